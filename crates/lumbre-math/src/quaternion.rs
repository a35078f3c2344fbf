//! Quaternions of any non-zero length as rotations, and Euler angles that are accurate at the poles.
//!
//! The type is glam's [`DQuat`], which lists `x, y, z, w`; most texts list the real part first, as
//! [`from_wxyz`] does. glam has the sum `p + q`, the product `p * q` ("first q") and `q.conjugate()`. Its `inverse`,
//! `q * v` and `from_quat` require unit quaternions; the functions here do not, and take quaternions of any length:
//! they are scaled by a power of two first, which changes no digit.

use crate::Elementary;
use glam::{DMat3, DQuat, DVec3};

use crate::transform::sin_cos_degrees;
use crate::vector::{self, power_of_two_over};

/// The quaternion `w + x i + y j + z k`.
pub fn from_wxyz(wxyz: [f64; 4]) -> DQuat {
    let [w, x, y, z] = wxyz;
    DQuat::from_xyzw(x, y, z, w)
}

/// The parts of `w + x i + y j + z k`, real part first.
pub fn to_wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

/// `q⁻¹ = conj q / |q|²`; `None` when it is not finite, as for zero.
pub fn inverse(q: DQuat) -> Option<DQuat> {
    let (q, factor) = scaled_to_one(q);
    let inverse = q.conjugate() * (1.0 / q.length_squared()) * factor;
    inverse.is_finite().then_some(inverse)
}

/// `|q|`, without overflow or underflow of the squares.
pub fn length(q: DQuat) -> f64 {
    let (q, factor) = scaled_to_one(q);
    q.length() / factor
}

/// `q / |q|`; `None` for zero and for what is not finite.
pub fn unit(q: DQuat) -> Option<DQuat> {
    let (q, _) = scaled_to_one(q);
    let unit = q * (1.0 / q.length());
    unit.is_finite().then_some(unit)
}

/// `q` times a power of two that makes its largest part about 1, and that power.
fn scaled_to_one(q: DQuat) -> (DQuat, f64) {
    let size = to_wxyz(q).into_iter().fold(0.0_f64, |most, part| most.max(part.abs()));
    let factor = power_of_two_over(size);
    (q * factor, factor)
}

/// The rotation a share `s` of the way from `p` to `q`, the shorter way about at a steady pace: `(sin((1-s)θ) p +
/// sin(sθ) q) / sin θ` for unit quaternions with the angle θ between them. It is a unit quaternion; `None` where `p` or
/// `q` is zero or anything is not finite.
///
/// K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH, 1985. θ is twice the angle whose tangent is
/// `|p - q| / |p + q|`, which is accurate for small angles as well.
pub fn slerp(p: DQuat, q: DQuat, s: f64) -> Option<DQuat> {
    let (p, q) = (unit(p)?, unit(q)?);
    // q and -q are the same rotation.
    let q = if p.dot(q) < 0.0 { -q } else { q };
    let angle = 2.0 * (p - q).length().angle_from((p + q).length());
    let sine = angle.sine();
    let [from, to] = match sine == 0.0 {
        true => [1.0 - s, s],
        false => [((1.0 - s) * angle).sine() / sine, (s * angle).sine() / sine],
    };
    unit(p * from + q * to)
}

/// The quotient `p q⁻¹`, whose product with `q` is `p`; `None` when it is not finite, as for a `q` of zero.
pub fn divide(p: DQuat, q: DQuat) -> Option<DQuat> {
    let ((p, of_p), (q, of_q)) = (scaled_to_one(p), scaled_to_one(q));
    let quotient = p * inverse(q)? * (of_q / of_p);
    quotient.is_finite().then_some(quotient)
}

/// The rotation by `degrees` about `axis`, of any length but zero, x towards y when it is z: `(cos θ/2, a sin θ/2)`.
/// `None` when the axis is zero or anything is not finite.
pub fn from_axis_angle(axis: DVec3, degrees: f64) -> Option<DQuat> {
    let a = vector::unit(axis)?;
    // A quaternion has a period of 720°; 360° gives -1.
    let (sin, cos) = sin_cos_degrees(0.5 * degrees);
    let q = DQuat::from_xyzw(a.x * sin, a.y * sin, a.z * sin, cos);
    q.is_finite().then_some(q)
}

