//! What a camera sees of the ground, against closed forms.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::{add, add_material, changed, diffuse, empty, exact, options, picture};
use lumbre_geometry::{Disk, Sphere};
use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, DMat3, DVec3, Transform};
use lumbre_render::denoise;
use lumbre_scene::{
    Camera, CameraKind, EnvironmentDesc, GeometryDesc, GroundDesc, LightDesc, Scene, SceneDesc, WithoutLight,
};
use lumbre_shading::{Material, MaterialKind, PrincipledParams, Roughness, Texture};

const RADIUS: f64 = 1.5;
const HEIGHT: f64 = 2.0;

/// A black disk that hovers over the ground, seen from below the disk, straight down.
fn hovering(lights: Vec<LightDesc>, catcher: bool) -> SceneDesc {
    let placement = DAffine3::from_mat3_translation(
        DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y),
        DVec3::new(3.0, 4.0 + 0.5 * HEIGHT, -2.0),
    );
    let camera = Camera {
        name: None,
        // The picture is a spot in the middle.
        kind: CameraKind::Perspective { fov: 0.5, lens_radius: 0.0, focal_distance: 1.0 },
        world_from_camera: Transform::from_affine(placement).unwrap(),
        motion: None,
        frame_aspect: None,
        screen_window: None,
        shutter_open: 0.0,
        shutter_close: 1.0,
        medium: None,
        clip: None,
    };
    let mut desc = SceneDesc {
        cameras: vec![camera],
        lights,
        without_light: WithoutLight::Dark,
        ground: Some(GroundDesc {
            point: DVec3::new(-9.0, 4.0, 7.0),
            normal: DVec3::new(0.0, 2.0, 0.0),
            reflectance: Rgb::splat(0.5),
            catcher,
        }),
        ..empty()
    };
    let black = add_material(&mut desc, diffuse(0.0));
    let disk = Disk::new(DVec3::new(3.0, 4.0 + HEIGHT, -2.0), DVec3::Y, RADIUS, 0.0).unwrap();
    add(&mut desc, exact(disk), black);
    desc
}

fn sky(radiance: Rgb) -> LightDesc {
    LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance, image: None }
}

fn look(desc: SceneDesc, transparent: bool) -> (Rgb, f32) {
    let scene = Scene::build(desc).unwrap();
    let rendered =
        picture(&scene, &changed(options(&scene, 12, 10, 2048), |it| it.transparent = transparent));
    let alpha = rendered.image.alpha().map_or(1.0, |a| a.iter().sum::<f32>() / a.len() as f32);
    (rendered.image.mean(), alpha)
}

/// The share of an even sky that the disk hides: its view factor.
fn hidden() -> f64 {
    RADIUS * RADIUS / (RADIUS * RADIUS + HEIGHT * HEIGHT)
}

#[test]
fn shadows_under_an_even_sky_are_view_factors() {
    let (colour, alpha) = look(hovering(vec![sky(Rgb::new(2.0, 3.0, 4.0))], true), true);
    assert_eq!(colour, Rgb::BLACK);
    assert!((f64::from(alpha) / hidden() - 1.0).abs() < 0.01, "{alpha} {}", hidden());
}

#[test]
fn a_shadow_without_noise_is_the_same_shadow() {
    let scene = Scene::build(hovering(vec![sky(Rgb::new(2.0, 3.0, 4.0))], true)).unwrap();
    let noisy = changed(options(&scene, 24, 20, 8), |it| it.transparent = true);
    let rendered = picture(&scene, &changed(noisy.clone(), |it| it.guides = true));
    assert_eq!(rendered.image, picture(&scene, &noisy).image, "guides change nothing");
    let denoised = denoise(&rendered, 1).unwrap();
    // The whole picture has one shadow.
    let spread = |image: &Image| {
        let alpha = image.alpha().unwrap();
        let errors = alpha.iter().map(|&a| (f64::from(a) - hidden()).powi(2));
        errors.sum::<f64>() / alpha.len() as f64
    };
    let (before, after) = (spread(&rendered.image), spread(&denoised.image));
    assert!(after * 10.0 < before, "{before} -> {after}");
    assert!(denoised.image.pixels().iter().all(|&c| c == Rgb::BLACK));
}

#[test]
fn a_shadow_darkens_the_sky_behind_it() {
    // The camera looks down, where the same even sky is.
    let (colour, alpha) = look(hovering(vec![sky(Rgb::new(2.0, 3.0, 4.0))], true), false);
    assert_eq!(alpha, 1.0);
    let left = (1.0 - hidden()) as f32;
    for (found, sky) in colour.to_array().into_iter().zip([2.0, 3.0, 4.0]) {
        assert!((found / (sky * left) - 1.0).abs() < 0.01, "{colour:?}");
    }
}

