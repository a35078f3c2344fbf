//! Lists of rays or points, read piece by piece from CSV or .npy.

use std::path::Path;

use lumbre::{DVec3, Ray};

use super::array::ArrayReader;
use super::bytes::Bytes;
use super::csv::{self, TextReader};
use super::npy;
use crate::failure::Failure;

/// What each row of an input is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Rows {
    /// A ray.
    #[default]
    Rays,
    /// A point, which is read as the origin of a ray without a direction.
    Points,
}

impl Rows {
    /// The numbers of a row, by name; those behind [`Rows::needed`] may be left out together.
    pub(super) fn columns(self) -> &'static [&'static str] {
        match self {
            Self::Rays => &["ox", "oy", "oz", "dx", "dy", "dz", "tmin", "tmax"],
            Self::Points => &["x", "y", "z"],
        }
    }

    /// How many numbers a row has at least.
    pub(super) fn needed(self) -> usize {
        match self {
            Self::Rays => 6,
            Self::Points => 3,
        }
    }

    /// In words.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::Points => "points",
        }
    }

    /// The ray, or the point, of some numbers in the order of the columns.
    #[inline]
    pub(super) fn ray(self, value: impl Fn(usize) -> f64, has_range: bool) -> Ray {
        let vector = |i: usize| DVec3::new(value(i), value(i + 1), value(i + 2));
        match self {
            Self::Points => Ray::new(vector(0), DVec3::ZERO),
            Self::Rays if has_range => Ray::new(vector(0), vector(3)).with_range(value(6), value(7)),
            Self::Rays => Ray::new(vector(0), vector(3)),
        }
    }
}

/// Some rows, as the input has them.
pub(super) struct Piece {
    /// 0-based position of the first.
    pub first_ray: u64,
    /// The bytes of whole rows or lines.
    pub bytes: Vec<u8>,
    /// The line, from 1, that text begins with.
    pub line: u64,
}

/// Reads a list of rays or points from beginning to end.
pub(super) enum RayReader {
    /// As an array.
    Array(ArrayReader),
    /// As text.
    Text(TextReader),
}

impl RayReader {
    /// Opens a list; `-` is standard input.
    ///
    /// # Errors
    /// [`Failure`] when it cannot be read or what it begins with is wrong.
    pub(super) fn open(path: &Path, rows: Rows) -> Result<Self, Failure> {
        Self::new(Bytes::open(path)?, rows)
    }

    /// Reads what the bytes begin with.
    ///
    /// # Errors
    /// As [`RayReader::open`].
    pub(super) fn new(bytes: Bytes, rows: Rows) -> Result<Self, Failure> {
        let (bytes, is_array) = bytes.starts_with(npy::MAGIC)?;
        if is_array {
            ArrayReader::new(bytes, rows).map(Self::Array)
        } else {
            TextReader::new(bytes, rows).map(Self::Text)
        }
    }

    /// The next rays, up to `most`; `None` at the end.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be read, or there are less than was announced.
    pub(super) fn next(&mut self, most: usize) -> Result<Option<Piece>, Failure> {
        match self {
            Self::Array(reader) => reader.next(most),
            Self::Text(reader) => reader.next(most),
        }
    }

    /// What turns pieces into rays, on any thread.
    pub(super) fn decoder(&self) -> Decoder {
        match self {
            Self::Array(reader) => Decoder::Array(reader.header().clone(), reader.rows()),
            Self::Text(reader) => Decoder::Text(reader.name().to_owned(), reader.header().clone()),
        }
    }

    /// The share that was read, in [0, 1], where that is known.
    pub(super) fn fraction(&self) -> Option<f64> {
        match self {
            Self::Array(reader) => reader.fraction(),
            Self::Text(reader) => reader.fraction(),
        }
    }
}

/// Turns pieces into rays.
pub(super) enum Decoder {
    /// Of an array, and what its rows are.
    Array(npy::Header, Rows),
    /// Of text, with its name for messages.
    Text(String, csv::Header),
}

impl Decoder {
    /// The rays of a piece.
    ///
    /// # Errors
    /// [`Failure::Input`] with the line and column of what is wrong.
    pub(super) fn rays(&self, piece: &Piece) -> Result<Vec<Ray>, Failure> {
        match self {
            Self::Array(header, rows) => Ok(header.rays(&piece.bytes, *rows)),
            Self::Text(name, header) => csv::rays(name, header, piece),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Read};

    use super::*;

    /// A reader that gives a few bytes at a time, as a pipe may.
    struct Pipe(Cursor<Vec<u8>>);

    impl Read for Pipe {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            let most = out.len().min(3);
            self.0.read(&mut out[..most])
        }
    }

