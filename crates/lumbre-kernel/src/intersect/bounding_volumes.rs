//! A ray against eight bounding volumes of shapes.

use super::operations::Simd;
use crate::intersect::watertight::HeightRange;
use crate::simd::{F32x8, F32x16, LANES, Row, Vector};
use crate::tree::BLOCK;
use crate::tree::bounding_block::{
    BoundingBlock, BoundingVolumeRay, MIN_COMPONENT, MIN_TOLERANCE, MIN_TUBE_ERROR, TOLERANCE_PER_MARGIN,
    TUBE_ERROR_PER_MARGIN,
};

/// The result of testing eight bounding volumes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundingHits {
    /// A bit for each that the ray may meet in its range, which includes every one whose shape it meets.
    pub(crate) mask: u32,
    /// A bit for each whose shape the ray certainly meets, if that was requested.
    pub(crate) sure: u32,
    /// Lower bounds on the heights of the shapes' crossings.
    pub(crate) near: [f32; BLOCK],
}

impl BoundingHits {
    pub(crate) const NONE: Self = Self { mask: 0, sure: 0, near: [0.0; BLOCK] };
}

/// The parts of lines between the planes of cubes.
struct Passages<V> {
    /// Starts and directions in the cubes.
    p: [V; 3],
    d: [V; 3],
    margin: V,
    enters: V,
    leaves: V,
    /// Clipped to the range.
    from: V,
    to: V,
    /// A bit for each line that misses.
    missed: u32,
}

/// Clips lines to the planes of cubes.
#[inline(always)]
fn pass<V: F32x8>(block: &BoundingBlock, ray: &BoundingVolumeRay, range: &HeightRange) -> Passages<V> {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let (load, splat) = (V::load, V::splat);
    let w = [
        (splat(ray.origin[0]) - load(&block.centers[0])) + splat(ray.rest[0]),
        (splat(ray.origin[1]) - load(&block.centers[1])) + splat(ray.rest[1]),
        (splat(ray.origin[2]) - load(&block.centers[2])) + splat(ray.rest[2]),
    ];
    let [ex, ey, ez] = ray.direction;
    let distance = w[0].abs().max(w[1].abs().max(w[2].abs()));
    let (per_distance, least_margin) = (load(&block.margins), load(&block.least_margins));
    let margin = per_distance.mul_add(distance, least_margin);
    let least = per_distance * V::splat(MIN_COMPONENT);
    let half = [one + margin, load(&block.heights) + margin, one + margin];
    let (mut p, mut d) = ([zero; 3], [zero; 3]);
    let (mut near, mut far) = ([zero; 3], [zero; 3]);
    for axis in 0..3 {
        let [x, y, z] = &block.rows[axis];
        let (x, y, z) = (load(x), load(y), load(z));
        p[axis] = x.mul_add(w[0], y.mul_add(w[1], z * w[2]));
        d[axis] = x.mul_add(splat(ex), y.mul_add(splat(ey), z * splat(ez)));
        let inverse = one / least.max(d[axis].abs());
        let at = p[axis].xor_sign(d[axis]);
        near[axis] = (zero - (at + half[axis])) * inverse;
        far[axis] = (half[axis] - at) * inverse;
    }
    let enters = near[0].max(near[1]).max(near[2]);
    let leaves = far[0].min(far[1]).min(far[2]);
    let (from, to) = (enters.max(splat(range.first)), leaves.min(splat(range.last)));
    // Every comparison with a NaN is false, so NaN is met.
    Passages { p, d, margin, enters, leaves, from, to, missed: to.simd_lt(from) }
}

/// The parts of lines in bounding volumes: `p + k d` for k from -1 to 1, at the heights `middle + k reach`.
struct Chords<V> {
    p: [V; 3],
    d: [V; 3],
    middle: V,
    reach: V,
    margin: V,
    from: V,
    /// A bit for each that may be met, before tubes are tested; includes all that are met.
    mask: u32,
    /// A bit for each that certainly is met, without regard to tubes, if that was requested.
    sure: u32,
    /// A bit for each whose line certainly is outside somewhere, likewise.
    outside: u32,
}

