//! A ray from the camera, and what it meets first.

use lumbre_scene::{CameraRay, Interaction};

/// A ray from the camera, and what it meets first.
#[derive(Clone, Debug)]
pub struct PrimaryHit<'s> {
    /// The ray.
    pub ray: CameraRay,
    /// What it meets; `None` when it leaves the scene.
    pub met: Option<Interaction<'s>>,
}
