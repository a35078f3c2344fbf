//! A small picture of the whole film, taken before a render to a noise target.

use lumbre_scene::{FilmKind, Scene};
use web_time::Instant;

use crate::film::MAX_LUMINANCE;
use crate::integrators::Integrator;
use crate::neighbourhoods::{Expectation, FLOOR, Moments, Neighbourhoods, Spread, needed};
use crate::one_sample::PixelSampler;
use crate::transport::Record;
use crate::wave::{SampleId, Wave};
use crate::workers::Workers;
use crate::{CancelToken, RenderError, RenderOptions};

/// Pixels along the longer side of the trial picture.
const SIDE: f64 = 64.0;
/// Samples of each of its pixels, at first and at most.
const SPP: u32 = 64;
const MAX_SPP: u32 = 1 << 14;
/// It runs until it has this share of the samples that it predicts for the picture. Light that it still misses is rare
/// even among the samples of the picture.
const SHARE: f64 = 1.0 / 32.0;
/// The trial is not continued after one part in this many of the time limit.
const SHARE_OF_TIME: u32 = 8;
/// A pixel may end when it has this share of the samples among which one of rare light is expected.
const HARDNESS: f64 = 0.25;
/// Minimum samples of a pixel before its noise is checked.
const MIN_SPP: u32 = 16;
/// The same for a hard scene.
const MAX_MIN_SPP: u32 = 256;

/// The mean luminance of the picture, and the expected statistics of the samples of each pixel. It depends on scene and
/// options only, not on crops and threads.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub(crate) mean: f64,
    neighbourhoods: Neighbourhoods,
}

/// A row of the trial picture.
struct Row {
    y: u32,
    pixels: Vec<Moments>,
}

impl Trial {
    /// Takes the trial for a noise target. It is not continued after an eighth of the time until `deadline`, and stops
    /// after half of it.
    pub(crate) fn take(
        scene: &Scene,
        options: &RenderOptions,
        limit: f64,
        integrator: &dyn Integrator,
        cancel: &CancelToken,
        deadline: Option<Instant>,
        workers: &Workers,
    ) -> Result<Self, RenderError> {
        let longer_side = SIDE.min(f64::from(options.width.max(options.height)));
        let film = match options.film {
            // Spectral noise includes that of the wavelengths.
            FilmKind::Spectral(_) => options.film,
            FilmKind::Rgb | FilmKind::GBuffer(_) => FilmKind::Rgb,
        };
        let small = RenderOptions { features: false, guides: false, film, ..options.smaller(longer_side) };
        let pixel_sampler = PixelSampler::new(scene, &small, integrator)?;
        let row = |y| Row { y, pixels: vec![Moments::default(); small.width as usize] };
        let mut rows: Vec<Row> = (0..small.height).map(row).collect();
        let start = Instant::now();
        let is_over = |parts: u32| {
            let share = |end: Instant| end.saturating_duration_since(start) / parts;
            deadline.is_some_and(|end| start.elapsed() >= share(end))
        };
        let (mut first, mut end) = (0, SPP);
        loop {
            workers.for_each(&mut rows, |row| {
                let mut wave = Wave::default();
                for first in (first..end).step_by(SPP as usize) {
                    // Half of the time is for the picture.
                    if cancel.is_cancelled() || is_over(2) {
                        return;
                    }
                    let samples =
                        (0..small.width).flat_map(|x| (first..first + SPP).map(move |index| (x, index)));
                    let ids: Vec<SampleId> =
                        samples.map(|(x, index)| SampleId { x, y: row.y, index }).collect();
                    pixel_sampler.take(&mut wave, &ids, &mut Record::default(), |id, sample| {
                        let luminance =
                            f64::from(small.sample_exposure().colour(sample.radiance).luminance());
                        if luminance.is_finite() {
                            row.pixels[id.x as usize].add(luminance.clamp(0.0, MAX_LUMINANCE));
                        }
                    });
                }
            });
            let spreads: Vec<Spread> = rows.iter().flat_map(|row| &row.pixels).map(Spread::of).collect();
            let trial = Self::new([options.width, options.height], small.width as usize, &spreads);
            let taken = spreads.len() as f64 * f64::from(end);
            let is_enough = taken >= SHARE * trial.cost(limit, options);
            if is_enough || end >= MAX_SPP || cancel.is_cancelled() || is_over(SHARE_OF_TIME) {
                return Ok(trial);
            }
            (first, end) = (end, 2 * end);
        }
    }

