//! Many rays at once.
//!
//! Those that are alike go together: see [`packet`]. The others are in flight (see [`fleet`]), where they are many: an answer has the
//! bits that it has alone.

mod double;
mod one_by_one;
mod spheres;

use std::marker::PhantomData;
use std::slice::Chunks;

use lumbre_geometry::Ray;

use self::double::InDouble;
use self::one_by_one::OneByOne;
use self::spheres::AmongSpheres;
use crate::Accel;
use crate::blocks::Line;
use crate::fleet::{Doubled, Shapes, Triangles};
use crate::holds::{Contents, SingleStart};
use crate::lanes::{self, Lanes, Level, Task};
use crate::node::Node;
use crate::packet::{self, Companion, Others, PACKET, Packet, Together};
use crate::single::{Exact, Goal, Outcome};
use crate::spheres::SphereBlock;

/// Bytes of nodes and triangles from which on the caches hold little of them.
const FAR: usize = 1 << 24;
/// Below this, the nearest caches hold them.
const NEAR: usize = 1 << 20;

/// How the rays of a batch go that do not go together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flying {
    /// From so many on, they are in flight; fewer go one after another.
    least: usize,
    /// Whether what a ray will read next is asked for before it is its turn.
    asks_ahead: bool,
}

impl Flying {
    /// From so many on, rays are faster in flight, among what the nearest caches hold and else: to set out, and to wait for the last,
    /// takes its time.
    pub(crate) const NEAR: Self = Self { least: 128, asks_ahead: false };
    pub(crate) const MIDDLE: Self = Self { least: 32, asks_ahead: false };
    pub(crate) const FAR: Self = Self { least: 32, asks_ahead: true };
    /// One after another, however many.
    const NEVER: Self = Self { least: usize::MAX, asks_ahead: false };

    /// As is fastest in a tree.
    #[inline(always)]
    fn through<L: Lanes>(accel: &Accel) -> Self {
        let bytes = bytes_of(accel);
        if bytes >= FAR {
            Self::FAR
        } else if !L::FLIES {
            Self::NEVER
        } else if bytes >= NEAR {
            Self::MIDDLE
        } else {
            Self::NEAR
        }
    }
}

/// Packets in a row that may go alone without a try.
const LEAST_OFTEN: usize = 16;
/// Rays among which those that are alike are sought before the others set out.
const AT_ONCE: usize = 4096;

/// How many packets ahead rays are asked for.
const AHEAD: usize = 3;

/// Asks for the rays of packets, before they are read: by packets, they are read faster than caches foresee. Where any hit will do in
/// double precision, nothing else keeps the memory busy, and they do.
struct Coming<'r, R> {
    packets: Chunks<'r, R>,
}

impl<'r, R> Coming<'r, R> {
    /// Asks for the first of these, if `asks`; never for any, else.
    #[inline(always)]
    fn new(rays: &'r [R], asks: bool) -> Self {
        let mut coming = Self { packets: if asks { rays } else { &[] }.chunks(PACKET) };
        for _ in 0..AHEAD {
            coming.fetch_next();
        }
        coming
    }

    #[inline(always)]
    fn fetch_next(&mut self) {
        if let Some(rays) = self.packets.next().and_then(<[R]>::first_chunk::<PACKET>) {
            lanes::fetch(rays);
        }
    }
}

/// Takes what came of every ray, in any order.
pub(crate) trait Ends<A> {
    /// To be `#[inline(always)]`: an answer that goes through memory is waited for.
    fn put(&mut self, position: usize, outcome: Outcome<A>);

    /// The same of as many as go together, the first of which has this position; the answer to each by its place among them.
    #[inline(always)]
    fn put_row(&mut self, first: usize, answer: impl Fn(usize) -> A) {
        for i in 0..PACKET {
            self.put(first + i, Outcome::Settled(answer(i)));
        }
    }

    /// Asks for where that will be put.
    #[inline(always)]
    fn fetch(&self, _position: usize) {}
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
    search_as_said::<G>(level, accel, start, rays, ends, None, true);
}

/// Bytes of nodes, triangles and spheres of clouds.
fn bytes_of(accel: &Accel) -> usize {
    let tree = &accel.tree;
    let blocks = size_of_val::<[Line]>(&tree.blocks) + size_of_val::<[SphereBlock]>(&tree.sphere_blocks);
    size_of_val::<[Node]>(&tree.nodes) + blocks
}

/// Searches along every ray in a tree of anything.
pub(crate) fn search_anything<G: Companion, R: Doubled>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[R],
    ends: impl Ends<G::Found>,
) {
    level.run(OneByOne::<G, R, _> { accel, start, rays, ends, goal: PhantomData });
}

/// The same as [`search_all`] with or without packets, where the others go as is said, if it is.
pub(crate) fn search_as_said<G: Goal>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[Ray],
    ends: impl Ends<G::Answer>,
    flying: Option<Flying>,
    has_packets: bool,
) {
    type AmongTriangles<G> = InDouble<G, Triangles, Ray, false>;
    if start.contents == Contents::Triangles {
        AllAtOnce::<AmongTriangles<G>, _> { accel, start, rays, ends, flying, has_packets }.run_at(level);
    } else {
        search_beside::<G, Ray>(level, accel, start, rays, ends, flying, has_packets);
    }
}

/// The same in a tree that has not triangles alone, where rays in single precision are asked in double, too.
pub(crate) fn search_beside<G: Goal, R: Doubled>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[R],
    ends: impl Ends<G::Answer>,
    flying: Option<Flying>,
    has_packets: bool,
) {
    type AmongShapes<G, R> = InDouble<G, Shapes, R, true>;
    if start.contents == Contents::Spheres {
        let has_packets = false;
        AllAtOnce::<AmongSpheres<G, R>, _> { accel, start, rays, ends, flying, has_packets }.run_at(level);
    } else {
        AllAtOnce::<AmongShapes<G, R>, _> { accel, start, rays, ends, flying, has_packets }.run_at(level);
    }
}

