//! The program as a person or a script meets it.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

pub(crate) const SPHERE: &str = r#"
Film "rgb" "integer xresolution" 48 "integer yresolution" 32 "string filename" "sphere.png"
Sampler "sobol" "integer pixelsamples" 4
LookAt 0 -8 3  0 0 0  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.6 0.7 0.8]
Material "diffuse" "rgb reflectance" [0.7 0.4 0.2]
Shape "sphere" "float radius" 1.75 "point3 center" [0.25 0 0.5]
"#;

pub(crate) struct Desk {
    pub(crate) folder: TempDir,
}

impl Desk {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) -> PathBuf {
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    pub(crate) fn lumbre(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_lumbre"))
            .args(arguments)
            .current_dir(self.folder.path())
            .stdin(Stdio::null())
            .output()
            .unwrap()
    }
}

pub(crate) fn code(output: &Output) -> i32 {
    output.status.code().expect("no signal ended it")
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn every_command_has_help_with_an_example() {
    let desk = Desk::new();
    for command in ["render", "cast", "info", "diff", "math", "completions", "man"] {
        let help = desk.lumbre(&[command, "--help"]);
        assert_eq!(code(&help), 0);
        assert!(stdout(&help).contains(&format!("  lumbre {command} ")), "{command}: {}", stdout(&help));
    }
}

#[test]
fn a_scene_renders_under_its_own_film_name() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    let out = desk.lumbre(&["render", "scene.pbrt"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    assert!(fs::read(desk.path("sphere.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn each_extension_makes_its_format_of_the_same_picture() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    for name in ["a.exr", "a.png", "a.hdr", "a.pfm", "a.jpg", "a.webp", "a.qoi"] {
        let out = desk.lumbre(&["render", "scene.pbrt", "-o", name, "-q"]);
        assert_eq!(code(&out), 0, "{name}: {}", stderr(&out));
        let difference = desk.lumbre(&["diff", name, "a.exr", "--metric", "mae"]);
        assert_eq!(code(&difference), 0, "{name}: {}", stderr(&difference));
        let value: f64 = stdout(&difference).trim().parse().unwrap();
        assert!(value < 0.02, "{name}: {value}");
    }
    let same = desk.lumbre(&["diff", "a.webp", "a.png", "--metric", "max"]);
    assert_eq!(stdout(&same), "0\n", "{}", stderr(&same));
    let out = desk.lumbre(&["render", "scene.pbrt", "-o", "a.tiff"]);
    assert_eq!(code(&out), 2, "{}", stderr(&out));
    assert!(stderr(&out).contains(".exr"), "{}", stderr(&out));
}

#[test]
fn statistics_have_what_scripts_rely_on() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    let out =
        desk.lumbre(&["render", "scene.pbrt", "-o", "a.png", "--stats", "stats.json", "--threads", "2"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let stats: Value = serde_json::from_slice(&fs::read(desk.path("stats.json")).unwrap()).unwrap();
    for phase in ["load", "build", "render", "save"] {
        assert!(stats["seconds"][phase].as_f64().unwrap() >= 0.0, "{stats}");
    }
    assert_eq!((stats["width"].as_u64(), stats["height"].as_u64()), (Some(48), Some(32)));
    assert_eq!((stats["spp"].as_u64(), stats["threads"].as_u64()), (Some(4), Some(2)));
    assert_eq!(stats["rays"]["camera"].as_u64(), Some(48 * 32 * 4));
    assert!(stats["rays"]["bounce"].as_u64().unwrap() > 0 && stats["rays"]["shadow"].as_u64().unwrap() > 0);
    assert!(stats["paths_per_second"].as_f64().unwrap() > 0.0);
    assert_eq!(stats["build"]["primitives"].as_u64(), Some(1));
    assert!(stats["build"]["primitives_per_second"].as_f64().is_some());
    assert!(stats["build"]["bytes_per_primitive"].as_f64().is_some());
    assert!(stats["peak_memory_bytes"].as_u64().unwrap() > 100_000);
    assert_eq!(stats["dropped_samples"].as_u64(), Some(0));
    assert!(stats["warnings"].as_array().unwrap().is_empty());
}

#[test]
fn options_win_over_the_scene() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    let out = desk.lumbre(&[
        "render",
        "scene.pbrt",
        "-o",
        "a.exr",
        "--size",
        "30x20",
        "--spp",
        "2",
        "--integrator",
        "normals",
        "--stats",
        "s.json",
    ]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let stats: Value = serde_json::from_slice(&fs::read(desk.path("s.json")).unwrap()).unwrap();
    assert_eq!((stats["width"].as_u64(), stats["height"].as_u64()), (Some(30), Some(20)));
    assert_eq!((stats["spp"].as_u64(), stats["rays"]["shadow"].as_u64()), (Some(2), Some(0)));
    let out = desk.lumbre(&["render", "scene.pbrt", "-o", "a.exr", "--integrator", "normal"]);
    assert_eq!(code(&out), 2);
    assert!(stderr(&out).contains("normals"), "{}", stderr(&out));
}

#[test]
fn a_crop_has_the_pixels_of_the_whole() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    assert_eq!(code(&desk.lumbre(&["render", "scene.pbrt", "-o", "whole.pfm", "-q"])), 0);
    assert_eq!(
        code(&desk.lumbre(&["render", "scene.pbrt", "-o", "part.pfm", "--crop", "10,5,31,19", "-q"])),
        0
    );
    let read = |name: &str| {
        let image = lumbre::read_image(&desk.path(name)).unwrap();
        (image.width(), image.height(), image)
    };
    let (_, _, whole) = read("whole.pfm");
    let (width, height, part) = read("part.pfm");
    assert_eq!((width, height), (21, 14));
    for y in 0..height {
        for x in 0..width {
            assert_eq!(part.pixel(x, y), whole.pixel(x + 10, y + 5), "({x}, {y})");
        }
    }
}

#[test]
fn a_scene_file_without_light_is_black_and_that_is_said() {
    let desk = Desk::new();
    let dark = "Film \"rgb\" \"integer xresolution\" 9 \"integer yresolution\" 6\nLookAt 3 -9 4 3 0 1 0 0 1\n\
        Camera \"perspective\"\nWorldBegin\nTranslate 3 0 1\nShape \"sphere\"\n";
    desk.write("dark.pbrt", dark);
    let out = desk.lumbre(&["render", "dark.pbrt", "-o", "dark.pfm", "--spp", "2", "--progress", "none"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    assert!(
        stderr(&out).contains("warning: dark.pbrt: the scene has no light: its picture is black"),
        "{}",
        stderr(&out)
    );
    let picture = lumbre::read_image(&desk.path("dark.pfm")).unwrap();
    assert!(picture.pixels().iter().all(|p| p.to_array() == [0.0; 3]));
    let strict = desk.lumbre(&["render", "dark.pbrt", "-o", "strict.pfm", "--strict"]);
    assert_eq!(code(&strict), 3, "{}", stderr(&strict));
    assert!(!desk.path("strict.pfm").exists());
    // What needs no light is seen.
    let normals = desk.lumbre(&["render", "dark.pbrt", "-o", "n.pfm", "--integrator", "normals", "--strict"]);
    assert_eq!((code(&normals), stderr(&normals).contains("no light")), (0, false), "{}", stderr(&normals));
}

#[test]
fn a_broken_scene_is_refused_with_its_place() {
    let desk = Desk::new();
    desk.write("broken.pbrt", "WorldBegin\n  Shape \"sphere\" \"float radius\" -2\n");
    for command in ["render", "info"] {
        let out = desk.lumbre(&[command, "broken.pbrt"]);
        assert_eq!(code(&out), 3, "{}", stderr(&out));
        let first = stderr(&out).lines().next().unwrap_or_default().to_owned();
        assert!(first.starts_with("error: broken.pbrt:2:"), "{first}");
    }
}

#[test]
fn an_unknown_parameter_is_a_warning_unless_strict() {
    let desk = Desk::new();
    desk.write("scene.pbrt", &SPHERE.replace("\"float radius\"", "\"float raduis\" 2 \"float radius\""));
    let out = desk.lumbre(&["render", "scene.pbrt", "-o", "a.png"]);
    assert_eq!(code(&out), 0);
    let warning =
        stderr(&out).lines().find(|line| line.starts_with("warning: ")).unwrap_or_default().to_owned();
    assert!(warning.starts_with("warning: scene.pbrt:9:"), "{}", stderr(&out));
    assert!(warning.contains("raduis") && warning.contains("radius"), "{warning}");
    assert_eq!(code(&desk.lumbre(&["render", "scene.pbrt", "-o", "a.png", "--strict"])), 3);
}

#[test]
fn files_that_cannot_be_read_or_written_end_with_four() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    fs::create_dir(desk.path("folder.png")).unwrap();
    for arguments in [
        &["render", "missing.pbrt"][..],
        &["render", "scene.pbrt", "-o", "nowhere/at/all.png"],
        &["render", "scene.pbrt", "-o", "folder.png"],
        &["info", "missing.pbrt"],
        &["diff", "missing.exr", "missing.exr"],
        &["cast", "scene.pbrt", "--rays", "missing.csv"],
    ] {
        let start = Instant::now();
        let out = desk.lumbre(arguments);
        assert_eq!(code(&out), 4, "{arguments:?}: {}", stderr(&out));
        assert!(stderr(&out).starts_with("error: "), "{arguments:?}: {}", stderr(&out));
        assert!(start.elapsed() < Duration::from_secs(20));
    }
}

#[test]
fn wrong_usage_ends_with_two() {
    let desk = Desk::new();
    for arguments in [
        &["rendr", "scene.pbrt"][..],
        &["render"],
        &["render", "scene.pbrt", "--spp", "0"],
        &["render", "scene.pbrt", "--size", "12"],
        &["render", "scene.pbrt", "--time", "soon"],
        &["diff", "a.png"],
        &["cast", "scene.pbrt"],
    ] {
        let out = desk.lumbre(arguments);
        assert_eq!(code(&out), 2, "{arguments:?}: {}", stderr(&out));
    }
}

#[test]
fn no_input_is_overwritten() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    desk.write("rays.csv", "ox,oy,oz,dx,dy,dz\n1,2,-5,0,0,2\n");
    let grey = lumbre::image::Image::filled(16, 8, lumbre::image::Rgb::new(0.1, 0.2, 0.3));
    for name in ["a.png", "b.png"] {
        lumbre::write_image(&desk.path(name), &grey, &lumbre::SaveOptions::default()).unwrap();
    }
    let before = |name: &str| fs::read(desk.path(name)).unwrap();
    for (input, arguments) in [
        ("rays.csv", &["cast", "scene.pbrt", "--rays", "rays.csv", "-o", "./rays.csv"][..]),
        ("a.png", &["diff", "a.png", "b.png", "-o", "a.png"]),
        ("b.png", &["diff", "a.png", "b.png", "-o", "b.png"]),
        ("scene.pbrt", &["render", "scene.pbrt", "--spp", "1", "-o", "x.png", "--stats", "scene.pbrt"]),
        ("a.png", &["render", "scene.pbrt", "--spp", "1", "-o", "a.png", "--background", "a.png"]),
        ("b.png", &["render", "scene.pbrt", "--spp", "1", "-o", "b.png", "--env", "b.png"]),
    ] {
        let bytes = before(input);
        let out = desk.lumbre(arguments);
        assert_eq!(code(&out), 2, "{arguments:?}: {}", stderr(&out));
        assert!(stderr(&out).contains("would be overwritten"), "{}", stderr(&out));
        assert_eq!(before(input), bytes, "{arguments:?}");
    }
}

#[test]
fn info_counts_what_is_there() {
    let desk = Desk::new();
    desk.write(
        "scene.pbrt",
        &format!("{SPHERE}\nShape \"box\"\nShape \"sphere\" \"float radius\" 2\nLightSource \"point\"\n"),
    );
    let out = desk.lumbre(&["info", "scene.pbrt", "--json"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let info: Value = serde_json::from_str(&stdout(&out)).unwrap();
    assert_eq!(info["shapes"]["sphere"].as_u64(), Some(2), "{info}");
    assert_eq!(info["shapes"]["box"].as_u64(), Some(1));
    assert_eq!((info["lights"]["infinite"].as_u64(), info["lights"]["point"].as_u64()), (Some(1), Some(1)));
    assert_eq!(info["materials"]["diffuse"].as_u64(), Some(1));
    assert_eq!((info["triangles"].as_u64(), info["instances"].as_u64()), (Some(0), Some(0)));
    assert_eq!(info["cameras"].as_array().map(Vec::len), Some(1));
    assert_eq!(info["bounds"]["max"][0].as_f64().map(f64::round), Some(2.0));
    assert!(info["warnings"].as_array().unwrap().is_empty());
    let picture = &info["picture"];
    assert_eq!((picture["width"].as_u64(), picture["height"].as_u64()), (Some(48), Some(32)), "{picture}");
    let time = picture["seconds_per_sample"].as_f64().unwrap();
    assert!(time > 0.0 && picture["memory_bytes"].as_u64() > Some(48 * 32 * 16), "{picture}");
    let plain = desk.lumbre(&["info", "scene.pbrt"]);
    let plain = stdout(&plain);
    assert!(plain.contains("2 sphere") && plain.contains("48x32"), "{plain}");
    // A model is measured as it would be shown; what cannot be rendered is still described.
    desk.write("model.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let model: Value = serde_json::from_str(&stdout(&desk.lumbre(&["info", "model.obj", "--json"]))).unwrap();
    assert_eq!(model["picture"]["width"].as_u64(), Some(1200), "{model}");
    assert_eq!(model["cameras"].as_array().map(Vec::len), Some(0), "{model}");
    let huge = SPHERE.replace("\"integer xresolution\" 48", "\"integer xresolution\" 99999999");
    desk.write("huge.pbrt", &huge);
    let huge = desk.lumbre(&["info", "huge.pbrt"]);
    assert!(code(&huge) == 0 && stdout(&huge).contains("99999999"), "{}", stdout(&huge));
}

#[test]
fn a_difference_above_its_limit_ends_with_one() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    for (name, seed) in [("a.exr", "1"), ("b.exr", "2")] {
        assert_eq!(code(&desk.lumbre(&["render", "scene.pbrt", "-o", name, "--seed", seed, "-q"])), 0);
    }
    for metric in ["rmse", "relmse", "mae", "max", "flip"] {
        let same = desk.lumbre(&["diff", "a.exr", "a.exr", "--metric", metric, "--fail-above", "0"]);
        assert_eq!((code(&same), stdout(&same).trim()), (0, "0"), "{metric}");
        let other = desk.lumbre(&[
            "diff",
            "a.exr",
            "b.exr",
            "--metric",
            metric,
            "--fail-above",
            "1e-9",
            "-o",
            "heat.png",
        ]);
        assert_eq!(code(&other), 1, "{metric}: {}", stdout(&other));
        assert!(stdout(&other).trim().parse::<f64>().unwrap() > 0.0);
        assert!(desk.path("heat.png").exists());
    }
}

#[test]
fn a_similarity_below_its_limit_ends_with_one() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    for (name, seed) in [("a.exr", "1"), ("b.exr", "2")] {
        assert_eq!(code(&desk.lumbre(&["render", "scene.pbrt", "-o", name, "--seed", seed, "-q"])), 0);
    }
    let ssim = |b: &str, more: &[&str]| {
        desk.lumbre(&[&["diff", "a.exr", b, "--metric", "ssim", "-o", "heat.png"], more].concat())
    };
    let same = ssim("a.exr", &["--fail-below", "1"]);
    assert_eq!((code(&same), &*stdout(&same)), (0, "1\n"));
    let other = ssim("b.exr", &[]);
    let value: f64 = stdout(&other).trim().parse().unwrap();
    assert!(code(&other) == 0 && (0.1..0.9999).contains(&value), "{value}");
    assert_eq!(code(&ssim("b.exr", &["--fail-below", "0.99999"])), 1);
    for (arguments, expected) in [
        (&["--metric", "ssim", "--fail-above", "0.1"][..], "--fail-below"),
        (&["--metric", "mae", "--fail-below", "0.1"], "--fail-above"),
    ] {
        let out = desk.lumbre(&[&["diff", "a.exr", "b.exr"], arguments].concat());
        assert!(code(&out) == 2 && stderr(&out).contains(expected), "{}", stderr(&out));
    }
}

#[test]
fn a_part_of_two_pictures_can_be_compared() {
    let desk = Desk::new();
    // They differ in one pixel of 5 by 4, the second of the third row.
    let picture = |value: f32| {
        let mut bytes = b"PF\n5 4\n-1.0\n".to_vec();
        // Rows from below.
        for row in (0..4).rev() {
            for column in 0..5 {
                let colour = if (column, row) == (1, 2) { value } else { 0.25 };
                bytes.extend([colour; 3].iter().flat_map(|c| c.to_le_bytes()));
            }
        }
        bytes
    };
    fs::write(desk.path("a.pfm"), picture(0.25)).unwrap();
    fs::write(desk.path("b.pfm"), picture(0.75)).unwrap();
    for (region, expected) in [("1,2,1,1", "0.5\n"), ("1,2,4,2", "0.0625\n"), ("2,0,3,4", "0\n")] {
        let out = desk.lumbre(&["diff", "a.pfm", "b.pfm", "--metric", "mae", "--region", region]);
        assert_eq!((code(&out), &*stdout(&out)), (0, expected), "{region}: {}", stderr(&out));
    }
    for region in ["2,0,4,4", "0,0,5,5", "9,9,1,1", "0,0,0,1", "0,0,1", "-1,0,2,2"] {
        let out = desk.lumbre(&["diff", "a.pfm", "b.pfm", &format!("--region={region}")]);
        assert_eq!(code(&out), 2, "{region}: {}", stdout(&out));
    }
}

#[test]
fn rays_are_answered_from_text_and_arrays_alike() {
    let desk = Desk::new();
    desk.write("scene.pbrt", "WorldBegin\nShape \"sphere\" \"point3 center\" [1 2 3] \"float radius\" 2\n");
    desk.write("rays.csv", "ox,oy,oz,dx,dy,dz\n1,2,-5,0,0,2\n1,2,3,0,0.5,0\n9,9,9,0,0,1\n");
    let closest = desk.lumbre(&["cast", "scene.pbrt", "--rays", "rays.csv"]);
    assert_eq!(
        stdout(&closest).lines().collect::<Vec<_>>()[0],
        "ray,hit,t,px,py,pz,nx,ny,nz,u,v,front,shape,prim,instance"
    );
    let rows: Vec<Vec<String>> =
        stdout(&closest).lines().skip(1).map(|l| l.split(',').map(str::to_owned).collect()).collect();
    assert_eq!(rows[0][..9], ["0", "1", "3.0", "1.0", "2.0", "1.0", "0.0", "0.0", "-1.0"].map(str::to_owned));
    assert_eq!((rows[0][11].as_str(), rows[1][2].as_str(), rows[1][11].as_str()), ("1", "4.0", "0"));
    assert_eq!(stdout(&closest).lines().nth(3), Some("2,0,,,,,,,,,,,,,"));
    let count = desk.lumbre(&["cast", "scene.pbrt", "--rays", "rays.csv", "--query", "count"]);
    assert_eq!(stdout(&count), "ray,count\n0,2\n1,1\n2,0\n");
    let any = desk.lumbre(&["cast", "scene.pbrt", "--rays", "rays.csv", "--query", "any"]);
    assert_eq!(stdout(&any), "ray,hit\n0,1\n1,1\n2,0\n");
    let all = desk.lumbre(&["cast", "scene.pbrt", "--rays", "rays.csv", "--query", "all"]);
    assert_eq!(stdout(&all).lines().count(), 4);

    let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 6), }";
    npy.extend(format!("{header:<117}\n").bytes());
    for v in [1.0, 2.0, -5.0, 0.0, 0.0, 2.0, 1.0, 2.0, 3.0, 0.0, 0.5, 0.0, 9.0, 9.0, 9.0, 0.0, 0.0, 1.0f64] {
        npy.extend(v.to_le_bytes());
    }
    fs::write(desk.path("rays.npy"), npy).unwrap();
    let array = desk.lumbre(&["cast", "scene.pbrt", "--rays", "rays.npy"]);
    assert_eq!(stdout(&array), stdout(&closest), "{}", stderr(&array));
    for name in ["hits.npy", "hits.npz", "hits.csv"] {
        let out = desk.lumbre(&["cast", "scene.pbrt", "--rays", "rays.npy", "-o", name]);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        assert!(fs::metadata(desk.path(name)).unwrap().len() > 100);
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_render_saves_what_is_there() {
    for (signal, status) in [("INT", 130), ("TERM", 143)] {
        let desk = Desk::new();
        desk.write("scene.pbrt", SPHERE);
        let mut child = Command::new(env!("CARGO_BIN_EXE_lumbre"))
            .args(["render", "scene.pbrt", "-o", "a.png", "--spp", "100000000", "--progress", "plain"])
            .current_dir(desk.folder.path())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(1500));
        let sent =
            Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let start = Instant::now();
        let ended = loop {
            if let Some(ended) = child.try_wait().unwrap() {
                break ended;
            }
            assert!(start.elapsed() < Duration::from_secs(30), "it goes on after SIG{signal}");
            std::thread::sleep(Duration::from_millis(20));
        };
        assert_eq!(ended.code(), Some(status));
        let image = lumbre::read_image(&desk.path("a.png")).unwrap();
        assert!(image.pixels().iter().any(|p| p.max_component() > 0.1), "the picture is black");
    }
}

#[test]
fn every_scene_has_the_same_bytes_in_eight_ways() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut scenes = Vec::new();
    for folder in fs::read_dir(&root).unwrap() {
        for file in fs::read_dir(folder.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_some_and(|e| e == "pbrt") {
                scenes.push(path);
            }
        }
    }
    assert!(scenes.len() >= 6, "{scenes:?}");
    let desk = Desk::new();
    let all = "--spp 3 --threads";
    // Each way is a list of commands that come to a.exr; SCENE stands for the scene, in its size.
    let ways = [
        format!("render SCENE -o a.exr {all} 1"),
        format!("render SCENE -o a.exr {all} 2"),
        format!("render SCENE -o a.exr {all} 16"),
        "render SCENE -o a.part --samples 0..1; render SCENE -o b.part --samples 1..3 --threads 1; merge b.part a.part -o a.exr".into(),
        "render SCENE -o a.part --samples 0..3 --crop 0,0,41,50; render SCENE -o b.exr --samples 0..3 --crop 41,0,66,50; merge a.part b.exr -o a.exr".into(),
        "render SCENE -o a.exr --spp 1 --keep-sums; render SCENE -o a.exr --spp 3 --resume".into(),
        "render SCENE -o a.exr --spp 2 --checkpoint ck --checkpoint-every 1ms; render SCENE -o a.exr --spp 3 --checkpoint ck --resume".into(),
        "render SCENE -o a.part --samples 2..3; render SCENE -o b.part --samples 0..1; merge a.part b.part -o c.part --allow-gaps; render SCENE -o d.part --samples 1..2; merge d.part c.part -o a.exr".into(),
    ];
    for scene in scenes {
        let path = scene.to_string_lossy();
        let mut pictures = Vec::new();
        for way in &ways {
            for name in ["a.exr", "ck"] {
                let _ = fs::remove_file(desk.path(name));
            }
            for command in way.split("; ") {
                let more: &[&str] =
                    if command.starts_with("render") { &["--size", "66x50", "--strict"] } else { &[] };
                let words = command.split(' ').map(|word| if word == "SCENE" { &path } else { word });
                let words: Vec<&str> = words.chain(["-q"]).chain(more.iter().copied()).collect();
                let out = desk.lumbre(&words);
                assert_eq!(code(&out), 0, "{path}: {command}: {}", stderr(&out));
            }
            pictures.push(fs::read(desk.path("a.exr")).unwrap());
        }
        for (way, picture) in ways.iter().zip(&pictures) {
            assert!(*picture == pictures[0], "{path}: {way}");
        }
    }
}

/// A pyramid on the plane z = 0, of 5 by 3 at its foot and 4 high.
pub(crate) const PYRAMID: &str = "solid p
facet normal 0 0 0\nouter loop\nvertex 1 1 0\nvertex 6 1 0\nvertex 3 2 4\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 6 1 0\nvertex 6 4 0\nvertex 3 2 4\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 6 4 0\nvertex 1 4 0\nvertex 3 2 4\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 1 4 0\nvertex 1 1 0\nvertex 3 2 4\nendloop\nendfacet
endsolid p\n";

#[test]
fn a_model_stands_whole_and_lit_before_its_background() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    for size in ["60x40", "24x60"] {
        let arguments =
            ["render", "p.stl", "-o", "p.png", "--spp", "4", "--background", "#ff0000", "--size", size, "-q"];
        let out = desk.lumbre(&arguments);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let image = lumbre::read_image(&desk.path("p.png")).unwrap();
        let (w, h) = (image.width(), image.height());
        let is_model = |x: u32, y: u32| image.pixel(x, y).g > 0.02;
        let red = |x: u32, y: u32| image.pixel(x, y).r > 0.2 && !is_model(x, y);
        // The very edge is background, in the colour that was asked for at least at the top.
        assert!(
            (0..w).all(|x| red(x, 0) && red(x, h - 1)) && (0..h).all(|y| red(0, y) && red(w - 1, y)),
            "{size}"
        );
        assert_eq!(image.pixel(0, 0).to_array(), [1.0, 0.0, 0.0]);
        let seen = (0..w * h).filter(|i| is_model(i % w, i / w)).count();
        assert!(seen > (w * h / 12) as usize, "{size}: {seen}");
        // Its shadow darkens the ground.
        let darkest = (0..w * h).filter(|i| !is_model(i % w, i / w)).map(|i| image.pixel(i % w, i / w).r);
        assert!(darkest.fold(1.0, f32::min) < 0.8);
    }
}

#[test]
fn transparent_pictures_cover_the_model_and_its_shadow() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    let render = |ground: &str| {
        let arguments = [
            "render",
            "p.stl",
            "-o",
            "p.exr",
            "--spp",
            "16",
            "--background",
            "transparent",
            "--size",
            "48x36",
            "--ground",
            ground,
            "-q",
        ];
        let out = desk.lumbre(&arguments);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let alpha = lumbre::read_image(&desk.path("p.exr")).unwrap().alpha().unwrap().to_vec();
        (
            alpha.iter().filter(|&&a| a == 0.0).count(),
            alpha.iter().filter(|&&a| a == 1.0).count(),
            alpha.len(),
        )
    };
    let (open, solid, all) = render("none");
    assert!(open > all / 3 && solid > all / 10 && open + solid > all * 8 / 10, "{open} {solid} {all}");
    let (with_shadow, still_solid, _) = render("shadow");
    assert!(
        with_shadow < open - all / 20 && still_solid >= solid,
        "{with_shadow} {open}, {still_solid} {solid}"
    );
    let (behind_plane, _, _) = render("plane");
    assert!(behind_plane < all / 4, "{behind_plane}");
}

#[test]
fn a_turntable_makes_as_many_different_pictures() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    let out = desk.lumbre(&[
        "render",
        "p.stl",
        "-o",
        "p.##.png",
        "--turntable",
        "5",
        "--spp",
        "1",
        "--size",
        "30x20",
        "-q",
    ]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let mut pictures: Vec<Vec<u8>> =
        (1..=5).map(|i| fs::read(desk.path(&format!("p.{i:02}.png"))).unwrap()).collect();
    assert!(!desk.path("p.06.png").exists());
    pictures.sort();
    pictures.dedup();
    assert_eq!(pictures.len(), 5);
}

/// A triangle that goes along x from 0 s to 1 s; with a camera among the nodes 0 and 1.
fn write_sliding_triangle(desk: &Desk, name: &str, nodes: &str) {
    let numbers: [f32; 17] =
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0];
    let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    fs::write(desk.path("slide.bin"), bytes).unwrap();
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[NODES]}],
        "buffers":[{"uri":"slide.bin","byteLength":68}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},
            {"buffer":0,"byteOffset":44,"byteLength":24}],
        "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[1,1,0]},
            {"bufferView":1,"componentType":5126,"type":"SCALAR","count":2,"min":[0],"max":[1]},
            {"bufferView":2,"componentType":5126,"type":"VEC3","count":2}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "cameras":[{"type":"orthographic","orthographic":{"xmag":4,"ymag":3,"znear":0.1,"zfar":99}}],
        "nodes":[{"mesh":0},{"camera":0,"translation":[2,0.5,9]}],
        "animations":[{"samplers":[{"input":1,"output":2}],
            "channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}]}"#;
    desk.write(name, &json.replace("NODES", nodes));
}

#[test]
fn frames_show_their_time_and_motion_blur_on_request() {
    let desk = Desk::new();
    write_sliding_triangle(&desk, "slide.gltf", "0,1");
    let render = |arguments: &[&str]| {
        let common = ["render", "slide.gltf", "--spp", "64", "--size", "80x60", "--integrator", "albedo"];
        let out = desk.lumbre(&[&common[..], arguments].concat());
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        stderr(&out)
    };
    // At four frames a second, frames 1 to 3 are at a quarter, a half and three quarters of a second.
    let said = render(&["--frames", "1..3", "--fps", "4", "-o", "f.###.pfm"]);
    assert!(said.contains("frame 1 (1 of 3)") && said.contains("frame 3 (3 of 3, "), "{said}");
    assert!(!desk.path("f.000.pfm").exists() && !desk.path("f.004.pfm").exists());
    let image = |name: &str| lumbre::read_image(&desk.path(name)).unwrap();
    let frames = [1, 2, 3].map(|i| image(&format!("f.00{i}.pfm")));
    render(&["--frame", "0.5", "-o", "still.pfm"]);
    assert_eq!(image("still.pfm"), frames[1]);
    // Ten pixels a unit: at half a second the square corner stands in column 40 - 40 + 2 · 10 + ... of the middle.
    let lit = |image: &lumbre::image::Image| {
        let is_lit = |&x: &u32| (0..60).any(|y| image.pixel(x, y).g > 0.01);
        let columns: Vec<u32> = (0..80).filter(is_lit).collect();
        (columns[0], *columns.last().unwrap())
    };
    let [first, second, third] = frames.each_ref().map(lit);
    assert!(
        first.0.abs_diff(30) <= 1 && second.0.abs_diff(40) <= 1 && third.0.abs_diff(50) <= 1,
        "{first:?}"
    );
    // The filter adds a pixel on each side.
    assert!((second.1 - second.0).abs_diff(11) <= 1, "{second:?}");
    // Open for half of a quarter of a second, it sees the triangle go half a unit: five pixels.
    render(&["--frames", "2..2", "--fps", "4", "--shutter", "0.5", "-o", "b.#.pfm"]);
    let blurred = image("b.2.pfm");
    let (from, to) = lit(&blurred);
    assert!(from.abs_diff(37) <= 1 && (to - from).abs_diff(16) <= 2, "{from} {to}");
    let sum = |image: &lumbre::image::Image| image.pixels().iter().map(|p| f64::from(p.g)).sum::<f64>();
    assert!((sum(&blurred) / sum(&frames[1]) - 1.0).abs() < 0.03);
}

#[test]
fn a_model_moves_on_a_stage_that_stays() {
    let desk = Desk::new();
    write_sliding_triangle(&desk, "model.gltf", "0");
    let out = desk.lumbre(&[
        "render",
        "model.gltf",
        "--frames",
        "0..2",
        "--fps",
        "40",
        "-o",
        "m#.pfm",
        "--spp",
        "4",
        "--size",
        "60x40",
        "--integrator",
        "albedo",
        "-q",
    ]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let left = |i: u32| {
        let image = lumbre::read_image(&desk.path(&format!("m{i}.pfm"))).unwrap();
        (0..60).find(|&x| (0..40).any(|y| image.pixel(x, y).g > 0.05)).unwrap()
    };
    assert!(left(0) < left(1) && left(1) < left(2), "{} {} {}", left(0), left(1), left(2));
}

#[test]
fn frames_that_make_no_sense_are_refused() {
    let desk = Desk::new();
    for (arguments, expected) in [
        (&["--frames", "0..3", "-o", "a.png"][..], "frame.####.png"),
        (&["--frames", "3..1"], "the first and the last frame"),
        (&["--frames", "0..3", "--frame", "1"], "cannot be used with"),
        (&["--shutter", "-1"], "unexpected argument"),
        (&["--shutter", "half"], "a share of a frame"),
        (&["--fps", "0"], "frames a second"),
        (&["--shutter", "0.5"], "--shutter needs --frame or --frames"),
    ] {
        let mut whole = vec!["render", "missing.gltf"];
        whole.extend(arguments);
        let out = desk.lumbre(&whole);
        assert_eq!(code(&out), 2, "{arguments:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(expected), "{arguments:?}: {}", stderr(&out));
    }
    let out = desk.lumbre(&["render", "still.pbrt", "--frames", "0..3"]);
    assert_eq!(code(&out), 2, "{}", stderr(&out));
    assert!(stderr(&out).contains("--frames needs an animation"), "{}", stderr(&out));
}

#[test]
fn light_from_a_picture_is_seen_and_lights() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    let sky = lumbre::image::Image::filled(16, 8, lumbre::image::Rgb::new(0.1, 0.2, 0.8));
    lumbre::write_image(&desk.path("sky.exr"), &sky, &lumbre::SaveOptions::default()).unwrap();
    let out = desk.lumbre(&[
        "render", "p.stl", "-o", "p.exr", "--env", "sky.exr", "--spp", "16", "--size", "40x30", "-q",
    ]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let image = lumbre::read_image(&desk.path("p.exr")).unwrap();
    assert!((image.pixel(0, 0).b - 0.8).abs() < 1e-2 && image.alpha().is_none());
    // Grey reflects the light's own colour.
    let middle = image.pixel(20, 15);
    assert!(middle.b > 0.1 && (middle.b / middle.r - 8.0).abs() < 0.5, "{middle:?}");
    lumbre::write_image(
        &desk.path("odd.exr"),
        &lumbre::image::Image::filled(15, 8, lumbre::image::Rgb::WHITE),
        &lumbre::SaveOptions::default(),
    )
    .unwrap();
    let out = desk.lumbre(&["render", "p.stl", "-o", "p.exr", "--env", "odd.exr"]);
    assert_eq!(code(&out), 3);
    assert!(stderr(&out).contains("15 by 8 pixels"), "{}", stderr(&out));
}

/// A white square of side 2 before a camera, lit by a sun of this many lux, over a black background.
fn sunlit(lux: f32) -> String {
    // 4 vertices and 6 indices.
    let data = "AACAvwAAgL8AAAAAAACAPwAAgL8AAAAAAACAPwAAgD8AAAAAAACAvwAAgD8AAAAAAAABAAIAAAACAAMA";
    format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_lights_punctual"],"extensions":{{"KHR_lights_punctual":{{
        "lights":[{{"type":"directional","intensity":{lux}}}]}}}},"buffers":[{{"byteLength":60,
        "uri":"data:application/octet-stream;base64,{data}"}}],"bufferViews":[{{"buffer":0,"byteLength":48}},
        {{"buffer":0,"byteOffset":48,"byteLength":12}}],"accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3",
        "count":4,"min":[-1,-1,0],"max":[1,1,0]}},{{"bufferView":1,"componentType":5123,"type":"SCALAR","count":6}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.8,"znear":0.01}}}}],
        "materials":[{{"pbrMetallicRoughness":{{"metallicFactor":0}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
        "nodes":[{{"mesh":0}},{{"camera":0,"translation":[0,0,4]}},{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}],
        "scenes":[{{"nodes":[0,1,2]}}]}}"#
    )
}

