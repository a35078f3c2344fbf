//! Pictures against closed forms and against themselves, in one binary, which links once.

mod caustics;
mod common;
mod cutouts;
mod determinism;
mod direct_light;
mod furnace;
mod ground;
mod integrators;
mod interiors;
mod journal;
mod media;
mod motion;
mod panes;
mod parts;
mod shading_normals;
mod spectral;
mod subsurface;
mod terminator;
