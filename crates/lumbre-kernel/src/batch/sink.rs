//! Where the answers of many rays go.

use crate::simd::WIDE;
use crate::trace::Outcome;

/// Rays in a packet.
pub(crate) const PACKET: usize = WIDE;

/// Takes the answers, in any order. Methods are to be `#[inline(always)]`: an answer that goes through memory is waited for.
pub(crate) trait Sink<A> {
    /// The answer to the ray at a position.
    fn put(&mut self, position: usize, outcome: Outcome<A>);

    /// The answers to a packet, the first ray of which has this position.
    #[inline(always)]
    fn put_row(&mut self, first: usize, answer: impl Fn(usize) -> A) {
        for i in 0..PACKET {
            self.put(first + i, Outcome::Certain(answer(i)));
        }
    }

    /// Prefetches where an answer will be written.
    #[inline(always)]
    fn prefetch(&self, _position: usize) {}
}
