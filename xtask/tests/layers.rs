//! The architecture holds: dependencies between our crates, between folders and between files within them, point down
//! only.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// The layer of each crate. A crate may depend on crates of lower layers only.
const LAYERS: &[(u32, &[&str])] = &[
    (0, &["lumbre-math", "lumbre-simd"]),
    (1, &["lumbre-geometry", "lumbre-image"]),
    (2, &["lumbre-kernel", "lumbre-shading"]),
    (3, &["lumbre-scene"]),
    (4, &["lumbre-render"]),
    (5, &["lumbre-formats"]),
    (6, &["lumbre"]),
    (7, &["lumbre-viewer", "xtask"]),
    (8, &["lumbre-cli"]),
    (9, &["lumbre-dev", "lumbre-python", "lumbre-web"]),
];

/// Layers whose crates do no input or output: no crate there may depend on these.
const NO_FILES_BELOW: u32 = 5;
const FILE_CRATES: &[&str] = &["image", "exr", "tempfile", "flate2", "memmap2", "jpeg-encoder"];
/// But the kernel maps the trees that it saved, when it is asked to.
const MAY_MAP: (&str, &str) = ("lumbre-kernel", "memmap2");

fn workspace() -> serde_json::Value {
    let out = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output()
        .expect("cargo metadata runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("cargo metadata is JSON")
}

/// Every crate of the workspace with the names of its normal and build dependencies.
fn arrows(metadata: &serde_json::Value) -> BTreeMap<String, Vec<String>> {
    let text = |v: &serde_json::Value| v.as_str().expect("a string").to_owned();
    metadata["packages"]
        .as_array()
        .expect("packages")
        .iter()
        .map(|package| {
            let dependencies = package["dependencies"].as_array().expect("dependencies");
            let normal = dependencies.iter().filter(|d| d["kind"].as_str() != Some("dev"));
            (text(&package["name"]), normal.map(|d| text(&d["name"])).collect())
        })
        .collect()
}

fn upward<'a>(
    arrows: &'a BTreeMap<String, Vec<String>>,
    layers: &BTreeMap<&str, u32>,
) -> Vec<(&'a str, &'a str)> {
    let mut found = Vec::new();
    for (from, targets) in arrows {
        for to in targets {
            if let (Some(a), Some(b)) = (layers.get(from.as_str()), layers.get(to.as_str()))
                && a <= b
            {
                found.push((from.as_str(), to.as_str()));
            }
        }
    }
    found
}

fn layers() -> BTreeMap<&'static str, u32> {
    LAYERS.iter().flat_map(|(layer, crates)| crates.iter().map(move |name| (*name, *layer))).collect()
}

#[test]
fn every_crate_has_a_layer_and_every_arrow_points_down() {
    let arrows = arrows(&workspace());
    let layers = layers();
    let unplaced: Vec<_> = arrows.keys().filter(|name| !layers.contains_key(name.as_str())).collect();
    assert!(unplaced.is_empty(), "no layer for {unplaced:?}: give them one here and in ARCHITECTURE.md");
    assert_eq!(arrows.len(), layers.len(), "a crate of the plan is missing from the workspace");
    let ours = arrows.values().flatten().filter(|to| layers.contains_key(to.as_str())).count();
    assert!(ours >= 20, "only {ours} arrows between our crates were seen: the test looks at the wrong thing");
    let wrong = upward(&arrows, &layers);
    assert!(wrong.is_empty(), "arrows that point up or sideways: {wrong:?}");
}

#[test]
fn an_arrow_that_points_up_is_noticed() {
    let mut arrows = arrows(&workspace());
    arrows.get_mut("lumbre-geometry").expect("a crate").push("lumbre-scene".to_owned());
    assert_eq!(upward(&arrows, &layers()), [("lumbre-geometry", "lumbre-scene")]);
}

#[test]
fn the_layers_of_mathematics_and_light_open_no_files() {
    let arrows = arrows(&workspace());
    let layers = layers();
    for (from, targets) in &arrows {
        if layers[from.as_str()] < NO_FILES_BELOW {
            let is_wrong =
                |to: &&String| FILE_CRATES.contains(&to.as_str()) && (from.as_str(), to.as_str()) != MAY_MAP;
            let wrong: Vec<_> = targets.iter().filter(is_wrong).collect();
            assert!(wrong.is_empty(), "{from} depends on {wrong:?}");
        }
    }
}

/// Folders of a crate, the lowest first: a folder may use those before it only. What is not named here may use all.
const FOLDERS: &[(&str, &[&str])] = &[
    ("crates/lumbre-kernel/src", &["simd", "tree", "intersect", "build", "trace", "batch", "point", "io"]),
    ("crates/lumbre-render/src", &["film", "transport"]),
];

/// Folders that may not use any other in the list, though they come later.
const INDEPENDENT: &[(&str, &str)] = &[("crates/lumbre-render/src", "transport")];

