//! What several tests of this crate share.
#![allow(dead_code)]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::path::PathBuf;

/// The folder `shared/data/PART` next to the repository or a worktree of it, where there is one.
pub(crate) fn shared(part: &str) -> Option<PathBuf> {
    let here = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let root = here.parent()?.parent()?;
    let found = ["../shared/data", "../../shared/data"]
        .iter()
        .map(|up| root.join(up).join(part))
        .find(|p| p.is_dir());
    if found.is_none() {
        println!("skipped: there is no folder shared/data/{part} here");
    }
    found
}

/// Every file below `folder` whose name ends with one of `endings`, sorted.
pub(crate) fn files_below(folder: &std::path::Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut waiting = vec![folder.to_owned()];
    let mut found = vec![];
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.to_string_lossy().to_lowercase();
            if path.is_dir() {
                waiting.push(path);
            } else if endings.iter().any(|e| name.ends_with(e)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Numbers that look random and are the same on every run (G. Steele and others, "Fast splittable pseudorandom number
/// generators", OOPSLA 2014).
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub(crate) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }
}

/// A value with some of its fields changed.
pub(crate) fn changed<T>(mut base: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut base);
    base
}
