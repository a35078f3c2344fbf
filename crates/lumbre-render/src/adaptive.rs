//! Adaptive sampling: when a pixel has enough samples.

use crate::film::{Pixel, Tile};
use crate::neighbourhoods::{Expectation, FLOOR, needed};
use crate::trial::Trial;

/// Ends the sampling of each pixel where its noise is low enough.
///
/// A pixel's error is estimated from its own samples and from a trial of the whole picture in its neighbourhood
/// ([`Trial`]): a pixel that has not met rare light yet knows nothing of it. Noise is checked at fixed numbers of
/// samples, and the trial is the same for every crop, so that the picture does not depend on crops, threads and
/// interruptions. Pixels that stop early are on average those whose samples happen to agree, so the estimate of their
/// error is raised by its own uncertainty.
#[derive(Clone, Debug)]
pub(crate) struct Adaptive {
    /// [`crate::Stop::noise`].
    limit: f64,
    /// Samples of a pixel before its noise is checked.
    min_spp: u32,
    /// Added to the luminance of a pixel.
    floor: f64,
    trial: Trial,
}

/// By how much an estimate from n samples is raised, times √n.
const CAUTION: f64 = 2.0;
impl Adaptive {
    /// For a noise limit and a trial of the whole picture. Every pixel gets at least `min_spp` samples, or the number
    /// that the trial requires.
    pub(crate) fn new(limit: f64, min_spp: Option<u32>, trial: Trial) -> Self {
        let min_spp = min_spp.unwrap_or_else(|| trial.min_spp());
        Self { limit, min_spp, floor: FLOOR * trial.mean.max(0.0), trial }
    }

    /// Whether a pixel needs no more samples.
    pub(crate) fn is_done(&self, x: u32, y: u32, pixel: &Pixel) -> bool {
        self.is_looked_at(pixel.taken) && self.share_of_limit(x, y, pixel).is_some_and(|share| share <= 1.0)
    }

    /// The error of a pixel relative to its limit; `None` with too few samples.
    fn share_of_limit(&self, x: u32, y: u32, pixel: &Pixel) -> Option<f64> {
        let (luminance, error) = pixel.luminance_with_error()?;
        let n = f64::from(pixel.samples);
        let Expectation { variance, kurtosis, .. } = self.trial.at(x, y);
        let variance = (n * error * error * n + kurtosis * variance) / (n + kurtosis);
        let cautious = (variance / n).sqrt() * (1.0 + CAUTION / n.sqrt());
        let allowed = self.limit * (luminance.max(0.0) + self.floor);
        // A black pixel of a black picture is done.
        Some(if cautious == 0.0 { 0.0 } else { cautious / allowed })
    }

    /// The expectation for the samples of a pixel.
    pub(crate) fn expectation(&self, x: u32, y: u32) -> Expectation {
        self.trial.at(x, y)
    }

    /// Whether a pixel is checked at this number of samples.
    fn is_looked_at(&self, taken: u32) -> bool {
        taken >= self.min_spp && (taken == self.min_spp || is_step(taken))
    }

    /// The next number of samples at which a pixel with `taken` samples is checked.
    pub(crate) fn next_look(&self, taken: u32) -> u32 {
        if taken < self.min_spp { self.min_spp } else { next_step(taken) }
    }

    /// The number of pixels above the noise limit.
    pub(crate) fn noisy_pixels(&self, tiles: &[Tile]) -> u64 {
        let pixels = tiles.iter().flat_map(|tile| tile.bounds().pixels().zip(tile.pixels()));
        let is_noisy = |&((x, y), pixel): &((u32, u32), &Pixel)| {
            self.share_of_limit(x, y, pixel).is_none_or(|share| share > 1.0)
        };
        pixels.filter(is_noisy).count() as u64
    }

    /// The expected final number of samples of a pixel, at most `most`.
    pub(crate) fn expected(&self, x: u32, y: u32, pixel: &Pixel, most: u32) -> f64 {
        let taken = f64::from(pixel.taken);
        if self.is_done(x, y, pixel) {
            return taken;
        }
        if pixel.taken < self.min_spp {
            // Its own samples are too few for an estimate.
            let Expectation { mean, variance, .. } = self.trial.at(x, y);
            let needed = needed(variance, self.limit * (mean.max(0.0) + self.floor));
            return needed.max(f64::from(self.min_spp)).min(f64::from(most));
        }
        // Noise falls with the square root of the number of samples.
        let share = self.share_of_limit(x, y, pixel).unwrap_or(1.0);
        (taken * share * share).max(taken).max(f64::from(self.min_spp)).min(f64::from(most))
    }
}

/// 1, 2, 3, 4, 6, 8, 12, 16, 24 and so on: numbers of samples after which a Sobol sequence is stratified.
fn is_step(taken: u32) -> bool {
    taken.is_power_of_two() || (taken.is_multiple_of(3) && (taken / 3).is_power_of_two())
}

/// The next such number, if any.
fn next_step(taken: u32) -> u32 {
    let Some(power) = taken.checked_add(1).and_then(u32::checked_next_power_of_two) else { return u32::MAX };
    let before = power / 4 * 3;
    if before > taken { before } else { power }
}