/// The modules at the root of its crate that the sources below a folder name, without comments.
fn named_modules(folder: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut pending = vec![folder.to_owned()];
    while let Some(path) = pending.pop() {
        if path.is_dir() {
            pending.extend(
                std::fs::read_dir(&path).expect("a folder").map(|entry| entry.expect("an entry").path()),
            );
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("a source");
        for line in text.lines().filter(|line| !line.trim_start().starts_with("//")) {
            for rest in line.split("crate::").skip(1) {
                found.insert(rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect());
            }
        }
    }
    found
}

#[test]
fn folders_use_lower_folders_only() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace");
    for (source, folders) in FOLDERS {
        let mut arrows = 0;
        for (layer, folder) in folders.iter().enumerate() {
            let named = named_modules(&root.join(source).join(folder));
            let is_independent = INDEPENDENT.contains(&(*source, *folder));
            let allowed = if is_independent { &[][..] } else { &folders[..layer] };
            for other in folders.iter().filter(|other| **other != *folder && named.contains(**other)) {
                assert!(allowed.contains(other), "{source}/{folder} uses {other}, which is no lower folder");
                arrows += 1;
            }
        }
        assert!(arrows > 5 || folders.len() < 3, "{source}: only {arrows} arrows were seen");
    }
}

/// Circles of files that import one another, crate by crate: the sizes that there are, the largest first. They may only
/// shrink.
const CIRCLES: &[(&str, &[usize])] = &[
    ("lumbre-cli", &[8, 4]),
    ("lumbre-formats", &[12, 7, 3, 2]),
    ("lumbre-math", &[4]),
    ("lumbre-render", &[3, 3]),
    ("lumbre-scene", &[3, 3, 2, 2, 2]),
    ("lumbre-shading", &[21, 5]),
    ("lumbre-simd", &[2]),
    ("lumbre-viewer", &[2]),
];

/// Where a file stands in its crate: `intersect/mod.rs` is `["intersect"]`, `lib.rs` is `[]`.
type Module = Vec<String>;

/// A file of a crate.
struct Source {
    /// Without comments and tests.
    text: String,
    /// The names of the items that it defines.
    items: BTreeSet<String>,
    /// The paths that it re-exports.
    exports: Vec<Module>,
}

/// Reads the files below `folder`, but for tests and `main.rs`.
fn read_sources(folder: &Path, module: &Module, found: &mut BTreeMap<Module, Source>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().expect("a name").to_str().expect("plain names").to_owned();
        let mut own = module.clone();
        if path.is_dir() && name != "tests" {
            own.push(name);
            read_sources(&path, &own, found);
        } else if path.extension().is_some_and(|extension| extension == "rs")
            && name != "tests"
            && name != "main"
        {
            if name != "mod" && name != "lib" {
                own.push(name);
            }
            let text = without_tests(&std::fs::read_to_string(&path).expect("a source"));
            let mut exports = Vec::new();
            for start in ["pub use ", "pub(crate) use ", "pub(super) use "] {
                for rest in text.split(start).skip(1) {
                    read_paths(rest, own.clone(), &mut exports);
                }
            }
            let items = text.lines().filter_map(defined_item).map(str::to_owned).collect();
            found.insert(own, Source { text, items, exports });
        }
    }
}

/// A source without comments, up to a module of tests.
fn without_tests(source: &str) -> String {
    let mut text = String::new();
    for line in source.lines() {
        let code = line.split("//").next().unwrap_or_default().trim_end();
        if code.starts_with("mod ") && code.ends_with('{') && text.ends_with("#[cfg(test)]\n") {
            break;
        }
        text.push_str(code);
        text.push('\n');
    }
    text
}

/// The item that a line begins to define.
fn defined_item(line: &str) -> Option<&str> {
    const BEFORE: [&str; 7] = ["pub", "crate", "super", "in", "unsafe", "async", "extern"];
    const KINDS: [&str; 9] =
        ["struct", "enum", "trait", "fn", "type", "const", "static", "union", "macro_rules!"];
    let words =
        line.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '!')).filter(|word| !word.is_empty());
    let mut words = words.skip_while(|word| BEFORE.contains(word)).peekable();
    words.next_if(|word| KINDS.contains(word))?;
    while words.next_if(|word| KINDS.contains(word) || BEFORE.contains(word)).is_some() {}
    words.next()
}

/// Reads a path, or a tree of paths as in `use`, with which a text begins below a module; what follows is left.
fn read_paths<'t>(text: &'t str, mut path: Module, found: &mut Vec<Module>) -> &'t str {
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        match &rest[..end] {
            "crate" => path.clear(),
            "super" => drop(path.pop()),
            "self" | "" => {}
            word => path.push(word.to_owned()),
        }
        rest = &rest[end..];
        let Some(after) = rest.strip_prefix("::") else { break };
        rest = after;
        if let Some(mut inner) = rest.strip_prefix('{') {
            while !inner.trim_start().starts_with('}') {
                inner = read_paths(inner, path.clone(), found);
                // Past `as name`.
                inner = inner.trim_start_matches(|c| c != ',' && c != '}');
                inner = inner.strip_prefix(',').unwrap_or(inner);
            }
            return inner.trim_start().strip_prefix('}').unwrap_or(inner);
        }
        if let Some(after) = rest.strip_prefix('*') {
            path.push("*".to_owned());
            rest = after;
            break;
        }
    }
    found.push(path);
    rest
}

