//! The nearest hit and any hit in trees of nothing but spheres of clouds that have one origin, in single precision wherever that can
//! decide.
//!
//! As among triangles (see [`single`](crate::single)), what single precision is certain of is kept by its place in the tree and the
//! places on the ray between which it is met (see [`SphereRay`]), and double precision is asked where that does not tell, and once a ray,
//! about the nearest. So the answer has the bits of that of the plain search (see [`sphere_search`](crate::sphere_search)), which answers
//! for rays from afar.

use std::borrow::Borrow;
use std::marker::PhantomData;

use lumbre_geometry::{Ray, Root};

use crate::Accel;
use crate::fleet::{Crossing, Doubled, Flyer, LeafBlocks, Passing};
use crate::holds::SingleStart;
use crate::lanes::{self, Eight, Lanes, Question, SphereCrossings, SpherePass, Task};
use crate::node::{Slabs, out_of_tree, tag};
use crate::single::{Exact, Goal, Outcome, Winner};
use crate::spheres::{SphereBlock, SphereRay};
use crate::stack::Stack;
use crate::traverse::What;
use crate::triangles::{self, BLOCK};
use crate::way::Way;

/// A ray among the spheres of a tree, and the nearest that it has met. Among boxes it takes a cache line, and here the next.
#[derive(Clone, Copy)]
pub(crate) struct Seeking {
    /// Ends at the nearest.
    ray: SphereRay,
    /// From places on the ray to its range among boxes.
    range_per_length: f32,
    /// The place of the block of the nearest, and the lane in the last three bits.
    nearest: u32,
}

const _: () = assert!(size_of::<Seeking>() <= 64);

/// No sphere has that place.
const NOWHERE: u32 = u32::MAX;

impl Seeking {
    const NOTHING: Self = Self { ray: SphereRay::NONE, range_per_length: 0.0, nearest: NOWHERE };

    /// With a ray that comes from nearby.
    #[inline(always)]
    fn new(start: &SingleStart, ray: &Ray) -> Self {
        let (mut spheres, length) = SphereRay::sharp(ray, &start.cloud_origin, start.sphere_reach);
        spheres.set_range(length, ray.t_min, ray.t_max);
        Self { ray: spheres, range_per_length: (1.0 / length) as f32, nearest: NOWHERE }
    }

    /// Takes the nearest of those that it meets in a block, if that is nearer than what it met before.
    #[inline(always)]
    fn take_nearest<E: Eight>(
        &mut self,
        exact: &Exact,
        ray: &Ray,
        block: u32,
        crossings: &SphereCrossings<E>,
        slabs: &mut Slabs,
    ) {
        let &SphereCrossings { met, unclear, from, to } = crossings;
        let nearest = to.least_of(met);
        let which = from.at_most(E::splat(nearest + self.ray.range_margin)) & (met | unclear);
        let lane = which.trailing_zeros() as usize % BLOCK;
        if which.is_power_of_two() && which & met != 0 {
            self.keep(block, lane, (from.lane(lane), nearest), slabs);
        } else {
            self.take_closely(exact, ray, block, which, slabs);
        }
    }

    /// The same of those in the mask, of which it is not clear which is met first, or whether one is.
    #[inline(never)]
    fn take_closely(&mut self, exact: &Exact, ray: &Ray, block: u32, mut mask: u32, slabs: &mut Slabs) {
        // As double precision has it, once that is asked.
        let mut nearest = None;
        let mut kept = None;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % BLOCK;
            mask &= mask - 1;
            let Some(root) = root_of(exact, ray, block, lane) else { continue };
            let nearest = nearest.get_or_insert_with(|| self.nearest(exact, ray));
            // What is denied stays, so that the answer tells.
            let Outcome::Settled(nearest) = nearest else { return };
            let names = names_of(exact, block, lane);
            if nearest.is_none_or(|nearest| nearest.comes_after(root.t, names)) {
                *nearest = Some(Winner { root, geometry: names.0, primitive: names.1 });
                kept = Some((lane, (root.t * ray.direction.length()) as f32));
            }
        }
        if let Some((lane, place)) = kept {
            self.keep(block, lane, (place, place), slabs);
        }
    }

    /// Keeps the nearest, which lies between two places on the ray.
    #[inline(always)]
    fn keep(&mut self, block: u32, lane: usize, (from, to): (f32, f32), slabs: &mut Slabs) {
        let range_margin = self.ray.range_margin;
        self.nearest = block * BLOCK as u32 + lane as u32;
        self.ray.far = to + range_margin;
        self.ray.surely_in[1] = from - range_margin;
        slabs.end_at(triangles::beyond(self.ray.far * self.range_per_length));
    }

    /// The nearest, as double precision has it. Should that ever deny what single precision was certain of, the plain search has to answer.
    #[inline(always)]
    fn nearest(&self, exact: &Exact, ray: &Ray) -> Outcome<Option<Winner>> {
        if self.nearest == NOWHERE {
            return Outcome::Settled(None);
        }
        let (block, lane) = (self.nearest / BLOCK as u32, self.nearest as usize % BLOCK);
        let Some(root) = root_of(exact, ray, block, lane) else { return Outcome::Unsettled };
        let (geometry, primitive) = names_of(exact, block, lane);
        Outcome::Settled(Some(Winner { root, geometry, primitive }))
    }

    /// What came of it: whether any hit `is_met`, or what it has taken.
    #[inline(always)]
    fn answer<G: Goal>(&self, exact: &Exact, ray: &Ray, is_met: bool) -> Outcome<G::Answer> {
        if G::IS_ANY {
            return Outcome::Settled(G::known(is_met, None));
        }
        match self.nearest(exact, ray) {
            Outcome::Settled(nearest) => Outcome::Settled(G::known(false, nearest)),
            Outcome::Unsettled => Outcome::Unsettled,
        }
    }
}

