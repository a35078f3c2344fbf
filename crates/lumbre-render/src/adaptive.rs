//! Adaptive sampling: when a pixel has samples enough.

use crate::film::{Pixel, Tile};

/// Ends the sampling of each pixel where its noise is low enough.
///
/// It looks at a pixel's own samples alone, at fixed numbers of them, so that the picture does not depend on crops, threads and
/// interruptions. Pixels that end early are, in the mean, those whose samples happen to be alike, so the estimate of their error is
/// raised by what it may be wrong; a feature that no sample has found yet is beyond any estimate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Adaptive {
    /// [`crate::Stop::noise`].
    limit: f64,
    /// Added to the luminance of a pixel.
    floor: f64,
}

/// Samples of a pixel before its noise is looked at.
const LEAST: u32 = 16;
/// How much an estimate of n samples is raised, times √n.
const CAUTION: f64 = 2.0;
/// The share of the picture's mean luminance that is added to that of each pixel, so that black pixels count for little.
pub(crate) const FLOOR: f64 = 0.1;

impl Adaptive {
    /// For a limit of noise, and the mean luminance of the whole picture.
    pub(crate) fn new(limit: f64, mean_luminance: f64) -> Self {
        Self { limit, floor: FLOOR * mean_luminance.max(0.0) }
    }

    /// Whether a pixel needs no more samples.
    pub(crate) fn is_done(&self, pixel: &Pixel) -> bool {
        is_looked_at(pixel.taken) && self.share_of_limit(pixel).is_some_and(|share| share <= 1.0)
    }

    /// The error of a pixel, of its limit; `None` where too few samples say.
    fn share_of_limit(&self, pixel: &Pixel) -> Option<f64> {
        let (luminance, error) = pixel.luminance_with_error()?;
        let cautious = error * (1.0 + CAUTION / f64::from(pixel.samples).sqrt());
        let allowed = self.limit * (luminance.max(0.0) + self.floor);
        // A black pixel of a black picture is done.
        Some(if cautious == 0.0 { 0.0 } else { cautious / allowed })
    }

    /// How many samples a pixel will have in the end, as far as one can tell, but no more than `most`.
    pub(crate) fn expected(&self, pixel: &Pixel, most: u32) -> f64 {
        let taken = f64::from(pixel.taken);
        if self.is_done(pixel) {
            return taken;
        }
        // Noise falls with the square root of the number of samples.
        let share = self.share_of_limit(pixel).unwrap_or(1.0);
        (taken * share * share).max(taken).max(f64::from(LEAST)).min(f64::from(most))
    }
}

/// Whether pixels are looked at with so many samples: 16, 24, 32, 48, 64, 96 and so on, after which a Sobol sequence is even.
fn is_looked_at(taken: u32) -> bool {
    let is_step = taken.is_power_of_two() || (taken.is_multiple_of(3) && (taken / 3).is_power_of_two());
    taken >= LEAST && is_step
}

/// The number of samples at which pixels are looked at next that have so many.
pub(crate) fn next_look(taken: u32) -> u32 {
    (taken.saturating_add(1)..=u32::MAX).find(|&count| is_looked_at(count)).unwrap_or(u32::MAX)
}

/// The fewest samples of the pixels of a tile that need more; `None` where none does.
pub(crate) fn least_wanted(tile: &Tile, adaptive: Option<&Adaptive>) -> Option<u32> {
    let wants = |pixel: &&Pixel| adaptive.is_none_or(|adaptive| !adaptive.is_done(pixel));
    tile.pixels().iter().filter(wants).map(|pixel| pixel.taken).min()
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;

    use super::*;

    fn pixel(values: &[f32]) -> Pixel {
        let mut pixel = Pixel::default();
        for &value in values {
            assert!(pixel.add(Rgb::splat(value), 1.0, 1.0));
            pixel.taken += 1;
        }
        pixel
    }

    #[test]
    fn a_pixel_is_done_where_its_own_error_is_small_and_only_at_a_look() {
        let alternating =
            |count: usize| pixel(&(0..count).map(|i| if i % 2 == 0 { 0.9 } else { 1.1 }).collect::<Vec<_>>());
        // 16 samples that are 0.1 off: an error of 0.1 / sqrt(15), half as much again for caution.
        let error = 0.1 / 15f64.sqrt() * 1.5;
        for (limit, is_done) in [(0.99 * error, false), (1.01 * error, true)] {
            assert_eq!(Adaptive::new(limit, 0.0).is_done(&alternating(16)), is_done, "{limit}");
        }
        let lax = Adaptive::new(1.0, 0.0);
        let looks: Vec<usize> = (1..200).filter(|&count| lax.is_done(&alternating(count))).collect();
        assert_eq!(looks, [16, 24, 32, 48, 64, 96, 128, 192]);
    }

    #[test]
    fn dark_pixels_are_measured_against_the_picture() {
        let dark = pixel(&[0.0, 0.0, 0.0, 0.01].repeat(4));
        assert!(!Adaptive::new(0.1, 0.0).is_done(&dark));
        assert!(Adaptive::new(0.1, 1.0).is_done(&dark));
        assert!(Adaptive::new(0.1, 0.0).is_done(&pixel(&[0.0; 16])));
        let expected = Adaptive::new(0.1, 0.0).expected(&dark, 1 << 14);
        assert!(expected > 100.0 && expected < 1000.0, "{expected}");
        assert_eq!(Adaptive::new(0.1, 0.0).expected(&pixel(&[1.0, 2.0]), 5), 5.0);
    }
}
