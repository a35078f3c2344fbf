//! The code and the documents keep to the words of the field: phrases that were replaced do not return, test names are
//! short, and comments fit the screen.

use std::fs;
use std::path::{Path, PathBuf};

/// Where a phrase may not stand.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scope {
    /// In names of the code and in comments.
    Code,
    /// In comments and documents, in any case of letters. Messages keep their words.
    Prose,
}

/// Phrases that may not return, and what to say in their place.
const GONE: &[(Scope, &str, &str)] = &[
    (Scope::Code, "MOST_*", "MAX_…"),
    (Scope::Code, "LEAST_*", "MIN_…"),
    (Scope::Code, "Twig", "Subtree"),
    (Scope::Code, "GrownTwig", "GrownSubtree"),
    (Scope::Code, "Fork", "InnerNode"),
    (Scope::Code, "CornersRoom", "CornerScratch"),
    (Scope::Code, "Workplace", "ThreadScratch"),
    (Scope::Code, "Wish", "SceneRequest"),
    (Scope::Code, "Wishes", "SetOptions"),
    (Scope::Code, "Substance", "MaterialInfo"),
    (Scope::Code, "Sight", "PrimaryHit"),
    (Scope::Code, "Draw", "SampleNumbers"),
    (Scope::Code, "Keeper", "CheckpointSink"),
    (Scope::Code, "Taker", "PixelSampler"),
    (Scope::Code, "BesideOthers", "Sampling::Mis"),
    (Scope::Code, "NoClosestPoint", "ClosestPointError"),
    (Scope::Code, "NoNearestPoint", "NearestPointError"),
    (Scope::Code, "NoWindingNumber", "WindingNumberError"),
    (Scope::Code, "times_plus", "mul_add"),
    (Scope::Code, "no_later", "le_nonneg"),
    (Scope::Code, "looks_up", "is_textured"),
    (Scope::Code, "WIDE", "LANES"),
    (Scope::Code, "risen", "terminator_origin"),
    (Scope::Code, "RISES", "HAS_TERMINATOR_OFFSET"),
    (Scope::Code, "Leg", "TerminatorSegment"),
    (Scope::Code, "walk_legs", "test_terminator_segments"),
    (Scope::Code, "put_falling", "store_four_descending"),
    (Scope::Code, "at_places", "swizzle"),
    (Scope::Code, "are_one", "coincide"),
    (Scope::Code, "taker", "pixel_sampler"),
    (Scope::Code, "material_slot", "each_material_slot"),
    (Scope::Prose, "so many", "this many"),
    (Scope::Prose, "twig*", "subtree"),
    (Scope::Prose, "whoever", "who does it: a client, a caller, a reader"),
    (Scope::Prose, "in whose place", "where"),
    (Scope::Prose, "wants to know", "needs, reads"),
    (Scope::Prose, "want to know", "need, read"),
    (Scope::Prose, "sooner", "faster, earlier"),
    (Scope::Prose, "whence", "where … from"),
    (Scope::Prose, "whither", "where … to"),
    (Scope::Prose, "there is but", "there is only"),
    (Scope::Prose, "is told of", "is shown, is reported"),
    (Scope::Prose, "for those who", "for callers who, for readers who"),
    (Scope::Prose, "somebody asks", "it is requested"),
    (Scope::Prose, "where nobody asks", "unless requested"),
    (Scope::Prose, "of one's own", "custom"),
    (Scope::Prose, "what rounding took", "the rounding error"),
    (Scope::Prose, "is told to", "does, gets"),
    (Scope::Prose, "all of which", "all"),
    (Scope::Prose, "one of which", "one of them"),
    (Scope::Prose, "some of which", "some"),
    (Scope::Prose, "most of which", "most"),
    (Scope::Prose, "of which nothing", "without"),
    (Scope::Prose, "of which none", "none of them"),
    (Scope::Prose, "mean nothing", "are undefined, are unused"),
    (Scope::Prose, "means nothing", "is undefined, is unused"),
    (Scope::Prose, "take on the instruction set", "inherit target features"),
    (Scope::Prose, "how soon", "how fast, when"),
    (Scope::Prose, "is its own affair", "only the innermost medium applies"),
    (Scope::Prose, "a lie", "differs from the surface's normal"),
    (Scope::Prose, "why none is lost", "# Error bound"),
    (Scope::Prose, "why no hit is lost", "# Error bound"),
    (Scope::Prose, "why nothing sticks out", "# Error bound"),
    (Scope::Prose, "why nothing leaks", "# Correctness"),
    (Scope::Prose, "why boxes lose nothing", "# Error bound"),
];

