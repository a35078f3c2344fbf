//! The choice among many lights: no light is lost or doubled, and densities are those of the samples.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod lit;

use std::sync::Arc;

use lit::{lights_of_all_kinds, rectangle_of_triangles, shining, sky_under};
use lumbre_geometry::{Cylinder, Disk, Ray, Shape, Sphere};
use lumbre_image::{Bitmap, Channels, Encoding, Image, PixelData, Rgb};
use lumbre_math::frame::orthonormal_basis;
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform, Vec2, warp64};
use lumbre_scene::{
    EnvironmentDesc, EnvironmentMapping, Footprint, GeometryDesc, LightDesc, LightId, LightSample, MeshDesc,
    NamedMaterial, Scene, SceneDesc,
};
use lumbre_shading::{Material, MipMap, MipMapOptions, Scatter};

fn flux(sample: Option<LightSample>) -> f64 {
    sample.map_or(0.0, |sample| {
        let density = if let Scatter::Density(pdf) = sample.scatter { pdf } else { 1.0 };
        f64::from(sample.radiance.average() / density)
    })
}

#[test]
fn the_light_of_all_is_the_sum_of_each() {
    const COUNT: usize = 60_000;
    let scene = lights_of_all_kinds(None);
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
            (0..COUNT).map(|_| flux(scene.sample_light(from, DVec3::ZERO, 0.0, u().x, u()))).sum::<f64>()
                / COUNT as f64;
        assert!((all / each - 1.0).abs() < 0.03, "{from}: {all} {each}");
    }
}

#[test]
fn light_below_the_horizon_of_an_opaque_place_takes_no_samples() {
    let mut lights = vec![
        LightDesc::Point { from: DVec3::new(0.3, 0.0, 2.0), intensity: Rgb::splat(4.0) },
        LightDesc::Point { from: DVec3::new(0.0, 0.2, -2.0), intensity: Rgb::splat(4e4) },
        LightDesc::Distant { towards: DVec3::new(0.2, 0.1, -0.9), irradiance: Rgb::splat(4e4) },
        LightDesc::Distant { towards: DVec3::new(0.6, 0.0, 0.8), irradiance: Rgb::splat(2.0) },
    ];
    let build = |lights: &[LightDesc]| {
        Scene::build(SceneDesc { lights: lights.to_vec(), ..SceneDesc::default() }).unwrap()
    };
    let scene = build(&lights);
    let mut random = RandomStream::new(23);
    let mut mean = 0.0;
    for _ in 0..4000 {
        let u = DVec2::new(random.next_f64(), random.next_f64());
        let sample = scene.sample_light(DVec3::ZERO, DVec3::Z, 0.0, random.next_f64(), u).unwrap();
        assert!(sample.towards.z > 0.0);
        mean += flux(Some(sample)) * sample.towards.z / 4000.0;
        // A place that transmits, and one that faces down, are lit from below.
        let down = scene.sample_light(DVec3::ZERO, -DVec3::Z, 0.0, random.next_f64(), u).unwrap();
        assert!(down.towards.z < 0.0);
    }
    let expected = 4.0 * 2.0 / (0.09_f64 + 4.0).powf(1.5) + 2.0 * 0.8;
    assert!((mean / expected - 1.0).abs() < 0.03, "{mean} {expected}");
    let below = |_| scene.sample_light(DVec3::ZERO, DVec3::ZERO, 0.0, random.next_f64(), DVec2::splat(0.5));
    assert!((0..100).filter_map(below).filter(|sample| sample.towards.z < 0.0).count() > 50);
    // All that is left is sampled by every sample.
    lights.truncate(3);
    let scene = build(&lights);
    for i in 0..100 {
        let choose = f64::from(i) / 100.0;
        let sample = scene.sample_light(DVec3::ZERO, DVec3::Z, 0.0, choose, DVec2::splat(0.5)).unwrap();
        assert!((flux(Some(sample)) - 4.0 / 4.09).abs() < 1e-6, "{sample:?}");
    }
}

#[test]
fn the_density_of_what_a_ray_finds_is_that_of_the_sample() {
    let scene = lights_of_all_kinds(None);
    let mut random = RandomStream::new(9);
    let mut count = 0;
    for _ in 0..4000 {
        let mut x = || random.next_f64();
        let from = 8.0 * DVec3::new(x() - 0.5, x() - 0.5, x() - 0.5);
        let Some(sample) = scene.sample_light(from, DVec3::ZERO, 0.0, x(), DVec2::new(x(), x())) else {
            continue;
        };
        let (Scatter::Density(expected), Some(end)) = (sample.scatter, sample.end) else { continue };
        let ray = Ray::new(from, sample.towards);
        let Some(hit) = scene.closest(&ray) else { continue };
        let met = scene.interaction(&ray, &hit, &Footprint::Point);
        // Another light may stand before it.
        if (met.surface.point - end.point).length() > 1e-6 {
            continue;
        }
        let density = scene.light_pdf(from, DVec3::ZERO, &met);
        assert!((density / expected - 1.0).abs() < 1e-3, "{density} {expected} {met:?}");
        count += 1;
    }
    assert!(count > 500, "{count}");
}

