//! The state of paths, in columns.

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Vec3};
use lumbre_scene::{Boundary, Footprint, MediumId, SamplerKind};
use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::{SpectralLookup, WavelengthDensity, Wavelengths};
use lumbre_simd::{Double, Mask, Real, UInt, V3};

use crate::transport::interior::MediumStack;
use crate::transport::{SampleNumbers, Sampler};

/// Padding of columns: a store writes whole vectors.
pub(crate) const PAD: usize = 16;

/// Resizes a column to `len` numbers plus one vector.
pub(crate) fn grow<T: Default + Clone>(column: &mut Vec<T>, len: usize) {
    if column.len() < len + PAD {
        column.resize(len + PAD, T::default());
    }
}

/// The medium index that means vacuum.
const VACUUM: u32 = u32::MAX;

pub(crate) fn to_column(medium: Option<MediumId>) -> u32 {
    medium.map_or(VACUUM, |id| id.0)
}

pub(crate) fn of_column(medium: u32) -> Option<MediumId> {
    (medium != VACUUM).then_some(MediumId(medium))
}

/// The media on both sides of a surface, as columns store them: first the side that the path comes from, then the far
/// side. `around` is the medium of both if the surface is no boundary.
pub(crate) fn sides(boundary: Option<Boundary>, front: bool, around: u32) -> [u32; 2] {
    match boundary {
        None => [around; 2],
        Some(Boundary { inside, outside }) if front => [outside, inside].map(to_column),
        Some(Boundary { inside, outside }) => [inside, outside].map(to_column),
    }
}

/// A sample of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SampleId {
    /// Column of the pixel.
    pub(crate) x: u32,
    /// Row of the pixel.
    pub(crate) y: u32,
    /// The number of the sample.
    pub(crate) index: u32,
}

/// The data of a sample that lasts as long as its path.
#[derive(Debug, Default)]
pub(crate) struct Slots<'s> {
    /// How many samples there are.
    pub(crate) len: usize,
    /// The inputs of its random numbers: the sampler's kind, words of the pixel, and the number of the sample.
    kind: SamplerKind,
    pub(crate) pixel: [Vec<u32>; 2],
    pub(crate) index: Vec<u32>,
    /// The time of its rays.
    pub(crate) time: Vec<f64>,
    /// The footprints of camera rays; empty in a scene without textures.
    pub(crate) footprints: Vec<Footprint>,
    /// Whether these are footprints of rays from one point, with these directions to the right and below.
    pub(crate) has_neighbours: bool,
    pub(crate) neighbours: [[Vec<f64>; 3]; 2],
    /// The light that the path has found.
    pub(crate) radiance: Vec<Spectrum>,
    /// The solids around the path; empty in a scene without solids.
    pub(crate) interiors: Vec<MediumStack<'s>>,
    /// The medium around the path, as [`of_column`] reads it; empty in a scene without media.
    pub(crate) medium: Vec<u32>,
    /// The wavelengths of the channels; empty in RGB.
    pub(crate) wavelengths: Vec<Wavelengths>,
    /// Whether only the hero wavelength continues, after a refraction by its own index; empty in RGB.
    pub(crate) is_alone: Vec<bool>,
    /// Number of distances sampled in media, and of collisions inside solids.
    pub(crate) distance_samples: Vec<u32>,
    pub(crate) collisions: Vec<u32>,
    /// The radius in which photons are collected, per width of a footprint; empty without photons.
    pub(crate) widths: Vec<f32>,
}

