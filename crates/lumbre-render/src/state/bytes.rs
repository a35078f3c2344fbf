//! The state of a render as bytes.
//!
//! Numbers are little-endian. After a head come strips of [`STRIP`] rows, so that neither writing nor reading needs all
//! bytes in memory. A strip has planes: one number of every pixel, row by row, each as the lowest `n` bytes of its
//! two's complement, where `n`, the first byte of the plane, is as small as all of them allow.

use std::io::{self, Read, Write};

use lumbre_scene::Buckets;

use crate::film::{
    BucketSums, ExactSum, Extras, FeatureSums, GuideSums, MAX_PIXELS, NUMBERS, Pixel, SurfaceSums, Tile,
    TileSumsMut, Tint,
};
use crate::state::{Piece, REMEMBERED, RenderState};
use crate::{DroppedSample, PixelBounds, RayCounts};

/// An error in the bytes of a state.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// They cannot be read.
    #[error("cannot read: {0}")]
    Io(io::Error),
    /// They end too early.
    #[error("it ends too early")]
    Truncated,
    /// The numbers are not those of a state.
    #[error("its {0} make no sense")]
    Invalid(&'static str),
    /// It would take more memory than is allowed.
    #[error("it takes {needed} bytes of memory")]
    TooLarge {
        /// How many.
        needed: u64,
    },
}

impl From<io::Error> for StateError {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::UnexpectedEof { Self::Truncated } else { Self::Io(error) }
    }
}

/// Maximum number of pieces.
const MAX_PIECES: u32 = 1 << 20;
/// Rows of a strip.
const STRIP: u32 = 16;

impl RenderState {
    /// Writes the state as bytes: the same for the same state, however it was merged. Sums are freed as they are
    /// written, unless they are shared.
    ///
    /// # Errors
    /// The errors of `out`.
    pub fn write_to(mut self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(&self.head())?;
        let (bounds, extras) = (self.bounds, self.extras());
        let mut bytes = Vec::new();
        for place in strips(bounds) {
            let mut strip = Tile::new(place, extras);
            self.tiles.iter().for_each(|tile| strip.take(tile));
            self.tiles.retain(|tile| tile.bounds().y1 > place.y1);
            planes(out, &mut bytes, strip.pixels(), pixel_numbers)?;
            let tints: Vec<Tint> = strip.tints().collect();
            planes(out, &mut bytes, &tints, |tint| [tint.red, tint.blue].map(ExactSum::units))?;
            planes(out, &mut bytes, strip.features(), feature_numbers)?;
            let guides: Vec<GuideSums> = strip.guides().collect();
            planes(out, &mut bytes, &guides, |guide| guide.words().map(|word| i128::from(word as i32)))?;
            planes(out, &mut bytes, strip.surfaces(), surface_numbers)?;
            for bucket in 0..extras.bucket_count() {
                let sums: Vec<BucketSums> = strip.buckets().map(|buckets| buckets[bucket]).collect();
                planes(out, &mut bytes, &sums, |sums| [sums.radiance, sums.weight].map(ExactSum::units))?;
            }
        }
        Ok(())
    }

    fn head(&self) -> Vec<u8> {
        let mut out = Vec::new();
        let mut words = |words: &[u32]| words.iter().for_each(|word| out.extend(word.to_le_bytes()));
        words(&corners(self.bounds()));
        let extras = self.extras();
        words(&[extras.features, extras.tints, extras.guides, extras.surfaces].map(u32::from));
        let Buckets { count, low, high } = extras.buckets.unwrap_or(NO_BUCKETS);
        words(&[count, low.to_bits(), high.to_bits()]);
        let mut pieces: Vec<&Piece> = self.pieces.iter().collect();
        pieces.sort_by_key(|piece| (piece.samples.start, piece.bounds.y0, piece.bounds.x0));
        words(&[pieces.len() as u32]);
        for piece in pieces {
            words(&corners(piece.bounds));
            words(&[piece.samples.start, piece.samples.end]);
        }
        words(&[self.first_dropped.len() as u32]);
        self.first_dropped.iter().for_each(|d| words(&[d.x, d.y, d.sample]));
        let counts = [self.rays.camera, self.rays.bounce, self.rays.shadow, self.dropped, self.clamped];
        counts.into_iter().chain([extras.depth_unit.to_bits()]).for_each(|n| out.extend(n.to_le_bytes()));
        out
    }

