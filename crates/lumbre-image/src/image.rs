//! A rectangle of linear colours.

use crate::Rgb;

/// A rectangle of linear colours with optional alpha, row by row from the top left. With alpha, the colours are
/// premultiplied.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    // `pixels.len() == width * height`, and likewise for `alpha`.
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

    /// The image with alpha in `[0, 1]`, one value a pixel; `None` unless there is one per pixel.
    pub fn with_alpha(self, alpha: Vec<f32>) -> Option<Self> {
        (alpha.len() == self.pixels.len()).then_some(Self { alpha: Some(alpha), ..self })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
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

    /// Alpha, row by row from the top left, if the image has it.
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

    /// One channel of every pixel, row by row from the top left: red, green or blue by `0`, `1` or `2`.
    ///
    /// # Panics
    /// When `channel` is more than 2.
    pub fn channel(&self, channel: usize) -> impl ExactSizeIterator<Item = f32> + '_ {
        self.pixels.iter().map(move |pixel| pixel[channel])
    }

    /// Maps each pixel by `f`; alpha is unchanged.
    #[must_use]
    pub fn map(mut self, f: impl FnMut(Rgb) -> Rgb) -> Self {
        let mut f = f;
        self.pixels.iter_mut().for_each(|pixel| *pixel = f(*pixel));
        self
    }

    /// The mean colour, summed in double precision in the order of the pixels; black when there are none.
    pub fn mean(&self) -> Rgb {
        let mut sum = [0.0f64; 3];
        for pixel in &self.pixels {
            for (sum, c) in sum.iter_mut().zip(pixel.to_array()) {
                *sum += f64::from(c);
            }
        }
        let count = self.pixels.len().max(1) as f64;
        let [r, g, b] = sum.map(|s| (s / count) as f32);
        Rgb::new(r, g, b)
    }

    /// The part of the image within `window`, clipped to the image; `None` when it is empty.
    pub fn crop(&self, window: Window) -> Option<Self> {
        let whole = Window { x: 0, y: 0, width: self.width, height: self.height };
        let part = window.intersection(whole)?;
        Some(self.gathered(part.width, part.height, |x, y| (x + part.x as u32, y + part.y as u32)))
    }

    /// Upside down: the first row last.
    #[must_use]
    pub fn flipped_rows(&self) -> Self {
        self.gathered(self.width, self.height, |x, y| (x, self.height - 1 - y))
    }

    /// Mirrored: the first column last.
    #[must_use]
    pub fn flipped_columns(&self) -> Self {
        self.gathered(self.width, self.height, |x, y| (self.width - 1 - x, y))
    }

    /// The image on a larger canvas: its top left pixel is at `(x, y)` of a black, transparent canvas of
    /// `width` by `height`; the rest is clipped.
    #[must_use]
    pub fn placed(&self, x: i32, y: i32, width: u32, height: u32) -> Self {
        let mut canvas = Self::filled(width, height, Rgb::BLACK);
        canvas.alpha = self.alpha.as_ref().map(|_| vec![0.0; canvas.pixels.len()]);
        let here = Window { x, y, width: self.width, height: self.height };
        let Some(seen) = here.intersection(Window { x: 0, y: 0, width, height }) else { return canvas };
        for row in 0..seen.height {
            let to = (seen.y as usize + row as usize) * width as usize + seen.x as usize;
            let from_y = (i64::from(seen.y) - i64::from(y)) as usize + row as usize;
            let from = from_y * self.width as usize + (i64::from(seen.x) - i64::from(x)) as usize;
            let span = seen.width as usize;
            canvas.pixels[to..to + span].copy_from_slice(&self.pixels[from..from + span]);
            if let (Some(into), Some(alpha)) = (&mut canvas.alpha, &self.alpha) {
                into[to..to + span].copy_from_slice(&alpha[from..from + span]);
            }
        }
        canvas
    }

    /// The image resized by a box filter: exact for integer factors, and the mean of the image is preserved.
    /// `None` when either image would have no pixels.
    pub fn resized(&self, width: u32, height: u32) -> Option<Self> {
        if self.pixels.is_empty() || width == 0 || height == 0 {
            return None;
        }
        let columns = spans(self.width, width);
        let rows = spans(self.height, height);
        let alpha = |i: usize| self.alpha.as_ref().map_or(1.0, |alpha| f64::from(alpha[i]));
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        let mut coverage = Vec::with_capacity(pixels.capacity());
        for row in &rows {
            for column in &columns {
                let mut sum = [0.0f64; 4];
                for &(y, wy) in row {
                    for &(x, wx) in column {
                        let i = y * self.width as usize + x;
                        let weight = wx * wy;
                        let [r, g, b] = self.pixels[i].to_array().map(f64::from);
                        for (sum, c) in sum.iter_mut().zip([r, g, b, alpha(i)]) {
                            *sum += weight * c;
                        }
                    }
                }
                let [r, g, b, a] = sum.map(|c| c as f32);
                pixels.push(Rgb::new(r, g, b));
                coverage.push(a);
            }
        }
        Some(Self { width, height, pixels, alpha: self.alpha.as_ref().map(|_| coverage) })
    }

    /// An image of `width` by `height` whose pixels are read at `from(x, y)`, which must be inside this one.
    fn gathered(&self, width: u32, height: u32, from: impl Fn(u32, u32) -> (u32, u32)) -> Self {
        let places = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let index = |(x, y)| {
            let (x, y) = from(x, y);
            y as usize * self.width as usize + x as usize
        };
        Self {
            width,
            height,
            pixels: places().map(|p| self.pixels[index(p)]).collect(),
            alpha: self.alpha.as_ref().map(|alpha| places().map(|p| alpha[index(p)]).collect()),
        }
    }
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// Its leftmost column.
    pub x: i32,
    /// Its topmost row.
    pub y: i32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Window {
    /// The intersection; `None` when it is empty.
    pub fn intersection(self, other: Self) -> Option<Self> {
        let axis = |a: i32, a_len: u32, b: i32, b_len: u32| {
            let start = a.max(b);
            let end = (i64::from(a) + i64::from(a_len)).min(i64::from(b) + i64::from(b_len));
            u32::try_from(end - i64::from(start)).ok().filter(|&len| len > 0).map(|len| (start, len))
        };
        let (x, width) = axis(self.x, self.width, other.x, other.width)?;
        let (y, height) = axis(self.y, self.height, other.y, other.height)?;
        Some(Self { x, y, width, height })
    }
}