/// The paths that a file names by `crate`, `super` or `self`, but for where something is visible.
fn named_paths(module: &Module, text: &str) -> Vec<Module> {
    let mut found = Vec::new();
    for start in ["crate::", "super::", "self::"] {
        for (at, _) in text.match_indices(start) {
            let before = &text[..at];
            let is_within = before.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
            if !is_within && !before.ends_with("(in ") {
                read_paths(&text[at..], module.clone(), &mut found);
            }
        }
    }
    found
}

/// The file that defines what a path names, or the module that it names.
fn definer(sources: &BTreeMap<Module, Source>, path: &[String], seen: &mut Vec<Module>) -> Option<Module> {
    if seen.iter().any(|before| before == path) {
        return None;
    }
    seen.push(path.to_vec());
    let len = (0..=path.len()).rev().find(|&len| sources.contains_key(&path[..len]))?;
    let (module, rest) = path.split_at(len);
    let Some(name) = rest.first() else { return (len > 0).then(|| module.to_vec()) };
    let source = &sources[module];
    if source.items.contains(name) {
        return Some(module.to_vec());
    }
    source.exports.iter().find_map(|export| match export.split_last() {
        Some((last, _)) if last == name => definer(sources, export, seen),
        Some((last, all)) if last == "*" => {
            definer(sources, &[all, std::slice::from_ref(name)].concat(), seen)
        }
        _ => None,
    })
}

/// Files that import one another, circle by circle, the largest first.
fn circles(sources: &BTreeMap<Module, Source>) -> Vec<Vec<Module>> {
    let imports = |module: &Module| -> Vec<Module> {
        let paths = named_paths(module, &sources[module].text);
        paths.iter().filter_map(|path| definer(sources, path, &mut Vec::new())).collect()
    };
    let imports: BTreeMap<&Module, Vec<Module>> =
        sources.keys().map(|module| (module, imports(module))).collect();
    let reached = |from: &Module| -> BTreeSet<Module> {
        let (mut reached, mut pending) = (BTreeSet::new(), imports[from].clone());
        while let Some(module) = pending.pop() {
            if reached.insert(module.clone()) {
                pending.extend(imports[&module].iter().cloned());
            }
        }
        reached
    };
    let reached: BTreeMap<&Module, BTreeSet<Module>> =
        sources.keys().map(|module| (module, reached(module))).collect();
    let around = |module: &Module| -> Vec<Module> {
        let mutual = reached[module].iter().filter(|other| reached[other].contains(module));
        mutual.cloned().collect()
    };
    let found: BTreeSet<Vec<Module>> = sources.keys().map(around).filter(|circle| circle.len() > 1).collect();
    let mut found: Vec<_> = found.into_iter().collect();
    found.sort_by_key(|circle| std::cmp::Reverse(circle.len()));
    found
}

#[test]
fn files_import_one_another_in_no_circles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace");
    for name in layers().into_keys().filter(|name| *name != "xtask") {
        let mut sources = BTreeMap::new();
        read_sources(&root.join("crates").join(name).join("src"), &Vec::new(), &mut sources);
        let found = circles(&sources);
        let allowed = CIRCLES.iter().find(|(of, _)| *of == name).map_or(&[][..], |(_, sizes)| sizes);
        let is_larger =
            |(i, circle): (usize, &Vec<Module>)| circle.len() > allowed.get(i).copied().unwrap_or(0);
        let sizes: Vec<_> = found.iter().map(Vec::len).collect();
        assert!(
            !found.iter().enumerate().any(is_larger),
            "{name}: circles of {sizes:?} files, where {allowed:?} are allowed: {found:?}"
        );
    }
}

#[test]
fn a_circle_of_files_is_noticed() {
    let files = [
        ("a", "use crate::b::{self, Second as Other};\npub struct First;"),
        ("b", "mod inner;\npub(crate) use self::inner::*;"),
        ("b/inner", "pub(super) struct Second { of: super::super::a::First }"),
        ("c", "fn third() { crate::b::Second }\npub(in crate::d) fn fourth() {}"),
        ("d", "use super::{c::third, b};"),
    ];
    let folder = tempfile::tempdir().expect("a folder");
    for (file, text) in files {
        let path = folder.path().join(format!("{file}.rs"));
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("written");
    }
    let mut sources = BTreeMap::new();
    read_sources(folder.path(), &Vec::new(), &mut sources);
    let names = |names: &[&str]| -> Vec<Module> {
        names.iter().map(|name| name.split('/').map(str::to_owned).collect()).collect()
    };
    assert_eq!(circles(&sources), [names(&["a", "b/inner"])]);
}
