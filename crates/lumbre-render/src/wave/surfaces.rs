//! From hits to vertices: where paths are, what is in the way there, what shines, and how the surface scatters.

use lumbre_geometry::Ray;
use lumbre_scene::{Footprint, Interaction};
use lumbre_shading::medium::{DistanceSample, sample_henyey_greenstein};
use lumbre_shading::{HomogeneousMedium, ShadingNormals, Spectrum};

use crate::transport::Record;
use crate::transport::journal::{End, Event, Met, Source};
use crate::wave::paths::{OnePath, SCATTERED};
use crate::wave::vertices::{FOLDS, RISES, SIDED};
use crate::wave::{Setting, Wave};

/// Collisions inside media that every path may have before Russian roulette.
const ROULETTE_START_IN_MEDIA: u32 = 4;
/// Collisions at most: they are not counted as bounces, and where nothing is absorbed a path might stay for ever.
const MAX_COLLISIONS: u32 = 1 << 14;

impl<'s> Wave<'s> {
    /// Writes down the vertices of all paths that met something, and queues those that scatter.
    pub(super) fn surfaces(&mut self, setting: &Setting<'s>, record: &mut Record) {
        self.vertices.reset(self.paths.len, setting.has_solids);
        self.queue.clear();
        self.collided.clear();
        for path in 0..self.paths.len {
            let Some(hit) = &self.hits[path] else { continue };
            let slot = self.paths.slot[path] as usize;
            let camera = &self.slots.camera[slot];
            let ray = self.paths.ray(path, camera.ray.time);
            let footprint = match self.paths.width[path] {
                _ if self.is_first => camera.footprint,
                width if width > 0.0 => {
                    Footprint::Cone { width: width.into(), spread: self.paths.spread[path].into() }
                }
                _ => Footprint::Point,
            };
            let here = setting.scene.interaction(&ray, hit, &footprint);
            self.surface(setting, path, slot, &ray, &here, record);
        }
    }

    fn surface(
        &mut self,
        setting: &Setting<'s>,
        path: usize,
        slot: usize,
        ray: &Ray,
        here: &Interaction<'s>,
        record: &mut Record,
    ) {
        let material = here.resolved();
        let depth = self.paths.depth[path] & !SCATTERED;
        if setting.has_solids {
            self.slots.interiors[slot].arrive(here, material);
        }
        let throughput = self.paths.throughput(path);
        record.note(|| Event::Met(Met::of(ray, here, depth, throughput)));
        if setting.has_solids && !self.cross_medium(path, slot, ray, here, record) {
            return;
        }
        self.emission(setting, path, slot, ray, here, record);
        if depth == setting.max_depth {
            record.note(|| Event::Ended(End::Depth));
            return;
        }
        let towards = here.towards_origin.as_vec3();
        let scattering = material
            .and_then(|material| material.shading(&here.at, &here.shading, towards, setting.shading_normals));
        let (Some((frame, mut bsdf)), Some(material)) = (scattering, material) else {
            record.note(|| Event::Ended(End::Nothing));
            return;
        };
        if setting.has_solids && material.is_solid() {
            let outside = self.slots.interiors[slot].index_outside(material, here.front);
            if outside != 1.0 {
                bsdf = bsdf.immersed(outside);
            }
            self.vertices.solids[path] = Some((material, here.front));
        }
        if setting.regularize && self.paths.depth[path] & SCATTERED != 0 {
            bsdf = bsdf.regularized();
        }
        let mut flags = 0;
        if ShadingNormals::differ(frame.n, here.shading.geometric) {
            flags |= match setting.shading_normals {
                ShadingNormals::Lumbre => FOLDS,
                ShadingNormals::Pbrt => SIDED,
            };
        }
        if flags & FOLDS != 0
            && let Some(risen) = here.terminator_origin()
        {
            flags |= RISES;
            let (smooth, geometric) = (here.shading.normal, here.shading.geometric);
            let on_its_side = if here.front { geometric } else { -geometric };
            let smooth = if smooth.dot(on_its_side) < 0.0 { -smooth } else { smooth };
            self.vertices.put_risen(path, smooth, risen);
        }
        self.vertices.put_place(path, &here.surface, here.surface.point_error, here.towards_origin);
        self.vertices.put_bsdf(path, &frame, bsdf, flags);
        let (width, spread) = here.cone();
        self.vertices.width[path] = width as f32;
        self.vertices.spread[path] = spread as f32;
        self.queue.push(path as u32);
    }

