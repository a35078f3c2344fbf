//! What must hold of any bytes: run on what damages files at random (`fuzz/`), and on the files that it found and kept.

use lumbre_formats::{Budget, Diagnostics, FormatError, Limits, Strictness};

mod glb;
pub(crate) mod gltf;
pub(crate) mod gltf_buffer;
pub(crate) mod gltf_draco;
pub(crate) mod gltf_ktx;
pub(crate) mod gltf_meshopt;
pub(crate) mod ies;
pub(crate) mod image;
pub(crate) mod measured;
pub(crate) mod mesh_kinds;
pub(crate) mod nanovdb;
pub(crate) mod obj;
pub(crate) mod pbrt;
pub(crate) mod ply;
pub(crate) mod pov;
pub(crate) mod stl;

/// Reads strictly and leniently in little memory: what is refused has a message that begins as it should.
fn read_both_ways<T>(
    elements: u64,
    begins: &str,
    read: impl Fn(&Budget, &mut Diagnostics) -> Result<T, FormatError>,
) {
    let mut limits = Limits::default();
    (limits.memory, limits.elements, limits.files) = (64 << 20, elements, 100);
    for strictness in [Strictness::Normal, Strictness::Lenient] {
        let mut diagnostics = Diagnostics::with_strictness(strictness);
        if let Err(error) = read(&Budget::new(limits), &mut diagnostics) {
            let message = error.to_diagnostic().to_string();
            assert!(message.starts_with(begins), "{message}");
        }
        diagnostics.lines();
    }
}

/// Reads bytes as one kind of file.
type Check = fn(&[u8]);

/// What reads each kind of file, by the name of its fuzz target.
pub(crate) const CHECKS: [(&str, Check); 15] = [
    ("gltf", gltf::run),
    ("gltf_buffer", gltf_buffer::run),
    ("gltf_draco", gltf_draco::run),
    ("gltf_ktx", gltf_ktx::run),
    ("gltf_meshopt", gltf_meshopt::run),
    ("ies", ies::run),
    ("image", image::run),
    ("measured", measured::run),
    ("mesh_kinds", mesh_kinds::run),
    ("nanovdb", nanovdb::run),
    ("obj", obj::run),
    ("pbrt", pbrt::run),
    ("ply", ply::run),
    ("pov", pov::run),
    ("stl", stl::run),
];
