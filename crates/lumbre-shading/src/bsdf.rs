//! The closed set of BSDFs: how a surface scatters between two directions.

use lumbre_math::Vec2;

use crate::coated::{Coat, CoatedConductor, CoatedDiffuse};
use crate::conductor::Conductor;
use crate::dielectric::{Dielectric, ThinDielectric};
use crate::diffuse::{Diffuse, DiffuseTransmission};
use crate::hair::Hair;
use crate::measured::Measured;
use crate::principled::Principled;
use crate::subsurface::Subsurface;
use crate::uber::Uber;
use crate::{BsdfSample, LocalDir, Spectrum};

/// How a surface scatters at one point. Both directions point away from the surface.
///
/// Energy is conserved by [`Diffuse`] of reflectance 1, [`DiffuseTransmission`] whose shares sum to 1, a smooth
/// [`Dielectric`] (counting η²), [`ThinDielectric`], and a smooth [`Conductor`] of reflectance 1. Rough metal
/// and glass have single scattering only and lose energy; [`Principled`] compensates for it.
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
    /// All the layers; boxed, since the others are a quarter of its size and are copied often.
    Principled(Box<Principled>),
    /// pbrt-v3's lobes side by side.
    Uber(Uber),
    /// A fibre.
    Hair(Hair),
    /// Measured.
    Measured(Measured),
    /// The boundary of a body that light wanders through.
    Subsurface(Subsurface),
}

