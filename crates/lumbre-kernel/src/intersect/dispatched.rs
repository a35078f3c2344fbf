//! Ray queries whose instruction set is chosen once for a tree, not for every ray.

use std::fmt;

use lumbre_geometry::Ray;

#[cfg(target_arch = "x86_64")]
use super::x86::AskOnX86;
use super::{Isa, Set, Simd, portable};
use crate::Accel;

/// A query of a ray in a tree.
pub(crate) trait RayQuery {
    /// The ray.
    type Ray;
    /// Its result.
    type Answer;
    /// Answers it. To be `#[inline(always)]`, with everything that it calls in its inner loop.
    fn ask<L: Simd>(accel: &Accel, ray: &Self::Ray) -> Self::Answer;
}

/// A query compiled for an instruction set that this machine has, since only an [`Isa`] makes one.
pub(crate) struct DispatchedQuery<A, R = Ray>(unsafe fn(&Accel, &R) -> A);

impl<A, R> DispatchedQuery<A, R> {
    #[inline(always)]
    pub(crate) fn ask(&self, accel: &Accel, ray: &R) -> A {
        // SAFETY: only an `Isa` makes this value, of a function whose features the machine has.
        unsafe { (self.0)(accel, ray) }
    }
}

impl<A, R> Clone for DispatchedQuery<A, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<A, R> Copy for DispatchedQuery<A, R> {}

impl<A, R> fmt::Debug for DispatchedQuery<A, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Asked")
    }
}

impl Isa {
    /// A query for this instruction set, chosen now and not once more for every ray.
    pub(crate) fn dispatched<Q: RayQuery>(self) -> DispatchedQuery<Q::Answer, Q::Ray> {
        DispatchedQuery(match self.0 {
            Set::Portable => Q::ask::<portable::Portable>,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => Q::ask_avx2,
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => Q::ask_avx512,
        })
    }
}
