//! Reads the language and evaluates it as it reads: a grammar of sums, products, powers, calls, lists and names.
//!
//! ```text
//! statement = [NAME "="] sum | "help" [NAME]
//! sum       = product {("+" | "-") product}
//! product   = signed {("*" | "/") signed}
//! signed    = {"+" | "-"} [NUMBER] power, the number without a space before a name or a bracket
//! power     = primary ["^" signed]
//! primary   = NUMBER ["°"] | NAME | NAME "(" [sum {"," sum}] ")" | "(" sum ")" | "[" sum {"," sum} "]" | "|" sum "|"
//! ```

use std::collections::BTreeMap;

use lumbre::formats::diagnostic::{Diagnostic, quoted};
use lumbre::math::DVec3;
use lumbre::math::quaternion;

use crate::language::filled;

use super::functions::{self, Argument, Call};
use super::lexer::{Lexer, Token, TokenKind, Wrong};
use super::operators;
use super::steps::{Step, Work};
use super::texts::Texts;
use super::value::{Matrix, Value};

/// How deep brackets and powers may be nested: no text may exhaust the stack.
const DEEPEST: usize = 100;

/// The most values between two brackets; more than any has a use for.
const MOST: usize = 16;

/// The names that always have a value.
const CONSTANTS: [&str; 8] = ["pi", "π", "x", "y", "z", "i", "j", "k"];

/// What a statement gave.
#[derive(Debug)]
pub(super) enum Outcome {
    /// A value, after the steps that led to it; with its name where it got one.
    Value { name: Option<String>, value: Value, steps: Vec<Step> },
    /// The text of `help`.
    Help(Vec<String>),
}

/// The values that have names.
pub(super) struct Session {
    pub(super) texts: &'static Texts,
    names: BTreeMap<String, Value>,
}

impl Session {
    pub(super) fn new(texts: &'static Texts) -> Self {
        Self { texts, names: BTreeMap::new() }
    }

    /// Evaluates the statements of a text in order and hands each outcome to `show`, which may stop it.
    ///
    /// # Errors
    /// The first mistake, or what `show` returns.
    pub(super) fn run<E>(
        &mut self,
        text: &str,
        mut show: impl FnMut(Outcome) -> Result<(), E>,
    ) -> Result<Result<(), E>, Wrong> {
        let mut reader = Reader::new(text, self)?;
        loop {
            while reader.token.kind == TokenKind::Break {
                reader.advance()?;
            }
            if reader.token.kind == TokenKind::End {
                return Ok(Ok(()));
            }
            let outcome = reader.statement()?;
            if let Err(error) = show(outcome) {
                return Ok(Err(error));
            }
        }
    }
}

/// Whether a number may stand before what it multiplies, as in `2x`: after `/` and `^` that has two readings.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Coefficient {
    Allowed,
    Ambiguous,
}

struct Reader<'a> {
    session: &'a mut Session,
    lexer: Lexer<'a>,
    token: Token,
    next: Token,
    depth: usize,
    work: Work,
}

impl<'a> Reader<'a> {
    fn new(text: &'a str, session: &'a mut Session) -> Result<Self, Wrong> {
        let mut lexer = Lexer::new(text, session.texts);
        let token = lexer.next()?;
        // The second one is looked at only where it belongs to the first.
        let next = Token { kind: TokenKind::Break, offset: token.offset, is_adjacent: false };
        let work = Work::new(session.texts);
        let mut reader = Self { session, lexer, token, next, depth: 0, work };
        reader.look_ahead()?;
        Ok(reader)
    }

    /// One token of lookahead distinguishes `a = …` from `a`.
    fn look_ahead(&mut self) -> Result<(), Wrong> {
        if self.token.kind != TokenKind::End {
            self.next = self.lexer.next()?;
        }
        Ok(())
    }

    fn advance(&mut self) -> Result<Token, Wrong> {
        let next = self.next.clone();
        let taken = std::mem::replace(&mut self.token, next);
        self.look_ahead()?;
        Ok(taken)
    }

