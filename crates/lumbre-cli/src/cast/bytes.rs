//! The bytes of a list of rays, with errors as the program reports them.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Chain, Cursor, Read};
use std::path::Path;

use lumbre::formats::{FormatError, InputStream, Limits};

use crate::failure::Failure;

/// Bytes that are read once, from beginning to end.
pub(super) struct Bytes {
    /// What [`Bytes::starts_with`] looked at stands in front.
    reader: BufReader<Chain<Cursor<Vec<u8>>, InputStream>>,
}

impl Bytes {
    /// Opens a file; `-` is standard input.
    ///
    /// # Errors
    /// [`Failure`] when it cannot be opened or is not a regular file.
    pub(super) fn open(path: &Path) -> Result<Self, Failure> {
        let limits = Limits::default();
        let stream = if path == Path::new("-") {
            InputStream::from_reader("standard input", io::stdin(), limits)
        } else {
            InputStream::open(path, limits)
        };
        Ok(Self::new(stream.map_err(failure)?))
    }

    fn new(stream: InputStream) -> Self {
        Self { reader: BufReader::with_capacity(1 << 18, Cursor::new(Vec::new()).chain(stream)) }
    }

    /// Bytes that come from elsewhere, under a name for messages.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be read.
    pub(super) fn from_reader(name: &str, reader: impl Read + 'static) -> Result<Self, Failure> {
        Ok(Self::new(InputStream::from_reader(name, reader, Limits::default()).map_err(failure)?))
    }

    /// Whether these come first; nothing may have been read before.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be read.
    pub(super) fn starts_with(mut self, magic: &[u8]) -> Result<(Self, bool), Failure> {
        let found = self.read_up_to(magic.len())?;
        let is_found = found == magic;
        let buffered = self.reader.buffer().to_vec();
        let (_, stream) = self.reader.into_inner().into_inner();
        let front = Cursor::new([found, buffered].concat());
        Ok((Self { reader: BufReader::with_capacity(1 << 18, front.chain(stream)) }, is_found))
    }

    /// The name for messages.
    pub(super) fn name(&self) -> &str {
        self.stream().name()
    }

    /// The file that the bytes stand in as they are, if they do.
    pub(super) fn file(&self) -> Option<&File> {
        self.stream().file()
    }

    /// The share of a file that was read, in [0, 1].
    pub(super) fn fraction(&self) -> Option<f64> {
        self.stream().fraction()
    }

    /// This many bytes, or all that are left.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be read.
    pub(super) fn read_up_to(&mut self, count: usize) -> Result<Vec<u8>, Failure> {
        let mut bytes = Vec::with_capacity(count);
        let read = (&mut self.reader).take(count as u64).read_to_end(&mut bytes);
        read.map_err(|e| self.failure(e))?;
        Ok(bytes)
    }

    /// Appends the bytes up to the end of the line, that included, but no more than `most`.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be read.
    pub(super) fn read_line(&mut self, most: usize, line: &mut Vec<u8>) -> Result<usize, Failure> {
        let read = (&mut self.reader).take(most as u64).read_until(b'\n', line);
        read.map_err(|e| self.failure(e))
    }

    /// Copies what is left, and counts it.
    ///
    /// # Errors
    /// [`Failure`] when it cannot be read or written.
    pub(super) fn copy_to(&mut self, out: &mut dyn io::Write) -> Result<u64, Failure> {
        let mut size = 0;
        loop {
            let piece = self.read_up_to(1 << 18)?;
            if piece.is_empty() {
                return Ok(size);
            }
            out.write_all(&piece).map_err(|e| Failure::Io(format!("temporary file: {e}")))?;
            size += piece.len() as u64;
        }
    }

    /// What an error of reading means.
    pub(super) fn failure(&self, error: io::Error) -> Failure {
        failure(self.stream().error(error))
    }

    fn stream(&self) -> &InputStream {
        self.reader.get_ref().get_ref().1
    }
}

fn failure(error: FormatError) -> Failure {
    lumbre::Error::from(error).into()
}
