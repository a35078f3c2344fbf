//! How many rays a second each shape answers: `cargo run --release -p lumbre-geometry --example shape_speed`.
//!
//! One thread; for each shape the same random rays through a ball about it, and the fastest of many short passes, which
//! a busy machine disturbs least.

use std::hint::black_box;
use std::time::Instant;

use lumbre_geometry::{
    Aabb, BilinearPatch, Capsule, Cone, Csg, Cuboid, Cylinder, Disk, Hyperboloid, Paraboloid, PlacedShape,
    Plane, Quadric, Ray, Roots, Shape, ShapeError, Sphere, Torus, Triangle, WatertightRay, moller_trumbore,
};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec3, Transform};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let turned = Transform::rotate(DVec3::new(1.0, 2.0, -3.0), 40.0)?;
    println!("{:<28} {:>10} {:>10} {:>8}", "million rays a second", "closest", "roots", "hits");
    for shape in shapes()? {
        report(shape.name(), &PlacedShape::new(shape.clone(), Transform::IDENTITY));
        if shape.name() == "sphere" {
            report("sphere, transformed", &PlacedShape::new(shape, turned));
        }
    }
    report_triangle_tests();
    Ok(())
}

/// One of each, in a ball of radius 2 about the origin.
fn shapes() -> Result<Vec<Shape>, ShapeError> {
    let v = DVec3::new;
    let (a, b, c, d) = (v(-1.3, -0.9, 0.4), v(1.4, -0.7, -0.3), v(-1.1, 1.2, -0.5), v(1.2, 1.3, 0.6));
    Ok(vec![
        Sphere::new(v(0.1, 0.0, 0.2), 1.4)?.into(),
        Plane::new(v(0.1, 0.2, 0.3), v(1.0, 2.0, 3.0))?.into(),
        Disk::new(v(0.1, 0.0, 0.2), v(1.0, 2.0, 3.0), 1.6, 0.0)?.into(),
        Cuboid::new(v(-1.0, -1.1, -0.9), v(1.2, 0.8, 1.0))?.into(),
        Cylinder::new(a, d, 0.8, true)?.into(),
        Capsule::new(a, d, 0.7)?.into(),
        Cone::new(a, d, 1.1, 0.4, true)?.into(),
        BilinearPatch::new(a, b, c, d)?.into(),
        Triangle::new(a, b, c)?.into(),
        Torus::new(v(0.1, 0.0, 0.2), v(1.0, 2.0, 3.0), 1.2, 0.4)?.into(),
        Paraboloid::new(1.5, 0.0, 1.2, 360.0)?.into(),
        Hyperboloid::new(v(1.2, 0.5, -1.0), v(0.2, 1.1, 1.1), 360.0)?.into(),
        Quadric::new([1.0, 2.5, 0.75, 0.6, -0.4, 0.3, 0.0, 0.0, 0.0, -1.5], None)?.into(),
        Quadric::new(
            [1.0, -1.4, 0.1, 0.3, 0.0, 0.2, 0.1, 0.0, -1.0, 0.15],
            Some(Aabb { min: v(-1.1, -1.2, -1.3), max: v(1.2, 1.1, 1.3) }),
        )?
        .into(),
        bored_box()?.into(),
    ])
}

/// Five leaves: a box with rounded corners, bored along two axes, and a torus taken away.
fn bored_box() -> Result<Csg, ShapeError> {
    let v = DVec3::new;
    let solid = |shape: Shape| Csg::leaf(PlacedShape::new(shape, Transform::IDENTITY));
    let body = Csg::intersection(vec![
        solid(Cuboid::new(v(-1.0, -1.1, -0.9), v(1.2, 0.8, 1.0))?.into())?,
        solid(Sphere::new(v(0.1, -0.1, 0.1), 1.35)?.into())?,
    ])?;
    Csg::difference(vec![
        body,
        solid(Cylinder::new(v(0.1, 0.0, -3.0), v(0.1, 0.0, 3.0), 0.4, true)?.into())?,
        solid(Cylinder::new(v(-3.0, 0.0, 0.1), v(3.0, 0.0, 0.1), 0.3, true)?.into())?,
        solid(Torus::new(v(0.1, 0.0, 1.0), v(0.0, 0.0, 1.0), 0.8, 0.25)?.into())?,
    ])
}

/// Random rays through the ball of radius 2 about the origin.
fn rays(count: usize) -> Vec<Ray> {
    let mut random = RandomStream::new(7);
    let mut point = || loop {
        let mut x = || 2.0 * random.next_f64() - 1.0;
        let p = DVec3::new(x(), x(), x());
        if p.length() < 1.0 {
            return 2.0 * p;
        }
    };
    (0..count)
        .map(|_| {
            let (from, through) = (point(), point());
            Ray::new(through + 4.0 * (from - through).normalize(), through - from)
        })
        .collect()
}

/// The fastest of some passes over the rays, in millions of rays a second, and what the last pass counted.
fn rate(rays: &[Ray], mut hits: impl FnMut(&Ray) -> usize) -> (f64, usize) {
    let mut best = (0.0_f64, 0);
    for _ in 0..200 {
        let start = Instant::now();
        let count = rays.iter().map(|ray| hits(black_box(ray))).sum();
        let seconds = start.elapsed().as_secs_f64();
        best = (best.0.max(rays.len() as f64 / seconds / 1e6), count);
    }
    best
}

fn report(name: &str, placed: &PlacedShape) {
    let rays = rays(1 << 13);
    let (closest, hits) = rate(&rays, |ray| usize::from(placed.closest(ray).is_some()));
    let (all, _) = rate(&rays, |ray| {
        let mut found = Roots::new();
        placed.roots(ray, &mut found);
        found.len()
    });
    let share = 100.0 * hits as f64 / rays.len() as f64;
    println!("{name:<28} {closest:>10.1} {all:>10.1} {share:>7.1}%");
}

/// The two tests for triangles; one ray against sixteen triangles, for the watertight test prepares its rays.
fn report_triangle_tests() {
    let rays = rays(1 << 11);
    let mut random = RandomStream::new(8);
    let mut point = || {
        let mut x = || 3.0 * random.next_f64() - 1.5;
        DVec3::new(x(), x(), x())
    };
    let triangles: Vec<[DVec3; 3]> = (0..16).map(|_| [point(), point(), point()]).collect();
    let tests = |name: &str, (rate, hits): (f64, usize)| {
        let share = 100.0 * hits as f64 / (rays.len() * triangles.len()) as f64;
        println!("{name:<28} {:>10.1} {:>10} {share:>7.1}%", rate * triangles.len() as f64, "");
    };
    let fast = |ray: &Ray| {
        let hits = |[a, b, c]: &&[DVec3; 3]| {
            moller_trumbore(ray.origin, ray.direction, *a, *b, *c).is_some_and(|hit| ray.contains(hit.t))
        };
        triangles.iter().filter(hits).count()
    };
    let watertight = |ray: &Ray| {
        let sheared = WatertightRay::new(ray.origin, ray.direction);
        let hits = |[a, b, c]: &&[DVec3; 3]| sheared.hit(*a, *b, *c).is_some_and(|hit| ray.contains(hit.t));
        triangles.iter().filter(hits).count()
    };
    tests("test of Moller, Trumbore", rate(&rays, fast));
    tests("test of Woop, Benthin, Wald", rate(&rays, watertight));
}
