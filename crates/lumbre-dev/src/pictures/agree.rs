//! A picture against a reference of the same scene by another renderer: the means, and each pixel by its noise.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use lumbre::image::Image;
use lumbre::read_image;
use xtask::command::{release_program, root, run};

/// Parts that the samples are rendered in, each with a seed of its own: they show the noise.
const PARTS: u32 = 8;
/// Pixels about each pixel, on each side, whose variances stand for its own.
const AROUND: usize = 3;
/// The largest relative difference of a channel's mean.
const MEAN_LIMIT: f64 = 3e-3;
/// The largest root mean square of differences in units of their standard deviation, which 1 is expected of.
const NOISE_LIMIT: f64 = 1.1;

/// What is compared.
#[derive(Args)]
pub(crate) struct Agree {
    /// The reference picture: it gives the size.
    #[arg(long)]
    reference: PathBuf,
    /// Samples a pixel of the reference, independent ones.
    #[arg(long)]
    reference_spp: u32,
    /// Samples a pixel of ours, in eight parts.
    #[arg(long, default_value_t = 4096)]
    spp: u32,
    /// The scene; its sampler is to be `independent`, or the noise is less than is expected.
    #[arg(long, default_value = "scenes/cornell/cornell.pbrt")]
    scene: PathBuf,
}

/// Renders and compares.
pub(crate) fn run_comparison(what: &Agree) -> Result<()> {
    ensure!(
        what.spp >= PARTS && what.reference_spp > 0,
        "at least {PARTS} samples a pixel, and a reference of some"
    );
    let reference = read_image(&what.reference).context("the reference")?;
    let size = format!("{}x{}", reference.width(), reference.height());
    let part_spp = what.spp / PARTS;
    let program = release_program()?.to_string_lossy().into_owned();
    let folder = root().join("target").join("agree");
    std::fs::create_dir_all(&folder)?;
    let scene = what.scene.to_string_lossy().into_owned();
    let mut parts = Vec::new();
    for seed in 1..=PARTS {
        let output = folder.join(format!("part{seed}.pfm"));
        let (path, seed, spp) =
            (output.to_string_lossy().into_owned(), seed.to_string(), part_spp.to_string());
        run(
            &program,
            &["render", &scene, "--size", &size, "--spp", &spp, "--seed", &seed, "-q", "-o", &path],
        )?;
        parts.push(read_part(&output)?);
    }
    report(&parts, &reference, f64::from(part_spp) / f64::from(what.reference_spp))
}

fn read_part(path: &Path) -> Result<Image> {
    read_image(path).with_context(|| path.display().to_string())
}

fn report(parts: &[Image], reference: &Image, reference_share: f64) -> Result<()> {
    let size = (reference.width() as usize, reference.height() as usize);
    let mut is_near = true;
    println!("channel       ours  reference  difference  noise rms   beyond 2, 3 sd  halves rms");
    for channel in 0..3 {
        let theirs: Vec<f64> = reference.channel(channel).map(f64::from).collect();
        let ours: Vec<Vec<f64>> =
            parts.iter().map(|part| part.channel(channel).map(f64::from).collect()).collect();
        let mean_of = |parts: &[Vec<f64>]| -> Vec<f64> {
            (0..theirs.len())
                .map(|i| parts.iter().map(|part| part[i]).sum::<f64>() / parts.len() as f64)
                .collect()
        };
        let all = mean_of(&ours);
        let variances: Vec<f64> = (0..theirs.len())
            .map(|i| {
                ours.iter().map(|part| (part[i] - all[i]).powi(2)).sum::<f64>() / (ours.len() - 1) as f64
            })
            .collect();
        let variances = smoothed(&variances, size);
        let (first, second) = ours.split_at(ours.len() / 2);
        let between = in_deviations(&all, &theirs, &variances, 1.0 / ours.len() as f64 + reference_share);
        let halves = in_deviations(
            &mean_of(first),
            &mean_of(second),
            &variances,
            1.0 / first.len() as f64 + 1.0 / second.len() as f64,
        );
        let (our_mean, their_mean) = (average(&all), average(&theirs));
        let difference = our_mean / their_mean - 1.0;
        let beyond = |limit: f64| {
            100.0 * between.iter().filter(|z| z.abs() > limit).count() as f64 / between.len() as f64
        };
        let (rms, halves_rms) = (root_mean_square(&between), root_mean_square(&halves));
        println!(
            "{:7} {our_mean:10.6} {their_mean:10.6} {:10.4} % {rms:10.4} {:8.2} % {:.2} % {halves_rms:10.4}",
            ["red", "green", "blue"][channel],
            100.0 * difference,
            beyond(2.0),
            beyond(3.0),
        );
        is_near &= difference.abs() <= MEAN_LIMIT && rms <= NOISE_LIMIT;
    }
    if !is_near {
        bail!(
            "the pictures differ by more than {} % of a mean, or by more than their noise",
            100.0 * MEAN_LIMIT
        );
    }
    Ok(())
}

/// Differences over their standard deviation, where there is noise at all.
fn in_deviations(a: &[f64], b: &[f64], variances: &[f64], factor: f64) -> Vec<f64> {
    let pixels = a.iter().zip(b).zip(variances);
    pixels
        .filter(|&(_, &variance)| variance > 1e-14)
        .map(|((a, b), v)| (a - b) / (v * factor).sqrt())
        .collect()
}

fn average(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// Means over squares about each pixel, smaller at the border.
fn smoothed(values: &[f64], (width, height): (usize, usize)) -> Vec<f64> {
    let about = |at: usize, size: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(size);
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    places
        .map(|(x, y)| {
            let (columns, rows) = (about(x, width), about(y, height));
            let count = columns.len() * rows.len();
            let sum: f64 = rows.map(|row| values[row * width..][columns.clone()].iter().sum::<f64>()).sum();
            sum / count as f64
        })
        .collect()
}
