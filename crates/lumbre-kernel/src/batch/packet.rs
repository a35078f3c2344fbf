//! Packets of sixteen coherent rays, such as camera rays or shadow rays of neighbouring points.
//!
//! A packet goes from box to box as one frustum, which makes a node hardly more expensive than for one ray. If the rays
//! start at different places, the frustum contains much that no ray hits: then the child boxes that it hits are tested
//! again, each against all sixteen rays. At a leaf, triangles that no ray can hit are culled eight at a time. Each of
//! the others is tested against all sixteen rays, by the operations and with the bounds of a single ray, so that
//! answers have the same bits. If a packet turns out to be more work than it is worth, its rays continue as single
//! rays.
//!
//! # Error bound: the frustum loses no box
//!
//! On each axis the directions have one sign. A single ray meets a plane p at `p r + c`, with a margin in c; see
//! `node`. Here it is `(p - q) r + (q - o) r`, where q is a point among the starts o, which are all within an eighth of
//! it. That is another order of the same operations, with one more subtraction and one more sum. Their error is less
//! than 4u|r| (1.3 + |q|), where a ray's margin is at least 8u|r| (1.01 + |o|). Twice that margin is added. The frustum
//! takes the least computed `(p - q) r` over all rays, and subtracts the largest |r| times the sum of the largest |q -
//! o| and three times the largest margin divided by |r|; its three rounding errors, of numbers below |r|/2, are covered
//! by those margins. So it enters no later than any ray with its margin, and likewise leaves no earlier.
//!
//! # Error bound: none of its rays loses a triangle
//!
//! Let (X, Y, Z) be a corner as seen from the middle of the rays' starts, sheared by the middle of their shears. For a
//! ray whose start and shear are off by a and b, the corner is at X + (a_x - s_x a_z) - b_x Z, and within |a_z| of Z.
//! So |x| is below |X| + `apart` + `spread` |Z|, the largest of these over all rays. The rounding errors of both are
//! below 32us with s as there, from these larger bounds. No ray hits a triangle all of whose corners are beyond that on
//! one side; and with the larger m, h and s the error bounds are no smaller than those of every ray.

pub(crate) use super::sink::PACKET;
use super::sink::Sink;
use crate::intersect::box_ray::{END_FACTOR, LITTLE, START_FACTOR};
use crate::intersect::box_ray::{Frustum, SlabRows};
use crate::intersect::watertight::TINY;
use crate::intersect::{self, Axes, CornerScratch, Sides, Simd};
use crate::simd::{self, F32x8, F32x16, Vector};
use crate::trace::Stop;
use crate::trace::decide::Decider;
use crate::trace::stack::{Goal, Stack};
use crate::tree::Corners;
use crate::tree::node::{Node, tag};
use crate::tree::triangle_block::TriangleBlock;

/// A mask of all of them.
pub(crate) const ALL: u32 = (1 << PACKET) - 1;
/// Maximum distance of a ray's start from the middle on an axis, in tree units: see above.
const MAX_DISTANCE: f32 = 0.125;
/// Minimum rays of a packet.
const LEAST: u32 = 4;
/// Testing this many child boxes against each ray costs as much as a node.
const CHILDREN_AS_A_NODE: u32 = 4;
/// Error bound of triangle corners, relative to their size: 32u, see above.
const CULL_ERROR: f32 = 32.0 / (1 << 24) as f32;

/// The work limits of a packet, in nodes; a block of triangles costs as much as two nodes, and so does a triangle.
#[derive(Clone, Copy)]
pub(super) struct WorkBudget {
    /// At this much work, its rays continue one by one.
    pub(super) most: u32,
    /// Up to this much work, a packet of sixteen rays pays; fewer rays have proportionately less.
    pub(super) paying: u32,
}

impl WorkBudget {
    #[inline(always)]
    fn pays(self, work: u32, rays: u32) -> bool {
        work * ALL.count_ones() <= self.paying * rays.count_ones()
    }
}

