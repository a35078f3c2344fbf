//! Expressions: numbers, vectors, colours and texts.

use std::rc::Rc;

use lumbre_shading::pov::SplineKind;
use lumbre_shading::pov::function::{Binary, Unary};

use super::functions::NATIVE_PARAMETERS;
use super::lexer::{GREATER_OR_EQUAL, Kind, LESS_OR_EQUAL, NOT_EQUAL, unescaped};
use super::value::{Array, Num, Value};
use super::words::is_reserved;
use super::{Parser, Result};
use crate::diagnostic::quoted;
use crate::{Diagnostic, FormatError};

impl Parser<'_, '_> {
    /// A number.
    pub(super) fn float(&mut self) -> Result<f64> {
        let num = self.expression()?;
        self.as_float(&num)
    }

    /// A number that something is counted by.
    pub(super) fn whole(&mut self, low: f64, high: f64) -> Result<u32> {
        let x = self.float()?;
        Ok(x.trunc().clamp(low, high) as u32)
    }

    /// A vector of three components; a number stands for all.
    pub(super) fn vector(&mut self) -> Result<lumbre_math::DVec3> {
        let num = self.expression()?;
        if num.v.iter().all(|x| x.is_finite()) {
            return Ok(num.dvec3());
        }
        Err(self.error("a vector that is not finite"))
    }

    /// A finite number.
    pub(super) fn finite(&mut self) -> Result<f64> {
        let x = self.float()?;
        if x.is_finite() { Ok(x) } else { Err(self.error("a number that is not finite")) }
    }

    /// A colour: a vector by position, a number as grey.
    pub(super) fn colour(&mut self) -> Result<Num> {
        let num = self.expression()?;
        let num = if num.n == 1 { Num::colour([num.v[0], num.v[0], num.v[0], 0.0, 0.0]) } else { num };
        let mut v = num.v;
        // What follows replaces a component.
        while let Some(word) = self.word_if_same_statement()? {
            let Some(i) = component(&word).filter(|_| word.len() > 1 && &*word != "gray" && &*word != "grey")
            else {
                break;
            };
            self.peeked = None;
            v[i] = self.float()?;
        }
        Ok(Num::colour(v))
    }

    fn word_if_same_statement(&mut self) -> Result<Option<Rc<str>>> {
        if self.ends_here()? { Ok(None) } else { self.word() }
    }

    pub(super) fn as_float(&self, num: &Num) -> Result<f64> {
        if num.n == 1 || num.is_colour && num.v[1..] == [0.0; 4] {
            return Ok(num.v[0]);
        }
        let found = Value::Num(*num).name();
        Err(self.diagnostic(Diagnostic::error("a number is needed").found(found)).into())
    }

    /// An expression without comparisons.
    pub(super) fn expression(&mut self) -> Result<Num> {
        self.depth += 1;
        let checked = self.budget.nesting(self.depth, "expressions");
        let result =
            checked.map_err(|e| FormatError::from(e).or_at(|| self.place())).and_then(|()| self.sum());
        self.depth -= 1;
        result
    }

    fn operator(&mut self, marks: &[u8]) -> Result<Option<u8>> {
        if self.ends_here()? {
            return Ok(None);
        }
        match self.peek()? {
            Some(Kind::Mark(mark)) if marks.contains(mark) => {
                let mark = *mark;
                self.peeked = None;
                Ok(Some(mark))
            }
            _ => Ok(None),
        }
    }

