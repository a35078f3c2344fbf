//! POV-Ray's scenes against the pictures that POV-Ray renders of them, where their folder is present.
//!
//! A pixel differs by its largest channel. At most a share of the pixels may differ by more than 0.004, and the others
//! on average by next to nothing: `cases/pov/EXPECTED.md` says how much.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::path::{Path, PathBuf};

use lumbre::Scene;
use lumbre::formats::image::open_image;
use lumbre::formats::pov::{PovOptions, SYSTEM_LIBRARY, written_files};
use lumbre::formats::{Budget, Diagnostics, ReadOptions, open_scene};

/// Scenes that are not as expected yet. One that is has to be taken off.
const NOT_YET: &[&str] = &["lgt-area-full", "pat-blocks"];

const SIZE: [u32; 2] = [48, 36];
/// Pixels that differ by more than this count by their share.
const DIFFERENT: f32 = 0.004;

fn folder() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["../shared", "../../shared"].map(|shared| root.join(shared).join("cases/pov"));
    folders.into_iter().find(|folder| folder.join("EXPECTED.md").exists())
}

/// The share of pixels that may differ, and how much the others may on average.
fn allowed(name: &str) -> (f64, f64) {
    let share = match name {
        "fin-reflection" => 0.01,
        "obj-isosurface" | "obj-sweep-blob" | "int-refraction" | "pat-fractal" | "pat-function-slope"
        | "pat-geometric" => 0.02,
        "obj-text" => 0.03,
        _ if name.starts_with("obj-") || name.starts_with("csg-") || name == "uv-mapping" => 0.01,
        _ => 0.005,
    };
    let is_solid = ["obj-", "csg-", "pat-"].iter().any(|start| name.starts_with(start));
    let rest = if is_solid || matches!(name, "uv-mapping" | "int-refraction") { 0.0005 } else { 0.0003 };
    (share, rest)
}

/// What is not as expected of a scene.
fn faults(path: &Path, name: &str) -> Vec<String> {
    let (desc, diagnostics) = match open_scene(path, &ReadOptions::default()) {
        Ok(read) => read,
        Err(error) => return vec![error.to_string()],
    };
    let mut faults: Vec<String> =
        diagnostics.lines().into_iter().filter(|line| line.starts_with("warning")).collect();
    let scene = match Scene::from_description(desc) {
        Ok(scene) => scene,
        Err(error) => return vec![error.to_string()],
    };
    let mut options = scene.options();
    (options.width, options.height) = (SIZE[0], SIZE[1]);
    options.stop.spp = 1;
    options.stop.noise = None;
    let picture = scene.render(&options).unwrap();
    let (budget, mut said) = (Budget::default(), Diagnostics::new());
    // Its numbers are linear, whatever a reader takes them for.
    let expected = open_image(&path.with_extension("png"), &budget, &mut said).unwrap().bitmap;
    let (mut different, mut sum, mut same) = (0, 0.0, 0);
    // By cards of a sheet, so that a message names the one that is wrong.
    let mut cards = [0; 12];
    let mut sums = [[[0.0; 2]; 3]; 12];
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let found = picture.image().pixel(x, y).to_array().map(|c| c.clamp(0.0, 1.0));
            let expected = [0, 1, 2].map(|c| expected.stored(x, y, c));
            let card = (y / 12 * 4 + x / 12) as usize;
            for c in 0..3 {
                sums[card][c][0] += f64::from(found[c]);
                sums[card][c][1] += f64::from(expected[c]);
            }
            let most = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            if most > DIFFERENT || most.is_nan() {
                different += 1;
                cards[card] += 1;
            } else {
                sum += f64::from(most);
                same += 1;
            }
        }
    }
    if name.starts_with("media-") {
        // POV-Ray's own sampling of media is off by up to a tenth.
        let is_off = |[found, expected]: &[f64; 2]| (found - expected).abs() > 0.1 * expected;
        for (card, sums) in sums.iter().enumerate() {
            if sums.iter().any(is_off) {
                faults.push(format!("the mean of card {card} is off: {sums:?}"));
            }
        }
        return faults;
    }
    let (share, rest) = allowed(name);
    let found = f64::from(different) / f64::from(SIZE[0] * SIZE[1]);
    let mean = sum / f64::from(same.max(1));
    if found > share || mean > rest {
        faults.push(format!("{:.1} % differ, the rest by {mean:.5}; by cards {cards:?}", 100.0 * found));
    }
    faults
}

#[test]
fn pictures_are_those_of_povray() {
    let Some(folder) = folder() else { return };
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .filter_map(|entry| {
            let path = entry.unwrap().path();
            let is_case = path.extension().is_some_and(|e| e == "pov") && path.with_extension("png").exists();
            is_case.then(|| path.file_stem().unwrap().to_string_lossy().into_owned())
        })
        .collect();
    names.sort();
    assert!(names.len() > 40, "{names:?}");
    let only = std::env::var("LUMBRE_POV_CASE").ok();
    let mut wrong = Vec::new();
    let mut right = 0;
    for name in names.iter().filter(|name| only.as_ref().is_none_or(|only| only == *name)) {
        let faults = faults(&folder.join(name).with_extension("pov"), name);
        match (faults.is_empty(), NOT_YET.contains(&&**name)) {
            (true, true) => wrong.push(format!("{name}: is right by now")),
            (false, false) => wrong.push(format!("{name}: {}", faults.join("\n    "))),
            (true, false) => right += 1,
            (false, true) => {}
        }
    }
    assert!(wrong.is_empty(), "{right} of {} are right:\n{}", names.len(), wrong.join("\n"));
}

/// The values that POV-Ray itself prints, where they are.
#[test]
fn values_are_those_of_povray() {
    let Some(folder) = folder() else { return };
    let library = Path::new(SYSTEM_LIBRARY[0]);
    let (Ok(scene), Ok(expected)) = (
        std::fs::read_to_string(folder.join("values.pov")),
        std::fs::read_to_string(folder.join("values.csv")),
    ) else {
        return;
    };
    if !library.is_dir() {
        return;
    }
    let mut options = PovOptions::default();
    options.library.push(library.to_owned());
    let mut diagnostics = Diagnostics::new();
    let budget = Budget::default();
    let files = written_files(&scene, "values.pov", &folder, &options, &budget, &mut diagnostics);
    let found = &files.unwrap_or_else(|error| panic!("{error}"))["values.csv"];
    let mut wrong: Vec<String> = Vec::new();
    for (i, expected) in expected.lines().enumerate() {
        let found = found.lines().nth(i).unwrap_or("");
        if !VALUES_NOT_YET.iter().any(|name| expected.starts_with(name)) && !is_near(found, expected) {
            wrong.push(format!("{found}   expected   {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
}

/// Rows of values that are not there yet.
const VALUES_NOT_YET: &[&str] = &[
    "f_hetero_mf",
    "f_spiral",
    "f_hex_x",
    "f_hex_y",
    "f_mesh1",
    "normal prism cubic_spline",
    "trace ovus",
    "normal ovus",
    "trace julia",
    "normal julia",
    "text A",
    "text Lumbre",
];

/// Whether two rows say the same, to some digits.
fn is_near(found: &str, expected: &str) -> bool {
    let (found, expected): (Vec<&str>, Vec<&str>) =
        (found.split(',').collect(), expected.split(',').collect());
    found.len() == expected.len()
        && found.iter().zip(&expected).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() <= 2e-6 * (1.0 + b.abs()),
            _ => a == b,
        })
}
