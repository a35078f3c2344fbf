//! The render loop: passes over samples, tiles over threads.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use lumbre_math::{DVec3, Elementary};
use lumbre_scene::{FilmKind, Scene, View};
use web_time::Instant;

use crate::adaptive::{self, Adaptive};
use crate::clock::Clock;
use crate::film::{Addition, Extras, Tile};
use crate::integrators::{Integrator, integrator};
use crate::noise::noise;
use crate::one_sample::PixelSampler;
use crate::rendered::{picture, rendered_of};
use crate::state::{Piece, REMEMBERED, RenderState};
use crate::transport::{RayCounts, Record};
use crate::trial::Trial;
use crate::wave::{SampleId, WAVE, Wave};
use crate::workers::Workers;
use crate::{
    CancelToken, DroppedSample, PixelBounds, Progress, RenderError, RenderOptions, Rendered, Snapshot, Stats,
};

/// Pixels along the side of a tile.
const TILE: u32 = 16;
/// The longest pass has one sample in this many of those already taken, if that is more.
const MAX_STEP: u32 = 16;
const LONG: u32 = 64;
/// The first pass takes one sample in each square of this many pixels a side, and then of smaller ones, so that an
/// interrupted render is still a whole, coarse picture.
const STRIDES: [u32; 7] = [256, 64, TILE, 8, 4, 2, 1];
/// The clock never stops a coarse picture with fewer samples: a small picture is better than none.
const UNSTOPPED: u64 = 8192;
/// Maximum samples of a wave if a clock or a pause may stop the render: a few milliseconds.
const WAVE_BY_THE_CLOCK: usize = 1024;

/// Renders a picture. It stops when the options say so or `cancel` is set, and returns the result so far.
///
/// The pixels depend only on the scene and the options; but which samples are taken before the clock or `cancel` stops
/// a render depends on the machine.
///
/// # Errors
/// [`RenderError`] for options that make no picture, and if `progress` rejects it.
pub fn render(
    scene: &Scene,
    options: &RenderOptions,
    progress: &dyn Progress,
    cancel: &CancelToken,
) -> Result<Rendered, RenderError> {
    render_with(scene, options, &*integrator(&options.integrator), progress, cancel)
}

/// [`render`] with a custom integrator; that of the options is ignored.
///
/// # Errors
/// As [`render`].
pub fn render_with(
    scene: &Scene,
    options: &RenderOptions,
    integrator: &dyn Integrator,
    progress: &dyn Progress,
    cancel: &CancelToken,
) -> Result<Rendered, RenderError> {
    Ok(render_from(scene, options, integrator, progress, cancel, None, None)?.0)
}

/// Receives the state of a render at intervals.
pub struct CheckpointSink<'a> {
    /// The interval.
    pub every: Duration,
    /// Called on one thread while the others wait: it should be quick.
    pub keep: &'a dyn Fn(RenderState),
}

impl std::fmt::Debug for CheckpointSink<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CheckpointSink").field("every", &self.every).finish_non_exhaustive()
    }
}

