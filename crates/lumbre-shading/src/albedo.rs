//! Tables of directional albedos of rough surfaces, and of their means.

use std::sync::LazyLock;

/// Nodes of the cosine, at the squares of equal steps from 0 to 1: dense at grazing angles.
const COSINES: usize = 32;
/// Nodes of the square root of α, in equal steps from 0 to 1.
const ROUGHNESSES: usize = 24;
/// Nodes of (η − 1)/(η + 1), at [`MAX_ROOT`] times the squares of equal steps from 0 to 1: dense near an index
/// of 1, where reflection varies most at grazing angles.
const INDICES: usize = 24;
/// (η − 1)/(η + 1) at the largest index of refraction in the tables, [`MAX_ETA`].
const MAX_ROOT: f32 = 0.6;
/// The largest index of refraction in the tables; larger ones count as this.
pub(crate) const MAX_ETA: f32 = 4.0;
/// Values are stored as integers up to 65535 and scaled by this for sheen, whose albedo may exceed 1.
const MOST_SHEEN: f32 = 8.0;

const PAGE: usize = COSINES * ROUGHNESSES;
const MIRROR: usize = 0;
const SHEEN: usize = 1;
const FACES: usize = 2;
const OUTSIDE: usize = FACES + INDICES;
const INSIDE: usize = OUTSIDE + INDICES;
const PAGES: usize = INSIDE + INDICES;

/// All tables. `albedo.bin` is written by the ignored test of this file, which defines each value.
pub(crate) static ALBEDO: LazyLock<Albedo> =
    LazyLock::new(|| Albedo::from_bytes(include_bytes!("albedo.bin")));

/// Directional albedos, interpolated cubically, and their cosine-weighted means.
pub(crate) struct Albedo {
    values: Vec<f32>,
    /// For each row of cosines.
    means: Vec<f32>,
}

/// A position between two nodes.
#[derive(Clone, Copy)]
pub(crate) struct Between(usize, f32);

impl Between {
    /// The position of `x` in [0, 1] between `nodes` in equal steps.
    pub(crate) fn new(x: f32, nodes: usize) -> Self {
        let place = crate::unit(x) * (nodes - 1) as f32;
        let first = (place as usize).min(nodes - 2);
        Self(first, place - first as f32)
    }

    /// The position at a fraction between a node and the next.
    pub(crate) fn at(first: usize, share: f32) -> Self {
        Self(first, share)
    }

    /// Catmull–Rom weights; beyond the ends the table is extended linearly. Linear interpolation would not
    /// conserve energy.
    pub(crate) fn weights(self) -> [f32; 4] {
        let t = self.1;
        [
            -0.5 * t * (1.0 - t) * (1.0 - t),
            1.0 + t * t * (1.5 * t - 2.5),
            0.5 * t + t * t * (2.0 - 1.5 * t),
            0.5 * t * t * (t - 1.0),
        ]
    }

    /// The first of the nodes around the position, and their weights.
    pub(crate) fn nodes(self, nodes: usize) -> (usize, [f32; 4]) {
        let Self(first, _) = self;
        let [a, b, c, d] = self.weights();
        if first == 0 {
            // The node before the first is extrapolated to 2 p0 − p1.
            return (0, [b + 2.0 * a, c - a, d, 0.0]);
        }
        if first + 2 == nodes {
            return (first - 2, [0.0, a, b - d, c + 2.0 * d]);
        }
        (first - 1, [a, b, c, d])
    }

    pub(crate) fn interpolate(self, nodes: usize, mut f: impl FnMut(usize) -> f32) -> f32 {
        let (first, weights) = self.nodes(nodes);
        weights.into_iter().enumerate().map(|(i, w)| w * f(first + i)).sum()
    }
}

fn by_cosine(cos: f32) -> Between {
    Between::new(crate::unit(cos).sqrt(), COSINES)
}

fn by_alpha(alpha: f32) -> Between {
    Between::new(crate::unit(alpha).sqrt(), ROUGHNESSES)
}

fn by_index(eta: f32) -> Between {
    Between::new(crate::unit((eta - 1.0) / (eta + 1.0) / MAX_ROOT).sqrt(), INDICES)
}

impl Albedo {
    fn from_bytes(bytes: &[u8]) -> Self {
        assert_eq!(bytes.len(), 2 * PAGES * PAGE);
        let pairs =
            bytes.chunks_exact(2).map(|pair| f32::from(u16::from_le_bytes([pair[0], pair[1]])) / 65535.0);
        let scale = |i: usize| if i / PAGE == SHEEN { MOST_SHEEN } else { 1.0 };
        let values: Vec<f32> = pairs.enumerate().map(|(i, v)| v * scale(i)).collect();
        let weights = mean_weights::<COSINES>();
        let mean = |row: &[f32]| row.iter().zip(weights).map(|(v, w)| v * w).sum();
        let means = values.chunks_exact(COSINES).map(mean).collect();
        Self { values, means }
    }

