//! The worker of a viewer, on one thread that uses all cores: it reads, builds, and renders from coarse to fine, and
//! drops stale work.

use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lumbre::description::IntegratorKind;
use lumbre::image::{Image, Rgb};
use lumbre::{CancelToken, ErrorKind, NoProgress, Progress, RenderOptions, RenderState, SceneDesc, Setting};
use rayon::prelude::*;
use serde_json::json;

use crate::camera::moved;
use crate::frame::{Channel, Look, Pixels, Shot, id_colour};
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
/// Samples per pixel of a feature, whose only noise is at edges.
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
    /// Time spent on the full picture.
    spent: Duration,
    sequence: u32,
}

impl Worker {
    pub(crate) fn new(session: Arc<Session>) -> Self {
        let options = RenderOptions::default();
        let (known, step) = (Changes::default(), Step::Done);
        let (spent, speed) = (Duration::ZERO, 1e6);
        Self {
            session,
            known,
            read: None,
            stage: None,
            step,
            options,
            state: None,
            speed,
            spent,
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
        self.session.tell_progress(
            &json!({ "type": "progress", "doing": if read { "reading" } else { "building" } }),
        );
        let source = self.session.source();
        if source.is_empty() {
            self.session.tell_progress(&json!({ "type": "progress", "doing": "nothing" }));
            return false;
        }
        let loaded = self.read(&*source, wanted, read);
        let is_fine = loaded.is_ok();
        if let Ok(stage) = &loaded {
            self.stage = Some(stage.clone());
        } else {
            self.session.tell_progress(&json!({ "type": "progress", "doing": "waiting" }));
        }
        self.session.staged(loaded.map_err(|error| error.to_string()));
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
        self.session.edited(wrong);
        let built = source.build(desc)?;
        Ok(Arc::new(Stage::new(built, &read.desc, read.warnings.clone())))
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
        let replaced = stage.scene_mut().replace_camera(options.camera, camera);
        if let Err(error) = replaced {
            return self.fail(&error);
        }
        if wanted.scale != 1.0 {
            let side = |pixels: u32| ((f64::from(pixels) * wanted.scale).round() as u32).max(1);
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
        options.spectral &= matches!(options.integrator.kind, IntegratorKind::Path { .. });
        if !matches!(wanted.channel, Channel::Beauty | Channel::Variance) {
            options.transparent = false;
            options.exposure = RenderOptions::default().exposure;
        }
        options.guides = wanted.channel == Channel::Beauty && wanted.denoise.unwrap_or(stage.denoise);
        if let Err(error) = self.session.source().check(&options) {
            return self.fail(&error);
        }
        self.session.pictured(Ok(()));
        self.options = options;
        self.options.stop.spp = self.target(wanted, &stage);
        (self.state, self.spent) = (None, Duration::ZERO);
        let target = self.options.stop.spp;
        self.session
            .tell_progress(&json!({ "type": "progress", "doing": "rendering", "spp": 0, "target": target }));
        self.sequence = wanted.sequence;
        self.step =
            if wanted.channel == Channel::Ids { Step::Full(1) } else { Step::First(self.coarseness()) };
    }

    fn target(&self, wanted: &Wanted, stage: &Stage) -> u32 {
        match wanted.channel {
            Channel::Beauty => wanted.spp.unwrap_or(stage.options.stop.spp).max(1),
            Channel::Variance => wanted.spp.unwrap_or(stage.options.stop.spp).max(2),
            Channel::Ids => 1,
            _ => FEATURE_SPP,
        }
    }

    /// Pixels of the full picture along the side of one that can be had in the time of the first.
    fn coarseness(&self) -> u32 {
        let all = f64::from(self.options.width) * f64::from(self.options.height);
        let at_once = (self.speed * FIRST.as_secs_f64()).max(1.0);
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
        let all = f64::from(self.options.width) * f64::from(self.options.height);
        let in_a_pass = ((self.speed * PASS / all.max(1.0)) as u32).max(1);
        // What little a pass changes of many samples is not worth sending a picture to everyone.
        (done + done.min(in_a_pass.max(done / 8)).max(1)).min(target)
    }

    fn look(&self, wanted: &Wanted) -> Look {
        let mut save = self.stage.as_ref().map(|stage| stage.save.clone()).unwrap_or_default();
        save.exposure = wanted.exposure.unwrap_or(save.exposure);
        save.tone_map = wanted.tone_map.unwrap_or(save.tone_map);
        Look { save, false_colour: wanted.false_colour }
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
        options.guides = false;
        options.stop = lumbre::Stop::at(1);
        options.stop.time = matches!(self.step, Step::First(_)).then_some(FIRST_AT_MOST);
        let scene = stage.scene();
        let (width, height) = (options.width.div_ceil(side), options.height.div_ceil(side));
        options.resize(scene.resolved().film(), width, height);
        let rendered = scene.render_from(&options, &NoProgress, &cancel, None, None);
        drop(scene);
        let picture = match rendered {
            Ok((picture, _)) => picture,
            Err(error) => return self.fail(&error),
        };
        if cancel.is_cancelled() {
            return;
        }
        self.measure(picture.stats().paths_per_second());
        let picture = match &stage.background {
            Some(background) if wanted.channel == Channel::Beauty => picture.over(background.clone()),
            _ => picture,
        };
        self.show(wanted, Pixels::Rendered(Box::new(picture)), false, false);
        self.step = if side > 5 { Step::Coarse(side / 3) } else { Step::Full(1) };
    }

    fn full(&mut self, stage: &Stage, wanted: &Wanted, spp: u32) {
        let cancel = self.session.token(self.known);
        let target = self.options.stop.spp;
        let mut options = self.options.clone();
        options.stop.spp = spp.min(target);
        let start = Instant::now();
        let scene = stage.scene();
        let state = self.state.take();
        let before = state.as_ref().map_or(0, RenderState::taken);
        let asked = StillWanted { session: &self.session, known: self.known };
        let rendered = scene.render_from(&options, &asked, &cancel, state, None);
        drop(scene);
        let (mut picture, state) = match rendered {
            Ok(rendered) => rendered,
            // What is wanted instead comes next.
            Err(lumbre::Error::Render(lumbre::RenderError::Unwanted)) => return,
            Err(error) => return self.fail(&error),
        };
        self.state = Some(state);
        let took = start.elapsed();
        self.spent += took;
        let stats = picture.stats().clone();
        if stats.spp < options.stop.spp {
            // Stopped: what was rendered is gone on with, if it is still wanted.
            return;
        }
        self.measure(stats.samples.saturating_sub(before) as f64 / took.as_secs_f64().max(1e-6));
        let is_done = stats.spp >= target;
        if options.guides && (is_done || stats.spp.is_power_of_two()) && stats.spp >= 4.min(target) {
            // It fails where there is no sample in some pixel, and there is one in each.
            let _ = picture.denoise_unless(options.threads, &cancel);
            if cancel.is_cancelled() {
                return;
            }
        }
        if let Some(background) = stage.background.as_ref().filter(|_| wanted.channel == Channel::Beauty) {
            picture = picture.over(background.clone());
        }
        let pixels = match (wanted.channel, &self.state) {
            (Channel::Variance, Some(state)) => Pixels::Plain(state.variance()),
            _ => Pixels::Rendered(Box::new(picture)),
        };
        self.show(wanted, pixels, true, is_done);
        self.step = if is_done { Step::Done } else { Step::Full(self.next(stats.spp, target)) };
        let rays = stats.rays.camera + stats.rays.bounce + stats.rays.shadow;
        let spent = self.spent.as_secs_f64().max(1e-6);
        let left = spent * f64::from(target - stats.spp.min(target)) / f64::from(stats.spp.max(1));
        self.session.tell_progress(&json!({
            "type": "progress",
            "doing": if is_done { "done" } else { "rendering" },
            "spp": stats.spp,
            "target": target,
            "noise": stats.noise,
            "rays_per_second": rays as f64 / spent,
            "seconds": spent,
            "left": left,
            "dropped": stats.dropped,
        }));
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
        self.show(wanted, Pixels::Plain(image), true, true);
        self.step = Step::Done;
        self.session.tell_progress(&json!({ "type": "progress", "doing": "done" }));
    }

    /// There can be no picture: the page says why.
    fn fail(&mut self, error: &dyn std::fmt::Display) {
        self.step = Step::Done;
        self.session.pictured(Err(error.to_string()));
        self.session.tell_progress(&json!({ "type": "progress", "doing": "nothing" }));
    }

    fn measure(&mut self, speed: f64) {
        if speed.is_finite() && speed > 1.0 {
            self.speed = 0.5 * (self.speed + speed);
        }
    }

    fn show(&self, wanted: &Wanted, pixels: Pixels, is_full: bool, is_done: bool) {
        let full = (self.options.width, self.options.height);
        let shot = Shot { pixels, channel: wanted.channel, full, sequence: self.sequence, is_full, is_done };
        self.session.show(shot, &self.look(wanted));
    }
}

/// Knows whether the picture is still wanted: a large one takes longer to put together than one may wait for the next.
struct StillWanted<'s> {
    session: &'s Session,
    known: Changes,
}

impl Progress for StillWanted<'_> {
    fn is_wanted(&self) -> bool {
        self.session.is_wanted(self.known)
    }
}

fn set(desc: &mut SceneDesc, path: &str, value: &str) -> Result<(), String> {
    Setting::from_str(&format!("{path}={value}"))?.apply(desc)
}
