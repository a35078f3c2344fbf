//! Access to the viewer: exact lists of hosts and origins, and secrets that only the page and the viewer know.
//!
//! Browsers send cookies to every port of a host, so there are none. The address that opens the viewer has a token
//! after its `#`, which browsers do not send; the page keeps the secret derived from it in the storage of its own
//! origin, port included. Neither is sent over the socket: each side proves to know it, by a keyed hash (BLAKE3) of
//! random numbers of both. Another program that takes the port after the viewer has ended learns nothing of use from a
//! page that reconnects.

use std::collections::VecDeque;
use std::fs;
use std::io::{Read, Write};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use hyper::HeaderMap;
use hyper::header::{HOST, HeaderName, ORIGIN};

use crate::message::{Access, Errand};

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The `Host` is not one of ours.
    Host,
    /// The `Origin`, or the browser's statement of the request's source.
    Origin,
}

/// The reply to a page that was admitted.
#[derive(Debug, PartialEq)]
pub(crate) struct Welcome {
    /// The keyed hash of "viewer" and the numbers of both sides, with the secret that the page knows.
    pub proof: String,
    /// The secret of the session, for a page that came with the token.
    pub session: Option<String>,
    /// What the page may do.
    pub access: Access,
}

/// The secrets that let in one browser.
struct Key {
    session: Secret,
    /// The token, until it was used.
    token: Mutex<Option<Secret>>,
    access: Access,
}

impl Key {
    fn new(session: Secret, access: Access) -> Result<Self, String> {
        Ok(Self { session, token: Mutex::new(Some(Secret::new()?)), access })
    }

    /// The path that opens the viewer, once.
    fn path(&self) -> String {
        let token = self.token.lock().unwrap_or_else(PoisonError::into_inner);
        token.as_ref().map_or_else(|| "/".to_owned(), |token| format!("/#{}", token.digits()))
    }
}

/// The secrets and the host names of a viewer.
pub(crate) struct Guard {
    hosts: Vec<String>,
    /// That of the user first, then those of watchers.
    keys: Vec<Key>,
    /// The oldest first.
    tickets: Mutex<VecDeque<(Secret, Errand)>>,
}

/// Maximum unused tickets; more push out the oldest.
const MAX_TICKETS: usize = 64;
const FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

impl Guard {
    /// For a viewer at an address, with other names for it, as `name:port`, and the file that keeps the secret of the
    /// session across restarts. This many more browsers may watch.
    ///
    /// # Errors
    /// If the system gives no random bytes.
    pub(crate) fn new(
        address: SocketAddr,
        more_hosts: &[String],
        session_file: Option<&Path>,
        watchers: usize,
    ) -> Result<Self, String> {
        let port = address.port();
        let mut hosts = vec![address.to_string()];
        if address.ip().is_loopback() {
            hosts.push(format!("localhost:{port}"));
        }
        hosts.extend(more_hosts.iter().map(|host| host.to_ascii_lowercase()));
        let session = match session_file {
            Some(path) => kept_secret(path)?,
            None => Secret::new()?,
        };
        let mut keys = vec![Key::new(session, Access::Edit)?];
        for _ in 0..watchers {
            keys.push(Key::new(Secret::new()?, Access::Watch)?);
        }
        Ok(Self { hosts, keys, tickets: Mutex::default() })
    }

