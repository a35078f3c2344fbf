//! Compressed buffer views.
use super::file::File;
use super::json::{Read, Value};

pub(super) fn unpacked(_file: &File<'_>, _view: Value<'_>) -> Read<Option<Vec<u8>>> {
    Ok(None)
}

pub(super) fn stride(_view: Value<'_>) -> Read<Option<usize>> {
    Ok(None)
}
