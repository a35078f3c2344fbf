//! pbrt scenes against their expected means, from closed forms and other programs, where their folder is present.
//!
//! Each row of its table is a part of a picture, its mean, and the standard error of that. A mean may be wrong by 0.3 %
//! or what the row says, or by three standard errors of the row and four of its own, which are found of each pixel.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use lumbre::Scene;
use lumbre::formats::{Budget, Diagnostics, Limits, pbrt};

/// Scenes that are not as expected yet, with paths of colours and with those of wavelengths. One that is has to be
/// taken off.
const NOT_YET: [&[&str]; 2] = [&[], &[]];

/// A part of a picture.
struct Row {
    region: String,
    /// x0, y0, x1, y1; upper ends are excluded.
    pixels: [u32; 4],
    mean: [f64; 3],
    error: [f64; 3],
    /// Relative.
    tolerance: f64,
    /// Whether it is of paths of colours, and of those of wavelengths.
    holds_in: [bool; 2],
}

fn folder() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["../shared", "../../shared"].map(|shared| root.join(shared).join("cases/pbrt-rest"));
    folders.into_iter().find(|folder| folder.join("EXPECTED.md").exists())
}

/// The rows of each scene.
fn expected(text: &str) -> BTreeMap<String, Vec<Row>> {
    let mut scenes: BTreeMap<String, Vec<Row>> = BTreeMap::new();
    let (mut scene, mut is_of_colours) = (String::new(), false);
    let table = text.split("## Scenes").nth(1).unwrap().split("\n## ").next().unwrap();
    for line in table.lines().filter(|line| line.starts_with('|')).skip(2) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let ["", name, region, pixels, mean, error, how, ..] = cells[..] else { panic!("{line}") };
        if !name.is_empty() {
            name.clone_into(&mut scene);
            // It holds for the rows below, too.
            is_of_colours = how.contains("RGB transport");
        }
        let numbers =
            |cell: &str| -> Vec<f64> { cell.split([' ', ',']).map(|n| n.parse().unwrap()).collect() };
        let pixels: Vec<u32> = numbers(pixels).into_iter().map(|n| n as u32).collect();
        let error = match numbers(error)[..] {
            [all] => [all; 3],
            ref each => each.try_into().unwrap(),
        };
        let percent = ["allow ", "within "]
            .iter()
            .find_map(|word| how.split(word).nth(1)?.split(' ').next()?.parse::<f64>().ok());
        let rows = scenes.entry(scene.clone()).or_default();
        let needs_spectra = how.contains("needs spectra") || how.contains("traced per nm");
        let mut holds_in = [!needs_spectra, !is_of_colours];
        if let Some(region) = region.strip_suffix(", spectral") {
            holds_in = [false, true];
            rows.iter_mut().filter(|row| row.region == region).for_each(|row| row.holds_in[1] = false);
        }
        if how.contains("spectral value") {
            holds_in = [false, true];
        }
        rows.push(Row {
            region: region.to_owned(),
            pixels: pixels.try_into().unwrap(),
            mean: numbers(mean).try_into().unwrap(),
            error,
            tolerance: percent.unwrap_or(0.3).max(0.3) / 100.0,
            holds_in,
        });
    }
    scenes
}

/// Renders of a scene by samples of their own each.
const RENDERS: u32 = 8;

/// What is not as expected of a scene.
fn faults(path: &Path, rows: &[&Row], spp: u32, spectral: bool) -> Vec<String> {
    let mut diagnostics = Diagnostics::new();
    let desc = match pbrt::read_files(&[path], &Budget::new(Limits::default()), &mut diagnostics) {
        Ok(desc) => desc,
        Err(error) => return vec![error.to_string()],
    };
    // A picture may be right because what is left out cannot be seen.
    let warnings = diagnostics.lines();
    if !warnings.is_empty() {
        return warnings;
    }
    let scene = match Scene::from_description(desc) {
        Ok(scene) => scene,
        Err(error) => return vec![error.to_string()],
    };
    let pictures: Vec<_> = (0..RENDERS)
        .map(|i| {
            let mut options = scene.options();
            options.spectral = spectral;
            options.first_sample = i * spp;
            options.stop.spp = spp;
            scene.render(&options).unwrap()
        })
        .collect();
    let mut faults = vec![];
    for row in rows {
        let [x0, y0, x1, y1] = row.pixels;
        let (renders, pixels) = (f64::from(RENDERS), f64::from((x1 - x0) * (y1 - y0)));
        for c in 0..3 {
            let (mut sum, mut variance) = (0.0, 0.0);
            for (x, y) in (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))) {
                let values = || pictures.iter().map(|p| f64::from(p.image().pixel(x, y).to_array()[c]));
                let mean = values().sum::<f64>() / renders;
                sum += mean;
                variance += values().map(|v| (v - mean).powi(2)).sum::<f64>() / (renders - 1.0);
            }
            let mean = sum / pixels;
            let own = (variance / renders).sqrt() / pixels;
            let by_chance = 3.0 * row.error[c] + 4.0 * own;
            let allowed = (row.tolerance * row.mean[c].abs()).max(by_chance);
            let is_near = (mean - row.mean[c]).abs() <= allowed + 1e-9;
            if !is_near {
                let channel = ["red", "green", "blue"][c];
                faults.push(format!(
                    "{}, {channel}: {mean:.6}, standard error {own:.6}; expected {}",
                    row.region, row.mean[c]
                ));
            }
        }
    }
    faults
}

#[test]
fn scenes_have_the_means_that_are_expected_of_them() {
    let Some(folder) = folder() else { return };
    let only = std::env::var("LUMBRE_CASES").unwrap_or_default();
    let scenes = expected(&fs::read_to_string(folder.join("EXPECTED.md")).unwrap());
    let mut wrong = vec![];
    for (name, rows) in scenes.iter().filter(|(name, _)| name.contains(&*only)) {
        for (mode, spectral) in [false, true].into_iter().enumerate() {
            let rows: Vec<&Row> = rows.iter().filter(|row| row.holds_in[mode]).collect();
            if rows.is_empty() {
                continue;
            }
            let name = &**name;
            let faults = faults(&folder.join(format!("{name}.pbrt")), &rows, 16, spectral);
            let by = ["colours", "wavelengths"][mode];
            println!("{name}, by {by}: {}", if faults.is_empty() { "as expected" } else { "not" });
            match (faults.is_empty(), NOT_YET[mode].contains(&name)) {
                (true, true) => wrong.push(format!("{name}, by {by}, is as expected: take it off the list")),
                (false, false) => wrong.push(format!("{name}, by {by}: {}", faults.join("\n    "))),
                _ => {}
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
