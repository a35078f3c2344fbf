//! From the nodes of a glTF to a scene: placed shapes, with meshes of several nodes as instanced objects.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use lumbre_geometry::Shape;
use lumbre_image::Rgb;
use lumbre_math::{
    AnimatedTransform, DAffine3, DMat3, DMat4, DQuat, DVec3, Elementary, Transform, Vec2, Vec3,
};
use lumbre_scene::{
    Camera, CameraKind, ColouredShape, GeometryDesc, InstanceDesc, LightDesc, MeshDesc, MeshMoment,
    MeshMotion, ObjectDesc, ObjectId, Placement, SceneDesc, ShapeDesc, WithoutLight,
};

use super::accessor::{Accessor, Component, Element};
use super::animation::Playing;
use super::check::check;
use super::expansion::check_expansion;
use super::exposure::Exposure;
use super::file::{File, List};
use super::graph::Graph;
use super::ies::Profiles;
use super::json::{Read, Value};
use super::mesh::{self, Assembly, Pose, Primitive, Vertices};
use super::options::GltfOptions;
use super::shade::{Dressing, Materials};
use super::texture::UvSets;
use super::{animation, listing, tangents};
use crate::diagnostic::{Diagnostic, quoted};
use crate::thin;

/// The maximal path length: every piece of glass takes two bounces.
const MAX_DEPTH: u32 = 16;

/// Emissive shapes are not instanced, unless there are more copies than this: lights inside objects are not
/// sampled.
const MAX_COPIES_OF_LIGHTS: usize = 64;

/// Reads the whole glTF.
pub(super) fn read(file: &File<'_>, options: &GltfOptions) -> Read<SceneDesc> {
    let variant = variant(file, options)?;
    let playing = Playing::read(file, options)?;
    let played = options.frame.map(|time| playing.at(time)).transpose()?.unwrap_or_default();
    let graph = Graph::read(file, played)?;
    check(file, &graph)?;
    if options.frame.is_none() {
        animation::check(file)?;
    }
    let mut exposure = Exposure::read(file, &playing, options)?;

    let roots = roots(file, &graph)?;
    let mut places: Vec<Placed> = vec![];
    let mut profiles = Profiles::new(file);
    let mut scene = SceneDesc { without_light: WithoutLight::StudioUnlessStaged, ..SceneDesc::default() };
    scene.integrator.max_depth = MAX_DEPTH;
    let mut first_camera = None;
    let mut uses: HashMap<Key, usize> = HashMap::new();
    let mut copied = 0;
    graph.walk(&roots, |node, world, is_visible| {
        let value = file.list(List::Nodes)[node];
        if let Some((_, camera)) = file.named(List::Cameras, value, "camera")? {
            first_camera.get_or_insert(camera);
            let mut camera = self::camera(camera, value, world)?;
            let forwards = Transform::scale(DVec3::new(1.0, 1.0, -1.0)).unwrap_or_default();
            let place = |world: &DAffine3| Transform::from_affine(rigid(world)).map(|map| map * forwards);
            // Its name and its place in the node, too.
            file.budget.bytes(size_of::<Camera>() as u64 + 128, "cameras")?;
            camera.motion = exposure.motion(node, place)?;
            scene.cameras.push(camera);
        }
        if !is_visible {
            return Ok(());
        }
        if let Some(extension) = value.extension("KHR_lights_punctual")? {
            file.budget.bytes(size_of::<LightDesc>() as u64, "lights")?;
            let (_, light) = file.at(List::Lights, extension.need("light")?)?;
            let motion = exposure.motion(node, |world| Transform::from_affine(rigid(world)))?;
            let at = if motion.is_some() { DAffine3::IDENTITY } else { *world };
            scene.lights.extend(self::light(file, light, &at)?.map(|light| carried(light, motion)));
        }
        if let Some(extension) = value.extension("EXT_lights_ies")? {
            file.budget.bytes(size_of::<LightDesc>() as u64, "lights")?;
            let motion = exposure.motion(node, |world| Transform::from_affine(rigid(world)))?;
            let at = if motion.is_some() { DAffine3::IDENTITY } else { rigid(world) };
            scene.lights.push(carried(profiles.light(extension, &at)?, motion));
        }
        let Some((mesh, _)) = file.named(List::Meshes, value, "mesh")? else { return Ok(()) };
        let skin = file.named(List::Skins, value, "skin")?.map(|(skin, _)| skin);
        let weights = weights(&graph, node)?;
        let owner = (skin.is_some() || exposure.deforms(node, skin)?).then_some(node);
        let key = Key { mesh, weights: weights.iter().map(|w| w.to_bits()).collect(), owner };
        let copies = match value.extension("EXT_mesh_gpu_instancing")? {
            Some(extension) => {
                let copies = instances(file, extension)?;
                // A few bytes shared by many nodes are copied for each of them.
                copied += (copies.len() * size_of::<InstanceDesc>()) as u64;
                check_expansion(file, extension, "copies of meshes", file.buffer_bytes(), copied)?;
                copies
            }
            None => vec![DAffine3::IDENTITY],
        };
        // A skin determines where its vertices are.
        let is_bent = skin.is_some() && value.extension("EXT_mesh_gpu_instancing")?.is_none();
        let stands = |copy: &DAffine3| if is_bent { DAffine3::IDENTITY } else { *world * *copy };
        let worlds: Vec<DAffine3> = copies.iter().map(stands).collect();
        let mut motions = vec![];
        if !is_bent && exposure.moves(node)? {
            for copy in &copies {
                motions.push(exposure.motion(node, |world| Transform::from_affine(*world * *copy))?);
            }
        }
        *uses.entry(key.clone()).or_default() += worlds.len();
        file.budget.elements(worlds.len() as u64, "nodes with meshes")?;
        // The key stands in a table too.
        let itself = size_of::<Placed>() + 2 * size_of::<Key>() + 8 * weights.len();
        file.budget.bytes((itself + size_of_val(&worlds[..])) as u64, "nodes with meshes")?;
        places.push(Placed { key, node, skin, worlds, motions });
        Ok(())
    })?;
    if let Some(camera) = first_camera
        && let Some(aspect) = aspect(camera)?
    {
        (scene.film.width, scene.film.height) = size_of_picture(aspect);
    }

    let mut builder = Builder {
        file,
        graph: &graph,
        variant,
        materials: Materials::new(file),
        known: HashMap::new(),
        skins: HashMap::new(),
        bent: 0,
        exposure,
        objects: HashMap::new(),
        next_shape: 0,
        size: size(file, &places)?,
    };
    for place in &places {
        builder.place(&mut scene, place, uses[&place.key])?;
    }
    (scene.materials, scene.listing.textures) = builder.materials.into_lists();
    scene.listing.animations = listing::animations(file)?;
    scene.listing.variants = listing::variants(file)?;
    Ok(scene)
}

