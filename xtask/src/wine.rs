//! The program's tests as on Windows: compiled by MinGW-w64, run by Wine.

use std::process::Command;

use anyhow::{Context, Result};
use xtask::command::{root, run_command, succeeds, target};

use crate::dist::Target;

/// The packages whose tests meet files, folders, terminals and processes.
const PACKAGES: [&str; 2] = ["lumbre-formats", "lumbre-cli"];

/// Runs them where Wine, MinGW-w64 and a standard library of Rust for Windows are found; else says what is missing.
pub(crate) fn test() -> Result<()> {
    if !succeeds("wine", &["--version"]) {
        eprintln!("\nWindows is left out: it needs Wine (apt-get install wine wine64)");
        return Ok(());
    }
    let mut cargo = match Target::windows().cargo("test", None) {
        Ok(cargo) => cargo,
        Err(lacks) => {
            eprintln!("\nWindows is left out: {lacks}");
            return Ok(());
        }
    };
    let prefix = target().join("wine");
    std::fs::create_dir_all(&prefix).with_context(|| format!("cannot make {}", prefix.display()))?;
    let environment =
        [("WINEPREFIX", prefix.to_string_lossy().into_owned()), ("WINEDEBUG", "-all".to_owned())];
    // Tests name files of the repository without a drive: temporary folders are to be on the same one.
    for name in ["TEMP", "TMP"] {
        let add = ["reg", "add", r"HKCU\Environment", "/v", name, "/t", "REG_SZ", "/d", r"Z:\tmp", "/f"];
        run_command(Command::new("wine").args(add).envs(environment.clone()))?;
    }
    let library = prefix.join("drive_c/windows/system32/bcryptprimitives.dll");
    if !library.exists() {
        let mut compiler = Command::new("x86_64-w64-mingw32-gcc");
        compiler.args(["-shared", "-o"]).arg(&library).arg(root().join("xtask/src/wine/bcryptprimitives.c"));
        run_command(compiler.arg("-ladvapi32"))?;
    }
    cargo
        .envs(environment)
        .env("CARGO_TARGET_X86_64_PC_WINDOWS_GNU_RUNNER", "wine")
        .args(["--profile", "trial"]);
    cargo.args(PACKAGES.iter().flat_map(|name| ["--package", name]));
    run_command(&mut cargo)
}
