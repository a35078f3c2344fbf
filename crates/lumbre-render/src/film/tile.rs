//! A part of the film that one thread owns at a time.

use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_scene::Buckets;

use crate::film::pixel::{MAX_SAMPLE, Sums};
use crate::film::sparse::Sparse;
use crate::film::{
    BucketSums, Count, FeatureSample, FeatureSums, GuideSums, GuideSurfaceSums, Pixel, PixelBounds,
    RatioSums, SpectralSample, SurfaceSample, SurfaceSums, Tint,
};

/// How radiance becomes the colour of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// A factor on every sample.
    pub factor: f32,
    /// The largest component that a sample may have; a brighter one keeps its hue. Infinite to leave all as they are.
    pub max_component: f32,
    /// What a sensor makes of colours: the rows of a matrix to the red, green and blue of the picture. The identity
    /// leaves all as they are.
    pub sensor: [[f32; 3]; 3],
}

impl Default for Exposure {
    fn default() -> Self {
        let sensor = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Self { factor: 1.0, max_component: f32::INFINITY, sensor }
    }
}

impl Exposure {
    /// The factor that dims a sample which is brighter than any may be.
    fn hold(&self, radiance: Rgb) -> f32 {
        let most = (radiance * self.factor).max_component();
        if most > self.max_component { self.max_component / most } else { 1.0 }
    }

    /// The colour that a sample of this radiance adds.
    pub fn colour(&self, radiance: Rgb) -> Rgb {
        let held = radiance * self.factor * self.hold(radiance);
        let [red, green, blue] = self.sensor.map(|[r, g, b]| r * held.r + g * held.g + b * held.b);
        Rgb::new(red, green, blue)
    }
}

/// What became of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Addition {
    /// It was added.
    Whole,
    /// It was added less bright than it is: brighter ones do not fit.
    Clamped,
    /// It was not: it is not finite, or its pixel is elsewhere.
    Dropped,
}

/// What one sample adds to its pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Radiance.
    pub radiance: Rgb,
    /// How much of what is behind it covers, of each colour; the radiance is multiplied by it.
    pub coverage: Rgb,
    /// The filter weight.
    pub weight: f64,
    /// The first hit, if features are requested and there is one.
    pub features: Option<FeatureSample>,
    /// The surface that it sees, if the film keeps that and it sees any.
    pub surface: Option<SurfaceSample>,
    /// Its radiance at its wavelengths, if the film keeps that.
    pub spectrum: Option<SpectralSample>,
    /// Whether it is of a shadow catcher.
    pub on_catcher: bool,
}

impl Default for Sample {
    /// Black, of all that is behind it, of weight 1.
    fn default() -> Self {
        Self {
            radiance: Rgb::BLACK,
            coverage: Rgb::WHITE,
            weight: 1.0,
            features: None,
            surface: None,
            spectrum: None,
            on_catcher: false,
        }
    }
}

/// The pixels of a rectangle. A clone shares its sums with the original until one of them gets another sample, so that
/// it is cheap.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    bounds: PixelBounds,
    sums: Arc<TileSums>,
    buckets: Option<Buckets>,
    depth_unit: f64,
}

/// The sums of a tile.
#[derive(Clone, Debug, PartialEq)]
struct TileSums {
    pixels: Vec<Pixel>,
    // Empty unless features are wanted; else one per pixel.
    features: Vec<FeatureSums>,
    // None unless coverage is wanted by colour; else one per pixel.
    tints: Sparse<Tint>,
    guides: TileGuides,
    // Empty unless the film keeps surfaces; else one per pixel.
    surfaces: Vec<SurfaceSums>,
    // Empty unless the film keeps wavelengths; else those of each pixel, one pixel after the other.
    buckets: Vec<BucketSums>,
}

/// The [`GuideSums`] of a tile; none unless they are wanted. Most tiles are of light alone, or of ground alone.
#[derive(Clone, Debug, PartialEq)]
struct TileGuides {
    light: Sparse<RatioSums<3>>,
    shadow: Sparse<RatioSums<1>>,
    // One per pixel, or none.
    surfaces: Vec<(GuideSurfaceSums, Count)>,
}

impl TileGuides {
    fn new(count: usize) -> Self {
        Self {
            light: Sparse::new(count),
            shadow: Sparse::new(count),
            surfaces: vec![Default::default(); count],
        }
    }

