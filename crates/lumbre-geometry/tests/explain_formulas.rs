//! The formulas of an explanation are in its grammar, and give the numbers next to them.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::collections::HashMap;

use lumbre_geometry::{Explanation, Ray, Topic, Value};
use lumbre_math::DVec3;

use crate::contract;

/// A number or a vector, with a size that its rounding error is a small part of.
#[derive(Clone, Copy, Debug)]
enum Term {
    Number(f64, f64),
    Vector(DVec3, f64),
}

impl Term {
    fn number(self) -> (f64, f64) {
        match self {
            Self::Number(value, size) => (value, size),
            Self::Vector(value, _) => panic!("{value} is no number"),
        }
    }

    fn vector(self) -> (DVec3, f64) {
        match self {
            Self::Vector(value, size) => (value, size),
            Self::Number(value, _) => panic!("{value} is no vector"),
        }
    }

    fn plus(self, other: Self, sign: f64) -> Self {
        match (self, other) {
            (Self::Number(a, x), Self::Number(b, y)) => Self::Number(a + sign * b, x + y),
            (Self::Vector(a, x), Self::Vector(b, y)) => Self::Vector(a + sign * b, x + y),
            _ => panic!("{self:?} and {other:?}"),
        }
    }

    fn times(self, other: Self) -> Self {
        match (self, other) {
            (Self::Number(a, x), Self::Number(b, y)) => Self::Number(a * b, x * y),
            (Self::Vector(a, x), Self::Vector(b, y)) => Self::Number(a.dot(b), x * y),
            (Self::Number(a, x), Self::Vector(b, y)) | (Self::Vector(b, y), Self::Number(a, x)) => {
                Self::Vector(a * b, x * y)
            }
        }
    }

    fn over(self, other: Self) -> Self {
        let (b, y) = other.number();
        // What the divisor may be off by adds to the quotient's error.
        let factor = y / (b * b);
        match self {
            Self::Number(a, x) => Self::Number(a / b, x * factor),
            Self::Vector(a, x) => Self::Vector(a / b, x * factor),
        }
    }
}

struct Parser<'a> {
    rest: &'a str,
    symbols: &'a HashMap<String, Term>,
}

