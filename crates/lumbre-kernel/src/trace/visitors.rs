//! The visitors of the exact traversal: the closest hit, any hit, the number of hits, and the next hits.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use lumbre_geometry::Ray;

use super::visitor::{Crossing, Visitor, Wanted};
use crate::hit::Hit;
use crate::query::Query;
use crate::trace::tree_query::TreeQuery;
use crate::tree::Tree;

use super::ContextRef;

// `t` is never NaN here, and both zeros are the same place.
fn by_t(a: f64, b: f64) -> Ordering {
    a.partial_cmp(&b).unwrap_or(Ordering::Equal)
}

/// Whether a query accepts a crossing.
fn takes(query: Option<&Query>, crossing: &Crossing) -> bool {
    let Some(query) = query else { return true };
    let &Crossing { root, geometry, primitive, tree, context, .. } = crossing;
    let query = TreeQuery::new(query, tree, ContextRef::of(context));
    query.has_primitive(geometry, primitive)
        && (query.takes_both_faces() || query.takes_face(crossing.is_front()))
        && query.accepts(&super::Winner { root, geometry, primitive })
}

/// Whether a query wants anything in an instance.
fn enters(query: Option<&Query>, tree: &Tree, geometry: u32) -> bool {
    query.is_none_or(|query| TreeQuery::new(query, tree, ContextRef::OUTSIDE).has_mask(geometry))
}

/// Without a query, the first crossing of a primitive suffices.
fn wanted_for_one(query: Option<&Query>) -> Wanted {
    if query.is_none() { Wanted::First } else { Wanted::Every }
}

/// The closest hit.
pub(crate) struct Closest<'q> {
    best: Option<Hit>,
    /// Whether the ray enters at the best hit.
    enters: bool,
    range: [f64; 2],
    query: Option<&'q Query<'q>>,
}

impl<'q> Closest<'q> {
    pub(crate) fn new(ray: &Ray, query: Option<&'q Query<'q>>) -> Self {
        Self { best: None, enters: false, range: [ray.t_min, ray.t_max], query }
    }

    pub(crate) fn into_hit(self) -> Option<Hit> {
        self.best
    }
}

impl Visitor for Closest<'_> {
    fn wanted(&self) -> Wanted {
        wanted_for_one(self.query)
    }

    fn range(&self) -> [f64; 2] {
        self.range
    }

    fn enters(&self, tree: &Tree, geometry: u32) -> bool {
        enters(self.query, tree, geometry)
    }

    fn visit(&mut self, crossing: &Crossing) -> bool {
        let &Crossing { root, geometry, primitive, context, .. } = crossing;
        let is_closer = root.t <= self.range[1]
            && match &self.best {
                Some(best) if root.t == self.range[1] => {
                    let order =
                        self.enters.cmp(&crossing.enters()).then_with(|| context.route.cmp(&best.route));
                    order.then_with(|| (geometry, primitive).cmp(&(best.geometry, best.primitive)))
                        == Ordering::Less
                }
                _ => true,
            };
        if is_closer && takes(self.query, crossing) {
            self.range[1] = root.t;
            self.enters = crossing.enters();
            self.best = Some(crossing.to_hit());
        }
        false
    }
}

/// Whether there is a hit.
pub(crate) struct Any<'q> {
    pub(crate) is_hit: bool,
    range: [f64; 2],
    query: Option<&'q Query<'q>>,
}

impl<'q> Any<'q> {
    pub(crate) fn new(ray: &Ray, query: Option<&'q Query<'q>>) -> Self {
        Self { is_hit: false, range: [ray.t_min, ray.t_max], query }
    }
}

impl Visitor for Any<'_> {
    fn wanted(&self) -> Wanted {
        wanted_for_one(self.query)
    }

    fn range(&self) -> [f64; 2] {
        self.range
    }

    fn enters(&self, tree: &Tree, geometry: u32) -> bool {
        enters(self.query, tree, geometry)
    }

    fn visit(&mut self, crossing: &Crossing) -> bool {
        self.is_hit = takes(self.query, crossing);
        self.is_hit
    }
}

/// The number of hits.
pub(crate) struct Count {
    pub(crate) hits: usize,
    range: [f64; 2],
}

impl Count {
    pub(crate) fn new(ray: &Ray) -> Self {
        Self { hits: 0, range: [ray.t_min, ray.t_max] }
    }
}

impl Visitor for Count {
    fn wanted(&self) -> Wanted {
        Wanted::Every
    }

    fn range(&self) -> [f64; 2] {
        self.range
    }

    fn visit(&mut self, _: &Crossing) -> bool {
        self.hits += 1;
        false
    }
}

/// The next hits after a given one, nearest first, in bounded memory.
pub(crate) struct NextHits<'a> {
    nearest: BinaryHeap<Ranked>,
    size: usize,
    after: Option<&'a Ranked>,
    range: [f64; 2],
}

/// A hit and everything its order depends on.
#[derive(Debug)]
pub(crate) struct Ranked {
    pub(crate) hit: Hit,
    enters: bool,
    // Which of the primitive's crossings: a shape may be crossed twice at the same t.
    order: u32,
}

impl Ord for Ranked {
    fn cmp(&self, other: &Self) -> Ordering {
        let ids = |ranked: &Self| (ranked.hit.geometry, ranked.hit.primitive, ranked.order);
        by_t(self.hit.root.t, other.hit.root.t)
            .then(other.enters.cmp(&self.enters))
            .then_with(|| self.hit.route.cmp(&other.hit.route))
            .then_with(|| ids(self).cmp(&ids(other)))
    }
}

impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ranked {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Ranked {}

impl<'a> NextHits<'a> {
    pub(crate) fn new(ray: &Ray, size: usize, after: Option<&'a Ranked>) -> Self {
        let first = after.map_or(ray.t_min, |after| after.hit.root.t);
        Self { nearest: BinaryHeap::new(), size, after, range: [first, ray.t_max] }
    }

    /// The hits in order, and whether there may be more.
    pub(crate) fn into_hits(self) -> (Vec<Ranked>, bool) {
        let is_full = self.nearest.len() == self.size;
        (self.nearest.into_sorted_vec(), is_full)
    }
}

impl Visitor for NextHits<'_> {
    fn wanted(&self) -> Wanted {
        Wanted::Every
    }

    fn range(&self) -> [f64; 2] {
        self.range
    }

    fn visit(&mut self, crossing: &Crossing) -> bool {
        let t = crossing.root.t;
        if t < self.range[0] || self.range[1] < t {
            return false;
        }
        let ranked = Ranked { hit: crossing.to_hit(), enters: crossing.enters(), order: crossing.order };
        if self.after.is_some_and(|after| ranked <= *after) {
            return false;
        }
        self.nearest.push(ranked);
        if self.nearest.len() > self.size {
            self.nearest.pop();
        }
        if self.nearest.len() == self.size
            && let Some(farthest) = self.nearest.peek()
        {
            self.range[1] = farthest.hit.root.t;
        }
        false
    }
}
