//! Files that were dropped on the page, in one request: a folder of ours gets them, and nothing outside it.
//!
//! `LUMF`, the length of a list (four bytes, little-endian), the list as JSON (`[{"name": "a/b.obj", "size": 7}, …]`),
//! and then the bytes of the files one after the other.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use lumbre::formats::{SceneFormat, atomic_write};

use crate::message::DroppedFile;

/// What it begins with.
const MAGIC: &[u8] = b"LUMF";
/// Files.
const MAX_FILES: usize = 4000;
/// Bytes of a name, and folders in it.
const MAX_NAME: usize = 400;
const MAX_DEPTH: usize = 16;

/// Why files are not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refused {
    /// They are no such files at all.
    Malformed,
    /// A name that could lead out of the folder, or that stands twice.
    Name,
    /// None of them is a scene or a picture.
    Kind,
    /// They cannot be written.
    Storage,
}

/// What was dropped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Dropped {
    /// A scene, with the files next to it.
    Scene(PathBuf),
    /// A picture of light from all around.
    Environment(PathBuf),
}

/// Endings of pictures that may be environments.
const PICTURES: [&str; 7] = ["hdr", "exr", "pfm", "png", "jpg", "jpeg", "tga"];

/// Writes the files of a request into an empty folder, and returns which of them to show.
pub(crate) fn unpack(bytes: &[u8], folder: &Path) -> Result<Dropped, Refused> {
    let files = files(bytes)?;
    let names: Vec<&Path> = files.iter().map(|(name, _)| Path::new(name)).collect();
    let shown = shown(&names).ok_or(Refused::Kind)?;
    for (name, bytes) in &files {
        let path = folder.join(name);
        let written = path.parent().map_or(Ok(()), fs::create_dir_all).map_err(|_| Refused::Storage);
        written?;
        atomic_write(&path, |file: &mut dyn Write| file.write_all(bytes)).map_err(|_| Refused::Storage)?;
    }
    Ok(match shown {
        Dropped::Scene(name) => Dropped::Scene(folder.join(name)),
        Dropped::Environment(name) => Dropped::Environment(folder.join(name)),
    })
}

/// The names and the bytes of the files, whose names lead into the folder and nowhere else.
fn files(bytes: &[u8]) -> Result<Vec<(String, &[u8])>, Refused> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(Refused::Malformed)?;
    let (length, rest) = rest.split_at_checked(4).ok_or(Refused::Malformed)?;
    let length = u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize;
    let (list, mut rest) = rest.split_at_checked(length).ok_or(Refused::Malformed)?;
    let entries: Vec<DroppedFile> = serde_json::from_slice(list).map_err(|_| Refused::Malformed)?;
    if entries.is_empty() || entries.len() > MAX_FILES {
        return Err(Refused::Malformed);
    }
    let mut files = Vec::with_capacity(entries.len());
    let mut known = BTreeSet::new();
    for DroppedFile { name, size } in entries {
        // Systems that know no case have one file for both.
        if !leads_inside(&name) || !known.insert(name.to_lowercase()) {
            return Err(Refused::Name);
        }
        let size = usize::try_from(size).map_err(|_| Refused::Malformed)?;
        let (own, after) = rest.split_at_checked(size).ok_or(Refused::Malformed)?;
        rest = after;
        files.push((name, own));
    }
    if rest.is_empty() { Ok(files) } else { Err(Refused::Malformed) }
}

/// Whether a name is a relative path of plain parts, on any system.
fn leads_inside(name: &str) -> bool {
    let is_plain = |part: &str| {
        !part.is_empty()
            && part != "."
            && part != ".."
            && !part.ends_with(['.', ' '])
            && !part
                .chars()
                .any(|c| c.is_control() || matches!(c, '\\' | ':' | '*' | '?' | '"' | '<' | '>' | '|'))
    };
    let parts: Vec<&str> = name.split('/').collect();
    name.len() <= MAX_NAME && parts.len() <= MAX_DEPTH && parts.iter().all(|part| is_plain(part))
}

