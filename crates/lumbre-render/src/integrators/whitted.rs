//! Direct light, perfect reflection and perfect refraction.

use lumbre_geometry::Ray;
use lumbre_scene::{Footprint, Interaction, Light, LightId, LightSample, Scene, View};
use lumbre_shading::{Scatter, ShadingNormals, Spectrum};
use smallvec::SmallVec;

use crate::integrators::RayIntegrator;
use crate::transport::direct::Vertex;
use crate::transport::interior::MediumStack;
use crate::transport::journal::{Event, Met, SampledLight, Scattered, Source};
use crate::transport::through::ray_length;
use crate::transport::{PrimaryHit, Record, SampleNumbers};

/// Follows every mirror image and every refraction, and gives each surface on the way direct light from every light.
///
/// Whitted, "An Improved Illumination Model for Shaded Display", CACM 23(6), 1980. A mixture counts with all of its
/// materials at once. A branch that carries too little light to be visible ends by Russian roulette, so that the
/// picture is unbiased. Direct light passes straight through smooth panes without thickness; rough or refracting
/// surfaces cast a shadow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Whitted {
    /// Maximum number of successive reflections and refractions.
    pub max_depth: u32,
    /// Points on each area light, at least 1; the points of all samples of a pixel are stratified together.
    pub light_samples: u32,
    /// Whether lights at infinity light surfaces. Without it they are background: mirrors and escaping rays show them.
    pub sky: bool,
    /// The treatment of shading normals that differ from the geometric ones.
    pub shading_normals: ShadingNormals,
}

/// With more lights than this, one is chosen by power.
const EVERY_LIGHT_UP_TO: usize = 64;
/// A branch that carries less than this plays Russian roulette.
const FAINT: f32 = 1.0 / 255.0;

/// A pending ray.
struct Branch<'s> {
    ray: Ray,
    interiors: MediumStack<'s>,
    footprint: Footprint,
    throughput: Spectrum,
    depth: u32,
}

/// The scattering materials at a point, with their shares.
type Scatterers<'a, 's> = SmallVec<[(f32, Vertex<'a, 's>); 2]>;

impl Whitted {
    /// A Whitted tracer that follows this many reflections, with one point on each light.
    pub fn new(max_depth: u32) -> Self {
        Self { max_depth, light_samples: 1, sky: false, shading_normals: ShadingNormals::default() }
    }

    /// The scattering materials at a vertex of the tree of rays; mirrors and glass go to `pending`.
    fn split<'a, 's>(
        &self,
        scene: &'s Scene,
        here: &'a Interaction<'s>,
        came: &'a Arrival<'s>,
        numbers: &SampleNumbers,
        pending: &mut SmallVec<[Branch<'s>; 4]>,
        record: &mut Record,
    ) -> Scatterers<'a, 's> {
        let mut scatterers = Scatterers::new();
        let mut branches = 0;
        let least = FAINT / came.throughput.max_component();
        let parts = Vertex::parts(scene, here, least, &came.interiors, self.shading_normals);
        for (share, vertex) in parts {
            for part in vertex.specular() {
                let branch = branches;
                branches += 1;
                let mut throughput = came.throughput * part.weight * share;
                let carries = throughput.max_component();
                if carries < FAINT {
                    if numbers.branch(came.vertex, branch) * FAINT >= carries {
                        continue;
                    }
                    throughput *= FAINT / carries;
                }
                let mut interiors = came.interiors.clone();
                if part.crosses {
                    interiors.cross(vertex.material, here.front);
                }
                let ray = vertex.leave(&part);
                record.note(|| Event::Scattered(Scattered::of(&ray, &part, throughput)));
                pending.push(Branch {
                    ray,
                    interiors,
                    footprint: here.footprint(),
                    throughput,
                    depth: came.depth + 1,
                });
            }
            if !vertex.bsdf.is_delta() {
                scatterers.push((share, vertex));
            }
        }
        scatterers
    }

    /// Direct light on all scattering materials at a point.
    fn direct<'s>(
        &self,
        scene: &Scene,
        here: &Interaction,
        scatterers: &Scatterers<'_, 's>,
        came: &Arrival<'s>,
        numbers: &SampleNumbers,
        record: &mut Record,
    ) -> Spectrum {
        let from = here.shadow_origin();
        let lights = scene.lights();
        let by_light = |record: &mut Record, id: LightId, light: &Light, label: u32| {
            if light.is_infinite() && !self.sky {
                return Spectrum::BLACK;
            }
            let points = if light.is_delta() { 1 } else { self.light_samples.max(1) };
            let mut sum = Spectrum::BLACK;
            for point in 0..points {
                let u = numbers.point_on_each_light(came.vertex, label, point, points);
                if let Some(sample) = scene.sample_one_light(id, from, here.time, u) {
                    sum += scattered(scene, scatterers, &came.interiors, &sample, record);
                }
            }
            sum * (1.0 / points as f32)
        };
        if lights.len() > EVERY_LIGHT_UP_TO {
            let choice = scene.choose_light(numbers.light_choice(came.vertex));
            return choice.map_or(Spectrum::BLACK, |(id, probability)| {
                by_light(record, id, &lights[id.0 as usize], 0) * (1.0 / probability) as f32
            });
        }
        let mut sum = Spectrum::BLACK;
        for (i, light) in (0..).zip(lights) {
            sum += by_light(record, LightId(i), light, i);
        }
        sum
    }
}

