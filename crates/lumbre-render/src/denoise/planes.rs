//! Guides as planes of numbers, with smoothed variances.

use crate::denoise::means::{Group, Layer, REACH};
use crate::film::{GROUPS, GuideSums, RatioSums};

/// Radius in pixels over which variances are averaged.
const VARIANCE_RADIUS: usize = 2;
/// Radius in pixels for measuring how much better a low-discrepancy sampler is than independent samples.
const SCALE_RADIUS: usize = 5;
/// Radius in pixels whose spread estimates the variance of a single sample.
const SPREAD_RADIUS: usize = 2;

/// Radius in pixels on which a mean depends.
pub(super) const BORDER: usize = REACH + SCALE_RADIUS + OUTLIER_RADIUS;

/// The settings of a layer.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    /// Minimum mean denominator.
    pub(super) least: f32,
    /// Whether all pixels take part; otherwise pixels without a denominator have no data.
    pub(super) is_everywhere: bool,
    /// Whether no pixel of the picture has more than one sample.
    pub(super) is_single: bool,
}

/// A ratio for every pixel, for two halves of its samples.
pub(super) fn layer<const UNDER: usize>(
    guides: &[GuideSums],
    size: (usize, usize),
    ratio: impl Fn(&GuideSums) -> &RatioSums<UNDER>,
    Kind { least, is_everywhere, is_single }: Kind,
) -> Layer {
    let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
    let is_sampled = |guide: &GuideSums| guide.count.samples > 0 && guide.count.weight > 0.0;
    let half = |half: usize, c: usize| -> Vec<f32> {
        let value = |guide: &GuideSums| finite(ratio(guide).halves(c, guide.count, least)[half]);
        guides.iter().map(|guide| if is_sampled(guide) { value(guide) } else { 0.0 }).collect()
    };
    let mut halves = [0, 1].map(|h| [0, 1, 2].map(|c| half(h, c)));
    let kept = limit_outliers(&mut halves, size);
    let by_samples: Vec<f32> = guides
        .iter()
        .map(|guide| {
            let channel = |c| ratio(guide).variance(c, guide.count, least).map_or(0.0, finite);
            channel(0) + channel(1) + channel(2)
        })
        .zip(kept)
        .map(|(variance, kept)| variance * kept * kept)
        .collect();
    let by_halves: Vec<f32> = (0..guides.len())
        .map(|i| (0..3).map(|c| 0.25 * (halves[0][c][i] - halves[1][c][i]).powi(2)).sum())
        .collect();
    let known = [0, 1].map(|half| {
        let is_known = |guide: &GuideSums| is_everywhere || ratio(guide).is_known(half, guide.count);
        guides.iter().map(|guide| if is_known(guide) { 1.0 } else { 0.0 }).collect::<Vec<f32>>()
    });
    // The mean variance of pixels that have one.
    let has_part: Vec<f32> = known[0].iter().zip(&known[1]).map(|(a, b)| a.max(*b)).collect();
    let parts = mean_around(&has_part, size, VARIANCE_RADIUS);
    let mut smooth = mean_around(&by_samples, size, VARIANCE_RADIUS);
    smooth
        .iter_mut()
        .zip(parts)
        .for_each(|(variance, part)| *variance /= if part > 0.0 { part } else { 1.0 });
    let (wide_samples, wide_halves) =
        (mean_around(&by_samples, size, SCALE_RADIUS), mean_around(&by_halves, size, SCALE_RADIUS));
    let variance = if is_single {
        spread(&halves[0], size)
    } else {
        (0..guides.len())
            .map(|i| {
                let scale = if wide_samples[i] > 0.0 { wide_halves[i] / wide_samples[i] } else { 1.0 };
                // The variance of a half is twice that of the whole.
                2.0 * smooth[i] * scale.clamp(0.1, 2.0)
            })
            .collect()
    };
    Layer { width: size.0, height: size.1, halves, variance, known }
}

/// Radius in pixels in which the other half limits the brightness.
const OUTLIER_RADIUS: usize = 5;
/// A pixel of one half that is brighter than this many pixels of that neighbourhood in the other half is an outlier: a
/// fifth of its 121 pixels.
const OUTLIER: f32 = 24.0;
/// Unless the other half has nearly as much next to it.
const CONFIRMED: f32 = 4.0;

