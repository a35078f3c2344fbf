//! The render itself: passes over samples, tiles over threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use lumbre_math::DVec2;
use lumbre_scene::{Scene, View};
use rayon::prelude::*;

use crate::film::{Extras, FeatureSample, Filter, Sample, Tile};
use crate::rendered::{coverage_picture, feature_picture, noise, picture};
use crate::transport::{Feature, Features, Integrator, RayCounts, Sampler, Sight, integrator, see};
use crate::{
    CancelToken, DroppedSample, Progress, RenderError, RenderOptions, Rendered, Snapshot, State, Stats,
};

/// Pixels along the side of a tile.
const TILE: u32 = 16;
/// Samples of the longest pass.
const MAX_PASS: u32 = 16;
/// Dropped samples that are remembered by place.
const REMEMBERED: usize = 16;
/// Time between two reports.
const REPORT_EVERY: Duration = Duration::from_millis(100);

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
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|error| RenderError::Threads(error.to_string()))?;
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
        clock: Clock {
            start,
            done: AtomicU64::new(0),
            total: bounds.area() * u64::from(spp),
            last: Mutex::new(start),
            progress,
        },
    };
    let catches_shadows = scene.ground().is_some_and(|ground| ground.catcher);
    let extras = Extras { features: options.features, tints: options.transparent && catches_shadows };
    let mut owners: Vec<Owner> =
        bounds.tiles(TILE).into_iter().map(|tile| Owner::new(Tile::new(tile, extras))).collect();

    let mut done = 0;
    while done < spp {
        // Short passes first, so that there is soon something to see; the length never matters for the picture.
        let pass = done.clamp(1, MAX_PASS).min(spp - done);
        let samples = done..done + pass;
        pool.install(|| owners.par_iter_mut().for_each(|owner| job.run(owner, samples.clone())));
        if job.must_stop() && owners.iter().any(|owner| owner.next_sample < samples.end) {
            break;
        }
        done += pass;
        let tiles = || owners.iter().map(|owner| &owner.tile);
        let reached = noise(tiles());
        progress.pass(&Snapshot {
            spp: done,
            noise: reached,
            picture: &|| picture(tiles(), bounds, options.transparent),
        });
        let is_quiet = matches!((options.stop.noise, reached), (Some(limit), Some(noise)) if noise <= limit);
        // Two or three samples say little about noise.
        if job.must_stop() || (is_quiet && done >= 8) {
            break;
        }
    }

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
        if options.features { &[Feature::Albedo, Feature::Normal, Feature::Depth, Feature::Uv] } else { &[] };
    Ok(Rendered {
        image: picture(tiles(), bounds, options.transparent),
        coverage: coverage_picture(tiles(), bounds),
        bounds,
        features: wanted.iter().map(|&f| (f, feature_picture(tiles(), bounds, f))).collect(),
        stats: Stats {
            spp: done,
            cancelled: cancel.is_cancelled() && done < spp,
            samples: rays.camera,
            rays,
            dropped: owners.iter().map(|owner| owner.dropped).sum(),
            first_dropped,
            noise: noise(tiles()),
            threads: pool.current_num_threads(),
            elapsed: start.elapsed(),
        },
    })
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
    rays: RayCounts,
    dropped: u64,
    first_dropped: Vec<DroppedSample>,
}

impl Owner {
    fn new(tile: Tile) -> Self {
        Self { tile, next_sample: 0, rays: RayCounts::default(), dropped: 0, first_dropped: Vec::new() }
    }
}

impl Job<'_> {
    fn must_stop(&self) -> bool {
        self.cancel.is_cancelled() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Takes some samples of every pixel of a tile, sample by sample, so that a tile which is stopped has all of one
    /// sample before it has any of the next.
    fn run(&self, owner: &mut Owner, samples: std::ops::Range<u32>) {
        for index in samples {
            if self.must_stop() {
                return;
            }
            let bounds = owner.tile.bounds();
            for (x, y) in bounds.pixels() {
                self.sample(owner, x, y, index);
            }
            owner.next_sample = index + 1;
            self.clock.add(bounds.area());
        }
    }

    fn sample(&self, owner: &mut Owner, x: u32, y: u32, index: u32) {
        let draw = self.sampler.draw(x, y, index);
        let place = self.filter.sample(draw.filter());
        let film = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) + place.offset;
        let part = if self.moves { draw.time() } else { 0.0 };
        let ray = self.view.ray(film, draw.lens(), self.view.time(part), self.spacing);
        let sight = Sight::new(self.scene, ray, &mut owner.rays);
        let features =
            if self.options.features { Features::of(&self.view, &sight).map(feature_sample) } else { None };
        let lights_are_seen = !self.options.transparent;
        let seen =
            see(self.integrator, self.scene, &self.view, sight, &draw, lights_are_seen, &mut owner.rays);
        let sample =
            Sample { radiance: seen.radiance, coverage: seen.coverage, weight: place.weight, features };
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

/// Counts samples, and tells of them now and then.
struct Clock<'a> {
    start: Instant,
    done: AtomicU64,
    total: u64,
    last: Mutex<Instant>,
    progress: &'a dyn Progress,
}

impl Clock<'_> {
    fn add(&self, samples: u64) {
        let done = self.done.fetch_add(samples, Ordering::Relaxed) + samples;
        // Whoever finds someone else telling goes on with its work.
        let Ok(mut last) = self.last.try_lock() else { return };
        let now = Instant::now();
        if now.duration_since(*last) < REPORT_EVERY {
            return;
        }
        *last = now;
        let elapsed = now.duration_since(self.start);
        let share_left = (self.total.saturating_sub(done)) as f64 / done.max(1) as f64;
        let left = Duration::try_from_secs_f64(elapsed.as_secs_f64() * share_left).ok();
        self.progress.state(&State { samples: done, total: self.total, elapsed, left });
    }
}
