//! What a query returns.

use lumbre_geometry::Root;
use smallvec::SmallVec;

/// The ids of the instances that a ray went through, outermost first; empty for what stands in the tree itself.
pub type InstancePath = SmallVec<[u32; 4]>;

/// A crossing, and what was crossed.
#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// Where along the ray, which part, and the barycentrics of a triangle.
    pub root: Root,
    /// The id of the geometry.
    pub id: u32,
    /// The triangle of a mesh, the sphere of a cloud, the primitive of a custom geometry, else 0.
    pub primitive: u32,
    /// The position of the geometry in the list that its tree was built from.
    pub geometry: u32,
    /// The ids of the instances around it.
    pub instances: InstancePath,
    /// The positions of those instances in the lists that their trees were built from.
    pub(crate) route: InstancePath,
}
