//! Four lanes of WebAssembly's vectors of 128 bits, where a module is compiled with them (`simd128`).

#![allow(unsafe_code)]

use std::arch::wasm32::*;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

use crate::indices::check_indices;
use crate::{Double, Mask, Real, Task, UInt};

/// A trait, so that each task is compiled with its own type.
trait Called: Task<F32x4> {
    #[inline(never)]
    fn call_simd128(self) -> Self::Output {
        self.run()
    }
}

impl<T: Task<F32x4>> Called for T {}

/// All bits of a lane are set, or none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask4(v128);

#[derive(Clone, Copy, Debug)]
pub(crate) struct U32x4(v128);

#[derive(Clone, Copy, Debug)]
pub(crate) struct F32x4(v128);

/// The first two lanes, and the others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F64x4([v128; 2]);

/// Operators that are an instruction each.
macro_rules! operators {
    ($name:ident: $($trait:ident $method:ident $instruction:ident),*) => {
        $(
            impl $trait for $name {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    Self($instruction(self.0, other.0))
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
                    Self([$instruction(self.0[0], other.0[0]), $instruction(self.0[1], other.0[1])])
                }
            }
        )*
    };
}

/// The four numbers at the start of a slice.
#[inline(always)]
fn four<T: Copy>(slice: &[T]) -> v128 {
    const { assert!(size_of::<T>() == 4) };
    let slice = &slice[..4];
    // SAFETY: four numbers are there; the instruction takes any alignment.
    unsafe { v128_load(slice.as_ptr().cast()) }
}

/// Writes four numbers to the start of a slice.
#[inline(always)]
fn write_four<T: Copy>(register: v128, slice: &mut [T]) {
    const { assert!(size_of::<T>() == 4) };
    let slice = &mut slice[..4];
    // SAFETY: there is room for four numbers, of which all bits are valid; the instruction takes any alignment.
    unsafe { v128_store(slice.as_mut_ptr().cast(), register) }
}

// ---------------------------------------------------------------- masks

operators!(Mask4: BitAnd bitand v128_and, BitOr bitor v128_or);

impl Not for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(v128_not(self.0))
    }
}

impl Mask for Mask4 {
    #[inline(always)]
    fn to_bitmask(self) -> u32 {
        u32::from(u32x4_bitmask(self.0))
    }

    #[inline(always)]
    fn from_bitmask(bits: u32) -> Self {
        let own = u32x4(1, 2, 4, 8);
        Self(u32x4_eq(v128_and(u32x4_splat(bits), own), own))
    }

    #[inline(always)]
    fn first(n: usize) -> Self {
        U32x4::lane_indices().simd_lt(U32x4::splat(n.min(4) as u32))
    }
}

impl Mask4 {
    /// For two doubles, and the other two.
    #[inline(always)]
    fn halves(self) -> [v128; 2] {
        [i64x2_extend_low_i32x4(self.0), i64x2_extend_high_i32x4(self.0)]
    }

    /// The inverse.
    #[inline(always)]
    fn of_halves(low: v128, high: v128) -> Self {
        Self(u32x4_shuffle::<0, 2, 4, 6>(low, high))
    }
}

