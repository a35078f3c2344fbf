//! POV-Ray's noise: three generators, turbulence, and the tables that they are made of, all generated.
//!
//! Values equal those of POV-Ray 3.7 to 5e-11.

use std::sync::LazyLock;

use lumbre_math::DVec3;

/// Which noise a pattern is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NoiseGenerator {
    /// That of versions before 3.5.
    Original,
    /// The same with its range corrected: the default.
    #[default]
    Corrected,
    /// Perlin's gradient noise.
    Perlin,
}

/// The multiplier and the increment of the linear congruential generator that makes the tables.
const MULTIPLIER: i32 = 1_812_433_253;
const INCREMENT: i32 = 12_345;

fn step(state: &mut i32) -> i32 {
    *state = state.wrapping_mul(MULTIPLIER).wrapping_add(INCREMENT);
    *state
}

fn draw(state: &mut i32) -> i32 {
    (step(state) >> 16) & 0x7FFF
}

struct Tables {
    /// All whole numbers below 4096 in another order, twice.
    hash: Box<[u16; 8192]>,
    lattice: Box<[f64; LATTICE]>,
    random: Vec<f64>,
    permutation: Vec<u16>,
    gradients: Vec<DVec3>,
    wave_frequencies: Vec<f64>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

impl Tables {
    fn new() -> Self {
        let (permutation, gradients) = perlin_tables();
        let mut state = -560_851_967_i32;
        let mut wave_frequencies = Vec::with_capacity(MAX_WAVES);
        for _ in 0..MAX_WAVES {
            wave_frequencies.push(f64::from(draw(&mut state)) * 0.000_030_518_509_476 + 0.01);
        }
        Self {
            hash: hash_table(),
            lattice: lattice_table(),
            random: mersenne_twister(32_768),
            permutation,
            gradients,
            wave_frequencies,
        }
    }
}

/// Waves come from at most this many sources.
const MAX_WAVES: usize = 256;

/// The numbers of 267 places of the lattice, each with half of it.
const LATTICE: usize = 534;

fn hash_table() -> Box<[u16; 8192]> {
    let mut hash: Vec<u16> = (0..4096).collect();
    let mut state = 0_i32;
    for i in (0..4096).rev() {
        let j = draw(&mut state) as usize % 4096;
        hash.swap(i, j);
    }
    Box::new(std::array::from_fn(|i| hash[i & 4095]))
}

/// The CRC-16 with the reflected polynomial 0xA001.
fn crc16(bytes: impl Iterator<Item = u8>) -> u16 {
    bytes.fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xA001 } else { crc >> 1 })
    })
}

fn lattice_table() -> Box<[f64; LATTICE]> {
    let mut lattice = Box::new([0.0; LATTICE]);
    for (i, pair) in lattice.chunks_exact_mut(2).enumerate() {
        let place = (i as f64 * 0.12345).to_be_bytes();
        let n = f64::from(crc16(place.iter().chain(&place).chain(&place).copied()));
        let value = six_digits(n * 2.0 / 65_535.0 - 1.0);
        pair.copy_from_slice(&[value, 0.5 * value]);
    }
    lattice
}

