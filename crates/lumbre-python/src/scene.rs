//! Scenes: opened or built, asked with rays and points, rendered.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use lumbre::description::{ClearSky, IntegratorKind, LightDesc, SkyDesc, SunPositionError};
use lumbre::formats::{Diagnostics, Strictness};
use lumbre::{
    Background, CancelToken, DVec3, Ground, Job, Part as PartDesc, PixelBounds, Progress, Ray, ReadOptions,
    RenderOptions, SceneBuilder, SceneDesc, State, Stop, Transform, UpAxis,
};
use lumbre_cli::{Format, Language, Request, SceneNames, memory_left};
use numpy::{PyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::errors::{check_environment, failed, invalid, raised, too_large, tuple, unknown};
use crate::material::colour;
use crate::meshes::{self, PlacedMesh};
use crate::picture::{Backdrop, Look, Picture, image_of};
use crate::rays::{Rays, Triples, is_single};
use crate::shape::{Camera, Environment, Light, Placed, placed, transform};
use crate::staged::{Around, PreparedScene, SceneRequest, Stages};
use crate::viewer::{Origin, Viewer};
use crate::work::interruptible;
use crate::{cast, points, rays};

/// A scene, ready for queries and renders.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Scene {
    /// Of what is there alone, for queries.
    scene: Arc<lumbre::Scene>,
    /// Before it is set on a stage.
    desc: Arc<SceneDesc>,
    origin: Origin,
    /// What it is called.
    name: PathBuf,
    /// The files that it was read from.
    files: Vec<PathBuf>,
    /// What else it depends on, by name.
    settings: Vec<(String, String)>,
    /// Hashes of the files by their names, once someone has asked for a part.
    hashes: OnceLock<BTreeMap<String, String>>,
    /// As its pictures show it.
    stages: Stages,
    /// What is called how, once someone has asked for an explanation.
    things: OnceLock<SceneNames>,
}

/// Does the same in the precision of an array, which goes by the name given.
macro_rules! by_precision {
    ($array:expr, $Real:ident => $query:expr) => {
        if is_single($array)? {
            type $Real = f32;
            $query
        } else {
            type $Real = f64;
            $query
        }
    };
}

#[pymethods]
impl Scene {
    /// Reads files as one scene; also returns the warnings.
    #[staticmethod]
    #[pyo3(signature = (paths, strictness, frame, shutter, animation, variant, settings))]
    #[expect(clippy::too_many_arguments, reason = "one call of the package's own")]
    fn open(
        py: Python<'_>,
        paths: Vec<PathBuf>,
        strictness: &str,
        frame: Option<f64>,
        shutter: f64,
        animation: Option<String>,
        variant: Option<String>,
        settings: Vec<(String, String)>,
    ) -> PyResult<(Self, Vec<String>)> {
        check_environment()?;
        let mut options = ReadOptions::default();
        options.strictness = match strictness {
            "lenient" => Strictness::Lenient,
            "strict" => Strictness::Strict,
            _ => Strictness::Normal,
        };
        (options.frame, options.shutter) = (frame, shutter);
        (options.animation, options.variant) = (animation, variant);
        let name = paths.first().cloned().unwrap_or_default();
        let open = || -> Result<(lumbre::Scene, SceneDesc, Diagnostics), lumbre::Error> {
            let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
            let (desc, mut diagnostics) = lumbre::describe(&paths, &options)?;
            let scene = lumbre::Scene::of_file(desc.clone(), &name, &mut diagnostics)?;
            Ok((scene, desc, diagnostics))
        };
        // They may be read again when this process is elsewhere.
        let named = paths.iter().map(std::path::absolute).collect::<Result<_, _>>()?;
        let origin = Origin::Files(named, Box::new(options.clone()));
        let (scene, desc, diagnostics) = interruptible(py, |_| open(), |_| Ok(()))?.map_err(raised)?;
        let files = diagnostics.files_read().to_vec();
        Ok((Self::new(scene, desc.into(), origin, name, files, settings), diagnostics.lines()))
    }