/// `v` rotated by `q`: `q v q⁻¹`, for `q` of any non-zero length. `q` and `-q` are the same rotation.
pub fn rotate(q: DQuat, v: DVec3) -> DVec3 {
    let (q, _) = scaled_to_one(q);
    let r = q.xyz();
    let across = 2.0 * r.cross(v) / q.length_squared();
    v + q.w * across + r.cross(across)
}

/// The rotation matrix of `q`, of any length but zero.
pub fn to_matrix(q: DQuat) -> DMat3 {
    let (q, _) = scaled_to_one(q);
    let square = q.length_squared();
    let [a, b, c, d] = to_wxyz(q);
    let (aa, bb, cc, dd) = (a * a, b * b, c * c, d * d);
    DMat3::from_cols(
        DVec3::new(aa + bb - cc - dd, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)),
        DVec3::new(2.0 * (b * c - a * d), aa - bb + cc - dd, 2.0 * (c * d + a * b)),
        DVec3::new(2.0 * (b * d + a * c), 2.0 * (c * d - a * b), aa - bb - cc + dd),
    ) * (1.0 / square)
}

/// A unit quaternion of a rotation matrix, with its largest part positive.
///
/// Each part comes from the largest one, so that nothing cancels: Shepperd, "Quaternion from Rotation Matrix", Journal
/// of Guidance and Control 1(3), 1978.
pub fn from_matrix(m: &DMat3) -> DQuat {
    let at = |row: usize, column: usize| m.col(column)[row];
    let trace = at(0, 0) + at(1, 1) + at(2, 2);
    // 4w², 4x², 4y², 4z².
    let squares = [
        1.0 + trace,
        1.0 + 2.0 * at(0, 0) - trace,
        1.0 + 2.0 * at(1, 1) - trace,
        1.0 + 2.0 * at(2, 2) - trace,
    ];
    let largest = (1..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let square = squares[largest];
    // 4 times the products of the parts by twos.
    let (wx, wy, wz) = (at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1));
    let (xy, yz, zx) = (at(1, 0) + at(0, 1), at(2, 1) + at(1, 2), at(0, 2) + at(2, 0));
    let parts = match largest {
        0 => [square, wx, wy, wz],
        1 => [wx, square, xy, zx],
        2 => [wy, xy, square, yz],
        _ => [wz, zx, yz, square],
    };
    from_wxyz(parts.map(|part| part / (2.0 * square.sqrt()))).normalize()
}

/// A rotation as three angles, in degrees: bank about x first, then attitude about z, then heading about y, `R
/// = Ry(heading) Rz(attitude) Rx(bank)`.
///
/// At the poles, attitude ±90°, heading and bank rotate about the same axis and only their sum (north, +90°) or
/// difference (south) is determined; near them the single angles are uncertain by about 1e-16 / cos(attitude).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Euler {
    /// The rotation about y, in degrees.
    pub heading: f64,
    /// The rotation about z, in degrees.
    pub attitude: f64,
    /// The rotation about x, in degrees.
    pub bank: f64,
}

impl Euler {
    /// The unit quaternion of this rotation.
    pub fn to_quaternion(self) -> DQuat {
        let (s1, c1) = sin_cos_degrees(0.5 * self.heading);
        let (s2, c2) = sin_cos_degrees(0.5 * self.attitude);
        let (s3, c3) = sin_cos_degrees(0.5 * self.bank);
        from_wxyz([
            c1 * c2 * c3 - s1 * s2 * s3,
            s1 * s2 * c3 + c1 * c2 * s3,
            s1 * c2 * c3 + c1 * s2 * s3,
            c1 * s2 * c3 - s1 * c2 * s3,
        ])
    }

