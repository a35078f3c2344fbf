//! The surfaces that paths met, in columns: everything that shading reads.

use lumbre_geometry::Surface;
use lumbre_math::{DVec3, Vec3};
use lumbre_shading::lanes::{BsdfKind, Rows};
use lumbre_shading::{Bsdf, HomogeneousMedium, ShadingFrame};
use lumbre_simd::{Double, Real, V3};

use crate::transport::interior::Solid;
use crate::wave::paths::grow;

/// Vertices of paths.
#[derive(Debug, Default)]
pub(crate) struct Vertices<'s> {
    pub(crate) len: usize,
    /// The index of the path.
    pub(crate) path: Vec<u32>,
    pub(crate) point: [Vec<f64>; 3],
    /// The offset of ray origins from the point: beyond any possible true surface.
    pub(crate) offset: Vec<f64>,
    /// The geometric normal, unit, on the side of the viewer.
    pub(crate) normal: [Vec<f32>; 3],
    /// The shading frame: its x and its z axis.
    pub(crate) frame_s: [Vec<f32>; 3],
    pub(crate) frame_n: [Vec<f32>; 3],
    /// A combination of [`FOLDS`], [`SIDED`], [`HAS_TERMINATOR_OFFSET`] and [`LIT_FROM_BELOW`].
    pub(crate) flags: Vec<u32>,
    /// Only with [`HAS_TERMINATOR_OFFSET`]: the shading normal before bump maps, on the side of the viewer, and the
    /// origin of rays that leave below the face but above the smooth surface.
    pub(crate) smooth_normal: [Vec<f32>; 3],
    pub(crate) terminator_origin: [Vec<f64>; 3],
    /// Start of the BSDF's row in [`Vertices::rows`].
    pub(crate) bsdf: Vec<u32>,
    pub(crate) rows: Rows,
    /// The vertices to shade, by the kind of their BSDF.
    pub(crate) queues: [Vec<u32>; BsdfKind::COUNT],
    /// The solids of the surfaces, and whether they were met from outside; shorter lists mean none.
    pub(crate) solids: Vec<Option<(Solid<'s>, bool)>>,
    /// The media that light enters there, if a solid has one; shorter lists mean none.
    inside: Vec<Option<HomogeneousMedium>>,
    /// The media where the path comes from and behind the surface, as [`crate::wave::paths::of_column`] reads them;
    /// only in a scene with media.
    pub(crate) media: [Vec<u32>; 2],
    /// The footprint of rays that leave: see [`lumbre_scene::Footprint::Cone`].
    pub(crate) width: Vec<f32>,
    pub(crate) spread: Vec<f32>,
}

/// The shading normal is not the geometric one: directions below the true surface are folded back.
pub(crate) const FOLDS: u32 = 1;
/// The shading normal is not the geometric one, which only decides the side of a direction, as in pbrt.
pub(crate) const SIDED: u32 = 2;
/// The mesh approximates a smooth surface above the face: [`lumbre_scene::Interaction::terminator_origin`].
pub(crate) const HAS_TERMINATOR_OFFSET: u32 = 4;

/// Light from below the horizon counts: the surface transmits, or approximates a smooth one.
pub(crate) const LIT_FROM_BELOW: u32 = 8;

/// A point and its ray offset.
#[derive(Clone, Copy)]
pub(crate) struct Place<R: Real> {
    pub(crate) point: V3<R::Double>,
    pub(crate) normal: V3<R>,
    pub(crate) offset: R::Double,
}

/// The loss of normals by single precision.
const MORE: f64 = 1.0 + 1e-6;
/// At the origin, where all errors may be 0, the offset is large enough to survive any map.
const MIN_OFFSET: f64 = 1e-250;

/// The distance of ray origins from a point with an error, along its normal: see
/// [`lumbre_math::rounding::offset_point`].
pub(crate) fn offset_of(normal: DVec3, error: DVec3) -> f64 {
    ((normal.abs().dot(error) + 4.0 * error.max_element()) * MORE).max(MIN_OFFSET)
}

impl<R: Real> Place<R> {
    /// A point with an error bound for each component, and its normal: see [`offset_of`].
    #[inline(always)]
    pub(crate) fn new(point: V3<R::Double>, error: V3<R::Double>, normal: V3<R>) -> Self {
        let n = normal.to_double();
        let most = error.x.simd_max(error.y).simd_max(error.z);
        let offset = n.x.abs() * error.x + n.y.abs() * error.y + n.z.abs() * error.z;
        let offset = (offset + R::Double::splat(4.0) * most) * R::Double::splat(MORE);
        Self { point, normal, offset: offset.simd_max(R::Double::splat(MIN_OFFSET)) }
    }

