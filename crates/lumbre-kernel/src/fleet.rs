//! Many rays in flight, so that one's arithmetic fills the waits of others.
//!
//! Rays take their steps together, in short loops without branches, as long as it can be: which rays a loop is for is told by bits that
//! one before it has put together. So little is foreseen wrongly but where loops end, and the processor has the steps of several rays in
//! view at once, where a branch that was foreseen wrongly, or a longer step, would leave it one.

mod double;

use std::hint::select_unpredictable;

use bytemuck::Zeroable;

use crate::batch::Ends;
use crate::blocks::TriangleBlock;
use crate::holds::SingleStart;
use crate::lanes::{self, Lanes, Slots, Vector, WIDE, Wide};
use crate::node::{Node, Slabs, WIDTH, tag};
use crate::single::{Exact, Outcome};
use crate::stack::{Order, STACK};
use crate::way::Way;

pub(crate) use double::DoubleFlyer;

/// A ray among triangles, in either precision, that flies.
pub(crate) trait Flyer<L: Lanes>: Sized {
    /// As it is asked.
    type Ray;
    /// What is asked of it.
    type Answer;
    /// Which boxes come first.
    type Order: Order;
    /// Whether any hit will do.
    const IS_ANY: bool;
    /// How its line passes the triangles of a block.
    type Pass: Copy + Zeroable;
    /// Where it meets each triangle.
    type At: Copy + Zeroable;

    /// The ray for boxes; `None` where it does not come from nearby, or is not sound.
    fn start(start: &SingleStart, ray: &Self::Ray) -> Option<Slabs>;
    /// The same for triangles.
    fn new(start: &SingleStart, ray: &Self::Ray, slabs: &Slabs) -> Self;
    /// The same in the place of another, of which may stand what means nothing.
    fn renew(&mut self, start: &SingleStart, ray: &Self::Ray, slabs: &Slabs);
    /// How its line passes the triangles of a block, and a bit for each that it may meet.
    fn pass(&self, block: &TriangleBlock) -> (u32, Self::Pass);
    /// Where it meets those of the mask.
    fn cross(&self, mask: u32, pass: &Self::Pass) -> Crossing<Self::At>;
    /// Whether it meets any of these, which are not clear.
    fn meets_closely(&self, exact: &Exact, ray: &Self::Ray, block: u32, unclear: u32) -> Outcome<bool>;
    /// Takes the nearest of those that it meets in a block, if that is nearer than what it met before; false where that is not to be
    /// told.
    fn take_nearest(
        &mut self,
        exact: &Exact,
        ray: &Self::Ray,
        block: u32,
        crossing: &Crossing<Self::At>,
        way: &mut Way<L>,
    ) -> bool;
    /// What came of it: whether any hit `is_met`, or what it has taken.
    fn answer(&self, exact: &Exact, ray: &Self::Ray, is_met: bool) -> Outcome<Self::Answer>;
}

/// The triangles of a block that a ray may meet.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Crossing<T> {
    /// A bit for each that it certainly does.
    pub(crate) met: u32,
    /// A bit for each that has to be looked at closer.
    pub(crate) unclear: u32,
    /// Where it meets each. What stands there of triangles in neither mask means nothing.
    pub(crate) at: T,
}

/// Rays in flight at most: a bit for each in a word.
pub(crate) const FLIGHTS: usize = 64;
/// How many have to have come to their end, or all, before others set out.
const ENOUGH: u32 = 8;
/// How many rays ahead one is asked for.
const AHEAD: usize = 2 * ENOUGH as usize;
/// The position of a ray that was answered already.
const NOWHERE: usize = usize::MAX;
/// Nothing is left of a ray's way.
const END: u32 = tag::reference(tag::RETURN, 0);
/// Alike, where any hit will do and there is one.
const MET: u32 = tag::reference(tag::RETURN, 1);

type Entry<F, L> = <<F as Flyer<L>>::Order as Order>::Entry;