    /// Reads a state that takes no more than this many bytes of memory.
    ///
    /// # Errors
    /// [`StateError`].
    pub fn read_from(input: &mut dyn Read, most_memory: u64) -> Result<Self, StateError> {
        let mut input = Input(input);
        let bounds = input.bounds()?;
        if bounds.is_empty() || bounds.area() > MAX_PIXELS {
            return Err(StateError::Invalid("bounds"));
        }
        let [features, tints, guides, surfaces] = input.words()?.map(|flag| flag == 1);
        let [count, low, high] = input.words()?;
        let buckets = Buckets { count, low: f32::from_bits(low), high: f32::from_bits(high) };
        let is_range = 0.0 < buckets.low && buckets.low < buckets.high && buckets.high.is_finite();
        let buckets = match buckets {
            NO_BUCKETS => None,
            Buckets { count: 1..=Buckets::MAX, .. } if is_range => Some(buckets),
            _ => return Err(StateError::Invalid("buckets")),
        };
        let count = input.word()?;
        if count > MAX_PIECES {
            return Err(StateError::Invalid("pieces"));
        }
        let mut pieces = Vec::new();
        for _ in 0..count {
            let piece = Piece { bounds: input.bounds()?, samples: input.word()?..input.word()? };
            if piece.bounds.intersection(&bounds) != piece.bounds || piece.count() == 0 {
                return Err(StateError::Invalid("pieces"));
            }
            pieces.push(piece);
        }
        let count = input.word()? as usize;
        if count > REMEMBERED {
            return Err(StateError::Invalid("dropped samples"));
        }
        let mut first_dropped = Vec::new();
        for _ in 0..count {
            let [x, y, sample] = input.words()?;
            first_dropped.push(DroppedSample { x, y, sample });
        }
        let [camera, bounce, shadow, dropped, clamped, depth_unit] = input.longs()?;
        let depth_unit = f64::from_bits(depth_unit);
        if !(depth_unit.is_normal() && depth_unit > 0.0) {
            return Err(StateError::Invalid("depths"));
        }
        let extras = Extras { features, tints, guides, surfaces, buckets, depth_unit };
        let needed = Tile::memory_bytes(bounds, extras);
        if needed > most_memory {
            return Err(StateError::TooLarge { needed });
        }
        let mut tiles = Vec::new();
        for place in strips(bounds) {
            let mut strip = Tile::new(place, extras);
            let TileSumsMut { pixels, features, surfaces, buckets } = strip.sums_mut();
            let count = pixels.len();
            input.planes(pixels, pixel_of)?;
            let mut all_tints = vec![Tint::default(); if tints { count } else { 0 }];
            input.planes(&mut all_tints, |[red, blue]| {
                Some(Tint { red: ExactSum::from_units(red), blue: ExactSum::from_units(blue) })
            })?;
            input.planes(features, |numbers| Some(features_of(numbers)))?;
            let mut all_guides = vec![GuideSums::default(); if guides { count } else { 0 }];
            input.planes(&mut all_guides, |numbers| {
                Some(GuideSums::of_words(numbers.map(|number| number as u32)))
            })?;
            input.planes(surfaces, |numbers| Some(surface_of(numbers)))?;
            let each = extras.bucket_count();
            let mut sums = vec![BucketSums::default(); count];
            for bucket in 0..each {
                input.planes(&mut sums, |numbers| {
                    let [radiance, weight] = numbers.map(ExactSum::from_units);
                    Some(BucketSums { radiance, weight })
                })?;
                let own = buckets.iter_mut().skip(bucket).step_by(each);
                own.zip(&sums).for_each(|(own, sums)| *own = *sums);
            }
            all_tints.into_iter().enumerate().for_each(|(at, tint)| strip.set_tint(at, tint));
            all_guides.into_iter().enumerate().for_each(|(at, guide)| strip.set_guide(at, guide));
            tiles.push(strip);
        }
        let rays = RayCounts { camera, bounce, shadow };
        Ok(Self { bounds, tiles, pieces, rays, dropped, clamped, first_dropped })
    }
}

