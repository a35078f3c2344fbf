//! The first test of eight hulls, on every instruction set.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

use super::portable::Portable;
#[cfg(target_arch = "x86_64")]
use super::x86::X86;
use crate::hulls::{
    HullBlock, HullRay, LEAST_COMPONENT, LEAST_TOLERANCE, LEAST_TUBE_ERROR, TOLERANCE_PER_MARGIN,
    TUBE_ERROR_PER_MARGIN,
};
use crate::triangles::{BLOCK, HeightRange};

/// What came of eight hulls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MetHulls {
    /// A bit for each that the ray may meet within the range: among them all whose shapes it does.
    pub(crate) mask: u32,
    /// A bit for each whose shape it certainly does meet, where that was asked.
    pub(crate) sure: u32,
    /// No shape among them is met at a lesser height.
    pub(crate) near: [f32; BLOCK],
}

impl MetHulls {
    const NONE: Self = Self { mask: 0, sure: 0, near: [0.0; BLOCK] };
}

/// What a search does with eight hulls.
pub(crate) trait HullLanes {
    /// Tries a ray against eight; with `SURE`, also what is certain: see [`HullRay`].
    fn meet_hulls<const SURE: bool>(block: &HullBlock, ray: &HullRay, range: &HeightRange) -> MetHulls;
}

/// What a line has in a hull: `p + k d` for k from -1 to 1, at the height `middle + k reach`.
struct Chord {
    p: [f32; 3],
    d: [f32; 3],
    middle: f32,
    reach: f32,
}

/// What is seen of a tube from sixteen places on a chord.
struct SeenTube {
    /// Whether none of it is met in between, either.
    misses: bool,
    /// Whether a place that is surely in range is surely inside.
    is_inside: bool,
    /// The same for outside.
    is_outside: bool,
}

/// Places on a chord.
const PLACES: usize = 2 * BLOCK;

/// k of each: the middles of pieces of equal lengths.
static MIDDLES: [f32; PLACES] = {
    let mut middles = [0.0; PLACES];
    let mut i = 0;
    while i < PLACES {
        middles[i] = (2 * i + 1) as f32 / PLACES as f32 - 1.0;
        i += 1;
    }
    middles
};

impl Chord {
    /// Half the length of a piece, in the space of x, y and r z.
    #[inline(always)]
    fn half_piece(&self, tube: f32) -> f32 {
        let [x, y, z] = [self.d[0], self.d[1], self.d[2] * tube];
        (x * x + y * y + z * z).sqrt() * ((1.0 + 1e-6) / PLACES as f32)
    }

    #[inline(always)]
    fn meet_tube(&self, tube: f32, margin: f32, range: &HeightRange) -> SeenTube {
        let error = TUBE_ERROR_PER_MARGIN * margin + LEAST_TUBE_ERROR;
        let near_by = self.half_piece(tube) + error;
        let mut seen = SeenTube { misses: true, is_inside: false, is_outside: false };
        for k in MIDDLES {
            let [x, y, z] = std::array::from_fn(|axis| self.p[axis] + k * self.d[axis]);
            let (from_circle, rise) = ((x * x + y * y).sqrt() - (1.0 - tube), tube * z);
            let outside = (from_circle * from_circle + rise * rise).sqrt() - tube;
            let height = self.middle + k * self.reach;
            let is_in_range = range.surely_first <= height && height <= range.surely_last;
            seen.misses &= outside > near_by;
            seen.is_inside |= outside < -error && is_in_range;
            seen.is_outside |= outside > error && is_in_range;
        }
        seen
    }
}

