//! JSON (RFC 8259) as a table of positions in its text: nothing is copied, and every value knows its pointer
//! (RFC 6901).

use std::borrow::Cow;
use std::fmt::Write as _;
use std::sync::{Arc, OnceLock};

use crate::budget::{Budget, BudgetVec};
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, TextPlaces, quoted, quoted_bytes};

pub(super) type Read<T> = Result<T, FormatError>;

/// A value or a key: its start in the text, and the table entry after everything inside it. A member of an
/// object has two entries, the key's and then the value's.
#[derive(Clone, Copy, Debug)]
struct Entry {
    start: u32,
    next: u32,
}

/// A parsed text.
#[derive(Debug)]
pub(super) struct Json<'t> {
    name: Arc<str>,
    text: &'t str,
    entries: Vec<Entry>,
    /// The offset of the text in its file, if it is not the whole file.
    within: Option<u64>,
    places: TextPlaces,
    holders: OnceLock<Vec<Holder>>,
}

/// What holds a value: the entry of its container, and its number there, or its key's entry.
#[derive(Clone, Copy, Debug, Default)]
struct Holder {
    container: u32,
    number: u32,
}

/// A nested value, with its name in an object.
pub(super) type Inside<'a> = (Option<Cow<'a, str>>, Value<'a>);

/// A value in a text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value<'a> {
    json: &'a Json<'a>,
    at: u32,
}

impl<'t> Json<'t> {
    /// Parses a text. `within` is its offset in its file, if it is not the whole file.
    pub(super) fn read(text: &'t str, name: &Arc<str>, within: Option<u64>, budget: &Budget) -> Read<Self> {
        let mut parser = Parser { text: text.as_bytes(), at: 0, name, within, budget };
        if text.len() >= u32::MAX as usize {
            return Err(parser.wrong("JSON text too long").expected("less than 4 GiB").into());
        }
        let entries = parser.document()?;
        Ok(Self {
            name: name.clone(),
            text,
            entries,
            within,
            places: TextPlaces::default(),
            holders: OnceLock::new(),
        })
    }

    /// The root value.
    pub(super) fn root(&self) -> Value<'_> {
        Value { json: self, at: 0 }
    }

    /// What holds each value and each key, found once, when the first pointer is needed.
    fn holders(&self) -> &[Holder] {
        self.holders.get_or_init(|| {
            let mut holders = vec![Holder::default(); self.entries.len()];
            for container in 0..self.entries.len() as u32 {
                let here = Value { json: self, at: container };
                match here.first_byte() {
                    b'{' => here.pairs().for_each(|(key, value)| {
                        let holder = Holder { container, number: key.at };
                        (holders[key.at as usize], holders[value.at as usize]) = (holder, holder);
                    }),
                    b'[' => (0..).zip(here.values()).for_each(|(number, value)| {
                        holders[value.at as usize] = Holder { container, number };
                    }),
                    _ => {}
                }
            }
            holders
        })
    }
}

struct Parser<'p> {
    text: &'p [u8],
    at: usize,
    name: &'p Arc<str>,
    within: Option<u64>,
    budget: &'p Budget,
}

