//! Projection matrices: orthographic and perspective.
//!
//! They act on homogeneous coordinates in the space of a right-handed camera that looks along -z; see
//! [`project`]. They give where a point of the scene appears in the picture; rays are made by
//! [`View`](crate::view::View).

use glam::{DMat4, DVec3, DVec4};

use crate::matrix::{homogeneous_point, point_of_homogeneous, rows4};
use crate::transform::sin_cos_degrees;

/// The box `[left, right] × [bottom, top] × [-far, -near]` to the cube [-1, 1]³: `near` and `far` are distances
/// along -z, and -z becomes +z. `left > right` and so on mirror. `None` when two sides coincide.
pub fn orthographic(left: f64, right: f64, bottom: f64, top: f64, near: f64, far: f64) -> Option<DMat4> {
    let (width, height, depth) = (right - left, top - bottom, far - near);
    let matrix = rows4([
        2.0 / width,
        0.0,
        0.0,
        -(right + left) / width,
        0.0,
        2.0 / height,
        0.0,
        -(top + bottom) / height,
        0.0,
        0.0,
        -2.0 / depth,
        -(far + near) / depth,
        0.0,
        0.0,
        0.0,
        1.0,
    ]);
    matrix.is_finite().then_some(matrix)
}

/// The pyramid with full vertical field of view `fovy` in degrees, `aspect` = width over height, between the
/// distances `near` and `far`, to the cube [-1, 1]³: after division by w = -z, z = -near maps to -1 and z =
/// -far to 1.
///
/// `None` unless 0 < near < far, 0 < fovy < 180 and 0 < aspect, all finite.
pub fn perspective(fovy: f64, aspect: f64, near: f64, far: f64) -> Option<DMat4> {
    let ordered = 0.0 < near && near < far && 0.0 < fovy && fovy < 180.0 && 0.0 < aspect;
    let (sin, cos) = sin_cos_degrees(0.5 * fovy);
    let k = cos / sin;
    let depth = near - far;
    let matrix = rows4([
        k / aspect,
        0.0,
        0.0,
        0.0,
        0.0,
        k,
        0.0,
        0.0,
        0.0,
        0.0,
        (far + near) / depth,
        2.0 * far * near / depth,
        0.0,
        0.0,
        -1.0,
        0.0,
    ]);
    (ordered && matrix.is_finite()).then_some(matrix)
}

/// Central projection on the plane z = -d as seen from the origin: `(-d x / z, -d y / z, -d)`. The matrix is singular;
/// the depth is lost. `None` when `d` is zero or not finite.
pub fn simple_perspective(d: f64) -> Option<DMat4> {
    let matrix = rows4([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0 / d, 0.0]);
    (d.is_finite() && matrix.is_finite()).then_some(matrix)
}

/// The homogeneous image of a point, before the division by w.
pub fn clip_coordinates(projection: &DMat4, p: DVec3) -> DVec4 {
    *projection * homogeneous_point(p)
}

/// The image of a point, after the division by w; `None` when w = 0, as in the plane of a pinhole.
pub fn project(projection: &DMat4, p: DVec3) -> Option<DVec3> {
    point_of_homogeneous(clip_coordinates(projection, p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_the_box_go_to_corners_of_the_cube() {
        let matrix = orthographic(-3.0, 5.0, 2.0, 4.0, 0.5, 20.0).unwrap();
        let low = project(&matrix, DVec3::new(-3.0, 2.0, -0.5)).unwrap();
        let high = project(&matrix, DVec3::new(5.0, 4.0, -20.0)).unwrap();
        assert!((low - DVec3::splat(-1.0)).length() < 1e-15 && (high - DVec3::ONE).length() < 1e-15);
    }

    #[test]
    fn corners_of_the_pyramid_go_to_corners_of_the_cube() {
        let (fovy, aspect, near, far) = (50.0_f64, 1.75, 0.5, 40.0);
        let matrix = perspective(fovy, aspect, near, far).unwrap();
        let half = (0.5 * fovy).to_radians().tan();
        for (distance, depth) in [(near, -1.0), (far, 1.0)] {
            let corner = DVec3::new(half * aspect * distance, -half * distance, -distance);
            let image = project(&matrix, corner).unwrap();
            assert!((image - DVec3::new(1.0, -1.0, depth)).length() < 1e-14, "{image}");
        }
        assert_eq!(project(&matrix, DVec3::new(1.0, 2.0, 0.0)), None);
        // Parallel lines meet at their vanishing point.
        let along = DVec3::new(0.3, 0.1, -1.0);
        let [a, b] = [DVec3::new(2.0, 1.0, -3.0), DVec3::new(-4.0, 2.0, -1.0)];
        let [a, b] = [a, b].map(|start| project(&matrix, start + along * 1e12).unwrap().truncate());
        assert!((a - b).length() < 1e-10);
    }

    #[test]
    fn impossible_projections_are_none() {
        assert!(orthographic(1.0, 1.0, 0.0, 2.0, 0.0, 1.0).is_none());
        assert!(orthographic(0.0, 1.0, 0.0, 2.0, 3.0, 3.0).is_none());
        assert!(perspective(0.0, 1.0, 1.0, 2.0).is_none());
        assert!(perspective(180.0, 1.0, 1.0, 2.0).is_none());
        assert!(perspective(60.0, 1.0, 0.0, 2.0).is_none());
        assert!(perspective(60.0, 1.0, 2.0, 1.0).is_none());
        assert!(perspective(60.0, f64::NAN, 1.0, 2.0).is_none());
        assert!(simple_perspective(0.0).is_none() && simple_perspective(f64::INFINITY).is_none());
    }
}
