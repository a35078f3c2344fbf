//! Errors of this crate.

use std::path::PathBuf;

use lumbre_formats::FormatError;
use thiserror::Error;

/// Why a scene cannot be opened, rendered or saved.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file is invalid, cannot be read, or exceeds a limit.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The description is invalid.
    #[error(transparent)]
    Build(#[from] lumbre_scene::BuildError),
    /// A file cannot be written.
    #[error("{}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The options are invalid.
    #[error("{0}")]
    Options(String),
}

/// The kinds of error, as the program's exit status distinguishes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file is invalid.
    Input,
    /// A file cannot be read or written.
    Io,
    /// A limit was exceeded.
    Limit,
    /// The options are invalid.
    Options,
}

impl Error {
    /// The kind of error.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Format(FormatError::Io { .. }) | Self::Write { .. } => ErrorKind::Io,
            Self::Format(FormatError::Limit { .. }) => ErrorKind::Limit,
            Self::Format(_) | Self::Build(_) => ErrorKind::Input,
            Self::Options(_) => ErrorKind::Options,
        }
    }
}
