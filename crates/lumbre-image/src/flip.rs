//! FLIP: the difference that a viewer perceives who alternates between two images.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Möller and others, "FLIP: A difference evaluator for alternating
//! images", HPG 2020; for high dynamic range, P. Andersson and others, "Visualizing errors in rendered high
//! dynamic range images", Eurographics 2021 (short papers). Written from the papers.

use glam::{DMat3, DVec3, Vec3};
use lumbre_math::Elementary;

use crate::{ColourSpace, Image, Rgb};

/// Pixels per degree of visual angle: a 0.7 m wide monitor of 3840 pixels seen from 0.7 m, as in the paper.
const PIXELS_PER_DEGREE: f32 = 0.7 * 3840.0 / 0.7 * std::f32::consts::PI / 180.0;

/// The error of each pixel of `image` against `reference`, from 0 to 1, row by row from the top left; `None`
/// when their sizes differ or they have no pixels.
///
/// When no channel of the reference is above 1, both are clamped to 1 and shown on an sRGB display. Otherwise
/// the error is the largest over a range of exposures, from the one where the brightest pixel of the reference
/// just saturates to the one where its median does, each shown through a fitted ACES curve (K. Narkowicz,
/// 2015). Numbers that are not finite count as 0, or as the largest error where only one image has them.
pub fn flip(image: &Image, reference: &Image) -> Option<Vec<f32>> {
    let same_size = (image.width(), image.height()) == (reference.width(), reference.height());
    if !same_size || image.pixels().is_empty() {
        return None;
    }
    let is_bright = reference.pixels().iter().any(|c| c.is_finite() && c.max_component() > 1.0);
    let mut map = if is_bright {
        let (first, last) = exposures(reference);
        let count = ((last - first).ceil() as usize).clamp(2, 64);
        let mut most = vec![0.0f32; image.pixels().len()];
        for i in 0..count {
            let stops = first + (last - first) * i as f32 / (count - 1) as f32;
            let errors = flip_shown(&shown(image, stops), &shown(reference, stops), image.width());
            most.iter_mut().zip(errors).for_each(|(most, error)| *most = most.max(error));
        }
        most
    } else {
        let cut =
            |image: &Image| image.pixels().iter().map(|c| finite(*c).clamp(0.0, 1.0)).collect::<Vec<_>>();
        flip_shown(&cut(image), &cut(reference), image.width())
    };
    for ((error, a), b) in map.iter_mut().zip(image.pixels()).zip(reference.pixels()) {
        if a.is_finite() != b.is_finite() {
            *error = 1.0;
        }
    }
    Some(map)
}

fn finite(c: Rgb) -> Rgb {
    if c.is_finite() { c } else { Rgb::BLACK }
}

/// The image through Narkowicz's curve.
fn shown(image: &Image, stops: f32) -> Vec<Rgb> {
    let fit = |v: f32| {
        let v = 0.6 * v.clamp(0.0, 1e6);
        ((v * (2.51 * v + 0.03)) / (v * (2.43 * v + 0.59) + 0.14)).clamp(0.0, 1.0)
    };
    image.pixels().iter().map(|c| (finite(*c) * stops.exponential_2()).map(fit)).collect()
}

/// The first and the last exposure in stops: at the first the brightest, at the last the median, is shown as 0.85.
fn exposures(reference: &Image) -> (f32, f32) {
    // The light v (before the factor 0.6) that the curve maps to 0.85.
    let (a, b, c) = (2.51 - 0.85 * 2.43, 0.03 - 0.85 * 0.59, -0.85 * 0.14);
    let bright: f32 = (-b + f32::sqrt(b * b - 4.0 * a * c)) / (2.0 * a) / 0.6;
    let mut light: Vec<f32> = reference.pixels().iter().map(|c| finite(*c).luminance().max(1e-6)).collect();
    light.sort_unstable_by(f32::total_cmp);
    let (median, most) = (light[light.len() / 2], light[light.len() - 1]);
    ((bright / most).logarithm_2(), (bright / median).logarithm_2())
}

/// FLIP of two images in [0, 1].
fn flip_shown(image: &[Rgb], reference: &[Rgb], width: u32) -> Vec<f32> {
    let space = Spaces::new();
    let width = width as usize;
    let opponent = |colours: &[Rgb]| colours.iter().map(|&c| space.opponent(c)).collect::<Vec<_>>();
    let (a, b) = (opponent(image), opponent(reference));
    let colour = colour_errors(&space, &a, &b, width);
    let feature = feature_errors(&a, &b, width);
    colour.into_iter().zip(feature).map(|(colour, feature)| colour.power(1.0 - feature)).collect()
}

