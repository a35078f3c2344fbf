//! Path tracing with next-event estimation and multiple importance sampling.

use lumbre_scene::Scene;
use lumbre_shading::ShadingNormals;
use lumbre_simd::InstructionSet;

use crate::integrators::Integrator;
use crate::transport::{Record, Sampler, Strategy};
use crate::wave::PrimaryHits;
use crate::wave::setting::Setting;

/// Kajiya's path tracing: at each surface one sample of a light and one of the BSDF, combined by the power heuristic,
/// and Russian roulette by throughput from the sixth bounce on. Many paths go side by side, in waves.
///
/// Light from points and in one direction, which no path finds by chance, is sampled straight through what does not change
/// its direction ([`lumbre_shading::Bsdf::straight_on`]): smooth panes without thickness. That is no bounce. What is smooth and refracts
/// throws a shadow of such light; what is rough is lit by it, and passes it on. The light of surfaces and of the sky is found
/// by paths, through panes as through anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Path {
    /// Bounces at most: 0 shows lights alone, 1 direct light.
    pub max_depth: u32,
    /// Whether to roughen surfaces after the first diffuse bounce.
    pub regularize: bool,
    /// What is made of shading normals that are not those of the surface.
    pub shading_normals: ShadingNormals,
    /// How light is found.
    pub strategy: Strategy,
    /// Bounces that every path may take before Russian roulette.
    pub roulette_start: u32,
}

/// Bounces that every path may take before Russian roulette: fewer cost more error than they save time, in every scene that was
/// measured.
const ROULETTE_START: u32 = 5;

impl Path {
    /// A path tracer with this many bounces at most.
    pub fn new(max_depth: u32) -> Self {
        Self {
            max_depth,
            regularize: false,
            shading_normals: ShadingNormals::default(),
            strategy: Strategy::Both,
            roulette_start: ROULETTE_START,
        }
    }
}

impl Path {
    /// What all paths have in common.
    pub(crate) fn setting<'s>(&self, scene: &'s Scene, sampler: &Sampler) -> Setting<'s> {
        Setting {
            scene,
            sampler: sampler.kind(),
            strategy: self.strategy,
            max_depth: self.max_depth,
            roulette_start: self.roulette_start,
            regularize: self.regularize,
            shading_normals: self.shading_normals,
            has_solids: scene.has_solids(),
            has_media: scene.has_media(),
            has_panes: scene.has_delta_transmission(),
            moves: scene.moves(),
            is_spectral: false,
            instruction_set: InstructionSet::detect(),
            merging: None,
        }
    }
}

impl Integrator for Path {
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, sampler: &Sampler, record: &mut Record) {
        let is_spectral = primary_hits.are_spectral();
        let setting = Setting { is_spectral, ..self.setting(primary_hits.scene(), sampler) };
        primary_hits.follow(&setting, record);
    }

    fn carries_wavelengths(&self) -> bool {
        true
    }
}
