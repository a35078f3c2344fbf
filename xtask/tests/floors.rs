//! The house holds: dependencies between our crates point down only.

use std::collections::BTreeMap;
use std::process::Command;

/// The floor that each crate lives on. A crate may depend on crates of lower floors only.
const FLOORS: &[(u32, &[&str])] = &[
    (0, &["lumbre-math", "lumbre-image"]),
    (1, &["lumbre-geometry"]),
    (2, &["lumbre-kernel", "lumbre-shading"]),
    (3, &["lumbre-scene"]),
    (4, &["lumbre-transport", "lumbre-film"]),
    (5, &["lumbre-render", "lumbre-formats"]),
    (6, &["lumbre"]),
    (7, &["lumbre-cli", "lumbre-bench", "xtask"]),
    (8, &["lumbre-pictures"]),
];

/// Floors whose crates must not do input or output: no crate here may lean on these.
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
    floors: &BTreeMap<&str, u32>,
) -> Vec<(&'a str, &'a str)> {
    let mut found = Vec::new();
    for (from, targets) in arrows {
        for to in targets {
            if let (Some(a), Some(b)) = (floors.get(from.as_str()), floors.get(to.as_str()))
                && a <= b
            {
                found.push((from.as_str(), to.as_str()));
            }
        }
    }
    found
}

fn floors() -> BTreeMap<&'static str, u32> {
    FLOORS.iter().flat_map(|(floor, crates)| crates.iter().map(move |name| (*name, *floor))).collect()
}

#[test]
fn every_crate_has_a_floor_and_every_arrow_points_down() {
    let arrows = arrows(&workspace());
    let floors = floors();
    let homeless: Vec<_> = arrows.keys().filter(|name| !floors.contains_key(name.as_str())).collect();
    assert!(homeless.is_empty(), "no floor for {homeless:?}: give them one here and in ARCHITECTURE.md");
    assert_eq!(arrows.len(), floors.len(), "a crate of the plan is missing from the workspace");
    let ours = arrows.values().flatten().filter(|to| floors.contains_key(to.as_str())).count();
    assert!(ours >= 20, "only {ours} arrows between our crates were seen: the test looks at the wrong thing");
    let wrong = upward(&arrows, &floors);
    assert!(wrong.is_empty(), "arrows that point up or sideways: {wrong:?}");
}

#[test]
fn an_arrow_that_points_up_is_noticed() {
    let mut arrows = arrows(&workspace());
    arrows.get_mut("lumbre-geometry").expect("a crate").push("lumbre-scene".to_owned());
    assert_eq!(upward(&arrows, &floors()), [("lumbre-geometry", "lumbre-scene")]);
}

#[test]
fn the_floors_of_mathematics_and_light_open_no_files() {
    let arrows = arrows(&workspace());
    let floors = floors();
    for (from, targets) in &arrows {
        if floors[from.as_str()] < NO_FILES_BELOW {
            let is_wrong =
                |to: &&String| FILE_CRATES.contains(&to.as_str()) && (from.as_str(), to.as_str()) != MAY_MAP;
            let wrong: Vec<_> = targets.iter().filter(is_wrong).collect();
            assert!(wrong.is_empty(), "{from} leans on {wrong:?}");
        }
    }
}
