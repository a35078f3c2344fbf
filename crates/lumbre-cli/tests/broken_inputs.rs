//! Broken inputs that only show through the program: what it says, and the status that it ends with.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const HEAD: &str = "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 12\n\
                    Sampler \"sobol\" \"integer pixelsamples\" 1\nLookAt 0 -8 3 0 0 0 0 0 1\nCamera \"perspective\"\n\
                    WorldBegin\nLightSource \"infinite\"\n";

/// A file, what its first line of error says (after `error: ` and its name), and the status.
struct Case {
    name: &'static str,
    text: Vec<u8>,
    said: &'static str,
    status: i32,
}

fn case(name: &'static str, text: impl AsRef<[u8]>, said: &'static str, status: i32) -> Case {
    Case { name, text: text.as_ref().to_vec(), said, status }
}

/// A scene with something after its seven lines of a good beginning.
fn after_head(name: &'static str, text: &str, said: &'static str, status: i32) -> Case {
    case(name, format!("{HEAD}{text}"), said, status)
}

fn wide(text: &str) -> Vec<u8> {
    let mut bytes = vec![0xFF, 0xFE];
    bytes.extend(text.encode_utf16().flat_map(u16::to_le_bytes));
    bytes
}

fn cases() -> Vec<Case> {
    let mut doubled = String::from("ObjectBegin \"o0\"\nShape \"sphere\"\nObjectEnd\n");
    for i in 1..=40 {
        let inner = i - 1;
        doubled += &format!(
            "ObjectBegin \"o{i}\"\nShape \"csg\" \"string operands\" [\"o{inner}\" \"o{inner}\"]\nObjectEnd\n"
        );
    }
    vec![
        case("empty.pbrt", "", ":1:1: the scene has no WorldBegin", 3),
        case("empty.obj", "", ": not an OBJ file, or one without vertices", 3),
        case("empty.ply", "", ":1:1: not a PLY file", 3),
        case("empty.stl", "", ": not an STL file", 3),
        case("empty.gltf", "", ": empty file", 3),
        case("wide.pbrt", wide(HEAD), ":1:1: unsupported text encoding (found UTF-16", 3),
        case("wide.ply", wide("ply\n"), ":1:1: unsupported text encoding (found UTF-16", 3),
        case("wide.stl", wide("solid\n"), ":1:1: unsupported text encoding (found UTF-16", 3),
        case("zeros.obj", [0; 100], ": not an OBJ file", 3),
        case("zeros.pbrt", [0; 100], ":1:1: stray byte (found 0x00", 3),
        after_head("doubled.pbrt", &doubled, ":59:13: more than 65536 solids are combined into one", 3),
        after_head(
            "far.pbrt",
            "Scale 1e150 1e150 1e150\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n",
            ":8:1: the current transform takes a vertex too far away (found 1e150",
            3,
        ),
        after_head(
            "torus.pbrt",
            "Shape \"torus\" \"float majorradius\" 1e300\n",
            ":7:15: parameter \"majorradius\" of shape \"torus\" is out of range (found 1e300; expected",
            3,
        ),
        after_head(
            "light.pbrt",
            "LightSource \"point\" \"float scale\" 1e38 \"rgb I\" [1e38 1 1]\n",
            ": light 1: its place or intensity is not finite",
            3,
        ),
        after_head(
            "texture.pbrt",
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"no.png\"\n\
             Material \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"\n",
            ":7:35: no.png: cannot open",
            3,
        ),
        after_head(
            "include.pbrt",
            "Include \"/dev/zero\"\n",
            ":7:9: /dev/zero: cannot read: it is not a regular file",
            3,
        ),
        after_head("cycle.pbrt", "Include \"cycle.pbrt\"\n", ":7:9: a file includes itself", 3),
        after_head(
            "deep.pbrt",
            &"AttributeBegin\n".repeat(300),
            ":263:1: AttributeBegin: needs 257 levels of nesting, limit 256; raise it with --max-nesting",
            5,
        ),
        after_head(
            "crlf.pbrt",
            "\r\n\r\nShape \"disk\" \"float radius\" 0\r\n",
            ":9:14: parameter \"radius\"",
            3,
        ),
    ]
}

fn lumbre(folder: &std::path::Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

#[test]
fn broken_files_are_refused_with_what_is_wrong_and_where() {
    let desk = tempfile::tempdir().unwrap();
    let mut wrong = String::new();
    for Case { name, text, said, status } in cases() {
        fs::write(desk.path().join(name), text).unwrap();
        for arguments in [&["render", name, "-o", "o.png"][..], &["info", "--json", name]] {
            let start = Instant::now();
            let out = lumbre(desk.path(), arguments);
            let message = String::from_utf8_lossy(&out.stderr).into_owned();
            let expected = format!("error: {name}{said}");
            if !message.starts_with(&expected) || out.status.code() != Some(status) {
                wrong += &format!("{arguments:?}: {:?} {message}  not {expected}\n", out.status.code());
            }
            assert!(start.elapsed() < Duration::from_secs(30), "{name}");
        }
        assert!(!desk.path().join("o.png").exists(), "{name} left a picture");
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn absurd_arguments_are_refused_before_any_work() {
    let desk = tempfile::tempdir().unwrap();
    fs::write(desk.path().join("a.pbrt"), format!("{HEAD}Shape \"sphere\"\n")).unwrap();
    for arguments in [
        &["--threads", "65535"][..],
        &["--threads", "0"],
        &["--exposure", "nan"],
        &["--exposure", "inf"],
        &["--time", "0"],
        &["--time", "nan"],
        &["--noise", "nan"],
        &["--size", "65536x65536"],
        &["--size", "2147483647x1"],
        &["--crop", "100,100,200,200"],
        &["--camera", "back"],
        &["-o", "/dev/full"],
        &["-o", "o.gif"],
    ] {
        let out = lumbre(desk.path(), &[&["render", "a.pbrt", "--spp", "1"], arguments].concat());
        let message = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    }
}

#[cfg(unix)]
#[test]
fn a_full_standard_output_is_an_error_and_a_closed_one_is_none() {
    let desk = tempfile::tempdir().unwrap();
    fs::write(desk.path().join("a.pbrt"), format!("{HEAD}Shape \"sphere\"\n")).unwrap();
    let run = |arguments: &str, out: &str| {
        let program = env!("CARGO_BIN_EXE_lumbre");
        let script = format!("set -o pipefail; {program} {arguments} {out}");
        Command::new("bash").args(["-c", &script]).current_dir(desk.path()).output().unwrap()
    };
    for arguments in ["info a.pbrt", "info --json a.pbrt"] {
        let full = run(arguments, "> /dev/full");
        assert_eq!(full.status.code(), Some(4), "{}", String::from_utf8_lossy(&full.stderr));
        let closed = run(arguments, "| true");
        assert_eq!(closed.status.code(), Some(0), "{}", String::from_utf8_lossy(&closed.stderr));
    }
    // Nobody hears the warnings and the summary, and the picture is made.
    let deaf = run("render a.pbrt -o deaf.png --spp 1 -v", "2> /dev/full");
    assert_eq!(deaf.status.code(), Some(0));
    assert!(desk.path().join("deaf.png").exists());
}
