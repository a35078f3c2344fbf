//! Pictures of what moves while the shutter is open, against closed forms, and against the same standing still.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Disk, Sphere};
use lumbre_image::{Image, Rgb};
use lumbre_math::{AnimatedTransform, DAffine3, DMat3, DVec3, Transform, Vec2, Vec3};
use lumbre_render::integrators::Path;
use lumbre_render::transport::Strategy;
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{
    Camera, CameraKind, GeometryDesc, InstanceDesc, LightDesc, MeshMoment, MeshMotion, ObjectDesc, ObjectId,
    Scene, SceneDesc, ShapeDesc,
};

fn motion(keys: &[(f64, Transform)]) -> AnimatedTransform {
    AnimatedTransform::new(keys.to_vec()).unwrap()
}

fn shift(x: f64, y: f64, z: f64) -> Transform {
    Transform::translate(DVec3::new(x, y, z))
}

/// Takes all the shapes of a description into an object that moves.
fn set_in_motion(desc: &mut SceneDesc, motion: AnimatedTransform) {
    let shapes = std::mem::take(&mut desc.shapes);
    desc.objects.push(ObjectDesc { name: "moving".into(), shapes, instances: vec![] });
    let object = ObjectId(desc.objects.len() as u32 - 1);
    desc.instances.push(InstanceDesc { object, world_from_object: motion.into() });
}

/// Looks along +z from z = -5 at x and y in [0, 8], x to the right and y up, from time 2 to 6.
fn flat_camera() -> Camera {
    Camera {
        kind: CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 },
        screen_window: Some([0.0, 8.0, 0.0, 8.0]),
        world_from_camera: shift(0.0, 0.0, -5.0),
        shutter_open: 2.0,
        shutter_close: 6.0,
        medium: None,
        ..look(-DVec3::Z, DVec3::ZERO, 45.0)
    }
}

/// A rectangle that glows on the side of -z.
fn glowing_quad(desc: &mut SceneDesc, [x0, x1, y0, y1]: [f32; 4]) {
    let black = add_material(desc, diffuse(0.0));
    let corner = |x, y| Vec3::new(x, y, 0.0);
    let corners = vec![corner(x0, y0), corner(x0, y1), corner(x1, y1), corner(x1, y0)];
    add(desc, mesh(corners, vec![], vec![[0, 1, 2, 3]]), black).area_light = Some(glow(1.0));
}

/// By pixels, the row of y in [0, 1] first.
fn rows_upwards(image: &Image) -> Vec<Vec<f64>> {
    let pixels: Vec<f64> = image.pixels().iter().map(|pixel| f64::from(pixel.g)).collect();
    pixels.chunks(image.width() as usize).rev().map(<[f64]>::to_vec).collect()
}

#[test]
fn a_pixel_sees_what_passes_for_as_long_as_it_passes() {
    // From x in [1, 3] at time 2 to x in [4, 6] at time 6; before and after, it goes on.
    let mut desc = empty();
    glowing_quad(&mut desc, [0.0, 2.0, 2.0, 5.0]);
    set_in_motion(&mut desc, motion(&[(0.0, shift(-0.5, 0.0, 0.0)), (8.0, shift(5.5, 0.0, 0.0))]));
    desc.cameras = vec![flat_camera()];
    let scene = Scene::build(desc).unwrap();
    assert!(scene.moves() && scene.warnings().is_empty());
    // As long as a place x is covered: the left edge is in [x - 2, x], and goes from 1 to 4. Over a pixel, the mean.
    let covered = |x: f64| (x.min(4.0) - (x - 2.0).max(1.0)).max(0.0) / 3.0;
    let mean =
        |x: usize| (0..1000).map(|i| covered(x as f64 + (f64::from(i) + 0.5) / 1000.0)).sum::<f64>() / 1000.0;
    let spp = 1024;
    let rows = rows_upwards(&picture(&scene, &options(&scene, 8, 8, spp)).image);
    for (y, row) in rows.iter().enumerate() {
        for (x, &found) in row.iter().enumerate() {
            let expected = if (2..5).contains(&y) { mean(x) } else { 0.0 };
            // Chance alone would have a standard error of 0.016.
            assert!((found - expected).abs() < 0.02, "{x} {y}: {found}, expected {expected}");
        }
    }
}

