//! Many rays interleaved, so that the arithmetic of some fills the memory and branch latency of others: rays in single precision, in
//! trees of triangles.
//!
//! Up to 64 rays stand in slots. In each turn, those that are at nodes, or those that are at leaves, take a step in short loops with
//! few branches: which slots a loop is for is told by a mask that the loop before it made.

use bytemuck::Zeroable;

use super::sink::Sink;
use crate::intersect::STACK;
use crate::intersect::box_ray::Slabs;
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::{self, Simd, Slots, watertight};
use crate::ray32::{Hit32, Ray32};
use crate::simd::{self, F32x8, F32x16, Vector, WIDE};
use crate::trace::decide::Decider;
use crate::trace::f32_ray::{Nearest, Passed, SOME_HIT};
use crate::trace::stack::Goal;
use crate::trace::{LaneHits, Outcome};
use crate::tree::BLOCK;
use crate::tree::node::{Node, WIDTH, tag};
use crate::tree::triangle_block::Blocks;

/// A bit for each in a word.
const SLOTS: usize = 64;
/// How many have to be done, or all, before others start.
const ENOUGH: u32 = 8;
/// How many rays ahead one is prefetched.
const AHEAD: usize = 2 * ENOUGH as usize;
/// The position of a ray that was answered already.
const ANSWERED: usize = usize::MAX;
/// The reference of a ray that is done, and of one that is done because it has a hit and any will do.
const DONE: u32 = tag::reference(tag::RETURN, 0);
const HIT: u32 = tag::reference(tag::RETURN, 1);

/// A ray: what nodes are tested with is a cache line, and what triangles are, with the nearest hit, the next.
#[repr(C, align(64))]
struct Slot {
    slabs: Slabs,
    position: usize,
    /// Ends at the nearest hit.
    ray: F32Ray,
    nearest: Nearest,
}

/// The positions of the bits that are set, the lowest first.
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

/// The bit of a slot, if that is so.
#[inline(always)]
fn bit(is: bool, slot: usize) -> u64 {
    u64::from(is) << slot
}

/// The rank of a slot among those of a mask: where arrays that are written in their order hold what belongs to it.
#[inline(always)]
fn rank(slots: u64, slot: usize) -> usize {
    (slots & !(u64::MAX << slot)).count_ones() as usize % SLOTS
}

/// The subtree that each ray is at.
#[repr(align(64))]
struct References([u32; SLOTS]);

/// A bit for each ray that is at a node, at a leaf, and done.
#[derive(Clone, Copy)]
struct Stations {
    nodes: u64,
    leaves: u64,
    done: u64,
}

impl References {
    #[inline(always)]
    fn of(&mut self, slot: usize) -> &mut u32 {
        &mut self.0[slot % SLOTS]
    }

    #[inline(always)]
    fn stations<W: F32x16>(&self) -> Stations {
        /// The last reference to a node, in the order of signed integers; those that are done are negative.
        const LAST_NODE: i32 = tag::reference(tag::INNER, tag::PLACE) as i32;
        const {
            assert!(
                LAST_NODE > 0
                    && tag::reference(tag::TRIANGLES, tag::PLACE) as i32 > LAST_NODE
                    && (DONE as i32) < 0
            )
        };
        let (rows, _) = self.0.as_chunks::<WIDE>();
        let (mut leaves, mut done) = (0, 0);
        for (i, row) in rows.iter().enumerate() {
            let row = W::load(bytemuck::cast_ref(row));
            let above = |last: i32| u64::from(row.bits_above(last)) << (WIDE * i);
            done |= !above(-1) & 0xffff << (WIDE * i);
            leaves |= above(LAST_NODE);
        }
        Stations { nodes: !(leaves | done), leaves, done }
    }
}

/// All rays in slots, and what one loop hands on to another.
struct Interleaved<'a, 'd, 'r, G: Goal, L: Simd> {
    decider: &'d Decider<'a>,
    nodes: &'a [Node],
    blocks: Blocks<'a>,
    rays: &'r [Ray32],
    slots: Box<[Slot; SLOTS]>,
    stacks: Box<[Slots<G::Entry>; SLOTS]>,
    references: References,
    /// The nodes that they come from.
    parents: References,
    /// Which children of its node each may hit.
    masks: [u32; SLOTS],
    /// Where each enters the bounding boxes of the children.
    enters: [L::F32x16; SLOTS],
    /// How each passes the triangles of its block.
    passed: [Passed<L::F32x8>; SLOTS],
}

