//! Rays in single precision, in trees of triangles only: for callers who prefer speed to the last digits.
//!
//! The test is that of S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, and
//! simpler than the one in double precision (see [`watertight`](crate::intersect::watertight)). Triangles are closed: a
//! ray through an edge meets all triangles at that edge, which affects neither the nearest hit nor whether there is
//! one. Products are computed exactly where rounding would be imprecise. Results do not depend on the instruction set:
//! no product is fused with a sum.
//!
//! The ray starts relative to the mesh, rounded once. Everything below refers to this rounded ray.
//!
//! # Correctness: nothing leaks
//!
//! A corner's position in the ray's sheared space depends on the ray and the corner only, so all triangles that share
//! the corner agree on it. The line of the ray passes through a closed mesh of those corners. Moved slightly into
//! general position, it passes through the inside of a triangle that is not seen on edge. Triangles are closed and
//! finitely many, so the unmoved line also passes through such a triangle, whose edge functions have one sign or are
//! zero. An edge function is the difference of two rounded products. Rounding keeps the order of the products or makes
//! them equal, so the computed function has the exact sign or is zero, and the triangle is not rejected. A computed
//! zero is evaluated again with exact products (products of single-precision numbers are exact in double precision),
//! which gives the exact sign.
//!
//! # Error bound: boxes lose nothing
//!
//! Let u = 2⁻²⁴, h the largest distance of the mesh from the ray's start along the last axis, and lengths be in tree
//! units. The sheared corners have an error of u(2m + 6.1h), where m ≤ 4.1 for a triangle around the ray: from two
//! roundings of the corner, and from the height, the shear (which has an error of 3u, and is at most 1), and their
//! product. If all computed edge functions e have strictly one sign, the exact ones have it too, and the ray passes
//! through the computed triangle at the height Σ e z / Σ e of exact values. Each e has an error of 2u(p + |e|), where p
//! is the largest product. So the computed height has an error of 6u(p / |Σ e| + 1) times the extent of the triangle
//! along the ray, and of 7uh from the rounding of sums, products and heights. Hence p times the extent must be below 2
//! |Σ e|, which leaves 24.2u. Otherwise, and if an e is zero, weights come from exact products, and their height has an
//! error of 2uh.
//!
//! So the hit lies within u(8.2 + 6.1h) + 24.2u + 7uh of the triangle on each axis, where h ≤ 1.01 + |o|: below u(47 +
//! 14|o|). Planes are relative to the tree's origin, which the ray knows rounded, with an error of slightly more than u
//! times its distance from the mesh's. `TreeSpace::f32_margin` covers all of this in addition to the errors in
//! [`node`](crate::tree::node). `t` itself has an error of three roundings, which the ends of the box range cover too.
//!
//! So no box with a hit as near as the nearest is skipped: the answer is that of a loop over all triangles, for any
//! tree.

use bytemuck::Zeroable;

use super::cursor::NodeCursor;
use super::decide::Decider;
use super::filtered::Queries;
use super::leaves::nearest_of;
use super::stack::{AnyHit, ClosestHit, Goal, Stack};
use super::{LaneHits, Outcome, precedes};
use crate::hit::Hit;
use crate::intersect::box_ray::Slabs;
use crate::intersect::f32_ray::{F32Ray, within};
use crate::intersect::watertight;
use crate::intersect::{Axes, DispatchedQuery, Isa, RayQuery, Simd};
use crate::ray32::{Hit32, Ray32};
use crate::simd::{self, F32x8, F32x16, Vector};
use crate::tree::BLOCK;
use crate::tree::Tree;
use crate::tree::filter_start::Precise;
use crate::tree::node::tag;
use crate::tree::triangle_block::TriangleBlock;

/// How a line passes the triangles of a block, before the exact tests.
pub(crate) struct Lines<E> {
    /// The first of each edge function's two products.
    products: [E; 3],
    edges: [E; 3],
    within: E,
    heights: [E; 3],
}

impl<E: Vector> Lines<E> {
    /// From corners in the sheared space of the ray; also returns a mask of the triangles that it may pass through.
    #[inline(always)]
    fn of([x, y, heights]: [[E; 3]; 3]) -> (u32, Self) {
        let products = [x[2] * y[1], x[0] * y[2], x[1] * y[0]];
        let edges = [products[0] - y[2] * x[1], products[1] - y[0] * x[2], products[2] - y[1] * x[0]];
        let within = within(edges);
        (E::splat(0.0).simd_le(within), Self { products, edges, within, heights })
    }

