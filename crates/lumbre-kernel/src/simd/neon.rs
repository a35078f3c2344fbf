//! Vectors of NEON, which every processor of the architecture aarch64 has: four numbers in a register.

use std::arch::aarch64::*;
use std::ops::{Add, Div, Mul, Sub};

use bytemuck::Zeroable;

use super::vector::{AFTER_MIDDLE, BEFORE_MIDDLE, F32x8, F32x16, LANE_BITS, LANES, LastEight, Row, Vector};

/// Instructions on registers.
macro_rules! registers {
    ($value:expr) => {{
        // SAFETY: they touch no memory, and every processor of this architecture has them.
        unsafe { $value }
    }};
}

/// In `N` registers.
#[derive(Clone, Copy)]
pub(crate) struct NeonVector<const N: usize>([float32x4_t; N]);
pub(crate) type Neon8 = NeonVector<2>;
pub(crate) type Neon16 = NeonVector<4>;

// SAFETY: registers of numbers, of which 0 has no bits.
unsafe impl<const N: usize> Zeroable for NeonVector<N> {}

/// The number of each lane, and its bit in a mask, by registers.
static LANE_NUMBERS: [[u32; 4]; 4] = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11], [12, 13, 14, 15]];
static BITS: [[u32; 4]; 4] =
    [[1, 2, 4, 8], [16, 32, 64, 128], [256, 512, 1024, 2048], [4096, 8192, 16_384, 32_768]];

#[inline(always)]
fn four(numbers: &[u32; 4]) -> uint32x4_t {
    // SAFETY: as many are read.
    unsafe { vld1q_u32(numbers.as_ptr()) }
}

/// All bits of a lane where the mask has its own.
#[inline(always)]
fn lanes_of(mask: u32, register: usize) -> uint32x4_t {
    registers!(vtstq_u32(vdupq_n_u32(mask), four(&BITS[register])))
}

/// The inverse.
#[inline(always)]
fn mask_of<const N: usize>(lanes: [uint32x4_t; N]) -> u32 {
    registers!({
        let mut bits = vandq_u32(lanes[0], four(&BITS[0]));
        for i in 1..N {
            bits = vorrq_u32(bits, vandq_u32(lanes[i], four(&BITS[i])));
        }
        vaddvq_u32(bits)
    })
}

macro_rules! by_register {
    ($($trait:ident $name:ident $instruction:ident),*) => {
        $(
            impl<const N: usize> $trait for NeonVector<N> {
                type Output = Self;
                #[inline(always)]
                fn $name(mut self, other: Self) -> Self {
                    registers!({
                        for i in 0..N {
                            self.0[i] = $instruction(self.0[i], other.0[i]);
                        }
                        self
                    })
                }
            }
        )*
    };
}
by_register!(Add add vaddq_f32, Sub sub vsubq_f32, Mul mul vmulq_f32, Div div vdivq_f32);

impl<const N: usize> NeonVector<N> {
    #[inline(always)]
    fn first_number(self) -> f32 {
        registers!(vgetq_lane_f32::<0>(self.0[0]))
    }

    #[inline(always)]
    fn read<const COUNT: usize>(numbers: &[f32; COUNT]) -> Self {
        const { assert!(COUNT == 4 * N) };
        // SAFETY: in each turn four f32 are read, of four times as many as there are registers.
        unsafe {
            let mut all = [vdupq_n_f32(0.0); N];
            for (i, four) in all.iter_mut().enumerate() {
                *four = vld1q_f32(numbers.as_ptr().add(4 * i));
            }
            Self(all)
        }
    }

    #[inline(always)]
    fn write<const COUNT: usize>(self, numbers: &mut [f32; COUNT]) {
        const { assert!(COUNT == 4 * N) };
        for i in 0..N {
            // SAFETY: alike.
            unsafe { vst1q_f32(numbers.as_mut_ptr().add(4 * i), self.0[i]) };
        }
    }
}

