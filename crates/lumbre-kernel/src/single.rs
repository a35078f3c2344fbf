//! The nearest hit and any hit, in single precision wherever that can decide: in trees of triangles, and of shapes and custom
//! geometry beside them.
//!
//! A hit that single precision is certain of (see [`BlockRay`]) is kept by its place in the tree and the heights between which
//! it lies. Double precision is asked where it is not: about a triangle whose edge or range the ray ends hardly miss, and which
//! of two hits is nearer where their heights overlap. And, once a ray, about the winner, so that the answer has the same bits
//! as that of the plain search in `traverse`, which stands beside this one as its oracle. Where a ray touches an edge or a
//! corner exactly, or comes from far away, that search answers it altogether. Shapes and custom geometry always answer in double
//! precision; shapes are asked only where single precision does not see that the ray passes them by (see [`HullRay`]).
//!
//! What options leave out is left out by name before anything closer is known of it, and by its face wherever single precision is
//! certain of a hit, for then it is certain of the face.

use std::marker::PhantomData;

use lumbre_geometry::{Ray, Root, Roots};
use lumbre_math::DVec3;

use crate::anything::Amidst;
use crate::batch::Ends;
use crate::blocks::{Blocks, TriangleBlock};
use crate::collapse::Entry;
use crate::holds::{Contents, SingleStart};
use crate::hulls::HullRay;
use crate::lanes::{self, Asked, Axes, Crossings, Lanes, Level, MetHulls, Question, Task};
use crate::node::{Node, Slabs, tag};
use crate::options::{self, Selection};
use crate::packet::{PACKET, Packet};
use crate::query::All;
use crate::single_spheres::AmongSpheres;
use crate::stack::{AsBuilt, ByDistance, Order, Stack};
use crate::traverse::{PlacedTree, What};
use crate::triangles::{self, BLOCK, BlockRay, Inside, Meeting, Passage, Shear};
use crate::way::Way;
use crate::{Accel, Faces, Hit, InstancePath, traverse};

/// What came of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome<T> {
    /// The answer.
    Settled(T),
    /// The plain search has to answer.
    Unsettled,
}

/// The nearest hit, in as few words as it takes: it is handed over faster than a [`Hit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Winner {
    pub(crate) root: Root,
    pub(crate) geometry: u32,
    pub(crate) primitive: u32,
}

impl Winner {
    /// Whether another crossing, of what has these names, is nearer, or as near and before it.
    #[inline(always)]
    pub(crate) fn comes_after(&self, t: f64, names: (u32, u32)) -> bool {
        t < self.root.t || t == self.root.t && names < (self.geometry, self.primitive)
    }

    /// As a hit in the tree itself.
    #[inline(always)]
    pub(crate) fn to_hit(self, accel: &Accel) -> Hit {
        let Self { root, geometry, primitive } = self;
        Hit {
            root,
            id: accel.geometries[geometry as usize].id,
            primitive,
            geometry,
            instances: InstancePath::new(),
            route: InstancePath::new(),
        }
    }

    /// Makes a place hold that, field by field: a hit that is put together elsewhere would be waited for.
    #[inline(always)]
    pub(crate) fn put(self, accel: &Accel, place: &mut Option<Hit>) {
        let Some(hit) = place else {
            *place = Some(self.to_hit(accel));
            return;
        };
        let Self { root, geometry, primitive } = self;
        hit.root = root;
        hit.id = accel.geometries[geometry as usize].id;
        hit.primitive = primitive;
        hit.geometry = geometry;
        // To clear a path, one has to look where it stands.
        hit.instances = InstancePath::new();
        hit.route = InstancePath::new();
    }
}

/// How a search ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// All was seen.
    Out,
    /// Any hit will do, and there is one.
    Met,
    /// The plain search has to answer.
    Unsettled,
}

/// A triangle by its place in the tree, or the crossing of something else, and the heights along the ray between which it is met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) block: u32,
    pub(crate) lane: u32,
    pub(crate) from: f32,
    pub(crate) to: f32,
}

impl Candidate {
    pub(crate) const NONE: Self = Self { block: u32::MAX, lane: 0, from: f32::INFINITY, to: f32::INFINITY };
    /// Of what is no triangle.
    const CROSSED: u32 = u32::MAX - 1;

    /// The crossing of what is no triangle, which lies between these heights.
    #[inline(always)]
    pub(crate) fn crossed((from, to): (f32, f32)) -> Self {
        Self { block: Self::CROSSED, lane: 0, from, to }
    }

    #[inline(always)]
    pub(crate) fn is_some(&self) -> bool {
        self.block != u32::MAX
    }

    #[inline(always)]
    pub(crate) fn is_triangle(&self) -> bool {
        self.block < Self::CROSSED
    }

    /// How far along the ray a hit may be that is nearer than this, or as near.
    #[inline(always)]
    pub(crate) fn limit(&self, ray: &Ray) -> f64 {
        if !self.is_some() {
            return ray.t_max;
        }
        // What this lies before, and rounded upwards as a whole.
        const UP: f64 = 1.0 + 4.0 * f64::EPSILON;
        let limit = f64::from(self.to) / largest_component(ray) * UP;
        if limit < ray.t_max { limit } else { ray.t_max }
    }
}

/// What is asked of a tree where single precision cannot decide.
#[derive(Clone, Copy)]
pub(crate) struct Exact<'a> {
    accel: &'a Accel,
    pub(crate) start: &'a SingleStart,
    // Those of the tree, which may lie in a file.
    triangles: Blocks<'a>,
}

impl<'a> Exact<'a> {
    #[inline(always)]
    pub(crate) fn new(accel: &'a Accel, start: &'a SingleStart) -> Self {
        Self { accel, start, triangles: accel.tree.blocks() }
    }

