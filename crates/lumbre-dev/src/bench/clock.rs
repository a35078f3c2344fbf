//! How long work took, as little as possible of other programs on the machine in it.
//!
//! Linux says how long each thread ran, not counting the time that it waited for a processor; where nobody says that,
//! the time of the clock on the wall is taken.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A point in the time of a thread, or of all threads of the program.
pub(crate) struct Start {
    wall: Instant,
    /// Of every thread by its entry in `/proc`; none where nobody says.
    ran: HashMap<PathBuf, f64>,
}

/// The seconds that a thread ran, from its entry in `/proc`.
fn ran(task: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(task.join("schedstat")).ok()?;
    let nanoseconds: f64 = text.split_ascii_whitespace().next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}

fn thread_ran() -> HashMap<PathBuf, f64> {
    // The count of a running thread is brought up to date when it gives way.
    std::thread::yield_now();
    let task = PathBuf::from("/proc/thread-self");
    ran(&task).map(|seconds| (task, seconds)).into_iter().collect()
}

fn program_ran() -> HashMap<PathBuf, f64> {
    std::thread::yield_now();
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return HashMap::new() };
    tasks.flatten().filter_map(|task| Some((task.path(), ran(&task.path())?))).collect()
}

impl Start {
    /// Of the calling thread.
    pub(crate) fn of_thread() -> Self {
        let ran = thread_ran();
        Self { wall: Instant::now(), ran }
    }

    /// Of all threads together. One that ends before it is read is none of the work's.
    pub(crate) fn of_program() -> Self {
        let ran = program_ran();
        Self { wall: Instant::now(), ran }
    }

    /// The seconds that the calling thread ran since [`Start::of_thread`].
    pub(crate) fn thread_seconds(&self) -> f64 {
        self.seconds(thread_ran)
    }

    /// The seconds that the work of this many threads took since [`Start::of_program`]: of one thread, what all ran
    /// together, but no more than the clock says, for threads that are done may wait busily for a while; of more, what
    /// the clock says, for one may wait for another.
    pub(crate) fn program_seconds(&self, threads: usize) -> f64 {
        let wall = self.wall.elapsed().as_secs_f64();
        if threads == 1 { self.seconds(program_ran).min(wall) } else { wall }
    }

    fn seconds(&self, ran: fn() -> HashMap<PathBuf, f64>) -> f64 {
        let wall = self.wall.elapsed().as_secs_f64();
        let since = |(task, end): (PathBuf, f64)| end - self.ran.get(&task).copied().unwrap_or(0.0);
        let all: f64 = ran().into_iter().map(since).sum();
        if self.ran.is_empty() || all <= 0.0 { wall } else { all }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn work_counts() {
        let (wall, start) = (Instant::now(), Start::of_thread());
        let mut sum = 0_u64;
        while wall.elapsed() < Duration::from_millis(50) {
            sum = sum.wrapping_add(std::hint::black_box(7));
        }
        let seconds = start.thread_seconds();
        assert!(sum > 0 && seconds > 0.002 && seconds <= wall.elapsed().as_secs_f64(), "{seconds}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn sleep_does_not_count() {
        let start = Start::of_thread();
        std::thread::sleep(Duration::from_millis(80));
        assert!(start.thread_seconds() < 0.04);
    }
}
