//! PLY files in every encoding, with every type, and as others wrote them.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::{changed, shared};
use lumbre_formats::ply::read_ply;
use lumbre_formats::{Budget, Diagnostics, FormatError, Input, Limits, ReadOptions, Strictness, open_scene};
use lumbre_geometry::Shape;
use lumbre_image::Rgb;
use lumbre_math::DVec3;
use lumbre_scene::{GeometryDesc, MeshDesc, Scene, ShapeDesc};
use lumbre_shading::{MaterialKind, Texture};

fn name() -> Arc<str> {
    "m.ply".into()
}

fn read(bytes: &[u8]) -> Result<MeshDesc, FormatError> {
    read_ply(bytes, &name(), &Budget::default(), &mut Diagnostics::new()).map(|file| file.mesh)
}

/// Two triangles and a quad over six vertices, in text.
const TEXT: &str = "ply\r
format ascii 1.0\r
comment made by hand\r
element vertex 6\r
property float x\r
property float y\r
property float z\r
property float nx\r
property float ny\r
property float nz\r
property float u\r
property float v\r
property uchar red\r
property uchar green\r
property uchar blue\r
element face 3\r
property list uchar int vertex_indices\r
property int face_indices\r
end_header\r
1 2 3 0 0 1 0.25 0.5 255 0 128\r
2 2 3 0 0 1 0.5 0.5 255 0 128\r
2 3 3 0 0 1 0.5 0.75 255 0 128\r
1 3 3 0 0 1 0.25 0.75 255 0 128\r
3 2 3 0 0 1 0.75 0.5 255 0 128\r
3 3 3 0 0 1 0.75 0.75 255 0 128\r
3 0 1 2 70\r
4 1 4 5 2 90\r
3 0 2 3 80\r
";

#[derive(Clone, Copy, Debug)]
enum Value {
    Float(f64),
    Whole(i64),
}

/// The bytes of a number of a type.
fn pack(kind: &str, v: Value, big: bool) -> Vec<u8> {
    let (f, i) = match v {
        Value::Float(f) => (f, f as i64),
        Value::Whole(i) => (i as f64, i),
    };
    let mut bytes = match kind {
        "char" | "int8" => (i as i8).to_le_bytes().to_vec(),
        "uchar" | "uint8" => (i as u8).to_le_bytes().to_vec(),
        "short" | "int16" => (i as i16).to_le_bytes().to_vec(),
        "ushort" | "uint16" => (i as u16).to_le_bytes().to_vec(),
        "int" | "int32" => (i as i32).to_le_bytes().to_vec(),
        "uint" | "uint32" => (i as u32).to_le_bytes().to_vec(),
        "float" | "float32" => (f as f32).to_le_bytes().to_vec(),
        "double" | "float64" => f.to_le_bytes().to_vec(),
        _ => panic!("{kind}"),
    };
    if big {
        bytes.reverse();
    }
    bytes
}

/// A square of two triangles away from the origin, with properties nobody knows between the known ones.
fn binary(big: bool, float: &str, length: &str, index: &str) -> Vec<u8> {
    let order = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut out = format!(
        "ply\nformat {order} 1.0\nelement camera 1\nproperty {float} aperture\nproperty list {length} short path\n\
         element vertex 4\nproperty {float} z\nproperty uchar quality\nproperty {float} x\nproperty list {length} double extra\n\
         property {float} y\nelement face 2\nproperty short flags\nproperty list {length} {index} vertex_index\nend_header\n"
    )
    .into_bytes();
    let mut put = |kind: &str, v: Value| out.extend(pack(kind, v, big));
    put(float, Value::Float(2.5));
    put(length, Value::Whole(2));
    put("short", Value::Whole(-3));
    put("short", Value::Whole(-4));
    for (i, [x, y]) in [[5.0, 6.0], [7.0, 6.0], [7.0, 9.0], [5.0, 9.0]].into_iter().enumerate() {
        put(float, Value::Float(4.0));
        put("uchar", Value::Whole(200));
        put(float, Value::Float(x));
        put(length, Value::Whole(i as i64));
        for _ in 0..i {
            put("double", Value::Float(1e300));
        }
        put(float, Value::Float(y));
    }
    for face in [[0, 1, 2], [0, 2, 3]] {
        put("short", Value::Whole(-1));
        put(length, Value::Whole(3));
        for corner in face {
            put(index, Value::Whole(corner));
        }
    }
    out
}

