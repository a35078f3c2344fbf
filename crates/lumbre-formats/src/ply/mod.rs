//! PLY meshes (G. Turk, "The PLY polygon file format", 1994): text or binary of either byte order.

mod header;
mod values;

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use lumbre_image::{Rgb, srgb_to_linear};
use lumbre_math::{DVec3, Transform, Vec2, Vec3};
use lumbre_scene::{GeometryDesc, MaterialId, MeshDesc, NamedMaterial, SceneDesc, ShapeDesc, UpAxis};
use lumbre_shading::{
    ImageFilter, ImageTexture, Mapping2d, Material, MaterialKind, MipMap, MipMapOptions, SpectrumTexture,
    Wrap,
};

use crate::budget::{Budget, BudgetVec};
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, nearest_name, quoted};
use crate::image::open_scene_image;
use crate::input::{Input, refuse_wide};
use crate::origin::{diagonal, is_without_area, origin_of, placed, relative};
use crate::polygon;
use crate::standing::up_of;
use crate::thin::{INK, Thin};
use header::{Element, Encoding, Header, Number, Property};
use values::{Binary, Fault, Source, Text};

/// Reads a mesh from the bytes of a PLY file.
///
/// Of vertices: `x y z`, normals `nx ny nz`, texture coordinates (`u v`, `s t`, `texture_u texture_v`,
/// `texture_s texture_t`) and colours (`red green blue`, integers in sRGB, others linear). Of faces:
/// `vertex_indices` (or `vertex_index`), `face_indices`, `texcoord`, two texture coordinates for each corner, as
/// MeshLab writes them, and colours, unless vertices have them: a vertex with several of these is kept several times.
/// Of `tristrips`: `vertex_indices`, where -1 begins a new strip. Other elements and properties are ignored. Convex
/// quadrilaterals are kept; other polygons are triangulated.
///
/// # Errors
/// [`FormatError::Input`] with the line and column, or the byte and the element's path such as `/vertex/3/x`;
/// [`FormatError::Limit`]. When lenient, unusable faces are dropped with a warning instead.
pub fn read_ply(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<PlyFile, FormatError> {
    refuse_wide(bytes, name)?;
    let header = Header::read(bytes, name, diagnostics)?;
    let body = header.end;
    let mut mesh = Mesh::new(name, bytes, header.encoding, budget, diagnostics);
    match header.encoding {
        Encoding::Text => mesh.read(&header, Text { bytes, at: body }),
        Encoding::Little => mesh.read(&header, Binary::<false> { bytes, at: body }),
        Encoding::Big => mesh.read(&header, Binary::<true> { bytes, at: body }),
    }
    .map_err(|e| e.or_at(|| Place::whole(name.clone())))?;
    mesh.finish(header.texture)
}

/// The contents of a PLY file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlyFile {
    /// The mesh.
    pub mesh: MeshDesc,
    /// What its positions are relative to: zero, unless all of them are far from there.
    pub origin: DVec3,
    /// The vertices of a file without faces and edges, in which they are points.
    pub points: Vec<u32>,
    /// The edges, as pairs of vertices.
    pub edges: Vec<[u32; 2]>,
    /// The image that a comment `TextureFile` names.
    pub texture: Option<String>,
    /// Whether texture coordinates are those of the corners of faces.
    pub has_corner_uvs: bool,
}

/// Reads the PLY file `path` as a scene of one shape with the default material.
///
/// # Errors
/// As for [`Input::open`] and [`read_ply`].
pub fn open_ply(
    path: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    ply_scene(Input::open(path, budget)?, path.parent().unwrap_or(Path::new("")), budget, diagnostics)
}

/// [`open_ply`] of a file that is open; its texture is found relative to `folder`.
pub(crate) fn ply_scene(
    input: Input<'_>,
    folder: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    let name = input.name().to_owned();
    let PlyFile { mesh, origin, points, edges, texture, .. } =
        read_ply(&input, input.name(), budget, diagnostics)?;
    drop(input);
    let world_from_object = placed(origin);
    let size = diagonal(&mesh.positions);
    let segments: Vec<([u32; 2], bool)> = edges.into_iter().map(|ends| (ends, true)).collect();
    if mesh.triangles.is_empty() && mesh.quads.is_empty() {
        let mut scene = SceneDesc { up: UpAxis::Y, ..SceneDesc::default() };
        let thin = Thin { positions: mesh.positions, colours: mesh.colours, points, segments };
        push_thin(&mut scene, &thin, size, None, world_from_object, budget)?;
        scene.shapes.shrink_to_fit();
        return Ok(scene);
    }
    let thin = (!segments.is_empty()).then(|| Thin {
        positions: mesh.positions.clone(),
        colours: mesh.colours.clone(),
        points,
        segments,
    });
    let has_uvs = mesh.uvs.is_some();
    let (up, up_is_guessed) = up_of(std::iter::once(&mesh), origin);
    let mut scene = SceneDesc { up_is_guessed, ..scene_of_meshes([mesh], up) };
    if let Some(thin) = thin {
        push_thin(&mut scene, &thin, size, None, Transform::IDENTITY, budget)?;
    }
    scene.shapes.iter_mut().for_each(|shape| shape.world_from_object = world_from_object);
    if let Some(file) = texture.filter(|_| has_uvs)
        && let Some(material) = textured(&name, &folder.join(&file), budget, diagnostics)?
    {
        scene.materials[0] = NamedMaterial { name: None, material: Arc::new(material) };
    }
    Ok(scene)
}

