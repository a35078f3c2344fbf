//! Arguments with units: sizes, durations, bytes and rectangles.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use lumbre::image::Window;

/// `640x480`.
///
/// # Errors
/// What was expected.
pub(crate) fn size(text: &str) -> Result<(u32, u32), String> {
    let wrong =
        || format!("found \"{text}\"; expected WIDTHxHEIGHT in pixels, each from 1 to 65536, as 640x480");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |s: &str| s.trim().parse().ok().filter(|n| (1..=65_536).contains(n));
    Ok((side(width).ok_or_else(wrong)?, side(height).ok_or_else(wrong)?))
}

/// `x0,y0,x1,y1` in pixels, or in fractions of the picture when a number has a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Crop {
    /// Left, top, right, bottom in pixels, right and bottom excluded.
    Pixels([u32; 4]),
    /// The same in [0, 1].
    Fractions([f64; 4]),
}

/// `x0,y0,x1,y1`.
///
/// # Errors
/// What was expected.
pub(crate) fn crop(text: &str) -> Result<Crop, String> {
    let wrong = || {
        format!(
            "found \"{text}\"; expected x0,y0,x1,y1 with x0 < x1 and y0 < y1, in pixels (10,20,110,95) or in fractions (0.25,0.25,0.5,0.5)"
        )
    };
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    if parts.len() != 4 {
        return Err(wrong());
    }
    if parts.iter().any(|part| part.contains('.')) {
        let mut f = [0.0; 4];
        for (value, part) in f.iter_mut().zip(&parts) {
            *value = part.parse().ok().filter(|v| (0.0..=1.0).contains(v)).ok_or_else(wrong)?;
        }
        return if f[0] < f[2] && f[1] < f[3] { Ok(Crop::Fractions(f)) } else { Err(wrong()) };
    }
    let mut p = [0; 4];
    for (value, part) in p.iter_mut().zip(&parts) {
        *value = part.parse().map_err(|_| wrong())?;
    }
    if p[0] < p[2] && p[1] < p[3] { Ok(Crop::Pixels(p)) } else { Err(wrong()) }
}

/// `x,y,width,height` in pixels.
///
/// # Errors
/// What was expected.
pub(crate) fn region(text: &str) -> Result<Window, String> {
    let wrong = || format!("found \"{text}\"; expected X,Y,WIDTH,HEIGHT in pixels, as 100,50,64,64");
    let number = |part: &str| part.trim().parse::<i32>().ok().filter(|&n| n >= 0).ok_or_else(wrong);
    let parts: Vec<i32> = text.split(',').map(number).collect::<Result<_, _>>()?;
    match parts[..] {
        [x, y, width, height] if width > 0 && height > 0 => {
            Ok(Window { x, y, width: width.unsigned_abs(), height: height.unsigned_abs() })
        }
        _ => Err(wrong()),
    }
}

/// `90s`, `2m`, `1h30m`, `500ms`; a bare number is seconds.
///
/// # Errors
/// What was expected.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || format!("found \"{text}\"; expected a time such as 90s, 2m, 1h30m or 500ms");
    let mut rest = text.trim();
    let mut seconds = 0.0;
    while !rest.is_empty() {
        let number_end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let value: f64 = rest[..number_end].parse().map_err(|_| wrong())?;
        let unit_end =
            rest[number_end..].find(|c: char| c.is_ascii_digit()).map_or(rest.len(), |n| number_end + n);
        seconds += value
            * match rest[number_end..unit_end].trim() {
                "" | "s" => 1.0,
                "ms" => 0.001,
                "m" | "min" => 60.0,
                "h" => 3600.0,
                "d" => 86_400.0,
                _ => return Err(wrong()),
            };
        rest = &rest[unit_end..];
    }
    if seconds <= 0.0 { Err(wrong()) } else { Duration::try_from_secs_f64(seconds).map_err(|_| wrong()) }
}

