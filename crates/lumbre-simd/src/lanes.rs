//! The operations on lanes.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

/// The most lanes that any instruction set has.
pub const MAX_LANES: usize = 16;

/// A truth value in each lane.
pub trait Mask:
    Copy + Debug + Send + Sync + 'static + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// One bit a lane, the first lane lowest.
    fn to_bitmask(self) -> u32;

    /// The inverse of [`Mask::to_bitmask`]; bits beyond the lanes are ignored.
    fn from_bitmask(bits: u32) -> Self;

    /// The first `n` lanes; all where `n` is larger.
    fn first(n: usize) -> Self;

    /// The same value in all lanes.
    #[inline(always)]
    fn splat(value: bool) -> Self {
        Self::from_bitmask(if value { u32::MAX } else { 0 })
    }

    /// Whether any lane is true.
    #[inline(always)]
    fn any(self) -> bool {
        self.to_bitmask() != 0
    }

    /// Whether all lanes are true.
    #[inline(always)]
    fn all(self) -> bool {
        (!self).to_bitmask() == 0
    }

    /// Whether no lane is true.
    #[inline(always)]
    fn none(self) -> bool {
        self.to_bitmask() == 0
    }

    /// The number of lanes that are true.
    #[inline(always)]
    fn count(self) -> usize {
        self.to_bitmask().count_ones() as usize
    }
}

/// A `u32` in each lane. Sums, differences and products wrap.
pub trait UInt:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + BitXor<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
{
    /// A truth value in each lane.
    type Mask: Mask;

    /// The same number in all lanes.
    fn splat(x: u32) -> Self;

    /// The first numbers of a slice.
    ///
    /// # Panics
    /// If the slice has fewer than there are lanes.
    fn from_slice(slice: &[u32]) -> Self;

    /// Writes all lanes to the start of a slice.
    ///
    /// # Panics
    /// If the slice has no room for all.
    fn copy_to_slice(self, slice: &mut [u32]);

    /// 0, 1, 2, …: each lane's own index.
    fn lane_indices() -> Self;

    /// Shifted left by `K` < 32 bits.
    fn shl<const K: u32>(self) -> Self;

    /// Shifted right by `K` < 32 bits; zeros come in.
    fn shr<const K: u32>(self) -> Self;

    /// self = other.
    fn simd_eq(self, other: Self) -> Self::Mask;

    /// self < other, unsigned.
    fn simd_lt(self, other: Self) -> Self::Mask;

    /// `a` where the mask is true, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// `table[index]` in each lane.
    ///
    /// # Panics
    /// If the index of any lane is outside of the table, or not below 2³¹.
    fn gather(table: &[u32], index: Self) -> Self;

    /// Writes the lanes of the mask to the start of a slice, in order and without gaps. What follows them, up to the
    /// number of lanes, is unspecified.
    ///
    /// # Panics
    /// If the slice has no room for all lanes.
    fn compress_store(self, mask: Self::Mask, slice: &mut [u32]);

    /// The largest of all lanes.
    fn reduce_max(self) -> u32;

    /// All lanes, and zeros up to [`MAX_LANES`].
    #[inline(always)]
    fn to_lanes(self) -> [u32; MAX_LANES] {
        let mut lanes = [0; MAX_LANES];
        self.copy_to_slice(&mut lanes);
        lanes
    }

    /// A vector of the same number of lanes.
    #[inline(always)]
    fn from_lanes(lanes: &[u32; MAX_LANES]) -> Self {
        Self::from_slice(lanes)
    }
}

/// An `f64` in each lane.
pub trait Double:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A truth value in each lane.
    type Mask: Mask;
    /// An `f32` in each lane.
    type Single;
    /// A `u32` in each lane.
    type UInt: UInt<Mask = Self::Mask>;

    /// The same number in all lanes.
    fn splat(x: f64) -> Self;

    /// The first numbers of a slice.
    ///
    /// # Panics
    /// If the slice has fewer than there are lanes.
    fn from_slice(slice: &[f64]) -> Self;

    /// Writes all lanes to the start of a slice.
    ///
    /// # Panics
    /// If the slice has no room for all.
    fn copy_to_slice(self, slice: &mut [f64]);

    /// The same numbers in double precision.
    fn from_single(single: Self::Single) -> Self;

    /// Rounded to the nearest number of single precision, ties to even.
    fn to_single(self) -> Self::Single;

    /// The absolute value.
    fn abs(self) -> Self;

    /// The square root.
    fn sqrt(self) -> Self;

    /// `if self < other { self } else { other }`.
    fn simd_min(self, other: Self) -> Self;

    /// `if self > other { self } else { other }`.
    fn simd_max(self, other: Self) -> Self;

    /// self < other.
    fn simd_lt(self, other: Self) -> Self::Mask;

    /// self ≤ other.
    fn simd_le(self, other: Self) -> Self::Mask;

    /// self > other.
    #[inline(always)]
    fn simd_gt(self, other: Self) -> Self::Mask {
        other.simd_lt(self)
    }

    /// self ≥ other.
    #[inline(always)]
    fn simd_ge(self, other: Self) -> Self::Mask {
        other.simd_le(self)
    }

    /// `a` where the mask is true, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// `table[index]` in each lane.
    ///
    /// # Panics
    /// If the index of any lane is outside of the table, or not below 2³¹.
    fn gather(table: &[f64], index: Self::UInt) -> Self;

    /// Writes the lanes of the mask to the start of a slice, in order and without gaps. What follows them, up to the
    /// number of lanes, is unspecified.
    ///
    /// # Panics
    /// If the slice has no room for all lanes.
    fn compress_store(self, mask: Self::Mask, slice: &mut [f64]);

    /// The absolute value of this with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;

    /// The next representable number in the direction of the sign of `along`: [`f64::next_up`] where that is positive,
    /// [`f64::next_down`] where it is negative. The number itself where `along` is 0 or NaN.
    fn next_towards_sign(self, along: Self) -> Self;

    /// All lanes, and zeros up to [`MAX_LANES`].
    #[inline(always)]
    fn to_lanes(self) -> [f64; MAX_LANES] {
        let mut lanes = [0.0; MAX_LANES];
        self.copy_to_slice(&mut lanes);
        lanes
    }

    /// A vector of the same number of lanes.
    #[inline(always)]
    fn from_lanes(lanes: &[f64; MAX_LANES]) -> Self {
        Self::from_slice(lanes)
    }
}

