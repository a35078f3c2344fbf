//! From the entities of a scene file to a [`SceneDesc`]: the tables of named entities, and deferred work.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;
use std::path::PathBuf;
use std::sync::Arc;

use lumbre_image::Bitmap;
use lumbre_math::{AnimatedTransform, Transform};
use lumbre_scene::{
    FilmDesc, GeometryDesc, InstanceDesc, MaterialId, MediumId, MeshDesc, NamedMaterial, ObjectDesc,
    ObjectId, Placement, SamplerDesc, SceneDesc, ShapeDesc, WithoutLight,
};
use lumbre_shading::measured::MeasuredTables;
use lumbre_shading::medium::Medium;
use lumbre_shading::spectrum::LightCurve;
use lumbre_shading::{
    FloatTexture, Material, MipMap, PrincipledParams, Spectrum, SpectrumTexture, SpectrumValue, Texture,
    TextureValue,
};

use super::images::ImageKey;
use super::lens::LensLater;
use super::params::{Param, Params};
use super::parser;
use super::shapes::ReadMeshes;
use super::source::{AtSpot, Fault, Files, Result, SourcePosition};
use crate::diagnostic::quoted;
use crate::origin::placed;
use crate::{Budget, Diagnostic, Diagnostics, FormatError, Severity};

/// Converts entities to the description of the scene.
pub(super) struct Converter<'b, 'd> {
    pub budget: &'b Budget,
    pub diagnostics: &'d mut Diagnostics,
    pub files: Files,
    /// The folder of relative file names; `None` if no other files may be read.
    pub directory: Option<PathBuf>,
    pub scene: SceneDesc,
    pub shape_count: u32,
    /// Each with the place of its first use as long as it is undefined.
    pub materials: Vec<MaterialSlot>,
    pub material_names: HashMap<Arc<str>, MaterialId>,
    /// Materials whose textures are defined after them, with their types.
    pub materials_later: Vec<(MaterialId, String, Params)>,
    pub waiting: HashSet<u32>,
    /// Alphas whose textures are defined after them, by the index of the shape.
    pub alphas_later: HashMap<u32, Param>,
    /// Textures by kind and name whose file cannot be read: an error where they are used.
    pub broken_textures: HashMap<(&'static str, String), (SourcePosition, Diagnostic)>,
    pub objects: Vec<ObjectSlot>,
    pub object_names: HashMap<Arc<str>, ObjectId>,
    pub open_object: Option<ObjectId>,
    pub float_textures: HashMap<String, Known<f32>>,
    pub spectrum_textures: HashMap<String, Known<Spectrum>>,
    /// Constant textures by their bits: most are of a few values.
    pub constants: HashMap<u32, FloatArc>,
    pub constant_spectra: HashMap<[u32; 3], SpectrumArc>,
    /// The last spectrum of a light, and its curve: the next one often has the same.
    pub last_light: Option<(SpectrumValue, Arc<LightCurve>)>,
    /// Each with the place of its first use as long as it is undefined.
    pub media: Vec<MediumSlot>,
    pub medium_names: HashMap<Arc<str>, MediumId>,
    pub images: HashMap<ImageKey, Arc<MipMap>>,
    /// Measured materials by their files.
    pub measured: HashMap<PathBuf, Arc<MeasuredTables>>,
    /// Images that are missing, when lenient.
    pub missing: HashSet<PathBuf>,
    /// The first pixels of each image file.
    pub bitmaps: HashMap<PathBuf, Arc<Bitmap>>,
    /// Mesh files to be read at the end, and their indices by path.
    pub mesh_files: Vec<MeshFile>,
    pub mesh_paths: HashMap<PathBuf, usize>,
    /// What moves the vertices of mesh files, by their indices, and where that is asked for.
    pub displaced: HashMap<usize, (Displaced, SourcePosition)>,
    /// Emissive shapes whose material is not yet known to be a surface.
    pub lights_to_check: Vec<(MaterialId, SourcePosition)>,
    /// Meshes in CSG shapes, which can be checked only after they are read.
    pub meshes_to_close: Vec<(Arc<MeshDesc>, SourcePosition)>,
    pub sampler_seed: Option<u64>,
    /// The times of the two current transforms.
    pub transform_times: [f64; 2],
    pub exposure: Exposure,
    /// The lens of the camera, which needs the film.
    pub lens: Option<LensLater>,
    /// A factor on the edges of displaced meshes.
    pub displaced_edge_scale: f64,
    /// The diagonal of the film, in millimetres.
    pub film_diagonal: f64,
    upgraded: Option<SourcePosition>,
}

/// A material, by its index in the table.
pub(super) struct MaterialSlot {
    pub name: Option<Arc<str>>,
    pub material: Option<Arc<Material>>,
    pub first_use: SourcePosition,
    /// Its depth of nested mixtures.
    pub depth: usize,
}

/// A medium, by its index in the table.
pub(super) struct MediumSlot {
    pub name: Arc<str>,
    pub medium: Option<Arc<Medium>>,
    pub first_use: SourcePosition,
}

/// An object, by its index in the table.
pub(super) struct ObjectSlot {
    /// Its name is set at the end.
    pub object: Option<ObjectDesc>,
    pub name: Arc<str>,
    /// Its shapes as an operand of CSG, once it is one.
    pub operand: Option<Arc<Vec<ShapeDesc>>>,
    pub first_use: SourcePosition,
    /// The number of its shapes with every CSG expanded, and their nesting depth.
    pub leaves: u64,
    pub depth: usize,
}

/// A mesh file to be read at the end: shapes hold `placeholder` until then.
pub(super) struct MeshFile {
    pub path: PathBuf,
    pub spot: SourcePosition,
    pub placeholder: Arc<MeshDesc>,
}

/// A displacement whose texture may be defined later.
pub(super) struct Displaced {
    pub texture: std::result::Result<FloatArc, Box<Param>>,
    pub edge_length: f64,
    pub world_from_object: Transform,
}

/// The exposure settings, which camera and film share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exposure {
    pub shutter: f64,
    pub iso: f64,
    /// The factor `scale` of pbrt-v3's film.
    pub scale: f64,
}

