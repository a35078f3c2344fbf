//! Direct light, perfect reflection and perfect refraction.

use lumbre_scene::{Interaction, Light, LightId, LightSample, Scene};
use lumbre_shading::{Scatter, ShadingNormals, Spectrum};
use smallvec::SmallVec;

use crate::integrators::Integrator;
use crate::transport::direct::Vertex;
use crate::transport::interior::MediumStack;
use crate::transport::journal::{Event, Met, SampledLight, Scattered, Source};
use crate::transport::through::ray_length;
use crate::transport::{Record, SampleNumbers, Sampler};
use crate::wave::PrimaryHits;
use crate::wave::paths::rounded;
use crate::wave::trees::{Branch, TreeIntegrator, TreeVertex};

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

/// The scattering materials at a point, with their shares.
type Scatterers<'a, 's> = SmallVec<[(f32, Vertex<'a, 's>); 2]>;

impl Whitted {
    /// A Whitted tracer that follows this many reflections, with one point on each light.
    pub fn new(max_depth: u32) -> Self {
        Self { max_depth, light_samples: 1, sky: false, shading_normals: ShadingNormals::default() }
    }

    /// The scattering materials at a vertex. Adds the rays of its mirrors and its glass to the tree.
    fn split<'a, 's>(
        &self,
        scene: &'s Scene,
        here: &'a Interaction<'s>,
        came: &'a Branch<'s>,
        numbers: &SampleNumbers,
        to: &mut TreeVertex<'_, 's>,
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
                    interiors.cross(vertex.solid(), here.front);
                }
                let ray = rounded(vertex.leave(&part));
                record.note(|| Event::Scattered(Scattered::of(&ray, &part, throughput)));
                let (footprint, depth) = (here.footprint(), came.depth + 1);
                to.follow(Branch { ray, footprint, interiors, throughput, depth, vertex: 0 });
            }
            if !vertex.bsdf.is_delta() {
                scatterers.push((share, vertex));
            }
        }
        scatterers
    }

    /// Samples the lights at a vertex: all of them, or one of many.
    fn sample_lights<'s>(
        &self,
        scene: &'s Scene,
        here: &Interaction<'s>,
        came: &Branch<'s>,
        numbers: &SampleNumbers,
        mut sampled: impl FnMut(LightSample, f32),
    ) {
        let from = here.shadow_origin();
        let lights = scene.lights();
        let mut sample = |id: LightId, light: &Light, label: u32, weight: f32| {
            if light.is_infinite() && !self.sky {
                return;
            }
            let points = if light.is_delta() { 1 } else { self.light_samples.max(1) };
            for point in 0..points {
                let u = numbers.point_on_each_light(came.vertex, label, point, points);
                if let Some(sample) = scene.sample_one_light(id, from, here.time, u) {
                    sampled(sample, weight / points as f32);
                }
            }
        };
        if lights.len() > EVERY_LIGHT_UP_TO {
            if let Some((id, probability)) = scene.choose_light(numbers.light_choice(came.vertex)) {
                sample(id, &lights[id.0 as usize], 0, (1.0 / probability) as f32);
            }
            return;
        }
        for (i, light) in (0..).zip(lights) {
            sample(LightId(i), light, i, 1.0);
        }
    }
}

impl Integrator for Whitted {
    fn estimate(&self, primary_hits: &mut PrimaryHits<'_, '_>, _: &Sampler, record: &mut Record) {
        primary_hits.follow_trees(self, record);
    }
}

impl TreeIntegrator for Whitted {
    fn shade<'s>(
        &self,
        scene: &'s Scene,
        mut came: Branch<'s>,
        met: Option<&Interaction<'s>>,
        numbers: &SampleNumbers,
        vertex: &mut TreeVertex<'_, 's>,
        record: &mut Record,
    ) {
        let Some(here) = met else {
            let arriving: Spectrum = scene.background(&came.ray).sum();
            record.note(|| Event::Left { ray: came.ray });
            return vertex.add(record.added(Source::Infinity, came.throughput, arriving, 1.0));
        };
        // In a mixture, one material chosen at random says which solid the ray was inside of.
        came.interiors.arrive(here, here.resolved());
        came.throughput *= came.interiors.transmittance(ray_length(&came.ray, here));
        record.note(|| Event::Met(Met::of(&came.ray, here, came.depth, came.throughput)));
        vertex.add(record.added(Source::Surface, came.throughput, here.emitted(), 1.0));
        if came.depth >= self.max_depth {
            return;
        }
        let scatterers = self.split(scene, here, &came, numbers, vertex, record);
        if scatterers.is_empty() {
            return;
        }
        vertex.begin_direct(Source::Direct, came.throughput);
        self.sample_lights(scene, here, &came, numbers, |sample, weight| {
            add_light(scene, &scatterers, &came.interiors, sample, weight, vertex, record);
        });
    }
}

/// Adds the weighted light of a sample that all materials of a vertex scatter.
fn add_light<'s>(
    scene: &Scene,
    scatterers: &Scatterers<'_, 's>,
    interiors: &MediumStack<'s>,
    sample: LightSample,
    weight: f32,
    to: &mut TreeVertex<'_, 's>,
    record: &mut Record,
) {
    let sample = to.reachable(sample);
    let mut sum = Spectrum::BLACK;
    let mut shadow_ray = None;
    // Through panes light goes straight on, of any light, since nothing else finds light behind a pane. That is known
    // at once; otherwise a shadow ray tells.
    let goes_straight_on = scene.has_delta_transmission();
    for (share, vertex) in scatterers {
        let scattered = vertex.eval(sample.towards) * *share;
        if scattered.is_black() {
            continue;
        }
        if goes_straight_on {
            sum += scattered * vertex.passes_straight_on(&sample, interiors, false, record);
        } else {
            sum += scattered * vertex.passes(&sample, interiors);
            shadow_ray.get_or_insert_with(|| vertex.shadow_ray(&sample));
        }
    }
    let mut light = sum * sample.radiance * weight;
    if let Scatter::Density(pdf) = sample.scatter {
        light = light / pdf;
    }
    let is_black = light.is_black();
    let segment = shadow_ray.filter(|_| !is_black).map(|ray| to.add_along(&ray, light));
    if segment.is_none() {
        to.add_unoccluded(light);
    }
    to.note(record, segment, move |is_occluded| {
        let passes = if is_occluded || is_black { Spectrum::BLACK } else { Spectrum::WHITE };
        let (scattered, bsdf_pdf, weight) = (sum, 0.0, 1.0);
        Event::Sampled(Box::new(SampledLight { sample, scattered, bsdf_pdf, weight, shadow_ray, passes }))
    });
}
