//! HTTP on this machine: the page, the picture as a file, and the way to the socket. No path of a request reaches the file system.

use std::convert::Infallible;
use std::io::Write;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_DISPOSITION, CONTENT_LENGTH, CONTENT_SECURITY_POLICY, CONTENT_TYPE,
    HeaderValue, LOCATION, REFERRER_POLICY, SEC_WEBSOCKET_ACCEPT, SEC_WEBSOCKET_KEY, SEC_WEBSOCKET_VERSION,
    SET_COOKIE, UPGRADE, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use hyper::service::service_fn;
use hyper::{HeaderMap, Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use lumbre::formats::image::ImageFormat;
use tokio::sync::{Notify, Semaphore};
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;

use crate::guard::{Guard, Refusal};
use crate::page::{EXPLANATION_POLICY, FILES, POLICY};
use crate::session::Session;
use crate::socket;

/// Connections at a time; more are closed at once.
const MOST_CONNECTIONS: usize = 256;
/// Until a request is there with all of its headers.
const HEADERS_WITHIN: Duration = Duration::from_secs(10);
/// Bytes of a request's headers.
const MOST_HEADER_BYTES: usize = 16 << 10;
/// Bytes of a scene that is dropped on the page.
const MOST_SCENE_BYTES: u64 = 256 << 20;
/// Until it is there.
const SCENE_WITHIN: Duration = Duration::from_secs(120);
/// What a binary glTF begins with.
const GLB: &[u8] = b"glTF";

/// What answers have in common.
pub(crate) struct Server {
    pub session: Arc<Session>,
    pub guard: Guard,
    /// Where scenes go that are dropped on the page, under names of our own.
    pub dropped: tempfile::TempDir,
    /// Tells that the viewer closes.
    pub closed: Arc<Notify>,
}

type Answer = Response<Full<Bytes>>;

/// Answers until the viewer closes.
///
/// # Errors
/// Where the listener cannot be used.
pub(crate) async fn serve(server: Arc<Server>, listener: TcpListener) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let connections = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = server.closed.notified() => return Ok(()),
        };
        let (Ok((stream, _)), Ok(place)) = (accepted, connections.clone().try_acquire_owned()) else {
            // No more files, or no more places: whoever is there goes on.
            tokio::time::sleep(Duration::from_millis(5)).await;
            continue;
        };
        // A frame is many packets, and an answer few: none should wait for another.
        let _ = stream.set_nodelay(true);
        let server = server.clone();
        tokio::spawn(async move {
            let place = Arc::new(place);
            let service = service_fn(|request| {
                let (server, place) = (server.clone(), place.clone());
                async move { Ok::<_, Infallible>(server.answer(request, place).await) }
            });
            let mut http = hyper::server::conn::http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(HEADERS_WITHIN).max_buf_size(MOST_HEADER_BYTES);
            // What goes wrong with one connection is told to no one else.
            let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
        });
    }
}