    /// The origin of a ray on the side of a direction; the point itself without a normal.
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
    /// Clears the columns and reserves `len` vertices; `rows` are those of uniform materials.
    pub(crate) fn reset(&mut self, len: usize, rows: &Rows) {
        self.len = 0;
        let f64s = self.point.iter_mut().chain(&mut self.terminator_origin).chain([&mut self.offset]);
        f64s.for_each(|column| grow(column, len));
        let vectors = [&mut self.normal, &mut self.frame_s, &mut self.frame_n, &mut self.smooth_normal];
        vectors.into_iter().flatten().for_each(|column| grow(column, len));
        for column in [&mut self.path, &mut self.flags, &mut self.bsdf] {
            grow(column, len);
        }
        grow(&mut self.width, len);
        grow(&mut self.spread, len);
        self.media.iter_mut().for_each(|column| grow(column, len));
        self.rows.reset(rows);
        self.solids.clear();
        self.inside.clear();
        self.queues.iter_mut().for_each(Vec::clear);
    }

    /// Appends the point of a path. The normal of the surface may face either side.
    pub(crate) fn push_place(&mut self, path: usize, surface: &Surface, error: DVec3, towards: DVec3) {
        let (at, normal) = (self.len, surface.normal);
        let facing = if normal.dot(towards) < 0.0 { -normal } else { normal };
        self.len += 1;
        self.path[at] = path as u32;
        put64(&mut self.point, at, surface.point);
        put(&mut self.normal, at, facing.as_vec3());
        self.offset[at] = offset_of(normal, error);
        self.flags[at] = 0;
    }

    /// Sets the BSDF of the last vertex, and queues it.
    pub(crate) fn put_bsdf(&mut self, frame: &ShadingFrame, bsdf: &Bsdf, flags: u32, cone: (f64, f64)) {
        let at = self.len - 1;
        put(&mut self.frame_s, at, frame.s);
        put(&mut self.frame_n, at, frame.n);
        self.flags[at] |= flags;
        (self.width[at], self.spread[at]) = (cone.0 as f32, cone.1 as f32);
        self.bsdf[at] = self.rows.push(bsdf);
        self.queue(at, bsdf.kind());
    }

    /// Sets the BSDF of a vertex that was made in lanes, and queues it.
    pub(crate) fn put_looked_up(&mut self, at: usize, frame: &ShadingFrame, bsdf: &Bsdf, flags: u32) {
        put(&mut self.frame_s, at, frame.s);
        put(&mut self.frame_n, at, frame.n);
        let has_offset = flags & FOLDS != 0 && self.flags[at] & HAS_TERMINATOR_OFFSET != 0;
        self.flags[at] = flags | if has_offset { HAS_TERMINATOR_OFFSET | LIT_FROM_BELOW } else { 0 };
        self.bsdf[at] = self.rows.push(bsdf);
        self.queue(at, bsdf.kind());
    }

    /// Queues a vertex for shading.
    pub(crate) fn queue(&mut self, vertex: usize, kind: BsdfKind) {
        self.queues[kind as usize].push(vertex as u32);
    }

    /// Whether no vertex is queued.
    pub(crate) fn is_unqueued(&self) -> bool {
        self.queues.iter().all(Vec::is_empty)
    }

    /// Sets the origin of rays that leave the last vertex below the face.
    pub(crate) fn put_terminator_origin(&mut self, smooth_normal: Vec3, terminator_origin: DVec3) {
        let at = self.len - 1;
        self.flags[at] |= HAS_TERMINATOR_OFFSET;
        put(&mut self.smooth_normal, at, smooth_normal);
        put64(&mut self.terminator_origin, at, terminator_origin);
    }

    /// The solid of a vertex, and whether it was met from outside.
    pub(crate) fn solid(&self, vertex: usize) -> Option<(Solid<'s>, bool)> {
        self.solids.get(vertex).copied().flatten()
    }

    /// The medium that light enters at a vertex.
    pub(crate) fn inside(&self, vertex: usize) -> Option<HomogeneousMedium> {
        self.inside.get(vertex).copied().flatten()
    }

    /// Sets the solid of the last vertex, and the medium inside.
    pub(crate) fn put_solid(&mut self, solid: Solid<'s>, front: bool, inside: Option<HomogeneousMedium>) {
        self.solids.resize(self.len, None);
        self.solids[self.len - 1] = Some((solid, front));
        if inside.is_some() {
            self.inside.resize(self.len, None);
            self.inside[self.len - 1] = inside;
        }
    }

    /// Sets the media on both sides of a vertex.
    pub(crate) fn put_media(&mut self, vertex: usize, sides: [u32; 2]) {
        for (column, medium) in self.media.iter_mut().zip(sides) {
            column[vertex] = medium;
        }
    }

    /// The point of a vertex.
    pub(crate) fn point(&self, vertex: usize) -> DVec3 {
        DVec3::new(self.point[0][vertex], self.point[1][vertex], self.point[2][vertex])
    }

    /// The points of vertices.
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
