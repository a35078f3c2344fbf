//! Path tracing with next-event estimation and multiple importance sampling.

use lumbre_scene::Scene;
use lumbre_shading::ShadingNormals;
use lumbre_simd::InstructionSet;

use crate::integrators::Integrator;
use crate::transport::{Record, Sampler, Strategy};
use crate::wave::PrimaryHits;
use crate::wave::setting::Setting;

/// Kajiya's path tracing: at each surface one sample of a light and one of the BSDF, combined by the power heuristic,
/// and Russian roulette by throughput from the sixth bounce on. Many paths advance together, in waves.
///
/// Light of delta lights, which no path hits by chance, is sampled straight through surfaces that do not change its
/// direction ([`lumbre_shading::Bsdf::straight_on`]): smooth panes without thickness. That is no bounce. Smooth
/// refracting surfaces cast a shadow in such light; rough ones scatter it. The light of surfaces and of the sky is
/// found by paths, through panes as through anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Path {
    /// Maximum bounces: 0 shows only lights, 1 direct light.
    pub max_depth: u32,
    /// Whether to roughen surfaces after the first diffuse bounce.
    pub regularize: bool,
    /// The treatment of shading normals that differ from the geometric ones.
    pub shading_normals: ShadingNormals,
    /// The sampling strategies for light.
    pub strategy: Strategy,
    /// Minimum bounces before Russian roulette.
    pub roulette_start: u32,
}

/// Default minimum of bounces before Russian roulette: fewer cost more error than they save time, in every measured
/// scene.
const ROULETTE_START: u32 = 5;

impl Path {
    /// A path tracer with this maximum of bounces.
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
    /// The data shared by all paths.
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
