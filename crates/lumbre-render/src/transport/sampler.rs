//! Random numbers as a pure function of (seed, pixel, sample index, purpose), for one sample or in lanes.

use lumbre_geometry::Ray;
use lumbre_math::random::{PixelRandom, combine, hash_dvec3, hash_words};
use lumbre_math::{DVec2, Vec2};
use lumbre_scene::{SamplerDesc, SamplerKind};
use lumbre_shading::medium::PassageNumbers;
use lumbre_simd::random::{pcg4d, uniform};
use lumbre_simd::{Real, UInt};

/// How the numbers of a pixel's samples are computed.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    kind: SamplerKind,
    seed: u64,
}

/// The position in the pixel, the time of a ray, and its wavelengths.
const FILTER: u32 = 0;
/// The position on the lens, and what the first two surfaces cover.
const LENS: u32 = 1;
/// Path vertex k has the labels `FIRST_VERTEX + 2 * k` for its light, and the next one for its BSDF.
const FIRST_VERTEX: u32 = 2;
/// Labels of integrators that sample every light at a vertex.
const EVERY_LIGHT: u32 = 1 << 24;
/// Labels of distance samples in media: two each.
const EVERY_DISTANCE_SAMPLE: u32 = 1 << 27;
/// Labels of integrators that follow several rays from a vertex.
const EVERY_BRANCH: u32 = 1 << 28;

impl Sampler {
    /// The sampler of a description.
    pub fn new(desc: &SamplerDesc) -> Self {
        Self { kind: desc.kind, seed: desc.seed }
    }

    /// The numbers of one sample of the pixel in column `x` and row `y`.
    #[inline]
    pub fn numbers(&self, x: u32, y: u32, index: u32) -> SampleNumbers {
        SampleNumbers { kind: self.kind, pixel: self.pixel(x, y), index }
    }

    /// The words from which all numbers of a pixel's samples are derived.
    #[inline]
    pub(crate) fn pixel(&self, x: u32, y: u32) -> [u32; 2] {
        let key = PixelRandom::new(self.seed, x, y).key();
        [key as u32, (key >> 32) as u32]
    }

    /// The number in [0, 1) by which all pixels choose the wavelengths of the samples with this index: a randomly
    /// shifted van der Corput sequence, so that the wavelengths of the first 2ᵏ samples are equally spaced.
    pub(crate) fn shared_wavelengths(&self, index: u32) -> f32 {
        // Not a pixel of any picture.
        let number = |index| self.numbers(u32::MAX, u32::MAX, index).aim()[3];
        match self.kind {
            SamplerKind::Independent => number(index),
            SamplerKind::Sobol => (number(0) + uniform::<f32>(UInt::splat(index.reverse_bits()))).fract(),
        }
    }

    /// The kind of all numbers.
    pub(crate) fn kind(&self) -> SamplerKind {
        self.kind
    }
}

/// The random numbers of one sample. Taking one changes none of the others.
#[derive(Clone, Copy, Debug)]
pub struct SampleNumbers {
    kind: SamplerKind,
    /// A hash of the seed and the pixel.
    pixel: [u32; 2],
    index: u32,
}

/// The random numbers of a sample in each lane: the same bits as [`SampleNumbers`].
#[derive(Clone, Copy)]
pub(crate) struct LaneNumbers<R: Real> {
    /// Of all lanes.
    pub(crate) kind: SamplerKind,
    /// A hash of the seed and the pixel.
    pub(crate) pixel: [R::UInt; 2],
    /// The sample.
    pub(crate) index: R::UInt,
}

impl<R: Real> LaneNumbers<R> {
    /// The position in the pixel filter, the fraction of the exposure, and the wavelengths.
    #[inline(always)]
    pub(crate) fn aim(&self) -> [R; 4] {
        self.four(R::UInt::splat(FILTER))
    }

    /// The point on a light, the choice of the light, and its further digits.
    #[inline(always)]
    pub(crate) fn light(&self, vertex: R::UInt) -> [R; 4] {
        self.four(vertex.shl::<1>() + R::UInt::splat(FIRST_VERTEX))
    }

