//! Transfer functions between stored numbers and light.

use std::sync::LazyLock;

use crate::Rgb;
use lumbre_math::Elementary;

/// The transfer function of stored numbers in `[0, 1]`. Alpha is always linear.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Encoding {
    /// Proportional to light.
    Linear,
    /// IEC 61966-2-1, the curve of sRGB.
    Srgb,
    /// Light is the stored number to this power.
    Gamma(f32),
}

impl Encoding {
    /// The encoding of a name in a scene file: `linear`, `sRGB` or `gamma G` with `G > 0`, in any case.
    pub fn from_name(name: &str) -> Option<Self> {
        let mut words = name.split_ascii_whitespace();
        let first = words.next()?;
        let gamma = words.next().map(str::parse::<f32>);
        match (first.to_ascii_lowercase().as_str(), gamma, words.next()) {
            ("linear", None, None) => Some(Self::Linear),
            ("srgb", None, None) => Some(Self::Srgb),
            ("gamma", Some(Ok(gamma)), None) if 0.0 < gamma && gamma.is_finite() => Some(Self::Gamma(gamma)),
            _ => None,
        }
    }

    /// Light from a stored number. The curve extends above 1, and below 0 by its mirror image.
    pub fn decode(self, stored: f32) -> f32 {
        match self {
            Self::Linear => stored,
            Self::Srgb => srgb_to_linear(stored),
            Self::Gamma(gamma) => stored.abs().power(gamma).copysign(stored),
        }
    }

    /// The stored number for light: the inverse of [`Encoding::decode`].
    pub fn encode(self, light: f32) -> f32 {
        match self {
            Self::Linear => light,
            Self::Srgb => linear_to_srgb(light),
            Self::Gamma(gamma) => light.abs().power(gamma.recip()).copysign(light),
        }
    }

    /// Light from a stored byte: `decode(byte / 255)`, rounded once.
    pub fn decode_u8(self, stored: u8) -> f32 {
        match self {
            Self::Srgb => SRGB_BYTES[usize::from(stored)],
            _ => self.decode(f32::from(stored) / 255.0),
        }
    }

    /// Light from 16 stored bits: `decode(bits / 65535)`.
    pub fn decode_u16(self, stored: u16) -> f32 {
        self.decode(f32::from(stored) / 65535.0)
    }
}

/// The light of each byte of sRGB.
static SRGB_BYTES: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| srgb_to_linear_f64(byte as f64 / 255.0) as f32));

/// The junction of the two pieces of the sRGB curve, as stored; the standard rounds it so.
const SRGB_STORED_JOIN: f64 = 0.04045;
/// The junction, as light.
const SRGB_LIGHT_JOIN: f64 = 0.0031308;

/// Light from a number on the sRGB curve, after IEC 61966-2-1:1999, section 5.2, computed in double precision.
///
/// The curve extends above 1, and below 0 by its mirror image, as in the standard's amendment 1.
pub fn srgb_to_linear(stored: f32) -> f32 {
    srgb_to_linear_f64(f64::from(stored)) as f32
}

fn srgb_to_linear_f64(stored: f64) -> f64 {
    let v = stored.abs();
    let light = if v <= SRGB_STORED_JOIN { v / 12.92 } else { ((v + 0.055) / 1.055).power(2.4) };
    light.copysign(stored)
}

/// A number on the sRGB curve from light: the inverse of [`srgb_to_linear`].
pub fn linear_to_srgb(light: f32) -> f32 {
    let v = f64::from(light.abs());
    let stored = if v <= SRGB_LIGHT_JOIN { v * 12.92 } else { 1.055 * v.power(1.0 / 2.4) - 0.055 };
    (stored as f32).copysign(light)
}

/// A colour encoded for storage or display: on a display's curve, each channel in `[0, 1]`.
///
/// A type of its own so that it cannot be confused with light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Encoded {
    // Each in [0, 1]: `new` clamps, and makes NaN 0.
    channels: [f32; 3],
}

impl Encoded {
    /// Channels on a display's curve, clamped to `[0, 1]`; NaN becomes 0.
    pub fn new(r: f32, g: f32, b: f32) -> Self {
        Self { channels: [r, g, b].map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, 1.0) }) }
    }

    /// Light on the sRGB curve.
    pub fn srgb(light: Rgb) -> Self {
        Self::new(linear_to_srgb(light.r), linear_to_srgb(light.g), linear_to_srgb(light.b))
    }

    /// The light that an sRGB display emits for it.
    pub fn to_linear(self) -> Rgb {
        let [r, g, b] = self.channels.map(srgb_to_linear);
        Rgb::new(r, g, b)
    }

    /// Red, green and blue, each in `[0, 1]`.
    pub fn channels(self) -> [f32; 3] {
        self.channels
    }

    /// The nearest bytes, halves rounded up.
    pub fn to_u8(self) -> [u8; 3] {
        self.channels.map(unit_to_u8)
    }

    /// The nearest 16-bit integers, halves rounded up.
    pub fn to_u16(self) -> [u16; 3] {
        self.channels.map(unit_to_u16)
    }
}

