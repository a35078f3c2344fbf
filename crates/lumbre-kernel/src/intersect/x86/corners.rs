//! The corners of triangles in blocks.

use std::arch::x86_64::*;

use super::X86;
use crate::intersect::axes::Axes;
use crate::intersect::triangles::Shears;
use crate::simd::x86::{Avx512, Eight256};
use crate::tree::BLOCK;
use crate::tree::triangle_block::TriangleBlock;

impl<const AVX512: bool> X86<AVX512> {
    /// A component of three corners, the first of which is here.
    ///
    /// # Safety
    /// They are so far behind `row`.
    #[inline(always)]
    pub(super) unsafe fn component(row: *const f32, [a, b, c]: [usize; 3]) -> __m128 {
        // SAFETY: see `X86`, and above.
        unsafe { _mm_setr_ps(*row.add(a), *row.add(b), *row.add(c), 0.0) }
    }

    /// The numbers of a row in three places below sixteen, of more bits than which what is above means nothing; nor does the last.
    /// For AVX-512 alone.
    ///
    /// # Safety
    /// There are sixteen to be read.
    #[inline(always)]
    pub(super) unsafe fn three_of(row: *const f32, places: __m128i) -> __m128 {
        // SAFETY: see `X86`, and above.
        unsafe {
            let three = _mm512_permutexvar_ps(_mm512_castsi128_si512(places), _mm512_loadu_ps(row));
            _mm512_castps512_ps128(three)
        }
    }

    /// The corners of the triangle in a lane, `[axis][corner]` by the order of the axes; the last of four means nothing.
    #[inline(always)]
    pub(super) fn corners_in(block: &TriangleBlock, lane: usize, axes: &Axes) -> [__m128; 3] {
        let words = block.words().as_ptr();
        let [x, y, z] = axes.rows(block);
        // SAFETY: see `X86` and `Axes::rows`.
        unsafe {
            if AVX512 && !block.is_unshared() {
                let [a, b, c] = block.corners();
                let corners = _mm_setr_epi32(a as i32, b as i32, c as i32, 0);
                let vertices = _mm_srl_epi32(corners, _mm_cvtsi32_si128(4 * (lane % BLOCK) as i32));
                return [
                    Self::three_of(words.add(x), vertices),
                    Self::three_of(words.add(y), vertices),
                    Self::three_of(words.add(z), vertices),
                ];
            }
            let vertices = block.vertices_at(lane);
            [
                Self::component(words.add(x), vertices),
                Self::component(words.add(y), vertices),
                Self::component(words.add(z), vertices),
            ]
        }
    }

    /// Eight numbers of sixteen, each by its place in the same half of `near`, or of `far` from eight on: see
    /// [`triangle_block`](crate::tree::triangle_block).
    #[inline(always)]
    pub(super) fn of_two(near: __m256, far: __m256, places: __m256i) -> __m256 {
        // SAFETY: see `X86`.
        unsafe {
            let is_far = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(places));
            let (near, far) = (_mm256_permutevar_ps(near, places), _mm256_permutevar_ps(far, places));
            _mm256_blendv_ps(near, far, is_far)
        }
    }

    /// The places of eight vertices, of four bits each: of more bits, what is above means nothing.
    #[inline(always)]
    pub(super) fn places(vertices: u32) -> __m256i {
        // SAFETY: see `X86`.
        unsafe {
            let shifts = _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28);
            _mm256_srlv_epi32(_mm256_set1_epi32(vertices as i32), shifts)
        }
    }

    /// Eight vertices of these rows from the `first` on, sheared.
    #[inline(always)]
    pub(super) fn sheared_eight<S: Shears>(
        block: &TriangleBlock,
        ray: &S,
        &[kx, ky, kz]: &[u32; 3],
        first: usize,
    ) -> [Eight256<AVX512>; 3] {
        let words = block.words().as_ptr();
        // SAFETY: see `X86`. Of rows of a block that shares its vertices the first sixteen are read, of others the first twenty-four.
        let vertices = unsafe {
            [
                Eight256::new(_mm256_loadu_ps(words.add(kx as usize + first))),
                Eight256::new(_mm256_loadu_ps(words.add(ky as usize + first))),
                Eight256::new(_mm256_loadu_ps(words.add(kz as usize + first))),
            ]
        };
        ray.apply(vertices)
    }

    /// The vertices that a block shares, sheared. For AVX-512 alone.
    #[inline(always)]
    pub(super) fn sheared_sixteen<S: Shears>(block: &TriangleBlock, ray: &S) -> [Avx512; 3] {
        let words = block.words().as_ptr();
        let [kx, ky, kz] = ray.axes().shared_rows;
        // SAFETY: as there.
        let vertices = unsafe {
            [
                Avx512::new(_mm512_loadu_ps(words.add(kx as usize))),
                Avx512::new(_mm512_loadu_ps(words.add(ky as usize))),
                Avx512::new(_mm512_loadu_ps(words.add(kz as usize))),
            ]
        };
        ray.apply(vertices)
    }

    /// Eight of sixteen numbers, each by its place. For AVX-512 alone.
    #[inline(always)]
    pub(super) fn of_sixteen(numbers: __m512, places: __m256i) -> __m256 {
        // SAFETY: see `X86`.
        unsafe { _mm512_castps512_ps256(_mm512_permutexvar_ps(_mm512_castsi256_si512(places), numbers)) }
    }
}
