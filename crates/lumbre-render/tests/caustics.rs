//! Light that comes from lamps over mirrors and smooth glass, against closed forms and against paths.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Cuboid, Disk, Sphere};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform};
use lumbre_scene::{
    Camera, InstanceDesc, IntegratorKind, LightDesc, MediumId, ObjectDesc, ObjectId, Placement, Scene,
    SceneDesc,
};
use lumbre_shading::medium::{HomogeneousMedium, Medium};
use lumbre_shading::spectrum::Wavelengths;
use lumbre_shading::{
    FloatTexture, Material, MaterialKind, PrincipledParams, Roughness, SpectrumTexture, SpectrumValue,
    VolumeParams,
};

/// Of the floor: so dark that what it lights lights it back by less than a thousandth.
const REFLECTANCE: f64 = 0.01;

fn glass(eta: f32) -> Material {
    Material::new(MaterialKind::Dielectric { eta, roughness: Roughness::smooth() })
}

fn mirror(reflectance: f32) -> Material {
    Material::new(MaterialKind::ConductorReflectance {
        reflectance: Arc::new(SpectrumTexture::Constant(Rgb::splat(reflectance))),
        roughness: Roughness::smooth(),
    })
}

fn lamp(from: DVec3) -> LightDesc {
    LightDesc::Point { from, intensity: Rgb::splat(10.0) }
}

/// A floor at z = 0, seen from close above so that nothing else is.
fn floor(lights: Vec<LightDesc>) -> SceneDesc {
    let mut desc = SceneDesc { lights, ..empty() };
    desc.cameras = vec![look(DVec3::new(0.1, 0.2, 0.9), DVec3::new(0.1, 0.2, 0.0), 60.0)];
    desc.integrator.max_depth = 40;
    let grey = add_material(&mut desc, diffuse(REFLECTANCE as f32));
    add(&mut desc, exact(Disk::new(DVec3::ZERO, DVec3::Z, 20.0, 0.0).unwrap()), grey);
    desc
}

fn with(desc: SceneDesc, material: Material, shape: impl Into<lumbre_geometry::Shape>) -> SceneDesc {
    changed(desc, |desc| {
        let material = add_material(desc, material);
        add(desc, exact(shape), material);
    })
}

/// The mean of a picture of 32 by 32 pixels.
fn mean_of(mut desc: SceneDesc, kind: IntegratorKind, spp: u32) -> f64 {
    desc.integrator.kind = kind;
    let scene = Scene::build(desc).unwrap();
    mean(&picture(&scene, &options(&scene, 32, 32, spp)).image)[1]
}

fn by_paths(desc: SceneDesc, spp: u32) -> f64 {
    mean_of(desc, IntegratorKind::Path { regularize: false }, spp)
}

fn by_photons(desc: SceneDesc, spp: u32) -> f64 {
    mean_of(desc, IntegratorKind::Caustics, spp)
}

#[test]
fn a_lamp_at_the_centre_of_a_glass_ball_is_undimmed() {
    let at = DVec3::new(0.3, 0.1, 3.0);
    let desc = floor(vec![lamp(at)]);
    let ball = with(desc.clone(), glass(1.5), Sphere::new(at, 0.5).unwrap());
    let bare = by_paths(desc, 16);
    assert_eq!(by_paths(ball.clone(), 16), 0.0);
    assert_close(by_photons(ball, 64), bare, 0.01, "a lamp in a ball of glass");
}

#[test]
fn a_mirror_shines_as_a_lamp_behind_it_does() {
    // The lamp itself is screened off.
    let at = DVec3::new(-1.0, 0.3, 2.0);
    let screen = Disk::new(DVec3::new(-0.9, 0.3, 1.7), DVec3::new(0.1, 0.0, -1.0), 0.4, 0.0).unwrap();
    let black = |desc| with(desc, diffuse(0.0), screen);
    let image = floor(vec![lamp(DVec3::new(-7.0, 0.3, 2.0))]);
    let wall = Disk::new(DVec3::new(-4.0, 0.3, 1.2), DVec3::X, 0.8, 0.0).unwrap();
    let mirrored = with(black(floor(vec![lamp(at)])), mirror(0.8), wall);
    assert_close(by_photons(mirrored, 1024), 0.8 * by_paths(image, 16), 0.01, "a mirror");
}

