//! A ray with its parameter range.

use lumbre_math::{DVec3, Elementary, Transform};

/// The points `origin + t * direction` with `t_min <= t <= t_max`.
///
/// The direction need not be unit, and `t` is in units of its length, which may be any number: a crossing is found
/// wherever its `t` is one too. A NaN anywhere, or a direction of zero, makes every query a miss.
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

    /// Whether products of the direction with itself and with ordinary lengths neither overflow nor vanish.
    #[inline]
    pub(crate) fn has_ordinary_direction(&self) -> bool {
        let squared = self.direction.length_squared();
        1e-80 < squared && squared < 1e80
    }

    /// The same ray with a direction of about unit length, and the power of two that takes its `t` to the given ray's,
    /// in two factors that are numbers; `None` for a direction that is none.
    pub(crate) fn with_direction_scaled(&self) -> Option<(Self, [f64; 2])> {
        let largest = self.direction.abs().max_element();
        if !self.direction.is_finite() || largest == 0.0 {
            return None;
        }
        let exponent = largest.logarithm_2().floor() as i32;
        let half = exponent / 2;
        let [one, other] = [half, exponent - half].map(|e| 2f64.powi(e));
        let scaled = Self {
            direction: self.direction / one / other,
            t_min: self.t_min * one * other,
            t_max: self.t_max * one * other,
            ..*self
        };
        Some((scaled, [one, other]))
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
