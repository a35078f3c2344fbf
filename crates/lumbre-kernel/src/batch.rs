//! Many rays at once.
//!
//! Those that are alike go together: see [`packet`]. The others are in flight, some on a thread, so that one's arithmetic fills the
//! waits of another: which boxes each of them meets is told for all before any of them turns by it. Each ray takes the very
//! steps that it takes alone, in turn with the others: its answer has the same bits.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use crate::Accel;
use crate::blocks::{TriangleBlock, Unit};
use crate::holds::{Contents, SingleStart};
use crate::lanes::{self, Lanes, Level, Task};
use crate::node::{Node, tag};
use crate::packet::{self, AmongInstances, Companion, NoOthers, Others, PACKET, Packet, Together};
use crate::query::All;
use crate::single::{Goal, Outcome, SingleRay, Step};
use crate::stack::{Order, Stack};
use crate::way::{Met, Way};

/// Rays in flight on a thread, where the caches hold much of the tree and where they do not.
const FEW: usize = 4;
const MANY: usize = 32;
/// Bytes of nodes and triangles from which on they do not.
pub(crate) const FAR: usize = 1 << 24;

/// Packets in a row that may go alone without a try.
pub(crate) const LEAST_OFTEN: usize = 16;
/// Rays among which those that are alike are sought before the others set out.
pub(crate) const AT_ONCE: usize = 4096;

/// How many packets ahead rays are asked for.
const AHEAD: usize = 2;

/// Asks for the rays of a packet, before they are read: by packets, they are read faster than caches foresee. Where any hit will do,
/// nothing else keeps the memory busy, and they do.
#[inline(always)]
fn fetch_rays<G: Goal>(rays: &[Ray]) {
    if !G::IS_ANY {
        rays.first_chunk::<PACKET>().map(lanes::fetch);
    }
}

/// Takes what came of every ray, in any order.
pub(crate) trait Ends<A> {
    /// To be `#[inline(always)]`: an answer that goes through memory is waited for.
    fn put(&mut self, position: usize, outcome: Outcome<A>);
}

impl<A, F: FnMut(usize, Outcome<A>)> Ends<A> for F {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<A>) {
        self(position, outcome);
    }
}

/// What takes the ends, as it is given: to have a closure inlined, it has to stand in a call.
#[inline(always)]
pub(crate) fn ends<A, F: FnMut(usize, Outcome<A>)>(ends: F) -> F {
    ends
}

/// Searches along every ray, in a tree of triangles, or of shapes and custom geometry too.
pub(crate) fn search_all<G: Goal>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[Ray],
    ends: impl Ends<G::Answer>,
) {
    let tree = &accel.tree;
    let bytes = size_of_val::<[Node]>(&tree.nodes) + size_of_val::<[Unit]>(&tree.blocks);
    if start.contents == Contents::Triangles {
        search_triangles::<G>(level, accel, start, rays, ends, bytes >= FAR, true);
    } else {
        let others = NoOthers::<true> { accel, start };
        level.run(OneByOne::<G, _, _> { accel, start, rays, others, ends, goal: PhantomData });
    }
}

/// Searches along every ray in a tree of anything.
pub(crate) fn search_anything<G: Companion>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[Ray],
    ends: impl Ends<G::Found>,
) {
    let others = AmongInstances::new(accel, start);
    level.run(OneByOne::<G, _, _> { accel, start, rays, others, ends, goal: PhantomData });
}

/// Searches a tree of triangles along every ray, as where the caches hold little of it or much, and with or without packets.
pub(crate) fn search_triangles<G: Goal>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[Ray],
    ends: impl Ends<G::Answer>,
    is_far: bool,
    has_packets: bool,
) {
    if is_far {
        level.run(AllAtOnce::<G, _, MANY, true> { accel, start, rays, ends, has_packets, goal: PhantomData });
    } else {
        level.run(AllAtOnce::<G, _, FEW, false> { accel, start, rays, ends, has_packets, goal: PhantomData });
    }
}

/// Tries to have rays go together.
struct Trials<'a, const MIXED: bool> {
    packet: Packet<'a, MIXED>,
    // After a packet that did not pay, others go alone before the next is tried: ever more while none does, and at once many where
    // none has.
    without: usize,
    patience: usize,
}

