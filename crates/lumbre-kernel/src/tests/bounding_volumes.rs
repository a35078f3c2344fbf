//! The first test of shapes: against every shape's own in double precision, and in trees against the loop.
//!
//! Tried by hand: half of all margins, a tenth of the tolerance, and no error for tubes each make a test fail.

use std::sync::Arc;

use lumbre_geometry::{
    Aabb, Capsule, Csg, Cuboid, Cylinder, Hyperboloid, PlacedShape, Plane, Quadric, Ray, Shape, Sphere,
    Torus, Triangle,
};
use lumbre_math::{DVec2, DVec3, Transform};

use super::oracle::check_many;
use super::scenes::{self, Random, build, with_every_preset};
use super::single::check_packet;
use crate::batch;
use crate::batch::packet::PACKET;
use crate::intersect::watertight::HeightRange;
use crate::intersect::{Isa, intersect_bounding_volumes_at};
use crate::trace::decide::heights;
use crate::tree::BLOCK;
use crate::tree::bounding_block::{BoundingBlock, BoundingVolumeRay, BoundingVolumes};
use crate::tree::node::TreeSpace;
use crate::tree::packed::Entry;
use crate::{Geometry, GeometryKind};

/// A shape of any kind within about `size` of `center`, now and then squeezed to a thousandth on an axis, or tiny.
fn shape(random: &mut Random, center: DVec3, size: f64) -> PlacedShape {
    let ball = Sphere::new(0.2 * random.vector(), random.between(0.2, 1.0)).unwrap();
    let kind: Shape = match random.below(12) {
        0 => Capsule::new(random.vector(), random.vector(), random.between(0.1, 0.6)).unwrap().into(),
        1 => Hyperboloid::new(random.vector(), random.vector(), random.between(90.0, 360.0)).unwrap().into(),
        2 => Torus::new(0.2 * random.vector(), random.vector(), 0.5, 0.5).unwrap().into(),
        3 => Torus::new(0.2 * random.vector(), random.vector(), 0.3, 0.6).unwrap().into(),
        4 => {
            let clip = Aabb { min: DVec3::splat(-0.9), max: DVec3::splat(0.8) };
            Quadric::new([1.0, -1.0, 0.5, 0.1, 0.0, 0.3, 0.0, 0.2, 0.0, -0.2], Some(clip)).unwrap().into()
        }
        5 => Quadric::new([1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.4, 0.1, 0.2, -0.8], None).unwrap().into(),
        6 => Csg::leaf(PlacedShape::new(ball.into(), Transform::IDENTITY)).unwrap().into(),
        7 => Cuboid::new(DVec3::new(-0.8, 0.3, -0.5), DVec3::new(0.7, 0.3, 0.6)).unwrap().into(),
        8 => Cylinder::new(random.vector(), random.vector(), 0.01, true).unwrap().into(),
        9 => ball.into(),
        _ => return scenes::shape(random, center, size),
    };
    let mut factors = DVec3::splat(size * random.between(0.1, 0.5));
    match random.below(5) {
        0 => factors[random.below(3)] *= 1e-3,
        1 => factors *= 1e-2,
        2 => factors *= random.vector() + 1.3,
        _ => {}
    }
    let place = Transform::translate(center + 0.4 * size * random.vector())
        * Transform::rotate(random.vector(), random.between(-180.0, 180.0)).unwrap()
        * Transform::scale(factors).unwrap();
    PlacedShape::new(kind, place)
}

/// Units of a tree that reaches so far from its origin.
fn tree_space(origin: DVec3, reach: f64) -> TreeSpace {
    let scale = (-reach.log2().ceil()).exp2();
    TreeSpace::new(origin, scale, reach * scale * 1.8, 100.0)
}

/// A point on a shape, if it is one with points at hand, and the normal there.
fn on_surface(random: &mut Random, shape: &PlacedShape) -> Option<(DVec3, DVec3)> {
    let sample = shape.sample_area(DVec2::new(random.unit(), random.unit()))?;
    Some((sample.surface.point, sample.surface.normal))
}

