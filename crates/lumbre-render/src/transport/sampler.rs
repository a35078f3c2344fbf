//! Random numbers as a pure function of (seed, pixel, sample index, what they are for).

use lumbre_math::DVec2;
use lumbre_math::Vec2;
use lumbre_math::random::{PixelRandom, SampleRandom, combine, mix, uniform_f64};
use lumbre_math::sobol::OwenSobol;
use lumbre_scene::{SamplerDesc, SamplerKind};

/// The closed set of samplers.
#[derive(Clone, Copy, Debug)]
pub enum Sampler {
    /// Owen-scrambled Sobol points: even over the samples of a pixel.
    Sobol {
        /// The points.
        points: OwenSobol,
        /// The seed, for the hash of a pixel.
        seed: u64,
    },
    /// Independent uniform numbers.
    Independent {
        /// The seed.
        seed: u64,
    },
}

/// What belongs to a whole path, each a label of its own.
const FILTER: u32 = 0;
const LENS: u32 = 1;
/// The labels of path vertex k start at `FIRST_VERTEX + k * LABELS`.
const FIRST_VERTEX: u32 = 2;
const LABELS: u32 = 5;
const LIGHT_CHOICE: u32 = 0;
const LIGHT_POINT: u32 = 1;
const LOBE: u32 = 2;
const DIRECTION: u32 = 3;
const SURVIVAL: u32 = 4;
/// Labels of integrators that ask every light of a vertex for a point.
const EVERY_LIGHT: u32 = 1 << 24;
/// Labels of distance samples in media.
const EVERY_DISTANCE_SAMPLE: u32 = 1 << 27;
/// When a ray looks. Away from the others, so that these are what they are without it.
const TIME: u32 = 1 << 30;
/// Labels of integrators that follow several rays from a vertex.
const EVERY_BRANCH: u32 = 1 << 28;

impl Sampler {
    /// The sampler that a description asks for.
    pub fn new(desc: &SamplerDesc) -> Self {
        match desc.kind {
            SamplerKind::Sobol => Self::Sobol { points: OwenSobol::new(desc.seed), seed: desc.seed },
            SamplerKind::Independent => Self::Independent { seed: desc.seed },
        }
    }

    /// The numbers of one sample of the pixel in column `x` and row `y`.
    #[inline]
    pub fn draw(&self, x: u32, y: u32, index: u32) -> Draw {
        match *self {
            Self::Sobol { points, seed } => {
                Draw::Sobol { points, pixel: PixelRandom::new(seed, x, y).key(), index }
            }
            Self::Independent { seed } => {
                Draw::Independent(PixelRandom::new(seed, x, y).sample(u64::from(index)))
            }
        }
    }
}

/// The random numbers of one sample. Asking one of them changes none of the others.
#[derive(Clone, Copy, Debug)]
pub enum Draw {
    /// Of [`Sampler::Sobol`].
    Sobol {
        /// The points.
        points: OwenSobol,
        /// The hash of the pixel.
        pixel: u64,
        /// The sample.
        index: u32,
    },
    /// Of [`Sampler::Independent`].
    Independent(SampleRandom),
}

impl Draw {
    /// Where in the pixel filter.
    pub fn filter(&self) -> DVec2 {
        self.two(FILTER)
    }

    /// Where on the lens.
    pub fn lens(&self) -> DVec2 {
        self.two(LENS)
    }

    /// Which part of the exposure is over when the ray looks: even over the samples of a pixel.
    pub fn time(&self) -> f64 {
        self.one(TIME)
    }

    /// Which light, at a vertex.
    pub fn light_choice(&self, vertex: u32) -> f64 {
        self.one(label(vertex, LIGHT_CHOICE))
    }

    /// Where on the light.
    pub fn light_point(&self, vertex: u32) -> DVec2 {
        self.two(label(vertex, LIGHT_POINT))
    }

    /// Where on the light of this number, for integrators that ask all of them for some `points` each.
    pub fn point_on_each_light(&self, vertex: u32, light: u32, point: u32, points: u32) -> DVec2 {
        let label = EVERY_LIGHT.wrapping_add(vertex.wrapping_mul(1 << 12)).wrapping_add(light);
        match *self {
            // The points of all samples of the pixel are one even set.
            Self::Sobol { points: sobol, pixel, index } => {
                let index = index.wrapping_mul(points).wrapping_add(point);
                Self::Sobol { points: sobol, pixel, index }.two(label)
            }
            Self::Independent(_) if point == 0 => self.two(label),
            Self::Independent(random) => {
                let key = combine(random.bits(label), u64::from(point));
                DVec2::new(uniform_f64(key), uniform_f64(mix(key)))
            }
        }
    }

    /// Whether a branch of a tree of rays goes on.
    pub fn branch(&self, vertex: u32, branch: u32) -> f32 {
        single(self.one(EVERY_BRANCH.wrapping_add(vertex.wrapping_mul(1 << 12)).wrapping_add(branch)))
    }

    /// Which part of a BSDF.
    pub fn lobe(&self, vertex: u32) -> f32 {
        single(self.one(label(vertex, LOBE)))
    }

