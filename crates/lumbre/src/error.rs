//! Errors of this crate.

use std::path::PathBuf;

use lumbre_formats::FormatError;
use lumbre_kernel::{ClosestPointError, WindingNumberError};
use lumbre_render::RenderError;
use lumbre_scene::BuildError;
use thiserror::Error;

/// Why a scene cannot be opened, asked, rendered or saved.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file is invalid, cannot be read, or exceeds a limit.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The description is invalid.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A file cannot be written.
    #[error("{}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The render options are invalid.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A shape that may be nearer than all others has no method for nearest points.
    #[error(transparent)]
    ClosestPointError(#[from] ClosestPointError),
    /// A shape has no inside.
    #[error(transparent)]
    WindingNumberError(#[from] WindingNumberError),
    /// The options for saving are invalid.
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
            Self::Format(_) | Self::Build(_) | Self::ClosestPointError(_) | Self::WindingNumberError(_) => {
                ErrorKind::Input
            }
            Self::Render(_) | Self::Options(_) => ErrorKind::Options,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error as _;
    use std::path::Path;

    use super::*;

    #[test]
    fn an_error_keeps_what_caused_it() {
        let missing = Path::new("no such folder/scene.pbrt");
        let error = crate::open(missing).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
        let source = error.source().expect("what the system said");
        assert_eq!(source.downcast_ref().map(std::io::Error::kind), Some(std::io::ErrorKind::NotFound));

        let scene = crate::SceneBuilder::new().build().unwrap();
        let mut options = scene.options();
        options.width = 0;
        let error = scene.render(&options).unwrap_err();
        assert!(matches!(error, Error::Render(RenderError::Size { width: 0, .. })), "{error:?}");
    }
}
