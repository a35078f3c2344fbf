//! Arrays in NumPy's .npy format, version 1.0 to 3.0, as far as lists of rays and answers need them.

use lumbre::Ray;

use super::rays::Rows;
use crate::failure::Failure;

/// What the header of an array of shape (N, M) of f4 or f8 says.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    /// Rows.
    pub rows: u64,
    /// Columns.
    pub columns: u64,
    /// Whether the whole first column stands before the second.
    pub columns_first: bool,
    /// The bytes before the data.
    pub length: u64,
    number: Number,
    shape: String,
}

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Number {
    size: usize,
    is_big_endian: bool,
}

/// Why there is no header.
#[derive(Debug)]
pub(super) enum HeaderError {
    /// The bytes cannot be read.
    Read(Failure),
    /// They say something wrong: the byte where it begins, what was found and what is accepted.
    Wrong(u64, String),
}

impl From<Failure> for HeaderError {
    fn from(failure: Failure) -> Self {
        Self::Read(failure)
    }
}

/// How every .npy file starts.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// The longest header that is read. NumPy itself takes no more than 10,000 bytes.
const LONGEST: usize = 1 << 20;

impl Header {
    /// Reads a header by `read`, which returns the requested number of bytes, fewer only at the end.
    ///
    /// # Errors
    /// [`HeaderError`].
    pub(super) fn read(mut read: impl FnMut(usize) -> Result<Vec<u8>, Failure>) -> Result<Self, HeaderError> {
        let wrong = |at: usize, what: &str| HeaderError::Wrong(at as u64, what.to_owned());
        if read(MAGIC.len())? != MAGIC {
            return Err(wrong(0, "not a .npy file (its first bytes are not \\x93NUMPY)"));
        }
        let version = read(2)?;
        let length = match version[..] {
            [1, _] => read(2)?.try_into().map(u16::from_le_bytes).map(usize::from).ok(),
            [2 | 3, _] => read(4)?.try_into().map(u32::from_le_bytes).map(|n| n as usize).ok(),
            _ => None,
        };
        let unknown = "unknown .npy version (expected 1.0, 2.0 or 3.0)";
        let length = length.ok_or_else(|| wrong(MAGIC.len(), unknown))?;
        let start = if version[0] == 1 { 10 } else { 12 };
        let text = read(length.min(LONGEST))?;
        if text.len() < length.min(LONGEST) {
            return Err(wrong(start + text.len(), "the .npy header is cut off"));
        }
        if LONGEST < length {
            let what = format!("a .npy header of {length} bytes (expected at most {LONGEST})");
            return Err(wrong(MAGIC.len() + 2, &what));
        }
        let text = std::str::from_utf8(&text)
            .map_err(|e| wrong(start + e.valid_up_to(), "the .npy header is not text"))?;
        let header =
            Self::parse(text).map_err(|(key, what)| wrong(start + text.find(key).unwrap_or(0), &what))?;
        Ok(Self { length: (start + length) as u64, ..header })
    }

    /// Reads the dictionary. What is wrong comes with the key that it belongs to.
    fn parse(header: &str) -> Result<Self, (&'static str, String)> {
        let entry = |key| entry(header, key).ok_or_else(|| (key, format!("the .npy header has no '{key}'")));
        let element = entry("descr")?.trim_matches(['\'', '"']);
        let (size, is_big_endian) = match element {
            "<f4" => (4, false),
            "<f8" => (8, false),
            ">f4" => (4, true),
            ">f8" => (8, true),
            _ => return Err(("descr", format!("element type {element} (expected f4 or f8)"))),
        };
        let shape = entry("shape")?;
        let sizes: Vec<u64> = shape
            .trim_matches(['(', ')'])
            .split(',')
            .map(str::trim)
            .filter(|size| !size.is_empty())
            .map(|size| size.parse().map_err(|_| ("shape", format!("shape {shape} (expected (N, M))"))))
            .collect::<Result<_, _>>()?;
        let &[rows, columns] = &sizes[..] else {
            return Err(("shape", format!("shape {shape} (expected two dimensions)")));
        };
        Ok(Self {
            rows,
            columns,
            columns_first: entry("fortran_order") == Ok("True"),
            length: 0,
            number: Number { size, is_big_endian },
            shape: format!("{shape} of {element}"),
        })
    }

    /// The bytes of a number.
    pub(super) fn number_size(&self) -> u64 {
        self.number.size as u64
    }

    /// The bytes of a row.
    pub(super) fn row_size(&self) -> u64 {
        self.columns.saturating_mul(self.number_size())
    }

    /// Checks that the data have the size that the shape implies.
    ///
    /// # Errors
    /// The byte of the file where data are missing, or are too many, and what was found.
    pub(super) fn check_size(&self, data: u64) -> Result<(), (u64, String)> {
        let size = self.rows.checked_mul(self.row_size());
        if size == Some(data) {
            return Ok(());
        }
        let at = self.length.saturating_add(size.unwrap_or(u64::MAX).min(data));
        Err((at, format!("{data} bytes of data for shape {}", self.shape)))
    }

