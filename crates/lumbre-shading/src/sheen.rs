//! Sheen of cloth: upright fibres that scatter backwards and at grazing angles.

use std::f32::consts::FRAC_1_PI;

use lumbre_simd::math::pow;
use lumbre_simd::{Real, V3};

use crate::albedo::ALBEDO;
use crate::lanes::{colour_lane, spectrum};
use crate::{LocalDir, Spectrum};

/// A layer of fibres over a surface, the same from both sides.
///
/// The distribution of Estevez, Kulla, "Production Friendly Microfacet Sheen BRDF", SIGGRAPH course notes 2017
/// ("Charlie"), with the visibility of Neubelt, Pettineo, "Crafting a Next-Gen Material Pipeline for The Order:
/// 1886", SIGGRAPH course notes 2013, both as named by glTF's KHR_materials_sheen. Unlike there, a lobe of
/// albedo above 1 (smooth fibres at grazing angles) is divided by its albedo, the larger of the two directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// The strength in each channel, in [0, 1]; black is no sheen.
    pub color: Spectrum,
    // Within [MIN_ROUGHNESS, 1].
    roughness: f32,
}

impl Sheen {
    /// Below this roughness the lobe is narrower than the albedo table resolves.
    pub const MIN_ROUGHNESS: f32 = 0.1;

    /// A layer by its colour and its roughness, clamped to [[`Sheen::MIN_ROUGHNESS`], 1]; the exponent of the
    /// distribution is 1 / roughness².
    pub fn new(color: Spectrum, roughness: f32) -> Self {
        // NaN counts as the smallest roughness.
        let roughness = crate::unit(roughness).max(Self::MIN_ROUGHNESS);
        Self { color: color.map(crate::unit), roughness }
    }

    /// The same in another colour.
    pub(crate) fn coloured(self, color: Spectrum) -> Self {
        Self { color, ..self }
    }

    /// No sheen.
    pub const NONE: Self = Self { color: Spectrum::BLACK, roughness: 1.0 };

    /// The roughness.
    pub fn roughness(&self) -> f32 {
        self.roughness
    }

    /// Whether there is no sheen.
    pub fn is_none(&self) -> bool {
        self.color.is_black()
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().eval(wo.lane(), wi.lane()))
    }

    /// The albedo of a white layer along one direction, by which the layers below are attenuated.
    pub fn share(&self, w: LocalDir) -> f32 {
        self.lane().share(w.lane())
    }

    /// The transmittance to the layers below along one direction.
    pub fn passes(&self, w: LocalDir) -> f32 {
        self.lane().passes(w.lane())
    }

    pub(crate) fn lane(&self) -> SheenLanes<f32> {
        SheenLanes { color: colour_lane(self.color), roughness: self.roughness }
    }
}

/// [`Sheen`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct SheenLanes<R: Real> {
    /// The strength in each channel; black is no sheen.
    pub color: V3<R>,
    /// Within [[`Sheen::MIN_ROUGHNESS`], 1].
    pub roughness: R,
}

impl<R: Real> SheenLanes<R> {
    /// [`Sheen::is_none`].
    #[inline(always)]
    pub fn is_none(&self) -> R::Mask {
        self.color.max_component().simd_eq(R::zero())
    }

    /// [`Sheen::eval`].
    #[inline(always)]
    pub fn eval(&self, wo: V3<R>, wi: V3<R>) -> V3<R> {
        let (at_o, at_i) =
            (ALBEDO.sheen(wo.z.abs(), self.roughness), ALBEDO.sheen(wi.z.abs(), self.roughness));
        let most = at_o.simd_max(at_i).simd_max(R::one());
        let value = self.color * (unbounded(self.roughness, wo, wi) / most);
        value.or_zero(!self.is_none() & (wo.z * wi.z).simd_gt(R::zero()))
    }

    /// [`Sheen::share`].
    #[inline(always)]
    pub fn share(&self, w: V3<R>) -> R {
        ALBEDO.sheen(w.z.abs(), self.roughness).simd_min(R::one())
    }

    /// [`Sheen::passes`].
    #[inline(always)]
    pub fn passes(&self, w: V3<R>) -> R {
        R::select(self.is_none(), R::one(), R::one() - self.color.max_component() * self.share(w))
    }
}

/// D · V · |cos θi| of white fibres, both directions on one side.
#[inline(always)]
pub(crate) fn unbounded<R: Real>(roughness: R, wo: V3<R>, wi: V3<R>) -> R {
    let half = wo + wi;
    let height = half.normalize().z;
    let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
    let exponent = (roughness * roughness).recip();
    let sin = (R::one() - height * height).simd_max(R::zero()).sqrt();
    let density = R::splat(0.5 * FRAC_1_PI) * (R::splat(2.0) + exponent) * pow(sin, exponent);
    let visible = R::splat(0.25) / (cos_o + cos_i - cos_o * cos_i).simd_max(R::splat(1e-9));
    (density * visible * cos_i).or_zero(half.length_squared().simd_gt(R::zero()))
}
