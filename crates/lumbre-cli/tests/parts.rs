//! Parts and checkpoints: whatever happens to a render, its picture has the same bytes.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::time::{Duration, Instant};

use crate::files::{Folder, answer};

const SCENE: &str = r#"
Film "rgb" "integer xresolution" 33 "integer yresolution" 21 "string filename" "film.exr"
Sampler "zsobol" "integer pixelsamples" 9
LookAt 0 -6 2  0 0 0.5  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.4 0.5 0.6]
Texture "wood" "spectrum" "imagemap" "string filename" "wood.png"
Material "diffuse" "texture reflectance" "wood"
Shape "disk" "float radius" 4
Material "dielectric"
Translate 0 0 1
Shape "sphere"
"#;

pub(crate) fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.pbrt", SCENE);
    wood(&folder, [0.8, 0.5, 0.2]);
    folder
}

fn wood(folder: &Folder, colour: [f32; 3]) {
    let image = lumbre::image::Image::from_pixels(1, 1, vec![colour.into()]).unwrap();
    lumbre::write_image(&folder.path("wood.png"), &image, &lumbre::SaveOptions::default()).unwrap();
}

fn run(folder: &Folder, arguments: &str) -> (i32, String) {
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    answer(folder.command(&arguments).output().unwrap())
}

pub(crate) fn done(folder: &Folder, arguments: &str) {
    let (status, said) = run(folder, arguments);
    assert_eq!(status, 0, "{arguments}: {said}");
}

