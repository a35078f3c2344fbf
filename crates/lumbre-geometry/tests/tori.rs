//! Tori against answers in twice the precision.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use lumbre_geometry::{Ray, Roots, Torus};
use lumbre_math::random::RandomStream;
use lumbre_math::roots::roots_between;
use lumbre_math::{DVec2, DVec3};

/// An unevaluated sum of two doubles: about 32 digits.
#[derive(Clone, Copy, Debug)]
struct Twofold {
    high: f64,
    low: f64,
}

impl From<f64> for Twofold {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl std::ops::Add for Twofold {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let sum = self.high + other.high;
        let part = sum - self.high;
        let error = (self.high - (sum - part)) + (other.high - part) + (self.low + other.low);
        let high = sum + error;
        Self { high, low: error - (high - sum) }
    }
}

impl std::ops::Sub for Twofold {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + Self { high: -other.high, low: -other.low }
    }
}

impl std::ops::Mul for Twofold {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let (product, error) = lumbre_math::quadratic::two_product(self.high, other.high);
        let error = error + (self.high * other.low + self.low * other.high);
        let high = product + error;
        Self { high, low: error - (high - product) }
    }
}

/// A torus as its implicit equation, along a line.
#[derive(Debug)]
struct Reference {
    center: DVec3,
    axis: DVec3,
    major: f64,
    minor: f64,
    origin: DVec3,
    direction: DVec3,
    // The parameter of the point nearest to the centre, rounded.
    near: f64,
}

impl Reference {
    /// |axis|² ((|P|² + R² - r²)² - 4R² |P|²) + 4R² (P·axis)², at near + s.
    fn value(&self, s: Twofold) -> Twofold {
        let coordinate = |i: usize| {
            let start = Twofold::from(self.origin[i]) - self.center[i].into();
            start + (Twofold::from(self.near) + s) * self.direction[i].into()
        };
        let p = [coordinate(0), coordinate(1), coordinate(2)];
        let a = self.axis.to_array().map(Twofold::from);
        let dot = |a: [Twofold; 3], b: [Twofold; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (pp, pa, aa) = (dot(p, p), dot(p, a), dot(a, a));
        let big = Twofold::from(self.major) * self.major.into();
        let small = Twofold::from(self.minor) * self.minor.into();
        let four_big = big * 4.0.into();
        let sum = pp + big - small;
        aa * (sum * sum - four_big * pp) + four_big * pa * pa
    }

    /// All crossings, or `None` when the line comes so near to touching that their number is a matter of rounding.
    fn roots(&self) -> Option<Vec<f64>> {
        let reach = 1.01 * (self.major + self.minor) / self.direction.length();
        // The extrema of the quartic from its values at five places: exact enough, for only signs matter there.
        let unit = self.axis.length_squared() * (self.major + self.minor).powi(4);
        let at = |s: f64| self.value((s * reach).into()).high / unit;
        let y = [at(-1.0), at(-0.5), at(0.0), at(0.5), at(1.0)];
        let c1 = (y[0] - 8.0 * y[1] + 8.0 * y[3] - y[4]) / 6.0;
        let c2 = (-y[0] + 16.0 * y[1] - 30.0 * y[2] + 16.0 * y[3] - y[4]) / 6.0;
        let c3 = 2.0 * (-y[0] + 2.0 * y[1] - 2.0 * y[3] + y[4]) / 3.0;
        let c4 = 2.0 * (y[0] - 4.0 * y[1] + 6.0 * y[2] - 4.0 * y[3] + y[4]) / 3.0;
        let extrema = roots_between(&[c1, 2.0 * c2, 3.0 * c3, 4.0 * c4], -1.0, 1.0);
        if extrema.iter().any(|&s| at(s).abs() < 1e-11) {
            return None;
        }
        let mut places = vec![-1.0];
        places.extend(extrema.iter());
        places.push(1.0);
        let mut roots = Vec::new();
        for w in places.windows(2) {
            let (mut a, mut b) = (Twofold::from(w[0] * reach), Twofold::from(w[1] * reach));
            let positive = self.value(a).high > 0.0;
            if positive == (self.value(b).high > 0.0) {
                continue;
            }
            for _ in 0..70 {
                let middle = (a + b) * 0.5.into();
                if (self.value(middle).high > 0.0) == positive { a = middle } else { b = middle }
            }
            roots.push((a + self.near.into()).high);
        }
        Some(roots)
    }
}

fn in_ball(random: &mut RandomStream) -> DVec3 {
    loop {
        let p = DVec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f64() - 1.0));
        if p.length_squared() <= 1.0 && p.length_squared() > 1e-4 {
            return p;
        }
    }
}

