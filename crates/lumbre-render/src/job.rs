//! The render itself: passes over samples, tiles over threads.

use std::time::Instant;

use lumbre_math::DVec2;
use lumbre_scene::{Scene, View};

use crate::clock::Clock;
use crate::film::{Extras, FeatureSample, Filter, Sample, Tile};
use crate::rendered::{coverage_picture, feature_picture, guides, noise, picture};
use crate::transport::{Feature, Features, Integrator, RayCounts, Sampler, Sight, integrator, see};
use crate::workers::Workers;
use crate::{CancelToken, DroppedSample, Progress, RenderError, RenderOptions, Rendered, Snapshot, Stats};

/// Pixels along the side of a tile.
const TILE: u32 = 16;
/// Samples of the longest pass.
const MAX_PASS: u32 = 16;
/// Samples a pixel before its noise is looked at: two or three say little.
const LEAST_FOR_NOISE: u32 = 8;
/// Dropped samples that are remembered by place.
const REMEMBERED: usize = 16;
/// The first pass goes over the picture in squares of so many pixels a side, one sample in each, and then in smaller ones, so that a
/// render which is stopped in it is a whole picture, if a coarse one.
const STRIDES: [u32; 7] = [256, 64, TILE, 8, 4, 2, 1];
/// Pixels between two looks at the clock.
const PIXELS_A_LOOK: usize = 4;

/// Renders a picture: stops when the options say so, or when `cancel` asks, and returns what there is.
///
/// The pixels depend on the scene and the options alone; but which samples are taken before the clock or `cancel` stops
/// a render depends on the machine.
///
/// # Errors
/// [`RenderError`] for options that make no picture.
pub fn render(
    scene: &Scene,
    options: &RenderOptions,
    progress: &dyn Progress,
    cancel: &CancelToken,
) -> Result<Rendered, RenderError> {
    render_with(scene, options, &*integrator(&options.integrator), progress, cancel)
}

