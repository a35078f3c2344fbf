//! STL files, text and binary, in every dialect of colours.

use std::sync::Arc;

use crate::common::{files_below, shared};
use lumbre_formats::stl::{StlSolid, open_stl, read_stl};
use lumbre_formats::{Budget, Diagnostics, FormatError, Strictness};
use lumbre_image::{Rgb, srgb_to_linear};
use lumbre_math::DVec3;
use lumbre_scene::UpAxis;

fn name() -> Arc<str> {
    "m.stl".into()
}

fn read(bytes: &[u8]) -> Result<Vec<StlSolid>, FormatError> {
    read_stl(bytes, &name(), &Budget::default(), &mut Diagnostics::new())
}

/// A binary file of facets: corners and attribute.
fn binary(header: &[u8], facets: &[([[f32; 3]; 3], u16)]) -> Vec<u8> {
    let mut out = header.to_vec();
    out.resize(80, b' ');
    out.extend((facets.len() as u32).to_le_bytes());
    for (corners, attribute) in facets {
        out.extend([0u8; 12]);
        out.extend(corners.iter().flatten().flat_map(|v| v.to_le_bytes()));
        out.extend(attribute.to_le_bytes());
    }
    out
}

const SQUARE: [[[f32; 3]; 3]; 2] =
    [[[1., 2., 3.], [4., 2., 3.], [4., 5., 3.]], [[1., 2., 3.], [4., 5., 3.], [1., 5., 3.]]];

