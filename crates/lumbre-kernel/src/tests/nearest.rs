//! Nearest points against a loop over everything.

use std::sync::Arc;

use lumbre_geometry::{NearestPointError, PlacedShape, Plane, Shape, Sphere, Torus};
use lumbre_math::{DVec3, Transform};

use super::scenes::{
    Random, balls, build, bumpy, cloud, cube, icosphere, mixture, precise, soup, with_every_preset,
};
use crate::point::closest_point::{Frame, Search};
use crate::{Accel, ClosestPoint, Geometry, GeometryKind, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// The loop: everything that has an answer, whatever has none, and all together.
fn by_loop(accel: &Accel, point: DVec3, max_distance: f64) -> (Option<ClosestPoint>, bool) {
    let mut frames = vec![Frame::outermost(&accel.tree, point, 0.0)];
    let mut search = Search::new(point, max_distance);
    let mut position = 0;
    while position < frames.len() {
        let mut inner = Vec::new();
        let frame = &frames[position];
        for (geometry, standing) in frame.tree.geometries.iter().enumerate() {
            let geometry = geometry as u32;
            match &standing.kind {
                GeometryKind::Mesh(mesh) => {
                    for primitive in 0..mesh.indices.len() as u32 {
                        search.intersect_triangle(frame, mesh, geometry, primitive);
                    }
                }
                GeometryKind::Instance(instance) => {
                    inner.push(frame.within(geometry, instance));
                }
                GeometryKind::PreciseMesh(mesh) => {
                    for primitive in 0..mesh.indices.len() as u32 {
                        search.meet(frame, geometry, primitive, 0.0);
                    }
                }
                GeometryKind::Shape(_) => search.meet(frame, geometry, 0, 0.0),
                GeometryKind::Spheres(cloud) => {
                    for primitive in 0..cloud.spheres.len() as u32 {
                        search.meet(frame, geometry, primitive, 0.0);
                    }
                }
                GeometryKind::Custom(custom) => {
                    for primitive in 0..custom.primitive_count() {
                        search.meet(frame, geometry, primitive, 0.0);
                    }
                }
            }
        }
        frames.extend(inner);
        position += 1;
    }
    search.into_parts()
}

/// Asks the tree and the loop; answers whether there was an answer, and whether it was a point.
fn check(accel: &Accel, point: DVec3, max_distance: f64) -> (bool, bool) {
    let (expected, all_answered) = by_loop(accel, point, max_distance);
    match accel.closest_point(point, max_distance) {
        Ok(found) => {
            assert_eq!(found, expected, "{point} {max_distance}");
            if let Some(found) = &found {
                let rounding = 1e-12 * (point.abs() + found.point.abs()).max_element();
                assert!(((found.point - point).length() - found.distance).abs() <= rounding);
                assert!(found.distance <= max_distance);
            }
            (true, found.is_some())
        }
        Err(no) => {
            assert!(!all_answered, "{no}");
            (false, false)
        }
    }
}

/// Triangles, most without area: lines, and points.
fn flat_soup(random: &mut Random, count: usize, center: DVec3, extent: f64) -> TriangleMesh {
    let mut mesh = soup(random, count, center, extent);
    for (i, triangle) in mesh.indices.iter_mut().enumerate() {
        let [a, b, _] = *triangle;
        match i % 4 {
            0 => *triangle = [a; 3],
            1 => *triangle = [a, b, a],
            // A corner half way between two others, where single precision has such a place.
            2 => {
                let ends = [a, b].map(|vertex| mesh.positions[vertex as usize]);
                let [start, end] = ends.map(|p| (16.0 * p).round() / 16.0);
                let first = mesh.positions.len() as u32;
                mesh.positions.extend([start, end, 0.5 * (start + end)]);
                *triangle = [first, first + 1, first + 2];
            }
            _ => {}
        }
    }
    mesh
}

#[test]
fn what_has_no_area_is_as_near_as_it_is_and_no_ray_hits_it() {
    let mut random = Random(31);
    let mut found = [0; 2];
    for center in [CENTER, 1000.0 * CENTER] {
        let mesh = flat_soup(&mut random, 240, center, 3.0);
        let flats: Vec<u32> = (0..240).filter(|i| i % 4 != 3).collect();
        let mut precise_mesh = precise(&flat_soup(&mut random, 40, center, 3.0));
        precise_mesh.indices.truncate(39);
        let mut dust = cloud(&mut random, 30, center, center, 3.0);
        dust.spheres.iter_mut().step_by(2).for_each(|sphere| sphere[3] = 0.0);
        let inner =
            Arc::new(build(vec![GeometryKind::Mesh(Arc::new(flat_soup(&mut random, 60, center, 0.5)))]));
        // Nothing in it has an area, so no tree of its own holds the instance.
        let mut points = flat_soup(&mut random, 20, center, 0.5);
        points.indices.iter_mut().for_each(|triangle| *triangle = [triangle[0]; 3]);
        let points = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(points))]));
        let nested = Arc::new(build(vec![GeometryKind::Instance(
            points.instance(Transform::translate(DVec3::new(0.5, 0.25, -1.0))),
        )]));
        let mut kinds = vec![
            GeometryKind::Mesh(Arc::new(mesh)),
            GeometryKind::PreciseMesh(Arc::new(precise_mesh)),
            GeometryKind::Spheres(Arc::new(dust)),
        ];
        for accel in [&inner, &points, &nested] {
            for _ in 0..4 {
                let map = random.placement(center, 4.0, 0.5) * Transform::translate(-center);
                let accel = Arc::clone(accel);
                kinds.push(GeometryKind::Instance(accel.instance(map)));
            }
        }
        let accel = build(kinds);
        for _ in 0..600 {
            let point = somewhere(&mut random, center, 4.0);
            let reach = [1.0, f64::INFINITY][random.below(2)];
            let (answered, is_there) = check(&accel, point, reach);
            assert!(answered);
            found[usize::from(is_there)] += 1;
            let Ok(Some(nearest)) = accel.closest_point(point, f64::INFINITY) else { panic!("nothing near") };
            if nearest.geometry == 0 && flats.contains(&nearest.primitive) {
                let way = nearest.point - point;
                let ray = lumbre_geometry::Ray::new(point, way);
                let hit = accel.closest(&ray);
                assert!(hit.is_none_or(|hit| hit.geometry != 0 || hit.primitive != nearest.primitive));
            }
        }
    }
    assert!(found[0] > 100 && found[1] > 600, "{found:?}");
}

