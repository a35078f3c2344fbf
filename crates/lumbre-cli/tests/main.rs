//! The program as its users run it, in one binary, which links once.

mod animations;
mod broken_inputs;
mod cast_streams;
mod cast_vectors;
mod denoising;
mod explain;
mod farm;
mod faults;
mod files;
mod film;
mod habits;
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod instruction_sets;
mod limits;
mod malformed;
mod math;
mod messages;
mod pages;
mod parts;
mod platforms;
mod program;
mod slurm;
mod spectral;
mod stops;
mod targets;
mod topics;
mod viewers;
