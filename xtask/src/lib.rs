//! What tasks of the project have in common.

pub mod command;
