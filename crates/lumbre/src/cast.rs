//! Answers of ray queries.

use lumbre_math::{DVec2, DVec3};

/// What a ray hit, in world space and double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CastHit {
    /// Where, in units of the ray's direction.
    pub t: f64,
    /// The point, on the surface.
    pub point: DVec3,
    /// The geometric normal: unit, outward, not turned towards the ray.
    pub normal: DVec3,
    /// Surface parameters.
    pub uv: DVec2,
    /// Whether the ray met the outer side.
    pub front: bool,
    /// 0-based position of the shape in its file.
    pub shape: u32,
    /// The triangle of a mesh, else 0.
    pub primitive: u32,
    /// The outermost instance, 0-based, if the shape stands in one.
    pub instance: Option<u32>,
}
