#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! A ray's direction need not be unit, and `t` is in units of its length. A search returns little ([`Root`]: where, and
//! on which part); [`Shape::surface`] computes the rest once, for the winner.

mod aabb;
mod axial;
mod bounding_volume;
mod curve_chords;
mod curves;
mod density;
mod explain;
mod hit;
mod implicit;
mod line;
mod measure;
mod nearest;
mod placed;
mod ray;
mod scaled;
mod shape;
mod strand;
mod support;
mod triangle_sides;
mod twofold;

use lumbre_math::{DVec2, DVec3, Transform};

pub use aabb::Aabb;
pub use bounding_volume::BoundingVolume;
pub use csg::{Crossing, Crossings, Leaf, LeafPart, Solid};
pub use curves::{CurveKind, Curves};
pub use explain::{Candidate, Explanation, Fate, Operand, Quantity, Remark, Step, Topic, Value};
pub use hit::{DirectionSample, Root, Roots, Surface, SurfaceSample};
pub use implicit::ImplicitSurface;
pub use nearest::{NearestPoint, NearestPointError, nearest_on_triangle, similarity_factor};
pub use patch::{PatchCrossing, PatchCrossings, PatchPlace};
pub use placed::PlacedShape;
pub use ray::Ray;
pub use shape::ShapeError;
pub use sphere::sphere_crossings;
pub use strand::{CurveBasis, Strand};
pub use triangle::{TriangleHit, WatertightRay, moller_trumbore};
pub use triangle_sides::plane_and_sides;

// The shapes: the file of each, and its line in the list.

mod capsule;
mod cone;
mod csg;
mod cuboid;
mod cylinder;
mod disk;
mod hyperboloid;
mod paraboloid;
mod patch;
mod plane;
mod quadric;
mod sphere;
mod torus;
mod triangle;

shape::shapes! {
    /// A sphere, or the part of one between two heights and two meridians.
    sphere::Sphere in Sphere,
    /// An infinite plane.
    plane::Plane in Plane,
    /// A disk, an annulus, or a sector of one.
    disk::Disk in Disk,
    /// A box along the axes.
    cuboid::Cuboid in Cuboid,
    /// A cylinder, open, capped or infinite.
    cylinder::Cylinder in Cylinder,
    /// A cone, pointed or cut off, open, capped or infinite.
    cone::Cone in Cone,
    /// A capsule: a segment swept by a ball.
    capsule::Capsule in Capsule,
    /// A bilinear patch.
    patch::BilinearPatch in BilinearPatch,
    /// A triangle.
    triangle::Triangle in Triangle,
    /// A torus: ring, horn or spindle.
    torus::Torus in Box<Torus>,
    /// A paraboloid of revolution.
    paraboloid::Paraboloid in Paraboloid,
    /// A hyperboloid of revolution.
    hyperboloid::Hyperboloid in Box<Hyperboloid>,
    /// A general quadric, bounded by a clipping box if it is open.
    quadric::Quadric in Box<Quadric>,
    /// Unions, intersections and differences of solids.
    csg::Csg in Box<Csg>,
}
