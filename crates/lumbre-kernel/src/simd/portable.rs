//! Vectors for any machine: loops over arrays.

use std::ops::{Add, Div, Mul, Sub};

use bytemuck::Zeroable;

use super::vector::{AFTER_MIDDLE, BEFORE_MIDDLE, F32x8, F32x16, LANE_BITS, LANES, LastEight, Row, Vector};

#[derive(Clone, Copy, Zeroable)]
pub(crate) struct PortableVector<const N: usize>([f32; N]);
pub(crate) type Portable8 = PortableVector<8>;
pub(crate) type Portable16 = PortableVector<LANES>;

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
    type Half = Portable8;

    #[inline(always)]
    fn of_two(first: Portable8, second: Portable8) -> Self {
        let mut all = [0.0; LANES];
        for lane in 0..8 {
            (all[lane], all[8 + lane]) = (first.0[lane], second.0[lane]);
        }
        Self(all)
    }

    #[inline(always)]
    fn splat_two(first: f32, second: f32, _: LastEight) -> Self {
        Self::of_two(Portable8::splat(first), Portable8::splat(second))
    }

    #[inline(always)]
    fn half(&self, which: usize) -> Portable8 {
        let mut half = [0.0; 8];
        for (lane, one) in half.iter_mut().enumerate() {
            *one = self.0[8 * (which % 2) + lane];
        }
        PortableVector(half)
    }

    #[inline(always)]
    fn load(row: &[f32; LANES]) -> Self {
        Self(*row)
    }

    #[inline(always)]
    fn store(self, row: &mut Row<f32>) {
        row.0 = self.0;
    }

    #[inline(always)]
    fn rounded(row: &Row<f64>) -> Self {
        let mut all = [0.0; LANES];
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
        let mut all = [0.0; LANES];
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
        let (mut rounded, mut rest) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let exact = row.0[lane] - place;
            rounded[lane] = exact as f32;
            rest[lane] = (exact - f64::from(rounded[lane])) as f32;
        }
        (Self(rounded), Self(rest))
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        let mut most = self.0[0];
        for lane in 1..LANES {
            most = if self.0[lane] > most { self.0[lane] } else { most };
        }
        most
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
        for lane in 0..LANES {
            first.0[lane] = if mask >> lane & 1 != 0 { first.0[lane] } else { second.0[lane] };
        }
        first
    }

    #[inline(always)]
    fn bits_above(self, other: i32) -> u32 {
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= u32::from(bits_of(self.0[lane]) > other) << lane;
        }
        mask
    }

    #[inline(always)]
    fn with_bits(self, bits: u32) -> u32 {
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= u32::from(self.0[lane].to_bits() == bits) << lane;
        }
        mask
    }

    #[inline(always)]
    fn lanes_in_bits(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = f32::from_bits((bits_of(self.0[lane]) & !LANE_BITS | lane as i32) as u32);
        }
        self
    }

    #[inline(always)]
    fn bits(self) -> [i32; LANES] {
        let mut bits = [0; LANES];
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
