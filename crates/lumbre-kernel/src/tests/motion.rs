//! What moves, against the same standing still where it is at the time of a ray.

use std::sync::Arc;

use lumbre_geometry::{Aabb, Ray};
use lumbre_math::{AnimatedTransform, DVec3, Transform};

use super::oracle::check;
use super::scenes::{Random, build, cube, icosphere, mixture, ray, with_every_preset};
use crate::tree::Tree;
use crate::{Accel, BuildOptions, Geometry, GeometryKind, Placement, brute};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// Keys at some times around [0, 1], each somewhere else.
fn motion(random: &mut Random, center: DVec3, extent: f64, inner: DVec3) -> AnimatedTransform {
    let first = random.placement(center, extent, 0.2 * extent);
    let mut time = random.between(-0.3, 0.4);
    let mut keys = Vec::new();
    for _ in 0..2 + random.below(3) {
        let step = Transform::translate(0.4 * extent * random.vector())
            * Transform::rotate(random.vector(), 170.0 * random.unit()).unwrap()
            * Transform::scale(DVec3::splat(random.between(0.7, 1.2))).unwrap();
        // About the middle of the first.
        let middle = Transform::translate(first.point(DVec3::ZERO));
        keys.push((time, middle * step * middle.inverse() * first * Transform::translate(-inner)));
        time += random.between(0.05, 0.5);
    }
    AnimatedTransform::new(keys).unwrap()
}

/// A tree whose instances move, with instances that move in them to `depth`.
fn moving(random: &mut Random, depth: u32, infinite: bool) -> Accel {
    let inner_center = DVec3::new(3.0, -2.0, 5.0);
    let inner = Arc::new(if depth > 1 {
        moving(random, depth - 1, infinite)
    } else {
        mixture(random, inner_center, 2.0, 0, infinite)
    });
    let inner_center = if depth > 1 { CENTER } else { inner_center };
    let mut geometries = mixture(random, CENTER, 3.0, 1, false).tree.geometries.clone();
    for id in 0..5 {
        let world_from_object = motion(random, CENTER, 3.0, inner_center);
        let kind = GeometryKind::Instance(inner.instance(world_from_object));
        geometries.push(Geometry { id: 500 + id, kind });
    }
    Accel::build(geometries, &BuildOptions::default()).unwrap()
}

/// The tree as it is at a time.
fn frozen(tree: &Tree, time: f64) -> Accel {
    let still = |geometry: &Geometry| {
        let kind = match &geometry.kind {
            GeometryKind::Instance(instance) => GeometryKind::Instance(
                frozen(&instance.tree, time).instance(instance.world_from_object.at(time)),
            ),
            kind => kind.clone(),
        };
        Geometry { id: geometry.id, kind }
    };
    Accel::build(tree.geometries.iter().map(still).collect(), &BuildOptions::default()).unwrap()
}

#[test]
fn queries_at_a_time_see_what_stands_still_there_then() {
    for (seed, depth, infinite) in [(1, 1, false), (2, 1, true), (3, 2, false)] {
        let mut random = Random(seed);
        let accel = moving(&mut random, depth, infinite);
        let (mut hits, mut on_moving) = (0, 0);
        for time in [-5.0, 0.0, 0.13, 0.5, 0.77, 3.0] {
            let frozen = frozen(&accel.tree, time);
            for _ in 0..150 {
                let ray = ray(&mut random, CENTER, 3.0);
                let timed = ray.at_time(time);
                hits += check(&accel, &timed);
                let hit = accel.closest(&timed);
                assert_eq!(hit, brute::closest(&frozen.tree, &ray));
                let Some(hit) = hit else { continue };
                let moves = accel.tree.geometries[hit.route.first().map_or(0, |&i| i as usize)].id >= 500;
                on_moving += usize::from(moves);
                assert_eq!(accel.surface(&timed, &hit), frozen.surface(&ray, &hit));
                assert_eq!(accel.world_from_object(&timed, &hit), frozen.world_from_object(&ray, &hit));
                assert!(
                    frozen.bounds().is_empty() || infinite || accel.bounds().contains(timed.at(hit.root.t))
                );
            }
        }
        assert!(hits > 500 && on_moving > 50, "{hits} {on_moving}");
    }
}

