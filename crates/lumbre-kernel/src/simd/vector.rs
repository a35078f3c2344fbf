//! Eight or sixteen numbers at once: those of as many boxes, rays, triangles or bounding volumes.

use std::mem::MaybeUninit;
use std::ops::{Add, Div, Index, Mul, Sub};

use bytemuck::Zeroable;

/// Those that are sixteen.
pub(crate) const WIDE: usize = 16;

/// The key of a distance in the upper half, a reference in the lower: entries order by distance.
#[inline(always)]
pub(crate) fn stack_entry(key: i32, reference: u32) -> i64 {
    (i64::from(key) << 32) | i64::from(reference)
}

/// An array that can be loaded at once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Row<T>(pub(crate) [T; WIDE]);

impl<T: Copy> Row<T> {
    #[inline(always)]
    pub(crate) const fn of(value: T) -> Self {
        Self([value; WIDE])
    }
}

/// Numbers side by side, for arithmetic. A mask has a bit for each; comparisons with a NaN are false.
pub(crate) trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many there are.
    const COUNT: usize;
    /// The mask of all.
    const ALL: u32 = (1 << Self::COUNT) - 1;
    type Array: Index<usize, Output = f32>;
    fn to_array(self) -> Self::Array;
    /// All the same.
    fn splat(value: f32) -> Self;
    /// `self * factor + summand`, rounded once or twice.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// `summand - self * factor`, alike.
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self;
    /// `self * factor - other`, alike.
    fn mul_sub(self, factor: Self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    /// Either where one of the two is a NaN.
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// The larger of the absolute values.
    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        self.abs().max(other.abs())
    }
    /// With the sign changed wherever the other has one.
    fn xor_sign(self, other: Self) -> Self;
    fn simd_le(self, other: Self) -> u32;
    fn simd_lt(self, other: Self) -> u32;
}

/// Eight.
pub(crate) trait F32x8: Vector<Array = [f32; 8]> + Zeroable {
    fn load(eight: &[f32; 8]) -> Self;
    /// The least of those in the mask, of which none is a NaN; infinity where there are none.
    fn reduce_min(self, mask: u32) -> f32;
    /// That in a lane.
    fn lane(self, lane: usize) -> f32;
}

/// Sixteen.
pub(crate) trait F32x16: Vector<Array = [f32; WIDE]> + Zeroable {
    fn load(row: &[f32; WIDE]) -> Self;
    fn store(self, row: &mut Row<f32>);
    /// Rounded.
    fn rounded(row: &Row<f64>) -> Self;
    /// Whether all are as the first; a NaN is not.
    fn are_same(row: &Row<f64>) -> bool;
    /// From a place, in other units; rounded, after it was computed in double precision.
    fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self;
    /// The difference to a number in double precision, rounded once.
    fn rounded_less(self, place: f64) -> Self;
    /// From a place, rounded, and what rounding took.
    fn parted_from(row: &Row<f64>, place: f64) -> (Self, Self);
    /// The largest of all; any of them where one is a NaN.
    fn reduce_max(self) -> f32;
    /// The same of each of eight.
    fn reduce_max_of_eight(them: [Self; 8]) -> [f32; 8];
    /// Whether all are the same number.
    fn are_equal(self) -> bool;
    /// Everywhere the place half way between two: those inside a square of four by four that are across from one another.
    fn midpoint(self) -> Self;
    /// The first of them.
    fn first(self) -> f32;
    /// The first where the mask has a bit, else the second; bit by bit.
    fn select(mask: u32, first: Self, second: Self) -> Self;
    /// The larger as far as that is not negative, else anything that is. Integers, which have the same order there, are compared
    /// faster where there are instructions for it.
    #[inline(always)]
    fn max_nonneg(self, other: Self) -> Self {
        self.max(other)
    }
    /// The smaller, or anything negative where one is.
    #[inline(always)]
    fn min_nonneg(self, other: Self) -> Self {
        self.min(other)
    }
    /// Where this, which is not negative, is no larger than the other.
    #[inline(always)]
    fn le_nonneg(self, other: Self) -> u32 {
        self.simd_le(other)
    }
    /// Where the bits are more, as an integer.
    fn bits_above(self, other: i32) -> u32;
    /// Where these are the bits.
    fn with_bits(self, bits: u32) -> u32;
    /// With each one's place in its last four bits.
    fn lanes_in_bits(self) -> Self;
    fn bits(self) -> [i32; WIDE];

    /// Of the first four that the mask chooses, if there are as many, the bits above and the word in the same place below.
    #[inline(always)]
    fn first_four(self, mask: u32, words: &[u32; WIDE]) -> [i64; 4] {
        let bits = self.bits();
        let mut rest = mask;
        let mut four = [0; 4];
        for one in &mut four {
            let lane = rest.trailing_zeros() as usize % WIDE;
            rest &= rest.wrapping_sub(1);
            *one = stack_entry(bits[lane], words[lane]);
        }
        four
    }

    /// Puts the first four of those there, the largest first, where there are instructions for that; where there are fewer, zeros behind
    /// them. False where there are none, and nothing is put.
    #[inline(always)]
    fn put_falling(self, _mask: u32, _words: &[u32; WIDE], _place: &mut [MaybeUninit<i64>; 4]) -> bool {
        false
    }

    /// Puts the words that the mask chooses there, in their order.
    #[inline(always)]
    fn put_chosen(mask: u32, words: &[u32; WIDE], place: &mut [MaybeUninit<u32>; WIDE]) {
        let mut rest = mask % (1 << WIDE);
        let mut count = 0;
        while rest != 0 {
            place[count % WIDE] = MaybeUninit::new(words[rest.trailing_zeros() as usize % WIDE]);
            count += 1;
            rest &= rest - 1;
        }
    }
}

#[derive(Clone, Copy, Zeroable)]
pub(crate) struct PortableVector<const N: usize>([f32; N]);
pub(crate) type Portable8 = PortableVector<8>;
pub(crate) type Portable16 = PortableVector<WIDE>;

