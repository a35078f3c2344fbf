//! Media between surfaces, against closed forms and furnaces.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Cuboid, Sphere};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform};
use lumbre_render::integrators::Path;
use lumbre_render::transport::Strategy;
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{Boundary, Camera, CameraKind, GeometryDesc, LightDesc, MediumId, Scene, SceneDesc};
use lumbre_shading::medium::{
    Coefficients, Density, Glow, Grid, HeterogeneousMedium, HomogeneousMedium, Medium,
};
use lumbre_shading::{FloatTexture, Material, MaterialKind, Roughness};

const CENTER: DVec3 = DVec3::new(3.0, -7.0, 11.0);

fn homogeneous(absorption: Rgb, scattering: Rgb, asymmetry: f32, glow: Rgb) -> Medium {
    let extinction = absorption + scattering;
    let albedo = scattering.zip(extinction, |s, t| if t > 0.0 { s / t } else { 0.0 });
    Medium::Homogeneous { medium: HomogeneousMedium { extinction, albedo, asymmetry }, glow, spectra: None }
}

/// Voxels of uneven density in the cube about the centre that is as wide as the sphere of radius 1.
fn grid(absorption: Rgb, scattering: Rgb) -> Medium {
    let density = (0..60_u16).map(|i| f32::from(i * 7 % 11) * 0.4).collect();
    Medium::Heterogeneous(Box::new(HeterogeneousMedium::new(
        Transform::IDENTITY,
        [CENTER - 1.0, CENTER + 1.0],
        0.4,
        Coefficients::Scaled {
            density: Density::Grid(Grid::new([5, 4, 3], density).unwrap()),
            absorption,
            scattering,
        },
        Glow::None,
    )))
}

fn sky(radiance: Rgb) -> LightDesc {
    LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance, image: None }
}

/// A shape full of a medium under a white sky, and the index of the medium.
fn filled(medium: Medium, shape: GeometryDesc) -> SceneDesc {
    let mut desc = empty();
    desc.lights.push(sky(Rgb::WHITE));
    desc.media.push(Arc::new(medium));
    let nothing = add_material(&mut desc, Material::new(MaterialKind::Interface));
    add(&mut desc, shape, nothing).boundary = Some(Boundary { inside: Some(MediumId(0)), outside: None });
    desc
}

fn ball() -> GeometryDesc {
    exact(Sphere::new(CENTER, 1.0).unwrap())
}

fn cube() -> GeometryDesc {
    exact(Cuboid::new(CENTER - 1.0, CENTER + 1.0).unwrap())
}

/// A camera that sees a square about the centre along z, its rays parallel.
fn over(half: f64) -> Camera {
    Camera {
        kind: CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 },
        screen_window: Some([-half, half, -half, half]),
        ..look(CENTER - 4.0 * DVec3::Z, CENTER, 45.0)
    }
}

