//! Many rays in flight, so that one's arithmetic fills the waits of others.
//!
//! Rays take their steps together, in short loops without branches, as long as it can be: which rays a loop is for is told by bits that
//! one before it has put together. So little is foreseen wrongly but where loops end, and the processor has the steps of several rays in
//! view at once, where a branch that was foreseen wrongly, or a longer step, would leave it one.
//!
//! Blocks are met by two rays at a time, each at its own: eight triangles or hulls of the one and eight of the other stand side by side where
//! vectors hold sixteen numbers.

mod double;

use bytemuck::Zeroable;

use crate::batch::Ends;
use crate::blocks::{Blocks, TriangleBlock};
use crate::collapse;
use crate::holds::SingleStart;
use crate::hulls::HullBlock;
use crate::lanes::{self, Glanced, Lanes, MetHulls, Slots, Vector, WIDE, Wide};
use crate::node::{Node, Slabs, WIDTH, tag};
use crate::single::{Exact, Outcome, Step, nearest_of};
use crate::stack::{Order, STACK};
use crate::triangles::BLOCK;

pub(crate) use double::{Beside, DoubleFlyer, Doubled, Shapes, Triangles};

/// A ray that flies: among triangles in either precision, and in double precision among what stands beside them.
pub(crate) trait Flyer<L: Lanes>: Sized {
    /// As it is asked.
    type Ray;
    /// What is asked of it.
    type Answer;
    /// Which boxes come first.
    type Order: Order;
    /// Whether any hit will do.
    const IS_ANY: bool;
    /// Whether it flies among anything but triangles.
    const IS_MIXED: bool;
    /// Whether four better set out together than one after the other; not where it is mixed.
    const STARTS_BY_FOUR: bool = false;
    /// What leaves are of; below, the triangles of a block may be spheres.
    type Block: 'static;
    /// All of them.
    type Blocks<'a>: LeafBlocks<'a, Block = Self::Block>;
    /// Whether the references to such leaves have a sign, as those have that come to their end.
    const LEAVES_HAVE_SIGNS: bool = false;
    /// How its line passes the triangles of a block.
    type Pass;
    /// How two lines do, each those of its block.
    type Passes: Copy + Zeroable;
    /// Where it meets each triangle.
    type At: Copy + Zeroable;

    /// One that has not set out.
    fn new(start: &SingleStart) -> Self;
    /// The ray for boxes; `None` where it does not come from nearby, or is not sound.
    fn start(start: &SingleStart, ray: &Self::Ray) -> Option<Slabs>;
    /// Sets out as a ray, in the place of another.
    fn set_out(&mut self, exact: &Exact, ray: &Self::Ray, slabs: &Slabs);
    /// Four set out, as far as [`start`](Self::start) does; a bit for each that does.
    #[inline(always)]
    fn set_out_by_four(exact: &Exact, rays: [&Self::Ray; 4], flights: [(&mut Self, &mut Slabs); 4]) -> u32 {
        let mut started = 0;
        for (i, (ray, (flyer, slabs))) in rays.into_iter().zip(flights).enumerate() {
            if let Some(own) = Self::start(exact.start, ray) {
                flyer.set_out(exact, ray, &own);
                *slabs = own;
                started |= 1 << i;
            }
        }
        started
    }
    /// How the lines of two pass the triangles of two blocks, each those of its own.
    fn pass_by_two(exact: &Exact, flyers: [&Self; 2], blocks: [&Self::Block; 2]) -> (Passing, Self::Passes);
    /// That of one of the two: `which` is 0 or 1.
    fn one_of(passes: &Self::Passes, which: usize) -> Self::Pass;
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
        pass: &Self::Pass,
        slabs: &mut Slabs,
    ) -> bool;
    /// What two may meet of two blocks of hulls, each of its own, tubes left aside. Where there are no shapes, it is nothing, here and
    /// below.
    #[inline(always)]
    fn glance_by_two(_flyers: [&Self; 2], _blocks: [&HullBlock; 2]) -> Glanced {
        Glanced::NOTHING
    }

    /// The same with a look at tubes.
    #[inline(always)]
    fn meet_hulls(&self, _block: &HullBlock) -> MetHulls {
        MetHulls::NONE
    }

    /// The height at which it ends among shapes.
    #[inline(always)]
    fn last(&self) -> f32 {
        f32::INFINITY
    }

    /// Tests a shape, or a primitive of custom geometry; how the search ends, if it does.
    #[inline(always)]
    fn meet_entry(
        &mut self,
        _exact: &Exact,
        _ray: &Self::Ray,
        _entry: &collapse::Entry,
        _slabs: &mut Slabs,
    ) -> Option<Step> {
        None
    }

    /// What came of it: whether any hit `is_met`, or what it has taken.
    fn answer(&self, exact: &Exact, ray: &Self::Ray, is_met: bool) -> Outcome<Self::Answer>;
}

