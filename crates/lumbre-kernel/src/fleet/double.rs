//! Rays in double precision, which fly in single precision as far as that can decide: as a ray alone does, see [`single`].
//!
//! [`single`]: crate::single

use std::borrow::Borrow;
use std::marker::PhantomData;

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use super::{Crossing, Flyer, Passing};
use crate::blocks::{Blocks, TriangleBlock};
use crate::collapse::Entry;
use crate::holds::SingleStart;
use crate::hulls::{HullBlock, HullRay};
use crate::lanes::{self, Axes, Crossings, Eight, Glanced, Lanes, Level, MetHulls, Task, Vector};
use crate::node::{Slabs, Units};
use crate::packet::PACKET;
use crate::single::{Candidate, Exact, Goal, Outcome, Step, Winner, heights, largest_component};
use crate::triangles::{self, BLOCK, BlockRay, HeightRange};
use crate::{Faces, Ray32, traverse};

/// What a ray has to know of shapes and custom geometry.
pub(crate) trait Beside {
    /// Whether there are any beside triangles.
    const ARE_ANY: bool;
    /// Of a ray that has not set out.
    const NOTHING: Self;

    /// That of another ray.
    fn set_out(&mut self, units: &Units, ray: &Ray);
    /// The ray for hulls.
    fn hulls(&self) -> Option<&HullRay>;
    /// The last of its nearest hits that was of no triangle.
    fn crossed(&self) -> Option<Winner>;
    /// Takes that.
    fn keep(&mut self, crossed: Winner);
}

/// Triangles are all there is.
pub(crate) struct Triangles;

impl Beside for Triangles {
    const ARE_ANY: bool = false;
    const NOTHING: Self = Self;

    #[inline(always)]
    fn set_out(&mut self, _: &Units, _: &Ray) {}

    #[inline(always)]
    fn hulls(&self) -> Option<&HullRay> {
        None
    }

    #[inline(always)]
    fn crossed(&self) -> Option<Winner> {
        None
    }

    #[inline(always)]
    fn keep(&mut self, _: Winner) {}
}

/// There may be shapes and custom geometry.
pub(crate) struct Shapes {
    hulls: HullRay,
    crossed: Option<Winner>,
}

impl Beside for Shapes {
    const ARE_ANY: bool = true;
    const NOTHING: Self =
        Self { hulls: HullRay { origin: [0.0; 3], rest: [0.0; 3], direction: [0.0; 3] }, crossed: None };

    #[inline(always)]
    fn set_out(&mut self, units: &Units, ray: &Ray) {
        self.hulls = HullRay::new(units, ray, largest_component(ray));
        self.crossed = None;
    }

    #[inline(always)]
    fn hulls(&self) -> Option<&HullRay> {
        Some(&self.hulls)
    }

    #[inline(always)]
    fn crossed(&self) -> Option<Winner> {
        self.crossed
    }

    #[inline(always)]
    fn keep(&mut self, crossed: Winner) {
        self.crossed = Some(crossed);
    }
}

/// A ray that is asked in either precision, and searched for in double.
pub(crate) trait Doubled {
    /// In double precision.
    fn doubled<L: Lanes>(&self) -> impl Borrow<Ray>;
    /// The same of a packet.
    fn all_doubled<L: Lanes>(rays: &[Self; PACKET]) -> impl Borrow<[Ray; PACKET]>
    where
        Self: Sized;
}

impl Doubled for Ray {
    #[inline(always)]
    fn doubled<L: Lanes>(&self) -> impl Borrow<Self> {
        self
    }

    #[inline(always)]
    fn all_doubled<L: Lanes>(rays: &[Self; PACKET]) -> impl Borrow<[Self; PACKET]> {
        rays
    }
}

impl Doubled for Ray32 {
    #[inline(always)]
    fn doubled<L: Lanes>(&self) -> impl Borrow<Ray> {
        L::widened(self)
    }

