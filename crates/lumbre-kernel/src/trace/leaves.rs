//! A ray in the leaves of a tree: one method for each kind.
//!
//! Start reading at [`FilteredRay::test_leaf`]; [`FilteredRay::closest_triangle`] intersects triangles.

use std::marker::PhantomData;

use lumbre_geometry::{PatchCrossings, Ray, Root};

use super::cloud_ray::CloudRay;
use super::decide::{Candidate, enters, heights};
use super::edges::{self, Patch};
use super::filtered_ray::{FilteredGoal, FilteredRay};
use super::stack::Goal;
use super::{
    IN_INSTANCE, Outcome, Stop, Winner, all_crossings, first_crossing, is_crossed, largest_component,
    meets_front,
};
use crate::intersect::box_ray::Slabs;
use crate::intersect::watertight::Meeting;
use crate::intersect::{self, BoundingHits, Crossings, Dispatch, Isa, Simd};
use crate::simd;
use crate::trace::tree_query::TreeQuery;
use crate::tree::BLOCK;
use crate::tree::bounding_block::BoundingVolumeRay;
use crate::tree::node::tag;
use crate::tree::packed::Entry;
use crate::tree::triangle_block::TriangleBlock;
use crate::tree::{GeometryKind, Tree};

impl<'a, const GENERAL: bool, const FILTERED: bool> FilteredRay<'a, '_, GENERAL, FILTERED> {
    /// Tests a leaf.
    #[inline(always)]
    pub(crate) fn test_leaf<G: FilteredGoal, L: Simd>(
        &mut self,
        leaf: u32,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        if !GENERAL || tag::of(leaf) == tag::TRIANGLES {
            return self.test_triangles::<G, L>(leaf, ray, slabs);
        }
        if tag::of(leaf) == tag::SHAPES {
            return self.test_shapes::<G, L>(leaf, ray, slabs);
        }
        // Opaque: keeps computations on the ray from being hoisted out of this leaf.
        let ray = simd::opaque(ray);
        match tag::of(leaf) {
            tag::SPHERES => {
                let goal = PhantomData::<G>;
                L::isa().run(TestSpheres { filtered: self, leaf, ray, slabs, goal })
            }
            tag::PRECISE => self.test_precise::<G>(leaf, ray, slabs),
            tag::INSTANCE => {
                let entry = &self.tree().packed.entries[tag::place(leaf)];
                self.test_instance::<G, L>(entry, ray, slabs)
            }
            _ => self.test_entries::<G>(leaf, ray, slabs),
        }
    }

    /// Tests the unbounded geometry outside the tree.
    #[inline(always)]
    pub(crate) fn test_infinite<G: FilteredGoal, L: Simd>(
        &mut self,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let tree = self.tree();
        for entry in &*tree.infinite {
            let stop = match tree.geometries[entry.geometry as usize].kind {
                GeometryKind::Instance(_) => self.test_instance::<G, L>(entry, ray, slabs),
                _ => self.test_entry::<G>(entry, ray, slabs),
            };
            if stop.is_some() {
                return stop;
            }
        }
        None
    }

    #[inline(always)]
    fn tree(&self) -> &'a Tree {
        self.decider.tree()
    }

    /// Tests a leaf of triangles, eight at a time.
    #[inline(always)]
    fn test_triangles<G: Goal, L: Simd>(&mut self, leaf: u32, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        // At least one block, and mostly only one.
        let mut place = leaf & tag::PLACE;
        loop {
            let block = self.decider.block(place);
            let (mask, edges) = L::intersect_triangles(block, simd::opaque(&self.blocks));
            if mask != 0 {
                let crossings = edges.place(&self.blocks);
                let stop = if G::IS_ANY {
                    self.any_triangle::<L>((place, block), mask, &crossings, ray)
                } else {
                    self.closest_triangle::<L>((place, block), mask, &crossings, ray, slabs)
                };
                if stop.is_some() {
                    return stop;
                }
            }
            match block.next(place) {
                Some(next) => place = next,
                None => return None,
            }
        }
    }

    /// Takes the closest of a block's triangles whose lines the ray may pass.
    #[inline(always)]
    fn closest_triangle<L: Simd>(
        &mut self,
        (place, block): (u32, &TriangleBlock),
        mask: u32,
        crossings: &Crossings<L::F32x8>,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let mut rest = mask & crossings.in_range;
        if rest != 0 && mask & (mask - 1) == 0 {
            // A single candidate is known before its range test ends: the winner need not wait for that.
            rest = simd::opaque_number(mask);
        }
        while rest != 0 {
            let lane = rest.trailing_zeros();
            let is_certain = crossings.sure >> lane & 1 != 0;
            rest &= rest - 1;
            let (from, to) = crossings.between(lane as usize);
            if FILTERED {
                if from > self.best.to {
                    continue;
                }
                match self.query_triangle::<L>((place, lane), ray) {
                    Outcome::Certain(Some(winner)) => {
                        self.keep_exact(winner, heights(winner.root.t, largest_component(ray)), slabs);
                    }
                    Outcome::Certain(None) => {}
                    Outcome::Uncertain => return Some(Stop::Uncertain),
                }
            } else if is_certain && to < self.best.from {
                self.keep(Candidate { block: place, lane, from, to }, slabs);
            } else if from > self.best.to || self.decider.misses::<L>(ray, self.blocks.axes, block, lane) {
                // Missed or farther; false for NaN.
                continue;
            } else {
                match self.compare(L::isa(), ray, place, lane) {
                    Outcome::Certain(Some(closer)) => self.keep(closer, slabs),
                    Outcome::Certain(None) => {}
                    Outcome::Uncertain => return Some(Stop::Uncertain),
                }
            }
        }
        None
    }

    /// Whether any of the triangles of a block is hit.
    #[inline(always)]
    fn any_triangle<L: Simd>(
        &self,
        (place, block): (u32, &TriangleBlock),
        mask: u32,
        crossings: &Crossings<L::F32x8>,
        ray: &Ray,
    ) -> Option<Stop> {
        if !FILTERED && mask & crossings.sure != 0 {
            return Some(Stop::Hit);
        }
        let mut rest = mask & crossings.in_range;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            if FILTERED {
                match self.query_triangle::<L>((place, lane), ray) {
                    Outcome::Certain(Some(_)) => return Some(Stop::Hit),
                    Outcome::Certain(None) => continue,
                    Outcome::Uncertain => return Some(Stop::Uncertain),
                }
            }
            if self.decider.misses::<L>(ray, self.blocks.axes, block, lane) {
                continue;
            }
            match self.decider.intersect(ray, place, lane) {
                Meeting::Miss => {}
                Meeting::Hit { .. } => return Some(Stop::Hit),
                Meeting::Touch { .. } => return Some(Stop::Uncertain),
            }
        }
        None
    }

    /// The crossing of a triangle, if it is the closest that the query accepts.
    #[inline(always)]
    fn query_triangle<L: Simd>(&self, (place, lane): (u32, u32), ray: &Ray) -> Outcome<Option<Winner>> {
        let (geometry, primitive) = self.decider.ids(place, lane);
        let Some(query) = self.query.filter(|query| query.has_primitive(geometry, primitive)) else {
            return Outcome::Certain(None);
        };
        let (winner, is_front) = match self.decider.crossing::<L>(ray, self.blocks.axes, place, lane) {
            Outcome::Certain(Some(found)) => found,
            Outcome::Certain(None) => return Outcome::Certain(None),
            Outcome::Uncertain => return Outcome::Uncertain,
        };
        let is_closest = match self.exact() {
            // The order of two hits at the same `t` depends on their faces.
            Some(best) if winner.root.t == best.root.t => return Outcome::Uncertain,
            best => best.is_none_or(|best| winner.root.t < best.root.t),
        };
        let is_taken = is_closest && query.takes_face(is_front) && query.accepts(&winner);
        Outcome::Certain(is_taken.then_some(winner))
    }

    /// Compares a triangle that may be hit with the best, in double precision. Out of line, to keep the surrounding
    /// loop small.
    #[cold]
    #[inline(never)]
    fn compare(&self, isa: Isa, ray: &Ray, block: u32, lane: u32) -> Outcome<Option<Candidate>> {
        let (decider, axes, best) = (self.decider, self.blocks.axes, (&self.best, self.exact()));
        if let Some(t) = self.exact().filter(|best| best.geometry == IN_INSTANCE).map(|best| best.root.t)
            && let Meeting::Hit { root, is_front } = decider.intersect(ray, block, lane)
            && root.t == t
        {
            let (from, to) = heights(t, largest_component(ray));
            return match self.precedes_instance(ray, Some(is_front), decider.ids(block, lane)) {
                Outcome::Certain(is_first) => {
                    Outcome::Certain(is_first.then_some(Candidate { block, lane, from, to }))
                }
                Outcome::Uncertain => Outcome::Uncertain,
            };
        }
        match isa.run(Comparison { decider, ray, axes, triangle: (block, lane), best }) {
            Outcome::Certain(Some(t)) => {
                let (from, to) = heights(t, largest_component(ray));
                Outcome::Certain(Some(Candidate { block, lane, from, to }))
            }
            Outcome::Certain(None) => Outcome::Certain(None),
            Outcome::Uncertain => Outcome::Uncertain,
        }
    }

    /// Tests the shapes of a leaf whose bounding volumes are hit, the nearest first.
    #[inline(always)]
    fn test_shapes<G: Goal, L: Simd>(&mut self, leaf: u32, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        let tree = self.tree();
        let make = || BoundingVolumeRay::new(&tree.tree_space, ray, largest_component(ray));
        let bounding_volumes = *self.bounding_volumes.get_or_insert_with(make);
        let mut first = tag::place(leaf);
        loop {
            let Some((block, goes_on)) = tree.bounding_volumes.block(first) else {
                return self.test_entries::<G>(leaf, ray, slabs);
            };
            let entries = &tree.packed.entries[first..];
            let range = &self.blocks.range;
            let BoundingHits { mut mask, sure, near } = if G::IS_ANY && !FILTERED {
                intersect::intersect_bounding_volumes::<L, true>(
                    block,
                    simd::opaque(&bounding_volumes),
                    range,
                )
            } else {
                intersect::intersect_bounding_volumes::<L, false>(
                    block,
                    simd::opaque(&bounding_volumes),
                    range,
                )
            };
            if G::IS_ANY && !FILTERED && sure != 0 {
                return Some(Stop::Hit);
            }
            while mask != 0 {
                let lane =
                    if G::IS_ANY { mask.trailing_zeros() as usize % BLOCK } else { nearest_of(mask, &near) };
                mask &= !(1 << lane);
                if !G::IS_ANY && near[lane] > self.blocks.range.last {
                    continue;
                }
                let stop = self.test_entry::<G>(&entries[lane], ray, slabs);
                if stop.is_some() {
                    return stop;
                }
            }
            if !goes_on {
                return None;
            }
            first += BLOCK;
        }
    }

    /// Tests a leaf of user geometry, or of shapes one by one.
    #[inline(always)]
    fn test_entries<G: Goal>(&mut self, leaf: u32, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        for entry in &self.tree().packed.entries[tag::place(leaf)..] {
            let stop = self.test_entry::<G>(entry, ray, slabs);
            if stop.is_some() || entry.is_last() {
                return stop;
            }
        }
        None
    }

    /// Tests a shape, or a primitive of user geometry.
    #[inline(always)]
    fn test_entry<G: Goal>(&mut self, entry: &Entry, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        let (geometry, primitive) = (entry.geometry, entry.primitive());
        let kind = &self.tree().geometries[geometry as usize].kind;
        if let Some(patch) = Patch::of(kind) {
            return self.test_patch::<G>(patch, geometry, ray, slabs);
        }
        if FILTERED {
            return self.query_crossings::<G>(kind, (geometry, primitive), ray, slabs);
        }
        if G::IS_ANY {
            return is_crossed(kind, primitive, ray).then_some(Stop::Hit);
        }
        self.test_root(first_crossing(kind, primitive, ray)?, || (geometry, primitive), ray, slabs)
    }

    /// Tests a bilinear patch.
    #[inline(never)]
    fn test_patch<G: Goal>(
        &mut self,
        patch: Patch,
        geometry: u32,
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let PatchCrossings { of_line, is_edge_on } = patch.line_crossings(ray);
        if is_edge_on || of_line.iter().any(|crossing| crossing.place.is_some()) {
            return Some(Stop::Uncertain);
        }
        if FILTERED {
            let kind = &self.tree().geometries[geometry as usize].kind;
            return self.query_crossings::<G>(kind, (geometry, 0), ray, slabs);
        }
        let root = of_line.iter().map(|crossing| crossing.root).find(|root| ray.contains(root.t))?;
        if G::IS_ANY {
            return Some(Stop::Hit);
        }
        self.test_root(root, || (geometry, 0), ray, slabs)
    }

    /// Takes a crossing in double precision, if it is the closest.
    #[inline(always)]
    pub(super) fn test_root(
        &mut self,
        root: Root,
        ids: impl Fn() -> (u32, u32),
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        if let Some(best) = self.exact().filter(|best| best.geometry == IN_INSTANCE && root.t == best.root.t)
        {
            let (geometry, primitive) = ids();
            let winner = Winner { root, geometry, primitive };
            return match self.precedes_instance(ray, enters(self.tree(), ray, &[], &winner), ids()) {
                Outcome::Certain(true) => {
                    self.keep_exact(winner, heights(best.root.t, largest_component(ray)), slabs);
                    None
                }
                Outcome::Certain(false) => None,
                Outcome::Uncertain => Some(Stop::Uncertain),
            };
        }
        match self.decider.compare_exact(ray, root, &ids, (&self.best, self.exact())) {
            Outcome::Certain(Some(heights)) => {
                let (geometry, primitive) = ids();
                self.keep_exact(Winner { root, geometry, primitive }, heights, slabs);
            }
            Outcome::Certain(None) => {}
            Outcome::Uncertain => return Some(Stop::Uncertain),
        }
        None
    }

    /// Takes the closest crossing that the query accepts, or ends at any.
    #[inline(never)]
    fn query_crossings<G: Goal>(
        &mut self,
        kind: &GeometryKind,
        (geometry, primitive): (u32, u32),
        ray: &Ray,
        slabs: &mut Slabs,
    ) -> Option<Stop> {
        let query = self.query.filter(|query| query.has_primitive(geometry, primitive))?;
        for root in all_crossings(kind, primitive, ray) {
            let winner = Winner { root, geometry, primitive };
            let is_closest = match self.exact() {
                // As above; the primitive's own crossings are in order.
                Some(best) if root.t == best.root.t => {
                    if (best.geometry, best.primitive) != (geometry, primitive) {
                        return Some(Stop::Uncertain);
                    }
                    false
                }
                best => best.is_none_or(|best| root.t < best.root.t),
            };
            let is_taken = ray.contains(root.t)
                && is_closest
                && (query.takes_both_faces() || query.takes_face(meets_front(kind, primitive, ray, &root)))
                && query.accepts(&winner);
            if is_taken && G::IS_ANY {
                return Some(Stop::Hit);
            }
            if is_taken {
                self.keep_exact(winner, heights(root.t, largest_component(ray)), slabs);
            }
        }
        None
    }

    /// Tests a leaf of spheres of clouds, eight at a time.
    #[inline(always)]
    fn test_spheres<G: Goal, L: Simd>(&mut self, leaf: u32, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        let tree = self.tree();
        let places = tag::blocks(leaf);
        let range = [ray.t_min, if G::IS_ANY { ray.t_max } else { self.best.limit(ray) }];
        for (ids, block) in
            tree.packed.sphere_ids[places.clone()].iter().zip(&tree.packed.sphere_blocks[places])
        {
            let cloud = CloudRay::turn(&mut self.cloud, tree, ray, ids.geometry);
            let origin = cloud.origin();
            let (mut mask, certain) = match cloud.within(range) {
                Some(spheres) => intersect::intersect_spheres::<L>(block, spheres),
                None => (ids.lanes(), 0),
            };
            if G::IS_ANY && !FILTERED && certain != 0 {
                return Some(Stop::Hit);
            }
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize % BLOCK;
                mask &= mask - 1;
                let stop = if FILTERED {
                    let kind = &tree.geometries[ids.geometry as usize].kind;
                    self.query_crossings::<G>(kind, (ids.geometry, ids.primitives[lane]), ray, slabs)
                } else {
                    match block.sphere(lane, &origin).closest(ray) {
                        Some(_) if G::IS_ANY => Some(Stop::Hit),
                        Some(root) => {
                            self.test_root(root, || (ids.geometry, ids.primitives[lane]), ray, slabs)
                        }
                        None => None,
                    }
                };
                if stop.is_some() {
                    return stop;
                }
            }
        }
        None
    }

    /// Tests a leaf of triangles in double precision.
    #[inline(never)]
    fn test_precise<G: Goal>(&mut self, leaf: u32, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        let tree = self.tree();
        for entry in &tree.packed.entries[tag::place(leaf)..] {
            let (geometry, primitive) = (entry.geometry, entry.primitive());
            if self.query.is_none_or(|query| query.has_primitive(geometry, primitive)) {
                match edges::intersect_precise(tree, ray, geometry, primitive) {
                    Meeting::Miss => {}
                    Meeting::Touch { .. } => return Some(Stop::Uncertain),
                    Meeting::Hit { root, is_front } => {
                        let winner = Winner { root, geometry, primitive };
                        let takes = |query: &TreeQuery| query.takes_face(is_front) && query.accepts(&winner);
                        let is_taken = self.query.is_none_or(takes);
                        let stop = match (is_taken, G::IS_ANY) {
                            (false, _) => None,
                            (true, true) => Some(Stop::Hit),
                            (true, false) => self.test_root(root, || (geometry, primitive), ray, slabs),
                        };
                        if stop.is_some() {
                            return stop;
                        }
                    }
                }
            }
            if entry.is_last() {
                break;
            }
        }
        None
    }
}

