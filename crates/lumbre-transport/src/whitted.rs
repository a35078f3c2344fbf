//! Direct light, perfect reflection and perfect refraction.

use lumbre_scene::{LightId, Scene, View};
use lumbre_shading::Spectrum;

use crate::direct::Vertex;
use crate::{Draw, Integrator, RayCounts, Sight};

/// Follows mirrors and glass until a surface scatters, and gives it direct light from every light.
///
/// Whitted, "An Improved Illumination Model for Shaded Display", CACM 23(6), 1980. Where he follows both the reflected
/// and the refracted ray, one of them is chosen, as often as it carries light: the picture is the same in the mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Whitted {
    /// Reflections and refractions at most, and the direct light of the last surface.
    pub max_depth: u32,
}

/// With more lights than these, one is chosen by its power.
const EVERY_LIGHT_UP_TO: usize = 64;

impl Integrator for Whitted {
    fn radiance(
        &self,
        scene: &Scene,
        _: &View,
        sight: Sight<'_>,
        draw: &Draw,
        rays: &mut RayCounts,
    ) -> Spectrum {
        let mut throughput = Spectrum::WHITE;
        let (mut ray, mut met) = (sight.ray.ray, sight.met);
        let mut radiance = Spectrum::BLACK;
        for depth in 0..=self.max_depth {
            let Some(here) = &met else {
                let arriving: Spectrum = scene.escaped(&ray).map(|(arriving, _)| arriving).sum();
                return radiance + throughput * arriving;
            };
            radiance += throughput * here.emitted();
            if depth == self.max_depth {
                break;
            }
            let Some(vertex) = Vertex::new(here) else { break };
            if !vertex.bsdf.is_delta() {
                return radiance + throughput * direct(scene, &vertex, depth, draw, rays);
            }
            let Some(bounce) = vertex.bsdf.sample(vertex.wo, draw.lobe(depth), draw.direction(depth)) else {
                break;
            };
            throughput *= bounce.weight;
            ray = here.leave(vertex.frame.to_world(bounce.wi).as_dvec3().normalize());
            let footprint = here.footprint();
            rays.bounce += 1;
            met = scene.closest(&ray).map(|hit| scene.interaction(&ray, &hit, &footprint));
        }
        radiance
    }
}

fn direct(scene: &Scene, vertex: &Vertex, depth: u32, draw: &Draw, rays: &mut RayCounts) -> Spectrum {
    let from = vertex.met.lit_from();
    let by_light_alone = |_, _| 1.0;
    let count = scene.lights().len();
    if count > EVERY_LIGHT_UP_TO {
        let sample = scene.sample_light(from, draw.light_choice(depth), draw.light_point(depth));
        return sample.map_or(Spectrum::BLACK, |s| vertex.scattered(scene, &s, by_light_alone, rays));
    }
    let mut sum = Spectrum::BLACK;
    for light in 0..count as u32 {
        let u = draw.point_on_each_light(depth, light);
        if let Some(sample) = scene.sample_one_light(LightId(light), from, u) {
            sum += vertex.scattered(scene, &sample, by_light_alone, rays);
        }
    }
    sum
}
