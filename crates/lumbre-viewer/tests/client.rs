//! A viewer of a small scene, and a client that says whatever it likes.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lumbre::{DVec3, RenderOptions, SaveOptions, Scene, SceneDesc};
use lumbre_viewer::{
    Built, Closer, Explain, Hidden, Moment, Options, Read as WasRead, Source, SourceError, Viewer,
};

/// The widest picture that there is memory for.
pub(crate) const MAX_PIXELS: u32 = 90;

/// A scene file in a folder of its own.
pub(crate) struct OneFile(pub PathBuf);

impl Source for OneFile {
    fn name(&self) -> String {
        "<img src=x onerror=alert(1)>.pbrt".to_owned()
    }

    fn files(&self) -> Vec<PathBuf> {
        vec![self.0.clone()]
    }

    fn read(&self, _: &Moment) -> Result<WasRead, SourceError> {
        let (desc, diagnostics) = lumbre::describe(&[&self.0], &lumbre::ReadOptions::default())?;
        Ok(WasRead { desc, files: diagnostics.files_read().to_vec(), warnings: diagnostics.lines() })
    }

    fn build(&self, mut desc: SceneDesc, hidden: &Hidden) -> Result<Built, SourceError> {
        hidden.apply(&mut desc);
        let scene = Scene::from_description(desc)?;
        let options = scene.options();
        let save = SaveOptions::default();
        Ok(Built {
            scene,
            options,
            save,
            background: None,
            denoise: false,
            warnings: Vec::new(),
            explain: Some(Box::new(Words)),
        })
    }

    fn check(&self, options: &RenderOptions) -> Result<(), SourceError> {
        if options.width <= MAX_PIXELS {
            return Ok(());
        }
        let message = format!("a picture of {} pixels does not fit", options.width);
        Err(SourceError { kind: lumbre::ErrorKind::Limit, message })
    }

    fn of_folder(&self, _: &Path, scene: &Path) -> Arc<dyn Source> {
        Arc::new(Self(scene.to_owned()))
    }

    fn in_light_of(&self, _: &Path) -> Arc<dyn Source> {
        Arc::new(Self(self.0.clone()))
    }
}

/// Returns the pixel it was asked for, in one language.
#[derive(Debug)]
struct Words;

impl Explain for Words {
    fn languages(&self) -> Vec<(&'static str, &'static str)> {
        vec![("la", "Latina")]
    }

    fn script(&self) -> Option<&'static str> {
        Some("sha256-AbCd")
    }

    fn page(
        &self,
        scene: &Scene,
        options: &RenderOptions,
        (x, y): (u32, u32),
        language: &str,
    ) -> Result<String, String> {
        if language != "la" {
            return Err(format!("<b>{language}</b> is not spoken here"));
        }
        let eye = scene.resolved().cameras()[options.camera].world_from_camera.point(DVec3::ZERO);
        Ok(format!("{x} {y} of {} {} from {}", options.width, options.height, eye.x.round()))
    }
}

pub(crate) const SCENE: &str = r#"LookAt 1 -7 3  0 0 0.5  0 0 1 Camera "perspective" "float fov" 35
Film "rgb" "integer xresolution" 48 "integer yresolution" 32 Sampler "independent" "integer pixelsamples" 4
WorldBegin LightSource "infinite" "rgb L" [0.5 0.6 0.7]
MakeNamedMaterial "<b>wood</b>" "string type" "diffuse" "rgb reflectance" [0.7 0.2 0.1]
NamedMaterial "<b>wood</b>" Shape "sphere" "float radius" 1.25
"#;

/// A viewer that runs until it is dropped.
pub(crate) struct Running {
    pub address: SocketAddr,
    pub path: PathBuf,
    token: String,
    /// Those of browsers that look on.
    pub watchers: Vec<String>,
    closer: Closer,
    thread: Option<JoinHandle<Result<(), String>>>,
    _folder: tempfile::TempDir,
}

