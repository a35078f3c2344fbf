//! Numbers of twice the precision, and numbers that carry a bound of their error: what decides where doubles cannot.

use std::ops::{Add, Div, Mul, Sub};

use lumbre_math::DVec3;
use lumbre_math::quadratic::two_product;
use lumbre_math::rounding::UNIT_ROUNDOFF;

/// What the coefficients of an equation can be computed in: doubles, [`Bounded`] or [`Twofold`].
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

/// A double, and a bound on what rounding has made it wrong by, in units of the unit roundoff.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounded {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

impl Bounded {
    /// Whether the sign is that of the exact number.
    #[inline]
    pub(crate) fn is_certain(self) -> bool {
        self.value.abs() > 2.0 * UNIT_ROUNDOFF * self.error
    }
}

impl From<f64> for Bounded {
    #[inline]
    fn from(value: f64) -> Self {
        Self { value, error: 0.0 }
    }
}

impl Number for Bounded {
    #[inline]
    fn difference(a: f64, b: f64) -> Self {
        let value = a - b;
        Self { value, error: value.abs() }
    }
}

impl Add for Bounded {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let value = self.value + other.value;
        Self { value, error: self.error + other.error + value.abs() }
    }
}

impl Sub for Bounded {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        let value = self.value - other.value;
        Self { value, error: self.error + other.error + value.abs() }
    }
}

impl Mul for Bounded {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let value = self.value * other.value;
        let carried = self.value.abs() * other.error
            + other.value.abs() * self.error
            + UNIT_ROUNDOFF * self.error * other.error;
        Self { value, error: carried + value.abs() }
    }
}

/// A number of about 32 digits: the sum of two doubles, of which the first is the number rounded.
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

    /// A sum whose second number is small beside the first.
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
pub(crate) fn exact_point(origin: DVec3, base: DVec3, t: f64, direction: DVec3, rough: DVec3) -> DVec3 {
    let exact = DVec3::from_array(place(origin, base, t, direction).map(|x| x.high));
    // Splitting overflows slightly before the product does.
    if exact.is_finite() { exact } else { rough }
}

#[cfg(test)]
mod tests {
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
    fn a_bound_holds_the_error_that_it_bounds() {
        let [x, y, z] = [0.1, 0.7, -0.3].map(Bounded::from);
        let computed = (x * y + z * x) * (y - z) - x * x * y;
        let exact = {
            let [x, y, z] = [0.1, 0.7, -0.3].map(Twofold::from);
            (x * y + z * x) * (y - z) - x * x * y
        };
        let off = (Twofold::from(computed.value) - exact).high.abs();
        assert!(off <= UNIT_ROUNDOFF * computed.error && computed.error < 1.0, "{off} {computed:?}");
        assert!(!(x * y - Bounded::from(0.1 * 0.7)).is_certain() && computed.is_certain());
    }
}
