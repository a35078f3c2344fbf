//! Files that are held in memory, in place of those of the system.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Files by their names, for a scene that was dropped onto a page or came over a network. A scene that is read from
/// them ([`crate::ReadOptions::held`]) opens no other file.
///
/// Names are relative paths; `.` and `..` in them and a `/` in front have no effect on what they name.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct HeldFiles(BTreeMap<PathBuf, Arc<[u8]>>);

impl HeldFiles {
    /// Adds a file; one of the same name is replaced.
    pub fn insert(&mut self, name: impl AsRef<Path>, bytes: impl Into<Arc<[u8]>>) {
        self.0.insert(normal(name.as_ref()), bytes.into());
    }

    /// The bytes of a file.
    pub fn get(&self, path: &Path) -> Option<&Arc<[u8]>> {
        self.0.get(&normal(path))
    }

    /// The one name of a file among all that lead to it; `None` where there is no such file.
    pub(crate) fn canonical(&self, path: &Path) -> Option<PathBuf> {
        let path = normal(path);
        self.0.contains_key(&path).then_some(path)
    }

    /// The names of all files, in order.
    pub fn names(&self) -> impl Iterator<Item = &Path> {
        self.0.keys().map(PathBuf::as_path)
    }
}

impl fmt::Debug for HeldFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.0.iter().map(|(name, bytes)| (name, bytes.len()))).finish()
    }
}

/// A path without `.`, without `..` and without a root: nothing lies above the topmost folder.
fn normal(path: &Path) -> PathBuf {
    let mut parts = PathBuf::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => parts.push(name),
            Component::ParentDir => _ = parts.pop(),
            Component::CurDir | Component::RootDir | Component::Prefix(_) => {}
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;

    use super::*;
    use crate::{FormatError, ReadOptions, open_scene};

    fn options(files: &[(&str, &[u8])]) -> ReadOptions {
        let mut held = HeldFiles::default();
        files.iter().for_each(|(name, bytes)| held.insert(name, *bytes));
        ReadOptions { held: Some(Arc::new(held)), ..ReadOptions::default() }
    }

    #[test]
    fn names_resolve_within_the_topmost_folder() {
        let mut held = HeldFiles::default();
        held.insert("a/b.ply", *b"two");
        for name in ["a/b.ply", "./a/b.ply", "a/../a/./b.ply", "/a/b.ply", "../../a/b.ply"] {
            assert_eq!(held.get(Path::new(name)).map(|bytes| &bytes[..]), Some(&b"two"[..]), "{name}");
        }
        assert!(held.get(Path::new("b.ply")).is_none() && held.get(Path::new("a")).is_none());
        assert_eq!(format!("{held:?}"), "{\"a/b.ply\": 3}");
    }

    #[test]
    fn a_scene_is_read_from_files_in_memory_with_what_it_includes() {
        let scene = b"WorldBegin\nInclude \"parts/ball.pbrt\"\nShape \"plymesh\" \"string filename\" \"parts/a.ply\"\n";
        let ply = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 0 0\n0 3 0\n3 0 1 2\n";
        let ball = b"Shape \"sphere\" \"float radius\" 2.5\n";
        let all: [(&str, &[u8]); 3] =
            [("world/scene.pbrt", scene), ("world/parts/ball.pbrt", ball), ("world/parts/a.ply", ply)];
        let (desc, diagnostics) = open_scene(Path::new("world/scene.pbrt"), &options(&all)).unwrap();
        assert_eq!(desc.shapes.len(), 2);
        assert_eq!(diagnostics.files_read().len(), 3);
        let again = b"WorldBegin\nInclude \"./scene.pbrt\"\n";
        let error = open_scene(Path::new("scene.pbrt"), &options(&[("scene.pbrt", again)])).unwrap_err();
        assert!(error.to_string().starts_with("scene.pbrt:2:9: a file includes itself"), "{error}");
    }

    #[test]
    fn no_file_of_the_system_is_opened() {
        let folder = tempfile::tempdir().unwrap();
        let secret = folder.path().join("secret.pbrt");
        std::fs::write(&secret, "Shape \"sphere\"\n").unwrap();
        let scene = format!("WorldBegin\nInclude \"{}\"\n", secret.display());
        let error = open_scene(Path::new("a.pbrt"), &options(&[("a.pbrt", scene.as_bytes())])).unwrap_err();
        assert!(error.to_string().contains("no such file among those that are held"), "{error}");
        let error = open_scene(&secret, &options(&[])).unwrap_err();
        assert!(
            matches!(&error, FormatError::Io { source, .. } if source.kind() == ErrorKind::NotFound),
            "{error}"
        );
        // Its folder is not listed, either.
        let error = open_scene(folder.path(), &options(&[])).unwrap_err();
        assert!(!error.to_string().contains("secret"), "{error}");
    }
}
