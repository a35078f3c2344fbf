//! The numbers of rays in registers, and how rays start.

use std::arch::x86_64::*;
use std::mem::MaybeUninit;

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use super::X86;
use crate::intersect::axes::{Axes, Sides};
use crate::intersect::box_ray::{END_FACTOR, LITTLE, START_FACTOR, Slabs};
use crate::ray32::Ray32;
use crate::simd::{LANES, Row};
use crate::tree::filter_start::FilterStart;

impl<const AVX512: bool> X86<AVX512> {
    /// The numbers of a ray, at least eight: see above.
    #[inline(always)]
    pub(super) fn numbers(ray: &Ray) -> *const f64 {
        let ray: *const Ray = ray;
        ray.cast()
    }

    /// Eight rays, transposed. The columns are written as wide as they are read: a load that spans two stores would
    /// stall.
    #[inline(always)]
    pub(super) fn columns_by_eight(rays: &[Ray; LANES], columns: &mut [Row<f64>; 8]) {
        const EVEN: i32 = 0b10_00_10_00;
        const ODD: i32 = 0b11_01_11_01;
        for half in 0..2 {
            let at = |i: usize| Self::numbers(&rays[8 * half + i]);
            // SAFETY: see `X86`; only called where `AVX512` is. The loads are of the eight numbers of a ray, see above;
            // the stores of eight f64 from the first or the ninth on, into arrays of sixteen.
            unsafe {
                // One by one: a closure may become a call.
                let (a, b, c, d) = (
                    _mm512_loadu_pd(at(0)),
                    _mm512_loadu_pd(at(1)),
                    _mm512_loadu_pd(at(2)),
                    _mm512_loadu_pd(at(3)),
                );
                let (e, f, g, h) = (
                    _mm512_loadu_pd(at(4)),
                    _mm512_loadu_pd(at(5)),
                    _mm512_loadu_pd(at(6)),
                    _mm512_loadu_pd(at(7)),
                );
                let even = [
                    _mm512_unpacklo_pd(a, b),
                    _mm512_unpacklo_pd(c, d),
                    _mm512_unpacklo_pd(e, f),
                    _mm512_unpacklo_pd(g, h),
                ];
                let odd = [
                    _mm512_unpackhi_pd(a, b),
                    _mm512_unpackhi_pd(c, d),
                    _mm512_unpackhi_pd(e, f),
                    _mm512_unpackhi_pd(g, h),
                ];
                for (first, [a, b, c, d]) in [even, odd].into_iter().enumerate() {
                    let (low, more_low) =
                        (_mm512_shuffle_f64x2::<EVEN>(a, b), _mm512_shuffle_f64x2::<EVEN>(c, d));
                    let (high, more_high) =
                        (_mm512_shuffle_f64x2::<ODD>(a, b), _mm512_shuffle_f64x2::<ODD>(c, d));
                    let of_eight = [
                        _mm512_shuffle_f64x2::<EVEN>(low, more_low),
                        _mm512_shuffle_f64x2::<EVEN>(high, more_high),
                        _mm512_shuffle_f64x2::<ODD>(low, more_low),
                        _mm512_shuffle_f64x2::<ODD>(high, more_high),
                    ];
                    for (place, of_eight) in of_eight.into_iter().enumerate() {
                        _mm512_storeu_pd(columns[first + 2 * place].0.as_mut_ptr().add(8 * half), of_eight);
                    }
                }
            }
        }
    }

    /// The first four numbers, and the last four of eight: other pieces would span two stores.
    #[inline(always)]
    pub(super) fn halves(ray: &Ray) -> (__m256d, __m256d) {
        let numbers = Self::numbers(ray);
        // SAFETY: see `X86`. The loads are of the eight numbers of a ray.
        unsafe { (_mm256_loadu_pd(numbers), _mm256_loadu_pd(numbers.add(4))) }
    }

    /// The ray of these halves.
    #[inline(always)]
    pub(super) fn of_halves(first: __m256d, last: __m256d, time: f64) -> Ray {
        let mut ray = MaybeUninit::<Ray>::uninit();
        let to = ray.as_mut_ptr();
        // SAFETY: see `X86`. A ray is eight numbers and its time, which are all written.
        unsafe {
            _mm256_storeu_pd(to.cast(), first);
            _mm256_storeu_pd(to.cast::<f64>().add(4), last);
            (&raw mut (*to).time).write(time);
            ray.assume_init()
        }
    }

