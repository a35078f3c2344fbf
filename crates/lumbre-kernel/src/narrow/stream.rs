//! Many rays in flight, so that one's arithmetic fills the waits of others.
//!
//! Rays take their steps together, in short loops without branches, as long as it can be: which rays a loop is for is told by bits that
//! one before it has put together. So little is foreseen wrongly but where loops end, and the processor has the steps of several rays in
//! view at once, where a branch that was foreseen wrongly, or a longer step, would leave it one.

use std::hint::select_unpredictable;

use super::{Goal, NarrowRay, Nearest, Pass, Passed, Seeker};
use crate::Ray32;
use crate::lanes::{self, Eight, Lanes, Slots, Vector, WIDE, Wide};
use crate::node::{Node, Slabs, WIDTH, tag};
use crate::single::Exact;
use crate::stack::{Order, STACK};
use crate::triangles;
use crate::way::limit_of;

/// Rays in flight: a bit for each in a word.
const FLIGHTS: usize = 32;
/// How many have to have come to their end, or all, before others set out.
const ENOUGH: u32 = 8;
/// The position of a ray that was answered already.
const NOWHERE: usize = usize::MAX;
/// Nothing is left of a ray's way.
const END: u32 = tag::reference(tag::RETURN, 0);
/// Alike, where any hit will do and there is one.
const MET: u32 = tag::reference(tag::RETURN, 1);

type Entry<G> = <<G as Goal>::Order as Order>::Entry;

/// A ray under way.
struct Flight<'r, E> {
    slabs: Slabs,
    ray: NarrowRay,
    /// No entry of the stack that is larger is of interest.
    limit: i64,
    stack: Slots<E>,
    nearest: Nearest,
    position: usize,
    asked: &'r Ray32,
}

impl<'r, E: Copy> Flight<'r, E> {
    /// A ray that sets out, with this at the bottom of its stack; `None` where it does not come from nearby, or is not sound.
    #[inline(always)]
    fn new<L: Lanes>(exact: &Exact, position: usize, asked: &'r Ray32, bottom: E) -> Option<Self> {
        let slabs = L::start_narrow(exact.start, lanes::opaque(asked))?;
        let ray = L::start_narrow_blocks(exact.start, lanes::opaque(asked), &slabs);
        let (limit, mut stack) = (limit_of(slabs.s_max), Slots::new());
        stack.push(bottom);
        Some(Self { slabs, ray, limit, stack, nearest: Nearest::NONE, position, asked })
    }

    /// The same in the place of another, whose stack is not moved; false where there is none.
    #[inline(always)]
    fn restart<L: Lanes>(&mut self, exact: &Exact, position: usize, asked: &'r Ray32, bottom: E) -> bool {
        let asked = lanes::opaque(asked);
        let Some(slabs) = L::start_narrow(exact.start, asked) else { return false };
        self.ray = L::start_narrow_blocks(exact.start, asked, &slabs);
        self.limit = limit_of(slabs.s_max);
        self.slabs = slabs;
        self.nearest.block = u32::MAX;
        (self.position, self.asked) = (position, asked);
        self.stack.clear();
        self.stack.push(bottom);
        true
    }

    /// Takes the nearest of what it meets in a block, if that is nearer than what it met before.
    #[inline(always)]
    fn take_nearest<L: Lanes>(&mut self, exact: &Exact, place: u32, passed: &Passed<L::Eight>) {
        let t = passed.t.least_of(passed.met);
        let which = passed.t.at_most(L::Eight::splat(t)) & passed.met;
        let is_alone = which & which.wrapping_sub(1) == 0;
        if passed.unclear != 0 || !is_alone || t >= self.ray.t_max {
            self.take_with_care::<L>(exact, place, passed);
            return;
        }
        let nearest = &mut self.nearest;
        (nearest.block, nearest.lane) = (place, which.trailing_zeros());
        let [v, w, det] = passed.weights;
        nearest.weights = [v.to_array(), w.to_array(), det.to_array()];
        self.ray.t_max = t;
        self.end_at(t);
    }

    /// The same where one has to be looked at closer, or two are met at the same place, of whatever block.
    #[inline(always)]
    fn take_with_care<L: Lanes>(&mut self, exact: &Exact, place: u32, passed: &Passed<L::Eight>) {
        let mut seeker = Seeker { exact: *exact, ray: &mut self.ray, nearest: &mut self.nearest };
        if seeker.take::<L>(exact.block(place), place, passed) {
            self.end_at(self.ray.t_max);
        }
    }

    /// Leaves out what comes after.
    #[inline(always)]
    fn end_at(&mut self, t: f32) {
        self.slabs.s_max = triangles::beyond(t);
        self.limit = limit_of(self.slabs.s_max);
    }

    /// Whether there may be no room for the children of another node.
    #[inline(always)]
    fn is_too_deep(&self) -> bool {
        self.stack.len() > STACK - WIDTH
    }
}

/// The places of bits, the lowest first.
#[derive(Clone, Copy)]
struct Bits(u32);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let first = self.0.trailing_zeros();
        self.0 &= self.0.wrapping_sub(1);
        (first < u32::BITS).then_some(first as usize % FLIGHTS)
    }
}

