//! Signals that end the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use lumbre::CancelToken;

/// SIGINT and SIGTERM: the first asks the work to end, a second interrupt ends the program.
pub(crate) struct Signals {
    last: Arc<AtomicUsize>,
}

impl Signals {
    /// Listens from now on.
    ///
    /// # Errors
    /// Those of the system.
    pub(crate) fn listen(cancel: &CancelToken) -> std::io::Result<Self> {
        let last = Arc::new(AtomicUsize::new(0));
        let again = Arc::new(AtomicBool::new(false));
        for (signal, status) in [(signal_hook::consts::SIGINT, 130), (signal_hook::consts::SIGTERM, 143)] {
            signal_hook::flag::register_conditional_shutdown(signal, status, again.clone())?;
            signal_hook::flag::register(signal, again.clone())?;
            signal_hook::flag::register_usize(signal, last.clone(), status as usize)?;
        }
        let (seen, cancel) = (last.clone(), cancel.clone());
        // A signal handler may do almost nothing, so a thread forwards the signal.
        std::thread::spawn(move || {
            while seen.load(Ordering::Relaxed) == 0 {
                std::thread::sleep(Duration::from_millis(20));
            }
            cancel.cancel();
        });
        Ok(Self { last })
    }

    /// The exit status of the received signal, if any.
    pub(crate) fn received(&self) -> Option<u8> {
        u8::try_from(self.last.load(Ordering::Relaxed)).ok().filter(|status| *status != 0)
    }
}
