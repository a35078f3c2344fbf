//! Radiance along a ray: no threads, no files, no clock.

mod ambient_occlusion;
mod direct;
mod features;
mod integrator;
mod interior;
mod journal;
mod path;
mod sampler;
mod seen;
mod through;
mod whitted;

pub use ambient_occlusion::AmbientOcclusion;
pub use features::{Feature, FeatureIntegrator, Features};
pub use integrator::{Integrator, RayCounts, Sight, integrator};
pub use journal::{End, Event, Met, Record, SampledLight, Scattered, Source};
pub use path::{Path, Strategy};
pub use sampler::{Draw, Sampler};
pub use seen::{Seen, see};
pub use whitted::Whitted;