    /// From the spreads of the pixels of a small picture, row by row, for a picture of `size` pixels.
    pub(crate) fn new(size: [u32; 2], width: usize, spreads: &[Spread]) -> Self {
        let whole = spreads.iter().fold(Spread::default(), Spread::and);
        Self { mean: whole.expectation().mean, neighbourhoods: Neighbourhoods::new(size, width, spreads) }
    }

    /// The predicted samples of the whole picture.
    fn cost(&self, limit: f64, options: &RenderOptions) -> f64 {
        let floor = FLOOR * self.mean.max(0.0);
        let cells = self.neighbourhoods.all();
        let each = |cell: &Expectation| {
            needed(cell.variance, limit * (cell.mean.max(0.0) + floor)).min(f64::from(options.stop.spp))
        };
        let mean = cells.iter().map(each).sum::<f64>() / cells.len() as f64;
        mean * f64::from(options.width) * f64::from(options.height)
    }

    /// The expected statistics of the samples of a pixel.
    pub(crate) fn at(&self, x: u32, y: u32) -> Expectation {
        self.neighbourhoods.at(x, y)
    }

    /// The default minimum of samples per pixel before its noise is checked: more if rare light is expected in most of
    /// the picture.
    pub(crate) fn min_spp(&self) -> u32 {
        let mut kurtoses: Vec<f64> = self.neighbourhoods.all().iter().map(|cell| cell.kurtosis).collect();
        let middle = kurtoses.len() / 2;
        let (_, &mut median, _) = kurtoses.select_nth_unstable_by(middle, f64::total_cmp);
        // A cast from a float saturates.
        ((HARDNESS * median).ceil() as u32).clamp(MIN_SPP, MAX_MIN_SPP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trial of 8 by 6 pixels of 64 samples; one in `rarity` is bright.
    fn trial(rarity: usize) -> Trial {
        let spread = |pixel: usize| {
            let mut moments = Moments::default();
            (0..64).for_each(|i| moments.add(if (pixel * 64 + i) % rarity == 3 { 50.0 } else { 0.1 }));
            Spread::of(&moments)
        };
        Trial::new([80, 60], 8, &(0..48).map(spread).collect::<Vec<_>>())
    }

    #[test]
    fn hard_scenes_get_more_samples_before_a_pixel_may_end() {
        let found = [2, 40, 400, 1 << 20].map(|rarity| trial(rarity).min_spp());
        assert!(found[0] == 16 && found[1] == 16, "{found:?}");
        assert!((60..=140).contains(&found[2]), "{found:?}");
    }

    #[test]
    fn the_cost_is_that_of_the_noise_that_is_wanted() {
        let mut options = RenderOptions::default();
        (options.width, options.height, options.stop.spp) = (80, 60, 1 << 20);
        // A variance of pq 49.9² for a mean of 0.1 + 49.9 p, and a tenth of it.
        let p = 1.0 / 40.0;
        let each = p * (1.0 - p) * 49.9_f64.powi(2) / (0.05 * 1.1 * (0.1 + 49.9 * p)).powi(2);
        let found = trial(40).cost(0.05, &options) / 4800.0;
        assert!((found / each - 1.0).abs() < 0.1, "{found} {each}");
        options.stop.spp = 100;
        assert_eq!(trial(40).cost(0.05, &options), 480_000.0);
    }
}
