//! Malformed files of every kind, each with what the program says of it and the status that it ends with: the catalogue
//! is the files of the folder `malformed`, for people to read.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::Path;
use std::sync::Mutex;

use crate::files::Folder;

#[path = "malformed_files.rs"]
mod malformed_files;

use malformed_files::files_of;

/// The beginning of most scenes.
const HEAD: &str = "Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 3\n\
                    Sampler \"sobol\" \"integer pixelsamples\" 1\nLookAt 0 -8 3 0 0 0 0 0 1\nCamera \"perspective\"\n\
                    WorldBegin\nLightSource \"infinite\"\n";

struct Case {
    name: String,
    bytes: Vec<u8>,
    /// Files that it names.
    files: Vec<(String, Vec<u8>)>,
    status: i32,
    said: String,
}

/// The cases of a catalogue: after `=== NAME` a file, after `--- STATUS` the first line that is said.
fn cases(text: &str) -> Vec<Case> {
    let blocks = text.split("\n=== ").skip(1);
    blocks
        .map(|block| {
            let (name, rest) = block.split_once('\n').unwrap();
            let (body, rest) = rest.rsplit_once("\n--- ").unwrap_or(("", &rest["--- ".len()..]));
            let (status, said) = rest.split_once('\n').unwrap();
            let body = format!("{body}\n");
            let (files, body) = files_of(&body);
            // A backslash at the end of the last line: the file has no end of line there.
            let body = body.strip_suffix("\\\n").unwrap_or(&body);
            let (head, body) = match body.strip_prefix("@HEAD\n") {
                Some(body) => (HEAD, body),
                None => ("", body),
            };
            let bytes = [head.as_bytes(), &unescaped(body)].concat();
            let said = said.lines().next().unwrap().to_owned();
            Case { name: name.to_owned(), bytes, files, status: status.parse().unwrap(), said }
        })
        .collect()
}

/// `\xNN` is a byte and `\\` a backslash.
fn unescaped(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = text.as_bytes();
    while let Some((&first, more)) = rest.split_first() {
        rest = more;
        match (first, more) {
            (b'\\', [b'\\', after @ ..]) => {
                bytes.push(b'\\');
                rest = after;
            }
            (b'\\', [b'x', a, b, after @ ..]) => {
                let digits = [*a, *b];
                bytes.push(u8::from_str_radix(std::str::from_utf8(&digits).unwrap(), 16).unwrap());
                rest = after;
            }
            _ => bytes.push(first),
        }
    }
    bytes
}

#[test]
fn every_malformed_file_gets_its_message() {
    let catalogue = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/malformed");
    let folder = Folder::new();
    folder.write("good.pbrt", &format!("{HEAD}Shape \"sphere\"\n"));
    folder.write("a.txt", "text\n");
    folder.write("b.txt", "text\n");
    let mut all = Vec::new();
    for file in fs::read_dir(catalogue).unwrap() {
        all.extend(cases(&fs::read_to_string(file.unwrap().path()).unwrap()));
    }
    assert!(all.len() >= 400, "{}", all.len());
    for name in ["cloud.nvdb", "satin.bsdf"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/pictures/images").join(name);
        fs::copy(from, folder.path(name)).unwrap();
    }
    // Several cases name the same file, and are read at the same time.
    for (name, bytes) in all.iter().flat_map(|case| &case.files) {
        fs::write(folder.path(name), bytes).unwrap();
    }
    let wrong = Mutex::new(Vec::new());
    rayon::scope(|scope| {
        for Case { name, bytes, status, said, .. } in &all {
            let (folder, wrong) = (&folder, &wrong);
            scope.spawn(move |_| {
                fs::write(folder.path(name), bytes).unwrap();
                let is_of_rays = name.ends_with(".csv") || name.ends_with(".npy");
                let arguments =
                    if is_of_rays { vec!["cast", "good.pbrt", "--rays", name] } else { vec!["info", name] };
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
