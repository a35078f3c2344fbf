//! How long a tree of many hairs takes to build, what it weighs, and how many rays a second it answers.
//!
//! `cargo run --release -p lumbre --example curve_speed -- 1000000 1`: the number of hairs, and how often each segment
//! is halved.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "an example may")]

use std::sync::Arc;
use std::time::Instant;

use lumbre::DVec3;
use lumbre::geometry::{CurveBasis, CurveKind, Curves, Ray, Strand};
use lumbre::kernel::{Accel, BuildOptions, Geometry, GeometryKind};
use lumbre::math::random::RandomStream;

fn vector(random: &mut RandomStream) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f64() - 1.0))
}

/// The memory of this process in MiB.
fn resident() -> f64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = text.split(' ').nth(1).and_then(|word| word.parse::<f64>().ok()).unwrap_or(0.0);
    pages * 4096.0 / f64::from(1 << 20)
}

fn main() {
    let mut words = std::env::args().skip(1);
    let count: usize = words.next().map_or(100_000, |word| word.parse().unwrap());
    let splits: u32 = words.next().map_or(1, |word| word.parse().unwrap());
    let mut random = RandomStream::new(11);
    // Fur on a ball, each hair of two segments, bent over.
    let mut curves = Curves::new(CurveKind::Flat);
    for _ in 0..count {
        let up = vector(&mut random).normalize();
        let (aside, bend) = (0.05 * vector(&mut random), 0.15 * vector(&mut random));
        let at = |t: f64| up * (1.0 + 0.25 * t) + aside * t + bend * t * t;
        let points: Vec<DVec3> = (0..5).map(|k| at(f64::from(k) / 4.0 - 0.1)).collect();
        curves.push(&Strand::new(CurveBasis::BSpline, 3, &points, [6e-4, 2e-4]).unwrap()).unwrap();
    }
    let curves = curves.with_splits(splits);
    let own = curves.bytes() as f64 / count as f64;
    let before = resident();
    let start = Instant::now();
    let geometry = Geometry { id: 0, kind: GeometryKind::Custom(Arc::new(curves)) };
    let accel = Accel::build(vec![geometry], &BuildOptions::default()).unwrap();
    let built = start.elapsed().as_secs_f64();
    println!(
        "{count} hairs of 2 segments: {own:.0} bytes each, and the tree {:.0}",
        (resident() - before) * f64::from(1 << 20) / count as f64
    );
    println!("built in {built:.2} s");
    let rays: Vec<Ray> = (0..200_000)
        .map(|_| {
            let from = 3.0 * vector(&mut random).normalize();
            Ray::new(from, (1.1 * vector(&mut random) - from).normalize())
        })
        .collect();
    let start = Instant::now();
    let hits = rays.iter().filter(|ray| accel.closest(ray).is_some()).count();
    let took = start.elapsed().as_secs_f64();
    println!("{:.0} rays a second on one thread; {hits} of {} hit", rays.len() as f64 / took, rays.len());
}
