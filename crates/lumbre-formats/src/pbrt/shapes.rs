//! Shapes: exact ones, meshes, and CSG.

use std::collections::HashMap;
use std::sync::Arc;

use lumbre_geometry::{Aabb, Csg, Quadric, Shape, ShapeError};
use lumbre_math::{DVec3, Transform, Vec2, Vec3, Vec4};
use lumbre_scene::{CsgDesc, CsgOperation, GeometryDesc, MaterialId, MeshDesc, ShapeDesc};
use lumbre_shading::Texture;

use super::convert::{Converter, Displaced, MeshFile, file_fault};
use super::curves::joined;
use super::displacement::{Displacement, Refused};
use super::exact_shapes::exact_shape;
use super::params::{Param, Params, Type};
use super::source::{AtSpot, Fault, Result, SourcePosition};
use super::state::State;
use super::subdivision;
use super::textures::vec3;
use crate::diagnostic::{number, quoted};
use crate::origin::{Spread, placed, relative};
use crate::ply::{PlyFile, read_ply};
use crate::{Diagnostic, Diagnostics, Input, Severity};

pub(super) const KNOWN: &[&str] = &[
    "sphere",
    "plane",
    "disk",
    "triangle",
    "box",
    "cylinder",
    "capsule",
    "cone",
    "torus",
    "paraboloid",
    "hyperboloid",
    "quadric",
    "csg",
    "trianglemesh",
    "bilinearmesh",
    "plymesh",
    "loopsubdiv",
    "curve",
];

/// The maximal number of leaves of a CSG.
const MAX_CSG_LEAVES: u64 = 1 << 16;

/// Bytes that a scene takes for a leaf of a CSG.
const LEAF_BYTES: u64 = 1000;

/// Meshes with their origins, by their placeholders.
pub(super) type ReadMeshes = HashMap<*const MeshDesc, (Arc<MeshDesc>, DVec3)>;

/// A geometry, with the number of leaves and the depth of a CSG.
struct Form {
    geometry: GeometryDesc,
    /// What the positions of a mesh are relative to.
    origin: DVec3,
    leaves: u64,
    depth: usize,
}

impl From<GeometryDesc> for Form {
    fn from(geometry: GeometryDesc) -> Self {
        (geometry, DVec3::ZERO).into()
    }
}

impl From<(GeometryDesc, DVec3)> for Form {
    fn from((geometry, origin): (GeometryDesc, DVec3)) -> Self {
        Self { geometry, origin, leaves: 1, depth: 0 }
    }
}

