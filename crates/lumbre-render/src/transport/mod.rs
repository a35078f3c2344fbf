//! The parts of light transport: random numbers, the solids around a path, the journal. No threads, no files, no clock.

mod counts;
pub(crate) mod direct;
mod features;
pub(crate) mod interior;
pub(crate) mod journal;
mod primary_hit;
pub(crate) mod sampler;
pub(crate) mod seen;
mod strategy;
pub(crate) mod through;

pub use counts::RayCounts;
pub use features::{Feature, Features};
pub use journal::{End, Event, MergedPhoton, Met, Record, SampledLight, Scattered, Source};
pub use primary_hit::PrimaryHit;
pub use sampler::{SampleNumbers, Sampler};
pub(crate) use seen::{Seen, caught};
pub use strategy::Strategy;