    fn at(&self, page: usize, alpha: Between, cos: Between) -> f32 {
        alpha.interpolate(ROUGHNESSES, |a| {
            let row = (page * ROUGHNESSES + a) * COSINES;
            cos.interpolate(COSINES, |c| self.values[row + c])
        })
    }

    fn mean_at(&self, page: usize, alpha: Between) -> f32 {
        alpha.interpolate(ROUGHNESSES, |a| self.means[page * ROUGHNESSES + a])
    }

    /// The single-scattering albedo of perfectly reflecting facets.
    pub(crate) fn mirror(&self, cos: f32, alpha: f32) -> f32 {
        self.at(MIRROR, by_alpha(alpha), by_cosine(cos)).clamp(0.0, 1.0)
    }

    /// The mean of [`Albedo::mirror`].
    pub(crate) fn mirror_mean(&self, alpha: f32) -> f32 {
        self.mean_at(MIRROR, by_alpha(alpha))
    }

    /// The albedo of the outside of a dielectric of index 1 to [`MAX_ETA`].
    pub(crate) fn face(&self, cos: f32, alpha: f32, eta: f32) -> f32 {
        let (alpha, cos) = (by_alpha(alpha), by_cosine(cos));
        by_index(eta).interpolate(INDICES, |e| self.at(FACES + e, alpha, cos)).clamp(0.0, 1.0)
    }

    /// The mean of [`Albedo::face`].
    pub(crate) fn face_mean(&self, alpha: f32, eta: f32) -> f32 {
        let alpha = by_alpha(alpha);
        by_index(eta).interpolate(INDICES, |e| self.mean_at(FACES + e, alpha))
    }

    /// The page of a rough dielectric interface, seen from one side: from the denser side it is the inside.
    fn glass_pages(eta: f32, inside: bool) -> (usize, f32) {
        let denser = eta >= 1.0;
        (if denser == inside { INSIDE } else { OUTSIDE }, if denser { eta } else { 1.0 / eta })
    }

    /// The reflected and transmitted power of a dielectric interface of index `eta` (inside over outside).
    pub(crate) fn glass(&self, cos: f32, alpha: f32, eta: f32, inside: bool) -> f32 {
        let (alpha, cos) = (by_alpha(alpha), by_cosine(cos));
        let (page, eta) = Self::glass_pages(eta, inside);
        by_index(eta).interpolate(INDICES, |e| self.at(page + e, alpha, cos)).clamp(0.0, 1.0)
    }

    /// The mean of [`Albedo::glass`].
    pub(crate) fn glass_mean(&self, alpha: f32, eta: f32, inside: bool) -> f32 {
        let alpha = by_alpha(alpha);
        let (page, eta) = Self::glass_pages(eta, inside);
        by_index(eta).interpolate(INDICES, |e| self.mean_at(page + e, alpha))
    }

    /// The albedo of white sheen, by roughness (α is its square); may be more than 1.
    pub(crate) fn sheen(&self, cos: f32, roughness: f32) -> f32 {
        self.at(SHEEN, by_alpha(roughness * roughness), by_cosine(cos)).max(0.0)
    }
}

