//! HTTP on this machine: the page, the picture as a file, and the way to the socket. No path of a request reaches the
//! file system.

use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_DISPOSITION, CONTENT_LENGTH, CONTENT_SECURITY_POLICY, CONTENT_TYPE,
    HeaderValue, REFERRER_POLICY, SEC_WEBSOCKET_ACCEPT, SEC_WEBSOCKET_KEY, SEC_WEBSOCKET_VERSION, UPGRADE,
    X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use lumbre::formats::image::ImageFormat;
use tokio::sync::Notify;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;

use crate::bundle::{Dropped, Refused, unpack};
use crate::guard::{Guard, Refusal};
use crate::message::{Errand, FileFormat};
use crate::page::{FILES, POLICY, explanation_policy};
use crate::session::Session;
use crate::socket;
use crate::stage::Explained;
use crate::visitors::{Visit, Visitors};

/// Timeout for the headers of a request, and for the next request.
const HEADERS_WITHIN: Duration = Duration::from_secs(5);
/// Maximum duration of a connection that is not admitted.
const STRANGER_AT_MOST: Duration = Duration::from_secs(20);
/// Bytes of a request's headers.
const MAX_HEADER_BYTES: usize = 16 << 10;
/// Bytes of a scene that is dropped on the page.
const MAX_SCENE_BYTES: u64 = 256 << 20;
/// Timeout for it.
const SCENE_WITHIN: Duration = Duration::from_secs(120);

/// The data that all answers share.
pub(crate) struct Server {
    pub session: Arc<Session>,
    pub guard: Guard,
    /// Where files go that are dropped on the page, each time into a new folder.
    pub dropped: tempfile::TempDir,
    /// How often files were dropped.
    pub drops: AtomicU64,
    /// Which of these folders are in use.
    pub places: Places,
    /// Who is connected.
    pub visitors: Arc<Visitors>,
    /// Signals that the viewer closes.
    pub closed: Arc<Notify>,
}

/// The folders of the scene and of the light that were dropped last; those before are removed.
#[derive(Default)]
pub(crate) struct Places {
    scene: Mutex<Option<PathBuf>>,
    light: Mutex<Option<PathBuf>>,
}

impl Places {
    fn replace_scene(&self, folder: &Path) {
        replace(&self.scene, folder);
    }

    fn replace_light(&self, folder: &Path) {
        replace(&self.light, folder);
    }
}

fn replace(place: &Mutex<Option<PathBuf>>, folder: &Path) {
    let before = place.lock().unwrap_or_else(PoisonError::into_inner).replace(folder.to_owned());
    if let Some(before) = before {
        let _ = std::fs::remove_dir_all(before);
    }
}

type Answer = Response<Full<Bytes>>;

/// Answers until the viewer closes.
///
/// # Errors
/// If the listener cannot be used.
pub(crate) async fn serve(server: Arc<Server>, listener: TcpListener) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = server.closed.notified() => return Ok(()),
        };
        let Ok((stream, _)) = accepted else {
            // Too many open files.
            tokio::time::sleep(Duration::from_millis(5)).await;
            continue;
        };
        // Frames take many packets, and answers few: none should wait for another.
        let _ = stream.set_nodelay(true);
        let server = server.clone();
        let visit = Arc::new(server.visitors.come());
        tokio::spawn(async move {
            let service = service_fn(|request| {
                let (server, visit) = (server.clone(), visit.clone());
                async move { Ok::<_, Infallible>(server.answer(request, visit).await) }
            });
            let mut http = hyper::server::conn::http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(HEADERS_WITHIN).max_buf_size(MAX_HEADER_BYTES);
            let served = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
            // A fault of one connection does not affect others.
            tokio::select! {
                _ = served => {}
                () = has_to_go(&visit) => {}
            }
        });
    }
}

/// Waits until a connection must close: to make room for another, or because it was not admitted in time.
pub(crate) async fn has_to_go(visit: &Visit) {
    let is_late = async {
        tokio::time::sleep(STRANGER_AT_MOST).await;
        if visit.is_guest() {
            std::future::pending::<()>().await;
        }
    };
    tokio::select! {
        () = visit.gives_way() => {}
        () = is_late => {}
    }
}

impl Server {
    async fn answer(self: Arc<Self>, request: Request<Incoming>, visit: Arc<Visit>) -> Answer {
        let mut answer = match self.answered(request, visit).await {
            Ok(answer) => answer,
            Err(status) => text(status, explained(status)),
        };
        let headers = answer.headers_mut();
        for (name, value) in [
            (CONTENT_SECURITY_POLICY, POLICY),
            (X_CONTENT_TYPE_OPTIONS, "nosniff"),
            (X_FRAME_OPTIONS, "DENY"),
            (REFERRER_POLICY, "no-referrer"),
            (CACHE_CONTROL, "no-store"),
        ] {
            headers.entry(name).or_insert(HeaderValue::from_static(value));
        }
        headers.insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
        headers.insert("cross-origin-opener-policy", HeaderValue::from_static("same-origin"));
        answer
    }

