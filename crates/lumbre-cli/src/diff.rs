//! `lumbre diff`: the difference of two pictures.

use std::io;
use std::path::PathBuf;

use clap::Args;
use lumbre::CancelToken;
use lumbre::formats::Limits;
use lumbre::image::{Image, Metric, Rgb, Window, compare};

use crate::failure::{Failure, print};
use crate::memory::Memory;
use crate::names::one_of;
use crate::output::{Inputs, Replaced, is_standard_stream};
use crate::render::check_image_format;
use crate::signals::Signals;
use crate::units;

/// Compares two pictures of the same size.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre diff out.exr reference.exr
  lumbre diff out.png golden.png --metric flip --fail-above 0.02 -o heat.png
  lumbre diff out.png golden.png --metric ssim --fail-below 0.98
  lumbre diff out.png golden.png --region 100,50,64,64
  lumbre render scene.pbrt -o - | lumbre diff - golden.png

Prints only the difference, so that scripts can read it. Exit status 1 when it is above --fail-above, or below
--fail-below.")]
pub(crate) struct Arguments {
    /// A picture: .exr, .png, .hdr, .pfm, .jpg and others; - is standard input.
    a: PathBuf,
    /// The picture to compare it with; relmse and flip take it as the reference.
    b: PathBuf,
    /// How to measure: rmse (root mean square), relmse (squares relative to the reference's), mae (mean of absolute
    /// values), max (the largest), flip (what a person notices when the two alternate, 0 to 1), or ssim (structural
    /// similarity, 1 for equal pictures).
    #[arg(long, value_name = "NAME", default_value = "rmse", value_parser = one_of(&Metric::NAMES, Metric::from_name))]
    metric: Metric,
    /// Compare this part only: its left and top edge, its width and its height in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = units::region)]
    region: Option<Window>,
    /// Fail when the difference is above this.
    #[arg(long, value_name = "X", value_parser = limit)]
    fail_above: Option<f64>,
    /// Fail when the similarity (ssim) is below this.
    #[arg(long, value_name = "X", value_parser = limit, conflicts_with = "fail_above")]
    fail_below: Option<f64>,
    /// Where to write a picture of the differences.
    #[arg(short, long, value_name = "HEAT.png")]
    output: Option<PathBuf>,
    /// Memory limit.
    #[arg(long, value_name = "SIZE", value_parser = units::bytes)]
    max_memory: Option<u64>,
}

/// A difference with four decimals, or as many more as it takes to see that it is beyond the limit.
fn shown_beyond(difference: f64, is_beyond: impl Fn(f64) -> bool) -> String {
    (4..18)
        .map(|decimals| format!("{difference:.decimals$}"))
        .find(|text| text.parse().is_ok_and(&is_beyond))
        .unwrap_or_else(|| difference.to_string())
}

fn limit(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| *x >= 0.0).ok_or_else(|| "expected a number, 0 or more".to_owned())
}

/// Bytes a pixel of the differences and their picture.
const BYTES: u64 = 32;
/// Bytes a pixel of what the metrics flip and ssim need in all.
const FLIP_BYTES: u64 = 160;

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if is_standard_stream(&arguments.a) && is_standard_stream(&arguments.b) {
        return Err(Failure::Usage("the two pictures cannot both be standard input".to_owned()));
    }
    let is_similarity = arguments.metric.is_similarity();
    if is_similarity && arguments.fail_above.is_some() {
        return Err(Failure::Usage("--fail-above: ssim is a similarity (expected --fail-below)".to_owned()));
    }
    if !is_similarity && arguments.fail_below.is_some() {
        return Err(Failure::Usage(
            "--fail-below: this metric is a difference (expected --fail-above, or --metric ssim)".to_owned(),
        ));
    }
    let signals = Signals::listen(&CancelToken::new())?;
    if let Some(output) = &arguments.output {
        check_image_format(output)?;
        Inputs::of([arguments.a.as_path(), &arguments.b]).refuse(output)?;
    }
    let memory = Memory::new(arguments.max_memory);
    let mut limits = Limits::default();
    limits.memory = memory.for_reading() / 2;
    let read = |path: &PathBuf| {
        let image = if is_standard_stream(path) {
            lumbre::read_image_from("standard input", io::stdin(), limits)
        } else {
            lumbre::read_image_within(path, limits)
        };
        image.map_err(|error| memory.explain(error))
    };
    let (a, b) = (read(&arguments.a)?, read(&arguments.b)?);
    let pixels = u64::from(a.width()) * u64::from(a.height());
    let each = if matches!(arguments.metric, Metric::Flip | Metric::Ssim) { FLIP_BYTES } else { BYTES };
    let needed = pixels.saturating_mul(each);
    Memory::new(arguments.max_memory).check(
        "the comparison",
        needed,
        2 * pixels * size_of::<Rgb>() as u64,
    )?;
    let same_size = (a.width(), a.height()) == (b.width(), b.height());
    let (a, b) = match arguments.region {
        Some(region) if same_size => {
            let is_whole = |part: &Image| (part.width(), part.height()) == (region.width, region.height);
            let part = |image: &Image| image.crop(region).filter(is_whole);
            part(&a).zip(part(&b)).ok_or_else(|| {
                let (width, height) = (a.width(), a.height());
                Failure::Usage(format!(
                    "--region: it reaches beyond the pictures (expected a part of {width}x{height})"
                ))
            })?
        }
        _ => (a, b),
    };
    let Some(comparison) = compare(&a, &b, arguments.metric) else {
        return Err(Failure::input(format!(
            "{} is {}x{} and {} is {}x{} (expected pictures of the same size)",
            arguments.a.display(),
            a.width(),
            a.height(),
            arguments.b.display(),
            b.width(),
            b.height()
        )));
    };
    let difference = comparison.value;
    print(&format!("{difference}\n"))?;
    if let Some(path) = &arguments.output {
        let heat = comparison.heat_map(arguments.metric);
        let replaced = Replaced::by(path);
        let stream = signals.enter_writing(path)?;
        lumbre::write_image(path, &heat, &lumbre::SaveOptions::default()).map_err(Failure::from)?;
        drop(stream);
        replaced.say();
    }
    // A NaN is beyond every limit.
    let name = arguments.metric.name();
    match (arguments.fail_above, arguments.fail_below) {
        (Some(limit), _) if difference.is_nan() || difference > limit => {
            say!("{name} {} is above --fail-above {limit}", shown_beyond(difference, |shown| shown > limit));
            Err(Failure::Different)
        }
        (_, Some(limit)) if difference.is_nan() || difference < limit => {
            say!("{name} {} is below --fail-below {limit}", shown_beyond(difference, |shown| shown < limit));
            Err(Failure::Different)
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::shown_beyond;

    #[test]
    fn a_difference_has_enough_digits_to_be_beyond_its_limit() {
        assert_eq!(shown_beyond(0.079_123, |x| x > 0.001), "0.0791");
        assert_eq!(shown_beyond(0.079_123, |x| x > 0.0791), "0.07912");
        assert_eq!(shown_beyond(0.979_996, |x| x < 0.98), "0.979996");
        assert_eq!(shown_beyond(2.7e-7, |x| x > 0.0), "0.0000003");
        assert_eq!(shown_beyond(f64::NAN, |x| x > 1.0), "NaN");
        assert_eq!(shown_beyond(f64::INFINITY, |x| x > 1.0), "inf");
    }
}
