//! Bodies that light wanders through, against what goes in and what must come out.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Cuboid, Sphere};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform};
use lumbre_render::integrators::Path;
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{Camera, CameraKind, LightDesc, Scene, SceneDesc};
use lumbre_shading::subsurface::{Inside, SubsurfaceParams};
use lumbre_shading::{Material, MaterialKind, Roughness, SpectrumTexture, fresnel};

const CENTER: DVec3 = DVec3::new(3.0, -7.0, 11.0);
const ETA: f32 = 1.33;

fn colour(c: Rgb) -> Arc<SpectrumTexture> {
    Arc::new(SpectrumTexture::Constant(c))
}

fn body(inside: Inside, alpha: f32) -> Material {
    Material::new(MaterialKind::Subsurface(Box::new(SubsurfaceParams {
        inside,
        scale: 1.0,
        asymmetry: 0.0,
        eta: ETA,
        roughness: Roughness::isotropic(alpha, false),
    })))
}

fn sky() -> LightDesc {
    LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance: Rgb::WHITE, image: None }
}

fn render(desc: SceneDesc, camera: Camera, depth: u32, side: u32, spp: u32) -> [f64; 3] {
    let scene = Scene::build(SceneDesc { cameras: vec![camera], ..desc }).unwrap();
    let path = Path { roulette_start: 1000, ..Path::new(depth) };
    let options = options(&scene, side, side, spp);
    let rendered = render_with(&scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!(rendered.stats.dropped, 0);
    mean(&rendered.image)
}

fn over(half: f64) -> Camera {
    Camera {
        kind: CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 },
        screen_window: Some([-half, half, -half, half]),
        ..look(CENTER - DVec3::new(4.0, -3.0, 9.0), CENTER, 45.0)
    }
}

#[test]
fn a_lossless_body_vanishes_under_an_even_sky() {
    // At two bounces: the reflection, and what comes through the body once.
    for (depth, sigma) in [(64, 0.7), (64, 6.0)] {
        let mut desc = empty();
        desc.lights.push(sky());
        let scattering = Rgb::new(sigma, 0.5 * sigma, 2.0 * sigma);
        let inside = Inside::Coefficients { absorption: colour(Rgb::BLACK), scattering: colour(scattering) };
        let wax = add_material(&mut desc, body(inside, 0.0));
        add(&mut desc, exact(Sphere::new(CENTER, 1.3).unwrap()), wax);
        for (channel, found) in render(desc, over(1.0), depth, 24, 96).into_iter().enumerate() {
            assert_close(found, 1.0, 0.012, &format!("{sigma} {channel}"));
        }
    }
}

/// A deep body whose reflectance is this, and where its surface is.
fn deep(reflectance: Rgb) -> (SceneDesc, DVec3) {
    let mut desc = empty();
    let inside = Inside::Reflectance {
        reflectance: colour(reflectance),
        mean_free_path: colour(Rgb::new(0.01, 0.02, 0.015)),
    };
    let wax = add_material(&mut desc, body(inside, 0.0));
    let half = DVec3::new(30.0, 40.0, 10.0);
    add(&mut desc, exact(Cuboid::new(CENTER - half, CENTER + half).unwrap()), wax);
    (desc, CENTER + DVec3::Z * half.z)
}

#[test]
fn a_deep_body_has_the_requested_albedo() {
    let reflectance = Rgb::new(0.2, 0.5, 0.8);
    let bare = f64::from(fresnel::dielectric(1.0, ETA));
    let (mut desc, top) = deep(reflectance);
    desc.lights.push(sky());
    for (channel, found) in render(desc, peer(top, DVec3::Z), 1, 4, 4096).into_iter().enumerate() {
        // What is reflected, and the share of what enters. At one bounce: the way below the surface does not count.
        let expected = bare + (1.0 - bare) * f64::from(reflectance.to_array()[channel]);
        assert_close(found, expected, 0.06, &format!("sky {channel}"));
    }
    // Two thirds of the way down from the zenith.
    let (mut desc, top) = deep(reflectance);
    let slant = 60_f64.to_radians();
    desc.lights.push(LightDesc::Distant {
        towards: DVec3::new(slant.sin(), 0.0, slant.cos()),
        irradiance: Rgb::splat(2.0),
    });
    // Even light from outside comes through the boundary but for this.
    let passes = 1.0 - 0.0664;
    for (channel, found) in render(desc, peer(top, DVec3::Z), 1, 4, 4096).into_iter().enumerate() {
        let share = f64::from(reflectance.to_array()[channel]);
        let through = 1.0 - f64::from(fresnel::dielectric(slant.cos() as f32, ETA));
        let even = through * slant.cos() / (std::f64::consts::PI * passes);
        assert_close(found, 2.0 * (1.0 - bare) * share * even, 0.06, &format!("distant {channel}"));
    }
}

#[test]
fn a_thin_body_lets_more_light_through_than_a_thick_one() {
    let behind = |thickness: f64| {
        let mut desc = empty();
        let inside = Inside::Reflectance {
            reflectance: colour(Rgb::new(0.9, 0.6, 0.3)),
            mean_free_path: colour(Rgb::splat(0.1)),
        };
        let wax = add_material(&mut desc, body(inside, 0.2));
        let half = DVec3::new(20.0, 20.0, 0.5 * thickness);
        add(&mut desc, exact(Cuboid::new(CENTER - half, CENTER + half).unwrap()), wax);
        desc.lights.push(LightDesc::Distant { towards: -DVec3::Z, irradiance: Rgb::splat(1.0) });
        render(desc, peer(CENTER + DVec3::Z * half.z, DVec3::Z), 4, 4, 1024)
    };
    let (thin, thick) = (behind(0.1), behind(0.8));
    for channel in 0..3 {
        assert!(thin[channel] > 2.0 * thick[channel] && thick[channel] > 0.0, "{thin:?} {thick:?}");
    }
    // Red comes farther than blue.
    assert!(thick[0] / thick[2] > 3.0 * thin[0] / thin[2], "{thin:?} {thick:?}");
}
