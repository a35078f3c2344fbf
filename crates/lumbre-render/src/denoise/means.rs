//! The filter itself, on planes of numbers: means of pixels that are alike.
//!
//! Sums, products and quotients in a fixed order, so that every machine and any number of threads has the same bytes.

use std::array;
use std::ops::Range;

use lumbre_simd::{InstructionSet, Job, Real};

use crate::CancelToken;
use crate::workers::Workers;

/// A picture in two independent halves.
pub(super) struct Layer {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Three channels of each half.
    pub(super) halves: [[Vec<f32>; 3]; 2],
    /// The variance of each channel of a half, summed over channels.
    pub(super) variance: Vec<f32>,
    /// 1, or 0 where a half says nothing of the pixel.
    pub(super) known: [Vec<f32>; 2],
}

/// What tells surfaces apart: a group is compared as one.
pub(super) struct Group {
    pub(super) planes: Vec<Vec<f32>>,
    /// The variance of a pixel's values, summed over planes.
    pub(super) variance: Vec<f32>,
    /// One over the square of the difference that counts as one, of each pixel.
    pub(super) sharpness: Vec<f32>,
}

/// The radius in pixels of the circle in which like ones are looked for.
const RADIUS: isize = 8;
/// Pixels to each side of one that are compared with those of another.
const PATCH: usize = 3;
/// The square of the number of standard deviations with which differences of light are compared.
const STRENGTH_SQUARED: f32 = 0.36;

/// Added to variances, so that two pixels without noise that differ are different.
const LEAST_VARIANCE: f32 = 1e-12;

/// Rows that one thread filters at once.
const BAND: usize = 16;

/// Nearly exp(-x), and exactly 0 from 4 on.
#[inline(always)]
fn kernel(x: f32) -> f32 {
    let t = (1.0 - 0.25 * x).max(0.0);
    let t = t * t;
    t * t
}

/// The larger of two numbers; the second where one of them is NaN. (`max` asks for NaN, which vectors have no instruction for.)
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller of two numbers; the second where one of them is NaN.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Three channels of the filtered layer; `None` where it is cancelled.
pub(super) fn filter(
    layer: &Layer,
    groups: &[Group],
    workers: &Workers,
    cancel: &CancelToken,
) -> Option<[Vec<f32>; 3]> {
    let starts = (0..layer.height).step_by(BAND);
    let mut bands: Vec<(Range<usize>, [Vec<f32>; 3])> =
        starts.map(|y| (y..(y + BAND).min(layer.height), Default::default())).collect();
    workers.for_each(&mut bands, |(rows, band)| {
        *band = InstructionSet::detect().run(FilterRows { layer, groups, rows: rows.clone(), cancel });
    });
    if cancel.is_cancelled() {
        return None;
    }
    Some(array::from_fn(|c| bands.iter().flat_map(|(_, band)| &band[c]).copied().collect()))
}

/// [`filter_rows`] at any instruction set: its loops go over rows of numbers, of which the compiler makes vectors as wide as there are.
struct FilterRows<'a> {
    layer: &'a Layer,
    groups: &'a [Group],
    rows: Range<usize>,
    cancel: &'a CancelToken,
}

impl Job for FilterRows<'_> {
    type Output = [Vec<f32>; 3];

    #[inline(always)]
    fn run<R: Real>(self) -> Self::Output {
        filter_rows(self.layer, self.groups, self.rows, self.cancel)
    }
}