#[test]
fn text_with_everything_in_it_is_read() {
    let mesh = read(TEXT.as_bytes()).unwrap();
    assert_eq!(mesh.positions.len(), 6);
    assert_eq!(mesh.positions[5].to_array(), [3.0, 3.0, 3.0]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.quads, [[1, 4, 5, 2]]);
    assert_eq!(mesh.face_indices.unwrap(), [70, 80, 90], "triangles first, then quads");
    assert_eq!(mesh.normals.unwrap()[3].to_array(), [0.0, 0.0, 1.0]);
    assert_eq!(mesh.uvs.unwrap()[4].to_array(), [0.75, 0.5]);
    let colour = mesh.colours.unwrap()[2];
    assert_eq!((colour.r, colour.g), (1.0, 0.0));
    assert!((colour.b - 0.2158605).abs() < 1e-6, "bytes are on the sRGB curve");
}

#[test]
fn a_mesh_alone_shows_the_colours_of_its_vertices() {
    let dir = tempfile::tempdir().unwrap();
    let plain = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n5 0 0\n0 7 0\n3 0 1 2\n";
    for (name, text, shows) in [("colours.ply", TEXT, true), ("plain.ply", plain, false)] {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        let (scene, _) = open_scene(&path, &ReadOptions::default()).unwrap();
        let material = &scene.materials[scene.shapes[0].material.unwrap().0 as usize].material;
        let MaterialKind::Diffuse { reflectance } = &material.kind else { panic!("{:?}", material.kind) };
        assert_eq!(matches!(**reflectance, Texture::Vertices), shows, "{name}");
    }
}

#[test]
fn every_byte_order_and_type_gives_the_same_mesh() {
    let mut read_meshes = 0;
    let expected = read(&binary(false, "float", "uchar", "int")).unwrap();
    assert_eq!(expected.positions[2].to_array(), [7.0, 9.0, 4.0]);
    assert_eq!(expected.triangles, [[0, 1, 2], [0, 2, 3]]);
    for big in [false, true] {
        for float in ["float", "double", "float32", "float64", "short", "uint8"] {
            for length in ["char", "uchar", "short", "ushort", "int", "uint", "uint32"] {
                for index in ["char", "uchar", "short", "ushort", "int", "uint", "int16", "float", "double"] {
                    assert_eq!(read(&binary(big, float, length, index)).unwrap(), expected);
                    read_meshes += 1;
                }
            }
        }
    }
    assert_eq!(read_meshes, 2 * 6 * 7 * 9);
}

#[test]
fn every_name_of_texture_coordinates_is_known() {
    for [u, v] in [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]] {
        let text =
            TEXT.replace("float u\r", &format!("float {u}\r")).replace("float v\r", &format!("float {v}\r"));
        assert_eq!(read(text.as_bytes()).unwrap().uvs.unwrap()[1].to_array(), [0.5, 0.5]);
    }
}

#[test]
fn concave_and_many_cornered_faces_become_triangles() {
    let text = "ply\nformat ascii 1.0\nelement vertex 6\nproperty double x\nproperty double y\nproperty double z\n\
        element face 2\nproperty list ushort uint vertex_indices\nproperty uint face_indices\nend_header\n\
        0 0 2\n4 0 2\n1 1 2\n0 4 2\n-2 2 2\n-2 1 2\n4 0 1 2 3 11\n6 0 1 2 3 4 5 12\n";
    let mesh = read(text.as_bytes()).unwrap();
    assert!(mesh.quads.is_empty(), "a concave quad is no patch");
    assert_eq!(mesh.triangles.len(), 2 + 4);
    assert_eq!(mesh.face_indices.as_deref(), Some(&[11, 11, 12, 12, 12, 12][..]));
    let area: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
            let n = (b - a).cross(c - a);
            assert!(n.z >= 0.0, "turned over");
            n.length() / 2.0
        })
        .sum();
    // The arrowhead has 4; the second face has it too, and beyond its side the polygon (0,4) (-2,2) (-2,1) (0,0)
    // with 5.
    assert!((area - (4.0 + 4.0 + 5.0)).abs() < 1e-9, "{area}");
}

#[test]
fn strips_turn_every_other_triangle() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        1 1 0\n2 1 0\n1 2 0\n2 2 0\n3 3 0\n8 0 1 2 3 -1 1 4 3\n";
    assert_eq!(read(text.as_bytes()).unwrap().triangles, [[0, 1, 2], [2, 1, 3], [1, 4, 3]]);
}

