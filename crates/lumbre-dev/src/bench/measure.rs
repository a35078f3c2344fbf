//! Running programs in alternation, and what their ratios say.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Barrier, Mutex};
use std::time::{Duration, Instant};

use crate::clock::Start;
use crate::program::{Pass, Query, Tree};
use crate::rays::Ray32;

/// Rays that a thread takes at a time.
const CHUNK: usize = 4_096;

/// The rays of a work, cut for threads, in the form of one program.
pub(crate) struct Job<'a> {
    passes: Vec<Mutex<Box<dyn Pass + 'a>>>,
    rays: usize,
}

impl<'a> Job<'a> {
    /// Hands the rays to a program.
    pub(crate) fn new(tree: &'a dyn Tree, query: Query, rays: &[Ray32]) -> Self {
        let passes = rays.chunks(CHUNK).map(|chunk| Mutex::new(tree.prepare(query, chunk))).collect();
        Self { passes, rays: rays.len() }
    }

    /// Traces every ray once on this many threads; answers the seconds that a thread ran, in the mean.
    pub(crate) fn run(&mut self, threads: usize) -> f64 {
        for pass in &mut self.passes {
            pass.get_mut().expect("no pass panics").reset();
        }
        let (next, barrier) = (AtomicUsize::new(0), Barrier::new(threads));
        let work = || {
            barrier.wait();
            let start = Start::of_thread();
            while let Some(pass) = self.passes.get(next.fetch_add(1, Ordering::Relaxed)) {
                pass.lock().expect("no pass panics").run();
            }
            start.thread_seconds()
        };
        std::thread::scope(|scope| {
            let others: Vec<_> = (1..threads).map(|_| scope.spawn(work)).collect();
            let own = work();
            let all = others.into_iter().map(|other| other.join().expect("no pass panics")).chain([own]);
            // Where threads had unequal parts of the processors, they took unequal parts of the work.
            all.sum::<f64>() / threads as f64
        })
    }

    /// What the last run found for each ray.
    pub(crate) fn answers(&self) -> Vec<Option<f64>> {
        self.passes.iter().flat_map(|pass| pass.lock().expect("no pass panics").answers()).collect()
    }

    /// Millions of rays a second.
    pub(crate) fn speed(&self, seconds: f64) -> f64 {
        self.rays as f64 / seconds / 1e6
    }
}

/// Runs tasks one after another, in turn forwards and backwards, at least `least` rounds, and then until the time is
/// up, at most fifteen; past the deadline one round is enough. Answers the seconds of every task in every round.
pub(crate) fn alternate<E>(
    tasks: usize,
    least: usize,
    time: Duration,
    deadline: Option<Instant>,
    mut run: impl FnMut(usize) -> Result<f64, E>,
) -> Result<Vec<Vec<f64>>, E> {
    let start = Instant::now();
    let mut rounds: Vec<Vec<f64>> = Vec::new();
    let is_late = || deadline.is_some_and(|deadline| Instant::now() > deadline);
    while rounds.is_empty()
        || (!is_late() && (rounds.len() < least || (rounds.len() < 15 && start.elapsed() < time)))
    {
        let mut seconds = vec![0.0; tasks];
        let is_forwards = rounds.len().is_multiple_of(2);
        for turn in 0..tasks {
            let task = if is_forwards { turn } else { tasks - 1 - turn };
            seconds[task] = run(task)?;
        }
        rounds.push(seconds);
    }
    Ok(rounds)
}

/// The ratio of two measurements that were repeated side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ratio {
    /// The median of the ratios.
    pub median: f64,
    /// Half the distance between the first and the third quartile.
    pub spread: f64,
}

impl Ratio {
    /// Of `b` to `a`, round by round: more than 1 where `a` was smaller.
    pub(crate) fn of(pairs: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut ratios: Vec<_> = pairs.into_iter().map(|(a, b)| b / a).collect();
        ratios.sort_by(f64::total_cmp);
        Self {
            median: quantile(&ratios, 0.5),
            spread: 0.5 * (quantile(&ratios, 0.75) - quantile(&ratios, 0.25)),
        }
    }
}

/// The middle one.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<_> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    quantile(&values, 0.5)
}

/// Between the two nearest of a sorted list; NaN of an empty one.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (sorted[above] - sorted[below]) * (place - below as f64)
}

/// The geometric mean; NaN of an empty list.
pub(crate) fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|value| value.ln()).sum::<f64>() / values.len() as f64).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_disturbed_round_does_not_move_the_ratio() {
        let ratio = Ratio::of([(2.0, 3.0), (4.0, 6.0), (2.0, 90.0), (2.0, 3.2), (2.5, 3.5)]);
        assert!((ratio.median - 1.5).abs() < 1e-12, "{ratio:?}");
        assert!((ratio.spread - 0.05).abs() < 1e-12, "{ratio:?}");
    }

    #[test]
    fn rounds_go_forwards_and_backwards() {
        let mut order = Vec::new();
        let rounds = alternate(3, 3, Duration::ZERO, None, |task| {
            order.push(task);
            Ok::<_, ()>(task as f64 + 2.0)
        });
        assert_eq!(rounds, Ok(vec![vec![2.0, 3.0, 4.0]; 3]));
        assert_eq!(order, [0, 1, 2, 2, 1, 0, 0, 1, 2]);
    }

    #[test]
    fn the_mean_of_a_half_and_a_double_is_one() {
        assert!((geometric_mean(&[0.5, 2.0, 4.0, 0.25]) - 1.0).abs() < 1e-12);
        assert_eq!(median([7.0, 2.0, 4.0, 5.0]), 4.5);
    }

    #[test]
    fn threads_trace_every_ray() {
        struct Counting;
        struct CountingPass(usize, bool);
        impl Tree for Counting {
            fn prepare<'a>(&'a self, _: Query, rays: &[Ray32]) -> Box<dyn Pass + 'a> {
                Box::new(CountingPass(rays.len(), false))
            }
        }
        impl Pass for CountingPass {
            fn reset(&mut self) {
                self.1 = false;
            }
            fn run(&mut self) {
                self.1 = true;
            }
            fn answers(&self) -> Vec<Option<f64>> {
                vec![self.1.then_some(2.5); self.0]
            }
        }
        let ray = Ray32 { origin: [2.0; 3], direction: [3.0; 3], t_max: 4.0 };
        let mut job = Job::new(&Counting, Query::Closest, &vec![ray; 3 * CHUNK + 17]);
        assert!(job.run(3) > 0.0);
        assert_eq!(job.answers(), vec![Some(2.5); 3 * CHUNK + 17]);
    }
}
