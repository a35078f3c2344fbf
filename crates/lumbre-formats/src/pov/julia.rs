//! Slices of Julia sets in four dimensions.

use lumbre_geometry::{Aabb, Ray, Root, Roots};
use lumbre_math::{DVec3, DVec4, Elementary};

/// Beyond this length a point has escaped.
const ESCAPED: f64 = 4.0;
/// A ray looks at the set at most so often.
const MAX_STEPS: u32 = 4000;

/// How four numbers are multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Algebra {
    Quaternion,
    Hypercomplex,
}

/// The points whose iteration h ← h² + p, or h³ + p, does not escape, in a slice of the space of four dimensions.
#[derive(Clone, Debug)]
pub(super) struct Julia {
    pub parameter: DVec4,
    pub algebra: Algebra,
    /// 2 or 3.
    pub power: u32,
    pub iterations: u32,
    /// One over the distance that is told apart.
    pub precision: f64,
    /// What the normal of the slice has in four dimensions, and its distance from the origin.
    pub slice: (DVec4, f64),
}

impl Julia {
    fn times(&self, a: DVec4, b: DVec4) -> DVec4 {
        match self.algebra {
            Algebra::Quaternion => DVec4::new(
                a.x * b.x - a.y * b.y - a.z * b.z - a.w * b.w,
                a.x * b.y + a.y * b.x + a.z * b.w - a.w * b.z,
                a.x * b.z + a.z * b.x + a.w * b.y - a.y * b.w,
                a.x * b.w + a.w * b.x + a.y * b.z - a.z * b.y,
            ),
            Algebra::Hypercomplex => DVec4::new(
                a.x * b.x - a.y * b.y - a.z * b.z + a.w * b.w,
                a.x * b.y + a.y * b.x - a.z * b.w - a.w * b.z,
                a.x * b.z + a.z * b.x - a.y * b.w - a.w * b.y,
                a.x * b.w + a.w * b.x + a.y * b.z + a.z * b.y,
            ),
        }
    }

    /// The point of the slice.
    fn place(&self, p: DVec3) -> DVec4 {
        let (normal, distance) = self.slice;
        p.extend((distance - normal.truncate().dot(p)) / normal.w)
    }

    /// The logarithm of the length after all steps, over that at which it has escaped: negative inside. And the
    /// derivative of the length by the place, at most.
    fn escape(&self, p: DVec3) -> (f64, f64, f64) {
        let mut h = self.place(p);
        let mut slope = 1.0;
        let mut length = h.length();
        for i in 0..self.iterations {
            if length > ESCAPED {
                // What is left would multiply the logarithm each time.
                let rest = f64::from(self.power).powi((self.iterations - i) as i32);
                return ((length / ESCAPED).logarithm() * rest.min(1e30) + 1e-12, length, slope);
            }
            let square = self.times(h, h);
            slope *= f64::from(self.power) * length.powi(self.power as i32 - 1);
            h = if self.power == 3 { self.times(square, h) } else { square } + self.parameter;
            length = h.length();
        }
        ((length / ESCAPED).logarithm(), length, slope)
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        self.escape(p).0 <= 0.0
    }

    fn radius(&self) -> f64 {
        // Beyond it the first step escapes; lengths are multiplied by quaternions only.
        let first = match self.algebra {
            Algebra::Quaternion => (ESCAPED + self.parameter.length()).power(1.0 / f64::from(self.power)),
            Algebra::Hypercomplex => ESCAPED,
        };
        first.min(ESCAPED) * 1.01
    }

    pub(super) fn bounds(&self) -> Aabb {
        let r = DVec3::splat(self.radius());
        Aabb { min: -r, max: r }
    }

    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        let step = 0.01 / self.precision;
        let slope = |axis: DVec3| self.escape(p + axis * step).0 - self.escape(p - axis * step).0;
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
    }

    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        let length = ray.direction.length();
        let unit = ray.direction / length;
        let half = ray.origin.dot(unit);
        let rest = half * half - ray.origin.length_squared() + self.radius() * self.radius();
        if rest <= 0.0 {
            return;
        }
        let low = (-half - rest.sqrt()).max(ray.t_min * length);
        let high = (-half + rest.sqrt()).min(ray.t_max * length);
        let least = 0.1 / self.precision;
        let (mut s, mut was_inside) = (low, None);
        let mut before = low;
        for _ in 0..MAX_STEPS {
            if s >= high {
                break;
            }
            let p = ray.origin + unit * s;
            let (value, size, slope) = self.escape(p);
            let is_inside = value <= 0.0;
            if was_inside.is_some_and(|was| was != is_inside) {
                let root = self.between(ray.origin, unit, before, s, !is_inside);
                let t = root / length;
                if ray.contains(t) {
                    out.push(Root::at(t));
                }
            }
            was_inside = Some(is_inside);
            before = s;
            // The distance to the set is estimated by the length and its derivative (Hart, Sandin, Kauffman, "Ray
            // tracing deterministic 3-D fractals", 1989).
            let estimate = if is_inside { 0.0 } else { 0.25 * size * size.logarithm() / slope.max(1e-9) };
            s += estimate.clamp(least, 0.5);
        }
    }

    /// The place between two where the set begins or ends.
    fn between(&self, origin: DVec3, unit: DVec3, mut a: f64, mut b: f64, begins_inside: bool) -> f64 {
        for _ in 0..40 {
            let middle = 0.5 * (a + b);
            if self.contains(origin + unit * middle) == begins_inside {
                a = middle;
            } else {
                b = middle;
            }
        }
        0.5 * (a + b)
    }
}
