//! One picture of `lumbre render`, the only one or one of several frames: from its description to its file.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use lumbre::description::{Camera, FilmKind, GroundDesc, IntegratorKind};
use lumbre::formats::image::ImageFormat;
use lumbre::formats::{Diagnostics, probe_writable};
use lumbre::{
    CancelToken, CheckpointSink, DVec3, Job, Picture, Prepared, RenderOptions, RenderState, SaveOptions,
    Scene, SceneDesc, Stage, Staged, in_words,
};
use serde_json::json;

use super::{
    Arguments, DARK_HINT, MIN_TIME, Metadata, check_film, check_whole, is_done_before, is_for_displays,
    is_nearly_black, options,
};
use crate::animation::Animation;
use crate::checkpoint::{Checkpoint, is_bare_part};
use crate::denoiser::Denoiser;
use crate::failure::{Failure, print_bytes};
use crate::output::{Inputs, Replaced, is_standard_stream};
use crate::progress::{Display, ProgressReporter, Series, Style};
use crate::reading::print_warnings;
use crate::report::{caustics_line, caustics_not_found, statistics, summary, warn_of_losses};
use crate::signals::{Phase, Signals};
use crate::staging::{self, Backdrop};

/// The inputs of a picture.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub(super) arguments: &'a Arguments,
    pub(super) stage: &'a Stage,
    /// The start of its reading.
    pub(super) start: Instant,
    pub(super) cancel: &'a CancelToken,
    pub(super) signals: &'a Signals,
    /// The one that was asked for.
    pub(super) denoiser: Option<&'a Denoiser>,
}

/// The stage of the first frame: camera and ground are the same in all others.
#[derive(Default)]
pub(super) struct FirstStage {
    cameras: Option<Vec<Camera>>,
    ground: Option<GroundDesc>,
}

impl FirstStage {
    fn hold(&mut self, staged: &Staged, desc: &mut SceneDesc) {
        if staged.framed {
            desc.cameras.clone_from(self.cameras.get_or_insert_with(|| desc.cameras.clone()));
        }
        if let (true, Some(ground)) = (staged.grounded, desc.ground) {
            desc.ground = Some(*self.ground.get_or_insert(ground));
        }
    }
}

/// One of several pictures.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    pub(super) number: u32,
    pub(super) is_first: bool,
    pub(super) series: Series,
}

/// The data of the first picture that all others share.
pub(super) struct First {
    /// The name, with `#` for the number of each picture.
    pub(super) pattern: Option<PathBuf>,
    pub(super) exposure: Option<f32>,
    /// The file of all frames, if they are in one.
    pub(super) animation: Option<Animation>,
}

/// Renders and saves a picture.
pub(super) fn picture(
    context: Context<'_>,
    desc: SceneDesc,
    diagnostics: &mut Diagnostics,
    frame: Option<(Frame, &mut FirstStage)>,
    first: &mut First,
) -> Result<(), Failure> {
    let built = Built::new(context, desc, diagnostics, frame, first)?;
    let mut options = built.options(diagnostics)?;
    built.warn(&options)?;
    let save = built.save_options(&options, first)?;
    let progress = built.progress(&save)?;
    let render_start = Instant::now();
    if let Some(deadline) = context.arguments.deadline(context.start) {
        // The time left after reading and building.
        let left = deadline.at.saturating_duration_since(render_start);
        options.stop.time = Some(left.max(MIN_TIME));
    }
    let Some((checkpoint, state)) = built.begin(&options, &save, diagnostics)? else { return Ok(()) };
    let (picture, state) = built.render(&options, &progress, &checkpoint, state)?;
    let render_time = render_start.elapsed();
    built.keep_samples(&progress, &picture, &checkpoint, &state);
    match check_whole(context.arguments, &picture, context.signals.received()) {
        // An interrupted animation has the frames that are done.
        Err(Failure::Interrupted(_)) if first.animation.as_ref().is_some_and(Animation::has_frames) => {
            return Ok(());
        }
        whole => whole?,
    }
    let rendered = Rendered { picture, state, options, checkpoint, time: render_time };
    let saved = built.save(rendered, save, first)?;
    built.report(&saved, diagnostics)
}

/// A built scene, and the name of its picture.
struct Built<'a> {
    context: Context<'a>,
    frame: Option<Frame>,
    kind: IntegratorKind,
    prepared: Prepared,
    behind: Backdrop,
    scene: Scene,
    /// Time of reading.
    load_time: Duration,
    output: PathBuf,
    is_piped: bool,
    /// `None` if the picture keeps its noise.
    denoiser: Option<&'a Denoiser>,
}