/// The rows of the filtered layer: each half by weights from the other. Where it is cancelled, they are of no use.
#[inline(always)]
fn filter_rows(layer: &Layer, groups: &[Group], rows: Range<usize>, cancel: &CancelToken) -> [Vec<f32>; 3] {
    let (width, height) = (layer.width, layer.height);
    let count = rows.len() * width;
    let mut sums: [[Vec<f32>; 3]; 2] = array::from_fn(|_| array::from_fn(|_| vec![0.0; count]));
    let mut totals: [Vec<f32>; 2] = array::from_fn(|_| vec![0.0; count]);
    // Rows of patches reach beyond those of their pixels.
    let reached = rows.start.saturating_sub(PATCH)..(rows.end + PATCH).min(height);
    let mut across: [Vec<f32>; 2] = array::from_fn(|_| vec![0.0; reached.len() * width]);
    let mut differences = vec![0.0; width];
    let mut surfaces = vec![0.0; width];
    let mut weights = vec![0.0; width];
    let share = 1.0 / ((2 * PATCH + 1) * (2 * PATCH + 1)) as f32;
    for (dx, dy) in (-RADIUS..=RADIUS).flat_map(|dy| (-RADIUS..=RADIUS).map(move |dx| (dx, dy))) {
        // Less with the distance, and nothing beyond a circle: what stands out is spread softly.
        let near = 1.0 - (dx * dx + dy * dy) as f32 / ((RADIUS + 1) * (RADIUS + 1)) as f32;
        // Columns whose neighbour is in the picture.
        let (left, right) = ((-dx).max(0) as usize, width as isize - dx.max(0));
        if near <= 0.0 || right <= left as isize {
            continue;
        }
        if cancel.is_cancelled() {
            break;
        }
        let span = right as usize - left;
        let start = |y: usize| y * width + left;
        let moved = |y: usize| {
            let row = y.checked_add_signed(dy).filter(|&row| row < height)?;
            (row * width + left).checked_add_signed(dx)
        };
        for y in reached.clone() {
            for (across, half) in across.iter_mut().zip(&layer.halves) {
                let across = &mut across[(y - reached.start) * width..][..width];
                let Some(there) = moved(y) else {
                    across.fill(0.0);
                    continue;
                };
                differences.fill(0.0);
                compare_light(half, &layer.variance, start(y), there, &mut differences[left..][..span]);
                sum_across(&differences, across);
            }
        }
        for y in rows.clone() {
            let Some(there) = moved(y) else { continue };
            let surfaces = &mut surfaces[..span];
            compare_surfaces(groups, start(y), there, surfaces);
            let out = (y - rows.start) * width + left;
            // The weights of one half are for the other.
            for (across, other) in across.iter().zip([1, 0]) {
                let weights = &mut weights[..span];
                weights.fill(0.0);
                for row in y.saturating_sub(PATCH)..(y + PATCH + 1).min(height) {
                    let patch = &across[(row - reached.start) * width + left..][..span];
                    for x in 0..span {
                        weights[x] += patch[x];
                    }
                }
                let known = &layer.known[other][there..][..span];
                let total = &mut totals[other][out..][..span];
                for x in 0..span {
                    // What is less different than by noise is not different.
                    let difference = larger(larger(weights[x] * share, surfaces[x]), 0.0);
                    weights[x] = near * kernel(difference) * known[x];
                    total[x] += weights[x];
                }
                for (sum, values) in sums[other].iter_mut().zip(&layer.halves[other]) {
                    let (sum, values) = (&mut sum[out..][..span], &values[there..][..span]);
                    for x in 0..span {
                        sum[x] += weights[x] * values[x];
                    }
                }
            }
        }
    }
    // A half of which nothing is known leaves it to the other.
    array::from_fn(|c| {
        let mean = |i: usize| match (totals[0][i] > 0.0, totals[1][i] > 0.0) {
            (true, true) => 0.5 * (sums[0][c][i] / totals[0][i] + sums[1][c][i] / totals[1][i]),
            (true, false) => sums[0][c][i] / totals[0][i],
            (false, true) => sums[1][c][i] / totals[1][i],
            (false, false) => 0.0,
        };
        (0..count).map(mean).collect()
    })
}

/// The squared differences of light of the pixels from `p` on and those from `q` on, less what noise makes of them, in units of it.
#[inline(always)]
fn compare_light(half: &[Vec<f32>; 3], variance: &[f32], p: usize, q: usize, out: &mut [f32]) {
    let span = out.len();
    let [r, g, b] = half;
    let (pr, pg, pb) = (&r[p..][..span], &g[p..][..span], &b[p..][..span]);
    let (qr, qg, qb) = (&r[q..][..span], &g[q..][..span], &b[q..][..span]);
    let (vp, vq) = (&variance[p..][..span], &variance[q..][..span]);
    for x in 0..span {
        let (r, g, b) = (pr[x] - qr[x], pg[x] - qg[x], pb[x] - qb[x]);
        let noise = vp[x] + smaller(vp[x], vq[x]);
        out[x] = (r * r + g * g + b * b - noise) / (LEAST_VARIANCE + STRENGTH_SQUARED * (vp[x] + vq[x]));
    }
}

/// The greatest squared difference of any group of features of the pixels from `p` on and those from `q` on, in units of each group.
#[inline(always)]
fn compare_surfaces(groups: &[Group], p: usize, q: usize, out: &mut [f32]) {
    let span = out.len();
    out.fill(0.0);
    for Group { planes, variance, sharpness } in groups {
        let (vp, vq) = (&variance[p..][..span], &variance[q..][..span]);
        let sharpness = &sharpness[p..][..span];
        if let [a, b, c] = &planes[..] {
            let (pa, pb, pc) = (&a[p..][..span], &b[p..][..span], &c[p..][..span]);
            let (qa, qb, qc) = (&a[q..][..span], &b[q..][..span], &c[q..][..span]);
            for x in 0..span {
                let (a, b, c) = (pa[x] - qa[x], pb[x] - qb[x], pc[x] - qc[x]);
                let noise = vp[x] + smaller(vp[x], vq[x]);
                out[x] = larger(out[x], (a * a + b * b + c * c - noise) * sharpness[x]);
            }
        } else {
            for plane in planes {
                let (p, q) = (&plane[p..][..span], &plane[q..][..span]);
                for x in 0..span {
                    let d = p[x] - q[x];
                    let noise = vp[x] + smaller(vp[x], vq[x]);
                    out[x] = larger(out[x], (d * d - noise) * sharpness[x]);
                }
            }
        }
    }
}

/// Sums of each value and its neighbours to the left and the right, as far as patches reach.
#[inline(always)]
fn sum_across(values: &[f32], out: &mut [f32]) {
    let width = values.len();
    let inside = PATCH..width.saturating_sub(PATCH).max(PATCH);
    for x in (0..width).filter(|x| !inside.contains(x)) {
        out[x] = values[x.saturating_sub(PATCH)..(x + PATCH + 1).min(width)].iter().sum();
    }
    if inside.is_empty() {
        return;
    }
    let inner = &mut out[inside.clone()];
    inner.copy_from_slice(&values[..inside.len()]);
    for shift in 1..=2 * PATCH {
        let values = &values[shift..][..inner.len()];
        for x in 0..inner.len() {
            inner[x] += values[x];
        }
    }
}