/// ∫ 2 μ f(μ) dμ for each node of the cubic interpolation.
pub(crate) fn mean_weights<const N: usize>() -> [f32; N] {
    let steps = 4096;
    let mut sum = [0.0; N];
    for i in 0..steps {
        let t = (f64::from(i) + 0.5) / f64::from(steps);
        let (first, weights) = Between::new(t as f32, N).nodes(N);
        for (sum, weight) in sum[first..].iter_mut().zip(weights) {
            // μ = t², dμ = 2 t dt
            *sum += 4.0 * t.powi(3) / f64::from(steps) * f64::from(weight);
        }
    }
    sum.map(|weight| weight as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conductor::Conductor;
    use crate::dielectric::{Dielectric, Ways};
    use crate::microfacet::Microfacets;
    use crate::{LocalDir, Spectrum, sheen};
    use lumbre_math::random::RandomStream;
    use lumbre_math::{Vec2, Vec3};

    fn direction(cos: f32) -> LocalDir {
        LocalDir(Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos))
    }

    /// Neighbours in Fibonacci's sequence: points of even lattices.
    const COARSE: [u32; 2] = [6765, 4181];
    const FINE: [u32; 2] = [75025, 46368];

    /// The value of a node: means over a lattice of random numbers of the weights that the lobes themselves give.
    fn node(page: usize, roughness: usize, cosine: usize, [points, step]: [u32; 2]) -> f32 {
        // In the surface itself there are no directions; nothing is as smooth as nothing.
        let cos = (cosine as f32 / (COSINES - 1) as f32).powi(2).max(1e-4);
        let root = roughness as f32 / (ROUGHNESSES - 1) as f32;
        let facets = Microfacets::new(root * root, root * root);
        let wo = direction(cos);
        let mean = |f: &dyn Fn(Vec2) -> f32| {
            let point = |i: u32| {
                let turns = u64::from(i) * u64::from(step) % u64::from(points);
                // The second number is the one that is not an angle.
                Vec2::new(turns as f32, i as f32 + 0.5) / points as f32
            };
            let sum: f64 = (0..points).map(|i| f64::from(f(point(i)))).sum();
            (sum / f64::from(points)) as f32
        };
        if page == MIRROR {
            let mirror = Conductor::from_reflectance(Spectrum::WHITE, facets);
            return mean(&|u| mirror.sample(wo, u).map_or(0.0, |sample| sample.weight.g));
        }
        if page == SHEEN {
            let roughness = root.max(sheen::Sheen::MIN_ROUGHNESS);
            // The cosine of wi is the cube of y, φ by x: the lobe crowds at the horizon.
            let value = mean(&|u| {
                let z = u.y.powi(3);
                let (sin, cos) = (std::f32::consts::TAU * u.x).sin_cos();
                let r = (1.0 - z * z).max(0.0).sqrt();
                let wi = LocalDir(Vec3::new(r * cos, r * sin, z));
                sheen::unbounded(roughness, wo, wi) * std::f32::consts::TAU * 3.0 * u.y * u.y
            });
            return value / MOST_SHEEN;
        }
        let index = (page - FACES) % INDICES;
        let x = (index as f32 / (INDICES - 1) as f32).powi(2) * MAX_ROOT;
        // No border at all would be a delta: next to it.
        let eta = ((1.0 + x) / (1.0 - x)).max(1.001);
        let glass = Dielectric { eta, facets };
        let wo = if page >= INSIDE { -wo } else { wo };
        mean(&|u| {
            let way = |ways| glass.sample_of(wo, 0.0, u, ways).map_or(0.0, |s| s.weight.g * s.eta * s.eta);
            way(Ways::Reflection) + if page >= OUTSIDE { way(Ways::Transmission) } else { 0.0 }
        })
    }

    /// Writes the tables: `cargo test --release -p lumbre-shading --lib albedo -- --ignored`
    #[test]
    #[ignore = "makes src/albedo.bin anew"]
    fn make_the_tables() {
        let mut bytes = Vec::with_capacity(2 * PAGES * PAGE);
        for page in 0..PAGES {
            let lattice = if page >= FACES { COARSE } else { FINE };
            for i in 0..PAGE {
                let value = node(page, i / COSINES, i % COSINES, lattice);
                assert!((-1e-3..1.001).contains(&value), "{page} {i} {value}");
                bytes.extend(((value.clamp(0.0, 1.0) * 65535.0).round() as u16).to_le_bytes());
            }
        }
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/albedo.bin"), bytes).unwrap();
    }

    #[test]
    fn the_tables_are_what_the_lobes_reflect() {
        let mut random = RandomStream::new(3);
        let mut count = 0;
        for page in 0..PAGES {
            for _ in 0..4 {
                let one_of = |n: usize, x: f32| (x * n as f32) as usize;
                let (r, c) = (one_of(ROUGHNESSES, random.next_f32()), one_of(COSINES, random.next_f32()));
                let expected =
                    node(page, r, c, [28657, 17711]) * if page == SHEEN { MOST_SHEEN } else { 1.0 };
                let ours = ALBEDO.values[(page * ROUGHNESSES + r) * COSINES + c];
                assert!(
                    (ours - expected).abs() < 1e-3 * expected.max(1.0),
                    "{page} {r} {c}: {ours} {expected}"
                );
                count += 1;
            }
        }
        assert_eq!(count, 4 * PAGES);
    }

    #[test]
    fn means_are_those_of_the_cosine_law() {
        assert!((mean_weights::<COSINES>().iter().sum::<f32>() - 1.0).abs() < 1e-5);
        let steps = 20_000;
        for alpha in [0.0, 0.03, 0.4, 1.0] {
            let sum: f32 = (0..steps)
                .map(|i| {
                    let mu = (i as f32 + 0.5) / steps as f32;
                    2.0 * mu * ALBEDO.face(mu, alpha, 1.7) / steps as f32
                })
                .sum();
            assert!((sum - ALBEDO.face_mean(alpha, 1.7)).abs() < 1e-4, "{alpha}: {sum}");
        }
    }
}
