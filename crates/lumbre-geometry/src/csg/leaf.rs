//! The operands of CSG: exact shapes and user-defined solids.

use std::fmt::Debug;
use std::sync::Arc;

use lumbre_math::{DVec3, Transform};
use smallvec::SmallVec;

use crate::placed::into_world;
use crate::{Aabb, PlacedShape, Ray, Root, Surface};

/// A user-defined solid, such as a closed mesh, as an operand of CSG.
pub trait Solid: Debug + Send + Sync {
    /// The number of parts of its surface; the `part` of every root is less than this.
    fn part_count(&self) -> u32;

    /// A bounding box under `world_from_object`, rounded outward. Only bounded solids are accepted.
    fn bounds(&self, world_from_object: &Transform) -> Aabb;

    /// Appends every crossing of the **whole** line of `ray`, whatever the ray's range, in any order. On every
    /// line, entries and exits must be equal in number.
    fn crossings(&self, ray: &Ray, out: &mut Crossings);

    /// The surface at a crossing, with the outward normal.
    fn surface(&self, ray: &Ray, root: &Root) -> Surface;

    /// Whether the solid contains `p`. The default counts the crossings before `p` on a line through it.
    fn contains(&self, p: DVec3) -> bool {
        let mut crossings = Crossings::new();
        // A direction that is unlikely to be an axis of symmetry.
        self.crossings(&Ray::new(p, DVec3::new(0.612_372_4, 0.353_553_7, 0.707_106_1)), &mut crossings);
        let behind = crossings.iter().filter(|c| c.root.t <= 0.0);
        behind.map(|c| if c.enters { 1 } else { -1 }).sum::<i32>() > 0
    }
}

/// A point where a line enters or leaves a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The distance along the line, and the part of the solid.
    pub root: Root,
    /// Whether the line enters the solid here.
    pub enters: bool,
}

/// The crossings of one line.
pub type Crossings = SmallVec<[Crossing; 8]>;

/// An operand of a CSG shape.
#[derive(Clone, Debug)]
pub enum Leaf {
    /// An exact shape.
    Shape(PlacedShape),
    /// A user-defined solid, placed.
    Solid {
        /// The solid.
        solid: Arc<dyn Solid>,
        /// Its placement; `None` for the identity.
        world_from_object: Option<Box<Transform>>,
    },
}

/// The leaf and part that a root of a CSG shape lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafPart {
    /// The index of the leaf, in the order of the operands from left to right.
    pub leaf: usize,
    /// The part, in the leaf's own numbering.
    pub part: u32,
    /// Whether the leaf is subtracted, so that its outside is the result's inside and its normal is flipped.
    pub flipped: bool,
}

impl Leaf {
    pub(super) fn placed(&self, world_from_self: &Transform) -> Self {
        match self {
            Self::Shape(shape) => {
                let map = *world_from_self * shape.world_from_object();
                Self::Shape(PlacedShape::new(shape.shape().clone(), map))
            }
            Self::Solid { solid, world_from_object } => {
                let map = *world_from_self * world_from_object.as_deref().copied().unwrap_or_default();
                Self::Solid { solid: Arc::clone(solid), world_from_object: Some(Box::new(map)) }
            }
        }
    }

    pub(super) fn bounds(&self, world_from_self: &Transform) -> Option<Aabb> {
        match self {
            Self::Shape(shape) => shape.shape().bounds(&(*world_from_self * shape.world_from_object())),
            Self::Solid { solid, world_from_object: None } => Some(solid.bounds(world_from_self)),
            Self::Solid { solid, world_from_object: Some(map) } => {
                Some(solid.bounds(&(*world_from_self * **map)))
            }
        }
    }

    pub(super) fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        match self {
            Self::Shape(shape) => shape.surface(ray, root),
            Self::Solid { solid, world_from_object: None } => solid.surface(ray, root),
            Self::Solid { solid, world_from_object: Some(map) } => {
                into_world(map, &solid.surface(&ray.into_object(map), root))
            }
        }
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Shape(shape) => shape_contains(shape, p),
            Self::Solid { solid, world_from_object: None } => solid.contains(p),
            Self::Solid { solid, world_from_object: Some(map) } => solid.contains(map.inverse_point(p)),
        }
    }
}

pub(super) fn shape_contains(shape: &PlacedShape, p: DVec3) -> bool {
    shape.shape().contains(shape.world_from_object().inverse_point(p))
}
