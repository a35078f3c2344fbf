//! The worker of a viewer, on one thread that uses all cores: it reads, builds, and renders from coarse to fine, and
//! drops stale work.

use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lumbre::description::{Camera, ClipPlane, FilmKind, IntegratorKind};
use lumbre::image::{Image, Rgb};
use lumbre::math::Elementary;
use lumbre::{
    CancelToken, DVec3, ErrorKind, NoProgress, Picture, Progress, RenderOptions, RenderState, SceneDesc,
    Setting, State, Stats, Stop,
};
use rayon::prelude::*;

use crate::camera::moved;
use crate::frame::{Look, Pixels, Shot, id_colour};
use crate::message::{Channel, Doing, Plane, RenderProgress};
use crate::session::{Changes, Session, Wanted};
use crate::source::{Read, SourceError};
use crate::stage::{Stage, ray};

/// Target time of the first picture after a change.
const FIRST: Duration = Duration::from_millis(35);
/// The first picture is stopped after this time, with what it has.
const FIRST_AT_MOST: Duration = Duration::from_millis(110);
/// Approximate time of a pass until it is shown.
const PASS: f64 = 0.6;
/// Maximum pixels of the full picture along the side of one of the first picture's.
const COARSEST: u32 = 16;
/// Samples that every pixel has before its noise may end it, where nobody says how many: see [`Stop::min_spp`].
const MIN_SPP_FOR_NOISE: u32 = 16;
/// Samples a pixel of a feature, which has no noise but that of edges.
const FEATURE_SPP: u32 = 16;

/// The next render.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// A picture of larger pixels by this factor, which is always finished, so that there is a picture even while the
    /// camera keeps moving.
    First(u32),
    /// The same, until the requested state changes.
    Coarse(u32),
    /// The picture, up to this many samples per pixel.
    Full(u32),
    /// Nothing.
    Done,
}

pub(crate) struct Worker {
    session: Arc<Session>,
    known: Changes,
    read: Option<Read>,
    stage: Option<Arc<Stage>>,
    step: Step,
    options: RenderOptions,
    state: Option<RenderState>,
    /// Paths a second, as last measured.
    speed: f64,
    /// Pixels a second that the denoiser takes, as last measured.
    denoising: f64,
    /// Time spent on the full picture.
    spent: Duration,
    /// [`Worker::spent`] when it was last shown.
    shown: Duration,
    /// How long it last took to denoise it.
    last_denoise: Duration,
    /// Its noise after the last pass.
    noise: Option<f64>,
    sequence: u32,
}

impl Worker {
    pub(crate) fn new(session: Arc<Session>) -> Self {
        let options = RenderOptions::default();
        let (known, step) = (Changes::default(), Step::Done);
        Self {
            session,
            known,
            read: None,
            stage: None,
            step,
            options,
            state: None,
            speed: 1e6,
            denoising: 1e6,
            spent: Duration::ZERO,
            shown: Duration::ZERO,
            last_denoise: Duration::ZERO,
            noise: None,
            sequence: 0,
        }
    }

    /// Works until the viewer closes.
    pub(crate) fn run(mut self) {
        while let Some(wanted) = self.session.wait(self.known, self.step != Step::Done) {
            let before = std::mem::replace(&mut self.known, wanted.changes);
            let now = wanted.changes;
            if now.read != before.read || now.build != before.build {
                if !self.load(&wanted, now.read != before.read) {
                    continue;
                }
                self.begin(&wanted);
            } else if now.render != before.render {
                self.begin(&wanted);
            } else if now.look != before.look {
                if let Some((shot, _)) = self.session.shot() {
                    self.session.show(Shot::clone(&shot), &self.look(&wanted));
                }
            } else if now.pause != before.pause {
                self.go_on(&wanted);
            }
            if !wanted.paused || matches!(self.step, Step::First(_)) {
                self.render(&wanted);
            }
        }
    }

