//! How much a build in Rust allocates.

use anyhow::Result;
use peak_alloc::PeakAlloc;

use crate::clock::Start;
use crate::program::Bytes;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// Runs what asks for builds on so many threads where it is to be measured: for one thread, on one that is all that there is. So it
/// is the same for every program, whose code and data then are where it last ran.
pub fn asking<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T> {
    if threads != 1 || rayon::current_num_threads() == 1 {
        return Ok(work());
    }
    // A thread that has joined a pool never leaves it.
    std::thread::scope(|scope| {
        let asking = scope.spawn(|| {
            let _pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
            Ok(work())
        });
        asking.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Runs a build on so many threads, with the seconds and the bytes that it took. One thread alone is that which asks for it, as it
/// is with Embree, so that none has to wake another before the work begins. As many as the machine has are those that every
/// program has: it is for the build to hand its work to them, if there is enough of it.
pub fn measure<T: Send>(threads: usize, build: impl FnOnce() -> T + Send) -> Result<(T, f64, Bytes)> {
    if threads == rayon::current_num_threads() {
        // The threads are there before the clock starts.
        rayon::broadcast(|_| ());
        return Ok(measure_here(threads, build));
    }
    if threads == 1 {
        return asking(1, || measure_here(1, build));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    pool.broadcast(|_| ());
    Ok(measure_here(threads, || pool.install(build)))
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
