//! Writing images: tone-mapped into PNG, JPEG, QOI and WebP, linear light into EXR, HDR and PFM.

use std::io::{self, Write};
use std::path::Path;

use image::codecs::qoi::QoiEncoder;
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder};
use lumbre_image::{Image, Layers, Rgb, ToneMap, unit_to_u8, unit_to_u16};

use super::{ImageFormat, exr_file, hdr, origin, pfm};
use crate::atomic::atomic_write;
use crate::diagnostic::{Diagnostic, FormatError, Place, quoted};

/// Options of writing an image.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// The tone mapping operator, for the formats that store display values.
    pub tone_map: ToneMap,
    /// The exposure in stops before tone mapping.
    pub exposure: f32,
    /// The bit depth of PNG.
    pub png_depth: PngDepth,
    /// JPEG quality, from 1 to 100.
    pub jpeg_quality: u8,
    /// The precision of EXR's colour channels.
    pub exr_precision: ExrPrecision,
    /// The compression of EXR, always lossless.
    pub exr_compression: ExrCompression,
    /// If the image is a crop of a larger one: the position of its top left pixel (x, y) and the larger one's
    /// width and height. Written to EXR as data and display window; other formats have only the crop.
    pub exr_window: Option<(i32, i32, u32, u32)>,
    /// The denoiser that the image went through, for the metadata of EXR (attribute `denoiser`) and PNG (text
    /// `Denoiser`).
    pub denoiser: Option<&'static str>,
    /// Attributes of EXR's own: texts by name.
    pub exr_attributes: Vec<(String, String)>,
    /// Further metadata by name, for EXR (lines of the attribute `comments`) and PNG (texts). Names are of letters and
    /// digits.
    pub metadata: Vec<(String, String)>,
}

impl Default for WriteOptions {
    /// No tone mapping, no exposure, 8 bits, quality 95, half precision, ZIP, not a crop, not denoised.
    fn default() -> Self {
        Self {
            tone_map: ToneMap::None,
            exposure: 0.0,
            png_depth: PngDepth::Eight,
            jpeg_quality: 95,
            exr_precision: ExrPrecision::Half,
            exr_compression: ExrCompression::Zip,
            exr_window: None,
            denoiser: None,
            exr_attributes: Vec::new(),
            metadata: Vec::new(),
        }
    }
}

/// The bit depth of PNG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PngDepth {
    /// 8 bits.
    Eight,
    /// 16 bits.
    Sixteen,
}

/// The precision of EXR's colour channels. Channels that require full precision always have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExrPrecision {
    /// Half precision: 11 bits, up to 65504. A channel with a finite number beyond has single precision.
    Half,
    /// Single precision.
    Float,
}

/// The compression of EXR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExrCompression {
    /// None.
    None,
    /// Run-length encoding: fast.
    Rle,
    /// Deflate, 16 rows at a time.
    Zip,
    /// Wavelets: best for noise.
    Piz,
}

/// Writes an image to `path` atomically, in the format of its extension.
///
/// Colours are premultiplied by alpha, as renders are.
///
/// # Errors
/// [`FormatError::Input`] when no writable format has this extension, and [`FormatError::Io`].
pub fn write_image(path: &Path, image: &Image, options: &WriteOptions) -> Result<(), FormatError> {
    let format = writable_format(path)?;
    write_bytes(path, encode_image(image, format, options))
}

/// Writes named channels to `path`: all of them into EXR, only the colours `R`, `G`, `B` and `A` into other
/// formats.
///
/// # Errors
/// As for [`write_image`], and [`FormatError::Input`] when a format that stores only colours gets none.
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
/// When the format is not writable ([`ImageFormat::is_writable`]), or cannot store an image of this size.
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
        ImageFormat::Qoi => encode_qoi(image, options),
        ImageFormat::WebP => encode_webp(image, options),
        ImageFormat::Tga | ImageFormat::Bmp => {
            Err(io::Error::new(io::ErrorKind::Unsupported, format!("{} is not written", format.name())))
        }
    }
}

