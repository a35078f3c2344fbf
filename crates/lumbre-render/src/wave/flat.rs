//! Vertices on flat triangles, in lanes: points with their errors, normals, and the light that such surfaces emit.

use lumbre_scene::light::lanes::Receiver;
use lumbre_scene::{SurfaceTable, TriangleSurface};
use lumbre_shading::Spectrum;
use lumbre_simd::math::orthonormal_basis;
use lumbre_simd::{Double, Job, Mask, Real, UInt, V3};

use crate::wave::paths::{Paths, grow};
use crate::wave::search::MetTriangle;
use crate::wave::setting::{Found, Setting};
use crate::wave::vertices::{LIT_FROM_BELOW, Place, Vertices, gather3, gather64};

/// Flat triangles that paths met, in columns.
#[derive(Debug, Default)]
pub(crate) struct FlatHits {
    len: usize,
    pub(crate) path: Vec<u32>,
    id: Vec<u32>,
    pub(crate) triangle: Vec<u32>,
    /// Start of the BSDF's row.
    pub(crate) row: Vec<u32>,
    /// [`LIT_FROM_BELOW`] or 0.
    pub(crate) flags: Vec<u32>,
    /// The corners of each triangle in its mesh.
    pub(crate) indices: Vec<[u32; 3]>,
    /// The corners relative to the origin, corner by corner.
    pub(crate) corners: [Vec<f64>; 9],
    pub(crate) origin: [Vec<f64>; 3],
    pub(crate) local: [Vec<f32>; 2],
    pub(crate) distance: Vec<f32>,
    pub(crate) outward: Vec<f32>,
    /// The radiance that the surface emits, and the number of its emissive sides (0, 1 or 2).
    emission: [Vec<f32>; 4],
}

impl FlatHits {
    /// Clears the columns and reserves `len` hits.
    pub(crate) fn reset(&mut self, len: usize) {
        self.len = 0;
        self.indices.clear();
        for column in [&mut self.path, &mut self.id, &mut self.triangle, &mut self.row, &mut self.flags] {
            grow(column, len);
        }
        let f32s = self.local.iter_mut().chain(&mut self.emission);
        f32s.chain([&mut self.distance, &mut self.outward]).for_each(|column| grow(column, len));
        self.corners.iter_mut().chain(&mut self.origin).for_each(|column| grow(column, len));
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The surface of a hit.
    pub(crate) fn surface<'s>(&self, surfaces: &'s SurfaceTable, at: usize) -> Option<&'s TriangleSurface> {
        surfaces.surface(self.id[at])
    }

    /// Appends what a path met.
    #[inline]
    pub(crate) fn push(&mut self, surface: &TriangleSurface, path: usize, met: MetTriangle, distance: f32) {
        let at = self.len;
        self.len += 1;
        self.path[at] = path as u32;
        self.id[at] = met.id;
        self.triangle[at] = met.triangle;
        self.row[at] = surface.bsdf.map_or(0, |bsdf| bsdf.row);
        self.flags[at] = if surface.transmits { LIT_FROM_BELOW } else { 0 };
        for (column, x) in self.origin.iter_mut().zip(surface.mesh.origin.to_array()) {
            column[at] = x;
        }
        (self.local[0][at], self.local[1][at]) = (met.local[0], met.local[1]);
        self.distance[at] = distance;
        self.outward[at] = surface.outward;
        let (radiance, sides) = match surface.emission {
            None => ([0.0; 3], 0.0),
            Some((radiance, two_sided)) => (radiance, if two_sided { 2.0 } else { 1.0 }),
        };
        for (column, x) in self.emission.iter_mut().zip([radiance[0], radiance[1], radiance[2], sides]) {
            column[at] = x;
        }
    }

    /// Reads the corners of all triangles, in loops so short that the loads of many triangles overlap.
    pub(crate) fn load(&mut self, surfaces: &SurfaceTable) {
        let met = self.id.iter().zip(&self.triangle).take(self.len);
        self.indices.extend(met.map(|(&id, &triangle)| {
            surfaces.surface(id).map_or([0; 3], |surface| surface.mesh.indices[triangle as usize])
        }));
        for (at, (&id, corners)) in self.id.iter().zip(&self.indices).enumerate() {
            let Some(surface) = surfaces.surface(id) else { continue };
            let corners = corners.map(|corner| surface.mesh.positions[corner as usize].as_dvec3().to_array());
            put_corners(&mut self.corners, at, corners);
        }
    }
}

