//! `lumbre merge`: joins parts of a render.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::Args;
use lumbre::formats::image::{ExrPrecision, ImageFormat};
use lumbre::formats::probe_writable;
use lumbre::image::{Rgb, ToneMap};
use lumbre::{Background, CancelToken, Feature, MergeError, Part, Piece, SaveOptions};

use crate::checkpoint::{differences, is_bare_part, open_part};
use crate::failure::Failure;
use crate::memory::Memory;
use crate::names::one_of;
use crate::output::{Inputs, Replaced};
use crate::render::{exposure, tone_map_name};
use crate::signals::Signals;
use crate::staging::frame_name;
use crate::units::{self, counted};

/// Joins parts of a render to the picture of one run, byte for byte.
///
/// Parts are made with lumbre render --samples, with or without --crop. Their order does not matter.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre render scene.pbrt --samples 0..32 -o a.part     on one machine
  lumbre render scene.pbrt --samples 32..64 -o b.part    on another
  lumbre merge a.part b.part -o picture.exr              the picture of lumbre render scene.pbrt --spp 64
  lumbre merge *.part -o more.part --allow-gaps          one part of several, to be merged again
  lumbre merge *.part -o frame.####.png                  parts of several frames: a picture of each frame

Exit status 3 when parts overlap, are of different renders, are unfinished, or leave gaps.")]
pub(crate) struct Arguments {
    /// The parts: .part files, and .exr files of --samples or --keep-sums.
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// The picture (.exr, .png, .jpg, .webp, .qoi, .hdr or .pfm), or a .part. A # in the name is replaced by the frame
    /// number: one picture per frame.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Join the parts even if samples are missing, and print which.
    #[arg(long)]
    allow_gaps: bool,
    /// Store the sums of all samples in the .exr, too, so that it can be resumed and merged.
    #[arg(long)]
    keep_sums: bool,
    /// Exposure in stops, for .png and .jpg. Overrides the exposure stored in the parts. Required if they differ.
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = exposure)]
    exposure: Option<f32>,
    /// Tone mapping, for .png and .jpg. Overrides the one stored in the parts. Required if they differ.
    #[arg(long, value_name = "NAME", value_parser = one_of(&ToneMap::NAMES, ToneMap::from_name))]
    tonemap: Option<ToneMap>,
    /// The background image of parts that were rendered with --background FILE. Give it here: merge never opens a file
    /// named only inside a part.
    #[arg(long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Memory limit for a part. By default 64 MiB plus 32 bytes per byte of the file.
    #[arg(long, value_name = "SIZE", value_parser = units::bytes)]
    max_memory: Option<u64>,
    /// Print errors only.
    #[arg(short, long)]
    quiet: bool,
}

/// Gaps that are named.
const MAX_NAMED: usize = 4;

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let output = &arguments.output;
    let format = ImageFormat::from_path(output).filter(|format| format.is_writable());
    if format.is_none() && !is_bare_part(output) {
        return Err(Failure::Usage(format!(
            "{}: unknown format (expected a name that ends in {}, or .part)",
            output.display(),
            ImageFormat::WRITABLE
        )));
    }
    if arguments.keep_sums && format != Some(ImageFormat::Exr) {
        return Err(Failure::Usage(format!("{}: --keep-sums needs an .exr file", output.display())));
    }
    let _signals = Signals::listen(&CancelToken::new())?;
    let has_number = output.file_name().is_some_and(|name| name.to_string_lossy().contains('#'));
    if !has_number {
        return merge(arguments, &arguments.parts, output, 0);
    }
    let mut frames: BTreeMap<u32, Vec<PathBuf>> = BTreeMap::new();
    // All frames have as many samples as any.
    let mut spp = 0;
    for path in &arguments.parts {
        let part = open(path, arguments)?;
        spp = spp.max(part.state.samples().end);
        let frame = frame_of(&part).ok_or_else(|| {
            let why =
                "not a part of a frame (expected an output without #, or parts of a render with --frames)";
            Failure::Input(format!("{}: {why}", path.display()))
        })?;
        frames.entry(frame).or_default().push(path.clone());
    }
    frames.iter().try_for_each(|(&frame, parts)| merge(arguments, parts, &frame_name(output, frame), spp))
}