/// The rays of a packet in one precision: how they start, and their data for triangles.
pub(super) trait Bundle<'a, 'd>: Sized {
    type Goal: Goal;
    type Ray;
    type Answer;
    /// Whether the tree has other leaves than triangles.
    const GENERAL: bool;
    /// Whether triangles are tested with the bounds of [`CullBounds`].
    const NEEDS_BOUNDS: bool;
    /// Maximum distance of directions from their middle, relative to the largest component.
    const MAX_SPREAD: f32;

    /// Without rays.
    fn new(decider: &'d Decider<'a>) -> Self;

    /// The work limits, for rays with or without a common origin.
    fn effort(has_one_origin: bool) -> WorkBudget;

    /// Loads the rays.
    fn load<L: Simd>(&mut self, rays: &[Self::Ray; PACKET]);

    /// The rays that are coherent with one ray: those with its signs and its largest axis. Also returns these.
    fn alike<L: Simd>(&self, one: u32) -> (u32, Signs);

    /// Replaces the rays outside the mask by one of the mask.
    fn fill_up<L: Simd>(&mut self, mask: u32);

    /// Starts among bounding boxes; `None` if a ray is invalid, or starts too far away for single precision.
    fn start<L: Simd>(&mut self, decider: &Decider, slabs: &mut SlabRows) -> Option<Start<L::F32x16>>;

    /// Starts among triangles.
    fn start_triangles<L: Simd>(
        &mut self,
        decider: &Decider,
        axes: &'static Axes,
        slabs: &SlabRows,
        cull: &mut Cull,
    );

    /// Tests a triangle against the rays.
    fn test_triangle<L: Simd>(
        &mut self,
        state: &mut State,
        cull: &Cull,
        block: (u32, &TriangleBlock, &Corners),
        lane: usize,
        bounds: &CullBounds,
        rays: &[Self::Ray; PACKET],
    );

    /// Tests unbounded geometry, ray by ray.
    #[inline(always)]
    fn test_infinite<L: Simd>(&mut self, _state: &mut State, _rays: &[Self::Ray; PACKET]) {}

    /// Tests other leaves than triangles, ray by ray.
    #[inline(always)]
    fn test_leaf<L: Simd>(&mut self, _state: &mut State, _leaf: u32, _rays: &[Self::Ray; PACKET]) {}

    /// Hands out the answers of the rays in `state.chosen`.
    fn put<L: Simd>(
        &mut self,
        decider: &Decider,
        state: &State,
        rays: &[Self::Ray; PACKET],
        first: usize,
        sink: &mut impl Sink<Self::Answer>,
    );
}

/// The signs of directions, a bit for each negative component, and their axes.
#[derive(Clone, Copy)]
pub(super) struct Signs {
    pub(super) signs: u32,
    pub(super) axes: &'static Axes,
}

impl Signs {
    /// The signs of one ray of a packet, and the rays that share them: by where each component is negative, and where x
    /// and y are the largest.
    #[inline(always)]
    pub(super) fn of(one: u32, negative: [u32; 3], x_is_last: u32, y_is_last: u32) -> (u32, Self) {
        let (mut alike, mut signs) = (ALL, 0);
        for (axis, &negative) in negative.iter().enumerate() {
            let is_negative = negative >> one & 1;
            signs |= is_negative << axis;
            alike &= if is_negative != 0 { negative } else { !negative };
        }
        let bits = if x_is_last >> one & 1 != 0 {
            alike &= x_is_last;
            0b101
        } else if y_is_last >> one & 1 != 0 {
            alike &= y_is_last;
            0b010
        } else {
            alike &= !(x_is_last | y_is_last);
            0
        };
        (alike, Self { signs, axes: Axes::by_bits(signs, bits) })
    }
}

