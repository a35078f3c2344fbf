//! A ray at an instance: the same traversal in the tree that it places.
//!
//! A tree of triangles is traversed at once, by the instruction set of the traversal around it; any other by a call, no deeper than
//! [`SingleStart`](crate::holds::SingleStart) allows. What is hit there comes back in double precision, as the crossing of a shape does.

use std::cmp::Ordering;
use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::decide::{heights, largest_component};
use super::filtered::{FilteredRay, Found, IN_INSTANCE, Traversal};
use super::stack::Goal;
use super::{ContextRef, Outcome, Stop, Winner, exact};
use crate::collapse::Entry;
use crate::holds::SingleStart;
use crate::lanes::{Lanes, Level};
use crate::node::Slabs;
use crate::opening::Start;
use crate::query::TreeQuery;
use crate::{Accel, GeometryKind, Hit, Instance};

/// An instance, or a part of one.
struct Placed<'a> {
    instance: &'a Instance,
    /// The subtree that is entered.
    from: Start,
    /// Its position and its id.
    geometry: u32,
    id: u32,
}

impl<'a> Placed<'a> {
    /// `None` where an entry stands for nothing.
    #[inline(always)]
    fn of(accel: &'a Accel, entry: &Entry) -> Option<Self> {
        let (geometry, from) = (entry.geometry, Start::of(entry.primitive()));
        let placed = &accel.geometries[geometry as usize];
        let GeometryKind::Instance(instance) = &placed.kind else { unreachable!("the tag says so") };
        (!from.is_nothing()).then_some(Self { instance, from, geometry, id: placed.id })
    }
}

impl<const GENERAL: bool, const FILTERED: bool> FilteredRay<'_, '_, GENERAL, FILTERED> {
    /// Tests an instance.
    #[inline(always)]
    pub(super) fn test_instance<G: Goal, L: Lanes>(
        &mut self,
        entry: &Entry,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let placed = Placed::of(self.decider.accel(), entry)?;
        if FILTERED && !self.query.has_mask(placed.geometry) {
            return None;
        }
        let range = [ray.t_min, if G::IS_ANY { ray.t_max } else { self.best.limit(ray) }];
        let inner = &*placed.instance.accel;
        let context = self.query.context().within(placed.geometry, placed.id);
        let mut outcome = Outcome::Uncertain;
        if let Some(start) = inner.single.as_ref().filter(|start| start.only_triangles) {
            let query = self.query.inside(inner, context);
            outcome = test_triangles::<G, L, FILTERED>(start, &placed, ray, range, query);
        }
        let found = match outcome {
            Outcome::Certain(found) => found,
            Outcome::Uncertain => {
                test_any_tree::<G, FILTERED>(L::level(), &placed, ray, range, &self.query, context)
            }
        };
        match found {
            Found { winner: None, .. } => None,
            _ if G::IS_ANY => Some(Stop::Hit),
            found => self.test_found(found, inner, context, ray, slabs),
        }
    }

    /// Takes what was found in the tree of an instance, if it is the closest.
    #[inline(always)]
    fn test_found(
        &mut self,
        found: Found,
        inner: &Accel,
        context: ContextRef,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let Winner { root, .. } = found.winner?;
        let heights @ (from, to) = heights(root.t, largest_component(ray));
        if from > self.best.to {
            return None;
        }
        let hit = found.into_hit(inner, context)?;
        let is_closer = to < self.best.from
            || match (self.exact(), &self.in_instance) {
                (Some(Winner { geometry: IN_INSTANCE, .. }), Some(best)) => comes_before(&hit, best),
                (exact, _) => {
                    match self.decider.is_closer(ray, root.t, (IN_INSTANCE, 0), &self.best, exact) {
                        Outcome::Certain(is_closer) => is_closer,
                        Outcome::Uncertain => return Some(Stop::Uncertain),
                    }
                }
            };
        if is_closer {
            self.in_instance = Some(hit);
            self.keep_exact(Winner { root, geometry: IN_INSTANCE, primitive: 0 }, heights, slabs);
        }
        None
    }
}

/// Traverses a placed tree of triangles, with the instruction set of the traversal around it.
#[inline(always)]
fn test_triangles<G: Goal, L: Lanes, const FILTERED: bool>(
    start: &SingleStart,
    placed: &Placed,
    ray: &Ray,
    range: [f64; 2],
    query: TreeQuery,
) -> Outcome<Found> {
    let mut moving = None;
    let map = placed.instance.world_from_object.map_at(ray.time, &mut moving);
    let (ray, slabs) = L::start_placed(start, map, ray, range);
    let Some(slabs) = slabs else { return Outcome::Uncertain };
    let (accel, root, ray) = (&*placed.instance.accel, placed.from.below(start.root), &ray);
    Traversal::<G, false, FILTERED> { accel, start, root, ray, query, goal: PhantomData }.run_from::<L>(slabs)
}

/// Traverses any placed tree; where single precision cannot tell, exactly.
#[inline(never)]
fn test_any_tree<G: Goal, const FILTERED: bool>(
    level: Level,
    placed: &Placed,
    ray: &Ray,
    [t_min, t_max]: [f64; 2],
    query: &TreeQuery,
    context: ContextRef,
) -> Found {
    let accel = &*placed.instance.accel;
    let ray = &placed.instance.world_from_object.object_ray(ray).with_range(t_min, t_max);
    let context = &context.to_context();
    if let Some(start) = accel.single.as_ref().filter(|start| !start.only_triangles) {
        let (root, query) = (placed.from.below(start.root), query.inside(accel, ContextRef::of(context)));
        let traversal = Traversal::<G, true, FILTERED> { accel, start, root, ray, query, goal: PhantomData };
        if let Outcome::Certain(found) = level.run(traversal) {
            return found;
        }
    }
    if G::IS_ANY {
        Found::some(exact::any_from(level, accel, placed.from, context, ray, query.query()))
    } else {
        Found::of_hit(exact::closest_from(level, accel, placed.from, context, ray, query.query()))
    }
}

/// Whether a hit comes before another in an instance.
#[cold]
#[inline(never)]
fn comes_before(hit: &Hit, other: &Hit) -> bool {
    let ids = |hit: &Hit| (hit.geometry, hit.primitive);
    let order = hit.root.t.partial_cmp(&other.root.t).unwrap_or(Ordering::Equal);
    order.then_with(|| hit.route.cmp(&other.route)).then_with(|| ids(hit).cmp(&ids(other))) == Ordering::Less
}
