//! What the project runs on itself: `cargo xtask test`, `cargo xtask scenes`, `cargo xtask bench …`.

use std::io::{self, Write};

use anyhow::Result;
use clap::{Args, Parser, Subcommand};
use xtask::command::{self, Profile};

mod arm;
mod bench;
mod book;
mod bytes;
mod check;
mod dist;
mod field;
mod files;
mod fuzz;
mod page;
mod pictures;
mod povray;
mod proof;
mod python;
mod race;
mod suite;
mod web;
mod wine;

#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", about = "What the project runs on itself")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Everything that must hold before a change lands: format, lint, unit, contract and doc tests, docs, licences.
    /// Installs what it needs.
    Test {
        /// Also what takes hours, and is due before a release: the longest tests, the proofs, Miri, the address
        /// sanitizer, and every package compiled alone, and the program's as on Windows, under Wine. Missing tools are
        /// named.
        #[arg(long)]
        all: bool,
    },
    /// What is worth knowing between two edits: format, lints, and the tests of the packages with changes that are not
    /// committed.
    Check {
        /// Also the packages that changed since this revision.
        #[arg(long, value_name = "REVISION")]
        since: Option<String>,
    },
    /// The tests of the Python package alone, where Python is found.
    Python,
    /// Builds the book of docs/ into target/book/html: renders its pictures, runs its examples, and tries its links.
    Book(book::Book),
    /// The same bytes anywhere: hashes of pictures, answers, results and explanations, by instruction sets and
    /// programs.
    Bytes(bytes::Bytes),
    /// Makes what is handed out into target/dist: the program for each platform, wheels, a Debian package, one of npm,
    /// the book, a list of what they are made of, and sums. What cannot be made on this machine is named, with what it
    /// lacks.
    Dist(dist::Dist),
    /// Lumbre for the browser: makes the npm package and the playground in target/web, and tries both. Says what it
    /// needs where that is missing.
    Web(web::Web),
    /// Renders every scene under scenes/ to the picture next to it.
    Scenes {
        /// Only scenes whose path contains this.
        filter: Option<String>,
    },
    /// Writes the meshes, textures and environments that scenes/ are made of.
    #[command(disable_help_flag = true)]
    Assets(PassedOn),
    /// Renders every glTF below a folder, small, and joins the pictures with their names to one PNG: `contact --help`.
    #[command(disable_help_flag = true)]
    Contact(PassedOn),
    /// Prints the field of exact shapes of scenes/field as a pbrt scene.
    Field,
    /// Compares a picture with a reference of the same scene, means, and each pixel by its noise: `agree --help`.
    #[command(disable_help_flag = true)]
    Agree(PassedOn),
    /// Walks the example scenes of POV-Ray, where they and povray are installed: which are read, without a warning, and
    /// which agree with POV-Ray's picture. The program is the one that `LUMBRE_PROGRAM` names, if any.
    Povray(povray::Corpus),
    /// Proves the kernel by numbers, more of them than the tests have: `leaks` sends rays at edges and vertices of
    /// closed meshes, `loop` compares trees with a loop over everything.
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
    /// Runs a small set of the kernel's tests, on its portable path, in the interpreter Miri. Needs a nightly toolchain
    /// with the components miri and rust-src.
    Miri,
    /// Runs the kernel's tests, with every instruction set that the machine has, under the address sanitizer. Needs a
    /// nightly toolchain.
    Asan,
    /// Damages files of every kind at random, target by target, and keeps what breaks a reader. Needs a nightly
    /// toolchain.
    Fuzz(fuzz::Fuzz),
    /// Measures Lumbre, against peers where they are found.
    #[command(subcommand)]
    Bench(bench::Bench),
}

/// Arguments for a program of the workspace that links Lumbre, so that this one, which the first check waits for, need
/// not.
#[derive(Args)]
struct PassedOn {
    /// Its arguments.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl PassedOn {
    fn hand_to_pictures(self, task: &str) -> Result<()> {
        let arguments: Vec<String> = std::iter::once(task.to_owned()).chain(self.arguments).collect();
        command::run_ours("lumbre-pictures", Profile::Dev, &arguments)
    }
}

fn main() -> Result<()> {
    match Arguments::parse().task {
        Task::Test { all: false } => suite::run(),
        Task::Test { all: true } => suite::run_all(),
        Task::Check { since } => check::run(since.as_deref()),
        Task::Python => python::test(),
        Task::Book(book) => book.run(),
        Task::Bytes(bytes) => bytes.run(),
        Task::Dist(dist) => dist.run(),
        Task::Web(wanted) => web::make(&wanted),
        Task::Scenes { filter } => pictures::render_all(filter.as_deref()),
        Task::Assets(passed) => passed.hand_to_pictures("assets"),
        Task::Contact(passed) => passed.hand_to_pictures("contact"),
        Task::Field => match io::stdout().write_all(field::scene().as_bytes()) {
            // Who reads it has read enough.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            written => Ok(written?),
        },
        Task::Agree(passed) => passed.hand_to_pictures("agree"),
        Task::Povray(corpus) => corpus.run(),
        Task::Proof { what, rays, seed } => proof::run_proof(what, rays, seed),
        Task::Miri => proof::miri(),
        Task::Asan => proof::asan(),
        Task::Fuzz(fuzz) => fuzz.run(),
        Task::Bench(bench) => bench.run(),
    }
}
