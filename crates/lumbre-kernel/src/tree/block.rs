//! Blocks of eight: the packed primitives of a leaf.

/// Primitives per block.
pub(crate) const BLOCK: usize = 8;

/// A primitive id: the index of a geometry, and of a primitive in it.
pub(crate) type PrimitiveId = [u32; 2];

/// Corners of eight triangles, `[axis][corner][lane]`; lanes without a triangle are undefined.
pub(crate) type Corners = [[[f32; BLOCK]; 3]; 3];
