//! Accurate products, angles and projections of vectors.
//!
//! glam has the plain formulas: `a.dot(b)`, `a.cross(b)`, `a.length()`.

use crate::Elementary;
use glam::{DMat3, DVec3};

use crate::quadratic::{dop, two_product};

/// The cross product with each component accurate to two ulps, even for nearly parallel vectors.
///
/// glam's own is faster, and sufficient where the vectors are far from parallel.
pub fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(dop(a.y, b.z, a.z, b.y), dop(a.z, b.x, a.x, b.z), dop(a.x, b.y, a.y, b.x))
}

/// The dot product as if computed with twice the digits and rounded once.
///
/// Source: Ogita, Rump, Oishi, "Accurate Sum and Dot Product", SIAM J. Sci. Comput. 26(6), 2005.
pub fn dot(a: DVec3, b: DVec3) -> f64 {
    let (x, ex) = two_product(a.x, b.x);
    let (y, ey) = two_product(a.y, b.y);
    let (z, ez) = two_product(a.z, b.z);
    let (xy, exy) = two_sum(x, y);
    let (sum, esum) = two_sum(xy, z);
    let refined = sum + (ex + ey + ez + exy + esum);
    if refined.is_finite() { refined } else { a.dot(b) }
}

/// `a + b` rounded, and the rounding error; their sum is exact.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// The triple product `a · (b × c)`: the determinant of the matrix with these columns (or rows), the volume of
/// their parallelepiped. Invariant under cyclic permutation; changes sign when two are swapped.
pub fn mixed_product(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    dot(a, cross(b, c))
}

/// The matrix `[a]×` with `[a]× b = a × b`.
pub fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

/// The length, without overflow or underflow of the squares.
pub fn length(a: DVec3) -> f64 {
    a.x.hypotenuse(a.y).hypotenuse(a.z)
}

/// `a` with length 1; `None` for zero and for what is not finite. Accurate for any length.
pub fn unit(a: DVec3) -> Option<DVec3> {
    let scaled = a / a.abs().max_element();
    let unit = scaled / scaled.length();
    unit.is_finite().then_some(unit)
}

/// `a` times a power of two that makes its largest component about 1, and that power: no digit changes, and squares and
/// products neither overflow nor vanish. Zero and what is not finite stay as they are.
pub(crate) fn scaled_to_one(a: DVec3) -> (DVec3, f64) {
    let factor = power_of_two_over(a.abs().max_element());
    (a * factor, factor)
}

/// The power of two that takes `size` to [1, 2); 1 for zero and what is not finite. A subnormal size is taken as far as
/// 2^1022 goes.
pub(crate) fn power_of_two_over(size: f64) -> f64 {
    if size == 0.0 || !size.is_finite() {
        return 1.0;
    }
    match size.to_bits() >> 52 {
        0 => f64::from_bits(2045 << 52),
        // 2^-1023 is subnormal, and still a power of two.
        2046 => f64::from_bits(1 << 51),
        biased => f64::from_bits((2046 - biased) << 52),
    }
}

/// The angle between two vectors in radians, in `[0, π]`; 0 when one is zero.
///
/// From both the sine and the cosine: the arc cosine of the dot product alone cannot resolve angles under 1e-8.
pub fn angle(a: DVec3, b: DVec3) -> f64 {
    let (a, b) = (scaled_to_one(a).0, scaled_to_one(b).0);
    length(cross(a, b)).angle_from(dot(a, b))
}

/// The signed length of `b` along `a`: negative when the angle is obtuse. Not finite if `a` is zero.
pub fn projected_length(a: DVec3, b: DVec3) -> f64 {
    let ((a, _), (b, factor)) = (scaled_to_one(a), scaled_to_one(b));
    dot(a, b) / length(a) / factor
}

/// The part of `b` that is parallel to `a`. Not finite if `a` is zero.
pub fn project(a: DVec3, b: DVec3) -> DVec3 {
    let ((a, _), (b, factor)) = (scaled_to_one(a), scaled_to_one(b));
    (dot(a, b) / a.length_squared()) * a / factor
}

/// The part of `b` that is perpendicular to `a`. Not finite if `a` is zero.
pub fn reject(a: DVec3, b: DVec3) -> DVec3 {
    let ((a, _), (b, factor)) = (scaled_to_one(a), scaled_to_one(b));
    // a × (b × a) / |a|²: no difference of nearly equal vectors when b is nearly parallel to a.
    cross(a, cross(b, a)) / a.length_squared() / factor
}

