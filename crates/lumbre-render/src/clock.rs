//! The progress of a render towards the limit that comes first.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use web_time::Instant;

use crate::{Progress, State, Stop};

/// Time between two reports.
const REPORT_EVERY: Duration = Duration::from_millis(100);

/// Counts samples, and reports progress at intervals.
pub(crate) struct Clock<'a> {
    start: Instant,
    /// The time from the start to the first sample.
    prepared: Duration,
    pixels: u64,
    stop: Stop,
    done: AtomicU64,
    /// Rays of this run.
    rays: AtomicU64,
    /// Samples of an earlier run.
    before: u64,
    /// Samples a pixel at which the noise is expected to be low enough, as the bits of an f64; infinite before it is
    /// known.
    quiet_at: AtomicU64,
    last: Mutex<Instant>,
    progress: &'a dyn Progress,
}

impl<'a> Clock<'a> {
    /// A clock of a render: its pixels, the samples of an earlier run, and the time that its preparation took.
    pub(crate) fn new(
        start: Instant,
        prepared: Duration,
        pixels: u64,
        stop: Stop,
        before: u64,
        progress: &'a dyn Progress,
    ) -> Self {
        let never = AtomicU64::new(f64::INFINITY.to_bits());
        Self {
            start,
            prepared,
            pixels,
            stop,
            done: AtomicU64::new(before),
            rays: AtomicU64::new(0),
            before,
            quiet_at: never,
            last: Mutex::new(start),
            progress,
        }
    }

    /// Sets the number of samples per pixel at which the noise target is expected to be met.
    pub(crate) fn expect_quiet_at(&self, spp: f64) {
        self.quiet_at.store(spp.to_bits(), Ordering::Relaxed);
    }

    /// Counts samples, and the rays that they took.
    pub(crate) fn add(&self, samples: u64, rays: u64) {
        self.rays.fetch_add(rays, Ordering::Relaxed);
        let done = self.done.fetch_add(samples, Ordering::Relaxed) + samples;
        // If another thread is reporting, this one continues its work.
        let Ok(mut last) = self.last.try_lock() else { return };
        let now = Instant::now();
        if now.duration_since(*last) < REPORT_EVERY {
            return;
        }
        *last = now;
        self.progress.state(&self.state(done, now.duration_since(self.start)));
    }

    fn state(&self, done: u64, elapsed: Duration) -> State {
        let samples = done as f64;
        let pixels = self.pixels as f64;
        let of_noise = samples / (f64::from_bits(self.quiet_at.load(Ordering::Relaxed)) * pixels);
        let of_spp = samples / (f64::from(self.stop.spp) * pixels);
        let of_time =
            self.stop.time.map_or(0.0, |time| (elapsed.as_secs_f64() / time.as_secs_f64()).min(1.0));
        // A render without a limit of its own for the number of samples has the largest.
        let counts = self.stop.spp < u32::MAX || (self.stop.time.is_none() && self.stop.noise.is_none());
        let share = of_noise.max(of_time).max(if counts { of_spp } else { 0.0 }).clamp(0.0, 1.0);
        let is_known = share > 0.0;
        // The share of this run.
        let own = share * (samples - self.before as f64) / samples;
        let left = match self.stop.time {
            Some(time) if of_time >= share => Some(time.saturating_sub(elapsed)),
            _ if is_known && own > 0.0 => {
                let worked = elapsed.saturating_sub(self.prepared).as_secs_f64();
                Duration::try_from_secs_f64(worked * (1.0 - share) / own).ok()
            }
            _ => None,
        };
        let total = match counts && of_spp >= share {
            true => Some(self.pixels.saturating_mul(u64::from(self.stop.spp))),
            false => is_known.then(|| ((samples / share) as u64).max(done)),
        };
        State { samples: done, rays: self.rays.load(Ordering::Relaxed), total, share, elapsed, left }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoProgress;

    fn state(stop: Stop, quiet_at: Option<f64>, done: u64, elapsed: u64) -> State {
        let clock = Clock::new(Instant::now(), Duration::ZERO, 200, stop, 0, &NoProgress);
        quiet_at.into_iter().for_each(|spp| clock.expect_quiet_at(spp));
        clock.state(done, Duration::from_secs(elapsed))
    }

    #[test]
    fn what_is_left_is_that_to_whichever_limit_comes_first() {
        let (time, noise) = (Some(Duration::from_secs(8)), Some(0.02));
        let endless = u32::MAX;
        for (spp, time, noise, quiet_at, expected) in [
            // 400 samples of 200 pixels after 2 s.
            (8, None, None, None, (0.25, Some(1600), Some(6))),
            (endless, time, None, None, (0.25, Some(1600), Some(6))),
            (8, Some(Duration::from_secs(4)), None, None, (0.5, Some(800), Some(2))),
            (4, time, None, None, (0.5, Some(800), Some(2))),
            (endless, None, noise, None, (0.0, None, None)),
            (endless, None, noise, Some(10.0), (0.2, Some(2000), Some(8))),
            (endless, time, noise, Some(10.0), (0.25, Some(1600), Some(6))),
            (endless, time, noise, Some(5.0), (0.4, Some(1000), Some(3))),
        ] {
            let state = state(Stop { spp, time, noise, min_spp: None }, quiet_at, 400, 2);
            let (share, total, left) = expected;
            assert_eq!((state.share, state.total), (share, total), "{state:?}");
            assert_eq!(state.left.map(|left| left.as_secs()), left, "{state:?}");
        }
        // Over time and beyond the expected noise, it is at its end.
        let late = state(Stop { spp: endless, time, noise, min_spp: None }, Some(1.0), 400, 9);
        assert_eq!((late.share, late.total, late.left), (1.0, Some(400), Some(Duration::ZERO)));
    }

    #[test]
    fn what_came_before_the_first_sample_is_no_measure_of_samples() {
        let stop = Stop { noise: Some(0.02), ..Stop::at(1 << 20) };
        let clock = Clock::new(Instant::now(), Duration::from_secs(6), 200, stop, 0, &NoProgress);
        clock.expect_quiet_at(10.0);
        // 400 of 2000 samples in 2 s.
        let state = clock.state(400, Duration::from_secs(8));
        assert_eq!((state.share, state.left), (0.2, Some(Duration::from_secs(8))));
    }

    #[test]
    fn what_an_earlier_run_took_is_no_work_of_this_one() {
        let stop = Stop::at(8);
        let clock = Clock::new(Instant::now(), Duration::ZERO, 200, stop, 400, &NoProgress);
        // 800 of 1600 samples, 400 of them in 2 s: the same number is left twice.
        let state = clock.state(800, Duration::from_secs(2));
        assert_eq!((state.share, state.left), (0.5, Some(Duration::from_secs(4))));
    }
}
