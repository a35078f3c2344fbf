//! How exact the crossings are, against the same equations in twice the precision.

use lumbre_geometry::{Cone, Cylinder, Plane, Ray, Roots, Shape, Sphere};
use lumbre_math::DVec3;
use lumbre_math::quadratic::two_product;
use lumbre_math::random::RandomStream;

/// A number of about 106 significant bits, as an unevaluated sum.
#[derive(Clone, Copy)]
struct Double(f64, f64);

impl Double {
    fn sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let t = s - a;
        Self(s, (a - (s - t)) + (b - t))
    }

    fn add(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.0, other.0), self.1 + other.1);
        Self::sum(high.0, high.1 + low)
    }

    fn sub(self, other: Self) -> Self {
        self.add(Self(-other.0, -other.1))
    }

    fn mul(self, other: Self) -> Self {
        let (p, e) = two_product(self.0, other.0);
        Self::sum(p, e + (self.0 * other.1 + self.1 * other.0))
    }
}

/// The point at `t`, relative to `center`, in twice the precision.
fn place(ray: &Ray, t: f64, center: DVec3) -> [Double; 3] {
    std::array::from_fn(|i| {
        let moved = Double(ray.direction[i], 0.0).mul(Double(t, 0.0));
        Double(ray.origin[i], 0.0).sub(Double(center[i], 0.0)).add(moved)
    })
}

fn square(x: Double) -> Double {
    x.mul(x)
}

/// Shoots rays at a shape from 10^0 to 10^8 away, and returns the largest error of `t` in units of its last place,
/// times the cosine of the angle with the normal, by which the problem itself magnifies every error; and the number of
/// crossings.
///
/// `residual(ray, t)` is the implicit function over its derivative in t: the step that Newton's method would take.
fn worst_ulps(shape: impl Into<Shape>, center: DVec3, residual: impl Fn(&Ray, f64) -> f64) -> (f64, usize) {
    let shape = shape.into();
    let mut random = RandomStream::new(17);
    let mut between = move |low: f64, high: f64| low + random.next_f64() * (high - low);
    let (mut worst, mut crossings) = (0.0_f64, 0);
    for i in 0..90_000 {
        let distance = 10f64.powi(i % 9);
        let mut direction = || {
            loop {
                let d = DVec3::new(between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0));
                if (0.1..1.0).contains(&d.length()) {
                    return d.normalize();
                }
            }
        };
        let (target, origin) = (center + 1.5 * direction(), center + (2.5 * distance) * direction());
        let ray = Ray::new(origin, 0.37 * (target - origin));
        let mut roots = Roots::new();
        shape.roots(&ray, &mut roots);
        for root in &roots {
            let steepness =
                shape.surface(&ray, root).normal.dot(ray.direction).abs() / ray.direction.length();
            if steepness < 1e-3 {
                continue;
            }
            crossings += 1;
            // Near the origin of the ray the last place of t is finer than the numbers that go in.
            let size = (ray.origin - center).length().max(1.0) / ray.direction.length();
            let last_place = f64::EPSILON * root.t.abs().max(size);
            worst = worst.max(residual(&ray, root.t).abs() * steepness / last_place);
        }
    }
    (worst, crossings)
}

#[test]
fn spheres_are_exact_to_a_few_ulps_at_any_distance() {
    let (center, radius) = (DVec3::new(3.25, -7.5, 2.0), 1.7);
    let residual = |ray: &Ray, t: f64| {
        let [x, y, z] = place(ray, t, center);
        let f = square(x).add(square(y)).add(square(z)).sub(square(Double(radius, 0.0)));
        f.0 / (2.0 * DVec3::new(x.0, y.0, z.0).dot(ray.direction))
    };
    let (worst, crossings) = worst_ulps(Sphere::new(center, radius).unwrap(), center, residual);
    println!("sphere: {worst} ulp, {crossings} crossings");
    assert!(worst < 4.0 && crossings > 50_000, "{worst} {crossings}");
}

#[test]
fn cylinders_are_exact_to_a_few_ulps_at_any_distance() {
    let radius = 1.3;
    let residual = |ray: &Ray, t: f64| {
        let [x, y, _] = place(ray, t, DVec3::ZERO);
        let f = square(x).add(square(y)).sub(square(Double(radius, 0.0)));
        f.0 / (2.0 * (x.0 * ray.direction.x + y.0 * ray.direction.y))
    };
    let shape = Cylinder::along_z(radius, f64::NEG_INFINITY, f64::INFINITY, false).unwrap();
    let (worst, crossings) = worst_ulps(shape, DVec3::ZERO, residual);
    println!("cylinder: {worst} ulp, {crossings} crossings");
    assert!(worst < 8.0 && crossings > 50_000, "{worst} {crossings}");
}

#[test]
fn cones_are_exact_to_a_few_ulps_at_any_distance() {
    // Radius 2 - z/2 from z = 0 to 3.
    let residual = |ray: &Ray, t: f64| {
        let [x, y, z] = place(ray, t, DVec3::ZERO);
        let radius = Double(2.0, 0.0).sub(z.mul(Double(0.5, 0.0)));
        let f = square(x).add(square(y)).sub(square(radius));
        let slope = x.0 * ray.direction.x + y.0 * ray.direction.y + 0.5 * radius.0 * ray.direction.z;
        f.0 / (2.0 * slope)
    };
    let shape = Cone::new(DVec3::ZERO, DVec3::new(0.0, 0.0, 3.0), 2.0, 0.5, false).unwrap();
    let (worst, crossings) = worst_ulps(shape, DVec3::ZERO, residual);
    println!("cone: {worst} ulp, {crossings} crossings");
    assert!(worst < 8.0 && crossings > 10_000, "{worst} {crossings}");
}

#[test]
fn planes_are_exact_to_a_few_ulps_at_any_distance() {
    let (point, normal) = (DVec3::new(3.25, -7.5, 2.0), DVec3::new(2.0, 3.0, -6.0));
    let residual = |ray: &Ray, t: f64| {
        let [x, y, z] = place(ray, t, point);
        let weigh = |x: Double, n: f64| x.mul(Double(n, 0.0));
        weigh(x, normal.x).add(weigh(y, normal.y)).add(weigh(z, normal.z)).0 / normal.dot(ray.direction)
    };
    let (worst, crossings) = worst_ulps(Plane::new(point, normal).unwrap(), point, residual);
    println!("plane: {worst} ulp, {crossings} crossings");
    assert!(worst < 4.0 && crossings > 50_000, "{worst} {crossings}");
}
