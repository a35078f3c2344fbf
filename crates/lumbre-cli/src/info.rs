//! `lumbre info`: the contents of a scene.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use lumbre::CancelToken;
use serde_json::json;

use crate::failure::{Failure, print};
use crate::reading::{ReadingArguments, print_warnings};
use crate::signals::Signals;

/// Prints what is in a scene, and what of it would not be rendered.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre info scene.pbrt
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
        let bounds = info.bounds.map(|b| json!({ "min": b.min.to_array(), "max": b.max.to_array() }));
        let report = json!({
            "shapes": info.shapes,
            "materials": info.materials,
            "lights": info.lights,
            "triangles": info.triangles,
            "instances": info.instances,
            "cameras": info.cameras,
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
    let cameras =
        if info.cameras.is_empty() { "none: one is made".to_owned() } else { info.cameras.join(", ") };
    let bounds = info.bounds.map_or("nothing finite".to_owned(), |b| format!("{} to {}", b.min, b.max));
    let report = [
        count("shapes", &info.shapes),
        line("triangles", info.triangles.to_string()),
        line("instances", info.instances.to_string()),
        count("materials", &info.materials),
        count("lights", &info.lights),
        line("cameras", cameras),
        line("bounds", bounds),
        line("memory", format!("{:.1} MiB", info.memory_bytes as f64 / f64::from(1 << 20))),
    ];
    print(&report.concat())?;
    print_warnings(&diagnostics);
    Ok(())
}
