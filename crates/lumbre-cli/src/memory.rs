//! What fits into memory, as far as it can be told before work begins.

use std::fs;

use lumbre::formats::Limits;

use crate::failure::Failure;

/// The memory that the program may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Memory {
    /// Bytes from now on.
    left: u64,
    /// Whether the system sets this limit, not an option.
    is_systems: bool,
}

/// What is not accounted for: threads and their stacks, and the program itself.
const RESERVE: u64 = 64 << 20;

impl Memory {
    /// As much as `--max-memory` lets it take, or by default [`Limits::memory`]; but no more than the system grants (`ulimit -v`).
    pub(crate) fn new(most: Option<u64>) -> Self {
        let most = most.unwrap_or(Limits::default().memory);
        match address_space_left() {
            Some(left) if left < most => Self { left, is_systems: true },
            _ => Self { left: most, is_systems: false },
        }
    }

    /// The bytes that reading may account for.
    pub(crate) fn for_reading(self) -> u64 {
        // Allocators take more of the address space than they are asked for.
        if self.is_systems { self.left.saturating_sub(RESERVE) / 4 * 3 } else { self.left }
    }

    /// The failure of a reader, with what else there is to know of the limit that it met.
    pub(crate) fn explain(self, failure: Failure) -> Failure {
        match failure {
            Failure::Limit(message) => Failure::Limit(message + self.remark()),
            failure => failure,
        }
    }

    fn remark(self) -> &'static str {
        if self.is_systems { " (but the system grants no more: see ulimit -v)" } else { "" }
    }

    /// Refuses what needs more than is left beside `held` bytes.
    ///
    /// # Errors
    /// [`Failure::Limit`] with the prediction.
    pub(crate) fn check(self, what: &str, needed: u64, held: u64) -> Result<(), Failure> {
        // What is held is taken from the address space already.
        let left = if self.is_systems { self.for_reading() } else { self.left.saturating_sub(held) };
        if needed <= left {
            return Ok(());
        }
        let raise = format!("raise it with --max-memory{}", self.remark());
        Err(Failure::Limit(format!("{what}: needs {needed} bytes of memory, {left} are left; {raise}")))
    }
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
        let memory = Memory { left: 1000, is_systems: false };
        assert!(memory.check("the picture", 700, 300).is_ok());
        let message = memory.check("the picture", 701, 300).unwrap_err().to_string();
        assert_eq!(
            message,
            "the picture: needs 701 bytes of memory, 700 are left; raise it with --max-memory"
        );
        // The system counts what is held itself.
        let memory = Memory { left: RESERVE + 1000, is_systems: true };
        assert!(memory.check("the tree", 750, 5000).is_ok());
        let message = memory.check("the tree", 751, 0).unwrap_err().to_string();
        assert!(message.contains("ulimit -v"), "{message}");
    }
}