/// The material of a mesh with a texture, which is found next to it; `None`, with a warning, when it cannot be read.
fn textured(
    ply: &str,
    path: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<Option<Material>, FormatError> {
    let image = match open_scene_image(path, budget, diagnostics) {
        Ok(image) => image,
        Err(e @ FormatError::Limit { .. }) => return Err(e),
        Err(e) => {
            let said = Diagnostic::warning("cannot use the texture of a PLY file");
            diagnostics.push(said.at(Place::whole(ply.to_owned())).found(e));
            return Ok(None);
        }
    };
    // The pyramid takes another third.
    budget.bytes(image.bitmap.bytes() as u64 / 3, "texture")?;
    let options = MipMapOptions { wrap: Wrap::Repeat, filter: ImageFilter::Trilinear };
    let image = ImageTexture {
        mapping: Mapping2d::Uv { scale: Vec2::ONE, delta: Vec2::ZERO },
        image: Arc::new(MipMap::new(Arc::new(image.bitmap), options)),
        scale: 1.0,
        invert: false,
    };
    let reflectance = Arc::new(SpectrumTexture::Image(image));
    Ok(Some(Material::new(MaterialKind::Diffuse { reflectance })))
}

/// Points and lines as shapes of a material; without one, of their colours, or else dark blue, which is seen on white
/// and on black.
pub(crate) fn push_thin(
    scene: &mut SceneDesc,
    thin: &Thin,
    size: f64,
    material: Option<MaterialId>,
    world_from_object: Transform,
    budget: &Budget,
) -> Result<(), FormatError> {
    let material = material.unwrap_or_else(|| {
        let has_colours = thin.colours.is_some();
        scene.materials.push(match has_colours {
            true => unsaid_material(true),
            false => {
                let reflectance = Arc::new(SpectrumTexture::Constant(INK));
                let material = Arc::new(Material::new(MaterialKind::Diffuse { reflectance }));
                NamedMaterial { name: None, material }
            }
        });
        MaterialId(scene.materials.len() as u32 - 1)
    });
    for geometry in thin.shapes(size, budget) {
        let geometry = geometry?;
        budget.bytes(size_of::<ShapeDesc>() as u64, "points and lines")?;
        scene.shapes.push(ShapeDesc {
            index: scene.shapes.len() as u32,
            geometry,
            world_from_object,
            reverse_orientation: false,
            material: Some(material),
            boundary: None,
            area_light: None,
            alpha: None,
        });
    }
    Ok(())
}

/// Meshes as shapes with the default material, or with their vertex colours, in their own space.
pub(crate) fn scene_of_meshes(meshes: impl IntoIterator<Item = MeshDesc>, up: UpAxis) -> SceneDesc {
    let mut scene = SceneDesc { up, ..SceneDesc::default() };
    // Without and with colours.
    let mut made: [Option<MaterialId>; 2] = [None; 2];
    for (index, mesh) in (0..).zip(meshes) {
        let has_colours = mesh.colours.is_some();
        let material = *made[usize::from(has_colours)].get_or_insert_with(|| {
            scene.materials.push(unsaid_material(has_colours));
            MaterialId(scene.materials.len() as u32 - 1)
        });
        scene.shapes.push(ShapeDesc {
            index,
            geometry: GeometryDesc::Mesh(Arc::new(mesh)),
            world_from_object: Transform::IDENTITY,
            reverse_orientation: false,
            material: Some(material),
            boundary: None,
            area_light: None,
            alpha: None,
        });
    }
    scene
}

/// The material of a mesh whose file has none: its vertex colours, if any, else grey.
pub(crate) fn unsaid_material(has_colours: bool) -> NamedMaterial {
    let material = match has_colours {
        true => Material::new(MaterialKind::Diffuse { reflectance: Arc::new(SpectrumTexture::Vertices) }),
        false => Material::default_diffuse(),
    };
    NamedMaterial { name: None, material: Arc::new(material) }
}
/// The use of a vertex property.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Slot {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Colour(usize),
    Unused,
}

impl Slot {
    fn of(name: &str) -> Self {
        match name {
            "x" => Self::Position(0),
            "y" => Self::Position(1),
            "z" => Self::Position(2),
            "nx" => Self::Normal(0),
            "ny" => Self::Normal(1),
            "nz" => Self::Normal(2),
            "u" | "s" | "texture_u" | "texture_s" => Self::Uv(0),
            "v" | "t" | "texture_v" | "texture_t" => Self::Uv(1),
            "red" | "r" | "diffuse_red" => Self::Colour(0),
            "green" | "g" | "diffuse_green" => Self::Colour(1),
            "blue" | "b" | "diffuse_blue" => Self::Colour(2),
            _ => Self::Unused,
        }
    }
}

/// A value of a vertex that is not finite, and where the vertex begins.
#[derive(Clone, Copy, Debug)]
struct Flaw {
    vertex: u32,
    at: usize,
    what: &'static str,
}

