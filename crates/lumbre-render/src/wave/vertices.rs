//! The surfaces that paths met, in columns: all that shading reads of them.

use lumbre_geometry::Surface;
use lumbre_math::{DVec3, Vec3};
use lumbre_shading::{Bsdf, Material, ShadingFrame};
use lumbre_simd::{Double, Real, V3};

use crate::wave::paths::grow;

/// Vertices of paths, each at the position of its path.
#[derive(Debug, Default)]
pub(crate) struct Vertices<'s> {
    pub(crate) point: [Vec<f64>; 3],
    /// How far off the surface rays start: beyond any place where the true surface can be.
    pub(crate) offset: Vec<f64>,
    /// The geometric normal, unit, on the side of the viewer.
    pub(crate) normal: [Vec<f32>; 3],
    /// The shading frame: its x and its z axis.
    pub(crate) frame_s: [Vec<f32>; 3],
    pub(crate) frame_n: [Vec<f32>; 3],
    /// Of [`FOLDS`], [`SIDED`] and [`RISES`].
    pub(crate) flags: Vec<u32>,
    /// Only where [`RISES`] says so: the shading normal before bump maps, on the side of the viewer, and where rays start that leave
    /// below the face but not below the smooth surface.
    pub(crate) smooth: [Vec<f32>; 3],
    pub(crate) risen: [Vec<f64>; 3],
    /// The position of the BSDF in [`Vertices::bsdfs`].
    pub(crate) bsdf: Vec<u32>,
    pub(crate) bsdfs: Vec<Bsdf>,
    /// The solids that surfaces belong to, and whether they were met from outside; empty in scenes without solids.
    pub(crate) solids: Vec<Option<(&'s Material, bool)>>,
    /// The footprint of rays that leave: see [`lumbre_scene::Footprint::Cone`].
    pub(crate) width: Vec<f32>,
    pub(crate) spread: Vec<f32>,
}

/// The shading normal is not the geometric one: directions on the wrong side of the surface are folded back.
pub(crate) const FOLDS: u32 = 1;
/// The shading normal is not the geometric one, which alone says what side a direction is on, as in pbrt.
pub(crate) const SIDED: u32 = 2;
/// The mesh stands for a smooth surface above the face.
pub(crate) const RISES: u32 = 4;

/// A place off which rays start.
#[derive(Clone, Copy)]
pub(crate) struct Place<R: Real> {
    pub(crate) point: V3<R::Double>,
    pub(crate) normal: V3<R>,
    pub(crate) offset: R::Double,
}

/// What normals lose by single precision.
const MORE: f64 = 1.0 + 1e-6;
/// At the origin, where all errors may be 0, the offset is so large that no map makes it 0.
const LEAST_OFFSET: f64 = 1e-250;

/// The distance from a point with an error to where rays start, along its normal: see [`lumbre_math::rounding::offset_point`].
pub(crate) fn offset_of(normal: DVec3, error: DVec3) -> f64 {
    ((normal.abs().dot(error) + 4.0 * error.max_element()) * MORE).max(LEAST_OFFSET)
}

impl<R: Real> Place<R> {
    /// A point with a bound on the error of each of its components, and its normal: see [`offset_of`].
    #[inline(always)]
    pub(crate) fn new(point: V3<R::Double>, error: V3<R::Double>, normal: V3<R>) -> Self {
        let n = normal.to_double();
        let most = error.x.simd_max(error.y).simd_max(error.z);
        let offset = n.x.abs() * error.x + n.y.abs() * error.y + n.z.abs() * error.z;
        let offset = (offset + R::Double::splat(4.0) * most) * R::Double::splat(MORE);
        Self { point, normal, offset: offset.simd_max(R::Double::splat(LEAST_OFFSET)) }
    }

