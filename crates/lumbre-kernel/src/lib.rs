#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
#![allow(unreachable_pub, unsafe_op_in_unsafe_fn, missing_debug_implementations)]
#![allow(clippy::unwrap_used, clippy::too_many_arguments)]

mod accel;
mod batch;
mod build;
mod columns;
mod curves;
mod deforming_mesh;
mod hit;
mod implicit;
mod intersect;
mod io;
mod listing;
mod point;
mod query;
mod ray32;
mod simd;
mod surface;
mod trace;
mod tree;

pub use accel::Accel;
pub use build::error::BuildError;
pub use build::options::{BuildOptions, Preset};
pub use build::refit::RefitError;
pub use columns::{HitColumns, RayColumns};
pub use deforming_mesh::DeformingMesh;
pub use hit::{Hit, InstancePath, Target, TargetShape};
pub use io::bytes::LoadError;
pub use io::mapped::MapError;
pub use point::closest_point::{ClosestPoint, ClosestPointError};
pub use point::winding::WindingNumberError;
pub use query::{Faces, Query};
pub use ray32::{Hit32, Ray32};
pub use tree::geometry::{CustomGeometry, Placement, SphereCloud, TriangleMesh};
pub use tree::picture_start::PictureRounding;
pub use tree::precise_mesh::PreciseMesh;
pub use tree::{Geometry, GeometryKind, Instance};

#[cfg(test)]
mod brute;
#[cfg(test)]
mod tests;