/// A light, with the motion of its space if there is one.
fn carried(light: LightDesc, motion: Option<Arc<AnimatedTransform>>) -> LightDesc {
    match motion {
        Some(world_from_light) => LightDesc::Moving { light: Box::new(light), world_from_light },
        None => light,
    }
}

/// A mesh in a pose, which several nodes may share.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Key {
    mesh: usize,
    /// The bits of the weights of its morph targets; empty where all are 0.
    weights: Vec<u64>,
    /// The node, for a mesh that is skinned or deforms and so cannot be shared.
    owner: Option<usize>,
}

struct Placed {
    key: Key,
    node: usize,
    skin: Option<usize>,
    worlds: Vec<DAffine3>,
    /// The motion of each of these; empty if nothing moves.
    motions: Vec<Option<Arc<AnimatedTransform>>>,
}

impl Placed {
    fn motion(&self, copy: usize) -> Option<Arc<AnimatedTransform>> {
        self.motions.get(copy).cloned().flatten()
    }
}

/// The diagonal of the bounding box of everything placed, from the bounds of accessors, before skins and morph
/// targets; 0 without bounds.
fn size(file: &File<'_>, places: &[Placed]) -> Read<f64> {
    let mut of_meshes: HashMap<usize, Vec<[DVec3; 2]>> = HashMap::new();
    let mut corners = vec![];
    for place in places {
        if let Entry::Vacant(entry) = of_meshes.entry(place.key.mesh) {
            let mesh = file.list(List::Meshes)[place.key.mesh];
            let mut boxes = vec![];
            for value in mesh.need("primitives")?.array()? {
                let Some(position) = value.need("attributes")?.get("POSITION")? else { continue };
                let bounds = Accessor::named(file, position)?.bounds::<3>()?;
                boxes.extend(bounds.map(|bounds| bounds.map(DVec3::from_array)));
            }
            entry.insert(boxes);
        }
        for world in &place.worlds {
            let ends = of_meshes[&place.key.mesh].iter().map(|[low, high]| {
                let (center, half) = (0.5 * (*low + *high), 0.5 * (*high - *low));
                let axes = [world.matrix3.x_axis, world.matrix3.y_axis, world.matrix3.z_axis];
                let reach = axes[0].abs() * half.x + axes[1].abs() * half.y + axes[2].abs() * half.z;
                let center = world.transform_point3(center);
                [center - reach, center + reach]
            });
            corners.extend(ends.flatten());
            // Two corners suffice.
            if corners.len() > 2 {
                let start = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min);
                let end = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
                corners = vec![start, end];
            }
        }
    }
    Ok(match corners[..] {
        [start, end] if (end - start).is_finite() => (end - start).length(),
        _ => 0.0,
    })
}

