//! Four lanes of NEON, which every processor of the architecture aarch64 has.

#![allow(unsafe_code)]

use std::arch::aarch64::*;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

use crate::indices::check_indices;
use crate::{Double, Mask, Real, Task, UInt};

/// A trait, so that each task is compiled with its own type.
trait Called: Task<F32x4> {
    #[inline(never)]
    fn call_neon(self) -> Self::Output {
        self.run()
    }
}

impl<T: Task<F32x4>> Called for T {}

/// All bits of a lane are set, or none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask4(uint32x4_t);

#[derive(Clone, Copy, Debug)]
pub(crate) struct U32x4(uint32x4_t);

#[derive(Clone, Copy, Debug)]
pub(crate) struct F32x4(float32x4_t);

/// The first two lanes, and the others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F64x4([float64x2_t; 2]);

/// Instructions on registers.
macro_rules! registers {
    ($value:expr) => {{
        // SAFETY: they touch no memory, and every processor of this architecture has them.
        unsafe { $value }
    }};
}

/// Operators that are an instruction each.
macro_rules! operators {
    ($name:ident: $($trait:ident $method:ident $instruction:ident),*) => {
        $(
            impl $trait for $name {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    registers!(Self($instruction(self.0, other.0)))
                }
            }
        )*
    };
}

/// The same of two registers.
macro_rules! operators_by_two {
    ($name:ident: $($trait:ident $method:ident $instruction:ident),*) => {
        $(
            impl $trait for $name {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    registers!(Self([$instruction(self.0[0], other.0[0]), $instruction(self.0[1], other.0[1])]))
                }
            }
        )*
    };
}

// ---------------------------------------------------------------- masks

operators!(Mask4: BitAnd bitand vandq_u32, BitOr bitor vorrq_u32);

impl Not for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        registers!(Self(vmvnq_u32(self.0)))
    }
}

impl Mask for Mask4 {
    #[inline(always)]
    fn to_bitmask(self) -> u32 {
        registers!(vaddvq_u32(vandq_u32(self.0, lane_bits())))
    }

    #[inline(always)]
    fn from_bitmask(bits: u32) -> Self {
        registers!(Self(vtstq_u32(vdupq_n_u32(bits), lane_bits())))
    }

    #[inline(always)]
    fn first(n: usize) -> Self {
        U32x4::lane_indices().simd_lt(U32x4::splat(n.min(4) as u32))
    }
}

/// The bit of each lane in a mask of bits.
#[inline(always)]
fn lane_bits() -> uint32x4_t {
    four(&[1, 2, 4, 8])
}

#[inline(always)]
fn four(numbers: &[u32; 4]) -> uint32x4_t {
    // SAFETY: four numbers are there.
    unsafe { vld1q_u32(numbers.as_ptr()) }
}

impl Mask4 {
    /// For two doubles, and the other two.
    #[inline(always)]
    fn halves(self) -> [uint64x2_t; 2] {
        registers!({
            let lanes = vreinterpretq_s32_u32(self.0);
            let (low, high) = (vmovl_s32(vget_low_s32(lanes)), vmovl_high_s32(lanes));
            [vreinterpretq_u64_s64(low), vreinterpretq_u64_s64(high)]
        })
    }

    /// The inverse.
    #[inline(always)]
    fn of_halves(low: uint64x2_t, high: uint64x2_t) -> Self {
        registers!(Self(vuzp1q_u32(vreinterpretq_u32_u64(low), vreinterpretq_u32_u64(high))))
    }

    /// Where [`UInt::compress_store`] takes its bytes from.
    #[inline(always)]
    fn compression(self) -> uint8x16_t {
        let bytes = &COMPRESSIONS[self.to_bitmask() as usize % 16];
        // SAFETY: sixteen bytes are there.
        unsafe { vld1q_u8(bytes.as_ptr()) }
    }
}

/// For each mask, the bytes of the lanes that are set, in order.
static COMPRESSIONS: [[u8; 16]; 16] = {
    let mut all = [[0; 16]; 16];
    let mut mask = 0;
    while mask < 16 {
        let (mut count, mut byte) = (0, 0);
        while byte < 16 {
            if mask >> (byte / 4) & 1 == 1 {
                all[mask][count] = byte as u8;
                count += 1;
            }
            byte += 1;
        }
        mask += 1;
    }
    all
};

// ---------------------------------------------------------------- integers

operators!(U32x4: Add add vaddq_u32, Sub sub vsubq_u32, Mul mul vmulq_u32,
    BitXor bitxor veorq_u32, BitAnd bitand vandq_u32, BitOr bitor vorrq_u32);

impl UInt for U32x4 {
    type Mask = Mask4;

    #[inline(always)]
    fn splat(x: u32) -> Self {
        registers!(Self(vdupq_n_u32(x)))
    }

