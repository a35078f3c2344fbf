//! Work that is compiled for every instruction set and dispatched to one: tasks, for which [`Isa::run`] chooses it at
//! every call, and queries of a ray in a tree, for which [`Isa::dispatched`] chooses it once.

use std::fmt;

use lumbre_geometry::Ray;

use super::isa::{Isa, Set};
use super::operations::Simd;
#[cfg(target_arch = "aarch64")]
use super::portable::Neon;
use super::portable::Portable;
#[cfg(target_arch = "x86_64")]
use super::x86::X86;
use crate::tree::Tree;

/// Work that is compiled for every instruction set and dispatched to one.
pub(crate) trait Dispatch {
    /// Its result.
    type Output;
    /// Does it. To be `#[inline(always)]`, with everything that it calls in its inner loop.
    fn run<L: Simd>(self) -> Self::Output;
}

/// The type with which dispatched work is compiled.
///
/// The compiler puts a generic method into the codegen unit of the type whose method it is. As methods of types in
/// different modules, the traversals are compiled in parallel; as functions of this module they would all be one unit.
trait CompilationUnit {
    // Out of the way of the others.
    #[inline(never)]
    fn run_portable<T: Dispatch>(task: T) -> T::Output {
        task.run::<Portable>()
    }

    #[cfg(target_arch = "aarch64")]
    #[inline(never)]
    fn run_neon<T: Dispatch>(task: T) -> T::Output {
        task.run::<Neon>()
    }
}

impl<H> CompilationUnit for H {}

/// Dispatched work with x86 vectors: see [`CompilationUnit`].
#[cfg(target_arch = "x86_64")]
trait OnX86 {
    /// # Safety
    /// The machine has these features.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    unsafe fn run_avx2<T: Dispatch>(task: T) -> T::Output {
        task.run::<X86<false>>()
    }

    /// # Safety
    /// The machine has these features.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512cd,avx512dq,avx512vl")]
    unsafe fn run_avx512<T: Dispatch>(task: T) -> T::Output {
        task.run::<X86<true>>()
    }
}

#[cfg(target_arch = "x86_64")]
impl<H> OnX86 for H {}

impl Isa {
    /// Runs a task that is only compiled for instruction sets with vectors.
    #[cfg_attr(
        not(any(target_arch = "aarch64", target_arch = "x86_64")),
        allow(unused_variables, reason = "there is no instruction set that takes the task")
    )]
    #[inline(always)]
    pub(crate) fn run_with_vectors<T: Dispatch>(self, task: T) -> T::Output {
        match self.0 {
            Set::Portable => unreachable!("who calls it asks `has_vectors`"),
            #[cfg(target_arch = "aarch64")]
            Set::Neon => T::run_neon(task),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `all` alone makes this value, after finding on this machine all the features of `run_avx2`.
            Set::Avx2 => unsafe { T::run_avx2(task) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above, of `run_avx512`.
            Set::Avx512 => unsafe { T::run_avx512(task) },
        }
    }

    /// Runs the task with these lanes.
    #[inline(always)]
    pub(crate) fn run<T: Dispatch>(self, task: T) -> T::Output {
        self.run_beside::<T, T>(task)
    }

    /// The same, compiled with this type: see [`CompilationUnit`].
    #[inline(always)]
    pub(crate) fn run_beside<H, T: Dispatch>(self, task: T) -> T::Output {
        match self.0 {
            Set::Portable => H::run_portable(task),
            #[cfg(target_arch = "aarch64")]
            Set::Neon => H::run_neon(task),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `all` alone makes this value, after finding on this machine all the features of `run_avx2`.
            Set::Avx2 => unsafe { H::run_avx2(task) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above, of `run_avx512`.
            Set::Avx512 => unsafe { H::run_avx512(task) },
        }
    }
}

/// A query of a ray in a tree.
pub(crate) trait RayQuery {
    /// The ray.
    type Ray;
    /// Its result.
    type Answer;
    /// Answers it. To be `#[inline(always)]`, with everything that it calls in its inner loop.
    fn ask<L: Simd>(tree: &Tree, ray: &Self::Ray) -> Self::Answer;
}

/// A query compiled for an instruction set that this machine has, since only an [`Isa`] makes one.
pub(crate) struct DispatchedQuery<A, R = Ray>(unsafe fn(&Tree, &R) -> A);

impl<A, R> DispatchedQuery<A, R> {
    #[inline(always)]
    pub(crate) fn ask(&self, tree: &Tree, ray: &R) -> A {
        // SAFETY: only an `Isa` makes this value, of a function whose features the machine has.
        unsafe { (self.0)(tree, ray) }
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
        f.write_str("DispatchedQuery")
    }
}

/// Ray queries with x86 vectors.
#[cfg(target_arch = "x86_64")]
trait AskOnX86: RayQuery {
    /// # Safety
    /// The machine has these features.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    unsafe fn ask_avx2(tree: &Tree, ray: &Self::Ray) -> Self::Answer {
        Self::ask::<X86<false>>(tree, ray)
    }

    /// # Safety
    /// The machine has these features.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512cd,avx512dq,avx512vl")]
    unsafe fn ask_avx512(tree: &Tree, ray: &Self::Ray) -> Self::Answer {
        Self::ask::<X86<true>>(tree, ray)
    }
}

#[cfg(target_arch = "x86_64")]
impl<Q: RayQuery> AskOnX86 for Q {}

impl Isa {
    /// A query for this instruction set, chosen now and not once more for every ray.
    pub(crate) fn dispatched<Q: RayQuery>(self) -> DispatchedQuery<Q::Answer, Q::Ray> {
        DispatchedQuery(match self.0 {
            Set::Portable => Q::ask::<Portable>,
            #[cfg(target_arch = "aarch64")]
            Set::Neon => Q::ask::<Neon>,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => Q::ask_avx2,
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => Q::ask_avx512,
        })
    }
}
