//! Where shadows end on coarse meshes that stand for smooth surfaces.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{Ray, Sphere};
use lumbre_image::{Image, Rgb};
use lumbre_math::{DVec3, Vec3};
use lumbre_render::integrators::{Integrator, Path, Whitted};
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{Footprint, GeometryDesc, IntegratorDesc, LightDesc, MeshDesc, Scene, SceneDesc};

pub(crate) const CENTER: DVec3 = DVec3::new(2.0, -1.0, 0.5);
pub(crate) const RADIUS: f64 = 1.5;

/// A sphere of `bands` times `2 * bands` faces about the z axis, with the normals of the sphere or none.
pub(crate) fn globe(bands: u32, is_smooth: bool) -> GeometryDesc {
    let around = 2 * bands;
    let mut unit = vec![];
    for i in 0..=bands {
        for j in 0..around {
            let (theta, phi) = (PI * f64::from(i) / f64::from(bands), PI * f64::from(j) / f64::from(bands));
            unit.push(DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()));
        }
    }
    let mut triangles = vec![];
    for i in 0..bands {
        for j in 0..around {
            let at = |i: u32, j: u32| i * around + j % around;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    GeometryDesc::Mesh(Arc::new(MeshDesc {
        positions: unit.iter().map(|n| (CENTER + RADIUS * *n).as_vec3()).collect(),
        normals: is_smooth.then(|| unit.iter().map(|n| n.as_vec3()).collect::<Vec<Vec3>>()),
        triangles,
        ..MeshDesc::default()
    }))
}

/// White, lit by a point from the right, and seen from the front without its outline.
pub(crate) fn lit(geometry: GeometryDesc) -> SceneDesc {
    let mut desc = empty();
    let white = add_material(&mut desc, diffuse(0.8));
    add(&mut desc, geometry, white);
    let from = CENTER + DVec3::new(6.0, -1.5, 1.5);
    desc.lights = vec![LightDesc::Point { from, intensity: Rgb::splat(100.0) }];
    desc.cameras = vec![look(CENTER + DVec3::new(0.3, -9.0, 1.0), CENTER, 12.0)];
    desc.integrator = IntegratorDesc { max_depth: 1, ..IntegratorDesc::default() };
    desc
}

fn shown(desc: SceneDesc, integrator: &dyn Integrator) -> Image {
    let scene = Scene::build(desc).unwrap();
    let options = options(&scene, 96, 96, 16);
    let rendered = render_with(&scene, &options, integrator, &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!(rendered.stats.dropped, 0);
    rendered.image
}

/// The mean difference over the mean of `expected`.
fn difference(found: &Image, expected: &Image) -> f64 {
    let pairs = found.pixels().iter().zip(expected.pixels());
    let sum: f64 = pairs.map(|(a, b)| f64::from((a.g - b.g).abs())).sum();
    sum / expected.pixels().len() as f64 / mean(expected)[1]
}

#[test]
fn a_coarse_sphere_with_smooth_normals_is_lit_as_a_sphere() {
    let integrators: [&dyn Integrator; 2] = [&Path::new(1), &Whitted::new(1)];
    for integrator in integrators {
        let exact = || GeometryDesc::Exact(Sphere::new(CENTER, RADIUS).unwrap().into());
        let expected = shown(lit(exact()), integrator);
        // They were 0.0769, 0.0553, 0.0178 and 0.0041 when all rays started on the faces.
        for (bands, bound) in [(6, 0.067), (8, 0.041), (16, 0.01), (32, 0.0025)] {
            let found = shown(lit(globe(bands, true)), integrator);
            let difference = difference(&found, &expected);
            assert!(difference < bound, "{bands}: {difference}");
        }
    }
}

/// The planes of the faces near the top reach beyond a wall that the sphere does not touch.
#[test]
fn no_light_comes_through_a_wall_close_to_a_coarse_sphere() {
    let scene = |wall: bool| {
        let mut desc = lit(globe(6, true));
        let top = CENTER.z + RADIUS + 0.004;
        if wall {
            let corner = |x: f64, y: f64| DVec3::new(CENTER.x + x, CENTER.y + y, top).as_vec3();
            let corners =
                vec![corner(-50.0, -40.0), corner(50.0, -40.0), corner(50.0, 60.0), corner(-50.0, 60.0)];
            let grey = add_material(&mut desc, diffuse(0.5));
            add(&mut desc, mesh(corners, vec![[0, 1, 2], [0, 2, 3]], vec![]), grey);
        }
        desc.lights = (0..12)
            .map(|i| {
                let angle = PI * f64::from(i) / 6.0;
                let from = DVec3::new(CENTER.x + 6.0 * angle.cos(), CENTER.y + 6.0 * angle.sin(), top + 0.3);
                LightDesc::Point { from, intensity: Rgb::splat(100.0) }
            })
            .collect();
        // From below the wall, along it.
        desc.cameras =
            vec![look(CENTER + DVec3::new(0.5, -6.0, 0.9), CENTER + DVec3::new(0.0, 0.0, 1.1), 16.0)];
        desc
    };
    for integrator in [&Path::new(3) as &dyn Integrator, &Whitted::new(1)] {
        let open = shown(scene(false), integrator);
        assert!(mean(&open)[1] > 0.1, "{:?}", mean(&open));
        let closed = shown(scene(true), integrator);
        assert_eq!(mean(&closed), [0.0; 3]);
    }
}

#[test]
fn only_what_stands_for_something_that_bulges_out_rises() {
    let cases = [
        ("smooth, from without", globe(8, true), false, true),
        ("smooth, from within", globe(8, true), true, false),
        ("flat", globe(8, false), false, false),
        ("exact", GeometryDesc::Exact(Sphere::new(CENTER, RADIUS).unwrap().into()), false, false),
    ];
    for (name, geometry, is_within, expected) in cases {
        let scene = Scene::build(lit(geometry)).unwrap();
        let mut heights = vec![];
        for i in 0..200 {
            let angle = 0.7 + 2.4 * f64::from(i);
            let out = DVec3::new(angle.cos(), angle.sin(), (0.37 * angle).sin()).normalize();
            let (from, along) = if is_within { (CENTER, out) } else { (CENTER + 4.0 * out, -out) };
            let ray = Ray::new(from, along);
            let hit = scene.closest(&ray).unwrap();
            let met = scene.interaction(&ray, &hit, &Footprint::Point);
            assert_eq!(
                met.has_terminator_offset(),
                scene.unoccluded_terminator_origin(&met).is_some(),
                "{name}"
            );
            heights.extend(
                scene
                    .unoccluded_terminator_origin(&met)
                    .map(|origin| (origin - CENTER).length() / RADIUS - 1.0),
            );
        }
        // A little above the sphere itself, by no more than the face is below it.
        let sag = 1.0 - (PI / 16.0).cos().powi(2);
        assert!(heights.iter().all(|height| (-1e-3..sag).contains(height)), "{name}: {heights:?}");
        assert_eq!(heights.len() > 150, expected, "{name}: {}", heights.len());
        assert_eq!(heights.is_empty(), !expected, "{name}");
    }
}
