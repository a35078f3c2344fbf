//! Interval arithmetic, and numbers that carry their derivative in it.
//!
//! Every operation contains all results that it can have for numbers in its operands, rounding included. Source: R. E.
//! Moore, R. B. Kearfott, M. J. Cloud, "Introduction to Interval Analysis", SIAM, 2009; the derivatives after L. B.
//! Rall, "Automatic Differentiation: Techniques and Applications", Springer, 1981.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::Elementary;
/// All numbers from `low` to `high`, both included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The least.
    pub low: f64,
    /// The greatest; not less than `low`.
    pub high: f64,
}

/// The steps by which a function of the standard library may be wrong, with room to spare.
const LIBRARY_STEPS: u32 = 4;

impl Interval {
    /// All numbers.
    pub const WHOLE: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// A single number.
    pub fn point(x: f64) -> Self {
        Self { low: x, high: x }
    }

    /// Between two numbers, in any order.
    pub fn between(a: f64, b: f64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    /// Whether it contains a number.
    pub fn contains(&self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// A number in its middle.
    pub fn middle(&self) -> f64 {
        (0.5 * self.low + 0.5 * self.high).clamp(self.low, self.high)
    }

    /// What both contain; `None` if nothing.
    pub fn intersection(self, other: Self) -> Option<Self> {
        let both = Self { low: self.low.max(other.low), high: self.high.min(other.high) };
        (both.low <= both.high).then_some(both)
    }

    /// Bounds of results that were rounded, wrong by no more than `steps` representable numbers. Where a bound is no
    /// number, as for infinity times zero, nothing is known.
    fn outward(low: f64, high: f64, steps: u32) -> Self {
        if low.is_nan() || high.is_nan() {
            return Self::WHOLE;
        }
        Self {
            low: crate::rounding::next_down_by(low, steps),
            high: crate::rounding::next_up_by(high, steps),
        }
    }

    /// The square, which is never negative.
    #[must_use]
    pub fn square(self) -> Self {
        let Self { low, high } = self.abs();
        Self { low: (low * low).next_down().max(0.0), ..Self::outward(0.0, high * high, 1) }
    }

    /// An integral power.
    #[must_use]
    pub fn powi(self, n: u32) -> Self {
        let squares = |x: Self, times: u32| (0..times).fold(Self::point(1.0), |product, _| product * x);
        if n.is_multiple_of(2) { squares(self.square(), n / 2) } else { self * squares(self.square(), n / 2) }
    }

    /// The absolute value.
    #[must_use]
    pub fn abs(self) -> Self {
        let least = if self.contains(0.0) { 0.0 } else { self.low.abs().min(self.high.abs()) };
        Self { low: least, high: self.low.abs().max(self.high.abs()) }
    }

    /// The square root of what is not negative in it; of what is, zero.
    #[must_use]
    pub fn sqrt(self) -> Self {
        let root = |x: f64| x.max(0.0).sqrt();
        let Self { low, high } = Self::outward(root(self.low), root(self.high), 1);
        Self { low: low.max(0.0), high }
    }

    /// The exponential function.
    #[must_use]
    pub fn exp(self) -> Self {
        let Self { low, high } =
            Self::outward(self.low.exponential(), self.high.exponential(), LIBRARY_STEPS);
        Self { low: low.max(0.0), high }
    }

    /// The sine.
    #[must_use]
    pub fn sin(self) -> Self {
        (self - Self::outward(FRAC_PI_2, FRAC_PI_2, 1)).cos()
    }

    /// The cosine.
    #[must_use]
    pub fn cos(self) -> Self {
        let Self { low, high } = self;
        // If the turns are too many to be distinguished, all of them.
        let reach = low.abs().max(high.abs());
        if (high - low).is_nan() || high - low >= TAU || reach >= 1e12 {
            return Self { low: -1.0, high: 1.0 };
        }
        // Whether it contains a multiple of a turn, from some offset. The error of a quotient is below 2⁻¹⁰ of a turn
        // at the bound.
        let passes = |offset: f64| {
            let error = 4.0 * f64::EPSILON * (1.0 + reach);
            ((high + error) / TAU - offset).floor() >= ((low - error) / TAU - offset).ceil()
        };
        let ends = Self::between(low.cosine(), high.cosine());
        let Self { low: least, high: most } = Self::outward(ends.low, ends.high, LIBRARY_STEPS);
        Self {
            low: if passes(0.5) { -1.0 } else { least.max(-1.0) },
            high: if passes(0.0) { 1.0 } else { most.min(1.0) },
        }
    }
}

impl From<f64> for Interval {
    fn from(x: f64) -> Self {
        Self::point(x)
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::outward(self.low + other.low, self.high + other.high, 1)
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let products =
            [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        if products.iter().any(|product| product.is_nan()) {
            return Self::WHOLE;
        }
        let [a, b, c, d] = products;
        Self::outward(a.min(b).min(c.min(d)), a.max(b).max(c.max(d)), 1)
    }
}

impl Div for Interval {
    type Output = Self;

    /// All numbers, where the divisor contains zero.
    fn div(self, other: Self) -> Self {
        if other.contains(0.0) {
            return Self::WHOLE;
        }
        let quotients =
            [self.low / other.low, self.low / other.high, self.high / other.low, self.high / other.high];
        if quotients.iter().any(|quotient| quotient.is_nan()) {
            return Self::WHOLE;
        }
        let [a, b, c, d] = quotients;
        Self::outward(a.min(b).min(c.min(d)), a.max(b).max(c.max(d)), 1)
    }
}

/// The value of a function and its derivative, both as intervals: over all of the arguments that the function was
/// given.
///
/// A function that is written with these instead of numbers gives its derivative with its value:
///
/// ```
/// use lumbre_math::interval::{Dual, Interval};
///
/// let f = |x: Dual| x.square() - Dual::from(2.0);
/// let at = f(Dual::variable(Interval { low: 1.0, high: 2.0 }));
/// assert!(at.value.contains(0.0), "the root of two lies there");
/// assert!(at.slope.low > 1.9, "and is the only one: the function only ascends");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual {
    /// The value.
    pub value: Interval,
    /// The derivative by the variable.
    pub slope: Interval,
}

impl Dual {
    /// The variable itself.
    pub fn variable(x: Interval) -> Self {
        Self { value: x, slope: Interval::point(1.0) }
    }

    /// The square.
    #[must_use]
    pub fn square(self) -> Self {
        Self { value: self.value.square(), slope: Interval::point(2.0) * self.value * self.slope }
    }

    /// An integral power.
    #[must_use]
    pub fn powi(self, n: u32) -> Self {
        let slope = match n {
            0 => Interval::point(0.0),
            n => Interval::point(f64::from(n)) * self.value.powi(n - 1) * self.slope,
        };
        Self { value: self.value.powi(n), slope }
    }

    /// The absolute value.
    #[must_use]
    pub fn abs(self) -> Self {
        let sign = match self.value {
            Interval { low, .. } if low > 0.0 => Interval::point(1.0),
            Interval { high, .. } if high < 0.0 => Interval::point(-1.0),
            _ => Interval { low: -1.0, high: 1.0 },
        };
        Self { value: self.value.abs(), slope: sign * self.slope }
    }

    /// The square root; of what is negative, zero.
    #[must_use]
    pub fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Self { value, slope: self.slope / (Interval::point(2.0) * value) }
    }

    /// The exponential function.
    #[must_use]
    pub fn exp(self) -> Self {
        let value = self.value.exp();
        Self { value, slope: value * self.slope }
    }

    /// The sine.
    #[must_use]
    pub fn sin(self) -> Self {
        Self { value: self.value.sin(), slope: self.value.cos() * self.slope }
    }

    /// The cosine.
    #[must_use]
    pub fn cos(self) -> Self {
        Self { value: self.value.cos(), slope: -self.value.sin() * self.slope }
    }
}

impl From<f64> for Dual {
    fn from(x: f64) -> Self {
        Self { value: Interval::point(x), slope: Interval::point(0.0) }
    }
}

impl Neg for Dual {
    type Output = Self;

    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

impl Add for Dual {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl Sub for Dual {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl Mul for Dual {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let slope = self.slope * other.value + self.value * other.slope;
        Self { value: self.value * other.value, slope }
    }
}

impl Div for Dual {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, slope: (self.slope - value * other.slope) / other.value }
    }
}

/// With a plain number on either side.
macro_rules! with_numbers {
    ($($trait:ident $method:ident),*) => {$(
        impl $trait<f64> for Dual {
            type Output = Self;

            fn $method(self, other: f64) -> Self {
                $trait::$method(self, Self::from(other))
            }
        }

        impl $trait<Dual> for f64 {
            type Output = Dual;

            fn $method(self, other: Dual) -> Dual {
                $trait::$method(Dual::from(self), other)
            }
        }
    )*};
}

with_numbers!(Add add, Sub sub, Mul mul, Div div);

#[cfg(test)]
mod tests {
    use super::*;