/// The bytes of an EXR file with these channels.
///
/// # Errors
/// When there are none, or one has a name that EXR cannot store.
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
        wrong.found(ending).expected(ImageFormat::WRITABLE).into()
    })
}

fn write_bytes(path: &Path, encoded: io::Result<Vec<u8>>) -> Result<(), FormatError> {
    let bytes = encoded.map_err(|e| FormatError::io(path, "cannot encode", e))?;
    atomic_write(path, |out: &mut dyn Write| out.write_all(&bytes))
}

/// The displayed colour and alpha of every pixel, not premultiplied.
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
    let software = origin::SOFTWARE.to_owned();
    encoder.add_text_chunk("Software".to_owned(), software).map_err(io::Error::other)?;
    if let Some(denoiser) = options.denoiser {
        encoder.add_text_chunk("Denoiser".to_owned(), denoiser.to_owned()).map_err(io::Error::other)?;
    }
    for (name, text) in &options.metadata {
        let added = encoder.add_itxt_chunk(name.clone(), text.clone());
        added.map_err(io::Error::other)?;
    }
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

/// Like PNG, with 8 bits.
fn encode_qoi(image: &Image, options: &WriteOptions) -> io::Result<Vec<u8>> {
    let (data, kind) = eight_bits(image, options);
    let mut out = Vec::new();
    let encoder = QoiEncoder::new(&mut out);
    encoder.write_image(&data, image.width(), image.height(), kind).map_err(io::Error::other)?;
    Ok(out)
}

/// Like PNG, with 8 bits and without losses.
fn encode_webp(image: &Image, options: &WriteOptions) -> io::Result<Vec<u8>> {
    const MAX_SIDE: u32 = 16_384;
    if image.width().max(image.height()) > MAX_SIDE {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "WebP images have at most 16384 pixels a side",
        ));
    }
    let (data, kind) = eight_bits(image, options);
    let mut out = Vec::new();
    let mut encoder = WebPEncoder::new_lossless(&mut out);
    encoder.set_exif_metadata(origin::EXIF.to_vec()).map_err(io::Error::other)?;
    encoder.write_image(&data, image.width(), image.height(), kind).map_err(io::Error::other)?;
    Ok(out)
}

/// Displayed values with 8 bits, with alpha if the image has it, and what they are.
fn eight_bits(image: &Image, options: &WriteOptions) -> (Vec<u8>, ExtendedColorType) {
    let has_alpha = image.alpha().is_some();
    let data = shown(image, options)
        .flat_map(|([r, g, b], a)| [Some(r), Some(g), Some(b), has_alpha.then_some(a)])
        .flatten()
        .map(unit_to_u8)
        .collect();
    (data, if has_alpha { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 })
}

/// Displayed values with 8 bits, three a pixel, row by row from the top left. An image with alpha is shown over black.
pub fn rgb8(image: &Image, options: &WriteOptions) -> Vec<u8> {
    let encode = |&light: &Rgb| options.tone_map.encode(light, options.exposure).to_u8();
    image.pixels().iter().flat_map(encode).collect()
}

fn encode_jpeg(image: &Image, options: &WriteOptions) -> io::Result<Vec<u8>> {
    let (Ok(width), Ok(height)) = (u16::try_from(image.width()), u16::try_from(image.height())) else {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "JPEG images have at most 65535 pixels a side",
        ));
    };
    let data = rgb8(image, options);
    let mut out = Vec::new();
    let quality = options.jpeg_quality.clamp(1, 100);
    let mut encoder = jpeg_encoder::Encoder::new(&mut out, quality);
    encoder.add_exif_metadata(origin::EXIF).map_err(io::Error::other)?;
    if quality >= 90 {
        encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_1_1);
    }
    encoder.encode(&data, width, height, jpeg_encoder::ColorType::Rgb).map_err(io::Error::other)?;
    Ok(out)
}
