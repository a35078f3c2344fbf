//! The plain version of every query: one loop over everything. The tests' oracle.

use lumbre_geometry::Ray;

use crate::query::{All, Batch, Closest};
use crate::spheres::has_radius;
use crate::touch::{offer_borders_of_all, offer_meeting};
use crate::traverse::{Place, Search, What, is_sound, meet_primitive};
use crate::triangles::{Shear, intersect};
use crate::{Accel, GeometryKind, Hit, precise};

pub(crate) fn closest(accel: &Accel, ray: &Ray) -> Option<Hit> {
    let mut search = Closest::new(ray, &All);
    visit(accel, ray, &mut search);
    search.take_hit()
}

pub(crate) fn every(accel: &Accel, ray: &Ray) -> Vec<Hit> {
    let mut search = Batch::new(ray, usize::MAX, None);
    visit(accel, ray, &mut search);
    search.into_hits().0.into_iter().map(|ranked| ranked.hit).collect()
}

fn visit<'a, S: Search<'a>>(accel: &'a Accel, ray: &Ray, search: &mut S) {
    let mut touches = Vec::new();
    let mut pending = vec![(accel, *ray, Place::default())];
    while let Some((accel, ray, place)) = pending.pop() {
        if !is_sound(&ray) {
            continue;
        }
        for (position, geometry) in accel.geometries.iter().enumerate() {
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
                        let primitive = primitive as u32;
                        let geometry = position;
                        let meeting = intersect(&ray, shear, origin, permuted);
                        let corners = corners.map(|corner| corner.map(f64::from));
                        let what = What::Named { geometry, primitive };
                        offer_meeting(meeting, &ray, corners, what, accel, &place, search, &mut touches);
                    }
                }
                GeometryKind::PreciseMesh(mesh) => {
                    for primitive in 0..mesh.indices.len() as u32 {
                        precise::meet(accel, &ray, [position, primitive], &place, search, &mut touches);
                    }
                }
                GeometryKind::Instance(instance) => {
                    let mut inner = place.clone();
                    inner.route.push(position);
                    inner.ids.push(geometry.id);
                    pending.push((&instance.accel, instance.world_from_object.object_ray(&ray), inner));
                }
                GeometryKind::Shape(_) => {
                    meet_primitive(accel, &ray, position, 0, &place, search);
                }
                GeometryKind::Spheres(cloud) => {
                    for primitive in 0..cloud.spheres.len() as u32 {
                        if has_radius(&cloud.spheres[primitive as usize]) {
                            meet_primitive(accel, &ray, position, primitive, &place, search);
                        }
                    }
                }
                GeometryKind::Custom(custom) => {
                    for primitive in 0..custom.primitive_count() {
                        meet_primitive(accel, &ray, position, primitive, &place, search);
                    }
                }
            }
        }
    }
    offer_borders_of_all(ray, &touches, search);
}
