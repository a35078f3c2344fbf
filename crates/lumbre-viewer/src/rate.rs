//! How many messages a client may send.

use std::time::Instant;

/// Maximum burst of messages.
const BURST: f64 = 400.0;
/// Sustained messages a second. The page merges the events of fast mice, once per frame.
const PER_SECOND: f64 = 200.0;

/// A client's remaining budget.
#[derive(Debug)]
pub(crate) struct Allowance {
    left: f64,
    last: Instant,
}

impl Allowance {
    /// The full budget.
    pub(crate) fn new(now: Instant) -> Self {
        Self { left: BURST, last: now }
    }

    /// Counts one message; returns whether it may be answered.
    pub(crate) fn take(&mut self, now: Instant) -> bool {
        let earned = now.saturating_duration_since(self.last).as_secs_f64() * PER_SECOND;
        self.left = (self.left + earned).min(BURST) - 1.0;
        self.last = now;
        self.left >= 0.0
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn bursts_pass_and_floods_do_not() {
        let mut now = Instant::now();
        let mut allowance = Allowance::new(now);
        assert!((0..400).all(|_| allowance.take(now)));
        assert!(!allowance.take(now));
        let mut steady = Allowance::new(now);
        for _ in 0..2000 {
            now += Duration::from_millis(6);
            assert!(steady.take(now));
        }
        let taken = (0..2000).filter(|_| {
            now += Duration::from_millis(1);
            steady.take(now)
        });
        assert!(taken.count() < 900);
    }
}
