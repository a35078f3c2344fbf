//! Winding numbers: whole around closed meshes, by the sky that open ones fill, and the fast sum against the exact one.

use std::f64::consts::PI;
use std::sync::Arc;

use lumbre_geometry::{Disk, PlacedShape, Sphere, Torus, Triangle};
use lumbre_math::{DVec3, Transform, Vec3};

use super::scenes::{Random, balls, build, bumpy, cube, icosphere, mesh, soup, torus, with_every_preset};
use crate::point::winding::winding_number;
use crate::{Accel, Geometry, GeometryKind, TriangleMesh};

fn kind(mesh: TriangleMesh) -> GeometryKind {
    GeometryKind::Mesh(Arc::new(mesh))
}

fn placed(accel: &Arc<Accel>, world_from_object: Transform) -> GeometryKind {
    GeometryKind::Instance(accel.instance(world_from_object))
}

fn turned_inside_out(mesh: &TriangleMesh) -> TriangleMesh {
    TriangleMesh { indices: mesh.indices.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..mesh.clone() }
}

#[track_caller]
fn exactly(accel: &Accel, point: DVec3, expected: f64) {
    let found = accel.winding_number_exact(point).unwrap();
    assert!((found - expected).abs() < 1e-12, "{found} instead of {expected} at {point}");
    let found = accel.winding_number(point).unwrap();
    assert!((found - expected).abs() < 2e-3, "{found} instead of {expected} at {point}, fast");
}

#[test]
fn around_closed_meshes_it_is_whole_and_agrees_with_the_parity() {
    with_every_preset(|| {
        let mut random = Random(71);
        let center = DVec3::new(2.0, -3.5, 1.25);
        for mesh in [cube(), bumpy(3, center, 2.5), torus(40, 20, 2.5, 0.75)] {
            let accel = build(vec![kind(mesh)]);
            let bounds = accel.bounds();
            let mut inside = 0;
            for _ in 0..500 {
                let p = bounds.center() + 0.8 * bounds.size() * random.vector();
                let expected = if accel.is_inside(p) { 1.0 } else { 0.0 };
                exactly(&accel, p, expected);
                inside += usize::from(expected > 0.5);
            }
            assert!(inside > 10, "{inside}");
        }
    });
}

#[test]
fn nested_bodies_add_and_inverted_ones_subtract() {
    let center = DVec3::new(2.0, -3.5, 1.25);
    let shell = |radius: f64| icosphere(3, center, radius);
    let ball = Sphere::new(center, 0.5).unwrap();
    let accel = build(vec![
        kind(shell(3.0)),
        kind(turned_inside_out(&shell(2.0))),
        kind(turned_inside_out(&shell(1.0))),
        GeometryKind::Shape(PlacedShape::new(ball.into(), Transform::IDENTITY)),
    ]);
    for (distance, expected) in [(0.2, 0.0), (0.7, -1.0), (1.5, 0.0), (2.5, 1.0), (3.5, 0.0)] {
        exactly(&accel, center + distance * DVec3::new(0.3, 0.6, -0.7).normalize(), expected);
    }
}

#[test]
fn instances_keep_the_sides_of_their_meshes() {
    let mut random = Random(72);
    let inner = Arc::new(build(vec![kind(cube())]));
    let middle = DVec3::new(1.75, 0.25, 4.25);
    for map in [
        Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap(),
        Transform::scale(DVec3::new(-3.0, 0.2, 1.0)).unwrap(),
        random.placement(DVec3::new(5.0, 6.0, -7.0), 1.0, 1e-5),
        Transform::translate(DVec3::new(1e6, -3e6, 2e6)),
    ] {
        let accel = build(vec![placed(&inner, map), placed(&inner, map)]);
        exactly(&accel, map.point(middle), 2.0);
        exactly(&accel, map.point(middle + DVec3::new(0.0, 2.0, 0.0)), 0.0);
    }
}