#[test]
fn faces_may_stand_before_their_vertices() {
    let text = "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n\
        element vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n3 2 1 0\n1 2 3 4 5 6 7 8 10\n";
    let mesh = read(text.as_bytes()).unwrap();
    assert_eq!(mesh.triangles, [[2, 1, 0]]);
    assert_eq!(mesh.positions[2].to_array(), [7.0, 8.0, 10.0]);
}

#[test]
fn lenient_drops_what_cannot_be_used_and_counts_it() {
    let text = TEXT.replace("3 3 3 0 0 1", "nan 3 3 0 0 1").replace("3 0 2 3 80", "3 0 2 9 80");
    let wrong = read(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(wrong, "m.ply:25:1: vertex 5 is not finite (found (NaN, 3, 3))");
    let mut said = Diagnostics::with_strictness(Strictness::Lenient);
    let mesh = read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap().mesh;
    assert_eq!((mesh.triangles.len(), mesh.quads.len()), (1, 0));
    assert_eq!(mesh.face_indices.unwrap(), [70]);
    assert_eq!(
        said.lines(),
        [
            "warning: m.ply:27:1: face with a vertex that is not finite is left out (found face 1)",
            "warning: m.ply:28:1: face with a vertex that does not exist is left out (found face 2)",
        ]
    );
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
}

#[test]
fn a_count_bomb_costs_nothing() {
    for count in ["1000000000000000000", "18446744073709551615", "4294967295"] {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            for element in ["vertex", "face", "tristrips", "other"] {
                let text = format!(
                    "ply\nformat {format} 1.0\nelement vertex 2\nproperty uchar x\nproperty uchar y\nproperty uchar z\n\
                     element nothing {count}\nelement {element}s 1\nproperty uchar a\nend_header\n"
                );
                let text = text
                    .replace("vertex 2", &format!("vertex {}", if element == "vertex" { count } else { "2" }))
                    .replace(
                        &format!("{element}s 1"),
                        &format!("{element} {}", if element == "vertex" { "1" } else { count }),
                    )
                    .replace("element vertex 1\nproperty uchar a\n", "");
                let budget = Budget::new(changed(Limits::default(), |it| it.memory = 1 << 20));
                let mut bytes = text.clone().into_bytes();
                bytes.extend(b"1 2 3 4 5 6 7 8 9 ");
                let error = read_ply(&bytes, &name(), &budget, &mut Diagnostics::new()).unwrap_err();
                let text = error.to_string();
                assert!(text.contains("file is truncated: ") && text.contains(count), "{text}");
                assert!(budget.memory_peak() < 1024, "{}", budget.memory_peak());
            }
        }
    }
}

#[test]
fn meshes_of_others_are_read() {
    if let Some(folder) = shared("formats/happly") {
        let budget = Budget::default();
        let read = |file: &str| {
            let input = Input::open(&folder.join(file), &budget).unwrap();
            read_ply(&input, input.name(), &budget, &mut Diagnostics::new()).unwrap().mesh
        };
        let text = read("platonic_shelf_ascii.ply");
        assert_eq!(text.positions.len(), 50);
        assert!(!text.quads.is_empty() && !text.triangles.is_empty());
        for other in ["platonic_shelf.ply", "platonic_shelf_big_endian.ply"] {
            let other = read(other);
            assert_eq!((&other.triangles, &other.quads), (&text.triangles, &text.quads));
            let near = other.positions.iter().zip(&text.positions).all(|(a, b)| (*a - *b).length() < 1e-4);
            assert!(near);
        }
    }
    if let Some(folder) = shared("meshes") {
        let budget = Budget::default();
        let input = Input::open(&folder.join("bitterli-coffee-flat.ply"), &budget).unwrap();
        let start = std::time::Instant::now();
        let mesh = read_ply(&input, input.name(), &budget, &mut Diagnostics::new()).unwrap().mesh;
        let seconds = start.elapsed().as_secs_f64();
        println!("{} bytes in {seconds} s: {:.0} MB/s", input.len(), input.len() as f64 / 1e6 / seconds);
        assert_eq!(mesh.triangles.len(), 235_271);
    }
}