impl Slots<'_> {
    /// Replaces all samples.
    pub(crate) fn start(&mut self, sampler: &Sampler, ids: &[SampleId]) {
        (self.len, self.kind) = (ids.len(), sampler.kind());
        self.pixel.iter_mut().chain([&mut self.index]).for_each(|column| grow(column, ids.len()));
        for (slot, id) in ids.iter().enumerate() {
            [self.pixel[0][slot], self.pixel[1][slot]] = sampler.pixel(id.x, id.y);
            self.index[slot] = id.index;
        }
        fill(&mut self.time, ids.len(), 0.0);
        fill(&mut self.radiance, ids.len(), Spectrum::BLACK);
        self.footprints.clear();
        self.has_neighbours = false;
        self.interiors.clear();
        self.medium.clear();
        self.wavelengths.clear();
        self.is_alone.clear();
        self.distance_samples.clear();
        self.collisions.clear();
        self.widths.clear();
    }

    /// Chooses the wavelengths of all samples by a number each.
    pub(crate) fn choose_wavelengths(
        &mut self,
        density: WavelengthDensity,
        numbers: impl Iterator<Item = f32>,
    ) {
        self.wavelengths.extend(numbers.take(self.len).map(|u| density.sample(u)));
        self.is_alone.resize(self.len, false);
    }

    /// Starts all paths outside of solids.
    pub(crate) fn start_outside(&mut self) {
        let wavelengths = (0..self.len).map(|slot| self.wavelengths.get(slot).copied());
        self.interiors.extend(wavelengths.map(MediumStack::of));
        self.collisions.resize(self.len, 0);
        self.distance_samples.resize(self.len, 0);
    }

    /// Starts all paths in a medium.
    pub(crate) fn start_in(&mut self, medium: Option<MediumId>) {
        self.medium.resize(self.len, to_column(medium));
        self.distance_samples.resize(self.len, 0);
    }

    /// The random numbers of a sample, for code that handles one path at a time.
    #[inline]
    pub(crate) fn numbers(&self, slot: usize) -> SampleNumbers {
        SampleNumbers::new(self.kind, [self.pixel[0][slot], self.pixel[1][slot]], self.index[slot])
    }

    /// The footprint of a sample's camera ray, which starts at `origin`.
    pub(crate) fn footprint(&self, slot: usize, origin: DVec3) -> Footprint {
        if !self.has_neighbours {
            return self.footprints.get(slot).copied().unwrap_or_default();
        }
        let [x_direction, y_direction] = self.neighbours.each_ref().map(|columns| at(columns, slot));
        Footprint::Neighbours { x_origin: origin, x_direction, y_origin: origin, y_direction }
    }

    /// How a sample looks up spectra; `None` in RGB.
    pub(crate) fn spectral(&self, slot: usize) -> Option<SpectralLookup> {
        let wavelengths = *self.wavelengths.get(slot)?;
        Some(SpectralLookup { wavelengths, is_unbounded: false })
    }
}

/// A vector of columns.
fn at(columns: &[Vec<f64>; 3], at: usize) -> DVec3 {
    DVec3::new(columns[0][at], columns[1][at], columns[2][at])
}

/// Fills a list with `len` copies of a value.
fn fill<T: Clone>(column: &mut Vec<T>, len: usize, value: T) {
    column.clear();
    column.resize(len, value);
}

/// A ray with the direction that a path has: in single precision. All facts of the ray are those of the rounded one.
pub(crate) fn rounded(mut ray: Ray) -> Ray {
    ray.direction = ray.direction.as_vec3().as_dvec3();
    ray
}

/// The active paths, each with its next ray.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    pub(crate) len: usize,
    /// The sample of the path: an index into [`Slots`].
    pub(crate) slot: Vec<u32>,
    /// The origin of the ray, from which lights were sampled too.
    pub(crate) origin: [Vec<f64>; 3],
    /// The normal at the origin for which lights were sampled, zero if they were sampled for every direction: see
    /// [`lumbre_scene::light::lanes::Receiver`].
    pub(crate) receiver_normal: [Vec<f32>; 3],
    /// Unit.
    pub(crate) direction: [Vec<f32>; 3],
    pub(crate) throughput: [Vec<f32>; 3],
    /// The factor of refraction in the throughput, which is undone when the path leaves again.
    pub(crate) eta_scale: Vec<f32>,
    /// The density of the chosen direction; infinite if it was the only one.
    pub(crate) pdf: Vec<f32>,
    /// For light found behind specular surfaces: the density of the direction before them, divided by the number of
    /// light paths of a pass and by the area (in a medium: volume, per length) in which photons are collected there.
    /// Infinite if photons do not find that light.
    pub(crate) merge_pdf: Vec<f32>,
    /// Bounces off surfaces, and [`SCATTERED`].
    pub(crate) depth: Vec<u32>,
    /// The width of the footprint at the origin, and its growth with distance: see [`lumbre_scene::Footprint::Cone`].
    pub(crate) width: Vec<f32>,
    pub(crate) spread: Vec<f32>,
}

