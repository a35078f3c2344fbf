//! Scenes: opening, ray queries and rendering.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use lumbre_formats::{Diagnostic, Diagnostics, FormatError, Place, ReadOptions, open_scenes};
use lumbre_geometry::Ray;
use lumbre_kernel::Hit;
use lumbre_math::DVec3;
use lumbre_render::integrators::integrator;
use lumbre_render::transport::Event;
use lumbre_render::{
    CancelToken, CheckpointSink, ExplainedSample, Feature, NoProgress, Progress, RenderOptions, RenderState,
    State, Stop, render_from,
};
use lumbre_scene::{BuildWarning, Footprint, IntegratorKind, SceneDesc};
use lumbre_shading::Spectrum;
use web_time::Instant;

use crate::{CastHit, CastPoint, Error, Picture, SceneInfo};

/// A scene, ready for ray queries and rendering on any number of threads.
#[derive(Debug)]
pub struct Scene {
    resolved: lumbre_scene::Scene,
    info: SceneInfo,
    build_time: Duration,
}

/// Darker surfaces say little about the light on them.
const MIN_ALBEDO: f32 = 0.02;

/// Opens a scene file: .pbrt (also .gz), .gltf, .glb, .obj, .ply or .stl. Warnings are dropped; [`open_with`]
/// returns them.
///
/// # Errors
/// [`Error::Format`] with the place, and [`Error::Build`].
pub fn open(path: impl AsRef<Path>) -> Result<Scene, Error> {
    Ok(open_with(&[path.as_ref()], &ReadOptions::default())?.0)
}

/// Opens one or more files as one scene, read one after another, and returns the diagnostics.
///
/// # Errors
/// As for [`open`]; with [`lumbre_formats::Strictness::Strict`], warnings too.
pub fn open_with(paths: &[&Path], options: &ReadOptions) -> Result<(Scene, Diagnostics), Error> {
    let (desc, mut diagnostics) = describe(paths, options)?;
    let scene = Scene::of_file(desc, paths.first().copied().unwrap_or(Path::new("")), &mut diagnostics)?;
    Ok((scene, diagnostics))
}

/// Reads one or more files as one description, which can be changed before it is built (by a [`crate::Stage`]
/// or otherwise), and returns the diagnostics.
///
/// # Errors
/// [`Error::Format`] with the place; with [`lumbre_formats::Strictness::Strict`], for warnings too.
pub fn describe(paths: &[&Path], options: &ReadOptions) -> Result<(SceneDesc, Diagnostics), Error> {
    Ok(open_scenes(paths, options)?)
}

impl Scene {
    /// Builds a scene from a description.
    ///
    /// # Errors
    /// [`Error::Build`], naming the shape, camera or light at fault.
    pub fn from_description(desc: SceneDesc) -> Result<Self, Error> {
        let mut info = SceneInfo::of(&desc);
        let start = Instant::now();
        let resolved = lumbre_scene::Scene::build(desc)?;
        let build_time = start.elapsed();
        let bounds = resolved.bounds();
        info.bounds = (!bounds.is_empty()).then_some(bounds);
        info.memory_bytes += resolved.accel().memory_bytes() as u64;
        Ok(Self { resolved, info, build_time })
    }

    /// Builds a scene read from a file; problems of the whole scene are reported for the file.
    ///
    /// # Errors
    /// [`Error::Format`]; with strict diagnostics, for warnings too.
    pub fn of_file(desc: SceneDesc, path: &Path, diagnostics: &mut Diagnostics) -> Result<Self, Error> {
        // Problems of the whole scene have a file but no line.
        let file = || Place::whole(path.display().to_string());
        let is_pov = desc.integrator.kind == IntegratorKind::Pov;
        let scene = match Self::from_description(desc) {
            Err(Error::Build(wrong)) => {
                return Err(FormatError::from(Diagnostic::error(wrong.to_string()).at(file())).into());
            }
            scene => scene?,
        };
        // Ray queries need no light: it concerns only pictures ([`Scene::is_dark`]).
        let mut found_by_chance = 0_u32;
        for warning in scene.resolved.warnings() {
            match warning {
                BuildWarning::NoLight => {}
                // Surfaces of POV-Ray's scenes light each other by other integrators only.
                BuildWarning::UnsampledLight { .. } if is_pov => found_by_chance += 1,
                _ => diagnostics.push(Diagnostic::warning(warning.to_string()).at(file())),
            }
        }
        if found_by_chance > 0 {
            let note = "the light of surfaces of solids is found by chance only by the integrator path, which is slow";
            diagnostics.push(Diagnostic::note(note).at(file()).found(found_by_chance));
        }
        diagnostics.check()?;
        Ok(scene)
    }