    /// Adds the light of the surface that was found.
    fn emission(
        &mut self,
        setting: &Setting<'s>,
        path: usize,
        slot: usize,
        ray: &Ray,
        here: &Interaction<'s>,
        record: &mut Record,
    ) {
        let emitted = here.emitted();
        if emitted.is_black() {
            return;
        }
        let chosen = self.paths.pdf[path];
        let pdf = if chosen == f32::INFINITY { 0.0 } else { setting.scene.light_pdf(ray.origin, here) };
        let weight = setting.weight_of_found(chosen, pdf);
        let throughput = self.paths.throughput(path);
        self.slots.radiance[slot] += record.added(Source::Surface, throughput, emitted, weight);
    }

    /// Goes through the medium before a surface; false where the path scatters or ends in it.
    fn cross_medium(
        &mut self,
        path: usize,
        slot: usize,
        ray: &Ray,
        here: &Interaction<'s>,
        record: &mut Record,
    ) -> bool {
        let way = (here.surface.point - ray.origin).length();
        let throughput = self.paths.throughput(path);
        let interiors = &self.slots.interiors[slot];
        let Some(medium) = interiors.medium() else {
            if interiors.attenuates() {
                self.paths.set_throughput(path, throughput * interiors.transmittance(way));
            }
            return true;
        };
        let u = self.slots.draws[slot].distance(self.slots.distance_samples[slot]);
        match medium.sample_distance(throughput, way, u) {
            DistanceSample::Through(weight) => {
                let throughput = throughput * weight;
                self.slots.distance_samples[slot] += 1;
                self.paths.set_throughput(path, throughput);
                record.note(|| Event::Medium { distance: way, scattered: false, throughput });
                true
            }
            DistanceSample::Collision { distance, weight } => {
                let throughput = throughput * weight;
                record.note(|| Event::Medium { distance, scattered: true, throughput });
                self.collide(path, slot, ray, here, &medium, distance, throughput, record);
                false
            }
        }
    }

    /// Scatters a path at a collision in a medium, or ends it there.
    #[expect(clippy::too_many_arguments, reason = "what is known of the collision")]
    fn collide(
        &mut self,
        path: usize,
        slot: usize,
        ray: &Ray,
        here: &Interaction<'s>,
        medium: &HomogeneousMedium,
        distance: f64,
        mut throughput: Spectrum,
        record: &mut Record,
    ) {
        let eta_scale = self.paths.eta_scale[path];
        let likely = (throughput * eta_scale).max_component();
        let (draw, sample) = (self.slots.draws[slot], self.slots.distance_samples[slot]);
        if self.slots.collisions[slot] >= MAX_COLLISIONS || likely <= 0.0 {
            return record.note(|| Event::Ended(End::Medium));
        }
        if likely < 1.0 && self.slots.collisions[slot] >= ROULETTE_START_IN_MEDIA {
            let survives = draw.survives_collision(sample) < likely;
            record.note(|| Event::Roulette { probability: likely, survives });
            if !survives {
                return record.note(|| Event::Ended(End::Roulette));
            }
            throughput *= 1.0 / likely;
        }
        let u = draw.scattered(sample);
        let (along, _) = sample_henyey_greenstein(ray.direction.as_vec3(), medium.asymmetry, u);
        self.slots.distance_samples[slot] += 1;
        self.slots.collisions[slot] += 1;
        let (width, spread) = here.cone();
        self.collided.push(OnePath {
            slot: slot as u32,
            origin: ray.origin + distance * ray.direction,
            direction: along.normalize(),
            throughput,
            eta_scale,
            // Lights are behind a surface that bends what comes from them: paths find them.
            pdf: f32::INFINITY,
            depth: self.paths.depth[path] | SCATTERED,
            width: width as f32,
            spread: spread as f32,
        });
    }
}
