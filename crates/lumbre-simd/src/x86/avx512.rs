//! Sixteen lanes of AVX-512 (F and DQ).

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

use super::{Called, operators, operators_by_two, registers};
use crate::indices::check_indices;
use crate::{Double, Mask, Real, Task, UInt};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask16(__mmask16);

#[derive(Clone, Copy, Debug)]
pub(crate) struct U32x16(__m512i);

#[derive(Clone, Copy, Debug)]
pub(crate) struct F32x16(__m512);

/// The first eight lanes, and the others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F64x16([__m512d; 2]);

// ---------------------------------------------------------------- masks

impl BitAnd for Mask16 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for Mask16 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl Not for Mask16 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}

impl Mask for Mask16 {
    #[inline(always)]
    fn to_bitmask(self) -> u32 {
        u32::from(self.0)
    }

    #[inline(always)]
    fn from_bitmask(bits: u32) -> Self {
        Self(bits as u16)
    }

    #[inline(always)]
    fn first(n: usize) -> Self {
        Self(((1_u32 << n.min(16)) - 1) as u16)
    }
}

impl Mask16 {
    /// Of the first eight lanes, and of the others.
    #[inline(always)]
    fn halves(self) -> [u8; 2] {
        [self.0 as u8, (self.0 >> 8) as u8]
    }

    #[inline(always)]
    fn of_halves(low: u8, high: u8) -> Self {
        Self(u16::from(low) | u16::from(high) << 8)
    }
}

// ---------------------------------------------------------------- integers

operators!(U32x16: Add add _mm512_add_epi32, Sub sub _mm512_sub_epi32, Mul mul _mm512_mullo_epi32,
    BitXor bitxor _mm512_xor_si512, BitAnd bitand _mm512_and_si512, BitOr bitor _mm512_or_si512);

impl UInt for U32x16 {
    type Mask = Mask16;

    #[inline(always)]
    fn splat(x: u32) -> Self {
        registers!(Self(_mm512_set1_epi32(x.cast_signed())))
    }

    #[inline(always)]
    fn from_slice(slice: &[u32]) -> Self {
        let slice = &slice[..16];
        // SAFETY: sixteen numbers are there.
        unsafe { Self(_mm512_loadu_si512(slice.as_ptr().cast())) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [u32]) {
        let slice = &mut slice[..16];
        // SAFETY: there is room for sixteen numbers.
        unsafe { _mm512_storeu_si512(slice.as_mut_ptr().cast(), self.0) }
    }

    #[inline(always)]
    fn lane_indices() -> Self {
        registers!(Self(_mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)))
    }

    #[inline(always)]
    fn shl<const K: u32>(self) -> Self {
        registers!(Self(_mm512_slli_epi32::<K>(self.0)))
    }

