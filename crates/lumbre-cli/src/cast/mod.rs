//! `lumbre cast`: what rays hit.

mod answers;
mod array;
mod bytes;
#[cfg(not(target_family = "wasm"))]
mod command;
mod csv;
mod npy;
#[cfg(not(target_family = "wasm"))]
mod output;
#[cfg(not(target_family = "wasm"))]
mod pipeline;
mod query;
mod rays;

#[cfg(not(target_family = "wasm"))]
pub(crate) use command::{Arguments, run};
pub use query::{Query, cast};
