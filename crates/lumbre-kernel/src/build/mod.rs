//! Builds a tree from geometries, and keeps it good when they move.
//!
//! [`input`] checks geometries and splits them into primitives, [`binary`] builds a binary tree, and [`collapse`] turns
//! it into the sixteen-wide tree that rays traverse. [`refit`] and [`rebuild`] follow geometries that move.

pub(crate) mod binary;
mod binary_node;
mod binary_tree;
mod boxes;
mod clouds;
pub(crate) mod collapse;
pub(crate) mod error;
pub(crate) mod input;
mod morton;
pub(crate) mod occlusion_order;
pub(crate) mod open_instances;
pub(crate) mod options;
mod outline;
pub(crate) mod pack;
mod partition;
pub(crate) mod primitive;
pub(crate) mod rebuild;
pub(crate) mod refit;
mod reinsert;
mod sah;
mod small;
mod treelet;
