//! AVX2 with FMA, and AVX-512 on vectors of 256 bits.

use std::arch::x86_64::*;
use std::mem::MaybeUninit;

use lumbre_geometry::Ray;

use super::{LANE_BITS, Lanes, Sides, Slots, Task};
use crate::node::{BoxRay, LARGEST_NEAR, Node, SMALLEST_NEAR, TINY_NEAR, Units, WIDTH};
use crate::stack::stack_entry;
use crate::triangles::{BLOCK, BlockRay, Inside, Passage, Shear, TriangleBlock};

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn run_avx2<T: Task>(task: T) -> T::Output {
    task.run::<X86<false>>()
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512dq,avx512vl")]
pub(super) fn run_avx512<T: Task>(task: T) -> T::Output {
    task.run::<X86<true>>()
}

/// Of the two levels: only `run_avx512` instantiates `X86<true>`, and only `run_avx2` `X86<false>`. That is why the
/// instructions below are there.
pub(crate) struct X86<const AVX512: bool>;

/// For each mask, its lanes first.
static LANES_OF: [[u8; WIDTH]; 256] = {
    let mut lanes = [[0; WIDTH]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < WIDTH {
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

impl<const AVX512: bool> X86<AVX512> {
    /// The lanes in `mask` first; the others mean nothing.
    #[inline(always)]
    fn compress(mask: u32, v: __m256i) -> __m256i {
        // SAFETY: see `X86`. The load is of one of the table's rows of eight bytes.
        unsafe {
            if AVX512 {
                _mm256_maskz_compress_epi32(mask as u8, v)
            } else {
                let lanes = _mm_loadl_epi64(LANES_OF[mask as usize % 256].as_ptr().cast());
                _mm256_permutevar8x32_epi32(v, _mm256_cvtepu8_epi32(lanes))
            }
        }
    }

    /// The larger of the absolute values.
    #[inline(always)]
    fn larger(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see `X86`.
        unsafe {
            if AVX512 {
                // The maximum by magnitude, without its sign.
                _mm256_range_ps::<0b1011>(a, b)
            } else {
                let without_sign = _mm256_castsi256_ps(_mm256_set1_epi32(i32::MAX));
                _mm256_max_ps(_mm256_and_ps(a, without_sign), _mm256_and_ps(b, without_sign))
            }
        }
    }

    /// Where the ray meets the planes from here on, as bits.
    ///
    /// # Safety
    /// There are eight to be read.
    #[inline(always)]
    unsafe fn slab(planes: *const f32, inverse: f32, offset: f32) -> __m256i {
        // SAFETY: see `X86`, and above.
        unsafe {
            let planes = _mm256_loadu_ps(planes);
            _mm256_castps_si256(_mm256_fmadd_ps(planes, _mm256_set1_ps(inverse), _mm256_set1_ps(offset)))
        }
    }

    /// A component of three corners, the first of which is here.
    ///
    /// # Safety
    /// The others are 24 and 48 further.
    #[inline(always)]
    unsafe fn component(first: *const f32) -> __m256d {
        // SAFETY: see `X86`, and above.
        unsafe { _mm256_cvtps_pd(_mm_setr_ps(*first, *first.add(24), *first.add(48), 0.0)) }
    }

    #[inline(always)]
    fn children(node: &Node) -> __m256i {
        // SAFETY: see `X86`. The load is of eight u32 in an array of eight.
        unsafe { _mm256_loadu_si256(node.children.as_ptr().cast()) }
    }
}

impl<const AVX512: bool> Lanes for X86<AVX512> {
    type Keys = __m256i;

    #[inline(always)]
    fn start_nearby(units: &Units, ray: &Ray, t_min: f64, t_max: f64, boxes: &mut BoxRay) -> bool {
        // As the portable one, three axes at a time.
        // SAFETY: see `X86`. The loads are of three f64 in arrays of three, and of four in arrays of four; the stores of
        // four f32 into arrays of four.
        unsafe {
            let first_three = _mm256_setr_epi64x(-1, -1, -1, 0);
            let origin = _mm256_maskload_pd(ray.origin.as_ref().as_ptr(), first_three);
            let direction = _mm256_maskload_pd(ray.direction.as_ref().as_ptr(), first_three);
            let scale = _mm256_set1_pd(units.scale);
            let tree_origin = _mm256_loadu_pd(units.padded_origin.as_ptr());
            let start = _mm256_mul_pd(_mm256_sub_pd(origin, tree_origin), scale);
            let direction = _mm256_mul_pd(direction, scale);
            let sign = _mm256_set1_pd(-0.0);
            let distance = _mm256_andnot_pd(sign, start);
            let size = _mm256_andnot_pd(sign, direction);
            let fits = _mm256_and_pd(
                _mm256_cmp_pd::<_CMP_LE_OQ>(distance, _mm256_set1_pd(units.near)),
                _mm256_cmp_pd::<_CMP_LE_OQ>(size, _mm256_set1_pd(LARGEST_NEAR)),
            );
            let is_long = _mm256_cmp_pd::<_CMP_GE_OQ>(size, _mm256_set1_pd(SMALLEST_NEAR));
            let is_near = _mm256_movemask_pd(fits) == 0b1111 && _mm256_movemask_pd(is_long) != 0;
            if !(is_near && 0.0 <= t_min && t_min <= t_max) {
                return false;
            }
            let size = _mm256_max_pd(size, _mm256_set1_pd(TINY_NEAR));
            let signs = _mm256_and_pd(direction, sign);
            // Always of 1 over something: the sign is put on again afterwards.
            let size = _mm256_div_pd(_mm256_set1_pd(1.0), size);
            let inverse = _mm256_or_pd(size, signs);
            let per_distance = _mm256_set1_pd(units.margin_per_distance);
            let margin = _mm256_mul_pd(
                size,
                _mm256_fmadd_pd(distance, per_distance, _mm256_set1_pd(units.near_margin)),
            );
            let near = _mm256_fnmsub_pd(start, inverse, margin);
            let far = _mm256_fnmadd_pd(start, inverse, margin);
            _mm_storeu_ps(boxes.inverse.as_mut_ptr(), _mm256_cvtpd_ps(inverse));
            _mm_storeu_ps(boxes.near_offset.as_mut_ptr(), _mm256_cvtpd_ps(near));
            _mm_storeu_ps(boxes.far_offset.as_mut_ptr(), _mm256_cvtpd_ps(far));
            boxes.sides = Sides::new(_mm256_movemask_pd(direction) as u32);
        }
        boxes.set_range_nearby(t_min, t_max);
        true
    }

    #[inline(always)]
    fn meet_boxes(node: &Node, ray: &BoxRay) -> (u32, __m256i) {
        let planes = node.planes.as_flattened().as_ptr();
        let near = ray.sides.near;
        // SAFETY: see `X86`. The loads are of eight f32 from a multiple of eight below 48 on, in an array of 48.
        unsafe {
            let near_x = Self::slab(planes.add(near[0]), ray.inverse[0], ray.near_offset[0]);
            let near_y = Self::slab(planes.add(near[1]), ray.inverse[1], ray.near_offset[1]);
            let near_z = Self::slab(planes.add(near[2]), ray.inverse[2], ray.near_offset[2]);
            let far_x = Self::slab(planes.add(near[0] ^ WIDTH), ray.inverse[0], ray.far_offset[0]);
            let far_y = Self::slab(planes.add(near[1] ^ WIDTH), ray.inverse[1], ray.far_offset[1]);
            let far_z = Self::slab(planes.add(near[2] ^ WIDTH), ray.inverse[2], ray.far_offset[2]);
            // By the bits: floats that are not negative have the order of integers, and 0 <= s_min. A negative one gives
            // way to s_min where the box is entered, and is a miss where it is left.
            let enter = _mm256_max_epi32(
                _mm256_max_epi32(near_x, near_y),
                _mm256_max_epi32(near_z, _mm256_set1_epi32(ray.s_min.to_bits() as i32)),
            );
            let leave = _mm256_min_epi32(
                _mm256_min_epi32(far_x, far_y),
                _mm256_min_epi32(far_z, _mm256_set1_epi32(ray.s_max.to_bits() as i32)),
            );
            let mask = if AVX512 {
                u32::from(_mm256_cmple_epi32_mask(enter, leave))
            } else {
                let missed = _mm256_cmpgt_epi32(enter, leave);
                _mm256_movemask_ps(_mm256_castsi256_ps(missed)) as u32 ^ 0xff
            };
            (mask, enter)
        }
    }

    #[inline(always)]
    fn only_child(node: &Node, mask: u32) -> u32 {
        if AVX512 {
            // SAFETY: see `X86`.
            unsafe { _mm256_cvtsi256_si32(Self::compress(mask, Self::children(node))) as u32 }
        } else {
            node.children[mask.trailing_zeros() as usize % WIDTH]
        }
    }

    #[inline(always)]
    fn push_by_distance(node: &Node, mask: u32, enter: __m256i, slots: &mut Slots<i64>) -> u32 {
        let count = mask.count_ones() as usize;
        // SAFETY: see `X86`. The store is of eight i32 into an array of eight.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let keys = _mm256_or_si256(_mm256_andnot_si256(_mm256_set1_epi32(LANE_BITS), enter), lanes);
            if count <= 4 {
                let (first_keys, first) =
                    (Self::compress(mask, keys), Self::compress(mask, Self::children(node)));
                let (first_keys, first) = (_mm256_castsi256_si128(first_keys), _mm256_castsi256_si128(first));
                let entries = _mm_unpacklo_epi32(first, first_keys);
                let (a, b) = (_mm_cvtsi128_si64(entries), _mm_extract_epi64::<1>(entries));
                let (a, b) = (a.min(b), a.max(b));
                if count == 2 {
                    slots.push(b);
                    return a as u32;
                }
                let entries = _mm_unpackhi_epi32(first, first_keys);
                let c = _mm_cvtsi128_si64(entries);
                if count == 3 {
                    let (nearest, rest) = (a.min(c), a.max(c));
                    let window = slots.next_eight();
                    window[0] = MaybeUninit::new(b.max(rest));
                    window[1] = MaybeUninit::new(b.min(rest));
                    slots.len += 2;
                    return nearest as u32;
                }
                let d = _mm_extract_epi64::<1>(entries);
                let (c, d) = (c.min(d), c.max(d));
                let (nearest, low) = (a.min(c), a.max(c));
                let (high, farthest) = (b.min(d), b.max(d));
                let window = slots.next_eight();
                window[0] = MaybeUninit::new(farthest);
                window[1] = MaybeUninit::new(low.max(high));
                window[2] = MaybeUninit::new(low.min(high));
                slots.len += 3;
                return nearest as u32;
            }
            let window = slots.next_eight();
            let mut scalar_keys = [0; WIDTH];
            _mm256_storeu_si256(scalar_keys.as_mut_ptr().cast(), keys);
            // Where each goes is how many are farther: no two have one key, so that the first places are all written.
            let mut rest = mask & 0xff;
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize % WIDTH;
                rest &= rest - 1;
                let this = scalar_keys[lane];
                let farther = _mm256_cmpgt_epi32(keys, _mm256_set1_epi32(this));
                let farther = _mm256_movemask_ps(_mm256_castsi256_ps(farther)) as u32 & mask;
                let place = farther.count_ones() as usize % WIDTH;
                window[place] = MaybeUninit::new(stack_entry(this, node.children[lane]));
            }
            slots.len += count - 1;
            slots.entries[slots.len].assume_init() as u32
        }
    }

    #[inline(always)]
    fn push_as_built(node: &Node, mask: u32, slots: &mut Slots<u32>) -> u32 {
        let window = slots.next_eight();
        // SAFETY: see `X86`. The store is of eight u32 into an array of eight.
        unsafe {
            let first = Self::compress(mask, Self::children(node));
            _mm256_storeu_si256(window.as_mut_ptr().cast(), first);
        }
        slots.len += mask.count_ones() as usize - 1;
        node.children[(31 - mask.leading_zeros()) as usize % WIDTH]
    }

    #[inline(always)]
    fn meet_triangles<const SURE: bool>(block: &TriangleBlock, ray: &BlockRay) -> (u32, u32) {
        if !ray.is_sharp {
            return ((1 << BLOCK) - 1, 0);
        }
        let corners = block.corners.as_flattened().as_flattened().as_ptr();
        let [kx, ky, kz] = ray.axes.order;
        // SAFETY: see `X86`. The loads are of eight f32 in an array of 3 · 3 · 8, at 24 corner + 8 axis; the axes are below
        // three.
        unsafe {
            let (ox, oy, oz) =
                (_mm256_set1_ps(ray.origin[0]), _mm256_set1_ps(ray.origin[1]), _mm256_set1_ps(ray.origin[2]));
            let (shear_x, shear_y) = (_mm256_set1_ps(ray.shear_x), _mm256_set1_ps(ray.shear_y));
            let mut x = [_mm256_setzero_ps(); 3];
            let mut y = [_mm256_setzero_ps(); 3];
            let mut z = [_mm256_setzero_ps(); 3];
            for corner in 0..3 {
                let axes = corners.add(24 * corner);
                z[corner] = _mm256_sub_ps(_mm256_loadu_ps(axes.add(8 * kz)), oz);
                let across = _mm256_sub_ps(_mm256_loadu_ps(axes.add(8 * kx)), ox);
                let up = _mm256_sub_ps(_mm256_loadu_ps(axes.add(8 * ky)), oy);
                x[corner] = _mm256_fnmadd_ps(shear_x, z[corner], across);
                y[corner] = _mm256_fnmadd_ps(shear_y, z[corner], up);
            }
            let u = _mm256_fmsub_ps(x[2], y[1], _mm256_mul_ps(y[2], x[1]));
            let v = _mm256_fmsub_ps(x[0], y[2], _mm256_mul_ps(y[0], x[2]));
            let w = _mm256_fmsub_ps(x[1], y[0], _mm256_mul_ps(y[1], x[0]));
            let size = Self::larger(
                Self::larger(Self::larger(x[0], y[0]), Self::larger(x[1], y[1])),
                Self::larger(x[2], y[2]),
            );
            let error =
                _mm256_fmadd_ps(size, _mm256_set1_ps(ray.error_slope), _mm256_set1_ps(ray.error_least));
            let least = _mm256_min_ps(_mm256_min_ps(u, v), w);
            let most = _mm256_max_ps(_mm256_max_ps(u, v), w);
            let low = _mm256_min_ps(_mm256_min_ps(z[0], z[1]), z[2]);
            let high = _mm256_max_ps(_mm256_max_ps(z[0], z[1]), z[2]);
            let (z_low, z_high) = (_mm256_set1_ps(ray.z_low), _mm256_set1_ps(ray.z_high));
            // Comparisons with a NaN, which unused lanes have, are false. A minimum of a NaN and a number is that number
            // or the NaN: unused lanes have nothing but NaN.
            let minus_error = _mm256_xor_ps(error, _mm256_set1_ps(-0.0));
            let mask = if AVX512 {
                let mask = (_mm256_cmp_ps_mask::<_CMP_GE_OQ>(least, minus_error)
                    | _mm256_cmp_ps_mask::<_CMP_LE_OQ>(most, error))
                    & _mm256_cmp_ps_mask::<_CMP_GE_OQ>(high, z_low)
                    & _mm256_cmp_ps_mask::<_CMP_LE_OQ>(low, z_high);
                u32::from(mask)
            } else {
                let in_range = _mm256_and_ps(
                    _mm256_cmp_ps::<_CMP_GE_OQ>(high, z_low),
                    _mm256_cmp_ps::<_CMP_LE_OQ>(low, z_high),
                );
                let sided = _mm256_or_ps(
                    _mm256_cmp_ps::<_CMP_GE_OQ>(least, minus_error),
                    _mm256_cmp_ps::<_CMP_LE_OQ>(most, error),
                );
                _mm256_movemask_ps(_mm256_and_ps(in_range, sided)) as u32
            };
            if !SURE || mask == 0 {
                return (mask, 0);
            }
            let sign = _mm256_set1_ps(-0.0);
            let inverse = _mm256_div_ps(_mm256_set1_ps(1.0), _mm256_add_ps(_mm256_add_ps(u, v), w));
            // Shares first: their products with lengths do not underflow.
            let of_c = _mm256_mul_ps(_mm256_mul_ps(w, inverse), z[2]);
            let of_b_and_c = _mm256_fmadd_ps(_mm256_mul_ps(v, inverse), z[1], of_c);
            let height = _mm256_fmadd_ps(_mm256_mul_ps(u, inverse), z[0], of_b_and_c);
            let backward = _mm256_set1_ps(if ray.is_backward { -0.0 } else { 0.0 });
            let ahead = _mm256_xor_ps(height, backward);
            let share =
                _mm256_mul_ps(_mm256_mul_ps(error, _mm256_set1_ps(12.5)), _mm256_andnot_ps(sign, inverse));
            let spread = _mm256_mul_ps(share, _mm256_sub_ps(high, low));
            let spread = _mm256_add_ps(spread, _mm256_set1_ps(ray.z_error));
            let (from, to) = (_mm256_sub_ps(ahead, spread), _mm256_add_ps(ahead, spread));
            let twice = _mm256_add_ps(error, error);
            let inside = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_GT_OQ>(least, twice),
                _mm256_cmp_ps::<_CMP_LT_OQ>(most, _mm256_xor_ps(twice, sign)),
            );
            let [first, last] = ray.surely_in;
            let in_range = _mm256_and_ps(
                _mm256_cmp_ps::<_CMP_GE_OQ>(from, _mm256_set1_ps(first)),
                _mm256_cmp_ps::<_CMP_LE_OQ>(to, _mm256_set1_ps(last)),
            );
            (mask, _mm256_movemask_ps(_mm256_and_ps(inside, in_range)) as u32 & mask)
        }
    }

    #[inline(always)]
    fn pass(block: &TriangleBlock, lane: usize, shear: &Shear, origin: &[f64; 3]) -> (Passage, Inside) {
        let corners = block.corners.as_flattened().as_flattened().as_ptr();
        let [kx, ky, kz] = shear.axes.order;
        let lane = lane % BLOCK;
        // The corners in the first three lanes, and the very operations of the portable one.
        // SAFETY: see `X86`. Each component of the three corners is at 24 corner + 8 axis + lane, in an array of 72.
        unsafe {
            let z = _mm256_sub_pd(Self::component(corners.add(8 * kz + lane)), _mm256_set1_pd(origin[2]));
            let across =
                _mm256_sub_pd(Self::component(corners.add(8 * kx + lane)), _mm256_set1_pd(origin[0]));
            let up = _mm256_sub_pd(Self::component(corners.add(8 * ky + lane)), _mm256_set1_pd(origin[1]));
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
                let is_unclear = is_zero | is_positive == 7 || is_zero | is_negative == 7;
                return (if is_unclear { Passage::Unclear } else { Passage::Outside }, Inside::NONE);
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
                return (Passage::Unclear, Inside::NONE);
            }
            let inside = Inside {
                height: _mm_cvtsd_f64(height),
                det: _mm_cvtsd_f64(det),
                v: _mm_cvtsd_f64(v),
                w: _mm_cvtsd_f64(w),
            };
            (Passage::Inside, inside)
        }
    }
}
