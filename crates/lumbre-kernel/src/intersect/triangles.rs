//! A ray against the triangles of a block, in SIMD lanes: see [`BlockRay`] for the error bounds.

use bytemuck::Zeroable;

use super::axes::Axes;
use super::f32_ray::{F32Ray, within};
use super::watertight::{
    BlockRay, EDGE_ERROR, ERRORS_OF_EDGES, ERRORS_OF_EXTENT, HEIGHT_ERROR, SIZE_ERROR, TINY,
};
use crate::simd::{self, F32x8, F32x16, Vector};

/// A shear of triangle corners.
pub(crate) trait Shears {
    fn axes(&self) -> &'static Axes;
    /// In the order of the axes, here and below.
    fn origin(&self) -> &[f32; 4];
    fn shear(&self) -> &[f32; 4];
    /// The rounding error of the origin, if it matters.
    fn rest(&self) -> Option<&[f32; 4]>;

    /// Corners in the sheared space, negated, which leaves their products unchanged. So one operand can come from
    /// memory.
    #[inline(always)]
    fn apply<V: Vector>(&self, [x, y, z]: [V; 3]) -> [V; 3] {
        let (origin, shear) = (self.origin(), self.shear());
        let (shear_x, shear_y) = (V::splat(shear[0]), V::splat(shear[1]));
        let z = V::splat(origin[2]) - z;
        let across = V::splat(origin[0]) - x;
        let up = V::splat(origin[1]) - y;
        let Some(rest) = self.rest() else {
            // No fused multiply-add: the same on every machine.
            return [across - shear_x * z, up - shear_y * z, z];
        };
        let x = shear_x.neg_mul_add(z, across + V::splat(rest[0]));
        [x, shear_y.neg_mul_add(z, up + V::splat(rest[1])), z]
    }
}

impl Shears for BlockRay {
    #[inline(always)]
    fn axes(&self) -> &'static Axes {
        self.axes
    }

    #[inline(always)]
    fn origin(&self) -> &[f32; 4] {
        &self.origin
    }

    #[inline(always)]
    fn shear(&self) -> &[f32; 4] {
        &self.shear
    }

    #[inline(always)]
    fn rest(&self) -> Option<&[f32; 4]> {
        Some(&self.rest)
    }
}

impl Shears for F32Ray {
    #[inline(always)]
    fn axes(&self) -> &'static Axes {
        self.axes
    }

    #[inline(always)]
    fn origin(&self) -> &[f32; 4] {
        &self.origin
    }

    #[inline(always)]
    fn shear(&self) -> &[f32; 4] {
        &self.shear
    }

    #[inline(always)]
    fn rest(&self) -> Option<&[f32; 4]> {
        None
    }
}

/// Where a ray may meet the triangles of a block.
#[derive(Clone, Copy)]
pub(crate) struct Crossings<V> {
    /// A bit for each that may be met in the range if its line meets it; includes all that are.
    pub(crate) in_range: u32,
    /// A bit for each that is certainly met there.
    pub(crate) sure: u32,
    /// The interval of heights of each crossing.
    pub(crate) from: V,
    pub(crate) to: V,
}

impl<V: F32x8> Crossings<V> {
    /// The interval of heights of the crossing in a lane.
    #[inline(always)]
    pub(crate) fn between(&self, lane: usize) -> (f32, f32) {
        (self.from.lane(lane), self.to.lane(lane))
    }
}

/// How a line passes the edges of eight triangles, or two lines those of eight each.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Edges<V> {
    /// The edge functions.
    values: [V; 3],
    /// Of the corners.
    heights: [V; 3],
    /// The minimum of the edge functions or of their negations, whichever is larger: how far inside the triangle the
    /// line is.
    within: V,
    /// The negated error bound of the edge functions, and the heights.
    minus_error: V,
    height_error: V,
}

