//! Area lights of an object with one placement, sampled at the time of the ray.

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_kernel::Placement;
use lumbre_math::{DVec2, DVec3, Transform};

use super::moving::swept;
use super::tree::{Emitter, Facing};
use super::{Light, LightPoint, LightSample};
use crate::placed_bounds::moved;
use crate::surface::SurfaceEntry;

/// A light in the space of an object, and the object's placement.
#[derive(Clone, Debug)]
pub struct PlacedLight {
    light: Box<Light>,
    placement: Placement,
}

impl PlacedLight {
    pub(crate) fn new(light: Light, placement: Placement) -> Self {
        Self { light: Box::new(light), placement }
    }

    /// The light in the object.
    pub(super) fn inner(&self) -> &Light {
        &self.light
    }

    pub(super) fn power(&self, scene_radius: f64) -> f64 {
        self.light.power(scene_radius)
    }

    pub(super) fn sample(
        &self,
        entries: &[SurfaceEntry],
        from: DVec3,
        time: f64,
        u: DVec2,
    ) -> Option<LightSample> {
        let map = self.placement.at(time);
        let mut sample = self.light.sample(entries, map.inverse_point(from), time, u)?;
        let end = sample.end?;
        let point = map.point(end.point);
        sample.towards = (point - from).try_normalize()?;
        sample.end = Some(LightPoint {
            point,
            error: map.point_error(end.point, end.error),
            normal: map.normal(end.normal).normalize_or_zero(),
        });
        Some(sample.of_density(growth(&map, sample.towards)))
    }

    /// Its entry in a light tree, at all times if it moves.
    pub(super) fn emitter(&self, entries: &[SurfaceEntry]) -> Option<Emitter> {
        let inner = self.light.emitters(entries);
        let bounds = inner.iter().fold(Aabb::EMPTY, |bounds, emitter| bounds.union(emitter.bounds));
        // From its power, which is the power in the world.
        let strength = self.light.power(0.0) / std::f64::consts::TAU;
        let bounds = match &self.placement {
            Placement::Still(map) => moved(&bounds, map).outward(8),
            Placement::Moving(motion) => swept(&bounds, motion),
        };
        (!inner.is_empty()).then_some(Emitter { bounds, facing: Facing::ANY, strength })
    }

    /// The surface, in the space of the object, at this point of a ray from `from`.
    pub(super) fn surface_at(&self, from: DVec3, point: DVec3, time: f64) -> Option<Surface> {
        let map = self.placement.at(time);
        self.light.surface_at(map.inverse_point(from), map.inverse_point(point), time)
    }

    /// `surface` is in the space of the object.
    pub(super) fn pdf(&self, ray: &Ray, surface: (&Surface, u32)) -> f64 {
        let map = self.placement.at(ray.time);
        let inner = ray.into_object(&map);
        let inner = Ray { direction: inner.direction.normalize(), ..inner };
        self.light.pdf(&inner, Some(surface)) * growth(&map, ray.direction)
    }
}

/// The factor by which a solid angle about a unit world-space direction grows in object space: |det L⁻¹| / |L⁻¹
/// d|³, since the volume of the cone over a small area |d|² dω at distance |d| scales with the determinant.
fn growth(map: &Transform, direction: DVec3) -> f64 {
    1.0 / (map.determinant().abs() * map.inverse_vector(direction).length().powi(3))
}
