//! Radiance along a ray: no threads, no files, no clock.

mod ambient_occlusion;
mod direct;
mod features;
mod integrator;
pub(crate) mod interior;
pub(crate) mod journal;
mod path;
pub(crate) mod sampler;
mod seen;
pub(crate) mod through;
mod whitted;

pub use ambient_occlusion::AmbientOcclusion;
pub use features::{Feature, FeatureIntegrator, Features};
pub use integrator::{Integrator, RayCounts, RayIntegrator, Sight, integrator};
pub use journal::{End, Event, Met, Record, SampledLight, Scattered, Source};
pub use path::{Path, Strategy};
pub use sampler::{Draw, Sampler};
pub(crate) use seen::{Seen, caught};
pub use whitted::Whitted;
