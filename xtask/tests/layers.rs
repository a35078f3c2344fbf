//! The architecture holds: dependencies between our crates, and between folders within them, point down only.

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
    (9, &["lumbre-dev", "lumbre-python"]),
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
