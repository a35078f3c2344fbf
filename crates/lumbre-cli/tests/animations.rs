//! Turntables and frames in one file.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;

use crate::program::{Desk, SPHERE, code, stderr};

const QUAD: &str = "v -3 0 0\nv 4 0 0\nv 4 2 1\nv -3 2 1\nf 1 2 3 4\n";

/// A turntable of three small pictures.
const TURN: [&str; 9] = ["render", "quad.obj", "--turntable", "3", "--size", "24x17", "--spp", "1", "-q"];

#[test]
fn a_turntable_is_one_gif() {
    let desk = Desk::new();
    desk.write("quad.obj", QUAD);
    let out = desk.lumbre(&[&TURN[..], &["-o", "turn.gif", "--fps", "10"]].concat());
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let bytes = fs::read(desk.path("turn.gif")).unwrap();
    assert!(bytes.starts_with(b"GIF89a\x18\0\x11\0"), "{:?}", &bytes[..16]);
    // The extension before each frame: four bytes, of which two are its time in hundredths of a second.
    let frames = bytes.windows(6).filter(|at| at[..3] == [0x21, 0xf9, 4] && at[4..] == [10, 0]).count();
    assert_eq!(frames, 3);
    let names: Vec<String> = fs::read_dir(desk.folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !["quad.obj", "turn.gif"].contains(&&**name))
        .collect();
    assert_eq!(names, [""; 0]);
}

#[test]
fn one_file_of_frames_needs_frames_and_cannot_be_resumed() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    desk.write("quad.obj", QUAD);
    let turn = |more: &[&str]| desk.lumbre(&[&TURN[..], more].concat());
    for (out, expected) in [
        (desk.lumbre(&["render", "scene.pbrt", "-o", "a.gif"]), "--turntable"),
        (turn(&["-o", "a.gif", "--resume"]), "#"),
        (turn(&["-o", "a.gif", "--aov", "depth"]), ".exr"),
        (turn(&["-o", "a.png"]), ".gif"),
        (turn(&["-o", "a.gif", "--background", "transparent"]), ".png"),
    ] {
        assert!(code(&out) == 2 && stderr(&out).contains(expected), "{}", stderr(&out));
    }
}

#[cfg(unix)]
#[test]
fn a_video_is_what_ffmpeg_makes_of_the_pixels() {
    use std::os::unix::fs::PermissionsExt;

    let desk = Desk::new();
    desk.write("quad.obj", QUAD);
    let video = |path: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_lumbre"));
        command.args(TURN).args(["-o", "turn.mp4"]).current_dir(desk.folder.path()).env("PATH", path);
        command.output().unwrap()
    };
    fs::create_dir(desk.path("bin")).unwrap();
    let bin = desk.path("bin").display().to_string();
    let out = video(&bin);
    assert!(code(&out) == 2 && stderr(&out).contains("ffmpeg"), "{}", stderr(&out));
    let path = format!("{bin}:{}", std::env::var("PATH").unwrap());
    let ffmpeg = |script: &str| {
        desk.write("bin/ffmpeg", &format!("#!/bin/sh\n[ \"$1\" = -version ] && exit 0\n{script}\n"));
        fs::set_permissions(desk.path("bin/ffmpeg"), fs::Permissions::from_mode(0o755)).unwrap();
    };
    // Its last argument is the file that it writes.
    ffmpeg("for last; do :; done\ncat > \"$last\"");
    let out = video(&path);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    assert_eq!(fs::read(desk.path("turn.mp4")).unwrap().len(), 3 * 24 * 17 * 3);
    ffmpeg("cat > /dev/null\necho no such codec >&2\nexit 1");
    let out = video(&path);
    assert!(code(&out) == 4 && stderr(&out).contains("ffmpeg: no such codec"), "{}", stderr(&out));
}
