//! `lumbre render`: renders a picture of a scene.

mod picture;
pub(crate) mod series;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{IsTerminal, Read};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use lumbre::description::{CameraKind, FilmKind, IntegratorKind};
use lumbre::formats::SceneFormat;
use lumbre::formats::image::{ExrPrecision, ImageFormat};
use lumbre::image::{Image, ToneMap};
use lumbre::math::Elementary;
use lumbre::shading::ShadingNormals;
use lumbre::{Feature, Job, Picture, PixelBounds, Prepared, RenderOptions, Scene, Stop, in_words};

use crate::animation::{Animation, ENDINGS, is_animation};
use crate::checkpoint::{PartArguments, is_bare_part};
use crate::denoiser::Choice;
use crate::failure::Failure;
use crate::names::one_of;
use crate::output::{self, Inputs, Pictures, is_standard_stream};
use crate::preview::{Preview, Protocol};
use crate::progress::{PictureViewer, Style};
use crate::reading::{Frames, ReadingArguments};
use crate::signals::Deadline;
use crate::staging::{Backdrop, StagingArguments};
use crate::tev::Tev;
use crate::units::{self, Crop, spoken};
use crate::view::ViewArguments;

/// Renders a scene to a picture.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre render scene.pbrt
  lumbre render scene.pbrt -o out.exr --spp 1024 --time 10m
  lumbre render model.obj --size 1920x1080 --tonemap agx --exposure 0.5
  lumbre render scene.pbrt -o clean.exr --spp 16 --denoise
  lumbre render scene.pbrt -o part.exr --crop 100,50,300,200
  lumbre render scene.pbrt -o all.exr --aov albedo,normal,depth
  curl https://example.org/fox.glb | lumbre render - -o - | display

A model without camera and light is framed, lit as in a studio, and stands on its shadow:
  lumbre render chair.glb
  lumbre render part.stl --background white --ground plane
  lumbre render chair.glb --env garden.hdr --ground none
  lumbre render chair.glb -o chair.png --background transparent
  lumbre render chair.glb --turntable 72 -o frame.####.png
  lumbre render chair.glb --turntable 36 --size 400x300 -o turn.gif
  lumbre render street.gltf --camera \"Bird's eye\"
  lumbre render street.gltf --fit --variant winter

From elsewhere than the front, the right and above:
  lumbre render chair.glb --azimuth 90 --elevation 15 --zoom 1.5
  lumbre render part.obj --up z --ortho
  lumbre render scene.pbrt --eye 3,-8,2 --target 0,0,1 --fov 35

With other parameters than those of the file:
  lumbre render chair.glb -D material.Wood.roughness=0.2 -D material.Wood.base_color=#704020
  lumbre render scene.pbrt --overlay evening.txt

Animations of a glTF, at a time in seconds, or frame by frame with motion blur:
  lumbre render dancer.glb --frame 1.5 --shutter 0.5
  lumbre render dancer.glb --frames 0..47 --fps 24 --shutter 0.5 -o frame.####.png

