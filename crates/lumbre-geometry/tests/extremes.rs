//! Shapes of absurd proportions: they refuse, miss or answer, and never panic.

use lumbre_geometry::{Aabb, Csg, Hyperboloid, Paraboloid, PlacedShape, Quadric, Ray, Roots, Shape, Torus};
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
