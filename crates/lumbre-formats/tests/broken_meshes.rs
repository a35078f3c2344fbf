//! What is said about broken meshes and images: each file with its whole message.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::changed;
use lumbre_formats::image::{ImageFormat, WriteOptions, encode_image, read_image};
use lumbre_formats::obj::{read_mtl, read_obj};
use lumbre_formats::ply::read_ply;
use lumbre_formats::stl::read_stl;
use lumbre_formats::{Budget, Diagnostics, FormatError, Limits};
use lumbre_image::{Image, Rgb};

fn read(name: &str, bytes: &[u8]) -> Result<(), FormatError> {
    let file: Arc<str> = name.into();
    let budget = Budget::new(changed(Limits::default(), |it| {
        it.memory = 4 << 20;
        it.elements = 100_000;
    }));
    let mut said = Diagnostics::new();
    match name.rsplit('.').next().unwrap() {
        "ply" => read_ply(bytes, &file, &budget, &mut said).map(drop),
        "obj" => read_obj(bytes, &file, &budget, &mut said).map(drop),
        "mtl" => read_mtl(bytes, &file, &budget, &mut said).map(drop),
        "stl" => read_stl(bytes, &file, &budget, &mut said).map(drop),
        _ => read_image(bytes, &file, &budget, &mut said).map(drop),
    }
}

const VERTICES: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
const FACES: &str = "element face 1\nproperty list uchar int vertex_indices\n";
const CORNERS: &str = "1 1 5\n4 1 5\n4 3 5\n";

fn ply(header: &str, body: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\n{header}end_header\n{body}").into_bytes()
}

fn binary_ply(header: &str, body: &[u8]) -> Vec<u8> {
    let mut out = format!("ply\nformat binary_little_endian 1.0\n{header}end_header\n").into_bytes();
    out.extend(body);
    out
}

/// Three vertices, then what follows.
fn binary_triangle(more: &[u8]) -> Vec<u8> {
    let floats = [1f32, 1., 5., 4., 1., 5., 4., 3., 5.];
    let body: Vec<u8> = floats.into_iter().flat_map(f32::to_le_bytes).chain(more.iter().copied()).collect();
    binary_ply(&format!("{VERTICES}{FACES}"), &body)
}

fn binary_stl(count: u32, facets: usize, first: f32) -> Vec<u8> {
    let mut out = vec![b' '; 80];
    out.extend(count.to_le_bytes());
    for _ in 0..facets {
        out.extend([0; 12]);
        for v in [first, 2., 3., 4., 2., 3., 4., 5., 3.] {
            out.extend(v.to_le_bytes());
        }
        out.extend([0; 2]);
    }
    out
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    encode_image(&Image::filled(6, 4, Rgb::new(0.2, 0.4, 0.6)), format, &WriteOptions::default()).unwrap()
}

