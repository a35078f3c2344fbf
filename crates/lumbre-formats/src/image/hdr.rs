//! Radiance pictures (RGBE): G. Ward, "Real pixels", Graphics Gems II, 1991, and the Radiance reference manual.

use std::sync::Arc;

use lumbre_image::{Bitmap, Channels, Encoding, Image, PixelData, Rgb};
use lumbre_math::Elementary;

use super::origin::SOFTWARE;
use super::{ImageFile, ImageFormat, check_expansion};
use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, quoted, quoted_bytes};

pub(super) fn read(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<ImageFile, FormatError> {
    let mut reader = Reader { bytes, at: 0, name };
    let Header { width, height, flip_x, flip_y, multipliers } = reader.header(diagnostics)?;
    let pixels = u64::from(width) * u64::from(height);
    // A run of 127 takes two bytes, and old runs can be longer: an upper bound for the former, generous to the
    // latter.
    if pixels > (1 << 16) + 256 * bytes.len() as u64 {
        let found = format!("{width} by {height} pixels in {} bytes", bytes.len());
        return Err(reader.fault("HDR image of an impossible size").found(found).into());
    }
    check_expansion(bytes, pixels * 12, &Place::whole(name.clone()), budget)?;
    let mut data: Vec<f32> = budget.vec(pixels * 3, "image")?;
    data.resize(pixels as usize * 3, 0.0);
    let mut row = vec![[0u8; 4]; width as usize];
    for y in 0..height {
        reader.row(&mut row, y)?;
        let into = if flip_y { height - 1 - y } else { y } as usize * width as usize * 3;
        for (x, rgbe) in row.iter().enumerate() {
            let x = if flip_x { width as usize - 1 - x } else { x };
            let light = light(*rgbe).to_array();
            for ((into, c), multiplier) in data[into + 3 * x..].iter_mut().zip(light).zip(multipliers) {
                // Nothing finite becomes infinite.
                *into = (f64::from(c) / multiplier).min(f64::from(f32::MAX)) as f32;
            }
        }
    }
    let bitmap = Bitmap::new(width, height, Channels::Rgb, PixelData::F32(data), Encoding::Linear);
    Ok(ImageFile::new(ImageFormat::Hdr, bitmap.expect("counted above")))
}

/// The light of shared-exponent bytes, as in other renderers; Ward's own decoder adds half a step.
fn light([r, g, b, e]: [u8; 4]) -> Rgb {
    if e == 0 {
        return Rgb::BLACK;
    }
    let step = f64::from(i32::from(e) - 136).exponential_2() as f32;
    Rgb::new(f32::from(r), f32::from(g), f32::from(b)) * step
}

/// 255 steps of the largest exponent.
const BRIGHTEST: f32 = 255.0 * 2.0 * (1u128 << 118) as f32;

/// The nearest shared-exponent bytes; negative light and NaN become 0, and too bright light the maximum.
fn shared_exponent(c: Rgb) -> [u8; 4] {
    let c = c.map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, BRIGHTEST) });
    let peak = c.max_component();
    if peak < 1e-38 {
        return [0; 4];
    }
    // The exponent for which the rounded peak is in [128, 256).
    let mut exponent = peak.logarithm_2().floor() as i32 + 1;
    let scaled =
        |exponent: i32| c.map(|c| (f64::from(c) * f64::from(8 - exponent).exponential_2()).rounded() as f32);
    while scaled(exponent).max_component() > 255.0 {
        exponent += 1;
    }
    while scaled(exponent).max_component() < 128.0 {
        exponent -= 1;
    }
    let [r, g, b] = scaled(exponent).to_array().map(|c| c as u8);
    match u8::try_from(exponent + 128) {
        Ok(e) if e > 0 => [r, g, b, e],
        _ => [0; 4],
    }
}

pub(super) fn encode(image: &Image) -> Vec<u8> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let mut out =
        format!("#?RADIANCE\nSOFTWARE={SOFTWARE}\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n")
            .into_bytes();
    for row in image.pixels().chunks(width.max(1)) {
        let row: Vec<[u8; 4]> = row.iter().map(|&c| shared_exponent(c)).collect();
        // Run-length encoding is for widths of 15 bits, whose marker must not look like a pixel.
        if !(8..32768).contains(&width) {
            out.extend(row.as_flattened());
            continue;
        }
        out.extend([2, 2, (width >> 8) as u8, width as u8]);
        for c in 0..4 {
            let plane: Vec<u8> = row.iter().map(|pixel| pixel[c]).collect();
            encode_runs(&plane, &mut out);
        }
    }
    out
}

