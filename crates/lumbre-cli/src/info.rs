//! `lumbre info`: the contents of a scene.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use lumbre::CancelToken;
use serde_json::json;

use crate::console::escaped;
use crate::failure::{Failure, print};
use crate::reading::{ReadingArguments, print_warnings};
use crate::signals::Signals;

/// Prints what is in a scene, and what of it would not be rendered.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre info scene.pbrt
  lumbre info dancer.glb                        which cameras, animations, variants and textures it has
  lumbre info model.ply --json | python3 -m json.tool

Exit status 3 when the scene would not load.")]
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

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let _signals = Signals::listen(&CancelToken::new())?;
    let (scene, diagnostics) = arguments.reading.open(&arguments.scene)?;
    let info = scene.info();
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
            "warnings": diagnostics.lines(),
        });
        return print(&format!("{report:#}\n"));
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
        _ => shortened(info.cameras.iter().map(|name| escaped(name).into_owned())),
    };
    let animations = info.listing.animations.iter().enumerate().map(|(i, animation)| {
        let name = animation.name.as_ref().map_or_else(|| i.to_string(), |name| escaped(name).into_owned());
        animation.end.map_or_else(|| name.clone(), |end| format!("{name} ({end:.2} s)"))
    });
    let variants = info.listing.variants.iter().map(|name| escaped(name).into_owned());
    let textures = info.listing.textures.iter();
    let textures = textures.map(|t| format!("{} {}x{}", escaped(&t.name), t.width, t.height));
    // What most files lack is told only where it is.
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
        line("memory", format!("{:.1} MiB", info.memory_bytes as f64 / f64::from(1 << 20))),
    ];
    print(&report.concat())?;
    print_warnings(&diagnostics);
    Ok(())
}

/// How many names of a kind are printed: `--json` has all.
const MOST_NAMES: usize = 20;

fn shortened(names: impl ExactSizeIterator<Item = String>) -> String {
    let more = names.len().saturating_sub(MOST_NAMES);
    let mut text = names.take(MOST_NAMES).collect::<Vec<_>>().join(", ");
    if more > 0 {
        text += &format!(" and {more} more");
    }
    text
}