#[test]
fn a_stained_slab_transmits_its_reflection_series() {
    let down = |irradiance| LightDesc::Distant { towards: DVec3::Z, irradiance: Rgb::splat(irradiance) };
    let left: f32 = 0.7;
    let slab = Material::new(MaterialKind::Principled(Box::new(PrincipledParams {
        base_color: Arc::new(SpectrumTexture::Constant(Rgb::WHITE)),
        metallic: Arc::new(FloatTexture::Constant(0.0)),
        roughness: Arc::new(FloatTexture::Constant(0.0)),
        transmission: Arc::new(FloatTexture::Constant(1.0)),
        volume: Some(VolumeParams {
            attenuation_color: Rgb::splat(left),
            attenuation_distance: 0.25,
            ..VolumeParams::default()
        }),
        ..PrincipledParams::default()
    })));
    let cuboid = Cuboid::new(DVec3::new(-1.5, -1.5, 2.0), DVec3::new(1.5, 1.5, 2.25)).unwrap();
    let below = with(floor(vec![down(3.0)]), slab, cuboid);
    let r = ((1.5_f64 - 1.0) / (1.5 + 1.0)).powi(2);
    let a = f64::from(left);
    let through = (1.0 - r).powi(2) * a / (1.0 - r * r * a * a);
    let expected = REFLECTANCE / std::f64::consts::PI * 3.0 * through;
    assert_close(by_photons(below, 256), expected, 0.01, "a slab");
}

/// A scene whose lamp paths find, too: a ball of glass, a mirror and a pane under a large lamp.
pub(crate) fn lit_by_a_large_lamp() -> SceneDesc {
    let mut desc = floor(vec![]);
    desc.materials[0].material = Arc::new(diffuse(0.6));
    desc.cameras = vec![look(DVec3::new(3.0, 1.0, 3.0), DVec3::new(0.0, 0.0, 0.3), 40.0)];
    let black = add_material(&mut desc, diffuse(0.0));
    add(&mut desc, exact(Sphere::new(DVec3::new(-1.0, 0.5, 4.0), 1.5).unwrap()), black).area_light =
        Some(glow(5.0));
    let desc = with(desc, glass(1.5), Sphere::new(DVec3::new(0.0, 0.0, 0.8), 0.6).unwrap());
    let desc = with(desc, mirror(0.9), Disk::new(DVec3::new(-1.5, 0.0, 0.8), DVec3::X, 0.8, 0.0).unwrap());
    let pane = Material::new(MaterialKind::ThinDielectric { eta: 1.5 });
    with(desc, pane, Disk::new(DVec3::new(0.3, 0.5, 1.8), DVec3::new(0.1, 0.2, 1.0), 0.7, 0.0).unwrap())
}

#[test]
fn what_paths_find_photons_and_paths_find_together() {
    let desc = lit_by_a_large_lamp();
    assert_close(by_photons(desc.clone(), 512), by_paths(desc, 2048), 0.005, "a large lamp");
}

/// A scene in thin fog.
fn in_fog(desc: SceneDesc) -> SceneDesc {
    changed(desc, |desc| {
        let extinction = Rgb::new(0.1, 0.12, 0.15);
        let medium = HomogeneousMedium { extinction, albedo: Rgb::splat(0.8), asymmetry: 0.3 };
        desc.media.push(Arc::new(Medium::Homogeneous { medium, glow: Rgb::BLACK, spectra: None }));
        desc.cameras[0].medium = Some(MediumId(0));
    })
}

