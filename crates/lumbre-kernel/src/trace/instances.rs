//! A ray at an instance: continues the traversal in the tree that it places.
//!
//! A tree of triangles is traversed inline, with the instruction set of the outer traversal. Any other tree takes a
//! call, no deeper than [`FilterStart`](crate::tree::filter_start::FilterStart) allows. The hit comes back in double
//! precision, like the crossing of a shape.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::decide::{enters, heights};
use super::filtered::Traversal;
use super::filtered_ray::{FilteredGoal, FilteredRay, Found, InInstance};
use super::{ContextRef, IN_INSTANCE, Outcome, Stop, Winner, largest_component, precedes};
use crate::hit::Hit;
use crate::intersect::box_ray::Slabs;
use crate::intersect::{Isa, Simd};
use crate::query::Query;
use crate::trace::tree_query::TreeQuery;
use crate::tree::filter_start::FilterStart;
use crate::tree::packed::Entry;
use crate::tree::packed::Start;
use crate::tree::{GeometryKind, Instance, Tree};

/// An instance, or a part of one.
pub(super) struct Placed<'a> {
    pub(super) instance: &'a Instance,
    /// The subtree to enter.
    pub(super) from: Start,
    /// Its position and its id.
    pub(super) geometry: u32,
    id: u32,
}

impl<'a> Placed<'a> {
    /// `None` for an entry without a part.
    #[inline(always)]
    pub(super) fn of(tree: &'a Tree, entry: &Entry) -> Option<Self> {
        let (geometry, from) = (entry.geometry, Start::of(entry.primitive()));
        let placed = &tree.geometries[geometry as usize];
        let GeometryKind::Instance(instance) = &placed.kind else { unreachable!("the tag says so") };
        (!from.is_nothing()).then_some(Self { instance, from, geometry, id: placed.id })
    }
}

impl<const GENERAL: bool, const FILTERED: bool> FilteredRay<'_, '_, GENERAL, FILTERED> {
    /// Tests an instance.
    #[inline(always)]
    pub(super) fn test_instance<G: FilteredGoal, L: Simd>(
        &mut self,
        entry: &Entry,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let placed = Placed::of(self.decider.tree(), entry)?;
        if FILTERED && !self.query.is_some_and(|query| query.has_mask(placed.geometry)) {
            return None;
        }
        let range = [ray.t_min, if G::IS_ANY { ray.t_max } else { self.best.limit(ray) }];
        let inner = &*placed.instance.tree;
        let context = self.context.within(placed.geometry, placed.id);
        let query = self.query.map(TreeQuery::query);
        let mut outcome = Outcome::Uncertain;
        if let Some(start) = inner.single.as_ref().filter(|start| start.only_triangles) {
            outcome = test_triangles::<G, L, FILTERED>(start, &placed, ray, range, query, context);
        }
        let found = match outcome {
            Outcome::Certain(found) => found,
            Outcome::Uncertain => test_any_tree::<G, FILTERED>(L::isa(), &placed, ray, range, query, context),
        };
        G::test_found(self, found, placed.geometry, ray, slabs)
    }

    /// Takes the result of an instance's tree, if it is the closest.
    #[inline(always)]
    pub(super) fn test_found(
        &mut self,
        found: Found,
        instance: u32,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let winner = found.winner?;
        let heights @ (from, to) = heights(winner.root.t, largest_component(ray));
        if from > self.best.to {
            return None;
        }
        let nested = found.in_instance.and_then(|inner| inner.nested);
        let hit = InInstance { instance, winner, nested };
        let is_closer = to < self.best.from
            || match self.is_closer(&hit, ray) {
                Outcome::Certain(is_closer) => is_closer,
                Outcome::Uncertain => return Some(Stop::Uncertain),
            };
        if is_closer {
            self.in_instance = Some(hit);
            let winner = Winner { root: winner.root, geometry: IN_INSTANCE, primitive: 0 };
            self.keep_exact(winner, heights, slabs);
        }
        None
    }

