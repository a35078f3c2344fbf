//! Threads and memory that there are not.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;

use crate::files::{Folder, answer};

const SPHERE: &str = r#"
Film "rgb" "integer xresolution" 48 "integer yresolution" 32 "string filename" "sphere.png"
Sampler "sobol" "integer pixelsamples" 2
LookAt 0 -8 3  0 0 0  0 0 1
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [0.6 0.7 0.8]
Shape "plymesh" "string filename" "m.ply"
Shape "sphere" "float radius" 1.75 "point3 center" [0.25 0 0.5]
"#;

fn scene(folder: &Folder) {
    folder.write("scene.pbrt", SPHERE);
    folder.write(
        "m.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n2 0 0\n3 0 0\n2 1 0\n3 0 1 2\n",
    );
    folder.write("rays.csv", "ox,oy,oz,dx,dy,dz\n0.25,-5,0.5,0,1,0\n");
}

/// `lumbre` with these arguments in a shell that has set a limit first.
fn limited(folder: &Folder, shell: &mut Command, limit: &str, arguments: &[&str]) -> (i32, String) {
    shell.args(["-c", &format!("ulimit {limit} && exec \"$@\""), "sh", env!("CARGO_BIN_EXE_lumbre")]);
    let shell = shell.args(arguments).current_dir(folder.path("")).env_remove("RUST_MIN_STACK");
    answer(shell.output().unwrap())
}

#[test]
fn where_the_system_grants_no_threads_the_work_is_done_without() {
    // The system limits no one but plain users: another one than who runs the tests has no processes that count. Not
    // every sh can set this limit.
    let user = ["--reuid", "54321", "--regid", "54321", "--clear-groups"];
    let is_root = Command::new("setpriv").args(user).arg("true").output().is_ok_and(|o| o.status.success());
    if !is_root {
        println!("skipped: no other user to be");
        return;
    }
    let folder = Folder::new();
    scene(&folder);
    fs::set_permissions(folder.path(""), fs::Permissions::from_mode(0o777)).unwrap();
    let run = |arguments: &[&str]| {
        limited(&folder, Command::new("setpriv").args(user).arg("bash"), "-u 1", arguments)
    };
    if run(&["--version"]).0 != 0 {
        println!("skipped: the other user may not run the program");
        return;
    }
    for arguments in [
        &["render", "scene.pbrt", "-o", "a.pfm", "-q"][..],
        &["render", "scene.pbrt", "-o", "b.exr", "-q", "--threads", "7"],
        &["info", "scene.pbrt"],
        &["cast", "scene.pbrt", "--rays", "rays.csv", "-o", "hits.csv"],
        &["diff", "a.pfm", "a.pfm"],
    ] {
        let (code, said) = run(arguments);
        assert_eq!(code, 0, "{arguments:?}: {said}");
    }
    // The same bytes as on many.
    assert_eq!(folder.lumbre(&["render", "scene.pbrt", "-o", "c.pfm", "-q"]).0, 0);
    assert_eq!(fs::read(folder.path("a.pfm")).unwrap(), fs::read(folder.path("c.pfm")).unwrap());
}

