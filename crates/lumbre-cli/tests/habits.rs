//! What users of other programs expect without reading: no verb, pipes, tips, views, colours.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::io::Write;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::program::{Desk, PYRAMID, SPHERE, code, stderr, stdout};

const OBJ: &str = "v -3 0 0\nv 4 0 0\nv 4 2 1\nv -3 2 1\nf 1 2 3 4\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 0 0\n0 3 0\n3 0 1 2\n";
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"scene":0,"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[0,0,0]}],
    "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,
    "uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA"}]}"#;

fn with_input(desk: &Desk, arguments: &[&str], input: &[u8]) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(arguments)
        .current_dir(desk.folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    let input = input.to_vec();
    let writer = std::thread::spawn(move || {
        // What is refused is not read to its end.
        let _ = pipe.write_all(&input);
    });
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

fn image(desk: &Desk, name: &str) -> lumbre::image::Image {
    lumbre::read_image(&desk.path(name)).unwrap()
}

#[test]
fn missing_and_unreadable_files_get_different_messages() {
    let desk = Desk::new();
    desk.write("part.STP", "ISO-10303-21;");
    fs::create_dir(desk.path("model")).unwrap();
    desk.write("model/scene.pbrt", "WorldBegin\nShape \"sphere\"\n");
    for (arguments, status, expected) in [
        (&["fox.fbx"][..], 4, "fox.fbx: cannot open"),
        (
            &["part.STP"],
            3,
            "part.STP: files of this kind are not read (expected an .stl, as FreeCAD exports it",
        ),
        (&["model"], 3, "model: this is a folder (expected a file, such as model/scene.pbrt)"),
        (&["view", "none.glb", "--no-open"], 4, "none.glb: cannot open"),
        (&["explain", "model/scene.pbrt"], 2, "nothing is asked for (expected --pixel X,Y"),
    ] {
        let out = desk.lumbre(arguments);
        assert_eq!(code(&out), status, "{arguments:?}: {}", stderr(&out));
        assert!(stderr(&out).starts_with(&format!("error: {expected}")), "{}", stderr(&out));
    }
}

#[test]
fn a_file_without_a_verb_is_rendered() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    desk.write("words", SPHERE);
    for arguments in [
        &["scene.pbrt", "-o", "a.pfm"][..],
        &["-o", "b.pfm", "--quiet", "./scene.pbrt"],
        &["words", "-o", "c.pfm"],
        &["render", "scene.pbrt", "-o", "d.pfm"],
    ] {
        let out = desk.lumbre(arguments);
        assert_eq!(code(&out), 0, "{arguments:?}: {}", stderr(&out));
    }
    for name in ["a.pfm", "b.pfm", "c.pfm"] {
        assert_eq!(image(&desk, name), image(&desk, "d.pfm"), "{name}");
    }
    let out = desk.lumbre(&["missing.glb"]);
    assert_eq!(code(&out), 4, "{}", stderr(&out));
    let out = desk.lumbre(&["rendr"]);
    assert_eq!(code(&out), 2);
    assert!(stderr(&out).contains("'render'"), "{}", stderr(&out));
}

#[test]
fn shells_and_manuals_know_every_command_and_option() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let out = desk.lumbre(&["completions", shell]);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        // Two of them complete no values.
        let values = if ["powershell", "elvish"].contains(&shell) { &[][..] } else { &["ambientocclusion"] };
        for word in ["render", "turntable", "fail-above"].iter().chain(values) {
            assert!(stdout(&out).contains(word), "{shell}: {word}");
        }
    }
    let page = stdout(&desk.lumbre(&["man"]));
    assert!(page.contains(".TH lumbre 1") && page.contains("completions"), "{page}");
    for command in ["render", "cast", "info", "diff"] {
        let out = desk.lumbre(&["man", command]);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let page = stdout(&out).replace("\\-", "-");
        assert!(page.contains(&format!("lumbre-{command}")) && page.contains("Examples"), "{page}");
    }
    fs::create_dir(desk.path("man")).unwrap();
    let out = desk.lumbre(&["man", "--into", "man"]);
    assert_eq!((code(&out), &*stdout(&out)), (0, ""), "{}", stderr(&out));
    assert!(fs::read_to_string(desk.path("man/lumbre.1")).unwrap().contains(".TH lumbre 1"));
    for command in ["render", "cast", "info", "diff", "farm-slurm"] {
        let page = fs::read_to_string(desk.path(&format!("man/lumbre-{command}.1"))).unwrap();
        assert!(page.replace("\\-", "-").contains(&format!(".TH lumbre-{command} 1")), "{page}");
    }
    assert_eq!(code(&desk.lumbre(&["man", "--into", "none"])), 4);
    let out = desk.lumbre(&["man", "rendr"]);
    assert_eq!(code(&out), 2);
    assert!(stderr(&out).contains("render"), "{}", stderr(&out));
}

