//! Pictures and parts of renders.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use lumbre::description::{ClearSky, SkyDesc, SunPosition};
use lumbre::formats::image::{ExrPrecision, ImageFormat, PngDepth};
use lumbre::image::{Image, Layer, Rgb, ToneMap};
use lumbre::{
    Background, DVec3, Feature, FilmLayers, Part as PartDesc, PixelBounds, RenderOptions, SaveOptions,
};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::errors::{invalid, list, raised, tuple, unknown};
use crate::staged::PreparedScene;

/// A rendered picture, with the sums of its samples.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Picture {
    picture: lumbre::Picture,
    look: Look,
    part: Mutex<Option<PartDesc>>,
}

impl Picture {
    pub(crate) fn new(picture: lumbre::Picture, look: Look, part: Option<PartDesc>) -> Self {
        let picture = match &look.background {
            Some(background) => picture.over(background.clone()),
            None => picture,
        };
        Self { picture, look, part: Mutex::new(part) }
    }
}

/// How a picture is saved where nobody says otherwise.
#[derive(Clone)]
pub(crate) struct Look {
    tone_map: ToneMap,
    exposure: f32,
    precision: ExrPrecision,
    /// What it stands before.
    background: Option<Background>,
}

/// What is behind everything in a picture.
pub(crate) enum Backdrop {
    /// The lights at infinity.
    Lights,
    /// Nothing: the picture has coverage.
    Nothing,
    Background(Background),
}

impl Look {
    /// As the program saves it.
    pub(crate) fn of(
        shown: &PreparedScene,
        options: &RenderOptions,
        behind: Backdrop,
    ) -> Result<Self, lumbre::Error> {
        let PreparedScene { scene, prepared } = shown;
        let save = prepared.save_options(scene);
        Ok(Self {
            tone_map: save.tone_map,
            exposure: prepared.exposure(scene, options)?,
            precision: save.exr_precision,
            background: match behind {
                Backdrop::Background(background) => Some(background),
                Backdrop::Lights | Backdrop::Nothing => None,
            },
        })
    }

    /// By name, in the words of the program's own parts.
    ///
    /// # Errors
    /// For a background that is a picture, which has no name.
    pub(crate) fn named(&self) -> PyResult<BTreeMap<String, String>> {
        let precision = if self.precision == ExrPrecision::Float { "float" } else { "half" };
        let tone_map =
            ToneMap::NAMES.into_iter().find(|name| ToneMap::from_name(name) == Some(self.tone_map));
        let entry = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        let mut names = BTreeMap::from([
            entry("exposure", &self.exposure.to_string()),
            entry("tone map", tone_map.unwrap_or("none")),
            entry("precision", precision),
            entry("layers", ""),
        ]);
        match &self.background {
            None => {}
            Some(Background::Colour(colour)) => {
                let [r, g, b] = colour.to_array().map(f32::to_bits);
                names.extend([entry("background", &format!("colour {r:08x} {g:08x} {b:08x}"))]);
            }
            Some(background) if *background == Background::studio() => {
                names.extend([entry("background", "studio")]);
            }
            Some(_) => {
                return Err(invalid(
                    "the background of a picture that is rendered in parts is no picture (expected env, studio, transparent or a colour)",
                ));
            }
        }
        Ok(names)
    }

    /// The options of a file, where what is not given is as it is here.
    fn options(
        &self,
        tonemap: Option<&str>,
        exposure: Option<f32>,
        depth: u8,
        quality: u8,
        precision: Option<&str>,
    ) -> PyResult<SaveOptions> {
        let png_depth = match depth {
            8 => PngDepth::Eight,
            16 => PngDepth::Sixteen,
            _ => return Err(invalid(format!("depth is no depth of PNG (found {depth}; expected 8 or 16)"))),
        };
        if !(1..=100).contains(&quality) {
            return Err(invalid(format!("quality is out of range (found {quality}; expected 1 to 100)")));
        }
        let mut options = SaveOptions::default();
        options.tone_map = tonemap.map_or(Ok(self.tone_map), tone_map)?;
        options.exposure = exposure.unwrap_or(self.exposure);
        options.exr_precision = match precision {
            None => self.precision,
            Some("half") => ExrPrecision::Half,
            Some("float") => ExrPrecision::Float,
            Some(other) => return Err(unknown("precision", other, &["half", "float"])),
        };
        (options.png_depth, options.jpeg_quality) = (png_depth, quality);
        Ok(options)
    }

    fn from_names(names: &BTreeMap<String, String>) -> Self {
        let text = |name: &str| names.get(name).map_or("", String::as_str);
        Self {
            tone_map: ToneMap::from_name(text("tone map")).unwrap_or_default(),
            exposure: text("exposure").parse().unwrap_or(0.0),
            precision: if text("precision") == "float" { ExrPrecision::Float } else { ExrPrecision::Half },
            background: background(text("background")),
        }
    }
}