/// The number of buckets in the head if there are none.
const NO_BUCKETS: Buckets = Buckets { count: 0, low: 0.0, high: 0.0 };

/// The strips of a picture, from above.
fn strips(bounds: PixelBounds) -> impl Iterator<Item = PixelBounds> {
    let y1 = bounds.y1;
    let ends = move |y0: u32| PixelBounds { y0, y1: y0.saturating_add(STRIP).min(y1), ..bounds };
    (bounds.y0..bounds.y1).step_by(STRIP as usize).map(ends)
}

fn corners(bounds: PixelBounds) -> [u32; 4] {
    [bounds.x0, bounds.y0, bounds.x1, bounds.y1]
}

fn pixel_numbers(pixel: &Pixel) -> [i128; 9] {
    let Pixel { sum: [r, g, b], covered, weight, luminance, luminance_squares, samples, taken } = *pixel;
    let [r, g, b, covered, weight, luminance, squares] =
        [r, g, b, covered, weight, luminance, luminance_squares].map(ExactSum::units);
    [r, g, b, covered, weight, luminance, squares, samples.into(), taken.into()]
}

fn pixel_of([r, g, b, covered, weight, luminance, squares, samples, taken]: [i128; 9]) -> Option<Pixel> {
    let [r, g, b, covered, weight, luminance, luminance_squares] =
        [r, g, b, covered, weight, luminance, squares].map(ExactSum::from_units);
    let (samples, taken) = (u32::try_from(samples).ok()?, u32::try_from(taken).ok()?);
    (samples <= taken).then_some(Pixel {
        sum: [r, g, b],
        covered,
        weight,
        luminance,
        luminance_squares,
        samples,
        taken,
    })
}

fn feature_numbers(sums: &FeatureSums) -> [i128; 11] {
    let FeatureSums { albedo: [r, g, b], normal: [x, y, z], depth, uv: [u, v], met, weight } = *sums;
    [r, g, b, x, y, z, depth, u, v, met, weight].map(ExactSum::units)
}

fn features_of(numbers: [i128; 11]) -> FeatureSums {
    let [r, g, b, x, y, z, depth, u, v, met, weight] = numbers.map(ExactSum::from_units);
    FeatureSums { albedo: [r, g, b], normal: [x, y, z], depth, uv: [u, v], met, weight }
}

fn surface_numbers(sums: &SurfaceSums) -> [i128; NUMBERS] {
    let mut numbers = [0; NUMBERS];
    let mut own = *sums;
    numbers.iter_mut().zip(own.numbers_mut()).for_each(|(number, sum)| *number = sum.units());
    numbers
}

fn surface_of(numbers: [i128; NUMBERS]) -> SurfaceSums {
    let mut own = SurfaceSums::default();
    own.numbers_mut().zip(numbers).for_each(|(sum, number)| *sum = ExactSum::from_units(number));
    own
}

