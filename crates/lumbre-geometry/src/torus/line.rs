//! A ray's line in the frame of the torus, clipped to its bounds.

use lumbre_math::DVec3;

use super::Torus;
use crate::Ray;
use crate::twofold::point;

/// A ray's line in the torus's frame: the points `p + s u` with a unit `u` perpendicular to `p`, at t = start + (shift
/// + s) / speed.
pub(crate) struct Line {
    pub(crate) p: DVec3,
    pub(crate) u: DVec3,
    pub(crate) start: f64,
    pub(crate) shift: f64,
    pub(crate) speed: f64,
    // All crossings lie strictly between these, and both ends are outside.
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Line {
    pub(crate) fn t(&self, s: f64) -> f64 {
        self.start + (self.shift + s) / self.speed
    }
}

/// A ray's line at its point nearest to the centre.
pub(crate) struct Nearest {
    /// The point relative to the centre, but for the rounding of `start`; `shift` is what remains.
    near: DVec3,
    unit: DVec3,
    pub(crate) start: f64,
    pub(crate) shift: f64,
    pub(crate) speed: f64,
    /// Whether it is within the sphere about the torus.
    pub(crate) is_within: bool,
}

/// The relative margin of the bounds: the ends of the clipped line are outside in spite of rounding.
const MARGIN: f64 = 1e-9;

impl Torus {
    /// The line, with s = 0 at the point nearest to the centre: there the quartic has no cubic term, and its
    /// coefficients do not depend on the distance of the ray's origin. `None` when the line misses the bounds.
    #[inline]
    pub(crate) fn line(&self, ray: &Ray) -> Option<Line> {
        let nearest = self.nearest(ray);
        if !nearest.is_within {
            return None;
        }
        let (p, u) = self.turned(&nearest);
        let (low, high) = self.span(p, u, self.reach())?;
        let Nearest { start, shift, speed, .. } = nearest;
        let line = Line { p, u, start, shift, speed, low, high };
        let overlaps = line.t(high) >= ray.t_min && line.t(low) <= ray.t_max;
        overlaps.then_some(line)
    }

    /// The radius of the sphere about it, with a margin.
    #[inline(always)]
    pub(crate) fn reach(&self) -> f64 {
        (self.major + self.minor) * (1.0 + MARGIN)
    }

    #[inline(always)]
    pub(crate) fn nearest(&self, ray: &Ray) -> Nearest {
        let (w, d) = (ray.origin - self.center, ray.direction);
        let dd = d.length_squared();
        let speed = dd.sqrt();
        let unit = d / speed;
        let start = -w.dot(d) / dd;
        let reach = self.reach();
        // From far away the rounding of the way would move the line.
        let is_far = w.length_squared() > 64.0 * reach * reach;
        let near = if is_far { point(ray.origin, self.center, start, d) } else { w + start * d };
        // False for a direction of zero and for NaNs.
        let is_within = near.length_squared() <= reach * reach && dd.is_finite();
        Nearest { near, unit, start, shift: -near.dot(unit), speed, is_within }
    }

    /// The line's nearest point and its unit direction, in the torus's frame.
    #[inline(always)]
    pub(crate) fn turned(&self, nearest: &Nearest) -> (DVec3, DVec3) {
        (self.framed(nearest.near + nearest.shift * nearest.unit), self.framed(nearest.unit))
    }

    /// The part of the line inside the flat cylinder around the torus; `None` when it is empty, or only in the
    /// hole.
    #[inline]
    pub(crate) fn span(&self, p: DVec3, u: DVec3, reach: f64) -> Option<(f64, f64)> {
        let flat = self.minor * (1.0 + MARGIN) + 16.0 * f64::EPSILON * reach;
        let (mut low, mut high) = (-2.0 * reach, 2.0 * reach);
        if u.z == 0.0 {
            if p.z.abs() > flat {
                return None;
            }
        } else {
            let inverse = 1.0 / u.z;
            let (middle, half) = (-p.z * inverse, flat * inverse.abs());
            (low, high) = (low.max(middle - half), high.min(middle + half));
        }
        let a = u.x * u.x + u.y * u.y;
        let h = p.x * u.x + p.y * u.y;
        let c = p.x * p.x + p.y * p.y - reach * reach;
        let delta = h * h - a * c;
        if delta < 0.0 {
            return None;
        }
        if a > 1e-30 {
            let inverse = 1.0 / a;
            let (middle, half) = (-h * inverse, delta.sqrt() * inverse);
            (low, high) = (low.max(middle - half), high.min(middle + half));
        } else if c > 0.0 {
            return None;
        }
        if low > high {
            return None;
        }
        // The distance from the axis is convex along the line, so it is greatest at an end.
        let hole = (self.major - self.minor) * (1.0 - MARGIN);
        let rho_squared = |s: f64| (p.x + s * u.x).powi(2) + (p.y + s * u.y).powi(2);
        let in_hole = hole > 0.0 && rho_squared(low).max(rho_squared(high)) < hole * hole;
        (!in_hole).then_some((low, high))
    }
}
