//! Running other programs from the root of the workspace.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

/// The root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").to_owned()
}

/// Runs a program at the root and fails when it does.
pub fn run(program: &str, arguments: &[&str]) -> Result<()> {
    run_with(program, arguments, &[])
}

/// The same with environment variables.
pub fn run_with(program: &str, arguments: &[&str], environment: &[(&str, &str)]) -> Result<()> {
    eprintln!("\n$ {program} {}", arguments.join(" "));
    let status = Command::new(program)
        .args(arguments)
        .envs(environment.iter().copied())
        .current_dir(root())
        .status()
        .with_context(|| format!("cannot start {program}"))?;
    if !status.success() {
        bail!("{program} {} failed: {status}", arguments.join(" "));
    }
    Ok(())
}

/// Runs a command as it is, and fails when it does.
pub fn run_command(command: &mut Command) -> Result<()> {
    eprintln!("\n$ {command:?}");
    let status = command.status().with_context(|| format!("cannot start {command:?}"))?;
    if !status.success() {
        bail!("{command:?} failed: {status}");
    }
    Ok(())
}

/// Whether a program starts and ends well, without showing what it says.
pub fn succeeds(program: &str, arguments: &[&str]) -> bool {
    Command::new(program).args(arguments).current_dir(root()).output().is_ok_and(|out| out.status.success())
}

/// What a program prints, which runs at the root; an error when it fails, with what it says then.
pub fn output(program: &str, arguments: &[&str]) -> Result<String> {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(root())
        .output()
        .with_context(|| format!("cannot start {program}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        bail!("{program} {} failed: {}", arguments.join(" "), said.trim());
    }
    String::from_utf8(output.stdout).with_context(|| format!("{program} prints no text"))
}

/// How cargo builds what is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// As for tests.
    Dev,
    /// As for users.
    Release,
}

/// Builds a program of the package `lumbre-dev` and runs it in the user's folder, so that relative paths mean what they
/// say. Where it fails it has said why, and this program ends as it did.
pub fn run_ours(name: &str, profile: Profile, arguments: &[String]) -> Result<()> {
    let program = program("lumbre-dev", name, profile)?;
    let status = Command::new(&program)
        .args(arguments)
        .status()
        .with_context(|| format!("cannot start {}", program.display()))?;
    if status.success() { Ok(()) } else { std::process::exit(status.code().unwrap_or(1)) }
}

/// Builds Lumbre's program and says where it lies.
pub fn release_program() -> Result<PathBuf> {
    program("lumbre-cli", "lumbre", Profile::Release)
}

/// Where cargo puts what it builds.
pub fn target() -> PathBuf {
    root().join(std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// Builds all that the tests build, by the same features, so that nothing is compiled a second time, and says where it
/// lies.
pub fn built_as_for_tests() -> Result<PathBuf> {
    run("cargo", &["build", "--workspace"])?;
    Ok(target().join("debug"))
}

/// Builds all that the tests build and says where Lumbre's program lies.
pub fn tested_program() -> Result<PathBuf> {
    Ok(built_as_for_tests()?.join(format!("lumbre{}", std::env::consts::EXE_SUFFIX)))
}

/// Builds the program of this name in one of our packages and says where it lies.
fn program(package: &str, name: &str, profile: Profile) -> Result<PathBuf> {
    let target = target();
    let build = ["build", "--package", package, "--bin", name];
    let folder = match profile {
        Profile::Dev => {
            run("cargo", &build)?;
            "debug"
        }
        Profile::Release => {
            run("cargo", &[&build[..], &["--release"]].concat())?;
            "release"
        }
    };
    Ok(target.join(folder).join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
}
