//! Pictures for browsers: raw pixels, so that nothing must be decoded.

use hyper::body::Bytes;
use lumbre::image::{Encoded, Image, Rgb, ToneMap, srgb_to_linear};
use lumbre::{Picture, SaveOptions};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The channel that is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Channel {
    /// The picture.
    #[default]
    Beauty,
    /// Reflectance.
    Albedo,
    /// Shading normals, (n + 1) / 2.
    Normal,
    /// Depth along the camera's axis.
    Depth,
    /// Texture coordinates.
    Uv,
    /// The variance of the picture's luminance; its square root, the standard error, is shown in false colours.
    Variance,
    /// A colour for each shape.
    Ids,
}

/// How a picture is shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Look {
    /// Exposure, tone mapping.
    pub save: SaveOptions,
    /// Luminance as colours, by stops.
    pub false_colour: bool,
}

/// A picture, with the data that a page needs.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    pub pixels: Pixels,
    pub channel: Channel,
    /// The size of the whole picture at full resolution.
    pub full: (u32, u32),
    /// The last change that it shows.
    pub sequence: u32,
    /// Whether it is complete, and of the requested scene.
    pub is_full: bool,
    /// Whether it equals the picture of `lumbre render`.
    pub is_done: bool,
}

/// The pixels of a shot.
#[derive(Clone, Debug)]
pub(crate) enum Pixels {
    /// In a picture that was rendered.
    Rendered(Box<Picture>),
    /// Here.
    Plain(Image),
}

impl Shot {
    /// The pixels, in linear light.
    pub(crate) fn image(&self) -> &Image {
        match &self.pixels {
            Pixels::Rendered(picture) => picture.image(),
            Pixels::Plain(image) => image,
        }
    }

    /// The picture, if it was rendered.
    pub(crate) fn picture(&self) -> Option<&Picture> {
        match &self.pixels {
            Pixels::Rendered(picture) => Some(picture),
            Pixels::Plain(_) => None,
        }
    }
}

/// A frame, encoded once for all pages.
#[derive(Clone, Debug)]
pub(crate) struct Frame(pub Bytes);

/// Bytes before the pixels: eight little-endian numbers of four bytes.
pub(crate) const HEADER: usize = 32;
const MAGIC: u32 = u32::from_le_bytes(*b"LUM1");

impl Frame {
    pub(crate) fn new(shot: &Shot, look: &Look) -> Self {
        let image = shot.image();
        let numbers = [
            MAGIC,
            image.width(),
            image.height(),
            shot.full.0,
            shot.full.1,
            shot.picture().map_or(1, |picture| picture.stats().spp),
            shot.sequence,
            u32::from(shot.is_full) | u32::from(shot.is_done) << 1,
        ];
        let mut bytes = Vec::with_capacity(HEADER + 4 * image.pixels().len());
        bytes.extend(numbers.into_iter().flat_map(u32::to_le_bytes));
        bytes.resize(HEADER + 4 * image.pixels().len(), 255);
        pixels(shot, look, &mut bytes[HEADER..]);
        Self(bytes.into())
    }
}

fn pixels(shot: &Shot, look: &Look, out: &mut [u8]) {
    let width = shot.image().width().max(1) as usize;
    if let (Some(picture), Channel::Beauty, false) = (shot.picture(), shot.channel, look.false_colour) {
        let (image, rest) = picture.displayed(&look.save);
        let (tone_map, exposure) = (rest.tone_map, rest.exposure);
        let alpha = image.alpha();
        rows(&image, width, out, |i, light| {
            let alpha = alpha.map_or(1.0, |alpha| alpha[i]);
            let light = if 0.0 < alpha && alpha < 1.0 { light / alpha } else { light };
            let [r, g, b] = tone_map.encode(light, exposure).to_u8();
            [r, g, b, lumbre::image::unit_to_u8(alpha)]
        });
        return;
    }
    let image = shot.image();
    let factor = exp2(look.save.exposure);
    let farthest = match shot.channel {
        Channel::Depth => image.pixels().iter().map(|pixel| pixel.r).fold(f32::MIN_POSITIVE, f32::max),
        _ => 1.0,
    };
    rows(image, width, out, |_, value| {
        let [r, g, b] = match shot.channel {
            Channel::Beauty => return opaque(stops_colour((value * factor).luminance())),
            Channel::Variance => return opaque(stops_colour(value.r.max(0.0).sqrt() * factor)),
            Channel::Depth if value.r > 0.0 => {
                Encoded::srgb(Rgb::splat(1.0 - 0.9 * value.r / farthest)).to_u8()
            }
            // The numbers themselves, as other programs show them.
            Channel::Normal | Channel::Uv => Encoded::new(value.r, value.g, value.b).to_u8(),
            Channel::Albedo | Channel::Depth | Channel::Ids => ToneMap::None.encode(value, 0.0).to_u8(),
        };
        [r, g, b, 255]
    });
}

