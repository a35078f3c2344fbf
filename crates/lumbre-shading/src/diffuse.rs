//! Lambertian surfaces.

use std::f32::consts::FRAC_1_PI;

use lumbre_math::Vec2;
use lumbre_simd::math::cosine_hemisphere;
use lumbre_simd::{Mask, Real, V3};

use crate::lanes::{LaneBsdf, LaneSample, colour, colour_lane, spectrum, square};
use crate::{BsdfSample, LocalDir, Spectrum};

/// Lambertian reflection. Conserves energy at a reflectance of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse {
    /// In [0, 1].
    pub reflectance: Spectrum,
}

impl Diffuse {
    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().eval(wo.lane(), wi.lane()).0)
    }

    /// The density of [`Diffuse::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).1
    }

    /// A cosine-weighted direction.
    pub fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), 0.0, square(u)).scalar()
    }

    pub(crate) fn lane(&self) -> DiffuseLanes<f32> {
        DiffuseLanes { reflectance: colour_lane(self.reflectance) }
    }

    pub(crate) fn row(&self) -> [f32; 3] {
        self.reflectance.to_array()
    }
}

/// [`Diffuse`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseLanes<R: Real> {
    /// In [0, 1].
    pub reflectance: V3<R>,
}

impl<R: Real> LaneBsdf<R> for DiffuseLanes<R> {
    const ROW: usize = 3;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self { reflectance: colour(table, at, 0) }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let is_reflection = (wo.z * wi.z).simd_gt(R::zero());
        let pdf = (R::splat(FRAC_1_PI) * wi.z.abs()).or_zero(is_reflection);
        (self.reflectance * pdf, pdf)
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, _: R, u: [R; 2]) -> LaneSample<R> {
        let wi = cosine_direction(u, wo.z);
        LaneSample {
            wi,
            weight: self.reflectance,
            pdf: R::splat(FRAC_1_PI) * wi.z.abs(),
            valid: has_side(wo),
            delta: R::Mask::splat(false),
            transmitted: R::Mask::splat(false),
            eta: R::one(),
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        R::Mask::splat(false)
    }

    #[inline(always)]
    fn regularized(self, _: R::Mask) -> Self {
        self
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
        spectrum(self.lane().eval(wo.lane(), wi.lane()).0)
    }

    /// The density of [`DiffuseTransmission::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).1
    }

    /// A cosine-weighted direction on either side.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), lobe, square(u)).scalar()
    }

    fn lane(&self) -> DiffuseTransmissionLanes<f32> {
        DiffuseTransmissionLanes {
            reflectance: colour_lane(self.reflectance),
            transmittance: colour_lane(self.transmittance),
        }
    }

    pub(crate) fn row(&self) -> [f32; 6] {
        let ([a, b, c], [d, e, f]) = (self.reflectance.to_array(), self.transmittance.to_array());
        [a, b, c, d, e, f]
    }
}

/// [`DiffuseTransmission`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseTransmissionLanes<R: Real> {
    /// In [0, 1].
    pub reflectance: V3<R>,
    /// In [0, 1].
    pub transmittance: V3<R>,
}

impl<R: Real> DiffuseTransmissionLanes<R> {
    /// The probability of a reflection.
    #[inline(always)]
    fn reflection_probability(&self) -> R {
        let (r, t) = (self.reflectance.max_component(), self.transmittance.max_component());
        let sum = r + t;
        R::select(sum.simd_gt(R::zero()), r / sum, R::splat(0.5))
    }
}

impl<R: Real> LaneBsdf<R> for DiffuseTransmissionLanes<R> {
    const ROW: usize = 6;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self { reflectance: colour(table, at, 0), transmittance: colour(table, at, 3) }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let side = wo.z * wi.z;
        let (reflects, transmits) = (side.simd_gt(R::zero()), side.simd_lt(R::zero()));
        let reflection = self.reflection_probability();
        let cosine = (R::splat(FRAC_1_PI) * wi.z.abs()).or_zero(reflects | transmits);
        let share = V3::select(reflects, self.reflectance, self.transmittance);
        (share * cosine, R::select(reflects, reflection, R::one() - reflection) * cosine)
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        let reflection = self.reflection_probability();
        let transmitted = lobe.simd_ge(reflection);
        let share = V3::select(transmitted, self.transmittance, self.reflectance);
        let probability = R::select(transmitted, R::one() - reflection, reflection);
        let wi = cosine_direction(u, R::select(transmitted, -wo.z, wo.z));
        LaneSample {
            wi,
            weight: share / probability,
            pdf: probability * (R::splat(FRAC_1_PI) * wi.z.abs()),
            valid: has_side(wo),
            delta: R::Mask::splat(false),
            transmitted,
            eta: R::one(),
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        R::Mask::splat(false)
    }

    #[inline(always)]
    fn regularized(self, _: R::Mask) -> Self {
        self
    }
}

/// Where a direction has a side of the surface: not in it, and not NaN.
#[inline(always)]
pub(crate) fn has_side<R: Real>(w: V3<R>) -> R::Mask {
    w.z.abs().simd_gt(R::zero())
}

/// A direction with density cos θ / π on the side of the sign of `side`, which is not zero.
#[inline(always)]
pub(crate) fn cosine_direction<R: Real>(u: [R; 2], side: R) -> V3<R> {
    let up = cosine_hemisphere(u);
    // At least 2⁻¹³, since a direction in the surface has no side.
    V3::new(up.x, up.y, up.z.simd_max(R::splat(1.2e-4)).copysign(side))
}
