//! The state of a render as bytes.
//!
//! Numbers are little-endian. After a head come planes: one number of every pixel, row by row, each as the lowest `n` bytes of its
//! two's complement, where `n`, the first byte of the plane, is as small as all of them allow.

use crate::film::{ExactSum, Extras, FeatureSums, GuideSums, MAX_PIXELS, Pixel, Tile, Tint};
use crate::state::{Piece, REMEMBERED, RenderState};
use crate::{DroppedSample, PixelBounds, RayCounts};

/// What is wrong with the bytes of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// They end too early.
    #[error("it ends too early")]
    Truncated,
    /// More follows.
    #[error("more follows than its head says")]
    TooLong,
    /// Its numbers make no state.
    #[error("its {0} make no sense")]
    Invalid(&'static str),
    /// It would take more memory than is allowed.
    #[error("it takes {needed} bytes of memory")]
    TooLarge {
        /// How many.
        needed: u64,
    },
}

/// Pieces at most.
const MAX_PIECES: u32 = 1 << 20;

impl RenderState {
    /// The state as bytes: the same for the same state, whatever it was merged of.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        let mut words = |words: &[u32]| words.iter().for_each(|word| out.extend(word.to_le_bytes()));
        words(&corners(self.bounds()));
        let extras = self.extras();
        words(&[u32::from(extras.features), u32::from(extras.tints), u32::from(extras.guides)]);
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
        let film = self.film();
        planes(&mut out, film.pixels(), pixel_numbers);
        planes(&mut out, film.tints(), |tint| [tint.red, tint.blue].map(ExactSum::units));
        planes(&mut out, film.features(), feature_numbers);
        planes(&mut out, film.guides(), |guide| guide.words().map(i128::from));
        out
    }

    /// The state of bytes that take no more than so many bytes of memory.
    ///
    /// # Errors
    /// [`StateError`].
    pub fn from_bytes(bytes: &[u8], most_memory: u64) -> Result<Self, StateError> {
        let mut input = Input(bytes);
        let bounds = input.bounds()?;
        if bounds.is_empty() || bounds.area() > MAX_PIXELS {
            return Err(StateError::Invalid("bounds"));
        }
        let [features, tints, guides] = input.words()?.map(|flag| flag == 1);
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
        let extras = Extras { features, tints, guides, depth_unit };
        let needed = Tile::memory_bytes(bounds, extras);
        if needed > most_memory {
            return Err(StateError::TooLarge { needed });
        }
        let mut film = Tile::new(bounds, extras);
        let (pixels, tints, features, guides) = film.sums_mut();
        input.planes(pixels, pixel_of)?;
        input.planes(tints, |[red, blue]| {
            Some(Tint { red: ExactSum::from_units(red), blue: ExactSum::from_units(blue) })
        })?;
        input.planes(features, |numbers| Some(features_of(numbers)))?;
        input.planes(guides, |numbers| Some(GuideSums::of_words(numbers.map(|number| number as u32))))?;
        if !input.0.is_empty() {
            return Err(StateError::TooLong);
        }
        let rays = RayCounts { camera, bounce, shadow };
        Ok(Self { bounds, tiles: vec![film], pieces, rays, dropped, clamped, first_dropped })
    }
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

/// Writes a plane for each number of the sums.
fn planes<T, const N: usize>(out: &mut Vec<u8>, sums: &[T], numbers: impl Fn(&T) -> [i128; N]) {
    if sums.is_empty() {
        return;
    }
    // Of each plane, the bits that differ from the sign in any number, and whether any is other than 0.
    let mut bits = [0_i128; N];
    let mut is_used = [false; N];
    for sums in sums {
        for (i, number) in numbers(sums).into_iter().enumerate() {
            bits[i] |= number ^ (number >> 127);
            is_used[i] |= number != 0;
        }
    }
    for i in 0..N {
        let width = if is_used[i] { (128 - bits[i].leading_zeros() as usize) / 8 + 1 } else { 0 };
        out.push(width as u8);
        let start = out.len();
        let end = start + width * sums.len();
        // Each is written whole, as that is faster, and the next one takes the place of what is too much of it.
        out.resize(end + 16, 0);
        for (k, sums) in sums.iter().enumerate() {
            let at = start + width * k;
            out[at..at + 16].copy_from_slice(&numbers(sums)[i].to_le_bytes());
        }
        out.truncate(end);
    }
}

/// What is left to read.
struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], StateError> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(StateError::Truncated)?;
        self.0 = rest;
        Ok(taken)
    }

    fn word(&mut self) -> Result<u32, StateError> {
        let (bytes, rest) = self.0.split_first_chunk().ok_or(StateError::Truncated)?;
        self.0 = rest;
        Ok(u32::from_le_bytes(*bytes))
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
        let mut planes: [(usize, &[u8]); N] = [(0, &[]); N];
        for plane in &mut planes {
            let width = usize::from(self.take(1)?[0]);
            if width > 16 {
                return Err(StateError::Invalid("planes"));
            }
            *plane = (width, self.take(width * sums.len())?);
        }
        for (i, sums) in sums.iter_mut().enumerate() {
            let numbers = planes.map(|(width, bytes)| number(&bytes[i * width..(i + 1) * width]));
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
    use crate::film::{Exposure, FeatureSample, Sample};

    fn state() -> RenderState {
        let bounds = PixelBounds { x0: 5, y0: 2, x1: 9, y1: 5 };
        let extras = Extras { features: true, tints: true, guides: true, depth_unit: 0.25 };
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

    #[test]
    fn a_state_comes_back_from_its_bytes() {
        let state = state();
        let bytes = state.to_bytes();
        let back = RenderState::from_bytes(&bytes, u64::MAX).unwrap();
        assert_eq!(back.film(), state.film());
        assert_eq!(back.to_bytes(), bytes);
        assert_eq!((back.rays, back.dropped, back.clamped), (state.rays, state.dropped, state.clamped));
        assert_eq!(back.first_dropped, state.first_dropped);
        assert_eq!(back.pieces, [state.pieces[1].clone(), state.pieces[0].clone()]);
    }

    #[test]
    fn bytes_that_are_no_state_are_refused() {
        let bytes = state().to_bytes();
        for end in 0..bytes.len() {
            let error = RenderState::from_bytes(&bytes[..end], u64::MAX).unwrap_err();
            assert!(matches!(error, StateError::Truncated | StateError::Invalid(_)), "{end}: {error}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert_eq!(RenderState::from_bytes(&longer, u64::MAX), Err(StateError::TooLong));
        assert!(matches!(RenderState::from_bytes(&bytes, 100), Err(StateError::TooLarge { .. })));
        let mut random = RandomStream::new(2);
        for _ in 0..2000 {
            let mut broken = bytes.clone();
            let place = random.next_below(broken.len().min(300));
            broken[place] = random.next_u64() as u8;
            // Whatever comes of it, it comes without panic and without the memory that a head asks for.
            let _ = RenderState::from_bytes(&broken, 1 << 20);
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
            planes(&mut out, &numbers, |number| [*number]);
            assert_eq!((usize::from(out[0]), out.len()), (bytes, 1 + 4 * bytes), "{number}");
            if bytes > 0 {
                let back = out[1..].chunks(bytes).map(super::number);
                assert!(back.eq(numbers), "{number}");
            }
        }
    }
}