    /// Functions of one number, plainly and by intervals.
    type Pair = (fn(f64) -> f64, fn(Dual) -> Dual);

    const FUNCTIONS: [Pair; 9] = [
        (|x| x * x - 3.0 * x, |x| x.square() - 3.0 * x),
        (|x| (x - 2.0) * (x + 0.25) / (x * x + 1.5), |x| (x - 2.0) * (x + 0.25) / (x.square() + 1.5)),
        (|x| x.powi(3) - x.powi(4), |x| x.powi(3) - x.powi(4)),
        (|x| x.abs() - 0.5, |x| x.abs() - 0.5),
        (|x| (x * x + 0.75).sqrt(), |x| (x.square() + 0.75).sqrt()),
        (|x| (0.25 * x).exp(), |x| (0.25 * x).exp()),
        (|x| x.sin() * 2.0, |x| x.sin() * 2.0),
        (|x| (3.0 * x + 0.2).cos(), |x| (3.0 * x + 0.2).cos()),
        (|x| -(1.0 / (x * x + 2.0)), |x| -(1.0 / (x.square() + 2.0))),
    ];

    #[test]
    fn values_and_differences_over_an_interval_lie_in_its_bounds() {
        let mut random = crate::random::RandomStream::new(31);
        let mut tight = 0;
        for (number, (plain, dual)) in FUNCTIONS.iter().enumerate() {
            for _ in 0..2000 {
                let from = 20.0 * f64::from(random.next_f32()) - 10.0;
                let width = [0.0, 1e-6, 0.01, 0.7, 5.0][random.next_below(5)];
                let x = Interval { low: from, high: from + width * f64::from(random.next_f32()) };
                let bounds = dual(Dual::variable(x));
                let at = |part: f64| (x.low + part * (x.high - x.low)).clamp(x.low, x.high);
                let (a, b) = (at(random.next_f32().into()), at(random.next_f32().into()));
                for place in [x.low, x.high, a, b] {
                    assert!(bounds.value.contains(plain(place)), "{number}: {x:?} at {place}, {bounds:?}");
                }
                if (a - b).abs() > 1e-3 {
                    let mean = (plain(b) - plain(a)) / (b - a);
                    let wide = Interval { low: bounds.slope.low - 1e-9, high: bounds.slope.high + 1e-9 };
                    assert!(wide.contains(mean), "{number}: {mean} over {x:?}, {bounds:?}");
                }
                tight += usize::from(width < 1e-5 && bounds.value.high - bounds.value.low < 1e-3);
            }
        }
        assert!(tight > 5000, "bounds of narrow intervals are narrow: {tight}");
    }

    #[test]
    fn what_cannot_be_bounded_is_everything() {
        let around_zero = Interval { low: -1.0, high: 2.0 };
        assert_eq!(Interval::point(1.0) / around_zero, Interval::WHOLE);
        assert_eq!(Interval::WHOLE * Interval::point(0.0), Interval::WHOLE);
        assert_eq!(Interval::WHOLE.cos(), Interval { low: -1.0, high: 1.0 });
        let wide = Interval { low: 2.0, high: 3.5 }.cos();
        assert_eq!((wide.low, wide.contains(-0.42)), (-1.0, true));
    }
}