    fn sum(&mut self) -> Result<Num> {
        let mut left = self.product()?;
        while let Some(mark) = self.operator(b"+-")? {
            let right = self.product()?;
            left = left.with(&right, |a, b| if mark == b'+' { a + b } else { a - b });
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Num> {
        let mut left = self.unary()?;
        while let Some(mark) = self.operator(b"*/")? {
            let right = self.unary()?;
            if mark == b'/' && right.n == 1 && right.v[0] == 0.0 {
                self.warn("a division by zero");
            }
            left = left.with(&right, |a, b| if mark == b'*' { a * b } else { a / b });
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<Num> {
        match self.operator(b"+-!")? {
            None => self.primary(),
            Some(mark) => {
                self.depth += 1;
                self.budget.nesting(self.depth, "expressions")?;
                let value = self.unary()?;
                self.depth -= 1;
                Ok(match mark {
                    b'-' => Num { v: value.v.map(|x| -x), ..value },
                    b'!' => Num::float(Unary::Not.of(value.v[0])),
                    _ => value,
                })
            }
        }
    }

    /// An expression in parentheses: with comparisons, logic and choices.
    pub(super) fn full_expression(&mut self) -> Result<Num> {
        let condition = self.logic()?;
        if self.operator(b"?")?.is_none() {
            return Ok(condition);
        }
        let yes = self.full_expression()?;
        self.expect(b':')?;
        let no = self.full_expression()?;
        Ok(if condition.v[0].abs() >= 1e-10 { yes } else { no })
    }

    fn logic(&mut self) -> Result<Num> {
        let mut left = self.comparison()?;
        // Both have one rank.
        while let Some(mark) = self.operator(b"&|")? {
            let right = self.comparison()?;
            let of = if mark == b'&' { Binary::And } else { Binary::Or };
            left = Num::float(of.of(left.v[0], right.v[0]));
        }
        Ok(left)
    }

    fn comparison(&mut self) -> Result<Num> {
        let mut left = if let Some(order) = self.text_comparison()? { order } else { self.expression()? };
        while let Some(mark) =
            self.operator(&[b'<', b'>', b'=', LESS_OR_EQUAL, GREATER_OR_EQUAL, NOT_EQUAL])?
        {
            let right = self.expression()?;
            let of = match mark {
                b'<' => Binary::Less,
                b'>' => Binary::Greater,
                b'=' => Binary::Equal,
                LESS_OR_EQUAL => Binary::LessOrEqual,
                GREATER_OR_EQUAL => Binary::GreaterOrEqual,
                _ => Binary::NotEqual,
            };
            let n = left.n.max(right.n);
            let (a, b) = (left.promoted(n), right.promoted(n));
            // Vectors are equal where all components are.
            let all = (0..n).all(|i| of.of(a[i], b[i]) == 1.0);
            let any = (0..n).any(|i| of.of(a[i], b[i]) == 1.0);
            left = Num::float(f64::from(u8::from(if mark == NOT_EQUAL { any } else { all })));
        }
        Ok(left)
    }

    /// A comparison of texts.
    fn text_comparison(&mut self) -> Result<Option<Num>> {
        if !self.is_text()? {
            return Ok(None);
        }
        let left = self.string()?;
        let Some(mark) = self.operator(&[b'<', b'>', b'=', LESS_OR_EQUAL, GREATER_OR_EQUAL, NOT_EQUAL])?
        else {
            return Err(self.unexpected("a comparison of texts"));
        };
        let right = self.string()?;
        let is = match mark {
            b'<' => left < right,
            b'>' => left > right,
            b'=' => left == right,
            LESS_OR_EQUAL => left <= right,
            GREATER_OR_EQUAL => left >= right,
            _ => left != right,
        };
        Ok(Some(Num::float(f64::from(u8::from(is)))))
    }

    fn primary(&mut self) -> Result<Num> {
        let value = match self.peek()? {
            Some(Kind::Number(x)) => {
                let x = *x;
                self.peeked = None;
                Num::float(x)
            }
            Some(Kind::Mark(b'(')) => {
                self.peeked = None;
                self.depth += 1;
                self.budget.nesting(self.depth, "expressions")?;
                let value = self.full_expression()?;
                self.depth -= 1;
                self.expect(b')')?;
                value
            }
            Some(Kind::Mark(b'<')) => self.vector_literal()?,
            Some(Kind::Word(word)) => {
                let word = Rc::clone(word);
                self.named(&word)?
            }
            _ => return Err(self.unexpected("a number, a vector or a colour")),
        };
        self.components(value)
    }

    /// `.x` and the like behind a value.
    fn components(&mut self, mut value: Num) -> Result<Num> {
        while self.operator(b".")?.is_some() {
            let Some(word) = self.word()? else { return Err(self.unexpected("a component")) };
            self.peeked = None;
            if matches!(&*word, "gray" | "grey") {
                value = Num::float(0.297 * value.v[0] + 0.589 * value.v[1] + 0.114 * value.v[2]);
                continue;
            }
            let Some(i) = component(&word) else {
                return Err(self.error("no component of a vector or a colour"));
            };
            value = Num::float(value.promoted(5)[i]);
        }
        Ok(value)
    }

    fn vector_literal(&mut self) -> Result<Num> {
        self.expect(b'<')?;
        let mut v = [0.0; 5];
        let mut n = 0;
        loop {
            let component = self.expression()?;
            if n == 5 {
                return Err(self.error("a vector of more than five components"));
            }
            v[n] = self.as_float(&component)?;
            n += 1;
            self.comma()?;
            if self.take(b'>')? {
                break;
            }
        }
        if n < 2 {
            return Err(self.error("a vector of fewer than two components"));
        }
        Ok(Num { v, n, is_colour: false })
    }

    /// What a word stands for in an expression.
    fn named(&mut self, word: &Rc<str>) -> Result<Num> {
        if let Some(value) = self.constant(word) {
            self.peeked = None;
            return Ok(value);
        }
        if let Some(channels) = colour_word(word) {
            self.peeked = None;
            return self.colour_after(word, channels);
        }
        if is_reserved(word) {
            if let Some(i) = component(word).filter(|_| word.len() > 1) {
                // `red 0.5 green 0.2`: a colour by its components.
                self.peeked = None;
                let mut v = [0.0; 5];
                v[i] = self.float()?;
                while let Some(next) = self.word_if_same_statement()? {
                    let Some(i) = component(&next).filter(|_| next.len() > 1) else { break };
                    self.peeked = None;
                    v[i] = self.float()?;
                }
                return Ok(Num::colour(v));
            }
            self.peeked = None;
            return self.built_in(word);
        }
        let Some(cell) = self.lookup(word).cloned() else { return Err(self.undeclared(word)) };
        let value = cell.borrow().clone();
        self.peeked = None;
        let value = self.indexed(value)?;
        match value {
            Value::Num(num) => Ok(num),
            Value::Function(function) => {
                let arguments = self.arguments(function.parameters())?;
                let v = function.call(&arguments);
                Ok(match function.results() {
                    1 => Num::float(v[0]),
                    5 => Num::colour(v),
                    n => Num { v, n, is_colour: false },
                })
            }
            Value::Spline(spline) => {
                self.expect(b'(')?;
                let t = self.float()?;
                let kind = if self.take(b',')? { self.spline_kind()? } else { None };
                self.expect(b')')?;
                let n = spline.size();
                let v = match kind {
                    Some(kind) if kind != spline.kind() => spline.with_kind(kind).at(t),
                    _ => spline.at(t),
                };
                Ok(if n == 1 { Num::float(v[0]) } else { Num { v, n, is_colour: false } })
            }
            Value::Nothing => Err(self.undeclared(word)),
            other => {
                let wrong = Diagnostic::error(format!("{} is no number", quoted(word)));
                Err(self.diagnostic(wrong.found(other.name())).into())
            }
        }
    }

    /// The kind of a spline, if a word of one comes next.
    pub(super) fn spline_kind(&mut self) -> Result<Option<SplineKind>> {
        let kind = match self.word()?.as_deref() {
            Some("linear_spline") => SplineKind::Linear,
            Some("quadratic_spline") => SplineKind::Quadratic,
            Some("cubic_spline") => SplineKind::Cubic,
            Some("natural_spline") => SplineKind::Natural,
            _ => return Ok(None),
        };
        self.peeked = None;
        Ok(Some(kind))
    }

    /// Numbers in parentheses.
    pub(super) fn arguments(&mut self, count: usize) -> Result<Vec<f64>> {
        self.expect(b'(')?;
        let mut arguments = Vec::new();
        while !self.is_mark(b')')? {
            let value = self.expression()?;
            // A vector stands for its components.
            if count == 3 && arguments.is_empty() && value.n == 3 {
                arguments.extend_from_slice(&value.v[..3]);
            } else {
                arguments.push(self.as_float(&value)?);
            }
            self.comma()?;
        }
        self.expect(b')')?;
        // The functions of the language's own have as many as they like.
        let is_right = arguments.len() == count || (count == NATIVE_PARAMETERS && arguments.len() <= count);
        if !is_right {
            let wrong = Diagnostic::error("a function is called with a wrong number of arguments");
            return Err(self.diagnostic(wrong.found(arguments.len()).expected(count)).into());
        }
        Ok(arguments)
    }

    /// `color`, `rgb`, `rgbt` and the like.
    fn colour_after(&mut self, word: &str, channels: Channels) -> Result<Num> {
        if channels == Channels::Any {
            return self.colour();
        }
        let num = self.expression()?;
        let v = num.promoted(match channels {
            Channels::Rgb => 3,
            Channels::RgbFilter | Channels::RgbTransmit => 4,
            _ => 5,
        });
        let v = match channels {
            Channels::Rgb => [v[0], v[1], v[2], v[3], v[4]],
            Channels::RgbFilter => [v[0], v[1], v[2], v[3], 0.0],
            Channels::RgbTransmit if num.is_colour => v,
            Channels::RgbTransmit => [v[0], v[1], v[2], 0.0, v[3]],
            _ => v,
        };
        let v = if word.starts_with('s') { self.settings.from_srgb(v) } else { v };
        Ok(Num::colour(v))
    }

    pub(super) fn undeclared(&self, name: &str) -> FormatError {
        let known = self.globals.keys().map(|key| &**key);
        let wrong =
            Diagnostic::error("an identifier that is not declared").found(quoted(name)).suggest(name, known);
        self.diagnostic(wrong).into()
    }

    pub(super) fn reserved(&self, name: &str) -> FormatError {
        let wrong = Diagnostic::error("a word of the language cannot be declared").found(quoted(name));
        self.diagnostic(wrong).into()
    }

    /// What a name stands for, whose word was taken: of an array or a dictionary, the element that follows.
    pub(super) fn known(&mut self, name: &str) -> Result<Option<Value>> {
        let Some(cell) = self.lookup(name).cloned() else { return Ok(None) };
        let value = cell.borrow().clone();
        match value {
            Value::Array(_) | Value::Dictionary(_) => self.indexed(value).map(Some),
            _ => Ok(Some(value)),
        }
    }

    /// Elements of arrays and dictionaries behind a value.
    pub(super) fn indexed(&mut self, mut value: Value) -> Result<Value> {
        loop {
            match &value {
                Value::Array(array) if !self.ends_here()? && self.is_mark(b'[')? => {
                    let array = Rc::clone(array);
                    match self.element(&array)? {
                        Some(Value::Nothing) | None => {
                            return Err(self.error("an element of an array that has no value yet"));
                        }
                        Some(element) => value = element,
                    }
                }
                Value::Dictionary(entries)
                    if !self.ends_here()? && (self.is_mark(b'.')? || self.is_mark(b'[')?) =>
                {
                    let entries = Rc::clone(entries);
                    let key: Rc<str> = if self.take(b'.')? {
                        let Some(key) = self.word()? else { return Err(self.unexpected("a key")) };
                        self.peeked = None;
                        key
                    } else {
                        self.expect(b'[')?;
                        let key = self.string()?.into();
                        self.expect(b']')?;
                        key
                    };
                    match entries.get(&key) {
                        Some(entry) => value = entry.clone(),
                        None => return Err(self.error(format!("the dictionary has no key {}", quoted(&key)))),
                    }
                }
                _ => return Ok(value),
            }
        }
    }

    /// The element of an array by the indices that come next; fewer than it has dimensions give a part of it.
    pub(super) fn element(&mut self, array: &Rc<Array>) -> Result<Option<Value>> {
        let (offset, taken) = self.indices(array)?;
        if taken == array.sizes.len() {
            return Ok(array.elements.get(offset).cloned());
        }
        let sizes = array.sizes[taken..].to_vec();
        let length: usize = sizes.iter().product();
        let elements = array.elements.get(offset..offset + length).unwrap_or(&[]).to_vec();
        Ok(Some(Value::Array(Rc::new(Array { sizes, elements }))))
    }

    /// The position of one element.
    pub(super) fn index(&mut self, array: &Rc<Array>) -> Result<usize> {
        let (offset, taken) = self.indices(array)?;
        if taken == array.sizes.len() {
            return Ok(offset);
        }
        let wrong = Diagnostic::error("an array has more dimensions than that");
        Err(self.diagnostic(wrong.found(taken).expected(array.sizes.len())).into())
    }

    fn indices(&mut self, array: &Array) -> Result<(usize, usize)> {
        let mut offset = 0;
        let mut taken = 0;
        while taken < array.sizes.len() && (taken == 0 || !self.ends_here()?) && self.take(b'[')? {
            let index = self.float()?;
            self.expect(b']')?;
            let size = array.sizes[taken];
            // As an integer is made of a number: towards zero.
            let whole = (index + 1e-6 * index.signum()).trunc();
            if !(0.0..size as f64).contains(&whole) {
                let wrong = Diagnostic::error("an index that the array does not have");
                return Err(self
                    .diagnostic(wrong.found(index).expected(format!("0 to {}", size.saturating_sub(1))))
                    .into());
            }
            let rest: usize = array.sizes[taken + 1..].iter().product();
            offset += whole as usize * rest;
            taken += 1;
        }
        Ok((offset, taken))
    }

    /// Whether a text comes next.
    pub(super) fn is_text(&mut self) -> Result<bool> {
        Ok(match self.peek()? {
            Some(Kind::Text(_)) => true,
            Some(Kind::Word(word)) => {
                let word = Rc::clone(word);
                match &*word {
                    "concat" | "chr" | "str" | "strlwr" | "strupr" | "substr" | "vstr" | "datetime"
                    | "input_file_name" => true,
                    _ => self.lookup(&word).is_some_and(|cell| match &*cell.borrow() {
                        Value::Text(_) => true,
                        Value::Array(array) => {
                            matches!(array.elements.first(), Some(Value::Text(_)))
                                && self.raw_ahead(0) == Some(&Kind::Mark(b'['))
                        }
                        _ => false,
                    }),
                }
            }
            _ => false,
        })
    }

    /// A text.
    pub(super) fn string(&mut self) -> Result<String> {
        self.text_of(true)
    }

    /// The name of a file, in which a backslash is a backslash.
    pub(super) fn file_name(&mut self) -> Result<String> {
        Ok(self.text_of(false)?.replace('\\', "/"))
    }

    fn text_of(&mut self, has_escapes: bool) -> Result<String> {
        match self.peek()? {
            Some(Kind::Text(text)) => {
                let text = Rc::clone(text);
                self.peeked = None;
                Ok(if has_escapes { unescaped(&text) } else { text.to_string() })
            }
            Some(Kind::Word(word)) => {
                let word = Rc::clone(word);
                if is_reserved(&word) {
                    self.peeked = None;
                    return self.built_in_text(&word);
                }
                let Some(cell) = self.lookup(&word).cloned() else { return Err(self.undeclared(&word)) };
                self.peeked = None;
                let value = cell.borrow().clone();
                match self.indexed(value)? {
                    Value::Text(text) => Ok(text.to_string()),
                    other => {
                        let wrong = Diagnostic::error("a text is needed").found(other.name());
                        Err(self.diagnostic(wrong).into())
                    }
                }
            }
            _ => Err(self.unexpected("a text")),
        }
    }
}

/// The number of a component.
fn component(word: &str) -> Option<usize> {
    Some(match word {
        "x" | "u" | "red" => 0,
        "y" | "v" | "green" => 1,
        "z" | "blue" => 2,
        "t" | "filter" => 3,
        "transmit" => 4,
        _ => return None,
    })
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Channels {
    Any,
    Rgb,
    RgbFilter,
    RgbTransmit,
    All,
}

fn colour_word(word: &str) -> Option<Channels> {
    Some(match word {
        "color" | "colour" => Channels::Any,
        "rgb" | "srgb" => Channels::Rgb,
        "rgbf" | "srgbf" => Channels::RgbFilter,
        "rgbt" | "srgbt" => Channels::RgbTransmit,
        "rgbft" | "srgbft" => Channels::All,
        _ => return None,
    })
}

/// Whether a word begins a colour.
pub(super) fn begins_colour(word: &str) -> bool {
    colour_word(word).is_some() || matches!(word, "red" | "green" | "blue" | "filter" | "transmit")
}