impl Bsdf {
    /// f(wo, wi) · |cos θi|, without delta parts. Radiance flows from `wi` to `wo`.
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
            Self::Uber(bsdf) => bsdf.eval(wo, wi),
            Self::Hair(bsdf) => bsdf.eval(wo, wi),
            Self::Measured(bsdf) => bsdf.eval(wo, wi),
            Self::Subsurface(bsdf) => bsdf.eval(wo, wi),
        }
    }

    /// The density per unit solid angle with which [`Bsdf::sample`] samples `wi`, without delta parts. Its
    /// integral is 1 minus the probabilities of delta parts and of `None`.
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
            Self::Uber(bsdf) => bsdf.pdf(wo, wi),
            Self::Hair(bsdf) => bsdf.pdf(wo, wi),
            Self::Measured(bsdf) => bsdf.pdf(wo, wi),
            Self::Subsurface(bsdf) => bsdf.pdf(wo, wi),
        }
    }

    /// Samples `wi` from three uniform numbers: `lobe` selects a part, `u` the direction. `None` is absorption.
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
            Self::Uber(bsdf) => bsdf.sample(wo, lobe, u),
            Self::Hair(bsdf) => bsdf.sample(wo, lobe, u),
            Self::Measured(bsdf) => bsdf.sample(wo, u),
            Self::Subsurface(bsdf) => bsdf.sample(wo, lobe, u),
        }
    }

    /// Whether all parts are deltas, so that light sampling is useless.
    pub fn is_delta(&self) -> bool {
        match self {
            Self::Diffuse(_)
            | Self::DiffuseTransmission(_)
            | Self::CoatedDiffuse(_)
            | Self::Hair(_)
            | Self::Measured(_)
            | Self::Subsurface(_) => false,
            Self::Conductor(bsdf) => bsdf.facets.is_smooth(),
            Self::Dielectric(bsdf) => bsdf.is_delta(),
            Self::ThinDielectric(_) => true,
            Self::CoatedConductor(bsdf) => bsdf.is_delta(),
            Self::Principled(bsdf) => bsdf.is_delta(),
            Self::Uber(bsdf) => bsdf.is_delta(),
        }
    }

    /// Whether it is certainly the same however its frame is turned about the normal.
    pub fn is_isotropic(&self) -> bool {
        let facets: &[_] = match self {
            Self::Diffuse(_) | Self::DiffuseTransmission(_) | Self::ThinDielectric(_) => &[],
            Self::Conductor(bsdf) => &[bsdf.facets],
            Self::Dielectric(bsdf) => &[bsdf.facets],
            Self::CoatedDiffuse(bsdf) => &[bsdf.coat.face.facets],
            Self::CoatedConductor(bsdf) => &[bsdf.coat.face.facets, bsdf.base.facets],
            Self::Principled(bsdf) if bsdf.coat.weight <= 0.0 || bsdf.coat.normal.z >= 1.0 => &[bsdf.facets],
            Self::Principled(_) | Self::Hair(_) => return false,
            Self::Uber(bsdf) => &[bsdf.facets],
            Self::Measured(bsdf) => return bsdf.tables.is_isotropic(),
            Self::Subsurface(bsdf) => &[bsdf.face.facets],
        };
        facets.iter().all(|facets| facets.alpha().x == facets.alpha().y)
    }

    /// An estimate of the hemispherical albedo for the AOV of that name: exact for diffuse surfaces, the
    /// reflectance at normal incidence for metals, 1 for glass and boundaries, that of light from the normal for
    /// measured surfaces.
    pub fn albedo(&self) -> Spectrum {
        match self {
            Self::Diffuse(bsdf) => bsdf.reflectance,
            Self::DiffuseTransmission(bsdf) => bsdf.reflectance + bsdf.transmittance,
            Self::Conductor(bsdf) => bsdf.fresnel(1.0),
            Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Subsurface(_) => Spectrum::WHITE,
            Self::CoatedDiffuse(bsdf) => bsdf.albedo_estimate(),
            Self::CoatedConductor(bsdf) => bsdf.albedo_estimate(),
            Self::Principled(bsdf) => bsdf.albedo_estimate(),
            Self::Uber(bsdf) => bsdf.albedo_estimate(),
            Self::Hair(bsdf) => bsdf.albedo_estimate(),
            Self::Measured(bsdf) => bsdf.albedo_estimate(),
        }
    }

    /// The surface inside another solid, whose index of refraction is `outside`. Only [`Principled`] solids
    /// know their index against vacuum; others are returned unchanged.
    #[must_use]
    pub fn immersed(self, outside: f32) -> Self {
        match self {
            Self::Principled(bsdf) => Self::Principled(Box::new(bsdf.immersed(outside))),
            other => other,
        }
    }

    /// The surface with mirrors and sharp lobes made rougher, for parts of a path that are not seen directly:
    /// less noise, fewer sharp details. Each α below 0.3 is doubled and clamped to [0.1, 0.3]. A thin pane is
    /// returned unchanged, since light passes straight through it, and so is a measured surface; the delta parts of
    /// [`Uber`] stay what they are.
    #[must_use]
    pub fn regularized(self) -> Self {
        let metal = |bsdf: Conductor| Conductor { facets: bsdf.facets.regularized(), ..bsdf };
        let glass = |bsdf: Dielectric| Dielectric { facets: bsdf.facets.regularized(), ..bsdf };
        let coated = |coat: Coat| Coat { face: glass(coat.face), ..coat };
        match self {
            Self::Diffuse(_)
            | Self::DiffuseTransmission(_)
            | Self::ThinDielectric(_)
            | Self::Hair(_)
            | Self::Measured(_) => self,
            Self::Conductor(bsdf) => Self::Conductor(metal(bsdf)),
            Self::Dielectric(bsdf) => Self::Dielectric(glass(bsdf)),
            Self::CoatedDiffuse(bsdf) => {
                Self::CoatedDiffuse(CoatedDiffuse { coat: coated(bsdf.coat), ..bsdf })
            }
            Self::CoatedConductor(bsdf) => {
                Self::CoatedConductor(CoatedConductor { base: metal(bsdf.base), coat: coated(bsdf.coat) })
            }
            Self::Principled(bsdf) => Self::Principled(Box::new(bsdf.regularized())),
            Self::Subsurface(bsdf) => Self::Subsurface(Subsurface { face: glass(bsdf.face), ..bsdf }),
            Self::Uber(bsdf) => Self::Uber(Uber { facets: bsdf.facets.regularized(), ..bsdf }),
        }
    }
}
