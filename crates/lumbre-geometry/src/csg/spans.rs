//! Span arithmetic: merges the crossings of all leaves along a line into those of the result.

use lumbre_math::DVec3;
use rustc_hash::FxHashMap;
use smallvec::{SmallVec, smallvec};

use super::leaf::shape_contains;
use super::tree::{Node, NodeKind};
use super::{Crossings, Csg, Leaf};
use crate::{Aabb, Ray, Root, Roots};

/// A crossing of one leaf.
#[derive(Clone, Copy)]
pub(crate) struct Event {
    pub(crate) root: Root,
    pub(crate) leaf: u32,
    pub(crate) enters: bool,
}

pub(crate) type Events = SmallVec<[Event; 16]>;

/// Crossings closer than this, relative to the coordinates involved, count as one.
const COINCIDENT: f64 = 256.0 * f64::EPSILON;

impl Csg {
    /// Calls `emit` with every crossing of the result in the ray's range, in order, until it returns false.
    pub(super) fn sweep(&self, ray: &Ray, mut emit: impl FnMut(Root) -> bool) {
        let mut membership = Membership::new(self);
        let mut events = Events::new();
        if self.gather(ray, &mut membership, &mut events, |_| {}).is_none() {
            return;
        }
        let mut rest = &events[..];
        while let Some((group, later)) = coincident(ray, rest) {
            if group[0].root.t > ray.t_max {
                return;
            }
            rest = later;
            if let Some(root) = membership.cross_group(group)
                && ray.contains(root.t)
                && !emit(root)
            {
                return;
            }
        }
    }

    /// Collects the crossings of all relevant leaves, in order; `None` when the result is empty within the
    /// ray's range.
    ///
    /// A leaf whose box the ray misses is empty along the whole range, and so is every intersection that
    /// contains it. Calls `look` with every leaf that is looked at.
    #[inline]
    pub(crate) fn gather(
        &self,
        ray: &Ray,
        membership: &mut Membership,
        events: &mut Events,
        mut look: impl FnMut(u32),
    ) -> Option<()> {
        let inverse = ray.direction.recip();
        let mut i = 0;
        while let Some(node) = self.nodes.get(i) {
            let is_empty = match (node.bounds, node.kind) {
                (Some(bounds), _) if !overlaps(&bounds, ray, inverse) => true,
                (_, NodeKind::Leaf(leaf)) => {
                    look(leaf);
                    !self.leaf_crossings(leaf, ray, membership, events)
                }
                _ => false,
            };
            i = if is_empty {
                self.after_empty(i)?
            } else if matches!(node.kind, NodeKind::Leaf(_)) {
                node.end as usize
            } else {
                i + 1
            };
        }
        events.sort_by(|a: &Event, b: &Event| a.root.t.total_cmp(&b.root.t).then(a.leaf.cmp(&b.leaf)));
        Some(())
    }

    /// The node to continue with when node `i` is empty along the ray; `None` when then the whole result is.
    fn after_empty(&self, mut i: usize) -> Option<usize> {
        loop {
            let node = &self.nodes[i];
            let parent = node.parent? as usize;
            let decides = match self.nodes[parent].kind {
                NodeKind::Intersection => true,
                NodeKind::Difference => !node.is_subtracted,
                _ => false,
            };
            if !decides {
                return Some(node.end as usize);
            }
            i = parent;
        }
    }

    /// A root of a leaf as a simple one of this shape.
    #[inline]
    pub(crate) fn encoded(&self, leaf: usize, root: &Root) -> Root {
        let (first_part, flipped) = (self.first_part[leaf], self.leaf_nodes[leaf].1);
        let part = first_part.saturating_add(root.part) << 1 | u32::from(flipped);
        Root { part, multiplicity: 1, ..*root }
    }

