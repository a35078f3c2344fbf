//! The values of a PLY file, text or binary.

use super::header::Number;
use crate::diagnostic::quoted_bytes;

/// An error at a byte; the caller adds the element.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) at: usize,
    pub(super) message: &'static str,
    pub(super) found: String,
}

pub(super) type Read<T> = Result<T, Box<Fault>>;

/// A reader of the body's numbers.
pub(super) trait Source: Copy {
    fn at(&self) -> usize;
    fn left(&self) -> usize;
    /// The next number. Integers are exact.
    fn number(&mut self, number: Number) -> Read<f64>;
    /// Skips numbers.
    fn skip(&mut self, number: Number, count: u64) -> Read<()>;

    /// A list's length, checked against the rest of the file.
    fn length(&mut self, number: Number, item: Number) -> Read<usize>;
}

#[derive(Clone, Copy)]
pub(super) struct Text<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Text<'a> {
    pub(super) fn word(&mut self) -> Read<&'a [u8]> {
        let blank = |b: &u8| matches!(b, b' ' | b'\t' | b'\n' | b'\r' | 0x0B | 0x0C);
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !blank(b)).unwrap_or(rest.len());
        let rest = &rest[start..];
        let length = rest.iter().position(blank).unwrap_or(rest.len());
        self.at += start;
        if length == 0 {
            return Err(Box::new(Fault {
                at: self.at,
                message: "file is truncated",
                found: "the end of the file".into(),
            }));
        }
        self.at += length;
        Ok(&rest[..length])
    }
}

impl Source for Text<'_> {
    fn at(&self) -> usize {
        self.at
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    #[inline]
    fn number(&mut self, number: Number) -> Read<f64> {
        let word = self.word()?;
        let parsed = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok());
        // Integers may be written as 3.0, as some programs do.
        let parsed = parsed.filter(|v| number.is_float() || v.fract() == 0.0);
        parsed.ok_or_else(|| {
            let message = if number.is_float() { "not a number" } else { "not a whole number" };
            Box::new(Fault { at: self.at - word.len(), message, found: quoted_bytes(word) })
        })
    }

    fn skip(&mut self, _: Number, count: u64) -> Read<()> {
        (0..count).try_for_each(|_| self.word().map(drop))
    }

    fn length(&mut self, number: Number, _: Number) -> Read<usize> {
        let start = *self;
        let length = self.number(number)?;
        checked_length(length, self.left() / 2 + 1).ok_or_else(|| {
            let mut start = start;
            let word = start.word().unwrap_or_default();
            Box::new(Fault { at: start.at - word.len(), message: WRONG_LENGTH, found: quoted_bytes(word) })
        })
    }
}

pub(super) const WRONG_LENGTH: &str = "a list's length is negative or more than the file holds";

pub(super) fn checked_length(length: f64, most: usize) -> Option<usize> {
    (0.0 <= length && length <= most as f64).then_some(length as usize)
}

#[derive(Clone, Copy)]
pub(super) struct Binary<'a, const BIG: bool> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<const BIG: bool> Binary<'_, BIG> {
    #[inline]
    pub(super) fn take<const N: usize>(&mut self) -> Read<[u8; N]> {
        let Some(&taken) = self.bytes[self.at..].first_chunk::<N>() else {
            let (at, found) = (self.bytes.len(), format!("{} bytes", self.left()));
            return Err(Box::new(Fault { at, message: "file is truncated", found }));
        };
        self.at += N;
        Ok(taken)
    }
}

impl<const BIG: bool> Source for Binary<'_, BIG> {
    fn at(&self) -> usize {
        self.at
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    #[inline]
    fn number(&mut self, number: Number) -> Read<f64> {
        macro_rules! take {
            ($T:ty) => {{
                let bytes = self.take()?;
                f64::from(if BIG { <$T>::from_be_bytes(bytes) } else { <$T>::from_le_bytes(bytes) })
            }};
        }
        Ok(match number {
            Number::I8 => take!(i8),
            Number::U8 => take!(u8),
            Number::I16 => take!(i16),
            Number::U16 => take!(u16),
            Number::I32 => take!(i32),
            Number::U32 => take!(u32),
            Number::F32 => take!(f32),
            Number::F64 => take!(f64),
        })
    }

    fn skip(&mut self, number: Number, count: u64) -> Read<()> {
        let bytes = count.saturating_mul(number.bytes() as u64);
        if bytes > self.left() as u64 {
            let (at, found) = (self.bytes.len(), format!("{} bytes", self.left()));
            return Err(Box::new(Fault { at, message: "file is truncated", found }));
        }
        self.at += bytes as usize;
        Ok(())
    }

    fn length(&mut self, number: Number, item: Number) -> Read<usize> {
        let at = self.at;
        let length = self.number(number)?;
        checked_length(length, self.left() / item.bytes())
            .ok_or_else(|| Box::new(Fault { at, message: WRONG_LENGTH, found: length.to_string() }))
    }
}
