//! Adaptive sampling: when a pixel has samples enough.

use crate::film::{Pixel, Tile};

/// Ends the sampling of each pixel where its noise is low enough.
///
/// The error of a pixel is estimated from its own samples and from what a trial of the whole picture says of its neighbourhood
/// ([`Expectation`]): a pixel that has not met rare light yet knows nothing of it. It looks at fixed numbers of samples, and the trial is
/// the same for every crop, so that the picture does not depend on crops, threads and interruptions. Pixels that end early are, in the
/// mean, those whose samples happen to be alike, so the estimate of their error is raised by what it may be wrong.
#[derive(Clone, Debug)]
pub(crate) struct Adaptive {
    /// [`crate::Stop::noise`].
    limit: f64,
    /// Added to the luminance of a pixel.
    floor: f64,
    trial: Trial,
}

/// Samples of a pixel before its noise is looked at.
const LEAST: u32 = 16;
/// How much an estimate of n samples is raised, times √n.
const CAUTION: f64 = 2.0;
/// The share of the picture's mean luminance that is added to that of each pixel, so that black pixels count for little.
pub(crate) const FLOOR: f64 = 0.1;
/// Pixels along the longer side of the trial picture, and samples of each.
pub(crate) const TRIAL_SIDE: f64 = 64.0;
pub(crate) const TRIAL_SPP: u32 = 64;

/// Sums over the samples of a pixel of the trial: how far their luminances are from their mean.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spread {
    samples: f64,
    /// Samples less one, as the variance counts them.
    freedom: f64,
    squares: f64,
    fourths: f64,
}

/// The variance of samples in a part of the picture, and how many of them it takes to know it: those of rare light have a kurtosis of
/// about one over their frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Expectation {
    variance: f64,
    kurtosis: f64,
}

/// A small picture of the whole film that was taken beforehand: its mean luminance, and what to expect of the samples in each of its
/// pixels.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    mean: f64,
    /// Pixels of the picture for each of the trial, along both axes.
    scale: [f64; 2],
    width: usize,
    height: usize,
    expectations: Vec<Expectation>,
}

impl Spread {
    /// Of the luminances of a pixel's samples.
    pub(crate) fn of(luminances: &[f64]) -> Self {
        let count = luminances.len() as f64;
        let mean = luminances.iter().sum::<f64>() / count.max(1.0);
        let powers = |power| luminances.iter().map(|l| (l - mean).powi(power)).sum();
        Self { samples: count, freedom: (count - 1.0).max(0.0), squares: powers(2), fourths: powers(4) }
    }

    fn and(self, other: &Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            freedom: self.freedom + other.freedom,
            squares: self.squares + other.squares,
            fourths: self.fourths + other.fourths,
        }
    }

    /// What these samples say alone.
    fn expectation(&self) -> Expectation {
        if self.freedom <= 0.0 || self.squares <= 0.0 {
            return Expectation { variance: 0.0, kurtosis: 1.0 };
        }
        let variance = self.squares / self.freedom;
        Expectation { variance, kurtosis: (self.fourths / self.samples / (variance * variance)).max(1.0) }
    }

    /// What these samples say, which are a part of those that led to `wider`.
    fn within(&self, wider: Expectation) -> Expectation {
        let own = self.expectation();
        let (n, k) = (self.samples, wider.kurtosis);
        let mean = |own: f64, wider: f64| (n * own + k * wider) / (n + k);
        Expectation {
            variance: mean(own.variance, wider.variance),
            kurtosis: mean(own.kurtosis, wider.kurtosis),
        }
    }
}

impl Trial {
    /// From the spreads of the pixels of a small picture, row by row, for a picture of `size` pixels.
    pub(crate) fn new(mean: f64, size: [u32; 2], width: usize, spreads: &[Spread]) -> Self {
        let height = spreads.len() / width;
        let mut trial = Self {
            mean,
            scale: [f64::from(size[0]) / width as f64, f64::from(size[1]) / height as f64],
            width,
            height,
            expectations: vec![Expectation::default(); spreads.len()],
        };
        let whole = trial.spread_of(spreads, [0, 0], [width, height]).expectation();
        trial.refine(spreads, [0, 0], [width, height], whole);
        trial
    }

    fn spread_of(&self, spreads: &[Spread], from: [usize; 2], to: [usize; 2]) -> Spread {
        let rows = (from[1]..to[1]).map(|y| &spreads[y * self.width + from[0]..y * self.width + to[0]]);
        rows.flatten().fold(Spread::default(), Spread::and)
    }

    /// Halves a part of the picture until it is two pixels wide: each half believes its own samples as far as there are enough of them,
    /// and the rest what is expected of the whole.
    fn refine(&mut self, spreads: &[Spread], from: [usize; 2], to: [usize; 2], expected: Expectation) {
        let size = [to[0] - from[0], to[1] - from[1]];
        let axis = usize::from(size[1] > size[0]);
        if size[axis] <= 2 {
            for y in from[1]..to[1] {
                self.expectations[y * self.width + from[0]..y * self.width + to[0]].fill(expected);
            }
            return;
        }
        let middle = from[axis] + size[axis] / 2;
        let (mut first_end, mut second_start) = (to, from);
        (first_end[axis], second_start[axis]) = (middle, middle);
        for (from, to) in [(from, first_end), (second_start, to)] {
            let expected = self.spread_of(spreads, from, to).within(expected);
            self.refine(spreads, from, to, expected);
        }
    }