/// A ray at a shape: at its points, along its surface within a hair's breadth, from it, from far away or nearby.
fn ray(random: &mut Random, shape: &PlacedShape, center: DVec3, size: f64) -> Ray {
    let (at, normal) =
        on_surface(random, shape).unwrap_or((center + size * random.vector(), random.vector()));
    let distance = size * [0.01, 1.0, 3.0, 12.0][random.below(4)];
    let tangent = normal.cross(random.vector()).normalize_or(DVec3::X);
    let hair = size * 10f64.powf(random.between(-16.0, -2.0)) * random.between(-1.0, 1.0);
    let ray = match random.below(5) {
        0 => Ray::new(at + distance * random.vector(), DVec3::ZERO),
        1 => Ray::new(at + distance * tangent + hair * normal, -tangent),
        2 => Ray::new(at + hair.abs() * normal, random.vector()),
        3 => Ray::new(at + distance * normal, -normal),
        _ => Ray::new(center + size * random.vector(), random.vector()),
    };
    let mut direction = if ray.direction == DVec3::ZERO { at - ray.origin } else { ray.direction };
    direction *= 10f64.powf(random.between(-2.0, 2.0));
    if random.unit() < 0.1 {
        direction[random.below(3)] = [0.0, -0.0, 1e-300][random.below(3)];
    }
    let ray = Ray { direction, ..ray };
    let Some(root) = shape.closest(&ray) else { return ray };
    // An end of the range just before or behind a hit, or at it.
    let t = root.t * (1.0 + [0.0, 1e-12, -1e-12, 1e-4, -1e-4][random.below(5)]);
    match random.below(4) {
        0 => ray.with_range(0.0, t),
        1 => ray.with_range(t, f64::INFINITY),
        _ => ray,
    }
}

fn block_of(shapes: &[PlacedShape], tree_space: &TreeSpace) -> BoundingBlock {
    let mut block = BoundingBlock::EMPTY;
    for (lane, shape) in shapes.iter().enumerate() {
        block.put(lane, shape.bounding_volume(), tree_space);
    }
    block
}

#[test]
fn no_shape_that_is_met_is_lost_and_none_is_certain_that_is_not() {
    let mut random = Random(61);
    for (size, offset) in [(1.0, 0.0), (3.0, 1e4), (1e-5, 1.0), (2e6, 0.0), (0.4, 1e7)] {
        let origin = size * offset * DVec3::new(1.0, -0.7, 0.4);
        // As the only ones in their tree, and tiny ones in a large tree.
        for reach in [1.5, 40.0, 3000.0] {
            let tree_space = tree_space(origin, reach * size);
            let (mut hits, mut misses, mut sure, mut spared) = (0, 0, 0, 0);
            for _ in 0..150 {
                let center = origin + 0.9 * (reach - 1.4) * size * random.vector();
                let shapes: Vec<PlacedShape> =
                    (0..1 + random.below(BLOCK)).map(|_| shape(&mut random, center, size)).collect();
                let block = block_of(&shapes, &tree_space);
                for _ in 0..40 {
                    let aim = random.below(shapes.len());
                    let ray = ray(&mut random, &shapes[aim], center, size);
                    let length = ray.direction.abs().max_element();
                    let bounding_volumes = BoundingVolumeRay::new(&tree_space, &ray, length);
                    let range = HeightRange::new((ray.t_min * length) as f32, (ray.t_max * length) as f32);
                    for isa in Isa::all() {
                        let met = intersect_bounding_volumes_at(isa, &block, &bounding_volumes, &range);
                        assert_eq!(met.mask >> shapes.len(), 0, "{isa:?}: of lanes that are not there");
                        for (lane, shape) in shapes.iter().enumerate() {
                            let (is_met, is_sure) = (met.mask >> lane & 1 == 1, met.sure >> lane & 1 == 1);
                            if let Some(root) = shape.closest(&ray) {
                                assert!(is_met, "{isa:?}: {shape:?} along {ray:?}");
                                let (from, to) = heights(root.t, length);
                                assert!(met.near[lane] <= to, "{from}: {shape:?} along {ray:?}");
                                hits += 1;
                            } else {
                                assert!(!is_sure, "{isa:?}: {shape:?} along {ray:?}");
                                misses += 1;
                                spared += u32::from(!is_met);
                            }
                            sure += u32::from(is_sure);
                        }
                    }
                }
            }
            assert!(hits > 5_000 && misses > 5_000, "{hits} and {misses}");
            let is_sharp = reach < 1000.0 && offset < 1e6;
            assert!(!is_sharp || spared > misses / 2, "{spared} of {misses} were spared");
            assert!(!is_sharp || sure > hits / 20, "{sure} of {hits} were certain");
        }
    }
}

