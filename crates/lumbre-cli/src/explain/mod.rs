//! `lumbre explain`: every number between a pixel or a ray and its colour.

use std::collections::BTreeSet;
use std::path::Path;

use clap::Args;
use lumbre::{DVec3, Ray, RenderOptions, Scene};
use serde_json::json;

use crate::console::{escaped_json, escaped_lines};
use crate::failure::Failure;
use crate::language::{Language, filled};
use crate::units;

mod along;
mod camera;
mod digits;
mod document;
mod english;
mod equation;
mod figure;
mod formula;
mod html;
mod labels;
mod light;
mod misses;
mod numbers;
mod plot;
// What a browser leaves out.
#[cfg(not(target_family = "wasm"))]
pub(crate) mod program;
mod question;
mod shape;
mod sketch;
mod spanish;
mod surfaces;
mod texts;
mod things;
mod writing;

pub use digits::Digits;
use digits::digits;
use document::Section;
use english::ENGLISH;
use question::Question;
use spanish::SPANISH;
use surfaces::Chosen;
use texts::Texts;
pub use things::SceneNames;

/// What is to be explained, and how that is told.
#[derive(Args, Clone, Debug)]
pub struct Request {
    /// The pixel, from 0,0 in the upper left corner.
    #[arg(long, value_name = "X,Y", value_parser = pixel)]
    pub pixel: Option<(u32, u32)>,
    /// A ray instead of a pixel: origin, direction and, if wanted, its range of t. The direction is of any length but
    /// 0, the range from 0 to infinity by default.
    #[arg(long, value_name = "OX,OY,OZ,DX,DY,DZ[,TMIN,TMAX]", allow_hyphen_values = true, value_parser = ray, conflicts_with = "pixel")]
    pub ray: Option<Ray>,
    /// The format of the explanation.
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    pub format: Format,
    /// The language: English or Spanish.
    #[arg(long, value_enum, value_name = "LANGUAGE", default_value_t = Language::En)]
    pub lang: Language,
    /// Also list the crossings of the next N bounce rays.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = units::whole(0..=u32::MAX))]
    pub depth: u32,
    /// Which sample of the pixel to explain.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = units::whole(0..=u32::MAX))]
    pub sample: u32,
    /// Explain only the visible surface, not those behind it.
    #[arg(long)]
    pub nearest: bool,
    /// Explain this shape, hit or missed: its number, its kind, or the name of its material.
    #[arg(long, value_name = "NAME|N", conflicts_with = "nearest")]
    pub shape: Option<String>,
    /// Explain all shapes, also those that the ray misses.
    #[arg(long, conflicts_with_all = ["nearest", "shape"])]
    pub all_shapes: bool,
    /// Print only the sections with these keys of JSON, such as hit,radiance. More: camera, equation, Quadratic,
    /// transform, light, …
    #[arg(long, value_name = "KEY,…", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Digits of the numbers: full, or at most this many, such as 6. JSON always has all.
    #[arg(long, value_name = "N|full", default_value = "full", value_parser = digits)]
    pub digits: Digits,
}

/// The format of an explanation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Plain text.
    Text,
    /// Markdown, with formulas in LaTeX.
    Markdown,
    /// One page, with formulas and a sketch.
    Html,
    /// For programs.
    Json,
}

impl Format {
    /// The names.
    pub const NAMES: [&'static str; 4] = ["text", "markdown", "html", "json"];

    /// The format of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        clap::ValueEnum::from_str(name, false).ok()
    }
}

/// The texts of a language.
fn texts(language: Language) -> &'static Texts {
    language.choose(&ENGLISH, &SPANISH)
}

fn pixel(text: &str) -> Result<(u32, u32), String> {
    let numbers =
        text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    numbers.ok_or_else(|| "expected two whole numbers, such as 320,240".to_owned())
}

fn ray(text: &str) -> Result<Ray, String> {
    let wrong = || "expected six numbers, the origin and the direction, such as 0,0,-5,0,0,1".to_owned();
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let numbers = numbers.ok_or_else(wrong)?;
    let (&[ox, oy, oz, dx, dy, dz], range) = numbers.split_first_chunk().ok_or_else(wrong)?;
    let (origin, direction) = (DVec3::new(ox, oy, oz), DVec3::new(dx, dy, dz));
    if !origin.is_finite() || !direction.is_finite() || direction == DVec3::ZERO {
        return Err("expected finite numbers and a direction other than 0,0,0".to_owned());
    }
    match *range {
        [] => Ok(Ray::new(origin, direction)),
        [from, to] if from <= to => Ok(Ray::new(origin, direction).with_range(from, to)),
        _ => Err("expected the least and the greatest t after the direction, such as 0,0,-5,0,0,1,0,100"
            .to_owned()),
    }
}