#[test]
fn standard_input_is_told_by_its_bytes_or_by_an_option() {
    let desk = Desk::new();
    let gzipped = {
        let mut child = Command::new("gzip").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(PLY.as_bytes()).unwrap();
        child.wait_with_output().unwrap().stdout
    };
    for (bytes, shapes) in [
        (SPHERE.as_bytes(), "sphere"),
        (OBJ.as_bytes(), "mesh"),
        (PLY.as_bytes(), "mesh"),
        (PYRAMID.as_bytes(), "mesh"),
        (GLTF.as_bytes(), "mesh"),
        (&gzipped, "mesh"),
    ] {
        let out = with_input(&desk, &["info", "-", "--json"], bytes);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let info: Value = serde_json::from_str(&stdout(&out)).unwrap();
        assert_eq!(info["shapes"][shapes].as_u64(), Some(1), "{info}");
    }
    let out = with_input(&desk, &["info", "-"], b"hello world");
    assert_eq!(code(&out), 3);
    assert!(stderr(&out).starts_with("error: standard input: unknown kind of scene"), "{}", stderr(&out));
    assert!(stderr(&out).contains("--input-format"), "{}", stderr(&out));
    let out =
        with_input(&desk, &["info", "-", "--input-format", "obj"], format!("bevel off\n{OBJ}").as_bytes());
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let out = with_input(&desk, &["info", "-", "--input-format", "opj"], b"");
    assert_eq!(code(&out), 2);
    assert!(stderr(&out).contains("'obj'"), "{}", stderr(&out));
}

#[test]
fn a_picture_goes_to_standard_output_as_the_file_would_be() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    for format in ["png", "exr", "hdr", "pfm", "jpg"] {
        let name = format!("a.{format}");
        assert_eq!(code(&desk.lumbre(&["render", "scene.pbrt", "-o", &name, "-q"])), 0);
        let piped = desk.lumbre(&["render", "scene.pbrt", "-o", "-", "--output-format", format]);
        assert_eq!(code(&piped), 0, "{}", stderr(&piped));
        assert!(piped.stdout == fs::read(desk.path(&name)).unwrap(), "{format}");
    }
    let png = with_input(&desk, &["-", "-o", "-", "--spp", "1"], SPHERE.as_bytes());
    assert!(png.stdout.starts_with(b"\x89PNG"), "{}", stderr(&png));
    assert!(stderr(&png).contains("standard output: 48x32, 1 sample per pixel"), "{}", stderr(&png));
    assert!(!desk.path("-").exists());
    let layers = desk.lumbre(&["scene.pbrt", "-o", "-", "--output-format", "exr", "--aov", "albedo", "-q"]);
    assert!(layers.stdout.windows(8).any(|w| w == b"albedo.R"), "{}", stderr(&layers));
    for arguments in [
        &["scene.pbrt", "-o", "-", "--aov", "albedo"][..],
        &["scene.pbrt", "-o", "a.png", "--output-format", "png"],
        &["scene.pbrt", "-o", "-", "--turntable", "3"],
    ] {
        let out = desk.lumbre(arguments);
        assert_eq!((code(&out), out.stdout.len()), (2, 0), "{arguments:?}: {}", stderr(&out));
    }
}

