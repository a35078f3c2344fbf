//! One lane: `f32`, `f64`, `bool` and a wrapping `u32`.

use std::num::Wrapping;

use crate::{Double, Mask, Real, Task, UInt};

impl Mask for bool {
    #[inline(always)]
    fn to_bitmask(self) -> u32 {
        u32::from(self)
    }

    #[inline(always)]
    fn from_bitmask(bits: u32) -> Self {
        bits & 1 != 0
    }

    #[inline(always)]
    fn first(n: usize) -> Self {
        n > 0
    }
}

/// What the three kinds of numbers have alike.
macro_rules! memory {
    ($number:ty, $new:expr, $of:expr) => {
        #[inline(always)]
        fn splat(x: $number) -> Self {
            $new(x)
        }

        #[inline(always)]
        fn from_slice(slice: &[$number]) -> Self {
            $new(slice[0])
        }

        #[inline(always)]
        fn copy_to_slice(self, slice: &mut [$number]) {
            slice[0] = $of(self);
        }

        #[inline(always)]
        fn select(mask: bool, a: Self, b: Self) -> Self {
            if mask { a } else { b }
        }

        #[inline(always)]
        fn gather(table: &[$number], index: Wrapping<u32>) -> Self {
            $new(table[index.0 as usize])
        }

        #[inline(always)]
        fn compress_store(self, mask: bool, slice: &mut [$number]) {
            if mask {
                slice[0] = $of(self);
            } else {
                assert!(!slice.is_empty(), "room for all lanes");
            }
        }
    };
}

impl UInt for Wrapping<u32> {
    type Mask = bool;

    memory!(u32, Wrapping, number_of);

    #[inline(always)]
    fn lane_indices() -> Self {
        Wrapping(0)
    }

    #[inline(always)]
    fn shl<const K: u32>(self) -> Self {
        Wrapping(self.0 << K)
    }

    #[inline(always)]
    fn shr<const K: u32>(self) -> Self {
        Wrapping(self.0 >> K)
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> bool {
        self.0 == other.0
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> bool {
        self.0 < other.0
    }

    #[inline(always)]
    fn reduce_max(self) -> u32 {
        self.0
    }
}

#[inline(always)]
fn number_of(x: Wrapping<u32>) -> u32 {
    x.0
}

impl Double for f64 {
    type Mask = bool;
    type Single = f32;
    type UInt = Wrapping<u32>;

    memory!(f64, f64::from, f64::from);

    #[inline(always)]
    fn from_single(single: f32) -> Self {
        f64::from(single)
    }

    #[inline(always)]
    fn to_single(self) -> f32 {
        self as f32
    }

    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        f64::copysign(self, sign)
    }

    #[inline(always)]
    fn next_towards_sign(self, along: Self) -> Self {
        if along > 0.0 {
            self.next_up()
        } else if along < 0.0 {
            self.next_down()
        } else {
            self
        }
    }
}

impl Real for f32 {
    const LANES: usize = 1;
    type Mask = bool;
    type UInt = Wrapping<u32>;
    type Double = f64;

    memory!(f32, f32::from, f32::from);

    #[inline(always)]
    fn call<T: Task<Self>>(task: T) -> T::Output {
        task.run_called()
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        f32::abs(self)
    }

    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    // The standard library's calls a function where the processor is only known to have SSE2.
    #[inline(always)]
    fn round_ties_even(self) -> Self {
        // From here on all numbers are whole. Next to it the spacing is 1, so the sum is rounded to a whole number.
        const WHOLE: f32 = 8_388_608.0;
        let size = f32::abs(self);
        let rounded = if size < WHOLE { (size + WHOLE) - WHOLE } else { size };
        f32::copysign(rounded, self)
    }

    #[inline(always)]
    fn floor(self) -> Self {
        let rounded = Real::round_ties_even(self);
        if rounded > self { rounded - 1.0 } else { rounded }
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> bool {
        self == other
    }

    #[inline(always)]
    fn to_bits(self) -> Wrapping<u32> {
        Wrapping(f32::to_bits(self))
    }

    #[inline(always)]
    fn from_bits(bits: Wrapping<u32>) -> Self {
        f32::from_bits(bits.0)
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn to_int(self) -> Wrapping<u32> {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_mm_cvttss_si32, _mm_set_ss};
            // SAFETY: every x86-64 processor has SSE. (`as` saturates, which costs more.)
            Wrapping(unsafe { _mm_cvttss_si32(_mm_set_ss(self)) }.cast_unsigned())
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            let is_in_range = f32::abs(self) < 2_147_483_648.0;
            Wrapping(if is_in_range { (self as i32).cast_unsigned() } else { 1 << 31 })
        }
    }

    #[inline(always)]
    fn from_int(int: Wrapping<u32>) -> Self {
        int.0.cast_signed() as f32
    }
}

/// A trait, so that each task is compiled with its own type.
trait Called: Task<f32> {
    #[inline(never)]
    fn run_called(self) -> Self::Output {
        self.run()
    }
}

impl<T: Task<f32>> Called for T {}
