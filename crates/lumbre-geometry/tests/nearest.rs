//! The nearest point of every shape: it is on the surface, as far away as it says, and no other point is nearer.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use lumbre_geometry::{
    Aabb, BilinearPatch, Capsule, Cone, Csg, Cuboid, Cylinder, Disk, Hyperboloid, NearestPoint,
    NearestPointError, Paraboloid, PlacedShape, Plane, Quadric, Shape, ShapeError, Sphere, Torus, Triangle,
    nearest_on_triangle,
};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform};

struct Random(RandomStream);

impl Random {
    fn new(seed: u64) -> Self {
        Self(RandomStream::new(seed))
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.next_f64()
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }
}

/// Shapes by name, and whether they have a method under every map.
fn shapes() -> Vec<(&'static str, Shape, bool)> {
    fn add<S: Into<Shape>>(
        all: &mut Vec<(&'static str, Shape, bool)>,
        name: &'static str,
        shape: Result<S, ShapeError>,
        under_any: bool,
    ) {
        all.push((name, shape.unwrap().into(), under_any));
    }
    let v = DVec3::new;
    let (p, q, r, s) = (v(0.4, -0.3, 1.2), v(-1.3, 2.1, 0.6), v(2.2, 0.9, -0.8), v(1.1, 1.7, 2.3));
    let ball = || Sphere::new(p, 2.5);
    let can = |caps| Cylinder::new(p, q, 0.7, caps);
    let lampshade = |caps| Cone::new(p, q, 1.4, 0.6, caps);
    let mut all = Vec::new();
    let a = &mut all;
    add(a, "sphere", ball(), true);
    add(a, "slice of a sphere", ball().and_then(|b| b.partial(-1.1, 1.9, 360.0)), false);
    add(a, "wedge of a sphere", ball().and_then(|b| b.partial(-9.0, 2.1, 130.0)), false);
    add(a, "wide wedge of a sphere", ball().and_then(|b| b.partial(-9.0, 9.0, 300.0)), false);
    add(a, "plane", Plane::new(p, v(1.0, -2.0, 0.5)), true);
    add(a, "disk", Disk::new(p, v(0.3, 2.0, -1.0), 1.7, 0.0), false);
    add(a, "annulus", Disk::new(q, v(-0.3, 0.2, -1.0), 1.7, 0.6), false);
    add(a, "sector", Disk::new(q, v(0.0, 0.0, 3.0), 1.7, 0.6).and_then(|d| d.partial(215.0)), false);
    add(a, "box", Cuboid::new(p, q), true);
    add(a, "open cylinder", can(false), false);
    add(a, "capped cylinder", can(true), false);
    add(a, "wedge of a cylinder", can(true).and_then(|c| c.partial(250.0)), false);
    add(
        a,
        "cylinder along z",
        Cylinder::along_z(1.3, 2.2, -0.7, false).and_then(|c| c.partial(100.0)),
        false,
    );
    add(a, "endless cylinder", Cylinder::along_z(0.8, f64::NEG_INFINITY, f64::INFINITY, false), false);
    add(a, "half-endless cylinder", Cylinder::along_z(1.2, f64::NEG_INFINITY, 1.1, true), false);
    add(a, "capsule", Capsule::new(p, q, 0.8), false);
    add(a, "open frustum", lampshade(false), false);
    add(a, "capped frustum", lampshade(true), false);
    add(a, "wedge of a frustum", lampshade(true).and_then(|c| c.partial(200.0)), false);
    add(a, "finite cone", Cone::new(p, q, 0.0, 1.2, true), false);
    add(a, "open pointed cone", Cone::nappe(p, v(1.0, 2.0, -0.4), 33.0, 2.7, false), false);
    add(a, "endless cone", Cone::nappe(p, v(-0.2, 0.5, -0.4), 40.0, f64::INFINITY, false), false);
    add(a, "triangle", Triangle::new(p, q, r), true);
    add(a, "bilinear patch", BilinearPatch::new(p, q, r, s), true);
    add(a, "folded patch", BilinearPatch::new(p, p + v(2.0, 0.1, 0.0), p + v(2.1, 1.0, 2.0), q), true);
    add(a, "patch with one side a point", BilinearPatch::new(p, q, p, s), true);
    let (along, across) = (v(2.0, 1.0, 0.0), v(-0.6, 1.2, 0.9));
    add(a, "rectangle", BilinearPatch::new(p, p + along, p + across, p + along + across), true);
    add(a, "ring torus", Torus::new(p, v(0.5, -1.0, 2.0), 1.6, 0.45), false);
    add(a, "horn torus", Torus::new(q, DVec3::Z, 1.2, 1.2), false);
    add(a, "spindle torus", Torus::new(q, v(-1.0, 0.2, -0.3), 0.9, 1.4), false);
    add(a, "paraboloid", Paraboloid::new(1.3, 0.0, 2.2, 360.0), false);
    add(a, "belt of a paraboloid", Paraboloid::new(1.8, 0.4, 1.1, 230.0), false);
    add(a, "hyperboloid", Hyperboloid::new(v(1.2, 0.3, -0.7), v(0.2, 1.1, 1.6), 360.0), false);
    add(a, "waist", Hyperboloid::new(v(1.2, -0.8, -0.7), v(0.2, 1.1, 1.6), 360.0), false);
    add(a, "wedge of a hyperboloid", Hyperboloid::new(v(0.3, 1.1, 1.4), v(-1.2, 0.6, -0.4), 140.0), false);
    add(a, "cone by a segment", Hyperboloid::new(v(-0.4, 0.8, 0.2), v(0.2, -0.4, 1.7), 360.0), false);
    let ellipsoid = [1.0, 2.5, 0.75, 0.6, -0.4, 0.3, -1.0, 0.5, 2.0, -1.5];
    add(a, "ellipsoid", Quadric::new(ellipsoid, None), true);
    all
}

/// Where the shapes stand, and whether the map keeps angles.
fn placements() -> Vec<(Transform, bool)> {
    let turn = Transform::rotate(DVec3::new(2.0, -1.0, 0.7), 130.0).unwrap();
    let scale = |x, y, z| Transform::scale(DVec3::new(x, y, z)).unwrap();
    let moved = |x, y, z| Transform::translate(DVec3::new(x, y, z));
    let shear = Transform::shear(0.5, 0.0, 0.2, -0.25, 0.0, 0.3).unwrap();
    vec![
        (Transform::IDENTITY, true),
        (moved(3.0, -40.0, 7.0) * turn, true),
        (moved(11.0, 2.0, -6.0) * scale(2.5, -2.5, 2.5) * turn, true),
        (moved(8e5, -9e5, 4e5) * turn * scale(1.9, 1.9, 1.9), true),
        (turn * scale(1e-6, 1e-6, 1e-6) * turn, true),
        (moved(-2.0, 5.0, 1.0) * turn * scale(3.0, 0.7, 1.6), false),
        (moved(0.3, -0.6, 2.0) * shear * turn * scale(-1.7, 0.8, 1.2), false),
        (turn * scale(1.0, 1.0, 0.01) * turn, false),
    ]
}

/// Points all over the surface, in world space, with the part and the parameters of each.
fn samples(shape: &Shape, map: &Transform, steps: u32) -> Vec<(DVec3, u32, DVec2)> {
    let is_infinite = shape.bounds(&Transform::IDENTITY).is_none();
    let mut all = Vec::new();
    for part in 0..6 {
        for i in 0..=steps {
            for j in 0..=steps {
                let mut uv = DVec2::new(f64::from(i), f64::from(j)) / f64::from(steps);
                if is_infinite && part == 0 {
                    let is_plane = matches!(shape, Shape::Plane(_));
                    uv = DVec2::new(if is_plane { 12.0 * uv.x - 6.0 } else { uv.x }, 12.0 * uv.y - 6.0);
                }
                // A half-endless body ends at 0; a triangle where its weights do.
                let is_beyond = match shape {
                    Shape::Cone(_) => uv.y < 0.0,
                    Shape::Cylinder(_) => {
                        is_infinite && part == 0 && uv.y > 0.0 && shape.surface_at(2, DVec2::ZERO).is_some()
                    }
                    Shape::Triangle(_) => uv.x + uv.y > 1.0,
                    _ => false,
                };
                if let Some(surface) = shape.surface_at(part, uv).filter(|_| !is_beyond) {
                    all.push((map.point(surface.point), part, uv));
                }
            }
        }
    }
    if let Shape::Capsule(capsule) = shape {
        // The parts go on past their seams: only what is as far from the segment as the surface counts.
        let [p0, p1] = capsule.ends();
        let axis = p1 - p0;
        all.retain(|(point, ..)| {
            let local = map.inverse_point(*point);
            let t = ((local - p0).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
            ((local - p0 - t * axis).length() - capsule.radius()).abs() < 1e-9
        });
    }
    all
}

fn check(
    name: &str,
    shape: &Shape,
    map: &Transform,
    surface: &[(DVec3, u32, DVec2)],
    p: DVec3,
) -> NearestPoint {
    let found = shape.closest_point(map, p).unwrap();
    let reach = p.abs().max_element().max(found.point.abs().max_element()) + found.distance;
    let size = map.linear().to_cols_array().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let rounding = 1e-13 * reach + 2e-13 * size;
    let apart = (found.point - p).length();
    assert!((apart - found.distance).abs() <= rounding, "{name}: {found:?} is {apart} from {p}");
    // It is on the surface.
    let there = shape.surface_at(found.part, found.uv).map(|s| map.point(s.point)).unwrap();
    let off = (there - found.point).length();
    let of_uv = 1e-7 * size + rounding;
    assert!(off <= of_uv, "{name}: {found:?} is {off} from its uv's point {there}");
    // Nothing is nearer.
    let (best, part, uv) = surface
        .iter()
        .copied()
        .min_by(|a, b| (a.0 - p).length_squared().total_cmp(&(b.0 - p).length_squared()))
        .unwrap();
    let sampled = (best - p).length();
    assert!(
        found.distance <= sampled + rounding,
        "{name}: {} from {p} to {}, but {sampled} to {best}, part {part} at {uv}",
        found.distance,
        found.point
    );
    found
}

#[test]
fn no_point_of_any_shape_is_nearer() {
    let mut random = Random::new(11);
    let mut refused = 0;
    for (name, shape, under_any) in shapes() {
        for (map, keeps_angles) in placements() {
            let middle = map.point(DVec3::new(0.4, 0.6, 0.9));
            let reach = map.vector(DVec3::ONE).length() * 2.0;
            if !keeps_angles && !under_any {
                assert_eq!(shape.closest_point(&map, middle), Err(NearestPointError::Map), "{name}");
                refused += 1;
                continue;
            }
            let surface = samples(&shape, &map, 60);
            for i in 0..60 {
                let p = match i % 4 {
                    0 => middle + reach * random.vector(),
                    1 => middle + 10.0 * reach * random.vector(),
                    2 => {
                        // Next to the surface.
                        let (on, ..) = surface[random.between(0.0, surface.len() as f64) as usize];
                        on + 1e-3 * reach * random.vector()
                    }
                    _ => map.point(3.0 * random.vector()),
                };
                check(name, &shape, &map, &surface, p);
            }
            // On the surface itself: at no distance.
            for i in (0..surface.len()).step_by(97) {
                let p = surface[i].0;
                let found = check(name, &shape, &map, &surface, p);
                let size = p.abs().max_element() + reach;
                assert!(found.distance <= 1e-13 * size, "{name}: {} from its own {p}", found.distance);
            }
        }
    }
    assert!(refused > 60, "{refused}");
}

#[test]
fn points_of_symmetry_have_an_answer() {
    for (name, shape, _) in shapes() {
        let surface = samples(&shape, &Transform::IDENTITY, 60);
        let mut middles = vec![DVec3::ZERO, DVec3::new(0.0, 0.0, 0.7), DVec3::new(0.0, 0.0, -3.0)];
        let (p, q) = (DVec3::new(0.4, -0.3, 1.2), DVec3::new(-1.3, 2.1, 0.6));
        middles.extend([p, q, 0.5 * (p + q), 2.0 * p - q, 2.0 * q - p, p + DVec3::Z]);
        if let Some(bounds) = shape.bounds(&Transform::IDENTITY) {
            middles.extend([bounds.center(), bounds.min, bounds.max]);
        }
        for p in middles {
            check(name, &shape, &Transform::IDENTITY, &surface, p);
        }
    }
}

#[test]
fn a_nearest_point_stands_still_when_its_parameters_move() {
    let mut random = Random::new(12);
    for (name, shape, _) in shapes() {
        for _ in 0..200 {
            let p = DVec3::new(0.4, 0.6, 0.9) + 3.0 * random.vector();
            let found = shape.closest_point(&Transform::IDENTITY, p).unwrap();
            for _ in 0..40 {
                let step = 10f64.powf(random.between(-6.0, -1.0));
                let moved =
                    found.uv + step * DVec2::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0));
                let is_free =
                    shape.bounds(&Transform::IDENTITY).is_none() || matches!(shape, Shape::Capsule(_));
                let mut moved = if is_free { moved } else { moved.clamp(DVec2::ZERO, DVec2::ONE) };
                if is_free && !matches!(shape, Shape::Plane(_)) {
                    moved.x = moved.x.clamp(0.0, 1.0);
                }
                if matches!(shape, Shape::Triangle(_)) && moved.x + moved.y > 1.0
                    || is_free && !matches!(shape, Shape::Plane(_)) && moved.y != found.uv.y
                {
                    continue;
                }
                let Some(surface) = shape.surface_at(found.part, moved) else { continue };
                let distance = (surface.point - p).length();
                assert!(
                    found.distance <= distance * (1.0 + 1e-13) + 1e-13,
                    "{name}: {} at {}, {distance} at {moved} from {p}",
                    found.distance,
                    found.uv
                );
            }
        }
    }
}