    /// The tree.
    #[inline(always)]
    pub(crate) fn accel(&self) -> &'a Accel {
        self.accel
    }

    /// A block of triangles.
    #[inline(always)]
    pub(crate) fn block(&self, place: u32) -> &'a TriangleBlock {
        self.triangles.block(place)
    }

    /// All of them.
    #[inline(always)]
    pub(crate) fn blocks(&self) -> Blocks<'a> {
        self.triangles
    }

    /// The nodes of the tree.
    #[inline(always)]
    pub(crate) fn nodes(&self) -> &'a [Node] {
        &self.accel.tree.nodes
    }

    /// Whether the ray passes by a triangle, or meets it out of its range, as far as that is seen at a glance.
    #[inline(always)]
    pub(crate) fn passes<L: Lanes>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        block: &TriangleBlock,
        lane: u32,
    ) -> bool {
        let ray = lanes::opaque(ray);
        let (shear, origin) = L::shear(ray, axes, &self.start.mesh_origin);
        match L::pass(block, lane as usize, &shear, &origin) {
            (Passage::Outside, _) => true,
            (Passage::Inside, inside) => !triangles::is_in_range(ray, inside.t(&shear)),
            (Passage::Unclear, _) => false,
        }
    }

    /// Looks closer at a triangle that may be met, and nearer than the best, which is the crossing if there is that: where it is met,
    /// if it is better and has such a face.
    #[inline(always)]
    pub(crate) fn contest<L: Lanes>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        (block, lane): (u32, u32),
        (best, crossed): (&Candidate, Option<Winner>),
        faces: Faces,
    ) -> Outcome<Option<f64>> {
        let closely = || self.contest_closely(ray, (block, lane), (best, crossed), faces);
        let (shear, origin) = L::shear(ray, axes, &self.start.mesh_origin);
        let inside = match self.pass::<L>(&shear, &origin, block, lane) {
            (Passage::Inside, inside) => inside,
            (Passage::Outside, _) => return Outcome::Settled(None),
            (Passage::Unclear, _) => return closely(),
        };
        let t = inside.t(&shear);
        if !triangles::is_in_range(ray, t) || !faces.have(inside.det > 0.0) {
            return Outcome::Settled(None);
        }
        let comes_after = if let Some(crossed) = crossed {
            !crossed.comes_after(t, self.names(block, lane))
        } else if best.is_some() {
            let (Passage::Inside, inside) = self.pass::<L>(&shear, &origin, best.block, best.lane) else {
                return closely();
            };
            let nearest = inside.t(&shear);
            t > nearest || t == nearest && self.names(block, lane) > self.names(best.block, best.lane)
        } else {
            false
        };
        Outcome::Settled((!comes_after).then_some(t))
    }

    /// The same where it is not seen at a glance how the ray passes the two.
    #[inline(never)]
    fn contest_closely(
        &self,
        ray: &Ray,
        (block, lane): (u32, u32),
        (best, crossed): (&Candidate, Option<Winner>),
        faces: Faces,
    ) -> Outcome<Option<f64>> {
        let t = match self.meet(ray, block, lane) {
            Meeting::Miss => return Outcome::Settled(None),
            Meeting::Touch { .. } => return Outcome::Unsettled,
            Meeting::Hit { is_front, .. } if !faces.have(is_front) => return Outcome::Settled(None),
            Meeting::Hit { root, .. } => root.t,
        };
        match self.is_better(ray, t, self.names(block, lane), best, crossed) {
            Outcome::Settled(is_better) => Outcome::Settled(is_better.then_some(t)),
            Outcome::Unsettled => Outcome::Unsettled,
        }
    }

    /// [`Lanes::pass`] of a triangle by its place.
    #[inline(always)]
    fn pass<L: Lanes>(&self, shear: &Shear, origin: &[f64; 3], block: u32, lane: u32) -> (Passage, Inside) {
        L::pass(self.triangles.block(block), lane as usize, shear, origin)
    }

    /// How the ray meets a triangle.
    #[cold]
    #[inline(never)]
    pub(crate) fn meet(&self, ray: &Ray, block: u32, lane: u32) -> Meeting {
        let shear = Shear::new(&ray.direction);
        let origin = shear.local_origin(&ray.origin, &DVec3::from_slice(&self.start.mesh_origin));
        let block = self.triangles.block(block);
        let corners = shear.axes.gather(block, lane as usize);
        triangles::intersect(ray, shear, origin, corners)
    }

    /// The crossing of a triangle in the ray's range, if there is one.
    #[inline(always)]
    fn crossing<L: Lanes>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        block: u32,
        lane: u32,
    ) -> Outcome<Option<Winner>> {
        let (shear, origin) = L::shear(ray, axes, &self.start.mesh_origin);
        let corners = self.triangles.block(block);
        let root = match L::pass(corners, lane as usize, &shear, &origin) {
            (Passage::Outside, _) => None,
            (Passage::Inside, inside) => {
                let t = inside.t(&shear);
                if triangles::is_in_range(ray, t) { Some(inside.root(t)) } else { None }
            }
            (Passage::Unclear, _) => match self.meet(ray, block, lane) {
                Meeting::Miss => None,
                Meeting::Hit { root, .. } => Some(root),
                Meeting::Touch { .. } => return Outcome::Unsettled,
            },
        };
        let (geometry, primitive) = self.names_in(corners, lane);
        Outcome::Settled(root.map(|root| Winner { root, geometry, primitive }))
    }

    /// Geometry and primitive of a triangle.
    #[inline(always)]
    pub(crate) fn names(&self, block: u32, lane: u32) -> (u32, u32) {
        self.names_in(self.triangles.block(block), lane)
    }

    #[inline(always)]
    fn names_in(&self, block: &TriangleBlock, lane: u32) -> (u32, u32) {
        let names = &self.accel.tree.names[block.number() as usize];
        (names.geometry, names.primitives[lane as usize % BLOCK])
    }

    /// Whether a crossing, of what has these names, is nearer than that of a triangle that the ray does meet, if there is one, or as
    /// near and before it.
    pub(crate) fn is_better(
        &self,
        ray: &Ray,
        t: f64,
        names: (u32, u32),
        best: &Candidate,
        crossed: Option<Winner>,
    ) -> Outcome<bool> {
        if let Some(crossed) = crossed {
            return Outcome::Settled(crossed.comes_after(t, names));
        }
        let &Candidate { block, lane, .. } = best;
        if !best.is_some() {
            return Outcome::Settled(true);
        }
        match self.meet(ray, block, lane) {
            Meeting::Hit { root, .. } => {
                Outcome::Settled(t < root.t || t == root.t && names < self.names(block, lane))
            }
            Meeting::Miss | Meeting::Touch { .. } => Outcome::Unsettled,
        }
    }

    /// The heights between which a crossing of what is no triangle lies, where it is in the ray's range and the nearest.
    #[inline(always)]
    pub(crate) fn contest_crossing(
        &self,
        ray: &Ray,
        t: f64,
        names: (u32, u32),
        (best, crossed): (&Candidate, Option<Winner>),
    ) -> Outcome<Option<(f32, f32)>> {
        let heights @ (from, to) = heights(t, largest_component(ray));
        // Also keeps out a NaN.
        if !ray.contains(t) || from > best.to {
            return Outcome::Settled(None);
        }
        if to < best.from {
            return Outcome::Settled(Some(heights));
        }
        match self.is_better(ray, t, names, best, crossed) {
            Outcome::Settled(is_better) => Outcome::Settled(is_better.then_some(heights)),
            Outcome::Unsettled => Outcome::Unsettled,
        }
    }

    /// The nearest hit: the crossing if there is that, else this triangle that the ray does meet, if it is any.
    #[inline(always)]
    pub(crate) fn answer<L: Lanes>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        (nearest, crossed): (&Candidate, Option<Winner>),
    ) -> Outcome<Option<Winner>> {
        if crossed.is_some() || !nearest.is_some() {
            return Outcome::Settled(crossed);
        }
        match self.winner::<L>(ray, axes, nearest) {
            Some(winner) => Outcome::Settled(Some(winner)),
            None => Outcome::Unsettled,
        }
    }

    /// A triangle that the ray does meet as the nearest hit; `None` where the plain search has to answer.
    #[inline(always)]
    pub(crate) fn winner<L: Lanes>(
        &self,
        ray: &Ray,
        axes: &'static Axes,
        &Candidate { block, lane, .. }: &Candidate,
    ) -> Option<Winner> {
        let (shear, origin) = L::shear(lanes::opaque(ray), axes, &self.start.mesh_origin);
        let corners = self.triangles.block(block);
        let (passage, inside) = L::pass(corners, lane as usize, &shear, &origin);
        let (t, local) = if passage == Passage::Inside {
            (inside.t(&shear), inside.local())
        } else {
            match self.meet(ray, block, lane) {
                Meeting::Hit { root, .. } => (root.t, root.local),
                Meeting::Miss | Meeting::Touch { .. } => return None,
            }
        };
        let (geometry, primitive) = self.names_in(corners, lane);
        Some(Winner { root: triangles::root(t, local), geometry, primitive })
    }
}

