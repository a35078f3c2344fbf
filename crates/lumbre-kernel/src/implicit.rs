//! Implicit surfaces in a tree.

use lumbre_geometry::{Aabb, ImplicitSurface, Ray, Root, Roots, Surface};
use lumbre_math::DVec3;

use crate::tree::geometry::CustomGeometry;

impl CustomGeometry for ImplicitSurface {
    fn primitive_count(&self) -> u32 {
        1
    }

    fn bounds(&self, _: u32) -> Option<Aabb> {
        Some(self.bounds())
    }

    fn closest(&self, _: u32, ray: &Ray) -> Option<Root> {
        self.closest(ray)
    }

    fn roots(&self, _: u32, ray: &Ray, out: &mut Roots) {
        out.extend(self.roots(ray));
    }

    fn surface(&self, _: u32, ray: &Ray, root: &Root) -> Surface {
        self.surface(ray, root)
    }

    fn winding_number(&self, point: DVec3) -> Option<f64> {
        Some(if self.contains(point) { 1.0 } else { 0.0 })
    }
}
