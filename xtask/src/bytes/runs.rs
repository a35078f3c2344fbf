//! What every program is asked for.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Result, bail};
use xtask::command::root;

use crate::files;

/// Where programs write, from the root; all to the same names, which may stand in what they write.
pub(super) const FOLDER: &str = "target/bytes";

pub(super) const WHOLE: &str = "`scenes/glass/glass.pbrt`, 6 samples in one run";
pub(super) const RESUMED: &str = "the same, resumed from the checkpoint of the next program";
pub(super) const MERGED: &str = "the same, merged of parts of all programs";
/// The scene of both, small.
const SHARED: &str = "scenes/glass/glass.pbrt --size 48x36";
const QUERIES: [&str; 4] = ["closest", "any", "all", "count"];
const QUERIES_OF_POINTS: [&str; 3] = ["closest-point", "inside", "winding"];
/// The middle of the pictures in the book.
const PIXEL: &str = "160,120";

/// One run of a program.
pub(super) struct Run {
    pub(super) arguments: Vec<String>,
    /// The files that it writes.
    pub(super) outputs: Vec<String>,
    /// Whether an error is an answer: its message counts.
    pub(super) may_be_refused: bool,
}

/// All of them.
pub(super) struct Runs {
    /// By rows: those that one program makes alone.
    pub(super) alone: Vec<(String, Vec<Run>)>,
    /// A checkpoint, and what goes on from it.
    pub(super) begun: Run,
    pub(super) resumed: Run,
    /// Parts, and what joins them.
    pub(super) parts: Vec<Run>,
    pub(super) merged: Run,
}

impl Run {
    /// Of words parted by blanks; it writes to standard output.
    fn printing(words: &str) -> Self {
        Self {
            arguments: words.split_whitespace().map(str::to_owned).collect(),
            outputs: Vec::new(),
            may_be_refused: false,
        }
    }

    fn and(mut self, argument: &str) -> Self {
        self.arguments.push(argument.to_owned());
        self
    }

    /// It writes this file, by `-o`.
    fn writing(self, name: &str) -> Self {
        let mut run = self.and("-o").and(&format!("{FOLDER}/{name}"));
        run.outputs.push(name.to_owned());
        run
    }
}

/// A file below the root, as passed to programs.
fn relative(file: &Path) -> String {
    let file = file.strip_prefix(root()).unwrap_or(file);
    file.to_string_lossy().replace('\\', "/")
}

fn picture(scene: &str, options: &str, name: &str) -> Run {
    Run::printing(&format!("render {scene} {options} --quiet")).writing(name)
}

impl Runs {
    pub(super) fn new() -> Result<Self> {
        let mut alone = Vec::new();
        for ending in ["pbrt", "glb"] {
            for scene in files::with_ending(&root().join("scenes"), ending)? {
                let scene = relative(&scene);
                let run = picture(&scene, "--size 48x36 --spp 2 --denoise none", "picture.pfm");
                alone.push((format!("`{scene}`"), vec![run]));
            }
        }
        let kinds = kinds()?;
        for (kind, scenes) in &kinds {
            let run = |scene: &String| picture(scene, "--size 24x18 --spp 2", "picture.pfm");
            alone.push((format!("the book's {}", plural(kind)), scenes.iter().map(run).collect()));
        }
        let glass = "scenes/glass/glass.pbrt";
        for (row, options, name) in [
            ("in three wavelengths", "--spectral", "picture.exr"),
            ("by photons", "--integrator caustics", "picture.pfm"),
            ("denoised, mapped to 8 bits", "--denoise own --tonemap agx", "picture.png"),
            ("as JPEG", "--exposure 0.5", "picture.jpg"),
        ] {
            let run = picture(glass, &format!("--size 48x36 --spp 3 {options}"), name);
            alone.push((format!("`{glass}`, {row}"), vec![run]));
        }
        alone.push((
            "a scene of POV-Ray".to_owned(),
            vec![picture("docs/pictures/pov.pov", "--size 32x24 --spp 2", "picture.pfm")],
        ));

        let Some(shapes) = kinds.get("shape") else { bail!("no pictures of shapes") };
        std::fs::write(
            root().join(FOLDER).join("rays.csv"),
            table_of(&["ox", "oy", "oz", "dx", "dy", "dz"], ray),
        )?;
        std::fs::write(
            root().join(FOLDER).join("points.csv"),
            table_of(&["x", "y", "z"], |next| point(next).into()),
        )?;
        for (list, queries) in [("rays", &QUERIES[..]), ("points", &QUERIES_OF_POINTS[..])] {
            for query in queries {
                let run = |shape: &String| {
                    let words = format!("cast {shape} --{list} {FOLDER}/{list}.csv --query {query} --quiet");
                    // Some solids have no nearest point that is surely the nearest.
                    Run { may_be_refused: list == "points", ..Run::printing(&words) }
                };
                let row = format!("`cast --query {query}`, every shape");
                alone.push((row, shapes.iter().map(run).collect()));
            }
        }
        let explain = |scene: &String| {
            Run::printing(&format!("explain {scene} --pixel {PIXEL} --depth 1 --format json"))
        };
        let explained = kinds.values().flatten().map(explain).collect();
        alone.push(("`explain --format json`, the book's scenes".to_owned(), explained));
        let math = examples()?.iter().map(|example| Run::printing("math --json").and(example)).collect();
        alone.push(("`math --json`, the book's examples".to_owned(), math));
        alone.push((WHOLE.to_owned(), vec![picture(SHARED, "--spp 6", "whole.exr")]));

        let checkpoint = format!("--checkpoint {FOLDER}/picture.checkpoint");
        let mut begun = picture(SHARED, &format!("--spp 2 {checkpoint}"), "begun.exr");
        begun.outputs.push("picture.checkpoint".to_owned());
        Ok(Self {
            alone,
            begun,
            resumed: picture(SHARED, &format!("--spp 6 {checkpoint} --resume"), "whole.exr"),
            parts: ["0..1", "1..3", "3..5", "5..6"]
                .iter()
                .enumerate()
                .map(|(i, samples)| {
                    picture(SHARED, &format!("--spp 6 --samples {samples}"), &format!("{i}.part"))
                })
                .collect(),
            merged: (0..4)
                .fold(Run::printing("merge --quiet"), |run, i| run.and(&format!("{FOLDER}/{i}.part")))
                .writing("whole.exr"),
        })
    }
}

