//! Vertices on triangles with vertex normals or textured materials, in lanes.

use lumbre_math::Vec3;
use lumbre_scene::{Scene, TrianglePoint, TriangleSurface, UniformBsdf};
use lumbre_shading::lanes::{BsdfKind, facing};
use lumbre_shading::{Bsdf, ShadingFrame, ShadingNormals};
use lumbre_simd::math::orthonormal_basis;
use lumbre_simd::{Double, Job, Mask, Real, UInt, V3};

use crate::wave::flat::{FlatHits, corner, find_light, put_corners, put3, put64, triangle};
use crate::wave::paths::{Paths, grow};
use crate::wave::placed::Placements;
use crate::wave::search::MetTriangle;
use crate::wave::setting::{Found, Setting};
use crate::wave::vertices::{FOLDS, HAS_TERMINATOR_OFFSET, LIT_FROM_BELOW, Place, SIDED, Vertices, gather3};

/// Triangles that paths met and that need more than [`FlatHits`], in columns.
#[derive(Debug, Default)]
pub(crate) struct SmoothHits {
    /// The data that they share with flat ones.
    pub(crate) base: FlatHits,
    /// The normals of the corners, corner by corner; zero if there are none.
    normals: [Vec<f32>; 9],
    /// The kind of the BSDF; `None` if the material is textured.
    pub(crate) kinds: Vec<Option<BsdfKind>>,
    /// The same for lanes: 1 if the material is textured.
    is_textured: Vec<u32>,
    /// The computed outward geometric and shading normals.
    pub(crate) geometric: [Vec<f32>; 3],
    pub(crate) shading: [Vec<f32>; 3],
    /// The instances around them; empty for triangles of top-level meshes.
    placements: Placements,
}

impl SmoothHits {
    /// Clears the columns and reserves `len` hits.
    pub(crate) fn reset(&mut self, len: usize) {
        self.base.reset(len);
        self.placements.clear();
        self.kinds.clear();
        grow(&mut self.is_textured, len);
        let columns = self.normals.iter_mut().chain(&mut self.geometric).chain(&mut self.shading);
        columns.for_each(|column| grow(column, len));
    }

    /// Appends what a path met, with its BSDF, or `None` for a textured material.
    #[inline]
    pub(crate) fn push(
        &mut self,
        surface: &TriangleSurface,
        path: usize,
        met: MetTriangle,
        distance: f32,
        bsdf: Option<UniformBsdf>,
    ) {
        let at = self.base.len();
        self.base.push(surface, path, met, distance);
        self.kinds.push(bsdf.map(|bsdf| bsdf.kind));
        self.is_textured[at] = u32::from(bsdf.is_none());
    }

    /// Appends what a path met in the instance at this position in the tree.
    #[inline]
    pub(crate) fn push_placed(
        &mut self,
        surface: &TriangleSurface,
        path: usize,
        (met, instance): (MetTriangle, u32),
        distance: f32,
        bsdf: Option<UniformBsdf>,
    ) {
        self.push(surface, path, met, distance, bsdf);
        self.placements.push(instance);
    }

    /// Reads the corners of all triangles and the normals there: see [`FlatHits::load`].
    pub(crate) fn load(&mut self, scene: &Scene, is_single: bool) {
        let surfaces = scene.tables();
        self.base.load(surfaces);
        for (at, &corners) in self.base.indices.iter().enumerate() {
            let normals = self.base.surface(surfaces, at).and_then(|surface| surface.normals(corners));
            put_corners(&mut self.normals, at, normals.unwrap_or_default().map(|normal| normal.to_array()));
        }
        self.placements.apply(scene.accel(), is_single, &mut self.base, &mut self.normals);
    }

    /// The surface point of a hit, for its material's textures.
    pub(crate) fn point<'s>(
        &self,
        scene: &'s Scene,
        at: usize,
        vertices: &Vertices<'_>,
        vertex: usize,
        direction: Vec3,
    ) -> TrianglePoint<'s> {
        TrianglePoint {
            placement: self.placements.map(scene.accel(), at),
            triangle: self.base.triangle[at],
            local: [self.base.local[0][at], self.base.local[1][at]],
            point: vertices.point(vertex),
            geometric: vector(&self.geometric, at),
            normal: vector(&self.shading, at),
            direction,
            distance: self.base.distance[at],
        }
    }
}

fn vector(columns: &[Vec<f32>; 3], at: usize) -> Vec3 {
    Vec3::new(columns[0][at], columns[1][at], columns[2][at])
}

/// The flags of a vertex whose shading normal differs from the geometric one.
pub(crate) fn flags_of(normals: ShadingNormals, frame: &ShadingFrame, geometric: Vec3) -> u32 {
    match normals {
        _ if !ShadingNormals::differ(frame.n, geometric) => 0,
        ShadingNormals::Lumbre => FOLDS,
        ShadingNormals::Pbrt => SIDED | LIT_FROM_BELOW,
    }
}

