//! A hit as far as POV-Ray's local illumination looks at it.

use lumbre_geometry::{Ray, Surface};
use lumbre_kernel::Hit;
use lumbre_math::{DVec2, DVec3};
use lumbre_shading::MaterialKind;
use lumbre_shading::pov::PovMaterial;

use crate::Scene;

/// A ray's hit with what POV-Ray's light needs of it: the part of an [`crate::Interaction`] without footprints, lights
/// and media. Its numbers are the same to the bit.
#[derive(Clone, Debug)]
pub struct PovHit<'s> {
    /// The surface; its normal is geometric and points outside.
    pub surface: Surface,
    /// The unit shading normal, on the side of the geometric one.
    pub smooth: DVec3,
    /// Whether the ray hit the outside.
    pub front: bool,
    /// The coordinates on the surface, in single precision.
    pub uv: DVec2,
    /// The material; `None` for those of other scenes.
    pub material: Option<&'s PovMaterial>,
    /// The unit direction to the ray's origin.
    towards_origin: DVec3,
    /// The origin of rays that leave on the incident side.
    incident_origin: DVec3,
    time: f64,
}

impl Scene {
    /// The hit of a ray.
    pub fn pov_hit(&self, ray: &Ray, hit: &Hit) -> PovHit<'_> {
        let (surface, smooth, material) = self.pov_surface(ray, hit);
        let direction = ray.direction / ray.direction.length();
        PovHit {
            smooth: smooth.as_dvec3(),
            front: surface.normal.dot(direction) < 0.0,
            uv: surface.uv.as_vec2().as_dvec2(),
            material: match material.map(|material| &material.kind) {
                Some(MaterialKind::Pov(material)) => Some(material),
                _ => None,
            },
            towards_origin: -direction,
            incident_origin: surface.offset_origin(-direction),
            time: ray.time,
            surface,
        }
    }
}

impl PovHit<'_> {
    /// The ray that leaves along a unit direction, offset by the error of the point.
    pub fn leave(&self, direction: DVec3) -> Ray {
        let normal = self.surface.normal;
        let is_incident = (normal.dot(direction) < 0.0) == (normal.dot(self.towards_origin) < 0.0);
        let start = if is_incident { self.incident_origin } else { self.surface.offset_origin(direction) };
        Ray::new(start, direction).at_time(self.time)
    }
}
