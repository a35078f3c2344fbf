//! Vectors of eight or sixteen numbers: one for each box, ray, triangle or bounding volume.

use std::mem::MaybeUninit;
use std::ops::{Add, Div, Index, Mul, Sub};

use bytemuck::Zeroable;

use super::opaque_number;

/// Lanes of a wide vector.
pub(crate) const LANES: usize = 16;

/// A stack entry: the key of a distance in the upper half, a reference in the lower. Entries order by distance.
#[inline(always)]
pub(crate) fn stack_entry(key: i32, reference: u32) -> i64 {
    (i64::from(key) << 32) | i64::from(reference)
}

/// An array that is aligned for vector loads.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Row<T>(pub(crate) [T; LANES]);

impl<T: Copy> Row<T> {
    #[inline(always)]
    pub(crate) const fn of(value: T) -> Self {
        Self([value; LANES])
    }
}

/// A vector of f32. A mask has a bit for each lane; comparisons with NaN are false.
pub(crate) trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Number of lanes.
    const COUNT: usize;
    /// The mask of all lanes.
    const ALL: u32 = (1 << Self::COUNT) - 1;
    type Array: Index<usize, Output = f32>;
    fn to_array(self) -> Self::Array;
    /// The value in all lanes.
    fn splat(value: f32) -> Self;
    /// `self * factor + summand`, fused or not, by instruction set.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// `summand - self * factor`, fused or not.
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self;
    /// `self * factor - other`, fused or not.
    fn mul_sub(self, factor: Self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    /// The smaller. If one is NaN, either may be returned.
    fn min(self, other: Self) -> Self;
    /// The larger. If one is NaN, either may be returned.
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// The larger of the absolute values.
    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        self.abs().max(other.abs())
    }
    /// Negated where `other` has its sign bit set.
    fn xor_sign(self, other: Self) -> Self;
    fn simd_le(self, other: Self) -> u32;
    fn simd_lt(self, other: Self) -> u32;
}

/// A vector of eight lanes.
pub(crate) trait F32x8: Vector<Array = [f32; 8]> + Zeroable {
    fn load(eight: &[f32; 8]) -> Self;
    /// The smallest of the lanes in the mask, none of which may be NaN; infinity for an empty mask.
    fn reduce_min(self, mask: u32) -> f32;
    /// The number in a lane.
    fn lane(self, lane: usize) -> f32;
}

/// A vector of sixteen lanes.
pub(crate) trait F32x16: Vector<Array = [f32; LANES]> + Zeroable {
    /// A vector of half the lanes.
    type Half: F32x8;
    /// `first` in lanes 0 to 7, `second` in lanes 8 to 15.
    fn of_two(first: Self::Half, second: Self::Half) -> Self;
    /// The number `first` in lanes 0 to 7, `second` in lanes 8 to 15.
    fn splat_two(first: f32, second: f32, last: LastEight) -> Self;
    /// Lanes 0 to 7 if `which` is 0, lanes 8 to 15 if it is 1.
    fn half(&self, which: usize) -> Self::Half;
    fn load(row: &[f32; LANES]) -> Self;
    fn store(self, row: &mut Row<f32>);
    /// The row, rounded to f32.
    fn rounded(row: &Row<f64>) -> Self;
    /// Whether all numbers of the row are equal; false if any is NaN.
    fn are_same(row: &Row<f64>) -> bool;
    /// `(row - place) * scale`, computed in f64, then rounded.
    fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self;
    /// `self - place`, computed in f64, then rounded.
    fn rounded_less(self, place: f64) -> Self;
    /// `row - place`, computed in f64: rounded, and the error of that rounding.
    fn parted_from(row: &Row<f64>, place: f64) -> (Self, Self);
    /// The largest lane. If one is NaN, any lane may be returned.
    fn reduce_max(self) -> f32;
    /// `reduce_max` of each of eight vectors.
    fn reduce_max_of_eight(vectors: [Self; 8]) -> [f32; 8];
    /// Whether all lanes are equal; false if any is NaN.
    fn are_equal(self) -> bool;
    /// In every lane the mean of lanes 5 and 10, which are opposite at the middle of a 4 by 4 square.
    fn midpoint(self) -> Self;
    /// Lane 0.
    fn first(self) -> f32;
    /// `first` in the lanes of the mask, `second` in the others; bits are preserved.
    fn select(mask: u32, first: Self, second: Self) -> Self;
    /// The larger if that is not negative; else any negative number. Some instruction sets compare faster as integers,
    /// whose order is that of floats from 0 up.
    #[inline(always)]
    fn max_nonneg(self, other: Self) -> Self {
        self.max(other)
    }
    /// The smaller if neither is negative; else any negative number.
    #[inline(always)]
    fn min_nonneg(self, other: Self) -> Self {
        self.min(other)
    }
    /// `simd_le` for a `self` that is not negative.
    #[inline(always)]
    fn le_nonneg(self, other: Self) -> u32 {
        self.simd_le(other)
    }
    /// Lanes whose bits, as `i32`, exceed `other`.
    fn bits_above(self, other: i32) -> u32;
    /// Lanes whose bits equal `bits`.
    fn with_bits(self, bits: u32) -> u32;
    /// With the index of each lane in its last four bits.
    fn lanes_in_bits(self) -> Self;
    fn bits(self) -> [i32; LANES];

