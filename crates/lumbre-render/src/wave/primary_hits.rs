//! A wave as integrators see it: samples of pixels, and what their rays from the camera meet.

use lumbre_geometry::{Ray, Surface};
use lumbre_math::{DVec2, DVec3};
use lumbre_scene::{CameraRay, Footprint, Pinhole, SamplerKind, Scene, View};
use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::{WavelengthDensity, Wavelengths};
use lumbre_simd::InstructionSet;

use crate::caustics::Merging;
use crate::transport::{PrimaryHit, Record, SampleNumbers, Sampler, Seen};
use crate::wave::camera::{AimNumbers, PinholeRays};
use crate::wave::catcher::{Catcher, Places};
use crate::wave::paths::{Paths, SampleId, Slots, rounded};
use crate::wave::setting::Setting;
use crate::wave::trees::TreeIntegrator;
use crate::wave::{Precision, Wave};

/// How a render chooses the wavelengths of its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WavelengthChoice {
    pub(crate) density: WavelengthDensity,
    /// Whether samples of the same index have the same: [`Sampler::shared_wavelengths`].
    pub(crate) is_shared: bool,
}

/// Samples whose camera rays have found their first hits. An integrator gives each its radiance.
#[derive(Debug)]
pub struct PrimaryHits<'a, 's> {
    scene: &'s Scene,
    view: &'a View,
    wave: &'a mut Wave<'s>,
    precision: Precision,
    choice: Option<WavelengthChoice>,
    /// The slots that the integrator has to compute.
    wanted: Vec<u32>,
}

impl<'a, 's> PrimaryHits<'a, 's> {
    /// Starts samples, whose camera rays the caller sets.
    pub(crate) fn start(
        scene: &'s Scene,
        view: &'a View,
        wave: &'a mut Wave<'s>,
        precision: Precision,
        sampler: &Sampler,
        ids: &[SampleId],
        choice: Option<WavelengthChoice>,
    ) -> Self {
        let Wave { aims, slots, paths, .. } = wave;
        slots.start(sampler, ids);
        paths.start(ids.len());
        InstructionSet::detect().run(AimNumbers { kind: sampler.kind(), slots, aims });
        match choice {
            Some(WavelengthChoice { density, is_shared: true }) => {
                slots.choose_wavelengths(density, ids.iter().map(|id| sampler.shared_wavelengths(id.index)));
            }
            Some(WavelengthChoice { density, is_shared: false }) => {
                slots.choose_wavelengths(density, aims.wavelengths().iter().copied());
            }
            None => {}
        }
        if scene.has_solids() {
            slots.start_outside();
        }
        if scene.has_media() {
            slots.start_in(view.medium());
        }
        wave.is_first = true;
        Self { scene, view, wave, precision, choice, wanted: (0..ids.len() as u32).collect() }
    }

    /// The numbers that aim a sample: see [`SampleNumbers::aim`].
    pub(crate) fn aim(&self, slot: usize) -> [f32; 4] {
        self.wave.aims.numbers(slot)
    }

    /// Sets the film point and the time of a sample.
    pub(crate) fn set_film(&mut self, slot: usize, film: DVec2, time: f64) {
        [self.wave.aims.film[0][slot], self.wave.aims.film[1][slot]] = film.to_array();
        self.wave.slots.time[slot] = time;
    }

    /// Sets the camera rays through all film points, with footprints from neighbours at this distance, in pixels.
    pub(crate) fn look_through(&mut self, pinhole: &Pinhole, spacing: Option<f64>) {
        let Wave { aims, slots, paths, .. } = &mut *self.wave;
        InstructionSet::detect().run(PinholeRays { pinhole, spacing, film: &aims.film, slots, paths });
    }

    /// Sets the camera ray of a sample. Earlier samples must have theirs.
    pub(crate) fn set_ray(&mut self, slot: usize, camera: &CameraRay) {
        let CameraRay { ray, footprint, .. } = *camera;
        let ray = rounded(ray);
        let Wave { slots, paths, .. } = &mut *self.wave;
        paths.set_ray(slot, ray.origin, ray.direction.as_vec3(), cone(&CameraRay { ray, ..*camera }));
        slots.time[slot] = ray.time;
        slots.footprints.push(footprint);
    }

    /// Finds the first hits of all rays.
    pub(crate) fn search(&mut self) {
        let Wave { hits, slots, paths, .. } = &mut *self.wave;
        hits.search(self.scene, paths, slots, self.precision, true);
    }

