//! Counter-based random numbers: pure functions of (seed, pixel, sample index, dimension).
//!
//! There is no sequence, so a number does not depend on the thread, the order of the tiles, or whether the
//! rendering was interrupted.
//!
//! ```
//! use lumbre_math::random::PixelRandom;
//!
//! let sample = PixelRandom::new(7, 320, 200).sample(41);
//! let (u, v) = (sample.f32(2), sample.f32(3));
//! assert!((0.0..1.0).contains(&u) && u != v);
//! assert_eq!(u, PixelRandom::new(7, 320, 200).sample(41).f32(2));
//! ```

use glam::{DVec3, Vec3};

/// 2⁶⁴ divided by the golden ratio, made odd: the step between consecutive keys.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A bijection of the 64-bit words in which every bit of the result depends on every bit of `x`.
///
/// The finaliser "Mix13" of Stafford, "Better Bit Mixing: Improving on MurmurHash3's 64-bit Finalizer", 2011,
/// as used in Steele, Lea, Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014. It maps 0 to
/// 0.
#[inline]
pub const fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Hashes two words, in order; builds a key from parts.
#[inline]
pub const fn combine(key: u64, word: u64) -> u64 {
    mix(mix(key.wrapping_add(GOLDEN)).wrapping_add(word.wrapping_mul(GOLDEN)).wrapping_add(1))
}

/// Hashes words: the result depends on all of them, their order and their number.
pub fn hash_words(words: &[u64]) -> u64 {
    words.iter().fold(mix(words.len() as u64), |key, &word| combine(key, word))
}

/// Hashes the bit patterns of numbers, with `-0.0` as `0.0`, since they compare equal.
pub fn hash_f64s(numbers: &[f64]) -> u64 {
    // Adding +0.0 turns -0.0 into 0.0 and changes no other number.
    numbers.iter().fold(mix(numbers.len() as u64), |key, &number| combine(key, (number + 0.0).to_bits()))
}

/// Hashes the bit patterns of numbers, with `-0.0` as `0.0`.
pub fn hash_f32s(numbers: &[f32]) -> u64 {
    let key = mix(!(numbers.len() as u64));
    numbers.iter().fold(key, |key, &number| combine(key, u64::from((number + 0.0).to_bits())))
}

/// [`hash_f64s`] of the components: the key of a stochastic decision that must not vary between calls.
pub fn hash_dvec3(v: DVec3) -> u64 {
    hash_f64s(&v.to_array())
}

/// [`hash_f32s`] of the components.
pub fn hash_vec3(v: Vec3) -> u64 {
    hash_f32s(&v.to_array())
}

/// The multiple of 2⁻²⁴ in `[0, 1)` from the top bits of `word`. It never rounds up to 1.
#[inline]
pub fn uniform_f32(word: u64) -> f32 {
    (word >> 40) as f32 * (1.0 / (1_u32 << 24) as f32)
}

/// The multiple of 2⁻⁵³ in `[0, 1)` from the top bits of `word`. It never rounds up to 1.
#[inline]
pub fn uniform_f64(word: u64) -> f64 {
    (word >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// The random numbers of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRandom {
    key: u64,
}

impl PixelRandom {
    /// The random numbers of the pixel in column `x` and row `y`.
    #[inline]
    pub const fn new(seed: u64, x: u32, y: u32) -> Self {
        Self { key: combine(seed, x as u64 | (y as u64) << 32) }
    }

    /// The key of this pixel.
    #[inline]
    pub const fn key(self) -> u64 {
        self.key
    }

    /// The random numbers of one sample of this pixel.
    #[inline]
    pub const fn sample(self, index: u64) -> SampleRandom {
        SampleRandom { key: mix(self.key.wrapping_add(index.wrapping_mul(GOLDEN))) }
    }
}

/// The random numbers of one sample of a pixel, one for each dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleRandom {
    key: u64,
}

impl SampleRandom {
    /// The key of this sample.
    #[inline]
    pub const fn key(self) -> u64 {
        self.key
    }

