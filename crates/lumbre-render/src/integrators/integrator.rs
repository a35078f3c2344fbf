//! The traits of integrators: radiance along camera rays.

use std::fmt::Debug;

use lumbre_scene::{Scene, View};
use lumbre_shading::Spectrum;

use crate::transport::{PrimaryHit, Record, SampleNumbers, Sampler};
use crate::wave::PrimaryHits;

/// An estimator of the radiance that arrives at the camera, for many samples at a time.
pub trait Integrator: Debug + Send + Sync {
    /// Sets each sample's estimate of the radiance along its camera ray.
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, sampler: &Sampler, record: &mut Record);

    /// Whether it supports samples that carry wavelengths instead of linear Rec. 709.
    fn carries_wavelengths(&self) -> bool {
        false
    }

    /// Whether all pixels choose the same wavelengths for samples of the same index, in a spectral render of this
    /// scene.
    fn shares_wavelengths(&self, _scene: &Scene) -> bool {
        false
    }

    /// Whether it looks at the first hits of camera rays, which are then found for all of them at a time.
    fn uses_primary_hits(&self) -> bool {
        true
    }

    /// Whether camera rays need footprints even in scenes without textures.
    fn needs_footprints(&self) -> bool {
        false
    }
}

/// An estimator that takes one camera ray at a time.
pub trait RayIntegrator: Debug + Send + Sync {
    /// An estimate of the radiance along a camera ray.
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
