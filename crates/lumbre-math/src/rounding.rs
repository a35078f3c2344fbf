//! Bounds on rounding errors, and ray origins offset by them.

use glam::DVec3;

/// The unit roundoff u of double precision, 2⁻⁵³: each operation is exact up to a factor of 1 ± u.
pub const UNIT_ROUNDOFF: f64 = 0.5 * f64::EPSILON;

/// The unit roundoff of single precision, 2⁻²⁴.
pub const UNIT_ROUNDOFF_F32: f32 = 0.5 * f32::EPSILON;

/// `γₙ = n u / (1 - n u)`: a product of `n` factors 1 ± u, or of their reciprocals, lies within 1 ± γₙ.
///
/// Source: Higham, "Accuracy and Stability of Numerical Algorithms", SIAM, 2002, section 3.1.
pub const fn gamma(n: u32) -> f64 {
    let nu = n as f64 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// [`gamma`] for single precision.
pub const fn gamma_f32(n: u32) -> f32 {
    let nu = n as f32 * UNIT_ROUNDOFF_F32;
    nu / (1.0 - nu)
}

/// The number `steps` representable numbers above `x`; it stops at infinity.
pub fn next_up_by(x: f64, steps: u32) -> f64 {
    (0..steps).fold(x, |x, _| x.next_up())
}

/// The number `steps` representable numbers below `x`; it stops at minus infinity.
pub fn next_down_by(x: f64, steps: u32) -> f64 {
    (0..steps).fold(x, |x, _| x.next_down())
}

/// The origin of a ray that leaves a surface at `point` towards `direction`: offset along the unit normal to the side
/// of `direction`, beyond any place where the true surface can be, so that the ray does not meet the surface that it
/// leaves.
///
/// `error` bounds, axis by axis, the distance of `point` from the surface. A `direction` perpendicular to the normal
/// counts as on the side of the normal.
///
/// Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th edition, 2023, 6.8.6. There, intersection tests reject a
/// `t` within its own error; here the offset is larger instead, by the error of the coordinate with the largest error,
/// which rounds into `t`. Otherwise a face in the plane z = 0, whose error along z is 0, would be met again. At the
/// origin, where all errors may be 0, the offset is so large that no map makes it 0.
#[inline]
pub fn offset_point(point: DVec3, error: DVec3, normal: DVec3, direction: DVec3) -> DVec3 {
    const LEAST: f64 = 1e-250;
    let distance = (normal.abs().dot(error) + 4.0 * error.max_element()).max(LEAST);
    let along = if normal.dot(direction) < 0.0 { -normal } else { normal };
    let moved = point + distance * along;
    // The sum was rounded to nearest, perhaps towards the surface.
    let away = |moved: f64, along: f64| {
        if along > 0.0 {
            moved.next_up()
        } else if along < 0.0 {
            moved.next_down()
        } else {
            moved
        }
    };
    DVec3::new(away(moved.x, along.x), away(moved.y, along.y), away(moved.z, along.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    #[test]
    fn gamma_bounds_a_chain_of_roundings() {
        assert!(gamma(3) > 3.0 * UNIT_ROUNDOFF && gamma(3) < 3.000_001 * UNIT_ROUNDOFF);
        assert!(gamma_f32(5) > 5.0 * UNIT_ROUNDOFF_F32 && gamma_f32(5) < 5.000_1 * UNIT_ROUNDOFF_F32);
        let mut random = RandomStream::new(2);
        for _ in 0..1_000 {
            let factors: [f32; 8] = std::array::from_fn(|_| 0.5 + random.next_f32());
            // Seven rounded products of eight numbers; double precision stands for the truth.
            let rounded: f32 = factors.iter().product();
            let exact: f64 = factors.iter().map(|&x| f64::from(x)).product();
            assert!((f64::from(rounded) - exact).abs() <= f64::from(gamma_f32(7)) * exact * 1.000_001);
        }
    }

    #[test]
    fn steps_up_and_down_are_inverse() {
        for x in [-2.5, -1e-310, 3.0, 1e300] {
            assert_eq!(next_down_by(next_up_by(x, 5), 5), x);
            assert!(next_up_by(x, 3) > next_up_by(x, 2));
        }
        assert_eq!(next_up_by(f64::MAX, 9), f64::INFINITY);
    }

    #[test]
    fn offset_points_clear_the_error_box() {
        let mut random = RandomStream::new(6);
        let mut number = || 2.0 * random.next_f64() - 1.0;
        for k in 0..3_000 {
            let size = f64::powi(10.0, k % 13 - 6);
            let normal = DVec3::new(number(), number(), number()).normalize();
            let point = DVec3::new(number(), number(), number()) * size;
            let error = DVec3::new(number(), number(), number()).abs() * size * 1e-15;
            let direction = DVec3::new(number(), number(), number());
            let start = offset_point(point, error, normal, direction);
            let side = direction.dot(normal).signum();
            for corner in 0..8 {
                let sign = |bit: i32| if corner >> bit & 1 == 0 { 1.0 } else { -1.0 };
                let surface = point + error * DVec3::new(sign(0), sign(1), sign(2));
                // The corners that matter differ from `start` by few units in the last place: the difference is exact.
                assert!((start - surface).dot(normal) * side > -1e-17 * size, "{k} {corner}");
            }
            assert!((start - point).length() < 7e-15 * size);
        }
    }

    #[test]
    fn without_error_the_step_is_the_least() {
        let p = DVec3::new(3.0, -4.0, 5.0);
        let least = DVec3::new(p.x, p.y.next_up(), p.z);
        assert_eq!(offset_point(p, DVec3::ZERO, DVec3::Y, DVec3::X), least);
        assert_eq!(offset_point(DVec3::ZERO, DVec3::ZERO, DVec3::Y, DVec3::X).y, 1e-250_f64.next_up());
        assert!(offset_point(p, DVec3::splat(1e-12), DVec3::Y, DVec3::NEG_Y).y < -4.0);
    }
}
