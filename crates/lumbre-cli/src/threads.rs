//! The threads that scenes are read and built on.

use std::sync::RwLock;

use crate::memory::address_space_left;

/// Address space that a thread takes: its stack, and what the allocator sets apart for it.
const ADDRESS_SPACE: u64 = 72 << 20;

/// Starts one per core, or as many as the system grants: at the limit of a user's processes (`ulimit -u`) it refuses
/// them. Without any the calling thread does the work. Where it limits the address space (`ulimit -v`), they take no
/// more than a quarter of it, and the same number to render.
pub(crate) fn start() {
    let cores = cores();
    let fit = address_space_left().map_or(cores, |left| (left / (4 * ADDRESS_SPACE)) as usize);
    // A pool that fails to start cannot be started again, so that what it would get is tried out first.
    let granted = count_granted(cores.min(fit));
    let pool = rayon::ThreadPoolBuilder::new();
    let started = if granted == cores {
        pool.build_global()
    } else {
        // One is left to watch for signals, and the same number to render.
        match granted.saturating_sub(1) / 2 {
            0 => pool.num_threads(1).use_current_thread().build_global(),
            count => pool.num_threads(count).build_global(),
        }
    };
    if let Err(e) = started {
        say!("warning: threads: {e}");
    }
}

/// How many fewer there are than cores, unless the environment says how many there are to be.
pub(crate) fn refused() -> usize {
    let is_asked_for = std::env::var_os("RAYON_NUM_THREADS").is_some();
    if is_asked_for { 0 } else { cores().saturating_sub(rayon::current_num_threads()) }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
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