/// Prints how fast a million vertices and two million triangles are read: run with `--ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn measure_reading() {
    let (vertices, faces) = (1_000_000u32, 2_000_000u32);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
         property float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face {faces}\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    let mut text = bytes.replace("binary_little_endian", "ascii");
    let mut binary = std::mem::take(&mut bytes).into_bytes();
    for i in 0..vertices {
        let v = [0.1, 0.2, 0.3, 0.5, 0.6, 0.7].map(|f| f * i as f32);
        binary.extend(v.into_iter().flat_map(f32::to_le_bytes));
        text += &format!("{} {} {} {} {} {}\n", v[0], v[1], v[2], v[3], v[4], v[5]);
    }
    for i in 0..faces {
        let f = [i % vertices, (i + 1) % vertices, (i * 7) % vertices];
        binary.push(3);
        binary.extend(f.into_iter().flat_map(u32::to_le_bytes));
        text += &format!("3 {} {} {}\n", f[0], f[1], f[2]);
    }
    for (kind, bytes) in [("binary", &binary[..]), ("text", text.as_bytes())] {
        let start = std::time::Instant::now();
        let mesh = read(bytes).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        assert_eq!(mesh.triangles.len(), faces as usize);
        println!(
            "{kind}: {} MB in {seconds:.3} s, {:.0} MB/s",
            bytes.len() / 1_000_000,
            bytes.len() as f64 / 1e6 / seconds
        );
    }
}

/// The scene of a text, written next to an image of one pixel.
fn open_text(text: &str) -> (lumbre_scene::SceneDesc, Vec<String>) {
    let dir = tempfile::tempdir().unwrap();
    let pixel = image::RgbImage::from_raw(1, 1, vec![255, 0, 0]).unwrap();
    pixel.save(dir.path().join("a b.png")).unwrap();
    let path = dir.path().join("m.ply");
    std::fs::write(&path, text).unwrap();
    let (scene, said) = open_scene(&path, &ReadOptions::default()).unwrap();
    (scene, said.lines())
}

const PLACES: &str = "property double x\nproperty double y\nproperty double z\n";

#[test]
fn vertices_without_faces_are_points_and_edges_are_lines() {
    let vertices = "0 0 2\n3 0 2\n3 4 2\n";
    let (scene, said) =
        open_text(&format!("ply\nformat ascii 1.0\nelement vertex 3\n{PLACES}end_header\n{vertices}"));
    assert_eq!((scene.shapes.len(), said.len()), (3, 0));
    let spheres = scene
        .shapes
        .iter()
        .all(|s| matches!(&s.geometry, GeometryDesc::Exact(exact) if matches!(*exact, Shape::Sphere(_))));
    assert!(spheres);
    let (scene, said) = open_text(&format!(
        "ply\nformat ascii 1.0\nelement vertex 3\n{PLACES}element edge 2\nproperty int vertex1\nproperty int vertex2\n\
         end_header\n{vertices}0 1\n1 2\n"
    ));
    let is_line = |s: &ShapeDesc| matches!(&s.geometry, GeometryDesc::Exact(exact) if matches!(*exact, Shape::Cylinder(_)));
    assert_eq!((scene.shapes.iter().filter(|s| is_line(s)).count(), said.len()), (2, 0));
    Scene::build(scene).unwrap();
}