/// A texture with bounds on the work of its evaluation.
#[derive(Clone, Debug)]
pub(super) struct Known<T: TextureValue> {
    pub texture: Arc<Texture<T>>,
    /// The depth of nested textures.
    pub depth: usize,
    /// The number of evaluations, with shared textures counted each time.
    pub leaves: u64,
}

impl<T: TextureValue> Known<T> {
    pub fn constant(value: T) -> Self {
        Self::of(Arc::new(Texture::Constant(value)))
    }

    /// A texture that holds no others.
    pub fn of(texture: Arc<Texture<T>>) -> Self {
        Self { texture, depth: 1, leaves: 1 }
    }

    /// The value, if it is uniform.
    pub fn value(&self) -> Option<T> {
        match *self.texture {
            Texture::Constant(value) | Texture::Spectrum { value, .. } => Some(value),
            _ => None,
        }
    }
}

/// The maximal number of evaluations of one texture.
pub(super) const MAX_TEXTURE_LEAVES: u64 = 4096;

pub(super) type FloatArc = Arc<FloatTexture>;
pub(super) type SpectrumArc = Arc<SpectrumTexture>;

impl<'b, 'd> Converter<'b, 'd> {
    pub fn new(budget: &'b Budget, diagnostics: &'d mut Diagnostics, directory: Option<PathBuf>) -> Self {
        // The language's defaults.
        let film = FilmDesc { width: Some(1280), height: Some(720), ..FilmDesc::default() };
        let sampler = SamplerDesc { spp: Some(16), ..SamplerDesc::default() };
        Self {
            budget,
            diagnostics,
            files: Files::default(),
            directory,
            scene: SceneDesc { film, sampler, without_light: WithoutLight::Dark, ..SceneDesc::default() },
            shape_count: 0,
            materials: vec![],
            material_names: HashMap::new(),
            materials_later: vec![],
            waiting: HashSet::new(),
            alphas_later: HashMap::new(),
            broken_textures: HashMap::new(),
            objects: vec![],
            object_names: HashMap::new(),
            open_object: None,
            float_textures: HashMap::new(),
            spectrum_textures: HashMap::new(),
            constants: HashMap::new(),
            constant_spectra: HashMap::new(),
            last_light: None,
            media: Vec::new(),
            medium_names: HashMap::new(),
            images: HashMap::new(),
            measured: HashMap::new(),
            missing: HashSet::new(),
            bitmaps: HashMap::new(),
            mesh_files: vec![],
            mesh_paths: HashMap::new(),
            displaced: HashMap::new(),
            lights_to_check: vec![],
            meshes_to_close: vec![],
            sampler_seed: None,
            transform_times: [0.0, 1.0],
            exposure: Exposure { shutter: 1.0, iso: 100.0, scale: 1.0 },
            lens: None,
            displaced_edge_scale: 1.0,
            film_diagonal: 35.0,
            upgraded: None,
        }
    }