/// [`render`] with an integrator of one's own; that of the options is not looked at.
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
    let start = Instant::now();
    let bounds = options.bounds()?;
    let camera = scene
        .cameras()
        .get(options.camera)
        .ok_or(RenderError::NoSuchCamera { index: options.camera, count: scene.cameras().len() })?;
    let workers = Workers::start(options.threads);
    let spp = options.stop.spp.max(1);
    let view = View::new(camera, options.width, options.height);
    let job = Job {
        scene,
        options,
        moves: scene.moves() || view.moves(),
        view,
        integrator,
        sampler: Sampler::new(&options.sampler),
        filter: options.pixel_filter()?,
        // Textures may be looked up more finely the more samples there are to average them (pbrt does likewise).
        spacing: f64::from(spp).sqrt().recip().max(0.125),
        deadline: options.stop.time.and_then(|time| start.checked_add(time)),
        cancel,
        clock: Clock::new(start, bounds.area(), options.stop, progress),
    };
    let catches_shadows = scene.ground().is_some_and(|ground| ground.catcher);
    let extras = Extras {
        features: options.features || options.guides,
        tints: options.transparent && catches_shadows,
        guides: options.guides,
    };
    let mut owners: Vec<Owner> =
        bounds.tiles(TILE).into_iter().map(|tile| Owner::new(Tile::new(tile, extras))).collect();

    let mut done = 0;
    let mut stride = None;
    let mut last = None;
    for side in STRIDES {
        workers.for_each(&mut owners, |owner| job.run_coarsely(owner, (bounds.x0, bounds.y0), side, last));
        last = Some(side);
        if owners.iter().any(|owner| owner.next_side > side) {
            break;
        }
        stride = Some(side);
    }
    if let Some(side) = stride.filter(|side| *side > 1) {
        spread(&mut owners, bounds.width().div_ceil(TILE) as usize, side);
    }
    let mut quiet_at = None;
    while done < spp && stride == Some(1) {
        // Short passes first, so that there is soon something to see; the length never matters for the picture. None goes far
        // beyond the noise that is asked for.
        let most = quiet_at.map_or(MAX_PASS, |quiet: f64| (quiet - f64::from(done)).ceil().max(1.0) as u32);
        let pass = done.clamp(1, MAX_PASS).min(most).min(spp - done);
        let samples = done..done + pass;
        if done > 0 {
            workers.for_each(&mut owners, |owner| job.run(owner, samples.clone()));
        }
        if job.must_stop() && owners.iter().any(|owner| owner.next_sample < samples.end) {
            break;
        }
        done += pass;
        if job.must_stop() {
            // What follows takes its time for a large picture.
            break;
        }
        let tiles = || owners.iter().map(|owner| &owner.tile);
        let reached = noise(tiles());
        progress.pass(&Snapshot {
            spp: done,
            noise: reached,
            picture: &|| picture(tiles(), bounds, options.transparent),
        });
        if let (Some(limit), Some(noise)) = (options.stop.noise, reached)
            && done >= LEAST_FOR_NOISE / 2
        {
            // Noise falls with the square root of the number of samples.
            let expected = (f64::from(done) * (noise / limit).powi(2)).max(f64::from(LEAST_FOR_NOISE));
            quiet_at = Some(expected);
            job.clock.expect_quiet_at(expected);
        }
        let is_quiet = matches!((options.stop.noise, reached), (Some(limit), Some(noise)) if noise <= limit);
        if job.must_stop() || (is_quiet && done >= LEAST_FOR_NOISE) {
            break;
        }
    }

    progress.stopped(stride);
    let tiles = || owners.iter().map(|owner| &owner.tile);
    let mut rays = RayCounts::default();
    let mut first_dropped: Vec<DroppedSample> = Vec::new();
    for owner in &owners {
        rays += owner.rays;
        first_dropped.extend(&owner.first_dropped);
    }
    first_dropped.sort_unstable_by_key(|d| (d.sample, d.y, d.x));
    first_dropped.truncate(REMEMBERED);
    let wanted: &[Feature] =
        if extras.features { &[Feature::Albedo, Feature::Normal, Feature::Depth, Feature::Uv] } else { &[] };
    Ok(Rendered {
        image: picture(tiles(), bounds, options.transparent),
        coverage: coverage_picture(tiles(), bounds),
        bounds,
        features: wanted.iter().map(|&f| (f, feature_picture(tiles(), bounds, f))).collect(),
        guides: options.guides.then(|| guides(tiles(), bounds)),
        stats: Stats {
            spp: done,
            stride,
            cancelled: cancel.is_cancelled() && done < spp,
            samples: rays.camera,
            rays,
            dropped: owners.iter().map(|owner| owner.dropped).sum(),
            first_dropped,
            noise: noise(tiles()),
            threads: workers.count(),
            refused_threads: workers.refused(),
            elapsed: start.elapsed(),
        },
    })
}

/// Gives every pixel that has no sample that of its square of `side` by `side` pixels; the tiles stand in rows of `columns`.
fn spread(owners: &mut [Owner], columns: usize, side: u32) {
    if side > TILE {
        let step = (side / TILE) as usize;
        let corners: Vec<Tile> = owners.iter().map(|owner| owner.tile.corner()).collect();
        for (i, owner) in owners.iter_mut().enumerate() {
            let (column, row) = (i % columns, i / columns);
            owner.tile.take_corner(&corners[(row - row % step) * columns + (column - column % step)]);
        }
    }
    owners.iter_mut().for_each(|owner| owner.tile.spread(side.min(TILE)));
}

/// What every tile needs and none changes.
struct Job<'a> {
    scene: &'a Scene,
    options: &'a RenderOptions,
    view: View,
    /// Whether it matters when a ray looks.
    moves: bool,
    integrator: &'a dyn Integrator,
    sampler: Sampler,
    filter: Filter,
    spacing: f64,
    deadline: Option<Instant>,
    cancel: &'a CancelToken,
    clock: Clock<'a>,
}

