//! The choice among many lights: no light is lost or doubled, and densities are those of the samples.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use lumbre_geometry::{Disk, Ray, Shape, Sphere};
use lumbre_image::{Image, Rgb};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform, Vec3, warp64};
use lumbre_scene::{
    AreaLightDesc, EnvironmentDesc, EnvironmentMapping, Footprint, GeometryDesc, InstanceDesc, LightDesc,
    LightId, LightSample, MaterialId, MeshDesc, NamedMaterial, ObjectDesc, ObjectId, Scene, SceneDesc,
    ShapeDesc,
};
use lumbre_shading::{Material, Scatter};

fn shining(index: u32, geometry: GeometryDesc, radiance: f32, two_sided: bool) -> ShapeDesc {
    let radiance = Rgb::splat(radiance);
    let light = AreaLightDesc { radiance, image: None, by_vertices: false, two_sided, power: None };
    ShapeDesc {
        index,
        geometry,
        world_from_object: Transform::IDENTITY,
        reverse_orientation: index.is_multiple_of(2),
        material: Some(MaterialId(0)),
        area_light: Some(light),
        alpha: None,
    }
}

fn patch_of_triangles(random: &mut RandomStream) -> GeometryDesc {
    let mut x = || 2.0 * random.next_f32() - 1.0;
    let at = 4.0 * Vec3::new(x(), x(), x());
    let positions = (0..5).map(|_| at + Vec3::new(x(), x(), x())).collect();
    let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4]];
    GeometryDesc::Mesh(Arc::new(MeshDesc { positions, triangles, ..MeshDesc::default() }))
}

/// A rectangle that is turned, the point in its middle, its unit normal and half its sides.
fn rectangle_of_triangles(random: &mut RandomStream) -> (GeometryDesc, DVec3, DVec3, [DVec3; 2]) {
    let mut x = || 2.0 * random.next_f64() - 1.0;
    let middle = 5.0 * DVec3::new(x(), x(), x());
    let normal = DVec3::new(x(), x(), x()).normalize();
    let across = normal.cross(DVec3::new(x(), x(), x())).normalize();
    let half = [0.8 * across, 0.5 * normal.cross(across)];
    let corner = |a: f64, b: f64| (middle + a * half[0] + b * half[1]).as_vec3();
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mesh = MeshDesc { positions, triangles: vec![[0, 1, 2], [2, 3, 0]], ..MeshDesc::default() };
    (GeometryDesc::Mesh(Arc::new(mesh)), middle, normal, half)
}

/// Lights of every kind about the origin, but for the origin itself.
fn lights_of_all_kinds() -> Scene {
    let mut random = RandomStream::new(3);
    let mut shapes: Vec<ShapeDesc> = (0..12)
        .map(|i| shining(i, patch_of_triangles(&mut random), 0.5 + random.next_f32(), i % 3 == 0))
        .collect();
    shapes.extend(
        (20..26)
            .map(|i| shining(i, rectangle_of_triangles(&mut random).0, 0.5 + random.next_f32(), i % 3 == 0)),
    );
    let exact = |shape: Shape| GeometryDesc::Exact(shape);
    let v = DVec3::new;
    shapes.push(shining(
        12,
        exact(Disk::new(v(0.0, 0.0, 5.0), -DVec3::Z, 1.0, 0.0).unwrap().into()),
        2.0,
        false,
    ));
    shapes.push(shining(13, exact(Sphere::new(v(3.0, 4.0, -2.0), 0.7).unwrap().into()), 1.0, false));
    let placed = shining(14, patch_of_triangles(&mut random), 3.0, true);
    let object = ObjectDesc { shapes: vec![placed], ..ObjectDesc::default() };
    let map = Transform::translate(v(0.5, -4.0, 0.3)) * Transform::scale(v(1.0, 2.0, 0.5)).unwrap();
    let turned =
        Transform::translate(v(-3.0, 0.5, 2.0)) * Transform::rotate(v(1.0, 2.0, 0.5), 150.0).unwrap();
    let spot = LightDesc::Spot {
        world_from_light: turned,
        intensity: Rgb::splat(5.0),
        cone_angle: 100.0,
        cone_delta_angle: 60.0,
    };
    let lights = vec![
        LightDesc::Point { from: v(1.0, -2.0, 2.0), intensity: Rgb::splat(3.0) },
        spot,
        LightDesc::Distant { towards: v(0.2, 1.0, 0.4), irradiance: Rgb::splat(0.7) },
        LightDesc::Infinite { world_from_light: Transform::IDENTITY, radiance: Rgb::splat(0.1), image: None },
    ];
    let material = NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) };
    let instances = vec![InstanceDesc { object: ObjectId(0), world_from_object: map.into() }];
    let objects = vec![object];
    Scene::build(SceneDesc {
        shapes,
        objects,
        instances,
        lights,
        materials: vec![material],
        ..SceneDesc::default()
    })
    .unwrap()
}

