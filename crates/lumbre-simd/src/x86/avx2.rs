//! Eight lanes of AVX2.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

use super::{Called, operators, operators_by_two, registers};
use crate::indices::check_indices;
use crate::{Double, Mask, Real, Task, UInt};

/// All bits of a lane are set, or none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask8(__m256);

#[derive(Clone, Copy, Debug)]
pub(crate) struct U32x8(__m256i);

#[derive(Clone, Copy, Debug)]
pub(crate) struct F32x8(__m256);

/// The first four lanes, and the others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F64x8([__m256d; 2]);

// ---------------------------------------------------------------- masks

operators!(Mask8: BitAnd bitand _mm256_and_ps, BitOr bitor _mm256_or_ps);

impl Not for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        registers!(Self(_mm256_xor_ps(self.0, _mm256_castsi256_ps(_mm256_set1_epi32(-1)))))
    }
}

impl Mask for Mask8 {
    #[inline(always)]
    fn to_bitmask(self) -> u32 {
        registers!(_mm256_movemask_ps(self.0).cast_unsigned())
    }

    #[inline(always)]
    fn from_bitmask(bits: u32) -> Self {
        registers!({
            let lane_bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits.cast_signed()), lane_bits);
            Self(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lane_bits)))
        })
    }

    #[inline(always)]
    fn first(n: usize) -> Self {
        U32x8::lane_indices().simd_lt(U32x8::splat(n.min(8) as u32))
    }
}

impl Mask8 {
    /// For four doubles, and the other four.
    #[inline(always)]
    fn halves(self) -> [__m256d; 2] {
        registers!({
            let lanes = _mm256_castps_si256(self.0);
            let low = _mm256_cvtepi32_epi64(_mm256_castsi256_si128(lanes));
            let high = _mm256_cvtepi32_epi64(_mm256_extracti128_si256::<1>(lanes));
            [_mm256_castsi256_pd(low), _mm256_castsi256_pd(high)]
        })
    }

    /// The inverse.
    #[inline(always)]
    fn of_halves(low: __m256d, high: __m256d) -> Self {
        registers!({
            // The upper halves of all doubles, in the order 0 1 4 5 2 3 6 7.
            let mixed = _mm256_shuffle_ps::<0b11_01_11_01>(_mm256_castpd_ps(low), _mm256_castpd_ps(high));
            Self(_mm256_castpd_ps(_mm256_permute4x64_pd::<0b11_01_10_00>(_mm256_castps_pd(mixed))))
        })
    }

    /// Where [`UInt::compress_store`] takes its lanes from.
    #[inline(always)]
    fn compression(self) -> __m256i {
        let lanes = &COMPRESSIONS[self.to_bitmask() as usize % 256];
        // SAFETY: eight bytes are there.
        unsafe { _mm256_cvtepu8_epi32(_mm_loadl_epi64(lanes.as_ptr().cast())) }
    }
}

/// For each mask, the lanes that are set, in order.
static COMPRESSIONS: [[u8; 8]; 256] = {
    let mut all = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut count, mut lane) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                all[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    all
};

// ---------------------------------------------------------------- integers

operators!(U32x8: Add add _mm256_add_epi32, Sub sub _mm256_sub_epi32, Mul mul _mm256_mullo_epi32,
    BitXor bitxor _mm256_xor_si256, BitAnd bitand _mm256_and_si256, BitOr bitor _mm256_or_si256);

impl UInt for U32x8 {
    type Mask = Mask8;

    #[inline(always)]
    fn splat(x: u32) -> Self {
        registers!(Self(_mm256_set1_epi32(x.cast_signed())))
    }

    #[inline(always)]
    fn from_slice(slice: &[u32]) -> Self {
        let slice = &slice[..8];
        // SAFETY: eight numbers are there.
        unsafe { Self(_mm256_loadu_si256(slice.as_ptr().cast())) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [u32]) {
        let slice = &mut slice[..8];
        // SAFETY: there is room for eight numbers.
        unsafe { _mm256_storeu_si256(slice.as_mut_ptr().cast(), self.0) }
    }

    #[inline(always)]
    fn lane_indices() -> Self {
        registers!(Self(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)))
    }

    #[inline(always)]
    fn shl<const K: u32>(self) -> Self {
        registers!(Self(_mm256_sll_epi32(self.0, _mm_cvtsi32_si128(K.cast_signed()))))
    }

