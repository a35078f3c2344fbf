//! How photons are merged with the vertices of paths, and how both ways to the same light are weighed.
//!
//! Light from a lamp that comes over specular surfaces to a vertex is found in two ways: by a path that chooses its direction by the BSDF
//! and follows the specular bounces to the lamp, and by photons near the vertex. Both are weighed by the balance heuristic, as vertex
//! merging is (I. Georgiev, J. Křivánek, T. Davidovič, P. Slusallek, "Light Transport Simulation with Vertex Connection and Merging",
//! 2012). All specular bounces between have the same probabilities seen from both ends, so the ends alone count: the density of the BSDF
//! at the vertex, and that with which light paths begin at the surface next to the lamp, and choose the lamp there.

use std::sync::Arc;

use lumbre_math::{DVec3, Elementary};
use lumbre_simd::Real;

use super::{ChordSampler, Photons, SAMPLES_A_PASS};

/// The radius in which a vertex that the camera sees collects photons of the first pass, in widths of the footprint of a sample, which is
/// a quarter of a pixel wide.
const WIDTHS: f64 = 6.0;
/// The factor on the radius for vertices further along a path, which are not seen sharply.
const WIDER: f32 = 3.0;
/// The least width in media, in typical ways: photons are first collected within an eightieth of one.
const MIN_WIDTH_IN_MEDIUM: f64 = 1.0 / 512.0;

/// The photons that the paths of a wave are merged with.
#[derive(Debug)]
pub(crate) struct Merging<'s> {
    pub(crate) chords: ChordSampler<'s>,
    /// The passes of all samples of the wave, each with its number.
    pub(crate) passes: Vec<(u32, Arc<Photons>)>,
    /// Lines of a pass.
    pub(crate) lines: f64,
    /// [`super::typical_way`]: the inverse of what stands for the density of a photon along its way, where photons and paths are weighed.
    pub(crate) typical_way: f64,
}

impl Merging<'_> {
    /// The pass of a sample.
    pub(crate) fn pass_of(sample: u32) -> u32 {
        sample / SAMPLES_A_PASS
    }

    /// The photons for a sample.
    pub(crate) fn photons(&self, sample: u32) -> Option<&Photons> {
        let pass = Self::pass_of(sample);
        self.passes.iter().find(|(number, _)| *number == pass).map(|(_, photons)| &**photons)
    }

    /// The radius of a sample per width of a footprint: it shrinks from pass to pass, so that the mean of all passes comes to be right
    /// (C. Knaus, M. Zwicker, "Progressive Photon Mapping: A Probabilistic Approach", 2011, with α = 2/3).
    pub(crate) fn widths(sample: u32) -> f32 {
        let pass = f64::from(Self::pass_of(sample)) + 1.0;
        (WIDTHS * pass.power(-1.0 / 6.0)) as f32
    }

    /// The inverse of what lines a pass has times the area of a vertex: what a density per line becomes one of photons near the vertex by.
    #[inline(always)]
    pub(crate) fn spread<R: Real>(&self, radius: R) -> R {
        (radius * radius * R::splat((std::f64::consts::PI * self.lines) as f32)).recip()
    }

    /// The radius in which a point of a medium collects photons. Near the camera a footprint is too small to find any but by chance.
    pub(crate) fn radius_in_medium(&self, widths: f32, width: f32) -> f32 {
        widths * width.max((self.typical_way * MIN_WIDTH_IN_MEDIUM) as f32)
    }

    /// The inverse of what lines a pass has times the volume around a point of a medium in which it collects photons.
    pub(crate) fn spread_in_medium(&self, radius: f32) -> f32 {
        let radius = f64::from(radius);
        (4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius * self.lines).recip() as f32
    }

    /// The same for densities, by which photons and paths are weighed: with the density of a photon along its way.
    pub(crate) fn share_in_medium(&self, spread: f32) -> f32 {
        spread * self.typical_way as f32
    }

    /// The weight of light that a path found behind specular surfaces, of which the last is at `from`. `merging` is what
    /// [`crate::wave::paths::Paths::merging`] says, and `light_pdf` the density with which the light would have been sampled there.
    pub(crate) fn weight_of_found(&self, merging: f32, from: DVec3, light_pdf: f32) -> f32 {
        let density = self.chords.density(from) as f32 * light_pdf;
        if density > 0.0 { merging / (merging + density) } else { 1.0 }
    }
}

/// The radius in which a vertex collects photons.
#[inline(always)]
pub(crate) fn radius<R: Real>(widths: R, width: R, has_scattered: R::Mask) -> R {
    widths * width * R::select(has_scattered, R::splat(WIDER), R::one())
}
