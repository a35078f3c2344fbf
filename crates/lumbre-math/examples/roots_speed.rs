//! Our polynomial roots against the crate polycool: nanoseconds a polynomial, and roots found in all.
//!
//! `cargo run --release -p lumbre-math --example roots_speed`

use std::hint::black_box;
use std::time::Instant;

use lumbre_math::random::RandomStream;
use lumbre_math::roots::{quartic_roots_between, roots_between};
use polycool::Poly;

const COUNT: usize = 100_000;
/// polycool stops at this error in x; ours goes to the last digits.
const ACCURACY: f64 = 1e-14;

fn main() {
    println!("{:<32}{:>10}{:>12}{:>12}{:>12}", "in [-1, 1]", "ours", "polycool", "our roots", "its roots");
    macro_rules! compare {
        ($name:literal, $polynomials:expr, $ours:expr) => {{
            let polynomials = $polynomials;
            let ours = best_of(&polynomials, |c| $ours(c, -1.0, 1.0).len());
            let theirs = best_of(&polynomials, |c| Poly::new(*c).roots_between(-1.0, 1.0, ACCURACY).len());
            println!("{:<32}{:>7.1} ns{:>9.1} ns{:>12}{:>12}", $name, ours.0, theirs.0, ours.1, theirs.1);
        }};
    }
    compare!("cubics, random", random::<4>(), roots_between);
    compare!("cubics of three real roots", of_real_roots::<4>(), roots_between);
    compare!("quartics, random", random::<5>(), quartic_roots_between);
    compare!("quartics of four real roots", of_real_roots::<5>(), quartic_roots_between);
    compare!("the same by the general route", of_real_roots::<5>(), roots_between);
    compare!("quintics, random", random::<6>(), roots_between);
    compare!("quintics of five real roots", of_real_roots::<6>(), roots_between);
    compare!("octics, random", random::<9>(), roots_between);
    compare!("octics of eight real roots", of_real_roots::<9>(), roots_between);
}

/// The best of seven runs: nanoseconds a polynomial, and the sum of what `count` returns.
fn best_of<const N: usize>(polynomials: &[[f64; N]], count: impl Fn(&[f64; N]) -> usize) -> (f64, usize) {
    let mut best = f64::INFINITY;
    let mut total = 0;
    for _ in 0..7 {
        let start = Instant::now();
        total = polynomials.iter().map(|c| count(black_box(c))).sum();
        best = best.min(start.elapsed().as_secs_f64());
    }
    (best * 1e9 / polynomials.len() as f64, total)
}

/// Coefficients uniform in [-1, 1).
fn random<const N: usize>() -> Vec<[f64; N]> {
    let mut random = RandomStream::new(2);
    (0..COUNT).map(|_| std::array::from_fn(|_| 2.0 * random.next_f64() - 1.0)).collect()
}

/// Products of N - 1 factors (x - r) with r uniform in [-1, 1).
fn of_real_roots<const N: usize>() -> Vec<[f64; N]> {
    let mut random = RandomStream::new(3);
    let mut product = || {
        let mut c = [0.0; N];
        c[0] = 1.0;
        for degree in 0..N - 1 {
            let root = 2.0 * random.next_f64() - 1.0;
            for k in (0..=degree).rev() {
                c[k + 1] += c[k];
                c[k] *= -root;
            }
        }
        c
    };
    (0..COUNT).map(|_| product()).collect()
}
