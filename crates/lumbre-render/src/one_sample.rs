//! Samples of pixels.

use std::sync::Arc;

use lumbre_geometry::Ray;
use lumbre_math::DVec2;
use lumbre_scene::{CameraRay, FilmKind, Footprint, Interaction, Pinhole, Scene, View};
use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::{SensorCurves, Wavelengths};

use crate::film::{FeatureSample, Filter, Sample, SpectralSample, SurfacePoint, SurfaceSample};
use crate::integrators::{Integrator, integrator};
use crate::transport::{Event, Features, PrimaryHit, Record, SampleNumbers, Sampler, Seen, caught};
use crate::wave::catcher::{Catcher, Places};
use crate::wave::{Precision, PrimaryHits, SampleId, Wave, WavelengthChoice, cone};
use crate::{RenderError, RenderOptions};

/// Distance in pixels from a camera ray to the two neighbours that define its footprint: samples average finer detail.
/// It does not depend on the number of samples, so that more can be added to a render; pbrt's shrinks with their
/// number.
const SPACING: f64 = 0.25;

/// Takes samples of pixels. A sample depends only on its pixel and its index.
pub(crate) struct PixelSampler<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) view: View,
    /// The camera, if its rays are made in lanes.
    pinhole: Option<Pinhole>,
    integrator: &'a dyn Integrator,
    sampler: Sampler,
    filter: Filter,
    /// Whether the scene or the camera moves, so that rays have different times.
    moves: bool,
    /// Whether rays from the camera have footprints.
    has_footprints: bool,
    wants_features: bool,
    /// Whether the only sample of a pixel is at its centre.
    is_centred: bool,
    lights_are_seen: bool,
    /// The shadow catcher, if its samples are computed in lanes.
    catcher: Option<Catcher<'a>>,
    precision: Precision,
    /// The wavelengths of samples in a spectral render.
    wavelengths: Option<WavelengthChoice>,
    film: FilmKind,
    /// The sensor that turns wavelengths into colours; by default the CIE observer.
    sensor_curves: Option<Arc<SensorCurves>>,
}

/// What a sample sees, besides the radiance of the integrator.
#[derive(Clone, Copy, Default)]
struct SeenSample {
    /// On a shadow catcher, what replaces that radiance.
    caught: Option<Seen>,
    features: Option<FeatureSample>,
    /// What the film keeps of the surface.
    surface: Option<SurfaceSample>,
    /// Its coverage, if not full and not given by `caught`.
    covered: Option<Spectrum>,
}

/// The film point, lens point and time of a sample.
#[derive(Clone, Copy)]
struct Aim {
    /// The point of the film, in pixels.
    film: DVec2,
    lens: DVec2,
    time: f64,
    weight: f64,
}

