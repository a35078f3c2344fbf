//! A shape and where it stands.

use lumbre_math::{DVec2, DVec3, Transform};

use crate::{Aabb, DirectionSample, Ray, Root, Roots, Shape, Surface, SurfaceSample};

/// An exact shape under any invertible affine map. The ray goes to the shape, not the shape to the ray, and `t` stays.
#[derive(Clone, Debug)]
pub struct PlacedShape {
    shape: Shape,
    // Without one, the shape stands in the world as it is, and no ray is moved for it.
    world_from_object: Option<Box<Transform>>,
}

impl PlacedShape {
    /// `shape`, placed.
    pub fn new(shape: Shape, world_from_object: Transform) -> Self {
        let world_from_object = (!world_from_object.is_identity()).then(|| Box::new(world_from_object));
        Self { shape, world_from_object }
    }

    /// The shape in its own space.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Where it stands.
    pub fn world_from_object(&self) -> Transform {
        self.world_from_object.as_deref().copied().unwrap_or_default()
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        match &self.world_from_object {
            None => self.shape.closest(ray),
            Some(m) => self.shape.closest(&ray.into_object(m)),
        }
    }

    /// Whether anything is crossed in the ray's range.
    pub fn any(&self, ray: &Ray) -> bool {
        match &self.world_from_object {
            None => self.shape.any(ray),
            Some(m) => self.shape.any(&ray.into_object(m)),
        }
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        match &self.world_from_object {
            None => self.shape.roots(ray, out),
            Some(m) => self.shape.roots(&ray.into_object(m), out),
        }
    }

    /// The surface, in world space, where `root` was found along `ray`.
    pub fn surface(&self, _ray: &Ray, _root: &Root) -> Surface {
        unimplemented!("skeleton")
    }

    /// The tightest box around it, rounded outward; `None` when it is infinite.
    pub fn bounds(&self) -> Option<Aabb> {
        self.shape.bounds(&self.world_from_object())
    }

    /// Area in world space; infinite for infinite shapes.
    pub fn area(&self) -> f64 {
        unimplemented!("skeleton")
    }

    /// A point uniform by world-space area; `None` for infinite shapes.
    pub fn sample_area(&self, _u: DVec2) -> Option<SurfaceSample> {
        unimplemented!("skeleton")
    }

    /// A point as seen from `from` in world space, by solid angle where there is a method, else by area.
    pub fn sample_direction(&self, _from: DVec3, _u: DVec2) -> Option<DirectionSample> {
        unimplemented!("skeleton")
    }

    /// The density, per unit solid angle at `ray.origin`, with which [`PlacedShape::sample_direction`] chooses the
    /// point `surface` (in world space) on the ray.
    pub fn pdf_direction(&self, _ray: &Ray, _surface: &Surface) -> f64 {
        unimplemented!("skeleton")
    }
}