/// A channel of a colour as linear light: integers are in sRGB.
fn colour_of(value: f64, number: Number) -> f32 {
    if number.is_float() { value as f32 } else { srgb_to_linear((value / number.one()) as f32) }
}

/// What faces say of their corners. A vertex has the values of the first corner that comes to it; for others it is
/// copied.
#[derive(Debug)]
struct Corners {
    /// Vertices of the file; what comes after them are copies.
    vertices: usize,
    /// By vertex; `None` where no corner came to it.
    of_vertices: Vec<Option<Corner>>,
    /// Copies by their vertex and the bits of their values.
    copies: HashMap<(u32, [u32; 5]), u32>,
    /// Whether faces have texture coordinates.
    has_uvs: bool,
    /// Whether faces have colours.
    has_colours: bool,
}

/// The texture coordinates of a corner, and the colour of its face.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Corner {
    uv: Vec2,
    colour: Rgb,
}

impl Corner {
    fn bits(self) -> [u32; 5] {
        let Self { uv, colour } = self;
        [uv.x, uv.y, colour.r, colour.g, colour.b].map(f32::to_bits)
    }
}

struct Mesh<'a> {
    name: &'a Arc<str>,
    bytes: &'a [u8],
    encoding: Encoding,
    budget: &'a Budget,
    diagnostics: &'a mut Diagnostics,
    positions: Vec<Vec3>,
    origin: DVec3,
    edges: BudgetVec<'a, [u32; 2]>,
    normals: Option<Vec<Vec3>>,
    uvs: Option<Vec<Vec2>>,
    colours: Option<Vec<Rgb>>,
    /// When lenient, vertices that are not finite.
    unusable: Vec<u32>,
    /// What else is not finite.
    flaws: BudgetVec<'a, Flaw>,
    /// Texture coordinates of corners and colours of faces, in files that have them.
    corners: Option<Corners>,
    triangles: BudgetVec<'a, [u32; 3]>,
    quads: BudgetVec<'a, [u32; 4]>,
    triangle_numbers: BudgetVec<'a, u32>,
    quad_numbers: BudgetVec<'a, u32>,
    has_numbers: bool,
}

impl<'a> Mesh<'a> {
    fn new(
        name: &'a Arc<str>,
        bytes: &'a [u8],
        encoding: Encoding,
        budget: &'a Budget,
        diagnostics: &'a mut Diagnostics,
    ) -> Self {
        Self {
            name,
            bytes,
            encoding,
            budget,
            diagnostics,
            positions: vec![],
            origin: DVec3::ZERO,
            edges: BudgetVec::new(budget, "edges"),
            normals: None,
            uvs: None,
            colours: None,
            unusable: vec![],
            flaws: BudgetVec::new(budget, "flaws"),
            corners: None,
            triangles: BudgetVec::new(budget, "triangles"),
            quads: BudgetVec::new(budget, "quads"),
            triangle_numbers: BudgetVec::new(budget, "face numbers"),
            quad_numbers: BudgetVec::new(budget, "face numbers"),
            has_numbers: false,
        }
    }

    fn place(&self, at: usize, element: &str, index: u64, property: &str) -> Place {
        self.encoding.place(self.name, self.bytes, at, element, index, property)
    }

    /// A fault in a property of element number `index`. Places in a text do not include the element.
    fn wrong(&self, fault: Fault, element: &Element, index: u64, property: &str) -> Diagnostic {
        let within = match self.encoding {
            Encoding::Text => format!("{} in {} {index}, property {property}", fault.message, element.name),
            _ => fault.message.to_owned(),
        };
        Diagnostic::error(within).at(self.place(fault.at, &element.name, index, property)).found(fault.found)
    }

    fn read<S: Source>(&mut self, header: &Header, mut source: S) -> Result<(), FormatError> {
        if !header.elements.iter().any(|e| e.name == "vertex") {
            let wrong = Diagnostic::error("PLY file without vertices").at(Place::whole(self.name.clone()));
            let names = header.elements.iter().map(|e| e.name.as_str());
            let near = nearest_name("vertex", names).map(|n| format!("element {}", quoted(n)));
            return Err(Diagnostic { found: near, ..wrong.expected("an element \"vertex\"") }.into());
        }
        let mut later = vec![];
        let mut has_vertices = false;
        for element in &header.elements {
            let least = element.least_bytes(self.encoding);
            if least == 0 {
                // Without properties it takes no bytes, at any count.
                continue;
            }
            // The last number of a text needs no space after it.
            let last = u64::from(self.encoding == Encoding::Text);
            let most = (source.left() as u64 + last) / least;
            if element.count > most {
                let elements = match (&*element.name, element.count) {
                    (name @ ("vertex" | "face" | "edge"), 1) => name.to_owned(),
                    ("vertex", _) => "vertices".to_owned(),
                    (name @ ("face" | "edge"), _) => format!("{name}s"),
                    (name, _) => format!("of {}", quoted(name)),
                };
                let counts = format!("{} {elements} announced, room for {most}", element.count);
                let wrong = Diagnostic::error("file is truncated").at(element.place.clone());
                return Err(wrong.because(counts).into());
            }
            self.budget
                .elements(element.count, "PLY elements")
                .map_err(|e| FormatError::from(e).or_at(|| element.place.clone()))?;
            match element.name.as_str() {
                "vertex" => {
                    self.vertices(element, &mut source)?;
                    has_vertices = true;
                }
                "face" | "tristrips" => {
                    if has_vertices {
                        self.faces(element, &mut source)?;
                    } else {
                        later.push((element, source));
                        self.skip(element, &mut source)?;
                    }
                }
                "edge" if has_vertices && Self::ends_of(element).is_some() => {
                    self.read_edges(element, &mut source)?;
                }
                _ => self.skip(element, &mut source)?,
            }
        }
        for (element, mut source) in later {
            self.faces(element, &mut source)?;
        }
        let rest = &self.bytes[source.at()..];
        if rest.iter().any(|b| !b.is_ascii_whitespace() && *b != 0) {
            let start = source.at();
            let place = match self.encoding {
                Encoding::Text => self.place(start, "", 0, ""),
                _ => Place::binary(self.name.clone(), start as u64, ""),
            };
            let said = Diagnostic::warning("bytes after the last element are left out").at(place);
            self.diagnostics.push(said.found(format!("{} bytes", rest.len())));
        }
        Ok(())
    }

