//! Paths that carry wavelengths: against closed forms, against paths of colours, and against themselves.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::*;
use crate::determinism::still_life;
use lumbre_geometry::Sphere;
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform, Vec3};
use lumbre_render::{CancelToken, NoProgress, RenderError, RenderOptions, Rendered, render};
use lumbre_scene::{AreaLightDesc, Boundary, IntegratorKind, LightDesc, MediumId, Scene, SceneDesc};
use lumbre_shading::medium::Medium;
use lumbre_shading::spectrum::{LightCurve, Wavelengths};
use lumbre_shading::{
    HomogeneousMedium, Material, MaterialKind, NamedSpectrum, Roughness, SpectrumTexture, SpectrumValue,
    Texture,
};

const CENTER: DVec3 = DVec3::new(3.0, -7.0, 11.0);

fn spectral(scene: &Scene, width: u32, height: u32, spp: u32) -> RenderOptions {
    changed(options(scene, width, height, spp), |it| it.spectral = true)
}

fn seen(scene: &Scene, spp: u32) -> [f64; 3] {
    mean(&picture(scene, &spectral(scene, 12, 12, spp)).image)
}

fn assert_near(found: [f64; 3], expected: [f64; 3], share: f64, what: &str) {
    for (found, expected) in found.into_iter().zip(expected) {
        assert!(
            (found - expected).abs() < share * expected.abs().max(0.1),
            "{what}: {found}, expected {expected}"
        );
    }
}

/// The colour of radiance that is a function of the wavelengths.
fn colour(radiance: impl Fn(&Wavelengths) -> Rgb) -> [f64; 3] {
    const COUNT: u32 = 20_000;
    let mut sum = [0.0; 3];
    for i in 0..COUNT {
        let wavelengths = Wavelengths::visible((i as f32 + 0.5) / COUNT as f32);
        let seen = wavelengths.rec709(radiance(&wavelengths)).to_array();
        (0..3).for_each(|c| sum[c] += f64::from(seen[c]) / f64::from(COUNT));
    }
    sum
}

fn of_colour(reflectance: Rgb) -> Material {
    Material::new(MaterialKind::Diffuse { reflectance: Arc::new(SpectrumTexture::Constant(reflectance)) })
}

/// A hollow ball that emits, seen from within.
fn room(material: Material, light: AreaLightDesc) -> SceneDesc {
    let mut desc = empty();
    let material = add_material(&mut desc, material);
    let walls = add(&mut desc, exact(Sphere::new(CENTER, 2.5).unwrap()), material);
    walls.reverse_orientation = true;
    walls.area_light = Some(light);
    desc.cameras = vec![look(CENTER + DVec3::new(0.3, 0.2, -0.4), CENTER + DVec3::X, 50.0)];
    desc.integrator.max_depth = 60;
    desc
}

#[test]
fn a_neutral_room_is_as_bright_as_by_colours() {
    let scene = Scene::build(room(diffuse(0.6), glow(0.4))).unwrap();
    assert_near(seen(&scene, 128), [1.0; 3], 4e-3, "by wavelengths");
}

#[test]
fn a_coloured_room_multiplies_spectra_and_not_colours() {
    let reflectance = Rgb::new(0.7, 0.3, 0.15);
    let scene = Scene::build(room(of_colour(reflectance), glow(0.5))).unwrap();
    let whole = |w: &Wavelengths| {
        w.light(Rgb::splat(0.5)).zip(w.reflectance(reflectance), |light, rho| light / (1.0 - rho))
    };
    let expected = colour(whole);
    assert_near(seen(&scene, 256), expected, 6e-3, "by wavelengths");
    let by_colours = mean(&picture(&scene, &options(&scene, 12, 12, 64)).image);
    assert!((by_colours[1] - expected[1]).abs() > 0.02, "{by_colours:?} {expected:?}");
}

#[test]
fn spectra_are_evaluated_at_the_wavelengths() {
    let ramp = SpectrumValue::Sampled(vec![(360.0, 0.1), (830.0, 0.7)]);
    let lamp = SpectrumValue::Named(NamedSpectrum::from_name("stdillum-F11").unwrap());
    let material = Material::new(MaterialKind::Diffuse {
        reflectance: Arc::new(Texture::Spectrum {
            value: ramp.reflectance_rgb(),
            spectrum: Arc::new(ramp.clone()),
        }),
    });
    let curve = Arc::new(LightCurve::of(&lamp).unwrap());
    let light =
        AreaLightDesc { radiance: lamp.illuminant_rgb() * 2.0, spectrum: Some(curve.clone()), ..glow(1.0) };
    let scene = Scene::build(room(material, light)).unwrap();
    let expected =
        colour(|w| (w.curve(&curve) * 2.0).zip(w.values(&ramp).unwrap(), |light, rho| light / (1.0 - rho)));
    // Lines of a lamp make noise.
    assert_near(seen(&scene, 512), expected, 1.5e-2, "by wavelengths");
}