#[test]
fn files_of_several_kinds_are_one_scene() {
    let desk = Desk::new();
    desk.write("a.pbrt", SPHERE);
    desk.write("b.ply", PLY);
    desk.write("c.stl", PYRAMID);
    let out = desk.lumbre(&["info", "a.pbrt", "b.ply", "c.stl", "--json"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let info: Value = serde_json::from_str(&stdout(&out)).unwrap();
    assert_eq!((info["shapes"]["sphere"].as_u64(), info["shapes"]["mesh"].as_u64()), (Some(1), Some(2)));
    assert_eq!(info["cameras"].as_array().unwrap().len(), 1);
    let out = desk.lumbre(&["a.pbrt", "b.ply", "-o", "a.png", "--spp", "1"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
}

#[cfg(unix)]
#[test]
fn a_name_that_is_not_text_is_read_and_told_harmlessly() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let desk = Desk::new();
    let run = |name: &[u8]| {
        Command::new(env!("CARGO_BIN_EXE_lumbre"))
            .arg("info")
            .arg(OsStr::from_bytes(name))
            .current_dir(desk.folder.path())
            .output()
            .unwrap()
    };
    for name in [&b"caf\xE9.obj"[..], b"caf\xE9"] {
        fs::write(desk.folder.path().join(OsStr::from_bytes(name)), OBJ).unwrap();
        assert_eq!(code(&run(name)), 0, "{}", stderr(&run(name)));
    }
    for name in [&b"a\x1b[31mb\x07.obj"[..], b"forged\nerror: x.obj", b"\xc2\x9b31m.glb"] {
        let out = run(name);
        assert_eq!(code(&out), 4);
        let text = stderr(&out);
        assert!(text.chars().all(|c| !c.is_control() || c == '\n'), "{text:?}");
        assert_eq!(text.lines().count(), 1, "{text:?}");
    }
    let out = desk.lumbre(&["render", "a.obj", "--\x1b[31mred"]);
    assert!(code(&out) == 2 && !stderr(&out).contains('\x1b'), "{:?}", stderr(&out));
    desk.write("a.obj", OBJ);
    desk.write("rays.csv", "ox,oy,oz,dx,dy,dz\n1,2,\0\x1b,0,0,1\n");
    let out = desk.lumbre(&["cast", "a.obj", "--rays", "rays.csv"]);
    assert_eq!(code(&out), 3);
    assert!(
        !stderr(&out).contains(['\0', '\x1b']) && stderr(&out).contains("rays.csv:2:5"),
        "{:?}",
        stderr(&out)
    );
}

#[test]
fn colours_are_the_same_for_all_messages() {
    let desk = Desk::new();
    desk.write("scene.pbrt", &SPHERE.replace("\"float radius\"", "\"float raduis\" 2 \"float radius\""));
    let run = |arguments: &[&str], variables: &[(&str, &str)]| {
        let out = Command::new(env!("CARGO_BIN_EXE_lumbre"))
            .args(arguments)
            .current_dir(desk.folder.path())
            .env_remove("NO_COLOR")
            .env_remove("CLICOLOR_FORCE")
            .envs(variables.iter().copied())
            .output()
            .unwrap();
        stderr(&out) + &stdout(&out)
    };
    for arguments in [
        &["render", "missing.obj"][..],
        &["render", "--nonsense"],
        &["info", "scene.pbrt"],
        &["render", "--help"],
    ] {
        let text = run(arguments, &[("CLICOLOR_FORCE", "1")]);
        assert!(text.contains('\x1b'), "{text}");
        for variables in [&[][..], &[("NO_COLOR", "1")], &[("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1")]] {
            let text = run(arguments, variables);
            assert!(!text.contains('\x1b'), "{text}");
        }
    }
    let text = run(&["info", "scene.pbrt"], &[("CLICOLOR_FORCE", "1")]);
    assert!(text.contains("\x1b[33mwarning:\x1b[0m scene.pbrt:9:"), "{text:?}");
}

#[test]
fn wrong_words_are_answered_with_the_right_ones() {
    let desk = Desk::new();
    for (arguments, expected) in [
        (&["render", "a.obj", "--samples", "4"][..], "the number of samples per pixel is --spp"),
        (&["render", "a.obj", "--pixel-samples", "4"], "'--spp'"),
        (&["render", "a.obj", "--output-file", "x"], "'--output'"),
        (&["render", "a.obj", "--resolution", "4"], "'--size'"),
        (&["render", "a.obj", "--camera-position", "4"], "'--eye'"),
        (&["a.obj", "--oidn"], "--denoise oidn"),
        (&["a.obj", "--integrator", "normal"], "'normals'"),
        (&["a.obj", "--tonemap", "natural"], "[possible values: none, agx, aces, neutral]"),
        (&["a.obj", "--background", "wite"], "did you mean white?"),
        (&["cast", "a.obj", "--input", "r.csv"], "'--rays'"),
        (&["diff", "a", "b", "--metric", "rsme"], "'rmse'"),
        (&["compare", "a", "b"], "'diff'"),
        (&["show", "a.obj"], "'view'"),
        (&["view", "a.obj", "--gui"], "lumbre view SCENE"),
        (&["a.obj", "--pixel", "3,4"], "lumbre explain SCENE --pixel X,Y"),
        (&["a.obj", "--display-server", "x:1"], "'--tev'"),
        (&["view", "a.obj", "--allow-host", "far"], "expected NAME:PORT, such as localhost:9000"),
        (&["a.obj", "--spp", "zero"], "expected a whole number from 1 to 4294967295"),
        (&["a.obj", "--spp", "0"], "expected a whole number from 1 to 4294967295"),
        (&["a.obj", "--threads", "-"], "expected a whole number from 1 to 1024"),
        (&["diff", "a", "b", "-o", "heat.gif"], "heat.gif: unknown image format"),
    ] {
        let out = desk.lumbre(arguments);
        assert_eq!(code(&out), 2, "{arguments:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(expected), "{arguments:?}: {}", stderr(&out));
        assert!(!stderr(&out).contains("--frames"), "{arguments:?}: {}", stderr(&out));
    }
}

#[test]
fn options_of_other_formats_are_named() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    for (option, value, of) in [
        ("--variant", "x", "a glTF file"),
        ("--frame", "1", "a glTF file"),
        ("--pov-clock", "1", "a POV-Ray scene"),
    ] {
        let expected = format!("warning: {option} has no effect: p.stl is not {of}");
        let out = desk.lumbre(&["info", "p.stl", option, value]);
        assert_eq!((code(&out), stderr(&out).contains(&expected)), (0, true), "{}", stderr(&out));
        let out = desk.lumbre(&["info", "p.stl", option, value, "--strict"]);
        assert_eq!((code(&out), stderr(&out).contains("has no effect")), (3, true), "{}", stderr(&out));
    }
    // Commands that show one picture do not offer many.
    for (command, is_offered) in [("render", true), ("view", false), ("explain", false)] {
        let out = desk.lumbre(&[command, "--help"]);
        assert_eq!(stdout(&out).contains("--turntable"), is_offered, "{command}");
    }
}

#[test]
fn a_crop_outside_the_picture_is_named_with_its_size() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    let out = desk.lumbre(&["p.stl", "--size", "32x24", "--crop", "90,90,95,95"]);
    let expected = "error: --crop 90,90,95,95 is outside the picture (32x24)";
    assert_eq!((code(&out), stderr(&out).contains(expected)), (2, true), "{}", stderr(&out));
}

#[test]
fn a_list_without_answers_prints_no_header() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    desk.write("r.csv", "ox,oy,oz,dx,dy,dz\n1,2,x,0,0,1\n");
    let out = desk.lumbre(&["cast", "p.stl", "--rays", "r.csv"]);
    assert_eq!((code(&out), stdout(&out)), (3, String::new()));
    let expected = "error: r.csv:2:5: invalid value (found \"x\"; expected a number)";
    assert!(stderr(&out).contains(expected), "{}", stderr(&out));
    desk.write("none.csv", "ox,oy,oz,dx,dy,dz\n");
    let out = desk.lumbre(&["cast", "p.stl", "--rays", "none.csv"]);
    assert_eq!((code(&out), stdout(&out).lines().count()), (0, 1), "{}", stderr(&out));
}

#[test]
fn a_view_is_chosen_by_angles_or_by_places() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    let render = |name: &str, more: &[&str]| {
        let common =
            ["render", "p.stl", "-o", name, "--spp", "8", "--size", "60x40", "--integrator", "normals", "-q"];
        let out = desk.lumbre(&[&common[..], more].concat());
        assert_eq!(code(&out), 0, "{more:?}: {}", stderr(&out));
        image(&desk, name)
    };
    let covered = |image: &lumbre::image::Image| {
        image.pixels().iter().filter(|p| p.max_component() > 0.02).count() as f64
    };
    let usual = render("usual.pfm", &[]);
    // A turn is the picture itself; a quarter is another one.
    let difference = |a: &lumbre::image::Image, b: &lumbre::image::Image| {
        lumbre::image::compare(a, b, lumbre::image::Metric::Mae).unwrap().value
    };
    assert!(difference(&render("turn.pfm", &["--azimuth", "-360"]), &usual) < 1e-3);
    assert!(difference(&render("quarter.pfm", &["--azimuth", "90"]), &usual) > 0.02);
    let half = render("half.pfm", &["--zoom", "0.5"]);
    assert!((covered(&usual) / covered(&half) - 4.0).abs() < 0.6, "{}", covered(&usual) / covered(&half));
    // From straight above, only the upper faces are seen, and the plan of 5 by 3 is as wide as it is high in its
    // window.
    let plan = render("plan.pfm", &["--ortho", "--eye", "3.5,2.5,50", "--target", "3.5,2.5,0"]);
    let columns = (0..60).filter(|&x| plan.pixel(x, 20).max_component() > 0.02).count() as f64;
    let rows = (0..40).filter(|&y| plan.pixel(30, y).max_component() > 0.02).count() as f64;
    assert!((columns / rows - 5.0 / 3.0).abs() < 0.15, "{columns} {rows}");
    // With y up the same plan is a side view.
    let turned = render("up.pfm", &["--up", "y"]);
    assert!(difference(&turned, &usual) > 0.02);
    for (more, expected) in [
        (&["--eye", "1,2"][..], "three numbers"),
        (&["--up", "w"], "-x, -y, -z"),
        (&["--fov", "180"], "degrees from"),
        (&["--zoom", "0"], "a factor"),
        (&["--eye", "1,2,3", "--target", "1,2,3"], "the same point"),
        (&["--camera", "0", "--azimuth", "3"], "cannot be used with"),
    ] {
        let out = desk.lumbre(&[&["render", "p.stl"], more].concat());
        assert_eq!(code(&out), 2, "{more:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(expected), "{more:?}: {}", stderr(&out));
    }
}

#[test]
fn a_turntable_goes_on_from_an_asked_view() {
    let desk = Desk::new();
    desk.write("p.stl", PYRAMID);
    let common = ["--spp", "4", "--size", "30x20", "--integrator", "normals", "-q", "--elevation", "30"];
    let out = desk.lumbre(&[&["p.stl", "-o", "t#.pfm", "--turntable", "4"], &common[..]].concat());
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let out = desk
        .lumbre(&[&["p.stl", "-o", "u#.pfm", "--turntable", "4", "--azimuth", "90"], &common[..]].concat());
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let difference = |a: &str, b: &str| {
        lumbre::image::compare(&image(&desk, a), &image(&desk, b), lumbre::image::Metric::Mae).unwrap().value
    };
    assert!(difference("t2.pfm", "u1.pfm") < 1e-3 && difference("t1.pfm", "u1.pfm") > 0.01);
}

#[test]
fn a_files_own_camera_gives_way_to_a_place_and_keeps_its_lens() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    let render = |name: &str, more: &[&str]| {
        let common = ["scene.pbrt", "-o", name, "--spp", "4", "--integrator", "depth", "-q"];
        let out = desk.lumbre(&[&common[..], more].concat());
        assert_eq!(code(&out), 0, "{more:?}: {}", stderr(&out));
        image(&desk, name)
    };
    // The ball's middle is at (0.25, 0, 0.5), its radius 1.75: seen from 10 away, its nearest point is at 8.25.
    let placed = render("placed.pfm", &["--eye", "0.25,10,0.5", "--target", "0.25,0,0.5", "--up", "z"]);
    assert!((placed.pixel(24, 16).g - 8.25).abs() < 0.02, "{:?}", placed.pixel(24, 16));
    let wide = |image: &lumbre::image::Image| {
        (0..48).filter(|&x| (1.0..20.0).contains(&image.pixel(x, 16).g)).count()
    };
    let (own, zoomed) = (render("own.pfm", &[]), render("zoomed.pfm", &["--zoom", "1.5"]));
    assert!((wide(&zoomed) as f64 / wide(&own) as f64 - 1.5).abs() < 0.2, "{} {}", wide(&own), wide(&zoomed));
    desk.write("round.pbrt", &SPHERE.replace("\"perspective\" \"float fov\" 40", "\"spherical\""));
    let out = desk.lumbre(&["round.pbrt", "-o", "a.png", "--zoom", "2"]);
    assert_eq!(code(&out), 2);
    assert!(stderr(&out).contains("--zoom: the camera sees all directions"), "{}", stderr(&out));
}