/// The heights between which a crossing in double precision lies, for a direction whose largest component has this length.
#[inline(always)]
pub(crate) fn heights(t: f64, length: f64) -> (f32, f32) {
    let height = (t * length) as f32;
    let error = height.abs() * triangles::ROUNDINGS + f32::MIN_POSITIVE;
    (height - error, height + error)
}

/// What takes t to heights.
#[inline(always)]
pub(crate) fn largest_component(ray: &Ray) -> f64 {
    ray.direction.abs().max_element()
}

/// A ray in the leaves of a tree that [`SingleStart`] was made for, among what a selection takes. Its [`Way`] leads it to them.
pub(crate) struct SingleRay<'a, const MIXED: bool, S = All> {
    exact: Exact<'a>,
    blocks: BlockRay,
    /// For shapes, once the ray has come to some.
    hulls: Option<HullRay>,
    /// From heights to places in the range of boxes.
    place_per_height: f32,
    /// The nearest so far.
    pub(crate) best: Candidate,
    /// The last of the best that was no triangle.
    crossed: Option<Winner>,
    selection: S,
}

impl<'a, const MIXED: bool, S: Selection> SingleRay<'a, MIXED, S> {
    /// Starts with a ray for triangles, and what takes heights along it to places in the range of boxes: see [`Lanes::start_blocks`].
    #[inline(always)]
    pub(crate) fn new(
        accel: &'a Accel,
        start: &'a SingleStart,
        (blocks, place_per_height): (BlockRay, f32),
        selection: S,
    ) -> Self {
        let exact = Exact::new(accel, start);
        let best = Candidate::NONE;
        Self { exact, blocks, hulls: None, place_per_height, best, crossed: None, selection }
    }