/// Aims rays at tori from `distance` radii away, and returns the worst error of t, as a distance in units of the
/// torus's size, times the cosine of incidence; with how many crossings were compared.
fn worst_error(distance: f64, spindle: bool, seed: u64, rays: usize) -> (f64, usize) {
    let mut random = RandomStream::new(seed);
    let (mut worst, mut compared) = (0.0_f64, 0);
    for i in 0..rays {
        let major = 3.0 + random.next_f64();
        let ratio = if spindle { 1.05 + random.next_f64() } else { 0.02 + 0.96 * random.next_f64() };
        let minor = major * ratio;
        let size = major + minor;
        let center = 5.0 * size * in_ball(&mut random);
        let axis = if i % 4 == 0 { DVec3::Z } else { in_ball(&mut random) };
        let target = center + size * in_ball(&mut random);
        let origin = target + distance * size * in_ball(&mut random).normalize();
        let direction = (target - origin) * (0.1 + random.next_f64());
        let torus = Torus::new(center, axis, major, minor).unwrap();
        let near = -(origin - center).dot(direction) / direction.length_squared();
        let reference = Reference { center, axis, major, minor, origin, direction, near };
        let Some(expected) = reference.roots() else {
            continue;
        };
        let ray = Ray::new(origin, direction).with_range(f64::NEG_INFINITY, f64::INFINITY);
        let mut roots = Roots::new();
        torus.roots(&ray, &mut roots);
        assert_eq!(roots.len(), expected.len(), "{reference:?} {roots:?} {expected:?}");
        let forward = Ray::new(origin, direction);
        assert_eq!(torus.closest(&forward), roots.iter().find(|r| r.t >= 0.0).copied());
        for (root, t) in roots.iter().zip(&expected) {
            let surface = torus.surface(&ray, root);
            let cos = surface.normal.dot(direction).abs() / direction.length();
            let error = (root.t - t).abs() * direction.length() / size;
            worst = worst.max(error * cos);
            compared += 1;
            assert!((surface.point - ray.at(*t)).length() * cos < 1e-14 * size * (10.0 + distance));
        }
    }
    (worst, compared)
}

#[test]
fn tori_are_hit_where_thirty_digits_say_from_near_and_far() {
    for (distance, most) in [(5.0, 5e-15), (50.0, 4e-14), (500.0, 4e-13), (5000.0, 4e-12)] {
        let (worst, compared) = worst_error(distance, false, 3, 10_000);
        println!("ring, distance {distance}: {worst:.1e} over {compared} crossings");
        assert!(worst < most && compared > 8_000, "{distance} {worst} {compared}");
    }
}

#[test]
fn both_sheets_of_a_spindle_are_hit_where_thirty_digits_say() {
    for (distance, most) in [(5.0, 1e-13), (500.0, 2e-12)] {
        let (worst, compared) = worst_error(distance, true, 4, 6_000);
        println!("spindle, distance {distance}: {worst:.1e} over {compared} crossings");
        assert!(worst < most && compared > 8_000, "{distance} {worst} {compared}");
    }
}

#[test]
fn lines_that_almost_touch_cross_an_even_number_of_times() {
    let (major, minor) = (3.0, 1.25);
    let torus = Torus::new(DVec3::new(1.0, -2.0, 0.5), DVec3::new(1.0, 2.0, -2.0), major, minor).unwrap();
    let mut random = RandomStream::new(9);
    let mut counts = [0usize; 5];
    for _ in 0..200_000 {
        let surface = torus.surface_at(0, DVec2::new(random.next_f64(), random.next_f64())).unwrap();
        let turn = DVec2::from_angle(6.0 * random.next_f64());
        let tangent = turn.x * surface.dpdu.normalize() + turn.y * surface.dpdv.normalize();
        let offset = (random.next_f64() - 0.5) * 10f64.powf(-16.0 * random.next_f64());
        let through = surface.point + offset * surface.normal;
        let ray = Ray::new(through - 20.0 * tangent, tangent);
        let mut roots = Roots::new();
        torus.roots(&ray, &mut roots);
        let crossings: usize = roots.iter().map(|r| usize::from(r.multiplicity)).sum();
        assert!(crossings.is_multiple_of(2), "{ray:?} {roots:?}");
        assert!(roots.windows(2).all(|w| w[0].t < w[1].t));
        counts[crossings.min(4)] += 1;
    }
    assert!(counts[0] > 10_000 && counts[2] > 10_000 && counts[4] > 10_000, "{counts:?}");
}
