//! Owen-scrambled Sobol points: more even than independent random numbers.
//!
//! [`OwenSobol`] gives each pixel points of its own; [`ZOrderSobol`] distributes one set of points over all
//! pixels, so that the error of the image is like blue noise. Both are functions of (seed, pixel, sample index,
//! dimension), without a limit on the dimensions: a dimension is a label with its own shuffle.
//!
//! ```
//! use lumbre_math::random::PixelRandom;
//! use lumbre_math::sobol::OwenSobol;
//!
//! let sampler = OwenSobol::new(7);
//! let pixel = PixelRandom::new(7, 320, 200).key();
//! // Of any 16 samples 16k..16k+16, each cell of a 4×4 grid gets one.
//! let mut cells = [0; 16];
//! for index in 32..48 {
//!     let u = sampler.get_2d(pixel, index, 5);
//!     cells[(4.0 * u.y) as usize * 4 + (4.0 * u.x) as usize] += 1;
//! }
//! assert_eq!(cells, [1; 16]);
//! ```

use glam::Vec2;

use crate::random::{combine, mix};

/// The number of dimensions of the plain sequence.
pub const DIMENSIONS: usize = 10;

/// For each dimension but the first: degree and inner coefficients of a primitive polynomial modulo 2, and the first
/// direction integers. The first lines of the table "new-joe-kuo-6" of Joe, Kuo, "Constructing Sobol Sequences with
/// Better Two-Dimensional Projections", SIAM J. Sci. Comput. 30(5), 2008.
const JOE_KUO: [(usize, u32, [u32; 5]); DIMENSIONS - 1] = [
    (1, 0, [1, 0, 0, 0, 0]),
    (2, 1, [1, 3, 0, 0, 0]),
    (3, 1, [1, 3, 1, 0, 0]),
    (3, 2, [1, 1, 1, 0, 0]),
    (4, 1, [1, 1, 3, 3, 0]),
    (4, 4, [1, 3, 5, 13, 0]),
    (5, 2, [1, 1, 5, 5, 17]),
    (5, 4, [1, 1, 5, 5, 5]),
    (5, 7, [1, 1, 7, 11, 19]),
];

/// `DIRECTIONS[d][j]`: the contribution of bit `j` of the index to dimension `d`, the first binary place in the
/// top bit.
const DIRECTIONS: [[u32; 32]; DIMENSIONS] = {
    let mut table = [[0; 32]; DIMENSIONS];
    let mut j = 0;
    while j < 32 {
        table[0][j] = 1 << (31 - j);
        j += 1;
    }
    let mut d = 1;
    while d < DIMENSIONS {
        let (degree, coefficients, initial) = JOE_KUO[d - 1];
        let mut j = 0;
        while j < 32 {
            table[d][j] = if j < degree {
                initial[j] << (31 - j)
            } else {
                let mut v = table[d][j - degree] ^ (table[d][j - degree] >> degree);
                let mut k = 1;
                while k < degree {
                    if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                        v ^= table[d][j - k];
                    }
                    k += 1;
                }
                v
            };
            j += 1;
        }
        d += 1;
    }
    table
};

/// Dimension `dimension` of point `index` of the plain Sobol sequence, as 32 binary places.
///
/// # Panics
/// When `dimension` is not below [`DIMENSIONS`].
pub fn sobol(index: u32, dimension: usize) -> u32 {
    let directions = &DIRECTIONS[dimension];
    let mut bits = 0;
    let mut rest = index;
    while rest != 0 {
        bits ^= directions[rest.trailing_zeros() as usize];
        rest &= rest - 1;
    }
    bits
}

/// The first two dimensions of the plain Sobol sequence for an index of 64 bits, as 64 binary places.
///
/// The first is the radical inverse. The matrix of the second is Pascal's triangle modulo 2, a tensor power of
/// `[[1, 1], [0, 1]]`, so one exclusive-or for each factor replaces the loop over the bits.
#[inline]
pub const fn sobol_2d(index: u64) -> (u64, u64) {
    let x = index.reverse_bits();
    let y = x ^ ((x & 0x5555_5555_5555_5555) << 1);
    let y = y ^ ((y & 0x3333_3333_3333_3333) << 2);
    let y = y ^ ((y & 0x0f0f_0f0f_0f0f_0f0f) << 4);
    let y = y ^ ((y & 0x00ff_00ff_00ff_00ff) << 8);
    let y = y ^ ((y & 0x0000_ffff_0000_ffff) << 16);
    (x, y ^ (y << 32))
}

