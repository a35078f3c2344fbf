//! Eight or sixteen numbers at once: those of as many boxes, rays, triangles or bounding volumes.

use std::mem::MaybeUninit;
use std::ops::{Add, Div, Index, Mul, Sub};

use bytemuck::Zeroable;

use super::opaque_number;

/// Those that are sixteen.
pub(crate) const LANES: usize = 16;

/// The key of a distance in the upper half, a reference in the lower: entries order by distance.
#[inline(always)]
pub(crate) fn stack_entry(key: i32, reference: u32) -> i64 {
    (i64::from(key) << 32) | i64::from(reference)
}

/// An array that can be loaded at once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Row<T>(pub(crate) [T; LANES]);

impl<T: Copy> Row<T> {
    #[inline(always)]
    pub(crate) const fn of(value: T) -> Self {
        Self([value; LANES])
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
pub(crate) trait F32x16: Vector<Array = [f32; LANES]> + Zeroable {
    /// Eight of them.
    type Half: F32x8;
    /// Eight, and eight others.
    fn of_two(first: Self::Half, second: Self::Half) -> Self;
    /// Eight times the one, and eight times the other.
    fn splat_two(first: f32, second: f32, last: LastEight) -> Self;
    /// The first eight, or the last: `which` is 0 or 1.
    fn half(&self, which: usize) -> Self::Half;
    fn load(row: &[f32; LANES]) -> Self;
    fn store(self, row: &mut Row<f32>);
    /// Rounded.
    fn rounded(row: &Row<f64>) -> Self;
    /// Whether all are as the first; a NaN is not.
    fn are_same(row: &Row<f64>) -> bool;
    /// From a place, in other units; rounded, after it was computed in double precision.
    fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self;
    /// The difference to a number in double precision, rounded once.
    fn rounded_less(self, place: f64) -> Self;
    /// Relative to a place: rounded, and the rounding error.
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
    fn bits(self) -> [i32; LANES];

    /// Eight of them, each by its place, of four bits; the first in the lowest.
    #[inline(always)]
    fn swizzle(self, places: u32) -> Self::Half {
        let all = self.to_array();
        let mut eight = [0.0; 8];
        for (lane, one) in eight.iter_mut().enumerate() {
            *one = all[(places >> (4 * lane)) as usize % LANES];
        }
        Self::Half::load(&eight)
    }

    /// Of the first four that the mask chooses, if there are as many, the bits above and the word in the same place below.
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

    /// Puts the first four of those there, the largest first, where there are instructions for that; where there are fewer, zeros behind
    /// them. False where there are none, and nothing is put.
    #[inline(always)]
    fn store_four_descending(
        self,
        _mask: u32,
        _words: &[u32; LANES],
        _place: &mut [MaybeUninit<i64>; 4],
    ) -> bool {
        false
    }

    /// Puts the words that the mask chooses there, in their order.
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

/// The last eight of sixteen, as a mask of which the compiler knows nothing: where it does know, it shuffles numbers
/// instead of reading each
/// to where it belongs.
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

/// Of sixteen in rows of four, two that are across from one another beside the middle.
pub(super) const BEFORE_MIDDLE: usize = 5;
pub(super) const AFTER_MIDDLE: usize = 10;

/// The last bits of a number, in which its place among sixteen may stand.
pub(crate) const LANE_BITS: i32 = LANES as i32 - 1;
