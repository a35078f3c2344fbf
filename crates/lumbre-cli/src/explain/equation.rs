//! Whether an equation between written numbers holds to the last digit, or only nearly.

use std::ops::{Add, Div, Mul, Neg, Sub};

use lumbre::math::Elementary;

/// Whether a formula of numbers gives what is written as its result; `None` where that cannot be said, as of matrices.
/// Colours are multiplied component by component, while `·` of two vectors is their dot product.
pub(super) fn holds(formula: &str, result: &str, of_colours: bool) -> Option<bool> {
    let value = |text: &str| Parser { rest: text, of_colours }.whole();
    let (found, written) = (value(formula)?, value(result)?);
    // About 30 digits are right of the largest number on the way.
    let slack = 1e-27 * found.size.max(written.size);
    let is_close = |a: Twofold, b: Twofold| (a - b).high.abs() <= slack;
    let pairs = match (found.numbers, written.numbers) {
        (Numbers::One(a), Numbers::One(b)) => vec![(a, b)],
        (Numbers::Three(a), Numbers::Three(b)) => a.into_iter().zip(b).collect(),
        // A colour of three equal components is written as one number.
        (Numbers::Three(a), Numbers::One(b)) if of_colours => a.map(|a| (a, b)).to_vec(),
        (Numbers::One(a), Numbers::Three(b)) if of_colours => b.map(|b| (a, b)).to_vec(),
        _ => return None,
    };
    let is_known = slack.is_finite() && pairs.iter().all(|(a, b)| a.high.is_finite() && b.high.is_finite());
    is_known.then(|| pairs.into_iter().all(|(a, b)| is_close(a, b)))
}

/// A number of about 32 digits: the sum of two doubles, of which the first is the number rounded (Dekker, "A
/// floating-point technique for extending the available precision", 1971).
#[derive(Clone, Copy, Debug)]
struct Twofold {
    high: f64,
    low: f64,
}

impl Twofold {
    fn of(high: f64) -> Self {
        Self { high, low: 0.0 }
    }

    /// The sum of two doubles, without error.
    fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let b_part = high - a;
        Self { high, low: (a - (high - b_part)) + (b - b_part) }
    }

    /// The product of two doubles, without error.
    fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        Self { high, low: a.multiply_add(b, -high) }
    }

    fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        if root == 0.0 {
            return Self::of(0.0);
        }
        let rest = self - Self::product(root, root);
        Self::sum(root, rest.high / (2.0 * root))
    }

    /// A power of ten.
    fn ten_to(exponent: u32) -> Self {
        (0..exponent).fold(Self::of(1.0), |power, _| power * Self::of(10.0))
    }

    /// A numeral, as `-1.5e-7`.
    fn read(text: &str) -> Option<Self> {
        let (digits, exponent) = match text.split_once('e') {
            Some((digits, exponent)) => (digits, exponent.parse().ok()?),
            None => (text, 0_i32),
        };
        let (sign, digits) = digits.strip_prefix('-').map_or((1.0, digits), |rest| (-1.0, rest));
        let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
        let exponent = exponent - i32::try_from(fraction.len()).ok()?;
        let mut value = Self::of(0.0);
        for digit in whole.chars().chain(fraction.chars()) {
            value = value * Self::of(10.0) + Self::of(f64::from(digit.to_digit(10)?));
        }
        let power = Self::ten_to(exponent.unsigned_abs());
        let value = if exponent < 0 { value / power } else { value * power };
        Some(value * Self::of(sign))
    }
}

impl Add for Twofold {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.high, other.high), Self::sum(self.low, other.low));
        let middle = Self::sum(high.high, high.low + low.high);
        Self::sum(middle.high, middle.low + low.low)
    }
}