    /// Where a ray starts on the side of a direction; the point itself where there is no normal.
    #[inline(always)]
    pub(crate) fn start(&self, direction: V3<R>) -> V3<R::Double> {
        let side = R::one().copysign(self.normal.dot(direction));
        let along = (self.normal * side).to_double();
        let moved = self.point + along * self.offset;
        // The sum was rounded to nearest, perhaps towards the surface.
        V3 {
            x: moved.x.next_towards_sign(along.x),
            y: moved.y.next_towards_sign(along.y),
            z: moved.z.next_towards_sign(along.z),
        }
    }
}

impl<'s> Vertices<'s> {
    /// Room for the vertices of so many paths.
    pub(crate) fn reset(&mut self, len: usize, has_solids: bool) {
        let f64s = self.point.iter_mut().chain(&mut self.risen).chain([&mut self.offset]);
        f64s.for_each(|column| grow(column, len));
        let vectors = [&mut self.normal, &mut self.frame_s, &mut self.frame_n, &mut self.smooth];
        vectors.into_iter().flatten().for_each(|column| grow(column, len));
        grow(&mut self.flags, len);
        grow(&mut self.bsdf, len);
        grow(&mut self.width, len);
        grow(&mut self.spread, len);
        self.bsdfs.clear();
        self.solids.clear();
        self.solids.resize(if has_solids { len } else { 0 }, None);
    }

    /// Writes down where a path is. The normal of the surface may face either side.
    pub(crate) fn put_place(&mut self, path: usize, surface: &Surface, error: DVec3, towards: DVec3) {
        let normal = surface.normal;
        let facing = if normal.dot(towards) < 0.0 { -normal } else { normal };
        put64(&mut self.point, path, surface.point);
        put(&mut self.normal, path, facing.as_vec3());
        self.offset[path] = offset_of(normal, error);
    }

    /// Writes down how the surface scatters.
    pub(crate) fn put_bsdf(&mut self, path: usize, frame: &ShadingFrame, bsdf: Bsdf, flags: u32) {
        put(&mut self.frame_s, path, frame.s);
        put(&mut self.frame_n, path, frame.n);
        self.flags[path] = flags;
        self.bsdf[path] = self.bsdfs.len() as u32;
        self.bsdfs.push(bsdf);
    }

    /// Writes down where rays start that leave below the face.
    pub(crate) fn put_risen(&mut self, path: usize, smooth: Vec3, risen: DVec3) {
        put(&mut self.smooth, path, smooth);
        put64(&mut self.risen, path, risen);
    }

    /// Where a path is.
    pub(crate) fn point(&self, path: usize) -> DVec3 {
        DVec3::new(self.point[0][path], self.point[1][path], self.point[2][path])
    }

    /// Where paths are.
    #[inline(always)]
    pub(crate) fn place<R: Real>(&self, at: R::UInt) -> Place<R> {
        Place {
            point: gather64::<R>(&self.point, at),
            normal: gather3(&self.normal, at),
            offset: R::Double::gather(&self.offset, at),
        }
    }
}

fn put(columns: &mut [Vec<f32>; 3], path: usize, v: Vec3) {
    for (column, x) in columns.iter_mut().zip(v.to_array()) {
        column[path] = x;
    }
}

fn put64(columns: &mut [Vec<f64>; 3], path: usize, v: DVec3) {
    for (column, x) in columns.iter_mut().zip(v.to_array()) {
        column[path] = x;
    }
}

/// A vector of each lane.
#[inline(always)]
pub(crate) fn gather3<R: Real>(columns: &[Vec<f32>; 3], at: R::UInt) -> V3<R> {
    V3 { x: R::gather(&columns[0], at), y: R::gather(&columns[1], at), z: R::gather(&columns[2], at) }
}

/// A vector in double precision of each lane.
#[inline(always)]
pub(crate) fn gather64<R: Real>(columns: &[Vec<f64>; 3], at: R::UInt) -> V3<R::Double> {
    V3 {
        x: R::Double::gather(&columns[0], at),
        y: R::Double::gather(&columns[1], at),
        z: R::Double::gather(&columns[2], at),
    }
}
