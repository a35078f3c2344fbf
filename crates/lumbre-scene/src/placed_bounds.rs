//! Bounding boxes of what a transform places.

use lumbre_geometry::Aabb;
use lumbre_math::{DVec3, Elementary, Transform};

use crate::MeshDesc;

/// The bounding box of a mesh under a transform.
pub(crate) fn mesh_bounds(mesh: &MeshDesc, placement: &Transform) -> Aabb {
    let corners = mesh.positions.iter().filter(|p| p.is_finite());
    moved(&Aabb::around(corners.map(|p| p.as_dvec3())), placement)
}

/// The origin for a bounding box: see [`origin`].
pub(crate) fn near(bounds: &Aabb) -> DVec3 {
    let size = bounds.size().max_element();
    if bounds.is_empty() || !size.is_finite() || size <= 0.0 {
        return if bounds.is_empty() { DVec3::ZERO } else { finite_or_zero(bounds.center()) };
    }
    let grid = f64::powi(2.0, size.logarithm_2().ceil().clamp(-1000.0, 1000.0) as i32);
    finite_or_zero((bounds.center() / grid).map(f64::rounded) * grid)
}

fn finite_or_zero(p: DVec3) -> DVec3 {
    if p.is_finite() { p } else { DVec3::ZERO }
}

/// The bounding box of a box under a transform.
pub(crate) fn moved(bounds: &Aabb, placement: &Transform) -> Aabb {
    if bounds.is_empty() {
        return *bounds;
    }
    let corners = (0..8).map(|i| {
        let pick = |bit: usize| if i >> bit & 1 == 1 { bounds.max } else { bounds.min };
        placement.point(DVec3::new(pick(0).x, pick(1).y, pick(2).z))
    });
    Aabb::around(corners)
}