    #[inline(always)]
    fn shr<const K: u32>(self) -> Self {
        registers!(Self(_mm256_srl_epi32(self.0, _mm_cvtsi32_si128(K.cast_signed()))))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask8 {
        registers!(Mask8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, other.0))))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask8 {
        registers!({
            // There is a comparison of signed numbers alone.
            let middle = _mm256_set1_epi32(i32::MIN);
            let (a, b) = (_mm256_xor_si256(self.0, middle), _mm256_xor_si256(other.0, middle));
            Mask8(_mm256_castsi256_ps(_mm256_cmpgt_epi32(b, a)))
        })
    }

    #[inline(always)]
    fn select(mask: Mask8, a: Self, b: Self) -> Self {
        registers!(Self(_mm256_blendv_epi8(b.0, a.0, _mm256_castps_si256(mask.0))))
    }

    #[inline(always)]
    fn gather(table: &[u32], index: Self) -> Self {
        check_indices(index.reduce_max(), table.len());
        // SAFETY: all indices are within the table.
        unsafe { Self(_mm256_i32gather_epi32::<4>(table.as_ptr().cast(), index.0)) }
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask8, slice: &mut [u32]) {
        registers!(Self(_mm256_permutevar8x32_epi32(self.0, mask.compression()))).copy_to_slice(slice);
    }

    #[inline(always)]
    fn reduce_max(self) -> u32 {
        registers!({
            let four = _mm_max_epu32(_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0));
            let two = _mm_max_epu32(four, _mm_shuffle_epi32::<0b01_00_11_10>(four));
            let one = _mm_max_epu32(two, _mm_shuffle_epi32::<0b10_11_00_01>(two));
            _mm_cvtsi128_si32(one).cast_unsigned()
        })
    }
}

// ---------------------------------------------------------------- double precision

operators_by_two!(F64x8: Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

impl Neg for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let [low, high] = self.0;
        registers!({
            let sign = _mm256_set1_pd(-0.0);
            Self([_mm256_xor_pd(low, sign), _mm256_xor_pd(high, sign)])
        })
    }
}

impl Double for F64x8 {
    type Mask = Mask8;
    type Single = F32x8;
    type UInt = U32x8;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        registers!(Self([_mm256_set1_pd(x); 2]))
    }

    #[inline(always)]
    fn from_slice(slice: &[f64]) -> Self {
        let slice = &slice[..8];
        // SAFETY: eight numbers are there.
        unsafe { Self([_mm256_loadu_pd(slice.as_ptr()), _mm256_loadu_pd(slice.as_ptr().add(4))]) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f64]) {
        let slice = &mut slice[..8];
        // SAFETY: there is room for eight numbers.
        unsafe {
            _mm256_storeu_pd(slice.as_mut_ptr(), self.0[0]);
            _mm256_storeu_pd(slice.as_mut_ptr().add(4), self.0[1]);
        }
    }

    #[inline(always)]
    fn from_single(single: F32x8) -> Self {
        registers!(Self([
            _mm256_cvtps_pd(_mm256_castps256_ps128(single.0)),
            _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(single.0)),
        ]))
    }

    #[inline(always)]
    fn to_single(self) -> F32x8 {
        registers!(F32x8(_mm256_insertf128_ps::<1>(
            _mm256_castps128_ps256(_mm256_cvtpd_ps(self.0[0])),
            _mm256_cvtpd_ps(self.0[1])
        )))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        registers!({
            let sign = _mm256_set1_pd(-0.0);
            Self([_mm256_andnot_pd(sign, self.0[0]), _mm256_andnot_pd(sign, self.0[1])])
        })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        registers!(Self([_mm256_sqrt_pd(self.0[0]), _mm256_sqrt_pd(self.0[1])]))
    }

    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        registers!(Self([_mm256_min_pd(self.0[0], other.0[0]), _mm256_min_pd(self.0[1], other.0[1])]))
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        registers!(Self([_mm256_max_pd(self.0[0], other.0[0]), _mm256_max_pd(self.0[1], other.0[1])]))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask8 {
        registers!(Mask8::of_halves(
            _mm256_cmp_pd::<_CMP_LT_OQ>(self.0[0], other.0[0]),
            _mm256_cmp_pd::<_CMP_LT_OQ>(self.0[1], other.0[1])
        ))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask8 {
        registers!(Mask8::of_halves(
            _mm256_cmp_pd::<_CMP_LE_OQ>(self.0[0], other.0[0]),
            _mm256_cmp_pd::<_CMP_LE_OQ>(self.0[1], other.0[1])
        ))
    }

    #[inline(always)]
    fn select(mask: Mask8, a: Self, b: Self) -> Self {
        let [low, high] = mask.halves();
        registers!(Self([_mm256_blendv_pd(b.0[0], a.0[0], low), _mm256_blendv_pd(b.0[1], a.0[1], high)]))
    }

    #[inline(always)]
    fn gather(table: &[f64], index: U32x8) -> Self {
        check_indices(index.reduce_max(), table.len());
        // SAFETY: all indices are within the table.
        unsafe {
            Self([
                _mm256_i32gather_pd::<8>(table.as_ptr(), _mm256_castsi256_si128(index.0)),
                _mm256_i32gather_pd::<8>(table.as_ptr(), _mm256_extracti128_si256::<1>(index.0)),
            ])
        }
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask8, slice: &mut [f64]) {
        let slice = &mut slice[..8];
        let mut lanes = [0.0; 8];
        self.copy_to_slice(&mut lanes);
        let (bits, mut count) = (mask.to_bitmask(), 0);
        for (lane, number) in lanes.into_iter().enumerate() {
            slice[count] = number;
            count += (bits >> lane & 1) as usize;
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
fn copysign(x: __m256d, sign: __m256d) -> __m256d {
    registers!({
        let bit = _mm256_set1_pd(-0.0);
        _mm256_or_pd(_mm256_andnot_pd(bit, x), _mm256_and_pd(bit, sign))
    })
}

#[inline(always)]
fn next(x: __m256d, along: __m256d) -> __m256d {
    registers!({
        let (zero, sign) = (_mm256_setzero_pd(), _mm256_set1_pd(-0.0));
        let is_negative = _mm256_cmp_pd::<_CMP_LT_OQ>(x, zero);
        let is_zero = _mm256_cmp_pd::<_CMP_EQ_OQ>(x, zero);
        let is_down = _mm256_cmp_pd::<_CMP_LT_OQ>(along, zero);
        let is_along = _mm256_cmp_pd::<_CMP_NEQ_OQ>(along, zero);
        // Away from zero, bits read as an integer grow by 1; towards it they shrink: -1 has all bits set.
        let is_towards = _mm256_xor_pd(is_negative, is_down);
        let one = _mm256_set1_epi64x(1);
        let step = _mm256_or_si256(_mm256_castpd_si256(is_towards), one);
        let moved = _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(x), step));
        // Both zeros become the smallest number with the sign.
        let smallest = _mm256_or_pd(_mm256_castsi256_pd(one), _mm256_and_pd(is_down, sign));
        let moved = _mm256_blendv_pd(moved, smallest, is_zero);
        // Infinity stays where it would grow, and NaN always.
        let is_finite = _mm256_cmp_pd::<_CMP_LT_OQ>(_mm256_andnot_pd(sign, x), _mm256_set1_pd(f64::INFINITY));
        let is_number = _mm256_cmp_pd::<_CMP_ORD_Q>(x, x);
        let may_move = _mm256_and_pd(is_number, _mm256_or_pd(is_finite, is_towards));
        _mm256_blendv_pd(x, moved, _mm256_and_pd(is_along, may_move))
    })
}

// ---------------------------------------------------------------- single precision

operators!(F32x8: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);

impl Neg for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        registers!(Self(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0))))
    }
}

