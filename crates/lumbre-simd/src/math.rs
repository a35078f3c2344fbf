//! Elementary functions and warps over lanes, with the same bits at every width.
//!
//! Error bounds are against exact results, for the arguments named; an ulp is a unit in the last place of the result.
//! Polynomials interpolate at Chebyshev nodes.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, LOG2_E, PI, SQRT_2};

use crate::{Real, UInt, V3};

/// Sine and cosine of an angle in [−π/4, π/4].
#[inline(always)]
fn sin_cos_octant<R: Real>(angle: R) -> (R, R) {
    let square = angle * angle;
    let sin = horner(square, [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0]);
    let cos = horner(square, [1.0, -0.5, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0]);
    (angle * sin, cos)
}

/// The polynomial in `x` with these coefficients, the constant first.
#[inline(always)]
fn horner<R: Real, const N: usize>(x: R, coefficients: [f32; N]) -> R {
    let mut sum = R::splat(coefficients[N - 1]);
    let mut i = N - 1;
    while i > 0 {
        i -= 1;
        sum = R::splat(coefficients[i]) + x * sum;
    }
    sum
}

/// Sine and cosine of an angle in turns, exact at quarters: each to 1.3e-7. NaN of infinities.
#[inline(always)]
pub fn sin_cos_turns<R: Real>(turns: R) -> (R, R) {
    let quarters = R::splat(4.0) * turns;
    let nearest = quarters.round_ties_even();
    let (sin, cos) = sin_cos_octant((quarters - nearest) * R::splat(FRAC_PI_2));
    let quadrant = nearest.to_int();
    let is_odd = (quadrant & R::UInt::splat(1)).simd_eq(R::UInt::splat(1));
    let (a, b) = (R::select(is_odd, cos, sin), R::select(is_odd, sin, cos));
    let sin_sign = (quadrant & R::UInt::splat(2)).shl::<30>();
    let cos_sign = ((quadrant + R::UInt::splat(1)) & R::UInt::splat(2)).shl::<30>();
    (R::from_bits(a.to_bits() ^ sin_sign), R::from_bits(b.to_bits() ^ cos_sign))
}

/// The angle of the point (x, y) from the x axis, in [−π, π] with the sign of `y`: to 4e-7. As IEEE 754 has it, −0 of
/// `x` is on the negative side; but NaN where both are infinite.
#[inline(always)]
pub fn atan2<R: Real>(y: R, x: R) -> R {
    let (width, height) = (x.abs(), y.abs());
    let is_steep = width.simd_lt(height);
    let short = R::select(is_steep, width, height);
    let long = R::select(is_steep, height, width);
    let t = R::select(long.simd_eq(R::zero()), short, short / long);
    // tan(π/8): above it, the angle from π/4.
    let is_far = t.simd_gt(R::splat(SQRT_2 - 1.0));
    let t = R::select(is_far, (t - R::one()) / (t + R::one()), t);
    let square = t * t;
    let series = horner(square, [-0.333_332_87, 0.199_912_38, -0.140_241_43, 0.085_204_92]);
    let angle = t + t * square * series + R::splat(FRAC_PI_4).or_zero(is_far);
    let angle = R::select(is_steep, R::splat(FRAC_PI_2) - angle, angle);
    let is_behind = R::one().copysign(x).simd_lt(R::zero());
    let angle = R::select(is_behind, R::splat(PI) - angle, angle);
    angle.copysign(y)
}

/// The angle in [0, π] with this cosine: to 6e-7. NaN outside of [−1, 1].
#[inline(always)]
pub fn acos<R: Real>(cosine: R) -> R {
    let sine = ((R::one() - cosine) * (R::one() + cosine)).sqrt();
    atan2(sine, cosine)
}

/// 2 to the power of a whole number in [−126, 127].
#[inline(always)]
fn power_of_two<R: Real>(exponent: R) -> R {
    R::from_bits((exponent.to_int() + R::UInt::splat(127)).shl::<23>())
}

/// e to this power: to 2 ulp. Infinite above 88.73, 0 below −104; results below 2⁻¹²⁶ are denormal.
#[inline(always)]
pub fn exp<R: Real>(x: R) -> R {
    let (least, greatest) = (R::splat(-104.0), R::splat(89.0));
    let x = R::select(x.simd_lt(least), least, x);
    let x = R::select(x.simd_gt(greatest), greatest, x);
    let n = (x * R::splat(LOG2_E)).round_ties_even();
    // ln 2 in two parts; n times the first is exact.
    let r = (x - n * R::splat(0.693_359_4)) - n * R::splat(-2.121_944_4e-4);
    let series = horner(
        r,
        [0.500_000_0, 0.166_666_67, 0.041_666_465, 0.008_333_311, 0.001_393_364_1, 0.000_198_909_8],
    );
    let mantissa = R::one() + (r + r * r * series);
    // In two steps, since n goes to −150 and 128.
    let half = (n * R::splat(0.5)).floor();
    mantissa * power_of_two(half) * power_of_two(n - half)
}

