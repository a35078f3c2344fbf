//! Many rays at once: as in double precision, see [`batch`].
//!
//! [`batch`]: crate::batch

use std::marker::PhantomData;

use super::Goal;
use super::flyer::NarrowFlyer;
use super::packet::Packet;
use crate::batch::{self, AllAtOnce, Ends, Flying, Manner};
use crate::fleet;
use crate::holds::{Contents, SingleStart};
use crate::lanes::{Lanes, Level};
use crate::packet::{PACKET, Together};
use crate::single::{self, Exact, Outcome};
use crate::{Accel, Ray32};

/// Searches along every ray.
pub(crate) fn search_all<G: Goal>(level: Level, accel: &Accel, rays: &[Ray32], answers: &mut [G::Answer]) {
    let Some(start) = &accel.single else {
        answers.iter_mut().zip(rays).for_each(|(answer, ray)| *answer = G::widely(accel, ray));
        return;
    };
    let rounded = |places| Rounded::<G> { accel, rays, places };
    match start.contents {
        Contents::Triangles => search_triangles::<G>(level, accel, start, rays, answers, None),
        Contents::Shapes | Contents::Spheres => {
            batch::search_beside::<G::Wide, _>(level, accel, start, rays, rounded(answers), None, true);
        }
        Contents::Anything => {
            batch::search_anything::<G::Wide, _>(level, accel, start, rays, Found(rounded(answers)));
        }
    }
}

/// The places for what came of rays in double precision, rounded.
struct Rounded<'a, G: Goal> {
    accel: &'a Accel,
    rays: &'a [Ray32],
    places: &'a mut [G::Answer],
}

impl<G: Goal> Ends<<G::Wide as single::Goal>::Answer> for Rounded<'_, G> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<<G::Wide as single::Goal>::Answer>) {
        let place = &mut self.places[position];
        match outcome {
            Outcome::Settled(answer) => G::put_rounded(self.accel, answer, place),
            Outcome::Unsettled => *place = G::widely(self.accel, &self.rays[position]),
        }
    }
}

/// The same of what is handed out.
struct Found<'a, G: Goal>(Rounded<'a, G>);

impl<G: Goal> Ends<<G::Wide as single::Goal>::Found> for Found<'_, G> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<<G::Wide as single::Goal>::Found>) {
        let Self(Rounded { accel, rays, places }) = self;
        places[position] = match outcome {
            Outcome::Settled(found) => G::rounded_found(found),
            Outcome::Unsettled => G::widely(accel, &rays[position]),
        };
    }
}

/// The same in a tree of triangles, where those that do not go together go as is said, if it is.
pub(crate) fn search_triangles<G: Goal>(
    level: Level,
    accel: &Accel,
    start: &SingleStart,
    rays: &[Ray32],
    answers: &mut [G::Answer],
    flying: Option<Flying>,
) {
    let ends = Answers::<G> { accel, level, rays, places: answers };
    AllAtOnce::<InSingle<G>, _> { accel, start, rays, ends, flying, has_packets: true }.run_at(level);
}

/// In single precision.
struct InSingle<G>(PhantomData<G>);

impl<G: Goal> Manner for InSingle<G> {
    type Ray = Ray32;
    type Answer = G::Answer;
    type Packet<'a> = Packet<'a>;
    const ASKS_AHEAD: bool = true;
    const MIXED: bool = false;

    #[inline(always)]
    fn packet<'a>(accel: &'a Accel, start: &'a SingleStart) -> Packet<'a> {
        Packet::new(accel, start)
    }

    #[inline(always)]
    fn search_together<'a, L: Lanes>(
        packet: &mut Packet<'a>,
        _: &Exact<'a>,
        rays: &[Ray32; PACKET],
        first: usize,
        ends: &mut impl Ends<G::Answer>,
    ) -> Together {
        packet.search::<G, L>(rays, first, ends)
    }

    #[inline(always)]
    fn search_alone<L: Lanes>(exact: &Exact, ray: &Ray32) -> Outcome<G::Answer> {
        G::alone::<L>(exact, ray)
    }

    #[inline(always)]
    fn fly<L: Lanes>(
        exact: &Exact,
        asks_ahead: bool,
        rays: &[Ray32],
        positions: &[usize],
        ends: &mut impl Ends<G::Answer>,
    ) {
        fleet::fly::<NarrowFlyer<G>, L>(exact, asks_ahead, rays, positions, ends);
    }
}

/// The places for what came of a batch of rays.
struct Answers<'a, G: Goal> {
    accel: &'a Accel,
    level: Level,
    rays: &'a [Ray32],
    places: &'a mut [G::Answer],
}

impl<G: Goal> Ends<G::Answer> for Answers<'_, G> {
    #[inline(always)]
    fn put(&mut self, position: usize, outcome: Outcome<G::Answer>) {
        self.places[position] = match outcome {
            Outcome::Settled(answer) => answer,
            Outcome::Unsettled => G::alone_at(self.level).ask(self.accel, &self.rays[position]),
        };
    }

    #[inline(always)]
    fn put_row(&mut self, first: usize, answer: impl Fn(usize) -> G::Answer) {
        for (i, place) in self.places[first..first + PACKET].iter_mut().enumerate() {
            *place = answer(i);
        }
    }
}