    fn is_at(&self, symbol: char) -> bool {
        self.token.kind == TokenKind::Symbol(symbol)
    }

    /// That the token here does not belong here.
    fn unexpected(&self, expected: &str) -> Wrong {
        let texts = self.session.texts;
        let found = match &self.token.kind {
            TokenKind::Number(x) => super::value::number(*x),
            TokenKind::Name(name) => quoted(name),
            TokenKind::Symbol(c) => quoted(c.encode_utf8(&mut [0; 4])),
            TokenKind::Break | TokenKind::End => texts.end.to_owned(),
        };
        let what = Diagnostic::error(texts.unexpected).found(found).expected(expected);
        Wrong::new(self.token.offset, what)
    }

    fn expect(&mut self, symbol: char, expected: &str) -> Result<(), Wrong> {
        if !self.is_at(symbol) {
            return Err(self.unexpected(expected));
        }
        self.advance().map(drop)
    }

    fn statement(&mut self) -> Result<Outcome, Wrong> {
        let texts = self.session.texts;
        let outcome = match (self.token.kind.clone(), self.next.kind.clone()) {
            (TokenKind::Name(name), TokenKind::Symbol('=')) => {
                let Token { offset, .. } = self.advance()?;
                self.advance()?;
                if functions::named(&name).is_some() || name == "ans" || name == "help" {
                    let what = Diagnostic::error(texts.name_is_taken).found(quoted(&name));
                    return Err(Wrong::new(offset, what.expected(texts.another_name)));
                }
                let value = self.sum()?;
                self.outcome(Some(name), value)
            }
            (TokenKind::Name(name), _) if name == "help" => {
                self.advance()?;
                let topic = match self.token.kind.clone() {
                    TokenKind::Name(topic) => {
                        let Token { offset, .. } = self.advance()?;
                        let unknown = || self.unknown(offset, texts.unknown_function, &topic);
                        Some(functions::find(&topic).ok_or_else(unknown)?)
                    }
                    _ => None,
                };
                Outcome::Help(functions::help(topic, texts))
            }
            _ => {
                let value = self.sum()?;
                self.outcome(None, value)
            }
        };
        match self.token.kind {
            TokenKind::Break | TokenKind::End => Ok(outcome),
            _ => Err(self.unexpected(texts.operator_or_end)),
        }
    }

    fn outcome(&mut self, name: Option<String>, value: Value) -> Outcome {
        if let Some(name) = &name {
            self.session.names.insert(name.clone(), value.clone());
        }
        self.session.names.insert("ans".to_owned(), value.clone());
        Outcome::Value { name, value, steps: std::mem::take(&mut self.work.steps) }
    }

