//! Direct light on a diffuse floor against closed forms, to 0.2 %, and the two ways of finding light against each
//! other.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::*;
use lumbre_geometry::{
    BilinearPatch, Capsule, Cone, Cuboid, Cylinder, Disk, Hyperboloid, Paraboloid, Quadric, Shape, Sphere,
    Torus, Triangle,
};
use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Transform, Vec3, warp64};
use lumbre_render::integrators::Path;
use lumbre_render::transport::Strategy;
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{EnvironmentDesc, EnvironmentMapping, GeometryDesc, LightDesc, Scene, SceneDesc};

/// Where the floor is looked at, and its normal: no axis of anything.
const PLACE: DVec3 = DVec3::new(3.0, -7.0, 11.0);
const REFLECTANCE: f32 = 0.6;

fn normal() -> DVec3 {
    DVec3::new(0.3, -0.5, 0.8).normalize()
}

/// Two directions along the floor, and its normal.
fn axes() -> [DVec3; 3] {
    let n = normal();
    let x = n.cross(DVec3::Y).normalize();
    [x, n.cross(x), n]
}

/// A floor that light falls on.
fn floor() -> SceneDesc {
    let mut desc = empty();
    let grey = add_material(&mut desc, diffuse(REFLECTANCE));
    add(&mut desc, exact(Disk::new(PLACE, normal(), 60.0, 0.0).unwrap()), grey);
    desc.cameras = vec![peer(PLACE, normal() + 0.2 * axes()[0])];
    desc
}

/// The irradiance that the picture shows, and the rays that it took.
fn irradiance(desc: SceneDesc, strategy: Strategy, spp: u32) -> (f64, lumbre_render::RayCounts) {
    let scene = Scene::build(desc).unwrap();
    let options = options(&scene, 8, 8, spp);
    let path = Path { strategy, ..Path::new(1) };
    let rendered = render_with(&scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!(rendered.stats.dropped, 0);
    (mean(&rendered.image)[1] * PI / f64::from(REFLECTANCE), rendered.stats.rays)
}

fn with_light(light: LightDesc) -> SceneDesc {
    SceneDesc { lights: vec![light], ..floor() }
}

/// A black shape over the floor that emits `glow`.
fn with_shape(geometry: GeometryDesc, placement: Transform, radiance: f32, two_sided: bool) -> SceneDesc {
    let mut desc = floor();
    let black = add_material(&mut desc, diffuse(0.0));
    let shape = add(&mut desc, geometry, black);
    shape.world_from_object = placement;
    let mut light = glow(radiance);
    light.two_sided = two_sided;
    shape.area_light = Some(light);
    desc
}

/// From coordinates along the floor and above it to the world.
fn over_floor() -> Transform {
    let [x, y, n] = axes();
    Transform::from_affine(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, n), PLACE)).unwrap()
}

#[test]
fn a_lamp_below_the_floor_takes_no_samples_however_bright_it_is() {
    let from = |height| over_floor().point(DVec3::new(1.5, -2.0, height));
    let above = LightDesc::Point { from: from(4.0), intensity: Rgb::splat(30.0) };
    let below = LightDesc::Point { from: from(-4.0), intensity: Rgb::splat(3e5) };
    let (expected, _) = irradiance(with_light(above.clone()), Strategy::Both, 1);
    // Were the one below chosen at all, some pixel of one sample would be black.
    let (found, rays) = irradiance(SceneDesc { lights: vec![above, below], ..floor() }, Strategy::Both, 1);
    assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    assert_eq!(rays.shadow, 64);
}

#[test]
fn a_point_light_falls_off_with_the_square_of_the_distance() {
    let from = over_floor().point(DVec3::new(1.5, -2.0, 4.0));
    let light = LightDesc::Point { from, intensity: Rgb::splat(30.0) };
    let (found, rays) = irradiance(with_light(light), Strategy::Both, 4);
    let squared: f64 = 1.5 * 1.5 + 4.0 + 16.0;
    assert_close(found, 30.0 * 4.0 / squared.powf(1.5), 1e-4, "point");
    assert_eq!(rays.shadow, rays.camera);
}

