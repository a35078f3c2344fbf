//! Instances that rays together may meet.
//!
//! Rays that come to an instance go through the tree that it places together, too, with the ranges that are left to them; what each
//! finds there comes with its crossing in double precision, as that of a shape does. Where they do not go together there, and in
//! trees of anything but triangles, each goes as it does alone.

use std::marker::PhantomData;

use lumbre_geometry::Ray;

use super::{Asked, CROSSED, NoOthers, Others, Packet, Together};
use crate::anything::{Direct, InInstance, Placed, Sought, WITHIN, Whole, is_nearest};
use crate::batch::{self, Ends};
use crate::collapse::Entry;
use crate::holds::{Contents, SingleStart};
use crate::lanes::{Lanes, Level, Task};
use crate::packet::PACKET;
use crate::query::All;
use crate::single::{Goal, Nearest, Outcome, Whether, Winner, heights, largest_component};
use crate::traverse::{Place, Standing};
use crate::{Accel, Hit};

/// What it is to set out in a placed tree together, and for one to go through it alone, in nodes met.
const WORK_OF_START: u32 = 8;
const WORK_ALONE: u32 = 4;

/// What rays have among instances.
pub(crate) struct AmongInstances<'a> {
    accel: &'a Accel,
    start: &'a SingleStart,
    around: Place,
    /// The last of each one's nearest hits that was in an instance.
    within: [Option<Hit>; PACKET],
}

impl<'a> AmongInstances<'a> {
    pub(crate) fn new(accel: &'a Accel, start: &'a SingleStart) -> Self {
        Self { accel, start, around: Place::default(), within: [const { None }; PACKET] }
    }

    /// Searches along a ray alone.
    #[inline(always)]
    pub(crate) fn search_alone<G: Companion, L: Lanes>(&self, ray: &Ray) -> Outcome<G::Found> {
        Whole::<G, All>::new(self.accel, self.start, &self.around, ray).run::<L>()
    }
}

/// Rays of a packet at an instance.
pub(crate) struct Visit<'v, 'a, const MIXED: bool> {
    packet: &'v mut Packet<'a, MIXED>,
    within: &'v mut [Option<Hit>; PACKET],
    placed: Placed<'a>,
    standing: Standing<'v>,
    most_work: u32,
    rays: &'v [Ray; PACKET],
}

/// What is asked of rays among instances.
pub(crate) trait Companion: Sought {
    /// Takes what came of a ray in a placed tree of triangles.
    fn take<const MIXED: bool>(visit: &mut Visit<MIXED>, i: usize, answer: Self::Answer);

    /// The same, of any placed tree.
    fn take_found<const MIXED: bool>(visit: &mut Visit<MIXED>, i: usize, found: Self::Found);

    /// What is handed out.
    fn found_together(accel: &Accel, within: &mut Option<Hit>, answer: Self::Answer) -> Self::Found;
}

impl Companion for Nearest {
    #[inline(always)]
    fn take<const MIXED: bool>(visit: &mut Visit<MIXED>, i: usize, answer: Option<Winner>) {
        if let Some(winner) = answer {
            let (accel, standing) = (&*visit.placed.instance.accel, visit.standing);
            visit.meet_hit(&Direct { accel, standing, winner }, i);
        }
    }

    #[inline(always)]
    fn take_found<const MIXED: bool>(visit: &mut Visit<MIXED>, i: usize, found: Option<Hit>) {
        if let Some(hit) = found {
            visit.meet_hit(&hit, i);
        }
    }

    #[inline(always)]
    fn found_together(accel: &Accel, within: &mut Option<Hit>, answer: Option<Winner>) -> Option<Hit> {
        match answer {
            Some(Winner { geometry: WITHIN, .. }) => within.take(),
            answer => Self::found(accel, answer),
        }
    }
}

impl Companion for Whether {
    #[inline(always)]
    fn take<const MIXED: bool>(visit: &mut Visit<MIXED>, i: usize, is_met: bool) {
        visit.packet.met |= u32::from(is_met) << i;
        visit.packet.alive &= !(u32::from(is_met) << i);
    }

    #[inline(always)]
    fn take_found<const MIXED: bool>(visit: &mut Visit<MIXED>, i: usize, is_met: bool) {
        Self::take(visit, i, is_met);
    }

    #[inline(always)]
    fn found_together(_: &Accel, _: &mut Option<Hit>, answer: bool) -> bool {
        answer
    }
}

impl<'a, G: Companion> Others<'a, G> for AmongInstances<'a> {
    type Found = G::Found;

    #[inline(always)]
    fn meet_instance<L: Lanes, const MIXED: bool>(
        &mut self,
        packet: &mut Packet<'a, MIXED>,
        entry: &Entry,
        most_work: u32,
        rays: &[Ray; PACKET],
    ) -> bool {
        let Some(placed) = Placed::of(self.accel, entry) else { return true };
        let Self { around, within, .. } = self;
        let standing = Standing::within(around, placed.geometry, placed.id);
        let visit = Visit { packet, within, placed, standing, most_work, rays };
        visit_apart::<G, MIXED>(L::level(), visit)
    }

    #[inline(always)]
    fn put(&mut self, place: usize, outcome: Outcome<G::Answer>, ends: &mut impl Ends<G::Found>) {
        let found = match outcome {
            Outcome::Settled(answer) => {
                Outcome::Settled(G::found_together(self.accel, &mut self.within[place], answer))
            }
            Outcome::Unsettled => Outcome::Unsettled,
        };
        ends.put(place, found);
    }
}

