//! Validation of everything in a file, used or not.

use std::collections::HashMap;

use lumbre_math::DAffine3;

use super::accessor::{self, Accessor, Component, Element};
use super::animation;
use super::file::{File, List};
use super::graph::Graph;
use super::ies::Profiles;
use super::json::{Read, Value};
use super::material::GltfMaterial;
use super::mesh::Primitive;
use super::scene;
use super::texture::Textures;
use crate::diagnostic::quoted;

/// Checks also what the scene may leave unused. What is wrong there is a warning: what is needed is read again,
/// and what is wrong then is an error.
pub(super) fn check(file: &File<'_>, graph: &Graph<'_>) -> Read<()> {
    for (index, &view) in file.list(List::BufferViews).iter().enumerate() {
        file.unless_used(file.view_at(index, view).map(drop))?;
    }
    for (index, &value) in file.list(List::Accessors).iter().enumerate() {
        file.unless_used(match accessor::is_known(value) {
            Ok(true) => Accessor::at(file, index).map(drop),
            Ok(false) => {
                file.warn(value, "accessor of an unknown kind is left out");
                Ok(())
            }
            Err(wrong) => Err(wrong),
        })?;
    }
    for &image in file.list(List::Images) {
        file.unless_used(Textures::check_image(file, image))?;
    }
    for &texture in file.list(List::Textures) {
        file.unless_used(Textures::check(file, texture))?;
    }
    let mut used_as: HashMap<usize, bool> = HashMap::new();
    let mut materials = vec![];
    for &material in file.list(List::Materials) {
        // The number of uv sets that its textures need.
        let mut wanted = 0;
        let read = GltfMaterial::read(file, material).map(|read| {
            wanted = read.textures().map(|t| t.uv_set + 1).max().unwrap_or(0);
        });
        file.unless_used(read)?;
        materials.push(wanted);
    }
    for &mesh in file.list(List::Meshes) {
        file.unless_used(check_mesh(file, mesh, &materials, &mut used_as))?;
    }
    for &camera in file.list(List::Cameras) {
        file.unless_used(scene::camera(camera, camera, &DAffine3::IDENTITY).map(drop))?;
    }
    for &light in file.list(List::Lights) {
        file.unless_used(scene::light(file, light, &DAffine3::IDENTITY).map(drop))?;
    }
    for &profile in file.list(List::Profiles) {
        Profiles::check(file, profile)?;
    }
    for &skin in file.list(List::Skins) {
        check_skin(file, skin)?;
    }
    for (index, &node) in file.list(List::Nodes).iter().enumerate() {
        check_node(file, graph, index, node)?;
    }
    file.named(List::Scenes, file.root, "scene")?;
    for &scene in file.list(List::Scenes) {
        let Some(nodes) = scene.get("nodes")? else { continue };
        let mut met = std::collections::HashSet::new();
        for name in nodes.array()? {
            let (node, _) = file.at(List::Nodes, name)?;
            if graph.is_child(node) {
                file.breach(name.wrong("scene with a node that hangs on another").found(node))?;
            }
            if !met.insert(node) {
                return Err(name.wrong("scene with the same node twice").found(node).into());
            }
        }
        if met.is_empty() {
            file.breach(nodes.wrong("empty list").expected("one node or more, or no list"))?;
        }
    }
    Ok(())
}

