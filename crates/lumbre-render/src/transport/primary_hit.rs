//! A camera ray and its first hit.

use lumbre_scene::{CameraRay, Interaction};

/// A camera ray and its first hit.
#[derive(Clone, Debug)]
pub struct PrimaryHit<'s> {
    /// The ray.
    pub ray: CameraRay,
    /// The first hit; `None` if the ray leaves the scene.
    pub met: Option<Interaction<'s>>,
}
