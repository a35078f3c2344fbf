//! Fuzzing of the readers, target by target.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use xtask::command::{self, root, succeeds};

/// The version of cargo-fuzz that is installed where there is none.
const CARGO_FUZZ: &str = "cargo-fuzz@0.13.2";
/// Files that are longer say nothing that shorter ones cannot.
const LONGEST: u32 = 65_536;
/// The longest file of a corpus that is kept in the repository.
const LONGEST_KEPT: u32 = 1_024;

/// What is fuzzed.
#[derive(Args)]
pub(crate) struct Fuzz {
    /// Minutes for all targets together.
    minutes: f64,
    /// Only these targets, separated by commas: the names of files in fuzz/fuzz_targets without fuzz_.
    #[arg(long, value_delimiter = ',')]
    targets: Vec<String>,
    /// Afterwards, reduce the corpora in the repository to the fewest short files that reach all that is reached.
    #[arg(long)]
    minimise: bool,
}

impl Fuzz {
    /// Runs every target in turn. A file that breaks one is kept in fuzz/regressions, where the tests find it.
    pub(crate) fn run(&self) -> Result<()> {
        if !succeeds("cargo", &["+nightly", "--version"]) {
            bail!("fuzzing needs a nightly compiler: rustup toolchain install nightly --profile minimal");
        }
        let tools = root().join("target").join("tools");
        if !succeeds("cargo", &["fuzz", "--version"]) && !tools.join("bin").join("cargo-fuzz").exists() {
            let tools = tools.to_string_lossy();
            command::run("cargo", &["install", "--locked", "--root", &tools, CARGO_FUZZ])?;
        }
        let path = std::env::var_os("PATH").unwrap_or_default();
        let path = std::env::join_paths(std::env::split_paths(&path).chain([tools.join("bin")]))?;
        let path = path.to_string_lossy().into_owned();
        let environment = [("PATH", path.as_str())];
        let known = targets()?;
        if let Some(unknown) = self.targets.iter().find(|target| !known.contains(target)) {
            bail!("there is no target {unknown} (expected some of {})", known.join(", "));
        }
        let chosen = if self.targets.is_empty() { &known } else { &self.targets };
        command::run_with("cargo", &["+nightly", "fuzz", "build"], &environment)?;
        let seconds = (60.0 * self.minutes / chosen.len() as f64).ceil().max(1.0) as u64;
        let mut broken = Vec::new();
        for target in chosen {
            let folder = |name: &str| root().join("fuzz").join(name).join(target);
            let (found, kept, regressions) =
                (root().join("target").join("fuzz").join(target), folder("corpus"), folder("regressions"));
            for folder in [&found, &kept, &regressions] {
                fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
            }
            let run = |first: &[&Path], options: &[String]| {
                let program = format!("fuzz_{target}");
                let folders: Vec<String> =
                    first.iter().map(|folder| folder.to_string_lossy().into_owned()).collect();
                let mut arguments = vec!["+nightly", "fuzz", "run", &program];
                arguments.extend(folders.iter().map(String::as_str));
                arguments.push("--");
                arguments.extend(options.iter().map(String::as_str));
                command::run_with("cargo", &arguments, &environment)
            };
            let limits = ["-timeout=10".to_owned(), "-rss_limit_mb=2048".to_owned()];
            let options = [
                format!("-max_total_time={seconds}"),
                format!("-max_len={LONGEST}"),
                format!("-artifact_prefix={}/", regressions.display()),
                "-print_final_stats=1".to_owned(),
            ];
            if run(&[&found, &kept], &[&limits[..], &options].concat()).is_err() {
                broken.push(regressions.clone());
            } else if self.minimise {
                let fewest = root().join("target").join("fuzz").join(format!("{target}.fewest"));
                let _ = fs::remove_dir_all(&fewest);
                fs::create_dir_all(&fewest)?;
                let merge = ["-merge=1".to_owned(), format!("-max_len={LONGEST_KEPT}")];
                run(&[&fewest, &found, &kept], &[&limits[..], &merge].concat())?;
                fs::remove_dir_all(&kept)?;
                fs::rename(&fewest, &kept)?;
            }
            // Only what broke something is kept there.
            let _ = fs::remove_dir(&regressions);
        }
        if !broken.is_empty() {
            let folders: Vec<String> = broken.iter().map(|folder| folder.display().to_string()).collect();
            bail!(
                "readers broke; what broke them, which the tests try from now on, is in {}",
                folders.join(", ")
            );
        }
        Ok(())
    }
}

/// The names of all targets, sorted.
fn targets() -> Result<Vec<String>> {
    let folder: PathBuf = root().join("fuzz").join("fuzz_targets");
    let mut names = Vec::new();
    for file in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
        let name = file?.file_name().to_string_lossy().into_owned();
        names.extend(name.strip_prefix("fuzz_").and_then(|n| n.strip_suffix(".rs")).map(str::to_owned));
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_is_built_under_the_name_of_its_file() {
        let manifest = fs::read_to_string(root().join("fuzz").join("Cargo.toml")).unwrap();
        let targets = targets().unwrap();
        assert!(targets.len() >= 12, "{targets:?}");
        for target in targets {
            let wanted = format!("name = \"fuzz_{target}\"\npath = \"fuzz_targets/fuzz_{target}.rs\"");
            assert!(manifest.contains(&wanted), "{target}");
        }
    }
}
