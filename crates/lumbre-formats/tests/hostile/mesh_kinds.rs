//! A mesh is the same in every kind of file that can hold it: text and binary PLY in both byte orders, OBJ, and as
//! triangles of their own text and binary STL.

use std::fmt::Write as _;

use lumbre_formats::obj::read_obj;
use lumbre_formats::ply::read_ply;
use lumbre_formats::stl::read_stl;
use lumbre_formats::{Budget, Diagnostics, Limits};
use lumbre_math::{DVec3, Vec3};
use lumbre_scene::MeshDesc;

/// Vertices and triangles.
struct Mesh {
    vertices: Vec<[f32; 3]>,
    faces: Vec<[u8; 3]>,
}

/// The first byte is the number of vertices; then come their coordinates and the corners of faces.
fn mesh(bytes: &[u8]) -> Option<Mesh> {
    let (&count, rest) = bytes.split_first()?;
    let count = usize::from(count % 60).max(3);
    let (coordinates, corners) = rest.split_at_checked(12 * count)?;
    let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let vertices: Vec<[f32; 3]> =
        coordinates.chunks_exact(12).map(|v| [number(&v[..4]), number(&v[4..8]), number(&v[8..])]).collect();
    let faces: Vec<[u8; 3]> =
        corners.chunks_exact(3).map(|f| [f[0], f[1], f[2]].map(|corner| corner % count as u8)).collect();
    // Numbers that are none are refused, and what is beyond the range of a reader.
    let is_usual = |x: &f32| x.is_finite() && x.abs() < 1e30;
    (!faces.is_empty() && vertices.as_flattened().iter().all(is_usual)).then_some(Mesh { vertices, faces })
}

fn ply(mesh: &Mesh, format: &str) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.faces.len()
    )
    .into_bytes();
    if format == "ascii" {
        let mut text = String::new();
        for [x, y, z] in &mesh.vertices {
            let _ = writeln!(text, "{x} {y} {z}");
        }
        for [a, b, c] in &mesh.faces {
            let _ = writeln!(text, "3 {a} {b} {c}");
        }
        out.extend(text.into_bytes());
        return out;
    }
    let is_little = format == "binary_little_endian";
    for x in mesh.vertices.as_flattened() {
        out.extend(if is_little { x.to_le_bytes() } else { x.to_be_bytes() });
    }
    for face in &mesh.faces {
        out.push(3);
        for corner in face.map(i32::from) {
            out.extend(if is_little { corner.to_le_bytes() } else { corner.to_be_bytes() });
        }
    }
    out
}

fn obj(mesh: &Mesh) -> Vec<u8> {
    let mut out = String::new();
    for [x, y, z] in &mesh.vertices {
        let _ = writeln!(out, "v {x:e} {y} {z}");
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|corner| u32::from(corner) + 1);
        let _ = writeln!(out, "f {a} {b} {c}");
    }
    out.into_bytes()
}

fn stl(mesh: &Mesh, is_text: bool) -> Vec<u8> {
    let corners = |face: &[u8; 3]| face.map(|corner| mesh.vertices[usize::from(corner)]);
    if is_text {
        let mut out = String::from("solid\n");
        for face in &mesh.faces {
            out.push_str("facet normal 0 0 1\nouter loop\n");
            for [x, y, z] in corners(face) {
                let _ = writeln!(out, "vertex {x} {y} {z:e}");
            }
            out.push_str("endloop\nendfacet\n");
        }
        out.push_str("endsolid\n");
        return out.into_bytes();
    }
    let mut out = vec![0; 80];
    out.extend((mesh.faces.len() as u32).to_le_bytes());
    for face in &mesh.faces {
        out.extend([0; 12]);
        corners(face).as_flattened().iter().for_each(|x| out.extend(x.to_le_bytes()));
        out.extend([0; 2]);
    }
    out
}

/// The corners of all triangles, which no merging or leaving out of vertices changes; a zero is a zero whatever its
/// sign.
fn triangles<'m>(meshes: impl IntoIterator<Item = &'m MeshDesc>, origin: DVec3) -> Vec<[[u64; 3]; 3]> {
    let place = |p: &Vec3| (origin + p.as_dvec3()).to_array().map(|x| (x + 0.0).to_bits());
    let of_mesh = |mesh: &'m MeshDesc| {
        mesh.triangles.iter().map(move |t| t.map(|i| place(&mesh.positions[i as usize])))
    };
    meshes.into_iter().flat_map(of_mesh).collect()
}

pub(crate) fn run(bytes: &[u8]) {
    let Some(mesh) = mesh(bytes) else { return };
    let mut limits = Limits::default();
    limits.memory = 64 << 20;
    let budget = Budget::new(limits);
    let mut said = Diagnostics::new();
    let mut of_ply = |format: &str| {
        let bytes = ply(&mesh, format);
        let file = read_ply(&bytes, &"a.ply".into(), &budget, &mut said);
        let file = file.unwrap_or_else(|error| panic!("{format}: {error}"));
        triangles([&file.mesh], file.origin)
    };
    let expected = of_ply("ascii");
    assert_eq!(expected.len(), mesh.faces.len());
    assert_eq!(expected, of_ply("binary_little_endian"));
    assert_eq!(expected, of_ply("binary_big_endian"));
    let file = read_obj(&obj(&mesh), &"a.obj".into(), &budget, &mut said);
    let file = file.unwrap_or_else(|error| panic!("obj: {error}"));
    assert_eq!(expected, triangles(file.meshes.iter().map(|part| &*part.mesh), file.origin));
    let [text, binary] = [true, false].map(|is_text| {
        let solids = read_stl(&stl(&mesh, is_text), &"a.stl".into(), &budget, &mut said);
        let solids = solids.unwrap_or_else(|error| panic!("stl, text {is_text}: {error}"));
        solids.iter().flat_map(|solid| triangles([&solid.mesh], solid.origin)).collect::<Vec<_>>()
    });
    assert_eq!(text, binary);
}
