//! Errors as exceptions.

use lumbre::formats::diagnostic::nearest_name;
use lumbre::{Error, ErrorKind};
use lumbre_cli::Failure;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyValueError};
use pyo3::{PyErr, PyResult, create_exception};

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

/// Converts a failure of the program, like [`raised`].
pub(crate) fn failed(failure: Failure) -> PyErr {
    match failure {
        Failure::Io(message) => PyOSError::new_err(message),
        Failure::Limit(message) => PyMemoryError::new_err(message),
        failure => LumbreError::new_err(failure.to_string()),
    }
}

/// Refuses an environment variable of Lumbre's with a value that it does not know.
pub(crate) fn check_environment() -> PyResult<()> {
    lumbre_simd::InstructionSet::from_environment().map(drop).map_err(|wrong| invalid(wrong.to_string()))
}

/// Numbers as a Python tuple.
pub(crate) fn tuple<T: std::fmt::Display>(numbers: &[T]) -> String {
    let words: Vec<String> = numbers.iter().map(T::to_string).collect();
    let end = if words.len() == 1 { "," } else { "" };
    format!("({}{end})", words.join(", "))
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

/// The exception for what does not fit into memory.
pub(crate) fn too_large(what: &str, bytes: u64, left: u64) -> PyErr {
    PyMemoryError::new_err(format!("{what}: needs {bytes} bytes of memory, {left} are left"))
}

/// The exception for memory that the system does not give.
pub(crate) fn no_memory<T>(count: usize) -> PyErr {
    let bytes = count as u128 * size_of::<T>() as u128;
    PyMemoryError::new_err(format!("the system has no {bytes} bytes of memory for this"))
}

/// An empty list with room for `count` items.
pub(crate) fn list<T>(count: usize) -> PyResult<Vec<T>> {
    let mut list = Vec::new();
    list.try_reserve_exact(count).map_err(|_| no_memory::<T>(count))?;
    Ok(list)
}

/// A list of `count` copies of `value`.
pub(crate) fn filled<T: Clone>(value: T, count: usize) -> PyResult<Vec<T>> {
    let mut list = list(count)?;
    list.resize(count, value);
    Ok(list)
}

/// The exception for what is wrong with a value.
pub(crate) fn invalid(message: impl std::fmt::Display) -> PyErr {
    LumbreError::new_err(message.to_string())
}

/// The error for a name that is not there.
pub(crate) fn unknown(noun: &str, name: &str, known: &[&str]) -> PyErr {
    let tip = nearest_name(name, known.iter().copied());
    let tip = tip.map_or_else(String::new, |near| format!("; did you mean {near}?"));
    invalid(format!("there is no {noun} \"{name}\" (expected {}{tip})", known.join(", ")))
}
