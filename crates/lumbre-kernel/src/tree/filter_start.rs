//! What rays need to start in single precision.

use lumbre_math::DVec3;

use super::node::{LARGEST_NEAR, ROUNDOFF, SMALLEST_NEAR, TINY_NEAR, TreeSpace, round_up};
use super::summary::Summary;
use crate::simd::Vector;

/// Deepest nesting of instances that is traversed in single precision: each level takes a few kilobytes of the thread's
/// stack.
const DEEPEST: u32 = 8;

/// The least size L of `intersect::watertight`, as a factor of the reach of the tree and its triangles.
pub(crate) const MIN_SIZE: f32 = 4.0 * ROUNDOFF as f32;

/// What a ray from nearby needs to start in single precision. The tree's triangles must be in single precision and
/// relative to one origin.
#[derive(Clone, Debug)]
pub(crate) struct FilterStart {
    /// The root of the tree.
    pub(crate) root: u32,
    /// Whether the tree holds only triangles in single precision.
    pub(crate) only_triangles: bool,
    /// The origin of the tree's boxes, padded with a zero.
    pub(crate) tree_origin: [f64; 4],
    /// The origin of the corners, padded with a zero.
    pub(crate) mesh_origin: [f64; 4],
    /// The latter in single precision, if that is exact: then the difference to a single-precision number has the same
    /// bits in either precision.
    pub(crate) single_mesh_origin: Option<[f32; 4]>,
    /// Tree units per unit of space.
    pub(crate) scale: f64,
    /// Maximum distance of a ray's start from zero on each axis, in tree units.
    pub(crate) farthest: [f32; 4],
    /// By how much planes are moved: a constant, and a factor of the ray's start.
    pub(crate) margin: f32,
    pub(crate) margin_per_distance: f32,
    /// The origin of the boxes minus that of the corners, in tree units, padded with a zero.
    pub(crate) shift: [f32; 4],
    /// By how much planes are moved for rays in single precision: see `trace::f32_ray`.
    pub(crate) f32_margin: f32,
    /// The scale, and its inverse.
    pub(crate) units_per_space: f32,
    pub(crate) space_per_unit: f32,
    /// When weights are precise enough.
    pub(crate) precise: Precise,
    /// The least size of a [`BlockRay`](crate::intersect::watertight::BlockRay) for any ray from nearby.
    pub(crate) least_size: f32,
    /// Bounds on the largest component of a direction (the upper one four times, to compare four components at once),
    /// and the least component, below which one is replaced.
    pub(crate) shortest: f32,
    pub(crate) longest: [f32; 4],
    pub(crate) tiny: f32,
}

impl FilterStart {
    /// `None` if the tree nests instances too deeply, has meshes of different origins, or is so small, so large or so
    /// far from its origin that single precision would overflow, underflow or be too coarse.
    pub(crate) fn new(summary: &Summary, tree_space: &TreeSpace, root: Option<u32>) -> Option<Self> {
        let two_to = |exponent: i32| 2.0f64.powi(exponent);
        // Without triangles, any origin is right.
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
            least_size: round_up(reach * f64::from(MIN_SIZE)),
            shortest: (SMALLEST_NEAR / tree_space.scale) as f32,
            longest: [(LARGEST_NEAR / tree_space.scale) as f32; 4],
            tiny: (TINY_NEAR / tree_space.scale) as f32,
        })
    }

    /// The start for single-precision rays that are relative to the mesh already, with wider boxes.
    pub(crate) fn relative_to_mesh(&self, room: f32) -> Self {
        let f32_margin = self.f32_margin + room;
        Self { mesh_origin: [0.0; 4], single_mesh_origin: Some([0.0; 4]), f32_margin, ..self.clone() }
    }
}

/// When weights are precise enough: when the largest product, times the triangle's extent plus `little`, is at most
/// `most` times the sum of the edge functions. See above.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Precise {
    /// The same bound with the longest side of all boxes instead of the extent. If the largest product is at most this
    /// many times the sum, the heights need no test; their rounding errors are below `little`.
    at_once: f32,
    most: f32,
    little: f32,
}

impl Precise {
    /// For a tree whose longest triangle box side is this, up to rounding.
    pub(crate) fn new(space_per_unit: f32, longest_side: f32) -> Self {
        let most = 2.0 * space_per_unit;
        let little = most * (1.0 / 1024.0);
        // More than rounding may remove, here and from the side.
        const MORE: f32 = 1.0 + 8.0 * f32::EPSILON;
        Self { at_once: most / (MORE * (longest_side + little)), most, little }
    }

    /// A bit for each lane of the mask with precise weights, by its largest product, how far the line is inside the
    /// triangle, the sum of the edge functions, and the heights of the corners. Other bits are undefined.
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

/// Larger than what products may lose by underflow.
const TINY: f32 = 1.0 / (1u128 << 80) as f32;
