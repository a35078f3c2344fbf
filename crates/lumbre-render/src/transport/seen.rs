//! What a camera ray sees: light, and how much it covers of the background.

use std::f64::consts::FRAC_1_PI;

use lumbre_math::{DVec3, Frame, warp64};
use lumbre_scene::{GroundPlane, Interaction, LightSample, Scene};
use lumbre_shading::{Scatter, Spectrum};

use crate::transport::interior::MediumStack;
use crate::transport::journal::{Event, Source};
use crate::transport::through::{goes_straight_on, light_through, straight_on};
use crate::transport::{PrimaryHit, Record, SampleNumbers};

/// Light samples of each light per sample of a shadow: few rays, compared with a whole path.
pub(crate) const SAMPLES: u32 = 2;
/// Maximum lights per such sample: if there are more, this many are chosen at random.
pub(crate) const MAX_LIGHTS: usize = 4;

/// Each light path through clear surfaces has two to the power of this vertices of random numbers.
const WAY_BITS: u32 = 6;

/// What a camera ray sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    /// Radiance, multiplied by the coverage.
    pub radiance: Spectrum,
    /// The coverage of the background, per channel: shadows are coloured if lights or clear objects are. Its mean over
    /// the samples of a pixel is in [0, 1]; that of one sample need not be.
    pub coverage: Spectrum,
    /// Whether it is a shadow catcher.
    pub on_catcher: bool,
}

/// What a sample sees without an integrator: nothing, or a shadow catcher.
///
/// A camera ray that meets nothing sees the lights at infinity, or nothing at all if these are hidden. On a shadow
/// catcher ([`GroundPlane::catcher`]) it sees what it would see without the ground, darkened by the blocked share of
/// the ground's light: light at infinity, from points and from spots. Light through clear objects is not blocked: light
/// at infinity even if it is refracted or spread, other light only through smooth panes without thickness. (P. Debevec,
/// "Rendering Synthetic Objects into Real Scenes", SIGGRAPH 1998, takes the difference of two renderings; here only the
/// blocked light is estimated, so that unshadowed ground has no noise.)
pub(crate) fn caught(
    scene: &Scene,
    primary_hit: &PrimaryHit<'_>,
    numbers: &SampleNumbers,
    lights_are_seen: bool,
    record: &mut Record,
) -> Option<Seen> {
    let behind = |ray| if lights_are_seen { scene.background(ray).sum() } else { Spectrum::BLACK };
    let covered = if lights_are_seen { Spectrum::WHITE } else { Spectrum::BLACK };
    let catcher = scene.ground().filter(|ground| ground.catcher);
    match (&primary_hit.met, catcher) {
        (Some(met), Some(ground)) if ground.holds(met) => {
            let lost = lost(scene, ground, met, numbers, record);
            let open = ground.open_irradiance(met.surface.point, met.time);
            Some(Seen::of_catcher(lost, open, lights_are_seen, behind(&primary_hit.ray.ray), record))
        }
        (None, _) if !lights_are_seen => {
            Some(Seen { radiance: Spectrum::BLACK, coverage: covered, on_catcher: false })
        }
        _ => None,
    }
}

impl Seen {
    /// A shadow catcher that has lost some of its unoccluded irradiance, in front of a background.
    pub(crate) fn of_catcher(
        lost: Spectrum,
        open: Spectrum,
        lights_are_seen: bool,
        behind: Spectrum,
        record: &mut Record,
    ) -> Self {
        let part = |lost: f32, open: f32| if open > 0.0 { lost / open } else { 0.0 };
        let blocked = Spectrum::new(part(lost.r, open.r), part(lost.g, open.g), part(lost.b, open.b));
        record.note(|| Event::Caught { blocked });
        let coverage = if lights_are_seen { Spectrum::WHITE } else { blocked };
        let radiance = record.added(Source::Infinity, Spectrum::WHITE - blocked, behind, 1.0);
        Self { radiance, coverage, on_catcher: true }
    }
}