/// A ray under way.
struct Flight<'a, 'r, F: Flyer<L>, L: Lanes> {
    way: Way<'a, L>,
    flyer: F,
    stack: Slots<Entry<F, L>>,
    position: usize,
    ray: &'r F::Ray,
}

impl<'a, 'r, F: Flyer<L>, L: Lanes> Flight<'a, 'r, F, L> {
    /// What is at the bottom of every stack.
    #[inline(always)]
    fn bottom() -> Entry<F, L> {
        F::Order::entry(END)
    }

    /// A ray that sets out; `None` where it does not come from nearby, or is not sound.
    #[inline(always)]
    fn new(exact: &Exact<'a>, position: usize, ray: &'r F::Ray) -> Option<Self> {
        let slabs = F::start(exact.start, lanes::opaque(ray))?;
        let flyer = F::new(exact.start, lanes::opaque(ray), &slabs);
        let mut stack = Slots::new();
        stack.push(Self::bottom());
        Some(Self { way: Way::new(exact.nodes(), slabs), flyer, stack, position, ray })
    }

    /// The same in the place of another, whose stack is not moved; false where there is none.
    #[inline(always)]
    fn restart(&mut self, exact: &Exact<'a>, position: usize, ray: &'r F::Ray) -> bool {
        let ray = lanes::opaque(ray);
        let Some(slabs) = F::start(exact.start, ray) else { return false };
        self.flyer.renew(exact.start, ray, &slabs);
        self.way = Way::new(exact.nodes(), slabs);
        (self.position, self.ray) = (position, ray);
        self.stack.clear();
        self.stack.push(Self::bottom());
        true
    }

    /// Whether there may be no room for the children of another node.
    #[inline(always)]
    fn is_too_deep(&self) -> bool {
        self.stack.len() > STACK - WIDTH
    }

    /// Whether an entry of its stack lies wholly beyond its end.
    #[inline(always)]
    fn is_beyond(&self, entry: Entry<F, L>) -> bool {
        self.way.is_beyond::<F::Order>(entry)
    }
}

/// The places of bits, the lowest first.
#[derive(Clone, Copy)]
struct Bits(u64);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let first = self.0.trailing_zeros();
        self.0 &= self.0.wrapping_sub(1);
        (first < u64::BITS).then_some(first as usize % FLIGHTS)
    }
}

/// A bit in this place if that is so.
#[inline(always)]
fn bit(is: bool, place: usize) -> u64 {
    u64::from(is) << place
}

/// Where each flight is.
#[repr(align(64))]
struct References([u32; FLIGHTS]);

/// A bit for each flight that is at a node, at a leaf, and at its end.
#[derive(Clone, Copy)]
struct Stations {
    nodes: u64,
    leaves: u64,
    ends: u64,
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
            on_the_way |= u64::from(row.bits_above(-1)) << (WIDE * i);
            leaves |= u64::from(row.bits_above(tag::PLACE as i32)) << (WIDE * i);
        }
        Stations { nodes: on_the_way & !leaves, leaves, ends: !on_the_way }
    }
}

/// All that are under way, and what one loop hands on to another.
struct Fleet<'a, 'r, F: Flyer<L>, L: Lanes> {
    exact: Exact<'a>,
    flights: Vec<Flight<'a, 'r, F, L>>,
    references: References,
    /// Which children of its node, or triangles of its block, each may meet.
    masks: [u32; FLIGHTS],
    /// Where each enters the boxes of children.
    enters: [L::Wide; FLIGHTS],
    passes: [F::Pass; FLIGHTS],
    crossings: [Crossing<F::At>; FLIGHTS],
    /// Which triangles have to be looked at closer.
    unclear: [u32; FLIGHTS],
    /// Where the next block of its leaf is.
    following: [u32; FLIGHTS],
}

