//! Interleaved rays: the arithmetic of some fills the memory and branch latency of others.
//!
//! Up to 64 rays are in slots. In each turn, either the rays at nodes or those at leaves take a step, in short loops
//! with few branches: each loop takes a mask of slots from the loop before it. Triangles are tested for two rays at a
//! time, each with its own block: eight triangles of each fill a vector of sixteen.

use bytemuck::Zeroable;

use super::sink::Sink;
use crate::intersect::STACK;
use crate::intersect::box_ray::Slabs;
use crate::intersect::{self, Simd, Slots};
use crate::simd::{self, F32x16, LANES, Vector};
use crate::trace::decide::Decider;
use crate::trace::stack::Goal;
use crate::trace::{LaneHits, Outcome, Stop};
use crate::tree::BLOCK;
use crate::tree::node::{Node, WIDTH, tag};
use crate::tree::triangle_block::{Blocks, TriangleBlock};

/// A ray in a slot, in either precision.
pub(super) trait RaySlot<'a, 'd, L: Simd>: Sized {
    type Goal: Goal;
    type Ray;
    type Answer;
    /// Whether the tree has other leaves than triangles.
    const GENERAL: bool;
    /// How a line passes the triangles of a block, and how two lines pass those of a block each.
    type Pass;
    type Passes: Copy + Zeroable;
    /// Where it hits each triangle.
    type At: Copy + Zeroable;

    /// An empty slot.
    fn new(decider: &'d Decider<'a>) -> Self;
    /// Starts with a ray; `None` if it is invalid, or starts too far away for single precision.
    fn start(&mut self, decider: &'d Decider<'a>, ray: &Self::Ray) -> Option<Slabs>;
    /// How two lines pass the triangles of their two blocks.
    fn pass_by_two(
        decider: &Decider,
        slots: [&Self; 2],
        blocks: [&TriangleBlock; 2],
    ) -> (PassedLanes, Self::Passes);
    /// The pass of one of the two lines: `which` is 0 or 1.
    fn one_of(passes: &Self::Passes, which: usize) -> Self::Pass;
    /// Which triangles in the mask it hits, and where.
    fn intersect(&self, mask: u32, pass: &Self::Pass) -> LaneHits<Self::At>;
    /// Whether it hits any of these triangles, decided exactly.
    fn hits_any(&self, decider: &Decider, ray: &Self::Ray, block: u32, uncertain: u32) -> Outcome<bool>;
    /// Takes the closest hit in a block, if it is closer than the best; false if that is uncertain.
    fn take_nearest(
        &mut self,
        decider: &Decider,
        ray: &Self::Ray,
        block: u32,
        hits: &LaneHits<Self::At>,
        pass: &Self::Pass,
        slabs: &mut Slabs,
    ) -> bool;
    /// Tests unbounded geometry.
    #[inline(always)]
    fn test_infinite(&mut self, _ray: &Self::Ray, _slabs: &mut Slabs) -> Option<Stop> {
        None
    }
    /// Tests a leaf of other primitives than triangles, as a single ray does.
    #[inline(always)]
    fn test_leaf(&mut self, _leaf: u32, _ray: &Self::Ray, _slabs: &mut Slabs) -> Option<Stop> {
        None
    }
    /// The answer; for an any-hit search, `is_hit`.
    fn answer(&mut self, decider: &Decider, ray: &Self::Ray, is_hit: bool) -> Outcome<Self::Answer>;
}

/// The triangles of two blocks that two lines pass: eight bits for each.
pub(super) struct PassedLanes {
    /// Triangles that the rays may hit.
    pub(super) mask: u32,
    /// Triangles that need an exact decision.
    pub(super) uncertain: u32,
}

/// One bit of a word for each.
const SLOTS: usize = 64;
/// New rays start when this many slots, or all, are done.
const ENOUGH: u32 = 8;
/// Rays are prefetched this far ahead.
const AHEAD: usize = 2 * ENOUGH as usize;
/// The position of a ray that was answered already.
const ANSWERED: usize = usize::MAX;
/// The reference of a finished ray, and of a ray that finished with a hit in an any-hit search.
const DONE: u32 = tag::reference(tag::RETURN, 0);
const HIT: u32 = tag::reference(tag::RETURN, 1);

type Entry<'a, 'd, R, L> = <<R as RaySlot<'a, 'd, L>>::Goal as Goal>::Entry;

