//! Paint or metal under varnish: layered surfaces evaluated by random walks.

use lumbre_math::Vec2;

use crate::coated_lanes::{CoatLanes, CoatedConductorLanes, CoatedDiffuseLanes};
use crate::conductor::Conductor;
use crate::dielectric::{Dielectric, Ways};
use crate::diffuse::Diffuse;
use crate::lanes::{LaneBsdf, colour_lane, spectrum, square};
use crate::{BsdfSample, LocalDir, Scatter, Spectrum, fresnel};

/// A dielectric coat with a scattering or absorbing medium below it.
///
/// Transport below the interface is estimated by a random walk whose random numbers are a hash of the two
/// directions: the result is deterministic, and right in the mean over directions. The walk is that of Guo,
/// Hašan, Zhao, "Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs", SIGGRAPH Asia 2018, with
/// the parameters of pbrt-v4: extinction 1 per unit of thickness, even where nothing scatters; Russian roulette
/// from the fifth bounce.
///
/// Unlike there, directions are sampled not by a walk but from a few lobes of known density, so weights,
/// densities and values agree exactly, and a weight includes multiple bounces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// The outer interface, inside over outside.
    pub face: Dielectric,
    /// In mean free paths, ≥ 0.
    pub thickness: f32,
    /// Henyey–Greenstein asymmetry of the medium, within (-1, 1).
    pub g: f32,
    /// Single-scattering albedo of the medium, in [0, 1].
    pub albedo: Spectrum,
    /// The maximal number of bounces of a walk.
    pub max_depth: u32,
    /// Walks per evaluation.
    pub samples: u32,
}

/// A diffuse base under a coat; the same from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedDiffuse {
    /// The base.
    pub base: Diffuse,
    /// The coat.
    pub coat: Coat,
}

/// A metal under a coat; the same from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedConductor {
    /// The base, with its index of refraction relative to the coat's.
    pub base: Conductor,
    /// The coat.
    pub coat: Coat,
}

impl CoatedDiffuse {
    /// f · |cos θi|, without the mirror reflection of a smooth coat.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().value(wo.lane(), wi.lane()))
    }

    /// The density of [`CoatedDiffuse::sample`] without its delta part.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().pdf(wo.lane(), wi.lane())
    }

    /// A direction sampled from the coat or by the cosine.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), lobe, square(u)).scalar()
    }

    /// The mirror reflection of a smooth coat.
    pub(crate) fn specular(&self, wo: LocalDir) -> Option<BsdfSample> {
        self.coat.mirror_image(wo)
    }

    /// A rough estimate of its albedo, from the coat's reflectance at normal incidence and the base's for the
    /// rest.
    pub fn albedo_estimate(&self) -> Spectrum {
        let coat = fresnel::dielectric(1.0, self.coat.face.eta);
        Spectrum::splat(coat) + self.base.reflectance * (1.0 - coat)
    }

    fn lane(&self) -> CoatedDiffuseLanes<f32> {
        CoatedDiffuseLanes { base: self.base.lane(), coat: self.coat.lane() }
    }

    pub(crate) fn row(&self) -> impl Iterator<Item = f32> {
        self.base.row().into_iter().chain(self.coat.row())
    }
}

impl CoatedConductor {
    /// Whether it is a mirror.
    pub fn is_delta(&self) -> bool {
        self.lane().is_delta()
    }

    /// f · |cos θi|, without mirror reflections.
    pub fn eval(&self, wo: LocalDir, wi: LocalDir) -> Spectrum {
        spectrum(self.lane().value(wo.lane(), wi.lane()))
    }

    /// The density of [`CoatedConductor::sample`] without its delta part.
    pub fn pdf(&self, wo: LocalDir, wi: LocalDir) -> f32 {
        self.lane().pdf(wo.lane(), wi.lane())
    }

    /// A direction sampled from the coat, from the metal or by the cosine.
    pub fn sample(&self, wo: LocalDir, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.lane().sample(wo.lane(), lobe, square(u)).scalar()
    }

    /// The mirror reflection of the smooth layers.
    pub(crate) fn specular(&self, wo: LocalDir) -> Option<BsdfSample> {
        let lane = self.lane();
        if !lane.both_smooth() {
            return self.coat.mirror_image(wo);
        }
        if wo.cos_theta() == 0.0 || wo.cos_theta().is_nan() {
            return None;
        }
        let above = if wo.cos_theta() < 0.0 { -wo } else { wo };
        let weight = spectrum(lane.mirror(above.lane()));
        Some(BsdfSample { wi: wo.mirrored(), weight, scatter: Scatter::Delta, transmitted: false, eta: 1.0 })
    }

    /// A rough estimate of its albedo, from both layers at normal incidence.
    pub fn albedo_estimate(&self) -> Spectrum {
        let through = 1.0 - fresnel::dielectric(1.0, self.coat.face.eta);
        Spectrum::splat(1.0 - through) + self.base.fresnel(1.0) * (through * through)
    }

    fn lane(&self) -> CoatedConductorLanes<f32> {
        CoatedConductorLanes { base: self.base.lane(), coat: self.coat.lane() }
    }

    pub(crate) fn row(&self) -> impl Iterator<Item = f32> {
        self.base.row().into_iter().chain(self.coat.row())
    }
}

impl Coat {
    /// The mirror reflection of a smooth interface.
    fn mirror_image(&self, wo: LocalDir) -> Option<BsdfSample> {
        if !self.face.is_delta() || self.face.eta == 1.0 {
            return None;
        }
        let below = wo.cos_theta() < 0.0;
        let above = if below { -wo } else { wo };
        let sample = self.face.sample_of(above, 0.0, Vec2::ZERO, Ways::Reflection)?;
        Some(if below { BsdfSample { wi: -sample.wi, ..sample } } else { sample })
    }

    fn lane(&self) -> CoatLanes<f32> {
        CoatLanes {
            face: self.face.lane(),
            thickness: self.thickness,
            g: self.g,
            albedo: colour_lane(self.albedo),
            max_depth: self.max_depth as f32,
            samples: self.samples.max(1) as f32,
        }
    }

    fn row(&self) -> [f32; CoatLanes::<f32>::ROW] {
        let ([eta, x, y], [r, g, b]) = (self.face.row(), self.albedo.to_array());
        let CoatLanes { max_depth, samples, .. } = self.lane();
        [eta, x, y, self.thickness, self.g, r, g, b, max_depth, samples]
    }
}
