//! SSIM: how similar the structure of two images is.
//!
//! Z. Wang, A. C. Bovik, H. R. Sheikh and E. P. Simoncelli, "Image quality assessment: from error visibility to
//! structural similarity", IEEE Transactions on Image Processing 13(4), 2004.

use lumbre_math::Elementary;

use crate::{Image, linear_to_srgb};

/// The window: a Gaussian with a standard deviation of 1.5 pixels, 11 pixels wide.
const SIGMA: f64 = 1.5;
const RADIUS: usize = 5;
/// The paper's constants, for values from 0 to 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The structural similarity of each pixel of two images, row by row from the top left: 1 where they are equal, at
/// least -1. `None` when their sizes differ or they have no pixels.
///
/// It compares luminance as an sRGB display shows it, from 0 to 1; light above 1 counts as 1. At the border of the
/// image the window is what lies inside. A pixel that is finite in one image only has a similarity of 0.
pub fn ssim(image: &Image, reference: &Image) -> Option<Vec<f32>> {
    let same_size = (image.width(), image.height()) == (reference.width(), reference.height());
    if !same_size || image.pixels().is_empty() {
        return None;
    }
    let width = image.width() as usize;
    let (a, b) = (shown(image), shown(reference));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>();
    let [aa, bb, ab] = [product(&a, &a), product(&b, &b), product(&a, &b)].map(|list| blurred(&list, width));
    let [a, b] = [a, b].map(|list| blurred(&list, width));
    let similarity = |i: usize| {
        let (image_pixel, reference_pixel) = (image.pixels()[i], reference.pixels()[i]);
        if image_pixel.is_finite() != reference_pixel.is_finite() {
            return 0.0;
        }
        let (mean_a, mean_b) = (a[i], b[i]);
        let (variance_a, variance_b) = (aa[i] - mean_a * mean_a, bb[i] - mean_b * mean_b);
        let covariance = ab[i] - mean_a * mean_b;
        let above = (2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2);
        let below = (mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2);
        (above / below) as f32
    };
    Some((0..a.len()).map(similarity).collect())
}

/// The luminance of each pixel as a display shows it.
fn shown(image: &Image) -> Vec<f64> {
    let shown = |light: f32| {
        let light = if light.is_finite() { light.clamp(0.0, 1.0) } else { 0.0 };
        f64::from(linear_to_srgb(light))
    };
    image.pixels().iter().map(|colour| shown(colour.luminance())).collect()
}

/// The means of the window around each pixel.
fn blurred(values: &[f64], width: usize) -> Vec<f64> {
    let weights: [f64; RADIUS + 1] =
        std::array::from_fn(|i| (-0.5 * (i as f64 / SIGMA).powi(2)).exponential());
    let height = values.len() / width;
    let mean = |at: usize, count: usize, value: &dyn Fn(usize) -> f64| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for i in at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(count) {
            let w = weights[i.abs_diff(at)];
            (sum, weight) = (sum + w * value(i), weight + w);
        }
        sum / weight
    };
    let pixel = |i: usize| (i % width, i / width);
    let along: Vec<f64> = (0..values.len())
        .map(|i| {
            let (x, y) = pixel(i);
            mean(x, width, &|x| values[y * width + x])
        })
        .collect();
    (0..values.len())
        .map(|i| {
            let (x, y) = pixel(i);
            mean(y, height, &|y| along[y * width + x])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Rgb, srgb_to_linear};

    /// An image of 23 by 17 pixels that shows these values.
    fn showing(value: impl Fn(u32, u32) -> f32) -> Image {
        let light = |i: u32| Rgb::splat(srgb_to_linear(value(i % 23, i / 23)));
        Image::from_pixels(23, 17, (0..23 * 17).map(light).collect()).unwrap()
    }

    #[test]
    fn flat_images_differ_by_their_means_alone() {
        let map = ssim(&showing(|_, _| 0.25), &showing(|_, _| 0.5)).unwrap();
        let expected = (2.0 * 0.25 * 0.5 + C1) / (0.0625 + 0.25 + C1);
        assert!(map.iter().all(|&s| (f64::from(s) - expected).abs() < 1e-5), "{expected} {map:?}");
    }

    #[test]
    fn contrast_and_sign_count() {
        // Checkers around 0.5: the window's mean is 0.5 up to 1e-4 and its variance that of the amplitude.
        let checkers =
            |amplitude: f32| showing(move |x, y| 0.5 + if (x + y) % 2 == 0 { amplitude } else { -amplitude });
        let middle = |a: f32, b: f32| f64::from(ssim(&checkers(a), &checkers(b)).unwrap()[8 * 23 + 11]);
        for (a, b) in [(0.25, 0.25), (0.25, 0.125), (0.25, -0.25)] {
            let (va, vb, cov) = (a * a, b * b, a * b);
            let expected = (2.0 * cov + C2) / (va + vb + C2);
            let found = middle(a as f32, b as f32);
            assert!((found - expected).abs() < 1e-3, "{a} {b}: {found} {expected}");
        }
    }

    #[test]
    fn what_is_not_finite_in_one_image_is_not_similar() {
        let mut odd = showing(|_, _| 0.5);
        odd.pixels_mut()[40] = Rgb::splat(f32::NAN);
        assert_eq!(ssim(&odd, &odd).unwrap()[40], 1.0);
        assert_eq!(ssim(&odd, &showing(|_, _| 0.5)).unwrap()[40], 0.0);
        assert_eq!(ssim(&odd, &Image::filled(17, 23, Rgb::WHITE)), None);
    }
}