    fn skip<S: Source>(&mut self, element: &Element, source: &mut S) -> Result<(), FormatError> {
        if !element.has_lists() && self.encoding != Encoding::Text {
            let bytes = element.least_bytes(self.encoding) * element.count;
            return source.skip(Number::U8, bytes).map_err(|f| self.wrong(*f, element, 0, "").into());
        }
        for index in 0..element.count {
            for property in &element.properties {
                let skipped = match property.list {
                    None => source.skip(property.number, 1),
                    Some(length) => source
                        .length(length, property.number)
                        .and_then(|length| source.skip(property.number, length as u64)),
                };
                skipped.map_err(|f| self.wrong(*f, element, index, &property.name))?;
            }
        }
        Ok(())
    }

    /// The properties of an edge that are its two vertices.
    fn ends_of(element: &Element) -> Option<[usize; 2]> {
        let find = |name: &str| {
            let is_end = |p: &Property| p.list.is_none() && !p.number.is_float() && p.name == name;
            element.properties.iter().position(is_end)
        };
        Some([find("vertex1")?, find("vertex2")?])
    }

    fn read_edges<S: Source>(&mut self, element: &Element, source: &mut S) -> Result<(), FormatError> {
        let Some(ends) = Self::ends_of(element) else { return self.skip(element, source) };
        // Edges have those of their vertices, if any.
        self.colours_of(element);
        for index in 0..element.count {
            let start = source.at();
            let mut found = [0i64; 2];
            for (i, property) in element.properties.iter().enumerate() {
                let fault = |f: Box<Fault>| FormatError::from(self.wrong(*f, element, index, &property.name));
                if let Some(length) = property.list {
                    let length = source.length(length, property.number).map_err(fault)?;
                    source.skip(property.number, length as u64).map_err(fault)?;
                    continue;
                }
                let value = source.number(property.number).map_err(fault)?;
                if let Some(end) = ends.iter().position(|&end| end == i) {
                    found[end] = value as i64;
                }
            }
            let count = self.positions.len() as i64;
            let is_there =
                |&v: &i64| (0..count).contains(&v) && self.unusable.binary_search(&(v as u32)).is_err();
            if found.iter().all(is_there) {
                self.edges.push(found.map(|v| v as u32))?;
            } else {
                self.drop_face("edge with a vertex that does not exist is left out", element, index, start);
            }
        }
        Ok(())
    }

