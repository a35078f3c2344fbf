//! `--preview`: the picture in the terminal while it is rendered.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use lumbre::SaveOptions;
use lumbre::formats::image::{ImageFormat, encode_image};
use lumbre::image::{Image, ToneMap};
use lumbre::math::Elementary;
use lumbre_viewer::base64;

use crate::console::understands_ansi;
use crate::failure::Failure;
use crate::progress::PictureViewer;

/// How a terminal shows pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Protocol {
    /// The best protocol that this terminal is known to have.
    Auto,
    /// The protocol of Kitty, Ghostty and WezTerm.
    Kitty,
    /// The protocol of iTerm2.
    Iterm,
    /// Sixel, for foot, mlterm, xterm and others.
    Sixel,
    /// Half blocks in 24-bit colour, for nearly every terminal.
    Blocks,
}

/// Between two pictures.
const EVERY: Duration = Duration::from_millis(900);
/// Cells across and down.
const CELLS: (u32, u32) = (80, 24);
/// Pixels of a cell, about.
const CELL: (u32, u32) = (10, 20);

/// The picture on standard error, in place of the one before.
pub(crate) struct Preview {
    protocol: Protocol,
    tone_map: ToneMap,
    exposure: f32,
    last: Mutex<Option<Instant>>,
}

impl Preview {
    /// A preview by a protocol.
    ///
    /// # Errors
    /// [`Failure::Usage`] where the protocol is to be found out and standard error is no terminal.
    pub(crate) fn new(protocol: Protocol, tone_map: ToneMap, exposure: f32) -> Result<Self, Failure> {
        if protocol == Protocol::Auto && !std::io::stderr().is_terminal() {
            let why = "--preview: standard error is not a terminal (expected a terminal, or --preview=kitty, iterm, sixel or blocks)";
            return Err(Failure::Usage(why.to_owned()));
        }
        if protocol == Protocol::Auto && !understands_ansi() {
            let why = "--preview: this terminal shows no pictures (expected one that takes escape sequences, or --preview=kitty, iterm, sixel or blocks)";
            return Err(Failure::Usage(why.to_owned()));
        }
        let variable = |name: &str| std::env::var(name).unwrap_or_default();
        let protocol = if protocol == Protocol::Auto { known(variable) } else { protocol };
        Ok(Self { protocol, tone_map, exposure, last: Mutex::new(None) })
    }
}

/// What a terminal has, by the variables that it sets.
fn known(variable: impl Fn(&str) -> String) -> Protocol {
    let (terminal, program) = (variable("TERM"), variable("TERM_PROGRAM"));
    let is_within = |names: &[&str], text: &str| names.iter().any(|name| text.contains(name));
    // Within a multiplexer, it is not the terminal that reads what is written.
    if is_within(&["tmux", "screen"], &terminal) || !variable("TMUX").is_empty() {
        Protocol::Blocks
    } else if is_within(&["kitty", "ghostty"], &terminal) || is_within(&["WezTerm", "ghostty"], &program) {
        Protocol::Kitty
    } else if program == "iTerm.app" {
        Protocol::Iterm
    } else if is_within(&["foot", "mlterm", "sixel", "contour"], &terminal) {
        Protocol::Sixel
    } else {
        Protocol::Blocks
    }
}

impl PictureViewer for Preview {
    fn show(&self, picture: &dyn Fn() -> Image, is_last: bool) {
        let mut last = self.last.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if !is_last && last.is_some_and(|last| last.elapsed() < EVERY) {
            return;
        }
        let text = drawn(&picture(), self.protocol, self.tone_map, self.exposure, last.is_some());
        let mut out = std::io::stderr().lock();
        // A preview that cannot be written stops no render.
        let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        *last = Some(Instant::now());
    }
}

