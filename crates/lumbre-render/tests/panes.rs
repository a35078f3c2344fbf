//! Light of points, spots and suns that goes straight on through panes, against closed forms.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Cuboid, Disk, Sphere};
use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, DMat3, DVec3, Transform};
use lumbre_render::integrators::{Integrator, Path, Whitted};
use lumbre_render::transport::Strategy;
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{EnvironmentDesc, IntegratorKind, LightDesc, Scene, SceneDesc};
use lumbre_shading::uber::UberParams;
use lumbre_shading::{
    FloatTexture, Material, MaterialKind, PrincipledParams, Roughness, SpectrumTexture, VolumeParams,
};

/// Where the floor is looked at, and its normal: no axis of anything.
const PLACE: DVec3 = DVec3::new(3.0, -7.0, 11.0);
const REFLECTANCE: f64 = 0.6;
/// Where lamps are, seen from there: 22.25 away, squared.
const LAMP: DVec3 = DVec3::new(1.5, -2.0, 4.0);
const INTENSITY: f64 = 30.0;
const STAIN: Rgb = Rgb::new(0.9, 0.5, 0.125);

/// From coordinates along the floor and above it to the world.
fn over_floor() -> Transform {
    let n = DVec3::new(0.3, -0.5, 0.8).normalize();
    let x = n.cross(DVec3::Y).normalize();
    let axes = DMat3::from_cols(x, n.cross(x), n);
    Transform::from_affine(DAffine3::from_mat3_translation(axes, PLACE)).unwrap()
}

fn floor(lights: Vec<LightDesc>) -> SceneDesc {
    let mut desc = SceneDesc { lights, ..empty() };
    let normal = over_floor().vector(DVec3::Z);
    let grey = add_material(&mut desc, diffuse(REFLECTANCE as f32));
    add(&mut desc, exact(Disk::new(PLACE, normal, 60.0, 0.0).unwrap()), grey);
    desc.cameras = vec![peer(PLACE, over_floor().vector(DVec3::new(0.2, 0.0, 1.0)))];
    desc
}

fn lamp() -> LightDesc {
    LightDesc::Point { from: over_floor().point(LAMP), intensity: Rgb::splat(INTENSITY as f32) }
}

/// What comes from the lamp if nothing stands in its way.
fn open() -> f64 {
    INTENSITY * LAMP.z / LAMP.length().powi(3)
}

/// A pane of radius 9, by coordinates over the floor.
fn add_pane(desc: &mut SceneDesc, middle: DVec3, normal: DVec3, material: Material) {
    let material = add_material(desc, material);
    let up = over_floor();
    add(desc, exact(Disk::new(up.point(middle), up.vector(normal), 9.0, 0.0).unwrap()), material);
}

fn glass() -> Material {
    Material::new(MaterialKind::ThinDielectric { eta: 1.5 })
}

fn number(v: f32) -> Arc<FloatTexture> {
    Arc::new(FloatTexture::Constant(v))
}

/// Clear, smooth and thin.
fn clear(ior: f32, color: Rgb) -> PrincipledParams {
    PrincipledParams {
        base_color: Arc::new(SpectrumTexture::Constant(color)),
        metallic: number(0.0),
        roughness: number(0.0),
        transmission: number(1.0),
        ior,
        ..PrincipledParams::default()
    }
}

fn principled(params: PrincipledParams) -> Material {
    Material::new(MaterialKind::Principled(Box::new(params)))
}

/// What a pane of index 1.5 lets through under a cosine, with all that goes to and fro inside.
fn through(cos: f64) -> f64 {
    let inner = (1.0 - (1.0 - cos * cos) / 2.25).sqrt();
    let across = ((cos - 1.5 * inner) / (cos + 1.5 * inner)).powi(2);
    let along = ((1.5 * cos - inner) / (1.5 * cos + inner)).powi(2);
    let once = 0.5 * (across + along);
    1.0 - 2.0 * once / (1.0 + once)
}

fn shown(desc: &SceneDesc, integrator: &dyn Integrator, spp: u32) -> [f64; 3] {
    let scene = Scene::build(desc.clone()).unwrap();
    let options = options(&scene, 8, 8, spp);
    let rendered = render_with(&scene, &options, integrator, &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!(rendered.stats.dropped, 0);
    mean(&rendered.image).map(|radiance| radiance * PI / REFLECTANCE)
}

/// The irradiance that both integrators show by direct light.
fn direct(desc: &SceneDesc, spp: u32) -> [[f64; 3]; 2] {
    [shown(desc, &Path::new(1), spp), shown(desc, &Whitted::new(1), spp)]
}

fn assert_direct(desc: &SceneDesc, expected: [f64; 3], what: &str) {
    for found in direct(desc, 2) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert_close(found, expected, 1e-4, what);
        }
    }
}