    fn vertices<S: Source>(&mut self, element: &Element, source: &mut S) -> Result<(), FormatError> {
        let mut slots: Vec<Slot> = vec![];
        for property in &element.properties {
            let slot = if property.list.is_some() { Slot::Unused } else { Slot::of(&property.name) };
            // The first of each counts: some files have both u v and s t.
            slots.push(if slots.contains(&slot) { Slot::Unused } else { slot });
        }
        let has = |slot| slots.contains(&slot);
        for (c, name) in ["x", "y", "z"].into_iter().enumerate() {
            if !has(Slot::Position(c)) {
                let wrong = Diagnostic::error(format!("vertices without a property \"{name}\""));
                return Err(wrong.at(element.place.clone()).into());
            }
        }
        let has_normals = (0..3).all(|c| has(Slot::Normal(c)));
        let has_uvs = (0..2).all(|c| has(Slot::Uv(c)));
        let has_colours = (0..3).all(|c| has(Slot::Colour(c)));
        if u32::try_from(element.count).is_err() {
            let wrong = Diagnostic::error("more vertices than a mesh can have").at(element.place.clone());
            return Err(wrong.found(element.count).expected(format!("at most {}", u32::MAX)).into());
        }
        let count = element.count;
        // In double precision until their origin is known, unless the file has less.
        let is_position = |slot: &Slot| matches!(slot, Slot::Position(_));
        let mut types = element.properties.iter().zip(&slots).filter(|(_, slot)| is_position(slot));
        let is_single = self.encoding != Encoding::Text && types.all(|(p, _)| p.number != Number::F64);
        let place_count = if is_single { 0 } else { count };
        let _while_read = self.budget.hold(place_count * size_of::<DVec3>() as u64, "vertices")?;
        let mut places: Vec<DVec3> = Vec::with_capacity(place_count as usize);
        let mut positions = self.budget.vec(if is_single { count } else { 0 }, "vertices")?;
        let mut normals = self.budget.vec(if has_normals { count } else { 0 }, "normals")?;
        let mut uvs = self.budget.vec(if has_uvs { count } else { 0 }, "texture coordinates")?;
        let mut colours = self.budget.vec(if has_colours { count } else { 0 }, "colours")?;
        for index in 0..count {
            let (mut p, mut n, mut uv, mut colour) = ([0f64; 3], [0f32; 3], [0f32; 2], [0f32; 3]);
            let start = source.at();
            for (property, slot) in element.properties.iter().zip(&slots) {
                let fault = |f: Box<Fault>| FormatError::from(self.wrong(*f, element, index, &property.name));
                if let Some(length) = property.list {
                    let length = source.length(length, property.number).map_err(fault)?;
                    source.skip(property.number, length as u64).map_err(fault)?;
                    continue;
                }
                let value = source.number(property.number).map_err(fault)?;
                match *slot {
                    Slot::Position(c) => p[c] = value,
                    Slot::Normal(c) => n[c] = value as f32,
                    Slot::Uv(c) => uv[c] = value as f32,
                    Slot::Colour(c) => colour[c] = colour_of(value, property.number),
                    Slot::Unused => {}
                }
            }
            let mut position = DVec3::from(p);
            if !position.as_vec3().is_finite() {
                self.unusable_vertex(element, index, start, position.as_vec3())?;
                position = DVec3::NAN;
            }
            if is_single {
                positions.push(relative(position, DVec3::ZERO));
            } else {
                places.push(position);
            }
            if has_normals {
                let n = Vec3::from(n);
                normals.push(if n.is_finite() { n } else { Vec3::ZERO });
                if !n.is_finite() {
                    self.flaw(index, start, "a normal is not finite, and taken for 0")?;
                }
            }
            if has_uvs {
                let uv = Vec2::from(uv);
                uvs.push(if uv.is_finite() { uv } else { Vec2::ZERO });
                if !uv.is_finite() {
                    self.flaw(index, start, "a texture coordinate is not finite, and taken for 0")?;
                }
            }
            if has_colours {
                let colour = Rgb::from(colour);
                colours.push(if colour.is_finite() { colour } else { Rgb::BLACK });
                if !colour.is_finite() {
                    self.flaw(index, start, "a colour is not finite, and taken for 0")?;
                }
            }
        }
        if !is_single {
            self.origin = origin_of(&places);
            positions = self.budget.vec(count, "vertices")?;
            positions.extend(places.iter().map(|p| relative(*p, self.origin)));
        }
        self.positions = positions;
        self.normals = has_normals.then_some(normals);
        self.uvs = has_uvs.then_some(uvs);
        self.colours = has_colours.then_some(colours);
        Ok(())
    }

    #[cold]
    fn flaw(&mut self, vertex: u64, at: usize, what: &'static str) -> Result<(), FormatError> {
        Ok(self.flaws.push(Flaw { vertex: vertex as u32, at, what })?)
    }

    /// Says what is not finite: a warning where a face that has an area uses it, or where vertices are points; else a
    /// note.
    fn say_flaws(&mut self) -> Result<(), FormatError> {
        if self.flaws.is_empty() {
            return Ok(());
        }
        let _while_said = self.budget.hold(self.positions.len() as u64, "vertices")?;
        let mut is_seen = vec![self.triangles.is_empty() && self.quads.is_empty(); self.positions.len()];
        let place = |vertex: u32| self.positions[vertex as usize].as_dvec3();
        let quads = self.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        for triangle in self.triangles.iter().copied().chain(quads) {
            let [a, b, c] = triangle.map(place);
            if (b - a).cross(c - a) != DVec3::ZERO {
                triangle.iter().for_each(|&vertex| is_seen[vertex as usize] = true);
            }
        }
        for (&(vertex, _), &copy) in self.corners.iter().flat_map(|of| &of.copies) {
            is_seen[vertex as usize] |= is_seen[copy as usize];
        }
        let (encoding, name, bytes) = (self.encoding, self.name, self.bytes);
        for &Flaw { vertex, at, what } in self.flaws.iter() {
            let placed = |said: Diagnostic| {
                let start = encoding.start(bytes, at);
                said.at(encoding.place(name, bytes, start, "vertex", u64::from(vertex), ""))
            };
            if is_seen[vertex as usize] {
                self.diagnostics.warn(what, placed);
            } else {
                self.diagnostics.note(&format!("{what}: no face with an area has it"), placed);
            }
        }
        Ok(())
    }

    /// An error; when lenient no face will use it.
    #[cold]
    fn unusable_vertex(
        &mut self,
        element: &Element,
        index: u64,
        at: usize,
        p: Vec3,
    ) -> Result<(), FormatError> {
        let axis = (0..3).find(|&c| !p[c].is_finite()).unwrap_or(0);
        let found = format!("({}, {}, {})", p.x, p.y, p.z);
        let at = self.encoding.start(self.bytes, at);
        let place = self.place(at, &element.name, index, ["x", "y", "z"][axis]);
        let wrong = Diagnostic::error(format!("vertex {index} is not finite")).at(place).found(found);
        if !self.diagnostics.is_lenient() {
            return Err(wrong.into());
        }
        self.unusable.push(index as u32);
        Ok(())
    }