fn encode_runs(plane: &[u8], out: &mut Vec<u8>) {
    let run_at = |i: usize| plane[i..].iter().take(127).take_while(|&&b| b == plane[i]).count();
    let mut i = 0;
    while i < plane.len() {
        let run = run_at(i);
        if run >= 4 {
            out.extend([128 + run as u8, plane[i]]);
            i += run;
            continue;
        }
        let mut end = i + run;
        while end < plane.len() && end - i < 128 && run_at(end) < 4 {
            end += 1;
        }
        end = end.min(i + 128);
        out.push((end - i) as u8);
        out.extend(&plane[i..end]);
        i = end;
    }
}

/// What a header says.
struct Header {
    width: u32,
    height: u32,
    /// Whether columns are reversed.
    flip_x: bool,
    /// Whether rows are reversed.
    flip_y: bool,
    /// What the pixels have been multiplied by: the product of all exposures and colour corrections.
    multipliers: [f64; 3],
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    name: &'a Arc<str>,
}

impl<'a> Reader<'a> {
    fn fault(&self, message: &str) -> Diagnostic {
        Diagnostic::error(message).at(Place::binary(self.name.clone(), self.at as u64, ""))
    }

    fn line(&mut self) -> Result<&'a [u8], FormatError> {
        let rest = &self.bytes[self.at..];
        let Some(end) = rest.iter().take(4096).position(|&b| b == b'\n') else {
            return Err(self
                .fault("HDR header without an end")
                .expected("a line of at most 4096 bytes")
                .into());
        };
        self.at += end + 1;
        let line = &rest[..end];
        Ok(line.strip_suffix(b"\r").unwrap_or(line))
    }

    fn header(&mut self, diagnostics: &mut Diagnostics) -> Result<Header, FormatError> {
        self.line()?;
        let mut multipliers = [1.0; 3];
        loop {
            let start = self.at;
            let line = self.line()?;
            if line.is_empty() {
                break;
            }
            let here = || Place::binary(self.name.clone(), start as u64, "");
            let value =
                |key: &[u8]| line.strip_prefix(key).map(|v| String::from_utf8_lossy(v).trim().to_owned());
            if let Some(format) = value(b"FORMAT=") {
                if format != "32-bit_rle_rgbe" {
                    let wrong = Diagnostic::error("unsupported HDR format").at(here());
                    return Err(wrong.found(quoted(&format)).expected("32-bit_rle_rgbe").into());
                }
                continue;
            }
            let exposure = value(b"EXPOSURE=").map(|text| (text, 1));
            let Some((text, count)) = exposure.or_else(|| value(b"COLORCORR=").map(|text| (text, 3))) else {
                continue;
            };
            let numbers: Option<Vec<f64>> =
                text.split_ascii_whitespace().map(|word| word.parse().ok()).collect();
            let numbers = numbers.filter(|numbers| numbers.len() == count);
            let after = numbers.map(|numbers| [0, 1, 2].map(|c| multipliers[c] * numbers[c % count]));
            // Beyond these no light of single precision is left.
            match after.filter(|after| after.iter().all(|m| (1e-60..=1e60).contains(m))) {
                Some(after) => multipliers = after,
                None => {
                    let what = "EXPOSURE or COLORCORR of an HDR image that is not positive is not applied";
                    diagnostics.push(Diagnostic::warning(what).at(here()).found(quoted(&text)));
                }
            }
        }
        let start = self.at;
        let line = self.line()?;
        let text = String::from_utf8_lossy(line);
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let size = |word: &str| word.parse::<u32>().ok().filter(|&n| n > 0);
        if let [y @ ("-Y" | "+Y"), height, x @ ("+X" | "-X"), width] = words[..]
            && let (Some(width), Some(height)) = (size(width), size(height))
        {
            return Ok(Header { width, height, flip_x: x == "-X", flip_y: y == "+Y", multipliers });
        }
        let wrong = Diagnostic::error("unsupported HDR resolution");
        let wrong = wrong.at(Place::binary(self.name.clone(), start as u64, ""));
        Err(wrong.found(quoted_bytes(line)).expected("-Y HEIGHT +X WIDTH").into())
    }

    fn take(&mut self, count: usize, row: u32) -> Result<&'a [u8], FormatError> {
        match self.bytes.get(self.at..self.at + count) {
            Some(taken) => {
                self.at += count;
                Ok(taken)
            }
            None => Err(Diagnostic::error("HDR image is truncated")
                .at(Place::binary(self.name.clone(), self.bytes.len() as u64, format!("/row/{row}")))
                .into()),
        }
    }

    fn row(&mut self, row: &mut [[u8; 4]], y: u32) -> Result<(), FormatError> {
        let mark = self.bytes.get(self.at..self.at + 4);
        let by_planes = (8..32768).contains(&row.len())
            && mark.is_some_and(|m| {
                m[0] == 2 && m[1] == 2 && usize::from(m[2]) << 8 | usize::from(m[3]) == row.len()
            });
        if !by_planes {
            return self.old_row(row, y);
        }
        self.at += 4;
        for c in 0..4 {
            let mut x = 0;
            while x < row.len() {
                let count = usize::from(self.take(1, y)?[0]);
                let (run, count) = if count > 128 { (true, count - 128) } else { (false, count) };
                if count == 0 || count > row.len() - x {
                    let wrong = self
                        .fault("HDR run does not fit its row")
                        .found(format!("{count} pixels at column {x}"));
                    return Err(wrong.expected(format!("1 to {}", row.len() - x)).into());
                }
                let values = self.take(if run { 1 } else { count }, y)?;
                for (i, pixel) in row[x..x + count].iter_mut().enumerate() {
                    pixel[c] = values[if run { 0 } else { i }];
                }
                x += count;
            }
        }
        Ok(())
    }

    /// Whole pixels, where 1 1 1 n repeats the last one n times, the next such 256 n times, and so on.
    fn old_row(&mut self, row: &mut [[u8; 4]], y: u32) -> Result<(), FormatError> {
        let mut x = 0;
        let mut shift = 0;
        while x < row.len() {
            let pixel: [u8; 4] = self.take(4, y)?.try_into().expect("four");
            if pixel[..3] != [1, 1, 1] || x == 0 {
                row[x] = pixel;
                x += 1;
                shift = 0;
                continue;
            }
            let count = if shift < 32 { usize::from(pixel[3]) << shift } else { usize::MAX };
            if count > row.len() - x {
                return Err(self
                    .fault("HDR run does not fit its row")
                    .found(format!("{count} pixels at column {x}"))
                    .into());
            }
            let last = row[x - 1];
            row[x..x + count].fill(last);
            x += count;
            shift += 8;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shared_exponent_comes_back() {
        for e in 1..=254u8 {
            for m in [128u8, 129, 200, 255] {
                let rgbe = [m, m / 2, 3, e];
                let c = light(rgbe);
                if c.r.is_normal() {
                    assert_eq!(shared_exponent(c), rgbe, "{c:?}");
                }
            }
        }
        assert_eq!(shared_exponent(Rgb::new(-1.0, f32::NAN, 0.0)), [0; 4]);
        assert_eq!(shared_exponent(Rgb::splat(f32::INFINITY))[3], 255);
    }

    #[test]
    fn light_is_kept_to_half_a_step_of_its_brightest_channel() {
        for i in 0..20_000 {
            let c = Rgb::new(1.0, 0.37, 0.011) * 2f32.powf(i as f32 / 500.0 - 20.0);
            let back = light(shared_exponent(c));
            let error = (back - c).map(f32::abs).max_component() / c.max_component();
            assert!(error <= 0.5 / 127.5 + 1e-6, "{c:?} {back:?}");
        }
    }

    #[test]
    fn runs_of_every_length_come_back() {
        for length in [8usize, 9, 127, 128, 129, 400] {
            for period in [1usize, 3, 4, 5, 200] {
                let plane: Vec<u8> = (0..length).map(|i| (i / period) as u8).collect();
                let mut out = vec![];
                encode_runs(&plane, &mut out);
                let mut back = vec![];
                let mut at = 0;
                while at < out.len() {
                    let count = usize::from(out[at]);
                    if count > 128 {
                        back.extend(std::iter::repeat_n(out[at + 1], count - 128));
                        at += 2;
                    } else {
                        back.extend(&out[at + 1..at + 1 + count]);
                        at += 1 + count;
                    }
                }
                assert_eq!(back, plane, "{length} {period}");
            }
        }
    }
}
