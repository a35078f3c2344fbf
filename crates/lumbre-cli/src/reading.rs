//! Opening a scene as the command line specifies, and printing warnings.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use lumbre::formats::diagnostic::Diagnostic;
use lumbre::formats::pov::PovOptions;
use lumbre::formats::{Budget, Diagnostics, Input, Limits, SceneFormat, Strictness};
use lumbre::{Error, Scene, SceneDesc, Setting, in_words};

use crate::failure::Failure;
use crate::memory::Memory;
use crate::names::one_of;
use crate::units;

/// How scene files are read.
#[derive(Args)]
#[command(next_help_heading = "Reading")]
pub(crate) struct ReadingArguments {
    /// The format of standard input or of a file with an unknown extension. By default it is detected from the content.
    #[arg(long, value_name = "FORMAT", value_parser = one_of(&SceneFormat::NAMES, SceneFormat::from_name))]
    input_format: Option<SceneFormat>,
    /// Warnings are errors.
    #[arg(long, conflicts_with = "lenient")]
    strict: bool,
    /// Leave out broken parts (such as faces with missing vertices) with a warning instead of an error.
    #[arg(long)]
    lenient: bool,
    /// The time in seconds at which the animations of a glTF are evaluated.
    #[arg(long, value_name = "T", value_parser = seconds, help_heading = "Animation")]
    frame: Option<f64>,
    /// How long the shutter is open about the time of a glTF's frame, as a fraction of the frame interval (see --fps):
    /// 0, the default, is an instant; 0.5 is usual in film. Animated objects get motion blur.
    #[arg(long, value_name = "S", value_parser = shutter, help_heading = "Animation")]
    shutter: Option<f64>,
    /// Frames per second, for --frames, --shutter, and a .gif or a video.
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = rate, help_heading = "Animation")]
    fps: f64,
    /// The animation of a glTF to play, by its name or its index from 0. By default all play at once, except those that
    /// conflict with an earlier one.
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Animation")]
    animation: Option<String>,
    /// The material variant of a glTF.
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// A folder of files that a POV-Ray scene includes, besides its own folder and where Debian has POV-Ray's own. May
    /// be repeated; the first folder is searched first.
    #[arg(long, value_name = "DIR")]
    pov_include: Vec<PathBuf>,
    /// The clock value of a POV-Ray scene, or A..B for the first and the last frame of --frames.
    #[arg(long, value_name = "K|A..B", value_parser = Clock::from_str, allow_hyphen_values = true, hide_short_help = true,
          help_heading = "Animation")]
    pov_clock: Option<Clock>,
    /// All frames of a POV-Ray animation, which its clock runs over, if --frames renders only some of them.
    #[arg(long, value_name = "A..B", hide_short_help = true, help_heading = "Animation")]
    pov_frames: Option<Frames>,
    /// The animation of a POV-Ray scene is a loop: the frame after the last one is the first one again.
    #[arg(long, hide_short_help = true, help_heading = "Animation")]
    pov_cyclic: bool,
    /// Declare a number or a text before a POV-Ray scene is read.
    #[arg(long, value_name = "NAME=VALUE", value_parser = declared, hide_short_help = true, help_heading = "Parameters")]
    pov_declare: Vec<(String, String)>,
    /// The size of the picture, which POV-Ray scenes ask for.
    #[arg(skip)]
    picture_size: Option<(u32, u32)>,
    /// Set a parameter of the scene: material.NAME.PARAM, light.INDEX.PARAM, light.area.scale, camera.PARAM or
    /// film.PARAM. For a wrong name, the error lists the valid ones.
    #[arg(short = 'D', long = "define", value_name = "PATH=VALUE", help_heading = "Parameters", value_parser = Setting::from_str)]
    settings: Vec<Setting>,
    /// A file of such settings, one per line; # begins a comment line.
    #[arg(long, value_name = "FILE", help_heading = "Parameters")]
    overlay: Vec<PathBuf>,
    /// Memory limit: for reading files (default 8G), and for the scene and picture (default: the free memory).
    #[arg(long, value_name = "SIZE", value_parser = units::bytes, help_heading = "Limits")]
    max_memory: Option<u64>,
    /// Limit on the number of vertices, faces, shapes and parameters that are read.
    #[arg(long, value_name = "N", value_parser = units::whole(0..=u64::MAX), hide_short_help = true, help_heading = "Limits")]
    max_elements: Option<u64>,
    /// Limit on the depth of nested includes and blocks.
    #[arg(long, value_name = "N", value_parser = units::whole(0..=u32::MAX), hide_short_help = true, help_heading = "Limits")]
    max_nesting: Option<u32>,
    /// Limit on the number of files that are opened.
    #[arg(long, value_name = "N", value_parser = units::whole(0..=u64::MAX), hide_short_help = true, help_heading = "Limits")]
    max_files: Option<u64>,
    /// Limit on how many times compressed data, or included files, may grow.
    #[arg(long, value_name = "N", value_parser = units::whole(0..=u64::MAX), hide_short_help = true, help_heading = "Limits")]
    max_expansion: Option<u64>,
}