/// The frame of a BSDF: if that is isotropic, the frame of flat surfaces, so that random numbers give the same
/// directions.
pub(crate) fn frame_for(bsdf: &Bsdf, frame: ShadingFrame) -> ShadingFrame {
    if !bsdf.is_isotropic() {
        return frame;
    }
    let (s, t) = orthonormal_basis(V3::new(frame.n.x, frame.n.y, frame.n.z));
    ShadingFrame { s: Vec3::new(s.x, s.y, s.z), t: Vec3::new(t.x, t.y, t.z), n: frame.n }
}

/// Makes vertices of hits, in their order, and adds the light that they emit.
pub(crate) struct SmoothVertices<'a, 's> {
    pub(crate) setting: &'a Setting<'s>,
    pub(crate) hits: &'a mut SmoothHits,
    pub(crate) paths: &'a Paths,
    pub(crate) vertices: &'a mut Vertices<'s>,
    pub(crate) found: &'a mut Vec<Found>,
    /// Whether the rays that leave are rounded.
    pub(crate) is_single: bool,
}

impl Job for SmoothVertices<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Self { setting, hits, paths, vertices, found, is_single } = self;
        let rounding = setting.rounding(is_single);
        let is_pbrt = R::Mask::splat(setting.shading_normals == ShadingNormals::Pbrt);
        let mut done = 0;
        while done < hits.base.len() {
            let lanes = R::Mask::first(hits.base.len() - done);
            let at = R::UInt::from_slice(&hits.base.path[done..]);
            // Padding lanes need a valid path too.
            let at = R::UInt::select(lanes, at, R::UInt::splat(0));
            let (point, error, face) = triangle::<R>(&hits.base, done, R::one());
            let (error, face) = if hits.placements.is_empty() {
                (rounding.grow::<R>(point, error), face)
            } else {
                hits.placements.adjust::<R>(done, error, face)
            };
            let outward = R::from_slice(&hits.base.outward[done..]);
            let (geometric, shading) = normals_at::<R>(hits, done, face, outward);
            let direction = gather3::<R>(&paths.direction, at);
            let front = geometric.dot(direction).simd_lt(R::zero());
            let above = V3::select(front, geometric, -geometric);
            let place = Place::<R>::new(point, error, above);

            let seen = facing::<R>(shading, geometric, -direction);
            let n = V3::select(is_pbrt & differ::<R>(shading, geometric), shading, seen);
            let differs = differ::<R>(n, geometric);
            let folds = differs & !is_pbrt;
            let mut flags = R::UInt::from_slice(&hits.base.flags[done..]);
            flags = flags | flag_where::<R>(folds, FOLDS);
            flags = flags | flag_where::<R>(differs & is_pbrt, SIDED | LIT_FROM_BELOW);
            let is_textured = R::UInt::from_slice(&hits.is_textured[done..]).simd_eq(R::UInt::splat(1));
            // If the frame may still be tilted, the texture look-up decides.
            let may_rise = lanes & differ::<R>(shading, geometric) & (folds | (is_textured & !is_pbrt));
            let to = vertices.len + done;
            if may_rise.any() {
                let start = place.start(above);
                let (offset, is_above) = terminator_offset::<R>(hits, done, above);
                // A smaller offset is within the error of the point.
                let least = (start - point).to_single().length();
                let is_above = may_rise & is_above & least.simd_lt(offset.dot(geometric).abs());
                let is_below = shading.dot(above).simd_lt(R::zero());
                put3::<R>(&mut vertices.smooth_normal, to, V3::select(is_below, -shading, shading));
                put64::<R>(&mut vertices.terminator_origin, to, start + offset.to_double());
                flags = flags | flag_where::<R>(is_above, HAS_TERMINATOR_OFFSET | LIT_FROM_BELOW);
            }

            let (s, _) = orthonormal_basis(n);
            put64::<R>(&mut vertices.point, to, point);
            place.offset.copy_to_slice(&mut vertices.offset[to..]);
            put3::<R>(&mut vertices.normal, to, above);
            put3::<R>(&mut vertices.frame_s, to, s);
            put3::<R>(&mut vertices.frame_n, to, n);
            flags.copy_to_slice(&mut vertices.flags[to..]);
            R::UInt::from_slice(&hits.base.row[done..]).copy_to_slice(&mut vertices.bsdf[to..]);
            at.copy_to_slice(&mut vertices.path[to..]);
            let spread = R::gather(&paths.spread, at);
            let width = R::gather(&paths.width, at) + spread * R::from_slice(&hits.base.distance[done..]);
            width.copy_to_slice(&mut vertices.width[to..]);
            spread.copy_to_slice(&mut vertices.spread[to..]);
            put3::<R>(&mut hits.geometric, done, geometric);
            put3::<R>(&mut hits.shading, done, shading);

            find_light::<R>(setting, &hits.base, paths, done, at, lanes, front, point, found);
            done += R::LANES;
        }
        vertices.len += hits.base.len();
    }
}