impl<'a> PixelSampler<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        options: &RenderOptions,
        integrator: &'a dyn Integrator,
    ) -> Result<Self, RenderError> {
        let camera = options.camera_of(scene)?;
        let view = View::new(camera, options.width, options.height);
        if options.spectral && !integrator.carries_wavelengths() {
            return Err(RenderError::NoWavelengths);
        }
        if matches!(options.film, FilmKind::Spectral(_)) && !options.spectral {
            return Err(RenderError::NoBuckets);
        }
        Ok(Self {
            scene,
            moves: scene.moves() || view.moves(),
            has_footprints: scene.is_textured()
                || integrator.needs_footprints()
                || matches!(options.film, FilmKind::GBuffer(_)),
            precision: precision(scene, &view, options),
            pinhole: view.pinhole(),
            view,
            integrator,
            sampler: Sampler::new(&options.sampler),
            filter: options.pixel_filter()?,
            wants_features: options.features || options.guides,
            is_centred: options.integrator.kind == lumbre_scene::IntegratorKind::Pov && options.stop.spp == 1,
            lights_are_seen: !options.transparent,
            catcher: Catcher::of(scene),
            wavelengths: options
                .wavelengths()
                .map(|density| WavelengthChoice { density, is_shared: integrator.shares_wavelengths(scene) }),
            film: options.film,
            sensor_curves: options.sensor_curves.clone(),
        })
    }

    /// Takes samples, and passes each to `put`, in order.
    pub(crate) fn take(
        &self,
        wave: &mut Wave<'a>,
        ids: &[SampleId],
        record: &mut Record,
        mut put: impl FnMut(SampleId, Sample),
    ) {
        let mut primary_hits = self.start(wave, ids);
        // The weights of the filter and of the lens.
        let mut weights = Vec::with_capacity(ids.len());
        match &self.pinhole {
            Some(pinhole) => {
                for (slot, &id) in ids.iter().enumerate() {
                    let aim = self.aim(id, primary_hits.aim(slot), None);
                    weights.push((aim.weight, 1.0));
                    primary_hits.set_film(slot, aim.film, aim.time);
                }
                primary_hits.look_through(pinhole, self.has_footprints.then_some(SPACING));
            }
            None => {
                for (slot, &id) in ids.iter().enumerate() {
                    let aim = self.aim(id, primary_hits.aim(slot), Some(&primary_hits.numbers(slot)));
                    let camera = self.camera_ray(&aim);
                    weights.push((aim.weight, camera.weight));
                    primary_hits.set_ray(slot, &camera);
                }
            }
        }
        self.search(&mut primary_hits, record);
        let seen = self.see(&mut primary_hits, record);
        for (slot, ((&id, &(weight, passes)), &radiance)) in
            ids.iter().zip(&weights).zip(primary_hits.radiance()).enumerate()
        {
            let SeenSample { mut caught, mut features, mut surface, covered } =
                seen.get(slot).copied().unwrap_or_default();
            if passes == 0.0 {
                (caught, features, surface) = (None, None, None);
            }
            let spectrum = self.spectrum(primary_hits.wavelengths(slot), radiance, caught.as_ref(), passes);
            let radiance = match (primary_hits.wavelengths(slot), &self.sensor_curves) {
                (None, _) => radiance,
                (Some(wavelengths), None) => wavelengths.rec709(radiance),
                (Some(wavelengths), Some(sensor)) => wavelengths.recorded(radiance, sensor),
            };
            let radiance = through_lens(radiance, passes);
            if let Some(caught) = &mut caught {
                caught.radiance = through_lens(caught.radiance, passes);
            }
            let coverage = covered.unwrap_or(Spectrum::WHITE);
            let Seen { radiance, coverage, on_catcher } =
                caught.unwrap_or(Seen { radiance, coverage, on_catcher: false });
            put(id, Sample { radiance, coverage, weight, features, surface, spectrum, on_catcher });
        }
    }

    /// The sample of a film with buckets. A shadow catcher has an RGB colour, which becomes a smooth spectrum.
    fn spectrum(
        &self,
        wavelengths: Option<&Wavelengths>,
        radiance: Spectrum,
        caught: Option<&Seen>,
        passes: f64,
    ) -> Option<SpectralSample> {
        let (FilmKind::Spectral(_), Some(wavelengths)) = (self.film, wavelengths) else { return None };
        let radiance = caught.map_or(radiance, |caught| wavelengths.varied_light(caught.radiance));
        Some(SpectralSample { nm: wavelengths.nm(), radiance: through_lens(radiance, passes).to_array() })
    }

    /// Finds the first hits of camera rays, if anybody looks at them.
    fn search(&self, primary_hits: &mut PrimaryHits<'_, 'a>, record: &mut Record) {
        record.counts.camera += primary_hits.len() as u64;
        let is_looked_at = self.integrator.uses_primary_hits()
            || self.wants_features
            || !self.lights_are_seen
            || matches!(self.film, FilmKind::GBuffer(_))
            || self.scene.ground().is_some_and(|ground| ground.catcher);
        if is_looked_at {
            primary_hits.search();
        }
    }

    /// Computes features and shadow catchers, then calls the integrator for the other samples. The result is empty if
    /// no sample has either.
    fn see(&self, primary_hits: &mut PrimaryHits<'_, 'a>, record: &mut Record) -> Vec<SeenSample> {
        primary_hits.show_background(self.lights_are_seen);
        let has_catcher = self.scene.ground().is_some_and(|ground| ground.catcher);
        let mut seen = Vec::new();
        let space = match self.film {
            FilmKind::GBuffer(space) => Some(space),
            FilmKind::Rgb | FilmKind::Spectral(_) => None,
        };
        let wants_surfaces = self.wants_features || space.is_some();
        if wants_surfaces || has_catcher || !self.lights_are_seen {
            seen.resize(primary_hits.len(), SeenSample::default());
            let mut places = Places::default();
            primary_hits.retain(|primary_hits, slot| {
                let is_caught = has_catcher && primary_hits.is_on_ground(slot);
                if is_caught
                    && let Some(catcher) = &self.catcher
                    && let Some(surface) = primary_hits.surface(slot)
                {
                    let ray = primary_hits.ray(slot);
                    places.push(slot, surface.point, surface.offset_origin(-ray.direction));
                    if self.wants_features {
                        let features = Features::of_ground(&self.view, catcher.ground(), &ray, &surface);
                        seen[slot].features = Some(feature_sample(features));
                    }
                    if let Some(space) = space {
                        let ground = catcher.ground();
                        let at = SurfacePoint {
                            point: surface.point,
                            normal: surface.normal,
                            shading_normal: surface.normal.as_vec3(),
                            uv: surface.uv.as_vec2(),
                            albedo: ground.albedo,
                        };
                        let camera = primary_hits.camera(slot);
                        seen[slot].surface =
                            Some(SurfaceSample::of(&self.view, space, &camera, &at, SPACING));
                    }
                    return false;
                }
                let is_plain =
                    if primary_hits.is_miss(slot) { self.lights_are_seen } else { !wants_surfaces };
                if is_plain && !is_caught {
                    return true;
                }
                let primary_hit = primary_hits.primary_hit(slot);
                let numbers = primary_hits.numbers(slot);
                let features =
                    if self.wants_features { Features::of(&self.view, &primary_hit) } else { None };
                let surface = space.zip(primary_hit.met.as_ref()).map(|(space, met)| {
                    let at = surface_point(met);
                    SurfaceSample::of(&self.view, space, &primary_hit.ray, &at, SPACING)
                });
                let left = self.left_by_media(&primary_hit, &numbers);
                let features = features.map(|features| feature_sample(features.behind(left)));
                if primary_hit.met.is_none() && left != Spectrum::WHITE && !self.lights_are_seen {
                    // Only the medium is visible.
                    seen[slot] =
                        SeenSample { caught: None, features, surface, covered: Some(Spectrum::WHITE - left) };
                    return true;
                }
                let caught = caught(self.scene, &primary_hit, &numbers, self.lights_are_seen, record);
                seen[slot] = SeenSample { caught, features, surface, covered: None };
                caught.is_none()
            });
            if let Some(catcher) = &self.catcher {
                let kind = self.sampler.kind();
                let caught = primary_hits.catch(catcher, &mut places, kind, self.lights_are_seen, record);
                for (&slot, caught) in places.slots.iter().zip(caught) {
                    seen[slot as usize].caught = Some(caught);
                }
            }
        }
        self.integrator.estimate(primary_hits, &self.sampler, record);
        seen
    }

    /// An estimate of the transmittance of media along a camera ray.
    fn left_by_media(&self, primary_hit: &PrimaryHit<'_>, numbers: &SampleNumbers) -> Spectrum {
        if !self.scene.has_media() {
            return Spectrum::WHITE;
        }
        let ray = primary_hit.ray.ray;
        let end =
            primary_hit.met.as_ref().map_or(f64::INFINITY, |met| (met.surface.point - ray.origin).length());
        self.scene.transmittance(self.view.medium(), &ray.with_range(0.0, end), numbers.along(&ray), None)
    }

    /// Starts samples.
    fn start<'w>(&'w self, wave: &'w mut Wave<'a>, ids: &[SampleId]) -> PrimaryHits<'w, 'a> {
        PrimaryHits::start(self.scene, &self.view, wave, self.precision, &self.sampler, ids, self.wavelengths)
    }

    /// The aim of a sample, by the numbers of [`SampleNumbers::aim`]. Without lens numbers, it goes through the centre
    /// of the lens.
    fn aim(&self, id: SampleId, [u, v, part, _]: [f32; 4], numbers: Option<&SampleNumbers>) -> Aim {
        let place = self.filter.sample(DVec2::new(u.into(), v.into()));
        let pixel = DVec2::new(f64::from(id.x) + 0.5, f64::from(id.y) + 0.5);
        let offset = if self.is_centred { DVec2::ZERO } else { place.offset };
        let lens = numbers.filter(|_| self.view.has_lens()).map_or(DVec2::splat(0.5), SampleNumbers::lens);
        let time = self.view.time(if self.moves { part.into() } else { 0.0 });
        Aim { film: pixel + offset, lens, time, weight: place.weight }
    }

    fn camera_ray(&self, aim: &Aim) -> CameraRay {
        if self.has_footprints {
            self.view.ray(aim.film, aim.lens, aim.time, SPACING)
        } else {
            self.view.bare_ray(aim.film, aim.lens, aim.time)
        }
    }

    /// A sample with its events.
    fn explain(&self, id: SampleId) -> ExplainedSample {
        let numbers = self.sampler.numbers(id.x, id.y, id.index);
        let aim = self.aim(id, numbers.aim(), Some(&numbers));
        let camera = self.camera_ray(&aim);
        let (ray, radiance, events) = self.explain_camera_ray(id, &camera);
        let radiance = through_lens(radiance, camera.weight);
        ExplainedSample { film: aim.film, lens: aim.lens, ray, radiance, weight: aim.weight, events }
    }

    /// The radiance along a camera ray with the numbers of a sample, and the events of its path.
    fn explain_camera_ray(&self, id: SampleId, camera: &CameraRay) -> (Ray, Spectrum, Vec<Event>) {
        let (mut wave, mut record) = (Wave::default(), Record::with_journal());
        let mut primary_hits = self.start(&mut wave, &[id]);
        primary_hits.set_ray(0, camera);
        self.search(&mut primary_hits, &mut record);
        let ray = primary_hits.ray(0);
        let seen = self.see(&mut primary_hits, &mut record).first().and_then(|seen| seen.caught);
        let radiance = seen.map_or(primary_hits.radiance()[0], |seen| seen.radiance);
        (ray, radiance, record.journal.unwrap_or_default())
    }
}