Ctrl-C stops and saves what is there, if every pixel has a sample; a second one stops at once and saves nothing.")]
pub(crate) struct Arguments {
    /// The scene: .pbrt, .gltf, .glb, .obj, .ply, .stl or .pov, also compressed with gzip; - is standard input. Several
    /// .pbrt files are read one after another; files of other formats are put into the same world.
    #[arg(required = true, value_name = "SCENE")]
    scene: Vec<PathBuf>,
    /// The picture: .exr, .png, .jpg, .webp, .qoi, .hdr or .pfm; - is standard output. Several are one file that ends
    /// in .gif, .mp4, .webm, .mkv or .mov. By default the film's name in the scene, else NAME.png. If that file is an
    /// input, or not written by Lumbre: NAME.render.png.
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// The format of a picture on standard output: png by default.
    #[arg(long, value_name = "FORMAT", value_parser = one_of(&WRITTEN, written_format))]
    output_format: Option<ImageFormat>,
    /// Samples per pixel. By default as many as the scene says, else 64; 16 for a model that is denoised; 8 for a scene
    /// of POV-Ray.
    #[arg(long, value_name = "N", value_parser = units::whole(1..=u32::MAX))]
    spp: Option<u32>,
    /// Stop after this time, counted from the start (of each frame), as 90s, 2m or 1h30m.
    #[arg(long, value_name = "DUR", value_parser = units::duration)]
    time: Option<Duration>,
    /// Stop sampling a pixel when its noise is below this share of its luminance, such as 0.02. The render ends
    /// at --spp or --time at the latest. Without either it runs until every pixel reaches the target. The progress
    /// shows the time left, and Ctrl-C saves the picture.
    #[arg(long, value_name = "R", value_parser = noise)]
    noise: Option<f64>,
    /// With --noise: at least this many samples per pixel. By default 16, or up to 256 where most of the light comes
    /// from rare samples.
    #[arg(long, value_name = "N", requires = "noise", value_parser = units::whole(1..=u32::MAX))]
    min_spp: Option<u32>,
    /// Denoise the picture. With Lumbre's own filter (own, or auto, which is the same), or with Open Image Denoise if
    /// it is installed (oidn; the variable OIDN_DIR names its folder). An .exr keeps the noisy picture too, in noisy.R,
    /// noisy.G and noisy.B. By default own in the light of the studio, else none.
    #[arg(long, value_name = "WITH", num_args = 0..=1, default_missing_value = "auto",
          value_parser = one_of(&Choice::NAMES, Choice::from_name))]
    denoise: Option<Choice>,
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", value_parser = units::size)]
    size: Option<(u32, u32)>,
    /// Frames of an animation from A to B, both included, as -o frame.####.png, or in one file, as -o walk.gif or
    /// walk.mp4 (by ffmpeg). Frame n shows the time n / --fps.
    #[arg(long, value_name = "A..B", conflicts_with_all = ["frame", "turntable"], help_heading = "Animation")]
    frames: Option<Frames>,
    /// Render only this rectangle, in pixels or in fractions of the picture.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = units::crop)]
    crop: Option<Crop>,
    /// A camera of the scene, by its name or its index from 0.
    #[arg(long, value_name = "NAME|INDEX", help_heading = "View")]
    camera: Option<String>,
    /// What each pixel shows: light, or a property of the visible surface.
    #[arg(long, value_name = "NAME", value_parser = one_of(&IntegratorKind::NAMES, IntegratorKind::from_name))]
    integrator: Option<IntegratorKind>,
    /// The maximum number of bounces.
    #[arg(long, value_name = "N", value_parser = units::whole(0..=u32::MAX))]
    max_depth: Option<u32>,
    /// How shading normals are treated: lumbre keeps coarse meshes free of black edges and leaks, pbrt does as pbrt-v4.
    /// By default what the scene says, else lumbre.
    #[arg(long, value_name = "HOW", value_parser = one_of(&SHADING_NORMALS, ShadingNormals::from_name))]
    shading_normals: Option<ShadingNormals>,
    /// Carry three wavelengths along each path in place of red, green and blue. Colours that multiply many times,
    /// spectra of lights and glass that disperses are then right. Only with the integrator path. By default if the
    /// scene's film is spectral.
    #[arg(long)]
    spectral: bool,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", value_parser = units::whole(0..=u64::MAX))]
    seed: Option<u64>,
    /// Threads; all cores by default. The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = units::whole(1_u16..=1024))]
    threads: Option<u16>,
    /// Exposure in stops, for .png and .jpg. By default 0, unless a glTF's own lights would make its picture white or
    /// black: then it is measured.
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = exposure)]
    exposure: Option<f32>,
    /// Tone mapping, for .png and .jpg. By default neutral with the light of the studio or --env, else none.
    #[arg(long, value_name = "NAME", value_parser = one_of(&ToneMap::NAMES, ToneMap::from_name))]
    tonemap: Option<ToneMap>,
    /// AOVs as layers of an .exr, separated by commas.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = one_of(&Feature::NAMES, Feature::from_name))]
    aov: Vec<Feature>,
    /// Which metadata .exr and .png contain. Plain: what the pixels depend on (version, a hash of the scene and the
    /// options, seed, samples, camera), the same for every run. Full: also the command and its time.
    #[arg(long, value_enum, value_name = "WHICH", default_value_t = Metadata::Plain)]
    metadata: Metadata,
    /// Write statistics of the render, as JSON.
    #[arg(long, value_name = "FILE.json", conflicts_with = "turntable")]
    stats: Option<PathBuf>,
    /// How to show progress.
    #[arg(long, value_enum, value_name = "STYLE", default_value_t = Style::Auto)]
    progress: Style,
    /// Show the picture in the terminal while it is rendered, in place of the progress.
    #[arg(long, value_enum, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "auto")]
    preview: Option<Protocol>,
    /// Show the picture in a running tev, by default at port 14158.
    #[arg(long, value_name = "HOST:PORT")]
    tev: Option<String>,
    /// Print more.
    #[arg(short, long)]
    verbose: bool,
    /// Print errors only.
    #[arg(short, long, conflicts_with = "verbose")]
    quiet: bool,
    #[command(flatten)]
    parts: PartArguments,
    #[command(flatten)]
    view: ViewArguments,
    #[command(flatten)]
    staging: StagingArguments,
    #[command(flatten)]
    reading: ReadingArguments,
}