impl<'a, const MIXED: bool> Trials<'a, MIXED> {
    #[inline(always)]
    fn new(accel: &'a Accel, start: &'a SingleStart) -> Self {
        Self { packet: Packet::new(accel, start), without: 0, patience: LEAST_OFTEN }
    }

    /// A bit for each of up to sixteen rays, the first of which has this position, that was answered.
    #[inline(always)]
    fn search<G: Goal, L: Lanes, O: Others<'a, G>>(
        &mut self,
        rays: &[Ray],
        first: usize,
        others: &mut O,
        ends: &mut impl Ends<O::Found>,
    ) -> u32 {
        if self.without > 0 {
            self.without -= 1;
            return 0;
        }
        let Ok(rays) = <&[Ray; PACKET]>::try_from(rays) else { return 0 };
        let whole = self.packet.whole::<G>();
        let mut ends = self::ends(
            #[inline(always)]
            |place, outcome| ends.put(first + place, outcome),
        );
        let Together { answered, pays, .. } = self.packet.search::<G, L, O>(rays, whole, others, &mut ends);
        (self.without, self.patience) =
            if pays { (0, 0) } else { (self.patience, (2 * self.patience).clamp(1, LEAST_OFTEN)) };
        answered
    }
}

/// Rays through a tree where shapes take most of the time: those that are alike together, and the others one after another.
struct OneByOne<'a, 'r, G, O, E> {
    accel: &'a Accel,
    start: &'a SingleStart,
    rays: &'r [Ray],
    others: O,
    ends: E,
    goal: PhantomData<G>,
}

impl<'a, G: Goal, O: Others<'a, G>, E: Ends<O::Found>> Task for OneByOne<'a, '_, G, O, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { accel, start, rays, mut others, mut ends, .. } = self;
        let mut trials = Trials::<true>::new(accel, start);
        let mut coming = rays.chunks(PACKET);
        coming.by_ref().take(AHEAD).for_each(fetch_rays::<G>);
        for (number, rays) in rays.chunks(PACKET).enumerate() {
            let first = number * PACKET;
            coming.next().map(fetch_rays::<G>);
            let answered = trials.search::<G, L, O>(rays, first, &mut others, &mut ends);
            for (place, ray) in rays.iter().enumerate() {
                if answered >> place & 1 == 0 {
                    ends.put(first + place, others.search_alone::<L>(ray));
                }
            }
        }
    }
}

/// Rays through a tree of triangles: those that are alike together, and `N` of the others in flight. Where the tree `IS_FAR`, what
/// a ray will read next is asked for before it is its turn.
struct AllAtOnce<'a, 'r, G, E, const N: usize, const IS_FAR: bool> {
    accel: &'a Accel,
    start: &'a SingleStart,
    rays: &'r [Ray],
    ends: E,
    has_packets: bool,
    goal: PhantomData<G>,
}

impl<G: Goal, E: Ends<G::Answer>, const N: usize, const IS_FAR: bool> Task
    for AllAtOnce<'_, '_, G, E, N, IS_FAR>
{
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { accel, start, rays, mut ends, has_packets, .. } = self;
        let mut flights: Vec<Flight<G, L>> = Vec::with_capacity(N);
        let mut others = Vec::with_capacity(rays.len().min(AT_ONCE));
        let mut trials = Trials::<false>::new(accel, start);
        let nothing = &mut NoOthers::<false> { accel, start };
        for (number, rays) in rays.chunks(AT_ONCE).enumerate() {
            let mut coming = rays.chunks(PACKET);
            coming.by_ref().take(AHEAD).for_each(fetch_rays::<G>);
            for (place, chunk) in rays.chunks(PACKET).enumerate() {
                let first = number * AT_ONCE + place * PACKET;
                coming.next().map(fetch_rays::<G>);
                let answered =
                    if has_packets { trials.search::<G, L, _>(chunk, first, nothing, &mut ends) } else { 0 };
                if answered != packet::ALL {
                    let is_left = |(position, _): &(usize, &Ray)| answered >> (position - first) & 1 == 0;
                    others.extend((first..).zip(chunk).filter(is_left));
                }
            }
            let mut waiting = others.iter().copied();
            while flights.len() < N
                && let Some(next) = Start::next::<G>(accel, start, &mut waiting, &mut ends)
            {
                flights.push(Flight::new(next, start.root));
            }
            if !is_node(start.root) {
                // A single leaf.
                for flight in &mut flights {
                    while {
                        let last = flight.meet_leaf();
                        flight.end(accel, start, last, &mut waiting, &mut ends)
                    } {}
                }
            } else if IS_FAR {
                fly_far::<G, L, N>(accel, start, &mut flights, &mut waiting, &mut ends);
            } else {
                fly_near::<G, L, N>(accel, start, &mut flights, &mut waiting, &mut ends);
            }
            others.clear();
            flights.clear();
        }
    }
}