#[test]
fn light_is_metered_unless_an_exposure_is_given() {
    let desk = Desk::new();
    let shown = |lux: f32, more: &[&str]| {
        desk.write("s.gltf", &sunlit(lux));
        let mut arguments = vec!["render", "s.gltf", "-o", "s.png", "--spp", "4", "--size", "30x30"];
        arguments.extend(more);
        let out = desk.lumbre(&arguments);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let image = lumbre::read_image(&desk.path("s.png")).unwrap();
        let middle = image.pixel(image.width() / 2, image.height() / 2);
        (middle.g, image.pixel(1, 1).g, stderr(&out))
    };
    for lux in [100_000.0, 0.02] {
        let (white, behind, said) = shown(lux, &[]);
        assert!((0.7..1.01).contains(&white) && behind == 0.0, "{lux}: {white} {behind}");
        assert!(said.contains("--exposure 0"), "{said}");
    }
    // As it is where that is seen, and where it is asked for.
    let (white, _, said) = shown(1.5, &[]);
    assert!((0.3..0.6).contains(&white) && !said.contains("exposed"), "{white} {said}");
    assert_eq!(shown(100_000.0, &["--exposure", "0"]).0, 1.0);
    let (black, _, said) = shown(0.02, &["--exposure", "0"]);
    assert!(black < 0.02 && !said.contains("exposed"), "{black} {said}");
    // A part is as bright as the whole.
    let (whole, part) = (shown(100_000.0, &[]).0, shown(100_000.0, &["--crop", "10,10,20,20"]).0);
    assert!((part - whole).abs() < 0.02, "{part} {whole}");
}