    fn read(name: &str, bytes: &[u8], most: usize) -> Result<Vec<Ray>, String> {
        read_rows(Rows::Rays, name, bytes, most)
    }

    fn read_rows(rows: Rows, name: &str, bytes: &[u8], most: usize) -> Result<Vec<Ray>, String> {
        let bytes = Bytes::from_reader(name, Pipe(Cursor::new(bytes.to_vec()))).unwrap();
        let all = || -> Result<Vec<Ray>, Failure> {
            let mut reader = RayReader::new(bytes, rows)?;
            let decoder = reader.decoder();
            let mut rays = Vec::new();
            while let Some(piece) = reader.next(most)? {
                assert_eq!(piece.first_ray, rays.len() as u64);
                rays.extend(decoder.rays(&piece)?);
            }
            Ok(rays)
        };
        all().map_err(|e| e.to_string())
    }

    const SIZES: [usize; 4] = [1, 2, 3, 100];

    #[test]
    fn columns_may_stand_in_any_order_and_ranges_are_optional() {
        let text =
            b"\xEF\xBB\xBF\n dx, dy,dz,ox,oy,oz,tmax\r\n0,0,1, 2,3,-4.5,inf\r\n\r\n1,2,3,4,5,6,7e1\r\n \n";
        for most in SIZES {
            assert_eq!(
                read("rays.csv", text, most).unwrap(),
                [
                    Ray::new(DVec3::new(2.0, 3.0, -4.5), DVec3::new(0.0, 0.0, 1.0)),
                    Ray::new(DVec3::new(4.0, 5.0, 6.0), DVec3::new(1.0, 2.0, 3.0)).with_range(0.0, 70.0),
                ]
            );
        }
    }

