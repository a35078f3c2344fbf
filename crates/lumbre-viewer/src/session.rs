//! The requested and the present state of a viewer, shared by the server and the worker.

use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use lumbre::image::ToneMap;
use lumbre::{CancelToken, Stop};
use tokio::sync::watch;

use crate::frame::{Frame, Look, Pixels, Shot};
use crate::message::{
    Channel, ColourMap, PageMessage, PixelValue, Placement, Plane, RenderProgress, SetOptions, ViewerMessage,
    ViewerState, to_json,
};
use crate::source::{Moment, Source};
use crate::stage::{Explained, Stage};
use crate::tree::{Hidden, MAX_NAMED};
use crate::watching::Watched;

/// Counters of changes, one for each kind of work that a change needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Changes {
    /// Goes up when the files must be read again.
    pub read: u64,
    /// Goes up when the scene must be built again.
    pub build: u64,
    /// Goes up when the picture must be rendered again.
    pub render: u64,
    /// Goes up when the picture must be shown again.
    pub look: u64,
    /// Goes up when pausing starts or ends.
    pub pause: u64,
}

/// The requested state.
#[derive(Clone, Debug)]
pub(crate) struct Wanted {
    pub changes: Changes,
    /// The last change of the camera, as counted by the page.
    pub sequence: u32,
    pub camera: usize,
    /// Where the user moved the camera; `None` for the file's own place.
    pub moved: Option<Moved>,
    pub channel: Channel,
    pub scale: f64,
    pub spp: Option<u32>,
    /// The noise at which the picture is done; 0 for none.
    pub noise: Option<f64>,
    pub denoise: Option<bool>,
    pub paused: bool,
    pub exposure: Option<f32>,
    pub tone_map: Option<ToneMap>,
    pub false_colour: bool,
    pub map: ColourMap,
    pub range: Option<[f32; 2]>,
    pub hidden: Hidden,
    pub section: Option<Plane>,
    pub moment: Moment,
    /// Parameters with their values, in the order in which they were first set.
    pub settings: Vec<(String, String)>,
}

/// Where a camera was moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moved {
    pub placement: Placement,
    pub fov: Option<f64>,
    pub zoom: f64,
}

/// Maximum number of set parameters.
const MAX_SETTINGS: usize = 500;
/// Maximum characters of a parameter's name and of its value.
const LONGEST_SETTING: usize = 1000;
/// Interval between checks of the files.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Maximum side of a rectangle of requested pixel values.
const MAX_VALUES: u32 = 64;

struct Inner {
    wanted: Wanted,
    cancel: CancelToken,
    source: Arc<dyn Source>,
    closing: bool,
    shot: Option<Arc<Shot>>,
    stage: Option<Arc<Stage>>,
    look: Option<Look>,
    error: Option<String>,
    picture_error: Option<String>,
    edit_error: Option<String>,
    name: String,
}

/// State shared by server and worker.
pub(crate) struct Session {
    inner: Mutex<Inner>,
    changed: Condvar,
    watched: Mutex<Watched>,
    /// The last frame.
    pub frames: watch::Sender<Option<Frame>>,
    /// The scene's facts, as JSON.
    pub scene: watch::Sender<Arc<str>>,
    /// The requested state, as JSON.
    pub state: watch::Sender<Arc<str>>,
    /// The progress of the picture, as JSON.
    pub progress: watch::Sender<Arc<str>>,
}

