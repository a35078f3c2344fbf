//! A table of single-scattering albedos of anisotropic facets, by direction, and of their means.

use std::f32::consts::FRAC_1_PI;
use std::sync::LazyLock;

use lumbre_simd::math::{atan2, pow, sin_cos_turns};
use lumbre_simd::{Real, Task, UInt, V3};

use crate::albedo::{Between, unit, weighed};

/// Nodes of the cosine, at the squares of equal steps from 0 to 1.
const COSINES: usize = 24;
/// Nodes of the azimuth from the first axis to the second, dense near both: at equal steps of s, where 3 s² − 2
/// s³ is the fraction of the quarter turn.
const AZIMUTHS: usize = 9;
/// Nodes of the cube root of each α, in equal steps from 0 to 1.
const ROUGHNESSES: usize = 16;

const ROW: usize = COSINES;
const PAGE: usize = AZIMUTHS * ROW;
/// Pairs of roughnesses, the first at least as large as the second.
const PAIRS: usize = ROUGHNESSES * (ROUGHNESSES + 1) / 2;

/// The table. `stretched.bin` is written by the ignored test of this file.
pub(crate) static STRETCHED: LazyLock<Stretched> =
    LazyLock::new(|| Stretched::from_bytes(include_bytes!("stretched.bin")));

/// The albedo of white facets with two α, interpolated cubically.
pub(crate) struct Stretched {
    values: Vec<f32>,
    /// For each pair.
    means: Vec<f32>,
}

/// The index of the pair of two roughnesses, and where the second is the larger one.
#[inline(always)]
fn pair<R: Real>(x: R::UInt, y: R::UInt) -> (R::UInt, R::Mask) {
    let swapped = x.simd_lt(y);
    let (larger, smaller) = (R::UInt::select(swapped, y, x), R::UInt::select(swapped, x, y));
    ((larger * (larger + R::UInt::splat(1))).shr::<1>() + smaller, swapped)
}

#[inline(always)]
fn by_alpha<R: Real>(alpha: R) -> Between<R> {
    Between::new(pow(unit(alpha), R::splat(1.0 / 3.0)), ROUGHNESSES)
}

impl Stretched {
    /// If neither α is larger, the facets count as a mirror; this table is too coarse there at grazing angles.
    pub(crate) const LEAST: f32 = 0.004;

    fn from_bytes(bytes: &[u8]) -> Self {
        assert_eq!(bytes.len(), 2 * PAIRS * PAGE);
        let values: Vec<f32> = bytes
            .chunks_exact(2)
            .map(|pair| f32::from(u16::from_le_bytes([pair[0], pair[1]])) / 65535.0)
            .collect();
        let weights = crate::albedo::mean_weights::<COSINES>();
        let shares = azimuth_weights();
        let mean = |page: &[f32]| {
            let rows = page.chunks_exact(ROW).zip(shares);
            rows.map(|(row, share)| share * row.iter().zip(weights).map(|(v, w)| v * w).sum::<f32>()).sum()
        };
        let means = values.chunks_exact(PAGE).map(mean).collect();
        Self { values, means }
    }

    /// The albedo of facets of these α for a direction in their frame (on either side).
    #[inline(always)]
    pub(crate) fn mirror<R: Real>(&self, alpha: [R; 2], w: V3<R>) -> R {
        R::call(Mirror { table: self, alpha, w })
    }

    #[inline(always)]
    fn mirror_inlined<R: Real>(&self, alpha: [R; 2], w: V3<R>) -> R {
        let around = Around::new(atan2(w.y.abs(), w.x.abs()) * R::splat(2.0 * FRAC_1_PI));
        let (column, by_column) = Between::new(unit(w.z.abs()).sqrt(), COSINES).nodes(COSINES);
        let [(x, by_x), (y, by_y)] =
            [by_alpha(alpha[0]).nodes(ROUGHNESSES), by_alpha(alpha[1]).nodes(ROUGHNESSES)];
        let mut sum = R::zero();
        for (i, by_x) in by_x.into_iter().enumerate() {
            let mut row = R::zero();
            for (j, by_y) in by_y.into_iter().enumerate() {
                let (page, swapped) = pair::<R>(x + R::UInt::splat(i as u32), y + R::UInt::splat(j as u32));
                let page = page * R::UInt::splat(AZIMUTHS as u32);
                let page = PageAt { values: &self.values, page, swapped, around: &around, column, by_column };
                row = row + by_y * R::call(page);
            }
            sum = sum + by_x * row;
        }
        sum.simd_max(R::zero()).simd_min(R::one())
    }

    /// The cosine-weighted mean of [`Stretched::mirror`].
    #[inline(always)]
    pub(crate) fn mean<R: Real>(&self, alpha: [R; 2]) -> R {
        R::call(Mean { table: self, alpha })
    }

