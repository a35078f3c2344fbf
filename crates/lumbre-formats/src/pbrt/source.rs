//! Places in scene files: files, the includes that led to them, and errors with their place.

use std::sync::Arc;

use crate::{Diagnostic, FormatError, LimitError, Place};

/// A line and a column of one of the [`Files`], both counted from 1, the column in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SourcePosition {
    pub file: u32,
    pub line: u32,
    pub column: u32,
}

/// The files read so far, with the place that included each.
#[derive(Debug, Default)]
pub(super) struct Files {
    list: Vec<(Arc<str>, Option<SourcePosition>)>,
}

impl Files {
    pub fn add(&mut self, name: Arc<str>, from: Option<SourcePosition>) -> u32 {
        self.list.push((name, from));
        self.list.len() as u32 - 1
    }

    pub fn name(&self, file: u32) -> &Arc<str> {
        &self.list[file as usize].0
    }

    pub fn place(&self, spot: SourcePosition) -> Place {
        Place::text(self.name(spot.file).clone(), u64::from(spot.line), u64::from(spot.column))
    }

    /// `diagnostic` at `spot`, with the chain of includes that led there.
    pub fn locate(&self, spot: SourcePosition, diagnostic: Diagnostic) -> Diagnostic {
        self.chain(spot).skip(1).fold(diagnostic.at(self.place(spot)), Diagnostic::included_from)
    }

    /// The place, that of the include that led to it, and so on outwards.
    fn chain(&self, spot: SourcePosition) -> impl Iterator<Item = Place> {
        std::iter::successors(Some(spot), |spot| self.list[spot.file as usize].1).map(|spot| self.place(spot))
    }
}

/// Why reading stops.
#[derive(Debug)]
pub(super) enum Fault {
    /// The scene is invalid here.
    Input(SourcePosition, Box<Diagnostic>),
    /// A limit is exceeded here.
    Limit(SourcePosition, Box<LimitError>),
    /// Another reader has already reported what and where.
    Other(Box<FormatError>),
    /// As [`Fault::Other`], of a file that is named here.
    Named(SourcePosition, Box<FormatError>),
}

pub(super) type Result<T, E = Fault> = std::result::Result<T, E>;

impl Fault {
    pub fn into_format_error(self, files: &Files) -> FormatError {
        match self {
            Self::Input(spot, diagnostic) => files.locate(spot, *diagnostic).into(),
            Self::Limit(spot, source) => {
                FormatError::Limit { place: Some(files.place(spot)), source: *source }
            }
            Self::Other(error) => *error,
            Self::Named(spot, error) => files.chain(spot).fold(*error, FormatError::included_from),
        }
    }
}

impl From<FormatError> for Fault {
    fn from(error: FormatError) -> Self {
        Self::Other(Box::new(error))
    }
}

impl SourcePosition {
    /// An error here.
    pub fn wrong(self, diagnostic: Diagnostic) -> Fault {
        Fault::Input(self, Box::new(diagnostic))
    }

    /// An error here with only a message.
    pub fn error(self, message: impl Into<String>) -> Fault {
        self.wrong(Diagnostic::error(message))
    }
}

/// Adds the place to the error of a limit.
pub(super) trait AtSpot<T> {
    fn at(self, spot: SourcePosition) -> Result<T>;
}

impl<T> AtSpot<T> for std::result::Result<T, LimitError> {
    fn at(self, spot: SourcePosition) -> Result<T> {
        self.map_err(|limit| Fault::Limit(spot, Box::new(limit)))
    }
}
