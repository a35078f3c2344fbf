//! Damaged files of every kind end in an answer or an error: never in a panic, and never in more memory than
//! 64 MiB and 32 times the input. The damage is the same on every run.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::io::Cursor;
use std::sync::Arc;

use common::{Random, changed};
use lumbre_formats::image::{
    ExrCompression, ExrPrecision, ImageFormat, PngDepth, WriteOptions, encode_image, read_image, read_layers,
};
use lumbre_formats::obj::{read_mtl, read_obj};
use lumbre_formats::ply::read_ply;
use lumbre_formats::stl::read_stl;
use lumbre_formats::{Budget, Diagnostics, Input, Limits, Strictness};
use lumbre_image::{Image, Rgb};

const PLY: &str = "ply\nformat ascii 1.0\ncomment a\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\nelement face 3\n\
    property list uchar int vertex_indices\nproperty int face_indices\nelement tristrips 1\n\
    property list int int vertex_indices\nend_header\n0 0 2 1 2 3 0 0\n4 0 2 1 2 3 1 0\n1 1 2 1 2 3 .5 .5\n0 4 2 1 2 3 0 1\n\
    -2 2 2 9 9 9 1 1\n4 0 1 2 3 7\n3 0 1 2 8\n5 0 1 2 3 4 9\n7 0 1 2 -1 1 2 3\n";

const OBJ: &str = "mtllib a.mtl\no thing\ng part\nv 0 0 2 1 1 1\nv 4 0 2\nv 1 1 2\nv 0 4 2\nvt 0 0\nvt 1 0.5\nvn 0 0 1\nusemtl a\ns 1\n\
    f 1/1/1 2/2/1 3/1/1\nf -4//-1 -3//-1 -2//-1 \\\n -1//-1\nl 1 2\nf 1 2 3 4\nf 5 1 2\nv 9 9 9\n";

const MTL: &str = "newmtl a\nKd 0.1 0.2 0.3\nKe 1 1 1\nNs 20\nd 0.5\nmap_Kd -s 1 2 -o 0 0 -mm 0 1 -clamp on a b.png\n\
    bump -bm 2 b.png -boost 3\nillum 7\nPr .5\n";

const STL: &str = "solid a b\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 4 2 3\nvertex 4 5 3\nendloop\nendfacet\n\
    endsolid a b\nsolid\nendsolid\n";

fn binary_ply(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut out = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty double y\nproperty float z\n\
         element face 2\nproperty list uchar uint vertex_indices\nproperty list ushort float extra\nend_header\n"
    )
    .into_bytes();
    let mut put = |mut bytes: Vec<u8>| {
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    for [x, y] in [[1.0f32, 2.0], [5.0, 2.0], [2.0, 3.0], [1.0, 6.0]] {
        put(x.to_le_bytes().to_vec());
        put(f64::from(y).to_le_bytes().to_vec());
        put(3f32.to_le_bytes().to_vec());
    }
    for face in [&[0u32, 1, 2, 3][..], &[0, 1, 2]] {
        put(vec![face.len() as u8]);
        face.iter().for_each(|i| put(i.to_le_bytes().to_vec()));
        put(1u16.to_le_bytes().to_vec());
        put(0.5f32.to_le_bytes().to_vec());
    }
    out
}

fn binary_stl() -> Vec<u8> {
    let mut out = b"solid binary COLOR=\x10\x20\x30\xFF".to_vec();
    out.resize(80, 0);
    out.extend(3u32.to_le_bytes());
    for i in 0..36 {
        out.extend((i as f32 * 0.5).to_le_bytes());
        if i % 12 == 11 {
            out.extend((0x7C00u16 | (i << 10)).to_le_bytes());
        }
    }
    out
}

fn picture() -> Image {
    let colours = (0..17 * 9).map(|i| Rgb::new(i as f32 / 153.0, (i % 17) as f32 / 17.0, 0.5)).collect();
    let alpha = (0..17 * 9).map(|i| (i % 5) as f32 / 4.0).collect();
    Image::from_pixels(17, 9, colours).unwrap().with_alpha(alpha).unwrap()
}

/// Every kind of image, by its file's name.
fn images() -> Vec<(&'static str, Vec<u8>)> {
    let image = picture();
    let write = |format, options: WriteOptions| encode_image(&image, format, &options).unwrap();
    let plain = WriteOptions::default;
    let exr = |exr_compression, exr_precision| {
        write(
            ImageFormat::Exr,
            changed(plain(), |it| {
                it.exr_compression = exr_compression;
                it.exr_precision = exr_precision;
            }),
        )
    };
    let by_image = |format| {
        let rgb = image::RgbImage::from_fn(17, 9, |x, y| image::Rgb([x as u8, y as u8, 90]));
        let mut out = Cursor::new(vec![]);
        rgb.write_to(&mut out, format).unwrap();
        out.into_inner()
    };
    vec![
        ("8.png", write(ImageFormat::Png, plain())),
        ("16.png", write(ImageFormat::Png, changed(plain(), |it| it.png_depth = PngDepth::Sixteen))),
        ("a.jpg", write(ImageFormat::Jpeg, plain())),
        ("a.hdr", write(ImageFormat::Hdr, plain())),
        ("a.pfm", write(ImageFormat::Pfm, plain())),
        ("none.exr", exr(ExrCompression::None, ExrPrecision::Float)),
        ("rle.exr", exr(ExrCompression::Rle, ExrPrecision::Half)),
        ("zip.exr", exr(ExrCompression::Zip, ExrPrecision::Half)),
        ("piz.exr", exr(ExrCompression::Piz, ExrPrecision::Half)),
        ("a.tga", by_image(image::ImageFormat::Tga)),
        ("a.bmp", by_image(image::ImageFormat::Bmp)),
        ("a.qoi", by_image(image::ImageFormat::Qoi)),
        ("a.webp", by_image(image::ImageFormat::WebP)),
    ]
}

