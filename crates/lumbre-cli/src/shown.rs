//! A scene as `lumbre render` would show it: staged, with its camera and its options.

use std::path::Path;

use lumbre::description::{FilmKind, IntegratorKind};
use lumbre::formats::Diagnostics;
use lumbre::{Prepared, RenderOptions, Scene, SceneDesc};
use lumbre_viewer::Hidden;

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
    pub(crate) prepared: Prepared,
    pub(crate) behind: Backdrop,
    pub(crate) options: RenderOptions,
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
    let prepared = lumbre::prepare(&mut desc, &stage, integrator);
    if let Some(hidden) = hidden {
        hidden.apply(&mut desc);
    }
    let behind = staging.behind(&prepared, reading.limits())?;
    let mut diagnostics = Diagnostics::with_strictness(reading.strictness());
    reading.check_build(&desc, &diagnostics)?;
    let scene = Scene::of_file(desc, name, &mut diagnostics)?;
    let mut options = prepared.options(&scene, integrator, size);
    // What is looked at has no channels besides its colours.
    options.film = FilmKind::Rgb;
    if let Some(wanted) = wanted {
        options.camera = camera(&scene, wanted)?;
    }
    view.check_camera(&scene, options.camera)?;
    options.transparent = behind.is_transparent();
    Ok(PreparedScene { scene, prepared, behind, options, diagnostics })
}
