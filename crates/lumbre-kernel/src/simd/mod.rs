//! Vectors of numbers, optimization barriers, and prefetching. It knows nothing of rays.

#![allow(unsafe_code)]

#[cfg(target_arch = "aarch64")]
pub(crate) mod neon;
pub(crate) mod portable;
pub(crate) mod vector;
#[cfg(target_arch = "x86_64")]
pub(crate) mod x86;

pub(crate) use vector::{F32x8, F32x16, LANE_BITS, LANES, LastEight, Row, Vector};

/// Three vectors of two halves each.
#[inline(always)]
pub(crate) fn three_of_two<W: F32x16>(first: &[W::Half; 3], second: &[W::Half; 3]) -> [W; 3] {
    [W::of_two(first[0], second[0]), W::of_two(first[1], second[1]), W::of_two(first[2], second[2])]
}

/// The same reference, opaque to the compiler. Otherwise it hoists the loads of a ray out of a loop, into more values
/// than there are registers, and spills them.
#[inline(always)]
pub(crate) fn opaque<T>(value: &T) -> &T {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        let mut place: *const T = value;
        // SAFETY: the assembly is empty, so the pointer still points to `value`.
        unsafe {
            std::arch::asm!("/* {0} */", inout(reg) place, options(readonly, nostack, preserves_flags));
            &*place
        }
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    value
}

/// The same number, opaque to the compiler. It keeps a predictable branch from becoming a data dependency, and keeps
/// expressions of the number in the order in which they are written.
#[inline(always)]
pub(crate) fn opaque_number(number: u32) -> u32 {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        let mut same = number;
        // SAFETY: the assembly is empty.
        unsafe {
            std::arch::asm!("/* {0:e} */", inout(reg) same, options(nomem, nostack, preserves_flags));
        }
        same
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    number
}

/// Prefetches a value into the L1 cache, if the instruction set has an instruction for it.
#[inline(always)]
pub(crate) fn fetch<T>(value: &T) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    for line in 0..size_of::<T>().div_ceil(64) {
        let start: *const T = value;
        // SAFETY: SSE is always there, and a prefetch reads nothing that the program could notice.
        unsafe {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(start.cast::<i8>().wrapping_add(64 * line));
        }
    }
    #[cfg(all(target_arch = "aarch64", not(miri)))]
    for line in 0..size_of::<T>().div_ceil(64) {
        let start: *const T = value;
        let start = start.cast::<i8>().wrapping_add(64 * line);
        // SAFETY: a prefetch reads nothing that the program could notice.
        unsafe {
            std::arch::asm!("prfm pldl1keep, [{0}]", in(reg) start, options(readonly, nostack, preserves_flags));
        }
    }
    #[cfg(not(all(any(target_arch = "aarch64", target_arch = "x86_64"), not(miri))))]
    let _ = value;
}
