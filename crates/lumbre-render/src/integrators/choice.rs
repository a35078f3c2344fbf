//! The integrator that a description asks for.

use lumbre_scene::{IntegratorDesc, IntegratorKind};

use crate::integrators::{AmbientOcclusion, Caustics, FeatureIntegrator, Integrator, Path, Pov, Whitted};
use crate::transport::Feature;

/// The integrator that a description asks for.
pub fn integrator(desc: &IntegratorDesc) -> Box<dyn Integrator> {
    let IntegratorDesc { max_depth, shading_normals, .. } = *desc;
    match desc.kind {
        IntegratorKind::Path { regularize } => {
            Box::new(Path { regularize, shading_normals, ..Path::new(max_depth) })
        }
        IntegratorKind::Caustics => Box::new(Caustics::new(max_depth, shading_normals)),
        IntegratorKind::Whitted { light_samples, sky } => {
            Box::new(Whitted { max_depth, light_samples, sky, shading_normals })
        }
        IntegratorKind::Pov => Box::new(Pov),
        IntegratorKind::AmbientOcclusion { cosine, max_distance } => {
            Box::new(AmbientOcclusion { cosine, max_distance, shading_normals })
        }
        IntegratorKind::Normals => Box::new(FeatureIntegrator(Feature::Normal)),
        IntegratorKind::Depth => Box::new(FeatureIntegrator(Feature::Depth)),
        IntegratorKind::Albedo => Box::new(FeatureIntegrator(Feature::Albedo)),
        IntegratorKind::Uv => Box::new(FeatureIntegrator(Feature::Uv)),
    }
}