#[test]
fn info_names_what_one_can_choose_from() {
    let desk = Desk::new();
    let grey = lumbre::image::Image::filled(6, 4, lumbre::image::Rgb::new(0.1, 0.2, 0.3));
    lumbre::write_image(&desk.path("wood.png"), &grey, &lumbre::SaveOptions::default()).unwrap();
    // A triangle whose position is animated over 1.5 s, twice; its times and its corners are all in 52 bytes of zeros.
    let zeros = "AAAA".repeat(17) + "AA==";
    let gltf = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"scene":0,"nodes":[{"mesh":0}],
        "extensionsUsed":["KHR_materials_variants"],
        "extensions":{"KHR_materials_variants":{"variants":[{"name":"summer"},{"name":"win\u001bter"}]}},
        "images":[{"uri":"wood.png"}],"textures":[{"source":0}],
        "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":2},"material":0}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[0,0,0]},
            {"bufferView":1,"componentType":5126,"type":"SCALAR","count":1,"min":[0],"max":[1.5]},
            {"bufferView":2,"componentType":5126,"type":"VEC2","count":3},
            {"bufferView":3,"componentType":5126,"type":"VEC3","count":1}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteLength":4},{"buffer":0,"byteLength":24},
            {"buffer":0,"byteLength":12}],
        "buffers":[{"byteLength":52,"uri":"data:application/octet-stream;base64,ZEROS"}],
        "animations":[{"name":"Walk","samplers":[{"input":1,"output":3}],
            "channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]},
            {"samplers":[{"input":1,"output":3}],"channels":[{"sampler":0,"target":{"node":0,"path":"scale"}}]}]}"#;
    desk.write("a.gltf", &gltf.replace("ZEROS", &zeros));
    let out = desk.lumbre(&["info", "a.gltf", "--json"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let info: Value = serde_json::from_str(&stdout(&out)).unwrap();
    assert_eq!(info["animations"][0], serde_json::json!({ "name": "Walk", "seconds": 1.5 }), "{info}");
    assert_eq!(info["animations"][1], serde_json::json!({ "name": null, "seconds": 1.5 }));
    assert_eq!(info["variants"], serde_json::json!(["summer", "win\u{1b}ter"]));
    assert_eq!(info["textures"], serde_json::json!([{ "name": "wood.png", "width": 6, "height": 4 }]));
    let text = stdout(&desk.lumbre(&["info", "a.gltf"]));
    assert!(text.contains("animations 2: Walk (1.50 s), 1 (1.50 s)\n"), "{text}");
    assert!(text.contains("variants   2: summer, win\\u{1b}ter\n"), "{text}");
    assert!(text.contains("textures   1: wood.png 6x4\n"), "{text}");
    desk.write("a.mtl", "newmtl m\nmap_Kd wood.png\n");
    desk.write("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 2 0 0\nv 0 3 0\nvt 0 1\nf 1/1 2/1 3/1\n");
    let pbrt = SPHERE.replace(
        "Material \"diffuse\" \"rgb reflectance\" [0.7 0.4 0.2]",
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"wood.png\" Material \"diffuse\" \"texture reflectance\" \"t\"",
    );
    desk.write("a.pbrt", &pbrt);
    for name in ["a.obj", "a.pbrt"] {
        let out = desk.lumbre(&["info", name, "--json"]);
        let info: Value = serde_json::from_str(&stdout(&out)).unwrap();
        assert_eq!(info["textures"][0]["name"], "wood.png", "{name}: {info} {}", stderr(&out));
        assert_eq!(info["textures"][0]["width"].as_u64(), Some(6));
    }
}

#[test]
fn parameters_are_set_in_any_scene_and_wrong_ones_are_answered() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    desk.write("a.mtl", "newmtl red\nKd 1 0 0\n");
    desk.write("a.obj", &format!("mtllib a.mtl\nusemtl red\n{OBJ}"));
    let render = |scene: &str, more: &[&str]| {
        let common = [scene, "-o", "a.pfm", "--spp", "4", "--size", "48x32", "--integrator", "albedo", "-q"];
        let out = desk.lumbre(&[&common[..], more].concat());
        assert_eq!(code(&out), 0, "{more:?}: {}", stderr(&out));
        // The colour of what is seen, wherever it is.
        let image = image(&desk, "a.pfm");
        let brightest = image.pixels().iter().max_by(|a, b| a.luminance().total_cmp(&b.luminance()));
        brightest.unwrap().to_array()
    };
    assert!(render("a.obj", &[])[0] > 0.9);
    let green = render("a.obj", &["-D", "material.red.reflectance=0,0.5,0"]);
    assert!(green[0] < 0.01 && (green[1] - 0.5).abs() < 0.01, "{green:?}");
    desk.write("overlay.txt", "# paint\n\n  material.red.reflectance = 0,0,0.25\ncamera.fov=1\n");
    let out = desk.lumbre(&["a.obj", "--overlay", "overlay.txt"]);
    assert_eq!(code(&out), 3);
    assert!(stderr(&out).starts_with("error: overlay.txt:4:1: the scene has no camera"), "{}", stderr(&out));
    desk.write("overlay.txt", "# paint\n  material.red.reflectance = 0,0,0.25\n");
    // What stands on the command line comes last.
    assert!((render("a.obj", &["--overlay", "overlay.txt"])[2] - 0.25).abs() < 0.01);
    let grey = ["--overlay", "overlay.txt", "-D", "material.red.reflectance=0.5"];
    assert!((render("a.obj", &grey)[0] - 0.5).abs() < 0.01);
    assert!((render("scene.pbrt", &["-D", "material.1.reflectance=0.125"])[1] - 0.125).abs() < 0.01);
    for (setting, expected) in [
        ("material.rd.reflectance=1", "did you mean \"red\"?"),
        ("material.red.gloss=1", "expected reflectance"),
        ("red=1", "material.NAME.PARAM=VALUE"),
    ] {
        let out = desk.lumbre(&["a.obj", "-D", setting]);
        assert_eq!(code(&out), 2, "{setting}: {}", stderr(&out));
        assert!(stderr(&out).contains(expected), "{setting}: {}", stderr(&out));
    }
}