/// Radiance times the weight of its camera ray.
fn through_lens(radiance: Spectrum, weight: f64) -> Spectrum {
    if weight == 1.0 {
        radiance
    } else if weight == 0.0 {
        // Black also if the radiance behind the stop is not finite.
        Spectrum::BLACK
    } else {
        radiance * weight as f32
    }
}

/// Rounded rays start farther off their surfaces. In a close-up of a large scene that would show, so rays are in double
/// precision if, at the hit of any of a few rays over the picture, the rounding is larger than a pixel of a picture
/// that is 1000 pixels wide.
fn precision(scene: &Scene, view: &View, options: &RenderOptions) -> Precision {
    const RAYS: u32 = 8;
    const PIXELS: f64 = 1000.0;
    let Some(rounding) = scene.accel().picture_rounding() else { return Precision::Double };
    let size = DVec2::new(f64::from(options.width), f64::from(options.height));
    let spacing = size.max_element() / PIXELS;
    let is_coarse = |i: u32| {
        let place = DVec2::new(f64::from(i % RAYS) + 0.5, f64::from(i / RAYS) + 0.5) / f64::from(RAYS);
        let camera = view.ray(place * size, DVec2::splat(0.5), view.time(0.5), spacing);
        let Some(hit) = scene.closest(&camera.ray) else { return false };
        let (width, spread) = cone(&camera);
        let distance = hit.root.t;
        rounding.error(camera.ray.at(distance)).length() > f64::from(width) + f64::from(spread) * distance
    };
    Precision::of(scene, (0..RAYS * RAYS).any(is_coarse))
}