fn exp2(stops: f32) -> f32 {
    lumbre::math::Elementary::exponential_2(stops)
}

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

/// Fills pixels row by row, over threads.
fn rows(image: &Image, width: usize, out: &mut [u8], pixel: impl Fn(usize, Rgb) -> [u8; 4] + Sync) {
    let lines = image.pixels().par_chunks(width).zip(out.par_chunks_mut(4 * width)).enumerate();
    lines.with_min_len(16).for_each(|(y, (line, out))| {
        for ((x, &light), out) in line.iter().enumerate().zip(out.chunks_exact_mut(4)) {
            out.copy_from_slice(&pixel(y * width + x, light));
        }
    });
}

/// The stops of [`stops_colour`], from middle grey: below them is black, above white.
const STOPS: [f32; 2] = [-6.0, 6.0];
/// Colours at even steps over the stops: dark blue, blue, green at middle grey, yellow, red.
const SCALE: [[f32; 3]; 7] = [
    [0.10, 0.05, 0.30],
    [0.15, 0.25, 0.75],
    [0.10, 0.60, 0.80],
    [0.25, 0.70, 0.30],
    [0.95, 0.85, 0.20],
    [0.95, 0.45, 0.10],
    [0.80, 0.05, 0.10],
];

/// A colour for a luminance, by how many stops it is from middle grey (0.18).
fn stops_colour(luminance: f32) -> [u8; 3] {
    let stops = lumbre::math::Elementary::logarithm_2(luminance.max(1e-30) / 0.18);
    let [low, high] = STOPS;
    if stops < low {
        return [0; 3];
    }
    if stops > high {
        return [255; 3];
    }
    let at = (stops - low) / (high - low) * (SCALE.len() - 1) as f32;
    let i = (at as usize).min(SCALE.len() - 2);
    let mix = |c: usize| SCALE[i][c] + (SCALE[i + 1][c] - SCALE[i][c]) * (at - i as f32);
    Encoded::new(mix(0), mix(1), mix(2)).to_u8()
}

/// A colour for a number, far from those of its neighbours.
pub(crate) fn id_colour(id: u32) -> Rgb {
    let turns = (f64::from(id) * 0.618_033_988_749_895).fract() as f32;
    let light = 0.55 + 0.35 * ((f64::from(id) * 0.754_877_666).fract() as f32);
    let channel = |shift: f32| {
        let hue = ((turns + shift).fract() * 6.0 - 3.0).abs() - 1.0;
        light * (0.35 + 0.65 * hue.clamp(0.0, 1.0))
    };
    Rgb::new(channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0)).map(|c| srgb_to_linear(c).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn false_colours_go_by_stops_and_mark_what_is_beyond() {
        assert_eq!(stops_colour(0.0), [0; 3]);
        assert_eq!(stops_colour(100.0), [255; 3]);
        assert_eq!(stops_colour(f32::NAN), [0; 3]);
        assert_eq!(stops_colour(0.18), Encoded::new(0.25, 0.70, 0.30).to_u8());
        assert_ne!(stops_colour(0.36), stops_colour(0.18));
    }

    #[test]
    fn neighbouring_shapes_have_plainly_different_colours() {
        for id in 0..200 {
            let [a, b] = [id_colour(id), id_colour(id + 1)].map(|c| Encoded::srgb(c).channels());
            let difference: f32 = (0..3).map(|c| (a[c] - b[c]).abs()).sum();
            assert!(difference > 0.3, "{id}: {a:?} {b:?}");
        }
    }
}
