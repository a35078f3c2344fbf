//! Metals, smooth or rough.

use lumbre_math::Vec2;
use lumbre_simd::{Mask, Real, V3};

use crate::lanes::{LaneBsdf, LaneSample, colour, colour_lane, field, spectrum, square};
use crate::microfacet::{FacetLanes, Microfacets};
use crate::{BsdfSample, LocalDir, Spectrum, fresnel};

/// A metal by its complex index of refraction. Smooth, it is a delta; rough, it has single scattering only, so
/// it loses energy as α grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor {
    /// Real part of the index; negative in a channel that reflects more than all ([`fresnel::conductor_channel`]).
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
        spectrum(self.lane().fresnel(cos))
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().eval(wo.lane(), wi.lane()).0)
    }

    /// The density of [`Conductor::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).1
    }

    /// A reflection in a visible facet.
    pub fn sample(&self, wo: LocalDir, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), 0.0, square(u)).scalar()
    }

    pub(crate) fn lane(&self) -> ConductorLanes<f32> {
        ConductorLanes { eta: colour_lane(self.eta), k: colour_lane(self.k), facets: self.facets.lane() }
    }

    pub(crate) fn row(&self) -> [f32; 8] {
        let ([a, b, c], [d, e, f]) = (self.eta.to_array(), self.k.to_array());
        let alpha = self.facets.alpha();
        [a, b, c, d, e, f, alpha.x, alpha.y]
    }
}

/// [`Conductor`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct ConductorLanes<R: Real> {
    /// Real part of the index.
    pub eta: V3<R>,
    /// Imaginary part of the index.
    pub k: V3<R>,
    /// Its roughness.
    pub facets: FacetLanes<R>,
}

impl<R: Real> ConductorLanes<R> {
    /// [`Conductor::fresnel`].
    #[inline(always)]
    pub fn fresnel(&self, cos: R) -> V3<R> {
        fresnel::conductor_lanes(cos.abs(), self.eta, self.k)
    }

    /// [`Conductor::pdf`].
    #[inline(always)]
    pub(crate) fn pdf(&self, wo: V3<R>, wi: V3<R>) -> R {
        let (density, fits) = self.facet_density(wo, wi);
        (density * self.facets.visible_per_cosine(wo)).or_zero(fits)
    }

    /// A quarter of the density of the facets that reflect one direction into the other, and where there are any.
    #[inline(always)]
    fn facet_density(&self, wo: V3<R>, wi: V3<R>) -> (R, R::Mask) {
        let half = wo + wi;
        let fits = !self.facets.is_smooth()
            & (wo.z * wi.z).simd_gt(R::zero())
            & half.length_squared().simd_gt(R::zero());
        (R::splat(0.25) * self.facets.density(half.normalize()), fits)
    }
}

impl<R: Real> LaneBsdf<R> for ConductorLanes<R> {
    const ROW: usize = 8;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        let facets = FacetLanes { alpha_x: field(table, at, 6), alpha_y: field(table, at, 7) };
        Self { eta: colour(table, at, 0), k: colour(table, at, 3), facets }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        if self.facets.is_smooth().all() {
            return (V3::splat(R::zero()), R::zero());
        }
        let (density, fits) = self.facet_density(wo, wi);
        let m = (wo + wi).normalize();
        let both = self.facets.both_visible_per_cosines(wo, wi);
        let value = self.fresnel(wo.dot(m)) * (density * both * wi.z.abs());
        (value.or_zero(fits), (density * self.facets.visible_per_cosine(wo)).or_zero(fits))
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, _: R, u: [R; 2]) -> LaneSample<R> {
        let smooth = self.facets.is_smooth();
        let mut m = V3::constant([0.0, 0.0, 1.0]);
        let (mut wi, mut also_visible, mut pdf) = (mirrored(wo), R::one(), R::one());
        if !smooth.all() {
            m = V3::select(smooth, m, self.facets.sample_visible(wo, u));
            wi = V3::select(smooth, wi, reflect(wo, m));
            also_visible = R::select(smooth, also_visible, self.facets.also_visible(wo, wi));
            let density = R::splat(0.25) * self.facets.density(m) * self.facets.visible_per_cosine(wo);
            pdf = R::select(smooth, pdf, density);
        }
        LaneSample {
            wi,
            weight: self.fresnel(wo.dot(m)) * also_visible,
            pdf,
            valid: (wo.z * wi.z).simd_gt(R::zero()),
            delta: smooth,
            transmitted: R::Mask::splat(false),
            eta: R::one(),
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        self.facets.is_smooth()
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        Self { facets: self.facets.regularized(mask), ..self }
    }
}

/// The mirror reflection in the surface.
#[inline(always)]
pub(crate) fn mirrored<R: Real>(w: V3<R>) -> V3<R> {
    V3::new(-w.x, -w.y, w.z)
}

/// `w` mirrored about the unit normal `m`.
#[inline(always)]
pub(crate) fn reflect<R: Real>(w: V3<R>, m: V3<R>) -> V3<R> {
    (m * (R::splat(2.0) * w.dot(m)) - w).normalize()
}
