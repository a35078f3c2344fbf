//! How much a build in Rust allocates.

use anyhow::Result;
use peak_alloc::PeakAlloc;

use crate::clock::Start;
use crate::program::Bytes;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// Runs builds from a thread of the pool, as Embree does: it takes part in the work, and waits for none to wake
/// up before that begins. So it is the same for every program, whose code and data then are where it last ran.
pub(crate) fn asking<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T> {
    if rayon::current_thread_index().is_some() && rayon::current_num_threads() == threads {
        return Ok(work());
    }
    // A thread that has joined a pool never leaves it.
    std::thread::scope(|scope| {
        let asking = scope.spawn(|| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build()?;
            // The threads are there before any clock starts.
            pool.broadcast(|_| ());
            Ok(work())
        });
        asking.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Runs a build on this many threads, with the seconds and the bytes that it took.
pub(crate) fn measure<T: Send>(threads: usize, build: impl FnOnce() -> T + Send) -> Result<(T, f64, Bytes)> {
    asking(threads, || measure_here(threads, build))
}

fn measure_here<T>(threads: usize, build: impl FnOnce() -> T) -> (T, f64, Bytes) {
    let before = HEAP.current_usage();
    HEAP.reset_peak_usage();
    let start = Start::of_program();
    let built = build();
    let seconds = start.program_seconds(threads);
    let bytes = Bytes {
        kept: HEAP.current_usage().saturating_sub(before),
        peak: HEAP.peak_usage().saturating_sub(before),
    };
    (built, seconds, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_and_what_is_dropped_are_told_apart() {
        let (kept, _, bytes) = measure(2, || {
            let scratch = vec![1_u8; 300_000_000];
            vec![scratch[17]; 100_000_000]
        })
        .expect("a pool of threads");
        assert_eq!(kept.len(), 100_000_000);
        // Other tests allocate and free some megabytes at the same time.
        assert!((70_000_000..130_000_000).contains(&bytes.kept), "{bytes:?}");
        assert!((370_000_000..430_000_000).contains(&bytes.peak), "{bytes:?}");
    }
}