fn flux(sample: Option<LightSample>) -> f64 {
    sample.map_or(0.0, |sample| {
        let density = if let Scatter::Density(pdf) = sample.scatter { pdf } else { 1.0 };
        f64::from(sample.radiance.average() / density)
    })
}

#[test]
fn the_light_of_all_is_the_sum_of_each() {
    const COUNT: usize = 60_000;
    let scene = lights_of_all_kinds();
    let mut random = RandomStream::new(8);
    for from in [DVec3::ZERO, DVec3::new(2.0, -1.0, 0.5), DVec3::new(-30.0, 20.0, 10.0)] {
        let mut u = || DVec2::new(random.next_f64(), random.next_f64());
        let each: f64 = (0..scene.lights().len() as u32)
            .map(|id| {
                (0..4000).map(|_| flux(scene.sample_one_light(LightId(id), from, 0.0, u()))).sum::<f64>()
                    / 4e3
            })
            .sum();
        let all: f64 =
            (0..COUNT).map(|_| flux(scene.sample_light(from, 0.0, u().x, u()))).sum::<f64>() / COUNT as f64;
        assert!((all / each - 1.0).abs() < 0.03, "{from}: {all} {each}");
    }
}

#[test]
fn the_density_of_what_a_ray_finds_is_that_of_the_sample() {
    let scene = lights_of_all_kinds();
    let mut random = RandomStream::new(9);
    let mut count = 0;
    for _ in 0..4000 {
        let mut x = || random.next_f64();
        let from = 8.0 * DVec3::new(x() - 0.5, x() - 0.5, x() - 0.5);
        let Some(sample) = scene.sample_light(from, 0.0, x(), DVec2::new(x(), x())) else { continue };
        let (Scatter::Density(expected), Some(end)) = (sample.scatter, sample.end) else { continue };
        let ray = Ray::new(from, sample.towards);
        let Some(hit) = scene.closest(&ray) else { continue };
        let met = scene.interaction(&ray, &hit, &Footprint::Point);
        // Another light may stand before it.
        if (met.surface.point - end.point).length() > 1e-6 {
            continue;
        }
        let density = scene.light_pdf(from, &met);
        assert!((density / expected - 1.0).abs() < 1e-3, "{density} {expected} {met:?}");
        count += 1;
    }
    assert!(count > 500, "{count}");
}

/// The irradiance by radiance 1 of a rectangle on a surface that faces `normal`, all of it being before both: Lambert's sum over the
/// sides of the polygon.
fn lambert(corners: &[DVec3], normal: DVec3) -> f64 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let sum: f64 = sides.map(|(a, b)| a.angle_between(*b) * a.cross(*b).normalize().dot(normal)).sum();
    0.5 * sum.abs()
}