/// The scene among these files: first of formats that name other files, then of the named ones; the one in the
/// outermost folder. Else the only picture.
fn shown(names: &[&Path]) -> Option<Dropped> {
    let rank = |path: &Path| match SceneFormat::from_path(path)? {
        SceneFormat::Pbrt | SceneFormat::Pov => Some(0),
        SceneFormat::Gltf => Some(1),
        SceneFormat::Obj => Some(2),
        _ => Some(3),
    };
    let scenes = names.iter().filter_map(|path| Some((rank(path)?, path.components().count(), *path)));
    if let Some((.., scene)) = scenes.min() {
        return Some(Dropped::Scene(scene.to_owned()));
    }
    let is_picture = |path: &&&Path| {
        path.extension().is_some_and(|ending| PICTURES.iter().any(|known| ending.eq_ignore_ascii_case(known)))
    };
    let mut pictures = names.iter().filter(is_picture);
    match (pictures.next(), pictures.next()) {
        (Some(picture), None) => Some(Dropped::Environment((*picture).to_owned())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bundle(files: &[(&str, &str)]) -> Vec<u8> {
        let list: Vec<_> = files
            .iter()
            .map(|(name, text)| serde_json::json!({ "name": name, "size": text.len() }))
            .collect();
        let list = serde_json::to_vec(&list).unwrap();
        let mut bytes = [MAGIC, &(list.len() as u32).to_le_bytes(), &list].concat();
        files.iter().for_each(|(_, text)| bytes.extend(text.bytes()));
        bytes
    }

    #[test]
    fn files_come_into_the_folder_and_the_scene_among_them_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let files =
            [("model/parts/wheel.ply", "ply"), ("model/car.obj", "o car"), ("model/car.mtl", "newmtl")];
        let dropped = unpack(&bundle(&files), folder.path()).unwrap();
        assert_eq!(dropped, Dropped::Scene(folder.path().join("model/car.obj")));
        for (name, text) in files {
            assert_eq!(fs::read_to_string(folder.path().join(name)).unwrap(), text);
        }
        for (names, expected) in [
            (&["a/b.obj", "c.obj", "a.stl"][..], "c.obj"),
            (&["b.gltf", "z.pbrt.gz", "a.glb"], "z.pbrt.gz"),
            (&["x.PLY", "sky.hdr"], "x.PLY"),
        ] {
            let paths: Vec<&Path> = names.iter().map(Path::new).collect();
            assert_eq!(shown(&paths), Some(Dropped::Scene(expected.into())), "{names:?}");
        }
        assert_eq!(shown(&[Path::new("sky.EXR")]), Some(Dropped::Environment("sky.EXR".into())));
        assert_eq!(shown(&[Path::new("a.hdr"), Path::new("b.hdr")]), None);
        assert_eq!(shown(&[Path::new("readme.md")]), None);
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("inside");
        fs::create_dir(&inside).unwrap();
        for name in [
            "/etc/passwd.obj",
            "../a.obj",
            "a/../../b.obj",
            "a//b.obj",
            "./a.obj",
            "a\\..\\b.obj",
            "C:a.obj",
            "C:/a.obj",
            "a/b.obj/",
            "",
            "a\0.obj",
            "a\n.obj",
            "..",
            "a/./b.obj",
            "nul.obj ",
            &"x/".repeat(40),
            &"y".repeat(500),
        ] {
            assert_eq!(
                unpack(&bundle(&[("ok.obj", "o"), (name, "v")]), &inside),
                Err(Refused::Name),
                "{name}"
            );
        }
        assert_eq!(unpack(&bundle(&[("a.obj", ""), ("A.OBJ", "")]), &inside), Err(Refused::Name));
        assert_eq!(unpack(&bundle(&[("a.txt", "")]), &inside), Err(Refused::Kind));
        let whole = bundle(&[("a.obj", "o ball")]);
        for cut in [0, 3, 7, 9, whole.len() - 1] {
            assert_eq!(unpack(&whole[..cut], &inside), Err(Refused::Malformed), "{cut}");
        }
        assert_eq!(unpack(&[&whole[..], b"x"].concat(), &inside), Err(Refused::Malformed));
        let huge = [MAGIC, &u32::MAX.to_le_bytes(), b"[]"].concat();
        assert_eq!(unpack(&huge, &inside), Err(Refused::Malformed));
        assert_eq!(unpack(&bundle(&[]), &inside), Err(Refused::Malformed));
        assert_eq!(fs::read_dir(&inside).unwrap().count(), 0);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
