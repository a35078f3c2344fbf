//! Parts of renders, and checkpoints: nothing that was rendered is lost.

use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use clap::Args;
use lumbre::formats::is_device_name;
use lumbre::{Job, Part, PartError, RenderState};

use crate::animation::is_animation;
use crate::failure::Failure;
use crate::memory::Memory;
use crate::output::is_standard_stream;
use crate::units::{self, counted};

/// How a render is shared out, kept and gone on with.
#[derive(Args)]
#[command(next_help_heading = "Parts and checkpoints")]
pub(crate) struct PartArguments {
    /// Render only samples A to B-1 of every pixel. lumbre merge joins such parts into exactly the picture of one run.
    /// A part is an .exr, whose picture other programs show, or a .part.
    #[arg(long, value_name = "A..B", value_parser = samples, conflicts_with_all = ["time", "noise", "min_spp", "denoise", "turntable"])]
    samples: Option<Range<u32>>,
    /// Save the samples in this file during the render, so that --resume can continue. By default a render of more than
    /// two minutes saves them in OUT.checkpoint until it is done.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["frames", "turntable"])]
    checkpoint: Option<PathBuf>,
    /// The time between two checkpoints.
    #[arg(long, value_name = "DUR", value_parser = units::duration, default_value = "30s")]
    checkpoint_every: Duration,
    /// Continue from a checkpoint, with the same result as an uninterrupted run. Or continue from the picture, if it
    /// was saved with --keep-sums. A higher --spp adds samples. If neither exists, start from the beginning. Pictures
    /// of --frames and --turntable that are finished (.png, .exr) are not rendered again.
    #[arg(long)]
    resume: bool,
    /// Save no checkpoint, however long the render takes.
    #[arg(long, conflicts_with_all = ["checkpoint", "resume"])]
    no_checkpoint: bool,
    /// Store the sums of all samples in the .exr, too, so that it can be resumed and merged.
    #[arg(long)]
    keep_sums: bool,
}

/// `A..B`, without B.
fn samples(text: &str) -> Result<Range<u32>, String> {
    let wrong = || {
        let count =
            if text.parse::<u32>().is_ok() { "; the number of samples per pixel is --spp" } else { "" };
        format!(
            "expected the first sample and the one after the last, such as 0..16 for the first sixteen{count}"
        )
    };
    let (first, last) = text.split_once("..").ok_or_else(wrong)?;
    let range = first.parse().map_err(|_| wrong())?..last.parse().map_err(|_| wrong())?;
    if range.is_empty() { Err(wrong()) } else { Ok(range) }
}

/// Shorter renders keep no checkpoint unless asked.
const LONG: Duration = Duration::from_secs(120);

impl PartArguments {
    /// The samples that are asked for.
    pub(crate) fn samples(&self) -> Option<Range<u32>> {
        self.samples.clone()
    }

    /// Whether it goes on from what there is.
    pub(crate) fn resumes(&self) -> bool {
        self.resume
    }

    /// Whether the output holds the sums of its samples.
    pub(crate) fn keeps_sums(&self) -> bool {
        self.keep_sums || self.samples.is_some()
    }

    /// Rejects outputs that cannot hold what is asked for.
    ///
    /// # Errors
    /// [`Failure::Usage`].
    pub(crate) fn check(&self, scene: &[PathBuf], output: &Path, spp: Option<u32>) -> Result<(), Failure> {
        let name = output.display();
        if self.is_asked() && scene.iter().any(|path| is_standard_stream(path)) {
            let why = "-: a part or a checkpoint needs a scene that can be read again (expected a file)";
            return Err(Failure::Usage(why.to_owned()));
        }
        if let (Some(samples), Some(spp)) = (&self.samples, spp)
            && samples.end > spp
        {
            return Err(Failure::Usage(format!(
                "--samples: {} is above --spp {spp} (expected a range within 0..{spp})",
                samples.end
            )));
        }
        let is = |ending: &str| output.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
        if self.samples.is_some() && !is("exr") && !is_bare_part(output) {
            return Err(Failure::Usage(format!(
                "{name}: --samples makes a part (expected a name that ends in .exr or .part)"
            )));
        }
        if self.samples.is_none() && is_bare_part(output) {
            return Err(Failure::Usage(format!("{name}: a .part needs --samples A..B")));
        }
        if self.keep_sums && !is("exr") {
            return Err(Failure::Usage(format!("{name}: --keep-sums needs an .exr file")));
        }
        Ok(())
    }

