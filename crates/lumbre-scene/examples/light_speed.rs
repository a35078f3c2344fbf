//! Nanoseconds a sample of light, a density and an escaped ray: scalar code against lanes at every instruction set.
//!
//! `cargo run --release -p lumbre-scene --example light_speed`

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "an example")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use lumbre_geometry::Ray;
use lumbre_image::{Image, Rgb};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform, Vec3};
use lumbre_scene::light::Sampling;
use lumbre_scene::light::lanes::Receiver;
use lumbre_scene::{
    AreaLightDesc, EnvironmentDesc, EnvironmentMapping, GeometryDesc, LightDesc, MaterialId, MeshDesc,
    NamedMaterial, Scene, SceneDesc, ShapeDesc,
};
use lumbre_shading::Material;
use lumbre_simd::{Double, InstructionSet, Job, Mask, Real, UInt, V3};

/// Columns of places, normals and random numbers; directions for rays that escape.
struct Questions {
    from: [Vec<f64>; 3],
    normal: [Vec<f32>; 3],
    direction: [Vec<f32>; 3],
    u: [Vec<f32>; 4],
}

const COUNT: usize = 4096;
const ROUNDS: usize = 200;

fn questions() -> Questions {
    let mut random = RandomStream::new(7);
    let mut column = |scale: f64, shift: f64| -> Vec<f64> {
        (0..COUNT).map(|_| scale * random.next_f64() + shift).collect()
    };
    let from = [column(8.0, -4.0), column(8.0, -4.0), column(1.0, -3.0)];
    let directions = [column(2.0, -1.0), column(2.0, -1.0), column(2.0, -1.0)];
    let u = [(); 4].map(|()| column(1.0, 0.0).iter().map(|&x| (x as f32).min(0.999_999)).collect());
    let mut direction = [(); 3].map(|()| Vec::new());
    let [x, y, z] = &directions;
    for ((&x, &y), &z) in x.iter().zip(y).zip(z) {
        let unit = DVec3::new(x, y, z).normalize().as_vec3().to_array();
        (0..3).for_each(|k| direction[k].push(unit[k]));
    }
    let normal = [0.0, 0.0, 1.0].map(|n| vec![n; COUNT]);
    Questions { from, normal, direction, u }
}

enum Work {
    Sample,
    /// Of triangles up to this one, one less than a power of two.
    Density {
        last: u32,
    },
    Escape,
}

struct Lanes<'a>(&'a Scene, &'a Questions, Work);

impl Job for Lanes<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<R: Real>(self) -> f32 {
        let Self(scene, q, work) = self;
        let lights = scene.lane_lights();
        let mut sum = R::zero();
        let mut at = 0;
        while at < COUNT {
            let from = V3::new(
                R::Double::from_slice(&q.from[0][at..]),
                R::Double::from_slice(&q.from[1][at..]),
                R::Double::from_slice(&q.from[2][at..]),
            );
            let normal = V3::new(
                R::from_slice(&q.normal[0][at..]),
                R::from_slice(&q.normal[1][at..]),
                R::from_slice(&q.normal[2][at..]),
            );
            let receiver = Receiver::<R> { from, normal, time: None };
            let active = R::Mask::splat(true);
            match work {
                Work::Sample => {
                    let u = [
                        R::from_slice(&q.u[0][at..]),
                        R::from_slice(&q.u[1][at..]),
                        R::from_slice(&q.u[2][at..]),
                        R::from_slice(&q.u[3][at..]),
                    ];
                    let sample = lights.sample(active, &receiver, u, Sampling::Mis);
                    sum = sum + (sample.pdf + sample.radiance.x + sample.towards.x).or_zero(sample.valid);
                }
                Work::Density { last } => {
                    // Some triangle or other: what it costs does not depend on the place of the point.
                    let index = R::UInt::lane_indices() + R::UInt::splat(at as u32);
                    let primitive = (index * R::UInt::splat(97)) & R::UInt::splat(last);
                    let zero = R::UInt::splat(0);
                    let up = V3::new(R::Double::splat(0.3), R::Double::splat(0.2), R::Double::splat(4.0));
                    sum = sum + lights.pdf(active, &receiver, zero, primitive, from + up);
                }
                Work::Escape => {
                    let direction = V3::new(
                        R::from_slice(&q.direction[0][at..]),
                        R::from_slice(&q.direction[1][at..]),
                        R::from_slice(&q.direction[2][at..]),
                    );
                    let (radiance, pdf) = lights.escaped(0, active, &receiver, direction);
                    sum = sum + radiance.x + pdf;
                }
            }
            at += R::LANES;
        }
        sum.to_lanes()[0]
    }
}