    /// The closest hit in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<CastHit> {
        self.resolved.accel().closest(ray).map(|hit| self.cast_hit(ray, &hit))
    }

    /// Whether there is any hit in the ray's range.
    pub fn any(&self, ray: &Ray) -> bool {
        self.resolved.accel().any(ray)
    }

    /// [`Scene::closest`] for every ray, with the same answers. It works on the calling thread, and is soonest done
    /// with thousands of rays at a time: see [`lumbre_kernel::Accel::closest_batch`].
    pub fn closest_batch(&self, rays: &[Ray]) -> Vec<Option<CastHit>> {
        let mut hits = vec![None; rays.len()];
        self.resolved.accel().closest_batch(rays, &mut hits);
        rays.iter().zip(hits).map(|(ray, hit)| hit.map(|hit| self.cast_hit(ray, &hit))).collect()
    }

    /// [`Scene::any`] for every ray, with the same answers: see [`Scene::closest_batch`].
    pub fn any_batch(&self, rays: &[Ray]) -> Vec<bool> {
        let mut hits = vec![false; rays.len()];
        self.resolved.accel().any_batch(rays, &mut hits);
        hits
    }

    /// Every hit in the ray's range, in ascending order of t, until `visit` breaks.
    pub fn all(&self, ray: &Ray, mut visit: impl FnMut(CastHit) -> ControlFlow<()>) {
        self.resolved.accel().all(ray, |hit| visit(self.cast_hit(ray, hit)));
    }

    /// The number of hits in the ray's range.
    pub fn count(&self, ray: &Ray) -> usize {
        self.resolved.accel().count(ray)
    }

    /// The nearest point of all surfaces within `max_distance` (which may be infinite); `None` where there is none so
    /// near. Its distance to triangles and exact shapes is right to the last digits.
    ///
    /// ```
    /// use lumbre::geometry::Sphere;
    /// use lumbre::{DVec3, SceneBuilder, ShapeBuilder};
    ///
    /// let ball = Sphere::new(DVec3::new(0.0, 0.0, 3.0), 2.0)?;
    /// let scene = SceneBuilder::new().shape(ShapeBuilder::exact(ball)).build()?;
    /// let nearest = scene.closest_point(DVec3::new(0.0, 0.0, -4.0), f64::INFINITY)?.expect("there is a ball");
    /// assert_eq!((nearest.distance, nearest.point), (5.0, DVec3::new(0.0, 0.0, 1.0)));
    /// assert!(scene.is_inside(DVec3::new(0.0, 1.0, 2.0)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::ClosestPointError`] where something may be nearer that has no answer: CSG, custom geometry without a
    /// method, or some shapes under maps that do not keep angles.
    pub fn closest_point(&self, point: DVec3, max_distance: f64) -> Result<Option<CastPoint>, Error> {
        let nearest = self.resolved.accel().closest_point(point, max_distance)?;
        Ok(nearest.map(|nearest| CastPoint {
            distance: nearest.distance,
            point: nearest.point,
            shape: self.resolved.shape_of(nearest.id),
            primitive: self.resolved.whole_primitive(nearest.id, nearest.primitive),
            instance: nearest.instances.first().copied(),
        }))
    }

    /// Whether a point is inside of what stands here, even-odd: where two bodies overlap it is outside again. What is
    /// open has no inside, and the answer there is some guess, always the same one.
    pub fn is_inside(&self, point: DVec3) -> bool {
        self.resolved.accel().is_inside(point)
    }

    /// How often surfaces wind around a point: 1 within a closed body, 0 without, the sum where bodies overlap, and a
    /// number in between where a mesh is open. More than 0.5 is a good rule for "inside" where meshes have gaps.
    ///
    /// # Errors
    /// [`Error::WindingNumberError`] where there are open shapes other than meshes.
    pub fn winding_number(&self, point: DVec3) -> Result<f64, Error> {
        Ok(self.resolved.accel().winding_number(point)?)
    }

    fn cast_hit(&self, ray: &Ray, hit: &Hit) -> CastHit {
        let at = self.resolved.interaction(ray, hit, &Footprint::Point);
        CastHit {
            t: hit.root.t,
            point: at.surface.point,
            normal: at.surface.normal,
            uv: at.surface.uv,
            front: at.front,
            shape: at.shape,
            primitive: at.primitive,
            instance: hit.instances.first().copied(),
        }
    }

    /// The scene's own render options.
    pub fn options(&self) -> RenderOptions {
        RenderOptions::of(&self.resolved)
    }

    /// Renders a picture.
    ///
    /// # Errors
    /// [`Error::Render`] when the options are invalid.
    pub fn render(&self, options: &RenderOptions) -> Result<Picture, Error> {
        self.render_with(options, &NoProgress, &CancelToken::new())
    }

    /// Renders a picture with progress reports; `cancel` ends it early with what has been rendered.
    ///
    /// # Errors
    /// As for [`Scene::render`].
    pub fn render_with(
        &self,
        options: &RenderOptions,
        progress: &dyn Progress,
        cancel: &CancelToken,
    ) -> Result<Picture, Error> {
        Ok(self.render_from(options, progress, cancel, None, None)?.0)
    }

    /// Renders a picture, going on from what the same render gathered before, and hands out what it gathers: now and
    /// then to a `keeper`, and at the end. The picture is that of a render without a break.
    ///
    /// # Errors
    /// As for [`Scene::render`], and where the state is not that of such a render.
    pub fn render_from(
        &self,
        options: &RenderOptions,
        progress: &dyn Progress,
        cancel: &CancelToken,
        state: Option<RenderState>,
        keeper: Option<&CheckpointSink<'_>>,
    ) -> Result<(Picture, RenderState), Error> {
        let integrator = integrator(&options.integrator);
        let (rendered, state) =
            render_from(&self.resolved, options, &*integrator, progress, cancel, state, keeper)?;
        let whole = (options.width, options.height);
        Ok((Picture { rendered, whole, background: None, noisy: None }, state))
    }

    /// The sample of a pixel with this number, as a render takes it, with all that happens along its path: the radiance
    /// is that which the render adds to the pixel, to the bit.
    ///
    /// # Errors
    /// As for [`Scene::render`].
    pub fn explain_sample(
        &self,
        options: &RenderOptions,
        pixel: (u32, u32),
        index: u32,
    ) -> Result<ExplainedSample, Error> {
        Ok(lumbre_render::explain_sample(&self.resolved, options, pixel, index)?)
    }

    /// An estimate of the light that arrives along a ray with a unit direction, and what happens along its path; the
    /// number chooses among such estimates.
    ///
    /// # Errors
    /// As for [`Scene::render`].
    pub fn explain_ray(
        &self,
        options: &RenderOptions,
        ray: &Ray,
        index: u32,
    ) -> Result<(Spectrum, Vec<Event>), Error> {
        Ok(lumbre_render::explain_ray(&self.resolved, options, ray, index)?)
    }

    /// The pixel value of white, well-lit surfaces, as an exposure meter would measure it: the luminance over
    /// the reflectance of what is visible, at the 80th percentile. `None` if nothing is visible. It is measured
    /// in a small picture of its own, so it does not depend on size, crop and number of samples.
    ///
    /// # Errors
    /// As for [`Scene::render`].
    pub fn white_level(&self, options: &RenderOptions) -> Result<Option<f32>, Error> {
        const LONGER_SIDE: f64 = 64.0;
        const SPP: u32 = 16;
        let mut small = options.smaller(LONGER_SIDE);
        (small.transparent, small.features) = (true, true);
        small.stop = Stop::at(SPP);
        let picture = self.render(&small)?;
        let image = picture.image();
        let (Some(albedo), Some(coverage)) = (picture.feature(Feature::Albedo), image.alpha()) else {
            return Ok(None);
        };
        let mut levels: Vec<f32> = image
            .pixels()
            .iter()
            .zip(albedo.pixels())
            .zip(coverage)
            .filter(|((light, albedo), coverage)| {
                **coverage > 0.99 && light.luminance() > 0.0 && albedo.luminance() > MIN_ALBEDO
            })
            .map(|((light, albedo), _)| light.luminance() / albedo.luminance())
            .collect();
        levels.sort_unstable_by(f32::total_cmp);
        Ok(levels.get(levels.len() * 4 / 5).copied())
    }

    /// Seconds that a sample of each pixel takes with these options, by rendering a small picture of the same view for
    /// a fraction of a second. The first samples fill the processor's caches, so a long render takes a little less.
    ///
    /// # Errors
    /// As for [`Scene::render`].
    pub fn seconds_per_sample(&self, options: &RenderOptions) -> Result<f64, Error> {
        const LONGER_SIDE: f64 = 96.0;
        const TIME: Duration = Duration::from_millis(500);
        let mut small = options.smaller(LONGER_SIDE);
        small.stop = Stop::at(u32::MAX);
        small.stop.time = Some(TIME);
        let until = Until { time: TIME, cancel: CancelToken::new() };
        let stats = self.render_with(&small, &until, &until.cancel)?.stats().clone();
        let pixels = options.bounds().map_err(Error::from)?.area();
        Ok(stats.elapsed.as_secs_f64() * pixels as f64 / stats.samples.max(1) as f64)
    }

    /// An estimate of the share of all light from lamps on surfaces that the integrator `path` hardly finds and
    /// `caustics` does: see [`lumbre_render::caustic_share`].
    ///
    /// # Errors
    /// As for [`Scene::render`].
    pub fn caustic_share(&self, options: &RenderOptions) -> Result<f64, Error> {
        Ok(lumbre_render::caustic_share(&self.resolved, options)?)
    }

    /// The same surfaces on another stage: those of a description that differs from this scene's in cameras, film and
    /// lights other than shapes alone. Its shapes, materials and ground are not looked at; the tree is shared.
    ///
    /// ```
    /// use lumbre::description::{Camera, LightDesc};
    /// use lumbre::geometry::Sphere;
    /// use lumbre::image::Rgb;
    /// use lumbre::{DVec3, SceneBuilder, ShapeBuilder};
    ///
    /// let builder = SceneBuilder::new().shape(ShapeBuilder::exact(Sphere::new(DVec3::ZERO, 2.0)?));
    /// let mut desc = builder.description().clone();
    /// let scene = builder.build()?;
    /// desc.cameras = vec![Camera::perspective(DVec3::new(0.0, -9.0, 2.0), DVec3::ZERO, DVec3::Z, 40.0)?];
    /// desc.lights = vec![LightDesc::Point { from: DVec3::new(3.0, -4.0, 5.0), intensity: Rgb::WHITE }];
    /// assert!(scene.relit(&desc)?.resolved().shares_tree(scene.resolved()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Build`] for a camera or a light out of range, and for a description without a camera.
    pub fn relit(&self, desc: &SceneDesc) -> Result<Self, Error> {
        let resolved = self.resolved.relit(desc.cameras.clone(), desc.film.clone(), desc.lights.clone())?;
        let mut info = SceneInfo::of(desc);
        (info.bounds, info.memory_bytes) = (self.info.bounds, self.info.memory_bytes);
        Ok(Self { resolved, info, build_time: self.build_time })
    }

    /// Puts a camera in the place of the one at a position, for pictures from elsewhere; nothing is built anew.
    ///
    /// # Errors
    /// [`Error::Build`] for a camera that makes no picture, and where there is none at the position.
    pub fn replace_camera(
        &mut self,
        position: usize,
        camera: crate::description::Camera,
    ) -> Result<(), Error> {
        Ok(self.resolved.replace_camera(position, camera)?)
    }

    /// Statistics of the scene.
    pub fn info(&self) -> &SceneInfo {
        &self.info
    }

    /// Whether nothing emits light, so that pictures of light are black.
    pub fn is_dark(&self) -> bool {
        self.resolved.warnings().contains(&BuildWarning::NoLight)
    }

    /// Whether pictures by an integrator are black, since nothing emits light that it shows. By
    /// [`IntegratorKind::Pov`] surfaces have ambient light.
    pub fn is_dark_by(&self, integrator: IntegratorKind) -> bool {
        self.is_dark() && integrator.needs_light() && integrator != IntegratorKind::Pov
    }

    /// The time taken to build the trees and the lights.
    pub fn build_time(&self) -> Duration {
        self.build_time
    }

    /// The scene resolved for light transport.
    pub fn resolved(&self) -> &lumbre_scene::Scene {
        &self.resolved
    }
}

/// Ends a render after a time, even in the first samples of a small picture, which [`Stop::time`] does not end.
struct Until {
    time: Duration,
    cancel: CancelToken,
}

impl Progress for Until {
    fn state(&self, state: &State) {
        if state.elapsed >= self.time {
            self.cancel.cancel();
        }
    }
}