/// The requested variant, by its index.
fn variant(file: &File<'_>, options: &GltfOptions) -> Read<Option<usize>> {
    let Some(wanted) = &options.variant else { return Ok(None) };
    let names = listing::variants(file)?;
    if let Some(index) = names.iter().position(|name| name == wanted) {
        return Ok(Some(index));
    }
    if names.is_empty() {
        let wrong = format!("--variant {}: the file has no material variants", quoted(wanted));
        return Err(Diagnostic::error(wrong).at(file.whole()).into());
    }
    let wrong = Diagnostic::error("no such material variant").at(file.whole()).found(quoted(wanted));
    let known: Vec<String> = names.iter().take(20).map(|name| quoted(name)).collect();
    Err(wrong.expected(known.join(", ")).suggest(wanted, names.iter().map(String::as_str)).into())
}

/// The root nodes of the scene to show.
fn roots(file: &File<'_>, graph: &Graph<'_>) -> Read<Vec<usize>> {
    let scenes = file.list(List::Scenes);
    let scene = match file.named(List::Scenes, file.root, "scene")? {
        Some((_, scene)) => Some(scene),
        None => scenes.first().copied(),
    };
    let Some(scene) = scene else { return Ok(graph.roots().collect()) };
    let Some(nodes) = scene.get("nodes")? else { return Ok(vec![]) };
    nodes.array()?.map(|node| Ok(file.at(List::Nodes, node)?.0)).collect()
}

/// The weights of a node's morph targets; empty where all are 0.
pub(super) fn weights(graph: &Graph<'_>, node: usize) -> Read<Vec<f64>> {
    Ok(graph.weights(node)?.filter(|weights| weights.iter().any(|&w| w != 0.0)).unwrap_or_default())
}

/// The transforms of the copies of a node's mesh, in node space (`EXT_mesh_gpu_instancing`).
pub(super) fn instances(file: &File<'_>, extension: Value<'_>) -> Read<Vec<DAffine3>> {
    let attributes = extension.need("attributes")?;
    let mut count: Option<usize> = None;
    let mut parts: [Option<Accessor<'_>>; 3] = [None; 3];
    for (name, index) in attributes.members()? {
        let accessor = Accessor::named(file, index)?;
        let expected = *count.get_or_insert(accessor.count);
        if accessor.count != expected {
            let wrong = index.wrong("attributes of different lengths").found(accessor.count);
            return Err(wrong.expected(expected).into());
        }
        let whole = [Component::F32, Component::I8, Component::I16];
        match &*name {
            "TRANSLATION" => {
                accessor.expect(index, &[Element::Vec3], &[Component::F32])?;
                parts[0] = Some(accessor);
            }
            "ROTATION" => {
                accessor.expect(index, &[Element::Vec4], &whole)?;
                parts[1] = Some(accessor);
            }
            "SCALE" => {
                accessor.expect(index, &[Element::Vec3], &[Component::F32])?;
                parts[2] = Some(accessor);
            }
            _ => {}
        }
    }
    let count = count.unwrap_or(0);
    // Parts that the file has are charged when they are read; missing ones and the result, here.
    file.budget
        .bytes((count * (size_of::<DAffine3>() + 10 * size_of::<f32>())) as u64, "copies of meshes")?;
    let vec3 = |part: Option<Accessor<'_>>, default: Vec3| match part {
        Some(accessor) => accessor.vectors(file, Vec3::from_array),
        None => Ok(vec![default; count]),
    };
    let translations = vec3(parts[0], Vec3::ZERO)?;
    let rotations = match parts[1] {
        Some(accessor) => accessor.floats(file)?,
        None => vec![[0.0, 0.0, 0.0, 1.0]; count],
    };
    let scales = vec3(parts[2], Vec3::ONE)?;
    let mut worlds = Vec::with_capacity(count);
    for i in 0..count {
        let rotation = DQuat::from_array(rotations[i].map(f64::from));
        let length = rotation.length();
        let rotation = if length > 0.0 { rotation * (1.0 / length) } else { DQuat::IDENTITY };
        worlds.push(DAffine3::from_scale_rotation_translation(
            scales[i].as_dvec3(),
            rotation,
            translations[i].as_dvec3(),
        ));
    }
    Ok(worlds)
}