#[test]
fn an_open_mesh_counts_by_the_sky_that_it_fills() {
    // A cube without its face at y = 1.5, seen from over that face and from its middle.
    let mut open = cube();
    open.indices.retain(|triangle| triangle.iter().any(|&vertex| open.positions[vertex as usize].y < 1.0));
    assert_eq!(open.indices.len(), 10);
    let accel = build(vec![kind(open.clone())]);
    exactly(&accel, DVec3::new(1.75, 0.25, 4.25), 5.0 / 6.0);
    // From above, the rest fills what the missing face would hide, and is seen from behind.
    let height: f64 = 1.25;
    let eye = DVec3::new(1.75, 1.5 + height, 4.25);
    let half = 1.25;
    let sky = 4.0 * (half * half / (height * (height * height + 2.0 * half * half).sqrt())).atan();
    exactly(&accel, eye, sky / (4.0 * PI));
    // Stretched, by the sky that the stretched one fills.
    let stretch = Transform::scale(DVec3::new(1.0, 3.0, 1.0)).unwrap();
    let tall = build(vec![placed(&Arc::new(accel), stretch)]);
    let positions = open.positions.iter().map(|p| *p * Vec3::new(1.0, 3.0, 1.0)).collect();
    let baked = build(vec![kind(TriangleMesh { positions, ..open })]);
    let mut random = Random(73);
    for _ in 0..100 {
        let p = DVec3::new(1.75, 0.75, 4.25) + 4.0 * random.vector();
        exactly(&tall, p, baked.winding_number_exact(p).unwrap());
    }
    let mirrored = Transform::scale(DVec3::new(1.0, -1.0, 1.0)).unwrap();
    let p = DVec3::new(1.0, 0.7, 4.0);
    let expected = tall.winding_number_exact(p).unwrap();
    let upside_down = build(vec![placed(&Arc::new(tall), mirrored)]);
    exactly(&upside_down, mirrored.point(p), expected);
}

#[test]
fn points_in_face_planes_and_far_away_have_valid_numbers() {
    let accel = build(vec![kind(cube())]);
    let low = DVec3::new(0.5, -1.0, 3.0);
    for place in [
        DVec3::new(-1.0, 0.0, 0.0),
        DVec3::new(0.0, 0.0, 5.0),
        DVec3::new(-1.0, -1.0, -1.0),
        DVec3::new(1.0, 2.5, -2.0),
        DVec3::new(3.0, 2.5, 2.5),
    ] {
        exactly(&accel, low + place, 0.0);
    }
    for far in [1e6, 1e9, 1e100] {
        exactly(&accel, far * DVec3::new(0.3, -0.5, 0.7), 0.0);
    }
    assert_eq!(accel.winding_number(DVec3::new(0.0, f64::NAN, 0.0)), Ok(0.0));
    assert_eq!(build(vec![]).winding_number(low), Ok(0.0));
    // On a corner it is a number.
    assert!(accel.winding_number(low).unwrap().is_finite());
}

#[test]
fn the_fast_sum_is_near_the_exact_one() {
    with_every_preset(|| {
        let mut random = Random(74);
        let center = DVec3::new(2.0, -3.5, 1.25);
        let rock = bumpy(5, center, 2.5);
        let half = TriangleMesh { indices: rock.indices[..10_000].to_vec(), ..rock.clone() };
        let small = Transform::translate(1e5 * center) * Transform::scale(DVec3::splat(-1e-3)).unwrap();
        let worst_of = |accel: &Accel, map: &Transform, random: &mut Random| {
            let worst = (0..200).map(|_| {
                let reach = 10f64.powf(random.between(0.0, 1.5));
                let p = map.point(center + reach * random.vector());
                (accel.winding_number(p).unwrap() - accel.winding_number_exact(p).unwrap()).abs()
            });
            worst.fold(0.0, f64::max)
        };
        for mesh in [rock, half, soup(&mut random, 5000, center, 3.0)] {
            let accel = build(vec![kind(mesh)]);
            let worst = worst_of(&accel, &Transform::IDENTITY, &mut random);
            eprintln!("{worst:e}");
            assert!(worst < 2e-3, "{worst}");
            let accel = build(vec![placed(&Arc::new(accel), small)]);
            let worst = worst_of(&accel, &small, &mut random);
            assert!(worst < 2e-3, "{worst}");
        }
    });
}

