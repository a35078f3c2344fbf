//! Less noise without more samples: a filter of the picture that knows what every pixel shows, and how sure it is.
//!
//! What is filtered is light over reflectance, so that textures stay as they are. Pixels are averaged that show the
//! same surface and whose neighbourhoods are the same but for noise (non-local means); the samples are in two halves;
//! each is averaged by weights from the other, so that no noise chooses itself (F. Rousselle, M. Manzi, M. Zwicker,
//! "Robust Denoising using Feature and Color Information", Computer Graphics Forum 32, 2013). Where they choose among
//! three filters by an estimate of the error, here is one.

mod means;
mod planes;
#[cfg(test)]
mod tests;

use lumbre_image::{Image, Rgb};

use crate::denoise::planes::{BORDER, Kind};
use crate::film::{Count, GuideSums, Guides, RatioSums};
use crate::workers::Workers;
use crate::{CancelToken, PixelBounds, Rendered};

/// Reflectance below which light is not divided by it.
const MIN_REFLECTANCE: f32 = 0.01;
/// Ground in a pixel below which its share of shadow is not known.
const MIN_GROUND: f32 = 1e-3;

/// Columns and rows of the blocks that a picture is filtered in.
const BLOCK: (usize, usize) = (256, 64);

/// Bytes that the filter needs for a picture of this many pixels, on this many threads: the denoised picture, and for
/// each thread the planes of a block.
pub(crate) fn memory_bytes(pixels: u64, threads: usize) -> u64 {
    // Colours, coverage by colour, alpha.
    const DENOISED: u64 = 2 * size_of::<Rgb>() as u64 + size_of::<f32>() as u64;
    // Two halves of three channels, what is known of them, variances and how they come about; features, their variance
    // and sharpness.
    const PLANES: usize = 4 * (2 * 3 + 2 + 1 + 12 + 13);
    let block = (BLOCK.0 + 2 * BORDER) * (BLOCK.1 + 2 * BORDER) * (size_of::<GuideSums>() + PLANES);
    let blocks = block as u64 * threads.max(1) as u64;
    pixels.saturating_mul(DENOISED).saturating_add(blocks)
}

/// A denoised picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Denoised {
    /// The pixels, with alpha if the rendered picture has it.
    pub image: Image,
    /// Coverage by channel, if the rendered picture has it: [`Rendered::coverage`].
    pub coverage: Option<Image>,
}

/// Denoises a picture that was rendered with [`crate::RenderOptions::guides`], on this many threads (0 for one per
/// core; pixels do not depend on it). `None` without guides or without a whole picture.
///
/// Pixels whose samples all agree and that resemble no other pixel are unchanged. Coverage is filtered only on shadow
/// catchers, so that outlines stay sharp. A coarse picture ([`crate::Stats::stride`]) is filtered at its small size,
/// then enlarged.
pub fn denoise(rendered: &Rendered, threads: usize) -> Option<Denoised> {
    denoise_unless(rendered, threads, &CancelToken::new())
}

/// The same, unless it is cancelled: then `None`, soon.
pub fn denoise_unless(rendered: &Rendered, threads: usize, cancel: &CancelToken) -> Option<Denoised> {
    let guides = rendered.guides.as_ref()?;
    let workers = Workers::start(threads);
    let noisy = Noisy {
        image: &rendered.image,
        coverage: rendered.coverage.as_ref(),
        guides,
        bounds: rendered.bounds,
        block: BLOCK,
    };
    match rendered.stats.stride? {
        1 => noisy.denoised(&workers, cancel),
        side => {
            let size = (rendered.image.width(), rendered.image.height());
            let image = smaller(noisy.image, side)?;
            let coverage = match noisy.coverage {
                Some(coverage) => Some(smaller(coverage, side)?),
                None => None,
            };
            let bounds = PixelBounds::whole(image.width(), image.height());
            let guides = &guides.smaller(rendered.bounds, side);
            let small = Noisy { image: &image, coverage: coverage.as_ref(), guides, bounds, block: BLOCK };
            let Denoised { image, coverage } = small.denoised(&workers, cancel)?;
            let coverage = match coverage {
                Some(coverage) => Some(larger(&coverage, size, side)?),
                None => None,
            };
            Some(Denoised { image: larger(&image, size, side)?, coverage })
        }
    }
}