    /// Builds a scene of shapes, of shapes with many places each, and of whole scenes, with cameras and lights besides
    /// theirs.
    #[staticmethod]
    fn build(
        py: Python<'_>,
        pieces: Vec<Piece<'_>>,
        cameras: Vec<Bound<'_, Camera>>,
        lights: Vec<Bound<'_, Light>>,
        up: Option<[f64; 3]>,
        settings: Vec<(String, String)>,
    ) -> PyResult<Self> {
        check_environment()?;
        let mut desc: Option<SceneDesc> = None;
        let mut add = |more: SceneDesc| match &mut desc {
            Some(desc) => desc.append(more),
            None => desc = Some(more),
        };
        let (mut builder, mut is_begun) = (SceneBuilder::new(), false);
        let mut files = Vec::new();
        for piece in &pieces {
            match piece {
                Piece::Shape(shape) => builder = builder.shape(placed(shape)?),
                Piece::Instances((shapes, places)) => {
                    let shapes = shapes.iter().map(placed).collect::<PyResult<Vec<_>>>()?;
                    builder = builder.instances(shapes, transforms(places)?);
                }
                Piece::Scene(scene) => {
                    if is_begun {
                        add(std::mem::take(&mut builder).description().clone());
                    }
                    is_begun = false;
                    let scene = scene.get();
                    add(SceneDesc::clone(&scene.desc));
                    files.extend(scene.files.iter().cloned());
                    continue;
                }
            }
            is_begun = true;
        }
        if is_begun || pieces.is_empty() {
            add(builder.description().clone());
        }
        drop(builder);
        let mut desc = desc.unwrap_or_default();
        // The given ones come first, and the first is the default.
        let given = cameras.iter().map(|camera| camera.get().0.clone());
        desc.cameras.splice(0..0, given);
        desc.lights.extend(lights.iter().map(|light| LightDesc::clone(&light.get().0)));
        if let Some(up) = up {
            desc.up_is_guessed = false;
            desc.up = match up {
                [x, y, z] if x == 0.0 && z == 0.0 && y > 0.0 => UpAxis::Y,
                [x, y, z] if x == 0.0 && y == 0.0 && z > 0.0 => UpAxis::Z,
                towards => UpAxis::Towards(towards.into()),
            };
        }
        let build = || lumbre::Scene::from_description(desc.clone());
        let scene = interruptible(py, |_| build(), |_| Ok(()))?.map_err(raised)?;
        let desc = Arc::new(desc);
        let origin = Origin::Shapes(Arc::clone(&desc));
        Ok(Self::new(scene, desc, origin, "scene".into(), files, settings))
    }

    /// Its meshes, those of instances in each of their places.
    fn meshes(&self) -> Vec<PlacedMesh> {
        meshes::meshes(&self.desc)
    }

    /// The closest hits, into the arrays of `out`.
    fn cast(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        tmin: &Bound<'_, PyAny>,
        tmax: &Bound<'_, PyAny>,
        out: &Bound<'_, PyDict>,
    ) -> PyResult<()> {
        by_precision!(origins, Real => {
                cast::closest::<Real>(py, &self.scene, &Rays::new(origins, directions, tmin, tmax)?, out)
        })
    }