/// The blocks of a tree that leaves of one kind are of, by what refers to such a leaf, or to what is left of it.
pub(crate) trait LeafBlocks<'a>: Copy {
    type Block: 'a;
    /// Those of a tree.
    fn of(exact: &Exact<'a>) -> Self;
    /// The place of the first.
    fn place(leaf: u32) -> u32;
    /// The first.
    fn block(self, leaf: u32) -> &'a Self::Block;
    /// Whether it is the last.
    fn is_last(leaf: u32, block: &Self::Block) -> bool;
    /// What is left behind the first, which is not the last.
    fn next(self, leaf: u32) -> u32;
    /// Asks for the first to be brought near.
    fn fetch(self, leaf: u32);
}

impl<'a> LeafBlocks<'a> for Blocks<'a> {
    type Block = TriangleBlock;

    #[inline(always)]
    fn of(exact: &Exact<'a>) -> Self {
        exact.blocks()
    }

    #[inline(always)]
    fn place(leaf: u32) -> u32 {
        leaf & tag::PLACE
    }

    #[inline(always)]
    fn block(self, leaf: u32) -> &'a TriangleBlock {
        self.block(Self::place(leaf))
    }

    #[inline(always)]
    fn is_last(_: u32, block: &TriangleBlock) -> bool {
        block.is_last()
    }

    #[inline(always)]
    fn next(self, leaf: u32) -> u32 {
        let place = Self::place(leaf);
        tag::reference(tag::TRIANGLES, self.block(place).place_behind(place))
    }

    #[inline(always)]
    fn fetch(self, leaf: u32) {
        self.block(Self::place(leaf)).fetch();
    }
}

/// The triangles of two blocks that two lines pass: eight bits for those of the first, and eight for those of the second.
pub(crate) struct Passing {
    /// Those that the rays may meet.
    pub(crate) mask: u32,
    /// Those that have to be looked at closer.
    pub(crate) unclear: u32,
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
const FLIGHTS: usize = 64;
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

/// A ray under way: what boxes are asked with is a cache line, and what triangles are, the next.
#[repr(C, align(64))]
struct Flight<F> {
    slabs: Slabs,
    position: usize,
    flyer: F,
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

impl Bits {
    /// The first four, if there are as many, and the others.
    #[inline(always)]
    fn first_four(mut self) -> Option<([usize; 4], Self)> {
        Some(([self.next()?, self.next()?, self.next()?, self.next()?], self))
    }

    /// Two at a time; the last of an odd number comes with itself.
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

/// A bit in this place if that is so.
#[inline(always)]
fn bit(is: bool, place: usize) -> u64 {
    u64::from(is) << place
}

/// How many of these places are before one: where what is written of one after another stands.
#[inline(always)]
fn rank(places: u64, place: usize) -> usize {
    (places & !(u64::MAX << place)).count_ones() as usize % FLIGHTS
}

/// Where each flight is.
#[repr(align(64))]
struct References([u32; FLIGHTS]);

/// A bit for each flight that is at a node, at a leaf of triangles or of anything else, and at its end.
#[derive(Clone, Copy)]
struct Stations {
    nodes: u64,
    leaves: u64,
    others: u64,
    ends: u64,
}

impl References {
    #[inline(always)]
    fn of(&mut self, flight: usize) -> &mut u32 {
        &mut self.0[flight % FLIGHTS]
    }

