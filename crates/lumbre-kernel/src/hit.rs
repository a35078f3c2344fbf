//! What a query returns.

use std::borrow::Cow;

use lumbre_geometry::{PlacedShape, Root};
use lumbre_math::{DVec3, Transform};
use smallvec::SmallVec;

/// The ids of the instances that a ray went through, outermost first; empty outside of instances.
pub type InstancePath = SmallVec<[u32; 4]>;

/// What a hit is on, and where it is.
#[derive(Clone, Debug)]
pub struct Target<'a> {
    /// The maps of the instances around it, outermost first: their product maps the space of the shape to the world.
    pub placements: Vec<Transform>,
    /// The shape, in the space of the innermost instance.
    pub shape: TargetShape<'a>,
}

/// What a hit is on.
#[derive(Clone, Debug)]
pub enum TargetShape<'a> {
    /// An exact shape.
    Exact(Cow<'a, PlacedShape>),
    /// A triangle of a mesh, by its corners.
    Triangle([DVec3; 3]),
    /// Custom geometry.
    Custom,
}

/// A crossing, and what was crossed.
#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// The position along the ray, which part of a shape, and the barycentrics of a triangle.
    pub root: Root,
    /// The id of the geometry.
    pub id: u32,
    /// The triangle of a mesh, the sphere of a cloud, the primitive of a custom geometry, otherwise 0.
    pub primitive: u32,
    /// The position of the geometry in the list that its tree was built from.
    pub geometry: u32,
    /// The ids of the instances around it.
    pub instances: InstancePath,
    /// The positions of those instances in the lists that their trees were built from.
    pub(crate) route: InstancePath,
}

impl Hit {
    /// The position of the instance around the hit in the list that the tree was built from, if there is exactly one:
    /// for [`Accel::still_instance`](crate::Accel::still_instance).
    #[inline]
    pub fn only_instance(&self) -> Option<u32> {
        if let [position] = self.route[..] { Some(position) } else { None }
    }
}
