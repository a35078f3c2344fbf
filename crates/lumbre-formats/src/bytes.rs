//! Little-endian numbers at places of a file, with errors that name the place.

use std::ops::Range;
use std::sync::Arc;

use crate::diagnostic::{Diagnostic, FormatError, Place};

/// Bytes of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bytes<'a> {
    bytes: &'a [u8],
    name: &'a Arc<str>,
    /// Where the first of them is in the file.
    base: u64,
    path: &'a str,
}

impl<'a> Bytes<'a> {
    pub(crate) fn new(bytes: &'a [u8], name: &'a Arc<str>) -> Self {
        Self { bytes, name, base: 0, path: "" }
    }

    /// The same, which begin at this byte of the file.
    pub(crate) fn from(self, base: u64) -> Self {
        Self { base, ..self }
    }

    /// The same, with what errors add to a place.
    pub(crate) fn at_path(self, path: &'a str) -> Self {
        Self { path, ..self }
    }

    pub(crate) fn all(self) -> &'a [u8] {
        self.bytes
    }

    pub(crate) fn len(self) -> u64 {
        self.bytes.len() as u64
    }

    pub(crate) fn name(self) -> &'a Arc<str> {
        self.name
    }

    pub(crate) fn base(self) -> u64 {
        self.base
    }

    /// What is wrong at a byte.
    pub(crate) fn fault(self, at: u64, message: impl Into<String>) -> Diagnostic {
        Diagnostic::error(message).at(Place::binary(
            self.name.clone(),
            self.base.saturating_add(at),
            self.path,
        ))
    }

    /// The bytes of a range, which may be outside.
    pub(crate) fn part(self, range: Range<u64>, what: &str) -> Result<&'a [u8], FormatError> {
        let inside = range.start <= range.end && range.end <= self.len();
        if inside {
            return Ok(&self.bytes[range.start as usize..range.end as usize]);
        }
        let wrong = self.fault(range.start.min(self.len()), format!("the file ends in a {what}"));
        let found = self.len().saturating_sub(range.start);
        let expected = range.end.saturating_sub(range.start);
        Err(wrong.found(format!("{found} bytes")).expected(format!("{expected} bytes")).into())
    }

    /// A range as bytes of the same file.
    pub(crate) fn slice(self, range: Range<u64>) -> Result<Self, FormatError> {
        let base = self.base + range.start;
        Ok(Self { bytes: self.part(range, "grid")?, base, ..self })
    }

    pub(crate) fn array<const N: usize>(self, at: u64, what: &str) -> Result<[u8; N], FormatError> {
        let part = self.part(at..at.saturating_add(N as u64), what)?;
        let mut array = [0; N];
        array.copy_from_slice(part);
        Ok(array)
    }

    pub(crate) fn u16(self, at: u64, what: &str) -> Result<u16, FormatError> {
        self.array(at, what).map(u16::from_le_bytes)
    }

    pub(crate) fn u32(self, at: u64, what: &str) -> Result<u32, FormatError> {
        self.array(at, what).map(u32::from_le_bytes)
    }

    pub(crate) fn i32(self, at: u64, what: &str) -> Result<i32, FormatError> {
        self.array(at, what).map(i32::from_le_bytes)
    }

    pub(crate) fn u64(self, at: u64, what: &str) -> Result<u64, FormatError> {
        self.array(at, what).map(u64::from_le_bytes)
    }

    pub(crate) fn i64(self, at: u64, what: &str) -> Result<i64, FormatError> {
        self.array(at, what).map(i64::from_le_bytes)
    }

    pub(crate) fn f32(self, at: u64, what: &str) -> Result<f32, FormatError> {
        self.array(at, what).map(f32::from_le_bytes)
    }

    pub(crate) fn f64(self, at: u64, what: &str) -> Result<f64, FormatError> {
        self.array(at, what).map(f64::from_le_bytes)
    }
}
