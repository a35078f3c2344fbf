//! Where output goes: onto no file that was read, and under a default name onto no file that is not Lumbre's.

use std::collections::HashMap;
use std::fs;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use lumbre::formats::image::{ImageFormat, is_own_image};

use crate::failure::Failure;
use crate::staging::frame_name;

/// Whether a file on the command line is standard input or output.
pub(crate) fn is_standard_stream(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// What makes two names those of one file.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Identity {
    /// The device and the number of an existing file, by whatever name or link.
    Node(u64, u64),
    /// The real path.
    Path(PathBuf),
}

impl Identity {
    /// That of a regular file, or of a name that is free; `None` for folders, devices and pipes, in which nothing is
    /// replaced.
    fn of(path: &Path) -> Option<Self> {
        match fs::metadata(path) {
            Ok(meta) if !meta.is_file() => None,
            #[cfg(unix)]
            Ok(meta) => {
                use std::os::unix::fs::MetadataExt;
                Some(Self::Node(meta.dev(), meta.ino()))
            }
            #[cfg(windows)]
            Ok(_) => {
                let file = winapi_util::Handle::from_path_any(path).ok()?;
                let meta = winapi_util::file::information(file).ok()?;
                Some(Self::Node(meta.volume_serial_number(), meta.file_index()))
            }
            Err(_) => {
                // A link to nothing is written through.
                let folder = folder_of(path);
                let to = fs::read_link(path).map_or_else(|_| path.to_owned(), |to| folder.join(to));
                let name = to.file_name()?;
                // There, names that differ by case alone are one.
                let is_any_case = cfg!(any(windows, target_os = "macos"));
                let name =
                    if is_any_case { name.to_string_lossy().to_lowercase().into() } else { name.to_owned() };
                Some(Self::Path(folder_of(&to).canonicalize().ok()?.join(name)))
            }
        }
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether two names are those of one file, which need not exist.
fn is_same_file(a: &Path, b: &Path) -> bool {
    Identity::of(a).is_some_and(|a| Identity::of(b) == Some(a))
}

/// Files that were read, or would have been had they been there.
pub(crate) struct Inputs(HashMap<Identity, PathBuf>);

impl Inputs {
    /// These files.
    pub(crate) fn of<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Self {
        Self(paths.into_iter().filter_map(|path| Some((Identity::of(path)?, path.to_owned()))).collect())
    }

    /// The one that a write to this name would replace.
    fn find(&self, output: &Path) -> Option<&Path> {
        self.0.get(&Identity::of(output)?).map(PathBuf::as_path)
    }

    /// Refuses an output that is one of them, by whatever name.
    ///
    /// # Errors
    /// [`Failure::Usage`] that names both.
    pub(crate) fn refuse(&self, output: &Path) -> Result<(), Failure> {
        match self.find(output) {
            None => Ok(()),
            Some(input) => Err(Failure::Usage(format!(
                "{}: this is an input ({}), which would be overwritten (expected another name)",
                output.display(),
                input.display()
            ))),
        }
    }
}

/// The pictures of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Pictures {
    /// One.
    One,
    /// Frames of an animation, by number.
    Frames(RangeInclusive<u32>),
    /// The same number from every side.
    Turntable(u32),
}

impl Pictures {
    /// The names of all of them; a single one has that of the pattern.
    pub(crate) fn names<'a>(&self, pattern: &'a Path) -> Box<dyn Iterator<Item = PathBuf> + 'a> {
        let numbers = match self {
            Self::One => return Box::new(std::iter::once(pattern.to_owned())),
            Self::Frames(numbers) => numbers.clone(),
            Self::Turntable(count) => 1..=*count,
        };
        Box::new(numbers.map(|number| frame_name(pattern, number)))
    }

    /// What a default name has before its ending.
    fn infix(&self) -> &'static str {
        match self {
            Self::One => "",
            Self::Frames(_) => ".####",
            Self::Turntable(_) => ".turn.####",
        }
    }
}

