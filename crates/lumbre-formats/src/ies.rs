//! Measured light distributions of luminaires: IES LM-63 files of 1986 to 2019 (`.ies`).
//!
//! ANSI/IES LM-63-19, "IES Standard File Format for the Electronic Transfer of Photometric Data and Related
//! Information", 2019. Data on lamps and housings are ignored; tilted lamps (`TILT=`) are used as measured.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use lumbre_image::{Image, Rgb};
use lumbre_math::{DVec2, DVec3, Elementary, warp64};

use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, FormatError, Place, quoted};

/// Luminous intensity in candelas, by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    photometry: Photometry,
    /// Degrees, ascending; at least two, or a single one if there is no other.
    vertical: Vec<f64>,
    horizontal: Vec<f64>,
    /// For each horizontal angle all vertical ones.
    candela: Vec<f32>,
}

/// The convention of the angles of a [`Profile`]. The light is aimed where both are 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Photometry {
    /// Vertical angles from the aim to its opposite, horizontal ones around it.
    C,
    /// Vertical angles around an axis perpendicular to the aim, horizontal ones towards it.
    B,
    /// Horizontal angles around the upright, vertical ones towards it.
    A,
}

/// The width of [`Profile::image`]: half a degree per pixel.
const WIDTH: u32 = 720;
const HEIGHT: u32 = 360;

impl Profile {
    /// The candelas towards a unit direction, in a space in which the light is aimed along -z, and the
    /// horizontal angles 0 and 90° of photometry C are along x and y.
    pub fn candela(&self, direction: DVec3) -> f64 {
        let d = direction;
        let (vertical, horizontal) = match self.photometry {
            Photometry::C => {
                let from_aim = d.truncate().length().angle_from(-d.z);
                let around = d.y.angle_from(d.x);
                (from_aim, if around < 0.0 { around + TAU } else { around })
            }
            // Seen from the light, these horizontal angles are clockwise.
            Photometry::B => (d.x.angle_from(0.0 - d.z), (-d.y).clamp(-1.0, 1.0).arc_sine()),
            Photometry::A => (d.x.clamp(-1.0, 1.0).arc_sine(), (0.0 - d.y).angle_from(0.0 - d.z)),
        };
        let (vertical, horizontal) = (vertical.to_degrees(), self.folded(horizontal.to_degrees()));
        let Some((row, along)) = place(&self.vertical, vertical) else { return 0.0 };
        let Some((column, across)) = place(&self.horizontal, horizontal) else { return 0.0 };
        let rows = self.vertical.len();
        let at = |column: usize, row: usize| {
            f64::from(self.candela[column.min(self.horizontal.len() - 1) * rows + row.min(rows - 1)])
        };
        let between = |column| at(column, row) + along * (at(column, row + 1) - at(column, row));
        between(column) + across * (between(column + 1) - between(column))
    }

    /// A horizontal angle folded into the table's range by symmetry.
    fn folded(&self, degrees: f64) -> f64 {
        let (first, last) = (self.horizontal[0], self.horizontal[self.horizontal.len() - 1]);
        match self.photometry {
            Photometry::C if last == 0.0 => 0.0,
            Photometry::C if first == 0.0 && last <= 90.0 => {
                let half = if degrees > 180.0 { 360.0 - degrees } else { degrees };
                if half > 90.0 { 180.0 - half } else { half }
            }
            Photometry::C if first == 0.0 && last <= 180.0 => {
                if degrees > 180.0 {
                    360.0 - degrees
                } else {
                    degrees
                }
            }
            // Symmetric about the plane through 90 and 270 degrees.
            Photometry::C if first == 90.0 && last <= 270.0 => {
                if !(90.0..=270.0).contains(&degrees) {
                    (540.0 - degrees).rem_euclid(360.0)
                } else {
                    degrees
                }
            }
            Photometry::C => degrees,
            Photometry::A | Photometry::B if first >= 0.0 => degrees.abs(),
            Photometry::A | Photometry::B => degrees,
        }
    }