    #[inline(always)]
    fn mean_inlined<R: Real>(&self, alpha: [R; 2]) -> R {
        let [(x, by_x), (y, by_y)] =
            [by_alpha(alpha[0]).nodes(ROUGHNESSES), by_alpha(alpha[1]).nodes(ROUGHNESSES)];
        let mut sum = R::zero();
        for (i, by_x) in by_x.into_iter().enumerate() {
            let mut row = R::zero();
            for (j, by_y) in by_y.into_iter().enumerate() {
                let (page, _) = pair::<R>(x + R::UInt::splat(i as u32), y + R::UInt::splat(j as u32));
                row = row + by_y * R::gather(&self.means, page);
            }
            sum = sum + by_x * row;
        }
        sum
    }
}

/// [`Stretched::mirror`].
struct Mirror<'a, R: Real> {
    table: &'a Stretched,
    alpha: [R; 2],
    w: V3<R>,
}

impl<R: Real> Task<R> for Mirror<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        self.table.mirror_inlined(self.alpha, self.w)
    }
}

/// The value of one pair of roughnesses.
struct PageAt<'a, R: Real> {
    values: &'a [f32],
    page: R::UInt,
    swapped: R::Mask,
    around: &'a Around<R>,
    column: R::UInt,
    by_column: [R; 4],
}

impl<R: Real> Task<R> for PageAt<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        let last = R::UInt::splat(AZIMUTHS as u32 - 1);
        let mut value = R::zero();
        for (node, weight) in self.around.nodes.into_iter().zip(self.around.weights) {
            let node = R::UInt::select(self.swapped, last - node, node);
            let start = (self.page + node) * R::UInt::splat(ROW as u32) + self.column;
            value = value + weight * weighed(self.values, start, self.by_column);
        }
        value
    }
}

/// [`Stretched::mean`].
struct Mean<'a, R: Real> {
    table: &'a Stretched,
    alpha: [R; 2],
}

impl<R: Real> Task<R> for Mean<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        self.table.mean_inlined(self.alpha)
    }
}

/// A position between nodes of the azimuth.
struct Around<R: Real> {
    nodes: [R::UInt; 4],
    weights: [R; 4],
}

impl<R: Real> Around<R> {
    /// By the fraction of the quarter turn.
    #[inline(always)]
    fn new(share: R) -> Self {
        // The root of 3 s² − 2 s³ = share: ½ − sin(⅓ arcsin(1 − 2 share)).
        let sine = R::one() - R::splat(2.0) * unit(share);
        let cosine = ((R::one() - sine) * (R::one() + sine)).simd_max(R::zero()).sqrt();
        let third = atan2(sine, cosine) * R::splat(0.5 * FRAC_1_PI / 3.0);
        Self::at(R::splat(0.5) - sin_cos_turns(third).0)
    }

    /// By the position in equal steps.
    #[inline(always)]
    fn at(s: R) -> Self {
        let place = unit(s) * R::splat((AZIMUTHS - 1) as f32);
        let first = place.floor().simd_min(R::splat((AZIMUTHS - 2) as f32));
        let node = first.to_int();
        let (one, two) = (R::UInt::splat(1), R::UInt::splat(2));
        // The quarter is extended by its mirror image: node −1 is node 1, and that after the last the one before it.
        let is_first = node.simd_eq(R::UInt::splat(0));
        let before = R::UInt::select(is_first, one, node - one);
        let is_last = node.simd_eq(R::UInt::splat(AZIMUTHS as u32 - 2));
        let after = R::UInt::select(is_last, node, node + two);
        let nodes = [before, node, node + one, after];
        Self { nodes, weights: Between::at(node, place - first).weights() }
    }
}

