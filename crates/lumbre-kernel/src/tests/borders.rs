//! Edges and corners of open meshes count, once; so do those inside.

use std::sync::Arc;

use lumbre_geometry::{PlacedShape, Ray, Triangle};
use lumbre_math::{DVec3, Transform};

use super::oracle::check;
use super::scenes::{Random, build, mesh, vertex};
use crate::{GeometryKind, TriangleMesh};

/// A fan of `n` triangles about a vertex, over part of a turn, and tilted.
fn fan(n: u32, turns: f64) -> TriangleMesh {
    let center = DVec3::new(0.5, -0.25, 2.0);
    let mut positions = vec![center];
    for i in 0..=n {
        let azimuth = std::f64::consts::TAU * turns * f64::from(i) / f64::from(n) + 0.3;
        positions.push(center + 1.5 * DVec3::new(azimuth.cos(), azimuth.sin(), 0.4 * azimuth.cos()));
    }
    mesh(positions, (0..n).map(|i| [0, i + 1, i + 2]).collect())
}

#[test]
fn a_rim_counts_once_from_every_side() {
    let mut random = Random(41);
    for (n, turns) in [(1, 0.2), (2, 0.3), (3, 0.4), (4, 0.5), (5, 0.7), (7, 0.9)] {
        let fan = fan(n, turns);
        let accel = build(vec![GeometryKind::Mesh(Arc::new(fan.clone()))]);
        for _ in 0..400 {
            let triangle = fan.indices[random.below(fan.indices.len())].map(|i| vertex(&fan, i));
            let corner = random.below(3);
            let along = [0.0, 0.5, 0.25][random.below(3)];
            let target = triangle[corner].lerp(triangle[(corner + 1) % 3], along);
            // Exactly through the target: along an axis.
            let offset = DVec3::new(0.0, 0.0, [4.0, -4.0][random.below(2)]);
            let ray = Ray::new(target + offset, -offset);
            let count = check(&accel, &ray);
            // A point on an edge is rounded, and may lie beyond the rim.
            assert!(count == 1 || (count == 0 && along > 0.0), "{count} {ray:?}");
        }
    }
}

#[test]
fn a_lone_triangle_is_closed_like_the_exact_one() {
    let corners = [DVec3::new(0.0, 1.0, 2.0), DVec3::new(8.0, -3.0, 2.0), DVec3::new(4.0, 5.0, 6.0)];
    let mesh = build(vec![GeometryKind::Mesh(Arc::new(mesh(corners.to_vec(), vec![[0, 1, 2]])))]);
    let [a, b, c] = corners;
    let exact = build(vec![GeometryKind::Shape(PlacedShape::new(
        Triangle::new(a, b, c).unwrap().into(),
        Transform::IDENTITY,
    ))]);
    let mut hits = 0;
    for i in 0..=40 {
        for j in 0..=40 {
            let at = DVec3::new(0.25 * f64::from(i) - 1.0, 0.25 * f64::from(j) - 4.0, -3.0);
            let ray = Ray::new(at, DVec3::new(0.0, 0.0, 2.0));
            assert_eq!(check(&mesh, &ray), exact.count(&ray), "{ray:?}");
            hits += mesh.count(&ray);
        }
    }
    assert!(hits > 200, "{hits}");
}

#[test]
fn a_grid_of_quads_is_crossed_once_everywhere() {
    // Rays at every vertex, edge middle and centre of a flat grid, split vertices or shared, rims included.
    for is_split in [false, true] {
        let mut positions = Vec::new();
        let mut indices = Vec::new();
        let at = |i: u32, j: u32| DVec3::new(f64::from(i) - 1.0, f64::from(j) + 2.0, 0.5 * f64::from(i));
        for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
            let base = positions.len() as u32;
            positions.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            indices.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
        let mut mesh = mesh(positions, indices);
        if !is_split {
            let position = mesh.positions.clone();
            for index in mesh.indices.as_flattened_mut() {
                *index = position.iter().position(|p| *p == position[*index as usize]).unwrap() as u32;
            }
        }
        let accel = build(vec![GeometryKind::Mesh(Arc::new(mesh))]);
        for (i, j) in (0..=20).flat_map(|i| (0..=20).map(move |j| (i, j))) {
            let start = DVec3::new(0.25 * f64::from(i) - 1.0, 0.25 * f64::from(j) + 2.0, 9.0);
            for direction in [DVec3::new(0.0, 0.0, -2.0), DVec3::new(-0.0, 0.0, -1.0)] {
                let ray = Ray::new(start, direction);
                assert_eq!(check(&accel, &ray), 1, "{ray:?}");
                let back = Ray::new(start + 16.0 * direction, -direction);
                assert_eq!(check(&accel, &back), 1, "{back:?}");
            }
        }
    }
}

#[test]
fn the_outline_of_a_closed_mesh_is_even() {
    let accel = build(vec![GeometryKind::Mesh(Arc::new(super::scenes::cube()))]);
    // Along faces, along edges, and across corners from outside: the cube spans (0.5, -1, 3) to (3, 1.5, 5.5).
    let mut hits = 0;
    for (i, j) in (0..=10).flat_map(|i| (0..=10).map(move |j| (i, j))) {
        let (x, y) = (0.5 + 0.25 * f64::from(i), -1.0 + 0.25 * f64::from(j));
        for direction in
            [DVec3::Z, DVec3::new(1.0, 1.0, 1.0), DVec3::new(-1.0, 1.0, 0.0), DVec3::new(0.0, -1.0, 1.0)]
        {
            let ray = Ray::new(DVec3::new(x, y, 3.0) - 8.0 * direction, direction);
            let count = check(&accel, &ray);
            assert_eq!(count % 2, 0, "{count} {ray:?}");
            hits += count;
        }
    }
    assert!(hits > 400, "{hits}");
}