fn seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|t: &f64| t.is_finite()).ok_or_else(|| "expected a number of seconds".to_owned())
}

fn shutter(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share: &f64| (0.0..=100.0).contains(share));
    share.ok_or_else(|| "expected a share of a frame, such as 0.5".to_owned())
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate: &f64| (1e-3..=1e6).contains(rate));
    rate.ok_or_else(|| "expected frames a second, such as 24".to_owned())
}

/// Frames from a first to a last one, both included.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Frames(pub std::ops::RangeInclusive<u32>);

/// The maximal number of frames in a run, and the largest frame number.
const MAX_FRAMES: u32 = 1_000_000;

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("expected the first and the last frame, such as 0..47, up to {MAX_FRAMES}");
        let (first, last) = text.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| text.parse().ok().filter(|&n: &u32| n <= MAX_FRAMES);
        let (first, last) = (number(first).ok_or_else(wrong)?, number(last).ok_or_else(wrong)?);
        if last < first { Err(wrong()) } else { Ok(Self(first..=last)) }
    }
}

/// The clock of a POV-Ray scene: in a still, or in the first and in the last frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clock([f64; 2]);

impl FromStr for Clock {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (from, to) = text.split_once("..").unwrap_or((text, text));
        let number = |text: &str| text.parse().ok().filter(|x: &f64| x.is_finite());
        let wrong = || "expected a number, or two, such as 0..1".to_owned();
        Ok(Self([number(from).ok_or_else(wrong)?, number(to).ok_or_else(wrong)?]))
    }
}

