//! How many rays a second: `cargo run --release -p lumbre-kernel --example kernel_speed [-- [--quick] [NAME]]`, where
//! NAME is a part of a scene's name.
//!
//! Scenes: a room, alone and with a sphere and an instance in it, bumpy spheres of triangles, a field of spheres, the
//! field of mixed shapes on a plane, and an instanced field. Rays: primary (of a pinhole camera, in squares of four by
//! four pixels), bounce (from the primary hits, at random), shadow (from the primary hits to a light). Each figure is
//! the best of several passes, in millions of rays a second: of single rays by one thread and by two; in batches; as
//! rays of a picture, 4096 at a time; and these by double precision.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use lumbre_geometry::{Cone, Cuboid, Cylinder, PlacedShape, Plane, Ray, Shape, Sphere, Torus, Triangle};
use lumbre_kernel::{Accel, BuildOptions, Geometry, GeometryKind, HitColumns, RayColumns, TriangleMesh};
use lumbre_math::{DVec3, Transform};

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if v.length_squared() <= 1.0 && v.length_squared() > 1e-6 {
                return v.normalize();
            }
        }
    }
}

fn main() {
    let is_quick = std::env::args().any(|argument| argument == "--quick");
    println!(
        "{:<22} {:>9} {:>7} {:>8} {:>6}  {:<8} {:>9} {:>7} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7}",
        "scene",
        "prims",
        "build",
        "Mprim/s",
        "B/prim",
        "rays",
        "closest×1",
        "any×1",
        "closest×2",
        "any×2",
        "batch",
        "any",
        "picture",
        "any",
        "exact",
        "any"
    );
    let mut scenes: Vec<(&str, Vec<GeometryKind>)> = vec![
        ("room", vec![room()]),
        ("room with things", room_with_things()),
        ("mesh 100k", vec![mesh(224)]),
        ("mixed field 625", field(25, mixed)),
        ("sphere field 625", field(25, sphere)),
        ("sphere field 40k", field(200, sphere)),
        ("instances 10k × 100k", instances(100)),
    ];
    if !is_quick {
        scenes.insert(1, ("mesh 1M", vec![mesh(708)]));
    }
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with("--")).unwrap_or_default();
    for (name, kinds) in scenes.into_iter().filter(|(name, _)| name.contains(&wanted)) {
        measure(name, kinds, if is_quick { 1 } else { 5 });
    }
}

