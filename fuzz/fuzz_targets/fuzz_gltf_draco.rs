//! glTF: the bytes of a primitive compressed by Draco, under accessors that fit what they start with.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::{Budget, Diagnostics, Limits};

fuzz_target!(|data: &[u8]| {
    // How many vertices and corners, then the stream.
    let Some((&[points, corners], stream)) = data.split_first_chunk::<2>() else { return };
    let (points, corners) = (u32::from(points).max(1), 3 * u32::from(corners).max(1));
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_draco_mesh_compression"],
        "buffers":[{{"byteLength":{0}}}],"bufferViews":[{{"buffer":0,"byteLength":{0}}}],"accessors":[
        {{"componentType":5126,"type":"VEC3","count":{points},"min":[0,0,0],"max":[1,1,1]}},
        {{"componentType":5126,"type":"VEC2","count":{points}}},
        {{"componentType":5123,"type":"SCALAR","count":{corners}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2,"extensions":{{
        "KHR_draco_mesh_compression":{{"bufferView":0,"attributes":{{"POSITION":0,"TEXCOORD_0":1}}}}}}}}]}}],
        "nodes":[{{"mesh":0}}]}}"#,
        stream.len()
    );
    read(&json, stream);
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
    let _ = read_gltf(
        &glb,
        &name,
        Path::new("/nowhere"),
        &GltfOptions::default(),
        &budget,
        &mut Diagnostics::new(),
    );
}
