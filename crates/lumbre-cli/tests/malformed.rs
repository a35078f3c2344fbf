//! Malformed files of every kind, each with what the program says of it and the status that it ends with: the catalogue
//! is the files of the folder `malformed`, for people to read.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::sync::Mutex;

use crate::files::Folder;

#[path = "malformed_files.rs"]
mod malformed_files;

use malformed_files::{Case, common_files, every_case};

#[test]
fn every_malformed_file_gets_its_message() {
    let folder = Folder::new();
    for (name, bytes) in common_files() {
        fs::write(folder.path(name), bytes).unwrap();
    }
    let all = every_case();
    assert!(all.len() >= 400, "{}", all.len());
    // Several cases name the same file, and are read at the same time.
    for (name, bytes) in all.iter().flat_map(|case| &case.files) {
        fs::write(folder.path(name), bytes).unwrap();
    }
    let wrong = Mutex::new(Vec::new());
    rayon::scope(|scope| {
        for case in &all {
            let Case { name, bytes, status, said, .. } = case;
            let (folder, wrong) = (&folder, &wrong);
            scope.spawn(move |_| {
                fs::write(folder.path(name), bytes).unwrap();
                let arguments = if case.has_rays() {
                    vec!["cast", "good.pbrt", "--rays", name]
                } else {
                    vec!["info", name]
                };
                let (found, found_said) = folder.lumbre(&arguments);
                let first = found_said.lines().next().unwrap_or_default();
                if found != *status || first != said {
                    wrong
                        .lock()
                        .unwrap()
                        .push(format!("{name}\n  found    {found} {first}\n  expected {status} {said}"));
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), all.len(), wrong.join("\n"));
}