fn declared(text: &str) -> Result<(String, String), String> {
    let is_name = |name: &str| {
        let mut bytes = name.bytes();
        let first = bytes.next().is_some_and(|byte| byte.is_ascii_alphabetic() || byte == b'_');
        first && bytes.all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    };
    match text.split_once('=') {
        Some((name, value)) if is_name(name) => Ok((name.to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE, such as Turns=3".to_owned()),
    }
}

impl Default for ReadingArguments {
    /// Those of a command line that says nothing of it.
    fn default() -> Self {
        Self {
            input_format: None,
            strict: false,
            lenient: false,
            frame: None,
            shutter: None,
            fps: 24.0,
            animation: None,
            variant: None,
            pov_include: Vec::new(),
            pov_clock: None,
            pov_frames: None,
            pov_cyclic: false,
            pov_declare: Vec::new(),
            picture_size: None,
            settings: Vec::new(),
            overlay: Vec::new(),
            max_memory: None,
            max_elements: None,
            max_nesting: None,
            max_files: None,
            max_expansion: None,
        }
    }
}

impl ReadingArguments {
    /// Tells POV-Ray scenes the size of the picture, and the frames that their clock runs over if nothing else does.
    pub(crate) fn tell_pov(&mut self, size: Option<(u32, u32)>, frames: Option<&Frames>) {
        self.picture_size = size;
        self.pov_frames = self.pov_frames.take().or_else(|| frames.cloned());
    }

    /// The memory that is left.
    pub(crate) fn memory(&self) -> Memory {
        Memory::new(self.max_memory)
    }

    /// The limits on reading.
    pub(crate) fn limits(&self) -> Limits {
        let mut limits = Limits::default();
        limits.memory = self.memory().for_reading();
        limits.elements = self.max_elements.unwrap_or(limits.elements);
        limits.nesting = self.max_nesting.unwrap_or(limits.nesting);
        limits.files = self.max_files.unwrap_or(limits.files);
        limits.expansion = self.max_expansion.unwrap_or(limits.expansion);
        limits
    }

    /// The limits on reading more, beside what was read.
    pub(crate) fn limits_beside(&self, read: &Diagnostics) -> Limits {
        let mut limits = self.limits();
        limits.memory = limits.memory.saturating_sub(read.memory_held());
        limits
    }

    /// Whether warnings are errors.
    pub(crate) fn is_strict(&self) -> bool {
        self.strict
    }

    /// The axis that the front of a model is taken to face, where its format says nothing of it.
    pub(crate) fn guessed_front(&self, path: &Path, is_z_up: bool) -> Option<&'static str> {
        match self.input_format.or(SceneFormat::from_path(path))? {
            SceneFormat::Obj | SceneFormat::Ply => Some(if is_z_up { "-y" } else { "+z" }),
            SceneFormat::Stl => Some("-y"),
            _ => None,
        }
    }

    /// How to treat invalid input.
    pub(crate) fn strictness(&self) -> Strictness {
        match (self.strict, self.lenient) {
            (true, _) => Strictness::Strict,
            (_, true) => Strictness::Lenient,
            _ => Strictness::Normal,
        }
    }

    /// Reads one or more files as one scene.
    ///
    /// # Errors
    /// [`Failure`] by kind of error.
    pub(crate) fn open(&self, paths: &[PathBuf]) -> Result<(Scene, Diagnostics), Failure> {
        let (desc, mut diagnostics) = self.describe(paths)?;
        self.check_build(&desc, &diagnostics)?;
        let name = paths.first().map_or(Path::new(""), PathBuf::as_path);
        let scene = Scene::of_file(desc, name, &mut diagnostics)?;
        Ok((scene, diagnostics))
    }

    /// Refuses a description whose scene would not fit into memory beside it.
    ///
    /// # Errors
    /// [`Failure::Limit`] with the prediction.
    pub(crate) fn check_build(&self, desc: &SceneDesc, diagnostics: &Diagnostics) -> Result<(), Failure> {
        let needed = lumbre::predicted_build_bytes(desc);
        self.memory().check("building the scene", needed, diagnostics.memory_held())
    }

    /// Refuses what is no file of a scene, as reading it would, before anything is read.
    ///
    /// # Errors
    /// As for [`ReadingArguments::open`].
    pub(crate) fn check_file(&self, path: &Path) -> Result<(), Failure> {
        let mut options = lumbre::ReadOptions::default();
        (options.limits, options.format) = (self.limits(), self.input_format);
        lumbre::formats::check_scene_file(path, &options).map_err(|error| Error::from(error).into())
    }

    /// Reads one or more files as one description.
    ///
    /// # Errors
    /// As for [`ReadingArguments::open`].
    pub(crate) fn describe(&self, paths: &[PathBuf]) -> Result<(SceneDesc, Diagnostics), Failure> {
        self.describe_at(paths, self.frame, None)
    }

    /// [`Self::describe`] at the frame of this number.
    ///
    /// # Errors
    /// As for [`ReadingArguments::open`].
    pub(crate) fn describe_frame(
        &self,
        paths: &[PathBuf],
        number: u32,
    ) -> Result<(SceneDesc, Diagnostics), Failure> {
        self.describe_at(paths, Some(f64::from(number) / self.fps), Some(number))
    }

    /// [`Self::describe`] at another moment, and with another variant, where they are given. A scene that came with a
    /// folder may use no files but those in it: see [`lumbre::ReadOptions::folder`].
    ///
    /// # Errors
    /// As for [`ReadingArguments::open`].
    pub(crate) fn describe_moment(
        &self,
        paths: &[PathBuf],
        time: Option<f64>,
        variant: Option<&str>,
        folder: Option<&Path>,
    ) -> Result<(SceneDesc, Diagnostics), Failure> {
        self.describe_as(paths, time.or(self.frame), None, variant.or(self.variant.as_deref()), folder)
    }

    fn describe_at(
        &self,
        paths: &[PathBuf],
        time: Option<f64>,
        number: Option<u32>,
    ) -> Result<(SceneDesc, Diagnostics), Failure> {
        self.describe_as(paths, time, number, self.variant.as_deref(), None)
    }

    fn describe_as(
        &self,
        paths: &[PathBuf],
        time: Option<f64>,
        number: Option<u32>,
        variant: Option<&str>,
        folder: Option<&Path>,
    ) -> Result<(SceneDesc, Diagnostics), Failure> {
        let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        let memory = self.memory();
        let mut options = self.options(time)?;
        self.pov_options(number, &mut options.pov);
        options.variant = variant.map(str::to_owned);
        (options.only_named_files, options.folder) = (folder.is_some(), folder.map(Path::to_owned));
        let read = lumbre::describe(&paths, &options);
        let (mut desc, mut diagnostics) = read.map_err(|error| memory.explain(error))?;
        if let (None, Some(animation)) = (time, &self.animation) {
            let what = format!("the animation {animation} is shown at 0 s (--frame gives another time)");
            diagnostics.push(Diagnostic::note(what));
        }
        self.warn_of_unused(&paths, &mut diagnostics)?;
        for path in &self.overlay {
            self.overlay(path, &mut desc)?;
        }
        for setting in &self.settings {
            setting.apply(&mut desc).map_err(|wrong| Failure::Usage(format!("-D: {wrong}")))?;
        }
        Ok((desc, diagnostics))
    }

    /// Frames per second.
    pub(crate) fn fps(&self) -> f64 {
        self.fps
    }

    /// Warns of options that apply to another format than the files have.
    ///
    /// # Errors
    /// [`Failure::Input`] with the first, under `--strict`.
    fn warn_of_unused(&self, paths: &[&Path], diagnostics: &mut Diagnostics) -> Result<(), Failure> {
        // What is detected by its content is not known here.
        let formats: Option<Vec<SceneFormat>> =
            paths.iter().map(|path| self.input_format.or(SceneFormat::from_path(path))).collect();
        let (Some(formats), Some(first)) = (formats, paths.first()) else { return Ok(()) };
        let has_gltf = formats.contains(&SceneFormat::Gltf);
        let has_pov = formats.contains(&SceneFormat::Pov);
        let of_gltf = [
            ("--frame", self.frame.is_some()),
            ("--shutter", self.shutter.is_some()),
            ("--animation", self.animation.is_some()),
            ("--variant", self.variant.is_some()),
        ];
        let of_pov = [
            ("--pov-include", !self.pov_include.is_empty()),
            ("--pov-clock", self.pov_clock.is_some()),
            ("--pov-frames", self.pov_frames.is_some()),
            ("--pov-cyclic", self.pov_cyclic),
            ("--pov-declare", !self.pov_declare.is_empty()),
        ];
        let unused = of_gltf.iter().filter(|_| !has_gltf).map(|option| (option, "a glTF file"));
        let unused =
            unused.chain(of_pov.iter().filter(|_| !has_pov).map(|option| (option, "a POV-Ray scene")));
        for ((option, _), kind) in unused.filter(|((_, is_given), _)| *is_given) {
            let what = format!("{option} has no effect: {} is not {kind}", first.display());
            diagnostics.push(Diagnostic::warning(what));
        }
        Ok(diagnostics.check().map_err(Error::from)?)
    }

    /// What the scene depends on besides its files, by name.
    pub(crate) fn scene_settings(&self) -> Vec<(String, String)> {
        let Self { lenient, frame, shutter, fps, animation, variant, settings, .. } = self;
        let Self { pov_clock, pov_frames, pov_cyclic, pov_declare, .. } = self;
        let text = |name: &str, value: String| (name.to_owned(), value);
        vec![
            text("lenient", lenient.to_string()),
            text("frame", in_words(&(frame, shutter, fps, animation))),
            text("variant", in_words(variant)),
            text("settings", in_words(settings)),
            text("pov", in_words(&(pov_clock, pov_frames, pov_cyclic, pov_declare))),
        ]
    }

    /// The files of settings, which are read too.
    pub(crate) fn overlays(&self) -> impl Iterator<Item = &Path> {
        self.overlay.iter().map(PathBuf::as_path)
    }

    fn overlay(&self, path: &Path, desc: &mut SceneDesc) -> Result<(), Failure> {
        let budget = Budget::new(self.limits());
        let input = Input::open(path, &budget).map_err(Error::from)?;
        let text = input.text().map_err(Error::from)?;
        for (number, line) in (1..).zip(text.lines()) {
            let start = 1 + line.chars().take_while(|c| c.is_whitespace()).count();
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let set = Setting::from_str(line).and_then(|setting| setting.apply(desc));
            set.map_err(|wrong| Failure::input(format!("{}:{number}:{start}: {wrong}", path.display())))?;
        }
        Ok(())
    }

    /// Sets the values that a POV-Ray scene can read: declares, the picture and the frame.
    fn pov_options(&self, number: Option<u32>, pov: &mut PovOptions) {
        pov.library.clone_from(&self.pov_include);
        pov.declares.clone_from(&self.pov_declare);
        if let Some((width, height)) = self.picture_size {
            (pov.width, pov.height) = (width, height);
        }
        if let Some(Clock(clocks)) = self.pov_clock {
            pov.clocks = clocks;
            pov.clock = clocks[0];
        }
        if let (Some(number), Some(Frames(frames))) = (number, &self.pov_frames) {
            let (first, last) = (*frames.start(), *frames.end());
            let [from, to] = pov.clocks;
            let steps = last - first + u32::from(self.pov_cyclic);
            pov.frames = Some([first, last]);
            pov.frame_number = number;
            let done = f64::from(number.saturating_sub(first)) / f64::from(steps.max(1));
            pov.clock = from + (to - from) * done;
        }
    }

    fn options(&self, frame: Option<f64>) -> Result<lumbre::ReadOptions, Failure> {
        if self.shutter.is_some() && frame.is_none() {
            return Err(Failure::Usage("--shutter needs --frame or --frames".to_owned()));
        }
        let frame = match (frame, &self.animation) {
            (None, Some(_)) => Some(0.0),
            (frame, _) => frame,
        };
        let mut options = lumbre::ReadOptions::default();
        options.limits = self.limits();
        options.format = self.input_format;
        options.strictness = self.strictness();
        options.frame = frame;
        options.shutter = self.shutter.unwrap_or(0.0) / self.fps;
        options.animation = self.animation.clone();
        options.variant = self.variant.clone();
        Ok(options)
    }
}

/// Prints warnings to standard error, and the number omitted.
pub(crate) fn print_warnings(diagnostics: &Diagnostics) {
    for line in diagnostics.lines() {
        say!("{line}");
    }
    match diagnostics.warnings() {
        0 => {}
        n => say!("{}", units::counted(n, "warning")),
    }
}

#[cfg(test)]
mod tests {
    use super::Frames;

    #[test]
    fn frames_are_counted_with_the_last() {
        assert_eq!("0..2".parse(), Ok(Frames(0..=2)));
        assert_eq!("17..17".parse(), Ok(Frames(17..=17)));
        for text in ["", "3", "..4", "5..4", "1..x", "-1..2", "0..4000000000"] {
            assert!(text.parse::<Frames>().is_err(), "{text}");
        }
    }
}
