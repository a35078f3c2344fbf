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
mod exposure;
mod file;
mod graph;
mod ies;
mod json;
#[cfg(feature = "basisu")]
mod ktx;
mod listing;
pub mod material;
mod mesh;
mod meshopt;
mod pointer;
mod scene;
mod shade;
mod tangents;
mod texture;
mod uri;

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use lumbre_scene::SceneDesc;

use self::animation::Playing;
use self::file::File;
use self::json::{Inside, Json, Read, Value};
use crate::budget::{Budget, Limits};
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, nearest_name, quoted, quoted_bytes};
use crate::input::{Input, text};

/// Options of reading a glTF.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GltfOptions {
    /// The time in seconds at which animations are evaluated; `None` ignores them.
    pub frame: Option<f64>,
    /// The animation to play, by its name or its index. `None` plays all simultaneously, except those that
    /// conflict with an earlier one.
    pub animation: Option<String>,
    /// The exposure in seconds, centred on `frame`; 0 for an instant. Animated nodes get motion blur.
    pub shutter: f64,
    /// The material variant (`KHR_materials_variants`).
    pub variant: Option<String>,
}

/// The supported extensions.
const SUPPORTED: &[&str] = &[
    "EXT_lights_ies",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    #[cfg(feature = "draco")]
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    #[cfg(feature = "basisu")]
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

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
    let scene = extensions(&file, root)
        .and_then(|()| file.load(binary, is_glb))
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
    file.load(binary, is_glb)?;
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

/// Rejects unknown required extensions, and warns of other unknown ones.
fn extensions(file: &File<'_>, root: Value<'_>) -> Read<()> {
    let mut required: Vec<(Value<'_>, Cow<'_, str>)> = vec![];
    if let Some(list) = root.get("extensionsRequired")? {
        for value in list.array()? {
            let extension = value.string()?;
            if !SUPPORTED.contains(&&*extension) {
                let wrong = value
                    .wrong("the file requires an extension that is not supported")
                    .found(quoted(&extension));
                let wrong = Diagnostic {
                    suggestion: nearest_name(&extension, SUPPORTED.iter().copied()).map(str::to_owned),
                    ..wrong
                };
                return Err(wrong.into());
            }
            required.push((value, extension));
        }
    }
    let mut used = HashSet::new();
    if let Some(list) = root.get("extensionsUsed")? {
        for value in list.array()? {
            let extension = value.string()?;
            if !SUPPORTED.contains(&&*extension) {
                let warning =
                    Diagnostic::warning("extension is not supported, and left out").at(value.place());
                file.push(warning.found(quoted(&extension)));
            }
            used.insert(extension);
        }
    }
    if let Some((value, extension)) = required.iter().find(|(_, extension)| !used.contains(extension)) {
        file.breach(
            value.wrong("required extension that \"extensionsUsed\" does not list").found(quoted(extension)),
        )?;
    }
    places(file, root)
}

/// The objects in which extensions may appear: pointers with `*` for indices.
const PLACES: &[(&str, &[&str])] = &[
    ("EXT_lights_ies", &["", "/nodes/*"]),
    ("EXT_mesh_gpu_instancing", &["/nodes/*"]),
    ("EXT_meshopt_compression", &["/bufferViews/*", "/buffers/*"]),
    ("KHR_meshopt_compression", &["/bufferViews/*", "/buffers/*"]),
    ("EXT_texture_webp", &["/textures/*"]),
    ("KHR_texture_basisu", &["/textures/*"]),
    ("KHR_animation_pointer", &["/animations/*/channels/*/target"]),
    ("KHR_draco_mesh_compression", &["/meshes/*/primitives/*"]),
    ("KHR_lights_punctual", &["", "/nodes/*"]),
    ("KHR_materials_variants", &["", "/meshes/*/primitives/*"]),
    ("KHR_node_visibility", &["/nodes/*"]),
    ("KHR_texture_transform", &["/materials/*/…Texture"]),
    ("KHR_materials_", &["/materials/*"]),
];

/// Checks that known extensions appear where they belong: elsewhere they would have no effect.
fn places(file: &File<'_>, root: Value<'_>) -> Read<()> {
    let mut path = String::new();
    // The containers being searched, with the length of their paths.
    let mut open: Vec<(usize, Box<dyn Iterator<Item = Inside<'_>> + '_>)> =
        vec![(0, Box::new(root.inside()))];
    while let Some((length, items)) = open.last_mut() {
        path.truncate(*length);
        let Some((name, inner)) = items.next() else {
            open.pop();
            continue;
        };
        let name = name.as_deref().unwrap_or("*");
        if name == "extras" {
            continue;
        }
        if name == "extensions" {
            for (extension, object) in inner.members()? {
                place(file, &path, &extension, object)?;
            }
        }
        path.push('/');
        path.push_str(name);
        open.push((path.len(), Box::new(inner.inside())));
    }
    Ok(())
}

fn place(file: &File<'_>, path: &str, extension: &str, object: Value<'_>) -> Read<()> {
    let is = |known: &str| extension == known || (known.ends_with('_') && extension.starts_with(known));
    let Some((_, places)) = PLACES.iter().find(|(known, _)| is(known)) else { return Ok(()) };
    let fits = |place: &str| match place.strip_suffix("/…Texture") {
        Some(start) => path.starts_with(start) && path.ends_with("Texture"),
        None => path == place,
    };
    if SUPPORTED.contains(&extension) && !places.iter().any(|place| fits(place)) {
        let wrong = object.wrong("extension where it says nothing").found(quoted(extension));
        let places: Vec<&str> = places.iter().map(|p| if p.is_empty() { "the top" } else { p }).collect();
        file.breach(wrong.expected(format!("it at {}", places.join(" or "))))?;
    }
    Ok(())
}

/// Compressed data may expand to this size at any ratio: a few bytes can represent millions of vertices.
const FREE_EXPANSION: u64 = 8 << 20;

/// Rejects what a few bytes make too much of; `what` names it.
fn check_expansion(file: &File<'_>, value: Value<'_>, what: &str, packed: u64, unpacked: u64) -> Read<()> {
    let limit = file.budget.limits().expansion;
    if unpacked <= FREE_EXPANSION.max(packed.saturating_mul(limit)) {
        return Ok(());
    }
    let source = crate::LimitError {
        what: what.to_owned(),
        kind: crate::LimitKind::Expansion,
        needed: unpacked.div_ceil(packed.max(1)),
        limit,
    };
    Err(FormatError::Limit { place: Some(value.place()), source })
}