#[test]
fn a_spot_shines_in_its_cone_alone() {
    let direct = |tilt_degrees: f64| {
        let [x, _, n] = axes();
        let (sin, cos) = tilt_degrees.to_radians().sin_cos();
        let from = PLACE + 5.0 * n;
        let axis = -cos * n + sin * x;
        let side = axis.cross(DVec3::X).normalize();
        let space = DMat3::from_cols(side, axis.cross(side), axis);
        let light = LightDesc::Spot {
            world_from_light: Transform::from_affine(DAffine3::from_mat3_translation(space, from)).unwrap(),
            intensity: Rgb::splat(50.0),
            cone_angle: 30.0,
            cone_delta_angle: 10.0,
        };
        irradiance(with_light(light), Strategy::Both, 2).0
    };
    assert_close(direct(12.0), 2.0, 1e-4, "inside");
    let share = (25_f64.to_radians().cos() - 30_f64.to_radians().cos())
        / (20_f64.to_radians().cos() - 30_f64.to_radians().cos());
    assert_close(direct(25.0), 2.0 * share * share * (3.0 - 2.0 * share), 1e-3, "edge");
    assert_eq!(direct(31.0), 0.0);
}

#[test]
fn distant_light_falls_by_the_cosine() {
    let [x, _, n] = axes();
    let towards = (3.0 * n + 4.0 * x) / 5.0;
    let light = LightDesc::Distant { towards, irradiance: Rgb::splat(7.0) };
    let (found, _) = irradiance(with_light(light), Strategy::Both, 2);
    assert_close(found, 7.0 * 0.6, 1e-4, "distant");
}

#[test]
fn area_lights_match_their_form_factors() {
    let up = over_floor();
    let sphere = Sphere::new(up.point(DVec3::new(2.0, 1.0, 4.0)), 1.75).unwrap();
    let sphere_expected = 5.0 * PI * 1.75_f64.powi(2) * 4.0 / 21_f64.powf(1.5);
    let disk = Disk::new(DVec3::new(0.0, 0.0, 3.0), -DVec3::Z, 2.5, 0.0).unwrap();
    let disk_expected = 5.0 * PI * 6.25 / (6.25 + 9.0);
    // Two rectangles that meet over the point: corners of 2 by 1.5 and of 0.5 by 1.5, at height 3.
    let corner = |a: f64, b: f64| {
        let (a, b) = (a / 3.0, b / 3.0);
        let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        0.5 * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan())
    };
    let rectangle = mesh(
        vec![
            Vec3::new(-0.5, 0.0, 3.0),
            Vec3::new(-0.5, 1.5, 3.0),
            Vec3::new(2.0, 1.5, 3.0),
            Vec3::new(2.0, 0.0, 3.0),
        ],
        vec![],
        vec![[0, 1, 2, 3]],
    );
    let rectangle_expected = 5.0 * (corner(2.0, 1.5) + corner(0.5, 1.5));
    let cases = [
        ("sphere", exact(sphere), Transform::IDENTITY, sphere_expected),
        ("disk", exact(disk), up, disk_expected),
        ("rectangle", rectangle, up, rectangle_expected),
    ];
    for (name, geometry, placement, expected) in cases {
        for (strategy, share) in [(Strategy::Both, 2e-3), (Strategy::Lights, 2e-3), (Strategy::Bsdf, 1.5e-2)]
        {
            let desc = with_shape(geometry.clone(), placement, 5.0, false);
            let (found, rays) = irradiance(desc, strategy, 1024);
            assert_close(found, expected, share, &format!("{name}, {strategy:?}"));
            let used = if strategy == Strategy::Bsdf { rays.bounce } else { rays.shadow };
            assert!(used > 60_000, "{name}, {strategy:?}: {rays:?}");
        }
    }
}