/// Where a ray crosses a sphere for the first time in its range.
#[inline(always)]
fn root_of(exact: &Exact, ray: &Ray, block: u32, lane: usize) -> Option<Root> {
    exact.accel().tree.sphere_blocks[block as usize].sphere(lane, &exact.start.cloud_origin).closest(ray)
}

/// Geometry and primitive.
#[inline(always)]
fn names_of(exact: &Exact, block: u32, lane: usize) -> (u32, u32) {
    What::Sphere { block, lane: lane as u32 }.names(exact.accel())
}

/// Whether a ray crosses one of these.
#[inline(always)]
fn crosses_any(exact: &Exact, ray: &Ray, block: u32, mut mask: u32) -> bool {
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize % BLOCK;
        mask &= mask - 1;
        if root_of(exact, ray, block, lane).is_some() {
            return true;
        }
    }
    false
}

/// The blocks of spheres of a tree.
#[derive(Clone, Copy)]
pub(crate) struct SphereBlocks<'a>(&'a [SphereBlock]);

impl<'a> LeafBlocks<'a> for SphereBlocks<'a> {
    type Block = SphereBlock;

    #[inline(always)]
    fn of(exact: &Exact<'a>) -> Self {
        Self(&exact.accel().tree.sphere_blocks)
    }

    #[inline(always)]
    fn place(leaf: u32) -> u32 {
        tag::blocks(leaf).start as u32
    }

    #[inline(always)]
    fn block(self, leaf: u32) -> &'a SphereBlock {
        let Self(blocks) = self;
        let Some(block) = blocks.get(tag::blocks(leaf).start) else { out_of_tree() };
        block
    }

    #[inline(always)]
    fn is_last(leaf: u32, _: &SphereBlock) -> bool {
        tag::blocks(leaf).len() == 1
    }

    #[inline(always)]
    fn next(self, leaf: u32) -> u32 {
        tag::behind_first(leaf)
    }

    #[inline(always)]
    fn fetch(self, leaf: u32) {
        lanes::fetch(self.block(leaf));
    }
}

/// A ray that flies among spheres.
pub(crate) struct SphereFlyer<G, R> {
    seeking: Seeking,
    asked: PhantomData<(G, R)>,
}

impl<G: Goal, R: Doubled, L: Lanes> Flyer<L> for SphereFlyer<G, R> {
    type Ray = R;
    type Answer = G::Answer;
    type Order = G::Order;
    type Block = SphereBlock;
    type Blocks<'a> = SphereBlocks<'a>;
    const IS_ANY: bool = G::IS_ANY;
    const IS_MIXED: bool = false;
    const LEAVES_HAVE_SIGNS: bool = true;
    type Pass = SpherePass<L::Eight>;
    type Passes = SpherePass<L::Wide>;
    /// Places on the ray between which the first crossing lies.
    type At = [L::Eight; 2];

    #[inline(always)]
    fn new(_: &SingleStart) -> Self {
        Self { seeking: Seeking::NOTHING, asked: PhantomData }
    }

    #[inline(always)]
    fn start(start: &SingleStart, ray: &R) -> Option<Slabs> {
        L::start_single(start, ray.doubled::<L>().borrow())
    }

    #[inline(always)]
    fn set_out(&mut self, exact: &Exact, ray: &R, _: &Slabs) {
        self.seeking = Seeking::new(exact.start, ray.doubled::<L>().borrow());
    }

    #[inline(always)]
    fn pass_by_two(
        _: &Exact,
        flyers: [&Self; 2],
        blocks: [&SphereBlock; 2],
    ) -> (Passing, SpherePass<L::Wide>) {
        let rays = [lanes::opaque(&flyers[0].seeking.ray), lanes::opaque(&flyers[1].seeking.ray)];
        let (mask, passes) = lanes::pass_spheres_by_two::<L>(blocks, rays);
        (Passing { mask, unclear: 0 }, passes)
    }