#[test]
fn what_changes_its_form_is_seen_in_all_of_them() {
    // The same way as above, by the vertices, in a space that is moved and mirrored; its normals turn as well.
    let mut desc = empty();
    glowing_quad(&mut desc, [0.0, 2.0, 2.0, 5.0]);
    let place = shift(3.0, 0.0, 0.0) * Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
    let GeometryDesc::Mesh(mesh) = &mut desc.shapes[0].geometry else { panic!("a mesh") };
    let mesh = Arc::make_mut(mesh);
    let moments = [1.0, 2.0, 3.0, 4.0].map(|x: f32| {
        let positions = mesh.positions.iter().map(|p| Vec3::new(3.0 - x - p.x, p.y, p.z)).collect();
        let normals = Some(vec![Vec3::new(0.6 * (x - 1.0) / 3.0, 0.0, -1.0).normalize(); 4]);
        MeshMoment { positions, normals }
    });
    // The mirror turns the faces round, and the coordinates have turned them already.
    mesh.positions.clone_from(&moments[1].positions);
    mesh.motion = Some(MeshMotion { start: 2.0, end: 6.0, moments: moments.to_vec() });
    desc.shapes[0].world_from_object = place;
    desc.cameras = vec![flat_camera()];
    let scene = Scene::build(desc).unwrap();
    assert!(scene.moves());
    assert_eq!(scene.warnings().len(), 1, "its light is found by chance");
    let covered = |x: f64| (x.min(4.0) - (x - 2.0).max(1.0)).max(0.0) / 3.0;
    let mean =
        |x: usize| (0..1000).map(|i| covered(x as f64 + (f64::from(i) + 0.5) / 1000.0)).sum::<f64>() / 1000.0;
    let rows = rows_upwards(&picture(&scene, &options(&scene, 8, 8, 1024)).image);
    for (y, row) in rows.iter().enumerate() {
        for (x, &found) in row.iter().enumerate() {
            let expected = if (2..5).contains(&y) { mean(x) } else { 0.0 };
            assert!((found - expected).abs() < 0.02, "{x} {y}: {found}, expected {expected}");
        }
    }
    // The shading normal half-way, which the mirror turns too.
    let ray = lumbre_geometry::Ray::new(DVec3::new(3.0, 3.0, -5.0), DVec3::Z).at_time(4.0);
    let hit = scene.closest(&ray).unwrap();
    let met = scene.interaction(&ray, &hit, &lumbre_scene::Footprint::Point);
    let between = Vec3::new(0.2, 0.0, -1.0).normalize() + Vec3::new(0.4, 0.0, -1.0).normalize();
    let expected = Vec3::new(-between.x, 0.0, between.z).normalize();
    assert!((met.shading.normal - expected).length() < 1e-6, "{}", met.shading.normal);
}

#[test]
fn meshes_whose_moments_do_not_fit_are_refused() {
    let refused = |change: fn(&mut MeshMotion)| {
        let mut desc = empty();
        glowing_quad(&mut desc, [0.0, 2.0, 2.0, 5.0]);
        let GeometryDesc::Mesh(mesh) = &mut desc.shapes[0].geometry else { panic!("a mesh") };
        let mesh = Arc::make_mut(mesh);
        let moment = MeshMoment { positions: mesh.positions.clone(), normals: None };
        let mut motion = MeshMotion { start: 0.0, end: 1.0, moments: vec![moment.clone(), moment] };
        change(&mut motion);
        mesh.motion = Some(motion);
        Scene::build(desc).map(|_| ()).unwrap_err().to_string()
    };
    assert!(refused(|m| m.moments[1].positions.truncate(3)).contains("moving positions"));
    assert!(refused(|m| m.moments[0].normals = Some(vec![])).contains("moving normals"));
    assert!(!refused(|m| m.moments[1].positions[2].y = f32::NAN).is_empty());
    assert!(!refused(|m| m.end = 0.0).is_empty());
}

