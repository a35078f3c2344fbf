//! Opening inputs: regular files only, decompressed if they are gzip, within the budget.

use std::borrow::Cow;
use std::fs::{File, OpenOptions};
use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

use flate2::bufread::MultiGzDecoder;

use crate::budget::{Budget, Hold};
use crate::devices::device;
use crate::diagnostic::{Diagnostic, FormatError, Place};

/// The bytes of a file, charged to the budget as long as they live.
#[derive(Debug)]
pub struct Input<'b> {
    name: Arc<str>,
    bytes: Vec<u8>,
    hold: Hold<'b>,
}

impl<'b> Input<'b> {
    /// Reads the file `path`, verbatim: no variable, `~` or `%2e` in it is expanded. A gzip file is
    /// decompressed.
    ///
    /// # Errors
    /// [`FormatError::Io`] when the system refuses, `path` is not a regular file (a folder, a pipe, a
    /// device) or the budget does not let it be opened ([`Budget::only`]), [`FormatError::Limit`] when the budget is
    /// exceeded, and [`FormatError::Input`] when gzip data is damaged.
    pub fn open(path: &Path, budget: &'b Budget) -> Result<Self, FormatError> {
        let name: Arc<str> = path.display().to_string().into();
        if !budget.allows(path) {
            let alone =
                io::Error::new(io::ErrorKind::PermissionDenied, "the scene may use no files but its own");
            return Err(FormatError::io(path, "cannot read", alone));
        }
        budget.path(path)?;
        let mut bytes = Vec::new();
        let mut hold = budget.hold(0, &name)?;
        let read = match budget.held() {
            Some(files) => {
                let missing =
                    || io::Error::new(io::ErrorKind::NotFound, "no such file among those that are held");
                let file = files.get(path).ok_or_else(|| FormatError::io(path, "cannot open", missing()))?;
                read_within(&file[..], file.len() as u64, &mut bytes, &mut hold, &name, |_| Ok(()))
            }
            None => {
                let (file, size) = open_regular(path)?;
                read_within(file, size, &mut bytes, &mut hold, &name, |_| Ok(()))
            }
        };
        read.map_err(|e| e.into_format_error(path, &name))?;
        let input = Self { name, bytes, hold };
        if input.bytes.starts_with(&[0x1F, 0x8B]) { input.unpacked(path, budget) } else { Ok(input) }
    }

    /// Bytes from elsewhere, such as standard input, with a name for messages.
    ///
    /// # Errors
    /// As for [`Input::open`].
    pub fn from_reader(name: &str, reader: impl Read, budget: &'b Budget) -> Result<Self, FormatError> {
        let name: Arc<str> = name.into();
        let path = Path::new(&*name);
        budget.file(&name)?;
        let mut bytes = Vec::new();
        let mut hold = budget.hold(0, &name)?;
        read_within(reader, 0, &mut bytes, &mut hold, &name, |_| Ok(()))
            .map_err(|e| e.into_format_error(path, &name))?;
        let input = Self { name: name.clone(), bytes, hold };
        if input.bytes.starts_with(&[0x1F, 0x8B]) { input.unpacked(path, budget) } else { Ok(input) }
    }

    /// [`Input::from_reader`] of a stream, which may never end: `is_text` says of its first bytes, as far as there are
    /// that many, whether they begin a text. The first byte of a text that no text has, a zero, ends the reading.
    ///
    /// # Errors
    /// As for [`Input::open`], that of `is_text`, and with the place of that byte.
    pub(crate) fn from_stream(
        name: &str,
        mut reader: impl Read,
        budget: &'b Budget,
        is_text: impl FnOnce(&[u8]) -> Result<bool, FormatError>,
    ) -> Result<Self, FormatError> {
        const FIRST: u64 = 64 << 10;
        let mut first = Vec::new();
        let read = (&mut reader).take(FIRST).read_to_end(&mut first);
        read.map_err(|e| FormatError::io(Path::new(name), "cannot read", e))?;
        if first.starts_with(&[0x1F, 0x8B]) || !is_text(&first)? {
            return Self::from_reader(name, first.chain(reader), budget);
        }
        let mut text = TextStream { inner: first.chain(reader), read: 0, zero: None };
        let input = Self::from_reader(name, &mut text, budget);
        let Some(offset) = text.zero else { return input };
        let wrong = Diagnostic::error("text with a byte that no text has");
        Err(wrong.at(Place::binary(name, offset, "")).found("byte 0x00").into())
    }

