//! Glass: reflection and refraction.

use lumbre_math::Vec2;
use lumbre_simd::{Mask, Real, V3};

use crate::conductor::{mirrored, reflect};
use crate::diffuse::has_side;
use crate::lanes::{LaneBsdf, LaneSample, field, square};
use crate::microfacet::{FacetLanes, Microfacets};
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
        self.lane().is_delta()
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).0.x
    }

    /// The density of [`Dielectric::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.pdf_of(wo, wi, Ways::Both)
    }

    /// The density of [`Dielectric::sample_of`].
    pub(crate) fn pdf_of(&self, wo: LocalDir, wi: LocalDir, ways: Ways) -> f32 {
        self.lane().pdf_of(wo.lane(), wi.lane(), ways)
    }

    /// A reflection or a refraction, in proportion to their power.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.sample_of(wo, lobe, u, Ways::Both)
    }

    /// [`Dielectric::sample`] restricted to some modes; the weight is for those.
    pub(crate) fn sample_of(&self, wo: LocalDir, lobe: f32, u: Vec2, ways: Ways) -> Option<BsdfSample> {
        self.lane().sample_of(wo.lane(), lobe, square(u), ways).scalar()
    }

    pub(crate) fn lane(&self) -> DielectricLanes<f32> {
        DielectricLanes { eta: self.eta, facets: self.facets.lane() }
    }

    pub(crate) fn row(&self) -> [f32; 3] {
        let alpha = self.facets.alpha();
        [self.eta, alpha.x, alpha.y]
    }
}

/// [`Dielectric`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct DielectricLanes<R: Real> {
    /// Index of refraction, inside over outside.
    pub eta: R,
    /// Its roughness.
    pub facets: FacetLanes<R>,
}

/// A facet that scatters `wo` to `wi`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet<R: Real> {
    /// Its normal, pointing up.
    pub(crate) normal: V3<R>,
    /// Index of the side of `wi` over that of the side of `wo`.
    pub(crate) eta: R,
    /// Its Fresnel reflectance.
    pub(crate) fresnel: R,
    /// |dm/dwi|.
    pub(crate) jacobian: R,
    /// Whether it refracts.
    pub(crate) transmits: R::Mask,
}

impl<R: Real> DielectricLanes<R> {
    /// Index of the other side over that of the side of `w`.
    #[inline(always)]
    fn eta_across(&self, w: V3<R>) -> R {
        R::select(w.z.simd_gt(R::zero()), self.eta, self.eta.recip())
    }

    /// |dm/dwi| for a facet of normal `m`, where `eta` is the index of the side of `wi` over that of the side of `wo`.
    #[inline(always)]
    fn jacobian(wo: V3<R>, wi: V3<R>, m: V3<R>, eta: R, transmits: R::Mask) -> R {
        let (dot_o, dot_i) = (wo.dot(m), wi.dot(m));
        let denominator = dot_i + dot_o / eta;
        let refraction = dot_i.abs() / (denominator * denominator);
        R::select(transmits, refraction, R::splat(0.25) / dot_o.abs())
    }

    /// The facet between two directions, and where there is one: not for a delta.
    #[inline(always)]
    pub(crate) fn facet(&self, wo: V3<R>, wi: V3<R>) -> (Facet<R>, R::Mask) {
        let sides = wo.z * wi.z;
        let transmits = sides.simd_lt(R::zero());
        let eta = R::select(transmits, self.eta_across(wo), R::one());
        let sum = wo + wi * eta;
        let normal = sum.normalize();
        let normal = V3::select(normal.z.simd_lt(R::zero()), -normal, normal);
        let (dot_o, dot_i) = (wo.dot(normal), wi.dot(normal));
        // A facet is visible only from the side of the surface that it faces.
        let fits = !self.is_delta()
            & sides.abs().simd_gt(R::zero())
            & sum.length_squared().simd_gt(R::zero())
            & (dot_o * wo.z).simd_gt(R::zero())
            & (dot_i * wi.z).simd_gt(R::zero());
        let jacobian = Self::jacobian(wo, wi, normal, eta, transmits);
        let fresnel = fresnel::dielectric(dot_o, self.eta);
        (Facet { normal, eta, fresnel, jacobian, transmits }, fits)
    }

    /// f · |cos θi| of a facet that only reflects or only refracts.
    #[inline(always)]
    pub(crate) fn eval_facet(&self, facet: &Facet<R>, wo: V3<R>, wi: V3<R>) -> R {
        let facets = self.facets.density(facet.normal)
            * self.facets.both_visible_per_cosines(wo, wi)
            * wo.dot(facet.normal).abs();
        facets * facet.jacobian * wi.z.abs() / (facet.eta * facet.eta)
    }

    /// The density of [`DielectricLanes::sample_of`].
    #[inline(always)]
    pub(crate) fn pdf_of(&self, wo: V3<R>, wi: V3<R>, ways: Ways) -> R {
        if self.is_delta().all() {
            return R::zero();
        }
        let (facet, fits) = self.facet(wo, wi);
        self.pdf_of_facet(&facet, wo, ways).or_zero(fits)
    }

    #[inline(always)]
    fn pdf_of_facet(&self, facet: &Facet<R>, wo: V3<R>, ways: Ways) -> R {
        let probability = match ways {
            Ways::Both => R::select(facet.transmits, R::one() - facet.fresnel, facet.fresnel),
            Ways::Transmission => R::one().or_zero(facet.transmits & facet.fresnel.simd_lt(R::one())),
            Ways::Reflection => R::one().or_zero(!facet.transmits),
        };
        probability * self.facets.visible_density(wo, facet.normal) * facet.jacobian
    }

