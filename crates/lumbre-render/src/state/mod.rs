//! The state of a render, to resume from and to merge.

mod bytes;

use std::borrow::Cow;
use std::fmt;
use std::iter;
use std::ops::Range;

use lumbre_image::Image;

use crate::film::{Extras, Pixel, Tile};
use crate::noise::noise;
use crate::rendered::{rendered_of, variance_picture};
use crate::{DroppedSample, PixelBounds, RayCounts, Rendered, Stats};

pub use bytes::StateError;

/// The sums of every pixel of a render, finished or not, and the samples that they contain.
///
/// Sums are exact ([`crate::film::ExactSum`]). So the states of parts of a render, by ranges of samples and by crops,
/// merge to the state of the whole, bit for bit, in any order and grouping.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderState {
    /// The rectangle that holds all pieces.
    pub(crate) bounds: PixelBounds,
    /// The sums of all its pixels: in one tile, or in many without overlaps.
    pub(crate) tiles: Vec<Tile>,
    /// The requested samples.
    pub(crate) pieces: Vec<Piece>,
    /// Rays traced.
    pub(crate) rays: RayCounts,
    /// Samples that were not finite.
    pub(crate) dropped: u64,
    /// Samples that were brighter than a sum holds.
    pub(crate) clamped: u64,
    /// The first of them.
    pub(crate) first_dropped: Vec<DroppedSample>,
}

/// Some samples of some pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// The pixels.
    pub bounds: PixelBounds,
    /// The indices of their samples.
    pub samples: Range<u32>,
}

/// Why two states cannot be merged.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// A sample is in both.
    #[error("both have {0}")]
    Overlap(Piece),
    /// Only one of them has features, or coverage by colour.
    #[error("only one of them has what the other has besides colours")]
    OtherExtras,
    /// One has sums of a denoiser, which depend on the order of samples.
    #[error("what a denoiser gathers cannot be merged")]
    Guides,
}

/// Maximum dropped samples whose pixels are remembered.
pub(crate) const REMEMBERED: usize = 16;

impl fmt::Display for Piece {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bounds: b, samples } = self;
        write!(f, "samples {}..{} of pixels {},{},{},{}", samples.start, samples.end, b.x0, b.y0, b.x1, b.y1)
    }
}

impl Piece {
    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.bounds.area() * u64::from(self.samples.end.saturating_sub(self.samples.start))
    }

    /// The intersection.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let bounds = self.bounds.intersection(&other.bounds);
        let samples = self.samples.start.max(other.samples.start)..self.samples.end.min(other.samples.end);
        (!bounds.is_empty() && !samples.is_empty()).then_some(Self { bounds, samples })
    }
}

impl RenderState {
    /// The rectangle that holds all pixels of it.
    pub fn bounds(&self) -> PixelBounds {
        self.bounds
    }

    fn pixels(&self) -> impl Iterator<Item = &Pixel> {
        self.tiles.iter().flat_map(Tile::pixels)
    }

    /// Sums besides colours.
    pub(crate) fn extras(&self) -> Extras {
        self.tiles.first().map(Tile::extras).unwrap_or_default()
    }

