//! One ray at a time.

use super::{Goal, Nearest};
use crate::lanes::{self, Lanes};
use crate::node::tag;
use crate::single::{Exact, Outcome};
use crate::stack::{AsBuilt, ByDistance, Stack};
use crate::triangles;
use crate::way::Way;
use crate::{Hit32, Ray32};

/// Searches along a ray, in double precision where it does not come from nearby.
#[inline(always)]
pub(super) fn search<G: Goal, L: Lanes>(exact: &Exact, ray: &Ray32) -> G::Answer {
    match G::alone::<L>(exact, ray) {
        Outcome::Settled(answer) => answer,
        Outcome::Unsettled => G::widely(exact.accel(), ray),
    }
}

#[inline(always)]
pub(super) fn closest<L: Lanes>(exact: &Exact, ray: &Ray32) -> Outcome<Option<Hit32>> {
    let (start, ray) = (exact.start, &L::read_narrow(ray));
    let Some(slabs) = L::start_narrow(start, ray) else { return Outcome::Unsettled };
    let mut way = Way::<L>::new(exact.nodes(), slabs);
    let mut stack = Stack::new();
    let Some(mut leaf) = way.descend::<ByDistance>(start.root, &mut stack) else {
        return Outcome::Settled(None);
    };
    let mut ray = L::start_narrow_blocks(start, lanes::opaque(ray), way.slabs());
    let mut nearest = Nearest::NONE;
    loop {
        let mut place = leaf & tag::PLACE;
        loop {
            let block = exact.block(place);
            if let Some((crossing, pass)) = ray.pass::<L>(&start.precise, block)
                && nearest.take(exact, &mut ray, place, &crossing, &pass)
            {
                way.end_at(triangles::beyond(ray.t_max()));
            }
            match block.next(place) {
                Some(next) => place = next,
                None => break,
            }
        }
        let Some(next) = way.pop::<ByDistance>(&mut stack) else { break };
        let Some(next) = way.descend::<ByDistance>(next, &mut stack) else { break };
        leaf = next;
    }
    Outcome::Settled(nearest.hit(exact, ray.t_max()))
}

#[inline(always)]
pub(super) fn any<L: Lanes>(exact: &Exact, ray: &Ray32) -> Outcome<bool> {
    let (start, ray) = (exact.start, &L::read_narrow(ray));
    let Some(slabs) = L::start_narrow(start, ray) else { return Outcome::Unsettled };
    let way = Way::<L>::new(exact.nodes(), slabs);
    let mut stack = Stack::new();
    let Some(mut leaf) = way.descend::<AsBuilt>(start.root, &mut stack) else {
        return Outcome::Settled(false);
    };
    let ray = L::start_narrow_blocks(start, lanes::opaque(ray), way.slabs());
    loop {
        let mut place = leaf & tag::PLACE;
        loop {
            let block = exact.block(place);
            if ray.meets_any::<L>(&start.precise, block) {
                return Outcome::Settled(true);
            }
            match block.next(place) {
                Some(next) => place = next,
                None => break,
            }
        }
        let Some(next) = way.pop::<AsBuilt>(&mut stack) else { break };
        let Some(next) = way.descend::<AsBuilt>(next, &mut stack) else { break };
        leaf = next;
    }
    Outcome::Settled(false)
}
