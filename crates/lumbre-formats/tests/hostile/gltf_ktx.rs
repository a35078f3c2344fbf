//! glTF: the bytes of a texture in KTX 2.0 with Basis Universal inside.

use lumbre_formats::FormatError;

use super::glb;

pub(crate) fn run(data: &[u8]) {
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
    if let Err(error) = glb::read(&json, &binary) {
        // What is around the texture is right: otherwise none would ever be looked at.
        let message = error.to_diagnostic().to_string();
        let is_of_texture = message.contains("/images/0") || matches!(error, FormatError::Limit { .. });
        assert!(is_of_texture, "{message}");
    }
}
