//! What artefacts are made with, in a virtual environment of Python under `target`: maturin, cargo-zigbuild and Zig's
//! linker; and archives and sums by Python itself.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use xtask::command::{self, run, succeeds, target};

/// What is installed, of versions that go together.
const PACKAGES: [&str; 3] = ["maturin>=1.16,<2", "cargo-zigbuild>=0.24,<0.25", "ziglang>=0.17,<0.18"];
/// Whether an interpreter makes environments.
const IS_FIT: &str = "import venv, ensurepip";
/// Sums of the files of a folder, as `sha256sum` writes and checks them.
const SUMS: &str = "\
import hashlib, pathlib, sys
for path in sorted(pathlib.Path(sys.argv[1]).iterdir()):
    if path.name != 'SHA256SUMS':
        print(hashlib.sha256(path.read_bytes()).hexdigest() + '  ' + path.name)";

/// The environment.
#[derive(Debug)]
pub(crate) struct Tools {
    environment: PathBuf,
}

impl Tools {
    /// Makes the environment where there is none, or says what that needs.
    pub(super) fn find() -> Result<Result<Self, String>> {
        let tools = Self { environment: target().join("dist-tools") };
        let has_all = ["maturin", "cargo-zigbuild"]
            .iter()
            .all(|name| tools.command(name).arg("--version").output().is_ok_and(|out| out.status.success()));
        if has_all {
            return Ok(Ok(tools));
        }
        let system = ["python3", "python"].into_iter().find(|python| succeeds(python, &["-c", IS_FIT]));
        let Some(system) = system else {
            let lacks = "the tools need Python 3 with venv (apt-get install python3-venv)";
            return Ok(Err(lacks.to_owned()));
        };
        run(system, &["-m", "venv", &tools.environment.to_string_lossy()])?;
        run(&tools.python(), &[&["-m", "pip", "install", "--quiet"], &PACKAGES[..]].concat())?;
        Ok(Ok(tools))
    }

    /// Where its programs are.
    pub(super) fn folder(&self) -> PathBuf {
        self.environment.join(if cfg!(windows) { "Scripts" } else { "bin" })
    }

    /// One of its programs.
    pub(super) fn command(&self, name: &str) -> Command {
        Command::new(self.folder().join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
    }

    fn python(&self) -> String {
        let name = format!("python{}", std::env::consts::EXE_SUFFIX);
        self.folder().join(name).to_string_lossy().into_owned()
    }

    /// The licence of a library that is linked from Zig's package or is also in it, by its path below `lib`.
    pub(super) fn licence(&self, path: &str) -> Result<String> {
        let zig = command::output(&self.python(), &["-c", "import ziglang; print(ziglang.__path__[0])"])?;
        let path = Path::new(zig.trim()).join("lib").join(path);
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    }

    /// Packs a folder with its name, by the ending of the archive.
    pub(super) fn pack(&self, folder: &Path, archive: &Path) -> Result<()> {
        let module =
            if archive.extension().is_some_and(|ending| ending == "zip") { "zipfile" } else { "tarfile" };
        if archive.exists() {
            fs::remove_file(archive)?;
        }
        let (parent, name) = (folder.parent().context("no parent")?, folder.file_name().context("no name")?);
        let mut command = Command::new(self.python());
        command.args(["-m", module, "-c"]).arg(archive).arg(name).current_dir(parent);
        let status = command.status().context("cannot start Python")?;
        anyhow::ensure!(status.success(), "cannot write {}", archive.display());
        Ok(())
    }

    /// Writes the SHA-256 sums of all files into the folder, and returns them.
    pub(super) fn sums(&self, folder: &Path) -> Result<String> {
        let sums = command::output(&self.python(), &["-c", SUMS, &folder.to_string_lossy()])?;
        fs::write(folder.join("SHA256SUMS"), &sums)?;
        Ok(sums)
    }
}
