//! An interleaved ray in double precision: the ray of the filtered traversal.

use lumbre_geometry::Ray;

use super::interleaved::{PassedLanes, RaySlot};
use crate::intersect::box_ray::Slabs;
use crate::intersect::watertight::{BlockRay, HeightRange, Meeting};
use crate::intersect::{Axes, Crossings, Dispatch, Edges, Isa, Simd};
use crate::simd::{self, F32x8, Vector};
use crate::trace::decide::{Candidate, Decider, heights};
use crate::trace::filtered_ray::{FilteredGoal, FilteredRay};
use crate::trace::largest_component;
use crate::trace::{ContextRef, LaneHits, Outcome, Stop, Winner};
use crate::tree::BLOCK;
use crate::tree::triangle_block::TriangleBlock;

/// A ray in the leaves of a tree.
pub(super) struct F64Slot<'a, 'd, G, const GENERAL: bool> {
    ray: FilteredRay<'a, 'd, GENERAL, false>,
    goal: std::marker::PhantomData<G>,
}

impl<'a, 'd, G: FilteredGoal, const GENERAL: bool> F64Slot<'a, 'd, G, GENERAL> {
    #[inline(always)]
    fn with(decider: &'d Decider<'a>, blocks: (BlockRay, f32)) -> Self {
        Self {
            ray: FilteredRay::new(decider, blocks, None, ContextRef::OUTSIDE),
            goal: std::marker::PhantomData,
        }
    }

    /// The closest of a block's triangles, decided one after another.
    #[cold]
    #[inline(never)]
    fn compare_all(
        &self,
        isa: Isa,
        ray: &Ray,
        block: u32,
        hits: &LaneHits<[[f32; BLOCK]; 2]>,
    ) -> Outcome<Option<Candidate>> {
        let (best, exact) = (self.ray.best, self.ray.exact());
        let (decider, axes) = (self.ray.decider(), self.ray.blocks.axes);
        isa.run(ComparisonOfAll { decider, ray, axes, best, exact, block, hits })
    }
}

/// See [`F64Slot::compare_all`].
struct ComparisonOfAll<'s, 'a> {
    decider: &'s Decider<'a>,
    ray: &'s Ray,
    axes: &'static Axes,
    best: Candidate,
    exact: Option<Winner>,
    block: u32,
    hits: &'s LaneHits<[[f32; BLOCK]; 2]>,
}

impl Dispatch for ComparisonOfAll<'_, '_> {
    type Output = Outcome<Option<Candidate>>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Self::Output {
        let Self { decider, ray, axes, best, exact, block, hits } = self;
        let &LaneHits { met, uncertain, at: [ref froms, ref tos] } = hits;
        let mut closer = None;
        let mut rest = met | uncertain;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            let (best, exact) = closer.map_or((best, exact), |closer| (closer, None));
            let (from, to) = (froms[lane as usize % BLOCK], tos[lane as usize % BLOCK]);
            // False for NaN.
            if from > best.to {
                continue;
            }
            if met >> lane & 1 != 0 && to < best.from {
                closer = Some(Candidate { block, lane, from, to });
                continue;
            }
            match decider.compare::<L>(ray, axes, (block, lane), (&best, exact)) {
                Outcome::Certain(Some(t)) => {
                    let (from, to) = heights(t, largest_component(ray));
                    closer = Some(Candidate { block, lane, from, to });
                }
                Outcome::Certain(None) => {}
                Outcome::Uncertain => return Outcome::Uncertain,
            }
        }
        Outcome::Certain(closer)
    }
}

/// Whether a ray hits any of the triangles in a mask, decided one after another.
#[cold]
#[inline(never)]
fn hits_any(
    isa: Isa,
    decider: &Decider,
    ray: &Ray,
    axes: &'static Axes,
    block: u32,
    mask: u32,
) -> Outcome<bool> {
    struct HitsAny<'s, 'a>(&'s Decider<'a>, &'s Ray, &'static Axes, u32, u32);
    impl Dispatch for HitsAny<'_, '_> {
        type Output = Outcome<bool>;

        #[inline(always)]
        fn run<L: Simd>(self) -> Outcome<bool> {
            let Self(decider, ray, axes, place, mut rest) = self;
            while rest != 0 {
                let lane = rest.trailing_zeros();
                rest &= rest - 1;
                if decider.misses::<L>(ray, axes, decider.block(place), lane) {
                    continue;
                }
                match decider.intersect(ray, place, lane) {
                    Meeting::Miss => {}
                    Meeting::Hit { .. } => return Outcome::Certain(true),
                    Meeting::Touch { .. } => return Outcome::Uncertain,
                }
            }
            Outcome::Certain(false)
        }
    }
    isa.run(HitsAny(decider, ray, axes, block, mask))
}