    /// The candelas as a latitude-longitude image in the same space, half a degree a pixel, z up.
    pub fn image(&self) -> Image {
        let pixels = (0..WIDTH * HEIGHT).map(|i| {
            let (x, y) = (f64::from(i % WIDTH) + 0.5, f64::from(i / WIDTH) + 0.5);
            let uv = DVec2::new(x / f64::from(WIDTH) + 0.5, y / f64::from(HEIGHT));
            Rgb::splat(self.candela(warp64::latlong_to_sphere(uv)) as f32)
        });
        Image::from_pixels(WIDTH, HEIGHT, pixels.collect()).unwrap_or_else(|| Image::filled(2, 1, Rgb::BLACK))
    }

    /// The luminous flux in lumens: the integral over all directions.
    pub fn lumens(&self) -> f64 {
        let image = self.image();
        let ring = |y: u32| (PI * f64::from(y) / f64::from(HEIGHT)).cosine();
        let row = |y: u32| {
            let solid_angle = TAU * (ring(y) - ring(y + 1)) / f64::from(WIDTH);
            (0..WIDTH).map(|x| f64::from(image.pixel(x, y).g)).sum::<f64>() * solid_angle
        };
        (0..HEIGHT).map(row).sum()
    }
}

/// The interval of `angles` that contains `at`, and the fraction; `None` outside.
fn place(angles: &[f64], at: f64) -> Option<(usize, f64)> {
    if angles.len() == 1 {
        return Some((0, 0.0));
    }
    // Rounding may be slightly outside.
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    if at < first - 1e-9 || at > last + 1e-9 {
        return None;
    }
    let after = angles.partition_point(|&angle| angle <= at).clamp(1, angles.len() - 1);
    let (low, high) = (angles[after - 1], angles[after]);
    Some((after - 1, ((at - low) / (high - low)).clamp(0.0, 1.0)))
}

/// Reads a profile from the bytes of its file.
///
/// # Errors
/// [`FormatError::Input`] with the line and column of what is wrong, and [`FormatError::Limit`].
pub fn read_ies(bytes: &[u8], name: &Arc<str>, budget: &Budget) -> Result<Profile, FormatError> {
    let mut words = Words { bytes, at: 0, name };
    let tilt = words.skip_keywords()?;
    if tilt {
        // The geometry of the lamp, angles, and a factor for each.
        words.number()?;
        let count = words.count("tilted angles")?;
        for _ in 0..2 * count {
            words.number()?;
        }
    }
    let _lamps = words.number()?;
    let _lumens = words.number()?;
    let multiplier = words.number()?;
    let rows = words.count("vertical angles")?;
    let columns = words.count("horizontal angles")?;
    let kind_at = words.next_at();
    let photometry = match words.number()? {
        1.0 => Photometry::C,
        2.0 => Photometry::B,
        3.0 => Photometry::A,
        other => {
            return Err(words
                .wrong_at(kind_at, "unknown photometry")
                .found(other)
                .expected("1, 2 or 3")
                .into());
        }
    };
    for _ in 0..4 {
        words.number()?;
    }
    let ballast = words.number()?;
    let with_lamp = words.number()?;
    let _watts = words.number()?;
    // A number takes at least two bytes.
    let all = (rows as u64).saturating_mul(columns as u64);
    if all.saturating_add((rows + columns) as u64) > bytes.len() as u64 {
        let wrong = words.wrong_at(kind_at, "more angles than the file has numbers");
        return Err(wrong.found(format!("{rows} times {columns}")).into());
    }
    budget.bytes(4 * all + 8 * (rows + columns) as u64, "light profile")?;
    let vertical = words.angles(rows)?;
    let horizontal = words.angles(columns)?;
    // Before 1995 the second was reserved, and some wrote 0.
    let factor = multiplier * ballast * if with_lamp > 0.0 { with_lamp } else { 1.0 };
    let mut candela = Vec::with_capacity(all as usize);
    for _ in 0..all {
        let at = words.next_at();
        let value = words.number()?;
        let scaled = (value * factor) as f32;
        if !(scaled >= 0.0 && scaled.is_finite()) {
            let wrong = words.wrong_at(at, "wrong intensity").found(value);
            return Err(wrong.expected("0 candelas or more").into());
        }
        candela.push(scaled);
    }
    Ok(Profile { photometry, vertical, horizontal, candela })
}

/// A reader of numbers between spaces, commas and line ends.
struct Words<'b> {
    bytes: &'b [u8],
    at: usize,
    name: &'b Arc<str>,
}

impl<'b> Words<'b> {
    fn wrong_at(&self, at: usize, message: &str) -> Diagnostic {
        Diagnostic::error(message).at(Place::of_offset(self.name.clone(), self.bytes, at))
    }