    /// The closest hits as new arrays by name, for arrays that are ready to be read; `None` for what Python has to look
    /// at first.
    fn cast_ready<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        tmin: f64,
        tmax: f64,
        fields: &Bound<'py, PyTuple>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        by_precision!(origins, Real => {
            if let Some(ray) = rays::single::<Real>(origins, directions, tmin, tmax) {
                return cast::closest_single::<Real>(py, &self.scene, ray, fields);
            }
            let rays = Rays::<Real>::ready(origins, directions, tmin, tmax);
            rays.map_or(Ok(None), |rays| cast::closest_fresh(py, &self.scene, &rays, fields))
        })
    }

    /// Whether anything is hit, into `out`.
    fn occluded(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        tmin: &Bound<'_, PyAny>,
        tmax: &Bound<'_, PyAny>,
        out: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        by_precision!(origins, Real => {
                cast::any::<Real>(py, &self.scene, &Rays::new(origins, directions, tmin, tmax)?, out)
        })
    }

    /// Whether anything is hit, as a new array, for arrays that are ready to be read; `None` for what Python has to
    /// look at first.
    fn occluded_ready<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        tmin: f64,
        tmax: f64,
    ) -> PyResult<Option<Bound<'py, PyArray1<bool>>>> {
        by_precision!(origins, Real => {
            if let Some(ray) = rays::single::<Real>(origins, directions, tmin, tmax) {
                return Ok(Some(PyArray1::from_slice(py, &[self.scene.any(&ray)])));
            }
            let rays = Rays::<Real>::ready(origins, directions, tmin, tmax);
            rays.map_or(Ok(None), |rays| cast::any_fresh(py, &self.scene, &rays))
        })
    }

    /// The numbers of hits, into `out`.
    fn count(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        tmin: &Bound<'_, PyAny>,
        tmax: &Bound<'_, PyAny>,
        out: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        by_precision!(origins, Real => {
                cast::count::<Real>(py, &self.scene, &Rays::new(origins, directions, tmin, tmax)?, out)
        })
    }

    /// Every hit, as columns by name.
    fn cast_all<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        tmin: &Bound<'py, PyAny>,
        tmax: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyDict>> {
        by_precision!(origins, Real => {
                cast::all::<Real>(py, &self.scene, &Rays::new(origins, directions, tmin, tmax)?)
        })
    }

    /// The nearest points of all surfaces, into the arrays of `out`. Says why some points have no answer, where there
    /// are such: their distance is nan.
    fn closest_point(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        max_distance: f64,
        out: &Bound<'_, PyDict>,
    ) -> PyResult<Option<String>> {
        by_precision!(points, Real => {
                points::closest::<Real>(py, &self.scene, &Triples::new("points", points)?, max_distance, out)
        })
    }

    /// Whether points are inside, into `out`.
    fn inside(&self, py: Python<'_>, points: &Bound<'_, PyAny>, out: &Bound<'_, PyAny>) -> PyResult<()> {
        by_precision!(points, Real => {
                points::inside::<Real>(py, &self.scene, &Triples::new("points", points)?, out)
        })
    }

    /// Winding numbers, into `out`.
    fn winding_number(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        out: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        by_precision!(points, Real => {
                points::winding_number::<Real>(
                    py,
                    &self.scene,
                    &Triples::new("points", points)?,
                    out.cast::<PyArray1<Real>>()?,
                )
        })
    }

    /// Renders with options by name; see the Python side for what they are.
    fn render(
        &self,
        py: Python<'_>,
        options: &Bound<'_, PyDict>,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Picture> {
        let RenderRequest { shown, options, behind, denoises, keeps_part, settings } =
            self.asked(py, options)?;
        check_memory(&options)?;
        let look = py.detach(|| Look::of(&shown, &options, behind)).map_err(raised)?;
        let tells = progress.map(Bound::unbind);
        let (watch, cancel) = (Watch::default(), CancelToken::new());
        let job = match keeps_part {
            true => Some(Job { shown: look.named()?, ..self.job(&options, settings)? }),
            false => None,
        };
        // The render has threads of its own; the ones that wait for it here check for Ctrl-C.
        let rendered = py.detach(|| {
            std::thread::scope(|scope| {
                let (done, waits) = mpsc::channel();
                let render = || {
                    let (mut picture, state) =
                        shown.scene.render_from(&options, &watch, &cancel, None, None)?;
                    if denoises && picture.stats().stride.is_some() {
                        picture.denoise_unless(options.threads, &cancel)?;
                    }
                    Ok((picture, state))
                };
                let running = scope.spawn(move || {
                    // The receiver is there until the scope ends.
                    drop(done.send(render()));
                });
                let mut raised = None;
                loop {
                    match waits.recv_timeout(LOOK) {
                        Ok(rendered) => return raised.map_or(Ok(rendered), Err),
                        Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                            let look = |py: Python<'_>| {
                                py.check_signals().and_then(|()| watch.tell(py, tells.as_ref()))
                            };
                            raised = Python::attach(look).err();
                            if raised.is_some() {
                                cancel.cancel();
                            }
                        }
                        Err(RecvTimeoutError::Timeout) => {}
                        Err(RecvTimeoutError::Disconnected) => {
                            let panic =
                                running.join().expect_err("it ends without an answer by a panic alone");
                            std::panic::resume_unwind(panic);
                        }
                    }
                }
            })
        })?;
        let (picture, state) = rendered.map_err(raised)?;
        watch.tell(py, tells.as_ref())?;
        Ok(Picture::new(picture, look, job.map(|job| PartDesc { job, state })))
    }

    /// Shows it in a viewer, at an address of this machine.
    fn view(&self, py: Python<'_>, size: Option<(u32, u32)>, spp: Option<u32>) -> PyResult<Viewer> {
        let origin = self.origin.clone();
        py.detach(|| Viewer::start(origin, size, spp))
    }

    /// What is in it, by name.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let info = self.scene.info();
        let all = PyDict::new(py);
        all.set_item("shapes", &info.shapes)?;
        all.set_item("materials", &info.materials)?;
        all.set_item("lights", &info.lights)?;
        all.set_item("triangles", info.triangles)?;
        all.set_item("instances", info.instances)?;
        all.set_item("cameras", PyList::new(py, &info.cameras)?)?;
        all.set_item("bounds", info.bounds.map(|b| (b.min.to_array(), b.max.to_array())))?;
        all.set_item("memory_bytes", info.memory_bytes)?;
        all.set_item("is_dark", self.scene.is_dark())?;
        Ok(all)
    }

    /// The files that it was read from, each as it was named.
    fn files(&self) -> Vec<PathBuf> {
        self.files.clone()
    }

    /// Reads its files once more for the hashes by which parts of a render are known; later they may go away.
    fn hash_files(&self) -> PyResult<()> {
        self.job(&self.scene.options(), Vec::new()).map(drop)
    }

    /// Samples a pixel, where nobody says how many.
    fn samples(&self) -> u32 {
        self.scene.options().stop.spp
    }

    /// An explanation of a pixel, or of a ray (its origin, its direction and its range), written in a format; options
    /// as of a render.
    #[expect(clippy::too_many_arguments, reason = "one call of the package's own")]
    fn explain(
        &self,
        py: Python<'_>,
        options: &Bound<'_, PyDict>,
        pixel: Option<(u32, u32)>,
        ray: Option<([f64; 3], [f64; 3], f64, f64)>,
        sample: u32,
        depth: u32,
        nearest: bool,
        shape: Option<String>,
        all_shapes: bool,
        lang: &str,
        format: &str,
    ) -> PyResult<String> {
        let lang = Language::from_name(lang).ok_or_else(|| unknown("language", lang, &Language::NAMES))?;
        let format = Format::from_name(format).ok_or_else(|| unknown("format", format, &Format::NAMES))?;
        let ray = ray.map(|(origin, direction, from, to)| {
            Ray::new(origin.into(), direction.into()).with_range(from, to)
        });
        let RenderRequest { shown, options, .. } = self.asked(py, options)?;
        let (only, digits) = (Vec::new(), lumbre_cli::Digits::Full);
        let request =
            Request { pixel, ray, format, lang, depth, sample, nearest, shape, all_shapes, only, digits };
        let explain = || {
            let things = self.things.get_or_init(|| SceneNames::of(&self.desc));
            lumbre_cli::explain(&shown.scene, &options, things, &self.name, &request)
        };
        py.detach(explain).map_err(failed)
    }

    /// How many trees were built so far, for ray queries and for pictures.
    fn trees(&self) -> usize {
        self.stages.trees()
    }

    /// The default size of its picture.
    fn size(&self, py: Python<'_>) -> PyResult<(u32, u32)> {
        let options = self.shown(py, SceneRequest::default())?.scene.options();
        Ok((options.width, options.height))
    }
}