/// A floor of two triangles under a light, seen from above.
fn floor(light: LightDesc) -> SceneDesc {
    let mut desc = empty();
    let material = add_material(&mut desc, of_colour(Rgb::new(0.2, 0.5, 0.7)));
    let corners = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
    let positions = corners.map(|(x, y)| Vec3::new(x, y, 0.5)).to_vec();
    add(&mut desc, mesh(positions, vec![[0, 1, 2], [0, 2, 3]], vec![]), material);
    desc.lights.push(light);
    desc.cameras = vec![look(DVec3::new(0.0, 0.3, 4.0), DVec3::new(0.0, 0.0, 0.5), 20.0)];
    desc
}

#[test]
fn single_bounces_match_the_colour_of_rgb_paths() {
    let white = Rgb::splat(3.0);
    let lights = [
        LightDesc::Point { from: DVec3::new(0.5, 1.0, 3.5), intensity: white },
        LightDesc::Distant { towards: DVec3::new(0.3, 0.1, 1.0).normalize(), irradiance: white },
        LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance: white, image: None },
    ];
    for light in lights {
        let what = format!("{light:?}");
        let scene = Scene::build(floor(light)).unwrap();
        let by_colours = mean(&picture(&scene, &options(&scene, 12, 12, 64)).image);
        assert_near(seen(&scene, 128), by_colours, 8e-3, &what);
    }
}

#[test]
fn a_medium_takes_its_share_at_each_wavelength() {
    let sigma = Rgb::new(0.1, 0.5, 1.1);
    let mut desc = empty();
    desc.media.push(Arc::new(Medium::Homogeneous {
        medium: HomogeneousMedium { extinction: sigma, albedo: Rgb::BLACK, asymmetry: 0.0 },
        glow: Rgb::BLACK,
        spectra: None,
    }));
    let material = add_material(&mut desc, Material::new(MaterialKind::Interface));
    let ball = add(&mut desc, exact(Sphere::new(CENTER, 2.5).unwrap()), material);
    ball.boundary = Some(Boundary { inside: Some(MediumId(0)), outside: None });
    let sky = Rgb::splat(2.0);
    desc.lights.push(LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: sky,
        image: None,
    });
    // From the middle, all ways are as long.
    let mut camera = look(CENTER, CENTER + DVec3::X, 50.0);
    camera.medium = Some(MediumId(0));
    desc.cameras = vec![camera];
    let scene = Scene::build(desc).unwrap();
    let expected =
        colour(|w| w.light(sky).zip(w.coefficient(sigma), |light, sigma| light * (-2.5 * sigma).exp()));
    assert_near(seen(&scene, 64), expected, 8e-3, "through the medium");
}

#[test]
fn a_dispersive_glass_ball_vanishes_under_a_white_sky() {
    let glass = NamedSpectrum::from_name("glass-F11").unwrap();
    let mut desc = empty();
    let mut material = Material::new(MaterialKind::Dielectric { eta: 1.78, roughness: Roughness::smooth() });
    material.dispersion = Some(Arc::new(SpectrumValue::Named(glass)));
    let material = add_material(&mut desc, material);
    add(&mut desc, exact(Sphere::new(CENTER, 2.5).unwrap()), material);
    let sky = Rgb::splat(2.0);
    desc.lights.push(LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: sky,
        image: None,
    });
    desc.cameras = vec![look(CENTER + DVec3::new(9.0, 0.0, 0.5), CENTER, 25.0)];
    desc.integrator.max_depth = 40;
    let scene = Scene::build(desc).unwrap();
    assert!(scene.disperses());
    // The hero wavelength alone is noisier.
    assert_near(seen(&scene, 512), [2.0; 3], 1.2e-2, "through glass");
}

#[test]
fn neither_threads_nor_parts_show() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let whole = spectral(&scene, 40, 30, 6);
    let one = picture(&scene, &whole);
    let two = picture(&scene, &changed(whole.clone(), |it| it.threads = 2));
    assert_eq!(one.image, two.image);
    let rgb = picture(&scene, &options(&scene, 40, 30, 6));
    assert_ne!(one.image, rgb.image);
    let [of_one, of_rgb] = [&one, &rgb].map(|rendered: &Rendered| mean(&rendered.image));
    for (one, rgb) in of_one.into_iter().zip(of_rgb) {
        assert!((one / rgb - 1.0).abs() < 0.05, "{of_one:?} {of_rgb:?}");
    }
}

#[test]
fn integrators_that_follow_colours_refuse_wavelengths() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let base = spectral(&scene, 8, 8, 1);
    for name in IntegratorKind::NAMES.into_iter().filter(|name| *name != "path") {
        let kind = IntegratorKind::from_name(name).unwrap();
        let options = changed(base.clone(), |it| it.integrator.kind = kind);
        let refused = render(&scene, &options, &NoProgress, &CancelToken::new()).unwrap_err();
        assert_eq!(refused, RenderError::NoWavelengths, "{name}");
    }
}
