//! A sheet of small pictures of every model in a folder, each with its name.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use lumbre::image::{Image, Rgb, srgb_to_linear};
use xtask::command::{release_program, root, run};

/// Pixels of a picture, and the strip below it for its name.
const WIDTH: u32 = 240;
const HEIGHT: u32 = 180;
const STRIP: u32 = 16;
/// Endings of what is shown.
const ENDINGS: [&str; 2] = ["glb", "gltf"];

/// Renders every model below `folder`, by default the sample models of glTF if they are next to the workspace, and
/// joins the pictures to one PNG.
pub(crate) fn sheet(folder: Option<&Path>, output: Option<&Path>, columns: u32, spp: u32) -> Result<()> {
    let folder = folder.map_or_else(shared_models, |folder| Ok(folder.to_owned()))?;
    let output = output.map_or_else(|| root().join("docs").join("gltf-models.png"), Path::to_owned);
    let mut models = Vec::new();
    collect(&folder, &mut models)?;
    models.sort_by_key(|(name, path)| (name.to_lowercase(), path.clone()));
    if models.is_empty() {
        bail!("no model below {}", folder.display());
    }
    let program = release_program()?;
    let scratch = root().join("target").join("contact");
    fs::create_dir_all(&scratch)?;
    let rows = (models.len() as u32).div_ceil(columns);
    let paper = Rgb::splat(srgb_to_linear(0.96));
    let mut sheet = Image::filled(columns * WIDTH, rows * (HEIGHT + STRIP), paper);
    let mut failures = Vec::new();
    for (i, (name, path)) in (0..).zip(&models) {
        let picture = scratch.join(format!("{i:03}.png"));
        let size = format!("{WIDTH}x{HEIGHT}");
        let arguments = [
            "render".into(),
            path.to_string_lossy(),
            "-o".into(),
            picture.to_string_lossy(),
            "--size".into(),
            size.into(),
            "--spp".into(),
            spp.to_string().into(),
            "--progress".into(),
            "none".into(),
        ];
        let arguments: Vec<&str> = arguments.iter().map(|a| &**a).collect();
        if let Err(error) = run(&program.to_string_lossy(), &arguments) {
            failures.push(format!("{}: {error}", path.display()));
            continue;
        }
        let image = lumbre::read_image(&picture)?;
        let (x, y) = (i % columns * WIDTH, i / columns * (HEIGHT + STRIP));
        put(&mut sheet, &image, x, y);
        write(&mut sheet, name, x, y + HEIGHT);
    }
    lumbre::write_image(&output, &sheet, &lumbre::SaveOptions::default())?;
    eprintln!("{}: {} models in {columns} columns", output.display(), models.len() - failures.len());
    if !failures.is_empty() {
        bail!("{} models were not rendered:\n{}", failures.len(), failures.join("\n"));
    }
    Ok(())
}

/// The folder of models by others, `shared/data/gltf/khronos` next to the workspace or above it.
fn shared_models() -> Result<PathBuf> {
    let beside = ["../shared", "../../shared"].map(|shared| root().join(shared).join("data/gltf/khronos"));
    let found = beside.into_iter().find(|folder| folder.is_dir());
    found.context("no folder of models (name one, as cargo xtask contact FOLDER)")
}

/// Models below a folder with their names: a file's own, or that of the folder above `glTF` and its like.
fn collect(folder: &Path, models: &mut Vec<(String, PathBuf)>) -> Result<()> {
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, models)?;
        } else if path.extension().is_some_and(|e| ENDINGS.iter().any(|known| e.eq_ignore_ascii_case(known)))
        {
            let above = path.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
            let name = match path.parent().and_then(Path::parent).and_then(Path::file_name) {
                Some(model) if above.starts_with("glTF") => model,
                _ => path.file_stem().unwrap_or_default(),
            };
            models.push((name.to_string_lossy().into_owned(), path));
        }
    }
    Ok(())
}

fn put(sheet: &mut Image, image: &Image, x: u32, y: u32) {
    let width = sheet.width();
    for j in 0..image.height().min(HEIGHT) {
        for i in 0..image.width().min(WIDTH) {
            sheet.pixels_mut()[((y + j) * width + x + i) as usize] = image.pixel(i, j);
        }
    }
}

