//! The tests on another architecture: compiled for aarch64, and run by an emulator.

use std::path::Path;
use std::process::Command;

use anyhow::Result;
use xtask::command::{run_command, succeeds, target};

use crate::bytes;
use crate::dist::Target;

const LINKER: &str = "aarch64-linux-gnu-gcc";
const EMULATOR: &str = "qemu-aarch64";
/// Where the linker's package puts the libraries of the system that programs start with.
const LIBRARIES: &str = "/usr/aarch64-linux-gnu";
/// What is tested: all that a picture is made of.
const PACKAGES: [&str; 5] =
    ["lumbre-simd", "lumbre-geometry", "lumbre-kernel", "lumbre-shading", "lumbre-render"];

/// The operations on lanes, whose test takes seconds. Where the tools are missing it is left out, and that is said.
pub(crate) fn test() -> Result<()> {
    match cargo("test") {
        Some(mut cargo) => run_command(cargo.args(["--package", "lumbre-simd", "--lib", "--tests"])),
        None => Ok(()),
    }
}

/// All tests of all that a picture is made of, but for those of millions of rays; and the program beside this
/// machine's, by `cargo xtask bytes`.
pub(crate) fn test_all() -> Result<()> {
    let (Some(mut tests), Some(mut program)) = (cargo("test"), cargo("build")) else { return Ok(()) };
    let packages = PACKAGES.iter().flat_map(|package| ["--package", package]);
    run_command(tests.args(["--lib", "--tests"]).args(packages).args(["--", "--skip", "million"]))?;
    run_command(program.args(["--workspace", "--bin", "lumbre"]))?;
    let program = target().join(Target::aarch64().triple).join("debug").join("lumbre");
    bytes::test(&[format!("aarch64={} {}", emulator(), program.display())])
}

fn emulator() -> String {
    format!("{EMULATOR} -L {LIBRARIES}")
}

/// A command of cargo for the target, whose programs the emulator runs; where something is missing that is said.
fn cargo(subcommand: &str) -> Option<Command> {
    if cfg!(target_arch = "aarch64") {
        return None;
    }
    let are_there = succeeds(LINKER, &["--version"])
        && succeeds(EMULATOR, &["--version"])
        && Path::new(LIBRARIES).is_dir();
    let cargo = if are_there {
        Target::aarch64().cargo(subcommand, None)
    } else {
        Err("apt-get install gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user".to_owned())
    };
    match cargo {
        Ok(mut cargo) => {
            cargo.env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER", LINKER);
            cargo.env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER", emulator());
            Some(cargo)
        }
        Err(lacks) => {
            eprintln!("\nThe tests on ARM are left out: {lacks}");
            None
        }
    }
}
