//! Expected statistics of the samples of a pixel, from those of its neighbourhood.

use crate::film::Pixel;

/// The share of the picture's mean luminance that is added to that of each pixel, so that black pixels count for
/// little.
pub(crate) const FLOOR: f64 = 0.1;

/// The number of samples of this variance whose mean has an error of `allowed`.
pub(crate) fn needed(variance: f64, allowed: f64) -> f64 {
    if variance > 0.0 { variance / (allowed * allowed) } else { 0.0 }
}

/// Sums over the luminances of samples. Those of several pixels add up.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spread {
    /// Number of samples.
    pub(crate) samples: f64,
    sum: f64,
    /// Samples, less one for each pixel whose mean was subtracted.
    freedom: f64,
    /// Σ (luminance − mean of its pixel)².
    squares: f64,
    /// Σ (luminance − mean of its pixel)⁴, and its bias.
    fourths: f64,
    excess: f64,
}

/// Statistics of a pixel: the number of its samples, their mean luminance, and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Known {
    pub(crate) samples: f64,
    pub(crate) mean: f64,
    pub(crate) error: f64,
}

/// The samples in a part of the picture: their mean, their variance, and the number of samples that a reliable variance
/// needs. Rare light has a kurtosis of about one over its frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Expectation {
    pub(crate) mean: f64,
    pub(crate) variance: f64,
    pub(crate) kurtosis: f64,
}

/// The central moments of the luminances of a pixel, sample by sample (Pébay, "Formulas for robust, one-pass parallel
/// computation of covariances and arbitrary-order statistical moments", Sandia report SAND2008-6212, 2008).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moments {
    count: f64,
    mean: f64,
    second: f64,
    third: f64,
    fourth: f64,
}

impl Moments {
    pub(crate) fn add(&mut self, luminance: f64) {
        let before = self.count;
        self.count += 1.0;
        let n = self.count;
        let delta = luminance - self.mean;
        let step = delta / n;
        let term = delta * step * before;
        self.mean += step;
        self.fourth += term * step * step * (n * n - 3.0 * n + 3.0) + 6.0 * step * step * self.second
            - 4.0 * step * self.third;
        self.third += term * step * (n - 2.0) - 3.0 * step * self.second;
        self.second += term;
    }
}

/// Times the kurtosis: samples that a mean needs.
const KNOWN: f64 = 8.0;

impl Known {
    /// `None` for fewer than two samples.
    pub(crate) fn of(pixel: &Pixel) -> Option<Self> {
        let (mean, error) = pixel.luminance_with_error()?;
        Some(Self { samples: f64::from(pixel.samples), mean, error })
    }
}

impl Spread {
    /// Of a pixel with all samples known.
    pub(crate) fn of(moments: &Moments) -> Self {
        Self {
            samples: moments.count,
            sum: moments.mean * moments.count,
            freedom: (moments.count - 1.0).max(0.0),
            squares: moments.second.max(0.0),
            fourths: moments.fourth.max(0.0),
            excess: moments.count,
        }
    }

    /// Of a pixel with known mean and variance. The spread of the variances of n samples between pixels gives the
    /// kurtosis κ: the mean of their squares is σ⁴ (1 + (κ − 1) / n).
    pub(crate) fn of_pixel(Known { samples: n, mean, error }: Known) -> Self {
        let variance = error * error * n;
        Self {
            samples: n,
            sum: mean * n,
            freedom: n - 1.0,
            squares: variance * (n - 1.0),
            fourths: (n * variance).powi(2),
            excess: n * n,
        }
    }

    pub(crate) fn and(self, other: &Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            sum: self.sum + other.sum,
            freedom: self.freedom + other.freedom,
            squares: self.squares + other.squares,
            fourths: self.fourths + other.fourths,
            excess: self.excess + other.excess,
        }
    }

    /// The estimate of these samples alone.
    pub(crate) fn expectation(&self) -> Expectation {
        let mean = if self.samples > 0.0 { self.sum / self.samples } else { 0.0 };
        if self.freedom <= 0.0 || self.squares <= 0.0 {
            return Expectation { mean, variance: 0.0, kurtosis: 1.0 };
        }
        let variance = self.squares / self.freedom;
        let kurtosis = (self.fourths / (variance * variance) - self.excess) / self.samples + 1.0;
        Expectation { mean, variance, kurtosis: kurtosis.max(1.0) }
    }

    /// The estimate of these samples, which are a part of those behind `wider`.
    pub(crate) fn within(&self, wider: Expectation) -> Expectation {
        let own = self.expectation();
        let (n, k) = (self.samples, wider.kurtosis);
        let mean = |own: f64, wider: f64| if n + k > 0.0 { (n * own + k * wider) / (n + k) } else { 0.0 };
        // A few samples of rare light are either very bright or dark: their mean is not used.
        let is_known = n >= KNOWN * k && n > 0.0;
        Expectation {
            mean: if is_known { own.mean } else { wider.mean },
            variance: mean(own.variance, wider.variance),
            kurtosis: mean(own.kurtosis, wider.kurtosis),
        }
    }
}

