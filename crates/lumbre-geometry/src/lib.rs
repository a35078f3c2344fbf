//! Exact surfaces as values: bounds, every root along a ray, surface data, area and sampling, in double precision.
//!
//! A ray's direction need not be unit, and `t` is in units of its length. A search returns little ([`Root`]: where, and
//! on which part); [`Shape::surface`] computes the rest once, for the winner.
//!
//! ```
//! use lumbre_geometry::{PlacedShape, Ray, Sphere};
//! use lumbre_math::{DVec3, Transform};
//!
//! let ball = Sphere::new(DVec3::ZERO, 2.0)?;
//! let egg = PlacedShape::new(ball.into(), Transform::scale(DVec3::new(1.0, 1.0, 1.5))?);
//! let ray = Ray::new(DVec3::new(0.0, 0.0, 10.0), DVec3::new(0.0, 0.0, -7.0));
//!
//! let root = egg.closest(&ray).expect("the ray points at it");
//! assert_eq!(root.t, 1.0);
//! assert_eq!(egg.surface(&ray, &root).normal, DVec3::Z);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