#[inline(always)]
fn flag_where<R: Real>(mask: R::Mask, flag: u32) -> R::UInt {
    R::UInt::select(mask, R::UInt::splat(flag), R::UInt::splat(0))
}

/// [`ShadingNormals::differ`].
#[inline(always)]
fn differ<R: Real>(shading: V3<R>, geometric: V3<R>) -> R::Mask {
    shading.dot(geometric).simd_lt(R::splat(1.0 - ShadingNormals::ROUNDING))
}

#[inline(always)]
fn corner_normal<R: Real>(hits: &SmoothHits, at: usize, first: usize) -> V3<R> {
    V3 {
        x: R::from_slice(&hits.normals[first][at..]),
        y: R::from_slice(&hits.normals[first + 1][at..]),
        z: R::from_slice(&hits.normals[first + 2][at..]),
    }
}

/// The weights of the corners.
#[inline(always)]
fn weights<R: Real>(hits: &SmoothHits, at: usize) -> [R; 3] {
    let b1 = R::from_slice(&hits.base.local[0][at..]);
    let b2 = R::from_slice(&hits.base.local[1][at..]);
    [R::one() - b1 - b2, b1, b2]
}

/// The unit vector in a direction, and whether there is one.
#[inline(always)]
fn unit<R: Real>(v: V3<R>) -> (V3<R>, R::Mask) {
    // Scaled first: the square may leave the range.
    let v = v * v.abs().max_component().recip();
    let scale = v.length().recip();
    (v * scale, scale.is_finite())
}

/// The outward geometric normal, and the shading normal on its side, which is interpolated from the vertices. Vertex
/// normals decide which side is outside. Without them, the shading normal is the geometric one.
#[inline(always)]
fn normals_at<R: Real>(hits: &SmoothHits, at: usize, face: V3<R>, outward: R) -> (V3<R>, V3<R>) {
    let [b0, b1, b2] = weights::<R>(hits, at);
    let sum = corner_normal::<R>(hits, at, 0) * b0
        + corner_normal::<R>(hits, at, 3) * b1
        + corner_normal::<R>(hits, at, 6) * b2;
    let (normal, is_smooth) = unit(sum);
    let turns = is_smooth & face.dot(normal).simd_lt(R::zero());
    let geometric = V3::select(turns, -face, face) * outward;
    (geometric, V3::select(is_smooth, normal * outward, geometric))
}

/// The offset from a triangle to the smooth surface that its vertex normals imply on the side of `above`, and where
/// that is above the triangle: as the terminator offset of [`lumbre_scene::Interaction`].
#[inline(always)]
fn terminator_offset<R: Real>(hits: &SmoothHits, at: usize, above: V3<R>) -> (V3<R>, R::Mask) {
    let [b0, b1, b2] = weights::<R>(hits, at);
    let (p0, p1, p2) =
        (corner::<R>(&hits.base, at, 0), corner::<R>(&hits.base, at, 3), corner::<R>(&hits.base, at, 6));
    // Subtracted in double precision: the corners may be far from the origin.
    let (along_a, along_b) = ((p1 - p0).to_single(), (p2 - p0).to_single());
    let (n0, is0) = unit(corner_normal::<R>(hits, at, 0));
    let (n1, is1) = unit(corner_normal::<R>(hits, at, 3));
    let (n2, is2) = unit(corner_normal::<R>(hits, at, 6));
    let mean = (n0 * b0 + n1 * b1 + n2 * b2).dot(above);
    let side = R::one().copysign(mean);
    let from_first = along_a * b1 + along_b * b2;
    let (offset0, over0) = lift(n0 * side, from_first, b0, above);
    let (offset1, over1) = lift(n1 * side, from_first - along_a, b1, above);
    let (offset2, over2) = lift(n2 * side, from_first - along_b, b2, above);
    let offset = offset0 + offset1 + offset2;
    let height = offset.dot(above);
    let is_above = is0 & is1 & is2 & over0 & over1 & over2;
    (offset, is_above & R::zero().simd_lt(height) & height.is_finite())
}

/// How far the tangent plane of a vertex lifts a point at distance `way`, times its weight, and whether the vertex
/// faces this side.
#[inline(always)]
fn lift<R: Real>(normal: V3<R>, way: V3<R>, weight: R, above: V3<R>) -> (V3<R>, R::Mask) {
    let below = way.dot(normal).simd_min(R::zero());
    (normal * -(weight * below), R::zero().simd_lt(normal.dot(above)))
}

#[cfg(test)]
#[path = "smooth_tests.rs"]
mod tests;
