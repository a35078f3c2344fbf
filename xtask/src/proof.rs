//! What is too long, or asks too much of the toolchain, to run before every change.

use anyhow::Result;
use clap::ValueEnum;
use xtask::command::run_with;

/// What can be proved by numbers.
#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Claim {
    /// No ray passes between the triangles of closed meshes.
    Leaks,
    /// Trees answer as a loop over everything does.
    Loop,
}

/// Runs the ignored test of a claim, optimised.
pub(crate) fn run_proof(claim: Claim, rays: Option<u64>, seed: u64) -> Result<()> {
    let (test, usual) = match claim {
        Claim::Leaks => ("proof_that_no_aimed_ray_leaks", 1_000_000_000),
        Claim::Loop => ("proof_that_trees_answer_as_a_loop", 10_000_000),
    };
    let (rays, seed) = (rays.unwrap_or(usual).to_string(), seed.to_string());
    let arguments =
        ["test", "--release", "--package", "lumbre-kernel", "--lib", "--", "--ignored", "--nocapture", test];
    run_with("cargo", &arguments, &[("LUMBRE_PROOF_RAYS", &rays), ("LUMBRE_PROOF_SEED", &seed)])
}

/// A little of everything in an interpreter that sees undefined behaviour.
pub(crate) fn miri() -> Result<()> {
    let arguments =
        ["+nightly", "miri", "test", "--package", "lumbre-kernel", "--lib", "--", "tests::small", "stack::"];
    // The queues below rayon turn integers into pointers, and keep the rules of tree borrows but not those of stacked
    // ones.
    let flags =
        "-Zmiri-tree-borrows -Zmiri-permissive-provenance -Zmiri-ignore-leaks -Zmiri-disable-isolation";
    run_with("cargo", &arguments, &[("MIRIFLAGS", flags), ("RAYON_NUM_THREADS", "1")])
}

/// Everything with every access to memory checked; optimised code stays as it is, SIMD included.
pub(crate) fn asan() -> Result<()> {
    let target =
        if cfg!(target_arch = "aarch64") { "aarch64-unknown-linux-gnu" } else { "x86_64-unknown-linux-gnu" };
    let arguments = [
        "+nightly",
        "test",
        "--target",
        target,
        "--package",
        "lumbre-kernel",
        "--lib",
        "--",
        "--skip",
        "million",
    ];
    run_with("cargo", &arguments, &[("RUSTFLAGS", "-Zsanitizer=address")])
}
