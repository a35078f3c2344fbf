//! Many paths side by side: plain data in columns, and stages that take them all one step further.
//!
//! A wave holds some thousand samples ([`Slots`]), each with its path ([`Paths`]). A bounce goes through the stages: the closest hits
//! of all rays ([`search`]); what they met, written down as plain numbers, with media, emission and materials ([`surfaces`]); a light
//! and a direction to go on in, for all of them ([`shade`]); what comes through of the lights ([`shadows`]). What a path does depends on
//! nothing but its sample: neither the size of the wave nor the other paths in it show in the picture.

mod lights;
mod one_bsdf;
mod paths;
mod search;
mod shade;
mod shadows;
mod sights;
mod surfaces;
mod traced;
mod vertices;

use lumbre_geometry::Ray;
use lumbre_kernel::Hit;
use lumbre_math::DVec3;
use lumbre_scene::{SamplerKind, Scene};
use lumbre_shading::{Bsdf, ShadingNormals, Spectrum};

pub(crate) use paths::SampleId;
pub use sights::Sights;

use crate::transport::journal::{End, Event, Source};
use crate::transport::{Record, Strategy};
use crate::wave::paths::{OnePath, Paths, Slots};
use crate::wave::shade::Shade;
use crate::wave::shadows::Shadows;
use crate::wave::traced::Traced;
use crate::wave::vertices::Vertices;

/// Samples of a wave, about: enough to fill lanes and to keep the kernel busy, few enough to stay in the caches.
pub(crate) const WAVE: usize = 4096;

/// What all paths of a render have in common.
#[derive(Debug)]
pub(crate) struct Setting<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) sampler: SamplerKind,
    pub(crate) strategy: Strategy,
    pub(crate) max_depth: u32,
    /// Bounces that every path may take before Russian roulette.
    pub(crate) roulette_start: u32,
    pub(crate) regularize: bool,
    pub(crate) shading_normals: ShadingNormals,
    pub(crate) has_solids: bool,
    /// Whether light from points is followed straight on through panes.
    pub(crate) has_panes: bool,
}

/// The first part of a ray: from a face to the smooth surface over it, where the ray itself starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leg {
    /// The position of the ray.
    pub(crate) ray: u32,
    /// Where it comes from.
    pub(crate) from: DVec3,
}

/// A wave's columns, kept from one wave to the next.
#[derive(Debug, Default)]
pub(crate) struct Wave<'s> {
    slots: Slots<'s>,
    paths: Paths,
    /// The same paths after the bounce.
    next: Paths,
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    vertices: Vertices<'s>,
    /// Vertices to be shaded, as positions of paths.
    queue: Vec<u32>,
    shadows: Shadows<'s>,
    legs: Vec<Leg>,
    crossings: Vec<u32>,
    /// Paths that scattered in a medium before they reached a surface.
    collided: Vec<OnePath>,
    /// Whether rays come from the camera.
    is_first: bool,
}

impl<'s> Wave<'s> {
    /// Follows all paths, whose rays have met what is in `hits`, to their ends.
    fn follow(&mut self, setting: &Setting<'s>, record: &mut Record) {
        let mut traced = record.journal.is_some().then(Traced::default);
        loop {
            self.escape(setting, record);
            self.surfaces(setting, record);
            self.shade(setting, traced.as_mut());
            self.cross_surfaces();
            self.light(setting, traced.as_mut(), record);
            self.walk_legs(setting.scene, record);
            std::mem::swap(&mut self.paths, &mut self.next);
            if self.paths.len == 0 {
                return;
            }
            record.counts.bounce += self.paths.len as u64;
            self.is_first = false;
            self.search(setting.scene);
        }
    }

    /// Adds the light at infinity that rays found which left the scene.
    fn escape(&mut self, setting: &Setting<'s>, record: &mut Record) {
        for path in 0..self.paths.len {
            if self.hits[path].is_some() {
                continue;
            }
            let slot = self.paths.slot[path] as usize;
            let ray = self.paths.ray(path, self.slots.camera[slot].ray.time);
            record.note(|| Event::Left { ray });
            let (throughput, chosen) = (self.paths.throughput(path), self.paths.pdf[path]);
            for (arriving, pdf) in setting.scene.escaped(&ray) {
                let weight = setting.weight_of_found(chosen, pdf);
                self.slots.radiance[slot] += record.added(Source::Infinity, throughput, arriving, weight);
            }
        }
    }

    /// Samples lights and directions at all vertices.
    fn shade(&mut self, setting: &Setting<'s>, traced: Option<&mut Traced>) {
        let count = self.queue.len();
        self.next.len = 0;
        self.legs.clear();
        self.crossings.clear();
        self.next.reserve(count);
        self.shadows.reset(count);
        // A vector reads beyond the last.
        let last = self.queue.last().copied().unwrap_or(0);
        self.queue.resize(count + paths::PAD, last);
        let mut shade = Shade {
            setting,
            slots: &self.slots,
            paths: &self.paths,
            vertices: &self.vertices,
            queue: &self.queue,
            count,
            next: &mut self.next,
            legs: &mut self.legs,
            shadows: &mut self.shadows,
            crossings: &mut self.crossings,
            traced,
        };
        let bsdfs: &[Bsdf] = &self.vertices.bsdfs;
        shade.run::<f32, _>(&bsdfs);
        for path in &self.collided {
            self.next.push_one(path);
        }
    }

    /// Takes paths into the solids behind the surfaces that they go through, or out of them.
    fn cross_surfaces(&mut self) {
        for &path in &self.crossings {
            if let Some((solid, front)) = self.vertices.solids[path as usize] {
                self.slots.interiors[self.paths.slot[path as usize] as usize].cross(solid, front);
            }
        }
    }

    /// Adds the light of samples that nothing stands in the way of.
    fn light(&mut self, setting: &Setting<'s>, traced: Option<&mut Traced>, record: &mut Record) {
        let mut share = Spectrum::BLACK;
        let Self { shadows, slots, .. } = self;
        shadows.resolve(setting.scene, slots, setting.regularize, record, |_, passes| share = passes);
        if let Some(traced) = traced {
            let light = if self.shadows.len > 0 { self.shadows.light(0) } else { Spectrum::BLACK };
            let time = self.slots.camera[0].ray.time;
            traced.write(self.paths.throughput(0), time, light, share, record);
        }
    }

    /// Ends the paths whose rays do not reach the smooth surface that they start on.
    fn walk_legs(&mut self, scene: &Scene, record: &mut Record) {
        let mut ended = Vec::new();
        for &Leg { ray, from } in &self.legs {
            let start = self.next.origin(ray as usize);
            let time = self.slots.camera[self.next.slot[ray as usize] as usize].ray.time;
            record.counts.shadow += 1;
            if scene.is_occluded(&Ray::new(from, start - from).with_range(0.0, 1.0).at_time(time)) {
                ended.push(ray);
            }
        }
        if !ended.is_empty() {
            record.note(|| Event::Ended(End::Absorbed));
            self.next.remove(&ended);
        }
    }
}

impl Setting<'_> {
    /// The weight of light that a ray found by itself, against a sample of the light with this density.
    fn weight_of_found(&self, chosen: f32, light_pdf: f32) -> f32 {
        match self.strategy {
            _ if chosen == f32::INFINITY => 1.0,
            Strategy::Bsdf => 1.0,
            Strategy::Lights => f32::from(u8::from(light_pdf <= 0.0)),
            Strategy::Both => shade::power_heuristic(chosen, light_pdf),
        }
    }
}