/// A picture with its samples.
struct Rendered {
    picture: Picture,
    state: RenderState,
    options: RenderOptions,
    checkpoint: Checkpoint,
    time: Duration,
}

/// A picture that was saved.
struct Saved<'p> {
    picture: Picture,
    options: RenderOptions,
    /// The files that it replaced.
    replaced: Vec<Replaced<'p>>,
    exposure: f32,
    render_time: Duration,
    denoised: Option<(&'static str, Duration)>,
    save_time: Duration,
}

impl<'a> Built<'a> {
    /// Stages and builds a description, and checks that the picture can be written.
    fn new(
        context: Context<'a>,
        mut desc: SceneDesc,
        diagnostics: &mut Diagnostics,
        frame: Option<(Frame, &mut FirstStage)>,
        first: &mut First,
    ) -> Result<Self, Failure> {
        let Context { arguments, stage, start, signals, denoiser, .. } = context;
        signals.enter(Phase::Preparing("building the scene"));
        let kind = arguments.integrator.unwrap_or(desc.integrator.kind);
        if denoiser.is_some() && kind.is_feature() {
            let why =
                "--denoise cannot be used with --integrator normals, depth, albedo or uv: they have no noise";
            return Err(Failure::Usage(why.to_owned()));
        }
        let prepared = lumbre::prepare(&mut desc, stage, arguments.integrator);
        let (frame, first_stage) = frame.unzip();
        if let Some(first_stage) = first_stage {
            first_stage.hold(prepared.staged(), &mut desc);
        }
        let is_first = frame.is_none_or(|frame| frame.is_first);
        let behind = arguments.staging.behind(&prepared, arguments.reading.limits_beside(diagnostics))?;
        let mut of_frames = Diagnostics::with_strictness(arguments.reading.strictness());
        arguments.reading.check_build(&desc, diagnostics)?;
        let told = if is_first { &mut *diagnostics } else { &mut of_frames };
        let scene = Scene::of_file(desc, &arguments.scene[0], told)?;
        let load_time = start.elapsed().saturating_sub(scene.build_time());
        if !arguments.quiet && is_first {
            print_warnings(diagnostics);
        }
        let number = frame.map(|frame| frame.number);
        let output = output(arguments, &scene, kind, number, diagnostics, first)?;
        // Parts store samples, not denoised pictures.
        let denoises = arguments.denoise.is_none() && !arguments.parts.keeps_sums() && prepared.denoises();
        let denoiser = denoiser.or(denoises.then_some(&Denoiser::Own));
        let is_piped = first.pattern.as_deref().is_some_and(is_standard_stream);
        Ok(Self { context, frame, kind, prepared, behind, scene, load_time, output, is_piped, denoiser })
    }

    /// Whether it is the only picture or the first of several.
    fn is_first(&self) -> bool {
        self.frame.is_none_or(|frame| frame.is_first)
    }

    /// The options of the render, which fits into memory.
    fn options(&self, diagnostics: &Diagnostics) -> Result<RenderOptions, Failure> {
        let Self { context: Context { arguments, .. }, kind, scene, denoiser, .. } = self;
        let is_denoised = denoiser.is_some() && !arguments.parts.keeps_sums();
        let mut options = options(arguments, scene, &self.prepared, is_denoised)?;
        options.transparent = self.behind.is_transparent();
        if arguments.spectral && !kind.carries_wavelengths() {
            let why = "--spectral works only with --integrator path or caustics";
            return Err(Failure::Usage(why.to_owned()));
        }
        options.spectral |= arguments.spectral;
        // Open Image Denoise needs albedo and normals.
        options.features |= matches!(denoiser, Some(Denoiser::Oidn(_)));
        options.guides = denoiser.is_some();
        let held = diagnostics.memory_held().saturating_add(scene.resolved().accel().memory_bytes() as u64);
        arguments.reading.memory().check_picture(&options, held)?;
        arguments.view.check_camera(scene, options.camera)?;
        Ok(options)
    }

