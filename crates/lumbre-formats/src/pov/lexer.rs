//! Text of POV-Ray's scene language as tokens with their places.

use std::collections::HashMap;
use std::rc::Rc;

use super::words::is_reserved;

/// A token.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// A keyword or an identifier.
    Word(Rc<str>),
    /// A number.
    Number(f64),
    /// A text between quotes, with its escapes as they are written.
    Text(Rc<str>),
    /// A punctuation mark; of two characters `l`, `g`, `n` for <=, >=, !=.
    Mark(u8),
    /// Something that is no token: why.
    Bad(&'static str),
}

/// A token with its place, counted from 1.
#[derive(Clone, Debug)]
pub(super) struct Token {
    pub kind: Kind,
    /// Whether it is a word of the language, which no scene may declare.
    pub is_reserved: bool,
    pub line: u32,
    pub column: u32,
}

/// The words of all files of a scene, each kept once, with whether it belongs to the language.
#[derive(Debug, Default)]
pub(super) struct Words(HashMap<Rc<str>, bool>);

impl Words {
    fn name(&mut self, text: &str) -> (Rc<str>, bool) {
        if let Some((name, is_reserved)) = self.0.get_key_value(text) {
            return (Rc::clone(name), *is_reserved);
        }
        let (name, is_reserved) = (Rc::from(text), is_reserved(text));
        self.0.insert(Rc::clone(&name), is_reserved);
        (name, is_reserved)
    }
}

pub(super) const LESS_OR_EQUAL: u8 = b'l';
pub(super) const GREATER_OR_EQUAL: u8 = b'g';
pub(super) const NOT_EQUAL: u8 = b'n';

/// A text that is being cut.
struct Cutter<'a> {
    words: &'a mut Words,
    text: &'a [u8],
    at: usize,
    line: u32,
    column: u32,
}

/// The tokens of a text, in order. What is no token is one that says so, for it may stand where nobody looks.
pub(super) fn tokens<'a>(text: &'a str, words: &'a mut Words) -> impl Iterator<Item = Token> + 'a {
    let mut cutter = Cutter { words, text: text.as_bytes(), at: 0, line: 1, column: 1 };
    std::iter::from_fn(move || cutter.next())
}

