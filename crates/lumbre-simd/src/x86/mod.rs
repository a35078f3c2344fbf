//! Eight lanes of AVX2 and sixteen of AVX-512: with `instruction_set` and `neon`, the fence around this crate's
//! `unsafe`.
//!
//! The types of lanes are private. Code reaches them as the `R` of a [`Job`] alone, below [`OnX86::run_avx2`] and
//! [`OnX86::run_avx512`], so that wherever a method of theirs runs, the machine has the instructions.

#![allow(unsafe_code)]

mod avx2;
mod avx512;

use crate::{Job, Real, Task};

/// Jobs on x86; a trait, so that each is compiled with its own type.
pub(crate) trait OnX86: Job + Sized {
    /// # Safety
    /// The machine has these features.
    #[inline(never)]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    unsafe fn run_avx2(self) -> Self::Output {
        self.run::<avx2::F32x8>()
    }

    /// # Safety
    /// The machine has these features.
    #[inline(never)]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512cd,avx512dq,avx512vl")]
    unsafe fn run_avx512(self) -> Self::Output {
        self.run::<avx512::F32x16>()
    }
}

impl<J: Job> OnX86 for J {}

/// Tasks of AVX2 and AVX-512.
trait Called<R: Real>: Task<R> {
    /// # Safety
    /// The machine has these features.
    #[inline(never)]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    unsafe fn call_avx2(self) -> Self::Output {
        self.run()
    }

    /// # Safety
    /// The machine has these features.
    #[inline(never)]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512cd,avx512dq,avx512vl")]
    unsafe fn call_avx512(self) -> Self::Output {
        self.run()
    }
}

impl<R: Real, T: Task<R>> Called<R> for T {}

/// Instructions on registers.
macro_rules! registers {
    ($value:expr) => {{
        // SAFETY: they touch no memory, and where this type is used, the machine has them: see the module.
        unsafe { $value }
    }};
}

/// Operators that are an instruction each.
macro_rules! operators {
    ($name:ident: $($trait:ident $method:ident $instruction:ident),*) => {
        $(
            impl $trait for $name {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    registers!(Self($instruction(self.0, other.0)))
                }
            }
        )*
    };
}

/// The same of two registers.
macro_rules! operators_by_two {
    ($name:ident: $($trait:ident $method:ident $instruction:ident),*) => {
        $(
            impl $trait for $name {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    registers!(Self([$instruction(self.0[0], other.0[0]), $instruction(self.0[1], other.0[1])]))
                }
            }
        )*
    };
}

use {operators, operators_by_two, registers};
