//! The sums of one pixel.

use lumbre_image::Rgb;

use crate::film::ExactSum;

/// Weighted sums of the samples of one pixel, independent of their order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Σ weight × colour.
    pub sum: [ExactSum; 3],
    /// Σ weight × coverage.
    pub covered: ExactSum,
    /// Σ weight.
    pub weight: ExactSum,
    /// Σ luminance, without weights.
    pub luminance: ExactSum,
    /// Σ luminance², without weights.
    pub luminance_squares: ExactSum,
    /// How many samples were added.
    pub samples: u32,
    /// Number of samples taken, including dropped ones.
    pub taken: u32,
}

/// The largest component of a sample: half of what a sum holds, for filter weights above 1.
pub(crate) const MAX_SAMPLE: f64 = ExactSum::LIMIT / 2.0;

/// Luminance above which noise is not distinguished.
pub(crate) const MAX_LUMINANCE: f64 = 1e6;

impl Pixel {
    /// Adds a sample, whose colour is premultiplied by its coverage. Returns false and adds nothing if it is not
    /// finite. A sample brighter than the film's maximum is scaled down to it, keeping its hue.
    pub fn add(&mut self, colour: Rgb, coverage: f32, weight: f64) -> bool {
        let most = colour.to_array().into_iter().map(|channel| f64::from(channel.abs())).fold(0.0, f64::max);
        let scale = if most > MAX_SAMPLE { weight * (MAX_SAMPLE / most) } else { weight };
        let weighted = colour.to_array().map(|channel| scale * f64::from(channel));
        let covered = weight * f64::from(coverage);
        if !colour.is_finite() || ![weight, covered].into_iter().chain(weighted).all(ExactSum::holds) {
            return false;
        }
        for (sum, number) in self.sum.iter_mut().zip(weighted) {
            sum.add(number);
        }
        self.covered.add(covered);
        self.weight.add(weight);
        let luminance = f64::from(colour.luminance()).clamp(-MAX_LUMINANCE, MAX_LUMINANCE);
        self.luminance.add(luminance);
        self.luminance_squares.add(luminance * luminance);
        self.samples += 1;
        true
    }

    /// Adds the samples of another.
    pub fn merge(&mut self, other: &Self) {
        self.sum.iter_mut().zip(other.sum).for_each(|(sum, other)| sum.merge(other));
        self.covered.merge(other.covered);
        self.weight.merge(other.weight);
        self.luminance.merge(other.luminance);
        self.luminance_squares.merge(other.luminance_squares);
        self.samples += other.samples;
        self.taken += other.taken;
    }

    /// The mean of the samples; black without any.
    pub fn colour(&self) -> Rgb {
        mean(self.sum, self.weight)
    }

    /// The mean coverage, in [0, 1]; 0 without a sample.
    pub fn coverage(&self) -> f32 {
        let (covered, weight) = (self.covered.value(), self.weight.value());
        if weight == 0.0 { 0.0 } else { (covered / weight).clamp(0.0, 1.0) as f32 }
    }

    /// The mean luminance, and its standard error as if samples were independent (those of a low-discrepancy sampler
    /// are better). `None` for fewer than two samples.
    pub fn luminance_with_error(&self) -> Option<(f64, f64)> {
        let n = f64::from(self.samples);
        if self.samples < 2 {
            return None;
        }
        let mean = self.luminance.value() / n;
        let variance = (self.luminance_squares.value() / n - mean * mean).max(0.0) * n / (n - 1.0);
        Some((mean, (variance / n).sqrt()))
    }
}

/// The coverage of red and of blue, minus that of green: weighted sums of the samples of one pixel. Usually exactly
/// zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tint {
    /// Σ weight × (red − green).
    pub red: ExactSum,
    /// Σ weight × (blue − green).
    pub blue: ExactSum,
}

impl Tint {
    /// Adds the coverage of a sample.
    pub fn add(&mut self, coverage: Rgb, weight: f64) {
        self.red.add(weight * f64::from(coverage.r - coverage.g));
        self.blue.add(weight * f64::from(coverage.b - coverage.g));
    }

    /// Adds the samples of another.
    pub fn merge(&mut self, other: &Self) {
        self.red.merge(other.red);
        self.blue.merge(other.blue);
    }

    /// The mean coverage of each channel in the pixel of the same samples, in [0, 1]; 0 without a sample.
    pub fn coverage(&self, of: &Pixel) -> Rgb {
        let weight = of.weight.value();
        if weight == 0.0 {
            return Rgb::BLACK;
        }
        let [red, blue] = [self.red.value(), self.blue.value()];
        let green = of.covered.value() - (red + blue) / 3.0;
        let share = |covered: f64| (covered / weight).clamp(0.0, 1.0) as f32;
        Rgb::new(share(green + red), share(green), share(green + blue))
    }
}

/// The first hit of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureSample {
    /// Reflectance.
    pub albedo: Rgb,
    /// Shading normal in world space.
    pub normal: [f32; 3],
    /// Distance along the camera's axis.
    pub depth: f32,
    /// Surface parameters.
    pub uv: [f32; 2],
}

/// Weighted sums of the features of one pixel, independent of their order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeatureSums {
    /// Σ weight × albedo.
    pub albedo: [ExactSum; 3],
    /// Σ weight × normal.
    pub normal: [ExactSum; 3],
    /// Σ weight × depth, in a unit that the film knows.
    pub depth: ExactSum,
    /// Σ weight × uv.
    pub uv: [ExactSum; 2],
    /// Σ weight of samples that met something.
    pub met: ExactSum,
    /// Σ weight of all samples.
    pub weight: ExactSum,
}