/// Pixels and their alpha, where there is one.
type Pixels = (Py<PyArray3<f32>>, Option<Py<PyArray2<f32>>>);
/// The first and the end of samples, and pixels as x0, y0, x1, y1.
type PiecePlace = (u32, u32, (u32, u32, u32, u32));

fn array(py: Python<'_>, image: &Image) -> PyResult<Py<PyArray3<f32>>> {
    let mut numbers = list(3 * image.pixels().len())?;
    numbers.extend(image.pixels().iter().flat_map(|pixel| pixel.to_array()));
    let shape = [image.height() as usize, image.width() as usize, 3];
    Ok(PyArray1::from_vec(py, numbers).reshape(shape)?.unbind())
}

fn tone_map(name: &str) -> PyResult<ToneMap> {
    ToneMap::from_name(name).ok_or_else(|| unknown("tonemap", name, &ToneMap::NAMES))
}

/// The background of a name in a part.
fn background(name: &str) -> Option<Background> {
    if name == "studio" {
        return Some(Background::studio());
    }
    let channels = name.strip_prefix("colour ")?.split(' ');
    let channels = channels.map(|bits| u32::from_str_radix(bits, 16).map(f32::from_bits));
    let channels: Vec<f32> = channels.collect::<Result<_, _>>().ok()?;
    let channels: [f32; 3] = channels.try_into().ok()?;
    Some(Background::Colour(Rgb::from(channels)))
}

fn features(names: &[String]) -> PyResult<Vec<Feature>> {
    let of = |name: &String| {
        Feature::from_name(name).ok_or_else(|| unknown("layer", name, &Feature::ALL.map(Feature::name)))
    };
    names.iter().map(of).collect()
}

#[pymethods]
impl Picture {
    /// Linear light, (h, w, 3).
    fn pixels(&self, py: Python<'_>) -> PyResult<Py<PyArray3<f32>>> {
        array(py, &self.picture.lit())
    }

    /// Coverage, (h, w), of a transparent picture.
    fn alpha(&self, py: Python<'_>) -> PyResult<Option<Py<PyArray2<f32>>>> {
        let image = self.picture.lit();
        let shape = [image.height() as usize, image.width() as usize];
        let Some(alpha) = image.alpha() else { return Ok(None) };
        Ok(Some(PyArray1::from_slice(py, alpha).reshape(shape)?.unbind()))
    }

    /// An AOV, (h, w, 3); only the first channels count; `None` where it was not rendered.
    fn feature(&self, py: Python<'_>, name: &str) -> PyResult<Option<(Py<PyArray3<f32>>, usize)>> {
        let feature = features(&[name.to_owned()])?[0];
        let Some(image) = self.picture.feature(feature) else { return Ok(None) };
        Ok(Some((array(py, image)?, feature.channels().len())))
    }