#[test]
fn an_ellipsoid_is_as_far_as_its_equation_says() {
    // Along an axis within the evolute the nearest point is off the axis.
    let flat = Transform::scale(DVec3::new(5.0, 2.0, 1.0)).unwrap();
    let ball = Shape::from(Sphere::new(DVec3::ZERO, 1.0).unwrap());
    let at = |x: f64, y: f64, z: f64| ball.closest_point(&flat, DVec3::new(x, y, z)).unwrap();
    assert!((at(0.0, 0.0, 0.0).distance - 1.0).abs() < 1e-15);
    assert!((at(9.0, 0.0, 0.0).distance - 4.0).abs() < 1e-14);
    assert!((at(0.0, 0.0, 0.25).distance - 0.75).abs() < 1e-15);
    // (x, 0, z) with x = 25 · 2.4/24 and x²/25 + z² = 1.
    let found = at(2.4, 0.0, 0.0);
    assert!((found.point.x - 2.5).abs() < 1e-14 && (found.point.z.abs() - 0.75f64.sqrt()).abs() < 1e-14);
    assert!((found.distance - (0.01f64 + 0.75).sqrt()).abs() < 1e-14);
}

#[test]
fn slivers_are_answered_as_exactly_as_their_sides() {
    let mut random = Random::new(13);
    for _ in 0..20_000 {
        let (a, b) = (random.vector(), random.vector());
        let c =
            a.lerp(b, random.between(0.0, 1.0)) + 10f64.powf(random.between(-18.0, -6.0)) * random.vector();
        let p = 2.0 * random.vector();
        let (uv, offset) = nearest_on_triangle(a - p, b - p, c - p);
        let size = (b - a).length_squared();
        let t = ((p - a).dot(b - a) / size).clamp(0.0, 1.0);
        let to_side = (a + t * (b - a) - p).length();
        let thickness = (c - a).cross(b - a).length() / size.sqrt();
        assert!(offset.length() <= to_side + 1e-15 && offset.length() >= to_side - thickness - 1e-14);
        let there = a + uv.x * (b - a) + uv.y * (c - a);
        assert!(
            (there - p - offset).length() < 1e-14 && uv.x >= 0.0 && uv.y >= 0.0 && uv.x + uv.y < 1.0 + 1e-15
        );
    }
}

