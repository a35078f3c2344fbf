//! Resource limits: every reader consults a [`Budget`] before any allocation whose size the input chose.
//!
//! Every limit names the program flag that raises it, and so does its error.

use std::mem::size_of;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use thiserror::Error;

use crate::held::HeldFiles;

/// The limits on reading, each with the flag that raises it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Bytes held at one time by everything read (`--max-memory`).
    pub memory: u64,
    /// Vertices, faces, shapes, parameters and the like over the whole run (`--max-elements`).
    pub elements: u64,
    /// Levels of nesting: includes, attribute blocks, objects in objects, JSON (`--max-nesting`).
    pub nesting: u32,
    /// Files opened over the whole run, includes and textures counted each time (`--max-files`).
    pub files: u64,
    /// The expansion ratio of compressed data, and of files that a scene includes again and again, beyond the first
    /// [`Limits::FREE_EXPANSION`] bytes of a stream (`--max-expansion`).
    pub expansion: u64,
}

impl Limits {
    /// A compressed stream may expand to this many bytes at any ratio.
    pub const FREE_EXPANSION: u64 = 64 << 20;

    /// No limits except those of the allocator.
    pub const UNLIMITED: Self =
        Self { memory: u64::MAX, elements: u64::MAX, nesting: 10_000, files: u64::MAX, expansion: u64::MAX };
}

impl Default for Limits {
    /// 8 GiB, 2³² elements, 256 levels, 100,000 files and an expansion of 200.
    fn default() -> Self {
        Self { memory: 8 << 30, elements: 1 << 32, nesting: 256, files: 100_000, expansion: 200 }
    }
}

/// Which limit was exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum LimitKind {
    /// [`Limits::memory`].
    Memory,
    /// [`Limits::elements`].
    Elements,
    /// [`Limits::nesting`].
    Nesting,
    /// [`Limits::files`].
    Files,
    /// [`Limits::expansion`].
    Expansion,
}

impl LimitKind {
    /// The program flag that raises this limit.
    pub const fn flag(self) -> &'static str {
        match self {
            Self::Memory => "--max-memory",
            Self::Elements => "--max-elements",
            Self::Nesting => "--max-nesting",
            Self::Files => "--max-files",
            Self::Expansion => "--max-expansion",
        }
    }

    const fn noun(self) -> &'static str {
        match self {
            Self::Memory => "bytes of memory",
            Self::Elements => "elements",
            Self::Nesting => "levels of nesting",
            Self::Files => "files",
            Self::Expansion => "bytes from each byte stored",
        }
    }
}

/// A limit that the input would exceed. Its text names the flag that raises the limit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{what}: needs {needed} {}, limit {limit}; raise it with {}", .kind.noun(), .kind.flag())]
pub struct LimitError {
    /// What was being read.
    pub what: String,
    /// The limit.
    pub kind: LimitKind,
    /// The total that would have been needed.
    pub needed: u64,
    /// The total that is allowed.
    pub limit: u64,
}

/// The running total of resources used by reading. Threads may share it.
#[derive(Debug, Default)]
pub struct Budget {
    limits: Limits,
    memory: AtomicU64,
    peak: AtomicU64,
    elements: AtomicU64,
    files: AtomicU64,
    paths: Mutex<Vec<PathBuf>>,
    /// The files that may be opened; `None` for any.
    only: Option<Vec<PathBuf>>,
    /// The folder in which any file may be opened besides these.
    folder: Option<PathBuf>,
    /// The files that there are; `None` for those of the system.
    held: Option<Arc<HeldFiles>>,
}

