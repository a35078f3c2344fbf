//! Exact surfaces as values: bounds, every root along a ray, surface data, area and sampling, in double precision.
//!
//! A ray's direction need not be unit, and `t` is in units of its length. A search returns little ([`Root`]: where, and
//! on which part); [`Shape::surface`] computes the rest once, for the winner.

mod aabb;
mod density;
mod hit;
mod measure;
mod placed;
mod ray;
mod shape;
mod sphere;
mod support;
mod triangle;

pub use aabb::Aabb;
pub use hit::{DirectionSample, Root, Roots, Surface, SurfaceSample};
pub use placed::PlacedShape;
pub use ray::Ray;
pub use shape::{Shape, ShapeError};
pub use sphere::Sphere;
pub use triangle::{Triangle, TriangleHit, WatertightRay, moller_trumbore};
