//! The denoiser's statistics of the samples of one pixel.

use std::ops::Range;

use crate::film::FeatureSample;

/// Sums for a ratio of two means over samples: its value, its variance, and its value for even and for odd samples. The
/// numerator has three channels, the denominator `UNDER` of them: three, or one for all.
///
/// Single precision is enough, because all of it is compared with noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatioSums<const UNDER: usize> {
    /// Σ numerator.
    over: [f32; 3],
    /// Σ denominator.
    under: [f32; UNDER],
    /// Σ numerator of the odd samples.
    odd_over: [f32; 3],
    /// Σ denominator of the odd samples.
    odd_under: [f32; UNDER],
    /// Σ numerator².
    over_squares: [f32; 3],
    /// Σ numerator × denominator.
    products: [f32; 3],
    /// Σ denominator².
    under_squares: [f32; UNDER],
}

impl<const UNDER: usize> Default for RatioSums<UNDER> {
    fn default() -> Self {
        let (over, under) = ([0.0; 3], [0.0; UNDER]);
        Self {
            over,
            under,
            odd_over: over,
            odd_under: under,
            over_squares: over,
            products: over,
            under_squares: under,
        }
    }
}

impl<const UNDER: usize> RatioSums<UNDER> {
    /// Adds a sample.
    pub fn add(&mut self, over: [f32; 3], under: [f32; UNDER], is_odd: bool) {
        for c in 0..3 {
            self.over[c] += over[c];
            self.over_squares[c] += over[c] * over[c];
            self.products[c] += over[c] * under[Self::under(c)];
            if is_odd {
                self.odd_over[c] += over[c];
            }
        }
        for (c, under) in under.into_iter().enumerate() {
            self.under[c] += under;
            self.under_squares[c] += under * under;
            if is_odd {
                self.odd_under[c] += under;
            }
        }
    }

    /// The index of a channel's denominator.
    fn under(c: usize) -> usize {
        c.min(UNDER - 1)
    }

    /// The mean denominator.
    pub fn denominator(&self, c: usize, count: Count) -> f32 {
        self.under[Self::under(c)] / count.weight
    }

    /// The ratio of the means, with a mean denominator of at least `least`.
    pub fn value(&self, c: usize, count: Count, least: f32) -> f32 {
        self.over[c] / self.under[Self::under(c)].max(least * count.weight)
    }

    /// Whether the even samples (0) or the odd ones (1) have a numerator or a denominator; a single sample counts for
    /// both.
    pub fn is_known(&self, half: usize, count: Count) -> bool {
        let is_odd = half == 1 && count.samples > 1;
        let sum = |all: f32, odd: f32| if is_odd { odd } else { all - odd };
        (0..3).any(|c| {
            sum(self.over[c], self.odd_over[c]) != 0.0
                || sum(self.under[Self::under(c)], self.odd_under[Self::under(c)]) != 0.0
        })
    }

    /// Whether there is neither numerator nor denominator: the pixel does not take part in the ratio.
    pub fn is_absent(&self, c: usize) -> bool {
        self.over[c] == 0.0 && self.under[Self::under(c)] == 0.0
    }

    /// The ratio of the even samples and that of the odd ones; that of all samples if there are none of a kind.
    pub fn halves(&self, c: usize, count: Count, least: f32) -> [f32; 2] {
        let odd = count.samples / 2;
        if odd == 0 {
            return [self.value(c, count, least); 2];
        }
        let least_odd = least * count.weight * odd as f32 / count.samples as f32;
        let least_even = least * count.weight - least_odd;
        let even_under = (self.under[Self::under(c)] - self.odd_under[Self::under(c)]).max(least_even);
        [
            (self.over[c] - self.odd_over[c]) / even_under,
            self.odd_over[c] / self.odd_under[Self::under(c)].max(least_odd),
        ]
    }

    /// The variance of the ratio, as if samples were independent (W. Cochran, "Sampling Techniques", 1977, 6.4). `None`
    /// for fewer than two samples.
    pub fn variance(&self, c: usize, count: Count, least: f32) -> Option<f32> {
        if count.samples < 2 {
            return None;
        }
        let n = count.samples as f32;
        let under = self.under[Self::under(c)].max(least * count.weight);
        // A denominator that was raised to `least` does not vary with the samples.
        let squares = if under > self.under[Self::under(c)] {
            self.over_squares[c] - self.over[c] * self.over[c] / n
        } else {
            let ratio = self.over[c] / under;
            self.over_squares[c] - 2.0 * ratio * self.products[c]
                + ratio * ratio * self.under_squares[Self::under(c)]
        };
        Some(squares.max(0.0) * n / (n - 1.0) / (under * under))
    }
}

/// The samples that were added.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// Their number.
    pub samples: u32,
    /// Σ weight.
    pub weight: f32,
}

/// What distinguishes surfaces, as numbers: albedo, normal, depth.
pub const FEATURES: usize = 7;

/// The groups of features that are compared as one: albedo, normal, depth.
pub const GROUPS: [Range<usize>; 3] = [0..3, 3..6, 6..FEATURES];

/// Sums over the samples of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuideSums {
    /// Light over reflectance.
    pub light: RatioSums<3>,
    /// The shadow on a shadow catcher over the pixel's share of it, in a transparent picture.
    pub shadow: RatioSums<1>,
    /// Features of the hits.
    pub surfaces: GuideSurfaceSums,
    /// Number of samples.
    pub count: Count,
}

