//! How many digits an explanation has.

use super::document::{Item, Section, Value};
use super::numbers;

/// How many digits the numbers of an explanation have. Formulas with numbers in them have six at most in any case, and
/// JSON always has all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Digits {
    /// As many as it takes to read back the same number.
    #[default]
    Full,
    /// At most this many, from 1 to 17.
    AtMost(usize),
}

/// Reads `full` or a number of digits.
///
/// # Errors
/// What is accepted.
pub(super) fn digits(text: &str) -> Result<Digits, String> {
    if text == "full" {
        return Ok(Digits::Full);
    }
    let count = text.parse().ok().filter(|count| (1..=17).contains(count));
    count.map(Digits::AtMost).ok_or_else(|| "expected full, or a whole number from 1 to 17".to_owned())
}

impl Digits {
    /// The section with its numbers rounded.
    pub(super) fn rounded(self, mut section: Section) -> Section {
        let Self::AtMost(count) = self else { return section };
        section.title = in_sentence(&section.title, count);
        for item in &mut section.items {
            match item {
                Item::Quantity(quantity) => {
                    quantity.is_rounded = round(&mut quantity.value, count);
                    if let Some(theirs) = &mut quantity.schoolbook
                        && round(&mut theirs.value, count)
                    {
                        theirs.sign = "≈";
                    }
                }
                Item::Text(text) | Item::Remark(text) => *text = in_sentence(text, count),
                Item::Table { rows, .. } => rows.iter_mut().flatten().for_each(|cell| {
                    round(cell, count);
                }),
                Item::Figure(_) => {}
            }
        }
        section.sections = section.sections.into_iter().map(|inner| self.rounded(inner)).collect();
        section
    }
}

/// Rounds a value, and says whether that changed it.
fn round(value: &mut Value, count: usize) -> bool {
    let before = value.clone();
    let number = |x: &mut f64| *x = numbers::rounded(*x, count);
    let single = |x: &mut f32| *x = numbers::rounded(f64::from(*x), count) as f32;
    match value {
        Value::Number(x) => number(x),
        Value::Single(x) => single(x),
        Value::Vector(v) => v.as_mut().iter_mut().for_each(number),
        Value::Colour(rgb) => rgb.iter_mut().for_each(single),
        Value::Numbers(numbers) => numbers.iter_mut().for_each(number),
        Value::Intervals(intervals) => intervals.iter_mut().flatten().for_each(number),
        Value::Matrix(m) => m.as_mut().as_mut().iter_mut().for_each(number),
        Value::Text(text) => *text = in_sentence(text, count),
    }
    *value != before
}

/// A sentence with the numbers in it rounded, other than those in names and in quotes.
fn in_sentence(text: &str, count: usize) -> String {
    let mut out = String::with_capacity(text.len());
    let (mut is_quoted, mut last) = (false, ' ');
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let begins = c.is_ascii_digit() && !is_quoted && !last.is_alphanumeric() && !"._".contains(last);
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let (mut word, mut after) = rest.split_at(if begins { end } else { c.len_utf8() });
        if begins {
            // A dot at the end is that of the sentence.
            word = word.trim_end_matches('.');
            after = &rest[word.len()..];
            let exponent = after.strip_prefix('e').map(|rest| rest.strip_prefix('-').unwrap_or(rest));
            if let Some(exponent) = exponent.filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit())) {
                let end = exponent.find(|c: char| !c.is_ascii_digit()).unwrap_or(exponent.len());
                let length = rest.len() - exponent.len() + end;
                (word, after) = rest.split_at(length);
            }
            let is_name = after.starts_with(|c: char| c.is_alphanumeric() || c == '_');
            match word.parse() {
                Ok(x) if word.contains('.') && !is_name => out += &numbers::exact(numbers::rounded(x, count)),
                _ => out += word,
            }
        } else {
            out += word;
        }
        is_quoted ^= c == '"';
        last = word.chars().next_back().unwrap_or(' ');
        rest = after;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_sentences_are_rounded_and_names_are_not() {
        for (text, expected) in [
            ("crossing at t = 2.8284271247461903", "crossing at t = 2.82843"),
            ("(-0.12345678, 3, 1.5).", "(-0.123457, 3, 1.5)."),
            ("between 1.23456789e-7 and 12345678", "between 1.23457e-7 and 12345678"),
            ("material \"wood 1.23456789\" (v1.23456789)", "material \"wood 1.23456789\" (v1.23456789)"),
            ("It costs 0.30000000000000004. No 1.2345678px", "It costs 0.3. No 1.2345678px"),
            ("√2 ≈ 1.4142135623730951°", "√2 ≈ 1.41421°"),
            ("", ""),
        ] {
            assert_eq!(in_sentence(text, 6), expected);
        }
    }

    #[test]
    fn digits_are_a_count_or_full() {
        assert_eq!((digits("full"), digits("6")), (Ok(Digits::Full), Ok(Digits::AtMost(6))));
        for text in ["0", "18", "", "six", "-3"] {
            assert!(digits(text).is_err(), "{text}");
        }
        let mut third = Value::Number(1.0 / 3.0);
        assert!(round(&mut third, 6) && third == Value::Number(0.333333));
        assert!(!round(&mut Value::Colour([0.5, 0.25, f32::INFINITY]), 3));
    }
}