macro_rules! vectors {
    ($name:ident, $registers:literal, $count:literal) => {
        impl Vector for $name {
            const COUNT: usize = $count;
            type Array = [f32; $count];

            #[inline(always)]
            fn to_array(self) -> [f32; $count] {
                let mut all = [0.0; $count];
                self.write(&mut all);
                all
            }

            #[inline(always)]
            fn splat(value: f32) -> Self {
                registers!(Self([vdupq_n_f32(value); $registers]))
            }

            #[inline(always)]
            fn mul_add(mut self, factor: Self, summand: Self) -> Self {
                registers!({
                    for i in 0..$registers {
                        self.0[i] = vfmaq_f32(summand.0[i], self.0[i], factor.0[i]);
                    }
                    self
                })
            }

            #[inline(always)]
            fn neg_mul_add(mut self, factor: Self, summand: Self) -> Self {
                registers!({
                    for i in 0..$registers {
                        self.0[i] = vfmsq_f32(summand.0[i], self.0[i], factor.0[i]);
                    }
                    self
                })
            }

            #[inline(always)]
            fn mul_sub(mut self, factor: Self, other: Self) -> Self {
                registers!({
                    for i in 0..$registers {
                        self.0[i] = vfmaq_f32(vnegq_f32(other.0[i]), self.0[i], factor.0[i]);
                    }
                    self
                })
            }

            #[inline(always)]
            fn sqrt(mut self) -> Self {
                registers!({
                    for i in 0..$registers {
                        self.0[i] = vsqrtq_f32(self.0[i]);
                    }
                    self
                })
            }

            #[inline(always)]
            fn min(mut self, other: Self) -> Self {
                registers!({
                    for i in 0..$registers {
                        self.0[i] = vminq_f32(self.0[i], other.0[i]);
                    }
                    self
                })
            }

            #[inline(always)]
            fn max(mut self, other: Self) -> Self {
                registers!({
                    for i in 0..$registers {
                        self.0[i] = vmaxq_f32(self.0[i], other.0[i]);
                    }
                    self
                })
            }

            #[inline(always)]
            fn abs(mut self) -> Self {
                registers!({
                    for i in 0..$registers {
                        self.0[i] = vabsq_f32(self.0[i]);
                    }
                    self
                })
            }

            #[inline(always)]
            fn xor_sign(mut self, other: Self) -> Self {
                registers!({
                    for i in 0..$registers {
                        let sign = vandq_u32(vreinterpretq_u32_f32(other.0[i]), vdupq_n_u32(1 << 31));
                        self.0[i] = vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(self.0[i]), sign));
                    }
                    self
                })
            }

            #[inline(always)]
            fn simd_le(self, other: Self) -> u32 {
                registers!({
                    let mut lanes = [vdupq_n_u32(0); $registers];
                    for i in 0..$registers {
                        lanes[i] = vcleq_f32(self.0[i], other.0[i]);
                    }
                    mask_of(lanes)
                })
            }

            #[inline(always)]
            fn simd_lt(self, other: Self) -> u32 {
                registers!({
                    let mut lanes = [vdupq_n_u32(0); $registers];
                    for i in 0..$registers {
                        lanes[i] = vcltq_f32(self.0[i], other.0[i]);
                    }
                    mask_of(lanes)
                })
            }
        }
    };
}
vectors!(Neon8, 2, 8);
vectors!(Neon16, 4, 16);

impl F32x8 for Neon8 {
    #[inline(always)]
    fn load(eight: &[f32; 8]) -> Self {
        Self::read(eight)
    }

    #[inline(always)]
    fn reduce_min(self, mask: u32) -> f32 {
        registers!({
            let none = vdupq_n_f32(f32::INFINITY);
            let low = vbslq_f32(lanes_of(mask, 0), self.0[0], none);
            vminvq_f32(vminq_f32(low, vbslq_f32(lanes_of(mask, 1), self.0[1], none)))
        })
    }