    fn unpacked(self, path: &Path, budget: &'b Budget) -> Result<Self, FormatError> {
        let packed = self.bytes.len() as u64;
        let mut bytes = Vec::new();
        let mut hold = budget.hold(0, &self.name)?;
        let within = |unpacked| budget.expansion(packed, unpacked, &self.name);
        // The size is found first, so that no memory is taken for a bomb, nor for growing.
        let fits = |unpacked| {
            within(unpacked)?;
            // Charged, and given back at once.
            budget.hold(unpacked, &self.name).map(drop)
        };
        let mut first = MultiGzDecoder::new(&self.bytes[..]);
        let mut second = MultiGzDecoder::new(&self.bytes[..]);
        let read = counted(&mut first, fits).map_err(|e| (e, first.get_ref().len())).and_then(|size| {
            read_within(&mut second, size, &mut bytes, &mut hold, &self.name, within)
                .map_err(|e| (e, second.get_ref().len()))
        });
        read.map_err(|(e, left)| match e {
            ReadError::Limit(limit) => FormatError::from(limit),
            ReadError::Io(source) => unpacking_error(path, &self.name, packed - left as u64, source),
        })?;
        Ok(Self { name: self.name, bytes, hold })
    }

    /// The name for messages: the path as given.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// The bytes as text, without a byte order mark.
    ///
    /// # Errors
    /// As for [`text`].
    pub fn text(&self) -> Result<&str, FormatError> {
        text(&self.bytes, &self.name)
    }

    /// The bytes, which stay charged to the budget.
    pub fn into_bytes(self) -> Vec<u8> {
        self.hold.keep();
        self.bytes
    }
}

impl Deref for Input<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes
    }
}

/// Opens a regular file for reading, and returns its size too. It asks what the file is before it opens it, and never
/// waits.
///
/// # Errors
/// [`FormatError::Io`] when the system refuses, and for folders, pipes, devices and the files of `/proc` and `/sys`,
/// which need not end.
pub fn open_regular(path: &Path) -> Result<(File, u64), FormatError> {
    let refuse = |action, source| FormatError::io(path, action, source);
    let not_regular = |kind: std::fs::FileType| {
        let what = if kind.is_dir() { "it is a folder" } else { "it is not a regular file" };
        refuse("cannot read", io::Error::new(io::ErrorKind::InvalidInput, what))
    };
    if device(path).is_some() {
        let what = "it is the name of a device";
        return Err(refuse("cannot read", io::Error::new(io::ErrorKind::InvalidInput, what)));
    }
    // Checked before opening, as opening a pipe would block; and again after, as it may have been replaced
    // in between.
    let before = std::fs::metadata(path).map_err(|e| refuse("cannot open", e))?;
    if !before.is_file() {
        return Err(not_regular(before.file_type()));
    }
    // By its real name: a link in /proc may lead to an ordinary file.
    let real = std::fs::canonicalize(path).map_err(|e| refuse("cannot open", e))?;
    if cfg!(target_os = "linux") && (real.starts_with("/proc") || real.starts_with("/sys")) {
        let what = "it is a file of the system's own (/proc, /sys)";
        return Err(refuse("cannot read", io::Error::new(io::ErrorKind::InvalidInput, what)));
    }
    let mut how = OpenOptions::new();
    how.read(true);
    // Some files of the system, such as /proc/kmsg, are regular and wait for more all the same.
    #[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
    {
        const O_NONBLOCK: i32 = 0o4000;
        std::os::unix::fs::OpenOptionsExt::custom_flags(&mut how, O_NONBLOCK);
    }
    let file = how.open(path).map_err(|e| refuse("cannot open", e))?;
    let meta = file.metadata().map_err(|e| refuse("cannot open", e))?;
    if !meta.is_file() {
        return Err(not_regular(meta.file_type()));
    }
    Ok((file, meta.len()))
}