    /// Of a fleet of such.
    #[inline(always)]
    fn stations<F: Flyer<L>, L: Lanes>(&self) -> Stations {
        /// The last reference of each kind, in the order of integers with signs.
        const LAST_NODE: i32 = tag::PLACE as i32;
        const LAST_TRIANGLES: i32 = tag::reference(tag::TRIANGLES, tag::PLACE) as i32;
        const LAST_BEFORE_END: i32 = END as i32 - 1;
        let (rows, _) = self.0.as_chunks::<WIDE>();
        // Those that are no node; neither that nor triangles; and what has a sign: other leaves, and ends, which come behind them.
        let (mut leaves, mut others, mut signs, mut ends) = (0, 0, 0, 0);
        for (i, row) in rows.iter().enumerate() {
            let row = L::Wide::load(bytemuck::cast_ref(row));
            let above = |last: i32| u64::from(row.bits_above(last)) << (WIDE * i);
            signs |= !above(-1) & 0xffff << (WIDE * i);
            leaves |= above(LAST_NODE);
            if F::IS_MIXED {
                others |= above(LAST_TRIANGLES);
            }
            if F::IS_MIXED || F::LEAVES_HAVE_SIGNS {
                ends |= above(LAST_BEFORE_END);
            }
        }
        if F::LEAVES_HAVE_SIGNS {
            ends &= signs;
            return Stations { nodes: !signs, leaves: signs & !ends, others: 0, ends };
        }
        if !F::IS_MIXED {
            return Stations { nodes: !(leaves | signs), leaves, others: 0, ends: signs };
        }
        ends &= signs;
        Stations { nodes: !(leaves | signs), leaves: leaves & !others, others: others | signs & !ends, ends }
    }
}

/// A bit for each flight that any hit will do for and has one, and for each that the plain search has to answer.
struct Ended {
    met: u64,
    unsettled: u64,
}

impl Ended {
    /// How a flight ends, if it does.
    #[inline(always)]
    fn heed(&mut self, place: usize, step: Option<Step>) -> bool {
        match step {
            None => return false,
            Some(Step::Unsettled) => self.unsettled |= bit(true, place),
            Some(Step::Met | Step::Out) => self.met |= bit(true, place),
        }
        true
    }
}

/// All that are under way, and what one loop hands on to another.
struct Fleet<'a, 'r, F: Flyer<L>, L: Lanes> {
    exact: Exact<'a>,
    nodes: &'a [Node],
    blocks: F::Blocks<'a>,
    rays: &'r [F::Ray],
    flights: Box<[Flight<F>; FLIGHTS]>,
    stacks: Box<[Slots<Entry<F, L>>; FLIGHTS]>,
    references: References,
    /// The nodes that they come from.
    parents: References,
    /// Which children of its node, or triangles of its block, each may meet.
    masks: [u32; FLIGHTS],
    /// Where each enters the boxes of children.
    enters: [L::Wide; FLIGHTS],
    passes: [F::Passes; FLIGHTS / 2],
    crossings: [Crossing<F::At>; FLIGHTS],
    /// Which triangles have to be looked at closer.
    unclear: [u32; FLIGHTS],
    /// No shape of the blocks of hulls that two are at is met at a lesser height.
    nears: [[[f32; BLOCK]; 2]; FLIGHTS / 2],
}

impl<'a, 'r, F: Flyer<L>, L: Lanes> Fleet<'a, 'r, F, L> {
    #[inline(always)]
    fn new(exact: &Exact<'a>, rays: &'r [F::Ray]) -> Self {
        Self {
            exact: *exact,
            nodes: exact.nodes(),
            blocks: F::Blocks::of(exact),
            rays,
            flights: Box::new(std::array::from_fn(
                #[inline(always)]
                |_| Flight { flyer: F::new(exact.start), slabs: Slabs::ZERO, position: NOWHERE },
            )),
            stacks: Slots::many(),
            references: References([END; FLIGHTS]),
            parents: References([END; FLIGHTS]),
            masks: [0; FLIGHTS],
            enters: [L::Wide::splat(0.0); FLIGHTS],
            passes: [F::Passes::zeroed(); FLIGHTS / 2],
            crossings: [Crossing::zeroed(); FLIGHTS],
            unclear: [0; FLIGHTS],
            nears: [[[0.0; BLOCK]; 2]; FLIGHTS / 2],
        }
    }