#[test]
fn a_damaged_file_is_told_with_its_byte_and_who_named_it() {
    let desk = Desk::new();
    let grey = lumbre::image::Image::filled(6, 4, lumbre::image::Rgb::new(0.1, 0.2, 0.3));
    lumbre::write_image(&desk.path("wood.png"), &grey, &lumbre::SaveOptions::default()).unwrap();
    let bytes = fs::read(desk.path("wood.png")).unwrap();
    fs::write(desk.path("wood.png"), &bytes[..bytes.len() - 20]).unwrap();
    fs::write(desk.path("m.ply"), PLY.replace("0 3 0", "0 x 0")).unwrap();
    desk.write(
        "t.pbrt",
        "WorldBegin\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"wood.png\"\n\
         Material \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"\n",
    );
    desk.write("m.pbrt", "WorldBegin\nInclude \"n.pbrt\"\n");
    desk.write("n.pbrt", "\n  Shape \"plymesh\" \"string filename\" \"m.ply\"\n");
    for (scene, file, places) in [
        ("t.pbrt", "wood.png:byte ", &["included from t.pbrt:2:"][..]),
        ("m.pbrt", "m.ply:12:3: ", &["included from n.pbrt:2:", "included from m.pbrt:2:"]),
    ] {
        let out = desk.lumbre(&["info", scene]);
        assert_eq!(code(&out), 3, "{}", stderr(&out));
        let text = stderr(&out);
        assert!(text.starts_with(&format!("error: {file}")), "{text}");
        for (line, place) in text.lines().skip(1).zip(places) {
            assert!(line.trim_start().starts_with(place), "{text}");
        }
        assert_eq!(text.lines().count(), 1 + places.len(), "{text}");
    }
}

