//! Enumerates every primitive of a tree, including ones that no ray can hit.

use std::ops::ControlFlow;

use lumbre_geometry::Root;

use crate::hit::{Hit, InstancePath};
use crate::tree::{GeometryKind, Tree};

/// Visits every primitive as a hit without a crossing; those of instances once for each instance.
pub(crate) fn each(tree: &Tree, visit: &mut impl FnMut(&Hit) -> ControlFlow<()>) -> ControlFlow<()> {
    let mut hit = Hit {
        root: Root::at(f64::NAN),
        id: 0,
        primitive: 0,
        geometry: 0,
        instances: InstancePath::new(),
        route: InstancePath::new(),
    };
    within(tree, &mut hit, visit)
}

fn within(tree: &Tree, hit: &mut Hit, visit: &mut impl FnMut(&Hit) -> ControlFlow<()>) -> ControlFlow<()> {
    for (position, geometry) in tree.geometries.iter().enumerate() {
        let count = match &geometry.kind {
            GeometryKind::Shape(_) => 1,
            GeometryKind::Mesh(mesh) => mesh.indices.len(),
            GeometryKind::Spheres(cloud) => cloud.spheres.len(),
            GeometryKind::PreciseMesh(mesh) => mesh.indices.len(),
            GeometryKind::Custom(custom) => custom.primitive_count() as usize,
            GeometryKind::Instance(instance) => {
                hit.instances.push(geometry.id);
                hit.route.push(position as u32);
                within(&instance.tree, hit, visit)?;
                hit.instances.pop();
                hit.route.pop();
                continue;
            }
        };
        (hit.geometry, hit.id) = (position as u32, geometry.id);
        for primitive in 0..count as u32 {
            hit.primitive = primitive;
            visit(hit)?;
        }
    }
    ControlFlow::Continue(())
}
