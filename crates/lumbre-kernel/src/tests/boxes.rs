//! The proof in `node`, put to the test: a box that a ray reaches within its range is never passed by.
//!
//! Tried by hand: without the margin for single precision, this fails.

use lumbre_geometry::{Aabb, Ray};
use lumbre_math::{DVec3, Transform, Vec3};

use super::scenes::Random;
use crate::Ray32;
use crate::build::primitive::Bounds;
use crate::intersect::box_ray::{BoxRay, Slabs};
use crate::intersect::{
    Isa, intersect_boxes_at, intersect_each_at, read_at, start_filter_at, start_placed_at,
};
use crate::simd::LANE_BITS;
use crate::tree::filter_start::FilterStart;
use crate::tree::node::{Node, TreeSpace, WIDTH};
use crate::tree::summary::{Sizes, Summary};

fn tree_space(bounds: &Aabb) -> TreeSpace {
    let half = 0.5 * bounds.size();
    let scale = half.max_element().log2().ceil().exp2().recip();
    TreeSpace::new(bounds.center(), scale, (half * scale).length(), 1.0)
}

/// As a search prepares it.
fn prepared(tree_space: &TreeSpace, ray: &Ray) -> Option<BoxRay> {
    let mut boxes = BoxRay::passing_all();
    let (t_min, t_max) = (ray.t_min, ray.t_max);
    let meets = boxes.start_nearby(tree_space, ray, t_min, t_max)
        || boxes.start_anywhere(tree_space, ray, t_min, t_max);
    meets.then_some(boxes)
}

/// As the build does.
fn put_box(node: &mut Node, lane: usize, tree_space: &TreeSpace, bounds: &Aabb) {
    Bounds::near(tree_space, bounds, 2, 3).put(node, lane);
}

/// A component such as makes trouble.
fn component(random: &mut Random) -> f64 {
    match random.below(8) {
        0 => 0.0,
        1 => -0.0,
        2 => 5e-324,
        3 => -1e-310,
        4 => random.between(-1.0, 1.0) * 10f64.powf(random.between(-30.0, 0.0)),
        _ => random.between(-1.0, 1.0),
    }
}

fn reached_boxes_are_met(isa: Isa, seed: u64, rounds: usize) {
    let mut random = Random(seed);
    let (mut met, mut met_by_single) = (0, 0);
    for _ in 0..rounds {
        let size = 10f64.powf(random.between(-20.0, 20.0));
        let offset = random.vector() * size * 10f64.powf(random.between(-2.0, 6.0));
        let whole = Aabb { min: offset - size * random.between(0.1, 1.0), max: offset + size };
        let tree_space = tree_space(&whole);
        let mut node = Node::EMPTY;
        let mut boxes = Vec::new();
        for lane in 0..WIDTH {
            // Small, flat, or the whole.
            let inside = |random: &mut Random| {
                whole.min + whole.size() * DVec3::new(random.unit(), random.unit(), random.unit())
            };
            let (a, mut b) = (inside(&mut random), inside(&mut random));
            b = a.lerp(b, 10f64.powf(random.between(-9.0, 0.0)));
            if random.unit() < 0.3 {
                b[lane % 3] = a[lane % 3];
            }
            let bounds = Aabb::around([a, b]);
            put_box(&mut node, lane, &tree_space, &bounds);
            boxes.push(bounds);
        }
        for (lane, bounds) in boxes.iter().enumerate() {
            // A point of the box, often on its corners, edges and faces.
            let mut target = bounds.min;
            for axis in 0..3 {
                let along = [0.0, 1.0, random.unit()][random.below(3)];
                target[axis] = (bounds.min[axis] + along * (bounds.max[axis] - bounds.min[axis]))
                    .clamp(bounds.min[axis], bounds.max[axis]);
            }
            let direction =
                DVec3::new(component(&mut random), component(&mut random), component(&mut random))
                    * 10f64.powf(random.between(-100.0, 100.0));
            if direction.abs().max_element() == 0.0 {
                continue;
            }
            // From where t leads to the target, up to rounding. Origins on the planes too.
            let distance = size * 10f64.powf(random.between(-8.0, 4.0));
            let t = if random.unit() < 0.1 { 0.0 } else { distance / direction.abs().max_element() };
            if !t.is_finite() || t > 1e250 {
                continue;
            }
            let ray = Ray::new(target - t * direction, direction);
            let (t_min, t_max) =
                [(t, t), (0.0, t), (t, f64::INFINITY), (f64::NEG_INFINITY, f64::INFINITY)][random.below(4)];
            let ray = ray.with_range(t_min, t_max);
            let boxes =
                prepared(&tree_space, &ray).unwrap_or_else(|| panic!("{ray:?} misses {tree_space:?}"));
            let (mask, keys) = intersect_boxes_at(isa, &node, &boxes.slabs);
            assert!(mask & (1 << lane) != 0, "{ray:?} at {t} misses {bounds:?} of {tree_space:?}");
            // A hit at t must not be culled by a limit of t either.
            let limit_key = boxes.progress.up(t).to_bits() as i32 | LANE_BITS;
            assert!(keys[lane] <= limit_key, "{ray:?} at {t}");
            met += 1;

            // The same from nearby, in single precision before anything else.
            let longest = direction.abs().max_element();
            let direction = direction / longest * (size * random.between(0.01, 30.0));
            let distance = size * [0.0, random.unit(), 7.0 * random.unit()][random.below(3)];
            let t = distance / direction.abs().max_element();
            let range = [(t, t), (0.0, t), (t, f64::INFINITY), (0.0, f64::INFINITY)][random.below(4)];
            let ray = Ray::new(target - t * direction, direction).with_range(range.0, range.1);
            let start = start_of(&tree_space, random.vector() * size);
            let Some((slabs, ..)) = start.and_then(|start| start_filter_at(isa, &start, &ray)) else {
                continue;
            };
            let (mask, _) = intersect_boxes_at(isa, &node, &slabs);
            assert!(
                mask & (1 << lane) != 0,
                "{ray:?} at {t} misses {bounds:?} of {tree_space:?} in single precision"
            );
            met_by_single += 1;
        }
    }
    assert!(met > rounds * 5 && met_by_single > rounds, "{met} {met_by_single}");
}

