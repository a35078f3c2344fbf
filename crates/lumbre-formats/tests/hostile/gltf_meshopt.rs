//! glTF: the bytes of a compressed buffer view, of any mode, filter, stride and count. What is taken is all there:
//! vertices as many as there should be, colours that are shares, corners of triangles that are vertices; and what the
//! older extension takes the newer one takes for the same. What is refused is the buffer view, or what it has.

use std::collections::HashSet;

use lumbre_formats::FormatError;
use lumbre_scene::{GeometryDesc, MeshDesc, SceneDesc};

use super::glb;

/// Vertices where the buffer view has indices.
const VERTICES: usize = 300;

pub(crate) fn run(data: &[u8]) {
    // What the extension says, then the stream.
    let Some((&[kind, stride, low, high], stream)) = data.split_first_chunk::<4>() else { return };
    if stream.is_empty() {
        return;
    }
    let mode = ["ATTRIBUTES", "TRIANGLES", "INDICES"][usize::from(kind % 3)];
    let filter = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"][usize::from(kind / 3 % 5)];
    let extensions = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
    let count = usize::from(u16::from_le_bytes([low, high])).max(1);
    let has_vertices = mode == "ATTRIBUTES";
    let stride =
        if has_vertices { 4 * (usize::from(stride) % 64 + 1) } else { 2 + 2 * usize::from(stride % 2) };

    // What looks at the numbers: as indices, as places where there is room for them, or else as colours.
    let with_stride =
        if has_vertices && stride <= 252 { format!(r#""byteStride":{stride},"#) } else { String::new() };
    let read_as = match (has_vertices, stride) {
        (false, 2) => Some((r#""componentType":5123,"type":"SCALAR""#, "indices")),
        (false, _) => Some((r#""componentType":5125,"type":"SCALAR""#, "indices")),
        (true, 4) => Some((r#""componentType":5121,"normalized":true,"type":"VEC4""#, "COLOR_0")),
        (true, 8) => Some((r#""componentType":5123,"normalized":true,"type":"VEC4""#, "COLOR_0")),
        (true, 12..=252) => {
            Some((r#""componentType":5126,"type":"VEC3","min":[0,0,0],"max":[1,1,1]"#, "POSITION"))
        }
        _ => None,
    };
    let vertices = if has_vertices { count } else { VERTICES };
    let zeros =
        format!(r#"{{"componentType":5126,"type":"VEC3","count":{vertices},"min":[0,0,0],"max":[0,0,0]}}"#);
    let (accessor, primitive) = match read_as {
        None => (zeros.clone(), r#"{"attributes":{"POSITION":1}}"#.to_owned()),
        Some((numbers, attribute)) => (
            format!(r#"{{"bufferView":0,"count":{count},{numbers}}}"#),
            match attribute {
                "POSITION" => r#"{"attributes":{"POSITION":0}}"#.to_owned(),
                "indices" => r#"{"attributes":{"POSITION":1},"indices":0}"#.to_owned(),
                colours => format!(r#"{{"attributes":{{"POSITION":1,"{colours}":0}}}}"#),
            },
        ),
    };
    let json = |extension: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["{extension}"],
            "buffers":[{{"byteLength":{0}}},{{"byteLength":{1}}}],"bufferViews":[{{"buffer":1,"byteLength":{1},{with_stride}"extensions":{{
            "{extension}":{{"buffer":0,"byteLength":{0},"byteStride":{stride},"count":{count},"mode":"{mode}","filter":"{filter}"}}}}}}],
            "accessors":[{accessor},{zeros}],"meshes":[{{"primitives":[{primitive}]}}],"nodes":[{{"mesh":0}}]}}"#,
            stream.len(),
            stride * count
        )
    };
    let found = glb::read(&json(extensions[usize::from(kind / 15 % 2)]), stream);
    match &found {
        Ok(scene) => {
            let mesh = mesh(scene);
            let triangles = count / 3;
            assert_eq!(mesh.map_or(0, |mesh| mesh.triangles.len()), triangles);
            if let Some(mesh) = mesh {
                check(mesh, vertices);
            }
        }
        Err(FormatError::Limit { .. }) => {}
        Err(error) => {
            // What is around the buffer view is right: otherwise none would ever be looked at.
            let message = error.to_diagnostic().to_string();
            let is_of_view = ["/bufferViews/0", "/accessors/0"].iter().any(|place| message.contains(place));
            assert!(is_of_view, "{message}");
        }
    }
    if let (Ok(scene), 0) = (found, kind / 15 % 2) {
        let newer = glb::read(&json(extensions[1]), stream).unwrap_or_else(|error| panic!("{error}"));
        let bits = |mesh: &MeshDesc| {
            mesh.positions.iter().map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>()
        };
        let parts =
            |scene: &SceneDesc| mesh(scene).map(|m| (bits(m), m.triangles.clone(), m.colours.clone()));
        assert_eq!(parts(&scene), parts(&newer));
    }
}

fn mesh(scene: &SceneDesc) -> Option<&MeshDesc> {
    match &scene.shapes[..] {
        [] => None,
        [shape] => match &shape.geometry {
            GeometryDesc::Mesh(mesh) => Some(mesh),
            _ => panic!("no mesh"),
        },
        shapes => panic!("{} shapes", shapes.len()),
    }
}

fn check(mesh: &MeshDesc, vertices: usize) {
    // Where but few are used, the others are left out.
    let corners = mesh.triangles.as_flattened();
    let used = corners.iter().collect::<HashSet<_>>().len();
    let vertices = if corners.len() < vertices / 2 { used } else { vertices };
    assert_eq!(mesh.positions.len(), vertices);
    for &vertex in corners {
        let position = mesh.positions.get(vertex as usize);
        assert!(position.is_some_and(|p| p.is_finite()), "{vertex}: {position:?}");
    }
    let is_share = |n: &f32| (0.0..=1.0).contains(n);
    if let Some(colours) = &mesh.colours {
        assert!(
            colours.len() == vertices && colours.iter().all(|colour| colour.to_array().iter().all(is_share))
        );
    }
    if let Some(coverages) = &mesh.coverages {
        assert!(coverages.len() == vertices && coverages.iter().all(is_share));
    }
}
