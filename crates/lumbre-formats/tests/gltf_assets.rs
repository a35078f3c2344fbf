//! glTF files that others made, where there are some.

mod common;

use std::path::Path;

use common::{files_below, shared};
use lumbre_formats::gltf::{GltfOptions, open_gltf};
use lumbre_formats::{Budget, Diagnostics};
use lumbre_scene::{Scene, SceneDesc};

fn open(path: &Path) -> Result<(SceneDesc, Diagnostics), String> {
    let mut diagnostics = Diagnostics::new();
    let scene = open_gltf(path, &GltfOptions::default(), &Budget::default(), &mut diagnostics);
    scene.map(|scene| (scene, diagnostics)).map_err(|e| e.to_string())
}

#[test]
fn every_valid_asset_reads_and_builds() {
    let mut failures = vec![];
    let mut count = 0;
    for part in ["gltf/khronos", "gltf/asset-generator"] {
        let Some(folder) = shared(part) else { return };
        for path in files_below(&folder, &[".gltf", ".glb"]) {
            count += 1;
            match open(&path) {
                Err(error) => failures.push(error),
                Ok((scene, diagnostics)) => {
                    for warning in diagnostics.lines() {
                        println!("{warning}");
                    }
                    if let Err(error) = Scene::build(scene) {
                        failures.push(format!("{}: {error}", path.display()));
                    }
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} of {count}:\n{}", failures.len(), failures.join("\n"));
    assert!(count > 40, "{count}");
}

#[test]
fn what_the_validator_refuses_is_refused_and_what_it_warns_of_reads() {
    let Some(folder) = shared("gltf/gltf-validator") else { return };
    let mut failures = vec![];
    let mut refused = 0;
    let mut read = 0;
    for path in files_below(&folder, &[".gltf", ".glb"]) {
        let report = std::fs::read_to_string(format!("{}.report.json", path.display())).unwrap();
        let is_wrong = !report.contains("\"numErrors\": 0");
        match (open(&path), is_wrong) {
            (Ok(_), true) => {
                let codes: Vec<&str> = report.lines().filter(|l| l.contains("\"code\"")).collect();
                failures.push(format!("read: {} {codes:?}", path.display()));
            }
            (Err(error), false) => failures.push(format!("refused: {error}")),
            (Err(error), true) => {
                println!("{error}");
                refused += 1;
            }
            (Ok(_), false) => read += 1,
        }
    }
    assert!(failures.is_empty(), "{}:\n{}", failures.len(), failures.join("\n"));
    assert!(refused > 60 && read > 30, "{refused} {read}");
}