impl Parser<'_> {
    fn place(&self, at: usize) -> Place {
        match self.within {
            None => Place::of_offset(self.name.clone(), self.text, at),
            Some(start) => Place::binary(self.name.clone(), start + at as u64, ""),
        }
    }

    /// An error at the parser's position.
    fn wrong(&self, message: &str) -> Diagnostic {
        let rest = &self.text[self.at.min(self.text.len())..];
        let found = match rest.first() {
            None => "the end of the text".to_owned(),
            // A whole character, so that it can be displayed.
            Some(_) => {
                let rest = String::from_utf8_lossy(&rest[..rest.len().min(4)]).into_owned();
                quoted(rest.get(..rest.chars().next().map_or(0, char::len_utf8)).unwrap_or(""))
            }
        };
        Diagnostic::error(message).at(self.place(self.at)).found(found)
    }

    fn skip_space(&mut self) {
        while let Some(b' ' | b'\t' | b'\n' | b'\r') = self.text.get(self.at) {
            self.at += 1;
        }
    }

    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    fn document(&mut self) -> Read<Vec<Entry>> {
        let budget = self.budget;
        let mut entries = BudgetVec::new(budget, "JSON values");
        // The open containers, as table indices.
        let mut open: BudgetVec<'_, u32> = BudgetVec::new(budget, "JSON nesting");
        let mut depth = 0;
        'value: loop {
            self.skip_space();
            let start = self.at;
            let place = entries.len() as u32;
            let entry = Entry { start: start as u32, next: place + 1 };
            match self.peek() {
                Some(bracket @ (b'{' | b'[')) => {
                    budget
                        .nesting(depth + 1, "JSON")
                        .map_err(|e| FormatError::from(e).or_at(|| self.place(start)))?;
                    entries.push(entry)?;
                    self.at += 1;
                    self.skip_space();
                    let is_empty = self.peek() == Some(bracket + 2);
                    if is_empty {
                        self.at += 1;
                    } else {
                        if depth == open.len() {
                            open.push(place)?;
                        } else {
                            open[depth] = place;
                        }
                        depth += 1;
                        if bracket == b'{' {
                            entries.push(self.key()?)?;
                            let next = entries.len() as u32;
                            entries[next as usize - 1].next = next;
                        }
                        continue 'value;
                    }
                }
                Some(b'"') => {
                    self.string()?;
                    entries.push(entry)?;
                }
                Some(b'-' | b'0'..=b'9') => {
                    self.number()?;
                    entries.push(entry)?;
                }
                _ => {
                    let words: [&[u8]; 3] = [b"true", b"false", b"null"];
                    let Some(word) = words.iter().find(|word| self.text[self.at..].starts_with(word)) else {
                        return Err(self.wrong("wrong JSON").expected("a value").into());
                    };
                    self.at += word.len();
                    entries.push(entry)?;
                }
            }
            // After a value: close containers until a comma follows.
            loop {
                self.skip_space();
                if depth == 0 {
                    if self.at < self.text.len() {
                        return Err(self.wrong("wrong JSON").expected("nothing after the value").into());
                    }
                    return Ok(entries.into_vec());
                }
                let container = open[depth - 1] as usize;
                let is_object = self.text[entries[container].start as usize] == b'{';
                match (self.peek(), is_object) {
                    (Some(b','), true) => {
                        self.at += 1;
                        self.skip_space();
                        let mut key = self.key()?;
                        key.next = entries.len() as u32 + 1;
                        entries.push(key)?;
                        continue 'value;
                    }
                    (Some(b','), false) => {
                        self.at += 1;
                        continue 'value;
                    }
                    (Some(b'}'), true) | (Some(b']'), false) => {
                        self.at += 1;
                        entries[container].next = entries.len() as u32;
                        depth -= 1;
                    }
                    _ => {
                        let expected = if is_object { "',' or '}'" } else { "',' or ']'" };
                        return Err(self.wrong("wrong JSON").expected(expected).into());
                    }
                }
            }
        }
    }

    /// A key with its colon.
    fn key(&mut self) -> Read<Entry> {
        let start = self.at as u32;
        if self.peek() != Some(b'"') {
            return Err(self.wrong("wrong JSON").expected("a name in quotes").into());
        }
        self.string()?;
        self.skip_space();
        if self.peek() != Some(b':') {
            return Err(self.wrong("wrong JSON").expected("':'").into());
        }
        self.at += 1;
        Ok(Entry { start, next: 0 })
    }

    fn string(&mut self) -> Read<()> {
        self.at += 1;
        loop {
            match self.peek() {
                Some(b'"') => {
                    self.at += 1;
                    return Ok(());
                }
                Some(b'\\') => {
                    self.at += 1;
                    match self.peek() {
                        Some(b'"' | b'\\' | b'/' | b'b' | b'f' | b'n' | b'r' | b't') => self.at += 1,
                        Some(b'u') => {
                            for i in 1..=4 {
                                if !self.text.get(self.at + i).is_some_and(u8::is_ascii_hexdigit) {
                                    self.at = (self.at + i).min(self.text.len());
                                    return Err(self
                                        .wrong("wrong escape in a JSON string")
                                        .expected("four hexadecimal digits")
                                        .into());
                                }
                            }
                            self.at += 5;
                        }
                        _ => return Err(self.wrong("wrong escape in a JSON string").into()),
                    }
                }
                Some(0x20..) => self.at += 1,
                Some(_) => {
                    let expected = "an escape such as \\n";
                    let found = quoted_bytes(&self.text[self.at..=self.at]);
                    return Err(self
                        .wrong("control character in a JSON string")
                        .found(found)
                        .expected(expected)
                        .into());
                }
                None => return Err(self.wrong("JSON string without end").expected("'\"'").into()),
            }
        }
    }

    fn number(&mut self) -> Read<()> {
        let digits = |this: &mut Self| {
            let start = this.at;
            while this.peek().is_some_and(|b| b.is_ascii_digit()) {
                this.at += 1;
            }
            if this.at == start {
                return Err(FormatError::from(this.wrong("wrong JSON number").expected("a digit")));
            }
            Ok(())
        };
        if self.peek() == Some(b'-') {
            self.at += 1;
        }
        if self.peek() == Some(b'0') {
            self.at += 1;
        } else {
            digits(self)?;
        }
        if self.peek() == Some(b'.') {
            self.at += 1;
            digits(self)?;
        }
        if let Some(b'e' | b'E') = self.peek() {
            self.at += 1;
            if let Some(b'+' | b'-') = self.peek() {
                self.at += 1;
            }
            digits(self)?;
        }
        Ok(())
    }
}

