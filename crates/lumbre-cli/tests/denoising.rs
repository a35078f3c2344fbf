//! `--denoise`: what is saved, and what is said.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::process::{Command, Stdio};

use lumbre::formats::{Budget, Diagnostics, Limits};

use crate::program::{Desk, SPHERE, code, stderr};

fn has(bytes: &[u8], words: &[u8]) -> bool {
    bytes.windows(words.len()).any(|at| at == words)
}

#[test]
fn an_exr_keeps_the_noisy_picture_and_names_the_denoiser() {
    let desk = Desk::new();
    desk.write("sphere.pbrt", SPHERE);
    let noisy = desk.lumbre(&["sphere.pbrt", "-o", "noisy.exr"]);
    assert_eq!(code(&noisy), 0, "{}", stderr(&noisy));
    let out = desk.lumbre(&["--denoise", "sphere.pbrt", "-o", "clean.exr", "--aov", "albedo"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    assert!(stderr(&out).lines().last().unwrap().contains(", denoised in "), "{}", stderr(&out));
    assert!(stderr(&out).contains("(own filter)"), "{}", stderr(&out));
    assert!(!stderr(&noisy).contains("denoised"), "{}", stderr(&noisy));

    let layers = |name: &str| {
        let budget = Budget::new(Limits::default());
        let path = desk.path(name);
        lumbre::formats::image::open_image(&path, &budget, &mut Diagnostics::new()).unwrap()
    };
    let names = |name: &str| fs::read(desk.path(name)).unwrap();
    for channel in ["noisy.R", "noisy.G", "noisy.B", "albedo.R", "denoiser"] {
        assert!(has(&names("clean.exr"), channel.as_bytes()), "{channel}");
    }
    assert!(!has(&names("noisy.exr"), b"noisy.R") && !has(&names("noisy.exr"), b"denoiser"));
    let colours = |name: &str| layers(name).to_image(&Budget::new(Limits::default())).unwrap();
    let difference = |a: &str, b: &str| -> f32 {
        let (a, b) = (colours(a), colours(b));
        a.pixels()
            .iter()
            .zip(b.pixels())
            .map(|(&a, &b)| (a - b).map(f32::abs).max_component())
            .fold(0.0, f32::max)
    };
    assert!(difference("clean.exr", "noisy.exr") > 1e-3);

    let none = desk.lumbre(&["sphere.pbrt", "-o", "none.exr", "--denoise", "none"]);
    assert_eq!(code(&none), 0, "{}", stderr(&none));
    assert_eq!(fs::read(desk.path("none.exr")).unwrap(), fs::read(desk.path("noisy.exr")).unwrap());
}

#[test]
fn a_png_shows_the_picture_without_noise() {
    let desk = Desk::new();
    desk.write("sphere.pbrt", SPHERE);
    for (name, arguments) in [("a.png", &["--denoise"][..]), ("b.png", &["--denoise=own", "--threads", "3"])]
    {
        let all = [&["sphere.pbrt", "-o", name], arguments].concat();
        let out = desk.lumbre(&all);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        assert!(has(&fs::read(desk.path(name)).unwrap(), b"Denoiser\0Lumbre"));
    }
    assert_eq!(fs::read(desk.path("a.png")).unwrap(), fs::read(desk.path("b.png")).unwrap());
}

#[test]
fn a_missing_denoiser_is_reported_before_rendering() {
    let desk = Desk::new();
    desk.write("sphere.pbrt", SPHERE);
    fs::create_dir(desk.path("empty")).unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(["sphere.pbrt", "-o", "out.png", "--denoise", "oidn"])
        .env("OIDN_DIR", desk.path("empty"))
        // No python3 here.
        .env("PATH", desk.path("empty"))
        .current_dir(desk.folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    if code(&out) == 0 {
        println!("skipped: the system has Open Image Denoise");
        return;
    }
    assert_eq!(code(&out), 2, "{}", stderr(&out));
    let message = stderr(&out);
    assert!(message.starts_with("error: --denoise oidn: "), "{message}");
    assert!(message.contains("OIDN_DIR") && message.contains("pip install pyoidn"), "{message}");
    assert!(!desk.path("out.png").exists());
}

/// A triangle and a camera.
const GLTF: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
"nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 1, 9]}],
"cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-3, 0, 0], "max": [4, 2, 0]}],
"bufferViews": [{"buffer": 0, "byteLength": 36}],
"buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AABAwAAAAAAAAAAAAACAQAAAAAAAAAAAAAAAAAAAAEAAAAAA"}]}"#;

#[test]
fn studio_models_are_denoised_with_few_samples_by_default() {
    let desk = Desk::new();
    desk.write("a.obj", "v -3 0 0\nv 4 0 0\nv 4 2 1\nv -3 2 1\nf 1 2 3 4\n");
    desk.write("sphere.pbrt", SPHERE);
    desk.write("own.gltf", GLTF);
    for (arguments, samples, is_denoised) in [
        (&["a.obj"][..], " 16 samples", true),
        (&["a.obj", "--denoise"], " 16 samples", true),
        (&["a.obj", "--denoise", "none"], " 64 samples", false),
        (&["a.obj", "--spp", "3"], " 3 samples", true),
        (&["a.obj", "--spp", "3", "--denoise", "none"], " 3 samples", false),
        (&["a.obj", "--noise", "0.5", "--min-spp", "5"], " 5 to ", true),
        (&["a.obj", "--spp", "99999", "--time", "300ms"], " samples", true),
        (&["own.gltf"], " 16 samples", true),
        (&["a.obj", "--env", "none"], " 64 samples", false),
        (&["a.obj", "--integrator", "normals"], " 64 samples", false),
        (&["sphere.pbrt"], " 4 samples", false),
    ] {
        let out = desk.lumbre(&[arguments, &["--size", "24x18", "-o", "out.png"]].concat());
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let said = stderr(&out);
        let last = said.lines().last().unwrap();
        assert!(last.contains(samples) && last.contains("denoised") == is_denoised, "{arguments:?}: {last}");
    }
}

#[test]
fn pictures_of_features_are_not_filtered() {
    let desk = Desk::new();
    desk.write("sphere.pbrt", SPHERE);
    let out = desk.lumbre(&["sphere.pbrt", "--integrator", "normals", "--denoise", "own", "-o", "out.png"]);
    assert_eq!(code(&out), 2, "{}", stderr(&out));
    assert!(stderr(&out).contains("--denoise is for pictures of light"), "{}", stderr(&out));
    assert!(!desk.path("out.png").exists());
}
