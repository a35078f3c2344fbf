//! Axis-aligned boxes.

use lumbre_math::rounding::gamma;
use lumbre_math::{DVec2, DVec3, Transform};

use crate::nearest::{on_triangle, similarity_factor, under_similarity};
use crate::shape::{check, sampled_by_area, two_crossings};
use crate::support::bounds_from_support;
use crate::{
    Aabb, BoundingVolume, NearestPoint, NearestPointError, Ray, Root, ShapeError, Surface, SurfaceSample,
    density, measure,
};

/// The box between two corners, "box" in the scene language. A closed solid: a ray along a face enters and
/// leaves it through the faces at its ends.
///
/// Parts 0 to 5 are the faces −x, +x, −y, +y, −z, +z. On the faces of axis i, `u` is the fraction along axis
/// i+1 and `v` along axis i+2, cyclically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    low: DVec3,
    high: DVec3,
}

impl Cuboid {
    /// The box between two opposite corners, possibly flat along one axis.
    ///
    /// # Errors
    /// [`ShapeError`] unless the corners are finite and differ along at least two axes.
    pub fn new(p0: DVec3, p1: DVec3) -> Result<Self, ShapeError> {
        let (p0, p1) = (check::finite("p0", p0)?, check::finite("p1", p1)?);
        let (low, high) = (p0.min(p1), p0.max(p1));
        let flat_axes = (0..3).filter(|&axis| low[axis] == high[axis]).count();
        if flat_axes > 1 {
            return Err(ShapeError::Degenerate("p0 and p1 of the box must differ along two axes at least"));
        }
        Ok(Self { low, high })
    }

    /// The corner of the least coordinates and that of the greatest.
    pub fn corners(&self) -> [DVec3; 2] {
        [self.low, self.high]
    }

    /// The points where the line enters and leaves the closed box, with their faces.
    ///
    /// T. L. Kay, J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986. The code divides instead of
    /// multiplying by a reciprocal, so a ray in the plane of a face does not multiply zero by infinity.
    #[inline]
    pub(crate) fn span(&self, ray: &Ray) -> Option<[(f64, u32); 2]> {
        let (to_low, to_high) = (self.low - ray.origin, self.high - ray.origin);
        let d = ray.direction;
        let (at_low, at_high) = (to_low / d, to_high / d);
        let (mut enter, mut leave) = (at_low.min(at_high), at_low.max(at_high));
        let is_across = d.cmpeq(DVec3::ZERO);
        if ray.origin.is_nan() || d.is_nan() || is_across.all() {
            return None;
        }
        if is_across.any() {
            // Parallel to two faces and between them, the ray is bounded by the others alone.
            let is_between = to_low.cmple(DVec3::ZERO) & to_high.cmpge(DVec3::ZERO);
            if !(is_between | !is_across).all() {
                return None;
            }
            enter = DVec3::select(is_across, DVec3::NEG_INFINITY, enter);
            leave = DVec3::select(is_across, DVec3::INFINITY, leave);
        }
        let first = |a: (f64, u32), b: (f64, u32)| if b.0 < a.0 { b } else { a };
        let last = |a: (f64, u32), b: (f64, u32)| if b.0 > a.0 { b } else { a };
        let near = last(last((enter.x, 0), (enter.y, 2)), (enter.z, 4));
        let far = first(first((leave.x, 1), (leave.y, 3)), (leave.z, 5));
        // Along a negative direction the high face comes first.
        let turned = |(t, face): (f64, u32)| (t, face ^ u32::from(d[face as usize / 2] < 0.0));
        (near.0 <= far.0).then(|| [turned(near), turned(far)])
    }

    #[inline]
    fn crossings(&self, ray: &Ray) -> [Option<Root>; 2] {
        let Some([near, far]) = self.span(ray) else {
            return [None, None];
        };
        let root = |(t, part): (f64, u32), multiplicity| {
            (t.is_finite() && ray.contains(t)).then_some(Root { part, multiplicity, ..Root::at(t) })
        };
        if near.0 == far.0 { [root(near, 2), None] } else { [root(near, 1), root(far, 1)] }
    }

