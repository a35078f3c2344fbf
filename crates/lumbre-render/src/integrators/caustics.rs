//! Path tracing with photons for caustics.

use lumbre_scene::Scene;
use lumbre_shading::ShadingNormals;

use crate::caustics::{ChordSampler, LightTracer, Merging, PassPlan, Passes, typical_way};
use crate::integrators::{Integrator, Path};
use crate::transport::{Record, Sampler};
use crate::wave::PrimaryHits;
use crate::wave::setting::Setting;

/// [`Path`], and photons for the light that comes from lamps over mirrors and smooth glass to what scatters it:
/// caustics, rooms behind panes, lamps in bulbs. Paths find such light by chance if the lamp is large, and never if it
/// is a point; photons find it the better the smaller the lamp. Both are weighed by multiple importance sampling.
///
/// The photons of a few samples of each pixel are one pass, and are collected within a few pixels. That blurs caustics
/// a little, and less with every pass, so that the mean comes to be right. In a spectral render, all paths of a pass
/// have the same wavelengths. What catches shadows (ground of the studio) collects none.
#[derive(Debug)]
pub struct Caustics {
    path: Path,
    passes: Passes,
}

impl Caustics {
    /// An integrator with this many bounces at most.
    pub fn new(max_depth: u32, shading_normals: ShadingNormals) -> Self {
        Self { path: Path { shading_normals, ..Path::new(max_depth) }, passes: Passes::default() }
    }
}

impl Integrator for Caustics {
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, sampler: &Sampler, record: &mut Record) {
        let (scene, view) = (primary_hits.scene(), primary_hits.view());
        let density = primary_hits.wavelength_choice().map(|choice| choice.density);
        let mut setting = Setting { is_spectral: density.is_some(), ..self.path.setting(scene, sampler) };
        if let Some(chords) = ChordSampler::new(scene).filter(|_| !scene.lights().is_empty()) {
            let tracer = LightTracer {
                scene,
                view,
                chords: &chords,
                sampler: *sampler,
                normals: self.path.shading_normals,
                max_bounces: self.path.max_depth.saturating_sub(1),
                goes_straight_on: setting.has_panes,
                density,
            };
            let plan = PassPlan::new(view.size(), density);
            let mut numbers: Vec<u32> = primary_hits.indices().map(|index| plan.pass_of(index)).collect();
            numbers.sort_unstable();
            numbers.dedup();
            let passes = numbers.into_iter().map(|number| (number, self.passes.get(&tracer, &plan, number)));
            let passes = passes.collect();
            let lines = plan.lines().into();
            setting.merging = Some(Merging { chords, passes, plan, lines, typical_way: typical_way(scene) });
        }
        primary_hits.follow(&setting, record);
    }

    fn carries_wavelengths(&self) -> bool {
        true
    }

    fn shares_wavelengths(&self, scene: &Scene) -> bool {
        ChordSampler::new(scene).is_some()
    }

    fn needs_footprints(&self) -> bool {
        true
    }
}