/// Letters of five by seven, row by row from the top, the leftmost dot in bit 4.
const LETTERS: &[(char, [u8; 7])] = &[
    ('A', [14, 17, 17, 31, 17, 17, 17]),
    ('B', [30, 17, 17, 30, 17, 17, 30]),
    ('C', [14, 17, 16, 16, 16, 17, 14]),
    ('D', [30, 17, 17, 17, 17, 17, 30]),
    ('E', [31, 16, 16, 30, 16, 16, 31]),
    ('F', [31, 16, 16, 30, 16, 16, 16]),
    ('G', [14, 17, 16, 23, 17, 17, 14]),
    ('H', [17, 17, 17, 31, 17, 17, 17]),
    ('I', [14, 4, 4, 4, 4, 4, 14]),
    ('J', [7, 2, 2, 2, 2, 18, 12]),
    ('K', [17, 18, 20, 24, 20, 18, 17]),
    ('L', [16, 16, 16, 16, 16, 16, 31]),
    ('M', [17, 27, 21, 21, 17, 17, 17]),
    ('N', [17, 25, 21, 19, 17, 17, 17]),
    ('O', [14, 17, 17, 17, 17, 17, 14]),
    ('P', [30, 17, 17, 30, 16, 16, 16]),
    ('Q', [14, 17, 17, 17, 21, 18, 13]),
    ('R', [30, 17, 17, 30, 20, 18, 17]),
    ('S', [15, 16, 16, 14, 1, 1, 30]),
    ('T', [31, 4, 4, 4, 4, 4, 4]),
    ('U', [17, 17, 17, 17, 17, 17, 14]),
    ('V', [17, 17, 17, 17, 17, 10, 4]),
    ('W', [17, 17, 17, 21, 21, 27, 17]),
    ('X', [17, 17, 10, 4, 10, 17, 17]),
    ('Y', [17, 17, 10, 4, 4, 4, 4]),
    ('Z', [31, 1, 2, 4, 8, 16, 31]),
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('2', [14, 17, 1, 6, 8, 16, 31]),
    ('3', [30, 1, 1, 14, 1, 1, 30]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]),
    ('-', [0, 0, 0, 14, 0, 0, 0]),
    ('_', [0, 0, 0, 0, 0, 0, 31]),
    ('.', [0, 0, 0, 0, 0, 12, 12]),
];

/// Writes a name in capitals in the strip whose upper left corner is given, as much of it as fits.
fn write(sheet: &mut Image, name: &str, x: u32, y: u32) {
    let ink = Rgb::splat(srgb_to_linear(0.25));
    let width = sheet.width();
    let room = (WIDTH / 6) as usize - 1;
    for (i, c) in (0..).zip(name.chars().take(room)) {
        let Some((_, rows)) = LETTERS.iter().find(|(known, _)| *known == c.to_ascii_uppercase()) else {
            continue;
        };
        for (j, row) in (0..).zip(rows) {
            for dot in (0..5).filter(|dot| row >> (4 - dot) & 1 == 1) {
                let at = (y + 4 + j) * width + x + 6 + 6 * i + dot;
                sheet.pixels_mut()[at as usize] = ink;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_have_the_name_of_their_folder_or_their_own() {
        let folder = std::env::temp_dir().join(format!("lumbre-contact-{}", std::process::id()));
        for file in ["Duck/glTF-Binary/Duck.glb", "plain/a.gltf", "Duck/README.md", "Fox/glTF/odd.gltf"] {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        let mut models = Vec::new();
        collect(&folder, &mut models).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        let mut names: Vec<String> = models.into_iter().map(|(name, _)| name).collect();
        names.sort();
        assert_eq!(names, ["Duck", "Fox", "a"]);
    }

    #[test]
    fn names_are_written_inside_their_strip() {
        let paper = Rgb::WHITE;
        let mut sheet = Image::filled(2 * WIDTH, 2 * (HEIGHT + STRIP), paper);
        let (x, y) = (WIDTH, HEIGHT);
        write(&mut sheet, &"W".repeat(99), x, y);
        let mut inked = 0;
        for j in 0..sheet.height() {
            for i in 0..sheet.width() {
                if sheet.pixel(i, j) != paper {
                    inked += 1;
                    assert!((x..x + WIDTH).contains(&i) && (y..y + STRIP).contains(&j), "({i}, {j})");
                }
            }
        }
        assert!(inked > 300, "{inked}");
    }
}
