//! Cut-outs against closed forms: partly covered triangles, whose rays are in single precision until they pass through.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Disk, Ray};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform, Vec3};
use lumbre_render::integrators::{AmbientOcclusion, Integrator, Path, Whitted};
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{InstanceDesc, LightDesc, ObjectDesc, ObjectId, Placement, Scene, SceneDesc};
use lumbre_shading::{FloatTexture, ShadingNormals};

/// The share of a sheet that blocks light.
const COVERAGE: f32 = 0.3;

/// A black sheet of two triangles at this height.
fn add_sheet(desc: &mut SceneDesc, z: f32) {
    let black = add_material(desc, diffuse(0.0));
    let corner = |x, y| Vec3::new(x, y, z);
    let corners = vec![corner(-9.0, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(-9.0, 9.0)];
    let sheet = add(desc, mesh(corners, vec![[0, 1, 2], [0, 2, 3]], vec![]), black);
    sheet.alpha = Some(Arc::new(FloatTexture::Constant(COVERAGE)));
}

fn shown(desc: SceneDesc, integrator: &dyn Integrator) -> f64 {
    let scene = Scene::build(desc).unwrap();
    let options = options(&scene, 64, 64, 32);
    mean(&render_with(&scene, &options, integrator, &NoProgress, &CancelToken::new()).unwrap().image)[0]
}

#[test]
fn each_sheet_hides_its_share_of_what_is_behind() {
    let mut desc = empty();
    let black = add_material(&mut desc, diffuse(0.0));
    add(&mut desc, exact(Disk::new(DVec3::Z * 5.0, -DVec3::Z, 99.0, 0.0).unwrap()), black).area_light =
        Some(glow(1.0));
    desc.cameras = vec![look(DVec3::ZERO, DVec3::Z, 40.0)];
    add_sheet(&mut desc, 1.0);
    add_sheet(&mut desc, 2.0);
    // And twice the same sheet, as instances.
    let sheet = desc.shapes.pop().unwrap();
    desc.objects = vec![ObjectDesc { name: "sheet".into(), shapes: vec![sheet], instances: vec![] }];
    let instance = |z| InstanceDesc {
        object: ObjectId(0),
        world_from_object: Placement::Still(Transform::translate(DVec3::Z * z)),
    };
    desc.instances = vec![instance(0.0), instance(1.5)];
    let expected = (1.0 - f64::from(COVERAGE)).powi(3);
    for integrator in [&Path::new(3) as &dyn Integrator, &Whitted::new(3)] {
        assert_close(shown(desc.clone(), integrator), expected, 0.02, "three sheets");
    }
}

#[test]
fn a_sheet_shadows_its_share_of_the_light() {
    let mut desc = empty();
    let grey = add_material(&mut desc, diffuse(0.5));
    add(&mut desc, exact(Disk::new(DVec3::ZERO, DVec3::Z, 4.0, 0.0).unwrap()), grey);
    desc.cameras = vec![look(DVec3::Z * 0.5, DVec3::ZERO, 40.0)];
    add_sheet(&mut desc, 1.0);
    let passes = 1.0 - f64::from(COVERAGE);
    let occlusion = AmbientOcclusion {
        cosine: true,
        max_distance: f64::INFINITY,
        shading_normals: ShadingNormals::default(),
    };
    // With an opaque sheet, what remains open is the share past its edges.
    let mut opaque = desc.clone();
    opaque.shapes[1].alpha = None;
    let past = shown(opaque, &occlusion);
    let open = past + passes * (1.0 - past);
    assert_close(shown(desc.clone(), &occlusion), open, 0.02, "ambient occlusion");

    let irradiance = 3.0;
    desc.lights = vec![LightDesc::Distant { towards: DVec3::Z, irradiance: Rgb::splat(irradiance) }];
    let expected = 0.5 * f64::from(irradiance) / std::f64::consts::PI * passes;
    for integrator in [&Path::new(1) as &dyn Integrator, &Whitted::new(1)] {
        assert_close(shown(desc.clone(), integrator), expected, 0.02, "a distant light");
    }
}

#[test]
fn the_first_sheet_hides_its_share_in_every_pixel() {
    let glowing = || {
        let mut desc = empty();
        let black = add_material(&mut desc, diffuse(0.0));
        add(&mut desc, exact(Disk::new(DVec3::Z * 5.0, -DVec3::Z, 99.0, 0.0).unwrap()), black).area_light =
            Some(glow(1.0));
        desc.cameras = vec![look(DVec3::ZERO, DVec3::Z, 40.0)];
        desc
    };
    let mut triangles = glowing();
    add_sheet(&mut triangles, 1.0);
    let mut disk = glowing();
    let black = add_material(&mut disk, diffuse(0.0));
    add(&mut disk, exact(Disk::new(DVec3::Z, -DVec3::Z, 99.0, 0.0).unwrap()), black).alpha =
        Some(Arc::new(FloatTexture::Constant(COVERAGE)));
    let mut behind_a_hole = triangles.clone();
    add_sheet(&mut behind_a_hole, 0.5);
    behind_a_hole.shapes.last_mut().unwrap().alpha = Some(Arc::new(FloatTexture::Constant(0.0)));
    for (name, desc) in [("triangles", triangles), ("disk", disk), ("behind a hole", behind_a_hole)] {
        let scene = Scene::build(desc).unwrap();
        let rendered = render_with(
            &scene,
            &options(&scene, 16, 16, 32),
            &Path::new(1),
            &NoProgress,
            &CancelToken::new(),
        )
        .unwrap();
        for pixel in rendered.image.pixels() {
            // Of 32 samples nine or ten.
            let away = pixel.to_array()[0] - (1.0 - COVERAGE);
            assert!(away.abs() <= 1.0 / 32.0, "{name}: {away}");
        }
        // The same in double precision, by the numbers alone.
        let ray = Ray::new(DVec3::new(0.1, 0.2, 0.0), DVec3::Z);
        for i in 0..32 {
            let number = i as f32 / 32.0;
            let t = scene.closest_seen(&ray, [number, 0.0]).unwrap().root.t;
            assert_eq!(t, if number < COVERAGE { 1.0 } else { 5.0 }, "{name} {number}");
        }
    }
}

#[test]
fn numbers_decide_about_the_two_nearest_sheets() {
    let mut desc = empty();
    for z in [1.0, 2.0, 3.0] {
        add_sheet(&mut desc, z);
    }
    let scene = Scene::build(desc).unwrap();
    let (meets, passes) = (0.9 * COVERAGE, COVERAGE);
    let mut thirds = 0;
    for i in 0..1000 {
        let ray = Ray::new(DVec3::new(0.1, 0.002 * f64::from(i), 0.0), DVec3::Z);
        let t = |numbers| scene.closest_seen(&ray, numbers).map(|hit| hit.root.t);
        assert_eq!(t([meets, passes]), Some(1.0));
        assert_eq!(t([meets, meets]), Some(1.0));
        assert_eq!(t([passes, meets]), Some(2.0));
        thirds += u32::from(t([passes, passes]).is_some());
    }
    // A hash decides about the third.
    assert!((250..350).contains(&thirds), "{thirds}");
}
