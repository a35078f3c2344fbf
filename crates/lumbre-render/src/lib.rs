//! Pixels over threads, passes over time.
//!
//! A picture is a function of the scene, the options and the seed: never of the number of threads or of the order in
//! which tiles happen to be done. [`render`] is the verb.

mod cancel;
mod error;
mod job;
mod options;
mod progress;
mod rendered;

pub use cancel::CancelToken;
pub use error::RenderError;
pub use job::{render, render_with};
pub use options::{RenderOptions, Stop};
pub use progress::{NoProgress, Progress, Snapshot, State};
pub use rendered::{DroppedSample, Rendered, Stats};

pub use lumbre_film::PixelBounds;
pub use lumbre_transport::{Feature, Integrator, RayCounts};