/// Writes the vectors of three corners, corner by corner.
#[inline]
pub(crate) fn put_corners<T>(columns: &mut [Vec<T>; 9], at: usize, corners: [[T; 3]; 3]) {
    for (column, x) in columns.iter_mut().zip(corners.into_iter().flatten()) {
        column[at] = x;
    }
}

/// Makes vertices of flat hits, in their order, and adds the light that they emit.
pub(crate) struct FlatVertices<'a, 's> {
    pub(crate) setting: &'a Setting<'s>,
    pub(crate) hits: &'a FlatHits,
    pub(crate) paths: &'a Paths,
    pub(crate) vertices: &'a mut Vertices<'s>,
    pub(crate) found: &'a mut Vec<Found>,
    /// Whether the rays that leave are rounded.
    pub(crate) is_single: bool,
}

impl Job for FlatVertices<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        let Self { setting, hits, paths, vertices, found, is_single } = self;
        let rounding = setting.rounding(is_single);
        let mut done = 0;
        while done < hits.len {
            let lanes = R::Mask::first(hits.len - done);
            let at = R::UInt::from_slice(&hits.path[done..]);
            // Padding lanes need a valid path too.
            let at = R::UInt::select(lanes, at, R::UInt::splat(0));
            let outward = R::from_slice(&hits.outward[done..]);
            let (point, error, normal) = triangle::<R>(hits, done, outward);
            let error = rounding.grow::<R>(point, error);
            let direction = gather3::<R>(&paths.direction, at);
            let front = normal.dot(direction).simd_lt(R::zero());
            let facing = V3::select(front, normal, -normal);
            let place = Place::<R>::new(point, error, facing);
            let (s, _) = orthonormal_basis(normal);
            let to = vertices.len + done;
            put64::<R>(&mut vertices.point, to, point);
            place.offset.copy_to_slice(&mut vertices.offset[to..]);
            put3::<R>(&mut vertices.normal, to, facing);
            put3::<R>(&mut vertices.frame_s, to, s);
            put3::<R>(&mut vertices.frame_n, to, normal);
            R::UInt::from_slice(&hits.flags[done..]).copy_to_slice(&mut vertices.flags[to..]);
            R::UInt::from_slice(&hits.row[done..]).copy_to_slice(&mut vertices.bsdf[to..]);
            at.copy_to_slice(&mut vertices.path[to..]);
            let spread = R::gather(&paths.spread, at);
            let width = R::gather(&paths.width, at) + spread * R::from_slice(&hits.distance[done..]);
            width.copy_to_slice(&mut vertices.width[to..]);
            spread.copy_to_slice(&mut vertices.spread[to..]);

            find_light::<R>(setting, hits, paths, done, at, lanes, front, point, found);
            done += R::LANES;
        }
        vertices.len += hits.len;
    }
}

/// Adds the light of surfaces that emit on the side of the viewer.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "lanes, as they stand in registers")]
pub(crate) fn find_light<R: Real>(
    setting: &Setting<'_>,
    hits: &FlatHits,
    paths: &Paths,
    done: usize,
    at: R::UInt,
    lanes: R::Mask,
    front: R::Mask,
    point: V3<R::Double>,
    found: &mut Vec<Found>,
) {
    let sides = R::from_slice(&hits.emission[3][done..]);
    let shines = lanes & (sides.simd_eq(R::splat(2.0)) | (sides.simd_eq(R::one()) & front));
    if shines.any() {
        let pdf = light_pdf::<R>(setting, hits, paths, done, at, shines, point);
        push_found::<R>(found, hits, done, shines, at, pdf);
    }
}