/// The point of a surface for a film of features.
fn surface_point(met: &Interaction<'_>) -> SurfacePoint {
    let (shading_normal, albedo) = match met.scattering() {
        Some((frame, bsdf)) => (frame.n, bsdf.albedo()),
        None => (met.shading.normal, Spectrum::BLACK),
    };
    SurfacePoint {
        point: met.surface.point,
        normal: met.surface.normal,
        shading_normal,
        uv: met.uv(),
        albedo,
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

/// A sample of a pixel with its events.
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
    /// Its weight in the pixel.
    pub weight: f64,
    /// The events of its path, in order.
    pub events: Vec<Event>,
}

/// The sample of a pixel with this index, as [`crate::render()`] takes it, with the events of its path.
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
    let pixel_sampler = PixelSampler::new(scene, options, &*integrator)?;
    Ok(pixel_sampler.explain(SampleId { x, y, index }))
}

/// An estimate of the radiance that arrives along a ray, computed as the render would, with the events of its path. The
/// index selects the random numbers. The direction must be unit.
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
    let pixel_sampler = PixelSampler::new(scene, options, &*integrator)?;
    let camera = CameraRay { ray: *ray, footprint: Footprint::Point, weight: 1.0 };
    // The random numbers are those of a pixel.
    let (_, radiance, events) = pixel_sampler.explain_camera_ray(SampleId { x: 0, y: 0, index }, &camera);
    Ok((radiance, events))
}
