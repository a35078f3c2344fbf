//! The tree and its queries.

use std::fmt;
use std::ops::ControlFlow;

use lumbre_geometry::{Aabb, Ray, Surface};
use lumbre_math::Transform;

use crate::{Geometry, Hit};

/// A bounding volume hierarchy over geometries, ready for queries from any number of threads.
#[derive(Debug)]
pub struct Accel {}

/// How a tree is built.
#[derive(Clone, Debug, Default)]
pub struct BuildOptions {}

/// Why a tree cannot be built.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum BuildError {
    /// A mesh names a vertex that it does not have.
    VertexOutOfRange {
        /// Position of the geometry in the list.
        geometry: usize,
        /// The triangle.
        triangle: usize,
    },
    /// A coordinate is not finite.
    NotFinite {
        /// Position of the geometry in the list.
        geometry: usize,
        /// The vertex or primitive.
        element: usize,
    },
    /// More primitives than a tree can name (2^32 - 1).
    TooMany,
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::VertexOutOfRange { geometry, triangle } => {
                write!(f, "triangle {triangle} of geometry {geometry} names a vertex that is not there")
            }
            Self::NotFinite { geometry, element } => {
                write!(f, "element {element} of geometry {geometry} has a coordinate that is not finite")
            }
            Self::TooMany => f.write_str("more than 4294967295 primitives in one tree"),
        }
    }
}

impl std::error::Error for BuildError {}

impl Accel {
    /// Builds a tree over `geometries`. Zero-area triangles are kept out: they are never hit.
    ///
    /// # Errors
    /// [`BuildError`] when a mesh names vertices that it lacks, or a coordinate is not finite.
    pub fn build(_geometries: Vec<Geometry>, _options: &BuildOptions) -> Result<Self, BuildError> {
        unimplemented!("skeleton")
    }

    /// The nearest hit in the ray's range. Of hits at the same `t`, the one whose (path, geometry, primitive) comes
    /// first.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.closest_filtered(ray, |_| true)
    }

    /// The nearest hit that `accept` takes; it may be asked in any order of `t`, and its answer must depend on the hit
    /// alone.
    pub fn closest_filtered(&self, _ray: &Ray, _accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        unimplemented!("skeleton")
    }

    /// Whether anything is hit in the ray's range.
    pub fn any(&self, ray: &Ray) -> bool {
        self.any_filtered(ray, |_| true)
    }

    /// Whether anything that `accept` takes is hit in the ray's range.
    pub fn any_filtered(&self, _ray: &Ray, _accept: impl FnMut(&Hit) -> bool) -> bool {
        unimplemented!("skeleton")
    }

    /// Every hit in the ray's range in ascending order of `t` (ties by path, geometry, primitive), until `visit` breaks.
    pub fn all(&self, _ray: &Ray, _visit: impl FnMut(&Hit) -> ControlFlow<()>) {
        unimplemented!("skeleton")
    }

    /// How many hits the ray's range holds.
    pub fn count(&self, ray: &Ray) -> usize {
        let mut n = 0;
        self.all(ray, |_| {
            n += 1;
            ControlFlow::Continue(())
        });
        n
    }

    /// The surface at a hit of this tree, in the space of this tree. For triangles `uv` are the barycentrics (b1, b2).
    pub fn surface(&self, _ray: &Ray, _hit: &Hit) -> Surface {
        unimplemented!("skeleton")
    }

    /// The map from the space of the hit's innermost instance to the space of this tree.
    pub fn world_from_object(&self, _hit: &Hit) -> Transform {
        unimplemented!("skeleton")
    }

    /// A box around everything finite in it.
    pub fn bounds(&self) -> Aabb {
        unimplemented!("skeleton")
    }

    /// How many primitives it holds itself, those of its instances not counted.
    pub fn primitive_count(&self) -> usize {
        unimplemented!("skeleton")
    }

    /// Bytes of the tree itself: nodes, leaves and references, not the meshes and not the instances' trees.
    pub fn memory_bytes(&self) -> usize {
        unimplemented!("skeleton")
    }
}
