//! Every query against the loop over everything.

use std::cell::RefCell;
use std::collections::HashSet;
use std::ops::ControlFlow;
use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform};

use super::scenes::{Random, balls, build, cube, icosphere, mixture, ray, soup, with_every_preset};
use crate::intersect::Isa;
use crate::{Accel, GeometryKind, Hit, Query, TriangleMesh, brute};

fn every(isa: Isa, accel: &Accel, ray: &Ray) -> Vec<Hit> {
    let mut hits = Vec::new();
    accel.all_at(isa, ray, |hit| {
        hits.push(hit.clone());
        ControlFlow::Continue(())
    });
    hits
}

/// All queries on one ray; returns how many hits there were.
pub(crate) fn check(accel: &Accel, ray: &Ray) -> usize {
    let expected = brute::every(&accel.tree, ray);
    let closest = brute::closest(&accel.tree, ray);
    assert_eq!(closest, expected.first().cloned(), "{ray:?}");
    for isa in Isa::all() {
        let found = accel.closest_at(isa, ray);
        assert_eq!(found, closest, "{isa:?} {ray:?}");
        assert_eq!(t_bits(&found), t_bits(&closest), "{isa:?} {ray:?}");
        assert_eq!(accel.any_at(isa, ray), closest.is_some(), "{isa:?} {ray:?}");
        assert_eq!(every(isa, accel, ray), expected, "{isa:?} {ray:?}");
        assert_eq!(accel.count_at(isa, ray), expected.len(), "{isa:?} {ray:?}");
    }

    let accept = |hit: &Hit| !(hit.id / 7 + hit.primitive + hit.instances.len() as u32).is_multiple_of(3);
    let filtered = expected.iter().find(|hit| accept(hit)).cloned();
    for isa in Isa::all() {
        let query = Query::new().filter(&accept);
        let found = accel.closest_with_at(isa, ray, &query);
        assert_eq!(found, filtered, "{isa:?} {ray:?}");
        assert_eq!(t_bits(&found), t_bits(&filtered), "{isa:?} {ray:?}");
        assert_eq!(accel.any_with_at(isa, ray, &query), filtered.is_some(), "{isa:?} {ray:?}");
    }
    expected.len()
}

fn t_bits(hit: &Option<Hit>) -> Option<u64> {
    hit.as_ref().map(|hit| hit.root.t.to_bits())
}

pub(crate) fn check_many(accel: &Accel, random: &mut Random, center: DVec3, extent: f64, rays: usize) {
    let hits: usize = (0..rays).map(|_| check(accel, &ray(random, center, extent))).sum();
    assert!(hits > rays / 4, "only {hits} hits of {rays} rays");
}

/// The same in batches of many sizes, at every instruction set; returns how many were hit.
pub(crate) fn check_batches(accel: &Accel, rays: &[Ray]) -> usize {
    let expected: Vec<_> = rays.iter().map(|ray| accel.closest(ray)).collect();
    for isa in Isa::all() {
        for size in [1, 3, 7, 64, rays.len()] {
            for (rays, expected) in rays.chunks(size).zip(expected.chunks(size)) {
                // What stood there before does not matter.
                let mut hits = vec![expected.iter().flatten().next().cloned(); rays.len()];
                accel.closest_batch_at(isa, rays, &mut hits);
                assert_eq!(hits, expected, "{isa:?}");
                let bits = |hit: &Option<Hit>| hit.as_ref().map(|hit| hit.root.t.to_bits());
                assert!(hits.iter().map(bits).eq(expected.iter().map(bits)));
                let mut is_hit = vec![true; rays.len()];
                accel.any_batch_at(isa, rays, &mut is_hit);
                assert!(is_hit.iter().copied().eq(expected.iter().map(Option::is_some)), "{isa:?}");
            }
        }
    }
    expected.iter().flatten().count()
}