#[test]
fn shading_normals_are_those_of_the_option_else_of_the_scene() {
    let desk = Desk::new();
    let world = "Film \"rgb\" \"integer xresolution\" 12 \"integer yresolution\" 9 \"bool savefp16\" false\n\
        Sampler \"independent\" \"integer pixelsamples\" 3\n\
        LookAt 1 -9 3  0 0 0  0 0 1\nCamera \"perspective\" \"float fov\" 20\nWorldBegin\n\
        LightSource \"point\" \"point3 from\" [ 6 0.5 -0.2 ] \"rgb I\" [ 50 60 70 ]\n\
        Shape \"trianglemesh\" \"point3 P\" [ -2 -1 0  2 -1 0  0 2 0.5 ] \"normal N\" [ 1 -0.3 1  1 -0.3 1  1 -0.3 1 ]\n";
    desk.write("ours.pbrt", &format!("Integrator \"path\"\n{world}"));
    desk.write("pbrt.pbrt", &format!("Integrator \"path\" \"string shadingnormals\" \"pbrt\"\n{world}"));
    for (scene, normals, picture) in [
        ("ours.pbrt", None, "default.pfm"),
        ("ours.pbrt", Some("lumbre"), "lumbre.pfm"),
        ("ours.pbrt", Some("pbrt"), "pbrt.pfm"),
        ("pbrt.pbrt", None, "scene.pfm"),
        ("pbrt.pbrt", Some("lumbre"), "back.pfm"),
    ] {
        let mut arguments = vec!["render", scene, "-o", picture, "--quiet"];
        arguments.extend(normals.iter().flat_map(|normals| ["--shading-normals", normals]));
        let out = desk.lumbre(&arguments);
        assert_eq!(code(&out), 0, "{arguments:?}: {}", stderr(&out));
    }
    let bytes = |name: &str| fs::read(desk.path(name)).unwrap();
    assert!(image(&desk, "pbrt.pfm").pixels().iter().any(|pixel| pixel.g > 0.0));
    for (a, b, same) in [
        ("default.pfm", "lumbre.pfm", true),
        ("default.pfm", "back.pfm", true),
        ("pbrt.pfm", "scene.pfm", true),
        ("default.pfm", "pbrt.pfm", false),
    ] {
        assert_eq!(bytes(a) == bytes(b), same, "{a} {b}");
    }
}

