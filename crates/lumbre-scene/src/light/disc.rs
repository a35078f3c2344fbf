//! A disc at infinity, such as the sun.

use std::f64::consts::PI;

use lumbre_math::{DVec2, DVec3, Elementary, Frame, warp64};
use lumbre_shading::Spectrum;

/// Uniform radiance from a disc at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscLight {
    frame: Frame,
    radiance: Spectrum,
    /// Irradiance on a surface that faces the centre.
    irradiance: Spectrum,
    /// 1 - cos of the angle between the centre and the edge, and its sine.
    one_minus_cos: f64,
    sine: f64,
}

impl DiscLight {
    /// `None` for a direction or an irradiance that is not finite, and for a diameter that is not in (0°, 180°].
    pub(crate) fn new(towards: DVec3, degrees: f64, irradiance: Spectrum) -> Option<Self> {
        let towards = towards.try_normalize()?;
        let is_known = 0.0 < degrees && degrees <= 180.0 && irradiance.is_finite();
        let half = (0.5 * degrees).to_radians();
        let (sine, small) = (half.sine(), (0.5 * half).sine());
        is_known.then(|| Self {
            frame: Frame::from_z(towards),
            radiance: irradiance * (1.0 / (PI * sine * sine)) as f32,
            irradiance,
            // Without cancellation.
            one_minus_cos: 2.0 * small * small,
            sine,
        })
    }

    /// The unit vector towards the centre.
    pub fn towards(&self) -> DVec3 {
        self.frame.z
    }

    /// The irradiance on a surface that faces the centre.
    pub fn facing(&self) -> Spectrum {
        self.irradiance
    }

    /// The sine of the angle between the centre and the edge.
    pub(super) fn sine(&self) -> f64 {
        self.sine
    }

    /// The radiance from a unit direction.
    pub fn radiance(&self, direction: DVec3) -> Spectrum {
        if self.holds(direction) { self.radiance } else { Spectrum::BLACK }
    }

    /// A direction in it, by its density per unit solid angle.
    pub(super) fn sample(&self, u: DVec2) -> (DVec3, f64) {
        let towards = self.frame.to_world(warp64::square_to_cone(u, self.one_minus_cos));
        (towards, warp64::cone_pdf(self.one_minus_cos))
    }

    pub(super) fn pdf(&self, direction: DVec3) -> f64 {
        if self.holds(direction) { warp64::cone_pdf(self.one_minus_cos) } else { 0.0 }
    }

    /// The irradiance on a surface with the unit `normal`. A disc that the horizon cuts counts as its visible part, as
    /// if the horizon were straight.
    pub fn irradiance(&self, normal: DVec3) -> Spectrum {
        let height = normal.dot(self.frame.z);
        if height >= self.sine {
            return self.irradiance * height as f32;
        }
        if height <= -self.sine {
            return Spectrum::BLACK;
        }
        // A disc of radius 1 at height h, of which the height above the horizon is integrated.
        let h = height / self.sine;
        let across = (1.0 - h * h).max(0.0).sqrt();
        let part = h * (h.arc_sine() + 0.5 * PI) + across * (2.0 + h * h) / 3.0;
        self.irradiance * (self.sine * part / PI) as f32
    }

    /// Whether a unit direction is within the disc.
    fn holds(&self, direction: DVec3) -> bool {
        // Half the square of a chord is 1 - cos.
        direction.distance_squared(self.frame.z) <= 2.0 * self.one_minus_cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::random::RandomStream;

    fn disc(degrees: f64) -> DiscLight {
        DiscLight::new(DVec3::new(0.3, -0.5, 0.9), degrees, Spectrum::new(3.0, 2.0, 1.0)).unwrap()
    }

    #[test]
    fn samples_have_their_density_and_the_irradiance_that_was_asked() {
        for degrees in [0.533, 20.0, 180.0] {
            let (light, mut random) = (disc(degrees), RandomStream::new(5));
            for normal in [light.towards(), DVec3::new(0.6, 0.0, 0.8)] {
                let (mut sum, count) = (0.0, 20_000);
                for _ in 0..count {
                    let (towards, pdf) = light.sample(DVec2::new(random.next_f64(), random.next_f64()));
                    assert_eq!(pdf, light.pdf(towards));
                    sum += f64::from(light.radiance(towards).r) / pdf * towards.dot(normal).max(0.0);
                }
                let (found, expected) = (sum / f64::from(count), f64::from(light.irradiance(normal).r));
                // Of a wide disc, the horizon is not straight.
                let tolerance = if degrees > 90.0 && normal != light.towards() { 0.2 } else { 0.01 };
                assert!((found / expected - 1.0).abs() < tolerance, "{degrees}: {found} {expected}");
            }
            assert!((light.irradiance(light.towards()).g - 2.0).abs() < 1e-4);
        }
    }

    #[test]
    fn directions_beside_it_are_black() {
        let light = disc(2.0);
        let beside = |degrees: f64| {
            let turn = lumbre_math::direction_at(degrees.to_radians());
            light.frame.to_world(DVec3::new(turn.y, 0.0, turn.x))
        };
        assert!(!light.radiance(beside(0.99)).is_black() && light.radiance(beside(1.01)).is_black());
        assert_eq!(light.pdf(beside(1.01)), 0.0);
    }

    #[test]
    fn the_part_above_the_horizon_lights() {
        let light = disc(4.0);
        let across = light.frame.x;
        for height in [-0.03, -0.01, 0.0, 0.02, 0.034] {
            let normal = (light.towards() * height + across * (1.0_f64 - height * height).sqrt()).normalize();
            let (mut sum, side) = (0.0, 200);
            for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
                let u = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) / f64::from(side);
                sum += light.sample(u).0.dot(normal).max(0.0) / f64::from(side * side);
            }
            let expected = f64::from(light.irradiance(normal).g) / 2.0;
            assert!((sum - expected).abs() < 2e-4, "{height}: {sum} {expected}");
        }
    }

    #[test]
    fn what_is_no_disc_is_refused() {
        let new = |towards, degrees| DiscLight::new(towards, degrees, Spectrum::WHITE);
        assert!(new(DVec3::ZERO, 1.0).is_none() && new(DVec3::Z, 0.0).is_none());
        assert!(new(DVec3::Z, 181.0).is_none() && new(DVec3::Z, f64::NAN).is_none());
    }
}
