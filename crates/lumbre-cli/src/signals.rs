//! Stops from outside, signals and deadlines, honoured wherever the program is.

use std::fs::File;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use lumbre::CancelToken;
use lumbre::formats::abandon_writes;
#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGUSR1, SIGXCPU};

use crate::failure::Failure;

/// What the program is doing, which says what becomes of a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// What leaves nothing to save, by what it is: a signal ends it at once. It has no deadline, for `--time` gives a
    /// picture, however coarse.
    Preparing(&'static str),
    /// As [`Phase::Preparing`], but of what someone else writes and may never end: [`RECEIVING_GRACE`].
    Receiving(&'static str),
    /// Rendering: it has [`GRACE`] to stop on its own, with the result so far.
    Rendering,
    /// Opening a pipe since this time, where no one may be to read: [`GRACE`].
    Opening(Instant),
    /// Writing to a pipe or a device: [`GRACE`] after a signal.
    Sending,
    /// Writing a whole picture to a file: it has [`SAVING_GRACE`].
    Saving,
}

/// How much later than its deadline the last byte of a pipe may come.
const RECEIVING_GRACE: Duration = Duration::from_secs(10);
/// How long a render may take to stop.
const GRACE: Duration = Duration::from_millis(1500);
/// How long a render may go without a sample after its deadline: its first, coarse picture is taken whatever the time,
/// but a sample may have no end.
const SAMPLE_GRACE: Duration = Duration::from_secs(10);
/// How long a picture that took its time to render may take to be saved. Who cannot wait sends another signal.
const SAVING_GRACE: Duration = Duration::from_secs(20);
/// Between two looks.
const INTERVAL: Duration = Duration::from_millis(10);
/// The exit status of a limit.
const LIMIT: i32 = 5;

/// What asks the program to end, with its exit status, and whether a second one means that it cannot wait: shells send
/// SIGHUP twice when a terminal is closed, schedulers SIGUSR1 as often as they like, and the system SIGXCPU every
/// second once the time of the processor (`ulimit -t`) is over.
#[cfg(unix)]
const SIGNALS: [(i32, u8, bool); 6] = [
    (SIGINT, 130, true),
    (SIGTERM, 143, true),
    (SIGQUIT, 131, true),
    (SIGHUP, 129, false),
    (SIGUSR1, 138, false),
    (SIGXCPU, 152, false),
];

/// The signals of [`SIGNALS`] that are handled: all but those that the parent process ignores, as nohup does with
/// SIGHUP. SIGINT and SIGTERM are always, as they were ever: shells ignore SIGINT for what runs in the background.
#[cfg(unix)]
fn wanted() -> impl Iterator<Item = (i32, u8, bool)> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored =
        status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    SIGNALS.into_iter().filter(move |&(signal, ..)| {
        let is_ignored = ignored.is_some_and(|mask| mask >> (signal - 1) & 1 == 1);
        matches!(signal, SIGINT | SIGTERM) || !is_ignored
    })
}

/// SIGINT, SIGTERM and their like ([`SIGNALS`]), and a deadline. The first signal asks the work to end, and ends the
/// program where that leaves nothing to save or takes too long; a second one ends it at once. The temporary files of
/// writes are removed, and no path holds a part of a file.
pub(crate) struct Signals {
    last: Arc<AtomicUsize>,
    state: Arc<Mutex<State>>,
}

struct State {
    phase: Phase,
    cancel: CancelToken,
    deadline: Option<Deadline>,
    /// How many samples a render has taken, and since when.
    samples: (u64, Instant),
}

/// A time by which the work has to end.
#[derive(Clone, Copy)]
pub(crate) struct Deadline {
    /// The time.
    pub at: Instant,
    /// How much there was.
    pub time: Duration,
}

impl Signals {
    /// Listens from now on, [`Phase::Preparing`].
    ///
    /// # Errors
    /// [`Failure::Io`] where the system does not let it.
    pub(crate) fn listen(cancel: &CancelToken) -> Result<Self, Failure> {
        Self::start(cancel).map_err(|e| Failure::Io(format!("cannot listen for signals: {e}")))
    }

