//! The two tests for triangles against each other, and why the shape uses the watertight one.

use lumbre_geometry::{Ray, Triangle, WatertightRay, moller_trumbore};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3};

struct Random(RandomStream);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.0.next_f64() * (high - low)
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.between(-2.3, 1.9), self.between(-1.7, 2.9), self.between(0.4, 3.1))
    }
}

/// A closed sphere of triangles about (3, -2, 5), its poles and all; the vertices are rounded to single precision if
/// asked.
fn ball(single: bool) -> Vec<[DVec3; 3]> {
    let (rows, columns) = (7_u32, 11_u32);
    let vertex = |row: u32, column: u32| {
        let theta = f64::from(row) / f64::from(rows) * std::f64::consts::PI;
        let phi = f64::from(column % columns) / f64::from(columns) * std::f64::consts::TAU;
        let rho = if row.is_multiple_of(rows) { 0.0 } else { theta.sin() };
        let p = DVec3::new(3.0, -2.0, 5.0) + 2.5 * DVec3::new(rho * phi.cos(), rho * phi.sin(), theta.cos());
        if single { p.as_vec3().as_dvec3() } else { p }
    };
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let (a, b) = (vertex(row, column), vertex(row + 1, column));
            let (c, d) = (vertex(row + 1, column + 1), vertex(row, column + 1));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// Aims rays from inside at points of the sides, and at the corners; returns how many rays hit nothing by either test.
fn leaks(single: bool, rays: usize) -> (usize, usize, usize) {
    let mut random = Random(RandomStream::new(31));
    let triangles = ball(single);
    let (mut aimed, mut through_fast, mut through_watertight) = (0, 0, 0);
    for i in 0..rays {
        let triangle = triangles[random.0.next_below(triangles.len())];
        let along = if i % 2 == 0 { random.between(0.0, 1.0) } else { f64::from(i as u32 / 2 % 2) };
        let target = triangle[0] + along * (triangle[1] - triangle[0]);
        let round = |p: DVec3| if single { p.as_vec3().as_dvec3() } else { p };
        let origin = round(DVec3::new(3.3, -1.8, 4.6) + 0.4 * random.point());
        let direction = round(target - origin);
        aimed += 1;
        let ray = WatertightRay::new(origin, direction);
        let ahead = |t: Option<f64>| t.is_some_and(|t| t > 0.0);
        let fast =
            |[a, b, c]: &[DVec3; 3]| ahead(moller_trumbore(origin, direction, *a, *b, *c).map(|hit| hit.t));
        let watertight = |[a, b, c]: &[DVec3; 3]| ahead(ray.hit(*a, *b, *c).map(|hit| hit.t));
        through_fast += usize::from(!triangles.iter().any(fast));
        through_watertight += usize::from(!triangles.iter().any(watertight));
    }
    (aimed, through_fast, through_watertight)
}

#[test]
fn rays_at_edges_and_corners_hit() {
    for single in [false, true] {
        let (aimed, through_fast, through_watertight) = leaks(single, 20_000);
        println!(
            "{aimed} rays, {through_fast} through Moller-Trumbore, {through_watertight} through watertight"
        );
        assert_eq!((aimed, through_watertight), (20_000, 0));
        // The reason for the other test: were this 0, the aim would be no test at all.
        assert!(through_fast > 10, "{through_fast}");
    }
}

/// Takes some ten seconds: four million rays at sides and corners.
#[test]
#[ignore = "slow"]
fn no_ray_slips_through_among_very_many() {
    for single in [false, true] {
        assert_eq!(leaks(single, 2_000_000).2, 0);
    }
}

#[test]
fn both_tests_agree_away_from_the_sides() {
    let mut random = Random(RandomStream::new(32));
    let (mut hits, mut fronts) = (0, 0);
    for _ in 0..200_000 {
        let (a, b, c) = (random.point(), random.point(), random.point());
        let origin = 3.0 * random.point();
        let weights =
            DVec3::new(random.between(0.0, 1.0), random.between(0.0, 1.0), random.between(-0.2, 1.0));
        let target = (weights.x * a + weights.y * b + weights.z * c) / weights.element_sum();
        let direction = random.between(0.1, 7.0) * (target - origin);
        let area = (b - a).cross(c - a);
        let flatness = area.dot(direction).abs() / (area.length() * direction.length());
        let shape = area.length() / (b - a).length_squared().max((c - a).length_squared());
        if flatness < 1e-2 || shape < 1e-2 || (weights.z / weights.element_sum()).abs() < 1e-6 {
            continue;
        }
        let fast = moller_trumbore(origin, direction, a, b, c);
        let watertight = WatertightRay::new(origin, direction).hit(a, b, c);
        assert_eq!(fast.is_some(), watertight.is_some(), "{a} {b} {c} {origin} {direction}");
        let (Some(fast), Some(watertight)) = (fast, watertight) else {
            continue;
        };
        hits += 1;
        fronts += usize::from(watertight.determinant > 0.0);
        assert!((fast.t - watertight.t).abs() < 1e-10 * fast.t.abs());
        assert!((fast.b1 - watertight.b1).abs() + (fast.b2 - watertight.b2).abs() < 1e-9);
        assert_eq!(fast.determinant > 0.0, watertight.determinant > 0.0);
        assert_eq!(watertight.determinant > 0.0, area.dot(direction) < 0.0);
    }
    assert!(hits > 100_000 && fronts > hits / 3 && fronts < 2 * hits / 3, "{hits} {fronts}");
}

#[test]
fn a_triangle_of_no_area_is_never_hit_and_gives_no_sample() {
    let mut random = Random(RandomStream::new(33));
    for _ in 0..20_000 {
        // On a coarse grid the last of them is flat to the last bit.
        let grid = |p: DVec3| (16.0 * p).round() / 16.0;
        let (a, b) = (grid(random.point()), grid(random.point()));
        let flat = [
            Triangle::new(a, a, b),
            Triangle::new(a, b, b),
            Triangle::new(a, a, a),
            Triangle::new(a, a + 2.0 * (b - a), a - 3.0 * (b - a)),
        ];
        for triangle in flat {
            let triangle = triangle.unwrap();
            let origin = random.point();
            for target in triangle.corners() {
                let ray = Ray::new(origin, target - origin);
                assert_eq!(triangle.closest(&ray), None, "{triangle:?}");
            }
            assert_eq!(triangle.area(), 0.0);
            assert_eq!(triangle.sample_area(DVec2::splat(0.3)), None);
            assert_eq!(triangle.sample_direction(origin, DVec2::splat(0.3)), None);
        }
    }
}

#[test]
fn a_tiny_triangle_is_hit_as_surely_as_a_large_one() {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    for exponent in [-600, -500, -100, -20, 0, 40, 100] {
        let size = 2f64.powi(exponent);
        let triangle = Triangle::new(corner(0.0, 0.0), corner(size, 0.0), corner(0.0, size)).unwrap();
        let ray = Ray::new(DVec3::new(0.25 * size, 0.25 * size, 3.0), DVec3::new(0.0, 0.0, -2.0));
        // At 2^-600 the area underflows to none.
        assert_eq!(triangle.closest(&ray).map(|r| r.t), (exponent > -600).then_some(1.5), "2^{exponent}");
    }
}