    /// The scene.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// The camera.
    pub fn view(&self) -> &'a View {
        self.view
    }

    /// Sets whether camera rays see light at infinity; scattered rays always do.
    pub(crate) fn show_background(&mut self, is_shown: bool) {
        self.wave.hides_background = !is_shown;
    }

    /// Number of samples.
    pub(crate) fn len(&self) -> usize {
        self.wave.slots.len
    }

    /// The camera ray of a sample, before its path is followed.
    pub(crate) fn ray(&self, slot: usize) -> Ray {
        self.wave.paths.ray(slot, self.wave.slots.time[slot])
    }

    /// The camera ray of a sample, with its footprint.
    pub(crate) fn camera(&self, slot: usize) -> CameraRay {
        let ray = self.ray(slot);
        CameraRay { ray, footprint: self.wave.slots.footprint(slot, ray.origin), weight: 1.0 }
    }

    /// The camera ray of a sample, and its first hit.
    pub(crate) fn primary_hit(&self, slot: usize) -> PrimaryHit<'s> {
        let ray = self.camera(slot);
        let met = self.wave.hits.interaction(self.scene, slot, &ray.ray, &ray.footprint);
        PrimaryHit { ray, met }
    }

    /// Whether a ray meets the ground.
    pub(crate) fn is_on_ground(&self, slot: usize) -> bool {
        self.wave.hits.is_ground(self.scene, slot)
    }

    /// Whether a ray meets nothing.
    pub(crate) fn is_miss(&self, slot: usize) -> bool {
        self.wave.hits.is_miss(slot)
    }

    /// The geometric surface that a ray meets.
    pub(crate) fn surface(&self, slot: usize) -> Option<Surface> {
        self.wave.hits.surface(self.scene, slot, &self.ray(slot))
    }

    /// What samples see that meet a shadow catcher, in the order of the points.
    pub(crate) fn catch(
        &mut self,
        catcher: &Catcher<'s>,
        places: &mut Places,
        sampler: SamplerKind,
        lights_are_seen: bool,
        record: &mut Record,
    ) -> Vec<Seen> {
        let is_single = self.precision == Precision::Single;
        let Wave { slots, paths, shadows, .. } = &mut *self.wave;
        catcher.see(places, slots, paths, shadows, sampler, is_single, lights_are_seen, record)
    }

    /// The random numbers of a sample.
    pub(crate) fn numbers(&self, slot: usize) -> SampleNumbers {
        self.wave.slots.numbers(slot)
    }

    /// Removes samples from the integrator's list unless the predicate holds.
    pub(crate) fn retain(&mut self, mut is_wanted: impl FnMut(&Self, usize) -> bool) {
        let mut wanted = std::mem::take(&mut self.wanted);
        wanted.retain(|&slot| is_wanted(self, slot as usize));
        self.wanted = wanted;
    }

    /// The radiance of every sample; black if the integrator set none.
    pub(crate) fn radiance(&self) -> &[Spectrum] {
        &self.wave.slots.radiance
    }

    /// How samples choose their wavelengths; `None` in RGB.
    pub(crate) fn wavelength_choice(&self) -> Option<WavelengthChoice> {
        self.choice
    }

    /// Whether samples carry wavelengths.
    pub(crate) fn are_spectral(&self) -> bool {
        !self.wave.slots.wavelengths.is_empty()
    }

    /// The wavelengths of a sample; `None` in RGB.
    pub(crate) fn wavelengths(&self, slot: usize) -> Option<&Wavelengths> {
        self.wave.slots.wavelengths.get(slot)
    }

    /// Sets the radiance of each sample by a function of its ray, one by one.
    pub fn each(&mut self, mut radiance: impl FnMut(PrimaryHit<'s>, &SampleNumbers) -> Spectrum) {
        for at in 0..self.wanted.len() {
            let slot = self.wanted[at] as usize;
            let found = radiance(self.primary_hit(slot), &self.numbers(slot));
            self.wave.slots.radiance[slot] = found;
        }
    }

    /// Sets the radiance of each sample by a function of its ray alone, whose first hit nobody has found.
    pub(crate) fn each_ray(&mut self, mut radiance: impl FnMut(Ray, &SampleNumbers) -> Spectrum) {
        for at in 0..self.wanted.len() {
            let slot = self.wanted[at] as usize;
            self.wave.slots.radiance[slot] = radiance(self.ray(slot), &self.numbers(slot));
        }
    }

    /// The indices of the samples that the integrator has to compute.
    pub(crate) fn indices(&self) -> impl Iterator<Item = u32> {
        self.wanted.iter().map(|&slot| self.wave.slots.index[slot as usize])
    }

    /// Follows a tree of rays from each ray: see [`TreeIntegrator`].
    pub(crate) fn follow_trees(&mut self, integrator: &impl TreeIntegrator, record: &mut Record) {
        self.wave.follow_trees(self.scene, self.precision, &self.wanted, integrator, record);
    }

    /// Follows a path from each ray.
    pub(crate) fn follow(&mut self, setting: &Setting<'s>, record: &mut Record) {
        if self.wanted.len() < self.wave.paths.len {
            // The other samples are already known.
            let mut kept = Paths::default();
            kept.reserve(self.wanted.len());
            for &slot in &self.wanted {
                kept.push_one(&self.wave.paths.get(slot as usize));
            }
            self.wave.paths = kept;
            self.wave.hits.keep(&self.wanted);
        }
        if setting.merging.is_some() {
            let Slots { index, widths, .. } = &mut self.wave.slots;
            widths.extend(index.iter().map(|&index| Merging::widths(index)));
        }
        self.wave.follow(setting, self.precision, record);
    }
}

/// The cone of a camera ray: the width of its footprint at its origin, and its growth.
pub(crate) fn cone(camera: &CameraRay) -> (f32, f32) {
    let Footprint::Neighbours { x_origin, x_direction, y_origin, y_direction } = camera.footprint else {
        return (0.0, 0.0);
    };
    let ray = &camera.ray;
    let mean = |x: DVec3, y: DVec3| 0.5 * (x.length() + y.length());
    let width = mean(x_origin - ray.origin, y_origin - ray.origin);
    let spread = mean(x_direction - ray.direction, y_direction - ray.direction);
    (width as f32, spread as f32)
}
