//! Rays among spheres.

use std::borrow::Borrow;
use std::marker::PhantomData;

use super::{Ends, Manner};
use crate::Accel;
use crate::fleet::{self, Doubled};
use crate::holds::SingleStart;
use crate::lanes::{Lanes, Task};
use crate::packet::{PACKET, Together};
use crate::single::{Exact, Goal, Outcome};
use crate::single_spheres::{AloneAmongSpheres, SphereFlyer};

/// Among spheres, where none go together.
pub(super) struct AmongSpheres<G, R>(PhantomData<(G, R)>);

impl<G: Goal, R: Doubled> Manner for AmongSpheres<G, R> {
    type Ray = R;
    type Answer = G::Answer;
    type Packet<'a> = ();
    const ASKS_AHEAD: bool = true;
    const MIXED: bool = false;

    fn packet<'a>(_: &'a Accel, _: &'a SingleStart) {}

    #[inline(always)]
    fn search_together<'a, L: Lanes>(
        _: &mut (),
        _: &Exact<'a>,
        _: &[R; PACKET],
        _: usize,
        _: &mut impl Ends<G::Answer>,
    ) -> Together {
        Together { answered: 0, pays: false, is_done: false }
    }

    #[inline(always)]
    fn search_alone<L: Lanes>(exact: &Exact, ray: &R) -> Outcome<G::Answer> {
        let ray = ray.doubled::<L>();
        AloneAmongSpheres::<G>::new(exact.accel(), exact.start, exact.start.root, ray.borrow()).run::<L>()
    }

    #[inline(always)]
    fn fly<L: Lanes>(
        exact: &Exact,
        asks_ahead: bool,
        rays: &[R],
        positions: &[usize],
        ends: &mut impl Ends<G::Answer>,
    ) {
        fleet::fly::<SphereFlyer<G, R>, L>(exact, asks_ahead, rays, positions, ends);
    }
}