/// The lanes of the mask first, in order.
#[inline(always)]
fn compressed(register: v128, mask: Mask4) -> v128 {
    let bytes = &COMPRESSIONS[mask.to_bitmask() as usize % 16];
    // SAFETY: sixteen bytes are there.
    let bytes = unsafe { v128_load(bytes.as_ptr().cast()) };
    u8x16_swizzle(register, bytes)
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

operators!(U32x4: Add add u32x4_add, Sub sub u32x4_sub, Mul mul u32x4_mul,
    BitXor bitxor v128_xor, BitAnd bitand v128_and, BitOr bitor v128_or);

impl UInt for U32x4 {
    type Mask = Mask4;

    #[inline(always)]
    fn splat(x: u32) -> Self {
        Self(u32x4_splat(x))
    }

    #[inline(always)]
    fn from_slice(slice: &[u32]) -> Self {
        Self(four(slice))
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [u32]) {
        write_four(self.0, slice);
    }

    #[inline(always)]
    fn lane_indices() -> Self {
        Self(u32x4(0, 1, 2, 3))
    }

    #[inline(always)]
    fn shl<const K: u32>(self) -> Self {
        Self(u32x4_shl(self.0, K))
    }

    #[inline(always)]
    fn shr<const K: u32>(self) -> Self {
        Self(u32x4_shr(self.0, K))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask4 {
        Mask4(u32x4_eq(self.0, other.0))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask4 {
        Mask4(u32x4_lt(self.0, other.0))
    }

    #[inline(always)]
    fn select(mask: Mask4, a: Self, b: Self) -> Self {
        Self(v128_bitselect(a.0, b.0, mask.0))
    }

    #[inline(always)]
    fn gather(table: &[u32], index: Self) -> Self {
        Self::from_slice(&gathered(table, index))
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask4, slice: &mut [u32]) {
        Self(compressed(self.0, mask)).copy_to_slice(slice);
    }

    #[inline(always)]
    fn reduce_max(self) -> u32 {
        let pairs = u32x4_max(self.0, u32x4_shuffle::<2, 3, 0, 1>(self.0, self.0));
        u32x4_extract_lane::<0>(u32x4_max(pairs, u32x4_shuffle::<1, 0, 3, 2>(pairs, pairs)))
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

operators_by_two!(F64x4: Add add f64x2_add, Sub sub f64x2_sub, Mul mul f64x2_mul, Div div f64x2_div);

impl Neg for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self([f64x2_neg(self.0[0]), f64x2_neg(self.0[1])])
    }
}

impl Double for F64x4 {
    type Mask = Mask4;
    type Single = F32x4;
    type UInt = U32x4;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([f64x2_splat(x); 2])
    }

    #[inline(always)]
    fn from_slice(slice: &[f64]) -> Self {
        let slice = &slice[..4];
        // SAFETY: four numbers are there; the instruction takes any alignment.
        unsafe { Self([v128_load(slice.as_ptr().cast()), v128_load(slice.as_ptr().add(2).cast())]) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f64]) {
        let slice = &mut slice[..4];
        // SAFETY: there is room for four numbers; the instruction takes any alignment.
        unsafe {
            v128_store(slice.as_mut_ptr().cast(), self.0[0]);
            v128_store(slice.as_mut_ptr().add(2).cast(), self.0[1]);
        }
    }

    #[inline(always)]
    fn from_single(single: F32x4) -> Self {
        let high = u32x4_shuffle::<2, 3, 0, 1>(single.0, single.0);
        Self([f64x2_promote_low_f32x4(single.0), f64x2_promote_low_f32x4(high)])
    }

    #[inline(always)]
    fn to_single(self) -> F32x4 {
        let [low, high] = self.0;
        F32x4(u32x4_shuffle::<0, 1, 4, 5>(f32x4_demote_f64x2_zero(low), f32x4_demote_f64x2_zero(high)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self([f64x2_abs(self.0[0]), f64x2_abs(self.0[1])])
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self([f64x2_sqrt(self.0[0]), f64x2_sqrt(self.0[1])])
    }

    // `pmin(a, b)` is `if b < a { b } else { a }`; `min` would order −0 below 0 and hand on NaN.
    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        Self([f64x2_pmin(other.0[0], self.0[0]), f64x2_pmin(other.0[1], self.0[1])])
    }

    // `pmax(a, b)` is `if a < b { b } else { a }`.
    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        Self([f64x2_pmax(other.0[0], self.0[0]), f64x2_pmax(other.0[1], self.0[1])])
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask4 {
        Mask4::of_halves(f64x2_lt(self.0[0], other.0[0]), f64x2_lt(self.0[1], other.0[1]))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask4 {
        Mask4::of_halves(f64x2_le(self.0[0], other.0[0]), f64x2_le(self.0[1], other.0[1]))
    }

    #[inline(always)]
    fn select(mask: Mask4, a: Self, b: Self) -> Self {
        let [low, high] = mask.halves();
        Self([v128_bitselect(a.0[0], b.0[0], low), v128_bitselect(a.0[1], b.0[1], high)])
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
        let bit = u64x2_splat(1 << 63);
        Self([v128_bitselect(sign.0[0], self.0[0], bit), v128_bitselect(sign.0[1], self.0[1], bit)])
    }

    #[inline(always)]
    fn next_towards_sign(self, along: Self) -> Self {
        Self([next(self.0[0], along.0[0]), next(self.0[1], along.0[1])])
    }
}

#[inline(always)]
fn next(x: v128, along: v128) -> v128 {
    let zero = f64x2_splat(0.0);
    let (is_negative, is_zero) = (f64x2_lt(x, zero), f64x2_eq(x, zero));
    let is_down = f64x2_lt(along, zero);
    let is_along = v128_or(is_down, f64x2_gt(along, zero));
    // Away from zero, bits read as an integer grow by 1; towards it they shrink: -1 has all bits set.
    let is_towards = v128_xor(is_negative, is_down);
    let one = u64x2_splat(1);
    let moved = u64x2_add(x, v128_or(is_towards, one));
    // Both zeros become the smallest number with the sign.
    let smallest = v128_or(one, v128_and(is_down, u64x2_splat(1 << 63)));
    let moved = v128_bitselect(smallest, moved, is_zero);
    // Infinity stays where it would grow, and NaN always.
    let is_finite = f64x2_lt(f64x2_abs(x), f64x2_splat(f64::INFINITY));
    let may_move = v128_and(f64x2_eq(x, x), v128_or(is_finite, is_towards));
    v128_bitselect(moved, x, v128_and(is_along, may_move))
}

// ---------------------------------------------------------------- single precision

operators!(F32x4: Add add f32x4_add, Sub sub f32x4_sub, Mul mul f32x4_mul, Div div f32x4_div);

impl Neg for F32x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(f32x4_neg(self.0))
    }
}

impl Real for F32x4 {
    const LANES: usize = 4;
    type Mask = Mask4;
    type UInt = U32x4;
    type Double = F64x4;

    #[inline(always)]
    fn call<T: Task<Self>>(task: T) -> T::Output {
        task.call_simd128()
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(f32x4_splat(x))
    }

    #[inline(always)]
    fn from_slice(slice: &[f32]) -> Self {
        Self(four(slice))
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f32]) {
        write_four(self.0, slice);
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(f32x4_sqrt(self.0))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(f32x4_abs(self.0))
    }

    // As in double precision.
    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        Self(f32x4_pmin(other.0, self.0))
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        Self(f32x4_pmax(other.0, self.0))
    }

    #[inline(always)]
    fn round_ties_even(self) -> Self {
        Self(f32x4_nearest(self.0))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(f32x4_floor(self.0))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask4 {
        Mask4(f32x4_lt(self.0, other.0))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask4 {
        Mask4(f32x4_le(self.0, other.0))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask4 {
        Mask4(f32x4_eq(self.0, other.0))
    }

    #[inline(always)]
    fn select(mask: Mask4, a: Self, b: Self) -> Self {
        Self(v128_bitselect(a.0, b.0, mask.0))
    }

    #[inline(always)]
    fn to_bits(self) -> U32x4 {
        U32x4(self.0)
    }

    #[inline(always)]
    fn from_bits(bits: U32x4) -> Self {
        Self(bits.0)
    }

    #[inline(always)]
    fn to_int(self) -> U32x4 {
        // The instruction goes to the nearest number of its range, and from NaN to 0.
        let is_in_range = self.abs().simd_lt(Self::splat(2_147_483_648.0));
        U32x4::select(is_in_range, U32x4(i32x4_trunc_sat_f32x4(self.0)), U32x4::splat(1 << 31))
    }

    #[inline(always)]
    fn from_int(int: U32x4) -> Self {
        Self(f32x4_convert_i32x4(int.0))
    }

    #[inline(always)]
    fn gather(table: &[f32], index: U32x4) -> Self {
        Self::from_slice(&gathered(table, index))
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask4, slice: &mut [f32]) {
        Self(compressed(self.0, mask)).copy_to_slice(slice);
    }
}