#[test]
fn a_picture_of_nothing_is_said_to_be_one() {
    let desk = Desk::new();
    desk.write("n.gltf", r#"{"asset":{"version":"2.0"},"scenes":[{"name":"nothing"}]}"#);
    let out = desk.lumbre(&["render", "n.gltf", "-o", "n.png", "--spp", "1", "--size", "8x8"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    assert!(
        stderr(&out)
            .contains("warning: n.gltf: the scene has no shapes: the picture shows only the background"),
        "{}",
        stderr(&out)
    );
}

#[test]
fn words_that_show_nothing_are_refused_before_anything_is_read() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    for (arguments, expected) in [
        (&["--ground", "floor"][..], "shadow"),
        (&["--background", "wite"], "transparent"),
        (&["--background", "#12"], "hexadecimal"),
        (&["--background", "transparent", "-o", "a.jpg"], "expected .png, .webp, .qoi or .exr"),
        (&["--turntable", "8", "-o", "a.png"], "frame.####.png"),
        (&["--turntable", "1"], "expected a whole number from 2 to 100000"),
        (&["--fit", "--camera", "0"], "cannot be used with"),
        (&["--turntable", "8", "--camera", "0"], "cannot be used with"),
    ] {
        let mut whole = vec!["render", "missing.stl"];
        whole.extend(arguments);
        let out = desk.lumbre(&whole);
        assert_eq!(code(&out), 2, "{arguments:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(expected), "{arguments:?}: {}", stderr(&out));
    }
    let out = desk.lumbre(&["render", "p.stl", "--env", "missing.hdr"]);
    assert_eq!(code(&out), 4, "{}", stderr(&out));
    let out = desk.lumbre(&["render", "p.stl", "--background", "missing.png", "-o", "a.png"]);
    assert_eq!(code(&out), 4, "{}", stderr(&out));
}
