//! Rays for box tests, single and by sixteen: see the proof in [`node`](crate::tree::node).

use lumbre_geometry::Ray;

use super::axes::Sides;
use crate::simd::{F32x16, Row};
use crate::tree::node::{
    LARGEST_NEAR, LARGEST_PLANE, ROUNDOFF, SMALLEST_NEAR, TINY_DIRECTION, TINY_NEAR, TreeSpace, slop,
};

/// Moves the ends of a rounded range outwards, together with [`LITTLE`] at the far end.
pub(crate) const START_FACTOR: f32 = 1.0 - 4.0 * ROUNDOFF as f32;
pub(crate) const END_FACTOR: f32 = 1.0 + 4.0 * ROUNDOFF as f32;

/// A ray in tree units, ready for box tests.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    /// The last of four is unused.
    pub(crate) inverse: [f32; 4],
    /// The last is the start of the range: never negative.
    pub(crate) near_offset: [f32; 4],
    /// The last is the end of the range.
    pub(crate) far_offset: [f32; 4],
    /// The planes that the ray meets first.
    pub(crate) sides: &'static Sides,
}

impl Slabs {
    /// A ray that hits nothing.
    pub(crate) const ZERO: Self = Self {
        inverse: [0.0; 4],
        near_offset: [0.0; 4],
        far_offset: [0.0; 4],
        sides: Sides::OF_NONE_NEGATIVE,
    };

    #[inline(always)]
    pub(crate) fn s_min(&self) -> f32 {
        self.near_offset[3]
    }

    #[inline(always)]
    pub(crate) fn s_max(&self) -> f32 {
        self.far_offset[3]
    }

    #[inline(always)]
    pub(crate) fn start_at(&mut self, s_min: f32) {
        self.near_offset[3] = s_min;
    }

    /// Excludes boxes that the ray enters after this.
    #[inline(always)]
    pub(crate) fn end_at(&mut self, s_max: f32) {
        self.far_offset[3] = s_max;
    }
}

/// The ray and the map of its range.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxRay {
    pub(crate) slabs: Slabs,
    pub(crate) progress: Progress,
}

/// Maps the `t` of a ray to the `s` of box tests.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progress {
    s_per_t: f64,
    s_at_zero: f64,
}

impl Progress {
    /// Whether the ray keeps its start, because it starts nearby.
    #[inline(always)]
    pub(crate) fn is_nearby(&self) -> bool {
        self.s_per_t == 1.0 && self.s_at_zero == 0.0
    }
}

impl BoxRay {
    /// Sets up the ray from `t_min` to `t_max` for a tree in these units, if it starts nearby; returns whether it does.
    /// Also checks that the ray is valid.
    #[inline(always)]
    pub(crate) fn start_nearby(&mut self, tree_space: &TreeSpace, ray: &Ray, t_min: f64, t_max: f64) -> bool {
        let start = ((ray.origin - tree_space.origin) * tree_space.scale).to_array();
        let direction = (ray.direction * tree_space.scale).to_array();
        // Every comparison with a NaN is false.
        let fits =
            |axis: usize| start[axis].abs() <= tree_space.near && direction[axis].abs() <= LARGEST_NEAR;
        let is_long = |axis: usize| direction[axis].abs() >= SMALLEST_NEAR;
        let is_near = fits(0) && fits(1) && fits(2) && (is_long(0) || is_long(1) || is_long(2));
        if !(is_near && 0.0 <= t_min && t_min <= t_max) {
            return false;
        }
        self.set_slabs(start, direction, TINY_NEAR, tree_space.margin_per_distance, tree_space.near_margin);
        self.set_range_nearby(t_min, t_max);
        true
    }

    /// The range of a ray from nearby.
    #[inline(always)]
    pub(crate) fn set_range_nearby(&mut self, t_min: f64, t_max: f64) {
        self.progress = Progress { s_per_t: 1.0, s_at_zero: 0.0 };
        self.slabs.start_at(self.progress.down(t_min));
        self.slabs.end_at(self.progress.up(t_max));
    }

    /// Sets up the ray from `t_min` to `t_max` for a tree in these units, from any start; returns false if it misses
    /// the whole tree. The ray must be finite, and its direction not zero.
    #[cold]
    #[inline(never)]
    pub(crate) fn start_anywhere(
        &mut self,
        tree_space: &TreeSpace,
        ray: &Ray,
        t_min: f64,
        t_max: f64,
    ) -> bool {
        // Powers of two near the limits of the exponent take two steps.
        let largest = ray.direction.abs().max_element();
        let step = if largest < f64::from_bits(100 << 52) {
            f64::from_bits((1023 + 200) << 52)
        } else if largest > f64::from_bits(1900 << 52) {
            f64::from_bits((1023 - 200) << 52)
        } else {
            1.0
        };
        let exponent = (largest * step).to_bits() >> 52;
        let normaliser = f64::from_bits((2046 - exponent) << 52);
        let direction = ray.direction * step * normaliser;
        let s_per_t = tree_space.scale / step / normaliser;

        let start = (ray.origin - tree_space.origin) * tree_space.scale;
        let to_middle = -start.dot(direction) / direction.length_squared();
        let middle = start + to_middle * direction;
        let reach = (ray.origin.abs() + tree_space.origin.abs()).max_element() * tree_space.scale + 1.0;
        let slop = slop(tree_space.condition, reach);

        let distance_squared = middle.length_squared();
        let fits = s_per_t.is_normal() && slop < 1e6 && distance_squared.is_finite();
        if !fits {
            *self = Self::passing_all();
            return true;
        }
        let reach = 1.001 * tree_space.radius + 4.0 * slop;
        if distance_squared > reach * reach {
            return false;
        }
        // Hits lie within |p| ≤ 1.75 + 1.75 slop of the origin, and no farther than that from the middle.
        let back = 2.0 + 4.0 * slop;
        let start = middle - back * direction;
        let margin = 4.0 * ROUNDOFF * LARGEST_PLANE + slop;
        self.set_slabs(start.to_array(), direction.to_array(), TINY_DIRECTION, 4.0 * ROUNDOFF, margin);
        self.progress = Progress { s_per_t, s_at_zero: back - to_middle };
        self.slabs.start_at(self.progress.down(t_min));
        self.slabs.end_at(self.progress.up(t_max));
        true
    }

