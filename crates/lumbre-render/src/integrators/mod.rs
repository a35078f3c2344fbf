//! Integrators: each arranges stages of a wave, or follows one ray from the camera after the other.

mod ambient_occlusion;
mod caustics;
mod features;
mod integrator;
mod path;
mod whitted;

pub use ambient_occlusion::AmbientOcclusion;
pub use caustics::Caustics;
pub use features::FeatureIntegrator;
pub use integrator::{Integrator, RayIntegrator, integrator};
pub use path::Path;
pub use whitted::Whitted;
