//! Opening a scene as the command line asks, and saying what was found on the way.

use std::path::{Path, PathBuf};

use clap::Args;
use lumbre::formats::{Diagnostics, Limits, Strictness};
use lumbre::{Error, Scene, SceneDesc};

use crate::failure::Failure;
use crate::units;

/// How scene files are read.
#[derive(Args)]
pub struct ReadingArguments {
    /// Warnings are errors.
    #[arg(long, conflicts_with = "lenient")]
    strict: bool,
    /// Drop what is broken (faces with impossible vertices, say) with a warning instead of an error.
    #[arg(long)]
    lenient: bool,
    /// The time in seconds at which the animations of a glTF stand.
    #[arg(long, value_name = "T", value_parser = seconds)]
    frame: Option<f64>,
    /// The material variant of a glTF to wear.
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Bytes that reading may hold at a time.
    #[arg(long, value_name = "SIZE", value_parser = units::bytes)]
    max_memory: Option<u64>,
    /// Vertices, faces, shapes and parameters that may be read.
    #[arg(long, value_name = "N", hide_short_help = true)]
    max_elements: Option<u64>,
    /// Levels of includes and blocks.
    #[arg(long, value_name = "N", hide_short_help = true)]
    max_nesting: Option<u32>,
    /// Files that may be opened.
    #[arg(long, value_name = "N", hide_short_help = true)]
    max_files: Option<u64>,
    /// Bytes that a compressed byte may become.
    #[arg(long, value_name = "N", hide_short_help = true)]
    max_expansion: Option<u64>,
}

fn seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|t: &f64| t.is_finite()).ok_or_else(|| "expected a number of seconds".to_owned())
}

impl ReadingArguments {
    fn limits(&self) -> Limits {
        let default = Limits::default();
        Limits {
            memory: self.max_memory.unwrap_or(default.memory),
            elements: self.max_elements.unwrap_or(default.elements),
            nesting: self.max_nesting.unwrap_or(default.nesting),
            files: self.max_files.unwrap_or(default.files),
            expansion: self.max_expansion.unwrap_or(default.expansion),
        }
    }

    /// Whether warnings are errors.
    pub fn is_strict(&self) -> bool {
        self.strict
    }

    /// What warnings and breaches are.
    pub fn strictness(&self) -> Strictness {
        match (self.strict, self.lenient) {
            (true, _) => Strictness::Strict,
            (_, true) => Strictness::Lenient,
            _ => Strictness::Normal,
        }
    }

    /// Reads one or more files as one scene.
    ///
    /// # Errors
    /// [`Failure`] by what went wrong.
    pub fn open(&self, paths: &[PathBuf]) -> Result<(Scene, Diagnostics), Failure> {
        let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        lumbre::open_with(&paths, &self.options()).map_err(Failure::from)
    }

    /// Reads one or more files as one description.
    ///
    /// # Errors
    /// As [`ReadingArguments::open`].
    pub fn describe(&self, paths: &[PathBuf]) -> Result<(SceneDesc, Diagnostics), Failure> {
        let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        lumbre::describe(&paths, &self.options()).map_err(Failure::from)
    }

    fn options(&self) -> lumbre::ReadOptions {
        lumbre::ReadOptions {
            limits: self.limits(),
            strictness: self.strictness(),
            frame: self.frame,
            variant: self.variant.clone(),
        }
    }
}

/// Prints warnings to standard error, and their number where many were left out.
pub fn print_warnings(diagnostics: &Diagnostics) {
    for line in diagnostics.lines() {
        say!("{line}");
    }
    match diagnostics.warnings() {
        0 => {}
        1 => say!("1 warning"),
        n => say!("{n} warnings"),
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let message = error.to_string();
        match error.kind() {
            lumbre::ErrorKind::Input => Self::Input(message),
            lumbre::ErrorKind::Io => Self::Io(message),
            lumbre::ErrorKind::Limit => Self::Limit(message),
            lumbre::ErrorKind::Options => Self::Usage(message),
        }
    }
}
