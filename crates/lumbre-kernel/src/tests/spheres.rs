//! Clouds of spheres: against the loop, against the same spheres as shapes, and the proof in `spheres` put to the test.
//!
//! Tried by hand: with a fortieth of both margins the test of a block loses hits.

use std::sync::Arc;

use lumbre_geometry::{PlacedShape, Ray, Sphere};
use lumbre_math::{DVec3, Transform};

use super::oracle::{check, check_batches, check_many};
use super::scenes::{Random, build, cloud, ray, with_every_preset};
use crate::intersect::{Isa, intersect_spheres_at};
use crate::trace::Outcome;
use crate::tree::BLOCK;
use crate::tree::sphere_block::{SphereBlock, SphereRay, has_radius};
use crate::{Accel, BuildError, BuildOptions, Geometry, GeometryKind, Hit, RefitError, SphereCloud};

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

fn spheres(cloud: SphereCloud) -> GeometryKind {
    GeometryKind::Spheres(Arc::new(cloud))
}

#[test]
fn a_tree_of_clouds_finds_what_a_loop_finds() {
    with_every_preset(|| {
        for (seed, origins) in
            [(1, vec![CENTER]), (2, vec![CENTER, CENTER]), (3, vec![CENTER, -2.0 * CENTER])]
        {
            let mut random = Random(seed);
            let clouds = origins.iter().map(|&origin| cloud(&mut random, 90, origin, CENTER, 3.0));
            let accel = build(clouds.map(spheres).collect());
            assert_eq!(accel.only_triangles(), Some(false));
            check_many(&accel, &mut random, CENTER, 3.0, 2_000);
            let rays: Vec<Ray> = (0..300).map(|_| ray(&mut random, CENTER, 3.0)).collect();
            assert!(check_batches(&accel, &rays) > 75);
        }
    });
}

#[test]
fn clouds_of_any_size_anywhere_lose_nothing() {
    for (seed, offset, extent) in [
        (4, 1e6, 3.0),
        (5, 1e10, 3.0),
        (6, 0.0, 1e-12),
        (7, 0.0, 1e12),
        (8, 0.0, 1e-30),
        (9, 0.0, 1e30),
        (10, 1e8, 1e-3),
    ] {
        let mut random = Random(seed);
        let center = DVec3::new(offset, -0.5 * offset, 0.25 * offset) + extent * CENTER;
        // Once with an origin that is not where the spheres are.
        for origin in [center, center - 7.0 * extent] {
            let accel = build(vec![spheres(cloud(&mut random, 60, origin, center, extent))]);
            check_many(&accel, &mut random, center, extent, 1_500);
        }
    }
}

/// Spheres that lie in one another, some of them twice, and some that touch.
fn crowd(random: &mut Random, origin: DVec3, extent: f64) -> SphereCloud {
    let mut crowd = cloud(random, 300, origin, origin + 0.5 * extent * CENTER, extent);
    let mut others = Vec::new();
    for &[x, y, z, radius] in crowd.spheres.iter().step_by(3) {
        others.push([x, y, z, radius]);
        others.push([x, y, z, 0.5 * radius]);
        others.push([x + 2.0 * radius, y, z, radius]);
    }
    crowd.spheres.extend(others);
    crowd
}

/// A ray to a sphere, or to where it would touch it; from afar, from a sphere, or from within one.
fn ray_among(random: &mut Random, cloud: &SphereCloud, extent: f64) -> Ray {
    let sphere = |random: &mut Random| {
        let [x, y, z, radius] = cloud.spheres[random.below(cloud.spheres.len())];
        (cloud.origin + DVec3::new(x.into(), y.into(), z.into()), f64::from(radius))
    };
    let (center, radius) = sphere(random);
    let from = match random.below(3) {
        0 => center + 3.0 * extent * random.vector(),
        1 => center + radius * random.vector().normalize(),
        _ => center + 0.9 * radius * random.vector(),
    };
    let (center, radius) = sphere(random);
    let across = (center - from).cross(random.vector()).normalize();
    let offset = match random.below(3) {
        0 => 1.0 + random.between(-1e-6, 1e-6),
        1 => 0.0,
        _ => random.between(0.0, 1.1),
    };
    let direction = (center + offset * radius * across - from) * random.between(0.1, 3.0);
    let ray = Ray::new(from, direction);
    match random.below(4) {
        0 => ray.with_range(0.0, random.between(0.2, 1.1)),
        1 => ray.with_range(random.between(0.0, 0.5), f64::INFINITY),
        _ => ray,
    }
}

