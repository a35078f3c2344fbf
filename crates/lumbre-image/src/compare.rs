//! Metrics of the difference of two images.

use crate::flip::flip;
use crate::ssim::ssim;
use crate::{Image, Rgb};
use lumbre_math::Elementary;

/// A metric of the difference of two images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Metric {
    /// The root of the mean squared difference of the channels.
    Rmse,
    /// The mean of squared differences relative to the squared reference: `(a - b)² / (b² + 0.01)`, so that
    /// dark and bright parts count equally (F. Rousselle and others, "Adaptive sampling and reconstruction
    /// using greedy error minimization", SIGGRAPH Asia 2011; the 0.01 is ours).
    RelMse,
    /// The mean absolute difference of the channels.
    Mae,
    /// The largest absolute difference of any channel.
    Max,
    /// The mean of FLIP, from 0 to 1: the difference that a viewer perceives who alternates between the two.
    /// See [`crate::flip()`].
    Flip,
    /// The mean structural similarity: 1 for equal images, and less the more they differ. See [`crate::ssim()`].
    Ssim,
}

impl Metric {
    /// The names, in the order of the enum.
    pub const NAMES: [&'static str; 6] = ["rmse", "relmse", "mae", "max", "flip", "ssim"];

    /// The metric of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "rmse" => Some(Self::Rmse),
            "relmse" => Some(Self::RelMse),
            "mae" => Some(Self::Mae),
            "max" => Some(Self::Max),
            "flip" => Some(Self::Flip),
            "ssim" => Some(Self::Ssim),
            _ => None,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// Whether a larger value means that two images are more alike.
    pub fn is_similarity(self) -> bool {
        self == Self::Ssim
    }
}

/// The difference of two images.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The value of the metric; infinite where a number is not finite and the other image's is different.
    pub value: f64,
    /// Each pixel's error, 0 where they are equal, row by row from the top left: that of FLIP; 1 - SSIM;
    /// otherwise the largest error of the channels, relative and squared for [`Metric::RelMse`].
    pub map: Vec<f32>,
    width: u32,
    height: u32,
}

impl Comparison {
    /// The map in false colours: black where there is no error, through violet, red and orange to pale yellow
    /// at `full` and above.
    pub fn heat(&self, full: f32) -> Image {
        let colours =
            self.map.iter().map(|&error| heat(if full > 0.0 { error / full } else { error })).collect();
        Image::from_pixels(self.width, self.height, colours).expect("one error a pixel")
    }

    /// The map in false colours from 0 to its largest error; to 1 for FLIP and SSIM, as is usual.
    pub fn heat_map(&self, metric: Metric) -> Image {
        let largest = self.map.iter().copied().filter(|e| e.is_finite()).fold(0.0, f32::max);
        self.heat(if matches!(metric, Metric::Flip | Metric::Ssim) { 1.0 } else { largest })
    }
}

/// Compares the colours of an image with a reference of the same size; alpha is ignored. `None` when their
/// sizes differ, or they have no pixels.
pub fn compare(image: &Image, reference: &Image, metric: Metric) -> Option<Comparison> {
    let same_size = (image.width(), image.height()) == (reference.width(), reference.height());
    if !same_size || image.pixels().is_empty() {
        return None;
    }
    let done = |value, map| Some(Comparison { value, map, width: image.width(), height: image.height() });
    if metric == Metric::Flip {
        let map = flip(image, reference)?;
        let mean = map.iter().map(|&e| f64::from(e)).sum::<f64>() / map.len() as f64;
        return done(mean, map);
    }
    if metric == Metric::Ssim {
        let map = ssim(image, reference)?;
        let mean = map.iter().map(|&s| f64::from(s)).sum::<f64>() / map.len() as f64;
        return done(mean, map.into_iter().map(|s| 1.0 - s).collect());
    }
    let mut sum = 0.0f64;
    let mut largest = 0.0f64;
    let mut map = Vec::with_capacity(image.pixels().len());
    for (a, b) in image.pixels().iter().zip(reference.pixels()) {
        let errors = a.zip(*b, difference);
        let mut worst = 0.0f64;
        for (error, b) in errors.to_array().into_iter().zip(b.to_array()) {
            let error = f64::from(error);
            let error = match metric {
                Metric::Rmse => error * error,
                Metric::RelMse if 0.0 < error && error.is_finite() => {
                    error * error / (f64::from(b).powi(2) + 0.01)
                }
                _ => error,
            };
            sum += error;
            worst = worst.max(error);
        }
        largest = largest.max(worst);
        map.push(if metric == Metric::Rmse { worst.sqrt() } else { worst } as f32);
    }
    let mean = sum / (3.0 * map.len() as f64);
    let value = match metric {
        Metric::Rmse => mean.sqrt(),
        Metric::Max => largest,
        _ => mean,
    };
    done(value, map)
}