impl<'a, 'd, G: FilteredGoal, L: Simd, const GENERAL: bool> RaySlot<'a, 'd, L>
    for F64Slot<'a, 'd, G, GENERAL>
{
    type Goal = G;
    type Ray = Ray;
    type Answer = G::Found;
    const GENERAL: bool = GENERAL;
    type Pass = Edges<L::F32x8>;
    type Passes = Edges<L::F32x16>;
    /// The interval of heights that contains the crossing.
    type At = [L::F32x8; 2];

    #[inline(always)]
    fn new(decider: &'d Decider<'a>) -> Self {
        let blocks = BlockRay {
            axes: Axes::by_bits(0, 0),
            origin: [0.0; 4],
            rest: [0.0; 4],
            shear: [0.0; 4],
            least_size: decider.start.least_size,
            range: HeightRange::ahead(0.0, 0.0),
            turn: 0.0,
        };
        Self::with(decider, (blocks, 0.0))
    }

    #[inline(always)]
    fn start(&mut self, decider: &'d Decider<'a>, ray: &Ray) -> Option<Slabs> {
        let slabs = L::start_filter(decider.start, ray)?;
        let blocks = L::start_blocks(decider.start, ray, &slabs);
        if GENERAL {
            *self = Self::with(decider, blocks);
        } else {
            self.ray.restart(blocks);
        }
        Some(slabs)
    }

    #[inline(always)]
    fn pass_by_two(
        _: &Decider,
        slots: [&Self; 2],
        blocks: [&TriangleBlock; 2],
    ) -> (PassedLanes, Edges<L::F32x16>) {
        let (mask, edges) =
            L::intersect_triangles_by_two(blocks, [&slots[0].ray.blocks, &slots[1].ray.blocks]);
        (PassedLanes { mask, uncertain: 0 }, edges)
    }

    #[inline(always)]
    fn one_of(passes: &Edges<L::F32x16>, which: usize) -> Edges<L::F32x8> {
        passes.half(which)
    }

    #[inline(always)]
    fn intersect(&self, mask: u32, edges: &Edges<L::F32x8>) -> LaneHits<[L::F32x8; 2]> {
        let Crossings { in_range, sure, from, to } = edges.place(simd::opaque(&self.ray.blocks));
        LaneHits { met: mask & sure, uncertain: mask & in_range & !sure, at: [from, to] }
    }

    #[inline(always)]
    fn hits_any(&self, decider: &Decider, ray: &Ray, block: u32, uncertain: u32) -> Outcome<bool> {
        hits_any(L::isa(), decider, ray, self.ray.blocks.axes, block, uncertain)
    }

    #[inline(always)]
    fn take_nearest(
        &mut self,
        _: &Decider,
        ray: &Ray,
        block: u32,
        hits: &LaneHits<[L::F32x8; 2]>,
        _: &Edges<L::F32x8>,
        slabs: &mut Slabs,
    ) -> bool {
        let &LaneHits { met, uncertain, at: [from, to] } = hits;
        let nearest = to.reduce_min(met);
        let which = from.simd_le(L::F32x8::splat(nearest)) & met;
        let is_alone = which & which.wrapping_sub(1) == 0;
        if uncertain == 0 && is_alone && nearest < self.ray.best.from {
            let lane = which.trailing_zeros();
            self.ray.keep(Candidate { block, lane, from: from.lane(lane as usize), to: nearest }, slabs);
            return true;
        }
        let hits = LaneHits { met, uncertain, at: [from.to_array(), to.to_array()] };
        match self.compare_all(L::isa(), ray, block, &hits) {
            Outcome::Certain(Some(closer)) => self.ray.keep(closer, slabs),
            Outcome::Certain(None) => {}
            Outcome::Uncertain => return false,
        }
        true
    }

    #[inline(always)]
    fn test_infinite(&mut self, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        self.ray.test_infinite::<G, L>(ray, slabs)
    }

    #[inline(always)]
    fn test_leaf(&mut self, leaf: u32, ray: &Ray, slabs: &mut Slabs) -> Option<Stop> {
        self.ray.test_leaf::<G, L>(leaf, ray, slabs)
    }

    #[inline(always)]
    fn answer(&mut self, _: &Decider, ray: &Ray, is_hit: bool) -> Outcome<G::Found> {
        if is_hit { Outcome::Certain(G::hit()) } else { G::end::<L, GENERAL, false>(&mut self.ray, ray) }
    }
}