    /// The origin, the direction and the ends of the range of these halves; the last of four is unused.
    #[inline(always)]
    pub(super) fn parts((first, last): (__m256d, __m256d)) -> (__m256d, __m256d, __m128d) {
        // SAFETY: see `X86`.
        unsafe {
            let middle = _mm256_permute2f128_pd::<0x21>(first, last);
            let direction = _mm256_shuffle_pd::<0b0101>(middle, last);
            (first, direction, _mm256_extractf128_pd::<1>(last))
        }
    }

    /// [`Simd::start_filter`] of a ray by its numbers: the ends of the range are the first two lanes; the last lanes of
    /// the others are unused.
    #[inline(always)]
    pub(super) fn slabs(
        start: &FilterStart,
        origin: __m256d,
        direction: __m128,
        range: __m128,
    ) -> Option<Slabs> {
        // As the portable one, three axes at a time.
        // SAFETY: see `X86`. The loads are of arrays of four.
        unsafe {
            let from = _mm256_sub_pd(origin, _mm256_loadu_pd(start.tree_origin.as_ptr()));
            let from = _mm256_cvtpd_ps(_mm256_mul_pd(from, _mm256_set1_pd(start.scale)));

            let sign = _mm_set1_ps(-0.0);
            let (distance, length) = (_mm_andnot_ps(sign, from), _mm_andnot_ps(sign, direction));
            // Every comparison with a NaN is false.
            let fits = _mm_and_ps(
                _mm_and_ps(
                    _mm_cmple_ps(distance, _mm_loadu_ps(start.farthest.as_ptr())),
                    _mm_cmple_ps(length, _mm_loadu_ps(start.longest.as_ptr())),
                ),
                // 0 <= t_min, t_min <= t_max, and the first again.
                _mm_cmple_ps(_mm_unpacklo_ps(_mm_setzero_ps(), range), range),
            );
            let is_long = _mm_cmpge_ps(length, _mm_set1_ps(start.shortest));
            if _mm_movemask_ps(fits) & 0b111 != 0b111 || _mm_movemask_ps(is_long) & 0b111 == 0 {
                return None;
            }

            let size = _mm_max_ps(length, _mm_set1_ps(start.tiny));
            let size = _mm_div_ps(_mm_set1_ps(start.space_per_unit), size);
            let inverse = _mm_or_ps(size, _mm_and_ps(direction, sign));
            let per_distance = _mm_set1_ps(start.margin_per_distance);
            let margin = _mm_mul_ps(size, _mm_fmadd_ps(distance, per_distance, _mm_set1_ps(start.margin)));
            let ends = _mm_fmadd_ps(
                range,
                _mm_setr_ps(START_FACTOR, END_FACTOR, 0.0, 0.0),
                _mm_setr_ps(0.0, LITTLE as f32, 0.0, 0.0),
            );
            let (near, far) = (_mm_fnmsub_ps(from, inverse, margin), _mm_fnmadd_ps(from, inverse, margin));
            Some(Slabs {
                inverse: Self::array(inverse),
                // The first of the ends, and the second, become the fourth.
                near_offset: Self::array(_mm_insert_ps::<0x30>(near, ends)),
                far_offset: Self::array(_mm_insert_ps::<0x70>(far, ends)),
                sides: Sides::new(_mm_movemask_ps(direction) as u32),
            })
        }
    }

    /// The numbers of eight rays in single precision, transposed.
    #[inline(always)]
    pub(super) fn rows_of_eight(rays: &[Ray32; 8]) -> [__m256; 8] {
        const LOW: i32 = 0b01_00_01_00;
        const HIGH: i32 = 0b11_10_11_10;
        // SAFETY: see `X86`. The loads are of the eight numbers of a ray.
        unsafe {
            let at = rays.as_ptr().cast::<f32>();
            let (a, b) = (_mm256_loadu_ps(at), _mm256_loadu_ps(at.add(8)));
            let (c, d) = (_mm256_loadu_ps(at.add(16)), _mm256_loadu_ps(at.add(24)));
            let (e, f) = (_mm256_loadu_ps(at.add(32)), _mm256_loadu_ps(at.add(40)));
            let (g, h) = (_mm256_loadu_ps(at.add(48)), _mm256_loadu_ps(at.add(56)));
            // One by one: a closure may become a call.
            let (ab, ab2) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (cd, cd2) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            let (ef, ef2) = (_mm256_unpacklo_ps(e, f), _mm256_unpackhi_ps(e, f));
            let (gh, gh2) = (_mm256_unpacklo_ps(g, h), _mm256_unpackhi_ps(g, h));
            // Numbers 0 and 4, 1 and 5, 2 and 6, 3 and 7, of the first four rays and of the others.
            let first = [
                _mm256_shuffle_ps::<LOW>(ab, cd),
                _mm256_shuffle_ps::<HIGH>(ab, cd),
                _mm256_shuffle_ps::<LOW>(ab2, cd2),
                _mm256_shuffle_ps::<HIGH>(ab2, cd2),
            ];
            let others = [
                _mm256_shuffle_ps::<LOW>(ef, gh),
                _mm256_shuffle_ps::<HIGH>(ef, gh),
                _mm256_shuffle_ps::<LOW>(ef2, gh2),
                _mm256_shuffle_ps::<HIGH>(ef2, gh2),
            ];
            let mut rows = [_mm256_setzero_ps(); 8];
            for number in 0..4 {
                rows[number] = _mm256_permute2f128_ps::<0x20>(first[number], others[number]);
                rows[4 + number] = _mm256_permute2f128_ps::<0x31>(first[number], others[number]);
            }
            rows
        }
    }

