//! What fits into memory, as far as it can be told before work begins.

use std::fs;

use lumbre::formats::Limits;

use crate::failure::Failure;

/// The memory that the program may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Memory {
    /// Bytes.
    most: u64,
    bound: Bound,
}

/// What sets the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bound {
    /// `--max-memory`, for all that is held.
    Flag,
    /// The memory that is free, from now on.
    Machine,
    /// `ulimit -v`, from now on.
    AddressSpace,
}

/// What is not accounted for: threads and their stacks, and the program itself.
const RESERVE: u64 = 64 << 20;

impl Memory {
    /// As much as `--max-memory` lets it take, or by default what is free; but no more than the system grants (`ulimit -v`).
    pub(crate) fn new(flag: Option<u64>) -> Self {
        let memory = match (flag, available_memory()) {
            (Some(most), _) => Self { most, bound: Bound::Flag },
            (None, Some(most)) => Self { most, bound: Bound::Machine },
            (None, None) => Self { most: Limits::default().memory, bound: Bound::Flag },
        };
        match address_space_left() {
            Some(most) if most < memory.most => Self { most, bound: Bound::AddressSpace },
            _ => memory,
        }
    }

    /// The bytes that reading may account for: by default [`Limits::memory`], as files may be anyone's.
    pub(crate) fn for_reading(self) -> u64 {
        match self.bound {
            Bound::Flag => self.most,
            Bound::Machine => self.most.min(Limits::default().memory),
            Bound::AddressSpace => self.usable().min(Limits::default().memory),
        }
    }

    /// Allocators take more of the address space than they are asked for.
    fn usable(self) -> u64 {
        self.most.saturating_sub(RESERVE) / 4 * 3
    }

    /// The failure of a reader, with what else there is to know of the limit that it met.
    pub(crate) fn explain(self, failure: Failure) -> Failure {
        match failure {
            Failure::Limit(message) => Failure::Limit(message + self.remark()),
            failure => failure,
        }
    }

    fn remark(self) -> &'static str {
        match self.bound {
            Bound::AddressSpace => " (but the system grants no more: see ulimit -v)",
            Bound::Flag | Bound::Machine => "",
        }
    }

    /// Refuses what needs more than is left beside `held` bytes.
    ///
    /// # Errors
    /// [`Failure::Limit`] with the prediction.
    pub(crate) fn check(self, what: &str, needed: u64, held: u64) -> Result<(), Failure> {
        let left = match self.bound {
            Bound::Flag => self.most.saturating_sub(held),
            // What is held is not counted any more.
            Bound::Machine => self.most,
            Bound::AddressSpace => self.usable(),
        };
        if needed <= left {
            return Ok(());
        }
        let raise = format!("raise it with --max-memory{}", self.remark());
        Err(Failure::Limit(format!("{what}: needs {needed} bytes of memory, {left} are left; {raise}")))
    }
}

/// Bytes of memory that are free, or can be made so; `None` if the system does not tell.
fn available_memory() -> Option<u64> {
    let memory = fs::read_to_string("/proc/meminfo").ok()?;
    let kibibytes = |name: &str| {
        let value = memory.lines().find_map(|line| line.strip_prefix(name))?;
        value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
    };
    let swap = kibibytes("SwapFree:").unwrap_or(0);
    Some(kibibytes("MemAvailable:")?.saturating_add(swap).saturating_mul(1024))
}

/// Bytes of address space that the system still grants the process; `None` if it sets no limit, or does not tell.
pub(crate) fn address_space_left() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let soft = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let soft: u64 = soft.split_whitespace().next()?.parse().ok()?;
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let size = status.lines().find_map(|line| line.strip_prefix("VmSize:"))?;
    let size: u64 = size.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(soft.saturating_sub(size * 1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_the_prediction_and_the_option() {
        let memory = Memory { most: 1000, bound: Bound::Flag };
        assert!(memory.check("the picture", 700, 300).is_ok());
        let message = memory.check("the picture", 701, 300).unwrap_err().to_string();
        assert_eq!(
            message,
            "the picture: needs 701 bytes of memory, 700 are left; raise it with --max-memory"
        );
        // The system counts what is held itself.
        let memory = Memory { most: 1000, bound: Bound::Machine };
        assert!(memory.check("the tree", 1000, 5000).is_ok() && memory.check("the tree", 1001, 0).is_err());
        let memory = Memory { most: RESERVE + 1000, bound: Bound::AddressSpace };
        assert!(memory.check("the tree", 750, 5000).is_ok());
        let message = memory.check("the tree", 751, 0).unwrap_err().to_string();
        assert!(message.contains("ulimit -v"), "{message}");
    }
}
