//! Pictures for browsers: raw pixels, so that nothing must be decoded.

use hyper::body::Bytes;
use lumbre::image::{Encoded, Image, Rgb, ToneMap, srgb_to_linear};
use lumbre::{Picture, SaveOptions};
use rayon::prelude::*;

use crate::message::{Channel, ColourMap};

/// How a picture is shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Look {
    /// Exposure, tone mapping.
    pub save: SaveOptions,
    /// Luminance as colours, by stops.
    pub false_colour: bool,
    /// The colours of numbers.
    pub map: ColourMap,
    /// The numbers at both ends of the colours; found where `None`.
    pub range: Option<[f32; 2]>,
}

impl Look {
    /// That of a picture, with the colours and the range of numbers that are found.
    pub(crate) fn of(save: SaveOptions) -> Self {
        Self { save, false_colour: false, map: ColourMap::default(), range: None }
    }
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
    /// Whether its noise was taken out.
    pub is_denoised: bool,
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

/// Bytes before the pixels: ten numbers of four bytes, the least significant first.
pub(crate) const HEADER: usize = 40;
const MAGIC: u32 = u32::from_le_bytes(*b"LUM2");

impl Frame {
    pub(crate) fn new(shot: &Shot, look: &Look) -> Self {
        let image = shot.image();
        let [low, high] = range(shot, look).unwrap_or_default();
        let numbers = [
            MAGIC,
            image.width(),
            image.height(),
            shot.full.0,
            shot.full.1,
            shot.picture().map_or(1, |picture| picture.stats().spp),
            shot.sequence,
            u32::from(shot.is_full) | u32::from(shot.is_done) << 1 | u32::from(shot.is_denoised) << 2,
            low.to_bits(),
            high.to_bits(),
        ];
        let mut bytes = Vec::with_capacity(HEADER + 4 * image.pixels().len());
        bytes.extend(numbers.into_iter().flat_map(u32::to_le_bytes));
        bytes.resize(HEADER + 4 * image.pixels().len(), 255);
        pixels(shot, look, &mut bytes[HEADER..]);
        Self(bytes.into())
    }
}

/// The numbers at both ends of the colours; `None` where colours stand for no numbers.
fn range(shot: &Shot, look: &Look) -> Option<[f32; 2]> {
    let found = match shot.channel {
        Channel::Depth => {
            let depths = shot.image().pixels().iter().map(|pixel| pixel.r);
            [0.0, depths.fold(f32::MIN_POSITIVE, f32::max)]
        }
        Channel::Beauty if look.false_colour => STOPS.map(|stops| MIDDLE_GREY * exp2(stops)),
        Channel::Variance => STOPS.map(|stops| MIDDLE_GREY * exp2(stops)),
        Channel::Beauty | Channel::Albedo | Channel::Normal | Channel::Uv | Channel::Ids => return None,
    };
    Some(look.range.unwrap_or(found))
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
    let range = range(shot, look).unwrap_or([0.0, 1.0]);
    rows(image, width, out, |_, value| {
        let [r, g, b] = match shot.channel {
            Channel::Beauty => light_colour((value * factor).luminance(), range, look.map),
            Channel::Variance => light_colour(value.r.max(0.0).sqrt() * factor, range, look.map),
            Channel::Depth if value.r > 0.0 => depth_colour(value.r, range, look.map),
            // The numbers themselves, as they are known from other programs.
            Channel::Normal | Channel::Uv => Encoded::new(value.r, value.g, value.b).to_u8(),
            Channel::Albedo | Channel::Depth | Channel::Ids => ToneMap::None.encode(value, 0.0).to_u8(),
        };
        [r, g, b, 255]
    });
}

fn exp2(stops: f32) -> f32 {
    lumbre::math::Elementary::exponential_2(stops)
}

fn log2(value: f32) -> f32 {
    lumbre::math::Elementary::logarithm_2(value)
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

const MIDDLE_GREY: f32 = 0.18;
/// The range of light that is found, in stops from middle grey.
const STOPS: [f32; 2] = [-6.0, 6.0];
/// Colours at even steps: dark blue, blue, green at middle grey, yellow, red.
const RAINBOW: [[f32; 3]; 7] = [
    [0.10, 0.05, 0.30],
    [0.15, 0.25, 0.75],
    [0.10, 0.60, 0.80],
    [0.25, 0.70, 0.30],
    [0.95, 0.85, 0.20],
    [0.95, 0.45, 0.10],
    [0.80, 0.05, 0.10],
];
/// Nine of the 256 colours of viridis, at even steps.
const VIRIDIS: [[f32; 3]; 9] = [
    [0.267, 0.005, 0.329],
    [0.279, 0.175, 0.483],
    [0.230, 0.322, 0.546],
    [0.173, 0.449, 0.558],
    [0.128, 0.567, 0.551],
    [0.158, 0.684, 0.502],
    [0.369, 0.789, 0.383],
    [0.678, 0.864, 0.190],
    [0.993, 0.906, 0.144],
];

/// The colour at a place in [0, 1] of a scale.
fn scale_colour(scale: &[[f32; 3]], place: f32) -> [u8; 3] {
    let at = place.clamp(0.0, 1.0) * (scale.len() - 1) as f32;
    let i = (at as usize).min(scale.len() - 2);
    let mix = |c: usize| scale[i][c] + (scale[i + 1][c] - scale[i][c]) * (at - i as f32);
    Encoded::new(mix(0), mix(1), mix(2)).to_u8()
}

/// A colour for light, by stops: below the range is black, above it white. A range that begins at 0 or below is even.
fn light_colour(light: f32, [low, high]: [f32; 2], map: ColourMap) -> [u8; 3] {
    let place = if low > 0.0 {
        (log2(light.max(1e-30)) - log2(low)) / (log2(high) - log2(low))
    } else {
        (light - low) / (high - low)
    };
    // What is no number is below.
    if place.is_nan() || place < 0.0 {
        return [0; 3];
    }
    if place > 1.0 {
        return [255; 3];
    }
    match map {
        ColourMap::Grey => Encoded::new(place, place, place).to_u8(),
        ColourMap::Viridis => scale_colour(&VIRIDIS, place),
        ColourMap::Automatic | ColourMap::Rainbow => scale_colour(&RAINBOW, place),
    }
}

/// A colour for a depth: what is beyond the range has the colour of its end.
fn depth_colour(depth: f32, [near, far]: [f32; 2], map: ColourMap) -> [u8; 3] {
    let place = ((depth - near) / (far - near)).clamp(0.0, 1.0);
    match map {
        ColourMap::Automatic | ColourMap::Grey => Encoded::srgb(Rgb::splat(1.0 - 0.9 * place)).to_u8(),
        ColourMap::Rainbow => scale_colour(&RAINBOW, place),
        ColourMap::Viridis => scale_colour(&VIRIDIS, place),
    }
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
        let range = STOPS.map(|stops| MIDDLE_GREY * exp2(stops));
        let colour = |light| light_colour(light, range, ColourMap::Automatic);
        assert_eq!(colour(0.0), [0; 3]);
        assert_eq!(colour(100.0), [255; 3]);
        assert_eq!(colour(f32::NAN), [0; 3]);
        assert_eq!(colour(0.18), Encoded::new(0.25, 0.70, 0.30).to_u8());
        assert_ne!(colour(0.36), colour(0.18));
        // A range that begins at 0 is even, one above it by stops; the ends have the first and the last colour.
        assert_eq!(light_colour(1.0, [0.0, 2.0], ColourMap::Grey), [128; 3]);
        assert_eq!(light_colour(1.0, [0.25, 4.0], ColourMap::Grey), [128; 3]);
        assert_eq!(
            light_colour(2.0, [0.0, 2.0], ColourMap::Viridis),
            Encoded::new(0.993, 0.906, 0.144).to_u8()
        );
        assert_eq!(depth_colour(7.0, [3.0, 5.0], ColourMap::Rainbow), Encoded::new(0.80, 0.05, 0.10).to_u8());
        assert_eq!(
            depth_colour(3.0, [3.0, 5.0], ColourMap::Viridis),
            Encoded::new(0.267, 0.005, 0.329).to_u8()
        );
        assert_eq!(depth_colour(3.0, [3.0, 5.0], ColourMap::Automatic), [255; 3]);
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
