//! Skin, wax, milk: a dielectric boundary around a dense medium, through which light wanders.
//!
//! Light enters as into glass. Inside, a path takes steps through the medium ([`SubsurfaceParams::medium`]); at the
//! boundary it is reflected back as Fresnel has it ([`SubsurfaceParams::reflected_inside`]), or leaves. What leaves is
//! spread as even light from below the boundary would be, whatever way it came: after many collisions it has forgotten
//! that, and so lights of any size can be sampled from the boundary. H. W. Jensen, S. Marschner, M. Levoy, P. Hanrahan
//! ("A Practical Model for Subsurface Light Transport", SIGGRAPH 2001) spread it alike, but replace the way inside by a
//! table of a flat, deep medium.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use lumbre_math::Vec2;
use lumbre_simd::{Mask, Real, V3};

use crate::dielectric::{Dielectric, DielectricLanes};
use crate::diffuse::cosine_direction;
use crate::lanes::{LaneBsdf, LaneSample, field, spectrum, square};
use crate::material::{Roughness, index};
use crate::microfacet::FacetLanes;
use crate::{BsdfSample, HomogeneousMedium, LocalDir, Spectrum, SpectrumTexture, TextureContext, fresnel};

/// What the medium inside is made of.
#[derive(Clone, Debug)]
pub enum Inside {
    /// By its coefficients, per unit of length in the world.
    Coefficients {
        /// σ_a.
        absorption: Arc<SpectrumTexture>,
        /// σ_s.
        scattering: Arc<SpectrumTexture>,
    },
    /// By the share of the light that enters a flat, deep body and comes out again, and by the mean free path.
    Reflectance {
        /// In [0, 1].
        reflectance: Arc<SpectrumTexture>,
        /// In units of length in the world, positive.
        mean_free_path: Arc<SpectrumTexture>,
    },
}

/// The parameters of `subsurface`.
#[derive(Clone, Debug)]
pub struct SubsurfaceParams {
    /// The medium.
    pub inside: Inside,
    /// A factor on coefficients, and on mean free paths: they act in opposite directions.
    pub scale: f32,
    /// Henyey–Greenstein asymmetry of the medium.
    pub asymmetry: f32,
    /// Index of refraction, inside over outside.
    pub eta: f32,
    /// Roughness of the boundary, from outside; from inside it is smooth.
    pub roughness: Roughness,
}

/// The least mean free path, against divisions by 0.
const MIN_PATH: f32 = 1e-9;

impl SubsurfaceParams {
    /// The medium that light enters at a position. What is out of range is clamped.
    pub fn medium(&self, at: &TextureContext) -> HomogeneousMedium {
        let asymmetry = if self.asymmetry.is_nan() { 0.0 } else { self.asymmetry.clamp(-0.999, 0.999) };
        let not_negative = |c: f32| if c > 0.0 { c.min(f32::MAX) } else { 0.0 };
        match &self.inside {
            Inside::Coefficients { absorption, scattering } => {
                let absorption = absorption.evaluate_unbounded(at).map(not_negative);
                let scattering = scattering.evaluate_unbounded(at).map(not_negative);
                let extinction = absorption + scattering;
                let albedo = scattering.zip(extinction, |s, t| if t > 0.0 { s / t } else { 0.0 });
                HomogeneousMedium { extinction: extinction * self.scale, albedo, asymmetry }
            }
            Inside::Reflectance { reflectance, mean_free_path } => {
                let path = mean_free_path.evaluate_unbounded(at) * self.scale;
                let extinction = path.map(|path| 1.0 / path.max(MIN_PATH));
                // The share of even light from inside that the boundary reflects back.
                let back = 1.0 - transmitted_from_outside(index(self.eta)) / index(self.eta).powi(2);
                let albedo =
                    reflectance.evaluate(at).map(|c| albedo_of_body(crate::unit(c), back, asymmetry));
                HomogeneousMedium { extinction, albedo, asymmetry }
            }
        }
    }

    /// The share of light that the boundary reflects back inside, by the cosine of its incidence.
    pub fn reflected_inside(&self, cos: f32) -> f32 {
        fresnel::dielectric(-cos.abs().max(f32::MIN_POSITIVE), index(self.eta))
    }

    pub(crate) fn bsdf(&self, at: &TextureContext) -> Subsurface {
        let eta = index(self.eta);
        Subsurface {
            face: Dielectric { eta, facets: self.roughness.facets(at) },
            transmitted: transmitted_from_outside(eta),
        }
    }
}

