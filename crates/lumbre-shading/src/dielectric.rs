//! Glass: reflection and refraction.

use lumbre_math::{Vec2, Vec3};

use crate::conductor::reflect;
use crate::microfacet::Microfacets;
use crate::specular::Specular;
use crate::{BsdfSample, LocalDir, Scatter, Spectrum, fresnel};

/// An interface between two dielectrics; the shading normal points outside.
///
/// It scatters radiance, which is scaled by η²: transmission is divided by the square of the index of the side
/// of `wi` over that of the side of `wo`. Apart from that it is reciprocal. Smooth, it conserves energy; rough,
/// it has single scattering only and loses some.
///
/// Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Index of refraction, inside over outside; positive.
    pub eta: f32,
    /// Its roughness.
    pub facets: Microfacets,
}

/// A facet that scatters `wo` to `wi`.
pub(crate) struct Facet {
    /// Its normal, pointing up.
    pub normal: Vec3,
    /// Index of the side of `wi` over that of the side of `wo`.
    pub eta: f32,
    /// Its Fresnel reflectance.
    pub fresnel: f32,
    /// |dm/dwi|.
    pub jacobian: f32,
    /// Whether it refracts.
    pub transmits: bool,
}

/// The modes of scattering to consider.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ways {
    Both,
    Transmission,
    Reflection,
}

impl Dielectric {
    /// Whether it is a delta: smooth, or with equal indices.
    pub fn is_delta(&self) -> bool {
        self.facets.is_smooth() || self.eta == 1.0
    }

    /// Index of the other side over that of the side of `w`.
    pub(crate) fn eta_across(&self, w: LocalDir) -> f32 {
        if w.cos_theta() > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// The facet between two directions; `None` where there is none, as for a delta.
    pub(crate) fn facet(&self, wo: LocalDir, wi: LocalDir) -> Option<Facet> {
        let (cos_o, cos_i) = (wo.cos_theta(), wi.cos_theta());
        let sides = cos_o * cos_i;
        if self.is_delta() || sides == 0.0 || sides.is_nan() {
            return None;
        }
        let transmits = sides < 0.0;
        let eta = if transmits { self.eta_across(wo) } else { 1.0 };
        let normal = (wo.vec() + eta * wi.vec()).try_normalize()?;
        let normal = if normal.z < 0.0 { -normal } else { normal };
        let (dot_o, dot_i) = (wo.vec().dot(normal), wi.vec().dot(normal));
        // A facet is visible only from the side of the surface that it faces.
        if dot_o * cos_o <= 0.0 || dot_i * cos_i <= 0.0 {
            return None;
        }
        let jacobian = if transmits {
            let denominator = dot_i + dot_o / eta;
            dot_i.abs() / (denominator * denominator)
        } else {
            0.25 / dot_o.abs()
        };
        Some(Facet { normal, eta, fresnel: fresnel::dielectric(dot_o, self.eta), jacobian, transmits })
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        let Some(facet) = self.facet(wo, wi) else { return 0.0 };
        let share = if facet.transmits { 1.0 - facet.fresnel } else { facet.fresnel };
        share * self.eval_facet(&facet, wo, wi)
    }

    /// f · |cos θi| of a facet that only reflects or only refracts.
    pub(crate) fn eval_facet(&self, facet: &Facet, wo: LocalDir, wi: LocalDir) -> f32 {
        let facets = self.facets.density(facet.normal)
            * self.facets.both_visible_per_cosines(wo.vec(), wi.vec())
            * wo.vec().dot(facet.normal).abs();
        facets * facet.jacobian * wi.abs_cos_theta() / (facet.eta * facet.eta)
    }

    /// The density of [`Dielectric::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.pdf_of(wo, wi, Ways::Both)
    }

    /// The density of [`Dielectric::sample_of`].
    pub(crate) fn pdf_of(&self, wo: LocalDir, wi: LocalDir, ways: Ways) -> f32 {
        let Some(facet) = self.facet(wo, wi) else { return 0.0 };
        let probability = match (ways, facet.transmits) {
            (Ways::Both, true) => 1.0 - facet.fresnel,
            (Ways::Both, false) => facet.fresnel,
            (Ways::Transmission, transmits) => f32::from(transmits && facet.fresnel < 1.0),
            (Ways::Reflection, transmits) => f32::from(!transmits),
        };
        probability * self.facets.visible_density(wo.vec(), facet.normal) * facet.jacobian
    }