impl Running {
    pub(crate) fn new() -> Self {
        Self::shared(0)
    }

    /// One that this many more browsers may look at.
    pub(crate) fn shared(watchers: usize) -> Self {
        let mut options = Options::default();
        options.watchers = watchers;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.pbrt");
        std::fs::write(&path, SCENE).unwrap();
        let viewer = Viewer::new(Arc::new(OneFile(path.clone())), &options).unwrap();
        let address = viewer.address();
        let url = viewer.url();
        let token_of = |url: &String| url.rsplit('#').next().unwrap().to_owned();
        let token = token_of(&url);
        let watchers = viewer.watcher_urls().iter().map(token_of).collect();
        let closer = viewer.closer();
        let thread = Some(std::thread::spawn(move || viewer.run()));
        Self { address, path, token, watchers, closer, thread, _folder: folder }
    }

    pub(crate) fn host(&self) -> String {
        self.address.to_string()
    }

    /// What the address has that opens it once.
    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// Sends bytes and reads until the other side closes or says nothing for a while.
    pub(crate) fn raw(&self, request: &[u8]) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        // It may be refused before it is all there.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// The status of the answer to a request with these header lines; 0 without an answer.
    pub(crate) fn status(&self, method: &str, path: &str, headers: &[String]) -> u16 {
        let lines: String = headers.iter().map(|line| format!("{line}\r\n")).collect();
        let answer =
            self.raw(format!("{method} {path} HTTP/1.1\r\n{lines}Connection: close\r\n\r\n").as_bytes());
        answer.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0)
    }

    /// Takes the token for the secret of the session.
    pub(crate) fn session(&self) -> String {
        let mut socket = self.connect();
        let welcome = socket.greet(&self.token).expect("it is let in");
        welcome["session"].as_str().unwrap().to_owned()
    }

    /// A socket of a page that has this secret.
    pub(crate) fn socket(&self, session: &str) -> Socket {
        let mut socket = self.connect();
        let welcome = socket.greet(session).expect("it is let in");
        assert!(welcome["session"].is_null());
        socket
    }

    /// A socket of a page that has said nothing yet.
    pub(crate) fn connect(&self) -> Socket {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let host = self.host();
        let request = format!(
            "GET /socket HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nConnection: Upgrade\r\n\
             Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut head = Vec::new();
        let mut byte = [0];
        while !head.ends_with(b"\r\n\r\n") {
            stream.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        let head = String::from_utf8(head).unwrap();
        assert!(head.starts_with("HTTP/1.1 101"), "{head}");
        // The example of RFC 6455.
        assert!(head.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{head}");
        Socket(stream)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.closer.close();
        let ended = self.thread.take().unwrap().join().unwrap();
        if !std::thread::panicking() {
            ended.unwrap();
        }
    }
}

/// That a side knows a secret.
pub(crate) fn proof(secret: &str, side: &str, challenge: &str, nonce: &str) -> String {
    let bytes = |digits: &str| -> Vec<u8> {
        (0..digits.len() / 2).map(|i| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).unwrap()).collect()
    };
    let text = [side.as_bytes(), &bytes(challenge)[..24], &bytes(nonce)[..24]].concat();
    blake3::keyed_hash(&bytes(secret).try_into().unwrap(), &text).to_hex().to_string()
}

/// What came through a socket.
#[derive(Debug)]
pub(crate) enum Packet {
    Text(String),
    Binary(Vec<u8>),
    /// With its code.
    Close(u16),
    /// The connection is gone.
    Gone,
}

/// The page's side of a socket.
pub(crate) struct Socket(pub TcpStream);

impl Socket {
    /// Proves to know a secret, and hears that the other side does; `None` where it is sent away.
    pub(crate) fn greet(&mut self, secret: &str) -> Option<serde_json::Value> {
        let Packet::Text(text) = self.next() else { return None };
        let challenge: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(challenge["type"], "challenge");
        let challenge = challenge["nonce"].as_str().unwrap().to_owned();
        let nonce = "5a".repeat(32);
        let (proof, expected) =
            (proof(secret, "page", &challenge, &nonce), proof(secret, "viewer", &challenge, &nonce));
        self.say(&format!(r#"{{"type":"hello","nonce":"{nonce}","proof":"{proof}"}}"#));
        let Packet::Text(text) = self.next() else { return None };
        let welcome: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(
            (welcome["type"].as_str(), welcome["proof"].as_str()),
            (Some("welcome"), Some(&*expected))
        );
        Some(welcome)
    }

    /// An address for an errand.
    pub(crate) fn ticket(&mut self, errand: &str) -> String {
        self.say(&format!(r#"{{"type":"ticket","request":5,"errand":{errand}}}"#));
        self.wait_for("ticket", |_| true)["address"].as_str().unwrap().to_owned()
    }

    /// Sends a frame with a first byte and a length as they are said, masked by zeros.
    pub(crate) fn send_frame(&mut self, first: u8, payload: &[u8]) {
        let mut frame = vec![first];
        match payload.len() {
            short @ 0..126 => frame.push(0x80 | short as u8),
            middle @ 126..65536 => {
                frame.push(0x80 | 126);
                frame.extend((middle as u16).to_be_bytes());
            }
            long => {
                frame.push(0x80 | 127);
                frame.extend((long as u64).to_be_bytes());
            }
        }
        frame.extend([0; 4]);
        frame.extend(payload);
        let _ = self.0.write_all(&frame);
    }

    pub(crate) fn say(&mut self, text: &str) {
        self.send_frame(0x81, text.as_bytes());
    }

    /// The next packet that is no ping.
    pub(crate) fn next(&mut self) -> Packet {
        loop {
            let mut head = [0; 2];
            if self.0.read_exact(&mut head).is_err() {
                return Packet::Gone;
            }
            let mut length = u64::from(head[1] & 0x7f);
            if length >= 126 {
                let mut bytes = vec![0; if length == 126 { 2 } else { 8 }];
                self.0.read_exact(&mut bytes).unwrap();
                length = bytes.iter().fold(0, |all, byte| all << 8 | u64::from(*byte));
            }
            let mut payload = vec![0; length as usize];
            if self.0.read_exact(&mut payload).is_err() {
                return Packet::Gone;
            }
            match head[0] & 0x0f {
                1 => return Packet::Text(String::from_utf8(payload).unwrap()),
                2 => return Packet::Binary(payload),
                8 => {
                    let code = payload.get(..2).map_or(1005, |code| u16::from_be_bytes([code[0], code[1]]));
                    return Packet::Close(code);
                }
                _ => {}
            }
        }
    }

    /// Waits for a message of this kind that meets a condition.
    pub(crate) fn wait_for(
        &mut self,
        kind: &str,
        holds: impl Fn(&serde_json::Value) -> bool,
    ) -> serde_json::Value {
        let end = Instant::now() + Duration::from_secs(60);
        while Instant::now() < end {
            match self.next() {
                Packet::Text(text) => {
                    let message: serde_json::Value = serde_json::from_str(&text).unwrap();
                    if message["type"] == kind && holds(&message) {
                        return message;
                    }
                }
                Packet::Binary(_) => self.say(r#"{"type":"shown"}"#),
                other => panic!("while waiting for {kind}: {other:?}"),
            }
        }
        panic!("no {kind} came");
    }

    /// How the socket ends: its code, or nothing where the connection is gone.
    pub(crate) fn end(&mut self) -> Option<u16> {
        loop {
            match self.next() {
                Packet::Close(code) => return Some(code),
                Packet::Gone => return None,
                Packet::Text(_) | Packet::Binary(_) => {}
            }
        }
    }
}
