//! From hits to vertices: points, media on the way, emission, and BSDFs.

use lumbre_geometry::Ray;
use lumbre_math::Vec3;
use lumbre_scene::light::lanes::Receiver;
use lumbre_scene::{Footprint, Interaction, TriangleSurface};
use lumbre_shading::medium::{DistanceSample, sample_henyey_greenstein};
use lumbre_shading::subsurface::SubsurfaceParams;
use lumbre_shading::{HomogeneousMedium, Material, Spectrum};
use lumbre_simd::{UInt, V3};

use crate::transport::Record;
use crate::transport::interior::{MediumStack, Solid};
use crate::transport::journal::{End, Event, Met, Source};
use crate::transport::through::hero_alone;
use crate::wave::Wave;
use crate::wave::flat::FlatVertices;
use crate::wave::paths::{OnePath, SCATTERED, sides};
use crate::wave::setting::Setting;
use crate::wave::smooth::{SmoothHits, SmoothVertices, flags_of, frame_for};
use crate::wave::vertices::{FOLDS, LIT_FROM_BELOW};

/// Minimum collisions in media before Russian roulette.
const ROULETTE_START_IN_MEDIA: u32 = 4;
/// Maximum collisions: they are not bounces, and without absorption a path might never end.
const MAX_COLLISIONS: u32 = 1 << 14;

impl<'s> Wave<'s> {
    /// Makes the vertices of all paths that hit something, queues those that scatter, and adds emission.
    pub(super) fn make_vertices(&mut self, setting: &Setting<'s>, record: &mut Record) {
        let scene = setting.scene;
        self.vertices.reset(self.paths.len, scene.tables().rows());
        self.flat.reset(self.paths.len);
        self.smooth.reset(self.paths.len);
        self.placed.reset(self.paths.len);
        self.found.clear();
        self.collided.clear();
        // Regularization depends on the path so far, which BSDF rows of the scene do not.
        let takes_triangles = !setting.regularize;
        let mut not_in_lanes = std::mem::take(&mut self.not_in_lanes);
        not_in_lanes.clear();
        for path in 0..self.paths.len {
            if self.hits.is_miss(path) || self.is_stopped_in_medium(path) {
                continue;
            }
            let in_the_open =
                self.slots.interiors.get(self.paths.slot[path] as usize).is_none_or(MediumStack::is_empty);
            if !(takes_triangles && in_the_open && self.push_triangle(setting, path)) {
                not_in_lanes.push(path as u32);
                continue;
            }
            if record.journal.is_some() {
                self.note_triangle(setting, path, record);
            }
        }
        self.flat.load(scene.tables());
        self.smooth.load(scene, self.hits.is_single());
        self.placed.load(scene, self.hits.is_single());
        setting.instruction_set.run(FlatVertices {
            setting,
            hits: &self.flat,
            paths: &self.paths,
            vertices: &mut self.vertices,
            found: &mut self.found,
            is_single: self.hits.is_single(),
        });
        for hits in [&mut self.smooth, &mut self.placed] {
            setting.instruction_set.run(SmoothVertices {
                setting,
                hits,
                paths: &self.paths,
                vertices: &mut self.vertices,
                found: &mut self.found,
                is_single: self.hits.is_single(),
            });
        }
        if setting.is_spectral {
            for found in &mut self.found {
                let path = found.path as usize;
                let Some(met) = self.hits.triangle(path) else { continue };
                let wavelengths = &self.slots.wavelengths[self.paths.slot[path] as usize];
                found.radiance = scene.emission_at_wavelengths(met.id, found.radiance, wavelengths);
            }
        }
        self.add_found(setting, Source::Surface, record);
        if setting.has_media {
            for vertex in 0..self.vertices.len {
                let slot = self.paths.slot[self.vertices.path[vertex] as usize] as usize;
                self.vertices.put_media(vertex, [self.slots.medium[slot]; 2]);
            }
        }
        if record.journal.is_some() && self.flat.len() > 0 && self.vertices.is_unqueued() {
            record.note(|| Event::Ended(End::Depth));
        }
        let (smooth, placed) = (std::mem::take(&mut self.smooth), std::mem::take(&mut self.placed));
        self.scatter_smooth(setting, self.flat.len(), &smooth, record);
        self.scatter_smooth(setting, self.flat.len() + smooth.base.len(), &placed, record);
        (self.smooth, self.placed) = (smooth, placed);
        for &path in &not_in_lanes {
            let path = path as usize;
            let slot = self.paths.slot[path] as usize;
            let ray = self.paths.ray(path, self.slots.time[slot]);
            let footprint = self.footprint(path);
            if let Some(mut here) = self.hits.interaction(scene, path, &ray, &footprint) {
                here.at.spectral = self.slots.spectral(slot);
                self.make_vertex(setting, path, slot, &ray, &here, record);
            }
        }
        self.not_in_lanes = not_in_lanes;
    }

