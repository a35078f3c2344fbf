//! Gradient noise, and sums of its octaves.
//!
//! K. Perlin, "Improving Noise", SIGGRAPH 2002; octaves after D. Ebert and others, "Texturing and Modeling: A
//! Procedural Approach", 3rd edition, 2003. The permutation is the one that Perlin published, and gradients are chosen
//! as pbrt does, so that patterns of its scenes stand where they stand there.

use glam::DVec3;

use crate::Elementary;

/// Perlin's permutation of the bytes.
#[rustfmt::skip]
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30,
    69, 142, 8, 99, 37, 240, 21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62,
    94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88, 237, 149, 56, 87, 174, 20, 125, 136,
    171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83, 111, 229, 122,
    60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161,
    1, 216, 80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86,
    164, 100, 109, 198, 173, 186, 3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126,
    255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213,
    119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129, 22, 39, 253,
    19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193,
    238, 210, 144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31,
    181, 199, 106, 157, 184, 84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93,
    222, 114, 67, 29, 24, 72, 243, 141, 128, 195, 78, 66, 215, 61, 156, 180,
];

fn permuted(index: i64) -> i64 {
    i64::from(PERMUTATION[(index & 255) as usize])
}

/// Gradient noise at a point, in (−1, 1): 0 at points whose coordinates are all whole.
///
/// ```
/// use lumbre_math::{DVec3, noise::noise};
///
/// assert_eq!(noise(DVec3::new(3.0, -2.0, 7.0)), 0.0);
/// assert_ne!(noise(DVec3::new(0.3, 0.7, 0.4)), 0.0);
/// ```
pub fn noise(p: DVec3) -> f64 {
    // Beyond this, neighbouring points have the same fraction.
    const PERIOD: f64 = 1_073_741_824.0;
    let p = p % PERIOD;
    let cell = p.floor();
    let [dx, dy, dz] = (p - cell).to_array();
    let [x, y, z] = cell.to_array().map(|cell| cell as i64);
    let corner = |i: i64, j: i64, k: i64| {
        let hash = permuted(permuted(permuted(x + i) + y + j) + z + k) & 15;
        let (dx, dy, dz) = (dx - i as f64, dy - j as f64, dz - k as f64);
        let u = if hash < 8 || hash == 12 || hash == 13 { dx } else { dy };
        let v = if hash < 4 || hash == 12 || hash == 13 { dy } else { dz };
        let signed = |value: f64, bit: i64| if hash & bit != 0 { -value } else { value };
        signed(u, 1) + signed(v, 2)
    };
    let [wx, wy, wz] = [dx, dy, dz].map(fade);
    let lerp = |t: f64, a: f64, b: f64| (1.0 - t) * a + t * b;
    let along_x = |j: i64, k: i64| lerp(wx, corner(0, j, k), corner(1, j, k));
    let along_y = |k: i64| lerp(wy, along_x(0, k), along_x(1, k));
    lerp(wz, along_y(0), along_y(1))
}

/// From one octave of a sum to the next, how much finer it is. Not 2, so that points where noise is 0 do not fall
/// together.
const LACUNARITY: f64 = 1.99;

/// Octaves of noise to be summed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Octaves {
    /// How many at most.
    pub count: u32,
    /// The strength of an octave over that of the one before.
    pub roughness: f64,
}

impl Octaves {
    /// The sum of octaves of noise, fractional Brownian motion. `footprint` are the sides of what is looked at; octaves
    /// finer than it are left out, the last one by degrees. A footprint of zero has all of them.
    pub fn fbm(self, p: DVec3, footprint: [DVec3; 2]) -> f64 {
        let (whole, part) = self.seen(footprint);
        let (mut sum, mut scale, mut strength) = (0.0, 1.0, 1.0);
        for _ in 0..whole {
            sum += strength * noise(scale * p);
            scale *= LACUNARITY;
            strength *= self.roughness;
        }
        if part > 0.0 { sum + strength * part * noise(scale * p) } else { sum }
    }

