//! Rays read piece by piece from an array.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use super::bytes::Bytes;
use super::npy::{Header, HeaderError};
use super::rays::{Piece, Rows};
use crate::failure::Failure;

/// Reads the rows of an array.
pub(super) struct ArrayReader {
    bytes: Bytes,
    header: Header,
    kind: Rows,
    /// Where columns come first: the file that they stand in, and where they begin.
    columns: Option<(File, u64)>,
    /// Rows that were read.
    rows: u64,
}

impl ArrayReader {
    /// Reads the header.
    ///
    /// # Errors
    /// [`Failure`] when it is wrong, and when a file has not the size that it asks for.
    pub(super) fn new(mut bytes: Bytes, kind: Rows) -> Result<Self, Failure> {
        let header = Header::read(|count| bytes.read_up_to(count)).map_err(|e| match e {
            HeaderError::Read(failure) => failure,
            HeaderError::Wrong(at, what) => wrong_at(&bytes, at, &what),
        })?;
        let mut this = Self { bytes, header, kind, columns: None, rows: 0 };
        let (least, most) = (kind.needed(), kind.columns().len());
        let found = this.header.columns;
        if found != least as u64 && found != most as u64 {
            let or_more = if most > least { format!(" or {most}") } else { String::new() };
            let expected = format!("{least}{or_more}: {}", kind.columns().join(", "));
            return Err(this.wrong(format!("{found} columns (expected {expected})")));
        }
        if let Some(file) = this.bytes.file() {
            let size = file.metadata().map_err(|e| this.bytes.failure(e))?.len();
            this.check_size(size.saturating_sub(this.header.length))?;
        }
        if this.header.columns_first {
            this.columns = Some(this.columns()?);
        }
        Ok(this)
    }

    /// What its rows are.
    pub(super) fn rows(&self) -> Rows {
        self.kind
    }

    /// What the array is.
    pub(super) fn header(&self) -> &Header {
        &self.header
    }

    /// The share that was read, in [0, 1].
    pub(super) fn fraction(&self) -> Option<f64> {
        Some(self.rows as f64 / self.header.rows.max(1) as f64)
    }

    /// The next rows.
    ///
    /// # Errors
    /// [`Failure`] when there is less or more data than the header says.
    pub(super) fn next(&mut self, most: usize) -> Result<Option<Piece>, Failure> {
        let rows = (self.header.rows - self.rows).min(most as u64);
        if rows == 0 {
            if self.columns.is_none() {
                let more = self.bytes.copy_to(&mut io::sink())?;
                self.check_size(self.rows * self.header.row_size() + more)?;
            }
            return Ok(None);
        }
        let size = (rows * self.header.row_size()) as usize;
        let bytes = match &self.columns {
            None => self.bytes.read_up_to(size)?,
            Some((file, start)) => {
                let mut bytes = vec![0; size];
                self.read_columns(file, *start, rows, &mut bytes).map_err(|e| self.bytes.failure(e))?;
                bytes
            }
        };
        if bytes.len() < size {
            self.check_size(self.rows * self.header.row_size() + bytes.len() as u64)?;
        }
        let first_ray = self.rows;
        self.rows += rows;
        Ok(Some(Piece { first_ray, bytes, line: 0 }))
    }

    /// The next `rows` of each column in turn.
    fn read_columns(&self, mut file: &File, start: u64, rows: u64, bytes: &mut [u8]) -> io::Result<()> {
        let size = self.header.number_size();
        for (column, part) in bytes.chunks_exact_mut((rows * size) as usize).enumerate() {
            let at = (column as u64 * self.header.rows + self.rows) * size;
            file.seek(SeekFrom::Start(start + at))?;
            file.read_exact(part)?;
        }
        Ok(())
    }

    /// The columns in a file to go to and fro in: the input itself, or a temporary copy.
    fn columns(&mut self) -> Result<(File, u64), Failure> {
        if let Some(file) = self.bytes.file() {
            let file = file.try_clone().map_err(|e| self.bytes.failure(e))?;
            return Ok((file, self.header.length));
        }
        let mut copy = tempfile::tempfile().map_err(|e| Failure::Io(format!("temporary file: {e}")))?;
        let size = self.bytes.copy_to(&mut copy)?;
        self.check_size(size)?;
        Ok((copy, 0))
    }

    fn check_size(&self, data: u64) -> Result<(), Failure> {
        self.header.check_size(data).map_err(|(at, what)| wrong_at(&self.bytes, at, &what))
    }

    fn wrong(&self, what: String) -> Failure {
        Failure::input(format!("{}: {what}", self.bytes.name()))
    }
}

fn wrong_at(bytes: &Bytes, at: u64, what: &str) -> Failure {
    Failure::input(format!("{}:byte {at}: {what}", bytes.name()))
}
