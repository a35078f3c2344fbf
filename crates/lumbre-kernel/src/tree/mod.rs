//! The tree as data: its geometries, nodes, leaves and summaries. [`assemble`] assembles it, [`build`](crate::build)
//! builds it, and the modules above traverse it.

pub(crate) mod assemble;
pub(crate) mod block;
pub(crate) mod bounding_block;
pub(crate) mod filter_start;
pub(crate) mod flats;
pub(crate) mod geometry;
pub(crate) mod moments;
pub(crate) mod node;
pub(crate) mod packed;
pub(crate) mod picture_start;
pub(crate) mod precise_mesh;
pub(crate) mod sphere_block;
pub(crate) mod storage;
pub(crate) mod summary;
pub(crate) mod triangle_block;

use std::sync::{Arc, OnceLock};

use lumbre_geometry::{Aabb, PlacedShape};
use lumbre_math::DVec3;

use self::bounding_block::BoundingVolumes;
use self::filter_start::FilterStart;
use self::flats::Flats;
use self::geometry::{CustomGeometry, Placement, SphereCloud, TriangleMesh};
use self::moments::Moments;
use self::node::TreeSpace;
use self::packed::{Entry, Packed};
use self::picture_start::PictureStart;
use self::precise_mesh::PreciseMesh;
use self::summary::Summary;

pub(crate) use self::block::{BLOCK, Corners, PrimitiveId};

/// Something that rays can hit, with an id of the caller's.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// Returned in every [`crate::Hit`] on the geometry; chosen by the caller and not necessarily unique. The id of an
    /// instance becomes part of the hit's path.
    pub id: u32,
    /// The geometry itself.
    pub kind: GeometryKind,
}

/// The kinds of geometry.
#[derive(Clone, Debug)]
pub enum GeometryKind {
    /// One exact shape, tested in double precision.
    Shape(PlacedShape),
    /// Triangles, watertight.
    Mesh(Arc<TriangleMesh>),
    /// Many whole spheres, tested in double precision: sixteen bytes each, where a shape takes about two hundred.
    Spheres(Arc<SphereCloud>),
    /// Watertight triangles with vertices in double precision.
    PreciseMesh(Arc<PreciseMesh>),
    /// A whole tree, placed.
    Instance(Instance),
    /// A user's geometry.
    Custom(Arc<dyn CustomGeometry>),
}

/// A tree under an invertible affine map, which may change with time. Trees may contain instances in turn. Made by
/// [`Accel::instance`](crate::Accel::instance).
#[derive(Clone, Debug)]
pub struct Instance {
    /// The tree that is placed.
    pub(crate) tree: Arc<Tree>,
    /// Its placement.
    pub world_from_object: Placement,
}

/// A built tree: geometries, nodes, and the data derived from them. An instance is a tree inside a tree.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) tree_space: TreeSpace,
    pub(crate) packed: Packed,
    // Not in the nodes; every ray tests them.
    pub(crate) infinite: Vec<Entry>,
    pub(crate) bounds: Aabb,
    pub(crate) primitives: usize,
    pub(crate) summary: Summary,
    /// How single-precision rays start; `None` if they cannot.
    pub(crate) single: Option<FilterStart>,
    /// How picture rays start in single precision; `None` if they cannot.
    pub(crate) picture: Option<PictureStart>,
    /// The bounding volumes that are tested before shapes.
    pub(crate) bounding_volumes: BoundingVolumes,
    /// The cost of a ray right after the build, once it was computed.
    pub(crate) built_cost: Option<f64>,
    // Empty, or one for each geometry.
    pub(crate) masks: Vec<u32>,
    /// For winding numbers; computed at the first query.
    pub(crate) moments: OnceLock<Moments>,
    /// For closest points; computed at the first query.
    pub(crate) flats: OnceLock<Flats>,
}

impl Tree {
    /// How picture rays traverse the tree in single precision; `None` if that is of no use.
    #[inline]
    pub(crate) fn picture_start(&self) -> Option<&PictureStart> {
        self.picture.as_ref().filter(|picture| picture.has_triangles)
    }

    /// The origin of a mesh's corners.
    pub(crate) fn mesh_origin(&self, geometry: u32) -> DVec3 {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::Mesh(mesh) => mesh.origin,
            _ => unreachable!("blocks are of meshes"),
        }
    }

    /// The corners of a triangle in double precision.
    pub(crate) fn precise_corners(&self, geometry: u32, primitive: u32) -> [DVec3; 3] {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::PreciseMesh(mesh) => mesh.corners(primitive),
            _ => unreachable!("the leaf says so"),
        }
    }

    /// A cloud of spheres.
    #[inline(always)]
    pub(crate) fn cloud(&self, geometry: u32) -> &SphereCloud {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::Spheres(cloud) => cloud,
            _ => unreachable!("blocks of spheres are of clouds"),
        }
    }

    /// The entry of an instance: entries in nodes are numbered first, then those outside the tree.
    #[inline(always)]
    pub(crate) fn instance_entry(&self, index: usize) -> &Entry {
        let inside = &self.packed.entries;
        inside.get(index).unwrap_or_else(|| &self.infinite[index - inside.len()])
    }
}
