//! What the project runs on itself: `cargo xtask test`, `cargo xtask scenes`, `cargo xtask bench …`.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Parser, Subcommand};

mod agree;
mod assets;
mod bench;
mod command;
mod contact;
mod field;
mod pictures;
mod proof;
mod suite;

#[derive(Parser)]
#[command(name = "cargo xtask", about = "What the project runs on itself")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Everything that must hold before a change lands: format, lint, unit, contract and doc tests, docs, licences.
    /// Installs what it needs.
    Test,
    /// Renders every scene under scenes/ to the picture beside it.
    Scenes {
        /// Only scenes whose path contains this.
        filter: Option<String>,
    },
    /// Writes the meshes, textures and environments that scenes/ are made of.
    Assets,
    /// Renders every glTF below a folder, small, and joins the pictures with their names to one PNG.
    Contact {
        /// The folder; by default that of the sample models, where it lies beside the workspace.
        folder: Option<PathBuf>,
        /// The sheet; by default docs/gltf-models.png.
        #[arg(short, long)]
        output: Option<PathBuf>,
        /// Pictures in a row.
        #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
        columns: u32,
        /// Samples a pixel.
        #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
        spp: u32,
    },
    /// Prints the field of exact shapes of scenes/field as a pbrt scene.
    Field,
    /// Compares a picture with a reference of the same scene: means, and each pixel by its noise.
    Agree(agree::Agree),
    /// Proves the kernel by numbers, more of them than the tests have: `leaks` sends rays at edges and vertices of closed
    /// meshes, `loop` compares trees with a loop over everything.
    Proof {
        /// What is to be shown.
        what: proof::Claim,
        /// How many rays; by default a billion for leaks, ten million for the loop.
        #[arg(long)]
        rays: Option<u64>,
        /// Other rays for every seed, so that a long proof can be had in parts.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Runs a small set of the kernel's tests, on its portable path, in the interpreter Miri. Needs a nightly toolchain with
    /// the components miri and rust-src.
    Miri,
    /// Runs the kernel's tests, with every instruction set that the machine has, under the address sanitizer. Needs a nightly
    /// toolchain.
    Asan,
    /// Measures Lumbre, against peers where they are found.
    #[command(subcommand)]
    Bench(bench::Bench),
}

fn main() -> Result<()> {
    match Arguments::parse().task {
        Task::Test => suite::run(),
        Task::Scenes { filter } => pictures::render_all(filter.as_deref()),
        Task::Assets => assets::write(),
        Task::Contact { folder, output, columns, spp } => {
            contact::sheet(folder.as_deref(), output.as_deref(), columns, spp)
        }
        Task::Field => {
            print!("{}", field::scene());
            Ok(())
        }
        Task::Agree(what) => agree::run_comparison(&what),
        Task::Proof { what, rays, seed } => proof::run_proof(what, rays, seed),
        Task::Miri => proof::miri(),
        Task::Asan => proof::asan(),
        Task::Bench(bench) => bench.run(),
    }
}
