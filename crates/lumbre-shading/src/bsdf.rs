//! The closed set of BSDFs: how a surface scatters between two directions.

use lumbre_math::Vec2;

use crate::coated::{Coat, CoatedConductor, CoatedDiffuse};
use crate::conductor::Conductor;
use crate::dielectric::{Dielectric, ThinDielectric};
use crate::diffuse::{Diffuse, DiffuseTransmission};
use crate::principled::Principled;
use crate::{LocalDir, Spectrum};

/// How a direction was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scatter {
    /// With this density per unit solid angle.
    Density(f32),
    /// As the only direction possible: a mirror has no density, and nothing can ask it for one.
    Delta,
}

/// A direction that a BSDF chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where light would come from.
    pub wi: LocalDir,
    /// f · |cos θi| / pdf, ready to multiply a path's throughput.
    pub weight: Spectrum,
    /// How it was chosen.
    pub scatter: Scatter,
    /// Whether it crosses the surface.
    pub transmitted: bool,
    /// η of the side it enters over that of the side it leaves, 1 where it reflects (or crosses without bending).
    pub eta: f32,
}

/// How a surface scatters at one point. Both directions leave the surface.
///
/// Which conserve energy: [`Diffuse`] of reflectance 1, [`DiffuseTransmission`] whose shares sum to 1, a smooth
/// [`Dielectric`] (counting η²), [`ThinDielectric`], and a smooth [`Conductor`] of reflectance 1. Rough metal and glass
/// count single scattering between facets only, and lose some; [`Principled`] gives it back.
#[derive(Clone, Debug, PartialEq)]
pub enum Bsdf {
    /// Lambert.
    Diffuse(Diffuse),
    /// Lambert on both sides.
    DiffuseTransmission(DiffuseTransmission),
    /// Metal.
    Conductor(Conductor),
    /// Glass.
    Dielectric(Dielectric),
    /// A pane of glass.
    ThinDielectric(ThinDielectric),
    /// Paint under varnish.
    CoatedDiffuse(CoatedDiffuse),
    /// Metal under varnish.
    CoatedConductor(CoatedConductor),
    /// Layers of all these; boxed, for all others are a quarter of its size, and copied often.
    Principled(Box<Principled>),
}