/// A point of each triangle with an error bound of its components, and the outward normal.
///
/// The error is that of the combination, γ₇ Σ|bᵢ pᵢ| (M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering",
/// 3rd edition, 2016, section 3.9), and one rounding for the mesh's origin.
#[inline(always)]
pub(crate) fn triangle<R: Real>(
    hits: &FlatHits,
    at: usize,
    outward: R,
) -> (V3<R::Double>, V3<R::Double>, V3<R>) {
    use lumbre_math::rounding::{UNIT_ROUNDOFF, gamma};
    let (p0, p1, p2) = (corner::<R>(hits, at, 0), corner::<R>(hits, at, 3), corner::<R>(hits, at, 6));
    let b1 = R::Double::from_single(R::from_slice(&hits.local[0][at..]));
    let b2 = R::Double::from_single(R::from_slice(&hits.local[1][at..]));
    let b0 = R::Double::splat(1.0) - b1 - b2;
    let (t0, t1, t2) = (p0 * b0, p1 * b1, p2 * b2);
    let origin = V3 {
        x: R::Double::from_slice(&hits.origin[0][at..]),
        y: R::Double::from_slice(&hits.origin[1][at..]),
        z: R::Double::from_slice(&hits.origin[2][at..]),
    };
    let point = origin + (t0 + t1 + t2);
    let sizes = abs::<R>(t0) + abs::<R>(t1) + abs::<R>(t2);
    let error = sizes * R::Double::splat(gamma(7)) + abs::<R>(point) * R::Double::splat(UNIT_ROUNDOFF);
    let cross = (p1 - p0).cross(p2 - p0);
    // In double precision: the cross product of short sides underflows single precision.
    let length = cross.dot(cross).sqrt();
    let unit = V3 { x: cross.x / length, y: cross.y / length, z: cross.z / length };
    let normal = V3 { x: unit.x.to_single(), y: unit.y.to_single(), z: unit.z.to_single() };
    (point, error, normal * outward)
}

#[inline(always)]
pub(crate) fn corner<R: Real>(hits: &FlatHits, at: usize, first: usize) -> V3<R::Double> {
    V3 {
        x: R::Double::from_slice(&hits.corners[first][at..]),
        y: R::Double::from_slice(&hits.corners[first + 1][at..]),
        z: R::Double::from_slice(&hits.corners[first + 2][at..]),
    }
}

#[inline(always)]
fn abs<R: Real>(v: V3<R::Double>) -> V3<R::Double> {
    V3 { x: v.x.abs(), y: v.y.abs(), z: v.z.abs() }
}

#[inline(always)]
pub(crate) fn put3<R: Real>(columns: &mut [Vec<f32>; 3], at: usize, v: V3<R>) {
    v.x.copy_to_slice(&mut columns[0][at..]);
    v.y.copy_to_slice(&mut columns[1][at..]);
    v.z.copy_to_slice(&mut columns[2][at..]);
}

#[inline(always)]
pub(crate) fn put64<R: Real>(columns: &mut [Vec<f64>; 3], at: usize, v: V3<R::Double>) {
    v.x.copy_to_slice(&mut columns[0][at..]);
    v.y.copy_to_slice(&mut columns[1][at..]);
    v.z.copy_to_slice(&mut columns[2][at..]);
}

/// The density with which the last vertex would have sampled the light that a ray found.
#[inline(always)]
fn light_pdf<R: Real>(
    setting: &Setting<'_>,
    hits: &FlatHits,
    paths: &Paths,
    done: usize,
    at: R::UInt,
    shines: R::Mask,
    point: V3<R::Double>,
) -> R {
    let least = R::gather(&paths.pdf, at).simd_min(R::gather(&paths.merge_pdf, at));
    let chosen = shines & least.simd_lt(R::splat(f32::INFINITY));
    if chosen.none() {
        return R::zero();
    }
    let receiver = Receiver::<R> {
        from: gather64::<R>(&paths.origin, at),
        normal: gather3(&paths.receiver_normal, at),
        // Moving surfaces are never flat hits.
        time: None,
    };
    let id = R::UInt::from_slice(&hits.id[done..]);
    let triangle = R::UInt::from_slice(&hits.triangle[done..]);
    let lights = setting.scene.lane_lights();
    lights.pdf(chosen, &receiver, id, triangle, point).or_zero(chosen)
}

/// Records the light that paths found.
#[inline(always)]
fn push_found<R: Real>(
    found: &mut Vec<Found>,
    hits: &FlatHits,
    done: usize,
    shines: R::Mask,
    at: R::UInt,
    pdf: R,
) {
    let (at, pdf) = (at.to_lanes(), pdf.to_lanes());
    let mut bits = shines.to_bitmask();
    while bits != 0 {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits - 1;
        let [r, g, b, _] = &hits.emission;
        let radiance = Spectrum::new(r[done + lane], g[done + lane], b[done + lane]);
        found.push(Found { path: at[lane], radiance, light_pdf: pdf[lane] });
    }
}
