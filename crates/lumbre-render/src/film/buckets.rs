//! Radiance by wavelength: the film `spectral` of pbrt-v4.

use lumbre_scene::Buckets;

use crate::film::ExactSum;
use crate::film::pixel::Sums;

/// The radiance of a sample at its wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralSample {
    /// The wavelengths, in nm.
    pub nm: [f32; 3],
    /// The radiance at each, in units in which light of a constant spectrum of 1 has luminance 1.
    pub radiance: [f32; 3],
}

/// Sums of one pixel for one range of wavelengths, independent of their order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BucketSums {
    /// Σ weight × radiance of the wavelengths in the range.
    pub radiance: ExactSum,
    /// Σ weight of these wavelengths.
    pub weight: ExactSum,
}

impl BucketSums {
    /// Adds a sample of this weight to the ranges of its wavelengths; its radiance is multiplied by `factor`.
    pub fn add(sums: &mut [Self], buckets: &Buckets, sample: &SpectralSample, weight: f64, factor: f32) {
        for (nm, radiance) in sample.nm.into_iter().zip(sample.radiance) {
            if let Some(sums) = sums.get_mut(buckets.of(nm)) {
                sums.radiance.add(weight * f64::from(radiance * factor));
                sums.weight.add(weight);
            }
        }
    }

    /// Adds the samples of another.
    pub fn merge(&mut self, other: &Self) {
        self.radiance.merge(other.radiance);
        self.weight.merge(other.weight);
    }

    /// The mean radiance; 0 without a sample.
    pub fn mean(&self) -> f32 {
        let weight = self.weight.value();
        if weight == 0.0 { 0.0 } else { (self.radiance.value() / weight) as f32 }
    }
}

impl Sums for BucketSums {
    fn merge(&mut self, other: &Self) {
        self.merge(other);
    }
}

/// The name of the channel of a range, as the layout of spectral OpenEXR files has it, with a comma for the decimal
/// point: A. Fichet, R. Pacanowski, A. Wilkie, "An OpenEXR Layout for Spectral Images", JCGT 10(3), 2021.
pub(crate) fn channel_name(buckets: &Buckets, part: usize) -> String {
    let middle = format!("{:.3}", buckets.middle(part)).replace('.', ",");
    format!("S0.{middle}nm")
}

/// The attributes of a file with these channels, in the same layout.
pub(crate) const ATTRIBUTES: [(&str, &str); 2] =
    [("spectralLayoutVersion", "1.0"), ("emissiveUnits", "W.m^-2.sr^-1")];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_goes_to_the_ranges_of_its_wavelengths() {
        let buckets = Buckets { count: 4, low: 400.0, high: 600.0 };
        let mut sums = [BucketSums::default(); 4];
        let sample = SpectralSample { nm: [400.0, 549.9, 600.0], radiance: [1.0, 2.0, 3.0] };
        BucketSums::add(&mut sums, &buckets, &sample, 0.5, 2.0);
        let sample = SpectralSample { nm: [449.9, 550.1, 420.0], radiance: [5.0, 7.0, 0.0] };
        BucketSums::add(&mut sums, &buckets, &sample, 1.5, 2.0);
        let mut other = [BucketSums::default(); 4];
        let sample = SpectralSample { nm: [500.0; 3], radiance: [4.0; 3] };
        BucketSums::add(&mut other, &buckets, &sample, 0.5, 1.0);
        sums.iter_mut().zip(&other).for_each(|(sums, other)| sums.merge(other));
        let means = sums.map(|sums| sums.mean());
        assert_eq!(means, [16.0 / 3.5, 0.0, (2.0 + 6.0) / 2.0, (3.0 + 21.0) / 2.0]);
    }

    #[test]
    fn channels_are_named_by_the_middle_of_their_range() {
        let buckets = Buckets { count: 16, low: 360.0, high: 830.0 };
        assert_eq!(channel_name(&buckets, 0), "S0.374,688nm");
        assert_eq!(channel_name(&buckets, 15), "S0.815,312nm");
        assert_eq!((buckets.of(359.0), buckets.of(830.0), buckets.of(389.4)), (0, 15, 1));
    }
}