    /// Adds what a path met to the triangles for lanes; false if it is none, or needs more than lanes do.
    #[inline]
    fn push_triangle(&mut self, setting: &Setting<'s>, path: usize) -> bool {
        let (scene, distance) = (setting.scene, self.hits.distance(path));
        // Spectral renders look up the material at the wavelengths of the path.
        let bsdf_of = |surface: &TriangleSurface| surface.bsdf.filter(|_| !setting.is_spectral);
        if let Some(met) = self.hits.triangle(path) {
            let Some(surface) = scene.tables().surface(met.id) else { return false };
            match bsdf_of(surface) {
                Some(bsdf) if !surface.is_smooth() => {
                    self.flat.push(surface, path, met, distance);
                    let ends = self.paths.depth[path] & !SCATTERED == setting.max_depth;
                    if !ends {
                        self.vertices.queue(self.flat.len() - 1, bsdf.kind);
                    }
                }
                bsdf => self.smooth.push(surface, path, met, distance, bsdf),
            }
            return true;
        }
        let Some(placed @ (met, instance)) = self.hits.triangle_in_instance(path) else { return false };
        let Some(surface) = scene.tables().surface(met.id) else { return false };
        // Lanes know lights by their triangles, of which an instance may have many copies.
        if surface.emission.is_some() || scene.accel().still_instance(instance).is_none() {
            return false;
        }
        self.placed.push_placed(surface, path, placed, distance, bsdf_of(surface));
        true
    }

    /// Queues the vertices of hits, the first of which is `first`, and looks up textured materials.
    fn scatter_smooth(
        &mut self,
        setting: &Setting<'s>,
        first: usize,
        hits: &SmoothHits,
        record: &mut Record,
    ) {
        for at in 0..hits.base.len() {
            let (vertex, path) = (first + at, hits.base.path[at] as usize);
            if self.paths.depth[path] & !SCATTERED == setting.max_depth {
                record.note(|| Event::Ended(End::Depth));
                continue;
            }
            if let Some(kind) = hits.kinds[at] {
                self.vertices.queue(vertex, kind);
                continue;
            }
            let footprint = self.footprint(path);
            let direction = self.paths.direction(path);
            let point = hits.point(setting.scene, at, &self.vertices, vertex, direction);
            let surface = hits.base.surface(setting.scene.tables(), at);
            let slot = self.paths.slot[path] as usize;
            let spectral = self.slots.spectral(slot);
            let scattering = surface.and_then(|surface| {
                surface.scattering(&point, &footprint, setting.shading_normals, spectral)
            });
            match scattering {
                Some((material, frame, bsdf)) => {
                    if setting.is_spectral && material.disperses() {
                        self.follow_hero(path, slot);
                    }
                    let frame = frame_for(&bsdf, frame);
                    let mut flags = flags_of(setting.shading_normals, &frame, point.geometric);
                    if material.is_transmissive() {
                        flags |= LIT_FROM_BELOW;
                    }
                    self.vertices.put_looked_up(vertex, &frame, &bsdf, flags);
                }
                None => record.note(|| Event::Ended(End::Nothing)),
            }
        }
    }

    /// Continues with the hero wavelength only, since each wavelength would refract differently.
    fn follow_hero(&mut self, path: usize, slot: usize) {
        if !std::mem::replace(&mut self.slots.is_alone[slot], true) {
            let throughput = self.paths.throughput(path);
            self.paths.set_throughput(path, hero_alone(throughput));
        }
    }

