//! Options against a filter over all hits of the loop over everything.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Transform, Vec3};

use super::scenes::{
    Random, balls, build, cube, icosphere, mixture, ray, repeats, shape, soup, with_every_preset,
};
use crate::intersect::Isa;
use crate::{Accel, Faces, GeometryKind, Hit, Query, TriangleMesh, brute};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

/// The masks of what a hit is in, outermost first.
fn masks(accel: &Accel, hit: &Hit) -> Vec<u32> {
    let mut masks = Vec::new();
    let mut tree = &accel.tree;
    for &position in &hit.route {
        masks.push(tree.masks.get(position as usize).copied().unwrap_or(u32::MAX));
        let GeometryKind::Instance(instance) = &tree.geometries[position as usize].kind else { panic!() };
        tree = &instance.tree;
    }
    masks.push(tree.masks.get(hit.geometry as usize).copied().unwrap_or(u32::MAX));
    masks
}

fn counts(accel: &Accel, ray: &Ray, hit: &Hit, options: &Query) -> bool {
    let is_front = accel.surface(ray, hit).normal.dot(ray.direction) < 0.0;
    let is_face = match options.faces {
        Faces::Both => true,
        Faces::Front => is_front,
        Faces::Back => !is_front,
    };
    let place = |hit: &Hit| (hit.route.clone(), hit.geometry, hit.primitive);
    is_face
        && options.exclude.is_none_or(|excluded| place(excluded) != place(hit))
        && masks(accel, hit).iter().all(|mask| options.mask == u32::MAX || mask & options.mask != 0)
}

fn with_random_masks(accel: Accel, random: &mut Random) -> Accel {
    let masks = accel.tree.geometries.iter().map(|_| random.bits() as u32 & 0b111_0000).collect();
    accel.with_masks(masks)
}

#[test]
fn options_leave_what_a_filter_leaves() {
    let mut random = Random(61);
    let inner = mixture(&mut random, CENTER, 1.5, 0, false);
    let inner = Arc::new(with_random_masks(inner, &mut random));
    let outer = mixture(&mut random, CENTER, 3.0, 1, true);
    let mut kinds: Vec<_> = outer.tree.geometries.iter().map(|geometry| geometry.kind.clone()).collect();
    for _ in 0..3 {
        let place =
            Transform::translate(random.vector()) * Transform::scale(DVec3::new(-1.1, 0.9, 1.2)).unwrap();
        kinds.push(GeometryKind::Instance(inner.instance(place)));
    }
    let accel = build(kinds);
    assert_ne!(accel.only_triangles(), Some(true));
    // At first there are masks in instances alone, and then everywhere.
    check(&accel, &mut random);
    let placed = accel.instance(Transform::IDENTITY);
    check(&build(vec![GeometryKind::Instance(placed.clone())]), &mut random);
    check(&with_random_masks(accel, &mut random), &mut random);
}

#[test]
fn they_do_so_in_trees_that_single_precision_searches() {
    let mut random = Random(64);
    let zero = DVec3::ZERO;
    let meshes = [icosphere(2, zero, 1.5), soup(&mut random, 150, zero, 3.0), icosphere(1, zero, 2.2)];
    let meshes = meshes.map(|mesh| GeometryKind::Mesh(Arc::new(TriangleMesh { origin: CENTER, ..mesh })));
    let meshes = meshes.to_vec();
    let mut mixed = meshes.clone();
    mixed.extend((0..30).map(|_| GeometryKind::Shape(shape(&mut random, CENTER, 3.0))));
    mixed.push(GeometryKind::Custom(Arc::new(balls(&mut random, 10, CENTER, 3.0, Some(CENTER.y - 2.0)))));
    for kinds in [meshes, mixed] {
        with_every_preset(|| {
            let accel = build(kinds.clone());
            assert!(accel.tree.single.is_some());
            let masks = [0b011_0000, 0b101_0000, 0b010_0000].into_iter().cycle();
            let masks = masks.take(accel.tree.geometries.len()).collect();
            let accel = accel.with_masks(masks);
            check(&accel, &mut random);
        });
    }
}