    /// The axes for a direction: see [`Axes::new`].
    #[inline(always)]
    pub(super) fn axes_of(direction: __m256d) -> &'static Axes {
        // SAFETY: see `X86`.
        unsafe {
            let size = _mm256_andnot_pd(_mm256_set1_pd(-0.0), direction);
            // x, y, x and y, z, z.
            let sizes = _mm256_cmp_pd::<_CMP_GE_OQ>(
                _mm256_permute4x64_pd::<0b00_00_01_00>(size),
                _mm256_permute4x64_pd::<0b10_10_10_01>(size),
            );
            Axes::by_bits(_mm256_movemask_pd(direction) as u32, _mm256_movemask_pd(sizes) as u32)
        }
    }

    /// The axes for a direction in single precision.
    #[inline(always)]
    pub(super) fn f32_axes(direction: __m128) -> &'static Axes {
        // SAFETY: see `X86`.
        unsafe {
            let size = _mm_andnot_ps(_mm_set1_ps(-0.0), direction);
            // x, y, x and y, z, z.
            let sizes = _mm_cmpge_ps(
                _mm_shuffle_ps::<0b00_00_01_00>(size, size),
                _mm_shuffle_ps::<0b10_10_10_01>(size, size),
            );
            Axes::by_bits(_mm_movemask_ps(direction) as u32, _mm_movemask_ps(sizes) as u32)
        }
    }

    /// The numbers of a ray in single precision, eight in total: see above.
    #[inline(always)]
    pub(super) fn f32_start(ray: &Ray32) -> *const f32 {
        let ray: *const Ray32 = ray;
        ray.cast()
    }

    /// Origin and start, direction and end.
    #[inline(always)]
    pub(super) fn f32_numbers(ray: &Ray32) -> (__m128, __m128) {
        let numbers = Self::f32_start(ray);
        // SAFETY: see `X86`. A ray is eight f32 in this order.
        unsafe { (_mm_loadu_ps(numbers), _mm_loadu_ps(numbers.add(4))) }
    }

    /// Three coordinates relative to the mesh, rounded once; the fourth number stays unchanged.
    #[inline(always)]
    pub(super) fn local(start: &FilterStart, origin: __m128) -> __m128 {
        // SAFETY: see `X86`. The loads are of arrays of four.
        unsafe {
            if let Some(mesh_origin) = &start.single_mesh_origin {
                return _mm_sub_ps(origin, _mm_loadu_ps(mesh_origin.as_ptr()));
            }
            let origin = _mm256_sub_pd(_mm256_cvtps_pd(origin), _mm256_loadu_pd(start.mesh_origin.as_ptr()));
            _mm256_cvtpd_ps(origin)
        }
    }

    /// Three numbers and a zero.
    #[inline(always)]
    pub(super) fn three(v: &DVec3) -> __m256d {
        // SAFETY: see `X86`. Only the first three are loaded.
        unsafe { _mm256_maskload_pd(v.as_ref().as_ptr(), _mm256_setr_epi64x(-1, -1, -1, 0)) }
    }

    #[inline(always)]
    pub(super) fn array(v: __m128) -> [f32; 4] {
        let mut array = [0.0; 4];
        // SAFETY: see `X86`. The store is of four f32 into an array of four.
        unsafe { _mm_storeu_ps(array.as_mut_ptr(), v) };
        array
    }
}