/// Writes a plane for each number of the sums, with `bytes` as a buffer.
fn planes<T, const N: usize>(
    out: &mut dyn Write,
    bytes: &mut Vec<u8>,
    sums: &[T],
    numbers: impl Fn(&T) -> [i128; N],
) -> io::Result<()> {
    if sums.is_empty() {
        return Ok(());
    }
    // For each plane, the bits that differ from the sign in any number, and whether any number is not 0.
    let mut bits = [0_i128; N];
    let mut is_used = [false; N];
    let all: Vec<[i128; N]> = sums.iter().map(numbers).collect();
    for numbers in &all {
        for (i, number) in numbers.iter().enumerate() {
            bits[i] |= number ^ (number >> 127);
            is_used[i] |= *number != 0;
        }
    }
    for i in 0..N {
        let width = if is_used[i] { (128 - bits[i].leading_zeros() as usize) / 8 + 1 } else { 0 };
        bytes.clear();
        bytes.push(width as u8);
        let end = 1 + width * sums.len();
        // Each number is written whole, which is faster; the next one overwrites the excess bytes.
        bytes.resize(end + 16, 0);
        for (k, numbers) in all.iter().enumerate() {
            let at = 1 + width * k;
            bytes[at..at + 16].copy_from_slice(&numbers[i].to_le_bytes());
        }
        out.write_all(&bytes[..end])?;
    }
    Ok(())
}

/// The rest of the input.
struct Input<'a>(&'a mut dyn Read);

impl Input<'_> {
    fn word(&mut self) -> Result<u32, StateError> {
        let mut bytes = [0; 4];
        self.0.read_exact(&mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }

    fn words<const N: usize>(&mut self) -> Result<[u32; N], StateError> {
        let mut words = [0; N];
        for word in &mut words {
            *word = self.word()?;
        }
        Ok(words)
    }

    fn longs<const N: usize>(&mut self) -> Result<[u64; N], StateError> {
        let mut longs = [0; N];
        for long in &mut longs {
            let [low, high] = self.words()?.map(u64::from);
            *long = high << 32 | low;
        }
        Ok(longs)
    }

    fn bounds(&mut self) -> Result<PixelBounds, StateError> {
        let [x0, y0, x1, y1] = self.words()?;
        Ok(PixelBounds { x0, y0, x1, y1 })
    }

    /// Reads a plane for each number of the sums.
    fn planes<T, const N: usize>(
        &mut self,
        sums: &mut [T],
        of: impl Fn([i128; N]) -> Option<T>,
    ) -> Result<(), StateError> {
        if sums.is_empty() {
            return Ok(());
        }
        let mut all = vec![[0; N]; sums.len()];
        let mut bytes = Vec::new();
        for i in 0..N {
            let mut width = [0];
            self.0.read_exact(&mut width)?;
            let width = usize::from(width[0]);
            if width > 16 {
                return Err(StateError::Invalid("planes"));
            }
            if width == 0 {
                continue;
            }
            bytes.resize(width * sums.len(), 0);
            self.0.read_exact(&mut bytes)?;
            for (numbers, bytes) in all.iter_mut().zip(bytes.chunks_exact(width)) {
                numbers[i] = number(bytes);
            }
        }
        for (sums, numbers) in sums.iter_mut().zip(all) {
            *sums = of(numbers).ok_or(StateError::Invalid("counts"))?;
        }
        Ok(())
    }
}

