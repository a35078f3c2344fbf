//! Helpers of the shapes: bounds from support functions, azimuths, arcs, and error bounds.

use std::f64::consts::TAU;

use lumbre_math::rounding::gamma;
use lumbre_math::{DVec3, Elementary, Transform};

use crate::Aabb;

/// The bounding box of a set under a transform, from its support function h(d) = max d·x in object space.
///
/// `magnitude` bounds |x| of every point, component by component, and determines how far the box is rounded
/// outward: the error of h, which may cancel, is proportional to it.
pub(crate) fn bounds_from_support(
    world_from_object: &Transform,
    magnitude: DVec3,
    support: impl Fn(DVec3) -> f64,
) -> Aabb {
    let linear = world_from_object.linear();
    let offset = world_from_object.affine().translation;
    let side = |axis: usize| {
        let row = linear.row(axis);
        let slack = gamma(16) * (offset[axis].abs() + row.abs().dot(magnitude));
        let low = offset[axis] - support(-row) - slack;
        let high = offset[axis] + support(row) + slack;
        (low, high)
    };
    let [(x0, x1), (y0, y1), (z0, z1)] = [side(0), side(1), side(2)];
    Aabb { min: DVec3::new(x0, y0, z0), max: DVec3::new(x1, y1, z1) }.outward(2)
}

/// The greatest value of `a cos φ + b sin φ` for φ from `from` to `to`.
pub(crate) fn arc_support(a: f64, b: f64, from: f64, to: f64) -> f64 {
    if to - from >= TAU || (b.angle_from(a) - from).rem_euclid(TAU) <= to - from {
        return a.hypotenuse(b);
    }
    let at = |phi: f64| a * phi.cosine() + b * phi.sine();
    at(from).max(at(to))
}

/// The azimuth of (x, y), from 0 to 2π.
pub(crate) fn azimuth(y: f64, x: f64) -> f64 {
    let phi = y.angle_from(x);
    // A tiny negative angle plus 2π rounds to 2π; -0.0 is not less than 0.
    if phi < 0.0 { phi + TAU } else { phi }
}

/// The length, of vectors too whose square is no number or vanishes.
pub(crate) fn length(v: DVec3) -> f64 {
    let squared = v.length_squared();
    if has_digits(squared) {
        return squared.sqrt();
    }
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { largest * (v / largest).length() } else { largest }
}

/// The unit vector along `v`, whatever the length; `None` for zero and for what is not finite.
pub(crate) fn unit(v: DVec3) -> Option<DVec3> {
    let squared = v.length_squared();
    if has_digits(squared) {
        return Some(v * squared.sqrt().recip());
    }
    let largest = v.abs().max_element();
    // False for a NaN.
    let has_direction = largest > 0.0 && v.is_finite();
    has_direction.then(|| {
        let scaled = v / largest;
        scaled / scaled.length()
    })
}

/// The unit normal where a ray enters a solid, or leaves it: mirrored where rounding has put it on the wrong side of a
/// ray that almost touches.
pub(crate) fn on_side_of(normal: DVec3, direction: DVec3, enters: bool) -> DVec3 {
    let along = normal.dot(direction);
    if (enters && along < 0.0) || (!enters && along > 0.0) {
        return normal;
    }
    let Some(direction) = unit(direction) else {
        return normal;
    };
    let lean = normal.dot(direction).abs().max(4.0 * f64::EPSILON);
    let side = if enters { -lean } else { lean };
    unit(normal + (side - normal.dot(direction)) * direction).unwrap_or(side.signum() * direction)
}

/// Whether a sum of squares has neither overflowed nor lost digits by underflow.
fn has_digits(squared: f64) -> bool {
    (1e-280..1e280).contains(&squared)
}

/// The rounding error of `d·x`, in units of the relative error of one operation.
pub(crate) fn dot_size(d: DVec3, x: DVec3) -> f64 {
    d.abs().dot(x.abs())
}

/// The rounding error of the length of `a × b`, in units of the relative error of one operation.
pub(crate) fn cross_size(a: DVec3, b: DVec3) -> f64 {
    let (a, b) = (a.abs(), b.abs());
    DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x).length()
}
