//! The closest hit and any hit, in single precision wherever that is certain.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::cursor::NodeCursor;
use super::decide::{Candidate, Decider};
use super::exact;
use super::leaves::CloudRay;
use super::stack::{AnyHit, ClosestHit, Goal, Stack};
use super::{Context, ContextRef, Outcome, Stop, Winner};
use crate::intersect::box_ray::Slabs;
use crate::intersect::filter_start::FilterStart;
use crate::intersect::watertight::{self, BlockRay};
use crate::intersect::{Dispatch, DispatchedQuery, Isa, RayQuery, Simd};
use crate::query::{Query, TreeQuery};
use crate::simd;
use crate::tree::bounding_block::BoundingVolumeRay;
use crate::tree::packed::Start;
use crate::{Accel, GeometryKind, Hit};

/// A ray in the leaves of a tree. `GENERAL`: of anything, not of triangles alone; `FILTERED`: with a query that leaves something out.
pub(crate) struct FilteredRay<'a, 'd, const GENERAL: bool, const FILTERED: bool> {
    pub(super) decider: &'d Decider<'a>,
    /// For triangles; its range also ends what other leaves are tested for.
    pub(crate) blocks: BlockRay,
    /// From heights along the ray to places in the range of bounding boxes.
    s_per_height: f32,
    /// The closest hit so far.
    pub(crate) best: Candidate,
    /// That hit, where it is known in double precision.
    exact: Option<Winner>,
    /// What counts, where `FILTERED`.
    pub(super) query: Option<&'d TreeQuery<'d>>,
    /// Where the tree stands.
    pub(super) context: ContextRef<'d>,
    /// For shapes, once the ray has come to some.
    pub(super) bounding_volumes: Option<BoundingVolumeRay>,
    /// For the cloud of spheres that the ray came to last.
    pub(super) cloud: Option<CloudRay>,
    /// The closest hit, where that is in an instance: `exact` has the geometry [`IN_INSTANCE`] then.
    pub(super) in_instance: Option<InInstance>,
}

/// No geometry of the tree, and behind all of them: of two hits at the same `t`, one outside of instances comes first.
pub(super) const IN_INSTANCE: u32 = u32::MAX;

/// A hit in an instance.
#[derive(Clone)]
pub(crate) struct InInstance {
    /// The position of the instance in the list of its tree.
    pub(super) instance: u32,
    /// The hit in the instance's own tree.
    pub(super) winner: Winner,
    /// The whole hit, where it is in an instance there.
    pub(super) nested: Option<Box<Hit>>,
}

impl InInstance {
    /// As a hit, where the tree that has the instance stands there.
    #[inline(always)]
    pub(super) fn into_hit(self, accel: &Accel, context: ContextRef) -> Hit {
        if let Some(hit) = self.nested {
            return *hit;
        }
        let placed = &accel.geometries[self.instance as usize];
        let GeometryKind::Instance(instance) = &placed.kind else { unreachable!("it was an instance") };
        self.winner.to_hit_in(&instance.accel, context.within(self.instance, placed.id))
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

    /// Starts with another ray, where there are triangles alone.
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

    /// Takes a closer hit, and ends the ray there.
    #[inline(always)]
    pub(crate) fn keep(&mut self, closer: Candidate, slabs: &mut Slabs) {
        self.best = closer;
        self.blocks.range.last = closer.to;
        slabs.end_at(watertight::beyond(closer.to * self.s_per_height));
    }

    /// The same of a hit that is known in double precision, and lies in this interval of heights.
    #[inline(always)]
    pub(super) fn keep_exact(&mut self, winner: Winner, heights: (f32, f32), slabs: &mut Slabs) {
        self.exact = Some(winner);
        self.keep(Candidate::exact(heights), slabs);
    }

    /// The closest hit so far, where it is known in double precision.
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
    /// The same, where it is in an instance.
    pub(crate) in_instance: Option<InInstance>,
}

impl Found {
    pub(crate) const NOTHING: Self = Self { winner: None, in_instance: None };

