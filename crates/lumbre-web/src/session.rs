//! A scene that is open: rendered pass after pass, asked and explained.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use lumbre::description::IntegratorKind;
use lumbre::formats::{HeldFiles, Limits};
use lumbre::image::unit_to_u8;
use lumbre::{
    CancelToken, DVec3, NoProgress, Picture, PixelBounds, Prepared, Ray, ReadOptions, RenderOptions,
    RenderState, SaveOptions, Scene, Stage,
};
use lumbre_cli::{Format, Language, Query, Request, SceneNames};
use serde::{Deserialize, Serialize};

use crate::problem::{Problem, ProblemKind};

/// Bytes that reading and building may hold: a page has 4 GiB for all, and the browser may grant less.
const MEMORY: u64 = 1 << 30;
/// Pixels of a picture: its sums, and what is made of them, take some 200 bytes each.
const PIXELS: u64 = 1 << 22;
/// Bytes of text that one question may be answered with.
const ANSWERS: usize = 64 << 20;

/// What a picture is to be, where not all of it is as the scene says.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wanted {
    /// Width and height in pixels.
    pub size: Option<(u32, u32)>,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// The name of an integrator.
    pub integrator: Option<String>,
    /// The seed of the random numbers.
    pub seed: Option<u64>,
}

/// How far a picture is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pass {
    /// Width and height of the whole picture in pixels.
    pub size: (u32, u32),
    /// The part of it that is rendered: the first column and row, and those beyond the last.
    pub bounds: [u32; 4],
    /// Samples of each pixel.
    pub spp: u32,
    /// Those that there will be.
    pub target: u32,
    /// Every this many pixels along a side has a sample; the others show their neighbours' until 1 is reached.
    pub stride: u32,
    /// All samples taken so far.
    pub samples: u64,
    /// Whether it is the picture that the program makes, to the bit.
    pub done: bool,
}

/// What is to be explained: the options of `lumbre explain` by their names.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Explained {
    /// The pixel, from 0, 0 in the upper left corner.
    pub pixel: Option<(u32, u32)>,
    /// A ray instead: origin, direction, and then its range of t where that is not 0 to infinity.
    pub ray: Option<Vec<f64>>,
    /// `text`, `markdown`, `html` or `json`.
    pub format: Option<String>,
    /// `en` or `es`.
    pub lang: Option<String>,
    /// Of this many of the rays that follow the crossings, too.
    pub depth: u32,
    /// The number of the sample.
    pub sample: u32,
    /// Only the surface that is seen.
    pub nearest: bool,
    /// This shape, whether the ray meets it or not.
    pub shape: Option<String>,
    /// All shapes.
    pub all_shapes: bool,
    /// Only the sections with these keys.
    pub only: Vec<String>,
}

/// A scene, and its picture as far as it is rendered.
#[derive(Debug)]
pub struct Session {
    scene: Scene,
    things: SceneNames,
    name: PathBuf,
    options: RenderOptions,
    /// The part of the picture that is rendered, if no rows are chosen.
    bounds: PixelBounds,
    prepared: Prepared,
    save: SaveOptions,
    warnings: Vec<String>,
    state: Option<RenderState>,
    picture: Option<Picture>,
}

