//! An explanation in any format: sections of quantities, tables and sentences.

use std::collections::BTreeSet;

use lumbre::math::glam::DMat4;
use lumbre::{DVec3, Ray};

use super::equation;
use super::figure::{Figure, Marked};
use super::formula::{PutIn, Scope};
use super::numbers::{exact, short};

/// A section of an explanation.
#[derive(Clone, Debug, Default)]
pub(super) struct Section {
    /// Its key for programs.
    pub(super) key: String,
    /// Its heading.
    pub(super) title: String,
    pub(super) items: Vec<Item>,
    pub(super) sections: Vec<Section>,
    /// Which symbols here and below are marked in the figure.
    pub(super) marked: Marked,
}

/// One item of a section.
#[derive(Clone, Debug)]
pub(super) enum Item {
    Quantity(Quantity),
    /// A sentence.
    Text(String),
    /// An important remark.
    Remark(String),
    /// Rows of one kind, with a key for programs.
    Table {
        key: &'static str,
        columns: Vec<Column>,
        rows: Vec<Vec<Value>>,
    },
    /// Drawings.
    Figure(Box<Figure>),
}

/// A column of a table.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) key: &'static str,
    pub(super) title: String,
}

/// A number with its name and its derivation.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    /// The name in formulas; empty if `label` is enough.
    pub(super) symbol: String,
    /// The description in words; may be empty.
    pub(super) label: String,
    /// The formula; may be empty.
    pub(super) formula: String,
    /// The formula with its numbers, if any.
    pub(super) numbers: Option<PutIn>,
    pub(super) value: Value,
    /// Whether digits of the value are left out.
    pub(super) is_rounded: bool,
    pub(super) schoolbook: Option<Textbook>,
}

/// The textbook's formula, with its numbers if any, and its result.
#[derive(Clone, Debug)]
pub(super) struct Textbook {
    pub(super) formula: String,
    /// The sign before the result.
    pub(super) sign: &'static str,
    pub(super) value: Value,
}

/// The value of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Number(f64),
    /// In single precision, like light.
    Single(f32),
    Vector(DVec3),
    /// Red, green and blue.
    Colour([f32; 3]),
    Numbers(Vec<f64>),
    /// Intervals, each with its first and last number.
    Intervals(Vec<[f64; 2]>),
    Matrix(Box<DMat4>),
    Text(String),
}

impl From<f64> for Value {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl From<f32> for Value {
    fn from(x: f32) -> Self {
        Self::Single(x)
    }
}

impl From<DVec3> for Value {
    fn from(v: DVec3) -> Self {
        Self::Vector(v)
    }
}

impl From<lumbre::shading::Spectrum> for Value {
    fn from(light: lumbre::shading::Spectrum) -> Self {
        Self::Colour(light.to_array())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<DMat4> for Value {
    fn from(m: DMat4) -> Self {
        Self::Matrix(Box::new(m))
    }
}

impl Value {
    fn written(&self, write: impl Fn(f64) -> String + Copy) -> String {
        let list = |numbers: &[f64]| numbers.iter().map(|x| write(*x)).collect::<Vec<_>>().join(", ");
        match self {
            Self::Number(x) => write(*x),
            Self::Single(x) => single(*x),
            Self::Vector(v) => format!("({})", list(&v.to_array())),
            Self::Colour([r, g, b]) if r == g && g == b => single(*r),
            Self::Colour(rgb) => format!("({})", rgb.map(single).join(", ")),
            Self::Numbers(numbers) => list(numbers),
            Self::Intervals(intervals) if intervals.is_empty() => "∅".to_owned(),
            Self::Intervals(intervals) => {
                let one = |[from, to]: &[f64; 2]| format!("[{}, {}]", write(*from), write(*to));
                intervals.iter().map(one).collect::<Vec<_>>().join(" ∪ ")
            }
            Self::Matrix(m) => {
                let rows = m.transpose().to_cols_array_2d();
                format!(
                    "[{}]",
                    rows.iter().map(|row| format!("[{}]", list(row))).collect::<Vec<_>>().join(", ")
                )
            }
            Self::Text(text) => text.clone(),
        }
    }

    /// In full.
    pub(super) fn in_full(&self) -> String {
        self.written(exact)
    }

    /// With six digits, for formulas.
    pub(super) fn in_short(&self) -> String {
        self.written(short)
    }

    /// The rows of a matrix, in full.
    pub(super) fn rows(&self) -> Option<[[String; 4]; 4]> {
        self.rows_written(exact)
    }

    /// The rows of a matrix, with six digits.
    pub(super) fn short_rows(&self) -> Option<[[String; 4]; 4]> {
        self.rows_written(short)
    }

    fn rows_written(&self, write: impl Fn(f64) -> String + Copy) -> Option<[[String; 4]; 4]> {
        match self {
            Self::Matrix(m) => Some(m.transpose().to_cols_array_2d().map(|row| row.map(write))),
            _ => None,
        }
    }
}

fn single(x: f32) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".to_owned()
    } else if size.is_finite() && !(1e-5..1e9).contains(&size) {
        format!("{x:e}")
    } else if x.is_finite() {
        format!("{x}")
    } else {
        exact(f64::from(x))
    }
}

impl Scope {
    /// Sets the value of a symbol for the following formulas.
    pub(super) fn set(&mut self, symbol: &str, value: &Value) {
        let written = value.in_short();
        let is_rounded = written != value.in_full();
        self.put(symbol, written, is_rounded);
    }