#[test]
fn a_lamp_that_is_hidden_takes_its_share_of_the_light_with_it() {
    // Straight above, at three times the height of the disk: irradiance I / d².
    let lamp =
        LightDesc::Point { from: DVec3::new(3.0, 4.0 + 3.0 * HEIGHT, -2.0), intensity: Rgb::splat(90.0) };
    let (_, alpha) = look(hovering(vec![sky(Rgb::splat(0.8)), lamp], true), true);
    let (from_sky, from_lamp) = (0.8 * std::f64::consts::PI, 90.0 / (9.0 * HEIGHT * HEIGHT));
    let expected = (from_sky * hidden() + from_lamp) / (from_sky + from_lamp);
    assert!((f64::from(alpha) / expected - 1.0).abs() < 0.02, "{alpha} {expected}");
}

/// The same place below something clear, in place of the disk.
fn below(lights: Vec<LightDesc>, kind: MaterialKind, geometry: GeometryDesc) -> SceneDesc {
    let mut desc = hovering(lights, true);
    desc.shapes.clear();
    let clear = add_material(&mut desc, Material::new(kind));
    add(&mut desc, geometry, clear);
    desc
}

/// What glass of index 1.5 reflects of light that comes at an angle, and the angle inside it.
fn fresnel(angle: f64) -> (f64, f64) {
    let inside = (angle.sin() / 1.5).asin();
    let (outer, inner) = (angle.cos(), inside.cos());
    let across = ((outer - 1.5 * inner) / (outer + 1.5 * inner)).powi(2);
    let along = ((1.5 * outer - inner) / (1.5 * outer + inner)).powi(2);
    (0.5 * (across + along), inside)
}

/// The share of an even sky that comes to the ground from angles up to `most` from straight above, of what `left` says.
fn share(most: f64, left: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 20_000;
    let angles = (0..STEPS).map(|i| most * (f64::from(i) + 0.5) / f64::from(STEPS));
    angles.map(|a| left(a) * 2.0 * a.sin() * a.cos()).sum::<f64>() * most / f64::from(STEPS)
}

#[test]
fn a_pane_takes_from_the_light_what_it_reflects() {
    let pane = || exact(Disk::new(DVec3::new(3.0, 4.0 + HEIGHT, -2.0), DVec3::Y, RADIUS, 0.0).unwrap());
    let kind = || MaterialKind::ThinDielectric { eta: 1.5 };
    // With all that goes to and fro inside.
    let reflected = |angle: f64| 2.0 * fresnel(angle).0 / (1.0 + fresnel(angle).0);
    let from_sky = share((RADIUS / HEIGHT).atan(), reflected);
    let (_, alpha) = look(below(vec![sky(Rgb::splat(0.8))], kind(), pane()), true);
    assert!((f64::from(alpha) / from_sky - 1.0).abs() < 0.02, "{alpha} {from_sky}");
    let lamp =
        LightDesc::Point { from: DVec3::new(3.0, 4.0 + 3.0 * HEIGHT, -2.0), intensity: Rgb::splat(90.0) };
    let (_, alpha) = look(below(vec![lamp], kind(), pane()), true);
    assert!((f64::from(alpha) / reflected(0.0) - 1.0).abs() < 0.02, "{alpha} {}", reflected(0.0));
}

#[test]
fn refracting_glass_blocks_light_as_optics_predicts() {
    let middle = HEIGHT + RADIUS;
    let ball = exact(Sphere::new(DVec3::new(3.0, 4.0 + middle, -2.0), RADIUS).unwrap());
    let kind = MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::smooth() };
    let most = (RADIUS / middle).asin();
    // Looked at from the ground, after this many reflections inside; what comes from below the horizon is dark.
    let passed = share(most, |angle| {
        let outside = (angle.sin() * middle / RADIUS).min(1.0).asin();
        let (reflected, inside) = fresnel(outside);
        let after = |bounces: i32| {
            let turned =
                2.0 * (outside - inside) + f64::from(bounces) * (std::f64::consts::PI - 2.0 * inside);
            let is_up = (angle - turned).cos() > 0.0;
            if is_up { (1.0 - reflected).powi(2) * reflected.powi(bounces) } else { 0.0 }
        };
        (0..12).map(after).sum()
    });
    let hidden = most.sin().powi(2);
    assert!(passed > 0.7 * hidden, "{passed} {hidden}");
    let (_, alpha) = look(below(vec![sky(Rgb::splat(0.8))], kind, ball.clone()), true);
    let expected = hidden - passed;
    assert!((f64::from(alpha) / expected - 1.0).abs() < 0.03, "{alpha} {expected}");
    // Light in one direction alone would have to be found by chance: it is taken to be hidden.
    let lamp =
        LightDesc::Point { from: DVec3::new(3.0, 4.0 + 6.0 * HEIGHT, -2.0), intensity: Rgb::splat(90.0) };
    let kind = MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::smooth() };
    let (_, alpha) = look(below(vec![lamp], kind, ball), true);
    assert_eq!(alpha, 1.0);
}

