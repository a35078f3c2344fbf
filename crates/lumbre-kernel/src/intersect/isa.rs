//! The instruction sets that are chosen among at run time.

use std::sync::OnceLock;

use lumbre_simd::InstructionSet;

/// An instruction set that this machine has: there is no other way to one than asking it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Isa(pub(super) Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Set {
    Portable,
    #[cfg(target_arch = "aarch64")]
    Neon,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// The best that this machine has and the environment variable `LUMBRE_SIMD` allows: see
    /// [`InstructionSet::detect`].
    pub(crate) fn best() -> Self {
        static BEST: OnceLock<Isa> = OnceLock::new();
        *BEST.get_or_init(|| {
            let most = InstructionSet::detect().lanes();
            Self::all().into_iter().rfind(|isa| isa.lanes() <= most).expect("the portable one at least")
        })
    }

    /// All that this machine has, the best last.
    #[cfg_attr(
        not(any(target_arch = "aarch64", target_arch = "x86_64")),
        allow(unused_mut, reason = "the portable one is all")
    )]
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self(Set::Portable)];
        // Every processor of this architecture has it.
        #[cfg(target_arch = "aarch64")]
        all.push(Self(Set::Neon));
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

    /// How many numbers a register holds, as [`InstructionSet::lanes`].
    fn lanes(self) -> usize {
        match self.0 {
            Set::Portable => 1,
            #[cfg(target_arch = "aarch64")]
            Set::Neon => 4,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => 8,
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => 16,
        }
    }

    /// Whether there are vectors of eight numbers.
    pub(crate) fn has_vectors(self) -> bool {
        self.0 != Set::Portable
    }
}