/// The single-scattering albedo of a deep body of this asymmetry which gives back this share of the light that enters
/// it head on, where its boundary reflects the share `back` of even light from inside.
///
/// Found by bisection of the reflectance of a half-space without a boundary, for light head on and for even light (B.
/// Hapke, "Theory of Reflectance and Emittance Spectroscopy", 2nd ed., 2012, chapters 8 and 10), with the reflections
/// at the boundary summed; asymmetry by similarity.
fn albedo_of_body(reflectance: f32, back: f32, asymmetry: f32) -> f32 {
    let (wanted, back) = (f64::from(reflectance), f64::from(back));
    // By γ = √(1 − albedo), in which the share falls from 1 to 0.
    let share = |gamma: f64| {
        let albedo = 1.0 - gamma * gamma;
        let r0 = (1.0 - gamma) / (1.0 + gamma);
        let h = 1.0 / (1.0 - albedo * (r0 + (0.5 - r0) * std::f64::consts::LN_2));
        let head_on = 1.0 - h * gamma;
        let even = r0 * (1.0 - gamma / (3.0 * (1.0 + gamma)));
        (1.0 - back) * head_on / (1.0 - back * even)
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..32 {
        let middle = 0.5 * (low + high);
        if share(middle) > wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    let albedo = 1.0 - low * low;
    let g = f64::from(asymmetry);
    (albedo / (1.0 - g + g * albedo)) as f32
}

/// The share of even light from outside that comes through a smooth boundary: 1 − 2 ∫ F(μ) μ dμ, by Simpson's rule over
/// √(1 − μ), in which the integrand is smooth at grazing angles.
fn transmitted_from_outside(eta: f32) -> f32 {
    const STEPS: usize = 64;
    let integrand = |i: usize| {
        let x = i as f64 / STEPS as f64;
        let mu = 1.0 - x * x;
        let reflected = if i == STEPS { 1.0 } else { f64::from(fresnel::dielectric(mu as f32, eta)) };
        (1.0 - reflected) * mu * 2.0 * x
    };
    let weight = |i: usize| match i {
        0 | STEPS => 1.0,
        i if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let sum: f64 = (0..=STEPS).map(|i| weight(i) * integrand(i)).sum();
    (2.0 * sum / (3.0 * STEPS as f64)) as f32
}

/// The boundary of such a body. From outside it is a [`Dielectric`]; of light from inside it is only told how it
/// leaves, since who follows it has already chosen between leaving and [`SubsurfaceParams::reflected_inside`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subsurface {
    /// The boundary from outside.
    pub face: Dielectric,
    /// The share of even light from outside that comes through it.
    pub(crate) transmitted: f32,
}

impl Subsurface {
    /// A boundary of this index of refraction and roughness.
    pub fn new(face: Dielectric) -> Self {
        Self { face, transmitted: transmitted_from_outside(face.eta) }
    }

    /// f · |cos θi|.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().eval(wo.lane(), wi.lane()).0)
    }

    /// The density of [`Subsurface::sample`].
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().eval(wo.lane(), wi.lane()).1
    }

    /// From outside as [`Dielectric::sample`]; from inside a direction outside.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), lobe, square(u)).scalar()
    }

    fn lane(&self) -> SubsurfaceLanes<f32> {
        SubsurfaceLanes { face: self.face.lane(), transmitted: self.transmitted }
    }

    pub(crate) fn row(&self) -> [f32; 4] {
        let [eta, x, y] = self.face.row();
        [eta, x, y, self.transmitted]
    }
}

/// [`Subsurface`] over lanes.
#[derive(Clone, Copy, Debug)]
pub struct SubsurfaceLanes<R: Real> {
    /// The boundary from outside.
    pub face: DielectricLanes<R>,
    transmitted: R,
}

impl<R: Real> SubsurfaceLanes<R> {
    /// What leaves towards a direction outside, over that of a perfect diffuser: light in the denser medium counts η²
    /// more.
    #[inline(always)]
    fn leaving(&self, wi: V3<R>) -> R {
        let eta = self.face.eta;
        let through = R::one() - fresnel::dielectric(wi.z, eta);
        eta * eta * through / self.transmitted
    }
}

impl<R: Real> LaneBsdf<R> for SubsurfaceLanes<R> {
    const ROW: usize = 4;

    #[inline(always)]
    fn load(table: &[f32], at: R::UInt) -> Self {
        let facets = FacetLanes { alpha_x: field(table, at, 1), alpha_y: field(table, at, 2) };
        Self { face: DielectricLanes { eta: field(table, at, 0), facets }, transmitted: field(table, at, 3) }
    }