    /// As a hit in a tree that stands there.
    #[inline(always)]
    pub(crate) fn into_hit(self, accel: &Accel, context: ContextRef) -> Option<Hit> {
        match self.in_instance {
            Some(hit) => Some(hit.into_hit(accel, context)),
            None => self.winner.map(|winner| winner.to_hit_in(accel, context)),
        }
    }
}

/// A goal of the filtered traversal, and how it ends.
pub(crate) trait FilteredGoal: Goal {
    /// What is found.
    type Found;

    /// Where no leaf is on the way.
    fn nothing() -> Self::Found;

    /// Where the traversal stops at a hit.
    fn hit() -> Self::Found;

    /// Where a triangle is the closest hit of a packet's ray.
    fn closest(winner: Winner) -> Self::Found;

    /// Where all leaves on the way were tested.
    fn end<L: Simd, const GENERAL: bool, const FILTERED: bool>(
        filtered: &mut FilteredRay<GENERAL, FILTERED>,
        ray: &Ray,
    ) -> Outcome<Self::Found>;

    /// By the exact traversal, in a part of a tree that stands there.
    fn exactly(
        isa: Isa,
        accel: &Accel,
        from: Start,
        context: &Context,
        ray: &Ray,
        query: Option<&Query>,
    ) -> Self::Found;

    /// The same, told apart from what a tree around that one finds.
    fn in_context(found: Self::Found, accel: &Accel, context: ContextRef) -> Self::Found;

    /// Takes what was found in the tree of an instance.
    fn test_found<const GENERAL: bool, const FILTERED: bool>(
        filtered: &mut FilteredRay<GENERAL, FILTERED>,
        found: Self::Found,
        instance: u32,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop>;
}

impl FilteredGoal for ClosestHit {
    type Found = Found;

    #[inline(always)]
    fn nothing() -> Found {
        Found::NOTHING
    }

    #[inline(always)]
    fn hit() -> Found {
        unreachable!("a closest hit ends at no hit")
    }

    #[inline(always)]
    fn closest(winner: Winner) -> Found {
        Found { winner: Some(winner), in_instance: None }
    }

    #[inline(always)]
    fn end<L: Simd, const GENERAL: bool, const FILTERED: bool>(
        filtered: &mut FilteredRay<GENERAL, FILTERED>,
        ray: &Ray,
    ) -> Outcome<Found> {
        filtered.closest::<L>(ray)
    }

    fn exactly(
        isa: Isa,
        accel: &Accel,
        from: Start,
        context: &Context,
        ray: &Ray,
        query: Option<&Query>,
    ) -> Found {
        let Some(hit) = exact::closest_from(isa, accel, from, context, ray, query) else {
            return Found::NOTHING;
        };
        let winner = Winner { root: hit.root, geometry: IN_INSTANCE, primitive: 0 };
        // The hit is whole already, wherever it is.
        let nested = Some(Box::new(hit));
        Found { winner: Some(winner), in_instance: Some(InInstance { instance: 0, winner, nested }) }
    }

    fn in_context(found: Found, accel: &Accel, context: ContextRef) -> Found {
        let nest = |hit: InInstance| {
            let (instance, winner) = (hit.instance, hit.winner);
            InInstance { instance, winner, nested: Some(Box::new(hit.into_hit(accel, context))) }
        };
        Found { winner: found.winner, in_instance: found.in_instance.map(nest) }
    }

    #[inline(always)]
    fn test_found<const GENERAL: bool, const FILTERED: bool>(
        filtered: &mut FilteredRay<GENERAL, FILTERED>,
        found: Found,
        instance: u32,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        filtered.test_found(found, instance, ray, slabs)
    }
}

impl FilteredGoal for AnyHit {
    type Found = bool;

    #[inline(always)]
    fn nothing() -> bool {
        false
    }

    #[inline(always)]
    fn hit() -> bool {
        true
    }

    #[inline(always)]
    fn closest(_: Winner) -> bool {
        true
    }

    #[inline(always)]
    fn end<L: Simd, const GENERAL: bool, const FILTERED: bool>(
        _: &mut FilteredRay<GENERAL, FILTERED>,
        _: &Ray,
    ) -> Outcome<bool> {
        Outcome::Certain(false)
    }

