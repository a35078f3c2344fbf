//! Backgrounds for pictures with alpha.

use lumbre_image::{Encoded, Image, Rgb, ToneMap};
use lumbre_math::Elementary;
use lumbre_render::PixelBounds;

/// The background of a transparent picture. Its colours are display colours: tone mapping does not change them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Background {
    /// One colour: linear, in [0, 1].
    Colour(Rgb),
    /// A vertical gradient from the first at the top to the second at the bottom, perceptually even.
    Gradient([Encoded; 2]),
    /// A linear picture, scaled to cover the whole and cropped.
    Picture(Image),
}

impl Background {
    /// Studio paper: light grey, slightly lighter at the bottom.
    pub fn studio() -> Self {
        Self::Gradient([Encoded::srgb(Rgb::splat(0.60)), Encoded::srgb(Rgb::splat(0.86))])
    }

    /// The background's pixels for a part of a picture of this size.
    fn pixels(&self, bounds: PixelBounds, whole: (u32, u32)) -> impl Iterator<Item = Rgb> + '_ {
        let (width, height) = (f64::from(whole.0.max(1)), f64::from(whole.1.max(1)));
        bounds.pixels().map(move |(x, y)| {
            let (x, y) = ((f64::from(x) + 0.5) / width, (f64::from(y) + 0.5) / height);
            match self {
                Self::Colour(colour) => *colour,
                Self::Gradient([top, bottom]) => {
                    let [a, b] = [top.channels(), bottom.channels()];
                    let mix = |c: usize| a[c] + (b[c] - a[c]) * y as f32;
                    Encoded::new(mix(0), mix(1), mix(2)).to_linear()
                }
                Self::Picture(image) => {
                    let (w, h) = (f64::from(image.width()), f64::from(image.height()));
                    // Image pixels per picture pixel, equal along both axes.
                    let scale = (w / width).min(h / height);
                    bilinear(image, 0.5 * w + (x - 0.5) * width * scale, 0.5 * h + (y - 0.5) * height * scale)
                }
            }
        })
    }

    /// A picture over the background as displayed: the picture tone-mapped, the background unchanged. The
    /// background shows where `coverage`, or else the image's own alpha, is below 1.
    pub(crate) fn under_shown(
        &self,
        image: &Image,
        coverage: Option<&Image>,
        bounds: PixelBounds,
        whole: (u32, u32),
        tone_map: ToneMap,
        exposure: f32,
    ) -> Image {
        self.under(image, coverage, bounds, whole, |light, alpha| {
            let pure = if alpha > 0.0 { light / alpha } else { light };
            tone_map.apply(pure * exposure.exponential_2()) * if alpha > 0.0 { alpha } else { 1.0 }
        })
    }

    /// A picture over the background, in linear light.
    pub(crate) fn under_light(
        &self,
        image: &Image,
        coverage: Option<&Image>,
        bounds: PixelBounds,
        whole: (u32, u32),
    ) -> Image {
        self.under(image, coverage, bounds, whole, |light, _| light)
    }

    fn under(
        &self,
        image: &Image,
        coverage: Option<&Image>,
        bounds: PixelBounds,
        whole: (u32, u32),
        front: impl Fn(Rgb, f32) -> Rgb,
    ) -> Image {
        let alpha = |i: usize| image.alpha().map_or(1.0, |alpha| alpha[i]);
        let mut out = Image::filled(image.width(), image.height(), Rgb::BLACK);
        let light = image.pixels().iter().enumerate();
        for ((out, (i, &light)), behind) in
            out.pixels_mut().iter_mut().zip(light).zip(self.pixels(bounds, whole))
        {
            let alpha = alpha(i);
            let covered = coverage.map_or(Rgb::splat(alpha), |coverage| coverage.pixels()[i]);
            *out = front(light, alpha) + behind * (Rgb::WHITE - covered);
        }
        out
    }
}