#[test]
fn a_picture_in_which_next_to_nothing_is_lit_comes_with_a_hint() {
    let desk = Desk::new();
    let room = |light: &str, eye: &str| {
        format!(
            "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 12\nSampler \"independent\" \"integer pixelsamples\" 4\n\
             LookAt {eye}  0 0.5 -3  0 1 0\nCamera \"perspective\"\nWorldBegin\n{light}\n\
             Shape \"box\" \"point3 p0\" [ -3 -2 -3 ] \"point3 p1\" [ 3 2.5 3 ]\n"
        )
    };
    let sky = "LightSource \"infinite\" \"rgb L\" [ 1 2 3 ]";
    let lamp = "LightSource \"point\" \"rgb I\" [ 9 8 7 ]";
    let faint = "LightSource \"point\" \"rgb I\" [ 1e-4 1e-4 1e-4 ]";
    let (inside, outside) = ("0.5 1 2", "0.5 1 12");
    for (name, light, eye, more, is_hinted) in [
        ("the sky stays outside", sky, inside, &[][..], true),
        ("the lamp stays inside", lamp, outside, &[], true),
        ("a faint lamp", faint, inside, &[], true),
        ("a faint lamp, exposed for", faint, inside, &["--exposure", "12"], false),
        ("a lamp", lamp, inside, &[], false),
        ("no picture of light", sky, inside, &["--integrator", "depth"], false),
        ("nobody wants to hear it", sky, inside, &["--quiet"], false),
    ] {
        desk.write("room.pbrt", &room(light, eye));
        let out = desk.lumbre(&[&["render", "room.pbrt", "-o", "a.png"], more].concat());
        assert_eq!(code(&out), 0, "{name}: {}", stderr(&out));
        let said = stderr(&out);
        let words = ["hint: ", "--env", "--exposure", "--fit", "--eye and --target"];
        assert_eq!(words.map(|word| said.contains(word)), [is_hinted; 5], "{name}: {said}");
    }
}