macro_rules! by_lane {
    ($name:ident, $trait:ident, $operator:tt) => {
        impl<const N: usize> $trait for PortableVector<N> {
            type Output = Self;
            #[inline(always)]
            fn $name(mut self, other: Self) -> Self {
                for lane in 0..N {
                    self.0[lane] $operator other.0[lane];
                }
                self
            }
        }
    };
}
by_lane!(add, Add, +=);
by_lane!(sub, Sub, -=);
by_lane!(mul, Mul, *=);
by_lane!(div, Div, /=);

impl<const N: usize> Vector for PortableVector<N> {
    const COUNT: usize = N;
    type Array = [f32; N];

    #[inline(always)]
    fn to_array(self) -> [f32; N] {
        self.0
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        self * factor + summand
    }

    #[inline(always)]
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self {
        summand - self * factor
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, other: Self) -> Self {
        self * factor - other
    }

    #[inline(always)]
    fn sqrt(mut self) -> Self {
        for lane in 0..N {
            self.0[lane] = self.0[lane].sqrt();
        }
        self
    }

    #[inline(always)]
    fn min(mut self, other: Self) -> Self {
        for lane in 0..N {
            self.0[lane] = if self.0[lane] < other.0[lane] { self.0[lane] } else { other.0[lane] };
        }
        self
    }

    #[inline(always)]
    fn max(mut self, other: Self) -> Self {
        for lane in 0..N {
            self.0[lane] = if self.0[lane] > other.0[lane] { self.0[lane] } else { other.0[lane] };
        }
        self
    }

    #[inline(always)]
    fn abs(mut self) -> Self {
        for lane in 0..N {
            self.0[lane] = self.0[lane].abs();
        }
        self
    }

    #[inline(always)]
    fn xor_sign(mut self, other: Self) -> Self {
        for lane in 0..N {
            self.0[lane] = f32::from_bits(self.0[lane].to_bits() ^ other.0[lane].to_bits() & (1 << 31));
        }
        self
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> u32 {
        let mut mask = 0;
        for lane in 0..N {
            mask |= u32::from(self.0[lane] <= other.0[lane]) << lane;
        }
        mask
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> u32 {
        let mut mask = 0;
        for lane in 0..N {
            mask |= u32::from(self.0[lane] < other.0[lane]) << lane;
        }
        mask
    }
}

impl F32x8 for Portable8 {
    #[inline(always)]
    fn load(eight: &[f32; 8]) -> Self {
        Self(*eight)
    }

    #[inline(always)]
    fn reduce_min(self, mask: u32) -> f32 {
        let mut least = f32::INFINITY;
        for lane in 0..8 {
            least = if mask >> lane & 1 != 0 && self.0[lane] < least { self.0[lane] } else { least };
        }
        least
    }

    #[inline(always)]
    fn lane(self, lane: usize) -> f32 {
        self.0[lane % 8]
    }
}

impl F32x16 for Portable16 {
    #[inline(always)]
    fn load(row: &[f32; WIDE]) -> Self {
        Self(*row)
    }

    #[inline(always)]
    fn store(self, row: &mut Row<f32>) {
        row.0 = self.0;
    }

    #[inline(always)]
    fn rounded(row: &Row<f64>) -> Self {
        let mut all = [0.0; WIDE];
        for (one, exact) in all.iter_mut().zip(row.0) {
            *one = exact as f32;
        }
        Self(all)
    }

    #[inline(always)]
    fn are_same(row: &Row<f64>) -> bool {
        let mut are_same = true;
        for one in row.0 {
            are_same &= one == row.0[0];
        }
        are_same
    }

    #[inline(always)]
    fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self {
        let mut all = [0.0; WIDE];
        for (one, exact) in all.iter_mut().zip(row.0) {
            *one = ((exact - place) * scale) as f32;
        }
        Self(all)
    }

    #[inline(always)]
    fn rounded_less(mut self, place: f64) -> Self {
        for one in &mut self.0 {
            *one = (f64::from(*one) - place) as f32;
        }
        self
    }

    #[inline(always)]
    fn parted_from(row: &Row<f64>, place: f64) -> (Self, Self) {
        let (mut rounded, mut rest) = ([0.0; WIDE], [0.0; WIDE]);
        for lane in 0..WIDE {
            let exact = row.0[lane] - place;
            rounded[lane] = exact as f32;
            rest[lane] = (exact - f64::from(rounded[lane])) as f32;
        }
        (Self(rounded), Self(rest))
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        let mut most = self.0[0];
        for lane in 1..WIDE {
            most = if self.0[lane] > most { self.0[lane] } else { most };
        }
        most
    }

    #[inline(always)]
    fn reduce_max_of_eight(them: [Self; 8]) -> [f32; 8] {
        let mut most = [0.0; 8];
        for (most, one) in most.iter_mut().zip(them) {
            *most = one.reduce_max();
        }
        most
    }

    #[inline(always)]
    fn are_equal(self) -> bool {
        let mut are_equal = true;
        for one in self.0 {
            are_equal &= one == self.0[0];
        }
        are_equal
    }

    #[inline(always)]
    fn midpoint(self) -> Self {
        Self::splat(0.5 * (self.0[BEFORE_MIDDLE] + self.0[AFTER_MIDDLE]))
    }

    #[inline(always)]
    fn first(self) -> f32 {
        self.0[0]
    }

    #[inline(always)]
    fn select(mask: u32, mut first: Self, second: Self) -> Self {
        for lane in 0..WIDE {
            first.0[lane] = if mask >> lane & 1 != 0 { first.0[lane] } else { second.0[lane] };
        }
        first
    }

    #[inline(always)]
    fn bits_above(self, other: i32) -> u32 {
        let mut mask = 0;
        for lane in 0..WIDE {
            mask |= u32::from(bits_of(self.0[lane]) > other) << lane;
        }
        mask
    }

    #[inline(always)]
    fn with_bits(self, bits: u32) -> u32 {
        let mut mask = 0;
        for lane in 0..WIDE {
            mask |= u32::from(self.0[lane].to_bits() == bits) << lane;
        }
        mask
    }

    #[inline(always)]
    fn lanes_in_bits(mut self) -> Self {
        for lane in 0..WIDE {
            self.0[lane] = f32::from_bits((bits_of(self.0[lane]) & !LANE_BITS | lane as i32) as u32);
        }
        self
    }

    #[inline(always)]
    fn bits(self) -> [i32; WIDE] {
        let mut bits = [0; WIDE];
        for (bits, number) in bits.iter_mut().zip(self.0) {
            *bits = bits_of(number);
        }
        bits
    }
}

#[inline(always)]
fn bits_of(number: f32) -> i32 {
    number.to_bits() as i32
}

/// Of sixteen in rows of four, two that are across from one another beside the middle.
const BEFORE_MIDDLE: usize = 5;
const AFTER_MIDDLE: usize = 10;

/// The last bits of a number, in which its place among sixteen may stand.
pub(crate) const LANE_BITS: i32 = WIDE as i32 - 1;

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512, Eight256};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;
    use std::mem::MaybeUninit;
    use std::ops::{Add, Div, Mul, Sub};

