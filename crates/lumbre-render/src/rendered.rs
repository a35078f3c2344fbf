//! A picture, and what it took.

use std::time::Duration;

use crate::film::{Extras, FeatureSums, Guides, MAX_SAMPLE, Pixel, PixelBounds, Tile};
use crate::transport::{Feature, RayCounts};
use lumbre_image::{Image, Rgb};

/// What [`crate::render`] returns: all that was asked for, or what there was when it was stopped.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Rendered {
    /// The pixels of [`Rendered::bounds`]; black where no sample was taken (see [`Stats::stride`]). With coverage, by which its colours are
    /// multiplied, if the options ask for a transparent picture.
    pub image: Image,
    /// Coverage by colour, of which that of the image is the mean: where a transparent picture has coloured shadows on its
    /// ground. `None` where it is that of all colours alike.
    pub coverage: Option<Image>,
    /// Which pixels of the whole picture.
    pub bounds: PixelBounds,
    /// Feature images, if they were asked for: albedo, normal (with signs), depth, uv (in red and green).
    pub features: Vec<(Feature, Image)>,
    /// What the denoiser needs of every pixel, if it was asked for.
    pub guides: Option<Guides>,
    /// What it took.
    pub stats: Stats,
}

/// What a render took.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Stats {
    /// Samples that every pixel has.
    pub spp: u32,
    /// Samples of the pixel with the most: more than the others have where the noise of each pixel ends its sampling.
    pub most_spp: u32,
    /// The side of squares of pixels of which each has a sample, which all pixels of the square show that have none of their own: 1
    /// where every pixel has a sample. `None` where there is no whole picture, not even such a coarse one.
    pub stride: Option<u32>,
    /// Whether someone asked it to stop before it had all samples.
    pub cancelled: bool,
    /// Paths, over all pixels.
    pub samples: u64,
    /// Rays.
    pub rays: RayCounts,
    /// Samples that were not finite, and are not in the picture.
    pub dropped: u64,
    /// Samples that were brighter than [`Stats::MAX_SAMPLE`], and are in the picture as bright as that.
    pub clamped: u64,
    /// The first of those that were dropped.
    pub first_dropped: Vec<DroppedSample>,
    /// The noise, as [`crate::Stop::noise`] defines it; `None` for fewer than two samples a pixel.
    pub noise: Option<f64>,
    /// The noise that was asked for.
    pub noise_target: Option<f64>,
    /// Pixels whose sampling was to end at that noise, and ended before.
    pub noisy_pixels: u64,
    /// Threads.
    pub threads: usize,
    /// More threads that were asked for, and that the system refused.
    pub refused_threads: usize,
    /// Time.
    pub elapsed: Duration,
}

impl Rendered {
    /// A picture that was rendered before, without guides and statistics.
    pub fn restored(
        image: Image,
        coverage: Option<Image>,
        bounds: PixelBounds,
        features: Vec<(Feature, Image)>,
    ) -> Self {
        Self { image, coverage, bounds, features, guides: None, stats: Stats::default() }
    }
}

impl Stats {
    /// The most that a sample counts for: see [`Stats::clamped`].
    pub const MAX_SAMPLE: f64 = MAX_SAMPLE;

    /// Whether a noise was asked for, and that of the picture is above it, or not known.
    pub fn misses_noise_target(&self) -> bool {
        self.noise_target.is_some_and(|target| self.noise.is_none_or(|noise| noise > target))
    }

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

/// The pictures of some tiles, with statistics that say nothing yet.
pub(crate) fn rendered_of<'t>(
    tiles: impl Iterator<Item = &'t Tile> + Clone,
    bounds: PixelBounds,
    transparent: bool,
    extras: Extras,
) -> Rendered {
    let wanted: &[Feature] =
        if extras.features { &[Feature::Albedo, Feature::Normal, Feature::Depth, Feature::Uv] } else { &[] };
    Rendered {
        image: picture(tiles.clone(), bounds, transparent),
        coverage: coverage_picture(tiles.clone(), bounds),
        bounds,
        features: wanted.iter().map(|&f| (f, feature_picture(tiles.clone(), bounds, f))).collect(),
        guides: extras.guides.then(|| Guides::new(tiles)),
        stats: Stats::default(),
    }
}

/// The picture of some tiles, with coverage if it is to be transparent.
pub(crate) fn picture<'t>(
    tiles: impl Iterator<Item = &'t Tile> + Clone,
    bounds: PixelBounds,
    transparent: bool,
) -> Image {
    let pixels = |tile: &'t Tile| tile.pixels().iter();
    let colours = put_together(tiles.clone(), bounds, Rgb::BLACK, |tile| pixels(tile).map(Pixel::colour));
    let image = image_of(bounds, colours);
    if !transparent {
        return image;
    }
    let alpha = put_together(tiles, bounds, 0.0, |tile| pixels(tile).map(Pixel::coverage));
    image.with_alpha(alpha).expect("a value for each pixel")
}

/// The coverage of some tiles by colour; `None` where it is that of all colours alike.
pub(crate) fn coverage_picture<'t>(
    tiles: impl Iterator<Item = &'t Tile> + Clone,
    bounds: PixelBounds,
) -> Option<Image> {
    let is_tinted = tiles.clone().any(Tile::is_tinted);
    is_tinted.then(|| image_of(bounds, put_together(tiles, bounds, Rgb::BLACK, Tile::coverages)))
}

/// The picture of a feature.
pub(crate) fn feature_picture<'t>(
    tiles: impl Iterator<Item = &'t Tile>,
    bounds: PixelBounds,
    feature: Feature,
) -> Image {
    let colour = |sums: &FeatureSums, depth_unit| match feature {
        Feature::Albedo => sums.albedo(),
        Feature::Normal => sums.normal(),
        Feature::Depth => Rgb::splat(sums.depth(depth_unit)),
        Feature::Uv => {
            let [u, v] = sums.uv();
            Rgb::new(u, v, 0.0)
        }
    };
    let colours = |tile: &'t Tile| tile.features().iter().map(move |sums| colour(sums, tile.depth_unit()));
    image_of(bounds, put_together(tiles, bounds, Rgb::BLACK, colours))
}

/// The variance of the luminance of every pixel, as it is estimated from its samples: that of their mean. 0 for fewer than two.
pub(crate) fn variance_picture<'t>(tiles: impl Iterator<Item = &'t Tile>, bounds: PixelBounds) -> Image {
    let variance = |pixel: &Pixel| pixel.luminance_with_error().map_or(0.0, |(_, error)| error * error);
    let variances =
        |tile: &'t Tile| tile.pixels().iter().map(move |pixel| Rgb::splat(variance(pixel) as f32));
    image_of(bounds, put_together(tiles, bounds, Rgb::BLACK, variances))
}

/// The values of all pixels, row by row, from those of tiles; `none` where there is no tile.
pub(crate) fn put_together<'t, T: Copy, I: Iterator<Item = T>>(
    tiles: impl Iterator<Item = &'t Tile>,
    bounds: PixelBounds,
    none: T,
    values: impl Fn(&'t Tile) -> I,
) -> Vec<T> {
    let width = bounds.width() as usize;
    let mut all = vec![none; bounds.area() as usize];
    for tile in tiles {
        for ((x, y), value) in tile.bounds().pixels().zip(values(tile)) {
            all[(y - bounds.y0) as usize * width + (x - bounds.x0) as usize] = value;
        }
    }
    all
}

fn image_of(bounds: PixelBounds, pixels: Vec<Rgb>) -> Image {
    Image::from_pixels(bounds.width(), bounds.height(), pixels).expect("a value for each pixel")
}