/// Sums over the hits of the samples of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuideSurfaceSums {
    features: [f32; FEATURES],
    /// Σ of the squares of the features of each group.
    group_squares: [f32; GROUPS.len()],
}

impl GuideSurfaceSums {
    /// Adds the hit of a sample; `None` for a miss.
    pub fn add(&mut self, sample: Option<&FeatureSample>) {
        let Some(FeatureSample { albedo, normal, depth, .. }) = sample else { return };
        let values = [albedo.r, albedo.g, albedo.b, normal[0], normal[1], normal[2], *depth];
        self.features.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        for (squares, group) in self.group_squares.iter_mut().zip(GROUPS) {
            *squares += values[group].iter().map(|value| value * value).sum::<f32>();
        }
    }
}

impl Count {
    /// Counts a sample of this weight.
    pub fn add(&mut self, weight: f32) {
        self.samples += 1;
        self.weight += weight;
    }
}

/// Numbers of [`GuideSums`].
pub(crate) const WORDS: usize = 21 + 15 + FEATURES + GROUPS.len() + 2;

impl<const UNDER: usize> RatioSums<UNDER> {
    fn numbers(&mut self) -> impl Iterator<Item = &mut f32> {
        let Self { over, under, odd_over, odd_under, over_squares, products, under_squares } = self;
        let overs = [over, odd_over, over_squares, products].into_iter().flatten();
        overs.chain([under, odd_under, under_squares].into_iter().flatten())
    }
}

impl GuideSums {
    fn numbers(&mut self) -> impl Iterator<Item = &mut f32> {
        let ratios = self.light.numbers().chain(self.shadow.numbers());
        let GuideSurfaceSums { features, group_squares } = &mut self.surfaces;
        let features = features.iter_mut().chain(group_squares);
        ratios.chain(features).chain(std::iter::once(&mut self.count.weight))
    }

    /// Its numbers, as bits.
    pub(crate) fn words(&self) -> [u32; WORDS] {
        let mut words = [self.count.samples; WORDS];
        let mut own = *self;
        words.iter_mut().zip(own.numbers()).for_each(|(word, number)| *word = number.to_bits());
        words
    }

    /// The inverse of the above.
    pub(crate) fn of_words(words: [u32; WORDS]) -> Self {
        let mut own = Self::default();
        own.numbers().zip(words).for_each(|(number, word)| *number = f32::from_bits(word));
        own.count.samples = words[WORDS - 1];
        own
    }

    /// The mean of a feature.
    pub fn feature(&self, i: usize) -> f32 {
        self.surfaces.features[i] / self.count.samples.max(1) as f32
    }

    /// The variance of the means of a group, summed over its features, as if samples were independent; 0 for fewer than
    /// two samples.
    pub fn group_variance(&self, group: usize) -> f32 {
        if self.count.samples < 2 {
            return 0.0;
        }
        let n = self.count.samples as f32;
        let GuideSurfaceSums { features, group_squares } = &self.surfaces;
        let means: f32 = GROUPS[group].clone().map(|i| (features[i] / n) * (features[i] / n)).sum();
        (group_squares[group] / n - means).max(0.0) / (n - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;

    use super::*;

    #[test]
    fn a_ratio_has_the_variance_of_what_its_parts_do_not_share() {
        let (count, one) = (Count { samples: 4, weight: 4.0 }, Count { samples: 1, weight: 1.0 });
        let mut sums = RatioSums::default();
        // The numerator is 2.5 times the denominator, plus 0.5 or less 0.5.
        for (i, under) in [0.5_f32, 1.0, 0.25, 0.75].into_iter().enumerate() {
            let over = 2.5 * under + if i < 2 { 0.5 } else { -0.5 };
            sums.add([0.0, over, 0.0], [1.0, under, 1.0], i % 2 == 1);
        }
        assert!((sums.value(1, count, 0.01) - 2.5).abs() < 1e-6);
        // 4 × 0.25 × 4 / 3 / 2.5²
        let variance = sums.variance(1, count, 0.01).unwrap();
        assert!((variance - 0.213_333).abs() < 1e-5, "{variance}");
        let [even, odd] = sums.halves(1, count, 0.01);
        assert!((even - 2.5).abs() < 1e-6 && (odd - 2.5).abs() < 1e-6, "{even} {odd}");
        assert_eq!((sums.value(0, count, 0.01), sums.variance(0, count, 0.01)), (0.0, Some(0.0)));
        assert_eq!(RatioSums::<3>::default().variance(0, one, 0.01), None);
    }

    #[test]
    fn features_have_the_variance_of_their_mean() {
        let mut sums = GuideSums::default();
        for depth in [3.0, 5.0] {
            let sample = FeatureSample { albedo: Rgb::WHITE, normal: [0.0, 1.0, 0.0], depth, uv: [0.0; 2] };
            sums.surfaces.add(Some(&sample));
            sums.count.add(1.0);
        }
        assert_eq!((sums.feature(6), sums.group_variance(2)), (4.0, 1.0));
        assert_eq!((sums.feature(4), sums.group_variance(1)), (1.0, 0.0));
        let tilted = FeatureSample { albedo: Rgb::WHITE, normal: [1.0, 0.0, 0.0], depth: 4.0, uv: [0.0; 2] };
        for _ in 0..2 {
            sums.surfaces.add(Some(&tilted));
            sums.count.add(1.0);
        }
        // Each of two components is 0 or 1 by halves: a variance of 1/4, and a third of that for the mean.
        assert!((sums.group_variance(1) - 2.0 / 12.0).abs() < 1e-6);
    }
}