/// The number of the frame that a part is of, if it is of one of several.
fn frame_of(part: &Part) -> Option<u32> {
    part.job.identity.get("picture")?.parse().ok()
}

/// Joins parts of one picture, of at least this many samples.
fn merge(arguments: &Arguments, parts: &[PathBuf], output: &Path, spp: u32) -> Result<(), Failure> {
    Inputs::of(arguments.parts.iter().chain(&arguments.background).map(PathBuf::as_path)).refuse(output)?;
    probe_writable(output).map_err(|e| Failure::from(lumbre::Error::from(e)))?;
    let whole = joined(arguments, parts)?;
    let bounds = whole.state.bounds();
    let mut gaps = whole.state.gaps(bounds);
    let last = whole.state.samples().end;
    if last < spp {
        gaps.push(Piece { bounds, samples: last..spp });
    }
    if !gaps.is_empty() {
        let missing: u64 = gaps.iter().map(Piece::count).sum();
        let named: Vec<String> = gaps.iter().take(MAX_NAMED).map(Piece::to_string).collect();
        let more = if gaps.len() > MAX_NAMED { " and more" } else { "" };
        let what = format!("{} missing: {}{more}", counted(missing, "sample"), named.join(", "));
        // Which of several pictures.
        let what =
            if parts.len() < arguments.parts.len() { format!("{}: {what}", output.display()) } else { what };
        if !arguments.allow_gaps {
            return Err(Failure::Input(format!("{what} (--allow-gaps joins the parts without them)")));
        }
        if !arguments.quiet {
            say!("warning: {what}");
        }
    }
    let replaced = Replaced::by(output);
    save(arguments, &whole, output)?;
    if !arguments.quiet {
        replaced.say();
        let (width, height) = (bounds.width(), bounds.height());
        let spp = counted(u64::from(whole.state.least_samples()), "sample");
        let parts = counted(parts.len() as u64, "part");
        say!("{}: {width}x{height}, {spp} per pixel, from {parts}", output.display());
    }
    Ok(())
}

/// A finished part.
fn open(path: &Path, arguments: &Arguments) -> Result<Part, Failure> {
    let mut part = open_part(path, Memory::new(arguments.max_memory))?;
    if let Some(exposure) = arguments.exposure {
        part.job.shown.insert("exposure".to_owned(), exposure.to_string());
    }
    if let Some(tone_map) = arguments.tonemap {
        part.job.shown.insert("tone map".to_owned(), tone_map_name(tone_map).to_owned());
    }
    if part.state.is_finished() {
        return Ok(part);
    }
    Err(Failure::Input(format!(
        "{}: unfinished, with {} of {} samples (lumbre render --resume finishes it)",
        path.display(),
        part.state.taken(),
        part.state.wanted()
    )))
}

/// All parts as one.
fn joined(arguments: &Arguments, parts: &[PathBuf]) -> Result<Part, Failure> {
    let (first, others) = parts.split_first().ok_or_else(|| Failure::Usage("no parts".to_owned()))?;
    let mut whole = open(first, arguments)?;
    let mut origins: Vec<(&Path, Vec<Piece>)> = vec![(first, whole.state.pieces().to_vec())];
    for path in others {
        let part = open(path, arguments)?;
        if let Some(differences) = differences(&whole.job, &part.job) {
            return Err(Failure::Input(format!(
                "{}: of another render than {}: {}",
                path.display(),
                first.display(),
                differences
            )));
        }
        // Which of them is first would say how the picture is shown.
        if let Some(differences) = shown_differences(&whole.job.shown, &part.job.shown) {
            return Err(Failure::Usage(format!(
                "{}: other picture settings than in {}: {differences}",
                path.display(),
                first.display()
            )));
        }
        let pieces = part.state.pieces().to_vec();
        whole.merge(&part).map_err(|error| {
            let MergeError::Overlap(overlap) = &error else {
                return Failure::Input(format!("{}: {error}", path.display()));
            };
            let has_it = |pieces: &[Piece]| pieces.iter().any(|piece| piece.intersection(overlap).is_some());
            let other =
                origins.iter().find(|(_, pieces)| has_it(pieces)).map_or(first.as_path(), |(path, _)| *path);
            Failure::Input(format!(
                "{}: overlaps {}: both have {overlap}; leave one out",
                path.display(),
                other.display()
            ))
        })?;
        origins.push((path, pieces));
    }
    Ok(whole)
}