#[test]
fn a_wheel_covers_a_place_for_its_share_of_the_turn() {
    // A quadrant turns about its corner by a quarter.
    let mut desc = empty();
    glowing_quad(&mut desc, [0.0, 3.5, 0.0, 3.5]);
    let turn = |degrees: f64| shift(4.0, 4.0, 0.0) * Transform::rotate(DVec3::Z, degrees).unwrap();
    set_in_motion(&mut desc, motion(&[(2.0, turn(0.0)), (6.0, turn(90.0))]));
    desc.cameras = vec![flat_camera()];
    let scene = Scene::build(desc).unwrap();
    let rows = rows_upwards(&picture(&scene, &options(&scene, 64, 64, 256)).image);
    let mut seen = 0;
    for (y, row) in rows.iter().enumerate() {
        for (x, &found) in row.iter().enumerate() {
            let (dx, dy) = ((x as f64 + 0.5) / 8.0 - 4.0, (y as f64 + 0.5) / 8.0 - 4.0);
            let (radius, degrees) = (dx.hypot(dy), dy.atan2(dx).to_degrees());
            if !(1.0..3.3).contains(&radius) || !(4.0..176.0).contains(&degrees) {
                continue;
            }
            let expected = 1.0 - (degrees - 90.0).abs() / 90.0;
            seen += 1;
            assert!((found - expected).abs() < 0.03, "{degrees}°: {found}, expected {expected}");
        }
    }
    assert!(seen > 800, "{seen}");
}

/// A floor, a ball over it that a lamp far away lights, and a mirror next to it.
fn stage() -> SceneDesc {
    let mut desc = empty();
    let white = add_material(&mut desc, diffuse(0.8));
    let corner = |x, y| Vec3::new(x, y, 1.0);
    let corners = vec![corner(-4.0, -4.0), corner(-4.0, 4.0), corner(4.0, 4.0), corner(4.0, -4.0)];
    add(&mut desc, mesh(corners, vec![], vec![[0, 1, 2, 3]]), white);
    add(&mut desc, exact(Sphere::new(DVec3::new(0.5, -0.3, -0.6), 1.1).unwrap()), white);
    desc.lights.push(LightDesc::Distant {
        towards: DVec3::new(0.5, 0.3, -1.0).normalize(),
        irradiance: Rgb::splat(2.0),
    });
    desc.cameras = vec![look(DVec3::new(2.0, -3.0, -9.0), DVec3::ZERO, 50.0)];
    desc
}

#[test]
fn what_moves_with_the_camera_stands_still_before_it() {
    // Shadows and light from surface to surface, too, for every ray of a path looks at the same time.
    let still = Scene::build(stage()).unwrap();
    let slide = motion(&[(0.0, shift(-7.0, 1.0, 2.0)), (1.0, shift(9.0, -3.0, -4.0))]);
    let mut desc = stage();
    set_in_motion(&mut desc, slide.clone());
    let camera = desc.cameras[0].world_from_camera;
    let keys: Vec<_> = slide.keys().iter().map(|&(time, map)| (time, map * camera)).collect();
    desc.cameras[0].motion = Some(Arc::new(motion(&keys)));
    let moving = Scene::build(desc).unwrap();
    let image = |scene: &Scene| picture(scene, &options(scene, 48, 40, 32)).image;
    let (still, moving) = (image(&still), image(&moving));
    let mut worst: f32 = 0.0;
    for (a, b) in still.pixels().iter().zip(moving.pixels()) {
        worst = worst.max((a.g - b.g).abs());
    }
    // A path in thousands takes another turn where rounding decides.
    let close = still.pixels().iter().zip(moving.pixels()).filter(|(a, b)| (a.g - b.g).abs() < 1e-4).count();
    assert!(close as f64 > 0.98 * still.pixels().len() as f64, "{close}, worst {worst}");
    assert!((mean(&still)[1] - mean(&moving)[1]).abs() < 1e-4);
    assert!(mean(&still)[1] > 0.05);
}

