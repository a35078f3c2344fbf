//! The tree as data: nodes, leaves, and what is known of them.

pub(crate) mod bounding_block;
pub(crate) mod node;
pub(crate) mod sphere_block;
pub(crate) mod storage;
pub(crate) mod summary;
pub(crate) mod triangle_block;