    /// Whether the state of the render is looked at.
    pub(crate) fn is_asked(&self) -> bool {
        self.keeps_sums() || self.checkpoint.is_some() || self.resume
    }
}

/// In what a render here differs from the one there, in words.
pub(crate) fn differences(there: &Job, here: &Job) -> Option<String> {
    let mut differences = there.differences(here);
    if differences.iter().any(|difference| difference.starts_with("size ")) {
        // It names the size once more.
        differences.retain(|difference| !difference.starts_with("stage "));
    }
    (!differences.is_empty()).then(|| differences.join("; "))
}

/// Whether a name is that of a part without a picture.
pub(crate) fn is_bare_part(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("part"))
}

/// The identity of a render, found out while it runs.
struct Identified(Mutex<Finding>);

enum Finding {
    Running(Background<Result<Job, lumbre::Error>>),
    Done(Result<Job, String>),
}

/// Work on a thread of its own, or done at once where the system grants none.
enum Background<T> {
    Thread(JoinHandle<Option<T>>),
    Done(Option<T>),
}

impl<T: Send + 'static> Background<T> {
    fn start(name: &str, work: impl FnOnce() -> T + Send + 'static) -> Self {
        // A thread that cannot be started would take its work along.
        let work: Box<dyn FnOnce() -> T + Send> = Box::new(work);
        let work = Arc::new(Mutex::new(Some(work)));
        let theirs = work.clone();
        let run = |work: &Mutex<Option<Box<dyn FnOnce() -> T + Send>>>| {
            let work = work.lock().unwrap_or_else(PoisonError::into_inner).take();
            work.map(|work| work())
        };
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(move || run(&theirs));
        match thread {
            Ok(thread) => Self::Thread(thread),
            Err(_) => Self::Done(run(&work)),
        }
    }

    fn is_finished(&self) -> bool {
        match self {
            Self::Thread(thread) => thread.is_finished(),
            Self::Done(_) => true,
        }
    }

    /// What came of it; `None` where it panicked.
    fn join(self) -> Option<T> {
        match self {
            Self::Thread(thread) => thread.join().ok().flatten(),
            Self::Done(done) => done,
        }
    }
}

impl Identified {
    fn get(&self) -> Result<Job, Failure> {
        let mut finding = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Finding::Running(_) = &*finding
            && let Finding::Running(thread) =
                std::mem::replace(&mut *finding, Finding::Done(Err(String::new())))
        {
            let found = thread.join().ok_or_else(|| "cannot hash the files of the scene".to_owned());
            *finding = Finding::Done(found.and_then(|job| job.map_err(|e| e.to_string())));
        }
        match &*finding {
            Finding::Done(Ok(job)) => Ok(job.clone()),
            Finding::Done(Err(why)) => Err(Failure::Io(why.clone())),
            Finding::Running(_) => Err(Failure::Io("cannot hash the files of the scene".to_owned())),
        }
    }
}

/// The checkpoint of one picture, and the state that it continues from.
pub(crate) struct Checkpoint {
    /// `None` where none is kept.
    path: Option<PathBuf>,
    is_asked: bool,
    /// Whether a run goes on from what there is: what was gone on with once is kept until it is done.
    resumes: bool,
    every: Duration,
    start: Instant,
    identified: Identified,
    /// Held as long as the render runs, so that no other writes the same checkpoint.
    _lock: Option<Lock>,
    /// Whether the file is of this very render, to be removed when it is done.
    is_own: AtomicBool,
    /// Whether the last write failed, which was said.
    has_failed: AtomicBool,
    /// Samples that a checkpoint of an earlier run has, which this one leaves alone as long as it has fewer.
    others: u64,
    writing: Mutex<Option<Background<Result<(), lumbre::Error>>>>,
}

/// A lock on a checkpoint, by the file that it is and not by its name: links to it lead to the same lock.
#[cfg(unix)]
struct Lock {
    path: PathBuf,
    file: File,
}

