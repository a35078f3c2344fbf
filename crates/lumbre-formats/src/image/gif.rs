//! Animated GIF (CompuServe, "Graphics Interchange Format", version 89a, 1990).

use std::io;

use ::gif::{Encoder, Frame, Repeat};
use lumbre_image::Image;
use lumbre_math::Elementary;

use super::{WriteOptions, rgb8};

/// Writes pictures of the same size as an animated GIF that repeats without end.
///
/// Each frame has a palette of 256 colours of its own; what is kept of it is compressed.
pub struct GifWriter {
    encoder: Encoder<Vec<u8>>,
    size: (u32, u32),
    frames_per_second: f64,
    count: u32,
}

/// How carefully the palette is chosen, from 1 to 30, the fastest.
const SPEED: i32 = 10;
/// The least time of a frame in hundredths of a second: viewers show shorter ones for much longer.
const MIN_DELAY: u16 = 2;

impl std::fmt::Debug for GifWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GifWriter")
            .field("size", &self.size)
            .field("count", &self.count)
            .finish_non_exhaustive()
    }
}

impl GifWriter {
    /// An animation of this size.
    ///
    /// # Errors
    /// When a side has more than 65535 pixels, or none.
    pub fn new(width: u32, height: u32, frames_per_second: f64) -> io::Result<Self> {
        let wrong = "GIF images have from 1 to 65535 pixels a side";
        let side = |n: u32| u16::try_from(n).ok().filter(|&n| n > 0);
        let (Some(w), Some(h)) = (side(width), side(height)) else {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, wrong));
        };
        let mut encoder = Encoder::new(Vec::new(), w, h, &[]).map_err(io::Error::other)?;
        encoder.set_repeat(Repeat::Infinite).map_err(io::Error::other)?;
        Ok(Self { encoder, size: (width, height), frames_per_second, count: 0 })
    }

    /// Adds a picture, as a display shows it; one with alpha over black.
    ///
    /// # Errors
    /// When it has another size.
    pub fn add(&mut self, image: &Image, options: &WriteOptions) -> io::Result<()> {
        if (image.width(), image.height()) != self.size {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "a frame of another size"));
        }
        let (width, height) = (image.width() as u16, image.height() as u16);
        let mut frame = Frame::from_rgb_speed(width, height, &rgb8(image, options), SPEED);
        // Times are rounded to hundredths so that the whole is as long as it should be.
        let time = |frames: u32| (100.0 * f64::from(frames) / self.frames_per_second).rounded();
        let delay = time(self.count + 1) - time(self.count);
        // A cast from a float saturates.
        frame.delay = (delay as u16).max(MIN_DELAY);
        self.count += 1;
        self.encoder.write_frame(&frame).map_err(io::Error::other)
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// As the encoder's.
    pub fn finish(self) -> io::Result<Vec<u8>> {
        self.encoder.into_inner().map_err(io::Error::other)
    }
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;

    use super::*;

    #[test]
    fn frames_come_back_with_their_colours_and_times() {
        let colours = [Rgb::new(1.0, 0.0, 0.0), Rgb::new(0.0, 1.0, 0.0), Rgb::new(0.0, 0.0, 1.0)];
        let mut writer = GifWriter::new(7, 5, 24.0).unwrap();
        for colour in colours {
            writer.add(&Image::filled(7, 5, colour), &WriteOptions::default()).unwrap();
        }
        assert!(writer.add(&Image::filled(5, 7, Rgb::WHITE), &WriteOptions::default()).is_err());
        let bytes = writer.finish().unwrap();
        let mut options = ::gif::DecodeOptions::new();
        options.set_color_output(::gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&bytes[..]).unwrap();
        assert_eq!((decoder.width(), decoder.height(), decoder.repeat()), (7, 5, Repeat::Infinite));
        let mut delays = vec![];
        for colour in colours {
            let frame = decoder.read_next_frame().unwrap().unwrap();
            let [r, g, b] = colour.to_array().map(|c| (255.0 * c) as u8);
            assert!(frame.buffer.chunks(4).all(|pixel| pixel == [r, g, b, 255]), "{:?}", &frame.buffer[..8]);
            delays.push(frame.delay);
        }
        // An eighth of a second in hundredths.
        assert_eq!(delays, [4, 4, 5]);
        assert!(decoder.read_next_frame().unwrap().is_none());
        assert!(GifWriter::new(65_536, 5, 24.0).is_err() && GifWriter::new(5, 0, 24.0).is_err());
    }
}