impl Parser<'_> {
    fn skip(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn takes(&mut self, token: &str) -> bool {
        self.skip();
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn expect(&mut self, token: &str) {
        assert!(self.takes(token), "no {token} before {:?}", self.rest);
    }

    fn sum(&mut self) -> Term {
        let mut sum = if self.takes("−") {
            let first = self.product();
            first.times(Term::Number(-1.0, 1.0))
        } else {
            self.product()
        };
        loop {
            if self.takes("+") {
                sum = sum.plus(self.product(), 1.0);
            } else if self.takes("−") {
                sum = sum.plus(self.product(), -1.0);
            } else {
                return sum;
            }
        }
    }

    fn product(&mut self) -> Term {
        let mut product = self.factor();
        loop {
            if self.takes("·") {
                product = product.times(self.factor());
            } else if self.takes("×") {
                let ((a, x), (b, y)) = (product.vector(), self.factor().vector());
                product = Term::Vector(a.cross(b), x * y);
            } else if self.takes("/") {
                product = product.over(self.factor());
            } else {
                return product;
            }
        }
    }

    fn factor(&mut self) -> Term {
        let term = self.atom();
        if self.takes("²") {
            let (value, size) = term.number();
            return Term::Number(value * value, size * size);
        }
        term
    }

    fn list(&mut self, end: &str) -> Vec<(f64, f64)> {
        let mut all = vec![self.sum().number()];
        while self.takes(",") {
            all.push(self.sum().number());
        }
        self.expect(end);
        all
    }

    fn atom(&mut self) -> Term {
        if self.takes("(") {
            let inner = self.sum();
            self.expect(")");
            return inner;
        }
        if self.takes("√(") {
            let (value, size) = self.sum().number();
            self.expect(")");
            return Term::Number(value.sqrt(), size / value.sqrt());
        }
        if self.takes("|") {
            let inner = self.sum();
            self.expect("|");
            return match inner {
                Term::Number(value, size) => Term::Number(value.abs(), size),
                Term::Vector(value, size) => Term::Number(value.length(), size),
            };
        }
        if self.takes("⟨") {
            let [(x, a), (y, b), (z, c)] = self.list("⟩")[..] else { panic!("not three components") };
            return Term::Vector(DVec3::new(x, y, z), a + b + c);
        }
        let end = |keeps: fn(char) -> bool, rest: &str| rest.find(|c| !keeps(c)).unwrap_or(rest.len());
        self.skip();
        let digits = end(|c| c.is_ascii_digit() || c == '.', self.rest);
        if digits > 0 {
            let (number, rest) = self.rest.split_at(digits);
            self.rest = rest;
            let value: f64 = number.parse().unwrap();
            return Term::Number(value, value);
        }
        let letters = end(|c| c.is_alphabetic() && !('₀'..='ₜ').contains(&c), self.rest);
        let (word, after) = self.rest.split_at(letters);
        let below = end(|c| c == '′' || ('₀'..='₉').contains(&c), after);
        let symbol = self.rest[..letters + below].to_owned();
        self.rest = &after[below..];
        if word == "min" || word == "max" {
            self.expect("(");
            let all = self.list(")");
            let size = all.iter().map(|term| term.1).fold(0.0, f64::max);
            let values = all.into_iter().map(|term| term.0);
            let value = if word == "min" {
                values.fold(f64::INFINITY, f64::min)
            } else {
                values.fold(-f64::INFINITY, f64::max)
            };
            return Term::Number(value, size);
        }
        assert!(word.chars().count() == 1 || word == "det", "{symbol:?} before {:?}", self.rest);
        *self.symbols.get(&symbol).unwrap_or_else(|| panic!("{symbol:?} before {:?}", self.rest))
    }
}

fn evaluate(formula: &str, symbols: &HashMap<String, Term>) -> Term {
    let mut parser = Parser { rest: formula, symbols };
    let term = parser.sum();
    parser.skip();
    assert!(parser.rest.is_empty(), "{:?} is left of {formula}", parser.rest);
    term
}

/// Whether a value is that of a formula, up to rounding.
fn agrees(value: &Value, term: Term) -> bool {
    let is_close = |off: f64, size: f64| off <= 1e-11 * size || off.is_nan() || !size.is_finite();
    match (value, term) {
        (Value::Number(value), Term::Number(expected, size)) => {
            *value == expected || is_close((value - expected).abs(), size.max(value.abs()))
        }
        (Value::Vector(value), Term::Vector(expected, size)) => {
            is_close((*value - expected).length(), size.max(value.length()))
        }
        _ => false,
    }
}

fn term_of(value: &Value) -> Option<Term> {
    match *value {
        Value::Number(number) => Some(Term::Number(number, number.abs())),
        Value::Vector(vector) => Some(Term::Vector(vector, vector.length())),
        Value::Numbers(_) | Value::Intervals(_) => None,
    }
}

/// Evaluates every formula of an explanation; returns how many.
fn check(explanation: &Explanation, ray: &Ray, name: &str) -> usize {
    let mut symbols = HashMap::new();
    let put = |symbols: &mut HashMap<String, Term>, symbol: &str, value: &Value| {
        if let Some(term) = term_of(value) {
            symbols.insert(symbol.to_owned(), term);
        }
    };
    put(&mut symbols, "O", &Value::Vector(ray.origin));
    put(&mut symbols, "D", &Value::Vector(ray.direction));
    let mut count = 0;
    for step in &explanation.steps {
        // The textbook's numbers are all of the ray's origin, and of the same symbols.
        let is_twofold = step.remarks.contains(&lumbre_geometry::Remark::TwicePrecision);
        for quantity in &step.quantities {
            if !quantity.formula.is_empty() {
                let term = evaluate(&quantity.formula, &symbols);
                let is_told_exactly = !is_twofold && step.topic != Topic::SetUp;
                assert!(
                    agrees(&quantity.value, term) || !is_told_exactly,
                    "{name}: {quantity:?} {term:?} {ray:?} {explanation:#?}"
                );
                count += 1;
            }
            put(&mut symbols, &quantity.symbol, &quantity.value);
        }
        // After its own symbols, for the textbook's may refer to those of the same step.
        let mut textbook = symbols.clone();
        for quantity in &step.quantities {
            let Some((formula, value)) = &quantity.schoolbook else { continue };
            let (symbol, formula) = formula.split_once(" = ").unwrap_or(("", formula));
            let term = evaluate(formula, &textbook);
            assert!(agrees(value, term), "{name}: {quantity:?} {term:?} {ray:?} {explanation:#?}");
            count += 1;
            if !symbol.is_empty() {
                put(&mut textbook, symbol, value);
                put(&mut symbols, symbol, value);
            }
        }
    }
    count
}

#[test]
fn every_formula_gives_the_number_beside_it() {
    let mut count = 0;
    let rays = if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 1000 } else { 25 };
    for subject in contract::subjects() {
        if !subject.name.ends_with("as made") {
            continue;
        }
        let mut random = subject.random(102);
        let before = count;
        for i in 0..rays {
            let near = random.ray(&subject);
            let ray = match i % 5 {
                0 => Ray { origin: near.at(-1e4 * subject.reach() / near.direction.length()), ..near },
                1 => Ray { direction: DVec3::AXES[i % 3], ..near },
                _ => near,
            };
            let explanation = subject.placed.shape().explain(&ray);
            count += check(&explanation, &ray, &subject.name);
            for operand in &explanation.operands {
                let line = ray.into_object(&operand.world_from_object);
                if let Some(explanation) = &operand.explanation {
                    count += check(explanation, &line, operand.name);
                }
            }
        }
        assert!(count > before + rays, "{}: {}", subject.name, count - before);
    }
}
