//! Rays and points as comma-separated text.

use lumbre::Ray;
use lumbre::formats::diagnostic::quoted;

use super::bytes::Bytes;
use super::rays::{Piece, Rows};
use crate::failure::Failure;

/// Reads the lines of a text.
pub(super) struct TextReader {
    bytes: Bytes,
    header: Header,
    /// Rays that were read.
    rays: u64,
    /// Lines that were read.
    lines: u64,
    /// What is wrong behind the last piece: what is wrong in it comes first.
    failure: Option<Failure>,
}

/// The longest line, so that one without an end does not fill memory.
const LONGEST: usize = 1 << 16;
/// What a piece of text may hold a ray, on the whole.
const BYTES_A_RAY: usize = 1 << 10;

impl TextReader {
    /// Reads the header.
    ///
    /// # Errors
    /// [`Failure`] when it is wrong.
    pub(super) fn new(bytes: Bytes, rows: Rows) -> Result<Self, Failure> {
        let mut this = Self { bytes, header: Header::default(), rays: 0, lines: 0, failure: None };
        let mut line = Vec::new();
        while let Some(text) = this.read_line(&mut line)? {
            let text = text.strip_prefix('\u{feff}').filter(|_| this.lines == 1).unwrap_or(text);
            if !text.trim().is_empty() {
                this.header =
                    Header::parse(text, rows).map_err(|wrong| place(this.name(), this.lines, wrong))?;
                return Ok(this);
            }
            line.clear();
        }
        let what = format!("no {} (expected a header among {})", rows.name(), rows.columns().join(","));
        Err(place(this.name(), 1, (1, what)))
    }

    /// The name for messages.
    pub(super) fn name(&self) -> &str {
        self.bytes.name()
    }

    /// What the lines hold.
    pub(super) fn header(&self) -> &Header {
        &self.header
    }

    /// The share that was read, in [0, 1].
    pub(super) fn fraction(&self) -> Option<f64> {
        self.bytes.fraction()
    }

    /// The next lines.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be read or are not text.
    pub(super) fn next(&mut self, most: usize) -> Result<Option<Piece>, Failure> {
        let (first_ray, line) = (self.rays, self.lines + 1);
        let mut bytes = Vec::new();
        let mut count = 0;
        while self.failure.is_none() && count < most && bytes.len() < most * BYTES_A_RAY {
            let end = bytes.len();
            match self.read_line(&mut bytes) {
                Ok(Some(line)) => count += usize::from(!line.trim().is_empty()),
                Ok(None) => break,
                Err(failure) => {
                    bytes.truncate(end);
                    self.failure = Some(failure);
                }
            }
        }
        if bytes.is_empty() {
            return self.failure.take().map_or(Ok(None), Err);
        }
        self.rays += count as u64;
        Ok(Some(Piece { first_ray, bytes, line }))
    }

    /// Appends a line to `text` and answers it, with its end.
    fn read_line<'t>(&mut self, text: &'t mut Vec<u8>) -> Result<Option<&'t str>, Failure> {
        let start = text.len();
        // One more, so that the longest line shows its end.
        if self.bytes.read_line(LONGEST + 1, text)? == 0 {
            return Ok(None);
        }
        self.lines += 1;
        let line = &text[start..];
        match std::str::from_utf8(line) {
            // The end of a piece may cut a letter.
            Err(e) if e.error_len().is_some() || line.len() <= LONGEST => {
                let what = "not text (expected CSV in UTF-8, or a .npy array)";
                Err(Failure::input(format!("{}:{}: {what}", self.name(), self.lines)))
            }
            Ok(line) if line.len() <= LONGEST || line.ends_with('\n') => Ok(Some(line)),
            _ => {
                let what = format!("a line of more than {LONGEST} bytes (expected up to 8 numbers)");
                Err(place(self.name(), self.lines, (LONGEST + 1, what)))
            }
        }
    }
}

