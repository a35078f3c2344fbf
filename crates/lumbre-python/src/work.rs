//! Threads for what Python asks: without the interpreter's lock, interruptible, and usable after a fork.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Between two looks whether Ctrl-C was pressed.
const INTERVAL: Duration = Duration::from_millis(40);

/// The threads, and the process that they are of.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Asks work to end soon, without an answer.
#[derive(Debug, Default)]
pub(crate) struct Stop(AtomicBool);

impl Stop {
    /// Whether to end.
    pub(crate) fn is_asked_for(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// One thread per core, or `RAYON_NUM_THREADS`. A fork has the memory of its parent, but none of its threads, so that
/// it gets a pool of its own.
pub(crate) fn pool() -> PyResult<Arc<ThreadPool>> {
    let mut slot = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((owner, pool)) = &*slot
        && *owner == process::id()
    {
        return Ok(Arc::clone(pool));
    }
    let cannot = |e| PyRuntimeError::new_err(format!("threads: {e}"));
    let pool = Arc::new(ThreadPoolBuilder::new().build().map_err(cannot)?);
    // Those of the parent would be waited for in vain.
    std::mem::forget(slot.replace((process::id(), Arc::clone(&pool))));
    Ok(pool)
}

/// Does work on the pool, without the interpreter's lock. What Ctrl-C raises ends it, and is returned once it has
/// ended; so is what `meanwhile` raises, which is called now and then on the calling thread.
pub(crate) fn interruptible<R: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Stop) -> R + Send,
    mut meanwhile: impl FnMut(Python<'_>) -> PyResult<()> + Send,
) -> PyResult<R> {
    let pool = pool()?;
    let stop = Stop::default();
    py.detach(|| {
        let (done, waits) = mpsc::channel();
        let mut raised = None;
        let mut answer = None;
        let stop = &stop;
        pool.in_place_scope(|scope| {
            scope.spawn(move |_| {
                // The receiver is there until the scope ends.
                drop(done.send(work(stop)));
            });
            loop {
                match waits.recv_timeout(INTERVAL) {
                    Ok(found) => {
                        answer = Some(found);
                        break;
                    }
                    Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                        let look = |py: Python<'_>| py.check_signals().and_then(|()| meanwhile(py));
                        raised = Python::attach(look).err();
                        if raised.is_some() {
                            stop.ask();
                        }
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    // It panicked: the end of the scope goes on with that.
                    Err(RecvTimeoutError::Disconnected) => break,
                }
            }
        });
        match (raised, answer) {
            (Some(raised), _) => Err(raised),
            (None, Some(answer)) => Ok(answer),
            (None, None) => Err(PyRuntimeError::new_err("the work ended without an answer")),
        }
    })
}

/// How many threads work on a query.
///
/// # Errors
/// `RuntimeError` where the system grants none.
#[pyfunction]
pub(crate) fn thread_count() -> PyResult<usize> {
    Ok(pool()?.current_num_threads())
}

/// Panics on a thread of the pool, which tests what becomes of that.
#[pyfunction]
pub(crate) fn panic_on_purpose(py: Python<'_>) -> PyResult<()> {
    interruptible(py, |_| panic!("on purpose"), |_| Ok(()))
}

/// Bytes of memory that are left for what is asked for next.
#[pyfunction]
pub(crate) fn memory_left() -> u64 {
    lumbre_cli::memory_left()
}