/// What a scene is built of.
#[derive(FromPyObject)]
enum Piece<'py> {
    Scene(Bound<'py, Scene>),
    Shape(Placed<'py>),
    Instances((Vec<Placed<'py>>, PyReadonlyArray3<'py, f64>)),
}

/// The maps of (N, 4, 4) matrices.
fn transforms(places: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Transform>> {
    if places.shape()[1..] != [4, 4] {
        return Err(invalid(format!(
            "the places of an instance have the wrong shape (found {}; expected (N, 4, 4))",
            tuple(places.shape())
        )));
    }
    let matrix = |place: numpy::ndarray::ArrayView2<'_, f64>| {
        transform(std::array::from_fn(|row| std::array::from_fn(|column| place[[row, column]])))
    };
    places.as_array().outer_iter().map(matrix).collect()
}

/// Between two looks at a render.
const LOOK: Duration = Duration::from_millis(20);

/// How far a render is, for observers.
#[derive(Default)]
struct Watch(Mutex<Option<State>>);

impl Progress for Watch {
    fn state(&self, state: &State) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(*state);
    }
}

impl Watch {
    /// Calls `tells(samples, total, share)` if something has changed.
    fn tell(&self, py: Python<'_>, tells: Option<&Py<PyAny>>) -> PyResult<()> {
        let Some(tells) = tells else { return Ok(()) };
        let Some(state) = self.0.lock().unwrap_or_else(PoisonError::into_inner).take() else { return Ok(()) };
        tells.call1(py, (state.samples, state.total, state.share)).map(drop)
    }
}

