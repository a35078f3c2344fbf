//! Signals and deadlines, wherever the program is.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::io::{Read as _, Write as _};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::files::{Folder, answer};

/// A light in a white room, where paths end by their depth alone.
const ROOM: &str = r#"
Film "rgb" "integer xresolution" WIDTH "integer yresolution" HEIGHT "string filename" "a.png"
Sampler "independent" "integer pixelsamples" 1000000
Integrator "path" "integer maxdepth" DEPTH
Camera "perspective" "float fov" 90
WorldBegin
Material "diffuse" "rgb reflectance" [1 1 1]
AttributeBegin
AreaLightSource "diffuse" "rgb L" [1 1 1]
Shape "sphere" "float radius" 0.125 "point3 center" [2 0 0]
AttributeEnd
ReverseOrientation
Shape "sphere" "float radius" 9
"#;

fn room(folder: &Folder, size: (u32, u32), depth: u32) {
    let scene = ROOM.replace("WIDTH", &size.0.to_string()).replace("HEIGHT", &size.1.to_string());
    folder.write("room.pbrt", &scene.replace("DEPTH", &depth.to_string()));
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// Waits, far longer than it should take: a test measures no time.
fn end_of(mut child: Child) -> (i32, String) {
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(start.elapsed() < Duration::from_secs(60), "it goes on");
        std::thread::sleep(Duration::from_millis(10));
    }
    answer(child.wait_with_output().unwrap())
}

