//! The tree as data: its geometries, nodes and leaves, and what is known of them. It is assembled in [`assemble`], built in
//! [`build`](crate::build), and traversed by what is above.

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

pub(crate) use self::block::{BLOCK, Corners, Name};

/// Something that rays can hit, under a name of the caller's.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// Returned in every [`crate::Hit`] on it; the caller's own, not necessarily unique. For an instance it joins the hit's
    /// path.
    pub id: u32,
    /// What it is.
    pub kind: GeometryKind,
}

/// The kinds of geometry.
#[derive(Clone, Debug)]
pub enum GeometryKind {
    /// One exact shape, tested in double precision.
    Shape(PlacedShape),
    /// Triangles, watertight.
    Mesh(Arc<TriangleMesh>),
    /// Whole spheres in large numbers, tested in double precision: sixteen bytes each, where a shape takes some two hundred.
    Spheres(Arc<SphereCloud>),
    /// Triangles with vertices in double precision, watertight as well.
    PreciseMesh(Arc<PreciseMesh>),
    /// A whole tree, placed.
    Instance(Instance),
    /// A user's geometry.
    Custom(Arc<dyn CustomGeometry>),
}

/// A tree under an invertible affine map, which may change with time; trees may hold instances in turn. Made by
/// [`Accel::instance`](crate::Accel::instance).
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is placed.
    pub(crate) tree: Arc<Tree>,
    /// Where.
    pub world_from_object: Placement,
}

/// A built tree: its geometries, its nodes, and what is known of both. An instance is a tree in a tree.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) tree_space: TreeSpace,
    pub(crate) packed: Packed,
    // Kept out of the nodes, and tested by every ray.
    pub(crate) infinite: Vec<Entry>,
    pub(crate) bounds: Aabb,
    pub(crate) primitives: usize,
    pub(crate) summary: Summary,
    /// Where single precision can traverse the tree.
    pub(crate) single: Option<FilterStart>,
    /// Where rays of pictures traverse it in single precision.
    pub(crate) picture: Option<PictureStart>,
    /// What shapes are tested by first.
    pub(crate) bounding_volumes: BoundingVolumes,
    /// What a ray cost after the build, once that was asked for.
    pub(crate) built_cost: Option<f64>,
    // One for each geometry, or none.
    pub(crate) masks: Vec<u32>,
    /// For winding numbers, once one was asked for.
    pub(crate) moments: OnceLock<Moments>,
    /// For closest points, once one was asked for.
    pub(crate) flats: OnceLock<Flats>,
}

impl Tree {
    /// How it is traversed in single precision for rays of pictures; `None` where that is of no use.
    #[inline]
    pub(crate) fn picture_start(&self) -> Option<&PictureStart> {
        self.picture.as_ref().filter(|picture| picture.has_triangles)
    }

    /// What the corners of a mesh are relative to.
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

    /// The entry of an instance: those in the nodes count first, then those outside of them.
    #[inline(always)]
    pub(crate) fn instance_entry(&self, index: usize) -> &Entry {
        let inside = &self.packed.entries;
        inside.get(index).unwrap_or_else(|| &self.infinite[index - inside.len()])
    }
}
