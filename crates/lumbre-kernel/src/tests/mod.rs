//! What the kernel promises, against a loop over everything.

mod blocks;
mod borders;
mod boxes;
mod build;
mod deforming;
mod file;
mod hulls;
mod inside;
mod motion;
mod nearest;
mod opening;
mod options;
mod oracle;
mod pairs;
mod parts;
mod precise;
mod proof;
mod refit;
mod save;
pub(crate) mod scenes;
mod single;
mod small;
mod spheres;
mod surfaces;
mod watertight;
mod wide;
mod winding;