#[test]
fn a_moving_lamp_gives_the_same_light_however_it_is_found() {
    let lamps: [fn() -> GeometryDesc; 2] = [
        || exact(Sphere::new(DVec3::new(0.1, 0.2, 0.0), 0.7).unwrap()),
        || {
            mesh(
                vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
                vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
                vec![],
            )
        },
    ];
    for lamp in lamps {
        let build = |moves: bool| {
            let mut desc = empty();
            let black = add_material(&mut desc, diffuse(0.0));
            let lit = ShapeDesc { area_light: Some(glow(3.0)), ..add(&mut desc, lamp(), black).clone() };
            desc.shapes = vec![lit];
            // Turned and stretched on its way, so that solid angles are, too.
            let stretch = Transform::scale(DVec3::new(0.6, 1.5, 1.0)).unwrap();
            let turn = Transform::rotate(DVec3::new(1.0, 0.4, 0.2), 80.0).unwrap();
            let from = shift(-2.0, 0.5, -2.0);
            if moves {
                set_in_motion(
                    &mut desc,
                    motion(&[(0.0, from), (1.0, shift(1.5, -1.0, -3.0) * turn * stretch)]),
                );
            } else {
                set_in_motion(&mut desc, motion(&[(0.0, from)]));
            }
            let white = add_material(&mut desc, diffuse(0.9));
            add(&mut desc, exact(Disk::new(DVec3::ZERO, -DVec3::Z, 6.0, 0.0).unwrap()), white);
            desc.cameras = vec![look(DVec3::new(0.0, 0.0, -9.0), DVec3::ZERO, 40.0)];
            let scene = Scene::build(desc).unwrap();
            assert!(scene.warnings().is_empty(), "{:?}", scene.warnings());
            scene
        };
        let scene = build(true);
        let of = |strategy, spp| {
            let options = options(&scene, 24, 24, spp);
            let path = Path { strategy, ..Path::new(1) };
            mean(&render_with(&scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap().image)[1]
        };
        let both = of(Strategy::Both, 256);
        assert!(both > 0.1, "{both}");
        assert_close(of(Strategy::Lights, 256), both, 0.01, "by lights");
        assert_close(of(Strategy::Bsdf, 1024), both, 0.02, "by chance");
    }
}

#[test]
fn moving_pictures_are_the_same_from_any_number_of_threads() {
    let mut desc = stage();
    set_in_motion(&mut desc, motion(&[(0.0, Transform::IDENTITY), (1.0, shift(0.5, 0.2, 0.0))]));
    let matrix = DMat3::from_rotation_z(0.1);
    let tilt = Transform::from_affine(DAffine3::from_mat3(matrix)).unwrap();
    let camera = desc.cameras[0].world_from_camera;
    desc.cameras[0].motion = Some(Arc::new(motion(&[(0.0, camera), (0.7, tilt * camera)])));
    desc.filter = lumbre_scene::FilterDesc::Gaussian { radius: Vec2::splat(1.5), sigma: 0.5 };
    let scene = Scene::build(desc).unwrap();
    let image = |threads| {
        let options = changed(options(&scene, 53, 37, 6), |it| it.threads = threads);
        picture(&scene, &options).image
    };
    let one = image(1);
    for threads in [2, 3, 7] {
        assert_eq!(image(threads), one);
    }
    assert!(mean(&one)[1] > 0.05);
}

#[test]
fn a_shutter_without_time_sees_one_moment() {
    let mut desc = empty();
    glowing_quad(&mut desc, [0.0, 2.0, 2.0, 5.0]);
    set_in_motion(&mut desc, motion(&[(2.0, shift(1.0, 0.0, 0.0)), (6.0, shift(5.0, 0.0, 0.0))]));
    desc.cameras = vec![Camera { shutter_open: 4.0, shutter_close: 4.0, ..flat_camera() }];
    let scene = Scene::build(desc).unwrap();
    let rows = rows_upwards(&picture(&scene, &options(&scene, 8, 8, 4)).image);
    for (x, &found) in rows[3].iter().enumerate() {
        assert_eq!(found, if (3..5).contains(&x) { 1.0 } else { 0.0 }, "{x}");
    }
}
