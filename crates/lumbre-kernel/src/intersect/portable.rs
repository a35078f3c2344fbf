//! Plain loops over arrays, for any machine.

use bytemuck::Zeroable;
use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use super::axes::{Axes, Sides};
use super::isa::{Isa, Set};
use super::operations::{CornersRoom, Crossings, Simd};
use crate::intersect::box_ray::{BoxRay, END_FACTOR, LITTLE, START_FACTOR, Slabs};
use crate::intersect::f32_ray::F32Ray;
use crate::intersect::watertight::{
    BlockRay, EDGE_ERROR, ERRORS_OF_EDGES, ERRORS_OF_EXTENT, EdgeTest, HEIGHT_ERROR, HeightRange, Inside,
    SIZE_ERROR, Shear, TINY, edge_test,
};
use crate::ray32::Ray32;
use crate::simd::vector::{Portable8, Portable16};
use crate::simd::{F32x8, Row, Vector, WIDE};
use crate::tree::BLOCK;
use crate::tree::Corners;
use crate::tree::filter_start::FilterStart;
use crate::tree::node::TreeSpace;
use crate::tree::triangle_block::{TriangleBlock, shared_row};

pub(crate) struct Portable;

/// How a line passes the edges of eight triangles.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Edges {
    /// The edge functions.
    values: [[f32; BLOCK]; 3],
    /// Of the corners.
    heights: [[f32; BLOCK]; 3],
    /// By how much the edge functions and the heights may be wrong.
    error: [f32; BLOCK],
    height_error: [f32; BLOCK],
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
impl Simd for Portable {
    type F32x8 = Portable8;
    type Edges = Edges;
    type F32x16 = Portable16;

    #[inline]
    fn isa() -> Isa {
        Isa(Set::Portable)
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
    fn f32_corners(block: &TriangleBlock, ray: &F32Ray) -> [[Self::F32x8; 3]; 3] {
        let splat = Self::F32x8::splat;
        let [kx, ky, kz] = ray.axes.order();
        let mut room = CornersRoom::new();
        let corners = Self::corners(block, &mut room);
        let mut sheared = [[splat(0.0); 3]; 3];
        for corner in 0..3 {
            // All three with the sign turned, which their products do not have.
            let z = splat(ray.origin[2]) - Self::F32x8::load(&corners[kz][corner]);
            let across = splat(ray.origin[0]) - Self::F32x8::load(&corners[kx][corner]);
            let up = splat(ray.origin[1]) - Self::F32x8::load(&corners[ky][corner]);
            sheared[0][corner] = across - splat(ray.shear[0]) * z;
            sheared[1][corner] = up - splat(ray.shear[1]) * z;
            sheared[2][corner] = z;
        }
        sheared
    }

    #[inline]
    fn f32_rows(rays: &[Ray32; WIDE], rows: &mut [Row<f32>; 8]) {
        for (i, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                rows[axis].0[i] = ray.origin[axis];
                rows[4 + axis].0[i] = ray.direction[axis];
            }
            (rows[3].0[i], rows[7].0[i]) = (ray.t_min, ray.t_max);
        }
    }

