//! AVX2 with FMA, and AVX-512 on vectors of 256 bits.

mod corners;
mod rays;

use std::arch::x86_64::*;
use std::mem::{MaybeUninit, offset_of};

use bytemuck::Zeroable;
use lumbre_geometry::Ray;
use lumbre_math::{DAffine3, Transform};

use crate::intersect::axes::{Axes, Sides};
use crate::intersect::box_ray::{BoxRay, END_FACTOR, LITTLE, START_FACTOR, Slabs};
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::isa::{Isa, Set};
use crate::intersect::operations::{CornerScratch, Simd};
use crate::intersect::triangles::Shears;
use crate::intersect::watertight::{BlockRay, EdgeTest, FAR, HeightRange, Inside, ROUNDINGS, Shear};
use crate::ray32::Ray32;
use crate::simd::x86::{Avx2, Avx512, Eight256};
use crate::simd::{self, F32x16, LANES, Row};
use crate::tree::BLOCK;
use crate::tree::Corners;
use crate::tree::filter_start::FilterStart;
use crate::tree::node::{LARGEST_NEAR, SMALLEST_NEAR, TINY_NEAR, TreeSpace};
use crate::tree::triangle_block::{TriangleBlock, shared_row};

/// The operations of both levels. Only roots that enable AVX-512 instantiate `X86<true>`, and only roots that enable
/// AVX2 `X86<false>`, so the instructions below are available.
pub(crate) struct X86<const AVX512: bool>;

// The numbers of a ray are contiguous: origin, direction, range.
const _: () = assert!(size_of::<Ray32>() == 32 && offset_of!(Ray32, direction) == 16);
const _: () =
    assert!(offset_of!(Ray, direction) == 24 && offset_of!(Ray, t_min) == 48 && offset_of!(Ray, t_max) == 56);
const _: () = assert!(size_of::<Ray>() == 72 && offset_of!(Ray, time) == 64);

/// The sixteen-lane vectors of each level, and the operations that differ.
pub(crate) trait HasWide<const AVX512: bool> {
    type F32x16: F32x16<Half = Eight256<AVX512>>;

    /// [`Simd::sheared_corners_by_two`] with AVX-512, if that is faster; otherwise `None`.
    #[inline(always)]
    fn corners_by_two<S: Shears>(
        _blocks: [&TriangleBlock; 2],
        _rays: [&S; 2],
    ) -> Option<[[Self::F32x16; 3]; 3]> {
        None
    }
}

impl HasWide<true> for X86<true> {
    type F32x16 = Avx512;

    #[inline(always)]
    fn corners_by_two<S: Shears>(blocks: [&TriangleBlock; 2], rays: [&S; 2]) -> Option<[[Avx512; 3]; 3]> {
        match [blocks[0].is_unshared(), blocks[1].is_unshared()] {
            [false, false] => Some(Self::shared_by_two(blocks, rays)),
            // Without rests there is too little work to pay for joining both blocks.
            [true, true] => match (rays[0].rest(), rays[1].rest()) {
                (Some(a), Some(b)) => Some(Self::unshared_by_two(blocks, rays, [a, b])),
                _ => None,
            },
            _ => None,
        }
    }
}

impl HasWide<false> for X86<false> {
    type F32x16 = Avx2;
}