/// The absolute difference of two numbers, infinite when one is not finite and they differ.
fn difference(a: f32, b: f32) -> f32 {
    if a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()) {
        return 0.0;
    }
    let d = (f64::from(a) - f64::from(b)).abs() as f32;
    if d.is_nan() { f32::INFINITY } else { d }
}

/// A colour for a number from 0 to 1: lightness rises evenly, hue runs from blue-violet through red to yellow.
///
/// Computed in Oklab (B. Ottosson, "A perceptual color space for image processing", 2020), so that equal steps
/// look equal.
fn heat(t: f32) -> Rgb {
    let t = if t.is_nan() { 1.0 } else { t.clamp(0.0, 1.0) };
    let lightness = 0.97 * t;
    let hue = (285.0 + 180.0 * t).to_radians();
    let chroma = 0.19 * (std::f32::consts::PI * t.power(0.85)).sine().max(0.0) + 0.04 * t;
    let (a, b) = (chroma * hue.cosine(), chroma * hue.sine());
    let l = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let m = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let s = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    Rgb::new(
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_4 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    )
    .clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(colours: &[[f32; 3]]) -> Image {
        Image::from_pixels(2, colours.len() as u32 / 2, colours.iter().map(|&c| Rgb::from(c)).collect())
            .unwrap()
    }

    #[test]
    fn every_metric_has_the_value_worked_by_hand() {
        let a = image(&[[0.5, 0.25, 1.0], [2.0, 0.0, 0.0], [0.1, 0.1, 0.1], [0.3, 0.3, 0.3]]);
        let b = image(&[[0.5, 0.75, 1.0], [1.0, 0.0, 0.0], [0.1, 0.1, 0.1], [0.3, 0.3, 0.3]]);
        let value = |metric| compare(&a, &b, metric).unwrap().value;
        assert!((value(Metric::Rmse) - (1.25f64 / 12.0).sqrt()).abs() < 1e-7);
        assert!((value(Metric::RelMse) - (0.25 / 0.5725 + 1.0 / 1.01) / 12.0).abs() < 1e-7);
        assert!((value(Metric::Mae) - 1.5 / 12.0).abs() < 1e-7);
        assert_eq!(value(Metric::Max), 1.0);
        assert_eq!(compare(&a, &b, Metric::Rmse).unwrap().map, [0.5, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn an_image_equals_itself_even_where_it_is_not_finite() {
        let odd = image(&[[f32::NAN, f32::INFINITY, -1.0], [0.5, f32::NEG_INFINITY, 2.0]]);
        let fine = image(&[[0.5, 0.5, -1.0], [0.5, 0.5, 2.0]]);
        for name in Metric::NAMES {
            let metric = Metric::from_name(name).unwrap();
            assert_eq!(metric.name(), name);
            let equal = if metric.is_similarity() { 1.0 } else { 0.0 };
            assert_eq!(compare(&odd, &odd, metric).unwrap().value, equal, "{name}");
            if !matches!(metric, Metric::Flip | Metric::Ssim) {
                assert_eq!(compare(&odd, &fine, metric).unwrap().value, f64::INFINITY, "{name}");
                assert_eq!(compare(&fine, &odd, metric).unwrap().value, f64::INFINITY, "{name}");
            }
        }
        assert_eq!(Metric::from_name("psnr"), None);
    }

    #[test]
    fn other_sizes_cannot_be_compared() {
        let a = Image::filled(4, 3, Rgb::WHITE);
        let b = Image::filled(3, 4, Rgb::WHITE);
        assert_eq!(compare(&a, &b, Metric::Mae), None);
        let none = Image::filled(0, 3, Rgb::WHITE);
        assert_eq!(compare(&none, &none, Metric::Mae), None);
    }

    #[test]
    fn heat_grows_lighter_all_along() {
        let light: Vec<f32> = (0..=256).map(|i| heat(i as f32 / 256.0).luminance()).collect();
        assert!(light.windows(2).all(|pair| pair[0] <= pair[1] + 1e-4), "{light:?}");
        assert!(heat(0.0).is_black() && light[256] > 0.8);
        assert_eq!(heat(f32::INFINITY), heat(1.0));
        let seen = image(&[[1.0; 3], [3.0; 3], [1.0; 3], [5.0; 3]]);
        let shown = compare(&seen, &image(&[[1.0; 3]; 4]), Metric::Max).unwrap().heat_map(Metric::Max);
        assert_eq!(shown.pixels()[..], [heat(0.0), heat(0.5), heat(0.0), heat(1.0)]);
    }
}
