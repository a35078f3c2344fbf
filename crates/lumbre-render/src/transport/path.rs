//! Path tracing with next-event estimation and multiple importance sampling.

use lumbre_geometry::Ray;
use lumbre_math::DVec3;
use lumbre_scene::{Interaction, Scene, View};
use lumbre_shading::medium::{DistanceSample, sample_henyey_greenstein};
use lumbre_shading::{HomogeneousMedium, Scatter, ShadingNormals, Spectrum};

use crate::transport::direct::{Vertex, power_heuristic};
use crate::transport::interior::Interiors;
use crate::transport::journal::{End, Event, Met, Scattered, Source};
use crate::transport::{Draw, Integrator, Record, Sight};

/// Kajiya's path tracing: at each surface one sample of a light and one of the BSDF, combined by the power heuristic,
/// and Russian roulette by throughput from the sixth bounce on.
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
    /// What is made of shading normals that are not those of the surface.
    pub shading_normals: ShadingNormals,
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

/// Bounces that every path may take before Russian roulette: fewer cost more error than they save time, in every scene that was
/// measured.
const SURE_BOUNCES: u32 = 5;
/// Collisions inside media that every path may have before Russian roulette.
const SURE_COLLISIONS: u32 = 4;
/// Collisions at most: they are not counted as bounces, and where nothing is absorbed a path might stay for ever.
const MOST_COLLISIONS: u32 = 1 << 14;

impl Path {
    /// A path tracer of so many bounces.
    pub fn new(max_depth: u32) -> Self {
        Self {
            max_depth,
            regularize: false,
            shading_normals: ShadingNormals::default(),
            strategy: Strategy::Both,
            sure_bounces: SURE_BOUNCES,
        }
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
        record: &mut Record,
    ) -> Spectrum {
        let mut walk = Walk::new(self, scene, sight.ray.ray, draw, record);
        let Some(mut here) = sight.met else { return walk.escaped() };
        loop {
            walk.interiors.arrive(&here, here.resolved());
            let (ray, depth, throughput) = (walk.ray, walk.depth, walk.throughput);
            walk.record.note(|| Event::Met(Met::of(&ray, &here, depth, throughput)));
            let next = match walk.cross_medium(&here) {
                Crossing::Through => walk.scatter_at_surface(&here),
                Crossing::Scattered(ray) => Some(ray),
                Crossing::Ended => None,
            };
            let Some(ray) = next else { return walk.radiance };
            walk.ray = ray;
            walk.record.counts.bounce += 1;
            let Some(hit) = scene.closest(&ray) else { return walk.escaped() };
            here = scene.interaction(&ray, &hit, &here.footprint());
        }
    }
}

/// A path on its way, and the light that it has found.
struct Walk<'s, 'w> {
    path: &'w Path,
    scene: &'s Scene,
    draw: &'w Draw,
    record: &'w mut Record,
    radiance: Spectrum,
    throughput: Spectrum,
    /// What refraction did to the throughput alone: it comes back when the path leaves again.
    eta_scale: f32,
    chosen: Chosen,
    has_scattered: bool,
    ray: Ray,
    /// Where the last vertex sampled lights from.
    shadow_origin: DVec3,
    /// See [`Vertex::lit_side`].
    lit_side: DVec3,
    /// Bounces off surfaces.
    depth: u32,
    interiors: Interiors<'s>,
    /// Media crossed or scattered in: each takes random numbers of its own.
    distance_samples: u32,
    collisions: u32,
}

/// How a path comes through the medium before a surface.
enum Crossing {
    /// It reaches the surface.
    Through,
    /// It goes on along this ray, from a collision.
    Scattered(Ray),
    /// It ends at a collision.
    Ended,
}

impl<'s, 'w> Walk<'s, 'w> {
    fn new(path: &'w Path, scene: &'s Scene, ray: Ray, draw: &'w Draw, record: &'w mut Record) -> Self {
        Self {
            path,
            scene,
            draw,
            record,
            radiance: Spectrum::BLACK,
            throughput: Spectrum::WHITE,
            eta_scale: 1.0,
            chosen: Chosen::Only,
            has_scattered: false,
            ray,
            shadow_origin: ray.origin,
            lit_side: DVec3::ZERO,
            depth: 0,
            interiors: Interiors::default(),
            distance_samples: 0,
            collisions: 0,
        }
    }

    /// The light of the whole path, with that at infinity that its last ray found, which left the scene.
    fn escaped(mut self) -> Spectrum {
        let ray = self.ray;
        self.record.note(|| Event::Left { ray });
        for (arriving, pdf) in self.scene.escaped(&ray, self.lit_side) {
            self.add(Source::Infinity, arriving, self.path.weight_of_found(self.chosen, pdf));
        }
        self.radiance
    }

    /// Adds light that arrives, with a weight.
    fn add(&mut self, source: Source, arriving: Spectrum, weight: f32) {
        self.radiance += self.record.added(source, self.throughput, arriving, weight);
    }

    /// Ends the path.
    fn end<T>(&mut self, why: End) -> Option<T> {
        self.record.note(|| Event::Ended(why));
        None
    }

    /// Adds the light of the surface that was found.
    fn add_emitted(&mut self, here: &Interaction<'s>) {
        let emitted = here.emitted();
        if !emitted.is_black() {
            let pdf = if self.chosen == Chosen::Only {
                0.0
            } else {
                self.scene.light_pdf(self.shadow_origin, self.lit_side, here)
            };
            self.add(Source::Surface, emitted, self.path.weight_of_found(self.chosen, pdf));
        }
    }