impl FeatureSums {
    /// Adds a sample, with depth in units of `depth_unit`; `None` met nothing.
    pub fn add(&mut self, sample: Option<&FeatureSample>, weight: f64, depth_unit: f64) {
        self.weight.add(weight);
        let Some(sample) = sample else { return };
        let add = |sums: &mut [ExactSum], values: &[f32]| {
            for (sum, &value) in sums.iter_mut().zip(values) {
                sum.add(weight * f64::from(value));
            }
        };
        add(&mut self.albedo, &sample.albedo.to_array());
        add(&mut self.normal, &sample.normal);
        add(&mut self.uv, &sample.uv);
        self.depth.add(weight * (f64::from(sample.depth) / depth_unit));
        self.met.add(weight);
    }

    /// Adds the samples of another.
    pub fn merge(&mut self, other: &Self) {
        let merge = |sums: &mut [ExactSum], others: &[ExactSum]| {
            sums.iter_mut().zip(others).for_each(|(sum, &other)| sum.merge(other));
        };
        merge(&mut self.albedo, &other.albedo);
        merge(&mut self.normal, &other.normal);
        merge(&mut self.uv, &other.uv);
        self.depth.merge(other.depth);
        self.met.merge(other.met);
        self.weight.merge(other.weight);
    }

    /// The mean albedo, black without a hit.
    pub fn albedo(&self) -> Rgb {
        mean(self.albedo, self.weight)
    }

    /// The mean normal: shorter than 1 if it varies, or if some samples met nothing.
    pub fn normal(&self) -> Rgb {
        mean(self.normal, self.weight)
    }

    /// The mean depth of what was met, in the film's unit times `depth_unit`; 0 where nothing was.
    pub fn depth(&self, depth_unit: f64) -> f32 {
        let met = self.met.value();
        if met > 0.0 { (self.depth.value() / met * depth_unit) as f32 } else { 0.0 }
    }

    /// The mean surface parameters of what was met.
    pub fn uv(&self) -> [f32; 2] {
        let met = self.met.value();
        if met > 0.0 { self.uv.map(|c| (c.value() / met) as f32) } else { [0.0; 2] }
    }
}

/// Sums that can be merged.
pub(super) trait Sums {
    /// Adds the samples of another.
    fn merge(&mut self, other: &Self);
}

macro_rules! sums {
    ($($sums:ident),*) => {
        $(impl Sums for $sums {
            fn merge(&mut self, other: &Self) {
                self.merge(other);
            }
        })*
    };
}

sums!(Pixel, Tint, FeatureSums);

fn mean(sum: [ExactSum; 3], weight: ExactSum) -> Rgb {
    let weight = weight.value();
    if weight == 0.0 { Rgb::BLACK } else { sum.map(|c| (c.value() / weight) as f32).into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_the_weighted_mean_of_its_samples() {
        let mut pixel = Pixel::default();
        assert_eq!(pixel.colour(), Rgb::BLACK);
        assert_eq!(pixel.coverage(), 0.0);
        assert!(pixel.add(Rgb::new(2.0, 4.0, 8.0), 0.75, 3.0));
        assert!(pixel.add(Rgb::new(6.0, 0.0, 4.0), -0.25, 1.0));
        let before = pixel;
        for colour in [f32::NAN, f32::INFINITY] {
            assert!(!pixel.add(Rgb::new(1.0, colour, 1.0), 1.0, 1.0));
        }
        assert_eq!(pixel, before);
        assert_eq!(pixel.coverage(), 0.5);
        assert_eq!(pixel.colour(), Rgb::new(3.0, 3.0, 7.0));
    }

    #[test]
    fn what_is_brighter_than_a_sum_holds_is_as_bright_in_its_hue() {
        let most = MAX_SAMPLE as f32;
        for bright in [2.0 * most, 1e18, 1e19, f32::MAX] {
            let mut pixel = Pixel::default();
            assert!(pixel.add(Rgb::new(0.5 * bright, bright, 0.0), 1.0, 1.25));
            assert_eq!(pixel.colour(), Rgb::new(0.5 * most, most, 0.0), "{bright}");
            assert_eq!((pixel.samples, pixel.coverage()), (1, 1.0));
        }
    }

    #[test]
    fn the_standard_error_is_that_of_the_mean() {
        let mut pixel = Pixel::default();
        for value in [1.0, 2.0, 3.0, 6.0] {
            assert!(pixel.add(Rgb::splat(value), 1.0, 0.5));
        }
        let (mean, error) = pixel.luminance_with_error().unwrap();
        assert!((mean - 3.0).abs() < 1e-6);
        assert!((error - (14.0_f64 / 3.0 / 4.0).sqrt()).abs() < 1e-5, "{error}");
    }

    #[test]
    fn depth_does_not_mix_with_the_background() {
        let mut sums = FeatureSums::default();
        sums.add(None, 2.0, 8.0);
        let sample =
            FeatureSample { albedo: Rgb::WHITE, normal: [0.0, 0.0, 1.0], depth: 7.0, uv: [0.25, 0.5] };
        sums.add(Some(&sample), 2.0, 8.0);
        assert_eq!((sums.depth(8.0), sums.uv()), (7.0, [0.25, 0.5]));
        assert_eq!((sums.albedo(), sums.normal()), (Rgb::splat(0.5), Rgb::new(0.0, 0.0, 0.5)));
    }
}
