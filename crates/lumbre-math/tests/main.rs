//! Tests through the interface, in one binary, which links once.

mod any_number;
mod errata;
mod vectors;