/// Owen's nested uniform scramble of 32 binary places: each place is flipped or not by a hash of the places before it.
///
/// A hash in which bits depend on lower bits only, on the reversed word: Laine, Karras, "Stratified Sampling for
/// Stochastic Transparency", EGSR 2011; Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; with the
/// constants of Vegdahl, "Building a Better LK Hash", 2021, which flip more evenly.
#[inline]
pub const fn owen_scramble(bits: u32, seed: u32) -> u32 {
    reversed_scramble(bits.reverse_bits(), seed).reverse_bits()
}

/// [`owen_scramble`] of binary places in reversed order, to reversed order.
#[inline]
const fn reversed_scramble(x: u32, seed: u32) -> u32 {
    let x = x ^ x.wrapping_mul(0x3d20_adea);
    let x = x.wrapping_add(seed);
    let x = x.wrapping_mul((seed >> 16) | 1);
    let x = x ^ x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// The number in `[0, 1)` with these binary places, truncated after the 24th.
#[inline]
fn fraction(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1_u32 << 24) as f32)
}

/// Sobol points, Owen-scrambled and shuffled independently for each pixel and dimension.
///
/// For a given pixel and dimension, the 2ᵐ samples of every aligned block of indices are a (0, m, 2)-net: each
/// of the boxes of area 2⁻ᵐ with sides of powers of two contains exactly one. Different dimensions are
/// independent ("padding", by shuffled indices, as in Burley, JCGT 2020), except those of one call of
/// [`OwenSobol::get`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OwenSobol {
    seed: u64,
}

impl OwenSobol {
    /// The points for a seed.
    pub const fn new(seed: u64) -> Self {
        Self { seed: combine(seed, 0x50b0_1000) }
    }

    /// A number in `[0, 1)`, for the pixel with this hash.
    #[inline]
    pub fn get_1d(&self, pixel: u64, index: u32, dimension: u32) -> f32 {
        fraction(self.bits_1d(pixel, index, dimension))
    }

    /// A point of the unit square, for the pixel with this hash. It takes one dimension label, not two.
    #[inline]
    pub fn get_2d(&self, pixel: u64, index: u32, dimension: u32) -> Vec2 {
        Vec2::from_array(self.bits_2d(pixel, index, dimension).map(fraction))
    }

    /// The 32 binary places of [`OwenSobol::get_1d`].
    #[inline]
    pub const fn bits_1d(&self, pixel: u64, index: u32, dimension: u32) -> u32 {
        let key = self.key(pixel, dimension);
        // The radical inverse of the shuffled index is the shuffled index before its last reversal, which the
        // scramble would undo.
        let shuffled = owen_scramble(index, key as u32);
        reversed_scramble(shuffled, (key >> 32) as u32).reverse_bits()
    }

    /// The 32 binary places of [`OwenSobol::get_2d`].
    #[inline]
    pub const fn bits_2d(&self, pixel: u64, index: u32, dimension: u32) -> [u32; 2] {
        let key = self.key(pixel, dimension);
        let scrambles = mix(key ^ 0x2d2d_2d2d);
        let shuffled = owen_scramble(index, key as u32);
        // The upper half of the second dimension, see `sobol_2d`, in reversed order as the scramble takes it.
        let y = shuffled ^ ((shuffled & 0xaaaa_aaaa) >> 1);
        let y = y ^ ((y & 0xcccc_cccc) >> 2);
        let y = y ^ ((y & 0xf0f0_f0f0) >> 4);
        let y = y ^ ((y & 0xff00_ff00) >> 8);
        let y = y ^ (y >> 16);
        [
            reversed_scramble(shuffled, scrambles as u32).reverse_bits(),
            reversed_scramble(y, (scrambles >> 32) as u32).reverse_bits(),
        ]
    }

    /// A point of the unit cube of `N` ≤ [`DIMENSIONS`] dimensions, well distributed in all of them jointly. It
    /// takes one dimension label, not `N`.
    pub fn get<const N: usize>(&self, pixel: u64, index: u32, dimension: u32) -> [f32; N] {
        const { assert!(N <= DIMENSIONS) };
        let key = self.key(pixel, dimension);
        let shuffled = owen_scramble(index, key as u32);
        std::array::from_fn(|d| {
            let scramble = mix(key.wrapping_add(0x1000 + d as u64));
            fraction(owen_scramble(sobol(shuffled, d), scramble as u32))
        })
    }

