//! Those who watch a render: the browser, the terminal, tev.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Stdio};

use crate::program::{Desk, SPHERE, code, stderr};

#[test]
fn tev_is_sent_the_picture_that_is_saved() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let told = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        listener.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
        bytes
    });
    let out = desk.lumbre(&["render", "scene.pbrt", "-o", "a.pfm", "--spp", "2", "--tev", &address]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let told = told.join().unwrap();
    let image = lumbre::read_image(&desk.path("a.pfm")).unwrap();
    let (width, height) = (image.width() as usize, image.height() as usize);
    let mut found = vec![[f32::NAN; 3]; width * height];
    let number = |at: usize| u32::from_le_bytes(told[at..at + 4].try_into().unwrap()) as usize;
    let mut at = 0;
    let mut kinds = Vec::new();
    while at < told.len() {
        let (end, kind) = (at + number(at), told[at + 4]);
        kinds.push(kind);
        if kind == 3 {
            let name = 6 + "a.pfm".len() + 1;
            assert_eq!(&told[at + 6..at + name], b"a.pfm\0");
            let channel = "RGB".find(char::from(told[at + name])).unwrap();
            let [x, y, w, h] = [0, 1, 2, 3].map(|i| number(at + name + 2 + 4 * i));
            let numbers = at + name + 2 + 16;
            for i in 0..w * h {
                let value = f32::from_bits(number(numbers + 4 * i) as u32);
                found[(y + i / w) * width + x + i % w][channel] = value;
            }
            assert_eq!(end, numbers + 4 * w * h);
        }
        at = end;
    }
    assert_eq!(kinds[0], 4, "the picture is made first");
    let expected: Vec<[f32; 3]> = image.pixels().iter().map(|pixel| pixel.to_array()).collect();
    assert!(found == expected);
    let nobody = desk.lumbre(&["render", "scene.pbrt", "-o", "b.pfm", "--tev", "127.0.0.1:1"]);
    assert_eq!(code(&nobody), 4);
    assert!(stderr(&nobody).starts_with("error: --tev: 127.0.0.1:1: "), "{}", stderr(&nobody));
}

#[test]
fn a_terminal_shows_the_picture_and_what_is_none_is_refused() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    for (how, beginning) in
        [("kitty", "\x1b_Ga=T"), ("iterm", "\x1b]1337;File=inline=1"), ("sixel", "\x1bPq")]
    {
        let out =
            desk.lumbre(&["render", "scene.pbrt", "-o", "a.png", "--spp", "2", &format!("--preview={how}")]);
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        assert!(stderr(&out).contains(beginning), "{how}");
    }
    let out = desk.lumbre(&["render", "scene.pbrt", "-o", "b.png", "--preview"]);
    assert_eq!(code(&out), 2);
    assert!(stderr(&out).contains("is not a terminal"), "{}", stderr(&out));
}

#[test]
fn a_viewer_answers_at_its_address_until_a_signal() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    let mut child = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .args(["view", "scene.pbrt", "--no-open"])
        .current_dir(desk.folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let rest = line.trim().strip_prefix("http://").unwrap();
    // The token is behind the mark that browsers send nothing of.
    let (host, token) = rest.split_once("/#").unwrap();
    assert!(token.len() == 64 && token.chars().all(|c| c.is_ascii_hexdigit()), "{line}");
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200") && !answer.contains("set-cookie"), "{answer}");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_viewer_that_cannot_be_says_why() {
    let desk = Desk::new();
    desk.write("scene.pbrt", SPHERE);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    for (words, status, expected) in [
        (&["view", "scene.pbrt", "--no-open", "--port", &port][..], 4, "is in use"),
        (&["view", "--export", "page"], 2, "--export needs a scene"),
        (&["view", "none.pbrt", "--export", "page"], 4, "none.pbrt"),
        (&["view", "scene.pbrt", "--turntable", "8"], 2, "--turntable makes many pictures"),
        (&["view", "scene.pbrt", "--port", "70000"], 2, "70000"),
        (&["view", "scene.pbrt", "--host", "0.0.0.0"], 2, "is not an address that a browser can open"),
    ] {
        let out = desk.lumbre(words);
        assert_eq!(code(&out), status, "{words:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(expected), "{words:?}: {}", stderr(&out));
    }
    let out = desk.lumbre(&["view", "scene.pbrt", "--export", "page", "--spp", "1"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    for name in ["index.html", "viewer.js", "viewer.css", "icon.svg", "data.js"] {
        assert!(desk.path("page").join(name).is_file(), "{name}");
    }
}