/// For a tree of a mesh at this origin.
fn start_of(tree_space: &TreeSpace, first_origin: DVec3) -> Option<FilterStart> {
    let sizes = Sizes { largest_corner: (1.0 / tree_space.scale) as f32, ..Sizes::default() };
    let summary = Summary {
        only_triangles: true,
        nesting: 0,
        has_one_origin: true,
        first_origin,
        sizes,
        has_one_cloud_origin: true,
        masks_within: false,
    };
    FilterStart::new(&summary, tree_space, Some(0))
}

#[test]
fn rays_start_in_placed_trees_as_they_would_there() {
    let mut random = Random(54);
    let (mut started, rounds) = (0, 20_000);
    for _ in 0..rounds {
        let center = random.vector() * 10f64.powf(random.between(-2.0, 6.0));
        let half = DVec3::splat(10f64.powf(random.between(-3.0, 3.0)));
        let tree_space = tree_space(&Aabb { min: center - half, max: center + half });
        let Some(start) = start_of(&tree_space, center + random.vector() * half) else { continue };
        let factors = DVec3::new(random.between(0.2, 4.0), -random.between(0.2, 4.0), 1.0);
        let map = Transform::translate(random.vector() * 10f64.powf(random.between(-2.0, 6.0)))
            * Transform::rotate(random.vector(), random.between(-180.0, 180.0)).unwrap()
            * Transform::scale(factors).unwrap();
        // From within the tree's surroundings or from far away; some along an axis there.
        let distance = 10f64.powf(random.between(-2.0, 2.0));
        let from = center + random.vector() * half * distance;
        let direction = random.vector() * half;
        let direction = if random.below(4) == 0 { DVec3::new(direction.x, 0.0, -0.0) } else { direction };
        let ray = Ray::new(map.point(from), map.vector(direction)).at_time(random.unit());
        let range = [[0.0, f64::INFINITY], [0.0, 2.0], [1.5, 1.0], [-1.0, 1.0]][random.below(4)];
        let there = ray.into_object(&map).with_range(range[0], range[1]);
        for isa in Isa::all() {
            let (placed, slabs) = start_placed_at(isa, &start, &map, &ray, range);
            assert_eq!(format!("{placed:?}"), format!("{there:?}"), "{isa:?}");
            let expected = start_filter_at(isa, &start, &there).map(|(slabs, ..)| slabs);
            assert_eq!(slabs.is_some(), expected.is_some(), "{isa:?}");
            let (Some(slabs), Some(expected)) = (slabs, expected) else { continue };
            assert_eq!(bits_of(&slabs), bits_of(&expected), "{isa:?} of {there:?}");
            assert_eq!(slabs.sides, expected.sides, "{isa:?} of {there:?}");
            started += 1;
        }
    }
    assert!(started > rounds / 2 && started < 3 * rounds, "{started}");
}

