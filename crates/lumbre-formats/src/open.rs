//! Opening any scene by the ending of its name.

use std::path::Path;

use lumbre_scene::SceneDesc;

use crate::diagnostic::quoted;
use crate::gltf::{GltfOptions, open_gltf};
use crate::obj::open_obj;
use crate::ply::open_ply;
use crate::stl::open_stl;
use crate::{Budget, Diagnostic, Diagnostics, FormatError, Limits, Place, Strictness, pbrt};

/// How a scene is read.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// What to do about input that is not as it should be.
    pub strictness: Strictness,
    /// How much may be read.
    pub limits: Limits,
    /// The time in seconds at which animations stand; `None` leaves them alone.
    pub frame: Option<f64>,
    /// How long the shutter is open about `frame`, in seconds: see [`GltfOptions::shutter`].
    pub shutter: f64,
    /// The one animation of a glTF to play: see [`GltfOptions::animation`].
    pub animation: Option<String>,
    /// The material variant of a glTF to wear.
    pub variant: Option<String>,
}

/// The kinds of scene file that are read, by the ending of their name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SceneFormat {
    Pbrt,
    Obj,
    Ply,
    Stl,
    Gltf,
}

/// The endings of [`open_scene`].
const ENDINGS: &str = ".pbrt, .pbrt.gz, .gltf, .glb, .obj, .ply, .ply.gz, .stl, .stl.gz";

impl SceneFormat {
    /// The kind of the file `path`, by its ending in any case.
    fn from_path(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let name = name.strip_suffix(".gz").unwrap_or(&name);
        match Path::new(name).extension()?.to_str()? {
            "pbrt" => Some(Self::Pbrt),
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            "gltf" | "glb" => Some(Self::Gltf),
            _ => None,
        }
    }
}

/// Reads the scene or the mesh in the file `path`: `.pbrt`, `.ply` and `.stl`, with `.gz` behind or without, `.gltf`, `.glb`
/// and `.obj`.
/// `-` is a scene in the language of pbrt from standard input.
///
/// Answers the description with all that was said about the file on the way: its warnings, and how many of each there were.
///
/// # Errors
/// [`FormatError`], with the place in the file.
pub fn open_scene(path: &Path, options: &ReadOptions) -> Result<(SceneDesc, Diagnostics), FormatError> {
    open_scenes(&[path], options)
}

/// Reads several scene files in the language of pbrt, one after another as if they were one; or one file of any kind.
///
/// # Errors
/// As [`open_scene`], and when there are several files of which one is of another kind, or no file at all.
pub fn open_scenes(
    paths: &[impl AsRef<Path>],
    options: &ReadOptions,
) -> Result<(SceneDesc, Diagnostics), FormatError> {
    let budget = Budget::new(options.limits);
    let mut diagnostics = Diagnostics::with_strictness(options.strictness);
    let formats: Result<Vec<_>, _> = paths.iter().map(|path| format_of(path.as_ref())).collect();
    let scene = match formats?[..] {
        [] => return Err(Diagnostic::error("no scene is given").into()),
        [SceneFormat::Pbrt, ..] => pbrt::read_files(paths, &budget, &mut diagnostics)?,
        [format] => read_one(paths[0].as_ref(), format, options, &budget, &mut diagnostics)?,
        [_, ..] => {
            let wrong = Diagnostic::error("only pbrt scenes can be read one after another");
            return Err(wrong.at(whole(paths[0].as_ref())).into());
        }
    };
    diagnostics.check()?;
    Ok((scene, diagnostics))
}

fn whole(path: &Path) -> Place {
    Place::whole(path.display().to_string())
}

fn format_of(path: &Path) -> Result<SceneFormat, FormatError> {
    if path.as_os_str() == "-" {
        return Ok(SceneFormat::Pbrt);
    }
    match SceneFormat::from_path(path) {
        Some(format) => Ok(format),
        None => {
            let found = path.extension().map_or("no ending".to_owned(), |e| quoted(&e.to_string_lossy()));
            let wrong = Diagnostic::error("unknown kind of scene file").at(whole(path)).found(found);
            Err(wrong.expected(ENDINGS).into())
        }
    }
}

/// A file of a kind that is read alone.
fn read_one(
    path: &Path,
    format: SceneFormat,
    options: &ReadOptions,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    match format {
        SceneFormat::Ply => open_ply(path, budget, diagnostics),
        SceneFormat::Obj => open_obj(path, budget, diagnostics),
        SceneFormat::Stl => open_stl(path, budget, diagnostics),
        SceneFormat::Gltf => {
            let gltf = GltfOptions {
                frame: options.frame,
                shutter: options.shutter,
                animation: options.animation.clone(),
                variant: options.variant.clone(),
            };
            open_gltf(path, &gltf, budget, diagnostics)
        }
        SceneFormat::Pbrt => pbrt::read_files(&[path], budget, diagnostics),
    }
}