impl Converter<'_, '_> {
    pub fn shape(&mut self, ty: &str, params: Params, state: &State) -> Result<()> {
        let spot = params.spot;
        let index = self.shape_count;
        self.shape_count = index.checked_add(1).ok_or_else(|| spot.error("more than 2^32 shapes"))?;
        self.budget.elements(1, "shapes").at(spot)?;
        let alpha = match params.find("alpha") {
            Some(param) if self.is_texture_to_come(param) => {
                self.keep(2 * size_of::<Param>() + param.bytes(), "textures that are not defined yet", spot)?;
                self.alphas_later.insert(index, param.clone());
                None
            }
            _ => self.float_texture(&params, "alpha")?,
        };
        let alpha = alpha.filter(|alpha| !matches!(**alpha, Texture::Constant(v) if v == 1.0));
        let Some(form) = self.form(ty, &params, state)? else {
            params.ignore_all();
            return Ok(());
        };
        // pbrt-v3.
        if params.has("shadowalpha") {
            params.ignore(&["shadowalpha"]);
            self.upgraded(params.spot_of("shadowalpha"));
        }
        self.done(&params);
        let placed = (form.origin != DVec3::ZERO).then(|| placed(form.origin));
        let world_from_object = placed.map_or(state.ctm[0], |placed| state.ctm[0] * placed);
        if let GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh) = &form.geometry {
            let moved = Aabb::around(mesh.positions.iter().map(|p| world_from_object.point(p.as_dvec3())));
            let farthest = moved.min.abs().max(moved.max.abs()).max_element();
            if !moved.is_empty() && (farthest.is_nan() || farthest > f64::from(f32::MAX)) {
                let wrong = Diagnostic::error("the current transform takes a vertex too far away");
                let wrong = wrong.found(number(farthest));
                return Err(spot.wrong(wrong.expected("coordinates of single precision")));
            }
        }
        let area_light = self.area_light_of(&form.geometry, spot, state)?;
        let boxed = match &form.geometry {
            GeometryDesc::Exact(shape) => {
                size_of::<Shape>()
                    + if matches!(*shape, Shape::Quadric(_)) { size_of::<Quadric>() } else { 0 }
            }
            GeometryDesc::Mesh(_) | GeometryDesc::BilinearMesh(_) => size_of::<MeshDesc>(),
            _ => 0,
        };
        let shape = ShapeDesc {
            index,
            geometry: form.geometry,
            world_from_object,
            reverse_orientation: state.reverse_orientation,
            material: state.material,
            boundary: state.boundary(),
            area_light,
            alpha,
        };
        let is_alone = self.alphas_later.contains_key(&index);
        let motion = self.motion(spot, &state.ctm, "shape")?;
        let shape = if motion.is_none() && !is_alone {
            match joined(self.shape_before(), shape) {
                Some(shape) => shape,
                None => return Ok(()),
            }
        } else {
            shape
        };
        self.keep(size_of::<ShapeDesc>() + boxed, "shapes", spot)?;
        match motion {
            None => self.push_shape(shape, form.leaves, form.depth),
            Some(motion) => {
                let world_from_object = placed.unwrap_or(Transform::IDENTITY);
                let shape = ShapeDesc { world_from_object, ..shape };
                self.push_moving(shape, form.leaves, form.depth, motion, spot)?;
            }
        }
        Ok(())
    }

    /// The current area light, if this shape can emit.
    fn area_light_of(
        &mut self,
        geometry: &GeometryDesc,
        spot: SourcePosition,
        state: &State,
    ) -> Result<Option<lumbre_scene::AreaLightDesc>> {
        let Some(light) = &state.area_light else { return Ok(None) };
        if self.open_object.is_some() {
            self.note(spot, "a shape inside an object gives no light: its area light is left out");
            return Ok(None);
        }
        let lightless = match geometry {
            GeometryDesc::Exact(shape) if shape.bounds(&Transform::IDENTITY).is_none() => "an infinite shape",
            GeometryDesc::Csg(_) => "a csg",
            _ => "",
        };
        if !lightless.is_empty() {
            let from = self.files.place(light.spot);
            return Err(spot.error(format!(
                "{lightless} cannot be an area light (that of {from}); is an AttributeEnd missing?"
            )));
        }
        match state.material {
            None => {
                self.note(spot, "an interface gives no light: the area light of this shape is left out");
                return Ok(None);
            }
            Some(id) => {
                let is_known = self.materials[id.0 as usize].material.is_some();
                let is_interface = self.materials[id.0 as usize]
                    .material
                    .as_ref()
                    .is_some_and(|m| matches!(m.kind, lumbre_shading::MaterialKind::Interface));
                if !is_known || is_interface {
                    self.keep(size_of::<(MaterialId, SourcePosition)>(), "area lights", spot)?;
                    self.lights_to_check.push((id, spot));
                }
            }
        }
        Ok(Some(light.desc.clone()))
    }

    /// The geometry of a shape; `None` for one that is ignored with a warning.
    fn form(&mut self, ty: &str, params: &Params, state: &State) -> Result<Option<Form>> {
        if let Some(made) = exact_shape(ty, params)? {
            return match made {
                Ok(shape) => Ok(Some(GeometryDesc::Exact(shape).into())),
                Err(ShapeError::OutOfRange { parameter, found, expected }) => {
                    params.out_of_range(parameter, found, expected)
                }
                Err(ShapeError::Degenerate(why)) => Err(params.spot.error(why)),
                Err(other) => Err(params.spot.error(format!("this shape cannot be made: {other}"))),
            };
        }
        match ty {
            "csg" => self.csg(params).map(Some),
            "trianglemesh" => Ok(self.triangle_mesh(params)?.map(Form::from)),
            "bilinearmesh" => Ok(self.bilinear_mesh(params)?.map(Form::from)),
            "plymesh" => self.ply_mesh(params, &state.ctm[0]).map(|g| Some(g.into())),
            "loopsubdiv" => self.loop_subdivision(params).map(|mesh| Some(mesh.into())),
            "curve" => self.curve(params).map(|curve| Some(curve.into())),
            "heightfield" => {
                self.upgraded(params.spot);
                self.heightfield(params).map(|mesh| Some(mesh.into()))
            }
            "nurbs" => {
                self.upgraded(params.spot);
                self.nurbs(params).map(|mesh| Some(mesh.into()))
            }
            _ => {
                self.unknown(params.spot, "shape", ty, KNOWN, "it is left out");
                Ok(None)
            }
        }
    }

    // CSG.

    fn csg(&mut self, params: &Params) -> Result<Form> {
        let operations = [
            ("union", CsgOperation::Union),
            ("intersection", CsgOperation::Intersection),
            ("difference", CsgOperation::Difference),
        ];
        let operation = params.choice("operation", &operations, CsgOperation::Union)?;
        let Some(param) = params.typed("operands", &[Type::String])? else {
            return Err(params.spot.error("a csg has no \"string operands\""));
        };
        let names = param.strings()?;
        if names.len() < 2 {
            return Err(param.refuse("the names of two objects or more"));
        }
        let at = param.spot;
        let (mut leaves, mut depth) = (0u64, 1);
        let mut operands = vec![];
        for name in names {
            let id = self.object_names.get(&**name).copied();
            let slot = id.map(|id| &self.objects[id.0 as usize]);
            let Some((slot, object)) = slot.and_then(|slot| Some((slot, slot.object.as_ref()?))) else {
                let wrong =
                    Diagnostic::error(format!("object {} is not defined before this csg", quoted(name)));
                return Err(at.wrong(wrong.suggest(name, self.object_names.keys().map(|name| &**name))));
            };
            if id == self.open_object {
                return Err(at.error(format!("object {} is an operand of a csg inside it", quoted(name))));
            }
            if !object.instances.is_empty() {
                let message =
                    format!("object {} has a shape that moves: it is no operand of a csg", quoted(name));
                return Err(at.error(message));
            }
            if object.shapes.is_empty() {
                return Err(
                    at.error(format!("object {} has no shape: it is no operand of a csg", quoted(name)))
                );
            }
            for shape in &object.shapes {
                let not_solid = match &shape.geometry {
                    GeometryDesc::Exact(exact) if !exact.is_solid() => exact.name(),
                    GeometryDesc::BilinearMesh(_) => "bilinearmesh",
                    GeometryDesc::Mesh(mesh) => {
                        self.keep(size_of::<(Arc<MeshDesc>, SourcePosition)>(), "operands of a csg", at)?;
                        self.meshes_to_close.push((mesh.clone(), at));
                        continue;
                    }
                    _ => continue,
                };
                let message = format!("object {} has a {not_solid} that is no solid", quoted(name));
                let expected = "a closed shape that is whole, such as a sphere or a capped cylinder, a plane, an infinite cylinder, cone or quadric, a closed mesh or csg";
                return Err(at.wrong(Diagnostic::error(message).expected(expected)));
            }
            leaves = leaves.saturating_add(slot.leaves);
            depth = depth.max(1 + slot.depth);
            if leaves > MAX_CSG_LEAVES {
                return Err(at.error(format!("more than {MAX_CSG_LEAVES} solids are combined into one")));
            }
            // The scene expands operands: nested objects in a csg may become very many.
            self.budget.elements(slot.leaves, "operands of a csg").at(at)?;
            self.budget.bytes(slot.leaves.saturating_mul(LEAF_BYTES), "operands of a csg").at(at)?;
            self.budget.nesting(depth, "csg shapes in csg shapes").at(at)?;
            // Parts of an operand are a union of their own.
            if 2 * depth > Csg::MAX_DEPTH {
                return Err(at.error(format!("csg shapes are nested more than {} deep", Csg::MAX_DEPTH / 2)));
            }
            operands.push(match &slot.operand {
                Some(operand) => operand.clone(),
                None => {
                    self.keep(size_of_val(&object.shapes[..]) + 64, "operands of a csg", at)?;
                    let operand = Arc::new(object.shapes.clone());
                    let id = id.expect("the object was found");
                    self.objects[id.0 as usize].operand = Some(operand.clone());
                    operand
                }
            });
        }
        let geometry = GeometryDesc::Csg(CsgDesc { operation, operands });
        Ok(Form { geometry, origin: DVec3::ZERO, leaves, depth })
    }

    // Meshes.

    /// Vertices in single precision, and what they are relative to, where they are far away.
    fn positions(&mut self, params: &Params, shape: &str) -> Result<(Vec<Vec3>, DVec3)> {
        let Some(param) = params.typed("P", &[Type::Point3])? else {
            return Err(params.spot.error(format!("a {shape} has no \"point3 P\"")));
        };
        let mut positions = self.triples(params, "P", Type::Point3)?.unwrap_or_default();
        if positions.is_empty() {
            return Err(param.refuse("points"));
        }
        let points =
            || param.numbers().into_iter().flat_map(|list| list.chunks_exact(3).map(DVec3::from_slice));
        let origin = points().fold(Spread::NOTHING, Spread::with).origin();
        if origin != DVec3::ZERO {
            positions = points().map(|point| relative(point, origin)).collect();
        }
        Ok((positions, origin))
    }

    /// The indices, `N` per face, checked; unusable faces are dropped where the reader is lenient.
    fn faces<const N: usize>(
        &mut self,
        params: &Params,
        vertices: usize,
        shape: &str,
    ) -> Result<(Vec<[u32; N]>, Vec<usize>)> {
        let Some(indices) = params.integers("indices")? else {
            if vertices == N {
                return Ok((vec![std::array::from_fn(|i| i as u32)], vec![0]));
            }
            let message = format!("a {shape} of other than {N} points has no \"integer indices\"");
            return Err(params.spot.error(message));
        };
        let spot = params.spot_of("indices");
        let indices = if indices.len().is_multiple_of(N) {
            indices
        } else if N == 3 && self.diagnostics.is_lenient() {
            self.note(spot, "indices that make no whole triangle are left out");
            &indices[..indices.len() - indices.len() % N]
        } else {
            let wrong = Diagnostic::error("wrong number of indices").found(indices.len());
            return Err(spot.wrong(wrong.expected(format!("a multiple of {N}"))));
        };
        self.budget.elements((indices.len() / N) as u64, "faces").at(spot)?;
        self.budget.bytes(indices.len() as u64 * 4, "faces").at(spot)?;
        // Which were kept, and room for that list to grow.
        let _while_read = self.budget.hold((indices.len() / N * 24) as u64, "faces").at(spot)?;
        let mut faces = Vec::with_capacity(indices.len() / N);
        let mut kept = vec![];
        let mut dropped = 0u64;
        for (i, face) in indices.chunks_exact(N).enumerate() {
            let bad = face.iter().position(|&v| usize::try_from(v).map_or(true, |v| v >= vertices));
            match bad {
                None => {
                    faces.push(std::array::from_fn(|k| face[k] as u32));
                    kept.push(i);
                }
                Some(_) if self.diagnostics.is_lenient() => dropped += 1,
                Some(k) => {
                    let wrong =
                        Diagnostic::error(format!("index {} of the {shape} is out of range", i * N + k));
                    let wrong = wrong.found(face[k]).expected(format!("0 to {}", vertices as i64 - 1));
                    return Err(spot.wrong(wrong));
                }
            }
        }
        if dropped > 0 {
            let message = "faces with an index out of range are left out";
            self.warn(spot, Diagnostic::warning(message).found(format!("{dropped} of them")));
        }
        Ok((faces, kept))
    }

    /// Normals, uv, tangents and face numbers.
    fn mesh_parts(
        &mut self,
        params: &Params,
        mesh: &mut MeshDesc,
        kept: &[usize],
        faces: usize,
    ) -> Result<()> {
        let vertices = mesh.positions.len();
        let same = |name: &'static str, found: usize| -> Result<()> {
            if found == vertices {
                return Ok(());
            }
            let wrong = Diagnostic::error(format!("wrong number of values for parameter {}", quoted(name)));
            let expected = format!("{vertices}, as many as points");
            Err(params.spot_of(name).wrong(wrong.found(found).expected(expected)))
        };
        mesh.normals = self.triples(params, "N", Type::Normal)?;
        if let Some(normals) = &mesh.normals {
            same("N", normals.len())?;
        }
        let tangents = self.triples(params, "S", Type::Vector3)?;
        let of_fourths = tangents.as_ref().map_or(0, |list| list.len() * size_of::<Vec4>());
        self.keep(of_fourths, "tangents", params.spot)?;
        mesh.tangents = tangents.map(|list| list.into_iter().map(|t| t.extend(0.0)).collect());
        if let Some(tangents) = &mesh.tangents {
            same("S", tangents.len())?;
        }
        // pbrt-v3 also has `float uv` and `float st`.
        let uv = ["uv", "st"].into_iter().find(|name| params.has(name));
        if let Some(name) = uv {
            let Some(param) = params.typed(name, &[Type::Point2, Type::Float])? else { return Ok(()) };
            if param.ty == Type::Float || name == "st" {
                self.upgraded(param.spot);
            }
            let numbers = param.numbers()?;
            if !numbers.len().is_multiple_of(2) {
                return Err(param.refuse("pairs of numbers"));
            }
            same(name, numbers.len() / 2)?;
            self.keep(size_of::<Vec2>() * vertices, "texture coordinates", param.spot)?;
            mesh.uvs = Some(numbers.chunks_exact(2).map(|c| Vec2::new(c[0] as f32, c[1] as f32)).collect());
            if mesh.uvs.iter().flatten().any(|uv| !uv.is_finite()) {
                return Err(param.refuse("numbers of single precision"));
            }
        }
        if let Some(indices) = params.integers("faceIndices")? {
            let spot = params.spot_of("faceIndices");
            if indices.len() != faces {
                let wrong = Diagnostic::error("wrong number of values for parameter \"faceIndices\"");
                let expected = format!("{faces}, as many as faces");
                return Err(spot.wrong(wrong.found(indices.len()).expected(expected)));
            }
            self.keep(size_of::<u32>() * kept.len(), "numbers of faces", spot)?;
            // The bits of the number, whose meaning is the writer's.
            mesh.face_indices = Some(kept.iter().map(|&i| indices[i] as u32).collect());
        }
        Ok(())
    }

    /// A list of points, vectors or normals in single precision.
    fn triples(&self, params: &Params, name: &'static str, ty: Type) -> Result<Option<Vec<Vec3>>> {
        let Some(param) = params.typed(name, &[ty])? else { return Ok(None) };
        let numbers = param.numbers()?;
        if !numbers.len().is_multiple_of(3) {
            return Err(param.refuse("three numbers each"));
        }
        self.keep(numbers.len() / 3 * size_of::<Vec3>(), "vertices", param.spot)?;
        let mut list = Vec::with_capacity(numbers.len() / 3);
        for triple in numbers.chunks_exact(3) {
            list.push(vec3(triple).ok_or_else(|| param.refuse("numbers of single precision"))?);
        }
        Ok(Some(list))
    }

    fn triangle_mesh(&mut self, params: &Params) -> Result<Option<(GeometryDesc, DVec3)>> {
        let (positions, origin) = self.positions(params, "trianglemesh")?;
        let (triangles, kept) = self.faces::<3>(params, positions.len(), "trianglemesh")?;
        let given = params.integers("indices")?.map_or(1, |indices| indices.len() / 3);
        let mut mesh = MeshDesc { positions, triangles, ..MeshDesc::default() };
        self.mesh_parts(params, &mut mesh, &kept, given)?;
        if params.has("discarddegenerateUVs") {
            params.ignore(&["discarddegenerateUVs"]);
            self.upgraded(params.spot_of("discarddegenerateUVs"));
        }
        if mesh.triangles.is_empty() {
            self.note(params.spot_of("indices"), "a mesh without a face is left out");
            params.ignore_all();
            return Ok(None);
        }
        Ok(Some((GeometryDesc::Mesh(Arc::new(mesh)), origin)))
    }

    fn bilinear_mesh(&mut self, params: &Params) -> Result<Option<(GeometryDesc, DVec3)>> {
        let (positions, origin) = self.positions(params, "bilinearmesh")?;
        let (quads, kept) = self.faces::<4>(params, positions.len(), "bilinearmesh")?;
        let given = params.integers("indices")?.map_or(1, |indices| indices.len() / 4);
        let mut mesh = MeshDesc { positions, quads, ..MeshDesc::default() };
        self.mesh_parts(params, &mut mesh, &kept, given)?;
        if params.find("emissionfilename").is_some() {
            // In pbrt it says where the patches are sampled more often, and changes no light.
            params.ignore(&["emissionfilename"]);
            let message = "emissionfilename changes no light, and is left out; an AreaLightSource shines by its filename";
            self.warn(params.spot_of("emissionfilename"), Diagnostic::note(message));
        }
        if mesh.quads.is_empty() {
            self.note(params.spot_of("indices"), "a mesh without a face is left out");
            params.ignore_all();
            return Ok(None);
        }
        Ok(Some((GeometryDesc::BilinearMesh(Arc::new(mesh)), origin)))
    }

    fn loop_subdivision(&mut self, params: &Params) -> Result<(GeometryDesc, DVec3)> {
        let (positions, origin) = self.positions(params, "loopsubdiv")?;
        let (faces, _) = self.faces::<3>(params, positions.len(), "loopsubdiv")?;
        if params.has("nlevels") {
            self.upgraded(params.spot_of("nlevels"));
        }
        let levels = params.count("nlevels", 3, 0)?;
        let levels = params.count("levels", levels, 0)?;
        params.ignore(&["scheme"]);
        // Each level has four times the faces: checked before they are made.
        let at = params.spot_of("levels");
        let growth = 4u64.checked_pow(levels).unwrap_or(u64::MAX);
        let last = growth.saturating_mul(faces.len() as u64);
        self.budget.elements(last, "faces of a loopsubdiv").at(at)?;
        let held = self.budget.hold(last.saturating_mul(160), "faces of a loopsubdiv").at(at)?;
        let mesh = subdivision::subdivide(&positions, &faces, levels).map_err(|wrong| {
            let spot = params.spot_of("indices");
            spot.error(format!("a loopsubdiv needs a mesh whose faces join two by two: {wrong}"))
        })?;
        drop(held);
        self.budget.bytes((mesh.positions.len() * 24 + mesh.triangles.len() * 12) as u64, "faces").at(at)?;
        Ok((GeometryDesc::Mesh(Arc::new(mesh)), origin))
    }

    /// A mesh from a file, which is read at the end with the others.
    fn ply_mesh(&mut self, params: &Params, world_from_object: &Transform) -> Result<GeometryDesc> {
        let Some(filename) = params.string("filename")?.map(str::to_owned) else {
            return Err(params.spot.error("a plymesh has no \"string filename\""));
        };
        let at = params.spot_of("filename");
        let path = self.resolve(&filename, at)?;
        if !self.mesh_paths.contains_key(&path) {
            // The path is kept twice.
            self.keep(
                size_of::<MeshFile>() + size_of::<MeshDesc>() + 2 * filename.len() + 256,
                "mesh files",
                at,
            )?;
        }
        let edge_length = params.float_above("edgelength", 1.0, 0.0)? * self.displaced_edge_scale;
        let texture = match params.find("displacement") {
            Some(param) if self.is_texture_to_come(param) => {
                self.keep(size_of::<Param>() + param.bytes(), "textures that are not defined yet", at)?;
                Some(Err(Box::new(param.clone())))
            }
            _ => self.float_texture(params, "displacement")?.map(Ok),
        };
        if let Some(texture) = texture {
            // It depends on where the mesh is, so none shares it.
            let placed = *world_from_object;
            let displaced = Displaced { texture, edge_length, world_from_object: placed };
            let each = size_of::<MeshFile>() + size_of::<Displaced>() + size_of::<MeshDesc>();
            self.keep(each + filename.len() + 512, "mesh files", at)?;
            self.displaced.insert(self.mesh_files.len(), (displaced, params.spot_of("displacement")));
            let placeholder: Arc<MeshDesc> = Arc::default();
            self.mesh_files.push(MeshFile { path, spot: at, placeholder: placeholder.clone() });
            return Ok(GeometryDesc::Mesh(placeholder));
        }
        let file = *self.mesh_paths.entry(path.clone()).or_insert_with(|| {
            self.mesh_files.push(MeshFile { path, spot: at, placeholder: Arc::default() });
            self.mesh_files.len() - 1
        });
        Ok(GeometryDesc::Mesh(self.mesh_files[file].placeholder.clone()))
    }

    /// Reads the mesh files in parallel; returns each by its placeholder, with its origin.
    pub fn read_meshes(&mut self) -> Result<ReadMeshes> {
        let files = std::mem::take(&mut self.mesh_files);
        let strictness = self.diagnostics.strictness();
        let budget = self.budget;
        let next = std::sync::atomic::AtomicUsize::new(0);
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get()).min(files.len());
        // Diagnostics are kept per file, so that warnings are in the order of the scene.
        let read = |file: &MeshFile| {
            let mut diagnostics = Diagnostics::with_strictness(strictness);
            let mesh = Input::open(&file.path, budget)
                .and_then(|input| read_ply(&input, input.name(), budget, &mut diagnostics));
            (mesh, diagnostics)
        };
        let mut results: Vec<_> = files.iter().map(|_| None).collect();
        std::thread::scope(|scope| {
            let work = || {
                let mut done = vec![];
                loop {
                    let i = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    let Some(file) = files.get(i) else { return done };
                    done.push((i, read(file)));
                }
            };
            // Where the system refuses threads, fewer do.
            let start = |_| std::thread::Builder::new().spawn_scoped(scope, work).ok();
            let workers: Vec<_> = (0..threads).filter_map(start).collect();
            for worker in workers {
                for (i, result) in worker.join().unwrap_or_default() {
                    results[i] = Some(result);
                }
            }
        });
        let mut meshes = HashMap::new();
        let displaced = std::mem::take(&mut self.displaced);
        for (index, (file, result)) in files.iter().zip(results).enumerate() {
            // What no worker has read, as there was none or it died, is read here.
            let (mesh, diagnostics) = result.unwrap_or_else(|| read(file));
            self.diagnostics.append(diagnostics);
            let mut mesh = match mesh.map_err(|e| file_fault(file.spot, e)) {
                Ok(mesh) => mesh,
                Err(Fault::Input(spot, wrong)) if self.diagnostics.is_lenient() => {
                    self.warn(spot, Diagnostic { severity: Severity::Warning, ..*wrong });
                    PlyFile::default()
                }
                Err(fault) => return Err(fault),
            };
            if mesh.has_corner_uvs {
                // As in pbrt-v4, which knows none of them.
                mesh.mesh.uvs = None;
            }
            if mesh.mesh.triangles.is_empty() && mesh.mesh.quads.is_empty() {
                self.note(file.spot, "a plymesh without faces shows nothing");
            } else if let Some((displaced, at)) = displaced.get(&index) {
                mesh.mesh = self.displaced(displaced, *at, &mesh)?;
            }
            meshes.insert(Arc::as_ptr(&file.placeholder), (Arc::new(mesh.mesh), mesh.origin));
        }
        // Pointers identify placeholders as long as these live.
        self.mesh_files = files;
        Ok(meshes)
    }
}

