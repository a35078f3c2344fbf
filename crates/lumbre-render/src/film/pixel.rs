//! The sums of one pixel.

use lumbre_image::Rgb;

/// Weighted sums of the samples of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Σ weight × colour.
    pub sum: [f64; 3],
    /// Σ weight × coverage.
    pub covered: f64,
    /// Σ weight.
    pub weight: f64,
    /// Σ luminance, without weights.
    pub luminance: f64,
    /// Σ luminance², without weights.
    pub luminance_squares: f64,
    /// How many samples.
    pub samples: u32,
}

impl Pixel {
    /// Adds a sample, whose colour is multiplied by its coverage.
    pub fn add(&mut self, colour: Rgb, coverage: f32, weight: f64) {
        for (sum, channel) in self.sum.iter_mut().zip(colour.to_array()) {
            *sum += weight * f64::from(channel);
        }
        self.covered += weight * f64::from(coverage);
        self.weight += weight;
        let luminance = f64::from(colour.luminance());
        self.luminance += luminance;
        self.luminance_squares += luminance * luminance;
        self.samples += 1;
    }

    /// The mean of the samples; black where there is none.
    pub fn colour(&self) -> Rgb {
        mean(self.sum, self.weight)
    }

    /// The mean coverage, in [0, 1]; 0 where there is no sample.
    pub fn coverage(&self) -> f32 {
        if self.weight == 0.0 { 0.0 } else { (self.covered / self.weight).clamp(0.0, 1.0) as f32 }
    }

    /// The mean luminance, and its standard error as if samples were independent (those of a low-discrepancy sampler are
    /// better than that). `None` for fewer than two samples.
    pub fn luminance_with_error(&self) -> Option<(f64, f64)> {
        let n = f64::from(self.samples);
        if self.samples < 2 {
            return None;
        }
        let mean = self.luminance / n;
        let variance = (self.luminance_squares / n - mean * mean).max(0.0) * n / (n - 1.0);
        Some((mean, (variance / n).sqrt()))
    }
}

/// By how much the coverage of red and that of blue are more than that of green: weighted sums of the samples of one pixel.
///
/// As a rule they are exactly zero, and else as noisy as shadows are: single precision is enough.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tint {
    red: f32,
    blue: f32,
}

impl Tint {
    /// Adds the coverage of a sample.
    pub fn add(&mut self, coverage: Rgb, weight: f64) {
        self.red += (weight * f64::from(coverage.r - coverage.g)) as f32;
        self.blue += (weight * f64::from(coverage.b - coverage.g)) as f32;
    }

    /// The mean coverage of each colour in the pixel that the same samples were added to, in [0, 1]; 0 where there is none.
    pub fn coverage(&self, of: &Pixel) -> Rgb {
        if of.weight == 0.0 {
            return Rgb::BLACK;
        }
        let [red, blue] = [self.red, self.blue].map(f64::from);
        let green = of.covered - (red + blue) / 3.0;
        let share = |covered: f64| (covered / of.weight).clamp(0.0, 1.0) as f32;
        Rgb::new(share(green + red), share(green), share(green + blue))
    }
}

/// What a sample met first.
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

/// Weighted sums of the features of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeatureSums {
    /// Σ weight × albedo.
    pub albedo: [f64; 3],
    /// Σ weight × normal.
    pub normal: [f64; 3],
    /// Σ weight × depth.
    pub depth: f64,
    /// Σ weight × uv.
    pub uv: [f64; 2],
    /// Σ weight of samples that met something.
    pub met: f64,
    /// Σ weight of all samples.
    pub weight: f64,
}

impl FeatureSums {
    /// Adds a sample; `None` met nothing.
    pub fn add(&mut self, sample: Option<&FeatureSample>, weight: f64) {
        self.weight += weight;
        let Some(sample) = sample else { return };
        let add = |sums: &mut [f64], values: &[f32]| {
            for (sum, &value) in sums.iter_mut().zip(values) {
                *sum += weight * f64::from(value);
            }
        };
        add(&mut self.albedo, &sample.albedo.to_array());
        add(&mut self.normal, &sample.normal);
        add(&mut self.uv, &sample.uv);
        self.depth += weight * f64::from(sample.depth);
        self.met += weight;
    }

    /// The mean albedo, black where nothing was met.
    pub fn albedo(&self) -> Rgb {
        mean(self.albedo, self.weight)
    }

    /// The mean normal: shorter than 1 where it varies or where nothing was met.
    pub fn normal(&self) -> Rgb {
        mean(self.normal, self.weight)
    }

    /// The mean depth of what was met; 0 where nothing was.
    pub fn depth(&self) -> f32 {
        if self.met > 0.0 { (self.depth / self.met) as f32 } else { 0.0 }
    }

    /// The mean surface parameters of what was met.
    pub fn uv(&self) -> [f32; 2] {
        if self.met > 0.0 { self.uv.map(|c| (c / self.met) as f32) } else { [0.0; 2] }
    }
}

fn mean(sum: [f64; 3], weight: f64) -> Rgb {
    if weight == 0.0 { Rgb::BLACK } else { sum.map(|c| (c / weight) as f32).into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_the_weighted_mean_of_its_samples() {
        let mut pixel = Pixel::default();
        assert_eq!(pixel.colour(), Rgb::BLACK);
        assert_eq!(pixel.coverage(), 0.0);
        pixel.add(Rgb::new(2.0, 4.0, 8.0), 0.75, 3.0);
        pixel.add(Rgb::new(6.0, 0.0, 4.0), -0.25, 1.0);
        assert_eq!(pixel.coverage(), 0.5);
        assert_eq!(pixel.colour(), Rgb::new(3.0, 3.0, 7.0));
    }

    #[test]
    fn the_standard_error_is_that_of_the_mean() {
        let mut pixel = Pixel::default();
        for value in [1.0, 2.0, 3.0, 6.0] {
            pixel.add(Rgb::splat(value), 1.0, 0.5);
        }
        let (mean, error) = pixel.luminance_with_error().unwrap();
        assert!((mean - 3.0).abs() < 1e-6);
        assert!((error - (14.0_f64 / 3.0 / 4.0).sqrt()).abs() < 1e-5, "{error}");
    }

    #[test]
    fn depth_does_not_mix_with_the_background() {
        let mut sums = FeatureSums::default();
        sums.add(None, 2.0);
        let sample =
            FeatureSample { albedo: Rgb::WHITE, normal: [0.0, 0.0, 1.0], depth: 7.0, uv: [0.25, 0.5] };
        sums.add(Some(&sample), 2.0);
        assert_eq!((sums.depth(), sums.uv()), (7.0, [0.25, 0.5]));
        assert_eq!((sums.albedo(), sums.normal()), (Rgb::splat(0.5), Rgb::new(0.0, 0.0, 0.5)));
    }
}
