//! What a page sees.

use crate::client::{Packet, Running, SCENE};

/// Bytes of a frame before its pixels.
const HEADER: usize = 40;

fn numbers(frame: &[u8]) -> Vec<u32> {
    frame[..HEADER].chunks(4).map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap())).collect()
}

/// Reads frames until one is the whole picture with all samples, of the change of this number.
fn finished(socket: &mut crate::client::Socket, sequence: u32) -> Vec<u8> {
    loop {
        match socket.next() {
            Packet::Binary(frame) => {
                socket.say(r#"{"type":"shown"}"#);
                let head = numbers(&frame);
                if head[6] == sequence && head[7] == 3 {
                    return frame;
                }
            }
            Packet::Text(_) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn the_last_frame_has_the_pixels_of_the_render() {
    let viewer = Running::new();
    let mut socket = viewer.socket(&viewer.session());
    let frame = finished(&mut socket, 0);
    let scene = lumbre::open(&viewer.path).unwrap();
    let picture = scene.render(&scene.options()).unwrap();
    let expected: Vec<u8> = picture
        .image()
        .pixels()
        .iter()
        .flat_map(|&light| {
            let [r, g, b] = lumbre::image::ToneMap::None.encode(light, 0.0).to_u8();
            [r, g, b, 255]
        })
        .collect();
    assert_eq!(numbers(&frame)[1..6], [48, 32, 48, 32, 4]);
    assert!(frame[HEADER..] == expected[..]);
    // Another camera makes another picture, and the file's own the same again.
    let placement = r#"{"eye":[5,-5,4],"target":[0,0,0],"up":[0,0,1]}"#;
    socket.say(&format!(r#"{{"type":"camera","sequence":7,"placement":{placement},"fov":null,"zoom":1}}"#));
    assert!(finished(&mut socket, 7)[HEADER..] != expected[..]);
    socket.say(r#"{"type":"reset","sequence":8,"camera":0}"#);
    assert!(finished(&mut socket, 8)[HEADER..] == expected[..]);
    // What makes no camera leaves the picture.
    let nowhere = r#"{"eye":[0,0,0],"target":[0,0,0],"up":[0,0,1]}"#;
    socket.say(&format!(r#"{{"type":"camera","sequence":9,"placement":{nowhere},"fov":null,"zoom":1}}"#));
    socket.say(r#"{"type":"reset","sequence":10,"camera":0}"#);
    assert!(finished(&mut socket, 10)[HEADER..] == expected[..]);
}

#[test]
fn a_page_asks_for_pixels_and_for_what_a_ray_meets() {
    let viewer = Running::new();
    let mut socket = viewer.socket(&viewer.session());
    finished(&mut socket, 0);
    socket.say(r#"{"type":"pick","x":24,"y":16,"request":5}"#);
    let picked = socket.wait_for("picked", |_| true);
    let hits = picked["ray"]["hits"].as_array().unwrap();
    assert_eq!((picked["request"].as_u64(), hits.len()), (Some(5), 2));
    assert_eq!(
        (hits[0]["kind"].as_str(), hits[0]["surface"]["front"].as_bool()),
        (Some("sphere"), Some(true))
    );
    assert_eq!(hits[0]["material"], "<b>wood</b> (diffuse)");
    let point: Vec<f64> =
        hits[0]["surface"]["point"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert!((point.iter().map(|x| x * x).sum::<f64>().sqrt() - 1.25).abs() < 1e-9, "{point:?}");
    socket.say(r#"{"type":"values","x":46,"y":30,"width":9,"height":9,"request":6}"#);
    let values = socket.wait_for("values", |_| true);
    assert_eq!((values["width"].as_u64(), values["height"].as_u64()), (Some(2), Some(2)));
    let image = lumbre::open(&viewer.path).unwrap();
    let image = image.render(&image.options()).unwrap();
    let expected = image.image().pixel(47, 30).to_array();
    let found: Vec<f32> =
        values["values"][1].as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect();
    assert_eq!(found, expected);
}

#[test]
fn shape_kinds_have_scene_language_names() {
    let viewer = Running::new();
    let mut socket = viewer.socket(&viewer.session());
    finished(&mut socket, 0);
    let ball = r#"Shape "sphere" "float radius" 1.25"#;
    let shapes = [
        ("bilinearmesh", r#"Shape "bilinearmesh" "point3 P" [-2 0 -2  2 0 -2  -2 0 2  2 0.5 2]"#),
        ("mesh", r#"Shape "trianglemesh" "point3 P" [-5 0 -5  5 0 -5  0 0 9]"#),
        ("box", r#"Shape "box" "point3 pmin" [-1 -1 -1] "point3 pmax" [1 1 1]"#),
    ];
    for (name, shape) in shapes {
        assert!(SCENE.contains(ball));
        std::fs::write(&viewer.path, SCENE.replace(ball, shape)).unwrap();
        let expected = serde_json::json!({ name: 1 });
        socket.wait_for("scene", |told| told["scene"]["shapes"] == expected);
        socket.say(r#"{"type":"pick","x":24,"y":16,"request":5}"#);
        let picked = socket.wait_for("picked", |_| true);
        assert_eq!(picked["ray"]["hits"][0]["kind"], name, "{picked}");
    }
}

#[test]
fn a_shown_pixel_is_explained_in_a_sandboxed_frame() {
    let viewer = Running::new();
    let session = viewer.session();
    let mut socket = viewer.socket(&session);
    let scene = socket.wait_for("scene", |_| true);
    assert_eq!(scene["scene"]["languages"], serde_json::json!([["la", "Latina"]]));
    finished(&mut socket, 0);
    let asked = |path: &str| {
        let host = viewer.host();
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        let answer = viewer.raw(request.as_bytes());
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.to_ascii_lowercase(), body.to_owned())
    };
    let mut errands = viewer.socket(&session);
    let mut explained = |language: &str, x: u32, y: u32| {
        let errand = format!(r#"{{"for":"explanation","language":"{language}","pixel":[{x},{y}]}}"#);
        asked(&errands.ticket(&errand))
    };
    let (head, body) = explained("la", 47, 31);
    assert_eq!(body, "47 31 of 48 32 from 1");
    for line in [
        "http/1.1 200",
        "content-type: text/html; charset=utf-8",
        "x-frame-options: sameorigin",
        "content-security-policy: default-src 'none'; script-src 'sha256-abcd'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'; sandbox allow-scripts",
    ] {
        assert!(head.contains(line), "{line}: {head}");
    }
    assert_eq!((head.matches("x-frame").count(), head.matches("content-security").count()), (1, 1), "{head}");

    // It is the picture that is there now: its camera and its size.
    let placement = r#"{"eye":[5,-5,4],"target":[0,0,0],"up":[0,0,1]}"#;
    socket.say(&format!(r#"{{"type":"camera","sequence":7,"placement":{placement},"fov":null,"zoom":1}}"#));
    socket.say(r#"{"type":"set","scale":0.5}"#);
    socket.wait_for("progress", |told| told["doing"] == "done");
    while explained("la", 23, 15).1 != "23 15 of 24 16 from 5" {
        socket.wait_for("progress", |told| told["doing"] == "done");
    }
    let (head, body) = explained("la", 24, 15);
    assert!(head.starts_with("http/1.1 422") && head.contains("text/plain"), "{head}");
    assert_eq!(body, "The picture of 24 by 16 pixels has no pixel 24, 15.");
    let (head, body) = explained("xx", 3, 2);
    assert!(head.starts_with("http/1.1 422") && head.contains("text/plain"), "{head}");
    assert!(!head.contains("script-src"), "{head}");
    assert_eq!(body, "<b>xx</b> is not spoken here", "as text");
    assert!(asked("/ticket/la").0.starts_with("http/1.1 403"));
}

#[test]
fn parameters_are_edited_and_wrong_ones_named() {
    let viewer = Running::new();
    let mut socket = viewer.socket(&viewer.session());
    let before = finished(&mut socket, 0);
    let path = "material.<b>wood</b>.reflectance";
    socket.say(&format!(r##"{{"type":"edit","path":"{path}","value":"#00ff00"}}"##));
    let state = socket.wait_for("state", |state| !state["settings"].as_array().unwrap().is_empty());
    assert_eq!(state["settings"][0][0], path);
    assert!(finished(&mut socket, 0)[HEADER..] != before[HEADER..]);
    socket.say(&format!(r##"{{"type":"edit","path":"{path}","value":"nonsense"}}"##));
    let state = socket.wait_for("state", |state| !state["edit_error"].is_null());
    assert!(state["edit_error"].as_str().unwrap().contains("expected"), "{state}");
    socket.say(&format!(r#"{{"type":"edit","path":"{path}","value":null}}"#));
    assert!(finished(&mut socket, 0)[HEADER..] == before[HEADER..]);
    assert_eq!(std::fs::read_to_string(&viewer.path).unwrap(), SCENE, "the file is never written");
}