#[test]
fn a_pane_leaves_of_a_lamp_what_it_does_not_reflect() {
    for tilt in [DVec3::Z, DVec3::new(0.4, 0.9, -1.3), DVec3::new(2.0, 0.3, 0.5)] {
        let mut desc = floor(vec![lamp()]);
        add_pane(&mut desc, 0.5 * LAMP, tilt, glass());
        let cos = (LAMP.normalize().dot(tilt.normalize())).abs();
        assert!(through(cos) < 0.93);
        assert_direct(&desc, [open() * through(cos); 3], &format!("{tilt}"));
    }
}

#[test]
fn a_stained_pane_leaves_its_colour_as_well() {
    let mut desc = floor(vec![lamp()]);
    add_pane(&mut desc, 0.5 * LAMP, DVec3::Z, principled(clear(1.5, STAIN)));
    let share = through(LAMP.z / LAMP.length());
    assert_direct(&desc, STAIN.to_array().map(|c| open() * share * f64::from(c)), "stained");
}

#[test]
fn of_a_mixed_surface_the_clear_part_lets_light_through() {
    let mut desc = floor(vec![lamp()]);
    let params = PrincipledParams { transmission: number(0.75), metallic: number(0.25), ..clear(1.5, STAIN) };
    add_pane(&mut desc, 0.5 * LAMP, DVec3::Z, principled(params));
    let share = 0.75 * 0.75 * through(LAMP.z / LAMP.length());
    assert_direct(&desc, STAIN.to_array().map(|c| open() * share * f64::from(c)), "of one material");

    let mut desc = floor(vec![lamp()]);
    let materials = [Arc::new(diffuse(0.5)), Arc::new(principled(clear(1.5, STAIN)))];
    let mixture = MaterialKind::Mix { materials, amount: number(0.375) };
    add_pane(&mut desc, 0.5 * LAMP, DVec3::Z, Material::new(mixture));
    let share = 0.375 * through(LAMP.z / LAMP.length());
    assert_direct(&desc, STAIN.to_array().map(|c| open() * share * f64::from(c)), "of two");
}

#[test]
fn what_the_opacity_of_uber_leaves_goes_straight_on() {
    let grey = |c: f32| Arc::new(SpectrumTexture::Constant(Rgb::splat(c)));
    let opacity = Rgb::new(0.25, 0.5, 0.875);
    let uber = UberParams {
        kd: grey(0.3),
        ks: grey(0.4),
        kr: grey(0.5),
        // It bends, so that it throws a shadow.
        kt: grey(0.6),
        opacity: Arc::new(SpectrumTexture::Constant(opacity)),
        eta: number(1.5),
        roughness: Roughness::isotropic(0.2, true),
    };
    for tilt in [DVec3::Z, DVec3::new(0.4, 0.9, -1.3)] {
        let mut desc = floor(vec![lamp()]);
        add_pane(&mut desc, 0.5 * LAMP, tilt, Material::new(MaterialKind::Uber(Box::new(uber.clone()))));
        assert_direct(&desc, opacity.to_array().map(|c| open() * f64::from(1.0 - c)), "uber");
    }
}

#[test]
fn each_of_many_panes_takes_its_share() {
    for count in [2, 40] {
        let mut desc = floor(vec![lamp()]);
        for i in 0..count {
            let height = 0.1 + 0.8 * f64::from(i) / f64::from(count);
            add_pane(&mut desc, height * LAMP, DVec3::Z, glass());
        }
        let expected = open() * through(LAMP.z / LAMP.length()).powi(count);
        for found in direct(&desc, 2) {
            assert_close(found[1], expected, 1e-3, &format!("{count} panes"));
        }
    }
}

#[test]
fn a_thin_bulb_is_gone_through_twice() {
    let mut desc = floor(vec![lamp()]);
    let bulb = add_material(&mut desc, principled(clear(1.0, STAIN)));
    let middle = over_floor().point(0.5 * LAMP);
    add(&mut desc, exact(Sphere::new(middle, 0.75).unwrap()), bulb);
    assert_direct(&desc, STAIN.to_array().map(|c| open() * f64::from(c * c)), "around nothing");
    // The lamp inside of it: one wall.
    desc.shapes[1].geometry = exact(Sphere::new(over_floor().point(LAMP), 0.75).unwrap());
    assert_direct(&desc, STAIN.to_array().map(|c| open() * f64::from(c)), "around the lamp");
}