/// The input of the filter.
struct Noisy<'a> {
    image: &'a Image,
    coverage: Option<&'a Image>,
    guides: &'a Guides,
    bounds: PixelBounds,
    /// Columns and rows of its blocks; they do not affect the result.
    block: (usize, usize),
}

/// Rows of the denoised picture, to be filled in.
struct Band<'a> {
    y0: u32,
    pixels: &'a mut [Rgb],
    /// Empty if coverage is not filtered.
    coverage: &'a mut [Rgb],
}

impl Noisy<'_> {
    fn denoised(&self, workers: &Workers, cancel: &CancelToken) -> Option<Denoised> {
        let count = self.bounds.area() as usize;
        let width = self.bounds.width() as usize;
        let catches_shadows = self.image.alpha().is_some()
            && self.guides.iter().any(|guide| guide.shadow != RatioSums::default());
        let is_single = self.guides.iter().all(|guide| guide.count.samples < 2);
        let mut pixels = vec![Rgb::BLACK; count];
        let mut coverage = vec![Rgb::BLACK; if catches_shadows { count } else { 0 }];
        {
            let mut covered = coverage.chunks_mut((width * self.block.1).max(1));
            let rows = pixels.chunks_mut((width * self.block.1).max(1)).enumerate();
            let mut bands: Vec<Band<'_>> = rows
                .map(|(i, pixels)| Band {
                    y0: self.bounds.y0 + (i * self.block.1) as u32,
                    pixels,
                    coverage: covered.next().unwrap_or_default(),
                })
                .collect();
            workers.for_each(&mut bands, |band| self.fill(band, is_single, cancel));
        }
        if cancel.is_cancelled() {
            return None;
        }
        let (width, height) = (self.image.width(), self.image.height());
        let image = Image::from_pixels(width, height, pixels)?;
        let Some(alpha) = self.image.alpha() else { return Some(Denoised { image, coverage: None }) };
        if !catches_shadows {
            let image = image.with_alpha(alpha.to_vec())?;
            return Some(Denoised { image, coverage: self.coverage.cloned() });
        }
        let image = image.with_alpha(coverage.iter().map(|c| c.average()).collect())?;
        let coverage = match self.coverage {
            Some(_) => Some(Image::from_pixels(width, height, coverage)?),
            None => None,
        };
        Some(Denoised { image, coverage })
    }

    /// Filters a band, block by block.
    fn fill(&self, band: &mut Band<'_>, is_single: bool, cancel: &CancelToken) {
        let width = self.bounds.width() as usize;
        let y1 = band.y0 + (band.pixels.len() / width) as u32;
        for x0 in (self.bounds.x0..self.bounds.x1).step_by(self.block.0) {
            if cancel.is_cancelled() {
                return;
            }
            let x1 = x0.saturating_add(self.block.0 as u32).min(self.bounds.x1);
            let block = PixelBounds { x0, y0: band.y0, x1, y1 };
            let border = BORDER as u32;
            let around = PixelBounds {
                x0: x0.saturating_sub(border),
                y0: band.y0.saturating_sub(border),
                x1: x1.saturating_add(border),
                y1: y1.saturating_add(border),
            };
            self.fill_block(band, block, around.intersection(&self.bounds), is_single, cancel);
        }
    }

    /// Filters a block with its surroundings.
    fn fill_block(
        &self,
        band: &mut Band<'_>,
        block: PixelBounds,
        around: PixelBounds,
        is_single: bool,
        cancel: &CancelToken,
    ) {
        let guides = self.guides.within(around);
        let size = (around.width() as usize, around.height() as usize);
        let columns = (block.x0 - around.x0) as usize..(block.x1 - around.x0) as usize;
        let rows = (block.y0 - around.y0) as usize..(block.y1 - around.y0) as usize;
        let surfaces = planes::surfaces(&guides, size);
        // The guide of a pixel of the block, and its place in the band.
        let places = || {
            block.pixels().map(|(x, y)| {
                let place =
                    (y - band.y0) as usize * self.bounds.width() as usize + (x - self.bounds.x0) as usize;
                (&guides[around.position(x, y)], place)
            })
        };

        // Pixels that show only the background of a transparent picture take no part.
        let is_everywhere = self.image.alpha().is_none();
        let kind = Kind { least: MIN_REFLECTANCE, is_everywhere, is_single };
        let layer = planes::layer(&guides, size, |guide| &guide.light, kind);
        let light = means::filter(&layer, &surfaces, columns.clone(), rows.clone(), cancel);
        for (i, (guide, place)) in places().enumerate() {
            let colour = |c: usize| light[c][i] * share(guide.count, &guide.light, c, MIN_REFLECTANCE);
            band.pixels[place] = Rgb::new(colour(0), colour(1), colour(2));
        }
        if band.coverage.is_empty() {
            return;
        }

        let kind = Kind { least: MIN_GROUND, is_everywhere: false, is_single };
        let layer = planes::layer(&guides, size, |guide| &guide.shadow, kind);
        let shadow = means::filter(&layer, &surfaces, columns, rows, cancel);
        let first = (band.y0 - self.bounds.y0) as usize * self.bounds.width() as usize;
        for (i, (guide, place)) in places().enumerate() {
            let at = first + place;
            let before = match (self.coverage, self.image.alpha()) {
                (Some(coverage), _) => coverage.pixels()[at],
                (None, alpha) => Rgb::splat(alpha.map_or(1.0, |alpha| alpha[at])),
            };
            // The part that is not on the shadow catcher keeps its coverage.
            let channel = |c: usize, before: f32| {
                let ground = share(guide.count, &guide.shadow, c, MIN_GROUND);
                // The noisy shadow was clamped in the picture, and is not here: where it is negative, light is focused.
                let rest = before - guide.shadow.value(c, guide.count, MIN_GROUND) * ground;
                let rest = rest.clamp(0.0, (1.0 - ground).max(0.0));
                let now = if guide.count.samples > 0 { rest + shadow[c][i] * ground } else { before };
                now.clamp(0.0, 1.0)
            };
            band.coverage[place] = Rgb::new(channel(0, before.r), channel(1, before.g), channel(2, before.b));
        }
    }
}

