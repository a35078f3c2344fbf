//! The lexer: from bytes to tokens, each with an exact place.

use std::borrow::Cow;
use std::ops::Deref;

use super::source::{Result, SourcePosition};
use crate::Diagnostic;
use crate::diagnostic::{quoted, quoted_bytes};

/// The kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind {
    /// Text in double quotes.
    String,
    /// `[`
    Open,
    /// `]`
    Close,
    /// A word or a number.
    Bare,
}

/// A token: its range of bytes in the file (a string with its quotes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Token {
    pub kind: TokenKind,
    start: usize,
    end: usize,
}

impl Token {
    /// Its length in bytes.
    pub fn len(self) -> usize {
        self.end - self.start
    }
}

/// Splits the bytes of one file into tokens.
///
/// White space is space, tab, CR and LF; `#` between tokens starts a comment up to the end of its line. Lines end with
/// LF, CRLF or a lone CR. A UTF-8 byte order mark is skipped. Comments may be in any encoding; strings are UTF-8.
#[derive(Debug)]
pub(super) struct Lexer<B> {
    bytes: B,
    file: u32,
    at: usize,
    // The last position with a computed line and column: the next one continues from it, so that places in order take
    // one pass over the file.
    walked: Walked,
}

#[derive(Clone, Copy, Debug)]
struct Walked {
    offset: usize,
    line: u32,
    column: u32,
}

impl<B: Deref<Target = [u8]>> Lexer<B> {
    /// When the byte order mark is that of UTF-16 or UTF-32.
    pub fn new(bytes: B, file: u32) -> Result<Self> {
        let all = &*bytes;
        let start = if all.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
        let foreign = if all.starts_with(&[0xFF, 0xFE, 0, 0]) || all.starts_with(&[0, 0, 0xFE, 0xFF]) {
            Some("UTF-32")
        } else if all.starts_with(&[0xFF, 0xFE]) || all.starts_with(&[0xFE, 0xFF]) {
            Some("UTF-16")
        } else {
            None
        };
        if let Some(found) = foreign {
            let wrong = Diagnostic::error("unsupported text encoding").found(found).expected("UTF-8");
            return Err(SourcePosition { file, line: 1, column: 1 }.wrong(wrong));
        }
        let walked = Walked { offset: start, line: 1, column: 1 };
        Ok(Self { bytes, file, at: start, walked })
    }

    /// The next token, or `None` at the end.
    ///
    /// # Errors
    /// When a string does not end on its line, or a control character is between tokens.
    pub fn next(&mut self) -> Result<Option<Token>> {
        let bytes = &*self.bytes;
        let mut start = self.at;
        loop {
            match bytes.get(start) {
                None => {
                    self.at = start;
                    return Ok(None);
                }
                Some(b' ' | b'\t' | b'\r' | b'\n') => start += 1,
                Some(b'#') => {
                    while bytes.get(start).is_some_and(|b| !matches!(b, b'\n' | b'\r')) {
                        start += 1;
                    }
                }
                Some(_) => break,
            }
        }
        let first = bytes[start];
        let (kind, end) = match first {
            b'[' => (TokenKind::Open, start + 1),
            b']' => (TokenKind::Close, start + 1),
            b'"' => {
                let mut end = start + 1;
                loop {
                    match bytes.get(end) {
                        Some(b'"') => break,
                        Some(b'\\') if !matches!(bytes.get(end + 1), None | Some(b'\n' | b'\r')) => end += 2,
                        Some(b'\n' | b'\r') | None => {
                            let shown = quoted_bytes(&bytes[start + 1..end.min(bytes.len())]);
                            let wrong = Diagnostic::error("string without an end on its line").found(shown);
                            return Err(self.spot_at(start).wrong(wrong.expected("a closing quote")));
                        }
                        Some(_) => end += 1,
                    }
                }
                (TokenKind::String, end + 1)
            }
            0..=0x1F | 0x7F => {
                let wrong = Diagnostic::error("stray byte").found(format!("0x{first:02x}"));
                return Err(self.spot_at(start).wrong(wrong.expected("text")));
            }
            _ => {
                let ends = |b: &u8| matches!(b, b' ' | b'\t' | b'\r' | b'\n' | b'"' | b'[' | b']' | 0);
                let length = bytes[start..].iter().position(ends);
                (TokenKind::Bare, length.map_or(bytes.len(), |n| start + n))
            }
        };
        self.at = end;
        Ok(Some(Token { kind, start, end }))
    }