#[test]
fn rays_are_read_as_they_were_written() {
    let mut random = Random(55);
    for _ in 0..if cfg!(miri) { 100 } else { 10_000 } {
        // Any bits at all, but no NaN, which is none like itself.
        let mut number = || f64::from_bits(random.bits());
        let mut wide = || std::iter::repeat_with(&mut number).find(|x| !x.is_nan()).expect("there is no end");
        let (origin, direction) = (DVec3::new(wide(), wide(), wide()), DVec3::new(wide(), wide(), wide()));
        let ray = Ray { origin, direction, t_min: wide(), t_max: wide(), time: wide() };
        let mut number = || f32::from_bits(random.bits() as u32);
        let mut single =
            || std::iter::repeat_with(&mut number).find(|x| !x.is_nan()).expect("there is no end");
        let (origin, direction) =
            (Vec3::new(single(), single(), single()), Vec3::new(single(), single(), single()));
        let f32_ray = Ray32 { origin, t_min: single(), direction, t_max: single() };
        for isa in Isa::all() {
            let expected = (ray, f32_ray);
            assert_eq!(read_at(isa, &ray, &f32_ray), expected, "{isa:?}");
        }
    }
}

/// All numbers that mean anything.
fn bits_of(slabs: &Slabs) -> Vec<u32> {
    let rows = [&slabs.inverse, &slabs.near_offset, &slabs.far_offset];
    let ends = [slabs.s_min(), slabs.s_max()];
    rows.into_iter().flat_map(|row| &row[..3]).chain(&ends).map(|x| x.to_bits()).collect()
}

#[test]
fn a_box_that_holds_the_point_at_t_is_always_met() {
    for (i, isa) in Isa::all().into_iter().enumerate() {
        reached_boxes_are_met(isa, 51 + i as u64, 70_000);
    }
}

#[test]
fn rays_together_meet_the_boxes_that_each_meets_alone() {
    let mut random = Random(77);
    let (mut met_by_few, mut missed) = (0, 0);
    let rounds = if cfg!(miri) { 20 } else { 3_000 };
    for round in 0..rounds {
        let whole = Aabb { min: DVec3::splat(-1.0), max: DVec3::splat(1.0) };
        let tree_space = tree_space(&whole);
        let mut node = Node::EMPTY;
        for lane in 0..WIDTH - round % 3 {
            let center = random.vector();
            let half = random.between(0.05, 0.6) * DVec3::new(random.unit(), random.unit(), random.unit());
            put_box(&mut node, lane, &tree_space, &Aabb { min: center - half, max: center + half });
        }
        let start = start_of(&tree_space, DVec3::ZERO).expect("it is of a usual size");
        let (from, to) = (4.0 * random.vector(), random.vector());
        let signs = (to - from).signum();
        for isa in Isa::all() {
            let rays: [Slabs; WIDTH] = std::array::from_fn(|_| {
                let origin = from + 0.3 * random.vector();
                let direction = (to + 0.5 * random.vector() - origin).abs() * signs;
                let ray = Ray::new(origin, direction).with_range(0.0, random.between(0.5, 3.0));
                let (slabs, ..) = start_filter_at(isa, &start, &ray).expect("it is from nearby");
                slabs
            });
            let (alive, children) = (random.below(1 << 16) as u32, random.below(1 << 16) as u32);
            let ((met, enters), alone) = intersect_each_at(isa, &node, &rays, alive, children);
            for child in (0..WIDTH).filter(|child| children >> child & 1 != 0) {
                let those =
                    alone.iter().enumerate().filter(|(i, (met, _))| alive >> i & 1 & met >> child != 0);
                let first = those.clone().map(|(_, (_, enters))| enters[child]).reduce(f32::min);
                assert_eq!(met >> child & 1 != 0, first.is_some(), "{isa:?}");
                if let Some(first) = first {
                    // A negative entry is replaced by the start of the ray, which is zero.
                    assert_eq!(enters[child], first, "{isa:?}");
                    met_by_few += usize::from(those.count() < 4);
                } else {
                    missed += 1;
                }
            }
            assert_eq!(met & !children, 0);
        }
    }
    assert!(met_by_few > rounds && missed > rounds, "{met_by_few} {missed}");
}

#[test]
fn boxes_far_from_the_ray_are_not_met() {
    // Else the test above would prove nothing.
    let mut random = Random(53);
    let whole = Aabb { min: DVec3::new(1.0, 2.0, 3.0), max: DVec3::new(5.0, 6.0, 7.0) };
    let tree_space = tree_space(&whole);
    let mut node = Node::EMPTY;
    let bounds = Aabb { min: DVec3::new(2.0, 3.0, 4.0), max: DVec3::new(2.5, 3.5, 4.5) };
    put_box(&mut node, 0, &tree_space, &bounds);
    let mut missed = 0;
    for _ in 0..10_000 {
        let center = bounds.center();
        let direction = random.vector();
        // Past the box, further than its half diagonal but by little.
        let aside = direction.cross(random.vector()).normalize() * 0.434;
        let ray = Ray::new(center + aside - 20.0 * direction, direction);
        let mask =
            prepared(&tree_space, &ray).map_or(0, |ray| intersect_boxes_at(Isa::best(), &node, &ray.slabs).0);
        missed += u32::from(mask == 0);
    }
    assert_eq!(missed, 10_000);
}
