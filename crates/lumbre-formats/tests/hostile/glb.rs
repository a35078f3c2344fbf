//! glTF in one file, of a frame and of bytes that fuzzing makes.

use std::path::Path;

use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::{Budget, Diagnostics, FormatError, Limits};
use lumbre_scene::SceneDesc;

/// A file of these two chunks, each filled up to a multiple of four bytes.
pub(super) fn of_chunks(json: &str, binary: &[u8]) -> Vec<u8> {
    let filled = |bytes: &[u8], with: u8| {
        let mut filled = bytes.to_vec();
        filled.resize(bytes.len().next_multiple_of(4), with);
        filled
    };
    let (json, binary) = (filled(json.as_bytes(), b' '), filled(binary, 0));
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend(((28 + json.len() + binary.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &binary)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

/// What such a file holds, in no more memory than malformed files may take.
pub(super) fn read(json: &str, binary: &[u8]) -> Result<SceneDesc, FormatError> {
    let glb = of_chunks(json, binary);
    let mut limits = Limits::default();
    limits.memory = (64 << 20) + 32 * glb.len() as u64;
    let budget = Budget::new(limits);
    let (name, nowhere, options) = ("fuzz.glb".into(), Path::new("/nowhere"), GltfOptions::default());
    let scene = read_gltf(&glb, &name, nowhere, &options, &budget, &mut Diagnostics::new());
    assert!(budget.memory_peak() <= limits.memory);
    scene
}
