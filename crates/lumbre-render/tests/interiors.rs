//! What solids take from light that goes through them, against closed forms.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Cuboid, Sphere};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform};
use lumbre_render::integrators::{Integrator, Path, Whitted};
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{Camera, CameraKind, LightDesc, Scene, SceneDesc};
use lumbre_shading::{FloatTexture, Material, MaterialKind, PrincipledParams, VolumeParams};

const CENTER: DVec3 = DVec3::new(3.0, -7.0, 11.0);
/// What a white light has left after [`DISTANCE`].
const COLOR: Rgb = Rgb::new(0.8, 0.5, 0.2);
const DISTANCE: f32 = 0.7;

fn number(v: f32) -> Arc<FloatTexture> {
    Arc::new(FloatTexture::Constant(v))
}

/// Clear and smooth.
fn solid(ior: f32, color: Rgb, distance: f32) -> Material {
    Material::new(MaterialKind::Principled(Box::new(PrincipledParams {
        metallic: number(0.0),
        roughness: number(0.0),
        transmission: number(1.0),
        ior,
        volume: Some(VolumeParams {
            attenuation_color: color,
            attenuation_distance: distance,
            ..VolumeParams::default()
        }),
        ..PrincipledParams::default()
    })))
}

/// Nothing but a light of radiance 1 from all around.
fn in_the_open() -> SceneDesc {
    let mut desc = empty();
    desc.lights.push(LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: Rgb::WHITE,
        image: None,
    });
    desc
}

/// The mean of the picture by paths without roulette, and by Whitted's tree of rays.
fn both(desc: &SceneDesc, camera: Camera, side: u32, spp: u32) -> [[f64; 3]; 2] {
    let scene = Scene::build(SceneDesc { cameras: vec![camera], ..desc.clone() }).unwrap();
    let path = Path { roulette_start: 1000, ..Path::new(64) };
    let whitted = Whitted { sky: true, ..Whitted::new(64) };
    let integrators: [&dyn Integrator; 2] = [&path, &whitted];
    integrators.map(|integrator| {
        let options = options(&scene, side, side, spp);
        let rendered = render_with(&scene, &options, integrator, &NoProgress, &CancelToken::new()).unwrap();
        assert_eq!(rendered.stats.dropped, 0);
        mean(&rendered.image)
    })
}

fn sigma(channel: usize) -> f64 {
    -f64::from(COLOR.to_array()[channel]).ln() / f64::from(DISTANCE)
}

#[test]
fn a_slab_leaves_what_beer_and_lambert_and_fresnel_say() {
    let mut count = 0;
    for (thickness, ior) in [(0.35, 1.5), (1.4, 1.5), (0.6, 2.2)] {
        let mut desc = in_the_open();
        let glass = add_material(&mut desc, solid(ior, COLOR, DISTANCE));
        let half = DVec3::new(200.0, 300.0, 0.5 * thickness);
        add(&mut desc, exact(Cuboid::new(CENTER - half, CENTER + half).unwrap()), glass);
        // Head on: R + (1 − R)² a (1 + R a + (R a)² + …), with a left after each crossing.
        let camera = peer(CENTER + DVec3::Z * thickness, DVec3::Z);
        for found in both(&desc, camera, 4, 1024) {
            for (channel, found) in found.into_iter().enumerate() {
                let r = f64::from((ior - 1.0) / (ior + 1.0)).powi(2);
                let a = (-sigma(channel) * thickness).exp();
                let expected = r + (1.0 - r).powi(2) * a / (1.0 - r * a);
                assert_close(found, expected, 8e-3, &format!("{thickness} {ior} {channel}"));
                count += 1;
            }
        }
    }
    assert_eq!(count, 18);
}

/// A camera that sees a square about the middle of a sphere, its rays parallel.
fn over(half: f64) -> Camera {
    Camera {
        kind: CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 },
        screen_window: Some([-half, half, -half, half]),
        ..look(CENTER - DVec3::new(4.0, -3.0, 9.0), CENTER, 45.0)
    }
}

#[test]
fn a_sphere_without_a_border_takes_what_its_chords_say() {
    let radius = 1.3;
    let mut desc = in_the_open();
    let haze = add_material(&mut desc, solid(1.0, COLOR, DISTANCE));
    add(&mut desc, exact(Sphere::new(CENTER, radius).unwrap()), haze);
    let side = 3.0;
    for found in both(&desc, over(0.5 * side), 64, 64) {
        for (channel, found) in found.into_iter().enumerate() {
            // ∫ exp(−2 σ √(r² − ρ²)) 2 π ρ dρ over the disk, and 1 outside it.
            let s = sigma(channel);
            let disk = std::f64::consts::PI / (2.0 * s * s)
                * (1.0 - (-2.0 * s * radius).exp() * (1.0 + 2.0 * s * radius));
            let area = side * side;
            let expected = (disk + area - std::f64::consts::PI * radius * radius) / area;
            assert_close(found, expected, 2e-3, &format!("{channel}"));
        }
    }
}

