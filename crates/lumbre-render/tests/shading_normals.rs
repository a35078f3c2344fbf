//! What is made of shading normals that are not those of the surface: Lumbre's way and pbrt's.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::*;
use crate::terminator::{CENTER, RADIUS, globe, lit};
use lumbre_geometry::Sphere;
use lumbre_image::{Image, Rgb};
use lumbre_math::{DVec3, Transform, Vec3};
use lumbre_scene::{GeometryDesc, IntegratorKind, LightDesc, MeshDesc, Scene, SceneDesc};
use lumbre_shading::{Material, MaterialKind, Roughness, ShadingNormals};

const WAYS: [ShadingNormals; 2] = [ShadingNormals::Lumbre, ShadingNormals::Pbrt];
const KINDS: [IntegratorKind; 2] =
    [IntegratorKind::Path { regularize: false }, IntegratorKind::Whitted { light_samples: 1, sky: false }];
const PLACE: DVec3 = DVec3::new(1.5, -2.0, 0.75);
const REFLECTANCE: f64 = 0.6;
const INTENSITY: f64 = 40.0;

fn shown(mut desc: SceneDesc, kind: IntegratorKind, normals: ShadingNormals, spp: u32) -> Image {
    desc.integrator.kind = kind;
    desc.integrator.shading_normals = normals;
    let scene = Scene::build(desc).unwrap();
    picture(&scene, &options(&scene, 48, 48, spp)).image
}

/// A direction in the plane y = 0 of the triangle, by its angle in degrees with the face's normal, z, towards x.
fn at_angle(degrees: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(sin, 0.0, cos)
}

/// A Lambert triangle that lies flat, whose normals lean by this many degrees, with one point light and one camera
/// close by.
fn leaning(normal: f64, light: f64, distance: f64, viewer: f64) -> SceneDesc {
    let mut desc = empty();
    let grey = add_material(&mut desc, diffuse(REFLECTANCE as f32));
    let corners = [DVec3::new(-2.0, -1.5, 0.0), DVec3::new(3.0, -1.0, 0.0), DVec3::new(-0.5, 2.5, 0.0)];
    let mesh = MeshDesc {
        positions: corners.map(|corner| (PLACE + corner).as_vec3()).to_vec(),
        normals: Some(vec![at_angle(normal).as_vec3(); 3]),
        triangles: vec![[0, 1, 2]],
        ..MeshDesc::default()
    };
    add(&mut desc, GeometryDesc::Mesh(Arc::new(mesh)), grey);
    let from = PLACE + distance * at_angle(light);
    desc.lights = vec![LightDesc::Point { from, intensity: Rgb::splat(INTENSITY as f32) }];
    desc.cameras = vec![peer(PLACE, at_angle(viewer))];
    desc.integrator.max_depth = 1;
    desc
}

/// f · |cos θ| of the light that is seen: where viewer and light are on one side of the shading normal, and that alone.
fn by_shading_normal(normal: f64, light: f64, distance: f64, viewer: f64) -> f64 {
    let cosine = |angle: f64| at_angle(normal).dot(at_angle(angle));
    if cosine(light) * cosine(viewer) <= 0.0 {
        return 0.0;
    }
    REFLECTANCE / PI * cosine(light).abs() * INTENSITY / (distance * distance)
}

#[test]
fn pbrt_uses_the_cosine_to_the_shading_normal() {
    // Degrees of the normal, of the light, its distance, degrees of the viewer, and whether both ways agree.
    let cases = [
        ("leaning towards the light", 35.0, 50.0, 3.0, 10.0, true),
        ("leaning away from the light", -25.0, 40.0, 2.5, 5.0, true),
        ("a grazing light", 35.0, 82.0, 3.0, 10.0, true),
        // Light from under the face, which the shading normal takes for light from above.
        ("a light below the horizon", 35.0, 98.0, 3.0, 10.0, false),
        ("a light above the horizon that the normal does not see", 35.0, -70.0, 3.0, 10.0, true),
        // Lumbre turns the normal until it is seen.
        ("a normal that faces away from the viewer", 50.0, 20.0, 3.0, -60.0, false),
        ("a viewer and a light that the normal both faces away from", 50.0, -55.0, 3.0, -60.0, false),
        ("a viewer behind the face", 35.0, 150.0, 3.0, 170.0, true),
    ];
    for (name, normal, light, distance, viewer, agree) in cases {
        let expected = by_shading_normal(normal, light, distance, viewer);
        for kind in KINDS {
            let [ours, pbrt] =
                WAYS.map(|way| mean(&shown(leaning(normal, light, distance, viewer), kind, way, 1))[1]);
            if expected == 0.0 {
                assert_eq!(pbrt, 0.0, "{name}");
            } else {
                assert_close(pbrt, expected, 1e-5, name);
            }
            assert_eq!((ours - pbrt).abs() <= 1e-5 * expected, agree, "{name}: {ours} {pbrt}");
        }
    }
}

