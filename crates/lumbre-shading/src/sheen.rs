//! Sheen of cloth: upright fibres that scatter backwards and at grazing angles.

use std::f32::consts::FRAC_1_PI;

use crate::albedo::ALBEDO;
use crate::{LocalDir, Spectrum};
use lumbre_math::Elementary;

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
        if self.is_none() || !wo.same_hemisphere(wi) {
            return Spectrum::BLACK;
        }
        let at = |w: LocalDir| ALBEDO.sheen(w.abs_cos_theta(), self.roughness);
        let most = at(wo).max(at(wi)).max(1.0);
        self.color * (unbounded(self.roughness, wo, wi) / most)
    }

    /// The albedo of a white layer along one direction, by which the layers below are attenuated.
    pub fn share(&self, w: LocalDir) -> f32 {
        ALBEDO.sheen(w.abs_cos_theta(), self.roughness).min(1.0)
    }

    /// The transmittance to the layers below along one direction.
    pub fn passes(&self, w: LocalDir) -> f32 {
        if self.is_none() { 1.0 } else { 1.0 - self.color.max_component() * self.share(w) }
    }
}

/// D · V · |cos θi| of white fibres, both directions on one side.
pub(crate) fn unbounded(roughness: f32, wo: LocalDir, wi: LocalDir) -> f32 {
    let Some(half) = (wo.vec() + wi.vec()).try_normalize() else { return 0.0 };
    let (cos_o, cos_i) = (wo.abs_cos_theta(), wi.abs_cos_theta());
    let exponent = 1.0 / (roughness * roughness);
    let sin = (1.0 - half.z * half.z).max(0.0).sqrt();
    let density = 0.5 * FRAC_1_PI * (2.0 + exponent) * sin.power(exponent);
    let visible = 0.25 / (cos_o + cos_i - cos_o * cos_i).max(1e-9);
    density * visible * cos_i
}
