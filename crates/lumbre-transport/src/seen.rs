//! What a camera sees along a line of sight: light, and how much of what is behind it covers.

use lumbre_scene::{GroundPlane, Interaction, Scene, View};
use lumbre_shading::{Scatter, Spectrum};

use crate::{Draw, Integrator, RayCounts, Sight};

/// Samples of each light that each sample of a shadow takes: few rays, where a whole path would be many.
const SAMPLES: u32 = 2;
/// Lights that each such sample asks: of more, as many by chance.
const MOST_LIGHTS: usize = 4;

/// What is seen along a line of sight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Radiance, multiplied by the coverage.
    pub radiance: Spectrum,
    /// How much of what is behind is covered. Its mean over the samples of a pixel is in [0, 1]; that of one sample need
    /// not be.
    pub coverage: f32,
}

/// Looks along a line of sight.
///
/// Where the camera meets nothing it sees the lights at infinity, or, if these are not to be seen, nothing at all. On ground
/// that catches shadows ([`GroundPlane::catcher`]) it sees what it would see without the ground, darkened by the share of
/// the light which something keeps from the ground: of light at infinity, from points and from spots. (P. Debevec,
/// "Rendering Synthetic Objects into Real Scenes", SIGGRAPH 1998, takes the difference of two renderings; here only what
/// is blocked is estimated, so that ground in the open has no noise.)
pub fn see(
    integrator: &dyn Integrator,
    scene: &Scene,
    view: &View,
    sight: Sight<'_>,
    draw: &Draw,
    lights_are_seen: bool,
    rays: &mut RayCounts,
) -> Seen {
    let behind = |ray| if lights_are_seen { scene.background(ray).sum() } else { Spectrum::BLACK };
    let covered = if lights_are_seen { 1.0 } else { 0.0 };
    let catcher = scene.ground().filter(|ground| ground.catcher);
    match (&sight.met, catcher) {
        (Some(met), Some(ground)) if ground.holds(met) => {
            let blocked = blocked(scene, ground, met, draw, rays);
            let left = Spectrum::WHITE - blocked;
            let coverage = if lights_are_seen { 1.0 } else { blocked.average() };
            Seen { radiance: behind(&sight.ray.ray) * left, coverage }
        }
        (None, _) if !lights_are_seen => Seen { radiance: Spectrum::BLACK, coverage: covered },
        _ => Seen { radiance: integrator.radiance(scene, view, sight, draw, rays), coverage: 1.0 },
    }
}

/// An estimate of the share of the light on the ground that something blocks.
fn blocked(
    scene: &Scene,
    ground: &GroundPlane,
    at: &Interaction<'_>,
    draw: &Draw,
    rays: &mut RayCounts,
) -> Spectrum {
    let from = at.lit_from();
    let mut lost = Spectrum::BLACK;
    let lights = ground.lights();
    // Every light, where there are few.
    let asked = lights.len().min(MOST_LIGHTS);
    let share = lights.len() as f32 / asked.max(1) as f32;
    for i in 0..SAMPLES * asked as u32 {
        let chosen = match lights.len() <= MOST_LIGHTS {
            true => i as usize % asked,
            false => (draw.light_choice(i) * lights.len() as f64) as usize,
        };
        let Some(&light) = lights.get(chosen) else { continue };
        let Some(sample) = scene.sample_one_light(light, from, at.time, draw.light_point(i)) else {
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
        rays.shadow += 1;
        if scene.is_occluded(&at.shadow_ray(&sample)) {
            lost += sample.radiance * (cosine * share / (density * SAMPLES as f32));
        }
    }
    let open = ground.open_irradiance(at.surface.point, at.time);
    let part = |lost: f32, open: f32| if open > 0.0 { lost / open } else { 0.0 };
    Spectrum::new(part(lost.r, open.r), part(lost.g, open.g), part(lost.b, open.b))
}
