//! Rays one number after the other, and what is many at a time by vectors that need no features beyond those of the
//! architecture: those for any machine, and those of NEON.

use std::marker::PhantomData;

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use super::axes::{Axes, Sides};
use super::isa::{Isa, Set};
use super::operations::{CornerScratch, Simd};
use super::triangles::Shears;
use crate::intersect::box_ray::{BoxRay, END_FACTOR, LITTLE, START_FACTOR, Slabs};
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::watertight::{BlockRay, EdgeTest, HeightRange, Inside, Shear, edge_test};
use crate::ray32::Ray32;
#[cfg(target_arch = "aarch64")]
use crate::simd::neon::Neon16;
use crate::simd::portable::Portable16;
use crate::simd::{F32x8, F32x16, LANES, Row, Vector};
use crate::tree::BLOCK;
use crate::tree::Corners;
use crate::tree::filter_start::FilterStart;
use crate::tree::node::TreeSpace;
use crate::tree::triangle_block::{TriangleBlock, shared_row};

/// With these vectors.
pub(crate) struct Plain<W>(PhantomData<W>);
pub(crate) type Portable = Plain<Portable16>;
#[cfg(target_arch = "aarch64")]
pub(crate) type Neon = Plain<Neon16>;

/// Vectors that the whole program may use.
pub(crate) trait EverywhereThere: F32x16 {
    /// See [`Simd::GOES_ON_TOGETHER`].
    const GOES_ON_TOGETHER: bool = true;

    /// What they are of.
    fn isa() -> Isa;
}

impl EverywhereThere for Portable16 {
    #[inline]
    fn isa() -> Isa {
        Isa(Set::Portable)
    }
}

#[cfg(target_arch = "aarch64")]
impl EverywhereThere for Neon16 {
    // As with AVX2, sixteen numbers take several registers.
    const GOES_ON_TOGETHER: bool = false;

    #[inline]
    fn isa() -> Isa {
        Isa(Set::Neon)
    }
}

// As the processor's instruction does it, which f32::max does not.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn single_direction(ray: &Ray) -> [f32; 4] {
    let [x, y, z] = ray.direction.to_array().map(|d| d as f32);
    [x, y, z, 0.0]
}

/// Where a ray starts relative to the mesh, rounded once.
#[inline(always)]
fn local(start: &FilterStart, ray: &Ray32) -> [f32; 4] {
    let [x, y, z] = [0, 1, 2].map(|axis| (f64::from(ray.origin[axis]) - start.mesh_origin[axis]) as f32);
    [x, y, z, 0.0]
}

// There is no instruction set to be taken on: these are ordinary functions, and the compiler chooses where they go.
impl<W: EverywhereThere> Simd for Plain<W> {
    type F32x8 = W::Half;
    type F32x16 = W;
    const GOES_ON_TOGETHER: bool = W::GOES_ON_TOGETHER;

    #[inline]
    fn isa() -> Isa {
        W::isa()
    }

    #[inline]
    fn start_nearby(tree_space: &TreeSpace, ray: &Ray, t_min: f64, t_max: f64, boxes: &mut BoxRay) -> bool {
        boxes.start_nearby(tree_space, ray, t_min, t_max)
    }

    #[inline]
    fn start_filter(start: &FilterStart, ray: &Ray) -> Option<Slabs> {
        let (t_min, t_max) = (ray.t_min as f32, ray.t_max as f32);
        // Every comparison with a NaN is false.
        let (mut fits, mut is_long) = (0.0 <= t_min && t_min <= t_max, false);
        let mut signs = 0;
        let mut slabs = BoxRay::passing_all().slabs;
        let direction = single_direction(ray);
        for (axis, &d) in direction.iter().enumerate().take(3) {
            let from = ((ray.origin[axis] - start.tree_origin[axis]) * start.scale) as f32;
            fits &= from.abs() <= start.farthest[axis] && d.abs() <= start.longest[axis];
            is_long |= d.abs() >= start.shortest;
            let inverse = start.space_per_unit / greater(d.abs(), start.tiny);
            let margin = inverse * (from.abs() * start.margin_per_distance + start.margin);
            let inverse = inverse.copysign(d);
            slabs.inverse[axis] = inverse;
            slabs.near_offset[axis] = -from * inverse - margin;
            slabs.far_offset[axis] = -from * inverse + margin;
            signs |= u32::from(d.is_sign_negative()) << axis;
        }
        if !(fits && is_long) {
            return None;
        }
        slabs.sides = Sides::new(signs);
        slabs.start_at(t_min * START_FACTOR);
        slabs.end_at(t_max * END_FACTOR + LITTLE as f32);
        Some(slabs)
    }

    #[inline]
    fn start_blocks(start: &FilterStart, ray: &Ray, slabs: &Slabs) -> (BlockRay, f32) {
        let (mut origin, mut rest) = ([0.0; 4], [0.0; 4]);
        for axis in 0..3 {
            let exact = ray.origin[axis] - start.mesh_origin[axis];
            origin[axis] = exact as f32;
            rest[axis] = (exact - f64::from(origin[axis])) as f32;
        }
        let direction = single_direction(ray);
        let axes = Axes::new(&ray.direction);
        let inverse = axes.permute_single(&slabs.inverse)[2] * start.units_per_space;
        let shear = axes.permute_single(&direction).map(|d| d * inverse);
        let rest = axes.permute_single(&rest);
        let length = axes.permute_single(&direction)[2].abs();
        let blocks = BlockRay {
            axes,
            origin: axes.permute_single(&origin),
            rest: [rest[0] - shear[0] * rest[2], rest[1] - shear[1] * rest[2], rest[2], 0.0],
            shear,
            least_size: start.least_size,
            range: HeightRange::ahead(ray.t_min as f32 * length, ray.t_max as f32 * length),
            turn: 0.0f32.copysign(-inverse),
        };
        (blocks, inverse.abs())
    }