#[test]
fn batches_answer_as_single_rays_do() {
    let mut random = Random(31);
    // A closed ball far off its own origin, a soup, and an open strip whose edges rays meet exactly.
    let mut ball = icosphere(3, DVec3::ZERO, 1.2);
    ball.origin = CENTER;
    let strip = |ball: &TriangleMesh| TriangleMesh { indices: ball.indices[..37].to_vec(), ..ball.clone() };
    let soup = soup(&mut random, 900, CENTER, 3.0);
    let mut meshes = vec![GeometryKind::Mesh(Arc::new(strip(&ball)))];
    for kind in [ball, soup] {
        meshes.push(GeometryKind::Mesh(Arc::new(kind)));
        let accel = build(meshes.clone());
        let mut rays: Vec<Ray> = (0..1500).map(|_| ray(&mut random, CENTER, 3.0)).collect();
        // Some miss the tree altogether, some are nothing.
        rays[3] = Ray::new(CENTER + 50.0 * DVec3::X, DVec3::Y);
        rays[20].direction = DVec3::ZERO;
        rays[77].t_max = f64::NAN;
        for i in (100..1400).step_by(7) {
            let GeometryKind::Mesh(mesh) = &meshes[random.below(meshes.len())] else { unreachable!() };
            let corner = mesh.indices[random.below(mesh.indices.len())][random.below(3)];
            let target = mesh.origin + mesh.positions[corner as usize].as_dvec3();
            rays[i] = Ray::new(target + DVec3::new(0.0, 0.0, 4.0), -DVec3::Z);
        }
        let hits = check_batches(&accel, &rays);
        assert!(250 < hits && hits < 1450, "{hits}");
    }
    let accel = mixture(&mut random, CENTER, 3.0, 1, true);
    let rays: Vec<Ray> = (0..300).map(|_| ray(&mut random, CENTER, 3.0)).collect();
    assert!(check_batches(&accel, &rays) > 75);
}

#[test]
fn batches_without_rays_or_without_triangles_end() {
    let accel = build(vec![]);
    accel.closest_batch(&[], &mut []);
    let ray = Ray::new(CENTER, DVec3::new(0.3, 0.4, 0.5));
    let mut hits = [true; 9];
    accel.any_batch(&[ray; 9], &mut hits);
    assert_eq!(hits, [false; 9]);
}

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

#[test]
fn a_tree_finds_what_a_loop_finds() {
    with_every_preset(|| {
        let mut random = Random(1);
        let accel = mixture(&mut random, CENTER, 3.0, 0, false);
        check_many(&accel, &mut random, CENTER, 3.0, 5_000);
    });
}

#[test]
fn nested_instances_are_found_as_by_a_loop() {
    with_every_preset(|| {
        let mut random = Random(2);
        let accel = mixture(&mut random, CENTER, 3.0, 2, false);
        check_many(&accel, &mut random, CENTER, 3.0, 2_000);
    });
}

#[test]
fn placed_meshes_are_found_as_by_a_loop() {
    with_every_preset(|| {
        let mut random = Random(12);
        let mut ball = icosphere(2, DVec3::ZERO, 1.5);
        ball.origin = CENTER;
        let soups = [CENTER, 3.0 * CENTER].map(|origin| {
            let mut soup = soup(&mut random, 80, CENTER - origin, 1.5);
            soup.origin = origin;
            GeometryKind::Mesh(Arc::new(soup))
        });
        // Of one origin, and of two.
        let trees = [
            vec![GeometryKind::Mesh(Arc::new(ball.clone())), soups[0].clone()],
            vec![GeometryKind::Mesh(Arc::new(cube()))],
            soups.to_vec(),
        ]
        .map(|kinds| Arc::new(build(kinds)));
        assert_eq!(trees.each_ref().map(|tree| tree.tree.single.is_some()), [true, true, false]);
        let mut kinds = vec![GeometryKind::Mesh(Arc::new(soup(&mut random, 30, CENTER, 3.0)))];
        for i in 0..24 {
            let world_from_object = random.placement(CENTER, 3.0, 0.5) * Transform::translate(-CENTER);
            kinds.push(GeometryKind::Instance(trees[i % 3].instance(world_from_object)));
        }
        let accel = build(kinds);
        check_many(&accel, &mut random, CENTER, 3.0, 3_000);
        // Exactly at corners of what is placed as it is.
        let accel = build(vec![GeometryKind::Instance(trees[0].instance(Transform::IDENTITY))]);
        let mut hits = 0;
        for position in &ball.positions {
            let corner = ball.origin + position.as_dvec3();
            hits += check(&accel, &Ray::new(corner - 4.0 * DVec3::Z, DVec3::Z));
            hits += check(&accel, &Ray::new(corner + 5.0 * DVec3::X, -DVec3::X));
        }
        assert!(hits > 300, "{hits}");
    });
}

/// Triangles that pass through each other, in instances and outside.
fn soup_in_and_beside_instances(random: &mut Random) -> Accel {
    let soup = GeometryKind::Mesh(Arc::new(soup(random, 150, CENTER, 3.0)));
    let inner = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(icosphere(2, CENTER, 2.5))), soup.clone()]));
    let map = random.placement(CENTER, 0.5, 1.0) * Transform::translate(-CENTER);
    let instance = |accel: &Arc<Accel>, map: Transform| GeometryKind::Instance(accel.instance(map));
    build(vec![soup, instance(&inner, map), instance(&inner, Transform::IDENTITY)])
}

