//! A ray of the filtered traversal in the leaves of a tree, and what it finds there.

use lumbre_geometry::Ray;

use super::cloud_ray::CloudRay;
use super::decide::{Candidate, Decider};
use super::stack::Goal;
use super::tree_query::TreeQuery;
use super::{Context, ContextRef, IN_INSTANCE, Outcome, Stop, Winner};
use crate::hit::Hit;
use crate::intersect::box_ray::Slabs;
use crate::intersect::watertight::{self, BlockRay};
use crate::intersect::{Isa, Simd};
use crate::query::Query;
use crate::tree::bounding_block::BoundingVolumeRay;
use crate::tree::packed::Start;
use crate::tree::{GeometryKind, Tree};

/// A ray in the leaves of a tree. `GENERAL`: for any primitives, not only triangles; `FILTERED`: with a query that
/// excludes some hits.
pub(crate) struct FilteredRay<'a, 'd, const GENERAL: bool, const FILTERED: bool> {
    pub(super) decider: &'d Decider<'a>,
    /// For triangles; its range also limits the tests of other leaves.
    pub(crate) blocks: BlockRay,
    /// Converts heights along the ray to positions in the range of bounding boxes.
    pub(super) s_per_height: f32,
    /// The closest hit so far.
    pub(crate) best: Candidate,
    /// That hit, if it is known in double precision.
    exact: Option<Winner>,
    /// The query, if `FILTERED`.
    pub(super) query: Option<&'d TreeQuery<'d>>,
    /// The instances around the tree.
    pub(super) context: ContextRef<'d>,
    /// For shapes; created at the first one.
    pub(super) bounding_volumes: Option<BoundingVolumeRay>,
    /// For the last cloud of spheres that the ray came to.
    pub(super) cloud: Option<CloudRay>,
    /// The closest hit, if it is in an instance: `exact` has the geometry [`IN_INSTANCE`] then.
    pub(super) in_instance: Option<InInstance>,
}

/// A hit in an instance.
#[derive(Clone)]
pub(crate) struct InInstance {
    /// The position of the instance in the list of its tree.
    pub(super) instance: u32,
    /// The hit in the instance's own tree.
    pub(super) winner: Winner,
    /// The complete hit, if it is in a nested instance.
    pub(super) nested: Option<Box<Hit>>,
}

impl InInstance {
    /// Converts to a hit, given the context of the instance's tree.
    #[inline(always)]
    pub(super) fn into_hit(self, tree: &Tree, context: ContextRef) -> Hit {
        if let Some(hit) = self.nested {
            return *hit;
        }
        let placed = &tree.geometries[self.instance as usize];
        let GeometryKind::Instance(instance) = &placed.kind else { unreachable!("it was an instance") };
        self.winner.to_hit_in(&instance.tree, context.within(self.instance, placed.id))
    }
}

impl<'a, 'd, const GENERAL: bool, const FILTERED: bool> FilteredRay<'a, 'd, GENERAL, FILTERED> {
    /// With a ray for triangles: see [`Simd::start_blocks`].
    #[inline(always)]
    pub(crate) fn new(
        decider: &'d Decider<'a>,
        (blocks, s_per_height): (BlockRay, f32),
        query: Option<&'d TreeQuery<'d>>,
        context: ContextRef<'d>,
    ) -> Self {
        let best = Candidate::NONE;
        Self {
            decider,
            blocks,
            s_per_height,
            best,
            exact: None,
            query,
            context,
            bounding_volumes: None,
            cloud: None,
            in_instance: None,
        }
    }

    /// Starts with another ray, in a tree of triangles only.
    #[inline(always)]
    pub(crate) fn restart(&mut self, (blocks, s_per_height): (BlockRay, f32)) {
        (self.blocks, self.s_per_height, self.best) = (blocks, s_per_height, Candidate::NONE);
    }

