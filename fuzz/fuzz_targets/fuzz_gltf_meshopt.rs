//! glTF: the bytes of a compressed buffer view, of any mode, filter, stride and count.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::{Budget, Diagnostics, Limits};

fuzz_target!(|data: &[u8]| {
    // What the extension says, then the stream.
    let Some((&[kind, stride, low, high], stream)) = data.split_first_chunk::<4>() else { return };
    let mode = ["ATTRIBUTES", "TRIANGLES", "INDICES"][usize::from(kind % 3)];
    let filter = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"][usize::from(kind / 3 % 5)];
    let extension = ["EXT_meshopt_compression", "KHR_meshopt_compression"][usize::from(kind / 15 % 2)];
    let stride = if mode == "ATTRIBUTES" { 4 * (u32::from(stride) % 64 + 1) } else { 2 + 2 * u32::from(stride % 2) };
    let count = u32::from(u16::from_le_bytes([low, high])).max(1);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["{extension}"],
        "buffers":[{{"byteLength":{0}}},{{"byteLength":{1}}}],"bufferViews":[{{"buffer":1,"byteLength":{1},"extensions":{{
        "{extension}":{{"buffer":0,"byteLength":{0},"byteStride":{stride},"count":{count},"mode":"{mode}","filter":"{filter}"}}}}}}]}}"#,
        stream.len(),
        stride * count
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
