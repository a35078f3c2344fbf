//! Instruction sets, and work that runs at any of them.

#![allow(unsafe_code)]

use std::fmt;
use std::sync::OnceLock;

use crate::Real;
#[cfg(target_arch = "aarch64")]
use crate::neon::F32x4;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use crate::wasm::F32x4;
#[cfg(target_arch = "x86_64")]
use crate::x86::OnX86;

/// Work that is compiled for every instruction set.
pub trait Job {
    /// What it returns.
    type Output;

    /// Does the work. To be `#[inline(always)]`, with everything that it calls in its inner loops.
    fn run<R: Real>(self) -> Self::Output;
}

/// An instruction set that this machine has: a value exists only where it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstructionSet(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Set {
    Scalar,
    #[cfg(target_arch = "aarch64")]
    Neon,
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Simd128,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// The environment variable `LUMBRE_SIMD` has a value that names no instruction set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownInstructionSet(pub String);

impl fmt::Display for UnknownInstructionSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "LUMBRE_SIMD names no instruction set (found \"{}\"; expected scalar, neon, avx2 or avx512)",
            self.0
        )
    }
}

impl std::error::Error for UnknownInstructionSet {}

impl InstructionSet {
    /// One number at a time, which every machine can.
    pub const SCALAR: Self = Self(Set::Scalar);

    /// The best that this machine has and the environment allows. The first call looks, all others remember.
    ///
    /// The environment variable `LUMBRE_SIMD` limits it: `scalar`, `neon`, `avx2` or `avx512` is the best that may be
    /// chosen. A value that names none of these limits nothing; a program reports it by
    /// [`InstructionSet::from_environment`].
    pub fn detect() -> Self {
        static BEST: OnceLock<InstructionSet> = OnceLock::new();
        *BEST.get_or_init(|| Self::from_environment().unwrap_or_else(|_| best_up_to(usize::MAX)))
    }

    /// [`InstructionSet::detect`] without memory.
    ///
    /// # Errors
    /// If `LUMBRE_SIMD` has a value that names no instruction set.
    pub fn from_environment() -> Result<Self, UnknownInstructionSet> {
        match std::env::var_os("LUMBRE_SIMD") {
            Some(limit) if !limit.is_empty() => Self::limited_to(&limit.to_string_lossy()),
            _ => Ok(best_up_to(usize::MAX)),
        }
    }

    /// The best that this machine has with no more lanes than the one with this name.
    ///
    /// # Errors
    /// If no instruction set has the name.
    pub fn limited_to(name: &str) -> Result<Self, UnknownInstructionSet> {
        match name {
            "scalar" => Ok(Self::SCALAR),
            "neon" | "simd128" => Ok(best_up_to(4)),
            "avx2" => Ok(best_up_to(8)),
            "avx512" => Ok(best_up_to(16)),
            _ => Err(UnknownInstructionSet(name.to_owned())),
        }
    }

    /// All that this machine has, the best last, whatever the environment says.
    pub fn available() -> Vec<Self> {
        let mut all = vec![Self::SCALAR];
        // Every processor of this architecture has it.
        #[cfg(target_arch = "aarch64")]
        all.push(Self(Set::Neon));
        // Where it is not there, a module that is compiled with it does not start.
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        all.push(Self(Set::Simd128));
        #[cfg(target_arch = "x86_64")]
        {
            let has_avx2 = std::arch::is_x86_feature_detected!("avx2")
                && std::arch::is_x86_feature_detected!("fma")
                && std::arch::is_x86_feature_detected!("bmi1")
                && std::arch::is_x86_feature_detected!("bmi2")
                && std::arch::is_x86_feature_detected!("lzcnt")
                && std::arch::is_x86_feature_detected!("popcnt");
            if has_avx2 {
                all.push(Self(Set::Avx2));
            }
            if has_avx2
                && std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512cd")
                && std::arch::is_x86_feature_detected!("avx512dq")
                && std::arch::is_x86_feature_detected!("avx512vl")
            {
                all.push(Self(Set::Avx512));
            }
        }
        all
    }

    /// Its name, as `LUMBRE_SIMD` takes it where there is an environment: `simd128` is of WebAssembly, which has none.
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Scalar => "scalar",
            #[cfg(target_arch = "aarch64")]
            Set::Neon => "neon",
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Set::Simd128 => "simd128",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => "avx512",
        }
    }

    /// The number of its lanes: [`Real::LANES`] of the type that a job runs with.
    pub fn lanes(self) -> usize {
        match self.0 {
            Set::Scalar => 1,
            #[cfg(target_arch = "aarch64")]
            Set::Neon => 4,
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Set::Simd128 => 4,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => 8,
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => 16,
        }
    }

    /// Runs a job with its lanes. A call costs a branch; the job's own loops belong inside of it.
    #[inline(always)]
    pub fn run<J: Job>(self, job: J) -> J::Output {
        match self.0 {
            Set::Scalar => job.run_scalar(),
            #[cfg(target_arch = "aarch64")]
            Set::Neon => job.run_neon(),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Set::Simd128 => job.run_simd128(),
            // SAFETY: `available` alone makes this value, after finding on this machine all the features of `run_avx2`.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { job.run_avx2() },
            // SAFETY: as above, of `run_avx512`.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { job.run_avx512() },
        }
    }
}

/// The best that this machine has with no more lanes.
fn best_up_to(lanes: usize) -> InstructionSet {
    let fits = InstructionSet::available().into_iter().rev().find(|set| set.lanes() <= lanes);
    fits.unwrap_or(InstructionSet::SCALAR)
}

/// The type with which a job is compiled: the compiler puts a generic method into the codegen unit of its type, so that
/// the jobs of different modules are compiled in parallel.
trait CompilationUnit: Job + Sized {
    #[inline(never)]
    fn run_scalar(self) -> Self::Output {
        self.run::<f32>()
    }

    #[cfg(target_arch = "aarch64")]
    #[inline(never)]
    fn run_neon(self) -> Self::Output {
        self.run::<F32x4>()
    }

    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    #[inline(never)]
    fn run_simd128(self) -> Self::Output {
        self.run::<F32x4>()
    }
}

impl<J: Job> CompilationUnit for J {}
