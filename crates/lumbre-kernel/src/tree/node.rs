//! Sixteen-wide nodes, and the single-precision ray that is tested against their boxes without losing a hit.
//!
//! # Error bound
//!
//! All coordinates are in tree units: relative to the tree's origin, times a power of two, so that every plane of a box
//! is an f32 `p` with |p| ≤ 1.01. A ray is moved there in f64, as `o + s d`, where `s = t * s_per_t + s_at_zero` is
//! never negative within its range.
//!
//! A ray that starts near the tree keeps its start: `o` is its start, |o| ≤ 16 on each axis, `d` its direction, whose
//! largest component is between 2⁻²⁰ and 2²⁰, and `s = t`. For any other ray, the direction is scaled by a power of two
//! until its largest component lies in [1, 2), and `o` lies slightly before the point of the line nearest to the tree's
//! origin, so that a ray from far away is as precise as one from nearby.
//!
//! A hit's point, as the leaf computed it, lies within `slop` (tree units, on each axis) of its box and of the line
//! `o + s d`: the f64 arithmetic of leaves, instances and of this set-up has an error of a few 2⁻⁵³ of the coordinates
//! involved. `slop` allows 2⁻⁴⁷ of them times the condition of the transforms, and at least 2⁻⁴⁰.
//!
//! On one axis let `R = 1/d > 0` and `p` be the lower plane; the hit has `s ≥ (p - o - slop) R` exactly. We compute
//! `near = p r + c` with `r = f32(R)`, `|r - R| ≤ u|R|`, u = 2⁻²⁴, and `c = f32(-o R - e)`, wrong by `u|R||o|` and what
//! is small compared with it. With a fused multiply-add, `near ≤ p R - o R - e + u|R|(2|p| + 2|o|)(1 + 4u)`; with a
//! separate product, one `u|R||p|` more. So `e = |R| (4u (1.01 + |o|) + slop)` makes `near` no greater than the hit's
//! `s`. The same holds mirrored for the far planes, and for R < 0 with the planes exchanged.
//!
//! A ray may also be rounded before: `o`, `d` and `R` in single precision are off by `u|o|`, `u|d|` and a little more
//! than `2u|R|`. Then `p r` is off by `2.01u|R||p|`, `o r` by `3.1u|R||o|`, and three roundings (one of a separate
//! product among them, for each of the two) add `2u|R||p| + 3u|R||o|` and what is small compared with it: `e = |R| (8u
//! (1.01 + |o|) + slop)` has room for all of it.
//!
//! A component below 2⁻⁶⁰ of the lower bound on the largest component, including zeros of both signs, is replaced by
//! that bound: a hit lies within |s d| ≤ 20 + 12 slop on the largest axis, where that moves the line by less than 2⁻⁵⁴
//! (1 + slop), which `slop` covers as well. So there is no division by zero, no 0·∞, and no NaN. If the scaling itself
//! overflows (coordinates beyond 1e±150 of the tree's size), the ray passes every box: slow, but right.
//!
//! An absent child has inverted planes of ±f32::MAX. Since |c| is far below f32::MAX |r|, every ray enters it at more
//! than 2¹⁰⁶ and leaves it before zero: no ray meets it.

use bytemuck::{Pod, Zeroable};
use lumbre_math::DVec3;

/// References to children: four bits for the kind, and 28 for the index.
pub(crate) mod tag {
    /// Bit offset of the kind.
    pub(crate) const SHIFT: u32 = 28;
    /// The bits of the index.
    pub(crate) const PLACE: u32 = (1 << SHIFT) - 1;

