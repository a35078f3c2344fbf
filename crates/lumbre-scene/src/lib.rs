#![doc = include_str!("../README.md")]

mod build;
mod camera;
mod csg;
mod custom;
mod desc;
mod emission;
mod error;
mod extent;
mod footprint;
mod framing;
mod ground;
mod id;
mod interaction;
pub mod light;
mod mesh;
mod scene;
mod solid;
mod stage;
mod studio;
mod surface;

pub use camera::{Camera, CameraKind, CameraRay, SphericalMapping, View};
pub use desc::*;
pub use emission::Emission;
pub use error::BuildError;
pub use footprint::Footprint;
pub use ground::GroundPlane;
pub use id::{MaterialId, ObjectId};
pub use interaction::{Interaction, offset};
pub use light::{Light, LightId, LightSample};
pub use lumbre_kernel::Placement;
pub use scene::{BuildWarning, Scene};
pub use stage::{Ground, Stage, StageLight, Staged, Surroundings};
