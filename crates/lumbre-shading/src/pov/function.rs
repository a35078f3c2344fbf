//! Functions of a scene, compiled to a flat list of operations on registers.

use std::sync::Arc;

use lumbre_math::{DVec3, Elementary, Transform};
use smallvec::SmallVec;

use super::natives;
use super::spline::Spline;
use super::{Eye, Pattern, Pigment};

/// A function of numbers, with up to five results.
#[derive(Clone, Debug)]
pub enum Function {
    /// An expression.
    Code(Code),
    /// The values of a pattern in x, y, z.
    Pattern(Pattern),
    /// The colours of a pigment in x, y, z.
    Pigment(Arc<Pigment>),
    /// A transform of x, y, z.
    Transform(Arc<Transform>),
    /// A spline of one number.
    Spline(Arc<Spline>),
}

impl Function {
    /// How many numbers it takes.
    pub fn parameters(&self) -> usize {
        match self {
            Self::Code(code) => code.parameters,
            Self::Pattern(_) | Self::Pigment(_) | Self::Transform(_) => 3,
            Self::Spline(_) => 1,
        }
    }

    /// How many numbers it gives.
    pub fn results(&self) -> usize {
        match self {
            Self::Code(_) | Self::Pattern(_) => 1,
            Self::Pigment(_) => 5,
            Self::Transform(_) => 3,
            Self::Spline(spline) => spline.size(),
        }
    }

    /// Its first result. Arguments that are missing count as 0.
    pub fn value(&self, arguments: &[f64]) -> f64 {
        match self {
            Self::Code(code) => code.value(arguments),
            _ => self.call(arguments)[0],
        }
    }

    /// Its results, 0 where it has fewer.
    pub fn call(&self, arguments: &[f64]) -> [f64; 5] {
        let at = |i: usize| arguments.get(i).copied().unwrap_or(0.0);
        let point = || DVec3::new(at(0), at(1), at(2));
        match self {
            Self::Code(code) => [code.value(arguments), 0.0, 0.0, 0.0, 0.0],
            Self::Pattern(pattern) => {
                let p = pattern.point(point());
                [pattern.value(p, &Eye::NOWHERE), 0.0, 0.0, 0.0, 0.0]
            }
            Self::Pigment(pigment) => pigment.colour(point(), &Eye::NOWHERE).to_array().map(f64::from),
            Self::Transform(map) => {
                let p = map.point(point());
                [p.x, p.y, p.z, 0.0, 0.0]
            }
            Self::Spline(spline) => spline.at(at(0)),
        }
    }
}

/// The number of an operation, whose result it is.
pub type Register = u32;

/// An expression as a list of operations, which may use earlier results.
#[derive(Clone, Debug)]
pub struct Code {
    /// How many arguments it has.
    pub parameters: usize,
    /// The operations, at least one; the result is that of the last.
    pub operations: Vec<Operation>,
}

/// An operation.
#[derive(Clone, Debug)]
pub enum Operation {
    /// A number.
    Number(f64),
    /// An argument.
    Argument(usize),
    /// A function of one number.
    Unary(Unary, Register),
    /// A function of two numbers.
    Binary(Binary, Register, Register),
    /// By the sign of the first: the second if it is negative, the third if it is zero, the fourth if it is positive.
    Select([Register; 4]),
    /// A component of what another function gives.
    Call {
        /// The function.
        function: Arc<Function>,
        /// Its arguments.
        arguments: Box<[Register]>,
        /// Which of its results.
        component: usize,
    },
    /// A function of [`natives`].
    Native(u32, Box<[Register]>),
    /// A sum or a product over whole numbers.
    Repeat {
        /// Whether it is a product.
        is_product: bool,
        /// The first number.
        from: Register,
        /// The last number.
        to: Register,
        /// What is added or multiplied: a function of the arguments around it and the number.
        body: Arc<Code>,
    },
}

