//! What each integrator shows, where it can be said in closed form.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Cuboid, Disk, Sphere};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform};
use lumbre_render::integrators::{Path, Whitted};
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{IntegratorKind, LightDesc, Scene, SceneDesc};
use lumbre_shading::dielectric::ThinDielectric;
use lumbre_shading::{Material, MaterialKind, Roughness, SpectrumTexture, Texture};

const PLACE: DVec3 = DVec3::new(3.0, -7.0, 11.0);

fn with_kind(mut desc: SceneDesc, kind: IntegratorKind, spp: u32) -> [f64; 3] {
    desc.integrator.kind = kind;
    let scene = Scene::build(desc).unwrap();
    mean(&picture(&scene, &options(&scene, 8, 8, spp)).image)
}

/// A floor seen from above at one point.
fn floor() -> SceneDesc {
    let mut desc = empty();
    let grey = add_material(&mut desc, diffuse(0.6));
    add(&mut desc, exact(Disk::new(PLACE, DVec3::Z, 60.0, 0.0).unwrap()), grey);
    desc.cameras = vec![peer(PLACE, DVec3::new(0.2, 0.1, 1.0))];
    desc
}

#[test]
fn ambient_occlusion_is_the_open_share_of_the_sky() {
    for cosine in [true, false] {
        let kind = |max_distance| IntegratorKind::AmbientOcclusion { cosine, max_distance };
        assert_close(with_kind(floor(), kind(f64::INFINITY), 256)[0], 1.0, 2e-3, "open");
        // Over it a disk of radius 3 at height 2 hides 9 / 13 of the sky by the cosine, if one looks far enough.
        let roofed = || {
            let mut desc = floor();
            let grey = add_material(&mut desc, diffuse(0.2));
            add(&mut desc, exact(Disk::new(PLACE + 2.0 * DVec3::Z, DVec3::Z, 3.0, 0.0).unwrap()), grey);
            desc
        };
        assert_close(with_kind(roofed(), kind(f64::INFINITY), 1024)[1], 4.0 / 13.0, 6e-3, "roofed");
        assert_close(with_kind(roofed(), kind(1.9), 256)[1], 1.0, 2e-3, "roof too far away");
    }
}

#[test]
fn feature_integrators_show_what_they_are_called() {
    let normals = with_kind(floor(), IntegratorKind::Normals, 4);
    assert!((normals[0] - 0.5).abs() < 1e-6 && (normals[2] - 1.0).abs() < 1e-6, "{normals:?}");
    assert_close(with_kind(floor(), IntegratorKind::Depth, 4)[0], 0.02, 1e-6, "depth");
    assert_close(with_kind(floor(), IntegratorKind::Albedo, 4)[0], 0.6, 1e-6, "albedo");
    let uv = with_kind(floor(), IntegratorKind::Uv, 4);
    assert!((uv[1] - 1.0).abs() < 1e-6 && uv[2] == 0.0, "the middle of a disk has v = 1: {uv:?}");
}

#[test]
fn whitted_follows_mirrors_without_a_second_bounce() {
    // A mirror at 45° looks at a floor under a point light.
    let mut desc = floor();
    let mirror = Material::new(MaterialKind::ConductorReflectance {
        reflectance: Arc::new(SpectrumTexture::Constant(Rgb::WHITE)),
        roughness: Roughness::smooth(),
    });
    let mirror = add_material(&mut desc, mirror);
    let at = PLACE + DVec3::new(0.0, 0.0, 2.0);
    add(&mut desc, exact(Disk::new(at, DVec3::new(1.0, 0.0, -1.0), 0.5, 0.0).unwrap()), mirror);
    desc.cameras = vec![peer(at, DVec3::X)];
    desc.lights =
        vec![LightDesc::Point { from: PLACE + DVec3::new(-3.0, 0.0, 4.0), intensity: Rgb::splat(20.0) }];
    let expected = 0.6 / PI * 20.0 * 4.0 / 125.0;
    let show = |desc: SceneDesc, depth: u32| {
        let scene = Scene::build(desc).unwrap();
        let options = options(&scene, 4, 4, 16);
        let whitted = Whitted::new(depth);
        mean(&render_with(&scene, &options, &whitted, &NoProgress, &CancelToken::new()).unwrap().image)[0]
    };
    assert_close(show(desc.clone(), 5), expected, 1e-4, "reflected");
    assert_eq!(show(desc.clone(), 1), 0.0, "one step reaches the mirror alone");
    // A white wall next to it adds nothing: whitted has no second diffuse bounce, path has.
    let white = add_material(&mut desc, diffuse(0.9));
    let wall = Cuboid::new(PLACE + DVec3::new(1.0, -9.0, -1.0), PLACE + DVec3::new(2.0, 9.0, 9.0)).unwrap();
    add(&mut desc, exact(wall), white);
    assert_close(show(desc.clone(), 5), expected, 1e-4, "with a wall");
    let scene = Scene::build(desc).unwrap();
    let options = options(&scene, 4, 4, 256);
    let path =
        mean(&render_with(&scene, &options, &Path::new(5), &NoProgress, &CancelToken::new()).unwrap().image)
            [0];
    assert!(path > 1.05 * expected, "{path} {expected}");
}