    /// Skips the keyword lines; returns whether factors for tilted lamps follow.
    fn skip_keywords(&mut self) -> Result<bool, FormatError> {
        loop {
            let rest = &self.bytes[self.at..];
            if rest.is_empty() {
                let wrong = self.wrong_at(self.at, "no \"TILT=\" before the numbers of a light profile");
                return Err(wrong.expected("an IES LM-63 file").into());
            }
            let length = rest.iter().position(|b| *b == b'\n' || *b == b'\r').unwrap_or(rest.len());
            let line = rest[..length].trim_ascii();
            self.at += (length + 1).min(rest.len());
            if let Some(tilt) = line.strip_prefix(b"TILT=") {
                return Ok(tilt.trim_ascii() == b"INCLUDE");
            }
        }
    }

    /// The start of the next word.
    fn next_at(&mut self) -> usize {
        while self.bytes.get(self.at).is_some_and(|b| b.is_ascii_whitespace() || *b == b',') {
            self.at += 1;
        }
        self.at
    }

    fn number(&mut self) -> Result<f64, FormatError> {
        let start = self.next_at();
        while self.bytes.get(self.at).is_some_and(|b| !b.is_ascii_whitespace() && *b != b',') {
            self.at += 1;
        }
        let word = String::from_utf8_lossy(&self.bytes[start..self.at]);
        let number = word.parse::<f64>().ok().filter(|n| n.is_finite());
        number.ok_or_else(|| {
            let short: String = word.chars().take(20).collect();
            let found = if word.is_empty() { "the end of the file".to_owned() } else { quoted(&short) };
            self.wrong_at(start, "wrong number in a light profile").found(found).into()
        })
    }

    fn count(&mut self, what: &str) -> Result<usize, FormatError> {
        let at = self.next_at();
        let number = self.number()?;
        if number.fract() == 0.0 && (1.0..=self.bytes.len() as f64).contains(&number) {
            return Ok(number as usize);
        }
        let wrong = self.wrong_at(at, &format!("wrong number of {what}")).found(number);
        Err(wrong.expected("1 or more, and no more than the file holds").into())
    }