/// The number whose lowest bytes these are.
fn number(bytes: &[u8]) -> i128 {
    let is_negative = bytes.last().is_some_and(|byte| byte >> 7 == 1);
    let mut all = [if is_negative { 0xff } else { 0 }; 16];
    all[..bytes.len()].copy_from_slice(bytes);
    i128::from_le_bytes(all)
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::film::{Exposure, FeatureSample, Sample, SpectralSample, SurfaceSample};

    fn state() -> RenderState {
        let bounds = PixelBounds { x0: 5, y0: 2, x1: 9, y1: 21 };
        let buckets = Some(Buckets { count: 3, low: 420.0, high: 690.5 });
        let extras =
            Extras { features: true, tints: true, guides: true, surfaces: true, buckets, depth_unit: 0.25 };
        let mut film = Tile::new(bounds, extras);
        let mut random = RandomStream::new(1);
        for (x, y) in bounds.pixels().chain(bounds.pixels().take(3)) {
            let mut colour = || Rgb::new(random.next_f32() - 0.5, random.next_f32(), 1e9 * random.next_f32());
            let sample = Sample {
                radiance: colour(),
                coverage: colour(),
                weight: 1.5,
                features: Some(FeatureSample {
                    albedo: colour(),
                    normal: [0.0, -1.0, 0.3],
                    depth: 0.1,
                    uv: [0.2, -7.0],
                }),
                surface: (x != 6).then_some(SurfaceSample {
                    point: [1.5, -2.5, f64::from(y)],
                    slope: [0.25, 8.0],
                    normal: [0.0, 0.0, -1.0],
                    shading_normal: [0.6, 0.0, -0.8],
                    uv: [0.75, 3.0],
                    albedo: Rgb::new(0.1, 0.2, 0.9),
                }),
                spectrum: Some(SpectralSample { nm: [450.0, 510.0, 640.0], radiance: [1.0, x as f32, -0.5] }),
                on_catcher: x == 5,
            };
            film.add(x, y, &sample, &Exposure::default());
        }
        RenderState {
            bounds,
            tiles: vec![film],
            pieces: vec![
                Piece { bounds, samples: 4..9 },
                Piece { bounds: PixelBounds { x1: 8, ..bounds }, samples: 0..4 },
            ],
            rays: RayCounts { camera: 1, bounce: u64::MAX, shadow: 3 },
            dropped: 1,
            clamped: 2,
            first_dropped: vec![DroppedSample { x: 7, y: 3, sample: 2 }],
        }
    }

    fn bytes_of(state: &RenderState) -> Vec<u8> {
        let mut bytes = Vec::new();
        state.clone().write_to(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn a_state_comes_back_from_its_bytes() {
        let state = state();
        let bytes = bytes_of(&state);
        let mut rest = &bytes[..];
        let back = RenderState::read_from(&mut rest, u64::MAX).unwrap();
        assert_eq!((back.tiles.len(), rest.len()), (2, 0));
        assert_eq!(back.film(), state.film());
        assert_eq!(bytes_of(&back), bytes);
        assert_eq!((back.rays, back.dropped, back.clamped), (state.rays, state.dropped, state.clamped));
        assert_eq!(back.first_dropped, state.first_dropped);
        assert_eq!(back.pieces, [state.pieces[1].clone(), state.pieces[0].clone()]);
        // However it is cut into tiles.
        let film = state.film();
        let tiles = state.bounds.tiles(3).into_iter().rev().map(|tile| film.placed_in(tile)).collect();
        assert_eq!(bytes_of(&RenderState { tiles, ..state.clone() }), bytes);
    }

    #[test]
    fn bytes_that_are_no_state_are_refused() {
        let bytes = bytes_of(&state());
        for end in 0..bytes.len() {
            let error = RenderState::read_from(&mut &bytes[..end], u64::MAX).unwrap_err();
            assert!(matches!(error, StateError::Truncated | StateError::Invalid(_)), "{end}: {error}");
        }
        assert!(matches!(RenderState::read_from(&mut &bytes[..], 100), Err(StateError::TooLarge { .. })));
        let mut random = RandomStream::new(2);
        for _ in 0..2000 {
            let mut broken = bytes.clone();
            let place = random.next_below(broken.len().min(300));
            broken[place] = random.next_u64() as u8;
            // Whatever comes of it, it comes without panic and without the memory that a head asks for.
            let _ = RenderState::read_from(&mut &broken[..], 1 << 20);
        }
    }

    #[test]
    fn numbers_take_the_bytes_that_they_need() {
        for (number, bytes) in [
            (0, 0),
            (1, 1),
            (127, 1),
            (128, 2),
            (-1, 1),
            (-128, 1),
            (-129, 2),
            (i128::MAX, 16),
            (i128::MIN, 16),
        ] {
            // Among smaller ones of either sign.
            let numbers = [0, number, number >> 3, number];
            let mut out = Vec::new();
            planes(&mut out, &mut Vec::new(), &numbers, |number| [*number]).unwrap();
            assert_eq!((usize::from(out[0]), out.len()), (bytes, 1 + 4 * bytes), "{number}");
            if bytes > 0 {
                let back = out[1..].chunks(bytes).map(super::number);
                assert!(back.eq(numbers), "{number}");
            }
        }
    }
}