    #[inline(always)]
    fn all_doubled<L: Lanes>(rays: &[Self; PACKET]) -> impl Borrow<[Ray; PACKET]> {
        let mut doubled = [Ray::new(DVec3::ZERO, DVec3::ZERO); PACKET];
        for (doubled, ray) in doubled.iter_mut().zip(rays) {
            *doubled = L::widened(ray);
        }
        doubled
    }
}

/// A ray in double precision, among triangles and what stands beside them.
pub(crate) struct DoubleFlyer<G, B, R> {
    blocks: BlockRay,
    /// From heights to places in the range of boxes.
    place_per_height: f32,
    /// The nearest so far.
    best: Candidate,
    beside: B,
    asked: PhantomData<(G, R)>,
}

impl<G, B: Beside, R> DoubleFlyer<G, B, R> {
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
        let (best, crossed) = (self.best, self.crossed());
        level.run(Seeking { exact, ray, axes: self.blocks.axes, best, crossed, block, crossing })
    }

    /// The best, where it is no triangle.
    #[inline(always)]
    fn crossed(&self) -> Option<Winner> {
        if self.best.is_triangle() { None } else { self.beside.crossed() }
    }
}

/// See [`DoubleFlyer::seek_closely`].
struct Seeking<'s, 'a> {
    exact: &'s Exact<'a>,
    ray: &'s Ray,
    axes: &'static Axes,
    best: Candidate,
    /// The best, where it is no triangle.
    crossed: Option<Winner>,
    /// Its place.
    block: u32,
    crossing: &'s Crossing<[[f32; BLOCK]; 2]>,
}