/// The amount of metadata in pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Metadata {
    /// The same for every run.
    Plain,
    /// The command and its time, too.
    Full,
}

/// A noise target.
pub(crate) fn noise(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| *x > 0.0 && x.is_finite())
        .ok_or_else(|| "expected a number above 0, such as 0.02".to_owned())
}

/// Stops of exposure.
pub(crate) fn exposure(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|x: &f32| x.abs() <= 100.0)
        .ok_or_else(|| "expected a number from -100 to 100, such as 1.5".to_owned())
}

/// The name of a tone mapping.
pub(crate) fn tone_map_name(map: ToneMap) -> &'static str {
    ToneMap::NAMES.into_iter().find(|name| ToneMap::from_name(name) == Some(map)).unwrap_or("none")
}

/// The treatments of shading normals.
pub(crate) const SHADING_NORMALS: [&str; 2] = ["lumbre", "pbrt"];
/// The names of formats that are written.
const WRITTEN: [&str; 7] = ["png", "exr", "hdr", "pfm", "jpg", "webp", "qoi"];

fn written_format(name: &str) -> Option<ImageFormat> {
    ImageFormat::from_path(Path::new(&format!("picture.{name}")))
}

/// Minimum render time, even if reading took all of the time.
const MIN_TIME: Duration = Duration::from_millis(400);

impl Arguments {
    /// Passes the picture options to the POV-Ray reader.
    pub(crate) fn pass_options_to_reader(&mut self) {
        if self.scene.iter().any(|path| SceneFormat::from_path(path) == Some(SceneFormat::Pov)) {
            self.reading.tell_pov(self.size, self.frames.as_ref());
        }
    }

    /// The requested samples per pixel.
    pub(crate) fn spp(&self) -> Option<u32> {
        self.spp
    }

    /// The image that is the background.
    pub(crate) fn background_file(&self) -> Option<&Path> {
        self.staging.background_file()
    }

    /// The scene.
    ///
    /// # Errors
    /// [`Failure`] by kind of error.
    pub(crate) fn open_scene(&self) -> Result<Scene, Failure> {
        self.reading.open(&self.scene).map(|(scene, _)| scene)
    }

    /// Refuses options that a task of a farm cannot handle, before it is sent.
    ///
    /// # Errors
    /// [`Failure::Usage`].
    pub(crate) fn check_task(&self) -> Result<(), Failure> {
        let Some(output) = &self.output else { return Ok(()) };
        self.staging.check(Some(output))?;
        self.check_frames(Some(output))?;
        if is_animation(output) {
            let why = format!("{}: a task renders one picture (expected a name with #)", output.display());
            return Err(Failure::Usage(why));
        }
        self.check_format(output)?;
        self.check_standard_output()?;
        self.parts.check(&self.scene, output, self.spp)?;
        let alone = [
            (self.stats.is_some(), "--stats cannot be used in a farm render: all tasks would write one file"),
            (self.preview.is_some(), "--preview cannot be used in a farm render: it needs a terminal"),
            (self.tev.is_some(), "--tev cannot be used in a farm render: it needs a screen"),
        ];
        alone
            .iter()
            .find(|(is_asked, _)| *is_asked)
            .map_or(Ok(()), |(_, why)| Err(Failure::Usage((*why).to_owned())))
    }

