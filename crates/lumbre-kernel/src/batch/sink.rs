//! Receives the answers of many rays.

use crate::simd::LANES;
use crate::trace::Outcome;

/// Rays in a packet.
pub(crate) const PACKET: usize = LANES;

/// Takes the answers, in any order. Methods must be `#[inline(always)]`: an answer passed through memory would stall.
pub(crate) trait Sink<A> {
    /// The answer for the ray at a position.
    fn put(&mut self, position: usize, outcome: Outcome<A>);

    /// The answers of a packet; `position` is that of its first ray.
    #[inline(always)]
    fn put_row(&mut self, first: usize, answer: impl Fn(usize) -> A) {
        for i in 0..PACKET {
            self.put(first + i, Outcome::Certain(answer(i)));
        }
    }

    /// Prefetches the slot of an answer.
    #[inline(always)]
    fn prefetch(&self, _position: usize) {}
}