    /// The angles of a quaternion of any non-zero length: heading and bank in (-180°, 180°], attitude in [-90°,
    /// 90°]; at a pole the bank is 0.
    ///
    /// Computed from sums and differences of the parts, which is accurate at the poles: Bernardes, Viollet,
    /// "Quaternion to Euler Angles Conversion: A Direct, General and Computationally Efficient Method", PLoS
    /// ONE 17(11), 2022.
    pub fn from_quaternion(q: DQuat) -> Self {
        let [a, b, c, d] = to_wxyz(scaled_to_one(q).0);
        let (sum, difference) = ((a + d).hypotenuse(b + c), (a - d).hypotenuse(c - b));
        let attitude = 2.0 * sum.angle_from(difference).to_degrees() - 90.0;
        let half_sum = || (b + c).angle_from(a + d).to_degrees();
        let half_difference = || (c - b).angle_from(a - d).to_degrees();
        let (heading, bank) = if difference <= 1e-15 * sum {
            (2.0 * half_sum(), 0.0)
        } else if sum <= 1e-15 * difference {
            (2.0 * half_difference(), 0.0)
        } else {
            (half_sum() + half_difference(), half_sum() - half_difference())
        };
        Self { heading: wrap_degrees(heading), attitude, bank: wrap_degrees(bank) }
    }
}

