//! The filter itself, on planes of numbers: means of pixels that are alike.
//!
//! Sums, products and quotients in a fixed order, so that every machine and any number of threads has the same bytes.

use std::array;
use std::ops::Range;

use crate::workers::Workers;

/// A picture in two independent halves.
pub(super) struct Layer {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Three channels of each half.
    pub(super) halves: [[Vec<f32>; 3]; 2],
    /// The variance of each channel of a half, summed over channels.
    pub(super) variance: Vec<f32>,
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

/// Rows that one thread filters at once.
const BAND: usize = 16;

/// Nearly exp(-x), and exactly 0 from 4 on.
#[inline]
fn kernel(x: f32) -> f32 {
    let t = (1.0 - 0.25 * x).max(0.0);
    let t = t * t;
    t * t
}

/// Three channels of the filtered layer.
pub(super) fn filter(layer: &Layer, groups: &[Group], workers: &Workers) -> [Vec<f32>; 3] {
    let starts = (0..layer.height).step_by(BAND);
    let mut bands: Vec<(Range<usize>, [Vec<f32>; 3])> =
        starts.map(|y| (y..(y + BAND).min(layer.height), Default::default())).collect();
    workers.for_each(&mut bands, |(rows, band)| *band = filter_rows(layer, groups, rows.clone()));
    array::from_fn(|c| bands.iter().flat_map(|(_, band)| &band[c]).copied().collect())
}

/// The rows of the filtered layer: each half by weights from the other.
fn filter_rows(layer: &Layer, groups: &[Group], rows: Range<usize>) -> [Vec<f32>; 3] {
    let (width, height) = (layer.width, layer.height);
    let count = rows.len() * width;
    let mut sums: [[Vec<f32>; 3]; 2] = array::from_fn(|_| array::from_fn(|_| vec![0.0; count]));
    let mut weights: [Vec<f32>; 2] = array::from_fn(|_| vec![0.0; count]);
    let first = rows.start.saturating_sub(PATCH);
    let last = (rows.end + PATCH).min(height);
    let mut across = [vec![0.0f32; (last - first) * width], vec![0.0f32; (last - first) * width]];
    let mut distance = vec![0.0f32; width];
    let mut feature = vec![0.0f32; width];
    let mut column = vec![0.0f32; width];
    let share = 1.0 / ((2 * PATCH + 1) * (2 * PATCH + 1)) as f32;
    for dy in -RADIUS..=RADIUS {
        for dx in -RADIUS..=RADIUS {
            // Pixels whose neighbour is in the picture.
            let x0 = (-dx).max(0) as usize;
            let x1 = (width as isize - dx.max(0)).max(0) as usize;
            if x0 >= x1 {
                continue;
            }
            // Less with the distance, and nothing beyond a circle: what stands out is spread softly.
            let near = 1.0 - (dx * dx + dy * dy) as f32 / ((RADIUS + 1) * (RADIUS + 1)) as f32;
            if near <= 0.0 {
                continue;
            }
            let span = x1 - x0;
            let moved = |y: usize| (y as isize + dy) as usize * width + (x0 as isize + dx) as usize;
            let is_in = |y: usize| (0..height as isize).contains(&(y as isize + dy));
            // Distances, summed along rows of patches.
            for y in first..last {
                for half in 0..2 {
                    let across = &mut across[half][(y - first) * width..][..width];
                    if !is_in(y) {
                        across.fill(0.0);
                        continue;
                    }
                    distance.fill(0.0);
                    let here = y * width + x0;
                    let there = moved(y);
                    {
                        let d = &mut distance[x0..x1];
                        let vp = &layer.variance[here..][..span];
                        let vq = &layer.variance[there..][..span];
                        let p = layer.halves[half].each_ref().map(|plane| &plane[here..][..span]);
                        let q = layer.halves[half].each_ref().map(|plane| &plane[there..][..span]);
                        for x in 0..span {
                            let (r, g, b) = (p[0][x] - q[0][x], p[1][x] - q[1][x], p[2][x] - q[2][x]);
                            let noise = vp[x] + vp[x].min(vq[x]);
                            d[x] = (r * r + g * g + b * b - noise)
                                / (1e-12 + STRENGTH_SQUARED * (vp[x] + vq[x]));
                        }
                    }
                    if width > 2 * PATCH {
                        for x in 0..PATCH {
                            across[x] = distance[..=x + PATCH].iter().sum();
                            across[width - 1 - x] = distance[width - 1 - x - PATCH..].iter().sum();
                        }
                        let inner = &mut across[PATCH..width - PATCH];
                        inner.copy_from_slice(&distance[..width - 2 * PATCH]);
                        for k in 1..=2 * PATCH {
                            for (sum, d) in inner.iter_mut().zip(&distance[k..]) {
                                *sum += d;
                            }
                        }
                    } else {
                        for x in 0..width {
                            across[x] =
                                distance[x.saturating_sub(PATCH)..(x + PATCH + 1).min(width)].iter().sum();
                        }
                    }
                }
            }
            for y in rows.clone().filter(|&y| is_in(y)) {
                let here = y * width + x0;
                let there = moved(y);
                // How different the surfaces are.
                let f = &mut feature[..span];
                f.fill(0.0);
                for group in groups {
                    let vp = &group.variance[here..][..span];
                    let vq = &group.variance[there..][..span];
                    let sharpness = &group.sharpness[here..][..span];
                    if let [a, b, c] = &group.planes[..] {
                        let [pa, pb, pc] = [a, b, c].map(|plane| &plane[here..][..span]);
                        let [qa, qb, qc] = [a, b, c].map(|plane| &plane[there..][..span]);
                        for x in 0..span {
                            let (r, g, b) = (pa[x] - qa[x], pb[x] - qb[x], pc[x] - qc[x]);
                            let d = (r * r + g * g + b * b - (vp[x] + vp[x].min(vq[x]))) * sharpness[x];
                            f[x] = f[x].max(d);
                        }
                    } else {
                        for plane in &group.planes {
                            let (p, q) = (&plane[here..][..span], &plane[there..][..span]);
                            for x in 0..span {
                                let d = p[x] - q[x];
                                f[x] = f[x].max((d * d - (vp[x] + vp[x].min(vq[x]))) * sharpness[x]);
                            }
                        }
                    }
                }
                let out = (y - rows.start) * width + x0;
                for half in 0..2 {
                    let up = y.saturating_sub(PATCH).max(first);
                    let down = (y + PATCH + 1).min(last);
                    let c = &mut column[..span];
                    c.fill(0.0);
                    for row in up..down {
                        let from = &across[half][(row - first) * width + x0..][..span];
                        for x in 0..span {
                            c[x] += from[x];
                        }
                    }
                    for x in 0..span {
                        // Both are at least 0, whatever noise was taken off.
                        c[x] = near * kernel((c[x] * share).max(f[x]).max(0.0));
                    }
                    // The weights of one half are for the other.
                    let other = 1 - half;
                    let total = &mut weights[other][out..][..span];
                    for x in 0..span {
                        total[x] += c[x];
                    }
                    for (sum, plane) in sums[other].iter_mut().zip(&layer.halves[other]) {
                        let (sum, q) = (&mut sum[out..][..span], &plane[there..][..span]);
                        for x in 0..span {
                            sum[x] += c[x] * q[x];
                        }
                    }
                }
            }
        }
    }
    // The pixel itself always counts: no weight is 0.
    array::from_fn(|c| {
        (0..count).map(|i| 0.5 * (sums[0][c][i] / weights[0][i] + sums[1][c][i] / weights[1][i])).collect()
    })
}