/// What unpacking gzip data said, as an error of the input where its bytes are at fault. It had read `at` of them.
pub(crate) fn unpacking_error(path: &Path, name: &Arc<str>, at: u64, source: io::Error) -> FormatError {
    match source.kind() {
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof => {
            let place = Place::binary(name.clone(), at, "");
            Diagnostic::error("damaged gzip data").at(place).found(source).into()
        }
        _ => FormatError::io(path, "cannot unpack", source),
    }
}

/// `bytes` as UTF-8 text, without a byte order mark.
///
/// # Errors
/// When they are UTF-16 or UTF-32 by their byte order mark, and with the place of the first byte that is not UTF-8.
pub fn text<'a>(bytes: &'a [u8], name: &Arc<str>) -> Result<&'a str, FormatError> {
    refuse_wide(bytes, name)?;
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|e| {
        let offset = e.valid_up_to();
        Diagnostic::error("text is not UTF-8")
            .at(Place::of_offset(name.clone(), bytes, offset))
            .found(format!("byte 0x{:02x}", bytes[offset]))
            .into()
    })
}

/// Rejects UTF-16 and UTF-32.
///
/// # Errors
/// When `bytes` begin with the byte order mark of either.
pub fn refuse_wide(bytes: &[u8], name: &Arc<str>) -> Result<(), FormatError> {
    let foreign = if bytes.starts_with(&[0xFF, 0xFE, 0, 0]) || bytes.starts_with(&[0, 0, 0xFE, 0xFF]) {
        Some("UTF-32")
    } else if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        Some("UTF-16")
    } else {
        None
    };
    if let Some(found) = foreign {
        let wrong = Diagnostic::error("unsupported text encoding").at(Place::text(name.clone(), 1, 1));
        return Err(wrong.found(found).expected("UTF-8").into());
    }
    Ok(())
}

/// The bytes of a text, taken to UTF-8 where its byte order mark is that of UTF-16: for formats that programs of
/// Windows write. What they take is charged to the budget.
///
/// # Errors
/// When they are UTF-32 by their byte order mark, and as for [`Budget::bytes`].
pub(crate) fn narrow_text<'a>(
    bytes: &'a [u8],
    name: &Arc<str>,
    budget: &Budget,
) -> Result<Cow<'a, [u8]>, FormatError> {
    let unit: fn([u8; 2]) -> u16 = match bytes {
        [0xFF, 0xFE, 0, 0, ..] | [0, 0, 0xFE, 0xFF, ..] => {
            refuse_wide(bytes, name)?;
            return Ok(Cow::Borrowed(bytes));
        }
        [0xFF, 0xFE, ..] => u16::from_le_bytes,
        [0xFE, 0xFF, ..] => u16::from_be_bytes,
        _ => return Ok(Cow::Borrowed(bytes)),
    };
    // A unit takes up to three bytes.
    budget.bytes(bytes.len() as u64 / 2 * 3, name)?;
    let units = bytes[2..].as_chunks::<2>().0.iter().map(|&pair| unit(pair));
    let mut text = String::with_capacity(bytes.len() / 2 * 3);
    text.extend(char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)));
    Ok(Cow::Owned(text.into_bytes()))
}

/// `bytes` as text, with invalid UTF-8 replaced by U+FFFD: for formats older than UTF-8, where such bytes occur
/// in names and comments.
pub fn lossy_text(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes))
}

