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
const NOT_YET: &[&str] = &[
    "int-refraction",
    "lgt-area-full",
    "media-simple",
    "obj-height-field",
    "obj-patch-mesh",
    "pat-blocks",
    "pat-turbulence-warp",
];

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
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let found = picture.image().pixel(x, y).to_array().map(|c| c.clamp(0.0, 1.0));
            let expected = [0, 1, 2].map(|c| expected.stored(x, y, c));
            let most = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            if most > DIFFERENT || most.is_nan() {
                different += 1;
                cards[(y / 12 * 4 + x / 12) as usize] += 1;
            } else {
                sum += f64::from(most);
                same += 1;
            }
        }
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
    "trace height_field",
    "normal height_field",
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

/// What became of the scenes of a folder: how many are read, how many without a warning, and how many have the picture
/// that POV-Ray makes of them, where `povray` is on the path. `LUMBRE_POV_CORPUS=/usr/share/doc/povray/examples cargo
/// test -p lumbre --test pov -- --ignored --nocapture`; with `LUMBRE_POV_CASE=glass` those whose path has this in it.
#[test]
#[ignore = "its scenes are where POV-Ray's examples are installed"]
fn the_corpus_is_read() {
    let Ok(folder) = std::env::var("LUMBRE_POV_CORPUS") else { return };
    let only = std::env::var("LUMBRE_POV_CASE").unwrap_or_default();
    let mut folders = vec![PathBuf::from(folder)];
    let mut scenes = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "pov") && path.to_string_lossy().contains(&only) {
                scenes.push(path);
            }
        }
    }
    scenes.sort();
    assert!(!scenes.is_empty());
    let pictures = tempfile::tempdir().unwrap();
    let has_povray = std::process::Command::new("povray").arg("--version").output().is_ok();
    let (mut read, mut clean, mut drawn, mut compared, mut agree) = (0, 0, 0, 0, 0);
    let mut warnings: std::collections::BTreeMap<String, u32> = std::collections::BTreeMap::new();
    for path in &scenes {
        let name = path.display();
        let mut options = ReadOptions::default();
        (options.pov.width, options.pov.height) = (CORPUS_SIZE[0], CORPUS_SIZE[1]);
        // Scenes that are frames of an animation have no other than its first.
        let is_frame = path.to_string_lossy().contains("/portfolio/");
        options.pov.frame_number = u32::from(is_frame);
        options.pov.frames = is_frame.then_some([1, 2]);
        let (desc, diagnostics) = match open_scene(path, &options) {
            Ok(found) => found,
            Err(error) => {
                println!("{name}: {error}");
                continue;
            }
        };
        read += 1;
        let said: std::collections::BTreeSet<String> = diagnostics
            .kept()
            .iter()
            .filter(|d| d.severity == lumbre::formats::Severity::Warning)
            .map(|d| d.message.clone())
            // What a scene says by `#warning` is its own.
            .filter(|message| !message.starts_with("the scene says"))
            .collect();
        clean += u32::from(said.is_empty());
        for message in said {
            *warnings.entry(message).or_default() += 1;
        }
        if !has_povray {
            continue;
        }
        let Some(ours) = corpus_picture(desc) else { continue };
        drawn += 1;
        let Some(theirs) = povray_picture(path, pictures.path(), is_frame) else { continue };
        compared += 1;
        let (share, mean) = difference(&ours, &theirs);
        let agrees = share <= 0.03 && mean <= 0.01;
        agree += u32::from(agrees);
        let verdict = if agrees { "agrees" } else { "differs" };
        println!("{name}: {verdict}, {:.1} % of its pixels, by {mean:.4} on average", 100.0 * share);
    }
    let mut warnings: Vec<_> = warnings.into_iter().collect();
    warnings.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    println!("\n| scenes | warning |\n|---|---|");
    for (message, count) in warnings.iter().take(40) {
        println!("| {count} | {message} |");
    }
    println!(
        "\n| scenes | read | without a warning | rendered | by POV-Ray, too | agree |\n|---|---|---|---|---|---|"
    );
    println!("| {} | {read} | {clean} | {drawn} | {compared} | {agree} |", scenes.len());
}

/// The size at which scenes are compared.
const CORPUS_SIZE: [u32; 2] = [80, 60];

/// The picture of a scene, one ray through the middle of each pixel, as numbers of a screen.
fn corpus_picture(desc: lumbre::SceneDesc) -> Option<Vec<[f32; 3]>> {
    let scene = Scene::from_description(desc).ok()?;
    let mut options = scene.options();
    (options.width, options.height) = (CORPUS_SIZE[0], CORPUS_SIZE[1]);
    options.stop.spp = 1;
    options.stop.noise = None;
    options.stop.time = Some(std::time::Duration::from_secs(60));
    let picture = scene.render(&options).ok()?;
    let encoded = |c: f32| {
        let c = if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) };
        if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
    };
    Some(picture.image().pixels().iter().map(|c| c.to_array().map(encoded)).collect())
}

/// The picture that POV-Ray makes of a scene.
fn povray_picture(path: &Path, pictures: &Path, is_frame: bool) -> Option<Vec<[f32; 3]>> {
    let out = pictures.join("scene.png");
    let _ = std::fs::remove_file(&out);
    let mut command = std::process::Command::new("povray");
    command.current_dir(path.parent()?).arg(format!("+I{}", path.file_name()?.to_string_lossy()));
    command.arg(format!("+O{}", out.display())).args(["-D", "-A", "+WT1", "+FN8", "-GA"]);
    command.args([format!("+W{}", CORPUS_SIZE[0]), format!("+H{}", CORPUS_SIZE[1])]);
    if is_frame {
        command.args(["+KFI1", "+KFF2", "+SF1", "+EF1"]);
    }
    command.output().ok()?;
    let found = [out.clone(), pictures.join("scene1.png")].into_iter().find(|file| file.exists())?;
    let (budget, mut said) = (Budget::default(), Diagnostics::new());
    let bitmap = open_image(&found, &budget, &mut said).ok()?.bitmap;
    std::fs::remove_file(&found).ok()?;
    let pixel = |i: u32| [0, 1, 2].map(|c| bitmap.stored(i % CORPUS_SIZE[0], i / CORPUS_SIZE[0], c));
    Some((0..CORPUS_SIZE[0] * CORPUS_SIZE[1]).map(pixel).collect())
}

/// The share of pixels that differ by more than 0.03 in a channel, and the mean of the differences.
fn difference(ours: &[[f32; 3]], theirs: &[[f32; 3]]) -> (f64, f64) {
    let (mut different, mut sum) = (0, 0.0);
    for (a, b) in ours.iter().zip(theirs) {
        let each = [0, 1, 2].map(|c| f64::from((a[c] - b[c]).abs()));
        different += u32::from(each.iter().any(|d| *d > 0.03));
        sum += each.iter().sum::<f64>() / 3.0;
    }
    let count = ours.len().max(1) as f64;
    (f64::from(different) / count, sum / count)
}