    fn get(&self, at: usize) -> GuideSums {
        let (surfaces, count) = self.surfaces[at];
        GuideSums { light: self.light.get(at), shadow: self.shadow.get(at), surfaces, count }
    }

    /// Sets those of a pixel, if they are wanted.
    fn set(&mut self, at: usize, sums: GuideSums) {
        if let Some(own) = self.surfaces.get_mut(at) {
            *own = (sums.surfaces, sums.count);
            self.light.set(at, sums.light);
            self.shadow.set(at, sums.shadow);
        }
    }
}

/// What to record of samples in addition to colour and coverage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extras {
    /// The first hits of the samples.
    pub features: bool,
    /// Per-channel coverage minus that of green.
    pub tints: bool,
    /// What the denoiser needs.
    pub guides: bool,
    /// What the film `gbuffer` keeps.
    pub surfaces: bool,
    /// The buckets of the film `spectral`.
    pub buckets: Option<Buckets>,
    /// The unit of depths: a power of two above all of them.
    pub depth_unit: f64,
}

impl Default for Extras {
    fn default() -> Self {
        Self { features: false, tints: false, guides: false, surfaces: false, buckets: None, depth_unit: 1.0 }
    }
}

impl Extras {
    /// Buckets of a pixel.
    pub(crate) fn bucket_count(&self) -> usize {
        self.buckets.map_or(0, |buckets| buckets.count as usize)
    }
}

impl Tile {
    /// No samples yet.
    pub fn new(bounds: PixelBounds, extras: Extras) -> Self {
        let count = bounds.area() as usize;
        let sums = TileSums {
            pixels: vec![Pixel::default(); count],
            features: vec![FeatureSums::default(); if extras.features { count } else { 0 }],
            tints: Sparse::new(if extras.tints { count } else { 0 }),
            guides: TileGuides::new(if extras.guides { count } else { 0 }),
            surfaces: vec![SurfaceSums::default(); if extras.surfaces { count } else { 0 }],
            buckets: vec![BucketSums::default(); count * extras.bucket_count()],
        };
        Self { bounds, sums: Arc::new(sums), buckets: extras.buckets, depth_unit: extras.depth_unit }
    }

    /// Which pixels.
    pub fn bounds(&self) -> PixelBounds {
        self.bounds
    }

    /// The sums of every pixel, row by row.
    pub fn pixels(&self) -> &[Pixel] {
        &self.sums.pixels
    }

    /// What depths are measured in.
    pub fn depth_unit(&self) -> f64 {
        self.depth_unit
    }

    /// The features of every pixel, row by row; empty where they are not wanted.
    pub fn features(&self) -> &[FeatureSums] {
        &self.sums.features
    }