impl Cutter<'_> {
    fn peek(&self, ahead: usize) -> u8 {
        self.text.get(self.at + ahead).copied().unwrap_or(0)
    }

    fn bump(&mut self) -> u8 {
        let byte = self.peek(0);
        self.at += 1;
        // A lone CR ends a line, too.
        if byte == b'\n' || (byte == b'\r' && self.peek(0) != b'\n') {
            self.line += 1;
            self.column = 1;
        } else if byte & 0xC0 != 0x80 {
            self.column += 1;
        }
        byte
    }

    /// Skips spaces and comments; `false` for a comment without an end.
    fn skip(&mut self) -> bool {
        loop {
            match self.peek(0) {
                b' ' | b'\t' | b'\n' | b'\r' | 0x0B | 0x0C | 0x1A => {
                    self.bump();
                }
                0 if self.at < self.text.len() => {
                    self.bump();
                }
                b'/' if self.peek(1) == b'/' => {
                    while self.at < self.text.len() && !matches!(self.peek(0), b'\n' | b'\r') {
                        self.bump();
                    }
                }
                b'/' if self.peek(1) == b'*' => {
                    let mut depth = 0_u32;
                    loop {
                        if self.at >= self.text.len() {
                            return false;
                        }
                        if self.peek(0) == b'/' && self.peek(1) == b'*' {
                            depth += 1;
                            self.bump();
                        } else if self.peek(0) == b'*' && self.peek(1) == b'/' {
                            depth -= 1;
                            self.bump();
                        }
                        self.bump();
                        if depth == 0 {
                            break;
                        }
                    }
                }
                _ => return true,
            }
        }
    }

    fn next(&mut self) -> Option<Token> {
        let (line, column) = (self.line, self.column);
        if !self.skip() {
            let kind = Kind::Bad("a comment without an end");
            return Some(Token { kind, is_reserved: false, line, column });
        }
        if self.at >= self.text.len() {
            return None;
        }
        let (line, column) = (self.line, self.column);
        if matches!(self.peek(0), b'a'..=b'z' | b'A'..=b'Z' | b'_') {
            let (name, is_reserved) = self.word();
            return Some(Token { kind: Kind::Word(name), is_reserved, line, column });
        }
        Some(Token { kind: self.token(), is_reserved: false, line, column })
    }

    fn word(&mut self) -> (Rc<str>, bool) {
        let start = self.at;
        while self.peek(0).is_ascii_alphanumeric() || self.peek(0) == b'_' {
            self.at += 1;
            self.column += 1;
        }
        let text = std::str::from_utf8(&self.text[start..self.at]).unwrap_or_default();
        self.words.name(text)
    }

    fn token(&mut self) -> Kind {
        match self.peek(0) {
            b'0'..=b'9' => self.number(),
            b'.' if self.peek(1).is_ascii_digit() => self.number(),
            b'"' => self.quoted(),
            first => {
                self.bump();
                let pair = match (first, self.peek(0)) {
                    (b'<', b'=') => LESS_OR_EQUAL,
                    (b'>', b'=') => GREATER_OR_EQUAL,
                    (b'!', b'=') => NOT_EQUAL,
                    _ => 0,
                };
                if pair != 0 {
                    self.bump();
                    return Kind::Mark(pair);
                }
                match first {
                    b'{' | b'}' | b'(' | b')' | b'[' | b']' | b'<' | b'>' | b',' | b';' | b'+' | b'-'
                    | b'*' | b'/' | b'=' | b'!' | b'&' | b'|' | b'?' | b':' | b'.' | b'#' => {
                        Kind::Mark(first)
                    }
                    _ => {
                        // All bytes of one character.
                        while self.peek(0) & 0xC0 == 0x80 {
                            self.bump();
                        }
                        Kind::Bad("a character that has no meaning here")
                    }
                }
            }
        }
    }

    fn slice(&self, start: usize) -> Rc<str> {
        String::from_utf8_lossy(&self.text[start..self.at.min(self.text.len())]).into()
    }

    fn number(&mut self) -> Kind {
        let start = self.at;
        let digits = |cutter: &mut Self| {
            while cutter.peek(0).is_ascii_digit() {
                cutter.bump();
            }
        };
        digits(self);
        if self.peek(0) == b'.' {
            self.bump();
            digits(self);
        }
        if matches!(self.peek(0), b'e' | b'E') {
            let sign = usize::from(matches!(self.peek(1), b'+' | b'-'));
            if self.peek(1 + sign).is_ascii_digit() {
                for _ in 0..=sign {
                    self.bump();
                }
                digits(self);
            }
        }
        self.slice(start).parse().map_or(Kind::Bad("a number that cannot be read"), Kind::Number)
    }

    fn quoted(&mut self) -> Kind {
        self.bump();
        let start = self.at;
        loop {
            if self.at >= self.text.len() {
                return Kind::Bad("a text without an end");
            }
            match self.peek(0) {
                b'"' => break,
                b'\\' if self.at + 1 < self.text.len() => {
                    self.bump();
                    self.bump();
                }
                _ => {
                    self.bump();
                }
            }
        }
        let text = self.slice(start);
        self.bump();
        Kind::Text(text)
    }
}

/// A text with its escapes replaced.
pub(super) fn unescaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text.chars();
    while let Some(c) = rest.next() {
        if c != '\\' {
            out.push(c);
            continue;
        }
        match rest.next() {
            Some('n') => out.push('\n'),
            Some('t') => out.push('\t'),
            Some('r') => out.push('\r'),
            Some('a') => out.push('\x07'),
            Some('b') => out.push('\x08'),
            Some('f') => out.push('\x0C'),
            Some('v') => out.push('\x0B'),
            Some('u') => {
                let digits: String = rest.clone().take(4).collect();
                if let Some(c) = u32::from_str_radix(&digits, 16).ok().and_then(char::from_u32) {
                    out.push(c);
                    rest.nth(3);
                }
            }
            Some(other) => out.push(other),
            None => {}
        }
    }
    out
}
