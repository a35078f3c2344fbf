//! Trees of rays, for integrators that follow several rays from a vertex.
//!
//! Each sample goes through its tree depth first, so that its light is summed in the same order in any wave. A round
//! takes one ray of each sample that has rays left. All rays of a round are traced together, and then all shadow rays
//! of what they met.

use lumbre_geometry::Ray;
use lumbre_math::DVec3;
use lumbre_scene::{Footprint, Interaction, LightSample, Scene};
use lumbre_shading::Spectrum;
use lumbre_simd::V3;

use crate::transport::interior::MediumStack;
use crate::transport::journal::{Event, Source};
use crate::transport::{Record, SampleNumbers};
use crate::wave::Wave;
use crate::wave::paths::to_column;
use crate::wave::search::Precision;
use crate::wave::setting::Rounding;
use crate::wave::shadows::{OneSegment, Shadows};

/// An integrator that shades one vertex at a time. The rays between vertices are traced for it.
pub(crate) trait TreeIntegrator {
    /// Shades what a ray met; `None` if it left the scene.
    fn shade<'s>(
        &self,
        scene: &'s Scene,
        branch: Branch<'s>,
        met: Option<&Interaction<'s>>,
        numbers: &SampleNumbers,
        vertex: &mut TreeVertex<'_, 's>,
        record: &mut Record,
    );
}

/// A ray of a tree.
#[derive(Debug)]
pub(crate) struct Branch<'s> {
    /// With a direction in single precision: see [`crate::wave::paths::rounded`].
    pub(crate) ray: Ray,
    pub(crate) footprint: Footprint,
    /// The solids around its origin.
    pub(crate) interiors: MediumStack<'s>,
    pub(crate) throughput: Spectrum,
    pub(crate) depth: u32,
    /// The number of the vertex at its end, in the order of visits.
    pub(crate) vertex: u32,
}

/// The tree of a sample, of which rays are left.
#[derive(Debug)]
struct Tree<'s> {
    slot: u32,
    /// The rays to follow, the next one last.
    pending: Vec<Branch<'s>>,
    /// Number of vertices before the next one.
    visited: u32,
}

/// Collects what a vertex adds to its sample.
pub(crate) struct TreeVertex<'w, 's> {
    pending: &'w mut Vec<Branch<'s>>,
    shadows: &'w mut Shadows<'s>,
    notes: &'w mut Vec<Note>,
    rounding: Rounding,
    radiance: Spectrum,
    direct: Direct,
}

/// The direct light of a vertex. Its shadow rays follow those of the vertex before.
struct Direct {
    slot: u32,
    /// What to call it, and what multiplies it; `None` without direct light.
    factor: Option<(Source, Spectrum)>,
    /// Light that is unoccluded.
    unoccluded: Spectrum,
    /// The end of its shadow rays.
    end: usize,
}

/// An event to record when a shadow ray has been traced.
struct Note {
    /// The index of the ray; `None` if nothing occludes the light.
    segment: Option<u32>,
    event: Box<dyn FnOnce(bool) -> Event>,
}

impl<'s> TreeVertex<'_, 's> {
    /// Adds light to the sample.
    pub(crate) fn add(&mut self, light: Spectrum) {
        self.radiance += light;
    }

    /// Adds a ray to the tree. The last one added is followed first.
    pub(crate) fn follow(&mut self, branch: Branch<'s>) {
        self.pending.push(branch);
    }

    /// Sets what multiplies the direct light of this vertex. Without this call there is none.
    pub(crate) fn begin_direct(&mut self, source: Source, throughput: Spectrum) {
        self.direct.factor = Some((source, throughput));
    }

    /// Adds direct light that is unoccluded.
    pub(crate) fn add_unoccluded(&mut self, light: Spectrum) {
        self.direct.unoccluded += light;
    }

    /// Adds direct light that arrives along a ray unless that is occluded. Returns the index of the ray.
    pub(crate) fn add_along(&mut self, ray: &Ray, light: Spectrum) -> u32 {
        let segment = self.shadows.len;
        if segment == self.shadows.capacity() {
            self.shadows.reserve(2 * segment + 64);
        }
        self.shadows.push_one(&OneSegment {
            slot: self.direct.slot,
            origin: ray.origin,
            to_light: ray.direction,
            end: ray.t_max,
            contribution: light,
            medium: to_column(None),
        });
        segment as u32
    }

    /// A light sample whose shadow ray ends before its light, although rays are rounded.
    pub(crate) fn reachable(&self, mut sample: LightSample) -> LightSample {
        if let Some(end) = &mut sample.end {
            let [point, error] = [end.point, end.error].map(|v| V3::new(v.x, v.y, v.z));
            let V3 { x, y, z } = self.rounding.grow::<f32>(point, error);
            end.error = DVec3::new(x, y, z);
        }
        sample
    }

    /// Records an event, if there is a journal, that says whether a shadow ray is occluded.
    pub(crate) fn note(
        &mut self,
        record: &Record,
        segment: Option<u32>,
        event: impl FnOnce(bool) -> Event + 'static,
    ) {
        if record.journal.is_some() {
            self.notes.push(Note { segment, event: Box::new(event) });
        }
    }
}

