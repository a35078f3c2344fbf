//! The filter on pictures whose signal and noise are known.

use lumbre_image::{Image, Rgb};
use lumbre_math::random::{combine, mix, uniform_f64};

use super::{denoise, denoise_unless};
use crate::film::Guides;
use crate::film::{Exposure, Extras, FeatureSample, PixelBounds, Sample, Tile};
use crate::rendered::picture;
use crate::{FilmLayers, Rendered, Stats};

const WIDTH: u32 = 40;
const HEIGHT: u32 = 32;

/// What a sample of a pixel sees: light, albedo, normal.
type Scene = dyn Fn(u32, u32, u32) -> (Rgb, Rgb, [f32; 3]);

fn rendered(samples: u32, scene: &Scene) -> Rendered {
    let bounds = PixelBounds { x0: 3, y0: 5, x1: 3 + WIDTH, y1: 5 + HEIGHT };
    let mut tile = Tile::new(bounds, Extras { features: true, guides: true, ..Extras::default() });
    for (x, y) in bounds.pixels() {
        for i in 0..samples {
            let (light, albedo, normal) = scene(x - bounds.x0, y - bounds.y0, i);
            let features = FeatureSample { albedo, normal, depth: 7.0, uv: [0.0; 2] };
            let sample = Sample { radiance: light * albedo, features: Some(features), ..Sample::default() };
            tile.add(x, y, &sample, &Exposure::default());
        }
    }
    let tiles = || std::iter::once(&tile);
    Rendered {
        image: picture(tiles(), bounds, false),
        coverage: None,
        bounds,
        features: vec![],
        guides: Some(Guides::new(tiles())),
        film: FilmLayers::default(),
        stats: Stats { spp: samples, stride: Some(1), threads: 1, ..Stats::default() },
    }
}

/// Uniform in [0, 2): its mean is 1.
fn noise(x: u32, y: u32, sample: u32) -> f32 {
    2.0 * uniform_f64(mix(combine(combine(u64::from(x), u64::from(y)), u64::from(sample)))) as f32
}

const UP: [f32; 3] = [0.0, 0.0, 1.0];
const ASIDE: [f32; 3] = [0.6, 0.0, 0.8];

/// A chessboard under light that rises to the right, above a wall that has less of it.
fn truth(x: u32, y: u32) -> (Rgb, Rgb, [f32; 3]) {
    let albedo =
        if (x / 5 + y / 4).is_multiple_of(2) { Rgb::new(0.8, 0.7, 0.3) } else { Rgb::new(0.1, 0.3, 0.2) };
    let ramp = 1.0 + x as f32 / WIDTH as f32;
    if y < 17 { (Rgb::splat(ramp), albedo, UP) } else { (Rgb::splat(0.3 * ramp), albedo, ASIDE) }
}

fn noisy(x: u32, y: u32, i: u32) -> (Rgb, Rgb, [f32; 3]) {
    let (light, albedo, normal) = truth(x, y);
    (light * noise(x, y, i), albedo, normal)
}

fn squared_error(image: &Image) -> f64 {
    let mut sum = 0.0;
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let (light, albedo, _) = truth(x, y);
            let error = (image.pixel(x, y) - light * albedo).to_array();
            sum += error.iter().map(|e| f64::from(e * e)).sum::<f64>();
        }
    }
    sum
}

#[test]
fn noise_falls_and_edges_stay_sharp() {
    for (samples, least) in [(4, 20.0), (16, 20.0), (64, 8.0)] {
        let rendered = rendered(samples, &noisy);
        let denoised = denoise(&rendered, 1).unwrap().image;
        let (before, after) = (squared_error(&rendered.image), squared_error(&denoised));
        assert!(after * least < before, "{samples} samples: {before} -> {after}");
    }
    // With less noise, every pixel is seen to keep to its side.
    let quiet = |x: u32, y: u32, i: u32| {
        let (light, albedo, normal) = truth(x, y);
        (light * (0.9 + 0.1 * noise(x, y, i)), albedo, normal)
    };
    let denoised = denoise(&rendered(16, &quiet), 1).unwrap().image;
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let (light, albedo, _) = truth(x, y);
            let (found, expected) = (denoised.pixel(x, y), light * albedo);
            let error = (found - expected).map(f32::abs).max_component() / expected.max_component();
            assert!(error < 0.05, "({x}, {y}): {found:?}, expected {expected:?}");
        }
    }
}

#[test]
fn what_has_no_noise_stays_as_it_is() {
    let clean = rendered(3, &|x, y, _| truth(x, y));
    let denoised = denoise(&clean, 1).unwrap().image;
    for (found, expected) in denoised.pixels().iter().zip(clean.image.pixels()) {
        assert!((*found - *expected).map(f32::abs).max_component() < 2e-6, "{found:?} {expected:?}");
    }
    let constant = rendered(5, &|_, _, _| (Rgb::splat(1.5), Rgb::new(0.5, 0.25, 0.75), UP));
    let denoised = denoise(&constant, 1).unwrap().image;
    let expected = Rgb::new(0.75, 0.375, 1.125);
    assert!(denoised.pixels().iter().all(|&c| (c - expected).map(f32::abs).max_component() < 1e-6));
}