#[test]
fn single_precision_has_the_bits_of_double_among_spheres() {
    let mut random = Random(18);
    for (extent, offset) in [(3.0, 0.0), (1e-6, 0.0), (3e7, 1.0), (0.02, 5e4)] {
        let cloud = crowd(&mut random, extent * offset * DVec3::new(1.0, -0.7, 0.4), extent);
        let accel = build(vec![spheres(cloud.clone())]);
        let mut rays: Vec<Ray> = (0..4_000).map(|_| ray_among(&mut random, &cloud, extent)).collect();
        rays[70].direction = DVec3::ZERO;
        rays[71].origin += 1e3 * extent;
        let expected: Vec<Option<Hit>> =
            rays.iter().map(|ray| accel.closest_exact_at(Isa::best(), ray)).collect();
        assert!(expected.iter().flatten().count() > 2_000);
        for isa in Isa::all() {
            let mut uncertain = 0;
            for (ray, hit) in rays.iter().zip(&expected) {
                match accel.filtered_at(isa, ray) {
                    Outcome::Certain(found) => assert_eq!(found, *hit, "{isa:?} {ray:?}"),
                    Outcome::Uncertain => uncertain += 1,
                }
                match accel.filtered_any_at(isa, ray) {
                    Outcome::Certain(is_hit) => assert_eq!(is_hit, hit.is_some(), "{isa:?} {ray:?}"),
                    Outcome::Uncertain => uncertain += 1,
                }
            }
            // One that is nothing and one from afar, twice each; and hardly another.
            assert!((4..12).contains(&uncertain), "{isa:?}: {uncertain}");
        }
        for (ray, hit) in rays.iter().zip(&expected) {
            assert_eq!(accel.closest(ray), *hit);
            assert_eq!(accel.any(ray), hit.is_some());
        }
    }
}

#[test]
fn a_placed_cloud_is_found_as_by_a_loop() {
    let mut random = Random(11);
    let inner = Arc::new(build(vec![spheres(cloud(&mut random, 60, CENTER, CENTER, 2.0))]));
    let instances = (0..5).map(|_| {
        let world_from_object = random.placement(CENTER, 2.0, 0.6) * Transform::translate(-CENTER);
        GeometryKind::Instance(inner.instance(world_from_object))
    });
    let accel = build(instances.collect());
    check_many(&accel, &mut random, CENTER, 3.0, 2_000);
}

#[test]
fn a_cloud_answers_as_shapes_do() {
    let mut random = Random(12);
    let origin = DVec3::new(1e5, -3e4, 0.1);
    let cloud = cloud(&mut random, 200, origin, origin + CENTER, 3.0);
    let there = cloud.spheres.iter().filter(|sphere| has_radius(sphere));
    let shapes = there.map(|&[x, y, z, radius]| {
        let center = origin + DVec3::new(x.into(), y.into(), z.into());
        let sphere = Sphere::new(center, radius.into()).unwrap();
        GeometryKind::Shape(PlacedShape::new(sphere.into(), Transform::IDENTITY))
    });
    let shapes = build(shapes.collect());
    let place: Vec<usize> = (0..cloud.spheres.len()).filter(|&i| has_radius(&cloud.spheres[i])).collect();
    let accel = build(vec![spheres(cloud)]);
    assert_eq!(accel.primitive_count(), shapes.primitive_count());
    let mut hits = 0;
    for _ in 0..3_000 {
        let ray = ray(&mut random, origin + CENTER, 3.0);
        let (hit, expected) = (accel.closest(&ray), shapes.closest(&ray));
        assert_eq!(hit.is_some(), expected.is_some(), "{ray:?}");
        assert_eq!(accel.count(&ray), shapes.count(&ray));
        if let (Some(hit), Some(expected)) = (hit, expected) {
            assert_eq!(hit.root, expected.root);
            assert_eq!(hit.primitive as usize, place[expected.geometry as usize]);
            assert_eq!(accel.surface(&ray, &hit), shapes.surface(&ray, &expected));
            hits += 1;
        }
    }
    assert!(hits > 700, "{hits}");
}