/// The state of placing meshes.
struct Builder<'f> {
    file: &'f File<'f>,
    graph: &'f Graph<'f>,
    variant: Option<usize>,
    materials: Materials<'f>,
    /// The transforms of joints.
    known: HashMap<usize, DAffine3>,
    /// The matrices of each skin.
    skins: HashMap<usize, Arc<Vec<DMat4>>>,
    /// The bytes of vertices that bend so far: each of their nodes has its own.
    bent: u64,
    exposure: Exposure<'f>,
    /// Meshes with several placements: their objects, and their emissive parts.
    objects: HashMap<Key, (Option<ObjectId>, Vec<ShapeDesc>)>,
    next_shape: u32,
    /// The size of the whole model: see [`size`].
    size: f64,
}

impl Builder<'_> {
    fn place(&mut self, scene: &mut SceneDesc, place: &Placed, uses: usize) -> Read<()> {
        if uses <= 1 {
            for (copy, world) in place.worlds.iter().enumerate() {
                let shapes = self.shapes(place)?;
                self.name_shapes(scene, &shapes, place)?;
                match place.motion(copy) {
                    Some(motion) => move_about(scene, shapes, motion),
                    None => self.stand(scene, shapes, world, place)?,
                }
            }
            return Ok(());
        }
        if !self.objects.contains_key(&place.key) {
            let (shining, mut plain): (Vec<_>, Vec<_>) = self
                .shapes(place)?
                .into_iter()
                .partition(|shape| shape.area_light.is_some() && uses <= MAX_COPIES_OF_LIGHTS);
            let object = if plain.is_empty() {
                None
            } else {
                let mesh = self.file.list(List::Meshes)[place.key.mesh];
                let name =
                    mesh.string_at("name")?.map_or_else(|| format!("mesh {}", place.key.mesh), Into::into);
                plain.shrink_to_fit();
                self.file.budget.bytes((size_of::<ObjectDesc>() + name.len()) as u64, "meshes")?;
                scene.objects.push(ObjectDesc { name, shapes: plain, instances: vec![] });
                Some(ObjectId(scene.objects.len() as u32 - 1))
            };
            self.objects.insert(place.key.clone(), (object, shining));
        }
        let (object, shining) = self.objects[&place.key].clone();
        let count = place.worlds.len() as u64;
        self.file.budget.bytes(count * size_of::<InstanceDesc>() as u64, "instances")?;
        for (copy, world) in place.worlds.iter().enumerate() {
            let motion = place.motion(copy);
            if let (Some(object), Some(motion)) = (object, &motion) {
                let world_from_object = Placement::Moving(motion.clone());
                scene.instances.push(InstanceDesc { object, world_from_object });
            } else if let Some(object) = object {
                match Transform::from_affine(*world) {
                    Ok(world_from_object) => scene
                        .instances
                        .push(InstanceDesc { object, world_from_object: world_from_object.into() }),
                    Err(_) => {
                        let shapes = &scene.objects[object.0 as usize].shapes;
                        self.file.budget.bytes(size_of_val(&shapes[..]) as u64, "meshes")?;
                        let shapes = shapes.clone();
                        self.stand(scene, shapes, world, place)?;
                    }
                }
            }
            self.file.budget.bytes(size_of_val(&shining[..]) as u64, "copies of lights")?;
            let copies = shining.iter().map(|shape| ShapeDesc { index: self.next_index(), ..shape.clone() });
            let copies: Vec<ShapeDesc> = copies.collect();
            match motion {
                Some(motion) => move_about(scene, copies, motion),
                None => self.stand(scene, copies, world, place)?,
            }
        }
        Ok(())
    }

    /// The matrices of a skin, found once.
    fn joints_of(&mut self, skin: usize) -> Read<Arc<Vec<DMat4>>> {
        if let Some(found) = self.skins.get(&skin) {
            return Ok(found.clone());
        }
        let made = Arc::new(joints(self.file, self.graph, &mut self.known, skin)?);
        self.file.budget.bytes((made.len() * size_of::<DMat4>()) as u64, "joints of skins")?;
        self.skins.insert(skin, made.clone());
        Ok(made)
    }

    /// Names shapes as their node is called, or else as their mesh.
    fn name_shapes(&self, scene: &mut SceneDesc, shapes: &[ShapeDesc], place: &Placed) -> Read<()> {
        let of = |list: List, index: usize| self.file.list(list)[index].string_at("name");
        let name = match of(List::Nodes, place.node)? {
            Some(name) => Some(name),
            None => of(List::Meshes, place.key.mesh)?,
        };
        let Some(name) = name.filter(|name| !name.is_empty()) else { return Ok(()) };
        let each = size_of::<(u32, Arc<str>)>();
        self.file.budget.bytes((name.len() + shapes.len() * each) as u64, "names of shapes")?;
        let name: Arc<str> = name.into();
        scene.listing.shapes.extend(shapes.iter().map(|shape| (shape.index, name.clone())));
        Ok(())
    }

    fn next_index(&mut self) -> u32 {
        let index = self.next_shape;
        self.next_shape = self.next_shape.saturating_add(1);
        index
    }

    /// Places shapes in the world.
    fn stand(
        &mut self,
        scene: &mut SceneDesc,
        shapes: Vec<ShapeDesc>,
        world: &DAffine3,
        place: &Placed,
    ) -> Read<()> {
        if shapes.is_empty() {
            return Ok(());
        }
        match Transform::from_affine(*world) {
            Ok(world_from_object) => {
                scene.shapes.extend(shapes.into_iter().map(|shape| ShapeDesc { world_from_object, ..shape }));
            }
            Err(_) => {
                // A flattened mesh may still be visible; one collapsed to a line or a point is not.
                let node = self.file.list(List::Nodes)[place.node];
                self.file.warn(
                    node,
                    "the transform of a node cannot be inverted: its shapes are flattened, or left out",
                );
                scene.shapes.extend(shapes.into_iter().filter_map(|shape| flattened(shape, world)));
            }
        }
        Ok(())
    }

    /// The shapes of a mesh in mesh space, or in the world if it is skinned.
    fn shapes(&mut self, place: &Placed) -> Read<Vec<ShapeDesc>> {
        let file = self.file;
        let joints = place.skin.map(|skin| self.joints_of(skin)).transpose()?;
        let poses = self.exposure.poses(place.node, place.skin)?;
        let weights: Vec<f64> = place.key.weights.iter().map(|&bits| f64::from_bits(bits)).collect();
        let pose = Pose { weights: &weights, joints: joints.as_ref().map(|joints| &joints[..]) };
        let mesh = file.list(List::Meshes)[place.key.mesh];
        let mut shapes = vec![];
        for value in mesh.need("primitives")?.array()? {
            let primitive = Primitive::read(file, value, self.variant)?;
            if primitive.attributes.position.is_none() {
                file.warn(value, "primitive without positions is left out");
                continue;
            }
            let has_colours = primitive.attributes.colour.is_some();
            let dressing =
                self.materials.dressing(primitive.material, has_colours, primitive.mode.is_surface())?;
            let sets = dressing.sets.filter(|_| primitive.mode.is_surface());
            let has_tangents =
                primitive.attributes.tangent.is_some() && primitive.attributes.normal.is_some();
            let by = dressing.tangents.filter(|_| !has_tangents);
            let wants = |set| sets.is_some_and(|sets| sets.holds(set)) || by == Some(set);
            let count = primitive.attributes.position.as_ref().map_or(0, |position| position.count);
            if place.key.owner.is_some() || !place.key.weights.is_empty() {
                self.bent += (count * size_of::<Vec3>() * (1 + poses.len())) as u64;
                check_expansion(file, value, "vertices that bend", file.buffer_bytes(), self.bent)?;
            }
            let mut vertices = mesh::vertices(file, &primitive, pose, wants)?;
            if primitive.mode.is_surface() {
                for pose in &poses {
                    let pose = Pose { weights: &pose.weights, joints: pose.joints.as_deref() };
                    let Vertices { positions, normals, .. } =
                        mesh::vertices(file, &primitive, pose, |_| false)?;
                    vertices.moments.push(MeshMoment { positions, normals });
                }
            } else if !poses.is_empty() {
                file.warn(
                    value,
                    "the motion of points and lines is left out: their positions halfway through the shutter are used",
                );
            }
            let shape = |geometry, index| ShapeDesc {
                index,
                geometry,
                world_from_object: Transform::IDENTITY,
                reverse_orientation: false,
                material: Some(dressing.material),
                boundary: None,
                area_light: dressing.area_light.clone(),
                alpha: dressing.alpha.clone(),
            };
            match mesh::assemble(file, &primitive, &vertices.positions)? {
                Assembly::Triangles(mut triangles) => {
                    mesh::compact(&mut vertices, &mut triangles);
                    if let Some(set) = by {
                        tangents::make(file, &mut vertices, &mut triangles, set)?;
                    }
                    if let Some(mesh) = mesh_of(vertices, triangles, &dressing) {
                        let each = size_of::<ShapeDesc>() + size_of::<MeshDesc>();
                        file.budget.bytes(each as u64, "meshes")?;
                        shapes.push(shape(GeometryDesc::Mesh(Arc::new(mesh)), self.next_index()));
                    }
                }
                thin => {
                    // In mesh space, for a constant size in the world.
                    let scale = place
                        .worlds
                        .first()
                        .map_or(1.0, |world| world.matrix3.determinant().abs().cube_root());
                    let each =
                        size_of::<ShapeDesc>() + if has_colours { size_of::<ColouredShape>() } else { 0 };
                    for (exact, ends) in thin_shapes(&vertices.positions, &thin, self.size / scale) {
                        file.budget.bytes(each as u64, "points and lines")?;
                        shapes.push(shape(vertices.coloured(exact, ends), self.next_index()));
                    }
                }
            }
        }
        Ok(shapes)
    }
}