#[test]
fn an_environment_lights_as_its_integral_says() {
    const SIDE: u32 = 96;
    // Radiance a + b (ω·z): the irradiance is π a + 2π/3 b (n·z), of light's z in the world.
    let (a, b) = (1.25, 1.0);
    let turned = Transform::rotate(DVec3::new(1.0, 2.0, -0.5), 50.0).unwrap();
    let expected = PI * a + 2.0 * PI / 3.0 * b * normal().dot(turned.vector(DVec3::Z));
    let picture = |width: u32, height: u32, direction: fn(DVec2) -> DVec3| {
        let pixel = |i: u32| {
            let uv = DVec2::new(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5)
                / DVec2::new(width.into(), height.into());
            Rgb::splat((a + b * direction(uv).z) as f32)
        };
        Arc::new(Image::from_pixels(width, height, (0..width * height).map(pixel).collect()).unwrap())
    };
    let cases = [
        (EnvironmentMapping::EqualArea, picture(SIDE, SIDE, warp64::equal_area_square_to_sphere)),
        (EnvironmentMapping::LatitudeLongitude, picture(2 * SIDE, SIDE, warp64::latlong_to_sphere)),
    ];
    for (mapping, image) in cases {
        for strategy in [Strategy::Both, Strategy::Lights, Strategy::Bsdf] {
            let desc = with_light(LightDesc::Infinite {
                world_from_light: turned,
                radiance: Rgb::WHITE,
                image: Some(EnvironmentDesc { image: image.clone(), mapping }),
            });
            let (found, _) = irradiance(desc, strategy, 256);
            assert_close(found, expected, 2e-3, &format!("{mapping:?}, {strategy:?}"));
        }
    }
    for strategy in [Strategy::Both, Strategy::Lights, Strategy::Bsdf] {
        let light = LightDesc::Infinite { world_from_light: turned, radiance: Rgb::splat(2.0), image: None };
        let (found, _) = irradiance(with_light(light), strategy, 256);
        assert_close(found, 2.0 * PI, 2e-3, &format!("uniform, {strategy:?}"));
    }
}

#[test]
fn a_sun_in_an_environment_points_where_its_pixel_is() {
    // One bright pixel over black: the distribution finds it, and the interpolation around it.
    let mut image = Image::filled(256, 256, Rgb::BLACK);
    let (x, y) = (160_u32, 85_u32);
    image.pixels_mut()[(y * 256 + x) as usize] = Rgb::splat(1000.0);
    let uv = DVec2::new((f64::from(x) + 0.5) / 256.0, (f64::from(y) + 0.5) / 256.0);
    let towards = warp64::equal_area_square_to_sphere(uv);
    let [_, _, n] = axes();
    // Turn it so that it stands over the floor.
    let turned =
        DMat3::from_quat(lumbre_math::DQuat::from_rotation_arc(towards, (n + 0.3 * axes()[1]).normalize()));
    let cosine = (turned * towards).dot(n);
    let desc = with_light(LightDesc::Infinite {
        world_from_light: Transform::from_affine(DAffine3::from_mat3(turned)).unwrap(),
        radiance: Rgb::WHITE,
        image: Some(EnvironmentDesc { image: Arc::new(image), mapping: EnvironmentMapping::EqualArea }),
    });
    let (found, rays) = irradiance(desc, Strategy::Lights, 2048);
    // A tent over 2 by 2 pixels has the volume of one pixel; its cosine varies a little about the middle's.
    assert_close(found, 1000.0 * 4.0 * PI / 65536.0 * cosine, 2e-3, "sun");
    // Half of each neighbour of the bright pixel lies outside the tent: 1 - 9/64 - 6/64 is left.
    assert_close(rays.shadow as f64 / rays.camera as f64, 49.0 / 64.0, 1e-2, "found");
}

