//! Media between surfaces: how they attenuate, add to and scatter paths.

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Vec3};
use lumbre_scene::MediumId;
use lumbre_scene::light::{LightPoint, Sampling};
use lumbre_shading::medium::{DistanceSample, Way, henyey_greenstein, sample_henyey_greenstein};
use lumbre_shading::{Scatter, Spectrum};
use lumbre_simd::V3;

use crate::transport::journal::{End, Event, Source};
use crate::transport::through::goes_straight_on;
use crate::transport::{Record, Strategy};
use crate::wave::Wave;
use crate::wave::paths::{Collision, OnePath, SCATTERED, of_column, to_column};
use crate::wave::setting::{Setting, power_heuristic};
use crate::wave::shadows::{NEARLY_WHOLE, OneSegment, Pane};
use crate::wave::traced::Traced;
use crate::wave::vertices::Place;

impl<'s> Wave<'s> {
    /// Traces all paths through media to their next surface; records those that scatter or end before it.
    pub(super) fn cross_media(&mut self, setting: &Setting<'s>, record: &mut Record) {
        self.collisions.clear();
        self.stopped_in_medium.clear();
        if !setting.has_media {
            return;
        }
        for path in 0..self.paths.len {
            let slot = self.paths.slot[path] as usize;
            // Inside a solid, only the medium of its material counts.
            let is_inside = self.slots.interiors.get(slot).is_some_and(|solids| solids.attenuates());
            let arrives = is_inside || self.cross(setting, path, slot, record);
            self.stopped_in_medium.push(!arrives);
        }
    }

    /// Whether a path scatters or ends before what its ray meets.
    pub(super) fn is_stopped_in_medium(&self, path: usize) -> bool {
        self.stopped_in_medium.get(path).is_some_and(|&stopped| stopped)
    }

    /// Traces a path through media to what it meets; false if it scatters or ends before.
    fn cross(&mut self, setting: &Setting<'s>, path: usize, slot: usize, record: &mut Record) -> bool {
        let scene = setting.scene;
        let end = self.hits.distance_f64(path);
        let ray = self.paths.ray(path, self.slots.time[slot]).with_range(0.0, end);
        let mut boundaries = std::mem::take(&mut self.boundaries);
        boundaries.clear();
        scene.crossings(&ray, &mut boundaries);
        let mut at = 0.0;
        let mut arrives = true;
        let ends = boundaries.iter().map(|crossing| (crossing.t, crossing.beyond));
        for (end, beyond) in ends.chain([(end, None)]) {
            if let Some(medium) = of_column(self.slots.medium[slot]) {
                arrives = self.pass(setting, path, slot, medium, &ray, [at, end], record);
                if !arrives {
                    break;
                }
            }
            at = end;
            if end < ray.t_max {
                self.slots.medium[slot] = to_column(beyond);
            }
        }
        self.boundaries = boundaries;
        arrives
    }

    /// Traces a path through one medium along a part of its ray; false if it scatters or ends there.
    #[expect(clippy::too_many_arguments, reason = "the path, and its way")]
    fn pass(
        &mut self,
        setting: &Setting<'s>,
        path: usize,
        slot: usize,
        medium: MediumId,
        ray: &Ray,
        [start, end]: [f64; 2],
        record: &mut Record,
    ) -> bool {
        let way = Way { origin: ray.at(start), direction: ray.direction, length: end - start };
        let throughput = self.paths.throughput(path);
        let numbers = self.slots.numbers(slot).passage(self.slots.distance_samples[slot]);
        self.slots.distance_samples[slot] += 1;
        let wavelengths = self.slots.wavelengths.get(slot);
        let passage = setting.scene.medium(medium).sample(&way, throughput, numbers, wavelengths);
        let depth = self.paths.depth[path] & !SCATTERED;
        if !passage.emitted.is_black() && depth < setting.max_depth {
            self.slots.radiance[slot] += record.added(Source::Medium, throughput, passage.emitted, 1.0);
        }
        let (distance, weight, scattered) = match passage.outcome {
            DistanceSample::Through(weight) => (way.length, weight, false),
            DistanceSample::Collision { distance, weight } => (distance, weight, true),
        };
        let throughput = throughput * weight;
        self.paths.set_throughput(path, throughput);
        record.note(|| Event::Medium { distance, scattered, throughput });
        if throughput.is_black() {
            record.note(|| Event::Ended(End::Medium));
        } else if scattered && depth == setting.max_depth {
            record.note(|| Event::Ended(End::Depth));
        } else if scattered {
            let width = self.paths.width[path] + self.paths.spread[path] * (start + distance) as f32;
            let point = way.origin + distance * way.direction;
            self.collisions.push(Collision { path: path as u32, point, medium, width });
        }
        !scattered && !throughput.is_black()
    }

    /// Samples the lights and a new direction at each collision.
    pub(super) fn shade_collisions(
        &mut self,
        setting: &Setting<'s>,
        is_single: bool,
        mut traced: Option<&mut Traced>,
    ) {
        for i in 0..self.collisions.len() {
            let collision = self.collisions[i];
            self.light_collision(setting, is_single, &collision, traced.as_deref_mut());
            self.scatter_collision(setting, &collision, traced.as_deref_mut());
        }
    }

