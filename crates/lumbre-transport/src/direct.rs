//! Light that arrives at a surface straight from a light.

use lumbre_scene::{Interaction, LightSample, Scene};
use lumbre_shading::{Bsdf, LocalDir, Scatter, ShadingFrame, Spectrum};

use crate::RayCounts;

/// A surface as seen along a path, ready to scatter.
pub(crate) struct Vertex<'a, 's> {
    pub met: &'a Interaction<'s>,
    pub frame: ShadingFrame,
    pub bsdf: Bsdf,
    pub wo: LocalDir,
}

impl<'a, 's> Vertex<'a, 's> {
    /// `None` where nothing scatters.
    pub fn new(met: &'a Interaction<'s>) -> Option<Self> {
        let (frame, bsdf) = met.scattering()?;
        let wo = frame.to_local(met.towards_origin.as_vec3());
        Some(Self { met, frame, bsdf, wo })
    }

    /// One vertex for each material of a mixture, with its share: see [`Interaction::scattering_parts`].
    pub fn parts(met: &'a Interaction<'s>, least: f32) -> impl Iterator<Item = (f32, Self)> {
        met.scattering_parts(least).map(move |(share, frame, bsdf)| {
            let wo = frame.to_local(met.towards_origin.as_vec3());
            (share, Self { met, frame, bsdf, wo })
        })
    }

    /// What the vertex scatters of a light's sample towards the path, weighed against the other way to find the same
    /// light: the density with which the BSDF would have chosen it.
    pub fn scattered(
        &self,
        scene: &Scene,
        sample: &LightSample,
        weigh: impl FnOnce(f32, f32) -> f32,
        rays: &mut RayCounts,
    ) -> Spectrum {
        let wi = self.frame.to_local(sample.towards.as_vec3());
        let scattered = self.bsdf.eval(self.wo, wi) * sample.radiance;
        if scattered.is_black() {
            return Spectrum::BLACK;
        }
        let weight = match sample.scatter {
            Scatter::Delta => 1.0,
            Scatter::Density(pdf) => weigh(pdf, self.bsdf.pdf(self.wo, wi)) / pdf,
        };
        if weight <= 0.0 {
            return Spectrum::BLACK;
        }
        rays.shadow += 1;
        if scene.is_occluded(&self.met.shadow_ray(sample)) { Spectrum::BLACK } else { scattered * weight }
    }
}

/// The power heuristic (Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997) for two ways.
pub(crate) fn power_heuristic(this: f32, other: f32) -> f32 {
    if this.is_infinite() {
        return 1.0;
    }
    // By the ratio, for a square may overflow.
    let ratio = other / this;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::power_heuristic;

    #[test]
    fn the_weights_of_both_ways_sum_to_one_at_any_size() {
        for (a, b) in [(2.0, 3.0), (1e30, 2e30), (1e-30, 5e-30), (7.0, 0.0), (0.5, 1e25)] {
            let sum = power_heuristic(a, b) + if b > 0.0 { power_heuristic(b, a) } else { 0.0 };
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b} {sum}");
        }
        assert_eq!(power_heuristic(f32::INFINITY, 2.0), 1.0);
    }
}
