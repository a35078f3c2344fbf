//! Pairs of a vertex and a nearby photon, evaluated in lanes.

use std::marker::PhantomData;

use lumbre_math::Vec3;
use lumbre_shading::Spectrum;
use lumbre_simd::{Job, Real, UInt, V3};

use crate::caustics::Photon;
use crate::transport::journal::MergedPhoton;
use crate::wave::flat::put3;
use crate::wave::paths::{PAD, Paths, grow};
use crate::wave::shade::{Kind, Vertex};
use crate::wave::vertices::{Vertices, gather3};

/// Light that grazes a surface more than this counts as if it arrived at this cosine.
const MIN_COSINE: f32 = 1e-3;

/// Pairs of a vertex and a nearby photon, in columns.
#[derive(Debug, Default)]
pub(crate) struct Merges {
    pub(super) len: usize,
    pub(super) vertex: Vec<u32>,
    /// The direction that the photon came from.
    towards: [Vec<f32>; 3],
    /// Its irradiance over the disk around the vertex, on an area perpendicular to the light.
    light: [Vec<f32>; 3],
    /// Converts the vertex's density of directions to one of pairs, relative to the density of the photon's light path.
    share: Vec<f32>,
    /// Its weight against paths that find its light, and what the vertex scatters of it.
    weight: Vec<f32>,
    scattered: [Vec<f32>; 3],
}

impl Merges {
    pub(super) fn push(&mut self, vertex: u32, is_alone: bool, photon: &Photon, spread: f32) {
        if self.vertex.len() < self.len + 1 + PAD {
            let len = 2 * (self.len + PAD);
            let columns = self.towards.iter_mut().chain(&mut self.light).chain(&mut self.scattered);
            columns.chain([&mut self.share, &mut self.weight]).for_each(|column| grow(column, len));
            grow(&mut self.vertex, len);
        }
        let at = self.len;
        self.len += 1;
        self.vertex[at] = vertex;
        let cosine = photon.normal.dot(photon.towards).max(MIN_COSINE);
        for (column, x) in self.towards.iter_mut().zip(photon.towards.to_array()) {
            column[at] = x;
        }
        for (column, x) in
            self.light.iter_mut().zip((photon.flux_for(is_alone) * (spread / cosine)).to_array())
        {
            column[at] = x;
        }
        self.share[at] = spread / photon.density;
    }

    /// A pair as an event for the journal.
    pub(super) fn merged(&self, at: usize) -> MergedPhoton {
        let [x, y, z] = self.towards.each_ref().map(|column| column[at]);
        let [r, g, b] = self.light.each_ref().map(|column| column[at]);
        MergedPhoton {
            towards: Vec3::new(x, y, z),
            irradiance: Spectrum::new(r, g, b),
            weight: self.weight[at],
            scattered: self.scattered(at),
        }
    }

    pub(super) fn scattered(&self, at: usize) -> Spectrum {
        Spectrum::new(self.scattered[0][at], self.scattered[1][at], self.scattered[2][at])
    }
}

/// Evaluates BSDFs at pairs.
pub(super) struct Merge<'a, 's> {
    pub(super) vertices: &'a Vertices<'s>,
    pub(super) paths: &'a Paths,
    pub(super) merges: &'a mut Merges,
}

/// [`Merge`] with BSDFs of one kind, for any instruction set.
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
            let bsdf: K::Bsdf<R> = vertices.rows.load(R::UInt::gather(&vertices.bsdf, vertex_at));
            let scattered = vertex.eval(&bsdf, load3(&merges.towards, done));
            let weight = (R::one() + scattered.pdf * R::from_slice(&merges.share[done..])).recip();
            let light = load3::<R>(&merges.light, done) * scattered.f * weight;
            put3(&mut merges.scattered, done, light);
            weight.copy_to_slice(&mut merges.weight[done..]);
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
