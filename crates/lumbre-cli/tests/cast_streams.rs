//! Streams of rays through the program: from files and pipes, whole and broken.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

use tempfile::TempDir;

const QUERIES: [&str; 4] = ["closest", "any", "all", "count"];

/// A folder with a scene and rays in it, enough of them for several pieces.
struct Desk {
    folder: TempDir,
    rays: Vec<[f64; 8]>,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let scene = "WorldBegin
            Shape \"sphere\" \"point3 center\" [1 2 3] \"float radius\" 2
            Shape \"trianglemesh\" \"point3 P\" [-5 -5 2.5  5 -5 2.5  0 7 2.5] \"integer indices\" [0 1 2]";
        fs::write(folder.path().join("scene.pbrt"), scene).unwrap();
        // Numbers that single precision holds, so that all files say the same.
        let ray = |i: u32| {
            let at = |period: u32| f64::from(i % period) / 8.0 - 5.0;
            [at(83), at(79), -9.0, at(3) / 64.0, 0.25, 1.5, 0.5, f64::from(4 + i % 9)]
        };
        Self { folder, rays: (0..9001).map(ray).collect() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lumbre"));
        command.args(["cast", "scene.pbrt"]).args(arguments).current_dir(self.folder.path());
        command
    }

    fn cast(&self, arguments: &[&str]) -> Output {
        self.command(arguments).stdin(Stdio::null()).output().unwrap()
    }

    /// Casts rays that come through a pipe.
    fn cast_piped(&self, rays: &[u8], arguments: &[&str]) -> Output {
        let mut child = self.spawn(&[&["--rays", "-"], arguments].concat());
        let mut pipe = child.stdin.take().unwrap();
        std::thread::scope(|scope| {
            // It ends early where the program does.
            scope.spawn(move || pipe.write_all(rays));
            child.wait_with_output().unwrap()
        })
    }

