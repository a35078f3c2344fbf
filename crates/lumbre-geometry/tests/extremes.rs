//! Shapes of absurd proportions, and rays from absurd places: they refuse, miss or answer, and never panic.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use lumbre_geometry::{
    Aabb, BilinearPatch, Capsule, Cone, Csg, Cuboid, Cylinder, Disk, Hyperboloid, Paraboloid, PlacedShape,
    Plane, Quadric, Ray, Roots, Shape, Sphere, Torus, Triangle,
};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform};

/// Numbers that break things, of either sign.
fn odd_number(random: &mut RandomStream) -> f64 {
    const MAGNITUDES: [f64; 14] =
        [0.0, 5e-324, 1e-308, 1e-160, 1e-75, 1e-30, 1e-8, 1.0, 3.5, 1e9, 1e30, 1e75, 1e160, f64::MAX];
    const RARE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    if random.next_below(40) == 0 {
        return RARE[random.next_below(3)];
    }
    let sign = if random.next_below(3) == 0 { -1.0 } else { 1.0 };
    sign * MAGNITUDES[random.next_below(MAGNITUDES.len())]
}

fn tame_number(random: &mut RandomStream) -> f64 {
    if random.next_below(3) == 0 { odd_number(random) } else { 4.0 * random.next_f64() - 1.0 }
}

fn shape(random: &mut RandomStream) -> Option<Shape> {
    let kind = random.next_below(4);
    let mut x = || tame_number(random);
    let mut v = || DVec3::new(x(), x(), x());
    match kind {
        0 => {
            let (center, axis, radii) = (v(), v(), v());
            Torus::new(center, axis, radii.x, radii.y).ok().map(Shape::from)
        }
        1 => {
            let (a, b) = (v(), v());
            Paraboloid::new(a.x, a.y, a.z, 100.0 * b.x).ok().map(Shape::from)
        }
        2 => {
            let (a, b, c) = (v(), v(), v());
            Hyperboloid::new(a, b, 100.0 * c.x).ok().map(Shape::from)
        }
        _ => {
            let (a, b, c, d) = (v(), v(), v(), v());
            let coefficients = [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z, d.x];
            let (min, max) = (v(), v());
            let clip = (d.y > 0.0).then_some(Aabb { min: min.min(max), max: max.max(min) });
            Quadric::new(coefficients, clip).ok().map(Shape::from)
        }
    }
}

#[test]
fn no_parameter_and_no_ray_makes_a_solid_panic() {
    let mut random = RandomStream::new(21);
    let (mut made, mut hits) = (0, 0);
    for _ in 0..30_000 {
        let Some(shape) = shape(&mut random) else {
            continue;
        };
        made += 1;
        let placed = PlacedShape::new(shape, Transform::IDENTITY);
        let csg = Csg::leaf(placed.clone()).ok().map(|csg| PlacedShape::new(csg.into(), Transform::IDENTITY));
        for placed in [Some(placed), csg].into_iter().flatten() {
            // A clipped quadric's area takes milliseconds.
            let _ = (placed.bounds(), (made % 512 == 0).then(|| placed.shape().area()));
            let u = DVec2::new(random.next_f64(), random.next_f64());
            let _ = (
                placed.sample_area(u),
                placed.sample_direction(DVec3::ONE, u),
                placed.shape().surface_at(0, u),
            );
            for _ in 0..8 {
                let mut v = || {
                    DVec3::new(tame_number(&mut random), tame_number(&mut random), tame_number(&mut random))
                };
                let ray = Ray::new(v(), v()).with_range(f64::NEG_INFINITY, f64::INFINITY);
                let mut roots = Roots::new();
                placed.roots(&ray, &mut roots);
                assert_eq!(placed.closest(&ray), roots.first().copied());
                for root in &roots {
                    assert!(root.t.is_finite(), "{placed:?} {ray:?} {roots:?}");
                    let surface = placed.surface(&ray, root);
                    let _ = placed.pdf_direction(&ray, &surface);
                    hits += 1;
                }
            }
        }
    }
    assert!(made > 5_000 && hits > 5_000, "{made} made, {hits} hits");
}