/// In which precision rays are asked, what, and among what.
pub(crate) trait Manner {
    /// As it is asked.
    type Ray;
    /// What is asked of it.
    type Answer;
    /// Those that go together.
    type Packet<'a>;
    /// Whether their rays are asked for ahead.
    const ASKS_AHEAD: bool;
    /// Whether there may be shapes or custom geometry.
    const MIXED: bool;

    /// Rays that will go together.
    fn packet<'a>(accel: &'a Accel, start: &'a SingleStart) -> Self::Packet<'a>;

    /// Searches along rays together, the first of which has this position.
    fn search_together<'a, L: Lanes>(
        packet: &mut Self::Packet<'a>,
        exact: &Exact<'a>,
        rays: &[Self::Ray; PACKET],
        first: usize,
        ends: &mut impl Ends<Self::Answer>,
    ) -> Together;

    /// Searches along a ray alone.
    fn search_alone<L: Lanes>(exact: &Exact, ray: &Self::Ray) -> Outcome<Self::Answer>;

    /// Searches along those of the rays that have these positions, in flight.
    fn fly<L: Lanes>(
        exact: &Exact,
        asks_ahead: bool,
        rays: &[Self::Ray],
        positions: &[usize],
        ends: &mut impl Ends<Self::Answer>,
    );
}

/// Searches along rays together, the first of which has this position.
#[inline(always)]
fn search_packet<'a, G: Goal, L: Lanes, O: Others<'a, G>, const MIXED: bool>(
    packet: &mut Packet<'a, MIXED>,
    rays: &[Ray; PACKET],
    first: usize,
    others: &mut O,
    ends: &mut impl Ends<O::Found>,
) -> Together {
    let whole = packet.whole();
    let mut ends = self::ends(
        #[inline(always)]
        |place, outcome| ends.put(first + place, outcome),
    );
    packet.search::<G, L, O>(rays, whole, others, &mut ends)
}

/// When to try to have rays go together. After a packet that did not pay, others go alone before the next is tried: ever more while
/// none does, and at once many where none has.
struct Trials {
    without: usize,
    patience: usize,
}

impl Trials {
    const NEW: Self = Self { without: 0, patience: LEAST_OFTEN };

    /// Whether the next is to be tried.
    #[inline(always)]
    fn is_next(&mut self) -> bool {
        let is_next = self.without == 0;
        self.without = self.without.saturating_sub(1);
        is_next
    }

    /// What came of it.
    #[inline(always)]
    fn heed(&mut self, pays: bool) {
        (self.without, self.patience) =
            if pays { (0, 0) } else { (self.patience, (2 * self.patience).clamp(1, LEAST_OFTEN)) };
    }
}

/// Rays through a tree of triangles and shapes: those that are alike together, and the others in flight, or one after another.
pub(crate) struct AllAtOnce<'a, 'r, M: Manner, E> {
    pub(crate) accel: &'a Accel,
    pub(crate) start: &'a SingleStart,
    pub(crate) rays: &'r [M::Ray],
    pub(crate) ends: E,
    /// Where it is said how the others go.
    pub(crate) flying: Option<Flying>,
    pub(crate) has_packets: bool,
}

impl<M: Manner, E: Ends<M::Answer>> AllAtOnce<'_, '_, M, E> {
    /// Does it with these lanes, compiled beside what takes the answers: all together would be half of the kernel.
    pub(crate) fn run_at(self, level: Level) {
        level.run_beside::<E, _>(self);
    }
}

impl<M: Manner, E: Ends<M::Answer>> Task for AllAtOnce<'_, '_, M, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { accel, start, rays, mut ends, flying, has_packets } = self;
        let flying = flying.unwrap_or_else(
            #[inline(always)]
            || Flying::through::<L>(accel),
        );
        let exact = Exact::new(accel, start);
        let mut packet = M::packet(accel, start);
        let mut trials = Trials::NEW;
        let mut others = Vec::with_capacity(rays.len().min(AT_ONCE));
        for (number, chunk) in rays.chunks(AT_ONCE).enumerate() {
            let first = number * AT_ONCE;
            let (packets, _) = chunk.as_chunks::<PACKET>();
            let mut coming = Coming::new(chunk, M::ASKS_AHEAD);
            for (i, rays) in packets.iter().enumerate() {
                coming.fetch_next();
                let first = first + PACKET * i;
                let mut answered = 0;
                if has_packets && trials.is_next() {
                    let together = M::search_together::<L>(&mut packet, &exact, rays, first, &mut ends);
                    trials.heed(together.pays);
                    answered = together.answered;
                }
                if answered == 0 {
                    others.extend(first..first + PACKET);
                } else if answered != packet::ALL {
                    others.extend(
                        (0..PACKET).filter(|place| answered >> place & 1 == 0).map(|place| first + place),
                    );
                }
            }
            others.extend(first + PACKET * packets.len()..first + chunk.len());
            if others.len() < flying.least || M::MIXED && !L::FLIES {
                // Here, and not by a call: a hit that was put together elsewhere would be waited for. Nor in a closure, which does not
                // take on the instruction set.
                for &i in &others {
                    ends.put(i, M::search_alone::<L>(&exact, lanes::opaque(&rays[i])));
                }
            } else {
                M::fly::<L>(&exact, flying.asks_ahead, rays, &others, &mut ends);
            }
            others.clear();
        }
    }
}
