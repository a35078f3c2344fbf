//! Many rays at once, in trees that have triangles: each answer has the same bits as for a single ray.
//!
//! Coherent rays are traversed as packets of sixteen (see [`packet`]), the others interleaved (see [`interleaved`]).
//! Both test triangles in either precision; other leaves are tested ray by ray, by the code of single rays.

pub(crate) mod columns;
mod f32_packet;
mod f32_slot;
mod f64_packet;
mod f64_slot;
mod interleaved;
pub(crate) mod packet;
#[cfg(test)]
pub(crate) mod shims;
mod sink;

use std::marker::PhantomData;
use std::slice::Chunks;

use lumbre_geometry::Ray;

use self::f32_packet::F32Bundle;
use self::f32_slot::F32Slot;
use self::f64_packet::F64Bundle;
use self::f64_slot::F64Slot;
use self::packet::{Bundle, PACKET, Packet};
pub(crate) use self::sink::Sink;
use crate::hit::Hit;
use crate::intersect::{Dispatch, Isa, Simd};
use crate::ray32::{Hit32, Ray32};
use crate::simd;
use crate::trace::decide::Decider;
use crate::trace::f32_ray::{self, F32Queries};
use crate::trace::filtered::Queries;
use crate::trace::filtered::Traversal;
use crate::trace::filtered_ray::{FilteredGoal, Found};
use crate::trace::stack::{AnyHit, ClosestHit, Goal};
use crate::trace::{ContextRef, Outcome, exact};
use crate::tree::Tree;
use crate::tree::filter_start::FilterStart;
use crate::tree::node::Node;
use crate::tree::triangle_block::Line;

/// Larger trees, in bytes, hardly fit the caches; interleaved rays then prefetch what they read next.
const FAR: usize = 1 << 24;
/// Smaller trees, in bytes, are in the nearest caches; interleaving then pays only for many rays.
const NEAR: usize = 1 << 20;
/// Smaller trees, of about two thousand triangles, are so shallow that single rays in single precision beat interleaved
/// ones.
const SMALL: usize = 1 << 17;
/// Consecutive packets that may be skipped without a try.
const MAX_SKIPPED: usize = 16;
/// Packets are sought among this many rays before the others are interleaved.
const CHUNK: usize = 4096;
/// Rays are prefetched this many packets ahead.
const AHEAD: usize = 3;
/// Rays in single precision that are converted to double at a time.
const WIDENED: usize = 1024;

/// [`Accel::closest`] for every ray.
pub(crate) fn closest(isa: Isa, tree: &Tree, rays: &[Ray], hits: &mut [Option<Hit>]) {
    let sink = &mut ClosestSink { tree, isa, rays, hits };
    if !batch_f64::<ClosestHit, _>(isa, tree, rays, sink, Plan::of(tree)) {
        let closest = Queries::of(isa, tree).closest;
        hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = closest.ask(tree, ray));
    }
}

/// [`Accel::any`] for every ray.
pub(crate) fn any(isa: Isa, tree: &Tree, rays: &[Ray], hits: &mut [bool]) {
    any_by(isa, tree, rays, hits, Plan::of(tree));
}

/// As [`any`], with a given plan.
fn any_by(isa: Isa, tree: &Tree, rays: &[Ray], hits: &mut [bool], plan: Plan) {
    let sink = &mut AnySink { tree, isa, rays, hits };
    if !batch_f64::<AnyHit, _>(isa, tree, rays, sink, plan) {
        let any = Queries::of(isa, tree).any;
        hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = any.ask(tree, ray));
    }
}

/// [`Accel::closest_f32`] for every ray.
pub(crate) fn closest_f32(isa: Isa, tree: &Tree, rays: &[Ray32], hits: &mut [Option<Hit32>]) {
    match F32Queries::of(isa, tree) {
        None => {
            let mut widened = Vec::with_capacity(rays.len().min(WIDENED));
            let mut found = vec![None; rays.len().min(WIDENED)];
            for (rays, hits) in rays.chunks(WIDENED).zip(hits.chunks_mut(WIDENED)) {
                widened.clear();
                widened.extend(rays.iter().map(|ray| ray.to_f64()));
                let found = &mut found[..rays.len()];
                closest(isa, tree, &widened, found);
                for (hit, found) in hits.iter_mut().zip(found) {
                    *hit = found.as_ref().map(f32_ray::rounded);
                }
            }
        }
        Some(queries) => {
            let sink = &mut F32ClosestSink { tree, queries, rays, hits };
            if !batch_f32::<ClosestHit, _>(isa, tree, rays, sink, Plan::of(tree)) {
                hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = queries.closest.ask(tree, ray));
            }
        }
    }
}

