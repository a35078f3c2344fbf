//! Many rays at once: as in double precision, see [`batch`].
//!
//! [`batch`]: crate::batch

use std::marker::PhantomData;

use super::Goal;
use super::flyer::NarrowFlyer;
use super::packet::Packet;
use crate::batch::{AllAtOnce, Ends, Flying, Manner};
use crate::fleet;
use crate::holds::{Contents, SingleStart};
use crate::lanes::{Lanes, Level};
use crate::packet::{PACKET, Together};
use crate::single::{Exact, Outcome};
use crate::{Accel, Ray32};

/// Rays that are taken to double precision at a time.
const WIDELY: usize = 1024;

/// Searches along every ray.
pub(crate) fn search_all<G: Goal>(level: Level, accel: &Accel, rays: &[Ray32], answers: &mut [G::Answer]) {
    let start = accel.single.as_ref().filter(|start| start.contents == Contents::Triangles);
    let Some(start) = start else {
        let mut wide = Vec::with_capacity(rays.len().min(WIDELY));
        for (rays, answers) in rays.chunks(WIDELY).zip(answers.chunks_mut(WIDELY)) {
            wide.clear();
            wide.extend(rays.iter().map(|ray| ray.to_f64()));
            G::all_widely(level, accel, &wide, answers);
        }
        return;
    };
    search_triangles::<G>(level, accel, start, rays, answers, None);
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
    level.run(AllAtOnce::<InSingle<G>, _> { accel, start, rays, ends, flying, has_packets: true });
}

/// In single precision.
struct InSingle<G>(PhantomData<G>);

impl<G: Goal> Manner for InSingle<G> {
    type Ray = Ray32;
    type Answer = G::Answer;
    type Packet<'a> = Packet<'a>;
    const ASKS_AHEAD: bool = false;

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
}