#[test]
fn equal_corners_become_one_vertex_and_so_do_the_two_zeros() {
    let solids = read(&binary(b"made by hand", &[(SQUARE[0], 0), (SQUARE[1], 0)])).unwrap();
    assert_eq!(solids[0].mesh.positions.len(), 4);
    assert_eq!(solids[0].mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(solids[0].mesh.colours.is_none());
    let zeros = [[0.0, 2., 3.], [-0.0, 2., 3.], [4., -0.0, 0.0]];
    assert_eq!(read(&binary(b"x", &[(zeros, 0), (zeros, 0)])).unwrap()[0].mesh.positions.len(), 2);
}

#[test]
fn a_binary_file_may_start_with_solid() {
    let solids = read(&binary(b"solid block of binary", &[(SQUARE[0], 0), (SQUARE[1], 0)])).unwrap();
    assert_eq!(solids[0].mesh.triangles.len(), 2);
    assert_eq!(solids[0].name, "block of binary");
}

#[test]
fn text_has_many_solids_in_any_case() {
    let text = "solid first part\r\n facet normal 0 0 1\r\n  outer loop\r\n   vertex 1 2 3\r\n   vertex 4e0 2 3\r\n   vertex 4 5 3\r\n\
        endloop endfacet\r\nendsolid first part\r\nSOLID\nFACET NORMAL 0 0 0 OUTER LOOP VERTEX 1 2 3 VERTEX 2 2 3 VERTEX 1 3 3 \
        ENDLOOP ENDFACET ENDSOLID\nsolid empty\nendsolid empty\n";
    let solids = read(text.as_bytes()).unwrap();
    let parts: Vec<_> = solids.iter().map(|s| (s.name.as_str(), s.mesh.triangles.len())).collect();
    assert_eq!(parts, [("first part", 1), ("", 1), ("empty", 0)]);
    assert_eq!(solids[0].mesh.positions[1].to_array(), [4.0, 2.0, 3.0]);
}

#[test]
fn colours_are_read_in_both_dialects() {
    let [red, green, blue] = [31u16 << 10, 31 << 5, 16];
    let facets = [(SQUARE[0], 0x8000 | red), (SQUARE[1], 0x8000 | green | blue), (SQUARE[0], red)];
    let viscam = read(&binary(b"VisCAM", &facets)).unwrap();
    let colours = viscam[0].mesh.colours.as_ref().unwrap();
    let of = |t: usize| colours[viscam[0].mesh.triangles[t][0] as usize];
    assert_eq!(of(0), Rgb::new(1.0, 0.0, 0.0));
    assert_eq!(of(1), Rgb::new(0.0, 1.0, srgb_to_linear(16.0 / 31.0)));
    assert_eq!(of(2), Rgb::splat(0.5));
    assert_eq!(viscam[0].mesh.positions.len(), 3 + 3 + 3, "a vertex has one colour");

    let magics =
        read(&binary(b"COLOR=\xFF\x80\x00\xFF,MATERIAL=", &[(SQUARE[0], red), (SQUARE[1], 0x8000)])).unwrap();
    let colours = magics[0].mesh.colours.as_ref().unwrap();
    let of = |t: usize| colours[magics[0].mesh.triangles[t][0] as usize];
    assert_eq!(of(0), Rgb::new(0.0, 0.0, 1.0), "red comes first there");
    assert_eq!(of(1), Rgb::new(1.0, srgb_to_linear(128.0 / 255.0), 0.0));
}

#[test]
fn lenient_reads_what_a_file_of_the_wrong_size_has() {
    let mut bytes = binary(b"cut", &[(SQUARE[0], 0), (SQUARE[1], 0)]);
    bytes.truncate(84 + 50 + 20);
    let wrong = read(&bytes).unwrap_err().to_string();
    assert_eq!(wrong, "m.stl:byte 80 /count: file is truncated: 2 facets announced, 1 present");
    let mut said = Diagnostics::with_strictness(Strictness::Lenient);
    let solids = read_stl(&bytes, &name(), &Budget::default(), &mut said).unwrap();
    assert_eq!((solids[0].mesh.triangles.len(), said.warnings()), (1, 1));
}

#[test]
fn a_line_break_after_the_last_facet_is_only_warned_about() {
    let mut bytes = binary(b"edited", &[(SQUARE[0], 0), (SQUARE[1], 0)]);
    bytes.push(b'\n');
    let mut said = Diagnostics::new();
    let solids = read_stl(&bytes, &name(), &Budget::default(), &mut said).unwrap();
    assert_eq!(solids[0].mesh.triangles.len(), 2);
    assert_eq!(
        said.lines(),
        ["warning: m.stl:byte 80 /count: count of facets does not fit the size of the STL file \
          (found 2 facets in 185 bytes; expected 184 bytes, or 2 facets)"]
    );
    bytes.extend([0; 49]);
    assert!(read(&bytes).is_err(), "room for one more");
}

#[test]
fn a_normal_against_its_corners_is_said() {
    let text = "solid\nfacet normal 0 0 -1 outer loop vertex 1 2 3 vertex 4 2 3 vertex 4 5 3 endloop endfacet\nendsolid\n";
    let mut said = Diagnostics::new();
    let solids = read_stl(text.as_bytes(), &name(), &Budget::default(), &mut said).unwrap();
    assert_eq!(solids[0].mesh.triangles, [[0, 1, 2]]);
    assert_eq!(
        said.lines(),
        ["warning: m.stl:2:14: normal of a facet points against its corners, which decide"]
    );
}

#[test]
fn files_of_others_are_read() {
    let Some(folder) = shared("formats/numpy-stl") else { return };
    let mut triangles = std::collections::HashMap::new();
    let mut read = 0;
    for path in files_below(&folder, &[".stl"]) {
        let mut said = Diagnostics::new();
        let scene = open_stl(&path, &Budget::default(), &mut said);
        let Ok(scene) = scene else { continue };
        assert_eq!(scene.up, UpAxis::Z);
        let count: usize = scene
            .shapes
            .iter()
            .map(|s| match &s.geometry {
                lumbre_scene::GeometryDesc::Mesh(mesh) => mesh.triangles.len(),
                _ => 0,
            })
            .sum();
        let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
        // Text and binary versions are the same.
        if let Some(other) = triangles.insert(stem.clone(), count) {
            assert_eq!(other, count, "{stem}");
        }
        read += 1;
    }
    assert!(read >= 11, "{read}");
}

#[test]
fn text_far_from_zero_keeps_its_digits() {
    let far = DVec3::new(500_000.25, 4_649_781.5, 100.125);
    let corners = [far, far + DVec3::new(0.01, 0.0, 0.0), far + DVec3::new(0.0, 0.03, 0.0)];
    let lines: String = corners.iter().map(|p| format!("vertex {} {} {}\n", p.x, p.y, p.z)).collect();
    let text = format!("solid a\nfacet normal 0 0 1\nouter loop\n{lines}endloop\nendfacet\nendsolid a\n");
    let solids = read(text.as_bytes()).unwrap();
    for (found, p) in solids[0].mesh.positions.iter().zip(corners) {
        assert!((found.as_dvec3() + solids[0].origin - p).abs().max_element() < 1e-8);
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.stl");
    std::fs::write(&path, text).unwrap();
    let scene = open_stl(&path, &Budget::default(), &mut Diagnostics::new()).unwrap();
    assert_eq!(scene.shapes[0].world_from_object.point(DVec3::ZERO), solids[0].origin);
}
