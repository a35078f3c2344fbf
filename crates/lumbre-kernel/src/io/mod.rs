//! Trees as bytes, and in mapped files.

pub(crate) mod bytes;
pub(crate) mod mapped;
