//! The state of paths, in columns.

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Vec3};
use lumbre_scene::{Boundary, CameraRay, Footprint, MediumId};
use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::{SpectralLookup, Wavelengths};
use lumbre_simd::{Double, Mask, Real, UInt, V3};

use crate::transport::Draw;
use crate::transport::interior::Interiors;

/// Lanes beyond the last that a column has room for: a store writes whole vectors.
pub(crate) const PAD: usize = 16;

/// Makes a column hold `len` numbers, and a vector more.
pub(crate) fn grow<T: Default + Clone>(column: &mut Vec<T>, len: usize) {
    if column.len() < len + PAD {
        column.resize(len + PAD, T::default());
    }
}

/// A medium in a column: its index, or this for a vacuum.
const VACUUM: u32 = u32::MAX;

pub(crate) fn to_column(medium: Option<MediumId>) -> u32 {
    medium.map_or(VACUUM, |id| id.0)
}

pub(crate) fn of_column(medium: u32) -> Option<MediumId> {
    (medium != VACUUM).then_some(MediumId(medium))
}

/// The media where a path comes from and behind the surface that it met, as columns keep them, inside of `around` before.
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

/// What belongs to a sample for as long as its path goes on.
#[derive(Debug, Default)]
pub(crate) struct Slots<'s> {
    /// Its random numbers, for code that takes one path at a time.
    pub(crate) draws: Vec<Draw>,
    /// The words of [`Draw`], for lanes: those of the pixel, and the number of the sample.
    pub(crate) pixel: [Vec<u32>; 2],
    pub(crate) index: Vec<u32>,
    /// When its rays look.
    pub(crate) time: Vec<f64>,
    /// The ray from the camera, and its footprint; none in a scene without textures.
    pub(crate) rays: Vec<Ray>,
    pub(crate) footprints: Vec<Footprint>,
    /// The light that the path has found.
    pub(crate) radiance: Vec<Spectrum>,
    /// The solids that it is inside of; empty in a scene without solids.
    pub(crate) interiors: Vec<Interiors<'s>>,
    /// The medium around, as [`of_column`] reads it; empty in a scene without media.
    pub(crate) medium: Vec<u32>,
    /// The wavelengths that channels are; none in RGB.
    pub(crate) wavelengths: Vec<Wavelengths>,
    /// Whether the hero wavelength goes on alone, once it was bent by an index of its own; none in RGB.
    pub(crate) is_alone: Vec<bool>,
    /// Distances sampled in media, and collisions inside solids.
    pub(crate) distance_samples: Vec<u32>,
    pub(crate) collisions: Vec<u32>,
    /// The radius in which photons are collected, per width of a footprint; only where there are photons.
    pub(crate) widths: Vec<f32>,
}

impl Slots<'_> {
    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        self.draws.clear();
        self.pixel.iter_mut().for_each(Vec::clear);
        self.index.clear();
        self.time.clear();
        self.rays.clear();
        self.footprints.clear();
        self.radiance.clear();
        self.interiors.clear();
        self.medium.clear();
        self.wavelengths.clear();
        self.is_alone.clear();
        self.distance_samples.clear();
        self.collisions.clear();
        self.widths.clear();
    }

    /// The ray from the camera of a sample.
    pub(crate) fn camera(&self, slot: usize) -> CameraRay {
        let footprint = self.footprints.get(slot).copied().unwrap_or_default();
        CameraRay { ray: self.rays[slot], footprint, weight: 1.0 }
    }

    /// What colours are to a sample; `None` in RGB.
    pub(crate) fn spectral(&self, slot: usize) -> Option<SpectralLookup> {
        let wavelengths = *self.wavelengths.get(slot)?;
        Some(SpectralLookup { wavelengths, is_unbounded: false })
    }

    /// Adds a sample. In a scene with media, `medium` is what the camera stands in; in a spectral render it has wavelengths.
    pub(crate) fn push(
        &mut self,
        draw: Draw,
        camera: &CameraRay,
        has_solids: bool,
        medium: Option<u32>,
        wavelengths: Option<Wavelengths>,
    ) {
        let (pixel, index) = draw.words();
        self.draws.push(draw);
        self.pixel[0].push(pixel[0]);
        self.pixel[1].push(pixel[1]);
        self.index.push(index);
        self.time.push(camera.ray.time);
        self.rays.push(camera.ray);
        if camera.footprint != Footprint::Point {
            // The rays before that have none, such as those that a lens stops, keep their places.
            self.footprints.resize(self.rays.len() - 1, Footprint::Point);
            self.footprints.push(camera.footprint);
        }
        self.radiance.push(Spectrum::BLACK);
        if has_solids {
            self.interiors.push(Interiors::of(wavelengths));
            self.collisions.push(0);
        }
        self.medium.extend(medium);
        self.wavelengths.extend(wavelengths);
        self.is_alone.extend(wavelengths.map(|_| false));
        if has_solids || medium.is_some() {
            self.distance_samples.push(0);
        }
    }
}