    /// The rays, or points, of some rows. Where columns come first, those of all these rows do.
    pub(super) fn rays(&self, bytes: &[u8], rows: Rows) -> Vec<Ray> {
        match self.number {
            Number { size: 4, is_big_endian: false } => {
                self.rays_of(bytes, rows, |b| f64::from(f32::from_le_bytes(b)))
            }
            Number { size: 4, is_big_endian: true } => {
                self.rays_of(bytes, rows, |b| f64::from(f32::from_be_bytes(b)))
            }
            Number { is_big_endian: false, .. } => self.rays_of(bytes, rows, f64::from_le_bytes),
            Number { is_big_endian: true, .. } => self.rays_of(bytes, rows, f64::from_be_bytes),
        }
    }

    fn rays_of<const SIZE: usize>(
        &self,
        bytes: &[u8],
        rows: Rows,
        number: impl Fn([u8; SIZE]) -> f64,
    ) -> Vec<Ray> {
        let (numbers, _) = bytes.as_chunks::<SIZE>();
        let columns = self.columns as usize;
        let count = numbers.len() / columns;
        let ray = |row: usize| {
            let value = |i: usize| {
                number(numbers[if self.columns_first { i * count + row } else { row * columns + i }])
            };
            rows.ray(value, columns > rows.needed())
        };
        (0..count).map(ray).collect()
    }
}

/// The text of a value in the header's Python dictionary.
fn entry<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let at = header.find(&format!("'{key}'"))? + key.len() + 2;
    let value = header[at..].trim_start().strip_prefix(':')?.trim_start();
    let end = if value.starts_with('(') { value.find(')')? + 1 } else { value.find([',', '}'])? };
    Some(value[..end].trim())
}

/// The header of a list of `rows` elements of the NumPy type `descr`. For the types of answers it has the same length
/// whatever the number of rows.
pub(super) fn header(descr: &str, rows: u64) -> Vec<u8> {
    let mut text = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': ({rows},), }}");
    // The format wants data to begin at a multiple of 64, and the header to end in a line feed.
    let padding = 63 - (10 + text.len()) % 64;
    text.extend(std::iter::repeat_n(' ', padding));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use lumbre::DVec3;

    use super::*;

    fn read(mut bytes: &[u8]) -> Result<Header, HeaderError> {
        Header::read(|count| {
            let (now, rest) = bytes.split_at(count.min(bytes.len()));
            bytes = rest;
            Ok(now.to_vec())
        })
    }

    fn file(header: &str) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes()].concat()
    }

    #[test]
    fn other_orders_and_precisions_mean_the_same() {
        let rays = |descr: &str, fortran: &str, data: Vec<u8>| {
            let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': (2, 6), }}\n");
            let header = read(&file(&text)).unwrap();
            assert_eq!(header.length, 10 + text.len() as u64);
            header.check_size(data.len() as u64).unwrap();
            header.rays(&data, Rows::Rays)
        };
        let rows: Vec<f64> = (1..=12).map(f64::from).collect();
        let by_columns: Vec<f64> = (0..12).map(|i| rows[i % 2 * 6 + i / 2]).collect();
        let expected = [
            Ray::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)),
            Ray::new(DVec3::new(7.0, 8.0, 9.0), DVec3::new(10.0, 11.0, 12.0)),
        ];
        for (fortran, numbers) in [("False", rows), ("True", by_columns)] {
            let of = |bytes: fn(f64) -> Vec<u8>| numbers.iter().flat_map(|v| bytes(*v)).collect::<Vec<u8>>();
            assert_eq!(rays("<f8", fortran, of(|v| v.to_le_bytes().into())), expected);
            assert_eq!(rays(">f8", fortran, of(|v| v.to_be_bytes().into())), expected);
            assert_eq!(rays("<f4", fortran, of(|v| (v as f32).to_le_bytes().into())), expected);
            assert_eq!(rays(">f4", fortran, of(|v| (v as f32).to_be_bytes().into())), expected);
        }
    }

    #[test]
    fn broken_arrays_are_refused_in_words() {
        for (bytes, at, expected) in [
            (b"PK".to_vec(), 0, "not a .npy file"),
            (b"\x93NUMPY\x01".to_vec(), 6, "unknown .npy version"),
            (b"\x93NUMPY\x09\x00\x10\x00".to_vec(), 6, "unknown .npy version"),
            (b"\x93NUMPY\x01\x00\xff\xff{".to_vec(), 11, "cut off"),
            (file("{'descr': '<i8', 'fortran_order': False, 'shape': (1, 6), }"), 12, "element type <i8"),
            (file("{'descr': '<f8', 'fortran_order': False, 'shape': (6,), }"), 52, "two dimensions"),
            (file("{'fortran_order': False}"), 10, "no 'descr'"),
            ([&b"\x93NUMPY\x02\x00\x00\x00\x20\x00"[..], &[b' '; 3 << 20]].concat(), 8, "2097152 bytes"),
        ] {
            let Err(HeaderError::Wrong(found, message)) = read(&bytes) else { panic!("{expected}") };
            assert!(message.contains(expected) && found == at, "{found}: {message}");
        }
        for rows in ["9999999999999", "4611686018427387904"] {
            let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, 6), }}");
            let wrong = read(&file(&text)).unwrap().check_size(0).unwrap_err();
            let message = format!("0 bytes of data for shape ({rows}, 6) of <f8");
            assert_eq!(wrong, (10 + text.len() as u64, message));
        }
    }
}
