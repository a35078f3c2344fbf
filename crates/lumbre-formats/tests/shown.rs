//! Files that break the rules of their format in a way whose meaning is clear, as exporters write them: what every
//! viewer shows is shown, with a warning, and refused when strict.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::path::Path;

use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::ply::read_ply;
use lumbre_formats::{Budget, Diagnostics, Strictness};
use lumbre_image::Rgb;
use lumbre_math::{Vec2, Vec3};
use lumbre_scene::{GeometryDesc, MeshDesc, Scene, SceneDesc};
use lumbre_shading::{Mapping2d, MaterialKind, TextureContext, UvSet, VertexData};

/// (3, 0, 2), (0, 4, 2), (0, 0, 2) and thrice (0, 0, 1), as base64 with its media type.
const BUFFER: &str = "data:application/octet-stream;base64,AABAQAAAAAAAAABAAAAAAAAAgEAAAABAAAAAAAAAAAAAAABAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/";

/// A triangle of a file whose parts can be replaced.
fn triangle(changes: &[(&str, &str)]) -> String {
    let mut json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,2],"max":[3,4,2]}],
        "bufferViews":[{"buffer":0,"byteLength":72}],"buffers":[{"byteLength":72,"uri":"BUFFER"}]}"#
        .replace("BUFFER", BUFFER);
    for (from, to) in changes {
        assert!(json.contains(from), "{from}");
        json = json.replacen(from, to, 1);
    }
    json
}

fn read(bytes: &[u8], strictness: Strictness) -> (Result<SceneDesc, String>, Diagnostics) {
    let mut said = Diagnostics::with_strictness(strictness);
    let options = GltfOptions::default();
    let scene =
        read_gltf(bytes, &"m.gltf".into(), Path::new("/nowhere"), &options, &Budget::default(), &mut said);
    (scene.map_err(|e| e.to_string()), said)
}

/// The scene of a file that is shown with a warning that says this, and that is refused when strict.
fn shown(bytes: &[u8], warning: &str) -> SceneDesc {
    let (scene, said) = read(bytes, Strictness::Normal);
    let scene = scene.unwrap();
    assert!(said.lines().iter().any(|line| line.contains(warning)), "{warning}: {:?}", said.lines());
    let (strictly, said) = read(bytes, Strictness::Strict);
    assert!(strictly.is_err() || said.check().is_err(), "{warning}");
    scene
}

fn mesh(scene: &SceneDesc) -> &MeshDesc {
    let [shape] = &scene.shapes[..] else { panic!("{} shapes", scene.shapes.len()) };
    let GeometryDesc::Mesh(mesh) = &shape.geometry else { panic!() };
    assert_eq!(mesh.positions[0].to_array(), [3.0, 0.0, 2.0]);
    mesh
}