impl HullLanes for Portable {
    #[inline(always)]
    fn meet_hulls<const SURE: bool>(block: &HullBlock, ray: &HullRay, range: &HeightRange) -> MetHulls {
        let mut met = MetHulls::NONE;
        for lane in 0..BLOCK {
            let w: [f32; 3] =
                std::array::from_fn(|axis| (ray.origin[axis] - block.centers[axis][lane]) + ray.rest[axis]);
            let distance = w.iter().fold(0.0, |largest: f32, w| largest.max(w.abs()));
            let margin = block.margins[lane] * distance + block.least_margins[lane];
            let least = block.margins[lane] * LEAST_COMPONENT;
            let half = [1.0, block.heights[lane], 1.0];
            let (mut p, mut d) = ([0.0; 3], [0.0; 3]);
            let (mut enters, mut leaves) = (f32::NEG_INFINITY, f32::INFINITY);
            for axis in 0..3 {
                let [x, y, z] = block.rows[axis].map(|lanes| lanes[lane]);
                let ([wx, wy, wz], [ex, ey, ez]) = (w, ray.direction);
                p[axis] = x * wx + (y * wy + z * wz);
                d[axis] = x * ex + (y * ey + z * ez);
                let size = d[axis].abs();
                let inverse = 1.0 / if size > least { size } else { least };
                let (at, wide) =
                    (if d[axis].is_sign_negative() { -p[axis] } else { p[axis] }, half[axis] + margin);
                // A NaN is left out of either.
                enters = enters.max(-(at + wide) * inverse);
                leaves = leaves.min((wide - at) * inverse);
            }
            let (from, to) = (enters.max(range.first), leaves.min(range.last));
            // Every comparison with a NaN is false, so that what is none is met.
            if from > to {
                continue;
            }
            let (middle, reach) = (0.5 * (from + to), 0.5 * (to - from));
            let [px, py, pz] = std::array::from_fn(|axis| p[axis] + middle * d[axis]);
            let [dx, dy, dz] = d.map(|d| d * reach);
            let [c, linear, e] = block.profiles.map(|lanes| lanes[lane]);
            let tolerance = (TOLERANCE_PER_MARGIN * margin) * (1.0 + margin) + LEAST_TOLERANCE;
            let a = dx * dx + (dy * dy + c * dz * dz);
            let b = px * dx + (py * dy + (c * pz + 0.5 * linear) * dz);
            let k = px * px + (py * py + ((c * pz + linear) * pz + e));
            let (first, last) = (k + (a - 2.0 * b), k + (a + 2.0 * b));
            let is_beside_between = b.abs() >= a || (k - tolerance) * a > b * b;
            if first > tolerance && last > tolerance && is_beside_between {
                continue;
            }
            let tube = block.tubes[lane];
            let comes = enters > range.surely_first || first > tolerance;
            let goes = leaves < range.surely_last || last > tolerance;
            let mut is_sure = false;
            if tube > 0.0 {
                let chord = Chord { p: [px, py, pz], d: [dx, dy, dz], middle, reach };
                let seen = chord.meet_tube(tube, margin, range);
                if seen.misses {
                    continue;
                }
                is_sure = seen.is_inside && (seen.is_outside || comes || goes);
            } else if SURE && tube < 0.0 {
                let deep = 1.0 - margin;
                let least_at = (-b / a).clamp(-1.0, 1.0);
                let least = k + least_at * (2.0 * b + least_at * a);
                let is_in_cube = (px + least_at * dx).abs() <= deep
                    && (py + least_at * dy).abs() <= deep
                    && (pz + least_at * dz).abs() <= deep;
                let height = middle + least_at * reach;
                let is_inside = is_in_cube
                    && least < -tolerance
                    && height >= range.surely_first
                    && height <= range.surely_last;
                is_sure = is_inside && (comes || goes);
            }
            met.mask |= 1 << lane;
            met.near[lane] = from;
            if SURE && is_sure {
                met.sure |= 1 << lane;
            }
        }
        met
    }
}