#[test]
fn they_do_so_in_placed_trees_that_single_precision_searches() {
    let mut random = Random(65);
    let zero = DVec3::ZERO;
    // A long one is opened.
    let mut needle = icosphere(4, zero, 1.0);
    needle.positions.iter_mut().for_each(|p| *p *= Vec3::new(3.0, 0.2, 0.3));
    let meshes = [(icosphere(2, zero, 1.1), 0.8), (soup(&mut random, 120, zero, 1.5), 1.2), (needle, 0.1)];
    let trees = meshes.map(|(mesh, radius)| {
        let other = icosphere(1, zero, radius);
        let kinds = [mesh, other].map(|mesh| GeometryKind::Mesh(Arc::new(mesh)));
        let tree = build(kinds.to_vec());
        assert_eq!(tree.only_triangles(), Some(true));
        Arc::new(tree.with_masks(vec![0b011_0000, 0b101_0000]))
    });
    let placed = |random: &mut Random, accel: &Arc<Accel>, at: DVec3| {
        GeometryKind::Instance(accel.instance(random.placement(at, 2.0, 0.8)))
    };
    let pair = build(trees[..2].iter().map(|tree| placed(&mut random, tree, zero)).collect());
    let pair = Arc::new(pair.with_masks(vec![0b001_0000, 0b111_0000]));
    let kinds = (0..12).map(|i| placed(&mut random, [&trees[2], &pair, &trees[i % 2]][i % 3], CENTER));
    let accel = build(kinds.collect());
    assert!(accel.tree.packed.entries.len() > 12);
    check(&accel, &mut random);
    check(&with_random_masks(accel, &mut random), &mut random);
}

fn check(accel: &Accel, random: &mut Random) {
    let (mut hits, mut fewer) = (0, 0);
    let count = repeats(3000);
    for i in 0..count {
        let ray = ray(random, CENTER, 3.0);
        let all = brute::every(&accel.tree, &ray);
        let options = Query {
            mask: [u32::MAX, 0b001_0000, 0b110_0000][i % 3],
            exclude: if i % 2 == 0 { all.first() } else { None },
            faces: [Faces::Both, Faces::Front, Faces::Back][random.below(3)],
            filter: None,
        };
        let expected = all.iter().find(|hit| counts(accel, &ray, hit, &options)).cloned();
        for isa in Isa::all() {
            assert_eq!(accel.closest_with_at(isa, &ray, &options), expected, "{isa:?} {ray:?} {options:?}");
            assert_eq!(accel.any_with_at(isa, &ray, &options), expected.is_some(), "{isa:?} {ray:?}");
        }
        hits += usize::from(expected.is_some());
        fewer += usize::from(expected.as_ref() != all.first());
    }
    assert!(hits > count / 8 && fewer > count / 8, "{hits} {fewer}");
}

#[test]
fn a_closed_mesh_has_as_many_fronts_as_backs() {
    let mut random = Random(62);
    let ball = icosphere(3, CENTER, 1.2);
    let accel = build(vec![GeometryKind::Mesh(Arc::new(ball)), GeometryKind::Mesh(Arc::new(cube()))]);
    let mut hits = 0;
    for _ in 0..2000 {
        let outside = CENTER + 9.0 * random.vector().normalize();
        let target = CENTER + 0.7 * random.vector();
        let ray = Ray::new(outside, target - outside);
        let nearest = |faces| accel.closest_with(&ray, &Query { faces, ..Query::new() });
        let (both, front, back) = (nearest(Faces::Both), nearest(Faces::Front), nearest(Faces::Back));
        // From without, a front comes first, and a back behind it.
        assert_eq!(both, front);
        assert!(back.is_some() == front.is_some());
        if let (Some(front), Some(back)) = (front, back) {
            assert!(front.root.t < back.root.t);
            // The other way round, what was a back is a front.
            let far = ray.at(back.root.t);
            let return_ray = Ray::new(far, outside - far).with_range(-1e-9, 1.0);
            let options = Query { faces: Faces::Front, ..Query::new() };
            assert!(accel.any_with(&return_ray, &options));
            hits += 1;
        }
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn by_default_nothing_is_left_out() {
    let mut random = Random(63);
    let accel = mixture(&mut random, CENTER, 3.0, 1, false);
    let mut hits = 0;
    for _ in 0..1500 {
        let ray = ray(&mut random, CENTER, 3.0);
        let hit = accel.closest_with(&ray, &Query::new());
        assert_eq!(hit, accel.closest(&ray));
        assert_eq!(accel.any_with(&ray, &Query::new()), hit.is_some());
        hits += usize::from(hit.is_some());
    }
    assert!(hits > 400, "{hits}");
}