    /// The files that are named on the command line and read.
    fn inputs(&self) -> impl Iterator<Item = &Path> {
        let files = self.scene.iter().map(PathBuf::as_path).chain(self.staging.inputs());
        files.chain(self.reading.overlays())
    }

    /// Everything else that the scene depends on, by name.
    fn settings(&self) -> Vec<(String, String)> {
        let mut settings = self.reading.scene_settings();
        settings.push(("view".to_owned(), in_words(&self.view)));
        settings.push(("stage".to_owned(), in_words(&(&self.staging, self.size))));
        settings
    }

    /// How a picture is shown, by name, for the command that saves it later: see [`crate::merge`].
    fn shown(
        &self,
        behind: &Backdrop,
        tone_map: ToneMap,
        exposure: f32,
        precision: ExrPrecision,
    ) -> BTreeMap<String, String> {
        let layers: Vec<&str> = self.aov.iter().map(|aov| aov.name()).collect();
        let mut shown = BTreeMap::from([
            ("exposure".to_owned(), exposure.to_string()),
            ("tone map".to_owned(), tone_map_name(tone_map).to_owned()),
            (
                "precision".to_owned(),
                if precision == ExrPrecision::Float { "float" } else { "half" }.to_owned(),
            ),
            ("layers".to_owned(), layers.join(",")),
        ]);
        if let (Backdrop::Background(_), Some(background)) = (behind, self.staging.background_name()) {
            shown.insert("background".to_owned(), background);
        }
        shown
    }

    /// Other viewers of the picture while it is rendered.
    fn viewers(
        &self,
        output: &Path,
        tone_map: ToneMap,
        exposure: f32,
    ) -> Result<Vec<Box<dyn PictureViewer>>, Failure> {
        let mut viewers: Vec<Box<dyn PictureViewer>> = Vec::new();
        if let Some(protocol) = self.preview {
            viewers.push(Box::new(Preview::new(protocol, tone_map, exposure)?));
        }
        if let Some(address) = &self.tev {
            viewers.push(Box::new(Tev::connect(address, &output.display().to_string())?));
        }
        Ok(viewers)
    }

    /// The output, unless it is standard output.
    fn file(&self) -> Option<&Path> {
        self.output.as_deref().filter(|output| !is_standard_stream(output))
    }

    /// The memory-relevant properties of the pictures.
    fn pictures(&self) -> Pictures {
        match (&self.frames, self.staging.turntable()) {
            (Some(Frames(numbers)), _) => Pictures::Frames(numbers.clone()),
            (None, Some(count)) => Pictures::Turntable(count),
            (None, None) => Pictures::One,
        }
    }

    /// The deadline of a picture that was started at this time.
    fn deadline(&self, start: Instant) -> Option<Deadline> {
        self.time.and_then(|time| Some(Deadline { at: start.checked_add(time)?, time }))
    }

    /// The name of the pictures, or the pattern of their names.
    fn pattern(&self, scene: &Scene, inputs: &Inputs) -> Result<PathBuf, Failure> {
        let (pictures, statistics) = (self.pictures(), self.stats.as_deref());
        output::refuse_inputs(self.file(), &pictures, statistics, inputs)?;
        if let Some(pattern) = &self.output {
            return Ok(pattern.clone());
        }
        let film = scene.resolved().film().filename.as_deref().map(Path::new);
        let film = film.filter(|name| check_format(name, false).is_ok());
        let ending = match scene.resolved().film().kind {
            FilmKind::GBuffer(_) | FilmKind::Spectral(_) => "exr",
            FilmKind::Rgb => "png",
        };
        let scene = (&*self.scene[0], ending);
        output::default_name(film, scene, &pictures, statistics, inputs, self.quiet)
    }

