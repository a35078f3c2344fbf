//! The closest hit and any hit, in single precision wherever that is certain.

use std::marker::PhantomData;

use lumbre_geometry::{Ray, Root};
use lumbre_math::DVec2;

use super::cursor::NodeCursor;
use super::decide::{Candidate, Decider};
use super::exact;
use super::leaves::CloudRay;
use super::stack::{AnyHit, ClosestHit, Goal, Stack};
use super::{ContextRef, Outcome, Stop, Winner};
use crate::holds::SingleStart;
use crate::hulls::HullRay;
use crate::lanes::{self, Asked, Lanes, Level, Question, Task};
use crate::node::Slabs;
use crate::query::{Query, TreeQuery};
use crate::triangles::{self, BlockRay};
use crate::{Accel, Hit};

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
    pub(super) query: TreeQuery<'a>,
    /// For shapes, once the ray has come to some.
    pub(super) hulls: Option<HullRay>,
    /// For the cloud of spheres that the ray came to last.
    pub(super) cloud: Option<CloudRay>,
    /// The closest hit, where that is in an instance: `exact` has the geometry [`IN_INSTANCE`] then.
    pub(super) in_instance: Option<Hit>,
}

/// No geometry of the tree, and behind all of them: of two hits at the same `t`, one outside of instances comes first.
pub(super) const IN_INSTANCE: u32 = u32::MAX;