/// The bit of [`Paths::depth`] set once the path has had a non-specular bounce.
pub(crate) const SCATTERED: u32 = 1 << 31;

/// What a path keeps from a vertex.
#[derive(Clone, Copy)]
pub(crate) struct Departure<R: Real> {
    pub(crate) slot: R::UInt,
    pub(crate) origin: V3<R::Double>,
    pub(crate) receiver_normal: V3<R>,
    pub(crate) direction: V3<R>,
    pub(crate) throughput: V3<R>,
    pub(crate) eta_scale: R,
    pub(crate) pdf: R,
    pub(crate) merge_pdf: R,
    pub(crate) depth: R::UInt,
    pub(crate) width: R,
    pub(crate) spread: R,
}

/// One path: see [`Paths`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnePath {
    pub(crate) slot: u32,
    pub(crate) origin: DVec3,
    pub(crate) receiver_normal: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) throughput: Spectrum,
    pub(crate) eta_scale: f32,
    pub(crate) pdf: f32,
    pub(crate) merge_pdf: f32,
    pub(crate) depth: u32,
    pub(crate) width: f32,
    pub(crate) spread: f32,
}

/// A collision of a path in a medium.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Collision {
    /// The index of the path.
    pub(crate) path: u32,
    pub(crate) point: DVec3,
    pub(crate) medium: MediumId,
    /// The width of the footprint there.
    pub(crate) width: f32,
}

impl Paths {
    /// Replaces all paths by one from each of `len` samples, whose rays the caller sets.
    pub(crate) fn start(&mut self, len: usize) {
        self.reserve(len);
        self.len = len;
        self.slot[..len].iter_mut().zip(0..).for_each(|(to, slot)| *to = slot);
        self.receiver_normal.iter_mut().for_each(|column| column[..len].fill(0.0));
        self.throughput.iter_mut().for_each(|column| column[..len].fill(1.0));
        self.eta_scale[..len].fill(1.0);
        self.pdf[..len].fill(f32::INFINITY);
        self.merge_pdf[..len].fill(f32::INFINITY);
        self.depth[..len].fill(0);
        self.width[..len].fill(0.0);
        self.spread[..len].fill(0.0);
    }

    /// Appends a path; the columns must have been reserved.
    pub(crate) fn push_one(&mut self, path: &OnePath) {
        self.put(self.len, path);
        self.len += 1;
    }

    /// Removes the paths at these ascending indices.
    pub(crate) fn remove(&mut self, positions: &[u32]) {
        let mut positions = positions.iter().peekable();
        let mut kept = 0;
        for at in 0..self.len {
            if positions.next_if(|&&position| position as usize == at).is_none() {
                let path = self.get(at);
                self.put(kept, &path);
                kept += 1;
            }
        }
        self.len = kept;
    }

    /// Sets the ray of a path, and the cone around it.
    pub(crate) fn set_ray(
        &mut self,
        path: usize,
        origin: DVec3,
        direction: Vec3,
        (width, spread): (f32, f32),
    ) {
        self.origin.iter_mut().zip(origin.to_array()).for_each(|(column, x)| column[path] = x);
        self.direction.iter_mut().zip(direction.to_array()).for_each(|(column, x)| column[path] = x);
        (self.width[path], self.spread[path]) = (width, spread);
    }

    /// The path at a position.
    pub(crate) fn get(&self, at: usize) -> OnePath {
        OnePath {
            slot: self.slot[at],
            origin: self.origin(at),
            receiver_normal: self.receiver_normal(at),
            direction: self.direction(at),
            throughput: self.throughput(at),
            eta_scale: self.eta_scale[at],
            pdf: self.pdf[at],
            merge_pdf: self.merge_pdf[at],
            depth: self.depth[at],
            width: self.width[at],
            spread: self.spread[at],
        }
    }

