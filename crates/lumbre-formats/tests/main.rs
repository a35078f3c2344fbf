//! Tests of the readers through their interface, in one binary, which links once.

mod broken_meshes;
mod broken_scenes;
mod common;
mod gltf;
mod gltf_assets;
mod hostile;
mod images;
mod obj;
mod pbrt_grammar;
mod ply;
mod pov;
mod regressions;
mod shown;
mod stl;