    /// An output with the format as its extension, even for standard output.
    fn named<'p>(&self, output: &'p Path) -> Cow<'p, Path> {
        if !is_standard_stream(output) {
            return Cow::Borrowed(output);
        }
        let format = self.output_format.unwrap_or(ImageFormat::Png).name().to_ascii_lowercase();
        Cow::Owned(format!("standard output.{format}").into())
    }

    /// Refuses to write a picture to a terminal, and a format for an output with an extension.
    fn check_standard_output(&self) -> Result<(), Failure> {
        let is_asked = self.output.as_deref().is_some_and(is_standard_stream);
        if is_asked && std::io::stdout().is_terminal() {
            let message = "standard output is a terminal (expected a pipe or a file, as -o - > picture.png)";
            return Err(Failure::Usage(message.to_owned()));
        }
        if self.output_format.is_some() && !is_asked {
            let message = "--output-format works only with -o - (the format of a file follows from its name)";
            return Err(Failure::Usage(message.to_owned()));
        }
        Ok(())
    }

    /// The file of all frames, if they are in one.
    fn animation(&self) -> Result<Option<Animation>, Failure> {
        let Some(output) = self.output.as_deref().filter(|_| self.pictures() != Pictures::One) else {
            return Ok(None);
        };
        let animation = Animation::of(output, self.reading.fps())?;
        if animation.is_some() && self.parts.is_asked() {
            return Err(Failure::Usage(format!(
                "{}: all frames are in one file, which cannot be resumed (expected a name with # for the number of each)",
                output.display()
            )));
        }
        Ok(animation)
    }

    /// Checks that the program can write the format of the path's extension.
    fn check_format(&self, path: &Path) -> Result<(), Failure> {
        if is_animation(path) {
            return match self.pictures() {
                Pictures::One => Err(Failure::Usage(format!(
                    "{}: it is of several pictures (expected --frames or --turntable, or another ending)",
                    path.display()
                ))),
                _ if !self.aov.is_empty() => {
                    Err(Failure::Usage(format!("{}: --aov needs an .exr file", path.display())))
                }
                _ => Ok(()),
            };
        }
        check_format(path, !self.aov.is_empty())
    }

    /// Rejects frames without an animation, and an output name that is the same for all frames.
    fn check_frames(&self, output: Option<&Path>) -> Result<(), Failure> {
        let has_frames = |path: &PathBuf| {
            let ending = path.extension().map(|e| e.to_ascii_lowercase()).unwrap_or_default();
            ending == "gltf" || ending == "glb" || ending == "pov"
        };
        if self.frames.is_some() && !self.scene.iter().all(has_frames) {
            let path = self.scene[0].display();
            return Err(Failure::Usage(format!(
                "{path}: --frames needs an animation (expected a .gltf, a .glb or a .pov)"
            )));
        }
        let name = output.and_then(Path::file_name).map(|name| name.to_string_lossy());
        match name {
            Some(name)
                if self.frames.is_some() && !name.contains('#') && !output.is_some_and(is_animation) =>
            {
                Err(Failure::Usage(format!(
                    "{name}: --frames makes many pictures (expected a name with # for their number, as frame.####.png, or one that ends in {ENDINGS})"
                )))
            }
            _ => Ok(()),
        }
    }
}

/// Whether a file is this render's picture with all samples, according to its metadata.
fn is_done_before(path: &Path, job: &Job, options: &RenderOptions) -> bool {
    const NEAR: u64 = 64 << 10;
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(NEAR).read_to_end(&mut start));
    let first = options.first_sample;
    let wanted = job.metadata(&(first..first.saturating_add(options.stop.spp)));
    let is_fixed = options.stop.time.is_none() && options.stop.noise.is_none();
    let says = |name: &str| {
        let value = wanted.iter().find(|(known, _)| known == name).map_or("", |(_, value)| value);
        let mut places = start.windows(name.len()).enumerate().filter(|(_, here)| *here == name.as_bytes());
        places.any(|(at, _)| text_of(&start, at, name.len()) == Some(value.as_bytes()))
    };
    read.is_ok() && says("lumbreScene") && (!is_fixed || says("lumbreSamples"))
}

