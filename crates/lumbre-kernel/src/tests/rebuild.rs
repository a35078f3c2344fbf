//! Trees that were put together anew in part: against the loop, and against trees built anew.

use std::sync::Arc;

use lumbre_math::{DVec3, Transform, Vec3};

use super::oracle::check;
use super::refit::moved;
use super::scenes::{Random, build, icosphere, mixture, options, ray, repeats, shape, with_every_preset};
use crate::{Accel, Geometry, GeometryKind, Preset, TriangleMesh};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

#[test]
fn a_tree_that_is_rebuilt_in_part_finds_what_a_loop_finds() {
    with_every_preset(|| {
        for seed in 440..443 {
            let mut random = Random(seed);
            let mut accel = mixture(&mut random, CENTER, 3.0, 1, seed == 441);
            for (center, extent) in [(CENTER, 3.0), (1e5 * CENTER, 200.0), (-CENTER, 1e-3)] {
                // What is infinite is to stay so.
                if seed != 441 {
                    accel.refit(moved(&accel, &mut random, center, extent)).unwrap();
                }
                accel.rebuild_partially(&options());
                let (center, extent) = if seed == 441 { (CENTER, 3.0) } else { (center, extent) };
                let count = repeats(300);
                let hits: usize = (0..count).map(|_| check(&accel, &ray(&mut random, center, extent))).sum();
                assert!(hits > count / 4, "{hits}");
                let again = Accel::from_bytes(&accel.to_bytes(), accel.tree.geometries.clone()).unwrap();
                assert!(format!("{:?}", again.tree.packed) == format!("{:?}", accel.tree.packed));
            }
        }
    });
}

const RADIUS: f64 = 0.15;

/// A place in a cube of them.
fn place(number: usize) -> DVec3 {
    CENTER + DVec3::from_array([number % 4, number / 4 % 4, number / 16].map(|x| x as f64))
}

/// Balls, each with such a place.
fn crowd(places: &[usize]) -> Vec<Geometry> {
    let ball = icosphere(1, DVec3::ZERO, RADIUS);
    let at = |(id, &number): (usize, &usize)| {
        let mesh = TriangleMesh { origin: place(number), ..ball.clone() };
        Geometry { id: id as u32, kind: GeometryKind::Mesh(Arc::new(mesh)) }
    };
    places.iter().enumerate().map(at).collect()
}

/// Rays at these places meet what is there.
fn check_crowd(accel: &Accel, random: &mut Random, places: &[usize]) {
    for &number in places {
        let count = repeats(100);
        let hits: usize = (0..count).map(|_| check(accel, &ray(random, place(number), RADIUS))).sum();
        assert!(hits > count / 10, "{hits} of {count}");
    }
}

/// Shapes, each somewhere.
fn shapes(random: &mut Random) -> Vec<Geometry> {
    let mut kind = || {
        let place = CENTER + 30.0 * random.vector();
        GeometryKind::Shape(shape(random, place, 1.0))
    };
    (0..400).map(|id| Geometry { id, kind: kind() }).collect()
}

/// The cost of a ray after such a refit, after a partial rebuild, and after a build, each as a multiple of that of the
/// tree before.
fn growths(before: Vec<Geometry>, after: Vec<Geometry>) -> [f64; 3] {
    let mut accel = Accel::build(before, &options()).unwrap();
    let built = crate::build::refit::cost(&accel.tree.packed.nodes);
    let anew = Accel::build(after.clone(), &options()).unwrap();
    let refitted = accel.refit(after).unwrap();
    let rebuilt = accel.rebuild_partially(&options());
    [refitted, rebuilt, crate::build::refit::cost(&anew.tree.packed.nodes) / built]
}

#[test]
fn what_went_different_ways_costs_what_a_build_makes_it_cost() {
    with_every_preset(|| {
        let mut random = Random(451);
        let mut places: Vec<usize> = (0..64).collect();
        let before = crowd(&places);
        for i in 0..64 {
            places.swap(i, random.below(64));
        }
        for (before, after) in [(before, crowd(&places)), (shapes(&mut random), shapes(&mut random))] {
            let [refitted, rebuilt, anew] = growths(before, after);
            assert!(refitted > 1.5, "{refitted}");
            assert!(rebuilt < 1.1 * anew, "{rebuilt} after {refitted}, where a build gives {anew}");
        }
    });
}