/// [`Accel::any_f32`] for every ray.
pub(crate) fn any_f32(isa: Isa, tree: &Tree, rays: &[Ray32], hits: &mut [bool]) {
    match F32Queries::of(isa, tree) {
        None => {
            let mut widened = Vec::with_capacity(rays.len().min(WIDENED));
            for (rays, hits) in rays.chunks(WIDENED).zip(hits.chunks_mut(WIDENED)) {
                widened.clear();
                widened.extend(rays.iter().map(|ray| ray.to_f64()));
                any(isa, tree, &widened, hits);
            }
        }
        Some(queries) => {
            let sink = &mut F32AnySink { tree, queries, rays, hits };
            if !batch_f32::<AnyHit, _>(isa, tree, rays, sink, Plan::of(tree)) {
                hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = queries.any.ask(tree, ray));
            }
        }
    }
}

/// The start, if batches can traverse the tree: it must have triangles and the machine vectors.
fn batched(isa: Isa, tree: &Tree) -> Option<&FilterStart> {
    let has_triangles = !tree.packed.blocks.is_empty();
    tree.single.as_ref().filter(|_| has_triangles && isa.has_vectors())
}

/// Returns false if batches cannot traverse the tree.
fn batch_f64<G: FilteredGoal, S: Sink<G::Found>>(
    isa: Isa,
    tree: &Tree,
    rays: &[Ray],
    sink: &mut S,
    plan: Plan,
) -> bool {
    let Some(start) = batched(isa, tree) else { return false };
    if start.only_triangles {
        isa.run_with_vectors(Batch::<F64<G, false>, S> { tree, start, rays, sink, plan });
    } else {
        isa.run_with_vectors(Batch::<F64<G, true>, S> { tree, start, rays, sink, plan });
    }
    true
}

/// The batch in a tree of triangles, in single precision.
fn batch_f32<G: Goal, S: Sink<Option<Hit32>>>(
    isa: Isa,
    tree: &Tree,
    rays: &[Ray32],
    sink: &mut S,
    plan: Plan,
) -> bool {
    let Some(start) = batched(isa, tree) else { return false };
    isa.run_with_vectors(Batch::<F32<G>, S> { tree, start, rays, sink, plan });
    true
}

/// See [`closest`].
struct ClosestSink<'a> {
    tree: &'a Tree,
    isa: Isa,
    rays: &'a [Ray],
    hits: &'a mut [Option<Hit>],
}

impl Sink<Found> for ClosestSink<'_> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Found>) {
        #[cfg(test)]
        shims::count(&outcome);
        let slot = &mut self.hits[position];
        match outcome {
            Outcome::Certain(Found { winner: None, .. }) => *slot = None,
            Outcome::Certain(Found { winner: Some(winner), in_instance: None }) => {
                winner.put(self.tree, slot)
            }
            Outcome::Certain(found) => *slot = found.into_hit(self.tree, ContextRef::OUTSIDE),
            Outcome::Uncertain => *slot = exact::closest(self.isa, self.tree, &self.rays[position], None),
        }
    }

    #[inline(always)]
    fn prefetch(&self, position: usize) {
        self.hits.get(position).map(simd::fetch);
    }
}

/// See [`any`].
struct AnySink<'a> {
    tree: &'a Tree,
    isa: Isa,
    rays: &'a [Ray],
    hits: &'a mut [bool],
}

impl Sink<bool> for AnySink<'_> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<bool>) {
        #[cfg(test)]
        shims::count(&outcome);
        self.hits[position] = match outcome {
            Outcome::Certain(is_hit) => is_hit,
            Outcome::Uncertain => exact::any(self.isa, self.tree, &self.rays[position], None),
        };
    }
}

/// See [`closest_f32`].
struct F32ClosestSink<'a> {
    tree: &'a Tree,
    /// For rays that a batch gives up: single precision answers them one by one.
    queries: F32Queries,
    rays: &'a [Ray32],
    hits: &'a mut [Option<Hit32>],
}