/// The bounds of a frustum.
pub(super) struct Start<W> {
    pub(super) inverse: [W; 3],
    pub(super) range: [W; 2],
    /// The middle of the starts, in tree units, and the largest distance from it.
    pub(super) center: [f32; 3],
    pub(super) off: [f32; 3],
    /// By how much planes are moved for all rays: a factor of distances, and a constant.
    pub(super) margin_per_distance: f32,
    pub(super) margin: f32,
    pub(super) has_one_origin: bool,
}

/// The children of a node whose boxes live rays may hit, where the first ray may enter each, and the work in nodes.
/// With rows for `each` ray, only children that a ray does hit, and, if `is_ordered`, where the first ray enters.
#[inline(always)]
fn test_children<W: F32x16>(
    node: &Node,
    frustum: &Frustum,
    each: Option<&SlabRows>,
    alive: u32,
    is_ordered: bool,
) -> (u32, W, u32) {
    let (mask, enters) = intersect::intersect_frustum::<W>(node, frustum);
    let Some(each) = each else { return (mask, enters, 1) };
    let work = 1 + mask.count_ones() / CHILDREN_AS_A_NODE;
    let (mask, enters) =
        intersect::intersect_each::<W>(node, each, frustum.sides, (mask, enters), alive, is_ordered);
    (mask, enters, work)
}

/// A bound on all rays among triangles: see above.
pub(super) struct Cull {
    pub(super) axes: &'static Axes,
    pub(super) middle: [f32; 3],
    pub(super) middle_shear: [f32; 2],
    pub(super) apart: [f32; 3],
    pub(super) spread: [f32; 2],
    pub(super) least_size: f32,
}

/// The bounds of a block's triangles for all rays.
pub(super) struct CullBounds {
    /// Triangles that a ray may hit.
    pub(super) mask: u32,
    /// Bounds on the coordinates across and along the rays together, on those across, and the extent along.
    pub(super) size: [f32; 8],
    pub(super) across: [f32; 8],
    pub(super) extent: [f32; 8],
}

impl Cull {
    /// Which triangles of a block remain; lanes without one are undefined.
    #[inline(always)]
    fn bounds<E: F32x8>(&self, corners: &Corners, needs_bounds: bool) -> CullBounds {
        let own = simd::opaque(self);
        let [kx, ky, kz] = own.axes.order();
        let ([ox, oy, oz], [sx, sy]) = (own.middle, own.middle_shear);
        let (ox, oy, oz) = (E::splat(ox), E::splat(oy), E::splat(oz));
        let (sx, sy) = (E::splat(sx), E::splat(sy));
        let at = |axis: usize, corner: usize| E::load(&corners[axis][corner]);
        let (az, bz, cz) = (oz - at(kz, 0), oz - at(kz, 1), oz - at(kz, 2));
        let (ax, bx, cx) = (
            sx.neg_mul_add(az, ox - at(kx, 0)),
            sx.neg_mul_add(bz, ox - at(kx, 1)),
            sx.neg_mul_add(cz, ox - at(kx, 2)),
        );
        let (ay, by, cy) = (
            sy.neg_mul_add(az, oy - at(ky, 0)),
            sy.neg_mul_add(bz, oy - at(ky, 1)),
            sy.neg_mul_add(cz, oy - at(ky, 2)),
        );
        let (low_x, high_x) = (ax.min(bx).min(cx), ax.max(bx).max(cx));
        let (low_y, high_y) = (ay.min(by).min(cy), ay.max(by).max(cy));
        let along = az.abs().max(bz.abs()).max(cz.abs());
        let zero = E::splat(0.0);
        let wide_x = along.mul_add(E::splat(own.spread[0]), E::splat(own.apart[0]));
        let wide_y = along.mul_add(E::splat(own.spread[1]), E::splat(own.apart[1]));
        let (across_x, across_y) = ((zero - low_x).max(high_x), (zero - low_y).max(high_y));
        let across = (across_x + wide_x).max(across_y + wide_y);
        let size = across + along + E::splat(own.apart[2] + own.least_size);
        let slack = size * E::splat(CULL_ERROR);
        let (wide_x, wide_y) = (wide_x + slack, wide_y + slack);
        // The edge functions seen from the middle, and by how much those of the rays may differ.
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        let off = across_y.mul_add(wide_x, wide_y.mul_add(wide_x, across_x * wide_y));
        let off = off * E::splat(2.0 + 8.0 * CULL_ERROR) + E::splat(TINY);
        let mask = low_x.simd_le(wide_x)
            & (zero - wide_x).simd_le(high_x)
            & low_y.simd_le(wide_y)
            & (zero - wide_y).simd_le(high_y)
            & ((zero - off).simd_le(u.min(v).min(w)) | u.max(v).max(w).simd_le(off));
        let mut bounds = CullBounds { mask, size: [0.0; 8], across: [0.0; 8], extent: [0.0; 8] };
        if needs_bounds && mask != 0 {
            bounds.across = (across + slack).to_array();
            bounds.size = (size + slack + slack).to_array();
            bounds.extent = (az.max(bz).max(cz) - az.min(bz).min(cz)).to_array();
        }
        bounds
    }
}