    /// Which direction of that part.
    pub fn direction(&self, vertex: u32) -> Vec2 {
        let u = self.two(label(vertex, DIRECTION));
        Vec2::new(single(u.x), single(u.y))
    }

    /// Whether the path goes on.
    pub fn survival(&self, vertex: u32) -> f32 {
        single(self.one(label(vertex, SURVIVAL)))
    }

    /// A distance sample in a medium: which channel of the spectrum, and how far.
    pub fn distance(&self, sample: u32) -> [f64; 2] {
        [self.one(inside(sample, 0)), self.one(inside(sample, 1))]
    }

    /// The direction after the collision of a distance sample.
    pub fn scattered(&self, sample: u32) -> Vec2 {
        let u = self.two(inside(sample, 2));
        Vec2::new(single(u.x), single(u.y))
    }

    /// Whether the path goes on after that collision.
    pub fn survives_collision(&self, sample: u32) -> f32 {
        single(self.one(inside(sample, 3)))
    }

    #[inline]
    fn one(&self, label: u32) -> f64 {
        match self {
            Self::Sobol { points, pixel, index } => fraction(points.bits_1d(*pixel, *index, label)),
            // Two labels each, so that pairs do not share a number.
            Self::Independent(random) => random.f64(label.wrapping_mul(2)),
        }
    }

    #[inline]
    fn two(&self, label: u32) -> DVec2 {
        match self {
            Self::Sobol { points, pixel, index } => {
                DVec2::from_array(points.bits_2d(*pixel, *index, label).map(fraction))
            }
            Self::Independent(random) => {
                let first = label.wrapping_mul(2);
                DVec2::new(random.f64(first), random.f64(first.wrapping_add(1)))
            }
        }
    }
}

fn inside(sample: u32, what: u32) -> u32 {
    EVERY_DISTANCE_SAMPLE.wrapping_add(sample.wrapping_mul(4)).wrapping_add(what)
}

fn label(vertex: u32, what: u32) -> u32 {
    FIRST_VERTEX.wrapping_add(vertex.wrapping_mul(LABELS)).wrapping_add(what)
}

#[inline]
fn fraction(bits: u32) -> f64 {
    f64::from(bits) * (1.0 / 4_294_967_296.0)
}

/// Cut to 24 places, so that it stays below 1.
#[inline]
fn single(u: f64) -> f32 {
    (u * 16_777_216.0) as u32 as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_depend_on_every_argument_and_stay_in_range() {
        for kind in [SamplerKind::Sobol, SamplerKind::Independent] {
            let sampler = |seed| Sampler::new(&SamplerDesc { kind, spp: None, seed });
            let base = sampler(3).draw(5, 7, 11);
            let others = [
                sampler(4).draw(5, 7, 11),
                sampler(3).draw(6, 7, 11),
                sampler(3).draw(5, 8, 11),
                sampler(3).draw(5, 7, 12),
            ];
            for other in others {
                assert_ne!(base.filter(), other.filter());
                assert_ne!(base.light_choice(2), other.light_choice(2));
            }
            assert_ne!(base.direction(2), base.direction(3));
            assert_ne!(base.light_point(2), base.lens());
            assert_eq!(base.direction(2), sampler(3).draw(5, 7, 11).direction(2));
            for index in 0..4096 {
                let draw = sampler(3).draw(5, 7, index);
                assert!((0.0..1.0).contains(&draw.lobe(1)) && (0.0..1.0).contains(&draw.survival(1)));
                assert!(draw.light_point(1).max_element() < 1.0);
            }
        }
    }

    #[test]
    fn points_on_a_light_are_even_over_all_samples_of_a_pixel() {
        let sampler = Sampler::new(&SamplerDesc { kind: SamplerKind::Sobol, spp: None, seed: 9 });
        let mut cells = [0; 64];
        for (index, point) in (0..16).flat_map(|index| (0..4).map(move |point| (index, point))) {
            let u = sampler.draw(13, 2, index).point_on_each_light(3, 5, point, 4);
            cells[(u.x * 8.0) as usize * 8 + (u.y * 8.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
    }

    #[test]
    fn independent_points_on_a_light_are_all_different() {
        let draw =
            Sampler::new(&SamplerDesc { kind: SamplerKind::Independent, spp: None, seed: 9 }).draw(13, 2, 4);
        let mut seen = Vec::new();
        for (light, point) in (0..3).flat_map(|light| (0..100).map(move |point| (light, point))) {
            let u = draw.point_on_each_light(2, light, point, 100);
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
            cells[(sampler.draw(13, 2, index).time() * 64.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
    }

    #[test]
    fn sobol_samples_of_a_pixel_are_even() {
        let sampler = Sampler::new(&SamplerDesc { kind: SamplerKind::Sobol, spp: None, seed: 9 });
        let mut cells = [0; 64];
        for index in 64..128 {
            let u = sampler.draw(13, 2, index).light_point(3);
            cells[(u.x * 8.0) as usize * 8 + (u.y * 8.0) as usize] += 1;
        }
        assert_eq!(cells, [1; 64]);
    }
}
