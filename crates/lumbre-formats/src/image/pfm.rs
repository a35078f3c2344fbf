//! Portable float maps: a text header `PF` or `Pf`, the size and a scale whose sign is the byte order, then
//! single-precision numbers from the bottom row up (P. Debevec's format, after the Netpbm ones).

use std::sync::Arc;

use lumbre_image::{Bitmap, Channels, Encoding, Image, PixelData};

use super::{ImageFile, ImageFormat};
use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, FormatError, Place, quoted_bytes};

pub(super) fn read(bytes: &[u8], name: &Arc<str>, budget: &Budget) -> Result<ImageFile, FormatError> {
    let fault = |at: usize, message: &str| {
        Diagnostic::error(message).at(Place::binary(name.clone(), at.min(bytes.len()) as u64, ""))
    };
    let channels = if bytes.starts_with(b"PF") { Channels::Rgb } else { Channels::Y };
    let mut at = 2;
    let mut word = |what: &str| {
        let is_space = |b: &u8| b.is_ascii_whitespace();
        let start = at + bytes[at.min(bytes.len())..].iter().take_while(|b| is_space(b)).count();
        let length = bytes[start.min(bytes.len())..].iter().take(64).take_while(|b| !is_space(b)).count();
        at = start + length;
        let text = std::str::from_utf8(&bytes[start.min(bytes.len())..at.min(bytes.len())]).unwrap_or("");
        (
            start,
            text,
            fault(start, &format!("wrong {what} in PFM header")).found(quoted_bytes(text.as_bytes())),
        )
    };
    let mut side = |what| {
        let (_, text, wrong) = word(what);
        let number = text.parse::<u32>().ok().filter(|&n| n > 0);
        number.ok_or_else(|| FormatError::from(wrong.expected("a whole number from 1")))
    };
    let (width, height) = (side("width")?, side("height")?);
    let (_, text, wrong) = word("scale");
    let scale = text.parse::<f32>().ok().filter(|s| s.is_finite() && *s != 0.0);
    let scale = scale.ok_or_else(|| FormatError::from(wrong.expected("a number that is not 0")))?;
    // One space ends the header, or two bytes in files that passed through a text mode.
    let samples = u64::from(width) * u64::from(height) * channels.count() as u64;
    let start = at + 1;
    let found = bytes.len().saturating_sub(start) as u64;
    let expected = samples.saturating_mul(4);
    if found < expected {
        let wrong = fault(start, "PFM image is truncated").found(format!("{found} bytes of pixels"));
        return Err(wrong.expected(format!("{expected} for {width} by {height}")).into());
    }
    let mut data: Vec<f32> = budget.vec(samples, "image")?;
    let row_bytes = width as usize * channels.count() * 4;
    for row in bytes[start..start + expected as usize].chunks_exact(row_bytes).rev() {
        data.extend(row.chunks_exact(4).map(|b| {
            let b = [b[0], b[1], b[2], b[3]];
            let v = if scale < 0.0 { f32::from_le_bytes(b) } else { f32::from_be_bytes(b) };
            v * scale.abs()
        }));
    }
    let bitmap = Bitmap::new(width, height, channels, PixelData::F32(data), Encoding::Linear);
    Ok(ImageFile::new(ImageFormat::Pfm, bitmap.expect("counted above")))
}

pub(super) fn encode(image: &Image) -> Vec<u8> {
    let mut out = format!("PF\n{} {}\n-1.0\n", image.width(), image.height()).into_bytes();
    out.reserve_exact(image.pixels().len() * 12);
    for row in image.pixels().chunks(image.width().max(1) as usize).rev() {
        out.extend(row.iter().flat_map(|c| c.to_array()).flat_map(f32::to_le_bytes));
    }
    out
}