/// Refuses names of pictures and statistics that are those of inputs, or of each other.
///
/// # Errors
/// [`Failure::Usage`] that says which.
pub(crate) fn refuse_inputs(
    pattern: Option<&Path>,
    pictures: &Pictures,
    statistics: Option<&Path>,
    inputs: &Inputs,
) -> Result<(), Failure> {
    if let Some(statistics) = statistics {
        inputs.refuse(statistics)?;
    }
    for name in pattern.into_iter().flat_map(|pattern| pictures.names(pattern)) {
        inputs.refuse(&name)?;
        if statistics.is_some_and(|statistics| is_same_file(statistics, &name)) {
            return Err(Failure::Usage(format!(
                "{}: the name of both the picture and its statistics (expected two names)",
                name.display()
            )));
        }
    }
    Ok(())
}

/// The name of pictures for which none is given, or with `#` for their number the pattern of their names: that of the
/// scene's film, or else of the scene's file, with the ending next to it. Where that is the name of a file that was
/// read, or of one that Lumbre did not write, it is `STEM.render.png`; the format is the same, but for PFM, which
/// cannot say who wrote it: EXR holds the same numbers.
///
/// # Errors
/// [`Failure::Usage`] when that name is not free either.
pub(crate) fn default_name(
    film: Option<&Path>,
    (scene, ending): (&Path, &str),
    pictures: &Pictures,
    statistics: Option<&Path>,
    inputs: &Inputs,
    quiet: bool,
) -> Result<PathBuf, Failure> {
    let stem = scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = stem.strip_suffix(".gz").unwrap_or(&stem);
    let stem = Path::new(stem).file_stem().map_or("picture".into(), |stem| stem.to_string_lossy());
    let stem = if stem == "-" { "picture" } else { &*stem };
    let infix = pictures.infix();
    let wanted = match film {
        Some(film) if *pictures == Pictures::One => film.to_owned(),
        _ => PathBuf::from(format!("{stem}{infix}.{ending}")),
    };
    // Why a name is not free.
    let obstacle = |pattern: &Path| {
        pictures.names(pattern).find_map(|name| {
            if let Some(input) = inputs.find(&name) {
                let by_another_name = match input == name {
                    true => String::new(),
                    false => format!(" ({})", input.display()),
                };
                Some(format!("{} is an input{by_another_name}", name.display()))
            } else if statistics.is_some_and(|statistics| is_same_file(statistics, &name)) {
                Some(format!("{} is the name of the statistics", name.display()))
            } else if name.is_file() && !is_own_image(&name) {
                Some(format!("{} exists and was not written by Lumbre", name.display()))
            } else {
                None
            }
        })
    };
    let Some(why) = obstacle(&wanted) else { return Ok(wanted) };
    let ending = match ImageFormat::from_path(&wanted) {
        Some(ImageFormat::Pfm) => "exr".into(),
        _ => wanted.extension().map_or("png".into(), |ending| ending.to_string_lossy()),
    };
    let other = PathBuf::from(format!("{stem}.render{infix}.{ending}"));
    if let Some(why_too) = obstacle(&other) {
        return Err(Failure::Usage(format!("{why}, {why_too} (expected -o with another name)")));
    }
    if !quiet {
        say!("{why}: the picture is saved as {}", other.display());
    }
    Ok(other)
}

/// Says that a file was replaced, if there was one.
pub(crate) struct Replaced<'a>(Option<&'a Path>);

impl<'a> Replaced<'a> {
    /// Looks before it is written.
    pub(crate) fn by(path: &'a Path) -> Self {
        Self(path.is_file().then_some(path))
    }

    /// Says so after it was written.
    pub(crate) fn say(&self) {
        if let Some(path) = self.0 {
            say!("{}: replaced", path.display());
        }
    }
}