#[test]
fn a_filter_is_asked_once_about_each_crossing() {
    let mut random = Random(75);
    let accel = soup_in_and_beside_instances(&mut random);
    let mut dispatched = 0;
    for _ in 0..3000 {
        let ray = ray(&mut random, CENTER, 3.0);
        let all = brute::every(&accel.tree, &ray);
        let seen = RefCell::new(HashSet::new());
        let deny = |hit: &Hit| {
            assert!(all.contains(hit), "{hit:?} is no hit");
            seen.borrow_mut().insert((hit.route.clone(), hit.geometry, hit.primitive));
            false
        };
        let query = Query::new().filter(&deny);
        assert_eq!(accel.closest_with(&ray, &query), None);
        assert_eq!(seen.take().len(), all.len());
        assert!(!accel.any_with(&ray, &query));
        let count = seen.take().len();
        assert_eq!(count, all.len());
        dispatched += count;
        let mut first = Vec::new();
        accel.all(&ray, |hit| {
            first.push(hit.clone());
            if first.len() == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(first, all[..all.len().min(3)]);
    }
    assert!(dispatched > 3000, "{dispatched}");
}

#[test]
fn infinite_things_are_found_within_instances_and_without() {
    with_every_preset(|| {
        let mut random = Random(3);
        let accel = mixture(&mut random, CENTER, 3.0, 1, true);
        assert!(!accel.tree.infinite.is_empty());
        check_many(&accel, &mut random, CENTER, 3.0, 2_000);
    });
}

#[test]
fn a_scene_far_from_the_origin_loses_nothing() {
    with_every_preset(|| {
        for (seed, offset) in [(4, 1e6), (5, 1e8), (6, 1e10)] {
            let mut random = Random(seed);
            let center = DVec3::new(offset, -0.5 * offset, 0.25 * offset);
            let accel = mixture(&mut random, center, 3.0, 1, false);
            check_many(&accel, &mut random, center, 3.0, 2_000);
        }
    });
}

#[test]
fn scenes_of_any_scale_lose_nothing() {
    with_every_preset(|| {
        for (seed, extent) in [(7, 1e-12), (8, 1e12), (9, 1e-30), (10, 1e30)] {
            let mut random = Random(seed);
            let accel = mixture(&mut random, CENTER * extent, extent, 1, false);
            check_many(&accel, &mut random, CENTER * extent, extent, 2_000);
        }
    });
}

#[test]
fn many_seeds_agree_with_the_loop() {
    with_every_preset(|| {
        for seed in 100..108 {
            let mut random = Random(seed);
            let (depth, infinite) = (random.below(2) as u32, random.unit() < 0.3);
            let accel = mixture(&mut random, CENTER, 3.0, depth, infinite);
            check_many(&accel, &mut random, CENTER, 3.0, 300);
        }
    });
}

/// A million rays: minutes, not seconds.
#[test]
#[ignore = "minutes; run before a release"]
fn a_million_rays_agree_with_the_loop() {
    for seed in 1000..1100 {
        let mut random = Random(seed);
        let accel = mixture(&mut random, CENTER, 3.0, (seed % 3 == 0).into(), seed % 5 == 0);
        check_many(&accel, &mut random, CENTER, 3.0, 10_000);
    }
}

#[test]
fn ill_conditioned_instances_lose_nothing() {
    let mut random = Random(11);
    let inner = Arc::new(mixture(&mut random, CENTER, 3.0, 0, false));
    for squeeze in [1e-4, 1e-8, 1e-12] {
        let map = Transform::rotate(random.vector(), 37.0).unwrap()
            * Transform::scale(DVec3::new(1.0, squeeze, 1.0)).unwrap()
            * Transform::rotate(random.vector(), 53.0).unwrap();
        let center = map.point(CENTER);
        let accel = build(vec![GeometryKind::Instance(inner.instance(map))]);
        check_many(&accel, &mut random, center, 3.0, 3_000);
    }
}

#[test]
fn ties_go_to_the_first_in_the_lists() {
    let cube = Arc::new(cube());
    let inner = Arc::new(build(vec![GeometryKind::Mesh(cube.clone()), GeometryKind::Mesh(cube.clone())]));
    let instance = || GeometryKind::Instance(inner.instance(Transform::IDENTITY));
    let accel = build(vec![
        instance(),
        GeometryKind::Mesh(cube.clone()),
        GeometryKind::Mesh(cube.clone()),
        instance(),
    ]);
    let ray = Ray::new(DVec3::new(1.25, 0.5, -7.0), DVec3::new(0.01, 0.02, 1.0));
    check(&accel, &ray);
    let places: Vec<_> =
        every(Isa::best(), &accel, &ray).iter().map(|hit| (hit.route.to_vec(), hit.geometry)).collect();
    let expected = [(vec![], 1), (vec![], 2), (vec![0], 0), (vec![0], 1), (vec![3], 0), (vec![3], 1)];
    assert_eq!(places[..6], expected);
    assert_eq!(places[6..], expected);
    assert_eq!(accel.closest(&ray).unwrap().geometry, 1);
}

#[test]
fn both_ends_of_the_range_count() {
    let accel = build(vec![GeometryKind::Mesh(Arc::new(cube()))]);
    let ray = Ray::new(DVec3::new(1.25, 0.5, -7.0), DVec3::new(0.0, 0.0, 2.0));
    let ts: Vec<f64> = every(Isa::best(), &accel, &ray).iter().map(|hit| hit.root.t).collect();
    assert_eq!(ts, [5.0, 6.25]);
    assert_eq!(accel.count(&ray.with_range(5.0, 6.25)), 2);
    assert_eq!(accel.count(&ray.with_range(5.0f64.next_up(), 6.25)), 1);
    assert_eq!(accel.count(&ray.with_range(5.0, 6.25f64.next_down())), 1);
    assert!(accel.any(&ray.with_range(5.0, 5.0)));
    assert!(!accel.any(&ray.with_range(6.0, 5.5)));
}

#[test]
fn an_unusable_ray_misses() {
    let accel = build(vec![
        GeometryKind::Mesh(Arc::new(cube())),
        GeometryKind::Custom(Arc::new(balls(&mut Random(3), 5, CENTER, 2.0, Some(-9.0)))),
    ]);
    let good = Ray::new(DVec3::new(1.25, 0.5, -7.0), DVec3::new(0.1, -0.3, 1.0));
    assert!(accel.any(&good));
    let nan = f64::NAN;
    for bad in [
        Ray { direction: DVec3::ZERO, ..good },
        Ray { direction: -DVec3::ZERO, ..good },
        Ray { direction: DVec3::new(0.0, nan, 1.0), ..good },
        Ray { direction: DVec3::new(0.0, f64::INFINITY, 1.0), ..good },
        Ray { origin: DVec3::new(nan, 0.5, -7.0), ..good },
        Ray { t_min: nan, ..good },
        Ray { t_max: nan, ..good },
        good.with_range(2.0, 1.0),
    ] {
        assert_eq!(check(&accel, &bad), 0, "{bad:?}");
    }
}

#[test]
fn rays_of_absurd_size_are_answered_as_by_the_loop() {
    let mut random = Random(21);
    let everything = mixture(&mut random, CENTER, 3.0, 1, true);
    let mut ball = icosphere(2, DVec3::ZERO, 1.2);
    ball.origin = CENTER;
    let meshes = build(vec![
        GeometryKind::Mesh(Arc::new(soup(&mut random, 60, CENTER, 3.0))),
        GeometryKind::Mesh(Arc::new(ball)),
        GeometryKind::Custom(Arc::new(balls(&mut random, 10, CENTER, 3.0, None))),
    ]);
    for (accel, sizes) in
        [(&everything, [1e-60, 1e-30, 1e30, 1e60]), (&meshes, [1e-320, 1e-300, 1e150, 1e300])]
    {
        let mut hits = 0;
        for _ in 0..150 {
            let origin = CENTER + random.vector();
            for size in sizes {
                hits += check(accel, &Ray::new(origin, random.vector() * size));
                check(accel, &Ray::new(random.vector() * size, random.vector()));
                check(accel, &Ray::new(random.vector() * size, random.vector() * size));
            }
        }
        assert!(hits > 300, "{hits}");
    }
}

#[test]
fn all_stops_where_told() {
    let accel = build(vec![GeometryKind::Mesh(Arc::new(soup(&mut Random(8), 250_000, CENTER, 3.0)))]);
    let ray = Ray::new(CENTER + DVec3::new(0.3, -9.0, 0.2), DVec3::new(0.01, 1.0, -0.02));
    let hits = every(Isa::best(), &accel, &ray);
    assert!(hits.len() > 300, "{}", hits.len());
    assert_eq!(hits, brute::every(&accel.tree, &ray));
    for stop in [1, 31, 32, 33, 160, 161, hits.len()] {
        let mut seen = Vec::new();
        accel.all(&ray, |hit| {
            seen.push(hit.clone());
            if seen.len() == stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(seen, hits[..stop]);
    }
}

#[test]
fn a_thousand_hits_in_one_place_are_all_listed() {
    let cube = Arc::new(cube());
    let accel = build((0..1000).map(|_| GeometryKind::Mesh(cube.clone())).collect());
    let ray = Ray::new(DVec3::new(1.25, 0.5, -7.0), DVec3::new(0.01, 0.02, 1.0));
    check(&accel, &ray);
    assert_eq!(accel.count(&ray), 2000);
}