/// Waits until a checkpoint is there that has a sample of every pixel.
pub(crate) fn until_sampled(folder: &Folder, name: &str) {
    let start = Instant::now();
    let is_sampled = || {
        let part = lumbre::Part::open(&folder.path(name), |_| u64::MAX);
        part.is_ok_and(|part| part.state.least_samples() > 0)
    };
    while !is_sampled() {
        assert!(start.elapsed() < Duration::from_secs(60), "{name} does not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// It fails with this status, and says this.
pub(crate) fn refused(folder: &Folder, arguments: &str, status: i32, why: &str) {
    let (found, said) = run(folder, arguments);
    assert!(found == status && said.contains(why), "{arguments}: {found}, {said}");
}

pub(crate) fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    fs::read(folder.path(name)).unwrap()
}

#[cfg(unix)]
pub(crate) fn signal(id: u32, name: &str) {
    let sent = std::process::Command::new("kill").args([format!("-{name}"), id.to_string()]).status();
    assert!(sent.unwrap().success());
}

/// Waits, far longer than it should take: a test measures no time.
pub(crate) fn until_there(folder: &Folder, name: &str) {
    let start = Instant::now();
    while !folder.path(name).exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "{name} does not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn merged_parts_are_the_file_of_one_run() {
    let folder = folder();
    for (name, more) in [("whole.exr", ""), ("whole.png", "--tonemap agx --exposure 0.5")] {
        done(&folder, &format!("render scene.pbrt -o {name} {more}"));
        for (part, crop, samples) in [
            ("a.part", "0,0,20,21", "0..4"),
            ("b.exr", "0,0,20,21", "4..9"),
            ("c.part", "20,0,33,21", "0..1"),
            ("d.part", "20,0,33,21", "1..8"),
            ("e.part", "20,0,33,21", "8..9"),
        ] {
            done(
                &folder,
                &format!("render scene.pbrt -o {part} --crop {crop} --samples {samples} {more} --threads 1"),
            );
        }
        done(&folder, "merge d.part a.part -o ad.part --allow-gaps");
        done(&folder, "merge c.part e.part -o ce.part --allow-gaps");
        done(&folder, &format!("merge ce.part b.exr ad.part -o merged.{name}"));
        assert_eq!(bytes(&folder, &format!("merged.{name}")), bytes(&folder, name), "{name}");
    }
    // An .exr of a part is a picture, too.
    let part = lumbre::read_image(&folder.path("b.exr")).unwrap();
    for (i, pixel) in part.pixels().iter().enumerate() {
        assert_eq!(pixel.max_component() > 0.0, i % 33 < 20, "{i}");
    }
}

/// A triangle that slides to a side within a second.
const SLIDING: &str = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"scene":0,
"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
"buffers":[{"byteLength":68,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAABAAAAAAAAAAAA="}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},{"buffer":0,"byteOffset":44,"byteLength":24}],
"accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"type":"SCALAR","count":2,"min":[0],"max":[1]},
{"bufferView":2,"componentType":5126,"type":"VEC3","count":2}],
"animations":[{"samplers":[{"input":1,"output":2}],"channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}]}"#;

#[test]
fn parts_of_several_frames_are_merged_at_once() {
    let folder = Folder::new();
    folder.write("slide.gltf", SLIDING);
    let render = "render slide.gltf --frames 0..1 --fps 4 --size 20x15 -q";
    done(&folder, &format!("{render} --spp 3 --denoise none -o whole.#.exr"));
    done(&folder, &format!("{render} --samples 0..1 -o a.#.part"));
    done(&folder, &format!("{render} --samples 1..3 -o b.#.part"));
    done(&folder, "merge b.1.part a.0.part a.1.part b.0.part -o f.#.exr");
    for frame in 0..2 {
        assert_eq!(bytes(&folder, &format!("f.{frame}.exr")), bytes(&folder, &format!("whole.{frame}.exr")));
    }
    assert_ne!(bytes(&folder, "f.0.exr"), bytes(&folder, "f.1.exr"));
    refused(
        &folder,
        "merge a.0.part a.1.part b.0.part -o g.#.exr",
        3,
        "g.1.exr: 600 samples missing: samples 1..3",
    );
    refused(&folder, "merge a.0.part b.1.part -o g.exr", 3, "of another render than a.0.part: ");
    done(&folder, "render slide.gltf --size 20x15 --samples 0..1 -q -o one.part");
    refused(&folder, "merge one.part -o g.#.exr", 3, "one.part: not a part of a frame");
}

#[test]
fn missing_doubled_foreign_and_damaged_parts_are_named() {
    let folder = folder();
    done(&folder, "render scene.pbrt -o a.part --samples 0..3");
    done(&folder, "render scene.pbrt -o b.part --samples 2..5");
    done(&folder, "render scene.pbrt -o c.part --samples 5..6");
    done(&folder, "render scene.pbrt -o seed.part --samples 3..5 --seed 4");
    refused(
        &folder,
        "merge a.part b.part -o x.exr",
        3,
        "b.part: overlaps a.part: both have samples 2..3 of pixels 0,0,33,21; leave one out",
    );
    refused(
        &folder,
        "merge a.part c.part -o x.exr",
        3,
        "missing: samples 3..5 of pixels 0,0,33,21 (--allow-gaps",
    );
    refused(&folder, "merge c.part -o x.exr", 3, "missing: samples 0..5");
    refused(
        &folder,
        "merge a.part seed.part -o x.exr",
        3,
        "of another render than a.part: seed 0 there, 4 here",
    );
    refused(&folder, "merge a.part scene.pbrt -o x.exr", 3, "scene.pbrt: not a part of a render");
    refused(&folder, "merge a.part nothing.part -o x.exr", 4, "nothing.part: cannot open");
    fs::create_dir(folder.path("parts")).unwrap();
    refused(&folder, "merge parts -o x.exr", 4, "parts: cannot open: it is a folder");
    refused(&folder, "merge a.part b.part -o a.part", 2, "a.part: this is an input");
    refused(
        &folder,
        "render scene.pbrt -o a.png --samples 0..3",
        2,
        "expected a name that ends in .exr or .part",
    );
    refused(&folder, "render scene.pbrt -o a.part", 2, "a .part needs --samples A..B");
    let piped = fs::File::open(folder.path("scene.pbrt")).unwrap();
    let mut command = folder.command(&["render", "-", "-o", "a.part", "--samples", "0..3"]);
    let (status, said) = answer(command.stdin(piped).output().unwrap());
    assert!(status == 2 && said.contains("needs a scene that can be read again"), "{said}");
    refused(&folder, "render scene.pbrt -o a.part --samples 3..3", 2, "the one after the last");
    refused(&folder, "render scene.pbrt -o a.part --samples 0..3 --noise 0.1", 2, "cannot be used with");
    let part = bytes(&folder, "a.part");
    for place in [0, 20, part.len() / 2, part.len() - 1] {
        let mut damaged = part.clone();
        damaged[place] ^= 4;
        fs::write(folder.path("damaged.part"), damaged).unwrap();
        let why = if place == 0 { "not a part of a render" } else { "checksum" };
        refused(&folder, "merge damaged.part c.part -o x.exr", 3, why);
    }
    fs::write(folder.path("damaged.part"), &part[..part.len() / 2]).unwrap();
    refused(&folder, "merge damaged.part c.part -o x.exr", 3, "damaged");
    assert!(!folder.path("x.exr").exists());
    // An asset that has changed makes it another render.
    wood(&folder, [0.8, 0.5, 0.3]);
    done(&folder, "render scene.pbrt -o d.part --samples 3..5");
    refused(
        &folder,
        "merge a.part d.part -o x.exr",
        3,
        "of another render than a.part: file wood.png changed",
    );
    let (_, about) = answer(folder.command(&["info", "d.part"]).output().unwrap());
    let about = if about.is_empty() {
        String::from_utf8(folder.command(&["info", "d.part"]).output().unwrap().stdout).unwrap()
    } else {
        about
    };
    assert!(about.contains("samples    3..5 of pixels 0,0,33,21"), "{about}");
}

#[test]
fn parts_with_two_tone_mappings_merge_with_the_given_one() {
    let folder = folder();
    done(&folder, "render scene.pbrt -q -o a.part --samples 0..2 --exposure 1.5 --tonemap agx");
    done(&folder, "render scene.pbrt -q -o b.part --samples 2..4");
    let asked = "--exposure 1.5 --tonemap agx";
    done(&folder, &format!("render scene.pbrt -q -o whole.png --spp 4 {asked}"));
    for parts in ["a.part b.part", "b.part a.part"] {
        refused(&folder, &format!("merge {parts} -o x.png"), 2, "--exposure EV sets one for all");
        refused(&folder, &format!("merge {parts} -o x.part"), 2, "--tonemap NAME sets one for all");
        refused(&folder, &format!("merge {parts} -o x.png --exposure 1.5"), 2, "tone map");
        done(&folder, &format!("merge {parts} -o x.png {asked}"));
        assert_eq!(bytes(&folder, "x.png"), bytes(&folder, "whole.png"), "{parts}");
        fs::remove_file(folder.path("x.png")).unwrap();
    }
    // Those of one way are shown in another one when that is asked for.
    done(&folder, "render scene.pbrt -q -o c.part --samples 0..2");
    done(&folder, &format!("merge c.part b.part -o x.png {asked}"));
    assert_eq!(bytes(&folder, "x.png"), bytes(&folder, "whole.png"));
}

/// A part whose head is true to the form, and whose planes are all zeros, which take no bytes: of a picture of this
/// size.
fn forged(folder: &Folder, (width, height): (u32, u32)) -> Vec<u8> {
    done(folder, "render scene.pbrt -q -o small.part --samples 0..1 --size 20x14");
    let mut part = lumbre::Part::open(&folder.path("small.part"), |_| u64::MAX).unwrap();
    part.job.size = (width, height);
    let whole = part.to_bytes();
    let start = 14 + 8 + u64::from_le_bytes(whole[14..22].try_into().unwrap()) as usize;
    // Corners, flags and buckets, one piece, no dropped samples, counts of rays and the rest: then the planes.
    let head = &whole[start..start + 16 + 28 + 4 + 24 + 4 + 48];
    assert_eq!(head[..16], [0u32, 0, 20, 14].map(u32::to_le_bytes).concat());
    let sealed = |head: &[u8], planes: usize| {
        let mut bytes = [&whole[..start], head, &vec![0; planes]].concat();
        let checksum = blake3::hash(&bytes);
        bytes.extend(checksum.as_bytes());
        bytes
    };
    let planes = (0..99).find(|&planes| lumbre::Part::from_bytes(&sealed(head, planes), u64::MAX).is_ok());
    // One for each strip of sixteen rows; the small picture has one strip.
    let planes = planes.map(|planes| planes * height.div_ceil(16) as usize);
    let mut head = head.to_vec();
    head[8..12].copy_from_slice(&width.to_le_bytes());
    head[12..16].copy_from_slice(&height.to_le_bytes());
    sealed(&head, planes.expect("as many planes as there are sums"))
}

#[test]
fn a_part_that_claims_much_memory_is_refused_unread() {
    let folder = folder();
    for size in [(1000, 1000), (7000, 7000), (20_000, 20_000)] {
        let bytes = forged(&folder, size);
        assert!(bytes.len() < 1 << 15, "{}", bytes.len());
        fs::write(folder.path("forged.part"), bytes).unwrap();
        for command in [
            "merge forged.part -o x.exr",
            "info forged.part",
            "render scene.pbrt -o x.exr --checkpoint forged.part --resume",
        ] {
            let (status, said) = run(&folder, command);
            assert!(
                status == 5 && said.contains("--max-memory") && !said.contains("damaged"),
                "{command}: {status} {said}"
            );
        }
    }
    // Who lets it take as much has it read: it has no samples.
    let small = forged(&folder, (1000, 1000));
    fs::write(folder.path("forged.part"), small).unwrap();
    refused(&folder, "merge forged.part -o x.exr --max-memory 1G", 3, "unfinished");
    // And what claims pixels outside of its picture is damaged.
    let mut part = lumbre::Part::open(&folder.path("small.part"), |_| u64::MAX).unwrap();
    part.job.size = (19, 14);
    part.save(&folder.path("narrow.part")).unwrap();
    refused(&folder, "merge narrow.part -o x.exr", 3, "its pixels are not those of its picture");
}

#[test]
fn text_of_a_part_is_escaped_for_the_terminal() {
    let folder = folder();
    done(&folder, "render scene.pbrt -q -o a.part --samples 0..1 --lenient --eye 1,-6,2.5 --background #fa0");
    let mut part = lumbre::Part::open(&folder.path("a.part"), |_| u64::MAX).unwrap();
    let told =
        |arguments: &[&str]| String::from_utf8(folder.command(arguments).output().unwrap().stdout).unwrap();
    let about = told(&["info", "a.part"]);
    for debug in ["Some(", "None", " {", "Path", "DVec3", "_"] {
        assert!(!about.contains(debug), "{debug}: {about}");
    }
    assert!(about.contains("integrator path\n") && about.contains("files      scene.pbrt"), "{about}");
    let all = told(&["info", "a.part", "--json"]);
    assert!(all.contains("eye dvec3 1.0, -6.0, 2.5"), "{all}");
    part.job
        .identity
        .insert("file a\x1b[2J\n  taken 7 of 7".to_owned(), "\x1b]0;x\x07\u{9b}31m\u{202e}\n  b".to_owned());
    part.save(&folder.path("a.part")).unwrap();
    for arguments in [&["info", "a.part"][..], &["info", "a.part", "--json"]] {
        let about = told(arguments);
        let is_plain = |c: char| c == '\n' || !(c.is_control() || c == '\u{202e}');
        assert!(about.chars().all(is_plain) && about.contains("taken 7 of 7"), "{about:?}");
        assert!(!about.lines().any(|line| line.trim_start().starts_with("taken 7")), "{about}");
    }
}

#[test]
fn a_finished_picture_takes_more_samples() {
    let folder = folder();
    done(&folder, "render scene.pbrt -o whole.exr --spp 9 --keep-sums");
    done(&folder, "render scene.pbrt -o few.exr --spp 4 --keep-sums");
    done(&folder, "render scene.pbrt -o few.exr --spp 9 --keep-sums --resume");
    assert_eq!(bytes(&folder, "few.exr"), bytes(&folder, "whole.exr"));
    done(&folder, "render scene.pbrt -o plain.exr --spp 4");
    refused(
        &folder,
        "render scene.pbrt -o plain.exr --spp 9 --resume",
        2,
        "or a picture saved with --keep-sums",
    );
    refused(
        &folder,
        "render scene.pbrt -o few.exr --spp 9 --resume --max-depth 2",
        2,
        "of another render than this one: integrator max depth 5 there, max depth 2 here",
    );
    done(&folder, "render scene.pbrt -o new.exr --spp 9 --resume --checkpoint new.ck --keep-sums");
    assert_eq!(bytes(&folder, "new.exr"), bytes(&folder, "whole.exr"));
    // The checkpoint that was asked for holds the finished render.
    done(&folder, "render scene.pbrt -o new.exr --spp 11 --resume --checkpoint new.ck");
    done(&folder, "render scene.pbrt -o eleven.exr --spp 11");
    assert_eq!(bytes(&folder, "new.exr"), bytes(&folder, "eleven.exr"));
    assert!(!folder.names().iter().any(|name| name.ends_with(".lock") || name == "eleven.exr.checkpoint"));
}

#[test]
fn a_picture_says_what_it_depends_on() {
    let folder = folder();
    let says =
        |name: &str, what: &str| bytes(&folder, name).windows(what.len()).any(|here| here == what.as_bytes());
    for name in ["a.exr", "a.png"] {
        done(&folder, &format!("render scene.pbrt -o {name} --spp 2 --seed 77"));
        for what in
            ["lumbreVersion", "lumbreScene", "lumbreSeed", "77", "lumbreSamples", "0..2", "lumbreCamera"]
        {
            assert!(says(name, what), "{name}: {what}");
        }
        assert!(!says(name, "lumbreCommand"));
        let first = bytes(&folder, name);
        done(&folder, &format!("render scene.pbrt -o {name} --spp 2 --seed 77 --threads 1"));
        assert_eq!(bytes(&folder, name), first, "{name}");
        done(&folder, &format!("render scene.pbrt -o {name} --spp 2 --seed 77 --metadata full"));
        assert!(says(name, "lumbreCommand") && says(name, "--metadata full"), "{name}");
    }
}

#[cfg(unix)]
mod interrupted {
    use std::process::Stdio;

    use super::*;

    const RENDER: &str =
        "render scene.pbrt --spp 4000 --size 20x14 --threads 2 --progress none --checkpoint-every 20ms";

    #[test]
    fn a_render_killed_many_times_gives_the_same_bytes() {
        let folder = folder();
        let arguments: Vec<&str> =
            RENDER.split_whitespace().chain(["-o", "a.exr", "--checkpoint", "ck", "--resume"]).collect();
        let kills = if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 300 } else { 6 };
        let mut held = 0;
        for i in 0..kills {
            let mut child = folder.command(&arguments).stderr(Stdio::null()).spawn().unwrap();
            std::thread::sleep(Duration::from_micros(60_000 + (i * 137_003) % 300_000));
            signal(child.id(), ["KILL", "INT", "KILL", "TERM"][i as usize % 4]);
            let _ = child.wait().unwrap();
            let path = folder.path("ck");
            if path.exists() {
                let taken = lumbre::Part::open(&path, |_| u64::MAX).unwrap().state.taken();
                assert!(taken >= held, "{taken} {held}");
                held = taken;
            }
        }
        assert!(held > 0, "it never kept anything");
        // The samples of the killed runs and a few more: the rest is rendered by one run.
        let most = lumbre::Part::open(&folder.path("ck"), |_| u64::MAX).unwrap().state.most_samples();
        refused(
            &folder,
            &format!("{} -o a.exr --checkpoint ck --resume", RENDER.replace("4000", "1")),
            2,
            "per pixel already",
        );
        let enough = RENDER.replace("4000", &(most + 1).to_string());
        done(&folder, &format!("{enough} -o a.exr --checkpoint ck --resume"));
        done(&folder, &format!("{enough} -o b.exr --no-checkpoint"));
        assert_eq!(bytes(&folder, "a.exr"), bytes(&folder, "b.exr"));
    }

    #[test]
    fn a_picture_that_cannot_be_saved_is_kept_elsewhere() {
        let folder = folder();
        fs::create_dir(folder.path("out")).unwrap();
        let render = format!("{RENDER} -o out/a.exr --checkpoint ck");
        let arguments: Vec<&str> = render.split_whitespace().collect();
        let child = folder.command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
        until_sampled(&folder, "ck");
        fs::remove_dir(folder.path("out")).unwrap();
        signal(child.id(), "INT");
        let (status, said) = answer(child.wait_with_output().unwrap());
        assert!(
            status == 4 && said.contains("the samples are saved in ./a.exr.rescued.0.part"),
            "{status} {said}"
        );
        let part = lumbre::Part::open(&folder.path("a.exr.rescued.0.part"), |_| u64::MAX).unwrap();
        assert!(part.state.least_samples() > 0);
    }

    #[test]
    fn a_picture_is_saved_even_if_its_checkpoint_cannot_be() {
        let folder = folder();
        fs::create_dir(folder.path("out")).unwrap();
        let render = format!("{RENDER} -o a.exr --checkpoint out/ck");
        let arguments: Vec<&str> = render.split_whitespace().collect();
        let child = folder.command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
        until_sampled(&folder, "out/ck");
        // A checkpoint may be written while the folder is emptied.
        while folder.path("out").exists() {
            let _ = fs::remove_dir_all(folder.path("out"));
        }
        signal(child.id(), "INT");
        let (status, said) = answer(child.wait_with_output().unwrap());
        assert!(status == 130 && said.contains("warning: cannot write the checkpoint"), "{status} {said}");
        assert!(folder.path("a.exr").exists(), "{said}");
    }

    #[test]
    fn pipes_devices_and_files_of_the_system_are_not_waited_for() {
        let folder = folder();
        for name in ["pipe.pbrt", "pipe.part", "pipe.ply", "out.exr.checkpoint"] {
            assert!(std::process::Command::new("mkfifo").arg(folder.path(name)).status().unwrap().success());
        }
        folder.write("names.pbrt", "WorldBegin Shape \"plymesh\" \"string filename\" \"pipe.ply\"");
        for (arguments, why) in [
            ("render pipe.pbrt -o a.png", "it is not a regular file"),
            (
                "render names.pbrt -o a.png",
                "names.pbrt:1:28: pipe.ply: cannot read: it is not a regular file",
            ),
            ("info pipe.pbrt", "it is not a regular file"),
            ("merge pipe.part -o a.png", "it is not a regular file"),
            ("merge /dev/zero -o a.png", "it is not a regular file"),
            #[cfg(target_os = "linux")]
            ("merge /proc/self/pagemap -o a.png", "of the system's own"),
            #[cfg(target_os = "linux")]
            ("render /proc/self/environ --input-format pbrt -o a.png", "of the system's own"),
            (
                "render scene.pbrt -o a.png --checkpoint pipe.part",
                "not a regular file (expected one for a checkpoint)",
            ),
            (
                "render scene.pbrt -o a.png --checkpoint /dev/null --resume",
                "not a regular file (expected one for a checkpoint)",
            ),
            (
                "render scene.pbrt -o a.png --checkpoint .",
                "not a regular file (expected one for a checkpoint)",
            ),
            ("render scene.pbrt -o a.png --stats pipe.ply", "nobody reads from this pipe"),
        ] {
            // What a scene names is an error of the scene.
            let status = if arguments.contains("names") { 3 } else { 4 };
            refused(&folder, arguments, status, why);
        }
        // Its name for a checkpoint is taken: it keeps none, and renders.
        done(&folder, "render scene.pbrt -q -o out.exr --spp 2");
        // One who reads gets the statistics.
        let reader = std::process::Command::new("cat")
            .arg(folder.path("pipe.ply"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        while run(&folder, "render scene.pbrt -q -o b.png --spp 2 --stats pipe.ply").0 != 0 {}
        let read = reader.wait_with_output().unwrap().stdout;
        assert!(serde_json::from_slice::<serde_json::Value>(&read).unwrap()["seconds"].is_object());
    }

    #[test]
    fn a_second_run_on_a_checkpoint_is_refused() {
        let folder = folder();
        let arguments: Vec<&str> =
            RENDER.split_whitespace().chain(["-o", "a.exr", "--checkpoint", "ck"]).collect();
        let mut first = folder.command(&arguments).stderr(Stdio::null()).spawn().unwrap();
        until_there(&folder, "ck");
        refused(
            &folder,
            &format!("{RENDER} -o b.exr --checkpoint ck --resume"),
            2,
            "another run writes this checkpoint",
        );
        fs::create_dir(folder.path("sub")).unwrap();
        std::os::unix::fs::symlink(folder.path("."), folder.path("sub/here")).unwrap();
        std::os::unix::fs::symlink("ck", folder.path("link")).unwrap();
        for name in ["./ck", "sub/../ck", "sub/here/ck", "link", "sub/here/link"] {
            let again = format!("{RENDER} -o b.exr --checkpoint {name} --resume");
            refused(&folder, &again, 2, "another run writes this checkpoint");
        }
        signal(first.id(), "TERM");
        assert_eq!(first.wait().unwrap().code(), Some(143));
        refused(
            &folder,
            &format!("{RENDER} -o b.exr --checkpoint ck"),
            2,
            "of an unfinished render (--resume continues from it",
        );
    }
}

#[test]
fn merge_opens_no_image_that_only_a_part_names() {
    let folder = folder();
    for (samples, name) in [("0..2", "a.part"), ("2..3", "b.part")] {
        done(&folder, &format!("render scene.pbrt -q -o {name} --samples {samples} --background wood.png"));
    }
    let merge = "merge a.part b.part -o joined.png";
    refused(&folder, merge, 2, "the parts use the background image wood.png: give it with --background");
    assert!(!folder.path("joined.png").exists());
    done(&folder, &format!("{merge} --background wood.png"));
    done(&folder, "render scene.pbrt -q -o whole.png --spp 3 --background wood.png");
    assert_eq!(bytes(&folder, "joined.png"), bytes(&folder, "whole.png"));
    refused(&folder, "merge a.part b.part -o wood.png --background wood.png", 2, "wood.png");
    // What needs no picture needs no image.
    done(&folder, "merge a.part b.part -o both.part");
    // A part that names something else, as one from a stranger may.
    let mut part = lumbre::Part::open(&folder.path("a.part"), |_| u64::MAX).unwrap();
    part.job.shown.insert("background".to_owned(), "file /dev/zero".to_owned());
    part.save(&folder.path("foreign.part")).unwrap();
    refused(
        &folder,
        "merge foreign.part -o x.png",
        2,
        "the background image /dev/zero: give it with --background",
    );
    done(&folder, "render scene.pbrt -q -o plain.part --samples 0..1 --background #fa0");
    refused(
        &folder,
        "merge plain.part -o x.png --background wood.png",
        2,
        "the parts have no background image",
    );
}

#[test]
fn pictures_of_a_series_that_are_done_are_not_rendered_again() {
    let folder = folder();
    let series = "render scene.pbrt --turntable 3 -o f.#.png --spp 2 --progress none --resume";
    let (status, said) = run(&folder, series);
    assert!(status == 0 && !said.contains("already rendered"), "{said}");
    let before = bytes(&folder, "f.2.png");
    fs::remove_file(folder.path("f.2.png")).unwrap();
    let (status, said) = run(&folder, series);
    assert_eq!((status, said.matches(": already rendered").count()), (0, 2), "{said}");
    assert!(said.contains("f.1.png: already") && said.contains("f.3.png: already"), "{said}");
    assert_eq!(bytes(&folder, "f.2.png"), before);
    // Others are not taken for them: more samples, another seed, and what is of no render.
    for (more, count) in [("--spp 3", 0), ("--seed 5", 0), ("", 2)] {
        fs::write(folder.path("f.1.png"), "no picture").unwrap();
        let (status, said) = run(
            &folder,
            &format!(
                "{} {more}",
                series.replace("--spp 2", if more.contains("spp") { "" } else { "--spp 2" })
            ),
        );
        assert_eq!((status, said.matches(": already rendered").count()), (0, count), "{more}: {said}");
        done(&folder, &format!("{series} -q"));
    }
}