#[cfg(target_arch = "x86_64")]
impl<const AVX512: bool, const LEAKS: bool> HullLanes for X86<AVX512, LEAKS> {
    #[inline(always)]
    fn meet_hulls<const SURE: bool>(block: &HullBlock, ray: &HullRay, range: &HeightRange) -> MetHulls {
        // As the portable one, eight at a time. Of a maximum or a minimum with a NaN, the second number comes.
        // SAFETY: see `X86`. The loads are of eight f32 in arrays of eight, and the store into one.
        unsafe {
            // Without closures: into these, instructions are sometimes not inlined, but called.
            let sign = _mm256_set1_ps(-0.0);
            let one = _mm256_set1_ps(1.0);
            let wx = offset(ray.origin[0], &block.centers[0], ray.rest[0]);
            let wy = offset(ray.origin[1], &block.centers[1], ray.rest[1]);
            let wz = offset(ray.origin[2], &block.centers[2], ray.rest[2]);
            let distance = _mm256_max_ps(
                _mm256_andnot_ps(sign, wx),
                _mm256_max_ps(_mm256_andnot_ps(sign, wy), _mm256_andnot_ps(sign, wz)),
            );
            let margins = _mm256_load_ps(block.margins.as_ptr());
            let margin = _mm256_fmadd_ps(margins, distance, _mm256_load_ps(block.least_margins.as_ptr()));
            let least = _mm256_mul_ps(margins, _mm256_set1_ps(LEAST_COMPONENT));
            let ex = _mm256_set1_ps(ray.direction[0]);
            let ey = _mm256_set1_ps(ray.direction[1]);
            let ez = _mm256_set1_ps(ray.direction[2]);
            let wide = _mm256_add_ps(one, margin);
            let high = _mm256_add_ps(_mm256_load_ps(block.heights.as_ptr()), margin);
            let [p0, d0, near0, far0] = slab(&block.rows[0], [wx, wy, wz], [ex, ey, ez], least, wide);
            let [p1, d1, near1, far1] = slab(&block.rows[1], [wx, wy, wz], [ex, ey, ez], least, high);
            let [p2, d2, near2, far2] = slab(&block.rows[2], [wx, wy, wz], [ex, ey, ez], least, wide);
            let enters = _mm256_max_ps(_mm256_max_ps(near0, near1), near2);
            let leaves = _mm256_min_ps(_mm256_min_ps(far0, far1), far2);
            let from = _mm256_max_ps(enters, _mm256_set1_ps(range.first));
            let to = _mm256_min_ps(leaves, _mm256_set1_ps(range.last));
            let missed = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(from, to)) as u32;
            if missed == 0xff {
                return MetHulls::NONE;
            }

            let half = _mm256_set1_ps(0.5);
            let middle = _mm256_mul_ps(half, _mm256_add_ps(from, to));
            let reach = _mm256_mul_ps(half, _mm256_sub_ps(to, from));
            let px = _mm256_fmadd_ps(middle, d0, p0);
            let py = _mm256_fmadd_ps(middle, d1, p1);
            let pz = _mm256_fmadd_ps(middle, d2, p2);
            let dx = _mm256_mul_ps(reach, d0);
            let dy = _mm256_mul_ps(reach, d1);
            let dz = _mm256_mul_ps(reach, d2);
            let c = _mm256_load_ps(block.profiles[0].as_ptr());
            let linear = _mm256_load_ps(block.profiles[1].as_ptr());
            let e = _mm256_load_ps(block.profiles[2].as_ptr());
            let tubes = _mm256_load_ps(block.tubes.as_ptr());
            let tolerance = _mm256_fmadd_ps(
                _mm256_mul_ps(_mm256_set1_ps(TOLERANCE_PER_MARGIN), margin),
                wide,
                _mm256_set1_ps(LEAST_TOLERANCE),
            );
            let cz = _mm256_mul_ps(c, dz);
            let a = _mm256_fmadd_ps(dx, dx, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(cz, dz)));
            let slope = _mm256_fmadd_ps(c, pz, _mm256_mul_ps(half, linear));
            let b = _mm256_fmadd_ps(px, dx, _mm256_fmadd_ps(py, dy, _mm256_mul_ps(slope, dz)));
            let k = _mm256_fmadd_ps(_mm256_fmadd_ps(c, pz, linear), pz, e);
            let k = _mm256_fmadd_ps(px, px, _mm256_fmadd_ps(py, py, k));
            let twice = _mm256_add_ps(b, b);
            let first = _mm256_add_ps(k, _mm256_sub_ps(a, twice));
            let last = _mm256_add_ps(k, _mm256_add_ps(a, twice));
            let is_beside_between = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_GE_OQ>(_mm256_andnot_ps(sign, b), a),
                _mm256_cmp_ps::<_CMP_GT_OQ>(
                    _mm256_mul_ps(_mm256_sub_ps(k, tolerance), a),
                    _mm256_mul_ps(b, b),
                ),
            );
            let is_beside = _mm256_and_ps(
                is_beside_between,
                _mm256_and_ps(
                    _mm256_cmp_ps::<_CMP_GT_OQ>(first, tolerance),
                    _mm256_cmp_ps::<_CMP_GT_OQ>(last, tolerance),
                ),
            );
            let mask = !(missed | _mm256_movemask_ps(is_beside) as u32) & 0xff;
            let mut met = MetHulls { mask, sure: 0, near: [0.0; BLOCK] };
            if mask == 0 {
                return met;
            }
            _mm256_storeu_ps(met.near.as_mut_ptr(), from);
            let mut outside_once = 0;
            if SURE {
                let deep = _mm256_sub_ps(one, margin);
                // Some place between the ends, near to where the parabola is least.
                let least_at = _mm256_mul_ps(_mm256_xor_ps(b, sign), _mm256_rcp_ps(a));
                let least_at = _mm256_min_ps(_mm256_max_ps(least_at, _mm256_set1_ps(-1.0)), one);
                let least = _mm256_fmadd_ps(least_at, _mm256_fmadd_ps(least_at, a, twice), k);
                let x = _mm256_andnot_ps(sign, _mm256_fmadd_ps(least_at, dx, px));
                let y = _mm256_andnot_ps(sign, _mm256_fmadd_ps(least_at, dy, py));
                let z = _mm256_andnot_ps(sign, _mm256_fmadd_ps(least_at, dz, pz));
                let height = _mm256_fmadd_ps(least_at, reach, middle);
                let (start, end) = (_mm256_set1_ps(range.surely_first), _mm256_set1_ps(range.surely_last));
                let is_in_cube = _mm256_and_ps(
                    _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_max_ps(x, y), deep),
                    _mm256_cmp_ps::<_CMP_LE_OQ>(z, deep),
                );
                let is_in_range = _mm256_and_ps(
                    _mm256_cmp_ps::<_CMP_GE_OQ>(height, start),
                    _mm256_cmp_ps::<_CMP_LE_OQ>(height, end),
                );
                let is_inside = _mm256_and_ps(
                    _mm256_and_ps(is_in_cube, is_in_range),
                    _mm256_and_ps(
                        _mm256_cmp_ps::<_CMP_LT_OQ>(least, _mm256_xor_ps(tolerance, sign)),
                        _mm256_cmp_ps::<_CMP_LT_OQ>(tubes, _mm256_setzero_ps()),
                    ),
                );
                let comes = _mm256_or_ps(
                    _mm256_cmp_ps::<_CMP_GT_OQ>(enters, start),
                    _mm256_cmp_ps::<_CMP_GT_OQ>(first, tolerance),
                );
                let goes = _mm256_or_ps(
                    _mm256_cmp_ps::<_CMP_LT_OQ>(leaves, end),
                    _mm256_cmp_ps::<_CMP_GT_OQ>(last, tolerance),
                );
                outside_once = _mm256_movemask_ps(_mm256_or_ps(comes, goes)) as u32;
                met.sure = _mm256_movemask_ps(is_inside) as u32 & outside_once & mask;
            }
            let mut rings =
                _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(tubes, _mm256_setzero_ps())) as u32 & mask;
            if rings != 0 {
                let mut numbers = [[0.0; BLOCK]; 9];
                for (place, v) in numbers.iter_mut().zip([px, py, pz, dx, dy, dz, middle, reach, margin]) {
                    _mm256_storeu_ps(place.as_mut_ptr(), v);
                }
                while rings != 0 {
                    let lane = rings.trailing_zeros() as usize % BLOCK;
                    rings &= rings - 1;
                    let [px, py, pz, dx, dy, dz, middle, reach, margin] = numbers.map(|lanes| lanes[lane]);
                    let chord = Chord { p: [px, py, pz], d: [dx, dy, dz], middle, reach };
                    let seen = Self::meet_tube(&chord, block.tubes[lane], margin, range);
                    met.mask &= !(u32::from(seen.misses) << lane);
                    let is_outside = seen.is_outside || outside_once >> lane & 1 == 1;
                    if SURE && seen.is_inside && is_outside {
                        met.sure |= 1 << lane;
                    }
                }
            }
            met
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl<const AVX512: bool, const LEAKS: bool> X86<AVX512, LEAKS> {
    /// As [`Chord::meet_tube`], eight places at a time.
    #[inline(always)]
    fn meet_tube(chord: &Chord, tube: f32, margin: f32, range: &HeightRange) -> SeenTube {
        let error = TUBE_ERROR_PER_MARGIN * margin + LEAST_TUBE_ERROR;
        let near_by = chord.half_piece(tube) + error;
        let (mut missed, mut inside, mut outside) = (true, 0, 0);
        // SAFETY: see `X86`. The loads are of eight f32 in an array of sixteen, from its start and its middle.
        unsafe {
            let [px, py, pz] = [chord.p[0], chord.p[1], chord.p[2]];
            let [dx, dy, dz] = [chord.d[0], chord.d[1], chord.d[2]];
            for half in 0..2 {
                let k = _mm256_loadu_ps(MIDDLES.as_ptr().add(BLOCK * half));
                let x = _mm256_fmadd_ps(k, _mm256_set1_ps(dx), _mm256_set1_ps(px));
                let y = _mm256_fmadd_ps(k, _mm256_set1_ps(dy), _mm256_set1_ps(py));
                let z = _mm256_fmadd_ps(k, _mm256_set1_ps(tube * dz), _mm256_set1_ps(tube * pz));
                let beside = _mm256_sqrt_ps(_mm256_fmadd_ps(x, x, _mm256_mul_ps(y, y)));
                let from_circle = _mm256_sub_ps(beside, _mm256_set1_ps(1.0 - tube));
                let square = _mm256_fmadd_ps(from_circle, from_circle, _mm256_mul_ps(z, z));
                let out = _mm256_sub_ps(_mm256_sqrt_ps(square), _mm256_set1_ps(tube));
                let height = _mm256_fmadd_ps(k, _mm256_set1_ps(chord.reach), _mm256_set1_ps(chord.middle));
                let is_in_range = _mm256_and_ps(
                    _mm256_cmp_ps::<_CMP_GE_OQ>(height, _mm256_set1_ps(range.surely_first)),
                    _mm256_cmp_ps::<_CMP_LE_OQ>(height, _mm256_set1_ps(range.surely_last)),
                );
                let is_far = _mm256_cmp_ps::<_CMP_GT_OQ>(out, _mm256_set1_ps(near_by));
                let is_inside = _mm256_cmp_ps::<_CMP_LT_OQ>(out, _mm256_set1_ps(-error));
                let is_outside = _mm256_cmp_ps::<_CMP_GT_OQ>(out, _mm256_set1_ps(error));
                missed &= _mm256_movemask_ps(is_far) == 0xff;
                inside |= _mm256_movemask_ps(_mm256_and_ps(is_inside, is_in_range));
                outside |= _mm256_movemask_ps(_mm256_and_ps(is_outside, is_in_range));
            }
        }
        SeenTube { misses: missed, is_inside: inside != 0, is_outside: outside != 0 }
    }
}

