//! Functions of x, y and z, as texts, with bounds of their values and slopes: implicit surfaces of Python.

use lumbre::geometry::{Aabb, ImplicitSurface};
use lumbre::math::interval::{Dual, Interval};
use pyo3::prelude::*;

use crate::errors::{invalid, unknown};

/// A step of a machine with a stack.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    /// x, y or z.
    Coordinate(usize),
    Add,
    Subtract,
    Multiply,
    Divide,
    Negate,
    Power(u32),
    Sqrt,
    Abs,
    Sin,
    Cos,
    Exp,
    Min,
    Max,
}

/// A function of a point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Expression {
    steps: Vec<Step>,
}

/// Numbers that wait on the stack, at most.
const MAX_WAITING: usize = 48;
const MAX_STEPS: usize = 4096;
/// Parentheses in parentheses, at most.
const MAX_NESTED: usize = 100;
const FUNCTIONS: [&str; 9] = ["sqrt", "abs", "sin", "cos", "tan", "exp", "min", "max", "length"];
const NAMES: [&str; 5] = ["x", "y", "z", "pi", "e"];

impl Expression {
    /// Of a text such as `x**2 + y**2 + z**2 - 1`, in the words of Python.
    ///
    /// # Errors
    /// Says what is wrong, and where.
    pub(crate) fn parse(text: &str) -> PyResult<Self> {
        let mut parser = Parser { text, at: 0, steps: Vec::new(), nested: 0 };
        parser.sum()?;
        if !parser.rest().is_empty() {
            return Err(parser.wrong("an operator"));
        }
        let expression = Self { steps: parser.steps };
        if expression.waiting() > MAX_WAITING {
            return Err(too_long());
        }
        Ok(expression)
    }

    /// The most numbers that wait at a time.
    fn waiting(&self) -> usize {
        let (mut now, mut most) = (0_usize, 0);
        for step in &self.steps {
            match step {
                Step::Number(_) | Step::Coordinate(_) => now += 1,
                Step::Add | Step::Subtract | Step::Multiply | Step::Divide | Step::Min | Step::Max => {
                    now -= 1
                }
                _ => {}
            }
            most = most.max(now);
        }
        most
    }

    /// Bounds of the value and of the slope.
    pub(crate) fn at(&self, p: [Dual; 3]) -> Dual {
        let mut stack = [Dual::from(0.0); MAX_WAITING];
        let mut count = 0;
        for step in &self.steps {
            match *step {
                Step::Number(number) => {
                    stack[count] = Dual::from(number);
                    count += 1;
                }
                Step::Coordinate(axis) => {
                    stack[count] = p[axis];
                    count += 1;
                }
                Step::Add | Step::Subtract | Step::Multiply | Step::Divide | Step::Min | Step::Max => {
                    count -= 1;
                    let (a, b) = (stack[count - 1], stack[count]);
                    stack[count - 1] = match step {
                        Step::Add => a + b,
                        Step::Subtract => a - b,
                        Step::Multiply => a * b,
                        Step::Divide => a / b,
                        Step::Min => least(a, b),
                        _ => -least(-a, -b),
                    };
                }
                one => {
                    let a = stack[count - 1];
                    stack[count - 1] = match one {
                        Step::Negate => -a,
                        Step::Power(n) => a.powi(n),
                        Step::Sqrt => a.sqrt(),
                        Step::Abs => a.abs(),
                        Step::Sin => a.sin(),
                        Step::Cos => a.cos(),
                        _ => a.exp(),
                    };
                }
            }
        }
        stack[0]
    }
}

/// The lesser of two numbers.
fn least(a: Dual, b: Dual) -> Dual {
    if a.value.high < b.value.low {
        return a;
    }
    if b.value.high < a.value.low {
        return b;
    }
    let value = Interval { low: a.value.low.min(b.value.low), high: a.value.high.min(b.value.high) };
    let slope = Interval { low: a.slope.low.min(b.slope.low), high: a.slope.high.max(b.slope.high) };
    Dual { value, slope }
}