impl Budget {
    /// A budget with nothing spent.
    pub fn new(limits: Limits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// Lets no file be opened but these, each by the name that is given here: for a scene from a stranger, who could
    /// name any file of its reader as a texture or a buffer.
    #[must_use]
    pub fn only(self, files: impl IntoIterator<Item = PathBuf>) -> Self {
        Self { only: Some(files.into_iter().collect()), ..self }
    }

    /// Lets files in this folder be opened besides those of [`Budget::only`]. Names are compared as they are written,
    /// so that a link in the folder leads to where it points: it has to be a folder in which there are none.
    #[must_use]
    pub fn and_in(self, folder: PathBuf) -> Self {
        Self { folder: Some(folder), ..self }
    }

    /// Whether the file of this name may be opened.
    pub fn allows(&self, path: &Path) -> bool {
        let Some(only) = &self.only else { return true };
        let is_inside = self.folder.as_ref().is_some_and(|folder| {
            let Ok(rest) = path.strip_prefix(folder) else { return false };
            let mut depth = 0_i64;
            for part in rest.components() {
                match part {
                    Component::Normal(_) => depth += 1,
                    Component::ParentDir => depth -= 1,
                    Component::CurDir => {}
                    Component::RootDir | Component::Prefix(_) => return false,
                }
                if depth < 0 {
                    return false;
                }
            }
            true
        });
        is_inside || only.iter().any(|known| known == path)
    }

    /// Takes these files in place of the system's, which then are neither opened nor looked for.
    #[must_use]
    pub fn of_held(self, files: Option<Arc<HeldFiles>>) -> Self {
        Self { held: files, ..self }
    }

    /// The files that there are; `None` for those of the system.
    pub(crate) fn held(&self) -> Option<&HeldFiles> {
        self.held.as_deref()
    }

    /// Whether there is a file of this name that may be opened, and no folder. Of others nothing is said, not even
    /// whether they exist.
    pub(crate) fn is_file(&self, path: &Path) -> bool {
        match self.held() {
            Some(files) => files.get(path).is_some(),
            None => self.allows(path) && path.is_file(),
        }
    }

    /// Whether there is anything of this name that may be opened.
    pub(crate) fn exists(&self, path: &Path) -> bool {
        match self.held() {
            Some(files) => files.get(path).is_some(),
            None => self.allows(path) && path.exists(),
        }
    }

    /// Whether there is a folder of this name that may be opened.
    pub(crate) fn is_folder(&self, path: &Path) -> bool {
        self.held.is_none() && self.allows(path) && path.is_dir()
    }

    /// The one name of a file among all that lead to it; `None` where there is no such file that may be opened.
    pub(crate) fn canonical(&self, path: &Path) -> Option<PathBuf> {
        match self.held() {
            Some(files) => files.canonical(path),
            None => path.canonicalize().ok().filter(|_| self.allows(path)),
        }
    }

    /// Its limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Charges `bytes` that are kept; [`Budget::release`] returns them.
    ///
    /// # Errors
    /// When more than [`Limits::memory`] would be held; nothing is charged then.
    pub fn bytes(&self, bytes: u64, what: &str) -> Result<(), LimitError> {
        let held = spend(&self.memory, bytes, self.limits.memory, LimitKind::Memory, what)?;
        self.peak.fetch_max(held, Ordering::Relaxed);
        Ok(())
    }

    /// Returns `bytes` charged by [`Budget::bytes`].
    pub fn release(&self, bytes: u64) {
        let _ = self
            .memory
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |held| Some(held.saturating_sub(bytes)));
    }