    /// The data of triangles that it may pass through, and a mask of those of `mask` that need exact products.
    #[inline(always)]
    pub(crate) fn pass(self, mask: u32, precise: &Precise) -> (u32, Pass<E>) {
        let Self { products: [bc, ca, ab], edges: [u, v, w], within, heights: z } = self;
        let det = u + v + w;
        let largest = bc.max_abs(ca).max_abs(ab);
        let uncertain = mask & !precise.of(mask, largest, within, det, z);
        (uncertain, Pass { height: u * z[0] + v * z[1] + w * z[2], weights: [v, w, det] })
    }
}

/// How a line passes the triangles of a block.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Pass<E> {
    /// The heights along the line, times the sum of all weights.
    height: E,
    /// Weights of the second and third corner, and the sum of all.
    weights: [E; 3],
}

/// How a line passes the triangles of a block, and which of them its ray meets.
type Passed<E> = (LaneHits<E>, Pass<E>);

impl<E: F32x8> Pass<E> {
    /// The weights of one lane.
    #[inline(always)]
    fn weights_of(&self, lane: usize) -> [f32; 3] {
        let [v, w, det] = self.weights;
        [v.lane(lane), w.lane(lane), det.lane(lane)]
    }

    /// The weights of all lanes.
    #[inline(always)]
    fn all_weights(&self) -> [[f32; BLOCK]; 3] {
        let [v, w, det] = self.weights;
        [v.to_array(), w.to_array(), det.to_array()]
    }
}

impl<W: F32x16> Pass<W> {
    /// The pass of one of the two rays: `which` is 0 or 1.
    #[inline(always)]
    pub(crate) fn half(&self, which: usize) -> Pass<W::Half> {
        let Self { height, weights: [v, w, det] } = self;
        Pass { height: height.half(which), weights: [v.half(which), w.half(which), det.half(which)] }
    }

    /// The passes of two rays.
    #[inline(always)]
    pub(crate) fn of_two(first: &Pass<W::Half>, second: &Pass<W::Half>) -> Self {
        Self {
            height: W::of_two(first.height, second.height),
            weights: simd::three_of_two(&first.weights, &second.weights),
        }
    }
}

/// The nearest crossing so far, if any. Together with a ray it takes one cache line, which interleaved rays rely on.
#[derive(Clone, Copy)]
pub(crate) struct Nearest {
    /// The line of its block, and the lane in the last three bits.
    place: u32,
    /// Weights of the second and third corner, and the sum of all.
    weights: [f32; 3],
}

const _: () = assert!(size_of::<F32Ray>() + size_of::<Nearest>() <= 64);

impl Nearest {
    /// No block begins at this line: it would end beyond the last index.
    pub(crate) const NONE: Self = Self { place: u32::MAX, weights: [0.0; 3] };

    #[inline(always)]
    fn new(block: u32, lane: u32, weights: [f32; 3]) -> Self {
        Self { place: block * BLOCK as u32 + lane, weights }
    }

    /// The line of its block, and the lane.
    #[inline(always)]
    fn triangle(&self) -> Option<(u32, u32)> {
        if self.place == u32::MAX {
            None
        } else {
            Some((self.place / BLOCK as u32, self.place % BLOCK as u32))
        }
    }

    /// Takes the nearest crossing of a block if it is nearer, and shortens the ray. Returns whether it was.
    #[inline(always)]
    fn take<E: F32x8>(
        &mut self,
        decider: &Decider,
        ray: &mut F32Ray,
        place: u32,
        crossing: &LaneHits<E>,
        pass: &Pass<E>,
    ) -> bool {
        let &LaneHits { met, uncertain, at } = crossing;
        if met | uncertain == 0 {
            return false;
        }
        let t = at.to_array();
        let lane = nearest_of(met, &t);
        self.take_nearest(decider, ray, place, crossing, pass, (lane, t[lane]))
    }