#[test]
fn what_paths_find_in_fog_photons_and_paths_find_together() {
    let desc = in_fog(lit_by_a_large_lamp());
    assert_close(by_photons(desc.clone(), 512), by_paths(desc, 2048), 0.005, "a large lamp in fog");
}

#[test]
fn a_lamp_in_a_glass_ball_lights_fog_undimmed() {
    let at = DVec3::new(0.3, 0.1, 2.0);
    let mut bare = in_fog(floor(vec![lamp(at)]));
    // The fog alone scatters: the floor is black. The lamp is outside the picture.
    bare.materials[0].material = Arc::new(diffuse(0.0));
    let beside = look(DVec3::new(3.0, 1.0, 3.0), DVec3::new(0.0, -2.0, 1.0), 40.0);
    bare.cameras[0] = Camera { medium: Some(MediumId(0)), ..beside };
    let ball = with(bare.clone(), glass(1.5), Sphere::new(at, 0.02).unwrap());
    assert_close(by_photons(ball, 1024), by_paths(bare, 1024), 0.01, "a lamp in fog");
}

#[test]
fn an_environment_comes_through_glass_once() {
    let mut desc = floor(vec![]);
    desc.materials[0].material = Arc::new(diffuse(0.6));
    desc.lights = vec![LightDesc::Infinite {
        radiance: Rgb::splat(0.5),
        image: None,
        world_from_light: Transform::IDENTITY,
    }];
    desc.cameras = vec![look(DVec3::new(3.0, 1.0, 3.0), DVec3::new(0.0, 0.0, 0.3), 30.0)];
    let desc = with(desc, glass(1.5), Sphere::new(DVec3::new(0.0, 0.0, 0.8), 0.6).unwrap());
    assert_close(by_photons(desc.clone(), 256), by_paths(desc, 1024), 0.005, "an environment");
}

#[test]
fn light_straight_through_a_pane_counts_once() {
    let desc = floor(vec![lamp(DVec3::new(0.3, 0.1, 3.0))]);
    let pane = Material::new(MaterialKind::ThinDielectric { eta: 1.5 });
    let desc = with(desc, pane, Disk::new(DVec3::new(0.0, 0.0, 2.0), DVec3::Z, 9.0, 0.0).unwrap());
    let found = by_photons(desc.clone(), 16);
    // The floor lights the pane from below, and that mirrors some of it.
    assert_close(found, by_paths(desc, 64), 0.003, "a pane");
}

#[test]
fn a_placed_ball_of_glass_is_as_one_that_stands_in_the_world() {
    let at = DVec3::new(0.3, 0.1, 3.0);
    let in_world = with(floor(vec![lamp(at + DVec3::Z)]), glass(1.5), Sphere::new(at, 0.5).unwrap());
    let mut placed = in_world.clone();
    let mut shape = placed.shapes.pop().unwrap();
    shape.geometry = exact(Sphere::new(DVec3::ZERO, 1.0).unwrap());
    placed.objects = vec![ObjectDesc { name: "ball".into(), shapes: vec![shape], instances: vec![] }];
    let map = Transform::translate(at) * Transform::scale(DVec3::splat(0.5)).unwrap();
    placed.instances = vec![InstanceDesc { object: ObjectId(0), world_from_object: Placement::Still(map) }];
    assert_close(by_photons(placed, 64), by_photons(in_world, 64), 0.01, "an instance");
}

#[test]
fn a_caustic_takes_a_bounce_for_each_surface_on_its_way() {
    let at = DVec3::new(0.3, 0.1, 3.0);
    let ball = with(floor(vec![lamp(at)]), glass(1.5), Sphere::new(at, 0.5).unwrap());
    let of_depth = |depth| by_photons(changed(ball.clone(), |desc| desc.integrator.max_depth = depth), 16);
    // One bounce is that of the floor.
    assert_eq!(of_depth(1), 0.0);
    assert!(of_depth(2) > 0.0);
}