    /// All sums in one tile.
    pub(crate) fn film(&self) -> Cow<'_, Tile> {
        match &self.tiles[..] {
            [tile] if tile.bounds() == self.bounds => Cow::Borrowed(tile),
            tiles => {
                let mut film = Tile::new(self.bounds, self.extras());
                tiles.iter().for_each(|tile| film.take(tile));
                Cow::Owned(film)
            }
        }
    }

    /// The requested samples and pixels, without overlaps, in the order of merging.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Number of these samples that were taken.
    pub fn taken(&self) -> u64 {
        self.pixels().map(|pixel| u64::from(pixel.taken)).sum()
    }

    /// Number of requested samples.
    pub fn wanted(&self) -> u64 {
        self.pieces.iter().map(Piece::count).sum()
    }

    /// Whether all samples were taken.
    pub fn is_finished(&self) -> bool {
        self.taken() == self.wanted()
    }

    /// The fewest samples of any pixel.
    pub fn least_samples(&self) -> u32 {
        let covered: u64 = self.tiles.iter().map(|tile| tile.bounds().area()).sum();
        let is_whole = covered == self.bounds.area();
        self.pixels().map(|pixel| pixel.taken).min().filter(|_| is_whole).unwrap_or(0)
    }

    /// The most samples of any pixel.
    pub fn most_samples(&self) -> u32 {
        self.pixels().map(|pixel| pixel.taken).max().unwrap_or(0)
    }

    /// The range of samples of all pixels, from the first of any to the last of any.
    pub fn samples(&self) -> Range<u32> {
        let first = self.pieces.iter().map(|piece| piece.samples.start).min().unwrap_or(0);
        let last = self.pieces.iter().map(|piece| piece.samples.end).max().unwrap_or(0);
        first..last
    }

    /// The gaps in samples 0 to the last of any, for the pixels of `bounds`, in pieces as large as possible.
    pub fn gaps(&self, bounds: PixelBounds) -> Vec<Piece> {
        // Pieces are few, so gaps are split one after another.
        let mut gaps = vec![Piece { bounds, samples: 0..self.samples().end }];
        for piece in &self.pieces {
            gaps = gaps.iter().flat_map(|gap| without(gap, piece)).collect();
        }
        gaps
    }

    /// The picture, with alpha if it is transparent. The statistics are those of the samples.
    pub fn to_rendered(&self, transparent: bool) -> Rendered {
        // All in one, so that sums of rounded numbers, such as the noise, do not depend on the order of merges.
        let film = self.film();
        let rendered = rendered_of(iter::once(&*film), self.bounds, transparent, self.extras());
        let stats = Stats {
            spp: self.least_samples(),
            most_spp: self.most_samples(),
            stride: (self.least_samples() > 0).then_some(1),
            samples: self.rays.camera,
            rays: self.rays,
            dropped: self.dropped,
            clamped: self.clamped,
            first_dropped: self.first_dropped.clone(),
            noise: noise(iter::once(&*film), self.bounds, None),
            ..Stats::default()
        };
        Rendered { stats, ..rendered }
    }

    /// The variance of the mean luminance of every pixel, in all three channels, estimated from its samples; it falls
    /// with their number. 0 for fewer than two samples.
    pub fn variance(&self) -> Image {
        variance_picture(self.tiles.iter(), self.bounds)
    }

    /// Adds another state.
    ///
    /// # Errors
    /// [`MergeError`]; nothing is changed then.
    pub fn merge(&mut self, other: &Self) -> Result<(), MergeError> {
        let overlap = |piece: &Piece| other.pieces.iter().find_map(|theirs| piece.intersection(theirs));
        if let Some(overlap) = self.pieces.iter().find_map(overlap) {
            return Err(MergeError::Overlap(overlap));
        }
        let (own, theirs) = (self.extras(), other.extras());
        if own != theirs {
            return Err(MergeError::OtherExtras);
        }
        if own.guides {
            return Err(MergeError::Guides);
        }
        if self.tiles.len() > 1 && other.tiles.len() > 1 {
            // Looking up each of many tiles among many would be quadratic.
            self.tiles = vec![self.film().into_owned()];
        }
        self.bounds = self.bounds.hull(&other.bounds);
        other.tiles.iter().for_each(|tile| self.add(tile));
        self.pieces.extend(other.pieces.iter().cloned());
        self.rays += other.rays;
        self.dropped += other.dropped;
        self.clamped += other.clamped;
        self.first_dropped.extend(&other.first_dropped);
        self.first_dropped.sort_unstable_by_key(|d| (d.sample, d.y, d.x));
        self.first_dropped.truncate(REMEMBERED);
        Ok(())
    }

    /// Adds the sums of a tile within the bounds, in a time that does not depend on the size of the picture, unless the
    /// tile overlaps others.
    fn add(&mut self, tile: &Tile) {
        let bounds = tile.bounds();
        if let Some(own) = self.tiles.iter_mut().find(|own| own.bounds().intersection(&bounds) == bounds) {
            own.merge(tile);
        } else if self.tiles.iter().all(|own| own.bounds().intersection(&bounds).is_empty()) {
            self.tiles.push(tile.clone());
        } else {
            let mut film = Tile::new(self.bounds, self.extras());
            self.tiles.iter().for_each(|own| film.take(own));
            film.merge(tile);
            self.tiles = vec![film];
        }
    }
}

