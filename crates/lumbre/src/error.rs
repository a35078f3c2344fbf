//! What can go wrong in the façade.

use std::path::PathBuf;

use lumbre_formats::FormatError;
use thiserror::Error;

/// Why a scene cannot be opened, rendered or saved.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file says something wrong, cannot be read, or is beyond a limit.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// What was described makes no scene.
    #[error(transparent)]
    Build(#[from] lumbre_scene::BuildError),
    /// A file cannot be written.
    #[error("{}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The options ask for something that there is not.
    #[error("{0}")]
    Options(String),
}

/// The kinds of error, as a program's exit status tells them apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file says something wrong.
    Input,
    /// A file cannot be read or written.
    Io,
    /// A limit was reached.
    Limit,
    /// The options are wrong.
    Options,
}

impl Error {
    /// Which kind it is.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Format(FormatError::Io { .. }) | Self::Write { .. } => ErrorKind::Io,
            Self::Format(FormatError::Limit { .. }) => ErrorKind::Limit,
            Self::Format(_) | Self::Build(_) => ErrorKind::Input,
            Self::Options(_) => ErrorKind::Options,
        }
    }
}
