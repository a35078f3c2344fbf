//! The directions of reflected and refracted rays.

use glam::DVec3;

use crate::quadratic::dop;
use crate::vector::{cross, dot};

/// The mirrored direction `D - 2 (D·N) N / |N|²`, as long as `direction`. The normal's side and length do not
/// matter.
pub fn reflect(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - (2.0 * dot(direction, normal) / normal.length_squared()) * normal
}

/// The normal flipped to the side that `direction` comes from: `N` when `N·D ≤ 0`, otherwise `-N`.
pub fn facing(normal: DVec3, direction: DVec3) -> DVec3 {
    if normal.dot(direction) > 0.0 { -normal } else { normal }
}

/// The unit direction of the refracted ray; `None` for total internal reflection.
///
/// `eta` is the index of refraction on the incident side over that on the other. Neither vector needs to be
/// unit, and the side of the normal does not matter. Snell's law: the sine of the angle to the normal grows by
/// `eta`.
pub fn refract(direction: DVec3, normal: DVec3, eta: f64) -> Option<DVec3> {
    let n = facing(normal, direction);
    let (dd, nn) = (direction.length_squared(), n.length_squared());
    // 1 - η² sin² θ, times |D|² |N|², with the sine from the cross product, so that it is exactly zero at the
    // critical angle.
    let rest = dop(dd, nn, eta * eta, cross(direction, n).length_squared());
    if rest.is_nan() || rest < 0.0 {
        return None;
    }
    let along = direction - (dot(direction, n) / nn) * n;
    let refracted = (eta / dd.sqrt()) * along - (rest / dd).sqrt() / nn * n;
    refracted.is_finite().then_some(refracted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;
    use crate::vector::angle;

    #[test]
    fn refraction_obeys_snells_law_and_can_be_reversed() {
        let mut random = RandomStream::new(17);
        let (mut passed, mut reflected) = (0, 0);
        for _ in 0..4_000 {
            let mut vector = || DVec3::from_array(std::array::from_fn(|_| 3.0 * random.next_f64() - 1.5));
            let (d, n) = (vector(), vector());
            let eta = 0.4 + 1.6 * random.next_f64();
            let into = facing(n, d);
            let sine = angle(-d, into).sin();
            let mirrored = reflect(d, n);
            assert!((mirrored.length() - d.length()).abs() < 1e-14);
            assert!((mirrored.dot(into) + d.dot(into)).abs() < 1e-13);
            match refract(d, n, eta) {
                Some(t) => {
                    passed += 1;
                    assert!((t.length() - 1.0).abs() < 1e-14);
                    assert!((angle(t, -into).sin() - eta * sine).abs() < 1e-7 && t.dot(into) <= 0.0);
                    assert!((angle(t, -into).sin() - eta * sine).abs() < 1e-13 || eta * sine > 0.999);
                    if eta * sine < 0.999 && sine < 0.999 {
                        // Back along the same path.
                        let back = refract(-t, n, 1.0 / eta).unwrap();
                        assert!((back + d.normalize()).length() < 1e-12);
                    }
                }
                None => {
                    reflected += 1;
                    assert!(eta * sine > 1.0 - 1e-14);
                }
            }
        }
        assert!(passed > 2_000 && reflected > 500, "{passed} {reflected}");
    }

    #[test]
    fn a_zero_direction_is_not_refracted() {
        assert_eq!(refract(DVec3::ZERO, DVec3::Y, 1.5), None);
        assert_eq!(refract(DVec3::NAN, DVec3::Y, 1.5), None);
    }
}
