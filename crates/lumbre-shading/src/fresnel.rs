//! Fresnel reflectance.

use lumbre_simd::{Real, V3};

use crate::Spectrum;

/// The reflectance of a smooth dielectric interface for unpolarised light.
///
/// `cos_i` is the cosine of incidence, negative from the inside; `eta` is the index of the inside over that of
/// the outside, positive. 1 beyond the critical angle and at grazing incidence.
#[inline(always)]
pub fn dielectric<R: Real>(cos_i: R, eta: R) -> R {
    let eta = R::select(cos_i.simd_lt(R::zero()), eta.recip(), eta);
    let cos_i = cos_i.abs().simd_min(R::one());
    let sin2_t = (R::one() - cos_i * cos_i) / (eta * eta);
    let cos_t = (R::one() - sin2_t).simd_max(R::zero()).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let partial = R::splat(0.5) * (parallel * parallel + perpendicular * perpendicular);
    R::select(sin2_t.simd_ge(R::one()), R::one(), partial)
}

/// The reflectance of a metal of index `eta + i k` (over that of its surroundings) at one wavelength, `cos_i` ≥
/// 0.
///
/// An infinite `k` reflects everything. A negative `eta` stands for a channel that reflects more than all of its light,
/// as red does of gold, whose colour no three channels hold: `1 - eta` at normal incidence, and 1 at grazing. Source:
/// the Fresnel equations with a complex index, in the real form of Born and Wolf, "Principles of Optics", 7th ed.,
/// 1999, section 14.2.
#[inline(always)]
pub fn conductor_channel<R: Real>(cos_i: R, eta: R, k: R) -> R {
    let cos_i = cos_i.simd_max(R::zero()).simd_min(R::one());
    let cos2 = cos_i * cos_i;
    let sin2 = R::one() - cos2;
    let (eta2, k2) = (eta * eta, k * k);
    let t0 = eta2 - k2 - sin2;
    let a2_plus_b2 = (t0 * t0 + R::splat(4.0) * eta2 * k2).sqrt();
    let a = (R::splat(0.5) * (a2_plus_b2 + t0)).simd_max(R::zero()).sqrt();
    let (t1, t2) = (a2_plus_b2 + cos2, R::splat(2.0) * a * cos_i);
    let (t3, t4) = (cos2 * a2_plus_b2 + sin2 * sin2, t2 * sin2);
    let perpendicular = (t1 - t2) / (t1 + t2);
    let parallel = perpendicular * (t3 - t4) / (t3 + t4);
    let partial = R::splat(0.5) * (perpendicular + parallel);
    let partial = partial.simd_max(R::zero()).simd_min(R::one());
    // Both are 0/0 where metal and surroundings are equal, at a grazing angle.
    let is_undefined = (t1 + t2).simd_le(R::zero()) | (t3 + t4).simd_le(R::zero());
    let is_border = k.simd_gt(R::zero()) | eta.simd_ne(R::one());
    let reflectance = R::select(is_undefined, R::one().or_zero(is_border), partial);
    // Beyond this the reflectance is within 4·10⁻⁴ of 1 except at grazing angles, and k⁴ approaches the end of
    // the range.
    let reflectance = R::select(k.simd_gt(R::splat(1e4)), R::one(), reflectance);
    R::select(eta.simd_lt(R::zero()), R::one() - eta * cos_i, reflectance)
}

/// [`conductor_channel`] for each channel, in lanes.
#[inline(always)]
pub(crate) fn conductor_lanes<R: Real>(cos_i: R, eta: V3<R>, k: V3<R>) -> V3<R> {
    V3::new(
        conductor_channel(cos_i, eta.x, k.x),
        conductor_channel(cos_i, eta.y, k.y),
        conductor_channel(cos_i, eta.z, k.z),
    )
}

/// [`conductor_channel`] for each channel.
pub fn conductor(cos_i: f32, eta: Spectrum, k: Spectrum) -> Spectrum {
    eta.zip(k, |eta, k| conductor_channel(cos_i, eta, k))
}

/// The `k` that, with an `eta` of 1, gives the reflectance `r` in [0, 1] at normal incidence; infinite for 1.
pub fn k_from_reflectance(r: f32) -> f32 {
    let r = crate::unit(r);
    2.0 * (r / (1.0 - r)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_gives_the_textbook_values() {
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(-1.0, 1.5) - 0.04).abs() < 1e-6);
        let (eta, k) = (0.2_f32, 3.4_f32);
        let expected = ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
        assert!((conductor_channel(1.0, eta, k) - expected).abs() < 1e-6);
    }

    #[test]
    fn a_metal_that_does_not_absorb_is_a_dielectric() {
        let mut count = 0;
        for eta in [1.1, 1.5, 2.4] {
            for i in 0..=50 {
                let cos = i as f32 / 50.0;
                assert!(
                    (conductor_channel(cos, eta, 0.0) - dielectric(cos, eta)).abs() < 2e-5,
                    "{eta} {cos}"
                );
                count += 1;
            }
        }
        assert_eq!(count, 153);
    }

    #[test]
    fn brewster_s_angle_reflects_no_parallel_light() {
        // There the reflected share is half the perpendicular one: ((η² − 1)/(η² + 1))²/2.
        let eta = 1.5_f32;
        let cos = (1.0 / (1.0 + eta * eta)).sqrt();
        let expected = 0.5 * ((eta * eta - 1.0) / (eta * eta + 1.0)).powi(2);
        assert!((dielectric(cos, eta) - expected).abs() < 1e-6);
    }

    #[test]
    fn both_sides_of_one_refracted_ray_reflect_the_same_share() {
        for i in 1..40 {
            let cos_i = i as f32 / 40.0;
            let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (1.33 * 1.33_f32)).sqrt();
            assert!((dielectric(cos_i, 1.33) - dielectric(-cos_t, 1.33)).abs() < 1e-5);
        }
    }

    #[test]
    fn fresnel_is_one_past_the_critical_angle_and_grazing() {
        let critical = (1.0 - 1.0 / (1.5_f32 * 1.5)).sqrt();
        assert_eq!(dielectric(-(critical - 1e-3), 1.5), 1.0);
        assert!(dielectric(-(critical + 1e-3), 1.5) < 1.0);
        assert_eq!(dielectric(0.0, 1.5), 1.0);
        assert!((conductor_channel(0.0, 0.2, 3.0) - 1.0).abs() < 1e-6);
        assert_eq!(dielectric(-0.3, 1.0).min(1e-10), dielectric(-0.3, 1.0));
    }

    #[test]
    fn the_k_of_a_reflectance_reflects_it() {
        for r in [0.0, 0.01, 0.3, 0.9, 0.999, 1.0] {
            assert!((conductor_channel(1.0, 1.0, k_from_reflectance(r)) - r).abs() < 1e-5, "{r}");
        }
        assert_eq!(conductor_channel(0.2, 1.0, k_from_reflectance(1.0)), 1.0);
        assert_eq!(conductor_channel(0.0, 1.0, 0.0), 0.0);
    }
}
