//! A ray with its parameter range.

use lumbre_math::{DVec3, Transform};

/// The points `origin + t * direction` with `t_min <= t <= t_max`.
///
/// The direction need not be unit, and `t` is in units of its length, from about 1e-150 to 1e150 (its square
/// must be finite). A NaN anywhere, or a direction of zero, makes every query a miss.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// The point at `t` = 0.
    pub origin: DVec3,
    /// The direction, of any non-zero length.
    pub direction: DVec3,
    /// The least `t`, inclusive.
    pub t_min: f64,
    /// The greatest `t`, inclusive; may be infinite.
    pub t_max: f64,
    /// The time, in the units of animation keys; static geometry ignores it.
    pub time: f64,
}

impl Ray {
    /// The half-line from `origin` along `direction`, at time 0.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f64::INFINITY, time: 0.0 }
    }

    /// The same line with another range.
    #[must_use]
    #[inline]
    pub fn with_range(self, t_min: f64, t_max: f64) -> Self {
        Self { t_min, t_max, ..self }
    }

    /// The same ray at another time.
    #[must_use]
    pub fn at_time(self, time: f64) -> Self {
        Self { time, ..self }
    }

    /// The point at `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }

    /// Whether `t` lies in the range; false for a NaN.
    pub fn contains(&self, t: f64) -> bool {
        self.t_min <= t && t <= self.t_max
    }

    /// The ray in object space. The direction is not renormalised, so `t` is preserved.
    #[must_use]
    #[inline]
    pub fn into_object(&self, world_from_object: &Transform) -> Self {
        Self {
            origin: world_from_object.inverse_point(self.origin),
            direction: world_from_object.inverse_vector(self.direction),
            ..*self
        }
    }
}