#[test]
fn focused_light_leaves_no_dark_pixels_when_denoised() {
    // Most light is near the zenith, and the ball focuses it below itself: the shadow is negative there, with noise.
    let row = |y: usize| if (6..26).contains(&y) { 0.2 } else { 5.0 };
    let image = Image::from_pixels(64, 32, (0..64 * 32).map(|i| Rgb::splat(row(i / 64))).collect()).unwrap();
    let light = LightDesc::Infinite {
        world_from_light: Transform::rotate(DVec3::X, -90.0).unwrap(),
        radiance: Rgb::WHITE,
        image: EnvironmentDesc::of_image(Arc::new(image)),
    };
    let ball = exact(Sphere::new(DVec3::new(3.0, 4.0 + HEIGHT + RADIUS, -2.0), RADIUS).unwrap());
    let kind = MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::smooth() };
    let scene = Scene::build(below(vec![light], kind, ball)).unwrap();
    let noisy = changed(options(&scene, 24, 20, 4), |it| (it.transparent, it.guides) = (true, true));
    let rendered = picture(&scene, &noisy);
    let denoised = denoise(&rendered, 1).unwrap();
    let largest = |image: &Image| image.alpha().unwrap().iter().copied().fold(0.0, f32::max);
    let (before, after) = (largest(&rendered.image), largest(&denoised.image));
    assert!(after <= before, "{before} -> {after}");
}

/// The coverage of each colour, and that of the picture.
fn coverage_by_colour(desc: SceneDesc) -> (Option<Rgb>, f32) {
    let scene = Scene::build(desc).unwrap();
    let rendered = picture(&scene, &changed(options(&scene, 12, 10, 2048), |it| it.transparent = true));
    let alpha = rendered.image.alpha().unwrap();
    (rendered.coverage.map(|coverage| coverage.mean()), alpha.iter().sum::<f32>() / alpha.len() as f32)
}

#[test]
fn shadows_have_the_colours_of_the_light_that_is_missing() {
    let from = DVec3::new(3.0, 4.0 + 3.0 * HEIGHT, -2.0);
    let intensity = Rgb::new(180.0, 90.0, 20.0);
    let lights = vec![sky(Rgb::new(0.4, 0.8, 1.2)), LightDesc::Point { from, intensity }];
    let (coverage, alpha) = coverage_by_colour(hovering(lights, true));
    let coverage = coverage.unwrap().to_array();
    for (found, (sky, lamp)) in coverage.into_iter().zip([(0.4, 180.0), (0.8, 90.0), (1.2, 20.0)]) {
        let (from_sky, from_lamp) = (sky * std::f64::consts::PI, lamp / (9.0 * HEIGHT * HEIGHT));
        let expected = (from_sky * hidden() + from_lamp) / (from_sky + from_lamp);
        assert!((f64::from(found) / expected - 1.0).abs() < 0.02, "{found} {expected}");
    }
    assert!((coverage.iter().sum::<f32>() / 3.0 - alpha).abs() < 1e-4, "{coverage:?} {alpha}");
}