/// Paths on their way, each with the ray that it follows next.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    pub(crate) len: usize,
    /// Whose path it is: a position in [`Slots`].
    pub(crate) slot: Vec<u32>,
    /// Where the ray starts; lights were sampled from there, too.
    pub(crate) origin: [Vec<f64>; 3],
    /// The normal there that lights were sampled for: see [`lumbre_scene::light::lanes::Receiver`].
    pub(crate) receiver: [Vec<f32>; 3],
    /// Unit.
    pub(crate) direction: [Vec<f32>; 3],
    pub(crate) throughput: [Vec<f32>; 3],
    /// What refraction did to the throughput alone: it comes back when the path leaves again.
    pub(crate) eta_scale: Vec<f32>,
    /// The density with which the direction was chosen; infinite where it was the only one.
    pub(crate) pdf: Vec<f32>,
    /// For light that is found behind specular surfaces: the density with which the direction before them was chosen, over the number of
    /// lines of a pass and the area in which photons are collected there (the volume, per length, in a medium). Infinite where photons do not
    /// bring that light.
    pub(crate) merging: Vec<f32>,
    /// Bounces off surfaces, and [`SCATTERED`].
    pub(crate) depth: Vec<u32>,
    /// The width of the footprint where the ray starts, and its growth with distance: see [`lumbre_scene::Footprint::Cone`].
    pub(crate) width: Vec<f32>,
    pub(crate) spread: Vec<f32>,
}

/// The bit of [`Paths::depth`] that says that the path has scattered otherwise than by mirrors and smooth glass.
pub(crate) const SCATTERED: u32 = 1 << 31;

/// What a path takes along from a vertex.
#[derive(Clone, Copy)]
pub(crate) struct Departure<R: Real> {
    pub(crate) slot: R::UInt,
    pub(crate) origin: V3<R::Double>,
    pub(crate) receiver: V3<R>,
    pub(crate) direction: V3<R>,
    pub(crate) throughput: V3<R>,
    pub(crate) eta_scale: R,
    pub(crate) pdf: R,
    pub(crate) merging: R,
    pub(crate) depth: R::UInt,
    pub(crate) width: R,
    pub(crate) spread: R,
}

/// One path: see [`Paths`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnePath {
    pub(crate) slot: u32,
    pub(crate) origin: DVec3,
    pub(crate) receiver: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) throughput: Spectrum,
    pub(crate) eta_scale: f32,
    pub(crate) pdf: f32,
    pub(crate) merging: f32,
    pub(crate) depth: u32,
    pub(crate) width: f32,
    pub(crate) spread: f32,
}

/// Where a medium scatters a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Collision {
    /// The position of the path.
    pub(crate) path: u32,
    pub(crate) point: DVec3,
    pub(crate) medium: MediumId,
    /// The width of the footprint there.
    pub(crate) width: f32,
}

impl Paths {
    /// Appends a path, for which there is room.
    pub(crate) fn push_one(&mut self, path: &OnePath) {
        self.put(self.len, path);
        self.len += 1;
    }

    /// Drops the paths at some positions, which ascend.
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

    /// The path at a position.
    pub(crate) fn get(&self, at: usize) -> OnePath {
        OnePath {
            slot: self.slot[at],
            origin: self.origin(at),
            receiver: self.receiver(at),
            direction: self.direction(at),
            throughput: self.throughput(at),
            eta_scale: self.eta_scale[at],
            pdf: self.pdf[at],
            merging: self.merging[at],
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
        for (column, x) in self.receiver.iter_mut().zip(path.receiver.to_array()) {
            column[at] = x;
        }
        for (column, x) in self.direction.iter_mut().zip(path.direction.to_array()) {
            column[at] = x;
        }
        self.set_throughput(at, path.throughput);
        self.eta_scale[at] = path.eta_scale;
        self.pdf[at] = path.pdf;
        self.merging[at] = path.merging;
        self.depth[at] = path.depth;
        self.width[at] = path.width;
        self.spread[at] = path.spread;
    }

    /// Makes room for `len` paths.
    pub(crate) fn reserve(&mut self, len: usize) {
        grow(&mut self.slot, len);
        self.origin.iter_mut().for_each(|column| grow(column, len));
        self.receiver.iter_mut().for_each(|column| grow(column, len));
        self.direction.iter_mut().for_each(|column| grow(column, len));
        self.throughput.iter_mut().for_each(|column| grow(column, len));
        let f32s = [&mut self.eta_scale, &mut self.pdf, &mut self.merging, &mut self.width, &mut self.spread];
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
        path.receiver.x.compress_store(mask, &mut self.receiver[0][to..]);
        path.receiver.y.compress_store(mask, &mut self.receiver[1][to..]);
        path.receiver.z.compress_store(mask, &mut self.receiver[2][to..]);
        path.direction.x.compress_store(mask, &mut self.direction[0][to..]);
        path.direction.y.compress_store(mask, &mut self.direction[1][to..]);
        path.direction.z.compress_store(mask, &mut self.direction[2][to..]);
        path.throughput.x.compress_store(mask, &mut self.throughput[0][to..]);
        path.throughput.y.compress_store(mask, &mut self.throughput[1][to..]);
        path.throughput.z.compress_store(mask, &mut self.throughput[2][to..]);
        path.eta_scale.compress_store(mask, &mut self.eta_scale[to..]);
        path.pdf.compress_store(mask, &mut self.pdf[to..]);
        path.merging.compress_store(mask, &mut self.merging[to..]);
        path.depth.compress_store(mask, &mut self.depth[to..]);
        path.width.compress_store(mask, &mut self.width[to..]);
        path.spread.compress_store(mask, &mut self.spread[to..]);
        self.len += mask.count();
    }

    /// The ray that a path follows next.
    pub(crate) fn ray(&self, path: usize, time: f64) -> Ray {
        Ray::new(self.origin(path), self.direction(path).as_dvec3()).at_time(time)
    }

    pub(crate) fn origin(&self, path: usize) -> DVec3 {
        DVec3::new(self.origin[0][path], self.origin[1][path], self.origin[2][path])
    }

    pub(crate) fn receiver(&self, path: usize) -> Vec3 {
        Vec3::new(self.receiver[0][path], self.receiver[1][path], self.receiver[2][path])
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
