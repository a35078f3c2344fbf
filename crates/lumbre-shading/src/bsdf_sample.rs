//! A direction sampled from a BSDF.

use crate::{LocalDir, Spectrum};

/// How a direction was sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scatter {
    /// With this density per unit solid angle.
    Density(f32),
    /// As the only possible direction, such as a mirror's: it has no density.
    Delta,
}

/// A direction sampled from a BSDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// The direction of incidence.
    pub wi: LocalDir,
    /// f · |cos θi| / pdf, ready to multiply a path's throughput.
    pub weight: Spectrum,
    /// How it was sampled.
    pub scatter: Scatter,
    /// Whether it is on the other side of the surface.
    pub transmitted: bool,
    /// η of the side of `wi` over that of the side of `wo`; 1 for a reflection or an unbent transmission.
    pub eta: f32,
}
