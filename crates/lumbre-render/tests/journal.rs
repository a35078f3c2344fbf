//! The journal of a sample equals what the render does.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use crate::common::*;
use crate::determinism::still_life;
use lumbre_image::Rgb;
use lumbre_math::DVec3;
use lumbre_render::transport::{End, Source};
use lumbre_render::{Event, explain_sample};
use lumbre_scene::{IntegratorKind, LightDesc, Scene};
use lumbre_shading::Spectrum;

/// The light of a path by its journal.
fn told(events: &[Event]) -> Spectrum {
    events.iter().fold(Spectrum::BLACK, |sum, event| match event {
        Event::Added { added, .. } => sum + *added,
        _ => sum,
    })
}

fn bits(light: Spectrum) -> [u32; 3] {
    light.to_array().map(f32::to_bits)
}

#[test]
fn a_journal_with_photons_sums_to_the_pixel() {
    let mut desc = still_life(DVec3::ZERO);
    desc.lights.push(LightDesc::Point { from: DVec3::new(0.5, -2.0, 5.0), intensity: Rgb::splat(40.0) });
    let scene = Scene::build(desc).unwrap();
    let mut found = 0;
    let mut options = options(&scene, 24, 16, 1);
    options.first_sample = 6;
    options.integrator.kind = IntegratorKind::Caustics;
    let image = picture(&scene, &options).image;
    for (x, y) in (0..16).map(|i| (i + 4, 15 - i / 2)) {
        let sample = explain_sample(&scene, &options, (x, y), 6).unwrap();
        assert_eq!(bits(told(&sample.events)), bits(sample.radiance), "({x}, {y})");
        assert_eq!(image.pixel(x, y).to_array().map(f32::to_bits), bits(sample.radiance), "({x}, {y})");
        let is_photons = |event: &&Event| matches!(event, Event::Added { source: Source::Caustics, .. });
        found += sample.events.iter().filter(is_photons).count();
    }
    assert!(found > 0);
}

#[test]
fn the_journal_of_every_sample_sums_to_the_pixel_of_the_render() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let kinds = [
        IntegratorKind::Path { regularize: false },
        IntegratorKind::Whitted { light_samples: 2, sky: true },
        IntegratorKind::AmbientOcclusion { cosine: true, max_distance: f64::INFINITY },
        IntegratorKind::Normals,
    ];
    let mut events = Vec::new();
    for kind in kinds {
        for index in [0, 5, 6, 9, 11] {
            let mut options = options(&scene, 24, 16, 1);
            options.first_sample = index;
            options.integrator.kind = kind;
            let image = picture(&scene, &options).image;
            for (x, y) in options.bounds().unwrap().pixels() {
                let sample = explain_sample(&scene, &options, (x, y), index).unwrap();
                let at = format!("{kind:?}: sample {index} of ({x}, {y})");
                assert_eq!(bits(told(&sample.events)), bits(sample.radiance), "{at}");
                assert_eq!(image.pixel(x, y).to_array().map(f32::to_bits), bits(sample.radiance), "{at}");
                assert!(matches!(sample.events[0], Event::Met(_) | Event::Left { .. }), "{at}");
                events.extend(sample.events);
            }
        }
    }
    let counts = |is_it: fn(&Event) -> bool| events.iter().filter(|event| is_it(event)).count();
    let from = |event: &Event, from| matches!(event, Event::Added { source, .. } if *source == from);
    for (what, count) in [
        ("lights", counts(|event| matches!(event, Event::Sampled(_)))),
        ("bounces", counts(|event| matches!(event, Event::Scattered(_)))),
        ("looks", counts(|event| matches!(event, Event::Looked { .. }))),
        ("ends", counts(|event| matches!(event, Event::Ended(End::Depth | End::Roulette)))),
        ("sampled", events.iter().filter(|event| from(event, Source::Sampled)).count()),
        ("found", events.iter().filter(|event| from(event, Source::Surface)).count()),
        ("direct", events.iter().filter(|event| from(event, Source::Direct)).count()),
        ("sky", events.iter().filter(|event| from(event, Source::Infinity)).count()),
    ] {
        assert!(count > 10, "{count} {what}");
    }
}

#[test]
fn what_is_told_of_a_light_multiplies_to_what_is_added() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let options = options(&scene, 24, 16, 1);
    let mut pairs = 0;
    for (x, y) in options.bounds().unwrap().pixels() {
        let sample = explain_sample(&scene, &options, (x, y), 3).unwrap();
        for pair in sample.events.windows(2) {
            let [Event::Sampled(light), Event::Added { source: Source::Sampled, radiance, .. }] = pair else {
                continue;
            };
            let pdf = match light.sample.scatter {
                lumbre_shading::Scatter::Density(pdf) => pdf,
                lumbre_shading::Scatter::Delta => 1.0,
            };
            let expected = light.scattered * light.sample.radiance * (light.weight / pdf) * light.passes;
            assert_eq!(bits(expected), bits(*radiance), "({x}, {y})");
            pairs += u32::from(!expected.is_black());
        }
    }
    assert!(pairs > 100, "{pairs}");
}
