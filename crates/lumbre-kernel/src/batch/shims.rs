//! Batches for tests: with a given plan and instruction set, and a count of rays that the exact traversal answered.

use std::cell::Cell;

use lumbre_geometry::Ray;

use super::packet::{PACKET, Packet};
use super::{
    AnySink, ClosestSink, F32AnySink, F32ClosestSink, F64Bundle, Plan, Sink, batch_f32, batch_f64, batched,
};
use crate::hit::Hit;
use crate::intersect::{Dispatch, Isa, Simd};
use crate::ray32::{Hit32, Ray32};
use crate::trace::Outcome;
use crate::trace::decide::Decider;
use crate::trace::f32_ray::F32Queries;
use crate::trace::filtered_ray::Found;
use crate::trace::stack::{AnyHit, ClosestHit};
use crate::tree::Tree;

/// Plans without packets.
pub(crate) const INTERLEAVED: [Plan; 2] =
    [Plan { has_packets: false, ..Plan::NEAR }, Plan { has_packets: false, ..Plan::FAR }];

thread_local! {
    /// Rays answered in total, and by the exact traversal.
    static ANSWERED: Cell<[usize; 2]> = const { Cell::new([0; 2]) };
}

pub(super) fn count<A>(outcome: &Outcome<A>) {
    let [all, exactly] = ANSWERED.get();
    ANSWERED.set([all + 1, exactly + usize::from(matches!(outcome, Outcome::Uncertain))]);
}

/// Closest hits by a plan, each answered once; returns how many the exact traversal found.
pub(crate) fn closest(isa: Isa, tree: &Tree, rays: &[Ray], hits: &mut [Option<Hit>], plan: Plan) -> usize {
    ANSWERED.set([0; 2]);
    if !batch_f64::<ClosestHit, _>(isa, tree, rays, &mut ClosestSink { tree, isa, rays, hits }, plan) {
        super::closest(isa, tree, rays, hits);
        return 0;
    }
    let [all, exactly] = ANSWERED.get();
    assert_eq!(all, rays.len(), "each once");
    exactly
}

/// As [`closest`], for any hits.
pub(crate) fn any(isa: Isa, tree: &Tree, rays: &[Ray], hits: &mut [bool], plan: Plan) -> usize {
    ANSWERED.set([0; 2]);
    if !batch_f64::<AnyHit, _>(isa, tree, rays, &mut AnySink { tree, isa, rays, hits }, plan) {
        super::any(isa, tree, rays, hits);
        return 0;
    }
    let [all, exactly] = ANSWERED.get();
    assert_eq!(all, rays.len(), "each once");
    exactly
}

/// Closest and any hits in single precision, by a plan that interleaves even few rays.
pub(crate) fn f32(isa: Isa, tree: &Tree, rays: &[Ray32], hits: &mut [Option<Hit32>], are_hit: &mut [bool]) {
    let plan = Plan::MIDDLE;
    let Some(queries) = F32Queries::of(isa, tree).filter(|_| batched(isa, tree).is_some()) else {
        super::closest_f32(isa, tree, rays, hits);
        super::any_f32(isa, tree, rays, are_hit);
        return;
    };
    batch_f32::<ClosestHit, _>(isa, tree, rays, &mut F32ClosestSink { tree, queries, rays, hits }, plan);
    batch_f32::<AnyHit, _>(isa, tree, rays, &mut F32AnySink { tree, queries, rays, hits: are_hit }, plan);
}

/// The rays that a packet answers; none without vectors.
pub(crate) fn answered_by_packet(isa: Isa, tree: &Tree, rays: &[Ray; PACKET]) -> u32 {
    struct Traversing<'a, const GENERAL: bool>(Decider<'a>, &'a [Ray; PACKET]);
    struct Nowhere;
    impl Sink<Found> for Nowhere {
        fn put(&mut self, _: usize, _: Outcome<Found>) {}
    }
    impl<const GENERAL: bool> Dispatch for Traversing<'_, GENERAL> {
        type Output = u32;
        #[inline(always)]
        fn run<L: Simd>(self) -> u32 {
            let mut packet = Packet::<F64Bundle<ClosestHit, GENERAL>>::new(&self.0);
            packet.traverse::<L>(self.1, 0, &mut Nowhere).answered
        }
    }
    if !isa.has_vectors() {
        return 0;
    }
    let start = tree.single.as_ref().expect("single precision traverses it");
    let decider = Decider::new(tree, start);
    if start.only_triangles {
        isa.run_with_vectors(Traversing::<false>(decider, rays))
    } else {
        isa.run_with_vectors(Traversing::<true>(decider, rays))
    }
}