/// The irradiance by radiance 1 of a rectangle on a surface that faces `normal`, all of it being before both: Lambert's
/// sum over the sides of the polygon.
fn lambert(corners: &[DVec3], normal: DVec3) -> f64 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let sum: f64 = sides.map(|(a, b)| a.angle_between(*b) * a.cross(*b).normalize().dot(normal)).sum();
    0.5 * sum.abs()
}

#[test]
fn rectangles_of_triangles_match_lambert_near_and_far() {
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
            let sample = scene.sample_light(from, DVec3::ZERO, 0.0, random.next_f64(), u).unwrap();
            let Scatter::Density(pdf) = sample.scatter else { panic!("{sample:?}") };
            let cosine = -sample.towards.dot(normal);
            sum += f64::from(sample.radiance.average()) * cosine / f64::from(pdf);
            // What a ray finds of either triangle has the density of the samples, and the mean of its inverse is the
            // solid angle.
            of_one += 1.0 / f64::from(pdf);
            let ray = Ray::new(from, sample.towards);
            let Some(hit) = scene.closest(&ray) else { continue };
            let met = scene.interaction(&ray, &hit, &Footprint::Point);
            assert!((scene.light_pdf(from, DVec3::ZERO, &met) / pdf - 1.0).abs() < 1e-4, "{case}");
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
        assert_eq!(
            scene.sample_light(middle - distance * normal, DVec3::ZERO, 0.0, 0.4, DVec2::splat(0.3)),
            None
        );
    }
}

/// A shadow ray that ends where the error of the light's point lets it.
fn met_shadow(from: DVec3, sample: &LightSample) -> Ray {
    let end = sample.end.unwrap();
    let way = end.point - from;
    let short = end.error.dot(end.normal.abs()) / way.dot(end.normal).abs();
    Ray { t_max: way.length() * (1.0 - 4.0 * short), ..Ray::new(from, sample.towards) }
}

#[test]
fn sky_samples_for_mis_have_the_density_of_escaping_rays() {
    const SIDE: u32 = 300;
    let mut random = RandomStream::new(17);
    for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatitudeLongitude] {
        let turned = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap();
        let scene = sky_under(mapping, turned);
        let (mut whole, mut light, mut by_both, mut bright) = (0.0, 0.0, 0.0, 0);
        for i in 0..SIDE * SIDE {
            let jitter = DVec2::new(random.next_f64(), random.next_f64());
            let u = (DVec2::new(f64::from(i % SIDE), f64::from(i / SIDE)) + jitter) / f64::from(SIDE);
            let cosine = |towards: DVec3| towards.dot(DVec3::new(0.6, 0.0, 0.8)).max(0.0);
            let share = 1.0 / f64::from(SIDE * SIDE);
            // All directions alike.
            let ray = Ray::new(DVec3::ONE, warp64::square_to_sphere(u));
            let (radiance, pdf) = scene.escaped(&ray, DVec3::ZERO).next().unwrap();
            assert!(radiance.is_black() || pdf > 0.0);
            let sphere = 4.0 * std::f64::consts::PI;
            whole += share * sphere * f64::from(pdf);
            let arriving = f64::from(radiance.average()) * cosine(ray.direction);
            light += share * sphere * arriving;
            by_both += share * arriving / (f64::from(pdf) + 1.0 / sphere);
            // And sampled ones.
            let Some(sample) = scene.sample_light(DVec3::ONE, DVec3::ZERO, 0.0, 0.5, u) else { continue };
            let ray = Ray::new(DVec3::ONE, sample.towards);
            let (radiance, pdf) = scene.escaped(&ray, DVec3::ZERO).next().unwrap();
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
            let (_, pdf) = scene.escaped(&ray, DVec3::ZERO).next().unwrap();
            // A row of the picture between circles of latitude is sampled evenly in the angle, which is not so even
            // near the poles.
            assert!(
                direction.z.abs() > 0.8 || (f64::from(pdf) * 4.0 * std::f64::consts::PI - 1.0).abs() < 0.2,
                "{direction} {pdf}"
            );
        }
    }
}