    /// Reads and builds; returns whether there is a new stage.
    fn load(&mut self, wanted: &Wanted, read: bool) -> bool {
        self.publish(if read { Doing::Reading } else { Doing::Building });
        let source = self.session.source();
        if source.is_empty() {
            self.publish(Doing::Nothing);
            return false;
        }
        let loaded = self.read(&*source, wanted, read);
        let is_fine = loaded.is_ok();
        if let Ok(stage) = &loaded {
            self.stage = Some(stage.clone());
        } else {
            self.publish(Doing::Waiting);
        }
        self.session.publish_stage(loaded.map_err(|error| error.to_string()));
        is_fine
    }

    fn read(
        &mut self,
        source: &dyn crate::Source,
        wanted: &Wanted,
        again: bool,
    ) -> Result<Arc<Stage>, SourceError> {
        if again || self.read.is_none() {
            let read = source.read(&wanted.moment);
            let files = read.as_ref().map(|read| read.files.clone()).ok();
            self.session.watch_files(files, source.files());
            self.read = Some(read?);
        }
        let Some(read) = &self.read else {
            return Err(SourceError { kind: ErrorKind::Input, message: "nothing was read".to_owned() });
        };
        let mut desc = read.desc.clone();
        let mut wrong = None;
        for (path, value) in &wanted.settings {
            if let Err(why) = set(&mut desc, path, value) {
                self.session.drop_setting(path);
                wrong = Some(why);
            }
        }
        self.session.publish_edit_error(wrong);
        let built = source.build(desc, &wanted.hidden)?;
        let mut stage = Stage::new(built, &read.desc, read.warnings.clone());
        // A shape that is hidden does not change what the camera turns around.
        if let Some(before) = self.stage.as_ref().filter(|before| !again && before.cameras == stage.cameras) {
            stage.placements.clone_from(&before.placements);
        }
        Ok(Arc::new(stage))
    }

    /// Starts a new picture.
    fn begin(&mut self, wanted: &Wanted) {
        let Some(stage) = self.stage.clone() else { return };
        let mut options = stage.options.clone();
        options.camera = wanted.camera.min(stage.cameras.len().saturating_sub(1));
        let Some(base) = stage.cameras.get(options.camera) else { return };
        let camera = match &wanted.moved {
            None => base.clone(),
            // A placement that makes no camera changes nothing.
            Some(to) => {
                match moved(base, &stage.placements[options.camera], &to.placement, to.fov, to.zoom) {
                    Some(camera) => camera,
                    None => return,
                }
            }
        };
        let camera = Camera { clip: wanted.section.as_ref().and_then(clip), ..camera };
        let replaced = stage.scene_mut().replace_camera(options.camera, camera);
        if let Err(error) = replaced {
            return self.fail(&error);
        }
        if wanted.scale != 1.0 {
            let side = |pixels: u32| ((f64::from(pixels) * wanted.scale).rounded() as u32).max(1);
            let (width, height) = (side(options.width), side(options.height));
            options.resize(stage.scene().resolved().film(), width, height);
        }
        options.integrator.kind = match wanted.channel {
            Channel::Beauty => options.integrator.kind,
            Channel::Albedo => IntegratorKind::Albedo,
            Channel::Normal => IntegratorKind::Normals,
            Channel::Depth => IntegratorKind::Depth,
            Channel::Uv => IntegratorKind::Uv,
            Channel::Variance | Channel::Ids => options.integrator.kind,
        };
        options.film = FilmKind::Rgb;
        options.spectral &= options.integrator.kind.carries_wavelengths();
        if !matches!(wanted.channel, Channel::Beauty | Channel::Variance) {
            options.transparent = false;
            options.exposure = RenderOptions::default().exposure;
        }
        options.guides = wanted.channel == Channel::Beauty && wanted.denoise.unwrap_or(stage.denoise);
        if let Err(error) = self.session.source().check(&options) {
            return self.fail(&error);
        }
        self.session.publish_picture_error(Ok(()));
        self.options = options;
        self.options.stop.spp = self.target(wanted, &stage);
        self.options.stop.noise = noise(wanted, &stage);
        (self.state, self.noise) = (None, None);
        (self.spent, self.shown) = (Duration::ZERO, Duration::ZERO);
        self.publish_start(None);
        self.sequence = wanted.sequence;
        self.step =
            if wanted.channel == Channel::Ids { Step::Full(1) } else { Step::First(self.coarseness()) };
    }

