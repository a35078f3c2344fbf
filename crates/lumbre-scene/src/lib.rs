#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! # Motion
//!
//! A camera has a shutter. Where anything moves, a sample has a time, evenly distributed over the exposure, and every
//! ray of its path keeps it. Only what moves reads it: an instance (`Placement::Moving`) interpolates its transform at
//! the ray's time, and its box in the tree holds it at every time. A single shape that moves is put in an object of its
//! own. If it emits, `light/moving.rs` samples it where it is at that time. A mesh that changes its form
//! (`MeshDesc::motion`: skins and morph targets) is custom geometry, `DeformingMesh`, and is hit as the mesh that it is
//! at the ray's time, to the bit.
//!
//! # The stage
//!
//! [`Stage`] turns a description without a camera or light into one that has them: framing, studio light, ground. What
//! is behind the picture (`lumbre::Background`) is added after tone mapping, by the coverage that the film keeps.

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
mod freeing;
mod ground;
mod id;
mod interaction;
mod lens;
pub mod light;
mod light_colour;
mod listing;
mod media;
mod mesh;
mod mesh_camera;
mod object_order;
mod placed_bounds;
pub mod pov;
mod pov_hit;
mod scene;
mod seams;
mod sky;
mod solid;
mod specular;
mod stage;
mod studio;
mod surface;
mod tables;
mod viewpoint;

pub use camera::{Camera, CameraKind, CameraRay, ClipPlane, Pinhole, SphericalMapping, View, WideProjection};
pub use desc::*;
pub use emission::Emission;
pub use error::BuildError;
pub use footprint::Footprint;
pub use freeing::freeing;
pub use ground::GroundPlane;
pub use id::{LightId, MaterialId, MediumId, ObjectId};
pub use interaction::Interaction;
pub use lens::{ApertureImage, Lens, LensError, LensSurface};
pub use light::{Light, LightSample};
pub use listing::{AnimationListing, Listing, TextureListing};
pub use lumbre_kernel::Placement;
pub use media::Crossing;
pub use mesh_camera::{CameraFace, FaceChoice, MeshCamera};
pub use pov_hit::PovHit;
pub use scene::{BuildWarning, PovObstacle, Scene};
pub use sky::{ClearSky, SkyDesc, SkyError, SunPosition, SunPositionError, time_of};
pub use specular::BoundingSphere;
pub use stage::{Ground, Stage, StageLight, Staged, Surroundings};
pub use surface::TrianglePoint;
pub use tables::{SurfaceTable, TriangleSurface, UniformBsdf};
pub use viewpoint::Viewpoint;