    /// What is at the bottom of every stack.
    #[inline(always)]
    fn bottom() -> Entry<F, L> {
        F::Order::entry(END)
    }

    /// A ray sets out at the root, in the place of one of which nothing is left; false where it does not come from nearby, or is not sound.
    #[inline(always)]
    fn set_out(&mut self, place: usize, position: usize) -> bool {
        let (start, ray) = (self.exact.start, lanes::opaque(&self.rays[position]));
        let Some(slabs) = F::start(start, ray) else { return false };
        let flight = &mut self.flights[place];
        flight.flyer.set_out(&self.exact, ray, &slabs);
        (flight.slabs, flight.position) = (slabs, position);
        let stack = &mut self.stacks[place];
        stack.clear();
        stack.push(Self::bottom());
        *self.references.of(place) = start.root;
        if F::IS_MIXED { self.meet_infinite(place) } else { true }
    }

    /// The same of four, where there is nothing but triangles; a bit for each.
    #[inline(always)]
    fn set_out_by_four(&mut self, places: [usize; 4], positions: [usize; 4]) -> u32 {
        let Self { exact, rays, flights, .. } = self;
        let Ok([a, b, c, d]) = flights.get_disjoint_mut(places) else { return 0 };
        [a.position, b.position, c.position, d.position] = positions;
        let [w, x, y, z] = positions;
        let rays = [&rays[w], &rays[x], &rays[y], &rays[z]];
        let flights = [
            (&mut a.flyer, &mut a.slabs),
            (&mut b.flyer, &mut b.slabs),
            (&mut c.flyer, &mut c.slabs),
            (&mut d.flyer, &mut d.slabs),
        ];
        let started = F::set_out_by_four(exact, rays, flights);
        for (i, place) in places.into_iter().enumerate() {
            let stack = &mut self.stacks[place];
            stack.clear();
            stack.push(Self::bottom());
            *self.references.of(place) = if started >> i & 1 != 0 { exact.start.root } else { END };
        }
        started
    }

    /// One that sets out meets what has no bounds; false where the plain search has to answer.
    #[inline(always)]
    fn meet_infinite(&mut self, place: usize) -> bool {
        let ray = self.ray(place);
        let Flight { flyer, slabs, position } = &mut self.flights[place];
        for entry in &self.exact.accel().infinite {
            match flyer.meet_entry(&self.exact, ray, entry, slabs) {
                None => {}
                Some(Step::Unsettled) => {
                    *position = NOWHERE;
                    *self.references.of(place) = END;
                    return false;
                }
                Some(Step::Met | Step::Out) => {
                    *self.references.of(place) = MET;
                    return true;
                }
            }
        }
        true
    }

    /// The ray of a flight, as it was asked.
    #[inline(always)]
    fn ray(&self, place: usize) -> &'r F::Ray {
        &self.rays[self.flights[place].position]
    }

    /// Those that are at nodes go on to the child that comes first, or to what stands on their stacks.
    #[inline(always)]
    fn meet_nodes(&mut self, at_nodes: u64, ends: &mut impl Ends<F::Answer>) {
        let too_deep = if F::Order::PUTS_ONE { self.put_and_take(at_nodes) } else { self.put_many(at_nodes) };
        self.give_up(too_deep, ends);
    }

    /// Puts what each meets of its node, and takes the last that then stands there. A bit for each that may not have room for the
    /// children of another node.
    #[inline(always)]
    fn put_and_take(&mut self, at_nodes: u64) -> u64 {
        let mut too_deep = 0;
        for place in Bits(at_nodes) {
            let reference = self.references.of(place);
            let node = &self.nodes[*reference as usize];
            let slabs = lanes::opaque(&self.flights[place].slabs);
            let (mask, enter) = lanes::meet_boxes::<L::Wide>(node, slabs);
            let stack = &mut self.stacks[place];
            *reference = F::Order::put_and_take::<L>(node, mask, enter, stack);
            too_deep |= bit(stack.len() > STACK - WIDTH, place);
        }
        too_deep
    }