    two_crossings!(pub);

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        self.surface_on(root.part, ray.at(root.t))
    }

    /// The surface at `uv` of a face.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        if part > 5 {
            return None;
        }
        let axis = part as usize / 2;
        let mut p = self.low;
        for (axis, fraction) in [((axis + 1) % 3, uv.x), ((axis + 2) % 3, uv.y)] {
            p[axis] = (1.0 - fraction) * self.low[axis] + fraction * self.high[axis];
        }
        Some(Surface { uv, ..self.surface_on(part, p) })
    }

    /// The surface at the point of a face nearest to `p`.
    fn surface_on(&self, part: u32, p: DVec3) -> Surface {
        let axis = part as usize / 2;
        let is_high = part % 2 == 1;
        let size = self.high - self.low;
        let mut point = p.clamp(self.low, self.high);
        point[axis] = if is_high { self.high[axis] } else { self.low[axis] };
        let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
        // Along a flat axis the face is a line, and every fraction is the same point.
        let fraction = |i: usize| if size[i] > 0.0 { (point[i] - self.low[i]) / size[i] } else { 0.5 };
        Surface {
            point,
            point_error: gamma(4) * self.low.abs().max(self.high.abs()),
            normal: if is_high { DVec3::AXES[axis] } else { -DVec3::AXES[axis] },
            uv: DVec2::new(fraction(s), fraction(t)),
            dpdu: size[s] * DVec3::AXES[s],
            dpdv: size[t] * DVec3::AXES[t],
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        }
    }

    /// The bounding box under a transform.
    ///
    /// J. Arvo, "Transforming axis-aligned bounding boxes", Graphics Gems, 1990.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let magnitude = self.low.abs().max(self.high.abs());
        let support = |d: DVec3| (d * self.low).max(d * self.high).element_sum();
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// A bounding volume: the box itself.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let bounding_volume = BoundingVolume::of_box(&Aabb { min: self.low, max: self.high })?;
        Some(BoundingVolume { is_solid: !bounding_volume.is_flat, ..bounding_volume })
    }

    /// The areas of the faces perpendicular to x, y and z, one of each pair, with normals stretched by
    /// `stretch`.
    fn face_areas(&self, stretch: impl Fn(DVec3) -> f64) -> [f64; 3] {
        let s = self.high - self.low;
        [s.y * s.z * stretch(DVec3::X), s.z * s.x * stretch(DVec3::Y), s.x * s.y * stretch(DVec3::Z)]
    }

    /// The area of the six faces.
    pub fn area(&self) -> f64 {
        2.0 * self.face_areas(|_| 1.0).iter().sum::<f64>()
    }

    /// The area of the six faces after a transform.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        let stretch = measure::area_stretch(world_from_object);
        2.0 * self.face_areas(|n| (stretch * n).length()).iter().sum::<f64>()
    }

    /// Always true.
    pub fn is_solid(&self) -> bool {
        true
    }

    /// Whether the closed box contains `p`.
    pub fn contains(&self, p: DVec3) -> bool {
        self.low.cmple(p).all() && p.cmple(self.high).all()
    }

    /// The nearest point to `p` under any map.
    ///
    /// # Errors
    /// None.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        if similarity_factor(world_from_object).is_none() {
            let face = |part: u32| {
                let corner = |u: f64, v: f64| {
                    let at = self.surface_at(part, DVec2::new(u, v)).map_or(DVec3::NAN, |s| s.point);
                    world_from_object.point(at)
                };
                let [p00, p10, p01, p11] =
                    [corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0)];
                let low = on_triangle(p, [p00, p10, p01], part);
                let high = on_triangle(p, [p11, p01, p10], part);
                low.or_nearer(NearestPoint { uv: DVec2::ONE - high.uv, ..high })
            };
            return Ok((1..6).map(face).fold(face(0), NearestPoint::or_nearer));
        }
        under_similarity(world_from_object, p, |p| {
            let mut point = p.clamp(self.low, self.high);
            // The face: from inside the nearest, from outside the one that `p` is farthest in front of.
            let depths = [p - self.low, self.high - p];
            let depth = |part: usize| depths[part % 2][part / 2];
            let part = (1..6).fold(0, |best, part| if depth(part) < depth(best) { part } else { best });
            point[part / 2] = if part % 2 == 1 { self.high } else { self.low }[part / 2];
            let (i, j) = ((part / 2 + 1) % 3, (part / 2 + 2) % 3);
            let size = self.high - self.low;
            let share = |axis: usize| {
                if size[axis] > 0.0 { (point[axis] - self.low[axis]) / size[axis] } else { 0.0 }
            };
            let uv = DVec2::new(share(i), share(j));
            NearestPoint { point, distance: (p - point).length(), part: part as u32, uv }
        })
    }

    /// "box".
    pub fn name(&self) -> &'static str {
        "box"
    }

    /// A point uniform by area: first a face, then a point of it.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let areas = self.face_areas(|_| 1.0);
        let area = 2.0 * areas.iter().sum::<f64>();
        let shares = [areas[0], areas[0], areas[1], areas[1], areas[2], areas[2]];
        let (part, left) = density::choose(&shares, u.x);
        let surface = self.surface_at(part as u32, DVec2::new(left, u.y))?;
        Some(SurfaceSample { surface, pdf: 1.0 / area })
    }

    sampled_by_area!(pub);
}
