//! Media that are the same everywhere.

use lumbre_math::Elementary;

use super::spectra::MediumSpectra;
use crate::Spectrum;
use crate::spectrum::Wavelengths;

/// A homogeneous medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomogeneousMedium {
    /// The extinction coefficient σ_t per unit of length: exp(−σ_t d) of the light travels a distance d without
    /// collision.
    pub extinction: Spectrum,
    /// The single-scattering albedo, in [0, 1].
    pub albedo: Spectrum,
    /// Henyey–Greenstein asymmetry, in (−1, 1): negative for backward, positive for forward scattering.
    pub asymmetry: f32,
}

/// A distance sample: how light crosses a part of a medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DistanceSample {
    /// It reaches the end, with this factor on its throughput.
    Through(Spectrum),
    /// It scatters at a collision.
    Collision {
        /// The distance travelled.
        distance: f64,
        /// The factor on its throughput.
        weight: Spectrum,
    },
}

impl HomogeneousMedium {
    /// The same at some wavelengths, if there are any.
    pub(super) fn at(&self, spectra: Option<&MediumSpectra>, wavelengths: Option<&Wavelengths>) -> Self {
        let Some(wavelengths) = wavelengths else { return *self };
        let scattering = self.extinction * self.albedo;
        let absorption = self.extinction * (Spectrum::WHITE - self.albedo);
        let [absorption, scattering] =
            MediumSpectra::coefficients(spectra, [absorption, scattering], wavelengths);
        let extinction = absorption + scattering;
        let albedo = scattering.zip(extinction, |s, t| if t > 0.0 { s / t } else { 0.0 });
        Self { extinction, albedo, ..*self }
    }

    /// What is left of light after a distance, which may be infinite.
    pub fn transmittance(&self, distance: f64) -> Spectrum {
        self.extinction.map(|sigma| left_after(sigma.into(), distance) as f32)
    }

    /// The part of light that is absorbed, rather than scattered, of what does not come through a distance: σ_a/σ_t (1
    /// − exp(−σ_t d)).
    pub fn absorbed(&self, distance: f64) -> Spectrum {
        self.transmittance(distance).zip(self.albedo, |left, albedo| (1.0 - left) * (1.0 - albedo))
    }

    /// Samples the distance that light of throughput `carried` travels within `distance`. `u` selects a channel
    /// and the collision; the density is the balance over all channels.
    ///
    /// (A. Wilkie and others, "Hero Wavelength Spectral Sampling", EGSR 2014, with channels for wavelengths.)
    pub fn sample_distance(&self, carried: Spectrum, distance: f64, u: [f64; 2]) -> DistanceSample {
        let sigma = self.extinction.to_array().map(f64::from);
        let carried = carried.to_array().map(|c| f64::from(c.max(0.0)));
        let sum: f64 = carried.iter().sum();
        if sum.is_nan() || sum <= 0.0 {
            return DistanceSample::Through(Spectrum::BLACK);
        }
        if self.albedo.is_black() {
            // Nothing scatters: what is left is known.
            return DistanceSample::Through(self.transmittance(distance));
        }
        let shares = carried.map(|c| c / sum);
        let mut channel = 0;
        let mut rest = u[0];
        while channel < 2 && rest >= shares[channel] {
            rest -= shares[channel];
            channel += 1;
        }
        // 1 - u is in (0, 1].
        let free_path = match sigma[channel] {
            sigma if sigma > 0.0 => -(1.0 - u[1]).logarithm() / sigma,
            _ => f64::INFINITY,
        };
        let end = if free_path < distance { free_path } else { distance };
        let left = sigma.map(|sigma| left_after(sigma, end));
        if free_path < distance {
            let density: f64 = (0..3).map(|i| shares[i] * sigma[i] * left[i]).sum();
            let albedo = self.albedo.to_array();
            let [r, g, b] =
                std::array::from_fn(|i| (f64::from(albedo[i]) * sigma[i] * left[i] / density) as f32);
            DistanceSample::Collision { distance: free_path, weight: Spectrum::new(r, g, b) }
        } else {
            let probability: f64 = (0..3).map(|i| shares[i] * left[i]).sum();
            // So dense that only rounding gets this far.
            if probability <= 0.0 {
                return DistanceSample::Through(Spectrum::BLACK);
            }
            let [r, g, b] = left.map(|left| (left / probability) as f32);
            DistanceSample::Through(Spectrum::new(r, g, b))
        }
    }
}