#[test]
fn batches_of_rays_at_different_times_answer_as_single_rays_do() {
    let mut random = Random(4);
    let accel = moving(&mut random, 1, false);
    let some_ray = |_| {
        let time = random.unit();
        ray(&mut random, CENTER, 3.0).at_time(time)
    };
    let rays: Vec<Ray> = (0..400).map(some_ray).collect();
    let mut hits = vec![None; rays.len()];
    accel.closest_batch(&rays, &mut hits);
    let mut is_hit = vec![false; rays.len()];
    accel.any_batch(&rays, &mut is_hit);
    for ((ray, hit), is_hit) in rays.iter().zip(&hits).zip(is_hit) {
        assert_eq!(*hit, brute::closest(&accel.tree, ray));
        assert_eq!(is_hit, hit.is_some());
    }
    assert!(hits.iter().flatten().count() > 100);
}

#[test]
fn a_box_holds_what_moves_at_every_time() {
    let mut random = Random(5);
    let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(icosphere(2, CENTER, 1.5)))]));
    let GeometryKind::Mesh(ball) = &inner.tree.geometries[0].kind else { panic!("a mesh") };
    let points: Vec<DVec3> = ball.positions.iter().map(|p| ball.origin + p.as_dvec3()).collect();
    let mut tightest = f64::INFINITY;
    for _ in 0..200 {
        let motion = motion(&mut random, DVec3::ZERO, 5.0, CENTER);
        let world_from_object = motion.clone();
        let accel = build(vec![GeometryKind::Instance(inner.instance(world_from_object))]);
        let mut seen = Aabb::EMPTY;
        for i in 0..=300 {
            let map = motion.at(-1.0 + 0.01 * f64::from(i));
            for &p in &points {
                let p = map.point(p);
                assert!(accel.bounds().contains(p), "{p} {:?}", accel.bounds());
                seen = seen.union(Aabb { min: p, max: p });
            }
        }
        tightest = tightest.min(accel.bounds().half_area() / seen.half_area());
        assert!(accel.bounds().half_area() < 2.0 * seen.half_area());
    }
    assert!(tightest < 1.3, "{tightest}");
}

#[test]
fn refitted_and_saved_trees_know_where_things_move() {
    let mut random = Random(6);
    let accel = moving(&mut random, 1, false);
    let bytes = accel.to_bytes();
    let mut geometries = accel.tree.geometries.clone();
    let mut loaded = Accel::from_bytes(&bytes, geometries.clone()).unwrap();
    for geometry in geometries.iter_mut().filter(|geometry| geometry.id >= 500) {
        let GeometryKind::Instance(instance) = &mut geometry.kind else { continue };
        // Elsewhere, and one that stands still from now on.
        let elsewhere = motion(&mut random, CENTER, 3.0, DVec3::new(3.0, -2.0, 5.0));
        instance.world_from_object = if geometry.id == 502 {
            elsewhere.at(0.4).into()
        } else {
            Placement::Moving(Arc::new(elsewhere))
        };
    }
    for round in 0..2 {
        let mut hits = 0;
        for _ in 0..400 {
            let time = random.between(-0.2, 1.3);
            hits += check(&loaded, &ray(&mut random, CENTER, 3.0).at_time(time));
        }
        assert!(hits > 300, "{hits}");
        if round == 0 {
            loaded.refit(geometries.clone()).unwrap();
        }
    }
}

#[test]
fn a_turning_cube_is_met_where_it_is() {
    with_every_preset(|| {
        let turn = |degrees: f64| Transform::rotate(DVec3::Z, degrees).unwrap();
        let keys = vec![(0.0, turn(0.0)), (1.0, turn(90.0)), (2.0, turn(180.0))];
        let world_from_object = AnimatedTransform::new(keys).unwrap();
        let cube = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(cube()))]));
        let size = cube.bounds();
        let accel = build(vec![GeometryKind::Instance(cube.instance(world_from_object))]);
        // Down along z, where a corner of the cube passes by.
        let start = DVec3::new(0.0, 0.0, size.max.z + 2.0);
        for i in 0..=40 {
            let time = 0.05 * f64::from(i);
            let corner = turn(90.0 * time).point(DVec3::new(size.max.x, size.max.y, 0.0));
            for (part, is_inside) in [(0.999, true), (1.001, false)] {
                let ray = Ray::new(start + part * corner, -DVec3::Z).at_time(time);
                assert_eq!(accel.any(&ray), is_inside, "{time} {part}");
            }
        }
    });
}
