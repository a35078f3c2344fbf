//! The viewer of the program, for a scene that is here.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use lumbre::{EnvironmentDesc, ReadOptions, SceneDesc, Stage, Surroundings};
use lumbre_cli::Explainer;
use lumbre_viewer::{Built, Closer, Hidden, Moment, Options, Read, Source, SourceError};
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;

/// Where a scene comes from.
#[derive(Clone)]
pub(crate) enum Origin {
    /// These files, read like this.
    Files(Vec<PathBuf>, Box<ReadOptions>),
    /// What was built.
    Shapes(Arc<SceneDesc>),
}

/// A scene for the viewer.
#[derive(Clone)]
struct Live {
    origin: Origin,
    /// A picture of light from all around that was dropped on the page.
    environment: Option<PathBuf>,
    size: Option<(u32, u32)>,
    spp: Option<u32>,
}

impl Source for Live {
    fn name(&self) -> String {
        let name = self.files().into_iter().next().unwrap_or_else(|| "scene".into());
        name.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    }

    fn files(&self) -> Vec<PathBuf> {
        match &self.origin {
            Origin::Files(paths, _) => paths.clone(),
            Origin::Shapes(_) => Vec::new(),
        }
    }

    fn read(&self, moment: &Moment) -> Result<Read, SourceError> {
        match &self.origin {
            Origin::Shapes(desc) => {
                Ok(Read { desc: SceneDesc::clone(desc), files: Vec::new(), warnings: Vec::new() })
            }
            Origin::Files(paths, options) => {
                let mut options = options.clone();
                options.frame = moment.time.or(options.frame);
                options.variant = moment.variant.clone().or(options.variant);
                let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
                let (desc, diagnostics) = lumbre::describe(&paths, &options)?;
                Ok(Read { desc, files: diagnostics.files_read().to_vec(), warnings: diagnostics.lines() })
            }
        }
    }

    fn build(&self, mut desc: SceneDesc, hidden: &Hidden) -> Result<Built, SourceError> {
        let explain = Explainer::new(&desc, self.name());
        let mut stage = Stage::default();
        stage.size = self.size;
        if let Some(path) = &self.environment {
            stage.surroundings = Surroundings::Map(environment(path)?);
        }
        let prepared = lumbre::prepare(&mut desc, &stage, None);
        hidden.apply(&mut desc);
        let scene = lumbre::Scene::from_description(desc)?;
        let mut options = prepared.options(&scene, None, self.size);
        options.threads = rayon::current_num_threads();
        options.stop.spp = self.spp.unwrap_or(options.stop.spp);
        self.check(&options)?;
        let mut save = prepared.save_options(&scene);
        save.exposure = prepared.exposure(&scene, &options)?;
        Ok(Built {
            scene,
            options,
            save,
            background: prepared.background(),
            denoise: prepared.denoises(),
            warnings: Vec::new(),
            explain: Some(Box::new(explain)),
        })
    }

    fn check(&self, options: &lumbre::RenderOptions) -> Result<(), SourceError> {
        Ok(lumbre_cli::check_picture(options, 0)?)
    }

    fn of_folder(&self, folder: &Path, scene: &Path) -> Arc<dyn Source> {
        let mut options = ReadOptions::default();
        (options.only_named_files, options.folder) = (true, Some(folder.to_owned()));
        let origin = Origin::Files(vec![scene.to_owned()], Box::new(options));
        Arc::new(Self { origin, ..self.clone() })
    }

    fn in_light_of(&self, picture: &Path) -> Arc<dyn Source> {
        Arc::new(Self { environment: Some(picture.to_owned()), ..self.clone() })
    }
}

/// Light from all around, from a picture.
fn environment(path: &Path) -> Result<EnvironmentDesc, SourceError> {
    let image = Arc::new(lumbre::read_image(path)?);
    let what = format!("{}: no environment map (expected twice as wide as high, or square)", path.display());
    EnvironmentDesc::of_image(image).ok_or(SourceError { kind: lumbre::ErrorKind::Input, message: what })
}

/// A viewer that listens on this machine alone, until it is closed.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Viewer {
    url: String,
    closer: Closer,
    runs: Mutex<Option<JoinHandle<Result<(), String>>>>,
}

impl Viewer {
    pub(crate) fn start(origin: Origin, size: Option<(u32, u32)>, spp: Option<u32>) -> PyResult<Self> {
        let source = Arc::new(Live { origin, environment: None, size, spp });
        let viewer = lumbre_viewer::Viewer::new(source, &Options::default()).map_err(PyOSError::new_err)?;
        let (url, closer) = (viewer.url(), viewer.closer());
        let thread = std::thread::Builder::new().name("viewer".to_owned());
        let runs = thread.spawn(move || viewer.run()).map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
        Ok(Self { url, closer, runs: Mutex::new(Some(runs)) })
    }

    fn runs(&self) -> std::sync::MutexGuard<'_, Option<JoinHandle<Result<(), String>>>> {
        self.runs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Viewer {
    /// The address to open, once.
    fn url(&self) -> &str {
        &self.url
    }

    /// Whether it still runs.
    fn is_open(&self) -> bool {
        self.runs().as_ref().is_some_and(|runs| !runs.is_finished())
    }

    /// Ends it, and waits until it has ended.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.closer.close();
        let Some(runs) = self.runs().take() else { return Ok(()) };
        match py.detach(|| runs.join()) {
            Ok(ended) => ended.map_err(PyRuntimeError::new_err),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}