impl Session {
    pub(crate) fn new(source: Arc<dyn Source>) -> Self {
        let name = source.name();
        let wanted = Wanted {
            changes: Changes { read: 1, ..Changes::default() },
            sequence: 0,
            camera: 0,
            moved: None,
            channel: Channel::Beauty,
            scale: 1.0,
            spp: None,
            noise: None,
            denoise: None,
            paused: false,
            exposure: None,
            tone_map: None,
            false_colour: false,
            map: ColourMap::default(),
            range: None,
            hidden: Hidden::default(),
            section: None,
            moment: Moment::default(),
            settings: Vec::new(),
        };
        let inner = Inner {
            wanted,
            cancel: CancelToken::new(),
            source,
            closing: false,
            shot: None,
            stage: None,
            look: None,
            error: None,
            picture_error: None,
            edit_error: None,
            name,
        };
        let session = Self {
            inner: Mutex::new(inner),
            changed: Condvar::new(),
            watched: Mutex::new(Watched::default()),
            frames: watch::channel(None).0,
            scene: watch::channel("".into()).0,
            state: watch::channel("".into()).0,
            progress: watch::channel("".into()).0,
        };
        session.publish_state(&session.lock());
        session
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the requested state, cancels stale work, and publishes the state.
    fn change(&self, change: impl FnOnce(&mut Inner)) {
        let mut inner = self.lock();
        change(&mut inner);
        inner.cancel.cancel();
        self.changed.notify_all();
        self.publish_state(&inner);
    }

    /// Waits for a change of the requested state, or for work to continue; `None` when the viewer closes.
    pub(crate) fn wait(&self, known: Changes, has_work: bool) -> Option<Wanted> {
        let mut inner = self.lock();
        loop {
            if inner.closing {
                return None;
            }
            if inner.wanted.changes != known || (has_work && !inner.wanted.paused) {
                return Some(inner.wanted.clone());
            }
            inner = self.changed.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// A token that is cancelled when the requested state differs from this version, perhaps at once.
    pub(crate) fn token(&self, known: Changes) -> CancelToken {
        let mut inner = self.lock();
        inner.cancel = CancelToken::new();
        if inner.closing || inner.wanted.changes != known {
            inner.cancel.cancel();
        }
        inner.cancel.clone()
    }

    /// Whether a picture that was started for this version is still wanted, for any display options.
    pub(crate) fn is_wanted(&self, known: Changes) -> bool {
        let inner = self.lock();
        let now = inner.wanted.changes;
        !inner.closing && (now.read, now.build, now.render) == (known.read, known.build, known.render)
    }

    pub(crate) fn close(&self) {
        self.change(|inner| inner.closing = true);
    }

    /// Reads the files again.
    pub(crate) fn reload(&self) {
        self.change(|inner| inner.wanted.changes.read += 1);
    }

    /// Shows the scene in other light.
    pub(crate) fn relight(&self, source: Arc<dyn Source>) {
        self.change(|inner| {
            inner.source = source;
            inner.wanted.changes.read += 1;
        });
    }

    /// Shows another scene.
    pub(crate) fn open(&self, source: Arc<dyn Source>) {
        self.change(|inner| {
            inner.name = source.name();
            inner.source = source;
            let wanted = &mut inner.wanted;
            (wanted.camera, wanted.moved, wanted.moment) = (0, None, Moment::default());
            (wanted.hidden, wanted.section) = (Hidden::default(), None);
            wanted.settings.clear();
            wanted.changes.read += 1;
        });
    }

    pub(crate) fn source(&self) -> Arc<dyn Source> {
        self.lock().source.clone()
    }

    /// Publishes a stage, or why there is none; then the last one stays.
    pub(crate) fn publish_stage(&self, staged: Result<Arc<Stage>, String>) {
        let mut inner = self.lock();
        match staged {
            Ok(stage) => {
                let scene = to_json(&ViewerMessage::Scene { scene: &stage.facts });
                (inner.stage, inner.error) = (Some(stage), None);
                self.scene.send_replace(scene.into());
            }
            Err(error) => inner.error = Some(error),
        }
        self.publish_state(&inner);
    }

    /// Publishes whether the requested picture can be rendered.
    pub(crate) fn publish_picture_error(&self, pictured: Result<(), String>) {
        let mut inner = self.lock();
        let error = pictured.err();
        if inner.picture_error != error {
            inner.picture_error = error;
            self.publish_state(&inner);
        }
    }

    /// Sets the files to watch: the files that were read, or otherwise the previously watched ones, and those of the
    /// source.
    pub(crate) fn watch_files(&self, read: Option<Vec<PathBuf>>, named: Vec<PathBuf>) {
        let mut watched = self.watched.lock().unwrap_or_else(PoisonError::into_inner);
        let before = read.unwrap_or_else(|| watched.files().collect());
        *watched = Watched::new(before.into_iter().chain(named));
    }

    /// Checks the files until the viewer closes, and reloads when one has changed.
    pub(crate) fn watch(&self) {
        while !self.lock().closing {
            std::thread::sleep(LOOK_EVERY);
            if self.watched.lock().unwrap_or_else(PoisonError::into_inner).changed() {
                self.reload();
            }
        }
    }

    /// Publishes whether the last parameter could be set.
    pub(crate) fn publish_edit_error(&self, wrong: Option<String>) {
        let mut inner = self.lock();
        inner.edit_error = wrong;
        self.publish_state(&inner);
    }

    /// Reverts a parameter that cannot be set.
    pub(crate) fn drop_setting(&self, path: &str) {
        self.lock().wanted.settings.retain(|(known, _)| known != path);
    }

    /// Publishes a picture: it is encoded once, for all pages.
    pub(crate) fn show(&self, shot: Shot, look: &Look) {
        let frame = Frame::new(&shot, look);
        let mut inner = self.lock();
        (inner.shot, inner.look) = (Some(Arc::new(shot)), Some(look.clone()));
        drop(inner);
        self.frames.send_replace(Some(frame));
    }

    /// The last picture, and how it is shown.
    pub(crate) fn shot(&self) -> Option<(Arc<Shot>, Look)> {
        let inner = self.lock();
        Some((inner.shot.clone()?, inner.look.clone()?))
    }

    pub(crate) fn publish_progress(&self, progress: RenderProgress) {
        self.progress.send_replace(to_json(&ViewerMessage::Progress(progress)).into());
    }

    /// Publishes the requested state and the scene.
    fn publish_state(&self, inner: &Inner) {
        let Inner { wanted, stage, error, picture_error, edit_error, name, .. } = inner;
        let index =
            stage.as_ref().map_or(0, |stage| wanted.camera.min(stage.cameras.len().saturating_sub(1)));
        let own = stage.as_ref().and_then(|stage| stage.placements.get(index));
        let options = stage.as_ref().map(|stage| &stage.options);
        let save = stage.as_ref().map(|stage| &stage.save);
        let state = ViewerState {
            name: name.clone(),
            has_scene: stage.is_some(),
            error: error.as_ref().or(picture_error.as_ref()).cloned(),
            edit_error: edit_error.clone(),
            camera: index,
            sequence: wanted.sequence,
            moved: wanted.moved.is_some(),
            placement: wanted.moved.map(|moved| moved.placement).or(own.copied()),
            fov: wanted.moved.and_then(|moved| moved.fov),
            zoom: wanted.moved.map_or(1.0, |moved| moved.zoom),
            size: options.map(|options| [options.width, options.height]),
            channel: wanted.channel,
            scale: wanted.scale,
            spp: wanted.spp.or(options.map(|options| options.stop.spp)),
            noise: wanted.noise.or(options.and_then(|options| options.stop.noise)),
            denoise: wanted.denoise.or(stage.as_ref().map(|stage| stage.denoise)),
            paused: wanted.paused,
            exposure: wanted.exposure.or(save.map(|save| save.exposure)),
            tone_map: wanted.tone_map.or(save.map(|save| save.tone_map)).map(tone_map_name),
            false_colour: wanted.false_colour,
            map: wanted.map,
            range: wanted.range,
            hidden: wanted.hidden.listed(),
            section: wanted.section,
            time: wanted.moment.time,
            variant: wanted.moment.variant.clone(),
            settings: wanted.settings.clone(),
        };
        self.state.send_replace(to_json(&ViewerMessage::State(Box::new(state))).into());
    }

    /// Handles a page's message; returns the answer, if any.
    pub(crate) fn handle_message(&self, message: PageMessage) -> Option<ViewerMessage<'static>> {
        match message {
            // The socket handles these.
            PageMessage::Shown {} | PageMessage::Ticket { .. } => None,
            PageMessage::Camera { sequence, placement, fov, zoom } => {
                self.change(|inner| {
                    let wanted = &mut inner.wanted;
                    wanted.sequence = sequence;
                    wanted.moved = Some(Moved { placement, fov, zoom });
                    wanted.changes.render += 1;
                });
                None
            }
            PageMessage::Reset { sequence, camera } => {
                self.change(|inner| {
                    let wanted = &mut inner.wanted;
                    (wanted.sequence, wanted.camera, wanted.moved) = (sequence, camera, None);
                    wanted.changes.render += 1;
                });
                None
            }
            PageMessage::Set(options) => self.set_options(&options),
            PageMessage::Edit { path, value } => self.edit(path, value),
            PageMessage::Hide { shapes, .. } if shapes.len() > MAX_NAMED => {
                Some(ViewerMessage::wrong(format!("more than {MAX_NAMED} shapes are named")))
            }
            PageMessage::Hide { shapes, others } => {
                self.change(|inner| {
                    inner.wanted.hidden = Hidden::new(shapes, others);
                    inner.wanted.changes.build += 1;
                });
                None
            }
            PageMessage::Section { plane } => {
                self.change(|inner| {
                    inner.wanted.section = plane;
                    inner.wanted.changes.render += 1;
                });
                None
            }
            PageMessage::Moment { time, variant } => {
                let is_fine = time.is_none_or(|time| time.is_finite() && time.abs() < 1e9);
                if is_fine && variant.as_ref().is_none_or(|name| name.len() <= LONGEST_SETTING) {
                    self.change(|inner| {
                        inner.wanted.moment = Moment { time, variant };
                        inner.wanted.changes.read += 1;
                    });
                }
                None
            }
            PageMessage::Pick { x, y, request } => self.pick(x, y, request),
            PageMessage::Values { x, y, width, height, request } => {
                self.values([x, y, width, height], request)
            }
        }
    }

    fn set_options(&self, options: &SetOptions) -> Option<ViewerMessage<'static>> {
        let tone_map = match options.tone_map.as_deref().map(|name| ToneMap::from_name(name).ok_or(name)) {
            Some(Err(_)) => return Some(ViewerMessage::wrong("there is no such tone mapping")),
            Some(Ok(map)) => Some(map),
            None => None,
        };
        self.change(|inner| {
            let wanted = &mut inner.wanted;
            let before = wanted.clone();
            wanted.exposure = options.exposure.map(|stops| stops.clamp(-100.0, 100.0)).or(wanted.exposure);
            wanted.tone_map = tone_map.or(wanted.tone_map);
            wanted.false_colour = options.false_colour.unwrap_or(wanted.false_colour);
            wanted.map = options.map.unwrap_or(wanted.map);
            if let Some(range) = &options.range {
                wanted.range = match range[..] {
                    [low, high] if low < high && low.is_finite() && high.is_finite() => Some([low, high]),
                    _ => None,
                };
            }
            wanted.channel = options.channel.unwrap_or(wanted.channel);
            wanted.denoise = options.denoise.or(wanted.denoise);
            wanted.paused = options.paused.unwrap_or(wanted.paused);
            wanted.scale =
                options.scale.filter(|s| s.is_finite()).map_or(wanted.scale, |s| s.clamp(0.1, 2.0));
            wanted.spp = options.spp.map(|spp| spp.clamp(1, 1 << 20)).or(wanted.spp);
            if let Some(noise) = options.noise.filter(|noise| noise.is_finite() && *noise >= 0.0) {
                wanted.noise = Some(noise);
                // No limit on samples, unless one was given.
                let most = Some(Stop::MAX_FOR_NOISE);
                wanted.spp =
                    if noise > 0.0 { wanted.spp.or(most) } else { wanted.spp.filter(|_| wanted.spp != most) };
            }
            let look = |wanted: &Wanted| {
                (wanted.exposure, wanted.tone_map, wanted.false_colour, wanted.map, wanted.range)
            };
            let is_same_look = look(&before) == look(wanted);
            let is_same_picture = (before.channel, before.denoise, before.scale, before.noise)
                == (wanted.channel, wanted.denoise, wanted.scale, wanted.noise);
            wanted.changes.look += u64::from(!is_same_look);
            wanted.changes.render += u64::from(!is_same_picture);
            // More samples continue the present ones.
            wanted.changes.pause += u64::from(before.paused != wanted.paused || before.spp != wanted.spp);
        });
        None
    }

    fn edit(&self, path: String, value: Option<String>) -> Option<ViewerMessage<'static>> {
        let is_long =
            path.len() > LONGEST_SETTING || value.as_ref().is_some_and(|v| v.len() > LONGEST_SETTING);
        let mut is_full = false;
        self.change(|inner| {
            let settings = &mut inner.wanted.settings;
            is_full = settings.len() >= MAX_SETTINGS && !settings.iter().any(|(known, _)| *known == path);
            if is_long || is_full {
                return;
            }
            match (settings.iter_mut().find(|(known, _)| *known == path), value) {
                (Some(setting), Some(value)) => setting.1 = value,
                (None, Some(value)) => settings.push((path, value)),
                (_, None) => settings.retain(|(known, _)| *known != path),
            }
            inner.wanted.changes.build += 1;
        });
        (is_long || is_full).then(|| ViewerMessage::wrong("too many parameters are set, or one is too long"))
    }