/// A vector perpendicular to `a`, at least `√⅔` times as long; zero only if `a` is zero.
pub fn perpendicular(a: DVec3) -> DVec3 {
    let size = a.abs();
    // The product with the axis of the smallest component, which is far from parallel.
    if size.x <= size.y && size.x <= size.z {
        DVec3::new(0.0, a.z, -a.y)
    } else if size.y <= size.z {
        DVec3::new(-a.z, 0.0, a.x)
    } else {
        DVec3::new(a.y, -a.x, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    fn random_vectors(seed: u64) -> impl Iterator<Item = DVec3> {
        let mut random = RandomStream::new(seed);
        std::iter::repeat_with(move || {
            DVec3::from_array(std::array::from_fn(|_| 7.0 * random.next_f64() - 3.0))
        })
    }

    #[test]
    fn products_of_the_axes_follow_the_table() {
        let [x, y, z] = DVec3::AXES;
        assert_eq!([cross(x, y), cross(y, z), cross(z, x)], [z, x, y]);
        assert_eq!([cross(y, x), cross(z, y), cross(x, z)], [-z, -x, -y]);
        assert_eq!(cross(x, x), DVec3::ZERO);
    }

    #[test]
    fn products_obey_their_identities() {
        let vectors: Vec<_> = random_vectors(3).take(900).collect();
        for v in vectors.chunks_exact(3) {
            let [a, b, c] = [v[0], v[1], v[2]];
            assert_eq!(cross(a, b), -cross(b, a));
            assert!((cross_matrix(a) * b - a.cross(b)).length() < 1e-14);
            assert!((cross(a, b) - a.cross(b)).length() < 1e-14);
            assert!((dot(a, b) - a.dot(b)).abs() < 1e-14);
            let volume = mixed_product(a, b, c);
            assert!((volume - DMat3::from_cols(a, b, c).determinant()).abs() < 1e-12);
            assert!((volume - mixed_product(b, c, a)).abs() < 1e-13);
            assert!((volume + mixed_product(b, a, c)).abs() < 1e-13);
            let sine = a.length() * b.length() * angle(a, b).sin();
            assert!((cross(a, b).length() - sine).abs() < 1e-13);
            assert!((a.length() * projected_length(a, b) - a.dot(b)).abs() < 1e-13);
            assert!((project(a, b) + reject(a, b) - b).length() < 1e-14);
            assert!(reject(a, b).dot(a).abs() < 1e-13);
            assert!(perpendicular(a).dot(a).abs() < 1e-14);
            assert!(perpendicular(a).length() >= (2.0_f64 / 3.0).sqrt() * a.length() - 1e-14);
        }
    }

    #[test]
    fn nearly_parallel_vectors_keep_their_digits() {
        let a = DVec3::new(1.0, 1.0 / 3.0, 3.0);
        let b = a * 3.0 + DVec3::new(0.0, f64::powi(2.0, -40), 0.0);
        // Exactly a × (b - 3a), by hand, with the b that was rounded.
        let rest = DVec3::new(0.0, b.y - 3.0 * a.y, 0.0);
        let exact = DVec3::new(-a.z * rest.y, 0.0, a.x * rest.y);
        assert!((cross(a, b) - exact).length() < 1e-4 * exact.length());
        assert!((angle(DVec3::X, DVec3::new(1.0, 1e-12, 0.0)) - 1e-12).abs() < 1e-27);
        assert!((dot(DVec3::new(1e20, 1.5, -1e20), DVec3::ONE) - 1.5).abs() < 1e-15);
        let tilted = reject(a, a * 7.0 + DVec3::new(0.0, 1e-9, 0.0));
        assert!(tilted.dot(a).abs() < 1e-24, "{tilted}");
    }

    #[test]
    fn lengths_neither_overflow_nor_vanish() {
        let v = DVec3::new(2.0, -3.0, 6.0);
        for size in [1e-300, 1e-5, 1.0, 1e300] {
            assert!((length(v * size) / size - 7.0).abs() < 1e-14);
            assert!((unit(v * size).unwrap() - v / 7.0).length() < 1e-15);
        }
        for size in [1e-300, 1e-200, 1e-30, 1.0, 1e200, 1e300] {
            for other in [1e-280, 1e-160, 3.0, 1e250] {
                let (a, b) = (v * size, DVec3::new(1.0, 1.0, 0.5) * other);
                let near = |found: f64, expected: f64| (found / other - expected).abs() < 1e-14;
                assert!((angle(a, b) - angle(v, b / other)).abs() < 1e-15, "{size} {other}");
                // a·b = 2 - 3 + 3 over a length of 7.
                assert!(near(projected_length(a, b), 2.0 / 7.0), "{size} {other}");
                assert!((project(a, b) / other - v * (2.0 / 49.0)).length() < 1e-15, "{size} {other}");
                assert!(((project(a, b) + reject(a, b)) / other - b / other).length() < 1e-15);
            }
        }
        assert_eq!(angle(DVec3::X * 1e-200, DVec3::Y * 1e-200).to_degrees(), 90.0);
        assert_eq!(project(DVec3::X * 1e200, DVec3::new(1.0, 1.0, 0.0)), DVec3::X);
        assert_eq!(reject(DVec3::X * 5e-324, DVec3::new(1.0, 1.0, 0.0)), DVec3::Y);
        assert_eq!(unit(DVec3::ZERO), None);
        assert_eq!(unit(DVec3::new(f64::INFINITY, 0.0, 0.0)), None);
        assert_eq!(perpendicular(DVec3::ZERO), DVec3::ZERO);
    }
}
