//! Surfaces and maps along a hit's route.

use std::sync::Arc;

use lumbre_math::DVec3;

use super::scenes::{Random, mixture, ray, vertex};
use crate::tree::Tree;
use crate::{Accel, GeometryKind, Hit};

fn innermost<'a>(accel: &'a Accel, hit: &Hit) -> &'a Tree {
    hit.route.iter().fold(&accel.tree, |tree, &at| match &tree.geometries[at as usize].kind {
        GeometryKind::Instance(instance) => &instance.tree,
        _ => panic!("a route leads through instances"),
    })
}

#[test]
fn surfaces_lie_on_the_ray_and_triangle_in_any_instances() {
    let mut random = Random(31);
    let center = DVec3::new(1.5, -2.25, 4.0);
    let accel = mixture(&mut random, center, 3.0, 2, false);
    let (mut triangles, mut nested) = (0, 0);
    for _ in 0..20_000 {
        let ray = ray(&mut random, center, 3.0);
        let Some(hit) = accel.closest(&ray) else { continue };
        let surface = accel.surface(&ray, &hit);
        let at = ray.at(hit.root.t);
        let reach = (ray.origin - surface.point).length() + 10.0;
        assert!((surface.point - at).length() < 1e-9 * reach, "{ray:?} {hit:?}");
        assert!((surface.normal.length() - 1.0).abs() < 1e-12);

        let inner = innermost(&accel, &hit);
        let ids: Vec<u32> = hit
            .route
            .iter()
            .scan(&accel.tree, |at, &position| {
                let geometry = &at.geometries[position as usize];
                let GeometryKind::Instance(instance) = &geometry.kind else { panic!("an instance") };
                *at = &instance.tree;
                Some(geometry.id)
            })
            .collect();
        assert_eq!(hit.instances.as_slice(), ids);
        assert_eq!(hit.id, inner.geometries[hit.geometry as usize].id);
        nested += usize::from(hit.route.len() > 1);
        let GeometryKind::Mesh(mesh) = &inner.geometries[hit.geometry as usize].kind else { continue };
        triangles += 1;
        assert!(surface.normal.dot(surface.dpdu).abs() <= 1e-9 * surface.dpdu.length());
        let map = accel.world_from_object(&ray, &hit);
        let [a, b, c] = mesh.indices[hit.primitive as usize].map(|i| vertex(mesh, i));
        assert!((map.vector(b - a) - surface.dpdu).length() < 1e-9 * (surface.dpdu.length() + 1.0));
        let normal = map.normal((b - a).cross(c - a).normalize()).normalize();
        assert!((normal - surface.normal).length() < 1e-6);
        // The point, pulled back, is in the triangle's plane and at its barycentrics, within the error that it states.
        let exact = map.point(a + surface.uv.x * (b - a) + surface.uv.y * (c - a));
        let off = (surface.point - exact).abs();
        let allowed = 4.0 * surface.point_error;
        assert!(off.cmple(allowed).all(), "{off} > {allowed}");
        assert!(surface.point_error.max_element() < 1e-12);
    }
    assert!(triangles > 1000 && nested > 100, "{triangles} {nested}");
}

#[test]
fn a_mirror_keeps_the_front() {
    use crate::GeometryKind;
    use lumbre_geometry::Ray;
    use lumbre_math::Transform;
    let cube = super::scenes::cube();
    let mirror = Transform::scale(DVec3::new(-2.0, 1.5, 1.0)).unwrap();
    let inner = Arc::new(super::scenes::build(vec![GeometryKind::Mesh(Arc::new(cube))]));
    let outer = super::scenes::build(vec![GeometryKind::Instance(inner.instance(mirror))]);
    let ray = Ray::new(DVec3::new(-3.0, 0.5, -4.0), DVec3::new(0.02, 0.01, 1.0));
    let mut sides = Vec::new();
    outer.all(&ray, |hit| {
        sides.push(outer.surface(&ray, hit).normal.dot(ray.direction) < 0.0);
        std::ops::ControlFlow::Continue(())
    });
    assert_eq!(sides, [true, false], "in by the front, out by the back");
}