/// In what two ways of showing a picture differ, with the options that say which is meant.
fn shown_differences(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>) -> Option<String> {
    let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let of = |shown: &BTreeMap<String, String>, name: &String| {
        shown.get(name).map_or("none", String::as_str).to_owned()
    };
    let differences = names.into_iter().filter(|name| a.get(*name) != b.get(*name)).map(|name| {
        let option = match name.as_str() {
            "exposure" => " (--exposure EV sets one for all)",
            "tone map" => " (--tonemap NAME sets one for all)",
            _ => " (expected the same)",
        };
        format!("{name} {} there, {} here{option}", of(a, name), of(b, name))
    });
    let differences: Vec<String> = differences.collect();
    (!differences.is_empty()).then(|| differences.join("; "))
}

/// Saves the picture as the render itself would have.
fn save(arguments: &Arguments, whole: &Part, output: &Path) -> Result<(), Failure> {
    if is_bare_part(output) {
        return Ok(whole.save(output)?);
    }
    let shown = |name: &str| whole.job.shown.get(name).map_or("", String::as_str);
    let mut options = SaveOptions::default();
    options.exposure = shown("exposure").parse().unwrap_or(0.0);
    options.tone_map = ToneMap::from_name(shown("tone map")).unwrap_or(ToneMap::None);
    if shown("precision") == "float" {
        options.exr_precision = ExrPrecision::Float;
    }
    options.metadata = whole.job.metadata(&whole.state.samples());
    let layers: Vec<Feature> = match ImageFormat::from_path(output) {
        Some(ImageFormat::Exr) => shown("layers").split(',').filter_map(Feature::from_name).collect(),
        _ => Vec::new(),
    };
    let picture = match background(shown("background"), arguments.background.as_deref())? {
        Some(background) => whole.picture().over(background),
        None => whole.picture(),
    };
    if arguments.keep_sums {
        return Ok(picture.save_with_part(output, &options, &layers, whole)?);
    }
    Ok(picture.save_with(output, &options, &layers)?)
}

/// The background that a part's picture is shown over. A part may come from anyone: an image is opened by the name that
/// the user gives, never by that in the part.
fn background(name: &str, given: Option<&Path>) -> Result<Option<Background>, Failure> {
    match (name.strip_prefix("file "), given) {
        (Some(_), Some(path)) => {
            let image = lumbre::read_image(path)?;
            return Ok(Some(Background::Picture(crate::staging::opaque(image))));
        }
        (Some(named), None) => {
            return Err(Failure::Usage(format!(
                "the parts use the background image {named}: give it with --background"
            )));
        }
        (None, Some(path)) => {
            return Err(Failure::Usage(format!(
                "--background {}: the parts have no background image",
                path.display()
            )));
        }
        (None, None) => {}
    }
    if name == "studio" {
        return Ok(Some(Background::studio()));
    }
    let colour = name.strip_prefix("colour ").map(|digits| {
        let mut channels =
            digits.split(' ').map(|digits| u32::from_str_radix(digits, 16).map(f32::from_bits));
        let mut next = || channels.next().and_then(Result::ok).unwrap_or(0.0);
        Rgb::new(next(), next(), next())
    });
    Ok(colour.map(Background::Colour))
}
