//! A picture as stored in a file: one to four channels in the file's own number format.

use crate::half::half_to_f32;
use crate::{Encoding, Image, Rgb, Window};

/// The values of a [`Bitmap`], channels innermost, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub enum PixelData {
    /// Bytes that represent `[0, 1]`.
    U8(Vec<u8>),
    /// 16-bit integers that represent `[0, 1]`.
    U16(Vec<u16>),
    /// Half-precision numbers, as their bits.
    F16(Vec<u16>),
    /// Single-precision numbers.
    F32(Vec<f32>),
}

impl PixelData {
    /// The number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) | Self::F16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes per value.
    pub fn bytes_each(&self) -> usize {
        match self {
            Self::U8(_) => 1,
            Self::U16(_) | Self::F16(_) => 2,
            Self::F32(_) => 4,
        }
    }
}

/// The meaning of the channels of a [`Bitmap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channels {
    /// Grey.
    Y,
    /// Grey and alpha.
    Ya,
    /// Red, green, blue.
    Rgb,
    /// Red, green, blue, alpha.
    Rgba,
}

impl Channels {
    /// The number of channels.
    pub const fn count(self) -> usize {
        match self {
            Self::Y => 1,
            Self::Ya => 2,
            Self::Rgb => 3,
            Self::Rgba => 4,
        }
    }

    /// The channels for a count from 1 to 4.
    pub const fn from_count(count: usize) -> Option<Self> {
        match count {
            1 => Some(Self::Y),
            2 => Some(Self::Ya),
            3 => Some(Self::Rgb),
            4 => Some(Self::Rgba),
            _ => None,
        }
    }

    /// The index of the alpha channel.
    pub const fn alpha(self) -> Option<usize> {
        match self {
            Self::Y | Self::Rgb => None,
            Self::Ya => Some(1),
            Self::Rgba => Some(3),
        }
    }
}

/// A picture as stored in a file; a texture of bytes takes bytes.
///
/// Colours are on the file's primaries (Rec. 709 unless stated otherwise). Integer colours are not
/// premultiplied by alpha, as in PNG, TGA and QOI; floating-point ones are, as in EXR.
#[derive(Clone, Debug, PartialEq)]
pub struct Bitmap {
    // `data.len() == width * height * channels.count()`, and neither side is 0.
    width: u32,
    height: u32,
    channels: Channels,
    data: PixelData,
    encoding: Encoding,
}

impl Bitmap {
    /// A picture from its values; `None` unless there are `width * height * channels` of them and at least one.
    pub fn new(
        width: u32,
        height: u32,
        channels: Channels,
        data: PixelData,
        encoding: Encoding,
    ) -> Option<Self> {
        let expected = u128::from(width) * u128::from(height) * channels.count() as u128;
        let fits = !data.is_empty() && data.len() as u128 == expected;
        fits.then_some(Self { width, height, channels, data, encoding })
    }

    /// Width in pixels, at least 1.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels, at least 1.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The meaning of the channels.
    pub fn channels(&self) -> Channels {
        self.channels
    }

    /// The stored values.
    pub fn data(&self) -> &PixelData {
        &self.data
    }

    /// The transfer function of the colour channels.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// The same values with another transfer function, as a scene may declare for a texture.
    #[must_use]
    pub fn with_encoding(self, encoding: Encoding) -> Self {
        Self { encoding, ..self }
    }

    /// Bytes of memory of the values.
    pub fn bytes(&self) -> usize {
        self.data.len() * self.data.bytes_each()
    }

    /// Channel `c` of the pixel `x` from the left and `y` from the top, as linear light (alpha as it is).
    ///
    /// # Panics
    /// When it lies outside the picture.
    pub fn texel(&self, x: u32, y: u32, c: usize) -> f32 {
        let i = self.index(x, y, c);
        let encoding = if self.channels.alpha() == Some(c) { Encoding::Linear } else { self.encoding };
        match &self.data {
            PixelData::U8(v) => encoding.decode_u8(v[i]),
            PixelData::U16(v) => encoding.decode_u16(v[i]),
            PixelData::F16(v) => encoding.decode(half_to_f32(v[i])),
            PixelData::F32(v) => encoding.decode(v[i]),
        }
    }

