//! The plain version of every query: one loop over everything. The tests' oracle.

use lumbre_geometry::Ray;

use crate::hit::Hit;
use crate::intersect::watertight::{Shear, intersect};
use crate::trace::edges::{Patch, Triangle, intersect_precise, visit_borders_of_all};
use crate::trace::exact::visit_primitive;
use crate::trace::visitor::Visitor;
use crate::trace::visitors::{Closest, NextHits};
use crate::trace::{Context, is_sound};
use crate::tree::sphere_block::has_radius;
use crate::tree::{GeometryKind, Tree};

pub(crate) fn closest(tree: &Tree, ray: &Ray) -> Option<Hit> {
    let mut visitor = Closest::new(ray, None);
    visit(tree, ray, &mut visitor);
    visitor.into_hit()
}

pub(crate) fn every(tree: &Tree, ray: &Ray) -> Vec<Hit> {
    let mut visitor = NextHits::new(ray, usize::MAX, None);
    visit(tree, ray, &mut visitor);
    visitor.into_hits().0.into_iter().map(|ranked| ranked.hit).collect()
}

fn visit(tree: &Tree, ray: &Ray, visitor: &mut dyn Visitor) {
    let mut edge_hits = Vec::new();
    let wanted = visitor.wanted();
    let mut pending = vec![(tree, *ray, Context::default())];
    while let Some((tree, ray, context)) = pending.pop() {
        if !is_sound(&ray) {
            continue;
        }
        for (position, geometry) in tree.geometries.iter().enumerate() {
            let position = position as u32;
            match &geometry.kind {
                GeometryKind::Mesh(mesh) => {
                    let shear = Shear::new(&ray.direction);
                    let origin = shear.local_origin(&ray.origin, &mesh.origin);
                    for (primitive, triangle) in mesh.indices.iter().enumerate() {
                        let corners = triangle.map(|vertex| mesh.positions[vertex as usize].to_array());
                        let [a, b, c] =
                            corners.map(|corner| lumbre_math::Vec3::from_array(corner).as_dvec3());
                        if (b - a).cross(c - a) == lumbre_math::DVec3::ZERO {
                            continue;
                        }
                        let permuted = corners.map(|corner| {
                            let corner = lumbre_math::Vec3::from_array(corner).as_dvec3();
                            shear.axes.permute(&corner).map(|x| x as f32)
                        });
                        let meeting = intersect(&ray, shear, origin, permuted);
                        let corners = corners.map(|corner| corner.map(f64::from));
                        let triangle = Triangle { corners, ids: (position, primitive as u32), tree };
                        triangle.visit(meeting, &ray, &context, visitor, &mut edge_hits);
                    }
                }
                GeometryKind::PreciseMesh(mesh) => {
                    for primitive in 0..mesh.indices.len() as u32 {
                        let meeting = intersect_precise(tree, &ray, position, primitive);
                        let corners = mesh.corners(primitive).map(|corner| corner.to_array());
                        let triangle = Triangle { corners, ids: (position, primitive), tree };
                        triangle.visit(meeting, &ray, &context, visitor, &mut edge_hits);
                    }
                }
                GeometryKind::Instance(instance) => {
                    let mut inner = context.clone();
                    inner.route.push(position);
                    inner.ids.push(geometry.id);
                    pending.push((&instance.tree, instance.world_from_object.object_ray(&ray), inner));
                }
                kind @ GeometryKind::Shape(_) => {
                    if let Some(patch) = Patch::of(kind) {
                        patch.visit((tree, position), &ray, &context, visitor, &mut edge_hits);
                    } else {
                        visit_primitive(tree, &ray, (position, 0), wanted, &context, visitor);
                    }
                }
                GeometryKind::Spheres(cloud) => {
                    for primitive in 0..cloud.spheres.len() as u32 {
                        if has_radius(&cloud.spheres[primitive as usize]) {
                            visit_primitive(tree, &ray, (position, primitive), wanted, &context, visitor);
                        }
                    }
                }
                GeometryKind::Custom(custom) => {
                    for primitive in 0..custom.primitive_count() {
                        visit_primitive(tree, &ray, (position, primitive), wanted, &context, visitor);
                    }
                }
            }
        }
    }
    visit_borders_of_all(ray, &edge_hits, visitor);
}
