//! Of two crossings at one `t`, the one that enters comes first.

use std::ops::ControlFlow;
use std::sync::Arc;

use lumbre_geometry::{BilinearPatch, PlacedShape, Ray};
use lumbre_math::{DVec3, Transform};

use super::oracle::check;
use super::scenes::{build, mesh};
use crate::{Accel, GeometryKind, Query, Ray32};

/// A roof along y whose ridge is at height 2, the slope towards negative x first or last in the list.
fn roof(is_first: bool, in_one: bool) -> Accel {
    let corners = [
        [-3.0, -1.5, 0.0],
        [3.0, -1.5, 0.0],
        [3.0, 1.5, 0.0],
        [-3.0, 1.5, 0.0],
        [0.0, -1.5, 2.0],
        [0.0, 1.5, 2.0],
    ];
    let left = vec![[3, 0, 4], [3, 4, 5]];
    let right = vec![[1, 2, 5], [1, 5, 4]];
    let (first, last) = if is_first { (left, right) } else { (right, left) };
    let of = |indices: Vec<[u32; 3]>| {
        GeometryKind::Mesh(Arc::new(mesh(corners.map(DVec3::from_array).to_vec(), indices)))
    };
    build(if in_one { vec![of([first, last].concat())] } else { vec![of(first), of(last)] })
}

fn enters(accel: &Accel, ray: &Ray) -> Vec<bool> {
    let mut faces = Vec::new();
    accel.all(ray, |hit| {
        faces.push(accel.surface(ray, hit).normal.dot(ray.direction) < 0.0);
        ControlFlow::Continue(())
    });
    faces
}

#[test]
fn a_ray_that_grazes_a_ridge_enters_before_it_leaves() {
    for accel in [(true, true), (false, true), (true, false), (false, false)].map(|(a, b)| roof(a, b)) {
        let mut ties = 0;
        for (step, x) in (1..40).flat_map(|step| [(step, -7.0), (step, 7.0)]) {
            let height = 2.0 - f64::from(step) * f64::EPSILON;
            let ray = Ray::new(DVec3::new(x, 0.1, height), DVec3::new(-x, 0.0, 0.0));
            assert_eq!(check(&accel, &ray), 2, "{ray:?}");
            assert_eq!(enters(&accel, &ray), [true, false], "{ray:?}");
            let hit = accel.closest(&ray).unwrap();
            assert!(accel.surface(&ray, &hit).normal.x * x > 0.0, "{ray:?}");
            assert_eq!(accel.closest_with(&ray, &Query::new()), Some(hit.clone()));
            let mut batch = [None, None];
            accel.closest_batch(&[ray, ray], &mut batch);
            assert_eq!(batch, [Some(hit.clone()), Some(hit.clone())]);
            let mut ts = Vec::new();
            accel.all(&ray, |hit| {
                ts.push(hit.root.t);
                ControlFlow::Continue(())
            });
            ties += usize::from(ts[0] == ts[1]);

            let height = 2.0 - step as f32 * f32::EPSILON;
            let from = DVec3::new(x, 0.1, f64::from(height));
            let ray = Ray32::new(from.as_vec3(), DVec3::new(-x, 0.0, 0.0).as_vec3());
            let hit = accel.closest_f32(&ray).unwrap();
            let wide = roof_normal(&accel, hit.geometry, hit.primitive);
            assert!(wide * x > 0.0, "{ray:?}");
        }
        assert!(ties > 0, "no ray meets both slopes at one t");
    }
}

/// The x of a triangle's normal.
fn roof_normal(accel: &Accel, geometry: u32, primitive: u32) -> f64 {
    let GeometryKind::Mesh(mesh) = &accel.tree.geometries[geometry as usize].kind else {
        unreachable!("a mesh")
    };
    let [a, b, c] = mesh.indices[primitive as usize].map(|i| mesh.positions[i as usize].as_dvec3());
    (b - a).cross(c - a).x
}

#[test]
fn a_ridge_of_patches_is_entered_before_it_is_left() {
    let v = DVec3::new;
    let left = BilinearPatch::new(v(-3.0, -1.5, 0.0), v(0.0, -1.5, 2.0), v(-3.0, 1.5, 0.0), v(0.0, 1.5, 2.0));
    let right = BilinearPatch::new(v(0.0, -1.5, 2.0), v(3.0, -1.5, 0.0), v(0.0, 1.5, 2.0), v(3.0, 1.5, 0.0));
    let kind =
        |patch: BilinearPatch| GeometryKind::Shape(PlacedShape::new(patch.into(), Transform::IDENTITY));
    let (left, right) = (left.unwrap(), right.unwrap());
    for accel in [build(vec![kind(left), kind(right)]), build(vec![kind(right), kind(left)])] {
        for step in 1..40 {
            let height = 2.0 - f64::from(step) * f64::EPSILON;
            for x in [-7.0, 7.0] {
                let ray = Ray::new(v(x, 0.1, height), v(-x, 0.0, 0.0));
                assert_eq!(check(&accel, &ray), 2, "{ray:?}");
                assert_eq!(enters(&accel, &ray), [true, false], "{ray:?}");
            }
        }
    }
}