    fn spawn(&self, arguments: &[&str]) -> Child {
        self.command(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    fn csv(&self) -> String {
        let row = |ray: &[f64; 8]| ray.map(|v| v.to_string()).join(",") + "\n";
        std::iter::once("ox,oy,oz,dx,dy,dz,tmin,tmax\n".to_owned()).chain(self.rays.iter().map(row)).collect()
    }

    fn npy(&self, descr: &str, columns_first: bool) -> Vec<u8> {
        let rows = self.rays.len();
        let order = if columns_first { "True" } else { "False" };
        let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': ({rows}, 8), }}\n");
        let mut file = [b"\x93NUMPY\x01\x00".as_slice(), &(header.len() as u16).to_le_bytes()].concat();
        file.extend(header.bytes());
        for i in 0..rows * 8 {
            let v = if columns_first { self.rays[i % rows][i / rows] } else { self.rays[i / 8][i % 8] };
            match descr {
                "<f4" => file.extend((v as f32).to_le_bytes()),
                ">f4" => file.extend((v as f32).to_be_bytes()),
                "<f8" => file.extend(v.to_le_bytes()),
                _ => file.extend(v.to_be_bytes()),
            }
        }
        file
    }

    /// What stands in the folder, but for what begins there.
    fn left(&self) -> Vec<String> {
        let names = fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> =
            names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.retain(|name| name != "scene.pbrt" && !name.starts_with("rays"));
        names.sort();
        names
    }
}

fn good(output: Output) -> Vec<u8> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

fn said(output: &Output) -> (i32, String) {
    (output.status.code().unwrap(), String::from_utf8(output.stderr.clone()).unwrap())
}

#[test]
fn rays_mean_the_same_in_every_form_from_files_and_pipes() {
    let desk = Desk::new();
    let csv = desk.csv();
    fs::write(desk.path("rays.csv"), &csv).unwrap();
    let mut forms = vec![("csv".to_owned(), csv.into_bytes())];
    for descr in ["<f4", ">f4", "<f8", ">f8"] {
        for columns_first in [false, true] {
            forms.push((format!("{descr} {columns_first}"), desk.npy(descr, columns_first)));
        }
    }
    for query in QUERIES {
        let expected = good(desk.cast(&["--rays", "rays.csv", "--query", query, "--threads", "1"]));
        assert!(expected.iter().filter(|b| **b == b'\n').count() > 3000, "{query}");
        for (name, bytes) in &forms {
            fs::write(desk.path("rays"), bytes).unwrap();
            let from_file = good(desk.cast(&["--rays", "rays", "--query", query, "--threads", "3"]));
            assert!(from_file == expected, "{query} from a file of {name}");
            let from_pipe = good(desk.cast_piped(bytes, &["--query", query]));
            assert!(from_pipe == expected, "{query} from a pipe of {name}");
        }
    }
}

#[test]
fn answers_are_the_same_whichever_way_the_rays_came() {
    let desk = Desk::new();
    let (csv, npy) = (desk.csv(), desk.npy(">f8", true));
    fs::write(desk.path("rays.npy"), &npy).unwrap();
    for query in QUERIES {
        for form in ["csv", "npy", "npz"] {
            let name = format!("out.{form}");
            // Something stands there before.
            fs::write(desk.path(&name), "old").unwrap();
            assert!(good(desk.cast_piped(csv.as_bytes(), &["--query", query, "-o", &name, "-q"])).is_empty());
            let piped = fs::read(desk.path(&name)).unwrap();
            good(desk.cast(&["--rays", "rays.npy", "--query", query, "-o", &name, "--threads", "1", "-q"]));
            assert!(piped == fs::read(desk.path(&name)).unwrap(), "{query} {form}");
            assert!(9001 < piped.len());
        }
    }
    assert_eq!(desk.left(), ["out.csv", "out.npy", "out.npz"]);
}

#[test]
fn what_is_wrong_late_is_said_and_leaves_what_was_there() {
    let desk = Desk::new();
    fs::write(desk.path("out.npy"), "old").unwrap();
    let csv = desk.csv();
    let bad_number = format!("{csv}1,2,3,4,five,6,7,8\n");
    let short = format!("{csv}1,2,3\n{csv}");
    let npy = desk.npy("<f8", false);
    let size = 9001 * 64;
    let cut = npy[..npy.len() - 100].to_vec();
    let long = [&npy[..], b"more"].concat();
    let (cut_at, long_at) = (cut.len(), npy.len());
    let cases = [
        (bad_number.into_bytes(), "9003:9: invalid value (found \"five\"; expected a number)".to_owned()),
        (short.into_bytes(), "9003:6: 3 values (expected 8)".to_owned()),
        (
            [csv.as_bytes(), b"1,2,\xFF\n"].concat(),
            "9003: not text (expected CSV in UTF-8, or a .npy array)".to_owned(),
        ),
        (cut, format!("byte {cut_at}: {} bytes of data for shape (9001, 8) of <f8", size - 100)),
        (long, format!("byte {long_at}: {} bytes of data for shape (9001, 8) of <f8", size + 4)),
    ];
    for (bytes, expected) in cases {
        fs::write(desk.path("rays"), &bytes).unwrap();
        for output in ["out.csv", "out.npy", "out.npz"] {
            let from_file = said(&desk.cast(&["--rays", "rays", "-o", output]));
            assert_eq!(from_file, (3, format!("error: rays:{expected}\n")));
            let from_pipe = said(&desk.cast_piped(&bytes, &["-o", output]));
            assert_eq!(from_pipe, (3, format!("error: standard input:{expected}\n")));
        }
        assert_eq!(desk.left(), ["out.npy"]);
        assert_eq!(fs::read(desk.path("out.npy")).unwrap(), b"old");
    }
}

#[test]
fn both_scene_and_rays_cannot_be_standard_input() {
    let desk = Desk::new();
    let out = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(["cast", "-", "--rays", "-"])
        .stdin(Stdio::null())
        .current_dir(desk.folder.path())
        .output()
        .unwrap();
    assert_eq!(said(&out), (2, "error: the scene and --rays cannot both be standard input\n".to_owned()));
}

#[test]
fn a_reader_that_leaves_ends_the_stream_quietly() {
    let desk = Desk::new();
    let mut child = desk.spawn(&["--rays", "-"]);
    let (mut rays, mut answers) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    let csv = desk.csv();
    let (header, lines) = csv.split_once('\n').unwrap();
    writeln!(rays, "{header}").unwrap();
    let feeder = std::thread::scope(|scope| {
        // Rays without end: that the program stops is what ends this.
        let feeder = scope.spawn(move || while rays.write_all(lines.as_bytes()).is_ok() {});
        answers.read_exact(&mut [0; 1000]).unwrap();
        drop(answers);
        feeder.join()
    });
    assert!(feeder.is_ok());
    let output = child.wait_with_output().unwrap();
    assert_eq!(said(&output), (0, String::new()));
}

#[cfg(unix)]
#[test]
fn an_interrupted_stream_leaves_no_file() {
    let desk = Desk::new();
    let csv = desk.csv();
    for (signal, status) in [("INT", 130), ("TERM", 143)] {
        let mut child = desk.spawn(&["--rays", "-", "-o", "out.npz"]);
        let mut rays = child.stdin.take().unwrap();
        rays.write_all(csv.as_bytes()).unwrap();
        let is_writing = |path: &std::path::Path| {
            fs::read_dir(path)
                .unwrap()
                .any(|entry| entry.unwrap().file_name().to_string_lossy().ends_with(".part"))
        };
        while !is_writing(desk.folder.path()) {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        let sent =
            Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        std::thread::sleep(std::time::Duration::from_millis(100));
        // What wrote the rays is interrupted as well.
        drop(rays);
        let output = child.wait_with_output().unwrap();
        assert_eq!(said(&output), (status, String::new()));
        assert_eq!(desk.left(), Vec::<String>::new());
    }
}
