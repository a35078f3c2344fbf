//! Who may talk to the viewer: exact lists of hosts and origins, a token that works once, and the cookie that it becomes.

use std::io::Write;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use hyper::HeaderMap;
use hyper::header::{COOKIE, HOST, HeaderName, ORIGIN};

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The `Host` is not one of ours.
    Host,
    /// The `Origin`, or what the browser says of where the request comes from.
    Origin,
    /// There is no cookie of this viewer.
    Session,
}

/// The secrets and the names of a viewer.
#[derive(Debug)]
pub(crate) struct Guard {
    hosts: Vec<String>,
    cookie_name: String,
    session: String,
    token: String,
    token_is_used: AtomicBool,
}

const FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

impl Guard {
    /// That of a viewer at an address, with other names under which it may be reached, as `name:port`, and the file in which the secret
    /// of the session outlives it.
    ///
    /// # Errors
    /// Where the system gives no random bytes.
    pub(crate) fn new(
        address: SocketAddr,
        more_hosts: &[String],
        session_file: Option<&Path>,
    ) -> Result<Self, String> {
        let port = address.port();
        let mut hosts = vec![address.to_string()];
        if address.ip().is_loopback() {
            hosts.push(format!("localhost:{port}"));
        }
        hosts.extend(more_hosts.iter().map(|host| host.to_ascii_lowercase()));
        // Browsers do not tell the cookies of two ports of one host apart.
        let cookie_name = format!("lumbre-{port}");
        let session = match session_file {
            Some(path) => kept_secret(path)?,
            None => secret()?,
        };
        let token = secret()?;
        Ok(Self { hosts, cookie_name, session, token, token_is_used: AtomicBool::new(false) })
    }

    /// The path that opens the viewer, once.
    pub(crate) fn path(&self) -> String {
        format!("/open/{}", self.token)
    }

    /// Takes the token; whether it is the right one, and was not taken before.
    pub(crate) fn take(&self, token: &str) -> bool {
        is_same(token, &self.token) && !self.token_is_used.swap(true, Ordering::SeqCst)
    }

    /// The header that makes the browser one of ours.
    pub(crate) fn set_cookie(&self) -> String {
        format!("{}={}; Path=/; HttpOnly; SameSite=Strict", self.cookie_name, self.session)
    }

    /// Whether a request is for this host: against names that are made to point here.
    pub(crate) fn check_host(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        match single(headers, &HOST) {
            Some(host) if self.hosts.iter().any(|known| known == host) => Ok(()),
            _ => Err(Refusal::Host),
        }
    }

    /// Whether a request comes from our page, or from no page at all. What changes something, or opens a socket, must say so.
    pub(crate) fn check_origin(&self, headers: &HeaderMap, must_say: bool) -> Result<(), Refusal> {
        let host = single(headers, &HOST).ok_or(Refusal::Host)?;
        match single(headers, &ORIGIN) {
            Some(origin) if origin.strip_prefix("http://") == Some(host) => {}
            None if !must_say && !headers.contains_key(ORIGIN) => {}
            _ => return Err(Refusal::Origin),
        }
        match headers.get(FETCH_SITE).map(|site| site.as_bytes()) {
            None | Some(b"same-origin" | b"none") => Ok(()),
            _ => Err(Refusal::Origin),
        }
    }

    /// Whether a request has our cookie.
    pub(crate) fn check_session(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let cookies = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
        let pairs = cookies.flat_map(|text| text.split(';')).filter_map(|pair| pair.trim().split_once('='));
        let mut ours = pairs.filter(|(name, _)| *name == self.cookie_name);
        if ours.any(|(_, value)| is_same(value, &self.session)) { Ok(()) } else { Err(Refusal::Session) }
    }
}

/// The value of a header that stands once.
fn single<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok()?;
    if values.next().is_some() { None } else { Some(value) }
}

/// Compares in a time that does not tell how much of a guess is right.
fn is_same(guess: &str, secret: &str) -> bool {
    let differences = guess.bytes().zip(secret.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
    guess.len() == secret.len() && differences == 0
}

/// The secret that a file keeps, or a new one that it keeps from now on. A file that others could have written, or that holds
/// something else, is replaced.
fn kept_secret(path: &Path) -> Result<String, String> {
    let kept = std::fs::symlink_metadata(path)
        .ok()
        .filter(is_private)
        .and_then(|_| std::fs::read_to_string(path).ok());
    if let Some(kept) =
        kept.filter(|text| text.len() == SECRET_DIGITS && text.bytes().all(|b| b.is_ascii_hexdigit()))
    {
        return Ok(kept);
    }
    let new = secret()?;
    // Where it cannot be kept, the page is opened anew after a restart.
    let _ = std::fs::remove_file(path);
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let _ = options.open(path).and_then(|mut file| file.write_all(new.as_bytes()));
    Ok(new)
}

/// Whether it is a file that no one else may read or write.
fn is_private(meta: &std::fs::Metadata) -> bool {
    #[cfg(unix)]
    let is_own = std::os::unix::fs::PermissionsExt::mode(&meta.permissions()) & 0o077 == 0;
    #[cfg(not(unix))]
    let is_own = true;
    meta.is_file() && is_own
}

const SECRET_DIGITS: usize = 32;

/// 128 random bits as hexadecimal digits.
fn secret() -> Result<String, String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|e| format!("the system gives no random numbers: {e}"))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_works_once_and_a_wrong_one_never() {
        let guard = Guard::new("127.0.0.1:7777".parse().unwrap(), &[], None).unwrap();
        let token = guard.path().strip_prefix("/open/").unwrap().to_owned();
        assert_eq!(token.len(), 32);
        assert!(!guard.take("") && !guard.take(&token[1..]) && !guard.take(&token.replace(|_| true, "0")));
        assert!(guard.take(&token));
        assert!(!guard.take(&token));
    }

    #[test]
    fn a_session_outlives_the_viewer_in_a_file_of_ones_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("session");
        let first = kept_secret(&path).unwrap();
        assert_eq!(kept_secret(&path).unwrap(), first);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
            let second = kept_secret(&path).unwrap();
            assert_ne!(second, first, "others could have read it");
            std::fs::rename(&path, folder.path().join("elsewhere")).unwrap();
            std::os::unix::fs::symlink(folder.path().join("elsewhere"), &path).unwrap();
            assert_ne!(kept_secret(&path).unwrap(), second, "it is not in this place");
        }
        std::fs::write(&path, "short").unwrap();
        assert_eq!(kept_secret(&path).unwrap().len(), SECRET_DIGITS);
    }
}