/// From eight centres to an origin and what was rounded off it, on one axis.
///
/// # Safety
/// See [`X86`].
#[cfg(target_arch = "x86_64")]
#[inline(always)]
unsafe fn offset(origin: f32, centers: &[f32; BLOCK], rest: f32) -> __m256 {
    // SAFETY: see `X86`. The load is of eight f32 in an array of eight.
    unsafe {
        let there = _mm256_sub_ps(_mm256_set1_ps(origin), _mm256_load_ps(centers.as_ptr()));
        _mm256_add_ps(there, _mm256_set1_ps(rest))
    }
}

/// Where a ray is in eight cubes, on one axis: its start and its direction there, and the heights at which it enters and leaves.
///
/// # Safety
/// See [`X86`].
#[cfg(target_arch = "x86_64")]
#[inline(always)]
unsafe fn slab(
    row: &[[f32; BLOCK]; 3],
    [wx, wy, wz]: [__m256; 3],
    [ex, ey, ez]: [__m256; 3],
    least: __m256,
    wide: __m256,
) -> [__m256; 4] {
    // SAFETY: see `X86`. The loads are of eight f32 in arrays of eight.
    unsafe {
        let x = _mm256_load_ps(row[0].as_ptr());
        let y = _mm256_load_ps(row[1].as_ptr());
        let z = _mm256_load_ps(row[2].as_ptr());
        let p = _mm256_fmadd_ps(x, wx, _mm256_fmadd_ps(y, wy, _mm256_mul_ps(z, wz)));
        let d = _mm256_fmadd_ps(x, ex, _mm256_fmadd_ps(y, ey, _mm256_mul_ps(z, ez)));
        let sign = _mm256_set1_ps(-0.0);
        let size = _mm256_max_ps(least, _mm256_andnot_ps(sign, d));
        let inverse = _mm256_div_ps(_mm256_set1_ps(1.0), size);
        let at = _mm256_xor_ps(p, _mm256_and_ps(d, sign));
        let near = _mm256_mul_ps(_mm256_xor_ps(_mm256_add_ps(at, wide), sign), inverse);
        let far = _mm256_mul_ps(_mm256_sub_ps(wide, at), inverse);
        [p, d, near, far]
    }
}

/// What [`HullLanes::meet_hulls`] gives at a level, for tests.
#[cfg(test)]
pub(crate) fn meet_hulls_at(
    level: super::Level,
    block: &HullBlock,
    ray: &HullRay,
    range: &HeightRange,
) -> MetHulls {
    struct Hulls<'a>(&'a HullBlock, &'a HullRay, &'a HeightRange);
    impl super::Task for Hulls<'_> {
        type Output = MetHulls;
        #[inline(always)]
        fn run<L: super::Lanes>(self) -> Self::Output {
            let met = L::meet_hulls::<true>(self.0, self.1, self.2);
            let same = L::meet_hulls::<false>(self.0, self.1, self.2);
            assert_eq!((same.mask, same.sure), (met.mask, 0));
            met
        }
    }
    level.run(Hulls(block, ray, range))
}
