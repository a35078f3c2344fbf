//! Inside or not: bodies of every kind, within each other, mirrored, and far away.

use std::sync::Arc;

use lumbre_geometry::{Cuboid, PlacedShape, Plane, Sphere, Torus};
use lumbre_math::{DVec3, Transform};

use super::scenes::{Random, balls, build, bumpy, cube, icosphere, torus, with_every_preset};
use crate::{Accel, GeometryKind, TriangleMesh};

fn mesh(mesh: TriangleMesh) -> GeometryKind {
    GeometryKind::Mesh(Arc::new(mesh))
}

fn placed(accel: Accel, world_from_object: Transform) -> GeometryKind {
    GeometryKind::Instance(accel.instance(world_from_object))
}

#[test]
fn closed_meshes_know_what_is_inside_under_every_map() {
    with_every_preset(|| {
        let mut random = Random(61);
        let is_in_cube = |p: DVec3| {
            let p = (p - DVec3::new(0.5, -1.0, 3.0)) / 2.5;
            p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::ONE).all()
        };
        let maps = [
            Transform::IDENTITY,
            Transform::translate(DVec3::new(1e6, -3e6, 2e6)),
            Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap(),
            random.placement(DVec3::new(5.0, 6.0, -7.0), 1.0, 1e-5),
        ];
        for map in maps {
            let accel = build(vec![placed(build(vec![mesh(cube())]), map)]);
            let mut inside = 0;
            for _ in 0..500 {
                let p = DVec3::new(1.75, 0.25, 4.25) + 2.5 * random.vector();
                assert_eq!(accel.is_inside(map.point(p)), is_in_cube(p), "{p}");
                inside += usize::from(is_in_cube(p));
            }
            assert!(inside > 30);
        }
    });
}

#[test]
fn a_rocks_inside_is_where_its_center_sees_no_surface() {
    let center = DVec3::new(2.0, -3.5, 1.25);
    let accel = build(vec![mesh(bumpy(4, center, 2.5))]);
    let mut random = Random(62);
    let mut inside = 0;
    for _ in 0..3000 {
        let p = center + 3.5 * random.vector();
        let ray = lumbre_geometry::Ray::new(center, p - center).with_range(0.0, 1.0);
        let sees = !accel.any(&ray);
        assert_eq!(accel.is_inside(p), sees, "{p}");
        inside += usize::from(sees);
    }
    assert!(inside > 500 && inside < 2000, "{inside}");
}

#[test]
fn bodies_within_bodies_alternate() {
    let center = DVec3::new(2.0, -3.5, 1.25);
    let shell = |radius: f64| mesh(icosphere(3, center, radius));
    let ball = Sphere::new(center, 0.4).unwrap();
    let accel = build(vec![
        shell(3.0),
        shell(2.0),
        shell(1.0),
        GeometryKind::Shape(PlacedShape::new(ball.into(), Transform::IDENTITY)),
    ]);
    for (distance, expected) in [(0.2, false), (0.7, true), (1.5, false), (2.5, true), (3.5, false)] {
        for direction in [DVec3::X, DVec3::new(0.1, -0.7, 0.3).normalize(), -DVec3::Z] {
            assert_eq!(accel.is_inside(center + distance * direction), expected, "{distance}");
        }
    }
}