/// The matrices, and the white that they are relative to.
struct Spaces {
    xyz: DMat3,
    rgb: DMat3,
    white: DVec3,
}

impl Spaces {
    fn new() -> Self {
        let xyz = ColourSpace::REC709.to_xyz().expect("its primaries span");
        Self { xyz, rgb: xyz.inverse(), white: xyz * DVec3::ONE }
    }

    /// YyCxCz: luminance, red against green, yellow against blue.
    fn opponent(&self, c: Rgb) -> Vec3 {
        let v = self.xyz * DVec3::new(c.r.into(), c.g.into(), c.b.into()) / self.white;
        DVec3::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z)).as_vec3()
    }

    /// CIELAB with the Hunt effect: chroma scaled by lightness.
    fn lab(&self, opponent: Vec3) -> Vec3 {
        let v = opponent.as_dvec3();
        let y = (v.x + 16.0) / 116.0;
        let v = DVec3::new(v.y / 500.0 + y, y, y - v.z / 200.0) * self.white;
        let v = self.xyz * (self.rgb * v).clamp(DVec3::ZERO, DVec3::ONE) / self.white;
        let [x, y, z] = v.to_array().map(|t| {
            const JOIN: f64 = 6.0 / 29.0;
            if t > JOIN.powi(3) { t.cube_root() } else { t / (3.0 * JOIN * JOIN) + 4.0 / 29.0 }
        });
        let lightness = 116.0 * y - 16.0;
        let fade = 0.01 * lightness;
        DVec3::new(lightness, fade * 500.0 * (x - y), fade * 200.0 * (y - z)).as_vec3()
    }
}

/// Distance for large differences of colour: city-block between lightness and chroma.
fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypotenuse(d.z)
}

/// The perceived difference of colours, from 0 to 1.
fn colour_errors(space: &Spaces, a: &[Vec3], b: &[Vec3], width: usize) -> Vec<f32> {
    const POWER: f32 = 0.7;
    let of = |r, g, b| space.lab(space.opponent(Rgb::new(r, g, b)));
    let largest = hyab(of(0.0, 1.0, 0.0), of(0.0, 0.0, 1.0)).power(POWER);
    let (a, b) = (contrast_filtered(a, width), contrast_filtered(b, width));
    a.into_iter()
        .zip(b)
        .map(|(a, b)| {
            let error = hyab(space.lab(a), space.lab(b)).power(POWER);
            // Small errors take most of the range: those up to 0.4 of the largest go to 0.95.
            const KNEE: [f32; 2] = [0.4, 0.95];
            let knee = KNEE[0] * largest;
            if error < knee {
                KNEE[1] / knee * error
            } else {
                KNEE[1] + (error - knee) / (largest - knee) * (1.0 - KNEE[1])
            }
            .min(1.0)
        })
        .collect()
}

