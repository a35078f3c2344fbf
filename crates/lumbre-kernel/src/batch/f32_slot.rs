//! An interleaved ray in single precision.

use std::marker::PhantomData;

use super::interleaved::{PassedLanes, RaySlot};
use crate::intersect::Simd;
use crate::intersect::box_ray::Slabs;
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::watertight;
use crate::ray32::{Hit32, Ray32};
use crate::simd::{F32x8, Vector};
use crate::trace::decide::Decider;
use crate::trace::f32_ray::{Nearest, Pass, SOME_HIT};
use crate::trace::stack::Goal;
use crate::trace::{LaneHits, Outcome};
use crate::tree::BLOCK;
use crate::tree::triangle_block::TriangleBlock;

/// A ray among triangles and its nearest hit: one cache line.
pub(super) struct F32Slot<'a, 'd, G> {
    /// Ends at the nearest hit.
    ray: F32Ray,
    nearest: Nearest,
    goal: PhantomData<(G, &'d Decider<'a>)>,
}

impl<'a, 'd, G: Goal, L: Simd> RaySlot<'a, 'd, L> for F32Slot<'a, 'd, G> {
    type Goal = G;
    type Ray = Ray32;
    type Answer = Option<Hit32>;
    const GENERAL: bool = false;
    type Pass = Pass<L::F32x8>;
    type Passes = Pass<L::F32x16>;
    /// `t`.
    type At = L::F32x8;

    #[inline(always)]
    fn new(_: &'d Decider<'a>) -> Self {
        Self { ray: F32Ray::of_none(), nearest: Nearest::NONE, goal: PhantomData }
    }

    #[inline(always)]
    fn start(&mut self, decider: &'d Decider<'a>, ray: &Ray32) -> Option<Slabs> {
        let slabs = L::start_f32(decider.start, ray)?;
        self.ray = L::start_f32_blocks(decider.start, ray, &slabs);
        self.nearest = Nearest::NONE;
        Some(slabs)
    }

    #[inline(always)]
    fn pass_by_two(
        decider: &Decider,
        slots: [&Self; 2],
        blocks: [&TriangleBlock; 2],
    ) -> (PassedLanes, Pass<L::F32x16>) {
        let precise = &decider.start.precise;
        if L::INTERSECTS_BY_TWO {
            let (mask, lines) = F32Ray::lines_by_two::<L>([&slots[0].ray, &slots[1].ray], blocks);
            let (uncertain, passes) = lines.pass(mask, precise);
            return (PassedLanes { mask: mask & !uncertain, uncertain }, passes);
        }
        let (first, of_first) = slots[0].ray.lines::<L>(blocks[0]);
        let (first_unclear, of_first) = of_first.pass(first, precise);
        let (second, of_second) = slots[1].ray.lines::<L>(blocks[1]);
        let (second_unclear, of_second) = of_second.pass(second, precise);
        let uncertain = first_unclear | second_unclear << BLOCK;
        let mask = (first | second << BLOCK) & !uncertain;
        (PassedLanes { mask, uncertain }, Pass::of_two(&of_first, &of_second))
    }

    #[inline(always)]
    fn one_of(passes: &Pass<L::F32x16>, which: usize) -> Pass<L::F32x8> {
        passes.half(which)
    }

    #[inline(always)]
    fn intersect(&self, mask: u32, pass: &Pass<L::F32x8>) -> LaneHits<L::F32x8> {
        let (met, at) = self.ray.cross(mask, pass);
        LaneHits { met, uncertain: 0, at }
    }

    #[inline(always)]
    fn hits_any(&self, decider: &Decider, _: &Ray32, block: u32, uncertain: u32) -> Outcome<bool> {
        Outcome::Certain(self.ray.meets_exactly(decider.block(block), uncertain))
    }

    #[inline(always)]
    fn take_nearest(
        &mut self,
        decider: &Decider,
        _: &Ray32,
        block: u32,
        hits: &LaneHits<L::F32x8>,
        pass: &Pass<L::F32x8>,
        slabs: &mut Slabs,
    ) -> bool {
        let t = hits.at.reduce_min(hits.met);
        let which = hits.at.simd_le(L::F32x8::splat(t)) & hits.met;
        let lane = which.trailing_zeros() as usize % BLOCK;
        if self.nearest.take_nearest(decider, &mut self.ray, block, hits, pass, (lane, t)) {
            slabs.end_at(watertight::beyond(self.ray.t_max()));
        }
        true
    }

    #[inline(always)]
    fn answer(&mut self, decider: &Decider, _: &Ray32, is_hit: bool) -> Outcome<Option<Hit32>> {
        Outcome::Certain(if G::IS_ANY {
            is_hit.then_some(SOME_HIT)
        } else {
            self.nearest.hit(decider, self.ray.t_max())
        })
    }
}