#[test]
fn a_rectangle_of_two_triangles_lights_as_lambert_says_from_near_and_far() {
    let mut random = RandomStream::new(12);
    for (case, distance) in [0.03, 0.3, 0.9, 2.0, 4.0, 15.0].into_iter().enumerate() {
        let (geometry, middle, normal, [a, b]) = rectangle_of_triangles(&mut random);
        let light = shining(1, geometry, 1.0, false);
        let material = NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) };
        let scene = Scene::build(SceneDesc {
            shapes: vec![light],
            materials: vec![material],
            ..SceneDesc::default()
        })
        .unwrap();
        let from = middle + distance * normal + 0.4 * a - 0.7 * b;
        let corners =
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(s, t)| middle + s * a + t * b - from);
        let expected = lambert(&corners, normal);
        let (mut sum, mut of_one, mut sides) = (0.0, 0.0, [0; 2]);
        const SIDE: usize = 64;
        for i in 0..SIDE * SIDE {
            let u = DVec2::new((i % SIDE) as f64 + random.next_f64(), (i / SIDE) as f64 + random.next_f64())
                / SIDE as f64;
            let sample = scene.sample_light(from, 0.0, random.next_f64(), u).unwrap();
            let Scatter::Density(pdf) = sample.scatter else { panic!("{sample:?}") };
            let cosine = -sample.towards.dot(normal);
            sum += f64::from(sample.radiance.average()) * cosine / f64::from(pdf);
            // What a ray finds of either triangle has the density of the samples, and the mean of its inverse is the solid angle.
            of_one += 1.0 / f64::from(pdf);
            let ray = Ray::new(from, sample.towards);
            let Some(hit) = scene.closest(&ray) else { continue };
            let met = scene.interaction(&ray, &hit, &Footprint::Point);
            assert!((scene.light_pdf(from, &met) / pdf - 1.0).abs() < 1e-4, "{case}");
            sides[met.primitive as usize] += 1;
            assert!(!scene.is_occluded(&met_shadow(from, &sample)), "{case}");
        }
        let count = (SIDE * SIDE) as f64;
        let solid_angle: f64 = [[0, 1, 2], [2, 3, 0]]
            .map(|triangle| {
                let [p, q, r] = triangle.map(|i: usize| corners[i]);
                lumbre_geometry::Triangle::new(p, q, r).unwrap().solid_angle(DVec3::ZERO)
            })
            .iter()
            .sum();
        assert!((sum / count / expected - 1.0).abs() < 2e-3, "{case}: {} {expected}", sum / count);
        assert!(
            (of_one / count / solid_angle - 1.0).abs() < 2e-3,
            "{case}: {} {solid_angle}",
            of_one / count
        );
        assert!(sides[0] > 20 && sides[1] > 20 && sides[0] + sides[1] > 4090, "{case}: {sides:?}");
        // Behind it, nothing.
        assert_eq!(scene.sample_light(middle - distance * normal, 0.0, 0.4, DVec2::splat(0.3)), None);
    }
}

/// A shadow ray that ends where the error of the light's point lets it.
fn met_shadow(from: DVec3, sample: &LightSample) -> Ray {
    let end = sample.end.unwrap();
    let way = end.point - from;
    let short = end.error.dot(end.normal.abs()) / way.dot(end.normal).abs();
    Ray { t_max: way.length() * (1.0 - 4.0 * short), ..Ray::new(from, sample.towards) }
}

/// A dim sky with two bright pixels and some that are black.
fn sky(mapping: EnvironmentMapping) -> Scene {
    let (width, height) = if mapping == EnvironmentMapping::EqualArea { (12, 12) } else { (22, 11) };
    let mut random = RandomStream::new(4);
    let pixel = |i: u32| match i {
        30 | 31 => Rgb::splat(40.0),
        60..70 => Rgb::BLACK,
        _ => Rgb::splat(0.2 + random.next_f32()),
    };
    let image = Image::from_pixels(width, height, (0..width * height).map(pixel).collect()).unwrap();
    let map = EnvironmentDesc { image: Arc::new(image), mapping };
    let world_from_light = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap();
    let light = LightDesc::Infinite { world_from_light, radiance: Rgb::splat(1.5), image: Some(map) };
    Scene::build(SceneDesc { lights: vec![light], ..SceneDesc::default() }).unwrap()
}