    /// What the denoiser needs of every pixel, row by row; empty unless it was asked for.
    pub fn guides(&self) -> impl Iterator<Item = GuideSums> + '_ {
        (0..self.sums.guides.surfaces.len()).map(|at| self.sums.guides.get(at))
    }

    /// What the film `gbuffer` keeps of every pixel, row by row; empty where it is not wanted.
    pub fn surfaces(&self) -> &[SurfaceSums] {
        &self.sums.surfaces
    }

    /// The buckets of every pixel, row by row; none where they are not wanted.
    pub fn buckets(&self) -> impl Iterator<Item = &[BucketSums]> {
        self.sums.buckets.chunks(self.extras().bucket_count().max(1))
    }

    /// The denoiser's guides of the pixel in column `x` and row `y` of the picture.
    ///
    /// # Panics
    /// Where that is not in the tile, and where it was not asked for.
    pub fn guide(&self, x: u32, y: u32) -> GuideSums {
        self.sums.guides.get(self.bounds.position(x, y))
    }

    /// Per-channel coverage minus that of green, row by row; empty unless requested.
    pub fn tints(&self) -> impl Iterator<Item = Tint> + '_ {
        self.sums.tints.iter()
    }

    /// The coverage of every pixel by colour, row by row; where that is not wanted, of all colours alike.
    pub fn coverages(&self) -> impl Iterator<Item = Rgb> + '_ {
        let pixels = self.sums.pixels.iter().enumerate();
        pixels.map(|(at, pixel)| self.sums.tints.get(at).coverage(pixel))
    }

    /// Whether the coverage of any pixel is not that of all colours alike.
    pub fn is_tinted(&self) -> bool {
        self.sums.tints.is_used()
    }

    /// Adds a sample to the pixel in column `x` and row `y` of the picture.
    pub fn add(&mut self, x: u32, y: u32, sample: &Sample, exposure: &Exposure) -> Addition {
        let b = &self.bounds;
        if !(b.x0 <= x && x < b.x1 && b.y0 <= y && y < b.y1) {
            return Addition::Dropped;
        }
        let colour = exposure.colour(sample.radiance);
        let position = b.position(x, y);
        let sums = Arc::make_mut(&mut self.sums);
        let pixel = &mut sums.pixels[position];
        pixel.taken += 1;
        if !sample.coverage.is_finite() || !pixel.add(colour, sample.coverage.average(), sample.weight) {
            return Addition::Dropped;
        }
        let catches_shadows = sums.tints.len() > 0;
        let Rgb { r, g, b } = sample.coverage;
        if catches_shadows && (r != g || b != g) {
            sums.tints.get_mut(position).add(sample.coverage, sample.weight);
        }
        if let Some(features) = sums.features.get_mut(position) {
            features.add(sample.features.as_ref(), sample.weight, self.depth_unit);
        }
        if let Some(surfaces) = sums.surfaces.get_mut(position) {
            surfaces.add(colour, sample.surface.as_ref(), sample.weight, self.depth_unit);
        }
        if let (Some(buckets), Some(spectrum)) = (&self.buckets, &sample.spectrum) {
            let factor = exposure.factor * exposure.hold(sample.radiance);
            let own = of_pixel(&mut sums.buckets, position, buckets.count as usize);
            BucketSums::add(own, buckets, spectrum, sample.weight, factor);
        }
        let TileGuides { light, shadow, surfaces } = &mut sums.guides;
        if let Some((surfaces, count)) = surfaces.get_mut(position) {
            let is_shadow = sample.on_catcher && catches_shadows;
            let reflectance = match &sample.features {
                _ if is_shadow => Rgb::BLACK,
                Some(features) if !sample.on_catcher => features.albedo,
                // Light from far away stands for itself.
                _ => sample.coverage,
            };
            let weighted = |colour: Rgb| (colour * sample.weight as f32).to_array();
            let is_odd = count.samples % 2 == 1;
            let (over, under) = (weighted(colour), weighted(reflectance));
            // Zeros change no sum.
            if over != [0.0; 3] || under != [0.0; 3] {
                light.get_mut(position).add(over, under, is_odd);
            }
            if is_shadow {
                let ground = [sample.weight as f32];
                shadow.get_mut(position).add(weighted(sample.coverage), ground, is_odd);
            }
            count.add(sample.weight as f32);
            surfaces.add(sample.features.as_ref());
        }
        let is_clamped = f64::from(colour.max_component()) > MAX_SAMPLE;
        if is_clamped { Addition::Clamped } else { Addition::Whole }
    }

    /// The part of it in these bounds, and nothing where it has none.
    pub(crate) fn placed_in(&self, bounds: PixelBounds) -> Self {
        let mut placed = Self::new(bounds, self.extras());
        placed.take(self);
        placed
    }

    /// Adds what another tile of the same kind gathered, all of whose pixels this one has.
    pub(crate) fn merge(&mut self, other: &Self) {
        fn add<T: Sums>(to: &mut [T], at: usize, other: &[T], from: usize) {
            if let (Some(to), Some(other)) = (to.get_mut(at), other.get(from)) {
                to.merge(other);
            }
        }
        let each = self.extras().bucket_count();
        let (sums, others) = (Arc::make_mut(&mut self.sums), &other.sums);
        for (from, (x, y)) in other.bounds.pixels().enumerate() {
            let at = self.bounds.position(x, y);
            add(&mut sums.pixels, at, &others.pixels, from);
            add(&mut sums.features, at, &others.features, from);
            let theirs = others.tints.get(from);
            if theirs != Tint::default() {
                sums.tints.get_mut(at).merge(&theirs);
            }
            add(&mut sums.surfaces, at, &others.surfaces, from);
            (0..each).for_each(|b| add(&mut sums.buckets, at * each + b, &others.buckets, from * each + b));
        }
    }

    /// Takes the sums of those pixels of a tile of the same kind that this one has, too.
    pub(crate) fn take(&mut self, other: &Self) {
        let each = self.extras().bucket_count();
        let sums = Arc::make_mut(&mut self.sums);
        for (x, y) in self.bounds.intersection(&other.bounds).pixels() {
            sums.copy(self.bounds.position(x, y), &other.sums, other.bounds.position(x, y), each);
        }
    }

    /// The memory of a tile, at most.
    pub(crate) fn memory_bytes(bounds: PixelBounds, extras: Extras) -> u64 {
        let sizes = [
            (true, size_of::<Pixel>()),
            (extras.features, size_of::<FeatureSums>()),
            (extras.tints, size_of::<Tint>()),
            (extras.guides, size_of::<GuideSums>()),
            (extras.surfaces, size_of::<SurfaceSums>()),
            (true, extras.bucket_count() * size_of::<BucketSums>()),
        ];
        let each: usize = sizes.into_iter().filter(|(has, _)| *has).map(|(_, size)| size).sum();
        bounds.area().saturating_mul(each as u64)
    }

    /// The sums that every tile has, to be set.
    pub(crate) fn sums_mut(&mut self) -> TileSumsMut<'_> {
        let TileSums { pixels, features, surfaces, buckets, .. } = Arc::make_mut(&mut self.sums);
        TileSumsMut { pixels, features, surfaces, buckets }
    }

    /// Sets the tint of a pixel, by its position, where it is wanted.
    pub(crate) fn set_tint(&mut self, at: usize, tint: Tint) {
        Arc::make_mut(&mut self.sums).tints.set(at, tint);
    }

    /// Sets the guides of a pixel, by its position, where they are wanted.
    pub(crate) fn set_guide(&mut self, at: usize, guide: GuideSums) {
        Arc::make_mut(&mut self.sums).guides.set(at, guide);
    }

    /// What is gathered besides colours.
    pub fn extras(&self) -> Extras {
        Extras {
            features: !self.sums.features.is_empty(),
            tints: self.sums.tints.len() > 0,
            guides: !self.sums.guides.surfaces.is_empty(),
            surfaces: !self.sums.surfaces.is_empty(),
            buckets: self.buckets,
            depth_unit: self.depth_unit,
        }
    }

    /// The samples of the pixel with the fewest, including dropped ones.
    pub(crate) fn least_taken(&self) -> u32 {
        self.sums.pixels.iter().map(|pixel| pixel.taken).min().unwrap_or(0)
    }

    /// The sums of the pixel in column `x` and row `y` of the picture.
    ///
    /// # Panics
    /// Where that is not in the tile.
    pub fn pixel(&self, x: u32, y: u32) -> &Pixel {
        &self.sums.pixels[self.bounds.position(x, y)]
    }

    /// The first pixel as a tile of its own.
    pub fn corner(&self) -> Self {
        let bounds = PixelBounds { x1: self.bounds.x0 + 1, y1: self.bounds.y0 + 1, ..self.bounds };
        self.placed_in(bounds)
    }

    /// Gives the first pixel the sums of that of another tile of the same picture, unless it has a sample.
    pub fn take_corner(&mut self, other: &Self) {
        if self.sums.pixels.first().is_none_or(|pixel| pixel.samples > 0) {
            return;
        }
        let each = self.extras().bucket_count();
        if !other.sums.pixels.is_empty() {
            Arc::make_mut(&mut self.sums).copy(0, &other.sums, 0, each);
        }
    }

    /// Gives every pixel that has no sample the sums of the first pixel of its square of `side` by `side` pixels,
    /// counted from the tile's corner.
    pub fn spread(&mut self, side: u32) {
        let width = self.bounds.width() as usize;
        let side = side.max(1) as usize;
        let each = self.extras().bucket_count();
        // A tile that is whole is not copied.
        if self.sums.pixels.iter().all(|pixel| pixel.samples > 0) {
            return;
        }
        let sums = Arc::make_mut(&mut self.sums);
        for at in 0..sums.pixels.len() {
            if sums.pixels[at].samples == 0 {
                let (x, y) = (at % width, at / width);
                sums.copy_within((y - y % side) * width + (x - x % side), at, each);
            }
        }
    }
}

