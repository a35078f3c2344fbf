//! Rays in single precision for triangle tests: see the proof in `trace::f32_ray`.

use super::axes::Axes;
use crate::simd::Vector;

/// A ray in single precision among triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F32Ray {
    /// The axes that become x, y and z; z is the direction's largest.
    pub(crate) axes: &'static Axes,
    /// Relative to the mesh, in the order of the axes; the last of four is the smallest `t`.
    pub(crate) origin: [f32; 4],
    /// The direction divided by its z (only x and y are used); the last of four is the largest `t`.
    pub(crate) shear: [f32; 4],
    /// Converts a negated height to `t`.
    pub(crate) minus_inverse: f32,
}

/// The minimum of the edge functions or of their negations, whichever is larger: how far inside the triangle the line
/// is.
#[inline(always)]
pub(crate) fn within<V: Vector>([u, v, w]: [V; 3]) -> V {
    let opposite = u.max(v).max(w).xor_sign(V::splat(-0.0));
    u.min(v).min(w).max(opposite)
}
