#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]

mod base64;
mod bundle;
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
mod tree;
mod viewer;
mod visitors;
mod watching;
mod worker;

pub use base64::base64;
pub use export::export;
pub use source::{Built, Explain, Moment, Read, Source, SourceError};
pub use tree::Hidden;
pub use viewer::{Closer, Options, Viewer};
