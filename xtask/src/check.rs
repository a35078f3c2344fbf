//! The quick check between edits: format, lints, and the tests of the packages that changed.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};
use xtask::command::{self, root};

/// What to test.
#[derive(Debug, PartialEq, Eq)]
enum Changed {
    Everything,
    Packages(BTreeSet<String>),
}

/// Checks the format and the lints of everything, and tests the packages with changes since `since`.
pub(crate) fn run(since: Option<&str>) -> Result<()> {
    command::run("cargo", &["fmt", "--all", "--check"])?;
    command::run("cargo", &["clippy", "--workspace", "--all-targets", "--", "--deny", "warnings"])?;
    let mut files = git(&["diff", "--name-only", since.unwrap_or("HEAD")])?;
    files.extend(git(&["ls-files", "--others", "--exclude-standard"])?);
    let tests: Vec<String> = match packages_of(files.iter().map(String::as_str)) {
        Changed::Everything => vec!["--workspace".to_owned()],
        Changed::Packages(packages) if packages.is_empty() => {
            eprintln!(
                "\nNo package has changed, so no test runs. --since REVISION also takes what is committed since."
            );
            return Ok(());
        }
        Changed::Packages(packages) => {
            packages.into_iter().flat_map(|package| ["--package".to_owned(), package]).collect()
        }
    };
    let tests = tests.iter().map(String::as_str);
    command::run("cargo", &["test", "--all-targets"].into_iter().chain(tests).collect::<Vec<_>>())
}

/// The packages that have one of these files, by the folders of the workspace.
fn packages_of<'f>(files: impl IntoIterator<Item = &'f str>) -> Changed {
    let mut packages = BTreeSet::new();
    for file in files {
        let mut folders = Path::new(file).iter().filter_map(|folder| folder.to_str());
        match (folders.next(), folders.next()) {
            (Some("Cargo.toml" | "Cargo.lock"), None) => return Changed::Everything,
            (Some("crates"), Some(name)) => drop(packages.insert(name.to_owned())),
            (Some("xtask"), _) => drop(packages.insert("xtask".to_owned())),
            _ => {}
        }
    }
    Changed::Packages(packages)
}

/// The lines that git answers.
fn git(arguments: &[&str]) -> Result<Vec<String>> {
    let output =
        Command::new("git").args(arguments).current_dir(root()).output().context("cannot start git")?;
    if !output.status.success() {
        bail!("git {} failed: {}", arguments.join(" "), String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_belong_to_packages() {
        let files = ["crates/lumbre-math/src/lib.rs", "docs/models.md", "xtask/src/main.rs", "README.md"];
        let expected = ["lumbre-math", "xtask"].map(str::to_owned).into();
        assert_eq!(packages_of(files), Changed::Packages(expected));
        assert_eq!(packages_of(["docs/models.md"]), Changed::Packages(BTreeSet::new()));
        assert_eq!(packages_of(["Cargo.lock", "crates/lumbre-math/src/lib.rs"]), Changed::Everything);
    }
}