    #[inline(always)]
    fn shr<const K: u32>(self) -> Self {
        registers!(Self(_mm512_srli_epi32::<K>(self.0)))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask16 {
        registers!(Mask16(_mm512_cmpeq_epi32_mask(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask16 {
        registers!(Mask16(_mm512_cmplt_epu32_mask(self.0, other.0)))
    }

    #[inline(always)]
    fn select(mask: Mask16, a: Self, b: Self) -> Self {
        registers!(Self(_mm512_mask_blend_epi32(mask.0, b.0, a.0)))
    }

    #[inline(always)]
    fn gather(table: &[u32], index: Self) -> Self {
        check_indices(index.reduce_max(), table.len());
        // SAFETY: all indices are within the table.
        unsafe { Self(_mm512_i32gather_epi32::<4>(index.0, table.as_ptr().cast())) }
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask16, slice: &mut [u32]) {
        registers!(Self(_mm512_maskz_compress_epi32(mask.0, self.0))).copy_to_slice(slice);
    }

    #[inline(always)]
    fn reduce_max(self) -> u32 {
        registers!(_mm512_reduce_max_epu32(self.0))
    }
}

// ---------------------------------------------------------------- double precision

operators_by_two!(F64x16: Add add _mm512_add_pd, Sub sub _mm512_sub_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd);

impl Neg for F64x16 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let [low, high] = self.0;
        registers!({
            let sign = _mm512_set1_pd(-0.0);
            Self([_mm512_xor_pd(low, sign), _mm512_xor_pd(high, sign)])
        })
    }
}

impl Double for F64x16 {
    type Mask = Mask16;
    type Single = F32x16;
    type UInt = U32x16;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        registers!(Self([_mm512_set1_pd(x); 2]))
    }

    #[inline(always)]
    fn from_slice(slice: &[f64]) -> Self {
        let slice = &slice[..16];
        // SAFETY: sixteen numbers are there.
        unsafe { Self([_mm512_loadu_pd(slice.as_ptr()), _mm512_loadu_pd(slice.as_ptr().add(8))]) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f64]) {
        let slice = &mut slice[..16];
        // SAFETY: there is room for sixteen numbers.
        unsafe {
            _mm512_storeu_pd(slice.as_mut_ptr(), self.0[0]);
            _mm512_storeu_pd(slice.as_mut_ptr().add(8), self.0[1]);
        }
    }

    #[inline(always)]
    fn from_single(single: F32x16) -> Self {
        registers!(Self([
            _mm512_cvtps_pd(_mm512_castps512_ps256(single.0)),
            _mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(single.0)),
        ]))
    }

    #[inline(always)]
    fn to_single(self) -> F32x16 {
        registers!(F32x16(_mm512_insertf32x8::<1>(
            _mm512_castps256_ps512(_mm512_cvtpd_ps(self.0[0])),
            _mm512_cvtpd_ps(self.0[1])
        )))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        registers!(Self([_mm512_abs_pd(self.0[0]), _mm512_abs_pd(self.0[1])]))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        registers!(Self([_mm512_sqrt_pd(self.0[0]), _mm512_sqrt_pd(self.0[1])]))
    }

    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        registers!(Self([_mm512_min_pd(self.0[0], other.0[0]), _mm512_min_pd(self.0[1], other.0[1])]))
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        registers!(Self([_mm512_max_pd(self.0[0], other.0[0]), _mm512_max_pd(self.0[1], other.0[1])]))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask16 {
        registers!(Mask16::of_halves(
            _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0[0], other.0[0]),
            _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0[1], other.0[1])
        ))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask16 {
        registers!(Mask16::of_halves(
            _mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0[0], other.0[0]),
            _mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0[1], other.0[1])
        ))
    }

    #[inline(always)]
    fn select(mask: Mask16, a: Self, b: Self) -> Self {
        let [low, high] = mask.halves();
        registers!(Self([
            _mm512_mask_blend_pd(low, b.0[0], a.0[0]),
            _mm512_mask_blend_pd(high, b.0[1], a.0[1])
        ]))
    }

    #[inline(always)]
    fn gather(table: &[f64], index: U32x16) -> Self {
        check_indices(index.reduce_max(), table.len());
        // SAFETY: all indices are within the table.
        unsafe {
            Self([
                _mm512_i32gather_pd::<8>(_mm512_castsi512_si256(index.0), table.as_ptr()),
                _mm512_i32gather_pd::<8>(_mm512_extracti64x4_epi64::<1>(index.0), table.as_ptr()),
            ])
        }
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask16, slice: &mut [f64]) {
        let slice = &mut slice[..16];
        let [low, high] = mask.halves();
        // SAFETY: there is room for sixteen numbers, and the second eight begin with the ninth or before.
        unsafe {
            _mm512_storeu_pd(slice.as_mut_ptr(), _mm512_maskz_compress_pd(low, self.0[0]));
            let place = slice.as_mut_ptr().add(low.count_ones() as usize);
            _mm512_storeu_pd(place, _mm512_maskz_compress_pd(high, self.0[1]));
        }
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self([copysign(self.0[0], sign.0[0]), copysign(self.0[1], sign.0[1])])
    }

    #[inline(always)]
    fn next_towards_sign(self, along: Self) -> Self {
        Self([next(self.0[0], along.0[0]), next(self.0[1], along.0[1])])
    }
}

#[inline(always)]
fn copysign(x: __m512d, sign: __m512d) -> __m512d {
    registers!({
        let bit = _mm512_set1_pd(-0.0);
        _mm512_or_pd(_mm512_andnot_pd(bit, x), _mm512_and_pd(bit, sign))
    })
}