#[test]
fn doubles_far_from_zero_keep_their_digits() {
    let far = DVec3::new(500_000.25, 4_649_781.5, 100.125);
    let places = [far, far + DVec3::new(0.01, 0.0, 0.0), far + DVec3::new(0.0, 0.03, 0.0)];
    let header = |kind: &str| {
        format!(
            "ply\nformat {kind} 1.0\nelement vertex 3\n{PLACES}element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let mut binary = header("binary_little_endian").into_bytes();
    let mut text = header("ascii");
    for p in places {
        text += &format!("{} {} {}\n", p.x, p.y, p.z);
        p.to_array().iter().for_each(|v| binary.extend(v.to_le_bytes()));
    }
    text += "3 0 1 2\n";
    binary.push(3);
    (0..3_i32).for_each(|v| binary.extend(v.to_le_bytes()));
    for bytes in [text.as_bytes(), &binary] {
        let file = read_ply(bytes, &name(), &Budget::default(), &mut Diagnostics::new()).unwrap();
        for (found, p) in file.mesh.positions.iter().zip(places) {
            assert!((found.as_dvec3() + file.origin - p).abs().max_element() < 1e-8);
        }
    }
    let scene = open_text(&text).0;
    assert!(scene.shapes[0].world_from_object.point(DVec3::ZERO).x > 499_999.0);
}

#[test]
fn the_texture_of_a_comment_is_found_beside_the_file() {
    let with = |file: &str| {
        open_text(&format!(
            "ply\nformat ascii 1.0\ncomment TextureFile {file}\nelement vertex 3\n{PLACES}property float s\n\
             property float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 2 0 0\n3 0 2 1 0\n3 4 2 1 1\n3 0 1 2\n"
        ))
    };
    let (scene, said) = with("a b.png");
    assert_eq!(said.len(), 0);
    let MaterialKind::Diffuse { reflectance } = &scene.materials[0].material.kind else { panic!() };
    assert!(matches!(**reflectance, Texture::Image(_)));
    let (_, said) = with("a b.png\ncomment TextureFile b.png");
    assert!(said.len() == 1 && said[0].contains("m.ply:4:21: a PLY file names several textures"), "{said:?}");
    let (_, said) = with("gone.png");
    assert!(said.len() == 1 && said[0].contains("cannot use the texture of a PLY file"), "{said:?}");
}

#[test]
fn texture_coordinates_of_corners_are_those_of_the_faces() {
    // A square with a seam along its diagonal, as MeshLab writes it.
    let file = |body: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\n{PLACES}property float nx\nproperty float ny\nproperty float nz\n\
             element face 3\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n\
             0 0 1 0 0 1\n2 0 1 0 0 1\n2 3 1 0 0 1\n0 3 1 0.6 0 0.8\n{body}"
        )
    };
    let text = file(
        "3 0 1 2 6 0 0 0.5 0 0.5 0.75\n3 0 2 3 6 0.25 0.25 0.5 0.75 0 1\n4 0 1 2 3 8 0.25 0.25 0.5 0 0.5 0.75 0 1\n",
    );
    let mut said = Diagnostics::new();
    let file_read = read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap();
    assert_eq!(said.lines(), [""; 0]);
    assert!(file_read.has_corner_uvs);
    let mesh = file_read.mesh;
    let uvs = mesh.uvs.as_ref().unwrap();
    // One vertex has two places in the texture, and one of them twice.
    assert_eq!((mesh.positions.len(), uvs.len(), mesh.normals.as_ref().unwrap().len()), (5, 5, 5));
    let of_corners =
        |corners: &[u32]| -> Vec<[f32; 2]> { corners.iter().map(|&i| uvs[i as usize].to_array()).collect() };
    assert_eq!(of_corners(&mesh.triangles[0]), [[0.0, 0.0], [0.5, 0.0], [0.5, 0.75]]);
    assert_eq!(of_corners(&mesh.triangles[1]), [[0.25, 0.25], [0.5, 0.75], [0.0, 1.0]]);
    assert_eq!(of_corners(&mesh.quads[0]), [[0.25, 0.25], [0.5, 0.0], [0.5, 0.75], [0.0, 1.0]]);
    for corners in [&mesh.triangles[0][..], &mesh.triangles[1], &mesh.quads[0]] {
        assert_eq!(mesh.positions[corners[0] as usize], lumbre_math::Vec3::new(0.0, 0.0, 1.0));
    }
    assert_eq!(mesh.quads[0][0], mesh.triangles[1][0]);

    // A face without them, and one with too few; a copy is no vertex of the file.
    let text = file("3 0 1 2 6 0 0 0.5 0 0.5 0.75\n3 0 2 3 0\n3 0 1 3 4 0.25 0.25 0.5 0\n");
    let mesh = read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap().mesh;
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 3));
    assert!(
        said.lines().len() == 1 && said.lines()[0].contains("expected two numbers per vertex"),
        "{:?}",
        said.lines()
    );
    let text = file("3 0 1 2 6 0 0 0.5 0 0.5 0.75\n3 0 2 3 6 9 9 0.5 0.75 0 1\n3 4 1 2 0\n");
    let error = read(text.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("face 2 has a vertex that does not exist") && error.contains("0 to 3"), "{error}");
}

