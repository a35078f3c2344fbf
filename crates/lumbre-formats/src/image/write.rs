//! Writing images: tone-mapped numbers for a display into PNG and JPEG, light as it is into EXR, HDR and PFM.

use std::io::{self, Write};
use std::path::Path;

use lumbre_image::{Image, Layers, Rgb, ToneMap, unit_to_u8, unit_to_u16};

use super::{ImageFormat, exr_file, hdr, pfm};
use crate::atomic::atomic_write;
use crate::diagnostic::{Diagnostic, FormatError, Place, quoted};

/// How an image is written.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// How light is brought within what a display shows, in PNG and JPEG.
    pub tone_map: ToneMap,
    /// Stops brighter before that.
    pub exposure: f32,
    /// Bits of a PNG's channel.
    pub png_depth: PngDepth,
    /// From 1 to 100.
    pub jpeg_quality: u8,
    /// The numbers of EXR's colour channels.
    pub exr_precision: ExrPrecision,
    /// How EXR is packed, always without loss.
    pub exr_compression: ExrCompression,
    /// When the image is a part of a larger picture: where its top left pixel lies in it (x, y) and the picture's width and
    /// height. Written to EXR as data and display window; other formats have only the part.
    pub exr_window: Option<(i32, i32, u32, u32)>,
}

impl Default for WriteOptions {
    /// No tone mapping, no exposure, 8 bits, quality 95, halves, ZIP, a picture of its own.
    fn default() -> Self {
        Self {
            tone_map: ToneMap::None,
            exposure: 0.0,
            png_depth: PngDepth::Eight,
            jpeg_quality: 95,
            exr_precision: ExrPrecision::Half,
            exr_compression: ExrCompression::Zip,
            exr_window: None,
        }
    }
}

/// Bits of a PNG's channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PngDepth {
    /// 8.
    Eight,
    /// 16.
    Sixteen,
}

/// The numbers of EXR's colour channels. Channels that ask for full precision have it always.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExrPrecision {
    /// Half precision: 11 bits, up to 65504.
    Half,
    /// Single precision.
    Float,
}

/// How EXR is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExrCompression {
    /// Not at all.
    None,
    /// By runs: fast.
    Rle,
    /// By deflate, 16 rows at a time.
    Zip,
    /// By wavelets: best for noise.
    Piz,
}

/// Writes an image to `path`, in the format that its ending says, so that the path never holds a part of it.
///
/// Colours are taken to be multiplied by coverage, as renders are.
///
/// # Errors
/// [`FormatError::Input`] when no format that can be written has this ending, and [`FormatError::Io`].
pub fn write_image(path: &Path, image: &Image, options: &WriteOptions) -> Result<(), FormatError> {
    let format = writable_format(path)?;
    write_bytes(path, encode_image(image, format, options))
}

/// Writes named channels to `path`: all of them into EXR, only the colours `R`, `G`, `B` and `A` into other formats.
///
/// # Errors
/// As [`write_image`], and [`FormatError::Input`] when there are no colours for a format that has only them.
pub fn write_layers(path: &Path, layers: &Layers, options: &WriteOptions) -> Result<(), FormatError> {
    let format = writable_format(path)?;
    if format == ImageFormat::Exr {
        return write_bytes(path, encode_layers(layers, options));
    }
    let image = layers.image("").ok_or_else(|| {
        let wrong = Diagnostic::error("no colours to write").at(Place::whole(path.display().to_string()));
        FormatError::from(wrong.expected("channels R, G and B, or an .exr file"))
    })?;
    write_bytes(path, encode_image(&image, format, options))
}

/// The bytes of an image file.
///
/// # Errors
/// When the format cannot be written ([`ImageFormat::is_writable`]), or cannot hold an image of this size.
pub fn encode_image(image: &Image, format: ImageFormat, options: &WriteOptions) -> io::Result<Vec<u8>> {
    if image.width() == 0 || image.height() == 0 {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "an image without pixels"));
    }
    match format {
        ImageFormat::Png => encode_png(image, options),
        ImageFormat::Jpeg => encode_jpeg(image, options),
        ImageFormat::Exr => exr_file::encode(&Layers::from_image(image), options),
        ImageFormat::Hdr => Ok(hdr::encode(image)),
        ImageFormat::Pfm => Ok(pfm::encode(image)),
        ImageFormat::Tga | ImageFormat::Bmp | ImageFormat::Qoi | ImageFormat::WebP => {
            Err(io::Error::new(io::ErrorKind::Unsupported, format!("{} is not written", format.name())))
        }
    }
}

