//! Crossings, and the surface at a hit.

use lumbre_math::rounding::{gamma, offset_point};
use lumbre_math::{DVec2, DVec3};
use smallvec::SmallVec;

/// A crossing of a ray with a surface: as little as a search needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// The ray parameter, in units of the direction's length.
    pub t: f64,
    /// The part of the shape: 0 for the only or the lateral surface; 1 and 2 for the caps at the first and
    /// second end; 0 to 5 for a box's faces -x, +x, -y, +y, -z, +z. For CSG, see `Csg`.
    pub part: u32,
    /// The multiplicity as a root of a polynomial: 2 where a ray touches without crossing.
    pub multiplicity: u8,
    /// Surface coordinates that the search computes anyway: barycentrics (b1, b2) of a triangle, (u, v) of a
    /// bilinear patch. Zero for other shapes, which compute theirs for the closest hit only.
    pub local: DVec2,
}

impl Root {
    /// A simple crossing of part 0.
    #[inline]
    pub fn at(t: f64) -> Self {
        Self { t, part: 0, multiplicity: 1, local: DVec2::ZERO }
    }
}

/// Crossings in ascending order of `t`.
pub type Roots = SmallVec<[Root; 4]>;

/// The surface at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The point, re-projected onto the surface, so that its error does not grow with the distance to the ray's
    /// origin.
    pub point: DVec3,
    /// A bound on the absolute error of each component of `point`.
    pub point_error: DVec3,
    /// The geometric normal: unit, outward for closed shapes, not flipped towards the ray.
    pub normal: DVec3,
    /// Surface parameters, each in [0, 1] on bounded shapes.
    pub uv: DVec2,
    /// ∂point/∂u.
    pub dpdu: DVec3,
    /// ∂point/∂v.
    pub dpdv: DVec3,
    /// ∂normal/∂u.
    pub dndu: DVec3,
    /// ∂normal/∂v.
    pub dndv: DVec3,
}

impl Surface {
    /// The surface at a point, by its normal alone, of any length: flat, without parameters, and with a bound on the
    /// point's error of a few units in its last place. For custom geometry that has no more to say.
    ///
    /// ```
    /// use lumbre_geometry::Surface;
    /// use lumbre_math::DVec3;
    ///
    /// let surface = Surface::new(DVec3::new(3.0, -4.0, 0.5), DVec3::new(0.0, 0.0, 2.0));
    /// assert_eq!(surface.normal, DVec3::Z);
    /// assert!(surface.dpdu.cross(surface.dpdv).dot(surface.normal) > 0.99);
    /// ```
    pub fn new(point: DVec3, normal: DVec3) -> Self {
        let normal = normal.try_normalize().unwrap_or(DVec3::Z);
        let (dpdu, dpdv) = normal.any_orthonormal_pair();
        Self {
            point,
            point_error: gamma(8) * point.abs(),
            normal,
            uv: DVec2::ZERO,
            dpdu,
            dpdv,
            dndu: DVec3::ZERO,
            dndv: DVec3::ZERO,
        }
    }

    /// The origin of a ray that leaves along `direction`, by [`offset_point`].
    pub fn offset_origin(&self, direction: DVec3) -> DVec3 {
        offset_point(self.point, self.point_error, self.normal, direction)
    }
}

/// A point sampled on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// The point, with its normal and parameters.
    pub surface: Surface,
    /// The probability density per unit area.
    pub pdf: f64,
}

/// A point sampled on a surface as seen from another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionSample {
    /// The point, with its normal and parameters.
    pub surface: Surface,
    /// The probability density per unit solid angle at the other point.
    pub pdf: f64,
}
