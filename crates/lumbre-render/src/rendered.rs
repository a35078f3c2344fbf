//! A rendered picture, with statistics.

use std::time::Duration;

use lumbre_image::{Image, Layer, Rgb};

use crate::film::{
    ATTRIBUTES, Extras, FeatureSums, Guides, MAX_SAMPLE, Pixel, PixelBounds, SurfaceSums, Tile, channel_name,
};
use crate::transport::{Feature, RayCounts};

/// The result of [`crate::render`]: complete, or as far as it was when it was stopped.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Rendered {
    /// The pixels of [`Rendered::bounds`]; black where no sample was taken (see [`Stats::stride`]). Transparent
    /// pictures have alpha, premultiplied.
    pub image: Image,
    /// Coverage by channel, if a transparent picture has coloured shadows on its ground; the image has its mean. `None`
    /// if it is the same for all channels.
    pub coverage: Option<Image>,
    /// The pixels of the whole picture that were rendered.
    pub bounds: PixelBounds,
    /// Feature images, if requested: albedo, normal (with signs), depth, uv (in red and green).
    pub features: Vec<(Feature, Image)>,
    /// The denoiser's guides of every pixel, if requested.
    pub guides: Option<Guides>,
    /// Further layers of the film.
    pub film: FilmLayers,
    /// Statistics.
    pub stats: Stats,
}

/// The layers of a film besides colours, as in an EXR file; empty for a film `rgb`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FilmLayers {
    /// Channels by the names that pbrt-v4 gives them.
    pub layers: Vec<Layer>,
    /// Attributes of the file, by name.
    pub attributes: Vec<(String, String)>,
}

/// Statistics of a render.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Stats {
    /// Samples that every pixel has.
    pub spp: u32,
    /// The most samples of any pixel: more than [`Self::spp`] in a render to a noise target.
    pub most_spp: u32,
    /// The side of squares of pixels that have at least one sample each: 1 if every pixel has a sample. Pixels without
    /// a sample show that of their square. `None` if there is not even such a coarse picture.
    pub stride: Option<u32>,
    /// Whether it was cancelled before it had all samples.
    pub cancelled: bool,
    /// Paths, over all pixels.
    pub samples: u64,
    /// Rays.
    pub rays: RayCounts,
    /// Samples that were not finite and were dropped.
    pub dropped: u64,
    /// Samples that were brighter than [`Stats::MAX_SAMPLE`] and were clamped to it.
    pub clamped: u64,
    /// The first dropped samples.
    pub first_dropped: Vec<DroppedSample>,
    /// The noise, as [`crate::Stop::noise`] defines it; `None` for fewer than two samples a pixel.
    pub noise: Option<f64>,
    /// The requested noise.
    pub noise_target: Option<f64>,
    /// Pixels that did not reach the requested noise.
    pub noisy_pixels: u64,
    /// Threads.
    pub threads: usize,
    /// Requested threads that the system refused.
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
        let film = FilmLayers::default();
        Self { image, coverage, bounds, features, guides: None, film, stats: Stats::default() }
    }
}

impl Stats {
    /// The largest value of a sample: see [`Stats::clamped`].
    pub const MAX_SAMPLE: f64 = MAX_SAMPLE;

    /// Whether the noise is above the requested one, or unknown; false without a request.
    pub fn misses_noise_target(&self) -> bool {
        self.noise_target.is_some_and(|target| self.noise.is_none_or(|noise| noise > target))
    }

    /// Paths per second.
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

/// The pictures of some tiles, without statistics.
pub(crate) fn rendered_of<'t>(
    tiles: impl Iterator<Item = &'t Tile> + Clone,
    bounds: PixelBounds,
    transparent: bool,
    extras: Extras,
) -> Rendered {
    let wanted: &[Feature] = if extras.features { &Feature::ALL } else { &[] };
    Rendered {
        image: picture(tiles.clone(), bounds, transparent),
        coverage: coverage_picture(tiles.clone(), bounds),
        bounds,
        features: wanted.iter().map(|&f| (f, feature_picture(tiles.clone(), bounds, f))).collect(),
        film: film_layers(tiles.clone(), bounds, extras),
        guides: extras.guides.then(|| Guides::new(tiles)),
        stats: Stats::default(),
    }
}

/// The picture of some tiles, with alpha if it is transparent.
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

/// The coverage of some tiles by channel; `None` if it is the same for all channels.
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

/// The further layers of a film.
fn film_layers<'t>(
    tiles: impl Iterator<Item = &'t Tile> + Clone,
    bounds: PixelBounds,
    extras: Extras,
) -> FilmLayers {
    let mut layers: Vec<Layer> = Vec::new();
    let mut attributes = Vec::new();
    if extras.surfaces {
        layers.extend(SurfaceSums::CHANNELS.map(|name| {
            let samples = vec![0.0; bounds.area() as usize];
            Layer { name: name.to_owned(), samples, full_precision: true }
        }));
        for tile in tiles.clone() {
            let pixels = tile.bounds().pixels().zip(tile.surfaces()).zip(tile.pixels());
            for (((x, y), sums), pixel) in pixels {
                let at = bounds.position(x, y);
                let values = sums.channels(pixel.samples, tile.depth_unit());
                layers.iter_mut().zip(values).for_each(|(layer, value)| layer.samples[at] = value);
            }
        }
    }
    if let Some(buckets) = extras.buckets {
        layers.extend((0..buckets.count as usize).map(|bucket| {
            let values = |tile: &'t Tile| tile.buckets().map(move |sums| sums[bucket].mean());
            let samples = put_together(tiles.clone(), bounds, 0.0, values);
            Layer { name: channel_name(&buckets, bucket), samples, full_precision: false }
        }));
        attributes.extend(ATTRIBUTES.map(|(name, value)| (name.to_owned(), value.to_owned())));
    }
    FilmLayers { layers, attributes }
}

/// The variance of the mean luminance of every pixel, estimated from its samples; 0 for fewer than two.
pub(crate) fn variance_picture<'t>(tiles: impl Iterator<Item = &'t Tile>, bounds: PixelBounds) -> Image {
    let variance = |pixel: &Pixel| pixel.luminance_with_error().map_or(0.0, |(_, error)| error * error);
    let variances =
        |tile: &'t Tile| tile.pixels().iter().map(move |pixel| Rgb::splat(variance(pixel) as f32));
    image_of(bounds, put_together(tiles, bounds, Rgb::BLACK, variances))
}

/// The values of all pixels, row by row, from those of tiles; `none` for pixels outside all tiles.
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
