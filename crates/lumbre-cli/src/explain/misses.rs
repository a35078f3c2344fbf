//! Shapes that a ray misses, and how near it passes them.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use lumbre::geometry::{Shape, Triangle};
use lumbre::kernel::{Hit, Target, TargetShape};
use lumbre::math::DVec3;
use lumbre::{Ray, Scene, Transform};

/// Maximum primitives that are tested.
const MAX_PRIMITIVES: usize = 1 << 20;
/// Points along the ray where the distance is computed first, and steps that refine it.
const PLACES: u32 = 48;
const STEPS: u32 = 80;

/// A primitive that a ray misses.
pub(super) struct Missed {
    /// The primitive, as a hit without a crossing.
    pub(super) hit: Hit,
    /// The nearest point of the ray to it, if it can be computed.
    pub(super) nearest: Option<Nearest>,
}

/// The nearest point of a ray to a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nearest {
    pub(super) distance: f64,
    pub(super) t: f64,
    /// Whether the distance is in the object's own space.
    pub(super) in_object: bool,
}

/// The missed shapes among the `wanted` that the ray passes nearest, in that order: for each its nearest primitive.
pub(super) fn nearest(scene: &Scene, ray: &Ray, most: usize, wanted: impl Fn(u32) -> bool) -> Vec<Missed> {
    let resolved = scene.resolved();
    let mut all: Vec<(f64, u32, Hit)> = Vec::new();
    resolved.accel().each_primitive(|hit| {
        let index = resolved.shape_index(hit);
        if wanted(index)
            && let Some((shape, map)) = placed(scene, ray, hit)
        {
            all.push((least_distance(&shape, &map, ray), index, hit.clone()));
        }
        if all.len() < MAX_PRIMITIVES { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let distance = |missed: &Missed| missed.nearest.map_or(f64::INFINITY, |nearest| nearest.distance);
    let mut found: BTreeMap<u32, Missed> = BTreeMap::new();
    for (least, index, hit) in all {
        // Skips what cannot be nearer than the shapes found so far.
        let mut so_far: Vec<f64> = found.values().map(distance).collect();
        so_far.sort_by(f64::total_cmp);
        let is_full = so_far.get(most.wrapping_sub(1)).is_some_and(|farthest| least > *farthest);
        if is_full {
            break;
        }
        if found.get(&index).is_some_and(|other| least > distance(other)) {
            continue;
        }
        let Some((shape, map)) = placed(scene, ray, &hit) else { continue };
        let missed = Missed { nearest: approach(&shape, &map, ray), hit };
        match found.get(&index) {
            Some(other) if distance(other) <= distance(&missed) => {}
            _ => {
                found.insert(index, missed);
            }
        }
    }
    let mut found: Vec<Missed> = found.into_values().collect();
    found.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    found.truncate(most);
    found
}

/// A primitive, and the map from its own space to the world.
fn placed(scene: &Scene, ray: &Ray, hit: &Hit) -> Option<(Shape, Transform)> {
    let Target { placements, shape } = scene.resolved().accel().target(ray, hit);
    let outer = placements.into_iter().fold(Transform::IDENTITY, |outer, inner| outer * inner);
    match shape {
        TargetShape::Exact(placed) => Some((placed.shape().clone(), outer * placed.world_from_object())),
        TargetShape::Triangle([a, b, c]) => Some((Triangle::new(a, b, c).ok()?.into(), outer)),
        TargetShape::Custom => None,
    }
}

/// The middle and the radius of a ball about a shape; `None` for an infinite one.
fn ball(shape: &Shape, map: &Transform) -> Option<(DVec3, f64)> {
    let bounds = shape.bounds(map)?;
    Some((0.5 * (bounds.min + bounds.max), 0.5 * (bounds.max - bounds.min).length()))
}

/// A lower bound on the distance between the ray and the shape.
fn least_distance(shape: &Shape, map: &Transform, ray: &Ray) -> f64 {
    let Some((middle, radius)) = ball(shape, map) else { return 0.0 };
    let t = ((middle - ray.origin).dot(ray.direction) / ray.direction.length_squared())
        .clamp(ray.t_min.min(ray.t_max), ray.t_max);
    ((ray.at(t) - middle).length() - radius).max(0.0)
}

/// The nearest point of a ray to a shape: the minimum of the distances at many points, refined.
pub(super) fn approach(shape: &Shape, map: &Transform, ray: &Ray) -> Option<Nearest> {
    let object = ray.into_object(map);
    let in_object = shape.closest_point(map, ray.origin).is_err();
    let distance = |t: f64| match in_object {
        false => shape.closest_point(map, ray.at(t)).map(|nearest| nearest.distance),
        true => shape.closest_point(&Transform::IDENTITY, object.at(t)).map(|nearest| nearest.distance),
    };
    let speed = ray.direction.length();
    let (low, high) = match ball(shape, map) {
        // The nearest point is in the ball, and so is its position along the ray.
        Some((middle, radius)) => {
            let t = (middle - ray.origin).dot(ray.direction) / (speed * speed);
            (t - radius / speed, t + radius / speed)
        }
        None => {
            let reach = 4.0 * (1.0 + ray.origin.length()) / speed;
            (-reach, reach)
        }
    };
    let (low, high) = (low.max(ray.t_min), high.min(ray.t_max));
    // All of it is in front of the ray's range, or beyond it: the nearest point is an end of the range.
    let (low, high) = if low <= high { (low, high) } else { (low.min(ray.t_max), low.min(ray.t_max)) };
    let at = |i: u32| low + (high - low) * f64::from(i) / f64::from(PLACES);
    let mut best = (f64::INFINITY, 0);
    for i in 0..=PLACES {
        let found = distance(at(i)).ok()?;
        if found < best.0 {
            best = (found, i);
        }
    }
    // The interval around the minimum, refined by ternary search.
    let (mut from, mut to) = (at(best.1.saturating_sub(1)), at((best.1 + 1).min(PLACES)));
    for _ in 0..STEPS {
        let (a, b) = (from + (to - from) / 3.0, to - (to - from) / 3.0);
        if distance(a).ok()? <= distance(b).ok()? {
            to = b;
        } else {
            from = a;
        }
    }
    let (t, there) = (0.5 * (from + to), at(best.1));
    let (refined, coarse) = (distance(t).ok()?, best.0);
    let (distance, t) = if refined <= coarse { (refined, t) } else { (coarse, there) };
    // The search comes near to the first place, as along a parallel line, but not to it.
    let t = if t - low < 1e-12 * (high - low) { low } else { t };
    distance.is_finite().then_some(Nearest { distance, t, in_object })
}

#[cfg(test)]
mod tests {
    use lumbre::geometry::{Cuboid, Sphere};

    use super::*;

    #[test]
    fn a_ray_comes_as_near_to_a_shape_as_pencil_and_paper_say() {
        let ball = Shape::from(Sphere::new(DVec3::new(1.0, 2.0, 3.0), 0.5).expect("a ball"));
        let block = Shape::from(Cuboid::new(DVec3::ZERO, DVec3::new(1.0, 2.0, 4.0)).expect("a box"));
        for (shape, origin, direction, distance, t) in [
            // Past the ball at 2, along z; away from it; and by a direction of length 2.
            (&ball, DVec3::new(1.0, 4.5, -5.0), DVec3::Z, 2.0, 8.0),
            (&ball, DVec3::new(1.0, 2.0, 5.0), DVec3::Z, 1.5, 0.0),
            (&ball, DVec3::new(1.0, 4.5, -5.0), 2.0 * DVec3::Z, 2.0, 4.0),
            // Past an edge of the box, which is 3 to the side and 4 above.
            (&block, DVec3::new(-7.0, 6.0, 8.0), DVec3::X, 32.0_f64.sqrt(), 7.5),
        ] {
            let found = approach(shape, &Transform::IDENTITY, &Ray::new(origin, direction)).expect("found");
            assert!((found.distance - distance).abs() < 1e-12, "{found:?} for {distance}");
            // Along the edge, all points are equally near.
            assert!((found.t - t).abs() < 0.51, "{found:?} for {t}");
            assert!(!found.in_object);
        }
        // Under this map, nothing has a nearest point in the world.
        let tube = lumbre::geometry::Cylinder::new(DVec3::ZERO, DVec3::Z, 1.0, true).expect("a tube");
        let squeezed = Transform::scale(DVec3::new(1.0, 0.5, 1.0)).expect("it is");
        let ray = Ray::new(DVec3::new(-5.0, 2.0, 0.5), DVec3::X);
        let found = approach(&Shape::from(tube), &squeezed, &ray).expect("found");
        // In its own space the ray is at y = 4.
        assert!(found.in_object && (found.distance - 3.0).abs() < 1e-12, "{found:?}");
    }
}