#[test]
fn a_cloud_takes_a_tenth_of_what_shapes_take() {
    let mut random = Random(13);
    let cloud = SphereCloud {
        origin: DVec3::ZERO,
        spheres: (0..5_000)
            .map(|_| {
                let [x, y, z] = (10.0 * random.vector()).as_vec3().to_array();
                [x, y, z, 0.1]
            })
            .collect(),
    };
    let accel = build(vec![spheres(cloud)]);
    let bytes = accel.memory_bytes() as f64 / accel.primitive_count() as f64;
    assert!(bytes < 34.0, "{bytes}");
}

#[test]
fn spheres_that_are_not_finite_are_refused_with_their_place() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for component in 0..4 {
            let mut broken = cloud(&mut Random(14), 20, CENTER, CENTER, 3.0);
            broken.spheres[13][component] = bad;
            let geometries = vec![Geometry { id: 3, kind: spheres(broken) }];
            let error = Accel::build(geometries, &BuildOptions::default()).unwrap_err();
            assert_eq!(error, BuildError::NotFinite { geometry: 0, element: 13 });
        }
    }
}

#[test]
fn spheres_without_a_radius_are_never_hit() {
    let bare = SphereCloud { origin: CENTER, spheres: vec![[0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, -2.0]] };
    let accel = build(vec![spheres(bare.clone())]);
    assert_eq!(accel.primitive_count(), 0);
    let at = |sphere: [f32; 4]| {
        let center = CENTER + DVec3::new(sphere[0].into(), sphere[1].into(), sphere[2].into());
        Ray::new(center - 4.0 * DVec3::Z, DVec3::Z)
    };
    assert!(bare.spheres.iter().all(|&sphere| !accel.any(&at(sphere))));
}

#[test]
fn a_cloud_is_refitted_unless_one_without_a_radius_gets_one() {
    let mut random = Random(15);
    let old = SphereCloud {
        origin: CENTER,
        spheres: (0..40).map(|i| [0.1 * i as f32, 0.0, 0.5, if i == 7 { 0.0 } else { 0.25 }]).collect(),
    };
    let geometries = |cloud: &SphereCloud| vec![Geometry { id: 9, kind: spheres(cloud.clone()) }];
    let mut accel = Accel::build(geometries(&old), &BuildOptions::default()).unwrap();
    let mut grown = old.clone();
    grown.spheres[7][3] = 0.5;
    let error = accel.refit(geometries(&grown)).unwrap_err();
    assert_eq!(error, RefitError::NeedsBuild { geometry: 0, element: 7 });
    let mut moved = old.clone();
    for (i, sphere) in moved.spheres.iter_mut().enumerate() {
        sphere[1] += i as f32 * 0.3;
    }
    // One that loses its radius is no longer hit.
    moved.spheres[20][3] = 0.0;
    accel.refit(geometries(&moved)).unwrap();
    assert_eq!(accel.primitive_count(), 38);
    let hits: usize = (0..1_000)
        .map(|i| {
            let to = CENTER + DVec3::new(0.1, 0.3, 0.0) * f64::from(i % 40) + DVec3::new(0.0, 0.0, 0.5);
            let from = to + 9.0 * random.vector();
            check(&accel, &Ray::new(from, to + 0.2 * random.vector() - from))
        })
        .sum();
    assert!(hits > 800, "{hits}");
    let shorter = SphereCloud { spheres: old.spheres[1..].to_vec(), ..old };
    let error = accel.refit(geometries(&shorter)).unwrap_err();
    assert_eq!(error, RefitError::OtherTopology { geometry: 0 });
}

