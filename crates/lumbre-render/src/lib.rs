#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! A render takes samples of pixels in waves of some thousand paths, of which an [`integrators::Integrator`] finds the light; [`film`] makes
//! pixels of samples and knows nothing of that. [`render`] is the verb.

mod adaptive;
mod cancel;
mod caustics;
mod clock;
mod denoise;
mod error;
pub mod film;
pub mod integrators;
mod job;
mod neighbourhoods;
mod noise;
mod one_sample;
mod options;
mod progress;
mod rendered;
mod state;
pub mod transport;
mod trial;
mod wave;
mod workers;

pub use cancel::CancelToken;
pub use caustics::caustic_share;
pub use denoise::{Denoised, denoise, denoise_unless};
pub use error::RenderError;
pub use job::{Keeper, render, render_from, render_with};
pub use one_sample::{ExplainedSample, explain_ray, explain_sample};
pub use options::{RenderOptions, Stop};
pub use progress::{NoProgress, Progress, Snapshot, State};
pub use rendered::{DroppedSample, FilmLayers, Rendered, Stats};
pub use state::{MergeError, Piece, RenderState, StateError};

pub use crate::film::PixelBounds;
pub use crate::integrators::{Integrator, RayIntegrator};
pub use crate::transport::{Event, Feature, RayCounts, Record};
pub use crate::wave::Sights;