/// The mean of the picture by paths of at most this many bounces, without roulette.
fn seen(desc: &SceneDesc, camera: Camera, depth: u32, side: u32, spp: u32) -> [f64; 3] {
    let scene = Scene::build(SceneDesc { cameras: vec![camera], ..desc.clone() }).unwrap();
    let path = Path { roulette_start: 1000, ..Path::new(depth) };
    let options = options(&scene, side, side, spp);
    let rendered = render_with(&scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!(rendered.stats.dropped, 0);
    mean(&rendered.image)
}

#[test]
fn a_cube_absorbs_what_beer_and_lambert_say() {
    let absorption = Rgb::new(0.2, 0.5, 1.0);
    let desc = filled(homogeneous(absorption, Rgb::BLACK, 0.0, Rgb::BLACK), cube());
    for (channel, found) in seen(&desc, over(0.5), 8, 8, 4).into_iter().enumerate() {
        let expected = (-2.0 * f64::from(absorption.to_array()[channel])).exp();
        assert_close(found, expected, 1e-5, &format!("{channel}"));
    }
}

#[test]
fn a_medium_of_the_radiance_around_cannot_be_seen() {
    let radiance = Rgb::new(0.4, 0.7, 1.3);
    let medium = homogeneous(Rgb::splat(0.5), Rgb::splat(2.0), 0.6, radiance);
    let mut desc = filled(medium, ball());
    desc.lights = vec![sky(radiance)];
    let found = seen(&desc, over(1.1), 200, 16, 256);
    for (found, expected) in found.into_iter().zip(radiance.to_array()) {
        assert_close(found, expected.into(), 6e-3, "isothermal");
    }
}

#[test]
fn what_only_scatters_cannot_be_seen_in_a_furnace() {
    let colour = Rgb::new(0.3, 1.0, 3.0);
    let media = [
        homogeneous(Rgb::BLACK, colour, 0.5, Rgb::BLACK),
        homogeneous(Rgb::BLACK, colour, -0.8, Rgb::BLACK),
        grid(Rgb::BLACK, colour),
    ];
    for (i, medium) in media.into_iter().enumerate() {
        let desc = filled(medium, cube());
        for found in seen(&desc, over(1.2), 500, 16, 256) {
            assert_close(found, 1.0, 1e-2, &format!("{i}"));
        }
    }
}

#[test]
fn single_scattering_of_a_beam_is_what_its_integral_says() {
    let (absorption, scattering, g) = (0.4_f64, 0.6_f64, 0.4_f64);
    let (a, s) = (Rgb::splat(absorption as f32), Rgb::splat(scattering as f32));
    let mut desc = filled(homogeneous(a, s, g as f32, Rgb::BLACK), cube());
    desc.lights = vec![LightDesc::Distant { towards: DVec3::Y, irradiance: Rgb::splat(2.0) }];
    let sigma = absorption + scattering;
    let phase = (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g).powf(1.5));
    let part = 1.0 - (-2.0 * sigma).exp();
    // The mean over the depth of the beam, and the integral along the ray.
    let expected = 2.0 * scattering * phase * part / (2.0 * sigma) * part / sigma;
    for found in seen(&desc, over(1.0), 1, 16, 512) {
        assert_close(found, expected, 1e-2, "single scattering");
    }
    // Deeper paths find more.
    assert!(seen(&desc, over(1.0), 2, 8, 64)[0] > 1.05 * expected);
}

#[test]
fn shadows_are_what_media_leave_of_the_light() {
    let absorption = Rgb::new(0.5, 1.0, 1.5);
    let mut desc = filled(homogeneous(absorption, Rgb::BLACK, 0.0, Rgb::BLACK), cube());
    desc.lights =
        vec![LightDesc::Distant { towards: DVec3::Y, irradiance: Rgb::splat(std::f32::consts::PI) }];
    let grey = add_material(&mut desc, diffuse(0.5));
    let under = CENTER - 1.5 * DVec3::Y;
    let half = DVec3::new(0.2, 0.1, 0.2);
    add(&mut desc, exact(Cuboid::new(under - half, under + half).unwrap()), grey);
    let camera = peer(under + 0.1 * DVec3::Y, DVec3::new(0.01, 1.0, 0.0));
    for (channel, found) in seen(&desc, camera, 1, 2, 4).into_iter().enumerate() {
        let expected = 0.5 * (-2.0 * f64::from(absorption.to_array()[channel])).exp();
        assert_close(found, expected, 1e-4, &format!("{channel}"));
    }
}

#[test]
fn the_camera_may_stand_inside_and_media_touch() {
    // Two cubes side by side in x, of different media; a ray along x from inside the first.
    let (a, b) = (Rgb::new(0.3, 0.1, 0.7), Rgb::new(0.2, 0.9, 0.4));
    let mut desc = filled(homogeneous(a, Rgb::BLACK, 0.0, Rgb::BLACK), cube());
    desc.media.push(Arc::new(homogeneous(b, Rgb::BLACK, 0.0, Rgb::BLACK)));
    let nothing = desc.shapes[0].material.unwrap();
    let next = CENTER + 2.0 * DVec3::X;
    let other = exact(Cuboid::new(next - 1.0, next + 1.0).unwrap());
    add(&mut desc, other, nothing).boundary = Some(Boundary { inside: Some(MediumId(1)), outside: None });
    let inside = Camera {
        kind: CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 },
        screen_window: Some([-0.5, 0.5, -0.5, 0.5]),
        medium: Some(MediumId(0)),
        ..look(CENTER + 0.25 * DVec3::X, CENTER + 5.0 * DVec3::X, 45.0)
    };
    for (channel, found) in seen(&desc, inside, 8, 4, 4).into_iter().enumerate() {
        let [a, b] = [a, b].map(|sigma| f64::from(sigma.to_array()[channel]));
        assert_close(found, (-0.75 * a - 2.0 * b).exp(), 1e-5, &format!("{channel}"));
    }
}