/// Every shape that can shine, of sizes that are not 1, a few units over the floor in coordinates of the floor.
fn shapes() -> Vec<(&'static str, GeometryDesc)> {
    let c = DVec3::new(0.4, -0.3, 3.0);
    let sphere = Sphere::new(c, 1.3).unwrap();
    let patch = BilinearPatch::new(
        c + DVec3::new(-1.5, -1.2, 0.0),
        c + DVec3::new(-1.2, 1.4, 0.5),
        c + DVec3::new(1.7, -1.0, 0.8),
        c + DVec3::new(1.4, 1.3, -0.4),
    );
    // ((x-c)/1.5)² + ((y-c)/1.2)² + ((z-c)/0.9)² = 1
    let w = [1.0 / 2.25, 1.0 / 1.44, 1.0 / 0.81];
    let ellipsoid = [
        w[0],
        w[1],
        w[2],
        0.0,
        0.0,
        0.0,
        -2.0 * w[0] * c.x,
        -2.0 * w[1] * c.y,
        -2.0 * w[2] * c.z,
        w[0] * c.x * c.x + w[1] * c.y * c.y + w[2] * c.z * c.z - 1.0,
    ];
    let lift = |shape: Shape| exact(shape);
    vec![
        ("sphere", lift(sphere.into())),
        ("part of a sphere", lift(sphere.partial(-1.1, 0.6, 250.0).unwrap().into())),
        ("annulus", lift(Disk::new(c, DVec3::new(0.2, 0.1, -1.0), 1.6, 0.5).unwrap().into())),
        ("box", lift(Cuboid::new(c - DVec3::new(1.2, 0.8, 0.5), c + 0.7).unwrap().into())),
        ("cylinder", lift(Cylinder::new(c - 0.9, c + DVec3::new(0.9, 0.3, 0.4), 0.7, true).unwrap().into())),
        (
            "open cylinder",
            lift(Cylinder::new(c - 0.9, c + DVec3::new(0.9, 0.3, 0.4), 0.7, false).unwrap().into()),
        ),
        ("capsule", lift(Capsule::new(c - 0.7, c + DVec3::new(0.7, 0.3, 0.4), 0.6).unwrap().into())),
        ("cone", lift(Cone::new(c - 0.8, c + DVec3::new(0.9, 0.4, 0.6), 1.2, 0.0, true).unwrap().into())),
        ("frustum", lift(Cone::new(c - 0.8, c + DVec3::new(0.9, 0.4, 0.6), 1.2, 0.6, false).unwrap().into())),
        ("patch", lift(patch.unwrap().into())),
        (
            "triangle",
            lift(
                Triangle::new(c - DVec3::X, c + DVec3::new(0.5, 1.9, 0.3), c + DVec3::new(1.5, -1.0, 0.2))
                    .unwrap()
                    .into(),
            ),
        ),
        ("torus", lift(Torus::new(c, DVec3::new(0.3, 0.5, 1.0), 1.2, 0.45).unwrap().into())),
        ("paraboloid", lift(Paraboloid::new(1.4, 0.3, 3.3, 300.0).unwrap().into())),
        (
            "hyperboloid",
            lift(
                Hyperboloid::new(DVec3::new(1.2, 0.1, 1.8), DVec3::new(0.6, 1.0, 3.4), 330.0).unwrap().into(),
            ),
        ),
        ("ellipsoid", lift(Quadric::new(ellipsoid, None).unwrap().into())),
        (
            "mesh",
            mesh(
                vec![
                    Vec3::new(-1.0, -1.2, 2.5),
                    Vec3::new(1.4, -0.9, 2.8),
                    Vec3::new(0.2, 1.5, 2.6),
                    Vec3::new(0.3, -0.2, 4.0),
                ],
                vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
                vec![],
            ),
        ),
        (
            "bent quads",
            mesh(
                vec![
                    Vec3::new(-1.4, -1.2, 2.5),
                    Vec3::new(1.4, -0.9, 3.0),
                    Vec3::new(1.5, 1.5, 2.4),
                    Vec3::new(-1.3, 1.2, 3.1),
                ],
                vec![],
                vec![[0, 1, 2, 3]],
            ),
        ),
    ]
}

