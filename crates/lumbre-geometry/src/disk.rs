//! Disks, annuli, and sectors of them.

use std::f64::consts::TAU;

use lumbre_math::rounding::gamma;
use lumbre_math::{DVec2, DVec3, Elementary, Transform, orthonormal_basis};

use crate::line::plane_crossing;
use crate::nearest::{Meridian, under_similarity};
use crate::shape::{check, open_surface, sampled_by_area};
use crate::support::{arc_support, azimuth, bounds_from_support, dot_size};
use crate::twofold::point;
use crate::{
    Aabb, BoundingVolume, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError, Surface,
    SurfaceSample, measure,
};

/// The points of a plane between two distances from a centre, both included.
///
/// As in pbrt, `u` is the azimuth over `phimax` and `v` falls from 1 at the inner radius to 0 at the rim. A ray
/// in the plane misses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    pub(crate) center: DVec3,
    // The given normal times a power of two, so that small integers stay exact; of the order of 1 in length.
    pub(crate) normal: DVec3,
    // 0 <= inner_radius < radius.
    pub(crate) radius: f64,
    pub(crate) inner_radius: f64,
    pub(crate) phi_max: f64,
}

impl Disk {
    /// The disk about `center` perpendicular to `normal` (of any non-zero length), with a hole of
    /// `inner_radius` unless that is 0.
    ///
    /// # Errors
    /// [`ShapeError`] unless everything is finite, the normal is not zero, and 0 ≤ inner radius < radius.
    pub fn new(center: DVec3, normal: DVec3, radius: f64, inner_radius: f64) -> Result<Self, ShapeError> {
        let center = check::finite("center", center)?;
        let normal = check::scaled_direction("normal", normal)?;
        let radius = check::positive("radius", radius)?;
        let leaves_a_ring = 0.0 <= inner_radius && inner_radius < radius;
        let inner_radius =
            check::within("innerradius", inner_radius, leaves_a_ring, "from 0 to less than radius")?;
        Ok(Self { center, normal, radius, inner_radius, phi_max: TAU })
    }

    /// The sector with azimuth up to `phimax` degrees.
    ///
    /// # Errors
    /// [`ShapeError`] when `phimax` is not in (0, 360].
    pub fn partial(self, phimax: f64) -> Result<Self, ShapeError> {
        Ok(Self { phi_max: check::sweep(phimax)?, ..self })
    }

    /// The unit normal.
    pub fn normal(&self) -> DVec3 {
        self.normal.normalize()
    }

    /// The point at `t` in the disk's plane, relative to the centre.
    pub(crate) fn arm(&self, ray: &Ray, t: f64) -> DVec3 {
        let w = point(ray.origin, self.center, t, ray.direction);
        w - (w.dot(self.normal) / self.normal.length_squared()) * self.normal
    }

    /// The first crossing in the ray's range.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        let (t, along) = plane_crossing(ray, self.center, self.normal);
        if !(along != 0.0 && t.is_finite() && ray.contains(t)) {
            return None;
        }
        let w = self.arm(ray, t);
        let distance_squared = w.length_squared();
        let inside = self.inner_radius * self.inner_radius <= distance_squared
            && distance_squared <= self.radius * self.radius
            && (self.phi_max >= TAU || {
                let (e1, e2) = orthonormal_basis(self.normal());
                azimuth(w.dot(e2), w.dot(e1)) <= self.phi_max
            });
        inside.then(|| Root::at(t))
    }

    /// The one crossing, if it is in the ray's range.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        out.extend(self.closest(ray));
    }

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let w = self.arm(ray, root.t);
        let (e1, e2) = orthonormal_basis(self.normal());
        let phi = azimuth(w.dot(e2), w.dot(e1));
        let v = (self.radius - w.length()) / (self.radius - self.inner_radius);
        self.surface_on(w, DVec2::new((phi / self.phi_max).min(1.0), v.clamp(0.0, 1.0)))
    }

    /// The surface at `uv`.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let (e1, e2) = orthonormal_basis(self.normal());
        let (sin, cos) = (uv.x * self.phi_max).sine_cosine();
        let rho = self.radius + uv.y * (self.inner_radius - self.radius);
        (part == 0).then(|| self.surface_on(rho * (cos * e1 + sin * e2), uv))
    }

    fn surface_on(&self, w: DVec3, uv: DVec2) -> Surface {
        let normal = self.normal();
        let rho = w.length();
        // At the centre any direction will do.
        let outward = if rho > 0.0 { w / rho } else { orthonormal_basis(normal).0 };
        let point = self.center + w;
        Surface {
            point,
            point_error: DVec3::splat(gamma(8) * dot_size(normal, w))
                + gamma(2) * (point.abs() + self.center.abs() + w.abs()),
            normal,
            uv,
            dpdu: self.phi_max * rho.max(1e-10 * self.radius) * normal.cross(outward),
            dpdv: (self.inner_radius - self.radius) * outward,
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        }
    }

    /// The bounding box under a transform, tight for sectors too.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        let normal = self.normal();
        let (e1, e2) = orthonormal_basis(normal);
        let support = |d: DVec3| {
            let reach = if self.phi_max >= TAU {
                self.radius * d.cross(normal).length()
            } else {
                // On a radius the extreme is at one of its ends.
                let unit = arc_support(d.dot(e1), d.dot(e2), 0.0, self.phi_max);
                (self.radius * unit).max(self.inner_radius * unit)
            };
            d.dot(self.center) + reach
        };
        let magnitude = self.center.abs() + DVec3::splat(self.radius);
        Some(bounds_from_support(world_from_object, magnitude, support))
    }

    /// A bounding volume: the whole disk, without its hole.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let (e1, e2) = orthonormal_basis(self.normal());
        BoundingVolume::flat(self.center, self.radius * e1, self.radius * e2, BoundingVolume::BALL)
    }

    /// The area, of one side.
    pub fn area(&self) -> f64 {
        0.5 * self.phi_max * (self.radius - self.inner_radius) * (self.radius + self.inner_radius)
    }

    /// The area after a transform, of one side.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        self.area() * (measure::area_stretch(world_from_object) * self.normal()).length()
    }

    open_surface!();

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
            let axis = self.normal();
            let (e1, e2) = orthonormal_basis(axis);
            let w = p - self.center;
            let meridian = Meridian::new(DVec3::new(w.dot(e1), w.dot(e2), w.dot(axis)), self.phi_max);
            let r = meridian.x.clamp(self.inner_radius, self.radius);
            let arm = r * (meridian.outward.x * e1 + meridian.outward.y * e2);
            let v = (self.radius - r) / (self.radius - self.inner_radius);
            NearestPoint {
                point: self.center + arm,
                distance: meridian.distance(r, 0.0),
                part: 0,
                uv: DVec2::new((meridian.phi / self.phi_max).min(1.0), v),
            }
        })
    }

    /// "disk".
    pub fn name(&self) -> &'static str {
        "disk"
    }

    /// A point uniform by area.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let (inner, outer) = (self.inner_radius * self.inner_radius, self.radius * self.radius);
        let rho = (inner + u.x * (outer - inner)).sqrt();
        let v = (self.radius - rho) / (self.radius - self.inner_radius);
        let surface = self.surface_at(0, DVec2::new(u.y, v.clamp(0.0, 1.0)))?;
        Some(SurfaceSample { surface, pdf: 1.0 / self.area() })
    }

    sampled_by_area!(pub);
}