    /// The same where those that meet one or none are better told apart from those that have something to put, and taken care of first.
    #[inline(always)]
    fn put_many(&mut self, at_nodes: u64) -> u64 {
        let nodes = self.nodes;
        let (mut none, mut many) = (0, 0);
        for (at, place) in Bits(at_nodes).enumerate() {
            let reference = self.references.of(place);
            let node = &nodes[*reference as usize];
            let slabs = lanes::opaque(&self.flights[place].slabs);
            let (mask, enter) = lanes::meet_boxes::<L::Wide>(node, slabs);
            self.masks[place] = mask;
            *self.parents.of(place) = *reference;
            self.enters[at % FLIGHTS] = enter;
            // Of more than one or none, anything.
            *reference = lanes::only_child(node, mask);
            none |= bit(mask == 0, place);
            many |= bit(mask & mask.wrapping_sub(1) != 0, place);
        }
        let mut too_deep = 0;
        for place in Bits(many) {
            let stack = &mut self.stacks[place];
            let node = &nodes[*self.parents.of(place) as usize];
            let (mask, enter) = (self.masks[place], self.enters[rank(at_nodes, place)]);
            *self.references.of(place) = F::Order::put_and_take::<L>(node, mask, enter, stack);
            too_deep |= bit(stack.len() > STACK - WIDTH, place);
        }
        self.pop(none);
        too_deep
    }

    /// Those that are at leaves go on to the next block, or to what stands on their stacks.
    #[inline(always)]
    fn meet_blocks(&mut self, at_leaves: u64, ends: &mut impl Ends<F::Answer>) {
        let (mut passing, mut last) = (0, 0);
        for (at, [first, second]) in Bits(at_leaves).by_two().enumerate() {
            let (leaf, other_leaf) = (self.references.0[first], self.references.0[second]);
            let (one, other) = (self.blocks.block(leaf), self.blocks.block(other_leaf));
            let flyers = [&self.flights[first].flyer, &self.flights[second].flyer];
            let (both, passes) = F::pass_by_two(&self.exact, flyers, [one, other]);
            self.passes[at % (FLIGHTS / 2)] = passes;
            let halves = |mask: u32| (mask & L::Eight::ALL, mask >> BLOCK);
            let of_both = |(of_first, of_second)| bit(of_first != 0, first) | bit(of_second != 0, second);
            (self.masks[first], self.masks[second]) = halves(both.mask);
            (self.unclear[first], self.unclear[second]) = halves(both.unclear);
            passing |= of_both(halves(both.mask | both.unclear));
            let is_last = F::Blocks::is_last;
            last |= bit(is_last(leaf, one), first) | bit(is_last(other_leaf, other), second);
        }
        let (mut meeting, mut unclear) = (0, 0);
        for place in Bits(passing) {
            let rank = rank(at_leaves, place);
            let pass = F::one_of(&self.passes[rank / 2], rank % 2);
            let mut crossing = self.flights[place].flyer.cross(self.masks[place], &pass);
            meeting |= bit(crossing.met != 0, place);
            crossing.unclear |= self.unclear[place];
            unclear |= bit(crossing.unclear != 0, place);
            if F::IS_ANY {
                self.unclear[place] = crossing.unclear;
            } else {
                self.crossings[rank] = crossing;
            }
        }
        let mut unsettled = 0;
        if F::IS_ANY {
            for place in Bits(unclear & !meeting) {
                let unit = F::Blocks::place(*self.references.of(place));
                let (flight, ray) = (&self.flights[place], self.ray(place));
                match flight.flyer.meets_closely(&self.exact, ray, unit, self.unclear[place]) {
                    Outcome::Settled(is_met) => meeting |= bit(is_met, place),
                    Outcome::Unsettled => unsettled |= bit(true, place),
                }
            }
            for place in Bits(meeting) {
                *self.references.of(place) = MET;
            }
        } else {
            for place in Bits(meeting | unclear) {
                let unit = F::Blocks::place(*self.references.of(place));
                let ray = self.ray(place);
                let Flight { flyer, slabs, .. } = &mut self.flights[place];
                let rank = rank(at_leaves, place);
                let pass = F::one_of(&self.passes[rank / 2], rank % 2);
                let crossing = &self.crossings[rank];
                let is_settled = flyer.take_nearest(&self.exact, ray, unit, crossing, &pass, slabs);
                unsettled |= bit(!is_settled, place);
            }
            meeting = 0;
        }
        let going_on = at_leaves & !meeting & !unsettled;
        for place in Bits(going_on & !last) {
            let reference = self.references.of(place);
            *reference = self.blocks.next(*reference);
        }
        self.give_up(unsettled, ends);
        self.pop(going_on & last);
    }