impl<'a, 'd, const GENERAL: bool, const FILTERED: bool> FilteredRay<'a, 'd, GENERAL, FILTERED> {
    /// With a ray for triangles: see [`Lanes::start_blocks`].
    #[inline(always)]
    pub(crate) fn new(
        decider: &'d Decider<'a>,
        (blocks, s_per_height): (BlockRay, f32),
        query: TreeQuery<'a>,
    ) -> Self {
        let best = Candidate::NONE;
        Self {
            decider,
            blocks,
            s_per_height,
            best,
            exact: None,
            query,
            hulls: None,
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
        slabs.end_at(triangles::beyond(closer.to * self.s_per_height));
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
    pub(crate) fn found<L: Lanes>(&mut self, ray: &Ray) -> Outcome<Found> {
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

/// What a traversal found.
pub(crate) struct Found {
    /// The closest hit; where any will do, some.
    pub(crate) winner: Option<Winner>,
    /// The same, where it is in an instance.
    pub(crate) in_instance: Option<Hit>,
}

impl Found {
    pub(crate) const NOTHING: Self = Self { winner: None, in_instance: None };

    /// Where any hit will do.
    #[inline(always)]
    pub(crate) fn some(is_hit: bool) -> Self {
        Self { winner: is_hit.then_some(SOME_HIT), in_instance: None }
    }

    /// What the exact traversal found.
    pub(super) fn of_hit(hit: Option<Hit>) -> Self {
        let winner = hit.as_ref().map(|hit| Winner { root: hit.root, geometry: IN_INSTANCE, primitive: 0 });
        Self { winner, in_instance: hit }
    }

    /// As a hit in a tree that stands there.
    #[inline(always)]
    pub(crate) fn into_hit(self, accel: &Accel, context: ContextRef) -> Option<Hit> {
        match self.in_instance {
            Some(hit) => Some(hit),
            None => self.winner.map(|winner| winner.to_hit_in(accel, context)),
        }
    }
}

/// A traversal with one ray.
pub(crate) struct Traversal<'a, 'r, G, const GENERAL: bool, const FILTERED: bool> {
    pub(super) accel: &'a Accel,
    pub(super) start: &'a SingleStart,
    /// The subtree to traverse.
    pub(super) root: u32,
    pub(super) ray: &'r Ray,
    pub(super) query: TreeQuery<'a>,
    pub(super) goal: PhantomData<G>,
}

/// Where any hit will do, there is no more to know of it.
pub(super) const SOME_HIT: Winner = Winner {
    root: Root { t: 0.0, part: 0, multiplicity: 1, local: DVec2::ZERO },
    geometry: 0,
    primitive: 0,
};

impl<G: Goal, const GENERAL: bool, const FILTERED: bool> Task for Traversal<'_, '_, G, GENERAL, FILTERED> {
    type Output = Outcome<Found>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        match L::start_single(self.start, self.ray) {
            Some(slabs) => self.run_from::<L>(slabs),
            None => Outcome::Uncertain,
        }
    }
}

impl<G: Goal, const GENERAL: bool, const FILTERED: bool> Traversal<'_, '_, G, GENERAL, FILTERED> {
    /// Traverses the tree with a ray that has started among its bounding boxes. Any hit is answered by some winner.
    #[inline(always)]
    pub(super) fn run_from<L: Lanes>(self, slabs: Slabs) -> Outcome<Found> {
        let Self { accel, start, root, ray, query, .. } = self;
        let mut cursor = NodeCursor::<L>::new(&accel.tree.nodes, slabs);
        let mut stack = Stack::new();
        let mut next = cursor.descend::<G>(root, &mut stack);
        if next.is_none() && !(GENERAL && !accel.infinite.is_empty()) {
            // Many rays come to no leaf, and need nothing else.
            return Outcome::Certain(Found::NOTHING);
        }
        let decider = &Decider::new(accel, start);
        // Opaque: what was read at the start would else be stored, to be kept until here.
        let blocks = L::start_blocks(start, lanes::opaque(ray), &cursor.slabs);
        let mut filtered = FilteredRay::<GENERAL, FILTERED>::new(decider, blocks, query);
        if GENERAL && let Some(stop) = filtered.test_infinite::<G, L>(ray, &mut cursor.slabs) {
            return stop_early(stop);
        }
        while let Some(leaf) = next {
            if let Some(stop) = filtered.test_leaf::<G, L>(leaf, ray, &mut cursor.slabs) {
                return stop_early(stop);
            }
            next = cursor.next_leaf::<G>(&mut stack);
        }
        if G::IS_ANY { Outcome::Certain(Found::NOTHING) } else { filtered.found::<L>(ray) }
    }
}

impl<'a, 'r, G: Goal, const GENERAL: bool> Traversal<'a, 'r, G, GENERAL, false> {
    /// Of a whole tree that stands in no instance, with everything in it.
    #[inline(always)]
    pub(crate) fn whole(accel: &'a Accel, start: &'a SingleStart, ray: &'r Ray) -> Self {
        let query = TreeQuery::new(None, accel, ContextRef::OUTSIDE);
        Self { accel, start, root: start.root, ray, query, goal: PhantomData }
    }
}

#[inline(always)]
fn stop_early(stop: Stop) -> Outcome<Found> {
    match stop {
        Stop::Hit => Outcome::Certain(Found::some(true)),
        Stop::Uncertain => Outcome::Uncertain,
    }
}

/// The traversal with a query that leaves something out.
pub(crate) fn with_query<G: Goal>(level: Level, accel: &Accel, ray: &Ray, query: &Query) -> Outcome<Found> {
    let Some(start) = &accel.single else { return Outcome::Uncertain };
    let (root, query) = (start.root, TreeQuery::new(Some(query), accel, ContextRef::OUTSIDE));
    if start.only_triangles {
        level.run(Traversal::<G, false, true> { accel, start, root, ray, query, goal: PhantomData })
    } else {
        level.run(Traversal::<G, true, true> { accel, start, root, ray, query, goal: PhantomData })
    }
}

/// The same without a query, for tests.
#[cfg(test)]
pub(crate) fn without_query<G: Goal>(level: Level, accel: &Accel, ray: &Ray) -> Outcome<Found> {
    let Some(start) = &accel.single else { return Outcome::Uncertain };
    if start.only_triangles {
        level.run(Traversal::<G, false, false>::whole(accel, start, ray))
    } else {
        level.run(Traversal::<G, true, false>::whole(accel, start, ray))
    }
}

/// [`Accel::closest`] and [`Accel::any`], by function pointers for the tree and the instruction set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Queries {
    pub(crate) closest: Asked<Option<Hit>>,
    pub(crate) any: Asked<bool>,
}

impl Queries {
    /// For a tree that has this start.
    pub(crate) fn new(level: Level, start: Option<&SingleStart>) -> Self {
        match start.map(|start| start.only_triangles) {
            Some(true) => Self {
                closest: level.asked::<FilteredQuery<ClosestHit, false>>(),
                any: level.asked::<FilteredQuery<AnyHit, false>>(),
            },
            Some(false) => Self {
                closest: level.asked::<FilteredQuery<ClosestHit, true>>(),
                any: level.asked::<FilteredQuery<AnyHit, true>>(),
            },
            None => Self {
                closest: level.asked::<ExactQuery<ClosestHit>>(),
                any: level.asked::<ExactQuery<AnyHit>>(),
            },
        }
    }
}

struct FilteredQuery<G, const GENERAL: bool>(PhantomData<G>);
struct ExactQuery<G>(PhantomData<G>);

impl<const GENERAL: bool> Question for FilteredQuery<ClosestHit, GENERAL> {
    type Ray = Ray;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> Option<Hit> {
        if let Some(start) = &accel.single {
            let ray = &L::read(ray);
            let traversal = Traversal::<ClosestHit, GENERAL, false>::whole(accel, start, ray);
            if let Outcome::Certain(found) = traversal.run::<L>() {
                return found.into_hit(accel, ContextRef::OUTSIDE);
            }
        }
        exact::closest(L::level(), accel, ray, None)
    }
}

impl<const GENERAL: bool> Question for FilteredQuery<AnyHit, GENERAL> {
    type Ray = Ray;
    type Answer = bool;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> bool {
        if let Some(start) = &accel.single {
            let ray = &L::read(ray);
            let traversal = Traversal::<AnyHit, GENERAL, false>::whole(accel, start, ray);
            if let Outcome::Certain(found) = traversal.run::<L>() {
                return found.winner.is_some();
            }
        }
        exact::any(L::level(), accel, ray, None)
    }
}

impl Question for ExactQuery<ClosestHit> {
    type Ray = Ray;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> Option<Hit> {
        exact::closest(L::level(), accel, ray, None)
    }
}

impl Question for ExactQuery<AnyHit> {
    type Ray = Ray;
    type Answer = bool;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> bool {
        exact::any(L::level(), accel, ray, None)
    }
}