/// The skinning matrices of a mesh.
pub(super) fn joints(
    file: &File<'_>,
    graph: &Graph<'_>,
    known: &mut HashMap<usize, DAffine3>,
    skin: usize,
) -> Read<Vec<DMat4>> {
    let value = file.list(List::Skins)[skin];
    let inverse: Option<Vec<[f32; 16]>> = match value.get("inverseBindMatrices")? {
        Some(name) => Some(Accessor::named(file, name)?.floats(file)?),
        None => None,
    };
    let mut joints = vec![];
    for (i, name) in value.need("joints")?.array()?.enumerate() {
        let (node, _) = file.at(List::Nodes, name)?;
        let world = DMat4::from(graph.world(node, known)?);
        let bind = match inverse.as_ref().and_then(|list| list.get(i)) {
            Some(matrix) => DMat4::from_cols_array(&matrix.map(f64::from)),
            None => DMat4::IDENTITY,
        };
        joints.push(world * bind);
    }
    if let Some(inverse) = inverse {
        file.budget.release((inverse.len() * 64) as u64);
    }
    Ok(joints)
}

/// Places moving shapes in the world, in an object of their own.
fn move_about(scene: &mut SceneDesc, shapes: Vec<ShapeDesc>, motion: Arc<AnimatedTransform>) {
    if shapes.is_empty() {
        return;
    }
    scene.objects.push(ObjectDesc { shapes, ..ObjectDesc::default() });
    let object = ObjectId(scene.objects.len() as u32 - 1);
    scene.instances.push(InstanceDesc { object, world_from_object: Placement::Moving(motion) });
}

