//! Image files: PNG, JPEG, EXR, HDR, PFM, TGA, BMP, QOI and WebP in; PNG, JPEG, QOI, WebP, EXR, HDR and PFM out, and
//! animated GIF.

mod damage;
mod decode;
mod exr_file;
mod gif;
mod hdr;
mod origin;
mod pfm;
mod scene;
mod write;

use std::path::Path;
use std::sync::Arc;

use lumbre_image::{Bitmap, Channels, ColourSpace, Encoding, Image, Layers, PixelData, Rgb, Window};

use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, quoted};
use crate::input::Input;

pub use gif::GifWriter;
pub use origin::is_own_image;
pub(crate) use scene::open_scene_image;
pub use write::{
    ExrCompression, ExrPrecision, PngDepth, WriteOptions, encode_image, encode_layers, rgb8, write_image,
    write_layers,
};

/// A kind of image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ImageFormat {
    /// Portable Network Graphics.
    Png,
    /// JPEG (JFIF, Exif).
    Jpeg,
    /// OpenEXR.
    Exr,
    /// Radiance RGBE.
    Hdr,
    /// Portable float map.
    Pfm,
    /// Truevision TGA; read only.
    Tga,
    /// Windows bitmap; read only.
    Bmp,
    /// Quite OK Image.
    Qoi,
    /// WebP; read with losses or without, written without.
    WebP,
}

impl ImageFormat {
    /// The format of a file name's extension, in any case.
    pub fn from_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "png" => Some(Self::Png),
            "jpg" | "jpeg" | "jpe" => Some(Self::Jpeg),
            "exr" => Some(Self::Exr),
            "hdr" | "pic" | "rgbe" => Some(Self::Hdr),
            "pfm" => Some(Self::Pfm),
            "tga" => Some(Self::Tga),
            "bmp" | "dib" => Some(Self::Bmp),
            "qoi" => Some(Self::Qoi),
            "webp" => Some(Self::WebP),
            _ => None,
        }
    }

    /// The format of a file's first bytes. TGA has no signature there, but may have one at its end.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let marks: [(&[u8], Self); 10] = [
            (b"\x89PNG\r\n\x1A\n", Self::Png),
            (b"\xFF\xD8\xFF", Self::Jpeg),
            (b"\x76\x2F\x31\x01", Self::Exr),
            (b"#?RADIANCE", Self::Hdr),
            (b"#?RGBE", Self::Hdr),
            (b"#?AUTOPANO", Self::Hdr),
            (b"PF", Self::Pfm),
            (b"Pf", Self::Pfm),
            (b"BM", Self::Bmp),
            (b"qoif", Self::Qoi),
        ];
        if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
            return Some(Self::WebP);
        }
        let marked = marks.into_iter().find(|(mark, _)| bytes.starts_with(mark)).map(|(_, format)| format);
        marked.or_else(|| bytes.ends_with(b"TRUEVISION-XFILE.\0").then_some(Self::Tga))
    }

    /// Its usual name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Exr => "EXR",
            Self::Hdr => "HDR",
            Self::Pfm => "PFM",
            Self::Tga => "TGA",
            Self::Bmp => "BMP",
            Self::Qoi => "QOI",
            Self::WebP => "WebP",
        }
    }

    /// Whether it can be written.
    pub const fn is_writable(self) -> bool {
        matches!(self, Self::Png | Self::Jpeg | Self::Exr | Self::Hdr | Self::Pfm | Self::Qoi | Self::WebP)
    }

    /// The names of the endings of files that can be written.
    pub const WRITABLE: &'static str = ".png, .jpg, .webp, .qoi, .exr, .hdr or .pfm";

    /// Whether it stores unbounded light rather than display values.
    pub const fn is_high_range(self) -> bool {
        matches!(self, Self::Exr | Self::Hdr | Self::Pfm)
    }
}

/// An image file as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageFile {
    /// The format of the file.
    pub format: ImageFormat,
    /// The stored pixels.
    pub bitmap: Bitmap,
    /// The primaries of its colours.
    pub colour_space: ColourSpace,
    /// The position of those pixels on the image plane (EXR's data window).
    pub data_window: Window,
    /// The extent of the image on that plane (EXR's display window).
    pub display_window: Window,
}

impl ImageFile {
    fn new(format: ImageFormat, bitmap: Bitmap) -> Self {
        let window = Window { x: 0, y: 0, width: bitmap.width(), height: bitmap.height() };
        Self {
            format,
            bitmap,
            colour_space: ColourSpace::REC709,
            data_window: window,
            display_window: window,
        }
    }

    /// One grey pixel, in place of an image that is missing.
    pub(crate) fn grey() -> Self {
        let pixel = PixelData::F32(vec![0.5]);
        let bitmap = Bitmap::new(1, 1, Channels::Y, pixel, Encoding::Linear);
        Self::new(ImageFormat::Pfm, bitmap.expect("one number for one pixel"))
    }