#[test]
fn photons_depend_on_no_thread_and_no_interruption() {
    let mut desc = lit_by_a_large_lamp();
    desc.integrator.kind = IntegratorKind::Caustics;
    let scene = Scene::build(desc).unwrap();
    let of = |threads, crop| {
        let options = changed(options(&scene, 40, 30, 20), |it| {
            it.threads = threads;
            it.crop = crop;
        });
        picture(&scene, &options).image
    };
    let whole = of(1, None);
    assert_eq!(whole, of(3, None));
    let crop = lumbre_render::PixelBounds { x0: 10, y0: 5, x1: 30, y1: 20 };
    let part = of(2, Some(crop));
    for (y, x) in (5..20).flat_map(|y| (10..30).map(move |x| (y, x))) {
        assert_eq!(part.pixel(x - 10, y - 5), whole.pixel(x, y), "({x}, {y})");
    }
}

/// The mean of a picture of 32 by 32 pixels, by wavelengths.
fn by_wavelengths(mut desc: SceneDesc, kind: IntegratorKind, spp: u32) -> [f64; 3] {
    desc.integrator.kind = kind;
    let scene = Scene::build(desc).unwrap();
    mean(&picture(&scene, &changed(options(&scene, 32, 32, spp), |it| it.spectral = true)).image)
}

fn assert_same_colour(found: [f64; 3], expected: [f64; 3], share: f64, what: &str) {
    for c in 0..3 {
        assert_close(found[c], expected[c], share, what);
    }
}

/// Glass whose index falls from 1.7 to 1.5.
fn dispersive() -> Material {
    let mut material = glass(1.6);
    material.dispersion = Some(Arc::new(SpectrumValue::Sampled(vec![(360.0, 1.7), (830.0, 1.5)])));
    material
}

/// A floor, a wall and a ball of these colours under a lamp, without anything specular.
fn coloured() -> SceneDesc {
    let mut desc = floor(vec![lamp(DVec3::new(0.3, 0.1, 3.0))]);
    let of = |colour| {
        Material::new(MaterialKind::Diffuse { reflectance: Arc::new(SpectrumTexture::Constant(colour)) })
    };
    desc.materials[0].material = Arc::new(of(Rgb::new(0.7, 0.3, 0.2)));
    let desc = with(desc, of(Rgb::new(0.2, 0.4, 0.7)), Sphere::new(DVec3::new(0.1, 0.4, 0.2), 0.2).unwrap());
    with(desc, of(Rgb::splat(0.5)), Disk::new(DVec3::new(-0.6, 0.0, 0.0), DVec3::X, 0.8, 0.0).unwrap())
}

#[test]
fn without_anything_specular_wavelengths_are_those_of_paths() {
    let desc = coloured();
    let of = |kind| by_wavelengths(desc.clone(), kind, 4);
    assert_eq!(of(IntegratorKind::Caustics), of(IntegratorKind::Path { regularize: false }));
}

#[test]
fn shared_wavelengths_have_the_mean_of_those_of_each_pixel() {
    // A small mirror has the photons look for light, of which there is hardly any.
    let small = Disk::new(DVec3::new(9.0, 9.0, 0.1), DVec3::Z, 0.01, 0.0).unwrap();
    let desc = with(coloured(), mirror(0.9), small);
    let of = |kind| by_wavelengths(desc.clone(), kind, 512);
    let [photons, paths] = [of(IntegratorKind::Caustics), of(IntegratorKind::Path { regularize: false })];
    assert_same_colour(photons, paths, 0.003, "shared wavelengths");
}

#[test]
fn photons_find_what_paths_find_through_dispersive_glass() {
    let mut desc = lit_by_a_large_lamp();
    // The ball; the floor gets a colour.
    let ball = desc.shapes[2].material.unwrap();
    desc.materials[ball.0 as usize].material = Arc::new(dispersive());
    desc.materials[0].material = Arc::new(Material::new(MaterialKind::Diffuse {
        reflectance: Arc::new(SpectrumTexture::Constant(Rgb::new(0.7, 0.5, 0.3))),
    }));
    let photons = by_wavelengths(desc.clone(), IntegratorKind::Caustics, 1024);
    let paths = by_wavelengths(desc, IntegratorKind::Path { regularize: false }, 4096);
    assert_same_colour(photons, paths, 0.008, "dispersion");
}