    /// The footprint of a path's ray.
    fn footprint(&self, path: usize) -> Footprint {
        if self.is_first {
            let slot = self.paths.slot[path] as usize;
            return self.slots.footprint(slot, self.paths.origin(path));
        }
        match self.paths.width[path] {
            width if width > 0.0 => {
                Footprint::Cone { width: width.into(), spread: self.paths.spread[path].into() }
            }
            _ => Footprint::Point,
        }
    }

    /// Records the triangle that a path met in the journal.
    fn note_triangle(&self, setting: &Setting<'s>, path: usize, record: &mut Record) {
        let ray = self.paths.ray(path, self.slots.time[self.paths.slot[path] as usize]);
        if let Some(here) = self.hits.interaction(setting.scene, path, &ray, &self.footprint(path)) {
            let (depth, throughput) = (self.paths.depth[path] & !SCATTERED, self.paths.throughput(path));
            record.note(|| Event::Met(Met::of(&ray, &here, depth, throughput)));
        }
    }

    /// Makes the vertex of one path and queues it, after the medium before it and its emission.
    fn make_vertex(
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
        let mut depth = depth;
        if let Some(body) = material.and_then(Material::subsurface)
            && !here.front
        {
            if self.reflect_inside(path, slot, ray, here, body, record) {
                return;
            }
            // Bounces below the surface do not count towards the depth.
            depth = depth.saturating_sub(1);
            self.paths.depth[path] = depth | SCATTERED;
        }
        let media = setting.has_media.then(|| sides(here.boundary, here.front, self.slots.medium[slot]));
        if let Some([before, _]) = media {
            self.slots.medium[slot] = before;
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
            let outside = self.slots.interiors[slot].index_outside(Solid::new(here, material), here.front);
            if outside != 1.0 {
                bsdf = bsdf.immersed(outside);
            }
        }
        if setting.regularize && self.paths.depth[path] & SCATTERED != 0 {
            bsdf = bsdf.regularized();
        }
        if setting.is_spectral && material.disperses() {
            self.follow_hero(path, slot);
        }
        let frame = frame_for(&bsdf, frame);
        let mut flags = flags_of(setting.shading_normals, &frame, here.shading.geometric);
        if material.is_transmissive() {
            flags |= LIT_FROM_BELOW;
        }
        self.vertices.push_place(path, &here.surface, here.surface.point_error, here.towards_origin);
        if let Some(media) = media {
            self.vertices.put_media(self.vertices.len - 1, media);
        }
        if flags & FOLDS != 0
            && let Some(terminator_origin) = here.terminator_origin()
        {
            let (normal, geometric) = (here.shading.normal, here.shading.geometric);
            let facing = if here.front { geometric } else { -geometric };
            let smooth_normal = if normal.dot(facing) < 0.0 { -normal } else { normal };
            self.vertices.put_terminator_origin(smooth_normal, terminator_origin);
            flags |= LIT_FROM_BELOW;
        }
        if material.is_solid() {
            let inside = if here.front { material.interior_medium(&here.at) } else { None };
            self.vertices.put_solid(Solid::new(here, material), here.front, inside);
        }
        self.vertices.put_bsdf(&frame, &bsdf, flags, self.cone_at(path, here));
    }

    /// The cone of a path at its surface, also in scenes without textures.
    fn cone_at(&self, path: usize, here: &Interaction<'s>) -> (f64, f64) {
        let cone = here.cone();
        if cone.0 > 0.0 {
            return cone;
        }
        let spread = f64::from(self.paths.spread[path]);
        (f64::from(self.paths.width[path]) + spread * self.hits.distance_f64(path), spread)
    }

    /// Reflects a path at the boundary of a body around it, or ends it; false if it leaves the body.
    fn reflect_inside(
        &mut self,
        path: usize,
        slot: usize,
        ray: &Ray,
        here: &Interaction<'s>,
        body: &SubsurfaceParams,
        record: &mut Record,
    ) -> bool {
        let normal = here.surface.normal;
        let cos = here.towards_origin.dot(normal);
        let u = self.slots.numbers(slot).scattered(self.slots.distance_samples[slot]);
        self.slots.distance_samples[slot] += 1;
        if u.x >= body.reflected_inside(cos as f32) {
            return false;
        }
        let throughput = self.paths.throughput(path);
        if self.slots.collisions[slot] >= MAX_COLLISIONS || throughput.max_component() <= 0.0 {
            record.note(|| Event::Ended(End::Medium));
            return true;
        }
        self.slots.collisions[slot] += 1;
        let along = ray.direction - 2.0 * ray.direction.dot(normal) * normal;
        let (width, spread) = here.cone();
        self.collided.push(OnePath {
            slot: slot as u32,
            origin: here.surface.offset_origin(along),
            receiver_normal: Vec3::ZERO,
            direction: along.as_vec3().normalize(),
            throughput,
            eta_scale: self.paths.eta_scale[path],
            pdf: f32::INFINITY,
            merge_pdf: f32::INFINITY,
            depth: self.paths.depth[path] | SCATTERED,
            width: width as f32,
            spread: spread as f32,
        });
        true
    }

