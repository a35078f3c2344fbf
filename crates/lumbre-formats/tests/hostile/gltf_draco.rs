//! glTF: the bytes of a primitive compressed by Draco, under accessors that fit what they start with. What is taken is
//! a mesh with the numbers of vertices and triangles that the accessors give, and scenes can be built of it; what is
//! refused is the primitive.

use std::collections::HashSet;

use lumbre_formats::FormatError;
use lumbre_scene::{BuildError, GeometryDesc, Scene, SceneDesc};

use super::glb;

pub(crate) fn run(data: &[u8]) {
    // How many vertices and corners, then the stream.
    let Some((&[points, corners], stream)) = data.split_first_chunk::<2>() else { return };
    if stream.is_empty() {
        return;
    }
    let (points, corners) = (usize::from(points).max(1), 3 * usize::from(corners).max(1));
    // Texture coordinates are read because there is a texture, even one without an image.
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_draco_mesh_compression"],
        "buffers":[{{"byteLength":{0}}}],"bufferViews":[{{"buffer":0,"byteLength":{0}}}],"accessors":[
        {{"componentType":5126,"type":"VEC3","count":{points},"min":[0,0,0],"max":[1,1,1]}},
        {{"componentType":5126,"type":"VEC2","count":{points}}},
        {{"componentType":5123,"type":"SCALAR","count":{corners}}}],
        "textures":[{{}}],"materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
        "meshes":[{{"primitives":[{{"material":0,"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2,"extensions":{{
        "KHR_draco_mesh_compression":{{"bufferView":0,"attributes":{{"POSITION":0,"TEXCOORD_0":1}}}}}}}}]}}],
        "nodes":[{{"mesh":0}}]}}"#,
        stream.len()
    );
    match glb::read(&json, stream) {
        Ok(scene) => check(scene, points, corners / 3),
        Err(FormatError::Limit { .. }) => {}
        Err(error) => {
            // What is around the primitive is right: otherwise none would ever be looked at.
            let message = error.to_diagnostic().to_string();
            let is_of_primitive = ["/meshes/0/primitives/0", "/accessors/"];
            assert!(is_of_primitive.iter().any(|place| message.contains(place)), "{message}");
        }
    }
}

fn check(scene: SceneDesc, points: usize, triangles: usize) {
    let [shape] = &scene.shapes[..] else { panic!("{} shapes", scene.shapes.len()) };
    let GeometryDesc::Mesh(mesh) = &shape.geometry else { panic!("no mesh") };
    // Where but few vertices are used, the others are left out.
    let corners = mesh.triangles.as_flattened();
    let used = corners.iter().collect::<HashSet<_>>().len();
    let points = if corners.len() < points / 2 { used } else { points };
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (points, triangles));
    assert_eq!(mesh.uvs.as_ref().map(Vec::len), Some(points));
    for &vertex in corners {
        let position = mesh.positions.get(vertex as usize);
        assert!(position.is_some_and(|p| p.is_finite()), "{vertex}: {position:?}");
    }
    let unused_may_be_wrong = mesh.positions.iter().any(|p| !p.is_finite());
    match Scene::build(scene) {
        Ok(_) => assert!(!unused_may_be_wrong),
        Err(error) => {
            assert!(unused_may_be_wrong && matches!(error, BuildError::NotFinite { .. }), "{error}")
        }
    }
}
