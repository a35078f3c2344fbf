//! The parts of a tree that a query includes.

use super::{ContextRef, Winner};
use crate::query::{Faces, Query};
use crate::tree::Tree;

/// A query in a tree, which may be inside instances.
#[derive(Clone, Copy)]
pub(crate) struct TreeQuery<'a> {
    query: &'a Query<'a>,
    tree: &'a Tree,
    context: ContextRef<'a>,
    /// Geometry and primitive.
    excluded: Option<(u32, u32)>,
}

impl<'a> TreeQuery<'a> {
    /// In a tree in this context.
    #[inline(always)]
    pub(crate) fn new(query: &'a Query<'a>, tree: &'a Tree, context: ContextRef<'a>) -> Self {
        let excluded = match query.exclude {
            Some(hit) if context.has_route(&hit.route) => Some((hit.geometry, hit.primitive)),
            _ => None,
        };
        Self { query, tree, context, excluded }
    }

    /// The query.
    #[inline(always)]
    pub(crate) fn query(&self) -> &'a Query<'a> {
        self.query
    }

    /// Whether the mask includes a geometry.
    #[inline(always)]
    pub(crate) fn has_mask(&self, geometry: u32) -> bool {
        let mask = self.query.mask;
        mask == u32::MAX || self.tree.masks.get(geometry as usize).is_none_or(|own| own & mask != 0)
    }

    /// Whether a primitive may count, before it is tested.
    #[inline(always)]
    pub(crate) fn has_primitive(&self, geometry: u32, primitive: u32) -> bool {
        self.excluded != Some((geometry, primitive)) && self.has_mask(geometry)
    }

    /// Whether both sides of a surface count.
    #[inline(always)]
    pub(crate) fn takes_both_faces(&self) -> bool {
        self.query.faces == Faces::Both
    }

    /// Whether a side of a surface counts.
    #[inline(always)]
    pub(crate) fn takes_face(&self, is_front: bool) -> bool {
        match self.query.faces {
            Faces::Both => true,
            Faces::Front => is_front,
            Faces::Back => !is_front,
        }
    }

    /// Whether the filter accepts a hit.
    pub(crate) fn accepts(&self, winner: &Winner) -> bool {
        self.query.filter.is_none_or(|filter| filter(&winner.to_hit_in(self.tree, self.context)))
    }
}
