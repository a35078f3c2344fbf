//! Custom geometry under a map.

use std::sync::Arc;

use lumbre_geometry::{Aabb, NearestPoint, NearestPointError, Ray, Root, Roots, Surface, similarity_factor};
use lumbre_kernel::CustomGeometry;
use lumbre_math::{DVec3, Transform};

use crate::placed_bounds::moved;

/// Geometry under a map.
#[derive(Debug)]
struct Placed {
    geometry: Arc<dyn CustomGeometry>,
    world_from_object: Transform,
}

/// The geometry under a map; itself where the map is the identity.
pub(crate) fn placed(
    geometry: Arc<dyn CustomGeometry>,
    world_from_object: Transform,
) -> Arc<dyn CustomGeometry> {
    if world_from_object.is_identity() { geometry } else { Arc::new(Placed { geometry, world_from_object }) }
}

/// The box around bounded geometry under a map; `None` if a part of it is infinite.
pub(crate) fn bounds(geometry: &dyn CustomGeometry, world_from_object: &Transform) -> Option<Aabb> {
    (0..geometry.primitive_count()).try_fold(Aabb::EMPTY, |bounds, primitive| {
        Some(bounds.union(moved(&geometry.bounds(primitive)?, world_from_object)))
    })
}

impl CustomGeometry for Placed {
    fn primitive_count(&self) -> u32 {
        self.geometry.primitive_count()
    }

    fn bounds(&self, primitive: u32) -> Option<Aabb> {
        // The corners were rounded by the map.
        Some(moved(&self.geometry.bounds(primitive)?, &self.world_from_object).outward(4))
    }

    fn closest(&self, primitive: u32, ray: &Ray) -> Option<Root> {
        self.geometry.closest(primitive, &ray.into_object(&self.world_from_object))
    }

    fn roots(&self, primitive: u32, ray: &Ray, out: &mut Roots) {
        self.geometry.roots(primitive, &ray.into_object(&self.world_from_object), out);
    }

    fn surface(&self, primitive: u32, ray: &Ray, root: &Root) -> Surface {
        let surface = self.geometry.surface(primitive, &ray.into_object(&self.world_from_object), root);
        surface.placed(&self.world_from_object)
    }

    fn closest_point(&self, primitive: u32, point: DVec3) -> Result<NearestPoint, NearestPointError> {
        let factor = similarity_factor(&self.world_from_object).ok_or(NearestPointError::Map)?;
        let found = self.geometry.closest_point(primitive, self.world_from_object.inverse_point(point))?;
        let point = self.world_from_object.point(found.point);
        Ok(NearestPoint { point, distance: factor * found.distance, ..found })
    }

    fn winding_number(&self, point: DVec3) -> Option<f64> {
        self.geometry.winding_number(self.world_from_object.inverse_point(point))
    }

    fn any(&self, primitive: u32, ray: &Ray) -> bool {
        self.geometry.any(primitive, &ray.into_object(&self.world_from_object))
    }
}