/// What the vertices of a round leave to be done when their shadow rays are traced.
struct Round {
    precision: Precision,
    rounding: Rounding,
    direct: Vec<Direct>,
    notes: Vec<Note>,
}

impl<'s> Wave<'s> {
    /// Follows a tree from each of these samples, whose camera rays have found their first hits.
    pub(crate) fn follow_trees(
        &mut self,
        scene: &'s Scene,
        precision: Precision,
        samples: &[u32],
        integrator: &impl TreeIntegrator,
        record: &mut Record,
    ) {
        let rounding = Rounding::of(scene, precision == Precision::Single);
        let mut round = Round { precision, rounding, direct: Vec::new(), notes: Vec::new() };
        let mut trees = Vec::new();
        let mut pending = Vec::new();
        self.shadows.reset(samples.len());
        for &slot in samples {
            let ray = self.paths.ray(slot as usize, self.slots.time[slot as usize]);
            let root = Branch {
                ray,
                footprint: self.slots.footprint(slot as usize, ray.origin),
                interiors: MediumStack::default(),
                throughput: Spectrum::WHITE,
                depth: 0,
                vertex: 0,
            };
            self.shade_vertex(scene, integrator, root, slot, slot as usize, &mut pending, &mut round, record);
            if !pending.is_empty() {
                trees.push(Tree { slot, pending: std::mem::take(&mut pending), visited: 0 });
            }
        }
        self.add_direct(scene, &mut round, record);
        while !trees.is_empty() {
            self.search_branches(scene, precision, &mut trees, record);
            self.shadows.reset(trees.len());
            for (path, Tree { slot, pending, .. }) in trees.iter_mut().enumerate() {
                let Some(branch) = pending.pop() else { continue };
                self.shade_vertex(scene, integrator, branch, *slot, path, pending, &mut round, record);
            }
            self.add_direct(scene, &mut round, record);
            trees.retain(|tree| !tree.pending.is_empty());
        }
    }

    /// Shades what the ray of a branch met: the hit of this path.
    #[expect(clippy::too_many_arguments, reason = "the parts of a round")]
    fn shade_vertex(
        &mut self,
        scene: &'s Scene,
        integrator: &impl TreeIntegrator,
        branch: Branch<'s>,
        slot: u32,
        path: usize,
        pending: &mut Vec<Branch<'s>>,
        round: &mut Round,
        record: &mut Record,
    ) {
        let met = self.hits.interaction(scene, path, &branch.ray, &branch.footprint);
        let mut vertex = TreeVertex {
            pending,
            shadows: &mut self.shadows,
            notes: &mut round.notes,
            rounding: round.rounding,
            radiance: Spectrum::BLACK,
            direct: Direct { slot, factor: None, unoccluded: Spectrum::BLACK, end: 0 },
        };
        let numbers = self.slots.numbers(slot as usize);
        integrator.shade(scene, branch, met.as_ref(), &numbers, &mut vertex, record);
        let TreeVertex { radiance, direct, .. } = vertex;
        self.slots.radiance[slot as usize] += radiance;
        round.direct.push(Direct { end: self.shadows.len, ..direct });
    }

    /// Traces the shadow rays of a round and adds its direct light.
    fn add_direct(&mut self, scene: &Scene, round: &mut Round, record: &mut Record) {
        record.counts.shadow += self.shadows.len as u64;
        self.shadows.search(scene, round.precision == Precision::Single, &self.slots);
        for Note { segment, event } in round.notes.drain(..) {
            let is_occluded = segment.is_some_and(|segment| self.shadows.blocked[segment as usize]);
            record.note(|| event(is_occluded));
        }
        let mut begin = 0;
        for Direct { slot, factor, unoccluded, end } in round.direct.drain(..) {
            let mut light = unoccluded;
            for segment in begin..end {
                if !self.shadows.blocked[segment] {
                    light += self.shadows.contribution(segment);
                }
            }
            begin = end;
            if let Some((source, throughput)) = factor {
                self.slots.radiance[slot as usize] += record.added(source, throughput, light, 1.0);
            }
        }
    }

    /// Finds the hits of the next ray of each tree.
    fn search_branches(
        &mut self,
        scene: &Scene,
        precision: Precision,
        trees: &mut [Tree<'s>],
        record: &mut Record,
    ) {
        self.paths.start(trees.len());
        for (path, tree) in trees.iter_mut().enumerate() {
            let Some(branch) = tree.pending.last_mut() else { continue };
            tree.visited += 1;
            branch.vertex = tree.visited;
            self.paths.slot[path] = tree.slot;
            self.paths.set_ray(path, branch.ray.origin, branch.ray.direction.as_vec3(), (0.0, 0.0));
        }
        record.counts.bounce += trees.len() as u64;
        self.hits.search(scene, &self.paths, &self.slots, precision, false);
    }
}