/// Functions of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "their names in the scene language")]
pub enum Unary {
    Negate,
    Not,
    Abs,
    Acos,
    Acosh,
    Asin,
    Asinh,
    Atan,
    Atanh,
    Ceil,
    Cos,
    Cosh,
    Degrees,
    Exp,
    Floor,
    Int,
    Ln,
    Log,
    Radians,
    Sin,
    Sinh,
    Sqrt,
    Tan,
    Tanh,
}

/// Functions of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "their names in the scene language")]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    NotEqual,
    And,
    Or,
    Atan2,
    Div,
    Mod,
    Pow,
    Min,
    Max,
    BitwiseAnd,
    BitwiseOr,
    BitwiseXor,
}

/// Below this a number counts as false, and two as equal.
pub const EPSILON: f64 = 1e-10;

impl Unary {
    /// The function of a name in the scene language.
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "abs" => Self::Abs,
            "acos" => Self::Acos,
            "acosh" => Self::Acosh,
            "asin" => Self::Asin,
            "asinh" => Self::Asinh,
            "atan" => Self::Atan,
            "atanh" => Self::Atanh,
            "ceil" => Self::Ceil,
            "cos" => Self::Cos,
            "cosh" => Self::Cosh,
            "degrees" => Self::Degrees,
            "exp" => Self::Exp,
            "floor" => Self::Floor,
            "int" => Self::Int,
            "ln" => Self::Ln,
            "log" => Self::Log,
            "radians" => Self::Radians,
            "sin" => Self::Sin,
            "sinh" => Self::Sinh,
            "sqrt" => Self::Sqrt,
            "tan" => Self::Tan,
            "tanh" => Self::Tanh,
            _ => return None,
        })
    }

    /// Its value.
    pub fn of(self, x: f64) -> f64 {
        match self {
            Self::Negate => -x,
            Self::Not => truth(x.abs() < EPSILON),
            Self::Abs => x.abs(),
            Self::Acos => x.arc_cosine(),
            Self::Acosh => (x + ((x - 1.0) * (x + 1.0)).sqrt()).logarithm(),
            Self::Asin => x.arc_sine(),
            Self::Asinh => x.inverse_hyperbolic_sine(),
            Self::Atan => x.arc_tangent(),
            Self::Atanh => 0.5 * ((1.0 + x) / (1.0 - x)).logarithm(),
            Self::Ceil => x.ceil(),
            Self::Cos => x.cosine(),
            Self::Cosh => 0.5 * (x.exponential() + (-x).exponential()),
            Self::Degrees => x.to_degrees(),
            Self::Exp => x.exponential(),
            Self::Floor => x.floor(),
            Self::Int => x.trunc(),
            Self::Ln => x.logarithm(),
            Self::Log => x.logarithm_10(),
            Self::Radians => x.to_radians(),
            Self::Sin => x.sine(),
            Self::Sinh => 0.5 * (x.exponential() - (-x).exponential()),
            Self::Sqrt => x.sqrt(),
            Self::Tan => x.tangent(),
            Self::Tanh => x.hyperbolic_tangent(),
        }
    }
}

impl Binary {
    /// The function of two numbers of a name in the scene language.
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "atan2" => Self::Atan2,
            "div" => Self::Div,
            "mod" => Self::Mod,
            "pow" => Self::Pow,
            "min" => Self::Min,
            "max" => Self::Max,
            "bitwise_and" => Self::BitwiseAnd,
            "bitwise_or" => Self::BitwiseOr,
            "bitwise_xor" => Self::BitwiseXor,
            _ => return None,
        })
    }

    /// Its value.
    pub fn of(self, a: f64, b: f64) -> f64 {
        let is_true = |x: f64| x.abs() >= EPSILON;
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Less => truth(a < b),
            Self::LessOrEqual => truth(a <= b + EPSILON),
            Self::Greater => truth(a > b),
            Self::GreaterOrEqual => truth(a + EPSILON >= b),
            Self::Equal => truth((a - b).abs() < EPSILON),
            Self::NotEqual => truth((a - b).abs() >= EPSILON),
            Self::And => truth(is_true(a) && is_true(b)),
            Self::Or => truth(is_true(a) || is_true(b)),
            Self::Atan2 => a.angle_from(b),
            Self::Div => (a / b).trunc(),
            Self::Mod => a % b,
            Self::Pow => power(a, b),
            Self::Min => a.min(b),
            Self::Max => a.max(b),
            Self::BitwiseAnd => ((a as i64) & (b as i64)) as f64,
            Self::BitwiseOr => ((a as i64) | (b as i64)) as f64,
            Self::BitwiseXor => ((a as i64) ^ (b as i64)) as f64,
        }
    }
}

