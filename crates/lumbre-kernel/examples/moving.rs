//! What it costs when things move: `cargo run --release -p lumbre-kernel --example moving [-- THREADS]`.
//!
//! Sixty-four balls, 1.2 million triangles, change places at random, time and again. Each time the tree is refitted,
//! then rebuilt in part, and another is built of the same geometries. Times in milliseconds, and what a ray from among
//! the balls takes in each tree, in nanoseconds: the best of several passes.

use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use lumbre_geometry::Ray;
use lumbre_kernel::{Accel, BuildOptions, Geometry, GeometryKind, TriangleMesh};
use lumbre_math::{DVec3, Vec3};
use rayon::prelude::*;

/// Balls along each axis.
const SIDE: usize = 4;
const BALLS: usize = SIDE * SIDE * SIDE;
/// Of a ball, between its poles and around them.
const STRIPS: u32 = 96;
const AROUND: u32 = 100;
const STEPS: usize = 5;
const RAYS: usize = 100_000;

struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % count
    }

    fn unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / f64::from(1 << 30)
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }
}

type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

fn main() -> Result<()> {
    let threads = match std::env::args().nth(1) {
        Some(argument) => argument.parse().map_err(|_| format!("{argument} is no number of threads"))?,
        None => 1,
    };
    rayon::ThreadPoolBuilder::new().num_threads(threads).build()?.install(measure)
}

fn measure() -> Result<()> {
    let options = BuildOptions::default();
    let mut random = Random(7);
    let rays: Vec<Ray> =
        (0..RAYS).map(|_| Ray::new(random.vector() * (SIDE - 1) as f64, random.vector() - 0.5)).collect();
    let ball = ball();
    let mut places: Vec<usize> = (0..BALLS).collect();
    let mut accel = Accel::build(crowd(&ball, &places), &options)?;
    println!("{} triangles, {} threads", accel.primitive_count(), rayon::current_num_threads());
    println!("{:>9} {:>6}  {:>9} {:>6}  {:>9} {:>6}", "refit", "rays", "partial", "rays", "build", "rays");
    for _ in 0..STEPS {
        for place in 0..BALLS {
            places.swap(place, random.below(BALLS));
        }
        let geometries = crowd(&ball, &places);
        let other = geometries.clone();
        let (refit, result) = timed(|| accel.refit(other));
        result?;
        let refitted = ray_time(&accel, &rays);
        let (partial, _) = timed(|| accel.rebuild_partially(&options));
        let rebuilt = ray_time(&accel, &rays);
        let (build, anew) = timed(|| Accel::build(geometries, &options));
        let built = ray_time(&anew?, &rays);
        println!("{refit:9.1} {refitted:6.0}  {partial:9.1} {rebuilt:6.0}  {build:9.1} {built:6.0}");
    }
    Ok(())
}

/// What it took, in milliseconds, and what came of it.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let result = work();
    (start.elapsed().as_secs_f64() * 1e3, result)
}

/// Nanoseconds that the nearest hit of a ray takes, one after another.
fn ray_time(accel: &Accel, rays: &[Ray]) -> f64 {
    const PASSES: usize = 5;
    let pass = || timed(|| black_box(rays.iter().filter(|ray| accel.closest(ray).is_some()).count())).0;
    let best = (0..PASSES).map(|_| pass()).fold(f64::INFINITY, f64::min);
    best * 1e6 / rays.len() as f64
}

/// A ball that is open at its poles.
fn ball() -> TriangleMesh {
    let vertex = |strip: u32, step: u32| {
        let (polar, azimuth) =
            (PI * f64::from(strip + 2) / f64::from(STRIPS + 4), TAU * f64::from(step) / f64::from(AROUND));
        let around = polar.sin();
        0.3 * DVec3::new(around * azimuth.cos(), polar.cos(), around * azimuth.sin())
    };
    let positions =
        (0..=STRIPS).flat_map(|strip| (0..=AROUND).map(move |step| vertex(strip, step).as_vec3())).collect();
    let mut indices = Vec::new();
    for strip in 0..STRIPS {
        for step in 0..AROUND {
            let first = strip * (AROUND + 1) + step;
            let below = first + AROUND + 1;
            indices.extend([[first, first + 1, below], [first + 1, below + 1, below]]);
        }
    }
    TriangleMesh { origin: DVec3::ZERO, positions, indices }
}

/// The balls, each in a place of its own. Their vertices move, not their meshes' origins, as those of what deforms do.
fn crowd(ball: &TriangleMesh, places: &[usize]) -> Vec<Geometry> {
    let at = |(id, &place): (usize, &usize)| {
        let center = [place % SIDE, place / SIDE % SIDE, place / (SIDE * SIDE)].map(|x| x as f32);
        let positions = ball.positions.iter().map(|&p| p + Vec3::from_array(center)).collect();
        let mesh = TriangleMesh { origin: ball.origin, positions, indices: ball.indices.clone() };
        Geometry { id: id as u32, kind: GeometryKind::Mesh(Arc::new(mesh)) }
    };
    places.par_iter().enumerate().map(at).collect()
}