#[test]
fn hit_and_sampled_light_below_a_face_agree() {
    // A wide lamp, half of it under the plane of the face: found by sampling it and by the BSDF alike, to the closed
    // form of a furnace about the shading normal: a white sky gives the reflectance, whatever the geometric normal.
    let mut desc = leaning(35.0, 60.0, 3.0, 10.0);
    desc.lights = vec![LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: Rgb::splat(1.5),
        image: None,
    }];
    for kind in [KINDS[0], IntegratorKind::Whitted { light_samples: 64, sky: true }] {
        let found = mean(&shown(desc.clone(), kind, ShadingNormals::Pbrt, 16))[1];
        assert_close(found, 1.5 * REFLECTANCE, 0.01, "a white sky");
    }
}

/// A coarse smooth sphere over a floor, in grazing light.
fn over_floor(ball: GeometryDesc) -> SceneDesc {
    let mut desc = lit(ball);
    let grey = add_material(&mut desc, diffuse(0.4));
    let corner = |x: f64, y: f64| DVec3::new(CENTER.x + x, CENTER.y + y, CENTER.z - RADIUS).as_vec3();
    let corners: Vec<Vec3> = vec![corner(-9.0, -8.0), corner(9.0, -8.0), corner(9.0, 8.0), corner(-9.0, 8.0)];
    add(&mut desc, mesh(corners, vec![[0, 1, 2], [0, 2, 3]], vec![]), grey);
    desc.integrator.max_depth = 3;
    desc
}

fn differing(a: &Image, b: &Image) -> usize {
    a.pixels().iter().zip(b.pixels()).filter(|(a, b)| a != b).count()
}

#[test]
fn only_smooth_meshes_differ_between_the_two_ways() {
    let sphere = || GeometryDesc::Exact(Sphere::new(CENTER, RADIUS).unwrap().into());
    for (name, ball, same) in
        [("flat", globe(6, false), true), ("exact", sphere(), true), ("smooth", globe(6, true), false)]
    {
        let mut desc = over_floor(ball);
        let glossy = MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::isotropic(0.3, false) };
        let glossy = add_material(&mut desc, Material::new(glossy));
        for material in [desc.shapes[0].material, Some(glossy)] {
            desc.shapes[0].material = material;
            for kind in KINDS {
                let [ours, pbrt] = WAYS.map(|way| shown(desc.clone(), kind, way, 8));
                assert_eq!(differing(&ours, &pbrt) == 0, same, "{name}, {kind:?}");
            }
        }
    }
    let ambient = IntegratorKind::AmbientOcclusion { cosine: true, max_distance: 2.0 };
    for (ball, same) in [(globe(6, false), true), (globe(6, true), false)] {
        let [ours, pbrt] = WAYS.map(|way| shown(over_floor(ball.clone()), ambient, way, 8));
        assert_eq!(differing(&ours, &pbrt) == 0, same);
    }
}

#[test]
fn pbrt_mode_keeps_the_polygonal_terminator() {
    let exact = GeometryDesc::Exact(Sphere::new(CENTER, RADIUS).unwrap().into());
    let expected = shown(lit(exact), KINDS[0], ShadingNormals::Pbrt, 16);
    let [ours, pbrt] = WAYS.map(|way| {
        let found = shown(lit(globe(6, true)), KINDS[0], way, 16);
        let pairs = found.pixels().iter().zip(expected.pixels());
        pairs.map(|(a, b)| f64::from((a.g - b.g).abs())).sum::<f64>() / mean(&expected)[1] / (48.0 * 48.0)
    });
    assert!(ours < 0.95 * pbrt && pbrt < 0.15, "{ours} {pbrt}");
}