    /// Adds a diagnostic that does not stop the reading.
    pub fn warn(&mut self, spot: SourcePosition, diagnostic: Diagnostic) {
        self.diagnostics.push(self.files.locate(spot, diagnostic));
    }

    /// Warns that something is ignored or replaced.
    pub fn note(&mut self, spot: SourcePosition, message: impl Into<String>) {
        self.warn(spot, Diagnostic::warning(message));
    }

    /// Warns of an unknown type, with the nearest known one.
    pub fn unknown(&mut self, spot: SourcePosition, noun: &str, ty: &str, known: &[&str], instead: &str) {
        let message = format!("unknown {noun} {}: {instead}", quoted(ty));
        let files = &self.files;
        self.diagnostics
            .warn(&message, |unknown| files.locate(spot, unknown.suggest(ty, known.iter().copied())));
    }

    /// Warns of unused parameters.
    pub fn done(&mut self, params: &Params) {
        let (unused, asked) = params.unused();
        for param in unused {
            let message = format!("unknown parameter {} of {}", quoted(&param.name), params.owner);
            let files = &self.files;
            self.diagnostics.warn(&message, |unknown| {
                files.locate(param.spot, unknown.suggest(&param.name, asked.iter().copied()))
            });
        }
    }

    /// Notes a use of pbrt-v3 syntax; reported once.
    pub fn upgraded(&mut self, spot: SourcePosition) {
        if self.upgraded.is_none() {
            self.upgraded = Some(spot);
            self.note(spot, "this is of pbrt-v3: the scene is upgraded to pbrt-v4 while it is read");
        }
    }

    pub fn is_upgraded(&self) -> bool {
        self.upgraded.is_some()
    }

    /// The path of a file that the scene names.
    pub fn resolve(&self, name: &str, at: SourcePosition) -> Result<PathBuf> {
        match &self.directory {
            Some(directory) => Ok(parser::resolve(directory, name, self.budget)),
            None => {
                Err(at
                    .error(format!("no file can be read from here, and the scene asks for {}", quoted(name))))
            }
        }
    }

    /// A constant texture, shared with others of the same value.
    pub fn number(&mut self, value: f32) -> FloatArc {
        shared(&mut self.constants, value.to_bits(), || Texture::Constant(value))
    }

    /// A constant texture of a colour, shared with others of the same.
    pub fn colour(&mut self, colour: Spectrum) -> SpectrumArc {
        let bits = colour.to_array().map(f32::to_bits);
        shared(&mut self.constant_spectra, bits, || Texture::Constant(colour))
    }

    // Materials and objects by name; uses may precede definitions.

    pub fn add_material(
        &mut self,
        name: Option<Arc<str>>,
        material: Option<Material>,
        depth: usize,
        spot: SourcePosition,
    ) -> Result<MaterialId> {
        // What is in a material besides its textures, and textures of its own.
        const EACH: usize = size_of::<MaterialSlot>()
            + size_of::<NamedMaterial>()
            + size_of::<Material>()
            + size_of::<PrincipledParams>()
            + 2 * size_of::<SpectrumTexture>();
        self.keep(EACH, "materials", spot)?;
        let id = MaterialId(self.materials.len() as u32);
        self.materials.push(MaterialSlot { name, material: material.map(Arc::new), first_use: spot, depth });
        Ok(id)
    }

    /// The material of shapes before the first `Material`.
    pub fn default_material(&mut self) -> MaterialId {
        let first_use = SourcePosition { file: 0, line: 1, column: 1 };
        let material = Some(Arc::new(Material::default_diffuse()));
        self.materials.push(MaterialSlot { name: None, material, first_use, depth: 1 });
        MaterialId(self.materials.len() as u32 - 1)
    }