    /// Charges `bytes` for as long as the result lives.
    ///
    /// # Errors
    /// As for [`Budget::bytes`].
    pub fn hold(&self, bytes: u64, what: &str) -> Result<Hold<'_>, LimitError> {
        self.bytes(bytes, what)?;
        Ok(Hold { budget: self, bytes })
    }

    /// A [`Hold`] of no bytes, to grow.
    pub fn hold_nothing(&self) -> Hold<'_> {
        Hold { budget: self, bytes: 0 }
    }

    /// Charges for `count` values of `T` that are kept, and returns `count` as a `usize`.
    ///
    /// # Errors
    /// As for [`Budget::bytes`].
    pub fn array<T>(&self, count: u64, what: &str) -> Result<usize, LimitError> {
        self.bytes(count.saturating_mul(size_of::<T>() as u64), what)?;
        usize::try_from(count).map_err(|_| LimitError {
            what: what.to_owned(),
            kind: LimitKind::Memory,
            needed: count.saturating_mul(size_of::<T>() as u64),
            limit: self.limits.memory.min(usize::MAX as u64),
        })
    }

    /// An empty vector with capacity for `count` values, charged like [`Budget::array`].
    ///
    /// The caller has checked that the input can contain `count` values.
    ///
    /// # Errors
    /// As for [`Budget::bytes`], and when the allocator refuses.
    pub fn vec<T>(&self, count: u64, what: &str) -> Result<Vec<T>, LimitError> {
        let len = self.array::<T>(count, what)?;
        let mut vec = Vec::new();
        vec.try_reserve_exact(len).map_err(|_| {
            let needed = count.saturating_mul(size_of::<T>() as u64);
            self.release(needed);
            LimitError { what: what.to_owned(), kind: LimitKind::Memory, needed, limit: self.limits.memory }
        })?;
        Ok(vec)
    }

    /// Counts `count` more elements.
    ///
    /// # Errors
    /// When there would be more than [`Limits::elements`].
    pub fn elements(&self, count: u64, what: &str) -> Result<(), LimitError> {
        spend(&self.elements, count, self.limits.elements, LimitKind::Elements, what).map(drop)
    }

    /// Counts one more file.
    ///
    /// # Errors
    /// When there would be more than [`Limits::files`].
    pub fn file(&self, name: &str) -> Result<(), LimitError> {
        spend(&self.files, 1, self.limits.files, LimitKind::Files, name).map(drop)
    }

    /// [`Budget::file`] for the file `path`, which is noted: see [`Budget::paths`].
    ///
    /// # Errors
    /// As for [`Budget::file`].
    pub fn path(&self, path: &Path) -> Result<(), LimitError> {
        self.file(&path.to_string_lossy())?;
        self.paths.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
        Ok(())
    }

    /// The files that were opened, or that were not there to open, each as it was named, once each.
    pub fn paths(&self) -> Vec<PathBuf> {
        let mut paths = self.paths.lock().unwrap_or_else(PoisonError::into_inner).clone();
        paths.sort();
        paths.dedup();
        paths
    }

    /// Checks a nesting of `depth` levels. Readers count their own depth.
    ///
    /// # Errors
    /// When `depth` is more than [`Limits::nesting`].
    pub fn nesting(&self, depth: usize, what: &str) -> Result<(), LimitError> {
        if depth <= self.limits.nesting as usize {
            return Ok(());
        }
        Err(LimitError {
            what: what.to_owned(),
            kind: LimitKind::Nesting,
            needed: depth as u64,
            limit: u64::from(self.limits.nesting),
        })
    }

    /// Checks that `packed` compressed bytes may expand to `unpacked` bytes.
    ///
    /// # Errors
    /// When there are more than [`Limits::FREE_EXPANSION`] and the ratio is more than [`Limits::expansion`].
    pub fn expansion(&self, packed: u64, unpacked: u64, what: &str) -> Result<(), LimitError> {
        if unpacked <= Limits::FREE_EXPANSION.max(packed.saturating_mul(self.limits.expansion)) {
            return Ok(());
        }
        Err(LimitError {
            what: what.to_owned(),
            kind: LimitKind::Expansion,
            needed: unpacked.div_ceil(packed.max(1)),
            limit: self.limits.expansion,
        })
    }

    /// Bytes charged and not returned.
    pub fn memory_held(&self) -> u64 {
        self.memory.load(Ordering::Relaxed)
    }

    /// The largest number of bytes charged at one time.
    pub fn memory_peak(&self) -> u64 {
        self.peak.load(Ordering::Relaxed)
    }

    /// Bytes that may still be charged.
    pub fn memory_left(&self) -> u64 {
        self.limits.memory.saturating_sub(self.memory_held())
    }
}

/// Bytes charged to a [`Budget`] until this is dropped.
#[derive(Debug)]
pub struct Hold<'a> {
    budget: &'a Budget,
    bytes: u64,
}