#[test]
fn shapes_say_what_they_hold_and_infinite_ones_too() {
    let cuboid = Cuboid::new(DVec3::new(-1.0, -2.0, -3.0), DVec3::new(1.5, 2.5, 0.5)).unwrap();
    let ring = Torus::new(DVec3::ZERO, DVec3::Z, 2.0, 0.5).unwrap();
    let ground = Plane::new(DVec3::new(0.0, 0.0, -9.0), DVec3::Z).unwrap();
    let place = Transform::translate(DVec3::new(7.0, 8.0, 9.0))
        * Transform::scale(DVec3::new(1.0, -0.5, 2.0)).unwrap();
    let inner = build(vec![GeometryKind::Shape(PlacedShape::new(ring.into(), place))]);
    let accel = build(vec![
        GeometryKind::Shape(PlacedShape::new(cuboid.into(), Transform::IDENTITY)),
        GeometryKind::Shape(PlacedShape::new(ground.into(), Transform::IDENTITY)),
        placed(inner, place),
        mesh(torus(40, 20, 2.5, 0.75)),
    ]);
    assert!(accel.is_inside(DVec3::new(1.4, 2.4, -2.9)));
    assert!(!accel.is_inside(DVec3::new(1.6, 2.4, -2.9)));
    assert!(accel.is_inside(DVec3::new(1e6, 0.0, -9.1)) && !accel.is_inside(DVec3::new(1e6, 0.0, -8.9)));
    assert!(accel.is_inside((place * place).point(DVec3::new(2.0, 0.1, 0.1))));
    assert!(!accel.is_inside((place * place).point(DVec3::new(0.3, 0.1, 0.1))));
    // In the tube of the mesh, which the box does not reach.
    assert!(accel.is_inside(DVec3::new(-0.7 + 2.5, 0.4, 1.1)));
}

#[test]
fn points_in_face_planes_and_edge_lines_are_classified() {
    let accel = build(vec![mesh(cube())]);
    let low = DVec3::new(0.5, -1.0, 3.0);
    for (place, expected) in [
        (DVec3::new(-1.0, 0.0, 0.0), false),
        (DVec3::new(0.0, 0.0, 5.0), false),
        (DVec3::new(1.25, 1.25, 1.25), true),
        (DVec3::new(-1.0, -1.0, -1.0), false),
        (DVec3::new(1.25, 1.25, -2.0), false),
        (DVec3::new(1.25, 1.25, 2.5f64.next_down()), true),
    ] {
        assert_eq!(accel.is_inside(low + place), expected, "{place}");
    }
    assert!(!accel.is_inside(DVec3::new(1e9, -2e9, 3e9)));
    assert!(!accel.is_inside(DVec3::new(f64::NAN, 0.0, 0.0)));
    assert!(!build(vec![]).is_inside(low));
}

#[test]
fn strangers_geometry_counts_by_its_crossings() {
    let mut random = Random(64);
    let stranger = balls(&mut random, 30, DVec3::ONE, 2.0, None);
    let held = stranger.balls.clone();
    let accel = build(vec![GeometryKind::Custom(Arc::new(stranger))]);
    let mut odd = 0;
    for _ in 0..500 {
        let p = DVec3::ONE + 2.0 * random.vector();
        let count = held.iter().filter(|(center, radius)| (p - *center).length() < *radius).count();
        assert_eq!(accel.is_inside(p), count % 2 == 1);
        odd += count % 2;
    }
    assert!(odd > 10, "{odd}");
}

#[test]
fn what_moves_is_where_it_is_at_that_time() {
    use lumbre_math::AnimatedTransform;
    let slide = |x: f64| Transform::translate(DVec3::new(x, 0.0, 0.0));
    let motion = AnimatedTransform::new(vec![(0.0, slide(0.0)), (1.0, slide(8.0))]).unwrap();
    let inner = Arc::new(build(vec![mesh(cube())]));
    let accel = build(vec![GeometryKind::Instance(inner.instance(motion))]);
    let middle = DVec3::new(1.75, 0.25, 4.25);
    for (time, x) in [(0.0, 0.0), (0.5, 4.0), (1.0, 8.0)] {
        let there = middle + DVec3::new(x, 0.0, 0.0);
        for (p, expected) in [(there, true), (there + DVec3::new(2.0, 0.0, 0.0), false)] {
            assert_eq!(accel.is_inside_at(p, time), expected);
            let number = accel.winding_number_at(p, time).unwrap();
            assert!((number - f64::from(u8::from(expected))).abs() < 2e-3);
        }
        let nearest = accel.closest_point_at(there + DVec3::new(3.25, 0.0, 0.0), 9.0, time).unwrap().unwrap();
        assert!((nearest.distance - 2.0).abs() < 1e-12);
    }
    assert!(accel.is_inside(middle));
}