/// A ray: its data for nodes is one cache line, and that for triangles the next.
#[repr(C, align(64))]
struct Slot<R> {
    slabs: Slabs,
    position: usize,
    ray: R,
}

/// The positions of the set bits, the lowest first.
#[derive(Clone, Copy)]
struct Bits(u64);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let first = self.0.trailing_zeros();
        self.0 &= self.0.wrapping_sub(1);
        (first < u64::BITS).then_some(first as usize % SLOTS)
    }
}

impl Bits {
    /// Two at a time; the last of an odd number is paired with itself.
    #[inline(always)]
    fn by_two(self) -> ByTwo {
        ByTwo(self)
    }
}

/// See [`Bits::by_two`].
struct ByTwo(Bits);

impl Iterator for ByTwo {
    type Item = [usize; 2];

    #[inline(always)]
    fn next(&mut self) -> Option<[usize; 2]> {
        let Self(bits) = self;
        match (bits.next(), bits.next()) {
            (Some(first), second) => Some([first, second.unwrap_or(first)]),
            (None, _) => None,
        }
    }
}

/// The bit of a slot, if `is_set`.
#[inline(always)]
fn bit(is: bool, slot: usize) -> u64 {
    u64::from(is) << slot
}

/// The rank of a slot in a mask: its index in arrays that have one element for each slot of the mask.
#[inline(always)]
fn rank(slots: u64, slot: usize) -> usize {
    (slots & !(u64::MAX << slot)).count_ones() as usize % SLOTS
}

/// The subtree that each ray is at.
#[repr(align(64))]
struct References([u32; SLOTS]);

/// A bit for each ray that is at a node, at a leaf of triangles, at another leaf, and done.
#[derive(Clone, Copy)]
struct Stations {
    nodes: u64,
    triangles: u64,
    others: u64,
    done: u64,
}

impl References {
    #[inline(always)]
    fn of(&mut self, slot: usize) -> &mut u32 {
        &mut self.0[slot % SLOTS]
    }

    #[inline(always)]
    fn stations<W: F32x16, const GENERAL: bool>(&self) -> Stations {
        /// The last reference of each kind, in the order of signed integers.
        const LAST_NODE: i32 = tag::reference(tag::INNER, tag::PLACE) as i32;
        const LAST_TRIANGLES: i32 = tag::reference(tag::TRIANGLES, tag::PLACE) as i32;
        const BEFORE_DONE: i32 = DONE as i32 - 1;
        const { assert!(LAST_NODE > 0 && LAST_TRIANGLES > LAST_NODE && BEFORE_DONE < 0) };
        let (rows, _) = self.0.as_chunks::<LANES>();
        let (mut leaves, mut others, mut negative, mut done) = (0, 0, 0, 0);
        for (i, row) in rows.iter().enumerate() {
            let row = W::load(bytemuck::cast_ref(row));
            let first = LANES * i;
            negative |= !u64::from(row.bits_above(-1)) << first & 0xffff << first;
            leaves |= u64::from(row.bits_above(LAST_NODE)) << first;
            if GENERAL {
                others |= u64::from(row.bits_above(LAST_TRIANGLES)) << first;
                done |= u64::from(row.bits_above(BEFORE_DONE)) << first;
            }
        }
        let nodes = !(leaves | negative);
        if !GENERAL {
            return Stations { nodes, triangles: leaves, others: 0, done: negative };
        }
        // Finished rays have the largest of the negative references.
        done &= negative;
        Stations { nodes, triangles: leaves & !others, others: others | negative & !done, done }
    }
}

/// All rays in slots, and the data that one loop passes to the next.
struct Interleaved<'a, 'd, 'r, R: RaySlot<'a, 'd, L>, L: Simd> {
    decider: &'d Decider<'a>,
    nodes: &'a [Node],
    blocks: Blocks<'a>,
    rays: &'r [R::Ray],
    slots: Box<[Slot<R>; SLOTS]>,
    stacks: Box<[Slots<Entry<'a, 'd, R, L>>; SLOTS]>,
    references: References,
    /// The nodes that they come from.
    parents: References,
    /// The children of its node, or triangles of its block, that each ray may hit.
    masks: [u32; SLOTS],
    /// Where each ray enters the bounding boxes of the children.
    enters: [L::F32x16; SLOTS],
    passes: [R::Passes; SLOTS / 2],
    hits: [LaneHits<R::At>; SLOTS],
    /// The triangles that need an exact decision.
    uncertain: [u32; SLOTS],
}

