//! Eight numbers in a register of 256 bits.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use bytemuck::Zeroable;

use crate::simd::vector::{F32x8, Vector};

/// Only where `intersect::x86::X86<AVX512>` is.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Eight256<const AVX512: bool>(pub(super) __m256);

pub(super) const SIGN: i32 = i32::MIN;

operator!(Eight256<AVX512>, AVX512; Add add _mm256_add_ps);
operator!(Eight256<AVX512>, AVX512; Sub sub _mm256_sub_ps);
operator!(Eight256<AVX512>, AVX512; Mul mul _mm256_mul_ps);
operator!(Eight256<AVX512>, AVX512; Div div _mm256_div_ps);

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
            // Numbers without a sign have the order of their bits. As integers, which execute in parallel with sums and
            // comparisons, not between them.
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

/// # Safety
/// There must be AVX2.
#[inline(always)]
pub(super) unsafe fn max_of_eight(v: __m256) -> f32 {
    // SAFETY: see above.
    unsafe {
        let v = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
        let v = _mm_max_ps(v, _mm_movehl_ps(v, v));
        _mm_cvtss_f32(_mm_max_ss(v, _mm_movehdup_ps(v)))
    }
}
