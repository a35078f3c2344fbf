//! Results of ray and point queries.

use lumbre_math::{DVec2, DVec3};

/// A hit, in world space and double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CastHit {
    /// The ray parameter, in units of the direction's length.
    pub t: f64,
    /// The point, on the surface.
    pub point: DVec3,
    /// The geometric normal: unit, outward, not flipped towards the ray.
    pub normal: DVec3,
    /// Surface parameters.
    pub uv: DVec2,
    /// Whether the ray hit the outside.
    pub front: bool,
    /// The 0-based index of the shape in its file.
    pub shape: u32,
    /// The triangle of a mesh, else 0.
    pub primitive: u32,
    /// The 0-based index of the outermost instance, if the shape is in one.
    pub instance: Option<u32>,
}

/// The point of all surfaces that is nearest to a given one, in world space and double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CastPoint {
    /// How far away it is, never negative.
    pub distance: f64,
    /// Where it is.
    pub point: DVec3,
    /// The 0-based index of the shape in its file.
    pub shape: u32,
    /// The triangle of a mesh, else 0.
    pub primitive: u32,
    /// The 0-based index of the outermost instance, if the shape is in one.
    pub instance: Option<u32>,
}