/// The same angle in (-180°, 180°], for one within a turn of it.
fn wrap_degrees(degrees: f64) -> f64 {
    if degrees > 180.0 {
        degrees - 360.0
    } else if degrees <= -180.0 {
        degrees + 360.0
    } else {
        degrees
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    fn largest(m: DMat3) -> f64 {
        m.to_cols_array().into_iter().fold(0.0, |most, e| most.max(e.abs()))
    }

    #[test]
    fn a_quotient_times_its_divisor_is_the_dividend() {
        let (p, q) = (from_wxyz([2.0, -3.0, 0.5, 7.0]), from_wxyz([0.25, 4.0, -1.5, 2.0]));
        let quotient = divide(p, q).unwrap();
        for (found, expected) in to_wxyz(quotient * q).into_iter().zip(to_wxyz(p)) {
            assert!((found - expected).abs() < 1e-14, "{found} for {expected}");
        }
        // (1 + i) / (1 + j) = (1 + i)(1 - j) / 2 = (1 + i - j - k) / 2
        let quotient = divide(from_wxyz([1.0, 1.0, 0.0, 0.0]), from_wxyz([1.0, 0.0, 1.0, 0.0])).unwrap();
        assert_eq!(to_wxyz(quotient), [0.5, 0.5, -0.5, -0.5]);
        assert_eq!(divide(p, from_wxyz([0.0; 4])), None);
    }

    #[test]
    fn the_length_of_a_quaternion_does_not_matter() {
        let q = from_wxyz([1.0, -2.0, 0.5, 4.0]);
        let (p, v) = (from_wxyz([0.5, 0.25, -3.0, 1.0]), DVec3::new(1.0, 2.0, -0.5));
        for size in [1e-320, 1e-300, 1e-160, 1.0, 1e160, 1e300] {
            let scaled = q * size;
            // A subnormal number has few digits.
            let slack = if size < 1e-310 { 1e-3 } else { 1e-14 };
            assert!((rotate(scaled, v) - rotate(q, v)).length() < slack);
            assert!(largest(to_matrix(scaled) - to_matrix(q)) < slack);
            assert!((length(scaled) / size / length(q) - 1.0).abs() < slack);
            assert!((unit(scaled).unwrap() - unit(q).unwrap()).length() < slack);
            let (found, expected) = (Euler::from_quaternion(scaled), Euler::from_quaternion(q));
            assert!((found.heading - expected.heading).abs() < 100.0 * slack);
            if size > 1e-310 {
                let product = scaled * inverse(scaled).unwrap();
                assert!((product - DQuat::IDENTITY).length() < slack, "{size} {product}");
                let quotient = divide(p * size, scaled).unwrap();
                assert!((quotient - divide(p, q).unwrap()).length() < slack, "{size}");
            }
        }
        assert_eq!((unit(from_wxyz([0.0; 4])), inverse(from_wxyz([0.0; 4]))), (None, None));
    }

    #[test]
    fn slerp_turns_at_a_steady_pace_the_shorter_way() {
        let axis = DVec3::new(1.0, 2.0, -2.0);
        let about = |degrees: f64| from_axis_angle(axis, degrees).unwrap();
        for (from, to) in [(10.0, 130.0), (-20.0, 155.0), (0.0, 1e-7), (40.0, 40.0), (5.0, 184.0)] {
            for s in [0.0, 0.25, 0.5, 0.9, 1.0] {
                let expected = about(from + s * (to - from));
                // Lengths and signs do not matter.
                for q in [about(to), -about(to), about(to) * 1e-200] {
                    let found = slerp(about(from) * 3.0, q, s).unwrap();
                    assert!(largest(to_matrix(found) - to_matrix(expected)) < 1e-14, "{from} {to} {s}");
                }
            }
        }
        // 200° one way are 160° the other.
        let found = slerp(about(0.0), about(200.0), 0.5).unwrap();
        assert!(largest(to_matrix(found) - to_matrix(about(-80.0))) < 1e-14);
        assert_eq!(slerp(from_wxyz([0.0; 4]), about(1.0), 0.5), None);
        assert_eq!(slerp(about(2.0), about(1.0), f64::NAN), None);
    }

    #[test]
    fn the_units_multiply_as_they_should() {
        let [i, j, k] = [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]].map(from_wxyz);
        assert_eq!([i * j, j * k, k * i], [k, i, j]);
        assert_eq!([j * i, k * j, i * k], [-k, -i, -j]);
        assert_eq!([i * i, i * j * k], [-DQuat::IDENTITY; 2]);
    }

    #[test]
    fn rotations_agree_with_their_matrix_and_round_trip() {
        let mut random = RandomStream::new(14);
        let mut number = || 4.0 * random.next_f64() - 2.0;
        for _ in 0..1_000 {
            let q = from_wxyz([number(), number(), number(), number()]);
            let v = DVec3::new(number(), number(), number());
            let m = to_matrix(q);
            assert!((m * v - rotate(q, v)).length() < 2e-15 * (1.0 + v.length()) * 4.0);
            assert!((m.determinant() - 1.0).abs() < 1e-14);
            assert!((rotate(inverse(q).unwrap(), rotate(q, v)) - v).length() < 1e-14);
            assert_eq!(rotate(-q, v), rotate(q, v));
            let again = from_matrix(&m);
            assert!((again.length() - 1.0).abs() < 1e-15);
            assert!(largest(to_matrix(again) - m) < 2e-15);
            let p = from_wxyz([number(), number(), number(), number()]);
            assert!((rotate(p * q, v) - rotate(p, rotate(q, v))).length() < 2e-14);
            assert!(((p * q).length() - p.length() * q.length()).abs() < 1e-14);
        }
        assert_eq!(inverse(from_wxyz([0.0; 4])), None);
    }

    #[test]
    fn half_turns_come_back_from_their_matrix() {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, -2.0, 3.0)] {
            for degrees in [180.0, 179.999_999, -180.0, 1e-7, 0.0] {
                let q = from_axis_angle(axis, degrees).unwrap();
                assert!(largest(to_matrix(from_matrix(&to_matrix(q))) - to_matrix(q)) < 2e-15);
            }
        }
        assert!(from_axis_angle(DVec3::ZERO, 20.0).is_none());
        assert!(from_axis_angle(DVec3::X, f64::NAN).is_none());
    }

    #[test]
    fn euler_angles_are_three_turns_in_order() {
        use crate::matrix::{rotation_x, rotation_y, rotation_z};
        let e = Euler { heading: 25.0, attitude: -50.0, bank: 110.0 };
        let m = rotation_y(e.heading) * rotation_z(e.attitude) * rotation_x(e.bank);
        assert!(largest(to_matrix(e.to_quaternion()) - m) < 1e-15);
    }

    #[test]
    fn the_rotation_survives_euler_angles_at_and_next_to_the_poles() {
        let mut count = 0;
        for pole in [90.0, -90.0] {
            for away in [0.0, 1e-14, 1e-10, 1e-7, 1e-4, 0.1, 3.6, 30.0, 90.0] {
                for heading in [-170.0, -90.0, 0.0, 33.0, 180.0] {
                    for bank in [-100.0, 0.0, 90.0, 179.0] {
                        let attitude = pole - f64::signum(pole) * away;
                        let q = Euler { heading, attitude, bank }.to_quaternion();
                        let found = Euler::from_quaternion(q * -3.5);
                        let error = largest(to_matrix(found.to_quaternion()) - to_matrix(q));
                        assert!(error < 3e-15, "{heading} {attitude} {bank}: {found:?}, {error}");
                        assert!(found.heading > -180.0 && found.heading <= 180.0);
                        assert!(found.bank > -180.0 && found.bank <= 180.0);
                        assert!(found.attitude.abs() <= 90.0);
                        count += 1;
                    }
                }
            }
        }
        assert_eq!(count, 360);
    }
}