    async fn answered(
        self: &Arc<Self>,
        request: Request<Incoming>,
        visit: Arc<Visit>,
    ) -> Result<Answer, StatusCode> {
        let headers = request.headers();
        self.guard.check_host(headers).map_err(status)?;
        if request.uri().authority().is_some() || request.uri().query().is_some() {
            return Err(StatusCode::BAD_REQUEST);
        }
        let path = request.uri().path();
        let is_get = request.method() == Method::GET;
        let changes = !is_get || path == "/socket";
        self.guard.check_origin(headers, changes).map_err(status)?;
        if let Some(ticket) = path.strip_prefix("/ticket/") {
            let errand = self.guard.redeem(ticket).filter(|_| visit.let_in()).ok_or(StatusCode::FORBIDDEN)?;
            return match (request.method(), errand) {
                (&Method::GET, Errand::Picture { format: FileFormat::Png }) => {
                    self.picture(ImageFormat::Png, "image/png").await
                }
                (&Method::GET, Errand::Picture { format: FileFormat::Exr }) => {
                    self.picture(ImageFormat::Exr, "image/x-exr").await
                }
                (&Method::GET, Errand::Explanation { language, pixel }) => {
                    self.explanation(language, pixel).await
                }
                (&Method::POST, Errand::Scene {}) => self.dropped(request).await,
                _ => Err(StatusCode::METHOD_NOT_ALLOWED),
            };
        }
        if (is_get, path) == (true, "/socket") {
            return self.upgraded(request, visit);
        }
        // The page itself is not secret: it is part of the program.
        let file = FILES.iter().find(|file| file.path == path).ok_or(StatusCode::NOT_FOUND)?;
        if !is_get {
            return Err(StatusCode::METHOD_NOT_ALLOWED);
        }
        let mut answer = Response::new(Full::new(Bytes::from_static(file.bytes)));
        answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(file.kind));
        Ok(answer)
    }

    async fn picture(&self, format: ImageFormat, kind: &'static str) -> Result<Answer, StatusCode> {
        let session = self.session.clone();
        // It takes a while; other requests should not wait for it.
        let encoded = tokio::task::spawn_blocking(move || session.file(format)).await;
        let bytes = encoded.ok().and_then(Result::ok).ok_or(StatusCode::NOT_FOUND)?;
        let mut answer = Response::new(Full::new(bytes.into()));
        answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
        // The page names the file, after the scene.
        answer.headers_mut().insert(CONTENT_DISPOSITION, HeaderValue::from_static("attachment"));
        Ok(answer)
    }

    /// An explanation of a pixel's colour: a page for our frame or a tab of its own.
    async fn explanation(&self, language: String, pixel: (u32, u32)) -> Result<Answer, StatusCode> {
        let session = self.session.clone();
        let told = tokio::task::spawn_blocking(move || session.explain(pixel, &language)).await;
        let told = told.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?.ok_or(StatusCode::NOT_FOUND)?;
        let (status, kind, text, script) = match told {
            Ok(Explained { page, script }) => (StatusCode::OK, "text/html; charset=utf-8", page, script),
            Err(why) => (StatusCode::UNPROCESSABLE_ENTITY, "text/plain; charset=utf-8", why, None),
        };
        let policy = HeaderValue::from_str(&explanation_policy(script));
        let policy = policy.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?;
        let mut answer = Response::new(Full::new(text.into()));
        *answer.status_mut() = status;
        answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
        answer.headers_mut().insert(CONTENT_SECURITY_POLICY, policy);
        answer.headers_mut().insert(X_FRAME_OPTIONS, HeaderValue::from_static("SAMEORIGIN"));
        Ok(answer)
    }

    /// Files that were dropped on the page: a scene, or light for the one that is there.
    async fn dropped(&self, request: Request<Incoming>) -> Result<Answer, StatusCode> {
        // A type that no form of another site can send.
        if request.headers().get(CONTENT_TYPE).is_none_or(|kind| kind != "application/octet-stream") {
            return Err(StatusCode::UNSUPPORTED_MEDIA_TYPE);
        }
        let length = request
            .headers()
            .get(CONTENT_LENGTH)
            .and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
        match length {
            Some(length) if length <= MAX_SCENE_BYTES => {}
            Some(_) => return Err(StatusCode::PAYLOAD_TOO_LARGE),
            None => return Err(StatusCode::LENGTH_REQUIRED),
        }
        let body = Limited::new(request.into_body(), MAX_SCENE_BYTES as usize).collect();
        let body = tokio::time::timeout(SCENE_WITHIN, body).await.map_err(|_| StatusCode::REQUEST_TIMEOUT)?;
        let bytes = body.map_err(|_| StatusCode::BAD_REQUEST)?.to_bytes();
        let number = self.drops.fetch_add(1, Ordering::Relaxed);
        let folder = self.dropped.path().join(number.to_string());
        std::fs::create_dir(&folder).map_err(|_| StatusCode::INSUFFICIENT_STORAGE)?;
        let unpacked = tokio::task::spawn_blocking({
            let folder = folder.clone();
            move || unpack(&bytes, &folder)
        });
        let unpacked = unpacked.await.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?;
        if unpacked.is_err() {
            let _ = std::fs::remove_dir_all(&folder);
        }
        match unpacked {
            Ok(Dropped::Scene(scene)) => {
                self.places.replace_scene(&folder);
                self.session.open(self.session.source().of_folder(&folder, &scene));
                Ok(text(StatusCode::OK, "opened"))
            }
            Ok(Dropped::Environment(_)) if self.session.source().is_empty() => Ok(text(
                StatusCode::UNPROCESSABLE_ENTITY,
                "A picture is light for a scene: drop a scene first.",
            )),
            Ok(Dropped::Environment(picture)) => {
                self.places.replace_light(&folder);
                self.session.relight(self.session.source().in_light_of(&picture));
                Ok(text(StatusCode::OK, "opened"))
            }
            Err(Refused::Name) => Ok(text(
                StatusCode::UNPROCESSABLE_ENTITY,
                "A name of a file leads out of its folder, or stands twice.",
            )),
            Err(Refused::Storage) => Err(StatusCode::INSUFFICIENT_STORAGE),
            Err(Refused::Malformed | Refused::Kind) => Err(StatusCode::UNSUPPORTED_MEDIA_TYPE),
        }
    }

    /// Upgrades from HTTP to the socket.
    fn upgraded(
        self: &Arc<Self>,
        request: Request<Incoming>,
        visit: Arc<Visit>,
    ) -> Result<Answer, StatusCode> {
        let headers = request.headers();
        let names = |name, word: &str| {
            let value: Option<&HeaderValue> = headers.get(name);
            let words =
                value.and_then(|value| value.to_str().ok()).into_iter().flat_map(|text| text.split(','));
            words.map(str::trim).any(|found| found.eq_ignore_ascii_case(word))
        };
        if !names(CONNECTION, "upgrade") || !names(UPGRADE, "websocket") {
            return Err(StatusCode::UPGRADE_REQUIRED);
        }
        if headers.get(SEC_WEBSOCKET_VERSION).is_none_or(|version| version != "13") {
            return Err(StatusCode::UPGRADE_REQUIRED);
        }
        // 16 bytes in base 64.
        let key =
            headers.get(SEC_WEBSOCKET_KEY).filter(|key| key.len() == 24).ok_or(StatusCode::BAD_REQUEST)?;
        let accept = HeaderValue::from_str(&derive_accept_key(key.as_bytes()));
        let accept = accept.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?;
        let server = self.clone();
        tokio::spawn(async move {
            if let Ok(upgraded) = hyper::upgrade::on(request).await {
                socket::talk(TokioIo::new(upgraded), server, visit).await;
            }
        });
        let mut answer = Response::new(Full::default());
        *answer.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
        let headers = answer.headers_mut();
        headers.insert(CONNECTION, HeaderValue::from_static("upgrade"));
        headers.insert(UPGRADE, HeaderValue::from_static("websocket"));
        headers.insert(SEC_WEBSOCKET_ACCEPT, accept);
        Ok(answer)
    }
}

