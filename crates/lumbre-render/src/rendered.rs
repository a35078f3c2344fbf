//! A picture, and what it took.

use std::time::Duration;

use lumbre_film::{FeatureSums, Pixel, PixelBounds, Tile};
use lumbre_image::{Image, Rgb};
use lumbre_transport::{Feature, RayCounts};

/// What [`crate::render`] returns: all that was asked for, or what there was when it was stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// The pixels of [`Rendered::bounds`]; black where no sample was taken. With coverage, by which its colours are
    /// multiplied, if the options ask for a transparent picture.
    pub image: Image,
    /// Which pixels of the whole picture.
    pub bounds: PixelBounds,
    /// Feature images, if they were asked for: albedo, normal (with signs), depth, uv (in red and green).
    pub features: Vec<(Feature, Image)>,
    /// What it took.
    pub stats: Stats,
}

/// What a render took.
#[derive(Clone, Debug, PartialEq)]
pub struct Stats {
    /// Samples that every pixel has.
    pub spp: u32,
    /// Whether someone asked it to stop before it had all samples.
    pub cancelled: bool,
    /// Paths, over all pixels.
    pub samples: u64,
    /// Rays.
    pub rays: RayCounts,
    /// Samples that were not finite, and are not in the picture.
    pub dropped: u64,
    /// The first of them.
    pub first_dropped: Vec<DroppedSample>,
    /// The noise, as [`crate::Stop::noise`] defines it; `None` for fewer than two samples a pixel.
    pub noise: Option<f64>,
    /// Threads.
    pub threads: usize,
    /// Time.
    pub elapsed: Duration,
}

impl Stats {
    /// Paths in a second.
    pub fn paths_per_second(&self) -> f64 {
        let seconds = self.elapsed.as_secs_f64();
        if seconds > 0.0 { self.samples as f64 / seconds } else { 0.0 }
    }
}

/// A sample that was not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DroppedSample {
    /// Column of the pixel in the whole picture.
    pub x: u32,
    /// Row of the pixel.
    pub y: u32,
    /// Index of the sample.
    pub sample: u32,
}

/// The picture of some tiles, with coverage if it is to be transparent.
pub(crate) fn picture<'t>(
    tiles: impl Iterator<Item = &'t Tile> + Clone,
    bounds: PixelBounds,
    transparent: bool,
) -> Image {
    let image = put_together(tiles.clone(), bounds, Tile::pixels, Pixel::colour);
    if !transparent {
        return image;
    }
    let alpha = put_together(tiles, bounds, Tile::pixels, |pixel: &Pixel| Rgb::splat(pixel.coverage()));
    image.clone().with_alpha(alpha.channel(0).collect()).unwrap_or(image)
}

/// The picture of a feature.
pub(crate) fn feature_picture<'t>(
    tiles: impl Iterator<Item = &'t Tile>,
    bounds: PixelBounds,
    feature: Feature,
) -> Image {
    put_together(tiles, bounds, Tile::features, |sums: &FeatureSums| match feature {
        Feature::Albedo => sums.albedo(),
        Feature::Normal => sums.normal(),
        Feature::Depth => Rgb::splat(sums.depth()),
        Feature::Uv => {
            let [u, v] = sums.uv();
            Rgb::new(u, v, 0.0)
        }
    })
}

fn put_together<'t, T: 't>(
    tiles: impl Iterator<Item = &'t Tile>,
    bounds: PixelBounds,
    values: impl Fn(&'t Tile) -> &'t [T],
    colour: impl Fn(&T) -> Rgb,
) -> Image {
    let mut image = Image::filled(bounds.width(), bounds.height(), Rgb::BLACK);
    let width = bounds.width() as usize;
    for tile in tiles {
        let own = tile.bounds();
        for ((x, y), value) in own.pixels().zip(values(tile)) {
            let position = (y - bounds.y0) as usize * width + (x - bounds.x0) as usize;
            image.pixels_mut()[position] = colour(value);
        }
    }
    image
}

/// The noise of some tiles, as [`crate::Stop::noise`] defines it.
pub(crate) fn noise<'t>(tiles: impl Iterator<Item = &'t Tile> + Clone) -> Option<f64> {
    let errors = || tiles.clone().flat_map(Tile::pixels).filter_map(Pixel::luminance_with_error);
    let count = errors().count();
    if count == 0 {
        return None;
    }
    let mean = errors().map(|(mean, _)| mean).sum::<f64>() / count as f64;
    if mean <= 0.0 {
        return Some(0.0);
    }
    let square = |(luminance, error): (f64, f64)| (error / (luminance.max(0.0) + 0.1 * mean)).powi(2);
    Some((errors().map(square).sum::<f64>() / count as f64).sqrt())
}