/// The state of a packet's rays in either precision.
pub(super) struct State {
    /// The requested rays; the others are copies of one of them.
    pub(super) chosen: u32,
    /// Live rays, rays that have a hit in an any-hit search, and rays that the exact traversal has to answer.
    pub(super) alive: u32,
    pub(super) met: u32,
    pub(super) uncertain: u32,
    pub(super) is_among_triangles: bool,
    /// The work done, in nodes.
    work: u32,
    pub(super) slabs: SlabRows,
    pub(super) frustum: Frustum,
}

impl State {
    /// Leaves a ray to the exact traversal.
    #[inline(always)]
    pub(super) fn give_up(&mut self, i: usize) {
        self.uncertain |= 1 << i;
        self.alive &= !(1 << i);
        self.slabs.s_max.0[i] = -1.0;
    }

    /// Records rays with a hit in an any-hit search.
    #[inline(always)]
    pub(super) fn stop_at_hits(&mut self, mask: u32) {
        self.met |= mask;
        self.alive &= !mask;
    }

    /// Ends the frustum if no ray is alive.
    #[inline(always)]
    pub(super) fn end_frustum(&mut self) {
        let greater = |a: f32, b: f32| if a > b { a } else { b };
        self.frustum.s_max = self.slabs.s_max.0.iter().fold(-1.0, |most, &s_max| greater(most, s_max));
    }
}

/// The traversal of one packet after another.
pub(super) struct Packet<'a, 'd, B> {
    decider: &'d Decider<'a>,
    state: State,
    cull: Cull,
    has_one_origin: bool,
    bundle: B,
}

/// The result of a packet.
pub(super) struct PacketResult {
    /// A bit for each ray that was answered.
    pub(super) answered: u32,
    /// Whether the packet was faster than single rays.
    pub(super) pays: bool,
}

impl<'a, 'd, B: Bundle<'a, 'd>> Packet<'a, 'd, B> {
    #[inline(always)]
    pub(super) fn new(decider: &'d Decider<'a>) -> Self {
        let none = [0.0; 3];
        let frustum = Frustum {
            center: none,
            least_inverse: none,
            most_inverse: none,
            width: none,
            s_min: 0.0,
            s_max: 0.0,
            sides: Sides::new(0),
        };
        let state = State {
            chosen: 0,
            alive: 0,
            met: 0,
            uncertain: 0,
            is_among_triangles: false,
            work: 0,
            slabs: SlabRows::NONE,
            frustum,
        };
        let cull = Cull {
            axes: Axes::by_bits(0, 0),
            middle: none,
            middle_shear: [0.0; 2],
            apart: none,
            spread: [0.0; 2],
            least_size: decider.start.least_size,
        };
        Self { decider, state, cull, has_one_origin: false, bundle: B::new(decider) }
    }