    #[inline]
    fn finite_or_zero<T: Copy + Default>(
        &mut self,
        value: T,
        is_finite: impl FnOnce(T) -> bool,
        what: &str,
        element: &Element,
        index: u64,
        at: usize,
    ) -> T {
        if is_finite(value) {
            return value;
        }
        let (encoding, name, bytes) = (self.encoding, self.name, self.bytes);
        self.diagnostics.warn(what, |said| {
            said.at(encoding.place(name, bytes, encoding.start(bytes, at), &element.name, index, ""))
        });
        T::default()
    }

    fn faces<S: Source>(&mut self, element: &Element, source: &mut S) -> Result<(), FormatError> {
        let is_strips = element.name == "tristrips";
        let is_corners =
            |p: &Property| p.list.is_some() && matches!(p.name.as_str(), "vertex_indices" | "vertex_index");
        let Some(corners_at) = element.properties.iter().position(is_corners) else {
            let names = element.properties.iter().map(|p| p.name.as_str());
            let near = nearest_name("vertex_indices", names).map(|n| format!("property {}", quoted(n)));
            let wrong = Diagnostic::error("faces without a list of vertices").at(element.place.clone());
            let wrong = wrong.expected("property list uchar int vertex_indices");
            return Err(Diagnostic { found: near, ..wrong }.into());
        };
        let numbers_at = element.properties.iter().position(|p| {
            p.list.is_none()
                && !p.number.is_float()
                && matches!(p.name.as_str(), "face_indices" | "face_index")
        });
        self.has_numbers = numbers_at.is_some() && !is_strips;
        self.unusable.sort_unstable();
        if !is_strips {
            self.triangles.reserve(element.count as usize)?;
            self.triangle_numbers.reserve(if self.has_numbers { element.count as usize } else { 0 })?;
        }
        let is_uvs = |p: &Property| p.list.is_some() && p.name == "texcoord";
        let uvs_at = element.properties.iter().position(is_uvs).filter(|_| !is_strips);
        let colour_at = self.colours_of(element);
        if (uvs_at.is_some() || colour_at.is_some()) && self.corners.is_none() {
            let vertices = self.positions.len();
            self.budget.bytes((vertices * size_of::<Option<Corner>>()) as u64, "corners")?;
            let of_vertices = vec![None; vertices];
            let (has_uvs, has_colours) = (false, false);
            let copies = HashMap::new();
            self.corners = Some(Corners { vertices, of_vertices, copies, has_uvs, has_colours });
        }
        if let Some(of) = &mut self.corners {
            of.has_uvs |= uvs_at.is_some();
            of.has_colours |= colour_at.is_some();
        }
        let mut corners: BudgetVec<'_, i64> = BudgetVec::new(self.budget, "corners of a face");
        let mut uvs: BudgetVec<'_, f32> = BudgetVec::new(self.budget, "texture coordinates of a face");
        let mut filled;
        let mut filled_uvs;
        for index in 0..element.count {
            let start = source.at();
            let mut number = 0u32;
            let mut colour = [0f32; 3];
            (filled, filled_uvs) = (0, 0);
            for (i, property) in element.properties.iter().enumerate() {
                let fault = |f: Box<Fault>| FormatError::from(self.wrong(*f, element, index, &property.name));
                match property.list {
                    Some(length) if i == corners_at => {
                        let length = source.length(length, property.number).map_err(fault)?;
                        while corners.len() < length {
                            corners.push(0)?;
                        }
                        for corner in &mut corners[..length] {
                            let value = source.number(property.number).map_err(fault)?;
                            // The cast saturates numbers that are out of range; they stay out of range.
                            *corner = if value.fract() == 0.0 { value as i64 } else { i64::MIN };
                        }
                        filled = length;
                    }
                    Some(length) if Some(i) == uvs_at => {
                        let length = source.length(length, property.number).map_err(fault)?;
                        while uvs.len() < length {
                            uvs.push(0.0)?;
                        }
                        for uv in &mut uvs[..length] {
                            *uv = source.number(property.number).map_err(fault)? as f32;
                        }
                        filled_uvs = length;
                    }
                    Some(length) => {
                        let length = source.length(length, property.number).map_err(fault)?;
                        source.skip(property.number, length as u64).map_err(fault)?;
                    }
                    None => {
                        let value = source.number(property.number).map_err(fault)?;
                        if Some(i) == numbers_at {
                            // Signed numbers keep their bits.
                            number = value as i64 as u32;
                        }
                        if let Some(c) = colour_at.and_then(|at| at.iter().position(|&at| at == i)) {
                            colour[c] = colour_of(value, property.number);
                        }
                    }
                }
            }
            let colour = colour_at.map(|_| {
                let said = "a colour is not finite, and taken for 0";
                self.finite_or_zero(Rgb::from(colour), Rgb::is_finite, said, element, index, start)
            });
            if is_strips {
                self.strip(&corners[..filled], element, index, start)?;
            } else {
                let count = self.vertices_of_file() as i64;
                if let Some(&corner) = corners[..filled].iter().find(|&&c| c < 0 || count <= c) {
                    self.unusable_face(corner, element, index, start)?;
                    continue;
                }
                if uvs_at.is_some() || colour.is_some() {
                    let uvs = &uvs[..filled_uvs];
                    self.set_corners(&mut corners[..filled], uvs, colour, element, index, start)?;
                }
                self.face(&corners[..filled], number, element, index, start)?;
            }
        }
        Ok(())
    }

