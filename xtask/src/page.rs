//! The viewer's page: what is built of it is up to date, and it does in a browser what it says.

use std::path::PathBuf;

use anyhow::Result;
use xtask::command::{self, run_with, succeeds};

/// Where its sources are.
const FOLDER: &str = "crates/lumbre-viewer/web";

/// Checks the page as far as there is what it needs, and says what is left out.
pub(crate) fn run() -> Result<()> {
    let install = ["ci", "--prefix", FOLDER, "--ignore-scripts", "--no-audit", "--no-fund"];
    if !succeeds("npm", &["--version"]) || !succeeds("node", &["--version"]) {
        eprintln!(
            "\nThe viewer's page is left out: it needs Node.js and npm (Debian: apt-get install nodejs npm)"
        );
        return Ok(());
    }
    if !succeeds("npm", &install) {
        eprintln!("\nThe viewer's page is left out: npm {} fails", install.join(" "));
        return Ok(());
    }
    command::run("npm", &["run", "--prefix", FOLDER, "check"])?;
    let Some(browser) = browser() else {
        eprintln!("\nThe viewer's page is not tried: it needs Chromium (Debian: apt-get install chromium)");
        return Ok(());
    };
    let program = command::tested_program()?;
    let (program, browser) = (program.to_string_lossy(), browser.to_string_lossy());
    let test = format!("{FOLDER}/tests/run.mjs");
    run_with("node", &[&test], &[("LUMBRE", &program), ("CHROMIUM", &browser)])
}

/// Chromium, as `CHROMIUM` names it, or as it is found on the path.
pub(crate) fn browser() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("CHROMIUM") {
        return Some(named.into());
    }
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let mut found = names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    found.find(|program| program.is_file())
}