/// [`FilteredRay::test_spheres`] out of line: it is long, and shares no registers with other leaves.
struct TestSpheres<'s, 'a, 'd, G, const GENERAL: bool, const FILTERED: bool> {
    filtered: &'s mut FilteredRay<'a, 'd, GENERAL, FILTERED>,
    leaf: u32,
    ray: &'s Ray,
    slabs: &'s mut Slabs,
    goal: PhantomData<G>,
}

impl<G: Goal, const GENERAL: bool, const FILTERED: bool> Dispatch
    for TestSpheres<'_, '_, '_, G, GENERAL, FILTERED>
{
    type Output = Option<Stop>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Option<Stop> {
        self.filtered.test_spheres::<G, L>(self.leaf, self.ray, self.slabs)
    }
}

/// See [`FilteredRay::compare`].
struct Comparison<'s, 'a> {
    decider: &'s super::decide::Decider<'a>,
    ray: &'s Ray,
    axes: &'static intersect::Axes,
    triangle: (u32, u32),
    best: (&'s Candidate, Option<Winner>),
}

impl Dispatch for Comparison<'_, '_> {
    type Output = Outcome<Option<f64>>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        let Self { decider, ray, axes, triangle, best } = self;
        decider.compare::<L>(ray, axes, triangle, best)
    }
}

/// The nearest lane of the mask; arbitrary for an empty mask.
#[inline(always)]
pub(crate) fn nearest_of(mask: u32, near: &[f32; BLOCK]) -> usize {
    let mut nearest = mask.trailing_zeros() as usize % BLOCK;
    let mut others = mask & mask.wrapping_sub(1);
    while others != 0 {
        let other = others.trailing_zeros() as usize % BLOCK;
        others &= others - 1;
        nearest = if near[other] < near[nearest] { other } else { nearest };
    }
    nearest
}