fn status(refusal: Refusal) -> StatusCode {
    match refusal {
        Refusal::Host => StatusCode::MISDIRECTED_REQUEST,
        Refusal::Origin => StatusCode::FORBIDDEN,
    }
}

fn explained(status: StatusCode) -> &'static str {
    match status {
        StatusCode::FORBIDDEN => {
            "This viewer answers its own page alone. Open the address that `lumbre view` printed."
        }
        StatusCode::MISDIRECTED_REQUEST => {
            "This viewer has another address. Through a tunnel, use the same port at both ends: ssh -L PORT:127.0.0.1:PORT HOST"
        }
        StatusCode::UNSUPPORTED_MEDIA_TYPE => {
            "None of the files is a scene (.pbrt, .pov, .gltf, .glb, .obj, .ply, .stl), and they are no single picture of light (.hdr, .exr)."
        }
        StatusCode::INSUFFICIENT_STORAGE => "There is no room for the files.",
        StatusCode::PAYLOAD_TOO_LARGE => {
            "The file is too large to be dropped here: open it from the command line."
        }
        StatusCode::NOT_FOUND => "There is nothing here.",
        _ => "The request is not understood.",
    }
}

fn text(status: StatusCode, text: &'static str) -> Answer {
    let mut answer = Response::new(Full::new(Bytes::from_static(text.as_bytes())));
    *answer.status_mut() = status;
    answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    answer
}

/// A listener at an address.
///
/// # Errors
/// Why there is none.
pub(crate) fn listen(address: SocketAddr) -> Result<TcpListener, String> {
    TcpListener::bind(address).map_err(|e| match e.kind() {
        std::io::ErrorKind::AddrInUse => {
            format!("{address} is in use (expected another --port, or none for one that is free)")
        }
        _ => format!("cannot listen at {address}: {e}"),
    })
}
