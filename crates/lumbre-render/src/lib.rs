#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! [`render()`] takes samples in waves of some thousand paths. An [`integrators::Integrator`] finds the light of each
//! path; [`film`] turns samples into pixels and knows nothing of light transport.
//!
//! # Where a path travels
//!
//! A path is a row of numbers in columns (`wave/paths.rs`): its sample, where its ray starts (f64), direction,
//! throughput, η², the density of its last choice, its bounces, its footprint (f32). Each bounce takes all paths of the
//! wave through these stages:
//!
//! | stage | file | what it does |
//! |---|---|---|
//! | generate | `one_sample.rs`, `wave/primary_hits.rs`, `wave/camera.rs` | a camera ray for each sample, and what it hits |
//! | catch | `wave/catcher.rs` | camera rays that hit a shadow catcher: samples of its lights, and whether they are blocked |
//! | search | `wave/search.rs` | the closest hits of all rays, by the kernel; rays that pass through cut-outs are traced again in f64 |
//! | media | `wave/media.rs` | absorption, emission and scattering between surfaces |
//! | escape | `wave/escape.rs` | light at infinity, for rays that leave the scene |
//! | surfaces | `wave/surfaces.rs`, `wave/flat.rs`, `wave/smooth.rs`, `wave/placed.rs` | vertices: point, error bound, normal, frame, BSDF row, emission |
//! | merge | `wave/merge.rs`, `caustics/` | photons near the vertices, by the integrator `caustics` |
//! | shade | `wave/shade.rs` | per kind of BSDF, in lanes: a light sample becomes a shadow segment, a BSDF sample the next ray |
//! | cross | `wave/mod.rs` | the solids and media that the next rays enter |
//! | shadows | `wave/shadows.rs` | how much of each light sample arrives: any hit, media, panes |
//! | segments | `wave/mod.rs` | rays that start on the smooth surface over a face: whether that is free up to there |
//!
//! `whitted` and `ambientocclusion` shade one vertex at a time and follow several rays from it (`wave/trees.rs`).
//!
//! All stages share `wave/setting.rs`. Triangles with uniform materials run in lanes, from the plain rows of
//! `Scene::tables`. Textured materials are looked up one by one. Exact shapes, solids, bump maps of heights, and
//! instances that move or are nested go one by one through `Hits::interaction`. Shading is written once over `R: Real`
//! (`lumbre-simd`): one number, four (NEON, WebAssembly), eight (AVX2) or sixteen (AVX-512), with the same bits.
//! `InstructionSet::detect` chooses when a render begins; the environment variable `LUMBRE_SIMD` limits it.
//!
//! Light paths of `caustics` begin on specular surfaces (`caustics/light_paths.rs`). Their photons are in a k-d tree
//! for four samples of each pixel and are weighed against what camera paths find (`caustics/merging.rs`).
//!
//! `explain` runs the same stages on a wave of one path and reads the events off its columns (`wave/traced.rs`).
//!
//! A spectral render differs from one in RGB where colours enter (`TextureContext::spectral`,
//! `Scene::light_at_wavelengths`), and in `one_sample.rs`, where the radiance of a sample becomes a colour.
//!
//! # The same bytes, however a render is run
//!
//! - A sample is a function of scene, options, seed, pixel and index.
//! - A pixel's sums are integers in units of 2⁻⁶³ (`film/exact.rs`). Each addend is rounded once. Adding is
//!   exact, so it is associative and commutative, and tiles, threads, ranges of samples, crops and the order of merges
//!   cannot change a pixel. This costs under 2 % of the time (`docs/measurements/costs.md`). The denoiser's guides are
//!   the exception: they are f32, in sample order, and cannot be merged.
//! - [`RenderState`] is those sums and which samples they are of. `lumbre::Part` adds a hash of every file and option
//!   that a sample depends on. A checkpoint, a part and a picture with its sums are the same thing.
//! - A noise target looks at a pixel after fixed numbers of its own samples, together with a trial picture of the whole
//!   film (`adaptive.rs`, `trial.rs`), so that a pixel stops at the same sample in every run.

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
pub use job::{CheckpointSink, render, render_from, render_with};
pub use one_sample::{ExplainedSample, explain_ray, explain_sample};
pub use options::{RenderOptions, Stop};
pub use progress::{NoProgress, Progress, Snapshot, State};
pub use rendered::{DroppedSample, FilmLayers, Rendered, Stats};
pub use state::{MergeError, Piece, RenderState, StateError};

pub use crate::film::PixelBounds;
pub use crate::integrators::{Integrator, RayIntegrator};
pub use crate::transport::{Event, Feature, RayCounts, Record};
pub use crate::wave::PrimaryHits;