/// An estimate of the blocked irradiance on the ground.
fn lost(
    scene: &Scene,
    ground: &GroundPlane,
    at: &Interaction<'_>,
    numbers: &SampleNumbers,
    record: &mut Record,
) -> Spectrum {
    let from = at.shadow_origin();
    let mut lost = Spectrum::BLACK;
    let lights = ground.lights();
    // Every light, if there are few.
    let asked = lights.len().min(MAX_LIGHTS);
    let share = lights.len() as f32 / asked.max(1) as f32;
    for i in 0..SAMPLES * asked as u32 {
        let chosen = match lights.len() <= MAX_LIGHTS {
            true => i as usize % asked,
            false => (numbers.light_choice(i) * lights.len() as f64) as usize,
        };
        let Some(&light) = lights.get(chosen) else { continue };
        let Some(sample) = scene.sample_one_light(light, from, at.time, numbers.light_point(i)) else {
            continue;
        };
        let density = match sample.scatter {
            Scatter::Delta => 1.0,
            Scatter::Density(pdf) => pdf,
        };
        let cosine = ground.normal.dot(sample.towards) as f32;
        if cosine <= 0.0 || density <= 0.0 {
            continue;
        }
        let shadow_ray = at.shadow_ray(&sample);
        let mut left = if goes_straight_on(scene, &sample) {
            straight_on(scene, shadow_ray, &sample, MediumStack::default(), false, false, record)
        } else {
            record.counts.shadow += 1;
            if scene.is_occluded(&shadow_ray) { Spectrum::BLACK } else { Spectrum::WHITE }
        };
        if scene.has_media() {
            left *= scene.transmittance(None, &shadow_ray, numbers.along(&shadow_ray), None);
        }
        if left == Spectrum::WHITE {
            continue;
        }
        lost += sample.radiance * (Spectrum::WHITE - left) * (cosine * share / (density * SAMPLES as f32));
    }
    if scene.is_transmissive() {
        lost = lost - passed(scene, ground, at, numbers, record);
    }
    lost
}

/// An estimate of the irradiance from light at infinity through clear objects.
///
/// Directions are sampled from the lights and over the whole sky, since clear objects may refract: the balance
/// heuristic combines both (E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997).
fn passed(
    scene: &Scene,
    ground: &GroundPlane,
    at: &Interaction<'_>,
    numbers: &SampleNumbers,
    record: &mut Record,
) -> Spectrum {
    let frame = Frame::from_z(ground.normal);
    let mut irradiance = Spectrum::BLACK;
    // Each direction has its own range of vertices, whose numbers choose the light's path.
    let along = |direction: DVec3, way: u32, record: &mut Record| {
        let cosine = ground.normal.dot(direction);
        if cosine <= 0.0 {
            return Spectrum::BLACK;
        }
        let ray = at.leave(direction);
        let light = light_through(scene, ray, numbers, way << WAY_BITS, record);
        if light.is_black() {
            return Spectrum::BLACK;
        }
        let by_lights: f64 = scene.escaped(&ray, ground.normal).map(|(_, pdf)| f64::from(pdf)).sum();
        let by_cosine = cosine * FRAC_1_PI;
        light * (cosine / (by_lights + by_cosine)) as f32
    };
    for i in 0..SAMPLES {
        let sample = scene.sample_light(
            at.shadow_origin(),
            ground.normal,
            at.time,
            numbers.light_choice(i),
            numbers.light_point(i),
        );
        if let Some(LightSample { scatter: Scatter::Density(_), end: None, towards, .. }) = sample {
            irradiance += along(towards, 1 + 2 * i, record);
        }
        let local = warp64::square_to_cosine_hemisphere(numbers.direction(i).as_dvec2());
        irradiance += along(frame.to_world(local), 2 + 2 * i, record);
    }
    irradiance / SAMPLES as f32
}
