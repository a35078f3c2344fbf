//! Waves of paths: data in columns, and stages that advance all paths by one step.
//!
//! A wave holds a few thousand samples ([`Slots`]), each with its path ([`Paths`]), which starts at the camera
//! ([`camera`]). `Wave::follow` takes each bounce through its stages; the crate's page lists them. A path depends only
//! on its sample: neither the size of the wave nor the other paths change the picture.

mod camera;
pub(crate) mod catcher;
mod escape;
mod flat;
mod lights;
mod media;
mod merge;
mod pairs;
pub(crate) mod paths;
mod placed;
mod primary_hits;
mod search;
pub(crate) mod setting;
mod shade;
mod shadows;
mod smooth;
mod surfaces;
mod traced;
pub(crate) mod trees;
mod vertices;

use std::marker::PhantomData;

use lumbre_geometry::Ray;
use lumbre_scene::{Crossing, Scene};
use lumbre_shading::Spectrum;
use lumbre_shading::lanes::{
    BsdfKind, CoatedConductorLanes, CoatedDiffuseLanes, ConductorLanes, DielectricLanes, DiffuseLanes,
    DiffuseTransmissionLanes, HairLanes, MeasuredLanes, PrincipledLanes, SubsurfaceLanes,
    ThinDielectricLanes, UberLanes,
};
use lumbre_simd::{InstructionSet, Real};

pub(crate) use paths::SampleId;
pub use primary_hits::PrimaryHits;
pub(crate) use primary_hits::{WavelengthChoice, cone};
pub(crate) use search::Precision;

use crate::transport::Record;
use crate::transport::journal::{End, Event, Source};
use crate::wave::camera::Aims;
use crate::wave::escape::Escape;
use crate::wave::flat::FlatHits;
use crate::wave::pairs::{Merge, MergeKind, Merges};
use crate::wave::paths::{Collision, OnePath, Paths, Slots};
use crate::wave::search::Hits;
use crate::wave::setting::{Found, Setting, TerminatorSegment};
use crate::wave::shade::{Kind, Shade, ShadeKind};
use crate::wave::shadows::Shadows;
use crate::wave::smooth::SmoothHits;
use crate::wave::traced::Traced;
use crate::wave::vertices::Vertices;

/// Approximate samples of a wave: enough to fill lanes and keep the kernel busy, few enough for the caches.
pub(crate) const WAVE: usize = 4096;

/// A wave's columns, reused by the next wave.
#[derive(Debug, Default)]
pub(crate) struct Wave<'s> {
    aims: Aims,
    slots: Slots<'s>,
    paths: Paths,
    /// The same paths after the bounce.
    next: Paths,
    hits: Hits,
    flat: FlatHits,
    smooth: SmoothHits,
    /// Triangles in instances.
    placed: SmoothHits,
    /// Paths that left the scene.
    escaped: Vec<u32>,
    /// Paths whose vertices are made one by one: their hit is no triangle, or needs more than lanes do.
    not_in_lanes: Vec<u32>,
    vertices: Vertices<'s>,
    found: Vec<Found>,
    shadows: Shadows<'s>,
    terminator_segments: Vec<TerminatorSegment>,
    crossings: Vec<u32>,
    /// Paths that scattered inside solids before they reached a surface.
    collided: Vec<OnePath>,
    /// Collisions in media between surfaces.
    collisions: Vec<Collision>,
    /// Whether each path scatters or ends in a medium before its hit; empty without media.
    stopped_in_medium: Vec<bool>,
    /// The boundaries of media along one ray.
    boundaries: Vec<Crossing>,
    merges: Merges,
    /// Whether these are camera rays.
    is_first: bool,
    /// Whether camera rays that leave the scene find no light.
    hides_background: bool,
}

impl<'s> Wave<'s> {
    /// Follows all paths to their ends. `hits` has the first hits of their rays.
    fn follow(&mut self, setting: &Setting<'s>, precision: Precision, record: &mut Record) {
        let mut traced = record.journal.is_some().then(Traced::default);
        loop {
            self.cross_media(setting, record);
            self.escape(setting, record);
            self.make_vertices(setting, record);
            self.merge(setting, record);
            self.shade(setting, precision, traced.as_mut());
            self.cross_surfaces(setting);
            self.trace_shadows(setting, precision, traced.as_mut(), record);
            self.test_terminator_segments(setting.scene, record);
            std::mem::swap(&mut self.paths, &mut self.next);
            if self.paths.len == 0 {
                return;
            }
            record.counts.bounce += self.paths.len as u64;
            self.is_first = false;
            self.hits.search(setting.scene, &self.paths, &self.slots, precision, false);
        }
    }