impl<const AVX512: bool> Simd for X86<AVX512>
where
    Self: HasWide<AVX512>,
{
    type F32x8 = Eight256<AVX512>;
    type F32x16 = <Self as HasWide<AVX512>>::F32x16;
    const INTERSECTS_BY_TWO: bool = AVX512;
    // Packets take twice the instructions on AVX2, and single rays hardly more.
    const GOES_ON_TOGETHER: bool = AVX512;

    #[inline(always)]
    fn isa() -> Isa {
        Isa(if AVX512 { Set::Avx512 } else { Set::Avx2 })
    }

    #[inline(always)]
    fn start_nearby(tree_space: &TreeSpace, ray: &Ray, t_min: f64, t_max: f64, boxes: &mut BoxRay) -> bool {
        // As the portable one, three axes at a time.
        // SAFETY: see `X86`. The loads are of three f64 in arrays of three, and of four in arrays of four; the stores
        // of four f32 into arrays of four.
        unsafe {
            let origin = Self::three(&ray.origin);
            let direction = Self::three(&ray.direction);
            let scale = _mm256_set1_pd(tree_space.scale);
            let tree_origin = _mm256_loadu_pd(tree_space.padded_origin.as_ptr());
            let start = _mm256_mul_pd(_mm256_sub_pd(origin, tree_origin), scale);
            let direction = _mm256_mul_pd(direction, scale);
            let sign = _mm256_set1_pd(-0.0);
            let distance = _mm256_andnot_pd(sign, start);
            let size = _mm256_andnot_pd(sign, direction);
            let fits = _mm256_and_pd(
                _mm256_cmp_pd::<_CMP_LE_OQ>(distance, _mm256_set1_pd(tree_space.near)),
                _mm256_cmp_pd::<_CMP_LE_OQ>(size, _mm256_set1_pd(LARGEST_NEAR)),
            );
            let is_long = _mm256_cmp_pd::<_CMP_GE_OQ>(size, _mm256_set1_pd(SMALLEST_NEAR));
            let is_near = _mm256_movemask_pd(fits) == 0b1111 && _mm256_movemask_pd(is_long) != 0;
            if !(is_near && 0.0 <= t_min && t_min <= t_max) {
                return false;
            }
            let size = _mm256_max_pd(size, _mm256_set1_pd(TINY_NEAR));
            let signs = _mm256_and_pd(direction, sign);
            // Divides 1 by the magnitude; the sign is restored below.
            let size = _mm256_div_pd(_mm256_set1_pd(1.0), size);
            let inverse = _mm256_or_pd(size, signs);
            let per_distance = _mm256_set1_pd(tree_space.margin_per_distance);
            let margin = _mm256_mul_pd(
                size,
                _mm256_fmadd_pd(distance, per_distance, _mm256_set1_pd(tree_space.near_margin)),
            );
            let near = _mm256_fnmsub_pd(start, inverse, margin);
            let far = _mm256_fnmadd_pd(start, inverse, margin);
            let slabs = &mut boxes.slabs;
            _mm_storeu_ps(slabs.inverse.as_mut_ptr(), _mm256_cvtpd_ps(inverse));
            _mm_storeu_ps(slabs.near_offset.as_mut_ptr(), _mm256_cvtpd_ps(near));
            _mm_storeu_ps(slabs.far_offset.as_mut_ptr(), _mm256_cvtpd_ps(far));
            slabs.sides = Sides::new(_mm256_movemask_pd(direction) as u32);
        }
        boxes.set_range_nearby(t_min, t_max);
        true
    }

    #[inline(always)]
    fn start_filter(start: &FilterStart, ray: &Ray) -> Option<Slabs> {
        let (origin, direction, range) = Self::parts(Self::halves(ray));
        // SAFETY: see `X86`.
        let (direction, range) = unsafe { (_mm256_cvtpd_ps(direction), _mm_cvtpd_ps(range)) };
        Self::slabs(start, origin, direction, range)
    }

    #[inline(always)]
    fn read(ray: &Ray) -> Ray {
        let from = Self::numbers(ray);
        // SAFETY: see `X86`. Eight numbers of a ray are read. Volatile: the compiler would otherwise merge the narrow
        // loads.
        unsafe {
            let at = |i: usize| from.add(i).read_volatile();
            let (first, last) =
                (_mm256_setr_pd(at(0), at(1), at(2), at(3)), _mm256_setr_pd(at(4), at(5), at(6), at(7)));
            Self::of_halves(first, last, ray.time)
        }
    }

    #[inline(always)]
    fn read_f32(ray: &Ray32) -> Ray32 {
        let from = Self::f32_start(ray);
        let mut own = MaybeUninit::<Ray32>::uninit();
        let to: *mut f32 = own.as_mut_ptr().cast();
        // SAFETY: as there. A ray is eight f32, which are all read, and written.
        unsafe {
            let at = |i: usize| from.add(i).read_volatile();
            _mm_storeu_ps(to, _mm_setr_ps(at(0), at(1), at(2), at(3)));
            _mm_storeu_ps(to.add(4), _mm_setr_ps(at(4), at(5), at(6), at(7)));
            own.assume_init()
        }
    }

    #[inline(always)]
    fn start_f32(start: &FilterStart, ray: &Ray32) -> Option<Slabs> {
        // As the portable one, three axes at a time.
        // SAFETY: see `X86`. The loads are of arrays of four.
        unsafe {
            let (origin, direction) = Self::f32_numbers(ray);
            // Fused or not, the result is the same: units are powers of two.
            let from = _mm_fmsub_ps(
                Self::local(start, origin),
                _mm_set1_ps(start.units_per_space),
                _mm_loadu_ps(start.shift.as_ptr()),
            );
            let sign = _mm_set1_ps(-0.0);
            let (distance, length) = (_mm_andnot_ps(sign, from), _mm_andnot_ps(sign, direction));
            // Every comparison with a NaN is false. The fourth lane: t_min is not negative, and t_min <= t_max.
            let farthest = _mm_loadu_ps(start.farthest.as_ptr());
            let size = _mm_blend_ps::<0b1000>(length, origin);
            let largest = _mm_blend_ps::<0b1000>(_mm_loadu_ps(start.longest.as_ptr()), direction);
            let shortest = _mm_set1_ps(start.shortest);
            let (fits, is_long) = if AVX512 {
                let is_near = _mm_cmp_ps_mask::<_CMP_LE_OQ>(distance, farthest);
                let fits = _mm_mask_cmp_ps_mask::<_CMP_LE_OQ>(is_near, size, largest);
                let sign_of_last = _mm_setr_epi32(0, 0, 0, i32::MIN);
                let fits = _mm_mask_testn_epi32_mask(fits, _mm_castps_si128(origin), sign_of_last);
                (fits == 0b1111, _mm_cmp_ps_mask::<_CMP_GE_OQ>(length, shortest) & 0b111 != 0)
            } else {
                let fits = _mm_and_ps(_mm_cmple_ps(distance, farthest), _mm_cmple_ps(size, largest));
                let is_before = _mm_movemask_ps(origin) & 0b1000 != 0;
                let is_long = _mm_movemask_ps(_mm_cmpge_ps(length, shortest)) & 0b111 != 0;
                (_mm_movemask_ps(fits) == 0b1111 && !is_before, is_long)
            };
            if !(fits && is_long) {
                return None;
            }
            let size = _mm_max_ps(length, _mm_set1_ps(start.tiny));
            let size = _mm_div_ps(_mm_set1_ps(start.space_per_unit), size);
            let inverse = _mm_or_ps(size, _mm_and_ps(direction, sign));
            let per_distance = _mm_set1_ps(TreeSpace::F32_MARGIN_PER_DISTANCE);
            let margin =
                _mm_mul_ps(size, _mm_fmadd_ps(distance, per_distance, _mm_set1_ps(start.f32_margin)));
            let (near, far) = (_mm_fnmsub_ps(from, inverse, margin), _mm_fnmadd_ps(from, inverse, margin));
            // Of the fourth lanes. Not fused.
            let first = _mm_mul_ps(origin, _mm_set1_ps(START_FACTOR));
            let last = _mm_mul_ps(direction, _mm_set1_ps(END_FACTOR));
            let last = _mm_add_ps(last, _mm_set1_ps(LITTLE as f32));
            Some(Slabs {
                inverse: Self::array(inverse),
                near_offset: Self::array(_mm_blend_ps::<0b1000>(near, first)),
                far_offset: Self::array(_mm_blend_ps::<0b1000>(far, last)),
                sides: Sides::new(_mm_movemask_ps(direction) as u32),
            })
        }
    }

    #[inline(always)]
    fn start_f32_blocks(start: &FilterStart, ray: &Ray32, slabs: &Slabs) -> F32Ray {
        // SAFETY: see `X86`. The loads are of arrays of four.
        unsafe {
            let (origin, direction) = Self::f32_numbers(ray);
            let local = Self::local(start, origin);
            let axes = Self::f32_axes(direction);
            let order = _mm_loadu_si128(axes.order.as_ptr().cast());
            let last = _mm_shuffle_epi32::<0b10_10_10_10>(order);
            let inverse = _mm_permutevar_ps(_mm_loadu_ps(slabs.inverse.as_ptr()), last);
            let inverse = _mm_mul_ps(inverse, _mm_set1_ps(start.units_per_space));
            // The fourth lane keeps the start and the end of the ray.
            let shear = _mm_blend_ps::<0b1000>(_mm_mul_ps(direction, inverse), direction);
            let shear = _mm_permutevar_ps(shear, order);
            F32Ray {
                axes,
                origin: Self::array(_mm_permutevar_ps(local, order)),
                shear: Self::array(shear),
                minus_inverse: -_mm_cvtss_f32(inverse),
            }
        }
    }

    #[inline(always)]
    fn start_placed(
        start: &FilterStart,
        map: &Transform,
        ray: &Ray,
        [t_min, t_max]: [f64; 2],
    ) -> (Ray, Option<Slabs>) {
        let DAffine3 { matrix3: linear, translation } = map.inverse_affine();
        // The same operations as `Ray::into_object`, three axes at a time. The slabs are computed from registers:
        // loading the ray again, just written in parts, would stall.
        // SAFETY: see `X86`.
        unsafe {
            let (x, y, z) =
                (Self::three(&linear.x_axis), Self::three(&linear.y_axis), Self::three(&linear.z_axis));
            let (from, along) = (&ray.origin, &ray.direction);
            let origin = _mm256_mul_pd(x, _mm256_set1_pd(from.x));
            let origin = _mm256_add_pd(origin, _mm256_mul_pd(y, _mm256_set1_pd(from.y)));
            let origin = _mm256_add_pd(origin, _mm256_mul_pd(z, _mm256_set1_pd(from.z)));
            let origin = _mm256_add_pd(origin, Self::three(translation));
            let direction = _mm256_mul_pd(x, _mm256_set1_pd(along.x));
            let direction = _mm256_add_pd(direction, _mm256_mul_pd(y, _mm256_set1_pd(along.y)));
            let direction = _mm256_add_pd(direction, _mm256_mul_pd(z, _mm256_set1_pd(along.z)));
            let ends = _mm_setr_pd(t_min, t_max);
            let slabs = Self::slabs(start, origin, _mm256_cvtpd_ps(direction), _mm_cvtpd_ps(ends));
            let first = _mm256_blend_pd::<0b1000>(origin, _mm256_permute4x64_pd::<0b00_00_00_00>(direction));
            let rest = _mm256_castpd256_pd128(_mm256_permute4x64_pd::<0b00_00_10_01>(direction));
            let last = _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(rest), ends);
            let ray = Self::of_halves(first, last, ray.time);
            (ray, slabs)
        }
    }

    #[inline(always)]
    fn start_blocks(start: &FilterStart, ray: &Ray, slabs: &Slabs) -> (BlockRay, f32) {
        // As the portable one, three axes at a time.
        // SAFETY: see `X86`. The loads are of arrays of four.
        unsafe {
            let (origin, direction, range) = Self::parts(Self::halves(ray));
            let axes = Self::axes_of(direction);
            let (direction, range) = (_mm256_cvtpd_ps(direction), _mm_cvtpd_ps(range));
            let exact = _mm256_sub_pd(origin, _mm256_loadu_pd(start.mesh_origin.as_ptr()));
            let origin = _mm256_cvtpd_ps(exact);
            let rest = _mm256_cvtpd_ps(_mm256_sub_pd(exact, _mm256_cvtps_pd(origin)));
            let range = _mm_movelh_ps(range, range);

            let sign = _mm_set1_ps(-0.0);
            let length = _mm_andnot_ps(sign, direction);
            let order = _mm_loadu_si128(axes.order.as_ptr().cast());
            let last = _mm_shuffle_epi32::<0b10_10_10_10>(order);
            let inverse = _mm_permutevar_ps(_mm_loadu_ps(slabs.inverse.as_ptr()), last);
            let inverse = _mm_mul_ps(inverse, _mm_set1_ps(start.units_per_space));
            let length = _mm_permutevar_ps(length, last);
            // Start, end, start, end; none of them negative.
            let heights = _mm_min_ps(_mm_mul_ps(range, length), _mm_set1_ps(FAR));
            const LESS: f32 = 1.0 - ROUNDINGS;
            const MORE: f32 = 1.0 + ROUNDINGS;
            let heights = _mm_mul_ps(heights, _mm_setr_ps(LESS, MORE, MORE, LESS));
            let shear = _mm_permutevar_ps(_mm_mul_ps(direction, inverse), order);
            let rest = _mm_permutevar_ps(rest, order);
            // Only the first two: the last would have a shear of one.
            let sheared = _mm_fnmadd_ps(shear, _mm_shuffle_ps::<0b10_10_10_10>(rest, rest), rest);
            let blocks = BlockRay {
                axes,
                origin: Self::array(_mm_permutevar_ps(origin, order)),
                rest: Self::array(_mm_blend_ps::<0b1100>(sheared, rest)),
                shear: Self::array(shear),
                least_size: start.least_size,
                range: std::mem::transmute::<[f32; 4], HeightRange>(Self::array(heights)),
                turn: _mm_cvtss_f32(_mm_andnot_ps(inverse, sign)),
            };
            (blocks, _mm_cvtss_f32(_mm_andnot_ps(sign, inverse)))
        }
    }

    #[inline(always)]
    fn f32_rows(rays: &[Ray32; LANES], rows: &mut [Row<f32>; 8]) {
        let (first, last) = rays.split_at(8);
        let (Ok(first), Ok(last)) = (first.try_into(), last.try_into()) else {
            unreachable!("sixteen are twice eight")
        };
        let (low, high) = (Self::rows_of_eight(first), Self::rows_of_eight(last));
        for (row, (low, high)) in rows.iter_mut().zip(low.into_iter().zip(high)) {
            // SAFETY: see `X86`. The stores are of sixteen f32, or of eight from the first or the ninth on, into an
            // array of sixteen.
            unsafe {
                let row = row.0.as_mut_ptr();
                if AVX512 {
                    // As wide as it is read: a load that spans two stores would stall.
                    let both = _mm512_insertf64x4::<1>(
                        _mm512_castps_pd(_mm512_castps256_ps512(low)),
                        _mm256_castps_pd(high),
                    );
                    _mm512_storeu_ps(row, _mm512_castpd_ps(both));
                } else {
                    _mm256_storeu_ps(row, low);
                    _mm256_storeu_ps(row.add(8), high);
                }
            }
        }
    }

    #[inline(always)]
    fn columns(rays: &[Ray; LANES], columns: &mut [Row<f64>; 8]) {
        if AVX512 {
            Self::columns_by_eight(rays, columns);
            return;
        }
        for four in 0..LANES / 4 {
            for half in 0..2 {
                let at = |i: usize| Self::numbers(&rays[4 * four + i]).wrapping_add(4 * half);
                let (a, b, c, d) = (at(0), at(1), at(2), at(3));
                let columns = &mut columns[4 * half..][..4];
                // SAFETY: see `X86`. The loads are of the first or the last four of the eight numbers of a ray, see
                // above; the stores of four f64 from a multiple of four below sixteen on, into arrays of sixteen.
                unsafe {
                    let (a, b) = (_mm256_loadu_pd(a), _mm256_loadu_pd(b));
                    let (c, d) = (_mm256_loadu_pd(c), _mm256_loadu_pd(d));
                    let (even, odd) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
                    let (more_even, more_odd) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
                    let of_four = [
                        _mm256_permute2f128_pd::<0x20>(even, more_even),
                        _mm256_permute2f128_pd::<0x20>(odd, more_odd),
                        _mm256_permute2f128_pd::<0x31>(even, more_even),
                        _mm256_permute2f128_pd::<0x31>(odd, more_odd),
                    ];
                    for (column, of_four) in columns.iter_mut().zip(of_four) {
                        _mm256_storeu_pd(column.0.as_mut_ptr().add(4 * four), of_four);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn sheared_corners_by_two<S: Shears>(
        blocks: [&TriangleBlock; 2],
        rays: [&S; 2],
    ) -> [[Self::F32x16; 3]; 3] {
        if let Some(corners) = Self::corners_by_two(blocks, rays) {
            return corners;
        }
        let [x, y, z] = Self::sheared_corners(blocks[0], rays[0]);
        let [other_x, other_y, other_z] = Self::sheared_corners(blocks[1], rays[1]);
        [simd::three_of_two(&x, &other_x), simd::three_of_two(&y, &other_y), simd::three_of_two(&z, &other_z)]
    }

    #[inline(always)]
    fn sheared_corners<S: Shears>(block: &TriangleBlock, ray: &S) -> [[Self::F32x8; 3]; 3] {
        let axes = ray.axes();
        if block.is_unshared() {
            let a = Self::sheared_eight(block, ray, &axes.unshared_rows, 0);
            let b = Self::sheared_eight(block, ray, &axes.unshared_rows, BLOCK);
            let c = Self::sheared_eight(block, ray, &axes.unshared_rows, 2 * BLOCK);
            return [[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]];
        }
        let mut corners = [[Eight256::zeroed(); 3]; 3];
        if AVX512 {
            let vertices = Self::sheared_sixteen(block, simd::opaque(ray));
            for (corner, &places) in block.corners().iter().enumerate() {
                let places = Self::places(places);
                for axis in 0..3 {
                    let found = Self::of_sixteen(vertices[axis].raw(), places);
                    // SAFETY: see `X86`.
                    corners[axis][corner] = unsafe { Eight256::new(found) };
                }
            }
        } else {
            let near = Self::sheared_eight(block, ray, &axes.shared_rows, 0);
            let far = Self::sheared_eight(block, ray, &axes.shared_rows, BLOCK);
            for (corner, &places) in block.corners().iter().enumerate() {
                let places = Self::places(places);
                for axis in 0..3 {
                    let found = Self::of_two(near[axis].raw(), far[axis].raw(), places);
                    // SAFETY: see `X86`.
                    corners[axis][corner] = unsafe { Eight256::new(found) };
                }
            }
        }
        corners
    }

    #[inline(always)]
    fn truncated(numbers: &[f32; BLOCK]) -> [i32; BLOCK] {
        let mut whole = [0; BLOCK];
        // SAFETY: see `X86`. The load and the store are of eight numbers in arrays of eight.
        unsafe {
            let truncated = _mm256_cvttps_epi32(_mm256_loadu_ps(numbers.as_ptr()));
            _mm256_storeu_si256(whole.as_mut_ptr().cast(), truncated);
        }
        whole
    }

    #[inline(always)]
    fn equals_before(list: &[u32; 3 * BLOCK]) -> [u32; 3 * BLOCK] {
        let mut equals = [0; 3 * BLOCK];
        // SAFETY: see `X86`. The loads and stores are of eight or sixteen numbers of arrays of twenty-four.
        unsafe {
            if AVX512 {
                let (first, last) = list.split_at(2 * BLOCK);
                let sixteen = _mm512_loadu_si512(first.as_ptr().cast());
                _mm512_storeu_si512(equals.as_mut_ptr().cast(), _mm512_conflict_epi32(sixteen));
                let eight = _mm256_loadu_si256(last.as_ptr().cast());
                let before = _mm256_slli_epi32::<16>(_mm256_conflict_epi32(eight));
                _mm256_storeu_si256(equals.as_mut_ptr().add(2 * BLOCK).cast(), before);
                for (equals, &number) in equals[2 * BLOCK..].iter_mut().zip(last) {
                    let number = _mm512_set1_epi32(number as i32);
                    *equals |= u32::from(_mm512_cmpeq_epi32_mask(sixteen, number));
                }
                return equals;
            }
            let (eights, _) = list.as_chunks::<BLOCK>();
            for last in 0..3 {
                for at in BLOCK * last..BLOCK * (last + 1) {
                    let number = _mm256_set1_epi32(list[at] as i32);
                    // Later groups of eight contain no earlier equals.
                    for (i, eight) in eights[..=last].iter().enumerate() {
                        let is_equal = _mm256_cmpeq_epi32(_mm256_loadu_si256(eight.as_ptr().cast()), number);
                        let mask = _mm256_movemask_ps(_mm256_castsi256_ps(is_equal)) as u32;
                        equals[at] |= mask << (BLOCK * i);
                    }
                    equals[at] &= (1 << at) - 1;
                }
            }
        }
        equals
    }

    #[inline(always)]
    fn corners<'a>(block: &'a TriangleBlock, room: &'a mut CornerScratch) -> &'a Corners {
        if block.is_unshared() {
            return block.own_corners();
        }
        let CornerScratch(corners) = room;
        let words = block.words().as_ptr();
        // No closures: they do not inherit target features.
        let [a, b, c] = block.corners();
        let places = [Self::places(a), Self::places(b), Self::places(c)];
        // SAFETY: see `X86`. The first sixteen of a row are read.
        unsafe {
            for (axis, corners) in corners.iter_mut().enumerate() {
                let row = words.add(shared_row(axis));
                for (corner, &places) in corners.iter_mut().zip(&places) {
                    let found = if AVX512 {
                        Self::of_sixteen(_mm512_loadu_ps(row), places)
                    } else {
                        Self::of_two(_mm256_loadu_ps(row), _mm256_loadu_ps(row.add(BLOCK)), places)
                    };
                    _mm256_storeu_ps(corner.as_mut_ptr(), found);
                }
            }
        }
        corners
    }

    #[inline(always)]
    fn shear(ray: &Ray, axes: &'static Axes, mesh_origin: &[f64; 4]) -> (Shear, [f64; 3]) {
        let (origin, direction, _) = Self::parts(Self::halves(ray));
        // SAFETY: see `X86`. The loads are of arrays of four and eight.
        unsafe {
            let halves = _mm256_loadu_si256(axes.halves.as_ptr().cast());
            let origin = _mm256_sub_pd(origin, _mm256_loadu_pd(mesh_origin.as_ptr()));
            let origin = _mm256_permutevar8x32_ps(_mm256_castpd_ps(origin), halves);
            let direction = _mm256_permutevar8x32_ps(_mm256_castpd_ps(direction), halves);
            let direction = _mm256_castps_pd(direction);
            let last = _mm256_permute4x64_pd::<0b10_10_10_10>(direction);
            let shear = _mm_div_pd(_mm256_castpd256_pd128(direction), _mm256_castpd256_pd128(last));
            let mut local = [0.0; 4];
            _mm256_storeu_pd(local.as_mut_ptr(), _mm256_castps_pd(origin));
            let shear = Shear {
                axes,
                x: _mm_cvtsd_f64(shear),
                y: _mm_cvtsd_f64(_mm_unpackhi_pd(shear, shear)),
                direction_z: _mm256_cvtsd_f64(last),
            };
            (shear, [local[0], local[1], local[2]])
        }
    }

    #[inline(always)]
    fn pass(block: &TriangleBlock, lane: usize, shear: &Shear, origin: &[f64; 3]) -> (EdgeTest, Inside) {
        // The corners in the first three lanes, and the same operations as the portable version.
        let [across, up, z] = Self::corners_in(block, lane, shear.axes);
        // SAFETY: see `X86`.
        unsafe {
            let (across, up, z) = (_mm256_cvtps_pd(across), _mm256_cvtps_pd(up), _mm256_cvtps_pd(z));
            let z = _mm256_sub_pd(z, _mm256_set1_pd(origin[2]));
            let across = _mm256_sub_pd(across, _mm256_set1_pd(origin[0]));
            let up = _mm256_sub_pd(up, _mm256_set1_pd(origin[1]));
            // No fused multiply-add here and below.
            let x = _mm256_sub_pd(across, _mm256_mul_pd(_mm256_set1_pd(shear.x), z));
            let y = _mm256_sub_pd(up, _mm256_mul_pd(_mm256_set1_pd(shear.y), z));
            // c, a, b and b, c, a.
            let (px, py) =
                (_mm256_permute4x64_pd::<0b11_01_00_10>(x), _mm256_permute4x64_pd::<0b11_01_00_10>(y));
            let (qx, qy) =
                (_mm256_permute4x64_pd::<0b11_00_10_01>(x), _mm256_permute4x64_pd::<0b11_00_10_01>(y));
            let product = _mm256_mul_pd(px, qy);
            let edges = _mm256_sub_pd(product, _mm256_mul_pd(py, qx));
            let zero = _mm256_setzero_pd();
            let is_negative = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(edges, zero)) & 7;
            let is_positive = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(edges, zero)) & 7;
            if is_positive != 7 && is_negative != 7 {
                let is_zero = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(edges, zero)) & 7;
                let is_uncertain = is_zero | is_positive == 7 || is_zero | is_negative == 7;
                return (if is_uncertain { EdgeTest::Uncertain } else { EdgeTest::Outside }, Inside::NONE);
            }
            let (u, w) = (_mm256_castpd256_pd128(edges), _mm256_extractf128_pd::<1>(edges));
            let v = _mm_unpackhi_pd(u, u);
            let det = _mm_add_sd(_mm_add_sd(u, v), w);
            let heights = _mm256_mul_pd(edges, z);
            let (of_a, of_c) = (_mm256_castpd256_pd128(heights), _mm256_extractf128_pd::<1>(heights));
            let height = _mm_add_sd(_mm_add_sd(of_a, _mm_unpackhi_pd(of_a, of_a)), of_c);
            let sign = _mm256_set1_pd(-0.0);
            let size = _mm256_andnot_pd(sign, _mm256_broadcastsd_pd(det));
            let least = _mm256_mul_pd(_mm256_andnot_pd(sign, product), _mm256_set1_pd(1.0 / 64.0));
            if _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(size, least)) & 7 != 0 {
                return (EdgeTest::Uncertain, Inside::NONE);
            }
            let inside = Inside {
                height: _mm_cvtsd_f64(height),
                det: _mm_cvtsd_f64(det),
                v: _mm_cvtsd_f64(v),
                w: _mm_cvtsd_f64(w),
            };
            (EdgeTest::Inside, inside)
        }
    }
}
