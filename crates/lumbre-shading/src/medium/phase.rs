//! The phase function of Henyey and Greenstein.

use std::f32::consts::PI;

use lumbre_math::{Vec2, Vec3};
use lumbre_simd::math::{orthonormal_basis, sin_cos_turns};
use lumbre_simd::{Real, V3};

use crate::lanes::{lane, square, vector};

/// The phase function per solid angle at the cosine of the scattering angle: 1 is straight on.
///
/// L. Henyey, J. Greenstein, "Diffuse Radiation in the Galaxy", Astrophysical Journal 93, 1941.
#[inline(always)]
pub fn henyey_greenstein<R: Real>(cos: R, g: R) -> R {
    let d = (R::one() + g * g - R::splat(2.0) * g * cos).simd_max(R::splat(1e-12));
    (R::one() - g * g) / (R::splat(4.0 * PI) * d * d.sqrt())
}

/// A unit direction sampled about the unit vector `forward` by [`henyey_greenstein`], with its density.
pub fn sample_henyey_greenstein(forward: Vec3, g: f32, u: Vec2) -> (Vec3, f32) {
    let (w, density) = sample_henyey_greenstein_lanes(lane(forward), g, square(u));
    (vector(w), density)
}

/// [`sample_henyey_greenstein`] over lanes.
#[inline(always)]
pub fn sample_henyey_greenstein_lanes<R: Real>(forward: V3<R>, g: R, u: [R; 2]) -> (V3<R>, R) {
    let (one, two) = (R::one(), R::splat(2.0));
    let s = (one - g * g) / (one + g - two * g * u[0]);
    let cos = ((one + g * g - s * s) / (two * g)).simd_max(-one).simd_min(one);
    let cos = R::select(g.abs().simd_lt(R::splat(1e-3)), one - two * u[0], cos);
    let sin = (one - cos * cos).simd_max(R::zero()).sqrt();
    let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
    let (x, y) = orthonormal_basis(forward);
    let w = (x * (sin * cos_phi) + y * (sin * sin_phi) + forward * cos).normalize();
    (w, henyey_greenstein(cos, g))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_math::random::RandomStream;

    #[test]
    fn directions_have_the_mean_cosine_of_their_asymmetry() {
        let forward = Vec3::new(2.0, -3.0, 6.0) / 7.0;
        let mut random = RandomStream::new(5);
        for g in [-0.7, 0.0, 0.3, 0.9] {
            let (mut sum, count) = (0.0, 100_000);
            for _ in 0..count {
                let u = Vec2::new(random.next_f32(), random.next_f32());
                let (w, density) = sample_henyey_greenstein(forward, g, u);
                assert!((density / henyey_greenstein(w.dot(forward), g) - 1.0).abs() < 1e-2);
                sum += f64::from(w.dot(forward));
            }
            assert!((sum / f64::from(count) - f64::from(g)).abs() < 6e-3, "{g}: {}", sum / f64::from(count));
        }
    }
}
