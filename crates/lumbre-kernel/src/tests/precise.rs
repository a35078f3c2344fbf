//! Meshes in double precision: watertight with features of a thousandth a billion units away.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform};

use super::oracle::check;
use super::scenes::{
    Random, build, bumpy, cube, icosphere, mesh, precise, ray, repeats, soup, torus, with_every_preset,
};
use crate::{Accel, BuildError, Faces, Geometry, GeometryKind, PreciseMesh, Query, TriangleMesh};

fn kind(mesh: PreciseMesh) -> GeometryKind {
    GeometryKind::PreciseMesh(Arc::new(mesh))
}

/// The mesh made small and taken far away.
fn far(mesh: &TriangleMesh, size: f64, place: DVec3) -> PreciseMesh {
    let near = precise(mesh);
    PreciseMesh {
        positions: near.positions.iter().map(|p| place + size * *p).collect(),
        indices: near.indices,
    }
}

#[test]
fn no_aimed_ray_leaks_through_fine_meshes_far_away() {
    with_every_preset(|| {
        let mut random = Random(81);
        let center = DVec3::new(2.0, -3.5, 1.25);
        let ring = DVec3::new(-0.7, 0.4, 1.1);
        for (mesh, inside) in [
            (icosphere(4, center, 2.5), center),
            (bumpy(3, center, 2.5), center),
            (torus(40, 20, 2.5, 0.75), ring + DVec3::new(2.5, 0.0, 0.0)),
        ] {
            for distance in [0.0, 1e6, 1e9] {
                let place = distance * DVec3::new(0.8, -0.3, 0.9);
                // Edges of about 1e-3.
                let fine = far(&mesh, 0.01, place);
                let accel = build(vec![kind(fine.clone())]);
                let map =
                    random.placement(DVec3::new(5.0, 6.0, -7.0), 1.0, 1.0) * Transform::translate(-place);
                let placed =
                    build(vec![GeometryKind::Instance(build(vec![kind(fine.clone())]).instance(map))]);
                let from = place + 0.01 * inside;
                for i in 0..3000 {
                    let corners = fine.corners(random.below(fine.indices.len()) as u32);
                    let along = [0.5, 0.25, random.unit()][random.below(3)];
                    let target = if i % 2 == 0 { corners[0] } else { corners[0].lerp(corners[1], along) };
                    let ray = Ray::new(from, target - from);
                    assert!(accel.closest(&ray).is_some() && accel.any(&ray), "{ray:?}");
                    assert_eq!(accel.count(&ray) % 2, 1, "{ray:?}");
                    let start = map.point(from);
                    let ray = Ray::new(start, map.point(target) - start);
                    assert_eq!(placed.count(&ray) % 2, 1, "{ray:?}");
                    let without = from + 0.3 * random.vector().normalize();
                    let line =
                        Ray::new(without, target - without).with_range(f64::NEG_INFINITY, f64::INFINITY);
                    assert_eq!(accel.count(&line) % 2, 0, "{line:?}");
                }
            }
        }
    });
}

#[test]
fn a_tree_finds_what_a_loop_finds_far_away() {
    with_every_preset(|| {
        for distance in [0.0, 1e6, 1e9] {
            let mut random = Random(82);
            let center = distance * DVec3::new(1.0, -0.5, 0.25) + DVec3::new(1.5, -2.25, 4.0);
            let mut open = far(&icosphere(2, DVec3::ZERO, 1.0), 1.0, center);
            open.indices.truncate(150);
            let fine = far(&soup(&mut random, 200, DVec3::ZERO, 3.0), 1.0, center);
            let accel = build(vec![kind(open.clone()), kind(fine), GeometryKind::Mesh(Arc::new(cube()))]);
            let (mut hits, count) = (0, repeats(1500));
            for i in 0..count {
                let mut ray = ray(&mut random, center, 3.0);
                if i % 3 == 0 {
                    // Exactly through a corner, along an axis.
                    let target = open.positions[random.below(open.positions.len())];
                    ray = Ray::new(target - 4.0 * DVec3::Z, DVec3::Z);
                }
                hits += check(&accel, &ray);
            }
            assert!(hits > count / 3, "{hits}");
        }
    });
}