/// What is asked of a render.
struct RenderRequest {
    shown: Arc<PreparedScene>,
    options: RenderOptions,
    /// What is behind everything.
    behind: Backdrop,
    denoises: bool,
    /// Whether its sums are to be kept, for merging.
    keeps_part: bool,
    /// What the picture depends on besides the scene and the options, by name.
    settings: Vec<(String, String)>,
}

impl Scene {
    fn new(
        scene: lumbre::Scene,
        desc: Arc<SceneDesc>,
        origin: Origin,
        name: PathBuf,
        files: Vec<PathBuf>,
        settings: Vec<(String, String)>,
    ) -> Self {
        let scene = Arc::new(scene);
        Self {
            stages: Stages::new(Arc::clone(&desc), Arc::clone(&scene)),
            scene,
            desc,
            origin,
            name,
            files,
            settings,
            hashes: OnceLock::new(),
            things: OnceLock::new(),
        }
    }

    /// On the stage of a picture. Pictures from elsewhere and in other light share its tree.
    fn shown(&self, py: Python<'_>, wish: SceneRequest) -> PyResult<Arc<PreparedScene>> {
        let building = self.stages.building.lock_py_attached(py);
        let shown = interruptible(py, |_| self.stages.shown(&wish), |_| Ok(()));
        drop(building);
        shown?.map_err(raised)
    }

    /// Which render it is.
    fn job(&self, options: &RenderOptions, staged: Vec<(String, String)>) -> PyResult<Job> {
        if self.hashes.get().is_none() {
            let files = self.files.iter().map(PathBuf::as_path).filter(|file| Path::is_file(file));
            let mut identity = Job::new(files, [], options).map_err(raised)?.identity;
            identity.retain(|name, _| name.starts_with("file "));
            self.hashes.get_or_init(|| identity);
        }
        let settings = self.settings.iter().cloned().chain(staged);
        let mut job = Job::new([], settings, options).map_err(raised)?;
        job.identity.extend(self.hashes.get().cloned().unwrap_or_default());
        Ok(job)
    }

