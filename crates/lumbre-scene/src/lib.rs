//! What is there: first described ([`SceneDesc`], plain data that any reader can make), then resolved for rendering.

mod camera;
mod desc;
mod id;

pub use camera::{Camera, CameraKind, SphericalMapping};
pub use desc::*;
pub use id::{MaterialId, ObjectId};
