//! Why a tree cannot be built.

use std::fmt;

use crate::tree::node::tag;

/// Leaf entries and nodes must fit the index bits of a reference.
pub(crate) const MAX_PRIMITIVES: usize = tag::PLACE as usize;

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
    /// A coordinate or a radius is not finite.
    NotFinite {
        /// Position of the geometry in the list.
        geometry: usize,
        /// The vertex, sphere or primitive.
        element: usize,
    },
    /// More primitives than a tree can index (2^28 - 1), or more than 2^25 blocks of eight because of many small leaves
    /// of triangles or of spheres.
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
            Self::TooMany => write!(
                f,
                "too many primitives for one tree: at most {}, in {} blocks of eight triangles or spheres",
                MAX_PRIMITIVES,
                tag::BLOCK_PLACES
            ),
        }
    }
}

impl std::error::Error for BuildError {}