/// A number rounded to six significant decimal digits.
fn six_digits(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

/// Numbers in [0, 1) of MT19937 with its default seed (M. Matsumoto and T. Nishimura, "Mersenne Twister", ACM TOMACS,
/// 1998).
fn mersenne_twister(count: usize) -> Vec<f64> {
    const N: usize = 624;
    let mut state = [0_u32; N];
    state[0] = 5489;
    for i in 1..N {
        state[i] = (state[i - 1] ^ (state[i - 1] >> 30)).wrapping_mul(1_812_433_253).wrapping_add(i as u32);
    }
    let mut numbers = Vec::with_capacity(count);
    while numbers.len() < count {
        for i in 0..N {
            let y = (state[i] & 0x8000_0000) | (state[(i + 1) % N] & 0x7FFF_FFFF);
            let twist = if y & 1 == 1 { 0x9908_B0DF } else { 0 };
            state[i] = state[(i + 397) % N] ^ (y >> 1) ^ twist;
        }
        numbers.extend(state.iter().map(|&word| {
            let mut y = word;
            y ^= y >> 11;
            y ^= (y << 7) & 0x9D2C_5680;
            y ^= (y << 15) & 0xEFC6_0000;
            y ^= y >> 18;
            f64::from(y) / 4_294_967_296.0
        }));
    }
    numbers.truncate(count);
    numbers
}

const GRADIENTS: usize = 2048;
/// What coordinates are shifted by before they are looked up in the lattice of gradients.
const SHIFT: f64 = 10_000_000.023_157_213;

fn perlin_tables() -> (Vec<u16>, Vec<DVec3>) {
    let mut state = 1_i32;
    let mut gradients = Vec::with_capacity(2 * GRADIENTS + 2);
    while gradients.len() < GRADIENTS {
        let mut component = || f64::from(draw(&mut state) % 4096 - 2048) / 2048.0;
        let v = DVec3::new(component(), component(), component());
        if (1e-5..=1.0).contains(&v.length_squared()) {
            gradients.push(v.normalize());
        }
    }
    let mut permutation: Vec<u16> = (0..GRADIENTS as u16).collect();
    permutation.push(0);
    for i in (2..=GRADIENTS).rev().step_by(2) {
        let j = draw(&mut state) as usize % GRADIENTS;
        permutation.swap(i, j);
    }
    permutation.truncate(GRADIENTS);
    permutation.extend_from_within(..);
    permutation.extend_from_within(..2);
    gradients.extend_from_within(..);
    gradients.extend_from_within(..2);
    (permutation, gradients)
}

/// A number below 4096 by two.
#[inline]
fn hash2(tables: &Tables, a: usize, b: usize) -> usize {
    usize::from(tables.hash[(usize::from(tables.hash[a & 4095]) ^ (b & 4095)) & 8191])
}

/// The hash of a cell by its whole coordinates.
pub(super) fn hash3(a: i64, b: i64, c: i64) -> usize {
    let tables = &*TABLES;
    let [a, b, c] = [a, b, c].map(|x| (x & 4095) as usize);
    usize::from(tables.hash[(hash2(tables, a, b) ^ c) & 8191])
}

/// A random number in [0, 1) by a hash.
pub(super) fn random(index: usize) -> f64 {
    let table = &TABLES.random;
    table[index % table.len()]
}

/// Where a point is in the lattice: the corner below it, and the place in the cell.
struct Cell {
    corner: [usize; 3],
    place: DVec3,
}

impl Cell {
    fn of(p: DVec3) -> Self {
        let whole = p.to_array().map(|x| if x >= 0.0 { x.trunc() } else { (x - (1.0 - 1e-10)).trunc() });
        Self {
            corner: whole.map(|t| ((t as i64).wrapping_add(10_000) & 4095) as usize),
            place: p - DVec3::from_array(whole),
        }
    }

    /// The lattice sums with these offsets into the table.
    #[inline]
    fn sums<const N: usize>(&self, offsets: [usize; N]) -> [f64; N] {
        let tables = &*TABLES;
        let f = self.place;
        let s = f * f * (DVec3::splat(3.0) - 2.0 * f);
        let [ix, iy, iz] = self.corner;
        let rows: [usize; 4] = std::array::from_fn(|i| hash2(tables, ix + (i & 1), iy + (i >> 1)));
        let (near, away) = (DVec3::ONE - s, f - DVec3::ONE);
        let mut sums = [0.0; N];
        for corner in 0..8 {
            let [dx, dy, dz] = [corner & 1, corner >> 1 & 1, corner >> 2];
            let m = 2 * usize::from(tables.hash[(rows[corner & 3] ^ ((iz + dz) & 4095)) & 8191] & 255);
            let pick = |is_far: usize, far: f64, near: f64| if is_far == 1 { far } else { near };
            let d = DVec3::new(pick(dx, away.x, f.x), pick(dy, away.y, f.y), pick(dz, away.z, f.z));
            let weight = pick(dx, s.x, near.x) * pick(dy, s.y, near.y) * pick(dz, s.z, near.z);
            for (sum, offset) in sums.iter_mut().zip(offsets) {
                let l: &[f64; 7] = tables.lattice[m + offset..].first_chunk().unwrap_or(&[0.0; 7]);
                *sum += weight * (l[1] + l[2] * d.x + l[4] * d.y + l[6] * d.z);
            }
        }
        sums
    }
}

/// Noise in [0, 1].
pub fn noise(p: DVec3, generator: NoiseGenerator) -> f64 {
    if !p.is_finite() {
        return 0.5;
    }
    let sum = || Cell::of(p).sums([0])[0];
    let value = match generator {
        NoiseGenerator::Original => sum() + 0.5,
        NoiseGenerator::Corrected => (sum() + 1.052_42) * 0.489_855_82,
        NoiseGenerator::Perlin => 0.5 * (1.59 * gradient_noise(p) + 0.985),
    };
    value.clamp(0.0, 1.0)
}

fn gradient_noise(p: DVec3) -> f64 {
    let tables = &*TABLES;
    // The lattice is shifted by this.
    let p = p + SHIFT;
    let cell = p.floor();
    let f = p - cell;
    let index = |x: f64, far: usize| ((x as i64 & (GRADIENTS as i64 - 1)) as usize + far) & (GRADIENTS - 1);
    let s = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let mut sum = 0.0;
    for corner in 0..8 {
        let [dx, dy, dz] = [corner & 1, corner >> 1 & 1, corner >> 2];
        let row = usize::from(tables.permutation[index(cell.x, dx)]) + index(cell.y, dy);
        let row = usize::from(tables.permutation[row]) + index(cell.z, dz);
        let gradient = tables.gradients[row];
        let share = |is_far: usize, s: f64| if is_far == 1 { s } else { 1.0 - s };
        let weight = share(dx, s.x) * share(dy, s.y) * share(dz, s.z);
        sum += weight * gradient.dot(f - DVec3::new(dx as f64, dy as f64, dz as f64));
    }
    sum
}

/// Noise with three components, about zero.
pub fn vector_noise(p: DVec3) -> DVec3 {
    if !p.is_finite() {
        return DVec3::ZERO;
    }
    DVec3::from_array(Cell::of(p).sums([0, 8, 16]))
}

/// Octaves of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Octaves {
    /// How many, at least 1.
    pub octaves: u32,
    /// The factor on the frequency from one to the next.
    pub lambda: f64,
    /// The factor on the amplitude from one to the next.
    pub omega: f64,
}