    /// Takes the closest hit so far from a packet.
    #[inline(always)]
    pub(crate) fn continue_from(&mut self, best: Candidate) {
        self.best = best;
        self.blocks.range.last = if best.is_some() { best.to } else { self.blocks.range.last };
    }

    /// Takes a closer hit, and shortens the ray.
    #[inline(always)]
    pub(crate) fn keep(&mut self, closer: Candidate, slabs: &mut Slabs) {
        self.best = closer;
        self.blocks.range.last = closer.to;
        slabs.end_at(watertight::beyond(closer.to * self.s_per_height));
    }

    /// Takes a closer hit that is known in double precision and lies in this interval of heights.
    #[inline(always)]
    pub(super) fn keep_exact(&mut self, winner: Winner, heights: (f32, f32), slabs: &mut Slabs) {
        self.exact = Some(winner);
        self.keep(Candidate::exact(heights), slabs);
    }

    /// The closest hit so far, if it is known in double precision.
    #[inline(always)]
    pub(crate) fn exact(&self) -> Option<Winner> {
        if (GENERAL || FILTERED) && self.best.is_exact() { self.exact } else { None }
    }

    /// The closest hit in double precision.
    #[inline(always)]
    pub(crate) fn closest<L: Simd>(&mut self, ray: &Ray) -> Outcome<Found> {
        match self.decider.closest::<L>(ray, self.blocks.axes, (&self.best, self.exact())) {
            Outcome::Certain(winner) => {
                let is_inside = GENERAL && winner.is_some_and(|winner| winner.geometry == IN_INSTANCE);
                let in_instance = if is_inside { self.in_instance.take() } else { None };
                Outcome::Certain(Found { winner, in_instance })
            }
            Outcome::Uncertain => Outcome::Uncertain,
        }
    }

    #[inline(always)]
    pub(crate) fn decider(&self) -> &'d Decider<'a> {
        self.decider
    }
}

/// The closest hit.
pub(crate) struct Found {
    pub(crate) winner: Option<Winner>,
    /// The same hit, if it is in an instance.
    pub(crate) in_instance: Option<InInstance>,
}

impl Found {
    pub(crate) const NOTHING: Self = Self { winner: None, in_instance: None };

    /// Converts to a hit in a tree in this context.
    #[inline(always)]
    pub(crate) fn into_hit(self, tree: &Tree, context: ContextRef) -> Option<Hit> {
        match self.in_instance {
            Some(hit) => Some(hit.into_hit(tree, context)),
            None => self.winner.map(|winner| winner.to_hit_in(tree, context)),
        }
    }
}

/// A goal of the filtered traversal, and how it ends.
pub(crate) trait FilteredGoal: Goal {
    /// The result.
    type Found;

    /// The result if the ray reaches no leaf.
    fn nothing() -> Self::Found;

    /// The result if the traversal stops at a hit.
    fn hit() -> Self::Found;

    /// The result if a triangle is the closest hit of a packet's ray.
    fn closest(winner: Winner) -> Self::Found;

    /// The result after all leaves on the way were tested.
    fn end<L: Simd, const GENERAL: bool, const FILTERED: bool>(
        filtered: &mut FilteredRay<GENERAL, FILTERED>,
        ray: &Ray,
    ) -> Outcome<Self::Found>;

    /// The result of the exact traversal, in a part of a tree in this context.
    fn exactly(
        isa: Isa,
        tree: &Tree,
        from: Start,
        context: &Context,
        ray: &Ray,
        query: Option<&Query>,
    ) -> Self::Found;

    /// Moves the result into this context, so that it differs from results of the outer tree.
    fn in_context(found: Self::Found, tree: &Tree, context: ContextRef) -> Self::Found;

    /// Takes the result of an instance's tree.
    fn test_found<const GENERAL: bool, const FILTERED: bool>(
        filtered: &mut FilteredRay<GENERAL, FILTERED>,
        found: Self::Found,
        instance: u32,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop>;
}
