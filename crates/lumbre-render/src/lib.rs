#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! [`transport`] computes the radiance along a ray, [`film`] makes pixels of samples; neither knows the other, nor of threads. [`render`]
//! is the verb.

mod adaptive;
mod cancel;
mod clock;
mod denoise;
mod error;
pub mod film;
mod job;
mod one_sample;
mod options;
mod progress;
mod rendered;
mod state;
pub mod transport;
mod wave;
mod workers;

pub use cancel::CancelToken;
pub use denoise::{Denoised, denoise, denoise_unless};
pub use error::RenderError;
pub use job::{Keeper, render, render_from, render_with};
pub use one_sample::{ExplainedSample, explain_ray, explain_sample};
pub use options::{RenderOptions, Stop};
pub use progress::{NoProgress, Progress, Snapshot, State};
pub use rendered::{DroppedSample, Rendered, Stats};
pub use state::{MergeError, Piece, RenderState, StateError};

pub use crate::film::PixelBounds;
pub use crate::transport::{Event, Feature, Integrator, RayCounts, RayIntegrator, Record};
pub use crate::wave::Sights;
