//! Assembles a tree from the parts that a build or a file provides.

use std::sync::OnceLock;

use lumbre_geometry::Aabb;
use lumbre_math::DVec3;

use super::bounding_block::BoundingVolumes;
use super::filter_start::FilterStart;
use super::node::TreeSpace;
use super::packed::{Entry, Packed};
use super::picture_start::PictureStart;
use super::summary::{Sizes, Summary};
use super::{Geometry, GeometryKind, Instance, Placement, Tree};

/// The parts that a build or a file provides.
pub(crate) struct TreeParts {
    pub(crate) tree_space: TreeSpace,
    pub(crate) packed: Packed,
    pub(crate) sizes: Sizes,
    pub(crate) bounds: Aabb,
    pub(crate) infinite: Vec<Entry>,
    pub(crate) primitives: usize,
}

impl Tree {
    pub(crate) fn assemble(geometries: Vec<Geometry>, parts: TreeParts) -> Self {
        let TreeParts { tree_space, packed, sizes, bounds, infinite, primitives } = parts;
        let mut tree = Self {
            summary: summary(&geometries, sizes),
            geometries,
            tree_space,
            packed,
            infinite,
            bounds,
            primitives,
            single: None,
            picture: None,
            bounding_volumes: BoundingVolumes::default(),
            built_cost: None,
            masks: Vec::new(),
            moments: OnceLock::new(),
            flats: OnceLock::new(),
        };
        tree.follow();
        tree
    }

    /// Recomputes the data derived from the tree after it has changed.
    pub(crate) fn follow(&mut self) {
        self.summary = summary(&self.geometries, self.summary.sizes);
        self.single = FilterStart::new(&self.summary, &self.tree_space, self.packed.root);
        self.picture = picture_start(&self.geometries, self.single.as_ref());
        let shape = |entry: &Entry| match &self.geometries[entry.geometry as usize].kind {
            GeometryKind::Shape(shape) => Some(shape),
            _ => None,
        };
        self.bounding_volumes = BoundingVolumes::new(&self.packed.entries, &self.tree_space, shape);
        self.moments = OnceLock::new();
        self.flats = OnceLock::new();
    }
}

/// The summary of geometries of these sizes.
fn summary(geometries: &[Geometry], sizes: Sizes) -> Summary {
    let mut origins = geometries.iter().filter_map(|geometry| match &geometry.kind {
        GeometryKind::Mesh(mesh) => Some(mesh.origin),
        _ => None,
    });
    let first_origin = origins.next().unwrap_or(DVec3::NAN);
    let mut cloud_origins = geometries.iter().filter_map(|geometry| match &geometry.kind {
        GeometryKind::Spheres(cloud) => Some(cloud.origin),
        _ => None,
    });
    let first_cloud_origin = cloud_origins.next();
    let nesting_of = |geometry: &Geometry| match &geometry.kind {
        GeometryKind::Instance(Instance { tree, .. }) => tree.summary.nesting.saturating_add(1),
        _ => 0,
    };
    Summary {
        has_one_cloud_origin: cloud_origins.all(|origin| Some(origin) == first_cloud_origin),
        only_triangles: geometries.iter().all(|geometry| matches!(geometry.kind, GeometryKind::Mesh(_))),
        nesting: geometries.iter().map(nesting_of).max().unwrap_or(0),
        has_one_origin: origins.all(|origin| origin == first_origin),
        first_origin,
        sizes,
        masks_within: geometries.iter().any(|geometry| match &geometry.kind {
            GeometryKind::Instance(Instance { tree, .. }) => {
                !tree.masks.is_empty() || tree.summary.masks_within
            }
            _ => false,
        }),
    }
}

/// How picture rays start in a tree with this start; `None` if they need double precision, as they do if instances
/// move.
fn picture_start(geometries: &[Geometry], start: Option<&FilterStart>) -> Option<PictureStart> {
    let start = start?;
    let (mut within, mut has_triangles) = (0.0f64, false);
    for geometry in geometries {
        has_triangles |= matches!(geometry.kind, GeometryKind::Mesh(_));
        let GeometryKind::Instance(instance) = &geometry.kind else { continue };
        let Placement::Still(map) = &instance.world_from_object else { return None };
        if let Some(picture) = &instance.tree.picture {
            let linear = map.affine().matrix3;
            let size = linear.x_axis.abs() + linear.y_axis.abs() + linear.z_axis.abs();
            within = within.max(size.max_element() * picture.deviation);
            has_triangles |= picture.has_triangles;
        }
    }
    PictureStart::new(start, within, has_triangles)
}