impl Server {
    async fn answer(&self, request: Request<Incoming>, place: socket::Place) -> Answer {
        let mut answer = match self.answered(request, place).await {
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

    async fn answered(&self, request: Request<Incoming>, place: socket::Place) -> Result<Answer, StatusCode> {
        let headers = request.headers();
        self.guard.check_host(headers).map_err(status)?;
        if request.uri().authority().is_some() || request.uri().query().is_some() {
            return Err(StatusCode::BAD_REQUEST);
        }
        let path = request.uri().path();
        let is_get = request.method() == Method::GET;
        let changes = !is_get || path == "/socket";
        self.guard.check_origin(headers, changes).map_err(status)?;
        if let (Some(token), true) = (path.strip_prefix("/open/"), is_get) {
            return self.opened(headers, token);
        }
        self.guard.check_session(headers).map_err(status)?;
        match (request.method(), path) {
            (&Method::GET, "/socket") => self.upgraded(request, place),
            (&Method::GET, "/picture.png") => {
                self.picture(ImageFormat::Png, "image/png", "picture.png").await
            }
            (&Method::GET, "/picture.exr") => {
                self.picture(ImageFormat::Exr, "image/x-exr", "picture.exr").await
            }
            (&Method::GET, path) if path.starts_with("/explanation/") => self.explanation(path).await,
            (&Method::POST, "/scene") => self.dropped(request).await,
            (method, path) => {
                let file = FILES.iter().find(|file| file.path == path).ok_or(StatusCode::NOT_FOUND)?;
                if method != Method::GET {
                    return Err(StatusCode::METHOD_NOT_ALLOWED);
                }
                let mut answer = Response::new(Full::new(Bytes::from_static(file.bytes)));
                answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(file.kind));
                Ok(answer)
            }
        }
    }

    /// The token becomes a cookie, and the address one without it.
    fn opened(&self, headers: &HeaderMap, token: &str) -> Result<Answer, StatusCode> {
        let is_known = self.guard.check_session(headers).is_ok();
        if !is_known && !self.guard.take(token) {
            return Err(StatusCode::FORBIDDEN);
        }
        let mut answer = text(StatusCode::SEE_OTHER, "");
        answer.headers_mut().insert(LOCATION, HeaderValue::from_static("/"));
        let cookie = HeaderValue::from_str(&self.guard.set_cookie());
        answer.headers_mut().insert(SET_COOKIE, cookie.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?);
        Ok(answer)
    }

    async fn picture(
        &self,
        format: ImageFormat,
        kind: &'static str,
        name: &str,
    ) -> Result<Answer, StatusCode> {
        let session = self.session.clone();
        // It takes its time, which the others should not wait for.
        let encoded = tokio::task::spawn_blocking(move || session.file(format)).await;
        let bytes = encoded.ok().and_then(Result::ok).ok_or(StatusCode::NOT_FOUND)?;
        let mut answer = Response::new(Full::new(bytes.into()));
        answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
        let name = HeaderValue::from_str(&format!("attachment; filename=\"{name}\""));
        answer
            .headers_mut()
            .insert(CONTENT_DISPOSITION, name.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?);
        Ok(answer)
    }

    /// How the colour of a pixel comes about: a page for a frame of ours or a tab of its own.
    async fn explanation(&self, path: &str) -> Result<Answer, StatusCode> {
        let mut parts = path.split('/').skip(2);
        let (Some(language), Some(x), Some(y), None) =
            (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return Err(StatusCode::NOT_FOUND);
        };
        let number = |text: &str| text.parse().map_err(|_| StatusCode::NOT_FOUND);
        let (session, language, pixel) =
            (self.session.clone(), language.to_owned(), (number(x)?, number(y)?));
        let told = tokio::task::spawn_blocking(move || session.explain(pixel, &language)).await;
        let told = told.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?.ok_or(StatusCode::NOT_FOUND)?;
        let (status, kind, text) = match told {
            Ok(page) => (StatusCode::OK, "text/html; charset=utf-8", page),
            Err(why) => (StatusCode::UNPROCESSABLE_ENTITY, "text/plain; charset=utf-8", why),
        };
        let mut answer = Response::new(Full::new(text.into()));
        *answer.status_mut() = status;
        for (name, value) in [
            (CONTENT_TYPE, kind),
            (CONTENT_SECURITY_POLICY, EXPLANATION_POLICY),
            (X_FRAME_OPTIONS, "SAMEORIGIN"),
        ] {
            answer.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        Ok(answer)
    }

    /// A .glb that was dropped on the page.
    async fn dropped(&self, request: Request<Incoming>) -> Result<Answer, StatusCode> {
        // A type that no form of another site can have.
        if request.headers().get(CONTENT_TYPE).is_none_or(|kind| kind != "application/octet-stream") {
            return Err(StatusCode::UNSUPPORTED_MEDIA_TYPE);
        }
        let length = request
            .headers()
            .get(CONTENT_LENGTH)
            .and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
        match length {
            Some(length) if length <= MOST_SCENE_BYTES => {}
            Some(_) => return Err(StatusCode::PAYLOAD_TOO_LARGE),
            None => return Err(StatusCode::LENGTH_REQUIRED),
        }
        let body = Limited::new(request.into_body(), MOST_SCENE_BYTES as usize).collect();
        let body = tokio::time::timeout(SCENE_WITHIN, body).await.map_err(|_| StatusCode::REQUEST_TIMEOUT)?;
        let bytes = body.map_err(|_| StatusCode::BAD_REQUEST)?.to_bytes();
        if !bytes.starts_with(GLB) {
            return Err(StatusCode::UNSUPPORTED_MEDIA_TYPE);
        }
        let path = self.dropped.path().join("dropped.glb");
        let written = std::fs::File::create(&path).and_then(|mut file| file.write_all(&bytes));
        written.map_err(|_| StatusCode::INSUFFICIENT_STORAGE)?;
        let source = self.session.source().of_file(&path);
        self.session.open(source);
        Ok(text(StatusCode::OK, "opened"))
    }

    /// From HTTP to the socket.
    fn upgraded(&self, request: Request<Incoming>, place: socket::Place) -> Result<Answer, StatusCode> {
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
        let session = self.session.clone();
        tokio::spawn(async move {
            if let Ok(upgraded) = hyper::upgrade::on(request).await {
                socket::talk(TokioIo::new(upgraded), session, place).await;
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
        Refusal::Origin | Refusal::Session => StatusCode::FORBIDDEN,
    }
}

fn explained(status: StatusCode) -> &'static str {
    match status {
        StatusCode::FORBIDDEN => {
            "This viewer is open to one browser. Open the address that `lumbre view` printed; it works once, so start it again for another browser."
        }
        StatusCode::MISDIRECTED_REQUEST => {
            "This viewer has another address. Through a tunnel, use the same port at both ends: ssh -L PORT:127.0.0.1:PORT HOST"
        }
        StatusCode::UNSUPPORTED_MEDIA_TYPE => "A .glb is expected.",
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
