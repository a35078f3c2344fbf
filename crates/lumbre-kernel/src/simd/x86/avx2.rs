//! Sixteen numbers in two registers of 256 bits.

use std::arch::x86_64::*;
use std::mem::MaybeUninit;
use std::ops::{Add, Div, Mul, Sub};

use bytemuck::Zeroable;

use super::eight::{Eight256, max_of_eight};
use crate::simd::opaque_number;
use crate::simd::vector::{AFTER_MIDDLE, BEFORE_MIDDLE, F32x16, LANE_BITS, LANES, LastEight, Row, Vector};

/// Only where `intersect::x86::X86<false>` is, alike.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Avx2(pub(super) [__m256; 2]);

/// For each mask of eight, its lanes first.
static LANES_OF: [[u8; 8]; 256] = {
    let mut lanes = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 != 0 {
                lanes[mask][place] = lane as u8;
                place += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    lanes
};

impl Avx2 {
    #[inline(always)]
    fn quarters(row: &Row<f64>) -> [__m256d; 4] {
        let start = row.0.as_ptr();
        // SAFETY: see the type. The loads are of four f64 each, of sixteen.
        unsafe {
            [
                _mm256_loadu_pd(start),
                _mm256_loadu_pd(start.add(4)),
                _mm256_loadu_pd(start.add(8)),
                _mm256_loadu_pd(start.add(12)),
            ]
        }
    }

    /// Rounded.
    #[inline(always)]
    fn of_quarters([a, b, c, d]: [__m256d; 4]) -> Self {
        // SAFETY: see the type.
        unsafe {
            let low = _mm256_setr_m128(_mm256_cvtpd_ps(a), _mm256_cvtpd_ps(b));
            Self([low, _mm256_setr_m128(_mm256_cvtpd_ps(c), _mm256_cvtpd_ps(d))])
        }
    }

    /// In every four lanes of eight, the largest that four have in those or eight behind.
    #[inline(always)]
    fn max_of_four(a: Self, b: Self, c: Self, d: Self) -> __m256 {
        // SAFETY: see the type.
        unsafe {
            let a = _mm256_max_ps(a.0[0], a.0[1]);
            let b = _mm256_max_ps(b.0[0], b.0[1]);
            let c = _mm256_max_ps(c.0[0], c.0[1]);
            let d = _mm256_max_ps(d.0[0], d.0[1]);
            let ab = _mm256_max_ps(_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let cd = _mm256_max_ps(_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            let (ab, cd) = (_mm256_castps_pd(ab), _mm256_castps_pd(cd));
            let low = _mm256_castpd_ps(_mm256_unpacklo_pd(ab, cd));
            _mm256_max_ps(low, _mm256_castpd_ps(_mm256_unpackhi_pd(ab, cd)))
        }
    }

    /// Eight words from here on, those of the mask first; the others are undefined.
    ///
    /// # Safety
    /// Lanes of both halves together.
    #[inline(always)]
    unsafe fn chosen(mask: u32, words: *const u32) -> __m256i {
        // SAFETY: see the type, and above. The other load is of one of the table's rows of eight bytes.
        unsafe {
            let lanes = _mm_loadl_epi64(LANES_OF[mask as usize % 256].as_ptr().cast());
            _mm256_permutevar8x32_epi32(_mm256_loadu_si256(words.cast()), _mm256_cvtepu8_epi32(lanes))
        }
    }

    #[inline(always)]
    fn integers(self) -> [__m256i; 2] {
        let [low, high] = self.0;
        // SAFETY: see the type.
        unsafe { [_mm256_castps_si256(low), _mm256_castps_si256(high)] }
    }

    #[inline(always)]
    fn of([low, high]: [__m256i; 2]) -> Self {
        // SAFETY: see the type.
        unsafe { Self([_mm256_castsi256_ps(low), _mm256_castsi256_ps(high)]) }
    }

    #[inline(always)]
    fn masks([low, high]: [__m256; 2]) -> u32 {
        // SAFETY: see the type.
        let (low, high) = unsafe { (_mm256_movemask_ps(low) as u32, _mm256_movemask_ps(high) as u32) };
        // Else the compiler puts the halves together first, which takes twice as long.
        low | opaque_number(high) << 8
    }
}

macro_rules! operators_by_halves {
    ($($trait:ident $method:ident $instruction:ident),*) => {
        $(
            impl $trait for Avx2 {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: see the type.
                    unsafe { Self([$instruction(self.0[0], other.0[0]), $instruction(self.0[1], other.0[1])]) }
                }
            }
        )*
    };
}

operators_by_halves!(Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);

macro_rules! by_halves {
    ($name:ident($($other:ident),*)) => {
        #[inline(always)]
        fn $name(self $(, $other: Self)*) -> Self {
            Self([
                Eight256::<false>(self.0[0]).$name($(Eight256::<false>($other.0[0])),*).0,
                Eight256::<false>(self.0[1]).$name($(Eight256::<false>($other.0[1])),*).0,
            ])
        }
    };
}

impl Vector for Avx2 {
    const COUNT: usize = LANES;
    type Array = [f32; LANES];

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
        let mut row = Row::of(0.0);
        self.store(&mut row);
        row.0
    }

    by_halves!(mul_add(factor, summand));
    by_halves!(neg_mul_add(factor, summand));
    by_halves!(mul_sub(factor, other));
    by_halves!(sqrt());
    by_halves!(min(other));
    by_halves!(max(other));
    by_halves!(abs());
    by_halves!(max_abs(other));
    by_halves!(xor_sign(other));

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([Eight256::<false>::splat(value).0; 2])
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> u32 {
        let ([a, b], [c, d]) = (self.0, other.0);
        // SAFETY: see the type.
        unsafe { Self::masks([_mm256_cmp_ps::<_CMP_LE_OQ>(a, c), _mm256_cmp_ps::<_CMP_LE_OQ>(b, d)]) }
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> u32 {
        let ([a, b], [c, d]) = (self.0, other.0);
        // SAFETY: see the type.
        unsafe { Self::masks([_mm256_cmp_ps::<_CMP_LT_OQ>(a, c), _mm256_cmp_ps::<_CMP_LT_OQ>(b, d)]) }
    }
}

impl F32x16 for Avx2 {
    type Half = Eight256<false>;

    #[inline(always)]
    fn of_two(first: Self::Half, second: Self::Half) -> Self {
        Self([first.0, second.0])
    }

    #[inline(always)]
    fn splat_two(first: f32, second: f32, _: LastEight) -> Self {
        Self::of_two(Eight256::splat(first), Eight256::splat(second))
    }

    #[inline(always)]
    fn half(&self, which: usize) -> Self::Half {
        Eight256(self.0[which % 2])
    }

    #[inline(always)]
    fn load(row: &[f32; LANES]) -> Self {
        // SAFETY: see the type. The loads are of eight f32 each, of sixteen.
        unsafe { Self([_mm256_loadu_ps(row.as_ptr()), _mm256_loadu_ps(row.as_ptr().add(8))]) }
    }

    #[inline(always)]
    fn store(self, row: &mut Row<f32>) {
        let [low, high] = self.0;
        // SAFETY: see the type. The stores are of eight f32 each, of sixteen.
        unsafe {
            _mm256_storeu_ps(row.0.as_mut_ptr(), low);
            _mm256_storeu_ps(row.0.as_mut_ptr().add(8), high);
        }
    }

    #[inline(always)]
    fn rounded(row: &Row<f64>) -> Self {
        Self::of_quarters(Self::quarters(row))
    }

    #[inline(always)]
    fn are_same(row: &Row<f64>) -> bool {
        let [a, b, c, d] = Self::quarters(row);
        // SAFETY: see the type.
        unsafe {
            let first = _mm256_set1_pd(row.0[0]);
            let low =
                _mm256_and_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(a, first), _mm256_cmp_pd::<_CMP_EQ_OQ>(b, first));
            let high =
                _mm256_and_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(c, first), _mm256_cmp_pd::<_CMP_EQ_OQ>(d, first));
            _mm256_movemask_pd(_mm256_and_pd(low, high)) == 0b1111
        }
    }

    #[inline(always)]
    fn rounded_from(row: &Row<f64>, place: f64, scale: f64) -> Self {
        let mut quarters = Self::quarters(row);
        for quarter in &mut quarters {
            // SAFETY: see the type.
            unsafe {
                let from = _mm256_sub_pd(*quarter, _mm256_set1_pd(place));
                *quarter = _mm256_mul_pd(from, _mm256_set1_pd(scale));
            }
        }
        Self::of_quarters(quarters)
    }

    #[inline(always)]
    fn rounded_less(self, place: f64) -> Self {
        let [low, high] = self.0;
        // SAFETY: see the type.
        unsafe {
            let place = _mm256_set1_pd(place);
            Self::of_quarters([
                _mm256_sub_pd(_mm256_cvtps_pd(_mm256_castps256_ps128(low)), place),
                _mm256_sub_pd(_mm256_cvtps_pd(_mm256_extractf128_ps::<1>(low)), place),
                _mm256_sub_pd(_mm256_cvtps_pd(_mm256_castps256_ps128(high)), place),
                _mm256_sub_pd(_mm256_cvtps_pd(_mm256_extractf128_ps::<1>(high)), place),
            ])
        }
    }

    #[inline(always)]
    fn parted_from(row: &Row<f64>, place: f64) -> (Self, Self) {
        let mut quarters = Self::quarters(row);
        for quarter in &mut quarters {
            // SAFETY: see the type.
            *quarter = unsafe { _mm256_sub_pd(*quarter, _mm256_set1_pd(place)) };
        }
        let rounded = Self::of_quarters(quarters);
        // SAFETY: see the type.
        unsafe {
            let [low, high] = rounded.0;
            let parts = [
                _mm256_castps256_ps128(low),
                _mm256_extractf128_ps::<1>(low),
                _mm256_castps256_ps128(high),
                _mm256_extractf128_ps::<1>(high),
            ];
            for (quarter, part) in quarters.iter_mut().zip(parts) {
                *quarter = _mm256_sub_pd(*quarter, _mm256_cvtps_pd(part));
            }
        }
        (rounded, Self::of_quarters(quarters))
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: see the type.
        unsafe { max_of_eight(_mm256_max_ps(self.0[0], self.0[1])) }
    }

    #[inline(always)]
    fn reduce_max_of_eight(vectors: [Self; 8]) -> [f32; 8] {
        let abcd = Self::max_of_four(vectors[0], vectors[1], vectors[2], vectors[3]);
        let efgh = Self::max_of_four(vectors[4], vectors[5], vectors[6], vectors[7]);
        let mut most = [0.0; 8];
        // SAFETY: see the type. The store is of eight f32.
        unsafe {
            let low = _mm256_permute2f128_ps::<0x20>(abcd, efgh);
            let all = _mm256_max_ps(low, _mm256_permute2f128_ps::<0x31>(abcd, efgh));
            _mm256_storeu_ps(most.as_mut_ptr(), all);
        }
        most
    }

    #[inline(always)]
    fn are_equal(self) -> bool {
        let [low, high] = self.0;
        // SAFETY: see the type.
        unsafe {
            let first = _mm256_broadcastss_ps(_mm256_castps256_ps128(low));
            let low = _mm256_cmp_ps::<_CMP_EQ_OQ>(low, first);
            let both = _mm256_and_ps(low, _mm256_cmp_ps::<_CMP_EQ_OQ>(high, first));
            _mm256_movemask_ps(both) == 0xff
        }
    }

    #[inline(always)]
    fn midpoint(self) -> Self {
        let [low, high] = self.0;
        // SAFETY: see the type.
        unsafe {
            let before = _mm256_permutevar8x32_ps(low, _mm256_set1_epi32(BEFORE_MIDDLE as i32));
            let after = _mm256_permutevar8x32_ps(high, _mm256_set1_epi32(AFTER_MIDDLE as i32 - 8));
            Self([_mm256_mul_ps(_mm256_add_ps(before, after), _mm256_set1_ps(0.5)); 2])
        }
    }

    #[inline(always)]
    fn first(self) -> f32 {
        // SAFETY: see the type.
        unsafe { _mm256_cvtss_f32(self.0[0]) }
    }

    #[inline(always)]
    fn select(mask: u32, first: Self, second: Self) -> Self {
        let ([a, b], [c, d]) = (first.0, second.0);
        // SAFETY: see the type.
        unsafe {
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let low = _mm256_and_si256(_mm256_set1_epi32(mask as i32), bits);
            let high = _mm256_and_si256(_mm256_set1_epi32((mask >> 8) as i32), bits);
            let low = _mm256_castsi256_ps(_mm256_cmpeq_epi32(low, bits));
            let high = _mm256_castsi256_ps(_mm256_cmpeq_epi32(high, bits));
            Self([_mm256_blendv_ps(c, a, low), _mm256_blendv_ps(d, b, high)])
        }
    }

    #[inline(always)]
    fn max_nonneg(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.integers(), other.integers());
        // SAFETY: see the type.
        unsafe { Self::of([_mm256_max_epi32(a, c), _mm256_max_epi32(b, d)]) }
    }

    #[inline(always)]
    fn min_nonneg(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.integers(), other.integers());
        // SAFETY: see the type.
        unsafe { Self::of([_mm256_min_epi32(a, c), _mm256_min_epi32(b, d)]) }
    }

    #[inline(always)]
    fn le_nonneg(self, other: Self) -> u32 {
        let ([a, b], [c, d]) = (self.integers(), other.integers());
        // SAFETY: see the type.
        let above = unsafe { Self::of([_mm256_cmpgt_epi32(a, c), _mm256_cmpgt_epi32(b, d)]) };
        Self::masks(above.0) ^ 0xffff
    }

    #[inline(always)]
    fn bits_above(self, other: i32) -> u32 {
        let [a, b] = self.integers();
        // SAFETY: see the type.
        unsafe {
            let other = _mm256_set1_epi32(other);
            let above = Self::of([_mm256_cmpgt_epi32(a, other), _mm256_cmpgt_epi32(b, other)]);
            Self::masks(above.0)
        }
    }

    #[inline(always)]
    fn with_bits(self, bits: u32) -> u32 {
        let [a, b] = self.integers();
        // SAFETY: see the type.
        unsafe {
            let bits = _mm256_set1_epi32(bits as i32);
            Self::masks(Self::of([_mm256_cmpeq_epi32(a, bits), _mm256_cmpeq_epi32(b, bits)]).0)
        }
    }

    #[inline(always)]
    fn lanes_in_bits(self) -> Self {
        let [a, b] = self.integers();
        // SAFETY: see the type.
        unsafe {
            let low = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let high = _mm256_setr_epi32(8, 9, 10, 11, 12, 13, 14, 15);
            let own = _mm256_set1_epi32(LANE_BITS);
            let (a, b) = (_mm256_andnot_si256(own, a), _mm256_andnot_si256(own, b));
            Self::of([_mm256_or_si256(a, low), _mm256_or_si256(b, high)])
        }
    }

    #[inline(always)]
    fn bits(self) -> [i32; LANES] {
        let [low, high] = self.integers();
        let mut bits = [0; LANES];
        // SAFETY: see the type. The stores are of eight i32 each, of sixteen.
        unsafe {
            _mm256_storeu_si256(bits.as_mut_ptr().cast(), low);
            _mm256_storeu_si256(bits.as_mut_ptr().add(8).cast(), high);
        }
        bits
    }

    #[inline(always)]
    fn put_chosen(mask: u32, words: &[u32; LANES], place: &mut [MaybeUninit<u32>; LANES]) {
        // SAFETY: see the type. The loads are of eight u32 each, of sixteen; so are the stores, the second no farther
        // than eight on.
        unsafe {
            let (words, place) = (words.as_ptr(), place.as_mut_ptr());
            let of_low = (mask & 0xff).count_ones() as usize;
            _mm256_storeu_si256(place.cast(), Self::chosen(mask, words));
            _mm256_storeu_si256(place.add(of_low).cast(), Self::chosen(mask >> 8, words.add(8)));
        }
    }
}