/// The rays, or points, of some lines.
///
/// # Errors
/// [`Failure::Input`] with the line and column of what is wrong.
pub(super) fn rays(name: &str, header: &Header, piece: &Piece) -> Result<Vec<Ray>, Failure> {
    let text = std::str::from_utf8(&piece.bytes).map_err(|e| Failure::input(format!("{name}: {e}")))?;
    (piece.line..)
        .zip(text.lines())
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(number, line)| header.ray(line).map_err(|wrong| place(name, number, wrong)))
        .collect()
}

/// What is wrong with a line: the column, from 1, and words.
type Wrong = (usize, String);

fn place(name: &str, line: u64, (column, what): Wrong) -> Failure {
    Failure::input(format!("{name}:{line}:{column}: {what}"))
}

/// The numbers of a ray that the lines hold, by the header.
#[derive(Clone, Debug, Default)]
pub(super) struct Header {
    rows: Rows,
    /// Where in a line each of the columns stands.
    place: [Option<usize>; 8],
    width: usize,
}

impl Header {
    /// Reads the header.
    ///
    /// # Errors
    /// Unknown, repeated and missing columns.
    fn parse(line: &str, rows: Rows) -> Result<Self, Wrong> {
        let columns = rows.columns();
        let mut place = [None; 8];
        for (i, (column, name)) in fields(line).enumerate() {
            let Some(known) = columns.iter().position(|known| *known == name) else {
                let expected = columns.join(",");
                return Err((column, format!("unknown column {} (expected {expected})", quoted(name))));
            };
            if place[known].replace(i).is_some() {
                return Err((column, format!("column {} appears twice", quoted(name))));
            }
        }
        if let Some(missing) = (0..rows.needed()).find(|i| place[*i].is_none()) {
            return Err((1, format!("no column \"{}\"", columns[missing])));
        }
        Ok(Self { rows, place, width: place.iter().flatten().count() })
    }

    /// Reads a ray, or a point.
    ///
    /// # Errors
    /// What is no number, and too many or too few of them.
    fn ray(&self, line: &str) -> Result<Ray, Wrong> {
        let mut values = [0.0; 8];
        let mut count = 0;
        for field in line.split(',') {
            // The column is counted only for who needs it.
            let column = || fields(line).nth(count).map_or(1, |(column, _)| column);
            if count == self.width {
                return Err((column(), format!("more than the {} values of the header", self.width)));
            }
            let field = unquoted(field.trim());
            values[count] = number(field).map_err(|expected| {
                (column(), format!("invalid value (found {}; expected {expected})", quoted(field)))
            })?;
            count += 1;
        }
        if count < self.width {
            return Err((line.len() + 1, format!("{count} values (expected {})", self.width)));
        }
        // The end of the range is the only number that is not zero where it is left out.
        let default = |column: usize| if column == 7 { f64::INFINITY } else { 0.0 };
        let value = |column: usize| self.place[column].map_or(default(column), |i| values[i]);
        Ok(self.rows.ray(value, true))
    }
}

/// A number in double precision, or what is expected instead: one that is too large or too small would become another
/// number.
fn number(field: &str) -> Result<f64, &'static str> {
    let value: f64 = field.parse().map_err(|_| "a number")?;
    let mantissa = field.split(['e', 'E']).next().unwrap_or(field);
    if value.is_infinite() && field.bytes().any(|b| b.is_ascii_digit()) {
        return Err("a number of double precision, at most 1.7976931348623157e308 in size");
    }
    if value == 0.0 && mantissa.bytes().any(|b| (b'1'..=b'9').contains(&b)) {
        return Err("a number of double precision, which does not become 0: 5e-324 is the smallest");
    }
    Ok(value)
}

/// The fields of a line with the column, from 1, where each begins.
fn fields(line: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut column = 1;
    line.split(',').map(move |field| {
        let start = column + field.chars().take_while(|c| c.is_whitespace()).count();
        column += field.chars().count() + 1;
        (start, unquoted(field.trim()))
    })
}

/// A field without the quotes that some programs put around each. No name and no number holds a comma or a quote.
fn unquoted(field: &str) -> &str {
    let inner = field.strip_prefix('"').and_then(|field| field.strip_suffix('"'));
    inner.map_or(field, str::trim)
}