    /// The properties that are the colour of a face, or a warning where they are not used: vertices come first, and
    /// edges have no colours of their own.
    fn colours_of(&mut self, element: &Element) -> Option<[usize; 3]> {
        let find = |c: usize| {
            let is_channel = |p: &Property| p.list.is_none() && Slot::of(&p.name) == Slot::Colour(c);
            element.properties.iter().position(is_channel)
        };
        let at = [find(0)?, find(1)?, find(2)?];
        if self.colours.is_none() && element.name == "face" {
            return Some(at);
        }
        let what = format!("colours of {} elements are not used", quoted(&element.name));
        let said = Diagnostic::warning(what).at(element.place.clone());
        self.diagnostics.push(match self.colours.is_some() {
            true => said.found("colours of vertices as well"),
            false => said,
        });
        None
    }

    /// Gives the corners of a face, which are vertices of the file, their texture coordinates and the colour of the
    /// face: vertices that have others already become copies.
    fn set_corners(
        &mut self,
        corners: &mut [i64],
        uvs: &[f32],
        colour: Option<Rgb>,
        element: &Element,
        index: u64,
        at: usize,
    ) -> Result<(), FormatError> {
        let Some(of) = &self.corners else { return Ok(()) };
        let is_usable = |&c: &i64| {
            (0..of.vertices as i64).contains(&c) && self.unusable.binary_search(&(c as u32)).is_err()
        };
        if !corners.iter().all(is_usable) {
            return Ok(());
        }
        let has_uvs = uvs.len() == 2 * corners.len() && uvs.iter().all(|uv| uv.is_finite());
        if !uvs.is_empty() && !has_uvs {
            let what = "texture coordinates of a face are left out: expected two numbers per vertex";
            self.drop_face(what, element, index, at);
        }
        if !has_uvs && colour.is_none() {
            return Ok(());
        }
        let Some(of) = &mut self.corners else { return Ok(()) };
        for (i, corner) in corners.iter_mut().enumerate() {
            let vertex = *corner as usize;
            let uv = match &self.uvs {
                _ if has_uvs => Vec2::new(uvs[2 * i], uvs[2 * i + 1]),
                Some(own) => own[vertex],
                None => Vec2::ZERO,
            };
            let said = Corner { uv, colour: colour.unwrap_or(Rgb::WHITE) };
            match of.of_vertices[vertex] {
                None => of.of_vertices[vertex] = Some(said),
                Some(first) if first == said => {}
                Some(_) => {
                    let next = self.positions.len() as u32;
                    let copy = *of.copies.entry((vertex as u32, said.bits())).or_insert(next);
                    if copy == next {
                        // Lists and the table grow by halves at most.
                        const COPY: u64 = 2 * 128;
                        self.budget.bytes(COPY, "corners")?;
                        self.positions.push(self.positions[vertex]);
                        of.of_vertices.push(Some(said));
                        for list in self.normals.iter_mut() {
                            list.push(list[vertex]);
                        }
                        for list in self.uvs.iter_mut() {
                            list.push(list[vertex]);
                        }
                        for list in self.colours.iter_mut() {
                            list.push(list[vertex]);
                        }
                    }
                    *corner = i64::from(copy);
                }
            }
        }
        Ok(())
    }

    /// Without copies that [`Mesh::set_corners`] made.
    fn vertices_of_file(&self) -> usize {
        self.corners.as_ref().map_or(self.positions.len(), |of| of.vertices)
    }

    /// A face whose corners are there.
    #[inline]
    fn face(
        &mut self,
        corners: &[i64],
        number: u32,
        element: &Element,
        index: u64,
        at: usize,
    ) -> Result<(), FormatError> {
        if !self.unusable.is_empty()
            && corners.iter().any(|&c| self.unusable.binary_search(&(c as u32)).is_ok())
        {
            self.drop_face("face with a vertex that is not finite is left out", element, index, at);
            return Ok(());
        }
        match *corners {
            [a, b, c] => self.triangle([a as u32, b as u32, c as u32], number)?,
            [] | [_] | [_, _] => {
                self.drop_face("face with fewer than three vertices is left out", element, index, at);
            }
            [a, b, c, d] if polygon::is_convex(&[a, b, c, d].map(|i| self.positions[i as usize])) => {
                self.quads.push([a, b, c, d].map(|i| i as u32))?;
                if self.has_numbers {
                    self.quad_numbers.push(number)?;
                }
            }
            _ => {
                // The positions of its corners, and the triangulation.
                let _while_cut = self.budget.hold(corners.len() as u64 * 160, "corners of a face")?;
                let places: Vec<Vec3> = corners.iter().map(|&c| self.positions[c as usize]).collect();
                let Some(triangles) = polygon::triangulate(&places) else {
                    let at = self.encoding.start(self.bytes, at);
                    let place = self.place(at, &element.name, index, "vertex_indices");
                    let wrong = Diagnostic::error("face too large and winding to be cut into triangles")
                        .at(place)
                        .found(format!("{} corners", corners.len()));
                    return Err(wrong.into());
                };
                for t in triangles {
                    self.triangle(t.map(|i| corners[i] as u32), number)?;
                }
            }
        }
        Ok(())
    }