/// A grid over a picture, with expected statistics in each cell.
#[derive(Clone, Debug)]
pub(crate) struct Neighbourhoods {
    width: usize,
    height: usize,
    /// Pixels of the picture for each cell, along both axes.
    scale: [f64; 2],
    expectations: Vec<Expectation>,
}

impl Neighbourhoods {
    /// From the spreads of the cells, row by row, for a picture of `size` pixels.
    pub(crate) fn new(size: [u32; 2], width: usize, spreads: &[Spread]) -> Self {
        let height = spreads.len() / width;
        let mut all = Self {
            width,
            height,
            scale: [f64::from(size[0]) / width as f64, f64::from(size[1]) / height as f64],
            expectations: vec![Expectation::default(); spreads.len()],
        };
        let whole = all.spread_of(spreads, [0, 0], [width, height]).expectation();
        all.refine(spreads, [0, 0], [width, height], whole);
        all
    }

    fn spread_of(&self, spreads: &[Spread], from: [usize; 2], to: [usize; 2]) -> Spread {
        let rows = (from[1]..to[1]).map(|y| &spreads[y * self.width + from[0]..y * self.width + to[0]]);
        rows.flatten().fold(Spread::default(), Spread::and)
    }

    /// Halves a part of the picture until it is two cells wide. Each half weights its own samples by their number
    /// against the expectation of the whole.
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

    /// The expected statistics of the samples of a pixel.
    pub(crate) fn at(&self, x: u32, y: u32) -> Expectation {
        let place = |pixel: u32, axis: usize, count: usize| {
            ((f64::from(pixel) + 0.5) / self.scale[axis]).min(count as f64 - 1.0) as usize
        };
        self.expectations[place(y, 1, self.height) * self.width + place(x, 0, self.width)]
    }

    /// The expected statistics of all cells.
    pub(crate) fn all(&self) -> &[Expectation] {
        &self.expectations
    }
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;
    use lumbre_math::random::RandomStream;

    use super::*;

    #[test]
    fn moments_are_those_of_all_samples() {
        let values = [0.0, 2.0, 3.5, 0.25, 9.0, 9.0, 1.0];
        let mut moments = Moments::default();
        values.iter().for_each(|&value| moments.add(value));
        let mean = values.iter().sum::<f64>() / 7.0;
        let power = |p| values.iter().map(|v| (v - mean).powi(p)).sum::<f64>();
        for (found, expected) in [
            (moments.mean, mean),
            (moments.second, power(2)),
            (moments.third, power(3)),
            (moments.fourth, power(4)),
        ] {
            assert!((found - expected).abs() < 1e-12 * expected.abs(), "{found} {expected}");
        }
    }

    #[test]
    fn pixels_of_which_the_variance_is_known_tell_the_kurtosis() {
        // Light in one of 50 samples: a kurtosis of (1 - 3pq) / pq = 48.
        let mut random = RandomStream::new(3);
        let (mut known, mut guessed) = (Spread::default(), Spread::default());
        for _ in 0..4000 {
            let (mut moments, mut pixel) = (Moments::default(), Pixel::default());
            for _ in 0..32 {
                let value = if random.next_f64() < 0.02 { 10.0 } else { 0.0 };
                moments.add(value);
                assert!(pixel.add(Rgb::splat(value as f32), 1.0, 1.0));
            }
            known = known.and(&Spread::of(&moments));
            guessed = guessed.and(&Spread::of_pixel(Known::of(&pixel).unwrap()));
        }
        for spread in [known, guessed] {
            let Expectation { mean, variance, kurtosis } = spread.expectation();
            assert!((mean - 0.2).abs() < 0.02 && (variance - 1.96).abs() < 0.2, "{mean} {variance}");
            assert!((kurtosis - 48.0).abs() < 6.0, "{kurtosis}");
        }
    }
}