    fn light_collision(
        &mut self,
        setting: &Setting<'s>,
        is_single: bool,
        collision: &Collision,
        traced: Option<&mut Traced>,
    ) {
        let (scene, from) = (setting.scene, collision.point);
        let path = collision.path as usize;
        let slot = self.paths.slot[path] as usize;
        let (numbers, time) = (self.slots.numbers(slot), self.slots.time[slot]);
        let depth = self.paths.depth[path] & !SCATTERED;
        let (choose, u) = (numbers.light_choice(depth), numbers.light_point(depth));
        let sampling = match setting.strategy {
            Strategy::Lights => Sampling::LightsOnly,
            Strategy::Both | Strategy::Bsdf => Sampling::Mis,
        };
        let sample = scene.sample_light_for(sampling, from, DVec3::ZERO, time, choose, u);
        let Some((id, mut sample)) = sample else { return };
        if let Some(wavelengths) = self.slots.wavelengths.get(slot) {
            sample.radiance = scene.light_at_wavelengths(id, sample.radiance, wavelengths);
        }
        let cos = self.paths.direction(path).dot(sample.towards.as_vec3());
        let phase = henyey_greenstein(cos, scene.medium(collision.medium).asymmetry());
        let (weight, pdf) = match (sample.scatter, setting.strategy) {
            (Scatter::Delta, _) => (1.0, 1.0),
            (Scatter::Density(pdf), Strategy::Both) => (power_heuristic(pdf, phase), pdf),
            (Scatter::Density(pdf), Strategy::Lights) => (1.0, pdf),
            (Scatter::Density(_), Strategy::Bsdf) => (0.0, 1.0),
        };
        let contribution = self.paths.throughput(path) * sample.radiance * (phase * weight / pdf);
        let is_light = !contribution.is_black() && weight > 0.0;
        let (to_light, end) = match sample.end {
            None => (sample.towards, f64::INFINITY),
            Some(end) => (stop(setting, is_single, &end, sample.towards) - from, NEARLY_WHOLE),
        };
        if let Some(traced) = traced {
            let ray = is_light.then(|| Ray::new(from, to_light).with_range(0.0, end));
            traced.collision_light(sample, Spectrum::splat(phase), phase, weight, ray);
        }
        if !is_light {
            return;
        }
        if setting.has_panes && goes_straight_on(scene, &sample) {
            let around = self.slots.interiors.get(slot).cloned().unwrap_or_default();
            self.shadows.panes.push(Pane { segment: self.shadows.len as u32, sample, around });
        }
        self.shadows.push_one(&OneSegment {
            slot: slot as u32,
            origin: from,
            to_light,
            end,
            contribution,
            medium: collision.medium.0,
        });
    }

    fn scatter_collision(
        &mut self,
        setting: &Setting<'s>,
        collision: &Collision,
        traced: Option<&mut Traced>,
    ) {
        let path = collision.path as usize;
        let slot = self.paths.slot[path] as usize;
        let numbers = self.slots.numbers(slot);
        let vertex = self.paths.depth[path] & !SCATTERED;
        let asymmetry = setting.scene.medium(collision.medium).asymmetry();
        let incoming = self.paths.direction(path);
        let (along, pdf) = sample_henyey_greenstein(incoming, asymmetry, numbers.direction(vertex));
        let (mut throughput, eta_scale) = (self.paths.throughput(path), self.paths.eta_scale[path]);
        let depth = vertex + 1;
        let survival = throughput.max_component() * eta_scale;
        let plays_roulette = setting.roulette_start < depth && survival < 1.0;
        let survives = !plays_roulette || numbers.survival(vertex) < survival;
        if plays_roulette {
            throughput = throughput / survival;
        }
        let merge_pdf = setting.merging.as_ref().map_or(f32::INFINITY, |merging| {
            let radius = merging.radius_in_medium(self.slots.widths[slot], collision.width);
            pdf * merging.share_in_medium(merging.spread_in_medium(radius))
        });
        let next = OnePath {
            slot: slot as u32,
            origin: collision.point,
            // Light arrives from every side.
            receiver_normal: Vec3::ZERO,
            direction: along.normalize(),
            throughput,
            eta_scale,
            pdf,
            merge_pdf,
            depth: depth | SCATTERED,
            width: collision.width,
            spread: self.paths.spread[path],
        };
        if let Some(traced) = traced {
            traced.collision_scattered(&next, plays_roulette.then_some((survival, survives)));
        }
        if survives {
            self.next.push_one(&next);
        }
    }
}

/// The end of a segment to a point of a light.
fn stop(setting: &Setting<'_>, is_single: bool, end: &LightPoint, towards: DVec3) -> DVec3 {
    let vector = |v: DVec3| V3::new(v.x, v.y, v.z);
    let single = |v: DVec3| V3::new(v.x as f32, v.y as f32, v.z as f32);
    let error = setting.rounding(is_single).grow::<f32>(vector(end.point), vector(end.error));
    let V3 { x, y, z } =
        Place::<f32>::new(vector(end.point), error, single(end.normal)).start(single(-towards));
    DVec3::new(x, y, z)
}
