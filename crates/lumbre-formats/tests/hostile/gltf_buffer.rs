//! Any bytes are the buffer of a glTF: vertices, indices, sparse elements and joints, and the data of each
//! decompressor.

use std::path::Path;

use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::{Budget, Diagnostics, Limits, Strictness};

use super::glb;

pub(crate) fn run(bytes: &[u8]) {
    let Some((&kind, data)) = bytes.split_first() else { return };
    let length = data.len();
    let packed = |mode: &str, stride: usize, count: usize, filter: &str| {
        format!(
            r#"[{{"buffer":0,"byteLength":{},"byteStride":{stride},"extensions":{{"EXT_meshopt_compression":{{"buffer":0,
            "byteLength":{length},"byteStride":{stride},"count":{count},"mode":"{mode}","filter":"{filter}"}}}}}}]"#,
            stride * count
        )
    };
    let plain = |stride: usize| format!(r#"[{{"buffer":0,"byteLength":{length},"byteStride":{stride}}}]"#);
    let count = (length / 24).max(1);
    let views = match kind % 6 {
        0 => packed("ATTRIBUTES", 12, 3 * count, "NONE"),
        1 => packed("ATTRIBUTES", 8, 3 * count, "QUATERNION"),
        2 => packed("ATTRIBUTES", 4, 3 * count, "OCTAHEDRAL"),
        3 => packed("TRIANGLES", 4, 3 * count, "NONE"),
        4 => packed("INDICES", 4, count, "NONE"),
        _ => plain(12),
    };
    let positions =
        format!(r#""componentType":5126,"type":"VEC3","count":{count},"min":[0,0,0],"max":[0,0,0]"#);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{length}}}],"bufferViews":{views},
        "accessors":[{{"bufferView":0,{positions}}},{{"bufferView":0,"componentType":5125,"type":"SCALAR","count":{count}}},
            {{{positions},"sparse":{{"count":1,"indices":{{"bufferView":0,"componentType":5121}},"values":{{"bufferView":0}}}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}},{{"attributes":{{"POSITION":2}}}}]}}],
        "nodes":[{{"mesh":0}}]}}"#
    );
    let glb = glb::of_chunks(&json, data);
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    limits.elements = 1_000_000;
    let mut diagnostics = Diagnostics::with_strictness(Strictness::Lenient);
    let (budget, options) = (Budget::new(limits), GltfOptions::default());
    let nowhere = Path::new("/nonexistent");
    if let Err(error) = read_gltf(&glb, &"fuzz.glb".into(), nowhere, &options, &budget, &mut diagnostics) {
        assert!(error.to_diagnostic().to_string().starts_with("error: "));
    }
}