impl Real for F32x8 {
    const LANES: usize = 8;
    type Mask = Mask8;
    type UInt = U32x8;
    type Double = F64x8;

    #[inline(always)]
    fn call<T: Task<Self>>(task: T) -> T::Output {
        // SAFETY: where this type is used, the machine has the features: see the module.
        unsafe { task.call_avx2() }
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        registers!(Self(_mm256_set1_ps(x)))
    }

    #[inline(always)]
    fn from_slice(slice: &[f32]) -> Self {
        let slice = &slice[..8];
        // SAFETY: eight numbers are there.
        unsafe { Self(_mm256_loadu_ps(slice.as_ptr())) }
    }

    #[inline(always)]
    fn copy_to_slice(self, slice: &mut [f32]) {
        let slice = &mut slice[..8];
        // SAFETY: there is room for eight numbers.
        unsafe { _mm256_storeu_ps(slice.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        registers!(Self(_mm256_sqrt_ps(self.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        registers!(Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }

    #[inline(always)]
    fn simd_min(self, other: Self) -> Self {
        registers!(Self(_mm256_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_max(self, other: Self) -> Self {
        registers!(Self(_mm256_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn round_ties_even(self) -> Self {
        registers!(Self(_mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0)))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        registers!(Self(_mm256_round_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(self.0)))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Mask8 {
        registers!(Mask8(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Mask8 {
        registers!(Mask8(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn simd_eq(self, other: Self) -> Mask8 {
        registers!(Mask8(_mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn select(mask: Mask8, a: Self, b: Self) -> Self {
        registers!(Self(_mm256_blendv_ps(b.0, a.0, mask.0)))
    }

    #[inline(always)]
    fn to_bits(self) -> U32x8 {
        registers!(U32x8(_mm256_castps_si256(self.0)))
    }

    #[inline(always)]
    fn from_bits(bits: U32x8) -> Self {
        registers!(Self(_mm256_castsi256_ps(bits.0)))
    }

    #[inline(always)]
    fn to_int(self) -> U32x8 {
        registers!(U32x8(_mm256_cvttps_epi32(self.0)))
    }

    #[inline(always)]
    fn from_int(int: U32x8) -> Self {
        registers!(Self(_mm256_cvtepi32_ps(int.0)))
    }

    #[inline(always)]
    fn gather(table: &[f32], index: U32x8) -> Self {
        check_indices(index.reduce_max(), table.len());
        // SAFETY: all indices are within the table.
        unsafe { Self(_mm256_i32gather_ps::<4>(table.as_ptr(), index.0)) }
    }

    #[inline(always)]
    fn compress_store(self, mask: Mask8, slice: &mut [f32]) {
        registers!(Self(_mm256_permutevar8x32_ps(self.0, mask.compression()))).copy_to_slice(slice);
    }
}
