//! The nearest point of a torus.

use lumbre_math::{DVec2, DVec3, Elementary, Transform};

use super::Torus;
use crate::nearest::under_similarity;
use crate::{NearestPoint, NearestPointError};

impl Torus {
    /// The nearest point to `p` under a similarity.
    ///
    /// # Errors
    /// [`NearestPointError::Map`] for other maps.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        under_similarity(world_from_object, p, |p| {
            let local = self.framed(p - self.center);
            let rho = local.x.hypotenuse(local.y);
            let outward = if rho > 0.0 { DVec2::new(local.x, local.y) / rho } else { DVec2::X };
            // The plane through the axis and the point intersects the torus in two circles.
            let near = DVec2::new(rho - self.major, local.z);
            let far = DVec2::new(-rho - self.major, local.z);
            let distance = |tube: DVec2| (tube.length() - self.minor).abs();
            let (surface, distance) = if distance(near) <= distance(far) {
                (self.surface_on(outward, near), distance(near))
            } else {
                (self.surface_on(-outward, far), distance(far))
            };
            NearestPoint { point: surface.point, distance, part: 0, uv: surface.uv }
        })
    }
}
