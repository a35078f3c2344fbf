//! The tests on another architecture: compiled for aarch64, and run by an emulator.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;
use xtask::command::{root, run_with, succeeds, target};

use crate::bytes;

const TARGET: &str = "aarch64-unknown-linux-gnu";
const LINKER: &str = "aarch64-linux-gnu-gcc";
const EMULATOR: &str = "qemu-aarch64";
/// Where the linker's package puts the libraries of the system that programs start with.
const LIBRARIES: &str = "/usr/aarch64-linux-gnu";
/// What is tested: all that a picture is made of.
const PACKAGES: [&str; 5] =
    ["lumbre-simd", "lumbre-geometry", "lumbre-kernel", "lumbre-shading", "lumbre-render"];

/// A compiler for the target.
struct Tools {
    cargo: PathBuf,
    rustc: PathBuf,
    /// Whether its standard library is compiled from its sources first.
    builds_std: bool,
}

/// The operations on lanes, whose test takes seconds. Where the tools are missing it is left out, and that is said.
pub(crate) fn test() -> Result<()> {
    match Tools::find() {
        Some(tools) => tools.cargo(&["test", "--package", "lumbre-simd", "--lib", "--tests"]),
        None => Ok(()),
    }
}

/// All tests of all that a picture is made of, but for those of millions of rays; and the program beside this machine's, by
/// `cargo xtask bytes`.
pub(crate) fn test_all() -> Result<()> {
    let Some(tools) = Tools::find() else { return Ok(()) };
    let packages = PACKAGES.iter().flat_map(|package| ["--package", package]);
    let test = ["test", "--lib", "--tests"].into_iter().chain(packages).chain(["--", "--skip", "million"]);
    tools.cargo(&test.collect::<Vec<_>>())?;
    tools.cargo(&["build", "--workspace", "--bin", "lumbre"])?;
    let program = folder().join(TARGET).join("debug").join("lumbre");
    bytes::test(&[format!("aarch64={} {}", emulator(), program.display())])
}

/// Where all this is compiled: what this machine runs of it, such as build scripts, may be of another compiler than all else.
fn folder() -> PathBuf {
    target().join("arm")
}

fn emulator() -> String {
    format!("{EMULATOR} -L {LIBRARIES}")
}

impl Tools {
    /// Those that are found; else what is to be installed is said.
    fn find() -> Option<Self> {
        if cfg!(target_arch = "aarch64") {
            return None;
        }
        let compilers = [("cargo", "rustc"), ("/usr/bin/cargo", "/usr/bin/rustc")];
        let mut tools = compilers.into_iter().filter_map(|(cargo, rustc)| Self::of(cargo, rustc));
        let are_there = succeeds(LINKER, &["--version"])
            && succeeds(EMULATOR, &["--version"])
            && Path::new(LIBRARIES).is_dir();
        if let (true, Some(tools)) = (are_there, tools.next()) {
            return Some(tools);
        }
        eprintln!(
            "\nThe tests on ARM are left out: rustup target add {TARGET}, \
             apt-get install gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user"
        );
        None
    }

    /// Of this compiler, where it has the target's standard library, or its sources and leave to compile them.
    fn of(cargo: &str, rustc: &str) -> Option<Self> {
        let library = PathBuf::from(said(rustc, &["--print", "target-libdir", "--target", TARGET])?);
        let sysroot = PathBuf::from(said(rustc, &["--print", "sysroot"])?);
        let sources = sysroot.join("lib/rustlib/src/rust/library/std/Cargo.toml");
        let builds_std = !library.is_dir();
        if !succeeds(cargo, &["--version"]) || (builds_std && !sources.is_file()) {
            return None;
        }
        Some(Self { cargo: cargo.into(), rustc: rustc.into(), builds_std })
    }

    fn cargo(&self, arguments: &[&str]) -> Result<()> {
        let (folder, rustc) = (folder(), self.rustc.to_string_lossy());
        let mut environment = vec![
            ("RUSTC", &*rustc),
            ("CARGO_TARGET_DIR", folder.to_str().unwrap_or("target/arm")),
            ("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER", LINKER),
        ];
        let runner = emulator();
        environment.push(("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER", &runner));
        let mut all = vec![arguments[0], "--target", TARGET];
        if self.builds_std {
            all.push("-Zbuild-std");
            environment.push(("RUSTC_BOOTSTRAP", "1"));
        }
        all.extend(&arguments[1..]);
        run_with(&self.cargo.to_string_lossy(), &all, &environment)
    }
}

/// What a program prints, without the line's end; `None` where it fails.
fn said(program: &str, arguments: &[&str]) -> Option<String> {
    let out = Command::new(program).args(arguments).current_dir(root()).output().ok()?;
    out.status.success().then(|| String::from_utf8_lossy(&out.stdout).trim_end().to_owned())
}