    fn start(cancel: &CancelToken) -> std::io::Result<Self> {
        let last = Arc::new(AtomicUsize::new(0));
        let state = State {
            phase: Phase::Preparing("starting"),
            cancel: cancel.clone(),
            deadline: None,
            samples: (0, Instant::now()),
        };
        let signals = Self { last: last.clone(), state: Arc::new(Mutex::new(state)) };
        let (came, hurries) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        // A signal handler may do almost nothing, so a thread does it.
        let watcher = Watcher {
            came: came.clone(),
            hurries: hurries.clone(),
            last: last.clone(),
            state: signals.state.clone(),
        };
        let watches = std::thread::Builder::new().spawn(move || watcher.watch()).is_ok();
        register(watches, &last, &came, &hurries)?;
        Ok(signals)
    }

    /// The exit status of the received signal, if any.
    pub(crate) fn received(&self) -> Option<u8> {
        u8::try_from(self.last.load(Ordering::Relaxed)).ok().filter(|status| *status != 0)
    }

    /// Says how many samples a render has taken so far.
    pub(crate) fn took(&self, samples: u64) {
        let mut state = lock(&self.state);
        if samples != state.samples.0 {
            state.samples = (samples, Instant::now());
        }
    }

    /// Says what the program is doing from now on.
    pub(crate) fn enter(&self, phase: Phase) {
        lock(&self.state).phase = phase;
    }

    /// Opens a pipe to be written, if this is the name of one: nobody is waited for.
    ///
    /// # Errors
    /// [`Failure::Io`] where nobody reads from it.
    #[cfg(unix)]
    pub(crate) fn open_pipe(path: &Path) -> Result<Option<File>, Failure> {
        use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
        if !std::fs::metadata(path).is_ok_and(|meta| meta.file_type().is_fifo()) {
            return Ok(None);
        }
        const O_NONBLOCK: i32 = if cfg!(target_os = "linux") { 0o4000 } else { 4 };
        match File::options().write(true).custom_flags(O_NONBLOCK).open(path) {
            Ok(pipe) => Ok(Some(pipe)),
            Err(_) => Err(Failure::Io(format!("{}: nobody reads from this pipe", path.display()))),
        }
    }

    /// Pipes have no names elsewhere.
    ///
    /// # Errors
    /// None.
    #[cfg(not(unix))]
    pub(crate) fn open_pipe(_: &Path) -> Result<Option<File>, Failure> {
        Ok(None)
    }

    /// Ends the work at this time, in place of an earlier deadline.
    pub(crate) fn end_at(&self, deadline: Option<Deadline>) {
        lock(&self.state).deadline = deadline;
    }
}

/// Has the signals of [`SIGNALS`] leave their exit status in `last`, set `came`, and `hurries` if a second one cannot
/// wait.
#[cfg(unix)]
fn register(
    watches: bool,
    last: &Arc<AtomicUsize>,
    came: &Arc<AtomicBool>,
    hurries: &Arc<AtomicBool>,
) -> std::io::Result<()> {
    for (signal, status, may_hurry) in wanted() {
        let status = i32::from(status);
        if !watches {
            // Without a thread nothing can be removed or saved: the next run removes what is left.
            let at_once = Arc::new(AtomicBool::new(true));
            signal_hook::flag::register_conditional_shutdown(signal, status, at_once)?;
        }
        signal_hook::flag::register_usize(signal, last.clone(), status as usize)?;
        signal_hook::flag::register(signal, came.clone())?;
        if may_hurry {
            signal_hook::flag::register(signal, hurries.clone())?;
        }
    }
    Ok(())
}

