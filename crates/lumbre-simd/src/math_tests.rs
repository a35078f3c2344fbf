//! Elementary functions against those of double precision.

use super::*;

/// Numbers spread over [low, high].
fn spread(low: f64, high: f64) -> impl Iterator<Item = f32> {
    (0..=200_000).map(move |i| (low + (high - low) * f64::from(i) / 200_000.0) as f32)
}

/// How far an answer is from the exact one, in units of its last place.
fn ulps(answer: f32, exact: f64) -> f64 {
    let nearest = exact as f32;
    let ulp = f64::from(nearest.abs().next_up()) - f64::from(nearest.abs());
    (f64::from(answer) - exact).abs() / ulp
}

#[test]
fn sines_and_cosines_are_near_and_exact_at_quarters() {
    for turns in spread(-3.0, 3.0) {
        let (sin, cos) = sin_cos_turns(turns);
        let angle = f64::from(turns) * std::f64::consts::TAU;
        assert!((f64::from(sin) - angle.sin()).abs() < 1.3e-7, "{turns}: {sin}");
        assert!((f64::from(cos) - angle.cos()).abs() < 1.3e-7, "{turns}: {cos}");
    }
    for (turns, expected) in
        [(0.0, (0.0, 1.0)), (0.25, (1.0, 0.0)), (0.5, (0.0, -1.0)), (-0.25, (-1.0, 0.0)), (7.75, (-1.0, 0.0))]
    {
        assert_eq!(sin_cos_turns(turns), expected, "{turns}");
    }
    assert!(sin_cos_turns(f32::INFINITY).0.is_nan() && sin_cos_turns(f32::NAN).1.is_nan());
}

#[test]
fn the_angle_of_a_point_is_near_and_exact_on_axes() {
    for turns in spread(-0.5, 0.5) {
        let (sin, cos) = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
        for size in [1e-30, 0.7, 1e20] {
            let (y, x) = ((size * sin) as f32, (size * cos) as f32);
            let error = f64::from(atan2(y, x)) - f64::from(y).atan2(f64::from(x));
            assert!(error.abs() < 4e-7, "{y} {x}: {}", atan2(y, x));
        }
    }
    for y in [-0.0, 0.0, -2.5, 2.5, f32::INFINITY] {
        for x in [-0.0, 0.0, -3.5, 3.5] {
            let error = f64::from(atan2(y, x)) - f64::from(y).atan2(f64::from(x));
            assert!(error.abs() < 4e-7, "{y} {x}: {}", atan2(y, x));
            assert_eq!(atan2(y, x).is_sign_negative(), y.is_sign_negative());
        }
    }
    for (y, x) in [(f32::NAN, 0.0), (f32::NAN, 1.0), (0.0, f32::NAN), (1.0, f32::NAN)] {
        assert!(atan2(y, x).is_nan(), "{y} {x}");
    }
}

#[test]
fn the_angle_of_a_cosine_is_near() {
    for cosine in spread(-1.0, 1.0) {
        assert!((f64::from(acos(cosine)) - f64::from(cosine).acos()).abs() < 6e-7, "{cosine}");
    }
    assert!(acos(1.0 + f32::EPSILON).is_nan());
}

#[test]
fn exponentials_are_within_two_ulps() {
    let mut worst = 0.0_f64;
    for x in spread(-87.0, 88.7).chain(spread(-1.0, 1.0)) {
        worst = worst.max(ulps(exp(x), f64::from(x).exp()));
    }
    assert!(worst < 2.0, "{worst}");
    // In denormals the last place is worth more.
    for x in spread(-103.9, -87.0) {
        assert!((f64::from(exp(x)) - f64::from(x).exp()).abs() < 3e-45 + 3e-7 * f64::from(x).exp(), "{x}");
    }
    assert_eq!(exp(0.0), 1.0);
    assert_eq!(exp(-0.0), 1.0);
    assert_eq!(
        [exp(89.0), exp(f32::INFINITY), exp(-105.0), exp(f32::NEG_INFINITY)],
        [f32::INFINITY, f32::INFINITY, 0.0, 0.0]
    );
    assert!(exp(f32::NAN).is_nan());
}