#[test]
fn what_is_sampled_of_a_sky_beside_other_ways_is_all_of_it_with_the_density_of_what_escapes() {
    const SIDE: u32 = 300;
    let mut random = RandomStream::new(17);
    for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatitudeLongitude] {
        let scene = sky(mapping);
        let (mut whole, mut light, mut by_both, mut bright) = (0.0, 0.0, 0.0, 0);
        for i in 0..SIDE * SIDE {
            let jitter = DVec2::new(random.next_f64(), random.next_f64());
            let u = (DVec2::new(f64::from(i % SIDE), f64::from(i / SIDE)) + jitter) / f64::from(SIDE);
            let cosine = |towards: DVec3| towards.dot(DVec3::new(0.6, 0.0, 0.8)).max(0.0);
            let share = 1.0 / f64::from(SIDE * SIDE);
            // All directions alike.
            let ray = Ray::new(DVec3::ONE, warp64::square_to_sphere(u));
            let (radiance, pdf) = scene.escaped(&ray).next().unwrap();
            assert!(radiance.is_black() || pdf > 0.0);
            let sphere = 4.0 * std::f64::consts::PI;
            whole += share * sphere * f64::from(pdf);
            let arriving = f64::from(radiance.average()) * cosine(ray.direction);
            light += share * sphere * arriving;
            by_both += share * arriving / (f64::from(pdf) + 1.0 / sphere);
            // And those that are sampled.
            let Some(sample) = scene.sample_light(DVec3::ONE, 0.0, 0.5, u) else { continue };
            let ray = Ray::new(DVec3::ONE, sample.towards);
            let (radiance, pdf) = scene.escaped(&ray).next().unwrap();
            let Scatter::Density(expected) = sample.scatter else { panic!("{sample:?}") };
            assert!((pdf / expected - 1.0).abs() < 1e-3, "{pdf} {expected}");
            assert!((radiance.average() / sample.radiance.average() - 1.0).abs() < 1e-3);
            let arriving = f64::from(radiance.average()) * cosine(ray.direction);
            by_both += share * arriving / (f64::from(pdf) + 1.0 / sphere);
            bright += u32::from(sample.radiance.average() > 6.0);
        }
        assert!((whole - 1.0).abs() < 5e-3, "{mapping:?}: {whole}");
        assert!((by_both / light - 1.0).abs() < 1e-2, "{mapping:?}: {by_both} {light}");
        let one = |u| scene.sample_one_light(LightId(0), DVec3::ONE, 0.0, u);
        let all =
            (0..SIDE * SIDE).map(|i| DVec2::new(f64::from(i % SIDE), f64::from(i / SIDE)) / f64::from(SIDE));
        let usual = all.filter_map(one).filter(|sample| sample.radiance.average() > 6.0).count() as u32;
        assert!(bright * 10 > usual * 13, "{mapping:?}: {bright} {usual}");
    }
}

#[test]
fn a_sky_that_is_the_same_all_around_is_sampled_evenly() {
    for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatitudeLongitude] {
        let image = Image::filled(18, 18, Rgb::splat(0.37));
        let map = EnvironmentDesc { image: Arc::new(image), mapping };
        let light = LightDesc::Infinite {
            world_from_light: Transform::IDENTITY,
            radiance: Rgb::splat(2.5),
            image: Some(map),
        };
        let scene = Scene::build(SceneDesc { lights: vec![light], ..SceneDesc::default() }).unwrap();
        let mut random = RandomStream::new(21);
        for _ in 0..500 {
            let direction = warp64::square_to_sphere(DVec2::new(random.next_f64(), random.next_f64()));
            let ray = Ray::new(DVec3::ONE, direction);
            let (_, pdf) = scene.escaped(&ray).next().unwrap();
            // A row of the picture between circles of latitude is sampled evenly in the angle, which is not so even near the poles.
            assert!(
                direction.z.abs() > 0.8 || (f64::from(pdf) * 4.0 * std::f64::consts::PI - 1.0).abs() < 0.2,
                "{direction} {pdf}"
            );
        }
    }
}

#[test]
fn a_texel_that_is_not_finite_is_named_and_the_rest_of_the_sky_shines() {
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut pixels = vec![Rgb::splat(0.5); 16 * 8];
        pixels[5 * 16 + 9].b = wrong;
        // Finite, though its channels are more than single precision when they are added up.
        pixels[2 * 16 + 3] = Rgb::splat(3e38);
        let image = Arc::new(Image::from_pixels(16, 8, pixels).unwrap());
        let mapping = EnvironmentMapping::LatitudeLongitude;
        let sky = LightDesc::Infinite {
            world_from_light: Transform::IDENTITY,
            radiance: Rgb::WHITE,
            image: Some(EnvironmentDesc { image, mapping }),
        };
        let scene = Scene::build(SceneDesc { lights: vec![sky], ..SceneDesc::default() }).unwrap();
        let said: Vec<String> = scene.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(said, ["light 0: texel (9, 5) of its picture is not finite, and taken for black"]);
        assert_eq!(scene.lights().len(), 1);
    }
}