#[test]
fn whitted_counts_all_of_mixtures_and_both_ways_of_glass() {
    let sky = |radiance: f32| LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: Rgb::splat(radiance),
        image: None,
    };
    let show = |desc: SceneDesc, whitted: Whitted| {
        let scene = Scene::build(desc).unwrap();
        let options = options(&scene, 8, 8, 1);
        mean(&render_with(&scene, &options, &whitted, &NoProgress, &CancelToken::new()).unwrap().image)[1]
    };
    // A floor of three parts paint and one part mirror, under a point light and a background.
    let mut desc = floor();
    let mirror = Arc::new(Material::new(MaterialKind::ConductorReflectance {
        reflectance: Arc::new(SpectrumTexture::Constant(Rgb::WHITE)),
        roughness: Roughness::smooth(),
    }));
    let paint = Arc::new(diffuse(0.6));
    let mixture = MaterialKind::Mix { materials: [paint, mirror], amount: Arc::new(Texture::Constant(0.25)) };
    desc.shapes[0].material = Some(add_material(&mut desc, Material::new(mixture)));
    desc.lights = vec![
        LightDesc::Point { from: PLACE + DVec3::new(-3.0, 0.0, 4.0), intensity: Rgb::splat(20.0) },
        sky(2.0),
    ];
    let expected = 0.75 * 0.6 / PI * 20.0 * 4.0 / 125.0 + 0.25 * 2.0;
    assert_close(show(desc.clone(), Whitted::new(5)), expected, 1e-4, "a mixture under a background");
    // The sky lights the paint too when it is asked to.
    let lit = show(desc, Whitted { sky: true, light_samples: 4096, ..Whitted::new(5) });
    assert_close(lit, expected + 0.75 * 0.6 * 2.0, 2e-2, "a mixture under a sky");

    // A pane over a black floor: what it reflects of the sky is seen alone, what it lets through is black.
    let mut desc = floor();
    desc.shapes[0].material = Some(add_material(&mut desc, diffuse(0.0)));
    let pane = add_material(&mut desc, Material::new(MaterialKind::ThinDielectric { eta: 1.5 }));
    add(&mut desc, exact(Disk::new(PLACE + 0.01 * DVec3::Z, DVec3::Z, 30.0, 0.0).unwrap()), pane);
    desc.lights = vec![sky(3.0)];
    let cos = (DVec3::new(0.2, 0.1, 1.0).length().recip()) as f32;
    let reflected = f64::from(ThinDielectric { eta: 1.5 }.reflected(cos));
    assert_close(show(desc, Whitted::new(5)), 3.0 * reflected, 1e-4, "a pane");
}

#[test]
fn depth_counts_bounces() {
    // Inside a closed sphere that emits and reflects a half, depth n shows 1 - 2^-(n+1) of what there is.
    let mut desc = empty();
    let half = add_material(&mut desc, diffuse(0.5));
    let walls = add(&mut desc, exact(Sphere::new(PLACE, 2.5).unwrap()), half);
    walls.reverse_orientation = true;
    walls.area_light = Some(glow(0.5));
    desc.cameras = vec![look(PLACE, PLACE + DVec3::new(0.3, 1.0, -0.2), 60.0)];
    let scene = Scene::build(desc).unwrap();
    let base = options(&scene, 8, 8, 256);
    for depth in 0..5 {
        let mut integrator = base.integrator;
        integrator.max_depth = depth;
        let image = picture(&scene, &changed(base.clone(), |it| it.integrator = integrator)).image;
        assert_close(mean(&image)[0], 1.0 - 0.5_f64.powi(depth as i32 + 1), 5e-3, &format!("depth {depth}"));
    }
}

