//! The filter itself, on planes of numbers: means of pixels that are alike.
//!
//! Sums, products and quotients in a fixed order, so that every machine and any number of threads has the same bytes.

use std::array;
use std::ops::Range;

use lumbre_simd::{InstructionSet, Job, Real};

use crate::CancelToken;

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

impl Layer {
    /// Whether a half says something of every pixel.
    fn is_known(&self, half: usize) -> bool {
        self.known[half].iter().all(|&known| known == 1.0)
    }

    /// The values of all pixels that are known, if they are the same in both halves: nothing is to be filtered. Black
    /// where none is known.
    fn constant(&self) -> Option<[f32; 3]> {
        let known = |half: usize| {
            let values = (0..self.width * self.height).filter(move |&i| self.known[half][i] == 1.0);
            values.map(move |i| self.halves[half].each_ref().map(|plane| plane[i]))
        };
        let mut all = known(0).chain(known(1));
        let first = all.next().unwrap_or_default();
        all.all(|value| value == first).then_some(first)
    }
}

/// What distinguishes surfaces: a group is compared as one.
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
/// Pixels beyond one that its mean depends on, by the layer and the groups.
pub(super) const REACH: usize = RADIUS as usize + PATCH;
/// The square of the number of standard deviations with which differences of light are compared.
const STRENGTH_SQUARED: f32 = 0.36;

/// Added to variances, so that two pixels without noise that differ are different.
const MIN_VARIANCE: f32 = 1e-12;

/// Nearly exp(-x), and exactly 0 from 4 on.
#[inline(always)]
fn kernel(x: f32) -> f32 {
    let t = (1.0 - 0.25 * x).max(0.0);
    let t = t * t;
    t * t
}

/// The larger of two numbers; the second where one of them is NaN. (`max` asks for NaN, which vectors have no
/// instruction for.)
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller of two numbers; the second where one of them is NaN.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Three channels of some columns and rows of the filtered layer, row by row; of no use where it is cancelled.
///
/// What lies further than [`REACH`] from them does not show, so that a picture can be filtered block by block.
pub(super) fn filter(
    layer: &Layer,
    groups: &[Group],
    columns: Range<usize>,
    rows: Range<usize>,
    cancel: &CancelToken,
) -> [Vec<f32>; 3] {
    if let Some(constant) = layer.constant() {
        return constant.map(|value| vec![value; columns.len() * rows.len()]);
    }
    InstructionSet::detect().run(FilterBlock { layer, groups, columns, rows, cancel })
}

/// [`filter_block`] at any instruction set: its loops go over rows of numbers, which the compiler vectorizes.
struct FilterBlock<'a> {
    layer: &'a Layer,
    groups: &'a [Group],
    columns: Range<usize>,
    rows: Range<usize>,
    cancel: &'a CancelToken,
}

impl Job for FilterBlock<'_> {
    type Output = [Vec<f32>; 3];

    #[inline(always)]
    fn run<R: Real>(self) -> Self::Output {
        filter_block(self.layer, self.groups, self.columns, self.rows, self.cancel)
    }
}

/// The columns of a range whose neighbour at this distance is in a picture of this width.
#[inline(always)]
fn with_neighbour(columns: &Range<usize>, dx: isize, width: usize) -> Range<usize> {
    let first = columns.start.max((-dx).max(0) as usize);
    let end = columns.end.min(width.saturating_sub(dx.max(0) as usize));
    first..end.max(first)
}