/// The mesh of a scene; `None` without triangles.
fn mesh_of(mut vertices: Vertices, triangles: Vec<[u32; 3]>, dressing: &Dressing) -> Option<MeshDesc> {
    if triangles.is_empty() {
        return None;
    }
    let count = vertices.positions.len();
    let UvSets { first, further, baked, is_first_lost } = dressing.sets.unwrap_or_default();
    let mut coordinates = |set: usize| -> Vec<Vec2> {
        let list = vertices.uvs.get_mut(set);
        let list = list.and_then(|list| if is_first_lost { list.clone() } else { list.take() });
        let mut list = list.unwrap_or_else(|| vec![Vec2::ZERO; count]);
        list.iter_mut().for_each(|uv| *uv = Vec2::new(uv.x, 1.0 - uv.y));
        list
    };
    let further_uvs = further.map(|set| set.map(&mut coordinates));
    let uvs = dressing.sets.is_some().then(|| {
        let mut uvs = coordinates(first);
        if baked != lumbre_math::glam::Affine2::IDENTITY {
            uvs.iter_mut().for_each(|uv| *uv = baked.transform_point2(*uv));
        }
        uvs
    });
    let (colours, coverages) = match vertices.colours {
        None => (None, None),
        Some(list) => {
            let coverages = list.iter().any(|&(_, coverage)| coverage != 1.0);
            let coverages = coverages.then(|| list.iter().map(|&(_, coverage)| coverage).collect());
            (Some(list.into_iter().map(|(colour, _)| colour).collect::<Vec<Rgb>>()), coverages)
        }
    };
    // Tangents without normals are meaningless.
    let tangents = vertices.normals.is_some().then_some(vertices.tangents).flatten();
    Some(MeshDesc {
        positions: vertices.positions,
        precise_positions: None,
        triangles,
        quads: vec![],
        normals: vertices.normals,
        uvs,
        tangents,
        further_uvs,
        colours,
        coverages,
        face_indices: None,
        motion: (!vertices.moments.is_empty()).then_some(MeshMotion {
            start: 0.0,
            end: 1.0,
            moments: vertices.moments,
        }),
    })
}

