//! A scene as `lumbre render` would show it: staged, with its camera and its options.

use std::path::Path;

use lumbre::description::{FilmKind, IntegratorKind};
use lumbre::formats::Diagnostics;
use lumbre::{RenderOptions, Scene, SceneDesc};
use lumbre_viewer::Hidden;

use crate::defaults::Defaults;
use crate::failure::Failure;
use crate::reading::ReadingArguments;
use crate::render::camera;
use crate::staging::{Backdrop, StagingArguments};
use crate::view::ViewArguments;

/// How to show a scene.
pub(crate) struct SceneRequest<'a> {
    /// The name of the file, for messages.
    pub(crate) name: &'a Path,
    pub(crate) size: Option<(u32, u32)>,
    /// A camera by name or position.
    pub(crate) camera: Option<&'a str>,
    /// Overrides the scene's integrator.
    pub(crate) integrator: Option<IntegratorKind>,
    pub(crate) view: &'a ViewArguments,
    pub(crate) staging: &'a StagingArguments,
    pub(crate) reading: &'a ReadingArguments,
    /// What is not shown, but stands on the stage.
    pub(crate) hidden: Option<&'a Hidden>,
}

/// A staged scene.
pub(crate) struct PreparedScene {
    pub(crate) scene: Scene,
    pub(crate) defaults: Defaults,
    pub(crate) behind: Backdrop,
    pub(crate) options: RenderOptions,
    /// Whether its pictures show light, and not features such as normals.
    pub(crate) is_of_light: bool,
    pub(crate) diagnostics: Diagnostics,
}

/// Stages and builds a description.
///
/// # Errors
/// [`Failure`] by kind of error.
pub(crate) fn shown(mut desc: SceneDesc, wish: &SceneRequest<'_>) -> Result<PreparedScene, Failure> {
    let SceneRequest { name, size, camera: wanted, integrator, view, staging, reading, hidden } = *wish;
    let mut stage = staging.stage(size, reading.limits())?;
    view.set(&mut stage)?;
    let kind = integrator.unwrap_or(desc.integrator.kind);
    let is_of_light = kind.needs_light();
    stage.ground = Defaults::ground(stage.ground, is_of_light);
    let defaults = Defaults::new(stage.set(&mut desc), is_of_light);
    if let Some(hidden) = hidden {
        hidden.apply(&mut desc);
    }
    let behind = staging.behind(&defaults, reading.limits())?;
    let mut diagnostics = Diagnostics::with_strictness(reading.strictness());
    reading.check_build(&desc, &diagnostics)?;
    let scene = Scene::of_file(desc, name, &mut diagnostics)?;
    let mut options = scene.options();
    options.integrator.kind = kind;
    // What is looked at has no channels besides its colours.
    options.film = FilmKind::Rgb;
    options.spectral &= kind.carries_wavelengths();
    if let Some((width, height)) = size {
        options.resize(scene.resolved().film(), width, height);
    }
    if let Some(wanted) = wanted {
        options.camera = camera(&scene, wanted)?;
    }
    view.check_camera(&scene, options.camera)?;
    options.transparent = behind.is_transparent();
    Ok(PreparedScene { scene, defaults, behind, options, is_of_light, diagnostics })
}
