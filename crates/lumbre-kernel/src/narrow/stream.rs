//! Many rays in flight, so that one's arithmetic fills the waits of others for memory: for trees of which the caches hold little.
//!
//! Rays take turns: all that are at nodes, then all that are at leaves. What a ray comes to next is asked for before it is its turn.

use super::{Goal, NarrowRay, Nearest, Seeker};
use crate::Ray32;
use crate::batch::Queue;
use crate::lanes::{self, Lanes, Slots, Vector};
use crate::node::{Node, Slabs, WIDTH, tag};
use crate::single::Exact;
use crate::stack::{Order, STACK};
use crate::triangles;
use crate::way::limit_of;

/// Rays in flight.
const FLIGHTS: usize = 32;
/// The position of a ray that was answered already.
const NOWHERE: usize = usize::MAX;
/// Nothing is left of a ray's way.
const END: u32 = tag::reference(tag::RETURN, 0);

/// A ray under way.
struct Flight<'r, E> {
    position: usize,
    asked: &'r Ray32,
    slabs: Slabs,
    ray: NarrowRay,
    nearest: Nearest,
    reference: u32,
    limit: i64,
    stack: Slots<E>,
}

/// Where flights are.
struct Stations<'a> {
    nodes: &'a [Node],
    at_nodes: Queue<FLIGHTS>,
    at_leaves: Queue<FLIGHTS>,
    at_end: Queue<FLIGHTS>,
}

impl Stations<'_> {
    /// Puts one where its reference leads.
    #[inline(always)]
    fn put(&mut self, exact: &Exact, place: usize, reference: u32) {
        match reference >> tag::SHIFT {
            tag::INNER => {
                self.nodes.get(reference as usize).map(lanes::fetch);
                self.at_nodes.put(place);
            }
            tag::TRIANGLES => {
                exact.block(reference & tag::PLACE).fetch();
                self.at_leaves.put(place);
            }
            _ => self.at_end.put(place),
        }
    }
}

impl<'r, E: Copy> Flight<'r, E> {
    /// A ray that sets out; `None` where it does not come from nearby, or is not sound.
    #[inline(always)]
    fn new<L: Lanes>(exact: &Exact, position: usize, asked: &'r Ray32, bottom: E) -> Option<Self> {
        let slabs = L::start_narrow(exact.start, lanes::opaque(asked))?;
        let ray = L::start_narrow_blocks(exact.start, lanes::opaque(asked), &slabs);
        let mut stack = Slots::new();
        stack.push(bottom);
        let (limit, reference) = (limit_of(slabs.s_max), exact.start.root);
        Some(Self { position, asked, slabs, ray, nearest: Nearest::NONE, reference, limit, stack })
    }

    /// The same in the place of another.
    #[inline(always)]
    fn restart<L: Lanes>(&mut self, exact: &Exact, position: usize, asked: &'r Ray32, bottom: E) -> bool {
        let Some(slabs) = L::start_narrow(exact.start, lanes::opaque(asked)) else { return false };
        self.ray = L::start_narrow_blocks(exact.start, lanes::opaque(asked), &slabs);
        self.limit = limit_of(slabs.s_max);
        self.slabs = slabs;
        self.nearest.block = u32::MAX;
        self.reference = exact.start.root;
        (self.position, self.asked) = (position, asked);
        self.stack.clear();
        self.stack.push(bottom);
        true
    }

    /// Goes on from what it meets of a node.
    #[inline(always)]
    fn go_on<L: Lanes, O: Order<Entry = E>>(&mut self, nodes: &[Node], (mask, enter): (u32, L::Wide)) {
        let node = &nodes[self.reference as usize];
        self.reference = if mask & mask.wrapping_sub(1) != 0 {
            O::push_children::<L>(node, mask, enter, self.stack.room())
        } else if mask != 0 {
            lanes::only_child(node, mask)
        } else {
            self.take::<O>()
        };
    }

