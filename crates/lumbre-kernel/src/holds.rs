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
    /// Whether it holds nothing but spheres of clouds, and some.
    pub(crate) only_spheres: bool,
    /// Whether the centres of all spheres are relative to one origin.
    pub(crate) has_one_cloud_origin: bool,
    /// No coordinate of a sphere's centre, relative to its cloud's origin, plus a radius is larger.
    pub(crate) sphere_reach: f64,
}

impl Holds {
    /// `largest_corner` and `sphere_reach` are of what was put into the tree.
    pub(crate) fn new(geometries: &[Geometry], largest_corner: f32, sphere_reach: f64) -> Self {
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
        let is_cloud = |geometry: &Geometry| matches!(geometry.kind, GeometryKind::Spheres(_));
        Self {
            only_spheres: first_cloud_origin.is_some() && geometries.iter().all(is_cloud),
            has_one_cloud_origin: cloud_origins.all(|origin| Some(origin) == first_cloud_origin),
            sphere_reach,
            only_triangles: geometries.iter().all(|geometry| matches!(geometry.kind, GeometryKind::Mesh(_))),
            has_one_origin: origins.all(|origin| origin == first_origin),
            first_origin,
            largest_corner,
        }
    }
}