impl<'a, 'r, F: Flyer<L>, L: Lanes> Fleet<'a, 'r, F, L> {
    #[inline(always)]
    fn new(exact: &Exact<'a>) -> Self {
        Self {
            exact: *exact,
            flights: Vec::with_capacity(FLIGHTS),
            references: References([END; FLIGHTS]),
            masks: [0; FLIGHTS],
            enters: [L::Wide::splat(0.0); FLIGHTS],
            passes: [F::Pass::zeroed(); FLIGHTS],
            crossings: [Crossing::zeroed(); FLIGHTS],
            unclear: [0; FLIGHTS],
            following: [END; FLIGHTS],
        }
    }

    /// Those that are at nodes go on to the child that comes first, or to what stands on their stacks.
    #[inline(always)]
    fn meet_nodes(&mut self, at_nodes: u64, ends: &mut impl Ends<F::Answer>) {
        let nodes = self.exact.nodes();
        let (mut none, mut many) = (0, 0);
        for place in Bits(at_nodes) {
            let node = &nodes[*self.references.of(place) as usize];
            let slabs = lanes::opaque(self.flights[place].way.slabs());
            let (mask, enter) = lanes::meet_boxes::<L::Wide>(node, slabs);
            self.masks[place] = mask;
            if !F::Order::PUTS_ONE {
                self.enters[place] = enter;
                none |= bit(mask == 0, place);
                many |= bit(mask & mask.wrapping_sub(1) != 0, place);
            }
        }
        let mut one = at_nodes & !none & !many;
        if F::Order::PUTS_ONE {
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
            *reference = F::Order::put_and_take::<L>(node, mask, enter, &mut flight.stack);
            too_deep |= bit(flight.is_too_deep(), place);
        }
        self.give_up(too_deep, ends);
        self.pop(none);
    }

    /// Those that are at leaves go on to the next block, or to what stands on their stacks.
    #[inline(always)]
    fn meet_blocks(&mut self, at_leaves: u64, ends: &mut impl Ends<F::Answer>) {
        let mut passing = 0;
        for place in Bits(at_leaves) {
            let unit = *self.references.of(place) & tag::PLACE;
            let block = self.exact.block(unit);
            (self.masks[place], self.passes[place]) = self.flights[place].flyer.pass(block);
            passing |= bit(self.masks[place] != 0, place);
            let next = tag::reference(tag::TRIANGLES, block.place_behind(unit));
            self.following[place] = select_unpredictable(block.is_last(), END, next);
        }
        let (mut meeting, mut unclear) = (0, 0);
        for place in Bits(passing) {
            let crossing = self.flights[place].flyer.cross(self.masks[place], &self.passes[place]);
            meeting |= bit(crossing.met != 0, place);
            unclear |= bit(crossing.unclear != 0, place);
            if F::IS_ANY {
                self.unclear[place] = crossing.unclear;
            } else {
                self.crossings[place] = crossing;
            }
        }
        let mut unsettled = 0;
        if F::IS_ANY {
            for place in Bits(unclear & !meeting) {
                let unit = *self.references.of(place) & tag::PLACE;
                let Flight { flyer, ray, .. } = &self.flights[place];
                match flyer.meets_closely(&self.exact, ray, unit, self.unclear[place]) {
                    Outcome::Settled(is_met) => meeting |= bit(is_met, place),
                    Outcome::Unsettled => unsettled |= bit(true, place),
                }
            }
        } else {
            for place in Bits(meeting | unclear) {
                let unit = *self.references.of(place) & tag::PLACE;
                let Flight { flyer, ray, way, .. } = &mut self.flights[place];
                let is_settled = flyer.take_nearest(&self.exact, ray, unit, &self.crossings[place], way);
                unsettled |= bit(!is_settled, place);
            }
            meeting = 0;
        }
        let mut beyond = 0;
        for place in Bits(at_leaves) {
            let flight = &mut self.flights[place];
            let next = self.following[place];
            let is_last = next == END;
            let bottom = Flight::<F, L>::bottom();
            let entry = flight.stack.pop_if(is_last).unwrap_or(bottom);
            let next = select_unpredictable(is_last, F::Order::reference(entry), next);
            let is_met = meeting >> place & 1 != 0;
            *self.references.of(place) = select_unpredictable(is_met, MET, next);
            beyond |= bit(is_last & !is_met & flight.is_beyond(entry), place);
        }
        self.give_up(unsettled, ends);
        self.pop(beyond & !unsettled);
    }