fn bilinear(image: &Image, x: f64, y: f64) -> Rgb {
    let (fx, fy) = ((x - 0.5).floor(), (y - 0.5).floor());
    let (u, v) = ((x - 0.5 - fx) as f32, (y - 0.5 - fy) as f32);
    let pixel = |i: f64, j: f64| {
        let inside = |at: f64, count: u32| at.clamp(0.0, f64::from(count.max(1) - 1)) as u32;
        image.pixel(inside(i, image.width()), inside(j, image.height()))
    };
    let above = pixel(fx, fy).lerp(pixel(fx + 1.0, fy), u);
    let below = pixel(fx, fy + 1.0).lerp(pixel(fx + 1.0, fy + 1.0), u);
    above.lerp(below, v)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: PixelBounds = PixelBounds { x0: 0, y0: 0, x1: 6, y1: 4 };

    fn picture() -> Image {
        let alpha: Vec<f32> = (0..24).map(|i| [0.0, 0.5, 1.0][i % 3]).collect();
        let pixels = alpha.iter().map(|&a| Rgb::new(2.0, 0.5, 0.25) * a).collect();
        Image::from_pixels(6, 4, pixels).unwrap().with_alpha(alpha).unwrap()
    }

    #[test]
    fn colours_are_shown_as_asked_and_light_is_tone_mapped() {
        let colour = Rgb::new(0.9, 0.8, 0.7);
        let shown =
            Background::Colour(colour).under_shown(&picture(), None, WHOLE, (6, 4), ToneMap::Neutral, -1.0);
        let front = ToneMap::Neutral.apply(Rgb::new(1.0, 0.25, 0.125));
        for (i, expected) in [colour, (front + colour) * 0.5, front].into_iter().enumerate() {
            let found = shown.pixels()[6 + i];
            assert!((found - expected).map(f32::abs).max_component() < 1e-6, "{i}: {found:?} {expected:?}");
        }
        let light = Background::Colour(colour).under_light(&picture(), None, WHOLE, (6, 4));
        assert_eq!(light.pixels()[2], Rgb::new(2.0, 0.5, 0.25));
        assert!(light.alpha().is_none());
    }

    #[test]
    fn what_is_covered_of_each_colour_is_missing_of_it() {
        let behind = Rgb::new(0.9, 0.8, 0.7);
        let image = Image::filled(6, 4, Rgb::BLACK).with_alpha(vec![0.5; 24]).unwrap();
        let coverage = Image::filled(6, 4, Rgb::new(0.25, 0.5, 0.75));
        let expected = Rgb::new(0.75 * 0.9, 0.5 * 0.8, 0.25 * 0.7);
        let background = Background::Colour(behind);
        let light = background.under_light(&image, Some(&coverage), WHOLE, (6, 4));
        let shown = background.under_shown(&image, Some(&coverage), WHOLE, (6, 4), ToneMap::Neutral, 1.0);
        for found in [light.pixels()[7], shown.pixels()[7]] {
            assert!((found - expected).map(f32::abs).max_component() < 1e-6, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn a_part_of_a_picture_has_its_part_of_the_background() {
        let ramp: Vec<Rgb> = (0..80).map(|i| Rgb::splat((i % 10) as f32)).collect();
        let backgrounds =
            [Background::studio(), Background::Picture(Image::from_pixels(10, 8, ramp).unwrap())];
        let part = PixelBounds { x0: 2, y0: 1, x1: 5, y1: 3 };
        for background in backgrounds {
            let whole: Vec<Rgb> = background.pixels(WHOLE, (6, 4)).collect();
            let found: Vec<Rgb> = background.pixels(part, (6, 4)).collect();
            let expected: Vec<Rgb> = part.pixels().map(|(x, y)| whole[(y * 6 + x) as usize]).collect();
            assert_eq!(found, expected);
            assert_ne!(whole[0], whole[23]);
        }
    }

    #[test]
    fn a_picture_covers_the_whole_and_keeps_its_shape() {
        // Twice as long as the picture wants: the outer quarters are cut.
        let ramp: Vec<Rgb> = (0..24 * 8).map(|i| Rgb::splat((i % 24) as f32 + 0.5)).collect();
        let background = Background::Picture(Image::from_pixels(24, 8, ramp).unwrap());
        let row: Vec<f32> = background.pixels(WHOLE, (6, 4)).take(6).map(|c| c.r).collect();
        assert_eq!(row, [7.0, 9.0, 11.0, 13.0, 15.0, 17.0]);
    }
}