/// A lock on a checkpoint, held as long as the file is open.
#[cfg(windows)]
struct Lock {
    _file: File,
}

impl Lock {
    fn take(checkpoint: &Path) -> Result<Self, Failure> {
        let path = with_ending(&real_path(checkpoint), "lock");
        refuse_special(&path, "the lock of a checkpoint")?;
        match Self::held(&path) {
            Ok(Some(lock)) => Ok(lock),
            Ok(None) => Err(Failure::Usage(format!(
                "{}: another run writes this checkpoint (expected another name, or its end)",
                checkpoint.display()
            ))),
            Err(e) => Err(Failure::Io(format!("{}: {e}", path.display()))),
        }
    }

    /// The lock of this name; `None` where another run holds it.
    #[cfg(unix)]
    fn held(path: &Path) -> io::Result<Option<Self>> {
        loop {
            let file = File::options().create(true).truncate(false).write(true).open(path)?;
            match file.try_lock() {
                Err(fs::TryLockError::WouldBlock) => return Ok(None),
                // A run that ended meanwhile has removed it: who comes next would lock another one.
                Ok(()) if !is_same_file(&file, path) => {}
                // Where the file system has no locks, there is none to be had.
                Ok(()) | Err(fs::TryLockError::Error(_)) => {
                    return Ok(Some(Self { path: path.to_owned(), file }));
                }
            }
        }
    }

    /// The lock of this name; `None` where another run holds it. Windows opens the file for one run alone, and removes
    /// it when that run ends, however it does.
    #[cfg(windows)]
    fn held(path: &Path) -> io::Result<Option<Self>> {
        use std::os::windows::fs::OpenOptionsExt;
        const FILE_FLAG_DELETE_ON_CLOSE: u32 = 0x0400_0000;
        const ERROR_SHARING_VIOLATION: i32 = 32;
        let mut how = File::options();
        how.create(true).truncate(false).write(true).share_mode(0).custom_flags(FILE_FLAG_DELETE_ON_CLOSE);
        match how.open(path) {
            Ok(file) => Ok(Some(Self { _file: file })),
            Err(e) if e.raw_os_error() == Some(ERROR_SHARING_VIOLATION) => Ok(None),
            Err(e) => Err(e),
        }
    }
}

#[cfg(unix)]
impl Drop for Lock {
    fn drop(&mut self) {
        if is_same_file(&self.file, &self.path) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Whether an open file is the one of this name.
#[cfg(unix)]
fn is_same_file(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |meta: fs::Metadata| (meta.dev(), meta.ino());
    let (open, named) = (file.metadata().map(identity), fs::metadata(path).map(identity));
    matches!((open, named), (Ok(open), Ok(named)) if open == named)
}

/// The name without links, of a file that need not be there.
fn real_path(path: &Path) -> PathBuf {
    if let Ok(real) = path.canonicalize() {
        return real;
    }
    let folder = |path: &Path| match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    };
    // A link to what is not there yet is written through.
    let to = fs::read_link(path).map_or_else(|_| path.to_owned(), |to| folder(path).join(to));
    match (folder(&to).canonicalize(), to.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => to,
    }
}

/// Refuses what is there and is no regular file: a folder, a pipe, a device.
fn refuse_special(path: &Path, what: &str) -> Result<(), Failure> {
    if is_device_name(path) || fs::metadata(path).is_ok_and(|meta| !meta.is_file()) {
        return Err(Failure::Io(format!("{}: not a regular file (expected one for {what})", path.display())));
    }
    Ok(())
}

/// Reads a part, within this memory.
///
/// # Errors
/// [`Failure`] with its name, by kind of error.
pub(crate) fn open_part(path: &Path, memory: Memory) -> Result<Part, Failure> {
    Part::open(path, |bytes| memory.for_part(bytes)).map_err(|e| part_failure(path, &e))
}

fn part_failure(path: &Path, error: &PartError) -> Failure {
    let message = format!("{}: {error}", path.display());
    match error {
        PartError::Io(_) => Failure::Io(message),
        PartError::TooLarge { .. } => Failure::Limit(message),
        _ => Failure::Input(message),
    }
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    name.into()
}

impl Checkpoint {
    /// Begins a render into `output`, which goes on from the state that is given, if any. `job` is found out on a
    /// thread of its own.
    ///
    /// # Errors
    /// [`Failure`] where what there is to go on from is of another render, is damaged, or is in use.
    pub(crate) fn begin(
        arguments: &PartArguments,
        output: &Path,
        memory: Memory,
        spp: u32,
        is_quiet: bool,
        is_one_of_several: bool,
        job: impl FnOnce() -> Result<Job, lumbre::Error> + Send + 'static,
    ) -> Result<(Self, Option<RenderState>), Failure> {
        let is_picture = !is_standard_stream(output) && !is_animation(output);
        let is_file = is_picture && (output.is_file() || !output.exists());
        let kept = match &arguments.checkpoint {
            Some(path) => Some(path.clone()),
            None if arguments.no_checkpoint || !is_file => None,
            // Where the name is that of a pipe or a device, none is kept.
            None => Some(with_ending(output, "checkpoint"))
                .filter(|path| refuse_special(path, "a checkpoint").is_ok()),
        };
        if let Some(path) = &arguments.checkpoint {
            refuse_special(path, "a checkpoint")?;
        }
        let thread = Background::start("identity", job);
        let mut checkpoint = Self {
            _lock: arguments.checkpoint.as_deref().map(Lock::take).transpose()?,
            path: kept,
            is_asked: arguments.checkpoint.is_some(),
            resumes: arguments.resume,
            every: arguments.checkpoint_every,
            start: Instant::now(),
            identified: Identified(Mutex::new(Finding::Running(thread))),
            is_own: AtomicBool::new(false),
            has_failed: AtomicBool::new(false),
            others: 0,
            writing: Mutex::new(None),
        };
        if arguments.is_asked() {
            // Whatever keeps it from being known is told before hours are spent.
            checkpoint.identified.get()?;
        }
        let state = checkpoint.find(arguments, output, memory, spp, is_quiet, is_one_of_several)?;
        Ok((checkpoint, state))
    }

