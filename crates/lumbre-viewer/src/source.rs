//! Where a viewer gets its scene from: whoever starts it says how files are read and pictures are set up.

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lumbre::{Background, ErrorKind, RenderOptions, SaveOptions, Scene, SceneDesc};

use crate::tree::Hidden;

/// Which moment and which variant of a scene to read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moment {
    /// The time in seconds at which animations stand; `None` for the scene at rest.
    pub time: Option<f64>,
    /// The material variant.
    pub variant: Option<String>,
}

/// What was read.
#[derive(Debug)]
pub struct Read {
    /// The scene, before it is set on a stage.
    pub desc: SceneDesc,
    /// Every file that was read.
    pub files: Vec<PathBuf>,
    /// Warnings, with their places.
    pub warnings: Vec<String>,
}

/// A scene that is ready, and how `lumbre render` would make and save its picture.
#[derive(Debug)]
pub struct Built {
    /// The scene.
    pub scene: Scene,
    /// The options of its picture.
    pub options: RenderOptions,
    /// How the picture is shown: exposure and tone mapping.
    pub save: SaveOptions,
    /// What is laid behind the picture.
    pub background: Option<Background>,
    /// Whether the noise is taken out of the picture.
    pub denoise: bool,
    /// Warnings.
    pub warnings: Vec<String>,
    /// What tells how the colours of its pixels come about.
    pub explain: Option<Box<dyn Explain>>,
}

/// Why there is no scene, or no picture of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceError {
    /// What kind of error it is.
    pub kind: ErrorKind,
    /// What is wrong, for people, with the place in the file where there is one.
    pub message: String,
}

impl std::fmt::Display for SourceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for SourceError {}

impl From<lumbre::Error> for SourceError {
    fn from(error: lumbre::Error) -> Self {
        Self { kind: error.kind(), message: error.to_string() }
    }
}

/// Tells how the colour of a pixel comes about.
pub trait Explain: Debug + Send + Sync {
    /// The languages in which it does, as their codes and their own names.
    fn languages(&self) -> Vec<(&'static str, &'static str)>;

    /// A page of HTML, which may have styles, and neither runs nor loads anything.
    ///
    /// # Errors
    /// Why there is none, for people.
    fn page(
        &self,
        scene: &Scene,
        options: &RenderOptions,
        pixel: (u32, u32),
        language: &str,
    ) -> Result<String, String>;
}

/// How a scene is read and built.
pub trait Source: Send + Sync {
    /// What to call the scene.
    fn name(&self) -> String;

    /// The files to watch even if none can be read.
    fn files(&self) -> Vec<PathBuf>;

    /// Reads the files.
    ///
    /// # Errors
    /// What is wrong, and where.
    fn read(&self, moment: &Moment) -> Result<Read, SourceError>;

    /// Sets a description on its stage, takes the hidden shapes out of it ([`Hidden::apply`]), and builds it.
    ///
    /// # Errors
    /// What is wrong.
    fn build(&self, desc: SceneDesc, hidden: &Hidden) -> Result<Built, SourceError>;

    /// Whether there is memory for a picture with these options.
    ///
    /// # Errors
    /// How much it takes and how much there is.
    fn check(&self, options: &RenderOptions) -> Result<(), SourceError>;

    /// The same for a scene that came through the page, with the files beside it, in a folder of its own. It may be a stranger's, so that it
    /// may use no file outside that folder.
    fn of_folder(&self, folder: &Path, scene: &Path) -> Arc<dyn Source>;

    /// The same scene in the light of a picture from all around.
    fn in_light_of(&self, picture: &Path) -> Arc<dyn Source>;

    /// Whether there is a scene at all.
    fn is_empty(&self) -> bool {
        false
    }
}