impl Sink<Option<Hit32>> for F32ClosestSink<'_> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Option<Hit32>>) {
        self.hits[position] = match outcome {
            Outcome::Certain(hit) => hit,
            Outcome::Uncertain => self.queries.closest.ask(self.tree, &self.rays[position]),
        };
    }

    #[inline(always)]
    fn put_row(&mut self, first: usize, answer: impl Fn(usize) -> Option<Hit32>) {
        for (i, slot) in self.hits[first..first + PACKET].iter_mut().enumerate() {
            *slot = answer(i);
        }
    }
}

/// See [`any_f32`].
struct F32AnySink<'a> {
    tree: &'a Tree,
    queries: F32Queries,
    rays: &'a [Ray32],
    hits: &'a mut [bool],
}

impl Sink<Option<Hit32>> for F32AnySink<'_> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<Option<Hit32>>) {
        self.hits[position] = match outcome {
            Outcome::Certain(hit) => hit.is_some(),
            Outcome::Uncertain => self.queries.any.ask(self.tree, &self.rays[position]),
        };
    }
}

/// When and how rays are interleaved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    /// Fewer rays are traversed one by one: filling and draining the slots takes time.
    least: usize,
    /// Whether a ray prefetches what it reads next.
    prefetches: bool,
    has_packets: bool,
}

impl Plan {
    pub(crate) const NEAR: Self = Self { least: 128, prefetches: false, has_packets: true };
    pub(crate) const MIDDLE: Self = Self { least: 32, prefetches: false, has_packets: true };
    pub(crate) const FAR: Self = Self { least: 32, prefetches: true, has_packets: true };
    /// Rays outside of packets are traversed one by one.
    const SINGLES: Self = Self { least: usize::MAX, prefetches: false, has_packets: true };

    /// The fastest plan for picture rays. Incoherent ones are faster one by one in a small tree.
    fn of_picture(tree: &Tree) -> Self {
        let bytes = Self::bytes(tree);
        if bytes >= FAR {
            Self::FAR
        } else if bytes >= SMALL {
            Self::MIDDLE
        } else {
            Self::SINGLES
        }
    }

    /// Bytes of a tree that rays read.
    fn bytes(tree: &Tree) -> usize {
        size_of_val::<[Line]>(&tree.packed.blocks) + size_of_val::<[Node]>(&tree.packed.nodes)
    }

    /// The fastest plan for a tree.
    fn of(tree: &Tree) -> Self {
        let bytes = Self::bytes(tree);
        if bytes >= FAR {
            Self::FAR
        } else if bytes >= NEAR {
            Self::MIDDLE
        } else {
            Self::NEAR
        }
    }
}

/// The precision, goal and kind of tree of a batch.
trait Precision {
    type Goal: Goal;
    type Ray: 'static;
    type Answer;
    type Bundle<'a, 'd>: Bundle<'a, 'd, Ray = Self::Ray, Answer = Self::Answer>
    where
        'a: 'd;
    /// Whether the rays of packets are prefetched.
    const PREFETCHES_RAYS: bool;

    /// Traverses the tree with one ray.
    fn traverse_alone<L: Simd>(decider: &Decider, ray: &Self::Ray) -> Outcome<Self::Answer>;

    /// Traverses the tree with the rays at these positions, interleaved.
    fn interleave<L: Simd>(
        decider: &Decider,
        prefetches: bool,
        rays: &[Self::Ray],
        positions: &[usize],
        sink: &mut impl Sink<Self::Answer>,
    );
}

/// Double precision; `GENERAL` in trees with other primitives than triangles.
struct F64<G, const GENERAL: bool>(PhantomData<G>);

impl<G: FilteredGoal, const GENERAL: bool> Precision for F64<G, GENERAL> {
    type Goal = G;
    type Ray = Ray;
    type Answer = G::Found;
    type Bundle<'a, 'd>
        = F64Bundle<'a, 'd, G, GENERAL>
    where
        'a: 'd;
    // For any hit, nothing else keeps the memory busy, and hardware prefetching suffices.
    const PREFETCHES_RAYS: bool = !G::IS_ANY;

    #[inline(always)]
    fn traverse_alone<L: Simd>(decider: &Decider, ray: &Ray) -> Outcome<G::Found> {
        Traversal::<G, GENERAL, false>::whole(decider.tree(), decider.start, ray).run::<L>()
    }

    #[inline(always)]
    fn interleave<L: Simd>(
        decider: &Decider,
        prefetches: bool,
        rays: &[Ray],
        positions: &[usize],
        sink: &mut impl Sink<G::Found>,
    ) {
        interleaved::traverse::<F64Slot<'_, '_, G, GENERAL>, L>(decider, prefetches, rays, positions, sink);
    }
}

