//! The page: files that are built from `web/src` and are part of the program.

/// A file of the page.
#[derive(Clone, Copy, Debug)]
pub(crate) struct File {
    /// Its path on the server.
    pub path: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// What it holds.
    pub bytes: &'static [u8],
}

/// All files.
pub(crate) const FILES: [File; 4] = [
    File { path: "/", kind: "text/html; charset=utf-8", bytes: include_bytes!("../web/dist/index.html") },
    File {
        path: "/viewer.js",
        kind: "text/javascript; charset=utf-8",
        bytes: include_bytes!("../web/dist/viewer.js"),
    },
    File {
        path: "/viewer.css",
        kind: "text/css; charset=utf-8",
        bytes: include_bytes!("../web/dist/viewer.css"),
    },
    File { path: "/icon.svg", kind: "image/svg+xml", bytes: include_bytes!("../web/dist/icon.svg") },
];

/// What the page may load: files of this server, and pictures that it makes itself.
pub(crate) const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
     frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What an explanation may: be in a frame of ours, have styles, run the one script that has this hash, and nothing
/// else. It is of no origin.
pub(crate) fn explanation_policy(script: Option<&str>) -> String {
    let runs = script.map(|hash| format!("script-src '{hash}'; ")).unwrap_or_default();
    format!(
        "default-src 'none'; {runs}style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'; sandbox allow-scripts"
    )
}