    /// The options of a render by their names.
    fn asked(&self, py: Python<'_>, given: &Bound<'_, PyDict>) -> PyResult<RenderRequest> {
        let size: Option<(u32, u32)> = named(given, "size")?;
        let integrator = match named::<String>(given, "integrator")? {
            None => None,
            Some(name) => Some(
                IntegratorKind::from_name(&name)
                    .ok_or_else(|| unknown("integrator", &name, &IntegratorKind::NAMES))?,
            ),
        };
        let view = match given.get_item("view")? {
            Some(view) => Some(view.cast::<Camera>()?.get().0.clone()),
            None => None,
        };
        let wish = wish(given, size, integrator, view.as_ref())?;
        let settings = wish.settings();
        let shown = self.shown(py, wish)?;
        let mut options = shown.prepared.options(&shown.scene, integrator, size);
        options.view = view;
        // As the program does.
        let is_given = |name: &str| given.get_item(name).is_ok_and(|found| found.is_some());
        let samples_are_asked = ["spp", "time", "noise", "part"].into_iter().any(is_given);
        // Parts hold samples alone.
        let keeps_part = named(given, "part")?.unwrap_or(false);
        let by_default = shown.prepared.denoises() && !keeps_part;
        let denoises = named(given, "denoise")?.unwrap_or(by_default);
        if !denoises || samples_are_asked {
            options.stop = Stop::usual(options.integrator.kind, shown.scene.resolved().sampler().spp);
        }
        let behind = shown.prepared.background().map_or(Backdrop::Lights, Backdrop::Background);
        let mut asked = RenderRequest { shown, options, behind, denoises, keeps_part: false, settings };
        for (name, value) in given {
            let name: String = name.extract()?;
            ask(&mut asked, &name, &value).map_err(|error| of_value(&name, &value, error))?;
        }
        asked.options.guides = asked.denoises;
        asked.options.features |= asked.denoises;
        asked.options.transparent = !matches!(asked.behind, Backdrop::Lights);
        Ok(asked)
    }
}

/// Refuses a picture that would not fit into memory.
fn check_memory(options: &RenderOptions) -> PyResult<()> {
    // The arrays of numpy, each made of another list: the picture, its alpha, and a feature.
    const ARRAYS: u64 = 64;
    let pixels = options.bounds().map_err(lumbre::Error::from).map_err(raised)?.area();
    let rendered = options.memory_bytes().map_err(lumbre::Error::from).map_err(raised)?;
    let needed = rendered.saturating_add(pixels.saturating_mul(ARRAYS));
    let left = memory_left();
    if needed <= left {
        return Ok(());
    }
    let what = format!("a picture of {} by {} pixels", options.width, options.height);
    Err(too_large(&what, needed, left))
}

/// The value of an option, if it is given.
fn named<'py, T: for<'a> FromPyObject<'a, 'py, Error = PyErr>>(
    given: &Bound<'py, PyDict>,
    name: &str,
) -> PyResult<Option<T>> {
    let Some(value) = given.get_item(name)? else { return Ok(None) };
    value.extract().map(Some).map_err(|error| of_value(name, &value, error))
}

/// The error of an option whose value is of a wrong kind.
fn of_value(name: &str, value: &Bound<'_, PyAny>, error: PyErr) -> PyErr {
    let py = value.py();
    if error.is_instance_of::<PyTypeError>(py) || error.is_instance_of::<PyOverflowError>(py) {
        return invalid(format!("render: {name} is {value}: {}", error.value(py)));
    }
    error
}

fn ask(asked: &mut RenderRequest, name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let options = &mut asked.options;
    match name {
        "size" | "integrator" | "denoise" | "view" | "azimuth" | "elevation" | "zoom" | "fit" | "ground"
        | "env" | "overrides" => {}
        "spp" => options.stop.spp = value.extract()?,
        "crop" => {
            let (x0, y0, x1, y1) = value.extract()?;
            options.crop = Some(PixelBounds { x0, y0, x1, y1 });
        }
        "camera" => options.camera = camera(&asked.shown.scene, value)?,
        "max_depth" => options.integrator.max_depth = value.extract()?,
        "seed" => options.sampler.seed = value.extract()?,
        "threads" => options.threads = value.extract()?,
        "noise" => options.stop.noise = Some(value.extract()?),
        "min_spp" => options.stop.min_spp = Some(value.extract()?),
        "time" => {
            let seconds: f64 = value.extract()?;
            let time = Duration::try_from_secs_f64(seconds)
                .map_err(|_| invalid(format!("time is out of range (found {seconds}; expected seconds)")))?;
            options.stop.time = Some(time);
        }
        "first_sample" => options.first_sample = value.extract()?,
        "transparent" => {
            if value.extract()? {
                asked.behind = Backdrop::Nothing;
            }
        }
        "background" => asked.behind = behind(value)?,
        "spectral" => options.spectral = value.extract()?,
        "features" => options.features = value.extract()?,
        "part" => asked.keeps_part = value.extract()?,
        _ => return Err(invalid(format!("render has no option {name}"))),
    }
    Ok(())
}

