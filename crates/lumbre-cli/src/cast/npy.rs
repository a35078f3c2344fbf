//! NumPy's .npy format, version 1.0 to 3.0, as needed for lists of rays and results.

use std::io::{self, Write};

/// A two-dimensional array of numbers, row by row.
#[derive(Debug, PartialEq)]
pub struct Array {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// Values, converted to double precision.
    pub values: Vec<f64>,
}

/// Reads an array of shape (N, M) of f4 or f8, in either byte order and either storage order.
///
/// A message with what was found and what is accepted.
pub fn read(bytes: &[u8]) -> Result<Array, String> {
    let version =
        bytes.strip_prefix(b"\x93NUMPY").ok_or("not a .npy file (its first bytes are not \\x93NUMPY)")?;
    let (header_len, start) = match version {
        [1, _, a, b, ..] => (usize::from(u16::from_le_bytes([*a, *b])), 10),
        [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 12),
        _ => return Err("unknown .npy version (expected 1.0, 2.0 or 3.0)".into()),
    };
    let header =
        bytes.get(start..).and_then(|rest| rest.get(..header_len)).ok_or("the .npy header is cut off")?;
    let header = std::str::from_utf8(header).map_err(|_| "the .npy header is not text")?;
    let data = &bytes[start + header_len..];

    let element = entry(header, "descr").ok_or("the .npy header has no 'descr'")?.trim_matches(['\'', '"']);
    let (size, big_endian) = match element {
        "<f4" => (4, false),
        "<f8" => (8, false),
        ">f4" => (4, true),
        ">f8" => (8, true),
        _ => return Err(format!("element type {element} (expected f4 or f8)")),
    };
    let columns_first = entry(header, "fortran_order") == Some("True");
    let shape = entry(header, "shape").ok_or("the .npy header has no 'shape'")?;
    let sizes: Vec<usize> = shape
        .trim_matches(['(', ')'])
        .split(',')
        .map(str::trim)
        .filter(|size| !size.is_empty())
        .map(|size| size.parse().map_err(|_| format!("shape {shape} (expected (N, M))")))
        .collect::<Result<_, _>>()?;
    let &[rows, columns] = &sizes[..] else {
        return Err(format!("shape {shape} (expected two dimensions)"));
    };
    let count = rows.checked_mul(columns).filter(|n| n.checked_mul(size) == Some(data.len()));
    let Some(count) = count else {
        return Err(format!("{} bytes of data for shape {shape} of {element}", data.len()));
    };

    let value = |i: usize| {
        let mut raw = [0; 8];
        raw[..size].copy_from_slice(&data[i * size..(i + 1) * size]);
        if big_endian {
            raw[..size].reverse();
        }
        if size == 8 {
            f64::from_le_bytes(raw)
        } else {
            f64::from(f32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]))
        }
    };
    let values = (0..count).map(|i| value(if columns_first { i % columns * rows + i / columns } else { i }));
    Ok(Array { rows, columns, values: values.collect() })
}

/// The text of a value in the header's Python dictionary.
fn entry<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let at = header.find(&format!("'{key}'"))? + key.len() + 2;
    let value = header[at..].trim_start().strip_prefix(':')?.trim_start();
    let end = if value.starts_with('(') { value.find(')')? + 1 } else { value.find([',', '}'])? };
    Some(value[..end].trim())
}

/// Writes an array of the given shape, elements already as little-endian bytes of the NumPy type `descr`.
///
/// # Errors
/// Those of the writer.
pub fn write(mut out: impl Write, descr: &str, shape: &[usize], bytes: &[u8]) -> io::Result<()> {
    let sizes: String = shape.iter().map(|size| format!("{size}, ")).collect();
    let mut header =
        format!("{{'descr': {descr}, 'fortran_order': False, 'shape': ({}), }}", sizes.trim_end());
    // The data must begin at a multiple of 64, and the header must end in a line feed.
    let padding = 63 - (10 + header.len()) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    let length = u16::try_from(header.len()).map_err(|_| io::Error::other("the .npy header is too long"))?;
    out.write_all(b"\x93NUMPY\x01\x00")?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    out.write_all(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_that_was_written_reads_back() {
        let values = [1.5, -2.25, 1e-300, 4.0, 5.0, 6.0];
        let bytes: Vec<u8> = values.iter().flat_map(|v: &f64| v.to_le_bytes()).collect();
        let mut file = Vec::new();
        write(&mut file, "'<f8'", &[2, 3], &bytes).unwrap();
        assert_eq!((file.len() - 48) % 64, 0);
        assert_eq!(read(&file).unwrap(), Array { rows: 2, columns: 3, values: values.to_vec() });
    }

    #[test]
    fn other_orders_and_precisions_mean_the_same() {
        let file = |descr: &str, fortran: &str, data: Vec<u8>| {
            let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': (2, 3), }}\n");
            let length = (header.len() as u16).to_le_bytes();
            [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes(), &data].concat()
        };
        let rows = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let big: Vec<u8> = rows.iter().flat_map(|v: &f64| v.to_be_bytes()).collect();
        assert_eq!(read(&file(">f8", "False", big)).unwrap().values, rows);
        let by_columns: Vec<u8> =
            [1f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(read(&file("<f4", "True", by_columns)).unwrap().values, rows);
    }

    #[test]
    fn broken_arrays_are_refused_in_words() {
        let file = |header: &str| {
            let length = (header.len() as u16).to_le_bytes();
            [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes()].concat()
        };
        for (bytes, expected) in [
            (b"PK".to_vec(), "not a .npy file"),
            (b"\x93NUMPY\x01\x00\xff\xff{".to_vec(), "cut off"),
            (file("{'descr': '<i8', 'fortran_order': False, 'shape': (1, 6), }"), "element type <i8"),
            (file("{'descr': '<f8', 'fortran_order': False, 'shape': (6,), }"), "two dimensions"),
            (
                file("{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999999, 6), }"),
                "0 bytes of data",
            ),
            (
                file("{'descr': '<f8', 'fortran_order': False, 'shape': (4611686018427387904, 6), }"),
                "0 bytes",
            ),
            (file("{'fortran_order': False}"), "no 'descr'"),
        ] {
            let message = read(&bytes).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
