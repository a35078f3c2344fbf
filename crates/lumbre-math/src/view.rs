//! Look-at frames of either handedness, and the rays of a camera.

use glam::{DVec2, DVec3};

use crate::frame::Frame;
use crate::transform::{Transform, sin_cos_degrees};

/// The handedness of camera axes: x right, y up, and z towards the viewer or away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handedness {
    /// z points at the observer; the camera looks along -z. As in OpenGL and glTF.
    Right,
    /// z points away; the camera looks along +z. As in RenderMan, POV-Ray and pbrt.
    ///
    /// With the same eye, target and up, its picture is the mirror image of the right-handed one.
    Left,
}

/// A viewpoint with a camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The position of the camera.
    pub eye: DVec3,
    /// x to the right of the picture, y up, z according to the handedness.
    pub frame: Frame,
    /// The direction of z.
    pub handedness: Handedness,
}

impl View {
    /// The view from `eye` to `target` with `up` as upright as possible. `None` when the eye is at the target,
    /// when `up` is parallel to the view, or when something is not finite.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, handedness: Handedness) -> Option<Self> {
        let z = match handedness {
            Handedness::Right => eye - target,
            Handedness::Left => target - eye,
        };
        let frame = Frame::from_two(z, up)?;
        eye.is_finite().then_some(Self { eye, frame, handedness })
    }

    /// The unit direction of view.
    pub fn forward(&self) -> DVec3 {
        match self.handedness {
            Handedness::Right => -self.frame.z,
            Handedness::Left => self.frame.z,
        }
    }

    /// The map from world to camera coordinates: translates the eye to the origin, then rotates.
    pub fn camera_from_world(&self) -> Transform {
        Transform::from_frame(self.eye, &self.frame).inverse()
    }

    /// The direction from the eye through a point of the picture, with depth 1: the parameter of the ray is the
    /// distance along the view.
    ///
    /// `fovy` is the full vertical field of view in degrees; `film` is in pixels from the upper left corner,
    /// the centre of pixel (0, 0) at (½, ½).
    pub fn perspective_direction(&self, fovy: f64, size: DVec2, film: DVec2) -> DVec3 {
        let (sin, cos) = sin_cos_degrees(0.5 * fovy);
        let slope = (sin / cos) * DVec2::new(size.x / size.y, 1.0) * centred(size, film);
        self.forward() + slope.x * self.frame.x + slope.y * self.frame.y
    }

    /// The direction from the eye through a point of a cylindrical picture, unrolled: across the picture the
    /// view turns evenly by `degrees` to the right; upwards, the slope grows so that pixels are square.
    pub fn cylindrical_direction(&self, degrees: f64, size: DVec2, film: DVec2) -> DVec3 {
        let place = centred(size, film);
        let (sin, cos) = sin_cos_degrees(0.5 * degrees * place.x);
        let height = 0.5 * degrees.to_radians() * (size.y / size.x) * place.y;
        cos * self.forward() + sin * self.frame.x + height * self.frame.y
    }

    /// The origin of the ray, parallel to [`View::forward`], through a point of the picture in orthographic
    /// projection. `half` is half the width and height of the picture in the world; `size` and `film` are in
    /// pixels.
    pub fn orthographic_origin(&self, half: DVec2, size: DVec2, film: DVec2) -> DVec3 {
        let place = half * centred(size, film);
        self.eye + place.x * self.frame.x + place.y * self.frame.y
    }
}

