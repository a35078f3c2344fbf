//! Colours by name.

use lumbre_image::{Rgb, srgb_to_linear};

/// The names of colours (CSS Color Module Level 4, 6.1, the basic ones and three more), and their codes in sRGB.
const NAMES: [(&str, u32); 18] = [
    ("white", 0xff_ff_ff),
    ("black", 0x00_00_00),
    ("grey", 0x80_80_80),
    ("gray", 0x80_80_80),
    ("silver", 0xc0_c0_c0),
    ("red", 0xff_00_00),
    ("maroon", 0x80_00_00),
    ("orange", 0xff_a5_00),
    ("yellow", 0xff_ff_00),
    ("olive", 0x80_80_00),
    ("lime", 0x00_ff_00),
    ("green", 0x00_80_00),
    ("teal", 0x00_80_80),
    ("cyan", 0x00_ff_ff),
    ("blue", 0x00_00_ff),
    ("navy", 0x00_00_80),
    ("magenta", 0xff_00_ff),
    ("purple", 0x80_00_80),
];

/// The names that [`colour`] knows.
pub fn colour_names() -> impl Iterator<Item = &'static str> {
    NAMES.iter().map(|(name, _)| *name)
}

/// The colour of a name such as `navy`, or of three or six hexadecimal digits of sRGB such as `#fa0` or `#e8e0d8`, in
/// linear light. `None` for other words.
pub fn colour(text: &str) -> Option<Rgb> {
    let lower = text.to_ascii_lowercase();
    let named = || NAMES.iter().find(|(name, _)| *name == lower).map(|(_, code)| *code);
    let code = match lower.strip_prefix('#') {
        None => named()?,
        Some(digits) => {
            let wide: String = match digits.len() {
                3 => digits.chars().flat_map(|c| [c, c]).collect(),
                6 => digits.to_owned(),
                _ => return None,
            };
            let is_hexadecimal = wide.len() == 6 && wide.bytes().all(|byte| byte.is_ascii_hexdigit());
            u32::from_str_radix(&wide, 16).ok().filter(|_| is_hexadecimal)?
        }
    };
    let channel = |shift: u32| srgb_to_linear((code >> shift & 0xff) as f32 / 255.0);
    Some(Rgb::new(channel(16), channel(8), channel(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_have_names_and_codes() {
        assert_eq!(colour("Red"), Some(Rgb::new(1.0, 0.0, 0.0)));
        assert_eq!(colour("#00f"), colour("blue"));
        assert_eq!(colour("#FFA500"), colour("orange"));
        for text in ["", "#", "#ff", "#12345", "#+12345", "#ggg", "#ää", "reddish", "ff0000"] {
            assert_eq!(colour(text), None, "{text}");
        }
        assert!(colour_names().all(|name| colour(name).is_some()));
    }
}