/// [`render_with`], resumed from the state of the same render; also returns the final state. The picture is that of an
/// uninterrupted render.
///
/// # Errors
/// As [`render`], and [`RenderError::OtherState`] if the state has other pixels, samples or sums.
pub fn render_from(
    scene: &Scene,
    options: &RenderOptions,
    integrator: &dyn Integrator,
    progress: &dyn Progress,
    cancel: &CancelToken,
    state: Option<RenderState>,
    sink: Option<&CheckpointSink<'_>>,
) -> Result<(Rendered, RenderState), RenderError> {
    let start = Instant::now();
    let bounds = options.bounds()?;
    let pixel_sampler = PixelSampler::new(scene, options, integrator)?;
    let spp = options.stop.spp.max(1);
    let extras = extras_of(scene, options, &pixel_sampler.view);
    let mut tiles = match state {
        Some(state) => tiles_of(state, bounds, extras, options.first_sample)?,
        None => bounds.tiles(TILE).into_iter().map(|tile| TileState::new(Tile::new(tile, extras))).collect(),
    };
    let before = tiles
        .iter()
        .flat_map(|tile_state| tile_state.tile.pixels())
        .map(|pixel| u64::from(pixel.taken))
        .sum();
    let workers = Workers::start(options.threads);
    let deadline = options.stop.time.and_then(|time| start.checked_add(time));
    let adaptive = match options.stop.noise {
        Some(limit) => {
            let trial = Trial::take(scene, options, limit, integrator, cancel, deadline, &workers)?;
            Some(Adaptive::new(limit, options.stop.min_spp, trial))
        }
        None => None,
    };
    let job = Job {
        options,
        pixel_sampler,
        bounds,
        adaptive,
        deadline,
        cancel,
        pause: sink.map(|sink| Pause::new(start, sink.every)),
        clock: Clock::new(start, start.elapsed(), bounds.area(), options.stop, before, progress),
        waves: Mutex::default(),
    };
    job.expect_quiet(&tiles);
    let hand_over = |tiles: &[TileState]| {
        if let (Some(sink), Some(pause)) = (sink, &job.pause) {
            (sink.keep)(state_of(tiles.to_vec(), bounds, options));
            pause.start_again();
        }
    };
    let stride = job.take_coarse_passes(&workers, &mut tiles, &hand_over);
    if stride == Some(1) {
        // The earlier run has reported its own samples.
        let done = if before > 0 { job.least_wanted(&tiles).unwrap_or(spp).min(spp) } else { 0 };
        job.take_passes(&workers, &mut tiles, done, progress, &hand_over);
    }
    if !progress.is_wanted() {
        return Err(RenderError::Unwanted);
    }
    progress.stopped(stride);
    let spread = stride.filter(|side| *side > 1).map(|side| spread(&tiles, bounds, side));
    let is_done = job.has(&tiles, spp);
    let state = state_of(tiles, bounds, options);
    let shown = spread.as_ref().unwrap_or(&state.tiles);
    let rendered = rendered_of(shown.iter(), bounds, options.transparent, extras);
    let stats = Stats {
        spp: state.least_samples(),
        most_spp: state.most_samples(),
        stride,
        cancelled: cancel.is_cancelled() && !is_done,
        samples: state.rays.camera,
        rays: state.rays,
        dropped: state.dropped,
        clamped: state.clamped,
        first_dropped: state.first_dropped.clone(),
        noise: noise(state.tiles.iter(), bounds, job.adaptive.as_ref()),
        noise_target: options.stop.noise,
        noisy_pixels: job.adaptive.as_ref().map_or(0, |adaptive| adaptive.noisy_pixels(&state.tiles)),
        threads: workers.count(),
        refused_threads: workers.refused(),
        elapsed: start.elapsed(),
    };
    Ok((Rendered { stats, ..rendered }, state))
}

/// What the film keeps besides colours.
fn extras_of(scene: &Scene, options: &RenderOptions, view: &View) -> Extras {
    let catches_shadows = scene.ground().is_some_and(|ground| ground.catcher);
    Extras {
        features: options.features,
        tints: options.transparent && catches_shadows,
        guides: options.guides,
        surfaces: matches!(options.film, FilmKind::GBuffer(_)),
        buckets: match options.film {
            FilmKind::Spectral(buckets) => Some(buckets),
            FilmKind::Rgb | FilmKind::GBuffer(_) => None,
        },
        depth_unit: depth_unit(scene, view),
    }
}

/// The samples of the pixel with the fewest.
fn least_taken(tiles: &[TileState]) -> u32 {
    tiles.iter().map(|tile_state| tile_state.tile.least_taken()).min().unwrap_or(0)
}

/// The sample count at which a render next checks its noise and shows its progress: the same after any interruptions.
fn next_count(done: u32) -> u32 {
    if done < MAX_STEP {
        return (done + 1).next_power_of_two();
    }
    let step = (done / 8).next_power_of_two().min(MAX_STEP).max(power_of_two_below(done / LONG));
    (done / step + 1) * step
}

/// The largest power of two that is not above a number; 0 for 0.
fn power_of_two_below(number: u32) -> u32 {
    if number == 0 { 0 } else { 1 << number.ilog2() }
}

/// A power of two near the largest depth that there may be.
fn depth_unit(scene: &Scene, view: &View) -> f64 {
    let bounds = scene.bounds();
    let reach = if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() };
    let camera = view.depth(DVec3::ZERO, view.time(0.5)).abs();
    let farthest = 4.0 * reach + camera;
    let unit = farthest.max(f64::MIN_POSITIVE).logarithm_2().ceil().exponential_2();
    if unit.is_normal() { unit } else { 1.0 }
}