    /// The direction, the lobe of a BSDF, and Russian roulette.
    #[inline(always)]
    pub(crate) fn scatter(&self, vertex: R::UInt) -> [R; 4] {
        self.four(vertex.shl::<1>() + R::UInt::splat(FIRST_VERTEX + 1))
    }

    /// Four numbers of a label in [0, 1), multiples of 2⁻²⁴. Over the samples of a pixel, Sobol numbers are stratified:
    /// the first two together, the others separately.
    #[inline(always)]
    pub(crate) fn four(&self, label: R::UInt) -> [R; 4] {
        let [p, q] = self.pixel;
        let bits = match self.kind {
            SamplerKind::Independent => pcg4d([p, q, self.index, label]),
            SamplerKind::Sobol => {
                let k = pcg4d([p, q, label, R::UInt::splat(1)]);
                let l = pcg4d([p, q, label, R::UInt::splat(2)]);
                let index = reversed(self.index);
                let [x, y] = sobol_pair(index, [k[0], k[1], k[2]]);
                [x, y, sobol_one(index, [k[3], l[0]]), sobol_one(index, [l[1], l[2]])]
            }
        };
        [uniform(bits[0]), uniform(bits[1]), uniform(bits[2]), uniform(bits[3])]
    }
}

/// The word with its bits in reverse order.
#[inline(always)]
fn reversed<U: UInt>(x: U) -> U {
    let s = U::splat;
    let x = (x.shr::<1>() & s(0x5555_5555)) | (x & s(0x5555_5555)).shl::<1>();
    let x = (x.shr::<2>() & s(0x3333_3333)) | (x & s(0x3333_3333)).shl::<2>();
    let x = (x.shr::<4>() & s(0x0f0f_0f0f)) | (x & s(0x0f0f_0f0f)).shl::<4>();
    let x = (x.shr::<8>() & s(0x00ff_00ff)) | (x & s(0x00ff_00ff)).shl::<8>();
    x.shr::<16>() | x.shl::<16>()
}

/// [`lumbre_math::sobol::owen_scramble`] from and to reversed binary digits.
#[inline(always)]
fn reversed_scramble<U: UInt>(x: U, seed: U) -> U {
    let s = U::splat;
    let x = x ^ (x * s(0x3d20_adea));
    let x = x + seed;
    let x = x * (seed.shr::<16>() | s(1));
    let x = x ^ (x * s(0x0552_6c56));
    x ^ (x * s(0x53a2_2864))
}

/// An Owen-scrambled Sobol point, from the reversed index and the keys of the shuffle and of both coordinates: see
/// [`lumbre_math::sobol`].
#[inline(always)]
fn sobol_pair<U: UInt>(reversed_index: U, keys: [U; 3]) -> [U; 2] {
    let s = U::splat;
    // In reverse order, the radical inverse is the index itself.
    let x = reversed(reversed_scramble(reversed_index, keys[0]));
    let y = x ^ (x & s(0xaaaa_aaaa)).shr::<1>();
    let y = y ^ (y & s(0xcccc_cccc)).shr::<2>();
    let y = y ^ (y & s(0xf0f0_f0f0)).shr::<4>();
    let y = y ^ (y & s(0xff00_ff00)).shr::<8>();
    let y = y ^ y.shr::<16>();
    [reversed(reversed_scramble(x, keys[1])), reversed(reversed_scramble(y, keys[2]))]
}

/// A number that is stratified over aligned ranges of indices, from the keys of the shuffle and of the scramble.
#[inline(always)]
fn sobol_one<U: UInt>(reversed_index: U, keys: [U; 2]) -> U {
    let shuffled = reversed(reversed_scramble(reversed_index, keys[0]));
    reversed(reversed_scramble(shuffled, keys[1]))
}

impl SampleNumbers {
    /// The numbers of a sample by the words of its pixel: see [`Sampler::pixel`].
    pub(crate) fn new(kind: SamplerKind, pixel: [u32; 2], index: u32) -> Self {
        Self { kind, pixel, index }
    }

    fn four(&self, label: u32) -> [f32; 4] {
        let pixel = self.pixel.map(UInt::splat);
        LaneNumbers::<f32> { kind: self.kind, pixel, index: UInt::splat(self.index) }.four(UInt::splat(label))
    }