#[test]
fn a_lamp_in_a_dispersive_ball_shines_as_it_does_without() {
    let at = DVec3::new(0.3, 0.1, 3.0);
    let desc = floor(vec![lamp(at)]);
    let ball = with(desc.clone(), dispersive(), Sphere::new(at, 0.5).unwrap());
    let bare = by_wavelengths(desc, IntegratorKind::Path { regularize: false }, 64);
    assert_same_colour(by_wavelengths(ball, IntegratorKind::Caustics, 2048), bare, 0.06, "a lamp in a ball");
}

#[test]
fn a_caustic_seen_through_glass_counts_its_wavelength_once() {
    // A lamp in a ball that disperses, seen from the middle of a second such ball: the photons and the camera's paths
    // are both of the hero wavelength alone. Light crosses both balls straight, so that the floor is lit as without.
    let at = DVec3::new(0.3, 0.1, 3.0);
    let desc = floor(vec![lamp(at)]);
    let [_, bare, _] = by_wavelengths(desc.clone(), IntegratorKind::Path { regularize: false }, 64);
    let desc = with(desc, dispersive(), Sphere::new(at, 0.5).unwrap());
    let desc = with(desc, dispersive(), Sphere::new(DVec3::new(0.1, 0.2, 0.9), 0.05).unwrap());
    let found = by_wavelengths(desc, IntegratorKind::Caustics, 2048);
    // Radiance is n² times that outside. What the eye's ball reflects inside comes back through the eye: of that, only
    // every second reflection sees the floor. So (1 - R) / (1 - R²) is let through.
    let seen = |index: f32| index * index / (1.0 + ((index - 1.0) / (index + 1.0)).powi(2));
    const COUNT: u32 = 1000;
    let mut expected = [0.0; 3];
    for i in 0..COUNT {
        let wavelengths = Wavelengths::visible((i as f32 + 0.5) / COUNT as f32);
        let [r, g, b] = wavelengths.nm().map(|nm| seen(1.7 - 0.2 * (nm - 360.0) / 470.0));
        let light = wavelengths.rec709(wavelengths.light(Rgb::WHITE) * Rgb::new(r, g, b)).to_array();
        (0..3).for_each(|c| expected[c] += bare * f64::from(light[c]) / f64::from(COUNT));
    }
    assert_same_colour(found, expected, 0.06, "seen through glass");
}

#[test]
fn photons_of_wavelengths_depend_on_no_thread_and_no_part() {
    let mut desc = lit_by_a_large_lamp();
    let ball = desc.shapes[2].material.unwrap();
    desc.materials[ball.0 as usize].material = Arc::new(dispersive());
    desc.integrator.kind = IntegratorKind::Caustics;
    let scene = Scene::build(desc).unwrap();
    let of = |threads, crop| {
        let options = changed(options(&scene, 40, 30, 20), |it| {
            (it.threads, it.crop, it.spectral) = (threads, crop, true);
        });
        picture(&scene, &options).image
    };
    let whole = of(1, None);
    assert_eq!(whole, of(3, None));
    let part = of(2, Some(lumbre_render::PixelBounds { x0: 10, y0: 5, x1: 30, y1: 20 }));
    for (y, x) in (5..20).flat_map(|y| (10..30).map(move |x| (y, x))) {
        assert_eq!(part.pixel(x - 10, y - 5), whole.pixel(x, y), "({x}, {y})");
    }
}

#[test]
fn a_scene_without_anything_specular_is_as_by_paths() {
    let desc = floor(vec![lamp(DVec3::new(0.3, 0.1, 3.0))]);
    assert_eq!(by_photons(desc.clone(), 4), by_paths(desc, 4));
}
