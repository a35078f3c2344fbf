//! No input is ever overwritten.

use std::path::Path;

use crate::failure::Failure;

/// Refuses an output that is one of the inputs, by whatever name.
///
/// # Errors
/// [`Failure::Usage`] that names both.
pub(crate) fn refuse_inputs<'a>(
    output: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    // What does not exist overwrites nothing.
    let Ok(real) = output.canonicalize() else { return Ok(()) };
    match inputs.into_iter().find(|input| input.canonicalize().is_ok_and(|input| input == real)) {
        Some(input) if real.is_file() => Err(Failure::Usage(format!(
            "{}: it is an input ({}), which would be overwritten (expected another name)",
            output.display(),
            input.display()
        ))),
        _ => Ok(()),
    }
}