#[test]
fn a_tree_that_nothing_has_moved_in_is_no_worse_for_it() {
    with_every_preset(|| {
        let places = [0, 7, 12, 33, 60, 61];
        let mut accel = Accel::build(crowd(&places), &options()).unwrap();
        let growth = accel.rebuild_partially(&options());
        assert!(growth <= 1.0, "{growth}");
        check_crowd(&accel, &mut Random(452), &places);
        for mut little in [build(vec![]), build(vec![GeometryKind::Mesh(Arc::new(super::scenes::cube()))])] {
            assert!(little.rebuild_partially(&options()) <= 1.0);
        }
    });
}

#[test]
fn what_vanished_comes_back_after_a_partial_rebuild() {
    with_every_preset(|| {
        let places: Vec<usize> = (0..64).step_by(3).collect();
        let whole = crowd(&places);
        let mut random = Random(453);
        for left in [0, 1, 9, places.len() - 1] {
            let mut gone = whole.clone();
            for geometry in &mut gone[left..] {
                if let GeometryKind::Mesh(mesh) = &mut geometry.kind {
                    Arc::make_mut(mesh).positions.fill(Vec3::ZERO);
                }
            }
            let mut accel = Accel::build(whole.clone(), &options()).unwrap();
            accel.refit(gone).unwrap();
            accel.rebuild_partially(&options());
            check_crowd(&accel, &mut random, &places[..left]);
            accel.refit(whole.clone()).unwrap();
            check_crowd(&accel, &mut random, &places);
            accel.rebuild_partially(&options());
            check_crowd(&accel, &mut random, &places);
        }
    });
}

#[test]
fn trees_around_follow_one_that_is_rebuilt_in_part() {
    with_every_preset(|| {
        let mut random = Random(454);
        // A long row of balls, slanted, so that instances of it are opened.
        let row = |places: &[usize]| {
            let mut balls = crowd(places);
            for (geometry, place) in balls.iter_mut().zip(places) {
                if let GeometryKind::Mesh(mesh) = &mut geometry.kind {
                    Arc::make_mut(mesh).origin = DVec3::X * (*place as f64 - 32.0);
                }
            }
            balls
        };
        let mut places: Vec<usize> = (0..64).collect();
        let mut inner = Arc::new(Accel::build(row(&places), &options()).unwrap());
        let around = |inner: &Arc<Accel>, random: &mut Random| {
            let instance = |id| {
                let world_from_object = Transform::translate(CENTER + 8.0 * random.vector())
                    * Transform::rotate(random.vector(), 50.0).unwrap();
                let kind = GeometryKind::Instance(inner.instance(world_from_object));
                Geometry { id, kind }
            };
            (0..12).map(instance).collect::<Vec<_>>()
        };
        let geometries = around(&inner, &mut Random(455));
        let mut accel = Accel::build(geometries, &options()).unwrap();
        let is_opened = accel.tree.packed.entries.len() > accel.tree.geometries.len();
        assert_eq!(is_opened, options().preset != Preset::Fast);
        let nothing = Arc::new(build(vec![]));
        for _ in 0..2 {
            accel.refit(around(&nothing, &mut Random(455))).unwrap();
            for i in 0..64 {
                places.swap(i, random.below(64));
            }
            let own = Arc::get_mut(&mut inner).expect("nobody else holds it");
            own.refit(row(&places)).unwrap();
            own.rebuild_partially(&options());
            accel.refit(around(&inner, &mut Random(455))).unwrap();
            for _ in 0..2 {
                let mut hits = 0;
                for geometry in &accel.tree.geometries {
                    let GeometryKind::Instance(instance) = &geometry.kind else { continue };
                    let ball = instance
                        .world_from_object
                        .at(0.0)
                        .point(DVec3::X * random.between(-32.0, 32.0).round());
                    hits += (0..repeats(9))
                        .map(|_| check(&accel, &ray(&mut random, ball, RADIUS)))
                        .sum::<usize>();
                }
                assert!(hits > repeats(9), "{hits}");
                accel.rebuild_partially(&options());
            }
        }
    });
}

#[test]
fn it_is_the_same_from_any_number_of_threads() {
    let print = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut random = Random(456);
            let mut accel = Accel::build(crowd(&(0..64).collect::<Vec<_>>()), &options()).unwrap();
            let mut places: Vec<usize> = (0..64).collect();
            for i in 0..64 {
                places.swap(i, random.below(64));
            }
            accel.refit(crowd(&places)).unwrap();
            accel.rebuild_partially(&options());
            format!("{:?}", accel.tree.packed)
        })
    };
    let one = print(1);
    assert!(one == print(2) && one == print(5));
}