    /// A node.
    pub(crate) const INNER: u32 = 0;
    /// Consecutive triangle blocks: see `triangle_block`.
    pub(crate) const TRIANGLES: u32 = 1;
    /// Consecutive leaf entries that are shapes.
    pub(crate) const SHAPES: u32 = 2;
    /// One leaf entry that is an instance.
    pub(crate) const INSTANCE: u32 = 3;
    /// Consecutive leaf entries of custom geometry.
    pub(crate) const CUSTOM: u32 = 4;
    /// Consecutive sphere blocks: see `sphere_block`.
    pub(crate) const SPHERES: u32 = 5;
    /// Consecutive leaf entries of triangles in double precision.
    pub(crate) const PRECISE: u32 = 6;
    /// A mark on the stack where the ray entered an instance; not a child.
    pub(crate) const RETURN: u32 = 15;

    pub(crate) const fn reference(tag: u32, place: u32) -> u32 {
        tag << SHIFT | place
    }

    /// The kind of a reference.
    #[inline(always)]
    pub(crate) const fn of(reference: u32) -> u32 {
        reference >> SHIFT
    }

    /// The index of a reference.
    #[inline(always)]
    pub(crate) const fn place(reference: u32) -> usize {
        (reference & PLACE) as usize
    }

    /// Whether a reference is to a node.
    #[inline(always)]
    pub(crate) const fn is_inner(reference: u32) -> bool {
        of(reference) == INNER
    }

    /// Maximum blocks in a leaf of triangles or spheres.
    pub(crate) const MAX_BLOCKS: u32 = 1 << COUNT_BITS;
    /// Number of indices that blocks may have.
    pub(crate) const BLOCK_PLACES: u32 = 1 << (SHIFT - COUNT_BITS);
    const COUNT_BITS: u32 = 3;

    /// A leaf of triangles: 25 bits for its first block, three for the number of blocks, 1 to 8. In a packed tree, the
    /// index is the line where the first block begins.
    pub(crate) const fn triangles(first: u32, count: u32) -> u32 {
        reference(TRIANGLES, first << COUNT_BITS | (count - 1))
    }

    /// A leaf of spheres, in the same encoding.
    pub(crate) const fn spheres(first: u32, count: u32) -> u32 {
        reference(SPHERES, first << COUNT_BITS | (count - 1))
    }

    /// The blocks of a leaf of triangles or of spheres.
    #[inline(always)]
    pub(crate) const fn blocks(reference: u32) -> std::ops::Range<usize> {
        let first = place(reference) >> COUNT_BITS;
        first..first + (reference & (MAX_BLOCKS - 1)) as usize + 1
    }
}

/// Panics at a reference that is not of its tree. The message lacks the reference, because every step would have to
/// keep it.
#[cold]
#[inline(never)]
pub(crate) fn out_of_tree() -> ! {
    panic!("a reference leads out of its tree")
}

/// Children of a node.
pub(crate) const WIDTH: usize = 16;

/// Up to sixteen boxes and references to their contents.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Lower and upper x, y and z planes of the boxes: `planes[2 * axis + side]`.
    pub(crate) planes: [[f32; WIDTH]; 6],
    /// Tagged references in the first lanes; [`Node::ABSENT`] in the others. An any-hit search tests the last child
    /// first: it has the best odds of a hit for its cost, or the largest box; see
    /// [`occlusion_order`](crate::build::occlusion_order).
    pub(crate) children: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 7 * 64);

impl Node {
    /// A node without children: its boxes are inverted.
    pub(crate) const EMPTY: Self = {
        let (low, high) = ([f32::MAX; WIDTH], [-f32::MAX; WIDTH]);
        Self { planes: [low, high, low, high, low, high], children: [Self::ABSENT; WIDTH] }
    };

    /// The reference of an absent child.
    pub(crate) const ABSENT: u32 = u32::MAX;

    /// Number of children.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.children.iter().position(|&child| child == Self::ABSENT).unwrap_or(WIDTH)
    }
}

