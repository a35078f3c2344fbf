//! The scene that is shown, and queries of it during a render.

use std::ops::ControlFlow;
use std::sync::{RwLock, RwLockReadGuard, RwLockWriteGuard};

use lumbre::description::{Camera, CameraView, UpAxis};
use lumbre::{
    Background, DVec2, DVec3, Parameter, ParameterKind, Ray, RenderOptions, SaveOptions, Scene, SceneDesc,
};

use crate::camera::field_of_view;
use crate::message::{
    AnimationFacts, CameraFacts, HitSurface, ListedHit, ListedParameter, PickedRay, Placement, Plane,
    SceneFacts, ValueKind,
};
use crate::source::{Built, Explain};
use crate::tree::{Thing, things, tree};

/// A scene with its descriptions by name.
pub(crate) struct Stage {
    /// The options of its picture.
    pub options: RenderOptions,
    /// How that is shown.
    pub save: SaveOptions,
    /// Its background.
    pub background: Option<Background>,
    /// Whether it is denoised.
    pub denoise: bool,
    scene: RwLock<Scene>,
    /// The cameras of the file.
    pub cameras: Vec<Camera>,
    /// Their placements.
    pub placements: Vec<Placement>,
    /// By the index of the shape in its file.
    things: Vec<Thing>,
    explain: Option<Box<dyn Explain>>,
    /// The facts of the scene for every page.
    pub facts: SceneFacts,
}

/// Hits that are listed of one ray.
const MAX_HITS: usize = 64;
/// Maximum parameters that are listed.
const MAX_PARAMETERS: usize = 2000;

/// How the colour of a pixel comes about.
pub(crate) struct Explained {
    /// A page of HTML.
    pub page: String,
    /// The hash of the script that it may run.
    pub script: Option<&'static str>,
}

impl Stage {
    /// From a built description.
    pub(crate) fn new(built: Built, desc: &SceneDesc, mut warnings: Vec<String>) -> Self {
        let Built { scene, options, save, background, denoise, warnings: more, explain } = built;
        warnings.extend(more);
        let cameras = scene.resolved().cameras().to_vec();
        let placements: Vec<Placement> =
            cameras.iter().map(|camera| Placement::of(camera, distance(&scene, camera))).collect();
        let languages = explain.as_ref().map_or_else(Vec::new, |explain| explain.languages());
        let facts = facts(&scene, desc, &cameras, &languages, &warnings);
        let things = things(desc);
        let scene = RwLock::new(scene);
        Self { options, save, background, denoise, scene, cameras, placements, things, explain, facts }
    }

