//! Requests that mean no good: each is refused or closed, and the picture goes on.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::client::{Packet, Running};

/// Asserts that the viewer still answers its own page, and still renders.
fn goes_on(viewer: &Running, session: &str) {
    assert_eq!(viewer.status("GET", "/", &[format!("Host: {}", viewer.host())]), 200);
    let mut socket = viewer.socket(session);
    socket.say(r#"{"type":"reset","sequence":3,"camera":0}"#);
    socket.wait_for("progress", |progress| progress["doing"] == "done");
}

#[test]
fn hosts_and_origins_that_are_not_ours_are_refused() {
    let viewer = Running::new();
    let session = viewer.session();
    let (host, port) = (viewer.host(), viewer.address.port());
    let ticket = viewer.socket(&session).ticket(r#"{"for":"picture","format":"png"}"#);
    let mut count = 0;
    let hosts = [
        "example.org".to_owned(),
        format!("example.org:{port}"),
        "127.0.0.1".to_owned(),
        format!("127.0.0.1:{}", port ^ 1),
        format!("127.0.0.2:{port}"),
        format!("127.1:{port}"),
        format!("0.0.0.0:{port}"),
        format!("2130706433:{port}"),
        format!("0x7f000001:{port}"),
        format!("[::1]:{port}"),
        format!("[::ffff:127.0.0.1]:{port}"),
        format!("localhost.example.org:{port}"),
        format!("127.0.0.1.nip.io:{port}"),
        format!("localhost:{port}.example.org"),
        format!("localhost.:{port}"),
        format!("user@127.0.0.1:{port}"),
        format!("127.0.0.1:{port}/"),
        format!("127.0.0.1:0{port}"),
        format!("{host}, example.org"),
        String::new(),
        "localhost".to_owned(),
    ];
    for wrong in hosts {
        let status = viewer.status("GET", "/", &[format!("Host: {wrong}")]);
        assert!(matches!(status, 400 | 421), "host {wrong:?}: {status}");
        count += 1;
    }
    for lines in [
        vec![],
        vec![format!("Host: {host}"), format!("Host: {host}")],
        vec![format!("Host: {host}"), "Host: example.org".to_owned()],
    ] {
        let status = viewer.status("GET", "/", &lines);
        assert!(matches!(status, 400 | 421), "{status}");
        count += 1;
    }
    let origins = [
        "null".to_owned(),
        "http://example.org".to_owned(),
        format!("https://{host}"),
        "http://127.0.0.1".to_owned(),
        format!("http://127.0.0.1:{}", port ^ 1),
        format!("http://localhost:{port}"),
        format!("http://{host}.example.org"),
        format!("http://{host}/"),
        format!("http://example.org/{host}"),
        format!("http://example.org?http://{host}"),
        format!("http://user@{host}"),
        "file://".to_owned(),
        "chrome-extension://abcdefghijklmnop".to_owned(),
        format!("http://[::1]:{port}"),
        format!(" http://{host} http://example.org"),
        format!("HTTP://{host}"),
        "http://127.0.0.1:".to_owned(),
        String::new(),
    ];
    for wrong in origins {
        for (method, path) in [("GET", "/"), ("GET", "/socket"), ("POST", "/scene"), ("GET", &ticket)] {
            let lines = [
                format!("Host: {host}"),
                format!("Origin: {wrong}"),
                "Upgrade: websocket".to_owned(),
                "Sec-WebSocket-Version: 13".to_owned(),
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==".to_owned(),
            ];
            assert_eq!(viewer.status(method, path, &lines), 403, "origin {wrong:?}, {method} {path}");
            count += 1;
        }
    }
    // A socket, or a scene, without an origin; and pages that the browser marks as foreign.
    for path in ["/socket", "/scene"] {
        let method = if path == "/scene" { "POST" } else { "GET" };
        assert_eq!(viewer.status(method, path, &[format!("Host: {host}")]), 403);
        count += 1;
    }
    for site in ["cross-site", "same-site", "", "none-such"] {
        for path in ["/", "/viewer.js", "/icon.svg", &ticket] {
            let lines = [format!("Host: {host}"), format!("Sec-Fetch-Site: {site}")];
            assert_eq!(viewer.status("GET", path, &lines), 403, "{site} {path}");
            count += 1;
        }
    }
    assert!(count > 90, "{count}");
    assert_eq!(viewer.status("GET", &ticket, &[format!("Host: {host}")]), 200, "nobody has used it");
    goes_on(&viewer, &session);
}

#[test]
fn without_the_secret_there_is_nothing_and_the_token_works_once() {
    let viewer = Running::new();
    let host = format!("Host: {}", viewer.host());
    let zeros = "0".repeat(64);
    for path in ["/picture.png", "/scene", "/explanation/la/1/2", "/nothing", "/open/1"] {
        assert_eq!(viewer.status("GET", path, std::slice::from_ref(&host)), 404, "{path}");
    }
    for path in ["/ticket/", "/ticket/x", &format!("/ticket/{zeros}"), &format!("/ticket/{}", viewer.token())]
    {
        assert_eq!(viewer.status("GET", path, std::slice::from_ref(&host)), 403, "{path}");
    }
    let sent_away = |said: &str| {
        let mut socket = viewer.connect();
        let Packet::Text(challenge) = socket.next() else { panic!("no challenge") };
        assert!(challenge.len() < 120, "nothing is said of the scene: {challenge}");
        socket.say(said);
        assert_eq!(socket.end(), Some(4403), "{said}");
    };
    for said in [
        "",
        "{}",
        r#"{"type":"hello"}"#,
        r#"{"type":"hello","nonce":"","proof":""}"#,
        &format!(r#"{{"type":"hello","nonce":"{zeros}","proof":"{zeros}"}}"#),
        &format!(r#"{{"type":"hello","nonce":"{zeros}","proof":"{}"}}"#, viewer.token()),
        &format!(r#"{{"type":"hello","nonce":"{}","proof":"{zeros}"}}"#, "é".repeat(32)),
        r#"{"type":"pick","x":24,"y":16,"request":5}"#,
        r#"{"type":"ticket","request":5,"errand":{"for":"scene"}}"#,
    ] {
        sent_away(said);
    }
    for wrong in [zeros, viewer.token().chars().rev().collect()] {
        assert!(viewer.connect().greet(&wrong).is_none());
    }
    let session = viewer.session();
    assert_ne!(session, viewer.token());
    assert!(viewer.connect().greet(viewer.token()).is_none(), "a second time");
    // What was heard of one socket opens no other.
    let mut socket = viewer.connect();
    let Packet::Text(challenge) = socket.next() else { panic!() };
    let challenge: serde_json::Value = serde_json::from_str(&challenge).unwrap();
    let nonce = "77".repeat(32);
    let proof = crate::client::proof(&session, "page", challenge["nonce"].as_str().unwrap(), &nonce);
    let hello = format!(r#"{{"type":"hello","nonce":"{nonce}","proof":"{proof}"}}"#);
    sent_away(&hello);
    socket.say(&hello);
    assert!(matches!(socket.next(), Packet::Text(welcome) if welcome.contains("welcome")));
    goes_on(&viewer, &session);
}

#[test]
fn no_path_reaches_a_file_and_no_method_but_those_of_the_page() {
    let viewer = Running::new();
    let session = viewer.session();
    let lines = [format!("Host: {}", viewer.host())];
    for path in [
        "/../../etc/passwd",
        "/..%2f..%2fetc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "//etc/passwd",
        "/./",
        "/viewer.js/../../secret",
        "/..\\..\\windows\\win.ini",
        "/etc/passwd",
        "/scene.pbrt",
        "/dropped.glb",
        "/index.html",
        "/%00",
        "/viewer.js%00.png",
        "/viewer.js?x=1",
        "/?token",
        "/picture.png/",
        "/PICTURE.PNG",
        "/explanation",
        "/explanation/la",
        "/explanation/la/1",
        "/explanation/la/1/2/3",
        "/explanation/la/1/2/",
        "/explanation/la/-1/2",
        "/explanation/la/1/4294967296",
        "/explanation/la/1e1/2",
        "file:///etc/passwd",
        "http://example.org/",
        "*",
        "",
    ] {
        let status = viewer.status("GET", path, &lines);
        assert!(matches!(status, 400 | 403 | 404 | 421), "{path}: {status}");
    }
    let own = [lines.to_vec(), vec![format!("Origin: http://{}", viewer.host())]].concat();
    for method in ["PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "HEAD", "CONNECT", "POST", "BREW"] {
        let status = viewer.status(method, "/", &own);
        assert!(matches!(status, 400 | 403 | 404 | 405), "{method}: {status}");
    }
    goes_on(&viewer, &session);
}

#[test]
fn answers_say_what_a_browser_may_do_with_them() {
    let viewer = Running::new();
    let session = viewer.session();
    let host = viewer.host();
    let ticket = viewer.socket(&session).ticket(r#"{"for":"picture","format":"exr"}"#);
    for path in ["/", "/nothing", &ticket] {
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        let answer = viewer.raw(request.as_bytes());
        let head = answer.split("\r\n\r\n").next().unwrap();
        for expected in [
            "content-security-policy: default-src 'none'; script-src 'self'",
            "frame-ancestors 'none'",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cache-control: no-store",
            "x-frame-options: DENY",
        ] {
            assert!(head.contains(expected), "{path}: {expected}: {head}");
        }
        assert!(!head.contains("access-control-allow") && !head.contains("set-cookie"), "{head}");
    }
}

#[test]
fn broken_requests_are_refused_and_slow_ones_given_up() {
    let viewer = Running::new();
    let session = viewer.session();
    let host = viewer.host();
    let long = "x".repeat(20_000);
    for request in [
        "\0\0\0\0\r\n\r\n".to_owned(),
        "GET\r\n\r\n".to_owned(),
        "GET / HTTP/9.9\r\n\r\n".to_owned(),
        "GET / HTTP/1.1\r\nHost: a\0b\r\n\r\n".to_owned(),
        format!("GET /{long} HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        format!("GET / HTTP/1.1\r\nHost: {host}\r\nX: {long}\r\n\r\n"),
        format!("GET / HTTP/1.1\r\nHost: {host}\r\n{}\r\n", "A: b\r\n".repeat(3000)),
        format!("POST /scene HTTP/1.1\r\nHost: {host}\r\nContent-Length: -1\r\n\r\n"),
        format!("POST /scene HTTP/1.1\r\nHost: {host}\r\nContent-Length: 99999999999999999999\r\n\r\n"),
        format!("POST /scene HTTP/1.1\r\nHost: {host}\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nab"),
        "\x16\x03\x01\x02\x00\x01\x00\x01\u{fc}\x03\x03".to_owned() + &long,
    ] {
        let answer = viewer.raw(request.as_bytes());
        let is_refused = answer.is_empty() || answer.starts_with("HTTP/1.1 4");
        assert!(is_refused, "{:?}: {answer}", &request[..request.len().min(60)]);
    }
    let start = Instant::now();
    let mut slow = TcpStream::connect(viewer.address).unwrap();
    slow.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    slow.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap();
    goes_on(&viewer, &session);
    let mut rest = Vec::new();
    let _ = slow.read_to_end(&mut rest);
    assert!(start.elapsed() < Duration::from_secs(18), "headers that never end are waited for");
}

#[test]
fn dropped_files_are_bounded_and_need_tickets() {
    let viewer = Running::new();
    let session = viewer.session();
    let own = [format!("Host: {}", viewer.host()), format!("Origin: http://{}", viewer.host())];
    let mut socket = viewer.socket(&session);
    let mut post = |lines: &[&str]| {
        let address = socket.ticket(r#"{"for":"scene"}"#);
        let lines = [&own[..], &lines.iter().map(|l| (*l).to_owned()).collect::<Vec<_>>()].concat();
        let status = viewer.status("POST", &address, &lines);
        assert_eq!(viewer.status("POST", &address, &lines), 403, "it works once");
        status
    };
    let kind = "Content-Type: application/octet-stream";
    assert_eq!(post(&["Content-Type: text/plain", "Content-Length: 0"]), 415);
    assert_eq!(post(&["Content-Type: multipart/form-data; boundary=x", "Content-Length: 0"]), 415);
    assert_eq!(post(&[kind, "Content-Length: 0"]), 415);
    assert_eq!(post(&[kind, "Content-Length: 999999999999"]), 413);
    assert_eq!(post(&[kind, "Transfer-Encoding: chunked"]), 411);
    // A ticket is for one thing.
    let address = socket.ticket(r#"{"for":"scene"}"#);
    assert_eq!(viewer.status("GET", &address, &own), 405);
    let address = socket.ticket(r#"{"for":"picture","format":"png"}"#);
    assert_eq!(viewer.status("POST", &address, &own), 405);
    goes_on(&viewer, &session);
}

#[test]
fn who_looks_on_asks_and_changes_nothing_whatever_it_says() {
    let viewer = Running::shared(2);
    let own = viewer.session();
    let mut editor = viewer.socket(&own);
    let mut sessions = Vec::new();
    for token in &viewer.watchers {
        let welcome = viewer.connect().greet(token).expect("it is let in");
        assert_eq!(welcome["access"], "watch");
        assert!(viewer.connect().greet(token).is_none(), "a second time");
        sessions.push(welcome["session"].as_str().unwrap().to_owned());
    }
    assert!(sessions[0] != sessions[1] && !sessions.contains(&own));
    editor.wait_for("progress", |told| told["doing"] == "done");
    let mut watcher = viewer.connect();
    assert_eq!(watcher.greet(&sessions[1]).unwrap()["access"], "watch");
    let before = watcher.wait_for("state", |_| true);
    let placement = r#"{"eye":[5,-5,4],"target":[0,0,0],"up":[0,0,1]}"#;
    for said in [
        &format!(r#"{{"type":"camera","sequence":7,"placement":{placement},"fov":null,"zoom":1}}"#),
        r#"{"type":"reset","sequence":7,"camera":0}"#,
        r#"{"type":"set","exposure":3,"channel":"normal","spp":9}"#,
        r#"{"type":"set"}"#,
        r#"{"type":"edit","path":"light.0.radiance","value":"9"}"#,
        r#"{"type":"hide","shapes":[0],"others":false}"#,
        r#"{"type":"section","plane":{"point":[0,0,0],"normal":[0,1,0]}}"#,
        r#"{"type":"moment","time":2,"variant":null}"#,
        r#"{"type":"ticket","request":5,"errand":{"for":"scene"}}"#,
    ] {
        watcher.say(said);
        let answer = watcher.wait_for("wrong", |_| true);
        assert_eq!(answer["what"], "this page looks on: it changes nothing", "{said}");
    }
    // What it may: ask, and take pictures and explanations.
    watcher.say(r#"{"type":"pick","x":24,"y":16,"request":5}"#);
    assert!(!watcher.wait_for("picked", |_| true)["ray"]["hits"].as_array().unwrap().is_empty());
    let lines = [format!("Host: {}", viewer.host())];
    for errand in
        [r#"{"for":"picture","format":"png"}"#, r#"{"for":"explanation","language":"la","pixel":[3,2]}"#]
    {
        let address = watcher.ticket(errand);
        assert_eq!(viewer.status("GET", &address, &lines), 200, "{errand}");
    }
    // No change was announced: a page that connects now gets the previous state.
    let now = viewer.socket(&own).wait_for("state", |_| true);
    assert_eq!(now, before);
    goes_on(&viewer, &own);
}

#[test]
fn messages_that_are_none_end_the_socket() {
    let viewer = Running::new();
    let session = viewer.session();
    for text in [
        "",
        "null",
        "{}",
        "[[[[[[",
        r#"{"type":"open","path":"/etc/passwd"}"#,
        r#"{"type":"set","exposure":"x"}"#,
        r#"{"type":"camera"}"#,
        r#"{"type":"shown","__proto__":{}}"#,
        &"[".repeat(10_000),
    ] {
        let mut socket = viewer.socket(&session);
        socket.say(text);
        assert_eq!(socket.end(), Some(1008), "{}", &text[..text.len().min(40)]);
    }
    let frames: [(&str, &[u8]); 8] = [
        ("binary", &[0x82, 0x80, 0, 0, 0, 0]),
        ("not masked", &[0x81, 2, b'{', b'}']),
        ("reserved bits", &[0xf1, 0x80, 0, 0, 0, 0]),
        ("reserved opcode", &[0x83, 0x80, 0, 0, 0, 0]),
        ("a long ping", &[0x89, 0xfe, 0xff, 0xff, 0, 0, 0, 0]),
        ("a piece of a ping", &[0x09, 0x80, 0, 0, 0, 0]),
        ("what goes on with nothing", &[0x80, 0x80, 0, 0, 0, 0]),
        ("a length of 2^63", &[0x81, 0xff, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]),
    ];
    for (what, bytes) in frames {
        let mut socket = viewer.socket(&session);
        socket.0.write_all(bytes).unwrap();
        assert!(socket.end().is_none_or(|code| code >= 1002), "{what}");
    }
    let mut socket = viewer.socket(&session);
    socket.send_frame(0x81, &[0xff, 0xfe, 0xfd]);
    assert!(socket.end().is_none_or(|code| code == 1007), "text that is none");
    let mut socket = viewer.socket(&session);
    socket.send_frame(0x81, &vec![b' '; 1 << 20]);
    assert!(socket.end().is_none_or(|code| code == 1009), "a giant message");
    let mut socket = viewer.socket(&session);
    for _ in 0..40 {
        // Pieces of a message that never ends.
        socket.send_frame(0x01, &[b' '; 1000]);
        socket.send_frame(0x00, &[b' '; 1000]);
    }
    assert!(socket.end().is_none_or(|code| code >= 1002), "a message in many pieces");
    goes_on(&viewer, &session);
}

#[test]
fn numbers_beyond_all_bounds_do_nothing() {
    let viewer = Running::new();
    let session = viewer.session();
    let mut socket = viewer.socket(&session);
    socket.wait_for("progress", |progress| progress["doing"] == "done");
    for text in [
        r#"{"type":"values","x":4294967295,"y":4294967295,"width":64,"height":64,"request":1}"#,
        r#"{"type":"values","x":0,"y":0,"width":4294967295,"height":4294967295,"request":1}"#,
        r#"{"type":"pick","x":1e308,"y":-1e308,"request":1}"#,
        r#"{"type":"reset","sequence":1,"camera":4000000000}"#,
        r#"{"type":"set","scale":1e300}"#,
        r#"{"type":"set","scale":-1}"#,
        r#"{"type":"set","exposure":1e30}"#,
        r#"{"type":"set","spp":0}"#,
        r#"{"type":"set","scale":1,"exposure":0,"spp":4}"#,
        r#"{"type":"moment","time":1e300,"variant":null}"#,
        r#"{"type":"camera","sequence":2,"placement":{"eye":[1e308,0,0],"target":[0,0,0],"up":[0,0,1]},"fov":1e9,"zoom":0}"#,
        r#"{"type":"edit","path":"material.x\n.y","value":"\u0000"}"#,
        r#"{"type":"edit","path":"","value":""}"#,
    ] {
        socket.say(text);
    }
    for i in 0..20 {
        // More than a parameter may be long.
        socket.say(&format!(r#"{{"type":"edit","path":"{}{i}","value":"1"}}"#, "x".repeat(2000)));
    }
    goes_on(&viewer, &session);
}

#[test]
fn floods_end_and_idle_readers_block_nobody() {
    let viewer = Running::new();
    let session = viewer.session();
    let mut flood = viewer.socket(&session);
    for _ in 0..3000 {
        flood.say(r#"{"type":"shown"}"#);
    }
    let end = flood.end();
    assert!(end.is_none_or(|code| code == 1008), "{end:?}");
    let before = memory();
    let silent: Vec<_> = (0..100).map(|_| viewer.socket(&session)).collect();
    let mut socket = viewer.socket(&session);
    for sequence in 1..60 {
        socket.say(&format!(r#"{{"type":"reset","sequence":{sequence},"camera":0}}"#));
        while let Packet::Text(_) = socket.next() {}
        socket.say(r#"{"type":"shown"}"#);
    }
    if let (Some(before), Some(after)) = (before, memory()) {
        assert!(after < before + (64 << 20), "memory grows: {before} to {after}");
    }
    drop(silent);
    goes_on(&viewer, &session);
}

#[test]
fn strangers_who_connect_and_say_nothing_lock_no_one_out() {
    let viewer = Running::new();
    // More than there are places, of four kinds: silence, half a request, a request and no more, a socket without a
    // greeting.
    let mut strangers = Vec::new();
    let mut add = |count: usize| {
        for i in 0..count {
            let Ok(mut stream) = TcpStream::connect(viewer.address) else { continue };
            let host = viewer.host();
            let said = match i % 4 {
                0 => String::new(),
                1 => format!("GET / HTTP/1.1\r\nHost: {host}"),
                2 => format!("GET /viewer.js HTTP/1.1\r\nHost: {host}\r\n\r\n"),
                _ => format!(
                    "GET /socket HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
                     Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
                ),
            };
            let _ = stream.write_all(said.as_bytes());
            strangers.push(stream);
        }
    };
    add(400);
    // The user opens the address while they are there, and stays in when others come.
    let session = viewer.session();
    let mut socket = viewer.socket(&session);
    add(400);
    socket.say(r#"{"type":"reset","sequence":3,"camera":0}"#);
    socket.wait_for("progress", |progress| progress["doing"] == "done");
    goes_on(&viewer, &session);
    // Those who were first had to go: what there is to be read of them has an end.
    let first = &mut strangers[0];
    first.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let mut rest = Vec::new();
    assert!(first.read_to_end(&mut rest).is_ok() && rest.is_empty());
    drop(strangers);
    goes_on(&viewer, &session);
}

/// Bytes of memory in use, if the system reports it.
fn memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}