enum ReadError {
    Io(io::Error),
    Limit(crate::budget::LimitError),
}

impl ReadError {
    fn into_format_error(self, path: &Path, name: &Arc<str>) -> FormatError {
        match self {
            Self::Io(source) => FormatError::io(path, "cannot read", source),
            Self::Limit(limit) => FormatError::from(limit).or_at(|| Place::whole(name.clone())),
        }
    }
}

impl From<crate::budget::LimitError> for ReadError {
    fn from(limit: crate::budget::LimitError) -> Self {
        Self::Limit(limit)
    }
}

/// A text, which ends with an error where there is a zero.
struct TextStream<R> {
    inner: R,
    read: u64,
    zero: Option<u64>,
}

impl<R: Read> Read for TextStream<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(out)?;
        if let Some(at) = out[..read].iter().position(|&b| b == 0) {
            self.zero = Some(self.read + at as u64);
            return Err(io::ErrorKind::InvalidData.into());
        }
        self.read += read as u64;
        Ok(read)
    }
}

/// The number of bytes to the end, each piece checked.
fn counted(
    mut reader: impl Read,
    within: impl Fn(u64) -> Result<(), crate::budget::LimitError>,
) -> Result<u64, ReadError> {
    let mut piece = vec![0; 64 << 10];
    let mut count = 0;
    loop {
        match reader.read(&mut piece) {
            Ok(0) => return Ok(count),
            Ok(read) => count += read as u64,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(ReadError::Io(e)),
        }
        within(count)?;
    }
}

/// Reads to the end, charging capacity before it is allocated. It grows by half, never by what a header claims.
fn read_within(
    mut reader: impl Read,
    expected: u64,
    bytes: &mut Vec<u8>,
    hold: &mut Hold<'_>,
    name: &str,
    within: impl Fn(u64) -> Result<(), crate::budget::LimitError>,
) -> Result<(), ReadError> {
    const LEAST: usize = 64 << 10;
    const STEP: usize = 4 << 20;
    let mut room = 0;
    loop {
        if bytes.len() == room {
            // One more than expected, so that the end is detected without growing. Files of system folders have
            // size 0.
            let first = usize::try_from(expected).unwrap_or(usize::MAX).saturating_add(1).max(LEAST);
            let more = if room == 0 { first } else { (room / 2).max(LEAST) };
            hold.grow(more as u64, name)?;
            let refused = |_| crate::budget::LimitError {
                what: name.to_owned(),
                kind: crate::budget::LimitKind::Memory,
                needed: (room + more) as u64,
                limit: room as u64,
            };
            bytes.try_reserve_exact(more).map_err(refused)?;
            room += more;
        }
        // Into uninitialised capacity: clearing it would take longer than reading a cached file.
        let step = (room - bytes.len()).min(STEP);
        let read = (&mut reader).take(step as u64).read_to_end(bytes).map_err(ReadError::Io)?;
        if read < step {
            break;
        }
        within(bytes.len() as u64)?;
    }
    within(bytes.len() as u64).map_err(ReadError::Limit)
}

