//! Eight-wide nodes, and the single-precision ray that is tested against their boxes without ever losing a hit.
//!
//! # Why no hit is lost
//!
//! Everything here happens in the tree's own units: positions relative to the tree's origin, times a power of two, so
//! that every plane of a box is an f32 `p` with |p| ≤ 1.01. A ray is moved there in f64: its direction is scaled by a
//! power of two until its largest component lies in [1, 2), and its start is moved along it to the point `o` nearest
//! to the origin, so that a ray from far away is as precise as one from nearby. `s` counts along that ray, and
//! `s = t * t_scale - t_shift`.
//!
//! A hit's point, as the leaf computed it, lies within `slop` (tree units, on each axis) of its box and of the line
//! `o + s d`, for the f64 arithmetic of leaves, instances and of this set-up is wrong by a few 2⁻⁵³ of the coordinates
//! that take part; `slop` allows 2⁻⁴⁷ of them times the condition of the transforms, and at least 2⁻⁴⁰.
//!
//! On one axis let `R = 1/d > 0` and `p` be the lower plane; the hit has `s ≥ (p - o - slop) R` exactly. We compute
//! `near = p r + c` with `r = f32(R)`, `|r - R| ≤ u|R|`, u = 2⁻²⁴, and `c ≤ -o R - e`, rounded down. With a fused
//! multiply-add, `near ≤ p R - o R - e + u|R|(|p| + |p| + |o|)(1 + 4u)`; with a separate product, one `u|R||p|` more.
//! So `e = |R| (4u (1.01 + |o|) + slop)` makes `near` no greater than the hit's `s`. The same holds mirrored for the far
//! planes, and for R < 0 with the planes exchanged.
//!
//! A component |d| < 2⁻⁶⁰ (zeros of both signs among them) is replaced by ±2⁻⁶⁰: a hit lies within |s| ≤ 4 + slop, where
//! that moves the line by less than 2⁻⁵⁷ (1 + slop), which `slop` covers as well. So there is no division by zero, no
//! 0·∞, and no NaN. Where the scaling itself overflows (coordinates beyond 1e±150 of the tree's size), the ray passes
//! every box: slow, but right.

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

/// What a reference to a child names: three bits of tag, 29 bits of place.
pub(crate) mod tag {
    pub(crate) const SHIFT: u32 = 29;
    pub(crate) const PLACE: u32 = (1 << SHIFT) - 1;
    /// A node.
    pub(crate) const INNER: u32 = 0;
    /// Some triangle blocks in a row: see [`triangles`].
    pub(crate) const TRIANGLES: u32 = 1;
    /// The first of some leaf entries that are shapes.
    pub(crate) const SHAPES: u32 = 2;
    /// One leaf entry that is an instance.
    pub(crate) const INSTANCE: u32 = 3;
    /// The first of some leaf entries that are primitives of custom geometry.
    pub(crate) const CUSTOM: u32 = 4;
    /// Not a child: the mark on the stack where an instance was entered.
    pub(crate) const RETURN: u32 = 7;

    pub(crate) const fn reference(tag: u32, place: u32) -> u32 {
        tag << SHIFT | place
    }

    /// Blocks that a leaf of triangles may have.
    pub(crate) const MOST_BLOCKS: u32 = 1 << COUNT_BITS;
    /// Places that blocks may have.
    pub(crate) const BLOCK_PLACES: u32 = 1 << (SHIFT - COUNT_BITS);
    const COUNT_BITS: u32 = 3;

    /// A leaf of triangles: 26 bits for its first block, three for how many there are, 1 to 8.
    pub(crate) const fn triangles(first: u32, count: u32) -> u32 {
        reference(TRIANGLES, first << COUNT_BITS | (count - 1))
    }

    /// The blocks of a leaf of triangles.
    #[inline(always)]
    pub(crate) const fn blocks(reference: u32) -> std::ops::Range<usize> {
        let first = ((reference & PLACE) >> COUNT_BITS) as usize;
        first..first + (reference & (MOST_BLOCKS - 1)) as usize + 1
    }
}

/// Children of a node.
pub(crate) const WIDTH: usize = 8;

/// Up to eight boxes and what they hold.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Lower and upper x, y and z planes of the boxes: `planes[2 * axis + side]`.
    pub(crate) planes: [[f32; WIDTH]; 6],
    /// Tagged references; those from `len` on mean nothing.
    pub(crate) children: [u32; WIDTH],
    /// How many children there are, in the first lanes.
    pub(crate) len: u32,
}

const _: () = assert!(size_of::<Node>() == 256);

impl Node {
    /// A node without children: its boxes are inside out.
    pub(crate) const EMPTY: Self = {
        let (low, high) = ([f32::MAX; WIDTH], [-f32::MAX; WIDTH]);
        Self { planes: [low, high, low, high, low, high], children: [u32::MAX; WIDTH], len: 0 }
    };
}

