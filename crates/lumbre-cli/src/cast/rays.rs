//! Lists of rays, read from CSV or .npy.

use lumbre::{DVec3, Ray};

use super::npy;
use crate::failure::Failure;

const COLUMNS: [&str; 8] = ["ox", "oy", "oz", "dx", "dy", "dz", "tmin", "tmax"];

/// Reads rays from the bytes of a file; `name` is for messages.
///
/// [`Failure::Input`] with the line and column.
pub fn read(name: &str, bytes: &[u8]) -> Result<Vec<Ray>, Failure> {
    if bytes.starts_with(b"\x93NUMPY") {
        return from_array(&npy::read(bytes).map_err(|what| Failure::input(format!("{name}: {what}")))?)
            .map_err(|what| Failure::input(format!("{name}: {what}")));
    }
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() + 1;
        Failure::input(format!("{name}:{line}: not text (expected CSV in UTF-8, or a .npy array)"))
    })?;
    from_csv(text.strip_prefix('\u{feff}').unwrap_or(text))
        .map_err(|(line, column, what)| Failure::input(format!("{name}:{line}:{column}: {what}")))
}

fn from_array(array: &npy::Array) -> Result<Vec<Ray>, String> {
    if array.columns != 6 && array.columns != 8 {
        return Err(format!("{} columns (expected 6 or 8: {})", array.columns, COLUMNS.join(", ")));
    }
    let ray = |row: &[f64]| {
        let vector = |i: usize| DVec3::new(row[i], row[i + 1], row[i + 2]);
        let ray = Ray::new(vector(0), vector(3));
        if row.len() == 8 { ray.with_range(row[6], row[7]) } else { ray }
    };
    Ok(array.values.chunks_exact(array.columns).map(ray).collect())
}

/// An error in the text: line and column from 1, and a message.
type CsvError = (usize, usize, String);

fn from_csv(text: &str) -> Result<Vec<Ray>, CsvError> {
    let mut lines =
        text.lines().enumerate().map(|(i, line)| (i + 1, line)).filter(|(_, line)| !line.trim().is_empty());
    let Some((header_line, header)) = lines.next() else {
        return Err((1, 1, format!("no rays (expected a header among {})", COLUMNS.join(","))));
    };
    let mut place = [None; 8];
    for (i, (column, name)) in fields(header).enumerate() {
        let Some(known) = COLUMNS.iter().position(|known| *known == name) else {
            let expected = COLUMNS.join(",");
            return Err((header_line, column, format!("unknown column \"{name}\" (expected {expected})")));
        };
        if place[known].replace(i).is_some() {
            return Err((header_line, column, format!("column \"{name}\" stands twice")));
        }
    }
    if let Some(missing) = (0..6).find(|i| place[*i].is_none()) {
        return Err((header_line, 1, format!("no column \"{}\"", COLUMNS[missing])));
    }
    let width = place.iter().flatten().count();

    let mut rays = Vec::new();
    for (number, line) in lines {
        let mut values = [0.0; 8];
        let mut count = 0;
        for (column, field) in fields(line) {
            if count == width {
                return Err((number, column, format!("more than the {width} values of the header")));
            }
            values[count] = field
                .parse::<f64>()
                .map_err(|_| (number, column, format!("expected a number, found \"{field}\"")))?;
            count += 1;
        }
        if count < width {
            return Err((number, line.len() + 1, format!("{count} values (expected {width})")));
        }
        let value = |column: usize, default: f64| place[column].map_or(default, |i| values[i]);
        rays.push(
            Ray::new(
                DVec3::new(value(0, 0.0), value(1, 0.0), value(2, 0.0)),
                DVec3::new(value(3, 0.0), value(4, 0.0), value(5, 0.0)),
            )
            .with_range(value(6, 0.0), value(7, f64::INFINITY)),
        );
    }
    Ok(rays)
}

/// The fields of a line, each with its column, from 1.
fn fields(line: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut column = 1;
    line.split(',').map(move |field| {
        let start = column + field.chars().take_while(|c| c.is_whitespace()).count();
        column += field.chars().count() + 1;
        (start, field.trim())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_may_stand_in_any_order_and_ranges_are_optional() {
        let rays =
            read("rays.csv", b"dx, dy,dz,ox,oy,oz,tmax\r\n0,0,1, 2,3,-4.5,inf\r\n\r\n1,2,3,4,5,6,7e1\r\n")
                .unwrap();
        assert_eq!(
            rays,
            [
                Ray::new(DVec3::new(2.0, 3.0, -4.5), DVec3::new(0.0, 0.0, 1.0)),
                Ray::new(DVec3::new(4.0, 5.0, 6.0), DVec3::new(1.0, 2.0, 3.0)).with_range(0.0, 70.0),
            ]
        );
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        for (text, expected) in [
            ("", "rays.csv:1:1: no rays"),
            ("ox,oy,oz,dx,dy\n", "rays.csv:1:1: no column \"dz\""),
            ("ox,oy,oz,dx,dy,dz,time\n", "rays.csv:1:19: unknown column \"time\""),
            ("ox,oy,oz,dx,dy,dz,ox\n", "rays.csv:1:19: column \"ox\" stands twice"),
            (
                "ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6\n1,2,3, four,5,6\n",
                "rays.csv:3:8: expected a number, found \"four\"",
            ),
            ("ox,oy,oz,dx,dy,dz\n1,2,3\n", "rays.csv:2:6: 3 values (expected 6)"),
            ("ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6,7\n", "rays.csv:2:13: more than the 6 values"),
        ] {
            let message = read("rays.csv", text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