    /// Warns of what a picture will not show.
    fn warn(&self, options: &RenderOptions) -> Result<(), Failure> {
        let Self { context: Context { arguments, .. }, prepared, scene, .. } = self;
        let (is_first, is_of_light) = (self.is_first(), prepared.is_of_light());
        let name = arguments.scene[0].display();
        let warn = |what: &str| {
            let what = format!("{name}: {what}");
            match arguments.reading.is_strict() {
                true => Err(Failure::input(what)),
                false if arguments.quiet || !is_first => Ok(()),
                false => {
                    say!("warning: {what}");
                    Ok(())
                }
            }
        };
        let has_media = scene.resolved().pov().is_some_and(|world| world.has_media);
        if is_of_light && self.kind != IntegratorKind::Pov && has_media {
            warn("fog and media of POV-Ray are rendered by --integrator pov alone")?;
        }
        if prepared.staged().framed && scene.resolved().accel().primitive_count() == 0 {
            warn("the scene has no shapes: the picture shows only the background")?;
        }
        if prepared.staged().guessed_up && is_first && !arguments.quiet {
            say!("{name}: z is up, since the model stands on a plane of z (--up y makes y up)");
        }
        let asks_for_front =
            prepared.staged().framed && arguments.view.is_from_front() && self.frame.is_none();
        if let Some(front) =
            arguments.reading.guessed_front(&arguments.scene[0], prepared.staged().guessed_up)
            && asks_for_front
            && !arguments.quiet
        {
            say!("{name}: its front is taken to face {front} (--azimuth 180 shows it from behind)");
        }
        if !options.spectral && is_first && is_of_light && scene.resolved().disperses() {
            warn(
                "glass does not disperse light without --spectral: its index at 587.6 nm is used for all colours",
            )?;
        }
        if scene.is_dark_by(self.kind) {
            warn("the scene has no light: its picture is black")?;
        }
        let camera = scene.resolved().cameras().get(options.camera);
        if let (Some(ground), Some(camera)) = (scene.resolved().ground(), camera)
            && staging::is_below(ground, camera.world_from_camera.point(DVec3::ZERO))
        {
            warn("the camera is below the ground, which hides everything (--ground none)")?;
        }
        Ok(())
    }

    /// How the picture is saved.
    fn save_options(&self, options: &RenderOptions, first: &mut First) -> Result<SaveOptions, Failure> {
        let Context { arguments, .. } = self.context;
        let mut save = self.prepared.save_options(&self.scene);
        save.tone_map = arguments.tonemap.unwrap_or(save.tone_map);
        save.exposure = match first.exposure {
            Some(exposure) => exposure,
            None if is_for_displays(&self.output) => {
                let stops = self.prepared.exposure(&self.scene, options)?;
                if stops != 0.0 && !arguments.quiet {
                    say!(
                        "exposed by {stops:.1} stops, for the brightness of the file's lights (--exposure 0 turns this off)"
                    );
                }
                *first.exposure.insert(stops)
            }
            None => *first.exposure.insert(0.0),
        };
        Ok(save)
    }

