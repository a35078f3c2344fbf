//! A ray, and the range of it that counts.

use lumbre_math::{DVec3, Transform};

/// The points `origin + t * direction` with `t_min <= t <= t_max`.
///
/// The direction need not be unit, and `t` is in units of its length; its length may be anything whose square is a number,
/// from about 1e-150 to 1e150. A NaN anywhere, or a direction of zero, makes every query a miss.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Where `t` is 0.
    pub origin: DVec3,
    /// Where `t` grows to; any length but zero.
    pub direction: DVec3,
    /// The smallest `t` that counts, itself included.
    pub t_min: f64,
    /// The largest `t` that counts, itself included; may be infinite.
    pub t_max: f64,
    /// When it looks, in the unit of the keys of what moves; of no consequence to what stands still.
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

    /// Whether `t` lies in the range; a NaN does not.
    pub fn contains(&self, t: f64) -> bool {
        self.t_min <= t && t <= self.t_max
    }

    /// The same ray in the object's space. Every `t` keeps its meaning, because the direction is not renormalised.
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