#[test]
fn a_stained_pane_throws_a_shadow_of_its_colour() {
    let from = DVec3::new(3.0, 4.0 + 3.0 * HEIGHT, -2.0);
    let lamp = || LightDesc::Point { from, intensity: Rgb::splat(90.0) };
    let pane = || exact(Disk::new(DVec3::new(3.0, 4.0 + HEIGHT, -2.0), DVec3::Y, RADIUS, 0.0).unwrap());
    let stain = Rgb::new(0.9, 0.5, 0.125);
    let clear = |base_color: Rgb| {
        MaterialKind::Principled(Box::new(PrincipledParams {
            base_color: Arc::new(Texture::Constant(base_color)),
            metallic: Arc::new(Texture::Constant(0.0)),
            roughness: Arc::new(Texture::Constant(0.0)),
            transmission: Arc::new(Texture::Constant(1.0)),
            ior: 1.0,
            ..PrincipledParams::default()
        }))
    };
    let (coverage, _) = coverage_by_colour(below(vec![lamp()], clear(stain), pane()));
    let expected = Rgb::WHITE - stain;
    assert!((coverage.unwrap() - expected).map(f32::abs).max_component() < 1e-4, "{coverage:?}");
    // Where nothing has a colour, the coverage of the picture says all.
    let (coverage, alpha) = coverage_by_colour(below(vec![lamp()], clear(Rgb::splat(0.5)), pane()));
    assert!(coverage.is_none() && (alpha - 0.5).abs() < 1e-4, "{coverage:?} {alpha}");
}

#[test]
fn ground_in_the_open_is_not_seen_at_all() {
    let pixels = (0..64 * 32).map(|i| Rgb::splat(0.1 + (i % 7) as f32 * (i % 11) as f32)).collect();
    let image = Image::from_pixels(64, 32, pixels).unwrap();
    let map = EnvironmentDesc::of_image(Arc::new(image)).unwrap();
    let light = LightDesc::Infinite {
        world_from_light: Transform::rotate(DVec3::new(1.0, 2.0, 3.0), 40.0).unwrap(),
        radiance: Rgb::WHITE,
        image: Some(map),
    };
    let mut desc = hovering(vec![light], true);
    desc.shapes.clear();
    let scene = Scene::build(desc).unwrap();
    let rendered = picture(&scene, &changed(options(&scene, 8, 6, 4), |it| it.transparent = true));
    assert!(rendered.image.alpha().unwrap().iter().all(|&a| a == 0.0));
    assert!(rendered.image.pixels().iter().all(|&c| c == Rgb::BLACK));
}

#[test]
fn a_plane_is_seen_as_the_matte_surface_that_it_is() {
    let (colour, alpha) = look(hovering(vec![sky(Rgb::splat(2.0))], false), true);
    assert_eq!(alpha, 1.0);
    let expected = 0.5 * 2.0 * (1.0 - hidden());
    assert!((f64::from(colour.g) / expected - 1.0).abs() < 0.01, "{colour:?} {expected}");
}

#[test]
fn the_irradiance_of_an_environment_agrees_with_its_samples() {
    let pixels = (0..32 * 16).map(|i| Rgb::new(0.2 + (i % 5) as f32, 1.0, (i % 32) as f32)).collect();
    let image = Arc::new(Image::from_pixels(32, 16, pixels).unwrap());
    let square = Arc::new(
        Image::from_pixels(24, 24, image.pixels()[..512].iter().copied().chain([Rgb::WHITE; 64]).collect())
            .unwrap(),
    );
    for image in [image, square] {
        let light = LightDesc::Infinite {
            world_from_light: Transform::rotate(DVec3::new(3.0, -2.0, 1.0), 70.0).unwrap(),
            radiance: Rgb::new(2.0, 0.5, 1.0),
            image: EnvironmentDesc::of_image(image),
        };
        let desc = SceneDesc { lights: vec![light], without_light: WithoutLight::Dark, ..empty() };
        let scene = Scene::build(desc).unwrap();
        let normal = DVec3::new(1.0, -2.0, 2.0) / 3.0;
        let exact = scene.lights()[0].irradiance(DVec3::ZERO, 0.0, normal).unwrap();
        let mut sum = [0.0_f64; 3];
        const N: u32 = 300;
        for i in 0..N * N {
            let u = lumbre_math::DVec2::new(f64::from(i % N) + 0.5, f64::from(i / N) + 0.5) / f64::from(N);
            let Some(sample) = scene.sample_light_alone(DVec3::ZERO, DVec3::ZERO, 0.0, 0.5, u) else {
                continue;
            };
            let lumbre_shading::Scatter::Density(pdf) = sample.scatter else { panic!("no delta light") };
            let weight = normal.dot(sample.towards).max(0.0) / f64::from(pdf) / f64::from(N * N);
            sum.iter_mut().zip(sample.radiance.to_array()).for_each(|(sum, c)| *sum += weight * f64::from(c));
        }
        for (exact, sampled) in exact.to_array().into_iter().zip(sum) {
            assert!((f64::from(exact) / sampled - 1.0).abs() < 0.01, "{exact} {sampled}");
        }
    }
}