/// A rectangle of two triangles with a picture that is dim but for one texel in 4,096: its radiance over uv, and the
/// scene.
fn screen(corner: DVec3, sides: [DVec3; 2], has_normals: bool) -> (Arc<MipMap>, Scene) {
    const SIDE: usize = 64;
    let mut texels = vec![0.02; 3 * SIDE * SIDE];
    texels[3 * (SIDE * 21 + 37)..][..3].fill(400.0);
    let bitmap = Bitmap::new(64, 64, Channels::Rgb, PixelData::F32(texels), Encoding::Linear).unwrap();
    let image = Arc::new(MipMap::new(Arc::new(bitmap), MipMapOptions::default()));
    let [a, b] = sides;
    let positions = [corner, corner + a, corner + a + b, corner + b].map(|p| p.as_vec3()).to_vec();
    let mesh = MeshDesc {
        positions,
        uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]),
        normals: has_normals.then(|| vec![a.cross(b).normalize().as_vec3(); 4]),
        triangles: vec![[0, 1, 2], [2, 3, 0]],
        ..MeshDesc::default()
    };
    let mut shape = shining(1, GeometryDesc::Mesh(Arc::new(mesh)), 1.5, false);
    shape.area_light.as_mut().unwrap().image = Some(image.clone());
    let material = NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) };
    let scene =
        Scene::build(SceneDesc { shapes: vec![shape], materials: vec![material], ..SceneDesc::default() });
    (image, scene.unwrap())
}

#[test]
fn one_bright_texel_of_thousands_is_found_from_near_and_far() {
    let (corner, [a, b]) =
        (DVec3::new(-1.2, 0.5, 4.0), [DVec3::new(3.0, 0.0, 0.4), DVec3::new(0.0, -2.0, 0.3)]);
    let normal = a.cross(b).normalize();
    let mut random = RandomStream::new(29);
    for has_normals in [false, true] {
        let (image, scene) = screen(corner, [a, b], has_normals);
        for distance in [0.3, 1.5, 9.0] {
            let from = corner + 0.4 * a + 0.8 * b + distance * normal;
            // By a fine grid.
            const GRID: u32 = 512;
            let mut expected = 0.0;
            for i in 0..GRID * GRID {
                let uv = (DVec2::new(f64::from(i % GRID), f64::from(i / GRID)) + 0.5) / f64::from(GRID);
                let way = corner + uv.x * a + uv.y * b - from;
                let radiance = 1.5 * image.lookup(uv.as_vec2(), Vec2::ZERO, Vec2::ZERO).average();
                let cosines = way.dot(normal).powi(2) / way.length_squared().powi(2);
                expected += f64::from(radiance) * cosines * a.cross(b).length() / f64::from(GRID * GRID);
            }
            let (mut mean, mut square, mut solid_angle, mut same) = (0.0, 0.0, 0.0, 0);
            const COUNT: u32 = 4096;
            for i in 0..COUNT {
                let jitter = DVec2::new(random.next_f64(), random.next_f64());
                let u = (DVec2::new(f64::from(i % 64), f64::from(i / 64)) + jitter) / 64.0;
                let sample = scene.sample_light(from, -normal, 0.0, random.next_f64(), u).unwrap();
                let Scatter::Density(pdf) = sample.scatter else { panic!("{sample:?}") };
                let light = flux(Some(sample)) * -sample.towards.dot(normal);
                mean += light / f64::from(COUNT);
                square += light * light / f64::from(COUNT);
                solid_angle += 1.0 / f64::from(pdf) / f64::from(COUNT);
                let ray = Ray::new(from, sample.towards);
                let Some(hit) = scene.closest(&ray) else { continue };
                let met = scene.interaction(&ray, &hit, &Footprint::Point);
                same += u32::from((scene.light_pdf(from, -normal, &met) / pdf - 1.0).abs() < 1e-3);
            }
            assert!((mean / expected - 1.0).abs() < 0.03, "{distance}: {mean} {expected}");
            // The variance of one sample is less than twice the square of the mean; by area it is some hundred times
            // that.
            assert!(square < 3.0 * expected * expected, "{distance}: {square} {expected}");
            let seen = [[a, a + b], [a + b, b]].map(|[p, q]| {
                let at = corner - from;
                lumbre_geometry::Triangle::new(at, at + p, at + q).unwrap().solid_angle(DVec3::ZERO)
            });
            let seen: f64 = seen.iter().sum();
            assert!((solid_angle / seen - 1.0).abs() < 0.15, "{distance}: {solid_angle} {seen}");
            assert!(same > COUNT - COUNT / 100, "{distance}: {same}");
        }
    }
}