#[test]
fn a_needle_and_a_point_have_the_distances_that_they_have() {
    // A triangle on a line of the x axis, one in a point, and one on a line far away, and two with an area.
    let vertices =
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [5, 5, 5], [10, 10, 10], [10, 10, 12], [10, 10, 11]];
    let positions = vertices.map(|p: [i32; 3]| lumbre_math::Vec3::from_array(p.map(|c| c as f32))).to_vec();
    let indices = vec![[0, 1, 2], [4, 4, 4], [5, 6, 7], [0, 2, 3], [5, 5, 6]];
    let mesh = TriangleMesh { origin: DVec3::ZERO, positions, indices };
    let accel = build(vec![GeometryKind::Mesh(Arc::new(mesh))]);
    let expected = [
        ([1.3, -1.0, 0.0], 1.0),
        ([5.0, 5.0, 6.0], 1.0),
        ([10.0, 11.0, 11.5], 1.0),
        ([10.0, 10.0, 13.0], 1.0),
        ([0.2, 0.2, 3.0], 3.0),
        ([5.1, 5.0, 5.0], 0.1),
        ([1.5, 0.0, 0.0], 0.0),
    ];
    for (point, distance) in expected {
        let found = accel.closest_point(DVec3::from_array(point), f64::INFINITY).unwrap().unwrap();
        assert!((found.distance - distance).abs() < 1e-12, "{point:?}: {}", found.distance);
    }
}

fn similar(random: &mut Random, center: DVec3, spread: f64) -> Transform {
    let size = random.between(0.2, 1.5);
    let mirror = if random.unit() < 0.3 { -1.0 } else { 1.0 };
    Transform::translate(center + spread * random.vector())
        * Transform::rotate(random.vector(), random.between(-180.0, 180.0)).unwrap()
        * Transform::scale(DVec3::new(mirror * size, size, size)).unwrap()
}