    pub fn material_named(&mut self, name: &str, at: SourcePosition) -> Result<MaterialId> {
        if let Some(id) = self.material_names.get(name) {
            return Ok(*id);
        }
        let name = self.kept_name(name, at)?;
        let id = self.add_material(Some(name.clone()), None, 1, at)?;
        self.material_names.insert(name, id);
        Ok(id)
    }

    /// Charges `bytes` that are kept to the end.
    pub fn keep(&self, bytes: usize, what: &str, spot: SourcePosition) -> Result<()> {
        self.budget.bytes(bytes as u64, what).at(spot)
    }

    /// A name that a table keeps, charged with the rest of its table entry, and its copy in the scene.
    pub fn kept_name(&self, name: &str, spot: SourcePosition) -> Result<Arc<str>> {
        const BESIDE: usize = 96;
        self.keep(2 * name.len() + BESIDE, "names", spot)?;
        Ok(name.into())
    }

    fn object_named(&mut self, name: &str, at: SourcePosition) -> Result<ObjectId> {
        if let Some(id) = self.object_names.get(name) {
            return Ok(*id);
        }
        let name = self.kept_name(name, at)?;
        let id = self.add_object(name.clone(), None, 0, 0, at)?;
        self.object_names.insert(name, id);
        Ok(id)
    }

    fn add_object(
        &mut self,
        name: Arc<str>,
        object: Option<ObjectDesc>,
        leaves: u64,
        depth: usize,
        first_use: SourcePosition,
    ) -> Result<ObjectId> {
        self.keep(size_of::<ObjectSlot>() + size_of::<ObjectDesc>(), "objects", first_use)?;
        let id = ObjectId(self.objects.len() as u32);
        self.objects.push(ObjectSlot { object, name, operand: None, first_use, leaves, depth });
        Ok(id)
    }

    pub fn begin_object(&mut self, name: &str, spot: SourcePosition, at: SourcePosition) -> Result<()> {
        if let Some(open) = self.open_object {
            let open = &self.objects[open.0 as usize].name;
            return Err(spot.error(format!("ObjectBegin inside the object {}", quoted(open))));
        }
        let id = self.object_named(name, at)?;
        let slot = &mut self.objects[id.0 as usize];
        if slot.object.is_some() {
            return Err(at.error(format!("object {} is defined twice", quoted(name))));
        }
        slot.object = Some(ObjectDesc::default());
        self.open_object = Some(id);
        Ok(())
    }

    pub fn end_object(&mut self) {
        let open = self.open_object.take().and_then(|id| self.objects[id.0 as usize].object.as_mut());
        if let Some(object) = open {
            object.shapes.shrink_to_fit();
            object.instances.shrink_to_fit();
        }
    }

    pub fn instance(
        &mut self,
        name: &str,
        spot: SourcePosition,
        at: SourcePosition,
        ctm: &[Transform; 2],
    ) -> Result<()> {
        if let Some(open) = self.open_object {
            let open = &self.objects[open.0 as usize].name;
            return Err(spot.error(format!("ObjectInstance inside the object {}", quoted(open))));
        }
        let object = self.object_named(name, at)?;
        self.keep(size_of::<InstanceDesc>(), "instances", spot)?;
        let motion = self.motion(spot, ctm, "instance")?;
        let world_from_object = motion.map_or(ctm[0].into(), Placement::Moving);
        self.scene.instances.push(InstanceDesc { object, world_from_object });
        Ok(())
    }

    /// The motion between the two current transforms, if they differ.
    pub fn motion(
        &mut self,
        spot: SourcePosition,
        ctm: &[Transform; 2],
        what: &str,
    ) -> Result<Option<Arc<AnimatedTransform>>> {
        if ctm[0] == ctm[1] {
            return Ok(None);
        }
        // The maps, each taken apart as well.
        self.keep(size_of::<AnimatedTransform>() + 4 * size_of::<Transform>(), "motions", spot)?;
        let [start, end] = self.transform_times;
        match AnimatedTransform::new(vec![(start, ctm[0]), (end, ctm[1])]) {
            Ok(motion) => Ok(Some(Arc::new(motion))),
            Err(error) => {
                let message = format!("this {what} stays where it starts: {error}");
                self.warn(spot, Diagnostic::warning(message));
                Ok(None)
            }
        }
    }

