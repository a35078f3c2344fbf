#![doc = include_str!("../README.md")]

#[cfg(target_family = "wasm")]
mod page;
mod problem;
mod session;

pub use problem::{Problem, ProblemKind};
pub use session::{Explained, Pass, Session, Wanted, calculate};
