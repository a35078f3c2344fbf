//! The noise of a picture.

use crate::adaptive::Adaptive;
use crate::film::{PixelBounds, Tile};
use crate::neighbourhoods::{FLOOR, Known, Neighbourhoods, Spread};

/// With fewer bright samples there is no usable mean.
const FEW: f64 = 2.0;
/// Cells along the longer side of the grid of neighbourhoods.
const SIDE: u32 = 256;
/// Rows whose pixels are processed at once.
const STRIP: u32 = 16;

/// Statistics of the pixels of a strip, row by row.
fn known_within<'t>(tiles: impl Iterator<Item = &'t Tile>, strip: PixelBounds) -> Vec<Option<Known>> {
    let mut known = vec![None; strip.area() as usize];
    for tile in tiles {
        for (x, y) in tile.bounds().intersection(&strip).pixels() {
            known[strip.position(x, y)] = Known::of(tile.pixel(x, y));
        }
    }
    known
}

/// The noise of the tiles of a picture, as [`crate::Stop::noise`] defines it; `None` if no pixel has two samples.
///
/// A pixel with light in one of its n samples has an error as large as its luminance, and cannot tell how rare that
/// light is. So its error is divided by the luminance of its neighbourhood, if that is smaller and its own is
/// uncertain. Light that only the trial has met counts as far as these pixels have too few samples to meet it.
pub(crate) fn noise<'t>(
    tiles: impl Iterator<Item = &'t Tile> + Clone,
    bounds: PixelBounds,
    adaptive: Option<&Adaptive>,
) -> Option<f64> {
    let (width, height) = (bounds.width(), bounds.height());
    let side = width.max(height).div_ceil(SIDE).max(1);
    let columns = width.div_ceil(side) as usize;
    let mut spreads = vec![Spread::default(); columns * height.div_ceil(side) as usize];
    // Pixels with enough samples, row by row, with their positions. They are streamed: there may be many.
    let known_pixels = || {
        let strips = (bounds.y0..bounds.y1).step_by(STRIP as usize);
        let tiles = tiles.clone();
        strips.flat_map(move |y0| {
            let y1 = y0.saturating_add(STRIP).min(bounds.y1);
            let strip = PixelBounds { y0, y1, ..bounds };
            let known = known_within(tiles.clone(), strip);
            let place = move |(x, y): (u32, u32)| (x - bounds.x0, y - bounds.y0);
            strip.pixels().map(place).zip(known).filter_map(|(place, known)| Some((place, known?)))
        })
    };
    let (mut count, mut sum) = (0.0, 0.0);
    for ((x, y), known) in known_pixels() {
        let spread = &mut spreads[(y / side) as usize * columns + (x / side) as usize];
        *spread = spread.and(&Spread::of_pixel(known));
        (count, sum) = (count + 1.0, sum + known.mean);
    }
    if count == 0.0 {
        return None;
    }
    // Cells at the right and lower edges may reach beyond the picture.
    let size = [columns as u32 * side, height.div_ceil(side) * side];
    let neighbourhoods = Neighbourhoods::new(size, columns, &spreads);
    let floor = FLOOR * (sum / count).max(0.0);
    let (mut squares, mut expected, mut kurtosis, mut samples) = (0.0, 0.0, 0.0, 0.0);
    let relative = |square: f64, luminance: f64| {
        let scale = luminance.max(0.0) + floor;
        // A black picture has no visible noise.
        if scale > 0.0 { square / (scale * scale) } else { 0.0 }
    };
    for ((x, y), known) in known_pixels() {
        let Known { samples: n, mean: luminance, error } = known;
        let around = Spread::of_pixel(known).within(neighbourhoods.at(x, y)).mean;
        // The mean of one or two bright samples is meaningless; that of twenty, as at the edge of a lamp, is not.
        let doubt = (FEW * (error / luminance.max(f64::MIN_POSITIVE)).powi(2)).min(1.0);
        squares += relative(error * error, luminance - doubt * (luminance - around).max(0.0));
        if let Some(adaptive) = adaptive {
            let trial = adaptive.expectation(bounds.x0 + x, bounds.y0 + y);
            expected += relative(trial.variance / n, around.max(trial.mean));
            kurtosis += trial.kurtosis;
            samples += n;
        }
    }
    let square = match samples > 0.0 {
        // The weight of the samples against those of the trial.
        true => {
            let kurtosis = kurtosis / count;
            (samples * squares + kurtosis * expected) / (samples + kurtosis)
        }
        false => squares,
    };
    Some((square / count).sqrt())
}

#[cfg(test)]
mod tests {
    use lumbre_image::Rgb;
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::film::{Addition, Exposure, Extras, Sample};

    /// A tile of 64 by 48 pixels of n samples; a share has this luminance and the rest 0.1, and its noise.
    fn found(n: u32, share: f64, bright: f64) -> f64 {
        let bounds = PixelBounds::whole(64, 48);
        let mut tile = Tile::new(bounds, Extras::default());
        let mut random = RandomStream::new(9);
        for (x, y) in bounds.pixels() {
            for _ in 0..n {
                let value = if random.next_f64() < share { bright } else { 0.1 };
                let radiance = Rgb::splat(value as f32);
                let sample = Sample { radiance, ..Sample::default() };
                assert_eq!(tile.add(x, y, &sample, &Exposure::default()), Addition::Whole);
            }
        }
        noise([&tile].into_iter(), bounds, None).unwrap()
    }

    #[test]
    fn light_that_few_pixels_met_counts_like_light_of_all() {
        for (n, share) in [(64, 0.25), (16, 0.01), (16, 0.001), (32, 3e-4)] {
            let bright = 0.1 + 1.0 / share;
            // The mean is 1.1, and the variance is (bright - 0.1)² pq.
            let expected = ((1.0 - share) / share / f64::from(n)).sqrt() / (1.1 * 1.1);
            let noise = found(n, share, bright);
            println!("{n} {share}: {noise} {expected}");
            assert!(
                (noise / expected - 1.0).abs() < 0.35,
                "{n} samples, 1 in {}: {noise} {expected}",
                1.0 / share
            );
        }
    }

    #[test]
    fn the_edge_of_a_lamp_is_not_rare_light() {
        // The left column is half covered by a lamp of 30; all else is 0.1, without noise.
        let bounds = PixelBounds::whole(64, 48);
        let mut tile = Tile::new(bounds, Extras::default());
        for (x, y) in bounds.pixels() {
            for k in 0..256 {
                let radiance = Rgb::splat(if x == 0 && k % 2 == 0 { 30.0 } else { 0.1 });
                let sample = Sample { radiance, ..Sample::default() };
                assert_eq!(tile.add(x, y, &sample, &Exposure::default()), Addition::Whole);
            }
        }
        // An error of 15 / 16 against a mean of 15, in one pixel of 64.
        let noise = noise([&tile].into_iter(), bounds, None).unwrap();
        assert!((0.0075..0.0083).contains(&noise), "{noise}");
    }
}