    fn at(&self, x: u32, y: u32) -> Expectation {
        let place = |pixel: u32, axis: usize, count: usize| {
            ((f64::from(pixel) + 0.5) / self.scale[axis]).min(count as f64 - 1.0) as usize
        };
        self.expectations[place(y, 1, self.height) * self.width + place(x, 0, self.width)]
    }
}

impl Adaptive {
    /// For a limit of noise, and a trial of the whole picture.
    pub(crate) fn new(limit: f64, trial: Trial) -> Self {
        Self { limit, floor: FLOOR * trial.mean.max(0.0), trial }
    }

    /// Whether a pixel needs no more samples.
    pub(crate) fn is_done(&self, x: u32, y: u32, pixel: &Pixel) -> bool {
        is_looked_at(pixel.taken) && self.share_of_limit(x, y, pixel).is_some_and(|share| share <= 1.0)
    }

    /// The error of a pixel, of its limit; `None` where too few samples say.
    fn share_of_limit(&self, x: u32, y: u32, pixel: &Pixel) -> Option<f64> {
        let (luminance, error) = pixel.luminance_with_error()?;
        let n = f64::from(pixel.samples);
        let Expectation { variance, kurtosis } = self.trial.at(x, y);
        let variance = (n * error * error * n + kurtosis * variance) / (n + kurtosis);
        let cautious = (variance / n).sqrt() * (1.0 + CAUTION / n.sqrt());
        let allowed = self.limit * (luminance.max(0.0) + self.floor);
        // A black pixel of a black picture is done.
        Some(if cautious == 0.0 { 0.0 } else { cautious / allowed })
    }

    /// How many samples a pixel will have in the end, as far as one can tell, but no more than `most`.
    pub(crate) fn expected(&self, x: u32, y: u32, pixel: &Pixel, most: u32) -> f64 {
        let taken = f64::from(pixel.taken);
        if self.is_done(x, y, pixel) {
            return taken;
        }
        // Noise falls with the square root of the number of samples.
        let share = self.share_of_limit(x, y, pixel).unwrap_or(1.0);
        (taken * share * share).max(taken).max(f64::from(LEAST)).min(f64::from(most))
    }
}

/// Whether pixels are looked at with so many samples: 16, 24, 32, 48, 64, 96 and so on, after which a Sobol sequence is even.
fn is_looked_at(taken: u32) -> bool {
    let is_step = taken.is_power_of_two() || (taken.is_multiple_of(3) && (taken / 3).is_power_of_two());
    taken >= LEAST && is_step
}

/// The next number of samples at which a pixel with `taken` samples is looked at.
pub(crate) fn next_look(taken: u32) -> u32 {
    (taken.saturating_add(1)..=u32::MAX).find(|&count| is_looked_at(count)).unwrap_or(u32::MAX)
}

/// The fewest samples of the pixels of a tile that need more; `None` where none does.
pub(crate) fn least_wanted(tile: &Tile, adaptive: Option<&Adaptive>) -> Option<u32> {
    let wants = |&((x, y), pixel): &((u32, u32), &Pixel)| {
        adaptive.is_none_or(|adaptive| !adaptive.is_done(x, y, pixel))
    };
    tile.bounds().pixels().zip(tile.pixels()).filter(wants).map(|(_, pixel)| pixel.taken).min()
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

    /// Nothing is expected, in a picture of this mean.
    fn blank(limit: f64, mean: f64) -> Adaptive {
        Adaptive::new(limit, Trial::new(mean, [6, 6], 2, &[Spread::default(); 4]))
    }

    #[test]
    fn a_pixel_is_done_where_its_own_error_is_small_and_only_at_a_look() {
        let alternating =
            |count: usize| pixel(&(0..count).map(|i| if i % 2 == 0 { 0.9 } else { 1.1 }).collect::<Vec<_>>());
        // 16 samples that are 0.1 off: an error of 0.1 / sqrt(15), half as much again for caution; nothing that is expected counts for
        // one sample.
        let error = 0.1 / 15f64.sqrt() * 1.5 * (16.0 / 17.0_f64).sqrt();
        for (limit, is_done) in [(0.99 * error, false), (1.01 * error, true)] {
            assert_eq!(blank(limit, 0.0).is_done(3, 2, &alternating(16)), is_done, "{limit}");
        }
        let lax = blank(1.0, 0.0);
        let looks: Vec<usize> = (1..200).filter(|&count| lax.is_done(3, 2, &alternating(count))).collect();
        assert_eq!(looks, [16, 24, 32, 48, 64, 96, 128, 192]);
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
                let luminances: Vec<f64> = (0..64)
                    .map(|k| match (x < 32, bright && k == 9) {
                        (true, true) => 400.0,
                        (true, false) => 0.0,
                        (false, _) => 0.1 + 0.002 * f64::from(k % 2),
                    })
                    .collect();
                Spread::of(&luminances)
            })
            .collect();
        let adaptive = Adaptive::new(0.05, Trial::new(0.1, [640, 320], 64, &spreads));
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