    /// As [`Self::take`], if the lane and the `t` of the block's nearest crossing are known.
    #[inline(always)]
    pub(crate) fn take_nearest<E: F32x8>(
        &mut self,
        decider: &Decider,
        ray: &mut F32Ray,
        place: u32,
        crossing: &LaneHits<E>,
        pass: &Pass<E>,
        (lane, t): (usize, f32),
    ) -> bool {
        let &LaneHits { met, uncertain, at } = crossing;
        let others = at.simd_le(E::splat(t)) & met & !(1 << lane);
        if uncertain | others == 0 && t < ray.t_max() {
            *self = Self::new(place, lane as u32, pass.weights_of(lane));
            ray.end_at(t);
            return true;
        }
        let at = at.to_array();
        self.take_closely(decider, ray, place, &LaneHits { met, uncertain, at }, &pass.all_weights())
    }

    /// As [`Self::take`], if a triangle needs exact products, or two are met at the same `t`, in this block or another.
    #[cold]
    #[inline(never)]
    fn take_closely(
        &mut self,
        decider: &Decider,
        ray: &mut F32Ray,
        place: u32,
        crossing: &LaneHits<[f32; BLOCK]>,
        weights: &[[f32; BLOCK]; 3],
    ) -> bool {
        let &LaneHits { met, uncertain, ref at } = crossing;
        let mut is_nearer = false;
        let mut rest = met | uncertain;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            let (t, weights) = if uncertain >> lane & 1 == 0 {
                let lane = lane as usize % BLOCK;
                (at[lane], weights.map(|weights| weights[lane]))
            } else {
                match ray.cross_exactly(decider.block(place), lane) {
                    Some(crossing) => crossing,
                    None => continue,
                }
            };
            if t < ray.t_max() || t == ray.t_max() && self.comes_after(decider, place, lane, weights[2] > 0.0)
            {
                *self = Self::new(place, lane, weights);
                ray.end_at(t);
                is_nearer = true;
            }
        }
        is_nearer
    }

    /// Whether a triangle that is met at the same `t` comes before this one.
    fn comes_after(&self, decider: &Decider, block: u32, lane: u32, enters: bool) -> bool {
        match self.triangle() {
            Some((own_block, own_lane)) => precedes(
                (enters, decider.ids(block, lane)),
                (self.weights[2] > 0.0, decider.ids(own_block, own_lane)),
            ),
            None => true,
        }
    }

    /// Geometry and primitive, the barycentrics, and whether the ray enters there; `None` without a hit.
    #[inline(always)]
    pub(super) fn crossing(&self, decider: &Decider) -> Option<((u32, u32), [f32; 2], bool)> {
        let (block, lane) = self.triangle()?;
        let [v, w, det] = self.weights;
        Some((decider.ids(block, lane), [v / det, w / det], det > 0.0))
    }

    /// The hit at this `t`, if any.
    #[inline(always)]
    pub(crate) fn hit(&self, decider: &Decider, t: f32) -> Option<Hit32> {
        let (block, lane) = self.triangle()?;
        let (geometry, primitive) = decider.ids(block, lane);
        let [v, w, det] = self.weights;
        Some(Hit32 {
            t,
            local: [v / det, w / det],
            id: decider.tree().geometries[geometry as usize].id,
            primitive,
            geometry,
            instance: Hit32::NO_INSTANCE,
        })
    }
}

impl F32Ray {
    /// A ray that hits nothing.
    pub(crate) fn of_none() -> Self {
        Self { axes: Axes::by_bits(0, 0), origin: [0.0; 4], shear: [0.0; 4], minus_inverse: 0.0 }
    }

    #[inline(always)]
    fn t_min(&self) -> f32 {
        self.origin[3]
    }

    #[inline(always)]
    pub(crate) fn t_max(&self) -> f32 {
        self.shear[3]
    }

    #[inline(always)]
    fn end_at(&mut self, t_max: f32) {
        self.shear[3] = t_max;
    }

    /// How the line of the ray passes the triangles of a block, and a mask of the ones that it may pass through.
    #[inline(always)]
    pub(crate) fn lines<L: Simd>(&self, block: &TriangleBlock) -> (u32, Lines<L::F32x8>) {
        let (mask, lines) = Lines::of(L::sheared_corners(block, simd::opaque(self)));
        (mask & block.taken(), lines)
    }

    /// As [`Self::lines`] for two rays, each with the triangles of its own block.
    #[inline(always)]
    pub(crate) fn lines_by_two<L: Simd>(
        rays: [&Self; 2],
        blocks: [&TriangleBlock; 2],
    ) -> (u32, Lines<L::F32x16>) {
        let (mask, lines) = Lines::of(L::sheared_corners_by_two(blocks, rays));
        (mask & (blocks[0].taken() | blocks[1].taken() << BLOCK), lines)
    }

