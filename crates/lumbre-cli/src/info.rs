//! `lumbre info`: the contents of a scene.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use clap::Args;
use lumbre::{CancelToken, Part, Prepared, Scene, SceneInfo, Stage};
use serde_json::json;

use crate::checkpoint::open_part;
use crate::console::{escaped_json, escaped_line};
use crate::failure::{Failure, print};
use crate::memory::picture_bytes;
use crate::reading::{ReadingArguments, print_warnings};
use crate::report::{caustics_line, caustics_not_found};
use crate::signals::Signals;
use crate::units::counted;

/// Prints what is in a scene, and which parts are not rendered.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre info scene.pbrt
  lumbre info dancer.glb                        which cameras, animations, variants and textures it has
  lumbre info model.ply --json | python3 -m json.tool
  lumbre info picture.exr.checkpoint            which samples a part or a checkpoint has, of which render

Exit status 3 when the scene cannot be loaded.")]
pub(crate) struct Arguments {
    /// The scene.
    #[arg(required = true)]
    scene: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    reading: ReadingArguments,
}

/// Whether the name is that of a part or a checkpoint: then the message is about that, whatever is in the file.
fn is_called_part(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    ending.is_some_and(|ending| ending == "part" || ending == "checkpoint")
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let _signals = Signals::listen(&CancelToken::new())?;
    if let [path] = &arguments.scene[..]
        && (Part::is_in(path) || is_called_part(path))
    {
        let part = open_part(path, arguments.reading.memory())?;
        return print(&about_part(&part, arguments.json));
    }
    let (mut desc, mut diagnostics) = arguments.reading.describe(&arguments.scene)?;
    arguments.reading.check_build(&desc, &diagnostics)?;
    // What is in the file, before it is set on a stage: a model without a camera is measured as `lumbre render` shows
    // it.
    let mut info = SceneInfo::of(&desc);
    let prepared = lumbre::prepare(&mut desc, &Stage::default(), None);
    let scene = Scene::of_file(desc, &arguments.scene[0], &mut diagnostics)?;
    (info.bounds, info.memory_bytes) = (scene.info().bounds, scene.info().memory_bytes);
    let held = diagnostics.memory_held().saturating_add(scene.resolved().accel().memory_bytes() as u64);
    let predicted = Predicted::of(&scene, &prepared, held);
    let caustics = caustics_not_found(&scene, &scene.options());
    if arguments.json {
        let animations = info.listing.animations.iter().map(|a| json!({ "name": a.name, "seconds": a.end }));
        let textures = info.listing.textures.iter();
        let textures = textures.map(|t| json!({ "name": t.name, "width": t.width, "height": t.height }));
        let bounds = info.bounds.map(|b| json!({ "min": b.min.to_array(), "max": b.max.to_array() }));
        let report = json!({
            "shapes": info.shapes,
            "materials": info.materials,
            "lights": info.lights,
            "triangles": info.triangles,
            "instances": info.instances,
            "cameras": info.cameras,
            "animations": animations.collect::<Vec<_>>(),
            "variants": info.listing.variants,
            "textures": textures.collect::<Vec<_>>(),
            "bounds": bounds,
            "memory_bytes": info.memory_bytes,
            "caustic_share": scene.caustic_share(&scene.options()).ok(),
            "picture": predicted.as_ref().ok().map(|predicted| json!({
                "width": predicted.width,
                "height": predicted.height,
                "memory_bytes": predicted.bytes,
                "seconds_per_sample": predicted.seconds_per_sample,
                "threads": predicted.threads,
            })),
            "warnings": diagnostics.lines(),
        });
        return print(&escaped_json(&report));
    }
    let line = |title: &str, what: String| format!("{title:<11}{what}\n");
    let count = |title: &str, counts: &BTreeMap<String, u64>| {
        let total: u64 = counts.values().sum();
        let each: Vec<String> = counts.iter().map(|(name, n)| format!("{n} {name}")).collect();
        let colon = if each.is_empty() { "" } else { ": " };
        line(title, format!("{total}{colon}{}", each.join(", ")))
    };
    let cameras = match info.cameras.len() {
        0 => "none: one is made".to_owned(),
        _ => shortened(info.cameras.iter().map(|name| escaped_line(name).into_owned())),
    };
    let animations = info.listing.animations.iter().enumerate().map(|(i, animation)| {
        let name =
            animation.name.as_ref().map_or_else(|| i.to_string(), |name| escaped_line(name).into_owned());
        animation.end.map_or_else(|| name.clone(), |end| format!("{name} ({end:.2} s)"))
    });
    let variants = info.listing.variants.iter().map(|name| escaped_line(name).into_owned());
    let textures = info.listing.textures.iter();
    let textures = textures.map(|t| format!("{} {}x{}", escaped_line(&t.name), t.width, t.height));
    // Most files lack these: printed only if present.
    let listed = |title: &str, names: Vec<String>| match names.len() {
        0 => String::new(),
        count => line(title, format!("{count}: {}", shortened(names.into_iter()))),
    };
    let bounds = info.bounds.map_or("nothing finite".to_owned(), |b| format!("{} to {}", b.min, b.max));
    let report = [
        count("shapes", &info.shapes),
        line("triangles", info.triangles.to_string()),
        line("instances", info.instances.to_string()),
        count("materials", &info.materials),
        count("lights", &info.lights),
        line("cameras", cameras),
        listed("animations", animations.collect()),
        listed("variants", variants.collect()),
        listed("textures", textures.collect()),
        line("bounds", bounds),
        line("memory", format!("{:.1} MiB", mebibytes(info.memory_bytes))),
        caustics.map_or_else(String::new, |share| line("caustics", caustics_line(share))),
        line("picture", predicted.map_or_else(|wrong| wrong.to_string(), |predicted| predicted.to_string())),
    ];
    print(&report.concat())?;
    print_warnings(&diagnostics);
    Ok(())
}