/// exp(−σ d), where d may be infinite.
fn left_after(sigma: f64, distance: f64) -> f64 {
    if sigma > 0.0 { (-sigma * distance).exponential() } else { 1.0 }
}

/// The single-scattering albedo for the multiple-scattering colour of a deep medium.
///
/// C. Kulla, A. Conty, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH course notes, 2017, with
/// the asymmetry of the medium (similarity theory).
pub fn albedo_of_many_collisions(color: f32, g: f32) -> f32 {
    let c = crate::unit(color);
    let s = 4.097_12 + 4.208_63 * c - (9.592_17 + 41.680_8 * c + 17.712_6 * c * c).sqrt();
    let squared = crate::unit(s).powi(2);
    (1.0 - squared) / (1.0 - g * squared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::random::RandomStream;

    #[test]
    fn flights_collide_as_beer_lambert_says_in_every_lane() {
        let medium = HomogeneousMedium {
            extinction: Spectrum::new(0.5, 2.0, 0.0),
            albedo: Spectrum::new(0.9, 0.5, 0.3),
            asymmetry: 0.0,
        };
        let carried = Spectrum::new(0.25, 0.5, 0.75);
        let distance = 1.3;
        let mut random = RandomStream::new(4);
        let (mut through, mut scattered, mut way) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let count = 400_000;
        for _ in 0..count {
            match medium.sample_distance(carried, distance, [random.next_f64(), random.next_f64()]) {
                DistanceSample::Through(weight) => {
                    (0..3).for_each(|i| through[i] += f64::from(weight.to_array()[i]));
                }
                DistanceSample::Collision { distance: free_path, weight } => {
                    assert!(free_path < distance);
                    for i in 0..3 {
                        scattered[i] += f64::from(weight.to_array()[i]);
                        way[i] += free_path * f64::from(weight.to_array()[i]);
                    }
                }
            }
        }
        for (i, (sigma, albedo)) in [(0.5_f64, 0.9), (2.0, 0.5), (0.0, 0.3)].into_iter().enumerate() {
            let left = (-sigma * distance).exp();
            let mean = |sum: f64| sum / f64::from(count);
            assert!((mean(through[i]) - left).abs() < 4e-3, "{i}: {}", mean(through[i]));
            assert!((mean(scattered[i]) - albedo * (1.0 - left)).abs() < 4e-3, "{i}: {}", mean(scattered[i]));
            // ∫ t σ exp(−σ t) dt
            let first = if sigma > 0.0 { (1.0 - left) / sigma - distance * left } else { 0.0 };
            assert!((mean(way[i]) - albedo * first).abs() < 4e-3, "{i}: {}", mean(way[i]));
        }
    }

    #[test]
    fn black_light_stops_and_dense_media_give_no_nan() {
        let medium = HomogeneousMedium {
            extinction: Spectrum::new(1e30, 1e30, 0.0),
            albedo: Spectrum::WHITE,
            asymmetry: 0.0,
        };
        assert_eq!(
            medium.sample_distance(Spectrum::BLACK, 2.0, [0.5; 2]),
            DistanceSample::Through(Spectrum::BLACK)
        );
        for u in [[0.0, 0.0], [0.3, 0.0], [0.3, 0.999_999], [0.99, 0.999_999]] {
            match medium.sample_distance(Spectrum::new(0.5, 0.25, 0.25), 2.0, u) {
                DistanceSample::Through(weight) => assert!(weight.is_finite(), "{u:?}: {weight:?}"),
                DistanceSample::Collision { weight, .. } => assert!(weight.is_finite(), "{u:?}: {weight:?}"),
            }
        }
    }

    #[test]
    fn white_stays_white_and_black_black_through_many_collisions() {
        for g in [-0.5, 0.0, 0.8] {
            assert!(albedo_of_many_collisions(0.0, g) < 0.01);
            assert!((albedo_of_many_collisions(1.0, g) - 1.0).abs() < 1e-3);
            assert!(albedo_of_many_collisions(0.5, g) > 0.7);
        }
    }
}