    /// Adds a moving shape to the open object, or else to the world, in an object of its own. Its transform is what
    /// comes before the motion.
    pub fn push_moving(
        &mut self,
        shape: ShapeDesc,
        leaves: u64,
        depth: usize,
        motion: Arc<AnimatedTransform>,
        spot: SourcePosition,
    ) -> Result<()> {
        let object = ObjectDesc { shapes: vec![shape], ..ObjectDesc::default() };
        let id = self.add_object("".into(), Some(object), leaves, depth, spot)?;
        self.keep(size_of::<InstanceDesc>(), "instances", spot)?;
        let instance = InstanceDesc { object: id, world_from_object: Placement::Moving(motion) };
        match self.open_object {
            None => self.scene.instances.push(instance),
            Some(open) => {
                let slot = &mut self.objects[open.0 as usize];
                slot.object.as_mut().expect("it is open").instances.push(instance);
            }
        }
        Ok(())
    }

    /// Adds a shape to the open object, or else to the world. `leaves` and `depth` are those of a CSG.
    /// The last shape of the object that is open, or of the world, unless its alpha is still to come.
    pub fn shape_before(&mut self) -> Option<&mut ShapeDesc> {
        let before = match self.open_object {
            None => self.scene.shapes.last_mut(),
            Some(id) => self.objects[id.0 as usize].object.as_mut()?.shapes.last_mut(),
        }?;
        (!self.alphas_later.contains_key(&before.index)).then_some(before)
    }

    pub fn push_shape(&mut self, shape: ShapeDesc, leaves: u64, depth: usize) {
        match self.open_object {
            None => self.scene.shapes.push(shape),
            Some(id) => {
                let slot = &mut self.objects[id.0 as usize];
                slot.leaves = slot.leaves.saturating_add(leaves);
                slot.depth = slot.depth.max(depth);
                slot.object.as_mut().expect("it is open").shapes.push(shape);
            }
        }
    }

    // The end of the scene.

    /// Completes deferred work: names, mesh files, lights on interfaces; and moves the tables into the scene.
    pub fn finish(&mut self) -> Result<()> {
        self.finish_materials()?;
        let mut broken: Vec<_> = std::mem::take(&mut self.broken_textures).into_values().collect();
        broken.sort_by_key(|(spot, _)| (spot.file, spot.line, spot.column));
        for (spot, wrong) in broken {
            let message = format!("{}: the texture is not used", wrong.message);
            self.warn(spot, Diagnostic { severity: Severity::Warning, message, ..wrong });
        }
        let mut alphas = HashMap::new();
        for (index, param) in std::mem::take(&mut self.alphas_later) {
            let alpha: Known<f32> = self.texture_named(&param)?;
            alphas.insert(index, alpha.texture);
        }
        self.check_names()?;
        let meshes = self.read_meshes()?;
        let is_interface: Vec<bool> = self
            .materials
            .iter()
            .map(|slot| {
                let material = slot.material.as_deref().expect("names are checked");
                matches!(material.kind, lumbre_shading::MaterialKind::Interface)
            })
            .collect();
        for (id, spot) in std::mem::take(&mut self.lights_to_check) {
            if is_interface[id.0 as usize] {
                self.note(spot, "an interface gives no light: the area light of this shape is left out");
            }
        }
        self.check_hair();
        let mut known = Completion { alphas, is_interface, meshes, operands: HashMap::new() };
        self.scene.shapes.iter_mut().for_each(|shape| known.complete(shape));
        for slot in &mut self.objects {
            slot.operand = None;
            let shapes = slot.object.iter_mut().flat_map(|object| &mut object.shapes);
            shapes.for_each(|shape| known.complete(shape));
        }
        let Completion { meshes, .. } = known;
        let shapes = std::mem::take(&mut self.scene.shapes);
        self.scene.shapes = self.shared_out(shapes)?;
        for i in 0..self.objects.len() {
            if let Some(object) = &mut self.objects[i].object {
                let shapes = std::mem::take(&mut object.shapes);
                let shapes = self.shared_out(shapes)?;
                self.objects[i].object.as_mut().expect("it was there").shapes = shapes;
            }
        }
        for (mesh, spot) in std::mem::take(&mut self.meshes_to_close) {
            let mesh = meshes.get(&Arc::as_ptr(&mesh)).map_or(&mesh, |(read, _)| read);
            if !super::shapes::is_closed(mesh) {
                let message = "a csg operand has a mesh that is not closed: it is no solid";
                return Err(spot.error(message));
            }
        }
        let media = std::mem::take(&mut self.media).into_iter();
        self.scene.media = media.map(|slot| slot.medium.expect("names are checked")).collect();
        let materials = std::mem::take(&mut self.materials).into_iter();
        self.scene.materials = materials
            .map(|slot| NamedMaterial {
                name: slot.name.map(|name| name.to_string()),
                material: slot.material.expect("names are checked"),
            })
            .collect();
        let objects = std::mem::take(&mut self.objects).into_iter();
        self.object_names = HashMap::new();
        self.scene.shapes.shrink_to_fit();
        self.scene.instances.shrink_to_fit();
        self.scene.lights.shrink_to_fit();
        self.scene.objects = objects
            .map(|slot| ObjectDesc { name: slot.name.to_string(), ..slot.object.expect("names are checked") })
            .collect();
        self.finish_settings()
    }

