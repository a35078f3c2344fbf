//! Single precision among instances, clouds and meshes in double precision: the filtered traversal against the exact
//! one.

use std::sync::Arc;

use lumbre_geometry::{PlacedShape, Plane, Ray, Sphere};
use lumbre_math::{AnimatedTransform, DVec3, Transform, Vec3};

use super::oracle;
use super::scenes::{Random, build, cloud, icosphere, mixture, precise, ray, shape, soup, vertex};
use super::single::check_packet;
use crate::batch;
use crate::batch::packet::{self, PACKET};
use crate::intersect::Isa;
use crate::trace::Outcome;
use crate::{Accel, Faces, GeometryKind, Hit, Query, TriangleMesh, brute};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

fn placed(accel: &Arc<Accel>, map: Transform) -> GeometryKind {
    GeometryKind::Instance(accel.instance(map))
}

/// A closed mesh, long and thin, so that it is opened where it is placed.
fn needle() -> TriangleMesh {
    let mut needle = icosphere(3, DVec3::ZERO, 1.0);
    needle.positions.iter_mut().for_each(|p| *p *= Vec3::new(4.0, 0.2, 0.3));
    needle
}

/// A tree of everything, and in it instances of trees of every kind.
fn everything(random: &mut Random) -> Accel {
    let zero = DVec3::ZERO;
    let shapes = |random: &mut Random| {
        let mut kinds = vec![GeometryKind::Mesh(Arc::new(icosphere(1, zero, 0.6)))];
        kinds.extend((0..9).map(|_| GeometryKind::Shape(shape(random, zero, 1.0))));
        kinds
    };
    let mut endless = shapes(random);
    let plane = Plane::new(-0.9 * DVec3::Y, random.vector()).unwrap();
    endless.push(GeometryKind::Shape(PlacedShape::new(plane.into(), Transform::IDENTITY)));
    let mut other_origin = icosphere(1, zero, 0.9);
    other_origin.origin = DVec3::new(0.1, 0.2, 0.3);
    let trees = [
        (vec![GeometryKind::Mesh(Arc::new(needle()))], Some(true)),
        (shapes(random), Some(false)),
        (endless, Some(false)),
        (
            vec![
                GeometryKind::Mesh(Arc::new(icosphere(1, zero, 0.7))),
                GeometryKind::Mesh(Arc::new(other_origin)),
            ],
            None,
        ),
        (vec![GeometryKind::Spheres(Arc::new(cloud(random, 30, zero, zero, 1.0)))], Some(false)),
        (vec![GeometryKind::PreciseMesh(Arc::new(precise(&icosphere(2, zero, 0.8))))], Some(false)),
    ];
    let mut trees: Vec<_> = trees
        .into_iter()
        .map(|(kinds, expected)| {
            let tree = Arc::new(build(kinds));
            assert_eq!(tree.only_triangles(), expected);
            tree
        })
        .collect();
    trees.push(Arc::new(mixture(random, zero, 1.0, 1, false)));

    let mesh = |mesh: TriangleMesh| TriangleMesh { origin: CENTER, ..mesh };
    let mut kinds = vec![
        GeometryKind::Mesh(Arc::new(mesh(icosphere(2, zero, 1.2)))),
        GeometryKind::Mesh(Arc::new(mesh(soup(random, 40, zero, 3.0)))),
        GeometryKind::PreciseMesh(Arc::new(precise(&mesh(icosphere(2, zero, 1.5))))),
        GeometryKind::Spheres(Arc::new(cloud(random, 40, CENTER, CENTER, 3.0))),
        GeometryKind::Spheres(Arc::new(cloud(random, 20, zero, CENTER, 3.0))),
    ];
    kinds.extend((0..12).map(|_| GeometryKind::Shape(shape(random, CENTER, 3.0))));
    for tree in &trees {
        for size in [0.2, 0.5, 1.0] {
            kinds.push(placed(tree, random.placement(CENTER, 3.0, size)));
        }
        let first = random.placement(CENTER, 3.0, 0.5);
        let moved = Transform::translate(random.vector()) * first;
        let motion = AnimatedTransform::new(vec![(0.0, first), (1.0, moved)]);
        let instance = tree.instance(motion.unwrap());
        kinds.push(GeometryKind::Instance(instance));
    }
    build(kinds)
}

