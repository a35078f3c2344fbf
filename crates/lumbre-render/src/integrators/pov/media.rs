//! Media along a ray: the light that they give, scatter and take.

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Elementary};
use lumbre_scene::pov::PovLight;
use lumbre_shading::Spectrum;
use lumbre_shading::pov::{Media, PovMaterial};
use smallvec::SmallVec;

use super::{Traced, Tracer};
use crate::transport::Record;

/// Media are followed so far.
const FAR: f64 = 1e7;
/// Places at which a medium that varies is evaluated, at least.
const MIN_SAMPLES: u32 = 30;
/// Less light than this is not followed further.
const FAINT: f32 = 1e-3;

impl<'s> Tracer<'s> {
    /// The media that a ray is in, inside of hollow solids or in the air.
    fn media_around(&self, inside: &[&'s PovMaterial]) -> SmallVec<[&'s Media; 4]> {
        let in_solids = inside.iter().flat_map(|solid| &solid.interior.media);
        in_solids.chain(&self.world.air).collect()
    }

    /// Light from behind, through the media along a ray, with what they add.
    pub(super) fn through_media(
        &self,
        traced: &Traced<'s>,
        direction: DVec3,
        length: f64,
        behind: Spectrum,
        record: &mut Record,
    ) -> Spectrum {
        let media = self.media_around(&traced.inside);
        if media.is_empty() {
            return behind;
        }
        let length = length.min(FAR);
        let origin = traced.ray.origin;
        let is_lit = media.iter().any(|media| media.scattering.is_some());
        if !is_lit && media.iter().all(|media| media.is_uniform()) {
            let (mut extinction, mut emission) = (Spectrum::BLACK, Spectrum::BLACK);
            for media in &media {
                let density = media.density(origin);
                extinction += media.extinction() * density;
                emission += media.emission * density;
            }
            let left = beer(extinction, length as f32);
            return behind * left + emission * mean_transmittance(extinction, length as f32) * length as f32;
        }
        let asked = media.iter().map(|media| media.samples).max().unwrap_or(1);
        let samples = asked.max(MIN_SAMPLES);
        let length = self.seen_length(&media, origin, length);
        let step = length / f64::from(samples);
        let (mut left, mut sum) = (Spectrum::WHITE, Spectrum::BLACK);
        for i in 0..samples {
            let p = origin + direction * ((f64::from(i) + 0.5) * step);
            let (mut extinction, mut added) = (Spectrum::BLACK, Spectrum::BLACK);
            for media in &media {
                let density = media.density(p);
                if density.is_black() {
                    continue;
                }
                extinction += media.extinction() * density;
                added += media.emission * density;
                if let Some(scattering) = &media.scattering {
                    let light =
                        self.light_at(p, traced, direction, record, &|cosine| scattering.phase.at(cosine));
                    added += scattering.colour * density * light;
                }
            }
            // Within a step the density is taken for constant.
            sum += left * added * mean_transmittance(extinction, step as f32) * step as f32;
            left *= beer(extinction, step as f32);
            if left.max_component() < FAINT {
                return sum;
            }
        }
        behind * left + sum
    }

    /// How far media can be seen into: where they are the same everywhere, until next to nothing comes through.
    fn seen_length(&self, media: &[&Media], origin: DVec3, length: f64) -> f64 {
        if !media.iter().all(|media| media.is_uniform()) {
            return length;
        }
        let extinction =
            media.iter().map(|media| media.extinction() * media.density(origin)).sum::<Spectrum>();
        let least = extinction.r.min(extinction.g).min(extinction.b);
        if least > 0.0 { length.min(f64::from(-FAINT.logarithm() / least)) } else { length }
    }

    /// The light of all lights at a point in a medium, by its share towards a ray.
    fn light_at(
        &self,
        p: DVec3,
        traced: &Traced<'s>,
        direction: DVec3,
        record: &mut Record,
        phase: &dyn Fn(f32) -> f32,
    ) -> Spectrum {
        let mut sum = Spectrum::BLACK;
        for light in self.lights.iter().filter(|light| light.media_interaction && light.group.is_none()) {
            let arriving = light.arriving(p, light.from);
            let Some((towards, distance)) = light.towards(p, light.from) else { continue };
            if arriving.is_black() {
                continue;
            }
            let passes = if light.shadowless {
                Spectrum::WHITE
            } else {
                let target = p + towards * distance;
                self.between(Ray::new(p, towards), target, traced.inside.clone(), light, record)
            };
            sum += arriving * passes * phase(towards.dot(direction) as f32);
        }
        sum
    }

    /// What media leave of the light of a light along a part of its way.
    pub(super) fn media_passing(
        &self,
        inside: &[&'s PovMaterial],
        ray: &Ray,
        length: f64,
        light: &PovLight,
    ) -> Spectrum {
        let hollow = inside.iter().filter(|solid| solid.hollow).flat_map(|solid| &solid.interior.media);
        let is_clear = inside.iter().all(|solid| solid.hollow);
        let air = self.world.air.iter().filter(|_| light.media_attenuation && is_clear);
        let mut left = Spectrum::WHITE;
        for media in hollow.chain(air) {
            left *= transmittance(media, ray.origin, ray.direction, length.clamp(0.0, FAR));
        }
        if light.media_attenuation && is_clear {
            for fog in &self.world.fogs {
                left *= fog.transmittance(ray.origin, ray.direction, length.max(0.0));
            }
        }
        left
    }
}

/// What a medium leaves of light along a way of a length in a unit direction.
fn transmittance(media: &Media, origin: DVec3, direction: DVec3, length: f64) -> Spectrum {
    let extinction = media.extinction();
    if extinction.is_black() {
        return Spectrum::WHITE;
    }
    let samples = if media.is_uniform() { 1 } else { media.samples };
    let step = length / f64::from(samples);
    let mut depth = Spectrum::BLACK;
    for i in 0..samples {
        depth += media.density(origin + direction * ((f64::from(i) + 0.5) * step)) * step as f32;
    }
    beer(extinction * depth, 1.0)
}

/// exp(−σ length).
fn beer(extinction: Spectrum, length: f32) -> Spectrum {
    extinction.map(|s| (-s * length).exponential())
}

/// The mean of exp(−σ t) over t from 0 to a length.
fn mean_transmittance(extinction: Spectrum, length: f32) -> Spectrum {
    extinction.map(|s| {
        let depth = s * length;
        if depth.abs() < 1e-3 { 1.0 - 0.5 * depth } else { (1.0 - (-depth).exponential()) / depth }
    })
}