impl Session {
    /// Opens the scene of this name among the files, set on the stage that `lumbre render` sets it on.
    ///
    /// # Errors
    /// With the place in the file; [`ProblemKind::Limit`] for a scene or a picture that is too large for a page.
    pub fn open(files: HeldFiles, name: &str, wanted: &Wanted) -> Result<Self, Problem> {
        let name = PathBuf::from(name);
        let mut reading = ReadOptions::default();
        reading.limits = Limits::default();
        reading.limits.memory = MEMORY;
        reading.held = Some(Arc::new(files));
        let (mut desc, mut diagnostics) = lumbre::describe(&[&name], &reading)?;
        let things = SceneNames::of(&desc);
        let kind = match &wanted.integrator {
            None => None,
            Some(name) => Some(IntegratorKind::from_name(name).ok_or_else(|| {
                let known = IntegratorKind::NAMES.join(", ");
                Problem::new(
                    ProblemKind::Usage,
                    format!("no integrator \"{name}\" (expected one of: {known})"),
                )
            })?),
        };
        let mut stage = Stage::default();
        stage.size = wanted.size;
        let prepared = lumbre::prepare(&mut desc, &stage, kind);
        let needed = lumbre::predicted_build_bytes(&desc).saturating_add(diagnostics.memory_held());
        if needed > MEMORY {
            let what = format!("the scene needs {needed} bytes, a page has {MEMORY}");
            return Err(Problem::new(ProblemKind::Limit, what));
        }
        let scene = Scene::of_file(desc, &name, &mut diagnostics)?;
        let mut options = prepared.options(&scene, kind, wanted.size);
        options.sampler.seed = wanted.seed.unwrap_or(options.sampler.seed);
        options.threads = 1;
        options.stop.spp = wanted.spp.unwrap_or(options.stop.spp);
        let pixels = u64::from(options.width) * u64::from(options.height);
        if pixels > PIXELS {
            let what = format!("the picture has {pixels} pixels, a page shows up to {PIXELS}");
            return Err(Problem::new(ProblemKind::Limit, what));
        }
        // Refused here, and not by the first pass.
        let bounds = options.bounds().map_err(lumbre::Error::from)?;
        let mut save = prepared.save_options(&scene);
        save.exposure = prepared.exposure(&scene, &options)?;
        let mut warnings = diagnostics.lines();
        if scene.is_dark_by(options.integrator.kind) {
            let dark = "the scene has no light: its picture is black";
            warnings.push(format!("warning: {}: {dark}", name.display()));
        }
        Ok(Self {
            scene,
            things,
            name,
            options,
            bounds,
            prepared,
            save,
            warnings,
            state: None,
            picture: None,
        })
    }

    /// What reading and building warned of, a line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Renders these rows alone, the first and that beyond the last: so several sessions of the same scene share its
    /// picture. What was rendered before is given up.
    ///
    /// # Errors
    /// [`ProblemKind::Usage`] where there are none of these rows, and for a picture that is denoised, which has to be
    /// whole.
    pub fn limit_rows(&mut self, from: u32, to: u32) -> Result<(), Problem> {
        if self.options.guides {
            return Err(Problem::new(
                ProblemKind::Usage,
                "a picture that is denoised is rendered as a whole",
            ));
        }
        let mut options = self.options.clone();
        let rows = PixelBounds { x0: 0, y0: from, x1: options.width, y1: to };
        options.crop = Some(self.bounds.intersection(&rows));
        options.bounds().map_err(lumbre::Error::from)?;
        (self.options, self.state, self.picture) = (options, None, None);
        Ok(())
    }

    /// Whether its rows may be rendered apart.
    pub fn is_divisible(&self) -> bool {
        !self.options.guides
    }

    /// The part of the picture that is rendered, if no rows are chosen.
    pub fn bounds(&self) -> PixelBounds {
        self.bounds
    }