#[test]
fn a_nan_texel_is_named_and_the_rest_of_the_sky_shines() {
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

/// A lamp whose picture is dim but for one texel in 4,096, and its scene.
fn pictured_lamp(shape: Shape, world_from_object: Transform) -> Scene {
    const SIDE: usize = 64;
    let mut texels = vec![0.02; 3 * SIDE * SIDE];
    texels[3 * (SIDE * 21 + 5)..][..3].fill(400.0);
    let bitmap = Bitmap::new(64, 64, Channels::Rgb, PixelData::F32(texels), Encoding::Linear).unwrap();
    let image = Arc::new(MipMap::new(Arc::new(bitmap), MipMapOptions::default()));
    let mut lamp = shining(1, GeometryDesc::Exact(shape), 1.5, false);
    lamp.world_from_object = world_from_object;
    lamp.area_light.as_mut().unwrap().image = Some(image);
    let material = NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) };
    let desc = SceneDesc { shapes: vec![lamp], materials: vec![material], ..SceneDesc::default() };
    Scene::build(desc).unwrap()
}

#[test]
fn one_bright_texel_of_a_disk_a_sphere_and_a_tube_is_found() {
    let ball = Sphere::new(DVec3::new(0.5, 0.0, 0.0), 1.5).unwrap();
    let plate = Disk::new(DVec3::ZERO, DVec3::Z, 2.0, 0.0).unwrap();
    let tube = Cylinder::new(DVec3::ZERO, DVec3::new(0.0, 0.0, 2.0), 0.5, false).unwrap();
    let map = Transform::translate(DVec3::new(0.3, -0.2, 4.0))
        * Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 25.0).unwrap()
        * Transform::scale(DVec3::new(1.5, 1.0, 1.0)).unwrap();
    let mut random = RandomStream::new(31);
    let bright = DVec2::new(5.5, 21.5) / 64.0;
    // Each with half the side of a square at distance 1 that covers it.
    for (shape, half) in [(Shape::from(ball), 2.0), (Shape::from(plate), 2.5), (Shape::from(tube), 0.8)] {
        let name = shape.name();
        // In front of the bright texel, wherever the picture's rows begin.
        let seen = [bright, DVec2::new(bright.x, 1.0 - bright.y)]
            .map(|uv| shape.surface_at(0, uv).unwrap().placed(&map));
        let scene = pictured_lamp(shape, map);
        let from = 0.5 * (seen[0].point + seen[1].point) + 3.0 * seen[0].normal;
        let towards = (seen[0].point - from).normalize();
        // By directions in the cone around the lamp, without the light's own sampling.
        let radiance = |direction: DVec3| {
            let ray = Ray::new(from, direction);
            let hit = scene.closest(&ray);
            hit.map_or(0.0, |hit| {
                let met = scene.interaction(&ray, &hit, &Footprint::Point);
                f64::from(met.emitted().average())
            })
        };
        const GRID: u32 = 400;
        let (e1, e2) = orthonormal_basis(towards);
        let mut expected = 0.0;
        let step = 2.0 * half / f64::from(GRID);
        for i in 0..GRID * GRID {
            let s = (DVec2::new(f64::from(i % GRID), f64::from(i / GRID)) + 0.5) * step - half;
            let way = towards + s.x * e1 + s.y * e2;
            let cosine = 1.0 / way.length();
            expected += radiance(way.normalize()) * cosine.powi(4) * step * step;
        }
        let (mut mean, mut square, mut same, mut met_it) = (0.0, 0.0, 0, 0);
        const COUNT: u32 = 4096;
        for i in 0..COUNT {
            let jitter = DVec2::new(random.next_f64(), random.next_f64());
            let u = (DVec2::new(f64::from(i % 64), f64::from(i / 64)) + jitter) / 64.0;
            let Some(sample) = scene.sample_light(from, towards, 0.0, random.next_f64(), u) else { continue };
            let ray = Ray::new(from, sample.towards);
            let Some(hit) = scene.closest(&ray) else { continue };
            let met = scene.interaction(&ray, &hit, &Footprint::Point);
            let is_near = sample.end.is_some_and(|end| (end.point - met.surface.point).length() < 1e-4);
            if !is_near {
                continue;
            }
            let Scatter::Density(pdf) = sample.scatter else { panic!("{sample:?}") };
            met_it += 1;
            same += u32::from((scene.light_pdf(from, towards, &met) / pdf - 1.0).abs() < 1e-3);
            let light = flux(Some(sample)) * sample.towards.dot(towards);
            mean += light / f64::from(COUNT);
            square += light * light / f64::from(COUNT);
        }
        assert!(met_it > COUNT / 4, "{name}: {met_it}");
        assert!((mean / expected - 1.0).abs() < 0.06, "{name}: {mean} {expected}");
        // By direction alone it is some hundred times the square of the mean.
        assert!(square < 8.0 * expected * expected, "{name}: {square} {expected}");
        assert!(same > met_it - met_it / 50, "{name}: {same} of {met_it}");
    }
}