#[test]
fn light_of_suns_spots_and_measured_lamps_goes_through_as_well() {
    let up = over_floor();
    let towards = up.vector(LAMP.normalize());
    let side = towards.cross(DVec3::X).normalize();
    let axes = DMat3::from_cols(side, side.cross(towards), -towards);
    let at_lamp = Transform::from_affine(DAffine3::from_mat3_translation(axes, up.point(LAMP))).unwrap();
    let sun = LightDesc::Distant { towards, irradiance: Rgb::splat(7.0) };
    let spot = LightDesc::Spot {
        world_from_light: at_lamp,
        intensity: Rgb::splat(INTENSITY as f32),
        cone_angle: 20.0,
        cone_delta_angle: 5.0,
    };
    let even = Image::from_pixels(8, 4, vec![Rgb::WHITE; 32]).unwrap();
    let measured = LightDesc::Goniometric {
        world_from_light: at_lamp,
        intensity: Rgb::splat(INTENSITY as f32),
        image: EnvironmentDesc::of_image(Arc::new(even)).unwrap(),
    };
    let cos = LAMP.z / LAMP.length();
    for (light, open) in [(sun, 7.0 * cos), (spot, open()), (measured, open())] {
        let what = format!("{light:?}");
        let mut desc = floor(vec![light]);
        add_pane(&mut desc, 0.5 * LAMP, DVec3::Z, glass());
        assert_direct(&desc, [open * through(cos); 3], &what);
    }
}

#[test]
fn a_pane_with_holes_lets_all_light_through_them() {
    let mut desc = floor(vec![lamp()]);
    add_pane(&mut desc, 0.5 * LAMP, DVec3::Z, principled(clear(1.0, STAIN)));
    desc.shapes[1].alpha = Some(number(0.25));
    // Behind it something opaque with holes of its own.
    add_pane(&mut desc, 0.75 * LAMP, DVec3::Z, diffuse(0.0));
    desc.shapes[2].alpha = Some(number(0.5));
    for found in direct(&desc, 1024) {
        for (found, stain) in found.into_iter().zip(STAIN.to_array()) {
            let expected = open() * 0.5 * (0.75 + 0.25 * f64::from(stain));
            assert_close(found, expected, 0.02, "with holes");
        }
    }
}

#[test]
fn what_is_rough_or_bends_light_still_throws_a_shadow() {
    let rough = PrincipledParams { roughness: number(0.2), ..clear(1.5, STAIN) };
    let solid = PrincipledParams { volume: Some(VolumeParams::default()), ..clear(1.5, STAIN) };
    let smooth = MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::smooth() };
    let blocking = [
        principled(rough),
        principled(solid),
        Material::new(smooth),
        diffuse(0.5),
        principled(PrincipledParams { metallic: number(1.0), ..clear(1.5, STAIN) }),
    ];
    for material in blocking {
        let what = format!("{material:?}");
        for pane_below in [true, false] {
            let mut desc = floor(vec![lamp()]);
            let [pane, other] = if pane_below { [0.3, 0.6] } else { [0.6, 0.3] };
            add_pane(&mut desc, pane * LAMP, DVec3::Z, glass());
            let middle = over_floor().point(other * LAMP);
            let material = add_material(&mut desc, material.clone());
            add(&mut desc, exact(Cuboid::new(middle - 0.25, middle + 0.25).unwrap()), material);
            assert_eq!(direct(&desc, 2), [[0.0; 3]; 2], "{what}");
        }
    }
}

#[test]
fn a_solid_without_a_border_takes_what_beer_and_lambert_say() {
    let distance = 0.7;
    let volume =
        VolumeParams { attenuation_color: STAIN, attenuation_distance: distance, ..VolumeParams::default() };
    let haze = || principled(PrincipledParams { volume: Some(volume), ..clear(1.0, Rgb::WHITE) });
    let left = |way: f64| STAIN.to_array().map(|c| open() * f64::from(c).powf(way / f64::from(distance)));
    let mut desc = floor(vec![lamp()]);
    add_pane(&mut desc, 0.8 * LAMP, DVec3::Z, principled(clear(1.0, Rgb::WHITE)));
    let material = add_material(&mut desc, haze());
    let sphere = |at: f64| exact(Sphere::new(over_floor().point(at * LAMP), 0.5).unwrap());
    add(&mut desc, sphere(0.5), material);
    assert_direct(&desc, left(1.0), "on the way");
    // Around the lamp.
    desc.shapes[2].geometry = sphere(1.0);
    assert_direct(&desc, left(0.5), "at the end");
}

