//! A file that is edited while it is looked at.

use crate::client::{Running, SCENE};

#[test]
fn edits_are_read_and_broken_ones_keep_the_picture() {
    let viewer = Running::new();
    let mut socket = viewer.socket(&viewer.session());
    let done = |message: &serde_json::Value| message["doing"] == "done";
    socket.wait_for("progress", done);
    let placement = r#"{"eye":[5,-5,4],"target":[0,0,0],"up":[0,0,1]}"#;
    socket.say(&format!(r#"{{"type":"camera","sequence":7,"placement":{placement},"fov":null,"zoom":1}}"#));
    socket.wait_for("state", |state| state["moved"] == true);

    std::fs::write(&viewer.path, SCENE.replace("\"float radius\"", "\"float radius")).unwrap();
    let state = socket.wait_for("state", |state| !state["error"].is_null());
    let error = state["error"].as_str().unwrap();
    assert!(error.contains("scene.pbrt:5:"), "{error}");
    assert_eq!(state["has_scene"], true);
    // What is there can still be asked.
    socket.say(r#"{"type":"pick","x":24,"y":16,"request":5}"#);
    assert!(!socket.wait_for("picked", |_| true)["ray"]["hits"].as_array().unwrap().is_empty());

    std::fs::write(&viewer.path, SCENE.replace("1.25", "0.5")).unwrap();
    let state = socket.wait_for("state", |state| state["error"].is_null());
    assert_eq!(state["placement"]["eye"], serde_json::json!([5.0, -5.0, 4.0]), "the camera is kept");
}

#[test]
fn a_picture_too_large_for_memory_is_refused() {
    let viewer = Running::new();
    let mut socket = viewer.socket(&viewer.session());
    socket.wait_for("progress", |message| message["doing"] == "done");
    socket.say(r#"{"type":"set","scale":2}"#);
    let state = socket.wait_for("state", |state| !state["error"].is_null());
    assert_eq!(state["error"], "a picture of 96 pixels does not fit");
    socket.say(r#"{"type":"set","scale":1.5}"#);
    socket.wait_for("state", |state| state["error"].is_null());
    socket.wait_for("progress", |message| message["doing"] == "done");
    // As the file itself asks for it.
    let wide = SCENE.replace("xresolution\" 48", "xresolution\" 480");
    assert_ne!(wide, SCENE);
    std::fs::write(&viewer.path, wide).unwrap();
    let state = socket.wait_for("state", |state| !state["error"].is_null());
    assert_eq!(state["error"], "a picture of 720 pixels does not fit");
    std::fs::write(&viewer.path, SCENE).unwrap();
    socket.wait_for("state", |state| state["error"].is_null());
}
