//! Failures: messages and exit statuses.

use std::fmt;
use std::io::{ErrorKind, Write};

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// A comparison exceeded its limit (1).
    Different,
    /// The command line is invalid (2).
    Usage(String),
    /// A file is invalid (3).
    Input(String),
    /// A file cannot be read or written (4).
    Io(String),
    /// A limit was exceeded (5).
    Limit(String),
    /// A signal interrupted the work (128 and its number, as given).
    Interrupted(u8),
}

impl Failure {
    /// A failure of this kind.
    pub(crate) fn of_kind(kind: lumbre::ErrorKind, message: String) -> Self {
        match kind {
            lumbre::ErrorKind::Input => Self::Input(message),
            lumbre::ErrorKind::Io => Self::Io(message),
            lumbre::ErrorKind::Limit => Self::Limit(message),
            lumbre::ErrorKind::Options => Self::Usage(message),
        }
    }

    /// A file is invalid.
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self::Input(message.into())
    }

    /// The exit status.
    pub(crate) fn status(&self) -> u8 {
        match self {
            Self::Different => 1,
            Self::Usage(_) => 2,
            Self::Input(_) => 3,
            Self::Io(_) => 4,
            Self::Limit(_) => 5,
            Self::Interrupted(status) => *status,
        }
    }

    /// Whether the message has already been printed.
    pub(crate) fn is_silent(&self) -> bool {
        matches!(self, Self::Interrupted(_) | Self::Different)
    }
}

impl From<lumbre::Error> for Failure {
    fn from(error: lumbre::Error) -> Self {
        Self::of_kind(error.kind(), error.to_string())
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(message) | Self::Input(message) | Self::Io(message) | Self::Limit(message) => {
                f.write_str(message)
            }
            Self::Interrupted(_) => f.write_str("interrupted"),
            Self::Different => f.write_str("the difference is above its limit"),
        }
    }
}

/// Prints text to standard output. The reader may close the pipe: `lumbre info … | head -1`.
///
/// # Errors
/// [`Failure::Io`] when it cannot be written.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    print_bytes(text.as_bytes())
}

/// [`print()`] of bytes.
///
/// # Errors
/// As for [`print()`].
pub(crate) fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::Io(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}