    #[inline(always)]
    fn from_slice(slice: &[u32]) -> Self {
        let slice = &slice[..4];
        // SAFETY: four numbers are there.
        unsafe { Self(vld1q_u32(slice.as_ptr())) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [u32]) {
        let slice = &mut slice[..4];
        // SAFETY: there is room for four numbers.
        unsafe { vst1q_u32(slice.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn lane_indices() -> Self {
        Self(four(&[0, 1, 2, 3]))
    }

    #[inline(always)]
    fn shl<const K: u32>(self) -> Self {
        registers!(Self(vshlq_u32(self.0, vdupq_n_s32(K.cast_signed()))))
    }

    #[inline(always)]
    fn shr<const K: u32>(self) -> Self {
        registers!(Self(vshlq_u32(self.0, vdupq_n_s32(-K.cast_signed()))))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask4 {
        registers!(Mask4(vceqq_u32(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask4 {
        registers!(Mask4(vcltq_u32(self.0, other.0)))
    }

    #[inline(always)]
    fn select(mask: Mask4, a: Self, b: Self) -> Self {
        registers!(Self(vbslq_u32(mask.0, a.0, b.0)))
    }

    #[inline(always)]
    fn gather(table: &[u32], index: Self) -> Self {
        Self::from_slice(&gathered(table, index))
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask4, slice: &mut [u32]) {
        registers!({
            let bytes = vqtbl1q_u8(vreinterpretq_u8_u32(self.0), mask.compression());
            Self(vreinterpretq_u32_u8(bytes)).copy_to_slice(slice);
        })
    }

    #[inline(always)]
    fn reduce_max(self) -> u32 {
        registers!(vmaxvq_u32(self.0))
    }
}

/// `table[index]` in each lane.
#[inline(always)]
fn gathered<T: Copy>(table: &[T], index: U32x4) -> [T; 4] {
    check_indices(index.reduce_max(), table.len());
    let mut lanes = [0; 4];
    index.copy_to_slice(&mut lanes);
    let [a, b, c, d] = lanes;
    // SAFETY: all indices are within the table.
    unsafe {
        [
            *table.get_unchecked(a as usize),
            *table.get_unchecked(b as usize),
            *table.get_unchecked(c as usize),
            *table.get_unchecked(d as usize),
        ]
    }
}

// ---------------------------------------------------------------- double precision

operators_by_two!(F64x4: Add add vaddq_f64, Sub sub vsubq_f64, Mul mul vmulq_f64, Div div vdivq_f64);

impl Neg for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        registers!(Self([vnegq_f64(self.0[0]), vnegq_f64(self.0[1])]))
    }
}

impl Double for F64x4 {
    type Mask = Mask4;
    type Single = F32x4;
    type UInt = U32x4;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        registers!(Self([vdupq_n_f64(x); 2]))
    }

    #[inline(always)]
    fn from_slice(slice: &[f64]) -> Self {
        let slice = &slice[..4];
        // SAFETY: four numbers are there.
        unsafe { Self([vld1q_f64(slice.as_ptr()), vld1q_f64(slice.as_ptr().add(2))]) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f64]) {
        let slice = &mut slice[..4];
        // SAFETY: there is room for four numbers.
        unsafe {
            vst1q_f64(slice.as_mut_ptr(), self.0[0]);
            vst1q_f64(slice.as_mut_ptr().add(2), self.0[1]);
        }
    }

    #[inline(always)]
    fn from_single(single: F32x4) -> Self {
        registers!(Self([vcvt_f64_f32(vget_low_f32(single.0)), vcvt_high_f64_f32(single.0)]))
    }

    #[inline(always)]
    fn to_single(self) -> F32x4 {
        registers!(F32x4(vcvt_high_f32_f64(vcvt_f32_f64(self.0[0]), self.0[1])))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        registers!(Self([vabsq_f64(self.0[0]), vabsq_f64(self.0[1])]))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        registers!(Self([vsqrtq_f64(self.0[0]), vsqrtq_f64(self.0[1])]))
    }

    // The instructions for the smaller and the larger order −0 below 0 and hand on NaN.
    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        Self::select(self.simd_lt(other), self, other)
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        Self::select(other.simd_lt(self), self, other)
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask4 {
        registers!(Mask4::of_halves(vcltq_f64(self.0[0], other.0[0]), vcltq_f64(self.0[1], other.0[1])))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask4 {
        registers!(Mask4::of_halves(vcleq_f64(self.0[0], other.0[0]), vcleq_f64(self.0[1], other.0[1])))
    }

    #[inline(always)]
    fn select(mask: Mask4, a: Self, b: Self) -> Self {
        registers!({
            let [low, high] = mask.halves();
            Self([vbslq_f64(low, a.0[0], b.0[0]), vbslq_f64(high, a.0[1], b.0[1])])
        })
    }

    #[inline(always)]
    fn gather(table: &[f64], index: U32x4) -> Self {
        Self::from_slice(&gathered(table, index))
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask4, slice: &mut [f64]) {
        let slice = &mut slice[..4];
        let mut lanes = [0.0; 4];
        self.copy_to_slice(&mut lanes);
        let (bits, mut count) = (mask.to_bitmask(), 0);
        for (lane, number) in lanes.into_iter().enumerate() {
            slice[count] = number;
            count += (bits >> lane & 1) as usize;
        }
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        registers!({
            let bit = vdupq_n_u64(1 << 63);
            Self([vbslq_f64(bit, sign.0[0], self.0[0]), vbslq_f64(bit, sign.0[1], self.0[1])])
        })
    }

    #[inline(always)]
    fn next_towards_sign(self, along: Self) -> Self {
        Self([next(self.0[0], along.0[0]), next(self.0[1], along.0[1])])
    }
}

#[inline(always)]
fn next(x: float64x2_t, along: float64x2_t) -> float64x2_t {
    registers!({
        let (is_negative, is_zero) = (vcltzq_f64(x), vceqzq_f64(x));
        let is_down = vcltzq_f64(along);
        let is_along = vorrq_u64(is_down, vcgtzq_f64(along));
        // Away from zero, bits read as an integer grow by 1; towards it they shrink: -1 has all bits set.
        let is_towards = veorq_u64(is_negative, is_down);
        let one = vdupq_n_u64(1);
        let moved = vaddq_u64(vreinterpretq_u64_f64(x), vorrq_u64(is_towards, one));
        // Both zeros become the smallest number with the sign.
        let smallest = vorrq_u64(one, vandq_u64(is_down, vdupq_n_u64(1 << 63)));
        let moved = vreinterpretq_f64_u64(vbslq_u64(is_zero, smallest, moved));
        // Infinity stays where it would grow, and NaN always.
        let is_finite = vcltq_f64(vabsq_f64(x), vdupq_n_f64(f64::INFINITY));
        let may_move = vandq_u64(vceqq_f64(x, x), vorrq_u64(is_finite, is_towards));
        vbslq_f64(vandq_u64(is_along, may_move), moved, x)
    })
}

// ---------------------------------------------------------------- single precision

operators!(F32x4: Add add vaddq_f32, Sub sub vsubq_f32, Mul mul vmulq_f32, Div div vdivq_f32);

impl Neg for F32x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        registers!(Self(vnegq_f32(self.0)))
    }
}

impl Real for F32x4 {
    const LANES: usize = 4;
    type Mask = Mask4;
    type UInt = U32x4;
    type Double = F64x4;

    #[inline(always)]
    fn call<T: Task<Self>>(task: T) -> T::Output {
        task.call_neon()
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        registers!(Self(vdupq_n_f32(x)))
    }

    #[inline(always)]
    fn from_slice(slice: &[f32]) -> Self {
        let slice = &slice[..4];
        // SAFETY: four numbers are there.
        unsafe { Self(vld1q_f32(slice.as_ptr())) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f32]) {
        let slice = &mut slice[..4];
        // SAFETY: there is room for four numbers.
        unsafe { vst1q_f32(slice.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        registers!(Self(vsqrtq_f32(self.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        registers!(Self(vabsq_f32(self.0)))
    }

    // As in double precision.
    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        Self::select(self.simd_lt(other), self, other)
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        Self::select(other.simd_lt(self), self, other)
    }

    #[inline(always)]
    fn round_ties_even(self) -> Self {
        registers!(Self(vrndnq_f32(self.0)))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        registers!(Self(vrndmq_f32(self.0)))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask4 {
        registers!(Mask4(vcltq_f32(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask4 {
        registers!(Mask4(vcleq_f32(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask4 {
        registers!(Mask4(vceqq_f32(self.0, other.0)))
    }

    #[inline(always)]
    fn select(mask: Mask4, a: Self, b: Self) -> Self {
        registers!(Self(vbslq_f32(mask.0, a.0, b.0)))
    }

    #[inline(always)]
    fn to_bits(self) -> U32x4 {
        registers!(U32x4(vreinterpretq_u32_f32(self.0)))
    }

    #[inline(always)]
    fn from_bits(bits: U32x4) -> Self {
        registers!(Self(vreinterpretq_f32_u32(bits.0)))
    }

    #[inline(always)]
    fn to_int(self) -> U32x4 {
        registers!({
            // The instruction goes to the nearest number of its range, and from NaN to 0.
            let is_in_range = self.abs().simd_lt(Self::splat(2_147_483_648.0));
            let int = U32x4(vreinterpretq_u32_s32(vcvtq_s32_f32(self.0)));
            U32x4::select(is_in_range, int, U32x4::splat(1 << 31))
        })
    }

    #[inline(always)]
    fn from_int(int: U32x4) -> Self {
        registers!(Self(vcvtq_f32_s32(vreinterpretq_s32_u32(int.0))))
    }

    #[inline(always)]
    fn gather(table: &[f32], index: U32x4) -> Self {
        Self::from_slice(&gathered(table, index))
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask4, slice: &mut [f32]) {
        registers!({
            let bytes = vqtbl1q_u8(vreinterpretq_u8_f32(self.0), mask.compression());
            Self(vreinterpretq_f32_u8(bytes)).copy_to_slice(slice);
        })
    }
}
