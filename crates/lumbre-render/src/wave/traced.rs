//! Journal of a vertex, from the numbers that lanes compute with.

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Vec3};
use lumbre_scene::LightSample;
use lumbre_scene::light::lanes::LaneLightSample;
use lumbre_shading::lanes::LaneSample;
use lumbre_shading::{Scatter, Spectrum};
use lumbre_simd::{Double, Mask, Real, V3};

use crate::transport::Record;
use crate::transport::journal::{End, Event, SampledLight, Scattered, Source};
use crate::wave::lights::first_sample;
use crate::wave::paths::{Departure, OnePath};
use crate::wave::shadows::Segment;

/// The events at the vertex of a wave of one path.
#[derive(Debug, Default)]
pub(crate) struct Traced {
    light: Option<TracedLight>,
    scattered: Option<TracedScatter>,
}

#[derive(Debug)]
struct TracedLight {
    sample: LightSample,
    /// f · |cos θ|.
    f: Spectrum,
    bsdf_pdf: f32,
    weight: f32,
    /// Towards the light, if light would come along it.
    shadow_ray: Option<Ray>,
}

#[derive(Debug)]
struct TracedScatter {
    /// Whether the BSDF scatters it.
    goes_on: bool,
    /// The survival probability, and whether the path survives, if Russian roulette applies.
    roulette: Option<(f32, bool)>,
    event: Scattered,
}

impl Traced {
    /// A sample of a light.
    #[inline(always)]
    pub(crate) fn light<R: Real>(
        &mut self,
        found: R::Mask,
        light: &LaneLightSample<R>,
        f: V3<R>,
        bsdf_pdf: R,
        weight: R,
        segment: &Segment<R>,
    ) {
        if light.valid.to_bitmask() & 1 == 0 {
            return;
        }
        let shadow_ray = Ray::new(first64::<R>(segment.origin), first64::<R>(segment.to_light))
            .with_range(0.0, segment.end.to_lanes()[0]);
        self.light = Some(TracedLight {
            sample: first_sample(light),
            f: colour(f),
            bsdf_pdf: bsdf_pdf.to_lanes()[0],
            weight: weight.to_lanes()[0],
            shadow_ray: (found.to_bitmask() & 1 == 1).then_some(shadow_ray),
        });
    }

    /// A sample of a light at a collision in a medium.
    pub(crate) fn collision_light(
        &mut self,
        sample: LightSample,
        f: Spectrum,
        bsdf_pdf: f32,
        weight: f32,
        shadow_ray: Option<Ray>,
    ) {
        self.light = Some(TracedLight { sample, f, bsdf_pdf, weight, shadow_ray });
    }

    /// The next direction after a collision.
    pub(crate) fn collision_scattered(&mut self, next: &OnePath, roulette: Option<(f32, bool)>) {
        let event = Scattered {
            ray: Ray::new(next.origin, next.direction.as_dvec3()),
            weight: Spectrum::WHITE,
            scatter: Scatter::Density(next.pdf),
            transmitted: false,
            eta: 1.0,
            throughput: next.throughput,
        };
        self.scattered = Some(TracedScatter { goes_on: true, roulette, event });
    }

    /// The next direction.
    #[inline(always)]
    pub(crate) fn scattered<R: Real>(
        &mut self,
        goes_on: R::Mask,
        plays_roulette: R::Mask,
        survives: R::Mask,
        survival: R,
        sample: &LaneSample<R>,
        path: &Departure<R>,
    ) {
        let is = |mask: R::Mask| mask.to_bitmask() & 1 == 1;
        let pdf = path.pdf.to_lanes()[0];
        self.scattered = Some(TracedScatter {
            goes_on: is(goes_on),
            roulette: is(plays_roulette).then(|| (survival.to_lanes()[0], is(survives))),
            event: Scattered {
                ray: Ray::new(first64::<R>(path.origin), first(path.direction).as_dvec3()),
                weight: colour(sample.weight),
                scatter: if pdf == f32::INFINITY { Scatter::Delta } else { Scatter::Density(pdf) },
                transmitted: is(sample.transmitted),
                eta: sample.eta.to_lanes()[0],
                throughput: colour(path.throughput),
            },
        });
    }

    /// Writes the events of a vertex, once the unoccluded share of its light sample is known.
    pub(crate) fn write(
        &mut self,
        throughput: Spectrum,
        time: f64,
        light: Spectrum,
        passes: Spectrum,
        record: &mut Record,
    ) {
        if let Some(traced) = self.light.take() {
            let TracedLight { sample, f, bsdf_pdf, weight, shadow_ray } = traced;
            let shadow_ray = shadow_ray.map(|ray| ray.at_time(time));
            let passes = if shadow_ray.is_some() { passes } else { Spectrum::BLACK };
            record.note(|| {
                Event::Sampled(Box::new(SampledLight {
                    sample,
                    scattered: f,
                    bsdf_pdf,
                    weight,
                    shadow_ray,
                    passes,
                }))
            });
            let weight_over_pdf = match sample.scatter {
                Scatter::Delta => weight,
                Scatter::Density(pdf) => weight / pdf,
            };
            let radiance = if passes.is_black() {
                Spectrum::BLACK
            } else {
                f * sample.radiance * weight_over_pdf * passes
            };
            let added = if passes.is_black() { Spectrum::BLACK } else { light * passes };
            record.note(|| Event::Added {
                source: Source::Sampled,
                radiance,
                weight: 1.0,
                throughput,
                added,
            });
        }
        let Some(scattered) = self.scattered.take() else { return };
        if !scattered.goes_on {
            return record.note(|| Event::Ended(End::Absorbed));
        }
        if let Some((probability, survives)) = scattered.roulette {
            record.note(|| Event::Roulette { probability, survives });
            if !survives {
                return record.note(|| Event::Ended(End::Roulette));
            }
        }
        let ray = scattered.event.ray.at_time(time);
        record.note(|| Event::Scattered(Box::new(Scattered { ray, ..scattered.event })));
    }
}

fn first<R: Real>(v: V3<R>) -> Vec3 {
    Vec3::new(v.x.to_lanes()[0], v.y.to_lanes()[0], v.z.to_lanes()[0])
}

fn colour<R: Real>(v: V3<R>) -> Spectrum {
    first(v).to_array().into()
}

fn first64<R: Real>(v: V3<R::Double>) -> DVec3 {
    DVec3::new(v.x.to_lanes()[0], v.y.to_lanes()[0], v.z.to_lanes()[0])
}