/// One of each kind, of a size of about 1.
fn one_of_each() -> Vec<Shape> {
    let v = DVec3::new;
    let (p, q, r, s) = (v(0.4, -0.3, 1.2), v(-1.3, 1.1, 0.6), v(1.2, 0.9, -0.8), v(1.1, 0.7, 1.3));
    let clip = Aabb { min: v(-1.1, -0.8, -1.3), max: v(1.2, 0.9, 0.7) };
    let saddle = [1.0, -1.4, 0.1, 0.3, 0.0, 0.2, 0.1, 0.0, -1.0, 0.15];
    let ellipsoid = [1.0, 2.5, 0.75, 0.6, -0.4, 0.3, -1.0, 0.5, 2.0, -1.5];
    let ball: Shape = Sphere::new(p, 1.3).unwrap().into();
    vec![
        ball.clone(),
        Sphere::new(p, 1.3).unwrap().partial(-0.9, 1.1, 300.0).unwrap().into(),
        Plane::new(p, v(1.0, -2.0, 0.5)).unwrap().into(),
        Disk::new(p, v(0.3, 2.0, -1.0), 1.7, 0.2).unwrap().into(),
        Cuboid::new(p, q).unwrap().into(),
        Cylinder::new(p, q, 0.7, true).unwrap().into(),
        Cylinder::infinite(p, q, 0.7).unwrap().into(),
        Cone::new(p, q, 1.4, 0.6, false).unwrap().into(),
        Cone::new(p, q, 0.0, 1.2, true).unwrap().into(),
        Capsule::new(p, q, 0.8).unwrap().into(),
        BilinearPatch::new(p, q, r, s).unwrap().into(),
        Triangle::new(p, q, r).unwrap().into(),
        Torus::new(p, v(0.5, -1.0, 2.0), 1.2, 0.45).unwrap().into(),
        Torus::new(p, v(0.5, -1.0, 2.0), 0.7, 0.9).unwrap().into(),
        Paraboloid::new(1.3, 0.0, 1.2, 360.0).unwrap().into(),
        Hyperboloid::new(v(1.2, 0.3, -0.7), v(0.2, 1.1, 1.6), 360.0).unwrap().into(),
        Quadric::new(ellipsoid, None).unwrap().into(),
        Quadric::new(saddle, Some(clip)).unwrap().into(),
        Csg::leaf(PlacedShape::new(ball, Transform::IDENTITY)).unwrap().into(),
    ]
}

fn in_cube(random: &mut RandomStream) -> DVec3 {
    let mut x = || f64::from(2.0 * random.next_f32() - 1.0);
    DVec3::new(x(), x(), x())
}

#[test]
fn a_direction_of_any_length_finds_what_a_unit_one_does() {
    let mut random = RandomStream::new(22);
    let squeezed = Transform::scale(DVec3::new(0.5, 2.0, 0.25)).unwrap();
    for shape in one_of_each() {
        let mut hits = 0;
        for map in [Transform::IDENTITY, squeezed] {
            let placed = PlacedShape::new(shape.clone(), map);
            for _ in 0..60 {
                let direction = in_cube(&mut random);
                let origin = map.point(in_cube(&mut random)) - 6.0 * direction;
                let ray = Ray::new(origin, direction).with_range(0.0, f64::INFINITY);
                let mut expected = Roots::new();
                placed.roots(&ray, &mut expected);
                for exponent in [-990, -700, -500, -130, 130, 500, 700, 990] {
                    let factor = 2f64.powi(exponent);
                    let scaled = Ray { direction: factor * direction, ..ray };
                    let mut found = Roots::new();
                    placed.roots(&scaled, &mut found);
                    let ts: Vec<f64> = found.iter().map(|root| root.t * factor).collect();
                    let wanted: Vec<f64> = expected.iter().map(|root| root.t).collect();
                    assert_eq!(ts, wanted, "{} {exponent} {ray:?}", shape.name());
                    assert_eq!(placed.closest(&scaled), found.first().copied());
                    for (one, other) in found.iter().zip(&expected) {
                        let (one, other) = (placed.surface(&scaled, one), placed.surface(&ray, other));
                        assert_eq!(one.normal, other.normal, "{} {exponent}", shape.name());
                        assert_eq!(
                            placed.pdf_direction(&scaled, &one),
                            placed.pdf_direction(&ray, &other),
                            "{} {exponent}",
                            shape.name()
                        );
                        hits += 1;
                    }
                    // The range is in the same units.
                    if let Some(root) = expected.first() {
                        let before = scaled.with_range(0.0, 0.75 * root.t / factor);
                        assert_eq!(placed.closest(&before), None, "{} {exponent}", shape.name());
                    }
                }
            }
        }
        assert!(hits > 60, "{}: {hits}", shape.name());
    }
}