    /// Shapes in which each face of a mesh that shines by power is a shape with the whole of it, as in pbrt.
    fn shared_out(&self, shapes: Vec<ShapeDesc>) -> Result<Vec<ShapeDesc>> {
        let faces = |shape: &ShapeDesc| match &shape.geometry {
            GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh) => {
                mesh.triangles.len() + mesh.quads.len()
            }
            _ => 1,
        };
        let is_shared = |shape: &ShapeDesc| {
            shape.area_light.as_ref().is_some_and(|light| light.power.is_some()) && faces(shape) > 1
        };
        if !shapes.iter().any(is_shared) {
            return Ok(shapes);
        }
        let mut all = vec![];
        for shape in shapes {
            match &shape.geometry {
                GeometryDesc::Mesh(mesh) if is_shared(&shape) => {
                    let each = size_of::<ShapeDesc>() + size_of::<MeshDesc>() + 256;
                    self.budget
                        .bytes((each * faces(&shape)) as u64, "faces that shine")
                        .map_err(FormatError::from)?;
                    let part =
                        |mesh| ShapeDesc { geometry: GeometryDesc::Mesh(Arc::new(mesh)), ..shape.clone() };
                    all.extend(super::shapes::single_faces(mesh).map(part));
                }
                GeometryDesc::BilinearMesh(mesh) if is_shared(&shape) => {
                    let part = |mesh| ShapeDesc {
                        geometry: GeometryDesc::BilinearMesh(Arc::new(mesh)),
                        ..shape.clone()
                    };
                    all.extend(super::shapes::single_faces(mesh).map(part));
                }
                _ => all.push(shape),
            }
        }
        Ok(all)
    }

    /// Says which materials of hair are on shapes that are no fibres.
    fn check_hair(&mut self) {
        let is_hair = |slot: &MaterialSlot| {
            let material = slot.material.as_deref().expect("names are checked");
            matches!(material.kind, lumbre_shading::MaterialKind::Hair(_))
        };
        if !self.materials.iter().any(is_hair) {
            return;
        }
        let of_objects = self.objects.iter().flat_map(|slot| &slot.object).flat_map(|object| &object.shapes);
        let is_fibre = |shape: &&ShapeDesc| matches!(shape.geometry, GeometryDesc::Curves(_));
        let others = self.scene.shapes.iter().chain(of_objects).filter(|shape| !is_fibre(shape));
        let mut places: Vec<SourcePosition> = others
            .filter_map(|shape| Some(&self.materials[shape.material?.0 as usize]))
            .filter(|slot| is_hair(slot))
            .map(|slot| slot.first_use)
            .collect();
        places.sort_by_key(|spot| (spot.file, spot.line, spot.column));
        places.dedup_by_key(|spot| (spot.file, spot.line, spot.column));
        for spot in places {
            let message = "hair on a shape that is no curve: its v says where light meets a fibre";
            self.note(spot, message);
        }
    }

    fn check_names(&mut self) -> Result<()> {
        if let Some(slot) = self.materials.iter().find(|slot| slot.material.is_none()) {
            let name = slot.name.as_deref().unwrap_or_default();
            let defined = self.materials.iter().filter(|slot| slot.material.is_some());
            let known = defined.filter_map(|slot| slot.name.as_deref());
            let wrong = Diagnostic::error(format!("material {} is not defined", quoted(name)));
            return Err(slot.first_use.wrong(wrong.suggest(name, known)));
        }
        if let Some(slot) = self.objects.iter().find(|slot| slot.object.is_none()) {
            let defined = self.objects.iter().filter(|slot| slot.object.is_some());
            let known = defined.map(|slot| &*slot.name).filter(|name| !name.is_empty());
            let wrong = Diagnostic::error(format!("object {} is not defined", quoted(&slot.name)));
            return Err(slot.first_use.wrong(wrong.suggest(&slot.name, known)));
        }
        if let Some(slot) = self.media.iter().find(|slot| slot.medium.is_none()) {
            let known = self.media.iter().filter(|slot| slot.medium.is_some()).map(|slot| &*slot.name);
            let wrong = Diagnostic::error(format!("medium {} is not defined", quoted(&slot.name)));
            return Err(slot.first_use.wrong(wrong.suggest(&slot.name, known)));
        }
        Ok(())
    }
}