/// Points and lines as solids, each with its two vertices. `size` is that of the whole model, or 0 to use the
/// primitive's own.
fn thin_shapes(positions: &[Vec3], assembly: &Assembly, size: f64) -> Vec<(Shape, [u32; 2])> {
    let at = |i: u32| positions[i as usize].as_dvec3();
    let is_size = |size: &f64| *size > 0.0 && size.is_finite();
    let own = || mesh::diagonal(positions.iter().copied());
    let size = Some(size).filter(is_size).or_else(|| Some(own()).filter(is_size)).unwrap_or(1.0);
    match assembly {
        Assembly::Points(points) => thin::points(at, points, size).collect(),
        Assembly::Segments(segments) => thin::segments(at, segments, size).collect(),
        Assembly::Triangles(_) => vec![],
    }
}

/// A mesh under a singular map; `None` where nothing remains visible.
fn flattened(shape: ShapeDesc, world: &DAffine3) -> Option<ShapeDesc> {
    let GeometryDesc::Mesh(mesh) = &shape.geometry else { return None };
    let has_area = mesh::cofactors(&world.matrix3).to_cols_array().iter().any(|&n| n != 0.0);
    if !world.is_finite() || !has_area {
        return None;
    }
    let mut mesh = MeshDesc::clone(mesh);
    for p in &mut mesh.positions {
        *p = world.transform_point3(p.as_dvec3()).as_vec3();
    }
    // All normals are perpendicular to the plane.
    (mesh.normals, mesh.tangents) = (None, None);
    Some(ShapeDesc {
        geometry: GeometryDesc::Mesh(Arc::new(mesh)),
        world_from_object: Transform::IDENTITY,
        ..shape
    })
}

/// The rotation and translation of something that is not scaled with its node.
fn rigid(world: &DAffine3) -> DAffine3 {
    let [x, y, z] = [world.matrix3.x_axis, world.matrix3.y_axis, world.matrix3.z_axis];
    let z = z.try_normalize().unwrap_or(DVec3::Z);
    let across = y - z * z.dot(y);
    let y = across.try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
    let right = y.cross(z);
    // A mirrored node shows a mirrored picture.
    let right = if right.dot(x) < 0.0 { -right } else { right };
    DAffine3 { matrix3: DMat3::from_cols(right, y, z), translation: world.translation }
}

