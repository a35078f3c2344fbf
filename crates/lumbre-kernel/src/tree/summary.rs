//! The properties of a tree that decide how it is searched.

use lumbre_math::DVec3;

/// Properties of all the geometries of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Summary {
    /// Whether it holds only triangles.
    pub(crate) only_triangles: bool,
    /// Depth of nested instances.
    pub(crate) nesting: u32,
    /// Whether the corners of all triangles are relative to one origin.
    pub(crate) has_one_origin: bool,
    /// The origin of the first mesh; NaN without a mesh.
    pub(crate) first_origin: DVec3,
    /// The sizes of the tree's contents.
    pub(crate) sizes: Sizes,
    /// Whether the centres of all spheres are relative to one origin.
    pub(crate) has_one_cloud_origin: bool,
    /// Whether geometries in instances have masks.
    pub(crate) masks_within: bool,
}

/// The sizes of a tree's contents.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sizes {
    /// The largest coordinate of a triangle's corner, relative to its mesh's origin.
    pub(crate) largest_corner: f32,
    /// The longest side of a triangle's box, up to rounding.
    pub(crate) longest_side: f32,
    /// The largest coordinate of a sphere's centre, relative to its cloud's origin, plus a radius.
    pub(crate) sphere_reach: f64,
}

impl Sizes {
    /// Takes the larger sizes.
    pub(crate) fn grow(&mut self, other: &Self) {
        self.largest_corner = self.largest_corner.max(other.largest_corner);
        self.longest_side = self.longest_side.max(other.longest_side);
        self.sphere_reach = self.sphere_reach.max(other.sphere_reach);
    }
}