/// The tiles of a state, whose counters go to the first.
fn tiles_of(
    state: RenderState,
    bounds: PixelBounds,
    extras: Extras,
    first_sample: u32,
) -> Result<Vec<TileState>, RenderError> {
    let is_same = state.bounds() == bounds
        && state.extras() == extras
        && state.pieces.iter().all(|piece| piece.bounds == bounds)
        && state.pieces.len() == 1
        && state.pieces[0].samples.start == first_sample;
    if !is_same {
        return Err(RenderError::OtherState);
    }
    let places = bounds.tiles(TILE);
    // Tiles of a render that continues in the same process are moved, not copied: they may take gigabytes.
    let are_in_place = state.tiles.iter().map(Tile::bounds).eq(places.iter().copied());
    let tiles = if are_in_place { state.tiles } else { placed(state.tiles, &places, extras) };
    let mut tiles: Vec<TileState> = tiles.into_iter().map(TileState::new).collect();
    if let Some(tile_state) = tiles.first_mut() {
        (tile_state.record.counts, tile_state.dropped, tile_state.clamped) =
            (state.rays, state.dropped, state.clamped);
        tile_state.first_dropped = state.first_dropped;
    }
    Ok(tiles)
}

/// Moves the sums of tiles into others, which are in rows from above. Each source is dropped as soon as everything is
/// taken from it.
fn placed(tiles: Vec<Tile>, places: &[PixelBounds], extras: Extras) -> Vec<Tile> {
    let mut rest = tiles;
    let mut above = 0;
    let take = |place: &PixelBounds| {
        if place.y0 > above {
            above = place.y0;
            rest.retain(|tile| tile.bounds().y1 > above);
        }
        let mut tile = Tile::new(*place, extras);
        rest.iter().for_each(|from| tile.take(from));
        tile
    };
    places.iter().map(take).collect()
}

/// The state of all tiles.
fn state_of(tiles: Vec<TileState>, bounds: PixelBounds, options: &RenderOptions) -> RenderState {
    let mut rays = RayCounts::default();
    let mut first_dropped: Vec<DroppedSample> = Vec::new();
    for tile_state in &tiles {
        rays += tile_state.record.counts;
        first_dropped.extend(&tile_state.first_dropped);
    }
    first_dropped.sort_unstable_by_key(|d| (d.sample, d.y, d.x));
    first_dropped.truncate(REMEMBERED);
    let first = options.first_sample;
    let wanted = options.stop.spp.max(1);
    RenderState {
        bounds,
        pieces: vec![Piece { bounds, samples: first..first.saturating_add(wanted) }],
        rays,
        dropped: tiles.iter().map(|tile_state| tile_state.dropped).sum(),
        clamped: tiles.iter().map(|tile_state| tile_state.clamped).sum(),
        first_dropped,
        tiles: tiles.into_iter().map(|tile_state| tile_state.tile).collect(),
    }
}

/// The tiles; each pixel without a sample has that of its square of `side` by `side` pixels.
fn spread(tiles: &[TileState], bounds: PixelBounds, side: u32) -> Vec<Tile> {
    let columns = bounds.width().div_ceil(TILE) as usize;
    let mut tiles: Vec<Tile> = tiles.iter().map(|tile_state| tile_state.tile.clone()).collect();
    if side > TILE {
        let step = (side / TILE) as usize;
        let corners: Vec<Tile> = tiles.iter().map(Tile::corner).collect();
        for (i, tile) in tiles.iter_mut().enumerate() {
            let (column, row) = (i % columns, i / columns);
            tile.take_corner(&corners[(row - row % step) * columns + (column - column % step)]);
        }
    }
    tiles.iter_mut().for_each(|tile| tile.spread(side.min(TILE)));
    tiles
}

/// Shared, constant data of all tiles.
struct Job<'a> {
    options: &'a RenderOptions,
    pixel_sampler: PixelSampler<'a>,
    bounds: PixelBounds,
    /// When a pixel has enough samples; `None` to take the same number everywhere.
    adaptive: Option<Adaptive>,
    deadline: Option<Instant>,
    cancel: &'a CancelToken,
    pause: Option<Pause>,
    clock: Clock<'a>,
    /// Columns for sampling threads, one for each.
    waves: Mutex<Vec<Wave<'a>>>,
}

/// The next pause of all threads, to save the state.
struct Pause {
    start: Instant,
    every: Duration,
    /// Milliseconds after the start.
    at: AtomicU64,
}

