//! What the viewer answers, and what it refuses.

mod client;
mod files;
mod hostile;
mod picture;