#[test]
fn logarithms_are_within_two_ulps() {
    let mut worst = 0.0_f64;
    let mut x = f32::from_bits(1);
    while x < f32::MAX / 1.1 {
        worst = worst.max(ulps(ln(x), f64::from(x).ln()));
        x = (x * 1.000_37).max(x.next_up());
    }
    for x in spread(0.9, 1.1) {
        worst = worst.max(if x == 1.0 { f64::from(ln(x)) } else { ulps(ln(x), f64::from(x).ln()) });
    }
    assert!(worst < 2.0, "{worst}");
    assert_eq!(
        [ln(1.0), ln(0.0), ln(-0.0), ln(f32::INFINITY)],
        [0.0, f32::NEG_INFINITY, f32::NEG_INFINITY, f32::INFINITY]
    );
    assert!(ln(-1.0).is_nan() && ln(f32::NEG_INFINITY).is_nan() && ln(f32::NAN).is_nan());
}

#[test]
fn powers_keep_their_bound() {
    for x in [1e-20_f32, 0.02, 0.5, 0.999, 1.0, 3.0, 1e10] {
        for y in spread(-8.0, 8.0).step_by(97) {
            let exact = f64::from(x).powf(f64::from(y));
            if (1e-37..1e38).contains(&exact) {
                let bound = (2.0 + 3.0 * exact.ln().abs()) / 8_388_608.0;
                assert!((f64::from(pow(x, y)) - exact).abs() < bound * exact, "{x} {y}: {}", pow(x, y));
            }
        }
    }
    assert_eq!([pow(0.0, 0.0), pow(0.0, 2.0), pow(0.0, -2.0), pow(1.0, 7.5)], [1.0, 0.0, f32::INFINITY, 1.0]);
}

#[test]
fn a_basis_is_orthonormal_and_right_handed() {
    for turns in spread(0.0, 1.0).step_by(53) {
        let (sin, cos) = sin_cos_turns(turns * 37.0);
        let z = 2.0 * turns - 1.0;
        let radius = (1.0 - z * z).sqrt();
        let n = V3::new(radius * cos, radius * sin, z);
        let (e1, e2) = orthonormal_basis(n);
        assert!((e1.cross(e2) - n).length() < 1e-6, "{n:?}");
        assert!(e1.dot(n).abs() < 1e-6 && (e1.length() - 1.0).abs() < 1e-6, "{n:?}");
    }
    assert_eq!(orthonormal_basis(V3::new(0.0, 0.0, 1.0)).0, V3::new(1.0, 0.0, 0.0));
}

#[test]
fn the_square_becomes_the_disk_and_the_hemisphere() {
    let mut inside = 0;
    for i in 0..100 {
        for j in 0..100 {
            let u = [(i as f32 + 0.5) / 100.0, (j as f32 + 0.5) / 100.0];
            let [x, y] = square_to_disk(u);
            // Squares about the middle become circles.
            let side = (2.0 * u[0] - 1.0).abs().max((2.0 * u[1] - 1.0).abs());
            assert!((x.hypot(y) - side).abs() < 3e-7, "{u:?}");
            inside += usize::from(x.hypot(y) < 0.5);
            let w = cosine_hemisphere(u);
            assert!((w.length() - 1.0).abs() < 1e-6 && w.z >= 0.0, "{u:?}");
        }
    }
    assert_eq!(inside, 2500, "areas are preserved");
    assert_eq!(square_to_disk([0.5, 0.5]), [0.0, 0.0]);
    assert_eq!(square_to_disk([1.0, 0.5]), [1.0, 0.0]);
    assert_eq!(square_to_disk([0.5, 0.0]), [0.0, -1.0]);
}
