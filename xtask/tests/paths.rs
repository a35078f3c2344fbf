//! The files and folders that ARCHITECTURE.md and CONTRIBUTING.md name are there.

use std::fs;
use std::path::Path;

/// The pages, at the root of the repository.
const PAGES: [&str; 2] = ["ARCHITECTURE.md", "CONTRIBUTING.md"];
/// The folders that their paths are relative to.
const BASES: [&str; 4] = [".", "crates", "crates/lumbre-kernel/src", "crates/lumbre-render/src"];
/// What stands for a name that the reader fills in, or for what a build makes.
const PLACEHOLDERS: [&str; 4] = ["NAME", "TOPIC", "...", "target/"];

/// The words in backticks, outside of blocks of code, that are paths: letters, digits and `/._-`, with a slash.
fn paths(page: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut is_code = false;
    for line in page.lines() {
        if line.starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            found.extend(line.split('`').skip(1).step_by(2));
        }
    }
    let is_of_a_path = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    found.retain(|span| {
        span.contains('/')
            && !span.starts_with('/')
            && span.chars().all(is_of_a_path)
            && !PLACEHOLDERS.iter().any(|placeholder| span.contains(placeholder))
    });
    found
}

#[test]
fn named_paths_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut missing = Vec::new();
    for page in PAGES {
        let text = fs::read_to_string(root.join(page)).expect("the page is there");
        let paths = paths(&text);
        assert!(paths.len() > 15, "{page} names {} paths", paths.len());
        missing.extend(
            paths
                .into_iter()
                .filter(|path| !BASES.iter().any(|base| root.join(base).join(path).exists()))
                .map(|path| format!("{page}: {path}")),
        );
    }
    assert!(missing.is_empty(), "no such file:\n{}", missing.join("\n"));
}

#[test]
fn paths_are_told_from_other_code() {
    let page = "`a/b.rs` and `mod c;`, `d/NAME.rs`, `e`, `x/y z`\n```\n`f/g.rs`\n```\n`h-i/j`\n";
    assert_eq!(paths(page), ["a/b.rs", "h-i/j"]);
}