impl TileSums {
    /// Takes the sums of a pixel of another tile of the same kind.
    fn copy(&mut self, at: usize, other: &Self, from: usize, each: usize) {
        self.pixels[at] = other.pixels[from];
        if let (Some(features), Some(theirs)) = (self.features.get_mut(at), other.features.get(from)) {
            *features = *theirs;
        }
        self.tints.set(at, other.tints.get(from));
        if from < other.guides.surfaces.len() {
            self.guides.set(at, other.guides.get(from));
        }
        if let (Some(surface), Some(theirs)) = (self.surfaces.get_mut(at), other.surfaces.get(from)) {
            *surface = *theirs;
        }
        if each > 0 {
            of_pixel(&mut self.buckets, at, each).copy_from_slice(&other.buckets[from * each..][..each]);
        }
    }

    /// Gives a pixel the sums of another.
    fn copy_within(&mut self, from: usize, to: usize, each: usize) {
        self.pixels[to] = self.pixels[from];
        if !self.features.is_empty() {
            self.features[to] = self.features[from];
        }
        self.tints.set(to, self.tints.get(from));
        if !self.guides.surfaces.is_empty() {
            self.guides.set(to, self.guides.get(from));
        }
        if !self.surfaces.is_empty() {
            self.surfaces[to] = self.surfaces[from];
        }
        self.buckets.copy_within(from * each..(from + 1) * each, to * each);
    }
}

