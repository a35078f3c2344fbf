//! What every integrator does: the radiance along a ray from the camera.

use std::fmt::Debug;

use lumbre_scene::{Scene, View};
use lumbre_shading::Spectrum;

use crate::transport::{PrimaryHit, Record, SampleNumbers, Sampler};
use crate::wave::PrimaryHits;

/// An estimator of the radiance that arrives at the camera, of many samples at a time.
pub trait Integrator: Debug + Send + Sync {
    /// Gives each of the samples an estimate of the radiance along its ray from the camera.
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, sampler: &Sampler, record: &mut Record);

    /// Whether it takes samples that carry wavelengths in place of linear Rec. 709.
    fn carries_wavelengths(&self) -> bool {
        false
    }

    /// Whether rays from the camera are to have footprints, also in scenes without textures.
    fn needs_footprints(&self) -> bool {
        false
    }
}

/// An estimator that takes one ray from the camera after the other.
pub trait RayIntegrator: Debug + Send + Sync {
    /// An estimate of the radiance that arrives at the camera along a line of sight.
    fn radiance(
        &self,
        scene: &Scene,
        view: &View,
        primary_hit: PrimaryHit<'_>,
        numbers: &SampleNumbers,
        record: &mut Record,
    ) -> Spectrum;
}

impl<T: RayIntegrator> Integrator for T {
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, _: &Sampler, record: &mut Record) {
        let (scene, view) = (primary_hits.scene(), primary_hits.view());
        primary_hits.each(|primary_hit, numbers| self.radiance(scene, view, primary_hit, numbers, record));
    }
}