    /// Says that no sample of the full picture is taken yet, and how long it will take, as far as that is known.
    fn publish_start(&self, left: Option<f64>) {
        self.session.publish_progress(RenderProgress {
            spp: Some(0),
            share: Some(0.0),
            left,
            ..self.rendering()
        });
    }

    /// Says what the viewer is doing, where there is no more to say.
    fn publish(&self, doing: Doing) {
        self.session.publish_progress(RenderProgress { doing, ..RenderProgress::default() });
    }

    /// That the picture is being rendered, up to these samples or this noise.
    fn rendering(&self) -> RenderProgress {
        let Stop { spp, noise, .. } = self.options.stop;
        let (target, noise_target) = (Some(spp), noise);
        RenderProgress { doing: Doing::Rendering, target, noise_target, ..RenderProgress::default() }
    }

    fn target(&self, wanted: &Wanted, stage: &Stage) -> u32 {
        let spp = wanted.spp.unwrap_or(stage.options.stop.spp);
        match wanted.channel {
            Channel::Beauty => spp.max(1),
            Channel::Variance => spp.max(2),
            Channel::Ids => 1,
            _ => FEATURE_SPP,
        }
    }

    /// Pixels of the full picture along the side of one that can be had in the time of the first.
    fn coarseness(&self) -> u32 {
        let all = self.pixels();
        let of_denoising = if self.options.guides { self.denoising.recip() } else { 0.0 };
        let at_once = (FIRST.as_secs_f64() / (self.speed.recip() + of_denoising)).max(1.0);
        ((all / at_once).sqrt().ceil() as u32).clamp(1, COARSEST)
    }

    /// Goes on towards another number of samples.
    fn go_on(&mut self, wanted: &Wanted) {
        let Some(stage) = &self.stage else { return };
        let target = self.target(wanted, stage);
        if self.step == Step::Done && target > self.options.stop.spp {
            let done = self.options.stop.spp;
            self.step = Step::Full(self.next(done, target));
        }
        self.options.stop.spp = target;
    }

    /// The number of samples after the next pass.
    fn next(&self, done: u32, target: u32) -> u32 {
        if self.options.stop.noise.is_some() {
            // Each pass towards a noise begins with a small picture, the same each time.
            return done.saturating_mul(2).max(1).min(target);
        }
        let all = self.pixels();
        let in_a_pass = ((self.speed * PASS / all.max(1.0)) as u32).max(1);
        // What little a pass changes of many samples is not worth sending a picture to everyone.
        (done + done.min(in_a_pass.max(done / 8)).max(1)).min(target)
    }

    fn look(&self, wanted: &Wanted) -> Look {
        let mut save = self.stage.as_ref().map(|stage| stage.save.clone()).unwrap_or_default();
        save.exposure = wanted.exposure.unwrap_or(save.exposure);
        save.tone_map = wanted.tone_map.unwrap_or(save.tone_map);
        Look { save, false_colour: wanted.false_colour, map: wanted.map, range: wanted.range }
    }

    /// Takes the next step.
    fn render(&mut self, wanted: &Wanted) {
        let Some(stage) = self.stage.clone() else { return };
        match self.step {
            Step::Done => {}
            Step::First(side) => self.coarse(&stage, wanted, side, CancelToken::new()),
            Step::Coarse(side) => self.coarse(&stage, wanted, side, self.session.token(self.known)),
            Step::Full(_) if wanted.channel == Channel::Ids => self.ids(&stage, wanted),
            Step::Full(spp) => self.full(&stage, wanted, spp),
        }
    }