    #[inline]
    fn start_f32(start: &FilterStart, ray: &Ray32) -> Option<Slabs> {
        let (t_min, t_max) = (ray.t_min, ray.t_max);
        // Every comparison with a NaN is false.
        let (mut fits, mut is_long) = (0.0 <= t_min && t_min <= t_max && t_min.is_sign_positive(), false);
        let mut signs = 0;
        let mut slabs = BoxRay::passing_all().slabs;
        for (axis, &local) in local(start, ray).iter().enumerate().take(3) {
            let d = ray.direction[axis];
            let from = local * start.units_per_space - start.shift[axis];
            fits &= from.abs() <= start.farthest[axis] && d.abs() <= start.longest[axis];
            is_long |= d.abs() >= start.shortest;
            let inverse = start.space_per_unit / greater(d.abs(), start.tiny);
            let margin = inverse * (from.abs() * TreeSpace::F32_MARGIN_PER_DISTANCE + start.f32_margin);
            let inverse = inverse.copysign(d);
            slabs.inverse[axis] = inverse;
            slabs.near_offset[axis] = -from * inverse - margin;
            slabs.far_offset[axis] = -from * inverse + margin;
            signs |= u32::from(d.is_sign_negative()) << axis;
        }
        if !(fits && is_long) {
            return None;
        }
        slabs.sides = Sides::new(signs);
        slabs.start_at(t_min * START_FACTOR);
        slabs.end_at(t_max * END_FACTOR + LITTLE as f32);
        Some(slabs)
    }

    #[inline]
    fn start_f32_blocks(start: &FilterStart, ray: &Ray32, slabs: &Slabs) -> F32Ray {
        let axes = Axes::new(&ray.direction.as_dvec3());
        let inverse = axes.permute_single(&slabs.inverse)[2] * start.units_per_space;
        let [x, y, z] = ray.direction.to_array();
        let mut origin = axes.permute_single(&local(start, ray));
        let mut shear = axes.permute_single(&[x, y, z, 0.0]).map(|d| d * inverse);
        (origin[3], shear[3]) = (ray.t_min, ray.t_max);
        F32Ray { axes, origin, shear, minus_inverse: -inverse }
    }

    #[inline]
    fn sheared_corners<S: Shears>(block: &TriangleBlock, ray: &S) -> [[W::Half; 3]; 3] {
        let mut sheared = [[W::Half::splat(0.0); 3]; 3];
        let [kx, ky, kz] = ray.axes().order();
        if block.is_unshared() {
            let own = block.own_corners();
            for corner in 0..3 {
                let vertices = [kx, ky, kz].map(|axis| W::Half::load(&own[axis][corner]));
                let [x, y, z] = ray.apply(vertices);
                (sheared[0][corner], sheared[1][corner], sheared[2][corner]) = (x, y, z);
            }
            return sheared;
        }
        let words = block.words();
        let rows = [kx, ky, kz].map(|axis| words[shared_row(axis)..].first_chunk().expect("sixteen"));
        let [x, y, z] = ray.apply(rows.map(W::load));
        for (corner, places) in block.corners().into_iter().enumerate() {
            sheared[0][corner] = x.swizzle(places);
            sheared[1][corner] = y.swizzle(places);
            sheared[2][corner] = z.swizzle(places);
        }
        sheared
    }

    #[inline]
    fn f32_rows(rays: &[Ray32; LANES], rows: &mut [Row<f32>; 8]) {
        for (i, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                rows[axis].0[i] = ray.origin[axis];
                rows[4 + axis].0[i] = ray.direction[axis];
            }
            (rows[3].0[i], rows[7].0[i]) = (ray.t_min, ray.t_max);
        }
    }

    #[inline]
    fn columns(rays: &[Ray; LANES], columns: &mut [Row<f64>; 8]) {
        for (i, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                columns[axis].0[i] = ray.origin[axis];
                columns[3 + axis].0[i] = ray.direction[axis];
            }
            (columns[6].0[i], columns[7].0[i]) = (ray.t_min, ray.t_max);
        }
    }

    #[inline]
    fn equals_before(list: &[u32; 3 * BLOCK]) -> [u32; 3 * BLOCK] {
        std::array::from_fn(|at| {
            let before = list[..at].iter().enumerate();
            before.fold(0, |places, (place, &other)| places | u32::from(other == list[at]) << place)
        })
    }

    #[inline]
    fn truncated(numbers: &[f32; BLOCK]) -> [i32; BLOCK] {
        numbers.map(|number| number as i32)
    }

    #[inline]
    fn corners<'a>(block: &'a TriangleBlock, room: &'a mut CornerScratch) -> &'a Corners {
        if block.is_unshared() {
            return block.own_corners();
        }
        let CornerScratch(corners) = room;
        for lane in 0..BLOCK {
            let vertices = block.vertices_at(lane);
            for (axis, corners) in corners.iter_mut().enumerate() {
                for (lanes, vertex) in corners.iter_mut().zip(vertices) {
                    lanes[lane] = block.words()[shared_row(axis) + vertex];
                }
            }
        }
        corners
    }

    #[inline]
    fn shear(ray: &Ray, axes: &'static Axes, &[x, y, z, _]: &[f64; 4]) -> (Shear, [f64; 3]) {
        let shear = Shear::along(axes, &ray.direction);
        (shear, shear.local_origin(&ray.origin, &DVec3::new(x, y, z)))
    }

    #[inline]
    fn pass(block: &TriangleBlock, lane: usize, shear: &Shear, origin: &[f64; 3]) -> (EdgeTest, Inside) {
        edge_test(shear, origin, &shear.axes.gather(block, lane))
    }
}
