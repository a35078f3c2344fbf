//! Parts of renders in files: to go on from, and to join.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use lumbre_formats::image::ImageFormat;
use lumbre_formats::{FormatError, atomic_write, open_regular};
use lumbre_render::{MergeError, RenderOptions, RenderState, StateError};
use lumbre_scene::FilmKind;
use serde::{Deserialize, Serialize};

use crate::{Error, Picture, SaveOptions, in_words};

/// What a part file begins with.
const MAGIC: &[u8] = b"LUMBRE PART 4\n";
/// What an .exr ends with that holds a part, after the length of the part as eight bytes.
const TRAILER: &[u8] = b"LUMBREPT";
/// Bytes of a checksum.
const CHECKSUM: usize = 32;

/// Some samples of some pixels of a render, finished or not, and the identity of the render: a checkpoint, a share of
/// one machine of many, or what several such were merged to.
///
/// Parts of the same render come to the same bytes in whatever order and grouping they are merged.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The identity of the render.
    pub job: Job,
    /// The sums of its samples.
    pub state: RenderState,
}

/// What identifies a render, apart from which samples of which pixels are taken and when it stops.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// All that a sample depends on, by name: the version of Lumbre, options, and a hash of every file that was read.
    pub identity: BTreeMap<String, String>,
    /// How its picture is shown, by name, as the writer of the file understands it.
    pub shown: BTreeMap<String, String>,
    /// Width and height of the whole picture.
    pub size: (u32, u32),
    /// Whether the picture has coverage.
    pub transparent: bool,
}

impl Job {
    /// A render with these options of a scene that was read from these files. `settings` are what else the scene
    /// depends on, by name.
    ///
    /// # Errors
    /// [`Error::Format`] for a file that cannot be read.
    pub fn new<'p>(
        files: impl IntoIterator<Item = &'p Path>,
        settings: impl IntoIterator<Item = (String, String)>,
        options: &RenderOptions,
    ) -> Result<Self, Error> {
        let mut identity: BTreeMap<String, String> = settings.into_iter().collect();
        let sampler = &options.sampler;
        let entries = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("size", format!("{}x{}", options.width, options.height)),
            ("camera", options.camera.to_string()),
            ("integrator", in_words(&options.integrator)),
            ("sampler", in_words(&sampler.kind)),
            ("seed", sampler.seed.to_string()),
            ("filter", in_words(&options.filter)),
            ("exposure of samples", in_words(&options.exposure)),
            ("transparent", options.transparent.to_string()),
            ("features", options.features.to_string()),
            ("guides", options.guides.to_string()),
        ];
        identity.extend(entries.map(|(name, value)| (name.to_owned(), value)));
        identity.extend(options.view.as_ref().map(|view| ("view".to_owned(), in_words(view))));
        if options.spectral {
            identity.insert("spectral".to_owned(), "true".to_owned());
        }
        if options.film != FilmKind::Rgb {
            identity.insert("film".to_owned(), in_words(&options.film));
        }
        let mut folder = None;
        for file in files {
            // By their names from the folder of the first, so that a render is the same wherever its files are.
            let folder = folder.get_or_insert_with(|| file.parent().unwrap_or(Path::new("")));
            let name = file.strip_prefix(*folder).unwrap_or(file).display().to_string();
            identity.insert(format!("file {name}"), hash_of_file(file)?);
        }
        let size = (options.width, options.height);
        Ok(Self { identity, shown: BTreeMap::new(), size, transparent: options.transparent })
    }

    /// What a picture of some samples of every pixel says of itself: the version of Lumbre, a hash of all that the
    /// samples depend on, the seed, the samples and the camera. The same for every run.
    pub fn metadata(&self, samples: &std::ops::Range<u32>) -> Vec<(String, String)> {
        let mut hasher = blake3::Hasher::new();
        for (name, value) in &self.identity {
            hasher.update(format!("{name}\0{value}\0").as_bytes());
        }
        let of = |name: &str| self.identity.get(name).cloned().unwrap_or_default();
        [
            ("lumbreVersion", of("version")),
            ("lumbreScene", hasher.finalize().to_hex().to_string()),
            ("lumbreSeed", of("seed")),
            ("lumbreSamples", format!("{}..{}", samples.start, samples.end)),
            ("lumbreCamera", of("camera")),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    /// In what another render differs, as `seed 3 there, 5 here`, where the other one is here; nothing for the same
    /// render.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let names = self.identity.keys().chain(other.identity.keys());
        let names: std::collections::BTreeSet<&String> = names.collect();
        let of = |job: &Self, name: &String| job.identity.get(name).cloned();
        let of_name = |name: &String| match (of(self, name), of(other, name)) {
            (a, b) if a == b => None,
            (Some(_), Some(_)) if name.starts_with("file ") => Some(format!("{name} changed")),
            (a, b) => Some(difference(name, &a.unwrap_or_default(), &b.unwrap_or_default())),
        };
        names.into_iter().filter_map(of_name).collect()
    }
}

