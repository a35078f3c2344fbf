//! The source of a viewer's scene: the program that starts the viewer decides how files are read and pictures are set
//! up.

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

/// The result of reading.
#[derive(Debug)]
pub struct Read {
    /// The scene, before it is staged.
    pub desc: SceneDesc,
    /// Every file that was read.
    pub files: Vec<PathBuf>,
    /// Warnings, with their places.
    pub warnings: Vec<String>,
}

/// A built scene, and how `lumbre render` would make and save its picture.
#[derive(Debug)]
pub struct Built {
    /// The scene.
    pub scene: Scene,
    /// The options of its picture.
    pub options: RenderOptions,
    /// How the picture is shown: exposure and tone mapping.
    pub save: SaveOptions,
    /// The background of the picture.
    pub background: Option<Background>,
    /// Whether the picture is denoised.
    pub denoise: bool,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Explains the colours of its pixels.
    pub explain: Option<Box<dyn Explain>>,
}

/// Why there is no scene, or no picture of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceError {
    /// The kind of error.
    pub kind: ErrorKind,
    /// The fault, for people, with its place in the file if known.
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

/// Explains the colour of a pixel.
pub trait Explain: Debug + Send + Sync {
    /// The available languages, as their codes and their own names.
    fn languages(&self) -> Vec<(&'static str, &'static str)>;

    /// The hash of the one script that its pages may run, as a Content Security Policy names it (`sha256-…`).
    fn script(&self) -> Option<&'static str>;

    /// A page of HTML, which may have styles and that script inline, and loads nothing.
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
    /// The name of the scene.
    fn name(&self) -> String;

    /// The files to watch even if none can be read.
    fn files(&self) -> Vec<PathBuf>;

    /// Reads the files.
    ///
    /// # Errors
    /// The fault and its place.
    fn read(&self, moment: &Moment) -> Result<Read, SourceError>;

    /// Sets a description on its stage, takes the hidden shapes out of it ([`Hidden::apply`]), and builds it.
    ///
    /// # Errors
    /// What is wrong.
    fn build(&self, desc: SceneDesc, hidden: &Hidden) -> Result<Built, SourceError>;

    /// Whether there is memory for a picture with these options.
    ///
    /// # Errors
    /// The needed and the available memory.
    fn check(&self, options: &RenderOptions) -> Result<(), SourceError>;

    /// The source of a scene that came through the page, with its files, in a folder of its own. The scene may be a
    /// stranger's, so it may use no file outside that folder.
    fn of_folder(&self, folder: &Path, scene: &Path) -> Arc<dyn Source>;

    /// The same scene in the light of a picture from all around.
    fn in_light_of(&self, picture: &Path) -> Arc<dyn Source>;

    /// Whether there is a scene at all.
    fn is_empty(&self) -> bool {
        false
    }
}
