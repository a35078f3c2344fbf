//! A shape with its placement.

use lumbre_math::rounding::gamma;
use lumbre_math::{DMat3, DVec2, DVec3, Transform};

use crate::support::length;
use crate::{
    Aabb, BoundingVolume, DirectionSample, NearestPoint, NearestPointError, Ray, Root, Roots, Shape, Surface,
    SurfaceSample, measure, scaled,
};

/// An exact shape under any invertible affine map. The ray is taken into object space; `t` is preserved.
#[derive(Clone, Debug)]
pub struct PlacedShape {
    shape: Shape,
    // `None` for the identity: then rays are not transformed.
    world_from_object: Option<Box<Transform>>,
}

impl PlacedShape {
    /// `shape` under `world_from_object`.
    pub fn new(shape: Shape, world_from_object: Transform) -> Self {
        let world_from_object = (!world_from_object.is_identity()).then(|| Box::new(world_from_object));
        Self { shape, world_from_object }
    }

    /// The shape in object space.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The placement.
    pub fn world_from_object(&self) -> Transform {
        self.world_from_object.as_deref().copied().unwrap_or_default()
    }

    /// The ray in object space, as every query takes it there.
    pub fn object_ray(&self, ray: &Ray) -> Ray {
        self.world_from_object.as_ref().map_or(*ray, |m| ray.into_object(m))
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        match &self.world_from_object {
            None => self.shape.closest(ray),
            // The map could take such a direction beyond the numbers.
            Some(_) if !ray.has_ordinary_direction() => scaled::closest(ray, |ray, out| self.roots(ray, out)),
            Some(m) => self.shape.closest(&ray.into_object(m)),
        }
    }

    /// Whether anything is crossed in the ray's range.
    pub fn any(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        match &self.world_from_object {
            None => self.shape.roots(ray, out),
            Some(_) if !ray.has_ordinary_direction() => {
                scaled::roots(ray, out, |ray, out| self.roots(ray, out));
            }
            Some(m) => self.shape.roots(&ray.into_object(m), out),
        }
    }

