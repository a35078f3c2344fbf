//! Sampling by solid angle against the closed form of ∫ω dω over what is seen, the vector that Lambert's polygon
//! formula gives: an error in the map that random samples would drown shows here.

use lumbre_geometry::{BilinearPatch, Shape, Sphere, Triangle};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3};

/// The mean of f(ω) / pdf over a fine grid of the unit square, and of 1 / pdf.
fn integrals(shape: &Shape, from: DVec3) -> (DVec3, f64) {
    let n = 300;
    let (mut vector, mut solid_angle) = (DVec3::ZERO, 0.0);
    for i in 0..n {
        for j in 0..n {
            let u = DVec2::new((f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n));
            let sample = shape.sample_direction(from, u).expect("a sample");
            vector += (sample.surface.point - from).normalize() / sample.pdf;
            solid_angle += 1.0 / sample.pdf;
        }
    }
    let count = f64::from(n * n);
    (vector / count, solid_angle / count)
}

/// ½ Σ (angle of a side) (unit normal of its plane through the eye): J. H. Lambert, "Photometria", 1760.
fn of_polygon(corners: &[DVec3], from: DVec3) -> DVec3 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let of_side = |(a, b): (&DVec3, &DVec3)| {
        let (a, b) = (*a - from, *b - from);
        0.5 * a.cross(b).length().atan2(a.dot(b)) * a.cross(b).normalize()
    };
    sides.map(of_side).sum()
}

struct Random(RandomStream);

impl Random {
    fn point(&mut self) -> DVec3 {
        let mut x = || 6.0 * self.0.next_f64() - 3.0;
        DVec3::new(x(), x(), x())
    }
}

/// Whichever way round the corners run, the vector points at the polygon.
fn close(a: DVec3, b: DVec3, solid_angle: f64) -> bool {
    (a - b).length().min((a + b).length()) < 2e-4 * solid_angle
}

#[test]
fn a_triangle_is_sampled_uniformly_by_solid_angle() {
    let mut random = Random(RandomStream::new(51));
    let mut tested = 0;
    while tested < 40 {
        let corners = [random.point(), random.point(), random.point()];
        let from = 1.5 * random.point();
        let triangle = Triangle::new(corners[0], corners[1], corners[2]).unwrap();
        let seen = triangle.solid_angle(from);
        if !(0.01..6.0).contains(&seen) {
            continue;
        }
        tested += 1;
        let (vector, solid_angle) = integrals(&triangle.into(), from);
        assert!((solid_angle / seen - 1.0).abs() < 1e-9);
        assert!(close(vector, of_polygon(&corners, from), seen), "{triangle:?} from {from}: {vector}");
    }
}

#[test]
fn a_rectangle_is_sampled_uniformly_by_solid_angle() {
    let mut random = Random(RandomStream::new(52));
    let mut tested = 0;
    while tested < 40 {
        let (corner, side, aside) = (random.point(), random.point(), random.point());
        let other = side.cross(aside).normalize() * aside.length();
        let from = 1.5 * random.point();
        let corners = [corner, corner + side, corner + side + other, corner + other];
        let patch = BilinearPatch::new(corners[0], corners[1], corners[3], corners[2]).unwrap();
        let half = |a: usize, b: usize, c: usize| {
            Triangle::new(corners[a], corners[b], corners[c]).unwrap().solid_angle(from)
        };
        let seen = half(0, 1, 2) + half(0, 2, 3);
        if !(0.01..6.0).contains(&seen) {
            continue;
        }
        tested += 1;
        let (vector, solid_angle) = integrals(&patch.into(), from);
        assert!((solid_angle / seen - 1.0).abs() < 1e-9, "{patch:?} from {from}");
        assert!(close(vector, of_polygon(&corners, from), seen), "{patch:?} from {from}: {vector}");
    }
}

#[test]
fn spheres_are_sampled_uniformly_by_solid_angle() {
    let (center, radius) = (DVec3::new(3.0, -2.0, 5.0), 2.5);
    let ball = Shape::from(Sphere::new(center, radius).unwrap());
    let toward = DVec3::new(2.0, 3.0, -6.0) / 7.0;
    for distance in [1.001, 1.2, 3.0, 50.0, 1e4, 1e7] {
        let (vector, solid_angle) = integrals(&ball, center - radius * distance * toward);
        let sin = 1.0 / distance;
        let versine = sin * sin / (1.0 + ((distance - 1.0) * (distance + 1.0)).sqrt() / distance);
        let seen = std::f64::consts::TAU * versine;
        assert!((solid_angle / seen - 1.0).abs() < 1e-6, "{distance}: {solid_angle} {seen}");
        let expected = std::f64::consts::PI * sin * sin * toward;
        assert!((vector - expected).length() < 2e-4 * seen, "{distance}: {vector} {expected}");
    }
    let (vector, solid_angle) = integrals(&ball, center + 0.7 * radius * toward);
    assert!((solid_angle / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-9);
    assert!(vector.length() < 1e-3, "{vector}");
}
