//! The closed set of BSDFs: how a surface scatters between two directions.

use lumbre_math::Vec2;

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
#[derive(Clone, Debug)]
pub enum Bsdf {}

impl Bsdf {
    /// f(wo, wi) · |cos θi|; zero for delta parts. Radiance flows from `wi` to `wo`.
    pub fn eval(&self, _wo: LocalDir, _wi: LocalDir) -> Spectrum {
        match *self {}
    }

    /// The density per unit solid angle with which [`Bsdf::sample`] chooses `wi`, delta parts left out.
    pub fn pdf(&self, _wo: LocalDir, _wi: LocalDir) -> f32 {
        match *self {}
    }

    /// Chooses `wi` from three uniform numbers: `lobe` decides between parts, `u` the direction. `None` absorbs.
    pub fn sample(&self, _wo: LocalDir, _lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        match *self {}
    }

    /// Whether it has nothing but delta parts, so that sampling lights is of no use.
    pub fn is_delta(&self) -> bool {
        match *self {}
    }

    /// An estimate of its hemispherical albedo for the feature image of the same name.
    pub fn albedo(&self) -> Spectrum {
        match *self {}
    }
}
