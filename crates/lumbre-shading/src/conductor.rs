//! Metals, smooth or rough.

use lumbre_math::{Vec2, Vec3};

use crate::microfacet::Microfacets;
use crate::{BsdfSample, LocalDir, Scatter, Spectrum, fresnel};

/// A metal by its complex index of refraction. Smooth, it is a delta; rough, it has single scattering only, so
/// it loses energy as α grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor {
    /// Real part of the index.
    pub eta: Spectrum,
    /// Imaginary part of the index, ≥ 0; infinite reflects everything.
    pub k: Spectrum,
    /// Its roughness.
    pub facets: Microfacets,
}

impl Conductor {
    /// The metal with the reflectance `reflectance`, in [0, 1], at normal incidence.
    pub fn from_reflectance(reflectance: Spectrum, facets: Microfacets) -> Self {
        Self { eta: Spectrum::WHITE, k: reflectance.map(fresnel::k_from_reflectance), facets }
    }

    /// The reflectance at this cosine of incidence.
    pub fn fresnel(&self, cos: f32) -> Spectrum {
        fresnel::conductor(cos.abs(), self.eta, self.k)
    }

    /// The normal of the facets that reflect one direction into the other, pointing up.
    fn half(&self, wo: LocalDir, wi: LocalDir) -> Option<Vec3> {
        if self.facets.is_smooth() || !wo.same_hemisphere(wi) {
            return None;
        }
        let half = (wo.vec() + wi.vec()).try_normalize()?;
        Some(if half.z < 0.0 { -half } else { half })
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        let Some(m) = self.half(wo, wi) else { return Spectrum::BLACK };
        let both = self.facets.both_visible_per_cosines(wo.vec(), wi.vec());
        self.fresnel(wo.vec().dot(m)) * (0.25 * self.facets.density(m) * both * wi.abs_cos_theta())
    }

    /// The density of [`Conductor::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let Some(m) = self.half(wo, wi) else { return 0.0 };
        0.25 * self.facets.density(m) * self.facets.visible_per_cosine(wo.vec())
    }

    /// A reflection in a visible facet.
    pub fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return None;
        }
        if self.facets.is_smooth() {
            return Some(BsdfSample {
                wi: wo.mirrored(),
                weight: self.fresnel(wo.cos_theta()),
                scatter: Scatter::Delta,
                transmitted: false,
                eta: 1.0,
            });
        }
        let m = self.facets.sample_visible(wo.vec(), u);
        let wi = reflect(wo, m);
        if !wo.same_hemisphere(wi) {
            return None;
        }
        Some(BsdfSample {
            wi,
            weight: self.fresnel(wo.vec().dot(m)) * self.facets.also_visible(wo.vec(), wi.vec()),
            scatter: Scatter::Density(
                0.25 * self.facets.density(m) * self.facets.visible_per_cosine(wo.vec()),
            ),
            transmitted: false,
            eta: 1.0,
        })
    }
}

/// `w` mirrored about the unit normal `m`.
pub(crate) fn reflect(w: LocalDir, m: Vec3) -> LocalDir {
    LocalDir((2.0 * w.vec().dot(m) * m - w.vec()).normalize())
}