    /// Whether a hit in an instance is closer than the best; if both are equally close, only the exact traversal knows
    /// their order.
    #[cold]
    #[inline(never)]
    fn is_closer(&self, hit: &InInstance, ray: &Ray) -> Outcome<bool> {
        let exact = self.exact();
        match (&exact, &self.in_instance) {
            (Some(Winner { geometry: IN_INSTANCE, .. }), Some(best)) => {
                let (t, best_t) = (hit.winner.root.t, best.winner.root.t);
                if t != best_t {
                    return Outcome::Certain(t < best_t);
                }
                let (Some(enters), Some(best_enters)) = (self.enters(hit, ray), self.enters(best, ray))
                else {
                    return Outcome::Uncertain;
                };
                let place = |hit: &InInstance| {
                    let hit = hit.clone().into_hit(self.decider.tree(), self.context);
                    (hit.route, hit.geometry, hit.primitive)
                };
                Outcome::Certain((!enters, place(hit)) < (!best_enters, place(best)))
            }
            _ => {
                let (t, ids) = (hit.winner.root.t, (IN_INSTANCE, 0));
                self.decider.is_closer(ray, t, || self.enters(hit, ray), ids, &self.best, exact)
            }
        }
    }

    /// Whether the ray enters at its hit in an instance.
    fn enters(&self, hit: &InInstance, ray: &Ray) -> Option<bool> {
        let Hit { root, geometry, primitive, route, .. } =
            hit.clone().into_hit(self.decider.tree(), self.context);
        let around = self.context.to_context().route.len();
        enters(self.decider.tree(), ray, &route[around..], &Winner { root, geometry, primitive })
    }

    /// Whether a crossing at the same `t` as the closest hit, which is in an instance, comes before it.
    pub(super) fn precedes_instance(
        &self,
        ray: &Ray,
        is_front: Option<bool>,
        ids: (u32, u32),
    ) -> Outcome<bool> {
        let best = self.in_instance.as_ref().and_then(|best| self.enters(best, ray));
        match (is_front, best) {
            (Some(is_front), Some(best)) => {
                Outcome::Certain(precedes((is_front, ids), (best, (IN_INSTANCE, 0))))
            }
            _ => Outcome::Uncertain,
        }
    }
}

/// Traverses a placed tree of triangles, with the instruction set of the outer traversal.
#[inline(always)]
fn test_triangles<G: FilteredGoal, L: Simd, const FILTERED: bool>(
    start: &FilterStart,
    placed: &Placed,
    ray: &Ray,
    range: [f64; 2],
    query: Option<&Query>,
    context: ContextRef,
) -> Outcome<G::Found> {
    let mut moving = None;
    let map = placed.instance.world_from_object.map_at(ray.time, &mut moving);
    let (ray, slabs) = L::start_placed(start, map, ray, range);
    let Some(slabs) = slabs else { return Outcome::Uncertain };
    let (tree, root, ray) = (&*placed.instance.tree, placed.from.below(start.root), &ray);
    let query = query.map(|query| TreeQuery::new(query, tree, context));
    let query = query.as_ref();
    Traversal::<G, false, FILTERED> { tree, start, root, ray, query, context, goal: PhantomData }
        .run_from::<L>(slabs)
}

/// Traverses any placed tree; exactly if single precision is uncertain.
#[inline(never)]
fn test_any_tree<G: FilteredGoal, const FILTERED: bool>(
    isa: Isa,
    placed: &Placed,
    ray: &Ray,
    [t_min, t_max]: [f64; 2],
    query: Option<&Query>,
    context: ContextRef,
) -> G::Found {
    let tree = &*placed.instance.tree;
    let ray = &placed.instance.world_from_object.object_ray(ray).with_range(t_min, t_max);
    let written = &context.to_context();
    if let Some(start) = tree.single.as_ref().filter(|start| !start.only_triangles) {
        let (root, context) = (placed.from.below(start.root), ContextRef::of(written));
        let query = query.map(|query| TreeQuery::new(query, tree, context));
        let query = query.as_ref();
        let traversal =
            Traversal::<G, true, FILTERED> { tree, start, root, ray, query, context, goal: PhantomData };
        if let Outcome::Certain(found) = isa.run(traversal) {
            return G::in_context(found, tree, ContextRef::of(written));
        }
    }
    G::exactly(isa, tree, placed.from, written, ray, query)
}
