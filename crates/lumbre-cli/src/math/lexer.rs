//! From text to tokens.

use lumbre::formats::diagnostic::{Diagnostic, quoted};

use super::texts::Texts;

/// A mistake in an expression: the byte that it is at, and what is wrong.
#[derive(Debug)]
pub(super) struct Wrong {
    pub(super) offset: usize,
    pub(super) what: Box<Diagnostic>,
}

impl Wrong {
    pub(super) fn new(offset: usize, what: impl Into<Box<Diagnostic>>) -> Self {
        Self { offset, what: what.into() }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum TokenKind {
    Number(f64),
    Name(String),
    /// One of `+ - * / ^ = ( ) [ ] , | °`.
    Symbol(char),
    /// The end of a statement: `;` or the end of a line outside of brackets.
    Break,
    /// The end of the text.
    End,
}

#[derive(Clone, Debug)]
pub(super) struct Token {
    pub(super) kind: TokenKind,
    /// The byte where it begins.
    pub(super) offset: usize,
    /// Whether nothing separates it from the token before.
    pub(super) is_adjacent: bool,
}

/// Cuts a text into tokens, one at a time.
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
    /// How many brackets are open: there, the end of a line is a space.
    open: usize,
    texts: &'static Texts,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str, texts: &'static Texts) -> Self {
        Self { text, at: 0, open: 0, texts }
    }

    /// The next token.
    pub(super) fn next(&mut self) -> Result<Token, Wrong> {
        let end = self.at;
        self.skip_space();
        let offset = self.at;
        let is_adjacent = offset == end;
        let Some(c) = self.text[self.at..].chars().next() else {
            return Ok(Token { kind: TokenKind::End, offset, is_adjacent });
        };
        let kind = match c {
            '0'..='9' | '.' => self.number()?,
            // Spanish keyboards have the ordinal, which is a letter.
            '°' | 'º' => {
                self.at += c.len_utf8();
                TokenKind::Symbol('°')
            }
            c if begins_name(c) => {
                let name = self.take_while(|c| begins_name(c) || c.is_ascii_digit());
                TokenKind::Name(name.to_owned())
            }
            ';' | '\n' => {
                self.at += 1;
                TokenKind::Break
            }
            '+' | '-' | '*' | '/' | '^' | '=' | '(' | ')' | '[' | ']' | ',' | '|' => {
                self.at += 1;
                match c {
                    '(' | '[' => self.open += 1,
                    ')' | ']' => self.open = self.open.saturating_sub(1),
                    _ => {}
                }
                TokenKind::Symbol(c)
            }
            other => {
                let what = Diagnostic::error(self.texts.unknown_character);
                return Err(Wrong::new(
                    offset,
                    what.found(quoted(other.encode_utf8(&mut [0; 4]))).expected(self.texts.characters),
                ));
            }
        };
        Ok(Token { kind, offset, is_adjacent })
    }

    /// Spaces, comments, and ends of lines within brackets.
    fn skip_space(&mut self) {
        loop {
            let is_inside = self.open > 0;
            self.take_while(|c| c == ' ' || c == '\t' || c == '\r' || (is_inside && c == '\n'));
            if !self.text[self.at..].starts_with('#') {
                return;
            }
            self.take_while(|c| c != '\n');
        }
    }

    fn take_while(&mut self, mut accepts: impl FnMut(char) -> bool) -> &'a str {
        let rest = &self.text[self.at..];
        let taken = &rest[..rest.find(|c| !accepts(c)).unwrap_or(rest.len())];
        self.at += taken.len();
        taken
    }

    fn number(&mut self) -> Result<TokenKind, Wrong> {
        let start = self.at;
        self.take_while(|c| c.is_ascii_digit() || c == '.');
        // An e without an exponent is a name.
        let rest = &self.text[self.at..];
        if let Some(exponent) = rest.strip_prefix(['e', 'E'])
            && exponent.strip_prefix(['+', '-']).unwrap_or(exponent).starts_with(|c: char| c.is_ascii_digit())
        {
            self.at += rest.len() - exponent.len();
            self.take_while(|c| c == '+' || c == '-');
            self.take_while(|c| c.is_ascii_digit());
        }
        let written = &self.text[start..self.at];
        match written.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(TokenKind::Number(number)),
            _ => {
                let what = Diagnostic::error(self.texts.not_a_number).found(quoted(written));
                Err(Wrong::new(start, what.expected(self.texts.number_form)))
            }
        }
    }
}

/// Letters of any alphabet; the ordinal stands for degrees.
fn begins_name(c: char) -> bool {
    c.is_alphabetic() && c != 'º' || c == '_'
}

/// How many brackets are open after a line that begins with `open` of them: more lines belong to it. 0 after a mistake.
pub(super) fn open_brackets(line: &str, open: usize, texts: &'static Texts) -> usize {
    let mut lexer = Lexer::new(line, texts);
    lexer.open = open;
    loop {
        match lexer.next() {
            Ok(Token { kind: TokenKind::End, .. }) => return lexer.open,
            Ok(_) => {}
            Err(_) => return 0,
        }
    }
}