#[test]
fn colours_of_faces_are_those_of_their_corners() {
    let file = |of_vertices: &str, of_faces: &str, body: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\n{PLACES}{of_vertices}element face 3\n\
             property list uchar int vertex_indices\n{of_faces}end_header\n{body}"
        )
    };
    let colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let places = "0 0 1\n2 0 1\n2 3 1\n0 3 1\n";
    let text = file("", colours, &format!("{places}3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n4 0 1 2 3 255 0 0\n"));
    let mut said = Diagnostics::new();
    let mesh = read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap().mesh;
    assert_eq!(said.lines(), [""; 0]);
    let (red, blue) = (Rgb::new(1.0, 0.0, 0.0), Rgb::new(0.0, 0.0, 1.0));
    // Three vertices have two colours.
    assert_eq!((mesh.positions.len(), mesh.uvs.is_none()), (7, true));
    let list = mesh.colours.as_ref().unwrap();
    let all = |corners: &[u32], colour: Rgb| corners.iter().all(|&i| list[i as usize] == colour);
    assert!(all(&mesh.triangles[0], red) && all(&mesh.triangles[1], blue));
    assert!(all(&mesh.quads[0], red), "{list:?}");

    // Texture coordinates of corners too; floats are linear.
    let floats =
        "property float red\nproperty float green\nproperty float blue\nproperty list uchar float texcoord\n";
    let faces =
        "3 0 1 2 0.5 0 0 6 0 0 0.5 0 0.5 0.75\n3 0 2 3 0 0 7.5 6 0 0 0.5 0.75 0 1\n3 0 1 3 0 nan 0 0\n";
    let text = file("", floats, &format!("{places}{faces}"));
    let read = read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap();
    let (mesh, colours_of, uvs) =
        (&read.mesh, read.mesh.colours.as_ref().unwrap(), read.mesh.uvs.as_ref().unwrap());
    assert!(read.has_corner_uvs);
    for (triangle, colour) in mesh.triangles.iter().zip([[0.5, 0.0, 0.0], [0.0, 0.0, 7.5], [0.0; 3]]) {
        assert!(triangle.iter().all(|&i| colours_of[i as usize] == Rgb::from(colour)), "{colours_of:?}");
    }
    assert_eq!(mesh.triangles[1].map(|i| uvs[i as usize].to_array()), [[0.0, 0.0], [0.5, 0.75], [0.0, 1.0]]);
    assert!(
        said.lines().len() == 1 && said.lines()[0].contains("a colour is not finite"),
        "{:?}",
        said.lines()
    );

    // Vertices come first, and that is said.
    let with = places.replace(" 1\n", " 1 0 255 0\n");
    let text = file(colours, colours, &format!("{with}3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n3 0 1 3 9 9 9\n"));
    let mut said = Diagnostics::new();
    let mesh = read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap().mesh;
    assert!(mesh.colours.unwrap().iter().all(|&c| c == Rgb::new(0.0, 1.0, 0.0)) && mesh.positions.len() == 4);
    let (lines, expected) =
        (said.lines(), "colours of \"face\" elements are not used (found colours of vertices");
    assert!(lines.len() == 1 && lines[0].contains(expected), "{lines:?}");

    // Edges have no colours.
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 4\n{PLACES}element edge 1\nproperty int vertex1\nproperty int vertex2\n\
         {colours}end_header\n{places}0 2 255 0 0\n"
    );
    let mut said = Diagnostics::new();
    let edges = read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap().edges;
    assert_eq!(edges, [[0, 2]]);
    assert!(said.lines()[0].contains("colours of \"edge\" elements are not used"), "{:?}", said.lines());
}

#[test]
fn what_is_not_finite_where_nothing_is_seen_is_a_note() {
    // The third vertex has a normal that is not finite, the fourth such texture coordinates.
    let file = |faces: &str, count: usize| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\n{PLACES}property float nx\nproperty float ny\nproperty float nz\n\
             property float u\nproperty float v\nelement face {count}\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 1 0 0 1 0 0\n2 0 1 0 0 1 0 0\n2 3 1 nan 0 1 0 0\n4 0 1 0 0 1 inf 0\n{faces}"
        )
    };
    let read = |text: &str| {
        let mut said = Diagnostics::with_strictness(Strictness::Strict);
        read_ply(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap();
        (said.lines(), said.warnings(), said.check().is_ok())
    };
    // A face along a line, and one in a point: nothing of them is seen.
    let unseen = "3 0 1 3\n3 2 2 2\n4 0 2 2 0\n";
    let (lines, warnings, passes) = read(&file(unseen, 3));
    assert_eq!((lines.len() - 1, warnings, passes), (2, 1, false), "{lines:?}");
    assert!(
        lines
            .iter()
            .filter(|line| line.starts_with("note: m.ply:") && line.contains("no face with an area"))
            .count()
            == 2
    );
    let seen = |face: &str| {
        let (lines, warnings, passes) = read(&file(&format!("3 0 1 3\n4 0 2 2 0\n{face}"), 3));
        let notes = lines.iter().filter(|line| line.starts_with("note: ")).count() as u64;
        assert_eq!(passes, warnings == 0, "{lines:?}");
        (warnings, notes)
    };
    assert_eq!(seen("3 0 1 2\n"), (1, 1));
    assert_eq!(seen("3 0 2 3\n"), (2, 0));
    assert_eq!(seen("4 0 0 1 3\n").1, 2);
}