#[test]
fn what_single_precision_cannot_tell_is_never_left_out() {
    let tree_space = tree_space(DVec3::ZERO, 2.0);
    let tiny = Transform::scale(DVec3::splat(1e-9)).unwrap();
    let thin = Transform::scale(DVec3::new(1.0, 1e-9, 1.0)).unwrap();
    let ball = || Shape::from(Sphere::new(DVec3::ZERO, 1.0).unwrap());
    let needle = Triangle::new(DVec3::ZERO, DVec3::X, DVec3::new(0.5, 1e-12, 0.0)).unwrap();
    let flat = Triangle::new(DVec3::ZERO, DVec3::X, 0.5 * DVec3::X).unwrap();
    let shapes = [
        PlacedShape::new(ball(), tiny),
        PlacedShape::new(ball(), thin),
        PlacedShape::new(needle.into(), Transform::IDENTITY),
        PlacedShape::new(flat.into(), Transform::IDENTITY),
    ];
    let block = block_of(&shapes, &tree_space);
    let ray = Ray::new(DVec3::new(5.0, 6.0, 7.0), DVec3::new(1.0, 0.2, 0.1));
    for isa in Isa::all() {
        let range = HeightRange::new(0.0, f32::INFINITY);
        let met = intersect_bounding_volumes_at(
            isa,
            &block,
            &BoundingVolumeRay::new(&tree_space, &ray, 1.0),
            &range,
        );
        assert_eq!((met.mask, met.sure), (0b1111, 0), "{isa:?}");
        assert!(met.near[..4].iter().all(|near| near.is_nan() || *near <= 0.0), "{:?}", met.near);
    }
}

#[test]
fn a_leaf_of_any_length_has_its_blocks_in_a_row() {
    let mut random = Random(62);
    let lengths = [3, 19, 8, 1, 16];
    let count = lengths.iter().sum::<usize>();
    let geometries: Vec<Geometry> = (0..count)
        .map(|i| Geometry {
            id: i as u32,
            kind: GeometryKind::Shape(scenes::shape(&mut random, DVec3::ZERO, 1.0)),
        })
        .collect();
    let mut entries = Vec::new();
    for length in lengths {
        for i in 0..length {
            entries.push(Entry::new(entries.len() as u32, 0, i + 1 == length));
        }
    }
    let tree_space = tree_space(DVec3::ZERO, 3.0);
    let shape = |entry: &Entry| match &geometries[entry.geometry as usize].kind {
        GeometryKind::Shape(shape) => Some(shape),
        _ => None,
    };
    let bounding_volumes = BoundingVolumes::new(&entries, &tree_space, shape);
    let mut first = 0;
    for length in lengths {
        for start in (0..length).step_by(BLOCK) {
            let (block, goes_on) = bounding_volumes.block(first + start).unwrap();
            assert_eq!(goes_on, start + BLOCK < length);
            for lane in 0..BLOCK {
                let is_there = start + lane < length;
                assert_eq!(
                    block.heights[lane] != f32::NEG_INFINITY,
                    is_there,
                    "{start} and {lane} of {length}"
                );
                if is_there {
                    let mut alone = BoundingBlock::EMPTY;
                    let GeometryKind::Shape(shape) = &geometries[first + start + lane].kind else {
                        unreachable!()
                    };
                    alone.put(0, shape.bounding_volume(), &tree_space);
                    assert_eq!(alone.centers.map(|lanes| lanes[0]), block.centers.map(|lanes| lanes[lane]));
                }
            }
        }
        first += length;
    }
    assert!(bounding_volumes.block(first).is_none());
}