/// The sums that every tile has, to be set.
pub(crate) struct TileSumsMut<'a> {
    pub(crate) pixels: &'a mut [Pixel],
    pub(crate) features: &'a mut [FeatureSums],
    pub(crate) surfaces: &'a mut [SurfaceSums],
    pub(crate) buckets: &'a mut [BucketSums],
}

/// The sums of a pixel, this many for each.
fn of_pixel<T>(sums: &mut [T], position: usize, each: usize) -> &mut [T] {
    sums.chunks_mut(each.max(1)).nth(position).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_go_to_their_pixel_unless_not_finite() {
        let extras = Extras { features: true, tints: true, ..Extras::default() };
        let mut tile = Tile::new(PixelBounds { x0: 5, y0: 7, x1: 9, y1: 10 }, extras);
        let coverage = Rgb::splat(0.25);
        let sample = |radiance| Sample { radiance, coverage, ..Sample::default() };
        let exposure = Exposure { factor: 2.0, max_component: 6.0, ..Exposure::default() };
        assert_eq!(tile.add(6, 9, &sample(Rgb::new(1.0, 2.0, 3.0)), &exposure), Addition::Whole);
        assert_eq!(tile.add(9, 9, &sample(Rgb::WHITE), &exposure), Addition::Dropped);
        assert_eq!(tile.add(6, 6, &sample(Rgb::WHITE), &exposure), Addition::Dropped);
        assert_eq!(tile.add(6, 9, &sample(Rgb::new(1.0, f32::NAN, 1.0)), &exposure), Addition::Dropped);
        assert_eq!(tile.add(6, 9, &sample(Rgb::new(f32::INFINITY, 1.0, 1.0)), &exposure), Addition::Dropped);
        let lit: Vec<_> = tile.pixels().iter().map(Pixel::colour).collect();
        for (i, colour) in lit.into_iter().enumerate() {
            let expected = if i == 2 * 4 + 1 { Rgb::new(2.0, 4.0, 6.0) } else { Rgb::BLACK };
            assert_eq!(colour, expected, "{i}");
        }
        assert_eq!(tile.pixels()[2 * 4 + 1].coverage(), 0.25);
        assert!(!tile.is_tinted());
    }

    #[test]
    fn samples_spread_over_empty_pixels_of_their_square() {
        let mut tile = Tile::new(PixelBounds { x0: 5, y0: 7, x1: 10, y1: 10 }, Extras::default());
        let sample = |value| Sample { radiance: Rgb::splat(value), ..Sample::default() };
        for (x, y, value) in [(5, 7, 1.0), (7, 7, 2.0), (9, 7, 3.0), (5, 9, 4.0), (6, 8, 9.0)] {
            assert_eq!(tile.add(x, y, &sample(value), &Exposure::default()), Addition::Whole);
        }
        tile.spread(2);
        let shown: Vec<f32> = tile.pixels().iter().map(|pixel| pixel.colour().g).collect();
        let expected =
            [[1.0, 1.0, 2.0, 2.0, 3.0], [1.0, 9.0, 2.0, 2.0, 3.0], [4.0, 4.0, 0.0, 0.0, 0.0]].concat();
        assert_eq!(shown, expected);
    }

    #[test]
    fn coverage_is_kept_by_colour_where_it_is_wanted() {
        let bounds = PixelBounds { x0: 5, y0: 7, x1: 9, y1: 10 };
        let covered = [Rgb::new(0.75, 0.5, 0.125), Rgb::new(0.25, 1.0, 0.5)];
        let mut tiles = [true, false].map(|tints| Tile::new(bounds, Extras { tints, ..Extras::default() }));
        for tile in &mut tiles {
            for (coverage, weight) in covered.into_iter().zip([1.0, 3.0]) {
                let sample = Sample { coverage, weight, ..Sample::default() };
                assert_eq!(tile.add(7, 8, &sample, &Exposure::default()), Addition::Whole);
            }
        }
        let [by_colour, alike] = tiles.each_ref().map(|tile| tile.coverages().collect::<Vec<_>>());
        let mean = (covered[0] + covered[1] * 3.0) / 4.0;
        assert!((by_colour[6] - mean).map(f32::abs).max_component() < 1e-6, "{:?} {mean:?}", by_colour[6]);
        assert!((alike[6] - Rgb::splat(mean.average())).map(f32::abs).max_component() < 1e-6);
        assert_eq!((by_colour[5], tiles[0].is_tinted(), tiles[1].is_tinted()), (Rgb::BLACK, true, false));
    }

    #[test]
    fn a_tile_keeps_of_guides_what_its_pixels_have() {
        let bounds = PixelBounds { x0: 5, y0: 7, x1: 9, y1: 10 };
        let extras = Extras { tints: true, guides: true, ..Extras::default() };
        let sample = |radiance, on_catcher| Sample {
            radiance,
            coverage: Rgb::splat(if on_catcher { 0.5 } else { 0.0 }),
            on_catcher,
            ..Sample::default()
        };
        let light = Rgb::new(2.0, 0.5, 0.0);
        for (samples, has) in [
            (vec![sample(Rgb::BLACK, true), sample(Rgb::BLACK, false)], [false, true]),
            (vec![sample(light, false), sample(Rgb::BLACK, false)], [true, false]),
            (vec![sample(light, false), sample(Rgb::BLACK, true)], [true, true]),
        ] {
            let mut tile = Tile::new(bounds, extras);
            let mut expected = GuideSums::default();
            for (i, sample) in samples.iter().enumerate() {
                assert_eq!(tile.add(6, 8, sample, &Exposure::default()), Addition::Whole);
                let reflectance = if sample.on_catcher { [0.0; 3] } else { sample.coverage.to_array() };
                expected.light.add(sample.radiance.to_array(), reflectance, i == 1);
                if sample.on_catcher {
                    expected.shadow.add(sample.coverage.to_array(), [1.0], i == 1);
                }
                expected.count.add(1.0);
                expected.surfaces.add(None);
            }
            let guides = &tile.sums.guides;
            assert_eq!([guides.light.is_used(), guides.shadow.is_used()], has);
            assert_eq!((tile.guide(6, 8), tile.guide(5, 8)), (expected, GuideSums::default()));
            assert!(tile.placed_in(PixelBounds { x0: 6, ..bounds }).guide(6, 8) == expected);
            assert_eq!((tile.guides().count(), tile.tints().count(), tile.is_tinted()), (12, 12, false));
        }
    }

    #[test]
    fn a_bright_sample_is_dimmed_and_keeps_its_hue() {
        let exposure = Exposure { max_component: 10.0, ..Exposure::default() };
        assert_eq!(exposure.colour(Rgb::new(40.0, 20.0, 4.0)), Rgb::new(10.0, 5.0, 1.0));
        assert_eq!(exposure.colour(Rgb::new(4.0, 2.0, 0.5)), Rgb::new(4.0, 2.0, 0.5));
        // What a sensor makes of it comes after.
        let sensor = [[0.5, 0.25, 0.0], [0.0, 2.0, 0.0], [0.0, 1.0, 1.0]];
        let exposure = Exposure { factor: 0.5, sensor, ..exposure };
        assert_eq!(exposure.colour(Rgb::new(40.0, 20.0, 4.0)), Rgb::new(6.25, 10.0, 6.0));
    }
}