impl Converter<'_, '_> {
    /// The mesh of a file with its vertices moved.
    fn displaced(&mut self, displaced: &Displaced, at: SourcePosition, file: &PlyFile) -> Result<MeshDesc> {
        let texture = match &displaced.texture {
            Ok(texture) => texture.clone(),
            Err(param) => self.texture_named(param)?.texture,
        };
        let displacement = Displacement {
            texture,
            edge_length: displaced.edge_length,
            world_from_object: displaced.world_from_object,
        };
        displacement.apply(&file.mesh, file.origin, self.budget).map_err(|refused| match refused {
            Refused::Limit(limit) => Fault::Limit(at, Box::new(limit)),
            Refused::NoUvs => {
                let wrong = Diagnostic::error("a mesh without texture coordinates cannot be displaced");
                at.wrong(wrong.expected("a file with u and v of its vertices"))
            }
            Refused::NotFinite { vertex, point } => {
                let wrong = Diagnostic::error(format!("the displacement takes vertex {vertex} away"));
                at.wrong(wrong.found(format!("not a finite number at {point}")))
            }
        })
    }
}

/// Each face of a mesh as a mesh of its own.
pub(super) fn single_faces(mesh: &MeshDesc) -> impl Iterator<Item = MeshDesc> + '_ {
    fn pick<T: Copy>(list: &Option<Vec<T>>, corners: &[u32]) -> Option<Vec<T>> {
        list.as_ref().map(|list| corners.iter().map(|&i| list[i as usize]).collect())
    }
    let numbers = mesh.face_indices.as_deref();
    let triangles = mesh.triangles.iter().map(|face| &face[..]);
    let faces = triangles.chain(mesh.quads.iter().map(|face| &face[..]));
    faces.enumerate().map(move |(number, corners)| {
        let is_triangle = corners.len() == 3;
        MeshDesc {
            positions: corners.iter().map(|&i| mesh.positions[i as usize]).collect(),
            triangles: if is_triangle { vec![[0, 1, 2]] } else { vec![] },
            quads: if is_triangle { vec![] } else { vec![[0, 1, 2, 3]] },
            normals: pick(&mesh.normals, corners),
            uvs: pick(&mesh.uvs, corners),
            tangents: pick(&mesh.tangents, corners),
            colours: pick(&mesh.colours, corners),
            face_indices: numbers.map(|numbers| vec![numbers[number]]),
            ..MeshDesc::default()
        }
    })
}

