//! Primitives without area: triangles that are lines or points, and spheres without a radius.
//!
//! No ray hits them, so trees leave them out. But distances count them: they have a tree of their own, which is built
//! at the first closest-point query.

use lumbre_geometry::Aabb;
use lumbre_math::{DMat3, DVec3, Transform};

use crate::tree::flats::{FlatItem, Flats};
use crate::tree::geometry::{Placement, has_area};
use crate::tree::sphere_block::{ExactSphere, has_radius};
use crate::tree::{GeometryKind, Tree, precise_mesh};

/// The primitives without area among the geometries of a tree.
pub(crate) fn flats(tree: &Tree) -> &Flats {
    tree.flats.get_or_init(|| Flats::new(flat_primitives(tree)))
}

/// The flat primitives, and instances of trees that have some, with their boxes.
fn flat_primitives(tree: &Tree) -> Vec<(Aabb, FlatItem)> {
    let mut boxed: Vec<(Aabb, FlatItem)> = Vec::new();
    for (geometry, standing) in (0..).zip(&tree.geometries) {
        let mut add = |primitive: u32, bounds: Aabb| boxed.push((bounds, FlatItem { geometry, primitive }));
        match &standing.kind {
            GeometryKind::Mesh(mesh) => {
                for (primitive, triangle) in (0..).zip(&mesh.indices) {
                    let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
                    if !has_area(&corners) {
                        add(primitive, Aabb::around(corners.map(|p| mesh.origin + p.as_dvec3())));
                    }
                }
            }
            GeometryKind::PreciseMesh(mesh) => {
                for primitive in 0..mesh.indices.len() as u32 {
                    let corners = mesh.corners(primitive);
                    if !precise_mesh::has_area(&corners) {
                        add(primitive, Aabb::around(corners));
                    }
                }
            }
            GeometryKind::Spheres(cloud) => {
                for (primitive, sphere) in (0..).zip(&cloud.spheres) {
                    if !has_radius(sphere) {
                        add(primitive, Aabb::around([ExactSphere::of(cloud, primitive).center]));
                    }
                }
            }
            GeometryKind::Instance(instance) => {
                if let Some(root) = flats(&instance.tree).root() {
                    add(0, placed(&root.bounds, &instance.world_from_object));
                }
            }
            GeometryKind::Shape(_) | GeometryKind::Custom(_) => {}
        }
    }
    boxed
}

/// A box around the image of another under a map, rounding included; infinite for a moving map.
fn placed(bounds: &Aabb, placement: &Placement) -> Aabb {
    match placement {
        Placement::Still(map) if bounds.min.is_finite() && bounds.max.is_finite() => moved(bounds, map),
        Placement::Still(_) | Placement::Moving(_) => Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY },
    }
}

fn moved(bounds: &Aabb, map: &Transform) -> Aabb {
    let corners = (0..8).map(|i| {
        let pick = |bit: usize| if i >> bit & 1 == 1 { bounds.max } else { bounds.min };
        map.point(DVec3::new(pick(0).x, pick(1).y, pick(2).z))
    });
    let moved = Aabb::around(corners);
    let linear = map.linear();
    let sizes = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let far = bounds.min.abs().max(bounds.max.abs());
    let rounding = 1e-15 * (sizes * far + map.point(DVec3::ZERO).abs());
    Aabb { min: moved.min - rounding, max: moved.max + rounding }
}
