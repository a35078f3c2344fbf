#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! A model in a studio of its own, on white paper, from all sides:
//!
//! ```no_run
//! use lumbre::{Background, Ground, ReadOptions, Scene, Stage};
//!
//! let (model, _) = lumbre::describe(&["model.glb".as_ref()], &ReadOptions::default())?;
//! for frame in 0..36 {
//!     let mut desc = model.clone();
//!     let turns = Some(f64::from(frame) / 36.0);
//!     let mut stage = Stage::default();
//!     (stage.turns, stage.ground) = (turns, Ground::Shadow);
//!     let prepared = lumbre::prepare(&mut desc, &stage, None);
//!     let scene = Scene::from_description(desc)?;
//!     let mut options = prepared.options(&scene, None, None);
//!     options.transparent = true;
//!     let paper = Background::Colour(lumbre::image::Rgb::WHITE);
//!     scene.render(&options)?.over(paper).save(format!("frame.{frame:04}.png"))?;
//! }
//! # Ok::<(), lumbre::Error>(())
//! ```
//!
//! The layers below are here too, under their own names: [`math`], [`image`], [`geometry`], [`kernel`], [`shading`],
//! [`formats`] and [`description`].

mod background;
mod builder;
mod cast;
mod colour;
pub mod description;
mod error;
mod files;
mod info;
mod parameter;
mod part;
mod picture;
mod prepare;
mod scene;
mod setting;
mod words;

pub use lumbre_formats as formats;
pub use lumbre_geometry as geometry;
pub use lumbre_image as image;
pub use lumbre_kernel as kernel;
pub use lumbre_math as math;
pub use lumbre_shading as shading;

pub use background::Background;
pub use builder::{SceneBuilder, ShapeBuilder};
pub use cast::{CastHit, CastPoint};
pub use colour::{colour, colour_names};
pub use error::{Error, ErrorKind};
pub use files::{SaveOptions, read_image, read_image_from, read_image_within, write_image};
pub use info::{SceneInfo, predicted_build_bytes};
pub use lumbre_formats::ReadOptions;
pub use lumbre_geometry::Ray;
pub use lumbre_math::{DVec2, DVec3, Transform};
pub use lumbre_render::film::Exposure;
pub use lumbre_render::{
    CancelToken, CheckpointSink, Denoised, ExplainedSample, Feature, FilmLayers, MergeError, NoProgress,
    Piece, PixelBounds, Progress, RayCounts, RenderError, RenderOptions, RenderState, Snapshot, State, Stats,
    Stop,
};
pub use lumbre_scene::{
    EnvironmentDesc, Ground, SceneDesc, Stage, StageLight, Staged, Surroundings, UpAxis, Viewpoint,
};
/// What happens along the path of one sample: see [`Scene::explain_sample`].
pub mod journal {
    pub use lumbre_render::transport::{End, Event, MergedPhoton, Met, SampledLight, Scattered, Source};
}

pub use parameter::{Parameter, ParameterKind, parameters};
pub use part::{Job, Part, PartError};
pub use picture::Picture;
pub use prepare::{Prepared, prepare};
pub use scene::{Scene, describe, open, open_with};
pub use setting::Setting;
pub use words::in_words;

/// Compiles the examples of the project's README.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
#[doc = include_str!("../../../docs/explain.md")]
struct ProjectReadme;