/// Whether each edge of a mesh is shared by exactly two faces in opposite directions, with vertices at the same
/// position merged.
pub(super) fn is_closed(mesh: &MeshDesc) -> bool {
    let mut places = HashMap::new();
    let vertex: Vec<u32> = mesh
        .positions
        .iter()
        .map(|p| {
            // Adding 0 turns -0 into 0.
            let key = (*p + Vec3::ZERO).to_array().map(f32::to_bits);
            let next = places.len() as u32;
            *places.entry(key).or_insert(next)
        })
        .collect();
    let mut balance: HashMap<(u32, u32), (u32, u32)> = HashMap::new();
    let triangles = mesh.triangles.iter().map(|f| &f[..]);
    let mut any = false;
    for face in triangles.chain(mesh.quads.iter().map(|f| &f[..])) {
        for (i, &a) in face.iter().enumerate() {
            let (a, b) = (vertex[a as usize], vertex[face[(i + 1) % face.len()] as usize]);
            if a == b {
                // An edge of length 0 is ignored.
                continue;
            }
            any = true;
            let count = balance.entry((a.min(b), a.max(b))).or_default();
            *if a < b { &mut count.0 } else { &mut count.1 } += 1;
        }
    }
    any && balance.values().all(|count| *count == (1, 1))
}