impl Hold<'_> {
    /// Charges `bytes` more.
    ///
    /// # Errors
    /// As for [`Budget::bytes`].
    pub fn grow(&mut self, bytes: u64, what: &str) -> Result<(), LimitError> {
        self.budget.bytes(bytes, what)?;
        self.bytes += bytes;
        Ok(())
    }

    /// Returns all bytes, when their data is gone.
    pub fn empty(&mut self) {
        self.budget.release(std::mem::take(&mut self.bytes));
    }

    /// Room for one more value in `vec`, charged before it is taken. It doubles, as `Vec` does.
    ///
    /// # Errors
    /// As for [`Budget::bytes`], and when the allocator refuses.
    #[inline]
    pub fn room_in<T>(&mut self, vec: &mut Vec<T>, what: &str) -> Result<(), LimitError> {
        if vec.len() < vec.capacity() {
            return Ok(());
        }
        self.grow_vec(vec, what)
    }

    #[cold]
    fn grow_vec<T>(&mut self, vec: &mut Vec<T>, what: &str) -> Result<(), LimitError> {
        let more = vec.len().max(if vec.capacity() == 0 { 1 } else { 4 });
        let bytes = (more * size_of::<T>()) as u64;
        self.grow(bytes, what)?;
        vec.try_reserve_exact(more).map_err(|_| LimitError {
            what: what.to_owned(),
            kind: LimitKind::Memory,
            needed: bytes,
            limit: self.budget.limits.memory,
        })
    }

    /// Leaves the bytes charged, for data that is kept.
    pub fn keep(mut self) {
        self.bytes = 0;
    }
}

impl Drop for Hold<'_> {
    fn drop(&mut self) {
        self.budget.release(self.bytes);
    }
}

/// A vector that charges the [`Budget`] before it grows. The charge persists after [`BudgetVec::into_vec`], and
/// is returned when the vector is dropped.
#[derive(Debug)]
pub struct BudgetVec<'b, T> {
    vec: Vec<T>,
    hold: Hold<'b>,
    what: &'static str,
}

impl<'b, T> BudgetVec<'b, T> {
    /// An empty vector; `what` names its values in errors.
    pub fn new(budget: &'b Budget, what: &'static str) -> Self {
        Self { vec: Vec::new(), hold: budget.hold_nothing(), what }
    }

    /// Reserves capacity for `count` more values, which the caller knows the input can contain.
    ///
    /// # Errors
    /// As for [`Budget::bytes`], and when the allocator refuses.
    pub fn reserve(&mut self, count: usize) -> Result<(), LimitError> {
        if count <= self.vec.capacity() - self.vec.len() {
            return Ok(());
        }
        self.grow(count)
    }

    /// Adds a value.
    ///
    /// # Errors
    /// As for [`BudgetVec::reserve`].
    #[inline]
    pub fn push(&mut self, value: T) -> Result<(), LimitError> {
        if self.vec.len() == self.vec.capacity() {
            // One, four, then doubled: files may have very many lists of one.
            self.grow(match self.vec.len() {
                0 => 1,
                1 => 3,
                length => length,
            })?;
        }
        self.vec.push(value);
        Ok(())
    }

    /// Capacity for `count` more, charged first. The old buffer stays charged until it is freed.
    #[cold]
    fn grow(&mut self, count: usize) -> Result<(), LimitError> {
        let size = size_of::<T>() as u64;
        let capacity = (self.vec.len() as u64).saturating_add(count as u64).saturating_mul(size);
        let old = self.hold.bytes;
        self.hold.grow(capacity, self.what)?;
        let made = self.vec.try_reserve_exact(count);
        self.hold.budget.release(old);
        self.hold.bytes = capacity;
        made.map_err(|_| LimitError {
            what: self.what.to_owned(),
            kind: LimitKind::Memory,
            needed: capacity,
            limit: self.hold.budget.limits.memory,
        })
    }

    /// The values, with the spare capacity freed.
    pub fn into_vec(mut self) -> Vec<T> {
        self.vec.shrink_to_fit();
        let kept = (self.vec.capacity() * size_of::<T>()) as u64;
        self.hold.budget.release(self.hold.bytes.saturating_sub(kept));
        self.hold.keep();
        self.vec
    }
}