/// Maximum number of columns of a comment.
const MAX_COLUMNS: usize = 120;
/// Characters of a test's name.
const MAX_TEST_NAME: usize = 60;

/// Whether a phrase is in a line as whole words; a `*` at its end stands for the rest of a word.
fn has_phrase(line: &str, phrase: &str) -> bool {
    let (stem, is_open) = phrase.strip_suffix('*').map_or((phrase, false), |stem| (stem, true));
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    line.match_indices(stem).any(|(at, _)| {
        !line[..at].ends_with(is_word) && (is_open || !line[at + stem.len()..].starts_with(is_word))
    })
}

/// The comment of a line of Rust, if it has one. A `//` in a string, as in an address, begins none.
fn comment(line: &str) -> Option<&str> {
    let trimmed = line.trim_start();
    if trimmed.starts_with("//") {
        return Some(trimmed);
    }
    line.find(" // ").map(|at| &line[at..])
}

/// The faults of one file, each with its line and the better word.
fn faults(path: &str, text: &str) -> Vec<String> {
    let is_rust = path.ends_with(".rs");
    let mut found = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let prose = if is_rust { comment(line).unwrap_or_default() } else { line }.to_lowercase();
        for &(scope, phrase, better) in GONE {
            let is_there = match scope {
                Scope::Code => is_rust && has_phrase(line, phrase),
                Scope::Prose => has_phrase(&prose, phrase),
            };
            if is_there {
                found.push(format!("{path}:{number}: instead of \"{phrase}\" say \"{better}\""));
            }
        }
        // Rows of tables are not wrapped, and addresses cannot be.
        let is_prose =
            is_rust && comment(line).is_some_and(|text| !text.contains(" | ") && !text.contains("://"));
        if is_prose && line.chars().count() > MAX_COLUMNS {
            found.push(format!("{path}:{number}: a comment of more than {MAX_COLUMNS} columns"));
        }
        let name = line.trim_start().strip_prefix("fn ").and_then(|rest| rest.split(['(', '<']).next());
        if let Some(name) = name
            && is_rust
            && name.len() > MAX_TEST_NAME
        {
            found.push(format!("{path}:{number}: {name} has more than {MAX_TEST_NAME} characters"));
        }
    }
    found
}

/// The files below a folder, without what is built or is of others.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && !["target", "node_modules", "shared"].contains(&name.as_str()) {
                files(&path, found);
            }
        } else if name.ends_with(".rs") || name.ends_with(".md") {
            found.push(path);
        }
    }
}

#[test]
fn replaced_phrases_do_not_return() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut paths = Vec::new();
    files(&root, &mut paths);
    paths.sort();
    let (mut seen, mut found) = ([0; 2], Vec::new());
    for path in paths {
        let name = path.strip_prefix(&root).expect("below the root").to_string_lossy().replace('\\', "/");
        let is_code = name.ends_with(".rs") && (name.starts_with("crates/") || name.starts_with("xtask/"));
        let is_document = name.ends_with(".md") && !name.starts_with("docs/es/");
        if (is_code || is_document) && name != "xtask/tests/words.rs" {
            seen[usize::from(is_document)] += 1;
            found.extend(faults(&name, &fs::read_to_string(&path).expect("a text")));
        }
    }
    assert!(seen[0] > 500 && seen[1] > 50, "{seen:?} files of code and documents are too few");
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn phrases_are_found_as_whole_words() {
    fn found(path: &str, text: &str) -> usize {
        faults(path, text).len()
    }
    assert_eq!(found("crates/a/src/a.rs", "const MOST_RAYS: u32 = 3; // LEAST_RAYS, and so many"), 3);
    assert_eq!(found("crates/a/src/a.rs", "let almost = \"so many\"; let UTMOST_ = MOST;"), 0);
    assert_eq!(found("docs/a.md", "Whoever reads: `const MOST_RAYS`.\nSo many."), 2);
    assert_eq!(found("crates/lumbre-kernel/src/a.rs", &format!("// {}", "ä".repeat(117))), 0);
    assert_eq!(found("crates/lumbre-kernel/src/a.rs", &format!("// {}", "ä".repeat(118))), 1);
    let test = format!("fn {}() {{}}", "a".repeat(61));
    assert_eq!(found("crates/lumbre-kernel/src/tests/a.rs", &test), 1);
    assert_eq!(found("crates/lumbre-math/README.md", &test), 0);
}
