//! Tables of directional albedos of rough surfaces, and of their means.

use std::sync::LazyLock;

use lumbre_simd::{Real, Task, UInt};

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
const MAX_SHEEN: f32 = 8.0;

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
pub(crate) struct Between<R: Real> {
    first: R::UInt,
    share: R,
}

impl<R: Real> Between<R> {
    /// The position of `x` in [0, 1] between `nodes` in equal steps.
    #[inline(always)]
    pub(crate) fn new(x: R, nodes: usize) -> Self {
        let place = unit(x) * R::splat((nodes - 1) as f32);
        let first = place.floor().simd_min(R::splat((nodes - 2) as f32));
        Self::at(first.to_int(), place - first)
    }

    /// The position at a fraction between a node and the next.
    #[inline(always)]
    pub(crate) fn at(first: R::UInt, share: R) -> Self {
        Self { first, share }
    }

    /// Catmull–Rom weights; beyond the ends the table is extended linearly. Linear interpolation would not
    /// conserve energy.
    #[inline(always)]
    pub(crate) fn weights(self) -> [R; 4] {
        let (t, one, half) = (self.share, R::one(), R::splat(0.5));
        [
            R::splat(-0.5) * t * (one - t) * (one - t),
            one + t * t * (R::splat(1.5) * t - R::splat(2.5)),
            half * t + t * t * (R::splat(2.0) - R::splat(1.5) * t),
            half * t * t * (t - one),
        ]
    }

    /// The first of the four nodes around the position, and their weights.
    #[inline(always)]
    pub(crate) fn nodes(self, nodes: usize) -> (R::UInt, [R; 4]) {
        let (zero, two) = (R::zero(), R::splat(2.0));
        let [a, b, c, d] = self.weights();
        let is_first = self.first.simd_eq(R::UInt::splat(0));
        let is_last = self.first.simd_eq(R::UInt::splat(nodes as u32 - 2));
        // The node before the first is extrapolated to 2 p0 − p1, and so is that after the last.
        let weights = [
            R::select(is_first, b + two * a, R::select(is_last, zero, a)),
            R::select(is_first, c - a, R::select(is_last, a, b)),
            R::select(is_first, d, R::select(is_last, b - d, c)),
            R::select(is_first, zero, R::select(is_last, c + two * d, d)),
        ];
        let back = R::UInt::select(is_last, R::UInt::splat(2), R::UInt::splat(1));
        (self.first - R::UInt::select(is_first, R::UInt::splat(0), back), weights)
    }
}

/// The number clamped to [0, 1]; 0 for NaN.
#[inline(always)]
pub(crate) fn unit<R: Real>(x: R) -> R {
    x.simd_min(R::one()).or_zero(x.simd_gt(R::zero()))
}

/// The sum of the numbers from an index on, each by its weight.
#[inline(always)]
pub(crate) fn weighed<R: Real>(table: &[f32], start: R::UInt, weights: [R; 4]) -> R {
    let [a, b, c, d] = weights;
    let [one, two, three] = [R::UInt::splat(1), R::UInt::splat(2), R::UInt::splat(3)];
    a * R::gather(table, start)
        + b * R::gather(table, start + one)
        + c * R::gather(table, start + two)
        + d * R::gather(table, start + three)
}

#[inline(always)]
fn by_cosine<R: Real>(cos: R) -> Between<R> {
    Between::new(unit(cos).sqrt(), COSINES)
}

#[inline(always)]
fn by_alpha<R: Real>(alpha: R) -> Between<R> {
    Between::new(unit(alpha).sqrt(), ROUGHNESSES)
}

#[inline(always)]
fn by_index<R: Real>(eta: R) -> Between<R> {
    let root = (eta - R::one()) / (eta + R::one()) / R::splat(MAX_ROOT);
    Between::new(unit(root).sqrt(), INDICES)
}

impl Albedo {
    fn from_bytes(bytes: &[u8]) -> Self {
        assert_eq!(bytes.len(), 2 * PAGES * PAGE);
        let pairs =
            bytes.chunks_exact(2).map(|pair| f32::from(u16::from_le_bytes([pair[0], pair[1]])) / 65535.0);
        let scale = |i: usize| if i / PAGE == SHEEN { MAX_SHEEN } else { 1.0 };
        let values: Vec<f32> = pairs.enumerate().map(|(i, v)| v * scale(i)).collect();
        let weights = mean_weights::<COSINES>();
        let mean = |row: &[f32]| row.iter().zip(weights).map(|(v, w)| v * w).sum();
        let means = values.chunks_exact(COSINES).map(mean).collect();
        Self { values, means }
    }

    #[inline(always)]
    fn at<R: Real>(&self, page: R::UInt, alpha: R, cos: R) -> R {
        R::call(At { albedo: self, page, alpha, cos })
    }

    #[inline(always)]
    fn mean_at<R: Real>(&self, page: R::UInt, alpha: R) -> R {
        let (row, weights) = by_alpha(alpha).nodes(ROUGHNESSES);
        weighed(&self.means, page * R::UInt::splat(ROUGHNESSES as u32) + row, weights)
    }

    /// [`Albedo::at`] between the pages of indices of refraction that begin with one.
    #[inline(always)]
    fn by_index_at<R: Real>(&self, page: R::UInt, eta: R, alpha: R, cos: R) -> R {
        R::call(ByIndex { eta, at: At { albedo: self, page, alpha, cos } })
    }

    #[inline(always)]
    fn mean_by_index_at<R: Real>(&self, page: R::UInt, eta: R, alpha: R) -> R {
        R::call(MeanByIndex { albedo: self, page, eta, alpha })
    }