    /// The paths that open the viewer, each once: that of the user, then those of watchers.
    pub(crate) fn paths(&self) -> impl Iterator<Item = String> + '_ {
        self.keys.iter().map(Key::path)
    }

    /// Whether a request is for this host: protects against DNS rebinding.
    pub(crate) fn check_host(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        match single(headers, &HOST) {
            Some(host) if self.hosts.iter().any(|known| known == host) => Ok(()),
            _ => Err(Refusal::Host),
        }
    }

    /// Whether a request comes from our page, or from no page at all. Requests that change something or open a socket
    /// must state their origin.
    pub(crate) fn check_origin(&self, headers: &HeaderMap, origin_required: bool) -> Result<(), Refusal> {
        let host = single(headers, &HOST).ok_or(Refusal::Host)?;
        match single(headers, &ORIGIN) {
            Some(origin) if origin.strip_prefix("http://") == Some(host) => {}
            None if !origin_required && !headers.contains_key(ORIGIN) => {}
            _ => return Err(Refusal::Origin),
        }
        match headers.get(FETCH_SITE).map(|site| site.as_bytes()) {
            None | Some(b"same-origin" | b"none") => Ok(()),
            _ => Err(Refusal::Origin),
        }
    }

    /// Admits a page that proves to know the token, which works once, or the secret of the session: by the keyed hash
    /// of "page", of our challenge and of 32 random bytes of the page's, both as hexadecimal digits.
    pub(crate) fn admit(&self, challenge: &Secret, nonce: &str, proof: &str) -> Option<Welcome> {
        let page: Secret = nonce.parse().ok()?;
        let asked = |key: &Secret| key.proof(b"page", challenge, &page);
        let answered = |key: &Secret| key.proof(b"viewer", challenge, &page).digits();
        let admitted = |Key { session, token, access }: &Key| {
            if is_same(proof, &asked(session).digits()) {
                return Some(Welcome { proof: answered(session), session: None, access: *access });
            }
            let mut token = token.lock().unwrap_or_else(PoisonError::into_inner);
            if !token.as_ref().is_some_and(|token| is_same(proof, &asked(token).digits())) {
                return None;
            }
            let token = token.take()?;
            Some(Welcome { proof: answered(&token), session: Some(session.digits()), access: *access })
        };
        self.keys.iter().find_map(admitted)
    }

    /// A single-use link to an answer that is fetched, or to an upload.
    pub(crate) fn ticket(&self, errand: Errand) -> Option<String> {
        let ticket = Secret::new().ok()?;
        let address = format!("/ticket/{}", ticket.digits());
        let mut tickets = self.tickets.lock().unwrap_or_else(PoisonError::into_inner);
        if tickets.len() >= MAX_TICKETS {
            tickets.pop_front();
        }
        tickets.push_back((ticket, errand));
        Some(address)
    }

    /// The errand of a ticket, which is used up.
    pub(crate) fn redeem(&self, ticket: &str) -> Option<Errand> {
        let mut tickets = self.tickets.lock().unwrap_or_else(PoisonError::into_inner);
        let place = tickets.iter().position(|(known, _)| is_same(ticket, &known.digits()))?;
        tickets.remove(place).map(|(_, errand)| errand)
    }
}

/// 256 random bits.
#[derive(Clone, PartialEq)]
pub(crate) struct Secret([u8; 32]);

impl Secret {
    /// # Errors
    /// Where the system gives no random bytes.
    pub(crate) fn new() -> Result<Self, String> {
        let mut bytes = [0; 32];
        getrandom::fill(&mut bytes).map_err(|e| format!("the system gives no random numbers: {e}"))?;
        Ok(Self(bytes))
    }

    pub(crate) fn digits(&self) -> String {
        self.0.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// The proof that `whose` side knows this secret. It takes the first 24 bytes of each random number, so that all
    /// fits one block of BLAKE3.
    fn proof(&self, whose: &[u8], challenge: &Self, page: &Self) -> Self {
        let text = [whose, &challenge.0[..24], &page.0[..24]].concat();
        Self(*blake3::keyed_hash(&self.0, &text).as_bytes())
    }
}

impl std::str::FromStr for Secret {
    type Err = ();

    fn from_str(digits: &str) -> Result<Self, ()> {
        let mut bytes = [0; 32];
        if digits.len() != 64 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(());
        }
        for (byte, at) in bytes.iter_mut().zip((0..64).step_by(2)) {
            *byte = u8::from_str_radix(&digits[at..at + 2], 16).map_err(|_| ())?;
        }
        Ok(Self(bytes))
    }
}

/// The value of a header that occurs exactly once.
fn single<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok()?;
    if values.next().is_some() { None } else { Some(value) }
}

