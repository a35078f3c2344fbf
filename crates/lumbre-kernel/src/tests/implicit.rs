//! Implicit surfaces among everything else.

use std::sync::Arc;

use lumbre_geometry::{Aabb, ImplicitSurface};
use lumbre_math::DVec3;

use super::oracle::{check, check_batches};
use super::scenes::{Random, build, ray, repeats, soup, with_every_preset};
use crate::GeometryKind;

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// A rounded cube.
fn rounded(center: DVec3, radius: f64) -> ImplicitSurface {
    let bounds = Aabb { min: center - radius, max: center + radius }.outward(2);
    let cube = ImplicitSurface::new(bounds, move |[x, y, z]| {
        (x - center.x).powi(4) + (y - center.y).powi(4) + (z - center.z).powi(4) - radius.powi(4)
    });
    cube.expect("the box is not empty")
}

#[test]
fn implicit_surfaces_and_triangles_are_found_as_by_a_loop() {
    with_every_preset(|| {
        let mut random = Random(931);
        let mut kinds: Vec<_> = (0..30)
            .map(|_| {
                let center = CENTER + 3.0 * random.vector();
                GeometryKind::Custom(Arc::new(rounded(center, random.between(0.1, 0.6))))
            })
            .collect();
        kinds.push(GeometryKind::Mesh(Arc::new(soup(&mut random, 60, CENTER, 3.0))));
        let accel = build(kinds);
        let rays: Vec<_> = (0..repeats(800)).map(|_| ray(&mut random, CENTER, 3.0)).collect();
        let hits: usize = rays.iter().map(|ray| check(&accel, ray)).sum();
        assert!(hits > rays.len() / 3, "{hits} of {}", rays.len());
        check_batches(&accel, &rays);
        // Each winds once around its middle, and the boxes know how far they reach.
        let GeometryKind::Custom(first) = &accel.tree.geometries[0].kind else { panic!() };
        let bounds = first.bounds(0).expect("it is bounded");
        assert_eq!(first.winding_number(bounds.center()), Some(1.0));
        assert_eq!(first.winding_number(bounds.max), Some(0.0));
    });
}