/// A power, also of negative numbers to whole exponents.
pub fn power(a: f64, b: f64) -> f64 {
    if b == b.trunc() && b.abs() <= 64.0 { a.powi(b as i32) } else { a.power(b) }
}

fn truth(is: bool) -> f64 {
    if is { 1.0 } else { 0.0 }
}

/// A sum or a product has at most this many terms.
const MAX_TERMS: f64 = 1e5;

impl Code {
    /// An expression that is a number.
    pub fn number(value: f64) -> Self {
        Self { parameters: 0, operations: vec![Operation::Number(value)] }
    }

    /// Its value.
    pub fn value(&self, arguments: &[f64]) -> f64 {
        match self.operations.len() {
            count if count <= FEW => self.run(arguments, &mut [0.0; FEW]),
            count if count <= MANY => self.run(arguments, &mut [0.0; MANY]),
            count => self.run(arguments, &mut vec![0.0; count]),
        }
    }

    /// Its value, with at least as many registers as operations.
    fn run(&self, arguments: &[f64], registers: &mut [f64]) -> f64 {
        let mut last = 0.0;
        for (i, operation) in self.operations.iter().enumerate() {
            last = operation.value(arguments, registers);
            registers[i] = last;
        }
        last
    }
}

/// How many registers are kept without an allocation.
const FEW: usize = 16;
const MANY: usize = 64;

/// Calls a function with a list of registers.
fn with_all<R>(list: &[Register], registers: &[f64], call: impl FnOnce(&[f64]) -> R) -> R {
    let mut few = [0.0; FEW];
    if list.len() > FEW {
        return call(&list.iter().map(|&r| registers[r as usize]).collect::<Vec<f64>>());
    }
    for (place, &r) in few.iter_mut().zip(list) {
        *place = registers[r as usize];
    }
    call(&few[..list.len()])
}

impl Operation {
    fn value(&self, arguments: &[f64], registers: &[f64]) -> f64 {
        let at = |register: Register| registers[register as usize];
        match self {
            Self::Number(value) => *value,
            Self::Argument(i) => arguments.get(*i).copied().unwrap_or(0.0),
            Self::Unary(unary, x) => unary.of(at(*x)),
            Self::Binary(binary, a, b) => binary.of(at(*a), at(*b)),
            Self::Select([x, negative, zero, positive]) => {
                let x = at(*x);
                if x < -EPSILON {
                    at(*negative)
                } else if x.abs() <= EPSILON {
                    at(*zero)
                } else {
                    at(*positive)
                }
            }
            Self::Call { function, arguments, component } => {
                with_all(arguments, registers, |arguments| match (&**function, component) {
                    (Function::Code(code), 0) => code.value(arguments),
                    _ => function.call(arguments)[*component],
                })
            }
            Self::Native(index, arguments) => {
                with_all(arguments, registers, |arguments| natives::value(*index, arguments))
            }
            Self::Repeat { is_product, from, to, body } => {
                let (from, to) = (at(*from), at(*to));
                let mut inner: SmallVec<[f64; 12]> = arguments.iter().copied().collect();
                inner.push(from);
                let mut total = if *is_product { 1.0 } else { 0.0 };
                let to = to.min(from + MAX_TERMS);
                let mut i = from;
                while i <= to + EPSILON {
                    if let Some(last) = inner.last_mut() {
                        *last = i;
                    }
                    let term = body.value(&inner);
                    if *is_product {
                        total *= term;
                    } else {
                        total += term;
                    }
                    i += 1.0;
                }
                total
            }
        }
    }
}