/// What a picture of a scene takes.
struct Predicted {
    width: u32,
    height: u32,
    /// The peak of the process: the program, the scene and the picture.
    bytes: u64,
    /// Measured.
    seconds_per_sample: f64,
    threads: usize,
}

impl Predicted {
    /// As `lumbre render` makes it, where no option asks for another. `held` bytes are the scene.
    fn of(scene: &Scene, prepared: &Prepared, held: u64) -> Result<Self, lumbre::Error> {
        // The program itself, with its tables and the columns of its threads.
        const PROGRAM: u64 = 18 << 20;
        let options = prepared.options(scene, None, None);
        Ok(Self {
            width: options.width,
            height: options.height,
            bytes: picture_bytes(&options)?.saturating_add(held).saturating_add(PROGRAM),
            seconds_per_sample: scene.seconds_per_sample(&options)?,
            threads: rayon::current_num_threads(),
        })
    }
}

impl fmt::Display for Predicted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, bytes, seconds_per_sample: seconds, threads } = self;
        write!(f, "{width}x{height}, {:.0} MiB with its scene, ", mebibytes(*bytes))?;
        match seconds {
            0.1.. => write!(f, "{seconds:.2} s")?,
            _ => write!(f, "{:.1} ms", 1e3 * seconds)?,
        }
        write!(f, " for a sample of each pixel with {} (measured)", counted(*threads as u64, "thread"))
    }
}

fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// What a part or a checkpoint holds.
fn about_part(part: &Part, as_json: bool) -> String {
    let state = &part.state;
    let (width, height) = part.job.size;
    if as_json {
        let pieces = state.pieces().iter().map(|piece| {
            let b = piece.bounds;
            json!({ "crop": [b.x0, b.y0, b.x1, b.y1], "samples": [piece.samples.start, piece.samples.end] })
        });
        let report = json!({
            "part": {
                "width": width,
                "height": height,
                "pieces": pieces.collect::<Vec<_>>(),
                "taken": state.taken(),
                "wanted": state.wanted(),
                "least_samples": state.least_samples(),
                "render": part.job.identity,
            },
        });
        return escaped_json(&report);
    }
    let done = if state.is_finished() { "finished" } else { "unfinished: --resume continues it" };
    let mut text = format!("part       of a picture of {width}x{height}, {done}\n");
    for piece in state.pieces() {
        let (b, samples) = (piece.bounds, &piece.samples);
        text += &format!(
            "samples    {}..{} of pixels {},{},{},{}\n",
            samples.start, samples.end, b.x0, b.y0, b.x1, b.y1
        );
    }
    text += &format!("taken      {} of {}\n", state.taken(), state.wanted());
    // The options that tell renders apart at a glance; `--json` has all.
    let options = [
        ("picture", "frame"),
        ("camera", "camera"),
        ("integrator", "integrator"),
        ("seed", "seed"),
        ("version", "version"),
    ];
    for (name, title) in options {
        let Some(value) = part.job.identity.get(name).filter(|value| *value != "none") else { continue };
        let value = value.strip_prefix("kind ").unwrap_or(value);
        let value = value.split([' ', ',']).next().unwrap_or_default();
        text += &format!("{title:<11}{}\n", escaped_line(value));
    }
    let files = part.job.identity.keys().filter_map(|name| name.strip_prefix("file "));
    let files: Vec<String> = files.map(|name| escaped_line(name).into_owned()).collect();
    text + &format!("files      {}\n", shortened(files.into_iter()))
}

/// How many names of a kind are printed: `--json` has all.
const MAX_NAMES: usize = 20;

fn shortened(names: impl ExactSizeIterator<Item = String>) -> String {
    let more = names.len().saturating_sub(MAX_NAMES);
    let mut text = names.take(MAX_NAMES).collect::<Vec<_>>().join(", ");
    if more > 0 {
        text += &format!(" and {more} more");
    }
    text
}