#[test]
fn what_cannot_fit_into_memory_is_refused_before_work_begins() {
    let folder = Folder::new();
    scene(&folder);
    let film = SPHERE.replace("resolution\" 48", "resolution\" 20000").replace("\" 32", "\" 20000");
    folder.write("film.pbrt", &film);
    let quads: String =
        (0..4000).map(|i| format!("Shape \"sphere\" \"float radius\" {}.5\n", i % 7)).collect();
    folder.write("many.pbrt", &format!("{SPHERE}{quads}"));
    let world = |name: &str, lines: &dyn Fn(usize) -> String| {
        let lines: String = (0..10_000).map(lines).collect();
        folder.write(name, &format!("WorldBegin\n{lines}"));
    };
    world("shapes.pbrt", &|_| "Shape \"sphere\"\n".into());
    world("materials.pbrt", &|_| "Material \"diffuse\"\n".into());
    world("objects.pbrt", &|i| format!("ObjectBegin \"{i}\"\nObjectEnd\n"));
    world("instances.pbrt", &|i| match i {
        0 => "ObjectBegin \"a\"\nShape \"sphere\"\nObjectEnd\n".into(),
        _ => "ObjectInstance \"a\"\n".into(),
    });
    world("numbers.pbrt", &|i| match i {
        0 => format!("Shape \"sphere\" \"float radius\" [{}]\n", "1 ".repeat(300_000)),
        _ => "\n".into(),
    });
    world("names.pbrt", &|i| format!("CoordinateSystem \"{i}\"\n"));
    let groups: String = (0..10_000).map(|i| format!("g {i}\nf 1 2 3\n")).collect();
    folder.write("groups.obj", &format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{groups}"));
    let (code, said) = folder.lumbre(&["render", "scene.pbrt", "-o", "a.png"]);
    assert_eq!(code, 0, "{said}");
    for (option, arguments) in [
        ("30000", &["render", "scene.pbrt", "-o", "b.png"][..]),
        ("2G", &["render", "film.pbrt", "-o", "b.png"]),
        ("2G", &["render", "missing.pbrt", "-o", "b.png", "--size", "20000x20000"]),
        ("1500k", &["render", "many.pbrt", "-o", "b.png"]),
        ("1500k", &["info", "many.pbrt"]),
        ("1500k", &["cast", "many.pbrt", "--rays", "rays.csv"]),
        ("10k", &["diff", "a.png", "a.png"]),
        // Lists of everything that a file may have.
        ("2M", &["info", "shapes.pbrt"]),
        ("2M", &["info", "materials.pbrt"]),
        ("2M", &["info", "objects.pbrt"]),
        ("2M", &["info", "instances.pbrt"]),
        ("2M", &["info", "numbers.pbrt"]),
        ("2M", &["info", "names.pbrt"]),
        ("2M", &["info", "groups.obj"]),
    ] {
        let (code, said) = folder.lumbre(&[arguments, &["--max-memory", option]].concat());
        assert_eq!(code, 5, "{arguments:?}: {said}");
        assert!(said.contains("needs") && said.contains("--max-memory"), "{arguments:?}: {said}");
        assert!(!folder.path("b.png").exists());
    }
    // A part of such a film fits.
    let (code, said) = folder.lumbre(&[
        "render",
        "film.pbrt",
        "-o",
        "b.png",
        "--crop",
        "10,20,40,50",
        "--max-memory",
        "2G",
        "-q",
    ]);
    assert_eq!((code, &*said), (0, ""));
    // The system's own limit counts likewise.
    for arguments in [
        &["render", "film.pbrt", "-o", "c.png"][..],
        &["render", "scene.pbrt", "-o", "c.exr", "--size", "9000x7000"],
    ] {
        let (code, said) = limited(&folder, &mut Command::new("sh"), "-v 1000000", arguments);
        assert_eq!(code, 5, "{arguments:?}: {said}");
        assert!(said.contains("ulimit -v"), "{arguments:?}: {said}");
    }
    let (code, said) =
        limited(&folder, &mut Command::new("sh"), "-v 1000000", &["render", "scene.pbrt", "-q"]);
    assert_eq!((code, &*said), (0, ""));
}

/// The largest memory of a command, in KiB; `None` where there is no program that measures it.
fn peak(folder: &Folder, arguments: &[&str]) -> Option<u64> {
    let time = Path::new("/usr/bin/time");
    if !time.is_file() {
        println!("skipped: no /usr/bin/time");
        return None;
    }
    let mut command = Command::new(time);
    command
        .args(["-f", "peak %M", env!("CARGO_BIN_EXE_lumbre")])
        .args(arguments)
        .current_dir(folder.path(""));
    let (status, said) = answer(command.output().unwrap());
    assert_eq!(status, 0, "{arguments:?}: {said}");
    let last = said.lines().rev().find_map(|line| line.strip_prefix("peak "));
    Some(last.unwrap().parse().unwrap())
}

#[test]
fn many_shapes_take_32_bytes_for_each_of_their_file_and_64_mib() {
    let folder = Folder::new();
    let start = SPHERE.split("Shape").next().unwrap();
    folder.write("spheres.pbrt", &(start.to_owned() + &"Shape \"sphere\"\n".repeat(300_000)));
    let faces: String = (0..50_000).map(|i| format!("usemtl m{i}\nf 1 2 3\n")).collect();
    folder.write("materials.obj", &format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}"));
    // A file that is included again is read again.
    let some = "Shape \"sphere\"\n".repeat(1000);
    folder.write("some.pbrt", &some);
    folder.write("includes.pbrt", &(start.to_owned() + &"Include \"some.pbrt\"\n".repeat(300)));
    let size = |name: &str| fs::metadata(folder.path(name)).unwrap().len();
    for (name, read) in [
        ("spheres.pbrt", size("spheres.pbrt")),
        ("includes.pbrt", size("includes.pbrt") + 300 * size("some.pbrt")),
        ("materials.obj", size("materials.obj")),
    ] {
        let allowed = (64 << 10) + 32 * read / 1024;
        let Some(peak) = peak(&folder, &["info", name]) else { return };
        println!("{name}: {peak} KiB of {allowed}");
        assert!(peak <= allowed, "{name}: {peak} KiB, allowed {allowed}");
    }
}