/// The escape sequence that shows a picture; `again` over the previous one.
fn drawn(image: &Image, protocol: Protocol, tone_map: ToneMap, exposure: f32, again: bool) -> String {
    let (across, down) = match protocol {
        Protocol::Blocks => (CELLS.0, 2 * CELLS.1),
        _ => (CELLS.0 * CELL.0, CELLS.1 * CELL.1),
    };
    let (width, height) = fitted((image.width(), image.height()), (across, down));
    let Some(small) = image.resized(width, height) else { return String::new() };
    let rows = match protocol {
        Protocol::Blocks => height.div_ceil(2),
        _ => height.div_ceil(CELL.1),
    };
    let columns = width.div_ceil(CELL.0);
    // Room is made first, so that the screen does not scroll under the picture.
    let up = format!("\x1b[{rows}A\r");
    let start = if again { up.clone() } else { "\n".repeat(rows as usize) + &up };
    let picture = match protocol {
        Protocol::Kitty => kitty(&png(&small, tone_map, exposure), columns, rows),
        Protocol::Iterm => {
            let bytes = base64(&png(&small, tone_map, exposure));
            format!("\x1b]1337;File=inline=1;width={columns};height={rows}:{bytes}\x07")
        }
        Protocol::Sixel => sixel(&small, tone_map, exposure),
        Protocol::Blocks | Protocol::Auto => return start + &blocks(&small, tone_map, exposure),
    };
    // Wherever it left the cursor, it goes on below.
    format!("{start}\x1b7{picture}\x1b8\x1b[{rows}B\r")
}

/// The largest size of this shape that fits.
fn fitted((width, height): (u32, u32), (across, down): (u32, u32)) -> (u32, u32) {
    let scale = (f64::from(across) / f64::from(width.max(1)))
        .min(f64::from(down) / f64::from(height.max(1)))
        .min(1.0);
    let side = |pixels: u32| ((f64::from(pixels) * scale).rounded() as u32).max(1);
    (side(width), side(height))
}

fn png(image: &Image, tone_map: ToneMap, exposure: f32) -> Vec<u8> {
    let mut options = SaveOptions::default();
    (options.tone_map, options.exposure) = (tone_map, exposure);
    encode_image(image, ImageFormat::Png, &options).unwrap_or_default()
}

/// Bytes of a piece of a picture that Kitty takes at once.
const PIECE: usize = 4096;

fn kitty(png: &[u8], columns: u32, rows: u32) -> String {
    let text = base64(png);
    let pieces: Vec<&[u8]> = text.as_bytes().chunks(PIECE).collect();
    let mut told = String::new();
    for (i, piece) in pieces.iter().enumerate() {
        // The same number again takes the place of the picture before.
        let what =
            if i == 0 { format!("a=T,f=100,i=5386,q=2,C=1,c={columns},r={rows},") } else { String::new() };
        let more = u8::from(i + 1 < pieces.len());
        told += &format!("\x1b_G{what}m={more};{}\x1b\\", String::from_utf8_lossy(piece));
    }
    told
}

/// Steps of each colour in the palette of a sixel picture: 6 × 6 × 6 colours.
const LEVELS: u32 = 6;

fn sixel(image: &Image, tone_map: ToneMap, exposure: f32) -> String {
    let (width, height) = (image.width(), image.height());
    let mut told = format!("\x1bPq\"1;1;{width};{height}");
    for colour in 0..LEVELS.pow(3) {
        let percent = |step: u32| step * 100 / (LEVELS - 1);
        let (r, g, b) = (colour / LEVELS / LEVELS, colour / LEVELS % LEVELS, colour % LEVELS);
        told += &format!("#{colour};2;{};{};{}", percent(r), percent(g), percent(b));
    }
    let colour = |x: u32, y: u32| {
        // Ordered dithering: a threshold for each pixel of a square of four by four.
        const ORDER: [u32; 16] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];
        let threshold = (ORDER[(y % 4 * 4 + x % 4) as usize] as f32 + 0.5) / 16.0;
        let step = |c: f32| ((c * (LEVELS - 1) as f32 + threshold) as u32).min(LEVELS - 1);
        let [r, g, b] = tone_map.encode(image.pixel(x, y), exposure).channels().map(step);
        (r * LEVELS + g) * LEVELS + b
    };
    for top in (0..height).step_by(6) {
        let mut bands = std::collections::BTreeMap::<u32, Vec<u8>>::new();
        for x in 0..width {
            for (bit, y) in (top..height.min(top + 6)).enumerate() {
                let band = bands.entry(colour(x, y)).or_insert_with(|| vec![0; width as usize]);
                band[x as usize] |= 1 << bit;
            }
        }
        for (colour, band) in bands {
            told += &format!("#{colour}");
            for run in band.chunk_by(|a, b| a == b) {
                told += &format!("!{}{}", run.len(), char::from(63 + run[0]));
            }
            told.push('$');
        }
        told.push('-');
    }
    told + "\x1b\\"
}