    /// Eight lanes, chosen by indices of four bits each; the first index is in the lowest bits.
    #[inline(always)]
    fn swizzle(self, places: u32) -> Self::Half {
        let all = self.to_array();
        let mut eight = [0.0; 8];
        for (lane, one) in eight.iter_mut().enumerate() {
            *one = all[(places >> (4 * lane)) as usize % LANES];
        }
        Self::Half::load(&eight)
    }

    /// For each of the first four lanes of the mask, a stack entry of the lane's bits and its word. With fewer lanes,
    /// the rest is arbitrary.
    #[inline(always)]
    fn first_four(self, mask: u32, words: &[u32; LANES]) -> [i64; 4] {
        let bits = self.bits();
        let mut rest = mask;
        let mut four = [0; 4];
        for one in &mut four {
            let lane = rest.trailing_zeros() as usize % LANES;
            rest &= rest.wrapping_sub(1);
            *one = stack_entry(bits[lane], words[lane]);
        }
        four
    }

    /// Stores the entries of `first_four` in falling order, zeros last. Returns false and stores nothing if the
    /// instruction set has no instruction for it.
    #[inline(always)]
    fn store_four_descending(
        self,
        _mask: u32,
        _words: &[u32; LANES],
        _place: &mut [MaybeUninit<i64>; 4],
    ) -> bool {
        false
    }

    /// Stores the words of the lanes in the mask, in order, without gaps.
    #[inline(always)]
    fn put_chosen(mask: u32, words: &[u32; LANES], place: &mut [MaybeUninit<u32>; LANES]) {
        let mut rest = mask % (1 << LANES);
        let mut count = 0;
        while rest != 0 {
            place[count % LANES] = MaybeUninit::new(words[rest.trailing_zeros() as usize % LANES]);
            count += 1;
            rest &= rest - 1;
        }
    }
}

/// A mask of lanes 8 to 15 that is opaque to the compiler. With a known mask, it shuffles registers instead of loading
/// into each lane.
#[derive(Clone, Copy)]
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code, reason = "for AVX alone"))]
pub(crate) struct LastEight(u32);

impl LastEight {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self(opaque_number(0xff00))
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn mask(self) -> u16 {
        self.0 as u16
    }
}

/// Two lanes of a 4 by 4 square that are opposite at its middle.
pub(super) const BEFORE_MIDDLE: usize = 5;
pub(super) const AFTER_MIDDLE: usize = 10;

/// The last bits of a number, which may hold the index of its lane.
pub(crate) const LANE_BITS: i32 = LANES as i32 - 1;