/// A tile and what its one owner counts.
struct Owner {
    tile: Tile,
    /// All samples before this one are in every pixel of the tile.
    next_sample: u32,
    /// The side of the smallest squares that the first pass has done.
    next_side: u32,
    rays: RayCounts,
    dropped: u64,
    first_dropped: Vec<DroppedSample>,
}

impl Owner {
    fn new(tile: Tile) -> Self {
        Self {
            tile,
            next_sample: 0,
            next_side: u32::MAX,
            rays: RayCounts::default(),
            dropped: 0,
            first_dropped: Vec::new(),
        }
    }
}

impl Job<'_> {
    fn must_stop(&self) -> bool {
        self.cancel.is_cancelled() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Takes the first sample of the first pixel of each square of `side` by `side` pixels, counted from the corner of the picture,
    /// that is in the tile, unless it was taken for the squares of the last side.
    fn run_coarsely(&self, owner: &mut Owner, corner: (u32, u32), side: u32, last: Option<u32>) {
        let starts = |x: u32, y: u32, side: u32| {
            (x - corner.0).is_multiple_of(side) && (y - corner.1).is_multiple_of(side)
        };
        let is_new = |x, y| starts(x, y, side) && !last.is_some_and(|last| starts(x, y, last));
        if self.take(owner, owner.tile.bounds().pixels().filter(|&(x, y)| is_new(x, y)), 0) {
            owner.next_side = side;
            owner.next_sample = u32::from(side == 1);
        }
    }

    /// Takes some samples of every pixel of a tile, sample by sample, so that a tile which is stopped has all of one
    /// sample before it has any of the next.
    fn run(&self, owner: &mut Owner, samples: std::ops::Range<u32>) {
        for index in samples {
            if !self.take(owner, owner.tile.bounds().pixels(), index) {
                return;
            }
            owner.next_sample = index + 1;
        }
    }

    /// Takes a sample of each of some pixels of a tile; whether it has done so before it had to stop.
    fn take(&self, owner: &mut Owner, pixels: impl Iterator<Item = (u32, u32)>, index: u32) -> bool {
        let mut count = 0;
        for (i, (x, y)) in pixels.enumerate() {
            if self.cancel.is_cancelled() || (i.is_multiple_of(PIXELS_A_LOOK) && self.must_stop()) {
                return false;
            }
            self.sample(owner, x, y, index);
            count += 1;
        }
        self.clock.add(count);
        true
    }

    fn sample(&self, owner: &mut Owner, x: u32, y: u32, index: u32) {
        let draw = self.sampler.draw(x, y, index);
        let place = self.filter.sample(draw.filter());
        let film = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) + place.offset;
        let part = if self.moves { draw.time() } else { 0.0 };
        let ray = self.view.ray(film, draw.lens(), self.view.time(part), self.spacing);
        let sight = Sight::new(self.scene, ray, &mut owner.rays);
        let features = if self.options.features || self.options.guides {
            Features::of(&self.view, &sight).map(feature_sample)
        } else {
            None
        };
        let lights_are_seen = !self.options.transparent;
        let seen =
            see(self.integrator, self.scene, &self.view, sight, &draw, lights_are_seen, &mut owner.rays);
        let sample = Sample {
            radiance: seen.radiance,
            coverage: seen.coverage,
            weight: place.weight,
            features,
            on_catcher: seen.on_catcher,
        };
        if !owner.tile.add(x, y, &sample, &self.options.exposure) {
            owner.dropped += 1;
            if owner.first_dropped.len() < REMEMBERED {
                owner.first_dropped.push(DroppedSample { x, y, sample: index });
            }
        }
    }
}

fn feature_sample(features: Features) -> FeatureSample {
    FeatureSample {
        albedo: features.albedo,
        normal: features.normal.to_array(),
        depth: features.depth,
        uv: features.uv.to_array(),
    }
}
