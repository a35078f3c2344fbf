//! Rays and hits in single precision.

use lumbre_geometry::Ray;
use lumbre_math::Vec3;

/// The points `origin + t * direction` with `t_min <= t <= t_max`, in single precision, at time 0: the rays of
/// [`Accel::closest_f32`] and similar methods. The rules of [`Ray`] apply.
///
/// [`Accel::closest_f32`]: crate::Accel::closest_f32
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray32 {
    /// The point at `t` = 0.
    pub origin: Vec3,
    /// The smallest `t`, inclusive.
    pub t_min: f32,
    /// The direction of increasing `t`, of any length but zero.
    pub direction: Vec3,
    /// The largest `t`, inclusive; may be infinite.
    pub t_max: f32,
}

impl Ray32 {
    /// The half-line from `origin` along `direction`.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// The same line with another range.
    #[must_use]
    #[inline]
    pub fn with_range(self, t_min: f32, t_max: f32) -> Self {
        Self { t_min, t_max, ..self }
    }

    /// The same ray in double precision.
    #[inline]
    pub fn to_f64(self) -> Ray {
        Ray::new(self.origin.as_dvec3(), self.direction.as_dvec3())
            .with_range(self.t_min.into(), self.t_max.into())
    }

    /// The point at `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}

/// A crossing in single precision, and what was crossed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Hit32 {
    /// The position along the ray.
    pub t: f32,
    /// For a triangle, the barycentrics of its second and third corner.
    pub local: [f32; 2],
    /// The id of the geometry.
    pub id: u32,
    /// The triangle of a mesh, the sphere of a cloud, the primitive of a custom geometry, otherwise 0.
    pub primitive: u32,
    /// The position of the geometry in the list that its tree was built from.
    pub geometry: u32,
    /// The id of the outermost instance around it; [`Hit32::NO_INSTANCE`] outside of instances.
    pub instance: u32,
}

impl Hit32 {
    /// The id outside of instances.
    pub const NO_INSTANCE: u32 = u32::MAX;
}
