//! PNG, JPEG, TGA, BMP, QOI and WebP, by the `image` crate after checks of ours.

use std::cell::Cell;
use std::sync::Arc;

use image::codecs::{
    bmp::BmpDecoder, jpeg::JpegDecoder, png::PngDecoder, qoi::QoiDecoder, tga::TgaDecoder, webp::WebPDecoder,
};
use image::{ColorType, ImageDecoder, ImageError, Limits};
use lumbre_image::{Bitmap, Channels, Encoding, PixelData};

use super::damage::{Tracked, first_damage, place_of_size};
use super::{ImageFile, ImageFormat, check_expansion};
use crate::budget::{Budget, LimitError, LimitKind};
use crate::contained::contained;
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, in_one_line};

pub(super) fn read(
    format: ImageFormat,
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<ImageFile, FormatError> {
    let place = Place::whole(name.clone());
    if format == ImageFormat::Jpeg && !bytes.windows(2).any(|pair| pair == [0xFF, 0xD9]) {
        // Its decoder silently fills missing data with grey.
        diagnostics.push(
            Diagnostic::warning("JPEG image without an end: its last rows may be missing").at(place.clone()),
        );
    }
    if let (ImageFormat::Png, Some(&[a, b, c, d, e, f, g, h])) =
        (format, bytes.get(16..).and_then(<[u8]>::first_chunk))
    {
        // Its decoder allocates a row before limits can be set.
        let (width, height) = (u32::from_be_bytes([a, b, c, d]), u32::from_be_bytes([e, f, g, h]));
        check_size(format, width, height, bytes, &place)?;
    }
    contained(&format!("{} image", format.name()), &place, || {
        let at = Cell::new(0);
        let source = Tracked::new(bytes, &at);
        let file = Encoded { format, bytes, place: &place, budget, at: &at };
        let fault = |e| file.fault(e);
        match format {
            // Its chunks may allocate memory before limits can be set on a decoder.
            ImageFormat::Png => {
                file.decode(PngDecoder::with_limits(source, profile_limits(bytes, budget)).map_err(fault)?)
            }
            ImageFormat::Jpeg => file.decode(JpegDecoder::new(source).map_err(fault)?),
            ImageFormat::Tga => file.decode(TgaDecoder::new(source).map_err(fault)?),
            ImageFormat::Bmp => file.decode(BmpDecoder::new(source).map_err(fault)?),
            ImageFormat::WebP => file.decode(WebPDecoder::new(source).map_err(fault)?),
            _ => file.decode(QoiDecoder::new(source).map_err(fault)?),
        }
    })
}

/// A file that is decoded.
#[derive(Clone, Copy)]
struct Encoded<'a> {
    format: ImageFormat,
    bytes: &'a [u8],
    place: &'a Place,
    budget: &'a Budget,
    /// How far its decoder has read it.
    at: &'a Cell<u64>,
}

impl Encoded<'_> {
    fn decode(self, mut decoder: impl ImageDecoder) -> Result<ImageFile, FormatError> {
        let Self { format, bytes, place, budget, .. } = self;
        let (width, height) = decoder.dimensions();
        let pixels = check_size(format, width, height, bytes, place)?;
        let colour = decoder.color_type();
        let channels = Channels::from_count(usize::from(colour.channel_count())).expect("one to four");
        let count = pixels * channels.count() as u64;
        let fault = |e| self.fault(e);
        // A progressive JPEG keeps all its coefficients, two bytes each, in addition to the pixels.
        let scratch = if format == ImageFormat::Jpeg { count * 2 } else { 0 };
        let unpacked = u64::from(colour.bytes_per_pixel()) * pixels;
        check_expansion(bytes, unpacked, place, budget)?;
        let _scratch = budget.hold(scratch, "decoding an image")?;
        let data = match colour {
            ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => {
                let mut data = vec![0u8; budget.array::<u8>(count, "image")?];
                decoder.set_limits(limits(bytes, budget)).map_err(fault)?;
                decoder.read_image(&mut data).map_err(fault)?;
                PixelData::U8(data)
            }
            ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
                let mut data = vec![0u16; budget.array::<u16>(count, "image")?];
                decoder.set_limits(limits(bytes, budget)).map_err(fault)?;
                decoder.read_image(bytemuck::cast_slice_mut(&mut data)).map_err(fault)?;
                PixelData::U16(data)
            }
            other => {
                let wrong =
                    Diagnostic::error(format!("unsupported {} image", format.name())).at(place.clone());
                let bits = other.bits_per_pixel() / u16::from(other.channel_count());
                let found = format!("{bits} bits a channel");
                return Err(wrong.found(found).expected("8 or 16 bits a channel").into());
            }
        };
        let bitmap = Bitmap::new(width, height, channels, data, Encoding::Srgb).expect("counted above");
        Ok(ImageFile::new(format, bitmap))
    }

    fn fault(self, error: ImageError) -> FormatError {
        let Self { format, bytes, place, budget, at } = self;
        let kind = match error {
            ImageError::Unsupported(_) => "unsupported",
            ImageError::Limits(_) => {
                let limit = budget.limits().memory;
                let what = format!("decoding a {} image", format.name());
                let source =
                    LimitError { what, kind: LimitKind::Memory, needed: limit.saturating_add(1), limit };
                return FormatError::Limit { place: Some(place.clone()), source };
            }
            _ => "damaged",
        };
        let at = match kind {
            "damaged" => Place::binary(place.file.clone(), first_damage(format, bytes, at.get()), ""),
            _ => place.clone(),
        };
        let wrong = Diagnostic::error(format!("{kind} {} image", format.name())).at(at);
        wrong.because(in_one_line(&error.to_string())).into()
    }
}

/// The number of pixels, checked against the maximal expansion of the format: a larger header is damaged or
/// malicious.
fn check_size(
    format: ImageFormat,
    width: u32,
    height: u32,
    bytes: &[u8],
    place: &Place,
) -> Result<u64, FormatError> {
    let most_per_byte = match format {
        ImageFormat::Png => 1032 * 8,
        ImageFormat::Jpeg => 1024,
        ImageFormat::Tga | ImageFormat::Bmp => 128,
        // A uniform image takes almost no space.
        ImageFormat::WebP => 1 << 17,
        _ => 62,
    };
    let pixels = u64::from(width) * u64::from(height);
    if 0 < pixels && pixels <= (1 << 16) + most_per_byte * bytes.len() as u64 {
        return Ok(pixels);
    }
    let at =
        place_of_size(format).map_or_else(|| place.clone(), |at| Place::binary(place.file.clone(), at, ""));
    let wrong = Diagnostic::error(format!("{} image of an impossible size", format.name())).at(at);
    Err(wrong.found(format!("{width} by {height} pixels in {} bytes", bytes.len())).into())
}

/// The limit that holds for whatever else an image of this many bytes unpacks, such as a colour profile.
fn limits(bytes: &[u8], budget: &Budget) -> Limits {
    let most =
        (bytes.len() as u64).saturating_mul(budget.limits().expansion).max(crate::Limits::FREE_EXPANSION);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(budget.memory_left().min(most));
    limits
}

/// The limit of what stands before the pixels of an image.
fn profile_limits(bytes: &[u8], budget: &Budget) -> Limits {
    const FREE: u64 = 32 << 20;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(budget.memory_left().min(FREE.max(16 * bytes.len() as u64)));
    limits
}