#[test]
fn a_root_that_is_also_a_child_is_shown_as_a_root() {
    let json = triangle(&[
        (r#""nodes":[0]"#, r#""nodes":[1]"#),
        (r#""nodes":[{"mesh":0}]"#, r#""nodes":[{"children":[1],"translation":[7,7,7]},{"mesh":0}]"#),
    ]);
    mesh(&shown(json.as_bytes(), "scene with a node that hangs on another"));
}

#[test]
fn attributes_in_a_view_without_stride_are_read() {
    let json = triangle(&[
        (r#"{"POSITION":0}"#, r#"{"POSITION":0,"NORMAL":1}"#),
        (
            r#""max":[3,4,2]}"#,
            r#""max":[3,4,2]},{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"}"#,
        ),
    ]);
    let scene = shown(json.as_bytes(), "attributes share a buffer view that says no stride");
    assert_eq!(mesh(&scene).normals.as_deref(), Some(&[Vec3::Z; 3][..]));
}

#[test]
fn a_second_set_of_texture_coordinates_may_stand_alone() {
    let json = triangle(&[
        (r#"{"POSITION":0}"#, r#"{"POSITION":0,"TEXCOORD_1":1}"#),
        (
            r#""max":[3,4,2]}"#,
            r#""max":[3,4,2]},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}"#,
        ),
        (r#""byteLength":72}]"#, r#""byteLength":72},{"buffer":0,"byteLength":24}]"#),
    ]);
    mesh(&shown(json.as_bytes(), "TEXCOORD_0 is missing"));
}

#[test]
fn a_missing_image_leaves_its_material_without_it() {
    let json = triangle(&[
        (r#""attributes":{"POSITION":0}"#, r#""material":0,"attributes":{"POSITION":0,"TEXCOORD_0":1}"#),
        (
            r#""max":[3,4,2]}"#,
            r#""max":[3,4,2]},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}"#,
        ),
        (
            r#""byteLength":72}]"#,
            r#""byteLength":72},{"buffer":0,"byteLength":24}],"images":[{"uri":"gone.png"}],
            "textures":[{"source":0}],"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,1],
            "baseColorTexture":{"index":0}}}]"#,
        ),
    ]);
    // One that is there and damaged is refused.
    let damaged = json.replace("gone.png", "data:image/png,%89PNG");
    assert!(read(damaged.as_bytes(), Strictness::Normal).0.unwrap_err().contains("/images/0"));
    let scene = shown(json.as_bytes(), "image is left out");
    let MaterialKind::Principled(params) = &scene.materials[0].material.kind else { panic!() };
    assert_eq!(params.base_color.evaluate(&place()), Rgb::new(0.5, 0.25, 1.0));
}

#[test]
fn parts_that_nothing_uses_may_be_wrong() {
    let unused = [
        (
            r#""nodes":[{"mesh":0}]"#,
            r#""cameras":[{"type":"perspective","perspective":{"yfov":4,"znear":0.1}}],"nodes":[{"mesh":0}]"#,
            "number out of range",
        ),
        (
            r#""byteLength":72}]"#,
            r#""byteLength":72},{"buffer":0,"byteLength":0}]"#,
            "buffer view without bytes",
        ),
        (
            r#""max":[3,4,2]}"#,
            r#""max":[3,4,2]},{"bufferView":5,"componentType":5126,"count":3,"type":"VEC3"}"#,
            "there is no ",
        ),
        (
            r#""nodes":[{"mesh":0}]"#,
            r#""materials":[{"alphaMode":"MIX"}],"nodes":[{"mesh":0}]"#,
            "unknown alpha mode",
        ),
    ];
    for (from, to, warning) in unused {
        mesh(&shown(triangle(&[(from, to)]).as_bytes(), warning));
    }
    // What is used is an error.
    let used = triangle(&[
        (r#""nodes":[{"mesh":0}]"#, r#""materials":[{"alphaMode":"MIX"}],"nodes":[{"mesh":0}]"#),
        (r#""attributes""#, r#""material":0,"attributes""#),
    ]);
    assert!(read(used.as_bytes(), Strictness::Normal).0.unwrap_err().contains("unknown alpha mode"));
}

#[test]
fn glb_chunk_lengths_need_not_be_multiples_of_four() {
    let mut json = triangle(&[(&format!(r#","uri":"{BUFFER}""#), "")]);
    while json.len() % 4 != 1 {
        json.push(' ');
    }
    let binary =
        [3.0_f32, 0.0, 2.0, 0.0, 4.0, 2.0, 0.0, 0.0, 2.0].map(f32::to_le_bytes).as_flattened().repeat(2);
    // Without padding, and with the padding that the length leaves out.
    for padding in [0, 3] {
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((12 + 8 + json.len() as u32 + padding + 8 + 72).to_le_bytes());
        file.extend((json.len() as u32).to_le_bytes());
        file.extend(b"JSON");
        file.extend(json.as_bytes());
        file.extend(&b"   "[..padding as usize]);
        file.extend(72_u32.to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(&binary);
        mesh(&shown(&file, "GLB chunk of a length that is no multiple of 4"));
    }
}

#[test]
fn nothing_is_fetched_from_a_network_and_that_is_said() {
    let json = triangle(&[(BUFFER, "https://example.org/a.bin")]);
    let error = read(json.as_bytes(), Strictness::Normal).0.unwrap_err();
    assert!(error.contains("on a network, from which nothing is fetched"), "{error}");
}

#[test]
fn nodes_that_are_not_visible_hide_what_hangs_on_them() {
    let with = |visible: &str| {
        let json = triangle(&[(
            r#""nodes":[{"mesh":0}]"#,
            &format!(
                r#""extensionsUsed":["KHR_node_visibility","KHR_lights_punctual"],
                "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point"}}]}}}},
                "nodes":[{{"children":[1,2],"extensions":{{"KHR_node_visibility":{{{visible}}}}}}},{{"mesh":0}},
                {{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}]"#
            ),
        )]);
        let (scene, said) = read(json.as_bytes(), Strictness::Normal);
        assert_eq!(said.lines(), [""; 0]);
        let scene = scene.unwrap();
        (scene.shapes.len(), scene.lights.len())
    };
    assert_eq!(with(r#""visible":false"#), (0, 0));
    assert_eq!(with(r#""visible":true"#), (1, 1));
    assert_eq!(with(""), (1, 1));
}

#[test]
fn visibility_is_animated_by_a_pointer() {
    // Visible from the time 0.5 on, hidden from 1 on, and visible again from 2 on: three floats and three bytes.
    let clip = "data:application/octet-stream;base64,AAAAPwAAgD8AAABAAQABAA==";
    let at = |frame: Option<f64>, shutter: f64| {
        let json = triangle(&[
            (
                r#""nodes":[{"mesh":0}]"#,
                r#""extensionsUsed":["KHR_node_visibility","KHR_animation_pointer"],
                "nodes":[{"children":[1],"extensions":{"KHR_node_visibility":{"visible":false}}},{"mesh":0}],
                "animations":[{"samplers":[{"input":1,"output":2,"interpolation":"STEP"}],"channels":[{"sampler":0,"target":
                {"path":"pointer","extensions":{"KHR_animation_pointer":{"pointer":"/nodes/0/extensions/KHR_node_visibility/visible"}}}}]}]"#,
            ),
            (
                r#""max":[3,4,2]}]"#,
                r#""max":[3,4,2]},{"bufferView":1,"componentType":5126,"count":3,"type":"SCALAR","min":[0.5],"max":[2]},
                {"bufferView":1,"byteOffset":12,"componentType":5121,"count":3,"type":"SCALAR"}]"#,
            ),
            (r#""byteLength":72}],"#, r#""byteLength":72},{"buffer":1,"byteLength":16}],"#),
            (r#""}]}"#, &format!(r#""}},{{"byteLength":16,"uri":"{clip}"}}]}}"#)),
        ]);
        let mut said = Diagnostics::new();
        let mut options = GltfOptions::default();
        (options.frame, options.shutter) = (frame, shutter);
        let (name, folder) = ("m.gltf".into(), Path::new("/nowhere"));
        let scene =
            read_gltf(json.as_bytes(), &name, folder, &options, &Budget::default(), &mut said).unwrap();
        (scene.shapes.len() + scene.instances.len(), said.lines())
    };
    // Without a time a file is what it says itself; before the first time of an animation, what that says.
    for (frame, expected) in [
        (None, 0),
        (Some(0.0), 1),
        (Some(0.75), 1),
        (Some(1.0), 0),
        (Some(1.9), 0),
        (Some(2.0), 1),
        (Some(7.0), 1),
    ] {
        assert_eq!(at(frame, 0.0), (expected, vec![]), "{frame:?}");
    }
    // While the shutter is open it stands, and that is said where it really changes.
    let (count, said) = at(Some(1.25), 0.75);
    assert_eq!(count, 0);
    assert!(said.len() == 1 && said[0].contains("KHR_node_visibility/visible"), "{said:?}");
    assert_eq!(at(Some(1.5), 0.5), (0, vec![]));
}

fn place() -> TextureContext {
    TextureContext {
        point: lumbre_math::DVec3::ONE,
        normal: Vec3::Z,
        uv: Vec2::new(0.3, 0.6),
        dpdx: Vec3::ZERO,
        dpdy: Vec3::ZERO,
        duv_dx: Vec2::ZERO,
        duv_dy: Vec2::ZERO,
        vertex: VertexData::NONE,
        spectral: None,
    }
}

#[test]
fn a_specular_colour_takes_its_share_from_the_diffuse_one() {
    let with = |specular: &str| {
        let json = triangle(&[
            (
                r#""nodes":[{"mesh":0}]"#,
                &format!(
                    r#""extensionsUsed":["KHR_materials_pbrSpecularGlossiness"],
                "materials":[{{"extensions":{{"KHR_materials_pbrSpecularGlossiness":{{"diffuseFactor":[0.8,0.4,0.2,1],
                "specularFactor":{specular}}}}}}}],"nodes":[{{"mesh":0}}]"#
                ),
            ),
            (r#""attributes""#, r#""material":0,"attributes""#),
        ]);
        let scene = read(json.as_bytes(), Strictness::Normal).0.unwrap();
        let MaterialKind::Principled(params) = &scene.materials[0].material.kind else { panic!() };
        params.bsdf(&place()).base
    };
    assert_eq!(with("[0.3,1,0.5]"), Rgb::BLACK);
    assert!((with("[0.25,0.1,0]") - Rgb::new(0.6, 0.3, 0.15)).map(f32::abs).max_component() < 1e-6);
    assert_eq!(with("[0,0,0]"), Rgb::new(0.8, 0.4, 0.2));
}

#[test]
fn a_map_to_one_point_shows_one_colour() {
    // An image of 2 by 1 pixels, red and blue.
    let image = {
        let mut bytes = std::io::Cursor::new(vec![]);
        let pixels = image::RgbImage::from_raw(2, 1, vec![255, 0, 0, 0, 0, 255]).unwrap();
        pixels.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner().iter().map(|byte| format!("%{byte:02x}")).collect::<String>()
    };
    let transform = r#""extensions":{"KHR_texture_transform":{"scale":[0,0],"offset":[0.75,0.5]}}"#;
    for material in [
        format!(
            r#""emissiveFactor":[1,1,1],"emissiveTexture":{{"index":0,{transform}}},
            "pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}"#
        ),
        format!(
            r#""pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,{transform}}}}},"alphaMode":"BLEND",
            "extensions":{{"KHR_materials_unlit":{{}}}}"#
        ),
    ] {
        let json = triangle(&[
            (r#""attributes":{"POSITION":0}"#, r#""material":0,"attributes":{"POSITION":0,"TEXCOORD_0":1}"#),
            (
                r#""max":[3,4,2]}"#,
                r#""max":[3,4,2]},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}"#,
            ),
            (
                r#""byteLength":72}]"#,
                &format!(
                    r#""byteLength":72}},{{"buffer":0,"byteLength":24}}],
                "images":[{{"uri":"data:image/png,{image}"}}],"textures":[{{"source":0}}],"materials":[{{{material}}}]"#
                ),
            ),
        ]);
        let (scene, said) = read(json.as_bytes(), Strictness::Normal);
        assert_eq!(said.lines(), [""; 0]);
        let scene = scene.unwrap();
        let mesh = mesh(&scene);
        assert_eq!(mesh.uvs.as_deref(), Some(&[Vec2::new(0.75, 0.5); 3][..]));
        // The set itself is kept for textures of the material.
        let raw: Vec<Vec2> = [[3.0, 1.0], [2.0, 1.0], [4.0, -1.0]].map(Vec2::from).to_vec();
        assert_eq!(mesh.further_uvs[0].as_deref(), Some(&raw[..]));
        if let MaterialKind::Principled(params) = &scene.materials[0].material.kind {
            let lumbre_shading::Texture::Image(base) = &*params.base_color else { panic!() };
            assert!(matches!(base.mapping, Mapping2d::Affine { set: UvSet::Second, .. }));
        }
        let light = scene.shapes[0].area_light.clone().unwrap();
        let colour = light.image.unwrap().lookup(Vec2::new(0.75, 0.5), Vec2::ZERO, Vec2::ZERO);
        assert!(colour.b > 0.99 && colour.r < 0.01, "{colour:?}");
        Scene::build(scene).unwrap();
    }
}

#[test]
fn unknown_ply_header_lines_are_skipped() {
    let text = "ply\nformat ascii 1.0\nWritten by hand, source: none\nelement vertex 3\nproperty float x\nproperty float y\n\
                property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                3 0 2\n0 4 2\n0 0 2\n3 0 1 2\n";
    let mut said = Diagnostics::new();
    let file = read_ply(text.as_bytes(), &"m.ply".into(), &Budget::default(), &mut said).unwrap();
    assert_eq!(file.mesh.triangles, [[0, 1, 2]]);
    assert_eq!(said.lines(), ["warning: m.ply:3:1: unknown line in PLY header (found \"Written\")"]);
}
