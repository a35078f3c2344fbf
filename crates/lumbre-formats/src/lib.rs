#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Every reader takes a [`Budget`], which it consults before any allocation whose size the input chose, and a
//! [`Diagnostics`], which collects its warnings. Its errors are [`FormatError`]s with a place.

pub mod atomic;
pub mod budget;
mod bytes;
mod contained;
mod devices;
pub mod diagnostic;
pub mod gltf;
mod held;
pub mod ies;
pub mod image;
pub mod input;
pub mod input_stream;
pub mod measured;
pub mod nanovdb;
pub mod obj;
pub mod open;
mod origin;
#[allow(unreachable_pub, reason = "its modules are being split")]
pub mod pbrt;
pub mod ply;
mod polygon;
pub mod pov;
mod standing;
pub mod stl;
mod thin;
mod unseen;

pub use atomic::{abandon_writes, atomic_write, atomic_write_seek, probe_writable};
pub use budget::{Budget, BudgetVec, Hold, LimitError, LimitKind, Limits};
pub use devices::is_device_name;
pub use diagnostic::{Diagnostic, Diagnostics, FormatError, Place, Position, Severity, Strictness};
pub use held::HeldFiles;
pub use input::{Input, open_regular};
pub use input_stream::InputStream;
pub use open::{ReadOptions, SceneFormat, check_scene_file, open_scene, open_scenes};
pub use thin::Thin;
