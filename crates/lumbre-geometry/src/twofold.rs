//! Numbers of twice the precision, and the sizes that bound rounding errors: what decides where doubles cannot.

use std::ops::{Add, Div, Mul, Sub};

use lumbre_math::DVec3;
use lumbre_math::quadratic::two_product;

/// What the coefficients of an equation can be computed in: doubles, [`Magnitude`] or [`Twofold`].
pub(crate) trait Number:
    Copy + From<f64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// `a - b`.
    fn difference(a: f64, b: f64) -> Self;
}

impl Number for f64 {
    #[inline]
    fn difference(a: f64, b: f64) -> Self {
        a - b
    }
}

/// The dot product.
#[inline]
pub(crate) fn dot<N: Number>(a: [N; 3], b: [N; 3]) -> N {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The cross product.
#[inline]
pub(crate) fn cross<N: Number>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The same components as other numbers.
#[inline]
pub(crate) fn components<N: Number>(v: DVec3) -> [N; 3] {
    v.to_array().map(N::from)
}

/// The sum of the absolute values of the terms that a number is computed from: its rounding error is some units of the
/// unit roundoff of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Magnitude(pub(crate) f64);

impl From<f64> for Magnitude {
    #[inline]
    fn from(value: f64) -> Self {
        Self(value.abs())
    }
}

impl Number for Magnitude {
    #[inline]
    fn difference(a: f64, b: f64) -> Self {
        Self((a - b).abs())
    }
}

impl Add for Magnitude {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Magnitude {
    type Output = Self;

    #[allow(clippy::suspicious_arithmetic_impl, reason = "sizes add up whatever the sign")]
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + other
    }
}

impl Mul for Magnitude {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

/// A number of about 32 digits: the sum of two doubles; the first is the rounded number.
///
/// T. J. Dekker, "A floating-point technique for extending the available precision", Numerische Mathematik, 1971.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twofold {
    pub(crate) high: f64,
    pub(crate) low: f64,
}

impl Twofold {
    pub(crate) const ZERO: Self = Self { high: 0.0, low: 0.0 };

    /// `a + b` without error.
    #[inline]
    pub(crate) fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let part = high - a;
        Self { high, low: (a - (high - part)) + (b - part) }
    }

    /// `a b` without error, barring over- and underflow.
    #[inline]
    pub(crate) fn product(a: f64, b: f64) -> Self {
        let (high, low) = two_product(a, b);
        Self { high, low }
    }

    /// A sum whose second number is small compared with the first.
    #[inline]
    fn normalized(high: f64, low: f64) -> Self {
        let sum = high + low;
        Self { high: sum, low: low - (sum - high) }
    }

    /// This times a double, not yet normalised.
    #[inline]
    pub(crate) fn times(self, x: f64) -> Self {
        let product = Self::product(self.high, x);
        Self { high: product.high, low: product.low + self.low * x }
    }

    pub(crate) fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        if root == 0.0 {
            return Self::ZERO;
        }
        let rest = self - Self::product(root, root);
        Self::normalized(root, 0.5 * rest.high / root)
    }

    pub(crate) fn negated(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }

    pub(crate) fn is_finite(self) -> bool {
        self.high.is_finite() && self.low.is_finite()
    }
}

impl From<f64> for Twofold {
    #[inline]
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Number for Twofold {
    #[inline]
    fn difference(a: f64, b: f64) -> Self {
        Self::sum(a, -b)
    }
}

impl Add for Twofold {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let sum = Self::sum(self.high, other.high);
        Self::normalized(sum.high, sum.low + (self.low + other.low))
    }
}

impl Sub for Twofold {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        let difference = Self::difference(self.high, other.high);
        Self::normalized(difference.high, difference.low + (self.low - other.low))
    }
}

impl Mul for Twofold {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let product = Self::product(self.high, other.high);
        let rest = self.high * other.low + self.low * other.high;
        Self::normalized(product.high, product.low + rest)
    }
}

impl Div for Twofold {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let quotient = self.high / other.high;
        let rest = self - other * Self::from(quotient);
        Self::normalized(quotient, rest.high / other.high)
    }
}

/// The point `origin - base + t direction` in twice the precision.
#[inline]
pub(crate) fn place(origin: DVec3, base: DVec3, t: f64, direction: DVec3) -> [Twofold; 3] {
    std::array::from_fn(|i| Twofold::difference(origin[i], base[i]) + Twofold::product(t, direction[i]))
}

/// The same point rounded, with nothing lost on a long way there.
#[inline]
pub(crate) fn point(origin: DVec3, base: DVec3, t: f64, direction: DVec3) -> DVec3 {
    let moved = t * direction;
    let near = (origin - base) + moved;
    // False for a NaN.
    let is_close = moved.abs().max_element() <= 16.0 * near.abs().max_element();
    if is_close { near } else { exact_point(origin, base, t, direction, near) }
}

/// The same point rounded once, or `rough` where a product over- or underflows.
#[inline(never)]
fn exact_point(origin: DVec3, base: DVec3, t: f64, direction: DVec3, rough: DVec3) -> DVec3 {
    let exact = DVec3::from_array(place(origin, base, t, direction).map(|x| x.high));
    // Splitting overflows slightly before the product does.
    if exact.is_finite() { exact } else { rough }
}

/// A parameter next to `t`, the point `origin - base + t direction` there, and a bound on that point's error in units
/// of the unit roundoff: what is lost on a long way is 2^-26 of what doubles lose.
#[inline]
pub(crate) fn place_near(origin: DVec3, base: DVec3, t: f64, direction: DVec3) -> (f64, DVec3, DVec3) {
    // Halves of the digits, whose products are exact.
    let half = |x: f64| f64::from_bits(x.to_bits() & (!0 << 27));
    let t = half(t);
    let split = direction.map(half);
    let (moved, rest) = (t * split, t * (direction - split));
    let way = DVec3::from_array(std::array::from_fn(|i| {
        let from_base = Twofold::difference(origin[i], base[i]);
        (from_base.high + moved[i]) + (from_base.low + rest[i])
    }));
    (t, way, 2.0 * way.abs() + 2.0 * rest.abs() + f64::EPSILON * moved.abs())
}

#[cfg(test)]
mod tests {
    use lumbre_math::rounding::UNIT_ROUNDOFF;

    use super::*;

    #[test]
    fn numbers_of_twice_the_precision_keep_thirty_digits() {
        let third = Twofold::from(1.0) / Twofold::from(3.0);
        let off = third * Twofold::from(3.0) - Twofold::from(1.0);
        assert!(off.high.abs() < 1e-31, "{off:?}");
        let root = Twofold::from(2.0).sqrt();
        let off = root * root - Twofold::from(2.0);
        assert!(off.high.abs() < 1e-30, "{off:?}");
        let tiny = (Twofold::sum(1e16, 0.3) - Twofold::from(1e16)).high;
        assert_eq!(tiny, 0.3);
    }

    #[test]
    fn magnitudes_bound_rounding_errors() {
        fn expression<N: Number>() -> N {
            let [x, y, z] = [0.1, 0.7, -0.3].map(N::from);
            (x * y + z * x) * (y - z) - x * x * y
        }
        let off = (Twofold::from(expression::<f64>()) - expression::<Twofold>()).high.abs();
        let size = expression::<Magnitude>().0;
        assert!((size - 0.107).abs() < 1e-12, "{size}");
        assert!(off <= 4.0 * UNIT_ROUNDOFF * size, "{off} {size}");
    }
}