/// Lines in bounding volumes, from their passages through the cubes; with `SURE`, also what is certain: see
/// [`BoundingVolumeRay`].
#[inline(always)]
fn look_into<V: F32x8, const SURE: bool>(
    block: &BoundingBlock,
    range: &HeightRange,
    passages: &Passages<V>,
) -> Chords<V> {
    let &Passages { p, d, margin, enters, leaves, from, to, missed } = passages;
    let (zero, half, one) = (V::splat(0.0), V::splat(0.5), V::splat(1.0));
    let (middle, reach) = (half * (from + to), half * (to - from));
    let [px, py, pz] = [middle.mul_add(d[0], p[0]), middle.mul_add(d[1], p[1]), middle.mul_add(d[2], p[2])];
    let [dx, dy, dz] = [reach * d[0], reach * d[1], reach * d[2]];
    let [c, linear, e] = &block.profiles;
    let (c, linear, e) = (V::load(c), V::load(linear), V::load(e));
    let tolerance = (V::splat(TOLERANCE_PER_MARGIN) * margin).mul_add(one + margin, V::splat(MIN_TOLERANCE));
    let a = dx.mul_add(dx, dy.mul_add(dy, c * dz * dz));
    let slope = c.mul_add(pz, half * linear);
    let b = px.mul_add(dx, py.mul_add(dy, slope * dz));
    let k = px.mul_add(px, py.mul_add(py, c.mul_add(pz, linear).mul_add(pz, e)));
    let twice = b + b;
    let (first, last) = (k + (a - twice), k + (a + twice));
    let is_beside_between = a.simd_le(b.abs()) | (b * b).simd_lt((k - tolerance) * a);
    let is_beside = tolerance.simd_lt(first) & tolerance.simd_lt(last) & is_beside_between;
    let mask = !(missed | is_beside) & V::ALL;
    let mut chords =
        Chords { p: [px, py, pz], d: [dx, dy, dz], middle, reach, margin, from, mask, sure: 0, outside: 0 };
    if SURE {
        let (start, end) = (V::splat(range.surely_first), V::splat(range.surely_last));
        let comes = start.simd_lt(enters) | tolerance.simd_lt(first);
        let goes = leaves.simd_lt(end) | tolerance.simd_lt(last);
        chords.outside = comes | goes;
        let deep = one - margin;
        // A point between the ends, near the minimum of the parabola.
        let least_at = ((zero - b) / a).max(zero - one).min(one);
        let least = least_at.mul_add(least_at.mul_add(a, twice), k);
        let x = least_at.mul_add(dx, px).abs();
        let y = least_at.mul_add(dy, py).abs();
        let z = least_at.mul_add(dz, pz).abs();
        let height = least_at.mul_add(reach, middle);
        let is_inside = x.max(y).max(z).simd_le(deep)
            & start.simd_le(height)
            & height.simd_le(end)
            & least.simd_lt(zero - tolerance)
            & V::load(&block.tubes).simd_lt(zero);
        chords.sure = is_inside & chords.outside & mask;
    }
    chords
}

/// What sixteen points on a chord say of a tube.
struct SeenTube {
    /// Whether the chord misses the tube, also between the points.
    misses: bool,
    /// Whether a point certainly in range is certainly inside.
    is_inside: bool,
    /// Whether a point certainly in range is certainly outside.
    is_outside: bool,
}

/// The k of points on a chord: the middles of pieces of equal length.
static MIDDLES: Row<f32> = {
    let mut middles = [0.0; LANES];
    let mut i = 0;
    while i < LANES {
        middles[i] = (2 * i + 1) as f32 / LANES as f32 - 1.0;
        i += 1;
    }
    Row(middles)
};

/// One of [`Chords`].
struct Chord {
    p: [f32; 3],
    d: [f32; 3],
    middle: f32,
    reach: f32,
    margin: f32,
}

