//! Pictures that the project makes for itself, and of itself: `cargo xtask assets`, `cargo xtask contact`, `cargo xtask
//! agree`.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Parser, Subcommand};

mod agree;
mod assets;
mod contact;

#[derive(Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    about = "Pictures that the project makes for itself, and of itself"
)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Writes the meshes, textures and environments that scenes/ are made of.
    Assets,
    /// Renders every glTF below a folder, small, and joins the pictures with their names to one PNG.
    Contact {
        /// The folder; by default that of the sample models, if it is next to the workspace.
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
    /// Compares a picture with a reference of the same scene: means, and each pixel by its noise.
    Agree(agree::Agree),
}

fn main() -> Result<()> {
    match Arguments::parse().task {
        Task::Assets => assets::write(),
        Task::Contact { folder, output, columns, spp } => {
            contact::sheet(folder.as_deref(), output.as_deref(), columns, spp)
        }
        Task::Agree(what) => agree::run_comparison(&what),
    }
}