    /// Width and height of the whole picture in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.options.width, self.options.height)
    }

    /// Renders on for about so long, and says how far the picture is. What is rendered is the same however the time is
    /// cut into passes.
    ///
    /// # Errors
    /// Where the options make no picture.
    pub fn step(&mut self, time: Duration) -> Result<Pass, Problem> {
        if let Some(pass) = self.pass().filter(|pass| pass.done) {
            return Ok(pass);
        }
        let mut options = self.options.clone();
        options.stop.time = Some(time);
        let token = CancelToken::new();
        let (mut picture, state) =
            self.scene.render_from(&options, &NoProgress, &token, self.state.take(), None)?;
        self.state = Some(state);
        let is_done = self.is_done(&picture);
        if is_done && self.options.guides {
            picture.denoise(self.options.threads)?;
        }
        if let Some(background) = self.prepared.background() {
            picture = picture.over(background);
        }
        self.picture = Some(picture);
        self.pass().ok_or_else(|| Problem::new(ProblemKind::Usage, "there is no picture"))
    }

    fn is_done(&self, picture: &Picture) -> bool {
        picture.stats().stride == Some(1) && picture.stats().spp >= self.options.stop.spp
    }

    /// How far the picture is; `None` before the first pass.
    pub fn pass(&self) -> Option<Pass> {
        let picture = self.picture.as_ref()?;
        let stats = picture.stats();
        let PixelBounds { x0, y0, x1, y1 } = picture.bounds();
        Some(Pass {
            size: self.size(),
            bounds: [x0, y0, x1, y1],
            spp: stats.spp,
            target: self.options.stop.spp,
            stride: stats.stride.unwrap_or(0),
            samples: stats.samples,
            done: self.is_done(picture),
        })
    }

    /// What is rendered of the picture, as displays show it: red, green, blue in sRGB and alpha of each pixel, row by
    /// row from the top, as a PNG of the program has them. Empty before the first pass.
    pub fn pixels(&self) -> Vec<u8> {
        let Some(picture) = &self.picture else { return Vec::new() };
        let (image, left) = picture.displayed(&self.save);
        let alpha = image.alpha();
        let mut bytes = Vec::with_capacity(4 * image.pixels().len());
        for (i, &light) in image.pixels().iter().enumerate() {
            let alpha = alpha.map_or(1.0, |alpha| alpha[i]);
            let light = if 0.0 < alpha && alpha < 1.0 { light / alpha } else { light };
            bytes.extend(left.tone_map.encode(light, left.exposure).to_u8());
            bytes.push(unit_to_u8(alpha));
        }
        bytes
    }

    /// What is rendered of the picture in linear light: red, green and blue of each pixel, row by row from the top, as
    /// a PFM of the program has them. Empty before the first pass.
    pub fn light(&self) -> Vec<f32> {
        let Some(picture) = &self.picture else { return Vec::new() };
        picture.light().pixels().iter().flat_map(|light| light.to_array()).collect()
    }

    /// What rays hit, or what is at points: what `lumbre cast` prints. `query` is one of its names, `list` a CSV or a
    /// `.npy`.
    ///
    /// # Errors
    /// With the place in the list.
    pub fn cast(&self, list: Vec<u8>, query: &str) -> Result<String, Problem> {
        let query = Query::from_name(query).ok_or_else(|| {
            let known = Query::names().join(", ");
            Problem::new(ProblemKind::Usage, format!("no query \"{query}\" (expected one of: {known})"))
        })?;
        Ok(lumbre_cli::cast(&self.scene, query, "rays", list, ANSWERS)?)
    }

    /// What `lumbre explain` says of a pixel or a ray.
    ///
    /// # Errors
    /// For a pixel outside of the picture, and for a ray, a name or a key that there is not.
    pub fn explain(&self, wanted: &Explained) -> Result<String, Problem> {
        let usage = |message: &str| Problem::new(ProblemKind::Usage, message);
        let format = match &wanted.format {
            None => Format::Text,
            Some(name) => {
                Format::from_name(name).ok_or_else(|| usage("expected text, markdown, html or json"))?
            }
        };
        let ray = wanted.ray.as_deref().map(ray).transpose()?;
        if wanted.pixel.is_some() == ray.is_some() {
            return Err(usage("expected a pixel or a ray"));
        }
        let request = Request {
            pixel: wanted.pixel,
            ray,
            format,
            lang: language(wanted.lang.as_deref())?,
            depth: wanted.depth,
            sample: wanted.sample,
            nearest: wanted.nearest,
            shape: wanted.shape.clone(),
            all_shapes: wanted.all_shapes,
            only: wanted.only.clone(),
            digits: lumbre_cli::Digits::Full,
        };
        // As the program: what is explained is a path of red, green and blue.
        let mut options = self.options.clone();
        options.spectral = false;
        Ok(lumbre_cli::explain(&self.scene, &options, &self.things, Path::new(&self.name), &request)?)
    }
}

/// What `lumbre math` prints for a text, in the language of this code.
///
/// # Errors
/// With the place of what is wrong, and a mark below it.
pub fn calculate(text: &str, lang: &str, as_json: bool) -> Result<String, Problem> {
    Ok(lumbre_cli::calculate(text, language(Some(lang))?, as_json, ANSWERS)?)
}

fn language(code: Option<&str>) -> Result<Language, Problem> {
    let wrong = || Problem::new(ProblemKind::Usage, "expected a language, en or es");
    code.map_or(Ok(Language::En), |code| Language::from_name(code).ok_or_else(wrong))
}

/// A ray of six or eight numbers.
fn ray(numbers: &[f64]) -> Result<Ray, Problem> {
    let wrong = || {
        let expected = "expected origin and direction in six finite numbers, the direction not 0, and its range of t in none or two";
        Problem::new(ProblemKind::Usage, expected)
    };
    let (&[ox, oy, oz, dx, dy, dz], range) = numbers.split_first_chunk().ok_or_else(wrong)?;
    let (origin, direction) = (DVec3::new(ox, oy, oz), DVec3::new(dx, dy, dz));
    if !origin.is_finite() || !direction.is_finite() || direction == DVec3::ZERO {
        return Err(wrong());
    }
    match *range {
        [] => Ok(Ray::new(origin, direction)),
        [from, to] if from <= to => Ok(Ray::new(origin, direction).with_range(from, to)),
        _ => Err(wrong()),
    }
}