impl Chord {
    /// Tests a tube of this radius; between `start` and `end`, the line certainly is in its range.
    #[inline(always)]
    fn intersect_tube<W: F32x16>(&self, tube: f32, [start, end]: [f32; 2]) -> SeenTube {
        let Self { p: [px, py, pz], d: [dx, dy, dz], .. } = *self;
        let error = TUBE_ERROR_PER_MARGIN * self.margin + MIN_TUBE_ERROR;
        // In the space of x, y and r z.
        let (pz, dz) = (tube * pz, tube * dz);
        let half_piece = (dx * dx + dy * dy + dz * dz).sqrt() * ((1.0 + 1e-6) / LANES as f32);
        let splat = W::splat;
        let k = W::load(&MIDDLES.0);
        let x = k.mul_add(splat(dx), splat(px));
        let y = k.mul_add(splat(dy), splat(py));
        let z = k.mul_add(splat(dz), splat(pz));
        let from_circle = x.mul_add(x, y * y).sqrt() - splat(1.0 - tube);
        let out = from_circle.mul_add(from_circle, z * z).sqrt() - splat(tube);
        let height = k.mul_add(splat(self.reach), splat(self.middle));
        let in_range = splat(start).simd_le(height) & height.simd_le(splat(end));
        SeenTube {
            misses: splat(half_piece + error).simd_lt(out) == W::ALL,
            is_inside: out.simd_lt(splat(-error)) & in_range != 0,
            is_outside: splat(error).simd_lt(out) & in_range != 0,
        }
    }
}

impl<V: F32x8> Chords<V> {
    /// Tests tubes: a bit for each that may be met, which includes all that are, and a bit for each that certainly is.
    #[inline(always)]
    fn intersect_tubes<W: F32x16, const SURE: bool>(
        &self,
        block: &BoundingBlock,
        range: &HeightRange,
    ) -> (u32, u32) {
        let (mut mask, mut sure) = (self.mask, self.sure);
        let tubes = &block.tubes;
        let mut rings = V::splat(0.0).simd_lt(V::load(tubes)) & mask;
        if rings == 0 {
            return (mask, sure);
        }
        let [px, py, pz] = [self.p[0].to_array(), self.p[1].to_array(), self.p[2].to_array()];
        let [dx, dy, dz] = [self.d[0].to_array(), self.d[1].to_array(), self.d[2].to_array()];
        let (middle, reach) = (self.middle.to_array(), self.reach.to_array());
        let margin = self.margin.to_array();
        let sure_range = [range.surely_first, range.surely_last];
        while rings != 0 {
            let i = rings.trailing_zeros() as usize % BLOCK;
            rings &= rings - 1;
            let chord = Chord {
                p: [px[i], py[i], pz[i]],
                d: [dx[i], dy[i], dz[i]],
                middle: middle[i],
                reach: reach[i],
                margin: margin[i],
            };
            let seen = chord.intersect_tube::<W>(tubes[i], sure_range);
            mask &= !(u32::from(seen.misses) << i);
            let is_outside = seen.is_outside || self.outside >> i & 1 == 1;
            if SURE && seen.is_inside && is_outside {
                sure |= 1 << i;
            }
        }
        (mask, sure)
    }
}

/// Tests a ray against the bounding volumes of a block; with `SURE`, also what is certain: see [`BoundingVolumeRay`].
#[inline(always)]
pub(crate) fn intersect_bounding_volumes<L: Simd, const SURE: bool>(
    block: &BoundingBlock,
    ray: &BoundingVolumeRay,
    range: &HeightRange,
) -> BoundingHits {
    let passages = pass::<L::F32x8>(block, ray, range);
    if passages.missed == <L::F32x8 as Vector>::ALL {
        return BoundingHits::NONE;
    }
    let chords = look_into::<L::F32x8, SURE>(block, range, &passages);
    if chords.mask == 0 {
        return BoundingHits::NONE;
    }
    let (mask, sure) = chords.intersect_tubes::<L::F32x16, SURE>(block, range);
    BoundingHits { mask, sure, near: chords.from.to_array() }
}

/// [`intersect_bounding_volumes`] at an instruction set, for tests.
#[cfg(test)]
pub(crate) fn intersect_bounding_volumes_at(
    isa: super::Isa,
    block: &BoundingBlock,
    ray: &BoundingVolumeRay,
    range: &HeightRange,
) -> BoundingHits {
    struct BoundingVolumes<'a>(&'a BoundingBlock, &'a BoundingVolumeRay, &'a HeightRange);
    impl super::Dispatch for BoundingVolumes<'_> {
        type Output = BoundingHits;
        #[inline(always)]
        fn run<L: Simd>(self) -> Self::Output {
            let met = intersect_bounding_volumes::<L, true>(self.0, self.1, self.2);
            let same = intersect_bounding_volumes::<L, false>(self.0, self.1, self.2);
            assert_eq!((same.mask, same.sure), (met.mask, 0));
            met
        }
    }
    isa.run(BoundingVolumes(block, ray, range))
}
