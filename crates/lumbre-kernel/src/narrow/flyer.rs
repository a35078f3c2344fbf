//! Rays that fly in single precision.

use std::marker::PhantomData;

use super::{Goal, NarrowRay, Nearest, Pass};
use crate::Ray32;
use crate::blocks::{Blocks, TriangleBlock};
use crate::fleet::{Crossing, Flyer, Passing};
use crate::holds::SingleStart;
use crate::lanes::{Eight, Lanes, Vector};
use crate::node::Slabs;
use crate::single::{Exact, Outcome};
use crate::triangles::{self, BLOCK};

/// A ray in single precision among triangles, and the nearest that it has met.
pub(super) struct NarrowFlyer<G> {
    /// Ends at the nearest.
    ray: NarrowRay,
    nearest: Nearest,
    goal: PhantomData<G>,
}

impl<G: Goal, L: Lanes> Flyer<L> for NarrowFlyer<G> {
    type Ray = Ray32;
    type Answer = G::Answer;
    type Order = G::Order;
    type Block = TriangleBlock;
    type Blocks<'a> = Blocks<'a>;
    const IS_ANY: bool = G::IS_ANY;
    const IS_MIXED: bool = false;
    const STARTS_BY_FOUR: bool = L::STARTS_BY_FOUR;
    type Pass = Pass<L::Eight>;
    type Passes = Pass<L::Wide>;
    /// `t`.
    type At = L::Eight;

    #[inline(always)]
    fn new(_: &SingleStart) -> Self {
        Self { ray: NarrowRay::of_none(), nearest: Nearest::NONE, goal: PhantomData }
    }

    #[inline(always)]
    fn start(start: &SingleStart, ray: &Ray32) -> Option<Slabs> {
        L::start_narrow(start, ray)
    }

    #[inline(always)]
    fn set_out(&mut self, exact: &Exact, ray: &Ray32, slabs: &Slabs) {
        self.ray = L::start_narrow_blocks(exact.start, ray, slabs);
        self.nearest = Nearest::NONE;
    }

    #[inline(always)]
    fn set_out_by_four(exact: &Exact, rays: [&Ray32; 4], flights: [(&mut Self, &mut Slabs); 4]) -> u32 {
        let [(a, a_slabs), (b, b_slabs), (c, c_slabs), (d, d_slabs)] = flights;
        for one in [&mut *a, &mut *b, &mut *c, &mut *d] {
            one.nearest = Nearest::NONE;
        }
        let places =
            [(a_slabs, &mut a.ray), (b_slabs, &mut b.ray), (c_slabs, &mut c.ray), (d_slabs, &mut d.ray)];
        L::start_narrow_by_four(exact.start, rays, places)
    }

    #[inline(always)]
    fn pass_by_two(
        exact: &Exact,
        flyers: [&Self; 2],
        blocks: [&TriangleBlock; 2],
    ) -> (Passing, Pass<L::Wide>) {
        let precise = &exact.start.precise;
        if L::MEETS_BY_TWO {
            let (mask, lines) = NarrowRay::lines_by_two::<L>([&flyers[0].ray, &flyers[1].ray], blocks);
            let (unclear, passes) = lines.pass(mask, precise);
            return (Passing { mask: mask & !unclear, unclear }, passes);
        }
        let (first, of_first) = flyers[0].ray.lines::<L>(blocks[0]);
        let (first_unclear, of_first) = of_first.pass(first, precise);
        let (second, of_second) = flyers[1].ray.lines::<L>(blocks[1]);
        let (second_unclear, of_second) = of_second.pass(second, precise);
        let unclear = first_unclear | second_unclear << BLOCK;
        let mask = (first | second << BLOCK) & !unclear;
        (Passing { mask, unclear }, Pass::of_two(&of_first, &of_second))
    }

    #[inline(always)]
    fn one_of(passes: &Pass<L::Wide>, which: usize) -> Pass<L::Eight> {
        passes.half(which)
    }

    #[inline(always)]
    fn cross(&self, mask: u32, pass: &Pass<L::Eight>) -> Crossing<L::Eight> {
        let (met, at) = self.ray.cross(mask, pass);
        Crossing { met, unclear: 0, at }
    }

    #[inline(always)]
    fn meets_closely(&self, exact: &Exact, _: &Ray32, block: u32, unclear: u32) -> Outcome<bool> {
        Outcome::Settled(self.ray.meets_exactly(exact.block(block), unclear))
    }

    #[inline(always)]
    fn take_nearest(
        &mut self,
        exact: &Exact,
        _: &Ray32,
        block: u32,
        crossing: &Crossing<L::Eight>,
        pass: &Pass<L::Eight>,
        slabs: &mut Slabs,
    ) -> bool {
        let t = crossing.at.least_of(crossing.met);
        let which = crossing.at.at_most(L::Eight::splat(t)) & crossing.met;
        let lane = which.trailing_zeros() as usize % BLOCK;
        if self.nearest.take_nearest(exact, &mut self.ray, block, crossing, pass, (lane, t)) {
            slabs.end_at(triangles::beyond(self.ray.t_max()));
        }
        true
    }

    #[inline(always)]
    fn answer(&self, exact: &Exact, _: &Ray32, is_met: bool) -> Outcome<G::Answer> {
        Outcome::Settled(G::answer(exact, is_met, &self.nearest, self.ray.t_max()))
    }
}
