//! Scene, mesh and image files, read and written.
//!
//! Every reader takes a [`Budget`], which it consults before any allocation whose size the input chose, and a
//! [`Diagnostics`], which collects its warnings. Its errors are [`FormatError`]s with a place.

pub mod atomic;
pub mod budget;
mod contained;
pub mod diagnostic;
pub mod gltf;
pub mod ies;
pub mod image;
pub mod input;
pub mod obj;
pub mod open;
pub mod pbrt;
pub mod ply;
mod polygon;
pub mod stl;

pub use atomic::{atomic_write, probe_writable};
pub use budget::{Budget, BudgetVec, Hold, LimitError, LimitKind, Limits};
pub use diagnostic::{Diagnostic, Diagnostics, FormatError, Place, Position, Severity, Strictness};
pub use input::Input;
pub use open::{ReadOptions, open_scene, open_scenes};