#[test]
fn few_samples_and_none_give_numbers() {
    let black = rendered(2, &|_, _, _| (Rgb::BLACK, Rgb::BLACK, UP));
    let single = rendered(1, &noisy);
    let mut holes = rendered(2, &noisy);
    let tile = &mut holes.guides.as_mut().unwrap().tiles_mut()[0];
    for i in [0, 7, 500] {
        tile.set_guide(i, Default::default());
    }
    let bright = rendered(2, &|x, y, i| (Rgb::splat(1e30) * noise(x, y, i), Rgb::WHITE, UP));
    for rendered in [&black, &single, &holes, &bright] {
        let denoised = denoise(rendered, 1).unwrap().image;
        assert!(denoised.pixels().iter().all(|c| c.is_finite()));
    }
    let denoised = denoise(&single, 1).unwrap().image;
    assert!(squared_error(&denoised) * 3.0 < squared_error(&single.image));
    let mut nothing = single.clone();
    nothing.stats.stride = None;
    assert_eq!(denoise(&nothing, 1), None);
    nothing = Rendered { guides: None, ..single };
    assert_eq!(denoise(&nothing, 1), None);
}

#[test]
fn a_coarse_picture_is_filtered_small_then_enlarged() {
    // Every third pixel has samples.
    let coarse = |side: u32| {
        let mut rendered = rendered(8, &noisy);
        rendered.stats.stride = Some(side);
        denoise(&rendered, 2).unwrap().image
    };
    let image = coarse(3);
    assert_eq!((image.width(), image.height()), (WIDTH, HEIGHT));
    // Those of a wall are near the truth, and what is between two of them is between.
    for (x, y) in [(12, 3), (27, 9), (15, 24), (33, 27)] {
        let (light, albedo, _) = truth(x, y);
        let (found, expected) = (image.pixel(x, y), light * albedo);
        assert!((found - expected).map(f32::abs).max_component() < 0.25 * expected.max_component());
    }
    for (x, y) in [(12, 3), (27, 24)] {
        let (left, right) = (image.pixel(x, y), image.pixel(x + 3, y));
        let (found, expected) = (image.pixel(x + 1, y), left * (2.0 / 3.0) + right * (1.0 / 3.0));
        assert!((found - expected).map(f32::abs).max_component() < 1e-6, "{found:?} {expected:?}");
    }
    assert_eq!(coarse(1), denoise(&rendered(8, &noisy), 1).unwrap().image);
}

#[test]
fn blocks_do_not_show() {
    for samples in [1, 5] {
        let rendered = rendered(samples, &noisy);
        let bytes = |block| -> Vec<u32> {
            let noisy = super::Noisy {
                image: &rendered.image,
                coverage: None,
                guides: rendered.guides.as_ref().unwrap(),
                bounds: rendered.bounds,
                block,
            };
            let workers = crate::workers::Workers::start(2);
            let image = noisy.denoised(&workers, &crate::CancelToken::new()).unwrap().image;
            image.pixels().iter().flat_map(|c| c.to_array().map(f32::to_bits)).collect()
        };
        let whole = bytes((100, 100));
        for block in [(7, 5), (40, 1), (1, 32), (13, 100)] {
            assert_eq!(bytes(block), whole, "{samples} {block:?}");
        }
    }
}

#[test]
fn one_bright_sample_makes_no_spot() {
    let with_one = |x: u32, y: u32, i: u32| {
        let (light, albedo, normal) = noisy(x, y, i);
        (if (x, y, i) == (21, 9, 3) { light * 1e5 } else { light }, albedo, normal)
    };
    let denoised = denoise(&rendered(16, &with_one), 1).unwrap().image;
    for (i, &found) in denoised.pixels().iter().enumerate() {
        let (light, albedo, _) = truth(i as u32 % WIDTH, i as u32 / WIDTH);
        let expected = (light * albedo).g;
        assert!((0.7 * expected..1.6 * expected).contains(&found.g), "{i}: {found:?}, expected {expected}");
    }
}

#[test]
fn light_is_kept() {
    let denoised = denoise(&rendered(8, &noisy), 1).unwrap().image;
    let sum = |value: &dyn Fn(u32, u32) -> f32| -> f64 {
        (0..WIDTH * HEIGHT).map(|i| f64::from(value(i % WIDTH, i / WIDTH))).sum()
    };
    let expected = sum(&|x, y| (truth(x, y).0 * truth(x, y).1).g);
    let found = sum(&|x, y| denoised.pixel(x, y).g);
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
}

#[test]
fn any_number_of_threads_denoises_to_the_same_bytes() {
    let rendered = rendered(4, &noisy);
    let bytes = |threads| -> Vec<u32> {
        let image = denoise(&rendered, threads).unwrap().image;
        image.pixels().iter().flat_map(|c| c.to_array().map(f32::to_bits)).collect()
    };
    assert_eq!(bytes(1), bytes(4));
}

#[test]
fn a_cancelled_filter_gives_no_picture() {
    let rendered = rendered(8, &|x, y, _| truth(x, y));
    let cancel = crate::CancelToken::new();
    let whole = denoise(&rendered, 2);
    assert!(whole.is_some());
    assert_eq!(denoise_unless(&rendered, 2, &cancel), whole);
    cancel.cancel();
    assert_eq!(denoise_unless(&rendered, 2, &cancel), None);
}