    fn two(&self, label: u32) -> DVec2 {
        let [x, y, ..] = self.four(label);
        DVec2::new(x.into(), y.into())
    }

    /// The position in the pixel filter (two numbers), the fraction of the exposure, and the wavelengths: stratified
    /// over the samples of a pixel.
    pub fn aim(&self) -> [f32; 4] {
        self.four(FILTER)
    }

    /// The position in the pixel filter.
    pub fn filter(&self) -> DVec2 {
        self.two(FILTER)
    }

    /// The fraction of the exposure at the time of the ray.
    pub fn time(&self) -> f64 {
        self.aim()[2].into()
    }

    /// The position on the lens.
    pub fn lens(&self) -> DVec2 {
        self.two(LENS)
    }

    /// Decides which of the surfaces that cover a camera ray it meets: see [`lumbre_scene::Scene::closest_seen`].
    pub fn coverage(&self) -> [f32; 2] {
        let [.., first, second] = self.four(LENS);
        [first, second]
    }

    /// The choice of the light at a vertex: a multiple of 2⁻⁴⁸.
    pub fn light_choice(&self, vertex: u32) -> f64 {
        let [.., choice, more] = self.four(of_light(vertex));
        f64::from(choice) + f64::from(more) * (1.0 / 16_777_216.0)
    }

    /// The point on the light.
    pub fn light_point(&self, vertex: u32) -> DVec2 {
        self.two(of_light(vertex))
    }

    /// The point on the light with this number, for integrators that sample all lights with `points` points each: the
    /// points of all samples of the pixel are stratified together.
    pub fn point_on_each_light(&self, vertex: u32, light: u32, point: u32, points: u32) -> DVec2 {
        let label = EVERY_LIGHT.wrapping_add(vertex.wrapping_mul(1 << 12)).wrapping_add(light);
        let index = self.index.wrapping_mul(points).wrapping_add(point);
        Self { index, ..*self }.two(label)
    }

    /// Russian roulette for a branch of a ray tree.
    pub fn branch(&self, vertex: u32, branch: u32) -> f32 {
        self.four(EVERY_BRANCH.wrapping_add(vertex.wrapping_mul(1 << 12)).wrapping_add(branch))[2]
    }

    /// The choice of a BSDF's lobe.
    pub fn lobe(&self, vertex: u32) -> f32 {
        self.four(of_bsdf(vertex))[2]
    }

    /// The direction within that lobe.
    pub fn direction(&self, vertex: u32) -> Vec2 {
        let [x, y, ..] = self.four(of_bsdf(vertex));
        Vec2::new(x, y)
    }

    /// Russian roulette.
    pub fn survival(&self, vertex: u32) -> f32 {
        self.four(of_bsdf(vertex))[3]
    }

    /// A distance sample in a medium: the channel of the spectrum, and the distance.
    pub fn distance(&self, sample: u32) -> [f64; 2] {
        let [.., channel, distance] = self.four(in_medium(sample, 0));
        [channel.into(), distance.into()]
    }

    /// The numbers of a passage through a medium.
    pub fn passage(&self, sample: u32) -> PassageNumbers {
        let words = [self.pixel[0], self.pixel[1], self.index, in_medium(sample, 0)];
        PassageNumbers::new(self.distance(sample), hash_words(&words.map(u64::from)))
    }

    /// The seed of random decisions along a ray.
    pub fn along(&self, ray: &Ray) -> u64 {
        let line = combine(hash_dvec3(ray.origin), hash_dvec3(ray.direction));
        hash_words(&[self.pixel[0].into(), self.pixel[1].into(), self.index.into(), line])
    }

    /// The direction after the collision of a distance sample.
    pub fn scattered(&self, sample: u32) -> Vec2 {
        let [x, y, ..] = self.four(in_medium(sample, 0));
        Vec2::new(x, y)
    }

    /// Russian roulette after that collision.
    pub fn survives_collision(&self, sample: u32) -> f32 {
        self.four(in_medium(sample, 1))[2]
    }
}

fn of_light(vertex: u32) -> u32 {
    vertex.wrapping_mul(2).wrapping_add(FIRST_VERTEX)
}

fn of_bsdf(vertex: u32) -> u32 {
    of_light(vertex).wrapping_add(1)
}

