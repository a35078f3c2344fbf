//! Opening any scene by its file extension.

use std::path::Path;

use lumbre_scene::SceneDesc;

use crate::diagnostic::quoted;
use crate::gltf::{GltfOptions, open_gltf};
use crate::obj::open_obj;
use crate::ply::open_ply;
use crate::stl::open_stl;
use crate::{Budget, Diagnostic, Diagnostics, FormatError, Limits, Place, Strictness, pbrt};

/// Options of reading a scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// How to treat invalid input.
    pub strictness: Strictness,
    /// The resource limits.
    pub limits: Limits,
    /// The time in seconds at which animations are evaluated; `None` ignores them.
    pub frame: Option<f64>,
    /// The exposure in seconds, centred on `frame`: see [`GltfOptions::shutter`].
    pub shutter: f64,
    /// The animation of a glTF to play: see [`GltfOptions::animation`].
    pub animation: Option<String>,
    /// The material variant of a glTF.
    pub variant: Option<String>,
}

/// The supported scene formats, by file extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SceneFormat {
    Pbrt,
    Obj,
    Ply,
    Stl,
    Gltf,
}

/// The extensions of [`open_scene`].
const ENDINGS: &str = ".pbrt, .pbrt.gz, .gltf, .glb, .obj, .ply, .ply.gz, .stl, .stl.gz";

impl SceneFormat {
    /// The format of the file `path`, by its extension in any case.
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

/// Reads the scene or the mesh in the file `path`: `.pbrt`, `.ply` and `.stl`, each also with `.gz`, `.gltf`,
/// `.glb` and `.obj`. `-` is a scene in the pbrt language from standard input.
///
/// Returns the description and the diagnostics: the warnings, their counts, and the files that were read.
///
/// # Errors
/// [`FormatError`], with the place in the file.
pub fn open_scene(path: &Path, options: &ReadOptions) -> Result<(SceneDesc, Diagnostics), FormatError> {
    open_scenes(&[path], options)
}

/// Reads several scene files in the pbrt language, one after another as if they were one; or one file of any
/// format.
///
/// # Errors
/// As for [`open_scene`], and when there are several files of which one has another format, or no file at all.
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
    diagnostics.set_files_read(budget.paths());
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

/// A file of a format that is read alone.
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