fn measure(name: &str, kinds: Vec<GeometryKind>, passes: usize) {
    let geometries = || {
        let geometry = |(i, kind): (usize, &GeometryKind)| Geometry { id: i as u32, kind: kind.clone() };
        kinds.iter().enumerate().map(geometry).collect::<Vec<_>>()
    };
    let mut seconds = f64::INFINITY;
    let mut accel = None;
    for _ in 0..passes.min(3) {
        let geometries = geometries();
        let start = Instant::now();
        accel = Some(Accel::build(geometries, &BuildOptions::default()).expect("a sound scene"));
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let accel = accel.expect("at least one pass");
    let count = accel.primitive_count();
    let primary = primary_rays(512);
    let mut random = Random(9);
    let light = DVec3::new(30.0, 40.0, 20.0);
    let (mut bounce, mut shadow) = (Vec::new(), Vec::new());
    for ray in &primary {
        let Some(hit) = accel.closest(ray) else { continue };
        let surface = accel.surface(ray, &hit);
        let out = random.direction();
        let normal = if surface.normal.dot(ray.direction) < 0.0 { surface.normal } else { -surface.normal };
        let out = if out.dot(normal) < 0.0 { -out } else { out };
        let from = surface.point + 1e-6 * normal;
        bounce.push(Ray::new(from, out));
        shadow.push(Ray::new(from, light - from).with_range(0.0, 1.0));
    }
    for (i, (work, rays)) in
        [("primary", &primary), ("bounce", &bounce), ("shadow", &shadow)].iter().enumerate()
    {
        let closest = |ray: &Ray| {
            black_box(accel.closest(ray));
        };
        let any = |ray: &Ray| {
            black_box(accel.any(ray));
        };
        let figures =
            [1, 2].map(|threads| (speed(rays, threads, passes, closest), speed(rays, threads, passes, any)));
        let many = speeds_of_many(&accel, rays, passes);
        let head = if i == 0 {
            let bytes = accel.memory_bytes() as f64 / count as f64;
            format!(
                "{name:<22} {count:>9} {seconds:>6.3}s {:>8.2} {bytes:>6.0}",
                count as f64 / seconds / 1e6
            )
        } else {
            format!("{:<56}", "")
        };
        println!(
            "{head}  {work:<8} {:>9.2} {:>7.2} {:>9.2} {:>7.2}{}",
            figures[0].0,
            figures[0].1,
            figures[1].0,
            figures[1].1,
            many.map(|figure| format!(" {figure:>7.2}")).concat()
        );
    }
}

/// Millions of rays a second, the best of some passes.
fn speed(rays: &[Ray], threads: usize, passes: usize, query: impl Fn(&Ray) + Sync) -> f64 {
    let best = (0..passes)
        .map(|_| {
            let start = Instant::now();
            std::thread::scope(|scope| {
                for part in rays.chunks(rays.len().div_ceil(threads).max(1)) {
                    let query = &query;
                    scope.spawn(move || part.iter().for_each(query));
                }
            });
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min);
    rays.len() as f64 / best / 1e6
}

/// Millions of rays a second in batches, as rays of a picture, and as those in double precision; closest hits, then
/// any.
fn speeds_of_many(accel: &Accel, rays: &[Ray], passes: usize) -> [f64; 6] {
    const WAVE: usize = 4096;
    let origin = [0, 1, 2].map(|axis| rays.iter().map(|ray| ray.origin[axis]).collect::<Vec<_>>());
    let direction =
        [0, 1, 2].map(|axis| rays.iter().map(|ray| ray.direction[axis] as f32).collect::<Vec<_>>());
    let t_max: Vec<f32> = rays.iter().map(|ray| ray.t_max as f32).collect();
    let (mut hits, mut are_hit) = (vec![None; WAVE], vec![false; WAVE]);
    let (mut columns, mut occluded) = (HitColumns::default(), Vec::new());
    let mut wave = |figure: usize, first: usize| {
        let range = first..rays.len().min(first + WAVE);
        let len = range.len();
        let wave = RayColumns {
            origin: [0, 1, 2].map(|axis| &origin[axis][range.clone()]),
            direction: [0, 1, 2].map(|axis| &direction[axis][range.clone()]),
            t_max: Some(&t_max[range.clone()]),
            time: None,
        };
        match figure {
            0 => accel.closest_batch(&rays[range], &mut hits[..len]),
            1 => accel.any_batch(&rays[range], &mut are_hit[..len]),
            2 | 4 => accel.closest_columns(&wave, figure == 4, &mut columns),
            _ => accel.any_columns(&wave, figure == 5, &mut occluded),
        }
    };
    [0, 1, 2, 3, 4, 5].map(|figure| {
        let mut best = f64::INFINITY;
        for _ in 0..passes {
            let start = Instant::now();
            (0..rays.len()).step_by(WAVE).for_each(|first| wave(figure, first));
            best = best.min(start.elapsed().as_secs_f64());
        }
        rays.len() as f64 / best / 1e6
    })
}

fn primary_rays(size: usize) -> Vec<Ray> {
    let eye = DVec3::new(9.0, 7.0, 14.0);
    let forward = (DVec3::new(0.0, 0.5, 0.0) - eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let pixel = |i: usize| (i as f64 + 0.5) / size as f64 * 2.0 - 1.0;
    let ray = |i: usize| {
        let (square, inside) = (i / 16, i % 16);
        let (x, y) = (square % (size / 4) * 4 + inside % 4, square / (size / 4) * 4 + inside / 4);
        Ray::new(eye, forward + 0.5 * (pixel(x) * right - pixel(y) * up))
    };
    (0..size * size).map(ray).collect()
}

/// A bumpy sphere of 2 n² triangles, radius about 6.
fn mesh(n: u32) -> GeometryKind {
    let at = |i: u32, j: u32| (i % n) * (n + 1) + j;
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..n {
        for j in 0..=n {
            let azimuth = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            let polar = std::f64::consts::PI * f64::from(j) / f64::from(n);
            let radius = 5.5
                + 0.5 * (9.0 * azimuth).sin() * (11.0 * polar).sin()
                + 0.1 * (53.0 * azimuth + 71.0 * polar).sin();
            let point =
                DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin()) * radius;
            positions.push(point.as_vec3());
            if j < n {
                indices.extend([
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                    [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                ]);
            }
        }
    }
    GeometryKind::Mesh(Arc::new(TriangleMesh { origin: DVec3::ZERO, positions, indices }))
}

/// A closed room with two boxes in it, around the camera.
fn room() -> GeometryKind {
    let mut mesh = TriangleMesh::default();
    let boxes = [
        (DVec3::new(-8.0, -0.5, -8.0), DVec3::new(16.0, 12.0, 16.0)),
        (DVec3::new(-4.0, -0.5, -3.0), DVec3::new(-0.5, 6.0, 1.0)),
        (DVec3::new(1.0, -0.5, -1.0), DVec3::new(4.0, 2.5, 3.0)),
    ];
    for (low, high) in boxes {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend((0..8).map(|i| {
            let at = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
            DVec3::new(at(0), at(1), at(2)).as_vec3()
        }));
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        for [a, b, c, d] in quads.map(|quad| quad.map(|corner| first + corner)) {
            mesh.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    GeometryKind::Mesh(Arc::new(mesh))
}

/// The room, with a sphere, a torus and an instance of a mesh in it.
fn room_with_things() -> Vec<GeometryKind> {
    let sphere = Sphere::new(DVec3::new(2.5, 4.0, 1.0), 1.5).expect("a radius");
    let torus = Torus::new(DVec3::new(5.0, 1.0, 5.0), DVec3::Y, 1.2, 0.4).expect("two radii");
    let ball = vec![Geometry { id: 3, kind: mesh(60) }];
    let accel = Arc::new(Accel::build(ball, &BuildOptions::default()).expect("a sound mesh"));
    let place = Transform::translate(DVec3::new(-2.0, 8.0, 0.0))
        * Transform::scale(DVec3::splat(0.3)).expect("a size");
    vec![
        room(),
        GeometryKind::Shape(PlacedShape::new(sphere.into(), Transform::IDENTITY)),
        GeometryKind::Shape(PlacedShape::new(torus.into(), Transform::IDENTITY)),
        GeometryKind::Instance(accel.instance(place)),
    ]
}

/// Things on a square of 18, in rows, and the ground under them.
fn field(n: usize, make: impl Fn(&mut Random, usize, Transform) -> PlacedShape) -> Vec<GeometryKind> {
    let mut random = Random(4);
    let step = 18.0 / n as f64;
    let mut kinds = Vec::new();
    for i in 0..n * n {
        let center =
            DVec3::new(((i % n) as f64 + 0.5) * step - 9.0, 0.4 * step, ((i / n) as f64 + 0.5) * step - 9.0);
        let place =
            Transform::translate(center) * Transform::scale(DVec3::splat(0.4 * step)).expect("not flat");
        kinds.push(GeometryKind::Shape(make(&mut random, i, place)));
    }
    let ground = Plane::new(DVec3::ZERO, DVec3::Y).expect("a normal");
    kinds.push(GeometryKind::Shape(PlacedShape::new(ground.into(), Transform::IDENTITY)));
    kinds
}

fn ground() -> GeometryKind {
    let positions = [(-40.0, -40.0), (-40.0, 40.0), (40.0, 40.0), (40.0, -40.0)]
        .map(|(x, z)| DVec3::new(x, 0.0, z).as_vec3())
        .to_vec();
    let indices = vec![[0, 1, 2], [0, 2, 3]];
    GeometryKind::Mesh(Arc::new(TriangleMesh { origin: DVec3::ZERO, positions, indices }))
}

fn sphere(random: &mut Random, _: usize, place: Transform) -> PlacedShape {
    let size = 0.5 + 0.5 * random.unit();
    // In world space: no ray is moved for it.
    let radius = size * place.vector(DVec3::X).x;
    PlacedShape::new(
        Sphere::new(place.point(DVec3::ZERO), radius).expect("a radius").into(),
        Transform::IDENTITY,
    )
}

fn mixed(random: &mut Random, i: usize, place: Transform) -> PlacedShape {
    let turn = Transform::rotate(random.direction(), 360.0 * random.unit()).expect("an axis");
    let (low, high) = (DVec3::new(0.0, -0.8, 0.0), DVec3::new(0.0, 0.8, 0.0));
    let shape: Shape = match i % 6 {
        0 => return sphere(random, i, place),
        1 => Cuboid::new(DVec3::splat(-0.6), DVec3::new(0.6, 0.5, 0.7)).expect("a size").into(),
        2 => Cylinder::new(low, high, 0.5, true).expect("a radius").into(),
        3 => Cone::new(low, high, 0.7, 0.0, true).expect("a radius").into(),
        4 => Torus::new(DVec3::ZERO, DVec3::Y, 0.7, 0.25).expect("two radii").into(),
        _ => {
            Triangle::new(DVec3::new(-0.9, -0.5, 0.1), DVec3::new(0.9, -0.6, 0.0), DVec3::new(0.1, 0.9, -0.2))
                .expect("three corners")
                .into()
        }
    };
    PlacedShape::new(shape, place * turn)
}

/// n² copies of a mesh in a field.
fn instances(n: usize) -> Vec<GeometryKind> {
    let ball = vec![Geometry { id: 3, kind: mesh(224) }];
    let accel = Arc::new(Accel::build(ball, &BuildOptions::default()).expect("a sound mesh"));
    let mut random = Random(6);
    let step = 18.0 / n as f64;
    let mut kinds: Vec<GeometryKind> = (0..n * n)
        .map(|i| {
            let center = DVec3::new(
                ((i % n) as f64 + 0.5) * step - 9.0,
                0.4 * step,
                ((i / n) as f64 + 0.5) * step - 9.0,
            );
            let world_from_object = Transform::translate(center)
                * Transform::rotate(random.direction(), 360.0 * random.unit()).expect("an axis")
                * Transform::scale(DVec3::splat(0.07 * step)).expect("not flat");
            GeometryKind::Instance(accel.instance(world_from_object))
        })
        .collect();
    kinds.push(ground());
    kinds
}
