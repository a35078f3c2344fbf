//! Triangles: meshes and polygons; and blobs.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Vec2, Vec3};
use lumbre_scene::MeshDesc;
use lumbre_shading::pov::Texture;

use super::blob::{Ball, Blob};
use super::mesh_tree::Enclosure;
use super::objects::{Form, Object, Operation};
use super::value::Value;
use super::{Parser, Result};

/// Triangles of one texture.
#[derive(Default)]
struct Triangles {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    /// Their corners, in an order that has the front where most of the normals point.
    corners: Vec<[u32; 3]>,
    has_normals: bool,
    has_uvs: bool,
}

/// Faces by the numbers of their corners, and the texture of each.
type FaceList = (Vec<[u32; 3]>, Vec<Option<usize>>);

impl Triangles {
    fn mesh(self) -> MeshDesc {
        MeshDesc {
            triangles: self.corners,
            normals: self.has_normals.then_some(self.normals),
            uvs: self.has_uvs.then_some(self.uvs),
            positions: self.positions,
            ..MeshDesc::default()
        }
    }
}

impl Parser<'_, '_> {
    /// Three corners with a normal each.
    fn smooth_corners(&mut self) -> Result<([DVec3; 3], [DVec3; 3])> {
        let (mut corners, mut normals) = ([DVec3::ZERO; 3], [DVec3::ZERO; 3]);
        for i in 0..3 {
            corners[i] = self.vector()?;
            self.comma()?;
            normals[i] = self.vector()?;
            self.comma()?;
        }
        Ok((corners, normals))
    }

    pub(super) fn smooth_triangle(&mut self) -> Result<Form> {
        let (corners, normals) = self.smooth_corners()?;
        let mut all = Triangles { has_normals: true, ..Triangles::default() };
        push(&mut all, corners, Some(normals), None);
        Ok(Form::Mesh(Arc::new(all.mesh()), None))
    }

    /// A mesh, up to what modifies it: its triangles by their textures.
    pub(super) fn mesh(&mut self) -> Result<Object> {
        let mut by_texture: HashMap<usize, (Option<Arc<Texture>>, Triangles)> = HashMap::new();
        let mut inside = None;
        loop {
            let word = self.word()?;
            let Some(word @ ("triangle" | "smooth_triangle" | "inside_vector")) = word.as_deref() else {
                break;
            };
            self.peeked = None;
            if word == "inside_vector" {
                inside = self.vector()?.try_normalize();
                continue;
            }
            let is_smooth = word == "smooth_triangle";
            self.expect(b'{')?;
            self.budget.elements(1, "triangles")?;
            self.budget.bytes(108, "triangles")?;
            let (corners, normals) = if is_smooth {
                let (corners, normals) = self.smooth_corners()?;
                (corners, Some(normals))
            } else {
                let mut corners = [DVec3::ZERO; 3];
                for corner in &mut corners {
                    *corner = self.vector()?;
                    self.comma()?;
                }
                (corners, None)
            };
            let mut uvs = None;
            if self.take_word("uv_vectors")? {
                let mut found = [DVec2::ZERO; 3];
                for uv in &mut found {
                    *uv = self.vector()?.truncate();
                    self.comma()?;
                }
                uvs = Some(found);
            }
            let mut texture = None;
            while self.take_word("texture")? {
                self.expect(b'{')?;
                // The same name is the same texture.
                texture = Some(self.shared_texture()?);
            }
            self.expect(b'}')?;
            let key = texture.as_ref().map_or(0, |texture| Arc::as_ptr(texture) as usize);
            let entry = by_texture.entry(key).or_insert_with(|| (texture, Triangles::default()));
            push(&mut entry.1, corners, normals, uvs);
        }
        let enclosure = enclosure(inside, by_texture.values().map(|(_, triangles)| triangles));
        let mut parts: Vec<(usize, Object)> = Vec::new();
        for (_, (texture, triangles)) in by_texture {
            let first = triangles.positions.first().map_or(0, |p| p.x.to_bits() as usize);
            let mut part = Object::new(Form::Mesh(Arc::new(triangles.mesh()), enclosure.clone()));
            part.texture = texture;
            parts.push((first, part));
        }
        // In an order that does not depend on addresses.
        parts.sort_by_key(|(first, _)| *first);
        Ok(joined(parts.into_iter().map(|(_, part)| part).collect()))
    }

    /// A texture up to its brace; one that is only a name is that of the name.
    fn shared_texture(&mut self) -> Result<Arc<Texture>> {
        if let Some(name) = self.word()?
            && self.is_raw_brace()
            && let Some(Value::Texture(known)) = self.lookup(&name).map(|cell| cell.borrow().clone())
        {
            self.peeked = None;
            self.expect(b'}')?;
            return Ok(known);
        }
        self.texture_body(b'}')
    }

    /// Whether a closing brace comes after the token that is looked at.
    fn is_raw_brace(&self) -> bool {
        self.raw_ahead(0) == Some(&super::lexer::Kind::Mark(b'}'))
    }