/// The scenes of the book's pictures by what they show, as the first word of their names says it.
fn kinds() -> Result<BTreeMap<String, Vec<String>>> {
    let mut kinds: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for scene in files::with_ending(&root().join("docs").join("pictures"), "pbrt")? {
        let scene = relative(&scene);
        if let Some((kind, _)) = scene.rsplit('/').next().and_then(|name| name.split_once('-')) {
            kinds.entry(kind.to_owned()).or_default().push(scene);
        }
    }
    Ok(kinds)
}

fn plural(kind: &str) -> String {
    match kind {
        "medium" => "media".to_owned(),
        "spectral" => "spectra".to_owned(),
        _ => format!("{kind}s"),
    }
}

/// Expressions of `lumbre math` in the book.
fn examples() -> Result<Vec<String>> {
    let mut examples = Vec::new();
    for page in files::with_ending(&root().join("docs"), "md")? {
        let text = std::fs::read_to_string(&page)?;
        let quoted = text.lines().filter_map(|line| line.strip_prefix("$ lumbre math '")?.split_once('\''));
        examples
            .extend(quoted.filter(|(_, rest)| rest.is_empty()).map(|(expression, _)| expression.to_owned()));
    }
    if examples.len() < 20 {
        bail!("{} examples of lumbre math in docs/", examples.len());
    }
    Ok(examples)
}

/// A column for each name, of thousandths.
fn table_of(names: &[&str], row: impl Fn(&mut dyn FnMut(i64) -> i64) -> Vec<i64>) -> String {
    let mut state = 7_u64;
    // Numerical Recipes' generator, of whose numbers the upper half is taken.
    let mut below = |bound: i64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        i64::from((state >> 33) as u32) % bound
    };
    let mut lines = vec![names.join(",")];
    for _ in 0..300 {
        let numbers = row(&mut below).into_iter().map(thousandths).collect::<Vec<_>>();
        lines.push(numbers.join(","));
    }
    lines.join("\n") + "\n"
}

fn thousandths(number: i64) -> String {
    let sign = if number < 0 { "-" } else { "" };
    format!("{sign}{}.{:03}", number.abs() / 1000, number.abs() % 1000)
}

/// Among the shapes.
fn point(below: &mut dyn FnMut(i64) -> i64) -> [i64; 3] {
    [below(3200) - 1600, below(2000) - 1000, below(1500)]
}

/// From around the shapes to among them.
fn ray(below: &mut dyn FnMut(i64) -> i64) -> Vec<i64> {
    let from = [below(10_000) - 5000, below(10_000) - 5000, 100 + below(6000)];
    let to = point(below);
    [from, [to[0] - from[0], to[1] - from[1], to[2] - from[2]]].concat()
}