    /// Tests a leaf; how the search ends, if it does.
    #[inline(always)]
    pub(crate) fn meet_leaf<G: Goal, L: Lanes>(
        &mut self,
        leaf: u32,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step> {
        if MIXED && leaf >> tag::SHIFT == tag::SHAPES {
            self.meet_shapes::<G, L>(leaf, ray, way)
        } else if MIXED && leaf >> tag::SHIFT != tag::TRIANGLES {
            self.meet_entries::<G, L>(leaf, ray, way)
        } else {
            G::meet_triangles(self, leaf, ray, way)
        }
    }

    /// Tests a leaf of shapes: in double precision those alone whose hulls are met, the nearest first.
    #[inline(always)]
    fn meet_shapes<G: Goal, L: Lanes>(&mut self, leaf: u32, ray: &Ray, way: &mut Way<L>) -> Option<Step> {
        let accel = self.exact.accel;
        let make = || HullRay::new(&accel.units, ray, largest_component(ray));
        let hulls = *self.hulls.get_or_insert_with(make);
        let mut first = (leaf & tag::PLACE) as usize;
        loop {
            let Some((block, goes_on)) = accel.hulls.block(first) else {
                return self.meet_entries::<G, L>(leaf, ray, way);
            };
            let entries = &accel.tree.entries[first..];
            let range = &self.blocks.range;
            let MetHulls { mut mask, sure, near } = if G::IS_ANY && S::TAKES_ALL {
                lanes::meet_hulls::<L, true>(block, lanes::opaque(&hulls), range)
            } else {
                lanes::meet_hulls::<L, false>(block, lanes::opaque(&hulls), range)
            };
            if G::IS_ANY && S::TAKES_ALL && sure != 0 {
                return Some(Step::Met);
            }
            while mask != 0 {
                let lane =
                    if G::IS_ANY { mask.trailing_zeros() as usize % BLOCK } else { nearest_of(mask, &near) };
                mask &= !(1 << lane);
                if !G::IS_ANY && near[lane] > self.blocks.range.last {
                    continue;
                }
                let end = G::meet_entry(self, &entries[lane], ray, way);
                if end.is_some() {
                    return end;
                }
            }
            if !goes_on {
                return None;
            }
            first += BLOCK;
        }
    }

    /// Tests a leaf of custom geometry, or of anything that is no triangle.
    #[inline(always)]
    fn meet_entries<G: Goal, L: Lanes>(&mut self, leaf: u32, ray: &Ray, way: &mut Way<L>) -> Option<Step> {
        for entry in &self.exact.accel.tree.entries[(leaf & tag::PLACE) as usize..] {
            let end = G::meet_entry(self, entry, ray, way);
            if end.is_some() || entry.is_last() {
                return end;
            }
        }
        None
    }

    /// Of the triangles of a block that may be met, those that are taken, as far as that is seen at a glance.
    #[inline(always)]
    fn select<L: Lanes>(
        &self,
        block: &TriangleBlock,
        mask: u32,
        edges: &L::Edges,
        crossings: &Crossings<L::Eight>,
    ) -> u32 {
        if S::TAKES_ALL {
            return mask;
        }
        let mask = mask & crossings.in_range;
        let mask = match self.selection.faces() {
            Faces::Both => mask,
            Faces::Front => mask & (!crossings.sure | L::fronts(edges)),
            Faces::Back => mask & !(crossings.sure & L::fronts(edges)),
        };
        // Names stand elsewhere, and most blocks have nothing left to be asked about.
        if mask == 0 {
            0
        } else {
            mask & self.selection.lanes(&self.exact.accel.tree.names[block.number() as usize])
        }
    }

    /// Tests a leaf of triangles for the nearest hit; false where the plain search has to answer.
    #[inline(always)]
    fn meet_leaf_closest<L: Lanes>(&mut self, leaf: u32, ray: &Ray, way: &mut Way<L>) -> bool {
        // One at least, and mostly no more.
        let mut place = leaf & tag::PLACE;
        loop {
            let block = self.exact.triangles.block(place);
            let (mask, edges) = L::meet_triangles(block, lanes::opaque(&self.blocks));
            if mask != 0 {
                let crossings = L::place_crossings(&edges, &self.blocks);
                let mask = self.select::<L>(block, mask, &edges, &crossings);
                let mut rest = mask & crossings.in_range;
                if rest != 0 && mask & (mask - 1) == 0 {
                    // One alone, known before its range is: the winner need not wait for that.
                    rest = lanes::opaque_number(mask);
                }
                while rest != 0 {
                    let lane = rest.trailing_zeros();
                    let is_sure = crossings.sure >> lane & 1 != 0;
                    rest &= rest - 1;
                    let (from, to) = crossings.between(lane as usize);
                    if S::ASKS {
                        if from > self.best.to {
                            continue;
                        }
                        match self.ask::<L>(ray, place, lane) {
                            Outcome::Settled(Some(better)) => self.keep(better, way),
                            Outcome::Settled(None) => {}
                            Outcome::Unsettled => return false,
                        }
                    } else if is_sure && to < self.best.from {
                        self.keep(Candidate { block: place, lane, from, to }, way);
                    } else if from > self.best.to
                        || self.exact.passes::<L>(ray, self.blocks.axes, block, lane)
                    {
                        // Farther, which what is no number is not; or not met at all.
                        continue;
                    } else {
                        match self.contest(L::level(), ray, place, lane) {
                            Outcome::Settled(Some(better)) => self.keep(better, way),
                            Outcome::Settled(None) => {}
                            Outcome::Unsettled => return false,
                        }
                    }
                }
            }
            match block.next(place) {
                Some(next) => place = next,
                None => return true,
            }
        }
    }

    #[inline(always)]
    fn keep<L: Lanes>(&mut self, better: Candidate, way: &mut Way<L>) {
        self.best = better;
        self.blocks.range.last = better.to;
        way.end_at(triangles::beyond(better.to * self.place_per_height));
    }

    /// Looks at a triangle that may be met, and asks about it if that is nearer than the best: what is better, if anything.
    #[inline(always)]
    fn ask<L: Lanes>(&mut self, ray: &Ray, block: u32, lane: u32) -> Outcome<Option<Candidate>> {
        let found = match self.exact.crossing::<L>(ray, self.blocks.axes, block, lane) {
            Outcome::Settled(Some(found)) => found,
            Outcome::Settled(None) => return Outcome::Settled(None),
            Outcome::Unsettled => return Outcome::Unsettled,
        };
        Outcome::Settled(self.ask_about(ray, found, 0))
    }

    /// Asks about a crossing in range, if it is nearer than the best, or as near and before it: the new best, if it is.
    fn ask_about(&mut self, ray: &Ray, found: Winner, order: u32) -> Option<Candidate> {
        if let Some(best) = self.crossed()
            && !best.comes_after(found.root.t, (found.geometry, found.primitive))
        {
            return None;
        }
        if !self.selection.accepts(&found, order) {
            return None;
        }
        self.crossed = Some(found);
        Some(Candidate::crossed(heights(found.root.t, largest_component(ray))))
    }

    /// Looks closer at a triangle that may be met, and nearer than the best: what is better, if anything.
    // Apart, for there it is in nobody's way.
    #[cold]
    #[inline(never)]
    fn contest(&self, level: Level, ray: &Ray, block: u32, lane: u32) -> Outcome<Option<Candidate>> {
        level.run(Contest { single: self, ray, block, lane })
    }

    /// The best, where it is no triangle.
    #[inline(always)]
    pub(crate) fn crossed(&self) -> Option<Winner> {
        if (MIXED || S::ASKS) && !self.best.is_triangle() { self.crossed } else { None }
    }

    /// Whether a crossing is nearer than the best, or as near and before it.
    pub(crate) fn is_better(&self, ray: &Ray, t: f64, names: (u32, u32)) -> Outcome<bool> {
        self.exact.is_better(ray, t, names, &self.best, self.crossed())
    }

    /// Tests what is no triangle for the nearest hit; false where the plain search has to answer.
    #[inline(always)]
    fn meet_entry_closest<L: Lanes>(&mut self, entry: &Entry, ray: &Ray, way: &mut Way<L>) -> bool {
        let (geometry, primitive) = (entry.geometry, entry.primitive());
        if !self.selection.takes(geometry, primitive) {
            return true;
        }
        if S::ASKS {
            let kind = &self.exact.accel.geometries[geometry as usize].kind;
            for (order, root) in traverse::all_crossings(kind, primitive, ray).into_iter().enumerate() {
                let found = Winner { root, geometry, primitive };
                if ray.contains(root.t)
                    && let Some(better) = self.ask_about(ray, found, order as u32)
                {
                    self.keep(better, way);
                }
            }
            return true;
        }
        if self.selection.faces() != Faces::Both {
            for root in self.crossings_of_faces(geometry, primitive, ray) {
                if !self.meet_root(root, geometry, primitive, ray, way) {
                    return false;
                }
            }
            return true;
        }
        let kind = &self.exact.accel.geometries[geometry as usize].kind;
        match traverse::first_crossing(kind, primitive, ray) {
            Some(root) => self.meet_root(root, geometry, primitive, ray, way),
            None => true,
        }
    }

    /// The crossings of what is no triangle at the faces that are taken.
    #[inline(never)]
    fn crossings_of_faces(&self, geometry: u32, primitive: u32, ray: &Ray) -> Roots {
        let (what, faces) = (What::Named { geometry, primitive }, self.selection.faces());
        let kind = &self.exact.accel.geometries[geometry as usize].kind;
        let mut roots = traverse::all_crossings(kind, primitive, ray);
        roots.retain(|root| {
            ray.contains(root.t) && faces.have(options::meets_front(self.exact.accel, ray, what, root))
        });
        roots
    }

    /// How far along the ray a hit may be that is nearer than the best, or as near.
    #[inline(always)]
    pub(crate) fn limit(&self, ray: &Ray) -> f64 {
        self.best.limit(ray)
    }

    /// Takes a crossing of what is no triangle, if it is the nearest; false where the plain search has to answer.
    #[inline(always)]
    pub(crate) fn meet_root<L: Lanes>(
        &mut self,
        root: Root,
        geometry: u32,
        primitive: u32,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> bool {
        let best = (&self.best, self.crossed());
        match self.exact.contest_crossing(ray, root.t, (geometry, primitive), best) {
            Outcome::Settled(Some(heights)) => {
                self.keep_crossed(Winner { root, geometry, primitive }, heights, way);
            }
            Outcome::Settled(None) => {}
            Outcome::Unsettled => return false,
        }
        true
    }

    /// Takes a crossing of what is no triangle, which lies between these heights.
    #[inline(always)]
    pub(crate) fn keep_crossed<L: Lanes>(&mut self, crossed: Winner, heights: (f32, f32), way: &mut Way<L>) {
        self.crossed = Some(crossed);
        self.keep(Candidate::crossed(heights), way);
    }

    /// Tests what is no triangle for any hit.
    #[inline(always)]
    fn meet_entry_any(&self, entry: &Entry, ray: &Ray) -> bool {
        let (geometry, primitive) = (entry.geometry, entry.primitive());
        if !self.selection.takes(geometry, primitive) {
            return false;
        }
        if S::ASKS {
            let kind = &self.exact.accel.geometries[geometry as usize].kind;
            let roots = traverse::all_crossings(kind, primitive, ray);
            return roots.into_iter().enumerate().any(|(order, root)| {
                ray.contains(root.t)
                    && self.selection.accepts(&Winner { root, geometry, primitive }, order as u32)
            });
        }
        if self.selection.faces() != Faces::Both {
            return !self.crossings_of_faces(geometry, primitive, ray).is_empty();
        }
        traverse::is_crossed(&self.exact.accel.geometries[geometry as usize].kind, primitive, ray)
    }

    /// Tests a leaf for any hit: whether there is one.
    #[inline(always)]
    fn meet_leaf_any<L: Lanes>(&self, leaf: u32, ray: &Ray) -> Outcome<bool> {
        // One at least, and mostly no more.
        let mut place = leaf & tag::PLACE;
        loop {
            let block = self.exact.triangles.block(place);
            let (mask, edges) = L::meet_triangles(block, lanes::opaque(&self.blocks));
            if mask != 0 {
                let crossings = L::place_crossings(&edges, &self.blocks);
                let mask = self.select::<L>(block, mask, &edges, &crossings);
                if !S::ASKS && mask & crossings.sure != 0 {
                    return Outcome::Settled(true);
                }
                let mut rest = mask & crossings.in_range;
                while rest != 0 {
                    let lane = rest.trailing_zeros();
                    rest &= rest - 1;
                    if S::ASKS {
                        match self.exact.crossing::<L>(ray, self.blocks.axes, place, lane) {
                            Outcome::Settled(Some(found)) => {
                                if self.selection.accepts(&found, 0) {
                                    return Outcome::Settled(true);
                                }
                            }
                            Outcome::Settled(None) => {}
                            Outcome::Unsettled => return Outcome::Unsettled,
                        }
                        continue;
                    }
                    if self.exact.passes::<L>(ray, self.blocks.axes, block, lane) {
                        continue;
                    }
                    match self.exact.meet(ray, place, lane) {
                        Meeting::Miss => {}
                        Meeting::Hit { is_front, .. } => {
                            if self.selection.faces().have(is_front) {
                                return Outcome::Settled(true);
                            }
                        }
                        Meeting::Touch { .. } => return Outcome::Unsettled,
                    }
                }
            }
            match block.next(place) {
                Some(next) => place = next,
                None => return Outcome::Settled(false),
            }
        }
    }

    /// The nearest hit, once all was seen.
    #[inline(always)]
    pub(crate) fn winner<L: Lanes>(&self, ray: &Ray) -> Outcome<Option<Winner>> {
        self.exact.answer::<L>(ray, self.blocks.axes, (&self.best, self.crossed()))
    }
}

/// A triangle that may be met, and nearer than the best: see [`SingleRay::contest`].
struct Contest<'s, 'a, const MIXED: bool, S> {
    single: &'s SingleRay<'a, MIXED, S>,
    ray: &'s Ray,
    block: u32,
    lane: u32,
}

impl<const MIXED: bool, S: Selection> Task for Contest<'_, '_, MIXED, S> {
    type Output = Outcome<Option<Candidate>>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { single, ray, block, lane } = self;
        let (axes, best) = (single.blocks.axes, (&single.best, single.crossed()));
        match single.exact.contest::<L>(ray, axes, (block, lane), best, single.selection.faces()) {
            Outcome::Unsettled => Outcome::Unsettled,
            Outcome::Settled(None) => Outcome::Settled(None),
            Outcome::Settled(Some(t)) => {
                let (from, to) = heights(t, largest_component(ray));
                Outcome::Settled(Some(Candidate { block, lane, from, to }))
            }
        }
    }
}

/// What is asked of a ray.
pub(crate) trait Goal {
    /// Which boxes come first.
    type Order: Order;
    /// What it is to know.
    type Answer;
    /// The same as it is handed out.
    type Found;
    /// The answer where nothing comes near.
    const NOTHING: Self::Answer;
    /// Whether any hit will do.
    const IS_ANY: bool;