impl<'a> Value<'a> {
    fn start(self) -> usize {
        self.json.entries[self.at as usize].start as usize
    }

    fn next(self) -> u32 {
        self.json.entries[self.at as usize].next
    }

    fn first_byte(self) -> u8 {
        self.json.text.as_bytes()[self.start()]
    }

    fn entry(self, at: u32) -> Self {
        Self { json: self.json, at }
    }

    /// The text that contains it.
    pub(super) fn text(self) -> &'a str {
        self.json.text
    }

    /// Its range in the text.
    pub(super) fn range(self) -> std::ops::Range<usize> {
        let bytes = self.json.text.as_bytes();
        // Down to the last nested value, and out again past the closing brackets.
        let (mut last, mut depth) = (self, 0);
        while let b'{' | b'[' = last.first_byte() {
            depth += 1;
            match last.values().last() {
                Some(inner) => last = inner,
                None => break,
            }
        }
        let mut end = match last.first_byte() {
            b'{' | b'[' => last.start() + 1,
            b'"' => last.start() + 2 + last.raw_string().len(),
            _ => last.start() + last.scalar().len(),
        };
        for _ in 0..depth {
            while !matches!(bytes.get(end), Some(b'}' | b']') | None) {
                end += 1;
            }
            end += 1;
        }
        self.start()..end
    }

    /// What it is, for errors.
    fn said(self) -> String {
        const LONGEST: usize = 40;
        match self.first_byte() {
            b'{' => "an object".to_owned(),
            b'[' => "an array".to_owned(),
            b'"' => {
                let text = self.raw_string();
                let short: String = text.chars().take(LONGEST).collect();
                if short.len() < text.len() { format!("{}…", quoted(&short)) } else { quoted(&short) }
            }
            _ => {
                let scalar = self.scalar();
                scalar.get(..LONGEST).map_or_else(|| scalar.to_owned(), |short| format!("{short}…"))
            }
        }
    }

    /// A number or a keyword, verbatim.
    fn scalar(self) -> &'a str {
        let rest = &self.json.text[self.start()..];
        let ends = |b: u8| matches!(b, b',' | b']' | b'}' | b' ' | b'\t' | b'\n' | b'\r');
        &rest[..rest.bytes().position(ends).unwrap_or(rest.len())]
    }

    /// The contents of a string, with escapes.
    fn raw_string(self) -> &'a str {
        let rest = &self.json.text[self.start() + 1..];
        let mut escaped = false;
        let end = rest.bytes().position(|b| {
            let ends = b == b'"' && !escaped;
            escaped = b == b'\\' && !escaped;
            ends
        });
        &rest[..end.unwrap_or(rest.len())]
    }

    fn unescaped(self) -> Cow<'a, str> {
        let raw = self.raw_string();
        if raw.contains('\\') { Cow::Owned(unescape(raw)) } else { Cow::Borrowed(raw) }
    }

    /// The JSON pointer.
    pub(super) fn pointer(self) -> String {
        let holders = self.json.holders();
        let mut path = vec![];
        let mut here = self.at;
        while here != 0 {
            let holder = holders[here as usize];
            path.push(holder);
            here = holder.container;
        }
        let mut pointer = String::new();
        for Holder { container, number } in path.into_iter().rev() {
            if self.entry(container).first_byte() == b'{' {
                let key = self.entry(number).unescaped();
                let _ = write!(pointer, "/{}", key.replace('~', "~0").replace('/', "~1"));
            } else {
                let _ = write!(pointer, "/{number}");
            }
        }
        pointer
    }

    /// The place, with the JSON pointer.
    pub(super) fn place(self) -> Place {
        let json = self.json;
        match json.within {
            Some(start) => Place::binary(json.name.clone(), start + self.start() as u64, self.pointer()),
            None => json
                .places
                .place(json.name.clone(), json.text.as_bytes(), self.start())
                .with_path(self.pointer()),
        }
    }

    /// An error at this value.
    pub(super) fn wrong(self, message: impl Into<String>) -> Diagnostic {
        Diagnostic::error(message).at(self.place())
    }

    /// An error: it is not as expected.
    pub(super) fn unexpected(self, message: &str, expected: &str) -> FormatError {
        self.wrong(message).found(self.said()).expected(expected).into()
    }

    /// A warning at this value.
    pub(super) fn warn(self, diagnostics: &mut Diagnostics, message: &str) {
        diagnostics.warn(message, |warning| warning.at(self.place()));
    }

    fn values(self) -> impl Iterator<Item = Self> {
        let mut at = self.at + 1;
        let end = self.next();
        std::iter::from_fn(move || {
            (at < end).then(|| {
                let value = self.entry(at);
                at = value.next();
                value
            })
        })
    }

    fn pairs(self) -> impl Iterator<Item = (Self, Self)> {
        let mut values = self.values();
        std::iter::from_fn(move || Some((values.next()?, values.next()?)))
    }

    /// Itself, if it is an object.
    pub(super) fn object(self) -> Read<Self> {
        if self.first_byte() == b'{' { Ok(self) } else { Err(self.unexpected("wrong type", "an object")) }
    }

    /// The members of an object, or the elements of an array; empty for others.
    pub(super) fn inside(self) -> impl Iterator<Item = Inside<'a>> {
        let is_object = self.first_byte() == b'{';
        let mut values = self.values();
        std::iter::from_fn(move || {
            if !is_object {
                return values.next().map(|value| (None, value));
            }
            let key = values.next()?;
            Some((Some(key.unescaped()), values.next()?))
        })
    }

    /// The members of an object: names and values.
    pub(super) fn members(self) -> Read<impl Iterator<Item = (Cow<'a, str>, Self)>> {
        self.object()?;
        Ok(self.pairs().map(|(key, value)| (key.unescaped(), value)))
    }

    /// The member of an object with this name.
    pub(super) fn get(self, name: &str) -> Read<Option<Self>> {
        self.object()?;
        let mut found: Option<Self> = None;
        for (key, value) in self.pairs() {
            let raw = key.raw_string();
            let same = if raw.contains('\\') { key.unescaped() == name } else { raw == name };
            if same {
                if found.is_some() {
                    return Err(key.wrong("second member of this name").found(quoted(name)).into());
                }
                found = Some(value);
            }
        }
        Ok(found)
    }

    /// The required member of an object with this name.
    pub(super) fn need(self, name: &str) -> Read<Self> {
        self.get(name)?.ok_or_else(|| self.wrong(format!("{} is missing", quoted(name))).into())
    }

    /// The elements of an array.
    pub(super) fn array(self) -> Read<impl Iterator<Item = Self>> {
        if self.first_byte() == b'[' {
            Ok(self.values())
        } else {
            Err(self.unexpected("wrong type", "an array"))
        }
    }

    /// The numbers of an array of this length.
    pub(super) fn numbers<const N: usize>(self) -> Read<[f64; N]> {
        let expected = || self.unexpected("wrong type", &format!("an array of {N} numbers"));
        let mut values = self.array().map_err(|_| expected())?;
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = values.next().ok_or_else(expected)?.number()?;
        }
        if values.next().is_some() { Err(expected()) } else { Ok(numbers) }
    }

    /// A finite number.
    pub(super) fn number(self) -> Read<f64> {
        let number = match self.first_byte() {
            b'-' | b'0'..=b'9' => self.scalar().parse::<f64>().ok(),
            _ => return Err(self.unexpected("wrong type", "a number")),
        };
        number.filter(|n| n.is_finite()).ok_or_else(|| self.unexpected("number too large", "a finite number"))
    }

    /// An integer of at least `least` and below 2⁵³.
    pub(super) fn whole(self, least: u64) -> Read<u64> {
        const MOST: f64 = (1_u64 << 53) as f64;
        let number = self.number()?;
        if number.fract() == 0.0 && least as f64 <= number && number < MOST {
            return Ok(number as u64);
        }
        let expected = format!("a whole number, {least} or more");
        Err(self.unexpected("wrong number", &expected))
    }

    /// An index into a list of `count` elements; `what` names one.
    pub(super) fn index(self, count: usize, what: &str) -> Read<usize> {
        let index = self.whole(0)?;
        match usize::try_from(index) {
            Ok(index) if index < count => Ok(index),
            _ => {
                let noun = what.trim_start_matches("an ").trim_start_matches("a ");
                let wrong = self.wrong(format!("there is no {noun} {index}"));
                Err(match count {
                    0 => wrong.expected("no index: there are none"),
                    1 => wrong.expected("0"),
                    _ => wrong.expected(format!("0 to {}", count - 1)),
                }
                .into())
            }
        }
    }

    /// A Boolean.
    pub(super) fn bool(self) -> Read<bool> {
        match self.first_byte() {
            b't' => Ok(true),
            b'f' => Ok(false),
            _ => Err(self.unexpected("wrong type", "true or false")),
        }
    }

    /// A string.
    pub(super) fn string(self) -> Read<Cow<'a, str>> {
        if self.first_byte() == b'"' {
            Ok(self.unescaped())
        } else {
            Err(self.unexpected("wrong type", "a string"))
        }
    }

    /// A number in a range, or `default` if the object has no such member.
    pub(super) fn number_or(
        self,
        name: &str,
        default: f64,
        range: std::ops::RangeInclusive<f64>,
    ) -> Read<f64> {
        let Some(value) = self.get(name)? else { return Ok(default) };
        let number = value.number()?;
        if range.contains(&number) {
            return Ok(number);
        }
        let expected = match (*range.start(), *range.end()) {
            (low, f64::INFINITY) => format!("{low} or more"),
            (f64::NEG_INFINITY, high) => format!("{high} or less"),
            (low, high) => format!("a number from {low} to {high}"),
        };
        Err(value.unexpected("number out of range", &expected))
    }

    /// Numbers in a range, or `default` if the object has no such member.
    pub(super) fn numbers_or<const N: usize>(
        self,
        name: &str,
        default: [f64; N],
        range: std::ops::RangeInclusive<f64>,
    ) -> Read<[f64; N]> {
        let Some(value) = self.get(name)? else { return Ok(default) };
        let numbers = value.numbers::<N>()?;
        if numbers.iter().all(|n| range.contains(n)) {
            return Ok(numbers);
        }
        let expected = format!("numbers from {} to {}", range.start(), range.end());
        let wrong = value
            .wrong("number out of range")
            .found(format!("[{}]", numbers.map(|number| number.to_string()).join(", ")));
        Err(wrong.expected(expected).into())
    }

    /// A Boolean, or `default`.
    pub(super) fn bool_or(self, name: &str, default: bool) -> Read<bool> {
        self.get(name)?.map_or(Ok(default), Self::bool)
    }

    /// A string, if present.
    pub(super) fn string_at(self, name: &str) -> Read<Option<Cow<'a, str>>> {
        self.get(name)?.map(Self::string).transpose()
    }

    /// The extension with this name.
    pub(super) fn extension(self, name: &str) -> Read<Option<Self>> {
        let Some(extensions) = self.get("extensions")? else { return Ok(None) };
        let extension = extensions.get(name)?;
        extension.map(Self::object).transpose()
    }
}

