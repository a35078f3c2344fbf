//! Rays in double precision, among triangles and what stands beside them.

use std::borrow::Borrow;
use std::marker::PhantomData;

use super::{Ends, Manner, search_packet};
use crate::Accel;
use crate::fleet::{self, Beside, DoubleFlyer, Doubled};
use crate::holds::SingleStart;
use crate::lanes::{Lanes, Task};
use crate::packet::{NoOthers, PACKET, Packet, Together};
use crate::single::{Alone, Exact, Goal, Outcome};

/// In double precision. `MIXED` where anything stands beside triangles.
pub(super) struct InDouble<G, B, R, const MIXED: bool>(PhantomData<(G, B, R)>);

impl<G: Goal, B: Beside, R: Doubled, const MIXED: bool> Manner for InDouble<G, B, R, MIXED> {
    type Ray = R;
    type Answer = G::Answer;
    type Packet<'a> = Packet<'a, MIXED>;
    const ASKS_AHEAD: bool = !G::IS_ANY;
    const MIXED: bool = MIXED;

    #[inline(always)]
    fn packet<'a>(accel: &'a Accel, start: &'a SingleStart) -> Packet<'a, MIXED> {
        Packet::new(accel, start)
    }

    #[inline(always)]
    fn search_together<'a, L: Lanes>(
        packet: &mut Packet<'a, MIXED>,
        _: &Exact<'a>,
        rays: &[R; PACKET],
        first: usize,
        ends: &mut impl Ends<G::Answer>,
    ) -> Together {
        let rays = R::all_doubled::<L>(rays);
        search_packet::<G, L, _, MIXED>(packet, rays.borrow(), first, &mut NoOthers, ends)
    }

    #[inline(always)]
    fn search_alone<L: Lanes>(exact: &Exact, ray: &R) -> Outcome<G::Answer> {
        let ray = ray.doubled::<L>();
        Alone::<G, MIXED>::new(exact.accel(), exact.start, ray.borrow()).run::<L>()
    }

    #[inline(always)]
    fn fly<L: Lanes>(
        exact: &Exact,
        asks_ahead: bool,
        rays: &[R],
        positions: &[usize],
        ends: &mut impl Ends<G::Answer>,
    ) {
        fleet::fly::<DoubleFlyer<G, B, R>, L>(exact, asks_ahead, rays, positions, ends);
    }
}