impl<'a, 'd, 'r, R: RaySlot<'a, 'd, L>, L: Simd> Interleaved<'a, 'd, 'r, R, L> {
    #[inline(always)]
    fn new(decider: &'d Decider<'a>, rays: &'r [R::Ray]) -> Self {
        Self {
            decider,
            nodes: decider.nodes(),
            blocks: decider.blocks(),
            rays,
            slots: Box::new(std::array::from_fn(
                #[inline(always)]
                |_| Slot { ray: R::new(decider), slabs: Slabs::ZERO, position: ANSWERED },
            )),
            stacks: Slots::many(),
            references: References([DONE; SLOTS]),
            parents: References([DONE; SLOTS]),
            masks: [0; SLOTS],
            enters: [L::F32x16::splat(0.0); SLOTS],
            passes: [R::Passes::zeroed(); SLOTS / 2],
            hits: [LaneHits::zeroed(); SLOTS],
            uncertain: [0; SLOTS],
        }
    }

    /// The bottom entry of every stack.
    #[inline(always)]
    fn bottom() -> Entry<'a, 'd, R, L> {
        R::Goal::entry(DONE)
    }

    /// Starts with a ray at the root; false if the exact traversal has to answer.
    #[inline(always)]
    fn start(&mut self, slot: usize, position: usize) -> bool {
        let ray = simd::opaque(&self.rays[position]);
        let own = &mut self.slots[slot];
        let Some(slabs) = own.ray.start(self.decider, ray) else { return false };
        (own.slabs, own.position) = (slabs, position);
        let stack = &mut self.stacks[slot];
        stack.clear();
        stack.push(Self::bottom());
        let reference = self.references.of(slot);
        *reference = self.decider.start.root;
        if R::GENERAL
            && let Some(stop) = own.ray.test_infinite(ray, &mut own.slabs)
        {
            *reference = if stop == Stop::Hit { HIT } else { DONE };
            return stop == Stop::Hit;
        }
        true
    }