    /// Traverses the tree with consecutive rays, from this position on. Rays whose signs differ from the first ray's
    /// form packets of their own.
    #[inline(always)]
    pub(super) fn traverse<L: Simd>(
        &mut self,
        rays: &[B::Ray; PACKET],
        first: usize,
        sink: &mut impl Sink<B::Answer>,
    ) -> PacketResult {
        let mut result = PacketResult { answered: 0, pays: true };
        while result.answered != ALL {
            self.bundle.load::<L>(rays);
            let (alike, signs) = self.bundle.alike::<L>((!result.answered).trailing_zeros());
            self.state.chosen = alike & !result.answered;
            if !self.start::<L>(signs) {
                // Either a few are left, or all.
                result.pays &= result.answered.count_ones() >= ALL.count_ones() / 2;
                break;
            }
            let effort = B::effort(self.has_one_origin);
            let most = if L::GOES_ON_TOGETHER || B::GENERAL { effort.most } else { effort.paying };
            let is_done = self.run::<L>(most, rays);
            if !is_done {
                // In an any-hit search, rays with a hit are done.
                self.state.chosen &= if B::Goal::IS_ANY { !self.state.alive } else { 0 };
            }
            self.bundle.put::<L>(self.decider, &self.state, rays, first, sink);
            result.answered |= self.state.chosen;
            result.pays &= is_done && effort.pays(self.state.work, self.state.chosen);
            if !is_done {
                break;
            }
        }
        result
    }

    /// Starts the chosen rays among boxes; false if they are too few, too far apart, or single precision is too coarse.
    #[inline(always)]
    fn start<L: Simd>(&mut self, Signs { signs, axes }: Signs) -> bool {
        let Self { decider, state, cull, bundle, has_one_origin } = self;
        if state.chosen.count_ones() < LEAST {
            return false;
        }
        if state.chosen != ALL {
            bundle.fill_up::<L>(state.chosen);
        }
        let Some(start) = bundle.start::<L>(decider, &mut state.slabs) else { return false };
        let (splat, [t_min, t_max]) = (L::F32x16::splat, start.range);
        let s_max = t_max.mul_add(splat(END_FACTOR), splat(LITTLE as f32));
        L::F32x16::select(state.chosen, s_max, splat(-1.0)).store(&mut state.slabs.s_max);
        (t_min * splat(START_FACTOR)).store(&mut state.slabs.s_min);
        let [x, y, z] = start.inverse;
        let zero = splat(0.0);
        let minus_s_min = t_min * splat(-START_FACTOR);
        let most =
            L::F32x16::reduce_max_of_eight([x, y, z, s_max, zero - x, zero - y, zero - z, minus_s_min]);
        let mut is_near = true;
        for axis in 0..3 {
            let (most_inverse, minus_least, off) = (most[axis], most[4 + axis], start.off[axis]);
            let distance = start.center[axis].abs() + off;
            let margin = distance * start.margin_per_distance + start.margin;
            let largest = if most_inverse > minus_least { most_inverse } else { minus_least };
            state.frustum.center[axis] = start.center[axis];
            state.frustum.most_inverse[axis] = most_inverse;
            state.frustum.least_inverse[axis] = -minus_least;
            state.frustum.width[axis] = largest * (off + margin);
            is_near &= off <= MAX_DISTANCE;
        }
        (state.frustum.s_max, state.frustum.s_min, state.frustum.sides) =
            (most[3], -most[7], Sides::new(signs));
        (cull.axes, state.is_among_triangles, *has_one_origin) = (axes, false, start.has_one_origin);
        is_near
    }