#[cfg(test)]
pub(crate) mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;
    use crate::budget::Limits;

    pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut packer = GzEncoder::new(Vec::new(), Compression::best());
        packer.write_all(bytes).unwrap();
        packer.finish().unwrap()
    }

    #[test]
    fn a_file_and_its_gzip_read_the_same_and_give_back_their_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let budget = Budget::default();
        let text: Vec<u8> = (0..300_000u32).flat_map(|i| i.to_le_bytes()).collect();
        for (name, contents) in [("plain.bin", text.clone()), ("packed.bin.gz", gzip(&text))] {
            let path = dir.path().join(name);
            std::fs::write(&path, contents).unwrap();
            let input = Input::open(&path, &budget).unwrap();
            assert!(*input == text[..], "{name}");
            assert!(budget.memory_held() >= text.len() as u64);
            drop(input);
            assert_eq!(budget.memory_held(), 0);
        }
    }

    #[test]
    fn only_regular_files_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let budget = Budget::default();
        let cases = [
            (dir.path().to_owned(), "it is a folder"),
            ("/dev/zero".into(), "it is not a regular file"),
            #[cfg(target_os = "linux")]
            ("/proc/self/pagemap".into(), "it is a file of the system's own"),
            #[cfg(target_os = "linux")]
            ("/proc/self/status".into(), "it is a file of the system's own"),
            (dir.path().join("absent.ply"), "cannot open"),
            ("$HOME/.profile".into(), "cannot open"),
        ];
        for (path, expected) in cases {
            let error = Input::open(&path, &budget).unwrap_err();
            assert!(matches!(error, FormatError::Io { .. }));
            assert!(error.to_string().contains(expected), "{error}");
        }
    }

    #[test]
    fn a_budget_of_some_files_lets_no_other_be_opened() {
        let dir = tempfile::tempdir().unwrap();
        let (own, other) = (dir.path().join("own.bin"), dir.path().join("other.bin"));
        for path in [&own, &other] {
            std::fs::write(path, b"bytes").unwrap();
        }
        let budget = Budget::default().only([own.clone()]);
        assert_eq!(&*Input::open(&own, &budget).unwrap(), b"bytes");
        for path in [&other, &dir.path().join("absent.bin")] {
            let error = Input::open(path, &budget).unwrap_err();
            assert!(
                error.to_string().contains("no files but its own"),
                "whether it is there does not show: {error}"
            );
        }
        // No one looks at them later, either.
        assert_eq!(budget.paths(), [own]);
    }

    #[test]
    fn a_folder_budget_opens_only_files_inside() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("dropped");
        std::fs::create_dir_all(folder.join("parts")).unwrap();
        std::fs::write(folder.join("parts/own.bin"), b"bytes").unwrap();
        std::fs::write(dir.path().join("other.bin"), b"secret").unwrap();
        let budget = Budget::default().only([]).and_in(folder.clone());
        assert_eq!(&*Input::open(&folder.join("parts/own.bin"), &budget).unwrap(), b"bytes");
        assert!(
            budget.exists(&folder.join("parts/own.bin"))
                && budget.exists(&folder.join("parts/../parts/./own.bin"))
        );
        let absent = Input::open(&folder.join("absent.bin"), &budget).unwrap_err();
        assert!(absent.to_string().contains("cannot open"), "{absent}");
        for way in ["../other.bin", "parts/../../other.bin", "../dropped/parts/own.bin", "../absent.bin"] {
            let path = folder.join(way);
            let error = Input::open(&path, &budget).unwrap_err();
            assert!(error.to_string().contains("no files but its own"), "{way}: {error}");
            assert!(!budget.exists(&path), "{way}");
        }
        for path in [dir.path().join("other.bin"), "/etc/passwd".into(), "parts/own.bin".into()] {
            assert!(!budget.allows(&path), "{}", path.display());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_refused_rather_than_waited_for() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        if !made.is_ok_and(|status| status.success()) {
            println!("skipped: no mkfifo here");
            return;
        }
        let error = Input::open(&path, &Budget::default()).unwrap_err();
        assert!(error.to_string().contains("it is not a regular file"), "{error}");
    }

    #[test]
    fn a_gzip_bomb_is_refused_by_ratio_and_by_memory() {
        let bomb = gzip(&vec![0; 80 << 20]);
        assert!(bomb.len() < 100_000);
        let by_ratio = Budget::default();
        let error = Input::from_reader("bomb.gz", &bomb[..], &by_ratio).unwrap_err();
        assert!(error.to_string().contains("--max-expansion"), "{error}");
        assert!(by_ratio.memory_peak() < 160 << 20);
        let by_memory = Budget::new(Limits { memory: 1 << 20, ..Limits::default() });
        let error = Input::from_reader("bomb.gz", &bomb[..], &by_memory).unwrap_err();
        assert!(error.to_string().contains("--max-memory"), "{error}");
        assert!(by_memory.memory_peak() <= 1 << 20);
        assert_eq!(by_memory.memory_held(), 0);
    }

    #[test]
    fn damaged_gzip_data_is_an_error_of_the_input() {
        let whole = gzip(b"ply\nformat ascii 1.0\n");
        for cut in 2..whole.len() {
            let error = Input::from_reader("m.ply.gz", &whole[..cut], &Budget::default()).unwrap_err();
            let said = error.to_string();
            let at =
                said.strip_prefix("m.ply.gz:byte ").unwrap().split_once(": damaged gzip data").unwrap().0;
            assert!(at.parse::<usize>().unwrap() <= cut, "{error}");
        }
    }

    /// A stream that never ends, and remembers how much was taken of it.
    struct Endless<'a>(&'a [u8], u64);

    impl Read for Endless<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let text = self.0.len().min(out.len());
            out[..text].copy_from_slice(&self.0[..text]);
            out[text..].fill(0);
            self.0 = &self.0[text..];
            self.1 += out.len() as u64;
            Ok(out.len())
        }
    }

    #[test]
    fn an_endless_stream_is_refused_at_its_first_wrong_byte() {
        let text = "Shape \"sphere\"\n".repeat(9000);
        let budget = Budget::default();
        let mut stream = Endless(text.as_bytes(), 0);
        let error = Input::from_stream("s", &mut stream, &budget, |_| Ok(true)).unwrap_err().to_string();
        assert!(error.contains(&format!("s:byte {}: text with a byte", text.len())), "{error}");
        assert!(stream.1 < 1 << 20, "{}", stream.1);
        // What is refused at its beginning is not read on.
        let mut stream = Endless(b"", 0);
        let refuse = |first: &[u8]| -> Result<bool, FormatError> {
            assert_eq!(first.len(), 64 << 10);
            Err(Diagnostic::error("unknown").into())
        };
        Input::from_stream("s", &mut stream, &budget, refuse).unwrap_err();
        assert_eq!(stream.1, 64 << 10);
        // What ends is all there, packed or not, text or not.
        for is_text in [true, false] {
            let read =
                |bytes: &[u8]| Input::from_stream("s", bytes, &budget, |_| Ok(is_text)).unwrap().to_vec();
            assert_eq!(read(text.as_bytes()), text.as_bytes());
            assert_eq!(read(&gzip(text.as_bytes())), text.as_bytes());
            assert_eq!(read(b""), b"");
        }
        let binary = Input::from_stream("s", &b"ply\0"[..], &budget, |_| Ok(false)).unwrap();
        assert_eq!(&*binary, b"ply\0");
    }

    #[test]
    fn files_are_counted() {
        let budget = Budget::new(Limits { files: 3, ..Limits::default() });
        for _ in 0..3 {
            Input::from_reader("part", &b"text"[..], &budget).unwrap();
        }
        let error = Input::from_reader("part", &b"text"[..], &budget).unwrap_err();
        assert!(error.to_string().contains("--max-files"), "{error}");
    }

    #[test]
    fn text_may_have_a_byte_order_mark_and_must_be_utf8() {
        let name: Arc<str> = "a.pbrt".into();
        assert_eq!(text(b"\xEF\xBB\xBFShape", &name).unwrap(), "Shape");
        let utf16 = text(b"\xFF\xFES\0", &name).unwrap_err().to_string();
        assert_eq!(utf16, "a.pbrt:1:1: unsupported text encoding (found UTF-16; expected UTF-8)");
        let latin1 = text(b"ok\nna\xEFve", &name).unwrap_err().to_string();
        assert_eq!(latin1, "a.pbrt:2:3: text is not UTF-8 (found byte 0xef)");
    }
}