    /// Adds the light at infinity for rays that left the scene.
    fn escape(&mut self, setting: &Setting<'s>, record: &mut Record) {
        self.escaped.clear();
        for path in 0..self.paths.len {
            let is_hidden = self.hides_background && self.paths.depth[path] == 0;
            if self.hits.is_miss(path) && !self.is_stopped_in_medium(path) && !is_hidden {
                self.escaped.push(path as u32);
            }
        }
        let count = self.escaped.len();
        let Some(&last) = self.escaped.last() else { return };
        record.note(|| Event::Left { ray: self.paths.ray(0, self.slots.time[0]) });
        // Vector loads read beyond the last element.
        self.escaped.resize(count + paths::PAD, last);
        for light in 0..setting.scene.lane_lights().infinite_count() {
            self.found.clear();
            setting.instruction_set.run(Escape {
                setting,
                slots: &self.slots,
                paths: &self.paths,
                queue: &self.escaped,
                count,
                light,
                found: &mut self.found,
            });
            if setting.is_spectral {
                let id = setting.scene.lane_lights().infinite_light(light);
                for found in &mut self.found {
                    let slot = self.paths.slot[found.path as usize] as usize;
                    let wavelengths = &self.slots.wavelengths[slot];
                    found.radiance = setting.scene.light_at_wavelengths(id, found.radiance, wavelengths);
                }
            }
            self.add_found(setting, Source::Infinity, record);
        }
    }

    /// Adds the light that paths hit without sampling it.
    fn add_found(&mut self, setting: &Setting<'s>, source: Source, record: &mut Record) {
        for &Found { path, radiance, light_pdf } in &self.found {
            let path = path as usize;
            let weight = self.weight_of_found(setting, path, light_pdf);
            let added = record.added(source, self.paths.throughput(path), radiance, weight);
            self.slots.radiance[self.paths.slot[path] as usize] += added;
        }
    }

    /// The weight of light that a path hit without sampling it: see [`Setting::weight_of_found`].
    fn weight_of_found(&self, setting: &Setting<'s>, path: usize, light_pdf: f32) -> f32 {
        let merge_pdf = self.paths.merge_pdf[path];
        match &setting.merging {
            Some(merging) if self.paths.pdf[path] == f32::INFINITY && merge_pdf < f32::INFINITY => {
                merging.weight_of_found(merge_pdf, self.paths.origin(path), light_pdf)
            }
            _ => setting.weight_of_found(self.paths.pdf[path], light_pdf),
        }
    }

    /// Samples lights and directions at all vertices.
    fn shade(&mut self, setting: &Setting<'s>, precision: Precision, mut traced: Option<&mut Traced>) {
        let count = self.vertices.queues.iter().map(Vec::len).sum::<usize>() + self.collisions.len();
        self.next.len = 0;
        self.terminator_segments.clear();
        self.crossings.clear();
        self.next.reserve(count + self.collided.len());
        self.shadows.reset(count);
        let mut queues = std::mem::take(&mut self.vertices.queues);
        for (kind, queue) in KINDS.into_iter().zip(&mut queues) {
            let count = queue.len();
            let Some(&last) = queue.last() else { continue };
            // Vector loads read beyond the last element.
            queue.resize(count + paths::PAD, last);
            let mut shade = Shade {
                setting,
                slots: &self.slots,
                paths: &self.paths,
                vertices: &self.vertices,
                queue,
                count,
                next: &mut self.next,
                terminator_segments: &mut self.terminator_segments,
                shadows: &mut self.shadows,
                crossings: &mut self.crossings,
                is_single: precision == Precision::Single,
                traced: traced.as_deref_mut(),
            };
            shade.of_kind(kind);
        }
        self.vertices.queues = queues;
        for path in &self.collided {
            self.next.push_one(path);
        }
        self.shade_collisions(setting, precision == Precision::Single, traced);
    }