    #[inline(always)]
    fn lane(self, lane: usize) -> f32 {
        self.to_array()[lane % 8]
    }
}

/// Two numbers of a row, from this one on.
#[inline(always)]
fn two(row: &Row<f64>, first: usize) -> float64x2_t {
    let two = &row.0[first..first + 2];
    // SAFETY: as many are read.
    unsafe { vld1q_f64(two.as_ptr()) }
}

/// Rounded.
#[inline(always)]
fn rounded(first: float64x2_t, last: float64x2_t) -> float32x4_t {
    registers!(vcvt_high_f32_f64(vcvt_f32_f64(first), last))
}

impl F32x16 for Neon16 {
    type Half = Neon8;

    #[inline(always)]
    fn of_two(first: Neon8, second: Neon8) -> Self {
        Self([first.0[0], first.0[1], second.0[0], second.0[1]])
    }

    #[inline(always)]
    fn splat_two(first: f32, second: f32, _: LastEight) -> Self {
        Self::of_two(Neon8::splat(first), Neon8::splat(second))
    }

    #[inline(always)]
    fn half(&self, which: usize) -> Neon8 {
        let first = 2 * (which % 2);
        NeonVector([self.0[first], self.0[first + 1]])
    }

    #[inline(always)]
    fn load(row: &[f32; LANES]) -> Self {
        Self::read(row)
    }

    #[inline(always)]
    fn store(self, row: &mut Row<f32>) {
        self.write(&mut row.0);
    }

    #[inline(always)]
    fn rounded(row: &Row<f64>) -> Self {
        let mut all = Self::splat(0.0);
        for i in 0..4 {
            all.0[i] = rounded(two(row, 4 * i), two(row, 4 * i + 2));
        }
        all
    }

    #[inline(always)]
    fn are_same(row: &Row<f64>) -> bool {
        registers!({
            let first = vdupq_n_f64(row.0[0]);
            let mut are_same = vceqq_f64(two(row, 0), first);
            for i in 1..8 {
                are_same = vandq_u64(are_same, vceqq_f64(two(row, 2 * i), first));
            }
            vminvq_u32(vreinterpretq_u32_u64(are_same)) != 0
        })
    }

    #[inline(always)]
    fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self {
        registers!({
            let (place, scale) = (vdupq_n_f64(place), vdupq_n_f64(scale));
            let mut all = Self::splat(0.0);
            for i in 0..4 {
                let first = vmulq_f64(vsubq_f64(two(row, 4 * i), place), scale);
                all.0[i] = rounded(first, vmulq_f64(vsubq_f64(two(row, 4 * i + 2), place), scale));
            }
            all
        })
    }

    #[inline(always)]
    fn rounded_less(mut self, place: f64) -> Self {
        registers!({
            let place = vdupq_n_f64(place);
            for i in 0..4 {
                let first = vsubq_f64(vcvt_f64_f32(vget_low_f32(self.0[i])), place);
                self.0[i] = rounded(first, vsubq_f64(vcvt_high_f64_f32(self.0[i]), place));
            }
            self
        })
    }

    #[inline(always)]
    fn parted_from(row: &Row<f64>, place: f64) -> (Self, Self) {
        registers!({
            let place = vdupq_n_f64(place);
            let (mut all, mut rests) = (Self::splat(0.0), Self::splat(0.0));
            for i in 0..4 {
                let first = vsubq_f64(two(row, 4 * i), place);
                let last = vsubq_f64(two(row, 4 * i + 2), place);
                let four = rounded(first, last);
                let first_rest = vsubq_f64(first, vcvt_f64_f32(vget_low_f32(four)));
                all.0[i] = four;
                rests.0[i] = rounded(first_rest, vsubq_f64(last, vcvt_high_f64_f32(four)));
            }
            (all, rests)
        })
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        registers!({
            let [a, b, c, d] = self.0;
            vmaxvq_f32(vmaxq_f32(vmaxq_f32(a, b), vmaxq_f32(c, d)))
        })
    }

