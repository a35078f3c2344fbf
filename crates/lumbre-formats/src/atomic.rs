//! Atomic writes: a path holds the old complete file or the new complete file, never a part of one.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

use crate::devices::{Device, device};
use crate::diagnostic::FormatError;

/// Writes the file `path` through `write`: into a temporary file in the same folder, which is synced to disk
/// and then renamed over `path`.
///
/// A replaced file keeps its permissions, and a symbolic link keeps pointing at the file that it names. A pipe
/// or a device is written to directly.
///
/// # Errors
/// [`FormatError::Io`]; the path then holds what it held before, unless only syncing the folder failed. A
/// process that is killed may leave a file `.NAME.….lumbre.part` next to it, which the next write into that folder
/// removes.
pub fn atomic_write(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), FormatError> {
    atomic_write_on(&RealDisk, path, write)
}

/// Checks that [`atomic_write`] could write `path`, by creating its temporary file and removing it. Call it
/// before a long render.
///
/// # Errors
/// [`FormatError::Io`] when it could not.
pub fn probe_writable(path: &Path) -> Result<(), FormatError> {
    let target = target_of(path).map_err(|e| FormatError::io(path, CANNOT_WRITE, e))?;
    let Target::File { path: real, .. } = target else { return Ok(()) };
    replace(&RealDisk, &real, None, |_| Ok(()), |part, _| RealDisk.remove(part))
        .map_err(|e| FormatError::io(path, CANNOT_WRITE, e))
}

/// Removes the temporary files of all writes that are under way, and keeps the process from beginning or ending any
/// other: for one that is about to exit, where a signal or a deadline ends it. Every path holds its old complete file
/// then, or its new one.
pub fn abandon_writes() {
    const PATIENCE: Duration = Duration::from_millis(200);
    let start = Instant::now();
    loop {
        let mut writes = match WRITES.try_lock() {
            Ok(writes) => writes,
            Err(TryLockError::Poisoned(writes)) => writes.into_inner(),
            // Some call to the system takes long.
            Err(TryLockError::WouldBlock) if start.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_millis(1));
                continue;
            }
            Err(TryLockError::WouldBlock) => return,
        };
        for part in writes.parts.drain(..) {
            let _ = fs::remove_file(part);
        }
        // A thread that would create or rename a file waits until the process has ended.
        std::mem::forget(writes);
        return;
    }
}

/// The writes of this process.
struct Writes {
    /// The temporary files that there are.
    parts: Vec<PathBuf>,
    /// The folders whose left-over temporary files were removed.
    swept: Vec<PathBuf>,
}

static WRITES: Mutex<Writes> = Mutex::new(Writes { parts: Vec::new(), swept: Vec::new() });

fn writes() -> MutexGuard<'static, Writes> {
    WRITES.lock().unwrap_or_else(PoisonError::into_inner)
}

const CANNOT_WRITE: &str = "cannot write";

/// The file system calls of [`atomic_write`], so that a test can make any of them fail.
pub trait Disk {
    /// A file open for writing.
    type File: Write;
    /// Creates a file that does not exist.
    ///
    /// # Errors
    /// As the system's.
    fn create(&self, path: &Path) -> io::Result<Self::File>;
    /// Syncs a file to disk.
    ///
    /// # Errors
    /// As the system's.
    fn sync(&self, file: &mut Self::File) -> io::Result<()>;
    /// Renames `from` to `to`, replacing it in one step.
    ///
    /// # Errors
    /// As the system's.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Syncs a folder's entries to disk.
    ///
    /// # Errors
    /// As the system's.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
    /// Removes a file.
    ///
    /// # Errors
    /// As the system's.
    fn remove(&self, path: &Path) -> io::Result<()>;
}

/// The real file system.
#[derive(Clone, Copy, Debug, Default)]
pub struct RealDisk;

impl Disk for RealDisk {
    type File = File;

    fn create(&self, path: &Path) -> io::Result<File> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        // As long as it is held no one takes the file for a left-over. A file system without locks is fine.
        let _ = file.try_lock();
        Ok(file)
    }

    fn sync(&self, file: &mut File) -> io::Result<()> {
        file.sync_all()
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        if cfg!(windows) { rename_when_closed(from, to) } else { fs::rename(from, to) }
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        // Elsewhere folders cannot be opened, and renames are journalled.
        if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }
}