impl Neg for Twofold {
    type Output = Self;

    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Sub for Twofold {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Twofold {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = Self::product(self.high, other.high);
        Self::sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Twofold {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::of(first);
        let second = rest.high / other.high;
        let third = (rest - other * Self::of(second)).high / other.high;
        Self::sum(first, second) + Self::of(third)
    }
}

/// One number, or three.
#[derive(Clone, Copy, Debug)]
enum Numbers {
    One(Twofold),
    Three([Twofold; 3]),
}

/// What a part of a formula gives.
#[derive(Clone, Copy, Debug)]
struct Term {
    numbers: Numbers,
    /// The rounding error is a small part of this.
    size: f64,
}

impl Term {
    fn one(value: Twofold, size: f64) -> Self {
        Self { numbers: Numbers::One(value), size }
    }

    fn number(self) -> Option<Twofold> {
        match self.numbers {
            Numbers::One(value) => Some(value),
            Numbers::Three(_) => None,
        }
    }

    fn vector(self) -> Option<[Twofold; 3]> {
        match self.numbers {
            Numbers::Three(values) => Some(values),
            Numbers::One(_) => None,
        }
    }

    /// Component by component; a single number goes with each of three.
    fn with(self, other: Self, size: f64, each: impl Fn(Twofold, Twofold) -> Twofold) -> Self {
        let numbers = match (self.numbers, other.numbers) {
            (Numbers::One(a), Numbers::One(b)) => Numbers::One(each(a, b)),
            (Numbers::Three(a), Numbers::One(b)) => Numbers::Three(a.map(|a| each(a, b))),
            (Numbers::One(a), Numbers::Three(b)) => Numbers::Three(b.map(|b| each(a, b))),
            (Numbers::Three(a), Numbers::Three(b)) => {
                Numbers::Three(std::array::from_fn(|i| each(a[i], b[i])))
            }
        };
        Self { numbers, size }
    }

    fn dot(a: [Twofold; 3], b: [Twofold; 3]) -> Twofold {
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }
}

/// Reads formulas of numbers in the grammar of explanations.
struct Parser<'a> {
    rest: &'a str,
    of_colours: bool,
}

impl Parser<'_> {
    fn takes(&mut self, token: &str) -> bool {
        self.rest = self.rest.trim_start();
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn whole(mut self) -> Option<Term> {
        let term = self.sum()?;
        self.rest.trim().is_empty().then_some(term)
    }

    fn sum(&mut self) -> Option<Term> {
        let is_negative = self.takes("−");
        let mut sum = self.product()?;
        if is_negative {
            sum = Term::one(Twofold::of(-1.0), 1.0).with(sum, sum.size, |a, b| a * b);
        }
        loop {
            if self.takes("+") {
                let next = self.product()?;
                sum = sum.with(next, sum.size + next.size, |a, b| a + b);
            } else if self.takes("−") {
                let next = self.product()?;
                sum = sum.with(next, sum.size + next.size, |a, b| a - b);
            } else {
                return Some(sum);
            }
        }
    }

    fn product(&mut self) -> Option<Term> {
        let mut product = self.factor()?;
        loop {
            if self.takes("·") {
                let next = self.factor()?;
                let size = product.size * next.size;
                product = match (product.numbers, next.numbers) {
                    (Numbers::Three(a), Numbers::Three(b)) if !self.of_colours => {
                        Term::one(Term::dot(a, b), size)
                    }
                    _ => product.with(next, size, |a, b| a * b),
                };
            } else if self.takes("×") {
                let next = self.factor()?;
                let (a, b) = (product.vector()?, next.vector()?);
                let part = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
                let numbers = Numbers::Three([part(1, 2), part(2, 0), part(0, 1)]);
                product = Term { numbers, size: product.size * next.size };
            } else if self.takes("/") {
                let next = self.factor()?;
                let by = next.number()?.high.abs();
                // What the divisor may be off by adds to the quotient's error.
                let size = product.size * next.size.max(by) / (by * by);
                product = product.with(next, size, |a, b| a / b);
            } else {
                return Some(product);
            }
        }
    }

    fn factor(&mut self) -> Option<Term> {
        let term = self.atom()?;
        if self.takes("²") {
            let value = term.number()?;
            return Some(Term::one(value * value, term.size * term.size));
        }
        Some(term)
    }

    /// What stands between a bracket that was taken and its `end`.
    fn list(&mut self, end: &str) -> Option<Vec<Term>> {
        let mut all = vec![self.sum()?];
        while self.takes(",") {
            all.push(self.sum()?);
        }
        self.takes(end).then_some(all)
    }

    fn atom(&mut self) -> Option<Term> {
        for (begin, end) in [("(", ")"), ("⟨", "⟩")] {
            if self.takes(begin) {
                let all = self.list(end)?;
                return match all[..] {
                    [only] => Some(only),
                    [x, y, z] => {
                        let numbers = Numbers::Three([x.number()?, y.number()?, z.number()?]);
                        Some(Term { numbers, size: x.size + y.size + z.size })
                    }
                    _ => None,
                };
            }
        }
        if self.takes("√(") {
            let [inner] = self.list(")")?[..] else { return None };
            let root = inner.number()?.sqrt();
            let size = if root.high > 0.0 { inner.size / root.high } else { inner.size.sqrt() };
            return Some(Term::one(root, size));
        }
        if self.takes("|") {
            let [inner] = self.list("|")?[..] else { return None };
            let length = match inner.numbers {
                Numbers::One(value) if value.high < 0.0 => -value,
                Numbers::One(value) => value,
                Numbers::Three(v) => Term::dot(v, v).sqrt(),
            };
            return Some(Term::one(length, inner.size));
        }
        for (name, keeps_first) in [("min(", f64::le as fn(&f64, &f64) -> bool), ("max(", f64::ge)] {
            if self.takes(name) {
                let all = self.list(")")?;
                let mut best = *all.first()?;
                for term in all {
                    if !keeps_first(&best.number()?.high, &term.number()?.high) {
                        best = term;
                    }
                }
                return Some(best);
            }
        }
        self.numeral()
    }

    fn numeral(&mut self) -> Option<Term> {
        self.rest = self.rest.trim_start();
        let mut before = ' ';
        let is_outside = |c: char| {
            let is_sign = c == '-' && (before == ' ' || before == 'e');
            let keeps = c.is_ascii_digit() || c == '.' || is_sign || (c == 'e' && before != ' ');
            before = c;
            !keeps
        };
        let end = self.rest.find(is_outside).unwrap_or(self.rest.len());
        let (digits, rest) = self.rest.split_at(end);
        self.rest = rest;
        let value = if digits.is_empty() { None } else { Twofold::read(digits) }?;
        Some(Term::one(value, value.high.abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_decide_whether_an_equation_holds() {
        for (formula, result, expected) in [
            // 8.36/7.6 is 1.1.
            ("8.36/7.6", "1.1", true),
            ("8.36/7.6", "1.0999999999999999", false),
            ("(-12)² − 4·4·8.36", "10.24", true),
            ("(-12)² − 4·4·8.36", "10.240000000000009", false),
            ("0.1 + 0.2", "0.3", true),
            ("0.1 + 0.2", "0.30000000000000004", false),
            ("1/3", "0.3333333333333333", false),
            ("√(2.56) − (-6)", "7.6", true),
            ("√(2)", "1.4142135623730951", false),
            ("−(0 + √(0.25))", "-0.5", true),
            ("(-3, 0.6, 0)·(2, 0, 0)", "-6", true),
            ("(-3, 0.6, 0)·(-3, 0.6, 0) − 1²", "8.36", true),
            ("(1, 0, 0)×(0, 1, 0)", "(0, 0, 1)", true),
            ("(0, 0, 2)/|(0, 0, 2)|", "(0, 0, 1)", true),
            ("|(0.6, 0, 0.8)×(0, 0, 1)|²", "0.36", true),
            ("2·(3, 1, 0) + ⟨1, 2, 1 − 0.5⟩", "(7, 4, 0.5)", true),
            ("min(-1, 0.5) − max(2, 3e-9)", "-3", true),
            ("1e-9·1e9", "1", true),
            ("-1.5e-7 + 2.5e-7", "1e-7", true),
        ] {
            assert_eq!(holds(formula, result, false), Some(expected), "{formula} and {result}");
        }
        for (formula, result, expected) in [
            ("(0.5, 0.25, 1)·2·(3, 2, 1)", "(3, 1, 2)", true),
            ("1·(0.1, 0.2, 0.3)", "(0.1, 0.2, 0.3)", true),
            ("0.1·(0.1, 0.1, 0.1)", "0.01", true),
            ("0.89626133·10·0.11093717", "0.99428695", false),
        ] {
            assert_eq!(holds(formula, result, true), Some(expected), "{formula} and {result}");
        }
        for unknown in ["∞ − 1", "M 2", "1 +", "(1, 2)", "√(-1)", ""] {
            assert_eq!(holds(unknown, "1", false), None, "{unknown}");
        }
    }
}