#[test]
fn a_cloud_holds_points_as_balls_do() {
    let mut random = Random(16);
    let cloud = cloud(&mut random, 80, CENTER, CENTER, 3.0);
    let map = Transform::translate(DVec3::new(9.0, 8.0, -7.0));
    let accel = Arc::new(build(vec![spheres(cloud.clone())]));
    let placed = build(vec![GeometryKind::Instance(accel.instance(map))]);
    let mut inside = 0;
    for _ in 0..1_000 {
        let p = CENTER + 3.0 * random.vector();
        let summary = |&[x, y, z, radius]: &[f32; 4]| {
            (p - CENTER - DVec3::new(x.into(), y.into(), z.into())).length() < radius.into()
        };
        let around = cloud.spheres.iter().filter(|sphere| summary(sphere)).count();
        assert_eq!(accel.is_inside(p), around % 2 == 1, "{p}");
        assert_eq!(placed.is_inside(map.point(p)), around % 2 == 1, "{p}");
        assert_eq!(accel.winding_number(p), Ok(around as f64), "{p}");
        inside += usize::from(around > 0);
    }
    assert!(inside > 100, "{inside}");
}

#[test]
fn rays_that_touch_are_found_as_by_a_loop() {
    let unit = SphereCloud { origin: CENTER, spheres: vec![[0.0, 0.0, 0.0, 1.0], [4.0, 0.0, 0.0, 1.0]] };
    let accel = build(vec![spheres(unit)]);
    let touching = Ray::new(CENTER + DVec3::new(-3.0, 1.0, 0.0), DVec3::X);
    assert_eq!(check(&accel, &touching), 2);
    let hit = accel.closest(&touching).unwrap();
    assert_eq!((hit.root.t, hit.root.multiplicity), (3.0, 2));
    assert_eq!(check(&accel, &Ray { origin: touching.origin + 1e-9 * DVec3::Y, ..touching }), 0);
    // From a surface, and from within.
    assert_eq!(check(&accel, &Ray::new(CENTER + DVec3::X, DVec3::X)), 3);
    assert_eq!(check(&accel, &Ray::new(CENTER, DVec3::new(0.3, 0.2, 0.1))), 1);
}

struct Tally {
    hits: u32,
    kept: u32,
    sure: u32,
}

/// One ray at one block at every instruction set.
fn compare(block: &SphereBlock, ray: &Ray, origin: DVec3, tally: &mut Tally) {
    let largest = |list: &[f32]| list.iter().fold(0.0f32, |most, x| most.max(x.abs()));
    let reach = f64::from(largest(block.centers.as_flattened())) + f64::from(largest(&block.radii));
    let Some((mut spheres, length)) = SphereRay::new(ray, &origin, reach) else { return };
    spheres.set_range(length, ray.t_min, ray.t_max);
    for isa in Isa::all() {
        let (mask, sure) = intersect_spheres_at(isa, block, &spheres);
        for lane in 0..BLOCK {
            let root = block.sphere(lane, &origin).closest(ray);
            let is_hit = root.is_some();
            let is_in = |mask: u32| mask >> lane & 1 != 0;
            assert!(!is_hit || is_in(mask), "{isa:?} loses lane {lane} along {ray:?} of {block:?}");
            assert!(is_hit || !is_in(sure), "{isa:?} invents lane {lane} along {ray:?} of {block:?}");
            tally.hits += u32::from(is_hit);
        }
        tally.kept += mask.count_ones();
        tally.sure += sure.count_ones();
    }
}

