//! What a tree holds, as far as it decides which search goes through it.

use lumbre_math::DVec3;

/// What is known of all the geometries of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Summary {
    /// Whether it holds nothing but triangles.
    pub(crate) only_triangles: bool,
    /// How many instances are around what is innermost.
    pub(crate) nesting: u32,
    /// Whether the corners of all triangles are relative to one origin.
    pub(crate) has_one_origin: bool,
    /// That of the first mesh; a NaN where there is none.
    pub(crate) first_origin: DVec3,
    /// The sizes of what was put into the tree.
    pub(crate) sizes: Sizes,
    /// Whether the centres of all spheres are relative to one origin.
    pub(crate) has_one_cloud_origin: bool,
    /// Whether geometries in instances have masks.
    pub(crate) masks_within: bool,
}

/// The sizes of what is put into a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sizes {
    /// No corner of a triangle has a larger coordinate, relative to its mesh's origin.
    pub(crate) largest_corner: f32,
    /// No side of the box of a triangle is longer, but for rounding.
    pub(crate) longest_side: f32,
    /// No coordinate of a sphere's centre, relative to its cloud's origin, plus a radius is larger.
    pub(crate) sphere_reach: f64,
}

impl Sizes {
    /// The larger ones.
    pub(crate) fn grow(&mut self, other: &Self) {
        self.largest_corner = self.largest_corner.max(other.largest_corner);
        self.longest_side = self.longest_side.max(other.longest_side);
        self.sphere_reach = self.sphere_reach.max(other.sphere_reach);
    }
}
