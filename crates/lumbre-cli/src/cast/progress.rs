//! How far the rays are, on a terminal.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::units::spoken;

/// A line on standard error, if that is a terminal.
pub(super) struct Progress {
    line: Option<ProgressBar>,
    start: Instant,
}

impl Progress {
    /// Shows nothing yet, or never anything.
    pub(super) fn new(quiet: bool) -> Self {
        let line = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let line = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            line.with_style(
                ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_bar()),
            )
        });
        Self { line, start: Instant::now() }
    }

    /// Shows that so many rays are done, which are this share of all, if that is known.
    pub(super) fn show(&self, rays: u64, share: Option<f64>) {
        if let Some(line) = &self.line {
            line.set_message(words(rays, share, self.start.elapsed()));
        }
    }

    /// Clears the line.
    pub(super) fn finish(&self) {
        if let Some(line) = &self.line {
            line.finish_and_clear();
        }
    }
}

fn words(rays: u64, share: Option<f64>, elapsed: Duration) -> String {
    let seconds = elapsed.as_secs_f64();
    let rate = rays as f64 / seconds.max(1e-3);
    let mut words = format!("{:.1} million rays, {:.2} million/s", rays as f64 / 1e6, rate / 1e6);
    if let Some(share) = share.filter(|share| 0.0 < *share && *share <= 1.0)
        && let Ok(left) = Duration::try_from_secs_f64(seconds / share - seconds)
    {
        words += &format!(", {:.0} %, {} left", 100.0 * share, spoken(left));
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_said_where_the_share_is_known() {
        let elapsed = Duration::from_secs(20);
        assert_eq!(
            words(30_000_000, Some(0.25), elapsed),
            "30.0 million rays, 1.50 million/s, 25 %, 60 s left"
        );
        assert_eq!(words(30_000_000, None, elapsed), "30.0 million rays, 1.50 million/s");
    }
}