/// The weight of each node of the azimuth in the mean.
fn azimuth_weights() -> [f32; AZIMUTHS] {
    let steps = 4096;
    let mut sum = [0.0; AZIMUTHS];
    for i in 0..steps {
        let s = (i as f32 + 0.5) / steps as f32;
        let around = Around::<f32>::at(s);
        for (node, weight) in around.nodes.into_iter().zip(around.weights) {
            sum[node.0 as usize] += f64::from(6.0 * s * (1.0 - s) * weight) / f64::from(steps);
        }
    }
    sum.map(|weight| weight as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conductor::Conductor;
    use crate::lanes::lane;
    use crate::microfacet::Microfacets;
    use crate::{LocalDir, Spectrum};
    use lumbre_math::random::RandomStream;
    use lumbre_math::{Vec2, Vec3};
    use std::f32::consts::FRAC_PI_2;

    /// The direction of a node.
    fn direction(azimuth: usize, cosine: usize) -> Vec3 {
        let cos = (cosine as f32 / (COSINES - 1) as f32).powi(2).max(1e-4);
        let sin = (1.0 - cos * cos).sqrt();
        let s = azimuth as f32 / (AZIMUTHS - 1) as f32;
        let phi = s * s * (3.0 - 2.0 * s) * FRAC_PI_2;
        Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
    }

    /// The mean weight of samples at a lattice of random numbers.
    fn reflected(alpha: Vec2, w: Vec3, [points, step]: [u32; 2]) -> f32 {
        let mirror = Conductor::from_reflectance(Spectrum::WHITE, Microfacets::new(alpha.x, alpha.y));
        let sum: f64 = (0..points)
            .map(|i| {
                let turns = u64::from(i) * u64::from(step) % u64::from(points);
                let u = Vec2::new(turns as f32, i as f32 + 0.5) / points as f32;
                mirror.sample(LocalDir(w), u).map_or(0.0, |sample| f64::from(sample.weight.g))
            })
            .sum();
        (sum / f64::from(points)) as f32
    }

    fn node(x: usize, y: usize, azimuth: usize, cosine: usize, lattice: [u32; 2]) -> f32 {
        let root = |i: usize| i as f32 / (ROUGHNESSES - 1) as f32;
        reflected(Vec2::new(root(x).powi(3), root(y).powi(3)), direction(azimuth, cosine), lattice)
    }

    /// Writes the table: `cargo test --release -p lumbre-shading --lib stretched -- --ignored`
    #[test]
    #[ignore = "makes src/stretched.bin anew"]
    fn make_the_table() {
        let mut bytes = Vec::with_capacity(2 * PAIRS * PAGE);
        for x in 0..ROUGHNESSES {
            for y in 0..=x {
                for azimuth in 0..AZIMUTHS {
                    for cosine in 0..COSINES {
                        let value = node(x, y, azimuth, cosine, [28657, 17711]);
                        bytes.extend(((value.clamp(0.0, 1.0) * 65535.0).round() as u16).to_le_bytes());
                    }
                }
            }
        }
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/stretched.bin"), bytes).unwrap();
    }

    #[test]
    fn the_table_is_what_facets_reflect_at_nodes_and_between() {
        let mut random = RandomStream::new(5);
        let mut worst = 0.0_f32;
        for _ in 0..400 {
            let mut number = || random.next_f32();
            let alpha = Vec2::new(number().powi(2).max(0.02), number().powi(2).max(0.02));
            let (cos, phi) = (number().powi(2).max(1e-3), number() * std::f32::consts::TAU);
            let sin = (1.0 - cos * cos).sqrt();
            let w = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
            let (ours, expected) =
                (STRETCHED.mirror(alpha.into(), lane(w)), reflected(alpha, w, [28657, 17711]));
            worst = worst.max((ours - expected).abs());
            // Along the surface, and along the narrow axis most, the steps are too wide.
            let tolerance = if cos < 0.1 { 3e-2 } else { 3e-3 };
            assert!((ours - expected).abs() < tolerance, "{alpha} {w}: {ours} {expected}");
        }
        assert!(worst > 1e-6);
    }

    #[test]
    fn facets_that_are_not_stretched_are_those_of_the_other_table() {
        for root in [0.0, 0.21, 0.5, 0.83, 1.0_f32] {
            let alpha = root * root;
            for cos in [0.02, 0.3, 0.77, 1.0_f32] {
                let w = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let (ours, other) =
                    (STRETCHED.mirror([alpha; 2], lane(w)), crate::albedo::ALBEDO.mirror(cos, alpha));
                assert!((ours - other).abs() < 4e-3, "{alpha} {cos}: {ours} {other}");
            }
            let (ours, other) = (STRETCHED.mean([alpha; 2]), crate::albedo::ALBEDO.mirror_mean(alpha));
            assert!((ours - other).abs() < 2e-3, "{alpha}: {ours} {other}");
        }
    }

    #[test]
    fn its_mean_is_that_of_the_cosine_law() {
        for alpha in [Vec2::new(1.0, 0.04), Vec2::new(0.1, 0.6), Vec2::new(0.3, 0.2)] {
            let steps = 200;
            let mut sum = 0.0;
            for i in 0..steps {
                for j in 0..steps {
                    let cos = ((i as f32 + 0.5) / steps as f32).sqrt();
                    let phi = (j as f32 + 0.5) / steps as f32 * std::f32::consts::TAU;
                    let sin = (1.0 - cos * cos).sqrt();
                    sum += STRETCHED.mirror(alpha.into(), V3::new(sin * phi.cos(), sin * phi.sin(), cos));
                }
            }
            let mean = sum / (steps * steps) as f32;
            assert!(
                (mean - STRETCHED.mean(alpha.into())).abs() < 5e-4,
                "{alpha}: {mean} {}",
                STRETCHED.mean(alpha.into())
            );
        }
    }
}