    /// Reads finite decimal numbers, which stand in long lists, faster than token by token. It stops before the first
    /// token that is something else, or that `take` does not accept.
    pub fn numbers<E>(
        &mut self,
        mut take: impl FnMut(f64) -> std::result::Result<bool, E>,
    ) -> std::result::Result<(), E> {
        let bytes = &*self.bytes;
        loop {
            let mut start = self.at;
            while matches!(bytes.get(start), Some(b' ' | b'\t' | b'\r' | b'\n')) {
                start += 1;
            }
            let (mut end, mut whole) = (start, 0_u64);
            while let Some(digit @ b'0'..=b'9') = bytes.get(end) {
                whole = whole.wrapping_mul(10).wrapping_add(u64::from(digit - b'0'));
                end += 1;
            }
            let ends_here = |end| matches!(bytes.get(end), Some(b' ' | b'\t' | b'\r' | b'\n' | b']'));
            let number = if start < end && end - start <= 15 && ends_here(end) {
                whole as f64
            } else {
                while matches!(bytes.get(end), Some(b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E')) {
                    end += 1;
                }
                match parse_number(&bytes[start..end]) {
                    Some(number) if number.is_finite() && ends_here(end) => number,
                    _ => return Ok(()),
                }
            };
            if !take(number)? {
                return Ok(());
            }
            self.at = end;
        }
    }

    /// The place of a token. Cheap for tokens in order.
    pub fn spot(&mut self, token: Token) -> SourcePosition {
        self.spot_at(token.start)
    }

    /// The place of the end of the file.
    pub fn end_spot(&mut self) -> SourcePosition {
        self.spot_at(self.bytes.len())
    }

    /// The bytes of a token, verbatim.
    pub fn raw(&self, token: Token) -> &[u8] {
        &self.bytes[token.start..token.end]
    }

    /// A token for a message, such as `string "x"`.
    pub fn shown(&self, token: Token) -> String {
        let raw = self.raw(token);
        match token.kind {
            TokenKind::String => format!("string {}", quoted_bytes(&raw[1..raw.len() - 1])),
            TokenKind::Open => "[".to_owned(),
            TokenKind::Close => "]".to_owned(),
            TokenKind::Bare => {
                let shown = quoted_bytes(raw);
                if parse_number(raw).is_some() { shown.trim_matches('"').to_owned() } else { shown }
            }
        }
    }

    /// The contents of a string token, escapes resolved.
    ///
    /// # Errors
    /// When it is not UTF-8, or has an unknown escape.
    pub fn string(&mut self, token: Token) -> Result<Cow<'_, str>> {
        debug_assert_eq!(token.kind, TokenKind::String);
        let (start, end) = (token.start + 1, token.end - 1);
        // Computed again below, since a borrow returned from one arm would last for the whole function.
        let wrong = unescape(&self.bytes[start..end]).err();
        if let Some(wrong) = wrong {
            return Err(self.spot_at(token.start).wrong(*wrong));
        }
        Ok(unescape(&self.bytes[start..end]).unwrap_or_default())
    }

    fn spot_at(&mut self, offset: usize) -> SourcePosition {
        let bytes = &*self.bytes;
        let mut w = self.walked;
        if offset < w.offset {
            let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
            w = Walked { offset: start, line: 1, column: 1 };
        }
        while w.offset < offset {
            let byte = bytes[w.offset];
            w.offset += 1;
            let ends_line = byte == b'\n' || (byte == b'\r' && bytes.get(w.offset) != Some(&b'\n'));
            if ends_line {
                w.line = w.line.saturating_add(1);
                w.column = 1;
            } else if byte & 0xC0 != 0x80 {
                // UTF-8 continuation bytes belong to the character before them.
                w.column = w.column.saturating_add(1);
            }
        }
        self.walked = w;
        SourcePosition { file: self.file, line: w.line, column: w.column }
    }
}