    #[inline]
    const fn key(&self, pixel: u64, dimension: u32) -> u64 {
        combine(self.seed ^ pixel, dimension as u64)
    }
}

/// One Sobol sequence distributed over all pixels along a shuffled z-order curve, so that the samples of
/// neighbouring pixels complement each other and the error of the image is mostly of high frequency.
///
/// Within a pixel it is as even as [`OwenSobol`], and so it is within each aligned block of 2ᵏ×2ᵏ pixels. The
/// number of samples per pixel must be known in advance: beyond it, an independent sequence starts. Source:
/// Ahmed, Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of
/// Pixels", ACM TOG 39(6) (SIGGRAPH Asia), 2020.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ZOrderSobol {
    seed: u64,
    // log2_side ≤ 20 and log2_samples ≤ 24, so that a sample's index in the image has at most 64 bits.
    log2_side: u32,
    log2_samples: u32,
}

impl ZOrderSobol {
    /// The points for a seed and an image of `width` × `height` pixels. The number of samples per pixel is
    /// rounded up to a power of two.
    pub fn new(seed: u64, width: u32, height: u32, samples_per_pixel: u32) -> Self {
        let log2_ceil = |n: u32| 32 - n.saturating_sub(1).leading_zeros();
        Self {
            seed: combine(seed, 0x2050_b010),
            log2_side: log2_ceil(width.max(height)).min(20),
            log2_samples: log2_ceil(samples_per_pixel).min(24),
        }
    }

    /// A number in `[0, 1)` for a sample of the pixel in column `x` and row `y`.
    pub fn get_1d(&self, x: u32, y: u32, index: u32, dimension: u32) -> f32 {
        self.get_2d(x, y, index, dimension).x
    }

    /// A point of the unit square for a sample of the pixel in column `x` and row `y`. It takes one dimension label.
    pub fn get_2d(&self, x: u32, y: u32, index: u32, dimension: u32) -> Vec2 {
        let side = (1_u64 << self.log2_side) - 1;
        let samples = (1_u64 << self.log2_samples) - 1;
        // Samples and pixels beyond the curve's capacity select another sequence.
        let beyond = (u64::from(index) >> self.log2_samples) << 40
            ^ (u64::from(x) >> self.log2_side) << 20
            ^ (u64::from(y) >> self.log2_side);
        let key = combine(combine(self.seed, beyond), u64::from(dimension));
        let z = spread_bits(u64::from(x) & side) | spread_bits(u64::from(y) & side) << 1;
        let ordered = z << self.log2_samples | (u64::from(index) & samples);
        let (a, b) = sobol_2d(self.shuffle(ordered, key));
        let scrambles = mix(key ^ 0x2d2d_2d2d);
        Vec2::new(
            fraction(owen_scramble((a >> 32) as u32, scrambles as u32)),
            fraction(owen_scramble((b >> 32) as u32, (scrambles >> 32) as u32)),
        )
    }

