//! Images of a scene.

use std::sync::Arc;

use lumbre_image::Encoding;
use lumbre_math::Elementary;
use lumbre_shading::Spectrum;
use lumbre_shading::pov::{Colour, ImageMap, ImageProjection, ImageSource};

use super::lexer::Kind;
use super::palette::Indexed;
use super::{Parser, Result};
use crate::diagnostic::quoted;
use crate::image::ImageFormat;
use crate::{Diagnostic, Input};

/// What the numbers of a file are.
#[derive(Clone, Copy, PartialEq)]
enum Decoding {
    /// Those of a screen, or light where the format has light.
    Usual,
    /// Light by this power of them.
    Power(f64),
    /// Colours of the working space, or heights.
    Stored,
}

/// What an image is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Use {
    /// Light, in the working space.
    Colours,
    /// Heights: the numbers of the file.
    Heights,
}

impl Parser<'_, '_> {
    /// An image with what modifies it, up to its closing brace.
    pub(super) fn image_body(&mut self) -> Result<ImageMap> {
        Ok(self.image_for(Use::Colours)?.0)
    }

    /// An image of heights with what modifies it, up to its closing brace, and its `bump_size`.
    pub(super) fn bump_map_body(&mut self) -> Result<(ImageMap, Option<f64>)> {
        self.image_for(Use::Heights)
    }

