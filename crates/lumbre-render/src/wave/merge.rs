//! Photons near vertices and near collisions in media: caustic light from lamps.

use std::f32::consts::FRAC_1_SQRT_2;

use lumbre_math::Vec3;
use lumbre_shading::Spectrum;
use lumbre_shading::lanes::BsdfKind;
use lumbre_shading::medium::henyey_greenstein;

use crate::caustics::{Merging, radius};
use crate::transport::Record;
use crate::transport::journal::{Event, MergedPhoton, Source};
use crate::wave::pairs::{Merge, Merges};
use crate::wave::paths::{Collision, PAD, Paths, SCATTERED, to_column};
use crate::wave::setting::Setting;
use crate::wave::vertices::Vertices;
use crate::wave::{KINDS, Wave};

/// Approximate number of photons merged at a time.
const BATCH: usize = 1 << 14;

impl<'s> Wave<'s> {
    /// Adds the light of photons near the vertices in the queues.
    pub(super) fn merge(&mut self, setting: &Setting<'s>, record: &mut Record) {
        let Some(merging) = &setting.merging else { return };
        let mut merges = std::mem::take(&mut self.merges);
        for kind in KINDS {
            let mut rest = &self.vertices.queues[kind as usize][..];
            while !rest.is_empty() {
                merges.len = 0;
                while let Some((&vertex, after)) = rest.split_first()
                    && merges.len < BATCH
                {
                    self.collect(setting, merging, vertex, &mut merges);
                    rest = after;
                }
                scatter(setting, kind, &self.vertices, &self.paths, &mut merges);
                add(&self.vertices, &self.paths, &merges, &mut self.slots.radiance, record);
            }
        }
        self.merges = merges;
        for i in 0..self.collisions.len() {
            self.merge_in_medium(setting, merging, i, record);
        }
    }

    /// Adds the light of photons near a collision in a medium.
    fn merge_in_medium(
        &mut self,
        setting: &Setting<'s>,
        merging: &Merging<'s>,
        collision: usize,
        record: &mut Record,
    ) {
        let Collision { path, point, medium, width } = self.collisions[collision];
        let path = path as usize;
        let slot = self.paths.slot[path] as usize;
        let Some(photons) = merging.photons(self.slots.index[slot]) else { return };
        let radius = merging.radius_in_medium(self.slots.widths[slot], width);
        let spread = merging.spread_in_medium(radius);
        if !spread.is_finite() {
            return;
        }
        let share = merging.share_in_medium(spread);
        let bounces_left = setting.max_depth.saturating_sub((self.paths.depth[path] & !SCATTERED) + 1);
        let direction = self.paths.direction(path);
        let asymmetry = setting.scene.medium(medium).asymmetry();
        let is_alone = self.is_alone(slot);
        let mut sum = Spectrum::BLACK;
        let mut seen = Vec::new();
        photons.media.within(point, radius.into(), |photon| {
            if photon.medium == to_column(Some(medium)) && photon.bounces <= bounces_left {
                let phase = henyey_greenstein(direction.dot(photon.towards), asymmetry);
                let weight = 1.0 / (1.0 + phase * share / photon.density);
                let irradiance = photon.flux_for(is_alone) * spread;
                let scattered = irradiance * (phase * weight);
                sum += scattered;
                if record.journal.is_some() {
                    seen.push(MergedPhoton { towards: photon.towards, irradiance, weight, scattered });
                }
            }
        });
        if !seen.is_empty() {
            record.note(|| Event::Photons(seen));
        }
        self.slots.radiance[slot] += record.added(Source::Caustics, self.paths.throughput(path), sum, 1.0);
    }

    /// Whether the hero wavelength stands for all of a sample.
    fn is_alone(&self, slot: usize) -> bool {
        self.slots.is_alone.get(slot).copied().unwrap_or(false)
    }

    /// Finds the photons near a vertex.
    fn collect(&self, setting: &Setting<'s>, merging: &Merging<'s>, vertex: u32, merges: &mut Merges) {
        let at = vertex as usize;
        let path = self.vertices.path[at] as usize;
        let slot = self.paths.slot[path] as usize;
        let Some(photons) = merging.photons(self.slots.index[slot]) else { return };
        let depth = self.paths.depth[path];
        let radius: f32 =
            radius::<f32>(self.slots.widths[slot], self.vertices.width[at], depth & SCATTERED != 0);
        // The bounce at the vertex counts too.
        let bounces_left = setting.max_depth.saturating_sub((depth & !SCATTERED) + 1);
        let normal = Vec3::from_array(self.vertices.normal.each_ref().map(|column| column[at]));
        let spread = merging.spread(radius);
        if !spread.is_finite() {
            return;
        }
        let is_alone = self.is_alone(slot);
        photons.surfaces.within(self.vertices.point(at), radius.into(), |photon| {
            // A photon around a corner is on another surface.
            let is_level = photon.normal.dot(normal).abs() >= FRAC_1_SQRT_2;
            if is_level && photon.bounces <= bounces_left {
                merges.push(vertex, is_alone, photon, spread);
            }
        });
    }
}

/// Computes what vertices scatter of the photons near them.
fn scatter(
    setting: &Setting<'_>,
    kind: BsdfKind,
    vertices: &Vertices<'_>,
    paths: &Paths,
    merges: &mut Merges,
) {
    if merges.len == 0 {
        return;
    }
    // Vector loads read beyond the last element.
    let last = merges.vertex[merges.len - 1];
    merges.vertex[merges.len..merges.len + PAD].fill(last);
    Merge { vertices, paths, merges }.of_kind(setting.instruction_set, kind);
}

/// Adds the light of pairs to their samples, vertex by vertex.
fn add(
    vertices: &Vertices<'_>,
    paths: &Paths,
    merges: &Merges,
    radiance: &mut [Spectrum],
    record: &mut Record,
) {
    let mut at = 0;
    while at < merges.len {
        let vertex = merges.vertex[at];
        let first = at;
        let mut sum = Spectrum::BLACK;
        while at < merges.len && merges.vertex[at] == vertex {
            sum += merges.scattered(at);
            at += 1;
        }
        record.note(|| Event::Photons((first..at).map(|pair| merges.merged(pair)).collect()));
        let path = vertices.path[vertex as usize] as usize;
        radiance[paths.slot[path] as usize] +=
            record.added(Source::Caustics, paths.throughput(path), sum, 1.0);
    }
}