/// The units of a tree's boxes.
#[derive(Clone, Debug)]
pub(crate) struct TreeSpace {
    /// The point in space at zero.
    pub(crate) origin: DVec3,
    /// Tree units per unit of space; a power of two.
    pub(crate) scale: f64,
    /// Half the diagonal of the tree's bounds, in tree units.
    pub(crate) radius: f64,
    /// By how much the transforms in leaves may enlarge rounding errors; 1 without any.
    pub(crate) condition: f64,
    /// How far from zero a ray may start on each axis to count as nearby; negative if no ray does.
    pub(crate) near: f64,
    /// The origin, padded with a zero.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code, reason = "for AVX alone"))]
    pub(crate) padded_origin: [f64; 4],
    /// For rays from nearby, by how much planes are moved: a constant, and a factor of the ray's start.
    pub(crate) near_margin: f64,
    pub(crate) margin_per_distance: f64,
}

impl TreeSpace {
    pub(crate) fn new(origin: DVec3, scale: f64, radius: f64, condition: f64) -> Self {
        let reach = 2.0 * origin.abs().max_element() * scale + NEAR + 1.0;
        let slop = slop(condition, reach);
        Self {
            origin,
            scale,
            radius,
            condition,
            // Also negative if the slop is NaN.
            near: if slop < 1.0 / 65536.0 { NEAR } else { -1.0 },
            padded_origin: [origin.x, origin.y, origin.z, 0.0],
            near_margin: 4.0 * ROUNDOFF * LARGEST_PLANE + slop,
            margin_per_distance: 4.0 * ROUNDOFF,
        }
    }
}

impl TreeSpace {
    /// The maximum distance between a box and its contents, in tree units, seen from a point in space.
    pub(crate) fn slop_of(&self, point: DVec3) -> f64 {
        slop(self.condition, (point.abs() + self.origin.abs()).max_element() * self.scale + 1.0)
    }

    /// That distance for any ray from nearby.
    pub(crate) fn nearby_slop(&self) -> f64 {
        self.near_margin - 4.0 * ROUNDOFF * LARGEST_PLANE
    }

    /// For rounded rays, by how much planes are moved: a constant, and a factor of the ray's start.
    pub(crate) fn single_margin(&self) -> f32 {
        round_up(8.0 * ROUNDOFF * LARGEST_PLANE + self.nearby_slop())
    }

    pub(crate) const SINGLE_MARGIN_PER_DISTANCE: f32 = (8.0 * ROUNDOFF) as f32;

    /// For single-precision rays, by how much planes are moved: a constant, and a factor of the ray's start. `shift` is
    /// the distance of zero from the mesh's origin on each axis, in tree units. See `trace::f32_ray`.
    pub(crate) fn f32_margin(&self, shift: f64) -> f32 {
        round_up(f64::from(self.single_margin()) + ROUNDOFF * (56.0 + 2.0 * shift))
    }

    pub(crate) const F32_MARGIN_PER_DISTANCE: f32 = (24.0 * ROUNDOFF) as f32;
}

const NEAR: f64 = 16.0;
/// Bounds on the largest component of a nearby ray's direction, in tree units.
pub(crate) const SMALLEST_NEAR: f64 = 1.0 / (1u64 << 20) as f64;
pub(crate) const LARGEST_NEAR: f64 = (1u64 << 20) as f64;
/// Components of a nearby ray's direction below this are replaced.
pub(crate) const TINY_NEAR: f64 = TINY_DIRECTION * SMALLEST_NEAR;
pub(crate) const ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
pub(crate) const TINY_DIRECTION: f64 = 1.0 / (1u64 << 60) as f64;
/// The bound on |p| in the proof.
pub(crate) const LARGEST_PLANE: f64 = 1.01;

pub(crate) fn slop(condition: f64, reach: f64) -> f64 {
    f64::from_bits((1023 - 40) << 52) + f64::from_bits((1023 - 47) << 52) * condition * reach
}

/// An f32 no smaller than `x`.
#[inline(always)]
pub(crate) fn round_up(x: f64) -> f32 {
    (x as f32).next_up()
}