/// Explains a pixel of a scene's picture, or the light along a ray in it.
///
/// # Errors
/// [`Failure::Usage`] for a pixel outside of the picture, and for options that make no picture.
pub fn explain(
    scene: &Scene,
    options: &RenderOptions,
    things: &SceneNames,
    name: &Path,
    request: &Request,
) -> Result<String, Failure> {
    let mut sections = told(request, scene, options, things)?;
    if !request.only.is_empty() {
        sections = only(sections, &request.only, texts(request.lang))?;
    }
    if request.format != Format::Json {
        sections = sections.into_iter().map(|section| request.digits.rounded(section)).collect();
    }
    Ok(written(request, name, &sections))
}

fn told(
    request: &Request,
    scene: &Scene,
    options: &RenderOptions,
    things: &SceneNames,
) -> Result<Vec<Section>, Failure> {
    let &Request { sample, depth, nearest, .. } = request;
    let shapes = match &request.shape {
        Some(name) => Some(Chosen::Called(name.clone())),
        None => request.all_shapes.then_some(Chosen::All),
    };
    let texts = texts(request.lang);
    let question = Question { things, texts, sample, depth, nearest, shapes };
    let Some((x, y)) = request.pixel else {
        let ray = request.ray.unwrap_or(Ray::new(DVec3::ZERO, DVec3::Z));
        return question.of_ray(scene, options, &ray);
    };
    let (width, height) = (options.width, options.height);
    if x >= width || y >= height {
        let (pixel, size) = (format!("{x},{y}"), format!("{width},{height}"));
        return Err(Failure::Usage(filled(texts.outside_picture, &[&pixel, &size])));
    }
    question.of_pixel(scene, options, (x, y))
}

/// The keys of an explanation's sections, without numbered ones: `shape 2`, `operand 0`, `transform 1`, `vertex 0`.
const KEYS: [&str; 50] = [
    "Parameters",
    "ScaledRay",
    "SetUp",
    "Quadratic",
    "Discriminant",
    "Roots",
    "Nappe",
    "Tip",
    "FirstCut",
    "SecondCut",
    "FirstBall",
    "SecondBall",
    "Plane",
    "Slabs",
    "Span",
    "TorusFrame",
    "TorusBounds",
    "Quartic",
    "QuarticExtrema",
    "QuarticRoots",
    "TextbookQuartic",
    "Shear",
    "EdgeFunctions",
    "MollerTrumbore",
    "PlaneAndSides",
    "Winding",
    "Rulings",
    "Intervals",
    "Surface",
    "camera",
    "ray",
    "surfaces",
    "transform",
    "equation",
    "crossings",
    "hit",
    "light",
    "start",
    "left",
    "added",
    "medium",
    "mirror",
    "lights",
    "sampled light",
    "scattered",
    "radiance",
    "shape",
    "operand",
    "vertex",
    "mesh",
];

/// Whether any explanation may have a section with this key.
fn is_key(key: &str) -> bool {
    let is_number = |text: &str| text.parse::<u32>().is_ok();
    KEYS.contains(&key)
        || key.split_once(' ').is_some_and(|(kind, number)| {
            ["shape", "operand", "transform", "vertex"].contains(&kind) && is_number(number)
        })
}

/// The sections with these keys, each with its subsections. A valid key without a section is no error, such as the hit
/// of a ray that meets nothing.
fn only(sections: Vec<Section>, keys: &[String], texts: &Texts) -> Result<Vec<Section>, Failure> {
    let mut known = BTreeSet::new();
    sections.iter().for_each(|section| section.collect_keys(&mut known));
    match keys.iter().find(|key| !known.contains(key.as_str()) && !is_key(key)) {
        None => Ok(sections.into_iter().flat_map(|section| section.with_keys(keys)).collect()),
        Some(key) => {
            let known = Vec::from_iter(known).join(", ");
            Err(Failure::Usage(filled(texts.no_such_key, &[key, &known])))
        }
    }
}

fn written(request: &Request, name: &Path, sections: &[Section]) -> String {
    let texts = texts(request.lang);
    let name = name.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let title = title(&name, request.pixel, texts);
    match request.format {
        Format::Text if sections.is_empty() => format!("{}\n", texts.no_sections),
        Format::Text => escaped_lines(&writing::text(sections, request.only.is_empty(), texts.schoolbook)),
        Format::Markdown => {
            format!("# {}\n\n{}", writing::literal(&title), writing::markdown(sections, texts.schoolbook))
        }
        Format::Html => html::html(&title, sections, texts),
        Format::Json => {
            let sections: Vec<_> = sections.iter().map(writing::json).collect();
            let report = json!({ "title": title, "sections": sections });
            escaped_json(&report)
        }
    }
}

fn title(name: &str, pixel: Option<(u32, u32)>, texts: &Texts) -> String {
    match pixel {
        Some((x, y)) => format!("{}: {name}, {} ({x}, {y})", texts.title, texts.pixel),
        None => format!("{}: {name}", texts.title),
    }
}
