//! Integrators: each arranges stages of a wave, or follows one ray from the camera after the other.

mod ambient_occlusion;
mod caustics;
mod choice;
mod features;
mod integrator;
mod path;
mod pov;
mod whitted;

pub use ambient_occlusion::AmbientOcclusion;
pub use caustics::Caustics;
pub use choice::integrator;
pub use features::FeatureIntegrator;
pub use integrator::{Integrator, RayIntegrator};
pub use path::Path;
pub use pov::Pov;
pub use whitted::Whitted;