/// Has those of a packet that go on meet an instance; false where that is more work than they may do.
// Apart, for a packet in a packet is much to keep at hand.
#[inline(never)]
fn visit_apart<G: Companion, const MIXED: bool>(level: Level, visit: Visit<MIXED>) -> bool {
    level.run(Visiting::<G, MIXED>(visit, PhantomData))
}

struct Visiting<'v, 'a, G, const MIXED: bool>(Visit<'v, 'a, MIXED>, PhantomData<G>);

impl<G: Companion, const MIXED: bool> Task for Visiting<'_, '_, G, MIXED> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self(mut visit, ..) = self;
        let Some(alone) = visit.search_together::<G, L>() else { return false };
        visit.search_alone::<G, L>(alone);
        if !G::IS_ANY {
            visit.packet.end_frustum();
        }
        true
    }
}

impl<const MIXED: bool> Visit<'_, '_, MIXED> {
    /// Has those that go on go through the placed tree together, as far as they can: those that cannot; `None` where that is more
    /// work than they may do.
    #[inline(always)]
    fn search_together<G: Companion, L: Lanes>(&mut self) -> Option<u32> {
        let those = self.packet.alive;
        let accel = &*self.placed.instance.accel;
        let Some(start) = accel.single.as_ref().filter(|start| start.contents == Contents::Triangles) else {
            return Some(those);
        };
        let mut rays = *self.rays;
        let mut rest = those;
        while rest != 0 {
            let i = rest.trailing_zeros() as usize % PACKET;
            rest &= rest - 1;
            let [t_min, t_max] = self.range::<G>(i);
            rays[i] =
                self.placed.instance.world_from_object.object_ray(&self.rays[i]).with_range(t_min, t_max);
        }
        let asked = Asked { those, root: self.placed.from.below(start.root), most_work: self.most_work };
        let mut packet = Packet::<false>::new(accel, start);
        let mut unsettled = 0;
        let mut take = batch::ends(
            #[inline(always)]
            |i, outcome| match outcome {
                Outcome::Settled(answer) => G::take(self, i, answer),
                Outcome::Unsettled => unsettled |= 1 << i,
            },
        );
        let Together { answered, is_done, .. } =
            packet.search::<G, L, _>(&rays, asked, &mut NoOthers, &mut take);
        self.packet.work += WORK_OF_START + packet.work;
        is_done.then_some(those & (!answered | unsettled))
    }

    /// Has these go through it one by one.
    #[inline(always)]
    fn search_alone<G: Companion, L: Lanes>(&mut self, mut those: u32) {
        while those != 0 {
            let i = those.trailing_zeros() as usize % PACKET;
            those &= those - 1;
            let (ray, range) = (&self.rays[i], self.range::<G>(i));
            self.packet.work += WORK_ALONE;
            match self.placed.search_triangles::<G, L, All>(ray, range, &All, self.standing) {
                Outcome::Settled(answer) => G::take(self, i, answer),
                Outcome::Unsettled => {
                    let found = self.placed.search::<G, All>(L::level(), ray, range, &All, self.standing);
                    G::take_found(self, i, found);
                }
            }
        }
    }

    /// Where along its ray one has still to look.
    #[inline(always)]
    fn range<G: Goal>(&self, i: usize) -> [f64; 2] {
        let ray = &self.rays[i];
        [ray.t_min, if G::IS_ANY { ray.t_max } else { self.packet.best(i).limit(ray) }]
    }

    /// Takes a hit in the instance, if it is the nearest of that ray.
    #[inline(always)]
    fn meet_hit(&mut self, hit: &impl InInstance, i: usize) {
        let Self { packet, within, rays, .. } = self;
        let ray = &rays[i];
        let heights = heights(hit.t(), largest_component(ray));
        let (best, crossed) = (packet.best(i), || packet.crossed(i));
        let is_better = |t| packet.is_better(ray, i, t, (WITHIN, 0));
        let is_nearer = match is_nearest(hit, heights, (&best, crossed, &within[i]), is_better) {
            Outcome::Settled(is_nearer) => is_nearer,
            Outcome::Unsettled => return packet.give_up(i),
        };
        if is_nearer {
            let within = hit.put(&mut within[i]);
            packet.shapes.crossed[i] = Some(Winner { root: within.root, geometry: WITHIN, primitive: 0 });
            packet.keep(i, heights, CROSSED);
        }
    }
}

/// Those of some rays that a packet answers, for tests.
#[cfg(test)]
pub(super) struct Searching<'a>(
    pub(super) &'a Accel,
    pub(super) &'a SingleStart,
    pub(super) &'a [Ray; PACKET],
);

#[cfg(test)]
impl Task for Searching<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<L: Lanes>(self) -> u32 {
        let Self(accel, start, rays) = self;
        let mut packet = Packet::<true>::new(accel, start);
        let others = &mut AmongInstances::new(accel, start);
        let whole = packet.whole();
        packet.search::<Nearest, L, _>(rays, whole, others, &mut |_, _| {}).answered
    }
}