    /// Updates the solids and media of paths that cross a surface.
    fn cross_surfaces(&mut self, setting: &Setting<'s>) {
        for &vertex in &self.crossings {
            if setting.has_media {
                let path = self.vertices.path[vertex as usize] as usize;
                self.slots.medium[self.paths.slot[path] as usize] = self.vertices.media[1][vertex as usize];
            }
            if let Some((solid, front)) = self.vertices.solid(vertex as usize) {
                let path = self.vertices.path[vertex as usize] as usize;
                let interiors = &mut self.slots.interiors[self.paths.slot[path] as usize];
                match self.vertices.inside(vertex as usize) {
                    Some(medium) if front => interiors.enter(solid, medium),
                    _ => interiors.cross(solid, front),
                }
            }
        }
    }

    /// Traces the shadow rays of all light samples, and adds the light of those that are unoccluded.
    fn trace_shadows(
        &mut self,
        setting: &Setting<'s>,
        precision: Precision,
        traced: Option<&mut Traced>,
        record: &mut Record,
    ) {
        let mut unoccluded = Spectrum::BLACK;
        let Self { shadows, slots, .. } = self;
        shadows
            .resolve(setting, precision == Precision::Single, slots, record, |_, passes| unoccluded = passes);
        if let Some(traced) = traced {
            let light = if self.shadows.len > 0 { self.shadows.contribution(0) } else { Spectrum::BLACK };
            traced.write(self.paths.throughput(0), self.slots.time[0], light, unoccluded, record);
        }
    }

    /// Ends the paths with something between their face and the smooth surface that their ray starts on.
    fn test_terminator_segments(&mut self, scene: &Scene, record: &mut Record) {
        let mut ended = Vec::new();
        for &TerminatorSegment { ray, from } in &self.terminator_segments {
            let start = self.next.origin(ray as usize);
            let time = self.slots.time[self.next.slot[ray as usize] as usize];
            record.counts.shadow += 1;
            if scene.is_occluded(&Ray::new(from, start - from).with_range(0.0, 1.0).at_time(time)) {
                ended.push(ray);
            }
        }
        if !ended.is_empty() {
            record.note(|| Event::Ended(End::Absorbed));
            ended.sort_unstable();
            self.next.remove(&ended);
        }
    }
}

/// All kinds of BSDFs, in their order.
const KINDS: [BsdfKind; BsdfKind::COUNT] = [
    BsdfKind::Diffuse,
    BsdfKind::DiffuseTransmission,
    BsdfKind::Conductor,
    BsdfKind::Dielectric,
    BsdfKind::ThinDielectric,
    BsdfKind::CoatedDiffuse,
    BsdfKind::CoatedConductor,
    BsdfKind::Principled,
    BsdfKind::Uber,
    BsdfKind::Hair,
    BsdfKind::Measured,
    BsdfKind::Subsurface,
];

macro_rules! kinds {
    ($($kind:ident: $lanes:ident),* $(,)?) => {
        $(#[derive(Debug)]
        enum $kind {}

        impl Kind for $kind {
            type Bsdf<R: Real> = $lanes<R>;
        })*

        impl<'s> Shade<'_, 's> {
            /// Shades vertices with a kind of BSDF.
            fn of_kind(&mut self, kind: BsdfKind) {
                let instruction_set = self.setting.instruction_set;
                match kind {
                    $(BsdfKind::$kind => {
                        instruction_set.run(ShadeKind { shade: self, kind: PhantomData::<$kind> });
                    })*
                }
            }
        }

        impl Merge<'_, '_> {
            /// Evaluates a kind of BSDF.
            fn of_kind(self, instruction_set: InstructionSet, kind: BsdfKind) {
                match kind {
                    $(BsdfKind::$kind => {
                        instruction_set.run(MergeKind { merge: self, kind: PhantomData::<$kind> });
                    })*
                }
            }
        }
    };
}

kinds!(
    Diffuse: DiffuseLanes,
    DiffuseTransmission: DiffuseTransmissionLanes,
    Conductor: ConductorLanes,
    Dielectric: DielectricLanes,
    ThinDielectric: ThinDielectricLanes,
    CoatedDiffuse: CoatedDiffuseLanes,
    CoatedConductor: CoatedConductorLanes,
    Principled: PrincipledLanes,
    Uber: UberLanes,
    Hair: HairLanes,
    Measured: MeasuredLanes,
    Subsurface: SubsurfaceLanes,
);
