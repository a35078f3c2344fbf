//! Meshes with vertices in double precision.
//!
//! Their triangles have leaves of their own, one entry each, so that meshes in single precision pay nothing for them.
//! The test is the same (see `triangles`): it is in double precision after the load anyway. A corner relative to the
//! ray's origin is rounded once, and in the same way for all triangles that share it.

use lumbre_math::DVec3;
use lumbre_math::quadratic::dop;

/// Triangles by index, with vertices in double precision, for geometry that is both large and fine, such as a landscape
/// with its pebbles in the coordinates of a planet. Watertight like a [`TriangleMesh`](crate::TriangleMesh), which
/// takes half the memory, is faster, and suffices if one origin is near all vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PreciseMesh {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// Three vertices each; the front is the side from which they run counter-clockwise.
    pub indices: Vec<[u32; 3]>,
}

impl PreciseMesh {
    /// The corners of a triangle; its vertices must exist.
    pub(crate) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.indices[triangle as usize].map(|vertex| self.positions[vertex as usize])
    }
}

/// Whether a triangle can be hit at all: whether its sides are not parallel in double precision.
pub(crate) fn has_area(&[a, b, c]: &[DVec3; 3]) -> bool {
    let (e, f) = (b - a, c - a);
    let is_clear = |x: usize, y: usize| dop(e[x], f[y], e[y], f[x]) != 0.0;
    is_clear(0, 1) || is_clear(1, 2) || is_clear(2, 0)
}