/// A camera. In glTF it looks along -z, with x to the right and y up.
pub(super) fn camera(camera: Value<'_>, node: Value<'_>, world: &DAffine3) -> Read<Camera> {
    let name = match camera.string_at("name")? {
        Some(name) => Some(name),
        None => node.string_at("name")?,
    };
    let above = f64::MIN_POSITIVE..=f64::INFINITY;
    let kind_value = camera.need("type")?;
    let (kind, window) = match &*kind_value.string()? {
        "perspective" => {
            let lens = camera.need("perspective")?;
            lens.need("yfov")?;
            lens.need("znear")?;
            lens.number_or("znear", 0.0, above.clone())?;
            lens.number_or("zfar", 1.0, above.clone())?;
            let most = std::f64::consts::PI - 1e-6;
            let fov = lens.number_or("yfov", 1.0, 1e-6..=most)?;
            let aspect =
                lens.get("aspectRatio")?.map(|_| lens.number_or("aspectRatio", 1.0, above)).transpose()?;
            // Our field of view is that of the shorter side.
            let slope = (0.5 * fov).tangent() * aspect.unwrap_or(1.0).min(1.0);
            let fov = (2.0 * slope.arc_tangent()).to_degrees();
            (CameraKind::Perspective { fov, lens_radius: 0.0, focal_distance: 1.0 }, None)
        }
        "orthographic" => {
            let lens = camera.need("orthographic")?;
            let [x, y] = ["xmag", "ymag"].map(|name| -> Read<f64> {
                let magnification = lens.need(name)?;
                let size = magnification.number()?;
                if size == 0.0 {
                    return Err(magnification.unexpected("number out of range", "a number other than 0"));
                }
                Ok(size.abs())
            });
            let (x, y) = (x?, y?);
            for name in ["znear", "zfar"] {
                lens.need(name)?.number()?;
            }
            (CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 }, Some([-x, x, -y, y]))
        }
        other => {
            let wrong = kind_value.wrong("unknown kind of camera").found(quoted(other));
            return Err(wrong.suggest(other, ["perspective", "orthographic"]).into());
        }
    };
    let forwards = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let world_from_camera = Transform::from_affine(rigid(world) * forwards)
        .map_err(|_| crate::FormatError::from(node.wrong("camera at a place that is not finite")))?;
    Ok(Camera {
        name: name.map(Into::into),
        kind,
        world_from_camera,
        motion: None,
        frame_aspect: None,
        screen_window: window,
        shutter_open: 0.0,
        shutter_close: 1.0,
        medium: None,
        clip: None,
    })
}

/// The aspect ratio, width over height, that a camera specifies.
fn aspect(camera: Value<'_>) -> Read<Option<f64>> {
    if let Some(lens) = camera.get("perspective")? {
        return lens.get("aspectRatio")?.map(Value::number).transpose();
    }
    let Some(lens) = camera.get("orthographic")? else { return Ok(None) };
    let aspect = lens.need("xmag")?.number()? / lens.need("ymag")?.number()?;
    Ok(Some(aspect.abs()))
}

/// About the number of pixels of 1280 × 720, with this aspect ratio.
fn size_of_picture(aspect: f64) -> (Option<u32>, Option<u32>) {
    let aspect = aspect.clamp(0.05, 20.0);
    let height = (1280.0 * 720.0 / aspect).sqrt();
    (Some((height * aspect).rounded() as u32), Some(height.rounded() as u32))
}

/// A light (`KHR_lights_punctual`), aimed along -z: candelas for radiant intensity and lux for irradiance agree
/// with nits for radiance, the unit of `emissiveFactor`. `None` for an unknown kind.
pub(super) fn light(file: &File<'_>, light: Value<'_>, world: &DAffine3) -> Read<Option<LightDesc>> {
    let unit = 0.0..=1.0;
    let positive = 0.0..=f64::INFINITY;
    let [r, g, b] = light.numbers_or("color", [1.0; 3], unit)?;
    let intensity = light.number_or("intensity", 1.0, positive.clone())?;
    let colour = Rgb::new(r as f32, g as f32, b as f32) * intensity as f32;
    light.number_or("range", 1.0, f64::MIN_POSITIVE..=f64::INFINITY)?;
    let kind = light.need("type")?;
    Ok(Some(match &*kind.string()? {
        "point" => LightDesc::Point { from: world.translation, intensity: colour },
        "directional" => LightDesc::Distant { towards: rigid(world).matrix3.z_axis, irradiance: colour },
        "spot" => {
            let cone = light.need("spot")?;
            let right = std::f64::consts::FRAC_PI_2;
            let inner = cone.number_or("innerConeAngle", 0.0, 0.0..=right)?;
            let outer = cone.number_or("outerConeAngle", 0.5 * right, 0.0..=right)?;
            if inner >= outer {
                let wrong = cone.wrong("inner angle of a spot that is not less than the outer one");
                return Err(wrong.found(format!("{inner} and {outer}")).into());
            }
            let backwards = DAffine3::from_scale(DVec3::new(-1.0, 1.0, -1.0));
            let world_from_light = Transform::from_affine(rigid(world) * backwards)
                .map_err(|_| crate::FormatError::from(light.wrong("light at a place that is not finite")))?;
            LightDesc::Spot {
                world_from_light,
                intensity: colour,
                cone_angle: outer.to_degrees() as f32,
                cone_delta_angle: (outer - inner).to_degrees() as f32,
            }
        }
        other => {
            let warning = Diagnostic::warning("light of an unknown kind is left out").at(kind.place());
            file.push(warning.found(quoted(other)));
            return Ok(None);
        }
    }))
}