    /// The original ray of a slot.
    #[inline(always)]
    fn ray(&self, slot: usize) -> &'r R::Ray {
        &self.rays[self.slots[slot].position]
    }

    /// Moves rays at nodes to their first child, or to the top of their stacks.
    #[inline(always)]
    fn step_nodes(&mut self, at_nodes: u64, sink: &mut impl Sink<R::Answer>) {
        let too_deep = if R::Goal::IS_ANY { self.step_any(at_nodes) } else { self.step_closest(at_nodes) };
        self.give_up(too_deep, sink);
    }

    /// For any hit: pushes the children, and pops one. Returns a bit for each stack that may be too full for another
    /// node's children.
    #[inline(always)]
    fn step_any(&mut self, at_nodes: u64) -> u64 {
        let mut too_deep = 0;
        for slot in Bits(at_nodes) {
            let reference = self.references.of(slot);
            let node = &self.nodes[*reference as usize];
            let slabs = simd::opaque(&self.slots[slot].slabs);
            let (mask, enter) = intersect::intersect_boxes::<L::F32x16>(node, slabs);
            let stack = &mut self.stacks[slot];
            *reference = R::Goal::push_and_pop::<L>(node, mask, enter, stack);
            too_deep |= bit(stack.len() > STACK - WIDTH, slot);
        }
        too_deep
    }

    /// For the closest hit, where it pays to handle rays first that hit one child or none.
    #[inline(always)]
    fn step_closest(&mut self, at_nodes: u64) -> u64 {
        let nodes = self.nodes;
        let (mut none, mut many) = (0, 0);
        for (at, slot) in Bits(at_nodes).enumerate() {
            let reference = self.references.of(slot);
            let node = &nodes[*reference as usize];
            let slabs = simd::opaque(&self.slots[slot].slabs);
            let (mask, enter) = intersect::intersect_boxes::<L::F32x16>(node, slabs);
            self.masks[slot] = mask;
            *self.parents.of(slot) = *reference;
            self.enters[at % SLOTS] = enter;
            // Arbitrary unless there is exactly one.
            *reference = intersect::only_child(node, mask);
            none |= bit(mask == 0, slot);
            many |= bit(mask & mask.wrapping_sub(1) != 0, slot);
        }
        let mut too_deep = 0;
        for slot in Bits(many) {
            let stack = &mut self.stacks[slot];
            let node = &nodes[*self.parents.of(slot) as usize];
            let (mask, enter) = (self.masks[slot], self.enters[rank(at_nodes, slot)]);
            *self.references.of(slot) = R::Goal::push_and_pop::<L>(node, mask, enter, stack);
            too_deep |= bit(stack.len() > STACK - WIDTH, slot);
        }
        self.pop(none);
        too_deep
    }

    /// Moves rays at triangle leaves to the next block, or to the top of their stacks.
    #[inline(always)]
    fn step_triangles(&mut self, at_leaves: u64, sink: &mut impl Sink<R::Answer>) {
        let (mut passing, mut last) = (0, 0);
        for (at, [first, second]) in Bits(at_leaves).by_two().enumerate() {
            let block_of = |slot: usize| self.blocks.block(self.references.0[slot] & tag::PLACE);
            let (one, other) = (block_of(first), block_of(second));
            let rays = [&self.slots[first].ray, &self.slots[second].ray];
            let (both, passes) = R::pass_by_two(self.decider, rays, [one, other]);
            self.passes[at % (SLOTS / 2)] = passes;
            let halves = |mask: u32| (mask & L::F32x8::ALL, mask >> BLOCK);
            let of_both = |(of_first, of_second)| bit(of_first != 0, first) | bit(of_second != 0, second);
            (self.masks[first], self.masks[second]) = halves(both.mask);
            (self.uncertain[first], self.uncertain[second]) = halves(both.uncertain);
            passing |= of_both(halves(both.mask | both.uncertain));
            last |= bit(one.is_last(), first) | bit(other.is_last(), second);
        }
        let (mut met, mut undecided) = (0, 0);
        for slot in Bits(passing) {
            let rank = rank(at_leaves, slot);
            let pass = R::one_of(&self.passes[rank / 2], rank % 2);
            let mut hits = self.slots[slot].ray.intersect(self.masks[slot], &pass);
            met |= bit(hits.met != 0, slot);
            hits.uncertain |= self.uncertain[slot];
            undecided |= bit(hits.uncertain != 0, slot);
            if R::Goal::IS_ANY {
                self.uncertain[slot] = hits.uncertain;
            } else {
                self.hits[rank] = hits;
            }
        }
        let mut uncertain = 0;
        if R::Goal::IS_ANY {
            for slot in Bits(undecided & !met) {
                let place = *self.references.of(slot) & tag::PLACE;
                let (own, ray) = (&self.slots[slot], self.ray(slot));
                match own.ray.hits_any(self.decider, ray, place, self.uncertain[slot]) {
                    Outcome::Certain(is_hit) => met |= bit(is_hit, slot),
                    Outcome::Uncertain => uncertain |= bit(true, slot),
                }
            }
            self.stop_at_hits(met);
        } else {
            for slot in Bits(met | undecided) {
                let place = *self.references.of(slot) & tag::PLACE;
                let ray = self.ray(slot);
                let own = &mut self.slots[slot];
                let rank = rank(at_leaves, slot);
                let pass = R::one_of(&self.passes[rank / 2], rank % 2);
                let hits = &self.hits[rank];
                let is_certain = own.ray.take_nearest(self.decider, ray, place, hits, &pass, &mut own.slabs);
                uncertain |= bit(!is_certain, slot);
            }
            met = 0;
        }
        let going_on = at_leaves & !met & !uncertain;
        for slot in Bits(going_on & !last) {
            let reference = self.references.of(slot);
            let place = *reference & tag::PLACE;
            *reference = tag::reference(tag::TRIANGLES, self.blocks.block(place).place_behind(place));
        }
        self.give_up(uncertain, sink);
        self.pop(going_on & last);
    }

    /// Tests other leaves one by one, and moves their rays to the top of their stacks.
    #[inline(always)]
    fn step_others(&mut self, at_others: u64, sink: &mut impl Sink<R::Answer>) {
        let (mut met, mut uncertain) = (0, 0);
        for slot in Bits(at_others) {
            let (leaf, ray) = (*self.references.of(slot), self.ray(slot));
            let own = &mut self.slots[slot];
            let stop = own.ray.test_leaf(leaf, ray, &mut own.slabs);
            met |= bit(stop == Some(Stop::Hit), slot);
            uncertain |= bit(stop == Some(Stop::Uncertain), slot);
        }
        self.stop_at_hits(met);
        self.give_up(uncertain, sink);
        self.pop(at_others & !met & !uncertain);
    }

    /// Marks rays that have a hit as finished, in an any-hit search.
    #[inline(always)]
    fn stop_at_hits(&mut self, slots: u64) {
        for slot in Bits(slots) {
            *self.references.of(slot) = HIT;
        }
    }

    /// Leaves these rays to the exact traversal.
    #[inline(always)]
    fn give_up(&mut self, slots: u64, sink: &mut impl Sink<R::Answer>) {
        for slot in Bits(slots) {
            let position = &mut self.slots[slot].position;
            sink.put(*position, Outcome::Uncertain);
            *position = ANSWERED;
            *self.references.of(slot) = DONE;
        }
    }

    /// Pops the first entry that is not beyond the end of the ray.
    #[inline(always)]
    fn pop(&mut self, mut slots: u64) {
        while slots != 0 {
            let mut beyond = 0;
            for slot in Bits(slots) {
                let entry = self.stacks[slot].pop().unwrap_or(Self::bottom());
                *self.references.of(slot) = R::Goal::reference(entry);
                beyond |= bit(R::Goal::is_beyond(entry, self.slots[slot].slabs.s_max()), slot);
            }
            slots = beyond;
        }
    }

    /// Prefetches what these rays read next.
    #[inline(always)]
    fn prefetch(&mut self, slots: u64) {
        let Stations { nodes, triangles, .. } = self.stations();
        for slot in Bits(nodes & slots) {
            self.nodes.get(*self.references.of(slot) as usize).map(simd::fetch::<Node>);
        }
        for slot in Bits(triangles & slots) {
            self.blocks.block(*self.references.of(slot) & tag::PLACE).fetch();
        }
    }

    #[inline(always)]
    fn stations(&self) -> Stations {
        if R::GENERAL {
            self.references.stations::<L::F32x16, true>()
        } else {
            self.references.stations::<L::F32x16, false>()
        }
    }

    /// Hands out the answers of finished rays.
    #[inline(always)]
    fn answer(&mut self, done: u64, sink: &mut impl Sink<R::Answer>) {
        for slot in Bits(done) {
            let own = &mut self.slots[slot];
            if own.position != ANSWERED {
                let is_hit = *self.references.of(slot) == HIT;
                let ray = &self.rays[own.position];
                sink.put(own.position, own.ray.answer(self.decider, ray, is_hit));
            }
        }
    }
}

