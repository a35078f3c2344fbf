//! Exact surfaces as values: bounds, every root along a ray, surface data, area and sampling, in double precision.
//!
//! A ray's direction need not be unit, and `t` is in units of its length. A search returns little ([`Root`]: where, and
//! on which part); [`Shape::surface`] computes the rest once, for the winner.

mod aabb;
mod axial;
mod cone;
mod csg;
mod cuboid;
mod cylinder;
mod density;
mod disk;
mod hit;
mod hyperboloid;
mod line;
mod measure;
mod paraboloid;
mod patch;
mod placed;
mod plane;
mod quadric;
mod ray;
mod shape;
mod sphere;
mod support;
mod torus;
mod triangle;

pub use aabb::Aabb;
pub use cone::Cone;
pub use csg::{Crossing, Crossings, Csg, Leaf, LeafPart, Solid};
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use hit::{DirectionSample, Root, Roots, Surface, SurfaceSample};
pub use hyperboloid::Hyperboloid;
pub use paraboloid::Paraboloid;
pub use patch::BilinearPatch;
pub use placed::PlacedShape;
pub use plane::Plane;
pub use quadric::Quadric;
pub use ray::Ray;
pub use shape::{Shape, ShapeError};
pub use sphere::Sphere;
pub use torus::Torus;
pub use triangle::{Triangle, TriangleHit, WatertightRay, moller_trumbore};