/// How a scene is to be shown, by the names of options.
fn wish(
    given: &Bound<'_, PyDict>,
    size: Option<(u32, u32)>,
    integrator: Option<IntegratorKind>,
    camera: Option<&lumbre::description::Camera>,
) -> PyResult<SceneRequest> {
    let mut wish = SceneRequest { size, integrator, ..SceneRequest::default() };
    wish.eye = camera.map(|camera| camera.world_from_camera.point(DVec3::ZERO));
    let view = &mut wish.view;
    view.azimuth = named(given, "azimuth")?.unwrap_or(view.azimuth);
    view.elevation = named(given, "elevation")?.unwrap_or(view.elevation);
    view.zoom = named(given, "zoom")?.unwrap_or(view.zoom);
    wish.fit = named(given, "fit")?.unwrap_or(false);
    if let Some(name) = named::<String>(given, "ground")? {
        wish.ground = Ground::from_name(&name).ok_or_else(|| unknown("ground", &name, &Ground::NAMES))?;
    }
    if let Some(env) = given.get_item("env")? {
        wish.surroundings = around(&env)?;
    }
    wish.overrides = named(given, "overrides")?.unwrap_or_default();
    Ok(wish)
}

fn around(env: &Bound<'_, PyAny>) -> PyResult<Around> {
    if let Ok(light) = env.cast::<Light>() {
        let light = &light.get().0;
        return match **light {
            LightDesc::Infinite { .. } => Ok(Around::Light(Arc::clone(light))),
            _ => Err(invalid("env is no light from all around (expected an EnvironmentLight or a SkyLight)")),
        };
    }
    if let Ok(map) = env.cast::<Environment>() {
        return Ok(Around::Map(map.get().0.clone()));
    }
    let name = env.extract::<String>()?;
    if let Some(at) = name.strip_prefix("sky:") {
        let sun = at.parse().map_err(|error: SunPositionError| invalid(format!("env says {error}")))?;
        let sky = ClearSky::new(SkyDesc { sun, ..SkyDesc::default() }).map_err(invalid)?;
        return Ok(Around::Sky(Box::new(sky)));
    }
    match &*name {
        "studio" => Ok(Around::Studio),
        "none" => Ok(Around::Own),
        other => Err(unknown("env", other, &["studio", "none", "sky:TIME,LATITUDE,LONGITUDE"])),
    }
}

fn behind(value: &Bound<'_, PyAny>) -> PyResult<Backdrop> {
    if let Ok(image) = value.extract::<PyReadonlyArray3<'_, f32>>() {
        return Ok(Backdrop::Background(Background::Picture(image_of("background", &image)?)));
    }
    if let Ok(rgb) = value.extract::<[f32; 3]>() {
        return Ok(Backdrop::Background(Background::Colour(colour("background", rgb)?)));
    }
    let name = value.extract::<String>()?;
    match &*name {
        "env" => Ok(Backdrop::Lights),
        "transparent" => Ok(Backdrop::Nothing),
        "studio" => Ok(Backdrop::Background(Background::studio())),
        _ => Err(unknown("background", &name, &["env", "studio", "transparent"])),
    }
}

fn camera(scene: &lumbre::Scene, wanted: &Bound<'_, PyAny>) -> PyResult<usize> {
    let cameras = scene.resolved().cameras();
    if let Ok(name) = wanted.extract::<String>() {
        let names: Vec<&str> = cameras.iter().filter_map(|camera| camera.name.as_deref()).collect();
        let found = cameras.iter().position(|camera| camera.name.as_deref() == Some(&name));
        return found.ok_or_else(|| unknown("camera", &name, &names));
    }
    let index: usize = wanted.extract()?;
    if index < cameras.len() {
        return Ok(index);
    }
    Err(invalid(format!("there is no camera {index} (expected 0 to {})", cameras.len().saturating_sub(1))))
}