/// Rays from anywhere, often nearly tangent, or whose range ends at a crossing.
fn bombard(seed: u64, center: DVec3, spread: f64, size: f64, distance: f64, shift: DVec3) -> Tally {
    let mut random = Random(seed);
    let mut tally = Tally { hits: 0, kept: 0, sure: 0 };
    for _ in 0..600 {
        let mut block = SphereBlock::EMPTY;
        for lane in 0..BLOCK - 1 {
            let [x, y, z] = (center + spread * random.vector()).as_vec3().to_array();
            block.put(lane, [x, y, z, (size * random.between(0.1, 1.0)) as f32]);
        }
        for _ in 0..12 {
            let sphere = block.sphere(random.below(BLOCK - 1), &shift);
            let direction = random.vector() * 10f64.powf(random.between(-3.0, 3.0));
            let across = direction.cross(random.vector()).normalize();
            let offset = match random.below(4) {
                // Next to the place where it touches.
                0 => 1.0 + random.between(-3e-7, 3e-7),
                1 => 1.0 + random.between(-1e-14, 1e-14),
                2 => 0.0,
                _ => random.between(0.0, 1.2),
            };
            let target = sphere.center + offset * sphere.radius * across;
            let reach = distance * random.between(0.0, 2.0) / direction.length();
            let whole =
                Ray::new(target - reach * direction, direction).with_range(f64::NEG_INFINITY, f64::INFINITY);
            let end = sphere.closest(&whole).map_or(reach, |root| root.t);
            let (t_min, t_max) = match random.below(5) {
                0 => (f64::NEG_INFINITY, f64::INFINITY),
                1 => (f64::NEG_INFINITY, end),
                2 => (end, f64::INFINITY),
                3 => (f64::NEG_INFINITY, end.next_down()),
                _ => (0.0, f64::INFINITY),
            };
            compare(&block, &whole.with_range(t_min, t_max), shift, &mut tally);
        }
    }
    tally
}

#[test]
fn the_test_of_a_block_loses_nothing_and_invents_nothing() {
    let center = DVec3::new(1.5, -0.75, 2.25);
    for (seed, scale) in [(71, 1.0), (72, 1e-11), (73, 1e11)] {
        // Alike in size and distance; small; large and near; far away; all but on the surface.
        for (spread, size, distance) in
            [(1.0, 1.0, 4.0), (0.3, 0.003, 5.0), (1.0, 30.0, 0.1), (1.0, 0.1, 1e5), (1e-6, 1.0, 1e-9)]
        {
            for shift in [DVec3::ZERO, DVec3::new(3.0, -5.0, 1e6)] {
                let tally = bombard(
                    seed,
                    scale * center,
                    scale * spread,
                    scale * size,
                    scale * distance,
                    scale * shift,
                );
                assert!(tally.hits > 3000, "{}", tally.hits);
            }
        }
    }
}

#[test]
fn no_ray_is_tested_where_single_precision_tells_nothing() {
    let ray = |scale: f64| Ray::new(scale * DVec3::X, scale * DVec3::Z);
    let is_tested = |scale| SphereRay::new(&ray(scale), &DVec3::ZERO, scale).is_some();
    assert!([1e-12, 1.0, 1e17].into_iter().all(is_tested));
    assert!(![1e-13, 1e-30, 1e19, 1e30, 1e300].into_iter().any(is_tested));
    assert!(SphereRay::new(&ray(f64::NAN), &DVec3::ZERO, 1.0).is_none());
}

#[test]
fn the_test_of_a_block_is_sharp() {
    let center = DVec3::new(1.5, -0.75, 2.25);
    for size in [1.0, 0.1, 0.01] {
        let Tally { hits, kept, sure } = bombard(77, center, 1.0, size, 5.0, DVec3::ZERO);
        assert!(f64::from(kept) < 2.0 * f64::from(hits), "{kept} for {hits}");
        assert!(f64::from(sure) > 0.2 * f64::from(hits), "{sure} of {hits}");
    }
}
