//! The closed set of exact shapes.

use lumbre_math::{DVec2, DVec3, Transform};

use crate::{Aabb, DirectionSample, Ray, Root, Roots, Surface, SurfaceSample};

/// An exact shape in its own space. Adding one is a new file, a variant and its arms here.
#[derive(Clone, Debug)]
pub enum Shape {}

/// Why a shape cannot be made.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ShapeError {
    /// A parameter is not finite, or out of its range: its name, what was given, and what is accepted.
    OutOfRange {
        /// The parameter's name, as in the scene language.
        parameter: &'static str,
        /// What was given.
        found: f64,
        /// What is accepted.
        expected: &'static str,
    },
    /// The parameters together make nothing: why.
    Degenerate(&'static str),
}

impl Shape {
    /// The first crossing in the ray's range.
    pub fn closest(&self, _ray: &Ray) -> Option<Root> {
        match *self {}
    }

    /// Whether anything is crossed in the ray's range.
    pub fn any(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, _ray: &Ray, _out: &mut Roots) {
        match *self {}
    }

    /// The surface where `root` was found along `ray`.
    pub fn surface(&self, _ray: &Ray, _root: &Root) -> Surface {
        match *self {}
    }

    /// The tightest box around the shape under `world_from_object`, rounded outward; `None` for infinite shapes.
    pub fn bounds(&self, _world_from_object: &Transform) -> Option<Aabb> {
        match *self {}
    }

    /// Area before any transform; infinite for infinite shapes.
    pub fn area(&self) -> f64 {
        match *self {}
    }

    /// Whether the surface encloses a solid, so that CSG can use it.
    pub fn is_solid(&self) -> bool {
        match *self {}
    }

    /// The name in the scene language.
    pub fn name(&self) -> &'static str {
        match *self {}
    }

    /// A point uniform by area from two uniform numbers; `None` for infinite shapes.
    pub fn sample_area(&self, _u: DVec2) -> Option<SurfaceSample> {
        match *self {}
    }

    /// A point as seen from `from`, by solid angle where the shape has a method, else by area.
    pub fn sample_direction(&self, _from: DVec3, _u: DVec2) -> Option<DirectionSample> {
        match *self {}
    }

    /// The density, per unit solid angle at `ray.origin`, with which [`Shape::sample_direction`] chooses the point
    /// `surface` on the ray.
    pub fn pdf_direction(&self, _ray: &Ray, _surface: &Surface) -> f64 {
        match *self {}
    }
}