/// `8G`, `512M`, `100k`; a bare number is bytes. Powers of 1024.
///
/// # Errors
/// What was expected.
pub(crate) fn bytes(text: &str) -> Result<u64, String> {
    let wrong = || format!("found \"{text}\"; expected a size such as 8G, 512M or 100k");
    let lower = text.trim().to_ascii_lowercase();
    let lower = lower.trim_end_matches('b').trim_end_matches('i');
    let (number, factor) = match lower.chars().last() {
        Some('k') => (&lower[..lower.len() - 1], 1u64 << 10),
        Some('m') => (&lower[..lower.len() - 1], 1 << 20),
        Some('g') => (&lower[..lower.len() - 1], 1 << 30),
        Some('t') => (&lower[..lower.len() - 1], 1 << 40),
        _ => (lower, 1),
    };
    let value: f64 = number.trim().parse().map_err(|_| wrong())?;
    if value > 0.0 && value.is_finite() { Ok((value * factor as f64) as u64) } else { Err(wrong()) }
}

/// A parser of whole numbers in this range.
pub(crate) fn whole<T>(range: RangeInclusive<T>) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static,
{
    move |text| {
        let number = text.trim().parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected a whole number from {} to {}", range.start(), range.end()))
    }
}

/// A number of things: `1 sample`, `16 samples`.
pub(crate) fn counted(count: u64, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

/// A duration in words.
pub(crate) fn spoken(duration: Duration) -> String {
    let seconds = duration.as_secs();
    match seconds {
        0..=9 => format!("{:.1} s", duration.as_secs_f64()),
        10..=99 => format!("{seconds} s"),
        100..=5999 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds % 3600 / 60),
    }
}

/// The shortest decimal number that reads back as `x`. The sign of zero is left out: it equals zero.
pub(crate) fn number(x: f64) -> String {
    let size = x.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if (1e-5..1e16).contains(&size) {
        x.to_string()
    } else {
        format!("{x:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_understood() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert_eq!(crop("10,20,110,95"), Ok(Crop::Pixels([10, 20, 110, 95])));
        assert_eq!(crop("0.25,0,0.5,1"), Ok(Crop::Fractions([0.25, 0.0, 0.5, 1.0])));
        assert_eq!(region("10,20, 110,95"), Ok(Window { x: 10, y: 20, width: 110, height: 95 }));
        assert_eq!(duration("1h30m"), Ok(Duration::from_secs(5400)));
        assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("2.5"), Ok(Duration::from_millis(2500)));
        assert_eq!(bytes("1.5k"), Ok(1536));
        assert_eq!(bytes("8GiB"), Ok(8 << 30));
    }

    #[test]
    fn whole_numbers_are_kept_to_their_range() {
        let spp = whole(1..=u32::MAX);
        assert_eq!((spp("1"), spp("4294967295")), (Ok(1), Ok(u32::MAX)));
        for text in ["zero", "", "0", "-1", "1.5", "4294967296"] {
            assert_eq!(spp(text), Err("expected a whole number from 1 to 4294967295".to_owned()), "{text}");
        }
    }

    #[test]
    fn one_thing_is_not_many() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "sample")), ["0 samples", "1 sample", "2 samples"]);
    }

    #[test]
    fn nonsense_is_refused() {
        for text in ["", "640", "0x480", "-3x4", "640x480x3", "99999999x2"] {
            assert!(size(text).is_err(), "{text}");
        }
        for text in ["", "1,2,3", "5,5,5,9", "0.5,0.5,0.25,1", "a,b,c,d", "0.1,0.1,0.2,1.5"] {
            assert!(crop(text).is_err(), "{text}");
        }
        for text in ["", "1,2,3", "1,2,3,0", "-1,2,3,4", "1,2,3,4,5", "0.5,0,1,1"] {
            assert!(region(text).is_err(), "{text}");
        }
        for text in ["", "soon", "3x", "m"] {
            assert!(duration(text).is_err(), "{text}");
        }
        for text in ["", "much", "-1G", "0"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }
}