    /// What shows the progress of the render.
    fn progress(&self, save: &SaveOptions) -> Result<ProgressReporter<'a>, Failure> {
        let Context { arguments, signals, .. } = self.context;
        let is_silent = arguments.quiet || arguments.preview.is_some();
        let style = if is_silent { Style::None } else { arguments.progress };
        let viewers = arguments.viewers(&self.output, save.tone_map, save.exposure)?;
        let series = self.frame.map(|frame| frame.series);
        Ok(ProgressReporter {
            display: Display::new(style),
            signals,
            viewers,
            series,
            pass: Mutex::default(),
        })
    }

    /// The checkpoint of the render, and the state that it goes on from; `None` if the picture is there already.
    fn begin(
        &self,
        options: &RenderOptions,
        save: &SaveOptions,
        diagnostics: &Diagnostics,
    ) -> Result<Option<(Checkpoint, Option<RenderState>)>, Failure> {
        let Context { arguments, .. } = self.context;
        let files = diagnostics.files_read().iter().cloned();
        let files: Vec<PathBuf> = files.chain(arguments.inputs().map(ToOwned::to_owned)).collect();
        let number = self.frame.map(|frame| frame.number);
        let mut settings = arguments.settings();
        settings.push(("picture".to_owned(), in_words(&number)));
        // The first picture determines camera and ground.
        let first_number = self.frame.map(|Frame { series, .. }| series.number - series.done);
        settings.push(("first picture".to_owned(), in_words(&first_number)));
        let shown = arguments.shown(&self.behind, save.tone_map, save.exposure, save.exr_precision);
        let job_options = options.clone();
        // If files cannot be read again, such as standard input, the render has no identity.
        let job = move || {
            let files = files.iter().map(PathBuf::as_path);
            Ok(Job { shown, ..Job::new(files, settings, &job_options)? })
        };
        let is_one_of_several = number.is_some();
        let job: Box<dyn FnOnce() -> Result<Job, lumbre::Error> + Send> =
            if is_one_of_several && arguments.parts.resumes() {
                let found = job().map_err(Failure::from)?;
                if is_done_before(&self.output, &found, options) {
                    if !arguments.quiet {
                        say!("{}: already rendered", self.output.display());
                    }
                    return Ok(None);
                }
                Box::new(move || Ok(found))
            } else {
                Box::new(job)
            };
        let memory = arguments.reading.memory();
        let (parts, output, is_quiet) = (&arguments.parts, &self.output, arguments.quiet);
        Checkpoint::begin(parts, output, memory, options.stop.spp, is_quiet, is_one_of_several, job).map(Some)
    }

    /// Renders, and keeps checkpoints.
    fn render(
        &self,
        options: &RenderOptions,
        progress: &ProgressReporter<'_>,
        checkpoint: &Checkpoint,
        state: Option<RenderState>,
    ) -> Result<(Picture, RenderState), Failure> {
        let Context { cancel, signals, .. } = self.context;
        let keep = |state| checkpoint.keep(state);
        let keeper = checkpoint.every().map(|every| CheckpointSink { every, keep: &keep });
        signals.enter(Phase::Rendering);
        Ok(self.scene.render_from(options, progress, cancel, state, keeper.as_ref())?)
    }

    /// Keeps the samples of a render that was interrupted or is to be continued, and says where they are.
    fn keep_samples(
        &self,
        progress: &ProgressReporter<'_>,
        picture: &Picture,
        checkpoint: &Checkpoint,
        state: &RenderState,
    ) {
        let Context { arguments, cancel, signals, .. } = self.context;
        progress.finish(picture.image());
        signals.enter(Phase::Saving);
        let is_cut_short = cancel.is_cancelled();
        let is_told = is_cut_short && !arguments.quiet;
        match checkpoint.end(state, !is_cut_short) {
            Ok(Some(path)) if is_told => {
                say!("{}: checkpoint saved (--resume continues from it)", path.display());
            }
            Ok(None) if is_told && checkpoint.is_possible() => {
                say!(
                    "hint: --checkpoint FILE saves the samples, for --resume (renders of more than two minutes do so by themselves)"
                );
            }
            Ok(_) => {}
            // The picture may still be saved.
            Err(why) => say!("warning: cannot write the checkpoint: {why}"),
        }
    }

    /// Denoises and saves a picture.
    fn save(
        &self,
        rendered: Rendered,
        mut save: SaveOptions,
        first: &mut First,
    ) -> Result<Saved<'_>, Failure> {
        let Context { arguments, signals, cancel, .. } = self.context;
        let Rendered { mut picture, state, options, checkpoint, time } = rendered;
        let denoised = match self.denoiser {
            Some(denoiser) if denoiser.takes(picture.stats().stride) => {
                Some((denoiser.name(), denoiser.apply(&mut picture, options.threads)?))
            }
            _ => None,
        };
        let pictures = std::iter::once(&self.output).filter(|_| first.animation.is_none());
        let replaced = pictures.chain(&arguments.stats).map(|path| Replaced::by(path)).collect();
        let stream = signals.enter_writing(&self.output)?;
        let start = Instant::now();
        if let Ok(job) = checkpoint.job() {
            let first = options.first_sample;
            save.metadata = job.metadata(&(first..first + picture.stats().spp));
        }
        if arguments.metadata == Metadata::Full {
            let words: Vec<String> = std::env::args().collect();
            save.metadata.push(("lumbreCommand".to_owned(), words.join(" ")));
            save.metadata.push(("lumbreSeconds".to_owned(), format!("{:.2}", time.as_secs_f64())));
        }
        let picture = match &self.behind {
            Backdrop::Background(background) => picture.over(background.clone()),
            Backdrop::Lights | Backdrop::Nothing => picture,
        };
        match self.write(&picture, &save, &checkpoint, &state, first) {
            Err(Failure::Io(why)) => {
                return Err(Failure::Io(match checkpoint.rescue(&state, &self.output) {
                    Some(kept) => format!(
                        "{why}; the samples are saved in {kept} (lumbre merge {kept} -o PICTURE makes a picture of them)",
                        kept = kept.display()
                    ),
                    None => why,
                }));
            }
            written => written?,
        }
        drop(stream);
        if !cancel.is_cancelled() {
            checkpoint.remove();
        }
        let (exposure, save_time) = (save.exposure, start.elapsed());
        Ok(Saved { picture, options, replaced, exposure, render_time: time, denoised, save_time })
    }

    /// Writes a picture to where it belongs.
    fn write(
        &self,
        picture: &Picture,
        save: &SaveOptions,
        checkpoint: &Checkpoint,
        state: &RenderState,
        first: &mut First,
    ) -> Result<(), Failure> {
        let (Context { arguments, .. }, output) = (self.context, &self.output);
        if let Some(animation) = &mut first.animation {
            return animation.add(picture, save);
        }
        if is_bare_part(output) {
            return Ok(checkpoint.part(state)?.save(output)?);
        }
        if arguments.parts.keeps_sums() {
            let part = checkpoint.part(state)?;
            return Ok(picture.save_with_part(output, save, &arguments.aov, &part)?);
        }
        if self.is_piped {
            let format = arguments.output_format.unwrap_or(ImageFormat::Png);
            return print_bytes(&picture.encode(format, save, &arguments.aov)?);
        }
        Ok(picture.save_with(output, save, &arguments.aov)?)
    }

    /// Says what was rendered, and writes its statistics.
    fn report(&self, saved: &Saved<'_>, diagnostics: &Diagnostics) -> Result<(), Failure> {
        let Self { context: Context { arguments, signals, .. }, scene, .. } = self;
        let Saved { picture, options, replaced, exposure, render_time, denoised, save_time } = saved;
        warn_of_losses(arguments.threads.is_some(), picture);
        let is_first = self.is_first();
        let is_told = is_first && !arguments.quiet && self.prepared.is_of_light() && !scene.is_dark();
        if is_told && picture.stats().spp > 0 && is_nearly_black(picture.image(), *exposure) {
            say!("{DARK_HINT}");
        }
        if let Some(path) = &arguments.stats {
            let seconds = json!({
                "load": self.load_time.as_secs_f64(),
                "build": scene.build_time().as_secs_f64(),
                "render": render_time.as_secs_f64(),
                "denoise": denoised.map(|(_, time)| time.as_secs_f64()),
                "save": save_time.as_secs_f64(),
            });
            let report = statistics(scene, picture, seconds, diagnostics.lines());
            let pipe = Signals::open_pipe(path)?;
            let stream = signals.enter_writing(path)?;
            drop(pipe);
            lumbre::formats::atomic_write(path, |file| writeln!(file, "{report:#}"))
                .map_err(|e| Failure::from(lumbre::Error::from(e)))?;
            drop(stream);
        }
        if !arguments.quiet {
            replaced.iter().for_each(Replaced::say);
            let name =
                if self.is_piped { "standard output".into() } else { self.output.display().to_string() };
            summary(arguments.verbose, &options.stop, scene, picture, &name, *render_time, *denoised);
            if is_first && let Some(share) = caustics_not_found(scene, options) {
                say!("hint: {}", caustics_line(share));
            }
        }
        Ok(())
    }
}

