//! Infinite planes.

use lumbre_math::rounding::gamma;
use lumbre_math::{DVec2, DVec3, Transform, orthonormal_basis};

use crate::line::plane_crossing;
use crate::shape::{check, unsampled};
use crate::support::dot_size;
use crate::twofold::point;
use crate::{Aabb, BoundingVolume, NearestPoint, NearestPointError, Ray, Root, Roots, ShapeError, Surface};

/// The plane through a point; as a solid, the half-space below it, opposite to the normal.
///
/// `uv` are lengths along the two axes that complete the normal to a frame. A ray in the plane misses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub(crate) point: DVec3,
    // The given normal times a power of two, so that small integers stay exact; of the order of 1 in length.
    pub(crate) normal: DVec3,
}

impl Plane {
    /// The plane through `point` perpendicular to `normal`, of any non-zero length.
    ///
    /// # Errors
    /// [`ShapeError`] unless both are finite and the normal is not zero.
    pub fn new(point: DVec3, normal: DVec3) -> Result<Self, ShapeError> {
        let point = check::finite("point", point)?;
        Ok(Self { point, normal: check::scaled_direction("normal", normal)? })
    }

    /// The unit normal.
    pub fn normal(&self) -> DVec3 {
        self.normal.normalize()
    }

    /// The first crossing in the ray's range.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        // No threshold is needed: near zero, `t` leaves the ray's range.
        let (t, along) = plane_crossing(ray, self.point, self.normal);
        if along == 0.0 {
            return None;
        }
        (t.is_finite() && ray.contains(t)).then(|| Root::at(t))
    }

    /// The one crossing, if it is in the ray's range.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        out.extend(self.closest(ray));
    }

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        let n = self.normal();
        let w = point(ray.origin, self.point, root.t, ray.direction);
        self.surface_on(w - w.dot(n) * n)
    }

    /// The surface at `uv`.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let (e1, e2) = orthonormal_basis(self.normal());
        (part == 0).then(|| self.surface_on(uv.x * e1 + uv.y * e2))
    }

    fn surface_on(&self, w: DVec3) -> Surface {
        let normal = self.normal();
        let (e1, e2) = orthonormal_basis(normal);
        let point = self.point + w;
        Surface {
            point,
            point_error: DVec3::splat(gamma(8) * dot_size(normal, w))
                + gamma(2) * (point.abs() + self.point.abs() + w.abs()),
            normal,
            uv: DVec2::new(w.dot(e1), w.dot(e2)),
            dpdu: e1,
            dpdv: e2,
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        }
    }

    /// `None`: it is infinite.
    pub fn bounds(&self, _world_from_object: &Transform) -> Option<Aabb> {
        None
    }

    /// `None`: it is infinite.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        None
    }

    unsampled!();

    /// Always true: it bounds the half-space below it.
    pub fn is_solid(&self) -> bool {
        true
    }

    /// Whether `p` lies in the plane or below it.
    pub fn contains(&self, p: DVec3) -> bool {
        (p - self.point).dot(self.normal) <= 0.0
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
        let point = world_from_object.point(self.point);
        let normal = world_from_object.normal(self.normal);
        let normal = normal / normal.abs().max_element();
        let height = (p - point).dot(normal);
        let foot = p - (height / normal.length_squared()) * normal;
        let w = world_from_object.inverse_point(foot) - self.point;
        let (e1, e2) = orthonormal_basis(self.normal());
        let uv = DVec2::new(w.dot(e1), w.dot(e2));
        Ok(NearestPoint { point: foot, distance: height.abs() / normal.length(), part: 0, uv })
    }

    /// "plane".
    pub fn name(&self) -> &'static str {
        "plane"
    }
}