    /// A ray that enters every box and never ends.
    pub(crate) fn passing_all() -> Self {
        // Less than f32::MAX times the inverse, so that absent children stay missed.
        let far = f32::MAX * f32::EPSILON;
        let slabs = Slabs {
            inverse: [1.0; 4],
            near_offset: [-far, -far, -far, 0.0],
            far_offset: [far, far, far, f32::INFINITY],
            sides: Sides::OF_NONE_NEGATIVE,
        };
        Self { slabs, progress: Progress { s_per_t: 1.0, s_at_zero: f64::INFINITY } }
    }

    /// Inverse direction, offsets and sides: see the proof. `margin` is 4u · 1.01 + slop.
    #[inline(always)]
    fn set_slabs(
        &mut self,
        start: [f64; 3],
        direction: [f64; 3],
        tiny: f64,
        margin_per_distance: f64,
        margin: f64,
    ) {
        let mut signs = 0;
        for axis in 0..3 {
            let (o, d) = (start[axis], direction[axis]);
            let d = if d.abs() < tiny { tiny.copysign(d) } else { d };
            let inverse = 1.0 / d;
            let center = -o * inverse;
            let margin = inverse.abs() * (margin_per_distance * o.abs() + margin);
            self.slabs.inverse[axis] = inverse as f32;
            self.slabs.near_offset[axis] = (center - margin) as f32;
            self.slabs.far_offset[axis] = (center + margin) as f32;
            signs |= u32::from(d.is_sign_negative()) << axis;
        }
        self.slabs.sides = Sides::new(signs);
    }
}

/// A small number that is neither zero nor subnormal as an f32.
pub(crate) const LITTLE: f64 = 1.0 / (1u128 << 100) as f64;

impl Progress {
    /// `t` or slightly more; never negative. The rounding to single precision was compensated before.
    #[inline(always)]
    pub(crate) fn up(&self, t: f64) -> f32 {
        let s = t * self.s_per_t + self.s_at_zero;
        let above = s + s * (2.0 * ROUNDOFF) + LITTLE;
        (if above > 0.0 { above } else { 0.0 }) as f32
    }

    /// `t` or slightly less; 0 if that is negative.
    #[inline(always)]
    pub(crate) fn down(&self, t: f64) -> f32 {
        let s = t * self.s_per_t + self.s_at_zero;
        let below = s - s * (2.0 * ROUNDOFF) - LITTLE;
        (if below > 0.0 { below } else { 0.0 }) as f32
    }
}

/// A bound on all rays of a packet, for box tests: see `packet`.
pub(crate) struct Frustum {
    pub(crate) center: [f32; 3],
    pub(crate) least_inverse: [f32; 3],
    pub(crate) most_inverse: [f32; 3],
    /// Subtracted from where they enter, and added to where they leave.
    pub(crate) width: [f32; 3],
    pub(crate) s_min: f32,
    pub(crate) s_max: f32,
    pub(crate) sides: &'static Sides,
}

/// The rays for box tests, each as [`Slabs`].
pub(crate) struct SlabRows {
    pub(crate) inverse: [Row<f32>; 3],
    pub(crate) near_offset: [Row<f32>; 3],
    pub(crate) far_offset: [Row<f32>; 3],
    pub(crate) s_min: Row<f32>,
    /// The end of each.
    pub(crate) s_max: Row<f32>,
}

impl SlabRows {
    pub(crate) const NONE: Self = {
        let row = Row::of(0.0);
        Self { inverse: [row; 3], near_offset: [row; 3], far_offset: [row; 3], s_min: row, s_max: row }
    };

    /// The offsets on an axis for rays that start there; planes are moved by a constant margin plus one per unit of
    /// distance.
    #[inline(always)]
    pub(crate) fn set_axis<W: F32x16>(
        &mut self,
        axis: usize,
        from: W,
        inverse: W,
        [least, per_distance]: [f32; 2],
    ) {
        let distance = from.abs();
        let margin = inverse.abs() * distance.mul_add(W::splat(per_distance), W::splat(least));
        inverse.store(&mut self.inverse[axis]);
        from.neg_mul_add(inverse, W::splat(0.0) - margin).store(&mut self.near_offset[axis]);
        from.neg_mul_add(inverse, margin).store(&mut self.far_offset[axis]);
    }
}