/// Some pixels of the filtered layer: each half by weights from the other.
#[inline(always)]
fn filter_block(
    layer: &Layer,
    groups: &[Group],
    columns: Range<usize>,
    rows: Range<usize>,
    cancel: &CancelToken,
) -> [Vec<f32>; 3] {
    let (width, height, across_width) = (layer.width, layer.height, columns.len());
    let count = rows.len() * across_width;
    let mut sums: [[Vec<f32>; 3]; 2] = array::from_fn(|_| array::from_fn(|_| vec![0.0; count]));
    let mut totals: [Vec<f32>; 2] = array::from_fn(|_| vec![0.0; count]);
    // Patches reach beyond their pixels.
    let reached = rows.start.saturating_sub(PATCH)..(rows.end + PATCH).min(height);
    let wide = columns.start.saturating_sub(PATCH)..(columns.end + PATCH).min(width);
    let mut across: [Vec<f32>; 2] = array::from_fn(|_| vec![0.0; reached.len() * across_width]);
    let mut differences = vec![0.0; wide.len()];
    let mut surfaces = vec![0.0; across_width];
    let mut weights = vec![0.0; across_width];
    let share = 1.0 / ((2 * PATCH + 1) * (2 * PATCH + 1)) as f32;
    // Where a half says nothing of some pixels, these are compared with none, and a patch counts the pairs that it
    // compares.
    let is_known = [0, 1].map(|half| layer.is_known(half));
    let mut pairs: [Vec<f32>; 2] =
        is_known.map(|known| vec![0.0; if known { 0 } else { reached.len() * across_width }]);
    let mut compared = vec![0.0; across_width];
    for (dx, dy) in (-RADIUS..=RADIUS).flat_map(|dy| (-RADIUS..=RADIUS).map(move |dx| (dx, dy))) {
        // Less with the distance, and nothing beyond a circle: what stands out is spread softly.
        let near = 1.0 - (dx * dx + dy * dy) as f32 / ((RADIUS + 1) * (RADIUS + 1)) as f32;
        let inner = with_neighbour(&columns, dx, width);
        let outer = with_neighbour(&wide, dx, width);
        if near <= 0.0 || inner.is_empty() {
            continue;
        }
        if cancel.is_cancelled() {
            break;
        }
        let moved = |y: usize, column: usize| {
            let row = y.checked_add_signed(dy).filter(|&row| row < height)?;
            (row * width + column).checked_add_signed(dx)
        };
        for y in reached.clone() {
            for half in 0..2 {
                let place = (y - reached.start) * across_width;
                let across = &mut across[half][place..][..across_width];
                let Some(there) = moved(y, outer.start) else {
                    across.fill(0.0);
                    if !is_known[half] {
                        pairs[half][place..][..across_width].fill(0.0);
                    }
                    continue;
                };
                let here = y * width + outer.start;
                let (before, first) = (outer.start - wide.start, columns.start - wide.start);
                differences.fill(0.0);
                let inside = &mut differences[before..][..outer.len()];
                compare_light(&layer.halves[half], &layer.variance, here, there, inside);
                if is_known[half] {
                    sum_across(&differences, first, across);
                    continue;
                }
                let known = &layer.known[half];
                let (p, q) = (&known[here..][..outer.len()], &known[there..][..outer.len()]);
                for x in 0..outer.len() {
                    inside[x] *= p[x] * q[x];
                }
                sum_across(&differences, first, across);
                let inside = &mut differences[before..][..outer.len()];
                for x in 0..outer.len() {
                    inside[x] = p[x] * q[x];
                }
                sum_across(&differences, first, &mut pairs[half][place..][..across_width]);
            }
        }
        let span = inner.len();
        let left = inner.start - columns.start;
        for y in rows.clone() {
            let Some(there) = moved(y, inner.start) else { continue };
            let surfaces = &mut surfaces[..span];
            compare_surfaces(groups, y * width + inner.start, there, surfaces);
            let out = (y - rows.start) * across_width + left;
            // The weights of one half are for the other.
            for (half, other) in [(0, 1), (1, 0)] {
                let patches = y.saturating_sub(PATCH)..(y + PATCH + 1).min(height);
                let weights = &mut weights[..span];
                weights.fill(0.0);
                for row in patches.clone() {
                    let patch = &across[half][(row - reached.start) * across_width + left..][..span];
                    for x in 0..span {
                        weights[x] += patch[x];
                    }
                }
                if is_known[half] {
                    for weight in weights.iter_mut() {
                        *weight *= share;
                    }
                } else {
                    let compared = &mut compared[..span];
                    compared.fill(0.0);
                    for row in patches {
                        let patch = &pairs[half][(row - reached.start) * across_width + left..][..span];
                        for x in 0..span {
                            compared[x] += patch[x];
                        }
                    }
                    for x in 0..span {
                        weights[x] /= larger(compared[x], 1.0);
                    }
                }
                let known = &layer.known[other][there..][..span];
                let total = &mut totals[other][out..][..span];
                for x in 0..span {
                    // What is less different than by noise is not different.
                    let difference = larger(larger(weights[x], surfaces[x]), 0.0);
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
    // A half without data leaves the weight to the other.
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

/// The squared differences of light of the pixels from `p` on and those from `q` on, less what noise makes of them, in
/// units of it.
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
        out[x] = (r * r + g * g + b * b - noise) / (MIN_VARIANCE + STRENGTH_SQUARED * (vp[x] + vq[x]));
    }
}

/// The greatest squared difference of any group of features of the pixels from `p` on and those from `q` on, in units
/// of each group.
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

/// For each of `out`, the sum of a value and its neighbours to the left and the right, as far as patches reach and
/// there are any. The value of the first is `values[first]`.
#[inline(always)]
fn sum_across(values: &[f32], first: usize, out: &mut [f32]) {
    let inside = PATCH.saturating_sub(first)..(values.len() - first).saturating_sub(PATCH).min(out.len());
    let inside = inside.start.min(out.len())..inside.end.max(inside.start.min(out.len()));
    for x in (0..out.len()).filter(|x| !inside.contains(x)) {
        let at = first + x;
        out[x] = values[at.saturating_sub(PATCH)..(at + PATCH + 1).min(values.len())].iter().sum();
    }
    if inside.is_empty() {
        return;
    }
    let start = first + inside.start - PATCH;
    let inner = &mut out[inside];
    inner.copy_from_slice(&values[start..][..inner.len()]);
    for shift in 1..=2 * PATCH {
        let values = &values[start + shift..][..inner.len()];
        for x in 0..inner.len() {
            inner[x] += values[x];
        }
    }
}
