//! glTF: the bytes of a texture in KTX 2.0 with Basis Universal inside.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::{Budget, Diagnostics, FormatError, Limits};

fuzz_target!(|data: &[u8]| {
    // A file that does not start as one is not even looked at.
    let mut texture = b"\xABKTX 20\xBB\r\n\x1A\n".to_vec();
    texture.extend(data);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_texture_basisu"],"buffers":[{{"byteLength":{0}}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":{1}}},
        {{"buffer":0,"byteLength":24}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[1,1,0]}},
        {{"bufferView":2,"componentType":5126,"type":"VEC2","count":3}}],
        "images":[{{"bufferView":1,"mimeType":"image/ktx2"}}],
        "textures":[{{"extensions":{{"KHR_texture_basisu":{{"source":0}}}}}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
        "meshes":[{{"primitives":[{{"material":0,"attributes":{{"POSITION":0,"TEXCOORD_0":1}}}}]}}],"nodes":[{{"mesh":0}}]}}"#,
        36 + texture.len(),
        texture.len()
    );
    let triangle = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut binary: Vec<u8> = triangle.iter().flat_map(|v| v.to_le_bytes()).collect();
    binary.extend(&texture);
    read(&json, &binary);
});

fn read(json: &str, binary: &[u8]) {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let padding = binary.len().next_multiple_of(4) - binary.len();
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend(((28 + json.len() + binary.len() + padding) as u32).to_le_bytes());
    glb.extend((json.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(&json);
    glb.extend(((binary.len() + padding) as u32).to_le_bytes());
    glb.extend(b"BIN\0");
    glb.extend(binary);
    glb.extend(&[0; 3][..padding]);
    let budget = Budget::new(Limits { memory: (64 << 20) + 32 * glb.len() as u64, ..Limits::default() });
    let name = "fuzz.glb".into();
    let (nowhere, options) = (Path::new("/nowhere"), GltfOptions::default());
    if let Err(error) = read_gltf(&glb, &name, nowhere, &options, &budget, &mut Diagnostics::new()) {
        // What is around the texture is right: otherwise none would ever be looked at.
        let message = error.to_diagnostic().to_string();
        let is_of_texture = message.contains("/images/0") || matches!(error, FormatError::Limit { .. });
        assert!(is_of_texture, "{message}");
    }
}
