//! glTF 2.0 (Khronos, 2021), as JSON and as GLB, with its extensions.
//!
//! Everything in a file is validated, used or not. A violation of glTF whose meaning is clear is an error, and
//! a warning when lenient. Errors name the place by its JSON pointer.
//!
//! Light is photometric: radiance is in nits, so that `emissiveFactor`, candelas and lux agree without a
//! factor. Points and lines become spheres and cylinders with a radius of 0.4 % and 0.2 % of the diagonal of
//! the model's bounding box, and less if there are very many; without a material and colours they are blue.

mod accessor;
mod animation;
mod check;
mod container;
#[cfg(feature = "draco")]
mod draco;
mod expansion;
mod exposure;
mod extensions;
mod file;
mod graph;
mod ies;
mod json;
#[cfg(feature = "basisu")]
mod ktx;
mod listing;
mod load;
pub mod material;
mod mesh;
mod meshopt;
mod options;
mod pointer;
mod scene;
mod shade;
mod tangents;
mod texture;
mod uri;

use std::path::Path;
use std::sync::Arc;

use lumbre_scene::SceneDesc;

use self::animation::Playing;
use self::file::File;
use self::json::{Json, Read, Value};
use self::load::load;
pub use self::options::GltfOptions;
use crate::budget::{Budget, Limits};
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, quoted_bytes};
use crate::input::{Input, text};

/// Reads the glTF or GLB file `path`; other files are found relative to its folder.
///
/// # Errors
/// As for [`Input::open`] and [`read_gltf`].
pub fn open_gltf(
    path: &Path,
    options: &GltfOptions,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    let input = Input::open(path, budget)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    read_gltf(&input, input.name(), folder, options, budget, diagnostics)
}

/// Reads a glTF or a GLB from the bytes of its file. Other files are found relative to `folder`.
///
/// # Errors
/// [`FormatError::Input`] with the JSON pointer where the file is invalid or requires an unknown extension,
/// [`FormatError::Limit`], and [`FormatError::Io`] for other files.
pub fn read_gltf(
    bytes: &[u8],
    name: &Arc<str>,
    folder: &Path,
    options: &GltfOptions,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    read(bytes, name, folder, options, budget, diagnostics)
        .map_err(|e| e.or_at(|| Place::whole(name.clone())))
}

/// Whether a file is named as a GLB file, packed or not.
fn has_name_of_glb(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.strip_suffix(".gz").unwrap_or(&name).ends_with(".glb")
}

/// Whether a text may be JSON: an object, or a text that says its encoding.
fn is_like_json(bytes: &[u8]) -> bool {
    let marks: [&[u8]; 3] = [b"\xEF\xBB\xBF", b"\xFE\xFF", b"\xFF\xFE"];
    bytes.trim_ascii_start().starts_with(b"{") || marks.iter().any(|mark| bytes.starts_with(mark))
}

fn read(
    bytes: &[u8],
    name: &Arc<str>,
    folder: &Path,
    options: &GltfOptions,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Read<SceneDesc> {
    let is_glb = bytes.starts_with(container::MAGIC);
    let (text, within, binary) = if is_glb {
        let glb = container::read(bytes, name, diagnostics)?;
        let text = std::str::from_utf8(glb.json).map_err(|e| {
            let at = e.valid_up_to();
            let wrong = Diagnostic::error("text is not UTF-8").at(Place::binary(
                name.clone(),
                glb.json_start + at as u64,
                "",
            ));
            FormatError::from(wrong.found(format!("byte 0x{:02x}", glb.json[at])))
        })?;
        (text, Some(glb.json_start), glb.binary)
    } else {
        if bytes.is_empty() {
            return Err(Diagnostic::error("empty file")
                .at(Place::whole(name.clone()))
                .expected("a glTF")
                .into());
        }
        if has_name_of_glb(name) && !is_like_json(bytes) {
            let wrong = Diagnostic::error("not a GLB file").at(Place::binary(name.clone(), 0, ""));
            let start = quoted_bytes(&bytes[..bytes.len().min(4)]);
            return Err(wrong.found(start).expected("it to begin with \"glTF\"").into());
        }
        (text(bytes, name)?, None, None)
    };
    let plain = Json::read(text, name, within, budget)?;
    let animated = match options.frame {
        Some(time) if text.contains("KHR_animation_pointer") => {
            animated(&plain, options, time, name, folder, budget, binary, is_glb)?
        }
        _ => None,
    };
    let changed = animated.as_ref().map(|text| Json::read(text, name, within, budget)).transpose()?;
    let json = changed.as_ref().unwrap_or(&plain);
    let root = json.root().object()?;
    version(root)?;
    let mut file = File::new(root, name, folder, budget, std::mem::take(diagnostics));
    let scene = extensions::check(&file, root)
        .and_then(|()| load(&mut file, binary, is_glb))
        .and_then(|()| scene::read(&file, options));
    *diagnostics = file.into_diagnostics();
    scene
}

/// The JSON with the values that animations change by pointers at a time; `None` if there are none.
#[expect(clippy::too_many_arguments, reason = "what the file is, and what is asked of it")]
fn animated(
    json: &Json<'_>,
    options: &GltfOptions,
    time: f64,
    name: &Arc<str>,
    folder: &Path,
    budget: &Budget,
    binary: Option<&[u8]>,
    is_glb: bool,
) -> Read<Option<String>> {
    // This load is temporary, and errors are reported when the whole is read.
    let own = Budget::new(Limits { memory: budget.memory_left(), ..*budget.limits() });
    let root = json.root().object()?;
    let mut file = File::new(root, name, folder, &own, Diagnostics::default());
    load(&mut file, binary, is_glb)?;
    let changes = Playing::read(&file, options)?.changes(time)?;
    if changes.is_empty() {
        return Ok(None);
    }
    let text = changes.apply(root)?;
    budget.bytes(text.len() as u64, "glTF as animations leave it")?;
    Ok(Some(text))
}

/// Checks that the file's version is supported: 2, with any minor version unless it requires more.
fn version(root: Value<'_>) -> Read<()> {
    let asset = root.need("asset")?;
    let needed = asset.get("minVersion")?;
    for value in [Some(asset.need("version")?), needed].into_iter().flatten() {
        let text = value.string()?;
        let (major, minor) = text.split_once('.').unwrap_or((&text, ""));
        let is_number = |s: &str| !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit());
        let is_minimum = needed.is_some_and(|n| n.pointer() == value.pointer());
        if major != "2" || !is_number(minor) || (is_minimum && minor != "0") {
            return Err(value.unexpected("unsupported version of glTF", "\"2.0\""));
        }
    }
    Ok(())
}
