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
const FINE: [(&str, &str); 8] = [
    ("cast/answers.rs", "{number:?}"),
    ("explain/shape.rs", "format!(\"{:?}\", step.topic)"),
    ("lumbre/src/words.rs", "format!(\"{options:?}\")"),
    ("pbrt/images.rs", "format!(\"{encoding:?} {options:?}\")"),
    // A file of tests.
    ("pbrt/pages.rs", "format!(\"{desc:?}\")"),
    // Lists of numbers.
    ("point/winding.rs", "self.instances.as_slice()"),
    ("point/closest_point.rs", "self.instances.as_slice()"),
    // Why a caller's fault is a panic.
    ("lumbre-image/src/bitmap.rs", "in {} by {} of {:?}"),
];

const CRATES: [&str; 13] = [
    "lumbre",
    "lumbre-cli",
    "lumbre-formats",
    "lumbre-geometry",
    "lumbre-image",
    "lumbre-kernel",
    "lumbre-math",
    "lumbre-python",
    "lumbre-render",
    "lumbre-scene",
    "lumbre-shading",
    "lumbre-simd",
    "lumbre-viewer",
];

#[test]
fn no_value_is_told_as_rust_writes_it() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = Vec::new();
    for name in CRATES {
        sources(&crates.join(name).join("src"), &mut files);
    }
    let (mut seen, mut used) = (0, vec![false; FINE.len()]);
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        // Tests end a file.
        let text = text.split("#[cfg(test)]").next().unwrap();
        seen += 1;
        let name = path.file_name().unwrap().to_string_lossy();
        if name.ends_with("tests.rs") || path.components().any(|part| part.as_os_str() == "tests") {
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
    assert!(seen > 400 && used.iter().all(|used| *used), "{seen} {used:?}");
}
