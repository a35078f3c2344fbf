//! Errors as exceptions.

use lumbre::{Error, ErrorKind};
use lumbre_cli::Failure;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyValueError};
use pyo3::{PyErr, create_exception};

create_exception!(
    lumbre._lumbre,
    LumbreError,
    PyValueError,
    "A scene, a file or an option is invalid; the message says where, what was found and what is accepted."
);

/// The exception for an error: files that cannot be read or written are [`OSError`](PyOSError), exceeded limits
/// [`MemoryError`](PyMemoryError), and all else is [`LumbreError`].
pub(crate) fn raised(error: Error) -> PyErr {
    let message = error.to_string();
    match error.kind() {
        ErrorKind::Io => match system_error(&error) {
            Some(code) => PyOSError::new_err((code, message)),
            None => PyOSError::new_err(message),
        },
        ErrorKind::Limit => PyMemoryError::new_err(message),
        ErrorKind::Input | ErrorKind::Options => LumbreError::new_err(message),
    }
}

/// The exception for why the program would fail: as of [`raised`].
pub(crate) fn failed(failure: Failure) -> PyErr {
    match failure {
        Failure::Io(message) => PyOSError::new_err(message),
        Failure::Limit(message) => PyMemoryError::new_err(message),
        failure => LumbreError::new_err(failure.to_string()),
    }
}

/// The system's number of the error, from which Python makes `FileNotFoundError` and its like.
fn system_error(error: &Error) -> Option<i32> {
    let mut source: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(error) = source {
        if let Some(error) = error.downcast_ref::<std::io::Error>() {
            return error.raw_os_error();
        }
        source = error.source();
    }
    None
}

/// The exception for what is wrong with a value.
pub(crate) fn invalid(message: impl std::fmt::Display) -> PyErr {
    LumbreError::new_err(message.to_string())
}
