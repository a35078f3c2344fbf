//! Rays through a tree of anything.

use std::borrow::Borrow;
use std::marker::PhantomData;

use super::{Coming, Ends, Trials, search_packet};
use crate::Accel;
use crate::fleet::Doubled;
use crate::holds::SingleStart;
use crate::lanes::{self, Lanes, Task};
use crate::packet::{AmongInstances, Companion, PACKET, Packet};

/// Rays through a tree of anything: those that are alike together, and the others one after another.
pub(super) struct OneByOne<'a, 'r, G, R, E> {
    pub(super) accel: &'a Accel,
    pub(super) start: &'a SingleStart,
    pub(super) rays: &'r [R],
    pub(super) ends: E,
    pub(super) goal: PhantomData<G>,
}

impl<G: Companion, R: Doubled, E: Ends<G::Found>> Task for OneByOne<'_, '_, G, R, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { accel, start, rays, mut ends, .. } = self;
        let mut others = AmongInstances::new(accel, start);
        let mut packet = Packet::<true>::new(accel, start);
        let mut trials = Trials::NEW;
        let mut coming = Coming::new(rays, !G::IS_ANY);
        for (number, rays) in rays.chunks(PACKET).enumerate() {
            let first = number * PACKET;
            coming.fetch_next();
            let mut answered = 0;
            if let Ok(rays) = rays.try_into()
                && trials.is_next()
            {
                let rays = R::all_doubled::<L>(rays);
                let together =
                    search_packet::<G, L, _, true>(&mut packet, rays.borrow(), first, &mut others, &mut ends);
                trials.heed(together.pays);
                answered = together.answered;
            }
            for (place, ray) in rays.iter().enumerate() {
                if answered >> place & 1 == 0 {
                    let ray = lanes::opaque(ray).doubled::<L>();
                    ends.put(first + place, others.search_alone::<G, L>(ray.borrow()));
                }
            }
        }
    }
}