/// The pixels of a tile that need more samples.
pub(crate) fn wanting<'t>(tile: &'t Tile, adaptive: Option<&Adaptive>) -> impl Iterator<Item = &'t Pixel> {
    let wants = move |&((x, y), pixel): &((u32, u32), &Pixel)| {
        adaptive.is_none_or(|adaptive| !adaptive.is_done(x, y, pixel))
    };
    tile.bounds().pixels().zip(tile.pixels()).filter(wants).map(|(_, pixel)| pixel)
}

/// The fewest samples among the pixels of a tile that need more; `None` if none does.
pub(crate) fn least_wanted(tile: &Tile, adaptive: Option<&Adaptive>) -> Option<u32> {
    wanting(tile, adaptive).map(|pixel| pixel.taken).min()
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;

    use super::*;
    use crate::neighbourhoods::{Moments, Spread};

    fn pixel(values: &[f32]) -> Pixel {
        let mut pixel = Pixel::default();
        for &value in values {
            assert!(pixel.add(Rgb::splat(value), 1.0, 1.0));
            pixel.taken += 1;
        }
        pixel
    }

    /// Without an expectation, in a picture of this mean.
    fn blank(limit: f64, mean: f64) -> Adaptive {
        let mut moments = Moments::default();
        moments.add(mean);
        Adaptive::new(limit, None, Trial::new([6, 6], 2, &[Spread::of(&moments); 4]))
    }

    #[test]
    fn a_pixel_ends_only_at_a_check_with_a_small_error() {
        let alternating =
            |count: usize| pixel(&(0..count).map(|i| if i % 2 == 0 { 0.9 } else { 1.1 }).collect::<Vec<_>>());
        // 16 samples that are 0.1 off: an error of 0.1 / sqrt(15), raised by half for caution; the empty expectation
        // counts as one sample.
        let error = 0.1 / 15f64.sqrt() * 1.5 * (16.0 / 17.0_f64).sqrt();
        for (limit, is_done) in [(0.99 * error, false), (1.01 * error, true)] {
            assert_eq!(blank(limit, 0.0).is_done(3, 2, &alternating(16)), is_done, "{limit}");
        }
        let lax = blank(1.0, 0.0);
        let looks: Vec<usize> = (1..200).filter(|&count| lax.is_done(3, 2, &alternating(count))).collect();
        assert_eq!(looks, [16, 24, 32, 48, 64, 96, 128, 192]);
        let patient = Adaptive { min_spp: 50, ..lax };
        let looks: Vec<usize> =
            (1..200).filter(|&count| patient.is_done(3, 2, &alternating(count))).collect();
        assert_eq!(looks, [50, 64, 96, 128, 192]);
        let mut next = vec![patient.next_look(0)];
        while next.len() < 5 {
            next.push(patient.next_look(next[next.len() - 1]));
        }
        assert_eq!(next, [50, 64, 96, 128, 192]);
        assert_eq!((next_step(3 << 30), next_step(u32::MAX)), (u32::MAX, u32::MAX));
    }

    #[test]
    fn dark_pixels_are_measured_against_the_picture() {
        let dark = pixel(&[0.0, 0.0, 0.0, 0.01].repeat(4));
        assert!(!blank(0.1, 0.0).is_done(3, 2, &dark));
        assert!(blank(0.1, 1.0).is_done(3, 2, &dark));
        assert!(blank(0.1, 0.0).is_done(3, 2, &pixel(&[0.0; 16])));
        let expected = blank(0.1, 0.0).expected(3, 2, &dark, 1 << 14);
        assert!(expected > 100.0 && expected < 1000.0, "{expected}");
        assert_eq!(blank(0.1, 0.0).expected(3, 2, &pixel(&[1.0, 2.0]), 5), 5.0);
    }

    #[test]
    fn black_pixels_go_on_where_rare_light_is_to_be_expected() {
        // One sample in 4096 is bright, anywhere in the left half of the picture; the right half is lit evenly.
        let spreads: Vec<Spread> = (0..64 * 32)
            .map(|i| {
                let (x, y) = (i % 64, i / 64);
                let bright = x < 32 && (7 * x + 13 * y) % 64 == 5;
                let mut moments = Moments::default();
                (0..64).for_each(|k| {
                    moments.add(match (x < 32, bright && k == 9) {
                        (true, true) => 400.0,
                        (true, false) => 0.0,
                        (false, _) => 0.1 + 0.002 * f64::from(k % 2),
                    });
                });
                Spread::of(&moments)
            })
            .collect();
        let adaptive = Adaptive::new(0.05, Some(16), Trial::new([640, 320], 64, &spreads));
        for (x, most) in [(40, 100_000), (600, 64)] {
            let value = if x < 320 { 0.0 } else { 0.1 };
            let needed = (4..24).map(|i| 1_usize << i).find(|&count| {
                let mut pixel = pixel(&[value; 16]);
                let (mut all, rest) = (pixel, count / 16);
                (1..rest).for_each(|_| all.merge(&pixel));
                pixel = all;
                adaptive.is_done(x, 100, &pixel)
            });
            let needed = needed.unwrap_or(usize::MAX);
            assert_eq!(needed <= most, x > 320, "{x}: {needed}");
        }
    }
}