    fn coarse(&mut self, stage: &Stage, wanted: &Wanted, side: u32, cancel: CancelToken) {
        let mut options = self.options.clone();
        options.stop = Stop::at(1);
        options.stop.time = matches!(self.step, Step::First(_)).then_some(FIRST_AT_MOST);
        let scene = stage.scene();
        let (width, height) = (options.width.div_ceil(side), options.height.div_ceil(side));
        options.resize(scene.resolved().film(), width, height);
        let rendered = scene.render_from(&options, &NoProgress, &cancel, None, None);
        drop(scene);
        let mut picture = match rendered {
            Ok((picture, _)) => picture,
            Err(error) => return self.fail(&error),
        };
        if cancel.is_cancelled() {
            return;
        }
        self.measure(picture.stats().paths_per_second());
        let is_denoised = self.denoise(&mut picture, &cancel);
        if cancel.is_cancelled() {
            return;
        }
        let picture = match &stage.background {
            Some(background) if wanted.channel == Channel::Beauty => picture.over(background.clone()),
            _ => picture,
        };
        let pixels = Pixels::Rendered(Box::new(picture));
        self.show(wanted, Shown { pixels, is_full: false, is_done: false, is_denoised });
        // To a noise target there is no progress yet.
        let samples = self.pixels() * f64::from(self.options.stop.spp);
        self.publish_start(self.options.stop.noise.is_none().then_some(samples / self.speed));
        self.step = if side > 5 { Step::Coarse(side / 3) } else { Step::Full(1) };
    }

    /// Takes the noise out of a picture that has guides; whether it could.
    fn denoise(&mut self, picture: &mut Picture, cancel: &CancelToken) -> bool {
        if !self.options.guides {
            return false;
        }
        let start = Instant::now();
        // It fails where there is no sample in some pixel: the picture stays as it is then.
        let is_denoised = picture.denoise_unless(self.options.threads, cancel).is_ok();
        self.last_denoise = start.elapsed();
        let side = f64::from(picture.stats().stride.unwrap_or(1));
        let pixels = picture.image().pixels().len() as f64 / (side * side);
        if !cancel.is_cancelled() {
            let speed = pixels / self.last_denoise.as_secs_f64().max(1e-6);
            self.denoising = 0.5 * (self.denoising + speed);
        }
        is_denoised
    }

    fn full(&mut self, stage: &Stage, wanted: &Wanted, spp: u32) {
        let cancel = self.session.token(self.known);
        let target = self.options.stop.spp;
        let mut options = self.options.clone();
        options.stop.spp = spp.min(target);
        // No pixel ends before it has these.
        let sure = options.stop.min_spp.unwrap_or(MIN_SPP_FOR_NOISE);
        options.stop.noise = options.stop.noise.filter(|_| options.stop.spp > sure);
        let start = Instant::now();
        let scene = stage.scene();
        let state = self.state.take();
        let before = state.as_ref().map_or(0, RenderState::taken);
        let progress = PassProgress {
            session: &self.session,
            known: self.known,
            pixels: self.pixels(),
            spent: self.spent,
            way: self.way(state.as_ref()),
            start: self.rendering(),
        };
        let rendered = scene.render_from(&options, &progress, &cancel, state, None);
        drop(scene);
        let (picture, state) = match rendered {
            Ok(rendered) => rendered,
            // What is wanted instead comes next.
            Err(lumbre::Error::Render(lumbre::RenderError::Unwanted)) => return,
            Err(error) => return self.fail(&error),
        };
        self.state = Some(state);
        let took = start.elapsed();
        self.spent += took;
        let stats = picture.stats().clone();
        if stats.cancelled || stats.most_spp < options.stop.spp && options.stop.noise.is_none() {
            // Stopped: what was rendered is gone on with, if it is still wanted.
            return;
        }
        if options.stop.noise.is_none() {
            self.measure(stats.samples.saturating_sub(before) as f64 / took.as_secs_f64().max(1e-6));
        }
        // With a noise target, pixels end before; when all have, the picture is done.
        let is_done = stats.most_spp >= target || stats.most_spp < options.stop.spp;
        if self.shows(is_done) && !self.show_full(stage, wanted, picture, is_done, &cancel) {
            return;
        }
        self.step = if is_done { Step::Done } else { Step::Full(self.next(options.stop.spp, target)) };
        self.publish_stats(&stats, is_done);
    }