#[test]
fn glass_may_hold_a_medium() {
    let absorption = Rgb::new(0.1, 0.4, 1.0);
    let mut desc = filled(homogeneous(absorption, Rgb::BLACK, 0.0, Rgb::BLACK), ball());
    let zero = Arc::new(FloatTexture::Constant(0.0));
    let roughness = Roughness { u: zero.clone(), v: zero, remap: false };
    let glass = Material::new(MaterialKind::Dielectric { eta: 1.5, roughness });
    desc.shapes.clear();
    let glass = add_material(&mut desc, glass);
    let half = DVec3::new(50.0, 50.0, 1.0);
    add(&mut desc, exact(Cuboid::new(CENTER - half, CENTER + half).unwrap()), glass).boundary =
        Some(Boundary { inside: Some(MediumId(0)), outside: None });
    for (channel, found) in seen(&desc, over(0.1), 64, 8, 1024).into_iter().enumerate() {
        let a = (-2.0 * f64::from(absorption.to_array()[channel])).exp();
        let expected = 0.04 + 0.96 * 0.96 * a / (1.0 - 0.04 * a);
        assert_close(found, expected, 8e-3, &format!("{channel}"));
    }
}

#[test]
fn lights_inside_are_found_alike_by_samples_and_by_chance() {
    let mut desc = filled(grid(Rgb::splat(0.1), Rgb::new(0.9, 0.6, 0.3)), cube());
    desc.lights.clear();
    let black = add_material(&mut desc, diffuse(0.0));
    let lamp = add(&mut desc, exact(Sphere::new(CENTER + 0.3, 0.4).unwrap()), black);
    lamp.area_light = Some(glow(5.0));
    lamp.boundary = Some(Boundary { inside: None, outside: Some(MediumId(0)) });
    let scene = Scene::build(SceneDesc { cameras: vec![over(1.2)], ..desc }).unwrap();
    let options = options(&scene, 16, 16, 512);
    let means = [Strategy::Both, Strategy::Bsdf, Strategy::Lights].map(|strategy| {
        let path = Path { strategy, ..Path::new(100) };
        mean(&render_with(&scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap().image)[0]
    });
    for found in &means[1..] {
        assert_close(*found, means[0], 1.5e-2, &format!("{means:?}"));
    }
}

#[test]
fn nothing_is_seen_through_endless_fog() {
    let mut desc = filled(homogeneous(Rgb::splat(0.3), Rgb::splat(0.1), 0.0, Rgb::BLACK), ball());
    desc.shapes.clear();
    let camera = Camera { medium: Some(MediumId(0)), ..over(1.0) };
    assert_eq!(seen(&desc, camera, 100, 8, 4), [0.0; 3]);
}

#[test]
fn rays_that_do_not_know_media_go_through_their_boundaries() {
    let desc = filled(homogeneous(Rgb::WHITE, Rgb::WHITE, 0.0, Rgb::BLACK), ball());
    let scene = Scene::build(SceneDesc { cameras: vec![over(1.0)], ..desc }).unwrap();
    let ray = lumbre_geometry::Ray::new(CENTER - 4.0 * DVec3::Z, DVec3::Z);
    assert!(scene.closest(&ray).is_none() && !scene.is_occluded(&ray));
    let mut crossings = Vec::new();
    scene.crossings(&ray, &mut crossings);
    let found: Vec<_> = crossings.iter().map(|crossing| (crossing.t, crossing.beyond)).collect();
    assert_eq!(found, [(3.0, Some(MediumId(0))), (5.0, None)]);
}
