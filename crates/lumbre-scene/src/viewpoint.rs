//! The requested view of a picture; framing chooses the rest.

use lumbre_math::{DVec2, DVec3, Elementary};

use crate::{Camera, CameraKind};

/// The requested view of a camera. The rest is chosen so that everything is in the picture: see [`crate::Stage`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Viewpoint {
    /// Degrees by which the camera moves to the right, around the up axis through its target.
    pub azimuth: f64,
    /// Degrees by which it rises, at most to straight above and at least to straight below.
    pub elevation: f64,
    /// The magnification of everything in the picture, by a longer lens from the same position; above 0.
    pub zoom: f64,
    /// Full field of view in degrees along the shorter side of the picture, above 0 and below 180.
    pub fov: Option<f64>,
    /// Whether the projection is orthographic.
    pub orthographic: bool,
    /// The camera's position, before it moves by `azimuth` and `elevation`.
    pub eye: Option<DVec3>,
    /// The point in the middle of the picture.
    pub target: Option<DVec3>,
}

impl Default for Viewpoint {
    fn default() -> Self {
        Self {
            azimuth: 0.0,
            elevation: 0.0,
            zoom: 1.0,
            fov: None,
            orthographic: false,
            eye: None,
            target: None,
        }
    }
}

impl Viewpoint {
    /// Whether it replaces a file's camera. `zoom` and `fov` only change its lens.
    pub fn replaces_cameras(&self) -> bool {
        self.azimuth != 0.0
            || self.elevation != 0.0
            || self.orthographic
            || self.eye.is_some()
            || self.target.is_some()
    }

    /// Whether it changes the lens of a camera that is kept.
    pub fn changes_lens(&self) -> bool {
        self.zoom != 1.0 || self.fov.is_some()
    }

    /// Changes the lens of a camera for a picture of this aspect ratio; a spherical camera has none, and a real lens
    /// stays unchanged.
    pub(crate) fn set_lens(&self, camera: &mut Camera, aspect: f64) {
        if let (CameraKind::Perspective { fov, .. }, Some(asked)) = (&mut camera.kind, self.fov) {
            *fov = asked;
        }
        self.magnify(camera, aspect);
    }

    /// Magnifies everything by `zoom`, about the middle of the picture.
    pub(crate) fn magnify(&self, camera: &mut Camera, aspect: f64) {
        if self.zoom == 1.0 {
            return;
        }
        let aspect = camera.frame_aspect.unwrap_or(aspect);
        match (&mut camera.kind, camera.screen_window) {
            (CameraKind::Spherical { .. } | CameraKind::Realistic(_) | CameraKind::Mesh(_), _) => {}
            (CameraKind::Perspective { fov, .. }, None) => {
                *fov = 2.0 * ((0.5 * fov.to_radians()).tangent() / self.zoom).arc_tangent().to_degrees();
            }
            (_, window) => {
                let half = half_window(aspect);
                let [x0, x1, y0, y1] = window.unwrap_or([-half.x, half.x, -half.y, half.y]);
                let (middle, half) = (0.5 * DVec2::new(x0 + x1, y0 + y1), 0.5 * DVec2::new(x1 - x0, y1 - y0));
                let (low, high) = (middle - half / self.zoom, middle + half / self.zoom);
                camera.screen_window = Some([low.x, high.x, low.y, high.y]);
            }
        }
    }
}

/// Half the width and height of the window for a picture of this aspect ratio, whose shorter side is from -1 to 1.
pub(crate) fn half_window(aspect: f64) -> DVec2 {
    if aspect > 1.0 { DVec2::new(aspect, 1.0) } else { DVec2::new(1.0, 1.0 / aspect) }
}

#[cfg(test)]
mod tests {
    use lumbre_math::Transform;

    use super::*;
    use crate::View;

    fn camera(kind: CameraKind) -> Camera {
        Camera::new(kind, Transform::translate(DVec3::new(7.0, -2.0, 3.0)))
    }

    #[test]
    fn a_zoom_of_two_shows_half_as_much_about_the_middle() {
        let perspective = CameraKind::Perspective { fov: 70.0, lens_radius: 0.0, focal_distance: 1.0 };
        let orthographic = CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 };
        for kind in [perspective, orthographic] {
            for screen_window in [None, Some([-1.0, 5.0, -3.0, 1.0])] {
                let before = Camera { screen_window, ..camera(kind.clone()) };
                let mut after = before.clone();
                Viewpoint { zoom: 2.0, ..Viewpoint::default() }.set_lens(&mut after, 1.5);
                let seen = |camera: &Camera, x, y| {
                    let ray =
                        View::new(camera, 90, 60).ray(DVec2::new(x, y), DVec2::splat(0.5), 0.0, 1.0).ray;
                    ray.at(4.0 / ray.direction.z)
                };
                // A quarter of the picture from the middle is what was an eighth.
                for (x, y) in [(90.0, 60.0), (0.0, 0.0), (67.5, 45.0)] {
                    let nearer = seen(&before, 45.0 + 0.5 * (x - 45.0), 30.0 + 0.5 * (y - 30.0));
                    assert!((seen(&after, x, y) - nearer).length() < 1e-12, "{kind:?} {screen_window:?}");
                }
            }
        }
    }

    #[test]
    fn a_field_of_view_is_that_of_the_shorter_side() {
        let mut camera = camera(CameraKind::Perspective { fov: 70.0, lens_radius: 0.0, focal_distance: 1.0 });
        Viewpoint { fov: Some(90.0), ..Viewpoint::default() }.set_lens(&mut camera, 1.5);
        let view = View::new(&camera, 90, 60);
        let top = view.ray(DVec2::new(45.0, 0.0), DVec2::splat(0.5), 0.0, 1.0).ray.direction;
        assert!((top.y - top.z).abs() < 1e-12 && top.x.abs() < 1e-12, "{top}");
    }
}