/// The difference of two pieces: up to six pieces.
fn without(piece: &Piece, other: &Piece) -> Vec<Piece> {
    let Some(both) = piece.intersection(other) else { return vec![piece.clone()] };
    let PixelBounds { x0, y0, x1, y1 } = piece.bounds;
    let inner = both.bounds;
    let samples = |samples: Range<u32>, bounds| Piece { bounds, samples };
    let beside = |x0, y0, x1, y1| samples(piece.samples.clone(), PixelBounds { x0, y0, x1, y1 });
    [
        samples(piece.samples.start..both.samples.start, inner),
        samples(both.samples.end..piece.samples.end, inner),
        beside(x0, y0, x1, inner.y0),
        beside(x0, inner.y1, x1, y1),
        beside(x0, inner.y0, inner.x0, inner.y1),
        beside(inner.x1, inner.y0, x1, inner.y1),
    ]
    .into_iter()
    .filter(|piece| piece.count() > 0)
    .collect()
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;
    use lumbre_math::random::RandomStream;
    use lumbre_scene::Buckets;

    use super::*;
    use crate::film::{Exposure, FeatureSample, Sample, SpectralSample, SurfaceSample};

    fn state(bounds: PixelBounds, samples: Range<u32>) -> RenderState {
        let buckets = Some(Buckets { count: 5, low: 400.0, high: 700.0 });
        let extras = Extras {
            features: true,
            tints: true,
            surfaces: true,
            buckets,
            depth_unit: 8.0,
            ..Extras::default()
        };
        let mut film = Tile::new(bounds, extras);
        for (x, y) in bounds.pixels() {
            for index in samples.clone() {
                let mut random =
                    RandomStream::new(u64::from(x) << 40 | u64::from(y) << 20 | u64::from(index));
                let mut colour =
                    || Rgb::new(random.next_f32(), 1e-3 * random.next_f32(), 1e5 * random.next_f32());
                let features =
                    FeatureSample { albedo: colour(), normal: [0.1, 0.7, 0.7], depth: 3.3, uv: [0.1, 0.2] };
                let sample = Sample {
                    radiance: colour(),
                    coverage: colour(),
                    weight: 0.3 + f64::from(index) / 7.0,
                    features: (index % 3 > 0).then_some(features),
                    surface: (index % 4 > 0).then_some(SurfaceSample {
                        point: colour().to_array().map(f64::from),
                        slope: [random.next_f32(), 2.0],
                        normal: [0.0, 0.6, -0.8],
                        shading_normal: [0.0, 0.0, -1.0],
                        uv: [random.next_f32(); 2],
                        albedo: Rgb::splat(random.next_f32()),
                    }),
                    spectrum: Some(SpectralSample {
                        nm: [400.0, 500.0, 600.0].map(|nm| nm + 99.0 * random.next_f32()),
                        radiance: [random.next_f32(), 2.0, random.next_f32()],
                    }),
                    on_catcher: false,
                };
                film.add(x, y, &sample, &Exposure::default());
            }
        }
        let pieces = vec![Piece { bounds, samples }];
        RenderState {
            bounds,
            tiles: vec![film],
            pieces,
            rays: RayCounts::default(),
            dropped: 0,
            clamped: 0,
            first_dropped: Vec::new(),
        }
    }

    const WHOLE: PixelBounds = PixelBounds { x0: 3, y0: 5, x1: 12, y1: 11 };

    #[test]
    fn parts_come_to_the_whole_in_any_order_and_grouping() {
        let whole = state(WHOLE, 0..23);
        let left = PixelBounds { x1: 7, ..WHOLE };
        let right = PixelBounds { x0: 7, ..WHOLE };
        let mut random = RandomStream::new(3);
        for _ in 0..50 {
            let mut parts = vec![state(left, 0..1), state(left, 1..9), state(left, 9..23)];
            parts.extend([(0, 4), (4, 5), (5, 22), (22, 23)].map(|(from, to)| state(right, from..to)));
            while parts.len() > 1 {
                let part = parts.swap_remove(random.next_below(parts.len()));
                let into = random.next_below(parts.len());
                parts[into].merge(&part).unwrap();
            }
            assert_eq!(parts[0].film(), whole.film());
            assert!(parts[0].is_finished() && parts[0].gaps(WHOLE).is_empty());
        }
    }

    #[test]
    fn merged_tiles_stay_tiles_and_gaps_have_no_samples() {
        let whole = state(WHOLE, 0..7);
        let tiles = WHOLE.tiles(4);
        let mut merged = state(tiles[0], 0..3);
        let mut least = Vec::new();
        for tile in &tiles[1..] {
            merged.merge(&state(*tile, 0..3)).unwrap();
            least.push(merged.least_samples());
        }
        // Three in the first row, three in the second.
        assert_eq!(least, [3, 3, 0, 0, 3]);
        // The rest of them comes to the tiles that are there.
        tiles.iter().for_each(|tile| merged.merge(&state(*tile, 3..6)).unwrap());
        assert_eq!((merged.tiles.len(), tiles.len()), (6, 6));
        assert_eq!(merged.least_samples(), 6);
        // What lies across them does not.
        merged.merge(&state(WHOLE, 6..7)).unwrap();
        assert_eq!((merged.tiles.len(), merged.film()), (1, whole.film()));
        assert_eq!(
            merged.to_rendered(true),
            RenderState { tiles: whole.tiles.clone(), ..merged.clone() }.to_rendered(true)
        );
        let many = |samples: Range<u32>| {
            let mut many = state(tiles[0], samples.clone());
            tiles[1..].iter().for_each(|tile| many.merge(&state(*tile, samples.clone())).unwrap());
            many
        };
        let mut both = many(0..3);
        both.merge(&many(3..7)).unwrap();
        assert_eq!((both.tiles.len(), both.film()), (1, whole.film()));
    }

    #[test]
    fn what_is_missing_is_named_and_what_is_twice_is_refused() {
        let mut part = state(WHOLE, 2..5);
        let before = part.clone();
        let overlap = part.merge(&state(PixelBounds { x0: 10, ..WHOLE }, 4..6)).unwrap_err();
        let both = Piece { bounds: PixelBounds { x0: 10, ..WHOLE }, samples: 4..5 };
        assert_eq!((overlap, &part), (MergeError::Overlap(both), &before));
        part.merge(&state(PixelBounds { x0: 10, ..WHOLE }, 5..7)).unwrap();
        let mut gaps = part.gaps(WHOLE);
        gaps.sort_by_key(|gap| (gap.samples.start, gap.bounds.x0));
        let left = PixelBounds { x1: 10, ..WHOLE };
        let missing: u64 = gaps.iter().map(Piece::count).sum();
        assert_eq!(missing, 2 * WHOLE.area() + 2 * left.area());
        assert_eq!(part.gaps(WHOLE).len(), gaps.len());
        assert!(gaps.contains(&Piece { bounds: left, samples: 5..7 }), "{gaps:?}");
        let other =
            RenderState { tiles: vec![Tile::new(WHOLE, Extras::default())], pieces: Vec::new(), ..before };
        assert_eq!(part.merge(&other), Err(MergeError::OtherExtras));
    }
}