    /// The channels of the film besides colours, by name, (h, w) each.
    fn film<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let image = self.picture.image();
        let shape = [image.height() as usize, image.width() as usize];
        let channels = PyDict::new(py);
        for layer in &self.picture.film().layers {
            channels.set_item(&layer.name, PyArray1::from_slice(py, &layer.samples).reshape(shape)?)?;
        }
        Ok(channels)
    }

    /// All that it is made of, by name, for pickles: arrays, numbers and texts.
    fn kept<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let picture = &self.picture;
        let kept = PyDict::new(py);
        let image = picture.image();
        let shape = [image.height() as usize, image.width() as usize];
        kept.set_item("pixels", array(py, image)?)?;
        if let Some(alpha) = image.alpha() {
            kept.set_item("alpha", PyArray1::from_slice(py, alpha).reshape(shape)?)?;
        }
        if let Some(coverage) = picture.coverage() {
            kept.set_item("coverage", array(py, coverage)?)?;
        }
        let features = PyDict::new(py);
        for feature in Feature::ALL {
            if let Some(image) = picture.feature(feature) {
                features.set_item(feature.name(), array(py, image)?)?;
            }
        }
        kept.set_item("features", features)?;
        let film = picture.film();
        let layers = film.layers.iter().map(|layer| {
            let samples = PyArray1::from_slice(py, &layer.samples).reshape(shape)?;
            Ok((layer.name.clone(), layer.full_precision, samples))
        });
        kept.set_item("film", layers.collect::<PyResult<Vec<_>>>()?)?;
        kept.set_item("film_attributes", film.attributes.clone())?;
        let PixelBounds { x0, y0, x1, y1 } = picture.bounds();
        kept.set_item("bounds", (x0, y0, x1, y1))?;
        kept.set_item("whole", picture.whole())?;
        match &self.look.background {
            Some(Background::Picture(image)) => {
                kept.set_item("background", array(py, image)?)?;
                kept.set_item("look", Look { background: None, ..self.look.clone() }.named()?)?;
            }
            _ => kept.set_item("look", self.look.named()?)?,
        }
        Ok(kept)
    }

    /// A picture of what another one was made of; without its part.
    #[staticmethod]
    fn restored(kept: &Bound<'_, PyDict>) -> PyResult<Self> {
        let given = |name: &str| {
            kept.get_item(name)?.ok_or_else(|| invalid(format!("a pickled picture has no {name}")))
        };
        let image = |name: &str| -> PyResult<Option<Image>> {
            let Some(pixels) = kept.get_item(name)? else { return Ok(None) };
            image_of(name, &pixels.extract()?).map(Some)
        };
        let mut pixels = image_of("pixels", &given("pixels")?.extract()?)?;
        if let Some(alpha) = kept.get_item("alpha")? {
            let alpha: PyReadonlyArray2<'_, f32> = alpha.extract()?;
            let alpha = alpha.as_array().iter().copied().collect();
            pixels = pixels.with_alpha(alpha).ok_or_else(|| invalid("alpha is of another size"))?;
        }
        let mut features = Vec::new();
        for (name, pixels) in given("features")?.cast::<PyDict>()? {
            let name: String = name.extract()?;
            let feature = self::features(std::slice::from_ref(&name))?[0];
            features.push((feature, image_of(&name, &pixels.extract()?)?));
        }
        let (x0, y0, x1, y1) = given("bounds")?.extract()?;
        let bounds = PixelBounds { x0, y0, x1, y1 };
        let whole = given("whole")?.extract()?;
        let layers: Vec<(String, bool, PyReadonlyArray2<'_, f32>)> = given("film")?.extract()?;
        let layers = layers.into_iter().map(|(name, full_precision, samples)| {
            let samples: Vec<f32> = samples.as_array().iter().copied().collect();
            match samples.len() == pixels.pixels().len() {
                true => Ok(Layer { name, samples, full_precision }),
                false => Err(invalid(format!("the channel {name} is of another size"))),
            }
        });
        let film = FilmLayers {
            layers: layers.collect::<PyResult<_>>()?,
            attributes: given("film_attributes")?.extract()?,
        };
        let picture = lumbre::Picture::restored(pixels, image("coverage")?, bounds, whole, features);
        let picture = picture.with_film(film);
        let mut look = Look::from_names(&given("look")?.extract()?);
        if let Some(background) = image("background")? {
            look.background = Some(Background::Picture(background));
        }
        Ok(Self::new(picture, look, None))
    }

    /// Writes a file.
    #[expect(clippy::too_many_arguments, reason = "one call of the package's own")]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        layers: Vec<String>,
        tonemap: Option<&str>,
        exposure: Option<f32>,
        depth: u8,
        quality: u8,
        precision: Option<&str>,
    ) -> PyResult<()> {
        let options = self.look.options(tonemap, exposure, depth, quality, precision)?;
        let layers = features(&layers)?;
        py.detach(|| self.picture.save_with(&path, &options, &layers)).map_err(raised)
    }

    /// The bytes of a .png.
    fn png<'py>(
        &self,
        py: Python<'py>,
        tonemap: Option<&str>,
        exposure: Option<f32>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let options = self.look.options(tonemap, exposure, 8, 95, None)?;
        let bytes = py.detach(|| self.picture.encode(ImageFormat::Png, &options, &[])).map_err(raised)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Statistics by name.
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stats = self.picture.stats();
        let rays = PyDict::new(py);
        rays.set_item("camera", stats.rays.camera)?;
        rays.set_item("bounce", stats.rays.bounce)?;
        rays.set_item("shadow", stats.rays.shadow)?;
        let all = PyDict::new(py);
        all.set_item("spp", stats.spp)?;
        all.set_item("samples", stats.samples)?;
        all.set_item("rays", rays)?;
        all.set_item("dropped", stats.dropped)?;
        all.set_item("clamped", stats.clamped)?;
        all.set_item("most_spp", stats.most_spp)?;
        all.set_item("noise", stats.noise)?;
        all.set_item("noise_target", stats.noise_target)?;
        all.set_item("noise_target_met", stats.noise_target.map(|_| !stats.misses_noise_target()))?;
        all.set_item("noisy_pixels", stats.noisy_pixels)?;
        all.set_item("threads", stats.threads)?;
        all.set_item("seconds", stats.elapsed.as_secs_f64())?;
        Ok(all)
    }

    /// The sums of its samples, which are handed out once.
    fn take_part(&self) -> PyResult<Part> {
        let part = self.part.lock().unwrap_or_else(PoisonError::into_inner).take();
        part.map(|part| Part(Mutex::new(part))).ok_or_else(|| {
            invalid(
                "the picture has no part, or it has been taken (expected one that was rendered with part)",
            )
        })
    }
}

