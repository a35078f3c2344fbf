//! Lambertian surfaces.

use std::f32::consts::FRAC_1_PI;

use lumbre_math::warp::square_to_cosine_hemisphere;
use lumbre_math::{Vec2, Vec3};

use crate::{BsdfSample, LocalDir, Scatter, Spectrum};

/// Lambertian reflection. Conserves energy at a reflectance of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse {
    /// In [0, 1].
    pub reflectance: Spectrum,
}

impl Diffuse {
    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        if wo.same_hemisphere(wi) {
            self.reflectance * (FRAC_1_PI * wi.abs_cos_theta())
        } else {
            Spectrum::BLACK
        }
    }

    /// The density of [`Diffuse::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        if wo.same_hemisphere(wi) { FRAC_1_PI * wi.abs_cos_theta() } else { 0.0 }
    }

    /// A cosine-weighted direction.
    pub fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        let wi = cosine_direction(u, wo.cos_theta())?;
        Some(BsdfSample {
            wi,
            weight: self.reflectance,
            scatter: Scatter::Density(FRAC_1_PI * wi.abs_cos_theta()),
            transmitted: false,
            eta: 1.0,
        })
    }
}

/// Lambertian reflection and transmission. Conserves energy where the two sum to 1; the scene must not let them
/// sum to more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// In [0, 1].
    pub reflectance: Spectrum,
    /// In [0, 1].
    pub transmittance: Spectrum,
}

impl DiffuseTransmission {
    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        let side = wo.cos_theta() * wi.cos_theta();
        let share = if side > 0.0 {
            self.reflectance
        } else if side < 0.0 {
            self.transmittance
        } else {
            return Spectrum::BLACK;
        };
        share * (FRAC_1_PI * wi.abs_cos_theta())
    }

    /// The probability of a reflection.
    fn reflection_probability(&self) -> f32 {
        let (r, t) = (self.reflectance.max_component(), self.transmittance.max_component());
        if r + t > 0.0 { r / (r + t) } else { 0.5 }
    }

    /// The density of [`DiffuseTransmission::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let side = wo.cos_theta() * wi.cos_theta();
        let reflection = self.reflection_probability();
        let probability = if side > 0.0 {
            reflection
        } else if side < 0.0 {
            1.0 - reflection
        } else {
            return 0.0;
        };
        probability * FRAC_1_PI * wi.abs_cos_theta()
    }

    /// A cosine-weighted direction on either side.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let reflection = self.reflection_probability();
        let transmitted = lobe >= reflection;
        let (share, probability) =
            if transmitted { (self.transmittance, 1.0 - reflection) } else { (self.reflectance, reflection) };
        let wi = cosine_direction(u, if transmitted { -wo.cos_theta() } else { wo.cos_theta() })?;
        Some(BsdfSample {
            wi,
            weight: share / probability,
            scatter: Scatter::Density(probability * FRAC_1_PI * wi.abs_cos_theta()),
            transmitted,
            eta: 1.0,
        })
    }
}

/// A direction with density cos θ / π on the side of the sign of `side`; `None` when that is zero.
pub(crate) fn cosine_direction(u: Vec2, side: f32) -> Option<LocalDir> {
    if side == 0.0 || side.is_nan() {
        return None;
    }
    let up = square_to_cosine_hemisphere(u);
    // At least 2⁻¹³, since a direction in the surface has no side.
    Some(LocalDir(Vec3::new(up.x, up.y, up.z.max(1.2e-4).copysign(side))))
}
