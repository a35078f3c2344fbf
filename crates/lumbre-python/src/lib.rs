//! The native half of the Python package `lumbre`. What users see is in `python/lumbre`: it checks and names, this
//! computes.

mod cast;
mod columns;
mod errors;
mod expression;
mod material;
mod medium;
mod meshes;
mod picture;
mod points;
mod program;
mod rays;
mod scene;
mod shape;
mod staged;
mod viewer;
mod work;

/// The module as Python imports it.
#[pyo3::pymodule(gil_used = false)]
mod _lumbre {
    #[pymodule_export]
    use crate::errors::LumbreError;
    #[pymodule_export]
    use crate::material::{Material, Texture, named_colour};
    #[pymodule_export]
    use crate::medium::Medium;
    #[pymodule_export]
    use crate::meshes::PlacedMesh;
    #[pymodule_export]
    use crate::picture::{Part, Picture, clear_sky, read_image, write_image};
    #[pymodule_export]
    use crate::program::main;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::shape::{Camera, Environment, Geometry, Light};
    #[pymodule_export]
    use crate::viewer::Viewer;
    #[pymodule_export]
    use crate::work::{memory_left, panic_on_purpose, thread_count};
}