    /// The sum of the absolute values of octaves of noise, turbulence. Octaves that are too fine count by their mean,
    /// about 0.2.
    pub fn turbulence(self, p: DVec3, footprint: [DVec3; 2]) -> f64 {
        const MEAN: f64 = 0.2;
        let (whole, part) = self.seen(footprint);
        let (mut sum, mut scale, mut strength) = (0.0, 1.0, 1.0);
        for _ in 0..whole {
            sum += strength * noise(scale * p).abs();
            scale *= LACUNARITY;
            strength *= self.roughness;
        }
        if whole < self.count {
            // What is seen of the next octave, and its mean for the rest; it stands in the means of all that are left
            // out once more, as in pbrt, so that pictures agree.
            sum += strength * ((1.0 - part) * MEAN + part * noise(scale * p).abs());
            for _ in whole..self.count {
                sum += strength * MEAN;
                strength *= self.roughness;
            }
        }
        sum
    }

    /// How many octaves are seen whole, and how much of the next.
    fn seen(self, [dx, dy]: [DVec3; 2]) -> (u32, f64) {
        let most = f64::from(self.count);
        let size = dx.length_squared().max(dy.length_squared());
        // The Nyquist limit; infinite where the footprint is a point. NaN counts as a point.
        let seen = -1.0 - 0.5 * size.logarithm_2();
        let seen = if seen.is_nan() { most } else { seen.clamp(0.0, most) };
        let whole = seen.floor();
        let t = ((seen - whole - 0.3) / 0.4).clamp(0.0, 1.0);
        (whole as u32, t * t * (3.0 - 2.0 * t))
    }
}

/// 6t⁵ − 15t⁴ + 10t³.
fn fade(t: f64) -> f64 {
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    #[test]
    fn the_permutation_has_every_byte_once() {
        let mut sorted = PERMUTATION;
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..=255));
    }

    #[test]
    fn noise_is_continuous_bounded_and_centred() {
        let mut random = RandomStream::new(3);
        let (mut sum, mut squares, count) = (0.0, 0.0, 20_000);
        for _ in 0..count {
            let p = 200.0 * DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) - 100.0;
            let value = noise(p);
            assert!(value.abs() < 1.0, "{p}: {value}");
            let step = noise(p + DVec3::splat(1e-7)) - value;
            assert!(step.abs() < 1e-5, "{p}: {step}");
            sum += value;
            squares += value * value;
        }
        let (mean, variance) = (sum / f64::from(count), squares / f64::from(count));
        assert!(mean.abs() < 0.01 && (0.04..0.1).contains(&variance), "{mean} {variance}");
    }

    #[test]
    fn noise_is_zero_between_cells_and_at_any_size() {
        for p in [DVec3::ZERO, DVec3::new(-5.0, 300.0, 17.0)] {
            assert_eq!(noise(p), 0.0);
        }
        for p in [DVec3::splat(1e300), DVec3::splat(-1e17), DVec3::splat(f64::MAX)] {
            assert!(noise(p).is_finite());
        }
    }

    const POINT: [DVec3; 2] = [DVec3::ZERO; 2];

    #[test]
    fn octaves_are_summed_and_too_fine_ones_are_left_out() {
        let p = DVec3::new(0.3, -1.7, 2.4);
        let octaves = Octaves { count: 3, roughness: 0.6 };
        let of = |i: i32| noise(p * 1.99_f64.powi(i));
        let expected = of(0) + 0.6 * of(1) + 0.36 * of(2);
        assert!((octaves.fbm(p, POINT) - expected).abs() < 1e-12);
        let expected = of(0).abs() + 0.6 * of(1).abs() + 0.36 * of(2).abs();
        assert!((octaves.turbulence(p, POINT) - expected).abs() < 1e-12);
        // log2 of the size is -2.5, so one octave and a half are seen.
        let half = [DVec3::X * 2.0_f64.powf(-2.5), DVec3::Y * 0.01];
        assert!((octaves.fbm(p, half) - (of(0) + 0.5 * 0.6 * of(1))).abs() < 1e-12);
        let rest = 0.6 * (0.1 + 0.5 * of(1).abs()) + 0.2 * (0.6 + 0.36);
        assert!((octaves.turbulence(p, half) - (of(0).abs() + rest)).abs() < 1e-12);
        let wide = [DVec3::ZERO, DVec3::Y * 10.0];
        assert_eq!(octaves.fbm(p, wide), 0.0);
        assert_eq!(Octaves { count: 0, ..octaves }.turbulence(p, POINT), 0.0);
    }
}