    /// `mesh2`, up to what modifies it.
    pub(super) fn mesh2(&mut self) -> Result<Object> {
        let (mut vertices, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
        let (mut faces, mut normal_faces, mut uv_faces) = (Vec::new(), Vec::new(), Vec::new());
        let mut textures: Vec<Arc<Texture>> = Vec::new();
        let mut inside = None;
        let mut faces_of: Vec<Option<usize>> = Vec::new();
        loop {
            let word = self.word()?;
            let Some(
                word @ ("vertex_vectors" | "normal_vectors" | "uv_vectors" | "face_indices"
                | "normal_indices" | "uv_indices" | "texture_list" | "inside_vector"),
            ) = word.as_deref()
            else {
                break;
            };
            self.peeked = None;
            match word {
                "inside_vector" => inside = self.vector()?.try_normalize(),
                "vertex_vectors" => vertices = self.vectors()?,
                "normal_vectors" => normals = self.vectors()?,
                "uv_vectors" => uvs = self.vectors()?,
                "face_indices" => (faces, faces_of) = self.face_list()?,
                "normal_indices" => normal_faces = self.face_list()?.0,
                "uv_indices" => uv_faces = self.face_list()?.0,
                _ => textures = self.textures()?,
            }
        }
        let (has_normals, has_uvs) = (!normals.is_empty(), !uvs.is_empty());
        // By texture; those without one of their own are the first.
        let mut all: Vec<Triangles> = Vec::new();
        all.resize_with(textures.len() + 1, || Triangles { has_normals, has_uvs, ..Triangles::default() });
        for (i, face) in faces.iter().enumerate() {
            let corner = |list: &[DVec3], face: &[u32; 3]| -> Option<[DVec3; 3]> {
                let at = |k: usize| list.get(face[k] as usize).copied();
                Some([at(0)?, at(1)?, at(2)?])
            };
            let Some(corners) = corner(&vertices, face) else {
                return Err(self.error("a face of a vertex that the mesh2 does not have"));
            };
            let smooth = corner(&normals, normal_faces.get(i).unwrap_or(face));
            let uv = corner(&uvs, uv_faces.get(i).unwrap_or(face));
            let texture = faces_of.get(i).copied().flatten().map_or(0, |texture| texture + 1);
            let Some(triangles) = all.get_mut(texture) else {
                return Err(self.error("a face of a texture that the mesh2 does not have"));
            };
            push(triangles, corners, smooth, uv.map(|uv| uv.map(|uv| uv.truncate())));
        }
        let enclosure = enclosure(inside, &all);
        let textures = std::iter::once(None).chain(textures.into_iter().map(Some));
        let mut parts: Vec<Object> = Vec::new();
        for (texture, triangles) in textures.zip(all) {
            if !triangles.positions.is_empty() {
                let mut part = Object::new(Form::Mesh(Arc::new(triangles.mesh()), enclosure.clone()));
                part.texture = texture;
                parts.push(part);
            }
        }
        Ok(joined(parts))
    }

    /// The textures of a `mesh2`.
    fn textures(&mut self) -> Result<Vec<Arc<Texture>>> {
        self.expect(b'{')?;
        self.whole(0.0, 1e7)?;
        let mut textures = Vec::new();
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            self.budget.bytes(size_of::<Texture>() as u64, "textures of a mesh2")?;
            if self.take_word("texture")? {
                self.expect(b'{')?;
                textures.push(self.shared_texture()?);
                continue;
            }
            let Some(name) = self.word()? else { return Err(self.unexpected("a texture")) };
            self.peeked = None;
            match self.known(&name)? {
                Some(Value::Texture(known)) => textures.push(known),
                _ => return Err(self.unexpected("a texture")),
            }
        }
        Ok(textures)
    }

    fn vectors(&mut self) -> Result<Vec<DVec3>> {
        self.expect(b'{')?;
        let count = self.float()?;
        let mut list = Vec::new();
        self.comma()?;
        while !self.take(b'}')? {
            self.budget.bytes(24, "vectors of a mesh2")?;
            list.push(self.vector()?);
            self.comma()?;
        }
        if list.len() as f64 != count {
            return Err(self.error("a list of a mesh2 has another length than it says"));
        }
        Ok(list)
    }

    /// Faces by the numbers of their corners, with the texture of the first corner where textures follow.
    fn face_list(&mut self) -> Result<FaceList> {
        self.expect(b'{')?;
        self.float()?;
        self.comma()?;
        let (mut list, mut textures): (Vec<[u32; 3]>, Vec<Option<usize>>) = (Vec::new(), Vec::new());
        let mut others_differ = false;
        while !self.take(b'}')? {
            let num = self.expression()?;
            if num.n > 1 {
                self.budget.elements(1, "triangles")?;
                self.budget.bytes(124, "triangles")?;
                list.push(num.dvec3().to_array().map(|x| x.max(0.0) as u32));
                textures.push(None);
            } else if let Some(texture) = textures.last_mut() {
                let found = num.v[0].max(0.0) as usize;
                others_differ |= texture.is_some_and(|first| first != found);
                texture.get_or_insert(found);
            }
            self.comma()?;
        }
        if others_differ {
            self.warn("a face of a mesh2 has the texture of its first corner");
        }
        Ok((list, textures))
    }