    /// Adds the emission of a surface that a path hit.
    fn emission(
        &mut self,
        setting: &Setting<'s>,
        path: usize,
        slot: usize,
        ray: &Ray,
        here: &Interaction<'s>,
        record: &mut Record,
    ) {
        let mut emitted = here.emitted();
        if emitted.is_black() {
            return;
        }
        if let (Some(wavelengths), Some(emission)) = (self.slots.wavelengths.get(slot), here.emission) {
            emitted = emission.at_wavelengths(emitted, wavelengths);
        }
        let matters = self.paths.pdf[path].min(self.paths.merge_pdf[path]) < f32::INFINITY;
        let pdf = if matters { self.light_pdf(setting, path, ray, here) } else { 0.0 };
        let weight = self.weight_of_found(setting, path, pdf);
        let throughput = self.paths.throughput(path);
        self.slots.radiance[slot] += record.added(Source::Surface, throughput, emitted, weight);
    }

    /// The density with which the last vertex would have sampled what a path hit: as the lanes compute it for a
    /// triangle.
    fn light_pdf(&self, setting: &Setting<'s>, path: usize, ray: &Ray, here: &Interaction<'s>) -> f32 {
        let (scene, normal) = (setting.scene, self.paths.receiver_normal(path));
        let Some(met) = self.hits.triangle(path).filter(|_| here.light.is_some()) else {
            return scene.light_pdf(ray.origin, normal.as_dvec3(), here);
        };
        let receiver = Receiver::<f32> {
            from: V3::new(ray.origin.x, ray.origin.y, ray.origin.z),
            normal: V3::new(normal.x, normal.y, normal.z),
            time: setting.moves.then_some(ray.time),
        };
        let point = here.surface.point;
        let (id, triangle) = (UInt::splat(met.id), UInt::splat(met.triangle));
        let point = V3::new(point.x, point.y, point.z);
        scene.lane_lights().pdf(true, &receiver, id, triangle, point)
    }

    /// Traces a path through the medium before a surface; false if it scatters or ends in it.
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
        let u = self.slots.numbers(slot).distance(self.slots.distance_samples[slot]);
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
        let survival = (throughput * eta_scale).max_component();
        let (numbers, sample) = (self.slots.numbers(slot), self.slots.distance_samples[slot]);
        if self.slots.collisions[slot] >= MAX_COLLISIONS || survival <= 0.0 {
            return record.note(|| Event::Ended(End::Medium));
        }
        if survival < 1.0 && self.slots.collisions[slot] >= ROULETTE_START_IN_MEDIA {
            let survives = numbers.survives_collision(sample) < survival;
            record.note(|| Event::Roulette { probability: survival, survives });
            if !survives {
                return record.note(|| Event::Ended(End::Roulette));
            }
            throughput *= 1.0 / survival;
        }
        let u = numbers.scattered(sample);
        let (along, _) = sample_henyey_greenstein(ray.direction.as_vec3(), medium.asymmetry, u);
        self.slots.distance_samples[slot] += 1;
        self.slots.collisions[slot] += 1;
        let (width, spread) = here.cone();
        self.collided.push(OnePath {
            slot: slot as u32,
            origin: ray.origin + distance * ray.direction,
            receiver_normal: Vec3::ZERO,
            direction: along.normalize(),
            throughput,
            eta_scale,
            // A refracting surface hides the lights: only paths find them.
            pdf: f32::INFINITY,
            merge_pdf: f32::INFINITY,
            depth: self.paths.depth[path] | SCATTERED,
            width: width as f32,
            spread: spread as f32,
        });
    }
}