#[test]
fn roulette_changes_the_noise_and_not_the_mean() {
    let mut desc = empty();
    let grey = add_material(&mut desc, diffuse(0.7));
    let white = add_material(&mut desc, diffuse(0.9));
    add(&mut desc, exact(Cuboid::new(PLACE - 3.0, PLACE + 2.0).unwrap()), white).reverse_orientation = true;
    add(&mut desc, exact(Sphere::new(PLACE + DVec3::new(0.3, 0.4, -1.8), 0.9).unwrap()), grey);
    let lamp = add(&mut desc, exact(Disk::new(PLACE + 1.9 * DVec3::Z, -DVec3::Z, 0.8, 0.0).unwrap()), grey);
    lamp.area_light = Some(glow(3.0));
    desc.cameras = vec![look(PLACE + DVec3::new(-2.5, -2.0, 0.5), PLACE, 55.0)];
    let scene = Scene::build(desc).unwrap();
    let options = options(&scene, 20, 20, 256);
    let by = |roulette_start| {
        let path = Path { roulette_start, ..Path::new(20) };
        let rendered = render_with(&scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap();
        (mean(&rendered.image)[1], rendered.stats.rays.bounce)
    };
    let (sure, many) = by(1000);
    let (roulette, few) = by(1);
    assert!(2 * few < many, "{few} {many}");
    assert_close(roulette, sure, 4e-3, "roulette");
}

#[test]
fn light_behind_glass_comes_back_through_its_square_of_eta() {
    // Under a slab of glass the floor is seen through two refractions: radiance is scaled by η² and back, so that a
    // floor that shines looks as bright as its two interfaces let through, whatever η is in between.
    let mut desc = empty();
    let glass = add_material(
        &mut desc,
        Material::new(MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::smooth() }),
    );
    let black = add_material(&mut desc, diffuse(0.0));
    let lamp = add(&mut desc, exact(Disk::new(PLACE, DVec3::Z, 40.0, 0.0).unwrap()), black);
    lamp.area_light = Some(glow(2.0));
    add(
        &mut desc,
        exact(
            Cuboid::new(PLACE + DVec3::new(-30.0, -30.0, 1.0), PLACE + DVec3::new(30.0, 30.0, 1.5)).unwrap(),
        ),
        glass,
    );
    desc.cameras = vec![peer(PLACE + 3.0 * DVec3::Z, DVec3::Z)];
    desc.lights = vec![LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: Rgb::splat(1e-9),
        image: None,
    }];
    desc.integrator.max_depth = 30;
    // Straight on each interface reflects 4 %; between two of them the rest goes back and forth.
    let r: f64 = 0.04;
    let through = (1.0 - r) * (1.0 - r) / (1.0 - r * r);
    let scene = Scene::build(desc).unwrap();
    let image = picture(&scene, &options(&scene, 16, 16, 256)).image;
    // What is reflected down off the slab meets a black floor.
    assert_close(mean(&image)[0], 2.0 * through, 2e-3, "slab");
}

/// Cameras look through the backs of one-sided faces, by rays in double precision; what leaves the faces is traced in
/// single.
#[test]
fn rays_that_leave_one_sided_meshes_do_not_meet_them_again() {
    let [two_sided, one_sided] = [false, true].map(|one_sided| {
        let mut desc = empty();
        let white = add_material(&mut desc, Material { one_sided, ..diffuse(1.0) });
        add(&mut desc, crate::terminator::globe(12, false), white);
        desc.lights = crate::terminator::lit(crate::terminator::globe(12, false)).lights;
        desc.cameras = crate::terminator::lit(crate::terminator::globe(12, false)).cameras;
        let scene = Scene::build(desc).unwrap();
        let rendered = picture(&scene, &options(&scene, 64, 64, 4));
        let rays = rendered.stats.rays;
        // A convex body: what bounces off it leaves.
        assert!(rays.bounce > 4000 && rays.bounce <= rays.camera, "{one_sided}: {rays:?}");
        mean(&rendered.image)
    });
    assert_close(one_sided[1], two_sided[1], 1e-5, "one-sided");
}