/// For each of `to` equal parts of a line of `from` pixels, the pixels that it covers and their weights.
fn spans(from: u32, to: u32) -> Vec<Vec<(usize, f64)>> {
    let step = f64::from(from) / f64::from(to);
    (0..to)
        .map(|i| {
            // The products are exact for integer factors, so neighbours overlap in no sliver.
            let (start, end) = (f64::from(i) * step, f64::from(i + 1) * step);
            let last = (end.ceil() as usize).min(from as usize);
            (start as usize..last)
                .map(|p| (p, ((p as f64 + 1.0).min(end) - (p as f64).max(start)) / step))
                .filter(|&(_, share)| share > 0.0)
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 5 by 3, each pixel telling where it is.
    fn places() -> Image {
        let colours = (0..15).map(|i| Rgb::new((i % 5) as f32, (i / 5) as f32, 7.0)).collect();
        let alpha = (0..15).map(|i| i as f32 / 20.0).collect();
        Image::from_pixels(5, 3, colours).unwrap().with_alpha(alpha).unwrap()
    }

    #[test]
    fn a_crop_is_cut_at_the_edge() {
        let part = places().crop(Window { x: 3, y: -1, width: 9, height: 3 }).unwrap();
        assert_eq!((part.width(), part.height()), (2, 2));
        assert_eq!(part.pixel(1, 1), Rgb::new(4.0, 1.0, 7.0));
        assert_eq!(part.alpha().unwrap()[3], 9.0 / 20.0);
        assert!(places().crop(Window { x: 5, y: 0, width: 2, height: 2 }).is_none());
        assert!(places().crop(Window { x: i32::MIN, y: 0, width: u32::MAX, height: 2 }).is_some());
    }

    #[test]
    fn flips_undo_themselves() {
        let image = places();
        assert_eq!(image.flipped_rows().pixel(1, 0), Rgb::new(1.0, 2.0, 7.0));
        assert_eq!(image.flipped_columns().pixel(1, 2), Rgb::new(3.0, 2.0, 7.0));
        assert_eq!(image.flipped_rows().flipped_rows(), image);
        assert_eq!(image.flipped_columns().flipped_columns(), image);
    }

    #[test]
    fn a_placed_image_crops_back() {
        let image = places();
        let canvas = image.placed(2, 4, 10, 9);
        assert_eq!(canvas.pixel(2, 4), image.pixel(0, 0));
        assert_eq!(canvas.pixel(1, 4), Rgb::BLACK);
        assert_eq!(canvas.crop(Window { x: 2, y: 4, width: 5, height: 3 }).unwrap(), image);
        let off = image.placed(-2, -1, 2, 2);
        assert_eq!(off.pixel(0, 0), image.pixel(2, 1));
        assert_eq!(image.placed(100, 100, 3, 2).mean(), Rgb::BLACK);
    }

    #[test]
    fn resizing_keeps_the_mean() {
        let image = places();
        for (w, h) in [(2, 2), (5, 3), (10, 9), (3, 1), (7, 11)] {
            let other = image.resized(w, h).unwrap();
            let error = (other.mean() - image.mean()).map(f32::abs).max_component();
            assert!(error < 1e-5, "{w} by {h}: {error}");
        }
        assert_eq!(image.resized(5, 3).unwrap(), image);
        assert_eq!(image.resized(10, 6).unwrap().pixel(9, 5), image.pixel(4, 2));
        assert!(image.resized(0, 3).is_none());
    }

    #[test]
    fn channels_and_maps_see_every_pixel() {
        let image = places();
        assert_eq!(image.channel(1).sum::<f32>(), 15.0);
        assert_eq!(image.clone().map(|c| c * 2.0).pixel(4, 2), Rgb::new(8.0, 4.0, 14.0));
        assert_eq!(image.mean(), Rgb::new(2.0, 1.0, 7.0));
    }
}