#[test]
fn sampling_any_shape_agrees_with_hitting_it_by_chance() {
    let plain = over_floor();
    let squeezed = over_floor()
        * Transform::shear(0.2, -0.1, 0.15, 0.0, 0.05, 0.1).unwrap()
        * Transform::scale(DVec3::new(-1.15, 0.8, 0.9)).unwrap();
    for (way, placement) in [("placed", plain), ("squeezed", squeezed)] {
        for (name, geometry) in shapes() {
            let by =
                |strategy, spp| irradiance(with_shape(geometry.clone(), placement, 3.0, true), strategy, spp);
            let (chance, hits) = by(Strategy::Bsdf, 512);
            let (sampled, rays) = by(Strategy::Lights, 256);
            let (both, _) = by(Strategy::Both, 256);
            assert!(hits.bounce > 30_000 && rays.shadow > 5_000, "{name} {way}: {hits:?} {rays:?}");
            assert!(chance > 0.05, "{name} {way}: {chance}");
            assert_close(sampled, chance, 0.02, &format!("{name} {way}: sampled"));
            assert_close(both, chance, 0.015, &format!("{name} {way}: both"));
        }
    }
}

#[test]
fn a_light_of_given_power_emits_it_whatever_its_size() {
    // Lumens over π A, twice that area when both sides shine.
    for two_sided in [false, true] {
        let mut desc = with_shape(
            exact(Sphere::new(PLACE + 4.0 * normal(), 1.5).unwrap()),
            Transform::IDENTITY,
            1.0,
            two_sided,
        );
        desc.shapes[1].area_light.as_mut().unwrap().power = Some(200.0);
        let (found, _) = irradiance(desc, Strategy::Both, 256);
        let area = 4.0 * PI * 2.25 * if two_sided { 2.0 } else { 1.0 };
        assert_close(found, 200.0 / (PI * area) * PI * (1.5_f64 / 4.0).powi(2), 2e-3, "power");
    }
}

#[test]
fn among_many_lights_each_gives_its_share() {
    // A mesh of many triangles, points and a distant light together: the sum of what each gives alone.
    let lights = || {
        vec![
            LightDesc::Point {
                from: over_floor().point(DVec3::new(2.0, 1.0, 3.0)),
                intensity: Rgb::splat(9.0),
            },
            LightDesc::Point {
                from: over_floor().point(DVec3::new(-2.0, 0.5, 1.5)),
                intensity: Rgb::splat(0.5),
            },
            LightDesc::Distant { towards: normal(), irradiance: Rgb::splat(0.002) },
        ]
    };
    let (_, geometry) =
        shapes().into_iter().find(|(name, _)| *name == "mesh").expect("a mesh among the shapes");
    let whole = SceneDesc { lights: lights(), ..with_shape(geometry.clone(), over_floor(), 3.0, false) };
    let (together, _) = irradiance(whole, Strategy::Both, 1024);
    let (mesh_alone, _) = irradiance(with_shape(geometry, over_floor(), 3.0, false), Strategy::Both, 256);
    // The mesh casts a shadow: alone it is a light of nothing.
    let mut sum = mesh_alone;
    for light in lights() {
        let (_, geometry) = shapes().swap_remove(14);
        let mut dark = with_shape(geometry, over_floor(), 3.0, false);
        dark.shapes[1].area_light = None;
        sum += irradiance(SceneDesc { lights: vec![light], ..dark }, Strategy::Both, 16).0;
    }
    assert_close(together, sum, 4e-3, "together");
}
