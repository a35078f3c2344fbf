//! Asks a scene with rays and points: `cargo run --release --example queries`.

use std::ops::ControlFlow;

use lumbre::geometry::{Capsule, Plane, Sphere};
use lumbre::{DVec3, Ray, SceneBuilder, ShapeBuilder};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ball = Sphere::new(DVec3::new(0.0, 0.0, 2.0), 1.5)?;
    let rod = Capsule::new(DVec3::new(-3.0, 4.0, 2.0), DVec3::new(3.0, 4.0, 2.0), 0.5)?;
    let floor = Plane::new(DVec3::ZERO, DVec3::Z)?;
    let scene = SceneBuilder::new()
        .shape(ShapeBuilder::exact(ball))
        .shape(ShapeBuilder::exact(rod))
        .shape(ShapeBuilder::exact(floor))
        .build()?;

    // The first hit. The direction need not have length 1: t is in units of it.
    let ray = Ray::new(DVec3::new(0.0, -9.0, 2.0), DVec3::new(0.0, 2.0, 0.0));
    let hit = scene.closest(&ray).ok_or("the ray goes to the ball")?;
    println!("shape {} at t {}, {}, normal {}", hit.shape, hit.t, hit.point, hit.normal);

    // Every hit, by t, until it is enough.
    scene.all(&ray, |hit| {
        println!("  t {} {} shape {}", hit.t, if hit.front { "into" } else { "out of" }, hit.shape);
        if hit.t < 6.0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });

    // Many rays at once, over all threads, with the same answers to the bit.
    let fan: Vec<Ray> = (0..1000)
        .map(|i| Ray::new(DVec3::new(0.0, -9.0, 2.0), DVec3::new(f64::from(i) / 500.0 - 1.0, 2.0, 0.0)))
        .collect();
    let hits = scene.closest_batch(&fan).iter().flatten().count();
    println!("{hits} of {} rays hit something", fan.len());

    // What is at a point.
    let point = DVec3::new(0.0, -2.5, 2.0);
    let nearest = scene.closest_point(point, f64::INFINITY)?.ok_or("something is near")?;
    println!("{} away from shape {}, inside: {}", nearest.distance, nearest.shape, scene.is_inside(point));
    Ok(())
}