    #[inline(always)]
    fn reduce_max_of_eight(vectors: [Self; 8]) -> [f32; 8] {
        let mut most = [0.0; 8];
        for (most, one) in most.iter_mut().zip(vectors) {
            *most = one.reduce_max();
        }
        most
    }

    #[inline(always)]
    fn are_equal(self) -> bool {
        registers!({
            let first = vdupq_n_f32(self.first_number());
            let mut are_equal = vceqq_f32(self.0[0], first);
            for i in 1..4 {
                are_equal = vandq_u32(are_equal, vceqq_f32(self.0[i], first));
            }
            vminvq_u32(are_equal) != 0
        })
    }

    #[inline(always)]
    fn midpoint(self) -> Self {
        let all = self.to_array();
        Self::splat(0.5 * (all[BEFORE_MIDDLE] + all[AFTER_MIDDLE]))
    }

    #[inline(always)]
    fn first(self) -> f32 {
        self.first_number()
    }

    #[inline(always)]
    fn select(mask: u32, mut first: Self, second: Self) -> Self {
        registers!({
            for i in 0..4 {
                first.0[i] = vbslq_f32(lanes_of(mask, i), first.0[i], second.0[i]);
            }
            first
        })
    }

    #[inline(always)]
    fn bits_above(self, other: i32) -> u32 {
        registers!({
            let mut lanes = [vdupq_n_u32(0); 4];
            for i in 0..4 {
                lanes[i] = vcgtq_s32(vreinterpretq_s32_f32(self.0[i]), vdupq_n_s32(other));
            }
            mask_of(lanes)
        })
    }

    #[inline(always)]
    fn with_bits(self, bits: u32) -> u32 {
        registers!({
            let mut lanes = [vdupq_n_u32(0); 4];
            for i in 0..4 {
                lanes[i] = vceqq_u32(vreinterpretq_u32_f32(self.0[i]), vdupq_n_u32(bits));
            }
            mask_of(lanes)
        })
    }

    #[inline(always)]
    fn lanes_in_bits(mut self) -> Self {
        registers!({
            for i in 0..4 {
                let kept = vbicq_u32(vreinterpretq_u32_f32(self.0[i]), vdupq_n_u32(LANE_BITS as u32));
                self.0[i] = vreinterpretq_f32_u32(vorrq_u32(kept, four(&LANE_NUMBERS[i])));
            }
            self
        })
    }

    #[inline(always)]
    fn bits(self) -> [i32; LANES] {
        bytemuck::cast(self.to_array())
    }

    #[inline(always)]
    fn swizzle(self, places: u32) -> Neon8 {
        registers!({
            let [a, b, c, d] = self.0;
            let [a, b] = [vreinterpretq_u8_f32(a), vreinterpretq_u8_f32(b)];
            let table = uint8x16x4_t(a, b, vreinterpretq_u8_f32(c), vreinterpretq_u8_f32(d));
            let mut eight = Neon8::splat(0.0);
            for i in 0..2 {
                // Of four bits each: shifted to the right, which is to the left by less than nothing.
                let shifts = vmulq_n_s32(vreinterpretq_s32_u32(four(&LANE_NUMBERS[i])), -4);
                let shifted = vshlq_u32(vdupq_n_u32(places), shifts);
                let numbers = vandq_u32(shifted, vdupq_n_u32(LANE_BITS as u32));
                // The four bytes of each.
                let bytes = vmlaq_u32(vdupq_n_u32(0x0302_0100), numbers, vdupq_n_u32(0x0404_0404));
                eight.0[i] = vreinterpretq_f32_u8(vqtbl4q_u8(table, vreinterpretq_u8_u32(bytes)));
            }
            eight
        })
    }
}