    fn image_for(&mut self, purpose: Use) -> Result<(ImageMap, Option<f64>)> {
        let (mut image, indices) = self.image_source(purpose)?;
        let (mut bump_size, mut by_index) = (None, false);
        // The filter or the transparency of single colours of its palette.
        let mut of_colours: Vec<(bool, f64, f32)> = Vec::new();
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("what modifies an image")) };
            self.peeked = None;
            match &*word {
                "once" => image.once = true,
                "interpolate" => image.interpolate = self.float()? != 0.0,
                "map_type" => {
                    image.projection = match self.float()? as i64 {
                        0 => ImageProjection::Planar,
                        1 => ImageProjection::Spherical,
                        2 => ImageProjection::Cylindrical,
                        5 => ImageProjection::Toroidal,
                        _ => {
                            self.warn("a map_type that is not rendered: the image lies in a plane");
                            ImageProjection::Planar
                        }
                    }
                }
                "filter" | "transmit" => {
                    if self.take_word("all")? {
                        let value = self.finite()? as f32;
                        if &*word == "filter" { image.filter = value } else { image.transmit = value }
                    } else {
                        let index = self.float()?;
                        self.comma()?;
                        self.budget.bytes(size_of::<(bool, f64, f32)>() as u64, "colours of an image")?;
                        of_colours.push((&*word == "filter", index, self.finite()? as f32));
                    }
                }
                "bump_size" if purpose == Use::Heights => bump_size = Some(self.finite()?),
                "use_index" if purpose == Use::Heights => by_index = true,
                "premultiplied" | "use_alpha" | "use_color" | "use_colour" | "use_index" => {
                    self.optional_bool()?;
                }
                _ => return Err(self.error(format!("{word} has no meaning for an image"))),
            }
        }
        if by_index && let Some(indices) = &indices {
            let mut heights = self.budget.vec(indices.len() as u64, "pixels")?;
            heights.extend(indices.iter().map(|index| Colour::opaque(Spectrum::splat(f32::from(*index)))));
            image.source = ImageSource::Pixels(heights.into());
        }
        if !of_colours.is_empty()
            && let ImageSource::Pixels(pixels) = &image.source
        {
            let Some(indices) = indices else {
                self.warn("an image without a palette has no single colours that could be transparent");
                return Ok((image, bump_size));
            };
            let mut changed = self.budget.vec(pixels.len() as u64, "pixels")?;
            for (pixel, own) in pixels.iter().zip(&indices) {
                let mut pixel = *pixel;
                for (is_filter, index, value) in &of_colours {
                    if *index == f64::from(*own) {
                        *(if *is_filter { &mut pixel.filter } else { &mut pixel.transmit }) = *value;
                    }
                }
                changed.push(pixel);
            }
            image.source = ImageSource::Pixels(changed.into());
        }
        Ok((image, bump_size))
    }

    /// An image with the indices of its pixels, if it has a palette.
    fn image_source(&mut self, purpose: Use) -> Result<(ImageMap, Option<Vec<u8>>)> {
        let mut image = ImageMap {
            source: ImageSource::Pixels(Arc::from([Colour::default()])),
            width: 1,
            height: 1,
            projection: ImageProjection::Planar,
            once: false,
            interpolate: false,
            filter: 0.0,
            transmit: 0.0,
        };
        if self.take_word("function")? {
            image.width = self.whole(2.0, 65_536.0)?;
            self.comma()?;
            image.height = self.whole(2.0, 65_536.0)?;
            image.source = ImageSource::Function(self.function_block(&["x", "y", "z"])?);
            return Ok((image, None));
        }
        // The kind is told by the file.
        if !matches!(self.peek()?, Some(Kind::Text(_)))
            && matches!(
                self.word()?.as_deref(),
                Some(
                    "png"
                        | "jpeg"
                        | "tga"
                        | "ppm"
                        | "pgm"
                        | "tiff"
                        | "gif"
                        | "sys"
                        | "exr"
                        | "hdr"
                        | "iff"
                        | "pot"
                )
            )
        {
            self.peeked = None;
        }
        let name = self.file_name()?;
        let Some(path) = self.find(&name) else {
            let wrong = Diagnostic::error("an image that is not there").found(quoted(&name));
            return Err(self.diagnostic(wrong).into());
        };
        let given = if !self.take_word("gamma")? {
            None
        } else if self.take_word("srgb")? {
            Some(Decoding::Usual)
        } else {
            Some(Decoding::Power(self.finite()?.clamp(0.01, 100.0)))
        };
        let input = Input::open(&path, self.budget)?;
        let decoding = given.unwrap_or_else(|| self.usual_decoding(&input, purpose));
        let indexed = Indexed::read(&input, self.budget)?;
        if let Some(indexed) = indexed.as_ref().filter(|_| input.starts_with(b"GIF")) {
            (image.width, image.height) = (indexed.width, indexed.height);
            let mut pixels = self.budget.vec(indexed.indices.len() as u64, "pixels")?;
            pixels.extend((0..indexed.indices.len()).map(|i| {
                let [r, g, b] = indexed.colour(i).map(|c| f64::from(c) / 255.0);
                if decoding == Decoding::Usual {
                    let [r, g, b, ..] = self.settings.from_srgb([r, g, b, 0.0, 0.0]);
                    return Colour::opaque(Spectrum::new(r as f32, g as f32, b as f32));
                }
                Colour::opaque(self.decoded(Spectrum::new(r as f32, g as f32, b as f32), decoding, purpose))
            }));
            image.source = ImageSource::Pixels(pixels.into());
            return Ok((image, Some(indexed.indices.clone())));
        }
        let read = crate::image::read_image(&input, input.name(), self.budget, self.diagnostics);
        let read = read.map(|mut file| {
            if decoding != Decoding::Usual {
                file.bitmap = file.bitmap.with_encoding(Encoding::Linear);
            }
            file
        });
        match read.and_then(|file| file.to_image(self.budget)) {
            Ok(read) => {
                (image.width, image.height) = (read.width(), read.height());
                let mut pixels =
                    self.budget.vec(u64::from(image.width) * u64::from(image.height), "pixels")?;
                for y in 0..image.height {
                    for x in 0..image.width {
                        let rgb = read.pixel(x, y);
                        let c = self.decoded(Spectrum::new(rgb.r, rgb.g, rgb.b), decoding, purpose);
                        let alpha = read.alpha().map_or(1.0, |alpha| alpha[(y * image.width + x) as usize]);
                        if purpose == Use::Heights {
                            // In front of black.
                            pixels.push(Colour::opaque(c * alpha));
                            continue;
                        }
                        pixels.push(Colour { transmit: 1.0 - alpha, ..Colour::opaque(c) });
                    }
                }
                image.source = ImageSource::Pixels(pixels.into());
            }
            Err(error) => {
                let wrong = Diagnostic::warning("an image that cannot be read is black")
                    .found(quoted(&error.to_string()));
                let wrong = self.diagnostic(wrong);
                self.diagnostics.push(wrong);
            }
        }
        let indices =
            indexed.filter(|indexed| (indexed.width, indexed.height) == (image.width, image.height));
        Ok((image, indices.map(|indexed| indexed.indices)))
    }

    /// How an image is decoded whose gamma the scene does not give.
    fn usual_decoding(&self, bytes: &[u8], purpose: Use) -> Decoding {
        if purpose == Use::Heights {
            return Decoding::Stored;
        }
        let is_old = self.settings.version < 3.7;
        let is_of_light = ImageFormat::from_bytes(bytes).is_some_and(ImageFormat::is_high_range);
        match png_gamma(bytes) {
            Some(gamma) if !is_old || self.settings.assumed_gamma.is_some() => Decoding::Power(1.0 / gamma),
            _ if is_old && !is_of_light => Decoding::Stored,
            _ => Decoding::Usual,
        }
    }

    /// A colour in the working space, or a height: of light, if it is decoded as usual, else of the file's numbers.
    fn decoded(&self, c: Spectrum, decoding: Decoding, purpose: Use) -> Spectrum {
        let light = match decoding {
            Decoding::Usual => c,
            Decoding::Power(power) => c.map(|c| c.max(0.0).power(power as f32)),
            Decoding::Stored => return c,
        };
        if purpose == Use::Heights { light } else { self.settings.from_linear(light) }
    }
}

/// The gamma that a PNG file gives: 1 for light, 1/2.2 for most screens.
fn png_gamma(bytes: &[u8]) -> Option<f64> {
    let mut rest = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n")?;
    loop {
        let length = u32::from_be_bytes(*rest.first_chunk()?) as usize;
        let (name, data) = rest.get(4..)?.split_at_checked(4)?;
        match name {
            b"gAMA" => {
                let gamma = u32::from_be_bytes(*data.first_chunk()?);
                return (gamma > 0).then_some(f64::from(gamma) / 1e5);
            }
            b"IDAT" | b"IEND" => return None,
            _ => rest = data.get(length.checked_add(4)?..)?,
        }
    }
}