    /// Channel `c` of the pixel `x` from the left and `y` from the top, as stored: integers as fractions of 1.
    ///
    /// # Panics
    /// When it lies outside the picture.
    pub fn stored(&self, x: u32, y: u32, c: usize) -> f32 {
        let i = self.index(x, y, c);
        match &self.data {
            PixelData::U8(v) => f32::from(v[i]) / 255.0,
            PixelData::U16(v) => f32::from(v[i]) / 65535.0,
            PixelData::F16(v) => half_to_f32(v[i]),
            PixelData::F32(v) => v[i],
        }
    }

    /// The linear colour of the pixel `x` from the left and `y` from the top; grey in all three channels.
    ///
    /// # Panics
    /// When it lies outside the picture.
    pub fn rgb(&self, x: u32, y: u32) -> Rgb {
        match self.channels {
            Channels::Y | Channels::Ya => Rgb::splat(self.texel(x, y, 0)),
            Channels::Rgb | Channels::Rgba => {
                Rgb::new(self.texel(x, y, 0), self.texel(x, y, 1), self.texel(x, y, 2))
            }
        }
    }

    /// The alpha of the pixel `x` from the left and `y` from the top; 1 when the picture has none.
    ///
    /// # Panics
    /// When it lies outside the picture.
    pub fn alpha(&self, x: u32, y: u32) -> f32 {
        self.channels.alpha().map_or(1.0, |c| self.texel(x, y, c))
    }

    /// Whether the colours are premultiplied by alpha.
    pub fn is_premultiplied(&self) -> bool {
        matches!(self.data, PixelData::F16(_) | PixelData::F32(_))
    }

