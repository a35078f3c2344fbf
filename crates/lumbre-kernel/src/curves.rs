//! Curves in a tree.

use lumbre_geometry::{Aabb, Curves, Ray, Root, Roots, Surface};

use crate::tree::geometry::CustomGeometry;

/// A primitive is a piece of a segment.
impl CustomGeometry for Curves {
    fn primitive_count(&self) -> u32 {
        self.primitive_count()
    }

    fn bounds(&self, primitive: u32) -> Option<Aabb> {
        Some(self.bounds(primitive))
    }

    fn closest(&self, primitive: u32, ray: &Ray) -> Option<Root> {
        self.closest(primitive, ray)
    }

    fn roots(&self, primitive: u32, ray: &Ray, out: &mut Roots) {
        self.roots(primitive, ray, out);
    }

    fn surface(&self, primitive: u32, ray: &Ray, root: &Root) -> Surface {
        self.surface(primitive, ray, root)
    }
}