    fn sum(&mut self) -> Result<Value, Wrong> {
        let mut left = self.product()?;
        while self.is_at('+') || self.is_at('-') {
            let sign = self.advance()?;
            let right = self.product()?;
            let is_sum = sign.kind == TokenKind::Symbol('+');
            let result = operators::add(&left, &right, is_sum, &mut self.work);
            left = self.finite(result, sign.offset)?;
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Value, Wrong> {
        let mut left = self.signed(Coefficient::Allowed)?;
        while self.is_at('*') || self.is_at('/') {
            let sign = self.advance()?;
            let is_product = sign.kind == TokenKind::Symbol('*');
            let right =
                self.signed(if is_product { Coefficient::Allowed } else { Coefficient::Ambiguous })?;
            let result = if is_product {
                operators::multiply(&left, &right, &mut self.work)
            } else {
                operators::divide(&left, &right, &mut self.work)
            };
            left = self.finite(result, sign.offset)?;
        }
        Ok(left)
    }

    fn signed(&mut self, coefficient: Coefficient) -> Result<Value, Wrong> {
        let mut is_negative = false;
        while self.is_at('+') || self.is_at('-') {
            is_negative ^= self.advance()?.kind == TokenKind::Symbol('-');
        }
        let begins_operand = matches!(self.next.kind, TokenKind::Name(_) | TokenKind::Symbol('(' | '['));
        let value = match self.token.kind {
            TokenKind::Number(factor) if begins_operand && self.next.is_adjacent => {
                if coefficient == Coefficient::Ambiguous {
                    let texts = self.session.texts;
                    let what = Diagnostic::error(texts.two_readings).expected(texts.one_reading);
                    return Err(Wrong::new(self.token.offset, what));
                }
                let Token { offset, .. } = self.advance()?;
                let value = self.power()?;
                let result = operators::multiply(&Value::Number(factor), &value, &mut self.work);
                self.finite(result, offset)?
            }
            _ => self.power()?,
        };
        Ok(if is_negative { operators::negated(&value) } else { value })
    }

    fn power(&mut self) -> Result<Value, Wrong> {
        self.depth += 1;
        if self.depth > DEEPEST {
            let what = Diagnostic::error(self.session.texts.too_deep);
            let expected = filled(self.session.texts.at_most, &[&DEEPEST.to_string()]);
            return Err(Wrong::new(self.token.offset, what.expected(expected)));
        }
        let mut base = self.primary()?;
        if self.is_at('^') {
            let sign = self.advance()?;
            let exponent = self.signed(Coefficient::Ambiguous)?;
            let result = operators::power(&base, &exponent, &mut self.work);
            base = self.finite(result, sign.offset)?;
        }
        self.depth -= 1;
        Ok(base)
    }

    fn primary(&mut self) -> Result<Value, Wrong> {
        let texts = self.session.texts;
        match self.token.kind.clone() {
            TokenKind::Number(x) => {
                self.advance()?;
                // Angles are in degrees anyway.
                if self.is_at('°') {
                    self.advance()?;
                }
                Ok(Value::Number(x))
            }
            TokenKind::Name(name) => {
                let Token { offset, .. } = self.advance()?;
                if self.is_at('(') { self.call(&name, offset) } else { self.named(&name, offset) }
            }
            TokenKind::Symbol('(') => {
                self.advance()?;
                let value = self.sum()?;
                if self.is_at(',') {
                    return Err(self.unexpected(texts.no_tuple));
                }
                self.expect(')', texts.operator_or_parenthesis)?;
                Ok(value)
            }
            TokenKind::Symbol('[') => {
                let Token { offset, .. } = self.advance()?;
                let items = self.list(']', texts.comma_or_bracket)?;
                self.collected(items, offset)
            }
            TokenKind::Symbol('|') => {
                let Token { offset, .. } = self.advance()?;
                let inner = self.token.offset;
                let argument = Argument { value: self.sum()?, offset: inner };
                self.expect('|', texts.operator_or_bar)?;
                self.evaluated("length", offset, &[argument])
            }
            _ => Err(self.unexpected(texts.operand)),
        }
    }

    /// Values between commas, up to and with the closing bracket.
    fn list(&mut self, close: char, expected: &str) -> Result<Vec<Argument>, Wrong> {
        let mut items = vec![];
        if self.is_at(close) {
            self.advance()?;
            return Ok(items);
        }
        loop {
            let offset = self.token.offset;
            if items.len() == MOST {
                let what = Diagnostic::error(self.session.texts.too_many);
                let expected = filled(self.session.texts.at_most, &[&MOST.to_string()]);
                return Err(Wrong::new(offset, what.expected(expected)));
            }
            let value = self.sum()?;
            items.push(Argument { value, offset });
            if !self.is_at(',') {
                self.expect(close, expected)?;
                return Ok(items);
            }
            self.advance()?;
        }
    }

    /// Numbers are a vector; vectors are the rows of a matrix.
    fn collected(&self, items: Vec<Argument>, offset: usize) -> Result<Value, Wrong> {
        let texts = self.session.texts;
        let wrong = |at: usize, found: String, expected: &str| {
            Err(Wrong::new(at, Diagnostic::error(texts.wrong_list).found(found).expected(expected)))
        };
        let expected = match items.first().map(|item| &item.value) {
            Some(Value::Number(_)) => texts.vector_size,
            Some(Value::Vector(_)) => texts.matrix_size,
            Some(other) => return wrong(items[0].offset, other.described(texts), texts.numbers_or_rows),
            None => return wrong(offset, texts.nothing.to_owned(), texts.numbers_or_rows),
        };
        if items.len() > 4 {
            return wrong(offset, filled(texts.entries, &[&items.len().to_string()]), expected);
        }
        let mut numbers = vec![];
        let mut rows: Vec<Vec<f64>> = vec![];
        for item in items {
            match item.value {
                Value::Number(x) if rows.is_empty() => numbers.push(x),
                Value::Vector(v) if numbers.is_empty() && rows.iter().all(|row| row.len() == v.len()) => {
                    rows.push(v)
                }
                other => return wrong(item.offset, other.described(texts), texts.like_the_first),
            }
        }
        Ok(match rows.first().map(Vec::len) {
            None => Value::Vector(numbers),
            Some(columns) => Value::Matrix(Matrix::from_fn(rows.len(), columns, |i, j| rows[i][j])),
        })
    }

    fn call(&mut self, name: &str, offset: usize) -> Result<Value, Wrong> {
        let texts = self.session.texts;
        if functions::find(name).is_none() {
            return Err(self.unknown(offset, texts.unknown_function, name));
        }
        self.advance()?;
        let arguments = self.list(')', texts.comma_or_parenthesis)?;
        self.evaluated(name, offset, &arguments)
    }

    /// The value of a function that is called at this byte.
    fn evaluated(&mut self, name: &str, offset: usize, arguments: &[Argument]) -> Result<Value, Wrong> {
        let Some(function) = functions::find(name) else {
            return Err(self.unknown(offset, self.session.texts.unknown_function, name));
        };
        let result = Call::new(function, offset, arguments, &mut self.work).run()?;
        self.finite(Ok(result), offset)
    }

    fn named(&self, name: &str, offset: usize) -> Result<Value, Wrong> {
        let texts = self.session.texts;
        if let Some(value) = self.session.names.get(name) {
            return Ok(value.clone());
        }
        let unit =
            |part: usize| quaternion::from_wxyz(std::array::from_fn(|i| f64::from(u8::from(i == part))));
        match name {
            "pi" | "π" => Ok(Value::Number(std::f64::consts::PI)),
            "x" => Ok(DVec3::X.into()),
            "y" => Ok(DVec3::Y.into()),
            "z" => Ok(DVec3::Z.into()),
            "i" => Ok(Value::Quaternion(unit(1))),
            "j" => Ok(Value::Quaternion(unit(2))),
            "k" => Ok(Value::Quaternion(unit(3))),
            _ if functions::find(name).is_some() => {
                let what = Diagnostic::error(texts.call_it).found(quoted(name));
                Err(Wrong::new(offset, what.expected(functions::forms(name))))
            }
            _ => Err(self.unknown(offset, texts.unknown_name, name)),
        }
    }

    fn unknown(&self, offset: usize, message: &str, name: &str) -> Wrong {
        let functions = functions::all().map(|function| function.name);
        let own = self.session.names.keys().map(String::as_str);
        let texts = self.session.texts;
        let what = Diagnostic::error(message).found(quoted(name)).expected(texts.known_names);
        Wrong::new(offset, what.suggest(name, own.chain(functions).chain(CONSTANTS)))
    }

    /// The result of an operation at this byte.
    fn finite(&self, result: Result<Value, Box<Diagnostic>>, offset: usize) -> Result<Value, Wrong> {
        let value = result.map_err(|what| Wrong::new(offset, what))?;
        if value.is_finite() {
            return Ok(value);
        }
        let texts = self.session.texts;
        let found = if let Value::Number(x) = value { x.to_string() } else { value.described(texts) };
        Err(Wrong::new(offset, Diagnostic::error(texts.not_finite).found(found).expected(texts.finite)))
    }
}