/// Meshes, shapes where they have a method, balls of a user's, instances of all that and of meshes under any map.
fn answerable(random: &mut Random, center: DVec3, extent: f64, depth: u32) -> Accel {
    let mut kinds = vec![GeometryKind::Mesh(Arc::new(soup(random, 90, center, extent)))];
    let spheres = cloud(random, 12, center, center, extent);
    kinds.push(GeometryKind::Spheres(Arc::new(spheres)));
    for _ in 0..12 {
        let shape: Shape = match random.below(3) {
            0 => Sphere::new(0.2 * random.vector(), 0.4).unwrap().into(),
            1 => Torus::new(0.2 * random.vector(), random.vector(), 0.5, 0.2).unwrap().into(),
            _ => Sphere::new(0.2 * random.vector(), 0.4).unwrap().partial(-0.2, 0.3, 250.0).unwrap().into(),
        };
        kinds.push(GeometryKind::Shape(PlacedShape::new(shape, similar(random, center, extent))));
    }
    kinds.push(GeometryKind::PreciseMesh(Arc::new(precise(&soup(random, 40, center, extent)))));
    kinds.push(GeometryKind::Custom(Arc::new(balls(random, 9, center, extent, None))));
    let mut rock = bumpy(1, DVec3::ZERO, 0.3 * extent);
    rock.origin = center;
    let meshes = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(rock))]));
    for _ in 0..3 {
        let map = random.placement(center, extent, 0.5) * Transform::translate(-center);
        kinds.push(GeometryKind::Instance(meshes.instance(map)));
    }
    if depth > 0 {
        let inner_center = DVec3::new(3.0, -2.0, 5.0);
        let inner = Arc::new(answerable(random, inner_center, 2.0, depth - 1));
        for _ in 0..3 {
            let map = similar(random, center, extent) * Transform::translate(-inner_center);
            kinds.push(GeometryKind::Instance(inner.instance(map)));
        }
    }
    build(kinds)
}

fn somewhere(random: &mut Random, center: DVec3, extent: f64) -> DVec3 {
    let reach = [1.0, 3.0, 100.0][random.below(3)];
    center + reach * extent * random.vector()
}

#[test]
fn a_tree_finds_the_nearest_point_that_a_loop_finds() {
    with_every_preset(|| {
        for (seed, center, depth) in [(1, CENTER, 0), (2, CENTER, 2), (3, 1e7 * CENTER, 1)] {
            let mut random = Random(seed);
            let accel = answerable(&mut random, center, 3.0, depth);
            let mut found = 0;
            for _ in 0..600 {
                let point = somewhere(&mut random, center, 3.0);
                let most = [f64::INFINITY, random.between(0.0, 4.0)][random.below(2)];
                let (is_answer, is_point) = check(&accel, point, most);
                assert!(is_answer);
                found += usize::from(is_point);
            }
            assert!(found > 300, "{found}");
        }
    });
}

#[test]
fn geometry_without_an_answer_may_leave_one_for_the_rest() {
    let mut random = Random(4);
    // Shapes under maps that do not keep angles, and a floor of a user's.
    let accel = mixture(&mut random, CENTER, 3.0, 1, true);
    let (mut answered, mut refused) = (0, 0);
    for _ in 0..600 {
        let (is_answer, _) = check(&accel, somewhere(&mut random, CENTER, 3.0), f64::INFINITY);
        *(if is_answer { &mut answered } else { &mut refused }) += 1;
    }
    assert!(refused > 100, "{refused}");

    let mut mesh_and_egg = vec![GeometryKind::Mesh(Arc::new(cube()))];
    let squeezed = Transform::translate(DVec3::new(9.0, 0.0, 0.0))
        * Transform::scale(DVec3::new(1.0, 0.5, 0.7)).unwrap();
    let ring = Torus::new(DVec3::ZERO, DVec3::Z, 1.5, 0.5).unwrap();
    mesh_and_egg.push(GeometryKind::Shape(PlacedShape::new(ring.into(), squeezed)));
    let accel = build(mesh_and_egg);
    let far = accel.closest_point(DVec3::new(-1.0, 0.0, 4.0), f64::INFINITY).unwrap().unwrap();
    assert_eq!((far.distance, far.geometry), (1.5, 0));
    let near = accel.closest_point(DVec3::new(9.5, 0.0, 4.0), f64::INFINITY).unwrap_err();
    assert_eq!((near.why, near.geometry, near.id), (NearestPointError::Map, 1, 1007));
    assert_eq!(accel.closest_point(DVec3::new(9.5, 0.0, 4.0), 1.0), Ok(None));
}