/// A difference of two renders: of options in words, only those that differ.
fn difference(name: &str, there: &str, here: &str) -> String {
    let parts = || there.split(", ").zip(here.split(", "));
    let is_aligned = there.split(", ").count() == here.split(", ").count();
    let (there, here) = match is_aligned && parts().count() > 1 {
        true => parts().filter(|(a, b)| a != b).unzip(),
        false => (vec![there], vec![here]),
    };
    let shown = |values: Vec<&str>| match values.join(", ") {
        text if text.is_empty() => "none".to_owned(),
        text => text,
    };
    format!("{name} {} there, {} here", shown(there), shown(here))
}

/// The hash of a file (BLAKE3) in hexadecimal digits.
fn hash_of_file(path: &Path) -> Result<String, Error> {
    let cannot_read = |e| Error::from(FormatError::io(path, "cannot read", e));
    let (mut file, _) = open_regular(path)?;
    let mut hasher = blake3::Hasher::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok(hasher.finalize().to_hex().to_string()),
            Ok(count) => hasher.update(&buffer[..count]),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(cannot_read(e)),
        };
    }
}

/// Why a file is no part.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PartError {
    /// It cannot be read.
    #[error("cannot open: {0}")]
    Io(#[from] io::Error),
    /// It is something else.
    #[error("not a part of a render (expected a file of --samples, --checkpoint or --keep-sums)")]
    NoPart,
    /// It would take more memory than it may.
    #[error("needs {needed} bytes of memory, limit {limit}; raise it with --max-memory")]
    TooLarge {
        /// The bytes that it takes.
        needed: u64,
        /// The bytes that it may take.
        limit: u64,
    },
    /// It is damaged.
    #[error("damaged or incomplete (wrong checksum): render this part again")]
    Damaged,
    /// It is of another version of Lumbre.
    #[error("written by another version of Lumbre: render this part again")]
    Version,
    /// Its head or its numbers make no sense.
    #[error("damaged ({0}): render this part again")]
    Invalid(String),
}

/// Hashes what passes through.
struct Hashed<T> {
    inner: T,
    hasher: blake3::Hasher,
    /// Bytes.
    length: u64,
}

impl<T> Hashed<T> {
    fn new(inner: T) -> Self {
        Self { inner, hasher: blake3::Hasher::new(), length: 0 }
    }

    fn count(&mut self, bytes: &[u8]) {
        self.hasher.update(bytes);
        self.length += bytes.len() as u64;
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.count(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<R: Read> Read for Hashed<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(bytes)?;
        self.count(&bytes[..count]);
        Ok(count)
    }
}

impl Part {
    /// Writes the bytes of a file of its own, and says how many. The sums are dropped as they are written, unless
    /// others share them.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_to(self, out: &mut dyn Write) -> io::Result<u64> {
        let head = serde_json::to_vec(&self.job).unwrap_or_default();
        let mut out = Hashed::new(out);
        out.write_all(MAGIC)?;
        out.write_all(&(head.len() as u64).to_le_bytes())?;
        out.write_all(&head)?;
        self.state.write_to(&mut out)?;
        let checksum = out.hasher.finalize();
        out.write_all(checksum.as_bytes())?;
        Ok(out.length)
    }