    /// Appends the crossings of a leaf; false when the whole line is outside of it.
    fn leaf_crossings(&self, leaf: u32, ray: &Ray, membership: &mut Membership, events: &mut Events) -> bool {
        let encode = |root: &Root| self.encoded(leaf as usize, root);
        let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
        let before = events.len();
        match &self.leaves[leaf as usize] {
            Leaf::Shape(shape) => {
                let mut roots = Roots::new();
                shape.roots(&line, &mut roots);
                // A touch is not a crossing.
                let crosses = |root: &&Root| root.multiplicity % 2 == 1 && root.t.is_finite();
                let mut inside = self.is_unbounded(leaf)
                    && match roots.iter().find(crosses) {
                        Some(first) => shape.surface(&line, first).normal.dot(line.direction) > 0.0,
                        None => shape_contains(shape, line.origin),
                    };
                if inside {
                    membership.cross(leaf, true);
                }
                let started_inside = inside;
                for root in roots.iter().filter(crosses) {
                    inside = !inside;
                    events.push(Event { root: encode(root), leaf, enters: inside });
                }
                let is_odd = inside && !self.is_unbounded(leaf);
                if is_odd {
                    // Rounding turned a touch into a crossing. It is one of the last two, which coincide.
                    events.pop();
                }
                started_inside || events.len() > before
            }
            Leaf::Solid { solid, world_from_object } => {
                let mut crossings = Crossings::new();
                let line = world_from_object.as_ref().map_or(line, |m| line.into_object(m));
                solid.crossings(&line, &mut crossings);
                let finite = crossings.iter().filter(|c| c.root.t.is_finite());
                events.extend(finite.map(|c| Event { root: encode(&c.root), leaf, enters: c.enters }));
                events.len() > before
            }
        }
    }
}

/// The first crossing and all that coincide with it, and the later ones; `None` after the last.
#[inline]
pub(crate) fn coincident<'a>(ray: &Ray, events: &'a [Event]) -> Option<(&'a [Event], &'a [Event])> {
    let t = events.first()?.root.t;
    let (origin, direction) = (ray.origin.abs().max_element(), ray.direction.abs().max_element());
    let reach = t + COINCIDENT * (origin / direction + t.abs());
    let together = 1 + events[1..].iter().take_while(|event| event.root.t <= reach).count();
    Some(events.split_at(together))
}

/// Whether the ray's range overlaps a box; true when in doubt.
#[inline]
fn overlaps(bounds: &Aabb, ray: &Ray, inverse: DVec3) -> bool {
    let (mut near, mut far) = (ray.t_min, ray.t_max);
    for axis in 0..3 {
        let a = (bounds.min[axis] - ray.origin[axis]) * inverse[axis];
        let b = (bounds.max[axis] - ray.origin[axis]) * inverse[axis];
        if a.is_nan() || b.is_nan() {
            // Parallel to the face, and in its plane.
            continue;
        }
        // A bound on the rounding error of the two operations.
        let slack = 4.0 * f64::EPSILON * a.abs().max(b.abs());
        let slack = if slack.is_finite() { slack } else { 0.0 };
        near = near.max(a.min(b) - slack);
        far = far.min(a.max(b) + slack);
    }
    near <= far
}

/// The leaves and nodes that contain the current point of the line.
pub(crate) struct Membership<'a> {
    csg: &'a Csg,
    // For each leaf, how many more times it has been entered than left.
    nesting: Numbers<i32>,
    // For each node, how many of its operands count towards it, minus those that count outside every leaf.
    counts: Numbers<i32>,
}

/// A number for each of many things, at first zero: all of them, or only the changed ones if a line meets few of many.
enum Numbers<T> {
    All(SmallVec<[T; 32]>),
    Changed(FxHashMap<u32, T>),
}

/// Things up to which a number for each is made for every ray.
const FEW: usize = 256;

impl<T: Copy + Default> Numbers<T> {
    fn new(count: usize) -> Self {
        if count <= FEW {
            Self::All(smallvec![T::default(); count])
        } else {
            Self::Changed(FxHashMap::default())
        }
    }