    #[inline]
    fn triangle(&mut self, corners: [u32; 3], number: u32) -> Result<(), FormatError> {
        self.triangles.push(corners)?;
        if self.has_numbers {
            self.triangle_numbers.push(number)?;
        }
        Ok(())
    }

    fn strip(
        &mut self,
        corners: &[i64],
        element: &Element,
        index: u64,
        at: usize,
    ) -> Result<(), FormatError> {
        let count = self.vertices_of_file() as i64;
        for strip in corners.split(|&c| c == -1) {
            for (i, corners) in strip.windows(3).enumerate() {
                let [a, b, c] = [corners[0], corners[1], corners[2]];
                if let Some(&corner) = corners.iter().find(|&&c| c < 0 || count <= c) {
                    self.unusable_face(corner, element, index, at)?;
                    continue;
                }
                // Every other triangle of a strip is reversed; degenerate ones have no area.
                if a != b && b != c && a != c {
                    let corners = if i % 2 == 0 { [a, b, c] } else { [b, a, c] };
                    self.face(&corners, 0, element, index, at)?;
                }
            }
        }
        Ok(())
    }

    #[cold]
    fn unusable_face(
        &mut self,
        corner: i64,
        element: &Element,
        index: u64,
        at: usize,
    ) -> Result<(), FormatError> {
        if self.diagnostics.is_lenient() {
            self.drop_face("face with a vertex that does not exist is left out", element, index, at);
            return Ok(());
        }
        let place = self.place(self.encoding.start(self.bytes, at), &element.name, index, "vertex_indices");
        let count = self.vertices_of_file();
        let expected = if count == 0 {
            "no face, as there are no vertices".to_owned()
        } else {
            format!("0 to {}", count - 1)
        };
        let wrong = Diagnostic::error(format!("face {index} has a vertex that does not exist")).at(place);
        let found =
            if corner == i64::MIN { "a number that is not whole".to_owned() } else { corner.to_string() };
        Err(wrong.found(found).expected(expected).into())
    }

    #[cold]
    fn drop_face(&mut self, what: &str, element: &Element, index: u64, at: usize) {
        let (encoding, name, bytes) = (self.encoding, self.name, self.bytes);
        self.diagnostics.warn(what, |said| {
            let start = encoding.start(bytes, at);
            let place = encoding.place(name, bytes, start, &element.name, index, "vertex_indices");
            said.at(place).found(format!("{} {index}", element.name))
        });
    }

    fn finish(mut self, texture: Option<String>) -> Result<PlyFile, FormatError> {
        self.say_flaws()?;
        let has_corner_uvs = self.corners.as_ref().is_some_and(|of| of.has_uvs);
        if let Some(of) = self.corners.take() {
            if of.has_colours {
                let of_vertex = |corner: &Option<Corner>| corner.map_or(Rgb::WHITE, |corner| corner.colour);
                self.colours = Some(of.of_vertices.iter().map(of_vertex).collect());
            }
            if of.has_uvs {
                let own = self.uvs.take();
                let of_vertex = |(i, corner): (usize, Option<Corner>)| {
                    let uv = corner.map(|corner| corner.uv);
                    uv.or_else(|| own.as_ref().map(|own| own[i])).unwrap_or(Vec2::ZERO)
                };
                self.uvs = Some(of.of_vertices.into_iter().enumerate().map(of_vertex).collect());
            }
        }
        if self.positions.is_empty() {
            let said = Diagnostic::warning("PLY mesh without vertices").at(Place::whole(self.name.clone()));
            self.diagnostics.push(said);
        }
        let face_indices = if self.has_numbers && self.triangle_numbers.len() == self.triangles.len() {
            let mut numbers = self.triangle_numbers;
            numbers.reserve(self.quad_numbers.len())?;
            for &number in self.quad_numbers.iter() {
                numbers.push(number)?;
            }
            Some(numbers.into_vec())
        } else {
            None
        };
        let mesh = MeshDesc {
            positions: self.positions,
            precise_positions: None,
            triangles: self.triangles.into_vec(),
            quads: self.quads.into_vec(),
            normals: self.normals,
            uvs: self.uvs,
            tangents: None,
            further_uvs: Default::default(),
            colours: self.colours,
            coverages: None,
            face_indices,
            motion: None,
        };
        if is_without_area(&mesh) {
            let said = Diagnostic::warning("all faces are without area: nothing of them is seen");
            self.diagnostics.push(said.at(Place::whole(self.name.clone())));
        }
        let points = if mesh.triangles.is_empty() && mesh.quads.is_empty() && self.edges.is_empty() {
            let count = mesh.positions.len() as u32;
            let mut points = self.budget.vec(u64::from(count), "points")?;
            points.extend((0..count).filter(|i| self.unusable.binary_search(i).is_err()));
            points
        } else {
            vec![]
        };
        Ok(PlyFile {
            mesh,
            origin: self.origin,
            points,
            edges: self.edges.into_vec(),
            texture,
            has_corner_uvs,
        })
    }
}