fn in_medium(sample: u32, what: u32) -> u32 {
    EVERY_DISTANCE_SAMPLE.wrapping_add(sample.wrapping_mul(2)).wrapping_add(what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_depend_on_every_argument_and_stay_in_range() {
        for kind in [SamplerKind::Sobol, SamplerKind::Independent] {
            let sampler = |seed| Sampler::new(&SamplerDesc { kind, spp: None, seed });
            let base = sampler(3).numbers(5, 7, 11);
            let others = [
                sampler(4).numbers(5, 7, 11),
                sampler(3).numbers(6, 7, 11),
                sampler(3).numbers(5, 8, 11),
                sampler(3).numbers(5, 7, 12),
            ];
            for other in others {
                assert_ne!(base.aim(), other.aim());
                assert_ne!(base.light_choice(2), other.light_choice(2));
            }
            assert_ne!(base.direction(2), base.direction(3));
            assert_ne!(base.light_point(2), base.lens());
            assert_eq!(base.direction(2), sampler(3).numbers(5, 7, 11).direction(2));
            for index in 0..4096 {
                let numbers = sampler(3).numbers(5, 7, index);
                assert!((0.0..1.0).contains(&numbers.lobe(1)) && (0.0..1.0).contains(&numbers.survival(1)));
                assert!(numbers.light_point(1).max_element() < 1.0);
            }
        }
    }

    #[test]
    fn shared_wavelengths_of_two_to_the_n_are_equally_spaced() {
        let sampler = |seed, kind| Sampler::new(&SamplerDesc { kind, spp: None, seed });
        let numbers = |seed, kind, count| {
            let mut all: Vec<f32> = (0..count).map(|i| sampler(seed, kind).shared_wavelengths(i)).collect();
            all.sort_unstable_by(f32::total_cmp);
            all
        };
        for pair in numbers(9, SamplerKind::Sobol, 64).windows(2) {
            assert!((pair[1] - pair[0] - 1.0 / 64.0).abs() < 1e-6, "{pair:?}");
        }
        assert_ne!(numbers(9, SamplerKind::Sobol, 4), numbers(8, SamplerKind::Sobol, 4));
        for u in numbers(9, SamplerKind::Independent, 1000) {
            assert!((0.0..1.0).contains(&u));
        }
    }

    #[test]
    fn points_on_a_light_are_even_over_all_samples_of_a_pixel() {
        let sampler = Sampler::new(&SamplerDesc { kind: SamplerKind::Sobol, spp: None, seed: 9 });
        let mut cells = [0; 64];
        for (index, point) in (0..16).flat_map(|index| (0..4).map(move |point| (index, point))) {
            let u = sampler.numbers(13, 2, index).point_on_each_light(3, 5, point, 4);
            cells[(u.x * 8.0) as usize * 8 + (u.y * 8.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
    }

    #[test]
    fn independent_points_on_a_light_are_all_different() {
        let numbers = Sampler::new(&SamplerDesc { kind: SamplerKind::Independent, spp: None, seed: 9 })
            .numbers(13, 2, 4);
        let mut seen = Vec::new();
        for (light, point) in (0..3).flat_map(|light| (0..100).map(move |point| (light, point))) {
            let u = numbers.point_on_each_light(2, light, point, 100);
            assert!(u.min_element() >= 0.0 && u.max_element() < 1.0 && u.x != u.y);
            seen.extend([u.x.to_bits(), u.y.to_bits()]);
        }
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 600);
    }

    #[test]
    fn the_samples_of_a_pixel_are_even_in_time() {
        let sampler = Sampler::new(&SamplerDesc { kind: SamplerKind::Sobol, spp: None, seed: 9 });
        let mut cells = [0; 64];
        for index in 64..128 {
            cells[(sampler.numbers(13, 2, index).aim()[2] * 64.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
    }

    #[test]
    fn sobol_samples_of_a_pixel_are_even() {
        let sampler = Sampler::new(&SamplerDesc { kind: SamplerKind::Sobol, spp: None, seed: 9 });
        let mut cells = [0; 64];
        for index in 64..128 {
            let u = sampler.numbers(13, 2, index).light_point(3);
            cells[(u.x * 8.0) as usize * 8 + (u.y * 8.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
    }
}
