//! Nanoseconds per call of what runs for every sample: `cargo bench -p lumbre-math`.

use std::hint::black_box;
use std::time::Instant;

use lumbre_math::distribution::{AliasTable, PiecewiseConstant2D};
use lumbre_math::random::{PixelRandom, RandomStream};
use lumbre_math::sobol::{OwenSobol, ZOrderSobol};
use lumbre_math::{DVec2, Vec2, warp};

/// The best of seven runs, which is the least disturbed.
fn time<T>(name: &str, call: impl Fn(u32) -> T) {
    let calls = 2_000_000;
    let best = (0..7)
        .map(|_| {
            let start = Instant::now();
            for i in 0..calls {
                black_box(call(black_box(i)));
            }
            start.elapsed().as_secs_f64() * 1e9 / f64::from(calls)
        })
        .fold(f64::INFINITY, f64::min);
    println!("{name:<44}{best:8.2} ns");
}

fn main() {
    let random = PixelRandom::new(7, 320, 200).sample(41);
    time("random::SampleRandom::f32", |i| random.f32(i));
    time("random::PixelRandom, from seed to number", |i| PixelRandom::new(7, i, 200).sample(41).f32(2));

    let (own, pixel) = (OwenSobol::new(7), random.key());
    time("sobol::OwenSobol::get_1d", |i| own.get_1d(pixel, i, 3));
    time("sobol::OwenSobol::get_2d", |i| own.get_2d(pixel, i, 3));
    time("sobol::OwenSobol::get::<4>", |i| own.get::<4>(pixel, i, 3));
    let curve = ZOrderSobol::new(7, 1920, 1080, 64);
    time("sobol::ZOrderSobol::get_2d", |i| curve.get_2d(i % 1920, i / 1920, i % 64, 3));

    let point = |i: u32| Vec2::new(i as f32 / 2e6, 0.3);
    time("warp::square_to_cosine_hemisphere", |i| warp::square_to_cosine_hemisphere(point(i)));
    time("warp::equal_area_square_to_sphere", |i| warp::equal_area_square_to_sphere(point(i)));
    let direction = |i: u32| warp::square_to_sphere(point(i));
    time("warp::equal_area_sphere_to_square (+ sphere)", |i| warp::equal_area_sphere_to_square(direction(i)));

    let mut stream = RandomStream::new(3);
    let weights: Vec<f64> = (0..100_000).map(|_| stream.next_f64()).collect();
    let table = AliasTable::new(&weights).expect("there are weights");
    time("distribution::AliasTable::sample, 100,000", |i| table.sample(f64::from(i) / 2e6));

    let start = Instant::now();
    let pixels: Vec<f32> = (0..4096 * 2048).map(|_| stream.next_f32()).collect();
    let made = start.elapsed();
    let picture = PiecewiseConstant2D::new(&pixels, 4096).expect("there are weights");
    println!("PiecewiseConstant2D::new, 4096 × 2048: {:.0} ms", (start.elapsed() - made).as_secs_f64() * 1e3);
    time("distribution::PiecewiseConstant2D::sample", |i| {
        picture
            .sample(DVec2::new(f64::from(i.wrapping_mul(0x9e37_79b9)) / 4_294_967_296.0, f64::from(i) / 2e6))
    });
}