    /// Whether any hit `is_met`, or the nearest.
    fn known(is_met: bool, nearest: Option<Winner>) -> Self::Answer;

    /// Hands out an answer of a tree.
    fn found(accel: &Accel, answer: Self::Answer) -> Self::Found;

    /// What the plain search finds.
    fn find_plainly(accel: &Accel, level: Level, ray: &Ray) -> Self::Found;

    /// Tests a leaf of triangles; how the search ends, if it does.
    fn meet_triangles<L: Lanes, S: Selection, const MIXED: bool>(
        single: &mut SingleRay<MIXED, S>,
        leaf: u32,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step>;

    /// Tests what is no triangle.
    fn meet_entry<L: Lanes, S: Selection, const MIXED: bool>(
        single: &mut SingleRay<MIXED, S>,
        entry: &Entry,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step>;

    /// What the last step leads to.
    fn answer<L: Lanes, S: Selection, const MIXED: bool>(
        single: &SingleRay<MIXED, S>,
        ray: &Ray,
        last: Step,
    ) -> Outcome<Self::Answer>;

    /// What a ray in flight has come to: whether any hit `is_met`, or the nearest, which is the crossing if there is that.
    fn answer_in_flight<L: Lanes>(
        exact: &Exact,
        ray: &Ray,
        axes: &'static Axes,
        is_met: bool,
        nearest: (&Candidate, Option<Winner>),
    ) -> Outcome<Self::Answer>;

    /// What came of rays that went together, by their places in the packet.
    fn answer_together<L: Lanes, const MIXED: bool>(
        packet: &Packet<MIXED>,
        rays: &[Ray; PACKET],
        ends: &mut impl Ends<Self::Answer>,
    );
}

/// The nearest hit.
pub(crate) enum Nearest {}

impl Goal for Nearest {
    type Order = ByDistance;
    type Answer = Option<Winner>;
    type Found = Option<Hit>;
    const NOTHING: Option<Winner> = None;
    const IS_ANY: bool = false;

    #[inline(always)]
    fn known(_: bool, nearest: Option<Winner>) -> Option<Winner> {
        nearest
    }

    #[inline(always)]
    fn found(accel: &Accel, answer: Option<Winner>) -> Option<Hit> {
        answer.map(|winner| winner.to_hit(accel))
    }

    #[inline(always)]
    fn find_plainly(accel: &Accel, level: Level, ray: &Ray) -> Option<Hit> {
        accel.closest_plainly_at(level, ray)
    }

    #[inline(always)]
    fn meet_triangles<L: Lanes, S: Selection, const MIXED: bool>(
        single: &mut SingleRay<MIXED, S>,
        leaf: u32,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step> {
        (!single.meet_leaf_closest(leaf, ray, way)).then_some(Step::Unsettled)
    }

    #[inline(always)]
    fn meet_entry<L: Lanes, S: Selection, const MIXED: bool>(
        single: &mut SingleRay<MIXED, S>,
        entry: &Entry,
        ray: &Ray,
        way: &mut Way<L>,
    ) -> Option<Step> {
        (!single.meet_entry_closest(entry, ray, way)).then_some(Step::Unsettled)
    }

    #[inline(always)]
    fn answer<L: Lanes, S: Selection, const MIXED: bool>(
        single: &SingleRay<MIXED, S>,
        ray: &Ray,
        last: Step,
    ) -> Outcome<Option<Winner>> {
        if last == Step::Unsettled { Outcome::Unsettled } else { single.winner::<L>(ray) }
    }

    #[inline(always)]
    fn answer_in_flight<L: Lanes>(
        exact: &Exact,
        ray: &Ray,
        axes: &'static Axes,
        _: bool,
        nearest: (&Candidate, Option<Winner>),
    ) -> Outcome<Option<Winner>> {
        exact.answer::<L>(ray, axes, nearest)
    }

    #[inline(always)]
    fn answer_together<L: Lanes, const MIXED: bool>(
        packet: &Packet<MIXED>,
        rays: &[Ray; PACKET],
        ends: &mut impl Ends<Self::Answer>,
    ) {
        packet.put_nearest::<L>(rays, ends);
    }
}

/// Whether there is any hit.
pub(crate) enum Whether {}

impl Goal for Whether {
    type Order = AsBuilt;
    type Answer = bool;
    type Found = bool;
    const NOTHING: bool = false;
    const IS_ANY: bool = true;

    #[inline(always)]
    fn known(is_met: bool, _: Option<Winner>) -> bool {
        is_met
    }

    #[inline(always)]
    fn found(_: &Accel, answer: bool) -> bool {
        answer
    }

    #[inline(always)]
    fn find_plainly(accel: &Accel, level: Level, ray: &Ray) -> bool {
        accel.any_plainly_at(level, ray)
    }

    #[inline(always)]
    fn meet_triangles<L: Lanes, S: Selection, const MIXED: bool>(
        single: &mut SingleRay<MIXED, S>,
        leaf: u32,
        ray: &Ray,
        _: &mut Way<L>,
    ) -> Option<Step> {
        match single.meet_leaf_any::<L>(leaf, ray) {
            Outcome::Settled(true) => Some(Step::Met),
            Outcome::Settled(false) => None,
            Outcome::Unsettled => Some(Step::Unsettled),
        }
    }

    #[inline(always)]
    fn meet_entry<L: Lanes, S: Selection, const MIXED: bool>(
        single: &mut SingleRay<MIXED, S>,
        entry: &Entry,
        ray: &Ray,
        _: &mut Way<L>,
    ) -> Option<Step> {
        single.meet_entry_any(entry, ray).then_some(Step::Met)
    }

    #[inline(always)]
    fn answer<L: Lanes, S: Selection, const MIXED: bool>(
        _: &SingleRay<MIXED, S>,
        _: &Ray,
        last: Step,
    ) -> Outcome<bool> {
        if last == Step::Unsettled { Outcome::Unsettled } else { Outcome::Settled(last == Step::Met) }
    }

    #[inline(always)]
    fn answer_in_flight<L: Lanes>(
        _: &Exact,
        _: &Ray,
        _: &'static Axes,
        is_met: bool,
        _: (&Candidate, Option<Winner>),
    ) -> Outcome<bool> {
        Outcome::Settled(is_met)
    }

    #[inline(always)]
    fn answer_together<L: Lanes, const MIXED: bool>(
        packet: &Packet<MIXED>,
        _: &[Ray; PACKET],
        ends: &mut impl Ends<bool>,
    ) {
        packet.put_met(ends);
    }
}

/// What is asked most, by whichever searches can tell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Questions {
    /// [`Accel::closest`].
    pub(crate) closest: Asked<Option<Hit>>,
    /// [`Accel::any`].
    pub(crate) any: Asked<bool>,
}

impl Questions {
    /// Of a tree that has this start.
    pub(crate) fn new(level: Level, start: Option<&SingleStart>) -> Self {
        match start.map(|start| start.contents) {
            Some(Contents::Triangles) => Self {
                closest: level.asked::<Singly<Nearest, false>>(),
                any: level.asked::<Singly<Whether, false>>(),
            },
            Some(Contents::Shapes) => Self {
                closest: level.asked::<Singly<Nearest, true>>(),
                any: level.asked::<Singly<Whether, true>>(),
            },
            Some(Contents::Spheres) => Self {
                closest: level.asked::<AmongSpheres<Nearest>>(),
                any: level.asked::<AmongSpheres<Whether>>(),
            },
            Some(Contents::Anything) => {
                Self { closest: level.asked::<Amidst<Nearest>>(), any: level.asked::<Amidst<Whether>>() }
            }
            None => {
                Self { closest: level.asked::<Plainly<Nearest>>(), any: level.asked::<Plainly<Whether>>() }
            }
        }
    }

    /// The same as they may leak at edges, to be measured beside; `None` but of trees of triangles, and without AVX2.
    #[cfg(feature = "measure")]
    pub(crate) fn leaking(level: Level, start: Option<&SingleStart>) -> Option<Self> {
        start.filter(|start| start.contents == Contents::Triangles)?;
        Some(Self {
            closest: level.asked_leaking::<Singly<Nearest, false>>()?,
            any: level.asked_leaking::<Singly<Whether, false>>()?,
        })
    }
}

/// In single precision first. `MIXED` as below.
struct Singly<G, const MIXED: bool>(PhantomData<G>);

/// In double precision alone.
struct Plainly<G>(PhantomData<G>);

impl<G: Goal, const MIXED: bool> Question for Singly<G, MIXED> {
    type Ray = Ray;
    type Answer = G::Found;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> G::Found {
        if let Some(start) = &accel.single
            && let ray = L::read(ray)
            && let Outcome::Settled(answer) = Alone::<G, MIXED>::new(accel, start, &ray).run::<L>()
        {
            return G::found(accel, answer);
        }
        G::find_plainly(accel, L::level(), ray)
    }
}

impl<G: Goal> Question for Plainly<G> {
    type Ray = Ray;
    type Answer = G::Found;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> G::Found {
        G::find_plainly(accel, L::level(), ray)
    }
}

/// A search with one ray. `MIXED` where there is anything but triangles.
pub(crate) struct Alone<'a, 'r, G, const MIXED: bool, S = All> {
    accel: &'a Accel,
    start: &'a SingleStart,
    /// The node that it starts at.
    root: u32,
    ray: &'r Ray,
    selection: S,
    goal: PhantomData<G>,
}

/// Searches along a ray.
#[inline(always)]
#[cfg(test)]
pub(crate) fn search<G: Goal>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    ray: &Ray,
) -> Outcome<G::Answer> {
    search_among::<G, All>(level, accel, start, ray, All)
}

/// The same among what a selection takes.
#[inline(always)]
pub(crate) fn search_among<G: Goal, S: Selection>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    ray: &Ray,
    selection: S,
) -> Outcome<G::Answer> {
    let root = start.root;
    match start.contents {
        Contents::Triangles => level.run(Alone::<G, false, S>::among(accel, start, root, ray, selection)),
        Contents::Shapes => level.run(Alone::<G, true, S>::among(accel, start, root, ray, selection)),
        Contents::Spheres => unreachable!("what is left out among spheres is for the plain search"),
        Contents::Anything => unreachable!("what it finds is no winner, but a hit"),
    }
}

/// The same in a placed tree of nothing but triangles, within a search that goes through other trees, with a ray that has started.
#[inline(always)]
pub(crate) fn search_placed<G: Goal, L: Lanes, S: Selection>(
    placed: &PlacedTree,
    ray: &Ray,
    slabs: Slabs,
    selection: S,
) -> Outcome<G::Answer> {
    let &PlacedTree { accel, start, root, .. } = placed;
    Alone::<G, false, S>::among(accel, start, root, ray, selection).go::<L>(slabs)
}

impl<'a, 'r, G: Goal, const MIXED: bool> Alone<'a, 'r, G, MIXED> {
    #[inline(always)]
    pub(crate) fn new(accel: &'a Accel, start: &'a SingleStart, ray: &'r Ray) -> Self {
        Self::among(accel, start, start.root, ray, All)
    }
}

impl<G: Goal, const MIXED: bool, S: Selection> Task for Alone<'_, '_, G, MIXED, S> {
    type Output = Outcome<G::Answer>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { accel, start, root, ray, selection, .. } = self;
        // Where all is taken, who asks has read it.
        let own;
        let ray = if S::TAKES_ALL {
            ray
        } else {
            own = L::read(ray);
            &own
        };
        match L::start_single(start, ray) {
            Some(slabs) => Alone::<G, MIXED, S>::among(accel, start, root, ray, selection).go::<L>(slabs),
            None => Outcome::Unsettled,
        }
    }
}