/// The bytes of an EXR file with these channels.
///
/// # Errors
/// When there are none, or one has a name that EXR cannot hold.
pub fn encode_layers(layers: &Layers, options: &WriteOptions) -> io::Result<Vec<u8>> {
    if layers.iter().len() == 0 || layers.width() == 0 || layers.height() == 0 {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "an image without pixels"));
    }
    exr_file::encode(layers, options)
}

fn writable_format(path: &Path) -> Result<ImageFormat, FormatError> {
    let format = ImageFormat::from_path(path).filter(|format| format.is_writable());
    format.ok_or_else(|| {
        let ending =
            path.extension().map_or_else(|| "no ending".to_owned(), |e| quoted(&e.to_string_lossy()));
        let wrong = Diagnostic::error("unknown format to write").at(Place::whole(path.display().to_string()));
        wrong.found(ending).expected(".png, .jpg, .exr, .hdr or .pfm").into()
    })
}

fn write_bytes(path: &Path, encoded: io::Result<Vec<u8>>) -> Result<(), FormatError> {
    let bytes = encoded.map_err(|e| FormatError::io(path, "cannot encode", e))?;
    atomic_write(path, |out: &mut dyn Write| out.write_all(&bytes))
}

/// Every pixel as a display gets it, with its coverage. PNG wants colours that are not multiplied by it.
fn shown<'a>(image: &'a Image, options: &'a WriteOptions) -> impl Iterator<Item = ([f32; 3], f32)> + 'a {
    image.pixels().iter().enumerate().map(|(i, &light)| {
        let alpha = image.alpha().map_or(1.0, |alpha| alpha[i]);
        let whole = 0.0 < alpha && alpha < 1.0;
        let light = if whole { light / alpha } else { light };
        (options.tone_map.encode(light, options.exposure).channels(), alpha)
    })
}

fn encode_png(image: &Image, options: &WriteOptions) -> io::Result<Vec<u8>> {
    let has_alpha = image.alpha().is_some();
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, image.width(), image.height());
    encoder.set_color(if has_alpha { png::ColorType::Rgba } else { png::ColorType::Rgb });
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let numbers = shown(image, options)
        .flat_map(|([r, g, b], a)| [Some(r), Some(g), Some(b), has_alpha.then_some(a)])
        .flatten();
    let data: Vec<u8> = match options.png_depth {
        PngDepth::Eight => {
            encoder.set_depth(png::BitDepth::Eight);
            numbers.map(unit_to_u8).collect()
        }
        PngDepth::Sixteen => {
            encoder.set_depth(png::BitDepth::Sixteen);
            numbers.flat_map(|v| unit_to_u16(v).to_be_bytes()).collect()
        }
    };
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(&data).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    Ok(out)
}

fn encode_jpeg(image: &Image, options: &WriteOptions) -> io::Result<Vec<u8>> {
    let (Ok(width), Ok(height)) = (u16::try_from(image.width()), u16::try_from(image.height())) else {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "JPEG images have at most 65535 pixels a side",
        ));
    };
    // There is no coverage: light multiplied by it is the picture over black.
    let encode = |&light: &Rgb| options.tone_map.encode(light, options.exposure).to_u8();
    let data: Vec<u8> = image.pixels().iter().flat_map(encode).collect();
    let mut out = Vec::new();
    let quality = options.jpeg_quality.clamp(1, 100);
    let mut encoder = jpeg_encoder::Encoder::new(&mut out, quality);
    if quality >= 90 {
        encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_1_1);
    }
    encoder.encode(&data, width, height, jpeg_encoder::ColorType::Rgb).map_err(io::Error::other)?;
    Ok(out)
}