    /// What there is to go on from.
    fn find(
        &mut self,
        arguments: &PartArguments,
        output: &Path,
        memory: Memory,
        spp: u32,
        is_quiet: bool,
        is_one_of_several: bool,
    ) -> Result<Option<RenderState>, Failure> {
        let held = self.path.iter().map(PathBuf::as_path).find(|path| path.is_file());
        let found = match held {
            Some(path) => Some(path.to_owned()),
            None if arguments.resume && output.is_file() => Some(output.to_owned()),
            None => None,
        };
        let begins = || {
            if arguments.resume && !is_quiet && !is_one_of_several {
                say!("no checkpoint found: starting from the beginning");
            }
            Ok(None)
        };
        let Some(path) = found else { return begins() };
        let is_output = path == output;
        let name = path.display().to_string();
        let part = match Part::open(&path, |bytes| memory.for_part(bytes)) {
            Ok(part) => part,
            // The checkpoint that is named is yet to come, and the picture is to be replaced.
            Err(PartError::NoPart) if is_output && (self.is_asked || is_one_of_several) => return begins(),
            Err(PartError::NoPart) if is_output => {
                return Err(Failure::Usage(format!(
                    "{name}: this picture cannot be resumed (expected a checkpoint, or a picture saved with --keep-sums)"
                )));
            }
            Err(_) if !arguments.resume && !self.is_asked => return Ok(None),
            Err(e) => return Err(part_failure(&path, &e)),
        };
        let (taken, wanted) = (part.state.taken(), part.state.wanted());
        if !arguments.resume {
            if self.is_asked && taken < wanted {
                return Err(Failure::Usage(format!(
                    "{name}: holds {} of an unfinished render (--resume continues from it; remove the file to start again)",
                    counted(taken, "sample")
                )));
            }
            if !self.is_asked {
                self.others = taken;
                let is_same = self.identified.get().is_ok_and(|job| job.differences(&part.job).is_empty());
                self.is_own.store(is_same, Ordering::Relaxed);
                if is_same && !is_quiet {
                    let share = 100.0 * taken as f64 / wanted.max(1) as f64;
                    say!("{name} holds {share:.0} % of this render (--resume continues from it)");
                }
            }
            return Ok(None);
        }
        if let Some(differences) = differences(&part.job, &self.identified.get()?) {
            return Err(Failure::Usage(format!("{name}: of another render than this one: {differences}")));
        }
        let most = part.state.most_samples();
        if most > spp {
            return Err(Failure::Usage(format!(
                "{name}: has up to {} per pixel already (expected --spp {most} or more)",
                counted(u64::from(most), "sample")
            )));
        }
        self.is_own.store(!is_output, Ordering::Relaxed);
        if !is_quiet {
            say!(
                "resumed from {name}: {} per pixel",
                counted(u64::from(part.state.least_samples()), "sample")
            );
        }
        Ok(Some(part.state))
    }