    #[inline]
    fn columns(rays: &[Ray; WIDE], columns: &mut [Row<f64>; 8]) {
        for (i, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                columns[axis].0[i] = ray.origin[axis];
                columns[3 + axis].0[i] = ray.direction[axis];
            }
            (columns[6].0[i], columns[7].0[i]) = (ray.t_min, ray.t_max);
        }
    }

    #[inline]
    fn intersect_triangles(block: &TriangleBlock, ray: &BlockRay) -> (u32, Edges) {
        let mut x = [[0.0; BLOCK]; 3];
        let mut y = [[0.0; BLOCK]; 3];
        let mut z = [[0.0; BLOCK]; 3];
        let [kx, ky, kz] = ray.axes.order();
        let (origin, rest, shear) = (&ray.origin, &ray.rest, &ray.shear);
        let mut room = CornersRoom::new();
        let corners = Self::corners(block, &mut room);
        for corner in 0..3 {
            let [across, up, along] = [kx, ky, kz].map(|axis| &corners[axis][corner]);
            for lane in 0..BLOCK {
                // All three with the sign turned, which their products do not have.
                let height = origin[2] - along[lane];
                x[corner][lane] = ((origin[0] - across[lane]) + rest[0]) - shear[0] * height;
                y[corner][lane] = ((origin[1] - up[lane]) + rest[1]) - shear[1] * height;
                z[corner][lane] = height;
            }
        }
        let mut mask = 0;
        let mut values = [[0.0; BLOCK]; 3];
        let (mut error, mut height_error) = ([0.0; BLOCK], [0.0; BLOCK]);
        for lane in 0..BLOCK {
            let edge = |p: usize, q: usize| x[p][lane] * y[q][lane] - y[p][lane] * x[q][lane];
            let (u, v, w) = (edge(2, 1), edge(0, 2), edge(1, 0));
            let across = (0..3).fold(0.0f32, |most, i| most.max(x[i][lane].abs()).max(y[i][lane].abs()));
            let along = (0..3).fold(0.0f32, |most, i| most.max(z[i][lane].abs()));
            let size = (across + along) + ray.least_size;
            error[lane] = (size * EDGE_ERROR) * (size * SIZE_ERROR + across) + TINY;
            height_error[lane] = size * HEIGHT_ERROR;
            let (least, most) = (u.min(v).min(w), u.max(v).max(w));
            mask |= u32::from(least >= -error[lane] || most <= error[lane]) << lane;
            (values[0][lane], values[1][lane], values[2][lane]) = (u, v, w);
        }
        (mask & block.taken(), Edges { values, heights: z, error, height_error })
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
    fn corners<'a>(block: &'a TriangleBlock, room: &'a mut CornersRoom) -> &'a Corners {
        if block.is_unshared() {
            return block.own_corners();
        }
        let CornersRoom(corners) = room;
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
    fn place_crossings(edges: &Edges, ray: &BlockRay) -> Crossings<Portable8> {
        let (mut all_in_range, mut sure) = (0, 0);
        let (mut froms, mut tos) = ([0.0; BLOCK], [0.0; BLOCK]);
        for lane in 0..BLOCK {
            let [u, v, w] = [edges.values[0][lane], edges.values[1][lane], edges.values[2][lane]];
            let [a, b, c] = [edges.heights[0][lane], edges.heights[1][lane], edges.heights[2][lane]];
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let error = edges.error[lane];
            let det = u + v + w;
            let weight = det.abs();
            let height = u * a + v * b + w * c + det * ray.rest[2];
            let is_turned = ray.turn.is_sign_negative() != det.is_sign_negative();
            let ahead = if is_turned { -height } else { height };
            let height_error = edges.height_error[lane];
            let along_edges = height_error * (error * ERRORS_OF_EDGES + weight) + TINY;
            let spread = (error * ERRORS_OF_EXTENT) * (high - low) + along_edges;
            let (from, to) = (ahead - spread, ahead + spread);
            // What is no number may be in range.
            let is_out = to < ray.range.first * weight || from > ray.range.last * weight;
            all_in_range |= u32::from(!is_out) << lane;
            let (least, most) = (u.min(v).min(w), u.max(v).max(w));
            let is_inside = least > error || most < -error;
            let is_in_range = ray.range.surely_first * weight <= from && to <= ray.range.surely_last * weight;
            sure |= u32::from(is_inside && is_in_range) << lane;
            let inverse = 1.0 / weight;
            (froms[lane], tos[lane]) = (from * inverse, to * inverse);
        }
        Crossings { in_range: all_in_range, sure, from: Portable8::load(&froms), to: Portable8::load(&tos) }
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