/// A piece of lane code that [`Real::call`] runs.
pub trait Task<R: Real>: Sized {
    /// What it returns.
    type Output;

    /// Does the work. To be `#[inline(always)]`, as all lane code.
    fn run(self) -> Self::Output;
}

/// An `f32` in each lane.
pub trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number of lanes: 1, 4, 8 or 16.
    const LANES: usize;
    /// A truth value in each lane.
    type Mask: Mask;
    /// A `u32` in each lane.
    type UInt: UInt<Mask = Self::Mask>;
    /// An `f64` in each lane.
    type Double: Double<Mask = Self::Mask, Single = Self, UInt = Self::UInt>;

    /// The same number in all lanes.
    fn splat(x: f32) -> Self;

    /// The first numbers of a slice.
    ///
    /// # Panics
    /// If the slice has fewer than there are lanes.
    fn from_slice(slice: &[f32]) -> Self;

    /// Writes all lanes to the start of a slice.
    ///
    /// # Panics
    /// If the slice has no room for all.
    fn copy_to_slice(self, slice: &mut [f32]);

    /// The square root; −0 of −0.
    fn sqrt(self) -> Self;

    /// The absolute value.
    fn abs(self) -> Self;

    /// `if self < other { self } else { other }`.
    fn simd_min(self, other: Self) -> Self;

    /// `if self > other { self } else { other }`.
    fn simd_max(self, other: Self) -> Self;

    /// The nearest whole number, ties to even.
    fn round_ties_even(self) -> Self;

    /// The largest whole number that is not above.
    fn floor(self) -> Self;

    /// self < other.
    fn simd_lt(self, other: Self) -> Self::Mask;

    /// self ≤ other.
    fn simd_le(self, other: Self) -> Self::Mask;

    /// self > other.
    #[inline(always)]
    fn simd_gt(self, other: Self) -> Self::Mask {
        other.simd_lt(self)
    }

    /// self ≥ other.
    #[inline(always)]
    fn simd_ge(self, other: Self) -> Self::Mask {
        other.simd_le(self)
    }

    /// self = other; −0 = 0.
    fn simd_eq(self, other: Self) -> Self::Mask;

    /// self ≠ other; true for NaN.
    #[inline(always)]
    fn simd_ne(self, other: Self) -> Self::Mask {
        !self.simd_eq(other)
    }

    /// `a` where the mask is true, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// The bits.
    fn to_bits(self) -> Self::UInt;

    /// The numbers with these bits.
    fn from_bits(bits: Self::UInt) -> Self;

    /// Rounded towards zero, as the bits of an `i32`; 2³¹ where that is outside of its range or NaN.
    fn to_int(self) -> Self::UInt;

    /// The nearest number to the `i32` with these bits, ties to even.
    fn from_int(int: Self::UInt) -> Self;

    /// `table[index]` in each lane.
    ///
    /// # Panics
    /// If the index of any lane is outside of the table, or not below 2³¹.
    fn gather(table: &[f32], index: Self::UInt) -> Self;

    /// Writes the lanes of the mask to the start of a slice, in order and without gaps. What follows them, up to the
    /// number of lanes, is unspecified.
    ///
    /// # Panics
    /// If the slice has no room for all lanes.
    fn compress_store(self, mask: Self::Mask, slice: &mut [f32]);

    /// Runs a task by a call instead of inlining it; the called function has the instruction set, too. For code that is
    /// long and used in several places: inlined in each it would compile for minutes.
    fn call<T: Task<Self>>(task: T) -> T::Output;

    /// 0 in all lanes.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }

    /// 1 in all lanes.
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }

    /// The number where the mask is true, else 0.
    #[inline(always)]
    fn or_zero(self, mask: Self::Mask) -> Self {
        Self::select(mask, self, Self::zero())
    }

    /// The absolute value of this with the sign of `sign`.
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let magnitude = self.to_bits() & Self::UInt::splat(0x7fff_ffff);
        Self::from_bits(magnitude | (sign.to_bits() & Self::UInt::splat(0x8000_0000)))
    }

    /// 1/self by a division: not an approximation.
    #[inline(always)]
    fn recip(self) -> Self {
        Self::one() / self
    }

    /// Whether this is neither infinite nor NaN.
    #[inline(always)]
    fn is_finite(self) -> Self::Mask {
        self.abs().simd_lt(Self::splat(f32::INFINITY))
    }

    /// All lanes, and zeros up to [`MAX_LANES`].
    #[inline(always)]
    fn to_lanes(self) -> [f32; MAX_LANES] {
        let mut lanes = [0.0; MAX_LANES];
        self.copy_to_slice(&mut lanes);
        lanes
    }

    /// A vector of the same number of lanes.
    #[inline(always)]
    fn from_lanes(lanes: &[f32; MAX_LANES]) -> Self {
        Self::from_slice(lanes)
    }
}
