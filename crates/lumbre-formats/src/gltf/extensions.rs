//! The extensions of glTF: which are supported, and where they may appear.

use std::borrow::Cow;
use std::collections::HashSet;

use super::file::File;
use super::json::{Inside, Read, Value};
use crate::diagnostic::{Diagnostic, nearest_name, quoted};

/// The supported extensions.
pub(super) const SUPPORTED: &[&str] = &[
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

/// Rejects unknown required extensions, and warns of other unknown ones.
pub(super) fn check(file: &File<'_>, root: Value<'_>) -> Read<()> {
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
