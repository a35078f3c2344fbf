#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! # How lane code is written
//!
//! - Everything is generic over [`Real`] and `#[inline(always)]`, from [`Job::run`] down: only inlined code takes on
//!   the instruction set of the root that [`InstructionSet::run`] calls. A function that is not inlined, and a closure,
//!   loses it and runs many times slower. What is too long to be inlined everywhere is a [`Task`], run by
//!   [`Real::call`].
//! - An early return becomes a mask, an `if` a [`Real::select`]. Lanes that a mask excludes are computed all the same,
//!   so they may hold infinities and NaN, but never an index out of range.
//!
//! # The same bits at every width
//!
//! Every operation gives the same bits in each lane at every instruction set, NaN aside: it is NaN everywhere, but its
//! sign and payload are unspecified. Comparisons with NaN are false (`simd_ne` is true), and `simd_min(a, b)` is `if a
//! < b { a } else { b }`.

#[cfg(any(
    target_arch = "aarch64",
    target_arch = "x86_64",
    all(target_arch = "wasm32", target_feature = "simd128")
))]
mod indices;
mod instruction_set;
mod lanes;
pub mod math;
#[cfg(target_arch = "aarch64")]
mod neon;
pub mod random;
mod scalar;
mod v3;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use instruction_set::{InstructionSet, Job, UnknownInstructionSet};
pub use lanes::{Double, MAX_LANES, Mask, Real, Task, UInt};
pub use v3::V3;
