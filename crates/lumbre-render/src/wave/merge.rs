//! Photons near vertices: light from lamps that came over mirrors and smooth glass.

use std::f32::consts::FRAC_1_SQRT_2;
use std::marker::PhantomData;

use lumbre_math::Vec3;
use lumbre_shading::Spectrum;
use lumbre_shading::lanes::{BsdfKind, LaneBsdf};
use lumbre_simd::{Job, Real, UInt, V3};

use crate::caustics::{Merging, Photon, radius};
use crate::transport::Record;
use crate::transport::journal::Source;
use crate::wave::flat::put3;
use crate::wave::paths::{PAD, Paths, SCATTERED, grow};
use crate::wave::setting::Setting;
use crate::wave::shade::{Kind, Vertex};
use crate::wave::vertices::{Vertices, gather3};
use crate::wave::{KINDS, Wave};

/// Photons that are merged at a time, about.
const BATCH: usize = 1 << 14;
/// Light that grazes a surface more than this is taken as if it did not.
const MIN_COSINE: f32 = 1e-3;

/// Pairs of a vertex and a photon near it, in columns.
#[derive(Debug, Default)]
pub(crate) struct Merges {
    len: usize,
    vertex: Vec<u32>,
    /// Where the photon came from.
    towards: [Vec<f32>; 3],
    /// Its irradiance over the disk around the vertex, by the area that the light is perpendicular to.
    light: [Vec<f32>; 3],
    /// What a density of directions of the vertex becomes one of pairs by, over the density of the photon's light path.
    share: Vec<f32>,
    /// What the vertex scatters of it.
    scattered: [Vec<f32>; 3],
}

impl Merges {
    fn push(&mut self, vertex: u32, photon: &Photon, spread: f32) {
        if self.vertex.len() < self.len + 1 + PAD {
            let len = 2 * (self.len + PAD);
            let columns = self.towards.iter_mut().chain(&mut self.light).chain(&mut self.scattered);
            columns.chain([&mut self.share]).for_each(|column| grow(column, len));
            grow(&mut self.vertex, len);
        }
        let at = self.len;
        self.len += 1;
        self.vertex[at] = vertex;
        let cosine = photon.normal.dot(photon.towards).max(MIN_COSINE);
        for (column, x) in self.towards.iter_mut().zip(photon.towards.to_array()) {
            column[at] = x;
        }
        for (column, x) in self.light.iter_mut().zip((photon.flux * (spread / cosine)).to_array()) {
            column[at] = x;
        }
        self.share[at] = spread / photon.density;
    }

    fn scattered(&self, at: usize) -> Spectrum {
        Spectrum::new(self.scattered[0][at], self.scattered[1][at], self.scattered[2][at])
    }
}

impl<'s> Wave<'s> {
    /// Adds the light of photons near the vertices that are to be shaded.
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
        // The bounce of the vertex is one, too.
        let bounces_left = setting.max_depth.saturating_sub((depth & !SCATTERED) + 1);
        let normal = Vec3::from_array(self.vertices.normal.each_ref().map(|column| column[at]));
        let spread = merging.spread(radius);
        if !spread.is_finite() {
            return;
        }
        photons.within(self.vertices.point(at), radius.into(), |photon| {
            // What lies around a corner is of another surface.
            let is_level = photon.normal.dot(normal).abs() >= FRAC_1_SQRT_2;
            if is_level && photon.bounces <= bounces_left {
                merges.push(vertex, photon, spread);
            }
        });
    }
}

/// Finds what vertices scatter of the photons near them.
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
    // A vector reads beyond the last.
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
        let mut sum = Spectrum::BLACK;
        while at < merges.len && merges.vertex[at] == vertex {
            sum += merges.scattered(at);
            at += 1;
        }
        let path = vertices.path[vertex as usize] as usize;
        radiance[paths.slot[path] as usize] +=
            record.added(Source::Caustics, paths.throughput(path), sum, 1.0);
    }
}

/// Evaluates BSDFs at pairs.
pub(super) struct Merge<'a, 's> {
    vertices: &'a Vertices<'s>,
    paths: &'a Paths,
    merges: &'a mut Merges,
}

/// [`Merge`] with BSDFs of one kind, at any instruction set.
pub(super) struct MergeKind<'a, 's, K> {
    pub(super) merge: Merge<'a, 's>,
    pub(super) kind: PhantomData<K>,
}

impl<K: Kind> Job for MergeKind<'_, '_, K> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Merge { vertices, paths, merges } = self.merge;
        let mut done = 0;
        while done < merges.len {
            let vertex_at = R::UInt::from_slice(&merges.vertex[done..]);
            let at = R::UInt::gather(&vertices.path, vertex_at);
            let vertex = Vertex::new(vertices, vertex_at, -gather3::<R>(&paths.direction, at));
            let bsdf = K::Bsdf::<R>::load(&vertices.rows, R::UInt::gather(&vertices.bsdf, vertex_at));
            let scattered = vertex.eval(&bsdf, load3(&merges.towards, done));
            let weight = (R::one() + scattered.pdf * R::from_slice(&merges.share[done..])).recip();
            let light = load3::<R>(&merges.light, done) * scattered.f * weight;
            put3(&mut merges.scattered, done, light);
            done += R::LANES;
        }
    }
}

#[inline(always)]
fn load3<R: Real>(columns: &[Vec<f32>; 3], at: usize) -> V3<R> {
    V3 {
        x: R::from_slice(&columns[0][at..]),
        y: R::from_slice(&columns[1][at..]),
        z: R::from_slice(&columns[2][at..]),
    }
}