/// The units in which a tree's boxes are kept.
#[derive(Clone, Debug)]
pub(crate) struct Units {
    /// What is at zero.
    pub(crate) origin: DVec3,
    /// Tree units per unit of space; a power of two.
    pub(crate) scale: f64,
    /// Half the diagonal of the tree's bounds, in tree units.
    pub(crate) radius: f64,
    /// How much the arithmetic of transforms in the leaves may enlarge rounding errors; 1 without any.
    pub(crate) condition: f64,
}

const ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
const TINY_DIRECTION: f64 = 1.0 / (1u64 << 60) as f64;
/// The bound on |p| that the proof uses.
const LARGEST_PLANE: f64 = 1.01;

/// A ray in tree units, ready for the boxes.
#[derive(Clone, Debug)]
pub(crate) struct BoxRay {
    pub(crate) inverse: [f32; 3],
    pub(crate) near_offset: [f32; 3],
    pub(crate) far_offset: [f32; 3],
    /// Index into [`Node::planes`] of the planes met first; the others are at that index with its last bit flipped.
    pub(crate) near_planes: [usize; 3],
    pub(crate) s_min: f32,
    pub(crate) s_max: f32,
    t_scale: f64,
    t_shift: f64,
    // The scaling overflowed: every box is taken.
    passes_all: bool,
}

impl BoxRay {
    /// The ray for a tree in these units; `None` where it passes by the tree altogether. The ray is finite, and its
    /// direction is not zero.
    #[inline(always)]
    pub(crate) fn new(units: &Units, ray: &Ray) -> Option<Self> {
        // Powers of two near the limits of the exponent go in two steps.
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
        let t_scale = units.scale / step / normaliser;

        let start = (ray.origin - units.origin) * units.scale;
        let t_shift = -start.dot(direction) / direction.length_squared();
        let anchor = start + t_shift * direction;
        let reach = (ray.origin.abs() + units.origin.abs()).max_element() * units.scale + 1.0;
        let slop =
            f64::from_bits((1023 - 40) << 52) + f64::from_bits((1023 - 47) << 52) * units.condition * reach;

        let distance_squared = anchor.length_squared();
        let fits = t_scale.is_normal() && slop < 1e6 && distance_squared.is_finite();
        if !fits {
            return Some(Self::passing_all());
        }
        let reach = 1.001 * units.radius + 4.0 * slop;
        if distance_squared > reach * reach {
            return None;
        }

        let mut boxes = Self { t_scale, t_shift, passes_all: false, ..Self::passing_all() };
        for axis in 0..3 {
            let d = direction[axis];
            let d = if d.abs() < TINY_DIRECTION { TINY_DIRECTION.copysign(d) } else { d };
            let inverse = 1.0 / d;
            let o = anchor[axis];
            let center = -o * inverse;
            let margin = inverse.abs() * (4.0 * ROUNDOFF * (LARGEST_PLANE + o.abs()) + slop);
            boxes.inverse[axis] = inverse as f32;
            boxes.near_offset[axis] = round_down(center - margin);
            boxes.far_offset[axis] = round_up(center + margin);
            boxes.near_planes[axis] = 2 * axis + usize::from(d < 0.0);
        }
        boxes.s_min = round_down(ray.t_min * t_scale - t_shift);
        boxes.s_max = round_up(ray.t_max * t_scale - t_shift);
        Some(boxes)
    }

    pub(crate) fn passing_all() -> Self {
        Self {
            inverse: [0.0; 3],
            near_offset: [f32::NEG_INFINITY; 3],
            far_offset: [f32::INFINITY; 3],
            near_planes: [0, 2, 4],
            s_min: f32::NEG_INFINITY,
            s_max: f32::INFINITY,
            t_scale: 1.0,
            t_shift: 0.0,
            passes_all: true,
        }
    }

    /// Leaves out what lies wholly beyond `t`.
    #[inline(always)]
    pub(crate) fn end_at(&mut self, t: f64) {
        if !self.passes_all {
            self.s_max = round_up(t * self.t_scale - self.t_shift);
        }
    }

    /// Leaves out what lies wholly before `t`.
    #[inline(always)]
    pub(crate) fn start_at(&mut self, t: f64) {
        if !self.passes_all {
            self.s_min = round_down(t * self.t_scale - self.t_shift);
        }
    }
}

/// An f32 no greater than `x`.
#[inline(always)]
pub(crate) fn round_down(x: f64) -> f32 {
    (x as f32).next_down()
}

/// An f32 no smaller than `x`.
#[inline(always)]
pub(crate) fn round_up(x: f64) -> f32 {
    (x as f32).next_up()
}
