//! Why a description cannot become a scene.

use lumbre_geometry::ShapeError;

/// Why a [`crate::SceneDesc`] cannot become a [`crate::Scene`]. Shapes are named by [`crate::ShapeDesc::index`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A shape cannot be made.
    #[error("shape {shape}: {source}")]
    Shape {
        /// Which.
        shape: u32,
        /// Why.
        source: ShapeError,
    },
    /// A shape names a material that is not there.
    #[error("shape {shape} names material {material}, but there are {count}")]
    NoSuchMaterial {
        /// Which shape.
        shape: u32,
        /// What it names.
        material: u32,
        /// How many materials there are.
        count: usize,
    },
    /// An instance names an object that is not there.
    #[error("an instance names object {object}, but there are {count}")]
    NoSuchObject {
        /// What it names.
        object: u32,
        /// How many objects there are.
        count: usize,
    },
    /// An object holds itself at some depth.
    #[error("object \"{name}\" holds itself")]
    ObjectCycle {
        /// The object's name.
        name: String,
    },
    /// Objects hold objects to too great a depth.
    #[error("object \"{name}\" holds objects to a depth of more than {limit}")]
    NestedTooDeeply {
        /// The object's name.
        name: String,
        /// The greatest depth.
        limit: usize,
    },
    /// A triangle or quad names a vertex that its mesh does not have.
    #[error("shape {shape}: face {face} names vertex {vertex}, but there are {count}")]
    NoSuchVertex {
        /// Which shape.
        shape: u32,
        /// Which face, triangles first.
        face: usize,
        /// What it names.
        vertex: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// A list of a mesh has another length than its vertices.
    #[error("shape {shape}: {found} {list} for {expected} vertices")]
    ListLength {
        /// Which shape.
        shape: u32,
        /// Which list.
        list: &'static str,
        /// How long it is.
        found: usize,
        /// How long it should be.
        expected: usize,
    },
    /// A coordinate is not finite, or too large for single precision.
    #[error("shape {shape}: vertex {vertex} is not finite or too far away")]
    NotFinite {
        /// Which shape.
        shape: u32,
        /// Which vertex.
        vertex: usize,
    },
    /// A shape without bounds cannot be a light.
    #[error("shape {shape}: an infinite {name} cannot carry an area light")]
    InfiniteLight {
        /// Which shape.
        shape: u32,
        /// Its form.
        name: &'static str,
    },
    /// A CSG cannot be made.
    #[error("shape {shape}: {reason}")]
    Csg {
        /// Which shape.
        shape: u32,
        /// Why.
        reason: String,
    },
    /// A camera has a parameter out of its range.
    #[error("camera {camera}: {parameter} is {found}, expected {expected}")]
    Camera {
        /// Its position among the cameras.
        camera: usize,
        /// Which parameter.
        parameter: &'static str,
        /// What it is.
        found: f64,
        /// What is accepted.
        expected: &'static str,
    },
    /// A light has a parameter out of its range.
    #[error("light {light}: {reason}")]
    Light {
        /// Its position among the lights.
        light: usize,
        /// Why.
        reason: &'static str,
    },
    /// The tree cannot be built.
    #[error("{0}")]
    Tree(#[from] lumbre_kernel::BuildError),
    /// More surfaces than can be named (2^32 - 1).
    #[error("more than 4294967295 surfaces in one scene")]
    TooMany,
}