    #[test]
    fn points_have_three_numbers() {
        for most in SIZES {
            let points = read_rows(Rows::Points, "p.csv", b"z,x,y\n3,1,2\n-6,4,5e1\n", most).unwrap();
            let places: Vec<DVec3> = points.iter().map(|point| point.origin).collect();
            assert_eq!(places, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 50.0, -6.0)]);
            let wrong = read_rows(Rows::Points, "p.csv", b"x,y,z,dx\n", most).unwrap_err();
            assert_eq!(wrong, "p.csv:1:7: unknown column \"dx\" (expected x,y,z)");
            let none = read_rows(Rows::Points, "p.csv", b"", most).unwrap_err();
            assert_eq!(none, "p.csv:1:1: no points (expected a header among x,y,z)");
            let wide = read_rows(Rows::Points, "p.npy", &array("False", "1", &[0.0; 8]), most).unwrap_err();
            assert_eq!(wide, "p.npy: 8 columns (expected 3: x, y, z)");
        }
    }

    #[test]
    fn fields_may_be_quoted() {
        let text = b"\"ox\", \"oy\",\"oz\" ,dx,\"dy\",\"dz\"\r\n\"2\",3,\" -4.5\",0,0,\"1\"\n";
        for most in SIZES {
            let expected = Ray::new(DVec3::new(2.0, 3.0, -4.5), DVec3::new(0.0, 0.0, 1.0));
            assert_eq!(read("rays.csv", text, most).unwrap(), [expected]);
        }
        let half = read("rays.csv", b"\"ox,oy,oz,dx,dy,dz\n", 7).unwrap_err();
        assert!(half.starts_with("rays.csv:1:1: unknown column \"\\\"ox\""), "{half}");
    }

    #[test]
    fn the_ends_of_double_precision_are_numbers() {
        let text = b"ox,oy,oz,dx,dy,dz,tmax\n0,-0e-999,5e-324,1.7976931348623157e308,-1e-320,0.000e5,inf\n";
        let rays = read("rays.csv", text, 7).unwrap();
        let (o, d) = (DVec3::new(0.0, -0.0, 5e-324), DVec3::new(f64::MAX, -1e-320, 0.0));
        assert_eq!(rays, [Ray::new(o, d).with_range(0.0, f64::INFINITY)]);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let long = format!("ox,oy,oz,dx,dy,dz\n1,2{}", " ".repeat(1 << 17));
        for (text, expected) in [
            ("", "rays.csv:1:1: no rays"),
            ("ox,oy,oz,dx,dy\n", "rays.csv:1:1: no column \"dz\""),
            ("ox,oy,oz,dx,dy,dz,time\n", "rays.csv:1:19: unknown column \"time\""),
            ("\n\nox,oy,oz,dx,dy,dz,ox\n", "rays.csv:3:19: column \"ox\" appears twice"),
            (
                "ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6\n\n1,2,3, four,5,6\n",
                "rays.csv:4:8: invalid value (found \"four\"; expected a number)",
            ),
            (
                "ox,oy,oz,dx,dy,dz\n1,2,3,4,5,-1e999\n",
                "rays.csv:2:11: invalid value (found \"-1e999\"; expected a number of double precision, at most",
            ),
            (
                "ox,oy,oz,dx,dy,dz\n1, 2e-400,3,4,5,6\n",
                "rays.csv:2:4: invalid value (found \"2e-400\"; expected a number of double precision, which",
            ),
            (
                "ox,oy,oz,dx,dy,dz\n0.0000001e-320,2,3,4,5,6\n",
                "rays.csv:2:1: invalid value (found \"0.0000001e-320\"; expected a number of double",
            ),
            ("ox,oy,oz,dx,dy,dz\n1,2,3\n", "rays.csv:2:6: 3 values (expected 6)"),
            ("ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6,7\n", "rays.csv:2:13: more than the 6 values"),
            (&long, "rays.csv:2:65537: a line of more than 65536 bytes"),
        ] {
            for most in SIZES {
                let message = read("rays.csv", text.as_bytes(), most).unwrap_err();
                assert!(message.contains(expected), "{message}");
            }
        }
        let latin1 = read("rays.csv", b"ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6\n1,2,\xEF,4,5,6", 7).unwrap_err();
        assert_eq!(latin1, "rays.csv:3: not text (expected CSV in UTF-8, or a .npy array)");
    }

    fn array(order: &str, rows: &str, data: &[f64]) -> Vec<u8> {
        let header = format!("{{'descr': '>f8', 'fortran_order': {order}, 'shape': ({rows}, 8), }}\n");
        let mut file = [npy::MAGIC, b"\x01\x00", &(header.len() as u16).to_le_bytes()].concat();
        file.extend(header.bytes());
        file.extend(data.iter().flat_map(|v| v.to_be_bytes()));
        file
    }

    #[test]
    fn arrays_in_both_orders_give_the_same_rays() {
        let by_rows: Vec<f64> = (0..56).map(f64::from).collect();
        let by_columns: Vec<f64> = (0..56).map(|i| f64::from(i % 7 * 8 + i / 7)).collect();
        let expected: Vec<Ray> = (0..7)
            .map(|i| f64::from(8 * i))
            .map(|x| {
                Ray::new(DVec3::new(x, x + 1.0, x + 2.0), DVec3::new(x + 3.0, x + 4.0, x + 5.0))
                    .with_range(x + 6.0, x + 7.0)
            })
            .collect();
        for most in SIZES {
            assert_eq!(read("r.npy", &array("False", "7", &by_rows), most).unwrap(), expected);
            assert_eq!(read("r.npy", &array("True", "7", &by_columns), most).unwrap(), expected);
            assert_eq!(read("r.npy", &array("False", "0", &[]), most).unwrap(), []);
            assert_eq!(read("r.npy", &array("True", "0", &[]), most).unwrap(), []);
        }
    }

    #[test]
    fn arrays_with_too_little_or_too_much_data_are_refused() {
        let data: Vec<f64> = (0..57).map(f64::from).collect();
        for order in ["False", "True"] {
            for most in SIZES {
                for (rows, count, found) in [("7", 57, 456), ("7", 55, 440), ("7", 0, 0), ("0", 1, 8)] {
                    let message = read("r.npy", &array(order, rows, &data[..count]), most).unwrap_err();
                    // Where data are missing or too many.
                    let header = array(order, rows, &[]).len();
                    let at = header + (64 * rows.parse::<usize>().unwrap()).min(found);
                    let expected = format!("{found} bytes of data for shape ({rows}, 8) of >f8");
                    assert_eq!(message, format!("r.npy:byte {at}: {expected}"));
                }
                let huge = read("r.npy", &array(order, "4611686018427387904", &data), most).unwrap_err();
                assert!(huge.contains("456 bytes of data"), "{huge}");
            }
        }
    }
}