/// Pixels from the upper left to [-1, 1]², y up.
fn centred(size: DVec2, film: DVec2) -> DVec2 {
    DVec2::new(2.0 * film.x / size.x - 1.0, 1.0 - 2.0 * film.y / size.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::projection::{orthographic, perspective, project};
    use crate::vector;

    fn views() -> impl Iterator<Item = View> {
        [Handedness::Right, Handedness::Left].into_iter().filter_map(|hand| {
            View::look_at(
                DVec3::new(2.0, -3.0, 5.0),
                DVec3::new(-4.0, 1.0, 2.5),
                DVec3::new(0.2, 0.1, 3.0),
                hand,
            )
        })
    }

    #[test]
    fn the_eye_goes_to_the_origin_and_the_target_straight_ahead() {
        let mut count = 0;
        for view in views() {
            let camera = view.camera_from_world();
            assert!(camera.point(view.eye).length() < 1e-15);
            let ahead = camera.vector(view.forward());
            let expected = if view.handedness == Handedness::Right { -1.0 } else { 1.0 };
            assert!((ahead - DVec3::Z * expected).length() < 1e-15);
            assert!(camera.vector(DVec3::Z).y > 0.0 && camera.vector(DVec3::Z).x.abs() < 0.2);
            assert!((camera.determinant() - 1.0).abs() < 1e-15);
            count += 1;
        }
        assert_eq!(count, 2);
        let eye = DVec3::new(1.0, 2.0, 3.0);
        assert!(View::look_at(eye, eye, DVec3::Y, Handedness::Left).is_none());
        assert!(View::look_at(eye, eye + DVec3::Y, DVec3::Y, Handedness::Right).is_none());
        assert!(View::look_at(eye, DVec3::NAN, DVec3::Y, Handedness::Right).is_none());
    }

    #[test]
    fn a_cylinder_is_unrolled_evenly() {
        let mut count = 0;
        for view in views() {
            let (size, degrees) = (DVec2::new(360.0, 90.0), 240.0);
            let at = |x, y| view.cylindrical_direction(degrees, size, DVec2::new(x, y));
            assert!((at(180.0, 45.0) - view.forward()).length() < 1e-15);
            assert!(at(190.0, 45.0).dot(view.frame.x) > 0.0 && at(180.0, 40.0).dot(view.frame.y) > 0.0);
            let step = vector::angle(at(0.0, 45.0), at(1.0, 45.0));
            assert!((step - vector::angle(at(200.0, 45.0), at(201.0, 45.0))).abs() < 1e-15);
            assert!((step - (degrees / size.x).to_radians()).abs() < 1e-15);
            // Square pixels where the cylinder touches the horizon.
            assert!(((at(180.0, 44.0) - at(180.0, 45.0)).length() - step).abs() < 1e-15);
            count += 1;
        }
        assert_eq!(count, 2);
    }

    #[test]
    fn rays_project_back_to_the_pixel_they_were_made_for() {
        let (size, fovy) = (DVec2::new(60.0, 45.0), 40.0);
        let lens = perspective(fovy, size.x / size.y, 0.25, 90.0).unwrap();
        let half = DVec2::new(4.0, 3.0);
        let flat = orthographic(-half.x, half.x, -half.y, half.y, 0.0, 50.0).unwrap();
        let mut count = 0;
        for view in views() {
            // The matrices are those of a camera that looks along -z.
            let to_right = if view.handedness == Handedness::Right { 1.0 } else { -1.0 };
            let camera = view.camera_from_world();
            let pixel_of =
                |image: DVec3| 0.5 * (DVec2::ONE + image.truncate() * DVec2::new(1.0, -1.0)) * size;
            for film in [DVec2::new(0.5, 0.5), DVec2::new(59.5, 0.5), DVec2::new(13.25, 40.0)] {
                let turn = |p: DVec3| DVec3::new(p.x, p.y, p.z * to_right);
                let p = view.eye + 7.5 * view.perspective_direction(fovy, size, film);
                assert!((camera.point(p).z.abs() - 7.5).abs() < 1e-14);
                assert!((pixel_of(project(&lens, turn(camera.point(p))).unwrap()) - film).length() < 1e-12);
                let p = view.orthographic_origin(half, size, film) + 7.5 * view.forward();
                assert!((pixel_of(project(&flat, turn(camera.point(p))).unwrap()) - film).length() < 1e-12);
                count += 1;
            }
        }
        assert_eq!(count, 6);
    }
}