    /// The bytes of a file of its own.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.clone().write_to(&mut bytes).expect("memory takes all bytes");
        bytes
    }

    /// Reads a part from bytes, which may take this many bytes of memory.
    ///
    /// # Errors
    /// [`PartError`].
    pub fn from_bytes(bytes: &[u8], most_memory: u64) -> Result<Self, PartError> {
        Self::read_from(&mut &bytes[..], bytes.len() as u64, most_memory)
    }

    /// Reads `length` bytes, which may take `memory` bytes once unpacked. What is damaged is called that, and not what
    /// it seems to say.
    fn read_from(input: &mut dyn Read, length: u64, most_memory: u64) -> Result<Self, PartError> {
        let Some(body) = length.checked_sub(CHECKSUM as u64) else {
            let mut begin = vec![0; length as usize];
            input.read_exact(&mut begin)?;
            return Err(if begin.starts_with(MAGIC) { PartError::Damaged } else { PartError::NoPart });
        };
        let mut hashed = Hashed::new(input.take(body));
        let read = Self::read_body(&mut hashed, body, most_memory);
        if let Err(PartError::NoPart | PartError::Version | PartError::TooLarge { .. } | PartError::Io(_)) =
            read
        {
            return read;
        }
        let at_end = hashed.length == body;
        io::copy(&mut hashed, &mut io::sink())?;
        let checksum = hashed.hasher.finalize();
        let mut expected = [0; CHECKSUM];
        input.read_exact(&mut expected)?;
        match read {
            _ if checksum.as_bytes() != &expected => Err(PartError::Damaged),
            Ok(_) if !at_end => Err(PartError::Invalid("more follows than its head says".to_owned())),
            read => read,
        }
    }

    /// Reads what stands before the checksum.
    fn read_body(input: &mut dyn Read, length: u64, most_memory: u64) -> Result<Self, PartError> {
        let mut begin = vec![0; MAGIC.len()];
        if length < MAGIC.len() as u64 {
            return Err(PartError::NoPart);
        }
        input.read_exact(&mut begin)?;
        if begin != MAGIC {
            let is_of_another_version = begin[..MAGIC.len() - 2] == MAGIC[..MAGIC.len() - 2];
            return Err(if is_of_another_version { PartError::Version } else { PartError::NoPart });
        }
        let invalid = |e: &dyn std::fmt::Display| PartError::Invalid(e.to_string());
        let mut count = [0; 8];
        input.read_exact(&mut count).map_err(|_| PartError::Damaged)?;
        let count = u64::from_le_bytes(count);
        if count > length {
            return Err(PartError::Damaged);
        }
        let mut head = Vec::new();
        input.take(count).read_to_end(&mut head)?;
        let job: Job = serde_json::from_slice(&head).map_err(|e| invalid(&e))?;
        let state = RenderState::read_from(input, most_memory).map_err(|e| match e {
            StateError::TooLarge { needed } => PartError::TooLarge { needed, limit: most_memory },
            StateError::Io(error) => PartError::Io(error),
            other => invalid(&other),
        })?;
        let part = Self { job, state };
        let (bounds, (width, height)) = (part.state.bounds(), part.job.size);
        if bounds.x1 > width || bounds.y1 > height {
            return Err(PartError::Invalid("its pixels are not those of its picture".to_owned()));
        }
        Ok(part)
    }

    /// Bytes of memory that a part may take whatever its size, and more for each byte of its file: a part of an honest
    /// render takes a tenth of it.
    pub fn fair_memory(file_bytes: u64) -> u64 {
        const FREE: u64 = 64 << 20;
        const EACH: u64 = 32;
        FREE.saturating_add(file_bytes.saturating_mul(EACH))
    }

    /// Reads a part from a `.part` file, or from an .exr that holds one with its picture. `most_memory` says how many
    /// bytes of memory it may take, by the size of its file in bytes, and is asked before it is read: see
    /// [`Part::fair_memory`].
    ///
    /// # Errors
    /// [`PartError`].
    pub fn open(path: &Path, most_memory: impl FnOnce(u64) -> u64) -> Result<Self, PartError> {
        let (mut file, size) = open_regular(path).map_err(|e| match e {
            FormatError::Io { source, .. } => source,
            other => io::Error::other(other.to_string()),
        })?;
        let most_memory = most_memory(size);
        let (start, length) = place(&mut file, size)?;
        file.seek(SeekFrom::Start(start))?;
        Self::read_from(&mut io::BufReader::with_capacity(256 << 10, file), length, most_memory)
    }

    /// Whether a file holds a part, by how it begins and ends.
    pub fn is_in(path: &Path) -> bool {
        let look = || -> Option<bool> {
            let (mut file, size) = open_regular(path).ok()?;
            let mut begin = [0; MAGIC.len()];
            file.read_exact(&mut begin).ok()?;
            Some(begin == *MAGIC || place(&mut file, size).ok()?.0 > 0)
        };
        look().unwrap_or(false)
    }

    /// Writes a file of its own.
    ///
    /// # Errors
    /// [`Error::Format`].
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        self.clone().save_as(path)
    }

    /// [`Part::save`], which drops the sums as they are written, unless others share them.
    ///
    /// # Errors
    /// [`Error::Format`].
    pub fn save_as(self, path: &Path) -> Result<(), Error> {
        Ok(atomic_write(path, |file| self.write_to(file).map(drop))?)
    }

    /// The picture of its samples.
    pub fn picture(&self) -> Picture {
        Picture {
            rendered: self.state.to_rendered(self.job.transparent),
            whole: self.job.size,
            background: None,
            noisy: None,
        }
    }

    /// Adds the samples of another part of the same render.
    ///
    /// # Errors
    /// [`MergeError`]; nothing is changed then. Whether it is the same render is for [`Job::differences`] to say.
    pub fn merge(&mut self, other: &Self) -> Result<(), MergeError> {
        self.state.merge(&other.state)
    }
}