#[test]
fn a_composed_solid_answers_where_it_can_and_is_never_wrong() {
    let placed = |shape: Shape, x: f64| {
        Csg::leaf(PlacedShape::new(shape, Transform::translate(DVec3::new(x, 0.0, 0.0)))).unwrap()
    };
    let ball = |x: f64, radius: f64| placed(Sphere::new(DVec3::ZERO, radius).unwrap().into(), x);
    let drilled = Csg::difference(vec![ball(0.5, 2.0), ball(2.5, 1.0)]).unwrap();
    let joined = Csg::union(vec![ball(0.5, 2.0), ball(2.5, 1.0)]).unwrap();
    let mut random = Random::new(14);
    for (solid, name, least_refused) in [(drilled, "drilled", 20), (joined, "joined", 3)] {
        let shape = Shape::from(solid.clone());
        // By walking outward in many directions.
        let (mut answered, mut refused) = (0, 0);
        for _ in 0..300 {
            let p = DVec3::new(1.0, 0.0, 0.0) + 3.0 * random.vector();
            match shape.closest_point(&Transform::IDENTITY, p) {
                Err(error) => {
                    assert_eq!(error, NearestPointError::Csg);
                    refused += 1;
                }
                Ok(found) => {
                    answered += 1;
                    assert!(((found.point - p).length() - found.distance).abs() < 1e-13);
                    let part = solid.leaf_of(&lumbre_geometry::Root {
                        part: found.part,
                        ..lumbre_geometry::Root::at(0.0)
                    });
                    let center = [0.5, 2.5][part.unwrap().leaf];
                    let radius = [2.0, 1.0][part.unwrap().leaf];
                    let from_center = (found.point - DVec3::new(center, 0.0, 0.0)).length();
                    assert!((from_center - radius).abs() < 1e-13);
                    // The side changes nowhere nearer.
                    let here = shape.contains(p);
                    for _ in 0..300 {
                        let near =
                            p + random.vector().normalize() * found.distance * random.between(0.0, 0.999);
                        assert_eq!(shape.contains(near), here, "{name}: {p} {near} {found:?}");
                    }
                }
            }
        }
        assert!(answered > 100 && refused > least_refused, "{name}: {answered} answered, {refused} refused");
    }
}

#[test]
fn what_has_no_method_says_so() {
    let clip = Aabb { min: DVec3::splat(-1.0), max: DVec3::splat(1.5) };
    let saddle = Quadric::new([1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0], Some(clip)).unwrap();
    let shape = Shape::from(saddle);
    assert_eq!(shape.closest_point(&Transform::IDENTITY, DVec3::ONE), Err(NearestPointError::OpenQuadric));
    let ball = Shape::from(Sphere::new(DVec3::ONE, 2.5).unwrap());
    let nowhere = DVec3::new(0.5, f64::NAN, 0.0);
    assert_eq!(ball.closest_point(&Transform::IDENTITY, nowhere), Err(NearestPointError::NotFinite));
}