/// A ray under way.
struct Flight<'a, 'r, G: Goal, L> {
    position: usize,
    ray: &'r Ray,
    reference: u32,
    way: Way<'a, L>,
    single: SingleRay<'a, false>,
    stack: Stack<<G::Order as Order>::Entry>,
}

/// A ray that sets out.
struct Start<'a, 'r, L> {
    position: usize,
    ray: &'r Ray,
    way: Way<'a, L>,
    single: SingleRay<'a, false>,
}

impl<'a, 'r, L: Lanes> Start<'a, 'r, L> {
    /// That of the next ray, if there is one. What does not come from nearby, or is not sound, is passed over.
    #[inline(always)]
    fn next<G: Goal>(
        accel: &'a Accel,
        start: &'a SingleStart,
        waiting: &mut impl Iterator<Item = (usize, &'r Ray)>,
        ends: &mut impl Ends<G::Answer>,
    ) -> Option<Self> {
        for (position, ray) in waiting {
            if let Some(slabs) = L::start_single(start, ray) {
                let way = Way::new(&accel.tree.nodes, slabs);
                let single = SingleRay::new::<L>(accel, start, ray, way.slabs(), All);
                return Some(Self { position, ray, way, single });
            }
            ends.put(position, Outcome::Unsettled);
        }
        None
    }
}

impl<'a, 'r, G: Goal, L: Lanes> Flight<'a, 'r, G, L> {
    fn new(Start { position, ray, way, single }: Start<'a, 'r, L>, root: u32) -> Self {
        Self { position, ray, reference: root, way, single, stack: Stack::new() }
    }