/// A ray of any sort, or at a corner of the mesh, so that it meets that exactly or all but exactly.
fn some_ray(random: &mut Random, accel: &Accel) -> Ray {
    let made = match (&accel.tree.geometries[0].kind, random.below(4)) {
        (GeometryKind::Mesh(mesh), 0) => {
            let corner = vertex(mesh, random.below(mesh.positions.len()) as u32);
            let along = [DVec3::X, -DVec3::Y, DVec3::Z, random.vector()][random.below(4)];
            Ray::new(corner - 4.0 * along, along)
        }
        _ => ray(random, CENTER, 3.0),
    };
    made.at_time(random.between(-0.2, 1.2))
}

/// A ray that nobody aims.
fn free_ray(random: &mut Random) -> Ray {
    let (from, to) = (CENTER + 6.0 * random.vector(), CENTER + 2.0 * random.vector());
    Ray::new(from, to - from).at_time(random.unit())
}

/// Both questions at every instruction set against the plain search, single and in batches; how many rays single
/// precision decided.
fn check(accel: &Accel, rays: &[Ray]) -> usize {
    let mut told = 0;
    for isa in Isa::all() {
        let mut hits = vec![None; rays.len()];
        accel.closest_batch_at(isa, rays, &mut hits);
        let mut are_hit = vec![false; rays.len()];
        accel.any_batch_at(isa, rays, &mut are_hit);
        told = 0;
        for ((ray, hit), is_hit) in rays.iter().zip(&hits).zip(&are_hit) {
            let plain = accel.closest_exact_at(isa, ray);
            let bits = |hit: &Option<Hit>| hit.as_ref().map(|hit| hit.root.t.to_bits());
            assert_eq!(*hit, plain, "{isa:?} {ray:?}");
            assert_eq!(bits(hit), bits(&plain), "{isa:?} {ray:?}");
            assert_eq!(*is_hit, plain.is_some(), "{isa:?} {ray:?}");
            assert_eq!(accel.closest_at(isa, ray), plain, "{isa:?} {ray:?}");
            assert_eq!(accel.any_at(isa, ray), plain.is_some(), "{isa:?} {ray:?}");
            let single = accel.filtered_at(isa, ray);
            assert!(single == Outcome::Uncertain || single == Outcome::Certain(plain), "{isa:?} {ray:?}");
            told += usize::from(single != Outcome::Uncertain);
        }
    }
    told
}

#[test]
fn single_precision_has_the_bits_of_double_in_mixed_trees() {
    super::scenes::with_every_preset(|| {
        let mut random = Random(401);
        let accel = everything(&mut random);
        assert_eq!(accel.only_triangles(), Some(false));
        let rays: Vec<_> = (0..2_000).map(|_| some_ray(&mut random, &accel)).collect();
        let is_hit = |ray: &&Ray| accel.any(ray);
        let hits = rays.iter().filter(is_hit).count();
        assert!(700 < hits && hits < 2_000, "{hits}");
        check(&accel, &rays);
        // Closures, too.
        rays[..200].iter().for_each(|ray| {
            oracle::check(&accel, ray);
        });
    });
}

#[test]
fn options_leave_the_same_bits_among_anything() {
    let mut random = Random(405);
    let accel = everything(&mut random);
    let masks = (0..accel.tree.geometries.len()).map(|_| 1 + random.below(7) as u32).collect();
    let accel = accel.with_masks(masks);
    let (mut told, mut free, mut hits) = (0, 0, 0);
    for i in 0..1_500 {
        let is_free = i % 2 == 0;
        let ray = if is_free { free_ray(&mut random) } else { some_ray(&mut random, &accel) };
        // What is met on the way, of anything.
        let exclude = accel.closest(&ray);
        let faces = [Faces::Both, Faces::Front, Faces::Back][random.below(3)];
        let exclude = exclude.as_ref().filter(|_| random.unit() < 0.5);
        let options = Query { mask: 1 << random.below(3), exclude, faces, filter: None };
        for isa in Isa::all() {
            let plain = accel.closest_with_exact_at(isa, &ray, &options);
            let bits = |hit: &Option<Hit>| hit.as_ref().map(|hit| hit.root.t.to_bits());
            let found = accel.closest_with_at(isa, &ray, &options);
            assert_eq!(found, plain, "{isa:?} {ray:?} {options:?}");
            assert_eq!(bits(&found), bits(&plain), "{isa:?} {ray:?} {options:?}");
            assert_eq!(
                accel.any_with_at(isa, &ray, &options),
                plain.is_some(),
                "{isa:?} {ray:?} {options:?}"
            );
            let single = accel.filtered_closest_at(isa, &ray, &options);
            free += u32::from(is_free);
            told += u32::from(is_free && single != Outcome::Uncertain);
            hits += u32::from(plain.is_some());
        }
    }
    assert!(hits > free && told > free * 49 / 50, "{hits} hits; {told} told of {free}");
}