    #[inline(always)]
    fn one_of(passes: &SpherePass<L::Wide>, which: usize) -> SpherePass<L::Eight> {
        passes.half(which)
    }

    #[inline(always)]
    fn cross(&self, mask: u32, pass: &SpherePass<L::Eight>) -> Crossing<[L::Eight; 2]> {
        let ray = lanes::opaque(&self.seeking.ray);
        let SphereCrossings { met, unclear, from, to } = if G::IS_ANY {
            lanes::cross_spheres::<_, true>(mask, pass, ray)
        } else {
            lanes::cross_spheres::<_, false>(mask, pass, ray)
        };
        Crossing { met, unclear, at: [from, to] }
    }

    #[inline(always)]
    fn meets_closely(&self, exact: &Exact, ray: &R, block: u32, unclear: u32) -> Outcome<bool> {
        Outcome::Settled(crosses_any(exact, ray.doubled::<L>().borrow(), block, unclear))
    }

    #[inline(always)]
    fn take_nearest(
        &mut self,
        exact: &Exact,
        ray: &R,
        block: u32,
        crossing: &Crossing<[L::Eight; 2]>,
        _: &SpherePass<L::Eight>,
        slabs: &mut Slabs,
    ) -> bool {
        let &Crossing { met, unclear, at: [from, to] } = crossing;
        let crossings = SphereCrossings { met, unclear, from, to };
        self.seeking.take_nearest(exact, ray.doubled::<L>().borrow(), block, &crossings, slabs);
        true
    }

    #[inline(always)]
    fn answer(&self, exact: &Exact, ray: &R, is_met: bool) -> Outcome<G::Answer> {
        self.seeking.answer::<G>(exact, ray.doubled::<L>().borrow(), is_met)
    }
}

/// A search with one ray.
pub(crate) struct AloneAmongSpheres<'a, 'r, G> {
    accel: &'a Accel,
    start: &'a SingleStart,
    /// The node that it starts at.
    root: u32,
    ray: &'r Ray,
    goal: PhantomData<G>,
}

impl<'a, 'r, G: Goal> AloneAmongSpheres<'a, 'r, G> {
    /// From a node on.
    #[inline(always)]
    pub(crate) fn new(accel: &'a Accel, start: &'a SingleStart, root: u32, ray: &'r Ray) -> Self {
        Self { accel, start, root, ray, goal: PhantomData }
    }
}

impl<G: Goal> Task for AloneAmongSpheres<'_, '_, G> {
    type Output = Outcome<G::Answer>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let Self { accel, start, root, ray, .. } = self;
        let Some(slabs) = L::start_single(start, ray) else { return Outcome::Unsettled };
        let mut way = Way::<L>::new(&accel.tree.nodes, slabs);
        let mut stack = Stack::new();
        let Some(mut leaf) = way.descend::<G::Order>(root, &mut stack) else {
            // Many rays come to no leaf, and need nothing else.
            return Outcome::Settled(G::NOTHING);
        };
        let exact = &Exact::new(accel, start);
        let mut seeking = Seeking::new(start, lanes::opaque(ray));
        loop {
            let places = tag::blocks(leaf);
            for (block, spheres) in (places.start as u32..).zip(&accel.tree.sphere_blocks[places]) {
                let (mask, pass) = lanes::pass_spheres::<L>(spheres, lanes::opaque(&seeking.ray));
                if mask == 0 {
                    continue;
                }
                if G::IS_ANY {
                    let crossings = lanes::cross_spheres::<_, true>(mask, &pass, &seeking.ray);
                    let SphereCrossings { met, unclear, .. } = crossings;
                    if met != 0 || crosses_any(exact, ray, block, unclear) {
                        return Outcome::Settled(G::known(true, None));
                    }
                } else {
                    let crossings = lanes::cross_spheres::<_, false>(mask, &pass, &seeking.ray);
                    if crossings.met | crossings.unclear != 0 {
                        seeking.take_nearest(exact, ray, block, &crossings, way.slabs_mut());
                    }
                }
            }
            let Some(next) = way.pop::<G::Order>(&mut stack) else { break };
            let Some(next) = way.descend::<G::Order>(next, &mut stack) else { break };
            leaf = next;
        }
        seeking.answer::<G>(exact, ray, false)
    }
}

/// In single precision first.
pub(crate) struct AmongSpheres<G>(PhantomData<G>);

impl<G: Goal> Question for AmongSpheres<G> {
    type Ray = Ray;
    type Answer = G::Found;

    #[inline(always)]
    fn ask<L: Lanes>(accel: &Accel, ray: &Ray) -> G::Found {
        if let Some(start) = &accel.single
            && let ray = L::read(ray)
            && let Outcome::Settled(answer) =
                AloneAmongSpheres::<G>::new(accel, start, start.root, &ray).run::<L>()
        {
            return G::found(accel, answer);
        }
        G::find_plainly(accel, L::level(), ray)
    }
}