/// A PNG whose header says another size.
fn png_of_size(width: u32, height: u32) -> Vec<u8> {
    let mut out = encoded(ImageFormat::Png);
    out[16..20].copy_from_slice(&width.to_be_bytes());
    out[20..24].copy_from_slice(&height.to_be_bytes());
    // The checksum of the header, so that nothing else is wrong with it.
    let mut crc = flate2::Crc::new();
    crc.update(&out[12..29]);
    out[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    out
}

fn obj(text: &str) -> Vec<u8> {
    format!("v 1 1 5\nv 4 1 5\nv 4 3 5\n{text}").into_bytes()
}

#[test]
fn every_broken_file_gets_its_message() {
    let long = "x".repeat(5000);
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        // PLY headers.
        ("a.ply", b"".to_vec(), "a.ply:1:1: not a PLY file (found \"\"; expected a line \"ply\")"),
        ("a.ply", b"plyx\n".to_vec(), "a.ply:1:1: not a PLY file (found \"plyx\"; expected a line \"ply\")"),
        (
            "a.ply",
            b"ply\nformat ascii 1.0\nelement vertex 3\n".to_vec(),
            "a.ply:4:1: PLY header without end_header (found \"\"; expected a line)",
        ),
        (
            "a.ply",
            b"ply\nformat binary_middle_endian 1.0\n".to_vec(),
            "a.ply:2:8: unknown PLY format (found \"binary_middle_endian\"; expected ascii, binary_little_endian or binary_big_endian)",
        ),
        (
            "a.ply",
            b"ply\nformat ascii 2.0\n".to_vec(),
            "a.ply:2:14: unknown PLY version (found \"2.0\"; expected 1.0)",
        ),
        ("a.ply", b"ply\nend_header\n".to_vec(), "a.ply:1:1: PLY header without a format line"),
        (
            "a.ply",
            ply("element vertex 1e18\n", ""),
            "a.ply:3:16: wrong count of elements (found \"1e18\"; expected a whole number)",
        ),
        (
            "a.ply",
            ply("element vertex -3\n", ""),
            "a.ply:3:16: wrong count of elements (found \"-3\"; expected a whole number)",
        ),
        (
            "a.ply",
            ply(&VERTICES.replace('3', "1000000000000000000"), CORNERS),
            "a.ply:3:16: file is truncated: 1000000000000000000 vertices announced, room for 3",
        ),
        (
            "a.ply",
            ply("property float x\n", ""),
            "a.ply:3:1: property before any element (found \"property float x\")",
        ),
        (
            "a.ply",
            ply("element vertex 3\nproperty flaot x\n", ""),
            "a.ply:4:10: unknown type of number (found \"flaot\"; did you mean \"float\"?)",
        ),
        (
            "a.ply",
            ply("element face 3\nproperty list float int vertex_indices\n", ""),
            "a.ply:4:15: a list's length is not whole (found \"float\"; expected a type of whole numbers)",
        ),
        (
            "a.ply",
            ply("elemnt vertex 3\n", ""),
            "a.ply:3:1: unknown line in PLY header (found \"elemnt\"; did you mean \"element\"?)",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{VERTICES}"), ""),
            "a.ply:7:9: second element of this name (found \"vertex\")",
        ),
        ("a.ply", ply(FACES, ""), "a.ply: PLY file without vertices (expected an element \"vertex\")"),
        (
            "a.ply",
            ply("element vertex 3\nproperty float x\nproperty float z\n", CORNERS),
            "a.ply:3:16: vertices without a property \"y\"",
        ),
        (
            "a.ply",
            ply(
                &format!("{VERTICES}element face 1\nproperty list uchar int vertex_indexes\n"),
                &format!("{CORNERS}3 0 1 2\n"),
            ),
            "a.ply:7:14: faces without a list of vertices (found property \"vertex_indexes\"; expected property list uchar int vertex_indices)",
        ),
        // PLY bodies.
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), "1 1 5\n4 1 x5\n4 3 5\n3 0 1 2"),
            "a.ply:11:5: not a number in vertex 1, property z (found \"x5\")",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), "1 1 5\n4 1 5\n4 nan 5\n3 0 1 2"),
            "a.ply:12:1: vertex 2 is not finite (found (4, NaN, 5))",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), "1 1 5\n4 1e400 5\n4 3 5\n3 0 1 2"),
            "a.ply:11:1: vertex 1 is not finite (found (4, inf, 5))",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), &format!("{CORNERS}3 0 1 3\n")),
            "a.ply:13:1: face 0 has a vertex that does not exist (found 3; expected 0 to 2)",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), &format!("{CORNERS}3 0 -1 2\n")),
            "a.ply:13:1: face 0 has a vertex that does not exist (found -1; expected 0 to 2)",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), &format!("{CORNERS}-3 0 1 2\n")),
            "a.ply:13:1: a list's length is negative or more than the file holds in face 0, property vertex_indices (found \"-3\")",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), &format!("{CORNERS}2.5 0 1 2\n")),
            "a.ply:13:1: not a whole number in face 0, property vertex_indices (found \"2.5\")",
        ),
        (
            "a.ply",
            ply(&format!("{VERTICES}{FACES}"), &format!("{CORNERS}4 0 1 2\n")),
            "a.ply:14:1: file is truncated in face 0, property vertex_indices (found the end of the file)",
        ),
        (
            "a.ply",
            binary_triangle(&[3, 0, 0, 0, 0, 1, 0, 0, 0, 9, 0, 0, 0]),
            "a.ply:byte 205 /face/0/vertex_indices: face 0 has a vertex that does not exist (found 9; expected 0 to 2)",
        ),
        (
            "a.ply",
            binary_triangle(&[3, 0, 0, 0, 0]),
            "a.ply:byte 205 /face/0/vertex_indices: a list's length is negative or more than the file holds (found 3)",
        ),
        (
            "a.ply",
            binary_ply(&format!("{VERTICES}{FACES}"), &[0; 35]),
            "a.ply:3:16: file is truncated: 3 vertices announced, room for 2",
        ),
        (
            "a.ply",
            binary_ply(VERTICES, &[0xFF; 36]),
            "a.ply:byte 115 /vertex/0/x: vertex 0 is not finite (found (NaN, NaN, NaN))",
        ),
        (
            "a.ply",
            ply(
                "element vertex 200000\nproperty uchar x\nproperty uchar y\nproperty uchar z\n",
                &"1 2 3\n".repeat(200_000),
            ),
            "a.ply:3:16: PLY elements: needs 200000 elements, limit 100000; raise it with --max-elements",
        ),
        (
            "a.ply",
            ply(
                "element vertex 99000\nproperty double x\nproperty double y\nproperty double z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float u\nproperty float v\nproperty float r\nproperty float g\nproperty float b\n",
                &"1 2 3 1 2 3 1 2 1 2 3\n".repeat(99_000),
            ),
            "a.ply: texture coordinates: needs 4356000 bytes of memory, limit 4194304; raise it with --max-memory",
        ),
        // OBJ and MTL.
        (
            "a.obj",
            obj("f 1 0 2\n"),
            "a.obj:4:5: face with a vertex that does not exist (found 0; expected 1 to 3, or -3 to -1)",
        ),
        (
            "a.obj",
            obj("f 1 2 -99999\n"),
            "a.obj:4:7: face with a vertex that does not exist (found -99999; expected 1 to 3, or -3 to -1)",
        ),
        (
            "a.obj",
            obj("f 1 2 9223372036854775808\n"),
            "a.obj:4:7: face with a vertex that does not exist (found 9223372036854775808; expected 1 to 3, or -3 to -1)",
        ),
        (
            "a.obj",
            obj("\r\nf 1 \\\n 2 7\n"),
            "a.obj:6:4: face with a vertex that does not exist (found 7; expected 1 to 3, or -3 to -1)",
        ),
        (
            "a.obj",
            obj("f 1 2 x\n"),
            "a.obj:4:7: wrong corner of a face (found \"x\"; expected v, v/vt, v//vn or v/vt/vn)",
        ),
        (
            "a.obj",
            obj("f 1/2/3/4 2 3\n"),
            "a.obj:4:3: wrong corner of a face (found \"1/2/3/4\"; expected v, v/vt, v//vn or v/vt/vn)",
        ),
        (
            "a.obj",
            obj("vt 0 0\nf 1/2 2/1 3/1\n"),
            "a.obj:5:5: face with a texture coordinate that does not exist (found 2; expected 1 or -1)",
        ),
        (
            "a.obj",
            obj("v 1 2\n"),
            "a.obj:4:1: wrong number of values after v (found 2; expected 3, 4, 6 or 7)",
        ),
        ("a.obj", obj("v 1 2 3,5\n"), "a.obj:4:7: not a number (found \"3,5\")"),
        ("a.obj", obj("v 1 1e400 3\n"), "a.obj:4:3: vertex 4 is not finite (found (1, inf, 3))"),
        ("a.obj", obj("v nan 2 3\n"), "a.obj:4:3: vertex 4 is not finite (found (NaN, 2, 3))"),
        ("a.obj", obj("vn 0 1\n"), "a.obj:4:1: wrong number of values after vn (found 2; expected 3)"),
        (
            "a.mtl",
            b"newmtl a\nKd 1 2\n".to_vec(),
            "a.mtl:2:1: wrong number of values of a colour (found 2; expected 1 or 3)",
        ),
        ("a.mtl", b"newmtl a\nNs inf\n".to_vec(), "a.mtl:2:4: not finite (found \"inf\")"),
        ("a.mtl", b"newmtl a\nmap_Kd -mm 0 x.png\n".to_vec(), "a.mtl:2:14: not a number (found \"x.png\")"),
        // STL.
        (
            "a.stl",
            b"".to_vec(),
            "a.stl: not an STL file (found 0 bytes; expected \"solid\", or at least 84 bytes)",
        ),
        (
            "a.stl",
            binary_stl(9, 2, 1.0),
            "a.stl:byte 80 /count: file is truncated: 9 facets announced, 2 present",
        ),
        (
            "a.stl",
            binary_stl(u32::MAX, 1, 1.0),
            "a.stl:byte 80 /count: file is truncated: 4294967295 facets announced, 1 present",
        ),
        (
            "a.stl",
            binary_stl(2, 2, f32::NAN),
            "a.stl:byte 96 /facet/0/vertex/0: facet 0 has a vertex that is not finite (found (NaN, 2, 3))",
        ),
        (
            "a.stl",
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertx 1 2 3".to_vec(),
            "a.stl:4:1: unexpected word in STL file (found \"vertx\"; expected vertex)",
        ),
        (
            "a.stl",
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2".to_vec(),
            "a.stl:4:11: file is truncated (expected a number)",
        ),
        ("a.stl", b"solid a\n".to_vec(), "a.stl:2:1: file is truncated (expected facet or endsolid)"),
        // Images.
        (
            "a.png",
            b"".to_vec(),
            "a.png: not an image that can be read (found an empty file; expected PNG, JPEG, EXR, HDR, PFM, TGA, BMP, QOI or WebP)",
        ),
        (
            "a.png",
            b"GIF89a".to_vec(),
            "a.png: not an image that can be read (found a GIF image; expected PNG, JPEG, EXR, HDR, PFM, TGA, BMP, QOI or WebP)",
        ),
        (
            "a.png",
            b"RIFF\x10\0\0\0WEBPVP8 ".to_vec(),
            "a.png:byte 12: damaged WebP image: failed to fill whole buffer",
        ),
        (
            "a.png",
            png_of_size(0x7FFF_FFFF, 0x7FFF_FFFF),
            "a.png:byte 16: PNG image of an impossible size (found 2147483647 by 2147483647 pixels in 130 bytes)",
        ),
        // The pixels stand behind the signature, the header and the rendering intent.
        ("a.png", png_of_size(120, 90), "a.png:byte 73: damaged PNG image: "),
        ("a.png", encoded(ImageFormat::Png)[..60].to_vec(), "a.png:byte 46: damaged PNG image: "),
        ("a.exr", encoded(ImageFormat::Exr)[..60].to_vec(), "a.exr:byte 60: damaged EXR image: "),
        (
            "a.pfm",
            b"PF\n0 4\n-1.0\n".to_vec(),
            "a.pfm:byte 3: wrong width in PFM header (found \"0\"; expected a whole number from 1)",
        ),
        (
            "a.pfm",
            b"PF\n6 4\n0\n".to_vec(),
            "a.pfm:byte 7: wrong scale in PFM header (found \"0\"; expected a number that is not 0)",
        ),
        (
            "a.pfm",
            b"PF\n6 4\n-1\n1234".to_vec(),
            "a.pfm:byte 10: PFM image is truncated (found 4 bytes of pixels; expected 288 for 6 by 4)",
        ),
        (
            "a.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 4 +X 6\n".to_vec(),
            "a.hdr:byte 11: unsupported HDR format (found \"32-bit_rle_xyze\"; expected 32-bit_rle_rgbe)",
        ),
        (
            "a.hdr",
            b"#?RADIANCE\n\n+X 6 -Y 4\n".to_vec(),
            "a.hdr:byte 12: unsupported HDR resolution (found \"+X 6 -Y 4\"; expected -Y HEIGHT +X WIDTH)",
        ),
        ("a.hdr", b"#?RADIANCE\n\n-Y 4 +X 6\nabcd".to_vec(), "a.hdr:byte 26 /row/0: HDR image is truncated"),
        (
            "a.hdr",
            format!("#?RADIANCE\n{long}").into_bytes(),
            "a.hdr:byte 11: HDR header without an end (expected a line of at most 4096 bytes)",
        ),
        (
            "a.hdr",
            b"#?RADIANCE\n\n-Y 70000 +X 70000\nabcd".to_vec(),
            "a.hdr:byte 30: HDR image of an impossible size (found 70000 by 70000 pixels in 34 bytes)",
        ),
    ];
    assert!(cases.len() >= 60, "{}", cases.len());
    let mut wrong = vec![];
    for (name, bytes, expected) in &cases {
        let said = match read(name, bytes) {
            Ok(()) => "it was read".to_owned(),
            Err(error) => error.to_diagnostic().to_string(),
        };
        let expected = format!("error: {expected}");
        let is_start = expected.ends_with("(found ") || expected.ends_with(" image: ");
        let fits = if is_start { said.starts_with(&expected) } else { said == expected };
        if !fits {
            wrong.push(format!("\n    said {said}\nexpected {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.concat());
}