impl<'a, 'd, 'r, G: Goal, L: Simd> Interleaved<'a, 'd, 'r, G, L> {
    #[inline(always)]
    fn new(decider: &'d Decider<'a>, rays: &'r [Ray32]) -> Self {
        Self {
            decider,
            nodes: decider.nodes(),
            blocks: decider.blocks(),
            rays,
            slots: Box::new(std::array::from_fn(
                #[inline(always)]
                |_| Slot {
                    slabs: Slabs::ZERO,
                    position: ANSWERED,
                    ray: F32Ray::of_none(),
                    nearest: Nearest::NONE,
                },
            )),
            stacks: Slots::many(),
            references: References([DONE; SLOTS]),
            parents: References([DONE; SLOTS]),
            masks: [0; SLOTS],
            enters: [L::F32x16::splat(0.0); SLOTS],
            passed: [Zeroable::zeroed(); SLOTS],
        }
    }

    /// What is at the bottom of every stack.
    #[inline(always)]
    fn bottom() -> G::Entry {
        G::entry(DONE)
    }

    /// Starts with a ray at the root; false where the ray has to be answered otherwise.
    #[inline(always)]
    fn start(&mut self, slot: usize, position: usize) -> bool {
        let ray = simd::opaque(&self.rays[position]);
        let start = self.decider.start;
        let Some(slabs) = L::start_f32(start, ray) else { return false };
        let own = &mut self.slots[slot];
        own.ray = L::start_f32_blocks(start, ray, &slabs);
        (own.slabs, own.position, own.nearest) = (slabs, position, Nearest::NONE);
        let stack = &mut self.stacks[slot];
        stack.clear();
        stack.push(Self::bottom());
        *self.references.of(slot) = start.root;
        true
    }

    /// Those that are at nodes go on to the child that comes first, or to the top of their stacks.
    #[inline(always)]
    fn step_nodes(&mut self, at_nodes: u64, sink: &mut impl Sink<Option<Hit32>>) {
        let too_deep = if G::IS_ANY { self.step_any(at_nodes) } else { self.step_closest(at_nodes) };
        self.give_up(too_deep, sink);
    }

    /// For any hit: pushes the children, and pops one. A bit for each whose stack may not hold the children of another node.
    #[inline(always)]
    fn step_any(&mut self, at_nodes: u64) -> u64 {
        let mut too_deep = 0;
        for slot in Bits(at_nodes) {
            let reference = self.references.of(slot);
            let node = &self.nodes[*reference as usize];
            let slabs = simd::opaque(&self.slots[slot].slabs);
            let (mask, enter) = intersect::intersect_boxes::<L::F32x16>(node, slabs);
            let stack = &mut self.stacks[slot];
            *reference = G::push_and_pop::<L>(node, mask, enter, stack);
            too_deep |= bit(stack.len() > STACK - WIDTH, slot);
        }
        too_deep
    }