impl<V: Vector> Edges<V> {
    /// From corners in the sheared spaces of rays with these [`least_size`](BlockRay::least_size)s; also returns a bit
    /// for each triangle that may be met.
    #[inline(always)]
    pub(super) fn of([x, y, z]: [[V; 3]; 3], least_size: V) -> (u32, Self) {
        let u = x[2].mul_sub(y[1], y[2] * x[1]);
        let v = x[0].mul_sub(y[2], y[0] * x[2]);
        let w = x[1].mul_sub(y[0], y[1] * x[0]);
        let within = within([u, v, w]);
        let across = x[0].max_abs(y[0]).max(x[1].max_abs(y[1])).max(x[2].max_abs(y[2]));
        let along = z[0].max_abs(z[1]).max_abs(z[2]);
        let size = across + along + least_size;
        let minus_error = (size * V::splat(-EDGE_ERROR))
            .mul_sub(size.mul_add(V::splat(SIZE_ERROR), across), V::splat(TINY));
        let height_error = size * V::splat(HEIGHT_ERROR);
        let edges = Self { values: [u, v, w], heights: z, within, minus_error, height_error };
        (minus_error.simd_le(within), edges)
    }
}

impl<W: F32x16> Edges<W> {
    /// The edges of one of the two lines: `which` is 0 or 1.
    #[inline(always)]
    pub(crate) fn half(&self, which: usize) -> Edges<W::Half> {
        let Self { values: [u, v, w], heights: [a, b, c], within, minus_error, height_error } = self;
        Edges {
            values: [u.half(which), v.half(which), w.half(which)],
            heights: [a.half(which), b.half(which), c.half(which)],
            within: within.half(which),
            minus_error: minus_error.half(which),
            height_error: height_error.half(which),
        }
    }

    /// The edges of two lines.
    #[inline(always)]
    pub(super) fn of_two(first: &Edges<W::Half>, second: &Edges<W::Half>) -> Self {
        Self {
            values: simd::three_of_two(&first.values, &second.values),
            heights: simd::three_of_two(&first.heights, &second.heights),
            within: W::of_two(first.within, second.within),
            minus_error: W::of_two(first.minus_error, second.minus_error),
            height_error: W::of_two(first.height_error, second.height_error),
        }
    }
}

impl<V: F32x8> Edges<V> {
    /// Where along the ray they are met.
    #[inline(always)]
    pub(crate) fn place(&self, ray: &BlockRay) -> Crossings<V> {
        let &Self { values: [u, v, w], heights: z, within, minus_error, height_error } = self;
        let det = u + v + w;
        let weight = det.abs();
        let of_c = det.mul_add(V::splat(ray.rest[2]), w * z[2]);
        let height = v.mul_add(z[1], u * z[0]) + of_c;
        let ahead = height.xor_sign(V::splat(ray.turn).xor_sign(det));
        let inverse = V::splat(1.0) / weight;
        let low = z[0].min(z[1]).min(z[2]);
        let high = z[0].max(z[1]).max(z[2]);
        let along_edges =
            height_error.mul_add(minus_error.mul_add(V::splat(-ERRORS_OF_EDGES), weight), V::splat(TINY));
        let spread = (minus_error * V::splat(-ERRORS_OF_EXTENT)).mul_add(high - low, along_edges);
        let (from, to) = (ahead - spread, ahead + spread);
        let range = &ray.range;
        // NaN may be in range.
        let is_out =
            to.simd_lt(weight * V::splat(range.first)) | (weight * V::splat(range.last)).simd_lt(from);
        let is_inside = minus_error.xor_sign(V::splat(-0.0)).simd_lt(within);
        let is_surely_in_range = (weight * V::splat(range.surely_first)).simd_le(from)
            & to.simd_le(weight * V::splat(range.surely_last));
        Crossings {
            in_range: V::ALL & !is_out,
            sure: is_inside & is_surely_in_range,
            from: from * inverse,
            to: to * inverse,
        }
    }
}