    /// Permutes each base-4 digit, and a single last bit, by a hash of the digits above it.
    fn shuffle(&self, ordered: u64, key: u64) -> u64 {
        let digits = self.log2_side + self.log2_samples / 2;
        let odd = self.log2_samples % 2;
        // The key of a node of the digit tree: the digits above it, preceded by a 1 that marks their number.
        let hash = |node: u64| mix(key.wrapping_add(node.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        let mut shuffled = 0;
        for digit in (0..digits).rev() {
            let shift = 2 * digit + odd;
            let value = (ordered >> shift) & 3;
            // In two steps, since the topmost digit may be at bit 62.
            let above = (ordered >> shift) >> 2;
            let bits = hash(1 << (2 * (digits - 1 - digit)) | above);
            let permutation = PERMUTATIONS[(((bits >> 32) * 24) >> 32) as usize];
            shuffled |= u64::from(permutation[value as usize]) << shift;
        }
        if odd == 1 {
            let bits = hash(1 << (2 * digits) | ordered >> 1);
            shuffled |= (ordered ^ (bits >> 63)) & 1;
        }
        shuffled
    }
}

/// The permutations of four elements.
const PERMUTATIONS: [[u8; 4]; 24] = {
    let mut table = [[0; 4]; 24];
    let mut row = 0;
    while row < 24 {
        // Factorial digits of the row: insert each element at its place among those before it.
        let places = [0, row % 2, (row / 2) % 3, row / 6];
        let mut things = 0;
        while things < 4 {
            let mut at = things;
            while at > places[things] {
                table[row][at] = table[row][at - 1];
                at -= 1;
            }
            table[row][at] = things as u8;
            things += 1;
        }
        row += 1;
    }
    table
};

/// Moves bit `i` of the low 32 bits to bit `2i`.
const fn spread_bits(x: u64) -> u64 {
    let x = (x | x << 16) & 0x0000_ffff_0000_ffff;
    let x = (x | x << 8) & 0x00ff_00ff_00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333_3333_3333;
    (x | x << 1) & 0x5555_5555_5555_5555
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    #[test]
    fn the_points_are_those_of_an_independent_implementation() {
        // Points 1024, 1500 and 2000 in Gray-code order, from another program with the same table.
        let expected: [(u32, [u32; DIMENSIONS]); 3] = [
            (
                1024,
                [
                    6291456, 1616904192, 1923088384, 2090860544, 2392850432, 3625975808, 1038090240,
                    2522873856, 2992635904, 2883584000,
                ],
            ),
            (
                1500,
                [
                    1289748480, 1692401664, 1847590912, 3894411264, 2954887168, 2493513728, 2405433344,
                    216006656, 920649728, 3563061248,
                ],
            ),
            (
                2000,
                [
                    471859200, 346030080, 3395289088, 2246049792, 895483904, 1952448512, 35651584,
                    4095737856, 1176502272, 3458203648,
                ],
            ),
        ];
        for (number, point) in expected {
            let gray = number ^ number >> 1;
            assert_eq!(std::array::from_fn(|d| sobol(gray, d)), point);
        }
    }

    #[test]
    fn the_short_cut_for_two_dimensions_equals_the_table() {
        let mut random = RandomStream::new(1);
        for _ in 0..10_000 {
            let index = random.next_u64() as u32;
            let (x, y) = sobol_2d(u64::from(index));
            assert_eq!(((x >> 32) as u32, (y >> 32) as u32), (sobol(index, 0), sobol(index, 1)));
        }
        // Past 32 bits the index still moves the places that are left.
        assert_eq!(sobol_2d(1 << 32).1 >> 63, 1);
    }

    /// Whether each elementary box of area 2⁻ᵐ holds exactly one of the 2ᵐ points.
    fn is_net(points: &[[u32; 2]]) -> bool {
        let m = points.len().trailing_zeros();
        assert_eq!(points.len(), 1 << m);
        (0..=m).all(|a| {
            let mut count = vec![0; points.len()];
            for &[x, y] in points {
                let column = (u64::from(x) >> (32 - a)) as usize;
                let row = (u64::from(y) >> (32 - (m - a))) as usize;
                count[row << a | column] += 1;
            }
            count.iter().all(|&c| c == 1)
        })
    }

    #[test]
    fn every_aligned_block_is_a_net_before_and_after_scrambling() {
        let sampler = OwenSobol::new(77);
        let mut blocks = 0;
        for m in 1..=10 {
            for block in [0_u32, 1, 2, 3, 1000] {
                let indices = (block << m)..((block + 1) << m);
                let plain: Vec<_> = indices.clone().map(|i| [sobol(i, 0), sobol(i, 1)]).collect();
                assert!(is_net(&plain), "plain, m = {m}, block {block}");
                for (pixel, dimension) in [(5, 0), (5, 1), (6, 1), (u64::MAX, 4_000_000_000)] {
                    let points: Vec<_> =
                        indices.clone().map(|i| sampler.bits_2d(pixel, i, dimension)).collect();
                    assert!(is_net(&points), "m = {m}, block {block}, pixel {pixel}, dimension {dimension}");
                    let lines = indices.clone().map(|i| sampler.bits_1d(pixel, i, dimension));
                    let mut cells: Vec<_> = lines.map(|x| x >> (32 - m)).collect();
                    cells.sort_unstable();
                    assert!(cells.into_iter().eq(0..1 << m));
                    blocks += 1;
                }
            }
        }
        assert_eq!(blocks, 200);
        assert!(!is_net(&[[0, 0], [1, 1]]), "the check itself can fail");
    }

    #[test]
    fn the_last_indices_are_as_even_as_the_first() {
        let sampler = OwenSobol::new(2);
        let points: Vec<_> = (u32::MAX - 255..=u32::MAX).map(|i| sampler.bits_2d(9, i, 3)).collect();
        assert!(is_net(&points));
    }

    #[test]
    fn fewer_reversals_give_the_same_points() {
        let sampler = OwenSobol::new(8);
        let mut random = RandomStream::new(5);
        for _ in 0..2_000 {
            let (pixel, index, dimension) =
                (random.next_u64(), random.next_u64() as u32, random.next_u64() as u32);
            let key = sampler.key(pixel, dimension);
            let shuffled = owen_scramble(index, key as u32);
            let plain = owen_scramble(sobol(shuffled, 0), (key >> 32) as u32);
            assert_eq!(sampler.bits_1d(pixel, index, dimension), plain);
            let scrambles = mix(key ^ 0x2d2d_2d2d);
            let plain = [
                owen_scramble(sobol(shuffled, 0), scrambles as u32),
                owen_scramble(sobol(shuffled, 1), (scrambles >> 32) as u32),
            ];
            assert_eq!(sampler.bits_2d(pixel, index, dimension), plain);
        }
    }

    #[test]
    fn dimensions_are_stratified_and_the_first_two_a_net() {
        let sampler = OwenSobol::new(3);
        for dimension in [0, 7] {
            let points: Vec<[f32; DIMENSIONS]> =
                (512..1024).map(|i| sampler.get(123, i, dimension)).collect();
            for d in 0..DIMENSIONS {
                let mut cells: Vec<_> = points.iter().map(|p| (p[d] * 512.0) as u32).collect();
                cells.sort_unstable();
                assert!(cells.into_iter().eq(0..512), "dimension {d}");
            }
            let bits: Vec<_> =
                points.iter().map(|p| [0, 1].map(|d| (p[d] * 16_777_216.0) as u32 * 256)).collect();
            assert!(is_net(&bits));
        }
    }

    #[test]
    fn scrambling_keeps_common_prefixes_and_is_bijective() {
        let mut random = RandomStream::new(8);
        for _ in 0..2_000 {
            let (a, b, seed) = (random.next_u64() as u32, random.next_u64() as u32, random.next_u64() as u32);
            let b = if random.next_u64() & 1 == 0 { b } else { a ^ (b >> (b % 31)) };
            let shared = (a ^ b).leading_zeros();
            assert_eq!((owen_scramble(a, seed) ^ owen_scramble(b, seed)).leading_zeros(), shared);
        }
    }

    #[test]
    fn over_all_pixels_each_sample_is_uniform() {
        let sampler = OwenSobol::new(31);
        for (index, dimension) in [(0, 0), (0, 1), (1, 0), (5, 2)] {
            let mut counts = [0_u32; 256];
            for pixel in 0..256_000 {
                let u = sampler.get_2d(mix(pixel), index, dimension);
                assert!(u.x < 1.0 && u.y < 1.0);
                counts[(u.y * 16.0) as usize * 16 + (u.x * 16.0) as usize] += 1;
            }
            let chi: f64 = counts.iter().map(|&c| (f64::from(c) - 1000.0).powi(2) / 1000.0).sum();
            assert!((chi - 255.0).abs() < 5.0 * 510_f64.sqrt(), "index {index}: {chi}");
        }
    }

    #[test]
    fn different_dimensions_of_one_sample_are_independent() {
        let sampler = OwenSobol::new(12);
        for (a, b) in [(0, 1), (1, 2), (3, 300)] {
            let mut counts = [0_u32; 256];
            for index in 0..65_536 {
                // Many pixels, so that what one pair of shuffles happens to share averages out.
                let pixel = mix(u64::from(index / 64));
                let (u, v) = (sampler.get_1d(pixel, index % 64, a), sampler.get_2d(pixel, index % 64, b).y);
                counts[(u * 16.0) as usize * 16 + (v * 16.0) as usize] += 1;
            }
            let chi: f64 = counts.iter().map(|&c| (f64::from(c) - 256.0).powi(2) / 256.0).sum();
            // At most: both margins are stratified, which lowers χ².
            assert!(chi < 255.0 + 5.0 * 510_f64.sqrt(), "{a}, {b}: {chi}");
        }
    }

    #[test]
    fn integrals_converge_far_faster_than_by_chance() {
        let sampler = OwenSobol::new(5);
        let smooth = |u: Vec2| f64::from(u.x) * f64::from(u.x) * f64::from(u.y).exp();
        let truth = (1.0_f64.exp() - 1.0) / 3.0;
        let (count, runs) = (1024, 64);
        let mean_square = (0..runs)
            .map(|pixel| {
                let sum: f64 = (0..count).map(|i| smooth(sampler.get_2d(mix(pixel), i, 4))).sum();
                (sum / f64::from(count) - truth).powi(2)
            })
            .sum::<f64>()
            / runs as f64;
        // The variance of the integrand is about 0.31; by chance the mean square is 0.31/1024 = 3e-4.
        assert!(mean_square < 1e-7, "{mean_square}");
        assert!(mean_square > 1e-12, "the runs differ: {mean_square}");
    }

    #[test]
    fn the_permutations_of_four_are_all_there() {
        let mut all = PERMUTATIONS.to_vec();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 24);
        assert!(all.iter().all(|p| (0..4).all(|digit| p.contains(&digit))));
    }

    #[test]
    fn along_the_curve_pixels_and_blocks_of_pixels_are_nets() {
        for samples in [1_u32, 4, 8, 32] {
            let sampler = ZOrderSobol::new(6, 300, 200, samples);
            let bits = |u: Vec2| [(u.x * 16_777_216.0) as u32 * 256, (u.y * 16_777_216.0) as u32 * 256];
            for dimension in [0, 3] {
                let pixel: Vec<_> =
                    (0..samples).map(|i| bits(sampler.get_2d(130, 57, i, dimension))).collect();
                assert!(is_net(&pixel), "{samples}");
                let block: Vec<_> = (0..4 * 4 * samples)
                    .map(|k| bits(sampler.get_2d(64 + k % 4, 36 + k / 4 % 4, k / 16, dimension)))
                    .collect();
                assert!(is_net(&block), "{samples}");
                // Past the number planned: another net, not the same one again.
                let more: Vec<_> =
                    (samples..2 * samples).map(|i| bits(sampler.get_2d(130, 57, i, dimension))).collect();
                assert!(is_net(&more) && more != pixel);
            }
        }
    }

    #[test]
    fn along_the_curve_the_error_of_blocks_is_far_below_white_noise() {
        let (side, samples) = (64, 4);
        let curve = ZOrderSobol::new(9, side, side, samples);
        let own = OwenSobol::new(9);
        // The mean over 4×4 pixels of the error of each, squared, averaged over all blocks.
        let low_frequency = |value: &dyn Fn(u32, u32, u32) -> Vec2| {
            let smooth = |u: Vec2| f64::from(u.x * u.y + u.y * u.y * u.y) - 0.5;
            let mut total = 0.0;
            for block in 0..(side / 4) * (side / 4) {
                let (bx, by) = (block % (side / 4) * 4, block / (side / 4) * 4);
                let sum: f64 =
                    (0..16 * samples).map(|k| smooth(value(bx + k % 4, by + k / 4 % 4, k / 16))).sum();
                total += (sum / f64::from(16 * samples)).powi(2);
            }
            total
        };
        let blue = low_frequency(&|x, y, i| curve.get_2d(x, y, i, 2));
        let white =
            low_frequency(&|x, y, i| own.get_2d(crate::random::PixelRandom::new(9, x, y).key(), i, 2));
        assert!(blue > 0.0 && blue < 0.05 * white, "{blue} against {white}");
    }

    #[test]
    fn the_curve_takes_pictures_of_any_size() {
        for (width, height, samples) in [(0, 0, 0), (1, 1, 1), (u32::MAX, 3, u32::MAX)] {
            let sampler = ZOrderSobol::new(1, width, height, samples);
            for corner in [0, 1, 12_345, u32::MAX] {
                let u = sampler.get_2d(corner, corner, corner, corner);
                assert!((0.0..1.0).contains(&u.x) && (0.0..1.0).contains(&u.y));
            }
        }
    }
}
