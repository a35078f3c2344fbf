//! What the viewer answers, and what it refuses.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod client;
mod files;
mod hostile;
mod picture;
mod protocol;