impl Bsdf {
    /// f(wo, wi) · |cos θi|; zero for delta parts. Radiance flows from `wi` to `wo`.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        match self {
            Self::Diffuse(bsdf) => bsdf.eval(wo, wi),
            Self::DiffuseTransmission(bsdf) => bsdf.eval(wo, wi),
            Self::Conductor(bsdf) => bsdf.eval(wo, wi),
            Self::Dielectric(bsdf) => Spectrum::splat(bsdf.eval(wo, wi)),
            Self::ThinDielectric(_) => Spectrum::BLACK,
            Self::CoatedDiffuse(bsdf) => bsdf.eval(wo, wi),
            Self::CoatedConductor(bsdf) => bsdf.eval(wo, wi),
            Self::Principled(bsdf) => bsdf.eval(wo, wi),
        }
    }

    /// The density per unit solid angle with which [`Bsdf::sample`] chooses `wi`, delta parts left out. Its integral is
    /// less than 1 by the probability of a delta part, and by that of `None`.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        match self {
            Self::Diffuse(bsdf) => bsdf.pdf(wo, wi),
            Self::DiffuseTransmission(bsdf) => bsdf.pdf(wo, wi),
            Self::Conductor(bsdf) => bsdf.pdf(wo, wi),
            Self::Dielectric(bsdf) => bsdf.pdf(wo, wi),
            Self::ThinDielectric(_) => 0.0,
            Self::CoatedDiffuse(bsdf) => bsdf.pdf(wo, wi),
            Self::CoatedConductor(bsdf) => bsdf.pdf(wo, wi),
            Self::Principled(bsdf) => bsdf.pdf(wo, wi),
        }
    }

    /// Chooses `wi` from three uniform numbers: `lobe` decides between parts, `u` the direction. `None` absorbs.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self {
            Self::Diffuse(bsdf) => bsdf.sample(wo, u),
            Self::DiffuseTransmission(bsdf) => bsdf.sample(wo, lobe, u),
            Self::Conductor(bsdf) => bsdf.sample(wo, u),
            Self::Dielectric(bsdf) => bsdf.sample(wo, lobe, u),
            Self::ThinDielectric(bsdf) => bsdf.sample(wo, lobe),
            Self::CoatedDiffuse(bsdf) => bsdf.sample(wo, lobe, u),
            Self::CoatedConductor(bsdf) => bsdf.sample(wo, lobe, u),
            Self::Principled(bsdf) => bsdf.sample(wo, lobe, u),
        }
    }

    /// Whether it has nothing but delta parts, so that sampling lights is of no use.
    pub fn is_delta(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::DiffuseTransmission(_) | Self::CoatedDiffuse(_) => false,
            Self::Conductor(bsdf) => bsdf.facets.is_smooth(),
            Self::Dielectric(bsdf) => bsdf.is_delta(),
            Self::ThinDielectric(_) => true,
            Self::CoatedConductor(bsdf) => bsdf.is_delta(),
            Self::Principled(bsdf) => bsdf.is_delta(),
        }
    }

    /// An estimate of its hemispherical albedo for the feature image of the same name: exact for diffuse surfaces, the
    /// reflectance at normal incidence for metals, 1 for glass.
    pub fn albedo(&self) -> Spectrum {
        match self {
            Self::Diffuse(bsdf) => bsdf.reflectance,
            Self::DiffuseTransmission(bsdf) => bsdf.reflectance + bsdf.transmittance,
            Self::Conductor(bsdf) => bsdf.fresnel(1.0),
            Self::Dielectric(_) | Self::ThinDielectric(_) => Spectrum::WHITE,
            Self::CoatedDiffuse(bsdf) => bsdf.albedo_estimate(),
            Self::CoatedConductor(bsdf) => bsdf.albedo_estimate(),
            Self::Principled(bsdf) => bsdf.albedo_estimate(),
        }
    }

    /// The same surface where what lies outside of it is not vacuum but has an index of refraction of its own: a solid
    /// inside another. Only [`Principled`] solids know their index against vacuum; others stay as they are.
    #[must_use]
    pub fn immersed(self, outside: f32) -> Self {
        match self {
            Self::Principled(bsdf) => Self::Principled(Box::new(bsdf.immersed(outside))),
            other => other,
        }
    }

    /// The same, with its mirrors and the parts that are nearly so made rough: less noise and fewer sharp details, for
    /// the parts of a path that no one sees directly. Each α below 0.3 becomes twice as large, at least 0.1 and at most
    /// 0.3. A thin pane stays as it is: light goes straight through it.
    #[must_use]
    pub fn regularized(self) -> Self {
        let metal = |bsdf: Conductor| Conductor { facets: bsdf.facets.regularized(), ..bsdf };
        let glass = |bsdf: Dielectric| Dielectric { facets: bsdf.facets.regularized(), ..bsdf };
        let coated = |coat: Coat| Coat { face: glass(coat.face), ..coat };
        match self {
            Self::Diffuse(_) | Self::DiffuseTransmission(_) | Self::ThinDielectric(_) => self,
            Self::Conductor(bsdf) => Self::Conductor(metal(bsdf)),
            Self::Dielectric(bsdf) => Self::Dielectric(glass(bsdf)),
            Self::CoatedDiffuse(bsdf) => {
                Self::CoatedDiffuse(CoatedDiffuse { coat: coated(bsdf.coat), ..bsdf })
            }
            Self::CoatedConductor(bsdf) => {
                Self::CoatedConductor(CoatedConductor { base: metal(bsdf.base), coat: coated(bsdf.coat) })
            }
            Self::Principled(bsdf) => Self::Principled(Box::new(bsdf.regularized())),
        }
    }
}
