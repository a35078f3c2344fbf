//! The corners of triangles in blocks.

use std::arch::x86_64::*;

use bytemuck::Zeroable;

use super::X86;
use crate::intersect::axes::Axes;
use crate::intersect::triangles::Shears;
use crate::simd::x86::{Avx512, Eight256};
use crate::simd::{self, F32x16, LastEight, Vector};
use crate::tree::BLOCK;
use crate::tree::triangle_block::{SHARED_NUMBERS, TriangleBlock};

impl<const AVX512: bool> X86<AVX512> {
    /// A component of three corners, at these offsets from `row`.
    ///
    /// # Safety
    /// The offsets are in bounds.
    #[inline(always)]
    pub(super) unsafe fn component(row: *const f32, [a, b, c]: [usize; 3]) -> __m128 {
        // SAFETY: see `X86`, and above.
        unsafe { _mm_setr_ps(*row.add(a), *row.add(b), *row.add(c), 0.0) }
    }

    /// The numbers of a row at three indices below sixteen; higher bits of the indices are ignored. The last lane is
    /// unused. For AVX-512 only.
    ///
    /// # Safety
    /// Sixteen numbers are readable.
    /// There are sixteen to be read.
    #[inline(always)]
    pub(super) unsafe fn three_of(row: *const f32, places: __m128i) -> __m128 {
        // SAFETY: see `X86`, and above.
        unsafe {
            let three = _mm512_permutexvar_ps(_mm512_castsi128_si512(places), _mm512_loadu_ps(row));
            _mm512_castps512_ps128(three)
        }
    }

    /// The corners of the triangle in a lane, `[axis][corner]` in the order of the axes; the last of four is unused.
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

    /// Eight of sixteen numbers, each by its index in the same half of `near`, or of `far` from eight on: see
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

    /// The indices of eight vertices, four bits each; higher bits are undefined.
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
        // SAFETY: see `X86`. Of rows of a block that shares its vertices the first sixteen are read, of others the
        // first twenty-four.
        let vertices = unsafe {
            [
                Eight256::new(_mm256_loadu_ps(words.add(kx as usize + first))),
                Eight256::new(_mm256_loadu_ps(words.add(ky as usize + first))),
                Eight256::new(_mm256_loadu_ps(words.add(kz as usize + first))),
            ]
        };
        ray.apply(vertices)
    }

    /// The vertices that a block shares, sheared. For AVX-512 only.
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

    /// Eight of sixteen numbers by index. For AVX-512 only.
    #[inline(always)]
    pub(super) fn of_sixteen(numbers: __m512, places: __m256i) -> __m256 {
        // SAFETY: see `X86`.
        unsafe { _mm512_castps512_ps256(_mm512_permutexvar_ps(_mm512_castsi256_si512(places), numbers)) }
    }
}

impl X86<true> {
    /// The corners of two blocks that share vertices.
    #[inline(always)]
    pub(super) fn shared_by_two<S: Shears>(blocks: [&TriangleBlock; 2], rays: [&S; 2]) -> [[Avx512; 3]; 3] {
        let [first, second] = blocks;
        let a = Self::sheared_sixteen(first, simd::opaque(rays[0]));
        let b = Self::sheared_sixteen(second, simd::opaque(rays[1]));
        let last = LastEight::new().mask();
        let mut corners = [[Avx512::zeroed(); 3]; 3];
        // SAFETY: see `X86`.
        unsafe {
            let shifts = _mm512_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28, 0, 4, 8, 12, 16, 20, 24, 28);
            let places = _mm512_set1_epi32(SHARED_NUMBERS as i32 - 1);
            // Selects the last sixteen of thirty-two numbers.
            let of_second = _mm512_maskz_set1_epi32(0xff00, SHARED_NUMBERS as i32);
            const OR_AND: i32 = 0b1111_1000;
            for (corner, (&of_a, of_b)) in first.corners().iter().zip(second.corners()).enumerate() {
                let both = _mm512_mask_set1_epi32(_mm512_set1_epi32(of_a as i32), last, of_b as i32);
                let both = _mm512_srlv_epi32(both, shifts);
                let both = _mm512_ternarylogic_epi32::<OR_AND>(of_second, both, places);
                corners[0][corner] = Avx512::new(_mm512_permutex2var_ps(a[0].raw(), both, b[0].raw()));
                corners[1][corner] = Avx512::new(_mm512_permutex2var_ps(a[1].raw(), both, b[1].raw()));
                corners[2][corner] = Avx512::new(_mm512_permutex2var_ps(a[2].raw(), both, b[2].raw()));
            }
        }
        corners
    }

    /// The corners of two blocks that share none; `rests` are the rounding errors of the rays' origins.
    #[inline(always)]
    pub(super) fn unshared_by_two<S: Shears>(
        blocks: [&TriangleBlock; 2],
        rays: [&S; 2],
        rests: [&[f32; 4]; 2],
    ) -> [[Avx512; 3]; 3] {
        let splat = Avx512::splat_two;
        let last = LastEight::new();
        let [a, b] = [simd::opaque(rays[0]), simd::opaque(rays[1])];
        let ([ax, ay, az, _], [bx, by, bz, _]) = (*a.origin(), *b.origin());
        let origin = [splat(ax, bx, last), splat(ay, by, last), splat(az, bz, last)];
        let rest = [splat(rests[0][0], rests[1][0], last), splat(rests[0][1], rests[1][1], last)];
        let shear = [splat(a.shear()[0], b.shear()[0], last), splat(a.shear()[1], b.shear()[1], last)];
        let (rows_a, rows_b) = (&a.axes().unshared_rows, &b.axes().unshared_rows);
        let [first, second] = [blocks[0].words().as_ptr(), blocks[1].words().as_ptr()];
        let mut corners = [[Avx512::zeroed(); 3]; 3];
        for (corner, sheared) in corners.iter_mut().enumerate() {
            let mut arms = [Avx512::zeroed(); 3];
            for (axis, arm) in arms.iter_mut().enumerate() {
                let (of_a, of_b) = (rows_a[axis] as usize, rows_b[axis] as usize);
                let own = BLOCK * corner;
                // SAFETY: see `X86`. The first twenty-four of such rows are read.
                let vertices = unsafe {
                    let low = _mm256_loadu_ps(first.add(of_a + own));
                    let high = _mm256_loadu_ps(second.add(of_b + own));
                    Avx512::new(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high))
                };
                *arm = origin[axis] - vertices;
            }
            let [across, up, z] = arms;
            *sheared = [shear[0].neg_mul_add(z, across + rest[0]), shear[1].neg_mul_add(z, up + rest[1]), z];
        }
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = corners;
        [[ax, bx, cx], [ay, by, cy], [az, bz, cz]]
    }
}