/// Where in a file of this size a part is, and how long it is: after the picture of an .exr, or else all of it.
fn place(file: &mut File, size: u64) -> Result<(u64, u64), PartError> {
    const END: u64 = (TRAILER.len() + 8) as u64;
    let Some(end) = size.checked_sub(END) else { return Ok((0, size)) };
    let mut last = [0; END as usize];
    file.seek(SeekFrom::Start(end))?;
    file.read_exact(&mut last)?;
    let (length, trailer) = last.split_at(8);
    let (Ok(length), true) = (<[u8; 8]>::try_from(length), trailer == TRAILER) else { return Ok((0, size)) };
    let length = u64::from_le_bytes(length);
    let start = end.checked_sub(length).ok_or(PartError::Damaged)?;
    Ok((start, length))
}

impl Picture {
    /// Writes an .exr of the picture that also holds a part: other programs read the picture alone.
    ///
    /// # Errors
    /// As [`Picture::save_with`].
    pub fn save_with_part(
        &self,
        path: &Path,
        options: &SaveOptions,
        layers: &[crate::Feature],
        part: &Part,
    ) -> Result<(), Error> {
        let picture = self.encode(ImageFormat::Exr, options, layers)?;
        Ok(atomic_write(path, |file| {
            file.write_all(&picture)?;
            let length = part.clone().write_to(file)?;
            file.write_all(&length.to_le_bytes())?;
            file.write_all(TRAILER)
        })?)
    }
}
