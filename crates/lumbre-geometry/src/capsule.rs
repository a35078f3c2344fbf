//! Capsules: a segment swept by a ball.

use std::f64::consts::{PI, TAU};

use lumbre_math::rounding::gamma;
use lumbre_math::{DMat3, DVec2, DVec3, Elementary, Transform, orthonormal_basis, warp64};

use crate::axial::{Axial, CAP1, CAP2, LATERAL, Span};
use crate::nearest::under_similarity;
use crate::shape::{check, sampled_by_area, two_crossings};
use crate::support::{bounds_from_support, length, unit};
use crate::{
    Aabb, BoundingVolume, NearestPoint, NearestPointError, Ray, Root, ShapeError, Surface, SurfaceSample,
};
use crate::{measure, sphere};

/// The points at distance `radius` from the segment between `p0` and `p1`: a hemisphere about each end, and the
/// side of a cylinder between them. It is a convex solid; when the ends coincide, a sphere with its poles along
/// z.
///
/// With V the unit vector from `p0` to `p1`, L the length of the segment and φ the azimuth about V, `u` is φ /
/// 2π, and `v` runs along the meridian, of length πr + L, from 0 at the pole beyond `p0` to 1 at the pole
/// beyond `p1`. The point and both its derivatives are continuous across the seams. Part 0 is the side, 1 the
/// hemisphere about `p0`, 2 that about `p1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    // The capped cylinder inside the capsule (k = 0); its length may be 0.
    pub(crate) tube: Axial,
}

impl Capsule {
    /// The capsule about the segment from `p0` to `p1`, which may coincide.
    ///
    /// # Errors
    /// [`ShapeError`] unless the ends and their distance are finite, and the radius is finite and greater than
    /// 0.
    pub fn new(p0: DVec3, p1: DVec3, radius: f64) -> Result<Self, ShapeError> {
        let (p0, p1) = (check::finite("p0", p0)?, check::finite("p1", p1)?);
        let radius = check::positive("radius", radius)?;
        let axis = if p0 == p1 { DVec3::Z } else { check::direction("p1", p1 - p0)? };
        let length = (p1 - p0).length();
        let length = check::within("p1", length, length.is_finite(), "a finite distance from p0")?;
        let tube = Axial {
            p1: p0,
            p2: p1,
            axis,
            length,
            r1: radius,
            r2: radius,
            k: 0.0,
            cut1: true,
            cut2: true,
            caps: true,
            phi_max: TAU,
            has_ends: p0 != p1,
        };
        Ok(Self { tube })
    }

    /// The ends of the segment.
    pub fn ends(&self) -> [DVec3; 2] {
        [self.tube.p1, self.tube.p2]
    }

    /// The radius.
    pub fn radius(&self) -> f64 {
        self.tube.r1
    }

    /// The length of a meridian, πr + L.
    fn meridian(&self) -> f64 {
        PI * self.radius() + self.tube.length
    }

    /// The centre of a cap, and the unit vector from there to its pole.
    pub(crate) fn cap(&self, part: u32) -> (DVec3, DVec3) {
        if part == CAP1 { (self.tube.p1, -self.tube.axis) } else { (self.tube.p2, self.tube.axis) }
    }

    /// The interval of the line inside the capsule: the convex hull of its intervals inside the cylinder and
    /// the two balls.
    ///
    /// The balls lie inside the infinite cylinder, so a line that misses it misses everything, and a ball
    /// matters only where the line passes beyond that end of the cylinder. No computed point is tested against
    /// a seam, so there is no crack along it. If rounding makes a line miss a ball although it passes through
    /// the disk at its end, the disk is used.
    #[inline]
    pub(crate) fn span(&self, ray: &Ray) -> Option<Span> {
        let [side_near, side_far] = self.tube.lateral_span(ray)?;
        let ball = |part| {
            let (near, far) = sphere::crossings(self.cap(part).0, self.radius(), ray)?;
            Some([(near, part), (far, part)])
        };
        let Some([slab_near, slab_far]) = self.tube.slab_span(ray) else {
            return ball(self.ball_beyond(ray));
        };
        let enters = if side_near.0 < slab_near.0 { slab_near } else { side_near };
        let leaves = if side_far.0 > slab_far.0 { slab_far } else { side_far };
        let mut span = (enters.0 <= leaves.0).then_some([enters, leaves]);
        let mut join = |part| {
            let Some([near, far]) = ball(part) else {
                return;
            };
            let [first, last] = span.unwrap_or([near, far]);
            let first = if near.0 < first.0 { near } else { first };
            let last = if far.0 > last.0 { far } else { last };
            span = Some([first, last]);
        };
        if side_near.0 < slab_near.0 {
            join(slab_near.1);
        }
        if side_far.0 > slab_far.0 {
            join(slab_far.1);
        }
        span
    }