/// The least time of several rounds, in nanoseconds a question.
fn time(mut work: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        work();
        least = least.min(start.elapsed().as_secs_f64());
    }
    least * 1e9 / COUNT as f64
}

fn lamps(count: u32) -> Scene {
    let mut random = RandomStream::new(5);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..count {
        let mut x = || 2.0 * random.next_f32() - 1.0;
        let at = Vec3::new(5.0 * x(), 5.0 * x(), 3.0 + x());
        positions.extend([at, at + 0.1 * Vec3::Y, at + Vec3::new(0.1, 0.1, 0.0), at + 0.1 * Vec3::X]);
        triangles.extend([[4 * i, 4 * i + 1, 4 * i + 2], [4 * i + 2, 4 * i + 3, 4 * i]]);
    }
    let mesh = MeshDesc { positions, triangles, ..MeshDesc::default() };
    let light = AreaLightDesc {
        radiance: Rgb::WHITE,
        image: None,
        by_vertices: false,
        two_sided: false,
        power: None,
        spectrum: None,
    };
    let shape = ShapeDesc {
        index: 0,
        geometry: GeometryDesc::Mesh(Arc::new(mesh)),
        world_from_object: Transform::IDENTITY,
        reverse_orientation: false,
        material: Some(MaterialId(0)),
        boundary: None,
        area_light: Some(light),
        alpha: None,
    };
    let material = NamedMaterial { name: None, material: Arc::new(Material::default_diffuse()) };
    Scene::build(SceneDesc { shapes: vec![shape], materials: vec![material], ..SceneDesc::default() })
        .unwrap()
}

fn sky(mapping: EnvironmentMapping) -> Scene {
    let (width, height) = if mapping == EnvironmentMapping::EqualArea { (1024, 1024) } else { (2048, 1024) };
    let mut random = RandomStream::new(4);
    let pixels = (0..width * height).map(|_| Rgb::splat(0.2 + random.next_f32().powi(20))).collect();
    let image = Arc::new(Image::from_pixels(width, height, pixels).unwrap());
    let world_from_light = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap();
    let image = Some(EnvironmentDesc { image, mapping });
    let light = LightDesc::Infinite { world_from_light, radiance: Rgb::WHITE, image };
    Scene::build(SceneDesc { lights: vec![light], ..SceneDesc::default() }).unwrap()
}

fn main() {
    let questions = questions();
    let place = |i: usize| DVec3::from([0, 1, 2].map(|k| questions.from[k][i]));
    let u = |k: usize, i: usize| f64::from(questions.u[k][i]);
    let scenes = [
        ("1 lamp", lamps(1), 1),
        ("10 lamps", lamps(10), 15),
        ("10,000 lamps", lamps(10_000), 16_383),
        ("sky, equal area", sky(EnvironmentMapping::EqualArea), 0),
        ("sky, latitude and longitude", sky(EnvironmentMapping::LatitudeLongitude), 0),
    ];
    for (name, scene, last) in &scenes {
        let scalar = time(|| {
            for i in 0..COUNT {
                black_box(scene.sample_light(place(i), DVec3::Z, 0.0, u(0, i), DVec2::new(u(1, i), u(2, i))));
            }
        });
        println!("{name}: sample: scalar code {scalar:.0} ns");
        for set in InstructionSet::available() {
            let time = |work: &dyn Fn() -> Work| {
                time(|| {
                    black_box(set.run(Lanes(scene, &questions, work())));
                })
            };
            println!("  {:>7}: sample {:.1} ns", set.name(), time(&|| Work::Sample));
            if scene.lane_lights().infinite_count() == 0 {
                println!("  {:>7}: density {:.1} ns", set.name(), time(&|| Work::Density { last: *last }));
            } else {
                println!("  {:>7}: escape {:.1} ns", set.name(), time(&|| Work::Escape));
            }
        }
        if scene.lane_lights().infinite_count() > 0 {
            let scalar = time(|| {
                for i in 0..COUNT {
                    let direction = DVec3::from([0, 1, 2].map(|k| f64::from(questions.direction[k][i])));
                    let ray = Ray::new(place(i), direction);
                    black_box(scene.escaped(&ray, DVec3::Z).next());
                }
            });
            println!("  escape: scalar code {scalar:.0} ns");
        }
    }
}
