//! Moved cameras: the file's own camera under a rigid motion, so that its other properties stay.

use lumbre::description::{Camera, CameraKind, SphericalMapping};
use lumbre::math::DAffine3;
use lumbre::{DVec3, Transform};

use crate::message::Placement;

/// Larger coordinates make no picture.
const FARTHEST: f64 = 1e12;

impl Placement {
    /// The placement of a camera whose target is at this distance.
    pub(crate) fn of(camera: &Camera, distance: f64) -> Self {
        let place = camera.world_from_camera;
        let eye = place.point(DVec3::ZERO);
        let forward = match camera.kind {
            CameraKind::Spherical { mapping: SphericalMapping::Equirectangular } => -DVec3::X,
            _ => DVec3::Z,
        };
        let target = eye + place.vector(forward).normalize_or(DVec3::Z) * distance;
        let up = place.vector(DVec3::Y).normalize_or(DVec3::Y);
        Self { eye: eye.to_array(), target: target.to_array(), up: up.to_array() }
    }

    /// Its axes and origin; `None` without a direction.
    fn frame(&self) -> Option<DAffine3> {
        let [eye, target, up] = [self.eye, self.target, self.up].map(DVec3::from_array);
        if ![eye, target, up].iter().all(|v| v.is_finite() && v.length() < FARTHEST) {
            return None;
        }
        let forward = (target - eye).try_normalize()?;
        let right = up.try_normalize()?.cross(forward);
        // If up is along the view, right is undefined.
        let right = (right.length() > 1e-9).then(|| right.normalize())?;
        let upward = forward.cross(right);
        Some(DAffine3::from_cols(right, upward, forward, eye))
    }
}

/// A camera moved to a placement; `fov` is the full field of view in degrees of a perspective camera, `zoom` the
/// magnification of an orthographic one. `None` if the placement makes no camera.
pub(crate) fn moved(
    base: &Camera,
    from: &Placement,
    to: &Placement,
    fov: Option<f64>,
    zoom: f64,
) -> Option<Camera> {
    let motion = to.frame()? * from.frame()?.inverse();
    let mut place = Transform::from_affine(motion).ok()? * base.world_from_camera;
    let mut camera = base.clone();
    match &mut camera.kind {
        CameraKind::Perspective { fov: own, .. } => {
            *own = fov.filter(|fov| (0.001..=179.0).contains(fov)).unwrap_or(*own);
        }
        CameraKind::Orthographic { .. } if (1e-6..=1e6).contains(&zoom) => {
            place = place * Transform::scale(DVec3::new(1.0 / zoom, 1.0 / zoom, 1.0)).ok()?;
        }
        // Faces of meshes stay where they are.
        CameraKind::Mesh(_) => return None,
        CameraKind::Orthographic { .. } | CameraKind::Spherical { .. } | CameraKind::Realistic(_) => {}
    }
    camera.world_from_camera = place;
    camera.motion = None;
    Some(camera)
}

/// The field of view of a camera, if it has one.
pub(crate) fn field_of_view(camera: &Camera) -> Option<f64> {
    match camera.kind {
        CameraKind::Perspective { fov, .. } => Some(fov),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use lumbre::DVec2;
    use lumbre::description::CameraView;

    use super::*;

    fn ray(camera: &Camera, x: f64, y: f64) -> (DVec3, DVec3) {
        let ray = CameraView::new(camera, 90, 60).ray(DVec2::new(x, y), DVec2::splat(0.5), 0.0, 1.0).ray;
        (ray.origin, ray.direction)
    }

    #[test]
    fn a_moved_camera_sees_what_one_made_there_sees() {
        let (eye, target) = (DVec3::new(7.0, -2.0, 3.0), DVec3::new(1.0, 2.0, 0.5));
        let expected = Camera::perspective(eye, target, DVec3::Z, 35.0).unwrap();
        let base = Camera::perspective(DVec3::new(0.0, 9.0, 1.0), DVec3::new(3.0, 0.0, 1.0), DVec3::Z, 50.0)
            .unwrap();
        let to = Placement { eye: eye.to_array(), target: target.to_array(), up: DVec3::Z.to_array() };
        let found = moved(&base, &Placement::of(&base, 4.0), &to, Some(35.0), 1.0).unwrap();
        for (x, y) in [(3.0, 5.0), (45.0, 30.0), (80.0, 57.0)] {
            let ((o, d), (p, e)) = (ray(&found, x, y), ray(&expected, x, y));
            assert!((o - p).length() < 1e-9 && (d - e).length() < 1e-9, "{x} {y}: {d} {e}");
        }
        // A camera of a left-handed world stays one.
        let left =
            Camera::new(base.kind.clone(), Transform::look_at_left(eye, target, DVec3::Z).unwrap().inverse());
        let found = moved(&left, &Placement::of(&left, 2.0), &to, None, 1.0).unwrap();
        assert_eq!(found.world_from_camera.is_mirror(), left.world_from_camera.is_mirror());
        assert_ne!(found.world_from_camera.is_mirror(), base.world_from_camera.is_mirror());
    }

    #[test]
    fn what_makes_no_camera_is_refused() {
        let base = Camera::perspective(DVec3::new(0.0, 9.0, 1.0), DVec3::new(3.0, 0.0, 1.0), DVec3::Z, 50.0)
            .unwrap();
        let from = Placement::of(&base, 4.0);
        for (eye, target, up) in [
            ([1.0; 3], [1.0; 3], [0.0, 0.0, 1.0]),
            ([0.0; 3], [0.0, 0.0, 5.0], [0.0, 0.0, 1.0]),
            ([f64::NAN, 0.0, 0.0], [1.0; 3], [0.0, 0.0, 1.0]),
            ([1e300; 3], [1.0; 3], [0.0, 0.0, 1.0]),
            ([2.0; 3], [1.0; 3], [0.0; 3]),
        ] {
            assert!(moved(&base, &from, &Placement { eye, target, up }, None, 1.0).is_none(), "{eye:?}");
        }
    }
}