    fn put(&mut self, at: usize, path: &OnePath) {
        self.slot[at] = path.slot;
        for (column, x) in self.origin.iter_mut().zip(path.origin.to_array()) {
            column[at] = x;
        }
        for (column, x) in self.receiver_normal.iter_mut().zip(path.receiver_normal.to_array()) {
            column[at] = x;
        }
        for (column, x) in self.direction.iter_mut().zip(path.direction.to_array()) {
            column[at] = x;
        }
        self.set_throughput(at, path.throughput);
        self.eta_scale[at] = path.eta_scale;
        self.pdf[at] = path.pdf;
        self.merge_pdf[at] = path.merge_pdf;
        self.depth[at] = path.depth;
        self.width[at] = path.width;
        self.spread[at] = path.spread;
    }

    /// Reserves `len` paths.
    pub(crate) fn reserve(&mut self, len: usize) {
        grow(&mut self.slot, len);
        self.origin.iter_mut().for_each(|column| grow(column, len));
        self.receiver_normal.iter_mut().for_each(|column| grow(column, len));
        self.direction.iter_mut().for_each(|column| grow(column, len));
        self.throughput.iter_mut().for_each(|column| grow(column, len));
        let f32s =
            [&mut self.eta_scale, &mut self.pdf, &mut self.merge_pdf, &mut self.width, &mut self.spread];
        for column in f32s {
            grow(column, len);
        }
        grow(&mut self.depth, len);
    }

    /// Appends the lanes of a mask.
    #[inline(always)]
    pub(crate) fn push<R: Real>(&mut self, mask: R::Mask, path: &Departure<R>) {
        let to = self.len;
        path.slot.compress_store(mask, &mut self.slot[to..]);
        path.origin.x.compress_store(mask, &mut self.origin[0][to..]);
        path.origin.y.compress_store(mask, &mut self.origin[1][to..]);
        path.origin.z.compress_store(mask, &mut self.origin[2][to..]);
        path.receiver_normal.x.compress_store(mask, &mut self.receiver_normal[0][to..]);
        path.receiver_normal.y.compress_store(mask, &mut self.receiver_normal[1][to..]);
        path.receiver_normal.z.compress_store(mask, &mut self.receiver_normal[2][to..]);
        path.direction.x.compress_store(mask, &mut self.direction[0][to..]);
        path.direction.y.compress_store(mask, &mut self.direction[1][to..]);
        path.direction.z.compress_store(mask, &mut self.direction[2][to..]);
        path.throughput.x.compress_store(mask, &mut self.throughput[0][to..]);
        path.throughput.y.compress_store(mask, &mut self.throughput[1][to..]);
        path.throughput.z.compress_store(mask, &mut self.throughput[2][to..]);
        path.eta_scale.compress_store(mask, &mut self.eta_scale[to..]);
        path.pdf.compress_store(mask, &mut self.pdf[to..]);
        path.merge_pdf.compress_store(mask, &mut self.merge_pdf[to..]);
        path.depth.compress_store(mask, &mut self.depth[to..]);
        path.width.compress_store(mask, &mut self.width[to..]);
        path.spread.compress_store(mask, &mut self.spread[to..]);
        self.len += mask.count();
    }

    /// The next ray of a path.
    pub(crate) fn ray(&self, path: usize, time: f64) -> Ray {
        Ray::new(self.origin(path), self.direction(path).as_dvec3()).at_time(time)
    }

    pub(crate) fn origin(&self, path: usize) -> DVec3 {
        at(&self.origin, path)
    }

    pub(crate) fn receiver_normal(&self, path: usize) -> Vec3 {
        Vec3::new(self.receiver_normal[0][path], self.receiver_normal[1][path], self.receiver_normal[2][path])
    }

    pub(crate) fn direction(&self, path: usize) -> Vec3 {
        Vec3::new(self.direction[0][path], self.direction[1][path], self.direction[2][path])
    }

    pub(crate) fn throughput(&self, path: usize) -> Spectrum {
        Spectrum::new(self.throughput[0][path], self.throughput[1][path], self.throughput[2][path])
    }

    pub(crate) fn set_throughput(&mut self, path: usize, throughput: Spectrum) {
        for (column, channel) in self.throughput.iter_mut().zip(throughput.to_array()) {
            column[path] = channel;
        }
    }
}