    #[inline]
    fn get(&self, i: u32) -> T {
        match self {
            Self::All(all) => all[i as usize],
            Self::Changed(changed) => changed.get(&i).copied().unwrap_or_default(),
        }
    }

    #[inline]
    fn set(&mut self, i: u32, number: T) {
        match self {
            Self::All(all) => all[i as usize] = number,
            Self::Changed(changed) => drop(changed.insert(i, number)),
        }
    }
}

impl<'a> Membership<'a> {
    pub(crate) fn new(csg: &'a Csg) -> Self {
        Self { csg, nesting: Numbers::new(csg.leaves.len()), counts: Numbers::new(csg.nodes.len()) }
    }

    pub(crate) fn contains(&self, node: u32) -> bool {
        let Node { initial, needed, .. } = self.csg.nodes[node as usize];
        i64::from(initial) + i64::from(self.counts.get(node)) >= i64::from(needed)
    }

    /// Whether the current point is inside a leaf.
    pub(crate) fn is_inside(&self, leaf: u32) -> bool {
        self.nesting.get(leaf) > 0
    }

    /// Enters or leaves a leaf, and updates its ancestors as far as they change.
    pub(crate) fn cross(&mut self, leaf: u32, enters: bool) {
        let before = self.nesting.get(leaf);
        let now = before + if enters { 1 } else { -1 };
        self.nesting.set(leaf, now);
        let mut is_inside = now > 0;
        if (before > 0) == is_inside {
            return;
        }
        let mut i = self.csg.leaf_nodes[leaf as usize].0;
        self.counts.set(i, i32::from(is_inside));
        while let Node { parent: Some(parent), is_subtracted, .. } = self.csg.nodes[i as usize] {
            let counts_for = is_inside != is_subtracted;
            let was_inside = self.contains(parent);
            self.counts.set(parent, self.counts.get(parent) + if counts_for { 1 } else { -1 });
            is_inside = self.contains(parent);
            if is_inside == was_inside {
                return;
            }
            i = parent;
        }
    }

    /// Passes a group of coincident crossings; returns a root when the result begins or ends there.
    pub(crate) fn cross_group(&mut self, group: &[Event]) -> Option<Root> {
        let was_inside = self.contains(0);
        // The surface belongs to a crossing that is sufficient alone, or else to one that is necessary.
        let mut decisive = None;
        if group.len() > 1 {
            decisive = self.decisive(group, was_inside);
        }
        for event in group {
            self.cross(event.leaf, event.enters);
        }
        let is_inside = self.contains(0);
        if is_inside == was_inside {
            return None;
        }
        if decisive.is_none() && group.len() > 1 {
            // Undoing a crossing is passing it backwards.
            let backwards: SmallVec<[Event; 8]> =
                group.iter().map(|event| Event { enters: !event.enters, ..*event }).collect();
            decisive = self.decisive(&backwards, is_inside);
        }
        let agrees =
            |event: &&Event| (event.enters != self.csg.leaf_nodes[event.leaf as usize].1) == is_inside;
        let chosen = match decisive {
            Some(i) => group.get(i),
            None => group.iter().filter(agrees).min_by_key(|event| event.leaf),
        };
        chosen.or(group.first()).map(|event| event.root)
    }

    /// The crossing of the first leaf among those that alone change whether the point is inside the
    /// result.
    fn decisive(&mut self, group: &[Event], was_inside: bool) -> Option<usize> {
        let mut found: Option<usize> = None;
        for (i, event) in group.iter().enumerate() {
            self.cross(event.leaf, event.enters);
            let decides = self.contains(0) != was_inside;
            self.cross(event.leaf, !event.enters);
            if decides && found.is_none_or(|best| event.leaf < group[best].leaf) {
                found = Some(i);
            }
        }
        found
    }
}
