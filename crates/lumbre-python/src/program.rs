//! The program `lumbre`, from Python.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program `lumbre` with these arguments, the first being its name, and returns its exit status. Signals end
/// the process, so it is for a process of its own.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| lumbre_cli::run(words))
}