    /// The crossings with the triangles of a block that the line passes, and which of those in the mask the ray meets.
    #[inline(always)]
    pub(crate) fn cross<E: F32x8>(&self, mask: u32, pass: &Pass<E>) -> (u32, E) {
        // Loads the ray again: most lines pass through few blocks.
        let ray = simd::opaque(self);
        let t = pass.height / pass.weights[2] * E::splat(ray.minus_inverse);
        (mask & E::splat(ray.t_min()).simd_le(t) & t.simd_le(E::splat(ray.t_max())), t)
    }

    /// Which triangles of a block the ray meets; `None` if its line passes through none.
    #[inline(always)]
    fn pass<L: Simd>(&self, precise: &Precise, block: &TriangleBlock) -> Option<Passed<L::F32x8>> {
        let (mask, lines) = self.lines::<L>(block);
        if mask == 0 {
            return None;
        }
        let (uncertain, pass) = lines.pass(mask, precise);
        let (met, at) = self.cross(mask & !uncertain, &pass);
        Some((LaneHits { met, uncertain, at }, pass))
    }

    /// The crossing with a triangle by exact products: its `t`, the weights of the second and third corner, and the sum
    /// of all.
    #[cold]
    #[inline(never)]
    pub(crate) fn cross_exactly(&self, block: &TriangleBlock, lane: u32) -> Option<(f32, [f32; 3])> {
        let corners = self.axes.gather(block, lane as usize).map(|[x, y, z]| {
            let height = self.origin[2] - z;
            let x = (self.origin[0] - x) - self.shear[0] * height;
            let y = (self.origin[1] - y) - self.shear[1] * height;
            [f64::from(x), f64::from(y), f64::from(height)]
        });
        let [a, b, c] = corners;
        let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        let is_inside = u.min(v).min(w) >= 0.0 || u.max(v).max(w) <= 0.0;
        let det = u + v + w;
        if !is_inside || det == 0.0 {
            return None;
        }
        let t = ((u * a[2] + v * b[2] + w * c[2]) / det * f64::from(self.minus_inverse)) as f32;
        (self.t_min() <= t && t <= self.t_max()).then(|| {
            // The sign of the sum decides the face.
            let size = det.abs();
            (t, [(v / size) as f32, (w / size) as f32, if det > 0.0 { 1.0 } else { -1.0 }])
        })
    }

    /// Shortens the ray to this `t`.
    #[inline(always)]
    pub(super) fn shorten(&mut self, t_max: f32) {
        if t_max < self.t_max() {
            self.end_at(t_max);
        }
    }

    /// Tests a leaf: takes the nearest crossing and shortens the ray. Returns true if any hit suffices and there is
    /// one.
    #[inline(always)]
    pub(super) fn test_leaf<G: Goal, L: Simd>(
        &mut self,
        decider: &Decider,
        leaf: u32,
        nearest: &mut Nearest,
        slabs: &mut Slabs,
    ) -> bool {
        let precise = &decider.start.precise;
        let mut place = leaf & tag::PLACE;
        loop {
            let block = decider.block(place);
            if G::IS_ANY {
                if self.meets_any::<L>(precise, block) {
                    return true;
                }
            } else if let Some((hits, pass)) = self.pass::<L>(precise, block)
                && nearest.take(decider, self, place, &hits, &pass)
            {
                slabs.end_at(watertight::beyond(self.t_max()));
            }
            match block.next(place) {
                Some(next) => place = next,
                None => return false,
            }
        }
    }

    /// Whether the ray meets any triangle of a block.
    #[inline(always)]
    fn meets_any<L: Simd>(&self, precise: &Precise, block: &TriangleBlock) -> bool {
        match self.pass::<L>(precise, block) {
            Some((LaneHits { met, uncertain, .. }, _)) => {
                met != 0 || uncertain != 0 && self.meets_exactly(block, uncertain)
            }
            None => false,
        }
    }

    /// Whether the ray meets one of these triangles.
    #[cold]
    #[inline(never)]
    pub(crate) fn meets_exactly(&self, block: &TriangleBlock, mut mask: u32) -> bool {
        while mask != 0 {
            let lane = mask.trailing_zeros();
            mask &= mask - 1;
            if self.cross_exactly(block, lane).is_some() {
                return true;
            }
        }
        false
    }
}