    /// Traverses the tree; false if the packet gave up.
    #[inline(always)]
    fn run<L: Simd>(&mut self, most_work: u32, rays: &[B::Ray; PACKET]) -> bool {
        let nodes = self.decider.nodes();
        let mut stack: Stack<<B::Goal as Goal>::Entry> = Stack::new();
        let mut reference = self.decider.start.root;
        let state = &mut self.state;
        (state.alive, state.met, state.uncertain, state.work) = (state.chosen, 0, 0, 0);
        if B::GENERAL && !self.decider.tree().infinite.is_empty() {
            if !self.start_triangles::<L>() {
                return false;
            }
            self.bundle.test_infinite::<L>(&mut self.state, rays);
        }
        loop {
            while tag::is_inner(reference) {
                let node = &nodes[reference as usize];
                let state = &mut self.state;
                let each = if self.has_one_origin { None } else { Some(simd::opaque(&state.slabs)) };
                let frustum = simd::opaque(&state.frustum);
                let (mask, keys, work) =
                    test_children::<L::F32x16>(node, frustum, each, state.alive, !B::Goal::IS_ANY);
                state.work += work;
                if mask & mask.wrapping_sub(1) != 0 {
                    reference = stack.put(
                        #[inline(always)]
                        |room| B::Goal::push_children::<L>(node, mask, keys, room),
                    );
                } else if mask != 0 {
                    reference = intersect::only_child(node, mask);
                } else {
                    match self.pop(&mut stack) {
                        Some(next) => reference = next,
                        None => return true,
                    }
                }
            }
            if !self.state.is_among_triangles && !self.start_triangles::<L>() {
                return false;
            }
            if !B::GENERAL || tag::of(reference) == tag::TRIANGLES {
                self.test_triangles::<L>(reference, rays);
            } else {
                self.state.work += 2 + 2 * self.state.alive.count_ones();
                self.bundle.test_leaf::<L>(&mut self.state, reference, rays);
            }
            if self.state.alive == 0 {
                return true;
            }
            if self.state.work > most_work {
                return false;
            }
            match self.pop(&mut stack) {
                Some(next) => reference = next,
                None => return true,
            }
        }
    }

    /// Starts among triangles; false if directions are too far apart.
    #[inline(always)]
    fn start_triangles<L: Simd>(&mut self) -> bool {
        let Self { decider, state, cull, bundle, .. } = self;
        bundle.start_triangles::<L>(decider, cull.axes, &state.slabs, cull);
        state.is_among_triangles = true;
        cull.spread[0] <= B::MAX_SPREAD && cull.spread[1] <= B::MAX_SPREAD
    }

    /// Tests a leaf of triangles.
    #[inline(always)]
    fn test_triangles<L: Simd>(&mut self, leaf: u32, rays: &[B::Ray; PACKET]) {
        let mut following = Some(leaf & tag::PLACE);
        let mut room = CornerScratch::new();
        while let Some(place) = following {
            let block = self.decider.block(place);
            following = block.next(place);
            let corners = L::corners(block, &mut room);
            let bounds = self.cull.bounds::<L::F32x8>(corners, B::NEEDS_BOUNDS);
            let mut rest = bounds.mask & block.taken();
            self.state.work += 2 + 2 * rest.count_ones();
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize % 8;
                rest &= rest - 1;
                let (state, cull) = (&mut self.state, &self.cull);
                self.bundle.test_triangle::<L>(state, cull, (place, block, corners), lane, &bounds, rays);
            }
        }
    }

    /// The next subtree on the stack that is not beyond the end of all rays.
    #[inline(always)]
    fn pop(&self, stack: &mut Stack<<B::Goal as Goal>::Entry>) -> Option<u32> {
        loop {
            let entry = stack.pop()?;
            if !B::Goal::is_beyond(entry, self.state.frustum.s_max) {
                return Some(B::Goal::reference(entry));
            }
        }
    }
}

/// Records how a ray of a packet ended at a leaf that is tested ray by ray.
pub(super) fn record(state: &mut State, i: usize, stop: Option<Stop>) {
    match stop {
        None => {}
        Some(Stop::Hit) => state.stop_at_hits(1 << i),
        Some(Stop::Uncertain) => state.give_up(i),
    }
}