    /// The surface, in world space, where `root` was found along `ray`.
    ///
    /// `point_error` includes the rounding of the transform to world space and of the next ray's transform
    /// back.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        match &self.world_from_object {
            None => self.shape.surface(ray, root),
            Some(_) if !ray.has_ordinary_direction() => {
                scaled::surface(ray, root, |ray, root| self.surface(ray, root))
            }
            Some(m) => into_world(m, &self.shape.surface(&ray.into_object(m), root)),
        }
    }

    /// The point of the surface that is nearest to `p`, both in world space: see [`Shape::closest_point`].
    ///
    /// # Errors
    /// [`NearestPointError`] where there is no method for the shape, or none under its map.
    pub fn closest_point(&self, p: DVec3) -> Result<NearestPoint, NearestPointError> {
        self.shape.closest_point(&self.world_from_object(), p)
    }

    /// The nearest point when the shape is placed under `outer` in addition.
    ///
    /// # Errors
    /// As for [`PlacedShape::closest_point`].
    pub fn closest_point_under(
        &self,
        outer: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        match &self.world_from_object {
            None => self.shape.closest_point(outer, p),
            Some(m) => self.shape.closest_point(&(*outer * **m), p),
        }
    }

    /// The tightest box around it, rounded outward; `None` when it is infinite.
    pub fn bounds(&self) -> Option<Aabb> {
        self.shape.bounds(&self.world_from_object())
    }

    /// A bounding volume in world space: see [`Shape::bounding_volume`].
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        let bounding_volume = self.shape.bounding_volume()?;
        Some(self.world_from_object.as_deref().map_or(bounding_volume, |map| bounding_volume.under(map)))
    }

    /// Area in world space; infinite for infinite shapes.
    pub fn area(&self) -> f64 {
        match &self.world_from_object {
            None => self.shape.area(),
            Some(m) => match measure::similarity_factor(m) {
                Some(factor) => factor * factor * self.shape.area(),
                None => self.shape.area_under(m),
            },
        }
    }

    /// A point on the surface; `None` for infinite shapes.
    ///
    /// `pdf` is per unit of world-space area. The density is uniform under similarities; under other maps it is
    /// uniform in object space, and `pdf` is exact.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let sample = self.shape.sample_area(u)?;
        let Some(m) = &self.world_from_object else {
            return Some(sample);
        };
        let pdf = sample.pdf / (measure::area_stretch(m) * sample.surface.normal).length();
        Some(SurfaceSample { surface: into_world(m, &sample.surface), pdf })
    }

    /// A point as seen from `from` in world space, by solid angle where the shape has a method, else by area;
    /// `None` where the point is seen edge-on, and for infinite shapes.
    pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
        let Some(m) = &self.world_from_object else {
            return self.shape.sample_direction(from, u);
        };
        let object_from = m.inverse_point(from);
        let sample = self.shape.sample_direction(object_from, u)?;
        let pdf = sample.pdf * solid_angle_shrink(m, sample.surface.point - object_from);
        pdf.is_finite().then(|| DirectionSample { surface: into_world(m, &sample.surface), pdf })
    }

    /// The density, per unit solid angle at `ray.origin`, with which [`PlacedShape::sample_direction`] samples
    /// the point `surface` (in world space) on the ray; 0 for points that it never samples.
    pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
        let Some(m) = &self.world_from_object else {
            return self.shape.pdf_direction(ray, surface);
        };
        if !ray.has_ordinary_direction() {
            return scaled::pdf_direction(ray, |ray| self.pdf_direction(ray, surface));
        }
        let object_ray = ray.into_object(m);
        let object_surface = Surface {
            point: m.inverse_point(surface.point),
            normal: {
                let normal = m.inverse_normal(surface.normal);
                normal / length(normal)
            },
            dpdu: m.inverse_vector(surface.dpdu),
            dpdv: m.inverse_vector(surface.dpdv),
            ..*surface
        };
        let pdf = self.shape.pdf_direction(&object_ray, &object_surface);
        pdf * solid_angle_shrink(m, object_surface.point - object_ray.origin)
    }
}

impl Surface {
    /// The same surface under a map to the space around it. Its `point_error` includes the rounding of the map, and of
    /// the map back that the next ray takes.
    #[must_use]
    pub fn placed(&self, world_from_object: &Transform) -> Self {
        into_world(world_from_object, self)
    }
}

/// Transforms a surface from object space to world space.
pub(crate) fn into_world(m: &Transform, surface: &Surface) -> Surface {
    let linear = m.linear();
    let size = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let offset = m.affine().translation;
    let point = m.point(surface.point);
    let back = m.inverse_affine();
    let back_size =
        DMat3::from_cols(back.matrix3.x_axis.abs(), back.matrix3.y_axis.abs(), back.matrix3.z_axis.abs());
    let object_error = surface.point_error + gamma(4) * (back_size * point.abs() + back.translation.abs());
    let point_error = size * object_error + gamma(4) * (size * surface.point.abs() + offset.abs());

    let scaled_normal = m.normal(surface.normal);
    let length = length(scaled_normal);
    let normal = scaled_normal / length;
    // The derivative of a normalised vector.
    let turned = |dn: DVec3| {
        let moved = m.normal(dn) / length;
        moved - normal * normal.dot(moved)
    };
    Surface {
        point,
        point_error,
        normal,
        uv: surface.uv,
        dpdu: m.vector(surface.dpdu),
        dpdv: m.vector(surface.dpdv),
        dndu: turned(surface.dndu),
        dndv: turned(surface.dndv),
    }
}

/// The ratio of solid angle in object space to solid angle in world space, about a direction `d` in object
/// space: |L d|³ / |det L| for a unit `d`.
fn solid_angle_shrink(m: &Transform, d: DVec3) -> f64 {
    let stretch = length(m.vector(d)) / length(d);
    stretch * stretch * stretch / m.determinant().abs()
}
