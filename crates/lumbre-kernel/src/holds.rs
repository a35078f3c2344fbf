//! What a tree holds, as far as it decides which search goes through it.

use lumbre_math::DVec3;

use crate::{Geometry, GeometryKind};

/// What is known of all the geometries of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Holds {
    /// Whether it holds nothing but triangles.
    pub(crate) only_triangles: bool,
    /// Whether the corners of all triangles are relative to one origin.
    pub(crate) has_one_origin: bool,
    /// That of the first mesh; a NaN where there is none.
    pub(crate) first_origin: DVec3,
    /// No corner of a triangle has a larger coordinate, relative to its mesh's origin.
    pub(crate) largest_corner: f32,
}

impl Holds {
    /// `largest_corner` is of the triangles that were put into the tree.
    pub(crate) fn new(geometries: &[Geometry], largest_corner: f32) -> Self {
        let mut origins = geometries.iter().filter_map(|geometry| match &geometry.kind {
            GeometryKind::Mesh(mesh) => Some(mesh.origin),
            _ => None,
        });
        let first_origin = origins.next().unwrap_or(DVec3::NAN);
        Self {
            only_triangles: geometries.iter().all(|geometry| matches!(geometry.kind, GeometryKind::Mesh(_))),
            has_one_origin: origins.all(|origin| origin == first_origin),
            first_origin,
            largest_corner,
        }
    }
}