/// Windows replaces no file that another program has open, unless that program allows it. Scanners and indexers look
/// into new files and are done in a moment, so it is tried again.
fn rename_when_closed(from: &Path, to: &Path) -> io::Result<()> {
    const PATIENCE: Duration = Duration::from_secs(2);
    const ERROR_ACCESS_DENIED: i32 = 5;
    const ERROR_SHARING_VIOLATION: i32 = 32;
    let start = Instant::now();
    loop {
        match fs::rename(from, to) {
            Err(e) if matches!(e.raw_os_error(), Some(ERROR_ACCESS_DENIED | ERROR_SHARING_VIOLATION)) => {
                if start.elapsed() > PATIENCE {
                    let why = format!("{e} Another program has it open (expected that it closes it)");
                    return Err(io::Error::new(e.kind(), why));
                }
                std::thread::sleep(Duration::from_millis(20));
            }
            renamed => return renamed,
        }
    }
}

/// [`atomic_write`] on another [`Disk`].
///
/// # Errors
/// As for [`atomic_write`].
pub fn atomic_write_on<D: Disk>(
    disk: &D,
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), FormatError> {
    let refuse = |e| FormatError::io(path, CANNOT_WRITE, e);
    match target_of(path).map_err(refuse)? {
        Target::File { path: real, permissions } => {
            let write = |file: &mut D::File| {
                let mut buffered = BufWriter::with_capacity(256 << 10, file);
                write(&mut buffered)?;
                buffered.flush()?;
                // A failed writer must not be flushed again when it is dropped.
                drop(buffered.into_parts());
                Ok(())
            };
            replace(disk, &real, permissions, write, |part, real| disk.rename(part, real))
        }
        Target::Stream => OpenOptions::new().write(true).open(path).and_then(|mut stream| write(&mut stream)),
    }
    .map_err(refuse)
}

/// [`atomic_write`] for formats that go back to what they wrote. What a pipe or a device is sent is made in a temporary
/// file first.
///
/// # Errors
/// As [`atomic_write`].
pub fn atomic_write_seek(
    path: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<(), FormatError> {
    let refuse = |e| FormatError::io(path, CANNOT_WRITE, e);
    match target_of(path).map_err(refuse)? {
        Target::File { path: real, permissions } => {
            replace(&RealDisk, &real, permissions, write, |part, real| RealDisk.rename(part, real))
        }
        Target::Stream => OpenOptions::new().write(true).open(path).and_then(|mut stream| {
            let mut file = tempfile::tempfile()?;
            write(&mut file)?;
            file.rewind()?;
            io::copy(&mut file, &mut stream).map(drop)
        }),
    }
    .map_err(refuse)
}

/// Writes a file next to `real`; `end` then renames it to `real`, or removes it.
fn replace<D: Disk>(
    disk: &D,
    real: &Path,
    permissions: Option<fs::Permissions>,
    write: impl FnOnce(&mut D::File) -> io::Result<()>,
    end: impl FnOnce(&Path, &Path) -> io::Result<()>,
) -> io::Result<()> {
    let part = part_of(real);
    let mut file = {
        let mut writes = writes();
        let folder = folder_of(real);
        if !writes.swept.iter().any(|swept| swept == folder) {
            remove_left_over(folder);
            writes.swept.push(folder.to_owned());
        }
        let file = disk.create(&part)?;
        writes.parts.push(part.clone());
        file
    };
    let written = (|| {
        write(&mut file)?;
        disk.sync(&mut file)?;
        if let Some(permissions) = permissions {
            // A file system without permissions is fine.
            let _ = fs::set_permissions(&part, permissions);
        }
        let mut writes = writes();
        // On Windows no one could read the file as long as it is locked.
        let held = if cfg!(windows) { None } else { Some(file) };
        end(&part, real)?;
        writes.parts.retain(|other| *other != part);
        drop(held);
        Ok(())
    })();
    if let Err(e) = written {
        // The first error is the one to report.
        let _ = disk.remove(&part);
        writes().parts.retain(|other| *other != part);
        return Err(e);
    }
    disk.sync_folder(folder_of(real))
}

/// Removes the temporary files in `folder` whose processes are gone.
fn remove_left_over(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        if let Some(owner) = name.to_str().and_then(owner_of)
            && is_left_over(&entry.path(), owner)
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether the process that wrote this temporary file is gone. It held a lock on it, also one on another machine or in
/// a container of its own; but just after it was created a file has none yet.
fn is_left_over(part: &Path, owner: u32) -> bool {
    const MOMENT: Duration = Duration::from_secs(60);
    let is_file = fs::symlink_metadata(part).is_ok_and(|meta| meta.is_file());
    if owner == std::process::id() || !is_file {
        return false;
    }
    let Ok(file) = File::open(part) else { return false };
    let processes = Path::new("/proc");
    let is_gone = processes.join("self").exists() && !processes.join(owner.to_string()).exists();
    let age = file.metadata().and_then(|meta| meta.modified()).map(|at| at.elapsed().unwrap_or_default());
    file.try_lock().is_ok() && (is_gone || age.is_ok_and(|age| age > MOMENT))
}

enum Target {
    File { path: PathBuf, permissions: Option<fs::Permissions> },
    Stream,
}

fn target_of(path: &Path) -> io::Result<Target> {
    if path.file_name().is_none() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it names no file"));
    }
    match device(path) {
        Some(Device::Null) => return Ok(Target::Stream),
        Some(Device::Other) => {
            let why = "it is the name of a device (expected that of a file, or NUL)";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, why));
        }
        None => {}
    }
    match fs::metadata(path) {
        Ok(meta) if meta.is_dir() => Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder")),
        Ok(meta) if meta.is_file() => {
            if meta.permissions().readonly() {
                return Err(io::Error::new(io::ErrorKind::PermissionDenied, "it is read-only"));
            }
            Ok(Target::File { path: fs::canonicalize(path)?, permissions: Some(meta.permissions()) })
        }
        Ok(_) => Ok(Target::Stream),
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            // A dangling link: create the file that it points to.
            let real = fs::read_link(path).map_or(path.to_owned(), |to| folder_of(path).join(to));
            Ok(Target::File { path: real, permissions: None })
        }
        Err(e) => Err(e),
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A name that no other write of this or another process uses.
fn part_of(path: &Path) -> PathBuf {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    // Truncated, so that the whole stays within the limits of file systems.
    let name: String = name.chars().take(40).collect();
    folder_of(path).join(format!(".{name}.{}-{count}{PART}", std::process::id()))
}

