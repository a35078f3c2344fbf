//! Errors of building a scene from a description.

use lumbre_geometry::ShapeError;

/// Why a [`crate::SceneDesc`] cannot become a [`crate::Scene`]. Shapes are named by [`crate::ShapeDesc::index`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A shape is invalid.
    #[error("shape {shape}: {source}")]
    Shape {
        /// The shape.
        shape: u32,
        /// The reason.
        source: ShapeError,
    },
    /// A shape refers to a missing material.
    #[error("shape {shape} names material {material}, but there are {count}")]
    NoSuchMaterial {
        /// The shape.
        shape: u32,
        /// The material index.
        material: u32,
        /// The number of materials.
        count: usize,
    },
    /// A shape or a camera refers to a missing medium.
    #[error("a shape or camera names medium {medium}, but there are {count}")]
    NoSuchMedium {
        /// The medium index.
        medium: u32,
        /// The number of media.
        count: usize,
    },
    /// An instance refers to a missing object.
    #[error("an instance names object {object}, but there are {count}")]
    NoSuchObject {
        /// The object index.
        object: u32,
        /// The number of objects.
        count: usize,
    },
    /// An object contains itself at some depth.
    #[error("object \"{name}\" holds itself")]
    ObjectCycle {
        /// The object's name.
        name: String,
    },
    /// Objects are nested too deeply.
    #[error("object \"{name}\" holds objects to a depth of more than {limit}")]
    NestedTooDeeply {
        /// The object's name.
        name: String,
        /// The maximal depth.
        limit: usize,
    },
    /// A triangle or quad refers to a missing vertex.
    #[error("shape {shape}: face {face} names vertex {vertex}, but there are {count}")]
    NoSuchVertex {
        /// The shape.
        shape: u32,
        /// The face, triangles first.
        face: usize,
        /// The vertex index.
        vertex: u32,
        /// The number of vertices.
        count: usize,
    },
    /// A list of a mesh has the wrong length.
    #[error("shape {shape}: {found} {list} for {expected} vertices")]
    ListLength {
        /// The shape.
        shape: u32,
        /// The list.
        list: &'static str,
        /// Its length.
        found: usize,
        /// The required length.
        expected: usize,
    },
    /// A coordinate is not finite, or too large for single precision.
    #[error("shape {shape}: vertex {vertex} is not finite or too far away")]
    NotFinite {
        /// The shape.
        shape: u32,
        /// The vertex.
        vertex: usize,
    },
    /// An unbounded shape cannot be a light.
    #[error("shape {shape}: an infinite {name} cannot carry an area light")]
    InfiniteLight {
        /// The shape.
        shape: u32,
        /// The kind of shape.
        name: &'static str,
    },
    /// A shape without a known area has a light defined by power.
    #[error("shape {shape}: custom geometry cannot shine by power, for its area is not known")]
    LightWithoutArea {
        /// The shape.
        shape: u32,
    },
    /// A CSG is invalid.
    #[error("shape {shape}: {reason}")]
    Csg {
        /// The shape.
        shape: u32,
        /// The reason.
        reason: String,
    },
    /// A camera has a parameter out of range.
    #[error("camera {camera}: {parameter} is {found}, expected {expected}")]
    Camera {
        /// The index of the camera.
        camera: usize,
        /// The parameter.
        parameter: &'static str,
        /// Its value.
        found: f64,
        /// The accepted range.
        expected: &'static str,
    },
    /// There is no camera at this position.
    #[error("there is no camera {position}, but {count} of them")]
    NoSuchCamera {
        /// The position.
        position: usize,
        /// The number of cameras.
        count: usize,
    },
    /// A light has a parameter out of range.
    #[error("light {light}: {reason}")]
    Light {
        /// The index of the light.
        light: usize,
        /// The reason.
        reason: &'static str,
    },
    /// The tree cannot be built.
    #[error("{0}")]
    Tree(#[from] lumbre_kernel::BuildError),
    /// More than 2^32 - 1 surfaces.
    #[error("more than 4294967295 surfaces in one scene")]
    TooMany,
}