/// Compares in constant time.
fn is_same(guess: &str, secret: &str) -> bool {
    let differences = guess.bytes().zip(secret.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
    guess.len() == secret.len() && differences == 0
}

/// The secret in a file, or a new one that is written to it, if the folder is the user's own and private. A file that
/// others could have written or read, a link, or a file with other contents is replaced.
fn kept_secret(path: &Path) -> Result<Secret, String> {
    let new = Secret::new()?;
    let Some(folder) = path.parent() else { return Ok(new) };
    // Our own file, mode 0600: its owner is the current user, and it replaces the existing file without following
    // links.
    let Ok(mut file) = tempfile::Builder::new().prefix(".lumbre-view").tempfile_in(folder) else {
        return Ok(new);
    };
    let Ok(own) = file.as_file().metadata() else { return Ok(new) };
    if !fs::symlink_metadata(folder).is_ok_and(|meta| meta.is_dir() && is_private(&meta, &own)) {
        return Ok(new);
    }
    // Nobody else can change the folder's contents, so the file is still the same when it is opened.
    let is_ours = |meta: fs::Metadata| meta.is_file() && is_private(&meta, &own);
    if fs::symlink_metadata(path).is_ok_and(is_ours) {
        let mut text = String::new();
        let read = fs::File::open(path).and_then(|file| file.take(65).read_to_string(&mut text));
        if let (Ok(_), Ok(kept)) = (read, text.parse()) {
            return Ok(kept);
        }
    }
    // If it cannot be kept, the page must be opened again after a restart.
    if file.write_all(new.digits().as_bytes()).is_ok() {
        let _ = file.persist(path);
    }
    Ok(new)
}

/// Whether this belongs to the same user as `own`, and no one else may read or write it.
#[cfg(unix)]
fn is_private(meta: &fs::Metadata, own: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    meta.uid() == own.uid() && meta.mode() & 0o077 == 0
}

/// Not supported on other systems.
#[cfg(not(unix))]
fn is_private(_: &fs::Metadata, _: &fs::Metadata) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard() -> Guard {
        Guard::new("127.0.0.1:7777".parse().unwrap(), &[], None, 2).unwrap()
    }

    /// A page's answer to a challenge, from this secret: its random number, and its proof.
    fn hello(key: &Secret, challenge: &Secret) -> (Secret, String) {
        let page = Secret::new().unwrap();
        let proof = key.proof(b"page", challenge, &page).digits();
        (page, proof)
    }

    #[test]
    fn a_token_works_once_and_the_session_always() {
        let guard = guard();
        let token: Secret = guard.paths().next().unwrap().strip_prefix("/#").unwrap().parse().unwrap();
        let challenge = Secret::new().unwrap();
        for wrong in [Secret([0; 32]), challenge.clone(), Secret::new().unwrap()] {
            let (page, proof) = hello(&wrong, &challenge);
            assert!(guard.admit(&challenge, &page.digits(), &proof).is_none());
        }
        let (nonces, proofs) = (challenge.digits(), token.digits());
        for (nonce, proof) in [("", ""), ("00", ""), (&*nonces, &*proofs)] {
            assert!(guard.admit(&challenge, nonce, proof).is_none());
        }
        let (page, proof) = hello(&token, &challenge);
        let welcome = guard.admit(&challenge, &page.digits(), &proof).expect("it is the token");
        assert_eq!(welcome.proof, token.proof(b"viewer", &challenge, &page).digits());
        assert!(guard.admit(&challenge, &page.digits(), &proof).is_none(), "a second time");
        assert_eq!(guard.paths().next().unwrap(), "/");
        assert_eq!(welcome.access, Access::Edit);
        let session: Secret = welcome.session.expect("the session").parse().unwrap();
        for _ in 0..3 {
            let challenge = Secret::new().unwrap();
            let (page, proof) = hello(&session, &challenge);
            let welcome = guard.admit(&challenge, &page.digits(), &proof).expect("it is the session");
            assert_eq!(welcome.proof, session.proof(b"viewer", &challenge, &page).digits());
            assert!(welcome.session.is_none(), "it is said once");
            // An overheard proof answers no other challenge.
            assert!(guard.admit(&Secret::new().unwrap(), &page.digits(), &proof).is_none());
        }
    }

    #[test]
    fn each_watcher_has_a_token_and_a_session_of_its_own() {
        let guard = guard();
        let tokens: Vec<Secret> =
            guard.paths().map(|path| path.strip_prefix("/#").unwrap().parse().unwrap()).collect();
        assert_eq!(tokens.len(), 3);
        let admit = |key: &Secret| {
            let challenge = Secret::new().unwrap();
            let (page, proof) = hello(key, &challenge);
            guard.admit(&challenge, &page.digits(), &proof)
        };
        let mut sessions = Vec::new();
        for (token, access) in tokens.iter().zip([Access::Edit, Access::Watch, Access::Watch]) {
            let welcome = admit(token).unwrap();
            assert_eq!(welcome.access, access);
            assert!(admit(token).is_none(), "a second time");
            let session: Secret = welcome.session.unwrap().parse().unwrap();
            let again = admit(&session).unwrap();
            assert_eq!((again.access, again.session), (access, None), "the session keeps its access");
            assert!(!sessions.contains(&session.digits()));
            sessions.push(session.digits());
        }
    }

    #[test]
    fn a_ticket_is_for_one_errand_once() {
        let guard = guard();
        let errand = Errand::Picture { format: crate::message::FileFormat::Exr };
        let address = guard.ticket(errand.clone()).unwrap();
        let ticket = address.strip_prefix("/ticket/").unwrap();
        assert!(guard.redeem("").is_none() && guard.redeem(&ticket[1..]).is_none());
        assert_eq!(guard.redeem(ticket), Some(errand));
        assert_eq!(guard.redeem(ticket), None);
        let first = guard.ticket(Errand::Scene {}).unwrap();
        for _ in 0..MAX_TICKETS {
            guard.ticket(Errand::Scene {}).unwrap();
        }
        assert_eq!(guard.redeem(first.strip_prefix("/ticket/").unwrap()), None, "they are not kept for ever");
    }

    #[cfg(unix)]
    #[test]
    fn a_session_outlives_the_viewer_in_a_file_of_the_users_own() {
        use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let set = |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
        set(folder.path(), 0o700);
        let path = folder.path().join("session");
        let first = kept_secret(&path).unwrap();
        assert!(kept_secret(&path).unwrap() == first);
        let meta = fs::symlink_metadata(&path).unwrap();
        assert_eq!((meta.mode() & 0o777, meta.is_file()), (0o600, true));
        set(&path, 0o644);
        let second = kept_secret(&path).unwrap();
        assert!(second != first, "others could have read it");
        // A link is not followed: neither read, nor written through.
        let elsewhere = folder.path().join("elsewhere");
        fs::rename(&path, &elsewhere).unwrap();
        symlink(&elsewhere, &path).unwrap();
        assert!(kept_secret(&path).unwrap() != second, "it is not in this place");
        assert_eq!(fs::read_to_string(&elsewhere).unwrap(), second.digits());
        assert!(fs::symlink_metadata(&path).unwrap().is_file());
        for broken in ["short", &"x".repeat(64), &"0".repeat(65)] {
            fs::write(&path, broken).unwrap();
            assert!(kept_secret(&path).unwrap() == fs::read_to_string(&path).unwrap().parse().unwrap());
        }
        // In a folder that others can write, or through a link, nothing is kept.
        let kept = kept_secret(&path).unwrap();
        let link = folder.path().join("link");
        symlink(folder.path(), &link).unwrap();
        assert!(kept_secret(&link.join("session")).unwrap() != kept);
        set(folder.path(), 0o755);
        assert!(kept_secret(&path).unwrap() != kept);
        set(folder.path(), 0o700);
        assert!(kept_secret(&path).unwrap() == kept);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "no temporary file is left");
    }
}
