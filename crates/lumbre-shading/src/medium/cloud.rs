//! A procedural cloud.

use lumbre_math::DVec3;
use lumbre_math::noise::noise;

/// A cloud by octaves of gradient noise: denser below, with density 1 at and below y = 0, and nothing much above y = 1.
///
/// The cloud of pbrt-v4 (M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 4th edition, 2023).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloud {
    /// A factor on the density of the noise.
    pub density: f64,
    /// How far noise moves the places where the density is looked up; 0 for not at all.
    pub wispiness: f64,
    /// A factor on places: the larger, the finer the cloud.
    pub frequency: f64,
}

/// From one octave to the next: not 2, so that the zeros of noise do not fall together.
const LACUNARITY: f64 = 1.99;

impl Cloud {
    /// The density at a point, in [0, 1].
    pub fn at(&self, p: DVec3) -> f64 {
        let mut place = self.frequency * p;
        if self.wispiness > 0.0 {
            let (mut weight, mut scale) = (0.05 * self.wispiness, 10.0);
            for _ in 0..2 {
                place += weight * slope(scale * place);
                weight *= 0.5;
                scale *= LACUNARITY;
            }
        }
        let (mut sum, mut weight, mut scale) = (0.0, 0.5, 1.0);
        for _ in 0..5 {
            sum += weight * noise(scale * place);
            weight *= 0.5;
            scale *= LACUNARITY;
        }
        let shape = ((1.0 - p.y) * 4.5 * self.density * sum).clamp(0.0, 1.0);
        (shape + 2.0 * (0.5 - p.y).max(0.0)).clamp(0.0, 1.0)
    }
}

/// The gradient of noise, by differences.
fn slope(p: DVec3) -> DVec3 {
    const STEP: f64 = 0.01;
    let here = noise(p);
    let along = |axis: DVec3| (noise(p + STEP * axis) - here) / STEP;
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_is_solid_below_and_gone_above() {
        let cloud = Cloud { density: 1.0, wispiness: 1.0, frequency: 5.0 };
        let mut sum = 0.0;
        for i in 0..1000 {
            let i = f64::from(i);
            let (x, z) = (0.37 * i % 1.0, 0.73 * i % 1.0);
            assert_eq!(cloud.at(DVec3::new(x, -0.1, z)), 1.0);
            assert_eq!(cloud.at(DVec3::new(x, 0.0, z)), 1.0);
            assert_eq!(cloud.at(DVec3::new(x, 1.0, z)), 0.0);
            let middle = cloud.at(DVec3::new(x, 0.6, z));
            assert!((0.0..=1.0).contains(&middle));
            sum += middle;
        }
        assert!(sum > 50.0 && sum < 800.0, "{sum}");
    }
}
