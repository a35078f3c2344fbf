//! Blocks of eight: what a leaf packs side by side.

/// Triangles, spheres or shapes that a leaf packs side by side.
pub(crate) const BLOCK: usize = 8;

/// Geometry and primitive.
pub(crate) type Name = [u32; 2];

/// Corners of triangles side by side, `[axis][corner][lane]`; those of lanes without a triangle mean nothing.
pub(crate) type Corners = [[[f32; BLOCK]; 3]; 3];