/// The text of a name at this position in a file: an iTXt chunk of a PNG, or a header line of an .exr.
fn text_of(file: &[u8], at: usize, length: usize) -> Option<&[u8]> {
    if let Some(chunk) = file.get(at.checked_sub(8)?..at)
        && chunk.ends_with(b"iTXt")
    {
        let bytes = u32::from_be_bytes([chunk[0], chunk[1], chunk[2], chunk[3]]) as usize;
        // In between: the end of the name, two bytes of compression, and an empty language.
        return file.get(at + length + 5..at + bytes);
    }
    let text = file.get(at + length..)?.strip_prefix(b": ")?;
    text.split(|&byte| byte == b'\n' || byte == 0).next()
}

/// A hint for nearly black pictures.
const DARK_HINT: &str = "hint: almost nothing in the picture is lit. --fit views a closed room from outside; --eye and --target put the camera
  inside. --env FILE lights the scene from all around; --exposure EV brightens the picture";

/// Whether almost all covered pixels would be shown black.
fn is_nearly_black(image: &Image, exposure: f32) -> bool {
    // Two 8-bit steps above black, in sRGB.
    let seen = 6e-4 * (-exposure).exponential_2();
    let (mut covered, mut lit) = (0.0, 0.0);
    for (i, pixel) in image.pixels().iter().enumerate() {
        let alpha = image.alpha().map_or(1.0, |alpha| alpha[i]);
        covered += f64::from(alpha);
        // Colours are premultiplied by coverage.
        if pixel.max_component() > seen {
            lit += f64::from(alpha);
        }
    }
    const MIN_COVERED: f64 = 0.005;
    const MIN_LIT: f64 = 0.01;
    covered > MIN_COVERED * image.pixels().len() as f64 && lit < MIN_LIT * covered
}

/// Whether exposure applies to this file's format.
fn is_for_displays(path: &Path) -> bool {
    ImageFormat::from_path(path).is_none_or(|format| !format.is_high_range())
}

/// The format of the path's extension, which the program can write.
///
/// # Errors
/// [`Failure::Usage`] for any other.
pub(crate) fn check_image_format(path: &Path) -> Result<ImageFormat, Failure> {
    let format = ImageFormat::from_path(path).filter(|format| format.is_writable());
    format.ok_or_else(|| {
        Failure::Usage(format!(
            "{}: unknown image format (expected a name that ends in {})",
            path.display(),
            ImageFormat::WRITABLE
        ))
    })
}

/// Checks that the program can write the format of the path's extension, with layers.
fn check_format(path: &Path, layers: bool) -> Result<(), Failure> {
    if is_bare_part(path) {
        return Ok(());
    }
    match check_image_format(path)? {
        format if layers && format != ImageFormat::Exr => {
            Err(Failure::Usage(format!("{}: --aov needs an .exr file", path.display())))
        }
        _ => Ok(()),
    }
}

/// Checks that the format of the path's extension has the channels of a film.
fn check_film(path: &Path, film: FilmKind) -> Result<(), Failure> {
    let name = match film {
        FilmKind::Rgb => return Ok(()),
        FilmKind::GBuffer(_) => "gbuffer",
        FilmKind::Spectral(_) => "spectral",
    };
    if is_bare_part(path) || ImageFormat::from_path(path) == Some(ImageFormat::Exr) {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "{}: the channels of film \"{name}\" need an .exr file (expected a name that ends in .exr)",
        path.display()
    )))
}