    /// The scene, to render or to query.
    pub(crate) fn scene(&self) -> RwLockReadGuard<'_, Scene> {
        self.scene.read().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// The scene, to move its camera.
    pub(crate) fn scene_mut(&self) -> RwLockWriteGuard<'_, Scene> {
        self.scene.write().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// All hits of the ray through a point of the picture, by distance.
    pub(crate) fn pick(&self, camera: usize, size: (u32, u32), x: f64, y: f64) -> PickedRay {
        let scene = self.scene();
        let Some(ray) = ray(&scene, camera, size, x, y) else { return PickedRay::default() };
        let mut hits = Vec::new();
        scene.all(&ray, |hit| {
            let surface = HitSurface {
                point: hit.point.to_array(),
                normal: hit.normal.to_array(),
                uv: hit.uv.to_array(),
                front: hit.front,
                primitive: hit.primitive,
                instance: hit.instance,
            };
            let shape = self.thing(hit.shape).listed(hit.shape);
            hits.push(ListedHit { shape, distance: hit.t, surface: Some(surface) });
            if hits.len() < MAX_HITS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        PickedRay { origin: Some(ray.origin.to_array()), direction: Some(ray.direction.to_array()), hits }
    }

    /// The shape with this number.
    pub(crate) fn thing(&self, shape: u32) -> Thing {
        self.things.get(shape as usize).cloned().unwrap_or_default()
    }

    /// An explanation of a pixel's colour, as a page; `None` if there is no explainer.
    pub(crate) fn explain(
        &self,
        camera: usize,
        (width, height): (u32, u32),
        pixel: (u32, u32),
        language: &str,
    ) -> Option<Result<Explained, String>> {
        let explain = self.explain.as_ref()?;
        if pixel.0 >= width || pixel.1 >= height {
            let (x, y) = pixel;
            return Some(Err(format!("The picture of {width} by {height} pixels has no pixel {x}, {y}.")));
        }
        let scene = self.scene();
        let mut options = self.options.clone();
        options.camera = camera;
        if (width, height) != (options.width, options.height) {
            options.resize(scene.resolved().film(), width, height);
        }
        let page = explain.page(&scene, &options, pixel, language);
        Some(page.map(|page| Explained { page, script: explain.script() }))
    }
}

/// The ray through a point of the picture, through the middle of the lens in the middle of the exposure.
pub(crate) fn ray(scene: &Scene, camera: usize, (width, height): (u32, u32), x: f64, y: f64) -> Option<Ray> {
    let camera = scene.resolved().cameras().get(camera)?;
    let view = CameraView::new(camera, width, height);
    Some(view.ray(DVec2::new(x, y), DVec2::splat(0.5), view.time(0.5), 0.25).ray)
}

/// The distance of a camera's target: of the hit in its middle, otherwise of the middle of the scene.
fn distance(scene: &Scene, camera: &Camera) -> f64 {
    let place = camera.world_from_camera;
    let (eye, forward) = (place.point(DVec3::ZERO), place.vector(DVec3::Z).normalize_or(DVec3::Z));
    let hit = scene.closest(&Ray::new(eye, forward)).map(|hit| hit.t);
    let middle = scene.info().bounds.map(|bounds| (0.5 * (bounds.min + bounds.max) - eye).dot(forward));
    let near = |distance: &f64| *distance > 1e-9 && *distance < 1e9;
    hit.filter(near).or(middle.filter(near)).unwrap_or(1.0)
}

fn facts(
    scene: &Scene,
    desc: &SceneDesc,
    cameras: &[Camera],
    languages: &[(&str, &str)],
    warnings: &[String],
) -> SceneFacts {
    let info = scene.info();
    let up = match desc.up {
        UpAxis::Y => DVec3::Y,
        UpAxis::Z => DVec3::Z,
        UpAxis::Towards(up) => up.normalize_or(DVec3::Y),
    };
    let camera = |(i, camera): (usize, &Camera)| {
        let kind = camera.kind.name();
        CameraFacts {
            name: camera.name.clone().unwrap_or_else(|| format!("{i} ({kind})")),
            kind: kind.to_owned(),
            mirrored: camera.world_from_camera.is_mirror(),
            fov: field_of_view(camera),
            window: camera.window(),
        }
    };
    let parameters = lumbre::parameters(desc);
    let animations = info.listing.animations.iter();
    let ground = scene.resolved().ground();
    SceneFacts {
        cameras: cameras.iter().enumerate().map(camera).collect(),
        up: up.to_array(),
        ground: ground
            .map(|ground| Plane { point: ground.point.to_array(), normal: ground.normal.to_array() }),
        tree: tree(desc),
        bounds: info.bounds.map(|bounds| [bounds.min.to_array(), bounds.max.to_array()]),
        shapes: info.shapes.clone(),
        materials: info.materials.clone(),
        lights: info.lights.clone(),
        triangles: info.triangles,
        instances: info.instances,
        memory: info.memory_bytes,
        build_seconds: scene.build_time().as_secs_f64(),
        animations: animations.map(|a| AnimationFacts { name: a.name.clone(), end: a.end }).collect(),
        variants: info.listing.variants.clone(),
        parameters: parameters.into_iter().take(MAX_PARAMETERS).map(listed).collect(),
        languages: languages.iter().map(|&(code, name)| (code.to_owned(), name.to_owned())).collect(),
        warnings: warnings.to_vec(),
    }
}

/// A parameter as a page lists it.
fn listed(parameter: Parameter) -> ListedParameter {
    let (kind, low, high) = match parameter.kind {
        ParameterKind::Number { low, high } => (ValueKind::Number, low, high),
        ParameterKind::Colour => (ValueKind::Colour, 0.0, 1.0),
        ParameterKind::Light => (ValueKind::Light, 0.0, f64::INFINITY),
        ParameterKind::Point => (ValueKind::Point, f64::NEG_INFINITY, f64::INFINITY),
        ParameterKind::Factor | _ => (ValueKind::Factor, 0.0, f64::INFINITY),
    };
    let Parameter { path, owner, name, value, .. } = parameter;
    // JSON has no infinity: such a range has no end.
    let [low, high] = [low, high].map(|end| end.is_finite().then_some(end));
    ListedParameter { path, owner, name, kind, value, low, high }
}
