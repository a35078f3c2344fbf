//! Statistics of a scene.

use std::collections::{BTreeMap, HashSet};
use std::mem::size_of_val;

use lumbre_geometry::Aabb;
use lumbre_scene::{
    AreaLightDesc, GeometryDesc, LightDesc, Listing, MaterialId, MeshDesc, ObjectDesc, ObjectId, SceneDesc,
    ShapeDesc,
};

/// Statistics of a scene. They count what the file describes: a shape inside an object counts once, however
/// often the object is instanced.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct SceneInfo {
    /// Shapes by type.
    pub shapes: BTreeMap<String, u64>,
    /// Materials by type.
    pub materials: BTreeMap<String, u64>,
    /// Lights by type; emissive shapes are `area`.
    pub lights: BTreeMap<String, u64>,
    /// Triangles of all meshes, a quad counting as two.
    pub triangles: u64,
    /// Instances, at any level.
    pub instances: u64,
    /// Cameras, by name if they have one, else by type.
    pub cameras: Vec<String>,
    /// Animations, material variants, and images of textures.
    pub listing: Listing,
    /// The bounding box of everything finite, instances included.
    pub bounds: Option<Aabb>,
    /// Bytes of memory of the description and the trees.
    pub memory_bytes: u64,
}

impl SceneInfo {
    /// Counts the contents of a description; bounds and trees are known only after building: see
    /// [`crate::Scene::info`].
    pub fn of(desc: &SceneDesc) -> Self {
        let mut info = Self::default();
        let objects = || desc.objects.iter().flat_map(|object| &object.shapes);
        for shape in desc.shapes.iter().chain(objects()) {
            info.add_shape(shape);
        }
        info.instances =
            desc.instances.len() as u64 + desc.objects.iter().map(|o| o.instances.len() as u64).sum::<u64>();
        let used: HashSet<MaterialId> =
            desc.shapes.iter().chain(objects()).filter_map(|s| s.material).collect();
        for (i, material) in desc.materials.iter().enumerate() {
            // Readers always add their default material, used or not.
            if material.name.is_none() && !used.contains(&MaterialId(i as u32)) {
                continue;
            }
            *info.materials.entry(material.material.kind.name().to_owned()).or_default() += 1;
        }
        for light in &desc.lights {
            *info.lights.entry(light_name(light).to_owned()).or_default() += 1;
        }
        info.listing = desc.listing.clone();
        info.cameras = desc
            .cameras
            .iter()
            .map(|camera| camera.name.clone().unwrap_or_else(|| camera.kind.name().to_owned()))
            .collect();
        info
    }

    fn add_shape(&mut self, shape: &ShapeDesc) {
        let mut count = 1;
        match &shape.geometry {
            GeometryDesc::Mesh(mesh) => {
                self.triangles += mesh.triangles.len() as u64 + 2 * mesh.quads.len() as u64;
                self.memory_bytes += mesh_bytes(mesh);
            }
            GeometryDesc::BilinearMesh(mesh) => self.memory_bytes += mesh_bytes(mesh),
            GeometryDesc::Curves(curves) => {
                self.memory_bytes += curves.bytes() as u64;
                count = curves.len() as u64;
            }
            GeometryDesc::Exact(_)
            | GeometryDesc::Coloured(_)
            | GeometryDesc::Csg(_)
            | GeometryDesc::Custom(_) => {}
        }
        *self.shapes.entry(shape.geometry.name().to_owned()).or_default() += count;
        if let Some(AreaLightDesc { .. }) = shape.area_light {
            *self.lights.entry("area".to_owned()).or_default() += 1;
        }
    }
}

/// Bytes that building a scene of this description takes besides the description, as far as they are known before:
/// those of the trees and of what they are made from. Measured for meshes of a million triangles, which took 60 bytes
/// each.
pub fn predicted_build_bytes(desc: &SceneDesc) -> u64 {
    const TRIANGLE: u64 = 64;
    // Shapes and instances keep double precision, and their maps.
    const OTHER: u64 = 640;
    // Lights keep the shapes that shine, triangle by triangle, and a tree over them.
    const LIGHT: u64 = 1152;
    // Each object that is placed has a tree of its own, however small; of the others, there is only a list.
    const PLACED: u64 = 4096;
    const OBJECT: u64 = 160;
    // Measured for hairs of two segments, which took 350 to 440 bytes in the tree.
    const SEGMENT: u64 = 256;
    let (mut triangles, mut others, mut lights) = (0_u64, 0_u64, desc.lights.len() as u64);
    let mut segments = 0_u64;
    let mut add = |shape: &ShapeDesc| {
        others += 1;
        let shines = shape.area_light.is_some();
        lights += u64::from(shines);
        if let GeometryDesc::Mesh(mesh) = &shape.geometry {
            let count = mesh.triangles.len() as u64 + 2 * mesh.quads.len() as u64;
            triangles += count;
            lights += if shines { count } else { 0 };
        } else if let GeometryDesc::BilinearMesh(mesh) = &shape.geometry {
            others += mesh.quads.len() as u64;
        } else if let GeometryDesc::Curves(curves) = &shape.geometry {
            segments += curves.segment_count() as u64;
        }
    };
    desc.shapes.iter().for_each(&mut add);
    let of_objects = desc.objects.iter().flat_map(|object| &object.instances);
    let placed: HashSet<ObjectId> = desc.instances.iter().chain(of_objects).map(|i| i.object).collect();
    let is_placed = |&(id, _): &(u32, &ObjectDesc)| placed.contains(&ObjectId(id));
    let objects = || (0..).zip(&desc.objects).filter(is_placed).map(|(_, object)| object);
    objects().flat_map(|object| &object.shapes).for_each(&mut add);
    let instances = desc.instances.len() + objects().map(|object| object.instances.len()).sum::<usize>();
    let parts = [
        (triangles, TRIANGLE),
        (segments, SEGMENT),
        (others + instances as u64, OTHER),
        (lights, LIGHT),
        (placed.len() as u64, PLACED),
        (desc.objects.len() as u64, OBJECT),
    ];
    parts.into_iter().fold(0, |sum, (count, each)| sum.saturating_add(count.saturating_mul(each)))
}

fn mesh_bytes(mesh: &MeshDesc) -> u64 {
    fn list<T>(items: &Option<Vec<T>>) -> usize {
        items.as_ref().map_or(0, |items| size_of_val(items.as_slice()))
    }
    let bytes = size_of_val(mesh.positions.as_slice())
        + size_of_val(mesh.triangles.as_slice())
        + size_of_val(mesh.quads.as_slice())
        + list(&mesh.normals)
        + list(&mesh.uvs)
        + list(&mesh.tangents)
        + list(&mesh.colours)
        + list(&mesh.face_indices);
    bytes as u64
}

/// The name of a light in the scene language; for a moving one, that of the light itself.
fn light_name(light: &LightDesc) -> &'static str {
    match light {
        LightDesc::Point { .. } => "point",
        LightDesc::Spot { .. } => "spot",
        LightDesc::Goniometric { .. } => "goniometric",
        LightDesc::Projection { .. } => "projection",
        LightDesc::Distant { .. } | LightDesc::Disc { .. } => "distant",
        LightDesc::Infinite { .. } | LightDesc::Portal { .. } => "infinite",
        LightDesc::Pov(_) => "pov",
        LightDesc::Moving { light, .. } | LightDesc::Spectral { light, .. } => light_name(light),
    }
}