/// Never saves an incomplete picture: a signal may come before every pixel has a sample. After a timeout there is a
/// coarse picture.
fn check_whole(arguments: &Arguments, picture: &Picture, signal: Option<u8>) -> Result<(), Failure> {
    if picture.stats().spp > 0 {
        return Ok(());
    }
    if let Some(status) = signal {
        say!("not every pixel has a sample yet: nothing was saved");
        return Err(Failure::Interrupted(status));
    }
    let time = arguments.time.map(spoken).unwrap_or_default();
    let over = format!("--time: {time} passed before every pixel had a sample");
    match picture.stats().stride {
        Some(stride) => {
            say!("warning: {over}; the picture has one for {stride} by {stride} pixels");
            Ok(())
        }
        None => Err(Failure::Limit(format!("{over}; nothing was saved"))),
    }
}

fn options(
    arguments: &Arguments,
    scene: &Scene,
    prepared: &Prepared,
    is_denoised: bool,
) -> Result<RenderOptions, Failure> {
    let mut options = prepared.options(scene, arguments.integrator, arguments.size);
    options.crop = match arguments.crop {
        None => options.crop,
        Some(Crop::Pixels([x0, y0, x1, y1])) if x0 >= options.width || y0 >= options.height => {
            return Err(Failure::Usage(format!(
                "--crop {x0},{y0},{x1},{y1} is outside the picture ({}x{})",
                options.width, options.height
            )));
        }
        Some(Crop::Pixels([x0, y0, x1, y1])) => Some(PixelBounds { x0, y0, x1, y1 }),
        Some(Crop::Fractions([x0, y0, x1, y1])) => Some(options.pixels_of([x0, x1, y0, y1])),
    };
    if let Some(wanted) = &arguments.camera {
        options.camera = camera(scene, wanted)?;
    }
    options.integrator.shading_normals =
        arguments.shading_normals.unwrap_or(options.integrator.shading_normals);
    options.integrator.max_depth = arguments.max_depth.unwrap_or(options.integrator.max_depth);
    options.sampler.seed = arguments.seed.unwrap_or(options.sampler.seed);
    let usual = match is_denoised {
        true => options.stop,
        false => Stop::usual(options.integrator.kind, scene.resolved().sampler().spp),
    };
    let spp = match arguments.spp {
        Some(spp) => spp,
        None if arguments.noise.is_some() => Stop::MAX_FOR_NOISE,
        // A time limit alone leaves samples unlimited.
        None if arguments.time.is_some() => u32::MAX,
        None => usual.spp,
    };
    let is_told = arguments.spp.is_some() || arguments.time.is_some() || arguments.noise.is_some();
    options.stop = if is_told || arguments.min_spp.is_some() || arguments.parts.keeps_sums() {
        let mut told = Stop::at(spp);
        (told.time, told.noise, told.min_spp) = (arguments.time, arguments.noise, arguments.min_spp);
        told
    } else {
        usual
    };
    if let Some(samples) = arguments.parts.samples() {
        options.first_sample = samples.start;
        options.stop.spp = samples.end - samples.start;
    }
    options.threads = arguments.threads.map_or_else(rayon::current_num_threads, usize::from);
    options.features = !arguments.aov.is_empty();
    Ok(options)
}

pub(crate) fn camera(scene: &Scene, wanted: &str) -> Result<usize, Failure> {
    let cameras = scene.resolved().cameras();
    let by_name = cameras.iter().position(|camera| camera.name.as_deref() == Some(wanted));
    let by_index = wanted.parse().ok().filter(|index| *index < cameras.len());
    by_name.or(by_index).ok_or_else(|| {
        let known: Vec<String> = cameras
            .iter()
            .enumerate()
            .map(|(i, camera)| match (&camera.name, &camera.kind) {
                (Some(name), _) => name.clone(),
                (None, CameraKind::Perspective { .. }) => format!("{i} (perspective)"),
                (None, CameraKind::Orthographic { .. }) => format!("{i} (orthographic)"),
                (None, CameraKind::Spherical { .. }) => format!("{i} (spherical)"),
                (None, CameraKind::Realistic(_)) => format!("{i} (realistic)"),
                (None, CameraKind::Mesh(_)) => format!("{i} (mesh)"),
            })
            .collect();
        Failure::Usage(format!(
            "--camera: there is no camera \"{wanted}\" (expected one of: {})",
            known.join(", ")
        ))
    })
}