/// The natural logarithm: to 2 ulp. −∞ of 0, NaN of negative numbers.
#[inline(always)]
pub fn ln<R: Real>(x: R) -> R {
    // Denormals, scaled to have all their digits.
    let is_small = x.simd_lt(R::splat(f32::MIN_POSITIVE));
    let scaled = R::select(is_small, x * R::splat(8_388_608.0), x);
    // x = 2ⁿ m with m in [√½, √2): bits from √½ on, so that the exponent falls at the right place.
    let root = R::UInt::splat(std::f32::consts::FRAC_1_SQRT_2.to_bits());
    let above = scaled.to_bits() - root;
    let n = above & R::UInt::splat(0xff80_0000);
    let m = R::from_bits(scaled.to_bits() - n);
    // The bits of n are those of an i32 that is shifted by 23: an exact conversion, and an exact product.
    let n = R::from_int(n) * R::splat(1.0 / 8_388_608.0);
    let n = n - R::select(is_small, R::splat(23.0), R::zero());
    let f = m - R::one();
    let square = f * f;
    let series = horner(
        f,
        [
            0.333_333_31,
            -0.249_999_97,
            0.200_007_16,
            -0.166_678_02,
            0.142_490_58,
            -0.124_256_87,
            0.116_854_2,
            -0.114_797_34,
            0.069_716_11,
        ],
    );
    let tail = f * square * series + n * R::splat(-2.121_944_4e-4) - R::splat(0.5) * square;
    let result = (f + tail) + n * R::splat(0.693_359_4);
    let result = R::select(x.simd_lt(R::splat(f32::INFINITY)), result, x);
    let result = R::select(x.simd_eq(R::zero()), R::splat(f32::NEG_INFINITY), result);
    R::select(x.simd_lt(R::zero()), R::splat(f32::NAN), result)
}

/// x ≥ 0 to a finite power: with a relative error of (2 + 3 |y ln x|) · 2⁻²³. 1 for y = 0, also where x = 0.
#[inline(always)]
pub fn pow<R: Real>(x: R, y: R) -> R {
    R::select(y.simd_eq(R::zero()), R::one(), exp(y * ln(x)))
}

/// Two unit vectors that complete the unit vector `n` to a right-handed frame, `e1 × e2 = n`.
///
/// Source: Duff, Burgess, Christensen, Hery, Kensler, Liani, Villemin, "Building an Orthonormal Basis, Revisited", JCGT
/// 6(1), 2017.
#[inline(always)]
pub fn orthonormal_basis<R: Real>(n: V3<R>) -> (V3<R>, V3<R>) {
    let sign = R::one().copysign(n.z);
    let a = -(sign + n.z).recip();
    let b = n.x * n.y * a;
    let e1 = V3::new(R::one() + sign * n.x * n.x * a, sign * b, -(sign * n.x));
    let e2 = V3::new(b, sign + n.y * n.y * a, -n.y);
    (e1, e2)
}

/// Maps the unit square to the unit disk, preserving area with little distortion.
///
/// Source: Shirley, Chiu, "A Low Distortion Map Between Disk and Square", Journal of Graphics Tools 2(3), 1997.
#[inline(always)]
pub fn square_to_disk<R: Real>(u: [R; 2]) -> [R; 2] {
    let x = R::splat(2.0) * u[0] - R::one();
    let y = R::splat(2.0) * u[1] - R::one();
    let is_wide = y.abs().simd_lt(x.abs());
    // The angle is measured from the nearer axis, so that it is exact there.
    let radius = R::select(is_wide, x, y);
    let ratio = R::select(is_wide, y, x) / radius;
    let (sin, cos) = sin_cos_octant(ratio.or_zero(radius.simd_ne(R::zero())) * R::splat(FRAC_PI_4));
    [radius * R::select(is_wide, cos, sin), radius * R::select(is_wide, sin, cos)]
}

/// A direction of the upper hemisphere with density cos θ/π: the disk, projected up.
#[inline(always)]
pub fn cosine_hemisphere<R: Real>(u: [R; 2]) -> V3<R> {
    let [x, y] = square_to_disk(u);
    let z = (R::one() - (x * x + y * y)).simd_max(R::zero()).sqrt();
    V3::new(x, y, z)
}

#[cfg(test)]
#[path = "math_tests.rs"]
mod tests;