impl<T> std::ops::Deref for BudgetVec<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.vec
    }
}

impl<T> std::ops::DerefMut for BudgetVec<'_, T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.vec
    }
}

/// Adds `amount` to `account` unless that exceeds `limit`, and returns the new sum.
fn spend(
    account: &AtomicU64,
    amount: u64,
    limit: u64,
    kind: LimitKind,
    what: &str,
) -> Result<u64, LimitError> {
    let add = |spent: u64| spent.checked_add(amount).filter(|&sum| sum <= limit);
    match account.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add) {
        Ok(before) => Ok(before + amount),
        Err(spent) => {
            Err(LimitError { what: what.to_owned(), kind, needed: spent.saturating_add(amount), limit })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Budget {
        Budget::new(Limits { memory: 1000, elements: 7, nesting: 3, files: 2, expansion: 10 })
    }

    #[test]
    fn each_limit_names_the_flag_that_raises_it() {
        let b = small();
        b.elements(5, "vertices").unwrap();
        b.file("a").unwrap();
        b.file("b").unwrap();
        let errors = [
            (b.bytes(1001, "pixels").unwrap_err(), "--max-memory"),
            (b.elements(3, "vertices").unwrap_err(), "--max-elements"),
            (b.nesting(4, "Include").unwrap_err(), "--max-nesting"),
            (b.file("c").unwrap_err(), "--max-files"),
            (b.expansion(100 << 20, 2000 << 20, "x.gz").unwrap_err(), "--max-expansion"),
        ];
        for (error, flag) in errors {
            assert!(error.to_string().contains(flag), "{error}");
        }
    }

    #[test]
    fn a_refused_charge_costs_nothing() {
        let b = small();
        b.bytes(900, "kept").unwrap();
        assert!(b.bytes(101, "too much").is_err());
        assert_eq!(b.memory_held(), 900);
        b.bytes(100, "just fits").unwrap();
        assert_eq!((b.memory_left(), b.memory_peak()), (0, 1000));
    }

    #[test]
    fn a_hold_gives_back_what_it_grew_to_unless_kept() {
        let b = small();
        let mut hold = b.hold(300, "text").unwrap();
        hold.grow(200, "more text").unwrap();
        assert_eq!(b.memory_held(), 500);
        drop(hold);
        assert_eq!(b.memory_held(), 0);
        b.hold(300, "mesh").unwrap().keep();
        assert_eq!(b.memory_held(), 300);
    }

    #[test]
    fn a_vector_charges_its_capacity_and_refunds_the_rest() {
        let b = small();
        let mut kept = BudgetVec::new(&b, "faces");
        for i in 0..40u32 {
            kept.push(i).unwrap();
        }
        assert_eq!(b.memory_held(), 64 * 4);
        let kept = kept.into_vec();
        assert_eq!((kept.len(), b.memory_held()), (40, 160));

        let mut too_many = BudgetVec::new(&b, "faces");
        let error = (0..1000u32).find_map(|i| too_many.push(i).err()).unwrap();
        assert!(error.to_string().starts_with("faces: needs "), "{error}");
        assert!(b.memory_peak() <= 1000);
        drop(too_many);
        assert_eq!(b.memory_held(), 160);
    }

    #[test]
    fn sizes_that_overflow_are_refused_rather_than_wrapped() {
        let b = Budget::default();
        let error = b.vec::<[u64; 4]>(u64::MAX / 2, "vertices").unwrap_err();
        assert_eq!(error.kind, LimitKind::Memory);
        assert_eq!(error.needed, u64::MAX);
        assert_eq!(b.memory_held(), 0);
    }

    #[test]
    fn threads_never_spend_more_than_there_is() {
        let b = small();
        let spent = std::thread::scope(|s| {
            let workers: Vec<_> = (0..4)
                .map(|_| s.spawn(|| (0..200).filter(|_| b.bytes(3, "piece").is_ok()).count()))
                .collect();
            workers.into_iter().map(|w| w.join().unwrap()).sum::<usize>()
        });
        assert_eq!(spent, 333);
        assert_eq!(b.memory_held(), 999);
    }
}