    use bytemuck::Zeroable;

    use super::{AFTER_MIDDLE, BEFORE_MIDDLE, F32x8, F32x16, LANE_BITS, Row, Vector, WIDE};
    use crate::simd::opaque_number;

    /// Only where `intersect::x86::X86<true>` is: the instructions are there.
    #[derive(Clone, Copy)]
    pub(crate) struct Avx512(__m512);

    // SAFETY: sixteen zeros are sixteen numbers.
    unsafe impl Zeroable for Avx512 {}

    /// Only where `intersect::x86::X86<false>` is, alike.
    #[derive(Clone, Copy, Zeroable)]
    pub(crate) struct Avx2([__m256; 2]);

    /// Only where `intersect::x86::X86<AVX512>` is.
    #[derive(Clone, Copy, Zeroable)]
    pub(crate) struct Eight256<const AVX512: bool>(__m256);

    const SIGN: i32 = i32::MIN;

    macro_rules! operator {
        ($name:ident, $trait:ident, $wide:ident, $half:ident) => {
            impl $trait for Avx512 {
                type Output = Self;
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: see the type.
                    unsafe { Self($wide(self.0, other.0)) }
                }
            }
            impl<const AVX512: bool> $trait for Eight256<AVX512> {
                type Output = Self;
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: see the type.
                    unsafe { Self($half(self.0, other.0)) }
                }
            }
            impl $trait for Avx2 {
                type Output = Self;
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: see the type.
                    unsafe { Self([$half(self.0[0], other.0[0]), $half(self.0[1], other.0[1])]) }
                }
            }
        };
    }
    operator!(add, Add, _mm512_add_ps, _mm256_add_ps);
    operator!(sub, Sub, _mm512_sub_ps, _mm256_sub_ps);
    operator!(mul, Mul, _mm512_mul_ps, _mm256_mul_ps);
    operator!(div, Div, _mm512_div_ps, _mm256_div_ps);

    macro_rules! by_one {
        ($name:ident($($other:ident),*) $instruction:ident) => {
            #[inline(always)]
            fn $name(self $(, $other: Self)*) -> Self {
                // SAFETY: see the type.
                unsafe { Self($instruction(self.0 $(, $other.0)*)) }
            }
        };
    }

    impl Vector for Avx512 {
        const COUNT: usize = WIDE;
        type Array = [f32; WIDE];

        #[inline(always)]
        fn to_array(self) -> [f32; WIDE] {
            let mut row = Row::of(0.0);
            self.store(&mut row);
            row.0
        }

        by_one!(mul_add(factor, summand) _mm512_fmadd_ps);
        by_one!(neg_mul_add(factor, summand) _mm512_fnmadd_ps);
        by_one!(mul_sub(factor, other) _mm512_fmsub_ps);
        by_one!(sqrt() _mm512_sqrt_ps);
        by_one!(min(other) _mm512_min_ps);
        by_one!(max(other) _mm512_max_ps);

        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: see the type.
            unsafe { Self(_mm512_set1_ps(value)) }
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see the type.
            unsafe { Self(_mm512_abs_ps(self.0)) }
        }

        #[inline(always)]
        fn max_abs(self, other: Self) -> Self {
            // The maximum by magnitude, without its sign.
            // SAFETY: see the type.
            unsafe { Self(_mm512_range_ps::<0b1011>(self.0, other.0)) }
        }

        #[inline(always)]
        fn xor_sign(self, other: Self) -> Self {
            // SAFETY: see the type.
            unsafe {
                let sign = _mm512_and_ps(other.0, _mm512_castsi512_ps(_mm512_set1_epi32(SIGN)));
                Self(_mm512_xor_ps(self.0, sign))
            }
        }

        #[inline(always)]
        fn simd_le(self, other: Self) -> u32 {
            // SAFETY: see the type.
            unsafe { u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0)) }
        }

        #[inline(always)]
        fn simd_lt(self, other: Self) -> u32 {
            // SAFETY: see the type.
            unsafe { u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0)) }
        }
    }

    impl F32x16 for Avx512 {
        #[inline(always)]
        fn load(row: &[f32; WIDE]) -> Self {
            // SAFETY: see the type. The load is of sixteen f32.
            unsafe { Self(_mm512_loadu_ps(row.as_ptr())) }
        }

        #[inline(always)]
        fn store(self, row: &mut Row<f32>) {
            // SAFETY: see the type. The store is of sixteen f32.
            unsafe { _mm512_storeu_ps(row.0.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn rounded(row: &Row<f64>) -> Self {
            // SAFETY: see the type. The loads are of eight f64 each, of sixteen.
            unsafe {
                let low = _mm512_loadu_pd(row.0.as_ptr());
                Self::of_halves(low, _mm512_loadu_pd(row.0.as_ptr().add(WIDE / 2)))
            }
        }

        #[inline(always)]
        fn are_same(row: &Row<f64>) -> bool {
            // SAFETY: see the type. The loads are of eight f64 each, of sixteen.
            unsafe {
                let first = _mm512_set1_pd(row.0[0]);
                let low = _mm512_loadu_pd(row.0.as_ptr());
                let high = _mm512_loadu_pd(row.0.as_ptr().add(WIDE / 2));
                _mm512_cmp_pd_mask::<_CMP_NEQ_UQ>(low, first) | _mm512_cmp_pd_mask::<_CMP_NEQ_UQ>(high, first)
                    == 0
            }
        }

        #[inline(always)]
        fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self {
            // SAFETY: see the type. The loads are of eight f64 each, of sixteen.
            unsafe {
                let (place, scale) = (_mm512_set1_pd(place), _mm512_set1_pd(scale));
                let low = _mm512_sub_pd(_mm512_loadu_pd(row.0.as_ptr()), place);
                let high = _mm512_sub_pd(_mm512_loadu_pd(row.0.as_ptr().add(WIDE / 2)), place);
                Self::of_halves(_mm512_mul_pd(low, scale), _mm512_mul_pd(high, scale))
            }
        }

        #[inline(always)]
        fn rounded_less(self, place: f64) -> Self {
            // SAFETY: see the type.
            unsafe {
                let place = _mm512_set1_pd(place);
                let low = _mm512_cvtps_pd(_mm512_castps512_ps256(self.0));
                let high = _mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(self.0));
                Self::of_halves(_mm512_sub_pd(low, place), _mm512_sub_pd(high, place))
            }
        }

        #[inline(always)]
        fn parted_from(row: &Row<f64>, place: f64) -> (Self, Self) {
            // SAFETY: see the type. The loads are of eight f64 each, of sixteen.
            unsafe {
                let place = _mm512_set1_pd(place);
                let low = _mm512_sub_pd(_mm512_loadu_pd(row.0.as_ptr()), place);
                let high = _mm512_sub_pd(_mm512_loadu_pd(row.0.as_ptr().add(WIDE / 2)), place);
                let rounded = Self::of_halves(low, high);
                let low_rest = _mm512_sub_pd(low, _mm512_cvtps_pd(_mm512_castps512_ps256(rounded.0)));
                let high_rest = _mm512_sub_pd(high, _mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(rounded.0)));
                (rounded, Self::of_halves(low_rest, high_rest))
            }
        }

        #[inline(always)]
        fn reduce_max(self) -> f32 {
            // SAFETY: see the type.
            unsafe {
                let low = _mm512_castps512_ps256(self.0);
                max_of_eight(_mm256_max_ps(low, _mm512_extractf32x8_ps::<1>(self.0)))
            }
        }

        #[inline(always)]
        fn reduce_max_of_eight(them: [Self; 8]) -> [f32; 8] {
            let abcd = Self::max_of_four(them[0], them[1], them[2], them[3]);
            let efgh = Self::max_of_four(them[4], them[5], them[6], them[7]);
            let mut most = [0.0; 8];
            // SAFETY: see the type. The store is of eight f32.
            unsafe {
                let low = _mm512_shuffle_f32x4::<0b01_00_01_00>(abcd, efgh);
                let halves = _mm512_max_ps(low, _mm512_shuffle_f32x4::<0b11_10_11_10>(abcd, efgh));
                let even = _mm512_shuffle_f32x4::<0b10_00_10_00>(halves, halves);
                let all = _mm512_max_ps(even, _mm512_shuffle_f32x4::<0b11_01_11_01>(halves, halves));
                _mm256_storeu_ps(most.as_mut_ptr(), _mm512_castps512_ps256(all));
            }
            most
        }

        #[inline(always)]
        fn are_equal(self) -> bool {
            // SAFETY: see the type.
            unsafe {
                let first = _mm512_broadcastss_ps(_mm512_castps512_ps128(self.0));
                _mm512_cmp_ps_mask::<_CMP_NEQ_UQ>(self.0, first) == 0
            }
        }

        #[inline(always)]
        fn midpoint(self) -> Self {
            // SAFETY: see the type.
            unsafe {
                let before = _mm512_permutexvar_ps(_mm512_set1_epi32(BEFORE_MIDDLE as i32), self.0);
                let after = _mm512_permutexvar_ps(_mm512_set1_epi32(AFTER_MIDDLE as i32), self.0);
                Self(_mm512_mul_ps(_mm512_add_ps(before, after), _mm512_set1_ps(0.5)))
            }
        }

        #[inline(always)]
        fn first(self) -> f32 {
            // SAFETY: see the type.
            unsafe { _mm512_cvtss_f32(self.0) }
        }

        #[inline(always)]
        fn select(mask: u32, first: Self, second: Self) -> Self {
            // SAFETY: see the type.
            unsafe { Self(_mm512_mask_mov_ps(second.0, mask as u16, first.0)) }
        }

        #[inline(always)]
        fn max_nonneg(self, other: Self) -> Self {
            let (a, b) = (self.integers(), other.integers());
            // SAFETY: see the type.
            unsafe { Self(_mm512_castsi512_ps(_mm512_max_epi32(a, b))) }
        }

        #[inline(always)]
        fn min_nonneg(self, other: Self) -> Self {
            let (a, b) = (self.integers(), other.integers());
            // SAFETY: see the type.
            unsafe { Self(_mm512_castsi512_ps(_mm512_min_epi32(a, b))) }
        }

        #[inline(always)]
        fn le_nonneg(self, other: Self) -> u32 {
            // SAFETY: see the type.
            unsafe { u32::from(_mm512_cmple_epi32_mask(self.integers(), other.integers())) }
        }

        #[inline(always)]
        fn bits_above(self, other: i32) -> u32 {
            // SAFETY: see the type.
            unsafe { u32::from(_mm512_cmpgt_epi32_mask(self.integers(), _mm512_set1_epi32(other))) }
        }

        #[inline(always)]
        fn with_bits(self, bits: u32) -> u32 {
            // SAFETY: see the type.
            unsafe { u32::from(_mm512_cmpeq_epi32_mask(self.integers(), _mm512_set1_epi32(bits as i32))) }
        }

        #[inline(always)]
        fn lanes_in_bits(self) -> Self {
            // SAFETY: see the type.
            unsafe {
                let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
                let kept = _mm512_andnot_si512(_mm512_set1_epi32(LANE_BITS), self.integers());
                Self(_mm512_castsi512_ps(_mm512_or_si512(kept, lanes)))
            }
        }

        #[inline(always)]
        fn bits(self) -> [i32; WIDE] {
            let mut bits = [0; WIDE];
            // SAFETY: see the type. The store is of sixteen i32.
            unsafe { _mm512_storeu_si512(bits.as_mut_ptr().cast(), self.integers()) };
            bits
        }

        #[inline(always)]
        fn first_four(self, mask: u32, words: &[u32; WIDE]) -> [i64; 4] {
            // SAFETY: see the type. The load is of sixteen u32.
            unsafe {
                let words = _mm512_loadu_si512(words.as_ptr().cast());
                let bits = _mm512_castsi512_si128(_mm512_maskz_compress_epi32(mask as u16, self.integers()));
                let words = _mm512_castsi512_si128(_mm512_maskz_compress_epi32(mask as u16, words));
                let (two, more) = (_mm_unpacklo_epi32(words, bits), _mm_unpackhi_epi32(words, bits));
                let (a, b) = (_mm_cvtsi128_si64(two), _mm_extract_epi64::<1>(two));
                [a, b, _mm_cvtsi128_si64(more), _mm_extract_epi64::<1>(more)]
            }
        }

        #[inline(always)]
        fn put_falling(self, mask: u32, words: &[u32; WIDE], place: &mut [MaybeUninit<i64>; 4]) -> bool {
            // SAFETY: see the type. The load is of sixteen u32, the store of four i64.
            unsafe {
                let words = _mm512_loadu_si512(words.as_ptr().cast());
                let bits = _mm512_castsi512_si128(_mm512_maskz_compress_epi32(mask as u16, self.integers()));
                let words = _mm512_castsi512_si128(_mm512_maskz_compress_epi32(mask as u16, words));
                let (two, more) = (_mm_unpacklo_epi32(words, bits), _mm_unpackhi_epi32(words, bits));
                let four = _mm256_inserti128_si256::<1>(_mm256_castsi128_si256(two), more);
                let other = _mm256_permute4x64_epi64::<0b10_11_00_01>(four);
                let four = _mm256_mask_min_epi64(_mm256_max_epi64(four, other), 0b1010, four, other);
                let other = _mm256_permute4x64_epi64::<0b01_00_11_10>(four);
                let four = _mm256_mask_min_epi64(_mm256_max_epi64(four, other), 0b1100, four, other);
                let other = _mm256_permute4x64_epi64::<0b11_01_10_00>(four);
                let four = _mm256_mask_min_epi64(_mm256_max_epi64(four, other), 0b0100, four, other);
                _mm256_storeu_si256(place.as_mut_ptr().cast(), four);
            }
            true
        }

        #[inline(always)]
        fn put_chosen(mask: u32, words: &[u32; WIDE], place: &mut [MaybeUninit<u32>; WIDE]) {
            // SAFETY: see the type. The load and the store are of sixteen u32.
            unsafe {
                let words = _mm512_loadu_si512(words.as_ptr().cast());
                let chosen = _mm512_maskz_compress_epi32(mask as u16, words);
                _mm512_storeu_si512(place.as_mut_ptr().cast(), chosen);
            }
        }
    }

    impl Avx512 {
        /// Rounded.
        #[inline(always)]
        fn of_halves(low: __m512d, high: __m512d) -> Self {
            // SAFETY: see the type.
            unsafe {
                let low = _mm512_castps256_ps512(_mm512_cvtpd_ps(low));
                Self(_mm512_insertf32x8::<1>(low, _mm512_cvtpd_ps(high)))
            }
        }

        /// In every four lanes, the largest that four have in those.
        #[inline(always)]
        fn max_of_four(Self(a): Self, Self(b): Self, Self(c): Self, Self(d): Self) -> __m512 {
            // SAFETY: see the type.
            unsafe {
                let ab = _mm512_max_ps(_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
                let cd = _mm512_max_ps(_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
                let (ab, cd) = (_mm512_castps_pd(ab), _mm512_castps_pd(cd));
                let low = _mm512_castpd_ps(_mm512_unpacklo_pd(ab, cd));
                _mm512_max_ps(low, _mm512_castpd_ps(_mm512_unpackhi_pd(ab, cd)))
            }
        }

        #[inline(always)]
        fn integers(self) -> __m512i {
            // SAFETY: see the type.
            unsafe { _mm512_castps_si512(self.0) }
        }
    }

    /// # Safety
    /// There must be AVX2.
    #[inline(always)]
    unsafe fn max_of_eight(v: __m256) -> f32 {
        // SAFETY: see above.
        unsafe {
            let v = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
            let v = _mm_max_ps(v, _mm_movehl_ps(v, v));
            _mm_cvtss_f32(_mm_max_ss(v, _mm_movehdup_ps(v)))
        }
    }

    /// For each mask of eight, its lanes first.
    static LANES_OF: [[u8; 8]; 256] = {
        let mut lanes = [[0; 8]; 256];
        let mut mask = 0;
        while mask < 256 {
            let (mut lane, mut place) = (0, 0);
            while lane < 8 {
                if mask >> lane & 1 != 0 {
                    lanes[mask][place] = lane as u8;
                    place += 1;
                }
                lane += 1;
            }
            mask += 1;
        }
        lanes
    };

    impl Avx2 {
        #[inline(always)]
        fn quarters(row: &Row<f64>) -> [__m256d; 4] {
            let start = row.0.as_ptr();
            // SAFETY: see the type. The loads are of four f64 each, of sixteen.
            unsafe {
                [
                    _mm256_loadu_pd(start),
                    _mm256_loadu_pd(start.add(4)),
                    _mm256_loadu_pd(start.add(8)),
                    _mm256_loadu_pd(start.add(12)),
                ]
            }
        }

        /// Rounded.
        #[inline(always)]
        fn of_quarters([a, b, c, d]: [__m256d; 4]) -> Self {
            // SAFETY: see the type.
            unsafe {
                let low = _mm256_setr_m128(_mm256_cvtpd_ps(a), _mm256_cvtpd_ps(b));
                Self([low, _mm256_setr_m128(_mm256_cvtpd_ps(c), _mm256_cvtpd_ps(d))])
            }
        }

        /// In every four lanes of eight, the largest that four have in those or eight behind.
        #[inline(always)]
        fn max_of_four(a: Self, b: Self, c: Self, d: Self) -> __m256 {
            // SAFETY: see the type.
            unsafe {
                let a = _mm256_max_ps(a.0[0], a.0[1]);
                let b = _mm256_max_ps(b.0[0], b.0[1]);
                let c = _mm256_max_ps(c.0[0], c.0[1]);
                let d = _mm256_max_ps(d.0[0], d.0[1]);
                let ab = _mm256_max_ps(_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
                let cd = _mm256_max_ps(_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
                let (ab, cd) = (_mm256_castps_pd(ab), _mm256_castps_pd(cd));
                let low = _mm256_castpd_ps(_mm256_unpacklo_pd(ab, cd));
                _mm256_max_ps(low, _mm256_castpd_ps(_mm256_unpackhi_pd(ab, cd)))
            }
        }

        /// Of eight words from here on, those that the mask chooses first; the others mean nothing.
        ///
        /// # Safety
        /// There are as many.
        #[inline(always)]
        unsafe fn chosen(mask: u32, words: *const u32) -> __m256i {
            // SAFETY: see the type, and above. The other load is of one of the table's rows of eight bytes.
            unsafe {
                let lanes = _mm_loadl_epi64(LANES_OF[mask as usize % 256].as_ptr().cast());
                _mm256_permutevar8x32_epi32(_mm256_loadu_si256(words.cast()), _mm256_cvtepu8_epi32(lanes))
            }
        }

        #[inline(always)]
        fn integers(self) -> [__m256i; 2] {
            let [low, high] = self.0;
            // SAFETY: see the type.
            unsafe { [_mm256_castps_si256(low), _mm256_castps_si256(high)] }
        }

        #[inline(always)]
        fn of([low, high]: [__m256i; 2]) -> Self {
            // SAFETY: see the type.
            unsafe { Self([_mm256_castsi256_ps(low), _mm256_castsi256_ps(high)]) }
        }

        #[inline(always)]
        fn masks([low, high]: [__m256; 2]) -> u32 {
            // SAFETY: see the type.
            let (low, high) = unsafe { (_mm256_movemask_ps(low) as u32, _mm256_movemask_ps(high) as u32) };
            // Else the compiler puts the halves together first, which takes twice as long.
            low | opaque_number(high) << 8
        }
    }

    impl<const AVX512: bool> Vector for Eight256<AVX512> {
        const COUNT: usize = 8;
        type Array = [f32; 8];

        #[inline(always)]
        fn to_array(self) -> [f32; 8] {
            let mut eight = [0.0; 8];
            // SAFETY: see the type. The store is of eight f32.
            unsafe { _mm256_storeu_ps(eight.as_mut_ptr(), self.0) }
            eight
        }

        by_one!(mul_add(factor, summand) _mm256_fmadd_ps);
        by_one!(neg_mul_add(factor, summand) _mm256_fnmadd_ps);
        by_one!(mul_sub(factor, other) _mm256_fmsub_ps);
        by_one!(sqrt() _mm256_sqrt_ps);
        by_one!(min(other) _mm256_min_ps);
        by_one!(max(other) _mm256_max_ps);

        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: see the type.
            unsafe { Self(_mm256_set1_ps(value)) }
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see the type.
            unsafe { Self(_mm256_andnot_ps(_mm256_castsi256_ps(_mm256_set1_epi32(SIGN)), self.0)) }
        }

        #[inline(always)]
        fn max_abs(self, other: Self) -> Self {
            // SAFETY: see the type.
            unsafe {
                if AVX512 {
                    // The maximum by magnitude, without its sign.
                    return Self(_mm256_range_ps::<0b1011>(self.0, other.0));
                }
                // Numbers without a sign have the order of their bits. As integers, for that is done beside sums and comparisons, not
                // between them.
                let without_sign = _mm256_set1_epi32(i32::MAX);
                let a = _mm256_and_si256(_mm256_castps_si256(self.0), without_sign);
                let b = _mm256_and_si256(_mm256_castps_si256(other.0), without_sign);
                Self(_mm256_castsi256_ps(_mm256_max_epi32(a, b)))
            }
        }

        #[inline(always)]
        fn xor_sign(self, other: Self) -> Self {
            // SAFETY: see the type.
            unsafe {
                let sign = _mm256_and_ps(other.0, _mm256_castsi256_ps(_mm256_set1_epi32(SIGN)));
                Self(_mm256_xor_ps(self.0, sign))
            }
        }

        #[inline(always)]
        fn simd_le(self, other: Self) -> u32 {
            // SAFETY: see the type.
            unsafe {
                if AVX512 {
                    u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0))
                } else {
                    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32
                }
            }
        }

        #[inline(always)]
        fn simd_lt(self, other: Self) -> u32 {
            // SAFETY: see the type.
            unsafe {
                if AVX512 {
                    u32::from(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0))
                } else {
                    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) as u32
                }
            }
        }
    }

    impl Avx512 {
        /// # Safety
        /// There must be what `intersect::x86::X86<true>` has.
        #[inline(always)]
        pub(crate) unsafe fn new(sixteen: __m512) -> Self {
            Self(sixteen)
        }

        #[inline(always)]
        pub(crate) fn raw(self) -> __m512 {
            self.0
        }
    }

    impl<const AVX512: bool> Eight256<AVX512> {
        /// # Safety
        /// There must be what `intersect::x86::X86<AVX512>` has.
        #[inline(always)]
        pub(crate) unsafe fn new(eight: __m256) -> Self {
            Self(eight)
        }

        #[inline(always)]
        pub(crate) fn raw(self) -> __m256 {
            self.0
        }
    }

    impl<const AVX512: bool> F32x8 for Eight256<AVX512> {
        #[inline(always)]
        fn load(eight: &[f32; 8]) -> Self {
            // SAFETY: see the type. The load is of eight f32.
            unsafe { Self(_mm256_loadu_ps(eight.as_ptr())) }
        }

        #[inline(always)]
        fn reduce_min(self, mask: u32) -> f32 {
            // SAFETY: see the type.
            unsafe {
                let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
                let chosen = _mm256_and_si256(_mm256_set1_epi32(mask as i32), bits);
                let chosen = _mm256_castsi256_ps(_mm256_cmpeq_epi32(chosen, bits));
                let eight = _mm256_blendv_ps(_mm256_set1_ps(f32::INFINITY), self.0, chosen);
                let four = _mm_min_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
                let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
                _mm_cvtss_f32(_mm_min_ss(two, _mm_movehdup_ps(two)))
            }
        }

        #[inline(always)]
        fn lane(self, lane: usize) -> f32 {
            // SAFETY: see the type.
            unsafe { _mm256_cvtss_f32(_mm256_permutevar8x32_ps(self.0, _mm256_set1_epi32(lane as i32))) }
        }
    }

    macro_rules! by_halves {
        ($name:ident($($other:ident),*)) => {
            #[inline(always)]
            fn $name(self $(, $other: Self)*) -> Self {
                Self([
                    Eight256::<false>(self.0[0]).$name($(Eight256::<false>($other.0[0])),*).0,
                    Eight256::<false>(self.0[1]).$name($(Eight256::<false>($other.0[1])),*).0,
                ])
            }
        };
    }

    impl Vector for Avx2 {
        const COUNT: usize = WIDE;
        type Array = [f32; WIDE];

        #[inline(always)]
        fn to_array(self) -> [f32; WIDE] {
            let mut row = Row::of(0.0);
            self.store(&mut row);
            row.0
        }

        by_halves!(mul_add(factor, summand));
        by_halves!(neg_mul_add(factor, summand));
        by_halves!(mul_sub(factor, other));
        by_halves!(sqrt());
        by_halves!(min(other));
        by_halves!(max(other));
        by_halves!(abs());
        by_halves!(max_abs(other));
        by_halves!(xor_sign(other));

        #[inline(always)]
        fn splat(value: f32) -> Self {
            Self([Eight256::<false>::splat(value).0; 2])
        }

        #[inline(always)]
        fn simd_le(self, other: Self) -> u32 {
            let ([a, b], [c, d]) = (self.0, other.0);
            // SAFETY: see the type.
            unsafe { Self::masks([_mm256_cmp_ps::<_CMP_LE_OQ>(a, c), _mm256_cmp_ps::<_CMP_LE_OQ>(b, d)]) }
        }

        #[inline(always)]
        fn simd_lt(self, other: Self) -> u32 {
            let ([a, b], [c, d]) = (self.0, other.0);
            // SAFETY: see the type.
            unsafe { Self::masks([_mm256_cmp_ps::<_CMP_LT_OQ>(a, c), _mm256_cmp_ps::<_CMP_LT_OQ>(b, d)]) }
        }
    }

    impl F32x16 for Avx2 {
        #[inline(always)]
        fn load(row: &[f32; WIDE]) -> Self {
            // SAFETY: see the type. The loads are of eight f32 each, of sixteen.
            unsafe { Self([_mm256_loadu_ps(row.as_ptr()), _mm256_loadu_ps(row.as_ptr().add(8))]) }
        }

        #[inline(always)]
        fn store(self, row: &mut Row<f32>) {
            let [low, high] = self.0;
            // SAFETY: see the type. The stores are of eight f32 each, of sixteen.
            unsafe {
                _mm256_storeu_ps(row.0.as_mut_ptr(), low);
                _mm256_storeu_ps(row.0.as_mut_ptr().add(8), high);
            }
        }

        #[inline(always)]
        fn rounded(row: &Row<f64>) -> Self {
            Self::of_quarters(Self::quarters(row))
        }

        #[inline(always)]
        fn are_same(row: &Row<f64>) -> bool {
            let [a, b, c, d] = Self::quarters(row);
            // SAFETY: see the type.
            unsafe {
                let first = _mm256_set1_pd(row.0[0]);
                let low = _mm256_and_pd(
                    _mm256_cmp_pd::<_CMP_EQ_OQ>(a, first),
                    _mm256_cmp_pd::<_CMP_EQ_OQ>(b, first),
                );
                let high = _mm256_and_pd(
                    _mm256_cmp_pd::<_CMP_EQ_OQ>(c, first),
                    _mm256_cmp_pd::<_CMP_EQ_OQ>(d, first),
                );
                _mm256_movemask_pd(_mm256_and_pd(low, high)) == 0b1111
            }
        }

        #[inline(always)]
        fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self {
            let mut quarters = Self::quarters(row);
            for quarter in &mut quarters {
                // SAFETY: see the type.
                unsafe {
                    let from = _mm256_sub_pd(*quarter, _mm256_set1_pd(place));
                    *quarter = _mm256_mul_pd(from, _mm256_set1_pd(scale));
                }
            }
            Self::of_quarters(quarters)
        }

        #[inline(always)]
        fn rounded_less(self, place: f64) -> Self {
            let [low, high] = self.0;
            // SAFETY: see the type.
            unsafe {
                let place = _mm256_set1_pd(place);
                Self::of_quarters([
                    _mm256_sub_pd(_mm256_cvtps_pd(_mm256_castps256_ps128(low)), place),
                    _mm256_sub_pd(_mm256_cvtps_pd(_mm256_extractf128_ps::<1>(low)), place),
                    _mm256_sub_pd(_mm256_cvtps_pd(_mm256_castps256_ps128(high)), place),
                    _mm256_sub_pd(_mm256_cvtps_pd(_mm256_extractf128_ps::<1>(high)), place),
                ])
            }
        }

        #[inline(always)]
        fn parted_from(row: &Row<f64>, place: f64) -> (Self, Self) {
            let mut quarters = Self::quarters(row);
            for quarter in &mut quarters {
                // SAFETY: see the type.
                *quarter = unsafe { _mm256_sub_pd(*quarter, _mm256_set1_pd(place)) };
            }
            let rounded = Self::of_quarters(quarters);
            // SAFETY: see the type.
            unsafe {
                let [low, high] = rounded.0;
                let parts = [
                    _mm256_castps256_ps128(low),
                    _mm256_extractf128_ps::<1>(low),
                    _mm256_castps256_ps128(high),
                    _mm256_extractf128_ps::<1>(high),
                ];
                for (quarter, part) in quarters.iter_mut().zip(parts) {
                    *quarter = _mm256_sub_pd(*quarter, _mm256_cvtps_pd(part));
                }
            }
            (rounded, Self::of_quarters(quarters))
        }

        #[inline(always)]
        fn reduce_max(self) -> f32 {
            // SAFETY: see the type.
            unsafe { max_of_eight(_mm256_max_ps(self.0[0], self.0[1])) }
        }

        #[inline(always)]
        fn reduce_max_of_eight(them: [Self; 8]) -> [f32; 8] {
            let abcd = Self::max_of_four(them[0], them[1], them[2], them[3]);
            let efgh = Self::max_of_four(them[4], them[5], them[6], them[7]);
            let mut most = [0.0; 8];
            // SAFETY: see the type. The store is of eight f32.
            unsafe {
                let low = _mm256_permute2f128_ps::<0x20>(abcd, efgh);
                let all = _mm256_max_ps(low, _mm256_permute2f128_ps::<0x31>(abcd, efgh));
                _mm256_storeu_ps(most.as_mut_ptr(), all);
            }
            most
        }

        #[inline(always)]
        fn are_equal(self) -> bool {
            let [low, high] = self.0;
            // SAFETY: see the type.
            unsafe {
                let first = _mm256_broadcastss_ps(_mm256_castps256_ps128(low));
                let low = _mm256_cmp_ps::<_CMP_EQ_OQ>(low, first);
                let both = _mm256_and_ps(low, _mm256_cmp_ps::<_CMP_EQ_OQ>(high, first));
                _mm256_movemask_ps(both) == 0xff
            }
        }

        #[inline(always)]
        fn midpoint(self) -> Self {
            let [low, high] = self.0;
            // SAFETY: see the type.
            unsafe {
                let before = _mm256_permutevar8x32_ps(low, _mm256_set1_epi32(BEFORE_MIDDLE as i32));
                let after = _mm256_permutevar8x32_ps(high, _mm256_set1_epi32(AFTER_MIDDLE as i32 - 8));
                Self([_mm256_mul_ps(_mm256_add_ps(before, after), _mm256_set1_ps(0.5)); 2])
            }
        }

        #[inline(always)]
        fn first(self) -> f32 {
            // SAFETY: see the type.
            unsafe { _mm256_cvtss_f32(self.0[0]) }
        }

        #[inline(always)]
        fn select(mask: u32, first: Self, second: Self) -> Self {
            let ([a, b], [c, d]) = (first.0, second.0);
            // SAFETY: see the type.
            unsafe {
                let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
                let low = _mm256_and_si256(_mm256_set1_epi32(mask as i32), bits);
                let high = _mm256_and_si256(_mm256_set1_epi32((mask >> 8) as i32), bits);
                let low = _mm256_castsi256_ps(_mm256_cmpeq_epi32(low, bits));
                let high = _mm256_castsi256_ps(_mm256_cmpeq_epi32(high, bits));
                Self([_mm256_blendv_ps(c, a, low), _mm256_blendv_ps(d, b, high)])
            }
        }

        #[inline(always)]
        fn max_nonneg(self, other: Self) -> Self {
            let ([a, b], [c, d]) = (self.integers(), other.integers());
            // SAFETY: see the type.
            unsafe { Self::of([_mm256_max_epi32(a, c), _mm256_max_epi32(b, d)]) }
        }

        #[inline(always)]
        fn min_nonneg(self, other: Self) -> Self {
            let ([a, b], [c, d]) = (self.integers(), other.integers());
            // SAFETY: see the type.
            unsafe { Self::of([_mm256_min_epi32(a, c), _mm256_min_epi32(b, d)]) }
        }

        #[inline(always)]
        fn le_nonneg(self, other: Self) -> u32 {
            let ([a, b], [c, d]) = (self.integers(), other.integers());
            // SAFETY: see the type.
            let above = unsafe { Self::of([_mm256_cmpgt_epi32(a, c), _mm256_cmpgt_epi32(b, d)]) };
            Self::masks(above.0) ^ 0xffff
        }

        #[inline(always)]
        fn bits_above(self, other: i32) -> u32 {
            let [a, b] = self.integers();
            // SAFETY: see the type.
            unsafe {
                let other = _mm256_set1_epi32(other);
                let above = Self::of([_mm256_cmpgt_epi32(a, other), _mm256_cmpgt_epi32(b, other)]);
                Self::masks(above.0)
            }
        }

        #[inline(always)]
        fn with_bits(self, bits: u32) -> u32 {
            let [a, b] = self.integers();
            // SAFETY: see the type.
            unsafe {
                let bits = _mm256_set1_epi32(bits as i32);
                Self::masks(Self::of([_mm256_cmpeq_epi32(a, bits), _mm256_cmpeq_epi32(b, bits)]).0)
            }
        }

        #[inline(always)]
        fn lanes_in_bits(self) -> Self {
            let [a, b] = self.integers();
            // SAFETY: see the type.
            unsafe {
                let low = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
                let high = _mm256_setr_epi32(8, 9, 10, 11, 12, 13, 14, 15);
                let own = _mm256_set1_epi32(LANE_BITS);
                let (a, b) = (_mm256_andnot_si256(own, a), _mm256_andnot_si256(own, b));
                Self::of([_mm256_or_si256(a, low), _mm256_or_si256(b, high)])
            }
        }

        #[inline(always)]
        fn bits(self) -> [i32; WIDE] {
            let [low, high] = self.integers();
            let mut bits = [0; WIDE];
            // SAFETY: see the type. The stores are of eight i32 each, of sixteen.
            unsafe {
                _mm256_storeu_si256(bits.as_mut_ptr().cast(), low);
                _mm256_storeu_si256(bits.as_mut_ptr().add(8).cast(), high);
            }
            bits
        }

        #[inline(always)]
        fn put_chosen(mask: u32, words: &[u32; WIDE], place: &mut [MaybeUninit<u32>; WIDE]) {
            // SAFETY: see the type. The loads are of eight u32 each, of sixteen; so are the stores, the second no farther than eight on.
            unsafe {
                let (words, place) = (words.as_ptr(), place.as_mut_ptr());
                let of_low = (mask & 0xff).count_ones() as usize;
                _mm256_storeu_si256(place.cast(), Self::chosen(mask, words));
                _mm256_storeu_si256(place.add(of_low).cast(), Self::chosen(mask >> 8, words.add(8)));
            }
        }
    }
}
