//! The token stream over included files, and the arguments of directives.

use super::super::lexer::{Token, TokenKind, parse_number};
use super::super::source::{Result, SourcePosition};
use super::{Frame, Parser};
use crate::Diagnostic;

impl<'b> Parser<'b, '_> {
    pub(super) fn top(&mut self) -> &mut Frame<'b> {
        self.frames.last_mut().expect("a file is being read")
    }

    /// The next token; at the end of an included file it continues with the including one.
    pub(super) fn next(&mut self) -> Result<Option<Token>> {
        if let Some(token) = self.peeked.take() {
            return Ok(Some(token));
        }
        loop {
            let frame = self.top();
            let token = frame.lexer.next()?;
            if token.is_some() || frame.is_top || frame.import.is_some() {
                return Ok(token);
            }
            self.frames.pop();
        }
    }

    pub(super) fn peek(&mut self) -> Result<Option<Token>> {
        self.peeked = self.next()?;
        Ok(self.peeked)
    }

    pub(super) fn spot(&mut self, token: Token) -> SourcePosition {
        self.top().lexer.spot(token)
    }

    pub(super) fn shown(&mut self, token: Token) -> String {
        self.top().lexer.shown(token)
    }

    pub(super) fn bare(&mut self, token: Token) -> String {
        String::from_utf8_lossy(self.top().lexer.raw(token)).into_owned()
    }

    /// The next token, which must exist.
    pub(super) fn expect(&mut self, what: &str) -> Result<Token> {
        match self.next()? {
            Some(token) => Ok(token),
            None => {
                let spot = self.top().lexer.end_spot();
                Err(spot.wrong(Diagnostic::error("the file ends too early").expected(what)))
            }
        }
    }

    pub(super) fn unexpected<T>(&mut self, token: Token, what: &str, expected: &str) -> Result<T> {
        let wrong = Diagnostic::error(what).found(self.shown(token)).expected(expected);
        Err(self.spot(token).wrong(wrong))
    }

    /// A string with its place.
    pub(super) fn string(&mut self, directive: &str, expected: &str) -> Result<(String, SourcePosition)> {
        let token = self.expect(expected)?;
        if token.kind != TokenKind::String {
            return self.unexpected(token, &format!("wrong argument of {directive}"), expected);
        }
        let spot = self.spot(token);
        let text = self.top().lexer.string(token)?;
        Ok((text.into_owned(), spot))
    }

    /// `N` numbers, optionally in brackets.
    pub(super) fn numbers<const N: usize>(&mut self, directive: &str) -> Result<[f64; N]> {
        let what = format!("wrong argument of {directive}");
        let plural = if N == 1 { "number" } else { "numbers" };
        let expected = format!("{N} {plural}");
        let mut numbers = [0.0; N];
        let mut token = self.expect(&expected)?;
        let bracketed = token.kind == TokenKind::Open;
        if bracketed {
            token = self.expect(&expected)?;
        }
        for (i, number) in numbers.iter_mut().enumerate() {
            if i > 0 {
                token = self.expect(&expected)?;
            }
            let value =
                if token.kind == TokenKind::Bare { parse_number(self.top().lexer.raw(token)) } else { None };
            match value {
                Some(v) if v.is_finite() => *number = v,
                Some(_) => return self.unexpected(token, &what, "a finite number"),
                None => return self.unexpected(token, &what, &expected),
            }
        }
        if bracketed {
            let token = self.expect("]")?;
            if token.kind != TokenKind::Close {
                return self.unexpected(token, &what, "]");
            }
        }
        Ok(numbers)
    }
}