    /// Puts what came of it, and sets out with the next ray in its place; whether there is one.
    #[inline(always)]
    fn end(
        &mut self,
        accel: &'a Accel,
        start: &'a SingleStart,
        last: Step,
        waiting: &mut impl Iterator<Item = (usize, &'r Ray)>,
        ends: &mut impl Ends<G::Answer>,
    ) -> bool {
        ends.put(self.position, G::answer::<L, _, false>(&self.single, self.ray, last));
        let Some(next) = Start::next::<G>(accel, start, waiting, ends) else { return false };
        let Start { position, ray, way, single } = next;
        (self.position, self.ray, self.reference) = (position, ray, start.root);
        (self.way, self.single) = (way, single);
        self.stack.clear();
        true
    }

    /// Tests the leaf that it is at, and goes on to what stands on the stack.
    #[inline(always)]
    fn meet_leaf(&mut self) -> Step {
        match self.single.meet_leaf::<G, L>(self.reference, self.ray, &mut self.way) {
            Some(last) => last,
            None => self.way.pop::<G::Order>(&mut self.stack).map_or(Step::Out, Step::On),
        }
    }

    /// Follows a step, or sets out with the next ray where that was the last, and asks for what it reads then; whether there is
    /// anything.
    #[inline(always)]
    fn follow(
        &mut self,
        accel: &'a Accel,
        start: &'a SingleStart,
        step: Step,
        waiting: &mut impl Iterator<Item = (usize, &'r Ray)>,
        ends: &mut impl Ends<G::Answer>,
    ) -> bool {
        if let Step::On(next) = step {
            self.reference = next;
            self.fetch(accel);
            true
        } else {
            self.end(accel, start, step, waiting, ends)
        }
    }

    /// Asks for what is read next, before it is needed.
    #[inline(always)]
    fn fetch(&self, accel: &Accel) {
        if is_node(self.reference) {
            accel.tree.nodes.get(self.reference as usize).map(lanes::fetch);
        } else {
            accel.tree.blocks().at(self.reference & tag::PLACE).map(TriangleBlock::fetch);
        }
    }
}

#[inline(always)]
fn is_node(reference: u32) -> bool {
    reference >> tag::SHIFT == tag::INNER
}

/// Whose turn comes next. The places of a turn are read one by one, as they were written: a wide read would wait for them.
struct Queue<const N: usize> {
    // Those whose turn it is, and those who come after, by turns.
    flights: [[u8; N]; 2],
    next: usize,
    len: usize,
}

impl<const N: usize> Queue<N> {
    const EMPTY: Self = Self { flights: [[0; N]; 2], next: 0, len: 0 };

    #[inline(always)]
    fn put(&mut self, flight: usize) {
        self.flights[self.next][self.len % N] = flight as u8;
        self.len += 1;
    }

    /// Begins a turn of all that were put: how many they are.
    #[inline(always)]
    fn begin(&mut self) -> usize {
        self.next ^= 1;
        std::mem::take(&mut self.len)
    }

    /// One of those whose turn it is.
    #[inline(always)]
    fn at(&self, place: usize) -> usize {
        self.flights[self.next ^ 1][place % N] as usize
    }
}

/// Flies through a tree of which the caches hold little until no ray is left: at nodes together, and then at leaves, each of which
/// was asked for a turn before.
#[inline(always)]
fn fly_far<'a, 'r, G: Goal, L: Lanes, const N: usize>(
    accel: &'a Accel,
    start: &'a SingleStart,
    flights: &mut [Flight<'a, 'r, G, L>],
    waiting: &mut impl Iterator<Item = (usize, &'r Ray)>,
    ends: &mut impl Ends<G::Answer>,
) {
    let Some(first) = flights.first() else { return };
    let mut met: [Met<L>; N] = [first.way.look_at(start.root); N];
    let (mut at_nodes, mut at_leaves) = (Queue::<N>::EMPTY, Queue::<N>::EMPTY);
    for i in 0..flights.len() {
        at_nodes.put(i);
    }
    while at_nodes.len + at_leaves.len > 0 {
        let count = at_nodes.begin();
        for (place, met) in met[..count].iter_mut().enumerate() {
            let flight = &flights[at_nodes.at(place)];
            *met = flight.way.look_at(flight.reference);
        }
        for (place, met) in met[..count].iter().enumerate() {
            let i = at_nodes.at(place);
            let flight = &mut flights[i];
            let step = flight.way.go_on::<G::Order>(met, &mut flight.stack).map_or(Step::Out, Step::On);
            if flight.follow(accel, start, step, waiting, ends) {
                if is_node(flight.reference) { at_nodes.put(i) } else { at_leaves.put(i) }
            }
        }
        if at_nodes.len > N / 2 {
            continue;
        }
        for place in 0..at_leaves.begin() {
            let i = at_leaves.at(place);
            let flight = &mut flights[i];
            let step = flight.meet_leaf();
            if flight.follow(accel, start, step, waiting, ends) {
                if is_node(flight.reference) { at_nodes.put(i) } else { at_leaves.put(i) }
            }
        }
    }
}

/// Flies through a tree of which the caches hold much until no ray is left: all at nodes together, but for what each finds at leaves
/// between.
#[inline(always)]
fn fly_near<'a, 'r, G: Goal, L: Lanes, const N: usize>(
    accel: &'a Accel,
    start: &'a SingleStart,
    flights: &mut Vec<Flight<'a, 'r, G, L>>,
    waiting: &mut impl Iterator<Item = (usize, &'r Ray)>,
    ends: &mut impl Ends<G::Answer>,
) {
    let Some(first) = flights.first() else { return };
    let mut met: [Met<L>; N] = [first.way.look_at(start.root); N];
    while !flights.is_empty() {
        for (flight, met) in flights.iter().zip(&mut met) {
            *met = flight.way.look_at(flight.reference);
        }
        let mut are_all_on = true;
        for (flight, met) in flights.iter_mut().zip(&met) {
            let mut next = flight.way.go_on::<G::Order>(met, &mut flight.stack);
            let last = loop {
                let Some(reference) = next else { break Step::Out };
                flight.reference = reference;
                if is_node(reference) {
                    break Step::On(reference);
                }
                match flight.single.meet_leaf::<G, L>(reference, flight.ray, &mut flight.way) {
                    Some(last) => break last,
                    None => next = flight.way.pop::<G::Order>(&mut flight.stack),
                }
            };
            if !matches!(last, Step::On(_)) && !flight.end(accel, start, last, waiting, ends) {
                flight.reference = NOWHERE;
                are_all_on = false;
            }
        }
        if !are_all_on {
            flights.retain(|flight| flight.reference != NOWHERE);
        }
    }
}

/// No reference.
const NOWHERE: u32 = u32::MAX;
