//! Merges photons with vertices of paths, and weights both strategies for the same light.
//!
//! Two strategies find caustic light from a lamp at a vertex: a path that samples the BSDF and follows the specular
//! bounces to the lamp, and photons near the vertex. The balance heuristic weights them, as in vertex merging (I.
//! Georgiev, J. Křivánek, T. Davidovič, P. Slusallek, "Light Transport Simulation with Vertex Connection and Merging",
//! 2012). The specular bounces in between have the same probabilities in both directions. So only the ends count: the
//! density of the BSDF at the vertex, and the density with which light paths start at the surface next to the lamp and
//! choose the lamp there.

use std::sync::Arc;

use lumbre_math::{DVec3, Elementary};
use lumbre_simd::Real;

use super::{ChordSampler, PassPlan, Photons, SAMPLES_A_PASS};

/// The photon radius of the first pass at a directly visible vertex, in widths of a sample's footprint, which is a
/// quarter of a pixel wide.
const WIDTHS: f64 = 6.0;
/// The factor on the radius for vertices further along a path, where blur does not show.
const WIDER: f32 = 3.0;
/// Minimum width in media, in typical distances: the first pass collects photons within an eightieth of one.
const MIN_WIDTH_IN_MEDIUM: f64 = 1.0 / 512.0;

/// The photons that are merged with the paths of a wave.
#[derive(Debug)]
pub(crate) struct Merging<'s> {
    pub(crate) chords: ChordSampler<'s>,
    /// The passes of all samples of the wave, each with its number.
    pub(crate) passes: Vec<(u32, Arc<Photons>)>,
    pub(crate) plan: PassPlan,
    /// Lines of a pass.
    pub(crate) lines: f64,
    /// [`super::typical_way`]: the inverse of it stands for the density of a photon along its segment in the weights.
    pub(crate) typical_way: f64,
}

impl Merging<'_> {
    /// The photons for a sample.
    pub(crate) fn photons(&self, sample: u32) -> Option<&Photons> {
        let pass = self.plan.pass_of(sample);
        self.passes.iter().find(|(number, _)| *number == pass).map(|(_, photons)| &**photons)
    }

    /// The radius of a sample per width of a footprint: it shrinks every [`SAMPLES_A_PASS`] samples, so that the mean
    /// of all passes converges to the right value (C. Knaus, M. Zwicker, "Progressive Photon Mapping: A Probabilistic
    /// Approach", 2011, with α = 2/3).
    pub(crate) fn widths(sample: u32) -> f32 {
        let pass = f64::from(sample / SAMPLES_A_PASS) + 1.0;
        (WIDTHS * pass.power(-1.0 / 6.0)) as f32
    }

    /// One over (lines of a pass times the area of a vertex): converts a density per line to one of photons near the
    /// vertex.
    #[inline(always)]
    pub(crate) fn spread<R: Real>(&self, radius: R) -> R {
        (radius * radius * R::splat((std::f64::consts::PI * self.lines) as f32)).recip()
    }

    /// The photon radius at a point of a medium. Near the camera, a footprint alone is too small to contain any.
    pub(crate) fn radius_in_medium(&self, widths: f32, width: f32) -> f32 {
        widths * width.max((self.typical_way * MIN_WIDTH_IN_MEDIUM) as f32)
    }

    /// One over (lines of a pass times the volume around a point of a medium in which photons are collected).
    pub(crate) fn spread_in_medium(&self, radius: f32) -> f32 {
        let radius = f64::from(radius);
        (4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius * self.lines).recip() as f32
    }

    /// As [`Self::spread_in_medium`], for the weights: with the density of a photon along its segment.
    pub(crate) fn share_in_medium(&self, spread: f32) -> f32 {
        spread * self.typical_way as f32
    }

    /// The weight of light that a path found behind specular surfaces, the last of which is at `from`. `merging` is
    /// [`crate::wave::paths::Paths::merging`], and `light_pdf` the density with which the light would have been sampled
    /// there.
    pub(crate) fn weight_of_found(&self, merging: f32, from: DVec3, light_pdf: f32) -> f32 {
        let density = self.chords.density(from) as f32 * light_pdf;
        if density > 0.0 { merging / (merging + density) } else { 1.0 }
    }
}

/// The photon radius at a vertex.
#[inline(always)]
pub(crate) fn radius<R: Real>(widths: R, width: R, has_scattered: R::Mask) -> R {
    widths * width * R::select(has_scattered, R::splat(WIDER), R::one())
}
