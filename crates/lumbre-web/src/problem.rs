//! Errors as a page shows them: a message, and its place in a file.

use std::fmt;

use lumbre::formats::{FormatError, Place, Position};
use lumbre::{Error, ErrorKind};
use lumbre_cli::Failure;
use serde::Serialize;

/// Why something cannot be done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// The kind of problem.
    pub kind: ProblemKind,
    /// What is wrong, with its place in front: what the program `lumbre` says after `error: `.
    pub message: String,
    /// The file at fault, by the name that it was given under.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The line in it, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
    /// The column, from 1, in characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<u64>,
}

/// The kinds of problem, as the exit status of the program distinguishes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ProblemKind {
    /// What was asked makes no sense.
    Usage,
    /// A file is invalid.
    Input,
    /// A file is missing.
    Files,
    /// It would take more memory or time than there is.
    Limit,
}

impl Problem {
    /// A problem without a place.
    pub(crate) fn new(kind: ProblemKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), file: None, line: None, column: None }
    }

    fn at(self, place: &Place) -> Self {
        let (line, column) = match place.position {
            Position::Text { line, column } | Position::Element { line, column, .. } => {
                (Some(line), Some(column))
            }
            Position::Whole | Position::Binary { .. } => (None, None),
        };
        Self { file: Some(place.file.to_string()), line, column, ..self }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Problem {}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        let kind = match error.kind() {
            ErrorKind::Input => ProblemKind::Input,
            ErrorKind::Io => ProblemKind::Files,
            ErrorKind::Limit => ProblemKind::Limit,
            ErrorKind::Options => ProblemKind::Usage,
        };
        let problem = Self::new(kind, error.to_string());
        match &error {
            Error::Format(error) => match error.to_diagnostic().place {
                Some(place) => problem.at(&place),
                None => problem,
            },
            _ => problem,
        }
    }
}

impl From<FormatError> for Problem {
    fn from(error: FormatError) -> Self {
        Error::from(error).into()
    }
}

impl From<Failure> for Problem {
    fn from(failure: Failure) -> Self {
        let kind = match failure {
            Failure::Usage(_) | Failure::Different | Failure::Interrupted(_) => ProblemKind::Usage,
            Failure::Input(_) => ProblemKind::Input,
            Failure::Io(_) => ProblemKind::Files,
            Failure::Limit(_) => ProblemKind::Limit,
        };
        Self::new(kind, failure.to_string())
    }
}