#[test]
fn a_solid_inside_another_takes_its_place_there() {
    let (outer, inner) = (2.0, 0.75);
    let mut desc = in_the_open();
    let haze = add_material(&mut desc, solid(1.0, COLOR, DISTANCE));
    let other = Rgb::new(0.3, 0.9, 0.6);
    let dye = add_material(&mut desc, solid(1.0, other, 1.1));
    add(&mut desc, exact(Sphere::new(CENTER, outer).unwrap()), haze);
    add(&mut desc, exact(Sphere::new(CENTER, inner).unwrap()), dye);
    let expected = |channel: usize, in_haze: f64, in_dye: f64| {
        let dye = -f64::from(other.to_array()[channel]).ln() / 1.1;
        (-sigma(channel) * in_haze - dye * in_dye).exp()
    };
    // Through the middle from outside, and from inside the inner one.
    for (from, in_haze, in_dye) in
        [(3.0, 2.0 * (outer - inner), 2.0 * inner), (0.5, outer - inner, 0.5 + inner)]
    {
        let camera = Camera {
            kind: CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 },
            screen_window: Some([-1e-6, 1e-6, -1e-6, 1e-6]),
            ..look(CENTER + DVec3::new(0.0, from, 0.0), CENTER, 45.0)
        };
        for found in both(&desc, camera, 4, 4) {
            for (channel, found) in found.into_iter().enumerate() {
                assert_close(found, expected(channel, in_haze, in_dye), 1e-4, &format!("{from} {channel}"));
            }
        }
    }
}

#[test]
fn glass_in_glass_of_the_same_index_cannot_be_seen() {
    let picture_of = |inner: Option<f32>| {
        let mut desc = in_the_open();
        let glass = add_material(&mut desc, solid(1.5, COLOR, DISTANCE));
        let half = DVec3::new(40.0, 30.0, 0.8);
        add(&mut desc, exact(Cuboid::new(CENTER - half, CENTER + half).unwrap()), glass);
        if let Some(ior) = inner {
            let same = add_material(&mut desc, solid(ior, COLOR, DISTANCE));
            add(&mut desc, exact(Sphere::new(CENTER, 0.6).unwrap()), same);
        }
        both(&desc, over(0.4), 24, 512)
    };
    let plain = picture_of(None);
    let mut differs = 0;
    for (same, other) in picture_of(Some(1.5)).iter().zip(picture_of(Some(1.9))) {
        for (channel, expected) in plain[0].into_iter().enumerate() {
            assert_close(same[channel], expected, 5e-3, &format!("{channel}"));
            differs += usize::from((other[channel] / expected - 1.0).abs() > 0.01);
        }
    }
    assert!(differs > 0);
}

/// A solid that scatters, in which light goes a `depth`th of a unit of length before it collides.
fn cloudy(ior: f32, color: Rgb, depth: f32, g: f32) -> Material {
    Material::new(MaterialKind::Principled(Box::new(PrincipledParams {
        metallic: number(0.0),
        roughness: number(0.0),
        transmission: number(1.0),
        ior,
        volume: Some(VolumeParams {
            attenuation_color: Rgb::splat((-1.0_f32).exp()),
            attenuation_distance: 1.0 / depth,
            scatter_color: color,
            scatter_anisotropy: g,
        }),
        ..PrincipledParams::default()
    })))
}

fn by_paths(desc: SceneDesc, camera: Camera, side: u32, spp: u32) -> [f64; 3] {
    let scene = Scene::build(SceneDesc { cameras: vec![camera], ..desc }).unwrap();
    let options = options(&scene, side, side, spp);
    let rendered = render_with(&scene, &options, &Path::new(64), &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!(rendered.stats.dropped, 0);
    mean(&rendered.image)
}

#[test]
fn a_lossless_scattering_solid_vanishes_under_a_white_sky() {
    for (ior, depth, g) in [(1.0, 2.0, 0.0), (1.5, 3.0, 0.6), (1.3, 9.0, -0.4)] {
        let mut desc = in_the_open();
        let cloud = add_material(&mut desc, cloudy(ior, Rgb::WHITE, depth, g));
        add(&mut desc, exact(Sphere::new(CENTER, 1.3).unwrap()), cloud);
        for found in by_paths(desc, over(1.2), 24, 64) {
            assert_close(found, 1.0, 5e-3, &format!("{ior} {depth} {g}"));
        }
    }
}

#[test]
fn a_deep_body_shows_the_colour_that_many_collisions_leave() {
    let color = Rgb::new(0.8, 0.5, 0.2);
    let (radius, side) = (1.3, 3.0);
    let mut desc = in_the_open();
    let wax = add_material(&mut desc, cloudy(1.0, color, 60.0, 0.0));
    add(&mut desc, exact(Sphere::new(CENTER, radius).unwrap()), wax);
    let disk = std::f64::consts::PI * radius * radius;
    let area = side * side;
    let found = by_paths(desc, over(0.5 * side), 48, 256);
    for (found, expected) in found.into_iter().zip(color.to_array()) {
        // A sphere shows every angle as often as it counts; around it is the sky. The formula is a fit.
        let found = (found * area - (area - disk)) / disk;
        assert_close(found, f64::from(expected), 0.03, "the colour of wax");
    }
}