    fn angles(&mut self, count: usize) -> Result<Vec<f64>, FormatError> {
        let mut angles: Vec<f64> = Vec::with_capacity(count);
        for _ in 0..count {
            let at = self.next_at();
            let angle = self.number()?;
            if let Some(before) = angles.last().filter(|before| angle <= **before) {
                let wrong = self.wrong_at(at, "angles out of order").found(angle);
                return Err(wrong.expected(format!("more than {before}")).into());
            }
            angles.push(angle);
        }
        Ok(angles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Profile, FormatError> {
        read_ies(text.as_bytes(), &"a.ies".into(), &Budget::default())
    }

    fn error(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    const HEAD: &str = "IES:LM-63-2019\n[TEST] ours\nTILT=NONE\n";

    /// The intensity at an angle from the aim and an angle around it, in degrees.
    fn towards(vertical: f64, horizontal: f64) -> DVec3 {
        let (v, h) = (vertical.to_radians(), horizontal.to_radians());
        DVec3::new(v.sin() * h.cos(), v.sin() * h.sin(), -v.cos())
    }

    #[test]
    fn tables_are_interpolated_and_folded_by_their_symmetry() {
        let profile = read(&format!(
            "{HEAD}1 1000 2 3 3 1 1 0 0 0 0.5 1 60\n0 40 90\n0 45 90\n100 50 0, 100 70 10\n100,90,20\n"
        ))
        .unwrap();
        let quadrants =
            [(0.0, 60.0), (45.0, 90.0), (180.0, 60.0), (135.0, 90.0), (225.0, 90.0), (315.0, 90.0)];
        for (around, expected) in quadrants {
            // Half way from 0 to 40 degrees.
            let expected = 0.5 * (100.0 + if expected == 60.0 { 50.0 } else { 70.0 });
            let found = profile.candela(towards(20.0, around));
            assert!((found - expected).abs() < 1e-9, "{around}: {found}");
        }
        assert!((profile.candela(towards(40.0, 67.5)) - 80.0).abs() < 1e-9);
        assert!((profile.candela(towards(0.0, 0.0)) - 100.0).abs() < 1e-9);
        assert_eq!(profile.candela(towards(100.0, 0.0)), 0.0);
    }

    #[test]
    fn sides_and_halves_are_mirrored_where_they_were_measured() {
        let table = |angles: &str| {
            read(&format!("{HEAD}1 -1 1 2 3 1 1 0 0 0 1 1 60 0 180 {angles} 1 1 2 2 3 3")).unwrap()
        };
        let side = table("0 90 180");
        assert_eq!(side.candela(towards(50.0, 90.0)), side.candela(towards(50.0, 270.0)));
        assert!((side.candela(towards(50.0, 135.0)) - 2.5).abs() < 1e-9);
        let old = table("90 180 270");
        assert!((old.candela(towards(50.0, 90.0)) - 1.0).abs() < 1e-9);
        assert!((old.candela(towards(50.0, 0.0)) - 2.0).abs() < 1e-9);
        assert!((old.candela(towards(50.0, 315.0)) - 2.5).abs() < 1e-9);
    }

    #[test]
    fn what_shines_evenly_gives_four_pi_lumens_a_candela() {
        let even = read(&format!("{HEAD}1 -1 1 2 1 1 1 0 0 0 1 1 60 0 180 0 50 50")).unwrap();
        assert!((even.lumens() / (4.0 * PI * 50.0) - 1.0).abs() < 1e-3);
        let half = read(&format!("{HEAD}1 -1 1 2 1 1 1 0 0 0 1 1 60 0 90 0 50 50")).unwrap();
        assert!((half.lumens() / (2.0 * PI * 50.0) - 1.0).abs() < 1e-2);
    }

    #[test]
    fn the_other_photometries_are_aimed_alike() {
        // Of B: 0 degrees both is the aim; 90 vertical is towards x, 90 horizontal against y.
        let b = read(&format!("{HEAD}1 -1 1 3 2 2 1 0 0 0 1 1 60 -90 0 90 0 90 1 5 9 2 2 2")).unwrap();
        assert!((b.candela(-DVec3::Z) - 5.0).abs() < 1e-9);
        assert!((b.candela(DVec3::X) - 9.0).abs() < 1e-9 && (b.candela(-DVec3::X) - 1.0).abs() < 1e-9);
        assert!((b.candela(-DVec3::Y) - 2.0).abs() < 1e-9 && (b.candela(DVec3::Y) - 2.0).abs() < 1e-9);
        let a = read(&format!("{HEAD}1 -1 1 3 2 3 1 0 0 0 1 1 60 -90 0 90 0 90 1 5 9 1 2 9")).unwrap();
        assert!((a.candela(-DVec3::Z) - 5.0).abs() < 1e-9 && (a.candela(DVec3::X) - 9.0).abs() < 1e-9);
        assert!((a.candela(-DVec3::Y) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn tilted_lamps_and_old_headers_are_passed_by() {
        let old = "my lamp\nsome words\nTILT=INCLUDE\n1\n3\n0 45 90\n1 .9 .8\n1 -1 1 2 1 1 1 0 0 0 1 0 60 0 180 0 7 7\n";
        assert!((read(old).unwrap().candela(DVec3::X) - 7.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, expected) in [
            ("".to_owned(), "a.ies:1:1: no \"TILT=\""),
            (format!("{HEAD}1 -1 1 2 1 7"), "a.ies:4:12: unknown photometry (found 7"),
            (format!("{HEAD}1 -1 1 2000000 1 1"), "a.ies:4:8: wrong number of vertical angles"),
            (format!("{HEAD}1 -1 1 9 9 1 1 0 0 0 1 1 6"), "more angles than the file has numbers"),
            (
                format!("{HEAD}1 -1 1 2 1 1 1 0 0 0 1 1 60 90 0 0 1 1"),
                "a.ies:4:32: angles out of order (found 0",
            ),
            (
                format!("{HEAD}1 -1 1 2 1 1 1 0 0 0 1 1 60 0 90 0 1 -4"),
                "a.ies:4:38: wrong intensity (found -4",
            ),
            (format!("{HEAD}1 -1 1 2 1 1 1 0 0 0 1 1 60 0 90 0 1"), "the end of the file"),
            (format!("{HEAD}1 -1 x"), "a.ies:4:6: wrong number in a light profile (found \"x\""),
        ] {
            let found = error(&text);
            assert!(found.contains(expected), "{found}");
        }
    }
}
