//! Path tracing with next-event estimation and multiple importance sampling.

use lumbre_geometry::Ray;
use lumbre_scene::{Interaction, Scene, View};
use lumbre_shading::medium::{Flight, sample_henyey_greenstein};
use lumbre_shading::{Scatter, Spectrum};

use crate::transport::direct::{Vertex, power_heuristic};
use crate::transport::interior::Interiors;
use crate::transport::{Draw, Integrator, RayCounts, Sight};

/// Kajiya's path tracing: at each surface one sample of a light and one of the BSDF, combined by the power heuristic,
/// and Russian roulette by throughput from the second bounce on.
///
/// Light from points and in one direction, which no path finds by chance, is sampled straight through what does not change
/// its direction ([`lumbre_shading::Bsdf::straight_on`]): smooth panes without thickness. That is no bounce. What is smooth and refracts
/// throws a shadow of such light; what is rough is lit by it, and passes it on. The light of surfaces and of the sky is found
/// by paths, through panes as through anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Path {
    /// Bounces at most: 0 shows lights alone, 1 direct light.
    pub max_depth: u32,
    /// Whether to roughen surfaces after the first diffuse bounce.
    pub regularize: bool,
    /// How light is found.
    pub strategy: Strategy,
    /// Bounces that every path may take before Russian roulette.
    pub sure_bounces: u32,
}

/// How a path finds light. All give the same picture in the mean, but [`Strategy::Bsdf`] does not find lights that no ray
/// can hit by chance, for which it samples the lights all the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Both ways, weighed.
    #[default]
    Both,
    /// By sampling lights, where they can be sampled.
    Lights,
    /// By sampling the BSDF.
    Bsdf,
}

/// How the last vertex chose the direction of the ray.
#[derive(Clone, Copy, PartialEq)]
enum Chosen {
    /// As one of no other: by the camera, a mirror, or glass.
    Only,
    /// With this density.
    Density(f32),
}

/// Collisions inside media that every path may have before Russian roulette.
const SURE_COLLISIONS: u32 = 4;
/// Collisions at most: they are not counted as bounces, and where nothing is absorbed a path might stay for ever.
const MOST_COLLISIONS: u32 = 1 << 14;

impl Path {
    /// A path tracer of so many bounces.
    pub fn new(max_depth: u32) -> Self {
        Self { max_depth, regularize: false, strategy: Strategy::Both, sure_bounces: 1 }
    }

    /// The weight of light that a ray found by itself, against a sample of the light with this density.
    fn weight_of_found(&self, chosen: Chosen, light_pdf: f32) -> f32 {
        match (chosen, self.strategy) {
            (Chosen::Only, _) | (_, Strategy::Bsdf) => 1.0,
            (Chosen::Density(_), Strategy::Lights) => {
                if light_pdf > 0.0 {
                    0.0
                } else {
                    1.0
                }
            }
            (Chosen::Density(pdf), Strategy::Both) => power_heuristic(pdf, light_pdf),
        }
    }

    /// The weight of a light's sample, against the BSDF's choice of the same direction.
    fn weight_of_sampled(&self, light_pdf: f32, bsdf_pdf: f32) -> f32 {
        match self.strategy {
            Strategy::Both => power_heuristic(light_pdf, bsdf_pdf),
            Strategy::Lights => 1.0,
            Strategy::Bsdf => 0.0,
        }
    }
}