    /// Adds one sample of the lights.
    fn add_sampled_light(&mut self, vertex: &Vertex<'_, 's>) {
        let (draw, depth) = (self.draw, self.depth);
        let sample = match self.path.strategy {
            Strategy::Lights => Scene::sample_light_alone,
            Strategy::Both | Strategy::Bsdf => Scene::sample_light,
        };
        let light = sample(
            self.scene,
            self.shadow_origin,
            self.lit_side,
            self.ray.time,
            draw.light_choice(depth),
            draw.light_point(depth),
        );
        if let Some(light) = light {
            let path = self.path;
            let weigh = |light_pdf, bsdf_pdf| path.weight_of_sampled(light_pdf, bsdf_pdf);
            let scattered = vertex.scattered(&light, &self.interiors, path.regularize, weigh, self.record);
            self.add(Source::Sampled, scattered, 1.0);
        }
    }

    /// Goes through the medium before a surface, or scatters in it.
    fn cross_medium(&mut self, here: &Interaction<'s>) -> Crossing {
        let way = ray_length(&self.ray, here);
        let Some(medium) = self.interiors.medium() else {
            self.throughput *= self.interiors.transmittance(way);
            return Crossing::Through;
        };
        match medium.sample_distance(self.throughput, way, self.draw.distance(self.distance_samples)) {
            DistanceSample::Through(weight) => {
                self.throughput *= weight;
                self.distance_samples += 1;
                let throughput = self.throughput;
                self.record.note(|| Event::Medium { distance: way, scattered: false, throughput });
                Crossing::Through
            }
            DistanceSample::Collision { distance, weight } => {
                self.throughput *= weight;
                let throughput = self.throughput;
                self.record.note(|| Event::Medium { distance, scattered: true, throughput });
                match self.collide(&medium, distance) {
                    Some(ray) => Crossing::Scattered(ray),
                    None => Crossing::Ended,
                }
            }
        }
    }

    /// The ray that leaves a collision in a medium; `None` where the path ends.
    fn collide(&mut self, medium: &HomogeneousMedium, distance: f64) -> Option<Ray> {
        let likely = (self.throughput * self.eta_scale).max_component();
        if self.collisions >= MOST_COLLISIONS || likely <= 0.0 {
            return self.end(End::Medium);
        }
        if likely < 1.0 && self.collisions >= SURE_COLLISIONS {
            let survives = self.draw.survives_collision(self.distance_samples) < likely;
            self.record.note(|| Event::Roulette { probability: likely, survives });
            if !survives {
                return self.end(End::Roulette);
            }
            self.throughput *= 1.0 / likely;
        }
        let along = self.ray.direction.as_vec3();
        let u = self.draw.scattered(self.distance_samples);
        let (along, _) = sample_henyey_greenstein(along, medium.asymmetry, u);
        let start = self.ray.origin + distance * self.ray.direction;
        // Lights are behind a surface that bends what comes from them: paths find them.
        self.chosen = Chosen::Only;
        self.has_scattered = true;
        self.distance_samples += 1;
        self.collisions += 1;
        Some(Ray::new(start, along.as_dvec3().normalize()).at_time(self.ray.time))
    }

    /// Gathers the light of a surface and at it, and gives the ray that leaves it; `None` where the path ends.
    fn scatter_at_surface(&mut self, here: &Interaction<'s>) -> Option<Ray> {
        self.add_emitted(here);
        if self.depth == self.path.max_depth {
            return self.end(End::Depth);
        }
        let vertex = Vertex::new(self.scene, here, &self.interiors, self.path.shading_normals);
        let Some(mut vertex) = vertex else { return self.end(End::Nothing) };
        if self.path.regularize && self.has_scattered {
            vertex.bsdf = vertex.bsdf.regularized();
        }
        self.shadow_origin = here.shadow_origin();
        self.lit_side = vertex.lit_side();
        if !vertex.bsdf.is_delta() {
            self.add_sampled_light(&vertex);
        }

        let lobe = if vertex.bsdf.has_lobes() { self.draw.lobe(self.depth) } else { 0.0 };
        let bounce = vertex.sample(lobe, self.draw.direction(self.depth));
        let Some(bounce) = bounce else { return self.end(End::Absorbed) };
        self.throughput *= bounce.weight;
        if self.throughput.is_black() {
            return self.end(End::Absorbed);
        }
        self.chosen = match bounce.scatter {
            Scatter::Delta => Chosen::Only,
            Scatter::Density(pdf) => Chosen::Density(pdf),
        };
        self.has_scattered |= bounce.scatter != Scatter::Delta;
        if bounce.transmitted {
            self.eta_scale *= bounce.eta * bounce.eta;
        }
        if bounce.crosses {
            self.interiors.cross(vertex.material, here.front);
        }
        self.depth += 1;
        if !self.survives() {
            return self.end(End::Roulette);
        }
        self.shadow_origin = vertex.risen_towards(bounce.direction).unwrap_or(self.shadow_origin);
        let (ray, throughput) = (vertex.leave(&bounce), self.throughput);
        self.record.note(|| Event::Scattered(Scattered::of(&ray, &bounce, throughput)));
        Some(ray)
    }

    /// Russian roulette after a bounce.
    fn survives(&mut self) -> bool {
        let likely = (self.throughput * self.eta_scale).max_component();
        if self.depth > self.path.sure_bounces && likely < 1.0 {
            let survives = self.draw.survival(self.depth) < likely;
            self.record.note(|| Event::Roulette { probability: likely, survives });
            if !survives {
                return false;
            }
            self.throughput *= 1.0 / likely;
        }
        true
    }
}

/// The way from a ray's origin to what it met; its direction is unit.
pub(super) fn ray_length(ray: &Ray, here: &Interaction) -> f64 {
    (here.surface.point - ray.origin).length()
}
