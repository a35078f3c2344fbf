//! Rays in single precision as they are tested against triangles: see the proof in `trace::f32_ray`.

use super::Axes;
use crate::simd::Vector;

/// A ray in single precision among triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F32Ray {
    /// The axes that become x, y and z; z is the direction's largest.
    pub(crate) axes: &'static Axes,
    /// Relative to the mesh, in the order of the axes; the last of four is the smallest `t`.
    pub(crate) origin: [f32; 4],
    /// The direction by its z, of which x and y count; the last of four is the largest `t`.
    pub(crate) shear: [f32; 4],
    /// From what is behind a corner, with the sign turned, to `t`.
    pub(crate) minus_inverse: f32,
}

/// Where weights are precise enough: the largest product times the extent of the triangle and a little is no more than their sum times
/// so much. See above.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Precise {
    /// The same by the longest side of all boxes in place of the extent: where the largest product is no more than the sum times this, one
    /// need not look at heights. What these are wrong by, as rounded, is less than the little.
    at_once: f32,
    most: f32,
    little: f32,
}

impl Precise {
    /// For a tree in which no side of a triangle's box is longer, but for rounding.
    pub(crate) fn new(space_per_unit: f32, longest_side: f32) -> Self {
        let most = 2.0 * space_per_unit;
        let little = most * (1.0 / 1024.0);
        // More than what rounding may take away, here and of the side.
        const MORE: f32 = 1.0 + 8.0 * f32::EPSILON;
        Self { at_once: most / (MORE * (longest_side + little)), most, little }
    }

    /// A bit for each of the mask that is: by the largest product, how far within the triangle the line is, the sum of the edge functions, and the
    /// heights of the corners. Other bits mean nothing.
    #[inline(always)]
    pub(crate) fn of<V: Vector>(&self, mask: u32, largest: V, within: V, sum: V, z: [V; 3]) -> u32 {
        let is_strict = V::splat(0.0).below(within);
        let largest = largest + V::splat(TINY);
        let sum = sum.abs();
        let at_once = is_strict & largest.at_most(sum * V::splat(self.at_once));
        if mask & !at_once == 0 {
            return at_once;
        }
        let extent = z[0].max(z[1]).max(z[2]) - z[0].min(z[1]).min(z[2]);
        let least = largest * (extent + V::splat(self.little));
        at_once | is_strict & least.at_most(sum * V::splat(self.most))
    }
}

/// The least of the edge functions, or of their opposites, whichever is more: how far within the triangle the line is.
#[inline(always)]
pub(crate) fn within<V: Vector>([u, v, w]: [V; 3]) -> V {
    let opposite = u.max(v).max(w).turned_by(V::splat(-0.0));
    u.min(v).min(w).max(opposite)
}

/// What products may lose by underflow is nothing beside this.
const TINY: f32 = 1.0 / (1u128 << 80) as f32;