#[inline(always)]
fn next(x: __m512d, along: __m512d) -> __m512d {
    registers!({
        let zero = _mm512_setzero_pd();
        let is_negative = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(x, zero);
        let is_zero = _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(x, zero);
        let is_down = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(along, zero);
        let is_along = _mm512_cmp_pd_mask::<_CMP_NEQ_OQ>(along, zero);
        // Away from zero, bits read as an integer grow.
        let is_away = !(is_negative ^ is_down);
        let is_infinite = _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(_mm512_abs_pd(x), _mm512_set1_pd(f64::INFINITY));
        let is_number = _mm512_cmp_pd_mask::<_CMP_ORD_Q>(x, x);
        let moves = is_along & is_number & !(is_away & is_infinite);
        let bits = _mm512_castpd_si512(x);
        let one = _mm512_set1_epi64(1);
        let moved = _mm512_mask_add_epi64(_mm512_sub_epi64(bits, one), is_away, bits, one);
        // Both zeros become the smallest number with the sign.
        let smallest = _mm512_mask_blend_epi64(is_down, one, _mm512_set1_epi64(i64::MIN | 1));
        let moved = _mm512_mask_blend_epi64(is_zero, moved, smallest);
        _mm512_castsi512_pd(_mm512_mask_blend_epi64(moves, bits, moved))
    })
}

// ---------------------------------------------------------------- single precision

operators!(F32x16: Add add _mm512_add_ps, Sub sub _mm512_sub_ps, Mul mul _mm512_mul_ps, Div div _mm512_div_ps);

impl Neg for F32x16 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        registers!(Self(_mm512_xor_ps(self.0, _mm512_set1_ps(-0.0))))
    }
}

impl Real for F32x16 {
    const LANES: usize = 16;
    type Mask = Mask16;
    type UInt = U32x16;
    type Double = F64x16;

    #[inline(always)]
    fn call<T: Task<Self>>(task: T) -> T::Output {
        // SAFETY: where this type is used, the machine has the features: see the module.
        unsafe { task.call_avx512() }
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        registers!(Self(_mm512_set1_ps(x)))
    }

    #[inline(always)]
    fn from_slice(slice: &[f32]) -> Self {
        let slice = &slice[..16];
        // SAFETY: sixteen numbers are there.
        unsafe { Self(_mm512_loadu_ps(slice.as_ptr())) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f32]) {
        let slice = &mut slice[..16];
        // SAFETY: there is room for sixteen numbers.
        unsafe { _mm512_storeu_ps(slice.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        registers!(Self(_mm512_sqrt_ps(self.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        registers!(Self(_mm512_abs_ps(self.0)))
    }

    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        registers!(Self(_mm512_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        registers!(Self(_mm512_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn round_ties_even(self) -> Self {
        registers!(Self(_mm512_roundscale_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0)))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        registers!(Self(_mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(self.0)))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask16 {
        registers!(Mask16(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask16 {
        registers!(Mask16(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask16 {
        registers!(Mask16(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn select(mask: Mask16, a: Self, b: Self) -> Self {
        registers!(Self(_mm512_mask_blend_ps(mask.0, b.0, a.0)))
    }

    #[inline(always)]
    fn to_bits(self) -> U32x16 {
        registers!(U32x16(_mm512_castps_si512(self.0)))
    }

    #[inline(always)]
    fn from_bits(bits: U32x16) -> Self {
        registers!(Self(_mm512_castsi512_ps(bits.0)))
    }

    #[inline(always)]
    fn to_int(self) -> U32x16 {
        registers!(U32x16(_mm512_cvttps_epi32(self.0)))
    }

    #[inline(always)]
    fn from_int(int: U32x16) -> Self {
        registers!(Self(_mm512_cvtepi32_ps(int.0)))
    }

    #[inline(always)]
    fn gather(table: &[f32], index: U32x16) -> Self {
        check_indices(index.reduce_max(), table.len());
        // SAFETY: all indices are within the table.
        unsafe { Self(_mm512_i32gather_ps::<4>(index.0, table.as_ptr())) }
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask16, slice: &mut [f32]) {
        registers!(Self(_mm512_maskz_compress_ps(mask.0, self.0))).copy_to_slice(slice);
    }
}