/// The contents of a string between its quotes, escapes resolved.
fn unescape(raw: &[u8]) -> std::result::Result<Cow<'_, str>, Box<Diagnostic>> {
    let Ok(text) = std::str::from_utf8(raw) else {
        return Err(Box::new(Diagnostic::error("string is not UTF-8").found(quoted_bytes(raw))));
    };
    if !text.contains('\\') {
        return Ok(Cow::Borrowed(text));
    }
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        if c != '\\' {
            out.push(c);
            continue;
        }
        match chars.next() {
            Some('b') => out.push('\u{8}'),
            Some('f') => out.push('\u{c}'),
            Some('n') => out.push('\n'),
            Some('r') => out.push('\r'),
            Some('t') => out.push('\t'),
            Some(c @ ('\\' | '\'' | '"')) => out.push(c),
            other => {
                let found = quoted(&format!("\\{}", other.map_or_else(String::new, String::from)));
                let wrong = Diagnostic::error("unknown escape in a string").found(found);
                return Err(Box::new(wrong.expected(r#"one of \b \f \n \r \t \\ \' \""#)));
            }
        }
    }
    Ok(Cow::Owned(out))
}

/// A number: decimal, hexadecimal (`0x1.8p3`) or `inf` with a sign. `None` for anything else, including `nan`.
///
/// A decimal number beyond the range of f64 is infinite.
pub(super) fn parse_number(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        rest => (false, rest),
    };
    let magnitude = match digits {
        [b'0', b'x' | b'X', hex @ ..] => parse_hex(hex)?,
        [b'0'..=b'9' | b'.', ..] => std::str::from_utf8(digits).ok()?.parse().ok()?,
        b"inf" | b"Inf" | b"INF" | b"infinity" | b"Infinity" => f64::INFINITY,
        _ => return None,
    };
    Some(if negative { -magnitude } else { magnitude })
}

/// The integer that a number is, if it is one.
pub(super) fn whole(number: f64) -> Option<i32> {
    let is_integer = number.fract() == 0.0 && f64::from(i32::MIN) <= number && number <= f64::from(i32::MAX);
    is_integer.then_some(number as i32)
}

/// Whether a word is `inf` itself, rather than a number that is too large.
pub(super) fn says_infinity(word: &[u8]) -> bool {
    word.iter().any(|b| b.eq_ignore_ascii_case(&b'i'))
}