fn blocks(image: &Image, tone_map: ToneMap, exposure: f32) -> String {
    let mut told = String::new();
    for y in (0..image.height()).step_by(2) {
        for x in 0..image.width() {
            let colour =
                |y: u32| tone_map.encode(image.pixel(x, y.min(image.height() - 1)), exposure).to_u8();
            let ([r, g, b], [s, h, c]) = (colour(y), colour(y + 1));
            told += &format!("\x1b[38;2;{r};{g};{b};48;2;{s};{h};{c}m\u{2580}");
        }
        told += "\x1b[0m\r\n";
    }
    told
}

#[cfg(test)]
mod tests {
    use lumbre::image::Rgb;

    use super::*;

    fn picture() -> Image {
        let pixels =
            (0..6 * 4).map(|i| if i < 12 { Rgb::new(1.0, 0.0, 0.0) } else { Rgb::new(0.0, 0.0, 1.0) });
        Image::from_pixels(6, 4, pixels.collect()).unwrap()
    }

    #[test]
    fn terminals_are_known_by_their_variables() {
        let of = |set: &[(&str, &str)]| {
            known(|name| {
                set.iter()
                    .find(|(known, _)| *known == name)
                    .map_or_else(String::new, |(_, v)| (*v).to_owned())
            })
        };
        assert_eq!(of(&[("TERM", "xterm-kitty")]), Protocol::Kitty);
        assert_eq!(of(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm")]), Protocol::Kitty);
        assert_eq!(of(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "iTerm.app")]), Protocol::Iterm);
        assert_eq!(of(&[("TERM", "foot")]), Protocol::Sixel);
        assert_eq!(of(&[("TERM", "xterm-kitty"), ("TMUX", "/tmp/x")]), Protocol::Blocks);
        assert_eq!(of(&[]), Protocol::Blocks);
    }

    #[test]
    fn half_blocks_have_the_upper_pixel_before_the_lower() {
        let told = drawn(&picture(), Protocol::Blocks, ToneMap::None, 0.0, false);
        assert!(told.starts_with("\n\n\x1b[2A\r\x1b[38;2;255;0;0;48;2;255;0;0m\u{2580}"), "{told:?}");
        assert_eq!(told.matches('\u{2580}').count(), 12);
        assert!(told.contains("38;2;0;0;255;48;2;0;0;255"));
        assert!(drawn(&picture(), Protocol::Blocks, ToneMap::None, 0.0, true).starts_with("\x1b[2A"));
    }

    #[test]
    fn sixels_are_six_rows_high_and_of_the_colours_of_the_picture() {
        let told = sixel(&picture(), ToneMap::None, 0.0);
        // Red in the upper two of six rows, blue in the next two.
        assert!(
            told.starts_with("\x1bPq\"1;1;6;4#0;2;0;0;0") && told.ends_with("#5!6K$#180!6B$-\x1b\\"),
            "{told}"
        );
    }

    #[test]
    fn pieces_for_kitty_say_whether_more_comes() {
        let told = kitty(&[7; 10_000], 40, 12);
        assert!(told.starts_with("\x1b_Ga=T,f=100,i=5386,q=2,C=1,c=40,r=12,m=1;BwcH"));
        assert_eq!((told.matches("m=1;").count(), told.matches("m=0;").count()), (3, 1));
        let text: String = told
            .split("\x1b_G")
            .skip(1)
            .map(|part| part.split(';').nth(1).unwrap().trim_end_matches("\x1b\\"))
            .collect();
        assert_eq!(text, base64(&[7; 10_000]));
    }
}