/// Dims pixels of one half where means would be dominated by one sample that the other half lacks. All other light
/// is kept. Returns the factor of each pixel.
fn limit_outliers(halves: &mut [[Vec<f32>; 3]; 2], size: (usize, usize)) -> Vec<f32> {
    let brightness = halves
        .each_ref()
        .map(|[r, g, b]| -> Vec<f32> { r.iter().zip(g).zip(b).map(|((r, g), b)| r + g + b).collect() });
    let around = brightness.each_ref().map(|values| mean_around(values, size, OUTLIER_RADIUS));
    let (width, height) = size;
    let mut kept = vec![1.0; width * height];
    for (i, (x, y)) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).enumerate() {
        for half in [0, 1] {
            let (value, other) = (brightness[half][i], 1 - half);
            let limit = OUTLIER * around[other][i];
            if value <= limit {
                continue;
            }
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            let beside = rows.flat_map(|y| {
                &brightness[other][y * width + x.saturating_sub(1)..y * width + (x + 2).min(width)]
            });
            let limit = limit.max(CONFIRMED * beside.copied().fold(0.0, f32::max));
            // If the neighbourhood is black, there is no estimate.
            if 0.0 < limit && limit < value {
                halves[half].iter_mut().for_each(|channel| channel[i] *= limit / value);
                kept[i] = limit / value;
            }
        }
    }
    kept
}

/// The variance of values among neighbours, summed over channels.
fn spread(channels: &[Vec<f32>; 3], size: (usize, usize)) -> Vec<f32> {
    let mut all = vec![0.0; size.0 * size.1];
    for values in channels {
        let squares: Vec<f32> = values.iter().map(|v| v * v).collect();
        let (means, squares) =
            (mean_around(values, size, SPREAD_RADIUS), mean_around(&squares, size, SPREAD_RADIUS));
        for (sum, (mean, square)) in all.iter_mut().zip(means.iter().zip(squares)) {
            *sum += (square - mean * mean).max(0.0);
        }
    }
    all
}

/// Albedo, normals and depth, with the differences from which on they count as different.
pub(super) fn surfaces(guides: &[GuideSums], size: (usize, usize)) -> Vec<Group> {
    let value = |f: usize| -> Vec<f32> { guides.iter().map(|guide| guide.feature(f)).collect() };
    let group = |which: usize, least: &dyn Fn(usize) -> f32| {
        let planes: Vec<Vec<f32>> = GROUPS[which].clone().map(value).collect();
        let variance: Vec<f32> = guides.iter().map(|guide| guide.group_variance(which)).collect();
        let sharpness = (0..guides.len())
            .map(|i| {
                let slope: f32 = planes.iter().map(|plane| slope_squared(plane, size, i)).sum();
                let scale = least(i).max(variance[i]).max(slope);
                1.0 / (STRENGTH * STRENGTH * scale)
            })
            .collect();
        Group { planes, variance, sharpness }
    };
    vec![
        group(0, &|_| MIN_ALBEDO),
        group(1, &|_| MIN_NORMAL),
        group(2, &|i| (MIN_DEPTH * guides[i].feature(6)).powi(2).max(f32::MIN_POSITIVE)),
    ]
}

/// Differences of features are compared with this many standard deviations, or slopes.
const STRENGTH: f32 = 1.0;
/// The square of an insignificant difference of albedo, over three channels: textures are divided out.
const MIN_ALBEDO: f32 = 0.01;
/// The square of a difference of normals.
const MIN_NORMAL: f32 = 0.01;
/// A difference of depth, as a share of it.
const MIN_DEPTH: f32 = 0.01;

/// Minimum pixels of a slope, to distinguish it from the narrow ramp that the film's filter makes of an edge.
const SLOPE: usize = 3;

/// The square of the slope per pixel: towards the more similar side, and at most that of the following pixels, so that
/// edges do not count as slopes.
fn slope_squared(plane: &[f32], (width, height): (usize, usize), i: usize) -> f32 {
    let (x, y) = (i % width, i / width);
    // The slope to one side, which has `count` pixels, `step` apart.
    let to = |count: usize, step: isize| {
        let at = |k: usize| plane[i.wrapping_add_signed(step * k as isize)];
        let steps = (1..=SLOPE.min(count)).map(|k| (at(k) - at(k - 1)).abs());
        steps.reduce(f32::min).unwrap_or(f32::INFINITY)
    };
    let across = to(x, -1).min(to(width - 1 - x, 1));
    let down = to(y, -(width as isize)).min(to(height - 1 - y, width as isize));
    let square = |d: f32| if d.is_finite() { d * d } else { 0.0 };
    square(across) + square(down)
}

/// The mean of each pixel's square of neighbours within the picture.
fn mean_around(values: &[f32], (width, height): (usize, usize), radius: usize) -> Vec<f32> {
    let mut rows = Vec::with_capacity(values.len());
    for row in values.chunks_exact(width.max(1)) {
        rows.extend((0..width).map(|x| {
            let near = &row[x.saturating_sub(radius)..(x + radius + 1).min(width)];
            near.iter().sum::<f32>() / near.len() as f32
        }));
    }
    let mut all = vec![0.0; values.len()];
    for (y, out) in all.chunks_exact_mut(width.max(1)).enumerate() {
        let near = y.saturating_sub(radius)..(y + radius + 1).min(height);
        let count = near.len() as f32;
        for row in near {
            for (sum, value) in out.iter_mut().zip(&rows[row * width..]) {
                *sum += value;
            }
        }
        out.iter_mut().for_each(|sum| *sum /= count);
    }
    all
}