/// A lamp with a surface above the floor, below it a pane that reflects nothing.
fn area_light() -> SceneDesc {
    let mut desc = floor(vec![]);
    add_pane(&mut desc, DVec3::Z, DVec3::Z, principled(clear(1.0, STAIN)));
    let black = add_material(&mut desc, diffuse(0.0));
    let up = over_floor();
    let shape = exact(Disk::new(up.point(3.0 * DVec3::Z), up.vector(-DVec3::Z), 2.5, 0.0).unwrap());
    add(&mut desc, shape, black).area_light = Some(glow(5.0));
    desc
}

#[test]
fn light_of_a_surface_is_counted_once() {
    let expected = STAIN.to_array().map(|c| f64::from(c) * 5.0 * PI * 6.25 / (6.25 + 9.0));
    for strategy in [Strategy::Both, Strategy::Lights, Strategy::Bsdf] {
        let found = shown(&area_light(), &Path { strategy, roulette_start: 9, ..Path::new(3) }, 4096);
        for (found, expected) in found.into_iter().zip(expected) {
            assert_close(found, expected, 0.01, &format!("{strategy:?}"));
        }
    }
    // Whitted's rays scatter off nothing, so that its samples of lights are all that brings it.
    for (found, expected) in shown(&area_light(), &Whitted::new(3), 1024).into_iter().zip(expected) {
        assert_close(found, expected, 0.01, "whitted");
    }
}

#[test]
fn light_of_the_sky_is_counted_once_beside_that_of_a_lamp() {
    let sky =
        LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance: Rgb::splat(0.5), image: None };
    let lamp =
        LightDesc::Point { from: over_floor().point(LAMP), intensity: Rgb::splat(10.0 * INTENSITY as f32) };
    let mut desc = floor(vec![lamp, sky]);
    let bell = add_material(&mut desc, principled(clear(1.0, STAIN)));
    add(&mut desc, exact(Sphere::new(PLACE, 2.0).unwrap()), bell);
    let whitted = Whitted { sky: true, ..Whitted::new(3) };
    let path = Path { roulette_start: 9, ..Path::new(3) };
    let integrators: [&dyn Integrator; 2] = [&path, &whitted];
    for integrator in integrators {
        for (found, stain) in shown(&desc, integrator, 2048).into_iter().zip(STAIN.to_array()) {
            assert_close(found, f64::from(stain) * (10.0 * open() + 0.5 * PI), 0.01, "sky and lamp");
        }
    }
}

#[test]
fn a_regularized_pane_is_crossed_once() {
    let mut desc = floor(vec![lamp()]);
    // The floor lies in the shadow of a small pane, whose surroundings are open.
    add_pane(&mut desc, 0.5 * LAMP, DVec3::Z, principled(clear(1.0, Rgb::WHITE)));
    let path = Path { roulette_start: 9, ..Path::new(3) };
    let sharp = shown(&desc, &path, 64)[1];
    assert_close(sharp, open(), 1e-4, "sharp");
    let rough = shown(&desc, &Path { regularize: true, ..path }, 16384)[1];
    // The lamp is blurred over places that are nearer and farther from it.
    assert!(0.8 < rough / open() && rough / open() < 1.2, "{rough} {}", open());
}

#[test]
fn pictures_through_panes_ignore_the_thread_count() {
    let mut desc = floor(vec![lamp()]);
    add_pane(&mut desc, 0.5 * LAMP, DVec3::Z, principled(clear(1.5, STAIN)));
    let up = over_floor();
    desc.cameras = vec![look(up.point(DVec3::new(-3.0, 2.0, 5.0)), PLACE, 70.0)];
    for kind in
        [IntegratorKind::Path { regularize: false }, IntegratorKind::Whitted { light_samples: 1, sky: false }]
    {
        desc.integrator.kind = kind;
        let scene = Scene::build(desc.clone()).unwrap();
        let by =
            |threads| picture(&scene, &changed(options(&scene, 40, 30, 4), |it| it.threads = threads)).image;
        let one = by(1);
        assert!(mean(&one)[0] > 0.0);
        assert_eq!(one, by(3));
    }
}