    /// The single-scattering albedo of perfectly reflecting facets.
    #[inline(always)]
    pub(crate) fn mirror<R: Real>(&self, cos: R, alpha: R) -> R {
        let albedo = self.at(R::UInt::splat(MIRROR as u32), alpha, cos);
        albedo.simd_max(R::zero()).simd_min(R::one())
    }

    /// The mean of [`Albedo::mirror`].
    #[inline(always)]
    pub(crate) fn mirror_mean<R: Real>(&self, alpha: R) -> R {
        self.mean_at(R::UInt::splat(MIRROR as u32), alpha)
    }

    /// The albedo of the outside of a dielectric of index 1 to [`MAX_ETA`].
    #[inline(always)]
    pub(crate) fn face<R: Real>(&self, cos: R, alpha: R, eta: R) -> R {
        self.by_index_at(R::UInt::splat(FACES as u32), eta, alpha, cos)
    }

    /// The mean of [`Albedo::face`].
    #[inline(always)]
    pub(crate) fn face_mean<R: Real>(&self, alpha: R, eta: R) -> R {
        self.mean_by_index_at(R::UInt::splat(FACES as u32), eta, alpha)
    }

    /// The page of a rough dielectric interface, seen from one side: from the denser side it is the inside.
    #[inline(always)]
    fn glass_pages<R: Real>(eta: R, inside: R::Mask) -> (R::UInt, R) {
        let denser = eta.simd_ge(R::one());
        let is_inside = (denser & inside) | (!denser & !inside);
        let page = R::UInt::select(is_inside, R::UInt::splat(INSIDE as u32), R::UInt::splat(OUTSIDE as u32));
        (page, R::select(denser, eta, eta.recip()))
    }

    /// The reflected and transmitted power of a dielectric interface of index `eta` (inside over outside).
    #[inline(always)]
    pub(crate) fn glass<R: Real>(&self, cos: R, alpha: R, eta: R, inside: R::Mask) -> R {
        let (page, eta) = Self::glass_pages(eta, inside);
        self.by_index_at(page, eta, alpha, cos)
    }

    /// The mean of [`Albedo::glass`].
    #[inline(always)]
    pub(crate) fn glass_mean<R: Real>(&self, alpha: R, eta: R, inside: R::Mask) -> R {
        let (page, eta) = Self::glass_pages(eta, inside);
        self.mean_by_index_at(page, eta, alpha)
    }

    /// The albedo of white sheen, by roughness (α is its square); may be more than 1.
    #[inline(always)]
    pub(crate) fn sheen<R: Real>(&self, cos: R, roughness: R) -> R {
        self.at(R::UInt::splat(SHEEN as u32), roughness * roughness, cos).simd_max(R::zero())
    }
}

/// A value of a page.
struct At<'a, R: Real> {
    albedo: &'a Albedo,
    page: R::UInt,
    alpha: R,
    cos: R,
}

impl<R: Real> Task<R> for At<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        let (row, by_row) = by_alpha(self.alpha).nodes(ROUGHNESSES);
        let (column, by_column) = by_cosine(self.cos).nodes(COSINES);
        let row = self.page * R::UInt::splat(ROUGHNESSES as u32) + row;
        let start = row * R::UInt::splat(COSINES as u32) + column;
        let mut sum = R::zero();
        for (i, weight) in by_row.into_iter().enumerate() {
            let start = start + R::UInt::splat((i * COSINES) as u32);
            sum = sum + weight * weighed(&self.albedo.values, start, by_column);
        }
        sum
    }
}

/// A value between pages; the page of the lowest index is given.
struct ByIndex<'a, R: Real> {
    eta: R,
    at: At<'a, R>,
}

impl<R: Real> Task<R> for ByIndex<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        let (first, weights) = by_index(self.eta).nodes(INDICES);
        let At { albedo, page, alpha, cos } = self.at;
        let mut sum = R::zero();
        for (i, weight) in weights.into_iter().enumerate() {
            sum = sum + weight * albedo.at(page + first + R::UInt::splat(i as u32), alpha, cos);
        }
        sum.simd_max(R::zero()).simd_min(R::one())
    }
}

/// A mean between pages.
struct MeanByIndex<'a, R: Real> {
    albedo: &'a Albedo,
    page: R::UInt,
    eta: R,
    alpha: R,
}

impl<R: Real> Task<R> for MeanByIndex<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        let (first, weights) = by_index(self.eta).nodes(INDICES);
        let mut sum = R::zero();
        for (i, weight) in weights.into_iter().enumerate() {
            let page = self.page + first + R::UInt::splat(i as u32);
            sum = sum + weight * self.albedo.mean_at(page, self.alpha);
        }
        sum
    }
}

/// ∫ 2 μ f(μ) dμ for each node of the cubic interpolation.
pub(crate) fn mean_weights<const N: usize>() -> [f32; N] {
    let steps = 4096;
    let mut sum = [0.0; N];
    for i in 0..steps {
        let t = (f64::from(i) + 0.5) / f64::from(steps);
        let (first, weights) = Between::new(t as f32, N).nodes(N);
        for (sum, weight) in sum[first.0 as usize..].iter_mut().zip(weights) {
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
                sheen::unbounded(roughness, wo.lane(), wi.lane()) * std::f32::consts::TAU * 3.0 * u.y * u.y
            });
            return value / MAX_SHEEN;
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
                let expected = node(page, r, c, [28657, 17711]) * if page == SHEEN { MAX_SHEEN } else { 1.0 };
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