    /// A reflection or a refraction, in proportion to their power.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.sample_of(wo, lobe, u, Ways::Both)
    }

    /// [`Dielectric::sample`] restricted to some modes; the weight is for those.
    pub(crate) fn sample_of(&self, wo: LocalDir, lobe: f32, u: Vec2, ways: Ways) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return None;
        }
        let delta = self.is_delta();
        let m = if delta { Vec3::Z } else { self.facets.sample_visible(wo.vec(), u) };
        let reflected = fresnel::dielectric(wo.vec().dot(m), self.eta);
        let (transmits, probability) = match ways {
            Ways::Both if lobe < reflected => (false, reflected),
            Ways::Both => (true, 1.0 - reflected),
            Ways::Transmission => (true, 1.0),
            Ways::Reflection => (false, 1.0),
        };
        let share = if transmits { 1.0 - reflected } else { reflected };
        let eta = if transmits { self.eta_across(wo) } else { 1.0 };
        let wi = if transmits {
            refract(wo, m, eta)?
        } else if delta {
            wo.mirrored()
        } else {
            reflect(wo, m)
        };
        let sides = wo.cos_theta() * wi.cos_theta();
        let on_its_side = if transmits { sides < 0.0 } else { sides > 0.0 };
        if !on_its_side || share == 0.0 {
            return None;
        }
        let weight = share / probability / (eta * eta);
        if delta {
            return Some(BsdfSample {
                wi,
                weight: Spectrum::splat(weight),
                scatter: Scatter::Delta,
                transmitted: transmits,
                eta,
            });
        }
        let jacobian = if transmits {
            let (dot_o, dot_i) = (wo.vec().dot(m), wi.vec().dot(m));
            let denominator = dot_i + dot_o / eta;
            dot_i.abs() / (denominator * denominator)
        } else {
            0.25 / wo.vec().dot(m).abs()
        };
        let pdf = probability * self.facets.visible_density(wo.vec(), m) * jacobian;
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        Some(BsdfSample {
            wi,
            weight: Spectrum::splat(weight * self.facets.also_visible(wo.vec(), wi.vec())),
            scatter: Scatter::Density(pdf),
            transmitted: transmits,
            eta,
        })
    }
}

/// `w` refracted through a facet of normal `m`, where `eta` is the index of the other side over that of the
/// side of `w`. `None` beyond the critical angle.
pub(crate) fn refract(w: LocalDir, m: Vec3, eta: f32) -> Option<LocalDir> {
    let m = if w.vec().dot(m) < 0.0 { -m } else { m };
    let cos_i = w.vec().dot(m);
    let sin2_t = (1.0 - cos_i * cos_i).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return None;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    Some(LocalDir(((cos_i / eta - cos_t) * m - w.vec() / eta).normalize()))
}

/// A pane of glass so thin that transmission is not displaced: a delta, with all reflections between its faces
/// summed. Conserves energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinDielectric {
    /// Index of the pane over that of its surroundings, positive.
    pub eta: f32,
}

impl ThinDielectric {
    /// The reflectance R + T² R + T² R³ + … = 2R / (1 + R) with T = 1 − R.
    pub fn reflected(&self, cos: f32) -> f32 {
        let once = fresnel::dielectric(cos.abs(), self.eta);
        2.0 * once / (1.0 + once)
    }

    /// The reflection and the transmission, each with its power.
    pub(crate) fn specular(&self, wo: LocalDir) -> Specular {
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return Specular::new();
        }
        let reflected = self.reflected(wo.cos_theta());
        [(wo.mirrored(), reflected, false), (-wo, 1.0 - reflected, true)]
            .into_iter()
            .filter(|&(_, share, _)| share > 0.0)
            .map(|(wi, share, transmitted)| BsdfSample {
                wi,
                weight: Spectrum::splat(share),
                scatter: Scatter::Delta,
                transmitted,
                eta: 1.0,
            })
            .collect()
    }

    /// A reflection, or transmission straight on.
    pub fn sample(&self, wo: LocalDir, lobe: f32) -> Option<BsdfSample> {
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return None;
        }
        let transmitted = lobe >= self.reflected(wo.cos_theta());
        Some(BsdfSample {
            wi: if transmitted { -wo } else { wo.mirrored() },
            weight: Spectrum::WHITE,
            scatter: Scatter::Delta,
            transmitted,
            eta: 1.0,
        })
    }
}