    /// Goes on from a block of triangles.
    #[inline(always)]
    fn meet_block<L: Lanes, G: Goal<Order: Order<Entry = E>>>(&mut self, exact: &Exact) {
        let place = self.reference & tag::PLACE;
        let block = exact.block(place);
        if G::IS_ANY {
            if self.ray.meets_any::<L>(block) {
                self.nearest.block = place;
                self.reference = END;
                return;
            }
        } else if (Seeker { exact: *exact, ray: &mut self.ray, nearest: &mut self.nearest })
            .meet_block::<L>(block, place)
        {
            self.slabs.s_max = triangles::beyond(self.ray.t_max);
            self.limit = limit_of(self.slabs.s_max);
        }
        self.reference = match block.next(place) {
            Some(next) => tag::reference(tag::TRIANGLES, next),
            None => self.take::<G::Order>(),
        };
    }

    /// Whether there may be no room for the children of another node.
    #[inline(always)]
    fn is_too_deep(&self) -> bool {
        self.stack.len() > STACK - WIDTH
    }

    /// The next that is not beyond the limit.
    #[inline(always)]
    fn take<O: Order<Entry = E>>(&mut self) -> u32 {
        loop {
            let Some(entry) = self.stack.pop() else { return END };
            if !O::is_beyond(entry, self.limit) {
                return O::reference(entry);
            }
        }
    }
}

/// Searches along those of the rays that have these positions.
#[inline(always)]
pub(super) fn fly<G: Goal, L: Lanes>(
    exact: &Exact,
    rays: &[Ray32],
    positions: &[usize],
    answers: &mut [G::Answer],
) {
    let mut waiting = positions.iter();
    // For a ray whose stack is full, by a call: that is rare.
    let alone = G::alone_at(L::level());
    let bottom = G::Order::entry(END);
    let mut flights: Vec<Flight<<G::Order as Order>::Entry>> = Vec::with_capacity(FLIGHTS);
    let mut stations = Stations {
        nodes: exact.nodes(),
        at_nodes: Queue::EMPTY,
        at_leaves: Queue::EMPTY,
        at_end: Queue::EMPTY,
    };
    while flights.len() < FLIGHTS
        && let Some(&position) = waiting.next()
    {
        let asked = &rays[position];
        match Flight::new::<L>(exact, position, asked, bottom) {
            Some(flight) => {
                stations.put(exact, flights.len(), flight.reference);
                flights.push(flight);
            }
            None => answers[position] = G::widely(exact.accel(), asked),
        }
    }
    let mut met = [(0, L::Wide::splat(0.0)); FLIGHTS];
    while stations.at_nodes.len + stations.at_leaves.len + stations.at_end.len != 0 {
        // Which boxes each meets is told for all before any turns by it.
        let count = stations.at_nodes.begin();
        for (turn, met) in met[..count].iter_mut().enumerate() {
            let flight = &flights[stations.at_nodes.at(turn)];
            let node = &stations.nodes[flight.reference as usize];
            *met = lanes::meet_boxes::<L::Wide>(node, lanes::opaque(&flight.slabs));
        }
        for (turn, met) in met[..count].iter().enumerate() {
            let place = stations.at_nodes.at(turn);
            let flight = &mut flights[place];
            flight.go_on::<L, G::Order>(stations.nodes, *met);
            if flight.is_too_deep() {
                answers[flight.position] = alone.ask(exact.accel(), flight.asked);
                flight.position = NOWHERE;
                flight.reference = END;
            }
            stations.put(exact, place, flight.reference);
        }
        if stations.at_nodes.len > FLIGHTS / 2 {
            continue;
        }
        for turn in 0..stations.at_leaves.begin() {
            let place = stations.at_leaves.at(turn);
            let flight = &mut flights[place];
            flight.meet_block::<L, G>(exact);
            stations.put(exact, place, flight.reference);
        }
        for turn in 0..stations.at_end.begin() {
            let place = stations.at_end.at(turn);
            let flight = &mut flights[place];
            if flight.position != NOWHERE {
                answers[flight.position] = G::answer(exact, &flight.nearest, flight.ray.t_max);
            }
            for &position in waiting.by_ref() {
                let asked = &rays[position];
                if flight.restart::<L>(exact, position, asked, bottom) {
                    stations.put(exact, place, flight.reference);
                    break;
                }
                answers[position] = G::widely(exact.accel(), asked);
            }
        }
    }
}
