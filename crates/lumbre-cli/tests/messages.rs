//! What the program says is said in words: no text that Rust's `{:?}` makes of a value reaches its users.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::{Path, PathBuf};

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Where it is no message: numbers with all of their digits, keys, and the words that are made of it.
const FINE: [(&str, &str); 3] = [
    ("cast/answers.rs", "{number:?}"),
    ("explain/shape.rs", "format!(\"{:?}\", step.topic)"),
    ("lumbre/src/words.rs", "format!(\"{options:?}\")"),
];

#[test]
fn no_value_is_told_as_rust_writes_it() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = Vec::new();
    for name in ["lumbre", "lumbre-cli", "lumbre-viewer"] {
        sources(&crates.join(name).join("src"), &mut files);
    }
    let (mut seen, mut used) = (0, vec![false; FINE.len()]);
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        // Tests end a file.
        let text = text.split("#[cfg(test)]").next().unwrap();
        seen += 1;
        if path.ends_with("tests.rs") {
            continue;
        }
        for (number, line) in (1..).zip(text.lines()) {
            let is_told = line.contains(":?}") || line.contains(":#?}");
            if !is_told || line.trim_start().starts_with("//") {
                continue;
            }
            let fine = FINE.iter().position(|(file, what)| path.ends_with(file) && line.contains(what));
            match fine {
                Some(place) => used[place] = true,
                None => panic!("{}:{number}: {line}", path.display()),
            }
        }
    }
    assert!(seen > 80 && used.iter().all(|used| *used), "{seen} {used:?}");
}
