//! Parameter lists.

use std::cell::Cell;

use lumbre_image::ColourSpace;

use super::super::colour::rgb_from_xyz;
use super::super::lexer::{Token, TokenKind, parse_number, says_infinity, whole};
use super::super::params::{Param, Params, Type, Values, Wants};
use super::super::source::{AtSpot, Result, SourcePosition};
use super::super::state::EntityKind;
use super::Parser;
use crate::diagnostic::quoted;
use crate::{Diagnostic, LimitError};

impl Parser<'_, '_> {
    /// Reads a parameter list.
    pub(super) fn params(&mut self) -> Result<Vec<Param>> {
        let mut params = vec![];
        while let Some(token) = self.peek()? {
            if token.kind != TokenKind::String {
                break;
            }
            self.peeked = None;
            let param = self.param(token)?;
            self.room.room_in(&mut params, "parameters").at(param.spot)?;
            params.push(param);
        }
        Ok(params)
    }

    /// Reads a type in quotes and a parameter list.
    pub(super) fn entity(
        &mut self,
        directive: &str,
        noun: &str,
        kind: Option<EntityKind>,
        spot: SourcePosition,
    ) -> Result<(String, Params)> {
        let (ty, _) = self.string(directive, "a type in quotes")?;
        let own = self.params()?;
        let defaults = kind.map(|k| self.state.defaults_for(k)).unwrap_or_default();
        let owner = format!("{noun} {}", quoted(&ty));
        Ok((ty, Params::new(owner, spot, own, defaults)))
    }

    fn param(&mut self, declaration: Token) -> Result<Param> {
        let spot = self.spot(declaration);
        let text = self.top().lexer.string(declaration)?.into_owned();
        let mut words = text.split_ascii_whitespace();
        let (type_name, name) = match (words.next(), words.next(), words.next()) {
            (Some(ty), Some(name), None) => (ty, name),
            _ => {
                let wrong = Diagnostic::error("wrong declaration of a parameter").found(quoted(&text));
                return Err(spot.wrong(wrong.expected("a type and a name such as \"float radius\"")));
            }
        };
        let Some((ty, old)) = Type::from_name(type_name) else {
            let wrong = Diagnostic::error(format!("unknown type of parameter {}", quoted(name)));
            let wrong = wrong.found(quoted(type_name)).suggest(type_name, Type::names());
            return Err(spot.wrong(wrong.expected(Type::names().collect::<Vec<_>>().join(", "))));
        };
        if old {
            self.converter.upgraded(spot);
        }
        let mut values = self.values(ty, name)?;
        let mut space = self.state.space;
        if type_name == "xyz" {
            if let Values::Numbers(numbers) = &mut values {
                let triples = numbers.chunks_exact_mut(3);
                triples.for_each(|c| c.copy_from_slice(&rgb_from_xyz([c[0], c[1], c[2]])));
            }
            space = ColourSpace::REC709;
        }
        self.converter.budget.elements(values.len() as u64 + 1, "parameters").at(spot)?;
        Ok(Param { ty, name: name.into(), spot, values, space, used: Cell::new(false) })
    }

    fn values(&mut self, ty: Type, name: &str) -> Result<Values> {
        let expected = match ty.wants() {
            Wants::Bools => "true or false",
            Wants::Integers => "a whole number",
            Wants::Strings => "a string in quotes",
            Wants::Numbers => "a number",
            Wants::NumbersOrStrings => "numbers or a string",
        };
        let mut token = self.expect(&format!("a value for parameter {}", quoted(name)))?;
        let bracketed = token.kind == TokenKind::Open;
        if bracketed {
            token = self.expect("\"]\"")?;
        }
        let mut values = match ty.wants() {
            Wants::Bools => Values::Bools(vec![]),
            Wants::Integers => Values::Integers(vec![]),
            Wants::Strings => Values::Strings(vec![]),
            Wants::NumbersOrStrings if token.kind == TokenKind::String => Values::Strings(vec![]),
            _ => Values::Numbers(vec![]),
        };
        loop {
            if bracketed && token.kind == TokenKind::Close {
                return Ok(values);
            }
            if !self.value(token, &mut values)? {
                let what = format!("wrong value for parameter {}", quoted(name));
                return self.unexpected(token, &what, expected);
            }
            if !bracketed {
                return Ok(values);
            }
            self.more_numbers(&mut values, token)?;
            token = self.expect("\"]\"")?;
        }
    }

    /// Appends the plain numbers that follow `last`.
    fn more_numbers(&mut self, values: &mut Values, last: Token) -> Result<()> {
        let lexer = &mut self.frames.last_mut().expect("a file is being read").lexer;
        let room = &mut self.room;
        let read = match values {
            Values::Numbers(v) => lexer.numbers(|number| {
                room.room_in(v, "numbers")?;
                v.push(number);
                Ok(true)
            }),
            Values::Integers(v) => lexer.numbers(|number| {
                let Some(number) = whole(number) else { return Ok(false) };
                room.room_in(v, "integers")?;
                v.push(number);
                Ok(true)
            }),
            Values::Bools(_) | Values::Strings(_) => Ok(()),
        };
        read.or_else(|limit: LimitError| Err(limit).at(lexer.spot(last)))
    }

    /// Appends the value of `token`; returns whether it is valid.
    fn value(&mut self, token: Token, values: &mut Values) -> Result<bool> {
        let lexer = &mut self.frames.last_mut().expect("a file is being read").lexer;
        let made = match values {
            Values::Numbers(v) => self.room.room_in(v, "numbers"),
            Values::Integers(v) => self.room.room_in(v, "integers"),
            Values::Strings(v) => {
                self.room.grow(token.len() as u64, "strings").and_then(|()| self.room.room_in(v, "strings"))
            }
            Values::Bools(v) => self.room.room_in(v, "bools"),
        };
        if let Err(limit) = made {
            return Err(limit).at(lexer.spot(token));
        }
        match (values, token.kind) {
            (Values::Numbers(v), TokenKind::Bare) => {
                let raw = lexer.raw(token);
                match parse_number(raw) {
                    Some(number) if number.is_finite() || says_infinity(raw) => v.push(number),
                    _ => return Ok(false),
                }
            }
            (Values::Integers(v), TokenKind::Bare) => match parse_number(lexer.raw(token)).and_then(whole) {
                Some(number) => v.push(number),
                None => return Ok(false),
            },
            (Values::Strings(v), TokenKind::String) => v.push(lexer.string(token)?.into_owned()),
            (Values::Bools(v), TokenKind::Bare) => match lexer.raw(token) {
                b"true" => v.push(true),
                b"false" => v.push(false),
                _ => return Ok(false),
            },
            // As in pbrt-v3.
            (Values::Bools(v), TokenKind::String) => {
                match &*lexer.string(token)? {
                    "true" => v.push(true),
                    "false" => v.push(false),
                    _ => return Ok(false),
                }
                let spot = lexer.spot(token);
                self.converter.upgraded(spot);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }
}