    /// [`LaneBsdf::sample`] restricted to some modes; the weight is for those.
    #[inline(always)]
    pub(crate) fn sample_of(&self, wo: V3<R>, lobe: R, u: [R; 2], ways: Ways) -> LaneSample<R> {
        let delta = self.is_delta();
        let is_rough = !delta;
        let mut m = V3::constant([0.0, 0.0, 1.0]);
        if is_rough.any() {
            m = V3::select(delta, m, self.facets.sample_visible(wo, u));
        }
        let reflected = fresnel::dielectric(wo.dot(m), self.eta);
        let (transmits, probability) = match ways {
            Ways::Both => {
                let reflects = lobe.simd_lt(reflected);
                (!reflects, R::select(reflects, reflected, R::one() - reflected))
            }
            Ways::Transmission => (R::Mask::splat(true), R::one()),
            Ways::Reflection => (R::Mask::splat(false), R::one()),
        };
        let share = R::select(transmits, R::one() - reflected, reflected);
        let eta = R::select(transmits, self.eta_across(wo), R::one());
        let mut wi = mirrored(wo);
        if (is_rough & !transmits).any() {
            wi = V3::select(delta, wi, reflect(wo, m));
        }
        let mut refracts = R::Mask::splat(false);
        if transmits.any() {
            let (refracted, is_refracted) = refract(wo, m, eta);
            wi = V3::select(transmits, refracted, wi);
            refracts = is_refracted;
        }
        let sides = wo.z * wi.z;
        let on_its_side =
            (transmits & refracts & sides.simd_lt(R::zero())) | (!transmits & sides.simd_gt(R::zero()));
        let mut weight = share / probability / (eta * eta);
        let mut pdf = R::one();
        if is_rough.any() {
            let density =
                probability * self.facets.visible_density(wo, m) * Self::jacobian(wo, wi, m, eta, transmits);
            pdf = R::select(delta, pdf, density);
            weight = R::select(delta, weight, weight * self.facets.also_visible(wo, wi));
        }
        LaneSample {
            wi,
            weight: V3::splat(weight),
            pdf,
            valid: on_its_side & share.simd_ne(R::zero()) & pdf.simd_gt(R::zero()) & pdf.is_finite(),
            delta,
            transmitted: transmits,
            eta,
        }
    }
}

impl<R: Real> LaneBsdf<R> for DielectricLanes<R> {
    const ROW: usize = 3;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        let facets = FacetLanes { alpha_x: field(table, at, 1), alpha_y: field(table, at, 2) };
        Self { eta: field(table, at, 0), facets }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        if self.is_delta().all() {
            return (V3::splat(R::zero()), R::zero());
        }
        let (facet, fits) = self.facet(wo, wi);
        let share = R::select(facet.transmits, R::one() - facet.fresnel, facet.fresnel);
        let value = share * self.eval_facet(&facet, wo, wi);
        let pdf = self.pdf_of_facet(&facet, wo, Ways::Both);
        (V3::splat(value.or_zero(fits)), pdf.or_zero(fits))
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        self.sample_of(wo, lobe, u, Ways::Both)
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        self.facets.is_smooth() | self.eta.simd_eq(R::one())
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        Self { facets: self.facets.regularized(mask), ..self }
    }
}

/// `w` refracted through a facet of normal `m`, where `eta` is the index of the other side over that of the
/// side of `w`; and where there is a refraction: not beyond the critical angle.
#[inline(always)]
pub(crate) fn refract<R: Real>(w: V3<R>, m: V3<R>, eta: R) -> (V3<R>, R::Mask) {
    let m = V3::select(w.dot(m).simd_lt(R::zero()), -m, m);
    let cos_i = w.dot(m);
    let sin2_t = (R::one() - cos_i * cos_i).simd_max(R::zero()) / (eta * eta);
    let cos_t = (R::one() - sin2_t).simd_max(R::zero()).sqrt();
    let refracted = (m * (cos_i / eta - cos_t) - w / eta).normalize();
    (refracted, sin2_t.simd_lt(R::one()))
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
        ThinDielectricLanes { eta: self.eta }.reflected(cos)
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
        ThinDielectricLanes { eta: self.eta }.sample(wo.lane(), lobe, [0.0; 2]).scalar()
    }
}

/// [`ThinDielectric`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectricLanes<R: Real> {
    /// Index of the pane over that of its surroundings.
    pub eta: R,
}

impl<R: Real> ThinDielectricLanes<R> {
    /// [`ThinDielectric::reflected`].
    #[inline(always)]
    pub fn reflected(&self, cos: R) -> R {
        let once = fresnel::dielectric(cos.abs(), self.eta);
        R::splat(2.0) * once / (R::one() + once)
    }
}

impl<R: Real> LaneBsdf<R> for ThinDielectricLanes<R> {
    const ROW: usize = 1;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        Self { eta: field(table, at, 0) }
    }

    #[inline(always)]
    fn eval(&self, _: V3<R>, _: V3<R>) -> (V3<R>, R) {
        (V3::splat(R::zero()), R::zero())
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, _: [R; 2]) -> LaneSample<R> {
        let transmitted = lobe.simd_ge(self.reflected(wo.z));
        LaneSample {
            wi: V3::select(transmitted, -wo, mirrored(wo)),
            weight: V3::splat(R::one()),
            pdf: R::one(),
            valid: has_side(wo),
            delta: R::Mask::splat(true),
            transmitted,
            eta: R::one(),
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        R::Mask::splat(true)
    }

    #[inline(always)]
    fn regularized(self, _: R::Mask) -> Self {
        self
    }
}