    /// Those that are at leaves of anything but triangles go on to the next block of hulls, or to what stands on their stacks.
    #[inline(always)]
    fn meet_others(&mut self, at_others: u64, ends: &mut impl Ends<F::Answer>) {
        let accel = self.exact.accel();
        let entries = &*accel.tree.entries;
        let (mut with_hulls, mut passing, mut ringing, mut met, mut more) = (0, 0, 0, 0, 0);
        for place in Bits(at_others) {
            let reference = *self.references.of(place);
            let are_shapes = reference >> tag::SHIFT == tag::SHAPES;
            let is_there = accel.hulls.block((reference & tag::PLACE) as usize).is_some();
            with_hulls |= bit(are_shapes && is_there, place);
        }
        for (at, [first, second]) in Bits(with_hulls).by_two().enumerate() {
            let place_of = |flight: usize| (self.references.0[flight] & tag::PLACE) as usize;
            let (Some((one, one_goes_on)), Some((other, other_goes_on))) =
                (accel.hulls.block(place_of(first)), accel.hulls.block(place_of(second)))
            else {
                continue;
            };
            let flyers = [&self.flights[first].flyer, &self.flights[second].flyer];
            let Glanced { mask, sure, rings, near } = F::glance_by_two(flyers, [one, other]);
            self.nears[at % (FLIGHTS / 2)] = near;
            (self.masks[first], self.masks[second]) = (mask & L::Eight::ALL, mask >> BLOCK);
            let of_both = |mask: u32| bit(mask & L::Eight::ALL != 0, first) | bit(mask >> BLOCK != 0, second);
            passing |= of_both(mask);
            ringing |= of_both(rings);
            met |= of_both(sure);
            more |= bit(one_goes_on, first) | bit(other_goes_on, second);
        }
        for place in Bits(ringing & !met) {
            let first = (*self.references.of(place) & tag::PLACE) as usize;
            let Some((block, _)) = accel.hulls.block(first) else { continue };
            let MetHulls { mask, sure, .. } = self.flights[place].flyer.meet_hulls(block);
            self.masks[place] = mask;
            met |= bit(sure != 0, place);
        }
        let mut ended = Ended { met, unsettled: 0 };
        for place in Bits(passing & !met) {
            let first = (*self.references.of(place) & tag::PLACE) as usize;
            let rank = rank(with_hulls, place);
            let (mut mask, near, ray) = (self.masks[place], &self.nears[rank / 2][rank % 2], self.ray(place));
            let Flight { flyer, slabs, .. } = &mut self.flights[place];
            while mask != 0 {
                let lane =
                    if F::IS_ANY { mask.trailing_zeros() as usize % BLOCK } else { nearest_of(mask, near) };
                mask &= !(1 << lane);
                if !F::IS_ANY && near[lane] > flyer.last() {
                    continue;
                }
                let step = flyer.meet_entry(&self.exact, ray, &entries[first + lane], slabs);
                if ended.heed(place, step) {
                    break;
                }
            }
        }
        for place in Bits(at_others & !with_hulls) {
            let first = (*self.references.of(place) & tag::PLACE) as usize;
            let ray = self.ray(place);
            let Flight { flyer, slabs, .. } = &mut self.flights[place];
            for entry in &entries[first..] {
                let step = flyer.meet_entry(&self.exact, ray, entry, slabs);
                if ended.heed(place, step) || entry.is_last() {
                    break;
                }
            }
        }
        let Ended { met, unsettled } = ended;
        for place in Bits(met) {
            *self.references.of(place) = MET;
        }
        let going_on = at_others & !met & !unsettled;
        for place in Bits(going_on & more) {
            *self.references.of(place) += BLOCK as u32;
        }
        self.give_up(unsettled, ends);
        self.pop(going_on & !more);
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
                let entry = self.stacks[place].pop().unwrap_or(Self::bottom());
                *self.references.of(place) = F::Order::reference(entry);
                beyond |= bit(F::Order::is_beyond(entry, self.flights[place].slabs.s_max()), place);
            }
            those = beyond;
        }
    }

