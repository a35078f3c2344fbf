//! The lines and words of OBJ and MTL files, with their places.

use std::borrow::Cow;
use std::sync::Arc;

use crate::diagnostic::{Diagnostic, FormatError, Place, TextPlaces, quoted_bytes};

/// A text file of lines of words. `\` at the end of a line continues it on the next, and `#` at the start of a
/// word begins a comment.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub name: &'a Arc<str>,
    pub bytes: &'a [u8],
    pub places: &'a TextPlaces,
}

/// A line: its offset and its bytes, without the line end.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub start: usize,
    bytes: &'a [u8],
}

/// A word: its offset and its bytes.
#[derive(Clone, Copy)]
pub(super) struct Word<'a> {
    pub start: usize,
    pub bytes: &'a [u8],
}

impl<'a> Source<'a> {
    pub(super) fn place(&self, at: usize) -> Place {
        self.places.place(self.name.clone(), self.bytes, at)
    }

    pub(super) fn wrong(&self, word: Word<'_>, message: impl Into<String>) -> Diagnostic {
        Diagnostic::error(message).at(self.place(word.start)).found(quoted_bytes(word.bytes))
    }

    pub(super) fn lines(self) -> impl Iterator<Item = Line<'a>> {
        // Files of old Macs have CR only.
        let end = if self.bytes.contains(&b'\n') || !self.bytes.contains(&b'\r') { b'\n' } else { b'\r' };
        let mut at = if self.bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
        std::iter::from_fn(move || {
            if at >= self.bytes.len() {
                return None;
            }
            let start = at;
            loop {
                let length = self.bytes[at..].iter().position(|&b| b == end);
                let stop = length.map_or(self.bytes.len(), |length| at + length);
                at = stop + 1;
                let line = &self.bytes[start..stop];
                let line = line.strip_suffix(b"\r").unwrap_or(line);
                if length.is_none() || !line.ends_with(b"\\") {
                    return Some(Line { start, bytes: line });
                }
            }
        })
    }

    /// A number, finite or not.
    pub(super) fn number(&self, word: Word<'_>) -> Result<f64, FormatError> {
        let parsed = std::str::from_utf8(word.bytes).ok().and_then(|text| text.parse().ok());
        parsed.ok_or_else(|| self.wrong(word, "not a number").into())
    }
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | 0x0B | 0x0C)
}

impl<'a> Line<'a> {
    pub(super) fn words(self) -> Words<'a> {
        Words { line: self, at: 0 }
    }
}

#[derive(Clone)]
pub(super) struct Words<'a> {
    line: Line<'a>,
    at: usize,
}

impl<'a> Words<'a> {
    /// Whether a `\` at `i` joins two lines.
    fn joins(&self, i: usize) -> bool {
        let rest = &self.line.bytes[i..];
        rest.starts_with(b"\\\n") || rest.starts_with(b"\\\r")
    }

    fn skip_blanks(&mut self) {
        let bytes = self.line.bytes;
        while self.at < bytes.len() && (is_blank(bytes[self.at]) || self.joins(self.at)) {
            self.at += 1;
        }
    }

    /// The rest of the line as a name: trimmed, and without a comment that follows a space.
    pub(super) fn rest(mut self) -> (usize, Cow<'a, str>) {
        self.skip_blanks();
        let bytes = &self.line.bytes[self.at..];
        let comment = (0..bytes.len()).find(|&i| bytes[i] == b'#' && (i == 0 || is_blank(bytes[i - 1])));
        let name = bytes[..comment.unwrap_or(bytes.len())].trim_ascii_end();
        (self.line.start + self.at, String::from_utf8_lossy(name))
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = Word<'a>;

    #[inline]
    fn next(&mut self) -> Option<Word<'a>> {
        self.skip_blanks();
        let bytes = self.line.bytes;
        let start = self.at;
        if start == bytes.len() || bytes[start] == b'#' {
            return None;
        }
        while self.at < bytes.len()
            && !is_blank(bytes[self.at])
            && !(bytes[self.at] == b'\\' && self.joins(self.at))
        {
            self.at += 1;
        }
        Some(Word { start: self.line.start + start, bytes: &bytes[start..self.at] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &[u8]) -> Vec<Vec<String>> {
        let name = "w".into();
        let places = TextPlaces::default();
        let word = |w: Word<'_>| String::from_utf8_lossy(w.bytes).into_owned();
        Source { name: &name, bytes: text, places: &places }
            .lines()
            .map(|l| l.words().map(word).collect())
            .collect()
    }

    #[test]
    fn lines_end_in_every_way_and_go_on_after_a_backslash() {
        assert_eq!(words(b"a b\r\nc  d\n"), [["a", "b"], ["c", "d"]]);
        assert_eq!(words(b"a b\rc\td"), [["a", "b"], ["c", "d"]]);
        assert_eq!(words(b"f 1 \\\n 2 \\\r\n 3\nf 4"), [vec!["f", "1", "2", "3"], vec!["f", "4"]]);
        assert_eq!(words(b"f 1\\\n2"), [["f", "1", "2"]]);
        assert_eq!(words(b"\xEF\xBB\xBFv 1 # 2\n# v 3\nv a#b"), [vec!["v", "1"], vec![], vec!["v", "a#b"]]);
        assert_eq!(words(b"map a\\b.png \\"), [["map", "a\\b.png", "\\"]]);
    }

    #[test]
    fn names_may_have_blanks() {
        let name = "w".into();
        let rest = |text: &[u8]| {
            let places = TextPlaces::default();
            let line = Source { name: &name, bytes: text, places: &places }.lines().next().unwrap();
            let mut words = line.words();
            words.next();
            let (at, rest) = words.rest();
            (at, rest.into_owned())
        };
        assert_eq!(rest(b"usemtl  red  car \t"), (8, "red  car".into()));
        assert_eq!(rest(b"usemtl car#1 # mine"), (7, "car#1".into()));
        assert_eq!(rest(b"usemtl"), (6, String::new()));
    }
}