/// Filters each opponent channel by the contrast sensitivity of the eye at this distance, as sums of Gaussians
/// (G. M. Johnson and M. D. Fairchild, "A top down description of S-CIELAB and CIEDE2000", 2003).
fn contrast_filtered(image: &[Vec3], width: usize) -> Vec<Vec3> {
    // By channel: weights a and spreads b of a * sqrt(pi / b) * exp(-pi^2 x^2 / b), x in degrees.
    const GAUSSIANS: [&[[f32; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];
    const PI: f32 = std::f32::consts::PI;
    // All channels are truncated at three standard deviations of the widest.
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let mut out = vec![Vec3::ZERO; image.len()];
    for (channel, gaussians) in GAUSSIANS.into_iter().enumerate() {
        let plane: Vec<f32> = image.iter().map(|v| v[channel]).collect();
        let kernels: Vec<(f32, Vec<f32>)> = gaussians
            .iter()
            .map(|&[a, b]| {
                let at = |x: i32| (-PI * PI * (x as f32 / PIXELS_PER_DEGREE).powi(2) / b).exponential();
                let kernel: Vec<f32> = (-radius..=radius).map(at).collect();
                let sum: f32 = kernel.iter().sum();
                // The weight of the whole in two dimensions, and the kernel of sum 1 in one.
                (a * (PI / b).sqrt() * sum * sum, kernel.iter().map(|k| k / sum).collect())
            })
            .collect();
        let total: f32 = kernels.iter().map(|(weight, _)| weight).sum();
        for (weight, kernel) in &kernels {
            let filtered = filtered(&plane, width, kernel, kernel);
            out.iter_mut().zip(filtered).for_each(|(out, v)| out[channel] += weight / total * v);
        }
    }
    out
}

/// The difference of edges and points, from 0 to 1.
fn feature_errors(a: &[Vec3], b: &[Vec3], width: usize) -> Vec<f32> {
    /// The width of a feature in degrees.
    const WIDTH: f32 = 0.082;
    const POWER: f32 = 0.5;
    let deviation = 0.5 * WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i32;
    let gaussian = |x: i32| (-(x * x) as f32 / (2.0 * deviation * deviation)).exponential();
    let all = |f: &dyn Fn(i32) -> f32| (-radius..=radius).map(f).collect::<Vec<_>>();
    let sum: f32 = all(&gaussian).iter().sum();
    let smooth = all(&|x| gaussian(x) / sum);
    let edge = balanced(all(&|x| -x as f32 * gaussian(x)));
    let point = balanced(all(&|x| ((x * x) as f32 / (deviation * deviation) - 1.0) * gaussian(x)));
    let magnitude = |image: &[Vec3], kernel: &[f32]| -> Vec<f32> {
        let plane: Vec<f32> = image.iter().map(|v| (v.x + 16.0) / 116.0).collect();
        let (dx, dy) = (filtered(&plane, width, kernel, &smooth), filtered(&plane, width, &smooth, kernel));
        dx.into_iter().zip(dy).map(|(dx, dy)| dx.hypotenuse(dy)).collect()
    };
    let (edge_a, edge_b) = (magnitude(a, &edge), magnitude(b, &edge));
    let (point_a, point_b) = (magnitude(a, &point), magnitude(b, &point));
    (0..a.len())
        .map(|i| {
            let most = (edge_a[i] - edge_b[i]).abs().max((point_a[i] - point_b[i]).abs());
            (most * std::f32::consts::FRAC_1_SQRT_2).power(POWER).clamp(0.0, 1.0)
        })
        .collect()
}

/// The kernel whose positive parts sum to 1 and negative parts to -1.
fn balanced(kernel: Vec<f32>) -> Vec<f32> {
    let positive: f32 = kernel.iter().filter(|k| **k > 0.0).sum();
    let negative: f32 = -kernel.iter().filter(|k| **k < 0.0).sum::<f32>();
    kernel.into_iter().map(|k| if k > 0.0 { k / positive } else { k / negative }).collect()
}

/// Filters a plane by one kernel along rows and another along columns; borders are extended.
fn filtered(plane: &[f32], width: usize, along_x: &[f32], along_y: &[f32]) -> Vec<f32> {
    let height = plane.len() / width;
    let convolve = |at: usize, length: usize, kernel: &[f32], value: &dyn Fn(usize) -> f32| {
        let radius = kernel.len() / 2;
        let term = |(i, k): (usize, &f32)| k * value((at + i).saturating_sub(radius).min(length - 1));
        kernel.iter().enumerate().map(term).sum::<f32>()
    };
    let mut rows = vec![0.0; plane.len()];
    for (y, row) in rows.chunks_mut(width).enumerate() {
        let line = &plane[y * width..(y + 1) * width];
        for (x, out) in row.iter_mut().enumerate() {
            *out = convolve(x, width, along_x, &|x| line[x]);
        }
    }
    let mut out = vec![0.0; plane.len()];
    for (y, row) in out.chunks_mut(width).enumerate() {
        for (x, out) in row.iter_mut().enumerate() {
            *out = convolve(y, height, along_y, &|y| rows[y * width + x]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(map: &[f32]) -> f32 {
        map.iter().sum::<f32>() / map.len() as f32
    }

    fn one(colour: Rgb) -> Image {
        Image::filled(40, 30, colour)
    }

    #[test]
    fn the_space_has_the_numbers_of_the_paper() {
        assert!((PIXELS_PER_DEGREE - 67.02).abs() < 0.01);
        let space = Spaces::new();
        let white = space.lab(space.opponent(Rgb::WHITE));
        assert!((white - Vec3::new(100.0, 0.0, 0.0)).length() < 1e-3, "{white}");
        // CIELAB of sRGB red is (53.24, 80.09, 67.20).
        let red = space.lab(space.opponent(Rgb::new(1.0, 0.0, 0.0)));
        let faded = Vec3::new(53.24, 80.09 * 0.5324, 67.20 * 0.5324);
        assert!((red - faded).abs().max_element() < 0.05, "{red}");
    }

    #[test]
    fn opposite_colours_are_near_the_largest_error() {
        let extremes = [(Rgb::BLACK, Rgb::WHITE), (Rgb::new(0.0, 1.0, 0.0), Rgb::new(0.0, 0.0, 1.0))];
        for (a, b) in extremes {
            let error = mean(&flip(&one(a), &one(b)).unwrap());
            assert!((0.95..=1.0).contains(&error), "{a:?} {b:?}: {error}");
        }
        let green_blue = mean(&flip(&one(extremes[1].0), &one(extremes[1].1)).unwrap());
        assert!((green_blue - 1.0).abs() < 1e-4, "{green_blue}");
    }

    #[test]
    fn a_flat_difference_has_the_value_of_the_formula() {
        // No features in flat pictures: only colour counts. Greys of lightness 50 and 60, worked by hand.
        let grey = |lightness: f32| Rgb::splat(((lightness + 16.0) / 116.0).powi(3));
        let space = Spaces::new();
        let of = |r, g, b| space.lab(space.opponent(Rgb::new(r, g, b)));
        let largest = hyab(of(0.0, 1.0, 0.0), of(0.0, 0.0, 1.0)).powf(0.7);
        let expected = 0.95 * 10f32.powf(0.7) / (0.4 * largest);
        let map = flip(&one(grey(50.0)), &one(grey(60.0))).unwrap();
        assert!(map.iter().all(|e| (e - expected).abs() < 1e-3), "{} {expected}", map[7]);
    }

    #[test]
    fn equal_pictures_have_none_and_the_order_does_not_matter() {
        let noisy = |seed: u32| {
            let value = |i: u32| {
                (i.wrapping_mul(2_654_435_761).wrapping_add((seed * 40_503) << 16) >> 24) as f32 / 255.0
            };
            let colours = (0..1200).map(|i| Rgb::new(value(i), value(i + 7), value(i + 13))).collect();
            Image::from_pixels(40, 30, colours).unwrap()
        };
        let (a, b) = (noisy(1), noisy(5));
        assert_eq!(mean(&flip(&a, &a).unwrap()), 0.0);
        let (there, back) = (flip(&a, &b).unwrap(), flip(&b, &a).unwrap());
        assert!(there.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-5));
        assert!(mean(&there) > 0.05);
    }

    #[test]
    fn an_edge_moved_by_two_pixels_shows_there_and_not_elsewhere() {
        let edge = |at: u32| {
            let colours = (0..60 * 40).map(|i| Rgb::splat(if i % 60 < at { 0.1 } else { 0.7 })).collect();
            Image::from_pixels(60, 40, colours).unwrap()
        };
        let map = flip(&edge(30), &edge(32)).unwrap();
        assert!(map[20 * 60 + 31] > 0.5, "{}", map[20 * 60 + 31]);
        assert!(map[20 * 60 + 5] < 1e-3 && map[20 * 60 + 55] < 1e-3);
    }

    #[test]
    fn bright_references_are_compared_at_many_exposures() {
        let ramp = |scale: f32| {
            let colours = (0..1200).map(|i| Rgb::splat(scale * 2f32.powf(i as f32 / 120.0 - 3.0))).collect();
            Image::from_pixels(40, 30, colours).unwrap()
        };
        let same = flip(&ramp(1.0), &ramp(1.0)).unwrap();
        assert_eq!(mean(&same), 0.0);
        let (near, far) = (flip(&ramp(1.05), &ramp(1.0)).unwrap(), flip(&ramp(1.5), &ramp(1.0)).unwrap());
        assert!(0.0 < mean(&near) && mean(&near) < mean(&far));
        // Cut off at 1 the bright half would be equal; some exposure shows its difference.
        assert!(far[1000] > 0.05, "{}", far[1000]);
    }

    #[test]
    fn what_is_not_finite_in_one_is_an_error_there() {
        let mut odd = one(Rgb::splat(0.5));
        odd.pixels_mut()[415] = Rgb::splat(f32::NAN);
        let map = flip(&odd, &one(Rgb::splat(0.5))).unwrap();
        assert_eq!(map[415], 1.0);
        assert!(map.iter().all(|e| (0.0..=1.0).contains(e)));
    }
}