    /// Asks for what those of them read next.
    #[inline(always)]
    fn fetch(&mut self, those: u64) {
        let at = self.references.stations::<F, L>();
        for place in Bits(at.nodes & those) {
            self.nodes.get(*self.references.of(place) as usize).map(lanes::fetch::<Node>);
        }
        for place in Bits(at.leaves & those) {
            self.blocks.fetch(*self.references.of(place));
        }
    }

    /// Puts the answers of those at their end.
    #[inline(always)]
    fn answer(&mut self, at_ends: u64, ends: &mut impl Ends<F::Answer>) {
        for place in Bits(at_ends) {
            let flight = &self.flights[place];
            if flight.position != NOWHERE {
                let is_met = *self.references.of(place) == MET;
                let ray = &self.rays[flight.position];
                ends.put(flight.position, flight.flyer.answer(&self.exact, ray, is_met));
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
    let mut waiting = positions.iter();
    let mut fleet = Fleet::<F, L>::new(exact, rays);
    // All of which have come to their end.
    let mut under_way = u64::MAX >> (u64::BITS as usize - FLIGHTS);
    while under_way != 0 {
        let at = fleet.references.stations::<F, L>();
        let at_ends = at.ends & under_way;
        if at_ends.count_ones() >= ENOUGH || at_ends == under_way {
            fleet.answer(at_ends, ends);
            under_way &= !at_ends;
            let mut free = at_ends;
            if F::STARTS_BY_FOUR {
                while let Some((&four, behind)) = waiting.as_slice().split_first_chunk()
                    && let Some((places, others)) = Bits(free).first_four()
                {
                    // Every other one: most come one behind another, two in a cache line.
                    for ahead in [AHEAD, AHEAD + 2] {
                        if let Some(&position) = waiting.as_slice().get(ahead) {
                            lanes::fetch(&rays[position]);
                        }
                    }
                    waiting = behind.iter();
                    let started = fleet.set_out_by_four(places, four);
                    if started == 0b1111 {
                        for position in four {
                            ends.fetch(position);
                        }
                        under_way |= free & !others.0;
                        free = others.0;
                        continue;
                    }
                    for (i, (place, position)) in places.into_iter().zip(four).enumerate() {
                        if started >> i & 1 != 0 {
                            ends.fetch(position);
                            under_way |= bit(true, place);
                            free &= !bit(true, place);
                        } else {
                            ends.put(position, Outcome::Unsettled);
                        }
                    }
                }
            }
            for place in Bits(free) {
                if let Some(&position) = waiting.as_slice().get(AHEAD) {
                    lanes::fetch(&rays[position]);
                }
                for &position in waiting.by_ref() {
                    if fleet.set_out(place, position) {
                        ends.fetch(position);
                        under_way |= bit(true, place);
                        break;
                    }
                    ends.put(position, Outcome::Unsettled);
                }
            }
            continue;
        }
        // Where most of them are.
        let [nodes, leaves, others] = [at.nodes, at.leaves, at.others].map(u64::count_ones);
        let moving = if F::IS_MIXED && others > nodes.max(leaves) {
            fleet.meet_others(at.others, ends);
            at.others
        } else if nodes >= leaves {
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