fn too_long() -> PyErr {
    invalid(format!(
        "the expression is too long (expected at most {MAX_STEPS} steps, and {MAX_WAITING} open at a time)"
    ))
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    steps: Vec<Step>,
    nested: usize,
}

impl<'a> Parser<'a> {
    fn rest(&mut self) -> &'a str {
        let rest = &self.text[self.at..];
        let trimmed = rest.trim_start();
        self.at += rest.len() - trimmed.len();
        trimmed
    }

    fn takes(&mut self, mark: &str) -> bool {
        let is_there = self.rest().starts_with(mark);
        if is_there {
            self.at += mark.len();
        }
        is_there
    }

    fn wrong(&mut self, expected: &str) -> PyErr {
        let found = match self.rest().chars().next() {
            Some(c) => format!("\"{c}\" at position {}", self.text[..self.at].chars().count() + 1),
            None => "its end".to_owned(),
        };
        invalid(format!("expression \"{}\": found {found}; expected {expected}", self.text))
    }

    fn expect(&mut self, mark: &str) -> PyResult<()> {
        if self.takes(mark) { Ok(()) } else { Err(self.wrong(&format!("\"{mark}\""))) }
    }

    fn sum(&mut self) -> PyResult<()> {
        self.nested += 1;
        if self.nested > MAX_NESTED {
            return Err(self.wrong(&format!("no more than {MAX_NESTED} parentheses in each other")));
        }
        self.product()?;
        loop {
            if self.takes("+") {
                self.product()?;
                self.steps.push(Step::Add);
            } else if self.takes("-") {
                self.product()?;
                self.steps.push(Step::Subtract);
            } else {
                self.nested -= 1;
                return Ok(());
            }
        }
    }

    fn product(&mut self) -> PyResult<()> {
        self.signed()?;
        loop {
            if self.rest().starts_with("**") {
                return Ok(());
            }
            if self.takes("*") {
                self.signed()?;
                self.steps.push(Step::Multiply);
            } else if self.takes("/") {
                self.signed()?;
                self.steps.push(Step::Divide);
            } else {
                return Ok(());
            }
        }
    }

    /// A power with signs before it, which bind less.
    fn signed(&mut self) -> PyResult<()> {
        let mut is_negative = false;
        loop {
            if self.takes("-") {
                is_negative = !is_negative;
            } else if !self.takes("+") {
                break;
            }
        }
        self.power()?;
        if is_negative {
            self.steps.push(Step::Negate);
        }
        Ok(())
    }

    fn power(&mut self) -> PyResult<()> {
        self.atom()?;
        while self.takes("**") || self.takes("^") {
            let is_negative = self.takes("-");
            let start = self.at;
            let Some(exponent) = self.number() else { return Err(self.wrong("an exponent")) };
            if !is_negative && exponent == 0.5 {
                self.steps.push(Step::Sqrt);
                continue;
            }
            if exponent.fract() != 0.0 || exponent > 64.0 {
                self.at = start;
                return Err(self.wrong("a whole exponent from -64 to 64, or 0.5"));
            }
            self.steps.push(Step::Power(exponent as u32));
            if is_negative {
                // 1 / a by what there is: a, 1 is no order of this machine.
                let power = self.steps.split_off(self.start_of_last());
                self.steps.push(Step::Number(1.0));
                self.steps.extend(power);
                self.steps.push(Step::Divide);
            }
        }
        Ok(())
    }

    /// Where the steps of the last number begin.
    fn start_of_last(&self) -> usize {
        let mut missing = 1_usize;
        for (at, step) in self.steps.iter().enumerate().rev() {
            match step {
                Step::Number(_) | Step::Coordinate(_) => missing -= 1,
                Step::Add | Step::Subtract | Step::Multiply | Step::Divide | Step::Min | Step::Max => {
                    missing += 1;
                }
                _ => {}
            }
            if missing == 0 {
                return at;
            }
        }
        0
    }

    fn atom(&mut self) -> PyResult<()> {
        if self.steps.len() > MAX_STEPS {
            return Err(too_long());
        }
        if self.takes("(") {
            self.sum()?;
            return self.expect(")");
        }
        if let Some(number) = self.number() {
            self.steps.push(Step::Number(number));
            return Ok(());
        }
        let rest = self.rest();
        let length = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
        let name = &rest[..length];
        if name.is_empty() {
            return Err(self.wrong("a number, a name or a parenthesis"));
        }
        self.at += length;
        if !self.takes("(") {
            self.steps.push(match name {
                "x" => Step::Coordinate(0),
                "y" => Step::Coordinate(1),
                "z" => Step::Coordinate(2),
                "pi" => Step::Number(std::f64::consts::PI),
                "e" => Step::Number(std::f64::consts::E),
                _ => return Err(unknown("name", name, &NAMES)),
            });
            return Ok(());
        }
        self.call(name)
    }

    /// A function's arguments, after its parenthesis.
    fn call(&mut self, name: &str) -> PyResult<()> {
        if !FUNCTIONS.contains(&name) {
            return Err(unknown("function", name, &FUNCTIONS));
        }
        let first = self.steps.len();
        let mut count = 0_usize;
        loop {
            self.sum()?;
            count += 1;
            match name {
                "min" if count > 1 => self.steps.push(Step::Min),
                "max" if count > 1 => self.steps.push(Step::Max),
                "length" => {
                    self.steps.push(Step::Power(2));
                    if count > 1 {
                        self.steps.push(Step::Add);
                    }
                }
                _ => {}
            }
            if !self.takes(",") {
                break;
            }
        }
        self.expect(")")?;
        let takes_many = matches!(name, "min" | "max" | "length");
        if takes_many != (count > 1) {
            let expected = if takes_many { "two or more" } else { "one" };
            return Err(invalid(format!(
                "expression \"{}\": {name} has {count} arguments (expected {expected})",
                self.text
            )));
        }
        // A tangent has its argument twice, so that those in each other grow fast.
        if self.steps.len() > MAX_STEPS {
            return Err(too_long());
        }
        match name {
            "sqrt" | "length" => self.steps.push(Step::Sqrt),
            "abs" => self.steps.push(Step::Abs),
            "sin" => self.steps.push(Step::Sin),
            "cos" => self.steps.push(Step::Cos),
            "exp" => self.steps.push(Step::Exp),
            "tan" => {
                let argument = self.steps[first..].to_vec();
                self.steps.push(Step::Sin);
                self.steps.extend(argument);
                self.steps.extend([Step::Cos, Step::Divide]);
            }
            _ => {}
        }
        Ok(())
    }

    fn number(&mut self) -> Option<f64> {
        let rest = self.rest();
        if !rest.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
            return None;
        }
        let bytes = rest.as_bytes();
        let mut end = 0;
        while end < bytes.len() {
            let is_sign =
                matches!(bytes[end], b'+' | b'-') && end > 0 && matches!(bytes[end - 1], b'e' | b'E');
            let is_exponent = matches!(bytes[end], b'e' | b'E')
                && bytes.get(end + 1).is_some_and(|c| c.is_ascii_digit() || matches!(c, b'+' | b'-'));
            if !(bytes[end].is_ascii_digit() || bytes[end] == b'.' || is_sign || is_exponent) {
                break;
            }
            end += 1;
        }
        let number = rest[..end].parse().ok()?;
        self.at += end;
        Some(number)
    }
}

/// The surface where an expression is zero, within a box.
///
/// # Errors
/// What is wrong with the expression, or with the box.
pub(crate) fn surface(text: &str, bounds: Aabb) -> PyResult<ImplicitSurface> {
    let expression = Expression::parse(text)?;
    ImplicitSurface::new(bounds, move |p| expression.at(p)).map_err(invalid)
}