/// The byte nearest to `255 * v`, halves rounded up; `v` is clamped to `[0, 1]`, and NaN becomes 0.
pub fn unit_to_u8(v: f32) -> u8 {
    // In f64, since 255 * v + 0.5 rounded to f32 can reach the next integer. The cast saturates.
    (f64::from(v) * 255.0 + 0.5) as u8
}

/// The 16-bit integer nearest to `65535 * v`, halves rounded up; `v` is clamped to `[0, 1]`, and NaN becomes 0.
pub fn unit_to_u16(v: f32) -> u16 {
    (f64::from(v) * 65535.0 + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_are_named_as_scenes_name_them() {
        assert_eq!(Encoding::from_name("sRGB"), Some(Encoding::Srgb));
        assert_eq!(Encoding::from_name("linear"), Some(Encoding::Linear));
        assert_eq!(Encoding::from_name("gamma 2.2"), Some(Encoding::Gamma(2.2)));
        for wrong in ["", "gamma", "gamma 0", "gamma -1", "gamma inf", "gamma 2 2", "srgb 2", "rec709"] {
            assert_eq!(Encoding::from_name(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn the_srgb_curve_has_the_values_of_the_standard() {
        // Worked with 50 digits from the standard's formula.
        let pairs = [
            (0.04045, 0.003_130_804_953_56),
            (0.2, 0.033_104_766_570_885),
            (0.5, 0.214_041_140_482_233),
            (0.75, 0.522_521_554_007_774),
            (1.0, 1.0),
        ];
        for (stored, light) in pairs {
            let got = f64::from(srgb_to_linear(stored));
            assert!((got - light).abs() < 1e-7 * light, "{stored}: {got}");
        }
        assert_eq!(srgb_to_linear(-0.5), -srgb_to_linear(0.5));
        assert!(srgb_to_linear(f32::NAN).is_nan());
    }

    #[test]
    fn every_stored_byte_and_word_comes_back() {
        let curves = [Encoding::Linear, Encoding::Srgb, Encoding::Gamma(2.2), Encoding::Gamma(0.45)];
        for curve in curves {
            for byte in 0..=255u8 {
                assert_eq!(unit_to_u8(curve.encode(curve.decode_u8(byte))), byte, "{curve:?}");
                let (tabled, worked) = (curve.decode_u8(byte), curve.decode(f32::from(byte) / 255.0));
                assert!((tabled - worked).abs() <= 2.0 * f32::EPSILON * worked, "{curve:?} {byte}");
            }
        }
        for word in 0..=u16::MAX {
            for curve in [Encoding::Linear, Encoding::Srgb] {
                assert_eq!(unit_to_u16(curve.encode(curve.decode_u16(word))), word, "{curve:?}");
            }
        }
    }

    #[test]
    fn rounding_is_to_the_nearest_and_halves_go_up() {
        for byte in 0..255u8 {
            let half = (f32::from(byte) + 0.5) / 255.0;
            let exact = f64::from(half) * 255.0;
            let expected = if exact >= f64::from(byte) + 0.5 { byte + 1 } else { byte };
            assert_eq!(unit_to_u8(half), expected);
            assert_eq!(unit_to_u8(half - 1e-4), byte);
            assert_eq!(unit_to_u8(half + 1e-4), byte + 1);
        }
        assert_eq!([-3.0, 7.0, f32::NAN, f32::INFINITY, -0.0].map(unit_to_u8), [0, 255, 0, 255, 0]);
        assert_eq!([-3.0, 7.0, f32::NAN, f32::INFINITY].map(unit_to_u16), [0, 65535, 0, 65535]);
    }

    #[test]
    fn encoded_colours_stay_within_what_a_display_shows() {
        let e = Encoded::srgb(Rgb::new(-2.0, 0.214_041_14, f32::NAN));
        assert_eq!(e.to_u8(), [0, 128, 0]);
        assert_eq!(Encoded::srgb(Rgb::splat(f32::INFINITY)).to_u16(), [65535; 3]);
        let back = Encoded::new(0.25, 0.5, 0.75).to_linear();
        assert!((back.g - 0.214_041_14).abs() < 1e-7);
    }
}
