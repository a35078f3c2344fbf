//! Many rays at once.
//!
//! Those that are alike go together: see [`packet`]. In large trees, some are in flight on one thread, so that one's arithmetic
//! fills the waits of another. Each ray takes the very steps that it takes alone, a node or a leaf at a time, in turn with the
//! others: its answer has the same bits. A step ends with a fetch of what the next one of that ray will read.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use crate::Accel;
use crate::holds::SingleStart;
use crate::lanes::{Lanes, Level, Task};
use crate::node::Node;
use crate::packet::{self, PACKET};
use crate::single::{Alone, Goal, Outcome, SingleRay, Step};
use crate::stack::{Order, Stack};
use crate::triangles::TriangleBlock;

/// Rays in flight on a thread.
const IN_FLIGHT: usize = 6;
/// Bytes of nodes and triangles from which on waiting for memory outweighs what it costs to turn from ray to ray.
const WORTH_FLYING: usize = 1 << 24;

/// Packets in a row that may go without a try.
const LEAST_OFTEN: usize = 8;

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

/// Searches along every ray.
pub(crate) fn search_all<G: Goal>(level: Level, accel: &Accel, rays: &[Ray], mut ends: impl Ends<G::Answer>) {
    let tree = &accel.tree;
    let bytes = size_of_val::<[Node]>(&tree.nodes) + size_of_val::<[TriangleBlock]>(&tree.blocks);
    if let Some(start) = &accel.single {
        if start.is_mixed {
            level.run(OneByOne::<G, _, true> { accel, start, rays, ends, goal: PhantomData });
        } else if bytes < WORTH_FLYING {
            level.run(OneByOne::<G, _, false> { accel, start, rays, ends, goal: PhantomData });
        } else {
            fly::<G>(level, accel, start, rays, ends);
        }
    } else {
        (0..rays.len()).for_each(|position| ends.put(position, Outcome::Unsettled));
    }
}

/// Searches a tree of triangles along every ray, some at a time.
pub(crate) fn fly<G: Goal>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[Ray],
    ends: impl Ends<G::Answer>,
) {
    level.run(Flights::<G, _> { accel, start, rays, ends, goal: PhantomData });
}

/// Rays through a tree of which the caches hold much, or where shapes take most of the time: in the former, those that are alike
/// go together, and all others one after another.
struct OneByOne<'a, 'r, G, E, const MIXED: bool> {
    accel: &'a Accel,
    start: &'a SingleStart,
    rays: &'r [Ray],
    ends: E,
    goal: PhantomData<G>,
}

impl<G: Goal, E: Ends<G::Answer>, const MIXED: bool> Task for OneByOne<'_, '_, G, E, MIXED> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { accel, start, rays, mut ends, .. } = self;
        // After a packet that did not pay, some rays go alone before the next is tried, and ever more while none does.
        let (mut alone, mut patience) = (0, 1);
        for (number, chunk) in rays.chunks(PACKET).enumerate() {
            let first = number * PACKET;
            if alone > 0 {
                alone -= 1;
            } else if !MIXED && let Ok(packet) = <&[Ray; PACKET]>::try_from(chunk) {
                if packet::search::<G, L>(accel, start, packet, first, &mut ends) {
                    patience = 1;
                    continue;
                }
                (alone, patience) = (patience, (2 * patience).min(LEAST_OFTEN));
            }
            for (i, ray) in chunk.iter().enumerate() {
                ends.put(first + i, Alone::<G, MIXED>::new(accel, start, ray).run::<L>());
            }
        }
    }
}

/// A ray under way.
struct Flight<'a, 'r, G: Goal, L> {
    position: usize,
    ray: &'r Ray,
    reference: u32,
    single: SingleRay<'a, L>,
    stack: Stack<<G::Order as Order>::Entry>,
}

/// All the rays.
struct Flights<'a, 'r, G, E> {
    accel: &'a Accel,
    start: &'a SingleStart,
    rays: &'r [Ray],
    ends: E,
    goal: PhantomData<G>,
}

impl<G: Goal, E: Ends<G::Answer>> Task for Flights<'_, '_, G, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { accel, start, rays, mut ends, .. } = self;
        let mut waiting = rays.iter().enumerate();
        let mut flights: Vec<Flight<G, L>> = Vec::with_capacity(IN_FLIGHT);
        while flights.len() < IN_FLIGHT
            && let Some((position, ray)) = waiting.next()
        {
            match SingleRay::start(accel, start, ray) {
                Some(single) => {
                    flights.push(Flight {
                        position,
                        ray,
                        reference: start.root,
                        single,
                        stack: Stack::new(),
                    });
                }
                None => ends.put(position, Outcome::Unsettled),
            }
        }
        // Those that are under way stand first.
        let mut count = flights.len();
        while count > 0 {
            let mut turn = 0;
            while turn < count {
                let Flight { position, ray, reference, single, stack } = &mut flights[turn];
                let step = single.step::<G, false>(*reference, ray, stack);
                if let Step::On(next) = step {
                    *reference = next;
                    single.fetch(next);
                    turn += 1;
                    continue;
                }
                ends.put(*position, G::answer(single, ray, step));
                // The next takes its place, where it stands.
                let started = loop {
                    let Some((next, ray)) = waiting.next() else { break None };
                    match SingleRay::start(accel, start, ray) {
                        Some(single) => break Some((next, ray, single)),
                        None => ends.put(next, Outcome::Unsettled),
                    }
                };
                if let Some((next, next_ray, next_single)) = started {
                    (*position, *ray, *reference, *single) = (next, next_ray, start.root, next_single);
                    stack.clear();
                } else {
                    count -= 1;
                    flights.swap(turn, count);
                }
            }
        }
    }
}