#[test]
fn without_an_offset_it_answers_as_a_single_precision_mesh() {
    let mut random = Random(83);
    let center = DVec3::new(1.5, -2.25, 4.0);
    let mut ball = icosphere(3, center, 2.0);
    ball.indices.truncate(1000);
    let double = build(vec![kind(precise(&ball))]);
    let single = build(vec![GeometryKind::Mesh(Arc::new(ball.clone()))]);
    let mut hits = 0;
    for i in 0..4000 {
        let mut ray = ray(&mut random, center, 2.0);
        if i % 4 == 0 {
            let corner = ball.positions[random.below(ball.positions.len())].as_dvec3();
            ray = Ray::new(corner + 5.0 * DVec3::X, -DVec3::X);
        }
        let (a, b) = (double.closest(&ray), single.closest(&ray));
        assert_eq!(a, b);
        assert_eq!(double.count(&ray), single.count(&ray));
        for faces in [Faces::Front, Faces::Back] {
            let options = Query { faces, ..Query::new() };
            assert_eq!(double.closest_with(&ray, &options), single.closest_with(&ray, &options));
        }
        if let (Some(a), Some(b)) = (a, b) {
            hits += 1;
            let (a, b) = (double.surface(&ray, &a), single.surface(&ray, &b));
            assert_eq!((a.uv, a.dpdu, a.dpdv), (b.uv, b.dpdu, b.dpdv));
            assert!((a.point - b.point).length() < 1e-14 && (a.normal - b.normal).length() < 1e-14);
        }
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn steps_of_a_thousandth_are_told_apart_a_billion_units_away() {
    // A stair: step k is a square at the height of k thousandths, over x from k to k + 1.
    let place = DVec3::new(1e9, -1e9, 1e9);
    let step = 1.0 / 1024.0;
    let mut stair = PreciseMesh::default();
    for k in 0..64 {
        let base = stair.positions.len() as u32;
        let x = f64::from(k);
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            stair.positions.push(place + DVec3::new(x + dx, dy, x * step));
        }
        stair.indices.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    let accel = build(vec![kind(stair)]);
    for k in 0..64 {
        let x = f64::from(k);
        let ray = Ray::new(place + DVec3::new(x + 0.625, 0.25, 8.0), -DVec3::Z);
        let hit = accel.closest(&ray).unwrap();
        assert_eq!(hit.root.t, 8.0 - x * step);
        assert_eq!(hit.primitive, 2 * k as u32);
        let surface = accel.surface(&ray, &hit);
        assert_eq!(surface.point, place + DVec3::new(x + 0.625, 0.25, x * step));
        assert_eq!(surface.normal, DVec3::Z);
        assert!(surface.point_error.max_element() < 1e-6);
        // What leaves it does not meet it again, but the next step that stands in the way.
        let up = Ray::new(surface.offset_origin(DVec3::Z), DVec3::Z);
        assert!(!accel.any(&up));
        let nearest = accel.closest_point(place + DVec3::new(x + 0.5, 0.5, x * step + step / 8.0), 1.0);
        let nearest = nearest.unwrap().unwrap();
        assert_eq!((nearest.distance, nearest.primitive / 2), (step / 8.0, k as u32));
    }
}

#[test]
fn the_inside_far_away_is_known() {
    let place = 1e9 * DVec3::new(0.8, -0.3, 0.9);
    let fine = far(&bumpy(3, DVec3::ZERO, 2.5), 0.01, place);
    let accel = build(vec![kind(fine)]);
    let mut random = Random(84);
    let mut inside = 0;
    for _ in 0..300 {
        let p = place + 0.04 * random.vector();
        let expected = if accel.is_inside(p) { 1.0 } else { 0.0 };
        assert!((accel.winding_number_exact(p).unwrap() - expected).abs() < 1e-12);
        assert!((accel.winding_number(p).unwrap() - expected).abs() < 2e-3);
        inside += usize::from(expected > 0.5);
    }
    assert!(inside > 10, "{inside}");
}

#[test]
fn it_is_refitted_and_saved() {
    let ball = icosphere(3, DVec3::ZERO, 2.0);
    let at = |place: DVec3, size: f64| vec![Geometry { id: 5, kind: kind(far(&ball, size, place)) }];
    let (here, there) = (DVec3::new(1e8, 3.0, -2e8), DVec3::new(-5e8, 1.0, 2.0));
    let mut accel = Accel::build(at(here, 1.0), &Default::default()).unwrap();
    let bytes = accel.to_bytes();
    let growth = accel.refit(at(there, 0.5)).unwrap();
    assert!((0.9..1.1).contains(&growth), "{growth}");
    let loaded = Accel::from_bytes(&bytes, at(there, 0.5)).unwrap();
    let mut random = Random(85);
    let mut hits = 0;
    for _ in 0..500 {
        let ray = ray(&mut random, there, 1.0);
        hits += check(&accel, &ray);
        assert_eq!(accel.closest(&ray), loaded.closest(&ray));
    }
    assert!(hits > 100, "{hits}");
    // Triangles that lose their area are never hit, and come back with it.
    let mut flat = far(&ball, 0.5, there);
    let first = flat.positions[0];
    flat.positions.iter_mut().filter(|p| p.z > there.z).for_each(|p| *p = first);
    accel.refit(vec![Geometry { id: 5, kind: kind(flat) }]).unwrap();
    assert!(accel.primitive_count() < ball.indices.len());
    (0..500).for_each(|_| {
        check(&accel, &ray(&mut random, there, 1.0));
    });
    accel.refit(at(there, 0.5)).unwrap();
    assert_eq!(accel.primitive_count(), ball.indices.len());
}

#[test]
fn what_makes_no_mesh_is_refused() {
    let good = precise(&mesh(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], vec![[0, 1, 2], [1, 2, 3]]));
    let failure = |mesh: PreciseMesh| {
        Accel::build(vec![Geometry { id: 1, kind: kind(mesh) }], &Default::default()).map(|_| ()).unwrap_err()
    };
    let mut broken = good.clone();
    broken.positions[2].y = f64::INFINITY;
    assert_eq!(failure(broken), BuildError::NotFinite { geometry: 0, element: 2 });
    let mut broken = good.clone();
    broken.indices[1][2] = 4;
    assert_eq!(failure(broken), BuildError::VertexOutOfRange { geometry: 0, triangle: 1 });
    // Without area: never hit, and no trouble.
    let mut flat = good;
    flat.indices.push([2, 1, 2]);
    let accel = build(vec![kind(flat)]);
    assert_eq!(accel.primitive_count(), 2);
}
