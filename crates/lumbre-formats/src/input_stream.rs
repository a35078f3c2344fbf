//! Reading an input from beginning to end without holding it in memory.

use std::fmt;
use std::fs::File;
use std::io::{self, Chain, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::read::MultiGzDecoder;

use crate::budget::{Budget, LimitError, Limits};
use crate::diagnostic::FormatError;
use crate::input::{open_regular, unpacking_error};

/// The bytes of a regular file or of a reader in order, unpacked when they are gzip.
pub struct InputStream {
    path: PathBuf,
    name: Arc<str>,
    bytes: Bytes,
    /// The file itself, where its bytes are given as they are.
    file: Option<File>,
    /// The size of the file, which may be packed.
    size: Option<u64>,
    unpacked: u64,
    budget: Budget,
}

type Counted = Count<Chain<Cursor<Vec<u8>>, Box<dyn Read>>>;

enum Bytes {
    Plain(Counted),
    Packed(Box<MultiGzDecoder<Counted>>),
}

impl InputStream {
    /// Opens the file `path`, taken as it is.
    ///
    /// # Errors
    /// [`FormatError::Io`] when the system refuses or `path` is not a regular file.
    pub fn open(path: &Path, limits: Limits) -> Result<Self, FormatError> {
        let (file, size) = open_regular(path)?;
        let own = file.try_clone().map_err(|e| FormatError::io(path, "cannot open", e))?;
        let stream = Self::new(path, Box::new(file), Some(size), limits)?;
        let file = matches!(stream.bytes, Bytes::Plain(_)).then_some(own);
        Ok(Self { file, ..stream })
    }

    /// Bytes that come from elsewhere, such as standard input, under a name for messages.
    ///
    /// # Errors
    /// [`FormatError::Io`] when the system refuses.
    pub fn from_reader(name: &str, reader: impl Read + 'static, limits: Limits) -> Result<Self, FormatError> {
        Self::new(Path::new(name), Box::new(reader), None, limits)
    }

    fn new(
        path: &Path,
        mut reader: Box<dyn Read>,
        size: Option<u64>,
        limits: Limits,
    ) -> Result<Self, FormatError> {
        let mut magic = Vec::new();
        (&mut reader).take(2).read_to_end(&mut magic).map_err(|e| FormatError::io(path, "cannot read", e))?;
        let is_packed = magic == [0x1F, 0x8B];
        let bytes = Count { inner: Cursor::new(magic).chain(reader), bytes: 0 };
        Ok(Self {
            path: path.to_owned(),
            name: path.display().to_string().into(),
            bytes: if is_packed {
                Bytes::Packed(Box::new(MultiGzDecoder::new(bytes)))
            } else {
                Bytes::Plain(bytes)
            },
            file: None,
            size,
            unpacked: 0,
            budget: Budget::new(limits),
        })
    }

    /// The name for messages: the path as it was given.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// The file whose bytes these are, where they are not unpacked. It shares its position with this.
    pub fn file(&self) -> Option<&File> {
        self.file.as_ref()
    }

    /// The share of a file that was read, in [0, 1].
    pub fn fraction(&self) -> Option<f64> {
        self.size.map(|size| self.packed() as f64 / size.max(1) as f64)
    }

    /// What an error of reading this means.
    pub fn error(&self, error: io::Error) -> FormatError {
        match error.downcast::<LimitError>() {
            Ok(limit) => limit.into(),
            Err(error) if matches!(self.bytes, Bytes::Packed(_)) => {
                unpacking_error(&self.path, &self.name, self.packed(), error)
            }
            Err(error) => FormatError::io(&self.path, "cannot read", error),
        }
    }

    fn packed(&self) -> u64 {
        match &self.bytes {
            Bytes::Plain(bytes) => bytes.bytes,
            Bytes::Packed(decoder) => decoder.get_ref().bytes,
        }
    }
}

impl fmt::Debug for InputStream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InputStream")
            .field("name", &self.name)
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

impl Read for InputStream {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = match &mut self.bytes {
            Bytes::Plain(bytes) => return bytes.read(out),
            Bytes::Packed(decoder) => decoder.read(out)?,
        };
        self.unpacked += read as u64;
        let packed = self.size.unwrap_or_else(|| self.packed());
        self.budget.expansion(packed, self.unpacked, &self.name).map_err(io::Error::other)?;
        Ok(read)
    }
}

/// A reader that counts what it gives.
struct Count<R> {
    inner: R,
    bytes: u64,
}

impl<R: Read> Read for Count<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(out)?;
        self.bytes += read as u64;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::tests::gzip;

    fn read(mut stream: InputStream) -> Result<Vec<u8>, FormatError> {
        let mut bytes = Vec::new();
        match stream.read_to_end(&mut bytes) {
            Ok(_) => Ok(bytes),
            Err(e) => Err(stream.error(e)),
        }
    }

    #[test]
    fn a_file_and_its_gzip_give_the_same_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let text: Vec<u8> = (0..300_000u32).flat_map(|i| i.to_le_bytes()).collect();
        for (name, contents) in [("plain.bin", text.clone()), ("packed.bin.gz", gzip(&text))] {
            let path = dir.path().join(name);
            std::fs::write(&path, contents).unwrap();
            let stream = InputStream::open(&path, Limits::default()).unwrap();
            assert_eq!(stream.file().is_some(), name == "plain.bin");
            assert!(read(stream).unwrap() == text, "{name}");
        }
        let short = InputStream::from_reader("one byte", &b"x"[..], Limits::default()).unwrap();
        assert_eq!(read(short).unwrap(), b"x");
    }

    #[test]
    fn damaged_gzip_data_and_bombs_are_refused() {
        let whole = gzip(b"ox,oy,oz,dx,dy,dz\n");
        for cut in 2..whole.len() {
            let part = Cursor::new(whole[..cut].to_vec());
            let error = read(InputStream::from_reader("r.gz", part, Limits::default()).unwrap()).unwrap_err();
            let said = error.to_string();
            let at = said.strip_prefix("r.gz:byte ").unwrap().split_once(": damaged gzip data").unwrap().0;
            assert!(at.parse::<usize>().unwrap() <= cut, "{error}");
        }
        let bomb = Cursor::new(gzip(&vec![0; 80 << 20]));
        let error = read(InputStream::from_reader("b.gz", bomb, Limits::default()).unwrap()).unwrap_err();
        assert!(error.to_string().contains("--max-expansion"), "{error}");
    }
}