    /// A plane polygon of closed loops, as triangles.
    pub(super) fn polygon(&mut self) -> Result<Form> {
        let count = self.whole(3.0, 1e7)?;
        self.comma()?;
        let mut points = Vec::new();
        for _ in 0..count {
            self.budget.bytes(24, "points of a polygon")?;
            points.push(self.vector()?);
            self.comma()?;
        }
        let Some((origin, s, t)) = plane_of(&points) else {
            return Err(self.error("a polygon without area"));
        };
        let flat: Vec<DVec2> =
            points.iter().map(|&p| DVec2::new((p - origin).dot(s), (p - origin).dot(t))).collect();
        let triangles = super::solids::triangulated(&flat);
        let mut all = Triangles::default();
        for triangle in triangles {
            push(&mut all, triangle.map(|p| origin + s * p.x + t * p.y), None, None);
        }
        Ok(Form::Mesh(Arc::new(all.mesh()), None))
    }

    /// A blob, up to what modifies it.
    pub(super) fn blob(&mut self) -> Result<Object> {
        let (mut threshold, mut parts) = (1.0, Vec::new());
        let mut textured = false;
        loop {
            let word = self.word()?;
            let Some(word @ ("threshold" | "sphere" | "cylinder" | "component")) = word.as_deref() else {
                break;
            };
            self.peeked = None;
            match word {
                "threshold" => threshold = self.finite()?,
                "component" => {
                    let strength = self.finite()?;
                    self.comma()?;
                    let radius = self.finite()?;
                    self.comma()?;
                    let center = self.vector()?;
                    parts.push(Ball::new([center, center], radius, strength));
                }
                _ => {
                    self.expect(b'{')?;
                    let from = self.vector()?;
                    self.comma()?;
                    let to = if word == "cylinder" { self.vector()? } else { from };
                    self.comma()?;
                    let radius = self.finite()?;
                    self.comma()?;
                    self.take_word("strength")?;
                    let strength = self.finite()?;
                    let mut ball = Object::new(Form::Nothing);
                    self.modifiers(&mut ball)?;
                    textured |= ball.texture.is_some();
                    let mut part = Ball::new([from, to], radius, strength);
                    part.world_from_ball = ball.transform;
                    parts.push(part);
                }
            }
            self.budget.bytes(size_of::<Ball>() as u64, "parts of a blob")?;
        }
        if textured {
            self.warn("the textures of the parts of a blob are not rendered");
        }
        if parts.is_empty() {
            return Err(self.error("a blob without parts"));
        }
        Ok(Object::new(Form::Blob(Arc::new(Blob::new(threshold, parts)))))
    }
}

fn push(all: &mut Triangles, corners: [DVec3; 3], normals: Option<[DVec3; 3]>, uvs: Option<[DVec2; 3]>) {
    let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    all.has_normals |= normals.is_some();
    let normals = normals.unwrap_or([flat; 3]);
    // The front is where most of the normals point.
    let is_turned = normals.iter().sum::<DVec3>().dot(flat) < 0.0;
    let first = all.positions.len() as u32;
    all.corners.push(if is_turned { [first, first + 2, first + 1] } else { [first, first + 1, first + 2] });
    for i in 0..3 {
        all.positions.push(corners[i].as_vec3());
        all.normals.push(normals[i].normalize_or(DVec3::Y).as_vec3());
        let uv = uvs.map_or(DVec2::ZERO, |uvs| uvs[i]);
        all.uvs.push(Vec2::new(uv.x as f32, uv.y as f32));
    }
    all.has_uvs |= uvs.is_some();
}

/// What triangles enclose, by a direction to look for them.
fn enclosure<'t>(
    inside: Option<DVec3>,
    all: impl IntoIterator<Item = &'t Triangles>,
) -> Option<Arc<Enclosure>> {
    let positions = all.into_iter().flat_map(|triangles| triangles.positions.iter().copied());
    inside.map(|direction| Arc::new(Enclosure::new(positions.collect(), direction)))
}

/// The parts of a mesh as one object.
fn joined(mut parts: Vec<Object>) -> Object {
    match parts.len() {
        0 => Object::new(Form::Nothing),
        1 => parts.swap_remove(0),
        _ => Object::new(Form::Group(Operation::Union, parts.into_iter().map(Rc::new).collect())),
    }
}

/// A point of the plane of a polygon, with two unit vectors in it.
fn plane_of(points: &[DVec3]) -> Option<(DVec3, DVec3, DVec3)> {
    let origin = *points.first()?;
    let first = points
        .iter()
        .map(|&p| p - origin)
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let s = first.try_normalize()?;
    let across = points
        .iter()
        .map(|&p| {
            let d = p - origin;
            d - s * d.dot(s)
        })
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    if across.length_squared() < 1e-20 * first.length_squared() {
        return None;
    }
    Some((origin, s, across.try_normalize()?))
}