#[test]
fn it_tells_of_nearly_all_rays_that_nobody_aims() {
    let mut random = Random(402);
    let accel = everything(&mut random);
    let rays: Vec<_> = (0..3_000).map(|_| free_ray(&mut random)).collect();
    let told = check(&accel, &rays);
    assert!(told > 2_950, "{told}");
}

/// Where a ball stands of which rays can meet a corner exactly, and its mesh.
const ASIDE: DVec3 = DVec3::new(5.5, -2.25, 4.0);

fn ball() -> TriangleMesh {
    icosphere(2, DVec3::ZERO, 0.7)
}

/// A tree in which rays can go together everywhere, of instances that overlap, move, stand twice in one place and hold
/// one another.
fn company(random: &mut Random, is_endless: bool) -> Accel {
    let zero = DVec3::ZERO;
    let ball = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(ball()))]));
    let long = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(needle()))]));
    let shapes = (0..9).map(|_| GeometryKind::Shape(shape(random, zero, 1.0))).collect();
    let mut within = vec![GeometryKind::Mesh(Arc::new(icosphere(1, zero, 0.5)))];
    within.extend((0..5).map(|_| placed(&ball, random.placement(zero, 1.0, 0.5))));
    let mut trees = vec![ball, long, Arc::new(build(shapes)), Arc::new(build(within))];
    if is_endless {
        let plane = Plane::new(-0.9 * DVec3::Y, random.vector()).unwrap();
        let plane = PlacedShape::new(plane.into(), Transform::IDENTITY);
        trees.push(Arc::new(build(vec![GeometryKind::Shape(plane)])));
    }
    let mesh = TriangleMesh { origin: CENTER, ..icosphere(2, zero, 1.2) };
    // What stands in the tree itself is placed in the same place, too.
    let again = Arc::new(build(vec![GeometryKind::Mesh(Arc::new(mesh.clone()))]));
    let mut kinds = vec![placed(&again, Transform::IDENTITY), GeometryKind::Mesh(Arc::new(mesh))];
    kinds.push(placed(&trees[0], Transform::translate(ASIDE)));
    kinds.extend((0..6).map(|_| GeometryKind::Shape(shape(random, CENTER, 3.0))));
    for tree in &trees {
        for size in [0.2, 0.5, 1.0] {
            let map = random.placement(CENTER, 3.0, size);
            kinds.extend([placed(tree, map), placed(tree, map)]);
        }
        let first = random.placement(CENTER, 3.0, 0.5);
        let moved = Transform::translate(random.vector()) * first;
        let motion = AnimatedTransform::new(vec![(0.0, first), (1.0, moved)]);
        let instance = tree.instance(motion.unwrap());
        kinds.push(GeometryKind::Instance(instance));
    }
    build(kinds)
}