/// The denominator of a pixel's ratio, at least `least`; 0 if the pixel takes no part.
fn share<const UNDER: usize>(count: Count, sums: &RatioSums<UNDER>, c: usize, least: f32) -> f32 {
    let has_part = count.weight > 0.0 && !sums.is_absent(c);
    if has_part { sums.denominator(c, count).max(least) } else { 0.0 }
}

/// The first pixel of each square of `side` by `side` pixels.
fn smaller(image: &Image, side: u32) -> Option<Image> {
    let (width, height) = (image.width().div_ceil(side), image.height().div_ceil(side));
    let places = || PixelBounds::whole(width, height).pixels().map(|(x, y)| (x * side, y * side));
    let pixels = places().map(|(x, y)| image.pixel(x, y)).collect();
    let small = Image::from_pixels(width, height, pixels)?;
    let Some(alpha) = image.alpha() else { return Some(small) };
    let at = |(x, y): (u32, u32)| alpha[y as usize * image.width() as usize + x as usize];
    small.with_alpha(places().map(at).collect())
}

/// An image interpolated from one pixel per square of `side` by `side` pixels.
fn larger(small: &Image, (width, height): (u32, u32), side: u32) -> Option<Image> {
    // Two neighbours and the share of the second.
    let along = |x: u32, count: u32| {
        let first = x / side;
        (first, (first + 1).min(count - 1), (x % side) as f32 / side as f32)
    };
    let columns: Vec<_> = (0..width).map(|x| along(x, small.width())).collect();
    let mix = |a: Rgb, b: Rgb, share: f32| a * (1.0 - share) + b * share;
    let enlarged = |value: &dyn Fn(u32, u32) -> Rgb| -> Vec<Rgb> {
        let rows = (0..height).map(|y| along(y, small.height()));
        rows.flat_map(|(above, below, down)| {
            columns.iter().map(move |&(left, right, across)| {
                let upper = mix(value(left, above), value(right, above), across);
                mix(upper, mix(value(left, below), value(right, below), across), down)
            })
        })
        .collect()
    };
    let image = Image::from_pixels(width, height, enlarged(&|x, y| small.pixel(x, y)))?;
    let Some(alpha) = small.alpha() else { return Some(image) };
    let at = |x: u32, y: u32| Rgb::splat(alpha[y as usize * small.width() as usize + x as usize]);
    image.with_alpha(enlarged(&at).iter().map(|c| c.r).collect())
}