/// How the names of temporary files end: no other program's do.
const PART: &str = ".lumbre.part";

/// The process that made the temporary file of this name; `None` for another file.
fn owner_of(name: &str) -> Option<u32> {
    let (_, number) = name.strip_prefix('.')?.strip_suffix(PART)?.rsplit_once('.')?;
    let (process, count) = number.split_once('-')?;
    count.parse::<u32>().ok()?;
    process.parse().ok()
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::io::ErrorKind;

    use super::*;

    /// What goes wrong at the chosen call.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Fault {
        Full,
        Broken,
        Short,
        Interrupted,
    }

    impl Fault {
        fn error(self) -> io::Error {
            match self {
                Self::Full | Self::Short => ErrorKind::StorageFull.into(),
                Self::Broken => io::Error::other("input/output error"),
                Self::Interrupted => ErrorKind::Interrupted.into(),
            }
        }
    }

    /// The real disk, but that call number `at` goes wrong.
    struct FaultyDisk {
        at: u32,
        fault: Fault,
        calls: Cell<u32>,
    }

    impl FaultyDisk {
        fn call(&self) -> io::Result<()> {
            let this = self.calls.get();
            self.calls.set(this + 1);
            if this == self.at { Err(self.fault.error()) } else { Ok(()) }
        }
    }

    struct FaultyFile<'a> {
        disk: &'a FaultyDisk,
        file: File,
        full: bool,
    }

    impl Write for FaultyFile<'_> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.full {
                return Err(Fault::Full.error());
            }
            match self.disk.call() {
                Ok(()) => self.file.write(bytes),
                // A few bytes fit, and then no more.
                Err(_) if self.disk.fault == Fault::Short => {
                    self.full = true;
                    self.file.write(&bytes[..bytes.len().div_ceil(3)])
                }
                Err(e) => Err(e),
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    /// A disk's reference, so that its files can point at it.
    struct On<'a>(&'a FaultyDisk);

    impl<'a> Disk for On<'a> {
        type File = FaultyFile<'a>;

        fn create(&self, path: &Path) -> io::Result<FaultyFile<'a>> {
            self.0.call()?;
            Ok(FaultyFile { disk: self.0, file: RealDisk.create(path)?, full: false })
        }

        fn sync(&self, file: &mut FaultyFile<'a>) -> io::Result<()> {
            self.0.call()?;
            RealDisk.sync(&mut file.file)
        }

        fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
            self.0.call()?;
            RealDisk.rename(from, to)
        }

        fn sync_folder(&self, folder: &Path) -> io::Result<()> {
            self.0.call()?;
            RealDisk.sync_folder(folder)
        }

        fn remove(&self, path: &Path) -> io::Result<()> {
            self.0.call()?;
            RealDisk.remove(path)
        }
    }

    /// Removing nothing after a failure makes this fail, and so does writing in place: both were tried.
    #[test]
    fn whichever_call_fails_the_path_holds_a_complete_file() {
        let old = vec![b'o'; 1234];
        // More than two buffers, so that there are several writes.
        let new: Vec<u8> = (0..700_000u32).map(|i| (i % 251) as u8).collect();
        let mut kept_old = 0;
        for fault in [Fault::Full, Fault::Broken, Fault::Short, Fault::Interrupted] {
            for at in 0..40 {
                let folder = tempfile::tempdir().unwrap();
                let path = folder.path().join("picture.png");
                fs::write(&path, &old).unwrap();
                let disk = FaultyDisk { at, fault, calls: Cell::new(0) };
                let done = atomic_write_on(&On(&disk), &path, |w| {
                    new.chunks(10_000).try_for_each(|chunk| w.write_all(chunk))
                });
                let held = fs::read(&path).unwrap();
                assert!(held == old || held == new, "{fault:?} at call {at}");
                assert!(done.is_err() || held == new, "{fault:?} at call {at}: said done");
                kept_old += u32::from(held == old);
                let entries = fs::read_dir(folder.path()).unwrap().count();
                assert_eq!(entries, 1, "{fault:?} at call {at} left its part");
                if disk.calls.get() <= at {
                    assert!(done.is_ok() && at >= 6, "{fault:?}: only {at} calls");
                    break;
                }
            }
        }
        assert!(kept_old >= 12, "{kept_old}");
    }

    /// Bringing the bytes to disk after the renaming makes this fail: it was tried.
    #[test]
    fn bytes_reach_the_disk_before_the_name_does() {
        struct Log(Cell<Vec<&'static str>>);
        impl Log {
            fn add(&self, call: &'static str) {
                let mut calls = self.0.take();
                calls.push(call);
                self.0.set(calls);
            }
        }
        impl Disk for Log {
            type File = File;
            fn create(&self, path: &Path) -> io::Result<File> {
                self.add("create");
                RealDisk.create(path)
            }
            fn sync(&self, file: &mut File) -> io::Result<()> {
                self.add("sync");
                RealDisk.sync(file)
            }
            fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
                self.add("rename");
                RealDisk.rename(from, to)
            }
            fn sync_folder(&self, folder: &Path) -> io::Result<()> {
                self.add("sync folder");
                RealDisk.sync_folder(folder)
            }
            fn remove(&self, path: &Path) -> io::Result<()> {
                self.add("remove");
                RealDisk.remove(path)
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let log = Log(Cell::default());
        atomic_write_on(&log, &folder.path().join("a.exr"), |w| w.write_all(b"light")).unwrap();
        assert_eq!(log.0.take(), ["create", "sync", "rename", "sync folder"]);
    }

    #[test]
    fn a_writer_that_gives_up_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        fs::write(&path, "old").unwrap();
        let error = atomic_write(&path, |w| {
            w.write_all(b"half of")?;
            Err(io::Error::other("the encoder gave up"))
        })
        .unwrap_err();
        assert!(error.to_string().contains("cannot write: the encoder gave up"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_writer_may_go_back_and_leaves_the_old_file_when_it_fails() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let count_last = |file: &mut File| {
            file.write_all(b"count: ?")?;
            file.seek(io::SeekFrom::Start(7))?;
            file.write_all(b"5")
        };
        atomic_write_seek(&path, count_last).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"count: 5");
        atomic_write_seek(&path, |file| {
            file.write_all(b"half of")?;
            Err(io::Error::other("no more"))
        })
        .unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), b"count: 5");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(atomic_write_seek(folder.path(), count_last).is_err());
    }

    #[test]
    fn folders_and_missing_folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let places = [folder.path().to_owned(), folder.path().join("absent/a.png"), "..".into()];
        for path in places {
            assert!(matches!(probe_writable(&path), Err(FormatError::Io { .. })), "{path:?}");
            assert!(matches!(atomic_write(&path, |_| Ok(())), Err(FormatError::Io { .. })), "{path:?}");
        }
        let fine = folder.path().join("a.png");
        probe_writable(&fine).unwrap();
        assert!(!fine.exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_permissions_and_devices_stay_what_they_are() {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("real.png"), folder.path().join("link.png"));
        let (dangling, later) = (folder.path().join("dangling.png"), folder.path().join("later.png"));
        fs::write(&file, "old").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
        symlink("real.png", &link).unwrap();
        symlink("later.png", &dangling).unwrap();
        atomic_write(&link, |w| w.write_all(b"new")).unwrap();
        atomic_write(&dangling, |w| w.write_all(b"first")).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(fs::read(&later).unwrap(), b"first");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);

        atomic_write(Path::new("/dev/null"), |w| w.write_all(b"gone")).unwrap();
        atomic_write_seek(Path::new("/dev/null"), |file| file.write_all(b"gone")).unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }
}