    /// The time between two hand-overs, if there are any.
    pub(crate) fn every(&self) -> Option<Duration> {
        self.path.is_some().then_some(self.every)
    }

    /// Keeps a state while the render goes on: it is written by a thread of its own. A state that comes while another
    /// is written is left out.
    pub(crate) fn keep(&self, state: RenderState) {
        let is_due = self.is_asked || (self.start.elapsed() >= LONG && state.taken() > self.others);
        let (true, Some(path)) = (is_due, self.path.clone()) else { return };
        let mut writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        if writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            return;
        }
        if let Some(written) = writing.take().and_then(Background::join) {
            // Said once for a disk that stays full.
            let was_said = self.has_failed.swap(written.is_err(), Ordering::Relaxed);
            if let (Err(error), false) = (written, was_said) {
                say!("warning: cannot write the checkpoint, will try again: {error}");
            }
        }
        let Ok(job) = self.identified.get() else { return };
        self.is_own.store(true, Ordering::Relaxed);
        let write = move || Part { job, state }.save_as(&path);
        *writing = Some(Background::start("checkpoint", write));
    }

    /// Whether one could be kept: what an unfinished render may be told that kept none.
    pub(crate) fn is_possible(&self) -> bool {
        self.path.is_some()
    }

    /// Ends with the last state: an unfinished render keeps it if it was long or resumed, a finished one only where a
    /// checkpoint was asked for.
    ///
    /// # Errors
    /// [`Failure::Io`] where the checkpoint cannot be written.
    pub(crate) fn end(&self, state: &RenderState, is_done: bool) -> Result<Option<&Path>, Failure> {
        let thread = self.writing.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = thread {
            // It is older than what is written now.
            let _ = thread.join();
        }
        let Some(path) = &self.path else { return Ok(None) };
        let is_worth_it = self.resumes || self.start.elapsed() >= LONG;
        if self.is_asked || (!is_done && is_worth_it && state.taken() > self.others) {
            Part { job: self.identified.get()?, state: state.clone() }.save(path)?;
            return Ok(Some(path));
        }
        Ok(None)
    }

    /// Removes the checkpoint of a render that is done and saved, unless it was asked for.
    pub(crate) fn remove(&self) {
        if let (false, true, Some(path)) = (self.is_asked, self.is_own.load(Ordering::Relaxed), &self.path) {
            let _ = fs::remove_file(path);
        }
    }

    /// Which render it is.
    ///
    /// # Errors
    /// [`Failure::Io`] where the files of the scene cannot be read.
    pub(crate) fn job(&self) -> Result<Job, Failure> {
        self.identified.get()
    }

    /// The part that a state is.
    ///
    /// # Errors
    /// [`Failure::Io`] where the files of the scene cannot be read.
    pub(crate) fn part(&self, state: &RenderState) -> Result<Part, Failure> {
        Ok(Part { job: self.identified.get()?, state: state.clone() })
    }

    /// Keeps what was rendered somewhere else, where its picture cannot be saved; `None` where that fails as well.
    pub(crate) fn rescue(&self, state: &RenderState, output: &Path) -> Option<PathBuf> {
        let part = self.part(state).ok()?;
        let name = output.file_name().map_or("picture".into(), |name| name.to_string_lossy());
        [PathBuf::from("."), std::env::temp_dir()].into_iter().find_map(|folder| {
            let free = (0..100)
                .map(|i| folder.join(format!("{name}.rescued.{i}.part")))
                .find(|path| !path.exists())?;
            part.save(&free).ok().map(|()| free)
        })
    }
}