/// Traverses the tree with the rays at these positions; with `prefetches`, a ray prefetches what it reads next.
#[inline(always)]
pub(super) fn traverse<'a, 'd, R: RaySlot<'a, 'd, L>, L: Simd>(
    decider: &'d Decider<'a>,
    prefetches: bool,
    rays: &[R::Ray],
    positions: &[usize],
    sink: &mut impl Sink<R::Answer>,
) {
    let mut waiting = positions.iter();
    let mut all = Interleaved::<R, L>::new(decider, rays);
    // All slots are done at first.
    let mut taken = u64::MAX;
    while taken != 0 {
        let at = all.stations();
        let done = at.done & taken;
        if done.count_ones() >= ENOUGH || done == taken {
            all.answer(done, sink);
            taken &= !done;
            taken |= start_others(&mut all, done, &mut waiting, sink);
            continue;
        }
        // The group with the most rays goes first.
        let [nodes, triangles, others] = [at.nodes, at.triangles, at.others].map(u64::count_ones);
        let moving = if R::GENERAL && others > nodes.max(triangles) {
            all.step_others(at.others, sink);
            at.others
        } else if nodes >= triangles {
            all.step_nodes(at.nodes, sink);
            at.nodes
        } else {
            all.step_triangles(at.triangles, sink);
            at.triangles
        };
        if prefetches {
            all.prefetch(moving);
        }
    }
}

/// Starts waiting rays in free slots, and returns the slots.
#[inline(always)]
fn start_others<'a, 'd, R: RaySlot<'a, 'd, L>, L: Simd>(
    all: &mut Interleaved<'a, 'd, '_, R, L>,
    free: u64,
    waiting: &mut std::slice::Iter<usize>,
    sink: &mut impl Sink<R::Answer>,
) -> u64 {
    let mut taken = 0;
    for slot in Bits(free) {
        if let Some(&position) = waiting.as_slice().get(AHEAD) {
            simd::fetch(&all.rays[position]);
        }
        for &position in waiting.by_ref() {
            if all.start(slot, position) {
                sink.prefetch(position);
                taken |= bit(true, slot);
                break;
            }
            sink.put(position, Outcome::Uncertain);
        }
    }
    taken
}