fn check_mesh(
    file: &File<'_>,
    mesh: Value<'_>,
    materials: &[usize],
    used_as: &mut HashMap<usize, bool>,
) -> Read<()> {
    let primitives = mesh.need("primitives")?;
    let mut targets: Option<usize> = None;
    let mut count = 0;
    for value in primitives.array()? {
        count += 1;
        let primitive = Primitive::read(file, value, None)?;
        let wanted = primitive.material.map_or(0, |material| materials[material]);
        let found = primitive.attributes.uvs.len();
        if found < wanted {
            let wrong = value.wrong("texture coordinates that the material needs are missing");
            file.breach(wrong.found(format!("{found} sets")).expected(format!("{wanted} sets")))?;
        }
        if *targets.get_or_insert(primitive.targets.len()) != primitive.targets.len() {
            let wrong = value.wrong("primitives with different numbers of morph targets");
            file.breach(wrong.found(primitive.targets.len()).expected(targets.unwrap_or(0)))?;
        }
        for (accessor, as_indices) in primitive.accessors() {
            let Some((view, _)) = accessor.view else { continue };
            let before = used_as.entry(view).or_insert(as_indices);
            let said = match file.list(List::BufferViews)[view].get("target")? {
                Some(target) => Some(target.whole(0)? == 34963),
                None => None,
            };
            if *before != as_indices || said.is_some_and(|said| said != as_indices) {
                file.breach(
                    accessor.value.wrong("buffer view for indices and for vertices at once").found(view),
                )?;
            }
        }
    }
    if count == 0 {
        file.breach(primitives.wrong("empty list").expected("one primitive or more"))?;
    }
    if let Some(weights) = mesh.get("weights")? {
        check_weights(file, weights, targets.unwrap_or(0))?;
    }
    Ok(())
}

fn check_weights(file: &File<'_>, weights: Value<'_>, targets: usize) -> Read<()> {
    let mut count = 0;
    for weight in weights.array()? {
        weight.number()?;
        count += 1;
    }
    if count != targets {
        let wrong = weights.wrong("as many weights as morph targets are needed").found(count);
        file.breach(wrong.expected(targets))?;
    }
    Ok(())
}

fn check_skin(file: &File<'_>, skin: Value<'_>) -> Read<()> {
    let list = skin.need("joints")?;
    let mut joints = 0;
    for joint in list.array()? {
        file.at(List::Nodes, joint)?;
        joints += 1;
    }
    if joints == 0 {
        file.breach(list.wrong("empty list").expected("one joint or more"))?;
    }
    file.named(List::Nodes, skin, "skeleton")?;
    if let Some(name) = skin.get("inverseBindMatrices")? {
        let matrices = Accessor::named(file, name)?;
        matrices.expect(name, &[Element::Mat4], &[Component::F32])?;
        if matrices.count < joints {
            let wrong = name.wrong("skin with too few matrices").found(matrices.count);
            return Err(wrong.expected(format!("{joints}, one for each joint")).into());
        }
    }
    Ok(())
}

fn check_node(file: &File<'_>, graph: &Graph<'_>, index: usize, node: Value<'_>) -> Read<()> {
    graph.local(index)?;
    let mesh = file.named(List::Meshes, node, "mesh")?;
    file.named(List::Cameras, node, "camera")?;
    let skin = file.named(List::Skins, node, "skin")?;
    if let Some(extension) = node.extension("KHR_lights_punctual")? {
        file.at(List::Lights, extension.need("light")?)?;
    }
    if let Some(extension) = node.extension("EXT_lights_ies")? {
        Profiles::instance(file, extension)?;
    }
    let Some((_, mesh)) = mesh else {
        for name in ["skin", "weights"] {
            if let Some(value) = node.get(name)? {
                file.breach(value.wrong(format!("node with {} and without a mesh", quoted(name))))?;
            }
        }
        return Ok(());
    };
    if let Some(weights) = node.get("weights")? {
        check_weights(file, weights, animation::targets(file, node)?)?;
    }
    let mut skinned = 0;
    let mut primitives = 0;
    for primitive in mesh.need("primitives")?.array()? {
        primitives += 1;
        skinned += usize::from(primitive.need("attributes")?.get("JOINTS_0")?.is_some());
    }
    if skin.is_some() && skinned < primitives {
        file.breach(node.need("skin")?.wrong("skin on a mesh without joints"))?;
    }
    if skin.is_none() && skinned > 0 {
        file.warn(node, "mesh with joints on a node without a skin stands as it is");
    }
    Ok(())
}