#[test]
fn diff_takes_one_of_its_pictures_from_standard_input() {
    let desk = Desk::new();
    let grey = |value: f32| lumbre::image::Image::filled(6, 4, lumbre::image::Rgb::splat(value));
    for (name, value) in [("a.exr", 0.5), ("b.exr", 0.75)] {
        lumbre::write_image(&desk.path(name), &grey(value), &lumbre::SaveOptions::default()).unwrap();
    }
    let bytes = fs::read(desk.path("a.exr")).unwrap();
    for (arguments, expected) in [(["diff", "-", "b.exr"], "0.25\n"), (["diff", "a.exr", "-"], "0\n")] {
        let out = with_input(&desk, &arguments, &bytes);
        assert_eq!((code(&out), stdout(&out)), (0, expected.to_owned()), "{}", stderr(&out));
    }
    let out = with_input(&desk, &["diff", "-", "b.exr"], &bytes[..bytes.len() - 9]);
    assert_eq!(code(&out), 3);
    assert!(stderr(&out).starts_with("error: standard input:byte "), "{}", stderr(&out));
    assert_eq!(code(&with_input(&desk, &["diff", "-", "-"], &bytes)), 2);
}

#[test]
fn a_model_on_a_plane_of_z_has_z_up_by_default() {
    let desk = Desk::new();
    // A pole on a wide slab.
    let box_of = |[x, y, from, to]: [f64; 4], first: usize| {
        let mut text = String::new();
        for i in 0..8 {
            let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let z = if i >> 2 & 1 == 1 { to } else { from };
            text += &format!("v {} {} {z}\n", sign(0) * x, sign(1) * y);
        }
        for quad in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            let corners: Vec<String> = quad.iter().map(|corner| (corner + first).to_string()).collect();
            text += &format!("f {}\n", corners.join(" "));
        }
        text
    };
    let pole = box_of([3.0, 2.0, 0.0, 0.5], 1) + &box_of([0.4, 0.3, 0.5, 6.0], 9);
    desk.write("pole.obj", &pole);
    let render = |more: &[&str], picture: &str| {
        let out =
            desk.lumbre(&[&["pole.obj", "-o", picture, "--size", "24x24", "--spp", "1"], more].concat());
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        stderr(&out).contains("z is up")
    };
    assert!(render(&[], "guessed.pfm"));
    assert!(!render(&["--up", "z"], "z.pfm") && !render(&["--up", "y"], "y.pfm"));
    let bytes = |name: &str| fs::read(desk.path(name)).unwrap();
    assert!(bytes("guessed.pfm") == bytes("z.pfm") && bytes("guessed.pfm") != bytes("y.pfm"));
    assert!(!render(&["--eye", "9,8,7", "--up", "y"], "eye.pfm"));
}