/// Escapes resolved; unpaired surrogates become U+FFFD.
fn unescape(raw: &str) -> String {
    let mut text = String::with_capacity(raw.len());
    let mut rest = raw.chars();
    let mut high: Option<u32> = None;
    let unit = |rest: &mut std::str::Chars<'_>| {
        (0..4).fold(0, |n, _| n * 16 + rest.next().and_then(|c| c.to_digit(16)).unwrap_or(0))
    };
    while let Some(c) = rest.next() {
        let c = match c {
            '\\' => match rest.next() {
                Some('b') => '\u{8}',
                Some('f') => '\u{C}',
                Some('n') => '\n',
                Some('r') => '\r',
                Some('t') => '\t',
                Some('u') => {
                    let unit = unit(&mut rest);
                    match (high.take(), unit) {
                        (Some(first), 0xDC00..0xE000) => {
                            let code = 0x1_0000 + ((first - 0xD800) << 10) + (unit - 0xDC00);
                            char::from_u32(code).unwrap_or('\u{FFFD}')
                        }
                        (before, 0xD800..0xDC00) => {
                            if before.is_some() {
                                text.push('\u{FFFD}');
                            }
                            high = Some(unit);
                            continue;
                        }
                        (before, _) => {
                            if before.is_some() {
                                text.push('\u{FFFD}');
                            }
                            char::from_u32(unit).unwrap_or('\u{FFFD}')
                        }
                    }
                }
                Some(other) => other,
                None => break,
            },
            other => other,
        };
        if high.take().is_some() {
            text.push('\u{FFFD}');
        }
        text.push(c);
    }
    if high.is_some() {
        text.push('\u{FFFD}');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Limits;

    fn read(text: &str) -> Read<String> {
        let budget = Budget::default();
        let json = Json::read(text, &"a.gltf".into(), None, &budget)?;
        Ok(json.root().said())
    }

    #[test]
    fn values_are_found_by_name_and_know_their_pointers() {
        let text = r#" {"a": [1, {"b/~": -2.5e1, "t": true}, [], {}], "\u0063": "x\n\ud83d\ude00\ud800"} "#;
        let budget = Budget::default();
        let json = Json::read(text, &"a.gltf".into(), None, &budget).unwrap();
        let root = json.root();
        let a: Vec<Value<'_>> = root.need("a").unwrap().array().unwrap().collect();
        assert_eq!(a.len(), 4);
        assert_eq!(a[0].whole(0).unwrap(), 1);
        let b = a[1].need("b/~").unwrap();
        assert_eq!(b.number().unwrap(), -25.0);
        assert_eq!(b.pointer(), "/a/1/b~1~0");
        assert!(a[1].need("t").unwrap().bool().unwrap());
        assert_eq!(a[3].pointer(), "/a/3");
        assert_eq!(root.need("c").unwrap().string().unwrap(), "x\n😀\u{FFFD}");
        assert_eq!(root.pointer(), "");
        let error = b.index(3, "a mesh").unwrap_err().to_string();
        let expected =
            "a.gltf:1:20 /a/1/b~1~0: wrong number (found -2.5e1; expected a whole number, 0 or more)";
        assert_eq!(error, expected);
    }

    #[test]
    fn wrong_json_is_refused_with_its_place() {
        let cases = [
            ("", "a.gltf:1:1: wrong JSON (found the end of the text; expected a value)"),
            ("{", "a.gltf:1:2: wrong JSON (found the end of the text; expected a name in quotes)"),
            ("{\"a\" 1}", "a.gltf:1:6: wrong JSON (found \"1\"; expected ':')"),
            ("{\"a\":1,}", "a.gltf:1:8: wrong JSON (found \"}\"; expected a name in quotes)"),
            ("[1,\n 2 é]", "a.gltf:2:4: wrong JSON (found \"é\"; expected ',' or ']')"),
            ("[1}", "a.gltf:1:3: wrong JSON (found \"}\"; expected ',' or ']')"),
            ("[01]", "a.gltf:1:3: wrong JSON (found \"1\"; expected ',' or ']')"),
            ("[1.]", "a.gltf:1:4: wrong JSON number (found \"]\"; expected a digit)"),
            ("[-]", "a.gltf:1:3: wrong JSON number (found \"]\"; expected a digit)"),
            ("[NaN]", "a.gltf:1:2: wrong JSON (found \"N\"; expected a value)"),
            ("\"a", "a.gltf:1:3: JSON string without end (found the end of the text; expected '\"')"),
            ("\"\\x\"", "a.gltf:1:3: wrong escape in a JSON string (found \"x\")"),
            ("1 2", "a.gltf:1:3: wrong JSON (found \"2\"; expected nothing after the value)"),
        ];
        for (text, expected) in cases {
            assert_eq!(read(text).unwrap_err().to_string(), expected, "{text}");
        }
        assert!(read("\"a\nb\"").unwrap_err().to_string().contains("control character"));
        assert!(read("[1e400]").is_ok(), "a number is looked at when it is used");
    }

    #[test]
    fn nesting_is_limited_and_costs_no_stack() {
        let deep = "[".repeat(1_000_000);
        let error = read(&deep).unwrap_err().to_string();
        assert!(error.contains("--max-nesting"), "{error}");
        let budget = Budget::new(Limits { nesting: 2_000_000, ..Limits::default() });
        let closed = format!("{deep}{}", "]".repeat(1_000_000));
        assert!(Json::read(&closed, &"a.gltf".into(), None, &budget).is_ok());
    }

    #[test]
    fn the_table_takes_little_memory() {
        let budget = Budget::default();
        let text = format!("[{}0]", "0,".repeat(500_000));
        Json::read(&text, &"a.gltf".into(), None, &budget).unwrap();
        assert!(budget.memory_peak() < 16 * text.len() as u64, "{}", budget.memory_peak());
    }

    #[test]
    fn a_name_that_is_there_twice_is_an_error() {
        let budget = Budget::default();
        let json = Json::read(r#"{"a":1,"\u0061":2}"#, &"a.gltf".into(), None, &budget).unwrap();
        let error = json.root().get("a").unwrap_err().to_string();
        assert_eq!(error, "a.gltf:1:8 /a: second member of this name (found \"a\")");
    }
}
