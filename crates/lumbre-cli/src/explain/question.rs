//! The subject of an explanation: a pixel or a ray.

use lumbre::description::CameraView;
use lumbre::journal::Event;
use lumbre::shading::Spectrum;
use lumbre::{DVec3, Ray, RenderOptions, Scene};

use super::document::Section;
use super::surfaces::Chosen;
use super::texts::Texts;
use super::things::SceneNames;
use super::{camera, light, surfaces};
use crate::failure::Failure;

/// Which sample, how much detail, and in which language.
pub(super) struct Question<'a> {
    pub(super) things: &'a SceneNames,
    pub(super) texts: &'static Texts,
    /// The number of the sample.
    pub(super) sample: u32,
    /// Number of rays after the first whose crossings are shown too.
    pub(super) depth: u32,
    /// Whether to show only the visible surface.
    pub(super) nearest: bool,
    /// The shapes to show, hit or not; `None` for those that the ray hits.
    pub(super) shapes: Option<Chosen>,
}

impl Question<'_> {
    /// For a pixel of the picture.
    ///
    /// # Errors
    /// As for a render.
    pub(super) fn of_pixel(
        &self,
        scene: &Scene,
        options: &RenderOptions,
        pixel: (u32, u32),
    ) -> Result<Vec<Section>, Failure> {
        let sample = scene.explain_sample(options, pixel, self.sample)?;
        let camera = options.camera_of(scene.resolved()).map_err(lumbre::Error::from)?;
        let whole = (options.width, options.height);
        let mut section = camera::camera(camera, whole, pixel, &sample, self.texts);
        section.fact(self.texts.sample, f64::from(self.sample));
        section.fact(self.texts.weight, sample.weight);
        let exposed =
            light::Exposed { radiance: sample.radiance, exposure: options.exposure, weight: sample.weight };
        let coverage = options.coverage_numbers(pixel, self.sample);
        self.along(
            section,
            scene,
            options,
            &sample.ray,
            coverage,
            Some(exposed),
            sample.radiance,
            &sample.events,
        )
    }

    /// For a ray, whose direction has any length but 0.
    ///
    /// # Errors
    /// As for a render.
    pub(super) fn of_ray(
        &self,
        scene: &Scene,
        options: &RenderOptions,
        ray: &Ray,
    ) -> Result<Vec<Section>, Failure> {
        // Light travels along unit directions.
        let scaled = ray.direction / ray.direction.abs().max_element();
        let unit = Ray { direction: scaled.normalize(), ..*ray };
        let (radiance, events) = scene.explain_ray(options, &unit, self.sample)?;
        let coverage = options.coverage_numbers((0, 0), self.sample);
        self.along(camera::given(ray, self.texts), scene, options, ray, coverage, None, radiance, &events)
    }

    /// The world axis that is most upwards in the picture.
    fn up(&self, scene: &Scene, options: &RenderOptions) -> DVec3 {
        let Some(camera) = scene.resolved().cameras().get(options.camera) else { return DVec3::Y };
        let view = CameraView::new(camera, options.width, options.height);
        let up = view.placement(0.0).vector(DVec3::Y);
        let axis = (0..3).fold(0, |best, i| if up[i].abs() > up[best].abs() { i } else { best });
        DVec3::AXES[axis] * up[axis].signum()
    }

    /// Writes the sections on the ray's origin, its hits, and the light along it.
    #[allow(clippy::too_many_arguments, reason = "the parts of one explanation")]
    fn along(
        &self,
        from: Section,
        scene: &Scene,
        options: &RenderOptions,
        ray: &Ray,
        coverage: [f32; 2],
        exposed: Option<light::Exposed>,
        radiance: Spectrum,
        events: &[Event],
    ) -> Result<Vec<Section>, Failure> {
        let &Self { things, texts, depth, nearest, .. } = self;
        let (up, path) = (self.up(scene, options), light::corners(events));
        let shapes = self.shapes.as_ref();
        let asked = surfaces::Wanted { nearest, from_camera: Some(coverage), shapes, up, path: &path };
        let met = surfaces::surfaces(scene, ray, things, &asked, texts)?;
        let path = light::Path { scene, things, texts, depth, kind: &options.integrator.kind, up, coverage };
        Ok(vec![from, met, path.tell(exposed, radiance, events)])
    }
}