    /// Sets the symbols of a ray's origin and direction.
    pub(super) fn set_ray(&mut self, [origin, direction]: [&str; 2], ray: &Ray) {
        self.set(origin, &Value::from(ray.origin));
        self.set(direction, &Value::from(ray.direction));
    }
}

impl Quantity {
    /// The parts of `symbol = formula = numbers = value` except the last, each with the sign that follows it; parts may
    /// be missing. What does not hold to the last digit is nearly equal.
    pub(super) fn chain(&self) -> Vec<(&str, &'static str)> {
        let Self { symbol, formula, numbers, .. } = self;
        let mut parts: Vec<(&str, &'static str)> = Vec::new();
        if !symbol.is_empty() {
            parts.push((symbol, "="));
        }
        if !formula.is_empty() && formula != symbol {
            parts.push((formula, "="));
        }
        if let Some(numbers) = numbers {
            if let Some(last) = parts.last_mut() {
                last.1 = numbers.sign_before();
            }
            parts.push((&numbers.written, numbers.sign_after()));
        }
        if let Some(last) = parts.last_mut().filter(|_| self.is_rounded) {
            last.1 = "≈";
        }
        parts
    }
}

impl Section {
    pub(super) fn new(key: impl Into<String>, title: impl Into<String>) -> Self {
        Self {
            key: key.into(),
            title: title.into(),
            items: Vec::new(),
            sections: Vec::new(),
            marked: Vec::new(),
        }
    }

    /// Adds the keys of this section and of those below it.
    pub(super) fn collect_keys<'a>(&'a self, keys: &mut BTreeSet<&'a str>) {
        keys.insert(&self.key);
        self.sections.iter().for_each(|section| section.collect_keys(keys));
    }

    /// This section if it has one of these keys, otherwise its subsections that do.
    pub(super) fn with_keys(self, keys: &[String]) -> Vec<Self> {
        if keys.contains(&self.key) {
            return vec![self];
        }
        self.sections.into_iter().flat_map(|section| section.with_keys(keys)).collect()
    }

    /// Adds a fact.
    pub(super) fn fact(&mut self, label: impl Into<String>, value: impl Into<Value>) {
        self.items.push(Item::Quantity(Quantity {
            symbol: String::new(),
            label: label.into(),
            formula: String::new(),
            numbers: None,
            value: value.into(),
            is_rounded: false,
            schoolbook: None,
        }));
    }

    /// Adds a quantity with its formula and the numbers in it, and sets its symbol for the following formulas.
    pub(super) fn quantity(
        &mut self,
        scope: &mut Scope,
        symbol: &str,
        label: &str,
        formula: &str,
        value: impl Into<Value>,
    ) {
        let value = value.into();
        self.items.push(Item::Quantity(Quantity {
            symbol: symbol.to_owned(),
            label: label.to_owned(),
            formula: formula.to_owned(),
            numbers: numbers(scope, formula, &value),
            value: value.clone(),
            is_rounded: false,
            schoolbook: None,
        }));
        scope.set(symbol, &value);
    }

    pub(super) fn text(&mut self, text: impl Into<String>) {
        self.items.push(Item::Text(text.into()));
    }

    pub(super) fn remark(&mut self, text: impl Into<String>) {
        self.items.push(Item::Remark(text.into()));
    }
}

/// The numbers in a formula, if they say more than its result.
pub(super) fn numbers(scope: &Scope, formula: &str, value: &Value) -> Option<PutIn> {
    let result = value.in_full();
    let mut numbers = scope.put_in(formula).filter(|numbers| numbers.written != result)?;
    let is_light = matches!(value, Value::Single(_) | Value::Colour(_));
    numbers.is_exact = equation::holds(&numbers.written, &result, is_light).unwrap_or(true);
    Some(numbers)
}