/// The same for the events of a console of Windows, with the exit statuses of their like elsewhere: Ctrl-C, Ctrl-Break,
/// and the ends of the console, the session and the machine. After the latter three Windows ends the process within
/// seconds (five for a console), done or not. Without a watching thread nothing is registered, and any of them ends the
/// program at once.
#[cfg(windows)]
fn register(
    watches: bool,
    last: &Arc<AtomicUsize>,
    came: &Arc<AtomicBool>,
    hurries: &Arc<AtomicBool>,
) -> std::io::Result<()> {
    use tokio::signal::windows::{ctrl_break, ctrl_c, ctrl_close, ctrl_logoff, ctrl_shutdown};
    if !watches {
        return Ok(());
    }
    let runtime = tokio::runtime::Builder::new_current_thread().build()?;
    let (mut interrupt, mut stop) = (ctrl_c()?, ctrl_break()?);
    let (mut close, mut logoff, mut shutdown) = (ctrl_close()?, ctrl_logoff()?, ctrl_shutdown()?);
    let (last, came, hurries) = (last.clone(), came.clone(), hurries.clone());
    let listen = async move {
        loop {
            let (status, may_hurry) = tokio::select! {
                _ = interrupt.recv() => (130, true),
                _ = stop.recv() => (131, true),
                _ = close.recv() => (129, false),
                _ = logoff.recv() => (143, false),
                _ = shutdown.recv() => (143, false),
            };
            last.store(status, Ordering::Relaxed);
            hurries.store(may_hurry, Ordering::Relaxed);
            came.store(true, Ordering::Relaxed);
        }
    };
    std::thread::Builder::new().name("console".to_owned()).spawn(move || runtime.block_on(listen))?;
    Ok(())
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Watcher {
    /// A signal came.
    came: Arc<AtomicBool>,
    /// One came that ends the program at once where it is the second.
    hurries: Arc<AtomicBool>,
    last: Arc<AtomicUsize>,
    state: Arc<Mutex<State>>,
}

impl Watcher {
    fn watch(&self) {
        let mut first: Option<Instant> = None;
        let mut has_said = false;
        loop {
            std::thread::sleep(INTERVAL);
            let came = self.came.swap(false, Ordering::Relaxed);
            let hurries = self.hurries.swap(false, Ordering::Relaxed);
            // Held until the end, so that nothing begins meanwhile that is worth saving.
            let state = lock(&self.state);
            let status = i32::try_from(self.last.load(Ordering::Relaxed)).unwrap_or(130);
            match (first, came) {
                (None, true) => {
                    first = Some(Instant::now());
                    state.cancel.cancel();
                }
                (Some(_), true) if hurries => end(status),
                _ => {}
            }
            let elapsed = first.map(|at| at.elapsed());
            match (state.phase, elapsed) {
                (Phase::Preparing(_) | Phase::Receiving(_), Some(_)) => end(status),
                (Phase::Rendering, Some(elapsed)) if elapsed > GRACE => {
                    say!("error: the render takes too long to stop; nothing was saved");
                    end(status);
                }
                (Phase::Opening(_) | Phase::Sending, Some(elapsed)) if elapsed > GRACE => end(status),
                (Phase::Saving, Some(elapsed)) if elapsed > SAVING_GRACE => end(status),
                (Phase::Saving, Some(elapsed)) if elapsed > GRACE && !has_said => {
                    has_said = true;
                    say!("saving the picture; another signal stops at once, without saving");
                }
                (_, Some(_)) => {}
                (phase, None) => {
                    if let Some(deadline) = state.deadline {
                        check(phase, deadline, state.samples.1);
                    }
                }
            }
        }
    }
}

impl Signals {
    /// Enters the phase of writing a file of this name. A pipe or a device is opened, and to be held until it is
    /// written: the phase begins when someone reads.
    ///
    /// # Errors
    /// [`Failure::Io`] when a pipe or a device cannot be opened.
    pub(crate) fn enter_writing(&self, path: &Path) -> Result<Option<File>, Failure> {
        if std::fs::metadata(path).map_or(true, |meta| meta.is_file() || meta.is_dir()) {
            self.enter(Phase::Saving);
            return Ok(None);
        }
        self.enter(Phase::Opening(Instant::now()));
        let opened = File::options().write(true).open(path);
        let stream = opened.map_err(|e| Failure::Io(format!("{}: {e}", path.display())))?;
        self.enter(Phase::Sending);
        Ok(Some(stream))
    }
}

/// Ends the program if its time is over; the last sample was taken at `last`.
fn check(phase: Phase, deadline: Deadline, last: Instant) {
    let over = Instant::now().saturating_duration_since(deadline.at);
    let time = crate::units::spoken(deadline.time);
    match phase {
        Phase::Receiving(what) if over > RECEIVING_GRACE => {
            say!("error: --time: {time} passed while {what}; nothing was rendered");
        }
        Phase::Rendering if over.min(last.elapsed()) > SAMPLE_GRACE => {
            say!("error: --time: {time} passed, and the render takes too long to stop; nothing was saved");
        }
        Phase::Opening(since) if over.min(since.elapsed()) > GRACE => {
            say!("error: --time: {time} passed, and nobody reads the picture; nothing was saved");
        }
        _ => return,
    }
    end(LIMIT);
}

fn end(status: i32) -> ! {
    abandon_writes();
    signal_hook::low_level::exit(status)
}