/// Single precision.
struct F32<G>(PhantomData<G>);

impl<G: Goal> Precision for F32<G> {
    type Goal = G;
    type Ray = Ray32;
    type Answer = Option<Hit32>;
    type Bundle<'a, 'd>
        = F32Bundle<'a, 'd, G, Ray32>
    where
        'a: 'd;
    const PREFETCHES_RAYS: bool = true;

    #[inline(always)]
    fn traverse_alone<L: Simd>(decider: &Decider, ray: &Ray32) -> Outcome<Option<Hit32>> {
        f32_ray::traverse::<G, L>(decider, ray)
    }

    #[inline(always)]
    fn interleave<L: Simd>(
        decider: &Decider,
        prefetches: bool,
        rays: &[Ray32],
        positions: &[usize],
        sink: &mut impl Sink<Option<Hit32>>,
    ) {
        interleaved::traverse::<F32Slot<'_, '_, G>, L>(decider, prefetches, rays, positions, sink);
    }
}

/// When to try a packet. After one that did not pay, more and more are skipped before the next try.
struct Trials {
    to_skip: usize,
    patience: usize,
}

impl Trials {
    const NEW: Self = Self { to_skip: 0, patience: MAX_SKIPPED };

    /// Whether to try the next packet.
    #[inline(always)]
    fn is_next(&mut self) -> bool {
        let is_next = self.to_skip == 0;
        self.to_skip = self.to_skip.saturating_sub(1);
        is_next
    }

    /// Records the result of a try.
    #[inline(always)]
    fn record(&mut self, pays: bool) {
        (self.to_skip, self.patience) =
            if pays { (0, 0) } else { (self.patience, (2 * self.patience).clamp(1, MAX_SKIPPED)) };
    }
}

/// Prefetches the rays of packets, which are read faster than hardware prefetching follows.
struct RaysAhead<'r, R> {
    packets: Chunks<'r, R>,
}

impl<'r, R> RaysAhead<'r, R> {
    #[inline(always)]
    fn new(rays: &'r [R], prefetches: bool) -> Self {
        let mut ahead = Self { packets: if prefetches { rays } else { &[] }.chunks(PACKET) };
        for _ in 0..AHEAD {
            ahead.prefetch_next();
        }
        ahead
    }

    #[inline(always)]
    fn prefetch_next(&mut self) {
        if let Some(rays) = self.packets.next().and_then(<[R]>::first_chunk::<PACKET>) {
            simd::fetch(rays);
        }
    }
}

/// Traverses rays: packets first; the others interleaved, or one by one if they are few.
struct Batch<'a, 'r, P: Precision, S> {
    tree: &'a Tree,
    start: &'a FilterStart,
    rays: &'r [P::Ray],
    sink: &'r mut S,
    plan: Plan,
}

impl<P: Precision, S: Sink<P::Answer>> Dispatch for Batch<'_, '_, P, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Simd>(self) {
        let Self { tree, start, rays, sink, plan } = self;
        let decider = &Decider::new(tree, start);
        let mut packet = Packet::<P::Bundle<'_, '_>>::new(decider);
        let mut trials = Trials::NEW;
        let mut others = Vec::with_capacity(rays.len().min(CHUNK));
        for (number, chunk) in rays.chunks(CHUNK).enumerate() {
            let first = number * CHUNK;
            let (packets, _) = chunk.as_chunks::<PACKET>();
            let mut ahead = RaysAhead::new(chunk, P::PREFETCHES_RAYS);
            for (i, rays) in packets.iter().enumerate() {
                ahead.prefetch_next();
                let first = first + PACKET * i;
                let mut answered = 0;
                if plan.has_packets && trials.is_next() {
                    let result = packet.traverse::<L>(rays, first, sink);
                    trials.record(result.pays);
                    answered = result.answered;
                }
                if answered == 0 {
                    others.extend(first..first + PACKET);
                } else if answered != packet::ALL {
                    others.extend((0..PACKET).filter(|i| answered >> i & 1 == 0).map(|i| first + i));
                }
            }
            others.extend(first + PACKET * packets.len()..first + chunk.len());
            if others.len() < plan.least {
                // No calls and no closures: neither inherits target features.
                for &i in &others {
                    sink.put(i, P::traverse_alone::<L>(decider, simd::opaque(&rays[i])));
                }
            } else {
                P::interleave::<L>(decider, plan.prefetches, rays, &others, sink);
            }
            others.clear();
        }
    }
}
