#![doc = include_str!("../README.md")]

mod accel;
mod batch;
mod bins;
mod blocks;
mod boxes;
mod build;
mod clouds;
mod collapse;
mod deforming;
mod few;
mod file;
mod geometry;
mod hit;
mod holds;
mod hulls;
mod inside;
mod lanes;
mod morton;
mod nearest;
mod node;
mod occlusion;
mod opening;
mod outline;
mod parting;
mod precise;
mod prepare;
mod primitive;
mod query;
mod ray32;
mod rebuild;
mod refit;
mod reinsert;
mod save;
mod spheres;
mod store;
mod surface;
mod trace;
mod treelet;
mod triangles;
mod winding;

pub use accel::{Accel, BuildError, BuildOptions, Preset};
pub use deforming::DeformingMesh;
pub use file::MapError;
pub use geometry::{CustomGeometry, Geometry, GeometryKind, Instance, Placement, SphereCloud, TriangleMesh};
pub use hit::{Hit, InstancePath};
pub use nearest::{ClosestPoint, NoClosestPoint};
pub use query::{Faces, Query};
pub use precise::PreciseMesh;
pub use ray32::{Hit32, Ray32};
pub use refit::RefitError;
pub use save::LoadError;
pub use winding::NoWindingNumber;

#[cfg(test)]
mod brute;
#[cfg(test)]
mod tests;