    /// The stage, the camera that looks at it, and the size of the picture.
    fn shown(&self) -> Option<(Arc<Stage>, usize, (u32, u32))> {
        let inner = self.lock();
        let stage = inner.stage.clone()?;
        let camera = inner.wanted.camera.min(stage.cameras.len().saturating_sub(1));
        Some((stage, camera, inner.shot.as_ref()?.full))
    }

    fn pick(&self, x: f64, y: f64, request: u32) -> Option<ViewerMessage<'static>> {
        let (stage, camera, full) = self.shown()?;
        if !(0.0 <= x && x <= f64::from(full.0) && 0.0 <= y && y <= f64::from(full.1)) {
            return None;
        }
        let ray = stage.pick(camera, full, x, y);
        Some(ViewerMessage::Picked { request, x, y, ray })
    }

    /// The explanation of a pixel, as a page in a language; `None` if there is no explainer.
    pub(crate) fn explain(&self, pixel: (u32, u32), language: &str) -> Option<Result<Explained, String>> {
        let (stage, camera, full) = self.shown()?;
        stage.explain(camera, full, pixel, language)
    }

    /// The values of pixels of the last complete picture, row by row.
    fn values(&self, [x0, y0, width, height]: [u32; 4], request: u32) -> Option<ViewerMessage<'static>> {
        let (shot, _) = self.shot()?;
        let image = shot.image();
        let is_whole = (image.width(), image.height()) == shot.full;
        if !is_whole || width > MAX_VALUES || height > MAX_VALUES {
            return None;
        }
        let (x1, y1) =
            (x0.saturating_add(width).min(image.width()), y0.saturating_add(height).min(image.height()));
        let pixels = (y0..y1).flat_map(|y| (x0..x1).map(move |x| image.pixel(x, y).to_array()));
        // JSON has no infinity: such numbers become text.
        let value = |value: f32| {
            if value.is_finite() { PixelValue::Number(value) } else { PixelValue::Text(value.to_string()) }
        };
        let values = pixels.map(|rgb| rgb.map(value)).collect();
        let (width, height) = (x1.saturating_sub(x0), y1.saturating_sub(y0));
        Some(ViewerMessage::Values { request, x: x0, y: y0, width, height, values })
    }

    /// The picture as a file.
    ///
    /// # Errors
    /// Where there is none, and where it cannot be encoded.
    pub(crate) fn file(&self, format: lumbre::formats::image::ImageFormat) -> Result<Vec<u8>, String> {
        let (shot, look) = self.shot().ok_or("there is no picture yet")?;
        match &shot.pixels {
            Pixels::Rendered(picture) => picture.encode(format, &look.save, &[]).map_err(|e| e.to_string()),
            Pixels::Plain(image) => {
                let save = lumbre::SaveOptions::default();
                lumbre::formats::image::encode_image(image, format, &save).map_err(|e| e.to_string())
            }
        }
    }
}

fn tone_map_name(map: ToneMap) -> String {
    let name = ToneMap::NAMES.into_iter().find(|name| ToneMap::from_name(name) == Some(map));
    name.unwrap_or("none").to_owned()
}