#[test]
fn scenes_of_any_scale_have_nearest_points() {
    for (seed, extent) in [(5, 1e-12), (6, 1e12), (7, 1e-30), (8, 1e30)] {
        let mut random = Random(seed);
        let mesh = soup(&mut random, 200, CENTER * extent, extent);
        let accel = build(vec![GeometryKind::Mesh(Arc::new(mesh))]);
        for _ in 0..200 {
            let point = somewhere(&mut random, CENTER * extent, extent);
            assert!(check(&accel, point, f64::INFINITY).1);
        }
    }
}

#[test]
fn the_limit_counts_itself_and_nothing_is_near_what_is_no_point() {
    let accel = build(vec![GeometryKind::Mesh(Arc::new(cube()))]);
    // Over the face at y = 1.5.
    let over = DVec3::new(1.25, 4.0, 4.5);
    let found = accel.closest_point(over, 2.5).unwrap().unwrap();
    assert_eq!((found.distance, found.point), (2.5, DVec3::new(1.25, 1.5, 4.5)));
    assert_eq!(accel.closest_point(over, 2.5f64.next_down()), Ok(None));
    assert_eq!(accel.closest_point(over, -1.0), Ok(None));
    assert_eq!(accel.closest_point(over, f64::NAN), Ok(None));
    assert_eq!(accel.closest_point(DVec3::new(1.0, f64::INFINITY, 0.0), f64::INFINITY), Ok(None));
    assert_eq!(build(vec![]).closest_point(over, f64::INFINITY), Ok(None));
    // On a corner: the first of its triangles.
    let corner = DVec3::new(0.5, -1.0, 3.0);
    let found = accel.closest_point(corner, 0.0).unwrap().unwrap();
    assert_eq!((found.distance, found.primitive), (0.0, 0));
}

#[test]
fn an_infinite_plane_is_near_wherever_it_is() {
    let plane = Plane::new(DVec3::new(0.0, -3.0, 0.0), DVec3::Y).unwrap();
    let accel = build(vec![
        GeometryKind::Mesh(Arc::new(cube())),
        GeometryKind::Shape(PlacedShape::new(plane.into(), Transform::IDENTITY)),
    ]);
    let found = accel.closest_point(DVec3::new(1e6, 2.0, 1e6), f64::INFINITY).unwrap().unwrap();
    assert_eq!((found.distance, found.geometry), (5.0, 1));
    assert!(check(&accel, DVec3::new(1.0, 3.0, 4.0), f64::INFINITY).1);
}

#[test]
fn two_to_the_fortieth_cubes_have_a_nearest_one() {
    let mut accel = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(cube()))]));
    for isa in 0..40 {
        let apart = 4.0 * 2f64.powi(isa);
        let place = |offset: DVec3| GeometryKind::Instance(accel.instance(Transform::translate(offset)));
        let pair = build(vec![place(DVec3::ZERO), place(DVec3::new(apart, 0.0, 0.0))]);
        accel = Arc::new(pair);
    }
    // Cube n stands from 4 n + 0.5 to 4 n + 3.
    let n = 123_456_789.0;
    let found = accel.closest_point(DVec3::new(4.0 * n + 3.5, 0.25, 4.0), f64::INFINITY).unwrap().unwrap();
    assert_eq!((found.distance, found.instances.len()), (0.5, 40));
}

#[test]
fn the_nearest_point_is_current_after_a_refit_and_a_load() {
    let ball = icosphere(3, DVec3::ZERO, 2.5);
    let at = |origin: DVec3| {
        let mesh = TriangleMesh { origin, ..ball.clone() };
        vec![Geometry { id: 4, kind: GeometryKind::Mesh(Arc::new(mesh)) }]
    };
    let mut accel = Accel::build(at(CENTER), &Default::default()).unwrap();
    let bytes = accel.to_bytes();
    accel.refit(at(-CENTER)).unwrap();
    let loaded = Accel::from_bytes(&bytes, at(-CENTER)).unwrap();
    let mut random = Random(9);
    for _ in 0..200 {
        let point = -CENTER + 6.0 * random.vector();
        assert!(check(&accel, point, f64::INFINITY).1);
        assert_eq!(accel.closest_point(point, 9e9), loaded.closest_point(point, 9e9));
    }
}
