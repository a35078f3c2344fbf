//! The interaction of a ray with a surface.

use lumbre_geometry::{Ray, Surface};
use lumbre_math::rounding::offset_point;
use lumbre_math::{DVec3, Vec2};
use lumbre_shading::{Bsdf, LocalSurface, Material, ShadingFrame, ShadingNormals, Spectrum, TextureContext};

use crate::{Boundary, Emission, Footprint, LightId, LightSample, MaterialId};

/// A ray's hit with everything that a path needs to continue.
#[derive(Clone, Debug)]
pub struct Interaction<'s> {
    /// The surface; its normal is geometric and points outside.
    pub surface: Surface,
    /// The shading surface; its normal is on the side of the geometric one.
    pub shading: LocalSurface,
    /// The unit direction to the ray's origin.
    pub towards_origin: DVec3,
    /// Whether the ray hit the outside.
    pub front: bool,
    /// The context of texture lookups.
    pub at: TextureContext,
    /// The material; `None` for an interface.
    pub material: Option<&'s Material>,
    /// The number of the material: the same for all surfaces that have this material.
    pub material_id: MaterialId,
    /// The emission.
    pub emission: Option<&'s Emission>,
    /// The light that samples this surface.
    pub light: Option<LightId>,
    /// The media on the surface's sides, where these differ.
    pub boundary: Option<Boundary>,
    /// [`crate::ShapeDesc::index`] of the shape.
    pub shape: u32,
    /// The time of the ray.
    pub time: f64,
    /// The triangle or patch of a mesh, else 0.
    pub primitive: u32,
    /// The geometric surface in the space of its tree, for the densities of the light that samples it.
    pub(crate) geometric: Option<Box<Surface>>,
    /// The origin of rays that leave on the incident side.
    pub(crate) incident_origin: DVec3,
    /// The offset from the incident origin to the smooth surface implied by vertex normals, if that is above the face.
    pub(crate) terminator_offset: Option<DVec3>,
    /// The width of the footprint across the ray, and its growth with distance.
    pub(crate) width: f64,
    pub(crate) spread: f64,
}

impl<'s> Interaction<'s> {
    /// The uv for textures.
    pub fn uv(&self) -> Vec2 {
        self.at.uv
    }

    /// The radiance emitted towards the ray's origin.
    pub fn emitted(&self) -> Spectrum {
        let vertices = self.at.vertex.colour;
        self.emission.map_or(Spectrum::BLACK, |emission| emission.at(self.front, self.at.uv, vertices))
    }

    /// The material with mixtures resolved; `None` for an interface.
    pub fn resolved(&self) -> Option<&'s Material> {
        Some(self.material?.resolve(&self.at, self.towards_origin.as_vec3()))
    }

    /// The materials of a mixture, each with its share. A mixture whose own share is less than `least` is not
    /// split (see [`Material::parts`]).
    pub fn parts(&self, least: f32) -> impl Iterator<Item = (f32, &'s Material)> {
        let wo = self.towards_origin.as_vec3();
        self.material.into_iter().flat_map(move |material| material.parts(&self.at, wo, least))
    }

    /// The shading frame and the BSDF, with [`ShadingNormals::Lumbre`]; `None` for an interface.
    pub fn scattering(&self) -> Option<(ShadingFrame, Bsdf)> {
        let towards = self.towards_origin.as_vec3();
        self.resolved()?.shading(&self.at, &self.shading, towards, ShadingNormals::Lumbre)
    }

    /// The ray that leaves along a unit direction, offset by the error of the point.
    pub fn leave(&self, direction: DVec3) -> Ray {
        self.leave_from(self.start(direction), direction)
    }

    /// The ray that leaves along a unit direction from another origin, such as
    /// [`crate::Scene::unoccluded_terminator_origin`].
    pub fn leave_from(&self, start: DVec3, direction: DVec3) -> Ray {
        Ray::new(start, direction).at_time(self.time)
    }

    /// The segment to a light sample, shortened by the sample's own error.
    pub fn shadow_ray(&self, sample: &LightSample) -> Ray {
        self.shadow_ray_from(self.start(sample.towards), sample)
    }

    /// [`Self::shadow_ray`] from another origin.
    pub fn shadow_ray_from(&self, start: DVec3, sample: &LightSample) -> Ray {
        let Some(end) = sample.end else { return self.leave_from(start, sample.towards) };
        let stop = offset_point(end.point, end.error, end.normal, -sample.towards);
        // The range allows for rounding of the direction and of t.
        Ray::new(start, stop - start).with_range(0.0, 1.0 - f64::powi(2.0, -40)).at_time(self.time)
    }

    /// The corresponding point on the smooth surface implied by the vertex normals, on the incident side: the face plus
    /// the shadow terminator offset. `None` if the mesh is not smooth or the face is concave.
    ///
    /// Rays that go below the plane of the face but not below the smooth surface start there, so that the face, which
    /// only approximates it, does not occlude them.
    pub fn terminator_origin(&self) -> Option<DVec3> {
        Some(self.incident_origin + self.terminator_offset?)
    }

    /// The width of the footprint across the ray, and its growth with distance, also for rays that leave.
    pub fn cone(&self) -> (f64, f64) {
        (self.width, self.spread)
    }

    /// Whether there may be a terminator offset.
    pub fn has_terminator_offset(&self) -> bool {
        self.terminator_offset.is_some()
    }

    /// The origin of light sampling: off the surface on the incident side, so that an emissive surface is
    /// certain of its side.
    pub fn shadow_origin(&self) -> DVec3 {
        self.incident_origin
    }

    /// The footprint of a ray that leaves: with the width and spread of the incident one.
    pub fn footprint(&self) -> Footprint {
        if self.width > 0.0 {
            Footprint::Cone { width: self.width, spread: self.spread }
        } else {
            Footprint::Point
        }
    }

    /// The origin of rays along a direction, offset by the error of the point.
    #[inline]
    pub fn start(&self, direction: DVec3) -> DVec3 {
        let normal = self.surface.normal;
        if (normal.dot(direction) < 0.0) == (normal.dot(self.towards_origin) < 0.0) {
            return self.incident_origin;
        }
        self.surface.offset_origin(direction)
    }
}
