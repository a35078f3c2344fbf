//! Meshes whose vertices are in double precision, and stay so.
//!
//! Their triangles stand one by one in leaves of their own, so that meshes in single precision pay nothing for them. The
//! test is the same (see `triangles`): after the load, that is in double precision anyway. A corner relative to the ray's
//! origin is rounded once, and the same way for all the triangles that share it.

use lumbre_math::DVec3;
use lumbre_math::quadratic::dop;

/// Triangles by index, with vertices in double precision: for what is large and fine at once, such as a landscape with its
/// pebbles in the coordinates of a planet. Watertight as a [`TriangleMesh`](crate::TriangleMesh) is, which takes half the
/// memory, is faster, and suffices where one origin is near all vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PreciseMesh {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// Three vertices each; the front is where they run counter-clockwise.
    pub indices: Vec<[u32; 3]>,
}

impl PreciseMesh {
    /// The corners of a triangle that names vertices that are there.
    pub(crate) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.indices[triangle as usize].map(|vertex| self.positions[vertex as usize])
    }
}

/// Whether a triangle can be hit at all: whether its sides, as double precision has them, are not parallel.
pub(crate) fn has_area(&[a, b, c]: &[DVec3; 3]) -> bool {
    let (e, f) = (b - a, c - a);
    let is_clear = |x: usize, y: usize| dop(e[x], f[y], e[y], f[x]) != 0.0;
    is_clear(0, 1) || is_clear(1, 2) || is_clear(2, 0)
}