#[test]
fn a_refit_moves_what_is_wound_around() {
    let geometry = |origin: DVec3| {
        vec![Geometry { id: 3, kind: kind(TriangleMesh { origin, ..icosphere(3, DVec3::ZERO, 1.5) }) }]
    };
    let (here, there) = (DVec3::new(2.0, -3.5, 1.25), DVec3::new(-9.0, 8.0, 7.0));
    let mut accel = Accel::build(geometry(here), &Default::default()).unwrap();
    exactly(&accel, here, 1.0);
    accel.refit(geometry(there)).unwrap();
    exactly(&accel, here, 0.0);
    exactly(&accel, there, 1.0);
}

#[test]
fn what_has_no_number_says_so() {
    let shape =
        |shape: lumbre_geometry::Shape| GeometryKind::Shape(PlacedShape::new(shape, Transform::IDENTITY));
    let disk = Disk::new(DVec3::ONE, DVec3::Z, 1.5, 0.0).unwrap();
    let accel = build(vec![kind(cube()), shape(disk.into())]);
    assert_eq!(accel.winding_number(DVec3::ZERO).unwrap_err().geometry, 1);
    let strangers = GeometryKind::Custom(Arc::new(balls(&mut Random(1), 3, DVec3::ONE, 2.0, None)));
    let inner = Arc::new(build(vec![strangers]));
    let no = build(vec![placed(&inner, Transform::IDENTITY)]).winding_number(DVec3::ZERO).unwrap_err();
    assert_eq!((no.id, no.instances.as_slice()), (1000, &[1000][..]));
    // A torus and a triangle have one.
    let ring = Torus::new(DVec3::ONE, DVec3::Z, 2.5, 0.5).unwrap();
    let corners = [DVec3::new(0.0, 0.0, -3.0), DVec3::new(4.0, 0.0, -3.0), DVec3::new(0.0, 5.0, -3.0)];
    let triangle = Triangle::new(corners[0], corners[1], corners[2]).unwrap();
    let accel = build(vec![shape(ring.into()), shape(triangle.into())]);
    let alone = build(vec![kind(mesh(corners.to_vec(), vec![[0, 1, 2]]))]);
    let p = DVec3::new(3.5, 1.2, 1.1);
    exactly(&accel, p, 1.0 + alone.winding_number_exact(p).unwrap());
}

#[test]
#[ignore = "prints how large errors are, and how long sums take"]
fn errors_and_times_of_fast_sums() {
    let mut random = Random(75);
    let center = DVec3::new(2.0, -3.5, 1.25);
    let accel = build(vec![kind(bumpy(6, center, 2.5))]);
    let points: Vec<DVec3> =
        (0..2000).map(|_| center + 10f64.powf(random.between(0.0, 1.5)) * random.vector()).collect();
    let all = |far: Option<f64>| -> (Vec<f64>, f64) {
        accel.winding_number(center).unwrap();
        let start = std::time::Instant::now();
        let numbers = points.iter().map(|&p| winding_number(&accel.tree, p, 0.0, far).unwrap()).collect();
        (numbers, start.elapsed().as_secs_f64() * 1e6 / points.len() as f64)
    };
    let (exact, exact_time) = all(None);
    eprintln!("exact: {exact_time:.1} us");
    for far in [1.5, 2.0, 2.5, 3.0, 4.0, 6.0] {
        let (fast, time) = all(Some(far));
        let worst = fast.iter().zip(&exact).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
        eprintln!("far from {far} radii on: {worst:.1e}, {time:.2} us");
    }
}