/// The digits of a hexadecimal number, with an optional fraction and an optional exponent of two.
fn parse_hex(text: &[u8]) -> Option<f64> {
    let (digits, exponent) = match text.iter().position(|b| matches!(b, b'p' | b'P')) {
        None => (text, 0),
        Some(p) => {
            let exponent = std::str::from_utf8(&text[p + 1..]).ok()?.parse::<i32>().ok()?;
            (&text[..p], exponent.clamp(-20_000, 20_000))
        }
    };
    // 60 bits are kept and the rest is or-ed into the last of them, so that the single rounding below is
    // correct.
    let (mut mantissa, mut shift, mut any, mut point) = (0u64, 0i64, false, false);
    for &byte in digits {
        if byte == b'.' && !point {
            point = true;
            continue;
        }
        let digit = u64::from(char::from(byte).to_digit(16)?);
        any = true;
        if mantissa >> 56 == 0 {
            mantissa = mantissa << 4 | digit;
            shift -= if point { 4 } else { 0 };
        } else {
            mantissa |= u64::from(digit != 0);
            shift += if point { 0 } else { 4 };
        }
    }
    if !any {
        return None;
    }
    let exponent = (shift + i64::from(exponent)).clamp(-3000, 3000) as i32;
    // In steps, so that no intermediate power of two overflows; only the last step can round below the normal
    // range.
    let mut value = mantissa as f64;
    let mut left = exponent;
    while left != 0 {
        let step = left.clamp(-1000, 1000);
        value *= 2f64.powi(step);
        left -= step;
    }
    Some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pbrt::source::{Fault, Files};

    fn words(text: &str) -> Vec<(String, u32, u32)> {
        let mut lexer = Lexer::new(text.as_bytes(), 0).unwrap();
        let mut out = vec![];
        while let Some(token) = lexer.next().unwrap() {
            let spot = lexer.spot(token);
            out.push((String::from_utf8_lossy(lexer.raw(token)).into_owned(), spot.line, spot.column));
        }
        out
    }

    fn message(bytes: &[u8]) -> String {
        let mut files = Files::default();
        files.add("a.pbrt".into(), None);
        let run = || -> Result<()> {
            let mut lexer = Lexer::new(bytes, 0)?;
            while let Some(token) = lexer.next()? {
                if token.kind == TokenKind::String {
                    lexer.string(token)?;
                }
            }
            Ok(())
        };
        let fault: Fault = run().unwrap_err();
        fault.into_format_error(&files).to_string()
    }

    #[test]
    fn numbers_of_a_list_are_those_of_their_tokens() {
        let text = b"1 -2.5e3\t007\r\n123456789012345678 .5 3] 4 0x10 5 1e999 6\"a\" 7abc 8";
        let mut lexer = Lexer::new(&text[..], 0).unwrap();
        let mut ends = vec![];
        let mut all = vec![];
        loop {
            let taken: std::result::Result<(), ()> = lexer.numbers(|number| {
                all.push(number);
                Ok(true)
            });
            taken.unwrap();
            match lexer.next().unwrap() {
                Some(token) => ends.push(String::from_utf8_lossy(lexer.raw(token)).into_owned()),
                None => break,
            }
        }
        // What is not certain is left to the token's own reader.
        assert_eq!(ends, ["]", "0x10", "1e999", "6", "\"a\"", "7abc", "8"]);
        assert_eq!(all, [1.0, -2500.0, 7.0, 123456789012345678.0, 0.5, 3.0, 4.0, 5.0]);

        let mut lexer = Lexer::new(&b"1 2 3 4"[..], 0).unwrap();
        let refused: std::result::Result<(), ()> = lexer.numbers(|number| Ok(number < 3.0));
        refused.unwrap();
        let token = lexer.next().unwrap().unwrap();
        assert_eq!(lexer.raw(token), b"3");
    }

    #[test]
    fn tokens_stand_where_an_editor_shows_them() {
        let at = |text: &str, line, column| (text.to_owned(), line, column);
        assert_eq!(
            words("# é\r\nShape \"sphère\"[ 1\t-2.5]#x\r\r\n  Z"),
            [
                at("Shape", 2, 1),
                at("\"sphère\"", 2, 7),
                at("[", 2, 15),
                at("1", 2, 17),
                at("-2.5", 2, 19),
                at("]", 2, 23),
                at("Z", 4, 3),
            ]
        );
    }

    #[test]
    fn a_byte_order_mark_takes_no_column() {
        assert_eq!(words("\u{FEFF}Scale"), [("Scale".to_owned(), 1, 1)]);
        assert_eq!(
            message(b"\xFF\xFES\0"),
            "a.pbrt:1:1: unsupported text encoding (found UTF-16; expected UTF-8)"
        );
    }

    #[test]
    fn broken_strings_are_found_where_they_start() {
        assert_eq!(
            message(b"Shape\n  \"sph\nere\""),
            r#"a.pbrt:2:3: string without an end on its line (found "sph"; expected a closing quote)"#
        );
        assert!(message(b"\"a\\").starts_with("a.pbrt:1:1: string without an end"));
        assert!(message(b"x \"a\\q\"").starts_with("a.pbrt:1:3: unknown escape in a string"));
        assert!(message(b"x\0").starts_with("a.pbrt:1:2: stray byte (found 0x00"));
        assert!(message(b"\"\xE9\"").starts_with("a.pbrt:1:1: string is not UTF-8"));
    }

    #[test]
    fn escapes_are_resolved() {
        let mut lexer = Lexer::new(br#" "a\\b\"c\td\'" "#.as_slice(), 0).unwrap();
        let token = lexer.next().unwrap().unwrap();
        assert_eq!(lexer.string(token).unwrap(), "a\\b\"c\td'");
    }

    #[test]
    fn numbers_are_decimal_or_hexadecimal() {
        let good = [
            ("1", 1.0),
            ("-0.5e-3", -0.5e-3),
            (".25", 0.25),
            ("7.", 7.0),
            ("+3", 3.0),
            ("0x10", 16.0),
            ("-0x1.8p3", -12.0),
            ("0x.8", 0.5),
            ("0x1p-1074", 5e-324),
            ("0x1.fffffffffffffp1023", f64::MAX),
            ("0x1234567890abcdef0", f64::from_bits(0x43F2_3456_7890_ABCE)),
            ("inf", f64::INFINITY),
            ("-inf", f64::NEG_INFINITY),
            ("1e400", f64::INFINITY),
        ];
        for (text, value) in good {
            assert_eq!(parse_number(text.as_bytes()), Some(value), "{text}");
        }
        for text in ["", "-", "nan", "0x", "1e", "1.2.3", "--1", "0x1.2.3", "0xp1", "true", "1f", ".", "e5"] {
            assert_eq!(parse_number(text.as_bytes()), None, "{text}");
        }
        assert!(says_infinity(b"-inf") && !says_infinity(b"1e400"));
    }
}