impl Task for Seeking<'_, '_> {
    type Output = Outcome<Option<Candidate>>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { exact, ray, axes, best, crossed, block, crossing } = self;
        let &Crossing { met, unclear, at: [ref froms, ref tos] } = crossing;
        let mut better = None;
        let mut rest = met | unclear;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            let (best, crossed) = match better {
                Some(better) => (better, None),
                None => (best, crossed),
            };
            let (from, to) = (froms[lane as usize % BLOCK], tos[lane as usize % BLOCK]);
            // What is no number is not farther.
            if from > best.to {
                continue;
            }
            if met >> lane & 1 != 0 && to < best.from {
                better = Some(Candidate { block, lane, from, to });
                continue;
            }
            match exact.contest::<L>(ray, axes, (block, lane), (&best, crossed), Faces::Both) {
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

impl<G: Goal, B: Beside, R: Doubled, L: Lanes> Flyer<L> for DoubleFlyer<G, B, R> {
    type Ray = R;
    type Answer = G::Answer;
    type Order = G::Order;
    type Block = TriangleBlock;
    type Blocks<'a> = Blocks<'a>;
    const IS_ANY: bool = G::IS_ANY;
    const IS_MIXED: bool = B::ARE_ANY;
    type Pass = L::Edges;
    type Passes = L::EdgesByTwo;
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
        Self { blocks, place_per_height: 0.0, best: Candidate::NONE, beside: B::NOTHING, asked: PhantomData }
    }

    #[inline(always)]
    fn start(start: &SingleStart, ray: &R) -> Option<Slabs> {
        L::start_single(start, ray.doubled::<L>().borrow())
    }

    #[inline(always)]
    fn set_out(&mut self, exact: &Exact, ray: &R, slabs: &Slabs) {
        let ray = ray.doubled::<L>();
        let ray = ray.borrow();
        (self.blocks, self.place_per_height) = L::start_blocks(exact.start, ray, slabs);
        self.best = Candidate::NONE;
        self.beside.set_out(&exact.accel().units, ray);
    }

    #[inline(always)]
    fn pass_by_two(_: &Exact, flyers: [&Self; 2], blocks: [&TriangleBlock; 2]) -> (Passing, L::EdgesByTwo) {
        let (mask, edges) = L::meet_triangles_by_two(blocks, [&flyers[0].blocks, &flyers[1].blocks]);
        (Passing { mask, unclear: 0 }, edges)
    }

    #[inline(always)]
    fn one_of(passes: &L::EdgesByTwo, which: usize) -> L::Edges {
        L::edges_of(passes, which)
    }

    #[inline(always)]
    fn cross(&self, mask: u32, edges: &L::Edges) -> Crossing<[L::Eight; 2]> {
        let Crossings { in_range, sure, from, to } = L::place_crossings(edges, lanes::opaque(&self.blocks));
        Crossing { met: mask & sure, unclear: mask & in_range & !sure, at: [from, to] }
    }

    fn meets_closely(&self, exact: &Exact, ray: &R, block: u32, unclear: u32) -> Outcome<bool> {
        meets_closely(L::level(), exact, ray.doubled::<L>().borrow(), self.blocks.axes, (block, unclear))
    }

    #[inline(always)]
    fn take_nearest(
        &mut self,
        exact: &Exact,
        ray: &R,
        block: u32,
        crossing: &Crossing<[L::Eight; 2]>,
        _: &L::Edges,
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
        match self.seek_closely(L::level(), exact, ray.doubled::<L>().borrow(), block, &crossing) {
            Outcome::Settled(Some(better)) => self.keep(better, slabs),
            Outcome::Settled(None) => {}
            Outcome::Unsettled => return false,
        }
        true
    }

    #[inline(always)]
    fn glance_by_two(flyers: [&Self; 2], blocks: [&HullBlock; 2]) -> Glanced {
        let (Some(first), Some(second)) = (flyers[0].beside.hulls(), flyers[1].beside.hulls()) else {
            return Glanced::NOTHING;
        };
        let rays = [lanes::opaque(first), lanes::opaque(second)];
        let ranges = [&flyers[0].blocks.range, &flyers[1].blocks.range];
        if G::IS_ANY {
            lanes::glance_by_two::<L, true>(blocks, rays, ranges)
        } else {
            lanes::glance_by_two::<L, false>(blocks, rays, ranges)
        }
    }

    #[inline(always)]
    fn meet_hulls(&self, block: &HullBlock) -> MetHulls {
        match self.beside.hulls() {
            Some(hulls) if G::IS_ANY => lanes::meet_hulls::<L, true>(block, hulls, &self.blocks.range),
            Some(hulls) => lanes::meet_hulls::<L, false>(block, hulls, &self.blocks.range),
            None => MetHulls::NONE,
        }
    }

    #[inline(always)]
    fn last(&self) -> f32 {
        self.blocks.range.last
    }

    #[inline(always)]
    fn meet_entry(&mut self, exact: &Exact, ray: &R, entry: &Entry, slabs: &mut Slabs) -> Option<Step> {
        let ray = ray.doubled::<L>();
        let ray = ray.borrow();
        let (geometry, primitive) = (entry.geometry, entry.primitive());
        let kind = &exact.accel().geometries[geometry as usize].kind;
        if G::IS_ANY {
            return traverse::is_crossed(kind, primitive, ray).then_some(Step::Met);
        }
        let root = traverse::first_crossing(kind, primitive, ray)?;
        let best = (&self.best, self.crossed());
        match exact.contest_crossing(ray, root.t, (geometry, primitive), best) {
            Outcome::Settled(Some(heights)) => {
                self.beside.keep(Winner { root, geometry, primitive });
                self.keep(Candidate::crossed(heights), slabs);
            }
            Outcome::Settled(None) => {}
            Outcome::Unsettled => return Some(Step::Unsettled),
        }
        None
    }

    #[inline(always)]
    fn answer(&self, exact: &Exact, ray: &R, is_met: bool) -> Outcome<G::Answer> {
        let ray = ray.doubled::<L>();
        let ray = ray.borrow();
        G::answer_in_flight::<L>(exact, ray, self.blocks.axes, is_met, (&self.best, self.crossed()))
    }
}