impl Default for Octaves {
    fn default() -> Self {
        Self { octaves: 6, lambda: 2.0, omega: 0.5 }
    }
}

impl Octaves {
    /// A sum of octaves of noise.
    pub fn turbulence(&self, p: DVec3, generator: NoiseGenerator) -> f64 {
        let first = match generator {
            NoiseGenerator::Original => noise(p, generator),
            _ => (2.0 * noise(p, generator) - 0.5).clamp(0.0, 1.0),
        };
        let (mut sum, mut lambda, mut omega) = (first, self.lambda, self.omega);
        for _ in 1..self.octaves {
            sum += omega
                * match generator {
                    NoiseGenerator::Original => noise(p * lambda, generator),
                    _ => 2.0 * noise(p * lambda, generator) - 0.5,
                };
            lambda *= self.lambda;
            omega *= self.omega;
        }
        sum
    }

    /// A sum of octaves of noise with three components.
    pub fn vector_turbulence(&self, p: DVec3) -> DVec3 {
        let (mut sum, mut lambda, mut omega) = (vector_noise(p), self.lambda, self.omega);
        for _ in 1..self.octaves {
            sum += omega * vector_noise(p * lambda);
            lambda *= self.lambda;
            omega *= self.omega;
        }
        sum
    }
}

/// The places and frequencies that ripples and waves come from.
pub(super) fn wave_sources(count: u32) -> impl Iterator<Item = (DVec3, f64)> {
    static SOURCES: LazyLock<Vec<DVec3>> = LazyLock::new(|| {
        let source = |i| vector_noise(DVec3::new(i as f64, 0.0, 0.0)).normalize_or_zero();
        (0..MAX_WAVES).map(source).collect()
    });
    let frequencies = TABLES.wave_frequencies.iter().copied();
    SOURCES.iter().copied().zip(frequencies).take(count as usize)
}
