//! The threads that scenes are read and built on.

use std::sync::RwLock;

/// Starts as many as there are cores, or as the system grants: at the limit of a user's processes (`ulimit -u`) it refuses
/// them. Without any the calling thread does the work.
pub(crate) fn start() {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    // A pool that fails to start cannot be started again, so that what it would get is tried out first.
    let granted = count_granted(cores);
    let pool = rayon::ThreadPoolBuilder::new();
    let started = if granted == cores {
        pool.build_global()
    } else {
        // One is left to watch for signals, and as many as here to render.
        match granted.saturating_sub(1) / 2 {
            0 => pool.num_threads(1).use_current_thread().build_global(),
            count => pool.num_threads(count).build_global(),
        }
    };
    if let Err(e) = started {
        say!("warning: threads: {e}");
    }
}

/// How many threads there can be at a time, up to `most`.
fn count_granted(most: usize) -> usize {
    let gate = RwLock::new(());
    std::thread::scope(|scope| {
        let closed = gate.write();
        let wait = || drop(gate.read());
        let granted =
            (0..most).take_while(|_| std::thread::Builder::new().spawn_scoped(scope, wait).is_ok()).count();
        drop(closed);
        granted
    })
}