impl<'a, 'r, G: Goal, const MIXED: bool, S: Selection> Alone<'a, 'r, G, MIXED, S> {
    /// Below a node, among what a selection takes.
    #[inline(always)]
    pub(crate) fn among(
        accel: &'a Accel,
        start: &'a SingleStart,
        root: u32,
        ray: &'r Ray,
        selection: S,
    ) -> Self {
        Self { accel, start, root, ray, selection, goal: PhantomData }
    }

    /// Goes through the tree with a ray that has started.
    #[inline(always)]
    pub(crate) fn go<L: Lanes>(self, slabs: Slabs) -> Outcome<G::Answer> {
        let Self { accel, start, root, ray, selection, .. } = self;
        let mut way = Way::<L>::new(&accel.tree.nodes, slabs);
        let mut stack = Stack::new();
        let infinite = if MIXED { &*accel.infinite } else { &[] };
        let mut leaf = root;
        if infinite.is_empty() {
            // Many rays come to no leaf, and need nothing else.
            match way.descend::<G::Order>(root, &mut stack) {
                Some(first) => leaf = first,
                None => return Outcome::Settled(G::NOTHING),
            }
        }
        // Opaque: what was read at the start would else be written down, to be kept until here.
        let blocks = L::start_blocks(start, lanes::opaque(ray), way.slabs());
        let mut single = SingleRay::<MIXED, S>::new(accel, start, blocks, selection);
        if !infinite.is_empty() {
            for entry in infinite {
                if let Some(last) = G::meet_entry(&mut single, entry, ray, &mut way) {
                    return G::answer::<L, S, MIXED>(&single, ray, last);
                }
            }
            match way.descend::<G::Order>(root, &mut stack) {
                Some(first) => leaf = first,
                None => return G::answer::<L, S, MIXED>(&single, ray, Step::Out),
            }
        }
        loop {
            if let Some(last) = single.meet_leaf::<G, L>(leaf, ray, &mut way) {
                return G::answer::<L, S, MIXED>(&single, ray, last);
            }
            let Some(next) = way.pop::<G::Order>(&mut stack) else { break };
            let Some(next) = way.descend::<G::Order>(next, &mut stack) else { break };
            leaf = next;
        }
        G::answer::<L, S, MIXED>(&single, ray, Step::Out)
    }
}

/// Which of those in the mask is the nearest; any where there are none.
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