impl Pause {
    fn new(start: Instant, every: Duration) -> Self {
        let pause = Self { start, every, at: AtomicU64::new(0) };
        pause.start_again();
        pause
    }

    fn start_again(&self) {
        let at = (self.start.elapsed() + self.every).as_millis();
        self.at.store(u64::try_from(at).unwrap_or(u64::MAX), Ordering::Relaxed);
    }

    fn is_due(&self) -> bool {
        self.start.elapsed().as_millis() >= u128::from(self.at.load(Ordering::Relaxed))
    }
}

/// A tile and its owner's counters.
#[derive(Clone)]
struct TileState {
    tile: Tile,
    /// The side of the smallest squares that the first pass has done.
    next_side: u32,
    /// Whether it has taken a sample since the last pause.
    has_worked: bool,
    record: Record,
    dropped: u64,
    clamped: u64,
    first_dropped: Vec<DroppedSample>,
}

impl TileState {
    fn new(tile: Tile) -> Self {
        Self {
            tile,
            next_side: u32::MAX,
            has_worked: false,
            record: Record::default(),
            dropped: 0,
            clamped: 0,
            first_dropped: Vec::new(),
        }
    }
}

impl Job<'_> {
    /// Takes one sample in each square, of ever smaller sides, then one in each pixel. Returns the side of the last
    /// whole pass; `None` if even the first was stopped. `hand_over` receives the tiles at each pause.
    fn take_coarse_passes(
        &self,
        workers: &Workers,
        tiles: &mut [TileState],
        hand_over: &dyn Fn(&[TileState]),
    ) -> Option<u32> {
        if least_taken(tiles) >= 1 {
            return Some(1);
        }
        let corner = (self.bounds.x0, self.bounds.y0);
        let mut last = None;
        for side in STRIDES {
            loop {
                workers.for_each(tiles, |tile_state| self.run_coarsely(tile_state, corner, side, last));
                if self.must_stop_at(side) || tiles.iter().all(|tile_state| tile_state.next_side <= side) {
                    break;
                }
                hand_over(tiles);
            }
            if tiles.iter().any(|tile_state| tile_state.next_side > side) {
                break;
            }
            last = Some(side);
        }
        last
    }

    /// Takes passes over all pixels, from `done` samples on, until there are enough or it must stop. `hand_over`
    /// receives the tiles at each pause.
    fn take_passes(
        &self,
        workers: &Workers,
        tiles: &mut [TileState],
        mut done: u32,
        progress: &dyn Progress,
        hand_over: &dyn Fn(&[TileState]),
    ) {
        let spp = self.options.stop.spp.max(1);
        while done < spp {
            let end = next_count(done).min(spp);
            loop {
                workers.for_each(tiles, |tile_state| self.run(tile_state, end));
                if self.must_stop() || self.has(tiles, end) {
                    break;
                }
                hand_over(tiles);
            }
            if !self.has(tiles, end) {
                return;
            }
            done = end;
            if self.must_stop() {
                // The rest takes time for a large picture.
                return;
            }
            let film = || tiles.iter().map(|tile_state| &tile_state.tile);
            progress.pass(&Snapshot {
                spp: done,
                noise: noise(film(), self.bounds, self.adaptive.as_ref()),
                picture: &|| picture(film(), self.bounds, self.options.transparent),
            });
            self.expect_quiet(tiles);
            if self.must_stop() || self.least_wanted(tiles).is_none() {
                return;
            }
        }
    }

    /// Predicts the end of a render to a noise target.
    fn expect_quiet(&self, tiles: &[TileState]) {
        let Some(adaptive) = &self.adaptive else { return };
        let spp = self.options.stop.spp.max(1);
        let pixels = tiles
            .iter()
            .flat_map(|tile_state| tile_state.tile.bounds().pixels().zip(tile_state.tile.pixels()));
        let expected: f64 = pixels.map(|((x, y), pixel)| adaptive.expected(x, y, pixel, spp)).sum();
        self.clock.expect_quiet_at(expected / self.bounds.area() as f64);
    }

    /// The fewest samples of a pixel that needs more; `None` if none does.
    fn least_wanted(&self, tiles: &[TileState]) -> Option<u32> {
        tiles
            .iter()
            .filter_map(|tile_state| adaptive::least_wanted(&tile_state.tile, self.adaptive.as_ref()))
            .min()
    }

    /// Whether all pixels that need more have this many samples.
    fn has(&self, tiles: &[TileState], samples: u32) -> bool {
        self.least_wanted(tiles).is_none_or(|least| least >= samples)
    }

    /// Whether the squares of this side must stop. The clock stops neither the first squares nor few samples: see
    /// [`UNSTOPPED`].
    fn must_stop_at(&self, side: u32) -> bool {
        let count = self.bounds.area().div_ceil(u64::from(side) * u64::from(side));
        if side == STRIDES[0] || count <= UNSTOPPED { self.cancel.is_cancelled() } else { self.must_stop() }
    }

    fn must_stop(&self) -> bool {
        self.cancel.is_cancelled() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    fn is_paused(&self) -> bool {
        self.pause.as_ref().is_some_and(Pause::is_due)
    }

    /// Takes the first sample of the first pixel of each square of `side` by `side` pixels in the tile, counted from
    /// the corner of the picture, unless the last side's squares have it.
    fn run_coarsely(&self, tile_state: &mut TileState, corner: (u32, u32), side: u32, last: Option<u32>) {
        let starts = |x: u32, y: u32, side: u32| {
            (x - corner.0).is_multiple_of(side) && (y - corner.1).is_multiple_of(side)
        };
        let is_new = |x, y| starts(x, y, side) && !last.is_some_and(|last| starts(x, y, last));
        if self.take(tile_state, 0..1, is_new, || self.must_stop_at(side)) {
            tile_state.next_side = side;
        }
    }

    /// Takes the samples of every pixel of a tile up to this number. A wave takes the same sample numbers of all
    /// pixels, so that an interrupted tile has all of one sample before any of the next.
    fn run(&self, tile_state: &mut TileState, end: u32) {
        let may_stop = self.deadline.is_some() || self.pause.is_some();
        let most = if may_stop { WAVE_BY_THE_CLOCK } else { WAVE };
        let Some(mut first) = adaptive::least_wanted(&tile_state.tile, self.adaptive.as_ref()) else {
            return;
        };
        while first < end {
            let wanting = adaptive::wanting(&tile_state.tile, self.adaptive.as_ref()).count();
            let step = (most / wanting.max(1)).max(1) as u32;
            let mut next = first.saturating_add(step).min(end);
            if let Some(adaptive) = &self.adaptive {
                next = next.min(adaptive.next_look(first));
            }
            if !self.take(tile_state, first..next, |_, _| true, || self.must_stop()) {
                return;
            }
            first = next;
        }
    }

    /// Takes these sample numbers in the pixels of a tile that lack and need them; false if it had to stop first.
    fn take(
        &self,
        tile_state: &mut TileState,
        numbers: Range<u32>,
        is_wanted: impl Fn(u32, u32) -> bool,
        must_stop: impl Fn() -> bool,
    ) -> bool {
        let mut ids = Vec::new();
        for number in numbers {
            for (x, y) in tile_state.tile.bounds().pixels() {
                let pixel = tile_state.tile.pixel(x, y);
                let has_enough =
                    || self.adaptive.as_ref().is_some_and(|adaptive| adaptive.is_done(x, y, pixel));
                if pixel.taken <= number && is_wanted(x, y) && !has_enough() {
                    ids.push(SampleId { x, y, index: self.options.first_sample.saturating_add(number) });
                }
            }
        }
        if ids.is_empty() {
            return true;
        }
        // Makes progress even if pauses are frequent.
        if must_stop() || (tile_state.has_worked && self.is_paused()) {
            tile_state.has_worked = false;
            return false;
        }
        tile_state.has_worked = true;
        let rays = tile_state.record.counts.total();
        let mut wave = self.waves.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        let TileState { tile, record, dropped, clamped, first_dropped, .. } = tile_state;
        let exposure = self.options.sample_exposure();
        self.pixel_sampler.take(&mut wave, &ids, record, |SampleId { x, y, index }, sample| {
            match tile.add(x, y, &sample, &exposure) {
                Addition::Whole => {}
                Addition::Clamped => *clamped += 1,
                Addition::Dropped => {
                    *dropped += 1;
                    if first_dropped.len() < REMEMBERED {
                        first_dropped.push(DroppedSample { x, y, sample: index });
                    }
                }
            }
        });
        self.waves.lock().unwrap_or_else(PoisonError::into_inner).push(wave);
        self.clock.add(ids.len() as u64, tile_state.record.counts.total() - rays);
        true
    }
}