/// The arrival at a vertex: the throughput, and the index of the vertex in the tree of rays.
struct Arrival<'s> {
    interiors: MediumStack<'s>,
    throughput: Spectrum,
    depth: u32,
    vertex: u32,
}

impl RayIntegrator for Whitted {
    fn radiance(
        &self,
        scene: &Scene,
        _: &View,
        primary_hit: PrimaryHit<'_>,
        numbers: &SampleNumbers,
        record: &mut Record,
    ) -> Spectrum {
        let mut radiance = Spectrum::BLACK;
        let mut pending: SmallVec<[Branch; 4]> = SmallVec::new();
        let (mut ray, mut met) = (primary_hit.ray.ray, primary_hit.met);
        let mut came =
            Arrival { interiors: MediumStack::default(), throughput: Spectrum::WHITE, depth: 0, vertex: 0 };
        loop {
            if let Some(here) = &met {
                // For a mixture, the chosen material says which medium the segment was in.
                came.interiors.arrive(here, here.resolved());
                came.throughput *= came.interiors.transmittance(ray_length(&ray, here));
                record.note(|| Event::Met(Met::of(&ray, here, came.depth, came.throughput)));
                radiance += record.added(Source::Surface, came.throughput, here.emitted(), 1.0);
                if came.depth < self.max_depth {
                    let scatterers = self.split(scene, here, &came, numbers, &mut pending, record);
                    if !scatterers.is_empty() {
                        let direct = self.direct(scene, here, &scatterers, &came, numbers, record);
                        radiance += record.added(Source::Direct, came.throughput, direct, 1.0);
                    }
                }
            } else {
                let arriving: Spectrum = scene.background(&ray).sum();
                record.note(|| Event::Left { ray });
                radiance += record.added(Source::Infinity, came.throughput, arriving, 1.0);
            }
            let Some(next) = pending.pop() else { return radiance };
            ray = next.ray;
            came = Arrival {
                interiors: next.interiors,
                throughput: next.throughput,
                depth: next.depth,
                vertex: came.vertex + 1,
            };
            record.counts.bounce += 1;
            met = scene.closest(&ray).map(|hit| scene.interaction(&ray, &hit, &next.footprint));
        }
    }
}

/// The light of a sample that all materials of a point scatter.
fn scattered<'s>(
    scene: &Scene,
    scatterers: &Scatterers<'_, 's>,
    interiors: &MediumStack<'s>,
    sample: &LightSample,
    record: &mut Record,
) -> Spectrum {
    let mut sum = Spectrum::BLACK;
    let mut shadow_ray = None;
    // Lights of any kind, since nothing else finds light behind a pane.
    let goes_straight_on = scene.has_delta_transmission();
    for (share, vertex) in scatterers {
        let scattered = vertex.eval(sample.towards) * *share;
        if scattered.is_black() {
            continue;
        }
        if goes_straight_on {
            sum += scattered * vertex.passes_straight_on(sample, interiors, false, record);
        } else {
            sum += scattered * vertex.passes(sample, interiors);
            shadow_ray.get_or_insert_with(|| vertex.shadow_ray(sample));
        }
    }
    let scattered = sum * sample.radiance;
    let is_occluded = shadow_ray.filter(|_| !scattered.is_black()).is_some_and(|shadow_ray| {
        record.counts.shadow += 1;
        scene.is_occluded(&shadow_ray)
    });
    record.note(|| {
        let passes = if is_occluded || scattered.is_black() { Spectrum::BLACK } else { Spectrum::WHITE };
        let sample = *sample;
        Event::Sampled(Box::new(SampledLight {
            sample,
            scattered: sum,
            bsdf_pdf: 0.0,
            weight: 1.0,
            shadow_ray,
            passes,
        }))
    });
    if scattered.is_black() || is_occluded {
        return Spectrum::BLACK;
    }
    match sample.scatter {
        Scatter::Delta => scattered,
        Scatter::Density(pdf) => scattered / pdf,
    }
}