/// A bit in this place if that is so.
#[inline(always)]
fn bit(is: bool, place: usize) -> u32 {
    u32::from(is) << place
}

/// Where each flight is.
#[repr(align(64))]
struct References([u32; FLIGHTS]);

/// A bit for each flight that is at a node, at a leaf, and at its end.
#[derive(Clone, Copy)]
struct Stations {
    nodes: u32,
    leaves: u32,
    ends: u32,
}

impl References {
    #[inline(always)]
    fn of(&mut self, flight: usize) -> &mut u32 {
        &mut self.0[flight % FLIGHTS]
    }

    #[inline(always)]
    fn stations<L: Lanes>(&self) -> Stations {
        let (rows, _) = self.0.as_chunks::<WIDE>();
        let (mut on_the_way, mut leaves) = (0, 0);
        for (i, row) in rows.iter().enumerate() {
            let row = L::Wide::load(bytemuck::cast_ref(row));
            // As an integer, the end has a sign.
            on_the_way |= row.bits_above(-1) << (WIDE * i);
            leaves |= row.bits_above(tag::PLACE as i32) << (WIDE * i);
        }
        Stations { nodes: on_the_way & !leaves, leaves, ends: !on_the_way }
    }
}

/// All that are under way, and what one loop hands on to another.
struct Fleet<'a, 'r, G: Goal, L: Lanes> {
    exact: Exact<'a>,
    flights: Vec<Flight<'r, Entry<G>>>,
    references: References,
    /// Which children of its node each meets, and where it enters their boxes.
    masks: [u32; FLIGHTS],
    enters: [L::Wide; FLIGHTS],
    passes: [Pass<L::Eight>; FLIGHTS],
    passed: [Passed<L::Eight>; FLIGHTS],
    /// Where the next block of its leaf is.
    following: [u32; FLIGHTS],
}

impl<'a, 'r, G: Goal, L: Lanes> Fleet<'a, 'r, G, L> {
    #[inline(always)]
    fn new(exact: &Exact<'a>) -> Self {
        let zero = L::Eight::splat(0.0);
        let three = [zero; 3];
        Self {
            exact: *exact,
            flights: Vec::with_capacity(FLIGHTS),
            references: References([END; FLIGHTS]),
            masks: [0; FLIGHTS],
            enters: [L::Wide::splat(0.0); FLIGHTS],
            passes: [Pass { mask: 0, products: three, edges: three, heights: three }; FLIGHTS],
            passed: [Passed { met: 0, unclear: 0, t: zero, weights: three }; FLIGHTS],
            following: [END; FLIGHTS],
        }
    }

    /// What is at the bottom of every stack.
    #[inline(always)]
    fn bottom() -> Entry<G> {
        G::Order::entry(END)
    }

    /// Those that are at nodes go on to the child that comes first, or to what stands on their stacks.
    #[inline(always)]
    fn meet_nodes(&mut self, at_nodes: u32, answers: &mut [G::Answer]) {
        let nodes = self.exact.nodes();
        let (mut none, mut many) = (0, 0);
        for place in Bits(at_nodes) {
            let node = &nodes[*self.references.of(place) as usize];
            let slabs = lanes::opaque(&self.flights[place].slabs);
            let (mask, enter) = lanes::meet_boxes::<L::Wide>(node, slabs);
            self.masks[place] = mask;
            if !G::Order::PUTS_ONE {
                self.enters[place] = enter;
                none |= bit(mask == 0, place);
                many |= bit(mask & mask.wrapping_sub(1) != 0, place);
            }
        }
        let mut one = at_nodes & !none & !many;
        if G::Order::PUTS_ONE {
            (many, one) = (at_nodes, 0);
        }
        for place in Bits(one) {
            let reference = self.references.of(place);
            *reference = lanes::only_child(&nodes[*reference as usize], self.masks[place]);
        }
        let mut too_deep = 0;
        for place in Bits(many) {
            let flight = &mut self.flights[place];
            let reference = self.references.of(place);
            let node = &nodes[*reference as usize];
            let (mask, enter) = (self.masks[place], self.enters[place]);
            *reference = G::Order::put_and_take::<L>(node, mask, enter, &mut flight.stack);
            too_deep |= bit(flight.is_too_deep(), place);
        }
        // By a call: that is rare.
        let alone = G::alone_at(L::level());
        for place in Bits(too_deep) {
            let flight = &mut self.flights[place];
            answers[flight.position] = alone.ask(self.exact.accel(), flight.asked);
            flight.position = NOWHERE;
            *self.references.of(place) = END;
        }
        self.pop(none);
    }