    /// The end beyond which a line is that passes perpendicular to the axis.
    pub(crate) fn ball_beyond(&self, ray: &Ray) -> u32 {
        let is_before = (ray.origin - self.tube.p1).dot(self.tube.axis) < 0.0;
        if is_before { CAP1 } else { CAP2 }
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
        let u = |arm| (self.tube.phi(arm) / TAU).min(1.0);
        let surface = if root.part == LATERAL {
            let (z, arm) = self.tube.arm(ray, root.t, LATERAL);
            let outward = unit(arm).unwrap_or_else(|| orthonormal_basis(self.tube.axis).0);
            self.on_side(z.clamp(0.0, self.tube.length), outward, u(arm))
        } else {
            let w = sphere::arm(self.cap(root.part).0, self.radius(), ray, root.t);
            self.on_cap(root.part, w, u(w))
        };
        let ends = self.span(ray).map(|[near, far]| (near.0, far.0));
        Surface { normal: sphere::sided(surface.normal, ends, ray, root.t), ..surface }
    }

    /// The surface at `uv` of a part: 0 the side, 1 and 2 the caps. A `v` past the seam continues the part, as
    /// if the cylinder were longer or the cap more than a hemisphere.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let (e1, e2) = orthonormal_basis(self.tube.axis);
        let (sin, cos) = warp64::circle(uv.x);
        let outward = cos * e1 + sin * e2;
        let surface = match part {
            LATERAL => self.on_side(uv.y * self.meridian() - 0.5 * PI * self.radius(), outward, uv.x),
            CAP1 | CAP2 => {
                let from_pole = if part == CAP1 { uv.y } else { 1.0 - uv.y };
                let (sin, cos) = (from_pole * self.meridian() / self.radius()).sine_cosine();
                let w = sin * outward + cos * self.cap(part).1;
                self.on_cap(part, w * (self.radius() / w.length()), uv.x)
            }
            _ => return None,
        };
        Some(Surface { uv, ..surface })
    }

    fn on_side(&self, z: f64, outward: DVec3, u: f64) -> Surface {
        let v = (0.5 * PI * self.radius() + z) / self.meridian();
        let dpdv = self.meridian() * self.tube.axis;
        Surface { uv: DVec2::new(u, v), dpdv, ..self.tube.on_side(z, outward, u) }
    }

    /// The surface of a cap at a point `w` of its sphere, relative to the centre. With the polar angle θ from
    /// the pole, v = rθ / (πr + L) on the first cap, and 1 minus that on the second.
    fn on_cap(&self, part: u32, w: DVec3, u: f64) -> Surface {
        let (center, to_pole) = self.cap(part);
        let (axis, radius) = (self.tube.axis, self.radius());
        let normal = w / length(w);
        let rho = length(axis.cross(w));
        let around = {
            // At a pole any meridian will do; near one the cross product has lost digits.
            let rough = if rho > 0.0 { axis.cross(w) / rho } else { orthonormal_basis(axis).1 };
            (rough - normal.dot(rough) * normal).normalize()
        };
        let from_pole = rho.angle_from(w.dot(to_pole)) * radius / self.meridian();
        let dpdu = TAU * rho.max(1e-10 * radius) * around;
        let dpdv = self.meridian() * normal.cross(around);
        let point = center + w;
        Surface {
            point,
            point_error: gamma(8) * w.abs() + gamma(2) * (point.abs() + center.abs()),
            normal,
            uv: DVec2::new(u, if part == CAP1 { from_pole } else { 1.0 - from_pole }),
            dpdu,
            dpdv,
            dndu: dpdu / radius,
            dndv: dpdv / radius,
        }
    }

    /// The bounding box under a transform, from the support function max(d·p0, d·p1) + r|d|.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let [p0, p1] = self.ends();
        let support = |d: DVec3| d.dot(p0).max(d.dot(p1)) + self.radius() * d.length();
        let magnitude = p0.abs().max(p1.abs()) + DVec3::splat(self.radius());
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// A bounding volume: the circumscribed cylinder.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let [p0, p1] = self.ends();
        let (e1, e2) = orthonormal_basis(self.tube.axis);
        let half = 0.5 * self.tube.length + self.radius();
        let axes = DMat3::from_cols(self.radius() * e1, self.radius() * e2, half * self.tube.axis);
        Some(BoundingVolume::new(0.5 * (p0 + p1), axes, BoundingVolume::CYLINDER, false))
    }

    /// The area, 2πr (L + 2r): that of the circumscribed cylinder, by Archimedes.
    pub fn area(&self) -> f64 {
        TAU * self.radius() * (self.tube.length + 2.0 * self.radius())
    }

    /// The area after a transform: an ellipsoid's for the caps, whose normals are those of a whole sphere, and
    /// a quadrature over the azimuth for the side.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        let stretch = measure::area_stretch(world_from_object);
        let (e1, e2) = orthonormal_basis(self.tube.axis);
        let around = measure::integrate(0.0, TAU, |phi| {
            let (sin, cos) = phi.sine_cosine();
            (stretch * (cos * e1 + sin * e2)).length()
        });
        let caps = measure::ellipsoid_area(self.radius(), world_from_object);
        self.radius() * self.tube.length * around + caps
    }

    /// Always true.
    pub fn is_solid(&self) -> bool {
        true
    }

    /// Whether `p` is within `radius` of the segment.
    pub fn contains(&self, p: DVec3) -> bool {
        let [p0, p1] = self.ends();
        let z = (p - p0).dot(self.tube.axis);
        let nearest = if z <= 0.0 {
            p0
        } else if (p - p1).dot(self.tube.axis) >= 0.0 {
            p1
        } else {
            p0 + z * self.tube.axis
        };
        (p - nearest).length() <= self.radius()
    }

    /// The nearest point to `p` under a similarity.
    ///
    /// # Errors
    /// [`NearestPointError::Map`] for other maps.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        under_similarity(world_from_object, p, |p| {
            let (axis, length, radius) = (self.tube.axis, self.tube.length, self.radius());
            let w = p - self.tube.p1;
            let z = w.dot(axis);
            let (part, center) = if z < 0.0 {
                (CAP1, self.tube.p1)
            } else if z > length {
                (CAP2, self.tube.p2)
            } else {
                (LATERAL, self.tube.p1 + z * axis)
            };
            let mut arm = p - center;
            if part == LATERAL {
                arm -= arm.dot(axis) * axis;
            }
            let from_segment = arm.length();
            let outward = if from_segment > 0.0 { arm / from_segment } else { orthonormal_basis(axis).0 };
            let u = (self.tube.phi(outward) / TAU).min(1.0);
            let surface = if part == LATERAL {
                self.on_side(z, outward, u)
            } else {
                self.on_cap(part, radius * outward, u)
            };
            let distance = (from_segment - radius).abs();
            NearestPoint { point: surface.point, distance, part, uv: surface.uv }
        })
    }

    /// "capsule".
    pub fn name(&self) -> &'static str {
        "capsule"
    }

    /// A point uniform by area: by Archimedes' theorem uniform in height over all parts, and in azimuth.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let (radius, length) = (self.radius(), self.tube.length);
        let (e1, e2) = orthonormal_basis(self.tube.axis);
        let (sin, cos) = warp64::circle(u.y);
        let outward = cos * e1 + sin * e2;
        let height = length + 2.0 * radius;
        let (below, above) = (u.x * height, (1.0 - u.x) * height);
        let on_cap = |part, from_pole: f64| {
            let rho = (from_pole * (2.0 * radius - from_pole)).sqrt();
            let w = rho * outward + (radius - from_pole) * self.cap(part).1;
            self.on_cap(part, w * (radius / w.length()), u.y)
        };
        let surface = if below < radius {
            on_cap(CAP1, below)
        } else if above < radius {
            on_cap(CAP2, above)
        } else {
            self.on_side((below - radius).clamp(0.0, length), outward, u.y)
        };
        Some(SurfaceSample { surface, pdf: 1.0 / self.area() })
    }

    sampled_by_area!(pub);
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::Roots;
    use crate::{Cylinder, Sphere};

    fn line(origin: DVec3, direction: DVec3) -> Ray {
        Ray::new(origin, direction).with_range(f64::NEG_INFINITY, f64::INFINITY)
    }

    fn roots(capsule: &Capsule, ray: &Ray) -> Vec<(f64, u32, u8)> {
        let mut found = Roots::new();
        capsule.roots(ray, &mut found);
        found.iter().map(|root| (root.t, root.part, root.multiplicity)).collect()
    }

    /// Along z from 2 to 8, of radius 1.5, about x = 3, y = −1.
    fn upright() -> Capsule {
        Capsule::new(DVec3::new(3.0, -1.0, 2.0), DVec3::new(3.0, -1.0, 8.0), 1.5).unwrap()
    }

    #[test]
    fn every_pair_of_parts_is_crossed_where_it_should_be() {
        let v = DVec3::new;
        let cases = [
            ("side, side", v(-2.0, -1.0, 5.0), DVec3::X, vec![(3.5, 0, 1), (6.5, 0, 1)]),
            ("cap, cap, along the axis", v(3.0, -1.0, -4.0), DVec3::Z, vec![(4.5, 1, 1), (13.5, 2, 1)]),
            ("the same backwards", v(3.0, -1.0, 11.5), -0.5 * DVec3::Z, vec![(4.0, 2, 1), (22.0, 1, 1)]),
            ("off the axis", v(3.0, 0.2, 0.0), DVec3::Z, vec![(1.1, 1, 1), (8.9, 2, 1)]),
            ("across the first cap", v(0.0, -1.0, 1.1), DVec3::X, vec![(1.8, 1, 1), (4.2, 1, 1)]),
            ("across the second cap", v(0.0, -1.0, 8.9), DVec3::X, vec![(1.8, 2, 1), (4.2, 2, 1)]),
            ("touches the side from without", v(-7.0, 0.5, 5.5), 2.0 * DVec3::X, vec![(5.0, 0, 2)]),
            ("touches a pole", v(-7.0, -1.0, 9.5), 4.0 * DVec3::X, vec![(2.5, 2, 2)]),
            ("passes over a pole", v(-7.0, -1.0, 9.6), DVec3::X, vec![]),
            ("passes the side", v(-7.0, 0.51, 5.5), DVec3::X, vec![]),
            ("passes a cap within the cylinder", v(0.0, -1.0, 9.0), v(2.0, 0.0, 1.0), vec![]),
            ("along the side", v(4.5, -1.0, 0.0), DVec3::Z, vec![(2.0, 1, 1), (8.0, 2, 1)]),
        ];
        for (name, origin, direction, expected) in cases {
            let found = roots(&upright(), &line(origin, direction));
            assert_eq!(found.len(), expected.len(), "{name}: {found:?}");
            for (found, expected) in found.iter().zip(&expected) {
                assert!((found.0 - expected.0).abs() < 1e-14 * 8.0, "{name}: {found:?} {expected:?}");
                assert_eq!((found.1, found.2), (expected.1, expected.2), "{name}");
            }
        }
    }

    #[test]
    fn it_is_the_union_of_a_cylinder_and_two_balls() {
        let mut random = RandomStream::new(31);
        let mut hits = [0; 3];
        for i in 0..40_000 {
            let mut v = || DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) * 4.0 - 1.3;
            let (p0, p1, radius) = (v(), v(), 0.2 + 0.3 * v().x.abs());
            let (origin, direction) = (8.0 * v(), v());
            let direction = if i % 2 == 0 { v() - origin } else { direction };
            let ray = line(origin, direction);
            let mut parts = Roots::new();
            Cylinder::new(p0, p1, radius, true).unwrap().roots(&ray, &mut parts);
            Sphere::new(p0, radius).unwrap().roots(&ray, &mut parts);
            Sphere::new(p1, radius).unwrap().roots(&ray, &mut parts);
            let capsule = Capsule::new(p0, p1, radius).unwrap();
            let found = roots(&capsule, &ray);
            let first = parts.iter().map(|root| root.t).fold(f64::INFINITY, f64::min);
            let last = parts.iter().map(|root| root.t).fold(f64::NEG_INFINITY, f64::max);
            let expected: &[f64] = if parts.is_empty() { &[] } else { &[first, last] };
            let found_t: Vec<f64> = found.iter().map(|root| root.0).collect();
            assert_eq!(found_t, expected, "{capsule:?} {ray:?}");
            for root in found {
                hits[root.1 as usize] += 1;
            }
        }
        assert!(hits.iter().all(|&n| n > 900), "{hits:?}");
    }

    #[test]
    fn no_ray_slips_through_a_seam() {
        let mut random = RandomStream::new(32);
        let capsule = Capsule::new(DVec3::new(0.7, -0.2, 1.9), DVec3::new(-2.1, 1.3, 0.4), 0.6).unwrap();
        let seams = [0.3 * PI, 0.3 * PI + capsule.tube.length].map(|along| along / capsule.meridian());
        for i in 0..40_000 {
            let v = seams[i % 2];
            let rim = capsule.surface_at(0, DVec2::new(random.next_f64(), v)).unwrap();
            let aside = DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) - 0.5;
            // From outside, more or less steeply, up to the last bits.
            let from =
                rim.point + 7.0 * (rim.normal * 0.5f64.powi((i % 20) as i32) + rim.normal.cross(aside));
            let found = roots(&capsule, &line(from, rim.point - from));
            assert_eq!(found.len(), 2, "{from} {rim:?} {found:?}");
            assert!((found[0].0 - 1.0).abs() < 1e-8, "{from} {rim:?} {found:?}");
        }
    }

    #[test]
    fn parts_meet_with_the_same_point_normal_uv_and_tangents() {
        let capsule = Capsule::new(DVec3::new(0.7, -0.2, 1.9), DVec3::new(-2.1, 1.3, 0.4), 0.6).unwrap();
        let quarter = 0.5 * PI * 0.6;
        for (cap, along) in [(CAP1, quarter), (CAP2, quarter + capsule.tube.length)] {
            let uv = DVec2::new(0.37, along / capsule.meridian());
            let side = capsule.surface_at(LATERAL, uv).unwrap();
            let cap = capsule.surface_at(cap, uv).unwrap();
            for (a, b) in [
                (side.point, cap.point),
                (side.normal, cap.normal),
                (side.dpdu, cap.dpdu),
                (side.dpdv, cap.dpdv),
                (side.dndu, cap.dndu),
            ] {
                assert!((a - b).length() < 1e-14 * 8.0, "{a} {b}");
            }
            // The whole side is a straight line of unit speed times the meridian.
            assert!((side.dpdv.length() - (PI * 0.6 + capsule.tube.length)).abs() < 1e-14 * 8.0);
        }
        let pole = capsule.surface_at(CAP1, DVec2::new(0.2, 0.0)).unwrap();
        assert!((pole.point - (capsule.tube.p1 - 0.6 * capsule.tube.axis)).length() < 1e-15 * 8.0);
        assert!(capsule.surface_at(3, DVec2::new(0.2, 0.4)).is_none());
    }

    #[test]
    fn ends_in_one_point_make_a_sphere() {
        let center = DVec3::new(0.3, -1.7, 2.2);
        let (capsule, ball) = (Capsule::new(center, center, 1.4).unwrap(), Sphere::new(center, 1.4).unwrap());
        let stretched = Transform::scale(DVec3::new(0.5, 2.0, 3.0)).unwrap();
        assert_eq!(capsule.bounds(&stretched), ball.bounds(&stretched));
        assert!((capsule.area() / ball.area() - 1.0).abs() < 1e-15);
        assert!((capsule.area_under(&stretched) / ball.area_under(&stretched) - 1.0).abs() < 1e-15);
        let mut random = RandomStream::new(33);
        let mut hits = 0;
        for _ in 0..5000 {
            let mut v = || DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) * 4.0 - 2.0;
            let ray = line(center + 3.0 * v(), v());
            let mut whole = Roots::new();
            ball.roots(&ray, &mut whole);
            let found = roots(&capsule, &ray);
            assert_eq!(found.len(), whole.len(), "{ray:?}");
            for (found, root) in found.iter().zip(&whole) {
                hits += 1;
                assert_eq!(found.0, root.t, "{ray:?}");
                let root = Root { t: found.0, part: found.1, multiplicity: 1, local: DVec2::ZERO };
                let (a, b) = (capsule.surface(&ray, &root), ball.surface(&ray, &Root::at(found.0)));
                assert!(
                    (a.point - b.point).length() < 1e-14 && (a.uv - b.uv).length() < 1e-12,
                    "{a:?} {b:?}"
                );
                assert!((a.dpdv - b.dpdv).length() < 1e-12, "{a:?} {b:?}");
            }
        }
        assert!(hits > 500, "{hits}");
    }

    #[test]
    fn bad_capsules_are_refused_with_the_parameter() {
        let (p, q) = (DVec3::new(0.4, 1.2, -0.3), DVec3::new(2.0, 0.3, 0.9));
        let huge = DVec3::new(f64::MAX, 0.4, 0.4);
        let cases = [
            ("radius", Capsule::new(p, q, 0.0)),
            ("radius", Capsule::new(p, q, -2.0)),
            ("radius", Capsule::new(p, q, f64::INFINITY)),
            ("p0", Capsule::new(p * f64::NAN, q, 2.0)),
            ("p1", Capsule::new(p, q * f64::INFINITY, 2.0)),
            ("p1", Capsule::new(-huge, huge, 2.0)),
        ];
        for (name, made) in cases {
            let Err(ShapeError::OutOfRange { parameter, .. }) = made else { panic!("{name}: {made:?}") };
            assert_eq!(parameter, name);
        }
    }

    #[test]
    fn absurd_proportions_answer_or_miss_and_never_panic() {
        const SIZES: [f64; 10] = [5e-324, 1e-160, 1e-30, 1e-8, 0.7, 3.5, 1e9, 1e75, 1e160, f64::MAX];
        let mut random = RandomStream::new(34);
        let (mut made, mut hits) = (0, 0);
        for _ in 0..20_000 {
            let mut size = || SIZES[random.next_below(SIZES.len())];
            let radius = size();
            let scale = [size(), size(), size()];
            let mut v = |scale: f64| {
                scale * (2.0 * DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) - 1.0)
            };
            let Ok(capsule) = Capsule::new(v(scale[0]), v(scale[1]), radius) else { continue };
            made += 1;
            let ray = line(v(scale[2]), v(3.5));
            let mut found = Roots::new();
            capsule.roots(&ray, &mut found);
            assert_eq!(capsule.closest(&ray), found.first().copied());
            for root in &found {
                hits += 1;
                assert!(root.t.is_finite());
                let _ = (capsule.surface(&ray, root), capsule.contains(ray.at(root.t)));
            }
            let u = DVec2::new(0.3, 0.8);
            let _ = (capsule.sample_area(u), capsule.sample_direction(ray.origin, u));
            let _ = (capsule.bounds(&Transform::IDENTITY), capsule.area(), capsule.surface_at(0, u));
        }
        assert!(made > 10_000 && hits > 2_000, "{made} made, {hits} hits");
    }
}