    #[inline(always)]
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R) {
        let (value, pdf) = self.face.eval(wo, wi);
        let from_inside = wo.z.simd_lt(R::zero());
        let leaves = from_inside & wi.z.simd_gt(R::zero());
        let even = (R::splat(FRAC_1_PI) * wi.z).or_zero(leaves);
        let leaving = V3::splat(self.leaving(wi) * even);
        (V3::select(from_inside, leaving, value), R::select(from_inside, even, pdf))
    }

    #[inline(always)]
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R> {
        let outside = self.face.sample(wo, lobe, u);
        let from_inside = wo.z.simd_lt(R::zero());
        if from_inside.none() {
            return outside;
        }
        let wi = cosine_direction(u, R::one());
        LaneSample {
            wi: V3::select(from_inside, wi, outside.wi),
            weight: V3::select(from_inside, V3::splat(self.leaving(wi)), outside.weight),
            pdf: R::select(from_inside, R::splat(FRAC_1_PI) * wi.z, outside.pdf),
            valid: from_inside | outside.valid,
            delta: outside.delta & !from_inside,
            transmitted: from_inside | outside.transmitted,
            eta: R::select(from_inside, self.face.eta.recip(), outside.eta),
        }
    }

    #[inline(always)]
    fn is_delta(&self) -> R::Mask {
        R::Mask::splat(false)
    }

    #[inline(always)]
    fn regularized(self, mask: R::Mask) -> Self {
        Self { face: self.face.regularized(mask), ..self }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use lumbre_math::DVec3;

    use super::*;
    use crate::{Texture, VertexData};

    fn params(inside: Inside, scale: f32) -> SubsurfaceParams {
        SubsurfaceParams { inside, scale, asymmetry: 0.0, eta: 1.33, roughness: Roughness::smooth() }
    }

    fn constant(r: f32, g: f32, b: f32) -> Arc<SpectrumTexture> {
        Arc::new(Texture::Constant(Spectrum::new(r, g, b)))
    }

    fn here() -> TextureContext {
        TextureContext {
            point: DVec3::ONE,
            normal: lumbre_math::Vec3::Z,
            uv: Vec2::ZERO,
            dpdx: lumbre_math::Vec3::ZERO,
            dpdy: lumbre_math::Vec3::ZERO,
            duv_dx: Vec2::ZERO,
            duv_dy: Vec2::ZERO,
            vertex: VertexData::NONE,
            spectral: None,
        }
    }

    #[test]
    fn even_light_passes_a_boundary_as_often_as_tables_say() {
        // Egan and Hilgeman, "Optical Properties of Inhomogeneous Materials", 1979: 1 − 0.0664 for 1.33, 1 − 0.0918 for
        // 1.5.
        for (eta, reflected) in [(1.33, 0.0664), (1.5, 0.0918), (1.0, 0.0)] {
            let passes = transmitted_from_outside(eta);
            assert!((1.0 - passes - reflected).abs() < 1e-3, "{eta}: {passes}");
        }
    }

    #[test]
    fn scale_makes_coefficients_larger_and_mean_free_paths_longer() {
        let coefficients =
            Inside::Coefficients { absorption: constant(1.0, 0.0, 3.0), scattering: constant(1.0, 2.0, 1.0) };
        let medium = params(coefficients, 10.0).medium(&here());
        assert_eq!(medium.extinction, Spectrum::new(20.0, 20.0, 40.0));
        assert_eq!(medium.albedo, Spectrum::new(0.5, 1.0, 0.25));
        let path = Inside::Reflectance {
            reflectance: constant(0.0, 0.5, 1.0),
            mean_free_path: constant(0.5, 0.25, 0.125),
        };
        let medium = params(path, 4.0).medium(&here());
        assert_eq!(medium.extinction, Spectrum::new(0.5, 1.0, 2.0));
        assert!(medium.albedo.r < 0.01 && medium.albedo.b > 0.999, "{medium:?}");
    }

    #[test]
    fn reflectance_matches_photon_beam_diffusion() {
        // Reflectances by that method, for an index of 1.33, of these albedos.
        for (albedo, reflectance) in [(0.8, 0.185_72), (0.9, 0.295_57), (0.95, 0.414_82), (0.99, 0.672_73)] {
            let inside = Inside::Reflectance {
                reflectance: constant(reflectance, reflectance, reflectance),
                mean_free_path: constant(1.0, 1.0, 1.0),
            };
            let found = params(inside, 1.0).medium(&here()).albedo.g;
            assert!((found - albedo).abs() < 0.3 * (1.0 - albedo), "{albedo}: {found}");
        }
    }
}
