//! The names of a file's shapes, and their materials.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use lumbre::description::{GeometryDesc, MeshDesc, ShapeDesc};
use lumbre::{DVec2, DVec3, SceneDesc, Transform};

/// The shapes of a file by their index, and the materials.
#[derive(Debug, Default)]
pub struct SceneNames {
    shapes: HashMap<u32, Thing>,
    materials: Vec<MaterialInfo>,
}

/// A shape of a file.
#[derive(Clone, Debug)]
struct Thing {
    kind: &'static str,
    material: Option<usize>,
    mesh: Option<(Arc<MeshDesc>, Transform)>,
}

/// A face of a mesh as in its file: a triangle, or a quad or patch.
#[derive(Clone, Debug)]
pub(super) struct Face {
    /// The corners in the mesh's own space, three or four.
    pub(super) corners: Vec<DVec3>,
    /// The texture coordinates of the corners, if the file has them.
    pub(super) uvs: Option<Vec<DVec2>>,
    /// The map from there to the space of its instance, or of the world.
    pub(super) map: Transform,
}

/// A parameter's name and its numbers; `None` for a texture.
type Parameter = (String, Option<Vec<f64>>);

/// A material of a file.
#[derive(Clone, Debug)]
pub(super) struct MaterialInfo {
    /// Its name, if it has one, and its kind.
    pub(super) name: Option<String>,
    pub(super) kind: &'static str,
    /// Its parameters.
    pub(super) parameters: Vec<Parameter>,
}

impl SceneNames {
    /// From a description.
    pub fn of(desc: &SceneDesc) -> Self {
        let mut by_owner: HashMap<String, Vec<Parameter>> = HashMap::new();
        for parameter in lumbre::parameters(desc) {
            let owner = parameter.path.strip_suffix(&parameter.name).unwrap_or_default().to_owned();
            by_owner.entry(owner).or_default().push((parameter.name, parameter.value));
        }
        let materials = desc.materials.iter().enumerate().map(|(index, named)| {
            let called = named.name.clone().unwrap_or_else(|| index.to_string());
            let parameters = by_owner.remove(&format!("material.{called}.")).unwrap_or_default();
            MaterialInfo { name: named.name.clone(), kind: named.material.kind.name(), parameters }
        });
        let materials = materials.collect();
        let in_objects = desc.objects.iter().flat_map(|object| &object.shapes);
        let mut open: Vec<&ShapeDesc> = desc.shapes.iter().chain(in_objects).collect();
        let mut shapes = HashMap::new();
        while let Some(shape) = open.pop() {
            if let GeometryDesc::Csg(csg) = &shape.geometry {
                // A hit is on a shape of an operand, which comes later: the first of them may have the same number.
                open.extend(csg.operands.iter().flat_map(|operand| &**operand));
            }
            let material = shape.material.map(|id| id.0 as usize);
            let mesh = match &shape.geometry {
                // The vertices of a deforming mesh are those of one moment.
                GeometryDesc::Mesh(mesh) | GeometryDesc::BilinearMesh(mesh) if mesh.motion.is_none() => {
                    Some((mesh.clone(), shape.world_from_object))
                }
                _ => None,
            };
            shapes.insert(shape.index, Thing { kind: shape.geometry.name(), material, mesh });
        }
        Self { shapes, materials }
    }

    /// The kind of the shape with this index, in the words of the scene language; the ground is in no file.
    pub(super) fn kind(&self, shape: u32) -> &'static str {
        self.shapes.get(&shape).map_or("ground", |thing| thing.kind)
    }

    /// Whether a name selects a shape: its index, its kind, in the words of the scene language or in those of
    /// `kind_of`, or the name of its material.
    pub(super) fn is_called(
        &self,
        shape: u32,
        name: &str,
        kind_of: fn(&'static str) -> &'static str,
    ) -> bool {
        let kind = self.kind(shape);
        let material = self.material(shape).and_then(|material| material.name.as_deref());
        name.parse() == Ok(shape) || kind == name || kind_of(kind) == name || material == Some(name)
    }

    /// The names that select shapes of the file, without their indices.
    pub(super) fn names(&self, kind_of: fn(&'static str) -> &'static str) -> BTreeSet<&str> {
        let kinds = self.shapes.values().map(|thing| kind_of(thing.kind));
        let materials = self.shapes.keys().filter_map(|shape| self.material(*shape)?.name.as_deref());
        kinds.chain(materials).collect()
    }

    /// The face of a mesh's file with these corners under its map. Flat quads are split into triangles, so the corners
    /// decide among the faces that the index of the primitive may mean.
    pub(super) fn face(&self, shape: u32, primitive: u32, told: &[DVec3]) -> Option<Face> {
        let (mesh, map) = self.shapes.get(&shape)?.mesh.as_ref()?;
        let (primitive, triangles) = (primitive as usize, mesh.triangles.len());
        let of_pair = primitive.checked_sub(triangles).map(|rest| rest / 2);
        let quads = [of_pair, primitive.checked_sub(triangles), Some(primitive), Some(primitive / 2)];
        let quads = quads.into_iter().flatten().filter_map(|i| mesh.quads.get(i)).map(|quad| quad.to_vec());
        let faces = mesh.triangles.get(primitive).map(|triangle| triangle.to_vec()).into_iter().chain(quads);
        let position = |vertex: u32| match &mesh.precise_positions {
            Some(precise) => precise.get(vertex as usize).copied(),
            None => mesh.positions.get(vertex as usize).map(|p| p.as_dvec3()),
        };
        for vertices in faces {
            let corners: Vec<DVec3> = vertices.iter().filter_map(|vertex| position(*vertex)).collect();
            let size = told.iter().fold(0.0_f64, |most, p| most.max(p.abs().max_element()));
            let is_there = |p: &DVec3| corners.iter().any(|q| (map.point(*q) - *p).length() <= 1e-5 * size);
            if corners.len() == vertices.len() && told.iter().all(is_there) {
                let uv = |vertex: &u32| mesh.uvs.as_ref()?.get(*vertex as usize).map(|uv| uv.as_dvec2());
                return Some(Face { corners, uvs: vertices.iter().map(uv).collect(), map: *map });
            }
        }
        None
    }

    /// The material of a shape.
    pub(super) fn material(&self, shape: u32) -> Option<&MaterialInfo> {
        self.materials.get(self.shapes.get(&shape)?.material?)
    }
}
