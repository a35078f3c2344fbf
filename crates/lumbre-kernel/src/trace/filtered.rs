//! The closest hit and any hit, in single precision wherever that is certain.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::cursor::NodeCursor;
use super::decide::Decider;
use super::exact;
use super::filtered_ray::{FilteredGoal, FilteredRay, Found, InInstance};
use super::stack::{AnyHit, ClosestHit, Stack};
use super::{Context, ContextRef, IN_INSTANCE, Outcome, Stop, Winner};
use crate::hit::Hit;
use crate::intersect::box_ray::Slabs;
use crate::intersect::{Dispatch, DispatchedQuery, Isa, RayQuery, Simd};
use crate::query::Query;
use crate::simd;
use crate::trace::tree_query::TreeQuery;
use crate::tree::Tree;
use crate::tree::filter_start::FilterStart;
use crate::tree::packed::Start;

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
        tree: &Tree,
        from: Start,
        context: &Context,
        ray: &Ray,
        query: Option<&Query>,
    ) -> Found {
        let Some(hit) = exact::closest_from(isa, tree, from, context, ray, query) else {
            return Found::NOTHING;
        };
        let winner = Winner { root: hit.root, geometry: IN_INSTANCE, primitive: 0 };
        // The nested hit is complete, whatever its depth.
        let nested = Some(Box::new(hit));
        Found { winner: Some(winner), in_instance: Some(InInstance { instance: 0, winner, nested }) }
    }

    fn in_context(found: Found, tree: &Tree, context: ContextRef) -> Found {
        let nest = |hit: InInstance| {
            let (instance, winner) = (hit.instance, hit.winner);
            InInstance { instance, winner, nested: Some(Box::new(hit.into_hit(tree, context))) }
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
        tree: &Tree,
        from: Start,
        context: &Context,
        ray: &Ray,
        query: Option<&Query>,
    ) -> bool {
        exact::any_from(isa, tree, from, context, ray, query)
    }

    fn in_context(is_hit: bool, _: &Tree, _: ContextRef) -> bool {
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

/// The traversal of one ray.
pub(crate) struct Traversal<'a, 'r, G, const GENERAL: bool, const FILTERED: bool> {
    pub(super) tree: &'a Tree,
    pub(super) start: &'a FilterStart,
    /// The subtree to traverse.
    pub(super) root: u32,
    pub(super) ray: &'r Ray,
    pub(super) query: Option<&'r TreeQuery<'r>>,
    /// The instances around the tree.
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
    /// Traverses the tree with a ray that has already started among its bounding boxes.
    #[inline(always)]
    pub(super) fn run_from<L: Simd>(self, slabs: Slabs) -> Outcome<G::Found> {
        let Self { tree, start, root, ray, query, context, .. } = self;
        let mut cursor = NodeCursor::<L>::new(&tree.packed.nodes, slabs);
        let mut stack = Stack::new();
        let mut next = cursor.descend::<G>(root, &mut stack);
        if next.is_none() && (!GENERAL || tree.infinite.is_empty()) {
            // Many rays reach no leaf and need no more.
            return Outcome::Certain(G::nothing());
        }
        let decider = &Decider::new(tree, start);
        // Opaque: keeps the ray from being loaded at the start and spilled until here.
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
    /// A traversal of a whole top-level tree.
    #[inline(always)]
    pub(crate) fn whole(tree: &'a Tree, start: &'a FilterStart, ray: &'r Ray) -> Self {
        Self {
            tree,
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

/// The traversal with a query that excludes some hits.
pub(crate) fn with_query<G: FilteredGoal>(
    isa: Isa,
    tree: &Tree,
    ray: &Ray,
    query: &Query,
) -> Outcome<G::Found> {
    let Some(start) = &tree.single else { return Outcome::Uncertain };
    let (root, context) = (start.root, ContextRef::OUTSIDE);
    let query = Some(&TreeQuery::new(query, tree, context));
    if start.only_triangles {
        isa.run(Traversal::<G, false, true> { tree, start, root, ray, query, context, goal: PhantomData })
    } else {
        isa.run(Traversal::<G, true, true> { tree, start, root, ray, query, context, goal: PhantomData })
    }
}

/// The traversal without a query, for tests.
#[cfg(test)]
pub(crate) fn without_query<G: FilteredGoal>(isa: Isa, tree: &Tree, ray: &Ray) -> Outcome<G::Found> {
    let Some(start) = &tree.single else { return Outcome::Uncertain };
    if start.only_triangles {
        isa.run(Traversal::<G, false, false>::whole(tree, start, ray))
    } else {
        isa.run(Traversal::<G, true, false>::whole(tree, start, ray))
    }
}

/// [`Accel::closest`] and [`Accel::any`], by function pointers for the tree and the instruction set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Queries {
    pub(crate) closest: DispatchedQuery<Option<Hit>>,
    pub(crate) any: DispatchedQuery<bool>,
}

impl Queries {
    /// The functions for a tree.
    pub(crate) fn of(isa: Isa, tree: &Tree) -> Self {
        match tree.single.as_ref().map(|start| start.only_triangles) {
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
    fn ask<L: Simd>(tree: &Tree, ray: &Ray) -> Option<Hit> {
        if let Some(start) = &tree.single {
            let ray = &L::read(ray);
            let traversal = Traversal::<ClosestHit, GENERAL, false>::whole(tree, start, ray);
            if let Outcome::Certain(found) = traversal.run::<L>() {
                return found.into_hit(tree, ContextRef::OUTSIDE);
            }
        }
        exact::closest(L::isa(), tree, ray, None)
    }
}

impl<const GENERAL: bool> RayQuery for FilteredQuery<AnyHit, GENERAL> {
    type Ray = Ray;
    type Answer = bool;

    #[inline(always)]
    fn ask<L: Simd>(tree: &Tree, ray: &Ray) -> bool {
        if let Some(start) = &tree.single {
            let ray = &L::read(ray);
            let traversal = Traversal::<AnyHit, GENERAL, false>::whole(tree, start, ray);
            if let Outcome::Certain(found) = traversal.run::<L>() {
                return found;
            }
        }
        exact::any(L::isa(), tree, ray, None)
    }
}

impl RayQuery for ExactQuery<ClosestHit> {
    type Ray = Ray;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn ask<L: Simd>(tree: &Tree, ray: &Ray) -> Option<Hit> {
        exact::closest(L::isa(), tree, ray, None)
    }
}

impl RayQuery for ExactQuery<AnyHit> {
    type Ray = Ray;
    type Answer = bool;

    #[inline(always)]
    fn ask<L: Simd>(tree: &Tree, ray: &Ray) -> bool {
        exact::any(L::isa(), tree, ray, None)
    }
}