    fn exactly(
        isa: Isa,
        accel: &Accel,
        from: Start,
        context: &Context,
        ray: &Ray,
        query: Option<&Query>,
    ) -> bool {
        exact::any_from(isa, accel, from, context, ray, query)
    }

    fn in_context(is_hit: bool, _: &Accel, _: ContextRef) -> bool {
        is_hit
    }

    #[inline(always)]
    fn test_found<const GENERAL: bool, const FILTERED: bool>(
        _: &mut FilteredRay<GENERAL, FILTERED>,
        is_hit: bool,
        _: u32,
        _: &Ray,
        _: &mut Slabs,
    ) -> Option<Stop> {
        is_hit.then_some(Stop::Hit)
    }
}

/// A traversal with one ray.
pub(crate) struct Traversal<'a, 'r, G, const GENERAL: bool, const FILTERED: bool> {
    pub(super) accel: &'a Accel,
    pub(super) start: &'a FilterStart,
    /// The subtree to traverse.
    pub(super) root: u32,
    pub(super) ray: &'r Ray,
    pub(super) query: Option<&'r TreeQuery<'r>>,
    /// Where the tree stands.
    pub(super) context: ContextRef<'r>,
    pub(super) goal: PhantomData<G>,
}

impl<G: FilteredGoal, const GENERAL: bool, const FILTERED: bool> Dispatch
    for Traversal<'_, '_, G, GENERAL, FILTERED>
{
    type Output = Outcome<G::Found>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        match L::start_filter(self.start, self.ray) {
            Some(slabs) => self.run_from::<L>(slabs),
            None => Outcome::Uncertain,
        }
    }
}

impl<G: FilteredGoal, const GENERAL: bool, const FILTERED: bool> Traversal<'_, '_, G, GENERAL, FILTERED> {
    /// Traverses the tree with a ray that has started among its bounding boxes.
    #[inline(always)]
    pub(super) fn run_from<L: Simd>(self, slabs: Slabs) -> Outcome<G::Found> {
        let Self { accel, start, root, ray, query, context, .. } = self;
        let mut cursor = NodeCursor::<L>::new(&accel.tree.nodes, slabs);
        let mut stack = Stack::new();
        let mut next = cursor.descend::<G>(root, &mut stack);
        if next.is_none() && (!GENERAL || accel.infinite.is_empty()) {
            // Many rays come to no leaf, and need nothing else.
            return Outcome::Certain(G::nothing());
        }
        let decider = &Decider::new(accel, start);
        // Opaque: what was read at the start would else be stored, to be kept until here.
        let blocks = L::start_blocks(start, simd::opaque(ray), &cursor.slabs);
        let mut filtered = FilteredRay::<GENERAL, FILTERED>::new(decider, blocks, query, context);
        if GENERAL && let Some(stop) = filtered.test_infinite::<G, L>(ray, &mut cursor.slabs) {
            return stop_early::<G>(stop);
        }
        while let Some(leaf) = next {
            if let Some(stop) = filtered.test_leaf::<G, L>(leaf, ray, &mut cursor.slabs) {
                return stop_early::<G>(stop);
            }
            next = cursor.next_leaf::<G>(&mut stack);
        }
        G::end::<L, GENERAL, FILTERED>(&mut filtered, ray)
    }
}

impl<'a, 'r, G: FilteredGoal, const GENERAL: bool> Traversal<'a, 'r, G, GENERAL, false> {
    /// Of a whole tree that stands in no instance, with everything in it.
    #[inline(always)]
    pub(crate) fn whole(accel: &'a Accel, start: &'a FilterStart, ray: &'r Ray) -> Self {
        Self {
            accel,
            start,
            root: start.root,
            ray,
            query: None,
            context: ContextRef::OUTSIDE,
            goal: PhantomData,
        }
    }
}

#[inline(always)]
fn stop_early<G: FilteredGoal>(stop: Stop) -> Outcome<G::Found> {
    match stop {
        Stop::Hit => Outcome::Certain(G::hit()),
        Stop::Uncertain => Outcome::Uncertain,
    }
}

/// The traversal with a query that leaves something out.
pub(crate) fn with_query<G: FilteredGoal>(
    isa: Isa,
    accel: &Accel,
    ray: &Ray,
    query: &Query,
) -> Outcome<G::Found> {
    let Some(start) = &accel.single else { return Outcome::Uncertain };
    let (root, context) = (start.root, ContextRef::OUTSIDE);
    let query = Some(&TreeQuery::new(query, accel, context));
    if start.only_triangles {
        isa.run(Traversal::<G, false, true> { accel, start, root, ray, query, context, goal: PhantomData })
    } else {
        isa.run(Traversal::<G, true, true> { accel, start, root, ray, query, context, goal: PhantomData })
    }
}

/// The same without a query, for tests.
#[cfg(test)]
pub(crate) fn without_query<G: FilteredGoal>(isa: Isa, accel: &Accel, ray: &Ray) -> Outcome<G::Found> {
    let Some(start) = &accel.single else { return Outcome::Uncertain };
    if start.only_triangles {
        isa.run(Traversal::<G, false, false>::whole(accel, start, ray))
    } else {
        isa.run(Traversal::<G, true, false>::whole(accel, start, ray))
    }
}

/// [`Accel::closest`] and [`Accel::any`], by function pointers for the tree and the instruction set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Queries {
    pub(crate) closest: DispatchedQuery<Option<Hit>>,
    pub(crate) any: DispatchedQuery<bool>,
}