/// Traverses a tree of triangles. For an any-hit search, the hit itself is arbitrary.
#[inline(always)]
pub(crate) fn traverse<G: Goal, L: Simd>(decider: &Decider, ray: &Ray32) -> Outcome<Option<Hit32>> {
    let start = decider.start;
    let Some(slabs) = L::start_f32(start, ray) else { return Outcome::Uncertain };
    let mut cursor = NodeCursor::<L>::new(decider.nodes(), slabs);
    let mut stack = Stack::new();
    let Some(mut leaf) = cursor.descend::<G>(start.root, &mut stack) else { return Outcome::Certain(None) };
    let mut ray = L::start_f32_blocks(start, simd::opaque(ray), &cursor.slabs);
    let mut nearest = Nearest::NONE;
    loop {
        if ray.test_leaf::<G, L>(decider, leaf, &mut nearest, &mut cursor.slabs) {
            return Outcome::Certain(Some(SOME_HIT));
        }
        match cursor.next_leaf::<G>(&mut stack) {
            Some(next) => leaf = next,
            None => return Outcome::Certain(nearest.hit(decider, ray.t_max())),
        }
    }
}

/// The result of an any-hit search.
pub(crate) const SOME_HIT: Hit32 =
    Hit32 { t: 0.0, local: [0.0; 2], id: 0, primitive: 0, geometry: 0, instance: Hit32::NO_INSTANCE };

/// A double-precision hit, rounded.
pub(crate) fn rounded(hit: &Hit) -> Hit32 {
    Hit32 {
        t: hit.root.t as f32,
        local: [hit.root.local.x as f32, hit.root.local.y as f32],
        id: hit.id,
        primitive: hit.primitive,
        geometry: hit.geometry,
        instance: hit.instances.first().copied().unwrap_or(Hit32::NO_INSTANCE),
    }
}

/// The closest hit of a ray in single precision, found in double precision and rounded.
#[inline(never)]
pub(crate) fn closest_widened(isa: Isa, tree: &Tree, ray: &Ray32) -> Option<Hit32> {
    Queries::of(isa, tree).closest.ask(tree, &ray.to_f64()).as_ref().map(rounded)
}

/// Whether a ray in single precision hits anything, found in double precision.
#[inline(never)]
pub(crate) fn any_widened(isa: Isa, tree: &Tree, ray: &Ray32) -> bool {
    Queries::of(isa, tree).any.ask(tree, &ray.to_f64())
}

/// [`Accel::closest_f32`] and [`Accel::any_f32`] in trees of triangles, by function pointers for the instruction set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F32Queries {
    pub(crate) closest: DispatchedQuery<Option<Hit32>, Ray32>,
    pub(crate) any: DispatchedQuery<bool, Ray32>,
}

impl F32Queries {
    /// `None` for a tree with other primitives.
    pub(crate) fn of(isa: Isa, tree: &Tree) -> Option<Self> {
        let start = tree.single.as_ref()?;
        start
            .only_triangles
            .then(|| Self { closest: isa.dispatched::<ClosestHit>(), any: isa.dispatched::<AnyHit>() })
    }
}

impl RayQuery for ClosestHit {
    type Ray = Ray32;
    type Answer = Option<Hit32>;

    #[inline(always)]
    fn ask<L: Simd>(tree: &Tree, ray: &Ray32) -> Option<Hit32> {
        let Some(start) = &tree.single else { return closest_widened(L::isa(), tree, ray) };
        match traverse::<Self, L>(&Decider::new(tree, start), &L::read_f32(ray)) {
            Outcome::Certain(hit) => hit,
            Outcome::Uncertain => closest_widened(L::isa(), tree, ray),
        }
    }
}

impl RayQuery for AnyHit {
    type Ray = Ray32;
    type Answer = bool;

    #[inline(always)]
    fn ask<L: Simd>(tree: &Tree, ray: &Ray32) -> bool {
        let Some(start) = &tree.single else { return any_widened(L::isa(), tree, ray) };
        match traverse::<Self, L>(&Decider::new(tree, start), &L::read_f32(ray)) {
            Outcome::Certain(hit) => hit.is_some(),
            Outcome::Uncertain => any_widened(L::isa(), tree, ray),
        }
    }
}
