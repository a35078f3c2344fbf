//! A ray prepared for the spheres of a cloud.

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use crate::tree::Tree;
use crate::tree::sphere_block::SphereRay;

/// The ray for the spheres of one cloud, or of several clouds with one origin.
pub(crate) struct CloudRay {
    geometry: u32,
    /// The cloud's origin.
    origin: DVec3,
    /// The ray in single precision and its units of space per `t`; `None` if single precision is too coarse.
    spheres: Option<(SphereRay, f64)>,
}

impl CloudRay {
    /// Prepares the ray for a cloud, unless it already is.
    #[inline(always)]
    pub(crate) fn turn<'s>(
        slot: &'s mut Option<Self>,
        tree: &Tree,
        ray: &Ray,
        geometry: u32,
    ) -> &'s mut Self {
        // If all clouds have one origin, ids need not be read from memory.
        let is_turned = slot
            .as_ref()
            .is_some_and(|cloud| tree.summary.has_one_cloud_origin || cloud.geometry == geometry);
        if !is_turned {
            let origin = tree.cloud(geometry).origin;
            let spheres = SphereRay::new(ray, &origin, tree.summary.sizes.sphere_reach);
            *slot = Some(Self { geometry, origin, spheres });
        }
        slot.as_mut().expect("it was turned")
    }

    /// The origin of the cloud.
    pub(super) fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The ray in this range of `t`; `None` if single precision is too coarse.
    #[inline(always)]
    pub(crate) fn within(&mut self, [t_min, t_max]: [f64; 2]) -> Option<&SphereRay> {
        let (spheres, length) = self.spheres.as_mut()?;
        spheres.set_range(*length, t_min, t_max);
        Some(spheres)
    }
}
