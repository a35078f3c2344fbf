//! A rectangle of linear colours.

use crate::Rgb;

/// A rectangle of linear colours with optional coverage, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    // `pixels.len() == width * height`, and so for `alpha` where it is there.
    width: u32,
    height: u32,
    pixels: Vec<Rgb>,
    alpha: Option<Vec<f32>>,
}

impl Image {
    /// An image of one colour.
    pub fn filled(width: u32, height: u32, colour: Rgb) -> Self {
        Self { width, height, pixels: vec![colour; width as usize * height as usize], alpha: None }
    }

    /// An image from its pixels, row by row from the top left; `None` unless there are `width * height` of them.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<Rgb>) -> Option<Self> {
        (pixels.len() == width as usize * height as usize).then_some(Self {
            width,
            height,
            pixels,
            alpha: None,
        })
    }

    /// The same image with coverage in `[0, 1]`, one value a pixel; `None` unless there are as many as pixels.
    pub fn with_alpha(self, alpha: Vec<f32>) -> Option<Self> {
        (alpha.len() == self.pixels.len()).then_some(Self { alpha: Some(alpha), ..self })
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Every pixel, row by row from the top left.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// Every pixel, row by row from the top left.
    pub fn pixels_mut(&mut self) -> &mut [Rgb] {
        &mut self.pixels
    }

    /// Coverage, row by row from the top left, where the image has it.
    pub fn alpha(&self) -> Option<&[f32]> {
        self.alpha.as_deref()
    }

    /// The pixel `x` from the left and `y` from the top.
    ///
    /// # Panics
    /// When it lies outside the image.
    pub fn pixel(&self, x: u32, y: u32) -> Rgb {
        assert!(
            x < self.width && y < self.height,
            "no pixel ({x}, {y}) in {} by {}",
            self.width,
            self.height
        );
        self.pixels[y as usize * self.width as usize + x as usize]
    }
}
