//! A place where light meets a surface, with all that a path needs to go on from there.

use lumbre_geometry::{Ray, Surface};
use lumbre_math::{DVec3, Vec2};
use lumbre_shading::{Bsdf, LocalSurface, Material, ShadingFrame, Spectrum, TextureContext};

use crate::light::{LightId, LightSample};
use crate::{Emission, Footprint, Scene};

/// Where a ray meets a surface.
#[derive(Clone, Debug)]
pub struct Interaction<'s> {
    /// The surface; its normal is geometric and points to the outside.
    pub surface: Surface,
    /// The shading surface; its normal is on the side of the geometric one.
    pub shading: LocalSurface,
    /// Unit, towards where the ray came from.
    pub towards_origin: DVec3,
    /// Whether the ray met the outside.
    pub front: bool,
    /// Where textures are looked up.
    pub at: TextureContext,
    /// What it is made of; `None` for an interface.
    pub material: Option<&'s Material>,
    /// The light that it gives off.
    pub emission: Option<&'s Emission>,
    /// The light that samples it.
    pub light: Option<LightId>,
    /// [`crate::ShapeDesc::index`] of the shape.
    pub shape: u32,
    /// When the ray looked.
    pub time: f64,
    /// The triangle or patch of a mesh, else 0.
    pub primitive: u32,
    /// The bare surface in the space of its tree, which the densities of lights are asked with; where a light samples it.
    pub(crate) bare: Option<Box<Surface>>,
    /// Where rays start that leave on the side that the ray came from.
    pub(crate) before: DVec3,
    /// From the point to the smooth surface that the normals of vertices tell of, where it stands off the face.
    pub(crate) rise: Option<DVec3>,
    /// Width of the footprint across the ray, and its growth with distance.
    pub(crate) width: f64,
    pub(crate) spread: f64,
}

impl<'s> Interaction<'s> {
    /// Surface parameters, as textures see them.
    pub fn uv(&self) -> Vec2 {
        self.at.uv
    }

    /// The radiance that it gives off towards the ray's origin.
    pub fn emitted(&self) -> Spectrum {
        let vertices = self.at.vertex.colour;
        self.emission.map_or(Spectrum::BLACK, |emission| emission.at(self.front, self.at.uv, vertices))
    }

    /// The one material that applies here; `None` for an interface.
    pub fn resolved(&self) -> Option<&'s Material> {
        Some(self.material?.resolve(&self.at, self.towards_origin.as_vec3()))
    }

    /// Every material of a mixture that applies here, with its share. A mixture whose own share is less than `least` is not
    /// taken apart (see [`Material::parts`]).
    pub fn parts(&self, least: f32) -> impl Iterator<Item = (f32, &'s Material)> {
        let wo = self.towards_origin.as_vec3();
        self.material.into_iter().flat_map(move |material| material.parts(&self.at, wo, least))
    }

    /// The shading frame and how the surface scatters; `None` for an interface.
    pub fn scattering(&self) -> Option<(ShadingFrame, Bsdf)> {
        self.resolved()?.shading(&self.at, &self.shading, self.towards_origin.as_vec3())
    }

    /// The ray that leaves along a unit direction, from beyond the error of the point.
    pub fn leave(&self, direction: DVec3) -> Ray {
        self.leave_from(self.start(direction), direction)
    }

    /// The ray that leaves along a unit direction from a place of its own, such as [`Interaction::risen`].
    pub fn leave_from(&self, start: DVec3, direction: DVec3) -> Ray {
        Ray::new(start, direction).at_time(self.time)
    }

    /// The segment to where the light comes from, short of it by its own error.
    pub fn shadow_ray(&self, sample: &LightSample) -> Ray {
        self.shadow_ray_from(self.start(sample.towards), sample)
    }

    /// The same from a place of its own.
    pub fn shadow_ray_from(&self, start: DVec3, sample: &LightSample) -> Ray {
        let Some(end) = sample.end else { return self.leave_from(start, sample.towards) };
        let stop = offset(end.point, end.error, end.normal, -sample.towards);
        // What rounds in the direction and in t.
        Ray::new(start, stop - start).with_range(0.0, 1.0 - f64::powi(2.0, -40)).at_time(self.time)
    }

    /// The place that belongs to the point on the smooth surface that the normals of vertices tell of, on the side that the ray
    /// came from; `None` where the surface is as smooth as it seems, the face bends the other way, or something
    /// stands between the two.
    ///
    /// From there leave rays that go under the plane of the face, though not under the smooth surface: the face, which is but a
    /// poor picture of it, does not stand in their way.
    pub fn risen(&self, scene: &Scene) -> Option<DVec3> {
        let rise = self.rise?;
        let way = self.leave_from(self.before, rise).with_range(0.0, 1.0);
        (!scene.is_occluded(&way)).then(|| self.before + rise)
    }

    /// Whether there may be such a place.
    pub fn may_rise(&self) -> bool {
        self.rise.is_some()
    }

    /// Where lights are sampled from: off the surface, on the side that the ray came from, so that a surface which shines
    /// is not in doubt about which side of itself it is on.
    pub fn lit_from(&self) -> DVec3 {
        self.before
    }

    /// The footprint of a ray that leaves: as wide as that of the ray that came, and spreading as much.
    pub fn footprint(&self) -> Footprint {
        if self.width > 0.0 {
            Footprint::Cone { width: self.width, spread: self.spread }
        } else {
            Footprint::Point
        }
    }

    /// Where rays start that leave along a direction: from beyond the error of the point.
    #[inline]
    pub fn start(&self, direction: DVec3) -> DVec3 {
        let normal = self.surface.normal;
        if (normal.dot(direction) < 0.0) == (normal.dot(self.towards_origin) < 0.0) {
            return self.before;
        }
        offset(self.surface.point, self.surface.point_error, self.surface.normal, direction)
    }
}

/// The point moved along the normal, to the side of `direction`, out of the box of its error, and rounded away from
/// the surface.
///
/// Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th edition, 2023, 6.8.6. There, tests for hits refuse a `t`
/// within its own error; here they do not, and the point goes farther instead: by the error of the coordinate that has
/// most of it, which is what rounds into `t`. (On a face in the plane z = 0 the point itself has no error along z at all,
/// and half of all rays from it hit that face again.)
#[inline]
pub fn offset(point: DVec3, error: DVec3, normal: DVec3, direction: DVec3) -> DVec3 {
    let distance = normal.abs().dot(error) + 4.0 * error.max_element();
    let along = if normal.dot(direction) < 0.0 { -normal } else { normal };
    let moved = point + distance * along;
    let away = |p: f64, n: f64| {
        if n > 0.0 {
            p.next_up()
        } else if n < 0.0 {
            p.next_down()
        } else {
            p
        }
    };
    DVec3::new(away(moved.x, along.x), away(moved.y, along.y), away(moved.z, along.z))
}