/// Some samples of some pixels of a render: what parts of it are merged to.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Part(Mutex<PartDesc>);

impl Part {
    fn with<R>(&self, work: impl FnOnce(&mut PartDesc) -> R) -> R {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl Part {
    /// The part of bytes.
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        Ok(Self(Mutex::new(PartDesc::from_bytes(bytes, u64::MAX).map_err(invalid)?)))
    }

    /// The bytes of a file of its own.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let bytes = py.detach(|| self.with(|part| part.to_bytes()));
        PyBytes::new(py, &bytes)
    }

    /// Adds the samples of the bytes of another part.
    fn merge(&self, py: Python<'_>, bytes: &[u8]) -> PyResult<()> {
        let merged = py.detach(|| {
            let other = PartDesc::from_bytes(bytes, u64::MAX).map_err(|e| e.to_string())?;
            self.with(|part| {
                let differences = part.job.differences(&other.job);
                if !differences.is_empty() {
                    return Err(format!("these are parts of different renders: {}", differences.join("; ")));
                }
                part.merge(&other).map_err(|e| e.to_string())
            })
        });
        merged.map_err(invalid)
    }

    /// Its samples: a list of (first, end, (x0, y0, x1, y1)).
    fn pieces(&self) -> Vec<PiecePlace> {
        self.with(|part| {
            let of = |piece: &lumbre::Piece| {
                let b = piece.bounds;
                (piece.samples.start, piece.samples.end, (b.x0, b.y0, b.x1, b.y1))
            };
            part.state.pieces().iter().map(of).collect()
        })
    }

    /// The picture of its samples.
    fn picture(&self, py: Python<'_>) -> Picture {
        py.detach(|| self.with(|part| Picture::new(part.picture(), Look::from_names(&part.job.shown), None)))
    }
}

/// A clear sky by longitude and latitude, (h, 2h, 3), without its sun at this azimuth and elevation; and the luminance
/// of its zenith.
#[pyfunction]
pub(crate) fn clear_sky(
    py: Python<'_>,
    azimuth: f64,
    elevation: f64,
    turbidity: f64,
    albedo: f64,
) -> PyResult<(Py<PyArray3<f32>>, f32)> {
    let sun = SunPosition { azimuth, elevation };
    let desc = SkyDesc { sun, turbidity, albedo, sun_scale: 0.0, ..SkyDesc::default() };
    let sky = ClearSky::new(desc).map_err(invalid)?;
    let zenith = sky.radiance(DVec3::Z).luminance();
    Ok((array(py, &py.detach(|| sky.map()))?, zenith))
}

/// An image file as (h, w, 3), linear light, and its alpha as (h, w) where it has one.
///
/// # Errors
/// What is wrong with the file.
#[pyfunction]
pub(crate) fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Pixels> {
    let image = py.detach(|| lumbre::read_image(&path)).map_err(raised)?;
    let shape = [image.height() as usize, image.width() as usize];
    let alpha = image.alpha().map(|alpha| PyArray1::from_slice(py, alpha).reshape(shape));
    Ok((array(py, &image)?, alpha.transpose()?.map(Bound::unbind)))
}

/// Writes linear light, (h, w, 3), as an image file.
///
/// # Errors
/// What is wrong with the array, the options or the file.
#[pyfunction]
pub(crate) fn write_image(
    py: Python<'_>,
    path: PathBuf,
    pixels: PyReadonlyArray3<'_, f32>,
    tonemap: &str,
    exposure: f32,
) -> PyResult<()> {
    let mut options = SaveOptions::default();
    (options.tone_map, options.exposure) = (tone_map(tonemap)?, exposure);
    let image = image_of("an image", &pixels)?;
    py.detach(|| lumbre::write_image(&path, &image, &options)).map_err(raised)
}

/// An image of an array, (h, w, 3).
pub(crate) fn image_of(name: &str, pixels: &PyReadonlyArray3<'_, f32>) -> PyResult<Image> {
    let &[height, width, 3] = pixels.shape() else {
        let found = tuple(pixels.shape());
        return Err(invalid(format!("{name} has the wrong shape (found {found}; expected (h, w, 3))")));
    };
    let view = pixels.as_array();
    let pixel = |i: usize| Rgb::from(std::array::from_fn(|channel| view[[i / width, i % width, channel]]));
    let mut colours = list(width * height)?;
    colours.extend((0..width * height).map(pixel));
    Image::from_pixels(width as u32, height as u32, colours)
        .ok_or_else(|| invalid(format!("there is no image of {width} by {height} pixels")))
}