impl Integrator for Path {
    fn radiance(
        &self,
        scene: &Scene,
        _: &View,
        sight: Sight<'_>,
        draw: &Draw,
        rays: &mut RayCounts,
    ) -> Spectrum {
        let mut radiance = Spectrum::BLACK;
        let mut throughput = Spectrum::WHITE;
        // What refraction did to the throughput alone: it comes back when the path leaves again.
        let mut eta_scale = 1.0;
        let mut chosen = Chosen::Only;
        let mut has_scattered = false;
        let (mut ray, mut met): (Ray, _) = (sight.ray.ray, sight.met);
        // Where the last vertex sampled lights from.
        let mut lit_from = ray.origin;
        let mut depth = 0;
        let mut interiors = Interiors::default();
        let (mut flights, mut collisions) = (0, 0);
        loop {
            let Some(here) = &met else {
                for (arriving, pdf) in scene.escaped(&ray) {
                    radiance += throughput * arriving * self.weight_of_found(chosen, pdf);
                }
                return radiance;
            };
            interiors.arrive(here, here.resolved());
            let way = ray_length(&ray, here);
            match interiors.medium() {
                None => throughput *= interiors.transmittance(way),
                Some(medium) => match medium.fly(throughput, way, draw.flight(flights)) {
                    Flight::Through(weight) => {
                        throughput *= weight;
                        flights += 1;
                    }
                    Flight::Collision { distance, weight } => {
                        throughput *= weight;
                        let likely = (throughput * eta_scale).max_component();
                        if collisions >= MOST_COLLISIONS || likely <= 0.0 {
                            return radiance;
                        }
                        if likely < 1.0 && collisions >= SURE_COLLISIONS {
                            if draw.survives_collision(flights) >= likely {
                                return radiance;
                            }
                            throughput *= 1.0 / likely;
                        }
                        let u = draw.scattered(flights);
                        let along = ray.direction.as_vec3();
                        let (along, _) = sample_henyey_greenstein(along, medium.asymmetry, u);
                        let start = ray.origin + distance * ray.direction;
                        ray = Ray::new(start, along.as_dvec3().normalize()).at_time(ray.time);
                        // Lights are behind a surface that bends what comes from them: paths find them.
                        chosen = Chosen::Only;
                        has_scattered = true;
                        flights += 1;
                        collisions += 1;
                        rays.bounce += 1;
                        let footprint = here.footprint();
                        met = scene.closest(&ray).map(|hit| scene.interaction(&ray, &hit, &footprint));
                        continue;
                    }
                },
            }
            let emitted = here.emitted();
            if !emitted.is_black() {
                let pdf = if chosen == Chosen::Only { 0.0 } else { scene.light_pdf(lit_from, here) };
                radiance += throughput * emitted * self.weight_of_found(chosen, pdf);
            }
            if depth == self.max_depth {
                return radiance;
            }
            let Some(mut vertex) = Vertex::new(scene, here, &interiors) else { return radiance };
            if self.regularize && has_scattered {
                vertex.bsdf = vertex.bsdf.regularized();
            }

            lit_from = here.lit_from();
            if !vertex.bsdf.is_delta() {
                let light =
                    scene.sample_light(lit_from, ray.time, draw.light_choice(depth), draw.light_point(depth));
                if let Some(light) = light {
                    let weigh = |light_pdf, bsdf_pdf| self.weight_of_sampled(light_pdf, bsdf_pdf);
                    radiance +=
                        throughput * vertex.scattered(&light, &interiors, self.regularize, weigh, rays);
                }
            }

            let Some(bounce) = vertex.sample(draw.lobe(depth), draw.direction(depth)) else {
                return radiance;
            };
            throughput *= bounce.weight;
            if throughput.is_black() {
                return radiance;
            }
            chosen = match bounce.scatter {
                Scatter::Delta => Chosen::Only,
                Scatter::Density(pdf) => Chosen::Density(pdf),
            };
            has_scattered |= bounce.scatter != Scatter::Delta;
            if bounce.transmitted {
                eta_scale *= bounce.eta * bounce.eta;
                interiors.cross(vertex.material, here.front);
            }
            depth += 1;

            let likely = (throughput * eta_scale).max_component();
            if depth > self.sure_bounces && likely < 1.0 {
                if draw.survival(depth) >= likely {
                    return radiance;
                }
                throughput *= 1.0 / likely;
            }

            ray = vertex.leave(&bounce);
            lit_from = vertex.risen_towards(bounce.direction).unwrap_or(lit_from);
            let footprint = here.footprint();
            rays.bounce += 1;
            met = scene.closest(&ray).map(|hit| scene.interaction(&ray, &hit, &footprint));
        }
    }
}

/// The way from a ray's origin to what it met; its direction is unit.
pub(crate) fn ray_length(ray: &Ray, here: &Interaction) -> f64 {
    (here.surface.point - ray.origin).length()
}