    /// The image as light on the primaries of Rec. 709, over its display window: black and transparent where
    /// the file has no pixels.
    ///
    /// # Errors
    /// [`FormatError::Limit`] when the budget does not allow this many pixels.
    pub fn to_image(&self, budget: &Budget) -> Result<Image, FormatError> {
        let (data, display) = (self.data_window, self.display_window);
        let pixels = |w: Window| u64::from(w.width) * u64::from(w.height);
        let each = size_of::<Rgb>() as u64 + if self.bitmap.channels().alpha().is_some() { 4 } else { 0 };
        let placed = if data == display { 0 } else { pixels(display) };
        let _while_made = budget.hold(pixels(data).saturating_mul(each), "image")?;
        budget.bytes(placed.saturating_mul(each), "image")?;
        let image = self.bitmap.to_image();
        let image = match self.colour_space.adapted_to(&ColourSpace::REC709) {
            Some(_) if self.colour_space != ColourSpace::REC709 => {
                image.map(|c| self.colour_space.to_rec709([c.r, c.g, c.b].map(f64::from)))
            }
            _ => image,
        };
        if data == display {
            return Ok(image);
        }
        Ok(image.placed(
            data.x.saturating_sub(display.x),
            data.y.saturating_sub(display.y),
            display.width,
            display.height,
        ))
    }
}

/// Reads the image file `path`.
///
/// # Errors
/// As for [`Input::open`] and [`read_image`].
pub fn open_image(
    path: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<ImageFile, FormatError> {
    let input = Input::open(path, budget)?;
    read_image(&input, input.name(), budget, diagnostics)
}

/// Reads an image from the bytes of its file, in the format of its bytes, or else of the extension of `name`.
/// The pixels stay charged to the budget.
///
/// # Errors
/// [`FormatError::Input`] when the bytes are not an image of a supported format or are damaged, and
/// [`FormatError::Limit`] when it has more pixels than the budget allows.
pub fn read_image(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<ImageFile, FormatError> {
    let place = || Place::whole(name.clone());
    match format_of(bytes, name)? {
        ImageFormat::Exr => exr_file::read(bytes, name, budget, diagnostics),
        ImageFormat::Hdr => hdr::read(bytes, name, budget, diagnostics),
        ImageFormat::Pfm => pfm::read(bytes, name, budget),
        format => decode::read(format, bytes, name, budget, diagnostics),
    }
    .map_err(|e| e.or_at(place))
}

/// Reads every channel of an image file; channels of an EXR file with several parts have the part's name as a
/// prefix.
///
/// # Errors
/// As for [`read_image`], and [`FormatError::Input`] when two channels have the same name or parts have
/// different sizes.
pub fn read_layers(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<Layers, FormatError> {
    if format_of(bytes, name)? == ImageFormat::Exr {
        return exr_file::read_layers(bytes, name, budget);
    }
    let image = read_image(bytes, name, budget, diagnostics)?.to_image(budget)?;
    Ok(Layers::from_image(&image))
}

/// Checks the size that an image unpacks to: the rule is the same for all kinds, and an image of one colour of
/// 4096 by 4096 pixels passes.
pub(crate) fn check_expansion(
    bytes: &[u8],
    unpacked: u64,
    place: &Place,
    budget: &Budget,
) -> Result<(), FormatError> {
    budget
        .expansion(bytes.len() as u64, unpacked, "image")
        .map_err(|source| FormatError::Limit { place: Some(place.clone()), source })
}

fn format_of(bytes: &[u8], name: &Arc<str>) -> Result<ImageFormat, FormatError> {
    let by_name = ImageFormat::from_path(Path::new(&**name));
    if let Some(format) = ImageFormat::from_bytes(bytes) {
        return Ok(format);
    }
    if by_name == Some(ImageFormat::Tga) {
        return Ok(ImageFormat::Tga);
    }
    // Unsupported formats, for the error message.
    let others: [(&[u8], &str); 7] = [
        (b"GIF8", "a GIF image"),
        (b"II*\0", "a TIFF image"),
        (b"MM\0*", "a TIFF image"),
        (b"DDS ", "a DDS texture"),
        (b"\xABKTX", "a KTX texture"),
        (b"\0\0\0\x0CJXL ", "a JPEG XL image"),
        (b"\xFF\x0A", "a JPEG XL image"),
    ];
    let avif = matches!(bytes.get(4..12), Some(b"ftypavif" | b"ftypheic" | b"ftypmif1"));
    let found = match others.iter().find(|(mark, _)| bytes.starts_with(mark)) {
        Some((_, kind)) => (*kind).to_owned(),
        None if avif => "an AVIF or HEIF image".to_owned(),
        None if bytes.is_empty() => "an empty file".to_owned(),
        None => format!(
            "a file that starts with {}",
            quoted(&bytes[..bytes.len().min(8)].escape_ascii().to_string())
        ),
    };
    let wrong = Diagnostic::error("not an image that can be read").at(Place::whole(name.clone()));
    Err(wrong.found(found).expected("PNG, JPEG, EXR, HDR, PFM, TGA, BMP, QOI or WebP").into())
}