/// The name of the picture of a scene, which may be written; `number` is that of a frame.
fn output(
    arguments: &Arguments,
    scene: &Scene,
    kind: IntegratorKind,
    number: Option<u32>,
    diagnostics: &Diagnostics,
    first: &mut First,
) -> Result<PathBuf, Failure> {
    let inputs = diagnostics.files_read().iter().map(PathBuf::as_path).chain(arguments.inputs());
    let inputs = Inputs::of(inputs);
    let pattern = match &first.pattern {
        Some(pattern) => pattern.clone(),
        None => first.pattern.insert(arguments.pattern(scene, &inputs)?).clone(),
    };
    let named = arguments.named(&pattern);
    arguments.check_format(&named)?;
    let film = if kind.is_feature() { FilmKind::Rgb } else { scene.resolved().film().kind };
    check_film(&named, film)?;
    arguments.staging.check(Some(&named))?;
    arguments.parts.check(&arguments.scene, &named, arguments.spp)?;
    let is_piped = is_standard_stream(&pattern);
    let output = number.map_or(named.to_path_buf(), |number| staging::frame_name(&pattern, number));
    for path in std::iter::once(&output).filter(|_| !is_piped).chain(&arguments.stats) {
        inputs.refuse(path)?;
        probe_writable(path).map_err(|e| Failure::from(lumbre::Error::from(e)))?;
    }
    Ok(output)
}