    /// Whether the picture is shown after this pass: not where the denoiser would take too much of the time.
    fn shows(&self, is_done: bool) -> bool {
        let is_first = self.shown == Duration::ZERO;
        is_done || is_first || !self.options.guides || self.spent - self.shown >= 3 * self.last_denoise
    }

    /// Shows the picture; whether it is still wanted.
    fn show_full(
        &mut self,
        stage: &Stage,
        wanted: &Wanted,
        mut picture: Picture,
        is_done: bool,
        cancel: &CancelToken,
    ) -> bool {
        let is_denoised = self.denoise(&mut picture, cancel);
        if cancel.is_cancelled() {
            return false;
        }
        if let Some(background) = stage.background.as_ref().filter(|_| wanted.channel == Channel::Beauty) {
            picture = picture.over(background.clone());
        }
        let pixels = match (wanted.channel, &self.state) {
            (Channel::Variance, Some(state)) => Pixels::Plain(state.variance()),
            _ => Pixels::Rendered(Box::new(picture)),
        };
        self.show(wanted, Shown { pixels, is_full: true, is_done, is_denoised });
        self.shown = self.spent;
        true
    }

    /// How much of the way to the end of the picture a sample of each pixel is: 0 where that is not known.
    fn way(&self, state: Option<&RenderState>) -> f64 {
        let by_spp = f64::from(self.options.stop.spp).recip();
        let by_noise = self.options.stop.noise.zip(state).map_or(0.0, |(limit, state)| {
            let spp = state.taken() as f64 / self.pixels();
            match self.noise {
                // The noise falls with the square root of the number of samples.
                Some(noise) if noise > limit && spp > 0.0 => (limit / noise).powi(2) / spp,
                _ => 0.0,
            }
        });
        if self.options.stop.noise.is_some() { by_noise.max(by_spp) } else { by_spp }
    }

    /// Pixels that are rendered: those of the film's crop.
    fn pixels(&self) -> f64 {
        self.options.bounds().map_or(1.0, |bounds| bounds.area() as f64)
    }

    fn publish_stats(&mut self, stats: &Stats, is_done: bool) {
        self.noise = stats.noise;
        let rays = stats.rays.camera + stats.rays.bounce + stats.rays.shadow;
        let spent = self.spent.as_secs_f64().max(1e-6);
        let spp = stats.samples as f64 / self.pixels();
        let share = if is_done { 1.0 } else { (spp * self.way(self.state.as_ref())).min(1.0) };
        let left = (share > 0.0).then(|| spent * (1.0 - share) / share);
        self.session.publish_progress(RenderProgress {
            doing: if is_done { Doing::Done } else { Doing::Rendering },
            spp: Some(if stats.noise_target.is_some() { spp.rounded() as u32 } else { stats.spp }),
            share: Some(share),
            noise: stats.noise,
            rays_per_second: Some(rays as f64 / spent),
            seconds: Some(spent),
            left,
            dropped: Some(stats.dropped),
            ..self.rendering()
        });
    }

