//! The tree as data: nodes, leaves, and what is known of them.

pub(crate) mod bounding_block;
pub(crate) mod node;
pub(crate) mod packed;
pub(crate) mod sphere_block;
pub(crate) mod storage;
pub(crate) mod summary;
pub(crate) mod triangle_block;

/// Triangles, spheres or shapes that a leaf packs side by side.
pub(crate) const BLOCK: usize = 8;

/// Geometry and primitive.
pub(crate) type Name = [u32; 2];

/// Corners of triangles side by side, `[axis][corner][lane]`; those of lanes without a triangle mean nothing.
pub(crate) type Corners = [[[f32; BLOCK]; 3]; 3];