    /// The picture as linear light, premultiplied where it has alpha.
    pub fn to_image(&self) -> Image {
        let places = || (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let multiply = self.channels.alpha().is_some() && !self.is_premultiplied();
        let colour = |(x, y)| if multiply { self.rgb(x, y) * self.alpha(x, y) } else { self.rgb(x, y) };
        let colours = places().map(colour).collect();
        let image = Image::from_pixels(self.width, self.height, colours).expect("one colour a pixel");
        match self.channels.alpha() {
            None => image,
            Some(c) => {
                let alpha = places().map(|(x, y)| self.texel(x, y, c)).collect();
                image.with_alpha(alpha).expect("one coverage a pixel")
            }
        }
    }

    /// The picture on a larger or smaller canvas, its upper left corner at (x, y) there. Elsewhere the canvas is black,
    /// and transparent if the picture has alpha.
    ///
    /// # Panics
    /// When the canvas has no pixels.
    #[must_use]
    pub fn placed(&self, x: i32, y: i32, width: u32, height: u32) -> Self {
        assert!(width > 0 && height > 0, "a canvas with pixels");
        let here = Window { x, y, width: self.width, height: self.height };
        let seen = here.intersection(Window { x: 0, y: 0, width, height });
        let data = match &self.data {
            PixelData::U8(v) => PixelData::U8(self.on_canvas(v, here, seen, width, height)),
            PixelData::U16(v) => PixelData::U16(self.on_canvas(v, here, seen, width, height)),
            PixelData::F16(v) => PixelData::F16(self.on_canvas(v, here, seen, width, height)),
            PixelData::F32(v) => PixelData::F32(self.on_canvas(v, here, seen, width, height)),
        };
        Self { width, height, data, ..*self }
    }

    fn on_canvas<T: Copy + Default>(
        &self,
        values: &[T],
        here: Window,
        seen: Option<Window>,
        width: u32,
        height: u32,
    ) -> Vec<T> {
        let channels = self.channels.count();
        let mut canvas = vec![T::default(); width as usize * height as usize * channels];
        let Some(seen) = seen else { return canvas };
        let (left, top) = (i64::from(seen.x) - i64::from(here.x), i64::from(seen.y) - i64::from(here.y));
        let span = seen.width as usize * channels;
        for row in 0..seen.height as usize {
            let to = ((seen.y as usize + row) * width as usize + seen.x as usize) * channels;
            let from = ((top as usize + row) * self.width as usize + left as usize) * channels;
            canvas[to..to + span].copy_from_slice(&values[from..from + span]);
        }
        canvas
    }

    /// Makes texels black that have a channel that is infinite or no number. How many there were, and the place of the
    /// first, from the top left.
    pub fn blacken_not_finite(&mut self) -> (usize, (u32, u32)) {
        let (channels, width) = (self.channels.count(), self.width as usize);
        let (mut count, mut first) = (0, (0, 0));
        let mut note = |texel: usize| {
            if count == 0 {
                first = ((texel % width) as u32, (texel / width) as u32);
            }
            count += 1;
        };
        match &mut self.data {
            PixelData::U8(_) | PixelData::U16(_) => {}
            PixelData::F16(v) => {
                for (i, texel) in v.chunks_exact_mut(channels).enumerate() {
                    if texel.iter().any(|&bits| !half_to_f32(bits).is_finite()) {
                        texel.fill(0);
                        note(i);
                    }
                }
            }
            PixelData::F32(v) => {
                for (i, texel) in v.chunks_exact_mut(channels).enumerate() {
                    if texel.iter().any(|v| !v.is_finite()) {
                        texel.fill(0.0);
                        note(i);
                    }
                }
            }
        }
        (count, first)
    }

    fn index(&self, x: u32, y: u32, c: usize) -> usize {
        assert!(
            x < self.width && y < self.height && c < self.channels.count(),
            "no channel {c} of pixel ({x}, {y}) in {} by {} of {:?}",
            self.width,
            self.height,
            self.channels
        );
        (y as usize * self.width as usize + x as usize) * self.channels.count() + c
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::half::f32_to_half;

    #[test]
    fn a_picture_on_a_canvas_stands_in_its_place() {
        // 3 by 2 pixels of grey and alpha, each of another value.
        let data: Vec<u16> = (1..=12).collect();
        let picture = Bitmap::new(3, 2, Channels::Ya, PixelData::U16(data), Encoding::Linear).unwrap();
        let canvas = picture.placed(2, 3, 7, 9);
        assert_eq!((canvas.width(), canvas.height(), canvas.channels()), (7, 9, Channels::Ya));
        let PixelData::U16(values) = canvas.data() else { panic!("another kind") };
        let mut inside = 0;
        for (i, pair) in values.chunks(2).enumerate() {
            let (x, y) = (i as i32 % 7 - 2, i as i32 / 7 - 3);
            let is_in = (0..3).contains(&x) && (0..2).contains(&y);
            let first = if is_in { 2 * (3 * y + x) + 1 } else { -1 };
            inside += i32::from(is_in);
            assert_eq!(pair, if is_in { [first as u16, first as u16 + 1] } else { [0, 0] }, "{x} {y}");
        }
        assert_eq!(inside, 6);
        // What is beyond the canvas is cut off, on every side.
        let cut = picture.placed(-1, -1, 1, 1);
        assert_eq!(cut.data(), &PixelData::U16(vec![9, 10]));
        assert_eq!(picture.placed(3, 0, 3, 2).data(), &PixelData::U16(vec![0; 12]));
        assert_eq!(picture.placed(i32::MIN, i32::MAX, 3, 2).data(), &PixelData::U16(vec![0; 12]));
    }

    #[test]
    fn texels_that_are_not_finite_become_black_and_others_stay() {
        let values =
            vec![0.5, 1.0, f32::NAN, 3.0, f32::MAX, 5.0, f32::NEG_INFINITY, 0.0, -7.0, 0.0, 1.0, 2.0];
        let mut picture = Bitmap::new(2, 2, Channels::Rgb, PixelData::F32(values), Encoding::Linear).unwrap();
        assert_eq!(picture.blacken_not_finite(), (2, (0, 0)));
        let expected = [0.0, 0.0, 0.0, 3.0, f32::MAX, 5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0];
        assert_eq!(picture.data(), &PixelData::F32(expected.to_vec()));
        assert_eq!(picture.blacken_not_finite().0, 0);
        let halves = [1.0, 2.0, 3.0, 4.0, 5.0, f32::INFINITY].map(f32_to_half).to_vec();
        let mut picture = Bitmap::new(2, 3, Channels::Y, PixelData::F16(halves), Encoding::Linear).unwrap();
        assert_eq!(picture.blacken_not_finite(), (1, (1, 2)));
        assert_eq!((picture.texel(1, 2, 0), picture.texel(0, 2, 0)), (0.0, 5.0));
    }

    #[test]
    fn texels_are_light_in_every_number_format() {
        let stored = [0.2f32, 0.4, 0.6, 0.8, 0.0, 1.0, 0.2, 0.6, 0.8, 0.4, 0.6, 0.2];
        let formats = [
            (PixelData::U8(stored.map(|v| (v * 255.0) as u8).to_vec()), 1e-6),
            (PixelData::U16(stored.map(|v| (v * 65535.0) as u16).to_vec()), 1e-6),
            (PixelData::F16(stored.map(f32_to_half).to_vec()), 1e-3),
            (PixelData::F32(stored.to_vec()), 1e-6),
        ];
        for (data, tolerance) in formats {
            let bitmap = Bitmap::new(3, 2, Channels::Ya, data, Encoding::Srgb).unwrap();
            for (i, &v) in stored.iter().enumerate() {
                let (x, y, c) = (i as u32 / 2 % 3, i as u32 / 6, i % 2);
                let expected = if c == 1 { v } else { Encoding::Srgb.decode(v) };
                assert!((bitmap.texel(x, y, c) - expected).abs() < tolerance, "{x} {y} {c}");
                assert!((bitmap.stored(x, y, c) - v).abs() < tolerance);
            }
            let image = bitmap.to_image();
            let coverage = if bitmap.is_premultiplied() { 1.0 } else { bitmap.alpha(2, 1) };
            assert_eq!(image.pixel(2, 1), bitmap.rgb(2, 1) * coverage);
            assert_eq!(image.alpha().unwrap()[5], bitmap.alpha(2, 1));
        }
    }

    #[test]
    fn a_picture_has_all_its_numbers_and_at_least_one() {
        let make = |w, h, n| Bitmap::new(w, h, Channels::Rgb, PixelData::U8(vec![9; n]), Encoding::Srgb);
        assert!(make(4, 3, 36).is_some());
        assert!(make(4, 3, 35).is_none());
        assert!(make(0, 3, 0).is_none());
        assert!(make(u32::MAX, u32::MAX, 3).is_none());
    }

    #[test]
    fn another_encoding_changes_light_and_not_numbers() {
        let data = PixelData::U8(vec![10, 128, 250, 64, 32, 16]);
        let srgb = Bitmap::new(2, 1, Channels::Rgb, data, Encoding::Srgb).unwrap();
        let linear = srgb.clone().with_encoding(Encoding::Linear);
        assert_eq!(srgb.stored(0, 0, 1), linear.stored(0, 0, 1));
        assert_eq!(linear.texel(0, 0, 1), 128.0 / 255.0);
        assert!(srgb.texel(0, 0, 1) < 0.22);
        assert_eq!(srgb.bytes(), 6);
    }
}