#[test]
fn a_tree_of_many_shapes_finds_what_a_loop_finds() {
    let mut random = Random(63);
    for (size, offset) in [(1.0, 0.0), (1e3, 50.0), (1e-6, 0.0), (1e-30, 0.0), (1e25, 1.0), (5.0, 1e9)] {
        let center = size * offset * DVec3::new(1.0, 0.6, -0.8);
        with_every_preset(|| {
            let kinds: Vec<GeometryKind> = (0..120)
                .map(|_| {
                    let place = center + size * random.vector();
                    let kind = shape(&mut random, place, size);
                    GeometryKind::Shape(kind)
                })
                .collect();
            let accel = build(kinds);
            check_many(&accel, &mut random, center, 2.0 * size, 600);
        });
    }
}

/// Rays that are near to each other, at a shape.
fn alike(random: &mut Random, shape: &PlacedShape, center: DVec3, size: f64) -> [Ray; PACKET] {
    let first = ray(random, shape, center, size);
    let apart = size * [0.0, 1e-9, 1e-3, 0.1][random.below(4)];
    let spread = first.direction.abs().max_element() * [0.0, 1e-9, 1e-3, 0.1][random.below(4)];
    std::array::from_fn(|_| {
        let origin = first.origin + apart * random.vector();
        Ray { origin, direction: first.direction + spread * random.vector(), ..first }
    })
}

#[test]
fn packets_among_shapes_answer_as_single_rays() {
    let mut random = Random(64);
    for (size, offset) in [(1.0, 0.0), (1e3, 50.0), (1e-6, 0.0), (0.4, 1e7)] {
        let center = size * offset * DVec3::new(1.0, 0.6, -0.8);
        let (mut together, mut apart) = (0, 0);
        for with in 0..4 {
            let shapes: Vec<_> = (0..60)
                .map(|_| {
                    let place = center + size * random.vector();
                    shape(&mut random, place, size)
                })
                .collect();
            let mut kinds: Vec<_> = shapes.iter().cloned().map(GeometryKind::Shape).collect();
            // The same twice: the first in the list is hit.
            kinds.push(kinds[7].clone());
            match with {
                0 => kinds.push(GeometryKind::Mesh(scenes::soup(&mut random, 40, center, size).into())),
                1 => {
                    let plane = Plane::new(center, DVec3::new(0.1, 1.0, 0.2)).unwrap();
                    kinds.push(GeometryKind::Shape(PlacedShape::new(plane.into(), Transform::IDENTITY)));
                }
                2 => {
                    let balls = scenes::balls(&mut random, 3, center, size, None);
                    kinds.push(GeometryKind::Custom(Arc::new(balls)));
                }
                _ => {}
            }
            let accel = build(kinds);
            for i in 0..if cfg!(miri) { 2 } else { 400 } {
                let rays = alike(&mut random, &shapes[i % shapes.len()], center, size);
                check_packet(&accel, &rays);
                let answered = batch::shims::answered_by_packet(accel.isa, &accel.tree, &rays);
                together += answered.count_ones();
                apart += answered.count_zeros() - (32 - PACKET as u32);
            }
        }
        assert!(cfg!(miri) || together > 4_000 && apart > 100, "{together} together, {apart} apart");
    }
}
