//! One page's socket: after a greeting, frames and facts go out and messages come in. Slow pages skip frames; silent
//! ones are dropped.

use std::sync::Arc;
use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use tokio::sync::watch;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message as Packet;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};

use crate::guard::{Guard, Secret, Welcome};
use crate::message::{Access, PageGreeting, PageMessage, ViewerGreeting, ViewerMessage, to_json};
use crate::rate::Allowance;
use crate::server::{Server, has_to_go};
use crate::visitors::Visit;

/// Maximum bytes of a page's message; the longest has a parameter's name and value.
const MAX_MESSAGE_BYTES: usize = 16 << 10;
/// Timeout for a page to take what was sent.
const TAKEN_WITHIN: Duration = Duration::from_secs(10);
/// Interval between pings.
const ASK_EVERY: Duration = Duration::from_secs(20);
/// Maximum silence.
const SILENT_AT_MOST: Duration = Duration::from_secs(65);

/// Timeout for a page's greeting.
const HELLO_WITHIN: Duration = Duration::from_secs(5);
/// The close code for unknown pages: the page knows no secret of this viewer, or there are too many pages.
const UNKNOWN: CloseCode = CloseCode::Library(4403);

type Stream = WebSocketStream<TokioIo<Upgraded>>;

/// Serves a page until either side ends.
pub(crate) async fn talk(stream: TokioIo<Upgraded>, server: Arc<Server>, visit: Arc<Visit>) {
    let config = WebSocketConfig::default()
        .max_message_size(Some(MAX_MESSAGE_BYTES))
        .max_frame_size(Some(MAX_MESSAGE_BYTES))
        .read_buffer_size(8 << 10);
    let mut stream = WebSocketStream::from_raw_socket(stream, Role::Server, Some(config)).await;
    let ended = tokio::select! {
        ended = async {
            let access = greet(&mut stream, &server.guard, &visit).await?;
            converse(&mut stream, &server, access).await
        } => ended,
        () = has_to_go(&visit) => return,
    };
    if let Err(Some(reason)) = ended {
        let frame = CloseFrame { code: reason.0, reason: reason.1.into() };
        let _ = tokio::time::timeout(TAKEN_WITHIN, stream.close(Some(frame))).await;
    }
}

/// Lets in a page that knows our secret, and proves to it that we know it, too. Nothing is said before.
async fn greet(stream: &mut Stream, guard: &Guard, visit: &Visit) -> Result<Access, Ended> {
    let challenge = Secret::new().map_err(|_| None)?;
    let asked = ViewerGreeting::Challenge { nonce: challenge.digits() };
    send(stream, Packet::text(to_json(&asked))).await?;
    let answer = tokio::time::timeout(HELLO_WITHIN, stream.next()).await;
    let unknown = || Some((UNKNOWN, "this page is not known"));
    let Ok(Some(Ok(Packet::Text(text)))) = answer else { return Err(unknown()) };
    let PageGreeting::Hello { nonce, proof } = serde_json::from_str(&text).map_err(|_| unknown())?;
    let welcome = guard.admit(&challenge, &nonce, &proof).filter(|_| visit.let_in()).ok_or_else(unknown)?;
    let Welcome { proof, session, access } = welcome;
    send(stream, Packet::text(to_json(&ViewerGreeting::Welcome { proof, session, access }))).await?;
    Ok(access)
}

/// Why we close the socket; `None` if the other side closed it, or is gone.
type Ended = Option<(CloseCode, &'static str)>;

async fn converse(stream: &mut Stream, server: &Server, access: Access) -> Result<(), Ended> {
    let session = &*server.session;
    let mut scene = subscribe(&session.scene);
    let mut state = subscribe(&session.state);
    let mut progress = subscribe(&session.progress);
    let mut frames = subscribe(&session.frames);
    let mut ask = tokio::time::interval(ASK_EVERY);
    let mut allowance = Allowance::new(Instant::now());
    let mut last_heard = Instant::now();
    let mut may_send = true;
    loop {
        tokio::select! {
            biased;
            packet = stream.next() => {
                let packet = packet.ok_or(None)?.map_err(|_| None)?;
                last_heard = Instant::now();
                if !allowance.take(last_heard) {
                    return Err(Some((CloseCode::Policy, "too many messages")));
                }
                match packet {
                    Packet::Text(text) => {
                        let message: PageMessage = serde_json::from_str(&text)
                            .map_err(|_| Some((CloseCode::Policy, "the message is not understood")))?;
                        may_send |= message == PageMessage::Shown {};
                        let answer = match message {
                            message if access == Access::Watch && !message.only_asks() => {
                                Some(ViewerMessage::wrong("this page looks on: it changes nothing"))
                            }
                            PageMessage::Ticket { request, errand } => {
                                let address = server.guard.ticket(errand);
                                Some(ViewerMessage::Ticket { request, address })
                            }
                            message => session.handle_message(message),
                        };
                        if let Some(answer) = answer {
                            send(stream, Packet::text(to_json(&answer))).await?;
                        }
                    }
                    Packet::Binary(_) => return Err(Some((CloseCode::Unsupported, "text is expected"))),
                    Packet::Close(_) => return Ok(()),
                    Packet::Ping(_) | Packet::Pong(_) | Packet::Frame(_) => {}
                }
            }
            changed = scene.changed() => say(stream, changed, &mut scene).await?,
            changed = state.changed() => say(stream, changed, &mut state).await?,
            changed = frames.changed(), if may_send => {
                changed.map_err(|_| None)?;
                let frame = frames.borrow_and_update().clone();
                if let Some(frame) = frame {
                    may_send = false;
                    send(stream, Packet::Binary(frame.0)).await?;
                }
            }
            changed = progress.changed() => say(stream, changed, &mut progress).await?,
            _ = ask.tick() => {
                if last_heard.elapsed() > SILENT_AT_MOST {
                    return Err(Some((CloseCode::Away, "nothing was heard")));
                }
                send(stream, Packet::Ping(Vec::new().into())).await?;
            }
        }
    }
}

fn subscribe<T>(of: &watch::Sender<T>) -> watch::Receiver<T> {
    let mut receiver = of.subscribe();
    // The present state is new to a page that has just connected.
    receiver.mark_changed();
    receiver
}

async fn say(
    stream: &mut Stream,
    changed: Result<(), watch::error::RecvError>,
    what: &mut watch::Receiver<Arc<str>>,
) -> Result<(), Ended> {
    changed.map_err(|_| None)?;
    let text = what.borrow_and_update().clone();
    if text.is_empty() { Ok(()) } else { send(stream, Packet::text(&*text)).await }
}

async fn send(stream: &mut Stream, packet: Packet) -> Result<(), Ended> {
    match tokio::time::timeout(TAKEN_WITHIN, stream.send(packet)).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => Err(None),
    }
}
