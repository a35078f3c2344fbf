//! Triangles without area that stitch a mesh.
//!
//! Where a vertex lies on an edge, exporters and rounding leave triangles whose corners are on one line. They are never hit themselves, but
//! the edges on their two sides, sheared and rounded one by one, are not quite on one line, and without them a ray might pass between. So
//! they stand in the tree as others do, and the few rays that pass through what rounding makes of them hit the neighbour instead.

use std::collections::HashSet;

use lumbre_geometry::Root;
use lumbre_math::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::{Accel, Geometry, GeometryKind, geometry, precise_mesh};

/// The most triangles without area between a crossing and a neighbour that has one.
const MOST_STEPS: usize = 64;

/// Whether any mesh has triangles without area that may stitch it.
pub(crate) fn has_seams(geometries: &[Geometry]) -> bool {
    geometries.iter().any(|standing| match &standing.kind {
        GeometryKind::Mesh(mesh) => mesh.indices.par_iter().with_min_len(1 << 14).any(|triangle| {
            let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
            !geometry::has_area(&corners) && geometry::is_kept(&corners)
        }),
        GeometryKind::PreciseMesh(mesh) => (0..mesh.indices.len() as u32).any(|triangle| {
            let corners = mesh.corners(triangle);
            !precise_mesh::has_area(&corners) && precise_mesh::is_kept(&corners)
        }),
        _ => false,
    })
}

/// The corners of a triangle of a mesh, in the space of the mesh.
fn corners(kind: &GeometryKind, primitive: usize) -> [DVec3; 3] {
    match kind {
        GeometryKind::Mesh(mesh) => {
            mesh.indices[primitive].map(|vertex| mesh.positions[vertex as usize].as_dvec3())
        }
        GeometryKind::PreciseMesh(mesh) => mesh.corners(primitive as u32),
        _ => unreachable!("a mesh"),
    }
}

fn has_area(kind: &GeometryKind, corners: &[DVec3; 3]) -> bool {
    match kind {
        GeometryKind::Mesh(_) => {
            geometry::has_area(&corners.map(|corner: DVec3| -> Vec3 { corner.as_vec3() }))
        }
        _ => precise_mesh::has_area(corners),
    }
}

/// Whether a triangle of a tree has no area.
#[inline(always)]
pub(crate) fn is_flat(accel: &Accel, geometry: u32, primitive: u32) -> bool {
    accel.summary.has_seams && is_flat_there(accel, geometry, primitive)
}

#[cold]
#[inline(never)]
fn is_flat_there(accel: &Accel, geometry: u32, primitive: u32) -> bool {
    let kind = &accel.geometries[geometry as usize].kind;
    !has_area(kind, &corners(kind, primitive as usize))
}

/// The neighbour with an area to which a crossing of a triangle without one belongs, and the crossing of it: `None` where there is none.
pub(crate) fn neighbour(accel: &Accel, geometry: u32, primitive: u32, root: Root) -> Option<(u32, Root)> {
    let kind = &accel.geometries[geometry as usize].kind;
    let count = match kind {
        GeometryKind::Mesh(mesh) => mesh.indices.len(),
        GeometryKind::PreciseMesh(mesh) => mesh.indices.len(),
        _ => return None,
    };
    let [a, b, c] = corners(kind, primitive as usize);
    let at = a + root.local.x * (b - a) + root.local.y * (c - a);
    let mut seen = HashSet::from([primitive as usize]);
    let mut pending = vec![primitive as usize];
    while let Some(flat) = pending.pop() {
        if seen.len() > MOST_STEPS {
            return None;
        }
        let [a, b, c] = corners(kind, flat);
        let mut edges = [[a, b], [b, c], [c, a]];
        edges.sort_by(|[a, b], [c, d]| (*d - *c).length_squared().total_cmp(&(*b - *a).length_squared()));
        for [p, q] in edges {
            let share = (at - p).dot(q - p) / (q - p).length_squared();
            if !(-1e-9..=1.0 + 1e-9).contains(&share) {
                continue;
            }
            for other in 0..count {
                let around = corners(kind, other);
                let place = |corner: DVec3| around.iter().position(|&own| own == corner);
                let (Some(first), Some(second)) = (place(p), place(q)) else { continue };
                if !seen.insert(other) {
                    continue;
                }
                if has_area(kind, &around) {
                    let share = share.clamp(0.0, 1.0);
                    let mut weights = [0.0; 3];
                    weights[first] = 1.0 - share;
                    weights[second] = share;
                    let local = DVec2::new(weights[1], weights[2]);
                    return Some((other as u32, Root { local, ..root }));
                }
                pending.push(other);
            }
        }
    }
    None
}