    /// The 64 random bits of a dimension.
    #[inline]
    pub const fn bits(self, dimension: u32) -> u64 {
        mix(self.key.wrapping_add((dimension as u64 + 1).wrapping_mul(GOLDEN)))
    }

    /// The number of a dimension, uniform in `[0, 1)`.
    #[inline]
    pub fn f32(self, dimension: u32) -> f32 {
        uniform_f32(self.bits(dimension))
    }

    /// The number of a dimension, uniform in `[0, 1)`.
    #[inline]
    pub fn f64(self, dimension: u32) -> f64 {
        uniform_f64(self.bits(dimension))
    }
}

/// A sequence of random numbers from a key, for an unknown number of decisions (rejection, random walks).
/// Derive the key from the purpose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RandomStream {
    state: u64,
}

impl RandomStream {
    /// The sequence of `key`.
    #[inline]
    pub const fn new(key: u64) -> Self {
        // Mixed, since keys a multiple of the step apart would give shifted copies of one sequence.
        Self { state: combine(key, 0) }
    }

    /// The next 64 random bits.
    #[inline]
    pub fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mix(self.state)
    }

    /// The next number, uniform in `[0, 1)`.
    #[inline]
    pub fn next_f32(&mut self) -> f32 {
        uniform_f32(self.next_u64())
    }

    /// The next number, uniform in `[0, 1)`.
    #[inline]
    pub fn next_f64(&mut self) -> f64 {
        uniform_f64(self.next_u64())
    }

    /// The next integer, uniform in `0..count` up to a bias of `count`/2⁶⁴; 0 for a count of 0.
    #[inline]
    pub fn next_below(&mut self, count: usize) -> usize {
        ((u128::from(self.next_u64()) * count as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// χ² of the counts against equal expectations, less its mean, in units of its standard deviation.
    fn chi_square_sigmas(counts: &[u64]) -> f64 {
        let total: u64 = counts.iter().sum();
        let expected = total as f64 / counts.len() as f64;
        let chi: f64 = counts.iter().map(|&c| (c as f64 - expected).powi(2) / expected).sum();
        let freedom = counts.len() as f64 - 1.0;
        (chi - freedom) / (2.0 * freedom).sqrt()
    }

    fn joint_sigmas(pairs: impl Iterator<Item = (f32, f32)>) -> f64 {
        let mut counts = vec![0; 32 * 32];
        for (a, b) in pairs {
            counts[(a * 32.0) as usize * 32 + (b * 32.0) as usize] += 1;
        }
        assert!(counts.iter().sum::<u64>() >= 100_000);
        chi_square_sigmas(&counts)
    }

    #[test]
    fn each_single_argument_alone_makes_uniform_numbers() {
        type Number = fn(u32) -> f64;
        let make: [(&str, Number); 5] = [
            ("seed", |i| PixelRandom::new(u64::from(i), 3, 5).sample(2).f64(9)),
            ("x", |i| PixelRandom::new(11, i, 5).sample(2).f64(9)),
            ("y", |i| PixelRandom::new(11, 3, i).sample(2).f64(9)),
            ("sample", |i| PixelRandom::new(11, 3, 5).sample(u64::from(i)).f64(9)),
            ("dimension", |i| PixelRandom::new(11, 3, 5).sample(2).f64(i)),
        ];
        for (name, number) in make {
            let mut counts = vec![0; 1000];
            for i in 0..200_000 {
                counts[(number(i) * 1000.0) as usize] += 1;
            }
            let sigmas = chi_square_sigmas(&counts);
            assert!(sigmas.abs() < 4.0, "{name}: {sigmas}");
        }
    }

    #[test]
    fn the_numbers_of_neighbouring_keys_are_independent() {
        let keys = || (0..400).flat_map(|y| (0..300).map(move |x| (x, y)));
        let at = |x, y, sample, dimension| PixelRandom::new(5, x, y).sample(sample).f32(dimension);
        let sigmas = [
            joint_sigmas(keys().map(|(x, y)| (at(x, y, 0, 0), at(x + 1, y, 0, 0)))),
            joint_sigmas(keys().map(|(x, y)| (at(x, y, 0, 0), at(x, y + 1, 0, 0)))),
            joint_sigmas(keys().map(|(x, y)| (at(x, y, 0, 0), at(y, x, 0, 0))).filter(|(a, b)| a != b)),
            joint_sigmas(keys().map(|(x, y)| (at(x, y, 0, 0), at(x, y, 1, 0)))),
            joint_sigmas(keys().map(|(x, y)| (at(x, y, 0, 0), at(x, y, 0, 1)))),
            joint_sigmas(keys().map(|(x, y)| (at(x, y, 1, 0), at(x, y, 0, 1)))),
            joint_sigmas(keys().map(|(s, d)| (at(2, 3, s.into(), d), at(2, 3, s.into(), d + 1)))),
            joint_sigmas(keys().map(|(s, d)| (at(2, 3, s.into(), d), at(2, 3, u64::from(s) + 1, d)))),
        ];
        // (The third has each pair twice, in both orders; its χ² spreads √2 wider.)
        assert!(sigmas.iter().all(|s| s.abs() < 6.0), "{sigmas:?}");
    }

    #[test]
    fn one_flipped_bit_of_a_word_flips_half_of_the_bits() {
        for bit in 0..64 {
            let mut flipped = 0;
            for word in 0..2_000_u64 {
                flipped += (combine(3, word) ^ combine(3, word ^ 1 << bit)).count_ones();
                flipped += (combine(word, 3) ^ combine(word ^ 1 << bit, 3)).count_ones();
            }
            let share = f64::from(flipped) / (4_000.0 * 64.0);
            assert!((share - 0.5).abs() < 0.006, "bit {bit}: {share}");
        }
    }

    #[test]
    fn all_ones_stay_below_one_and_the_mean_is_a_half() {
        assert!(uniform_f32(u64::MAX) < 1.0 && uniform_f64(u64::MAX) < 1.0);
        assert_eq!((uniform_f32(0), uniform_f64(0)), (0.0, 0.0));
        let mut stream = RandomStream::new(99);
        let mean = (0..1_000_000).map(|_| stream.next_f64()).sum::<f64>() / 1e6;
        assert!((mean - 0.5).abs() < 5.0 * 0.29 / 1e3, "{mean}");
    }

    #[test]
    fn hashes_know_order_number_and_sign_but_not_the_sign_of_zero() {
        assert_ne!(hash_words(&[1, 2]), hash_words(&[2, 1]));
        assert_ne!(hash_words(&[0]), hash_words(&[0, 0]));
        assert_ne!(hash_words(&[]), hash_words(&[0]));
        assert_ne!(hash_f64s(&[1.5]), hash_f64s(&[-1.5]));
        assert_eq!(hash_f64s(&[0.0, 2.0]), hash_f64s(&[-0.0, 2.0]));
        assert_eq!(hash_vec3(Vec3::new(-0.0, 1.0, 2.0)), hash_vec3(Vec3::new(0.0, 1.0, 2.0)));
        assert_ne!(
            hash_dvec3(DVec3::new(1.0, 2.0, 3.0)),
            hash_dvec3(DVec3::new(1.0, 2.0, 3.0_f64.next_up()))
        );
    }

    #[test]
    fn a_stream_below_a_count_reaches_every_number_alike() {
        let mut stream = RandomStream::new(4);
        let mut counts = vec![0; 7];
        for _ in 0..70_000 {
            counts[stream.next_below(7)] += 1;
        }
        assert!(chi_square_sigmas(&counts).abs() < 4.0, "{counts:?}");
        assert_eq!(stream.next_below(0), 0);
    }

    #[test]
    fn the_numbers_never_change_from_release_to_release() {
        // Pictures are compared bit by bit; a change here changes every one of them.
        assert_eq!(mix(1), 0x5692_161d_100b_05e5);
        assert_eq!(combine(2, 3), 0x26ec98251dda6012);
        assert_eq!(PixelRandom::new(7, 320, 200).sample(41).bits(2), 0x847e5c6f78f4f97a);
    }
}
