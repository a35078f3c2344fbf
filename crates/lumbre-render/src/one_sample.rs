//! One sample of one pixel.

use lumbre_geometry::Ray;
use lumbre_math::DVec2;
use lumbre_scene::{CameraRay, Footprint, Scene, View};
use lumbre_shading::Spectrum;

use crate::film::{FeatureSample, Filter, Sample};
use crate::transport::{Event, Features, Integrator, Record, Sampler, Sight, integrator, see};
use crate::{RenderError, RenderOptions};

/// Between the rays that textures are looked up for, in pixels: samples average what is finer. The same for any number of samples, so
/// that more of them can be added to a render (pbrt takes fewer the wider apart).
const SPACING: f64 = 0.25;

/// Takes samples of pixels, each of which depends on its place and its number alone.
pub(crate) struct Taker<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) view: View,
    integrator: &'a dyn Integrator,
    sampler: Sampler,
    filter: Filter,
    /// Whether it matters when a ray looks.
    moves: bool,
    wants_features: bool,
    lights_are_seen: bool,
}

/// A sample, and the ray that it was taken along.
struct Taken {
    /// The point of the film, in pixels.
    film: DVec2,
    lens: DVec2,
    ray: Ray,
    sample: Sample,
}

impl<'a> Taker<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        options: &RenderOptions,
        integrator: &'a dyn Integrator,
    ) -> Result<Self, RenderError> {
        let count = scene.cameras().len();
        let camera = scene.cameras().get(options.camera);
        let camera = camera.ok_or(RenderError::NoSuchCamera { index: options.camera, count })?;
        let view = View::new(camera, options.width, options.height);
        Ok(Self {
            scene,
            moves: scene.moves() || view.moves(),
            view,
            integrator,
            sampler: Sampler::new(&options.sampler),
            filter: options.pixel_filter()?,
            wants_features: options.features || options.guides,
            lights_are_seen: !options.transparent,
        })
    }

    /// The sample of a pixel with this number.
    pub(crate) fn take(&self, x: u32, y: u32, index: u32, record: &mut Record) -> Sample {
        self.taken(x, y, index, record).sample
    }

    /// The light along a ray of no pixel, with the random numbers of one.
    fn along(&self, ray: &Ray, index: u32, record: &mut Record) -> Spectrum {
        let draw = self.sampler.draw(0, 0, index);
        let sight = Sight::new(self.scene, CameraRay { ray: *ray, footprint: Footprint::Point }, record);
        see(self.integrator, self.scene, &self.view, sight, &draw, self.lights_are_seen, record).radiance
    }

    #[inline]
    fn taken(&self, x: u32, y: u32, index: u32, record: &mut Record) -> Taken {
        let draw = self.sampler.draw(x, y, index);
        let place = self.filter.sample(draw.filter());
        let film = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) + place.offset;
        let part = if self.moves { draw.time() } else { 0.0 };
        let lens = draw.lens();
        let ray = self.view.ray(film, lens, self.view.time(part), SPACING);
        let sight = Sight::new(self.scene, ray, record);
        let features =
            if self.wants_features { Features::of(&self.view, &sight).map(feature_sample) } else { None };
        let seen = see(self.integrator, self.scene, &self.view, sight, &draw, self.lights_are_seen, record);
        let sample = Sample {
            radiance: seen.radiance,
            coverage: seen.coverage,
            weight: place.weight,
            features,
            on_catcher: seen.on_catcher,
        };
        Taken { film, lens, ray: ray.ray, sample }
    }
}

fn feature_sample(features: Features) -> FeatureSample {
    FeatureSample {
        albedo: features.albedo,
        normal: features.normal.to_array(),
        depth: features.depth,
        uv: features.uv.to_array(),
    }
}

/// A sample of a pixel with all that led to it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ExplainedSample {
    /// The point of the film, in pixels from the upper left corner of the picture.
    pub film: DVec2,
    /// The point of the lens, as two numbers in [0, 1).
    pub lens: DVec2,
    /// The ray from the camera.
    pub ray: Ray,
    /// The radiance that the render adds to the pixel for this sample, before the film's own factor.
    pub radiance: Spectrum,
    /// The weight that it has in the pixel.
    pub weight: f64,
    /// What happens along the path, in order.
    pub events: Vec<Event>,
}

/// The sample of a pixel with this number, as [`crate::render()`] takes it, with all that happens along its path.
///
/// # Errors
/// [`RenderError`] for options that make no picture; the pixel need not be in the crop.
pub fn explain_sample(
    scene: &Scene,
    options: &RenderOptions,
    (x, y): (u32, u32),
    index: u32,
) -> Result<ExplainedSample, RenderError> {
    let integrator = integrator(&options.integrator);
    let taker = Taker::new(scene, options, &*integrator)?;
    let mut record = Record::with_journal();
    let Taken { film, lens, ray, sample } = taker.taken(x, y, index, &mut record);
    let events = record.journal.unwrap_or_default();
    Ok(ExplainedSample { film, lens, ray, radiance: sample.radiance, weight: sample.weight, events })
}

/// An estimate of the light that arrives along a ray, as the render would make it, with all that happens along its path. The number
/// chooses among such estimates. The direction must be unit.
///
/// # Errors
/// [`RenderError`] for options that make no picture.
pub fn explain_ray(
    scene: &Scene,
    options: &RenderOptions,
    ray: &Ray,
    index: u32,
) -> Result<(Spectrum, Vec<Event>), RenderError> {
    let integrator = integrator(&options.integrator);
    let taker = Taker::new(scene, options, &*integrator)?;
    let mut record = Record::with_journal();
    let radiance = taker.along(ray, index, &mut record);
    Ok((radiance, record.journal.unwrap_or_default()))
}
