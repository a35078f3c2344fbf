//! What a tree holds, as far as it decides which search goes through it.

use lumbre_math::DVec3;
use rayon::prelude::*;

use crate::triangles::TriangleBlock;
use crate::{Geometry, GeometryKind};

/// What is known of all the geometries of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Holds {
    /// Whether it holds nothing but triangles.
    pub(crate) only_triangles: bool,
    /// What the corners of all triangles are relative to; `None` when meshes differ in it, or there are none.
    pub(crate) origin: Option<DVec3>,
    /// No corner of a triangle has a larger coordinate, relative to its mesh's origin.
    pub(crate) largest_corner: f32,
}

impl Holds {
    pub(crate) fn new(geometries: &[Geometry], blocks: &[TriangleBlock]) -> Self {
        let mut origins = geometries.iter().filter_map(|geometry| match &geometry.kind {
            GeometryKind::Mesh(mesh) => Some(mesh.origin),
            _ => None,
        });
        // No NaN: those of unused lanes give way.
        let larger = |a: f32, b: f32| a.max(b.abs());
        let largest_of = |block: &TriangleBlock| {
            block.corners.as_flattened().as_flattened().iter().copied().fold(0.0, larger)
        };
        Self {
            only_triangles: geometries.iter().all(|geometry| matches!(geometry.kind, GeometryKind::Mesh(_))),
            origin: origins.next().filter(|first| origins.all(|origin| origin == *first)),
            largest_corner: blocks.par_iter().map(largest_of).reduce(|| 0.0, larger),
        }
    }
}
