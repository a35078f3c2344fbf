//! Rays in double precision, which fly in single precision as far as that can decide: as a ray alone does, see [`single`].
//!
//! [`single`]: crate::single

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::{Crossing, Flyer};
use crate::Faces;
use crate::blocks::TriangleBlock;
use crate::holds::SingleStart;
use crate::lanes::{self, Axes, Crossings, Eight, Lanes, Level, Task, Vector};
use crate::node::Slabs;
use crate::single::{Candidate, Exact, Goal, Outcome, heights, largest_component};
use crate::triangles::{self, BLOCK, BlockRay, HeightRange};

/// A ray in double precision among triangles.
pub(crate) struct DoubleFlyer<G> {
    blocks: BlockRay,
    /// From heights to places in the range of boxes.
    place_per_height: f32,
    /// The nearest so far.
    best: Candidate,
    goal: PhantomData<G>,
}

impl<G> DoubleFlyer<G> {
    #[inline(always)]
    fn keep(&mut self, better: Candidate, slabs: &mut Slabs) {
        self.best = better;
        self.blocks.range.last = better.to;
        slabs.end_at(triangles::beyond(better.to * self.place_per_height));
    }

    /// Looks for what is nearer among triangles of a block that are met, or may be: between two heights each.
    #[cold]
    #[inline(never)]
    fn seek_closely(
        &self,
        level: Level,
        exact: &Exact,
        ray: &Ray,
        block: u32,
        crossing: &Crossing<[[f32; BLOCK]; 2]>,
    ) -> Outcome<Option<Candidate>> {
        level.run(Seeking { exact, ray, axes: self.blocks.axes, best: self.best, block, crossing })
    }
}

/// See [`DoubleFlyer::seek_closely`].
struct Seeking<'s, 'a> {
    exact: &'s Exact<'a>,
    ray: &'s Ray,
    axes: &'static Axes,
    best: Candidate,
    /// Its place.
    block: u32,
    crossing: &'s Crossing<[[f32; BLOCK]; 2]>,
}

impl Task for Seeking<'_, '_> {
    type Output = Outcome<Option<Candidate>>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { exact, ray, axes, best, block, crossing } = self;
        let &Crossing { met, unclear, at: [ref froms, ref tos] } = crossing;
        let mut better = None;
        let mut rest = met | unclear;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            let best = better.unwrap_or(best);
            let (from, to) = (froms[lane as usize % BLOCK], tos[lane as usize % BLOCK]);
            // What is no number is not farther.
            if from > best.to {
                continue;
            }
            if met >> lane & 1 != 0 && to < best.from {
                better = Some(Candidate { block, lane, from, to });
                continue;
            }
            match exact.contest::<L>(ray, axes, (block, lane), (&best, None), Faces::Both) {
                Outcome::Settled(Some(t)) => {
                    let (from, to) = heights(t, largest_component(ray));
                    better = Some(Candidate { block, lane, from, to });
                }
                Outcome::Settled(None) => {}
                Outcome::Unsettled => return Outcome::Unsettled,
            }
        }
        Outcome::Settled(better)
    }
}

/// Whether a ray meets one of these triangles of a block.
#[cold]
#[inline(never)]
fn meets_closely(
    level: Level,
    exact: &Exact,
    ray: &Ray,
    axes: &'static Axes,
    triangles: (u32, u32),
) -> Outcome<bool> {
    level.run(MeetsAny { exact, ray, axes, triangles })
}

/// See [`meets_closely`].
struct MeetsAny<'s, 'a> {
    exact: &'s Exact<'a>,
    ray: &'s Ray,
    axes: &'static Axes,
    /// The place of the block, and the mask.
    triangles: (u32, u32),
}

impl Task for MeetsAny<'_, '_> {
    type Output = Outcome<bool>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Outcome<bool> {
        let Self { exact, ray, axes, triangles: (place, mut rest) } = self;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            if exact.passes::<L>(ray, axes, exact.block(place), lane) {
                continue;
            }
            match exact.meet(ray, place, lane) {
                triangles::Meeting::Miss => {}
                triangles::Meeting::Hit { .. } => return Outcome::Settled(true),
                triangles::Meeting::Touch { .. } => return Outcome::Unsettled,
            }
        }
        Outcome::Settled(false)
    }
}

impl<G: Goal, L: Lanes> Flyer<L> for DoubleFlyer<G> {
    type Ray = Ray;
    type Answer = G::Answer;
    type Order = G::Order;
    const IS_ANY: bool = G::IS_ANY;
    type Pass = L::Edges;
    /// Heights along the ray between which the crossing lies.
    type At = [L::Eight; 2];

    #[inline(always)]
    fn new(start: &SingleStart) -> Self {
        let blocks = BlockRay {
            axes: Axes::by_bits(0, 0),
            origin: [0.0; 4],
            rest: [0.0; 4],
            shear: [0.0; 4],
            least_size: start.least_size,
            range: HeightRange::ahead(0.0, 0.0),
            turn: 0.0,
        };
        Self { blocks, place_per_height: 0.0, best: Candidate::NONE, goal: PhantomData }
    }

    #[inline(always)]
    fn start(start: &SingleStart, ray: &Ray) -> Option<Slabs> {
        L::start_single(start, ray)
    }

    #[inline(always)]
    fn set_out(&mut self, start: &SingleStart, ray: &Ray, slabs: &Slabs) {
        (self.blocks, self.place_per_height) = L::start_blocks(start, ray, slabs);
        self.best = Candidate::NONE;
    }

    #[inline(always)]
    fn pass(&self, block: &TriangleBlock) -> (u32, L::Edges) {
        L::meet_triangles::<false>(block, lanes::opaque(&self.blocks))
    }

    #[inline(always)]
    fn cross(&self, mask: u32, edges: &L::Edges) -> Crossing<[L::Eight; 2]> {
        let Crossings { in_range, sure, from, to } = L::place_crossings(edges, lanes::opaque(&self.blocks));
        Crossing { met: mask & sure, unclear: mask & in_range & !sure, at: [from, to] }
    }

    fn meets_closely(&self, exact: &Exact, ray: &Ray, block: u32, unclear: u32) -> Outcome<bool> {
        meets_closely(L::level(), exact, ray, self.blocks.axes, (block, unclear))
    }

    #[inline(always)]
    fn take_nearest(
        &mut self,
        exact: &Exact,
        ray: &Ray,
        block: u32,
        crossing: &Crossing<[L::Eight; 2]>,
        slabs: &mut Slabs,
    ) -> bool {
        let &Crossing { met, unclear, at: [from, to] } = crossing;
        let nearest = to.least_of(met);
        let which = from.at_most(L::Eight::splat(nearest)) & met;
        let is_alone = which & which.wrapping_sub(1) == 0;
        if unclear == 0 && is_alone && nearest < self.best.from {
            let lane = which.trailing_zeros();
            self.keep(Candidate { block, lane, from: from.lane(lane as usize), to: nearest }, slabs);
            return true;
        }
        let crossing = Crossing { met, unclear, at: [from.to_array(), to.to_array()] };
        match self.seek_closely(L::level(), exact, ray, block, &crossing) {
            Outcome::Settled(Some(better)) => self.keep(better, slabs),
            Outcome::Settled(None) => {}
            Outcome::Unsettled => return false,
        }
        true
    }

    #[inline(always)]
    fn answer(&self, exact: &Exact, ray: &Ray, is_met: bool) -> Outcome<G::Answer> {
        G::answer_in_flight::<L>(exact, ray, self.blocks.axes, is_met, &self.best)
    }
}