    /// A colour for each shape.
    fn ids(&mut self, stage: &Stage, wanted: &Wanted) {
        let cancel = self.session.token(self.known);
        let (width, height) = (self.options.width, self.options.height);
        let scene = stage.scene();
        let mut image = Image::filled(width, height, Rgb::BLACK);
        let rows = image.pixels_mut().par_chunks_mut(width.max(1) as usize).zip(0..height);
        rows.for_each(|(row, y)| {
            if cancel.is_cancelled() {
                return;
            }
            for (pixel, x) in row.iter_mut().zip(0..width) {
                let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
                let ray = ray(&scene, self.options.camera, (width, height), x, y);
                let hit = ray.and_then(|ray| scene.closest(&ray));
                *pixel = hit.map_or(Rgb::BLACK, |hit| id_colour(hit.shape));
            }
        });
        drop(scene);
        if cancel.is_cancelled() {
            return;
        }
        let pixels = Pixels::Plain(image);
        self.show(wanted, Shown { pixels, is_full: true, is_done: true, is_denoised: false });
        self.step = Step::Done;
        self.publish(Doing::Done);
    }

    /// There can be no picture: the page says why.
    fn fail(&mut self, error: &dyn std::fmt::Display) {
        self.step = Step::Done;
        self.session.publish_picture_error(Err(error.to_string()));
        self.publish(Doing::Nothing);
    }

    fn measure(&mut self, speed: f64) {
        if speed.is_finite() && speed > 1.0 {
            self.speed = 0.5 * (self.speed + speed);
        }
    }

    fn show(&self, wanted: &Wanted, shown: Shown) {
        let full = (self.options.width, self.options.height);
        let Shown { pixels, is_full, is_done, is_denoised } = shown;
        let (channel, sequence) = (wanted.channel, self.sequence);
        let shot = Shot { pixels, channel, full, sequence, is_full, is_done, is_denoised };
        self.session.show(shot, &self.look(wanted));
    }
}

/// What is shown of a step.
struct Shown {
    pixels: Pixels,
    is_full: bool,
    is_done: bool,
    is_denoised: bool,
}

/// What a page is to hear while a pass goes on. It knows whether the picture is still wanted: a large one takes longer
/// to put together than one may wait for the next.
struct PassProgress<'s> {
    session: &'s Session,
    known: Changes,
    pixels: f64,
    /// The time that the passes before took.
    spent: Duration,
    /// See [`Worker::way`].
    way: f64,
    /// What does not change during the pass.
    start: RenderProgress,
}

impl Progress for PassProgress<'_> {
    fn state(&self, state: &State) {
        let spp = state.samples as f64 / self.pixels;
        let share = (spp * self.way).clamp(0.0, 1.0);
        let spent = (self.spent + state.elapsed).as_secs_f64();
        let left = (share > 0.0).then(|| spent * (1.0 - share) / share);
        let (spp, share) = (Some(spp as u32), Some(share));
        self.session.publish_progress(RenderProgress { spp, share, left, ..self.start.clone() });
    }

    fn is_wanted(&self) -> bool {
        self.session.is_wanted(self.known)
    }
}

/// The plane of a section; `None` for one without a direction.
fn clip(plane: &Plane) -> Option<ClipPlane> {
    let [point, normal] = [plane.point, plane.normal].map(DVec3::from_array);
    let is_fine = point.is_finite() && point.length() < 1e12;
    let normal = normal.try_normalize().filter(|_| is_fine)?;
    Some(ClipPlane { point, normal })
}

/// The noise at which a picture of light ends, if it is to end at one.
fn noise(wanted: &Wanted, stage: &Stage) -> Option<f64> {
    let is_light = matches!(wanted.channel, Channel::Beauty | Channel::Variance);
    wanted.noise.or(stage.options.stop.noise).filter(|noise| is_light && *noise > 0.0)
}

fn set(desc: &mut SceneDesc, path: &str, value: &str) -> Result<(), String> {
    Setting::from_str(&format!("{path}={value}"))?.apply(desc)
}
