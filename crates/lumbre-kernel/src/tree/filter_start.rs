//! What rays need to start in single precision.

use lumbre_math::DVec3;

use super::node::{LARGEST_NEAR, ROUNDOFF, SMALLEST_NEAR, TINY_NEAR, TreeSpace, round_up};
use super::summary::Summary;
use crate::simd::Vector;

/// Instances within one another are traversed in single precision no deeper: each takes a few kilobytes of the thread's stack.
const DEEPEST: u32 = 8;

/// The smallest size L of `intersect::watertight`, by how far the tree and its triangles reach.
pub(crate) const LEAST_SIZE: f32 = 4.0 * ROUNDOFF as f32;

/// What a ray from nearby needs to start in single precision, in a tree where the corners of all triangles in single precision are
/// relative to one origin.
#[derive(Clone, Debug)]
pub(crate) struct FilterStart {
    /// Of the tree.
    pub(crate) root: u32,
    /// Whether it holds nothing but triangles in single precision.
    pub(crate) only_triangles: bool,
    /// What the tree's boxes are relative to, and a zero.
    pub(crate) tree_origin: [f64; 4],
    /// What the corners are relative to, and a zero.
    pub(crate) mesh_origin: [f64; 4],
    /// The latter in single precision, if nothing is lost by that: numbers in single precision then differ from it by the same, to the
    /// bit, in either precision.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code, reason = "for AVX alone"))]
    pub(crate) single_mesh_origin: Option<[f32; 4]>,
    /// Tree units per unit of space.
    pub(crate) scale: f64,
    /// How far from zero a ray may start on each axis, in tree units.
    pub(crate) farthest: [f32; 4],
    /// By how much planes are moved, and by how much more for each unit of the ray's start.
    pub(crate) margin: f32,
    pub(crate) margin_per_distance: f32,
    /// What the tree's boxes are relative to as seen from where the corners are, in tree units, and a zero.
    pub(crate) shift: [f32; 4],
    /// By how much planes are moved for rays in single precision: see `trace::f32_ray`.
    pub(crate) f32_margin: f32,
    /// The scale, and its inverse.
    pub(crate) units_per_space: f32,
    pub(crate) space_per_unit: f32,
    /// Where weights are precise enough.
    pub(crate) precise: Precise,
    /// That of [`BlockRay`](crate::intersect::watertight::BlockRay) for every ray from nearby.
    pub(crate) least_size: f32,
    /// The bounds on the largest component of a direction, the upper one four times, to be compared with four at once; and that below which
    /// one is replaced.
    pub(crate) shortest: f32,
    pub(crate) longest: [f32; 4],
    pub(crate) tiny: f32,
}

impl FilterStart {
    /// `None` where the tree holds instances too deep within one another or meshes with different origins, or is so small, so large or so
    /// far from its origin that single precision would overflow, underflow or tell nothing.
    pub(crate) fn new(summary: &Summary, tree_space: &TreeSpace, root: Option<u32>) -> Option<Self> {
        let two_to = |exponent: i32| 2.0f64.powi(exponent);
        // Without a triangle, any place will do.
        let has_triangles = summary.first_origin.is_finite() && summary.sizes.largest_corner > 0.0;
        let (mesh_origin, largest_corner) = if has_triangles {
            (summary.first_origin, f64::from(summary.sizes.largest_corner))
        } else {
            (tree_space.origin, 1.0 / tree_space.scale)
        };
        let shift = (tree_space.origin - mesh_origin).abs().max_element();
        let reach = tree_space.near / tree_space.scale + shift + largest_corner;
        let is_fit = summary.nesting <= DEEPEST
            && summary.has_one_origin
            && tree_space.near > 0.0
            && (two_to(-40)..=two_to(40)).contains(&tree_space.scale)
            && largest_corner > two_to(-39)
            && reach < two_to(38);
        let space_per_unit = (1.0 / tree_space.scale) as f32;
        let padded = |v: DVec3, last: f64| [v.x, v.y, v.z, last];
        root.filter(|_| is_fit).map(|root| Self {
            root,
            only_triangles: summary.only_triangles,
            tree_origin: padded(tree_space.origin, 0.0),
            mesh_origin: padded(mesh_origin, 0.0),
            single_mesh_origin: Some(mesh_origin.as_vec3())
                .filter(|single| single.as_dvec3() == mesh_origin)
                .map(|single| single.extend(0.0).to_array()),
            scale: tree_space.scale,
            farthest: [tree_space.near as f32, tree_space.near as f32, tree_space.near as f32, f32::INFINITY],
            margin: tree_space.single_margin(),
            margin_per_distance: TreeSpace::SINGLE_MARGIN_PER_DISTANCE,
            shift: ((tree_space.origin - mesh_origin) * tree_space.scale).extend(0.0).as_vec4().to_array(),
            f32_margin: tree_space.f32_margin(shift * tree_space.scale),
            units_per_space: tree_space.scale as f32,
            space_per_unit,
            precise: Precise::new(space_per_unit, summary.sizes.longest_side),
            least_size: round_up(reach * f64::from(LEAST_SIZE)),
            shortest: (SMALLEST_NEAR / tree_space.scale) as f32,
            longest: [(LARGEST_NEAR / tree_space.scale) as f32; 4],
            tiny: (TINY_NEAR / tree_space.scale) as f32,
        })
    }

    /// The same for rays in single precision that start relative to the mesh already, with more room around boxes.
    pub(crate) fn relative_to_mesh(&self, room: f32) -> Self {
        let f32_margin = self.f32_margin + room;
        Self { mesh_origin: [0.0; 4], single_mesh_origin: Some([0.0; 4]), f32_margin, ..self.clone() }
    }
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
        let is_strict = V::splat(0.0).simd_lt(within);
        let largest = largest + V::splat(TINY);
        let sum = sum.abs();
        let at_once = is_strict & largest.simd_le(sum * V::splat(self.at_once));
        if mask & !at_once == 0 {
            return at_once;
        }
        let extent = z[0].max(z[1]).max(z[2]) - z[0].min(z[1]).min(z[2]);
        let least = largest * (extent + V::splat(self.little));
        at_once | is_strict & least.simd_le(sum * V::splat(self.most))
    }
}

/// What products may lose by underflow is nothing beside this.
const TINY: f32 = 1.0 / (1u128 << 80) as f32;
