#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]

mod append;
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
mod listing;
mod media;
mod mesh;
mod scene;
mod solid;
mod specular;
mod stage;
mod studio;
mod surface;
mod tables;
mod viewpoint;

pub use camera::{Camera, CameraKind, CameraRay, SphericalMapping, View};
pub use desc::*;
pub use emission::Emission;
pub use error::BuildError;
pub use footprint::Footprint;
pub use ground::GroundPlane;
pub use id::{MaterialId, MediumId, ObjectId};
pub use interaction::Interaction;
pub use light::{Light, LightId, LightSample};
pub use listing::{AnimationListing, Listing, TextureListing};
pub use lumbre_kernel::Placement;
pub use media::Crossing;
pub use scene::{BuildWarning, Scene};
pub use specular::BoundingSphere;
pub use stage::{Ground, Stage, StageLight, Staged, Surroundings};
pub use surface::TrianglePoint;
pub use tables::{SurfaceTable, TriangleSurface, UniformBsdf};
pub use viewpoint::Viewpoint;
