//! The test command: everything that must hold before a change lands.

use anyhow::Result;
use xtask::command::{self, root, run_with, succeeds};

use crate::{arm, book, bytes, page, proof, python, web, wine};

/// The version of cargo-deny that the gate was written for.
const CARGO_DENY: &str = "0.20.2";

/// Runs it all, cheapest first, and stops at the first failure.
pub(crate) fn run() -> Result<()> {
    for component in ["rustfmt", "clippy"] {
        let subcommand = if component == "rustfmt" { "fmt" } else { component };
        if !succeeds("cargo", &[subcommand, "--version"]) {
            command::run("rustup", &["component", "add", component])?;
        }
    }
    command::run("cargo", &["fmt", "--all", "--check"])?;
    command::run("cargo", &["clippy", "--workspace", "--all-targets", "--", "--deny", "warnings"])?;
    command::run("cargo", &["test", "--workspace", "--all-targets"])?;
    page::run()?;
    web::check()?;
    book::test()?;
    bytes::test(&[])?;
    arm::test()?;
    command::run("cargo", &["test", "--workspace", "--doc"])?;
    python::test()?;
    run_with("cargo", &["doc", "--workspace", "--no-deps"], &[("RUSTDOCFLAGS", "--deny warnings")])?;
    oldest_compiler()?;
    package()?;
    deny()
}

/// What every change must pass, and what only a release has the time for.
pub(crate) fn run_all() -> Result<()> {
    run()?;
    // Ignored tests that check nothing: some write the tables that are compiled in, some print measurements.
    let skipped = ["make_the_table", "measure_reading", "errors_and_times_of_fast_sums"];
    let skips = skipped.iter().flat_map(|name| ["--skip", name]);
    let ignored = ["test", "--workspace", "--release", "--", "--ignored"].into_iter().chain(skips);
    command::run("cargo", &ignored.collect::<Vec<_>>())?;
    // What `run` does a part of.
    run_with("cargo", &["test", "--workspace", "--release"], &[("LUMBRE_LONG_TESTS", "1")])?;
    command::run("cargo", &["publish", "--workspace", "--dry-run"])?;
    arm::test_all()?;
    wine::test()?;
    if succeeds("cargo", &["+nightly", "miri", "--version"]) {
        proof::miri()?;
        proof::asan()
    } else {
        eprintln!(
            "\nMiri and the address sanitizer are left out: rustup toolchain install nightly --component miri,rust-src"
        );
        Ok(())
    }
}

/// The declared minimum Rust version compiles everything, where that toolchain is installed. Clippy's
/// `incompatible_msrv` finds what is newer in the standard library without it.
fn oldest_compiler() -> Result<()> {
    let version = env!("CARGO_PKG_RUST_VERSION");
    if succeeds("rustup", &["run", version, "cargo", "--version"]) {
        return command::run("rustup", &["run", version, "cargo", "check", "--workspace", "--all-targets"]);
    }
    eprintln!("\nRust {version} is left out: rustup toolchain install {version} --profile minimal");
    Ok(())
}

/// Every crate that is published makes a package. The packages are not compiled, which would take as long as all the
/// tests.
fn package() -> Result<()> {
    let arguments = [
        "package",
        "--workspace",
        "--exclude",
        "xtask",
        "--exclude",
        "lumbre-dev",
        "--exclude",
        "lumbre-python",
        "--exclude",
        "lumbre-web",
    ];
    command::run("cargo", &[&arguments[..], &["--no-verify", "--allow-dirty", "--quiet"]].concat())
}

/// Licences, sources and bans of every dependency.
fn deny() -> Result<()> {
    let check = ["check", "licenses", "bans", "sources"];
    if succeeds("cargo", &["deny", "--version"]) {
        return command::run("cargo", &[&["deny"], &check[..]].concat());
    }
    let tools = root().join("target").join("tools");
    let tools_argument = tools.to_string_lossy().into_owned();
    let program = tools.join("bin").join("cargo-deny");
    let program = program.to_string_lossy().into_owned();
    if !succeeds(&program, &["--version"]) {
        let version = format!("cargo-deny@{CARGO_DENY}");
        // Unoptimised: it runs for two seconds, and compiles in a third of the time.
        command::run("cargo", &["install", "--locked", "--debug", "--root", &tools_argument, &version])?;
    }
    command::run(&program, &check)
}
