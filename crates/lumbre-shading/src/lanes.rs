//! BSDFs over lanes of numbers.

use lumbre_simd::{Real, V3};

#[cfg(doc)]
use crate::Bsdf;
pub use crate::one_bsdf::OneBsdf;

/// A direction sampled from a BSDF in each lane: see [`crate::BsdfSample`].
#[derive(Clone, Copy, Debug)]
pub struct LaneSample<R: Real> {
    /// The direction of incidence, unit, in the shading frame.
    pub wi: V3<R>,
    /// f · |cos θi| / pdf.
    pub weight: V3<R>,
    /// The density per unit solid angle, where it is no delta.
    pub pdf: R,
    /// False where all is absorbed.
    pub valid: R::Mask,
    /// Whether the direction is the only possible one.
    pub delta: R::Mask,
    /// Whether it is on the other side of the surface.
    pub transmitted: R::Mask,
    /// η of the side of `wi` over that of the side of `wo`.
    pub eta: R,
}

/// A BSDF in each lane: see [`Bsdf`].
pub trait LaneBsdf<R: Real> {
    /// f(wo, wi) · |cos θi| and the density of [`LaneBsdf::sample`], without delta parts.
    fn eval(&self, wo: V3<R>, wi: V3<R>) -> (V3<R>, R);

    /// Samples `wi` from three uniform numbers: `lobe` selects a part, `u` the direction.
    fn sample(&self, wo: V3<R>, lobe: R, u: [R; 2]) -> LaneSample<R>;

    /// Whether all parts are deltas.
    fn is_delta(&self) -> R::Mask;
}

/// A BSDF that is a row of numbers.
pub trait RowBsdf<R: Real>: LaneBsdf<R> {
    /// Numbers of a row of parameters.
    const ROW: usize;

    /// Reads the row that begins at `at` in each lane.
    ///
    /// # Panics
    /// Where a row is not all in the table.
    fn load(table: &[f32], at: R::UInt) -> Self;
}
