//! Crossings of a ray, and the visitor that the exact traversal shows them to.

use lumbre_geometry::{Ray, Root};

use super::{Context, meets_front};
use crate::hit::Hit;
use crate::tree::Tree;

/// Which crossings of one primitive a visitor wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// None: only edge hits are collected.
    None,
    /// The first.
    First,
    /// Every one.
    Every,
}

/// Receives crossings.
pub(crate) trait Visitor {
    /// Which crossings it wants.
    fn wanted(&self) -> Wanted;

    /// The range of `t` that it wants; never grows.
    fn range(&self) -> [f64; 2];

    /// Whether it wants anything in an instance.
    fn enters(&self, _tree: &Tree, _geometry: u32) -> bool {
        true
    }

    /// Takes a crossing; true ends the traversal.
    fn visit(&mut self, crossing: &Crossing) -> bool;
}

/// A crossing of a ray.
pub(crate) struct Crossing<'c> {
    pub(crate) root: Root,
    /// The first of the primitive's crossings at this `t`.
    pub(crate) first: Root,
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
    /// Which of the primitive's crossings.
    pub(crate) order: u32,
    /// Whether the front is met, if already known.
    pub(crate) is_front: Option<bool>,
    /// The ray in the space of the geometry's tree.
    pub(crate) ray: &'c Ray,
    pub(crate) tree: &'c Tree,
    pub(crate) context: &'c Context,
}

impl Crossing<'_> {
    /// Whether the front is met.
    pub(crate) fn is_front(&self) -> bool {
        let kind = &self.tree.geometries[self.geometry as usize].kind;
        self.is_front.unwrap_or_else(|| meets_front(kind, self.primitive, self.ray, &self.root))
    }

    /// Whether it comes before crossings at the same `t` that leave. Crossings of one primitive at the same `t` stay
    /// together.
    pub(crate) fn enters(&self) -> bool {
        let kind = &self.tree.geometries[self.geometry as usize].kind;
        self.is_front.unwrap_or_else(|| meets_front(kind, self.primitive, self.ray, &self.first))
    }

    pub(crate) fn to_hit(&self) -> Hit {
        let &Self { root, geometry, primitive, tree, context, .. } = self;
        Hit {
            root,
            id: tree.geometries[geometry as usize].id,
            primitive,
            geometry,
            instances: context.ids.clone(),
            route: context.route.clone(),
        }
    }
}
