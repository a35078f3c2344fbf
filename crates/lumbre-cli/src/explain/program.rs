//! The command `lumbre explain`, and the same pages in the viewer: what needs files, a terminal or a server.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use lumbre::description::IntegratorKind;
use lumbre::formats::{Diagnostics, atomic_write};
use lumbre::{RenderOptions, Scene, SceneDesc};
use lumbre_viewer::Explain;

use super::question::Question;
use super::things::SceneNames;
use super::{Request, explain, html, texts, title};
use crate::failure::{Failure, print};
use crate::language::Language;
use crate::names::one_of;
use crate::output::Inputs;
use crate::reading::{ReadingArguments, print_warnings};
use crate::shown::{PreparedScene, SceneRequest, shown};
use crate::spanish_messages::in_spanish;
use crate::staging::StagingArguments;
use crate::units;
use crate::view::ViewArguments;

/// Explains how a pixel gets its colour.
///
/// Or how much light comes along a ray: the camera and its ray, every surface on the way with the equation of its
/// crossings, normals, lights and shadows, and the path of one sample, with all numbers as the render computes them.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre explain scene.pbrt --pixel 320,240
  lumbre explain scene.pbrt --ray 0,0,-5,0,0,1 --nearest
  lumbre explain scene.pbrt --ray 0,2,-5,0,0,1 --shape sphere     why the ray misses it
  lumbre explain scene.pbrt --pixel 320,240 --only equation,radiance
  lumbre explain scene.pbrt --pixel 320,240 --format html -o pixel.html
  lumbre explain scene.pbrt --pixel 320,240 --sample 7 --depth 2 --digits 6
  lumbre explain scene.pbrt --pixel 320,240 --format markdown --lang es
  lumbre explain model.glb --pixel 100,80 --size 200x160 --format json | jq .")]
pub(crate) struct Arguments {
    /// The scene: .pbrt, .gltf, .glb, .obj, .ply, .stl or .pov, also compressed with gzip. Several are put into the
    /// same world.
    #[arg(required = true, value_name = "SCENE")]
    scene: Vec<PathBuf>,
    #[command(flatten)]
    request: Request,
    /// Write to this file.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Width and height of the picture in pixels.
    #[arg(long, value_name = "WxH", value_parser = units::size)]
    size: Option<(u32, u32)>,
    /// A camera of the scene, by its name or its index from 0.
    #[arg(long, value_name = "NAME|INDEX", help_heading = "View")]
    camera: Option<String>,
    /// What each pixel shows: light, or a property of the visible surface.
    #[arg(long, value_name = "NAME", value_parser = one_of(&IntegratorKind::NAMES, IntegratorKind::from_name))]
    integrator: Option<IntegratorKind>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", value_parser = units::whole(0..=u64::MAX))]
    seed: Option<u64>,
    /// Print errors only.
    #[arg(short, long)]
    quiet: bool,
    #[command(flatten)]
    view: ViewArguments,
    #[command(flatten)]
    staging: StagingArguments,
    #[command(flatten)]
    reading: ReadingArguments,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.staging.turntable().is_some() {
        return Err(Failure::Usage(texts(arguments.request.lang).no_turntable.to_owned()));
    }
    if arguments.request.pixel.is_none() && arguments.request.ray.is_none() {
        return Err(Failure::Usage(texts(arguments.request.lang).nothing_asked.to_owned()));
    }
    let named = arguments.scene.iter().map(PathBuf::as_path).chain(arguments.staging.inputs());
    if let Some(output) = &arguments.output {
        Inputs::of(named.chain(arguments.reading.overlays())).refuse(output)?;
    }
    let (desc, diagnostics) = arguments.reading.describe(&arguments.scene)?;
    if let Some(output) = &arguments.output {
        Inputs::of(diagnostics.files_read().iter().map(PathBuf::as_path)).refuse(output)?;
    }
    let things = SceneNames::of(&desc);
    let Arguments { size, camera, integrator, view, staging, reading, .. } = arguments;
    let name = arguments.scene.first().map_or(Path::new(""), PathBuf::as_path);
    let wish = SceneRequest {
        name,
        size: *size,
        camera: camera.as_deref(),
        integrator: *integrator,
        view,
        staging,
        reading,
        hidden: None,
    };
    let shown = shown(desc, &wish)?;
    if !arguments.quiet {
        warn(&diagnostics, arguments.request.lang);
        warn(&shown.diagnostics, arguments.request.lang);
    }
    let PreparedScene { scene, mut options, .. } = shown;
    if options.spectral && !arguments.quiet {
        say!("{}", texts(arguments.request.lang).no_wavelengths);
    }
    options.spectral = false;
    options.sampler.seed = arguments.seed.unwrap_or(options.sampler.seed);
    let written = explain(&scene, &options, &things, name, &arguments.request)?;
    match &arguments.output {
        None => print(&written),
        Some(path) => {
            Ok(atomic_write(path, |out| out.write_all(written.as_bytes())).map_err(lumbre::Error::from)?)
        }
    }
}

/// Prints the warnings of a reader in a language.
fn warn(diagnostics: &Diagnostics, language: Language) {
    if language == Language::En {
        return print_warnings(diagnostics);
    }
    for line in diagnostics.lines() {
        say!("{}", in_spanish(&line));
    }
    match diagnostics.warnings() {
        0 => {}
        1 => say!("1 aviso"),
        n => say!("{n} avisos"),
    }
}

/// Explains the pixels of one scene.
#[derive(Debug)]
pub struct Explainer {
    name: String,
    things: SceneNames,
}

impl Explainer {
    /// For a named scene, as described before it is staged.
    pub fn new(desc: &SceneDesc, name: String) -> Self {
        Self { name, things: SceneNames::of(desc) }
    }
}

impl Explain for Explainer {
    fn languages(&self) -> Vec<(&'static str, &'static str)> {
        let languages = Language::value_variants().iter().map(|language| texts(*language));
        languages.map(|texts| (texts.code, texts.language)).collect()
    }

    fn script(&self) -> Option<&'static str> {
        Some(html::SCRIPT_HASH)
    }

    fn page(
        &self,
        scene: &Scene,
        options: &RenderOptions,
        pixel: (u32, u32),
        language: &str,
    ) -> Result<String, String> {
        let texts = texts(Language::from_str(language, false)?);
        let question =
            Question { things: &self.things, texts, sample: 0, depth: 0, nearest: false, shapes: None };
        let sections = question.of_pixel(scene, options, pixel).map_err(|failure| failure.to_string())?;
        Ok(html::html(&title(&self.name, Some(pixel), texts), &sections, texts))
    }
}
