//! glTF: what small models made here become, and what is said of broken ones.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::path::Path;
use std::sync::Arc;

use crate::common::{Random, changed};
use lumbre_formats::gltf::{GltfOptions, read_gltf};
use lumbre_formats::{Budget, Diagnostics, FormatError, Limits, Strictness};
use lumbre_geometry::Shape;
use lumbre_image::Rgb;
use lumbre_math::{DVec2, DVec3, Transform, Vec2, Vec3, Vec4};
use lumbre_scene::{
    CameraKind, GeometryDesc, LightDesc, MeshDesc, Placement, Scene, SceneDesc, ShapeDesc, WithoutLight,
};
use lumbre_shading::{
    FloatTexture, Mapping2d, MaterialKind, PrincipledParams, SpectrumTexture, Texture, TextureContext, UvSet,
    VertexData,
};

/// A GLB of a JSON and its first buffer.
fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut file = b"glTF".to_vec();
    file.extend(2_u32.to_le_bytes());
    file.extend(
        (12 + 8 + json.len() as u32 + if binary.is_empty() { 0 } else { 8 + binary.len() as u32 })
            .to_le_bytes(),
    );
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(&json);
    if !binary.is_empty() {
        file.extend((binary.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(&binary);
    }
    file
}

fn read_with(
    bytes: &[u8],
    options: &GltfOptions,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    let name: Arc<str> = "m.gltf".into();
    read_gltf(bytes, &name, Path::new("."), options, &Budget::default(), diagnostics)
}

fn read(json: &str, binary: &[u8]) -> SceneDesc {
    read_with(&glb(json, binary), &GltfOptions::default(), &mut Diagnostics::new()).unwrap()
}

/// What is said about a file that is wrong: why it is refused, or what is warned of where it is shown all the same.
/// Strict reading refuses either.
fn error(json: &str, binary: &[u8]) -> String {
    let mut said = Diagnostics::new();
    let read = read_with(&glb(json, binary), &GltfOptions::default(), &mut said);
    let mut strict = Diagnostics::with_strictness(Strictness::Strict);
    let strictly = read_with(&glb(json, binary), &GltfOptions::default(), &mut strict);
    assert!(strictly.is_err() || strict.check().is_err());
    let refused = read.err().map(|error| error.to_string());
    let warned = said.kept().iter().map(|said| said.body());
    refused.into_iter().chain(warned).collect::<Vec<_>>().join("\n")
}

fn mesh(shape: &ShapeDesc) -> &MeshDesc {
    match &shape.geometry {
        GeometryDesc::Mesh(mesh) => mesh,
        other => panic!("a mesh is expected, not {other:?}"),
    }
}

fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

fn shorts(numbers: &[u16]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

/// A buffer in parts, each with its view and its accessor.
#[derive(Default)]
struct Parts {
    binary: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Parts {
    fn add(&mut self, bytes: &[u8], accessor: &str) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view =
            format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#, self.binary.len(), bytes.len());
        self.binary.extend(bytes);
        self.accessors.push(format!(r#"{{"bufferView":{},{accessor}}}"#, self.views.len()));
        self.views.push(view);
        self.accessors.len() - 1
    }

    fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let end = |better: fn(f32, f32) -> f32| {
            [0, 1, 2].map(|axis| positions.iter().map(|p| p[axis]).reduce(better).unwrap_or_default())
        };
        let ([x0, y0, z0], [x1, y1, z1]) = (end(f32::min), end(f32::max));
        let bounds = format!(r#""min":[{x0},{y0},{z0}],"max":[{x1},{y1},{z1}]"#);
        let kind = format!(r#""componentType":5126,"type":"VEC3","count":{},{bounds}"#, positions.len());
        self.add(&floats(positions.as_flattened()), &kind)
    }

    fn indices(&mut self, indices: &[u16]) -> usize {
        let kind = format!(r#""componentType":5123,"type":"SCALAR","count":{}"#, indices.len());
        self.add(&shorts(indices), &kind)
    }

    /// A file with these buffers and, besides, `rest`.
    fn json(&self, rest: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.binary.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }

    fn read(&self, rest: &str) -> SceneDesc {
        read(&self.json(rest), &self.binary)
    }
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 2.0], [3.0, 0.0, 2.0], [3.0, 4.0, 2.0], [0.0, 4.0, 2.0]];

/// One node with a mesh of one primitive.
fn one(primitive: &str) -> String {
    format!(r#""meshes":[{{"primitives":[{{{primitive}}}]}}],"nodes":[{{"mesh":0}}]"#)
}

#[test]
fn every_mode_makes_the_triangles_that_the_specification_says() {
    type Case = (u32, &'static [u16], &'static [[u32; 3]]);
    let cases: [Case; 6] = [
        (4, &[0, 1, 2, 2, 3, 0], &[[0, 1, 2], [2, 3, 0]]),
        (4, &[0, 1, 2, 2, 3], &[[0, 1, 2]]),
        (5, &[0, 1, 3, 2], &[[0, 1, 3], [1, 2, 3]]),
        (5, &[0, 1, 3, 2, 0], &[[0, 1, 3], [1, 2, 3], [3, 2, 0]]),
        (6, &[0, 1, 2, 3], &[[1, 2, 0], [2, 3, 0]]),
        (6, &[0, 1], &[]),
    ];
    for (mode, indices, expected) in cases {
        let mut parts = Parts::default();
        let (p, i) = (parts.positions(&SQUARE), parts.indices(indices));
        let scene =
            parts.read(&one(&format!(r#""mode":{mode},"indices":{i},"attributes":{{"POSITION":{p}}}"#)));
        let found: Vec<[u32; 3]> = scene.shapes.iter().flat_map(|s| mesh(s).triangles.clone()).collect();
        assert_eq!(found, expected, "mode {mode}");
    }
    // Without indices, in order.
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let scene = parts.read(&one(&format!(r#""mode":5,"attributes":{{"POSITION":{p}}}"#)));
    assert_eq!(mesh(&scene.shapes[0]).triangles, [[0, 1, 2], [1, 3, 2]]);
}

#[test]
fn points_and_lines_are_spheres_and_cylinders() {
    let spheres = |scene: &SceneDesc| {
        let is = |s: &&ShapeDesc| matches!(&s.geometry, GeometryDesc::Exact(exact) if matches!(*exact, Shape::Sphere(_)));
        scene.shapes.iter().filter(is).count()
    };
    // Spheres stand where a line goes on.
    for (mode, cylinders, balls) in [(0, 0, 4), (1, 2, 0), (2, 4, 4), (3, 3, 2)] {
        let mut parts = Parts::default();
        let p = parts.positions(&SQUARE);
        let scene = parts.read(&one(&format!(r#""mode":{mode},"attributes":{{"POSITION":{p}}}"#)));
        assert_eq!(spheres(&scene), balls, "mode {mode}");
        assert_eq!(scene.shapes.len(), cylinders + balls, "mode {mode}");
        for (i, shape) in scene.shapes.iter().enumerate() {
            assert_eq!(shape.index as usize, i);
            let GeometryDesc::Exact(exact) = &shape.geometry else { panic!("an exact shape is expected") };
            let bounds = exact.bounds(&shape.world_from_object).unwrap();
            // The square is 5 across.
            assert!(
                bounds.size().min_element() > 0.0 && bounds.size().min_element() <= 2.0 * 0.004 * 5.0 + 1e-9
            );
        }
        Scene::build(scene).unwrap();
    }
}

#[test]
fn points_and_lines_have_the_colours_of_their_vertices() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let list: Vec<f32> = (0..16).map(|i| i as f32 / 16.0).collect();
    let c = parts.add(&floats(&list), r#""componentType":5126,"type":"VEC4","count":4"#);
    let colour = |i: usize| Rgb::new(list[4 * i], list[4 * i + 1], list[4 * i + 2]);
    let at = |i: usize| Vec3::from_array(SQUARE[i]).as_dvec3();
    // The vertices that each shape lies between: of points, and of a strip, whose spheres stand where it goes on.
    let expected: [(u32, &[[usize; 2]]); 2] =
        [(0, &[[0, 0], [1, 1], [2, 2], [3, 3]]), (3, &[[0, 1], [1, 1], [1, 2], [2, 2], [2, 3]])];
    for (mode, ends) in expected {
        for material in ["", r#""material":0,"#] {
            let mut diagnostics = Diagnostics::new();
            let rest = format!(
                r#""extensionsUsed":["KHR_materials_unlit"],
                "materials":[{{"alphaMode":"BLEND","extensions":{{"KHR_materials_unlit":{{}}}}}}],
                "meshes":[{{"primitives":[{{"mode":{mode},{material}"attributes":{{"POSITION":{p},"COLOR_0":{c}}}}}]}}],
                "nodes":[{{"mesh":0}}]"#
            );
            let bytes = glb(&parts.json(&rest), &parts.binary);
            let scene = read_with(&bytes, &GltfOptions::default(), &mut diagnostics).unwrap();
            assert_eq!(diagnostics.lines(), [""; 0]);
            assert_eq!(scene.shapes.len(), ends.len());
            for (shape, &[a, b]) in scene.shapes.iter().zip(ends) {
                let GeometryDesc::Coloured(found) = &shape.geometry else { panic!("colours are expected") };
                assert_eq!(matches!(found.shape, Shape::Sphere(_)), a == b);
                assert_eq!((found.ends, found.colours), ([at(a), at(b)], [colour(a), colour(b)]));
                assert_eq!(found.coverages, [list[4 * a + 3], list[4 * b + 3]]);
                let light = shape.area_light.as_ref();
                assert_eq!(light.map(|light| light.by_vertices), (!material.is_empty()).then_some(true));
                assert_eq!(shape.alpha.is_some(), !material.is_empty());
            }
            let base = match &scene.materials[0].material.kind {
                MaterialKind::Principled(params) => format!("{:?}", params.base_color),
                other => format!("{other:?}"),
            };
            // White, and not the ink of what has no colour of its own.
            assert!(!material.is_empty() || base.contains("Vertices") && base.contains("r: 1.0"), "{base}");
            Scene::build(scene).unwrap();
        }
    }
}

/// Radius and base colour of the first shape, a sphere or a cylinder.
fn thin(scene: &SceneDesc) -> (f64, Rgb) {
    let GeometryDesc::Exact(exact) = &scene.shapes[0].geometry else { panic!("an exact shape is expected") };
    let size = exact.bounds(&scene.shapes[0].world_from_object).unwrap().size();
    let MaterialKind::Principled(params) = &scene.materials[0].material.kind else {
        panic!("principled is expected")
    };
    let colour = match *params.base_color {
        Texture::Constant(colour) => colour,
        ref other => panic!("{other:?}"),
    };
    (0.5 * size.min_element(), colour)
}

#[test]
fn points_and_lines_have_a_visible_width_and_colour() {
    // A square of 5 by its diagonal, at twice its size, and another far to its right: 50 across, and 8 high.
    let scene = |mode: u32, material: &str| {
        let mut parts = Parts::default();
        let p = parts.positions(&SQUARE);
        parts.read(&format!(
            r#""materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,1]}}}}],
            "meshes":[{{"primitives":[{{"mode":{mode},{material}"attributes":{{"POSITION":{p}}}}}]}},
                {{"primitives":[{{"attributes":{{"POSITION":{p}}}}}]}}],
            "nodes":[{{"mesh":0,"scale":[2,2,2]}},{{"mesh":1,"translation":[40,0,0]}}]"#
        ))
    };
    let (low, high) = SQUARE.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| {
        (low.min(Vec3::from_array(p)), high.max(Vec3::from_array(p)))
    });
    let whole = (high + Vec3::X * 40.0).max(2.0 * high) - (2.0 * low).min(low);
    let whole = f64::from(whole.length());
    for (mode, share) in [(0, 0.004), (1, 0.002), (3, 0.002)] {
        let (radius, ink) = thin(&scene(mode, ""));
        assert!((radius / (share * whole) - 1.0).abs() < 1e-5, "mode {mode}: {radius} of {whole}");
        assert!(ink.luminance() < 0.2 && ink.b > 3.0 * ink.g, "{ink:?}");
        let (_, own) = thin(&scene(mode, r#""material":0,"#));
        assert_eq!(own, Rgb::WHITE);
    }
    // What is a surface keeps glTF's own default.
    assert_eq!(colour_of_default_surface(), Rgb::WHITE);
    // Of a hundred thousand points, each is less than a five hundredth across.
    let mut parts = Parts::default();
    let cloud: Vec<[f32; 3]> =
        (0..100_000).map(|i| [i as f32 * 1e-5, (i % 317) as f32 / 316.0, 0.0]).collect();
    let p = parts.positions(&cloud);
    let (radius, _) = thin(&parts.read(&one(&format!(r#""mode":0,"attributes":{{"POSITION":{p}}}"#))));
    assert!((radius / (0.5 / 100_000_f64.sqrt() * 2_f64.sqrt()) - 1.0).abs() < 1e-3, "{radius}");
}

fn colour_of_default_surface() -> Rgb {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let scene = parts.read(&one(&format!(r#""mode":6,"attributes":{{"POSITION":{p}}}"#)));
    match &scene.materials[0].material.kind {
        MaterialKind::Principled(params) => match *params.base_color {
            Texture::Constant(colour) => colour,
            ref other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    }
}

#[test]
fn images_of_the_wrong_declared_type_are_read_with_a_note() {
    let image = picture([51, 102, 204], image::ImageFormat::Png);
    let escaped: String = image.iter().map(|byte| format!("%{byte:02x}")).collect();
    let said = |image: &str| {
        let mut parts = Parts::default();
        let p = parts.positions(&SQUARE);
        let uv = parts.add(&floats(&[0.0; 8]), r#""componentType":5126,"type":"VEC2","count":4"#);
        let one = one(&format!(r#""mode":6,"material":0,"attributes":{{"POSITION":{p},"TEXCOORD_0":{uv}}}"#));
        let json = parts.json(&format!(
            r#""images":[{image}],"textures":[{{"source":0}}],
            "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],{one}"#
        ));
        let mut diagnostics = Diagnostics::new();
        let scene = read_with(&glb(&json, &parts.binary), &GltfOptions::default(), &mut diagnostics).unwrap();
        let MaterialKind::Principled(params) = &scene.materials[0].material.kind else {
            panic!("principled")
        };
        assert!(matches!(*params.base_color, Texture::Image(_)), "{:?}", params.base_color);
        diagnostics.lines()
    };
    assert_eq!(said(&format!(r#"{{"uri":"data:image/png,{escaped}"}}"#)), [""; 0]);
    assert_eq!(said(&format!(r#"{{"uri":"data:image/PNG,{escaped}"}}"#)), [""; 0]);
    for (wrong, kind) in [("image/jpeg", "jpeg"), ("", "none"), ("application/octet-stream", "other")] {
        let lines = said(&format!(r#"{{"uri":"data:{wrong},{escaped}"}}"#));
        assert_eq!(lines.len(), 1, "{kind}: {lines:?}");
        assert!(lines[0].contains("/images/0/uri: wrong media type of an image"), "{kind}: {lines:?}");
        assert!(lines[0].contains(r#"expected "image/png""#), "{kind}: {lines:?}");
    }
    let lines = said(&format!(r#"{{"mimeType":"image/jpeg","uri":"data:image/png,{escaped}"}}"#));
    assert!(lines.len() == 1 && lines[0].contains("/images/0/mimeType: wrong media type"), "{lines:?}");
}

#[test]
fn interleaved_and_strided_vertices_are_told_apart() {
    let mut binary = vec![];
    for (i, p) in SQUARE.iter().enumerate() {
        binary.extend(floats(p));
        binary.extend(floats(&[0.0, 0.0, 1.0]));
        binary.extend(shorts(&[i as u16 * 16384, 65535]));
        // Something else's.
        binary.extend([0xFF; 8]);
    }
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{},"byteStride":36}}],
        "accessors":[
            {{"bufferView":0,"componentType":5126,"type":"VEC3","count":4,"min":[0,0,0],"max":[9,9,9]}},
            {{"bufferView":0,"byteOffset":12,"componentType":5126,"type":"VEC3","count":4}},
            {{"bufferView":0,"byteOffset":24,"componentType":5123,"normalized":true,"type":"VEC2","count":4}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
        "textures":[{{}}],
        "meshes":[{{"primitives":[{{"mode":6,"material":0,
            "attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2}}}}]}}],
        "nodes":[{{"mesh":0}}]}}"#,
        binary.len(),
        binary.len()
    );
    let scene = read(&json, &binary);
    let mesh = mesh(&scene.shapes[0]);
    assert_eq!(mesh.positions, SQUARE.map(Vec3::from_array));
    assert_eq!(mesh.normals, Some(vec![Vec3::Z; 4]));
    let uvs = mesh.uvs.as_ref().unwrap();
    for (i, uv) in uvs.iter().enumerate() {
        // v counts upwards in a scene.
        assert!((*uv - Vec2::new(i as f32 * 16384.0 / 65535.0, 0.0)).length() < 1e-6);
    }
}

#[test]
fn quantized_numbers_of_every_type_are_read() {
    let cases: [(u32, bool, Vec<u8>, f32); 8] = [
        (5120, false, vec![2, 0, 0xFD, 0], -3.0),
        (5120, true, vec![127, 0, 0x80, 0], -1.0),
        (5121, false, vec![2, 0, 253, 0], 253.0),
        (5121, true, vec![255, 0, 51, 0], 0.2),
        (5122, false, shorts(&[2, 0, 0xFF00, 0]), -256.0),
        (5122, true, shorts(&[0x7FFF, 0, 0x8001, 0]), -1.0),
        (5123, false, shorts(&[2, 0, 65000, 0]), 65000.0),
        (5123, true, shorts(&[0xFFFF, 0, 13107, 0]), 0.2),
    ];
    for (component, normalized, element, z) in cases {
        let stride = element.len();
        let binary: Vec<u8> = element.repeat(3);
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_mesh_quantization"],
            "extensionsRequired":["KHR_mesh_quantization"],"buffers":[{{"byteLength":{}}}],
            "bufferViews":[{{"buffer":0,"byteLength":{},"byteStride":{stride}}}],
            "accessors":[{{"bufferView":0,"componentType":{component},"normalized":{normalized},"type":"VEC3","count":3,
                "min":[0,0,0],"max":[9,9,9]}}],{}}}"#,
            binary.len(),
            binary.len(),
            one(r#""attributes":{"POSITION":0}"#)
        );
        let scene = read(&json, &binary);
        let p = mesh(&scene.shapes[0]).positions[2];
        assert!((p.z - z).abs() < 1e-6 * z.abs() && p.y == 0.0 && p.x > 0.0, "{component} {normalized}: {p}");
        // Without the extension these are no positions.
        let plain = json
            .replace(r#""extensionsUsed":["KHR_mesh_quantization"],"#, "")
            .replace(r#""extensionsRequired":["KHR_mesh_quantization"],"#, "");
        assert!(error(&plain, &binary).contains("/attributes/POSITION: accessor of a wrong type"));
    }
}

#[test]
fn sparse_accessors_work_with_and_without_a_base() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    parts.add(&[1, 3], r#""componentType":5121,"type":"SCALAR","count":2"#);
    parts.add(&floats(&[7.0, 8.0, 9.0, 1.5, 2.5, 3.5]), r#""componentType":5126,"type":"VEC3","count":2"#);
    let sparse =
        r#""sparse":{"count":2,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":2}}"#;
    let kind = r#""componentType":5126,"type":"VEC3","count":4,"min":[0,0,0],"max":[9,9,9]"#;
    parts.accessors.push(format!(r#"{{"bufferView":0,{kind},{sparse}}}"#));
    parts.accessors.push(format!(r#"{{{kind},{sparse}}}"#));
    let read = |a: usize| {
        let scene = parts.read(&one(&format!(r#""mode":6,"attributes":{{"POSITION":{a}}}"#)));
        mesh(&scene.shapes[0]).positions.clone()
    };
    let (one, three) = (Vec3::new(7.0, 8.0, 9.0), Vec3::new(1.5, 2.5, 3.5));
    let square = SQUARE.map(Vec3::from_array);
    assert_eq!(read(p), square);
    assert_eq!(read(3), [square[0], one, square[2], three]);
    assert_eq!(read(4), [Vec3::ZERO, one, Vec3::ZERO, three]);
}

#[test]
fn nodes_stand_where_their_parents_and_parts_say() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    // A quarter turn about z, then doubled along x, below a parent that moves.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"mode":6,"attributes":{{"POSITION":{p}}}}}]}}],
        "nodes":[{{"translation":[10,20,30],"children":[1]}},
            {{"mesh":0,"rotation":[0,0,{half},{half}],"scale":[2,1,-1],"translation":[1,0,0]}},
            {{"mesh":0,"matrix":[0,2,0,0, -3,0,0,0, 0,0,1,0, 5,6,7,1]}}],
        "scenes":[{{"nodes":[2]}},{{"nodes":[0,2]}}],"scene":1"#
    );
    let scene = parts.read(&rest);
    assert_eq!((scene.objects.len(), scene.instances.len(), scene.shapes.len()), (1, 2, 0));
    let at = |i: usize| scene.instances[i].world_from_object.at(0.0).point(DVec3::new(3.0, 4.0, 2.0));
    assert!((at(0) - DVec3::new(11.0 - 4.0, 20.0 + 6.0, 30.0 - 2.0)).length() < 1e-9, "{}", at(0));
    assert!(scene.instances[0].world_from_object.at(0.0).is_mirror());
    assert!((at(1) - DVec3::new(5.0 - 12.0, 6.0 + 6.0, 9.0)).length() < 1e-9, "{}", at(1));
    Scene::build(scene).unwrap();
    // The other scene has one place, and so no object.
    let scene = parts.read(&rest.replace(r#""scene":1"#, r#""scene":0"#));
    assert_eq!((scene.objects.len(), scene.instances.len(), scene.shapes.len()), (0, 0, 1));
}

#[test]
fn flattened_nodes_are_flat_and_vanished_ones_are_gone() {
    for (scale, shapes) in [("[1,1,0]", 1), ("[0,1,1]", 0), ("[0,0,0]", 0)] {
        let mut parts = Parts::default();
        let p = parts.positions(&SQUARE);
        let rest = one(&format!(r#""mode":6,"attributes":{{"POSITION":{p}}}"#));
        let scene = parts.read(&rest.replace(r#"{"mesh":0}"#, &format!(r#"{{"mesh":0,"scale":{scale}}}"#)));
        let seen = scene.shapes.iter().filter(|s| mesh(s).positions.iter().all(|p| p.z == 0.0)).count();
        let flat = if scale == "[0,1,1]" { 0 } else { seen };
        assert_eq!(flat, shapes, "{scale}");
        Scene::build(scene).unwrap();
    }
}

#[test]
fn nodes_may_hang_on_each_other_two_hundred_thousand_deep() {
    let depth = 200_000;
    let nodes: Vec<String> =
        (1..depth).map(|i| format!(r#"{{"children":[{i}],"translation":[0,0,1]}}"#)).collect();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{},{{"camera":0}}],"cameras":[{{"type":"perspective",
        "perspective":{{"yfov":0.7,"znear":0.1}}}}]}}"#,
        nodes.join(",")
    );
    let scene = read_with(json.as_bytes(), &GltfOptions::default(), &mut Diagnostics::new()).unwrap();
    let depth = f64::from(depth - 1);
    assert!(
        (scene.cameras[0].world_from_camera.point(DVec3::ZERO) - DVec3::new(0.0, 0.0, depth)).length() < 1e-6
    );
}

#[test]
fn instancing_places_copies() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let t = parts.add(
        &floats(&[1.0, 2.0, 3.0, -4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
        r#""componentType":5126,"type":"VEC3","count":3"#,
    );
    let s = parts.add(&floats(&[2.0; 9]), r#""componentType":5126,"type":"VEC3","count":3"#);
    let scene = parts.read(&format!(
        r#""extensionsUsed":["EXT_mesh_gpu_instancing"],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}}}}]}}],
        "nodes":[{{"mesh":0,"translation":[0,0,100],"extensions":{{"EXT_mesh_gpu_instancing":
            {{"attributes":{{"TRANSLATION":{t},"SCALE":{s}}}}}}}}}]"#
    ));
    assert_eq!((scene.objects.len(), scene.instances.len()), (1, 3));
    let at = scene.instances[1].world_from_object.at(0.0).point(DVec3::new(1.0, 1.0, 1.0));
    assert!((at - DVec3::new(-2.0, 7.0, 108.0)).length() < 1e-9, "{at}");
}

/// A square of two joints, which a spline bends and a morph target lifts.
fn animated() -> (Parts, String) {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let joints = parts.add(&[0, 1, 0, 0].repeat(4), r#""componentType":5121,"type":"VEC4","count":4"#);
    let weights: Vec<f32> =
        [[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0]].concat();
    let weights = parts.add(&floats(&weights), r#""componentType":5126,"type":"VEC4","count":4"#);
    let lift = parts.positions(&[[0.0, 0.0, 1.0]; 4]);
    let times = parts.add(&floats(&[1.0, 3.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let moves = parts
        .add(&floats(&[0.0, 0.0, 0.0, 8.0, 0.0, 0.0]), r#""componentType":5126,"type":"VEC3","count":2"#);
    let morphs = parts.add(&floats(&[0.0, 2.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = parts.add(
        &floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -half, -half]),
        r#""componentType":5126,"type":"VEC4","count":2"#,
    );
    // Tangent in, value, tangent out.
    let spline: Vec<f32> = [[0.0; 3], [1.0; 3], [2.0; 3], [-1.0; 3], [3.0; 3], [0.0; 3]].concat();
    let spline = parts.add(&floats(&spline), r#""componentType":5126,"type":"VEC3","count":6"#);
    let rest = format!(
        r#""meshes":[{{"weights":[0.5],"primitives":[{{"mode":6,
            "attributes":{{"POSITION":{p},"JOINTS_0":{joints},"WEIGHTS_0":{weights}}},"targets":[{{"POSITION":{lift}}}]}}]}}],
        "skins":[{{"joints":[1,2]}}],
        "nodes":[{{"mesh":0,"skin":0,"translation":[99,99,99]}},{{"children":[2]}},{{"translation":[0,0,0]}},
            {{"camera":0}},{{"camera":0}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1}}}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{moves}}},{{"input":{times},"output":{morphs},"interpolation":"STEP"}},
            {{"input":{times},"output":{turns}}},{{"input":{times},"output":{spline},"interpolation":"CUBICSPLINE"}}],
            "channels":[{{"sampler":0,"target":{{"node":2,"path":"translation"}}}},
                {{"sampler":1,"target":{{"node":0,"path":"weights"}}}},
                {{"sampler":2,"target":{{"node":3,"path":"rotation"}}}},
                {{"sampler":3,"target":{{"node":4,"path":"translation"}}}}]}}]"#
    );
    (parts, rest)
}

fn at_time(frame: Option<f64>) -> SceneDesc {
    let (parts, rest) = animated();
    let options = changed(GltfOptions::default(), |it| it.frame = frame);
    read_with(&glb(&parts.json(&rest), &parts.binary), &options, &mut Diagnostics::new()).unwrap()
}

#[test]
fn skins_and_morph_targets_stand_at_their_time() {
    let square = SQUARE.map(Vec3::from_array);
    // Weight of the morph target, and how far the second joint has come.
    for (frame, weight, far) in [
        (None, 0.5, 0.0),
        (Some(0.0), 0.0, 0.0),
        (Some(1.5), 0.0, 2.0),
        (Some(2.0), 0.0, 4.0),
        (Some(3.0), 2.0, 8.0),
        (Some(9.0), 2.0, 8.0),
    ] {
        let scene = at_time(frame);
        let found = &mesh(&scene.shapes[0]).positions;
        for (i, share) in [0.0, 0.5, 1.0, 0.75].into_iter().enumerate() {
            let expected = square[i] + Vec3::new(share * far, 0.0, weight);
            assert!((found[i] - expected).length() < 1e-5, "{frame:?} {i}: {} {expected}", found[i]);
        }
    }
}

#[test]
fn skins_and_morph_targets_are_seen_moving() {
    let (parts, rest) = animated();
    let options = changed(GltfOptions::default(), |it| {
        it.frame = Some(2.5);
        it.shutter = 2.0;
    });
    let mut diagnostics = Diagnostics::new();
    let scene = read_with(&glb(&parts.json(&rest), &parts.binary), &options, &mut diagnostics).unwrap();
    assert_eq!(diagnostics.lines(), [""; 0]);
    let found = mesh(&scene.shapes[0]);
    let motion = found.motion.as_ref().unwrap();
    assert_eq!((motion.start, motion.end, motion.moments.len()), (0.0, 1.0, 9));
    for (i, moment) in (0..).zip(&motion.moments) {
        let still = at_time(Some(1.5 + 2.0 * f64::from(i) / 8.0));
        assert_eq!(moment.positions, mesh(&still.shapes[0]).positions);
    }
    assert_eq!(found.positions, mesh(&at_time(Some(2.5)).shapes[0]).positions);
    assert!(motion.moments[0] != motion.moments[8]);
    assert!(Scene::build(scene).unwrap().moves());
    // Nothing moves before the first keyframe.
    let options = changed(GltfOptions::default(), |it| {
        it.frame = Some(0.4);
        it.shutter = 1.0;
    });
    let bytes = glb(&parts.json(&rest), &parts.binary);
    let still = read_with(&bytes, &options, &mut Diagnostics::new()).unwrap();
    assert_eq!(mesh(&still.shapes[0]).motion, None);
    assert!(!Scene::build(still).unwrap().moves());
}

#[test]
fn nodes_and_cameras_that_animations_move_are_seen_moving() {
    // A square that goes 8 along x from 1 s to 3 s, which hangs under one that does a whole turn about z meanwhile.
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let times = parts.add(&floats(&[1.0, 3.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let moves = parts
        .add(&floats(&[0.0, 0.0, 0.0, 8.0, 0.0, 0.0]), r#""componentType":5126,"type":"VEC3","count":2"#);
    let quarters =
        parts.add(&floats(&[1.0, 1.5, 2.0, 2.5, 3.0]), r#""componentType":5126,"type":"SCALAR","count":5"#);
    let turn = |degrees: f32| {
        let (sin, cos) = (0.5 * degrees).to_radians().sin_cos();
        [0.0, 0.0, sin, cos]
    };
    let turns: Vec<f32> = [0.0, 90.0, 180.0, 270.0, 360.0].map(turn).concat();
    let turns = parts.add(&floats(&turns), r#""componentType":5126,"type":"VEC4","count":5"#);
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"mode":6,"attributes":{{"POSITION":{p}}}}}]}}],
        "nodes":[{{"mesh":0}},{{"camera":0}},{{"children":[0,3]}},{{"mesh":0,"translation":[0,5,0]}},{{"mesh":0}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1}}}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{moves}}},{{"input":{quarters},"output":{turns}}}],
            "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}},
                {{"sampler":0,"target":{{"node":1,"path":"translation"}}}},
                {{"sampler":1,"target":{{"node":2,"path":"rotation"}}}}]}}]"#
    );
    let bytes = glb(&parts.json(&rest), &parts.binary);
    let read = |frame, shutter| {
        let mut diagnostics = Diagnostics::new();
        let options = changed(GltfOptions::default(), |it| {
            it.frame = frame;
            it.shutter = shutter;
        });
        let scene = read_with(&bytes, &options, &mut diagnostics).unwrap();
        assert_eq!(diagnostics.lines(), [""; 0]);
        scene
    };
    for (frame, shutter) in [(None, 1.0), (Some(2.0), 0.0)] {
        assert!(!Scene::build(read(frame, shutter)).unwrap().moves());
    }
    let (middle, shutter) = (2.0, 1.0);
    let scene = read(Some(middle), shutter);
    // Where a place of the mesh is at a part of the exposure.
    let expected = |part: f64, at: DVec3, slides: bool| {
        let time = middle + shutter * (part - 0.5);
        let share = (time - 1.0) / 2.0;
        let turn = Transform::rotate(DVec3::Z, 360.0 * share).unwrap();
        turn.point(at + if slides { DVec3::new(8.0 * share, 0.0, 0.0) } else { DVec3::new(0.0, 5.0, 0.0) })
    };
    let mut moving = 0;
    for instance in &scene.instances {
        let Placement::Moving(motion) = &instance.world_from_object else { continue };
        let slides = (motion.at(0.0).point(DVec3::ZERO) - expected(0.0, DVec3::ZERO, true)).length() < 1e-5;
        moving += 1 + 10 * usize::from(slides);
        let at = DVec3::new(0.5, 0.25, 2.0);
        // At the moments that are looked at it is where it is; between them next to it.
        for step in 0..=32 {
            let part = f64::from(step) / 32.0;
            let apart = (motion.at(part).point(at) - expected(part, at, slides)).length();
            assert!(apart < if step % 2 == 0 { 1e-5 } else { 0.04 }, "{part}: {apart}");
        }
    }
    // Of the third, which stands still, there is an instance as well.
    assert_eq!((moving, scene.instances.len()), (12, 3));
    let camera = &scene.cameras[0];
    assert_eq!((camera.shutter_open, camera.shutter_close), (0.0, 1.0));
    let motion = camera.motion.as_ref().unwrap();
    assert_eq!(motion.keys().len(), 2);
    for (part, x) in [(0.0, 2.0), (0.5, 4.0), (1.0, 6.0)] {
        assert!((motion.at(part).point(DVec3::ZERO) - DVec3::new(x, 0.0, 0.0)).length() < 1e-5);
    }
    assert!((camera.world_from_camera.point(DVec3::ZERO) - DVec3::new(4.0, 0.0, 0.0)).length() < 1e-5);
    assert!(Scene::build(scene).unwrap().moves());
}

#[test]
fn rotations_take_the_shorter_way_and_splines_their_curve() {
    let scene = at_time(Some(2.0));
    // A half of a quarter turn about z.
    let forward = scene.cameras[0].world_from_camera.vector(DVec3::X);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!((forward - DVec3::new(half, half, 0.0)).length() < 1e-6, "{forward}");
    // Half way: (1 + 3) / 2 + 2 seconds · (2 - -1) / 8.
    let place = scene.cameras[1].world_from_camera.point(DVec3::ZERO);
    assert!((place - DVec3::splat(2.75)).length() < 1e-6, "{place}");
}

#[test]
fn measured_lights_shine_as_their_profile_says_along_minus_z() {
    // 200 candelas straight ahead, none from 90 degrees on.
    let profile = "IES:LM-63-2019\nTILT=NONE\n1 -1 2 2 1 1 1 0 0 0 1 1 60\n0 90\n0\n100 0\n";
    let json = |profile: &str| {
        let data = profile.replace('\n', "%0A").replace(' ', "%20");
        format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["EXT_lights_ies"],
            "extensions":{{"EXT_lights_ies":{{"lights":[{{"uri":"data:application/x-ies-lm-63,{data}"}}]}}}},
            "nodes":[{{"translation":[1,2,3],"rotation":[0,0.7071067811865476,0,0.7071067811865476],"scale":[5,5,5],
            "extensions":{{"EXT_lights_ies":{{"light":0,"multiplier":3,"color":[1,0.5,0.25]}}}}}}]}}"#
        )
    };
    let scene = read(&json(profile), &[]);
    let scene = Scene::build(SceneDesc { without_light: WithoutLight::Dark, ..scene }).unwrap();
    assert_eq!(scene.lights().len(), 1);
    // A quarter turn about y takes -z to -x. At distance d the irradiance is I / d².
    let place = DVec3::new(1.0, 2.0, 3.0);
    for (towards, share) in [
        (-DVec3::X, 1.0),
        (DVec3::X, 0.0),
        (DVec3::new(-1.0, 1.0, 0.0), 0.5),
        (DVec3::new(-1.0, 0.0, -1.0), 0.5),
    ] {
        let towards = towards.normalize();
        let found = scene.lights()[0].irradiance(place + 4.0 * towards, 0.0, -towards).unwrap();
        let expected = Rgb::new(1.0, 0.5, 0.25) * (3.0 * 200.0 / 16.0 * share) as f32;
        assert!((found - expected).map(f32::abs).max_component() < 0.5, "{towards}: {found:?} {expected:?}");
    }
    let wrong = error(&json(&profile.replace("100 0", "100 x")), &[]);
    assert!(
        wrong.contains("/extensions/EXT_lights_ies/lights/0/uri") && wrong.contains("wrong number"),
        "{wrong}"
    );
    let wrong = error(&json(profile).replace(r#""light":0"#, r#""light":1"#), &[]);
    assert!(wrong.contains("/nodes/0/extensions/EXT_lights_ies/light"), "{wrong}");
}

#[test]
fn animations_by_pointers_change_what_they_name() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let times = parts.add(&floats(&[1.0, 3.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let colours = parts.add(
        &floats(&[0.0, 1.0, 0.5, 1.0, 1.0, 0.0, 0.5, 1.0]),
        r#""componentType":5126,"type":"VEC4","count":2"#,
    );
    let numbers = parts.add(&floats(&[2.0, 6.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let places = parts
        .add(&floats(&[0.0, 0.0, 0.0, 8.0, 4.0, 2.0]), r#""componentType":5126,"type":"VEC3","count":2"#);
    let channel = |sampler: usize, pointer: &str| {
        format!(
            r#"{{"sampler":{sampler},"target":{{"path":"pointer","extensions":{{"KHR_animation_pointer":{{"pointer":"{pointer}"}}}}}}}}"#
        )
    };
    let rest = |channels: &[String]| {
        format!(
            r#""extensionsUsed":["KHR_animation_pointer","KHR_lights_punctual","KHR_materials_emissive_strength"],
            "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":1}}]}}}},
            "materials":[{{"emissiveFactor":[1,1,1],"pbrMetallicRoughness":{{"metallicFactor":0}}}}],
            "meshes":[{{"primitives":[{{"mode":6,"material":0,"attributes":{{"POSITION":{p}}}}}]}}],
            "nodes":[{{"mesh":0}},{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}},"translation":[1,1,1]}}],
            "animations":[{{"samplers":[{{"input":{times},"output":{colours}}},{{"input":{times},"output":{numbers}}},
                {{"input":{times},"output":{places}}}],"channels":[{}]}}]"#,
            channels.join(",")
        )
    };
    let all = [
        channel(0, "/materials/0/pbrMetallicRoughness/baseColorFactor"),
        channel(1, "/extensions/KHR_lights_punctual/lights/0/intensity"),
        channel(1, "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength"),
        channel(2, "/nodes/1/translation"),
    ];
    for (frame, strength, place, green) in
        [(None, 1.0, DVec3::ONE, 1.0), (Some(1.5), 3.0, DVec3::new(2.0, 1.0, 0.5), 0.75)]
    {
        let options = changed(GltfOptions::default(), |it| it.frame = frame);
        let mut diagnostics = Diagnostics::new();
        let scene =
            read_with(&glb(&parts.json(&rest(&all)), &parts.binary), &options, &mut diagnostics).unwrap();
        assert_eq!(diagnostics.lines(), Vec::<String>::new());
        let LightDesc::Point { from, intensity } = &scene.lights[0] else { panic!("{:?}", scene.lights) };
        assert!((*from - place).length() < 1e-6, "{from}");
        assert_eq!(*intensity, Rgb::splat(strength));
        let light = scene.shapes[0].area_light.as_ref().unwrap();
        assert_eq!(light.radiance, Rgb::splat(strength));
        let material = format!("{:?}", scene.materials[0].material);
        assert!(frame.is_none() || material.contains(&format!("g: {green:?}")), "{material}");
    }
    // While the shutter is open nodes move; what else changes is said to stand, if it really does.
    for (middle, shutter, still) in [(2.0, 0.5, 3), (0.4, 0.5, 0)] {
        let options = changed(GltfOptions::default(), |it| {
            it.frame = Some(middle);
            it.shutter = shutter;
        });
        let mut diagnostics = Diagnostics::new();
        let scene =
            read_with(&glb(&parts.json(&rest(&all)), &parts.binary), &options, &mut diagnostics).unwrap();
        let lines = diagnostics.lines();
        assert_eq!(lines.len(), still, "{lines:?}");
        assert_eq!(still > 0, matches!(scene.lights[0], LightDesc::Moving { .. }));
        let is_said = |(i, pointer): (usize, &str)| {
            let start = format!("/animations/0/channels/{i}: animation without motion blur");
            lines[i].contains(&start) && lines[i].contains(pointer)
        };
        let places = ["/baseColorFactor\"", "/lights/0/intensity\"", "/KHR_materials_emissive_strength/"];
        assert!(places.into_iter().enumerate().take(still).all(is_said), "{lines:?}");
    }
    // What cannot be animated, or is not there, is said and left out.
    for (pointer, said) in [
        ("/buffers/0/byteLength", "/pointer: animation is left out: this cannot be animated"),
        ("/materials/1/alphaCutoff", "/pointer: animation is left out: there is no such value"),
        ("/nodes/2/scale/0", "/pointer: animation is left out: there is no such value"),
    ] {
        let options = changed(GltfOptions::default(), |it| it.frame = Some(1.5));
        let mut diagnostics = Diagnostics::new();
        let odd = glb(&parts.json(&rest(&[channel(1, pointer)])), &parts.binary);
        read_with(&odd, &options, &mut diagnostics).unwrap();
        assert!(diagnostics.lines()[0].contains(said), "{pointer}: {:?}", diagnostics.lines());
    }
}

#[test]
fn one_animation_is_chosen_and_conflicting_ones_do_not_mix() {
    let mut parts = Parts::default();
    let times = parts.add(&floats(&[1.0, 3.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let moves = [8.0, 16.0].map(|far| {
        parts.add(&floats(&[0.0, 0.0, 0.0, far, 0.0, 0.0]), r#""componentType":5126,"type":"VEC3","count":2"#)
    });
    let clip = |start: &str, output: usize, nodes: &[u32]| {
        let channels: Vec<String> = nodes
            .iter()
            .map(|node| format!(r#"{{"sampler":0,"target":{{"node":{node},"path":"translation"}}}}"#))
            .collect();
        let channels = channels.join(",");
        format!(r#"{{{start}"samplers":[{{"input":{times},"output":{output}}}],"channels":[{channels}]}}"#)
    };
    // The second moves what the first moves, and something else; the third has no name.
    let clips = [
        clip(r#""name":"Walk","#, moves[0], &[0]),
        clip(r#""name":"Run","#, moves[1], &[1, 0]),
        clip("", moves[0], &[2]),
    ];
    let rest = format!(
        r#""extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point"}}]}}}},
        "nodes":[{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
            {{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}],
        "animations":[{}]"#,
        clips.join(",")
    );
    let bytes = glb(&parts.json(&rest), &parts.binary);
    let at = |animation: Option<&str>, shutter: f64, diagnostics: &mut Diagnostics| {
        let animation = animation.map(Into::into);
        let options = changed(GltfOptions::default(), |it| {
            it.frame = Some(2.0);
            it.shutter = shutter;
            it.animation = animation;
        });
        let scene = read_with(&bytes, &options, diagnostics)?;
        let place = |light: &LightDesc| match light {
            LightDesc::Point { from, .. } => from.x,
            LightDesc::Moving { world_from_light, .. } => world_from_light.at(0.5).point(DVec3::ZERO).x,
            other => panic!("{other:?}"),
        };
        Ok::<_, FormatError>(scene.lights.iter().map(place).collect::<Vec<f64>>())
    };
    for shutter in [0.0, 1.0] {
        let mut diagnostics = Diagnostics::new();
        assert_eq!(at(None, shutter, &mut diagnostics).unwrap(), [4.0, 0.0, 4.0]);
        let lines = diagnostics.lines();
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert!(lines[0].contains("/animations/1: ") && lines[0].contains("\"Run\""), "{lines:?}");
        for (name, expected) in [
            ("Run", [8.0, 8.0, 0.0]),
            ("0", [4.0, 0.0, 0.0]),
            ("2", [0.0, 0.0, 4.0]),
            ("Walk", [4.0, 0.0, 0.0]),
        ] {
            let mut diagnostics = Diagnostics::new();
            assert_eq!(at(Some(name), shutter, &mut diagnostics).unwrap(), expected, "{name}");
            assert_eq!(diagnostics.lines(), [""; 0]);
        }
    }
    for wrong in ["3", "run", ""] {
        let error = at(Some(wrong), 0.0, &mut Diagnostics::new()).unwrap_err().to_string();
        let is_said = error.contains("no such animation") && error.contains(r#""Walk", "Run", "2""#);
        assert!(is_said && (wrong != "run" || error.contains("Run")), "{error}");
    }
}

/// The same animations, but by pointers.
fn by_pointers(rest: &str) -> String {
    let mut out = String::from(r#""extensionsUsed":["KHR_animation_pointer"],"#);
    let mut parts = rest.split(r#""target":{"node":"#);
    out += parts.next().unwrap();
    for part in parts {
        let (node, part) = part.split_once(r#","path":""#).unwrap();
        let (path, part) = part.split_once(r#""}"#).unwrap();
        let extension = format!(r#"{{"KHR_animation_pointer":{{"pointer":"/nodes/{node}/{path}"}}}}"#);
        out += &format!(r#""target":{{"path":"pointer","extensions":{extension}}}{part}"#);
    }
    out
}

#[test]
fn nodes_move_by_pointers_as_they_do_by_names() {
    let (parts, rest) = animated();
    let mut moving = 0;
    for (frame, shutter) in [(None, 0.0), (Some(1.5), 0.0), (Some(2.5), 2.0), (Some(2.0), 0.5)] {
        let options = changed(GltfOptions::default(), |it| {
            it.frame = frame;
            it.shutter = shutter;
        });
        let [named, pointed] = [rest.clone(), by_pointers(&rest)].map(|rest| {
            let mut diagnostics = Diagnostics::new();
            let scene =
                read_with(&glb(&parts.json(&rest), &parts.binary), &options, &mut diagnostics).unwrap();
            assert_eq!(diagnostics.lines(), [""; 0]);
            scene
        });
        assert_eq!(format!("{named:?}"), format!("{pointed:?}"), "{frame:?} {shutter}");
        moving +=
            usize::from(mesh(&pointed.shapes[0]).motion.is_some() && pointed.cameras[0].motion.is_some());
    }
    assert_eq!(moving, 2);
}

#[test]
fn single_weights_and_those_of_meshes_are_animated_by_pointers() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let aside = parts.positions(&[[1.0, 0.0, 0.0]; 4]);
    let lift = parts.positions(&[[0.0, 0.0, 1.0]; 4]);
    let times = parts.add(&floats(&[1.0, 3.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let one = parts.add(&floats(&[2.0, 6.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let both = parts.add(&floats(&[0.0, 3.0, 4.0, 5.0]), r#""componentType":5126,"type":"SCALAR","count":4"#);
    let rest = |pointers: &[(usize, &str)]| {
        let channel = |(sampler, pointer): &(usize, &str)| {
            let extension = format!(r#"{{"KHR_animation_pointer":{{"pointer":"{pointer}"}}}}"#);
            format!(r#"{{"sampler":{sampler},"target":{{"path":"pointer","extensions":{extension}}}}}"#)
        };
        let channels: Vec<String> = pointers.iter().map(channel).collect();
        format!(
            r#""extensionsUsed":["KHR_animation_pointer"],
            "meshes":[{{"weights":[7,9],"primitives":[{{"mode":6,"attributes":{{"POSITION":{p}}},
                "targets":[{{"POSITION":{aside}}},{{"POSITION":{lift}}}]}}]}}],
            "nodes":[{{"mesh":0}},{{"mesh":0,"weights":[-1,-2]}}],
            "animations":[{{"samplers":[{{"input":{times},"output":{one}}},{{"input":{times},"output":{both}}}],
                "channels":[{}]}}]"#,
            channels.join(",")
        )
    };
    // Where the first vertex of a mesh is at 1.5 s, 2 s and 2.5 s.
    let seen = |pointers: &[(usize, &str)], node: usize, shutter: f64| {
        let bytes = glb(&parts.json(&rest(pointers)), &parts.binary);
        let options = changed(GltfOptions::default(), |it| {
            it.frame = Some(2.0);
            it.shutter = shutter;
        });
        let mut diagnostics = Diagnostics::new();
        let scene = read_with(&bytes, &options, &mut diagnostics).unwrap();
        let mesh = mesh(&scene.shapes[node]);
        let moved = mesh.motion.as_ref().map_or_else(
            || vec![mesh.positions[0]],
            |motion| [0, 4, 8].map(|i| motion.moments[i].positions[0]).to_vec(),
        );
        let added = moved.iter().map(|p| (*p - Vec3::from_array(SQUARE[0])).to_array());
        (added.collect::<Vec<_>>(), diagnostics.lines())
    };
    let none: Vec<String> = vec![];
    let of_mesh = [(1, "/meshes/0/weights")];
    assert_eq!(seen(&of_mesh, 0, 0.0), (vec![[2.0, 0.0, 4.0]], none.clone()));
    let moved = vec![[1.0, 0.0, 3.5], [2.0, 0.0, 4.0], [3.0, 0.0, 4.5]];
    assert_eq!(seen(&of_mesh, 0, 1.0), (moved, none.clone()));
    // What a node says of its own stays.
    assert_eq!(seen(&of_mesh, 1, 1.0), (vec![[-1.0, 0.0, -2.0]], none.clone()));
    let of_node = [(0, "/nodes/1/weights/1")];
    let moved = vec![[-1.0, 0.0, 3.0], [-1.0, 0.0, 4.0], [-1.0, 0.0, 5.0]];
    assert_eq!(seen(&of_node, 1, 1.0), (moved, none.clone()));
    assert_eq!(seen(&[(0, "/nodes/0/weights/0")], 0, 0.0), (vec![[4.0, 0.0, 9.0]], none));
    // One and all of them at once: the first counts.
    let (found, warnings) = seen(&[(0, "/nodes/1/weights/1"), (1, "/nodes/1/weights")], 1, 0.0);
    assert_eq!(found, [[-1.0, 0.0, 4.0]]);
    assert!(
        warnings[0].contains("/animations/0/channels/1: animation is left out: another one"),
        "{warnings:?}"
    );
    let wrong = error(&parts.json(&rest(&[(0, "/nodes/0/weights/2")])), &parts.binary);
    assert!(wrong.contains("morph targets that do not exist"), "{wrong}");
}

#[test]
fn cameras_look_along_minus_z_and_are_not_mirrored() {
    let json = r#"{"asset":{"version":"2.0"},"cameras":[
        {"type":"perspective","name":"wide","perspective":{"yfov":0.8,"znear":0.1,"aspectRatio":2}},
        {"type":"perspective","perspective":{"yfov":0.8,"znear":0.1,"aspectRatio":0.5}},
        {"type":"orthographic","orthographic":{"xmag":3,"ymag":2,"znear":0,"zfar":9}}],
        "nodes":[{"camera":0,"translation":[1,2,3],"scale":[5,5,5]},{"camera":1,"name":"tall"},{"camera":2}]}"#;
    let scene = read_with(json.as_bytes(), &GltfOptions::default(), &mut Diagnostics::new()).unwrap();
    let names: Vec<Option<&str>> = scene.cameras.iter().map(|c| c.name.as_deref()).collect();
    assert_eq!(names, [Some("wide"), Some("tall"), None]);
    let wide = &scene.cameras[0];
    assert_eq!(wide.world_from_camera.point(DVec3::new(0.5, 0.25, 2.0)), DVec3::new(1.5, 2.25, 1.0));
    let fov = |i: usize| match scene.cameras[i].kind {
        CameraKind::Perspective { fov, .. } => fov.to_radians(),
        _ => panic!("a perspective camera is expected"),
    };
    assert!((fov(0) - 0.8).abs() < 1e-9);
    assert!(((0.5 * fov(1)).tan() - 0.5 * 0.4_f64.tan()).abs() < 1e-9);
    assert_eq!(scene.cameras[2].screen_window, Some([-3.0, 3.0, -2.0, 2.0]));
    let (width, height) = (scene.film.width.unwrap(), scene.film.height.unwrap());
    assert!((f64::from(width) / f64::from(height) - 2.0).abs() < 0.01);
}

#[test]
fn lights_that_animations_move_are_seen_moving() {
    // A lamp that goes 8 along x from 1 s to 3 s, and a sun that turns by a quarter about z meanwhile, from +x to +y.
    let mut parts = Parts::default();
    let times = parts.add(&floats(&[1.0, 3.0]), r#""componentType":5126,"type":"SCALAR","count":2"#);
    let moves = parts
        .add(&floats(&[2.0, 3.0, 4.0, 10.0, 3.0, 4.0]), r#""componentType":5126,"type":"VEC3","count":2"#);
    // -z turned to -x, and that about z.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = parts.add(
        &floats(&[0.0, half, 0.0, half, -0.5, 0.5, 0.5, 0.5]),
        r#""componentType":5126,"type":"VEC4","count":2"#,
    );
    let rest = format!(
        r#""extensionsUsed":["KHR_lights_punctual"],"extensions":{{"KHR_lights_punctual":{{"lights":[
            {{"type":"point","intensity":8}},{{"type":"directional","intensity":3}}]}}}},
        "nodes":[{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
            {{"extensions":{{"KHR_lights_punctual":{{"light":1}}}}}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{moves}}},{{"input":{times},"output":{turns}}}],
            "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}},
                {{"sampler":1,"target":{{"node":1,"path":"rotation"}}}}]}}]"#
    );
    let bytes = glb(&parts.json(&rest), &parts.binary);
    let read = |shutter| {
        let mut diagnostics = Diagnostics::new();
        let options = changed(GltfOptions::default(), |it| {
            it.frame = Some(2.0);
            it.shutter = shutter;
        });
        let scene = read_with(&bytes, &options, &mut diagnostics).unwrap();
        assert_eq!(diagnostics.lines(), [""; 0]);
        Scene::build(scene).unwrap()
    };
    assert!(!read(0.0).moves());
    let scene = read(1.0);
    assert!(scene.moves());
    // Besides, there is the light of the studio.
    let [lamp, sun, ..] = scene.lights() else { panic!("two lights are expected") };
    for part in [0.0, 0.25, 0.5, 1.0] {
        let share = 0.25 + 0.5 * part;
        // 2 above the floor, 1 to the side of the lamp.
        let floor = DVec3::new(2.0 + 8.0 * share, 4.0, 2.0);
        let found = lamp.irradiance(floor, part, DVec3::Z).unwrap().g;
        let expected = 8.0 * 2.0 / 5.0_f64.powf(1.5);
        assert!((f64::from(found) / expected - 1.0).abs() < 1e-5, "{part}: {found}, {expected}");
        let angle = 0.5 * std::f64::consts::PI * share;
        let found = sun.irradiance(floor, part, DVec3::new(angle.cos(), angle.sin(), 0.0)).unwrap().g;
        // Between the moments that are looked at it turns as evenly.
        assert!((found / 3.0 - 1.0).abs() < 1e-4, "{part}: {found}");
        assert_eq!((lamp.name(), sun.name()), ("point", "distant"));
        assert!(lamp.is_delta() && sun.is_delta());
        // Chosen and asked at the time, a sample comes from where the lamp is then.
        let samples = [0.1, 0.4, 0.7, 0.95]
            .map(|choose| scene.sample_light(floor, DVec3::ZERO, part, choose, DVec2::splat(0.5)));
        let ends: Vec<DVec3> =
            samples.into_iter().flatten().filter_map(|sample| Some(sample.end?.point)).collect();
        assert!(!ends.is_empty());
        assert!(
            ends.iter().all(|end| (*end - floor - DVec3::new(0.0, -1.0, 2.0)).length() < 1e-5),
            "{ends:?}"
        );
    }
}

#[test]
fn punctual_lights_keep_their_candelas_and_lux() {
    let json = r#"{"asset":{"version":"2.0"},"extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[
        {"type":"point","color":[1,0.5,0.25],"intensity":40},{"type":"directional","intensity":3},
        {"type":"spot","intensity":7,"spot":{"innerConeAngle":0.2,"outerConeAngle":0.5}}]}},
        "nodes":[{"translation":[1,2,3],"extensions":{"KHR_lights_punctual":{"light":0}}},
            {"rotation":[0.7071067811865476,0,0,0.7071067811865476],"extensions":{"KHR_lights_punctual":{"light":1}}},
            {"translation":[4,5,6],"scale":[2,2,2],"extensions":{"KHR_lights_punctual":{"light":2}}}]}"#;
    let scene = read_with(json.as_bytes(), &GltfOptions::default(), &mut Diagnostics::new()).unwrap();
    let [
        LightDesc::Point { from, intensity },
        LightDesc::Distant { towards, irradiance },
        LightDesc::Spot { world_from_light, intensity: spot, cone_angle, cone_delta_angle },
    ] = &scene.lights[..]
    else {
        panic!("{:?}", scene.lights)
    };
    assert_eq!((*from, *intensity), (DVec3::new(1.0, 2.0, 3.0), Rgb::new(40.0, 20.0, 10.0)));
    // -z turned about x by a quarter points to +y: light comes from below.
    assert!(
        (*towards - DVec3::new(0.0, -1.0, 0.0)).length() < 1e-9 && *irradiance == Rgb::splat(3.0),
        "{towards}"
    );
    assert_eq!(*spot, Rgb::splat(7.0));
    assert_eq!(world_from_light.vector(DVec3::Z), DVec3::new(0.0, 0.0, -1.0));
    assert!(
        (cone_angle - 0.5_f32.to_degrees()).abs() < 1e-4
            && (cone_delta_angle - 0.3_f32.to_degrees()).abs() < 1e-4
    );
    Scene::build(scene).unwrap();
}

/// A place to look textures up at.
fn place(colour: Rgb) -> TextureContext {
    TextureContext {
        point: DVec3::ONE,
        normal: Vec3::Z,
        uv: Vec2::new(0.3, 0.6),
        dpdx: Vec3::ZERO,
        dpdy: Vec3::ZERO,
        duv_dx: Vec2::ZERO,
        duv_dy: Vec2::ZERO,
        vertex: VertexData { colour, ..VertexData::NONE },
        spectral: None,
    }
}

/// A scene of one square of a material, with an image whose bytes are 51, 102 and 204 at every place.
fn dressed(material: &str) -> (SceneDesc, Diagnostics) {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let uv = parts.add(&floats(&[0.0; 8]), r#""componentType":5126,"type":"VEC2","count":4"#);
    let image = picture([51, 102, 204], image::ImageFormat::Png);
    let start = parts.binary.len();
    parts.binary.extend_from_slice(&image);
    parts.views.push(format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{}}}"#, image.len()));
    let view = parts.views.len() - 1;
    let one = one(&format!(r#""mode":6,"material":0,"attributes":{{"POSITION":{p},"TEXCOORD_0":{uv}}}"#));
    let rest = format!(
        r#""images":[{{"bufferView":{view},"mimeType":"image/png"}}],"textures":[{{"source":0}}],"materials":[{material}],{one}"#
    );
    let mut diagnostics = Diagnostics::new();
    let scene = read_with(&glb(&parts.json(&rest), &parts.binary), &GltfOptions::default(), &mut diagnostics);
    (scene.unwrap(), diagnostics)
}

fn principled(material: &str) -> PrincipledParams {
    let (scene, diagnostics) = dressed(material);
    assert_eq!(diagnostics.warnings(), 0, "{material}: {:?}", diagnostics.lines());
    let MaterialKind::Principled(params) = scene.materials[0].material.kind.clone() else {
        panic!("{material}: {:?}", scene.materials[0].material.kind)
    };
    Scene::build(scene).unwrap();
    *params
}

/// A scene of one square with this many sets of texture coordinates, all different, and a material whose textures go by
/// some: base colour, roughness, normals, transmission and clearcoat.
fn with_sets(count: usize, named: [usize; 5]) -> (SceneDesc, Vec<String>) {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let mut attributes = format!(r#""POSITION":{p}"#);
    for set in 0..count {
        let at = |i: u8| 0.1 * set as f32 + 0.25 * f32::from(i);
        let uvs: Vec<f32> = (0..8).map(at).collect();
        let accessor = parts.add(&floats(&uvs), r#""componentType":5126,"type":"VEC2","count":4"#);
        attributes += &format!(r#","TEXCOORD_{set}":{accessor}"#);
    }
    let image = picture([51, 102, 204], image::ImageFormat::Png);
    let start = parts.binary.len();
    parts.binary.extend_from_slice(&image);
    parts.views.push(format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{}}}"#, image.len()));
    let view = parts.views.len() - 1;
    let [base, rough, normals, clear, coat] = named.map(|set| format!(r#"{{"index":0,"texCoord":{set}}}"#));
    let rest = format!(
        r#""images":[{{"bufferView":{view},"mimeType":"image/png"}}],"textures":[{{"source":0}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{base},"metallicRoughnessTexture":{rough}}},
        "normalTexture":{normals},
        "extensions":{{"KHR_materials_transmission":{{"transmissionFactor":0.5,"transmissionTexture":{clear}}},
        "KHR_materials_clearcoat":{{"clearcoatFactor":1,"clearcoatTexture":{coat}}}}}}}],{}"#,
        one(&format!(r#""mode":6,"material":0,"attributes":{{{attributes}}}"#)),
    );
    let mut diagnostics = Diagnostics::new();
    let scene = read_with(&glb(&parts.json(&rest), &parts.binary), &GltfOptions::default(), &mut diagnostics);
    (scene.unwrap(), diagnostics.lines())
}

/// Of the third vertex of [`with_sets`], wherever the tangents left it: its coordinates in a set of the mesh.
fn of_third_vertex(mesh: &MeshDesc, uvs: &[Vec2]) -> Vec2 {
    uvs[mesh.positions.iter().position(|p| p.to_array() == SQUARE[2]).unwrap()]
}

/// The same, as the file has them in one of its sets; v counts upwards here.
fn in_the_file(set: usize) -> Vec2 {
    let at = |i: usize| 0.1 * set as f32 + 0.25 * i as f32;
    Vec2::new(at(4), 1.0 - at(5))
}

/// Which set of its mesh a texture is looked up in.
fn set_of(texture: &FloatTexture) -> UvSet {
    let image = match texture {
        Texture::Image(image) => image,
        Texture::Product([image, _]) => match &**image {
            Texture::Image(image) => image,
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    };
    let Mapping2d::Affine { set, .. } = image.mapping else { panic!("{:?}", image.mapping) };
    set
}

#[test]
fn four_sets_of_texture_coordinates_serve_one_material() {
    let (scene, warnings) = with_sets(4, [0, 1, 2, 3, 3]);
    assert_eq!(warnings, [""; 0]);
    let mesh = mesh(&scene.shapes[0]);
    for (set, uvs) in std::iter::once(&mesh.uvs).chain(&mesh.further_uvs).enumerate() {
        let found = of_third_vertex(mesh, uvs.as_ref().unwrap());
        assert!((found - in_the_file(set)).length() < 1e-6, "{set}");
    }
    let MaterialKind::Principled(params) = scene.materials[0].material.kind.clone() else { panic!() };
    assert_eq!((set_of(&params.roughness), set_of(&params.transmission)), (UvSet::Second, UvSet::Fourth));
    let normal_map = scene.materials[0].material.normal_map.clone().unwrap();
    assert!(matches!(normal_map.mapping, Mapping2d::Affine { set: UvSet::Third, .. }));
    Scene::build(scene).unwrap();
    let (_, warnings) = with_sets(5, [0, 1, 2, 3, 4]);
    assert!(warnings.len() == 1 && warnings[0].contains("on a fifth set"), "{warnings:?}");
}

#[test]
fn texture_coordinate_sets_that_materials_use_are_kept() {
    // Two of eight, one of them the last, take the room of two.
    let (scene, warnings) = with_sets(8, [7, 3, 7, 3, 7]);
    assert_eq!(warnings, [""; 0]);
    let mesh = mesh(&scene.shapes[0]);
    let [Some(second), None, None] = &mesh.further_uvs else { panic!("{:?}", mesh.further_uvs) };
    for (uvs, set) in [(mesh.uvs.as_ref().unwrap(), 7), (second, 3)] {
        assert!((of_third_vertex(mesh, uvs) - in_the_file(set)).length() < 1e-6, "{set}");
    }
    let MaterialKind::Principled(params) = scene.materials[0].material.kind.clone() else { panic!() };
    assert_eq!((set_of(&params.roughness), set_of(&params.clearcoat)), (UvSet::Second, UvSet::First));
    Scene::build(scene).unwrap();
    // Four, in any order.
    let (scene, warnings) = with_sets(8, [6, 1, 4, 0, 4]);
    assert_eq!(warnings, [""; 0]);
    let MaterialKind::Principled(params) = scene.materials[0].material.kind.clone() else { panic!() };
    let found = [&params.transmission, &params.roughness, &params.clearcoat].map(|texture| set_of(texture));
    assert_eq!(found, [UvSet::Second, UvSet::Third, UvSet::Fourth]);
}

#[test]
fn one_accessor_may_be_two_attributes_but_two_need_a_stride() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let uv = parts.add(&floats(&[0.0; 16]), r#""componentType":5126,"type":"VEC2","count":4"#);
    let other =
        format!(r#"{{"bufferView":{uv},"byteOffset":32,"componentType":5126,"type":"VEC2","count":4}}"#);
    parts.accessors.push(other);
    let with = |second: usize| {
        let attributes = format!(r#""POSITION":{p},"TEXCOORD_0":{uv},"TEXCOORD_1":{second}"#);
        parts.json(&one(&format!(r#""mode":6,"attributes":{{{attributes}}}"#)))
    };
    assert_eq!(read(&with(uv), &parts.binary).shapes.len(), 1);
    assert!(
        error(&with(uv + 1), &parts.binary).contains("attributes share a buffer view that says no stride")
    );
}

#[test]
fn every_parameter_of_a_material_arrives() {
    let with = |name: &str, rest: &str| {
        principled(&format!(r#"{{"extensions":{{"KHR_materials_{name}":{{{rest}}}}}}}"#))
    };
    let number = |texture: &FloatTexture| texture.evaluate(&place(Rgb::WHITE));
    let colour = |texture: &SpectrumTexture| texture.evaluate(&place(Rgb::WHITE));
    let close = |a: f32, b: f32| (a - b).abs() < 1e-5;
    // The image on the sRGB curve, and as it is.
    let srgb = Rgb::new(0.033_104_77, 0.132_868_33, 0.603_827_36);
    let near = |a: Rgb, b: Rgb| (a - b).map(f32::abs).max_component() < 1e-4;

    let plain = principled("{}");
    assert_eq!((number(&plain.metallic), number(&plain.roughness), plain.ior), (1.0, 1.0, 1.5));
    assert!(plain.volume.is_none() && number(&plain.transmission) == 0.0);
    let core = principled(
        r#"{"pbrMetallicRoughness":{"baseColorFactor":[0.5,1,0.25,1],"baseColorTexture":{"index":0},"metallicFactor":0.5,
        "roughnessFactor":0.25,"metallicRoughnessTexture":{"index":0}}}"#,
    );
    assert!(near(colour(&core.base_color), srgb * Rgb::new(0.5, 1.0, 0.25)));
    assert!(close(number(&core.metallic), 0.4) && close(number(&core.roughness), 0.1));

    let specular = with(
        "specular",
        r#""specularFactor":0.5,"specularColorFactor":[2,1,0.5],"specularColorTexture":{"index":0}"#,
    );
    assert!(close(number(&specular.specular), 0.5));
    assert!(near(colour(&specular.specular_color), srgb * Rgb::new(2.0, 1.0, 0.5)));
    assert_eq!(with("ior", r#""ior":1.7"#).ior, 1.7);
    let clear = with("transmission", r#""transmissionFactor":0.5,"transmissionTexture":{"index":0}"#);
    assert!(close(number(&clear.transmission), 0.1) && clear.volume.is_none());
    let volume =
        with("volume", r#""thicknessFactor":2,"attenuationDistance":3,"attenuationColor":[0.5,0.25,1]"#);
    let inside = volume.volume.unwrap();
    assert_eq!((inside.attenuation_distance, inside.attenuation_color), (3.0, Rgb::new(0.5, 0.25, 1.0)));
    assert_eq!(with("dispersion", r#""dispersion":0.4"#).dispersion, 0.4);
    let through = with(
        "diffuse_transmission",
        r#""diffuseTransmissionFactor":0.25,"diffuseTransmissionColorFactor":[0.5,1,1],"diffuseTransmissionColorTexture":{"index":0}"#,
    );
    assert_eq!(number(&through.diffuse_transmission), 0.25);
    assert!(near(colour(&through.diffuse_transmission_color), srgb * Rgb::new(0.5, 1.0, 1.0)));
    let coat = with(
        "clearcoat",
        r#""clearcoatFactor":0.5,"clearcoatTexture":{"index":0},"clearcoatRoughnessFactor":0.5,
        "clearcoatRoughnessTexture":{"index":0},"clearcoatNormalTexture":{"index":0,"scale":0.5}"#,
    );
    assert!(close(number(&coat.clearcoat), 0.1) && close(number(&coat.clearcoat_roughness), 0.2));
    assert!(coat.clearcoat_normal.is_some());
    let sheen = with("sheen", r#""sheenColorFactor":[1,0.5,0],"sheenRoughnessFactor":0.5"#);
    assert_eq!((colour(&sheen.sheen_color), number(&sheen.sheen_roughness)), (Rgb::new(1.0, 0.5, 0.0), 0.5));
    let film = with(
        "iridescence",
        r#""iridescenceFactor":0.5,"iridescenceTexture":{"index":0},"iridescenceIor":1.6,"iridescenceThicknessMinimum":200,
        "iridescenceThicknessMaximum":700,"iridescenceThicknessTexture":{"index":0}"#,
    );
    assert!(close(number(&film.iridescence), 0.1) && film.iridescence_ior == 1.6);
    assert!((number(&film.iridescence_thickness) - 400.0).abs() < 0.1);
    assert_eq!(number(&with("iridescence", r#""iridescenceFactor":1"#).iridescence_thickness), 400.0);
    let brushed = with(
        "anisotropy",
        r#""anisotropyStrength":0.6,"anisotropyRotation":1.5,"anisotropyTexture":{"index":0}"#,
    );
    assert_eq!((number(&brushed.anisotropy), brushed.anisotropy_rotation), (0.6, 1.5));
    assert!(near(colour(brushed.anisotropy_texture.as_ref().unwrap()), Rgb::new(0.2, 0.4, 0.8)));
    let older = with(
        "pbrSpecularGlossiness",
        r#""diffuseFactor":[0.5,0.25,1,1],"specularFactor":[0.9,0.5,0.25],"glossinessFactor":0.75"#,
    );
    assert_eq!(
        (colour(&older.base_color), colour(&older.specular_color)),
        (Rgb::new(0.5, 0.25, 1.0), Rgb::new(0.9, 0.5, 0.25))
    );
    assert_eq!((number(&older.roughness), number(&older.metallic), older.ior), (0.25, 0.0, 0.0));
}

#[test]
fn unlit_shines_and_solids_scatter_inside() {
    let (scene, _) = dressed(
        r#"{"extensions":{"KHR_materials_unlit":{}},"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,1]}}"#,
    );
    assert_eq!(scene.materials[0].material.kind.name(), "diffuse");
    let light = scene.shapes[0].area_light.as_ref().unwrap();
    assert!(light.radiance == Rgb::new(0.5, 0.25, 1.0) && light.two_sided);
    let volume = r#"{"extensions":{"KHR_materials_transmission":{"transmissionFactor":1},
        "KHR_materials_volume":{"thicknessFactor":1,"attenuationDistance":2,"attenuationColor":[0.5,0.5,0.5]},
        "KHR_materials_volume_scatter":{"multiscatterColor":[0.5,0.5,0.5],"scatterAnisotropy":0.25}}}"#;
    let (scene, _) = dressed(volume);
    let MaterialKind::Principled(params) = &scene.materials[0].material.kind else { panic!() };
    let medium = params.interior_medium(None).unwrap();
    assert!(medium.albedo.r > 0.7 && medium.asymmetry == 0.25, "{medium:?}");
}

#[test]
fn missing_tangents_are_made_and_given_ones_are_kept() {
    let material = r#""images":[{"uri":"data:image/png;base64,iVBORw0KGgo="}],"textures":[{"source":0}]"#;
    let square = |attributes: &[&str], material: &str| {
        let mut parts = Parts::default();
        let p = parts.positions(&SQUARE);
        // u runs along x, v (counted downwards) along y: the image is seen mirrored.
        let uv = parts.add(
            &floats(&[1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0].map(|c: f32| 1.0 - c)),
            r#""componentType":5126,"type":"VEC2","count":4"#,
        );
        let mirrored = parts.add(
            &floats(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]),
            r#""componentType":5126,"type":"VEC2","count":4"#,
        );
        let n =
            parts.add(&floats(&[0.0, 0.0, 1.0].repeat(4)), r#""componentType":5126,"type":"VEC3","count":4"#);
        let t = parts.add(
            &floats(&[0.6, 0.8, 0.0, -1.0].repeat(4)),
            r#""componentType":5126,"type":"VEC4","count":4"#,
        );
        let mut list = format!(r#""POSITION":{p}"#);
        for name in attributes {
            let index = match *name {
                "TEXCOORD_0" => uv,
                "TEXCOORD_1" => mirrored,
                "NORMAL" => n,
                _ => t,
            };
            list += &format!(r#","{name}":{index}"#);
        }
        let one = one(&format!(r#""mode":6,"material":0,"attributes":{{{list}}}"#));
        let mut said = Diagnostics::with_strictness(Strictness::Lenient);
        let json = parts.json(&format!(r#"{material},{one}"#));
        read_with(&glb(&json, &parts.binary), &GltfOptions::default(), &mut said).unwrap()
    };
    let tangents = |scene: &SceneDesc| mesh(&scene.shapes[0]).tangents.clone();
    let near = |list: Option<Vec<Vec4>>, count: usize, expected: Vec4| {
        let list = list.unwrap();
        assert_eq!(list.len(), count);
        assert!(list.iter().all(|t| (*t - expected).length() < 1e-5), "{list:?} {expected}");
    };
    let mapped = |set: usize| {
        format!(r#"{material},"materials":[{{"normalTexture":{{"index":0,"texCoord":{set}}}}}]"#)
    };
    let scene = square(&["TEXCOORD_0", "NORMAL"], &mapped(0));
    near(tangents(&scene), 4, Vec4::new(1.0, 0.0, 0.0, -1.0));
    let scene = square(&["TEXCOORD_0", "TEXCOORD_1", "NORMAL"], &mapped(1));
    near(tangents(&scene), 4, Vec4::new(0.0, 1.0, 0.0, 1.0));
    // Flat, each triangle with its own vertices.
    let scene = square(&["TEXCOORD_0"], &mapped(0));
    near(tangents(&scene), 6, Vec4::new(1.0, 0.0, 0.0, -1.0));
    let scene = square(&["TEXCOORD_0", "NORMAL", "TANGENT"], &mapped(0));
    near(tangents(&scene), 4, Vec4::new(0.6, 0.8, 0.0, -1.0));
    let brushed = r#""materials":[{"extensions":{"KHR_materials_anisotropy":{"anisotropyStrength":0.5}}}]"#;
    near(tangents(&square(&["TEXCOORD_0", "NORMAL"], brushed)), 4, Vec4::new(1.0, 0.0, 0.0, -1.0));
    assert_eq!(tangents(&square(&["NORMAL"], brushed)), None);
    assert_eq!(tangents(&square(&["TEXCOORD_0", "NORMAL"], r#""materials":[{}]"#)), None);
}

#[test]
fn coverage_is_by_mode_and_light_by_strength() {
    let with = |material: &str| {
        let mut parts = Parts::default();
        let p = parts.positions(&SQUARE);
        let c = parts.add(
            &[10, 20, 30, 128].repeat(4),
            r#""componentType":5121,"normalized":true,"type":"VEC4","count":4"#,
        );
        let one = one(&format!(r#""mode":6,"material":0,"attributes":{{"POSITION":{p},"COLOR_0":{c}}}"#));
        parts.read(&format!(r#""materials":[{material}],{one}"#)).shapes[0].clone()
    };
    let at = TextureContext {
        point: DVec3::ONE,
        normal: Vec3::Z,
        uv: Vec2::ZERO,
        dpdx: Vec3::ZERO,
        dpdy: Vec3::ZERO,
        duv_dx: Vec2::ZERO,
        duv_dy: Vec2::ZERO,
        vertex: VertexData { coverage: 128.0 / 255.0, ..VertexData::NONE },
        spectral: None,
    };
    let coverage = |material: &str| with(material).alpha.map(|alpha| alpha.evaluate(&at));
    let colour = r#""pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0.5]}"#;
    assert_eq!(coverage(&format!(r#"{{{colour}}}"#)), None);
    assert!((coverage(&format!(r#"{{{colour},"alphaMode":"BLEND"}}"#)).unwrap() - 64.0 / 255.0).abs() < 1e-6);
    assert_eq!(coverage(&format!(r#"{{{colour},"alphaMode":"MASK"}}"#)), Some(0.0));
    assert_eq!(coverage(&format!(r#"{{{colour},"alphaMode":"MASK","alphaCutoff":0.25}}"#)), Some(1.0));
    let light = with(
        r#"{"emissiveFactor":[1,0.5,0],"doubleSided":true,"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":6}}}"#,
    );
    let light = light.area_light.unwrap();
    assert!(light.radiance == Rgb::new(6.0, 3.0, 0.0) && light.two_sided);
    let shape = with("{}");
    let colours = mesh(&shape).colours.as_ref().unwrap();
    assert!((colours[2].g - 20.0 / 255.0).abs() < 1e-6 && mesh(&shape).coverages.is_some());
}

#[test]
fn what_is_invisible_everywhere_does_not_shine() {
    let is_emissive = |alpha: f32, rest: &str| {
        let colour = format!(r#""pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,{alpha}]}}"#);
        let (scene, _) = dressed(&format!(r#"{{{colour},"emissiveFactor":[1,1,1]{rest}}}"#));
        scene.shapes[0].area_light.is_some()
    };
    let unlit = r#","extensions":{"KHR_materials_unlit":{}}"#;
    for more in ["", unlit] {
        // Without a mode, alpha is not used.
        assert!(is_emissive(0.0, more) && is_emissive(0.75, &format!(r#","alphaMode":"BLEND"{more}"#)));
        assert!(!is_emissive(0.0, &format!(r#","alphaMode":"BLEND"{more}"#)));
        assert!(!is_emissive(0.0, &format!(r#","alphaMode":"MASK"{more}"#)));
        assert!(!is_emissive(0.75, &format!(r#","alphaMode":"MASK","alphaCutoff":0.8{more}"#)));
        assert!(is_emissive(0.75, &format!(r#","alphaMode":"MASK","alphaCutoff":0.7{more}"#)));
    }
    let textured = r#""pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0],"baseColorTexture":{"index":0}}"#;
    for mode in ["MASK", "BLEND"] {
        let (scene, _) = dressed(&format!(r#"{{{textured},"emissiveFactor":[1,1,1],"alphaMode":"{mode}"}}"#));
        assert!(scene.shapes[0].area_light.is_none(), "{mode}");
    }
}

#[test]
fn variants_are_worn_by_name() {
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let rest = format!(
        r#""extensionsUsed":["KHR_materials_variants"],"extensions":{{"KHR_materials_variants":{{"variants":[{{"name":"red"}},{{"name":"blue"}}]}}}},
        "materials":[{{"name":"plain"}},{{"name":"r"}},{{"name":"b"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}},"material":0,"extensions":{{"KHR_materials_variants":
            {{"mappings":[{{"material":1,"variants":[0]}},{{"material":2,"variants":[1]}}]}}}}}}]}}],"nodes":[{{"mesh":0}}]"#
    );
    let file = glb(&parts.json(&rest), &parts.binary);
    for (variant, material) in [(None, "plain"), (Some("red"), "r"), (Some("blue"), "b")] {
        let options = changed(GltfOptions::default(), |it| it.variant = variant.map(str::to_owned));
        let scene = read_with(&file, &options, &mut Diagnostics::new()).unwrap();
        assert_eq!(scene.materials[0].name.as_deref(), Some(material));
    }
    let options = changed(GltfOptions::default(), |it| it.variant = Some("bleu".to_owned()));
    let error = read_with(&file, &options, &mut Diagnostics::new()).unwrap_err().to_string();
    assert_eq!(
        error,
        "m.gltf: no such material variant (found \"bleu\"; expected \"red\", \"blue\"; did you mean \"blue\"?)"
    );
}

#[test]
fn files_are_found_by_escaped_and_foreign_names() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a b ü%.bin"), floats(SQUARE.as_flattened())).unwrap();
    for uri in ["a%20b%20%C3%BC%25.bin", "a b ü%25.bin", "./a b \\u00fc%.bin"] {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":48,"uri":"{uri}"}}],"bufferViews":[{{"buffer":0,"byteLength":48}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":4,"min":[0,0,0],"max":[9,9,9]}}],{}}}"#,
            one(r#""mode":6,"attributes":{"POSITION":0}"#)
        );
        let path = dir.path().join("m.gltf");
        std::fs::write(&path, json).unwrap();
        let (scene, _) = lumbre_formats::open_scene(&path, &Default::default()).unwrap();
        assert_eq!(mesh(&scene.shapes[0]).positions.len(), 4, "{uri}");
    }
}

#[test]
fn vertices_that_no_one_uses_are_left_out() {
    let mut parts = Parts::default();
    let many: Vec<[f32; 3]> = (0..5000).map(|i| [i as f32, (i % 7) as f32, 0.5]).collect();
    let (p, i) = (parts.positions(&many), parts.indices(&[4000, 17, 3000]));
    let scene = parts.read(&one(&format!(r#""indices":{i},"attributes":{{"POSITION":{p}}}"#)));
    let mesh = mesh(&scene.shapes[0]);
    assert_eq!(mesh.positions, [4000, 17, 3000].map(|i: usize| Vec3::from_array(many[i])));
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn compressed_buffer_views_are_unpacked() {
    // Eight triangles over nine vertices, by meshoptimizer.
    let packed: Vec<u8> = [
        0xE1, 0xFE, 0x1E, 0x10, 0x0E, 0x4E, 0x1E, 0x12, 0x0E, 0x0F, 0x06, 0x00, 0x76, 0x87, 0x56, 0x67, 0x78,
        0xA9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0x00, 0x00,
    ]
    .into();
    let mut parts = Parts::default();
    let grid: Vec<[f32; 3]> = (0..9).map(|i| [(i % 3) as f32, (i / 3) as f32, 0.25]).collect();
    let p = parts.positions(&grid);
    parts.add(&packed, r#""componentType":5123,"type":"SCALAR","count":24"#);
    let (at, length) = (parts.binary.len() - packed.len(), packed.len());
    // The buffer that it stands in for has no data.
    parts.views[1] = format!(
        r#"{{"buffer":1,"byteLength":48,"extensions":{{"EXT_meshopt_compression":{{"buffer":0,"byteOffset":{at},
            "byteLength":{length},"byteStride":2,"count":24,"mode":"TRIANGLES"}}}}}}"#
    );
    let rest = one(&format!(r#""indices":1,"attributes":{{"POSITION":{p}}}"#));
    let used =
        r#""extensionsUsed":["EXT_meshopt_compression"],"extensionsRequired":["EXT_meshopt_compression"]"#;
    let json = parts.json(&format!("{rest},{used}")).replacen(
        "}],\"bufferViews\"",
        "},{\"byteLength\":48}],\"bufferViews\"",
        1,
    );
    let scene = read(&json, &parts.binary);
    let triangles = &mesh(&scene.shapes[0]).triangles;
    assert_eq!(triangles.len(), 8);
    assert_eq!(triangles[..3], [[0, 1, 3], [3, 1, 4], [4, 1, 2]]);
    for (from, to, expected) in [
        ("\"TRIANGLES\"", "\"TRIANGLE\"", "/EXT_meshopt_compression/mode: unknown mode of compression"),
        (
            "\"count\":24,\"mode\"",
            "\"count\":2400000000,\"mode\"",
            "/EXT_meshopt_compression/count: wrong count of compressed elements",
        ),
        ("\"byteStride\":2", "\"byteStride\":3", "/EXT_meshopt_compression/byteStride: wrong stride"),
        ("\"TRIANGLES\"", "\"INDICES\"", "/EXT_meshopt_compression: damaged compressed data (found a header"),
    ] {
        let found = error(&json.replacen(from, to, 1), &parts.binary);
        assert!(found.contains(expected), "{found}");
    }
}

/// A picture of one colour as an image file.
fn picture(colour: [u8; 3], format: image::ImageFormat) -> Vec<u8> {
    let mut file = std::io::Cursor::new(vec![]);
    image::RgbImage::from_pixel(5, 3, image::Rgb(colour)).write_to(&mut file, format).unwrap();
    file.into_inner()
}

#[test]
fn an_image_of_an_extension_goes_before_the_plain_one() {
    let red = picture([255, 0, 0], image::ImageFormat::Png);
    let blue = picture([0, 0, 255], image::ImageFormat::WebP);
    let mut parts = Parts::default();
    let p = parts.positions(&SQUARE);
    let uv = parts.add(&floats(&[0.0; 8]), r#""componentType":5126,"type":"VEC2","count":4"#);
    for image in [&red, &blue] {
        parts.add(image, r#""componentType":5121,"type":"SCALAR","count":5"#);
    }
    let rest = one(&format!(r#""material":0,"mode":6,"attributes":{{"POSITION":{p},"TEXCOORD_0":{uv}}}"#));
    let rest = format!(
        r#"{rest},"images":[{{"bufferView":2,"mimeType":"image/png"}},{{"bufferView":3,"mimeType":"image/webp"}}],
        "textures":[{{"source":0,"extensions":{{"EXT_texture_webp":{{"source":1}}}}}}],"extensionsUsed":["EXT_texture_webp"],
        "materials":[{{"emissiveFactor":[1,1,1],"emissiveTexture":{{"index":0}}}}]"#
    );
    let scene = parts.read(&rest);
    let light = scene.shapes[0].area_light.as_ref().unwrap();
    let bitmap = light.image.as_ref().unwrap().bitmap();
    assert_eq!((bitmap.width(), bitmap.height(), bitmap.rgb(2, 1)), (5, 3, Rgb::new(0.0, 0.0, 1.0)));
    let plain = parts.read(&rest.replace(r#","extensions":{"EXT_texture_webp":{"source":1}}"#, ""));
    let light = plain.shapes[0].area_light.as_ref().unwrap();
    assert_eq!(light.image.as_ref().unwrap().bitmap().rgb(2, 1), Rgb::new(1.0, 0.0, 0.0));
}

/// A file in which much can go wrong.
fn rich() -> (String, Vec<u8>) {
    let (mut parts, rest) = animated();
    parts.accessors.push(
        r#"{"componentType":5126,"type":"VEC3","count":4,"sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":0}}}"#
            .to_owned(),
    );
    let rest = rest.replacen(r#""mode":6,"#, r#""mode":6,"material":0,"#, 1);
    let json = parts.json(&format!(
        r#"{rest},"materials":[{{"alphaMode":"MASK","alphaCutoff":0.5,"pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,1],"roughnessFactor":0.5}}}}],
        "scenes":[{{"nodes":[0,1,3,4]}}],"scene":0,"samplers":[{{"wrapS":10497}}],"textures":[{{"sampler":0}}],
        "extensionsUsed":["KHR_lights_punctual"],"extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":2}}]}}}}"#
    ));
    (json, parts.binary)
}

#[test]
fn broken_files_are_refused_with_a_pointer_and_a_reason() {
    let (json, binary) = rich();
    read(&json, &binary);
    let length = binary.len();
    let cases: Vec<(String, &str, &str)> = [
        (r#""version":"2.0""#, r#""version":"1.0""#, r#"/asset/version: unsupported version of glTF (found "1.0"; expected "2.0")"#),
        (r#""version":"2.0""#, r#""version":2.0"#, "/asset/version: wrong type (found 2.0; expected a string)"),
        (r#""version":"2.0""#, r#""version":"2.0","minVersion":"2.1""#, "/asset/minVersion: unsupported version"),
        (r#""asset":{"version":"2.0"},"#, "", r#""asset" is missing"#),
        (r#""buffer":0,"byteOffset":0"#, r#""buffer":7,"byteOffset":0"#, "/bufferViews/0/buffer: there is no buffer 7 (expected 0)"),
        (r#""buffer":0,"byteOffset":0"#, r#""buffer":-1,"byteOffset":0"#, "/bufferViews/0/buffer: wrong number (found -1; expected a whole number, 0 or more)"),
        (r#""buffer":0,"byteOffset":0"#, r#""buffer":0,"byteOffset":18446744073709551615"#, "/bufferViews/0/byteOffset: wrong number"),
        (r#""buffer":0,"byteOffset":0"#, r#""buffer":0,"byteOffset":9007199254740991"#, "/bufferViews/0/byteOffset: buffer view past the end of its buffer"),
        (r#""byteOffset":0,"byteLength":48"#, r#""byteOffset":0,"byteLength":99999"#, "/bufferViews/0/byteLength: buffer view past the end of its buffer (found 99999 bytes from byte 0"),
        (r#""byteOffset":0,"byteLength":48"#, r#""byteOffset":0,"byteLength":0"#, "/accessors/0/count: accessor past the end of its buffer view (found 4 elements, which need 48 bytes; expected 0 bytes at most)"),
        (r#""byteOffset":0,"byteLength":48"#, r#""byteOffset":0,"byteLength":48,"byteStride":6"#, "/bufferViews/0/byteStride: wrong stride (found 6"),
        (r#""byteOffset":0,"byteLength":48"#, r#""byteOffset":0,"byteLength":48,"byteStride":8"#, "/accessors/0: stride shorter than an element (found 8; expected 12 or more)"),
        (r#""type":"VEC3","count":4,"min""#, r#""type":"VEC3","count":5,"min""#, "/accessors/0/count: accessor past the end of its buffer view (found 5 elements, which need 60 bytes; expected 48 bytes at most)"),
        (r#""type":"VEC3","count":4,"min""#, r#""type":"VEC3","count":4000000000,"min""#, "/accessors/0/count: accessor past the end"),
        (r#""type":"VEC3","count":4,"min""#, r#""type":"VEC3","count":9007199254740991,"min""#, "/accessors/0/count: accessor past the end of its buffer view"),
        (r#""type":"VEC3","count":4,"min""#, r#""type":"VEC3","count":0,"min""#, "/accessors/0/count: wrong number (found 0"),
        (r#""type":"VEC3","count":4,"min""#, r#""type":"VEC3","count":1.5,"min""#, "/accessors/0/count: wrong number (found 1.5"),
        (r#""type":"VEC3","count":4,"min""#, r#""type":"VEC3","count":2,"min""#, "attributes of different lengths"),
        (r#""type":"VEC3","count":4,"min":[0,0,2]"#, r#""type":"VEC3","count":4,"min":[0,0]"#, "/accessors/0/min: bound of a wrong length (expected 3)"),
        (r#""type":"VEC3","count":4,"min":[0,0,2],"#, r#""type":"VEC3","count":4,"#, r#"/accessors/0: accessor of positions without "min" and "max""#),
        (r#"{"bufferView":0,"componentType":5126"#, r#"{"bufferView":0,"byteOffset":2,"componentType":5126"#, "/accessors/0/count: accessor past the end"),
        (r#"{"bufferView":0,"componentType":5126"#, r#"{"bufferView":0,"componentType":5125"#, "/meshes/0/primitives/0/attributes/POSITION: accessor of a wrong type (found VEC3 of unsigned integers; expected VEC3 of floats)"),
        (r#"{"bufferView":0,"componentType":5126"#, r#"{"bufferView":0,"componentType":5124"#, "/accessors/0/componentType: unknown type of number (found 5124"),
        (r#"{"componentType":5126,"type":"VEC3","count":4,"sparse":"#, r#"{"componentType":5126,"type":"VEC3","count":4000000000,"sparse":"#, "count: accessor without data has too many elements (found 4000000000"),
        (r#""sparse":{"count":1"#, r#""sparse":{"count":5"#, "/sparse/count: too many sparse elements (found 5; expected at most 4"),
        (r#""indices":{"bufferView":1,"componentType":5121}"#, r#""indices":{"bufferView":1,"byteOffset":16,"componentType":5121}"#, "/sparse/indices: accessor past the end"),
        (r#""indices":{"bufferView":1,"componentType":5121}"#, r#""indices":{"bufferView":1,"componentType":5126}"#, "/sparse/indices/componentType: wrong type of sparse indices"),
        (r#""POSITION":0"#, r#""POSITION":99"#, "/meshes/0/primitives/0/attributes/POSITION: there is no accessor 99"),
        (r#""POSITION":0"#, r#""POSITON":0"#, r#"/meshes/0/primitives/0/attributes/POSITON: unknown attribute (found "POSITON"; expected one of glTF's, or a name that starts with an underscore; did you mean "POSITION"?)"#),
        (r#""mode":6"#, r#""mode":7"#, "/meshes/0/primitives/0/mode: unknown mode of a primitive (found 7"),
        (r#""mode":6"#, r#""indices":0,"mode":6"#, "/meshes/0/primitives/0/indices: accessor of a wrong type"),
        (r#""weights":[0.5]"#, r#""weights":[0.5,1]"#, "/meshes/0/weights: as many weights as morph targets are needed (found 2; expected 1)"),
        (r#""WEIGHTS_0":2"#, r#""WEIGHTS_1":2"#, "/meshes/0/primitives/0/attributes: WEIGHTS_0 is missing"),
        (r#""joints":[1,2]"#, r#""joints":[1,9]"#, "/skins/0/joints/1: there is no node 9"),
        (r#""joints":[1,2]"#, r#""joints":[1]"#, "/accessors/1: joint that the skin does not have (found 1 at vertex 1; expected 0 to 0)"),
        (r#""joints":[1,2]"#, r#""joints":[1,2],"inverseBindMatrices":0"#, "/skins/0/inverseBindMatrices: accessor of a wrong type"),
        (r#""children":[2]"#, r#""children":[1]"#, "/nodes/1: node inside itself (found nodes 1 > 1)"),
        (r#"{"children":[2]},{"#, r#"{"children":[2]},{"children":[1],"#, "node inside itself (found nodes"),
        (r#"{"children":[2]},{"#, r#"{"children":[2,2]},{"#, "/nodes/1/children/1: node with two parents (found node 2, a child of 1 and of 1)"),
        (r#""translation":[0,0,0]"#, r#""translation":[0,0]"#, "/nodes/2/translation: wrong type (found an array; expected an array of 3 numbers)"),
        (r#""translation":[0,0,0]"#, r#""translation":[0,0,1e999]"#, "/nodes/2/translation/2: number too large (found 1e999; expected a finite number)"),
        (r#""translation":[0,0,0]"#, r#""rotation":[0,0,0,0]"#, "/nodes/2/rotation: rotation that is not a unit quaternion"),
        (r#""translation":[0,0,0]"#, r#""matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,2]"#, "/nodes/2/matrix: matrix that is not affine"),
        (r#""translation":[0,0,0]"#, r#""matrix":[1,0,0,0,1,1,0,0,0,0,1,0,0,0,0,1]"#, "/nodes/2/matrix: matrix that shears"),
        (r#""nodes":[0,1,3,4]"#, r#""nodes":[0,1,2]"#, "/scenes/0/nodes/2: scene with a node that hangs on another (found 2)"),
        (r#""nodes":[0,1,3,4]"#, r#""nodes":[0,1,0]"#, "/scenes/0/nodes/2: scene with the same node twice (found 0)"),
        (r#""scene":0"#, r#""scene":3"#, "/scene: there is no scene 3 (expected 0)"),
        (r#""yfov":0.7"#, r#""yfov":4"#, "/cameras/0/perspective/yfov: number out of range (found 4; expected a number from"),
        (r#""type":"perspective""#, r#""type":"perspektive""#, r#"/cameras/0/type: unknown kind of camera (found "perspektive"; did you mean "perspective"?)"#),
        (r#""path":"weights""#, r#""path":"wieghts""#, r#"/animations/0/channels/1/target/path: unknown target of an animation (found "wieghts"; did you mean "weights"?)"#),
        (r#""interpolation":"STEP""#, r#""interpolation":"STEPS""#, r#"/animations/0/samplers/1/interpolation: unknown interpolation (found "STEPS"; did you mean "STEP"?)"#),
        (r#""interpolation":"CUBICSPLINE""#, r#""interpolation":"LINEAR""#, "/animations/0/samplers/3/output: animation of a wrong length (found 6 elements; expected 2 times 1 times 1)"),
        (r#""sampler":1,"target""#, r#""sampler":8,"target""#, "/animations/0/channels/1/sampler: there is no sampler 8 (expected 0 to 3)"),
        (r#""alphaMode":"MASK""#, r#""alphaMode":"MASKS""#, r#"/materials/0/alphaMode: unknown alpha mode (found "MASKS"; did you mean "MASK"?)"#),
        (r#""baseColorFactor":[1,1,1,1]"#, r#""baseColorFactor":[1,1,2,1]"#, "/materials/0/pbrMetallicRoughness/baseColorFactor: number out of range"),
        (r#""roughnessFactor":0.5"#, r#""roughnessFactor":"0.5""#, r#"/materials/0/pbrMetallicRoughness/roughnessFactor: wrong type (found "0.5"; expected a number)"#),
        (r#""roughnessFactor":0.5"#, r#""baseColorTexture":{"index":0}"#, "/meshes/0/primitives/0: texture coordinates that the material needs are missing (found 0 sets; expected 1 sets)"),
        (r#""roughnessFactor":0.5"#, r#""baseColorTexture":{"index":5}"#, "/materials/0/pbrMetallicRoughness/baseColorTexture/index: there is no texture 5"),
        (r#""wrapS":10497"#, r#""wrapS":10498"#, "/samplers/0/wrapS: unknown way to wrap (found 10498"),
        (r#""extensionsUsed":["KHR_lights_punctual"]"#, r#""extensionsUsed":["KHR_x"],"extensionsRequired":["KHR_x"]"#, r#"/extensionsRequired/0: the file requires an extension that is not supported (found "KHR_x")"#),
        (r#""extensionsUsed":["KHR_lights_punctual"]"#, r#""extensionsRequired":["KHR_materials_ior"]"#, r#"required extension that "extensionsUsed" does not list"#),
        (r#""intensity":2"#, r#""intensity":-2"#, "/extensions/KHR_lights_punctual/lights/0/intensity: number out of range (found -2; expected 0 or more)"),
        (r#""scene":0"#, r#""scene":0,"scene":0"#, r#"/scene: second member of this name (found "scene")"#),
        (r#""scene":0"#, r#""scene":0,"images":[{"bufferView":0}]"#, r#"/images/0: image in a buffer view without a "mimeType""#),
        (r#""scene":0"#, r#""scene":0,"images":[]"#, "/images: empty list (expected one element or more, or no list)"),
    ]
    .into_iter()
    .map(|(from, to, expected)| {
        assert!(json.contains(from), "{from}");
        (json.replacen(from, to, 1), expected, to)
    })
    .collect();
    assert!(cases.len() >= 60);
    for (json, expected, change) in &cases {
        let found = error(json, &binary);
        assert!(found.contains(expected), "{change}\n  expected {expected}\n  found    {found}");
        assert!(found.starts_with("m.gltf:byte "), "{found}");
    }
    let said = format!(r#""byteLength":{length}}}],"bufferViews""#);
    let long = json.replacen(&said, r#""byteLength":100000}],"bufferViews""#, 1);
    let found = error(&long, &binary);
    assert!(found.contains("/buffers/0/byteLength: buffer longer than its data (found 100000"), "{found}");
}

#[test]
fn bad_indices_and_nan_numbers_give_warnings() {
    let mut parts = Parts::default();
    let mut square = SQUARE;
    square[3][1] = f32::NAN;
    let (p, i) = (parts.positions(&square), parts.indices(&[0, 1, 2, 2, 3, 0]));
    let rest = one(&format!(r#""indices":{i},"attributes":{{"POSITION":{p}}}"#));
    let json = parts.json(&rest);
    assert!(
        error(&json, &parts.binary)
            .contains("/accessors/0: vertex that is not finite (found [0, NaN, 2] as vertex 3")
    );
    let mut lenient = Diagnostics::with_strictness(Strictness::Lenient);
    let scene = read_with(&glb(&json, &parts.binary), &GltfOptions::default(), &mut lenient).unwrap();
    assert_eq!(mesh(&scene.shapes[0]).triangles, [[0, 1, 2]]);
    assert_eq!(lenient.warnings(), 1);

    let mut parts = Parts::default();
    let (p, i) = (parts.positions(&SQUARE), parts.indices(&[0, 1, 2, 2, 65535, 0]));
    let json = parts.json(&one(&format!(r#""indices":{i},"attributes":{{"POSITION":{p}}}"#)));
    let found = error(&json, &parts.binary);
    assert!(
        found.contains(
            "/accessors/1: index of a vertex that does not exist (found 65535 as index 4; expected 0 to 3)"
        ),
        "{found}"
    );
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let (json, binary) = rich();
    let whole = glb(&json, &binary);
    for cut in 0..whole.len() {
        let read = read_with(&whole[..cut], &GltfOptions::default(), &mut Diagnostics::new());
        assert!(read.is_err(), "{cut} of {} bytes", whole.len());
        // With a length in the header that fits, the cut is found inside.
        if cut >= 12 {
            let mut cut_file = whole[..cut].to_vec();
            cut_file[8..12].copy_from_slice(&(cut as u32).to_le_bytes());
            let read = read_with(&cut_file, &GltfOptions::default(), &mut Diagnostics::new());
            let all_of_json = cut == 20 + json.len().next_multiple_of(4);
            assert!(read.is_err(), "{cut} {all_of_json}");
        }
    }
}

#[test]
fn damaged_files_never_panic_and_cost_little() {
    let (json, binary) = rich();
    let whole = glb(&json, &binary);
    let mut random = Random(0x617F);
    let (mut errors, mut reads) = (0, 0);
    for round in 0..6000 {
        let mut file = whole.clone();
        for _ in 0..1 + random.below(3) {
            let at = random.below(file.len());
            match random.below(4) {
                0 => file[at] = random.next() as u8,
                1 => file[at] = b"0123456789-e.\"[]{},:"[random.below(20)],
                2 => file[at] ^= 1 << random.below(8),
                _ => {
                    let (from, length) = (random.below(file.len()), 1 + random.below(12));
                    let piece: Vec<u8> = file[from..(from + length).min(file.len())].to_vec();
                    let end = (at + piece.len()).min(file.len());
                    file[at..end].copy_from_slice(&piece[..end - at]);
                }
            }
        }
        let strictness = [Strictness::Normal, Strictness::Lenient][round % 2];
        let (frame, shutter) = ([None, Some(1.7)][round / 2 % 2], [0.0, 0.4][round / 4 % 2]);
        let options = changed(GltfOptions::default(), |it| {
            it.frame = frame;
            it.shutter = shutter;
        });
        let budget = Budget::new(Limits::default());
        let mut diagnostics = Diagnostics::with_strictness(strictness);
        let read =
            read_gltf(&file, &"m.glb".into(), Path::new("/nowhere"), &options, &budget, &mut diagnostics);
        assert!(budget.memory_peak() < (64 << 20) + 32 * file.len() as u64);
        match read {
            Ok(scene) => {
                reads += 1;
                let _ = Scene::build(scene);
            }
            Err(_) => errors += 1,
        }
    }
    assert!(errors > 500 && reads > 500, "{errors} {reads}");
}

// What Google's Draco 1.5 made of `grid`: sequential, and by edge breaking.
const DRACO: [&str; 2] = [
    "RFJBQ08CAgEAAAAMDAEAAQUABQQBAgYBBgUCAwcCBwYEBQkECQgFBgoFCgkGBwsGCwoBBAICBAEAAwkCAQEBCQMAAgAJAwADAQAAAgABA\
     QEByQEBLFUBL1UBQ60C//sBDJutAguqcwxrKUJwE5VCigAAAAD/AAAAAAAAAAAAAACrqqo+AAAAAKuqKj8AAAAAAACAPwAAAAAAAAAAAA\
     AAP6uqqj4AAAA/q6oqPwAAAD8AAIA/AAAAPwAAAAAAAIA/q6qqPgAAgD+rqio/AACAPwAAgD8AAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAA\
     AAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAA\
     AAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAEBAA8DVQUvrToDECCIUFUBAABAVQUAAABVFQAAAASA/\
     x8AUFUBAKtKVQUAqCpVFQBIVQUA/x8AUFUBAFVVVQUApipVFQCoqgAAAAAA/z8AAAAAAEAAAEBAAAAAAAAAwD8O",
    "RFJBQ08CAgEBAAAADAwDDAIABH+69in/ARH/At1A/wLdQP8C3UAEAAAAAQAAAgAA/wABAQICBAEAAQEDCQIBAQABAQkDAAIAAQAJAwADA\
     gEBAQAJAwEwFwEQBAC8joCgyA4BnwAAAADHAAAAAAAAAAAAAAD/AAAAq6qqPgAAAD8AAAAAAAAAPwAAAAAAAAAAq6qqPgAAAACrqio/AA\
     AAP6uqKj8AAAAAAACAPwAAAD8AAIA/AAAAAAAAgD8AAIA/q6oqPwAAgD+rqqo+AACAPwAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAA\
     AAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAA\
     AAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/AQEBAA8DVQUrrRoBIASYbfm5qur/b1WlqgBAVQUA/P8AA\
     AAAAFUVAAAAqgoAAMBUBQAAgFQVAAAAkKoCAAAwVQEAAABVBQAAYKoCAAAAAP8/AAAAAABAAABAQAAAAAAAAMA/Dg==",
];

/// The vertices of four by three: place, uv, colour.
fn grid() -> Vec<([f32; 3], [f32; 2], [u8; 4])> {
    let at = |i: u8, j: u8| {
        let (x, y) = (f32::from(i), f32::from(j));
        let place = [2.0 + 0.5 * x, 3.0 + 0.75 * y, f32::from((i * j) % 3) * 0.25];
        (place, [x / 3.0, y / 2.0], [i * 80, j * 100, 7, 255])
    };
    (0..3).flat_map(|j| (0..4).map(move |i| at(i, j))).collect()
}

/// A file with a primitive in compressed data, which claims this many indices.
fn compressed_by_draco(data: &[u8], indices: usize) -> (String, Vec<u8>) {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_draco_mesh_compression"],
        "extensionsRequired":["KHR_draco_mesh_compression"],"buffers":[{{"byteLength":{0}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{0}}}],"accessors":[
        {{"componentType":5126,"type":"VEC3","count":12,"min":[2,3,0],"max":[3.5,4.5,0.5]}},
        {{"componentType":5126,"type":"VEC2","count":12}},
        {{"componentType":5126,"type":"VEC3","count":12}},
        {{"componentType":5121,"normalized":true,"type":"VEC4","count":12}},
        {{"componentType":5123,"type":"SCALAR","count":{indices}}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
        "textures":[{{}}],
        "meshes":[{{"primitives":[{{"material":0,"attributes":{{"POSITION":0,"TEXCOORD_0":1,"NORMAL":2,"COLOR_0":3}},"indices":4,
        "extensions":{{"KHR_draco_mesh_compression":{{"bufferView":0,
        "attributes":{{"POSITION":3,"TEXCOORD_0":1,"NORMAL":2,"COLOR_0":0}}}}}}}}]}}],"nodes":[{{"mesh":0}}]}}"#,
        data.len()
    );
    (json, data.to_vec())
}

fn base64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let text = text.trim_end_matches('=');
    let bits: Vec<u32> = text.bytes().map(|c| u32::from(value(c))).collect();
    let mut out = vec![];
    for four in bits.chunks(4) {
        let word = four.iter().enumerate().fold(0, |word, (i, b)| word | b << (18 - 6 * i));
        out.extend(&word.to_be_bytes()[1..four.len()]);
    }
    out
}

#[cfg(feature = "draco")]
#[test]
fn primitives_compressed_by_draco_are_the_mesh_that_they_were() {
    let grid = grid();
    for packed in DRACO {
        let (json, data) = compressed_by_draco(&base64(packed), 36);
        let scene = read(&json, &data);
        let mesh = mesh(&scene.shapes[0]);
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (12, 12));
        let mut met = vec![];
        for i in 0..12 {
            let place = mesh.positions[i];
            let near = |(p, ..): &([f32; 3], [f32; 2], [u8; 4])| (Vec3::from(*p) - place).length() < 1e-3;
            let index = grid.iter().position(near).unwrap_or_else(|| panic!("{place} is no vertex"));
            let (_, uv, colour) = grid[index];
            // The v of glTF counts downwards.
            let found = mesh.uvs.as_ref().unwrap()[i];
            assert!((found - Vec2::new(uv[0], 1.0 - uv[1])).length() < 1e-3, "{found}");
            assert!((mesh.normals.as_ref().unwrap()[i] - Vec3::Z).length() < 1e-3);
            let expected = colour.map(|c| f32::from(c) / 255.0);
            assert_eq!(mesh.colours.as_ref().unwrap()[i].to_array(), expected[..3]);
            met.push(index);
        }
        // Each cell of the grid has two triangles that turn the same way.
        let mut cells: Vec<(usize, f32)> = mesh
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|i| mesh.positions[i as usize]);
                let least = corners.iter().map(|&i| met[i as usize]).min().unwrap();
                (least, (b - a).cross(c - a).z)
            })
            .collect();
        cells.sort_by_key(|(cell, _)| *cell);
        let firsts: Vec<usize> = cells.iter().map(|(cell, _)| *cell).collect();
        assert_eq!(firsts, [0, 0, 1, 1, 2, 2, 4, 4, 5, 5, 6, 6]);
        assert!(cells.iter().all(|(_, turn)| *turn > 0.0));
        met.sort_unstable();
        assert_eq!(met, (0..12).collect::<Vec<_>>());
    }
}

#[cfg(feature = "draco")]
#[test]
fn damaged_draco_is_an_error_with_a_pointer_and_costs_little() {
    let whole = base64(DRACO[1]);
    let (json, data) = compressed_by_draco(&whole, 33);
    let message = error(&json, &data);
    assert!(message.contains("/meshes/0/primitives/0"), "{message}");
    let (json, data) = compressed_by_draco(&whole, 4_000_000_000);
    let message = error(&json, &data);
    assert!(message.contains("--max-expansion"), "{message}");
    let mut survived = 0;
    for at in 0..whole.len() {
        for damage in [0x01, 0x80, 0xFF] {
            let mut data = whole.clone();
            data[at] ^= damage;
            let (json, data) = compressed_by_draco(&data, 36);
            let budget = Budget::default();
            let name: Arc<str> = "m.gltf".into();
            let read = read_gltf(
                &glb(&json, &data),
                &name,
                Path::new("."),
                &GltfOptions::default(),
                &budget,
                &mut Diagnostics::new(),
            );
            survived += usize::from(read.is_ok());
            assert!(budget.memory_peak() < 64 << 20, "{at}: {}", budget.memory_peak());
        }
    }
    assert!(survived < whole.len() * 3);
    for cut in 0..whole.len() {
        let (json, data) = compressed_by_draco(&whole[..cut.max(1)], 36);
        assert!(error(&json, &data).contains("/meshes/0/primitives/0"), "{cut}");
    }
}

/// A KTX 2.0 texture of 8 by 4 pixels in two blocks of one colour each, in UASTC's mode for these.
fn ktx(colours: [[u8; 4]; 2]) -> Vec<u8> {
    let words = |words: &[u32]| -> Vec<u8> { words.iter().flat_map(|w| w.to_le_bytes()).collect() };
    let mut out = b"\xABKTX 20\xBB\r\n\x1A\n".to_vec();
    out.extend(words(&[0, 1, 8, 4, 0, 0, 1, 1, 0]));
    out.extend(words(&[104, 44, 0, 0, 0, 0, 0, 0]));
    out.extend(words(&[160, 0, 32, 0, 32, 0]));
    // The descriptor of the data: model 166 is UASTC; sRGB; blocks of four by four in 16 bytes; channel 3 is RGBA.
    out.extend(words(&[44, 0, 2 | 40 << 16, 166 | 1 << 8 | 2 << 16, 3 | 3 << 8, 16, 0]));
    out.extend(words(&[127 << 16 | 3 << 24, 0, 0, u32::MAX]));
    out.resize(160, 0);
    for colour in colours {
        // Five bits of mode, then the colour.
        let bits = u128::from(0x17_u8) | u128::from(u32::from_le_bytes(colour)) << 5;
        out.extend(bits.to_le_bytes());
    }
    out
}

#[cfg(feature = "basisu")]
#[test]
fn textures_in_basis_universal_are_read() {
    let colours = [[200, 100, 50, 255], [10, 20, 30, 128]];
    let whole = ktx(colours);
    let with = |texture: &[u8]| {
        let mut parts = Parts::default();
        let p = parts.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let uv = parts
            .add(&floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]), r#""componentType":5126,"type":"VEC2","count":3"#);
        parts.binary.resize(parts.binary.len().next_multiple_of(4), 0);
        let view = parts.views.len();
        parts.views.push(format!(
            r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#,
            parts.binary.len(),
            texture.len()
        ));
        parts.binary.extend(texture);
        let json = parts.json(&format!(
            r#""extensionsUsed":["KHR_texture_basisu"],"extensionsRequired":["KHR_texture_basisu"],
            "images":[{{"bufferView":{view},"mimeType":"image/ktx2"}}],
            "textures":[{{"extensions":{{"KHR_texture_basisu":{{"source":0}}}}}}],
            "materials":[{{"emissiveFactor":[1,1,1],"emissiveTexture":{{"index":0}}}}],
            "meshes":[{{"primitives":[{{"material":0,"attributes":{{"POSITION":{p},"TEXCOORD_0":{uv}}}}}]}}],
            "nodes":[{{"mesh":0}}]"#
        ));
        (json, parts.binary)
    };
    let (json, binary) = with(&whole);
    let scene = read(&json, &binary);
    let light = scene.shapes[0].area_light.clone().unwrap();
    let map = light.image.unwrap();
    // The left half has the first colour, the right half the second, on the sRGB curve.
    let linear = |c: u8| lumbre_image::srgb_to_linear(f32::from(c) / 255.0);
    let bitmap = map.bitmap();
    assert_eq!((bitmap.width(), bitmap.height()), (8, 4));
    for (x, colour) in [(1, colours[0]), (6, colours[1])] {
        let found: Rgb = bitmap.rgb(x, 2);
        let expected = Rgb::new(linear(colour[0]), linear(colour[1]), linear(colour[2]));
        assert!((found - expected).map(f32::abs).max_component() < 0.01, "{found:?} {expected:?}");
    }
    for cut in 0..whole.len() {
        let (json, binary) = with(&whole[..cut.max(1)]);
        let message = error(&json, &binary);
        assert!(message.contains("/images/0"), "{cut}: {message}");
    }
    for at in 0..whole.len() {
        for damage in [0x01, 0x10, 0xFF] {
            let mut texture = whole.clone();
            texture[at] ^= damage;
            let (json, binary) = with(&texture);
            let _ = read_with(&glb(&json, &binary), &GltfOptions::default(), &mut Diagnostics::new());
        }
    }
    // A size that its data cannot have is refused before it is believed.
    let mut texture = whole;
    texture[20..28].copy_from_slice(&[0, 0, 1, 0, 0, 0, 1, 0]);
    let (json, binary) = with(&texture);
    let message = error(&json, &binary);
    assert!(message.contains("first level of another size than its blocks"), "{message}");
}
