//! What every ray is asked, by one call to where its answer is found.

use std::fmt;

use lumbre_geometry::Ray;

#[cfg(target_arch = "x86_64")]
use super::x86::AskOnX86;
use super::{Lanes, Level, Set, portable};
use crate::Accel;

/// What is asked about a ray in a tree.
pub(crate) trait Question {
    /// The ray.
    type Ray;
    /// What it is to know.
    type Answer;
    /// Finds that. To be `#[inline(always)]`, with everything that it calls in its inner loop.
    fn ask<L: Lanes>(accel: &Accel, ray: &Self::Ray) -> Self::Answer;
}

/// A question at an instruction set that this machine has: there is no other way to one than by a [`Level`].
pub(crate) struct Asked<A, R = Ray>(unsafe fn(&Accel, &R) -> A);

impl<A, R> Asked<A, R> {
    #[inline(always)]
    pub(crate) fn ask(&self, accel: &Accel, ray: &R) -> A {
        // SAFETY: only a `Level` makes this value, of a function whose features the machine has.
        unsafe { (self.0)(accel, ray) }
    }
}

impl<A, R> Clone for Asked<A, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<A, R> Copy for Asked<A, R> {}

impl<A, R> fmt::Debug for Asked<A, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Asked")
    }
}

impl Level {
    /// A question with these lanes: chosen now, and not once more for every ray.
    pub(crate) fn asked<Q: Question>(self) -> Asked<Q::Answer, Q::Ray> {
        Asked(match self.0 {
            Set::Portable => Q::ask::<portable::Portable>,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => Q::ask_avx2,
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => Q::ask_avx512,
        })
    }
}