    /// For the closest hit, where it pays to take care first of those that hit one child or none.
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
            // Anything, where there is not just one.
            *reference = intersect::only_child(node, mask);
            none |= bit(mask == 0, slot);
            many |= bit(mask & mask.wrapping_sub(1) != 0, slot);
        }
        let mut too_deep = 0;
        for slot in Bits(many) {
            let stack = &mut self.stacks[slot];
            let node = &nodes[*self.parents.of(slot) as usize];
            let (mask, enter) = (self.masks[slot], self.enters[rank(at_nodes, slot)]);
            *self.references.of(slot) = G::push_and_pop::<L>(node, mask, enter, stack);
            too_deep |= bit(stack.len() > STACK - WIDTH, slot);
        }
        self.pop(none);
        too_deep
    }

    /// Those that are at leaves go on to the next block, or to the top of their stacks.
    #[inline(always)]
    fn step_leaves(&mut self, at_leaves: u64) {
        let precise = &self.decider.start.precise;
        let (mut passing, mut last, mut hit) = (0, 0, 0);
        for slot in Bits(at_leaves) {
            let block = self.blocks.block(self.references.0[slot] & tag::PLACE);
            let own = &self.slots[slot].ray;
            let (mask, lines) = own.lines::<L>(block);
            let (uncertain, pass) = lines.pass(mask, precise);
            let (met, at) = own.cross(mask & !uncertain, &pass);
            self.passed[slot] = (LaneHits { met, uncertain, at }, pass);
            passing |= bit(met | uncertain != 0, slot);
            last |= bit(block.is_last(), slot);
        }
        for slot in Bits(passing) {
            let place = *self.references.of(slot) & tag::PLACE;
            let own = &mut self.slots[slot];
            let (hits, pass) = &self.passed[slot];
            if G::IS_ANY {
                let is_hit = hits.met != 0 || own.ray.meets_exactly(self.blocks.block(place), hits.uncertain);
                hit |= bit(is_hit, slot);
                continue;
            }
            let t = hits.at.reduce_min(hits.met);
            let which = hits.at.simd_le(L::F32x8::splat(t)) & hits.met;
            let lane = which.trailing_zeros() as usize % BLOCK;
            if own.nearest.take_nearest(self.decider, &mut own.ray, place, hits, pass, (lane, t)) {
                own.slabs.end_at(watertight::beyond(own.ray.t_max()));
            }
        }
        for slot in Bits(hit) {
            *self.references.of(slot) = HIT;
        }
        for slot in Bits(at_leaves & !hit & !last) {
            let reference = self.references.of(slot);
            let place = *reference & tag::PLACE;
            *reference = tag::reference(tag::TRIANGLES, self.blocks.block(place).place_behind(place));
        }
        self.pop(at_leaves & !hit & last);
    }

    /// Leaves those to be answered otherwise.
    #[inline(always)]
    fn give_up(&mut self, slots: u64, sink: &mut impl Sink<Option<Hit32>>) {
        for slot in Bits(slots) {
            let position = &mut self.slots[slot].position;
            sink.put(*position, Outcome::Uncertain);
            *position = ANSWERED;
            *self.references.of(slot) = DONE;
        }
    }

    /// Those take the top of their stacks that is not beyond the end of the ray.
    #[inline(always)]
    fn pop(&mut self, mut slots: u64) {
        while slots != 0 {
            let mut beyond = 0;
            for slot in Bits(slots) {
                let entry = self.stacks[slot].pop().unwrap_or(Self::bottom());
                *self.references.of(slot) = G::reference(entry);
                beyond |= bit(G::is_beyond(entry, self.slots[slot].slabs.s_max()), slot);
            }
            slots = beyond;
        }
    }

    /// Prefetches what those read next.
    #[inline(always)]
    fn prefetch(&mut self, slots: u64) {
        let Stations { nodes, leaves, .. } = self.stations();
        for slot in Bits(nodes & slots) {
            self.nodes.get(*self.references.of(slot) as usize).map(simd::fetch::<Node>);
        }
        for slot in Bits(leaves & slots) {
            self.blocks.block(*self.references.of(slot) & tag::PLACE).fetch();
        }
    }

    #[inline(always)]
    fn stations(&self) -> Stations {
        self.references.stations::<L::F32x16>()
    }

    /// Hands out the answers of those that are done.
    #[inline(always)]
    fn answer(&mut self, done: u64, sink: &mut impl Sink<Option<Hit32>>) {
        for slot in Bits(done) {
            let own = &self.slots[slot];
            if own.position != ANSWERED {
                let hit = if G::IS_ANY {
                    (*self.references.of(slot) == HIT).then_some(SOME_HIT)
                } else {
                    own.nearest.hit(self.decider, own.ray.t_max())
                };
                sink.put(own.position, Outcome::Certain(hit));
            }
        }
    }
}

/// Traverses the tree with those of the rays that have these positions; with `prefetches`, a ray prefetches what it reads next.
#[inline(always)]
pub(super) fn traverse<G: Goal, L: Simd>(
    decider: &Decider,
    prefetches: bool,
    rays: &[Ray32],
    positions: &[usize],
    sink: &mut impl Sink<Option<Hit32>>,
) {
    let mut waiting = positions.iter();
    let mut all = Interleaved::<G, L>::new(decider, rays);
    // All are done at first.
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
        // Where most of them are.
        let moving = if at.nodes.count_ones() >= at.leaves.count_ones() {
            all.step_nodes(at.nodes, sink);
            at.nodes
        } else {
            all.step_leaves(at.leaves);
            at.leaves
        };
        if prefetches {
            all.prefetch(moving);
        }
    }
}

/// Starts rays that wait in free slots: the slots that were taken.
#[inline(always)]
fn start_others<G: Goal, L: Simd>(
    all: &mut Interleaved<'_, '_, '_, G, L>,
    free: u64,
    waiting: &mut std::slice::Iter<usize>,
    sink: &mut impl Sink<Option<Hit32>>,
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
