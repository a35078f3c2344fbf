//! Detects changed files by their times and sizes. Polling a few times a second costs next to nothing, works on every
//! file system, and handles editors that rename.

use std::path::PathBuf;
use std::time::SystemTime;

/// A file's modification time and length; `None` if it cannot be read.
type Stamp = Option<(SystemTime, u64)>;

/// Files in the state of the last check.
#[derive(Debug, Default)]
pub(crate) struct Watched(Vec<(PathBuf, Stamp)>);

impl Watched {
    /// Files in their present state.
    pub(crate) fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let mut files: Vec<PathBuf> = files.into_iter().collect();
        files.sort_unstable();
        files.dedup();
        Self(files.into_iter().map(|path| (path.clone(), stamp(&path))).collect())
    }

    /// Whether any has changed since; records the present state.
    pub(crate) fn changed(&mut self) -> bool {
        let mut changed = false;
        for (path, known) in &mut self.0 {
            let now = stamp(path);
            changed |= now != *known;
            *known = now;
        }
        changed
    }

    /// The files.
    pub(crate) fn files(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.0.iter().map(|(path, _)| path.clone())
    }
}

fn stamp(path: &PathBuf) -> Stamp {
    let meta = std::fs::metadata(path).ok()?;
    Some((meta.modified().ok()?, meta.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_renames_and_removals_are_seen_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.pbrt");
        std::fs::write(&path, "one").unwrap();
        let mut watched = Watched::new([path.clone(), path.clone()]);
        assert_eq!(watched.files().count(), 1);
        assert!(!watched.changed());
        std::fs::write(&path, "three").unwrap();
        assert!(watched.changed() && !watched.changed());
        let other = folder.path().join("other");
        std::fs::write(&other, "seven bytes").unwrap();
        std::fs::rename(&other, &path).unwrap();
        assert!(watched.changed() && !watched.changed());
        std::fs::remove_file(&path).unwrap();
        assert!(watched.changed() && !watched.changed());
    }
}
