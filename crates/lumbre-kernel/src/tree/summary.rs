//! What a tree holds, as far as it decides which search goes through it.

use lumbre_math::DVec3;

use crate::{Geometry, GeometryKind, Instance};

/// What is known of all the geometries of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Summary {
    /// Whether it holds nothing but triangles.
    pub(crate) only_triangles: bool,
    /// How many instances are around what is innermost.
    pub(crate) nesting: u32,
    /// Whether the corners of all triangles are relative to one origin.
    pub(crate) has_one_origin: bool,
    /// That of the first mesh; a NaN where there is none.
    pub(crate) first_origin: DVec3,
    /// The sizes of what was put into the tree.
    pub(crate) sizes: Sizes,
    /// Whether the centres of all spheres are relative to one origin.
    pub(crate) has_one_cloud_origin: bool,
    /// Whether geometries in instances have masks.
    pub(crate) masks_within: bool,
}

impl Summary {
    pub(crate) fn new(geometries: &[Geometry], sizes: Sizes) -> Self {
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
            GeometryKind::Instance(Instance { accel, .. }) => accel.summary.nesting.saturating_add(1),
            _ => 0,
        };
        Self {
            has_one_cloud_origin: cloud_origins.all(|origin| Some(origin) == first_cloud_origin),
            only_triangles: geometries.iter().all(|geometry| matches!(geometry.kind, GeometryKind::Mesh(_))),
            nesting: geometries.iter().map(nesting_of).max().unwrap_or(0),
            has_one_origin: origins.all(|origin| origin == first_origin),
            first_origin,
            sizes,
            masks_within: geometries.iter().any(|geometry| match &geometry.kind {
                GeometryKind::Instance(Instance { accel, .. }) => {
                    !accel.masks.is_empty() || accel.summary.masks_within
                }
                _ => false,
            }),
        }
    }
}

/// The sizes of what is put into a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sizes {
    /// No corner of a triangle has a larger coordinate, relative to its mesh's origin.
    pub(crate) largest_corner: f32,
    /// No side of the box of a triangle is longer, but for rounding.
    pub(crate) longest_side: f32,
    /// No coordinate of a sphere's centre, relative to its cloud's origin, plus a radius is larger.
    pub(crate) sphere_reach: f64,
}

impl Sizes {
    /// The larger ones.
    pub(crate) fn grow(&mut self, other: &Self) {
        self.largest_corner = self.largest_corner.max(other.largest_corner);
        self.longest_side = self.longest_side.max(other.longest_side);
        self.sphere_reach = self.sphere_reach.max(other.sphere_reach);
    }
}