#[test]
fn normals_are_unit_for_tiny_and_distant_shapes() {
    let mut random = RandomStream::new(23);
    let sizes = [1e-300, 1e-170, 1e-60, 1e-17, 1e-3, 1.0, 1e6, 1e30];
    let distances = [0.0, 1e-12, 1.0, 1e6, 1e12, 1e17, 1e20, 1e90, 1e200];
    let mut hits = 0;
    for shape in one_of_each() {
        for size in sizes {
            let Ok(map) = Transform::scale(DVec3::new(size, 0.7 * size, 1.3 * size)) else { continue };
            let placed = PlacedShape::new(shape.clone(), map);
            for distance in distances {
                for k in 0..20 {
                    let direction = if k < 3 { DVec3::AXES[k] } else { in_cube(&mut random) };
                    let aim = map.point(if k % 2 == 0 { DVec3::ZERO } else { in_cube(&mut random) });
                    let ray = Ray::new(aim - distance * direction, direction)
                        .with_range(f64::NEG_INFINITY, f64::INFINITY);
                    let mut found = Roots::new();
                    placed.roots(&ray, &mut found);
                    for root in &found {
                        hits += 1;
                        let surface = placed.surface(&ray, root);
                        let is_unit = (surface.normal.length() - 1.0).abs() < 1e-9;
                        assert!(is_unit, "{} {size} {distance} {ray:?} {root:?} {surface:?}", shape.name());
                        assert!(surface.point.is_finite() && surface.uv.is_finite(), "{ray:?} {surface:?}");
                    }
                }
            }
        }
    }
    assert!(hits > 10_000, "{hits}");
}

#[test]
fn tiny_and_distant_balls_face_their_ray() {
    let v = DVec3::new;
    let capsule = |size: f64| Capsule::new(v(0.0, 0.0, -size), v(0.0, 0.0, size), size).unwrap();
    let stretched = Transform::scale(v(1e-17, 2e-17, 3e-17)).unwrap();
    let ball = |radius: f64| Shape::from(Sphere::new(DVec3::ZERO, radius).unwrap());
    let cases = [
        (PlacedShape::new(ball(1e-17), Transform::IDENTITY), 1.0),
        (PlacedShape::new(ball(1.0), Transform::IDENTITY), 1e20),
        (PlacedShape::new(ball(1.0), stretched), 1.0),
        (PlacedShape::new(capsule(1e-18).into(), Transform::IDENTITY), 1.0),
        (PlacedShape::new(capsule(1.0).into(), Transform::IDENTITY), 1e20),
    ];
    for (placed, distance) in cases {
        for direction in [DVec3::Z, DVec3::X, v(1.0, 2.0, -2.0)] {
            let ray = Ray::new(-distance * direction, direction);
            let root = placed.closest(&ray).unwrap();
            let surface = placed.surface(&ray, &root);
            assert!((root.t / distance - 1.0).abs() < 1e-15, "{root:?} {placed:?}");
            assert!((surface.normal.length() - 1.0).abs() < 1e-12, "{surface:?} {placed:?}");
            assert!(surface.normal.dot(direction) < 0.0, "{surface:?} {ray:?} {placed:?}");
        }
    }
}

#[test]
fn a_wire_is_hit_wherever_a_line_passes_through_it() {
    let mut random = RandomStream::new(24);
    for thinness in [1e-3, 1e-5, 1e-8, 1e-10, 1e-12] {
        let (major, minor) = (1e9, thinness * 1e9);
        let wire = Torus::new(DVec3::ZERO, DVec3::Z, major, minor).unwrap();
        let mut worst = 0.0_f64;
        for i in 0..2000 {
            let phi = 7.0 * random.next_f64();
            let outward = DVec3::new(phi.cos(), phi.sin(), 0.0);
            let depth = if i % 4 == 0 { 0.998 } else { random.next_f64() };
            let mut direction = in_cube(&mut random);
            if i % 3 == 0 {
                direction.z *= 1e-3;
            }
            // Past the middle of the wire, at a distance across the line and across the wire.
            let around = outward.cross(DVec3::Z);
            let across = direction.cross(around).normalize();
            let aside = 0.97 * (1.0 - depth) * minor;
            let through = major * outward + aside * across;
            let origin = through - 3.0 * major * direction;
            // What is left is the distance of the rounded line.
            let ray = Ray::new(origin, direction).with_range(f64::NEG_INFINITY, f64::INFINITY);
            let rounding = 1e-6 / minor;
            if rounding > 0.01 * depth {
                continue;
            }
            let mut found = Roots::new();
            wire.roots(&ray, &mut found);
            let before = found.iter().filter(|root| root.t < 3.0 * major).count();
            let is_through = before % 2 == 1 && found.len().is_multiple_of(2);
            assert!(is_through, "{thinness} {depth} {ray:?} {found:?}");
            for root in &found {
                let p = ray.at(root.t);
                let off = (p.x.hypot(p.y) - major).hypot(p.z) / minor - 1.0;
                worst = worst.max(off.abs() * minor / major);
            }
        }
        assert!(worst < 1e-14, "{thinness} {worst}");
    }
}