    /// Leaves those to the plain search.
    #[inline(always)]
    fn give_up(&mut self, those: u64, ends: &mut impl Ends<F::Answer>) {
        for place in Bits(those) {
            let position = &mut self.flights[place].position;
            ends.put(*position, Outcome::Unsettled);
            *position = NOWHERE;
            *self.references.of(place) = END;
        }
    }

    /// Those take the next on their stacks that is not beyond their limits.
    #[inline(always)]
    fn pop(&mut self, mut those: u64) {
        while those != 0 {
            let mut beyond = 0;
            for place in Bits(those) {
                let flight = &mut self.flights[place];
                let bottom = Flight::<F, L>::bottom();
                let entry = flight.stack.pop().unwrap_or(bottom);
                *self.references.of(place) = F::Order::reference(entry);
                beyond |= bit(flight.is_beyond(entry), place);
            }
            those = beyond;
        }
    }

    /// Asks for what those of them read next.
    #[inline(always)]
    fn fetch(&mut self, those: u64) {
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
    fn answer(&mut self, at_ends: u64, ends: &mut impl Ends<F::Answer>) {
        for place in Bits(at_ends) {
            let flight = &self.flights[place];
            if flight.position != NOWHERE {
                let is_met = *self.references.of(place) == MET;
                ends.put(flight.position, flight.flyer.answer(&self.exact, flight.ray, is_met));
            }
        }
    }
}

/// Searches along those of the rays that have these positions. If that is asked for, a ray `asks_ahead` for what it comes to next,
/// before it is its turn.
#[inline(always)]
pub(crate) fn fly<F: Flyer<L>, L: Lanes>(
    exact: &Exact,
    asks_ahead: bool,
    rays: &[F::Ray],
    positions: &[usize],
    ends: &mut impl Ends<F::Answer>,
) {
    let root = exact.start.root;
    let mut waiting = positions.iter();
    let mut fleet = Fleet::<F, L>::new(exact);
    let mut under_way = 0;
    while fleet.flights.len() < L::FLIGHTS.min(FLIGHTS)
        && let Some(&position) = waiting.next()
    {
        match Flight::new(exact, position, &rays[position]) {
            Some(flight) => {
                ends.fetch(position);
                let place = fleet.flights.len();
                *fleet.references.of(place) = root;
                under_way |= bit(true, place);
                fleet.flights.push(flight);
            }
            None => ends.put(position, Outcome::Unsettled),
        }
    }
    while under_way != 0 {
        let at = fleet.references.stations::<L>();
        let at_ends = at.ends & under_way;
        if at_ends.count_ones() >= ENOUGH || at_ends == under_way {
            fleet.answer(at_ends, ends);
            under_way &= !at_ends;
            for place in Bits(at_ends) {
                if let Some(&position) = waiting.as_slice().get(AHEAD) {
                    lanes::fetch(&rays[position]);
                }
                for &position in waiting.by_ref() {
                    if fleet.flights[place].restart(exact, position, &rays[position]) {
                        ends.fetch(position);
                        *fleet.references.of(place) = root;
                        under_way |= bit(true, place);
                        break;
                    }
                    ends.put(position, Outcome::Unsettled);
                }
            }
            continue;
        }
        // Where most of them are.
        let moving = if at.nodes.count_ones() >= at.leaves.count_ones() {
            fleet.meet_nodes(at.nodes, ends);
            at.nodes
        } else {
            fleet.meet_blocks(at.leaves, ends);
            at.leaves
        };
        if asks_ahead {
            fleet.fetch(moving);
        }
    }
}
