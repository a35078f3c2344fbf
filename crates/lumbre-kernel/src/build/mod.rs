//! From geometries to a tree, and what keeps it good when they move.
//!
//! [`input`] checks geometries and makes primitives of them, [`binary`] a binary tree, and [`collapse`] the tree of sixteen children that
//! rays traverse. [`refit`] and [`rebuild`] follow geometries that move.

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
