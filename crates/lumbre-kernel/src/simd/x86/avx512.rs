//! Sixteen numbers in a register of 512 bits.

use std::arch::x86_64::*;
use std::mem::MaybeUninit;
use std::ops::{Add, Div, Mul, Sub};

use bytemuck::Zeroable;

use super::eight::{Eight256, SIGN, max_of_eight};
use crate::simd::vector::{AFTER_MIDDLE, BEFORE_MIDDLE, F32x16, LANE_BITS, LANES, LastEight, Row, Vector};

/// Only where `intersect::x86::X86<true>` is: the instructions are there.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(pub(super) __m512);

// SAFETY: sixteen zeros are sixteen numbers.
unsafe impl Zeroable for Avx512 {}

operator!(Avx512; Add add _mm512_add_ps);
operator!(Avx512; Sub sub _mm512_sub_ps);
operator!(Avx512; Mul mul _mm512_mul_ps);
operator!(Avx512; Div div _mm512_div_ps);

impl Vector for Avx512 {
    const COUNT: usize = LANES;
    type Array = [f32; LANES];

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
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
    type Half = Eight256<true>;

    #[inline(always)]
    fn of_two(first: Self::Half, second: Self::Half) -> Self {
        // SAFETY: see the type.
        unsafe { Self(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(first.0), second.0)) }
    }

    #[inline(always)]
    fn splat_two(first: f32, second: f32, last: LastEight) -> Self {
        // SAFETY: see the type.
        unsafe { Self(_mm512_mask_mov_ps(_mm512_set1_ps(first), last.mask(), _mm512_set1_ps(second))) }
    }

    #[inline(always)]
    fn half(&self, which: usize) -> Self::Half {
        // Where it is in memory, that is read from there.
        let first: *const f32 = (&raw const self.0).cast();
        // SAFETY: see the type. The load is of eight f32 of sixteen.
        unsafe { Eight256(_mm256_loadu_ps(first.add(8 * (which % 2)))) }
    }

    #[inline(always)]
    fn load(row: &[f32; LANES]) -> Self {
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
            Self::of_halves(low, _mm512_loadu_pd(row.0.as_ptr().add(LANES / 2)))
        }
    }

    #[inline(always)]
    fn are_same(row: &Row<f64>) -> bool {
        // SAFETY: see the type. The loads are of eight f64 each, of sixteen.
        unsafe {
            let first = _mm512_set1_pd(row.0[0]);
            let low = _mm512_loadu_pd(row.0.as_ptr());
            let high = _mm512_loadu_pd(row.0.as_ptr().add(LANES / 2));
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
            let high = _mm512_sub_pd(_mm512_loadu_pd(row.0.as_ptr().add(LANES / 2)), place);
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
            let high = _mm512_sub_pd(_mm512_loadu_pd(row.0.as_ptr().add(LANES / 2)), place);
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
    fn reduce_max_of_eight(vectors: [Self; 8]) -> [f32; 8] {
        let abcd = Self::max_of_four(vectors[0], vectors[1], vectors[2], vectors[3]);
        let efgh = Self::max_of_four(vectors[4], vectors[5], vectors[6], vectors[7]);
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
    fn bits(self) -> [i32; LANES] {
        let mut bits = [0; LANES];
        // SAFETY: see the type. The store is of sixteen i32.
        unsafe { _mm512_storeu_si512(bits.as_mut_ptr().cast(), self.integers()) };
        bits
    }

    #[inline(always)]
    fn first_four(self, mask: u32, words: &[u32; LANES]) -> [i64; 4] {
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
    fn store_four_descending(
        self,
        mask: u32,
        words: &[u32; LANES],
        place: &mut [MaybeUninit<i64>; 4],
    ) -> bool {
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
    fn put_chosen(mask: u32, words: &[u32; LANES], place: &mut [MaybeUninit<u32>; LANES]) {
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
