#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! # Where a frame travels
//!
//! A page sends what it wants (`message.rs`). The session bumps a version and cancels stale work (`session.rs`). One
//! worker thread, helped by all cores, moves the camera, rebuilds or reads again, and renders from coarse to fine
//! (`worker.rs`). A frame is encoded once for all pages (`frame.rs`). Each socket sends the latest frame when its page
//! has shown the one before; frames in between are never sent (`socket.rs`).

mod base64;
mod camera;
mod export;
mod frame;
mod guard;
mod message;
mod page;
mod rate;
mod server;
mod session;
mod socket;
mod source;
mod stage;
mod viewer;
mod visitors;
mod watching;
mod worker;

pub use base64::base64;
pub use export::export;
pub use source::{Built, Explain, Moment, Read, Source, SourceError};
pub use viewer::{Closer, Options, Viewer};