fn start(folder: &Folder, arguments: &[&str]) -> Child {
    let mut command = folder.command(arguments);
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_signal_leaves_the_old_file_or_a_whole_new_one() {
    let folder = Folder::new();
    room(&folder, (8, 6), 5);
    let old = b"the old file".to_vec();
    let repeats = if std::env::var_os("LUMBRE_LONG_TESTS").is_some() { 100 } else { 12 };
    let mut saved = 0;
    for i in 0..repeats {
        fs::write(folder.path("a.png"), &old).unwrap();
        let child = start(&folder, &["render", "room.pbrt", "-o", "a.png", "--progress", "none"]);
        // From before it listens until well into the render, unevenly.
        std::thread::sleep(Duration::from_micros(30_000 + (i * 137_003) % 700_000));
        let (name, status) = [("INT", 130), ("TERM", 143)][i as usize % 2];
        signal(&child, name);
        let (code, said) = end_of(child);
        assert_eq!(code, status, "{said}");
        assert_eq!(folder.names(), ["a.png", "room.pbrt"], "{said}");
        if fs::read(folder.path("a.png")).unwrap() != old {
            let picture = lumbre::read_image(&folder.path("a.png")).unwrap();
            assert!(picture.pixels().iter().any(|p| p.max_component() > 0.0), "it is black");
            saved += 1;
        }
    }
    assert!(saved > 0, "it never saved");
}

#[test]
fn a_sample_without_end_is_not_waited_for() {
    let folder = Folder::new();
    // A path of two billion bounces.
    room(&folder, (40, 30), i32::MAX as u32);
    folder.write("a.png", "the old file");
    let child = start(&folder, &["render", "room.pbrt", "-o", "a.png", "--progress", "none"]);
    std::thread::sleep(Duration::from_millis(600));
    signal(&child, "TERM");
    let (code, said) = end_of(child);
    assert_eq!((code, said.contains("nothing was saved")), (143, true), "{said}");
    let child =
        start(&folder, &["render", "room.pbrt", "-o", "a.png", "--progress", "none", "--time", "300ms"]);
    let (code, said) = end_of(child);
    assert_eq!((code, said.contains("--time")), (5, true), "{said}");
    assert_eq!(fs::read(folder.path("a.png")).unwrap(), b"the old file");
    assert_eq!(folder.names(), ["a.png", "room.pbrt"]);
}

#[test]
fn a_signal_ends_reading_and_waiting_for_pipes() {
    let folder = Folder::new();
    room(&folder, (40, 30), 5);
    let made = Command::new("mkfifo").arg(folder.path("out.png")).status();
    assert!(made.is_ok_and(|made| made.success()));
    for arguments in [
        // Nobody writes, and nobody reads.
        &["cast", "room.pbrt", "--rays", "-", "-o", "hits.csv"][..],
        &["render", "room.pbrt", "-o", "out.png", "--spp", "1", "--progress", "none"],
        // The scene itself does not come.
        &["render", "-", "-o", "x.png"],
        &["info", "-"],
    ] {
        let mut command = folder.command(arguments);
        let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let _ = stdin.write_all(b"ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6\n");
        std::thread::sleep(Duration::from_millis(700));
        signal(&child, "TERM");
        let (code, said) = end_of(child);
        assert_eq!(code, 143, "{arguments:?}: {said}");
        drop(stdin);
    }
    assert_eq!(folder.names(), ["out.png", "room.pbrt"]);
    // A deadline ends it, too.
    let time = ["render", "room.pbrt", "-o", "out.png", "--time", "500ms", "--progress", "none"];
    let (code, said) = end_of(start(&folder, &time));
    assert_eq!((code, said.contains("nobody reads the picture")), (5, true), "{said}");
    let mut command = folder.command(&["render", "-", "-o", "x.png", "--time", "200ms"]);
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // To wait for a child closes what it has.
    let stdin = child.stdin.take();
    let (code, said) = end_of(child);
    drop(stdin);
    assert_eq!((code, said.contains("while reading the scene")), (5, true), "{said}");
}

#[test]
fn a_time_limit_in_the_first_pass_leaves_a_coarse_picture() {
    let folder = Folder::new();
    // So large that no machine ends a pass in time.
    room(&folder, (3000, 2000), 200);
    for time in ["1s", "1ms"] {
        // Whatever stands there: it was asked for.
        folder.write("a.png", "the old file");
        let arguments = ["render", "room.pbrt", "-o", "a.png", "--time", time, "--progress", "none"];
        let (code, said) = end_of(start(&folder, &arguments));
        assert_eq!(code, 0, "{said}");
        assert!(said.contains("the picture has one for"), "{said}");
        assert!(
            said.contains("a.png: 3000x2000, a coarse picture of ") && !said.contains("0 samples per pixel"),
            "{said}"
        );
        let picture = lumbre::read_image(&folder.path("a.png")).unwrap();
        // No band of it is empty.
        for y in (0..2000).step_by(16) {
            assert!((0..3000).any(|x| picture.pixel(x, y).max_component() > 0.0), "row {y}");
        }
    }
}

#[test]
fn progress_goes_by_whichever_limit_comes_first() {
    let folder = Folder::new();
    room(&folder, (8, 6), 5);
    for arguments in [&["--time", "700ms"][..], &["--time", "700ms", "--noise", "1e-9"], &["--spp", "300"]] {
        let common = ["render", "room.pbrt", "-o", "a.png", "--progress", "json"];
        let mut child = start(&folder, &[&common, arguments].concat());
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert!(child.wait().unwrap().success(), "{said}");
        let states = said.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
        let mut count = 0;
        for state in states {
            let share = state["share"].as_f64().unwrap();
            let (left, seconds) =
                (state["seconds_left"].as_f64().unwrap(), state["seconds"].as_f64().unwrap());
            assert!(0.0 < share && share <= 1.0 && left < 60.0, "{state}");
            // What came before the first sample takes no more time.
            assert!(left <= seconds * (1.0 / share - 1.0) + 1e-3, "{state}");
            assert!(state["samples"].as_u64() <= state["total"].as_u64(), "{state}");
            assert!(state["rays_per_second"].as_f64() > Some(0.0) && state["frame"].is_null(), "{state}");
            count += 1;
        }
        assert!(count > 0 || arguments[0] == "--spp", "{arguments:?}: {said}");
    }
}

/// Whether the parent process has the tests ignore a signal. The program leaves it so.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[test]
fn every_end_signal_keeps_picture_and_checkpoint() {
    let folder = Folder::new();
    room(&folder, (8, 6), 5);
    let arguments = [
        "render",
        "room.pbrt",
        "-o",
        "a.png",
        "--progress",
        "none",
        "--checkpoint",
        "ck",
        "--checkpoint-every",
        "20ms",
    ];
    // Repeated signals end it no earlier.
    for (name, status, times) in
        [("HUP", 129, 3), ("QUIT", 131, 1), ("USR1", 138, 3), ("XCPU", 152, 3), ("TERM", 143, 1)]
    {
        if is_ignored(status - 128) {
            eprintln!("SIG{name} is ignored here, as under nohup: it is left out");
            continue;
        }
        for file in ["a.png", "ck"] {
            let _ = fs::remove_file(folder.path(file));
        }
        let child = start(&folder, &arguments);
        crate::parts::until_sampled(&folder, "ck");
        for _ in 0..times {
            let _ = Command::new("kill")
                .args([format!("-{name}"), child.id().to_string()])
                .stderr(Stdio::null())
                .status();
        }
        let (code, said) = end_of(child);
        assert_eq!(code, status, "{name}: {said}");
        assert_eq!(folder.names(), ["a.png", "ck", "room.pbrt"], "{name}: {said}");
        assert!(lumbre::read_image(&folder.path("a.png")).is_ok());
        let part = lumbre::Part::open(&folder.path("ck"), |_| u64::MAX).unwrap();
        assert!(part.state.least_samples() > 0, "{name}");
    }
    fs::remove_file(folder.path("ck")).unwrap();
    // nohup has it ignore SIGHUP, which it does.
    let program = env!("CARGO_BIN_EXE_lumbre");
    let mut command = Command::new("sh");
    command
        .args(["-c", "trap '' HUP; exec \"$@\"", "sh", program])
        .args(arguments)
        .current_dir(folder.path(""));
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    crate::parts::until_sampled(&folder, "ck");
    signal(&child, "HUP");
    let before = fs::metadata(folder.path("ck")).unwrap().modified().unwrap();
    let start = Instant::now();
    while fs::metadata(folder.path("ck")).unwrap().modified().unwrap() == before {
        assert!(start.elapsed() < Duration::from_secs(60), "it does not go on");
        std::thread::sleep(Duration::from_millis(10));
    }
    signal(&child, "TERM");
    assert_eq!(end_of(child).0, 143);
}