#[test]
fn packets_through_instances_answer_as_single_rays() {
    super::scenes::with_every_preset(|| {
        let mut random = Random(408);
        for is_endless in [false, true] {
            let accel = company(&mut random, is_endless);
            assert_eq!(accel.only_triangles(), Some(false));
            let (mut together, mut within) = (0, 0);
            for i in 0..600 {
                let spread = [1e-4, 3e-3, 0.03, 0.1][i % 4];
                let (mut eye, mut target) = (CENTER + 7.0 * random.vector(), CENTER + 2.0 * random.vector());
                let is_aimed = i % 5 == 0;
                if is_aimed {
                    target = ASIDE + vertex(&ball(), random.below(40) as u32);
                    eye = target - 3.0 * [DVec3::X, -DVec3::Y, DVec3::Z][random.below(3)];
                }
                let (along, away) = (target - eye, [0.0, 1e-3, 0.05][i % 3]);
                let t_max = [f64::INFINITY, random.between(0.5, 1.5)][i / 2 % 2];
                let rays: [Ray; PACKET] = std::array::from_fn(|place| {
                    let apart = if is_aimed && place % 4 == 0 { 0.0 } else { 1.0 };
                    let direction = along + apart * spread * along.length() * random.vector();
                    let from = eye + apart * away * random.vector();
                    Ray::new(from, direction).with_range(1e-3, t_max).at_time(random.unit())
                });
                check_packet(&accel, &rays);
                let answered = batch::shims::answered_by_packet(accel.isa, &accel.tree, &rays);
                together += answered.count_ones();
                let is_within = |ray: &&Ray| accel.closest(ray).is_some_and(|hit| !hit.route.is_empty());
                if answered == packet::ALL {
                    within += rays.iter().filter(is_within).count();
                }
            }
            assert!(together > 1_200 && within > 400, "{together} together, {within} of them in instances");
        }
    });
}

#[test]
fn of_hits_at_one_place_the_first_in_the_lists_wins() {
    let zero = DVec3::ZERO;
    let mesh = Arc::new(icosphere(2, zero, 1.0));
    let ball = PlacedShape::new(Sphere::new(3.0 * DVec3::X, 0.5).unwrap().into(), Transform::IDENTITY);
    let flat = Arc::new(build(vec![GeometryKind::Mesh(Arc::clone(&mesh))]));
    let round = Arc::new(build(vec![GeometryKind::Shape(ball.clone()), GeometryKind::Shape(ball.clone())]));
    let nested = Arc::new(build(vec![
        placed(&round, Transform::IDENTITY),
        placed(&flat, Transform::IDENTITY),
        placed(&flat, Transform::IDENTITY),
    ]));
    let same = Transform::IDENTITY;
    let instances = [placed(&nested, same), placed(&flat, same), placed(&round, same), placed(&flat, same)];
    let mut random = Random(403);
    for first in 0..instances.len() {
        let mut kinds: Vec<_> = instances.to_vec();
        kinds.rotate_left(first);
        for has_own in [false, true] {
            if has_own {
                kinds.push(GeometryKind::Mesh(Arc::clone(&mesh)));
                kinds.push(GeometryKind::Shape(ball.clone()));
            }
            let accel = build(kinds.clone());
            let rays: Vec<_> = (0..300)
                .map(|i| {
                    let target = if i % 2 == 0 { zero } else { 3.0 * DVec3::X };
                    let from = 5.0 * random.vector();
                    Ray::new(from, target + 0.4 * random.vector() - from)
                })
                .collect();
            assert!(check(&accel, &rays) > 280);
            for ray in &rays {
                let hit = accel.closest(ray);
                assert_eq!(hit, brute::closest(&accel.tree, ray));
                assert_eq!(hit.is_some_and(|hit| hit.instances.is_empty()), has_own && accel.any(ray));
            }
        }
    }
}

#[test]
fn trees_are_searched_however_deep_they_stand() {
    let mut random = Random(404);
    let mut accel = build(vec![GeometryKind::Mesh(Arc::new(icosphere(2, DVec3::ZERO, 1.0)))]);
    for depth in 1..=12 {
        let inner = Arc::new(accel);
        let shift = 0.3 * random.vector();
        accel = build(vec![
            GeometryKind::Mesh(Arc::new(icosphere(1, DVec3::ZERO, 0.9))),
            placed(&inner, Transform::translate(shift)),
            placed(
                &inner,
                Transform::translate(-shift) * Transform::scale(DVec3::new(-1.0, 0.7, 0.9)).unwrap(),
            ),
        ]);
        assert_eq!(accel.only_triangles(), (depth <= 8).then_some(false), "{depth}");
        if depth < 7 {
            let rays: Vec<_> = (0..100 >> (depth / 2)).map(|_| ray(&mut random, DVec3::ZERO, 2.0)).collect();
            check(&accel, &rays);
        }
    }
    let ray = Ray::new(5.0 * DVec3::Z, -DVec3::Z);
    assert_eq!(accel.closest(&ray), brute::closest(&accel.tree, &ray));
}