/// What is known of shapes only when all is read.
struct Completion {
    /// By the index of the shape.
    alphas: HashMap<u32, FloatArc>,
    /// By material.
    is_interface: Vec<bool>,
    meshes: ReadMeshes,
    /// Operands by what they were: several CSG shapes share them.
    operands: HashMap<*const Vec<ShapeDesc>, [Arc<Vec<ShapeDesc>>; 2]>,
}

impl Completion {
    fn complete(&mut self, shape: &mut ShapeDesc) {
        if let Some(alpha) = self.alphas.get(&shape.index) {
            shape.alpha = Some(alpha.clone());
        }
        if shape.material.is_some_and(|id| self.is_interface[id.0 as usize]) {
            shape.material = None;
            shape.area_light = None;
        }
        match &mut shape.geometry {
            GeometryDesc::Mesh(mesh) => {
                if let Some((read, origin)) = self.meshes.get(&Arc::as_ptr(mesh)) {
                    *mesh = read.clone();
                    shape.world_from_object = shape.world_from_object * placed(*origin);
                }
            }
            GeometryDesc::Csg(csg) => csg.operands.iter_mut().for_each(|operand| self.operand(operand)),
            GeometryDesc::Exact(_)
            | GeometryDesc::Coloured(_)
            | GeometryDesc::BilinearMesh(_)
            | GeometryDesc::Curves(_)
            | GeometryDesc::Custom(_) => {}
        }
    }

    /// Nests no deeper than CSG shapes may.
    fn operand(&mut self, operand: &mut Arc<Vec<ShapeDesc>>) {
        if let Some([_, complete]) = self.operands.get(&Arc::as_ptr(operand)) {
            *operand = complete.clone();
            return;
        }
        let mut shapes = Vec::clone(operand);
        shapes.iter_mut().for_each(|shape| self.complete(shape));
        let complete = Arc::new(shapes);
        // The old one stays, so that its address stands for nothing else.
        let old = std::mem::replace(operand, complete.clone());
        self.operands.insert(Arc::as_ptr(&old), [old, complete]);
    }
}

/// The texture of a key, made once; beyond some number they are not kept.
fn shared<K: Hash + Eq, T: TextureValue>(
    known: &mut HashMap<K, Arc<Texture<T>>>,
    key: K,
    make: impl FnOnce() -> Texture<T>,
) -> Arc<Texture<T>> {
    const MOST: usize = 1 << 12;
    if let Some(found) = known.get(&key) {
        return found.clone();
    }
    let made = Arc::new(make());
    if known.len() < MOST {
        known.insert(key, made.clone());
    }
    made
}

/// What the system says of a file that the scene names.
pub(super) fn io_message(path: &std::path::Path, action: &str, source: &std::io::Error) -> String {
    match path.as_os_str().is_empty() {
        true => format!("\"\": {action}: {source}"),
        false => format!("{}: {action}: {source}", path.display()),
    }
}

/// An error about a file that the scene names, at the place that names it.
pub(super) fn file_fault(at: SourcePosition, error: FormatError) -> Fault {
    match error {
        FormatError::Io { path, action, source } => at.error(io_message(&path, action, &source)),
        FormatError::Limit { place: None, source } => Fault::Limit(at, Box::new(source)),
        other => Fault::Named(at, Box::new(other)),
    }
}