fn meshes() -> Vec<(&'static str, Vec<u8>)> {
    let mut gz = flate2::write::GzEncoder::new(vec![], flate2::Compression::default());
    std::io::Write::write_all(&mut gz, PLY.as_bytes()).unwrap();
    vec![
        ("a.ply", PLY.into()),
        ("little.ply", binary_ply(false)),
        ("big.ply", binary_ply(true)),
        ("a.ply.gz", gz.finish().unwrap()),
        ("a.obj", OBJ.into()),
        ("a.mtl", MTL.into()),
        ("a.stl", STL.into()),
        ("binary.stl", binary_stl()),
    ]
}

/// Reads a file by its name, under the limit that is promised; whether it could be read.
fn read(name: &str, bytes: &[u8], strictness: Strictness) -> bool {
    let limit = (64 << 20) + 32 * bytes.len() as u64;
    let budget = Budget::new(changed(Limits::default(), |it| it.memory = limit));
    let mut said = Diagnostics::with_strictness(strictness);
    let file: Arc<str> = name.into();
    let done = if name.ends_with(".gz") {
        Input::from_reader(name, bytes, &budget)
            .and_then(|input| read_ply(&input, &file, &budget, &mut said).map(drop))
    } else {
        match name.rsplit('.').next().unwrap() {
            "ply" => read_ply(bytes, &file, &budget, &mut said).map(drop),
            "obj" => read_obj(bytes, &file, &budget, &mut said).map(drop),
            "mtl" => read_mtl(bytes, &file, &budget, &mut said).map(drop),
            "stl" => read_stl(bytes, &file, &budget, &mut said).map(drop),
            "exr" if bytes.len() % 2 == 1 => read_layers(bytes, &file, &budget, &mut said).map(drop),
            _ => read_image(bytes, &file, &budget, &mut said)
                .and_then(|image| image.to_image(&budget).map(drop)),
        }
    };
    assert!(budget.memory_peak() <= limit);
    if let Err(error) = &done {
        let line = error.to_diagnostic().to_string();
        assert!(line.starts_with(&format!("error: {name}")) || line.contains("--max-"), "{line}");
        assert!(line.len() < 1000, "{line}");
    }
    done.is_ok()
}

fn damaged(random: &mut Random, bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..=random.below(6) {
        if out.is_empty() {
            break;
        }
        let at = random.below(out.len());
        match random.below(8) {
            0..=2 => out[at] ^= 1 << random.below(8),
            3 => out[at] = [0, 0xFF, 0x80, 0x7F, b'-', b'9', b'\n', b'/'][random.below(8)],
            4 => {
                let end = (at + 4).min(out.len());
                out[at..end].fill(if random.below(2) == 0 { 0xFF } else { 0 });
            }
            5 => {
                out.remove(at);
            }
            6 => {
                let end = (at + random.below(40)).min(out.len());
                let copy = out[at..end].to_vec();
                let to = random.below(out.len());
                out.splice(to..to, copy);
            }
            _ => out.insert(at, random.next() as u8),
        }
    }
    out
}

/// The most memory that this process ever had, where the system says.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_ascii_whitespace().nth(1)?.parse::<u64>().ok().map(|kb| kb << 10)
}

fn fuzz(rounds: usize) {
    let files: Vec<_> = meshes().into_iter().chain(images()).collect();
    for (name, bytes) in &files {
        assert!(read(name, bytes, Strictness::Normal), "{name}");
    }
    let before = peak_memory();
    let mut random = Random(2026);
    let (mut readable, mut all) = (0, 0);
    for (name, bytes) in &files {
        for cut in 0..bytes.len() {
            let strictness = if cut % 2 == 0 { Strictness::Normal } else { Strictness::Lenient };
            readable += u32::from(read(name, &bytes[..cut], strictness));
        }
        for round in 0..rounds {
            let strictness = if round % 3 == 0 { Strictness::Lenient } else { Strictness::Normal };
            readable += u32::from(read(name, &damaged(&mut random, bytes), strictness));
        }
        all += bytes.len() + rounds;
    }
    // Damage must reach the readers' insides: some of it is harmless, and most is not.
    assert!(readable as usize > all / 50 && (readable as usize) < all * 4 / 5, "{readable} of {all}");
    if let (Some(before), Some(after)) = (before, peak_memory()) {
        assert!(after - before < 128 << 20, "{} MiB", (after - before) >> 20);
    }
}

#[test]
fn damaged_files_of_every_kind_end_in_an_answer_or_an_error() {
    fuzz(2000);
}

/// Minutes of it: run with `--ignored`.
#[test]
#[ignore = "takes minutes"]
fn damaged_files_of_every_kind_for_long() {
    fuzz(100_000);
}
