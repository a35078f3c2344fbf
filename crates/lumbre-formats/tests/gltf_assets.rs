//! glTF files that others made, where there are some.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::{files_below, shared};
use lumbre_formats::gltf::{GltfOptions, open_gltf};
use lumbre_formats::{Budget, Diagnostics, FormatError, Strictness};
use lumbre_scene::{Scene, SceneDesc};

fn open(path: &Path) -> Result<(SceneDesc, Diagnostics), String> {
    let mut diagnostics = Diagnostics::new();
    let scene = open_gltf(path, &GltfOptions::default(), &Budget::default(), &mut diagnostics);
    scene.map(|scene| (scene, diagnostics)).map_err(|e| e.to_string())
}

/// With everything that is wrong as an error, whether the rest would be shown or not.
fn open_strictly(path: &Path, budget: &Budget) -> Result<SceneDesc, FormatError> {
    let mut diagnostics = Diagnostics::with_strictness(Strictness::Strict);
    let scene = open_gltf(path, &GltfOptions::default(), budget, &mut diagnostics)?;
    diagnostics.check().map(|()| scene)
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

/// What reading may cost: 64 MiB and 32 times the size of the files.
fn bounded(path: &Path) -> (Result<SceneDesc, String>, Duration, f64) {
    // Buffers and images are next to the file.
    let beside = std::fs::read_dir(path.parent().unwrap()).unwrap();
    let size: u64 = beside.map(|entry| entry.unwrap().metadata().unwrap().len()).sum();
    let budget = Budget::default();
    let start = Instant::now();
    let scene = open_strictly(path, &budget);
    let share = budget.memory_peak() as f64 / ((64 << 20) + 32 * size) as f64;
    (scene.map_err(|e| e.to_string()), start.elapsed(), share)
}

#[test]
fn malformed_assets_are_errors_with_their_place() {
    let Some(folder) = shared("gltf/gltf-validator") else { return };
    let (mut refused, mut longest, mut largest) = (0, Duration::ZERO, 0.0_f64);
    for path in files_below(&folder, &[".gltf", ".glb"]) {
        let (read, time, share) = bounded(&path);
        // A guard against loops, not a measurement: machines that test may be busy.
        assert!(time < Duration::from_secs(10), "{}: {time:?}", path.display());
        assert!(share <= 1.0, "{}: {share} of what it may cost", path.display());
        (longest, largest) = (longest.max(time), largest.max(share));
        let Err(message) = read else { continue };
        refused += 1;
        let said = message.strip_prefix(&*path.display().to_string()).unwrap_or(&message);
        // Line and column or the byte, and the pointer but for what is wrong with the JSON itself or the whole of it.
        let has_place = said.starts_with(":byte ")
            || said.split(':').nth(1).is_some_and(|line| line.bytes().all(|b| b.is_ascii_digit()));
        let is_of_whole = ["JSON", "GLB", "missing", "empty file", "type (found", "truncated"]
            .iter()
            .any(|w| said.contains(w));
        assert!(has_place || said.contains("empty file") || said.contains("GLB"), "{message}");
        assert!(said.contains(" /") || is_of_whole, "{message}");
    }
    println!("{refused} refused, in {longest:?} and {largest:.3} of the memory at most");
    assert!(refused > 60, "{refused}");
}

#[test]
fn assets_that_the_validator_refuses_are_errors() {
    let Some(folder) = shared("gltf/gltf-validator") else { return };
    let mut failures = vec![];
    let mut refused = 0;
    let mut read = 0;
    for path in files_below(&folder, &[".gltf", ".glb"]) {
        let report = std::fs::read_to_string(format!("{}.report.json", path.display())).unwrap();
        let is_wrong = !report.contains("\"numErrors\": 0");
        let scene = if is_wrong {
            open_strictly(&path, &Budget::default()).map(drop).map_err(|e| e.to_string())
        } else {
            open(&path).map(drop)
        };
        match (scene, is_wrong) {
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
