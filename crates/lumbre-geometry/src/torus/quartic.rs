//! The quartic along a line, and the torus's own equation.

use super::Torus;
use super::line::Line;

/// The quartic whose roots are the crossings: s⁴ + p s² + q s + w. Away from the roots it is as accurate as the
/// torus's own equation, and faster.
#[derive(Clone, Copy)]
pub(crate) struct Quartic {
    pub(crate) p: f64,
    pub(crate) q: f64,
    pub(crate) w: f64,
}

impl Quartic {
    #[inline]
    pub(crate) fn new(torus: &Torus, line: &Line) -> Self {
        let (big, small) = (torus.major * torus.major, torus.minor * torus.minor);
        let (p, u) = (line.p, line.u);
        let reach = p.length_squared() - small;
        let sum = reach + big;
        Self {
            p: 2.0 * (reach - big + 2.0 * big * u.z * u.z),
            q: 8.0 * big * p.z * u.z,
            w: sum * sum - 4.0 * big * (p.x * p.x + p.y * p.y),
        }
    }

    #[inline]
    pub(crate) fn at(&self, s: f64) -> (f64, f64) {
        let square = s * s;
        let value = (square + self.p) * square + (self.q * s + self.w);
        (value, (4.0 * square + 2.0 * self.p) * s + self.q)
    }

    pub(crate) fn curvature(&self, s: f64) -> f64 {
        12.0 * s * s + 2.0 * self.p
    }
}

impl Torus {
    /// The quartic along a line.
    pub(crate) fn quartic(&self, line: &Line) -> Quartic {
        Quartic::new(self, line)
    }

    /// The implicit function of the torus and its slope along the line; negative inside, positive outside.
    ///
    /// For a ring it is (ρ - R)² + z² - r²: the quartic's other factor (ρ + R)² + z² - r² is positive and would
    /// only add rounding. For the others it is the product.
    #[inline]
    pub(crate) fn value_and_slope(&self, line: &Line, s: f64) -> (f64, f64) {
        let p = line.p + s * line.u;
        let rho = (p.x * p.x + p.y * p.y).sqrt();
        let outward = p.x * line.u.x + p.y * line.u.y;
        if self.is_ring() {
            let from_circle = rho - self.major;
            let value = (from_circle - self.minor) * (from_circle + self.minor) + p.z * p.z;
            return (value, 2.0 * (from_circle * outward / rho + p.z * line.u.z));
        }
        let (outer, inner) = self.factors(rho, p.z);
        let (big, small) = (self.major * self.major, self.minor * self.minor);
        let along = p.dot(line.u);
        (outer * inner, 4.0 * (p.length_squared() + big - small) * along - 8.0 * big * outward)
    }

    /// (ρ - R)² + z² - r² and (ρ + R)² + z² - r².
    #[inline]
    pub(crate) fn factors(&self, rho: f64, z: f64) -> (f64, f64) {
        let (near, far) = (rho - self.major, rho + self.major);
        let outer = (near - self.minor) * (near + self.minor) + z * z;
        let inner = (far - self.minor) * (far + self.minor) + z * z;
        (outer, inner)
    }

    /// The sign of the quartic at `s`, 0 where rounding leaves it uncertain; and the quartic itself. A ring's
    /// sign is that of its first factor.
    #[inline]
    pub(crate) fn sign_and_quartic(&self, line: &Line, s: f64) -> (f64, f64) {
        let p = line.p + s * line.u;
        let (outer, inner) = self.factors((p.x * p.x + p.y * p.y).sqrt(), p.z);
        let size = self.major + self.minor;
        let rounding = 16.0 * f64::EPSILON * size;
        let (value, uncertain) = if self.is_ring() {
            (outer, rounding * self.minor)
        } else {
            let rounding = rounding * size;
            (outer * inner, rounding * (outer.abs() + inner.abs() + rounding))
        };
        let sign = if value.abs() <= uncertain { 0.0 } else { value.signum() };
        (sign, outer * inner)
    }
}