impl Queries {
    /// For a tree that has this start.
    pub(crate) fn new(isa: Isa, start: Option<&FilterStart>) -> Self {
        match start.map(|start| start.only_triangles) {
            Some(true) => Self {
                closest: isa.dispatched::<FilteredQuery<ClosestHit, false>>(),
                any: isa.dispatched::<FilteredQuery<AnyHit, false>>(),
            },
            Some(false) => Self {
                closest: isa.dispatched::<FilteredQuery<ClosestHit, true>>(),
                any: isa.dispatched::<FilteredQuery<AnyHit, true>>(),
            },
            None => Self {
                closest: isa.dispatched::<ExactQuery<ClosestHit>>(),
                any: isa.dispatched::<ExactQuery<AnyHit>>(),
            },
        }
    }
}

struct FilteredQuery<G, const GENERAL: bool>(PhantomData<G>);
struct ExactQuery<G>(PhantomData<G>);

impl<const GENERAL: bool> RayQuery for FilteredQuery<ClosestHit, GENERAL> {
    type Ray = Ray;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn ask<L: Simd>(accel: &Accel, ray: &Ray) -> Option<Hit> {
        if let Some(start) = &accel.single {
            let ray = &L::read(ray);
            let traversal = Traversal::<ClosestHit, GENERAL, false>::whole(accel, start, ray);
            if let Outcome::Certain(found) = traversal.run::<L>() {
                return found.into_hit(accel, ContextRef::OUTSIDE);
            }
        }
        exact::closest(L::isa(), accel, ray, None)
    }
}

impl<const GENERAL: bool> RayQuery for FilteredQuery<AnyHit, GENERAL> {
    type Ray = Ray;
    type Answer = bool;

    #[inline(always)]
    fn ask<L: Simd>(accel: &Accel, ray: &Ray) -> bool {
        if let Some(start) = &accel.single {
            let ray = &L::read(ray);
            let traversal = Traversal::<AnyHit, GENERAL, false>::whole(accel, start, ray);
            if let Outcome::Certain(found) = traversal.run::<L>() {
                return found;
            }
        }
        exact::any(L::isa(), accel, ray, None)
    }
}

impl RayQuery for ExactQuery<ClosestHit> {
    type Ray = Ray;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn ask<L: Simd>(accel: &Accel, ray: &Ray) -> Option<Hit> {
        exact::closest(L::isa(), accel, ray, None)
    }
}

impl RayQuery for ExactQuery<AnyHit> {
    type Ray = Ray;
    type Answer = bool;

    #[inline(always)]
    fn ask<L: Simd>(accel: &Accel, ray: &Ray) -> bool {
        exact::any(L::isa(), accel, ray, None)
    }
}