    /// Those that are at leaves go on to the next block, or to what stands on their stacks.
    #[inline(always)]
    fn meet_blocks(&mut self, at_leaves: u32) {
        let mut passing = 0;
        for place in Bits(at_leaves) {
            let unit = *self.references.of(place) & tag::PLACE;
            let block = self.exact.block(unit);
            self.passes[place] = self.flights[place].ray.pass_edges::<L, false>(block);
            passing |= bit(self.passes[place].mask != 0, place);
            let next = tag::reference(tag::TRIANGLES, block.place_behind(unit));
            self.following[place] = select_unpredictable(block.is_last(), END, next);
        }
        let (mut meeting, mut unclear) = (0, 0);
        for place in Bits(passing) {
            let of = self.flights[place].ray.cross::<L>(&self.passes[place]);
            meeting |= bit(of.met != 0, place);
            unclear |= bit(of.unclear != 0, place);
            if G::IS_ANY {
                self.passed[place].unclear = of.unclear;
            } else {
                self.passed[place] = of;
            }
        }
        if G::IS_ANY {
            for place in Bits(unclear & !meeting) {
                let block = self.exact.block(*self.references.of(place) & tag::PLACE);
                let is_met = self.flights[place].ray.meets_exactly(block, self.passed[place].unclear);
                meeting |= bit(is_met, place);
            }
        } else {
            for place in Bits(meeting | unclear) {
                let unit = *self.references.of(place) & tag::PLACE;
                self.flights[place].take_nearest::<L>(&self.exact, unit, &self.passed[place]);
            }
            meeting = 0;
        }
        let mut beyond = 0;
        for place in Bits(at_leaves) {
            let flight = &mut self.flights[place];
            let next = self.following[place];
            let is_last = next == END;
            let entry = flight.stack.pop_if(is_last).unwrap_or(Self::bottom());
            let next = select_unpredictable(is_last, G::Order::reference(entry), next);
            let is_met = meeting >> place & 1 != 0;
            *self.references.of(place) = select_unpredictable(is_met, MET, next);
            beyond |= bit(is_last & !is_met & G::Order::is_beyond(entry, flight.limit), place);
        }
        self.pop(beyond);
    }

    /// Those take the next on their stacks that is not beyond their limits.
    #[inline(always)]
    fn pop(&mut self, mut those: u32) {
        while those != 0 {
            let mut beyond = 0;
            for place in Bits(those) {
                let flight = &mut self.flights[place];
                let entry = flight.stack.pop().unwrap_or(Self::bottom());
                *self.references.of(place) = G::Order::reference(entry);
                beyond |= bit(G::Order::is_beyond(entry, flight.limit), place);
            }
            those = beyond;
        }
    }

    /// Asks for what those of them read next.
    #[inline(always)]
    fn fetch(&mut self, those: u32) {
        let at = self.references.stations::<L>();
        for place in Bits(at.nodes & those) {
            self.exact.nodes().get(*self.references.of(place) as usize).map(lanes::fetch::<Node>);
        }
        for place in Bits(at.leaves & those) {
            self.exact.block(*self.references.of(place) & tag::PLACE).fetch();
        }
    }

    /// Puts the answers of those at their end.
    #[inline(always)]
    fn answer(&mut self, at_ends: u32, answers: &mut [G::Answer]) {
        for place in Bits(at_ends) {
            let flight = &self.flights[place];
            if flight.position != NOWHERE {
                let is_met = *self.references.of(place) == MET;
                answers[flight.position] = G::answer(&self.exact, is_met, &flight.nearest, flight.ray.t_max);
            }
        }
    }
}

/// Searches along those of the rays that have these positions. Where the tree `is_far`, what a ray comes to next is asked for before it
/// is its turn.
#[inline(always)]
pub(super) fn fly<G: Goal, L: Lanes>(
    exact: &Exact,
    is_far: bool,
    rays: &[Ray32],
    positions: &[usize],
    answers: &mut [G::Answer],
) {
    let root = exact.start.root;
    let bottom = Fleet::<G, L>::bottom();
    let mut waiting = positions.iter();
    let mut fleet = Fleet::<G, L>::new(exact);
    let mut under_way = 0;
    while fleet.flights.len() < FLIGHTS
        && let Some(&position) = waiting.next()
    {
        let asked = &rays[position];
        match Flight::new::<L>(exact, position, asked, bottom) {
            Some(flight) => {
                let place = fleet.flights.len();
                *fleet.references.of(place) = root;
                under_way |= bit(true, place);
                fleet.flights.push(flight);
            }
            None => answers[position] = G::widely(exact.accel(), asked),
        }
    }
    while under_way != 0 {
        let at = fleet.references.stations::<L>();
        let ends = at.ends & under_way;
        if ends.count_ones() >= ENOUGH || ends == under_way {
            fleet.answer(ends, answers);
            under_way &= !ends;
            for place in Bits(ends) {
                for &position in waiting.by_ref() {
                    let asked = &rays[position];
                    if fleet.flights[place].restart::<L>(exact, position, asked, bottom) {
                        *fleet.references.of(place) = root;
                        under_way |= bit(true, place);
                        break;
                    }
                    answers[position] = G::widely(exact.accel(), asked);
                }
            }
            continue;
        }
        // Where most of them are.
        let moving = if at.nodes.count_ones() >= at.leaves.count_ones() {
            fleet.meet_nodes(at.nodes, answers);
            at.nodes
        } else {
            fleet.meet_blocks(at.leaves);
            at.leaves
        };
        if is_far {
            fleet.fetch(moving);
        }
    }
}
